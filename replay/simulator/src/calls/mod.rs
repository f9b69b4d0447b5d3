//! What a scene's descriptions call for: a lining, silt, a leak, rubble, thrusters, a cable, the models of sensors each imply
//! effects, with their places and the parameters of data sheets. Whether they are taken says `[effects] take`.

mod data_sheets;
mod described;
mod merge;

use headrace_config::{ConfigError, Section};
use headrace_vehicle::VehicleConfig;

use crate::environment::Environment;
use crate::facts::Facts;

pub(crate) use described::{Described, Tables};

/// Which of the effects that a scene calls for are simulated.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Take {
    /// Those alone that the scene names.
    #[default]
    Only,
    /// Those that it calls for, too; one that it names is as named.
    Called,
}

/// An effect that a scene calls for.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Called {
    /// Its name.
    pub effect: &'static str,
    /// What in the scene or its vehicle file calls for it.
    pub by: Vec<String>,
    /// Its tables, as they would be written in the scene.
    pub tables: String,
    /// What becomes of it.
    pub fate: Fate,
}

/// What becomes of an effect that a scene calls for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Fate {
    /// It is simulated as called.
    Taken,
    /// It is simulated as the scene names it.
    Named,
    /// It isn't simulated: the scene takes only what it names.
    NotTaken,
    /// It isn't simulated: `leave` names it.
    Left,
}

impl Fate {
    /// Its words.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Taken => "taken",
            Self::Named => "as named",
            Self::NotTaken => "not taken",
            Self::Left => "left",
        }
    }
}

/// A value of an effect's key, as TOML.
type Value = String;

/// One call for an effect.
#[derive(Debug, Clone, PartialEq)]
struct Call {
    effect: &'static str,
    by: String,
    /// Sensors that it acts on; `None` for an effect on the vehicle or the water.
    sensors: Option<Vec<String>>,
    /// Where; `None` for everywhere.
    place_m: Option<[f64; 2]>,
    keys: Vec<(&'static str, Value)>,
}

impl Call {
    fn new(effect: &'static str, by: impl Into<String>, keys: &[(&'static str, Value)]) -> Self {
        Self { effect, by: by.into(), sensors: None, place_m: None, keys: keys.to_vec() }
    }

    fn on(self, sensors: &[String]) -> Self {
        Self { sensors: Some(sensors.to_vec()), ..self }
    }

    fn within(self, place_m: [f64; 2]) -> Self {
        Self { place_m: Some(place_m), ..self }
    }
}

/// A number as TOML.
fn number(value: f64) -> Value {
    format!("{value:?}")
}

/// All that a scene calls for, in the order of [`crate::effects::KINDS`].
pub(crate) fn called(
    described: &Described,
    vehicle: &VehicleConfig,
    facts: &Facts,
    environment: &Environment,
) -> Vec<Called> {
    let mut calls = data_sheets::calls(vehicle, facts);
    calls.extend(described.calls(&vehicle.site, facts, environment));
    merge::merge(&calls)
}

/// Keys of `[effects]` that aren't effects.
#[derive(Debug, Clone, Default)]
pub(crate) struct Choice {
    pub(crate) take: Take,
    leave: Vec<String>,
}

impl Choice {
    /// Reads `take` and `leave`; `instead` overrides what `take` says.
    ///
    /// Errors: another word; `leave` without `take = "called"`, or a name that is no effect.
    pub(crate) fn read(effects: Option<&Section<'_>>, instead: Option<Take>) -> Result<Self, ConfigError> {
        let Some(section) = effects else {
            return Ok(Self { take: instead.unwrap_or_default(), leave: Vec::new() });
        };
        let words = [("only", Take::Only), ("called", Take::Called)];
        let take = section.choice("take", &words)?.unwrap_or_default();
        let leave = section.texts("leave")?;
        if leave.is_some() && take == Take::Only {
            return Err(section.invalid("leave", "is of use only with take = \"called\""));
        }
        let leave = leave.unwrap_or_default();
        if let Some(unknown) = leave.iter().find(|name| crate::effects::named(name).is_none()) {
            return Err(section.invalid("leave", &format!("names {unknown:?}, which is no effect")));
        }
        Ok(Self { take: instead.unwrap_or(take), leave })
    }

    /// Says of each call what becomes of it, the effects of these names being the scene's own.
    pub(crate) fn decide(&self, called: &mut [Called], is_named: impl Fn(&str) -> bool) {
        for call in called {
            call.fate = match self.take {
                _ if is_named(call.effect) => Fate::Named,
                Take::Only => Fate::NotTaken,
                Take::Called if self.leave.iter().any(|name| name == call.effect) => Fate::Left,
                Take::Called => Fate::Taken,
            };
        }
    }
}

/// The tables of all effects that are taken, as a text to parse.
pub(crate) fn taken(called: &[Called]) -> String {
    let taken = called.iter().filter(|call| call.fate == Fate::Taken);
    taken.map(|call| call.tables.as_str()).collect::<Vec<_>>().concat()
}

#[cfg(test)]
mod tests;
