//! Effects implied by a scene's descriptions, with their ranges of chainage and with parameters from data sheets.
//!
//! A lining, silt, a leak, rubble, thrusters, a cable and the models of sensors each imply effects. The key `take` of
//! `[effects]` decides whether implied effects are simulated.

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
    /// Simulates only the effects that the scene names.
    #[default]
    Only,
    /// Simulates implied effects too. An effect that the scene names is simulated with the scene's own tables.
    Called,
}

/// An effect that a scene implies, with its tables.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Called {
    /// Name of the effect.
    pub effect: &'static str,
    /// Parts of the scene or its vehicle file that imply the effect.
    pub by: Vec<String>,
    /// Tables of the effect, in the form in which a scene would contain them.
    pub tables: String,
    /// Whether and how the effect is simulated.
    pub fate: Fate,
}

/// Whether and how an implied effect is simulated.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Fate {
    /// The effect is simulated with its implied tables.
    Taken,
    /// The effect is simulated with the tables in the scene.
    Named,
    /// The effect isn't simulated: the scene asks only for the effects that it names.
    NotTaken,
    /// The effect isn't simulated: the key `leave` lists it.
    Left,
}

impl Fate {
    /// Whether and how the effect is simulated, as text for display.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Taken => "taken",
            Self::Named => "as named",
            Self::NotTaken => "not taken",
            Self::Left => "left",
        }
    }
}

/// A value of an effect's key, as TOML text.
type Value = String;

/// A call: one reason to simulate an effect, with the sensors, the range of chainage and the keys that follow from it.
#[derive(Debug, Clone, PartialEq)]
struct Call {
    effect: &'static str,
    by: String,
    /// Sensors that the effect acts on; `None` for an effect on the vehicle or the water.
    sensors: Option<Vec<String>>,
    /// Chainages between which the effect acts; `None` if it acts everywhere.
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

/// Formats a number as TOML.
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

/// The keys of `[effects]` that are not names of effects.
#[derive(Debug, Clone, Default)]
pub(crate) struct Choice {
    pub(crate) take: Take,
    leave: Vec<String>,
}

impl Choice {
    /// Reads `take` and `leave`. `instead` overrides the value of `take`.
    ///
    /// Errors: `take` has an unknown value, `leave` is given without `take = "called"`, or `leave` lists a name that is
    /// not an effect.
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

    /// Sets for each implied effect whether and how it is simulated. `is_named` tells whether the scene names an
    /// effect.
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

/// The tables of all implied effects that are simulated, as text to parse.
pub(crate) fn taken(called: &[Called]) -> String {
    let taken = called.iter().filter(|call| call.fate == Fate::Taken);
    taken.map(|call| call.tables.as_str()).collect::<Vec<_>>().concat()
}

#[cfg(test)]
mod tests;
