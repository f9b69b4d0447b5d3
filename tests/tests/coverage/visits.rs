//! Places with several visits. A later visit can add to the coverage, but it never revokes a pass. The samples of two
//! visits count together.

use headrace_coverage::Verdict;
use headrace_tests::{scenes, truth};

const SENSORS: &str = "imu_noise = { gyro_degps_rthz = 0.007, accel_mps2_rthz = 0.0006, attitude_deg = 0.2 }\n\
    imu_bias = { gyro_degps = 0.003, accel_mps2 = 0.0003, tau_s = 300 }\nrange_noise = { sd_m = 0.01 }\n";

/// A dive of `vita2-4` from chainage 5 m. Each leg is given by its length, m, and speed, m/s. A negative distance means
/// backward motion.
fn dive(seed: u64, legs: &[(f64, f64)], effects: &str) -> truth::JudgedDive {
    let leg = |(by_m, speed_mps): &(f64, f64)| {
        format!("[[trajectory.legs]]\ndistance_m = {by_m}\nspeed_mps = {speed_mps}\n")
    };
    let legs = legs.iter().map(leg).collect::<Vec<String>>().concat();
    let text = format!(
        "seed = {seed}\nvehicle = \"vita2-4.toml\"\n[trajectory]\nstart_m = 5\n{legs}[effects]\nmotion_within_turn = {{}}\n\
         {SENSORS}{effects}"
    );
    truth::dive(&scenes::seeded(&text, &vehicle, Some(seed)))
}

/// A vehicle file in which the cable slack may change by 6 cm within minutes. Between neighbouring passes this change
/// is small, but between visits it is large.
fn vehicle(name: &str) -> Result<Vec<u8>, String> {
    let file = String::from_utf8(scenes::vehicle_file(name)?).map_err(|error| error.to_string())?;
    let file = file.replace("slack_sd_m = 0.02", "slack_sd_m = 0.06");
    Ok(file.replace("slack_time_s = 10", "slack_time_s = 60").into_bytes())
}

/// Start chainages of the sections with this verdict that lie between two chainages, m.
fn with_verdict(dive: &truth::JudgedDive, verdict: Verdict, [from_m, to_m]: [f64; 2]) -> Vec<String> {
    let within = dive.sections.iter().map(|section| &section.report);
    let within = within.filter(|section| section.start_m >= from_m && section.end_m <= to_m);
    within
        .filter(|section| section.verdict == verdict)
        .map(|section| format!("{:.2}", section.start_m))
        .collect()
}

fn far_over(dive: &truth::JudgedDive, target_m: f64) -> usize {
    let passed = dive.sections.iter().filter(|section| section.report.verdict == Verdict::Pass);
    passed.filter(|section| section.true_hole_m > 1.1 * target_m).count()
}

/// Simulator fault: the cable counter is stuck for 12 s while the vehicle continues to move.
const STUCK: &str =
    "[[effects.device_faults]]\nsensors = [\"tether\"]\nkind = \"stick\"\nfrom_s = 60\nfor_s = 12\n";

#[test]
fn section_sampled_while_the_counter_is_stuck_passes_after_one_complete_visit() {
    let out = dive(4, &[(12.0, 0.09)], STUCK);
    let back = dive(4, &[(12.0, 0.09), (9.0, -0.09)], STUCK);
    let where_m = [8.0, 13.0];
    let unsure = with_verdict(&out, Verdict::CannotSay, where_m);
    assert!(unsure.len() >= 2, "nothing was in doubt: {:?}", out.report.alert_list);
    let passed = with_verdict(&back, Verdict::Pass, where_m);
    let still: Vec<_> = unsure.iter().filter(|start| !passed.contains(start)).collect();
    assert!(still.is_empty(), "undecided: {unsure:?}; still not passed: {still:?}");
    assert_eq!(far_over(&back, 0.5), 0);
}

#[test]
fn driving_back_revokes_no_pass() {
    let out = dive(2, &[(12.0, 0.09)], "");
    let home = dive(2, &[(12.0, 0.09), (12.0, -0.4)], "");
    let where_m = [6.0, 15.0];
    let [passed, after] = [&out, &home].map(|dive| with_verdict(dive, Verdict::Pass, where_m));
    assert!(passed.len() > 30, "{passed:?}");
    let lost: Vec<_> = passed.iter().filter(|start| !after.contains(start)).collect();
    assert!(lost.is_empty(), "{lost:?}");
}

/// The vehicle is too fast on both visits, and the slack of the cable is different on each visit.
#[test]
fn no_section_far_over_the_target_passes_after_two_visits_with_different_slack() {
    let (mut over, mut wrong, mut passed) = (0, 0, 0);
    for seed in 0..10 {
        let dive =
            dive(seed, &[(8.0, 0.19), (8.0, -0.2)], "tether_slack = { reach_m = 0.15, period_s = 150 }\n");
        assert_eq!(far_over(&dive, 0.5), 0);
        let (all, pass) =
            (&dive.sections, |section: &&truth::JudgedSection| section.report.verdict == Verdict::Pass);
        let is_over = |section: &&truth::JudgedSection| section.true_hole_m > 0.5;
        over += all.iter().filter(is_over).count();
        wrong += all.iter().filter(is_over).filter(pass).count();
        passed += all.iter().filter(pass).count();
    }
    println!("{passed} pass, {wrong} of {over} over the target");
    assert!(passed >= 20 && over >= 200, "{passed} {over}");
    assert!(wrong <= 1, "{wrong} of {over}");
}
