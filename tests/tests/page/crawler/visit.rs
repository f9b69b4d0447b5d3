//! Visits moments of a replay on the page, on a terminal and in JSON lines.

use std::io::{BufRead as _, BufReader, Write as _};
use std::process::{Child, ChildStdin, ChildStdout, Stdio};
use std::time::Duration;

use headrace_tests::Folder;
use headrace_tests::page_client::Viewer;
use headrace_tests::program;
use headrace_tests::screen::Screen;
use serde_json::{Value, json};

use crate::address::ANY;

/// Largest number of times that a screen is read, every 50 ms, until it shows the moment.
const READINGS: u32 = 100;

/// Everything that the screens show at one moment.
#[derive(Debug, Clone)]
pub(crate) struct Moment {
    /// State line of `--json-lines`.
    pub(crate) line: Value,
    /// State message of the page's feed.
    pub(crate) page: Value,
    /// Alerts of the page's feed that have not ended, by number.
    pub(crate) alerts: Vec<Value>,
    /// Length of the page's sections by verdict, m: open, pass, fail, cannot say, not inspected.
    pub(crate) metres: [f64; 5],
    /// Last `back` message of the page's feed.
    pub(crate) back: Option<Value>,
    /// Page of the terminal.
    pub(crate) screen: String,
}

/// A replay with a terminal and a page, and a second replay of the same log with JSON lines.
pub(crate) struct Crawl {
    screen: Screen,
    viewer: Viewer,
    lines: Lines,
}

impl Crawl {
    /// Starts both replays of `dive.mcap`. The replay with terminal and page is then at the end of the log.
    pub(crate) fn start(folder: &Folder) -> Self {
        let arguments = ["replay", "dive.mcap", "--tui", "--speed", "max", ANY, "--report", "report.json"];
        let screen = Screen::sized(folder, &arguments, (160, 70), &[("LANG", "C.UTF-8")]);
        let shown = screen.until("SENSORS");
        let (_, address) = shown.split_once("page   http://").unwrap();
        let address = address.split_whitespace().next().unwrap();
        let mut viewer = Viewer::connect_to(address, "", &[]).unwrap();
        viewer.until_type("ready");
        viewer.until("the end of the log", |viewer| viewer.state["playback"]["paused"] == true);
        // Without this pause, playback goes on after a jump.
        viewer.send(&json!({"do": "play", "command": "pause"}));
        Self { screen, viewer, lines: Lines::start(folder) }
    }

    /// Jumps to the last tick before the dive time `at_s`.
    fn jump(&mut self, at_s: f64) {
        let viewer = &mut self.viewer;
        let before = viewer.hello["instance"].clone();
        viewer.others.clear();
        viewer.send(&json!({"do": "play", "command": "seek", "to_s": at_s}));
        viewer.until("the jump", |viewer| {
            let is_ready = viewer.others.iter().any(|other| other["type"] == "ready");
            // The state may arrive after the message that the page is ready.
            let now_s = viewer.state["now_s"].as_f64();
            let is_there = now_s.is_some_and(|now_s| (now_s - at_s).abs() < 0.05);
            viewer.hello["instance"] != before && is_ready && is_there
        });
    }

    fn now_s(&self) -> f64 {
        self.viewer.state["now_s"].as_f64().unwrap()
    }

    /// Dive time at the end of the log, s.
    pub(crate) fn last_s(&self) -> f64 {
        self.viewer.state["playback"]["to_s"].as_f64().unwrap()
    }

    /// Shows the first tick after the dive time `at_s` on all screens. The terminal is slower than the page, so it is
    /// read again as long as `contradictions` finds any.
    pub(crate) fn visit(
        &mut self,
        at_s: f64,
        contradictions: &mut dyn FnMut(&Moment) -> Vec<String>,
    ) -> Moment {
        self.jump(at_s);
        let from_s = self.now_s();
        self.viewer.send(&json!({"do": "play", "command": "step"}));
        let line = self.lines.visit(from_s);
        let viewer = &mut self.viewer;
        let listed = line["alert_list"].as_array().unwrap();
        let numbers: Vec<u64> = listed.iter().filter_map(|alert| alert["number"].as_u64()).collect();
        // The list of alerts may arrive after the state.
        viewer.until("the moment", |viewer| {
            let has_alerts = numbers.iter().all(|number| viewer.alerts.contains_key(number));
            viewer.state["now_s"] == line["now_s"] && has_alerts
        });
        let section_m = viewer.hello["section_m"].as_f64().unwrap();
        let mut metres = [0.0; 5];
        for section in viewer.sections.values() {
            metres[usize::from(section.verdict)] += section_m;
        }
        let live = viewer.alerts.values().filter(|alert| alert["state"] != "cleared");
        let mut moment = Moment {
            line,
            page: viewer.state.clone(),
            alerts: live.cloned().collect(),
            metres,
            back: viewer.others.iter().rfind(|message| message["type"] == "back").cloned(),
            screen: self.screen.page(),
        };
        for _ in 0..READINGS {
            if contradictions(&moment).is_empty() {
                break;
            }
            std::thread::sleep(Duration::from_millis(50));
            moment.screen = self.screen.page();
        }
        moment
    }

    /// Plays to the end of the log, and ends the replay. Returns the page's last message, the summary on the terminal,
    /// and the report.
    pub(crate) fn end(mut self, folder: &Folder) -> (Value, String, Value) {
        let to_s = self.last_s() + 1.0;
        self.viewer.send(&json!({"do": "play", "command": "seek", "to_s": to_s}));
        self.screen.until_page(" END ");
        self.viewer.send(&json!({"do": "play", "command": "end"}));
        let end = self.viewer.until_type("end");
        drop(self.screen.end());
        let report = serde_json::from_slice(&folder.read("report.json")).unwrap();
        (end, self.screen.page(), report)
    }
}

/// A replay with `--json-lines` that takes commands from its standard input.
struct Lines {
    child: Child,
    commands: ChildStdin,
    lines: BufReader<ChildStdout>,
}

impl Lines {
    fn start(folder: &Folder) -> Self {
        let mut command = program();
        command.args(["replay", "dive.mcap", "--json-lines", "--interactive"]).current_dir(folder.path(""));
        command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::null());
        let mut child = command.spawn().unwrap();
        let (commands, lines) = (child.stdin.take().unwrap(), BufReader::new(child.stdout.take().unwrap()));
        let mut all = Self { child, commands, lines };
        all.command("pause");
        while all.next()["type"] != "stopped" {}
        all
    }

    fn command(&mut self, command: &str) {
        writeln!(self.commands, "{command}").unwrap();
    }

    fn next(&mut self) -> Value {
        let mut line = String::new();
        assert!(self.lines.read_line(&mut line).unwrap() > 0, "the replay has ended");
        serde_json::from_str(&line).unwrap()
    }

    /// State line of the first tick after the dive time `at_s`.
    fn visit(&mut self, at_s: f64) -> Value {
        self.command(&format!("seek {at_s:.9}s\nstep"));
        let mut state = Value::Null;
        loop {
            let line = self.next();
            if line["type"] == "state" {
                state = line;
            } else if line["type"] == "stopped" && state["t_s"] == line["t_s"] {
                return state;
            }
        }
    }
}

impl Drop for Lines {
    fn drop(&mut self) {
        drop(self.child.kill());
        drop(self.child.wait());
    }
}
