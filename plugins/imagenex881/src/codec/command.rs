//! The switch data command: 27 bytes that carry the head's settings and request one ping.
//!
//! Source: Imagenex 881A serial interface, switch data command.

use headrace_sensor::codec::{Framed, Framing, Verdict};
use headrace_sensor::geometry::math;

/// Length of a switch command, bytes.
pub const COMMAND_BYTES: usize = 27;

/// Range settings for profiling, m.
pub const RANGES_M: [u8; 13] = [1, 2, 3, 4, 5, 10, 20, 30, 40, 50, 60, 80, 100];

const HEADER: [u8; 2] = [0xFE, 0x44];
/// Byte that terminates a command. It must not occur elsewhere in the command.
const TERMINATOR: u8 = 0xFD;
/// Bits set in the mode byte of a command: transmit (bit 0), send data (bit 1), slave (bit 6).
const SLAVE: u8 = 0x43;
const REVERSE: u8 = 0x40;
/// Reply rate code for 115200 baud. No other code is known.
const UP_BAUD: u8 = 0x06;
const STEP_CODES: [u8; 6] = [0, 1, 2, 3, 4, 8];

/// Number of echo points in a return.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Points {
    /// Nominally 250 points. A return with 8-bit points (`IMX`) has 252.
    P250,
    /// 500 points (`IGX`).
    P500,
}

/// Settings of one command, in physical units. Encoding rounds each to the nearest code.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Command {
    /// Address of the head on the line; 0x10 by default. Not 0xFD.
    pub head_id: u8,
    /// Range setting, m: one of [`RANGES_M`].
    pub range_m: u8,
    /// Whether the head reverses its stepping direction at this command.
    pub reverse: bool,
    /// Gain at the start of the ping, 0 to 40 dB.
    pub start_gain_db: f64,
    /// Slope of the time-varied gain: 10, 20, 30 or 40 dB per decade of range.
    pub logf_db: f64,
    /// Absorption that the gain compensates, 0 to 2.55 dB/m but not 2.53, whose code is the terminator.
    pub absorption_dbpm: f64,
    /// Centre of the sector in the head's own angles, -180 to 180 degrees in steps of 3.
    pub train_deg: f64,
    /// Width of the sector, 0 to 360 degrees in steps of 3. With 360 the head rotates continuously.
    pub sector_deg: f64,
    /// Step to the next ping: 0, 0.3, 0.6, 0.9, 1.2 or 2.4 degrees.
    pub step_deg: f64,
    /// Pulse length, 0 to 2550 microseconds in steps of 10, but not 2530, whose code is the terminator.
    pub pulse_us: f64,
    /// Minimum range of the profile point, 0 to 25 m in steps of 0.1.
    pub min_range_m: f64,
    /// Number of echo points in the return.
    pub points: Points,
    /// Number of bits of each echo point: 4, 8 or 16.
    pub data_bits: u8,
    /// Whether the return has the profile point only, without an echo (`IPX`).
    pub profile: bool,
    /// Whether the head calibrates its zero.
    pub calibrate: bool,
    /// Delay before the head answers, 0 to 510 ms in steps of 2, but not 506, whose code is the terminator.
    pub switch_delay_ms: f64,
    /// Acoustic frequency, 280 to 1100 kHz in steps of 5.
    pub frequency_khz: f64,
}

/// A reason why settings can't be encoded, or bytes can't be decoded.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum CommandError {
    /// A setting is outside the head's range.
    #[error("switch command: {field} of {value} {unit}; allowed is {least} to {most} {unit}")]
    Outside {
        /// Name of the setting.
        field: &'static str,
        /// Value of the setting.
        value: f64,
        /// Unit of the setting.
        unit: &'static str,
        /// Minimum of the setting.
        least: f64,
        /// Maximum of the setting.
        most: f64,
    },
    /// A setting isn't one of the allowed values.
    #[error("switch command: {field} of {value}; allowed are {allowed}")]
    NotListed {
        /// Name of the setting.
        field: &'static str,
        /// Value of the setting.
        value: f64,
        /// Allowed values of the setting.
        allowed: &'static str,
    },
    /// The code of a setting is the terminator byte, which may occur only at the end of the command.
    #[error(
        "switch command: byte {index} would be 0xFD, which is allowed only at the end; choose a neighbouring value of the setting"
    )]
    EarlyTerminator {
        /// Index of the code in the command.
        index: usize,
    },
    /// A byte of the command that must be constant has another value.
    #[error("switch command: byte {index} is {got:#04X}; allowed is {wanted:#04X}")]
    Fixed {
        /// Index of the byte in the command.
        index: usize,
        /// Actual value of the byte.
        got: u8,
        /// Required value of the byte.
        wanted: u8,
    },
}

/// Linear scale of a byte: value = zero + code * num / den.
///
/// The factor is a fraction, because a product with 0.3 or 0.01 has a rounding error for some codes.
struct Scale {
    field: &'static str,
    unit: &'static str,
    zero: f64,
    num: f64,
    den: f64,
    least: u8,
    most: u8,
}

impl Scale {
    const fn new(field: &'static str, unit: &'static str, (num, den): (f64, f64), most: u8) -> Self {
        Self { field, unit, zero: 0.0, num, den, least: 0, most }
    }

    fn value(&self, code: u8) -> f64 {
        self.zero + f64::from(code) * self.num / self.den
    }

    /// Code nearest to a value of the setting.
    fn code(&self, value: f64) -> Result<u8, CommandError> {
        let code = math::round_to_i64((value - self.zero) * self.den / self.num);
        match u8::try_from(code) {
            Ok(code) if value.is_finite() && (self.least..=self.most).contains(&code) => Ok(code),
            _ => Err(CommandError::Outside {
                field: self.field,
                value,
                unit: self.unit,
                least: self.value(self.least),
                most: self.value(self.most),
            }),
        }
    }

    /// Value of the setting for a received code. The code's range is checked.
    fn checked(&self, code: u8) -> Result<f64, CommandError> {
        self.code(self.value(code)).map(|_| self.value(code))
    }
}

const GAIN: Scale = Scale::new("start gain", "dB", (1.0, 1.0), 40);
const LOGF: Scale = Scale { zero: 10.0, ..Scale::new("LOGF", "dB", (10.0, 1.0), 3) };
const ABSORPTION: Scale = Scale::new("absorption", "dB/m", (1.0, 100.0), 255);
const TRAIN: Scale = Scale { zero: -180.0, ..Scale::new("train angle", "degrees", (3.0, 1.0), 120) };
const SECTOR: Scale = Scale::new("sector width", "degrees", (3.0, 1.0), 120);
const STEP: Scale = Scale::new("step", "degrees", (3.0, 10.0), 8);
const PULSE: Scale = Scale::new("pulse length", "us", (10.0, 1.0), 255);
const MIN_RANGE: Scale = Scale::new("profile minimum range", "m", (1.0, 10.0), 250);
const DELAY: Scale = Scale::new("switch delay", "ms", (2.0, 1.0), 255);
const FREQUENCY: Scale = Scale { zero: 175.0, least: 21, ..Scale::new("frequency", "kHz", (5.0, 1.0), 185) };

impl Command {
    /// Encodes the command.
    ///
    /// Errors: a setting has no code, or has the code 0xFD.
    pub fn encode(&self) -> Result<[u8; COMMAND_BYTES], CommandError> {
        let [fe, d] = HEADER;
        let bytes = [
            fe,
            d,
            self.head_id,
            listed_range(self.range_m)?,
            0,
            if self.reverse { REVERSE } else { 0 },
            SLAVE,
            0,
            GAIN.code(self.start_gain_db)?,
            LOGF.code(self.logf_db)?,
            ABSORPTION.code(self.absorption_dbpm)?,
            TRAIN.code(self.train_deg)?,
            SECTOR.code(self.sector_deg)?,
            listed_step(STEP.code(self.step_deg)?, self.step_deg)?,
            PULSE.code(self.pulse_us)?,
            MIN_RANGE.code(self.min_range_m)?,
            0,
            0,
            0,
            if self.points == Points::P250 { 25 } else { 50 },
            listed_bits(self.data_bits)?,
            UP_BAUD,
            u8::from(self.profile),
            u8::from(self.calibrate),
            DELAY.code(self.switch_delay_ms)?,
            FREQUENCY.code(self.frequency_khz)?,
            TERMINATOR,
        ];
        match bytes.iter().position(|byte| *byte == TERMINATOR) {
            Some(index) if index < COMMAND_BYTES - 1 => Err(CommandError::EarlyTerminator { index }),
            _ => Ok(bytes),
        }
    }

    /// Decodes a command. Unknown content is an error, including non-zero reserved bytes.
    ///
    /// Errors: a wrong constant byte, or an undefined code.
    pub fn decode(bytes: &[u8; COMMAND_BYTES]) -> Result<Self, CommandError> {
        if let Some(index) = bytes.iter().take(COMMAND_BYTES - 1).position(|byte| *byte == TERMINATOR) {
            return Err(CommandError::EarlyTerminator { index });
        }
        let [fe, d, head_id, range, r4, turn, slave, r7, gain, logf, absorption, train, sector, step, ..] =
            *bytes;
        let [
            ..,
            pulse,
            min_range,
            r16,
            r17,
            r18,
            points,
            bits,
            up_baud,
            profile,
            calibrate,
            delay,
            frequency,
            end,
        ] = *bytes;
        let [header_0, header_1] = HEADER;
        let fixed = [
            (0, fe, header_0),
            (1, d, header_1),
            (4, r4, 0),
            (5, turn & !REVERSE, 0),
            (6, slave, SLAVE),
            (7, r7, 0),
            (16, r16, 0),
            (17, r17, 0),
            (18, r18, 0),
            (21, up_baud, UP_BAUD),
            (26, end, TERMINATOR),
        ];
        if let Some((index, got, wanted)) = fixed.into_iter().find(|(_, got, wanted)| got != wanted) {
            return Err(CommandError::Fixed { index, got, wanted });
        }
        Ok(Self {
            head_id,
            range_m: listed_range(range)?,
            reverse: turn & REVERSE != 0,
            start_gain_db: GAIN.checked(gain)?,
            logf_db: LOGF.checked(logf)?,
            absorption_dbpm: ABSORPTION.checked(absorption)?,
            train_deg: TRAIN.checked(train)?,
            sector_deg: SECTOR.checked(sector)?,
            step_deg: STEP.checked(listed_step(step, STEP.value(step))?)?,
            pulse_us: PULSE.checked(pulse)?,
            min_range_m: MIN_RANGE.checked(min_range)?,
            points: decode_points(points)?,
            data_bits: listed_bits(bits)?,
            profile: decode_switch("profile", profile)?,
            calibrate: decode_switch("calibrate", calibrate)?,
            switch_delay_ms: DELAY.checked(delay)?,
            frequency_khz: FREQUENCY.checked(frequency)?,
        })
    }

    /// Step of the command in counts of 0.3 degrees.
    pub fn step_counts(&self) -> i32 {
        STEP.code(self.step_deg).map_or(0, i32::from)
    }
}

/// Size of a step of `counts` counts of 0.3 degrees, in degrees.
pub(crate) fn step_deg(counts: u8) -> f64 {
    STEP.value(counts)
}

/// Largest step that the head supports and that is not above `counts`. Steps are in counts of 0.3 degrees.
pub(crate) fn step_at_most(counts: i32) -> u8 {
    STEP_CODES.into_iter().rfind(|code| i32::from(*code) <= counts).unwrap_or(0)
}

fn listed_range(range_m: u8) -> Result<u8, CommandError> {
    let allowed = "1, 2, 3, 4, 5, 10, 20, 30, 40, 50, 60, 80, 100 m";
    let error = CommandError::NotListed { field: "range", value: f64::from(range_m), allowed };
    RANGES_M.contains(&range_m).then_some(range_m).ok_or(error)
}

fn listed_step(code: u8, value: f64) -> Result<u8, CommandError> {
    let allowed = "0, 0.3, 0.6, 0.9, 1.2, 2.4 degrees";
    let error = CommandError::NotListed { field: "step", value, allowed };
    STEP_CODES.contains(&code).then_some(code).ok_or(error)
}

fn listed_bits(bits: u8) -> Result<u8, CommandError> {
    let error = CommandError::NotListed { field: "data bits", value: f64::from(bits), allowed: "4, 8, 16" };
    matches!(bits, 4 | 8 | 16).then_some(bits).ok_or(error)
}

fn decode_points(code: u8) -> Result<Points, CommandError> {
    match code {
        25 => Ok(Points::P250),
        50 => Ok(Points::P500),
        _ => {
            let value = f64::from(code);
            Err(CommandError::NotListed { field: "data points", value, allowed: "25 and 50" })
        }
    }
}

fn decode_switch(field: &'static str, code: u8) -> Result<bool, CommandError> {
    match code {
        0 | 1 => Ok(code == 1),
        _ => Err(CommandError::NotListed { field, value: f64::from(code), allowed: "0 and 1" }),
    }
}

/// Separates commands in the stream from host to head.
#[derive(Debug, Clone, Copy, Default)]
pub struct Commands;

/// Decodes commands from the stream from host to head.
pub type CommandCodec = Framed<Commands, COMMAND_BYTES>;

impl Framing for Commands {
    type Value = Command;

    fn judge(&self, front: &[u8]) -> Verdict {
        if front.iter().zip(HEADER).any(|(byte, wanted)| *byte != wanted) {
            return Verdict::NotAStart;
        }
        Verdict::on(front, COMMAND_BYTES, |frame| self.read(frame).is_some())
    }

    fn read(&self, frame: &[u8]) -> Option<Command> {
        Command::decode(frame.first_chunk()?).ok()
    }
}

#[cfg(test)]
mod tests;
