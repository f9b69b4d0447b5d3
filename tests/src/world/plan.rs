//! What goes wrong in a world, drawn from its seed.

use std::fmt;

use headrace_geometry::time::{DurNs, MonoNs};

use crate::random::Random;

/// Begin of a dive: the machine was switched on a while before.
pub const BEGIN: MonoNs = MonoNs(1_000_000_000);
/// Time within which faults begin, and by which they have ended, ns.
const BEGIN_WITHIN_NS: usize = 6_000_000_000;
const END_WITHIN_NS: usize = 7_000_000_000;
/// Length of a dive: afterwards there is time to recover.
const LENGTH: DurNs = DurNs(12_000_000_000);
/// Longest faults: of a cable that only delays, shorter than any silence timeout; of a loop or recorder, long enough for queues to fill.
const LONGEST_HOLD_NS: usize = 1_500_000_000;
const LONGEST_STALL_NS: usize = 7_000_000_000;
const LONGEST_NS: usize = 3_000_000_000;

/// A fault and when it holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Window<T> {
    /// The fault.
    pub what: T,
    /// Begin, included.
    pub from: MonoNs,
    /// End, not included.
    pub to: MonoNs,
}

impl<T> Window<T> {
    /// Whether it holds at that time.
    pub fn holds(&self, now: MonoNs) -> bool {
        self.from <= now && now < self.to
    }
}

/// Faults of a cable or of the device at its end.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum CableFault {
    /// A stream arrives in pieces of any length, up to 80 ms apart.
    Cut,
    /// Nothing arrives, and then all at once.
    Held,
    /// Bytes or messages are lost.
    Lost,
    /// Bits are flipped.
    Garbled,
    /// Noise comes between frames.
    Babble,
    /// Messages come twice.
    Doubled,
    /// Messages overtake each other.
    Disordered,
    /// The device says nothing.
    Silent,
    /// The connection breaks, and can't be opened for a while.
    Broken,
    /// Writing fails.
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

/// Faults of the machine.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum MachineFault {
    /// The loop doesn't get the processor.
    LoopStalls,
    /// The recorder's thread doesn't, or its disk doesn't answer.
    RecorderStalls,
    /// The threads of the ports don't.
    PortsStall,
    /// The terminal takes nothing.
    TerminalStands,
}

const OF_MACHINES: [MachineFault; 4] = [
    MachineFault::LoopStalls,
    MachineFault::RecorderStalls,
    MachineFault::PortsStall,
    MachineFault::TerminalStands,
];

/// Faults of a disk.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum DiskFault {
    /// Writing fails.
    WriteFails,
    /// Writing takes a part of what it is given, or is interrupted.
    WritesInPart,
    /// Syncing fails, and what wasn't synced is lost.
    SyncFails,
    /// There is no room.
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

/// How a dive ends.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Ending {
    /// In order.
    Finished,
    /// The program is killed.
    Killed,
    /// The power is cut: what hasn't been synced is lost, or torn.
    PowerCut,
}

/// All that goes wrong in a dive.
#[derive(Clone)]
pub struct Plan {
    /// By cable.
    pub cables: Vec<Vec<Window<CableFault>>>,
    /// Of the machine.
    pub machine: Vec<Window<MachineFault>>,
    /// Of the disk.
    pub disk: Vec<Window<DiskFault>>,
    /// The end.
    pub ending: Ending,
    /// When the dive ends.
    pub end: MonoNs,
}

impl Plan {
    /// Draws a plan for cables, of which those that are streams are told. One of them at least stays sound.
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

    /// The same, the terminal apart: it takes everything, or nothing.
    #[must_use]
    pub fn with_terminal(mut self, stands: bool) -> Self {
        self.machine.retain(|window| window.what != MachineFault::TerminalStands);
        let always = Window { what: MachineFault::TerminalStands, from: BEGIN, to: MonoNs(u64::MAX) };
        self.machine.extend(stands.then_some(always));
        self
    }

    /// Whether a fault of the machine holds.
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
