//! Faults that a person causes during a rehearsal, by typing lines or keys into `emulate`.

use std::io::{BufRead as _, BufReader, Write as _};
use std::net::UdpSocket;
use std::process::{ChildStdin, ChildStdout, Stdio};
use std::time::{Duration, Instant};

use headrace_tests::Folder;
use headrace_tests::screen::Screen;
use rustix::process::Signal;

use crate::rehearsal::{Running, headrace, scene};

/// A running program with its output, and with its input if the program reads commands.
pub(crate) struct Piped {
    process: Running,
    commands: ChildStdin,
    lines: std::io::Lines<BufReader<ChildStdout>>,
}

impl Piped {
    pub(crate) fn start(folder: &Folder, arguments: &[&str]) -> Self {
        let mut command = headrace();
        command.args(arguments).current_dir(folder.path(""));
        command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
        let mut child = command.spawn().unwrap();
        let (commands, lines) =
            (child.stdin.take().unwrap(), BufReader::new(child.stdout.take().unwrap()).lines());
        Self { process: Running(child), commands, lines }
    }

    /// Starts a rehearsal that takes its commands from a pipe.
    pub(crate) fn emulator(folder: &Folder) -> Self {
        folder.write("scene.toml", scene(30.0));
        Self::start(folder, &["emulate", "--stand", "0", "--out", "rehearsal", "scene.toml"])
    }

    /// Waits for a line that begins with `start` and contains `text`, and returns this line.
    #[track_caller]
    pub(crate) fn until(&mut self, start: &str, text: &str) -> String {
        let line = self
            .lines
            .by_ref()
            .map_while(Result::ok)
            .find(|line| line.starts_with(start) && line.contains(text));
        line.unwrap_or_else(|| panic!("no line {start:?} with {text:?}"))
    }

    /// Waits for the program's end; returns its exit code and its remaining output.
    pub(crate) fn end(&mut self) -> (Option<i32>, String) {
        let lines: Vec<String> = self.lines.by_ref().map_while(Result::ok).collect();
        (self.process.0.wait().unwrap().code(), lines.join("\n"))
    }

    /// Sends a command, and waits until the program shows the command's effect.
    #[track_caller]
    pub(crate) fn order(&mut self, line: &str, id: &str, effect: &str) {
        writeln!(self.commands, "{line}").unwrap();
        self.until(id, effect);
    }
}

#[test]
fn unplugged_stalled_and_restarted_devices_are_reported_and_come_back() {
    let folder = Folder::new();
    let mut emulator = Piped::emulator(&folder);
    emulator.until("commands by lines on standard input: unplug ID, plug ID, stall ID", "end or quit");
    let mut run =
        Piped::start(&folder, &["run", "rehearsal/vehicle.toml", "--no-record", "--no-page", "--for", "200"]);
    emulator.until("all sensors are connected", "");
    // A pseudoterminal gets another name when it is plugged in again, but TCP and UDP ports keep their numbers.
    for id in ["sonar_2", "sonar_0", "ping_left"] {
        emulator.order(&format!("unplug {id}"), id, "unplugged");
        run.until("SENSOR", &format!("{id} closed: "));
        emulator.order(&format!("plug {id}"), id, "plugged in");
        run.until("SENSOR", &format!("{id} running"));
    }
    emulator.order("stall sonar_1", "sonar_1", "stalled");
    run.until("ALERT", "raised: sonar_1 silent");
    emulator.order("resume sonar_1", "sonar_1", "answers again");
    run.until("ALERT", "rectified: sonar_1 silent");
    emulator.order("restart sonar_0", "sonar_0", "restarts: off for 3 s");
    run.until("SENSOR", "sonar_0 closed: ");
    emulator.until("sonar_0", "on again");
    run.until("SENSOR", "sonar_0 running");
    emulator.order("freeze", "tether", "count frozen");
    emulator.order("release", "tether", "counts again");
    writeln!(emulator.commands, "unplug sonar_9").unwrap();
    emulator.order("end", "ended early", "");
    let complaints = std::io::read_to_string(emulator.process.0.stderr.take().unwrap()).unwrap();
    assert!(complaints.contains("no device \"sonar_9\"; expected one of: sonar_0, sonar_1"), "{complaints}");
}

/// Returns the times, s, that a host of the cable counter waits for its next 30 reports after a command.
fn waits_after(line: &str, id: &str, effect: &str) -> Vec<f64> {
    let folder = Folder::new();
    let mut emulator = Piped::emulator(&folder);
    let port = emulator.until("tether", "udp:127.0.0.1:");
    let host = UdpSocket::bind("127.0.0.1:0").unwrap();
    host.connect(port.split("udp:").last().unwrap()).unwrap();
    host.set_read_timeout(Some(Duration::from_mins(1))).unwrap();
    host.send(b"\n").unwrap();
    let mut report = [0; 64];
    host.recv(&mut report).unwrap();
    emulator.order(line, id, effect);
    #[expect(clippy::disallowed_methods, reason = "the delay is wall time")]
    let waits = (0..30).map(|_| {
        let begun = Instant::now();
        host.recv(&mut report).unwrap();
        begun.elapsed().as_secs_f64()
    });
    waits.collect()
}

#[test]
fn delayed_data_arrive_later_by_the_delay() {
    let longest =
        waits_after("delay tether 2s", "tether", "data 2 s late").into_iter().reduce(f64::max).unwrap();
    assert!((1.5..20.0).contains(&longest), "{longest}");
}

#[test]
fn held_data_of_all_devices_arrive_at_once() {
    let waits = waits_after("hold 2s", "all devices", "data held back for 2 s");
    let held = waits.iter().position(|wait| *wait > 1.0).unwrap();
    let after: f64 = waits[held + 1..].iter().take(10).sum();
    assert!(after < 0.5 * waits[held], "{waits:?}");
}

#[test]
fn keys_cause_and_end_faults() {
    let folder = Folder::new();
    folder.write("scene.toml", scene(30.0));
    let emulate = || Screen::run(&folder, &["emulate", "--out", "rehearsal", "scene.toml"], 120, &[]);
    let mut screen = emulate();
    screen.until("sonar_0      chosen");
    assert!(
        screen.shown().contains("KEYS     up and down choose a device, u unplug, "),
        "{}",
        screen.shown()
    );
    for (key, shown) in [
        (&b"u"[..], "sonar_0      unplugged"),
        (b"u", "sonar_0      plugged in"),
        (b"\x1b[B", "sonar_1      chosen"),
        (b"s", "sonar_1      stalled"),
        (b"s", "sonar_1      answers again"),
        (b"d", "sonar_1      data 0.5 s late"),
        (b"ddd", "sonar_1      data on time"),
        (b"\x1b[A\x1b[Ar", "tether       restarts"),
        (b"f", "tether       count frozen"),
        (b"f", "tether       counts again"),
        (b"b", "all devices  data held back for 1.3 s"),
    ] {
        screen.press(key);
        screen.until(shown);
    }
    screen.press(b"q");
    let (code, shown) = screen.end();
    assert_eq!(code, Some(0), "{shown}");
    assert!(screen.is_in_order(), "the terminal is as before");
    let mut screen = emulate();
    screen.until("chosen");
    screen.signal(Signal::TERM);
    assert_eq!(screen.end().0, Some(0));
    assert!(screen.is_in_order());
}
