//! The stages of every simulation, from polling the devices to encoding their messages, with the base systems.

#![allow(clippy::needless_pass_by_value, reason = "bevy hands systems their arguments by value")]

use bevy_ecs::prelude::{Component, Query, Res, With, Without};
use headrace_geometry::frames::{Mount, Pose, Vec3, head_direction};
use headrace_geometry::math::{self, TAU};
use headrace_sensor::measurement::{GroundVelocity, Inertia, Measurement, Payout, Pressure, Sounding};

use crate::clock::Clock;
use crate::motion::{motion, velocity};
use crate::sensing::{Device, Echosounder, Head, Line, Mounted, Ray, Rays, Reach, Samples, Scenery, Slice};

/// Name of the system [`aim_held`]. Effects use the name to replace the system.
pub(crate) const AIM_HELD: &str = "aim_held";
/// Angle by which a head's rotation may fall short of a whole turn and still count as one, radians.
const SAME_ANGLE_RAD: f64 = 1e-9;

/// Order of processing in a slice. Within a stage, base systems run first, then effects in the order of
/// [`crate::effects::KINDS`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Stage {
    /// Devices give the times and kinds of their measurements.
    Begin,
    /// Heads turn. Effects on beam angles act in this stage.
    Turn,
    /// Sonars get a position and a direction.
    Aim,
    /// Beams hit walls and objects.
    Look,
    /// Pings get a range. Effects on ranges act in this stage.
    Hear,
    /// All sensors except sonars get pressure, motion or cable length. Effects on these quantities act in this stage.
    Feel,
    /// Devices encode their measurements.
    Tell,
    /// Effects on the devices' lines act in this stage.
    Line,
}

impl Stage {
    /// Name of the stage for display.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Begin => "begin",
            Self::Turn => "turn",
            Self::Aim => "aim",
            Self::Look => "look",
            Self::Hear => "hear",
            Self::Feel => "feel",
            Self::Tell => "tell",
            Self::Line => "line",
        }
    }
}

/// State of a head whose pings all start from the vehicle's pose at the start of the turn. The state is this pose, and
/// the head's rotation since then.
#[derive(Debug, Clone, Copy, PartialEq, Default, Component)]
pub(crate) struct Held {
    pose: Option<Pose>,
    last_rad: f64,
    last_step_rad: f64,
    turned_rad: f64,
}

impl Held {
    /// Whether a new turn or sweep begins with a ping at `angle_rad`, which must be the head's next ping.
    fn begins(&mut self, angle_rad: f64) -> bool {
        // The head's first ping has no previous angle.
        let came_rad = if self.pose.is_some() { angle_rad - self.last_rad } else { 0.0 };
        let step_rad = math::wrap_signed(came_rad, TAU);
        self.turned_rad += step_rad.abs();
        let reversed = step_rad * self.last_step_rad < 0.0;
        let begins = self.pose.is_none() || reversed || self.turned_rad >= TAU - SAME_ANGLE_RAD;
        if begins {
            self.turned_rad = 0.0;
        }
        (self.last_rad, self.last_step_rad) = (angle_rad, step_rad);
        begins
    }
}

type Beginning<'a, M> = (&'a mut Device<M>, &'a mut Samples<M>, Option<&'a Clock>);

/// Polls the devices for the measurements of the slice.
///
/// A device with a drifting clock is polled up to the time that its clock shows at the end of the slice. The effect
/// clock_drift later sets the true times.
pub(crate) fn begin<M: Measurement>(slice: Res<'_, Slice>, mut devices: Query<'_, '_, Beginning<'_, M>>) {
    for (mut device, mut samples, clock) in &mut devices {
        let samples = &mut *samples;
        samples.first += samples.list.len() as u64;
        samples.list.clear();
        let until = clock.map_or(slice.until, |clock| clock.shows(slice.until));
        device.0.begin(until, &mut samples.list);
    }
}

/// The ray along a head's beam at an angle.
pub(crate) fn head_ray(pose: &Pose, mount: &Mount, angle_rad: f64) -> Ray {
    let direction = pose.attitude * (mount.rotation * head_direction(angle_rad));
    Ray { origin: pose.place(mount.position), direction, hit: None }
}

type Aimed<'a, Kind> = (&'a Samples<Sounding>, &'a Mounted, &'a mut Rays, Kind);

/// Aims all pings of a head's turn from the vehicle's pose at the start of the turn, as if the turn were measured at
/// one instant.
pub(crate) fn aim_held(
    scenery: Res<'_, Scenery>,
    mut heads: Query<'_, '_, Aimed<'_, &mut Held>, With<Head>>,
) {
    for (samples, mounted, mut rays, mut held) in &mut heads {
        rays.0.clear();
        for sounding in &samples.list {
            if held.begins(sounding.angle_rad) {
                held.pose = Some(scenery.pose(sounding.at));
            }
            if let Some(pose) = &held.pose {
                rays.0.push(head_ray(pose, &mounted.0, sounding.angle_rad));
            }
        }
    }
}

/// Aims each ping of a head from the vehicle's pose at the time of the ping.
pub(crate) fn aim_moving(
    scenery: Res<'_, Scenery>,
    mut heads: Query<'_, '_, (&Samples<Sounding>, &Mounted, &mut Rays), With<Head>>,
) {
    for (samples, mounted, mut rays) in &mut heads {
        rays.0.clear();
        for sounding in &samples.list {
            rays.0.push(head_ray(&scenery.pose(sounding.at), &mounted.0, sounding.angle_rad));
        }
    }
}

/// Aims each echosounder along its own x-axis from the vehicle's pose.
pub(crate) fn aim_echosounders(
    scenery: Res<'_, Scenery>,
    mut sounders: Query<'_, '_, (&Samples<Sounding>, &Mounted, &mut Rays), With<Echosounder>>,
) {
    for (samples, mounted, mut rays) in &mut sounders {
        rays.0.clear();
        for sounding in &samples.list {
            let pose = scenery.pose(sounding.at);
            let direction = pose.attitude * (mounted.0.rotation * Vec3::new(1.0, 0.0, 0.0));
            rays.0.push(Ray { origin: pose.place(mounted.0.position), direction, hit: None });
        }
    }
}

type Looking<'a> = (&'a mut Samples<Sounding>, &'a mut Rays, &'a Reach);

/// Marks sonars whose rays are cast by an effect and not by the base system.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Component)]
pub(crate) struct OwnBeam;

/// Casts each beam as a ray. The range is that of the first hit.
pub(crate) fn look(scenery: Res<'_, Scenery>, mut sonars: Query<'_, '_, Looking<'_>, Without<OwnBeam>>) {
    for (mut samples, mut rays, reach) in &mut sonars {
        for (sounding, ray) in samples.list.iter_mut().zip(&mut rays.0) {
            ray.hit = scenery.environment.cast(ray.origin, ray.direction, reach.0);
            sounding.range_m = ray.hit.map(|hit| hit.range_m);
        }
    }
}

/// Depth sensors measure the water's pressure.
pub(crate) fn feel_pressure(
    scenery: Res<'_, Scenery>,
    mut sensors: Query<'_, '_, (&mut Samples<Pressure>, &Mounted)>,
) {
    for (mut samples, mounted) in &mut sensors {
        for pressure in &mut samples.list {
            let height_m = scenery.pose(pressure.at).place(mounted.0.position).z();
            let site = &scenery.site;
            pressure.pressure_pa = site.pressure_pa(site.surface_above_floor_m - height_m);
        }
    }
}

/// Inertial units measure the vehicle's motion.
pub(crate) fn feel_motion(
    scenery: Res<'_, Scenery>,
    mut units: Query<'_, '_, (&mut Samples<Inertia>, &Mounted)>,
) {
    for (mut samples, mounted) in &mut units {
        for inertia in &mut samples.list {
            *inertia = motion(&scenery, &mounted.0, inertia.at, inertia.period);
        }
    }
}

/// Velocity logs measure the velocity at their mounting point.
pub(crate) fn feel_velocity(
    scenery: Res<'_, Scenery>,
    mut logs: Query<'_, '_, (&mut Samples<GroundVelocity>, &Mounted)>,
) {
    for (mut samples, mounted) in &mut logs {
        for moved in &mut samples.list {
            moved.velocity_mps = velocity(&scenery, &mounted.0, moved.at);
        }
    }
}

/// Cable counters measure the vehicle's chainage as the cable's length.
pub(crate) fn feel_cable(scenery: Res<'_, Scenery>, mut counters: Query<'_, '_, &mut Samples<Payout>>) {
    for mut samples in &mut counters {
        for payout in &mut samples.list {
            payout.chainage_m = scenery.chainage_m(payout.at);
        }
    }
}

/// Marks a cable counter that repeats one count, and holds the chainage of this count, m; `None` until the first count.
#[derive(Debug, Default, Component)]
pub(crate) struct Frozen(Option<f64>);

/// Cable counters that are frozen repeat the first count after they were frozen.
pub(crate) fn freeze(mut counters: Query<'_, '_, (&mut Samples<Payout>, &mut Frozen)>) {
    for (mut samples, mut frozen) in &mut counters {
        for payout in &mut samples.list {
            payout.chainage_m = *frozen.0.get_or_insert(payout.chainage_m);
        }
    }
}

/// Devices encode their measurements onto their lines.
pub(crate) fn tell<M: Measurement>(mut devices: Query<'_, '_, (&mut Device<M>, &Samples<M>, &mut Line)>) {
    for (mut device, samples, mut line) in &mut devices {
        for (number, measured) in samples.list.iter().enumerate() {
            device.0.tell(measured, &mut |direction, at, bytes| line.send(at, direction, bytes, number));
        }
    }
}
