//! `headrace run` on real ports: each sensor's line and driver, and how they are doing.

use std::cell::RefCell;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use headrace_geometry::time::{DurNs, MonoNs};
use headrace_ports::{Crew, Hand, Phase, SentSink, Status};
use headrace_replay::log::part_path;
use headrace_sensor::connect::{Connect, ConnectError};
use headrace_sensor::driver::DriverSetup;
use headrace_vehicle::VehicleConfig;

use crate::cli::Run;
use crate::dive::{Clock, Dive, Recording, assemble};
use crate::failure::Failure;
use crate::output::say;
use crate::report_output::finish;
use crate::watch::Watch;

/// The dive itself.
pub(crate) fn run(args: &Run, text: &str, vehicle: &VehicleConfig) -> Result<u8, Failure> {
    let required = required(args, vehicle)?;
    let log = args.record.clone().unwrap_or_else(new_log);
    let recording =
        (!args.no_record).then_some(Recording { path: &log, clock: Clock::Ours, rotate: args.rotate });
    let mut dive = assemble(vehicle, text, recording)?;
    let begun = headrace_ports::now();
    let crew = crew(&mut dive, vehicle, begun)?;
    let interrupted = interrupts()?;
    let until = args.duration.map(|seconds| begun + DurNs::from_secs_f64(seconds));
    let mut watch = Watch::unless(args.output.json);
    if !watch.is_quiet() {
        let where_to = match (args.no_record, args.rotate) {
            (true, _) => "not recorded".to_owned(),
            (false, None) => format!("recorded to {}", log.display()),
            (false, Some(_)) => format!("recorded in parts, from {} on", part_path(&log, 1).display()),
        };
        say(&format!("{}, target {} m: {where_to}; Ctrl-C ends the dive", vehicle.name, vehicle.target_m));
    }
    let lamps =
        RefCell::new(Lamps::new(vehicle, required, begun, begun + DurNs::from_secs_f64(args.require_within)));
    let ended = || {
        let now = headrace_ports::now();
        interrupted.load(Ordering::Relaxed)
            || until.is_some_and(|until| now >= until)
            || lamps.borrow().missing(now).is_some()
    };
    let report = dive.run_live(crew, &ended, &mut watch, &mut |crew, watch| {
        while let Some(status) = crew.next_status() {
            lamps.borrow_mut().show(&status, watch);
        }
    })?;
    let code = finish(&report, &args.output)?;
    match lamps.borrow().missing(headrace_ports::now()) {
        Some(why) => Err(Failure::Required(why)),
        None => Ok(code),
    }
}

/// Each sensor's id and where it is, or why that can't be.
pub(crate) fn connections(vehicle: &VehicleConfig) -> Vec<(&str, Result<Connect, ConnectError>)> {
    let sensors = vehicle.sensor_configs.iter().zip(&vehicle.sensors);
    let connect = sensors.map(|(config, device)| {
        let parsed = Connect::parse(&config.connect).and_then(|connect| connect.among(device.carriers()));
        (config.id.as_str(), parsed)
    });
    connect.collect()
}

/// The sensors without which the dive is not to go on, by number.
///
/// Errors: an id that the vehicle doesn't have; a required sensor whose `connect` can't be used.
fn required(args: &Run, vehicle: &VehicleConfig) -> Result<Vec<usize>, Failure> {
    let connections = connections(vehicle);
    let all = args.require.iter().any(|id| id == "all");
    let ids: Vec<&str> = connections.iter().map(|(id, _)| *id).collect();
    if let Some(unknown) = args.require.iter().find(|id| *id != "all" && !ids.contains(&id.as_str())) {
        let known = ids.join(", ");
        return Err(Failure::Usage(format!(
            "--require {unknown}: the vehicle has no such sensor; it has {known}, or all"
        )));
    }
    let mut required = Vec::new();
    for (number, (id, connect)) in connections.into_iter().enumerate() {
        if all || args.require.iter().any(|required| required == id) {
            connect.map_err(|error| Failure::Usage(format!("sensor {id:?} is required: {error}")))?;
            required.push(number);
        }
    }
    Ok(required)
}

/// A thread for each line, with the drivers of those on it.
fn crew(dive: &mut Dive, vehicle: &VehicleConfig, begun: MonoNs) -> Result<Crew, Failure> {
    let mut programs = vehicle.programs().map_err(Failure::Plan)?.into_iter();
    let mut hands = Vec::new();
    for (source, (_, connect)) in connections(vehicle).into_iter().enumerate() {
        let Some(device) = vehicle.sensors.get(source) else { continue };
        let head = device.head().and_then(|_| programs.next());
        let Some(port) = dive.armed.take_port(source) else { continue };
        hands.push(Hand { source, connect, port, driver: device.driver(&DriverSetup { begun, head }) });
    }
    let sent = dive.sent_port().map(|port| {
        let sink: SentSink = Arc::new(move |source, at, bytes: &[u8]| {
            port.sent(u16::try_from(source).unwrap_or(u16::MAX), at, bytes);
        });
        sink
    });
    Crew::start(hands, sent)
        .map_err(|source| Failure::System { what: "starting the threads of the ports", source })
}

/// Set by an interrupt or a request to end; a second one ends the program at once.
fn interrupts() -> Result<Arc<AtomicBool>, Failure> {
    use signal_hook::consts::{SIGINT, SIGTERM};
    let failed = |source| Failure::System { what: "listening for interrupts", source };
    let flag = Arc::new(AtomicBool::new(false));
    for signal in [SIGINT, SIGTERM] {
        signal_hook::flag::register_conditional_shutdown(signal, 1, Arc::clone(&flag)).map_err(failed)?;
        signal_hook::flag::register(signal, Arc::clone(&flag)).map_err(failed)?;
    }
    Ok(flag)
}

/// A name for the log that no earlier one has: the time of day, which nothing is ordered by.
fn new_log() -> PathBuf {
    let (_, utc) = headrace_ports::clock_anchor();
    PathBuf::from(format!("dive-{}.mcap", utc.0 / 1_000_000_000))
}

/// How each sensor is doing.
struct Lamps {
    ids: Vec<String>,
    words: Vec<String>,
    /// Required sensors that haven't run yet.
    required: Vec<usize>,
    /// By when they must have.
    required_by: MonoNs,
    begun: MonoNs,
}

impl Lamps {
    fn new(vehicle: &VehicleConfig, required: Vec<usize>, begun: MonoNs, required_by: MonoNs) -> Self {
        let ids: Vec<String> = vehicle.sensor_configs.iter().map(|config| config.id.clone()).collect();
        Self { words: vec![String::new(); ids.len()], ids, required, required_by, begun }
    }

    fn show(&mut self, status: &Status, watch: &mut Watch) {
        let Some(words) = self.words.get_mut(status.source) else { return };
        words.clone_from(&status.words);
        if status.phase == Phase::Running {
            self.required.retain(|number| *number != status.source);
        }
        if let Some(id) = self.ids.get(status.source) {
            watch.sensor(id, status);
        }
    }

    /// A required sensor that hasn't run in the time that it has for it, with why.
    fn missing(&self, now: MonoNs) -> Option<String> {
        let number = *self.required.first().filter(|_| now > self.required_by)?;
        let within_s = self.required_by.since(self.begun).as_secs_f64();
        Some(format!(
            "sensor {:?} is required and didn't run within {within_s} s: {}",
            self.ids.get(number)?,
            self.words.get(number)?
        ))
    }
}
