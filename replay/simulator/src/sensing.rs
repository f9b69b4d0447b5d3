//! State of a simulation: an entity for each sensor, and shared resources.
//!
//! A simulation runs slice by slice. Within a slice, each system processes all measurements of its kind at once.

use bevy_ecs::prelude::{Component, Resource};
use headrace_geometry::frames::{Mount, Point3, Pose, Rot, Tunnel, Vec3};
use headrace_geometry::math;
use headrace_geometry::site::Site;
use headrace_geometry::time::{DurNs, MonoNs};
use headrace_sampling::head::HeadSpec;
use headrace_sensor::device::{Direction, Emulator};
use headrace_sensor::measurement::Measurement;

use crate::clock::START;
use crate::environment::{Environment, Hit, What};
use crate::error::SceneError;
use crate::trajectory::Trajectory;

/// Interval of the points on the trajectory that are checked for obstacles, s.
const CHECK_S: f64 = 0.5;

/// Time slice: a span of the dive whose measurements are all processed together.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Resource)]
pub(crate) struct Slice {
    /// Start of the time slice.
    pub from: MonoNs,
    /// End of the time slice. A measurement at exactly this time belongs to the next slice.
    pub until: MonoNs,
}

/// The tunnel, the vehicle's trajectory, and the water.
#[derive(Debug, Clone, Resource)]
pub struct Scenery {
    /// The tunnel around the vehicle, with its contents.
    pub environment: Environment,
    /// Trajectory of the vehicle.
    pub trajectory: Trajectory,
    /// True properties and levels of the water.
    pub site: Site,
    /// Time at which the vehicle starts moving; `None` for the start of the dive.
    pub sets_out: Option<MonoNs>,
}

/// Index of a sensor in the vehicle file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Component)]
pub(crate) struct Source(pub u16);

/// Mount of a sensor on the vehicle.
#[derive(Debug, Clone, Copy, PartialEq, Component)]
pub(crate) struct Mounted(pub Mount);

/// The simulated device at the far end of its line.
#[derive(Component)]
pub(crate) struct Device<M: Measurement>(pub Box<dyn Emulator<M>>);

/// Marks a sensor as a profiling head, with its specification.
#[derive(Debug, Clone, Copy, PartialEq, Component)]
pub(crate) struct Head(pub HeadSpec);

/// Marks a sensor as a fixed echosounder.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Component)]
pub(crate) struct Echosounder;

/// Measurements of a sensor in the current time slice, in order of time.
#[derive(Debug, Clone, Component)]
pub(crate) struct Samples<M: Measurement> {
    /// Number of the first sample, counted from the start of the dive. Effects use it as the step number of their
    /// random numbers.
    pub first: u64,
    /// The measurements, in order of time.
    pub list: Vec<M>,
}

/// Rays of the soundings in the slice, one per sample.
#[derive(Debug, Clone, Default, Component)]
pub(crate) struct Rays(pub Vec<Ray>);

/// Ray along the axis of a sonar's beam.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Ray {
    /// Position of the sonar, where the beam starts.
    pub origin: Point3<Tunnel>,
    /// Direction of the beam, a unit vector.
    pub direction: Vec3<Tunnel>,
    /// Hit of the ray; `None` if nothing is within reach.
    pub hit: Option<Hit>,
}

/// Distance up to which the walls ahead of a sonar are computed, m. It is the sonar's range setting plus a margin.
#[derive(Debug, Clone, Copy, PartialEq, Component)]
pub(crate) struct Reach(pub f64);

/// Messages on a device's line in the current time slice.
#[derive(Debug, Clone, Default, Component)]
pub(crate) struct Line {
    /// The messages in the order in which the device sent them.
    pub messages: Vec<LineMessage>,
    /// Bytes of all messages, one after the other.
    pub bytes: Vec<u8>,
}

/// A message on a device's line.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct LineMessage {
    /// Time at which the first byte crosses the line.
    pub at: MonoNs,
    /// Direction of the message: to or from the device.
    pub direction: Direction,
    /// Start and end of the message in [`Line::bytes`].
    pub bytes: (usize, usize),
    /// Number of the reported measurement within the time slice.
    pub sample: usize,
}

impl<M: Measurement> Default for Samples<M> {
    fn default() -> Self {
        Self { first: 0, list: Vec::new() }
    }
}

impl<M: Measurement> Samples<M> {
    /// The measurements of the time slice, each with its step number.
    pub(crate) fn steps(&mut self) -> impl Iterator<Item = (u64, &mut M)> {
        (self.first..).zip(&mut self.list)
    }
}

impl Scenery {
    /// The vehicle's true pose at time `at`.
    pub fn pose(&self, at: MonoNs) -> Pose {
        let place = self.trajectory.place(self.under_way_s(at));
        let axis = self.environment.axis();
        let [roll, pitch, yaw] = place.turned_rad;
        let yaw = if axis.is_straight() { yaw } else { yaw + axis.heading_rad(place.chainage_m) };
        let attitude = if roll == 0.0 && pitch == 0.0 && yaw == 0.0 {
            Rot::identity()
        } else {
            Rot::from_roll_pitch_yaw(roll, pitch, yaw)
        };
        Pose { position: axis.place(place.chainage_m, place.across_m), attitude }
    }

    /// True chainage of the vehicle at time `at`, m.
    pub fn chainage_m(&self, at: MonoNs) -> f64 {
        self.trajectory.place(self.under_way_s(at)).chainage_m
    }

    /// Time that has passed at `at` since the vehicle started moving, s.
    fn under_way_s(&self, at: MonoNs) -> f64 {
        self.sets_out
            .map_or_else(|| at.since(START).as_secs_f64(), |out| at.since(out).as_secs_f64().max(0.0))
    }

    /// Checks that the trajectory stays in water.
    ///
    /// Errors: the first point outside the water.
    pub(crate) fn check(&self) -> Result<(), SceneError> {
        let steps = math::floor_to_i64(self.trajectory.duration_s() / CHECK_S) + 1;
        let at = |step: i64| (step as f64 * CHECK_S).min(self.trajectory.duration_s());
        let mut from = self.pose(START).position;
        for step in 1..=steps {
            let after_s = at(step);
            let to = self.pose(START + DurNs::from_secs_f64(after_s)).position;
            if let Some(hit) = self.environment.first_obstruction(from, to) {
                let [chainage_m, y_m, z_m] = self.environment.axis().chart(hit.point);
                let what = match hit.what {
                    What::Wall => "the wall".to_owned(),
                    What::Feature(feature) => self.environment.feature_name(feature).to_owned(),
                };
                return Err(SceneError::Blocked { after_s, chainage_m, y_m, z_m, what });
            }
            from = to;
        }
        Ok(())
    }
}

impl Line {
    /// Adds a message to the line.
    pub(crate) fn send(&mut self, at: MonoNs, direction: Direction, bytes: &[u8], sample: usize) {
        let from = self.bytes.len();
        self.bytes.extend_from_slice(bytes);
        self.messages.push(LineMessage { at, direction, bytes: (from, self.bytes.len()), sample });
    }

    /// The bytes of a message on this line.
    pub(crate) fn bytes_of(&self, message: &LineMessage) -> &[u8] {
        let (from, to) = message.bytes;
        self.bytes.get(from..to).unwrap_or_default()
    }

    /// Inserts messages of the line `other`, from number `first` on, in front of the messages of this line.
    pub(crate) fn put_first(&mut self, other: &Self, first: usize) {
        let bytes = &mut self.bytes;
        let moved = other.messages.iter().skip(first).map(|message| {
            let from = bytes.len();
            bytes.extend_from_slice(other.bytes_of(message));
            LineMessage { bytes: (from, bytes.len()), ..*message }
        });
        drop(self.messages.splice(0..0, moved));
    }

    /// Clears the messages of the time slice.
    pub(crate) fn clear(&mut self) {
        self.messages.clear();
        self.bytes.clear();
    }
}
