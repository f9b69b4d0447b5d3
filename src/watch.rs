//! Output during a dive, as lines or as JSON.
//!
//! The output has the dive's state, and each missed, unsure or cleared stretch once.

use headrace_config::plain::one_line;
use headrace_geometry::time::{DiveClock, DurNs, MonoNs};
use headrace_monitor::live_messages::{LiveMessage, LiveMessages};
use headrace_monitor::live_state::{Condition, Lamp, LiveState};
use headrace_monitor::live_text::{PilotLine, message_line, status_line};
use headrace_monitor::messages::Notice;
use headrace_monitor::run::Loop;
use headrace_ports::{Phase, Status};
use headrace_replay::log::RecordingEvent;
use serde_json::{Value, json};

use crate::follower::Follower;
use crate::printer::Printer;
use crate::recording_state::RecordingState;
use crate::screen::Screen;
use crate::sensor_lines::SensorLines;
use crate::terminal;

/// Interval between state lines if lines can't be overwritten.
const LINE_EVERY: DurNs = DurNs(10_000_000_000);
/// Interval between state lines that are overwritten, and between states in JSON.
const REFRESH_EVERY: DurNs = DurNs(1_000_000_000);
/// Minimum time from a state line to the next one if the colour of the status lamp changes and lines can't be
/// overwritten.
const CHANGE_EVERY: DurNs = DurNs(2_000_000_000);

/// Kind of output during a dive.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Show {
    /// No output during the dive.
    Nothing,
    /// No lines, because a follower uses the terminal.
    Followers,
    /// Lines of text for people.
    Lines,
    /// JSON objects, one per line.
    JsonLines,
}

/// Shows a dive on stdout, and passes it to followers.
pub(crate) struct Watch {
    followers: Vec<Box<dyn Follower>>,
    show: Show,
    screen: Screen,
    printer: Option<Printer>,
    /// Makes live messages from the loop's results, for lines and followers.
    teller: LiveMessages,
    /// Time and condition of the last state shown.
    shown: Option<(MonoNs, Condition)>,
    recorded: RecordingState,
    sensor_lines: SensorLines,
    clock: DiveClock,
}

impl Watch {
    /// Creates the output of this kind. With `-q` nothing is shown.
    pub(crate) fn new(show: Show) -> Self {
        let quiet = terminal::is_quiet() && show != Show::Followers;
        let show = if quiet { Show::Nothing } else { show };
        Self {
            followers: Vec::new(),
            show,
            screen: Screen::of_stdout(),
            printer: matches!(show, Show::Lines | Show::JsonLines).then(|| Printer::start(false)),
            teller: LiveMessages::default(),
            shown: None,
            recorded: RecordingState::default(),
            sensor_lines: SensorLines::default(),
            clock: DiveClock::default(),
        }
    }

    /// Creates an output that shows nothing.
    pub(crate) fn quiet() -> Self {
        Self::new(Show::Nothing)
    }

    /// Adds a follower of the dive.
    #[must_use]
    pub(crate) fn followed_by(mut self, follower: Box<dyn Follower>) -> Self {
        self.followers.push(follower);
        self
    }

    /// Whether nothing is shown on stdout.
    pub(crate) fn is_quiet(&self) -> bool {
        self.show == Show::Nothing
    }

    /// Whether the dive is shown in lines for people.
    pub(crate) fn shows_lines(&self) -> bool {
        self.show == Show::Lines
    }

    /// Writes a line, in order with the other lines.
    pub(crate) fn say(&mut self, line: &str) {
        self.print(one_line(line).into_owned());
    }

    /// Makes the output lossy, for a live dive, which can't wait. Lines for which the terminal has no room
    /// are dropped.
    pub(crate) fn live(mut self) -> Self {
        if let Some(printer) = &mut self.printer {
            printer.drop_rather_than_wait();
        }
        self
    }

    /// Passes a result of the loop to followers, and writes its live messages.
    pub(crate) fn notice(&mut self, notice: &Notice, dive: &Loop) {
        if !self.has_readers() {
            return;
        }
        self.clock = dive.view().clock();
        let mut messages = Vec::new();
        self.teller.hear(notice, dive, &mut |one| messages.push(one));
        for follower in &mut self.followers {
            follower.messages(&messages, dive);
            follower.notice(notice, dive);
        }
        let at = match notice {
            Notice::Section { at, .. } | Notice::Run { at, .. } | Notice::Listed { at, .. } => *at,
            Notice::Advice(entry) => entry.at,
            Notice::Note(note) => note.at,
        };
        self.tell(at, &messages, dive);
    }

    /// Shows the dive's state. Called after every tick, even without packets.
    pub(crate) fn tick(&mut self, dive: &Loop) {
        if !self.has_readers() {
            return;
        }
        self.clock = dive.view().clock();
        let state = dive.view().live_state();
        let mut messages = Vec::new();
        self.teller.tick(state, dive, &mut |one| messages.push(one));
        for follower in &mut self.followers {
            follower.messages(&messages, dive);
            follower.tick(dive);
        }
        if self.printer.is_none() {
            return;
        }
        self.tell(state.now, &messages, dive);
        let condition = state.condition();
        if self.is_due(state, condition) {
            self.shown = Some((as_of(state), condition));
            self.status(state, dive);
        }
    }

    /// Processes a tick that belongs to a jump, without showing it.
    pub(crate) fn skipped(&mut self, dive: &Loop) {
        self.followers.iter_mut().for_each(|follower| follower.skipped(dive));
    }

    /// Shows that a replay pauses or resumes, or that its speed changes.
    pub(crate) fn mode(&mut self, paused: bool, speed: Option<f64>) {
        self.followers.iter_mut().for_each(|follower| follower.mode(paused, speed));
    }

    /// Shows a change of a sensor's state.
    pub(crate) fn sensor(&mut self, id: &str, status: &Status) {
        self.followers.iter_mut().for_each(|follower| follower.sensor(id, status));
        let phase = status.phase.as_str();
        match self.show {
            Show::Nothing | Show::Followers => {}
            Show::JsonLines => self.json(
                status.since,
                json!({"type": "sensor", "id": id, "phase": phase, "text": status.words}),
            ),
            Show::Lines => {
                if !self.sensor_lines.is_new(status) {
                    return;
                }
                let lamp = (status.phase != Phase::Running).then_some(Lamp::Amber);
                let what = vec![format!("{id} {status}")];
                self.line(&PilotLine { place: "SENSOR".to_owned(), what, lamp, ..PilotLine::default() });
            }
        }
    }

    /// Shows an event of a recording.
    pub(crate) fn recording(&mut self, event: &RecordingEvent, at: MonoNs) {
        let fails = event.fails();
        self.followers.iter_mut().for_each(|follower| follower.recording(event, at));
        let words = event.words();
        match self.show {
            Show::Nothing | Show::Followers => {}
            Show::JsonLines => self.json(at, json!({"type": "recording", "fails": fails, "text": words})),
            Show::Lines => {
                let lamp = Some(if fails { Lamp::Red } else { Lamp::Amber });
                self.line(&PilotLine {
                    place: "RECORDING".to_owned(),
                    what: vec![words],
                    lamp,
                    ..PilotLine::default()
                });
            }
        }
        self.shown = None;
    }

    /// Sets a new state of the recordings, which is shown from now on.
    pub(crate) fn recorded(&mut self, state: &RecordingState) {
        self.show_recorded(RecordingState { rebuilt_pct: self.recorded.rebuilt_pct, ..*state });
    }

    fn show_recorded(&mut self, state: RecordingState) {
        self.recorded = state;
        self.followers.iter_mut().for_each(|follower| follower.recorded(&state));
    }

    /// Shows how much of an interrupted dive's log has been read again, percent.
    pub(crate) fn rebuilding(&mut self, pct: u8, dive: &Loop) {
        self.followers.iter_mut().for_each(|follower| follower.tick(dive));
        if self.recorded.rebuilt_pct == Some(pct) {
            return;
        }
        self.clock = dive.view().clock();
        self.show_recorded(RecordingState { rebuilt_pct: Some(pct), ..self.recorded });
        let words = self.recorded.words().map(|(words, _)| words).unwrap_or_default();
        match self.show {
            Show::JsonLines => {
                self.json(dive.now(), json!({"type": "resuming", "read_pct": pct, "text": words}));
            }
            Show::Lines if pct.is_multiple_of(10) => self.say(&format!("RESUMING  {words}")),
            Show::Lines | Show::Nothing | Show::Followers => {}
        }
    }

    /// Shows that an interrupted dive goes on, after its state has been rebuilt.
    pub(crate) fn rebuilt(&mut self, dive: &Loop, words: &str) {
        self.clock = dive.view().clock();
        self.show_recorded(RecordingState { rebuilt_pct: None, ..self.recorded });
        self.teller = LiveMessages::default();
        self.followers.iter_mut().for_each(|follower| follower.rebuilt(dive));
        match self.show {
            Show::JsonLines => self.json(dive.now(), json!({"type": "resumed", "text": words})),
            Show::Lines => self.say(&format!("RESUMED   {words}")),
            Show::Nothing | Show::Followers => {}
        }
    }

    /// Shows that a replay has paused, jumped or ended. `time` is a dive time.
    pub(crate) fn stopped(&mut self, dive: &Loop, time: DurNs, ended: bool) {
        (self.shown, self.clock) = (None, dive.view().clock());
        self.teller.stopped(dive.now());
        self.followers.iter_mut().for_each(|follower| follower.stopped(dive, time, ended));
        let (tick, samples, digest) =
            (dive.ticks(), dive.view().tally().samples, format!("{:016x}", dive.view().digest()));
        match self.show {
            Show::Nothing | Show::Followers => {}
            Show::JsonLines => {
                let stopped = json!({"type": "stopped", "time_s": time.as_secs_f64(), "ended": ended, "tick": tick,
                    "samples": samples, "digest": digest});
                self.json(dive.now(), stopped);
            }
            Show::Lines => {
                let seconds = time.as_secs_f64();
                let (h, min, s) = (seconds / 3600.0, seconds / 60.0 % 60.0, seconds % 60.0);
                let end = if ended { "  (end)" } else { "" };
                let (h, min) = (h.floor(), min.floor());
                self.print(format!(
                    "AT       {h}:{min:02}:{s:06.3}{end}: tick {tick}, {samples} samples, digest {digest}"
                ));
            }
        }
    }

    /// Tells followers that a dive on ports ends.
    pub(crate) fn ending(&mut self) {
        self.followers.iter_mut().for_each(|follower| follower.ending());
    }

    /// Ends the output of a dive.
    pub(crate) fn end(&mut self, dive: &Loop) {
        let mut messages = Vec::new();
        self.teller.end(&dive.view().coverage().sections, &mut |one| messages.push(one));
        for follower in &mut self.followers {
            follower.messages(&messages, dive);
            follower.end(dive);
        }
        self.tell(dive.now(), &messages, dive);
        if let Some(printer) = &mut self.printer {
            printer.end();
        }
    }

    /// Whether live messages are shown, as lines or by a follower.
    fn has_readers(&self) -> bool {
        self.printer.is_some() || !self.followers.is_empty()
    }

    fn is_due(&self, state: &LiveState, condition: Condition) -> bool {
        let Some((shown, before)) = self.shown else {
            return condition != Condition::NoData || !state.heard.iter().any(Option::is_some);
        };
        let since = as_of(state).since(shown).0.abs();
        if self.show == Show::JsonLines || self.screen.overwrites {
            return since >= REFRESH_EVERY.0 || before.as_str() != condition.as_str();
        }
        since >= LINE_EVERY.0 || before.lamp() != condition.lamp() && since >= CHANGE_EVERY.0
    }

    fn status(&mut self, state: &LiveState, dive: &Loop) {
        let line = state_line(dive, &self.recorded);
        if self.show == Show::JsonLines {
            let mut value = match serde_json::to_value(dive.view().live_state_json()) {
                Ok(value) => value,
                Err(error) => json!({"error": error.to_string()}),
            };
            if let Some(object) = value.as_object_mut() {
                object.insert("type".to_owned(), "state".into());
                object.insert("text".to_owned(), line.text().into());
                object.extend(self.recorded.fails.map(|fails| ("recording_fails".to_owned(), fails.into())));
                let unsafe_s = Some(self.recorded.unsafe_s).filter(|seconds| *seconds > 0);
                object.extend(unsafe_s.map(|seconds| ("recording_unsafe_s".to_owned(), seconds.into())));
            }
            self.json(state.now, value);
        } else if self.screen.overwrites {
            let columns = Screen::columns().unwrap_or(usize::MAX);
            let text = self.screen.coloured(&line.cut(columns), line.lamp);
            if let Some(printer) = &mut self.printer {
                printer.status(text);
            }
        } else {
            self.print(self.screen.coloured(&line.text(), None));
        }
    }

    /// Writes live messages as lines, unless the output has no lines.
    fn tell(&mut self, at: MonoNs, messages: &[LiveMessage], dive: &Loop) {
        if self.printer.is_none() {
            return;
        }
        for one in messages {
            let line = message_line(one, &dive.mission().profile, dive.head_descriptions());
            if self.show == Show::Lines {
                if one.adds_line() {
                    self.line(&line);
                }
                continue;
            }
            let mut value = match serde_json::to_value(one) {
                Ok(value) => value,
                Err(error) => json!({"error": error.to_string()}),
            };
            if let Some(object) = value.as_object_mut().filter(|_| !matches!(one, LiveMessage::Note(_))) {
                object.insert("text".to_owned(), line.text().into());
            }
            self.json(at, value);
        }
    }

    fn line(&mut self, line: &PilotLine) {
        let lines = Screen::columns().map_or_else(|| vec![line.text()], |columns| line.broken(columns));
        for text in lines {
            self.print(self.screen.coloured(&text, line.lamp));
        }
    }

    fn json(&mut self, at: MonoNs, mut value: Value) {
        if let Some(object) = value.as_object_mut() {
            object.insert("t_s".to_owned(), self.clock.seconds(at).into());
        }
        self.print(one_line(&value.to_string()).into_owned());
    }

    /// Writes a line of printable text.
    fn print(&mut self, text: String) {
        if let Some(printer) = &mut self.printer {
            printer.line(text);
        }
    }
}

/// The dive's state as a line, with a warning if recordings fail or aren't synced.
pub(crate) fn state_line(dive: &Loop, recorded: &RecordingState) -> PilotLine {
    let name = |source: usize| dive.sources().get(source).map_or_else(String::new, |info| info.id.clone());
    let state = dive.view().live_state();
    let mut line = status_line(state, &dive.mission().profile, dive.head_descriptions(), &name);
    if let Some((words, is_alarm)) = recorded.words() {
        line.what.insert(line.what.len().min(1), words);
        line.lamp = if is_alarm { Some(Lamp::Red) } else { line.lamp };
    }
    line
}

/// Time shown with a state of the dive. It is the time of the state's last update, so that the same dive
/// gives the same lines wherever ticks end.
///
/// If there are no updates, the time of the tick is shown.
fn as_of(state: &LiveState) -> MonoNs {
    state.at.filter(|_| !state.is_old()).unwrap_or(state.now)
}
