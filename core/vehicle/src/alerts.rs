//! `[alerts]` and `[limits]` of a vehicle file: timing of alerts by class, and limits of cable and time.

use headrace_config::{ConfigError, Section};
use headrace_geometry::time::DurNs;

/// Class of an alert: its subject.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum AlertClass {
    /// The alert is about coverage of the wall.
    Coverage,
    /// The alert is about the vehicle's speed.
    Speed,
    /// The alert is about the vehicle's position.
    Position,
    /// The alert is about a sensor.
    Sensor,
    /// The alert is about the log recording.
    Recording,
    /// The alert is about a setting of the vehicle file, or a limit in it.
    Setting,
}

impl AlertClass {
    /// All alert classes.
    pub const ALL: [Self; 6] =
        [Self::Coverage, Self::Speed, Self::Position, Self::Sensor, Self::Recording, Self::Setting];

    /// Name of the alert class in files and JSON.
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

/// Delays before an alert becomes active and before it clears.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ClassTiming {
    /// Time for which the situation must last before the alert becomes active.
    pub hold: DurNs,
    /// Time for which the situation must be absent before the alert clears.
    pub off: DurNs,
}

/// Hold and clearing times of alerts, by class.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct AlertTiming([ClassTiming; AlertClass::ALL.len()]);

/// Maximum delay that may be set for a class of alerts, seconds.
const MOST_S: f64 = 600.0;

impl Default for AlertTiming {
    /// Default delays before alerts become active and clear.
    ///
    /// Speed and position fluctuate about their limits within seconds, so their alerts are delayed. The situations of
    /// all other classes have their own hysteresis.
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
    /// Returns the delays of an alert class.
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

    /// Returns a copy of the timing with other delays for one alert class.
    #[must_use]
    pub fn with(mut self, class: AlertClass, timing: ClassTiming) -> Self {
        if let Some(slot) = self.0.get_mut(class as usize) {
            *slot = timing;
        }
        debug_assert!(self.of(class) == timing, "the delays of {class:?} are {timing:?}: {self:?}");
        self
    }

    /// Reads the `[alerts]` table of a vehicle file.
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

/// Limits of cable length and dive time.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct LimitsConfig {
    /// Length of the cable, measured from the portal, m.
    pub cable_m: Option<f64>,
    /// Maximum duration of the dive.
    pub dive_time: Option<DurNs>,
    /// Speed of the vehicle while it is not inspecting, m/s.
    pub transit_mps: Option<f64>,
}

impl LimitsConfig {
    /// Reads the `[limits]` table of a vehicle file.
    ///
    /// Errors: a key that is unknown or out of range.
    pub(super) fn parse(section: &Section<'_>) -> Result<Self, ConfigError> {
        let cable_m = section.number("cable_m", 1.0..=100_000.0)?;
        let dive_min = section.number("dive_min", 1.0..=60_000.0)?;
        let transit_mps = section.number("transit_mps", 0.01..=5.0)?;
        section.finish()?;
        let dive_time = dive_min.map(|min| DurNs::from_secs_f64(min * 60.0));
        Ok(Self { cable_m, dive_time, transit_mps })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use headrace_config::Document;

    fn timing(text: &str) -> Result<AlertTiming, String> {
        let section = Document::new("vehicle.toml", text).root().map_err(|error| error.to_string())?;
        AlertTiming::parse(&section).map_err(|error| error.to_string())
    }

    #[test]
    fn alert_timing_changes_only_for_the_named_class() {
        let all = timing("speed.hold_s = 2.5\n[position]\noff_s = 0\n").unwrap();
        let usual = AlertTiming::default();
        let speed = ClassTiming { hold: DurNs(2_500_000_000), ..usual.of(AlertClass::Speed) };
        let position = ClassTiming { off: DurNs(0), ..usual.of(AlertClass::Position) };
        assert_eq!((all.of(AlertClass::Speed), all.of(AlertClass::Position)), (speed, position));
        for class in AlertClass::ALL {
            let (now, before) = (all.of(class), usual.of(class));
            assert_eq!(now == before, !matches!(class, AlertClass::Speed | AlertClass::Position));
        }
        for wrong in
            ["sonar.hold_s = 1", "speed.hold_s = -1", "speed.off_s = 601", "speed.off = 1", "hold_s = 1"]
        {
            assert!(timing(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn cable_limit_is_in_metres_and_dive_limit_in_minutes() {
        let limits = |text: &str| {
            let section = Document::new("vehicle.toml", text).root().unwrap();
            LimitsConfig::parse(&section).map_err(|error| error.to_string())
        };
        let dive_time = Some(DurNs(5_400_000_000_000));
        assert_eq!(
            limits("cable_m = 300\ndive_min = 90\ntransit_mps = 0.3"),
            Ok(LimitsConfig { cable_m: Some(300.0), dive_time, transit_mps: Some(0.3) })
        );
        assert_eq!(limits(""), Ok(LimitsConfig::default()));
        assert!(limits("cable_m = 0").is_err() && limits("dive_min = \"90\"").is_err());
    }
}
