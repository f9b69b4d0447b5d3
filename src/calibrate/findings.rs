//! All estimates from a log for a vehicle file.

use headrace_fusion::filter::settings::Settings;
use headrace_monitor::messages::Event;
use headrace_sensor::device::{SensorInfo, SensorKind};
use headrace_vehicle::{NavigationConfig, VehicleConfig};

use crate::calibrate::collect::{Collected, Material};
use crate::calibrate::estimate::NotEstimated;
use crate::calibrate::heads::{Heads, heads};
use crate::calibrate::still::longest;
use crate::calibrate::timing::{Lag, lags};
use crate::calibrate::zero::{self, Zero};

/// Result of each estimator, or the reason why it could estimate nothing.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Findings {
    /// Mounts of the heads.
    pub(crate) heads: Result<Heads, NotEstimated>,
    /// Pressure at the surface, Pa.
    pub(crate) surface: Result<Zero, NotEstimated>,
    /// Height of the water's surface above the floor, m.
    pub(crate) level: Result<Zero, NotEstimated>,
    /// Chainage at which each cable counter reads zero, m, each with the vehicle file's value, m.
    pub(crate) tethers: Result<Vec<(Zero, f64)>, NotEstimated>,
    /// Latency error of each sensor's timestamps.
    pub(crate) lags: Result<Vec<Lag>, NotEstimated>,
}

impl Findings {
    /// Runs all estimators on the collected part of a log.
    ///
    /// `chainage_m` is the true chainage at which the vehicle stood still. `progress` receives the name of
    /// each long step.
    pub(crate) fn of(
        vehicle: &VehicleConfig,
        collected: &Collected,
        chainage_m: Option<f64>,
        progress: &mut dyn FnMut(&str),
    ) -> Self {
        let settings = match vehicle.navigation {
            NavigationConfig::Filter(settings) => settings,
            NavigationConfig::Direct => Settings::default(),
        };
        let within: Vec<Event> = collected.within().copied().collect();
        let all = Material {
            profile: &vehicle.tunnel.profile,
            site: vehicle.site,
            settings,
            sensors: &collected.sensors,
            events: &collected.events,
        };
        let in_time = Material { events: &within, ..all };
        progress("mounts of the heads");
        let heads = heads(&in_time);
        let surface = match collected.at_surface {
            Some([from, to]) => zero::surface(&all, from, to),
            None => Err(NotEstimated::NoSurface),
        };
        let surface_pa = surface.as_ref().ok().map(|zero| zero.found.value);
        let level = heads
            .as_ref()
            .map_err(|why| *why)
            .and_then(|heads| zero::water_level(&in_time, heads, surface_pa));
        let tethers = chainage_m.ok_or(NotEstimated::NoChainage).and_then(|chainage_m| {
            let zeros = zero::tethers(&in_time, &longest(&in_time)?, chainage_m)?;
            let filed_m = |zero: &Zero| match collected.sensors.get(zero.source).map(|sensor| sensor.kind) {
                Some(SensorKind::Tether { zero_at_m, .. }) => zero_at_m,
                _ => 0.0,
            };
            Ok(zeros.into_iter().map(|zero| (zero, filed_m(&zero))).collect())
        });
        // The time offsets are estimated with the mounts that were found for the heads.
        let sensors = sitting(&collected.sensors, heads.as_ref().ok());
        let sitting = Material { sensors: &sensors, ..in_time };
        let latencies: Vec<_> = vehicle.sensor_configs.iter().map(|sensor| sensor.latency).collect();
        let mut runs = 0_u32;
        let lags = lags(&sitting, &latencies, &mut || {
            runs += 1;
            progress(&format!("time offsets: run {runs} of the filter"));
        });
        Self { heads, surface, level, tethers, lags }
    }
}

/// Sensors with the mounts found for the heads.
fn sitting(sensors: &[SensorInfo], heads: Option<&Heads>) -> Vec<SensorInfo> {
    let mut sensors = sensors.to_vec();
    for head in heads.iter().flat_map(|heads| &heads.heads) {
        if let Some(sensor) = sensors.get_mut(head.source) {
            sensor.mount = head.found;
        }
    }
    sensors
}
