//! `[alerts]` and `[limits]` of a vehicle file: hold times and dead bands by class, and what there is of cable and time.

use headrace_config::{ConfigError, Section};
use headrace_geometry::time::DurNs;

/// What an alert is about.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum AlertClass {
    /// The wall.
    Coverage,
    /// The vehicle's speed.
    Speed,
    /// The vehicle's position.
    Position,
    /// A sensor.
    Sensor,
    /// The log.
    Recording,
    /// A setting of the vehicle file, or a limit in it.
    Setting,
}

impl AlertClass {
    /// All of them.
    pub const ALL: [Self; 6] =
        [Self::Coverage, Self::Speed, Self::Position, Self::Sensor, Self::Recording, Self::Setting];

    /// The word used in files and JSON.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Coverage => "coverage",
            Self::Speed => "speed",
            Self::Position => "position",
            Self::Sensor => "sensor",
            Self::Recording => "recording",
            Self::Setting => "setting",
        }
    }
}

/// When what holds is told, and when it is over.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ClassTiming {
    /// How long it must hold before it is told.
    pub hold: DurNs,
    /// How long it must not hold before it is over.
    pub off: DurNs,
}

/// Timing of all classes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct AlertTiming([ClassTiming; AlertClass::ALL.len()]);

/// Longest time of a class, seconds.
const MOST_S: f64 = 600.0;

impl Default for AlertTiming {
    /// Speed and position flicker about their limits within seconds; the others have limits of their own.
    fn default() -> Self {
        let timing = |hold_s: f64, off_s: f64| ClassTiming {
            hold: DurNs::from_secs_f64(hold_s),
            off: DurNs::from_secs_f64(off_s),
        };
        Self(AlertClass::ALL.map(|class| match class {
            AlertClass::Coverage | AlertClass::Recording => timing(0.0, 5.0),
            AlertClass::Speed | AlertClass::Position => timing(1.0, 5.0),
            AlertClass::Sensor => timing(0.0, 3.0),
            AlertClass::Setting => timing(0.0, 10.0),
        }))
    }
}

impl AlertTiming {
    /// That of a class.
    pub fn of(&self, class: AlertClass) -> ClassTiming {
        let [coverage, speed, position, sensor, recording, setting] = self.0;
        match class {
            AlertClass::Coverage => coverage,
            AlertClass::Speed => speed,
            AlertClass::Position => position,
            AlertClass::Sensor => sensor,
            AlertClass::Recording => recording,
            AlertClass::Setting => setting,
        }
    }

    /// The same with another timing of a class.
    #[must_use]
    pub fn with(mut self, class: AlertClass, timing: ClassTiming) -> Self {
        if let Some(slot) = self.0.get_mut(class as usize) {
            *slot = timing;
        }
        self
    }

    /// Reads `[alerts]`.
    ///
    /// Errors: a key that is unknown or out of range.
    pub(super) fn parse(section: &Section<'_>) -> Result<Self, ConfigError> {
        let mut all = Self::default();
        for class in AlertClass::ALL {
            let Some(table) = section.section(class.as_str())? else { continue };
            let usual = all.of(class);
            let read = |key: &'static str, usual: DurNs| -> Result<DurNs, ConfigError> {
                Ok(table.number(key, 0.0..=MOST_S)?.map_or(usual, DurNs::from_secs_f64))
            };
            let timing = ClassTiming { hold: read("hold_s", usual.hold)?, off: read("off_s", usual.off)? };
            table.finish()?;
            all = all.with(class, timing);
        }
        section.finish()?;
        Ok(all)
    }
}

/// What there is of cable and time.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct LimitsConfig {
    /// Length of the cable, m from the portal.
    pub cable_m: Option<f64>,
    /// Duration of the dive.
    pub dive_time: Option<DurNs>,
}

impl LimitsConfig {
    /// Reads `[limits]`.
    ///
    /// Errors: a key that is unknown or out of range.
    pub(super) fn parse(section: &Section<'_>) -> Result<Self, ConfigError> {
        let cable_m = section.number("cable_m", 1.0..=100_000.0)?;
        let dive_min = section.number("dive_min", 1.0..=60_000.0)?;
        section.finish()?;
        Ok(Self { cable_m, dive_time: dive_min.map(|min| DurNs::from_secs_f64(min * 60.0)) })
    }
}
