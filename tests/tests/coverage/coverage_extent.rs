//! The report accounts for every metre of the dive. If a dive has no position, its report says so first.
//!
//! Each section that the vehicle or its heads have entered has a verdict or is open, even if no head has sampled it.

use headrace_coverage::Verdict;
use headrace_geometry::time::DurNs;
use headrace_monitor::report::Report;
use headrace_monitor::section_row::SectionRow;
use headrace_tests::random_dives::{Draw, Kind, seeded};
use headrace_tests::{Folder, SCENE, VEHICLE as SHORT, instrumented};

use crate::dives::DIVES;

const VEHICLE: &str = include_str!("../../../deploy/vehicles/vita2-4.toml");
/// Distance of VITA 2's heads from the vehicle's origin, ahead and behind, m.
const HEAD_M: f64 = 0.551;
const START_M: f64 = 3.0;
const SPEED_MPS: f64 = 0.11;

/// Report of a dive at the constant planned speed with the simulator effects `effects`.
fn steady(distance_m: f64, effects: &str) -> Report {
    let scene = format!(
        "seed = 3\nvehicle = \"vehicle.toml\"\n[trajectory]\nstart_m = {START_M}\n[[trajectory.legs]]\n\
         distance_m = {distance_m}\nspeed_mps = {SPEED_MPS}\n[effects]\nmotion_within_turn = {{}}\n{effects}"
    );
    instrumented::dive(VEHICLE, &scene).report
}

fn silence(sensors: &str, span: &str) -> String {
    format!("[[effects.device_faults]]\nkind = \"die\"\nsensors = [{sensors}]\n{span}\n")
}

const ALL: &str = r#""sonar_0", "sonar_1", "sonar_2", "sonar_3""#;

/// Checks that the lengths of all verdicts add up to the coverage extent, and that the list of sections has no gaps.
#[track_caller]
fn accounted_for(what: &str, report: &Report) {
    let all_m = report.summary.way_m();
    assert!(
        (all_m - report.coverage_extent.length_m).abs() < 1e-9,
        "{what}: {all_m} m of {:?}",
        report.coverage_extent
    );
    let ends = (report.sections.first().map(|s| s.start_m), report.sections.last().map(|s| s.end_m));
    assert_eq!(ends, (report.coverage_extent.from_m, report.coverage_extent.to_m), "{what}");
    assert!(
        report.sections.windows(2).all(|pair| pair[0].end_m.to_bits() == pair[1].start_m.to_bits()),
        "{what}"
    );
    let judged = |section: &SectionRow| section.hole_m.is_some() || section.verdict == Verdict::Open;
    assert!(report.sections.iter().all(judged), "{what}");
}

/// Checks that a section fails, and that its reported cause is the silence of the heads `heads`.
#[track_caller]
fn fails_by_silence(section: &SectionRow, heads: &[usize]) {
    let evidence = section.cause.unwrap();
    let named = (section.verdict, evidence.cause.as_str());
    assert_eq!(named, (Verdict::Fail, "head_silent"), "{}", section.start_m);
    assert_eq!(evidence.silent_heads.iter().collect::<Vec<_>>(), heads);
}

/// Time at which the plane `behind_m` behind the vehicle is half the target beyond a section's end, seconds after the
/// start of the dive.
fn left_s(section: &SectionRow, behind_m: f64) -> f64 {
    (section.end_m + 0.25 + behind_m - START_M) / SPEED_MPS
}

/// Delay of a section's flag after [`left_s`], seconds.
fn late_s(section: &SectionRow, behind_m: f64) -> f64 {
    section.flagged_s.unwrap() - left_s(section, behind_m)
}

#[test]
fn sections_without_any_live_head_fail_as_the_vehicle_leaves_them() {
    // The heads die when the vehicle is at 5.2 m and the rear heads are at 4.65 m.
    let report = steady(9.0, &silence(ALL, "from_s = 20"));
    accounted_for("dead", &report);
    assert!(report.coverage_extent.to_m.unwrap() > START_M + 9.0, "{:?}", report.coverage_extent);
    let dark: Vec<_> =
        report.sections.iter().filter(|s| s.start_m >= 6.0 && s.end_m <= 12.0 - HEAD_M - 0.5).collect();
    assert!(dark.len() > 16);
    for section in dark {
        fails_by_silence(section, &[0, 1, 2, 3]);
        let late_s = late_s(section, HEAD_M);
        // The upper limit allows for one update and the position margin. The flag may be raised as soon as the heads
        // have left the section's start, because a circle centred at the start may exceed the target.
        assert!((-0.25 / SPEED_MPS - 0.1..2.5).contains(&late_s), "{}: {late_s} s late", section.start_m);
    }
    let home = report.go_back.iter().map(|back| back.from_m).fold(0.0, f64::max);
    assert!(home > 10.5, "the advice for the way back misses the last sections: {home}");
    let run = report.runs.iter().find(|run| run.cause.as_str() == "head_silent").unwrap();
    assert_eq!(run.silent_sources, ["sonar_0", "sonar_1", "sonar_2", "sonar_3"]);
    let last = report.sections.last().unwrap();
    assert_eq!(last.verdict, Verdict::Open, "a head may recover and still see the wall ahead");
}

#[test]
fn stretch_crossed_while_all_heads_are_silent_fails() {
    // The heads are dead while the vehicle moves from 5.75 m to 8.5 m.
    let report = steady(9.0, &silence(ALL, "from_s = 25\nfor_s = 25"));
    accounted_for("dead and back", &report);
    let between = |from_m: f64, to_m: f64| {
        let within = move |s: &&SectionRow| s.start_m >= from_m && s.end_m <= to_m;
        report.sections.iter().filter(within).collect::<Vec<_>>()
    };
    for section in between(6.5, 7.75) {
        let cause = section.cause.map(|evidence| evidence.cause.as_str());
        assert_eq!((section.verdict, cause), (Verdict::Fail, Some("head_silent")), "{}", section.start_m);
    }
    for section in between(4.25, 5.0).into_iter().chain(between(9.5, 11.0)) {
        let calm = section.verdict != Verdict::Fail && section.flagged_s.is_none();
        assert!(calm, "{}: {:?} at {:?}", section.start_m, section.verdict, section.flagged_s);
    }
}

/// Report of a dive without position errors. `distances_m` are the signed lengths of its legs.
fn legs(distances_m: &[f64]) -> Report {
    let vehicle = VEHICLE.replace("slack_sd_m = 0.02", "way = \"direct\"\n#");
    let mut scene = format!("seed = 3\nvehicle = \"vehicle.toml\"\n[trajectory]\nstart_m = {START_M}\n");
    for distance_m in distances_m {
        let speed_mps = 0.09 * distance_m.signum();
        let leg =
            format!("[[trajectory.legs]]\ndistance_m = {}\nspeed_mps = {speed_mps}\n", distance_m.abs());
        scene.push_str(&leg);
    }
    scene.push_str("[effects]\nmotion_within_turn = {}\n");
    let vehicle = vehicle.replace("planned_speed_mps = 0.11", "planned_speed_mps = 0.09");
    instrumented::dive(&vehicle, &scene).report
}

#[test]
fn wall_beyond_start_and_turning_point_has_verdict_open_and_no_flag() {
    let report = legs(&[9.0, -4.0]);
    accounted_for("there and back", &report);
    let front_m = START_M + HEAD_M;
    let rear_m = START_M + 9.0 - HEAD_M;
    let outside = |s: &&SectionRow| s.start_m < front_m - 0.25 || s.end_m > rear_m + 0.25;
    let inside = |s: &&SectionRow| s.start_m > front_m + 0.5 && s.end_m < rear_m - 0.5;
    for section in report.sections.iter().filter(outside) {
        assert_eq!(section.flagged_s, None, "{}", section.start_m);
        assert_ne!(section.verdict, Verdict::Fail, "{}", section.start_m);
    }
    let at_ends: Vec<_> = report.sections.iter().filter(|s| s.not_inspected).collect();
    assert!(at_ends.iter().any(|s| s.end_m <= front_m + 0.25), "at the beginning: {:?}", report.no_verdict);
    assert!(at_ends.iter().all(|s| s.verdict == Verdict::Open && s.hole_m.unwrap() > report.target_m));
    assert!(report.sections.iter().filter(inside).all(|s| s.verdict == Verdict::Pass), "{:?}", report.runs);
    let listed_m: f64 =
        report.no_verdict.iter().filter(|s| s.why == "not_inspected").map(|s| s.no_verdict_m).sum();
    assert!(
        (listed_m - report.summary.not_inspected_m).abs() < 1e-9 && listed_m > 0.0,
        "{:?}",
        report.no_verdict
    );
}

#[test]
fn section_crossed_on_the_way_back_is_judged_like_any_other() {
    let (once, again) = (legs(&[3.0]), legs(&[3.0, -5.0, 5.0]));
    accounted_for("once", &once);
    accounted_for("again", &again);
    let at_start = |report: &Report| {
        let near = |s: &&SectionRow| s.start_m >= START_M - 0.25 && s.end_m <= START_M + 0.5;
        report.sections.iter().filter(near).map(|s| (s.not_inspected, s.verdict)).collect::<Vec<_>>()
    };
    assert!(at_start(&once).contains(&(true, Verdict::Open)), "{:?}", at_start(&once));
    assert!(at_start(&again).iter().all(|is| *is == (false, Verdict::Pass)), "{:?}", at_start(&again));
}

#[test]
fn tick_length_does_not_change_verdicts_while_heads_are_dead() {
    let silence = silence(ALL, "from_s = 8\nfor_s = 6");
    let scene = format!(
        "vehicle = \"vehicle.toml\"\n[trajectory]\nstart_m = 3\n[[trajectory.legs]]\ndistance_m = 4\n\
         speed_mps = 0.2\n[effects]\n{silence}"
    );
    let digest =
        |tick_ms| instrumented::dive_in_ticks(VEHICLE, &scene, DurNs::from_millis(tick_ms)).report.digest;
    assert_eq!([digest(1), digest(333)], [digest(20), digest(20)]);
}

#[test]
fn flags_wait_only_for_live_heads() {
    let report = steady(6.0, &silence(r#""sonar_1", "sonar_2", "sonar_3""#, "from_s = 0"));
    accounted_for("three of four", &report);
    let inner: Vec<_> = report.sections.iter().filter(|s| s.start_m >= 5.25 && s.end_m <= 8.5).collect();
    assert!(inner.len() > 10);
    for section in inner {
        fails_by_silence(section, &[1, 2, 3]);
        // The flag waits only for the front head, which still works. This head leaves the section ten seconds before
        // the silent aft heads do.
        let late_s = late_s(section, -HEAD_M);
        assert!(late_s < 4.0, "{}: {late_s} s late", section.start_m);
    }
    // One of the four heads is silent, but the vehicle is slow enough for the remaining three.
    let silent = silence("\"sonar_1\"", "from_s = 10");
    let (one, none) = (steady(6.0, &silent), steady(6.0, ""));
    accounted_for("one of four", &one);
    for report in [&one, &none] {
        let judged = report.sections.iter().filter(|s| s.end_m <= 7.5);
        // Sections near the start and the end are left out, because not all heads have passed them.
        let beyond = |s: &&SectionRow| !s.not_inspected;
        assert!(judged.clone().filter(beyond).count() > 12);
        assert!(judged.filter(beyond).all(|s| s.verdict != Verdict::Open));
        let ends = report.sections.iter().filter(|s| s.not_inspected);
        let at_an_end =
            |s: &SectionRow| s.end_m <= START_M + HEAD_M + 0.5 || s.start_m >= START_M + 6.0 - HEAD_M - 0.5;
        assert!(ends.clone().count() > 0 && ends.clone().all(at_an_end));
    }
}

#[test]
fn verdict_lengths_add_up_in_random_dives() {
    for (seeded, dive) in DIVES.iter().take(40) {
        accounted_for(&format!("seed {} ({:?})", seeded.seed, seeded.kind), &dive.report);
    }
}

/// The dives are short, go out and back, reach beyond the ends of a short tunnel, and end anywhere within a section.
#[test]
fn lengths_of_all_verdicts_add_up_in_dives_out_and_back() {
    let vehicle = SHORT.replace("length_m = 100", "length_m = 8");
    let (mut outside, mut not_inspected_m) = (0, 0.0);
    for seed in 0..60 {
        let mut draw = Draw::new(seed);
        let start_m = draw.between(-2.0, 10.0);
        let (legs, first) = (1 + seed % 3, seed / 3 % 2);
        let legs = (0..legs).map(|leg| {
            let speed_mps = if (leg + first) % 2 == 0 { 0.2 } else { -0.2 };
            let distance_m = draw.between(0.5, 2.5);
            format!("[[trajectory.legs]]\ndistance_m = {distance_m}\nspeed_mps = {speed_mps}\n")
        });
        let head = format!("vehicle = \"vehicle.toml\"\n[trajectory]\nstart_m = {start_m}\n");
        let scene = [head].into_iter().chain(legs).collect::<String>();
        let report = instrumented::dive(&vehicle, &scene).report;
        accounted_for(&format!("seed {seed}"), &report);
        let reason = report.not_inspected.as_ref().map(|why| why.reason);
        assert_eq!(
            report.coverage_extent.from_m.is_none(),
            reason == Some("outside_tunnel"),
            "seed {seed}: {reason:?}"
        );
        outside += usize::from(reason == Some("outside_tunnel"));
        not_inspected_m += report.summary.not_inspected_m;
    }
    assert!(outside > 2 && not_inspected_m > 5.0, "{outside}, {not_inspected_m}");
}

#[test]
fn sections_unseen_because_of_silent_heads_fail_at_once() {
    let mut dark = 0;
    for seed in (0..48).filter(|seed| seeded(*seed).kind != Kind::Reversing) {
        let dive = seeded(seed);
        let heads = dive.vehicle.matches("id = \"sonar_").count();
        let ids: Vec<_> = (0..heads).map(|head| format!("\"sonar_{head}\"")).collect();
        let from_s = Draw::new(1000 + seed).between(2.0, 6.0);
        let scene = dive.scene + &silence(&ids.join(", "), &format!("from_s = {from_s}"));
        let dive = instrumented::dive(&dive.vehicle, &scene);
        let report = &dive.report;
        let what = format!("seed {seed}");
        accounted_for(&what, report);
        let Some(to_m) = report.coverage_extent.to_m else { continue };
        // Heads are at most 0.6 m ahead of or behind the vehicle. A section counts as left when the heads are beyond
        // its end by half the target.
        let (target_m, section_m) = (report.target_m, report.section_m);
        let seen_m = dive.samples().map(|sample| sample.place[0]).fold(f64::NEG_INFINITY, f64::max);
        let far = |s: &&SectionRow| s.start_m > seen_m + target_m;
        let left = |s: &&SectionRow| s.end_m < to_m - 1.2 - target_m / 2.0 - 2.0 * section_m - 0.1;
        for section in report.sections.iter().filter(far).filter(left) {
            let cause = section.cause.map(|evidence| evidence.cause.as_str());
            assert_eq!(
                (section.verdict, cause),
                (Verdict::Fail, Some("head_silent")),
                "{what}: {}",
                section.start_m
            );
            let end_s = report.dive.duration_s;
            assert!(section.flagged_s.unwrap() < end_s - 1e-6, "{what}: {} only at the end", section.start_m);
            dark += 1;
        }
    }
    assert!(dark > 20, "{dark} sections");
}

#[test]
fn stretch_without_a_position_fails_once_the_vehicle_has_left_it() {
    // Some seconds after the cable counter falls silent at 25 s, the filter has no fix any more.
    let report = steady(12.0, &silence("\"tether\"", "from_s = 25\nfor_s = 50"));
    accounted_for("outage", &report);
    let lost = |s: &&SectionRow| s.cause.is_some_and(|evidence| evidence.cause.as_str() == "position_lost");
    let lost: Vec<_> = report.sections.iter().filter(lost).collect();
    assert!(lost.len() >= 4, "{} sections", lost.len());
    assert!(report.not_inspected.is_none(), "most of the dive had a position");
}

#[test]
fn dive_without_a_position_reports_first_that_it_has_no_verdicts() {
    for (sensor, no_fix, words) in [("tether", "no_chainage", "chainage"), ("imu", "no_heading", "heading")] {
        let folder = Folder::new();
        folder.write("vehicle.toml", SHORT);
        let silence = format!("[effects]\n{}", silence(&format!("\"{sensor}\""), "from_s = 0"));
        folder.write("scene.toml", SCENE.to_owned() + &silence);
        folder.simulate("scene.toml", "dive.mcap");
        let answer = folder.headrace(&["replay", "dive.mcap"]);
        assert_eq!(answer.code, Some(1), "{}", answer.stdout);
        let loud = answer.stdout.lines().find(|line| !line.contains("NO POSITION")).unwrap();
        let wanted =
            format!("NO VERDICTS: the vehicle never had a position, because the {words} was unknown");
        assert_eq!(loud, format!("{wanted}; {sensor} sent nothing"), "{}", answer.stdout);
        let (code, report) = folder.replay("dive.mcap", &[]);
        let why = &report["not_inspected"];
        assert_eq!((code, &why["reason"], &why["missing"]), (Some(1), &"no_position".into(), &no_fix.into()));
        assert_eq!(why["silent_sources"], serde_json::json!([sensor]));
        assert_eq!(report["coverage_extent"]["length_m"], 0.0);
    }
}

#[test]
fn dive_outside_the_tunnel_exits_with_1() {
    let folder = Folder::new();
    folder.write("vehicle.toml", SHORT);
    folder.write("scene.toml", SCENE.replace("start_m = 3", "start_m = 105"));
    folder.simulate("scene.toml", "dive.mcap");
    let (code, report) = folder.replay("dive.mcap", &[]);
    assert_eq!((code, &report["coverage_extent"]["length_m"]), (Some(1), &0.0.into()));
    assert_eq!(report["not_inspected"]["reason"], "outside_tunnel");
    let answer = folder.headrace(&["replay", "dive.mcap"]);
    let said = "NO VERDICTS: the heads were outside the tunnel from 0+105.20 to 0+109.00: check";
    assert!(answer.stdout.contains(said), "{}", answer.stdout);
}

#[test]
fn dive_mostly_without_a_position_exits_with_1() {
    let folder = Folder::new();
    folder.write("vehicle.toml", SHORT);
    let silence = format!("[effects]\n{}", silence("\"tether\"", "from_s = 2"));
    folder.write("scene.toml", SCENE.to_owned() + &silence);
    folder.simulate("scene.toml", "dive.mcap");
    let (code, report) = folder.replay("dive.mcap", &[]);
    assert_eq!(code, Some(1), "{}", report["not_inspected"]);
    assert_eq!(report["not_inspected"]["reason"], "mostly_no_position");
    assert!(report["coverage_extent"]["length_m"].as_f64().unwrap() > 0.0);
    let answer = folder.headrace(&["replay", "dive.mcap"]);
    assert!(answer.stdout.contains("NO INSPECTION: "), "{}", answer.stdout);
    let gap = answer.stdout.lines().find(|line| line.contains("NO POSITION: scanned for"));
    assert!(
        gap.is_some_and(|gap| gap.contains("-> once the position is back, inspect again from ")),
        "{}",
        answer.stdout
    );
}

/// Wall that the heads scanned while the tether was silent has no verdict. The report tells for how long the position
/// was missing, and about where the vehicle was then. The vehicle drives at 0.11 m/s. The counter falls silent at 60 s,
/// and the position is lost some seconds later.
#[test]
fn stretch_scanned_without_a_position_is_reported_by_duration_and_likely_chainage() {
    let noise = "imu_noise = { gyro_degps_rthz = 0.007, accel_mps2_rthz = 0.001, attitude_deg = 0.3 }\n\
                 imu_bias = { gyro_degps = 0.003, accel_mps2 = 0.002, tau_s = 300 }\n";
    for (span, is_over) in [("from_s = 60", false), ("from_s = 60\nfor_s = 60", true)] {
        let report = steady(20.0, &format!("{noise}{}", silence("\"tether\"", span)));
        accounted_for(span, &report);
        let [gap] = &report.position_gaps[..] else { panic!("{span}: {:?}", report.position_gaps) };
        let true_m = |at_s: f64| START_M + SPEED_MPS * at_s;
        let end_s = if is_over { 120.0 } else { 20.0 / SPEED_MPS };
        // When the counter sends data again, the filter compares its reading with the estimate before there is a fix.
        let late_s = gap.to_s - end_s;
        assert!((-2.0..15.0).contains(&late_s) && gap.is_over == is_over, "{span}: {gap:?}");
        assert!((60.0..100.0).contains(&gap.from_s), "{span}: {gap:?}");
        // Each of the four heads pings 50 times per second.
        let pings = 200.0 * (gap.to_s - gap.from_s);
        assert!((gap.pings as f64 - pings).abs() < 0.05 * pings, "{span}: {gap:?}");
        let (from_m, to_m) = (gap.from_m.unwrap(), gap.to_m.unwrap());
        assert!((from_m - true_m(gap.from_s)).abs() < 1.0, "{span}: {gap:?}");
        let error_m = (to_m - true_m(gap.to_s)).abs();
        assert!(error_m < if is_over { 0.1 } else { 0.3 * (to_m - from_m) }, "{span}: {error_m} m, {gap:?}");
    }
    let steady_dive = steady(6.0, noise);
    assert_eq!(steady_dive.position_gaps, [], "the position was never lost");
}

/// Samples from before the position estimate has converged don't affect later sections. If a vehicle waits until its
/// heading is known, only the wall that its front heads sampled during this time stays undecided.
#[test]
fn waiting_for_a_known_heading_leaves_at_most_25_cm_undecided() {
    let vehicle = VEHICLE.replace("planned_speed_mps = 0.10", "planned_speed_mps = 0.09");
    assert_ne!(vehicle, VEHICLE);
    let scene = format!(
        "seed = 3\nvehicle = \"vehicle.toml\"\n[trajectory]\nkind = \"waypoints\"\n\
         [[trajectory.waypoints]]\nchainage_m = {START_M}\nstay_s = 10\n\
         [[trajectory.waypoints]]\nchainage_m = {}\nspeed_mps = 0.09\n[effects]\nmotion_within_turn = {{}}\n",
        START_M + 6.0
    );
    let report = instrumented::dive(&vehicle, &scene).report;
    accounted_for("waited", &report);
    assert!(
        report.summary.cannot_say_m <= 0.25,
        "{} m: {:?}",
        report.summary.cannot_say_m,
        report.no_verdict
    );
    let inside =
        |s: &&SectionRow| s.start_m > START_M + HEAD_M + 0.25 && s.end_m < START_M + 6.0 - HEAD_M - 0.5;
    assert!(
        report.sections.iter().filter(inside).all(|s| s.verdict == Verdict::Pass),
        "{:?}",
        report.no_verdict
    );
}
