//! Converts sensor readings to fixes of the vehicle.

use bevy_ecs::entity::Entity;
use bevy_ecs::prelude::{Query, Res, ResMut, Resource, Single};

use super::decode::Events;
use crate::advice_log::ADVICE_PERIOD;
use crate::entities::{Mounted, Navigator, VehicleEntities, VehicleState};
use crate::messages::{Doubts, Event};
use crate::result_stream::{RecordKind, ResultStream};
use headrace_fusion::filter::pose_sd::PoseSd;
use headrace_fusion::{Fix, NoFix, Times};
use headrace_geometry::snapshot::{Restorer, Saver, SnapshotError, Stateful};
use headrace_geometry::time::MonoNs;
use headrace_sensor::reading::Reading;

/// A sonar ping, or an advice update at a multiple of [`ADVICE_PERIOD`], with its fix.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Positioned {
    /// A sonar ping. The fix is for the ping's time of validity.
    Ping { event: usize, sensor: Entity, fix: Result<Fix, NoFix> },
    /// An advice update at a multiple of the advice period. `before` is the index of the first event after the update.
    AdviceUpdate { at: MonoNs, fix: Result<Fix, NoFix>, doubts: Doubts, sd: Option<PoseSd>, before: usize },
}

/// Sonar pings and advice updates of this tick with their fixes, in order.
#[derive(Debug, Resource)]
pub(super) struct PositionedList(pub(super) Vec<Positioned>);

/// Result stream of the vehicle's poses at the advice updates.
#[derive(Debug, Default, Resource)]
pub(crate) struct Poses(pub(crate) ResultStream);

impl Stateful for Poses {
    fn save(&self, to: &mut Saver) {
        self.0.save(to);
    }

    fn restore(&mut self, from: &mut Restorer<'_>) -> Result<(), SnapshotError> {
        self.0.restore(from)
    }
}

pub(super) fn navigate(
    events: Res<'_, Events>,
    entities: Res<'_, VehicleEntities>,
    sensors: Query<'_, '_, &Mounted>,
    vehicle: Single<'_, '_, (&mut Navigator, &mut VehicleState)>,
    mut list: ResMut<'_, PositionedList>,
    mut poses: ResMut<'_, Poses>,
) {
    list.0.clear();
    let (mut navigator, mut state) = vehicle.into_inner();
    let navigator = &mut *navigator;
    for (index, event) in events.0.iter().enumerate() {
        // Time may stall or go back, but each advice update is emitted only once. After a gap, only the latest update
        // is emitted.
        if let Some(at) = update_before(&mut navigator.next_update, event.received) {
            let fix = navigator.navigation.fix(at);
            let navigation = &navigator.navigation;
            let (cable, setting) = (navigation.cable_doubt(), navigation.setting_doubt());
            let unverified_mounts = navigation.has_unverified_mounts();
            let stand_s = navigation.stand_s();
            let doubts = Doubts { cable, setting, unverified_mounts, stand_s, hung: navigator.hung };
            let sd = navigation.pose_sd();
            *state = VehicleState { at: Some(at), fix, sd, cable_doubt: doubts.cable };
            digest(&mut poses.0, at, &state);
            list.0.push(Positioned::AdviceUpdate { at, fix, doubts, sd, before: index });
        }
        let sensor = entities.of_source(event.source);
        if let (Reading::Sonar(_), Some(sensor)) = (&event.reading, sensor) {
            let fix = navigator.navigation.fix(event.valid_at);
            list.0.push(Positioned::Ping { event: index, sensor, fix });
        }
        if let Some(mounted) = sensor.and_then(|sensor| sensors.get(sensor).ok()) {
            if navigator.hangs(event) {
                continue;
            }
            let times = Times { received: event.received, valid: event.valid_at };
            navigator.navigation.update(event.source.index(), &mounted.info, times, &event.reading);
        }
    }
}

impl Navigator {
    /// Whether the source of an event is a stuck inertial unit or velocity log. Its repeated readings are ignored.
    fn hangs(&mut self, event: &Event) -> bool {
        let source = event.source.index();
        let bit = 1_u64 << (source % 64);
        if let (Reading::AngularRate(vector) | Reading::VelocityOverGround(vector), Some(repeats)) =
            (&event.reading, self.repeats.get_mut(source))
        {
            let hangs = repeats.hangs(event.received, *vector);
            self.hung = if hangs { self.hung | bit } else { self.hung & !bit };
        }
        self.hung & bit != 0
    }
}

/// Time of the latest advice update at or before `now`; `None` if this update was already emitted.
fn update_before(next: &mut Option<MonoNs>, now: MonoNs) -> Option<MonoNs> {
    let period = ADVICE_PERIOD.0.unsigned_abs();
    let last = MonoNs(now.0 - now.0 % period);
    match *next {
        Some(due) if now < due => None,
        Some(_) => {
            *next = Some(last + ADVICE_PERIOD);
            Some(last)
        }
        None => {
            *next = Some(last + ADVICE_PERIOD);
            None
        }
    }
}

fn digest(poses: &mut ResultStream, at: MonoNs, state: &VehicleState) {
    let fix = match &state.fix {
        Ok(fix) => fix,
        Err(no_fix) => {
            poses.record(RecordKind::NoPose).integer(at.0).integer(*no_fix as u64);
            return;
        }
    };
    let place = fix.pose.position;
    poses.record(RecordKind::Pose).integer(at.0).number(place.x()).number(place.y()).number(place.z());
    for part in fix.pose.attitude.wxyz() {
        poses.number(part);
    }
    poses.number(fix.speed_mps);
    if let Some(sd) = state.sd {
        poses.number(sd.along_m).number(sd.place_m).number(sd.tilt_rad).number(sd.yaw_rad);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use headrace_geometry::time::DurNs;

    /// Updates come five times a second, from the first packet on.
    #[test]
    fn each_update_is_due_at_most_once() {
        let at = |seconds: f64| MonoNs(0) + DurNs::from_secs_f64(seconds);
        let mut next = None;
        for (now_s, beat_s) in [
            (1.05, None),
            (1.199, None),
            (1.2, Some(1.2)),
            (1.21, None),
            // The time of the packets goes back, then catches up.
            (0.3, None),
            (1.39, None),
            (1.43, Some(1.4)),
            // After a gap in the data.
            (5.07, Some(5.0)),
            (5.19, None),
            (5.2, Some(5.2)),
        ] {
            assert_eq!(update_before(&mut next, at(now_s)), beat_s.map(at), "at {now_s} s");
        }
    }
}
