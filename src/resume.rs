//! `headrace run --resume`: continues a dive whose recording did not end in order.

use std::cmp::Reverse;
use std::path::{Path, PathBuf};

use headrace_geometry::time::{DiveClock, DurNs, MonoNs};
use headrace_replay::clocks::clock_of;
use headrace_replay::log::{
    Interrupted, LogInfo, RECOVERED_FROM, TRIMMED, Unfinished, files_of, in_the_way, named_part,
};
use headrace_replay::rebuild::Rebuild;
use headrace_replay::saved_state::SavedState;
use headrace_vehicle::VehicleConfig;

use crate::cli::{LAST, Run};
use crate::dive::{BOOT, CLOCK_ANCHOR, Dive, boot_id, silent};
use crate::failure::Failure;
use crate::interruption::Interruption;
use crate::outputs::SIMULATED;

/// Longest interruption after which a dive is continued without its path on the command line, seconds.
const LONGEST_S: f64 = 12.0 * 3600.0;
/// Longest interruption that UTC may show after a reboot, seconds. If UTC shows a longer one, the clock was probably
/// set.
const LONGEST_BY_UTC_S: f64 = 30.0 * 86_400.0;
/// Interruption that is assumed if the clocks show no interruption.
const SHORTEST: DurNs = DurNs(1_000_000_000);

/// An interrupted dive that is to be continued.
pub(crate) struct Resuming {
    /// The recordings of the dive, beginning with the one that has the most data.
    pub(crate) recordings: Vec<Interrupted>,
    /// Time without data.
    pub(crate) gap: DurNs,
    /// Clock of the interrupted dive, which the continued dive keeps.
    clock: DiveClock,
    /// Paths at which the dive isn't recorded any more, because their folder is gone.
    gone: Vec<PathBuf>,
}

impl Resuming {
    /// The dive that the arguments ask to continue. `None` for a new dive.
    ///
    /// Errors: a dive did not end in order, and the arguments don't state whether to continue it; or the dive can't be
    /// continued.
    pub(crate) fn of(
        args: &Run,
        logs: &[PathBuf],
        vehicle: (&VehicleConfig, &str),
    ) -> Result<Option<Self>, Failure> {
        if args.new || args.no_record {
            return Ok(None);
        }
        if let Some(named) = args.resume.as_deref().filter(|named| *named != Path::new(LAST)) {
            return Self::continuing(vec![named_recording(args, named)?], vehicle).map(Some);
        }
        let found = logs.iter().map(|log| unfinished(log)).collect::<Result<Vec<_>, _>>()?;
        let Some(first) = found.iter().flatten().next().map(|first| first.display()) else { return Ok(None) };
        if args.resume.is_none() {
            return Err(Failure::Usage(format!(
                "run: the last dive, {first}, did not end in order; --resume continues it in a further part, --new begins \
                 another dive"
            )));
        }
        let read = |found: &PathBuf| Unfinished::read(found);
        let mut recordings = found.iter().flatten().map(read).collect::<Result<Vec<_>, _>>()?;
        if recordings.iter().any(Option::is_none) {
            // Two paths led to the same recording, or another program has just continued a recording.
            return Err(Failure::Usage(format!(
                "run --resume: {first} can be continued only once at a time; give --record once, or the paths of the recordings"
            )));
        }
        // Another medium of the dive may have been replaced, or may be gone.
        let missing =
            logs.iter().zip(&found).filter(|(_, found)| found.is_none()).map(|(log, _)| log.clone());
        let (present, gone): (Vec<PathBuf>, Vec<PathBuf>) = missing.partition(|log| folder_of(log).is_dir());
        let longest = recordings.iter().flatten().max_by_key(|recording| recording.last).cloned();
        for (log, longest) in present.iter().zip(longest.iter().cycle()) {
            recordings.push(Some(longest.at(log).ok_or_else(|| not_replaced(log))?));
        }
        let resuming = Self::continuing(recordings.into_iter().flatten().collect(), vehicle)?;
        Ok(Some(Self { gone, ..resuming }))
    }

    fn continuing(
        mut recordings: Vec<Unfinished>,
        (vehicle, text): (&VehicleConfig, &str),
    ) -> Result<Self, Failure> {
        // The report and the rebuilt state come from the first recording, so the one with the latest data is put first.
        recordings.sort_by_key(|recording| Reverse(recording.last));
        let Some(longest) = recordings.first() else {
            return Err(Failure::Usage(
                "run --resume: another program has just continued the dive".to_owned(),
            ));
        };
        let shown = longest.recording.display();
        if let Some(other) = recordings.iter().find(|other| other.dive != longest.dive) {
            let other = other.recording.display();
            return Err(Failure::Usage(format!(
                "run --resume: {shown} and {other} are recordings of different dives; continue one of them with --resume=PATH"
            )));
        }
        if !is_same_vehicle(&longest.info, vehicle, text) {
            return Err(Failure::Usage(format!(
                "run --resume: {shown} was recorded with another vehicle file (only lines with connect may differ); give that \
                 file, or begin another dive with --new"
            )));
        }
        let gap = set_clock(longest);
        let to = longest.last + gap;
        let clock = clock_of_first(&longest.files);
        let last_part = longest.last_part().display().to_string();
        let stated = |recording: Unfinished| {
            let seconds = to.since(recording.last).as_secs_f64();
            let words = match recording.files.last() {
                Some(last) => format!(
                    "the program was stopped while it recorded {}; its last second may be missing, and {seconds:.0} s until \
                     it recorded again",
                    last.display(),
                ),
                None => format!(
                    "the recording begins within a dive whose earlier parts are elsewhere, the last in {last_part}; {seconds:.0} s \
                     of the dive were not recorded"
                ),
            };
            Interrupted { recording, to, words }
        };
        Ok(Self { gap, clock, recordings: recordings.into_iter().map(stated).collect(), gone: Vec::new() })
    }

    /// Data about the interruption, for the continued dive.
    pub(crate) fn interruption(&self) -> Interruption {
        Interruption {
            gap: self.gap,
            span: self.recordings.first().and_then(|first| first.recording.span),
            words: self.words(),
            losses: self.losses(),
        }
    }

    /// Losses that the interruption caused, as text.
    fn losses(&self) -> Vec<String> {
        let interruptions = self.recordings.iter().map(|interrupted| interrupted.loss_text(self.clock));
        interruptions.chain(self.gone.iter().map(|log| gone_text(log))).collect()
    }

    /// Text about the dive that is continued.
    pub(crate) fn words(&self) -> String {
        let recordings = self.recordings.iter();
        let pair = |of: &Interrupted| {
            format!("{} in {}", of.recording.recording.display(), of.recording.next_path().display())
        };
        let all: Vec<String> =
            recordings.map(pair).chain(self.gone.iter().map(|log| gone_text(log))).collect();
        format!(
            "the dive is continued after {:.0} s without data: {}",
            self.gap.as_secs_f64(),
            all.join(", ")
        )
    }

    /// Begins to rebuild the dive's state, and makes the loop of `dive` only record until then.
    ///
    /// Errors: the loop can't be armed, or the thread can't be started.
    pub(crate) fn begin(&self, vehicle: &VehicleConfig, dive: &mut Dive) -> Result<Rebuild, Failure> {
        let next_tick = self.recordings.iter().map(|interrupted| interrupted.recording.next_tick()).max();
        dive.armed.hold(next_tick.unwrap_or(0));
        let files = self.recordings.first().map(|first| first.recording.files.clone()).unwrap_or_default();
        // Saved states are beside one of the recordings only, so all recordings are searched.
        let states = self.recordings.iter().map(|of| SavedState::path(&of.recording.recording));
        let state = states.into_iter().find(|path| path.exists()).unwrap_or_default();
        Ok(Rebuild::start(silent(vehicle)?, files, state)?)
    }

    /// Paths that name the recordings, as after `--record`.
    pub(crate) fn paths(&self) -> Vec<PathBuf> {
        self.recordings.iter().map(|interrupted| interrupted.recording.recording.clone()).collect()
    }
}

/// The recording that `--resume=PATH` names.
///
/// Errors: the recording can't be continued, or there are several recordings.
fn named_recording(args: &Run, named: &Path) -> Result<Unfinished, Failure> {
    let shown = named.display();
    if args.record.len() > 1 || named.is_dir() {
        return Err(Failure::Usage(format!(
            "run --resume={shown}: expected one recording; with --record twice, write --resume without a path"
        )));
    }
    let recording = named_part(named).map_or_else(|| named.to_owned(), |(recording, _)| recording);
    Unfinished::read(&recording)?.ok_or_else(|| {
        let why = if named.exists() {
            "it ended in order, has no data, or another program is recording to it"
        } else {
            "there is no such file"
        };
        Failure::Usage(format!(
            "run --resume: {shown} can't be continued: {why}; begin another dive with --new"
        ))
    })
}

/// Error if the files at a path can't be continued, although they belong to the dive that is to be continued.
fn not_replaced(log: &Path) -> Failure {
    let log = log.display();
    Failure::Usage(format!(
        "run --resume: the recording of this dive at {log} ended in order, or another program is recording to it; give --record \
         only for recordings that can be continued, or --new"
    ))
}

/// Text about a recording that isn't continued, because its medium is gone.
fn gone_text(log: &Path) -> String {
    format!("{} is NOT CONTINUED: its folder is gone", log.display())
}

/// The folder of a log.
fn folder_of(log: &Path) -> &Path {
    log.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// The recording that a dive recorded to `log` would continue: `log` itself, or the last one in its folder.
fn unfinished(log: &Path) -> Result<Option<PathBuf>, Failure> {
    let folder = folder_of(log);
    if !folder.is_dir() {
        return Ok(None);
    }
    if !in_the_way(log).unwrap_or_default().is_empty() && Unfinished::is_at(log)? {
        return Ok(Some(log.to_owned()));
    }
    let last = Unfinished::last_in(folder, &is_no_live_dive)?;
    // A service that is started again must not continue a dive of another day.
    Ok(last.filter(|recording| interruption_s(recording).is_none_or(|seconds| seconds < LONGEST_S)))
}

/// Time since a recording was last written to, by the file system, seconds; `None` if unknown.
fn interruption_s(recording: &Path) -> Option<f64> {
    let files = files_of(&[recording.to_owned()]).ok()?;
    let modified = files.iter().filter_map(|file| file.metadata().ok()?.modified().ok()).max()?;
    let (_, utc) = headrace_ports::clock_anchor();
    let since_1970_s = modified.duration_since(std::time::UNIX_EPOCH).ok()?.as_secs_f64();
    Some(utc.0 as f64 / 1e9 - since_1970_s)
}

/// Whether a log isn't the recording of a live dive.
fn is_no_live_dive(info: &LogInfo) -> bool {
    let is_changed = [SIMULATED, RECOVERED_FROM, TRIMMED].iter().any(|key| info.metadata.contains_key(*key));
    is_changed || !info.metadata.contains_key(CLOCK_ANCHOR[0])
}

/// Whether a log was recorded with this vehicle file and the files that it names. The connections of the sensors may
/// differ.
fn is_same_vehicle(recorded: &LogInfo, vehicle: &VehicleConfig, text: &str) -> bool {
    let lines = |text: &str| -> Vec<String> {
        let lines = text.lines().map(str::trim).filter(|line| !line.starts_with("connect"));
        lines.map(str::to_owned).collect()
    };
    let attached = |(name, text): &(String, String)| {
        let found = recorded.attachments.iter().find(|(other, _)| other == name);
        found.is_some_and(|(_, bytes)| bytes == text.as_bytes())
    };
    lines(recorded.vehicle_toml.as_deref().unwrap_or_default()) == lines(text)
        && vehicle.attachments.iter().all(attached)
}

/// The clock of a dive. The clock starts in the first part that has a packet of a sensor, so later parts aren't opened.
fn clock_of_first(files: &[PathBuf]) -> DiveClock {
    let clock = |file: &PathBuf| clock_of(std::slice::from_ref(file)).ok();
    files.iter().filter_map(clock).find(|clock| clock.zero().is_some()).unwrap_or_default()
}

/// Sets the dive's clock so that it continues the clock of the interrupted dive. Returns the time without data.
fn set_clock(dive: &Unfinished) -> DurNs {
    let number = |key: &str| -> Option<i64> { dive.info.metadata.get(key)?.parse().ok() };
    let is_same_boot = boot_id().is_some() && dive.info.metadata.get(BOOT[0]) == boot_id().as_ref();
    let (host, utc) = headrace_ports::clock_anchor();
    let [of_clock, of_utc] = CLOCK_ANCHOR.map(number);
    let since_anchor = of_clock.map_or(0, |anchor| dive.last.0.cast_signed() - anchor);
    let by_utc = of_utc.map(|then| DurNs(utc.0 - then - since_anchor));
    let is_plausible = |gap: &DurNs| gap.0 > 0 && gap.as_secs_f64() < LONGEST_BY_UTC_S;
    let since_boot = host.since(MonoNs(0));
    let ahead = number(BOOT[1]).unwrap_or(0);
    let gap = if is_same_boot {
        DurNs(host.0.cast_signed() + ahead - dive.last.0.cast_signed())
    } else {
        // The time without data is at least the time since the reboot, even if UTC was set back meanwhile.
        by_utc.filter(is_plausible).map_or(since_boot, |gap| DurNs(gap.0.max(since_boot.0)))
    };
    let gap = DurNs(gap.0.max(SHORTEST.0));
    headrace_ports::set_ahead((dive.last + gap).since(host));
    gap
}
