//! Converts returns to points on the wall.

use bevy_ecs::prelude::{Query, Res, ResMut, Resource};
use bevy_ecs::query::QueryItem;

use super::decode::Events;
use super::navigate::{Positioned, PositionedList};
use crate::entities::{Head, HiddenAngles, LossCount, MeasuredMotion, Mounted};
use crate::head_health::Heard;
use crate::messages::{Event, Hidden, Outcome, PlacedItem, PlacedPing, Placement, Update};
use crate::resources::{Plan, TunnelDesign};
use headrace_coverage::deviation::off_m;
use headrace_coverage::{Loss, PassError};
use headrace_fusion::{Fix, NoFix};
use headrace_geometry::frames::{Mount, head_direction};
use headrace_geometry::time::MonoNs;
use headrace_geometry::tunnel::WallPoint;
use headrace_sampling::head::{HeadMotion, HeadSet, MAX_HEADS, SILENT_AFTER};
use headrace_sampling::losses::LossRate;
use headrace_sampling::passes::Situation;
use headrace_sensor::reading::{Reading, SonarReturn};

/// Query for a head: number, mount, measured motion, losses and occluded angles.
type Heads<'w, 's> = Query<'w, 's, HeadParts>;
type HeadParts = (
    &'static Head,
    &'static Mounted,
    &'static mut MeasuredMotion,
    &'static mut LossCount,
    &'static HiddenAngles,
);

/// Georeferenced pings and advice updates of this tick, in order.
#[derive(Debug, Default, Resource)]
pub(super) struct PlacedList(pub(super) Vec<PlacedItem>);

pub(super) fn georeference(
    events: Res<'_, Events>,
    positioned: Res<'_, PositionedList>,
    tunnel: Res<'_, TunnelDesign>,
    plan: Res<'_, Plan>,
    mut heads: Heads<'_, '_>,
    mut placed: ResMut<'_, PlacedList>,
) {
    placed.0.clear();
    for item in &positioned.0 {
        match *item {
            Positioned::AdviceUpdate { at, fix, doubts, sd, before } => {
                let situation = situation(at, fix, &tunnel, &plan, &heads);
                let placement = Placement::Update(Update { at, situation, doubts, fix, sd });
                placed.0.push(PlacedItem { event: before, placement });
            }
            Positioned::Ping { event: index, sensor, fix } => {
                let (Some(event), Ok(head)) = (events.0.get(index), heads.get_mut(sensor)) else { continue };
                let Reading::Sonar(sonar) = event.reading else {
                    debug_assert!(
                        false,
                        "event {index} was positioned as a ping, but is {:?}",
                        event.reading
                    );
                    continue;
                };
                let placement = Placement::Ping(place(event, &sonar, fix, head, &tunnel));
                placed.0.push(PlacedItem { event: index, placement });
            }
        }
    }
}

/// Georeferences a head's ping.
fn place(
    event: &Event,
    sonar: &SonarReturn,
    fix: Result<Fix, NoFix>,
    (head, mounted, mut motion, mut losses, hidden): QueryItem<'_, '_, HeadParts>,
    tunnel: &TunnelDesign,
) -> PlacedPing {
    let turned = motion.ping(event.valid_at, sonar.angle_rad);
    let mount = &mounted.info.mount;
    let hides = hidden.hides(sonar.angle_rad);
    let beside = [-BESIDE_RAD, BESIDE_RAD].iter().any(|by| hidden.hides(sonar.angle_rad + by));
    let ping = PlacedPing {
        head: head.0,
        received: event.received,
        valid_at: event.valid_at,
        fix: fix.ok(),
        reach: fix.ok().map(|fix| tunnel.reach(&fix.pose, mount)),
        single_step: turned.single_step,
        new_sweep: turned.new_sweep,
        standing: turned.standing,
        outcome: outcome(sonar, fix, mount, hides, tunnel),
        angle_rad: sonar.angle_rad,
        hidden: if hides {
            Hidden::Yes
        } else if beside {
            Hidden::Beside
        } else {
            Hidden::No
        },
        longest_m: longest_m(sonar, tunnel),
        source: event.source,
        origin: fix.ok().map(|fix| fix.pose.place(mount.position)),
    };
    if !ping.standing {
        count(&mut losses, &ping, sonar.range_m, tunnel);
    }
    ping
}

/// Counts a ping that was aimed at wall within range, for the head's loss statistics.
fn count(losses: &mut LossCount, ping: &PlacedPing, range_m: Option<f64>, tunnel: &TunnelDesign) {
    match ping.outcome {
        Outcome::Sample { point, arc_m } => {
            let off_m = off_m(&tunnel.profile, [point.y(), point.z()], arc_m);
            losses.ping(ping.angle_rad, false);
            let is_wall = off_m.abs() <= tunnel.contradiction_m;
            losses.hear(ping.angle_rad, range_m.map(|range_m| Heard { range_m, off_m, is_wall }));
        }
        Outcome::Lost(Loss::Missing, Some(_)) => {
            losses.ping(ping.angle_rad, true);
            losses.hear(ping.angle_rad, None);
        }
        Outcome::Lost(..) | Outcome::Unplaced(_) => {}
    }
}

/// Margin on either side of the occluded angles, radians. Beams within this margin may also return echoes from the
/// vehicle.
const BESIDE_RAD: f64 = 0.09;
/// A return at an occluded angle comes from the vehicle if its range is below this share of the range to the wall.
const VEHICLE_SHARE: f64 = 0.5;

fn outcome(
    sonar: &SonarReturn,
    fix: Result<Fix, NoFix>,
    mount: &Mount,
    hidden: bool,
    tunnel: &TunnelDesign,
) -> Outcome {
    let fix = match fix {
        Ok(fix) => fix,
        Err(no_fix) if sonar.range_m.is_some() => return Outcome::Unplaced(no_fix),
        Err(_) => return Outcome::Lost(Loss::Missing, None),
    };
    let origin = fix.pose.place(mount.position);
    let beam = fix.pose.attitude * (mount.rotation * head_direction(sonar.angle_rad));
    let range_m = sonar.range_m.map(|range_m| tunnel.site.rescaled_range_m(range_m, sonar.sound_speed_mps));
    let sample = |range_m: f64| {
        let point = origin + beam.scaled(range_m);
        Outcome::Sample { point, arc_m: tunnel.profile.arc_of([point.y(), point.z()]) }
    };
    if let Some(range_m) = range_m.filter(|_| !hidden) {
        return sample(range_m);
    }
    let wall = tunnel.profile.cast([origin.y(), origin.z()], [beam.y(), beam.z()]);
    let aim = wall.map(|wall| WallPoint { x_m: origin.x() + wall.range_m * beam.x(), arc_m: wall.arc_m });
    let wall_m = wall.map(|wall| wall.range_m);
    if let Some(range_m) = range_m.filter(|range_m| wall_m.is_none_or(|wall| *range_m > VEHICLE_SHARE * wall))
    {
        return sample(range_m);
    }
    let loss = match wall_m {
        // Wall beyond the longest range counts as out of range, even if the vehicle occludes it.
        Some(wall_m) if wall_m > longest_m(sonar, tunnel) => Loss::OutOfRange,
        _ if hidden => Loss::Occluded,
        Some(_) => Loss::Missing,
        None => Loss::OutOfRange,
    };
    Outcome::Lost(loss, aim)
}

/// Longest range at the head's range setting, corrected for the speed of sound in this water, m.
fn longest_m(sonar: &SonarReturn, tunnel: &TunnelDesign) -> f64 {
    tunnel.site.rescaled_range_m(sonar.max_range_m, sonar.sound_speed_mps)
}

fn situation(
    at: MonoNs,
    fix: Result<Fix, NoFix>,
    tunnel: &TunnelDesign,
    plan: &Plan,
    heads: &Heads<'_, '_>,
) -> Situation {
    let mut motions = [None; MAX_HEADS];
    let mut losses = [LossRate::default(); MAX_HEADS];
    let mut lost_at_most = LossRate::default();
    let mut deaf = HeadSet::default();
    for (head, mounted, track, lost, _) in heads {
        if let Some(slot) = losses.get_mut(head.0) {
            *slot = lost.rate();
        }
        let (Some((last, angle_rad)), Some(rate_radps), Some(step_rad), Some(slot)) =
            (track.last(), track.rate_radps(), track.step_rad(), motions.get_mut(head.0))
        else {
            continue;
        };
        if at.since(last).0.abs() <= SILENT_AFTER.0 {
            // Heads ping at different times, so their angles are extrapolated to the same time.
            let angle_rad = angle_rad + rate_radps * at.since(last).as_secs_f64();
            let (mount, sector_rad) = (mounted.info.mount, track.sector_rad());
            let others = heads.iter().filter(|(other, ..)| other.0 != head.0);
            if lost.health().is_deaf(others.map(|(.., lost, _)| lost.health().elsewhere())) {
                deaf = deaf.with(head.0);
            } else {
                *slot = Some(HeadMotion { mount, angle_rad, rate_radps, step_rad, sector_rad });
                let at_most = lost.at_most();
                lost_at_most = if at_most.share > lost_at_most.share { at_most } else { lost_at_most };
            }
        }
    }
    Situation {
        pose: fix.ok().map(|fix| fix.pose),
        speed_mps: fix.map_or(0.0, |fix| fix.speed_mps),
        pass_error_m: fix.map_or(0.0, |fix| PassError::of(&fix).worst_m(&tunnel.profile)),
        layout: plan.layout,
        configured: heads.iter().len(),
        heads: motions,
        deaf,
        losses,
        lost_at_most,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bevy_ecs::system::SystemState;
    use bevy_ecs::world::World;
    use headrace_coverage::{OtherSettings, WallLimits};
    use headrace_fusion::relative::Relative;
    use headrace_geometry::frames::{Point3, Pose, Rot, Vec3};
    use headrace_geometry::math;
    use headrace_geometry::site::Site;
    use headrace_geometry::time::DurNs;
    use headrace_geometry::tunnel::shapes;
    use headrace_sampling::Target;
    use headrace_sampling::layout::HeadLayout;
    use headrace_sensor::device::{SensorInfo, SensorKind};
    use headrace_sensor::reading::SourceId;

    fn tunnel() -> TunnelDesign {
        let profile = shapes::circle(3.0).unwrap();
        let limits = WallLimits::new(profile.perimeter_m(), 1.0, 2.0);
        let (site, length_m) = (Site::default(), 30.0);
        TunnelDesign { profile, site, length_m, contradiction_m: 1.0, limits }
    }

    /// Outcome of a ping at 90 degrees, to the left, from the centre of a pipe of 3 m radius. The head
    /// assumes the speed of sound of the water.
    fn heard(range_m: Option<f64>, hidden: bool) -> Outcome {
        let tunnel = tunnel();
        let [y_m, z_m] = tunnel.profile.reference();
        let pose = Pose { position: Point3::new(10.0, y_m, z_m), attitude: Rot::identity() };
        let relative = Relative::along(0.01);
        let fix = Fix { pose, speed_mps: 0.1, relative, revisit: relative, tie: 0, settled: 0 };
        let mount = Mount { position: Vec3::zero(), rotation: Rot::identity() };
        let sound_speed_mps = tunnel.site.sound_speed_mps;
        let [angle_rad, max_range_m, resolution_m] = [math::FRAC_PI_2, 5.0, 0.005];
        let sonar = SonarReturn { angle_rad, range_m, max_range_m, resolution_m, sound_speed_mps };
        outcome(&sonar, Ok(fix), &mount, hidden, &tunnel)
    }

    #[test]
    fn echo_from_the_vehicle_is_not_wall() {
        for range_m in [0.1, 0.75, 1.4] {
            assert!(
                matches!(heard(Some(range_m), true), Outcome::Lost(Loss::Occluded, Some(_))),
                "{range_m}"
            );
            assert!(matches!(heard(Some(range_m), false), Outcome::Sample { .. }), "{range_m}");
        }
        // A return from more than half the wall's distance is not from the vehicle.
        assert!(matches!(heard(Some(1.6), true), Outcome::Sample { .. }));
        assert!(matches!(heard(None, true), Outcome::Lost(Loss::Occluded, Some(_))));
        assert!(matches!(heard(None, false), Outcome::Lost(Loss::Missing, Some(_))));
    }

    /// Angles are extrapolated to the advice update, even if the head hasn't pinged at that time. A head
    /// silent for over two seconds is left out.
    #[test]
    fn head_angles_are_extrapolated_to_the_update() {
        const RATE_RADPS: f64 = 0.785;
        let at = |seconds: f64| MonoNs(0) + DurNs::from_secs_f64(seconds);
        // For each head, which makes 400 pings in 8 s: time of its first ping, and turn rate.
        let heads = [(1.0, RATE_RADPS), (3.0, -RATE_RADPS), (0.5, RATE_RADPS)];
        let mut world = World::new();
        for (number, (from_s, rate_radps)) in heads.into_iter().enumerate() {
            let mut motion = MeasuredMotion::default();
            for ping in 0..400_u32 {
                let after_s = 0.02 * f64::from(ping);
                motion.ping(at(from_s + after_s), 1.0 + rate_radps * after_s);
            }
            let mount = Mount { position: Vec3::zero(), rotation: Rot::identity() };
            let info = SensorInfo { mount, kind: SensorKind::Head };
            let mounted = Mounted { source: SourceId(0), info };
            world.spawn((Head(number), mounted, motion, LossCount::default(), HiddenAngles(Vec::new())));
        }
        let (tunnel, other) = (tunnel(), OtherSettings::default());
        let layout = HeadLayout::PhaseShift;
        let plan = Plan { target: Target::new(0.5), layout, planned_speed_mps: 0.0, other };
        let mut state = SystemState::<Heads<'_, '_>>::new(&mut world);
        let query = state.get_mut(&mut world).unwrap();
        let found = situation(at(10.53), Err(NoFix::Heading), &tunnel, &plan, &query);
        for (motion, (from_s, rate_radps)) in found.heads.iter().zip(heads).take(2) {
            let motion = motion.unwrap();
            let off_rad = motion.angle_rad - 1.0 - rate_radps * (10.53 - from_s);
            assert!(math::wrap_signed(off_rad, math::TAU).abs() < 1e-6, "{from_s}: {off_rad}");
            assert!((motion.rate_radps - rate_radps).abs() < 1e-6);
        }
        assert!(found.heads[2..].iter().all(Option::is_none), "the third head's last ping was at 8.48 s");
        assert_eq!((found.configured, found.pose.is_none()), (3, true));
    }
}
