//! Faults of devices.

use bevy_ecs::prelude::{Component, Query, Res};
use headrace_config::{ConfigError, Section};
use headrace_geometry::frames::Rot;
use headrace_geometry::math;
use headrace_geometry::time::{DurNs, MonoNs};
use headrace_sensor::device::{Direction, Sense};
use headrace_sensor::measurement::{GroundVelocity, Inertia, Measurement, Payout, Pressure, Sounding};

use super::effect::{Effect, EffectKind};
use super::line_delay::SENSES;
use super::targets::PerSensor;
use crate::builder::Builder;
use crate::clock::START;
use crate::error::SceneError;
use crate::facts::Facts;
use crate::random::Stream;
use crate::sensing::{Echosounder, Line, Samples, Scenery};
use crate::stages::Stage;

/// A device has a fault.
///
/// `kind` is the kind of fault. `from_s` is its start in seconds from the dive's start, 0 by default. `for_s` is its
/// duration in seconds, by default until the dive's end. After the fault the device works as before.
///
/// - `stick`: the device repeats its last value: range, pressure, attitude with rates and forces, velocity, or cable
///   length. A head continues to turn.
/// - `jump`: the device's value is off by `size`, which is required and from -1000 to 1000. The unit is metres for an
///   echosounder's range and the cable length, degrees for a head's angle and an inertial unit's heading, metres of
///   water for a depth, and m/s along the sensor's x for a velocity.
/// - `die`: the device sends nothing.
/// - `babble`: the device sends random bytes, as many as it would send without the fault.
pub(super) struct DeviceFaultsKind;

#[derive(Debug, Clone, Copy, PartialEq)]
enum Fault {
    Stick,
    Jump { size: f64 },
    Die,
    Babble,
}

/// Time span of a fault. The time `to` is no longer part of the span.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Span {
    from: MonoNs,
    to: MonoNs,
}

impl Span {
    fn holds(&self, at: MonoNs) -> bool {
        (self.from..self.to).contains(&at)
    }
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
                _ if size.is_some() => return Err(table.invalid("size", "applies to kind = \"jump\" only")),
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
        sim.system(Stage::Hear, stick::<Sounding>);
        sim.system(Stage::Hear, jump_soundings);
        sim.system(Stage::Feel, stick::<Pressure>);
        sim.system(Stage::Feel, stick::<Inertia>);
        sim.system(Stage::Feel, stick::<GroundVelocity>);
        sim.system(Stage::Feel, stick::<Payout>);
        sim.system(Stage::Feel, jump_others);
        sim.system(Stage::Line, break_lines);
        Ok(())
    }
}

/// Makes a sensor repeat the last value that it had before the fault.
#[derive(Component)]
struct Stuck<M: Measurement> {
    span: Span,
    held: Option<M>,
}

impl<M: Measurement> Stuck<M> {
    fn new(span: Span) -> Self {
        Self { span, held: None }
    }
}

/// A measurement whose value can be replaced by another measurement's value.
trait Sticking: Measurement {
    /// Returns this measurement with the value of `other`. This measurement's own time and head angles are kept.
    #[must_use]
    fn valued(self, other: &Self) -> Self;
}

impl Sticking for Sounding {
    fn valued(self, other: &Self) -> Self {
        Self { range_m: other.range_m, ..self }
    }
}

impl Sticking for Pressure {
    fn valued(self, other: &Self) -> Self {
        Self { at: self.at, ..*other }
    }
}

impl Sticking for Inertia {
    fn valued(self, other: &Self) -> Self {
        Self { at: self.at, period: self.period, ..*other }
    }
}

impl Sticking for GroundVelocity {
    fn valued(self, other: &Self) -> Self {
        Self { at: self.at, ..*other }
    }
}

impl Sticking for Payout {
    fn valued(self, other: &Self) -> Self {
        Self { at: self.at, ..*other }
    }
}

/// Makes stuck devices repeat their last value before the fault. A device that is stuck from the dive's start repeats
/// its first value.
fn stick<M: Sticking>(mut devices: Query<'_, '_, (&mut Samples<M>, &mut Stuck<M>)>) {
    for (mut samples, mut stuck) in &mut devices {
        for measured in &mut samples.list {
            if stuck.span.holds(measured.at())
                && let Some(held) = &stuck.held
            {
                *measured = measured.valued(held);
            }
            stuck.held = Some(*measured);
        }
    }
}

/// Adds a constant error to the values of a sensor.
#[derive(Component)]
struct Jumped {
    size: f64,
    span: Span,
}

fn jump_soundings(mut sonars: Query<'_, '_, (&mut Samples<Sounding>, &Jumped, Option<&Echosounder>)>) {
    for (mut samples, Jumped { size, span }, echosounder) in &mut sonars {
        for sounding in samples.list.iter_mut().filter(|sounding| span.holds(sounding.at)) {
            if echosounder.is_some() {
                // A range must not become negative, even if the added error is negative.
                sounding.range_m = sounding.range_m.map(|range_m| (range_m + size).max(0.0));
            } else {
                sounding.reported_rad += size.to_radians();
            }
        }
    }
}

type Others<'a> = (
    &'a Jumped,
    Option<&'a mut Samples<Pressure>>,
    Option<&'a mut Samples<Inertia>>,
    Option<&'a mut Samples<GroundVelocity>>,
    Option<&'a mut Samples<Payout>>,
);

fn jump_others(scenery: Res<'_, Scenery>, mut sensors: Query<'_, '_, Others<'_>>) {
    let site = &scenery.site;
    for (Jumped { size, span }, pressures, inertias, velocities, payouts) in &mut sensors {
        within(pressures, span, |pressure| {
            pressure.pressure_pa = site.pressure_pa(site.depth_m(pressure.pressure_pa) + size);
        });
        within(inertias, span, |inertia| {
            let (roll, pitch, yaw) = inertia.attitude.roll_pitch_yaw();
            inertia.attitude = Rot::from_roll_pitch_yaw(roll, pitch, yaw + size.to_radians());
        });
        within(velocities, span, |moved| {
            let [x, y, z] = moved.velocity_mps.0.into();
            moved.velocity_mps = headrace_geometry::frames::Vec3::new(x + size, y, z);
        });
        within(payouts, span, |payout| payout.chainage_m += size);
    }
}

fn within<M: Measurement>(
    samples: Option<bevy_ecs::change_detection::Mut<'_, Samples<M>>>,
    span: &Span,
    change: impl Fn(&mut M),
) {
    if let Some(mut samples) = samples {
        samples.list.iter_mut().filter(|measured| span.holds(measured.at())).for_each(change);
    }
}

/// Makes a device's line silent, or replaces its bytes with random bytes.
#[derive(Component)]
struct BrokenLine {
    span: Span,
    /// Source of the random bytes; `None` for a silent line.
    stream: Option<Stream>,
    /// Number of random bytes sent so far by a babbling device.
    said: u64,
}

impl BrokenLine {
    fn silent(span: Span) -> Self {
        Self { span, stream: None, said: 0 }
    }

    fn babbling(span: Span, stream: Stream) -> Self {
        Self { span, stream: Some(stream), said: 0 }
    }

    fn break_line(&mut self, line: &mut Line) {
        let Line { messages, bytes } = line;
        let received = messages.iter_mut().filter(|message| message.direction == Direction::Received);
        for message in received.filter(|message| self.span.holds(message.at)) {
            let (from, to) = message.bytes;
            let Some(stream) = self.stream else {
                // Messages without bytes keep their indices. The outbox, which sends the messages, drops them.
                message.bytes = (from, from);
                continue;
            };
            for byte in bytes.get_mut(from..to).unwrap_or_default() {
                let [u, _] = stream.at(self.said).uniform();
                *byte = u8::try_from(math::floor_to_i64(256.0 * u)).unwrap_or_default();
                self.said += 1;
            }
        }
    }
}

fn break_lines(mut lines: Query<'_, '_, (&mut Line, &mut BrokenLine)>) {
    for (mut line, mut broken) in &mut lines {
        broken.break_line(&mut line);
    }
}

#[cfg(test)]
mod tests;
