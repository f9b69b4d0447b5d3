//! Effects implied by a scene's descriptions, with their ranges of chainage and with parameters from data sheets.
//!
//! A lining, silt, a leak, rubble, thrusters, a cable and the models of sensors each imply effects. The key `take` of
//! `[effects]` decides whether implied effects are simulated.

mod call;
mod data_sheets;
mod described;
mod merge;

use headrace_config::{ConfigError, Section};
use headrace_vehicle::VehicleConfig;

use crate::environment::Environment;
use crate::facts::Facts;

pub use call::{Called, Fate};
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
    /// Reads `take` and `leave`. `instead`, if given, overrides the value of `take`.
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

    /// Sets for each implied effect whether and how it is simulated. `is_named` tells whether the scene names the
    /// effect with this name.
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
