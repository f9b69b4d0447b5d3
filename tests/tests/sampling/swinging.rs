//! A vehicle that yaws by ten degrees gets the advice to drive at a speed at which its sections pass.

use headrace_monitor::advice_log::AdviceEntry;
use headrace_sampling::advice::Remedy;
use headrace_tests::field_table::VEHICLES;
use headrace_tests::passable::Outing;

/// With ten degrees of yaw, some successive passes are farther apart than the target at any speed, but passes during
/// later swings fill the gaps. Sections must pass at the advised speed, but not at 2.5 times that speed.
#[test]
fn advised_speed_of_a_swinging_vehicle_is_positive_and_passes() {
    for target_m in [0.5, 1.0] {
        let effects =
            "pilot_drift = { across_m = 0.0, up_m = 0.0, yaw_deg = 10.0, period_s = 20.0 }\n".to_owned();
        let outing = Outing { target_m, effects, ..Outing::steady(VEHICLES[3], 1) };
        let planned_mps = outing.planned_share * outing.plan_mps();
        let slow = outing.dive(planned_mps, 0.2 * planned_mps);
        let advised_mps = slow.median(|entry| entry.advice.v_max_mps);
        let says_steady = |entry: &AdviceEntry| entry.advice.remedy == Some(Remedy::HoldHeading);
        assert!(
            slow.entries.iter().filter(|entry| says_steady(entry)).count() > slow.entries.len() / 2,
            "{target_m} m"
        );
        // The speed after all margins must be near the advised speed, because the target is met at both speeds.
        let with_all_mps =
            slow.median(|entry| entry.advice.margins.map_or(0.0, |margins| margins.losses_mps));
        assert!((0.9..2.0).contains(&(with_all_mps / advised_mps)), "{with_all_mps}, not {advised_mps} m/s");
        assert!(advised_mps > 0.01, "target {target_m} m: {advised_mps} m/s");
        let followed = outing.dive(planned_mps, advised_mps);
        assert!(followed.passes(), "target {target_m} m: {} pass at {advised_mps} m/s", followed.passing);
        let faster = outing.dive(planned_mps, 2.5 * advised_mps);
        assert!(!faster.passes(), "target {target_m} m: passes at 2.5 times {advised_mps} m/s");
    }
}
