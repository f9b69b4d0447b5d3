//! Faults of devices.

mod line;
mod span;
mod values;

use headrace_config::{ConfigError, Section};
use headrace_geometry::time::DurNs;
use headrace_sensor::device::Sense;
use headrace_sensor::measurement::{GroundVelocity, Inertia, Payout, Pressure, Sounding};

use super::effect::{Effect, EffectKind};
use super::line_delay::SENSES;
use super::targets::PerSensor;
use crate::builder::Builder;
use crate::clock::START;
use crate::error::SceneError;
use crate::facts::Facts;
use crate::stages::Stage;
use line::BrokenLine;
use span::Span;
use values::{Jumped, Stuck};

/// A device has a fault.
///
/// `kind` is the kind of fault, `from_s` its start in seconds from the dive's start (0), `for_s` its duration in
/// seconds (until the dive's end). Afterwards the device works as before.
///
/// - `stick`: the device repeats its last value: range, pressure, attitude with rates and forces, velocity, or cable
///   length. A head continues to turn.
/// - `jump`: the device's value is off by `size`, which is required and from -1000 to 1000. The unit is metres for an
///   echosounder's range and the cable length, degrees for a head's angle and an inertial unit's heading, metres of
///   water for a depth, and m/s along the sensor's x for a velocity.
/// - `die`: the device sends nothing.
/// - `babble`: the device sends as many bytes as without the fault, but random ones.
pub(super) struct DeviceFaultsKind;

#[derive(Debug, Clone, Copy, PartialEq)]
enum Fault {
    Stick,
    Jump { size: f64 },
    Die,
    Babble,
}

#[derive(Debug, Clone, Copy, PartialEq)]
struct Parameters {
    fault: Fault,
    span: Span,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Kind {
    Stick,
    Jump,
    Die,
    Babble,
}

const FAULTS: [(&str, Kind); 4] =
    [("stick", Kind::Stick), ("jump", Kind::Jump), ("die", Kind::Die), ("babble", Kind::Babble)];

/// A time longer than any dive, s.
const LONGEST_S: f64 = 1e6;

impl EffectKind for DeviceFaultsKind {
    fn name(&self) -> &'static str {
        "device_faults"
    }

    fn summary(&self) -> &'static str {
        "a device gets stuck, jumps, stops or sends random bytes for a while"
    }

    fn read(&self, tables: Vec<Section<'_>>, facts: &Facts) -> Result<Box<dyn Effect>, ConfigError> {
        Ok(Box::new(PerSensor::read(tables, facts, &SENSES, |table| {
            let kind = table.required("kind", table.choice("kind", &FAULTS)?)?;
            let from_s = table.number("from_s", 0.0..=LONGEST_S)?.unwrap_or(0.0);
            let for_s = table.number("for_s", 0.001..=LONGEST_S)?.unwrap_or(LONGEST_S);
            let size = table.number("size", -1000.0..=1000.0)?;
            let fault = match kind {
                Kind::Jump => Fault::Jump { size: table.required("size", size)? },
                _ if size.is_some() => return Err(table.invalid("size", "is for kind = \"jump\" only")),
                Kind::Stick => Fault::Stick,
                Kind::Die => Fault::Die,
                Kind::Babble => Fault::Babble,
            };
            let from = START + DurNs::from_secs_f64(from_s);
            Ok(Parameters { fault, span: Span { from, to: from + DurNs::from_secs_f64(for_s) } })
        })?))
    }
}

impl Effect for PerSensor<Parameters> {
    fn build(&self, sim: &mut Builder<'_>) -> Result<(), SceneError> {
        for (source, Parameters { fault, span }) in &self.0 {
            let sense = sim.facts().sensors.get(*source).map(|sensor| sensor.sense);
            match fault {
                Fault::Stick => match sense {
                    Some(Sense::Head | Sense::Echosounder) => {
                        sim.insert(*source, Stuck::<Sounding>::new(*span));
                    }
                    Some(Sense::Depth) => sim.insert(*source, Stuck::<Pressure>::new(*span)),
                    Some(Sense::Inertial) => sim.insert(*source, Stuck::<Inertia>::new(*span)),
                    Some(Sense::Velocity) => sim.insert(*source, Stuck::<GroundVelocity>::new(*span)),
                    Some(Sense::Tether) => sim.insert(*source, Stuck::<Payout>::new(*span)),
                    None => {}
                },
                Fault::Jump { size } => sim.insert(*source, Jumped { size: *size, span: *span }),
                Fault::Die => sim.insert(*source, BrokenLine::silent(*span)),
                Fault::Babble => {
                    let stream = sim.stream(*source);
                    sim.insert(*source, BrokenLine::babbling(*span, stream));
                }
            }
        }
        sim.system(Stage::Hear, values::stick::<Sounding>);
        sim.system(Stage::Hear, values::jump_soundings);
        sim.system(Stage::Feel, values::stick::<Pressure>);
        sim.system(Stage::Feel, values::stick::<Inertia>);
        sim.system(Stage::Feel, values::stick::<GroundVelocity>);
        sim.system(Stage::Feel, values::stick::<Payout>);
        sim.system(Stage::Feel, values::jump_others);
        sim.system(Stage::Line, line::break_lines);
        Ok(())
    }
}

#[cfg(test)]
mod tests;
