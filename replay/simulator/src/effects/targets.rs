//! Selection of the sensors to which an effect applies.

use headrace_config::{ConfigError, Section};
use headrace_sensor::device::Sense;

use crate::facts::Facts;

/// Parameters of an effect for each sensor, which is given by its number.
#[derive(Debug, Clone, PartialEq)]
pub struct PerSensor<P>(pub Vec<(usize, P)>);

impl<P: Clone> PerSensor<P> {
    /// Reads an effect's tables. The key `sensors` of a table names the sensors to which the table applies.
    ///
    /// If the key is absent, the table applies to all sensors that measure one of the quantities `senses`. `read` reads
    /// the effect's own keys.
    ///
    /// Errors: the vehicle lacks a named sensor; a sensor is named twice or measures another quantity; a key is
    /// unknown.
    pub fn read(
        tables: Vec<Section<'_>>,
        facts: &Facts,
        senses: &[Sense],
        mut read: impl FnMut(&Section<'_>) -> Result<P, ConfigError>,
    ) -> Result<Self, ConfigError> {
        let mut found: Vec<(usize, P)> = Vec::new();
        for table in tables {
            let read = table.part(|| {
                let sensors = targets(&table, facts, senses);
                let parameters = read(&table)?;
                table.finish()?;
                Ok((sensors?, parameters))
            })?;
            let Some((sensors, parameters)) = read else { continue };
            for source in sensors {
                if found.iter().any(|(other, _)| *other == source) {
                    let id = facts.sensors.get(source).map_or("", |sensor| sensor.id.as_str());
                    let problem =
                        format!("names {id:?}, which an earlier table of this effect names already");
                    return Err(table.invalid("sensors", &problem));
                }
                found.push((source, parameters.clone()));
            }
        }
        found.sort_by_key(|(source, _)| *source);
        Ok(Self(found))
    }
}

/// Numbers of the sensors to which a table applies.
///
/// Errors: see [`PerSensor::read`].
pub(super) fn targets(
    table: &Section<'_>,
    facts: &Facts,
    senses: &[Sense],
) -> Result<Vec<usize>, ConfigError> {
    let fits = |source: &usize| facts.sensors.get(*source).is_some_and(|s| senses.contains(&s.sense));
    let fitting: Vec<usize> = (0..facts.sensors.len()).filter(fits).collect();
    let ids = |sources: &[usize]| {
        let ids: Vec<&str> =
            sources.iter().filter_map(|s| facts.sensors.get(*s)).map(|s| s.id.as_str()).collect();
        ids.join(", ")
    };
    let Some(wanted) = table.texts("sensors")? else {
        if fitting.is_empty() {
            let kinds: Vec<&str> = senses.iter().map(|sense| sense.as_str()).collect();
            let problem = format!("has nothing to act on: the vehicle has no {}", kinds.join(" and no "));
            return Err(table.invalid_itself(&problem));
        }
        return Ok(fitting);
    };
    let mut sources = Vec::new();
    for id in wanted {
        let source = fitting.iter().find(|s| facts.sensors.get(**s).is_some_and(|sensor| sensor.id == id));
        if let Some(source) = source {
            sources.push(*source);
        } else {
            let problem = format!("names {id:?}; this effect can act on: {}", ids(&fitting));
            return Err(table.invalid("sensors", &problem));
        }
    }
    if sources.is_empty() {
        let problem = "is empty; remove it to name all sensors that the effect can act on";
        return Err(table.invalid("sensors", problem));
    }
    Ok(sources)
}
