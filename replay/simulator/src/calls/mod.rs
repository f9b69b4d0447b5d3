//! Effects implied by a scene's descriptions, with their places and parameters from data sheets.
//!
//! A lining, silt, a leak, rubble, thrusters, a cable and the models of sensors each imply effects. The key `take` of
//! `[effects]` decides whether they are simulated.

mod data_sheets;
mod described;
mod merge;

use headrace_config::{ConfigError, Section};
use headrace_vehicle::VehicleConfig;

use crate::environment::Environment;
use crate::facts::Facts;

pub(crate) use described::{Described, Tables};

/// Selects which of the implied effects are simulated.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Take {
    /// Only the effects that the scene names.
    #[default]
    Only,
    /// Implied effects as well; an effect that the scene names is simulated as named.
    Called,
}

/// An effect that a scene implies.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Called {
    /// Its name.
    pub effect: &'static str,
    /// The parts of the scene or its vehicle file that imply it.
    pub by: Vec<String>,
    /// Its tables, as they would be written in the scene.
    pub tables: String,
    /// Whether and how it is simulated.
    pub fate: Fate,
}

/// Whether and how an implied effect is simulated.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Fate {
    /// Simulated as implied.
    Taken,
    /// It is simulated as the scene names it.
    Named,
    /// Not simulated: the scene takes only named effects.
    NotTaken,
    /// Not simulated: `leave` lists it.
    Left,
}

impl Fate {
    /// Its display text.
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

/// A single call for an effect.
#[derive(Debug, Clone, PartialEq)]
struct Call {
    effect: &'static str,
    by: String,
    /// Sensors that it acts on; `None` for an effect on the vehicle or the water.
    sensors: Option<Vec<String>>,
    /// Chainages between which it acts; `None` for everywhere.
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

/// All effects that a scene implies, in the order of [`crate::effects::KINDS`].
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

/// The keys of `[effects]` other than effects.
#[derive(Debug, Clone, Default)]
pub(crate) struct Choice {
    pub(crate) take: Take,
    leave: Vec<String>,
}

impl Choice {
    /// Reads `take` and `leave`; `instead` overrides the value of `take`.
    ///
    /// Errors: another value; `leave` without `take = "called"`; a name that isn't an effect.
    pub(crate) fn read(effects: Option<&Section<'_>>, instead: Option<Take>) -> Result<Self, ConfigError> {
        let Some(section) = effects else {
            return Ok(Self { take: instead.unwrap_or_default(), leave: Vec::new() });
        };
        let words = [("only", Take::Only), ("called", Take::Called)];
        let take = section.choice("take", &words)?.unwrap_or_default();
        let leave = section.texts("leave")?;
        if leave.is_some() && take == Take::Only {
            return Err(section.invalid("leave", "has an effect only with take = \"called\""));
        }
        let leave = leave.unwrap_or_default();
        if let Some(unknown) = leave.iter().find(|name| crate::effects::named(name).is_none()) {
            return Err(section.invalid("leave", &format!("names {unknown:?}, which isn't an effect")));
        }
        Ok(Self { take: instead.unwrap_or(take), leave })
    }

    /// Sets for each call whether and how it is simulated. `is_named` tells which effects the scene names itself.
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

/// The tables of all taken effects, as text to parse.
pub(crate) fn taken(called: &[Called]) -> String {
    let taken = called.iter().filter(|call| call.fate == Fate::Taken);
    taken.map(|call| call.tables.as_str()).collect::<Vec<_>>().concat()
}

#[cfg(test)]
mod tests;
