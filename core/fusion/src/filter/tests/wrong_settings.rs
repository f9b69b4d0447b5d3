//! Detection of wrong settings in a dive of some minutes, by the filter alone.

use super::super::FilterNavigation;
use super::super::setting_check::{Setting, SettingDoubt};
use super::rig::{HEADS, Rig, at, cruise, rest, swing, swing_in_place};
use crate::Navigation as _;
use crate::relative::Relative;
use headrace_geometry::math;
use headrace_sensor::reading::{Reading, SonarReturn};

/// Returns the filter's doubt about settings after a dive of four minutes. `echoes` multiplies all echosounder ranges,
/// and `change` changes each return of a head.
fn doubted(echoes: f64, change: impl Fn(usize, SonarReturn) -> SonarReturn) -> Option<SettingDoubt> {
    let rig = Rig::new(cruise, 3);
    let mut nav: FilterNavigation = rig.navigation();
    for mut event in rig.events(0.0, 240.0) {
        event.reading = match event.reading {
            Reading::Sonar(sonar) => Reading::Sonar(change(event.source - HEADS, sonar)),
            Reading::Echo(mut echo) => {
                echo.range_m = echo.range_m.map(|range_m| range_m * echoes);
                Reading::Echo(echo)
            }
            other => other,
        };
        Rig::hear(&mut nav, &event);
    }
    nav.setting_doubt()
}

#[test]
fn correct_settings_are_not_doubted() {
    assert_eq!(doubted(1.0, |_, sonar| sonar), None);
}

#[test]
fn scaled_ranges_are_reported_with_their_scale() {
    let scale = |_, sonar: SonarReturn| SonarReturn { range_m: sonar.range_m.map(|m| 1.04 * m), ..sonar };
    let doubt = doubted(1.04, scale).unwrap();
    assert!(
        matches!(doubt, SettingDoubt { setting: Setting::RangeScale(share), source: None, .. } if (share - 0.04).abs() < 0.01),
        "{doubt:?}"
    );
}

#[test]
fn rotated_head_is_reported_with_its_angle() {
    for (head, turned_rad) in [(0, 0.1), (1, -0.08)] {
        let turn = |number, sonar: SonarReturn| {
            let off_rad = if number == head { turned_rad } else { 0.0 };
            SonarReturn { angle_rad: sonar.angle_rad + off_rad, ..sonar }
        };
        let doubt = doubted(1.0, turn).unwrap();
        let is_named = doubt.source.is_some_and(|source| usize::from(source) == HEADS + head);
        assert!(
            is_named
                && matches!(doubt.setting, Setting::HeadTurned(rad) if (rad.abs() - turned_rad.abs()).abs() < 0.02),
            "{turned_rad} of head {head}: {doubt:?}"
        );
    }
}

/// Feeds the readings of a dive to a filter with this declared mount error. `is_heard` selects the sources.
fn dived(rig: &Rig, to_s: f64, mount_sd_deg: f64, is_heard: &dyn Fn(usize) -> bool) -> FilterNavigation {
    let mut nav = rig.navigation();
    nav.context.settings.mount_sd_rad = mount_sd_deg.to_radians();
    for event in rig.events(0.0, to_s).iter().filter(|event| is_heard(event.source)) {
        Rig::hear(&mut nav, event);
    }
    nav
}

const ALL: &dyn Fn(usize) -> bool = &|_| true;

#[test]
fn slow_swing_verifies_mounts_and_reveals_a_yawed_head() {
    for (yaw_rad, seed) in [(0.0, 1), (0.0, 2), (0.052, 3), (-0.065, 4)] {
        let rig = Rig { head_yaw_rad: yaw_rad, ..Rig::new(swing, seed) };
        assert!(dived(&rig, 20.0, 0.0, ALL).has_unverified_mounts(), "a swing of 20 s is too short");
        let nav = dived(&rig, 240.0, 0.0, ALL);
        let doubt = nav.setting_doubt();
        assert!(!nav.has_unverified_mounts(), "{yaw_rad}: {doubt:?}");
        match doubt {
            None => assert!(yaw_rad == 0.0, "{yaw_rad} is not reported"),
            Some(SettingDoubt { setting: Setting::HeadYawed(by_rad), source, .. }) => {
                assert_eq!(source.map(usize::from), Some(HEADS));
                // With two heads, the filter may take up to half of a head's yaw for an error of the vehicle's heading.
                assert!((0.5..1.2).contains(&(by_rad / yaw_rad)), "{by_rad} instead of {yaw_rad}");
            }
            other => panic!("{yaw_rad}: {other:?}"),
        }
    }
}

#[test]
fn mounts_stay_unverified_without_a_swing() {
    let is_unverified = |is_heard: &dyn Fn(usize) -> bool| {
        dived(&Rig::new(rest, 5), 240.0, 0.0, is_heard).has_unverified_mounts()
    };
    assert!(is_unverified(ALL));
    assert!(!is_unverified(&|source| source != HEADS), "one head");
    assert!(!is_unverified(&|source| source < HEADS), "no head");
}

/// The mount error between two heads has twice the variance of a single head's, in pitch and in yaw.
#[test]
fn declared_mount_error_widens_the_error_between_passes_of_several_heads() {
    let adds_deg = |rig: &Rig, declared_deg: f64, is_heard: &dyn Fn(usize) -> bool| {
        let square = |declared_deg: f64| {
            let relative: Relative = dived(rig, 60.0, declared_deg, is_heard).fix(at(60.0)).unwrap().relative;
            relative.turn_sd_rad() * relative.turn_sd_rad()
        };
        math::sqrt(square(declared_deg) - square(0.0)).to_degrees()
    };
    for declared_deg in [0.1, 0.3, 3.0] {
        for way in [rest, swing, swing_in_place] {
            let added_deg = adds_deg(&Rig::new(way, 6), declared_deg, ALL);
            assert!((added_deg / (2.0 * declared_deg) - 1.0).abs() < 1e-6, "{added_deg}");
        }
    }
    assert!(adds_deg(&Rig::new(rest, 6), 0.3, &|source| source != HEADS) < 1e-9, "one head");
}
