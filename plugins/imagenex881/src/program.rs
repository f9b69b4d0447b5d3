//! A head's scan program as a sequence of commands, one per ping.

use headrace_sensor::geometry::time::{DurNs, MonoNs};
use headrace_sensor::sampling::head::HeadProgram;

use crate::codec::{COMMAND_BYTES, COUNTS_PER_TURN, Command, step_at_most, step_deg};
use crate::settings::{Settings, counts_of_rad};
use crate::stepping::Head;

/// Generates the commands that keep a head on its scan program.
///
/// Sectors are swept with steps and reversals. The head's own sector settings aren't used, because they allow multiples
/// of 3 degrees only. Each sweep pings both ends of the sector, each end once. If the sector isn't a multiple of the
/// step, the last step before an end is shorter.
#[derive(Debug, Clone)]
pub struct Host {
    command: Command,
    step_counts: i32,
    growing: bool,
    sector: Option<Sector>,
}

/// A sector in counts of 0.3 degrees, with the head's position in the sector, counted from the lower end.
#[derive(Debug, Clone, Copy)]
struct Sector {
    size: i32,
    along: i32,
}

impl Host {
    /// Creates the host of a head that is at the start of its scan program and steps in the program's initial
    /// direction.
    pub fn new(settings: &Settings, program: &HeadProgram) -> Self {
        let normal = settings.angle_sign > 0.0;
        Self {
            command: settings.command,
            step_counts: i32::from(settings.step_counts),
            growing: program.growing == normal,
            sector: program.sector.map(|(least_rad, size_rad)| {
                let above_least = program.start_rad - least_rad;
                let above_rad = if normal { above_least } else { size_rad - above_least };
                Sector::new(counts_of_rad(above_rad), counts_of_rad(size_rad))
            }),
        }
    }

    /// Whether the next step increases the position.
    pub fn growing(&self) -> bool {
        self.growing
    }

    /// The next command to the head, which pings at its position and then steps.
    pub fn next_command(&mut self) -> Command {
        let Some(Sector { size, along }) = &mut self.sector else { return self.command };
        let to_end = |growing| if growing { *size - *along } else { *along };
        let reverse = to_end(self.growing) <= 0;
        self.growing ^= reverse;
        let step = step_at_most(self.step_counts.min(to_end(self.growing)));
        *along += if self.growing { i32::from(step) } else { -i32::from(step) };
        Command { reverse, step_deg: step_deg(step), ..self.command }
    }
}

impl Sector {
    fn new(above: i32, size: i32) -> Self {
        let size = size.clamp(0, COUNTS_PER_TURN);
        let inside = (0..=size).contains(&above);
        let along = if inside { above } else { above.rem_euclid(COUNTS_PER_TURN).min(size) };
        Self { size, along }
    }
}

/// A planned ping of a head's scan program.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Planned {
    /// Head position, 0 to 1199.
    pub position: u16,
    /// Stepping direction of the head before this command: true if positions increase.
    pub clockwise: bool,
    /// Encoded command that requests the ping and sets the next step.
    pub command: [u8; COMMAND_BYTES],
}

/// A periodic scan program with times: ping k is due k ping periods after the dive's start.
#[derive(Debug, Clone)]
pub struct Timetable {
    pings: Vec<Planned>,
    begun: MonoNs,
    period: DurNs,
}

/// Maximum period of a scan program, in pings. A sector in the mode "slow" has 2,400 pings.
const MAX_PINGS: usize = 10_000;

impl Timetable {
    /// Creates the timetable of a head that is at the start of its scan program when the dive begins.
    pub fn new(settings: &Settings, program: &HeadProgram, begun: MonoNs) -> Self {
        let mut host = Host::new(settings, program);
        let mut head = Head::new(settings.position(program.start_rad), host.growing());
        let beginning = (head.position(), head.growing());
        let mut pings = Vec::new();
        while pings.len() < MAX_PINGS {
            let before = (head.position(), head.growing());
            if !pings.is_empty() && before == beginning {
                break;
            }
            let command = host.next_command();
            let ping = head.obey(&command);
            // Settings are checked when they are read, so every command can be encoded.
            let Ok(command) = command.encode() else { break };
            pings.push(Planned { position: ping.position, clockwise: before.1, command });
        }
        Self { pings, begun, period: settings.ping_period }
    }

    /// Period of the scan program, in pings.
    pub fn len(&self) -> u64 {
        self.pings.len() as u64
    }

    /// Whether the scan program has no pings, which never happens.
    pub fn is_empty(&self) -> bool {
        self.pings.is_empty()
    }

    /// Finds ping number `number` of the periodic scan program.
    pub fn ping(&self, number: u64) -> Option<&Planned> {
        let place = number.checked_rem(self.len())?;
        self.pings.get(usize::try_from(place).ok()?)
    }

    /// Due time of ping `number`.
    pub fn due(&self, number: u64) -> MonoNs {
        self.begun + DurNs(i64::try_from(number).unwrap_or(i64::MAX).saturating_mul(self.period.0))
    }

    /// Number of the first ping due at `at` or later.
    pub fn first_at(&self, at: MonoNs) -> u64 {
        let since = at.since(self.begun).0.max(0);
        since.unsigned_abs().div_ceil(self.period.0.max(1).unsigned_abs())
    }

    /// Number of the ping nearest to `near` with this position and stepping direction.
    pub fn nearest(&self, near: u64, position: u16, clockwise: bool) -> Option<u64> {
        let fits = |number: &u64| {
            self.ping(*number).is_some_and(|ping| ping.position == position && ping.clockwise == clockwise)
        };
        let candidates = (0..=self.len() / 2).flat_map(|off| [near.checked_sub(off), near.checked_add(off)]);
        candidates.flatten().find(fits)
    }
}
