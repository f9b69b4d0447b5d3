//! Settings that are wrong are named, and right ones aren't.

use headrace_monitor::report::SettingReport;
use headrace_simulator::Scene;
use headrace_tests::field_table::{Cell, Condition, Driven, VEHICLES, Vehicle};
use headrace_tests::truth;

fn vehicle(name: &str) -> Vehicle {
    VEHICLES.into_iter().find(|vehicle| vehicle.name == name).unwrap()
}

fn doubted(scene: &Scene, believed: &Scene) -> Option<SettingReport> {
    let report = truth::dive_believing(scene, &believed.vehicle).report;
    report.alerts.iter().find_map(|alert| alert.setting.clone())
}

#[test]
fn probe() {
    let cond = std::env::var("COND").unwrap();
    let (_, condition) =
        headrace_tests::field_table::CONDITIONS.into_iter().find(|(name, _)| *name == cond).unwrap();
    for name in std::env::var("VEH").unwrap().split(',') {
        for seed in 1..3 {
            let cell = Cell { vehicle: vehicle(name), condition, start_m: 100.0, driven: Driven::Planned };
            let dive = cell.dive(seed, 60.0);
            println!("#### {name} {cond} {seed}");
            println!("{:?}", doubted(&dive.scene, &dive.believed));
        }
    }
    let _ = Condition::Clean;
}
