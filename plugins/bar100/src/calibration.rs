//! Conversion of a Bar100's counts to pressure. Range and pressure mode come from the sensor's memory or the
//! vehicle file.

use headrace_sensor::geometry::math;
use serde::{Deserialize, Serialize};

use crate::codec::MemoryWord;

/// Memory cell with the calibration date and pressure mode.
pub const CELL_SCALING0: u8 = 0x12;
/// Memory cells with the lower limit of the pressure range: high and low word of a float.
pub const CELLS_P_MIN: [u8; 2] = [0x13, 0x14];
/// Memory cells with the upper limit of the pressure range: high and low word of a float.
pub const CELLS_P_MAX: [u8; 2] = [0x15, 0x16];
/// All memory cells of the calibration.
pub const CALIBRATION_CELLS: [u8; 5] = [0x12, 0x13, 0x14, 0x15, 0x16];

/// One standard atmosphere: the default ambient pressure of a vented sensor.
pub const STANDARD_ATMOSPHERE_BAR: f64 = 1.013_25;

const COUNTS_AT_P_MIN: f64 = 16_384.0;
const COUNTS_OF_SPAN: f64 = 32_768.0;
const PA_PER_BAR: f64 = 1.0e5;

/// Reference of a sensor's pressure.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PressureMode {
    /// Mode PR: the pressure is relative to ambient air, which enters through a vent.
    Vented,
    /// Mode PA: the pressure is relative to a sealed reference of one bar.
    Sealed,
    /// PAA: relative to vacuum.
    Absolute,
}

/// Content of memory cell 0x12: calibration date and pressure mode.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Scaling0 {
    /// Year of calibration, 2010 to 2041.
    pub year: u16,
    /// Month, 1 to 12 (0 to 15 on the wire).
    pub month: u8,
    /// Day, 1 to 31 (0 to 31 on the wire).
    pub day: u8,
    /// Pressure mode, as on the wire: 0 PR, 1 PA, 2 PAA, 3 undefined.
    pub mode: u8,
}

/// A sensor's range and pressure mode, both checked.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Calibration {
    mode: PressureMode,
    p_min_bar: f64,
    p_max_bar: f64,
}

/// Reason why counts can't be converted to pressure.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum CalibrationError {
    /// The sensor's memory has an undefined pressure mode.
    #[error("reading cell 0x12: pressure mode {0}; defined are 0 (PR), 1 (PA) and 2 (PAA)")]
    Mode(u8),
    /// The limits of the pressure range are not finite, or not in increasing order.
    #[error(
        "reading the pressure limits: {p_min_bar} to {p_max_bar} bar; both must be finite, the second larger"
    )]
    Limits {
        /// Lower limit of the pressure range, bar.
        p_min_bar: f64,
        /// Upper limit of the pressure range, bar.
        p_max_bar: f64,
    },
}

impl PressureMode {
    /// Converts the two mode bits of memory cell 0x12 to a pressure mode.
    ///
    /// Errors: a mode of 3 or more. Such a mode must not be replaced by a guess, because a wrong mode shifts the depth
    /// by ten metres.
    pub fn from_wire(mode: u8) -> Result<Self, CalibrationError> {
        match mode {
            0 => Ok(Self::Vented),
            1 => Ok(Self::Sealed),
            2 => Ok(Self::Absolute),
            _ => Err(CalibrationError::Mode(mode)),
        }
    }

    /// Returns the two mode bits of memory cell 0x12.
    pub fn to_wire(self) -> u8 {
        match self {
            Self::Vented => 0,
            Self::Sealed => 1,
            Self::Absolute => 2,
        }
    }

    fn offset_bar(self, ambient_bar: f64) -> f64 {
        match self {
            Self::Vented => ambient_bar,
            Self::Sealed => 1.0,
            Self::Absolute => 0.0,
        }
    }
}

impl Scaling0 {
    /// Unpacks the word of memory cell 0x12.
    #[expect(clippy::cast_possible_truncation, reason = "each field is masked to less than a byte")]
    pub fn from_word(word: u16) -> Self {
        let bits = |shift: u16, mask: u16| (word >> shift) & mask;
        Self {
            year: 2010 + bits(11, 0x1F),
            month: bits(7, 0x0F) as u8,
            day: bits(2, 0x1F) as u8,
            mode: bits(0, 0x03) as u8,
        }
    }

    /// Packs date and mode into the word of memory cell 0x12. Each field is truncated to its number of bits.
    pub fn to_word(self) -> u16 {
        (self.year.saturating_sub(2010) & 0x1F) << 11
            | (u16::from(self.month) & 0x0F) << 7
            | (u16::from(self.day) & 0x1F) << 2
            | u16::from(self.mode) & 0x03
    }
}

impl Calibration {
    /// Creates a calibration from limits in bar, relative to the mode's reference.
    ///
    /// Errors: limits that aren't finite, or not increasing.
    pub fn new(mode: PressureMode, p_min_bar: f64, p_max_bar: f64) -> Result<Self, CalibrationError> {
        if !(p_min_bar.is_finite() && p_max_bar.is_finite() && p_max_bar > p_min_bar) {
            return Err(CalibrationError::Limits { p_min_bar, p_max_bar });
        }
        Ok(Self { mode, p_min_bar, p_max_bar })
    }

    /// Converts raw pressure counts to absolute pressure, Pa. A vented sensor uses `ambient_bar`, the pressure of the
    /// ambient air.
    pub fn pressure_pa(&self, counts: u16, ambient_bar: f64) -> f64 {
        let above_bar =
            (f64::from(counts) - COUNTS_AT_P_MIN) * (self.p_max_bar - self.p_min_bar) / COUNTS_OF_SPAN;
        (above_bar + self.p_min_bar + self.mode.offset_bar(ambient_bar)) * PA_PER_BAR
    }

    /// Counts nearest to an absolute pressure, clamped to the wire's range (1 to 65535).
    pub fn counts(&self, pressure_pa: f64, ambient_bar: f64) -> u16 {
        let above_bar = pressure_pa / PA_PER_BAR - self.mode.offset_bar(ambient_bar) - self.p_min_bar;
        let counts = above_bar * COUNTS_OF_SPAN / (self.p_max_bar - self.p_min_bar) + COUNTS_AT_P_MIN;
        u16::try_from(math::round_to_i64(counts).max(1)).unwrap_or(u16::MAX)
    }

    /// Pressure difference that one count stands for, Pa.
    pub fn resolution_pa(&self) -> f64 {
        (self.p_max_bar - self.p_min_bar) / COUNTS_OF_SPAN * PA_PER_BAR
    }

    /// Addresses and words of the five memory cells of this calibration. `date` is the date of calibration; its `mode`
    /// is ignored.
    #[expect(clippy::cast_possible_truncation, reason = "the memory holds single precision")]
    pub fn to_words(&self, date: Scaling0) -> [(u8, u16); 5] {
        let halves = |limit_bar: f64| {
            let bits = (limit_bar as f32).to_bits();
            [(bits >> 16) as u16, (bits & 0xFFFF) as u16]
        };
        let [min_high, min_low] = halves(self.p_min_bar);
        let [max_high, max_low] = halves(self.p_max_bar);
        [
            (CELL_SCALING0, Scaling0 { mode: self.mode.to_wire(), ..date }.to_word()),
            (CELLS_P_MIN[0], min_high),
            (CELLS_P_MIN[1], min_low),
            (CELLS_P_MAX[0], max_high),
            (CELLS_P_MAX[1], max_low),
        ]
    }
}

/// Values of the vehicle file that override the sensor's memory. They are needed for a log that begins during a dive,
/// because such a log lacks the memory's content.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Overrides {
    /// Lower limit of the pressure range, bar.
    pub p_min_bar: Option<f64>,
    /// Upper limit of the pressure range, bar.
    pub p_max_bar: Option<f64>,
    /// Pressure mode of the sensor.
    pub mode: Option<PressureMode>,
}

/// Memory cells of the calibration that have been read so far.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct CalibrationCells {
    scaling0: Option<u16>,
    p_min: [Option<u16>; 2],
    p_max: [Option<u16>; 2],
}

impl CalibrationCells {
    /// Stores a word of the calibration. Words of other cells are ignored.
    pub fn note(&mut self, word: &MemoryWord) {
        let [p_min_high, p_min_low] = &mut self.p_min;
        let [p_max_high, p_max_low] = &mut self.p_max;
        let cell = match word.cell {
            CELL_SCALING0 => &mut self.scaling0,
            cell if cell == CELLS_P_MIN[0] => p_min_high,
            cell if cell == CELLS_P_MIN[1] => p_min_low,
            cell if cell == CELLS_P_MAX[0] => p_max_high,
            cell if cell == CELLS_P_MAX[1] => p_max_low,
            _ => return,
        };
        *cell = Some(word.word);
    }

    /// The calibration; `None` until every part of it is known. `overrides` take precedence over the memory.
    ///
    /// Errors: an undefined mode, or impossible limits.
    pub fn calibration(&self, overrides: &Overrides) -> Result<Option<Calibration>, CalibrationError> {
        let mode = match (overrides.mode, self.scaling0) {
            (Some(mode), _) => mode,
            (None, Some(word)) => PressureMode::from_wire(Scaling0::from_word(word).mode)?,
            (None, None) => return Ok(None),
        };
        let p_min_bar = overrides.p_min_bar.or_else(|| limit_bar(self.p_min));
        let p_max_bar = overrides.p_max_bar.or_else(|| limit_bar(self.p_max));
        match (p_min_bar, p_max_bar) {
            (Some(p_min_bar), Some(p_max_bar)) => Calibration::new(mode, p_min_bar, p_max_bar).map(Some),
            _ => Ok(None),
        }
    }
}

fn limit_bar(halves: [Option<u16>; 2]) -> Option<f64> {
    let [high, low] = halves;
    Some(f64::from(f32::from_bits(u32::from(high?) << 16 | u32::from(low?))))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::codec::{Status, Transaction};

    fn noted(transactions: &[[u8; 4]]) -> CalibrationCells {
        let mut cells = CalibrationCells::default();
        for bytes in transactions {
            match Transaction::decode(bytes) {
                Ok(Transaction::Memory(word)) => cells.note(&word),
                other => panic!("{other:?}"),
            }
        }
        cells
    }

    const READ: [[u8; 4]; 5] = [
        [0x12, 0x40, 0x5B, 0x3D],
        [0x13, 0x40, 0x00, 0x00],
        [0x14, 0x40, 0x00, 0x00],
        [0x15, 0x40, 0x42, 0xC8],
        [0x16, 0x40, 0x00, 0x00],
    ];

    #[test]
    fn worked_example_1_gives_date_mode_and_limits() {
        let scaling0 = Scaling0 { year: 2021, month: 6, day: 15, mode: 1 };
        assert_eq!(Scaling0::from_word(0x5B3D), scaling0);
        assert_eq!(scaling0.to_word(), 0x5B3D);
        let calibration = noted(&READ).calibration(&Overrides::default()).unwrap();
        assert_eq!(calibration, Calibration::new(PressureMode::Sealed, 0.0, 100.0).ok());
    }

    #[test]
    fn worked_examples_2_to_4_give_pressure_and_depth() {
        let calibration = Calibration::new(PressureMode::Sealed, 0.0, 100.0).unwrap();
        for (counts, bar, depth_m) in
            [(16_388, 1.01221, -0.011), (17_990, 5.90112, 49.992), (26_000, 30.34570, 300.008)]
        {
            let pa = calibration.pressure_pa(counts, STANDARD_ATMOSPHERE_BAR);
            assert!((pa / 1e5 - bar).abs() < 5e-6, "{pa} Pa");
            let depth = (pa - 101_325.0) / (997.0 * 9.806_65);
            assert!((depth - depth_m).abs() < 5e-4, "{depth} m");
            assert_eq!(calibration.counts(pa, STANDARD_ATMOSPHERE_BAR), counts);
        }
        assert!((calibration.resolution_pa() - 305.175_781_25).abs() < 1e-9);
    }

    #[test]
    fn pressure_mode_shifts_the_pressure() {
        let pa = |mode| Calibration::new(mode, 0.0, 100.0).unwrap().pressure_pa(16_384, 0.95);
        assert!((pa(PressureMode::Vented) - 95_000.0).abs() < 1e-9);
        assert!((pa(PressureMode::Sealed) - 100_000.0).abs() < 1e-9);
        assert!(pa(PressureMode::Absolute).abs() < 1e-9);
    }

    #[test]
    fn undefined_mode_and_impossible_limits_are_refused() {
        let mut read = READ;
        read[0][3] = 0x3F;
        let cells = noted(&read);
        assert_eq!(cells.calibration(&Overrides::default()), Err(CalibrationError::Mode(3)));
        let mode = Some(PressureMode::Absolute);
        assert!(cells.calibration(&Overrides { mode, ..Overrides::default() }).unwrap().is_some());
        read[3] = [0x15, 0x40, 0x7F, 0xC0];
        assert!(matches!(
            noted(&read).calibration(&Overrides { mode, ..Overrides::default() }),
            Err(CalibrationError::Limits { .. })
        ));
    }

    #[test]
    fn memory_words_round_trip() {
        let calibration = Calibration::new(PressureMode::Absolute, -1.0, 350.5).unwrap();
        let mut cells = CalibrationCells::default();
        for (cell, word) in calibration.to_words(Scaling0::from_word(0x5B3D)) {
            assert_eq!(cells.calibration(&Overrides::default()), Ok(None));
            cells.note(&MemoryWord { cell, status: Status::IDLE, word });
        }
        assert_eq!(cells.calibration(&Overrides::default()), Ok(Some(calibration)));
    }
}
