//! `headrace run --resume`: continues a dive whose recording did not end in order.

use std::path::{Path, PathBuf};

use headrace_geometry::time::{DurNs, MonoNs};
use headrace_replay::log::{Interrupted, LogInfo, Unfinished};
use headrace_replay::rebuild::Rebuild;
use headrace_replay::saved_state::SavedState;
use headrace_vehicle::VehicleConfig;

use crate::cli::Run;
use crate::dive::{BOOT, CLOCK_ANCHOR, Dive, boot_id, silent};
use crate::failure::Failure;
use crate::interruption::Interruption;
use crate::outputs::SIMULATED;

/// Longest interruption after which a dive is continued without being named, seconds.
const LONGEST_S: f64 = 12.0 * 3600.0;
/// Shortest interruption that is assumed if the clocks show none.
const SHORTEST: DurNs = DurNs(1_000_000_000);

/// An interrupted dive that is to be continued.
pub(crate) struct Resuming {
    /// The recordings of the dive, in the order of `--record`.
    pub(crate) recordings: Vec<Interrupted>,
    /// Time without data.
    pub(crate) gap: DurNs,
}

impl Resuming {
    /// The dive that the arguments ask to continue. `None` for a new dive.
    ///
    /// Errors: a dive did not end in order, and the arguments don't say what to do; or the dive can't be continued.
    pub(crate) fn of(args: &Run, logs: &[PathBuf], vehicle_text: &str) -> Result<Option<Self>, Failure> {
        if args.new || args.no_record {
            return Ok(None);
        }
        let mut found = Vec::new();
        for log in logs {
            found.extend(unfinished(args, log)?.map(|recording| (log, recording)));
        }
        let Some((_, first)) = found.first() else {
            return named_is_complete(args).map_or(Ok(None), Err);
        };
        let shown = first.display();
        if args.resume.is_none() {
            return Err(Failure::Usage(format!(
                "run: the last dive, {shown}, did not end in order; --resume continues it in a further part, --new begins \
                 another dive"
            )));
        }
        if found.len() < logs.len() {
            return Err(Failure::Usage(format!(
                "run --resume: {shown} can be continued, but one of the other recordings can't; give --record only for those \
                 that can, or --new"
            )));
        }
        let recordings =
            found.iter().map(|(_, recording)| Unfinished::read(recording)).collect::<Result<Vec<_>, _>>()?;
        Self::continuing(recordings.into_iter().flatten().collect(), vehicle_text).map(Some)
    }

    fn continuing(recordings: Vec<Unfinished>, vehicle_text: &str) -> Result<Self, Failure> {
        let Some(longest) = recordings.iter().max_by_key(|recording| recording.last) else {
            return Err(Failure::Usage("run --resume: the recording has no data yet; use --new".to_owned()));
        };
        let shown = longest.recording.display();
        let recorded = longest.info.vehicle_toml.as_deref().unwrap_or_default();
        if !is_same_vehicle(recorded, vehicle_text) {
            return Err(Failure::Usage(format!(
                "run --resume: {shown} was recorded with another vehicle file (only lines with connect may differ); give that \
                 file, or begin another dive with --new"
            )));
        }
        let gap = set_clock(longest);
        let to = longest.last + gap;
        let stated = |recording: Unfinished| {
            let words = format!(
                "the program was stopped while it recorded {}; its last second may be missing, and {:.0} s until it \
                 recorded again",
                recording.last_part().display(),
                to.since(recording.last).as_secs_f64(),
            );
            Interrupted { recording, to, words }
        };
        Ok(Self { gap, recordings: recordings.into_iter().map(stated).collect() })
    }

    /// Data about the interruption for the dive that goes on.
    pub(crate) fn interruption(&self) -> Interruption {
        Interruption {
            gap: self.gap,
            span: self.longest().and_then(|longest| longest.recording.span),
            words: self.words(),
            losses: self.recordings.iter().map(|interrupted| interrupted.loss().to_string()).collect(),
        }
    }

    /// Text about the dive that is continued.
    pub(crate) fn words(&self) -> String {
        let recordings = self.recordings.iter();
        let pair = |of: &Interrupted| {
            format!("{} in {}", of.recording.recording.display(), of.recording.next_path().display())
        };
        let all: Vec<String> = recordings.map(pair).collect();
        format!(
            "the dive is continued after {:.0} s without data: {}",
            self.gap.as_secs_f64(),
            all.join(", ")
        )
    }

    /// The recording that has the most data.
    pub(crate) fn longest(&self) -> Option<&Interrupted> {
        self.recordings.iter().max_by_key(|interrupted| interrupted.recording.last)
    }

    /// Begins to rebuild the dive's state, and makes the loop of `dive` only record until then.
    ///
    /// Errors: the log can't be opened, or the loop can't be armed.
    pub(crate) fn begin(&self, vehicle: &VehicleConfig, dive: &mut Dive) -> Result<Rebuild, Failure> {
        let next_tick = self.recordings.iter().map(|interrupted| interrupted.recording.next_tick()).max();
        dive.armed.hold(next_tick.unwrap_or(0));
        let files = self.longest().map(|longest| longest.recording.files.clone()).unwrap_or_default();
        // States are saved beside the first recording.
        let first = self.recordings.first().map(|first| SavedState::path(&first.recording.recording));
        Ok(Rebuild::start(silent(vehicle)?, files, first.unwrap_or_default())?)
    }

    /// Paths that name the recordings.
    pub(crate) fn paths(&self) -> Vec<PathBuf> {
        self.recordings.iter().map(|interrupted| interrupted.recording.recording.clone()).collect()
    }
}

/// The recording that a dive recorded to `log` would continue.
fn unfinished(args: &Run, log: &Path) -> Result<Option<PathBuf>, Failure> {
    let named = args.resume.clone().flatten();
    if let Some(named) = named.filter(|_| args.record.len() < 2) {
        return Ok(Unfinished::read(&named)?.map(|recording| recording.recording));
    }
    let folder = log.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    if !folder.is_dir() {
        return Ok(None);
    }
    let last = Unfinished::last_in(folder, &is_no_live_dive)?;
    // A dive of another day isn't continued by a service that starts anew.
    Ok(last.filter(|recording| interruption_s(recording).is_none_or(|seconds| seconds < LONGEST_S)))
}

/// Error if `--resume` names a recording that can't be continued.
fn named_is_complete(args: &Run) -> Option<Failure> {
    let named = args.resume.clone().flatten()?;
    Some(Failure::Usage(format!(
        "run --resume: {} can't be continued: it ended in order, has no data, or another program is recording to it; begin \
         another dive with --new",
        named.display()
    )))
}

/// Time since a recording was last written to, by the file system, seconds; `None` if unknown.
fn interruption_s(recording: &Path) -> Option<f64> {
    let files = headrace_replay::log::files_of(&[recording.to_owned()]).ok()?;
    let modified = files.iter().filter_map(|file| file.metadata().ok()?.modified().ok()).max()?;
    let (_, utc) = headrace_ports::clock_anchor();
    let since_1970_s = modified.duration_since(std::time::UNIX_EPOCH).ok()?.as_secs_f64();
    Some(utc.0 as f64 / 1e9 - since_1970_s)
}

/// Whether a log isn't the recording of a live dive.
fn is_no_live_dive(info: &LogInfo) -> bool {
    info.metadata.contains_key(SIMULATED) || !info.metadata.contains_key(CLOCK_ANCHOR[0])
}

/// Whether two vehicle files differ at most in the connections of the sensors.
fn is_same_vehicle(one: &str, other: &str) -> bool {
    let lines = |text: &str| -> Vec<String> {
        let lines = text.lines().map(str::trim).filter(|line| !line.starts_with("connect"));
        lines.map(str::to_owned).collect()
    };
    lines(one) == lines(other)
}

/// Sets the dive's clock so that it continues the clock of the interrupted dive. Returns the time without data.
fn set_clock(dive: &Unfinished) -> DurNs {
    let number = |key: &str| -> Option<i64> { dive.info.metadata.get(key)?.parse().ok() };
    let is_same_boot = boot_id().is_some() && dive.info.metadata.get(BOOT[0]) == boot_id().as_ref();
    let (host, utc) = headrace_ports::clock_anchor();
    let [of_clock, of_utc] = CLOCK_ANCHOR.map(number);
    let since_anchor = of_clock.map_or(0, |anchor| dive.last.0.cast_signed() - anchor);
    let by_utc = of_utc.map(|then| DurNs(utc.0 - then - since_anchor));
    let is_plausible = |gap: &DurNs| gap.0 > 0 && gap.as_secs_f64() < LONGEST_S;
    let ahead = number(BOOT[1]).unwrap_or(0);
    let gap = if is_same_boot {
        DurNs(host.0.cast_signed() + ahead - dive.last.0.cast_signed())
    } else {
        // Without a valid UTC, the computer was off for an unknown time before it ran for that of its clock.
        by_utc.filter(is_plausible).unwrap_or(host.since(MonoNs(0)))
    };
    let gap = DurNs(gap.0.max(SHORTEST.0));
    headrace_ports::set_ahead((dive.last + gap).since(host));
    gap
}
