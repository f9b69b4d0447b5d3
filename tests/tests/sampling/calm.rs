//! In calm dives, the command `plan` and the live advice agree on position errors and speeds.

use headrace_devices::KINDS;
use headrace_sampling::margin::{APART_SHARE, error_time_s};
use headrace_simulator::position_error_model;
use headrace_tests::field_table::VEHICLES;
use headrace_tests::passable::Outing;

/// The position errors from `plan` and from the live advice may differ by a fifth. The advised speed may be up to 7 %
/// below the planned one.
#[test]
fn plan_and_live_position_errors_agree() {
    for vehicle in [VEHICLES[0], VEHICLES[1], VEHICLES[3], VEHICLES[5]] {
        let outing = Outing::steady(vehicle, 3);
        let plan_mps = outing.plan_mps();
        let speed_mps = outing.planned_share * plan_mps;
        let scene = outing.scene(speed_mps, speed_mps, 1.0);
        let text = scene.vehicle_text.clone();
        let load = |_: &str| Ok(text.clone().into_bytes());
        let errors = position_error_model::expected_errors(&scene.vehicle, "vehicle.toml", &KINDS, &load)
            .unwrap()
            .unwrap();
        let heads = scene.vehicle.heads();
        let turn_s = heads[0].ping_period_s * std::f64::consts::TAU / heads[0].step_rad;
        let x_m = || heads.iter().map(|head| head.mount.position.x());
        let apart_m = x_m().fold(f64::MIN, f64::max) - x_m().fold(f64::MAX, f64::min);
        let time_s = error_time_s(heads.len() as f64 / turn_s, apart_m, speed_mps, APART_SHARE);
        let expected_m = errors.pass_error_m(time_s);

        let dive = outing.dive(speed_mps, speed_mps);
        let said_m = dive.median(|entry| entry.advice.margins.map_or(0.0, |margins| margins.pass_error_m));
        let advised_mps = dive.median(|entry| entry.advice.v_max_mps);
        println!(
            "{}: {expected_m:.4} m expected, {said_m:.4} said; {plan_mps:.4} m/s planned, {advised_mps:.4} advised",
            vehicle.name
        );
        assert!(
            (said_m / expected_m - 1.0).abs() < 0.2,
            "{}: expected {expected_m}, advised {said_m}",
            vehicle.name
        );
        assert!(advised_mps <= 1.005 * plan_mps && advised_mps > 0.93 * plan_mps, "{}", vehicle.name);
        assert!(dive.passes(), "{}: {} pass at {speed_mps} m/s", vehicle.name, dive.passing);
    }
}

/// The dives are some of those in `cargo bench --bench advice`. All of them are steady except the last one.
#[test]
fn advised_speeds_match_the_largest_passing_speeds() {
    let mut ratios = Vec::new();
    for seed in [0, 2, 3, 5, 6] {
        let compared = Outing::drawn(seed).compare();
        println!("{seed}: {:.4} m/s advised, {:?} true", compared.advised_mps, compared.true_mps);
        let changes = compared.planned.changes_a_minute();
        assert!(changes <= 2.0, "{seed}: {changes} changes of advice a minute");
        ratios.push(compared.ratio());
    }
    assert!(ratios.iter().all(|ratio| (0.899..1.001).contains(ratio)), "{ratios:?}");
}

/// In each dive, the vehicle drives at another speed near the advised speed. The advice must be the same in all dives.
#[test]
fn advice_does_not_depend_on_the_driven_speed() {
    let outing = Outing::steady(VEHICLES[3], 1);
    let advised = [0.094, 0.099, 0.1, 0.101, 0.106]
        .map(|speed_mps| outing.dive(0.1, speed_mps).median(|entry| entry.advice.v_max_mps));
    println!("{advised:.4?}");
    assert!(advised.windows(2).all(|pair| (pair[0] / pair[1] - 1.0).abs() < 0.05), "{advised:?}");
}
