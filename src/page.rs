//! Starts, feeds and ends the operator's page of a dive.

#![expect(clippy::disallowed_types, reason = "locks between the page's threads; the loop's takes none")]

use std::collections::BTreeMap;
use std::io::IsTerminal as _;
use std::net::{IpAddr, SocketAddr, UdpSocket};
use std::path::{Path, PathBuf};
use std::process::{Command as Process, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use crossbeam::channel::Sender;
use headrace_config::plain::one_line;
use headrace_dashboard::collector::Collector;
use headrace_dashboard::fed::PlaybackState;
use headrace_dashboard::qr::qr;
use headrace_dashboard::server::{Act, Direct, PORT};
use headrace_dashboard::{
    Command, HeadSite, Mode, Page, Play, SensorSite, Settings, Site, TlsFiles, Token, Tokens, Voices,
};
use headrace_geometry::time::{DiveClock, DurNs, MonoNs};
use headrace_monitor::console::{Command as Input, ConsolePort, NoteText, Who};
use headrace_monitor::live_messages::LiveMessage;
use headrace_monitor::messages::Notice;
use headrace_monitor::report::Report;
use headrace_monitor::run::Loop;
use headrace_ports::Status;
use headrace_replay::drive::PacketSource as _;
use headrace_replay::log::voice::find_voice;
use headrace_replay::log::{RecordingEvent, VoicePort};
use headrace_replay::playback::PlaybackCommand;
use headrace_replay::player::Player;
use headrace_sampling::occlusion::{AngleRange, hidden_by_vehicle};
use headrace_sensor::device::Sense;
use headrace_vehicle::VehicleConfig;
use serde_json::{Value, json};

use crate::cli::PageArgs;
use crate::dive::CLOCK_ANCHOR;
use crate::files;
use crate::follower::Follower;
use crate::logging::complain;
use crate::recording_state::RecordingState;
use crate::report_output::exit_code;

/// Interval at which a paused replay checks for an interruption.
const LOOK_EVERY: Duration = Duration::from_millis(100);
/// Number of times that a playback stops if it begins with a jump to the log's end: after the jump and at the end.
const STOPS_TO_END: u8 = 2;
/// Error text for a command to playback.
const NO_PLAYBACK: &str = "no playback is running that could be controlled";
/// Name of a BlueOS machine.
const BLUEOS: &str = "blueos.local";

/// Information about the dive that the page shows.
pub(crate) struct Of<'a> {
    pub(crate) vehicle: &'a VehicleConfig,
    pub(crate) mode: Mode,
    /// Name of the log or scene.
    pub(crate) dive: String,
    pub(crate) recorded_to: Option<String>,
    /// Second target for which the page shows verdicts, too, m.
    pub(crate) compared_m: Option<f64>,
    /// UTC of the clock's zero, s, if the clock is that of this machine.
    pub(crate) utc_of_zero_s: Option<f64>,
    /// First and last time of the replayed log; `None` in a live dive.
    pub(crate) span: Option<(MonoNs, MonoNs)>,
    /// Clock of the replayed dive.
    pub(crate) clock: DiveClock,
    /// Whether the dive is a replay that can be paused and can jump to another time.
    pub(crate) is_playback: bool,
    /// Receiver of the operator's commands; `None` in a replay.
    pub(crate) console: Option<ConsolePort>,
    /// Source from which the audio of voice notes is read, or logs to which it is written.
    pub(crate) voices: VoicesOf,
}

/// Source from which the audio of voice notes is read, or logs to which it is written.
pub(crate) enum VoicesOf {
    /// Logs of a live dive, to which recordings are written; empty if the dive isn't recorded.
    Dive(Vec<VoicePort>),
    /// Files of a log, in which recordings are found.
    Log(Vec<PathBuf>),
}

/// An operator's page that is being served.
pub(crate) struct Served {
    page: Page,
    span: Option<(MonoNs, MonoNs)>,
    clock: DiveClock,
    is_playback: bool,
    waits: bool,
    directed: Arc<Directed>,
}

/// Playback that the page controls.
#[derive(Default)]
struct Directed {
    /// Sender of commands, and the dive's clock; `None` if no playback is running.
    commands: Mutex<Option<(Sender<PlaybackCommand>, DiveClock)>>,
    /// Whether playback is at the end of the log.
    is_at_end: AtomicBool,
}

impl Directed {
    fn commands(&self) -> MutexGuard<'_, Option<(Sender<PlaybackCommand>, DiveClock)>> {
        self.commands.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Whether to serve a page: true if it was requested, or if a person watches on a terminal.
pub(crate) fn is_wanted(args: &PageArgs, is_watched: bool) -> bool {
    !args.no_page && (args.page.is_some() || is_watched && std::io::stdout().is_terminal())
}

/// Serves the page of a dive. If that fails, the reason goes to stderr and the dive continues without the
/// page.
///
/// `lines` writes the page's address among the dive's lines.
pub(crate) fn serve(args: &PageArgs, of: Of<'_>, lines: Option<&mut dyn FnMut(&str)>) -> Option<Served> {
    match start(args, of, lines) {
        Ok(served) => Some(served),
        Err(why) => {
            complain(&format!("headrace: {}; the dive goes on without the page", one_line(&why)));
            None
        }
    }
}

fn start(args: &PageArgs, of: Of<'_>, lines: Option<&mut dyn FnMut(&str)>) -> Result<Served, String> {
    let address = args.page.unwrap_or(SocketAddr::new([127, 0, 0, 1].into(), PORT));
    let tokens = tokens(args, address)?;
    let tls = args.page_cert.clone().zip(args.page_key.clone());
    let settings = Settings {
        address,
        tokens: tokens.clone(),
        hosts: hosts(args),
        origins: args.page_origin.clone(),
        proxies: args.page_proxy.clone(),
        tls: tls.map(|(certificate, key)| TlsFiles { certificate, key }),
    };
    let instance =
        Token::random().map_err(|error| format!("getting a random number for the page: {error}"))?;
    let instance = instance.text().chars().take(12).collect();
    let (span, clock, is_playback, waits) = (of.span, of.clock, of.is_playback, of.mode != Mode::Live);
    let directed: Arc<Directed> = Arc::default();
    let act = act(of.console.clone(), &directed);
    let voices = voices(&of);
    let page = Page::start(settings, site(of), instance, act, direct(&directed), voices)
        .map_err(|error| error.to_string())?;
    for port in page.taken() {
        complain(&format!("headrace: port {port} is taken; the page is on {}", page.address().port()));
    }
    let opening_text = opening_text(&page, tokens.as_ref());
    lines.unwrap_or(&mut complain)(opening_text.trim_end());
    Ok(Served { page, span, clock, is_playback, waits, directed })
}

/// Tokens for access; `None` if other machines can't reach the page.
fn tokens(args: &PageArgs, address: SocketAddr) -> Result<Option<Tokens>, String> {
    if let Some(path) = &args.page_token_file {
        return read_tokens(path).map(Some);
    }
    if address.ip().is_loopback() {
        return Ok(None);
    }
    if !std::io::stdout().is_terminal() {
        return Err(format!(
            "a page on {address} is open to other machines; without a terminal it needs --page-token-file"
        ));
    }
    let random = || Token::random().map_err(|error| format!("making tokens for the page: {error}"));
    Ok(Some(Tokens { viewer: random()?, operator: random()? }))
}

fn read_tokens(path: &Path) -> Result<Tokens, String> {
    let failed = |why: String| format!("the page's tokens can't be read from {}: {why}", path.display());
    let text = files::read(path).map_err(|error| failed(error.to_string()))?;
    let token = |name: &str| {
        let lines = text.lines().filter_map(|line| line.split_once('='));
        let value = lines
            .into_iter()
            .find(|(key, _)| key.trim() == name)
            .map(|(_, value)| value.trim().trim_matches('"'));
        let value = value.ok_or_else(|| failed(format!("no line `{name} = TOKEN`")))?;
        Token::chosen(value).map_err(|why| failed(format!("the {name}'s token {why}")))
    };
    Ok(Tokens { viewer: token("viewer")?, operator: token("operator")? })
}

/// Names under which browsers may address this machine.
fn hosts(args: &PageArgs) -> Vec<String> {
    let own = std::fs::read_to_string("/proc/sys/kernel/hostname").unwrap_or_default();
    let own = own.trim();
    let own = [own.to_owned(), format!("{own}.local")].into_iter().filter(|_| !own.is_empty());
    own.chain([BLUEOS.to_owned()]).chain(args.page_host.iter().cloned()).collect()
}

/// Address of the page, as text. The tokens in it are shown only on a terminal, and are never logged.
fn opening_text(page: &Page, tokens: Option<&Tokens>) -> String {
    let (scheme, at) = (page.scheme(), page.address());
    let host = if at.ip().is_unspecified() { own_address(at.ip()) } else { at.ip() };
    let base = format!("{scheme}://{}", SocketAddr::new(host, at.port()));
    let is_terminal = std::io::stdout().is_terminal();
    let mut lines = format!("page   {base}\n");
    if let Some(tokens) = tokens.filter(|_| is_terminal) {
        let login = |token: &Token| format!("{base}/login?token={}", token.text());
        let operator = login(&tokens.operator);
        lines = format!("page   {operator}  (operator)\n       {}  (viewer)\n", login(&tokens.viewer));
        lines.push_str(&qr(&operator).map(|code| format!("{code}\n")).unwrap_or_default());
    }
    lines
}

/// Address by which other machines reach this machine. No packet is sent to find it.
fn own_address(unspecified: IpAddr) -> IpAddr {
    let (any, beyond) =
        if unspecified.is_ipv4() { ("0.0.0.0:0", "192.0.2.1:9") } else { ("[::]:0", "[2001:db8::1]:9") };
    let found = UdpSocket::bind(any).and_then(|socket| {
        socket.connect(beyond)?;
        socket.local_addr()
    });
    found.map_or(unspecified, |address| address.ip())
}

/// Tunnel, heads and sensors for the page.
pub(crate) fn site(of: Of<'_>) -> Site {
    let vehicle = of.vehicle;
    let hidden = hidden_by_vehicle(&vehicle.heads(), &vehicle.hull);
    let mut hidden = vehicle.heads().into_iter().zip(hidden);
    let (mut heads, mut sensors) = (Vec::new(), Vec::new());
    for ((number, sensor), config) in (0..).zip(&vehicle.sensors).zip(&vehicle.sensor_configs) {
        let kind = sensor.sense();
        if kind == Sense::Head {
            let degrees =
                |range: AngleRange| [range.from_rad, range.from_rad + range.size_rad].map(f64::to_degrees);
            let hidden_deg = hidden.next().map_or_else(Vec::new, |(head, ranges)| {
                ranges.iter().map(|range| degrees(range.across_body(&head.mount))).collect()
            });
            heads.push(HeadSite { id: config.id.clone(), source: number, hidden_deg });
        }
        sensors.push(SensorSite {
            id: config.id.clone(),
            plugin: config.plugin.clone(),
            kind: kind_text(kind),
        });
    }
    Site {
        mode: of.mode,
        dive: of.dive,
        vehicle: vehicle.name.clone(),
        target: vehicle.target,
        compared_m: of.compared_m,
        section_m: vehicle.section_m,
        length_m: vehicle.tunnel.length_m,
        profile: vehicle.tunnel.profile.clone(),
        heads,
        sensors,
        utc_of_zero_s: of.utc_of_zero_s,
        span_s: of.span.map(|(from, to)| [from, to].map(|at| of.clock.seconds(at))),
        takes_commands: of.console.is_some(),
        is_playback: of.is_playback,
        recorded_to: of.recorded_to,
    }
}

fn kind_text(kind: Sense) -> &'static str {
    match kind {
        Sense::Head => "head",
        Sense::Echosounder => "echosounder",
        Sense::Depth => "depth",
        Sense::Inertial => "imu",
        Sense::Velocity => "velocity_log",
        Sense::Tether => "tether",
    }
}

/// UTC of the zero of a log's clock, seconds; `None` if the log doesn't state it.
pub(crate) fn utc_of_zero_s(metadata: &BTreeMap<String, String>) -> Option<f64> {
    let number = |key: &str| metadata.get(key)?.parse::<i64>().ok();
    let [monotonic, utc] = CLOCK_ANCHOR.map(number);
    Some(utc?.checked_sub(monotonic?)? as f64 / 1e9)
}

/// Creates the function that hands an operator's commands to the loop. During playback it refuses them.
fn act(console: Option<ConsolePort>, directed: &Arc<Directed>) -> Act {
    let directed = Arc::clone(directed);
    Arc::new(move |command| {
        let Some(console) = &console else { return Err("this dive takes no commands".to_owned()) };
        if directed.commands().is_some() {
            return Err("this dive has ended: its log contains the acknowledgements and notes".to_owned());
        }
        let who = |by: &str| Who::new(by).ok_or_else(|| "by has control characters".to_owned());
        let command = match &command {
            Command::Acknowledge { alert, by } => Input::Acknowledge { alert: *alert, by: who(by)? },
            Command::Silence { by } => Input::Silence { by: who(by)? },
            Command::Note { text, by } => {
                let text = NoteText::new(text).ok_or_else(|| "text has control characters".to_owned())?;
                Input::Note { text, by: who(by)? }
            }
            Command::Mark { by } => Input::Note { text: NoteText::default(), by: who(by)? },
            Command::Voice { id, by } => Input::Voice { id: *id, by: who(by)? },
        };
        console.send(&command).map_err(|error| error.to_string())
    })
}

/// Returns how the page handles the audio of voice notes. In a dive, a function hands it to all logs. In a replay, a
/// function finds it in the log.
///
/// In a dive, the loop is informed when at least one log has taken the audio.
fn voices(of: &Of<'_>) -> Voices {
    match (&of.voices, &of.console) {
        (VoicesOf::Log(files), _) => {
            let (files, clock) = (files.clone(), of.clock);
            Voices::Recalled(Arc::new(move |id, at_s| {
                let from = clock.timestamp(DurNs::from_secs_f64(at_s));
                find_voice(&files, id, from).map_err(|error| error.to_string())
            }))
        }
        (VoicesOf::Dive(ports), Some(console)) if !ports.is_empty() => {
            let (ports, console) = (ports.clone(), console.clone());
            Voices::Kept(Arc::new(move |voice| {
                let kept: Vec<_> = ports.iter().map(|port| port.keep(voice)).collect();
                if kept.iter().all(Result::is_err) {
                    return kept.into_iter().collect::<Result<_, _>>().map_err(|why| why.to_string());
                }
                let spoken = Input::Voiced { id: voice.id, seconds: voice.seconds };
                console.send(&spoken).map_err(|error| error.to_string())
            }))
        }
        _ => Voices::None,
    }
}

/// Creates the function that hands the page's commands to playback. The function fails if no playback is
/// running. At the end of the log, playback goes on from the beginning.
fn direct(directed: &Arc<Directed>) -> Direct {
    let directed = Arc::clone(directed);
    Arc::new(move |play| {
        let commands = directed.commands();
        let Some((commands, clock)) = commands.as_ref() else { return Err(NO_PLAYBACK.to_owned()) };
        let command = match play {
            Play::Pause => PlaybackCommand::Pause,
            Play::Go => PlaybackCommand::Go,
            Play::Step => PlaybackCommand::Step(1),
            Play::StepSection => PlaybackCommand::StepSection,
            Play::End => PlaybackCommand::End,
            Play::Speed(speed) => PlaybackCommand::Speed(speed),
            Play::Seek(to_s) => PlaybackCommand::Seek(clock.timestamp(DurNs::from_secs_f64(to_s))),
        };
        if command == PlaybackCommand::Go && directed.is_at_end.load(Ordering::Relaxed) {
            // If this jump fails, so does sending the command below, and that failure is returned.
            let _failed = commands.send(PlaybackCommand::Seek(MonoNs(0)));
        }
        commands.send(command).map_err(|_| NO_PLAYBACK.to_owned())
    })
}

impl Served {
    /// Creates the follower that feeds the page.
    pub(crate) fn follower(&self, dive: &Loop) -> Box<dyn Follower> {
        let span = self.span.filter(|_| self.is_playback);
        Box::new(PageFollower { span, clock: self.clock, ..self.directing_follower(dive) })
    }

    /// Creates the follower that feeds the page with a replay of the dive that the page has shown until now. The replay
    /// must begin with a jump to the end of the log.
    pub(crate) fn replay_follower(&self, dive: &Loop, player: &Player) -> Box<dyn Follower> {
        let (span, clock) = (player.span(), player.dive_clock());
        let (now, ignored_stops) = (span.map_or(MonoNs(0), |(_, to)| to), STOPS_TO_END);
        Box::new(PageFollower { span, clock, now, ignored_stops, ..self.directing_follower(dive) })
    }

    fn directing_follower(&self, dive: &Loop) -> PageFollower {
        let directed = Some(Arc::clone(&self.directed));
        PageFollower { directed, ..PageFollower::new(self.page.collector(dive, self.waits)) }
    }

    /// Shows the dive's result, and goes on serving the page.
    pub(crate) fn show_result(&self, report: &Report) {
        self.page.show_result(end_message(report));
    }

    /// Lets the page control a replay of the dive with this clock.
    ///
    /// With `stays` the replay remains at the end of the log until `interrupted`. Otherwise the returned
    /// function ends the page's control of the replay.
    pub(crate) fn direct(
        &self,
        (to, clock): (&Sender<PlaybackCommand>, DiveClock),
        stays: bool,
        interrupted: Arc<AtomicBool>,
    ) -> Option<Box<dyn Fn()>> {
        let directed = Arc::clone(&self.directed);
        *directed.commands() = Some((to.clone(), clock));
        if !stays {
            return Some(Box::new(move || drop(directed.commands().take())));
        }
        let sender = to.clone();
        std::thread::spawn(move || {
            while !interrupted.load(Ordering::Relaxed) {
                std::thread::sleep(LOOK_EVERY);
            }
            // Sending fails if playback has ended already, which does no harm.
            let _ended = sender.send(PlaybackCommand::End);
        });
        None
    }

    /// Opens a browser, if this machine has one and a person can see the browser.
    pub(crate) fn open(&self) {
        let has_screen = ["DISPLAY", "WAYLAND_DISPLAY"]
            .iter()
            .any(|name| std::env::var_os(name).is_some_and(|of| !of.is_empty()));
        if !has_screen || !std::io::stdout().is_terminal() {
            return;
        }
        let address = format!("{}://{}", self.page.scheme(), self.page.address());
        let null = Stdio::null;
        let opened =
            Process::new("xdg-open").arg(address).stdin(null()).stdout(null()).stderr(null()).spawn();
        if let Err(error) = opened {
            tracing::debug!(%error, "no browser was opened");
        }
    }

    /// Ends the page, and shows the dive's report on it.
    pub(crate) fn end(self, report: &Report) {
        self.page.end(Some(end_message(report)));
    }
}

/// Last message of a dive to its page.
pub(crate) fn end_message(report: &Report) -> Value {
    json!({"type": "end", "digest": report.digest, "summary": report.summary, "way": report.coverage_extent,
        "exit": exit_code(report)})
}

/// A follower that passes all events of the dive to the page's collector.
pub(crate) fn following(collector: Collector) -> Box<dyn Follower> {
    Box::new(PageFollower::new(collector))
}

struct PageFollower {
    collector: Collector,
    /// First and last time of a replay's log; `None` in a live dive.
    span: Option<(MonoNs, MonoNs)>,
    clock: DiveClock,
    now: MonoNs,
    /// Playback that the page controls; `None` for a page in a file.
    directed: Option<Arc<Directed>>,
    /// Number of coming stops of the replay at which the page goes on showing the finished dive.
    ignored_stops: u8,
}

impl PageFollower {
    fn new(collector: Collector) -> Self {
        Self {
            collector,
            span: None,
            clock: DiveClock::default(),
            now: MonoNs(0),
            directed: None,
            ignored_stops: 0,
        }
    }
}

impl Follower for PageFollower {
    fn messages(&mut self, messages: &[LiveMessage], dive: &Loop) {
        self.collector.messages(messages, dive);
    }

    fn notice(&mut self, notice: &Notice, _: &Loop) {
        self.collector.notice(notice);
    }

    fn tick(&mut self, dive: &Loop) {
        self.now = dive.now();
        self.collector.tick(dive);
    }

    fn skipped(&mut self, dive: &Loop) {
        if self.ignored_stops == 0 {
            self.now = dive.now();
            self.collector.skipped(dive);
        }
    }

    fn mode(&mut self, paused: bool, speed: Option<f64>) {
        let Some((from, to)) = self.span else { return };
        let paused = paused || self.ignored_stops > 0;
        let [at_s, from_s, to_s] = [self.now.max(from), from, to].map(|at| self.clock.seconds(at));
        self.collector.playback(PlaybackState { paused, speed, at_s, from_s, to_s });
    }

    fn sensor(&mut self, id: &str, status: &Status) {
        self.collector.sensor(id, status.phase.as_str(), &status.words, status.since);
    }

    fn recording(&mut self, event: &RecordingEvent, at: MonoNs) {
        let (fails, words) = (event.fails(), event.words());
        self.collector.recording(fails, &words, at);
    }

    fn recorded(&mut self, state: &RecordingState) {
        self.collector.recorded(state.words(), state.rebuilt_pct);
    }

    fn rebuilt(&mut self, dive: &Loop) {
        self.collector.rebuilt(dive);
    }

    fn stopped(&mut self, dive: &Loop, _time: DurNs, ended: bool) {
        if let Some(directed) = &self.directed {
            directed.is_at_end.store(ended, Ordering::Relaxed);
        }
        if self.ignored_stops > 0 {
            self.ignored_stops -= 1;
            return;
        }
        self.now = dive.now();
        self.collector.stopped(dive);
    }

    fn end(&mut self, dive: &Loop) {
        self.collector.end(dive);
    }
}
