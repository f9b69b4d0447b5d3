//! Cost that the page and its viewers cause in the loop, measured in one dive of four heads in real time. Prints
//! Markdown.
//!
//! It compares four cases: without a page, with a page and no viewer, with ten viewers (one never reads and one
//! floods), and without a page beside two busy threads. The last case is the reference for the third one, because a
//! flooding viewer and its server keep two cores busy. `cargo bench -p headrace_tests --bench page` takes about four
//! minutes; `-- 20` makes each dive last twenty seconds. Ticks come every 20 ms by the clock. The viewers are threads
//! of this process on the same cores. Absolute times drift on shared machines, mostly the longest ones. The bench
//! panics if the results of the four dives differ.

#![expect(clippy::disallowed_methods, reason = "a benchmark reads the clock")]
#![expect(clippy::unwrap_used, reason = "a failed step ends the benchmark")]
#![expect(clippy::panic, reason = "the same")]

use std::net::Ipv4Addr;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use headrace_dashboard::collector::Collector;
use headrace_dashboard::{HeadSite, Mode, Page, SensorSite, Settings, Site, Voices};
use headrace_geometry::time::{DurNs, MonoNs};
use headrace_monitor::App;
use headrace_monitor::live_messages::{LiveMessage, LiveMessages};
use headrace_monitor::messages::Notice;
use headrace_monitor::notice_outlet::{NoticeOutlet, NoticeReceiver};
use headrace_monitor::run::Loop;
use headrace_sensor::device::{Direction, Sense};
use headrace_simulator::{START, Scene, Simulation};
use headrace_tests::page_client::{Viewer, ask};
use headrace_tests::scenes;
use serde_json::json;
use tungstenite::Message;

const SPEED_MPS: f64 = 0.197;
const TICK: DurNs = DurNs(20_000_000);
/// Number of ticks per second.
const TICKS_PER_S: u64 = 50;
/// Default duration of each dive, s.
const MEASURED_S: u64 = 60;
/// Number of viewers that read everything.
const READING: usize = 8;
/// Size of the notice queue, as in the program.
const NOTICES: usize = 1 << 10;
/// Delay before a refused flooding viewer connects again.
const AGAIN_AFTER: Duration = Duration::from_millis(10);

fn main() {
    let seconds = std::env::args().find_map(|word| word.parse().ok()).unwrap_or(MEASURED_S);
    let (arch, os) = (std::env::consts::ARCH, std::env::consts::OS);
    let cores = thread::available_parallelism().map_or(0, std::num::NonZero::get);
    let build = if cfg!(debug_assertions) { "with" } else { "without" };
    println!("{}, {cores} cores, {arch} {os}, {build} debug assertions, {seconds} s a dive\n", cpu());
    let scene = scene(seconds);
    let messages = messages_of(&scene, seconds);
    let measured = Beside::ALL.map(|beside| (beside.words(), dive(&scene, &messages, seconds, beside)));
    println!("| dive | what | p50, us | p99, us | p99.9, us | max, us |\n|---|---|---|---|---|---|");
    for (name, dive) in &measured {
        row(name, "tick", &dive.ticks);
        row(name, "collector", &dive.collecting);
        row(name, "end after its time", &dive.ends);
    }
    println!("\n| dive | samples | digest | dropped notices | the page |\n|---|---|---|---|---|");
    for (name, Measured { samples, digest, notices_dropped, page, .. }) in &measured {
        println!("| {name} | {samples} | {digest:016x} | {notices_dropped} | {page} |");
    }
    let [(_, first), others @ ..] = &measured;
    for (name, other) in others {
        assert_eq!(first.digest, other.digest, "{name}: the dive's results differ from those without a page");
    }
}

/// Load that runs beside a dive.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Beside {
    Nothing,
    BusyThreads,
    Page,
    Viewers,
}

impl Beside {
    const ALL: [Self; 4] = [Self::Nothing, Self::BusyThreads, Self::Page, Self::Viewers];

    fn words(self) -> &'static str {
        match self {
            Self::Nothing => "no page",
            Self::BusyThreads => "no page, two busy threads",
            Self::Page => "page, no viewers",
            Self::Viewers => "page, ten viewers",
        }
    }
}

/// Keeps two cores busy until `is_over` is set.
fn be_busy(is_over: &Arc<AtomicBool>) {
    for _ in 0..2 {
        let is_over = Arc::clone(is_over);
        thread::spawn(move || {
            while !is_over.load(Ordering::Relaxed) {
                std::hint::spin_loop();
            }
        });
    }
}

fn cpu() -> String {
    let info = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let model =
        info.lines().find_map(|line| line.strip_prefix("model name")).unwrap_or(": unknown processor");
    model.trim_start_matches(['\t', ' ', ':']).to_owned()
}

fn row(dive: &str, what: &str, times: &[Duration]) {
    let mut times = times.to_vec();
    times.sort_unstable();
    let at = |share: usize| {
        let time = times.get(times.len().saturating_sub(1) * share / 1000);
        time.map_or("-".to_owned(), |time| format!("{:.0}", time.as_secs_f64() * 1e6))
    };
    println!("| {dive} | {what} | {} | {} | {} | {} |", at(500), at(990), at(999), at(1000));
}

fn scene(seconds: u64) -> Scene {
    // The vehicle's path is slightly longer than the dive needs.
    let distance_m = (seconds + 10) as f64 * SPEED_MPS;
    scenes::scene(&format!(
        "vehicle = \"vita2-4.toml\"\n[vehicle_changes]\nheads.planned_speed_mps = {SPEED_MPS}\n[trajectory]\n\
         [[trajectory.legs]]\ndistance_m = {distance_m}\nspeed_mps = {SPEED_MPS}\n"
    ))
}

/// A message of a simulated device, to be fed to the loop.
struct Kept {
    at: MonoNs,
    source: u16,
    bytes: Vec<u8>,
}

/// Messages that the simulated devices send in the first seconds of a scene.
fn messages_of(scene: &Scene, seconds: u64) -> Vec<Kept> {
    let mut simulation = Simulation::new(scene).unwrap();
    let until = tick_end(seconds * TICKS_PER_S);
    let mut messages: Vec<Kept> = Vec::new();
    while let Some(message) = simulation.next_message() {
        if message.at >= until {
            return messages;
        }
        if message.direction == Direction::Received {
            messages.push(Kept { at: message.at, source: message.source, bytes: message.bytes.to_vec() });
        }
    }
    panic!("the scene lasts less than {seconds} s");
}

/// Time of the dive at the end of a tick. The first tick has number 1.
fn tick_end(number: u64) -> MonoNs {
    START + DurNs(TICK.0 * i64::try_from(number).unwrap())
}

/// Measurements of a dive.
struct Measured {
    /// Durations of the ticks, including the time to fill the rings.
    ticks: Vec<Duration>,
    /// Durations of the work that the page's collector does after each tick.
    collecting: Vec<Duration>,
    /// For each tick, the time from its due time until both the tick and the collector's work after the tick are done.
    ends: Vec<Duration>,
    samples: u64,
    digest: u64,
    notices_dropped: u64,
    /// Counters of the page's server (`/metrics`), as text.
    page: String,
}

fn dive(scene: &Scene, messages: &[Kept], seconds: u64, beside: Beside) -> Measured {
    let has_page = matches!(beside, Beside::Page | Beside::Viewers);
    let (mut armed, notices) = armed(scene, has_page);
    let page = has_page.then(|| serve(scene));
    let mut follower = page.as_ref().map(|page| Follower {
        collector: page.collector(&armed, false),
        teller: LiveMessages::default(),
        messages: Vec::new(),
    });
    let is_over = Arc::new(AtomicBool::new(false));
    let viewers = page.as_ref().filter(|_| beside == Beside::Viewers);
    let viewers = viewers.map(|page| Viewers::connect(page, &is_over));
    if beside == Beside::BusyThreads {
        be_busy(&is_over);
    }
    let mut measured = run(&mut armed, messages, seconds, |dive| follow(follower.as_mut(), &notices, dive));
    let counts = page.as_ref().map(counts);
    armed.finish(&mut |notice, dive| {
        if let Some(follower) = &mut follower {
            follower.notice(notice, dive);
        }
    });
    if let Some(follower) = &mut follower {
        follower.end(&armed);
    }
    is_over.store(true, Ordering::Relaxed);
    if let Some(page) = page {
        // The last message to viewers follows the feed's schema, but its summary is empty.
        let digest = format!("{:016x}", armed.view().digest());
        page.end(Some(json!({"type": "end", "digest": digest, "exit": 0, "summary": {}, "way": null})));
    }
    let viewers = viewers.map(Viewers::end);
    measured.samples = armed.view().tally().samples;
    measured.digest = armed.view().digest();
    measured.notices_dropped = notices.dropped();
    measured.page = counts.into_iter().chain(viewers).collect::<Vec<_>>().join("; ");
    measured
}

/// A loop for the scene's vehicle, configured as in the program.
fn armed(scene: &Scene, is_followed: bool) -> (Loop, NoticeReceiver) {
    let vehicle = &scene.vehicle;
    let mut app = App::new(vehicle.mission());
    for sensor in &vehicle.sensors {
        app.add_device(sensor.as_ref()).unwrap();
    }
    if is_followed {
        app.keep_results();
    }
    let (outlet, notices) = NoticeOutlet::new(NOTICES);
    app.add_plugin(&outlet).unwrap();
    (app.arm(vehicle.navigation()).unwrap(), notices)
}

/// Feeds all messages at their times, tick by tick, and calls `beside` after each tick.
fn run(dive: &mut Loop, messages: &[Kept], seconds: u64, mut beside: impl FnMut(&Loop)) -> Measured {
    let mut ports: Vec<_> = (0..dive.sources().len()).map(|source| dive.take_port(source).unwrap()).collect();
    let (mut ticks, mut collecting, mut ends) = (Vec::new(), Vec::new(), Vec::new());
    let mut rest = messages;
    let begun = Instant::now();
    for number in 1..=seconds * TICKS_PER_S {
        let until = tick_end(number);
        let (now, later) = rest.split_at(rest.partition_point(|message| message.at < until));
        rest = later;
        let due = begun + Duration::from_nanos(until.since(START).0.unsigned_abs());
        thread::sleep(due.saturating_duration_since(Instant::now()));
        let started = Instant::now();
        for message in now {
            ports[usize::from(message.source)].send(message.at, &message.bytes).unwrap();
        }
        dive.tick(until);
        let ticked = Instant::now();
        beside(dive);
        let ended = Instant::now();
        ticks.push(ticked - started);
        collecting.push(ended - ticked);
        ends.push(ended - due);
    }
    assert!(rest.is_empty(), "{} messages were not fed", rest.len());
    Measured { ticks, collecting, ends, samples: 0, digest: 0, notices_dropped: 0, page: String::new() }
}

/// The part of the program that follows the loop and passes its results to the page.
struct Follower {
    collector: Collector,
    teller: LiveMessages,
    messages: Vec<LiveMessage>,
}

impl Follower {
    fn notice(&mut self, notice: &Notice, dive: &Loop) {
        self.teller.hear(notice, dive, &mut |one| self.messages.push(one));
        self.pass_on(dive);
        self.collector.notice(notice);
    }

    fn tick(&mut self, dive: &Loop) {
        self.teller.tick(dive.view().live_state(), dive, &mut |one| self.messages.push(one));
        self.pass_on(dive);
        self.collector.tick(dive);
    }

    fn end(&mut self, dive: &Loop) {
        self.teller.end(&dive.view().coverage().sections, &mut |one| self.messages.push(one));
        self.pass_on(dive);
        self.collector.end(dive);
    }

    fn pass_on(&mut self, dive: &Loop) {
        self.collector.messages(&self.messages, dive);
        self.messages.clear();
    }
}

/// Work that the program does after each tick. Without a page, it only empties the queue of notices.
fn follow(mut follower: Option<&mut Follower>, notices: &NoticeReceiver, dive: &Loop) {
    while let Some(notice) = notices.next() {
        if let Some(follower) = &mut follower {
            follower.notice(&notice, dive);
        }
    }
    if let Some(follower) = follower {
        follower.tick(dive);
    }
}

fn serve(scene: &Scene) -> Page {
    let settings = Settings {
        address: (Ipv4Addr::LOCALHOST, 0).into(),
        tokens: None,
        hosts: Vec::new(),
        origins: Vec::new(),
        proxies: Vec::new(),
        tls: None,
    };
    let act = Arc::new(|_| Err("a bench takes no commands".to_owned()));
    let direct = Arc::new(|_| Err("a bench isn't directed".to_owned()));
    Page::start(settings, site(scene), "bench".to_owned(), act, direct, Voices::None).unwrap()
}

fn site(scene: &Scene) -> Site {
    let vehicle = &scene.vehicle;
    let (mut heads, mut sensors) = (Vec::new(), Vec::new());
    for ((source, sensor), config) in (0..).zip(&vehicle.sensors).zip(&vehicle.sensor_configs) {
        let is_head = sensor.sense() == Sense::Head;
        if is_head {
            heads.push(HeadSite { id: config.id.clone(), source, hidden_deg: Vec::new() });
        }
        let kind = if is_head { "head" } else { "other" };
        sensors.push(SensorSite { id: config.id.clone(), plugin: config.plugin.clone(), kind });
    }
    Site {
        mode: Mode::Live,
        dive: "bench".to_owned(),
        vehicle: vehicle.name.clone(),
        target: vehicle.target,
        section_m: vehicle.section_m,
        length_m: vehicle.tunnel.length_m,
        profile: vehicle.tunnel.profile.clone(),
        heads,
        sensors,
        utc_of_zero_s: None,
        span_s: None,
        takes_commands: true,
        is_playback: false,
        recorded_to: None,
        compared_m: None,
    }
}

/// Counters of the page's server (`/metrics`) after the last tick.
fn counts(page: &Page) -> String {
    let (status, text) = ask(&page.address().to_string(), "GET", "/metrics", &[], "");
    assert_eq!(status, 200, "{text}");
    let of = |name: &str| {
        let name = format!("headrace_page_{name} ");
        text.lines()
            .find_map(|line| line.strip_prefix(&name))
            .unwrap_or_else(|| panic!("no {name}"))
            .to_owned()
    };
    format!(
        "dropped {} samples, {} lines; {} viewers at the end of {} in all, {} stalled, {} lagged; {} messages refused; {} bytes",
        of("dropped_samples_total"),
        of("dropped_lines_total"),
        of("viewers"),
        of("viewers_total"),
        of("stalled_total"),
        of("lagged_total"),
        of("refused_total"),
        of("sent_bytes_total")
    )
}

/// The ten viewers of a dive. One of them never reads, and one floods the page.
struct Viewers {
    /// Number of samples that each viewer received, and whether it received the end.
    reading: Vec<JoinHandle<(u64, bool)>>,
    _never_reads: Viewer,
    /// Number of messages that the flooding viewer sent.
    flooding: JoinHandle<u64>,
}

impl Viewers {
    fn connect(page: &Page, is_over: &Arc<AtomicBool>) -> Self {
        let address = page.address().to_string();
        let connect = || Viewer::connect_to(&address, "", &[]).unwrap();
        let reading = (0..READING).map(|_| connect()).map(|mut viewer| {
            thread::spawn(move || {
                viewer.until_closed();
                (viewer.samples, viewer.others.iter().any(|other| other["type"] == "end"))
            })
        });
        let reading = reading.collect();
        let never_reads = connect();
        while page.viewers() < READING + 1 {
            thread::sleep(AGAIN_AFTER);
        }
        let flooding = thread::spawn({
            let (address, is_over) = (address.clone(), Arc::clone(is_over));
            move || flood(&address, &is_over)
        });
        Self { reading, _never_reads: never_reads, flooding }
    }

    /// Waits for the viewers' threads to end. The page's server must have ended already.
    fn end(self) -> String {
        let seen: Vec<_> = self.reading.into_iter().map(|viewer| viewer.join().unwrap()).collect();
        let ended = seen.iter().filter(|(_, has_ended)| *has_ended).count();
        let fewest = seen.iter().map(|(samples, _)| *samples).min().unwrap_or(0);
        let sent = self.flooding.join().unwrap();
        format!(
            "{ended} of {READING} readers got the end, the least {fewest} samples; {sent} messages of the flood"
        )
    }
}

/// Floods the page: sends messages as fast as possible and reconnects after each disconnection. Returns the number of
/// messages sent.
fn flood(address: &str, is_over: &AtomicBool) -> u64 {
    let mut sent = 0;
    let message = Message::Text(json!({"do": "mark", "by": "flood"}).to_string().into());
    while !is_over.load(Ordering::Relaxed) {
        let Ok(mut viewer) = Viewer::connect_to(address, "", &[]) else {
            thread::sleep(AGAIN_AFTER);
            continue;
        };
        while !is_over.load(Ordering::Relaxed) && viewer.send_raw(message.clone()).is_ok() {
            sent += 1;
        }
    }
    sent
}
