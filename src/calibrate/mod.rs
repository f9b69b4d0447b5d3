//! `headrace calibrate`: a log through the loop, and what its readings tell of the vehicle file.

mod findings;
mod hear;
mod table;
mod words;

use headrace_calibration::heads::{Heads, heads};
use headrace_calibration::still::longest;
use headrace_calibration::timing::lags;
use headrace_calibration::zero::{self, Zero};
use headrace_calibration::{Material, Untold};
use headrace_fusion::filter::settings::Settings;
use headrace_monitor::messages::Event;
use headrace_replay::log::files_of;
use headrace_replay::player::Player;
use headrace_sensor::device::{SensorInfo, SensorKind};
use headrace_vehicle::NavigationConfig;
use headrace_vehicle::VehicleConfig;

use crate::cli::Calibrate;
use crate::dive::assemble;
use crate::failure::{self, Failure};
use crate::output::{deliver, put};
use crate::progress::Progress;
use crate::vehicle_file;
use findings::Findings;
use hear::Heard;
use table::Table;

/// Finds what a log tells of the vehicle file.
pub(crate) fn calibrate(args: &Calibrate) -> Result<u8, Failure> {
    let mut player = Player::open(&files_of(std::slice::from_ref(&args.log))?)?;
    let (text, vehicle) = match &args.vehicle {
        Some(path) => vehicle_file::read(path),
        None => vehicle_file::attached(player.info(), &player.losses(), &args.log),
    }?;
    let dive = assemble(&vehicle, &text, None)?;
    player.connect(dive.armed.sources());
    let heard = hear::hear(dive.armed, &mut player, args)?;
    let findings = find(&vehicle, &heard, args);
    let table = Table::of(&vehicle, &findings);
    let losses = player.losses();
    if args.json {
        let shown = words::json(args, &vehicle, &heard, &findings, &table, &losses);
        deliver(&serde_json::to_string_pretty(&shown)?)?;
    } else {
        put(&words::text(args, &vehicle, &heard, &findings, &table, &losses));
    }
    Ok(if !losses.is_empty() {
        failure::DATA_LOST
    } else if table.found.is_empty() {
        failure::FAILED
    } else {
        failure::OK
    })
}

fn find(vehicle: &VehicleConfig, heard: &Heard, args: &Calibrate) -> Findings {
    let settings = match vehicle.navigation {
        NavigationConfig::Filter(settings) => settings,
        NavigationConfig::Direct => Settings::default(),
    };
    let within: Vec<Event> = heard.within().copied().collect();
    let all = Material {
        profile: &vehicle.tunnel.profile,
        site: vehicle.site,
        settings,
        sensors: &heard.sensors,
        events: &heard.events,
    };
    let in_time = Material { events: &within, ..all };
    let mut progress = Progress::start();
    progress.step("how the heads sit");
    let heads = heads(&in_time);
    let surface = match heard.at_surface {
        Some([from, to]) => zero::surface(&all, from, to),
        None => Err(Untold::NoSurface),
    };
    let surface_pa = surface.as_ref().ok().map(|zero| zero.found.value);
    let level =
        heads.as_ref().map_err(|why| *why).and_then(|heads| zero::water_level(&in_time, heads, surface_pa));
    let tethers = args.chainage.ok_or(Untold::NoChainage).and_then(|chainage_m| {
        let zeros = zero::tethers(&in_time, &longest(&in_time)?, chainage_m)?;
        let filed_m = |zero: &Zero| match heard.sensors.get(zero.source).map(|sensor| sensor.kind) {
            Some(SensorKind::Tether { zero_at_m, .. }) => zero_at_m,
            _ => 0.0,
        };
        Ok(zeros.into_iter().map(|zero| (zero, filed_m(&zero))).collect())
    });
    // Times are compared with heads as they are found to sit.
    let sensors = sitting(&heard.sensors, heads.as_ref().ok());
    let sitting = Material { sensors: &sensors, ..in_time };
    let latencies: Vec<_> = vehicle.sensor_configs.iter().map(|sensor| sensor.latency).collect();
    let mut runs = 0_u32;
    let lags = lags(&sitting, &latencies, &mut || {
        runs += 1;
        progress.step(&format!("time offsets: run {runs} of the filter"));
    });
    Findings { heads, surface, level, tethers, lags }
}

fn sitting(sensors: &[SensorInfo], heads: Option<&Heads>) -> Vec<SensorInfo> {
    let mut sensors = sensors.to_vec();
    for head in heads.iter().flat_map(|heads| &heads.heads) {
        if let Some(sensor) = sensors.get_mut(head.source) {
            sensor.mount = head.found;
        }
    }
    sensors
}
