//! The recordings of a dive: their events and their state for all screens.

use std::path::PathBuf;

use headrace_geometry::time::{DiveClock, DurNs, MonoNs};
use headrace_monitor::report::{LogReport, Report};
use headrace_ports::LineRecord;
use headrace_replay::log::{
    LeftOut, LinePort, RecorderHandle, RecordingEvent, RecordingFault, RecordingHealth, Summary, VoicePort,
};
use headrace_replay::player::seconds;

use crate::recording_state::{ALARM_FROM, RecordingState, SHOWN_FROM};
use crate::report_output::files_report;

/// The recorders of a dive.
#[derive(Default)]
pub(crate) struct Recordings {
    all: Vec<One>,
    /// Whether the dive runs on this machine's clock.
    ///
    /// A replayed or simulated dive loses nothing in a power cut, even if minutes of it are unsynced, because it can be
    /// run again.
    is_live: bool,
    unsafe_for: DurNs,
}

struct One {
    path: PathBuf,
    handle: RecorderHandle,
    /// State of the recording; `None` if it has never failed.
    health: Option<RecordingHealth>,
    is_late: bool,
}

impl Recordings {
    pub(crate) fn of(recorders: Vec<(PathBuf, RecorderHandle)>, is_live: bool) -> Self {
        let one = |(path, handle)| One { path, handle, health: None, is_late: false };
        Self { all: recorders.into_iter().map(one).collect(), is_live, unsafe_for: DurNs(0) }
    }

    /// Takes the recordings' events since the last call. Call this function after every tick.
    pub(crate) fn news(&mut self) -> Vec<RecordingEvent> {
        let mut news = Vec::new();
        self.unsafe_for = DurNs(0);
        for one in &mut self.all {
            while let Some(event) = one.handle.next_event() {
                one.health.get_or_insert_default().take(&event);
                news.push(event);
            }
            if self.is_live {
                let unsafe_for = one.handle.unsafe_for();
                self.unsafe_for = self.unsafe_for.max(unsafe_for);
                news.extend(one.late(unsafe_for));
            }
        }
        news
    }

    /// State of all recordings together, for the screens.
    pub(crate) fn state(&self) -> RecordingState {
        let fails = self.all.iter().filter_map(One::fails).reduce(|one, other| one | other);
        let unsafe_s = self.unsafe_for.0.max(0).unsigned_abs() / 1_000_000_000;
        RecordingState { fails, unsafe_s, rebuilt_pct: None }
    }

    /// Length of the dive that a power cut would lose now. If recordings differ, the largest of their lengths.
    pub(crate) fn unsafe_for(&self) -> DurNs {
        self.unsafe_for
    }

    /// Whether a recording fails, or would lose the last seconds of the dive in a power cut.
    pub(crate) fn is_alarm(&self) -> bool {
        self.all.iter().any(|one| one.is_late || one.fails() == Some(true))
    }

    /// Handles by which port threads record device traffic that doesn't pass through the loop.
    pub(crate) fn line_ports(&self) -> Vec<LinePort> {
        self.all.iter().map(|one| one.handle.line_port()).collect()
    }

    /// Handles by which other threads add the audio of voice notes to each log.
    pub(crate) fn voice_ports(&self) -> Vec<VoicePort> {
        self.all.iter().map(|one| one.handle.voice_port()).collect()
    }

    /// Tells all recordings to end without an end mark. A log without an end mark can be continued.
    pub(crate) fn abandon(&mut self) {
        self.all.iter_mut().for_each(|one| one.handle.begin_to_abandon());
    }

    /// Ends all recordings at the same time.
    ///
    /// The result has the files of the first recording and the losses of all, with dive times. If a medium is missing, the
    /// other recordings still end.
    pub(crate) fn end(mut self, report: &Report, clock: DiveClock) -> Option<LogReport> {
        self.all.iter_mut().for_each(|one| one.handle.begin_to_end(self.is_live));
        let (mut log, several): (Option<LogReport>, _) = (None, self.all.len() > 1);
        for One { path, handle, .. } in self.all {
            let written = handle.finish();
            let mut losses = match &written {
                Err(error) => vec![format!("recording failed: {error}")],
                Ok(written) => unrecorded(written, clock),
            };
            if several {
                for loss in &mut losses {
                    *loss = format!("{}: {loss}", path.display());
                }
            }
            if let Some(log) = &mut log {
                log.notes.push(format!("also recorded to {}", path.display()));
                log.losses.extend(losses);
                continue;
            }
            let parts = written.map(|written| written.parts).unwrap_or_default();
            let parts: Vec<_> = parts.iter().map(|part| (part.path.as_path(), part.raw_messages)).collect();
            let mut files = files_report(&path, &parts);
            let of_console = report.console.map_or(0, |console| console.packets);
            files.messages = of_console + report.sources.iter().map(|source| source.packets).sum::<u64>();
            files.losses.splice(0..0, losses);
            log = Some(files);
        }
        log
    }
}

impl One {
    /// Whether the recording is failing at present; `None` if it has never failed.
    fn fails(&self) -> Option<bool> {
        self.health.as_ref().map(RecordingHealth::fails)
    }

    /// The event to report if the recording has just fallen behind or caught up.
    fn late(&mut self, unsafe_for: DurNs) -> Option<RecordingEvent> {
        let is_late = unsafe_for >= if self.is_late { SHOWN_FROM } else { ALARM_FROM };
        let has_changed = core::mem::replace(&mut self.is_late, is_late) != is_late;
        let path = || self.path.clone();
        has_changed.then(|| {
            if is_late {
                RecordingEvent::Late { path: path(), by: unsafe_for }
            } else {
                RecordingEvent::InTime { path: path() }
            }
        })
    }
}

/// Texts about data missing in a recording, and about errors while it was recorded.
fn unrecorded(written: &Summary, clock: DiveClock) -> Vec<String> {
    let mut losses: Vec<String> = written.faults.iter().map(|one| fault(one, clock)).collect();
    let left = Some(written.left_out).filter(|left| left.messages > 0);
    losses.extend(left.map(|left| left_out(left, clock)));
    let counts = [
        (written.sent_dropped, "messages to devices not recorded: the recorder's queue was full"),
        (written.skipped, "packets not recorded: the recorder was behind"),
        (written.results_missing, "ticks recorded with some results missing: too many results"),
    ];
    losses
        .extend(counts.iter().filter(|(count, _)| *count > 0).map(|(count, what)| format!("{count} {what}")));
    losses
}

/// Text about an error of the recording, with dive times.
fn fault(fault: &RecordingFault, clock: DiveClock) -> String {
    let from = fault.from.map(|from| format!(", after {}", seconds(from, clock)));
    let to = fault.to.map(|to| format!(", before {}", seconds(to, clock)));
    [fault.words(), from.unwrap_or_default(), to.unwrap_or_default()].concat()
}

/// Text about data that the recorder has dropped, with dive times.
fn left_out(left: LeftOut, clock: DiveClock) -> String {
    let span = left.span.map(|(from, to)| format!(", {} to {}", seconds(from, clock), seconds(to, clock)));
    format!("{}{}", left.words(), span.unwrap_or_default())
}

/// All recordings of a dive, as the destination of device traffic that doesn't pass through the loop.
pub struct InRecordings(pub Vec<LinePort>);

impl LineRecord for InRecordings {
    fn sent(&self, sensor: usize, at: MonoNs, bytes: &[u8]) {
        self.0.iter().for_each(|port| port.sent(source(sensor), at, bytes));
    }

    fn lost(&self, sensor: usize, from: MonoNs, to: MonoNs, packets: u64) {
        self.0.iter().for_each(|port| port.lost(source(sensor), from, to, packets));
    }
}

/// Number of a sensor's packet source in the log.
fn source(sensor: usize) -> u16 {
    u16::try_from(sensor).unwrap_or(u16::MAX)
}
