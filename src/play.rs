//! `replay --from` and `replay --interactive`: playback, controlled by keys in a terminal or by lines on
//! standard input.

mod keys;

use std::io::{BufRead, IsTerminal as _};
use std::time::Duration;

use crossbeam::channel::{Receiver, Sender};
use headrace_geometry::time::{DiveClock, DurNs, MonoNs};
use headrace_monitor::notice_outlet::NoticeReceiver;
use headrace_monitor::report::Report;
use headrace_monitor::run::Loop;
use headrace_replay::drive::Pace;
use headrace_replay::playback::{Playback, PlaybackCommand, PlaybackObserver};
use headrace_replay::player::Player;
use headrace_replay::snapshot_store::SnapshotStore;

use crate::cli::{COMMANDS, speed, time};
use crate::dive::Dive;
use crate::failure::Failure;
use crate::logging::complain;
use crate::output::aside;
use crate::watch::Watch;
pub(crate) use keys::{Hand, Key};

/// Computing time between two snapshots of the loop. A jump thus takes well under a second, including the
/// time to restore a snapshot.
const SNAPSHOT_INTERVAL: Duration = Duration::from_millis(300);
/// Memory for snapshots, bytes. When it is full, every second snapshot is dropped and the interval is doubled.
const SNAPSHOT_BYTES: usize = 256 << 20;

/// Controllers of playback besides standard input, such as the page or a full-screen terminal.
///
/// Each controller has a sender of commands. Playback continues as long as there is a sender.
pub(crate) struct Directors {
    /// Whether one of the controllers reads the terminal's keys.
    pub(crate) takes_keys: bool,
    /// Function that drops a controller's sender at the end of the log; `None` if the controller stays.
    pub(crate) close: Option<Box<dyn Fn()>>,
}

/// A replay with `--from` or `--interactive`, or with a page.
pub(crate) struct Playing {
    pub(crate) from: Option<DurNs>,
    pub(crate) interactive: bool,
    pub(crate) pace: Pace,
    pub(crate) commands: (Sender<PlaybackCommand>, Receiver<PlaybackCommand>),
    /// Controllers besides standard input.
    pub(crate) others: Option<Directors>,
}

impl Playing {
    /// Plays a recorded dive, and returns its report.
    pub(crate) fn play(self, dive: Dive, player: &mut Player, watch: &mut Watch) -> Result<Report, Failure> {
        let Self { from, interactive, pace, commands: (sender, commands), others } = self;
        // Without commands playback never jumps back, so no snapshots are needed.
        let interval = if interactive || others.is_some() { SNAPSHOT_INTERVAL } else { Duration::MAX };
        dive.play(watch, |armed, notices, watch| {
            let interactive = interactive && !others.as_ref().is_some_and(|others| others.takes_keys);
            let close = others.and_then(|others| others.close);
            let has_keys = interactive && has_keys();
            let mut screen = Screen { notices, watch, clock: DiveClock::default(), has_keys, close };
            let store = SnapshotStore::new(SNAPSHOT_BYTES, interval);
            let mut playback = Playback::new(armed, player, store, pace)?;
            screen.clock = playback.dive_clock();
            if let Some(from) = from {
                // The jump is a command, so that followers (such as the page) show the state after it, as after any
                // other jump. Sending can't fail, because the receiver lives as long as this function.
                let _received = sender.send(PlaybackCommand::Seek(screen.clock.timestamp(from)));
            }
            screen.watch.mode(false, pace.speed);
            // A terminal gives single keys; a pipe or a file gives lines.
            let keyboard = match interactive {
                true if has_keys => Some(keys::listen(sender, pace.speed)?),
                true => {
                    listen(sender, screen.clock);
                    None
                }
                false => {
                    drop(sender);
                    None
                }
            };
            let played = playback.play(&commands, &mut screen);
            drop(keyboard);
            Ok(played?)
        })
    }
}

/// Whether single keys are read. That requires a terminal as standard input.
pub(crate) fn has_keys() -> bool {
    std::io::stdin().is_terminal()
}

/// Shows playback on the terminal.
struct Screen<'a> {
    notices: &'a NoticeReceiver,
    watch: &'a mut Watch,
    clock: DiveClock,
    has_keys: bool,
    /// Function that drops the other controllers' senders at the end of the log.
    close: Option<Box<dyn Fn()>>,
}

impl PlaybackObserver for Screen<'_> {
    fn after_tick(&mut self, dive: &Loop) {
        while let Some(notice) = self.notices.next() {
            self.watch.notice(&notice, dive);
        }
        self.watch.tick(dive);
    }

    fn after_skipped_tick(&mut self, dive: &Loop) {
        while self.notices.next().is_some() {}
        self.watch.skipped(dive);
    }

    fn mode(&mut self, paused: bool, speed: Option<f64>) {
        self.watch.mode(paused, speed);
    }

    fn stopped(&mut self, dive: &Loop, at: MonoNs, ended: bool) {
        self.watch.stopped(dive, self.clock.time(at), ended);
        if let Some(close) = self.close.as_ref().filter(|_| ended) {
            close();
        }
        if ended && self.has_keys {
            aside("END      left and down seek back, q quits");
        }
    }
}

/// Reads commands from standard input on a separate thread, until standard input ends.
fn listen(to: Sender<PlaybackCommand>, clock: DiveClock) {
    std::thread::spawn(move || {
        for line in std::io::stdin().lock().lines().map_while(Result::ok) {
            match command(&line, clock) {
                Ok(command) => {
                    if to.send(command).is_err() {
                        return;
                    }
                }
                Err(why) => complain(&format!("headrace: {why}")),
            }
        }
    });
}

/// Parses a command. Its times are dive times.
fn command(line: &str, clock: DiveClock) -> Result<PlaybackCommand, String> {
    let mut words = line.split_whitespace();
    let (word, argument) = (words.next().unwrap_or_default(), words.next());
    let unknown = || format!("{:?} isn't a command; expected one of: {COMMANDS}", line.trim());
    let moment = || argument.ok_or_else(unknown).and_then(time);
    let command = match (word, argument) {
        ("pause", None) => PlaybackCommand::Pause,
        ("go", None) => PlaybackCommand::Go,
        ("end" | "quit", None) => PlaybackCommand::End,
        ("step", None) => PlaybackCommand::Step(1),
        ("step", Some(ticks)) => PlaybackCommand::Step(ticks.parse().map_err(|_| unknown())?),
        ("speed", Some(text)) => PlaybackCommand::Speed(speed(text)?.0),
        ("seek", _) => PlaybackCommand::Seek(clock.timestamp(moment()?)),
        ("ahead", _) => PlaybackCommand::Skip(moment()?),
        ("back", _) => PlaybackCommand::Skip(DurNs(-moment()?.0)),
        _ => return Err(unknown()),
    };
    if words.next().is_some() { Err(unknown()) } else { Ok(command) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn unknown_playback_command_is_refused_with_the_list_of_commands() {
        let command = |line| command(line, DiveClock::new(Some(MonoNs(5))));
        assert_eq!(command(" step 12 "), Ok(PlaybackCommand::Step(12)));
        assert_eq!(command("seek 10s"), Ok(PlaybackCommand::Seek(MonoNs(10_000_000_005))));
        assert_eq!(command("back 1min"), Ok(PlaybackCommand::Skip(DurNs(-60_000_000_000))));
        assert_eq!(command("speed max"), Ok(PlaybackCommand::Speed(None)));
        for line in ["", "stop", "step -1", "seek", "pause 5", "go go", "step 1 2"] {
            assert!(command(line).is_err(), "{line:?}");
        }
        insta::assert_snapshot!(command("stop").unwrap_err(), @r#""stop" isn't a command; expected one of: pause, go, step [TICKS], seek TIME, ahead TIME, back TIME, speed N|max, end or quit"#);
    }
}
