//! Returns to places on the wall.

use bevy_ecs::prelude::{Query, Res, ResMut};

use crate::flow::{
    Aim, Digests, Event, Events, HeadTable, HiddenAngles, Outcome, Place, Placed, PlacedList, PlacedPing,
    Positioned, PositionedList, SensorTable,
};
use crate::head::HeadTrack;
use crate::trail::RecordKind;
use headrace_coverage::{Doubt, Loss, Reach};
use headrace_fusion::{Fix, NoFix};
use headrace_geometry::frames::{Mount, Pose, Vec3, head_direction};
use headrace_geometry::math;
use headrace_geometry::time::{DurNs, MonoNs};
use headrace_geometry::tunnel::Profile;
use headrace_sampling::head::{HeadMotion, MAX_HEADS};
use headrace_sampling::layout::HeadLayout;
use headrace_sampling::passes::Situation;
use headrace_sensor::reading::{Reading, SonarReturn};

/// A head whose last return is older than this isn't turning.
const SILENT: DurNs = DurNs(2_000_000_000);

#[expect(clippy::too_many_arguments, reason = "a system's arguments are what it reads and writes")]
pub(super) fn place(
    events: Res<'_, Events>,
    positioned: Res<'_, PositionedList>,
    context: Res<'_, Place>,
    heads: Res<'_, HeadTable>,
    sensors: Res<'_, SensorTable>,
    hidden: Res<'_, HiddenAngles>,
    mut tracks: Query<'_, '_, &mut HeadTrack>,
    mut placed: ResMut<'_, PlacedList>,
    mut digests: ResMut<'_, Digests>,
) {
    placed.0.clear();
    for item in &positioned.0 {
        match *item {
            Positioned::Beat { at, fix } => {
                let situation =
                    situation(at, fix, &context.profile, context.layout, &heads, &sensors, &tracks);
                placed.0.push(Placed::Situation(at, situation));
            }
            Positioned::Ping { event, fix } => {
                let Some(event) = events.0.get(event) else { continue };
                let Reading::Sonar(sonar) = event.reading else { continue };
                let Some((head, entity)) = heads.0.get(event.source.index()).copied().flatten() else {
                    continue;
                };
                let (Some(sensor), Ok(mut track)) =
                    (sensors.0.get(event.source.index()), tracks.get_mut(entity))
                else {
                    continue;
                };
                let turned = track.ping(event.valid_at, sonar.angle_rad);
                let hidden = hidden
                    .0
                    .get(head)
                    .is_some_and(|angles| angles.iter().any(|range| range.has(sonar.angle_rad)));
                let outcome = outcome(&sonar, fix, &sensor.mount, hidden, &context);
                let ping = PlacedPing {
                    head,
                    received: event.received,
                    valid_at: event.valid_at,
                    fix: fix.ok(),
                    reach: fix.ok().map(|fix| reach(&fix.pose, &sensor.mount, &context)),
                    single_step: turned.single_step,
                    new_sweep: turned.new_sweep,
                    standing: turned.standing,
                    outcome,
                };
                digest(&mut digests, event, &ping);
                placed.0.push(Placed::Ping(ping));
            }
        }
    }
}

/// What comes back from nearer than this share of the way to the wall, where the vehicle itself stands in the way, is the
/// vehicle.
const VEHICLE_SHARE: f64 = 0.5;

fn outcome(
    sonar: &SonarReturn,
    fix: Result<Fix, NoFix>,
    mount: &Mount,
    hidden: bool,
    context: &Place,
) -> Outcome {
    let fix = match fix {
        Ok(fix) => fix,
        Err(lacking) if sonar.range_m.is_some() => return Outcome::Unplaced(lacking),
        Err(_) => return Outcome::Lost(Loss::Missing, None),
    };
    let origin = fix.pose.place(mount.position);
    let beam = fix.pose.attitude * (mount.rotation * head_direction(sonar.angle_rad));
    let range_m = sonar.range_m.map(|range_m| context.site.rescaled_range_m(range_m, sonar.sound_speed_mps));
    let sample = |range_m: f64| {
        let point = origin + beam.scaled(range_m);
        Outcome::Sample { point, sigma_m: context.profile.sigma_of([point.y(), point.z()]) }
    };
    if let Some(range_m) = range_m.filter(|_| !hidden) {
        return sample(range_m);
    }
    let wall = context.profile.cast([origin.y(), origin.z()], [beam.y(), beam.z()]);
    let aim = wall.map(|wall| Aim { x_m: origin.x() + wall.range_m * beam.x(), sigma_m: wall.sigma_m });
    let wall_m = wall.map(|wall| wall.range_m);
    if let Some(range_m) = range_m.filter(|range_m| wall_m.is_none_or(|wall| *range_m > VEHICLE_SHARE * wall))
    {
        return sample(range_m);
    }
    let longest_m = context.site.rescaled_range_m(sonar.max_range_m, sonar.sound_speed_mps);
    let loss = match wall_m {
        _ if hidden => Loss::Occluded,
        Some(wall_m) if wall_m <= longest_m => Loss::Missing,
        _ => Loss::OutOfRange,
    };
    Outcome::Lost(loss, aim)
}

/// A head lands its samples in the plane across its axis; tilted against the tunnel, the plane spans some chainage.
fn reach(pose: &Pose, mount: &Mount, context: &Place) -> Reach {
    let origin = pose.place(mount.position);
    let axis = pose.attitude * (mount.rotation * Vec3::new(1.0, 0.0, 0.0));
    let across = math::hypot(axis.y(), axis.z()).min(0.99);
    let slope = across / math::sqrt(1.0 - across * across);
    let spread_m = slope * context.profile.farthest_m([origin.y(), origin.z()]);
    Reach { from_m: origin.x() - spread_m, to_m: origin.x() + spread_m }
}

fn situation(
    at: MonoNs,
    fix: Result<Fix, NoFix>,
    profile: &Profile,
    layout: HeadLayout,
    heads: &HeadTable,
    sensors: &SensorTable,
    tracks: &Query<'_, '_, &mut HeadTrack>,
) -> Situation {
    let mut motions = [None; MAX_HEADS];
    for (sensor, head) in sensors.0.iter().zip(&heads.0) {
        let Some((head, entity)) = head else { continue };
        let (Ok(track), Some(slot)) = (tracks.get(*entity), motions.get_mut(*head)) else { continue };
        let (Some((last, angle_rad)), Some(rate_radps), Some(step_rad)) =
            (track.last(), track.rate_radps(), track.step_rad())
        else {
            continue;
        };
        if at.since(last).0.abs() <= SILENT.0 {
            // Heads ping at their own moments; their angles are compared at one.
            let angle_rad = angle_rad + rate_radps * at.since(last).as_secs_f64();
            let sector_rad = track.sector_rad();
            *slot = Some(HeadMotion { mount: sensor.mount, angle_rad, rate_radps, step_rad, sector_rad });
        }
    }
    Situation {
        pose: fix.ok().map(|fix| fix.pose),
        speed_mps: fix.map_or(0.0, |fix| fix.speed_mps),
        doubt_m: fix.map_or(0.0, |fix| Doubt::of(&fix).worst_m(profile)),
        layout,
        configured: heads.0.iter().flatten().count(),
        heads: motions,
    }
}

fn digest(digests: &mut Digests, event: &Event, ping: &PlacedPing) {
    let kind = if matches!(ping.outcome, Outcome::Sample { .. }) {
        RecordKind::Sample
    } else {
        RecordKind::NoSample
    };
    let digest = digests.pings.record(kind).integer(event.received.0).integer(u64::from(event.source.0));
    match ping.outcome {
        Outcome::Sample { point, sigma_m } => {
            digest.integer(0).number(point.x()).number(point.y()).number(point.z()).number(sigma_m);
        }
        Outcome::Lost(loss, _) => {
            digest.integer(1).integer(loss as u64);
        }
        Outcome::Unplaced(lacking) => {
            digest.integer(2).integer(lacking as u64);
        }
    }
}
