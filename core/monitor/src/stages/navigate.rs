//! Readings to fixes.

use bevy_ecs::prelude::{Res, ResMut};

use crate::flow::{ADVICE_PERIOD, Digests, Events, Navigator, Positioned, PositionedList, SensorTable};
use crate::trail::{RecordKind, Trail};
use headrace_fusion::filter::running::Sigmas;
use headrace_fusion::{Fix, NoFix, Times};
use headrace_geometry::time::MonoNs;
use headrace_sensor::reading::Reading;

pub(super) fn navigate(
    events: Res<'_, Events>,
    sensors: Res<'_, SensorTable>,
    mut navigator: ResMut<'_, Navigator>,
    mut list: ResMut<'_, PositionedList>,
    mut digests: ResMut<'_, Digests>,
) {
    list.0.clear();
    let navigator = &mut *navigator;
    for (index, event) in events.0.iter().enumerate() {
        // Time may stand still or go back; a beat is passed once. After a gap only the last beat counts.
        if let Some(at) = beat_before(&mut navigator.next_beat, event.received) {
            let fix = navigator.navigation.fix(at);
            digest(&mut digests.poses, at, &fix, navigator.navigation.sigmas());
            list.0.push(Positioned::Beat { at, fix });
        }
        if matches!(event.reading, Reading::Sonar(_)) {
            let fix = navigator.navigation.fix(event.valid_at);
            list.0.push(Positioned::Ping { event: index, fix });
        }
        if let Some(sensor) = sensors.0.get(event.source.index()) {
            let times = Times { received: event.received, valid: event.valid_at };
            navigator.navigation.update(event.source.index(), sensor, times, &event.reading);
        }
    }
}

/// The last beat at or before `now` that hasn't been given yet.
fn beat_before(next: &mut Option<MonoNs>, now: MonoNs) -> Option<MonoNs> {
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

fn digest(poses: &mut Trail, at: MonoNs, fix: &Result<Fix, NoFix>, sigmas: Option<Sigmas>) {
    let fix = match fix {
        Ok(fix) => fix,
        Err(lacking) => {
            poses.record(RecordKind::NoPose).integer(at.0).integer(*lacking as u64);
            return;
        }
    };
    let place = fix.pose.position;
    poses.record(RecordKind::Pose).integer(at.0).number(place.x()).number(place.y()).number(place.z());
    for part in fix.pose.attitude.wxyz() {
        poses.number(part);
    }
    poses.number(fix.speed_mps);
    if let Some(Sigmas { along_m, place_m, tilt_rad, yaw_rad }) = sigmas {
        poses.number(along_m).number(place_m).number(tilt_rad).number(yaw_rad);
    }
}
