//! Expected position errors of a calm dive, computed by running the navigation filter.
//!
//! The vehicle moves straight through its tunnel, with devices that are ideal except for their wire formats. The
//! filter's covariance does not depend on the readings, so the errors between two passes over a place apply to any calm
//! dive. They agree within 10 % with dives simulated from data sheets (`tests/tests/sampling/calm.rs`).

use headrace_config::Document;
use headrace_coverage::PassError;
use headrace_fusion::filter::FilterNavigation;
use headrace_fusion::filter::settings::Settings;
use headrace_fusion::{Navigation, Times};
use headrace_geometry::frames::{Body, Rot, Tunnel};
use headrace_geometry::time::DurNs;
use headrace_sampling::margin::ExpectedErrors;
use headrace_sensor::device::{DeviceKind, Direction, SensorInfo};
use headrace_sensor::reading::Packet;
use headrace_vehicle::{NavigationConfig, VehicleConfig};

use crate::error::SceneError;
use crate::file_loader::FileLoader;
use crate::scene::Scene;
use crate::simulation::Simulation;

/// Duration of the dive, s. After this time, the uncertainty of an inertial unit's biases is within a few per cent of
/// its final value.
const CALM_S: f64 = 180.0;
/// Largest speed of the simulated dive, m/s, and largest share of the tunnel that it covers. The speed is lower in a
/// short tunnel.
const CALM_MPS: f64 = 0.1;
const MOST_SHARE: f64 = 0.5;
/// Largest evaluated time between two passes, s. All whole seconds up to this time are evaluated.
const TIMES_S: u32 = 110;

/// Expected position errors of a vehicle. `load` returns the vehicle file for its `name`.
///
/// `None` if the vehicle's navigation estimates no errors.
///
/// Errors: the vehicle cannot be simulated.
pub fn expected_errors(
    vehicle: &VehicleConfig,
    name: &str,
    kinds: &[&dyn DeviceKind],
    load: FileLoader<'_>,
) -> Result<Option<ExpectedErrors>, SceneError> {
    let NavigationConfig::Filter(settings) = vehicle.navigation else { return Ok(None) };
    let length_m = vehicle.tunnel.length_m;
    let distance_m = (CALM_MPS * CALM_S).min(MOST_SHARE * length_m);
    let text = format!(
        "vehicle = {name:?}\n[trajectory]\nstart_m = {}\n[[trajectory.legs]]\ndistance_m = {distance_m}\nspeed_mps = {}\n",
        (length_m - distance_m) / 2.0,
        distance_m / CALM_S
    );
    let scene = Scene::parse(Document::new("a calm dive", &text), kinds, load, None)?;
    let navigation = navigated(&scene, &Settings { learns: false, ..settings })?;
    Ok(Some(ExpectedErrors {
        confidence_sd: vehicle.target.confidence_sd,
        by_time: by_time(&navigation, vehicle, settings.mount_sd_rad),
    }))
}

/// Runs a scene and returns the filter at its end.
fn navigated(scene: &Scene, settings: &Settings) -> Result<FilterNavigation, SceneError> {
    let vehicle = &scene.vehicle;
    let mut navigation = FilterNavigation::new(vehicle.tunnel.profile.clone(), vehicle.site, *settings);
    let sensors = vehicle.sensors.iter().map(|sensor| sensor.specification());
    let mut sensors: Vec<_> = sensors
        .map(|spec| (SensorInfo { mount: spec.sensor.mount, kind: spec.kind }, spec.decoder))
        .collect();
    let mut simulation = Simulation::new(scene)?;
    while let Some(message) = simulation.next_message() {
        let source = usize::from(message.source);
        let Some((info, decoder)) = sensors.get_mut(source) else { continue };
        if message.direction == Direction::Received {
            let received = message.at;
            decoder.decode(Packet { received, bytes: message.bytes }, &mut |decoded| {
                let times = Times { received, valid: decoded.valid_at };
                navigation.update(source, info, times, &decoded.reading);
            });
        }
    }
    Ok(navigation)
}

/// Standard deviation of a hole's diameter for each time between two passes, as pairs of time, s, and deviation, m. For
/// each time, the largest deviation around the wall is taken.
fn by_time(navigation: &FilterNavigation, vehicle: &VehicleConfig, mount_sd_rad: f64) -> Vec<[f64; 2]> {
    let Some(running) = navigation.running() else { return Vec::new() };
    let profile = &vehicle.tunnel.profile;
    let mounts = running.suspicions.mount_error(mount_sd_rad);
    let arm = Rot::<Tunnel, Body>::identity() * -navigation.unit_at();
    let error = |time_s: u32| {
        let time_s = f64::from(time_s);
        let relative = running.clones.relative(DurNs::from_secs_f64(time_s))?.moved(arm);
        let relative = relative.weighted(1.0, &mounts, 1.0);
        let error = PassError { relative, from_m: profile.reference() };
        Some([time_s, error.worst_m(profile)])
    };
    (1..=TIMES_S).map_while(error).collect()
}
