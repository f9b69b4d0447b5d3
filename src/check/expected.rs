//! Rates and noise that a vehicle's sensors should have, from its file and from data sheets.

use headrace_fusion::filter::settings::Settings;
use headrace_geometry::math;
use headrace_geometry::site::Site;
use headrace_geometry::time::{DurNs, MonoNs};
use headrace_sampling::head::HeadProgram;
use headrace_sensor::device::{Device, Emulated, Emulator, EmulatorSetup, Sense};
use headrace_vehicle::{NavigationConfig, VehicleConfig};

use super::cable::sets_navigation;
use super::readings::Quantity;

/// Time for which a device is emulated to count its readings.
const COUNTED: DurNs = DurNs(20_000_000_000);

/// Expected noise of a quantity at rest.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct ExpectedNoise {
    pub(super) sd: f64,
    /// Origin of the value: vehicle file, data sheet or default.
    pub(super) source: &'static str,
}

/// Readings per second of a device with the settings in the vehicle file: mode of a head, `interval_ms` or `rate_hz`.
///
/// They are counted by emulating the device with the host that polls it.
pub(super) fn rate_hz(device: &dyn Device, head: Option<HeadProgram>, site: Site) -> f64 {
    let start = MonoNs(1);
    let emulated = device.emulator(&EmulatorSetup { start, head, site, polled: true });
    let count = match emulated {
        Emulated::Head(device) | Emulated::Echosounder(device) => begun(device, start),
        Emulated::Depth(device) => begun(device, start),
        Emulated::Inertial(device) => begun(device, start),
        Emulated::VelocityLog(device) => begun(device, start),
        Emulated::Tether(device) => begun(device, start),
    };
    count as f64 / COUNTED.as_secs_f64()
}

/// Number of measurements that a device begins during the time for which it is emulated.
fn begun<M>(mut device: Box<dyn Emulator<M>>, start: MonoNs) -> usize {
    let mut due = Vec::new();
    device.begin(start + COUNTED, &mut due);
    due.len()
}

/// Expected noise at rest of a sensor's quantity that is read `rate_hz` times a second; `None` if it isn't specified.
///
/// `text` is the text of the vehicle file.
pub(super) fn noise(
    vehicle: &VehicleConfig,
    text: &str,
    (sense, quantity): (Sense, Quantity),
    rate_hz: f64,
) -> Option<ExpectedNoise> {
    let settings = match &vehicle.navigation {
        NavigationConfig::Filter(settings) => *settings,
        NavigationConfig::Direct => Settings::default(),
    };
    // The standard deviation of a sample of white noise is the noise density times the square root of the rate.
    let root = math::sqrt(rate_hz);
    let (key, sd) = match (quantity, sense) {
        (Quantity::Range, Sense::Head) => ("return_sd_m", settings.return_sd_m),
        (Quantity::Range, _) => ("echo_sd_m", settings.echo_sd_m),
        (Quantity::Depth, _) => ("depth_sd_m", settings.depth_sd_m),
        (Quantity::TurnRate, _) => ("gyro_noise_degps_rthz", settings.rate_noise.to_degrees() * root),
        (Quantity::Acceleration, _) => ("accel_noise_mps2_rthz", settings.force_noise * root),
        (Quantity::Velocity, _) => ("velocity_sd_mps", settings.velocity_sd_mps),
        (Quantity::Cable, _) => ("tether_sd_m", settings.tether_sd_m),
        (Quantity::Attitude, _) => return None,
    };
    let is_inertial = matches!(quantity, Quantity::TurnRate | Quantity::Acceleration);
    let source = if sets_navigation(text, key) {
        "vehicle file"
    } else if is_inertial && vehicle.sensors.iter().any(|sensor| sensor.inertial_noise().is_some()) {
        "data sheet"
    } else {
        "default"
    };
    Some(ExpectedNoise { sd, source })
}
