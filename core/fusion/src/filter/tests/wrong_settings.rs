//! Detection of wrong settings in a dive of some minutes, by the filter alone.

use super::super::FilterNavigation;
use super::super::setting_check::{Setting, SettingDoubt};
use super::rig::{HEADS, Rig, cruise};
use crate::Navigation as _;
use headrace_sensor::reading::{Reading, SonarReturn};

/// Returns the filter's doubt about settings after a dive of four minutes. All echoes are scaled, and each head's
/// returns are changed.
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
