use headrace_geometry::time::{DurNs, MonoNs};
use headrace_sensor::device::Direction;

use super::*;
use crate::testing_motion::{Bench, LEGS, OnLine, refusal, same_in_any_slices};

const FROM_S: f64 = 10.0;
const FOR_S: f64 = 5.0;

fn keys(sensor: &str, fault: &str) -> String {
    format!("[effects.device_faults]\nsensors = [{sensor:?}]\nfrom_s = 10\nfor_s = 5\n{fault}\n")
}

fn breaks(at: MonoNs) -> bool {
    (START + DurNs::from_secs_f64(FROM_S)..START + DurNs::from_secs_f64(FROM_S + FOR_S)).contains(&at)
}

/// All measurements of a sensor, each without the fault and with the fault.
fn both<M: headrace_sensor::measurement::Measurement>(sensor: &str, fault: &str) -> Vec<(M, M)> {
    let moving = "[effects.motion_within_turn]\n[effects.pilot_drift]\nup_m = 0.5\nyaw_deg = 60\n";
    let run = |effects: &str| Bench::on(LEGS, &format!("{moving}{effects}")).run::<M>(sensor);
    let all: Vec<(M, M)> = run("").into_iter().zip(run(&keys(sensor, fault))).collect();
    assert!(all.len() > 100);
    all
}

#[test]
fn stuck_device_repeats_its_last_value_until_repaired() {
    let mut last = f64::NAN;
    for (plain, broken) in both::<Payout>("tether", "kind = \"stick\"") {
        let wanted_m = if breaks(plain.at) { last } else { plain.chainage_m };
        assert_eq!((broken.at, broken.chainage_m.to_bits()), (plain.at, wanted_m.to_bits()));
        last = wanted_m;
    }
    let mut last = None;
    for (plain, broken) in both::<Sounding>("head_a", "kind = \"stick\"") {
        let range_m = if breaks(plain.at) { last } else { plain.range_m };
        assert_eq!(broken, Sounding { range_m, ..plain }, "its angle goes on");
        last = range_m;
    }
    let mut last: Option<Inertia> = None;
    for (plain, broken) in both::<Inertia>("imu", "kind = \"stick\"") {
        let wanted = last.filter(|_| breaks(plain.at)).map_or(plain, |last| Inertia { at: plain.at, ..last });
        assert_eq!(broken, wanted);
        last = Some(wanted);
    }
}

#[test]
fn jump_fault_shifts_values_by_its_size() {
    #[track_caller]
    fn off(at: MonoNs, [plain, broken]: [f64; 2], size: f64) {
        let wanted = if breaks(at) { size } else { 0.0 };
        assert!((broken - plain - wanted).abs() < 1e-6, "{plain} {broken}");
    }
    for (plain, broken) in both::<Payout>("tether", "kind = \"jump\"\nsize = -2.5") {
        off(plain.at, [plain.chainage_m, broken.chainage_m], -2.5);
    }
    let mut seen = 0;
    for (plain, broken) in both::<Sounding>("ping", "kind = \"jump\"\nsize = 0.7") {
        // The echosounder looks along the tunnel. It sees a wall only while the vehicle is turned to the side.
        if let (Some(plain_m), Some(broken_m)) = (plain.range_m, broken.range_m) {
            off(plain.at, [plain_m, broken_m], 0.7);
            seen += usize::from(breaks(plain.at));
        }
    }
    assert!(seen > 5, "{seen}");
    for (plain, broken) in both::<Sounding>("head_b", "kind = \"jump\"\nsize = 9") {
        off(plain.at, [plain, broken].map(|ping| ping.reported_rad.to_degrees()), 9.0);
        assert_eq!((plain.angle_rad, plain.range_m), (broken.angle_rad, broken.range_m));
    }
    let site = headrace_geometry::site::Site { surface_above_floor_m: 50.0, ..Default::default() };
    for (plain, broken) in both::<Pressure>("depth", "kind = \"jump\"\nsize = 1.5") {
        off(plain.at, [plain, broken].map(|pressure| site.depth_m(pressure.pressure_pa)), 1.5);
    }
    for (plain, broken) in both::<Inertia>("imu", "kind = \"jump\"\nsize = 20") {
        off(plain.at, [plain, broken].map(|inertia| inertia.attitude.roll_pitch_yaw().2.to_degrees()), 20.0);
    }
}

/// Messages of all lines, without the fault and with the fault.
fn lines(sensor: &str, fault: &str) -> [Vec<OnLine>; 2] {
    [String::new(), keys(sensor, fault)].map(|effects| {
        let messages = Bench::turning(&effects).messages().into_iter();
        messages.map(|(at, _, direction, bytes)| (at, direction, bytes)).collect()
    })
}

#[test]
fn dead_device_sends_nothing_until_it_returns() {
    for sensor in ["head_a", "ping", "depth", "imu", "tether"] {
        let [plain, broken] = lines(sensor, "kind = \"die\"");
        let missing: Vec<&OnLine> = plain.iter().filter(|message| !broken.contains(message)).collect();
        assert!(missing.len() > 10, "{sensor}");
        assert!(missing.iter().all(|(at, direction, _)| breaks(*at) && *direction == Direction::Received));
        assert_eq!(broken.len() + missing.len(), plain.len(), "{sensor}: nothing else changes");
    }
}

#[test]
fn babbling_device_sends_as_many_bytes_as_without_the_fault() {
    let [plain, broken] = lines("depth", "kind = \"babble\"");
    assert_eq!(plain.len(), broken.len());
    let mut garbled = Vec::new();
    for ((at, way, was), (at_too, way_too, is)) in plain.iter().zip(&broken) {
        assert_eq!((at, way, was.len()), (at_too, way_too, is.len()));
        if was != is {
            assert!(breaks(*at) && *way == Direction::Received);
            garbled.extend_from_slice(is);
        }
    }
    assert!(garbled.len() > 100);
    let ones: u32 = garbled.iter().map(|byte| byte.count_ones()).sum();
    let share = f64::from(ones) / (8.0 * garbled.len() as f64);
    assert!((share - 0.5).abs() < 0.1, "{share}");
}

#[test]
fn time_slice_length_does_not_change_results() {
    for fault in ["kind = \"stick\"", "kind = \"jump\"\nsize = 1", "kind = \"die\"", "kind = \"babble\""] {
        for sensor in ["head_a", "ping", "depth", "imu", "tether"] {
            same_in_any_slices(&Bench::turning(&keys(sensor, fault)));
        }
    }
}

#[test]
fn error_for_an_invalid_fault_names_the_key() {
    assert!(refusal("[effects.device_faults]\n").contains("kind"));
    assert!(refusal("[effects.device_faults]\nkind = \"jump\"\n").contains("size"));
    assert!(refusal("[effects.device_faults]\nkind = \"die\"\nsize = 1\n").contains("\"jump\" only"));
    assert!(refusal("[effects.device_faults]\nkind = \"sulk\"\n").contains("sulk"));
}
