//! Tests of combinations of effects on sonars.

use crate::testing::{Dive, Dived};
use crate::truth::TruthRow;

/// Each effect on sonars, as the table that a scene contains, with some keys.
const EFFECTS: [&str; 11] = [
    "[effects.beam_cone]\n",
    "[effects.occlusion]\n",
    "[effects.multipath]\nshare = 0.5\n",
    "[effects.side_lobes]\nshare = 0.2\n",
    "[effects.interference]\nshare = 0.2\n",
    "[effects.missing_returns]\nshare = 0.1\nmean_run = 5\n",
    "[effects.outliers]\n",
    "[effects.sound_speed_error]\nshare = 0.02\n",
    "[effects.range_noise]\nsd_m = 0.02\n",
    "[effects.range_quantisation]\n",
    "[effects.stuck_range]\nto_s = 2\n",
];

fn pair() -> Dive {
    Dive::with_heads(&[[0.0, 0.4, 0.0], [0.0, -0.4, 0.0]])
}

/// For each measurement of the dive, its values before and after an effect changes it; `None` if unchanged. `effect` is
/// the effect's index in the scene.
fn changes(dived: &Dived, effect: u16) -> Vec<Option<(f64, f64)>> {
    let of = |row: &TruthRow| {
        let cause = row.causes.iter().find(|cause| cause.effect == effect)?;
        Some((cause.from, cause.to))
    };
    dived.rows.iter().map(of).collect()
}

#[test]
fn adding_an_effect_keeps_the_random_numbers_of_other_effects() {
    let dive = pair();
    let outliers = |before: &str, place: u16| {
        let strays = changes(&dive.dive(&format!("{before}[effects.outliers]\nshare = 0.2")), place);
        strays.into_iter().map(|change| change.map(|(_, to)| to.to_bits())).collect::<Vec<_>>()
    };
    let alone = outliers("", 0);
    assert!(alone.iter().flatten().count() > 20);
    for effects in [EFFECTS[0], EFFECTS[2], EFFECTS[3], EFFECTS[4]] {
        assert!(alone == outliers(effects, 1), "{effects}");
    }
    // The scene names the two effects in the wrong order. They still run in the program's fixed order.
    let (a, b) = (EFFECTS[8], EFFECTS[7]);
    assert_eq!(dive.dive(&format!("{a}{b}")).messages, dive.dive(&format!("{b}{a}")).messages);
}

#[test]
fn adding_a_head_keeps_the_random_numbers_of_the_first_head() {
    let effects = [EFFECTS[2], EFFECTS[3], EFFECTS[5], EFFECTS[6], EFFECTS[8]].concat();
    let bits = |dive: &Dive| {
        let ranges_m = dive.dive(&effects).ranges_m(0);
        ranges_m.into_iter().map(|range_m| range_m.map(f64::to_bits)).collect::<Vec<_>>()
    };
    // The scene has no planned speed, so the ping settings of the first head don't change if a second head is added.
    let one = Dive::with_heads(&[[0.0, 0.4, 0.0]]);
    assert_eq!(bits(&one), bits(&pair()));
}

#[test]
fn all_sonar_effects_together_do_not_depend_on_time_slice_length() {
    pair().assert_slices_dont_matter(&EFFECTS.concat());
}

#[test]
fn each_table_of_an_effect_applies_only_to_its_own_sensors() {
    let effects = "[[effects.range_noise]]\nsensors = [\"sonar_0\"]\nsd_m = 0.01\n\
                   [[effects.range_noise]]\nsensors = [\"sonar_1\"]\nsd_share = 0.1\n";
    let dive = Dive { seconds: 60.0, ..pair() };
    let (base, dived) = (dive.dive(""), dive.dive(effects));
    let off = |source: u16, by_range: bool| {
        let pairs = base.ranges_m(source).into_iter().zip(dived.ranges_m(source));
        let errors: Vec<f64> = pairs
            .map(|(was, is)| (is.unwrap() - was.unwrap()) / if by_range { was.unwrap() } else { 1.0 })
            .collect();
        let count = errors.len() as f64;
        let sd = headrace_geometry::math::sqrt(errors.iter().map(|error| error * error).sum::<f64>() / count);
        (sd, 5.0 / headrace_geometry::math::sqrt(2.0 * count))
    };
    let ((first, allowed), (second, _)) = (off(0, false), off(1, true));
    assert!((first / 0.01 - 1.0).abs() < allowed && (second / 0.1 - 1.0).abs() < allowed);
    let twice = "[[effects.range_noise]]\nsd_m = 0.01\n[[effects.range_noise]]\nsd_m = 0.02\n";
    assert!(dive.refusal(twice).contains("an earlier table of this effect names"));
}
