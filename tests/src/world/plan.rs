//! Faults in a simulated world, drawn from the world's seed.

use std::fmt;

use headrace_geometry::time::{DurNs, MonoNs};

use crate::random::Random;

/// Time of the simulated clock at which dives start. It isn't zero, as if the machine had been switched on some time
/// before the dive.
pub const BEGIN: MonoNs = MonoNs(1_000_000_000);
/// Time from the start of a dive within which faults begin, ns.
const BEGIN_WITHIN_NS: usize = 6_000_000_000;
const END_WITHIN_NS: usize = 7_000_000_000;
/// Duration of a dive. It includes time in which the program recovers after the last fault.
const LENGTH: DurNs = DurNs(12_000_000_000);
/// Longest delay on a cable, ns. It is shorter than any silence timeout. `LONGEST_STALL_NS` is the longest stall of the
/// loop or recorder. Such a stall is long enough to fill the queues.
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
    /// The disk performs a limited number of operations per second. Each write and each sync waits for its turn.
    OpsLimited {
        /// Number of operations that the disk performs per second.
        per_s: u16,
    },
    /// Each sync takes a long time.
    SyncsSlow {
        /// Duration of a sync, ms.
        ms: u16,
    },
}

/// Operations per second of a limited disk, from an SD card in poor condition to a hard disk.
const OPS_PER_S: [u16; 5] = [3, 10, 30, 100, 300];
/// Durations of slow syncs, ms.
const SYNCS_MS: [u16; 6] = [10, 100, 250, 700, 2000, 5000];

const OF_DISKS: [DiskFault; 5] = [
    DiskFault::WriteFails,
    DiskFault::WritesInPart,
    DiskFault::SyncFails,
    DiskFault::Full,
    DiskFault::CreateFails,
];

/// A change of the recording's files after the dive.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum LogChange {
    /// The parts are named in another order.
    Reordered,
    /// A part, possibly cut, is appended to itself.
    Doubled,
    /// The next part is appended to a part, possibly after the latter was cut.
    Joined,
    /// A part is cut.
    Cut,
}

const OF_LOGS: [LogChange; 4] = [LogChange::Reordered, LogChange::Doubled, LogChange::Joined, LogChange::Cut];

/// A fault of a plan.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Fault {
    /// A fault of the cable with this number.
    Cable(usize, Window<CableFault>),
    /// A fault of the machine.
    Machine(Window<MachineFault>),
    /// A fault of the disk.
    Disk(Window<DiskFault>),
    /// A change of the recording's files.
    Log(LogChange),
    /// An end of the dive by a kill or a power cut, and its time.
    Ending(Ending, MonoNs),
}

impl Fault {
    /// Returns the kind of the fault as text. The text is the same for all faults of a kind.
    pub fn kind(&self) -> String {
        match self {
            Self::Cable(_, window) => format!("cable: {:?}", window.what),
            Self::Machine(window) => format!("machine: {:?}", window.what),
            Self::Disk(Window { what: DiskFault::OpsLimited { .. }, .. }) => "disk: OpsLimited".to_owned(),
            Self::Disk(Window { what: DiskFault::SyncsSlow { .. }, .. }) => "disk: SyncsSlow".to_owned(),
            Self::Disk(window) => format!("disk: {:?}", window.what),
            Self::Log(change) => format!("log: {change:?}"),
            Self::Ending(ending, _) => format!("end: {ending:?}"),
        }
    }
}

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
    /// Duration of the recording's parts; `None` for a single file.
    pub every: Option<DurNs>,
    /// Change of the recording's files after the dive, if any.
    pub log: Option<LogChange>,
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
        let disk = (0..random.below(3)).map(|_| disk_fault(random));
        let disk = disk.collect();
        let every = random.one_in(2).then(|| DurNs::from_millis(1000 + random.below(4000) as i64));
        let log = random.one_in(2).then(|| pick(random, &OF_LOGS));
        let ending = pick(random, &[Ending::Finished, Ending::Finished, Ending::Killed, Ending::PowerCut]);
        let early = if ending == Ending::Finished { 0 } else { random.below(END_WITHIN_NS) };
        Self { cables, machine, disk, every, log, ending, end: BEGIN + LENGTH - DurNs(early as i64) }
    }

    /// Returns all faults of the plan.
    pub fn faults(&self) -> Vec<Fault> {
        let cables = self.cables.iter().enumerate();
        let cables = cables.flat_map(|(number, all)| all.iter().map(move |one| Fault::Cable(number, *one)));
        let machine = self.machine.iter().map(|window| Fault::Machine(*window));
        let disk = self.disk.iter().map(|window| Fault::Disk(*window));
        let ending = (self.ending != Ending::Finished).then_some(Fault::Ending(self.ending, self.end));
        cables.chain(machine).chain(disk).chain(self.log.map(Fault::Log)).chain(ending).collect()
    }

    /// The same plan, but with only the faults `faults`.
    #[must_use]
    pub fn with_only(&self, faults: &[Fault]) -> Self {
        let cables = vec![Vec::new(); self.cables.len()];
        let (machine, disk) = (Vec::new(), Vec::new());
        let (ending, end) = (Ending::Finished, BEGIN + LENGTH);
        let mut plan = Self { cables, machine, disk, every: self.every, log: None, ending, end };
        for fault in faults {
            match *fault {
                Fault::Cable(number, window) => plan.cables[number].push(window),
                Fault::Machine(window) => plan.machine.push(window),
                Fault::Disk(window) => plan.disk.push(window),
                Fault::Log(change) => plan.log = Some(change),
                Fault::Ending(ending, end) => (plan.ending, plan.end) = (ending, end),
            }
        }
        plan
    }

    /// The same plan with another terminal. The terminal accepts nothing if `is_blocked` is set, and everything
    /// otherwise.
    #[must_use]
    pub fn with_terminal(mut self, is_blocked: bool) -> Self {
        self.machine.retain(|window| window.what != MachineFault::TerminalStands);
        let always = Window { what: MachineFault::TerminalStands, from: BEGIN, to: MonoNs(u64::MAX) };
        self.machine.extend(is_blocked.then_some(always));
        self
    }

    /// Whether a fault of the machine is active at the time `now`.
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
        if let Some(every) = self.every {
            writeln!(f, "  recording: a part every {:.3} s", every.as_secs_f64())?;
        }
        if let Some(change) = self.log {
            writeln!(f, "  recording after the dive: {change:?}")?;
        }
        write!(f, "  {:?} at {:.3} s", self.ending, s(self.end))
    }
}

fn pick<T: Copy>(random: &mut Random, of: &[T]) -> T {
    of[random.below(of.len())]
}

fn disk_fault(random: &mut Random) -> Window<DiskFault> {
    let (what, longest) = match random.below(3) {
        0 => (DiskFault::OpsLimited { per_s: pick(random, &OPS_PER_S) }, LONGEST_STALL_NS),
        1 => (DiskFault::SyncsSlow { ms: pick(random, &SYNCS_MS) }, LONGEST_STALL_NS),
        _ => (pick(random, &OF_DISKS), LONGEST_NS),
    };
    window(random, what, longest)
}

fn window<T>(random: &mut Random, what: T, longest_ns: usize) -> Window<T> {
    let from_ns = random.below(BEGIN_WITHIN_NS);
    let to_ns = (from_ns + 1 + random.below(longest_ns)).min(END_WITHIN_NS);
    Window { what, from: BEGIN + DurNs(from_ns as i64), to: BEGIN + DurNs(to_ns as i64) }
}
