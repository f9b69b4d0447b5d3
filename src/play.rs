//! A replay that people watch: from where it begins, and what they say by lines on standard input.

use std::io::BufRead;
use std::path::{Path, PathBuf};
use std::time::Duration;

use crossbeam::channel::{Sender, unbounded};
use headrace_geometry::time::{DurNs, MonoNs};
use headrace_monitor::outlet::NoticeReceiver;
use headrace_monitor::report::Report;
use headrace_monitor::run::Loop;
use headrace_replay::drive::Pace;
use headrace_replay::playback::{Playback, Watcher, Wish};
use headrace_replay::player::Player;
use headrace_replay::states::{States, identity, log_identity};
use headrace_vehicle::VehicleConfig;

use crate::cli::{COMMANDS, speed, time};
use crate::dive::Dive;
use crate::failure::Failure;
use crate::watch::Watch;

/// From one state to the next it takes so long to replay: with what a jump takes besides, well under a second.
const BETWEEN_STATES: Duration = Duration::from_millis(300);

/// How a replay is watched.
pub(crate) struct Playing {
    pub(crate) from: Option<DurNs>,
    pub(crate) interactive: bool,
    pub(crate) states: States,
    pub(crate) pace: Pace,
}

/// The states of a dive, in the file beside its log; where there can be none, for this replay alone.
pub(crate) fn states(
    log: &Path,
    files: &[PathBuf],
    vehicle: &VehicleConfig,
    text: &str,
) -> Result<States, Failure> {
    let program = std::env::current_exe()
        .map_err(|source| Failure::System { what: "finding this program's file", source })?;
    let attached = format!("{:?}", vehicle.attachments);
    let mission = format!("{:?}", vehicle.mission());
    let logs: Result<Vec<[u8; 8]>, _> =
        files.iter().map(|file| log_identity(file).map(u64::to_le_bytes)).collect();
    let logs = logs?;
    let settings = [logs.as_flattened(), text.as_bytes(), attached.as_bytes(), mission.as_bytes()];
    let identity = identity(&[&program], &settings)?;
    // Beside a folder of parts, not in it.
    let mut path = log.components().collect::<PathBuf>().into_os_string();
    path.push(".states");
    match States::open(&PathBuf::from(path), identity) {
        Ok(states) => Ok(states),
        Err(error) => {
            eprintln!("headrace: {error}; states are kept for this replay alone");
            Ok(States::temporary()?)
        }
    }
}

impl Playing {
    /// Plays a dive, shows what happens, and gives the report.
    pub(crate) fn play(self, dive: Dive, player: &mut Player, watch: &mut Watch) -> Result<Report, Failure> {
        let Self { from, interactive, states, pace } = self;
        dive.play(watch, |armed, notices, watch| {
            let (to_say, wishes) = unbounded();
            let mut shown = Shown { notices, watch, begun: MonoNs(0) };
            let mut playback = Playback::new(armed, player, states, pace, BETWEEN_STATES)?;
            shown.begun = playback.begun();
            if let Some(from) = from {
                playback.seek(shown.begun + from, &mut shown)?;
            }
            if interactive {
                listen(to_say, shown.begun);
            } else {
                drop(to_say);
            }
            Ok(playback.play(&wishes, &mut shown)?)
        })
    }
}

/// What a person sees of it.
struct Shown<'a> {
    notices: &'a NoticeReceiver,
    watch: &'a mut Watch,
    begun: MonoNs,
}

impl Watcher for Shown<'_> {
    fn ticked(&mut self, dive: &Loop) {
        while let Some(notice) = self.notices.next() {
            self.watch.notice(&notice, dive);
        }
    }

    fn passed(&mut self, _: &Loop) {
        while self.notices.next().is_some() {}
    }

    fn stands(&mut self, dive: &Loop, at: MonoNs, ended: bool) {
        self.watch.stands(dive, at.since(self.begun), ended);
    }
}

/// Reads wishes from standard input, on a thread that ends with it.
fn listen(to: Sender<Wish>, begun: MonoNs) {
    std::thread::spawn(move || {
        for line in std::io::stdin().lock().lines().map_while(Result::ok) {
            match wish(&line, begun) {
                Ok(wish) => {
                    if to.send(wish).is_err() {
                        return;
                    }
                }
                Err(why) => eprintln!("headrace: {why}"),
            }
        }
    });
}

/// What a line wishes.
fn wish(line: &str, begun: MonoNs) -> Result<Wish, String> {
    let mut words = line.split_whitespace();
    let (word, argument) = (words.next().unwrap_or_default(), words.next());
    let unknown = || format!("{:?} isn't understood; there are {COMMANDS}", line.trim());
    let moment = || argument.ok_or_else(unknown).and_then(time);
    let wish = match (word, argument) {
        ("pause", None) => Wish::Pause,
        ("go", None) => Wish::Go,
        ("end", None) => Wish::End,
        ("step", None) => Wish::Step(1),
        ("step", Some(ticks)) => Wish::Step(ticks.parse().map_err(|_| unknown())?),
        ("speed", Some(text)) => Wish::Speed(speed(text)?.0),
        ("seek", _) => Wish::Seek(begun + moment()?),
        ("ahead", _) => Wish::Skip(moment()?),
        ("back", _) => Wish::Skip(DurNs(-moment()?.0)),
        _ => return Err(unknown()),
    };
    if words.next().is_some() { Err(unknown()) } else { Ok(wish) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_wishes_or_refused_with_what_there_is() {
        let wish = |line| wish(line, MonoNs(5));
        assert_eq!(wish(" step 12 "), Ok(Wish::Step(12)));
        assert_eq!(wish("seek 10s"), Ok(Wish::Seek(MonoNs(10_000_000_005))));
        assert_eq!(wish("back 1min"), Ok(Wish::Skip(DurNs(-60_000_000_000))));
        assert_eq!(wish("speed max"), Ok(Wish::Speed(None)));
        for line in ["", "stop", "step -1", "seek", "pause 5", "go go", "step 1 2"] {
            assert!(wish(line).is_err(), "{line:?}");
        }
        insta::assert_snapshot!(wish("stop").unwrap_err(), @r#""stop" isn't understood; there are pause, go, step [TICKS], seek TIME, ahead TIME, back TIME, speed N|max, end"#);
    }
}
