//! A dive from the assembled loop to the report: shared by `demo`, `run` and `replay`.

use std::cell::RefCell;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use headrace_fusion::Navigation;
use headrace_geometry::snapshot::SnapshotError;
use headrace_geometry::time::{DurNs, MonoNs};
use headrace_monitor::App;
use headrace_monitor::console::{CONSOLE_ID, Command, ConsoleInput, ConsolePort};
use headrace_monitor::entities::HeadSpecification;
use headrace_monitor::head_descriptions::HeadDescriptions;
use headrace_monitor::notice_outlet::{NoticeOutlet, NoticeReceiver};
use headrace_monitor::report::{LineReport, Report};
use headrace_monitor::run::Loop;
use headrace_ports::Supervisor;
use headrace_replay::drive::{DriveError, Pace, PacketSource, drive};
use headrace_replay::log::{
    DerivedChannels, Every, Interrupted, LinePort, LogHeader, Recorder, Rotation, SourceInfo, VoicePort,
    dive_name,
};
use headrace_replay::rebuild::{Rebuild, Rebuilt};
use headrace_replay::record::{QUEUE_BYTES, QUEUE_OF_PORTS_BYTES, RecorderOutlet, result_channels};
use headrace_replay::saved_state::StateKeeper;
use headrace_replay::threads::drive_on;
use headrace_replay::view::{Site, View};
use headrace_sensor::device::Sense;
use headrace_vehicle::VehicleConfig;

use crate::failure::Failure;
use crate::feeds;
use crate::interruption::{Earlier, Interruption};
use crate::memory;
use crate::outputs::SIMULATED;
use crate::phase::Phase;
use crate::progress::Progress;
use crate::recordings::Recordings;
use crate::watch::Watch;

/// Capacity of the queue of notices to the terminal.
///
/// A tick (one run of the loop, every 20 ms) has only a few notices. A place in the queue takes about 400 bytes,
/// allocated before the dive begins.
const NOTICES: usize = 1 << 10;

/// Metadata keys of a log. Their values state the same moment on two clocks: the log's clock and UTC, both in
/// nanoseconds.
pub(crate) const CLOCK_ANCHOR: [&str; 2] = ["clock_anchor_monotonic_ns", "clock_anchor_utc_ns"];

/// Metadata keys of a live dive's log: the boot in which the log was recorded, and how far the dive's clock was ahead
/// of the host's clock, ns.
pub(crate) const BOOT: [&str; 2] = ["boot_id", "clock_ahead_ns"];
/// Function that is called after every tick.
type AfterTick<'a> = &'a mut dyn FnMut(&Loop);

/// A loop that is ready to run with the vehicle's sensors, and the consumers of its results.
pub(crate) struct Dive {
    pub(crate) armed: Loop,
    notices: NoticeReceiver,
    recordings: Recordings,
    operator: Option<Operator>,
    states: Option<StateKeeper>,
    /// The parts recorded before the dive was interrupted.
    earlier: Earlier,
}

/// Operator's input of a live dive.
struct Operator {
    input: ConsoleInput,
    port: ConsolePort,
    /// Whether a recording is failing, as the loop was last told.
    fails: bool,
}

/// A log to which a dive is recorded.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Recording<'a> {
    /// Paths of the log. Each path is a separate recording of the same dive.
    pub(crate) paths: &'a [PathBuf],
    pub(crate) clock: Clock,
    /// Size or duration after which a recording begins a new part; `None` for a recording in a single file.
    pub(crate) rotate: Option<Every>,
    /// Name of the scene, for a simulation.
    pub(crate) scene: Option<&'a str>,
    /// The interrupted recordings that the paths continue; empty for a new dive.
    pub(crate) earlier: &'a [Interrupted],
}

impl<'a> Recording<'a> {
    /// Recording of a simulated dive.
    pub(crate) fn simulated(path: &'a PathBuf, scene: &'a str) -> Self {
        Self {
            paths: std::slice::from_ref(path),
            clock: Clock::Theirs,
            rotate: None,
            scene: Some(scene),
            earlier: &[],
        }
    }
}

/// Clock by which a dive's timestamps are taken.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Clock {
    /// This machine's monotonic clock.
    Ours,
    /// Clock of a recorded or simulated dive, whose timestamps are already in the data.
    Theirs,
}

/// Builder of a dive from a vehicle and options.
pub(crate) struct Assembly<'a> {
    vehicle: &'a VehicleConfig,
    text: &'a str,
    recording: Option<Recording<'a>>,
    keeps_results: bool,
    navigation: Option<Box<dyn Navigation>>,
}

impl<'a> Assembly<'a> {
    /// Assembles a vehicle with the navigation that its file states. `text` is the text of the file.
    pub(crate) fn of(vehicle: &'a VehicleConfig, text: &'a str) -> Self {
        Self { vehicle, text, recording: None, keeps_results: false, navigation: None }
    }

    /// Records the dive, if there is a recording.
    pub(crate) fn recorded(self, recording: Option<Recording<'a>>) -> Self {
        Self { recording, ..self }
    }

    /// Sets whether the results of each tick are kept for a follower or a comparison.
    pub(crate) fn kept(self, keeps_results: bool) -> Self {
        Self { keeps_results, ..self }
    }

    /// Replaces the navigation that the vehicle file states.
    pub(crate) fn navigated(self, navigation: Box<dyn Navigation>) -> Self {
        Self { navigation: Some(navigation), ..self }
    }

    /// Starts the recorders, and arms the loop.
    ///
    /// Errors: there is too little memory, a device or plugin doesn't fit, or a recording can't be created.
    pub(crate) fn assemble(self) -> Result<Dive, Failure> {
        let vehicle = self.vehicle;
        memory::check_room(ring_bytes(vehicle), vehicle.tunnel.length_m)?;
        let (mut app, notices) = app(vehicle)?;
        if self.keeps_results {
            app.keep_results();
        }
        let recordings = match self.recording {
            None => Recordings::default(),
            Some(recording) => record(&mut app, vehicle, self.text, recording)?,
        };
        let armed = arm(app, vehicle, self.navigation.unwrap_or_else(|| vehicle.navigation()))?;
        Ok(Dive { armed, notices, recordings, operator: None, states: None, earlier: Earlier::default() })
    }
}

/// Starts the recorders of a dive.
fn record(
    app: &mut App,
    vehicle: &VehicleConfig,
    vehicle_text: &str,
    Recording { paths, clock, rotate, scene, earlier }: Recording<'_>,
) -> Result<Recordings, Failure> {
    let mut header = log_header(vehicle, vehicle_text, true);
    let is_live = clock == Clock::Ours;
    if is_live {
        anchor(&mut header);
    }
    header.metadata.extend(scene.map(|scene| (SIMULATED.to_owned(), scene.to_owned())));
    let rotation = Rotation { every: rotate, dive: new_dive() };
    let queue_bytes = if is_live { QUEUE_OF_PORTS_BYTES } else { QUEUE_BYTES };
    let (mut ports, mut recorders) = (Vec::new(), Vec::new());
    for (number, path) in paths.iter().enumerate() {
        let view: Option<Box<dyn DerivedChannels>> = Some(Box::new(View::new(view_site(vehicle))));
        let (port, handle) = match earlier.get(number) {
            Some(earlier) => Recorder::go_on(earlier, &header, rotate, queue_bytes, view)?,
            None => Recorder::create(path, &header, &rotation, queue_bytes, view)?,
        };
        ports.push(port);
        recorders.push((path.clone(), handle));
    }
    let outlet = RecorderOutlet::new(ports);
    app.add_plugin(&if is_live { outlet.of_ports() } else { outlet })?;
    Ok(Recordings::of(recorders, is_live))
}

/// Allocates all memory of the loop, so that it can run.
fn arm(app: App, vehicle: &VehicleConfig, navigation: Box<dyn Navigation>) -> Result<Loop, Failure> {
    let armed = app.arm(navigation)?;
    if tracing::enabled!(tracing::Level::INFO) {
        let ring_bytes = ring_bytes(vehicle);
        let (sensors, resident_kib) = (vehicle.sensors.len(), memory::resident_kib());
        tracing::info!(sensors, ring_bytes, resident_kib, "loop armed");
    }
    Ok(armed)
}

/// Total size of the ring buffers of all sensors, bytes.
fn ring_bytes(vehicle: &VehicleConfig) -> usize {
    vehicle.sensors.iter().map(|sensor| sensor.specification().ring_bytes).sum()
}

/// The app with the vehicle's sensors, and the queue of notices to the terminal.
fn app(vehicle: &VehicleConfig) -> Result<(App, NoticeReceiver), Failure> {
    let mut app = App::new(vehicle.mission());
    for sensor in &vehicle.sensors {
        app.add_device(sensor.as_ref())?;
    }
    if cfg!(feature = "foxglove") {
        app.keep_results();
    }
    let (outlet, notices) = NoticeOutlet::new(NOTICES);
    app.add_plugin(&outlet)?;
    Ok((app, notices))
}

/// Description of the tunnel and the heads for viewers such as Foxglove.
pub(crate) fn view_site(vehicle: &VehicleConfig) -> Site {
    let heads = (0..).zip(&vehicle.sensors).filter(|(_, sensor)| sensor.head().is_some());
    let mission = vehicle.mission();
    let specified = vehicle.sensors.iter().filter_map(|sensor| {
        let (device, spec) = (sensor.as_ref(), sensor.head()?);
        let head = HeadSpecification::of(device, spec, &mission);
        Some(head.settings(&sensor.specification().sensor.id, &mission.profile, mission.target.max_hole_m))
    });
    let head_descriptions = HeadDescriptions::of(specified);
    let reaches = heads.clone().map(|(_, sensor)| sensor.specification().sensor.mount.position.x().abs());
    Site {
        profile: vehicle.tunnel.profile.clone(),
        target_m: vehicle.target.max_hole_m,
        section_m: vehicle.section_m,
        run_up_m: reaches.fold(0.0, f64::max) + vehicle.target.max_hole_m,
        length_m: vehicle.tunnel.length_m,
        head_descriptions,
        heads: heads.map(|(source, _)| source).collect(),
    }
}

/// Stores the UTC that corresponds to the monotonic clock in the log's header.
fn anchor(header: &mut LogHeader) {
    let (monotonic, utc) = headrace_ports::clock_anchor();
    let [of_clock, of_utc] = CLOCK_ANCHOR.map(str::to_owned);
    header.metadata.insert(of_clock, monotonic.0.to_string());
    header.metadata.insert(of_utc, utc.0.to_string());
    let [boot, ahead] = BOOT.map(str::to_owned);
    header.metadata.extend(boot_id().map(|id| (boot, id)));
    header.metadata.insert(ahead, headrace_ports::ahead().0.to_string());
}

/// A loop whose results nobody receives. It gives the same results as a recorded loop.
pub(crate) fn silent(vehicle: &VehicleConfig) -> Result<Loop, Failure> {
    memory::check_room(ring_bytes(vehicle), vehicle.tunnel.length_m)?;
    let mut app = App::new(vehicle.mission());
    for sensor in &vehicle.sensors {
        app.add_device(sensor.as_ref())?;
    }
    app.keep_results();
    arm(app, vehicle, vehicle.navigation())
}

/// Identifier of the computer's present boot; `None` if the system has none.
pub(crate) fn boot_id() -> Option<String> {
    let text = std::fs::read_to_string("/proc/sys/kernel/random/boot_id").ok()?;
    Some(text.trim().to_owned())
}

/// A unique name for a recording.
fn new_dive() -> String {
    let (monotonic, utc) = headrace_ports::clock_anchor();
    dive_name(&[monotonic.0, utc.0.cast_unsigned(), std::process::id().into()])
}

/// Header of this vehicle's log.
pub(crate) fn log_header(vehicle: &VehicleConfig, vehicle_text: &str, ticks: bool) -> LogHeader {
    let sources = vehicle.sensor_configs.iter().map(|sensor| SourceInfo {
        id: sensor.id.clone(),
        plugin: sensor.plugin.clone(),
        connect: sensor.connect.clone(),
    });
    let console =
        SourceInfo { id: CONSOLE_ID.to_owned(), plugin: CONSOLE_ID.to_owned(), connect: String::new() };
    let sources = sources.chain(ticks.then_some(console));
    LogHeader {
        vehicle_toml: vehicle_text.to_owned(),
        attachments: vehicle
            .attachments
            .iter()
            .map(|(name, text)| (name.clone(), text.clone().into_bytes()))
            .collect(),
        metadata: [("version".to_owned(), env!("CARGO_PKG_VERSION").to_owned())].into(),
        sources: sources.collect(),
        ticks,
        voices: ticks,
        results: if ticks { result_channels() } else { Vec::new() },
        sonars: sonars(vehicle),
        part: None,
    }
}

/// Numbers of the sensors that are sonars.
fn sonars(vehicle: &VehicleConfig) -> Vec<u16> {
    let is_sonar = |sense: Sense| matches!(sense, Sense::Head | Sense::Echosounder);
    let numbered = (0..).zip(&vehicle.sensors);
    numbered.filter(|(_, sensor)| is_sonar(sensor.sense())).map(|(number, _)| number).collect()
}

impl Dive {
    /// Accepts an operator's commands from now on. Only live dives call this function.
    pub(crate) fn operated(mut self, clock: Clock) -> Self {
        let clock: Option<Arc<dyn Fn() -> MonoNs + Send + Sync>> = match clock {
            Clock::Ours => Some(Arc::new(headrace_ports::now)),
            Clock::Theirs => None,
        };
        let input = ConsoleInput::new(&mut self.armed, clock);
        self.operator = input.map(|(input, port)| Operator { input, port, fails: false });
        self
    }

    /// Port that accepts commands for the loop from any thread; `None` for a dive without an operator.
    pub(crate) fn console(&self) -> Option<ConsolePort> {
        self.operator.as_ref().map(|operator| operator.port.clone())
    }

    /// Runs the loop until the feed ends, and returns the report. `beside` is called after every tick and at
    /// the end.
    pub(crate) fn run(
        self,
        feed: &mut dyn PacketSource,
        pace: Pace,
        watch: &mut Watch,
        beside: &mut dyn FnMut(&Loop),
    ) -> Result<Report, Failure> {
        let span = feed.span();
        self.run_driven(span, watch, beside, &mut |dive, after_tick| drive(dive, feed, pace, after_tick))
    }

    /// Runs the loop on up to `threads` threads, and returns the report. If a playback speed is set, one
    /// thread is used.
    pub(crate) fn run_on(
        self,
        threads: usize,
        (feed, pace): (&mut (dyn PacketSource + Send), Pace),
        watch: &mut Watch,
        beside: &mut dyn FnMut(&Loop),
    ) -> Result<Report, Failure> {
        let span = feed.span();
        self.run_driven(span, watch, beside, &mut |dive, after_tick| match pace.speed {
            Some(_) => drive(dive, feed, pace, after_tick),
            None => drive_on(threads, dive, feed, pace.tick, after_tick),
        })
    }

    fn run_driven(
        mut self,
        span: Option<(MonoNs, MonoNs)>,
        watch: &mut Watch,
        beside: &mut dyn FnMut(&Loop),
        drive: &mut dyn FnMut(&mut Loop, AfterTick<'_>) -> Result<(), DriveError>,
    ) -> Result<Report, Failure> {
        let notices = self.notices.clone();
        let phase = Phase::start("replay");
        let mut progress = Progress::start();
        let driven = drive(&mut self.armed, &mut |dive| {
            if watch.is_quiet() {
                let (tally, share) = (dive.view().tally(), feeds::share(span, dive.now()));
                progress.at(|| {
                    (format!("{} packets, {} samples", dive.view().placed().packets(), tally.samples), share)
                });
            }
            while let Some(notice) = notices.next() {
                watch.notice(&notice, dive);
            }
            tell_recordings(&mut self.recordings, watch, dive, self.operator.as_mut());
            if let Some(operator) = &mut self.operator {
                operator.input.take_in(dive.now());
            }
            watch.tick(dive);
            beside(dive);
        });
        drop(progress);
        drop(phase);
        if let Err(error @ DriveError::Panicked { .. }) = driven {
            // After a panic, parts of the loop's state are missing, so there is no report.
            return Err(error.into());
        }
        let report = self.end(watch, beside);
        driven?;
        Ok(report)
    }

    /// Lets the function `direct` run the loop, and returns the report of the dive.
    pub(crate) fn play(
        mut self,
        watch: &mut Watch,
        direct: impl FnOnce(&mut Loop, &NoticeReceiver, &mut Watch) -> Result<(), Failure>,
    ) -> Result<Report, Failure> {
        let notices = self.notices.clone();
        let phase = Phase::start("playback");
        let played = direct(&mut self.armed, &notices, watch);
        drop(phase);
        let report = self.end(watch, &mut |_| ());
        played?;
        Ok(report)
    }

    /// Saves states beside the recording, so that the dive can be continued quickly after an interruption.
    pub(crate) fn keep_states(&mut self, recording: &Path) {
        match StateKeeper::start(recording) {
            Ok(states) => self.states = Some(states),
            Err(error) => tracing::warn!("saving states of the dive: {error}"),
        }
    }

    /// Rebuilds the state that the dive had before the interruption. Meanwhile, packets from the ports are recorded but
    /// not processed. Returns false if `ended` returns true before the state is rebuilt.
    ///
    /// If the log can't be read, the dive goes on without the earlier part, and the report says so. If the dive ends
    /// before its state is rebuilt, the recording can be continued.
    ///
    /// Errors: the loop can't take the rebuilt state.
    pub(crate) fn rebuild(
        &mut self,
        interruption: Interruption,
        rebuild: Rebuild,
        (supervisor, ended): (&Supervisor, &dyn Fn() -> bool),
        watch: &mut Watch,
        beside: &mut dyn FnMut(&Supervisor, &mut Watch),
    ) -> Result<bool, Failure> {
        let _phase = Phase::start("rebuilding the dive so far");
        let rebuild = RefCell::new(rebuild);
        if let Some(operator) = &mut self.operator {
            operator.restarted(interruption.gap);
            operator.input.take_in(headrace_ports::now());
        }
        let near = || ended() || rebuild.borrow().is_near();
        supervisor.run(&mut self.armed, &near, &mut |dive| {
            rebuild.borrow_mut().take(&dive.view().placed().inbox);
            tell_recordings(&mut self.recordings, watch, dive, None);
            watch.rebuilding(interruption.read_pct(rebuild.borrow().at()), dive);
            if let Some(operator) = &mut self.operator {
                operator.input.take_in(dive.now());
            }
            beside(supervisor, watch);
        });
        let rebuild = rebuild.into_inner();
        if ended() {
            rebuild.cancel();
            self.recordings.abandon();
            return Ok(false);
        }
        self.earlier.losses = interruption.losses;
        let words = match rebuild.finish() {
            Ok(rebuilt) => {
                let replayed = rebuilt.consumed.packets - rebuilt.saved_packets;
                self.go_on(rebuilt)?;
                format!("{}; {replayed} packets replayed", interruption.words)
            }
            Err(error) => {
                self.armed.go_on(None)?;
                let words = format!("the dive before the interruption can't be read again: {error}");
                self.earlier.losses.push(words.clone());
                words
            }
        };
        watch.rebuilt(&self.armed, &words);
        Ok(true)
    }

    fn go_on(&mut self, rebuilt: Rebuilt) -> Result<(), SnapshotError> {
        self.armed.go_on(Some(&rebuilt.snapshot))?;
        self.earlier.losses.splice(0..0, rebuilt.losses);
        self.earlier.files = rebuilt.files;
        if let Some(states) = &mut self.states {
            states.counted(rebuilt.consumed);
        }
        Ok(())
    }

    /// Runs the loop on the ports until `ended` returns true. `beside` is called after every tick.
    pub(crate) fn run_live(
        &mut self,
        supervisor: &Supervisor,
        ended: &dyn Fn() -> bool,
        watch: &mut Watch,
        beside: &mut dyn FnMut(&Supervisor, &mut Watch),
    ) {
        let notices = self.notices.clone();
        let _phase = Phase::start("dive");
        supervisor.run(&mut self.armed, ended, &mut |dive| {
            while let Some(notice) = notices.next() {
                watch.notice(&notice, dive);
            }
            tell_recordings(&mut self.recordings, watch, dive, self.operator.as_mut());
            if let Some(operator) = &mut self.operator {
                operator.input.take_in_live(dive, headrace_ports::now());
            }
            watch.tick(dive);
            beside(supervisor, watch);
            if let Some(states) = &mut self.states {
                states.after_tick(dive, headrace_ports::now() - self.recordings.unsafe_for());
            }
        });
    }

    /// Ends a dive on ports, and returns the report.
    pub(crate) fn end_live(mut self, supervisor: Supervisor, watch: &mut Watch) -> Report {
        watch.ending();
        let notices = self.notices.clone();
        let histories = supervisor.stop(&mut self.armed, &mut |_| ());
        while let Some(notice) = notices.next() {
            watch.notice(&notice, &self.armed);
        }
        let mut report = self.end(watch, &mut |_| ());
        for (source, history) in report.sources.iter_mut().zip(histories) {
            source.line = Some(LineReport {
                opened: history.opened,
                lost: history.lost,
                dropped_packets: history.dropped,
                ignored: history.strangers,
                status: history.last,
            });
        }
        report
    }

    /// Handles by which port threads record device traffic that doesn't pass through the loop.
    pub(crate) fn line_ports(&self) -> Vec<LinePort> {
        self.recordings.line_ports()
    }

    /// Handles by which other threads add recordings of voice notes to each log.
    pub(crate) fn voice_ports(&self) -> Vec<VoicePort> {
        self.recordings.voice_ports()
    }

    /// Ends the dive, and returns the report.
    fn end(mut self, watch: &mut Watch, beside: &mut dyn FnMut(&Loop)) -> Report {
        let _phase = Phase::start("report");
        self.armed.finish(&mut |notice, dive| watch.notice(notice, dive));
        watch.end(&self.armed);
        beside(&self.armed);
        // This tick sends the verdicts of the dive's last sections to the recording.
        let now = self.armed.now();
        self.armed.tick(now);
        // The samples are no longer needed. They are freed before the report is made, because the report of a long dive
        // takes as much memory as the samples.
        self.armed.release_samples();
        let mut report = Report::of(&self.armed);
        let (recordings, clock) = (core::mem::take(&mut self.recordings), self.armed.view().clock());
        drop(self.armed);
        report.log = recordings.end(&report, clock);
        if let Some(log) = &mut report.log {
            self.earlier.complete(log);
        }
        if let Some(states) = self.states {
            states.end();
        }
        report
    }
}

impl Operator {
    /// Tells the loop that the program did not run for some time.
    fn restarted(&mut self, after: DurNs) {
        if let Err(error) = self.port.send(&Command::stalled_for(after)) {
            tracing::error!(%error, "writing the interruption to the log failed");
        }
    }

    /// Tells the loop whether a recording is failing. The other recordings, and later parts of the failing one, then
    /// state it.
    fn recording(&mut self, fails: bool) {
        if core::mem::replace(&mut self.fails, fails) == fails {
            return;
        }
        if let Err(error) = self.port.send(&Command::Recording { fails }) {
            tracing::error!(%error, fails, "writing a recording's state to the log failed");
        }
    }
}

/// Reports events of the recordings on the screens and to the loop.
fn tell_recordings(
    recordings: &mut Recordings,
    watch: &mut Watch,
    dive: &Loop,
    operator: Option<&mut Operator>,
) {
    for event in recordings.news() {
        watch.recording(&event, dive.now());
    }
    watch.recorded(&recordings.state());
    if let Some(operator) = operator {
        operator.recording(recordings.is_alarm());
    }
}
