//! `headrace run` on real ports: connections, drivers, and the state of each sensor.

use std::cell::{Cell, RefCell};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::Ordering;

use headrace_dashboard::Mode;
use headrace_geometry::time::{DiveClock, DurNs, MonoNs};
use headrace_ports::{Connection, LineRecord, Phase, Status, Supervisor};
use headrace_replay::log::part_path;
use headrace_replay::saved_state::SavedState;
use headrace_sensor::connect::{Connect, ConnectError};
use headrace_sensor::driver::DriverSetup;
use headrace_vehicle::{Grade, VehicleConfig};

use crate::cli::Run;
use crate::dive::{Assembly, Clock, Dive, Recording};
use crate::failure::Failure;
use crate::followers::{Followers, Joining};
use crate::interrupt;
use crate::output;
use crate::outputs::{self, Claims};
use crate::page::{self, Of, Served, VoicesOf};
use crate::recordings::InRecordings;
use crate::report_output::{finish, state_utc};
use crate::resume::Resuming;
use crate::screen::Screen;
use crate::summary::broken;
use crate::tui;
use crate::watch::{Show, Watch};

/// Texts of the errors that `headrace check` would find in the vehicle file. A dive shows these errors, but
/// runs.
fn wrong_texts(vehicle: &VehicleConfig) -> Vec<String> {
    let errors = vehicle.findings().into_iter().filter(|finding| finding.grade == Grade::Error);
    errors.map(|finding| format!("WRONG in the vehicle file: {finding}")).collect()
}

/// Runs a dive on the vehicle's ports.
pub(crate) fn run(args: &Run, text: &str, vehicle: &VehicleConfig, claims: Claims) -> Result<u8, Failure> {
    let required = required(args, vehicle)?;
    output::never_wait();
    let mut logs = if args.record.is_empty() { vec![new_log()] } else { args.record.clone() };
    let resuming = Resuming::of(args, &logs, (vehicle, text))?;
    match &resuming {
        Some(resuming) => logs = resuming.paths(),
        None if args.no_record => {}
        None => make_room(&logs, args, claims)?,
    }
    let recording = (!args.no_record).then_some(Recording {
        paths: &logs,
        clock: Clock::Ours,
        rotate: args.rotate,
        scene: None,
        earlier: resuming.as_ref().map_or(&[], |resuming| &resuming.recordings),
    });
    let (is_served, recording_is_on) = (page::is_wanted(&args.page, true), recording.is_some());
    let mut dive =
        Assembly::of(vehicle, text).recorded(recording).kept(is_served).assemble()?.operated(Clock::Ours);
    // After a restart, the recordings come in another order. The states stay beside the first one on the command line.
    if let (Some(log), true) = (logs.iter().min_by_key(|log| place(log, &args.record)), recording_is_on) {
        dive.keep_states(log);
    }
    let rebuild = resuming.as_ref().map(|resuming| resuming.begin(vehicle, &mut dive)).transpose()?;
    let begun = headrace_ports::now();
    let supervisor = supervisor(&mut dive, vehicle, begun)?;
    let followers = Followers::of(&args.following)?;
    let interrupted = interrupt::flag_of_a_dive()?;
    // The duration in --for counts from the time at which the dive begins or goes on.
    let until = Cell::new(None);
    let show = followers.show(args.output.show());
    let mut watch = Watch::new(show).live();
    let served = is_served.then(|| live_page(args, vehicle, &logs, &dive, &mut watch)).flatten();
    if let Some(served) = &served {
        watch = watch.followed_by(served.follower(&dive.armed));
    }
    let wrong: Vec<String> = wrong_texts(vehicle);
    let mut begun_text = begun_text(args, &logs, (vehicle, resuming.as_ref()));
    if show == Show::Lines {
        for line in
            core::iter::once(&begun_text).chain(&wrong).flat_map(|text| broken(text, Screen::columns()))
        {
            watch.say(&line);
        }
    }
    if let [first, ..] = wrong.as_slice() {
        output::append(&mut begun_text, format_args!("; {first}"));
    }
    let joining =
        Joining::new(vehicle, tui::Mode::Live, &interrupted).operated(dive.console()).saying(begun_text);
    let mut watch = followers.join(watch, joining)?;
    let states = RefCell::new(SensorStates::new(
        vehicle,
        required,
        begun,
        begun + DurNs::from_secs_f64(args.require_within),
    ));
    let ended = || {
        let now = headrace_ports::now();
        interrupted.load(Ordering::Relaxed)
            || until.get().is_some_and(|until| now >= until)
            || states.borrow().missing(now).is_some()
    };
    let mut beside = |supervisor: &Supervisor, watch: &mut Watch| {
        while let Some(status) = supervisor.next_status() {
            states.borrow_mut().show(&status, watch);
        }
    };
    if let Some((resuming, rebuild)) = resuming.as_ref().zip(rebuild)
        && !dive.rebuild(resuming.interruption(), rebuild, (&supervisor, &ended), &mut watch, &mut beside)?
    {
        let why = states.borrow().missing(headrace_ports::now()).unwrap_or_else(|| {
            "the dive was ended before its earlier part was read again, so there is no report".to_owned()
        });
        return Err(Failure::Required(format!("{why}; --resume goes on with the dive")));
    }
    until.set(args.duration.map(|seconds| headrace_ports::now() + DurNs::from_secs_f64(seconds)));
    dive.run_live(&supervisor, &ended, &mut watch, &mut beside);
    let mut report = dive.end_live(supervisor, &mut watch);
    // If the first medium was missing for a while, there are states beside other recordings, too.
    for log in logs.iter().filter(|_| recording_is_on) {
        drop(std::fs::remove_file(SavedState::path(log)));
    }
    state_utc(&mut report, Some(utc_of_zero_s()));
    if let Some(served) = served {
        served.end(&report);
    }
    let code = finish(&report, &args.output)?;
    match states.borrow().missing(headrace_ports::now()) {
        Some(why) => Err(Failure::Required(why)),
        None => Ok(code),
    }
}

/// Place of a recording on the command line, by its path and then by its folder. A dive that goes on may have another
/// name than the given one.
fn place(log: &Path, given: &[PathBuf]) -> [usize; 2] {
    let by_path = given.iter().position(|given| given == log);
    let by_folder = given.iter().position(|given| given.parent() == log.parent());
    [by_path, by_folder].map(|place| place.unwrap_or(given.len()))
}

/// UTC of the zero of this machine's clock, seconds.
fn utc_of_zero_s() -> f64 {
    let (monotonic, utc) = headrace_ports::clock_anchor();
    (utc.0 - monotonic.0.cast_signed()) as f64 / 1e9
}

/// Serves the page of a dive on ports.
fn live_page(
    args: &Run,
    vehicle: &VehicleConfig,
    logs: &[PathBuf],
    dive: &Dive,
    watch: &mut Watch,
) -> Option<Served> {
    let log = logs.first().filter(|_| !args.no_record).map(|log| log.display().to_string());
    let of = Of {
        vehicle,
        mode: Mode::Live,
        dive: log.clone().unwrap_or_else(|| vehicle.name.clone()),
        recorded_to: log,
        compared_m: None,
        utc_of_zero_s: Some(utc_of_zero_s()),
        span: None,
        clock: DiveClock::default(),
        is_playback: false,
        console: dive.console(),
        voices: VoicesOf::Dive(dive.voice_ports()),
    };
    let shows_lines = watch.shows_lines();
    let mut say = |lines: &str| lines.lines().for_each(|line| watch.say(line));
    page::serve(&args.page, of, if shows_lines { Some(&mut say) } else { None })
}

/// Text about ports and recordings that is shown at the beginning of a dive.
fn begun_text(
    args: &Run,
    logs: &[PathBuf],
    (vehicle, resuming): (&VehicleConfig, Option<&Resuming>),
) -> String {
    if let Some(resuming) = resuming {
        return format!("{}: {}; Ctrl-C ends the dive", vehicle.name, resuming.words());
    }
    let first = |log: &PathBuf| if args.rotate.is_some() { part_path(log, 1) } else { log.clone() };
    let firsts: Vec<String> = logs.iter().map(|log| first(log).display().to_string()).collect();
    let firsts = firsts.join(" and ");
    let where_to = match (args.no_record, args.rotate) {
        (true, _) => "not recorded".to_owned(),
        (false, None) => format!("recorded to {firsts}"),
        (false, Some(_)) => format!("recorded in parts, starting with {firsts}"),
    };
    format!("{}, target {} m: {where_to}; Ctrl-C ends the dive", vehicle.name, vehicle.target.max_hole_m)
}

/// Checks that a dive can be recorded to these files.
///
/// With `--force` existing files are removed. After this step no check can prevent the dive.
pub(crate) fn make_room(logs: &[PathBuf], args: &Run, mut claims: Claims) -> Result<(), Failure> {
    let first = |log: &PathBuf| claims.claim_recording("--record", log, args.rotate.is_some());
    let firsts = logs.iter().map(first).collect::<Result<Vec<_>, _>>()?;
    firsts.iter().try_for_each(|first| outputs::make_way(first))
}

/// Id of each sensor and its connection, or the reason why `connect` is invalid.
pub(crate) fn connections(vehicle: &VehicleConfig) -> Vec<(&str, Result<Connect, ConnectError>)> {
    let sensors = vehicle.sensor_configs.iter().zip(&vehicle.sensors);
    let connect = sensors.map(|(config, device)| {
        let parsed = Connect::parse(&config.connect).and_then(|connect| connect.among(device.carriers()));
        (config.id.as_str(), parsed)
    });
    connect.collect()
}

/// Numbers of the sensors that `--require` names.
///
/// Errors: the vehicle has no sensor with the id, or a required sensor has an invalid `connect`.
fn required(args: &Run, vehicle: &VehicleConfig) -> Result<Vec<usize>, Failure> {
    let connections = connections(vehicle);
    let all = args.require.iter().any(|id| id == "all");
    let ids: Vec<&str> = connections.iter().map(|(id, _)| *id).collect();
    if let Some(unknown) = args.require.iter().find(|id| *id != "all" && !ids.contains(&id.as_str())) {
        let known = ids.join(", ");
        return Err(Failure::Usage(format!(
            "--require {unknown}: no such sensor; expected all, or ids of {known}"
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

/// Starts a thread per connection. The thread runs the drivers of its sensors.
pub(crate) fn supervisor(
    dive: &mut Dive,
    vehicle: &VehicleConfig,
    begun: MonoNs,
) -> Result<Supervisor, Failure> {
    let mut programs = vehicle.programs().map_err(Failure::Plan)?.into_iter();
    let excluded = vehicle.excluded_from_lines();
    let mut served = Vec::new();
    for (source, (_, connect)) in connections(vehicle).into_iter().enumerate() {
        let Some(device) = vehicle.sensors.get(source) else { continue };
        let head = device.head().and_then(|_| programs.next());
        let Some(port) = dive.armed.take_port(source) else { continue };
        let excluded = excluded.iter().find(|(number, _)| *number == source).map(|(_, why)| why.clone());
        let connect = match (connect, excluded) {
            (Ok(connect), Some(problem)) => Err(ConnectError {
                text: connect.to_string(),
                problem,
                allowed: "headrace check names all such lines".to_owned(),
            }),
            (connect, _) => connect,
        };
        served.push(Connection {
            source,
            connect,
            port,
            driver: device.driver(&DriverSetup { begun, head }),
        });
    }
    let ports = dive.line_ports();
    let record = (!ports.is_empty()).then(|| Arc::new(InRecordings(ports)) as Arc<dyn LineRecord>);
    Supervisor::start(served, record)
        .map_err(|source| Failure::System { what: "starting the port threads", source })
}

/// Default name of a log, made from the time of day.
fn new_log() -> PathBuf {
    let (_, utc) = headrace_ports::clock_anchor();
    PathBuf::from(format!("dive-{}.mcap", utc.0 / 1_000_000_000))
}

/// State of each sensor's port, and the deadline of required sensors.
struct SensorStates {
    ids: Vec<String>,
    words: Vec<String>,
    /// Numbers of required sensors that aren't running yet.
    required: Vec<usize>,
    /// Time by which the required sensors must run.
    required_by: MonoNs,
    begun: MonoNs,
}

impl SensorStates {
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

    /// Text about a required sensor that isn't running at the deadline, with the sensor's last status.
    fn missing(&self, now: MonoNs) -> Option<String> {
        let number = *self.required.first().filter(|_| now > self.required_by)?;
        let within_s = self.required_by.since(self.begun).as_secs_f64();
        Some(format!(
            "required sensor {:?} wasn't running within {within_s} s: {}",
            self.ids.get(number)?,
            self.words.get(number)?
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn states_are_beside_the_first_recording_on_the_command_line() {
        let given = ["dive.mcap", "/media/stick/dive.mcap", "/media/stick/second.mcap"].map(PathBuf::from);
        let first = |logs: &[&'static str]| {
            let logs = logs.iter().copied().map(Path::new);
            logs.min_by_key(|log| place(log, &given)).unwrap()
        };
        assert_eq!(first(&["/media/stick/dive.mcap", "dive.mcap"]), Path::new("dive.mcap"));
        assert_eq!(first(&["/media/stick/dive-1.mcap", "dive-1.mcap"]), Path::new("dive-1.mcap"));
        let both = ["/media/stick/second.mcap", "/media/stick/dive.mcap"];
        assert_eq!(first(&both), Path::new("/media/stick/dive.mcap"));
    }
}
