//! Effects implied by the models of sensors, from their data sheets.
//!
//! | model | effect | parameters | source |
//! |---|---|---|---|
//! | imagenex881 | beam_cone | beam width at the head's frequency | the data sheet: 2.4 to 1.4 degrees |
//! | | echo_strength | the effect's defaults | the data sheet |
//! | | range_quantisation | 500 points | the switch command, field 19; Jorge et al. 2021, §9.2 |
//! | | range_noise | 10 mm | docs/why/field.md, "data sheet" |
//! | ping1d | beam_cone | 30 degrees | the data sheet: 0.52 rad |
//! | | range_noise, outliers, missing_returns | 20 mm; 8 %; 5 % in runs of 8 | docs/why/field.md, "data sheet" |
//! | bar100 | depth_steps, depth_noise | 31.2 mm; a count of 305 Pa / 2 | the data sheet: 3.05 mbar; resolution 3 mbar |
//! | models with known noise | imu_noise, imu_bias | the device's own figures | the device's crate, through [`Device::inertial_noise`] |
//!
//! A head on a vehicle implies more effects: see [`of_vehicle`].
//!
//! [`Device::inertial_noise`]: headrace_sensor::device::Device::inertial_noise

use headrace_sensor::device::{InertialNoise, Sense};
use headrace_vehicle::VehicleConfig;

use super::call::{Call, number};
use crate::facts::{Facts, SensorFacts};

/// Largest difference in beam width between heads that count as having one frequency, radians. It corresponds to 5 kHz.
const SAME_BEAM_RAD: f64 = 2e-4;

/// Effects implied by the models of the vehicle's sensors.
pub(super) fn calls(vehicle: &VehicleConfig, facts: &Facts) -> Vec<Call> {
    let mut calls = of_vehicle(vehicle, facts);
    let models = vehicle.sensor_configs.iter().map(|config| config.plugin.as_str());
    for (model, (sensor, of)) in models.zip(vehicle.sensors.iter().zip(&facts.sensors)) {
        let by = format!("the model {model}");
        let own = match model {
            "imagenex881" => head(),
            "ping1d" => echosounder(),
            "bar100" => depth(),
            _ => sensor.inertial_noise().as_ref().map(inertial).unwrap_or_default(),
        };
        calls
            .extend(own.into_iter().map(|(effect, keys)| {
                Call::new(effect, by.clone(), &keys).on(core::slice::from_ref(&of.id))
            }));
    }
    calls
}

type Own = Vec<(&'static str, Vec<(&'static str, String)>)>;

fn head() -> Own {
    vec![
        ("beam_cone", vec![]),
        ("echo_strength", vec![]),
        ("range_quantisation", vec![("points", number(500.0))]),
        ("range_noise", vec![("sd_m", number(0.01))]),
    ]
}

fn echosounder() -> Own {
    vec![
        ("beam_cone", vec![("width_deg", number(30.0))]),
        ("missing_returns", vec![("share", number(0.05)), ("mean_run", number(8.0))]),
        ("outliers", vec![("share", number(0.08))]),
        ("range_noise", vec![("sd_m", number(0.02))]),
    ]
}

fn depth() -> Own {
    vec![
        ("depth_noise", vec![("noise_pa", number(152.0))]),
        ("depth_steps", vec![("quantum_m", number(0.0312))]),
    ]
}

fn inertial(noise: &InertialNoise) -> Own {
    let InertialNoise { rate_noise, rate_bias, force_noise, force_bias } = noise;
    vec![
        (
            "imu_noise",
            vec![
                ("gyro_degps_rthz", number(rate_noise.to_degrees())),
                ("accel_mps2_rthz", number(*force_noise)),
            ],
        ),
        (
            "imu_bias",
            vec![
                ("gyro_degps", number(rate_bias.in_run.to_degrees())),
                ("accel_mps2", number(force_bias.in_run)),
                ("tau_s", number(rate_bias.time_s)),
                ("gyro_constant_degps", number(rate_bias.turn_on.to_degrees())),
                ("accel_constant_mps2", number(force_bias.turn_on)),
            ],
        ),
    ]
}

/// Effects implied by heads that are on a moving vehicle, or near other heads or the hull.
fn of_vehicle(vehicle: &VehicleConfig, facts: &Facts) -> Vec<Call> {
    let heads: Vec<&SensorFacts> = facts.sensors.iter().filter(|sensor| sensor.head.is_some()).collect();
    let ids = |sensors: &[&SensorFacts]| sensors.iter().map(|sensor| sensor.id.clone()).collect::<Vec<_>>();
    let mut calls = Vec::new();
    if !heads.is_empty() {
        calls.push(Call::new("motion_within_turn", "heads that turn while the vehicle moves", &[]));
    }
    let sonars: Vec<&SensorFacts> = facts
        .sensors
        .iter()
        .filter(|sensor| matches!(sensor.sense, Sense::Head | Sense::Echosounder))
        .collect();
    if (heads.len() > 1 || !vehicle.hull.is_empty()) && !sonars.is_empty() {
        let by = match (heads.len(), vehicle.hull.len()) {
            (0 | 1, boxes) => format!("a hull of {boxes} parts"),
            (count, 0) => format!("{count} heads on one vehicle"),
            (count, boxes) => format!("{count} heads on one vehicle, and a hull of {boxes} parts"),
        };
        calls.push(Call::new("occlusion", by, &[]).on(&ids(&sonars)));
    }
    let mut left = heads;
    while let Some(first) = left.first().copied() {
        let same = |other: &&SensorFacts| match (&first.head, &other.head) {
            (Some(a), Some(b)) => (a.beam_rad - b.beam_rad).abs() < SAME_BEAM_RAD,
            _ => false,
        };
        let (group, rest): (Vec<_>, Vec<_>) = left.into_iter().partition(same);
        if group.len() > 1 {
            let by = format!("{} heads of one frequency", group.len());
            calls.push(Call::new("interference", by, &[]).on(&ids(&group)));
        }
        left = rest;
    }
    calls
}
