//! What a unit's signals are, ready for the loop.

use headrace_sensor::geometry::time::DurNs;

use super::file::{Place, Signal};
use super::layout::Bits;

/// Standard gravity, m/s^2 (CGPM 1901).
const G_MPS2: f64 = 9.806_65;

/// Which way the unit's axes point.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Axes {
    /// x forward, y left, z up; attitudes against a frame whose z is up.
    Flu,
    /// x forward, y right, z down; attitudes against north, east, down.
    Frd,
}

/// What turns a signal's unit into ours.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Unit {
    /// As it is: radians, rad/s, m/s^2, parts of a quaternion.
    Si,
    /// Degrees, degrees a second.
    Degrees,
    /// Standard gravity.
    Gravities,
}

/// What kind of quantity a signal is one of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// Turn rate.
    Rate,
    /// Specific force.
    Force,
    /// Angle.
    Angle,
    /// Part of a quaternion.
    Share,
}

/// A unit that isn't known, or a signal that can't be what it is wanted for.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum MappingError {
    /// Not a unit of that quantity.
    #[error("taking {signal:?} for a {quantity}: its unit is {unit:?}; allowed are {allowed}")]
    Unit {
        /// Which signal.
        signal: String,
        /// What it was to be.
        quantity: &'static str,
        /// Its unit in the DBC.
        unit: String,
        /// What would do.
        allowed: String,
    },
    /// A time whose steps can't be counted.
    #[error(
        "taking {signal:?} for the sample time: a step of {factor} {unit:?}; allowed are whole numbers without an offset, \
         in ns, us, ms or s, a step being 1 ns to 15 minutes and whole nanoseconds"
    )]
    Time {
        /// Which signal.
        signal: String,
        /// Its factor, as text.
        factor: String,
        /// Its unit in the DBC.
        unit: String,
    },
    /// Bits that the signal hasn't.
    #[error(
        "taking {signal:?} for a state: it has {bits} bits, and the mask is {mask:#X}, the value {value:#X}"
    )]
    Mask {
        /// Which signal.
        signal: String,
        /// How many bits it has.
        bits: u32,
        /// The bits that are looked at.
        mask: u64,
        /// What they should be.
        value: u64,
    },
}

/// A signal as a part of a reading.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Part {
    /// Where it is.
    pub place: Place,
    /// Its unit.
    pub unit: Unit,
}

/// How attitude is sent.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Attitude {
    /// w, x, y, z: sensor to level.
    Quaternion([Part; 4]),
    /// Roll, pitch, yaw: about x, then y, then z, the axes fixed.
    Euler([Part; 3]),
}

/// Readings are withheld unless the signal's bits under `mask` are `value`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Condition {
    /// Where the state is.
    pub place: Place,
    /// Which bits count.
    pub mask: u64,
    /// What they are where all is well.
    pub value: u64,
}

/// The unit's own time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stamp {
    /// Where it is.
    pub place: Place,
    /// How long a step is.
    pub tick: DurNs,
}

/// States on which readings depend.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Conditions {
    /// For all readings.
    pub all: Option<Condition>,
    /// For attitude.
    pub attitude: Option<Condition>,
    /// For turn rate.
    pub rate: Option<Condition>,
    /// For specific force.
    pub force: Option<Condition>,
}

/// What a unit's signals are.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Mapping {
    /// Which way its axes point.
    pub axes: Axes,
    /// Turn rate about x, y, z.
    pub rate: Option<[Part; 3]>,
    /// Specific force along x, y, z.
    pub force: Option<[Part; 3]>,
    /// Orientation.
    pub attitude: Option<Attitude>,
    /// When which of them count.
    pub conditions: Conditions,
    /// The unit's own time.
    pub sample_time: Option<Stamp>,
    /// From validity to receive time.
    pub latency: DurNs,
}

impl Axes {
    /// A vector in the unit's axes in ours, or the other way.
    pub fn turned(self, [x, y, z]: [f64; 3]) -> [f64; 3] {
        match self {
            Self::Flu => [x, y, z],
            Self::Frd => [x, -y, -z],
        }
    }

    /// A quaternion w, x, y, z between the unit's frames as one between ours, or the other way.
    pub fn rotation_turned(self, [w, x, y, z]: [f64; 4]) -> [f64; 4] {
        let [x, y, z] = self.turned([x, y, z]);
        [w, x, y, z]
    }
}

impl Unit {
    /// A value of this unit in ours.
    pub fn to_si(self, value: f64) -> f64 {
        match self {
            Self::Si => value,
            Self::Degrees => value.to_radians(),
            Self::Gravities => value * G_MPS2,
        }
    }

    /// A value of ours in this unit.
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

    /// The units that it may have, as DBC files write them; letters' case and blanks don't count.
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
    /// A signal that is to be of this kind.
    ///
    /// Errors: a unit that such a quantity hasn't.
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
    /// A state; without `value` all bits of the mask are to be set.
    ///
    /// Errors: bits that the signal hasn't, a value outside of the mask, a float.
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
    /// The unit's own time: a count of ticks, each the signal's factor in its unit.
    ///
    /// Errors: a unit that is no time, a step that isn't whole nanoseconds, a float, an offset.
    pub fn of(signal: &Signal) -> Result<Self, MappingError> {
        const UNITS_NS: [(&str, f64); 6] =
            [("s", 1e9), ("sec", 1e9), ("ms", 1e6), ("us", 1e3), ("µs", 1e3), ("ns", 1.0)];
        const LONGEST_NS: f64 = 900e9;
        let place = signal.place;
        let written = without_blanks(&signal.unit).replace('μ', "µ");
        let unit_ns = UNITS_NS.iter().find(|(name, _)| *name == written).map(|(_, ns)| *ns);
        let tick_ns = unit_ns.map_or(0.0, |unit_ns| place.factor * unit_ns);
        let tick = DurNs::from_secs_f64(tick_ns / 1e9);
        // Factors are decimal fractions: their product with a power of ten is whole to rounding.
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
    /// All places that are looked at.
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
