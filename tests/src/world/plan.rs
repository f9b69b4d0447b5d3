//! Faults in a simulated world, drawn from the world's seed.

use std::fmt;

use headrace_geometry::time::{DurNs, MonoNs};

use crate::random::Random;

/// Time of the simulated clock at which dives start; the machine was switched on some time before.
pub const BEGIN: MonoNs = MonoNs(1_000_000_000);
/// Faults begin within this time from the start of a dive, ns.
const BEGIN_WITHIN_NS: usize = 6_000_000_000;
const END_WITHIN_NS: usize = 7_000_000_000;
/// Duration of a dive. It includes time to recover after the last fault.
const LENGTH: DurNs = DurNs(12_000_000_000);
/// Longest delay on a cable, ns. It is shorter than any silence timeout. `LONGEST_STALL_NS` is the longest stall of the
/// loop or recorder, long enough to fill the queues.
const LONGEST_HOLD_NS: usize = 1_500_000_000;
const LONGEST_STALL_NS: usize = 7_000_000_000;
const LONGEST_NS: usize = 3_000_000_000;

/// A fault and the time in which it is active.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Window<T> {
    /// The fault that is active in this time window.
    pub what: T,
    /// Start of the fault, inclusive.
    pub from: MonoNs,
    /// End of the fault, exclusive.
    pub to: MonoNs,
}

impl<T> Window<T> {
    /// Whether the fault is active at that time.
    pub fn holds(&self, now: MonoNs) -> bool {
        self.from <= now && now < self.to
    }
}

/// Faults of a cable or of the device at its end.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum CableFault {
    /// The byte stream arrives in pieces of any length, up to 80 ms apart.
    Cut,
    /// Nothing arrives at first, and then everything at once.
    Held,
    /// Bytes or messages are lost.
    Lost,
    /// Bits are flipped.
    Garbled,
    /// Noise arrives between frames.
    Babble,
    /// Messages arrive twice.
    Doubled,
    /// Messages overtake each other.
    Disordered,
    /// The device sends nothing.
    Silent,
    /// The connection breaks and can't be reopened for a while.
    Broken,
    /// Writes to the device fail.
    Deaf,
}

const OF_STREAMS: [CableFault; 8] = [
    CableFault::Cut,
    CableFault::Held,
    CableFault::Lost,
    CableFault::Garbled,
    CableFault::Babble,
    CableFault::Silent,
    CableFault::Broken,
    CableFault::Deaf,
];
const OF_MESSAGES: [CableFault; 9] = [
    CableFault::Held,
    CableFault::Lost,
    CableFault::Garbled,
    CableFault::Babble,
    CableFault::Doubled,
    CableFault::Disordered,
    CableFault::Silent,
    CableFault::Broken,
    CableFault::Deaf,
];

/// Faults of the simulated machine.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum MachineFault {
    /// The loop gets no CPU time.
    LoopStalls,
    /// The recorder's thread gets no CPU time, or its disk doesn't respond.
    RecorderStalls,
    /// The port threads get no CPU time.
    PortsStall,
    /// The terminal accepts nothing.
    TerminalStands,
}

const OF_MACHINES: [MachineFault; 4] = [
    MachineFault::LoopStalls,
    MachineFault::RecorderStalls,
    MachineFault::PortsStall,
    MachineFault::TerminalStands,
];

/// Faults of the simulated disk.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum DiskFault {
    /// Writes to the disk fail.
    WriteFails,
    /// Writes to the disk are partial or interrupted.
    WritesInPart,
    /// Syncs fail, and unsynced data is lost.
    SyncFails,
    /// The disk is full.
    Full,
    /// No file can be created.
    CreateFails,
}

const OF_DISKS: [DiskFault; 5] = [
    DiskFault::WriteFails,
    DiskFault::WritesInPart,
    DiskFault::SyncFails,
    DiskFault::Full,
    DiskFault::CreateFails,
];

/// The way in which a dive ends.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Ending {
    /// The dive ends regularly.
    Finished,
    /// The program is killed.
    Killed,
    /// The power is cut: unsynced data is lost or partly written.
    PowerCut,
}

/// All faults planned for a dive.
#[derive(Clone)]
pub struct Plan {
    /// Faults of each cable.
    pub cables: Vec<Vec<Window<CableFault>>>,
    /// Faults of the simulated machine.
    pub machine: Vec<Window<MachineFault>>,
    /// Faults of the disk.
    pub disk: Vec<Window<DiskFault>>,
    /// The way in which the dive ends.
    pub ending: Ending,
    /// Time at which the dive ends.
    pub end: MonoNs,
}

impl Plan {
    /// Draws a plan. `streams` says for each cable whether it carries a byte stream. At least one cable has no fault.
    pub fn draw(random: &mut Random, streams: &[bool]) -> Self {
        let mut cables = vec![Vec::new(); streams.len()];
        let sound = random.below(streams.len());
        for _ in 0..random.below(7) {
            let number = random.below(streams.len());
            if number == sound {
                continue;
            }
            let what = if streams[number] { pick(random, &OF_STREAMS) } else { pick(random, &OF_MESSAGES) };
            let longest = if what == CableFault::Held { LONGEST_HOLD_NS } else { LONGEST_NS };
            cables[number].push(window(random, what, longest));
        }
        let machine = (0..random.below(3)).map(|_| {
            let what = pick(random, &OF_MACHINES);
            let long = matches!(what, MachineFault::LoopStalls | MachineFault::RecorderStalls);
            window(random, what, if long { LONGEST_STALL_NS } else { LONGEST_NS })
        });
        let machine = machine.collect();
        let disk = (0..random.below(3)).map(|_| {
            let what = pick(random, &OF_DISKS);
            window(random, what, LONGEST_NS)
        });
        let disk = disk.collect();
        let ending = pick(random, &[Ending::Finished, Ending::Finished, Ending::Killed, Ending::PowerCut]);
        let early = if ending == Ending::Finished { 0 } else { random.below(END_WITHIN_NS) };
        Self { cables, machine, disk, ending, end: BEGIN + LENGTH - DurNs(early as i64) }
    }

    /// The same plan with a terminal that accepts nothing if `stands` is set, and otherwise everything.
    #[must_use]
    pub fn with_terminal(mut self, stands: bool) -> Self {
        self.machine.retain(|window| window.what != MachineFault::TerminalStands);
        let always = Window { what: MachineFault::TerminalStands, from: BEGIN, to: MonoNs(u64::MAX) };
        self.machine.extend(stands.then_some(always));
        self
    }

    /// Whether a fault of the machine is active at this time.
    pub fn has(&self, fault: MachineFault, now: MonoNs) -> bool {
        self.machine.iter().any(|window| window.what == fault && window.holds(now))
    }
}

impl fmt::Debug for Plan {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let s = |at: MonoNs| at.0 as f64 / 1e9;
        for (number, faults) in self.cables.iter().enumerate() {
            for Window { what, from, to } in faults {
                writeln!(f, "  cable {number}: {what:?} from {:.3} to {:.3} s", s(*from), s(*to))?;
            }
        }
        for Window { what, from, to } in &self.machine {
            writeln!(f, "  machine: {what:?} from {:.3} to {:.3} s", s(*from), s(*to))?;
        }
        for Window { what, from, to } in &self.disk {
            writeln!(f, "  disk: {what:?} from {:.3} to {:.3} s", s(*from), s(*to))?;
        }
        write!(f, "  {:?} at {:.3} s", self.ending, s(self.end))
    }
}

fn pick<T: Copy>(random: &mut Random, of: &[T]) -> T {
    of[random.below(of.len())]
}

fn window<T>(random: &mut Random, what: T, longest_ns: usize) -> Window<T> {
    let from_ns = random.below(BEGIN_WITHIN_NS);
    let to_ns = (from_ns + 1 + random.below(longest_ns)).min(END_WITHIN_NS);
    Window { what, from: BEGIN + DurNs(from_ns as i64), to: BEGIN + DurNs(to_ns as i64) }
}
