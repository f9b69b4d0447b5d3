//! Invariants of every dive in a simulated world, whichever faults occur.

use super::dive_result::{Consumed, DiveResult, Line, Replayed};
use super::plan::{CableFault, DiskFault, Ending, LogChange, MachineFault};
use crate::drops;

/// Longest time for which packets may wait while the loop runs, with or without a recording.
const LONGEST_WAIT_NS: i64 = 500_000_000;

/// Lists the invariants that a dive broke, as text.
pub fn broken(lived: &DiveResult, replayed: &Result<Replayed, String>) -> Vec<String> {
    let mut broken: Vec<String> =
        lived.lines.iter().enumerate().filter_map(|(number, line)| of_line(lived, number, line)).collect();
    match replayed {
        Err(error) => broken.push(format!("the log can't be read: {error}")),
        Ok(replayed) => {
            broken.extend(of_log(lived, replayed));
            broken.extend(of_changed(lived, replayed));
        }
    }
    if lived.has_left_out && keeps_up(lived) {
        broken.push("the recorder left packets out although its disk was only limited".to_owned());
    }
    if lived.longest_wait.0 > LONGEST_WAIT_NS {
        broken.push(format!("the loop took nothing for {} s", lived.longest_wait.as_secs_f64()));
    }
    broken
}

/// Whether the recorder must record everything, because nothing stalls and no disk operation fails. Even if the disk
/// performs only a few operations per second, the recorder may not leave packets out.
fn keeps_up(lived: &DiveResult) -> bool {
    let plan = &lived.plan;
    let is_limited = |what: DiskFault| matches!(what, DiskFault::OpsLimited { .. });
    let is_stall = |what: MachineFault| what != MachineFault::TerminalStands;
    let is_held = |what: CableFault| what == CableFault::Held;
    plan.disk.iter().all(|window| is_limited(window.what))
        && !plan.machine.iter().any(|window| is_stall(window.what))
        && !plan.cables.iter().flatten().any(|window| is_held(window.what))
}

/// Number of packets in `theirs` that the loop never took, or took in another order. `ours` are the packets that the
/// loop took.
fn invented(ours: &[Consumed], theirs: &[Consumed]) -> usize {
    let mut rest = ours.iter();
    theirs.iter().filter(|packet| !rest.any(|other| other == *packet)).count()
}

/// Checks the replay of the recording whose files were changed after the dive.
///
/// The order of the parts doesn't matter. No packet may be counted twice, and missing packets must be reported. Instead
/// of a replay, an error that names a file is also right, unless only the order of the parts was changed.
fn of_changed(lived: &DiveResult, replayed: &Replayed) -> Option<String> {
    let (change, changed) = (lived.plan.log?, replayed.changed.as_ref()?);
    let what = match changed {
        Err(error) if change == LogChange::Reordered => format!("it can't be read: {error}"),
        Err(error) if !error.contains(".mcap") => format!("its error names no file: {error}"),
        Err(_) => return None,
        Ok(changed) => {
            let is_same = (&changed.consumed, &changed.losses, changed.digest)
                == (&replayed.consumed, &replayed.losses, replayed.digest);
            let is_reported = changed.losses != replayed.losses && !changed.losses.is_empty();
            let invented = invented(&lived.consumed, &changed.consumed);
            if invented > 0 {
                format!("{invented} packets are counted twice or in another order: {:?}", changed.losses)
            } else if change == LogChange::Reordered && !is_same {
                format!("its replay differs: {:?}", changed.losses)
            } else if change == LogChange::Doubled && !is_reported {
                "the copy isn't reported".to_owned()
            } else if changed.consumed.len() < replayed.consumed.len() && changed.losses.is_empty() {
                "packets are missing and no loss is reported".to_owned()
            } else {
                return None;
            }
        }
    };
    Some(format!("the recording after its change ({change:?}): {what}"))
}

/// Checks that other devices' faults don't affect a device, that delays lose none of its frames, and that the device
/// runs again after all faults.
fn of_line(lived: &DiveResult, number: usize, line: &Line) -> Option<String> {
    let finished = lived.plan.ending == Ending::Finished;
    let is_of = |fault: MachineFault| matches!(fault, MachineFault::LoopStalls | MachineFault::PortsStall);
    let stalled = lived.plan.machine.iter().any(|window| is_of(window.what));
    let Line { untouched, lossless, whole, good, history } = line;
    let what = if *untouched && (history.opened, history.lost) != (1, 0) {
        "it had no fault, but its line was lost"
    } else if *good > *whole && *lossless {
        "more frames were found than sent"
    } else if *lossless && finished && *good < *whole && history.dropped == 0 {
        "frames are missing, and none was counted"
    } else if history.dropped > 0 && !stalled && *untouched {
        "packets were dropped although nothing stalled"
    } else if finished && !history.last.starts_with("running") {
        "it isn't running at the end"
    } else {
        return None;
    };
    Some(format!("device {number}: {what}: {line:?}"))
}

/// Checks a log against the dive.
///
/// The log contains every packet that the loop took, in the loop's order. Recorder and reader report exactly those
/// packets that are missing. The log also states the packets that a line dropped before the loop.
fn of_log(lived: &DiveResult, replayed: &Replayed) -> Vec<String> {
    let finished = lived.plan.ending == Ending::Finished;
    let (ours, theirs) = (&lived.consumed, &replayed.consumed);
    let invented = invented(ours, theirs);
    let missing = ours.len() - theirs.len().min(ours.len());
    let (dropped, losses) = drops::apart(&replayed.losses);
    let mut broken = Vec::new();
    let mut hold = |holds: bool, what: &str| {
        if !holds {
            let losses = &replayed.losses;
            broken.push(format!("{what}: {missing} of {} packets missing, reported: {losses:?}", ours.len()));
        }
    };
    hold(invented == 0, "the log has packets that the loop never took, or in another order");
    hold(missing == 0 || !losses.is_empty(), "packets are missing and no loss is reported");
    hold(theirs.len() >= lived.certain, "packets are missing that had been synced");
    if finished {
        let summary = lived.summary.as_ref().unwrap();
        let is_reported = summary.faults.iter().any(|fault| fault.lost > 0);
        let skipped = usize::try_from(summary.skipped).unwrap();
        hold(is_reported || missing == skipped, "packets are missing that the recorder doesn't report");
        hold(missing > 0 || replayed.digest == lived.digest, "the replay's results differ");
        let lines_dropped: u64 = lived.lines.iter().map(|line| line.history.dropped).sum();
        hold(dropped == lines_dropped, "the log doesn't state the packets that the lines dropped");
        let untroubled = lived.disk_failures == 0 && skipped == 0;
        hold(!untroubled || summary.faults.is_empty(), "the recorder reports a fault that didn't occur");
        hold(!untroubled || losses.is_empty(), "losses are reported although the disk had no fault");
    }
    broken
}
