//! Keys of a vehicle file that map a DBC's signals.

use headrace_sensor::config::{ConfigError, NamedFile, Section};
use headrace_sensor::geometry::time::DurNs;

use super::file::{DbcError, DbcFile, Signal};
use super::mapping::{Attitude, Axes, Condition, Conditions, Kind, Mapping, Part, Stamp};

/// Reads the keys `axes` and `signals` of a sensor's table that names a DBC file.
///
/// Errors: the DBC is invalid (with its line); a signal, unit or key is unknown; no reading is mapped.
pub fn mapping(file: &NamedFile, own: &Section<'_>, latency: DurNs) -> Result<Mapping, ConfigError> {
    let dbc = DbcFile::parse(&file.text).map_err(|error| in_file(file, own, error))?;
    let axes = own.choice("axes", &[("flu", Axes::Flu), ("frd", Axes::Frd)])?.unwrap_or(Axes::Flu);
    let section = own.required("signals", own.section("signals")?)?;
    let signals = Signals { dbc: &dbc, section: &section };
    let mapping = Mapping {
        axes,
        rate: signals.parts("rate", Kind::Rate)?,
        force: signals.parts("force", Kind::Force)?,
        attitude: signals.attitude()?,
        conditions: Conditions {
            all: signals.condition("valid")?,
            attitude: signals.condition("attitude_valid")?,
            rate: signals.condition("rate_valid")?,
            force: signals.condition("force_valid")?,
        },
        sample_time: signals.sample_time()?,
        latency,
    };
    if mapping.rate.is_none() && mapping.force.is_none() && mapping.attitude.is_none() {
        return Err(section
            .invalid_itself("gives no reading; at least one of rate, force, quaternion, euler is needed"));
    }
    section.finish()?;
    Ok(mapping)
}

fn in_file(file: &NamedFile, own: &Section<'_>, error: DbcError) -> ConfigError {
    match error {
        DbcError::Parse { line, problem } => {
            ConfigError { file: file.name.clone(), line, key: "DBC".to_owned(), value: None, problem }
        }
        error => own.invalid("dbc", &error.to_string()),
    }
}

/// The table `signals`, with the DBC in which names are looked up.
struct Signals<'s, 'a> {
    dbc: &'s DbcFile,
    section: &'s Section<'a>,
}

impl Signals<'_, '_> {
    fn parts<const N: usize>(&self, key: &'static str, kind: Kind) -> Result<Option<[Part; N]>, ConfigError> {
        let Some(names) = self.section.texts(key)? else { return Ok(None) };
        let parts = names.iter().map(|name| {
            let signal = self.signal(self.section, key, name)?;
            Part::of(&signal, kind).map_err(|error| self.section.invalid(key, &error.to_string()))
        });
        let parts: Vec<Part> = parts.collect::<Result<_, _>>()?;
        let wanted = format!("must be the names of {N} signals");
        parts.try_into().map(Some).map_err(|_| self.section.invalid(key, &wanted))
    }

    fn attitude(&self) -> Result<Option<Attitude>, ConfigError> {
        let quaternion = self.parts("quaternion", Kind::Share)?.map(Attitude::Quaternion);
        let euler = self.parts("euler", Kind::Angle)?.map(Attitude::Euler);
        if quaternion.is_some() && euler.is_some() {
            return Err(self
                .section
                .invalid("euler", "is given beside quaternion; only one of them may give the attitude"));
        }
        Ok(quaternion.or(euler))
    }

    fn condition(&self, key: &'static str) -> Result<Option<Condition>, ConfigError> {
        let Some(section) = self.section.section(key)? else { return Ok(None) };
        let name = section.required("signal", section.text("signal")?)?;
        let signal = self.signal(&section, "signal", &name)?;
        let whole =
            |key| Ok(section.integer(key, 0..=i64::MAX)?.and_then(|number| u64::try_from(number).ok()));
        let mask = section.required("mask", whole("mask")?)?;
        let condition = Condition::of(&signal, mask, whole("value")?);
        let condition = condition.map_err(|error| section.invalid("mask", &error.to_string()))?;
        section.finish()?;
        Ok(Some(condition))
    }

    fn sample_time(&self) -> Result<Option<Stamp>, ConfigError> {
        let key = "sample_time";
        let Some(name) = self.section.text(key)? else { return Ok(None) };
        let signal = self.signal(self.section, key, &name)?;
        Stamp::of(&signal).map(Some).map_err(|error| self.section.invalid(key, &error.to_string()))
    }

    fn signal(&self, section: &Section<'_>, key: &str, name: &str) -> Result<Signal, ConfigError> {
        self.dbc.signal(name).map_err(|error| section.invalid(key, &error.to_string()))
    }
}
