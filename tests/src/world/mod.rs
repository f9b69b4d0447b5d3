//! A simulated world for fault tests. Real drivers, line services, loop and recorder run on simulated devices,
//! cables, disk and clock.
//!
//! One seed determines every failure. There are no threads, no ports and no real time, so a seed that fails once
//! fails every time.

pub mod cable;
pub mod device;
pub mod disk;
mod dive_result;
pub mod fewest;
pub mod invariants;
pub mod plan;
mod sabotage;

use std::collections::VecDeque;
use std::fmt::Write as _;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

use headrace::InRecordings;
use headrace_config::Document;
use headrace_coverage::{Cause, Causes};
use headrace_devices::KINDS;
use headrace_geometry::time::{DurNs, MonoNs};
use headrace_monitor::App;
use headrace_monitor::alert_list::{Figures, ListedAlert};
use headrace_monitor::live_state::PositionState;
use headrace_monitor::notice_outlet::{NoticeOutlet, NoticeReceiver};
use headrace_monitor::run::Loop;
use headrace_ports::{Attached, Common, LateData, LineHistory, LineRecord, LineService, StatusQueue, Waker};
use headrace_replay::drive::{Pace, drive};
use headrace_replay::log::{
    Every, Interrupted, LogHeader, Recorder, RecorderWorker, RecordingEvent, Rotation, SourceInfo,
    Unfinished, files_of, in_the_way,
};
use headrace_replay::player::Player;
use headrace_replay::record::{RecorderOutlet, result_channels};
use headrace_sensor::connect::Connect;
use headrace_sensor::device::EmulatorSetup;
use headrace_sensor::driver::DriverSetup;
use headrace_vehicle::VehicleConfig;

use crate::folder::Folder;
use crate::random::Random;
use cable::{Cable, Clock, Machine};
use device::Device;
pub use device::{TRUE_SPEED_MPS, true_chainage_m};
use disk::{LeftFile, SimulatedDisk};
pub use dive_result::{Consumed, DiveResult, Line, Position, Replayed};
use plan::{BEGIN, Ending, Fault, LogChange, MachineFault, Plan};
pub use sabotage::Sabotage;

/// Longest time step of the simulated world, ns.
const LONGEST_STEP_NS: usize = 12_000_000;
/// Longest time that the world waits at the end of a dive for data that is on its way to the loop.
const PATIENCE: DurNs = DurNs::from_millis(4_000);
/// Capacity of the queue of notices to the terminal. It is small so that the queue is soon full.
const NOTICES: usize = 4;
/// Age above which recorded packets are always synced. The age is half a second plus one step of the world.
const SYNC_PERIOD: DurNs = DurNs::from_millis(500 + 13);

const TUNNEL: &str = r#"name = "a world of faults"
target_m = 1.2

[tunnel]
profile = "circle"
radius_m = 3
length_m = 40

[water]
surface_above_floor_m = 8

[heads]
planned_speed_mps = 0.2
"#;

/// Tables of the sensors in the vehicle file, without their ids.
const SENSORS: [&str; 6] = [
    "plugin = \"imagenex881\"\nconnect = \"tcp:10.0.0.1:4040\"\nmode = \"fastest\"\nrange_m = 5\n",
    "plugin = \"imagenex881\"\nconnect = \"serial:/dev/ttyS1\"\nmode = \"fastest\"\nrange_m = 5\n",
    "plugin = \"ping1d\"\nconnect = \"serial:/dev/ttyS2\"\nangles_deg = [0, 0, 90]\n",
    "plugin = \"bar100\"\nconnect = \"udp:10.0.0.2:9000\"\n",
    "plugin = \"imu_can\"\nconnect = \"udp:10.0.0.2:9001\"\npreset = \"xsens_mti600\"\n",
    "plugin = \"tether_hid\"\nconnect = \"udp:10.0.0.2:9002\"\ncounts_per_metre = 2000\n",
];

/// Number of sensors, each on a line of its own.
pub const SENSOR_COUNT: usize = SENSORS.len();

/// Size of the recorder's queue, bytes. It is so small that a stall of some seconds fills the queue.
const QUEUE_BYTES: usize = 128 * 1024;

/// The vehicle file of all simulated worlds.
pub fn vehicle_text() -> String {
    let mut text = TUNNEL.to_owned();
    for (number, sensor) in SENSORS.iter().enumerate() {
        write!(text, "\n[[sensors]]\nid = \"s{number}\"\n{sensor}").unwrap();
    }
    text
}

/// Returns the seeds of `HEADRACE_WORLD_SEEDS`, such as `1000..2000`, or the seeds `default` if the variable isn't set.
pub fn seeds(default: Range<u64>) -> Range<u64> {
    let Ok(text) = std::env::var("HEADRACE_WORLD_SEEDS") else { return default };
    let (from, to) = text.split_once("..").unwrap();
    from.parse().unwrap()..to.parse().unwrap()
}

/// A dive in a simulated world.
pub struct World {
    sabotage: Option<Sabotage>,
    random: Random,
    clock: Arc<Clock>,
    plan: Plan,
    devices: Vec<Device>,
    services: Vec<LineService>,
    board: StatusQueue,
    dive: Loop,
    consumed: Vec<Consumed>,
    positions: Vec<Position>,
    disk: SimulatedDisk,
    recorder: RecorderWorker,
    /// Moments at which the recorder had emptied its queue, each with the number of packets that it had then recorded.
    /// A disk failure clears the list.
    taken: VecDeque<(MonoNs, usize)>,
    /// Syncs in progress: the completion time of each, and the number of packets that are then certainly in the log.
    syncing: VecDeque<(MonoNs, usize)>,
    is_failing: bool,
    is_behind: bool,
    /// Number of packets that the recorder skipped because its backlog was too large.
    skipped: usize,
    /// Time since which packets have waited to be taken by the loop. `longest_wait` is the longest such wait while the
    /// loop was running.
    waiting_since: Option<MonoNs>,
    longest_wait: DurNs,
    notices: NoticeReceiver,
    /// Number of packets that must be in the log, whichever way the dive ends.
    certain: usize,
}

impl World {
    /// Creates the world of a seed. Its dive hasn't begun yet.
    pub fn new(seed: u64) -> Self {
        Self::with(seed, None, None)
    }

    /// As [`World::new`], but with a sabotage that breaks an invariant, and with only those of the seed's faults that
    /// are in `faults`.
    pub fn with(seed: u64, sabotage: Option<Sabotage>, faults: Option<&[Fault]>) -> Self {
        let mut random = Random(seed);
        let text = vehicle_text();
        let vehicle = vehicle(&text);
        let clock = Arc::new(Clock::default());
        clock.set(BEGIN);
        let connect = |source: usize| Connect::parse(&vehicle.sensor_configs[source].connect).unwrap();
        let cables: Vec<Arc<Cable>> =
            (0..SENSORS.len()).map(|source| Arc::new(Cable::new(connect(source)))).collect();
        let streams: Vec<bool> =
            cables.iter().map(|cable| !matches!(cable.connect, Connect::Udp { .. })).collect();
        let plan = Plan::draw(&mut random, &streams);
        let plan = faults.map_or(plan.clone(), |faults| plan.with_only(faults));
        let disk = SimulatedDisk::new(Arc::clone(&clock), &plan.disk, sabotage);
        let (mut dive, recorder, notices) = assemble(&vehicle, &text, &disk, plan.every);
        let board = StatusQueue::new(1 << 16);
        let common = Common {
            host: Arc::new(Machine { clock: Arc::clone(&clock), cables: cables.clone() }),
            stopping: Arc::new(AtomicBool::new(false)),
            board: board.clone(),
            waker: Waker::of_this_thread(),
            late_data: LateData::default(),
            record: (sabotage != Some(Sabotage::DropsUntold))
                .then(|| Arc::new(InRecordings(vec![recorder.line_port()])) as Arc<dyn LineRecord>),
        };
        let mut programs = vehicle.programs().unwrap().into_iter();
        let (mut devices, mut services) = (Vec::new(), Vec::new());
        for (source, (sensor, cable)) in vehicle.sensors.iter().zip(cables).enumerate() {
            let head = sensor.head().and_then(|_| programs.next());
            let setup = EmulatorSetup { start: BEGIN, head, site: vehicle.site, polled: false };
            let driver = sensor.driver(&DriverSetup { begun: BEGIN, head });
            let attached = Attached { source, port: dive.take_port(source).unwrap(), driver };
            services.push(LineService::new(
                Ok(cable.connect.clone()),
                Vec::new(),
                vec![attached],
                common.clone(),
            ));
            let faults = plan.cables[source].clone();
            let loses = sabotage == Some(Sabotage::CableLoses) && faults.is_empty();
            devices.push(Device::new(sensor.emulator(&setup), cable, faults, loses, Random(random.bits())));
        }
        let (consumed, taken, syncing, certain) = (Vec::new(), VecDeque::new(), VecDeque::new(), 0);
        let positions = Vec::new();
        let (is_failing, is_behind) = (false, false);
        Self {
            sabotage,
            random,
            clock,
            plan,
            devices,
            services,
            board,
            dive,
            consumed,
            positions,
            disk,
            recorder,
            taken,
            syncing,
            is_failing,
            is_behind,
            skipped: 0,
            waiting_since: None,
            longest_wait: DurNs(0),
            notices,
            certain,
        }
    }

    /// The same world with another terminal. The terminal accepts nothing if `is_blocked` is set, and everything
    /// otherwise.
    #[must_use]
    pub fn with_terminal(mut self, is_blocked: bool) -> Self {
        self.plan = self.plan.with_terminal(is_blocked);
        self
    }

    /// Runs the dive to its planned end and returns the result.
    pub fn live(mut self) -> DiveResult {
        while self.clock.now() < self.plan.end {
            self.step(false);
        }
        if self.plan.ending == Ending::Finished {
            let patience = self.clock.now() + PATIENCE;
            while self.clock.now() < patience {
                self.step(true);
            }
        }
        let (certain, longest_wait) = (self.certain, self.longest_wait);
        let has_left_out = self.skipped > 0 || self.is_behind;
        let since_begin = self.since_begin();
        let Self { services, mut dive, devices, plan, mut consumed, positions, .. } = self;
        let Self { disk, recorder, mut random, .. } = self;
        let histories: Vec<LineHistory> =
            services.into_iter().flat_map(LineService::end).map(|(_, history)| history).collect();
        let mut recorder = Some(recorder);
        let mut summary = None;
        if plan.ending == Ending::Finished {
            let now = self.clock.now();
            while dive.has_waiting() {
                dive.tick(now);
                note(&dive, &mut consumed);
                recorder.as_mut().unwrap().step(since_begin);
            }
            dive.finish(&mut |_, _| ());
            dive.tick(now);
            summary = recorder.take().map(|recorder| recorder.finish(since_begin));
        }
        drop(recorder);
        let good: Vec<u64> = dive.decoder_counts().iter().map(|counts| counts.good_frames).collect();
        let lines = devices.iter().zip(good).zip(histories).map(|((device, good), history)| Line {
            untouched: device.is_untouched(),
            lossless: device.is_lossless(),
            whole: device.whole(),
            good,
            history,
        });
        DiveResult {
            lines: lines.collect(),
            digest: dive.view().digest(),
            summary,
            disk_failures: disk.failures(),
            left: disk.left(plan.ending, &mut random),
            certain,
            has_left_out,
            longest_wait,
            plan,
            consumed,
            positions,
            alerts: dive.view().alert_list().iter().flat_map(words).collect(),
        }
    }

    fn since_begin(&self) -> Duration {
        Duration::from_nanos(u64::try_from(self.clock.now().since(BEGIN).0).unwrap())
    }

    /// Lets the recorder write until its queue is empty or the disk has an operation to complete.
    ///
    /// Without a disk failure, packets are synced by a sync that begins half a second and one step after the recorder
    /// took them, or earlier. When this sync is complete, they count as certainly recorded.
    fn record(&mut self, now: MonoNs) {
        let since_begin = self.since_begin();
        let (failures, syncs) = (self.disk.failures(), self.disk.syncs());
        let mut is_empty = false;
        while !is_empty && self.disk.busy_until() <= now {
            is_empty = !self.recorder.step(since_begin);
        }
        while let Some(event) = self.recorder.next_event() {
            match event {
                RecordingEvent::Failed { .. } => self.is_failing = true,
                RecordingEvent::Resumed(_) => self.is_failing = false,
                RecordingEvent::Behind => self.is_behind = true,
                RecordingEvent::CaughtUp { packets } => {
                    self.is_behind = false;
                    self.skipped += usize::try_from(packets).unwrap();
                }
                _ => {}
            }
        }
        if self.is_failing || self.is_behind || self.disk.failures() != failures {
            self.taken.clear();
            return;
        }
        // Packets taken so far can only be certain if the recorder has emptied its queue or synced in this step.
        if is_empty || self.disk.syncs() > syncs {
            self.taken.push_back((now, self.consumed.len() - self.skipped));
            while let Some((at, count)) = self.taken.front().copied()
                && now.since(at) > SYNC_PERIOD
            {
                self.syncing.push_back((self.disk.busy_until().max(now), count));
                self.taken.pop_front();
            }
        }
        self.take_syncs(now);
    }

    /// Removes complete syncs from the list, and counts their packets as certainly recorded.
    fn take_syncs(&mut self, now: MonoNs) {
        while let Some((_, count)) = self.syncing.pop_front_if(|(complete, _)| *complete <= now) {
            self.certain = count;
        }
    }

    fn step(&mut self, quiet: bool) {
        let now = self.clock.now() + DurNs(1 + self.random.below(LONGEST_STEP_NS) as i64);
        self.clock.set(now);
        for device in &mut self.devices {
            device.step(now, quiet);
        }
        if self.sabotage == Some(Sabotage::NeighbourBreaks)
            && let Some(other) = self.devices.iter().position(Device::is_broken)
        {
            self.devices[(other + 1) % SENSORS.len()].cable().break_off(0);
        }
        if !self.plan.has(MachineFault::PortsStall, now) {
            for (service, device) in self.services.iter_mut().zip(&self.devices) {
                serve(service, device.cable(), now);
            }
        }
        if self.plan.has(MachineFault::LoopStalls, now) {
            self.waiting_since = None;
        } else {
            let taken = self.dive.tick(now);
            note(&self.dive, &mut self.consumed);
            self.positions.extend(position(&self.dive));
            if taken > 0 || !self.dive.has_waiting() {
                self.waiting_since = None;
            } else {
                let since = *self.waiting_since.get_or_insert(now);
                self.longest_wait = self.longest_wait.max(now.since(since));
            }
        }
        self.take_syncs(now);
        // The recorder's thread waits for the disk.
        if !self.plan.has(MachineFault::RecorderStalls, now) && self.disk.busy_until() <= now {
            self.record(now);
        }
        if !self.plan.has(MachineFault::TerminalStands, now) {
            while self.notices.next().is_some() {}
        }
        while self.board.next().is_some() {}
    }
}

impl DiveResult {
    /// Writes the files that are left on the disk to `folder` and replays them. Also continues a recording that has no
    /// orderly end and replays it, and replays the files after the planned change.
    ///
    /// Errors: the files can't be read as a log, or the recording can't be continued.
    pub fn replay(&self, folder: &Folder, sabotage: Option<Sabotage>) -> Result<Replayed, String> {
        let name = |path: &Path| folder.path(path.file_name().unwrap().to_str().unwrap());
        let files: Vec<PathBuf> = self.left.iter().map(|file| name(&file.path)).collect();
        for (path, file) in files.iter().zip(&self.left) {
            std::fs::write(path, &file.bytes).unwrap();
        }
        let mut played = replayed(&files);
        let recording = folder.path("dive.mcap");
        if let Ok(so_far) = &played
            && let Err(why) = resumed(&recording, so_far)
        {
            played = Err(format!("it can't be continued: {why}"));
        }
        for path in in_the_way(&recording).unwrap() {
            std::fs::remove_file(path).unwrap();
        }
        if let Ok(so_far) = &mut played {
            so_far.changed = self.plan.log.map(|change| self.replay_changed(change, folder, sabotage));
        }
        played
    }

    /// Replays the recording after a change of its files.
    fn replay_changed(
        &self,
        change: LogChange,
        folder: &Folder,
        sabotage: Option<Sabotage>,
    ) -> Result<Box<Replayed>, String> {
        let mut left = self.left.clone();
        // After a power cut, the last file may be empty. Nothing can be changed in it.
        let filled: Vec<usize> = (0..left.len()).filter(|number| !left[*number].bytes.is_empty()).collect();
        let number = filled.get(self.certain % filled.len().max(1)).copied().unwrap_or_default();
        let own = &mut left[number].bytes;
        // In half of the worlds, a part that is to be doubled or joined is cut before.
        if change == LogChange::Cut || change != LogChange::Reordered && self.certain.is_multiple_of(2) {
            own.truncate(self.certain * 257 % own.len().max(1));
        }
        let appended = match change {
            LogChange::Doubled => own.clone(),
            LogChange::Joined if number + 1 < left.len() => left.remove(number + 1).bytes,
            LogChange::Joined | LogChange::Cut => Vec::new(),
            LogChange::Reordered => {
                left.reverse();
                Vec::new()
            }
        };
        let is_apart = sabotage == Some(Sabotage::PartsReadApart);
        if is_apart && !appended.is_empty() {
            let mut other = LeftFile::default();
            (other.path, other.bytes) = (PathBuf::from("other.mcap"), appended);
            left.insert(number + 1, other);
        } else {
            left[number].bytes.extend(appended);
        }
        let paths: Vec<PathBuf> =
            left.iter().map(|file| folder.path(file.path.file_name().unwrap().to_str().unwrap())).collect();
        for (path, file) in paths.iter().zip(&left) {
            std::fs::write(path, &file.bytes).unwrap();
        }
        let played = if is_apart { replayed_apart(&paths) } else { replayed(&paths) };
        for path in paths {
            std::fs::remove_file(path).unwrap();
        }
        played.map(Box::new)
    }
}

/// Replays each file on its own, in the given order. Returns the packets of all files.
fn replayed_apart(files: &[PathBuf]) -> Result<Replayed, String> {
    let mut all = Replayed::default();
    for file in files {
        let one = replayed(std::slice::from_ref(file))?;
        all.consumed.extend(one.consumed);
        all.digest = one.digest;
    }
    Ok(all)
}

/// If a recording has no orderly end, continues it for some ticks and replays the whole recording.
///
/// Errors: packets from before or after the interruption are missing, or the replay reports no loss for the
/// interruption.
fn resumed(recording: &Path, so_far: &Replayed) -> Result<(), String> {
    const TICKS: u64 = 20;
    let Some(unfinished) = Unfinished::read(recording).map_err(|error| error.to_string())? else {
        return Ok(());
    };
    let (tick, to) = (unfinished.next_tick(), unfinished.last + DurNs(1_000_000_000));
    let earlier = Interrupted { recording: unfinished, to, words: "interrupted".to_owned() };
    let text = vehicle_text();
    let header = header(&vehicle(&text), &text);
    let begun = Recorder::go_on(&earlier, &header, None, QUEUE_BYTES, None);
    let (mut port, handle) = begun.map_err(|error| error.to_string())?;
    for number in 0..TICKS {
        port.raw(0, to, to, &number.to_le_bytes()).map_err(|_| "the queue is full".to_owned())?;
        port.tick(tick + number, to, &[0]).map_err(|_| "the queue is full".to_owned())?;
    }
    handle.finish().map_err(|error| error.to_string())?;
    let files = files_of(&[recording.to_owned()]).map_err(|error| error.to_string())?;
    let both = replayed(&files)?;
    let (before, after) = both.consumed.split_at(so_far.consumed.len().min(both.consumed.len()));
    if before != so_far.consumed || after.len() as u64 != TICKS {
        let (all, wanted) = (both.consumed.len(), so_far.consumed.len());
        return Err(format!(
            "{all} packets, expected the {wanted} before and {TICKS} more; losses {:?}",
            both.losses
        ));
    }
    let is_stated = both.losses.iter().any(|loss| loss.contains("interrupted"));
    if is_stated { Ok(()) } else { Err(format!("no loss states the interruption: {:?}", both.losses)) }
}

fn replayed(files: &[PathBuf]) -> Result<Replayed, String> {
    let mut player = Player::open(files).map_err(|error| error.to_string())?;
    let text = vehicle_text();
    let vehicle = vehicle(&text);
    let mut dive = app(&vehicle).arm(vehicle.navigation()).unwrap();
    player.connect(dive.sources());
    let mut consumed = Vec::new();
    let driven = drive(&mut dive, &mut player, Pace::default(), &mut |dive| note(dive, &mut consumed));
    driven.map_err(|error| error.to_string())?;
    dive.finish(&mut |_, _| ());
    Ok(Replayed { consumed, digest: dive.view().digest(), losses: player.losses(), changed: None })
}

fn vehicle(text: &str) -> VehicleConfig {
    let document = Document::new("vehicle.toml", text);
    VehicleConfig::parse(document, &KINDS, &|_| unreachable!("no file is named")).unwrap()
}

fn app(vehicle: &VehicleConfig) -> App {
    let mut app = App::new(vehicle.mission());
    for sensor in &vehicle.sensors {
        app.add_device(sensor.as_ref()).unwrap();
    }
    app
}

fn header(vehicle: &VehicleConfig, text: &str) -> LogHeader {
    let sources = vehicle.sensor_configs.iter().map(|sensor| SourceInfo {
        id: sensor.id.clone(),
        plugin: sensor.plugin.clone(),
        connect: sensor.connect.clone(),
    });
    LogHeader {
        vehicle_toml: text.to_owned(),
        sources: sources.collect(),
        ticks: true,
        results: result_channels(),
        ..LogHeader::default()
    }
}

/// Creates the loop and the recorder of a dive.
fn assemble(
    vehicle: &VehicleConfig,
    text: &str,
    disk: &SimulatedDisk,
    every: Option<DurNs>,
) -> (Loop, RecorderWorker, NoticeReceiver) {
    let header = header(vehicle, text);
    let (storage, path) = (Box::new(disk.clone()), Path::new("dive.mcap"));
    let rotation = Rotation { every: every.map(Every::Span), ..Rotation::default() };
    let (port, worker) = Recorder::unthreaded(storage, path, &header, &rotation, QUEUE_BYTES, None).unwrap();
    let mut app = app(vehicle);
    app.add_plugin(&RecorderOutlet::new([port]).of_ports()).unwrap();
    let (outlet, notices) = NoticeOutlet::new(NOTICES);
    app.add_plugin(&outlet).unwrap();
    (app.arm(vehicle.navigation()).unwrap(), worker, notices)
}

/// Does the work of a line service's thread until the thread would wait.
fn serve(service: &mut LineService, cable: &Cable, now: MonoNs) {
    // The driver reads once in each round, and also at intervals if nothing arrives. The limit detects a driver that is
    // due again at once in every round; a real thread would never wait.
    for round in 0..10_000 {
        let due = if let Some(until) = service.closed_until() {
            until <= now
        } else {
            let is_due = service.due().is_some_and(|due| due <= now);
            round == 0 || !cable.to_host.is_empty() || !cable.is_open() || is_due
        };
        if !due {
            return;
        }
        service.step();
    }
    panic!("a line service is always due");
}

/// Position at the latest advice update; `None` without a position.
fn position(dive: &Loop) -> Option<Position> {
    let state = dive.view().live_state();
    let (chainage_m, speed_mps) = state.chainage_m.zip(state.speed_mps)?;
    let sd_m = state.sd.map_or(0.0, |sd| sd.along_m);
    Some(Position {
        at: state.at?,
        chainage_m,
        sd_m,
        speed_mps,
        is_sure: state.position == PositionState::Ok,
    })
}

/// Kind of an alert, and causes of a missed stretch.
fn words(alert: &ListedAlert) -> Vec<&'static str> {
    let causes = match &alert.figures {
        Figures::Missed(figures, ..) => figures.causes,
        _ => Causes::default(),
    };
    [alert.kind.as_str()].into_iter().chain(causes.iter().map(Cause::as_str)).collect()
}

fn note(dive: &Loop, consumed: &mut Vec<Consumed>) {
    let inbox = &dive.view().placed().inbox;
    consumed.extend(inbox.iter().map(|(source, packet)| Consumed {
        source: source.0,
        received: packet.received,
        bytes: packet.bytes.to_vec(),
    }));
}
