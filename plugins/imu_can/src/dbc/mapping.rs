//! Mapping of an inertial unit's DBC signals to readings, in the form that the loop uses.

use headrace_sensor::geometry::time::DurNs;

use super::file::{Place, Signal};
use super::layout::Bits;

/// Standard gravity, m/s^2 (CGPM 1901).
const G_MPS2: f64 = 9.806_65;

/// Axis convention of the inertial unit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Axes {
    /// x forward, y left, z up; attitude relative to a z-up frame.
    Flu,
    /// x forward, y right, z down; attitude relative to north, east, down.
    Frd,
}

/// Unit of a signal.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Unit {
    /// SI: rad, rad/s, m/s^2, quaternion components.
    Si,
    /// Degrees, or degrees per second.
    Degrees,
    /// Standard gravity, g.
    Gravities,
}

/// Quantity that a signal measures.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// Turn rate.
    Rate,
    /// Specific force.
    Force,
    /// Angle.
    Angle,
    /// One component of a quaternion.
    Share,
}

/// A reason why a DBC signal can't be used as the vehicle file requests.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum MappingError {
    /// The unit of the signal doesn't fit the quantity.
    #[error("using {signal:?} as a {quantity}: its unit is {unit:?}; allowed are {allowed}")]
    Unit {
        /// Name of the signal.
        signal: String,
        /// Expected quantity.
        quantity: &'static str,
        /// Unit of the signal in the DBC.
        unit: String,
        /// Allowed units of the quantity.
        allowed: String,
    },
    /// The signal can't be a sample time, because its tick is unsuitable.
    #[error(
        "using {signal:?} as the sample time: a step of {factor} {unit:?}; allowed are whole numbers without an offset, \
         in ns, us, ms or s, a step being 1 ns to 15 minutes and whole nanoseconds"
    )]
    Time {
        /// Name of the signal.
        signal: String,
        /// Factor of the signal, as text.
        factor: String,
        /// Unit of the signal in the DBC.
        unit: String,
    },
    /// The mask or value of a validity condition has bits beyond the signal.
    #[error(
        "using {signal:?} as a state: mask {mask:#X}, value {value:#X}; allowed are an integer signal, a mask within its \
         {bits} bits, and a value within the mask"
    )]
    Mask {
        /// Name of the signal.
        signal: String,
        /// Number of bits of the signal.
        bits: u32,
        /// Mask of the checked bits.
        mask: u64,
        /// Value that the checked bits must have.
        value: u64,
    },
}

/// A DBC signal used as a component of a reading.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Part {
    /// Location of the signal in the frames.
    pub place: Place,
    /// Unit of the signal.
    pub unit: Unit,
}

/// Attitude representation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Attitude {
    /// Signals w, x, y, z of a quaternion, from sensor to level frame.
    Quaternion([Part; 4]),
    /// Signals of roll, pitch and yaw: rotations about the fixed axes x, then y, then z.
    Euler([Part; 3]),
}

/// Condition of validity. Readings are withheld unless the signal's bits under `mask` equal `value`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Condition {
    /// Location of the status signal in the frames.
    pub place: Place,
    /// Mask of the checked bits.
    pub mask: u64,
    /// Value of the checked bits if readings are valid.
    pub value: u64,
}

/// Timestamp of the unit's clock.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stamp {
    /// Location of the timestamp in the frames.
    pub place: Place,
    /// Length of a tick of the unit's clock.
    pub tick: DurNs,
}

/// Conditions of validity of the readings.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Conditions {
    /// Condition for the validity of all readings.
    pub all: Option<Condition>,
    /// Additional condition for the validity of attitude.
    pub attitude: Option<Condition>,
    /// Additional condition for the validity of turn rate.
    pub rate: Option<Condition>,
    /// Additional condition for the validity of specific force.
    pub force: Option<Condition>,
}

/// Mapping of an inertial unit's DBC signals to readings.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Mapping {
    /// Axis convention of the unit.
    pub axes: Axes,
    /// Signals of the turn rate about x, y, z.
    pub rate: Option<[Part; 3]>,
    /// Signals of the specific force along x, y, z.
    pub force: Option<[Part; 3]>,
    /// Signals of the attitude.
    pub attitude: Option<Attitude>,
    /// Conditions of validity.
    pub conditions: Conditions,
    /// Timestamp of the unit's clock.
    pub sample_time: Option<Stamp>,
    /// Delay from a reading's time of validity to its receipt.
    pub latency: DurNs,
}

impl Axes {
    /// Converts a vector from the unit's axes to headrace's, or back.
    pub fn turned(self, [x, y, z]: [f64; 3]) -> [f64; 3] {
        match self {
            Self::Flu => [x, y, z],
            Self::Frd => [x, -y, -z],
        }
    }

    /// Converts a quaternion w, x, y, z from the unit's frames to headrace's, or back.
    pub fn rotation_turned(self, [w, x, y, z]: [f64; 4]) -> [f64; 4] {
        let [x, y, z] = self.turned([x, y, z]);
        [w, x, y, z]
    }
}

impl Unit {
    /// Converts a value from this unit to the SI unit.
    pub fn to_si(self, value: f64) -> f64 {
        match self {
            Self::Si => value,
            Self::Degrees => value.to_radians(),
            Self::Gravities => value * G_MPS2,
        }
    }

    /// Converts a value from the SI unit to this unit.
    pub fn of_si(self, value: f64) -> f64 {
        match self {
            Self::Si => value,
            Self::Degrees => value.to_degrees(),
            Self::Gravities => value / G_MPS2,
        }
    }
}

impl Kind {
    fn name(self) -> &'static str {
        match self {
            Self::Rate => "turn rate",
            Self::Force => "specific force",
            Self::Angle => "angle",
            Self::Share => "part of a quaternion",
        }
    }

    /// Allowed units, as written in DBC files. Case and spaces are ignored.
    fn units(self) -> &'static [(&'static str, Unit)] {
        match self {
            Self::Rate => &[
                ("deg/s", Unit::Degrees),
                ("°/s", Unit::Degrees),
                ("deg/sec", Unit::Degrees),
                ("dps", Unit::Degrees),
                ("rad/s", Unit::Si),
                ("rad/sec", Unit::Si),
            ],
            Self::Force => &[
                ("m/s^2", Unit::Si),
                ("m/s2", Unit::Si),
                ("m/s²", Unit::Si),
                ("m/s/s", Unit::Si),
                ("g", Unit::Gravities),
            ],
            Self::Angle => &[
                ("deg", Unit::Degrees),
                ("°", Unit::Degrees),
                ("degree", Unit::Degrees),
                ("degrees", Unit::Degrees),
                ("rad", Unit::Si),
            ],
            Self::Share => &[("", Unit::Si), ("-", Unit::Si), ("1", Unit::Si)],
        }
    }
}

impl Part {
    /// Uses a signal as a component of this quantity.
    ///
    /// Errors: the unit doesn't fit the quantity.
    pub fn of(signal: &Signal, kind: Kind) -> Result<Self, MappingError> {
        let written = without_blanks(&signal.unit);
        let unit = kind.units().iter().find(|(name, _)| *name == written).map(|(_, unit)| *unit);
        let unit = unit.ok_or_else(|| MappingError::Unit {
            signal: signal.name.clone(),
            quantity: kind.name(),
            unit: signal.unit.clone(),
            allowed: kind.units().iter().map(|(name, _)| format!("{name:?}")).collect::<Vec<_>>().join(", "),
        })?;
        Ok(Self { place: signal.place, unit })
    }
}

impl Condition {
    /// Uses a signal as a status. Without `value`, readings are valid if all bits of the mask are set.
    ///
    /// Errors: bits beyond the signal, a value outside the mask, a float.
    pub fn of(signal: &Signal, mask: u64, value: Option<u64>) -> Result<Self, MappingError> {
        let value = value.unwrap_or(mask);
        let bits = signal.place.layout.bits();
        let whole = matches!(signal.place.bits, Bits::Unsigned | Bits::Signed);
        if !whole || mask == 0 || mask > u64::MAX >> (64 - bits.clamp(1, 64)) || value & !mask != 0 {
            return Err(MappingError::Mask { signal: signal.name.clone(), bits, mask, value });
        }
        Ok(Self { place: signal.place, mask, value })
    }
}

impl Stamp {
    /// Uses a signal as a timestamp. The signal counts ticks. The length of a tick is the signal's factor, in the
    /// signal's unit.
    ///
    /// Errors: the unit is no time, the tick isn't whole nanoseconds, or the signal is a float or has an offset.
    pub fn of(signal: &Signal) -> Result<Self, MappingError> {
        const UNITS_NS: [(&str, f64); 6] =
            [("s", 1e9), ("sec", 1e9), ("ms", 1e6), ("us", 1e3), ("µs", 1e3), ("ns", 1.0)];
        const LONGEST_NS: f64 = 900e9;
        let place = signal.place;
        let written = without_blanks(&signal.unit).replace('μ', "µ");
        let unit_ns = UNITS_NS.iter().find(|(name, _)| *name == written).map(|(_, ns)| *ns);
        let tick_ns = unit_ns.map_or(0.0, |unit_ns| place.factor * unit_ns);
        let tick = DurNs::from_secs_f64(tick_ns / 1e9);
        // Factors are decimal fractions, so their product with a power of ten is an integer except for rounding.
        let is_whole = (tick.0 as f64 - tick_ns).abs() <= 1e-9 * tick_ns;
        let counts = matches!(place.bits, Bits::Unsigned | Bits::Signed) && place.offset.abs() == 0.0;
        if !counts || !is_whole || !(1.0..=LONGEST_NS).contains(&tick_ns) {
            return Err(MappingError::Time {
                signal: signal.name.clone(),
                factor: place.factor.to_string(),
                unit: signal.unit.clone(),
            });
        }
        Ok(Self { place, tick })
    }
}

impl Mapping {
    /// Locations of all mapped signals.
    pub fn places(&self) -> impl Iterator<Item = Place> + '_ {
        let conditions =
            [self.conditions.all, self.conditions.attitude, self.conditions.rate, self.conditions.force];
        let parts = |parts: Option<[Part; 3]>| parts.into_iter().flatten().map(|part| part.place);
        let (quaternion, euler) = match self.attitude {
            Some(Attitude::Quaternion(parts)) => (Some(parts), None),
            Some(Attitude::Euler(parts)) => (None, Some(parts)),
            None => (None, None),
        };
        parts(self.rate)
            .chain(parts(self.force))
            .chain(quaternion.into_iter().flatten().map(|part| part.place))
            .chain(parts(euler))
            .chain(conditions.into_iter().flatten().map(|condition| condition.place))
            .chain(self.sample_time.map(|stamp| stamp.place))
    }
}

fn without_blanks(unit: &str) -> String {
    unit.chars().filter(|c| !c.is_whitespace()).flat_map(char::to_lowercase).collect()
}
