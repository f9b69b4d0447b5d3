//! Driver of a head. It keeps one command in flight. It also keeps the head on its scan program, which is the planned
//! sequence of pings.
//!
//! The driver first locates the head. It then homes the head, the short way, to the program's current position, and
//! requests each ping of the program when due. After a late or lost answer the head lags behind its program. The driver
//! then polls the head as soon as it has answered, until the head has caught up. A head far off its program
//! (power-cycled, or turned by hand) is homed again.

use std::collections::VecDeque;

use headrace_sensor::driver::{Carrier, Cutter, DeviceHealth, Driver, DriverSetup, Wire};
use headrace_sensor::geometry::time::{DurNs, MonoNs};
use headrace_sensor::sampling::head::HeadProgram;

use crate::codec::{COMMAND_BYTES, COUNTS_PER_TURN, Command, Header, MAX_RETURN_BYTES, Model, Returns};
use crate::homing;
use crate::program::{Planned, Timetable};
use crate::settings::Settings;

/// Supported carriers: Ethernet for the 881L, RS-485 or RS-232 for the 881A.
pub const CARRIERS: [Carrier; 3] = [Carrier::Tcp, Carrier::Serial, Carrier::Udp];

/// Longest usual gap between the bytes of a return.
const SILENCE: DurNs = DurNs::from_millis(100);
/// Part of the answer timeout that allows for the head's own processing of a command.
const LEISURE: DurNs = DurNs::from_millis(60);
/// Slowest sound (m/s) and slowest line (bit/s) for which the answer timeout is long enough.
const SLOWEST_SOUND_MPS: f64 = 1300.0;
const LINE_BAUD: f64 = 115_200.0;
/// Number of unanswered commands in a row after which the head is polled less often, and the interval of this polling.
/// Source: LSTS DUNE, which retries after a second.
const ASK_SELDOM_AFTER: u32 = 10;
const SELDOM: DurNs = DurNs::from_millis(1_000);
/// Limits beyond which a head is homed. The largest lag is the scan program's period divided by `BEHIND_SHARE`. The
/// largest lead is `AHEAD_PINGS`. Before the head has joined its program, the largest lag is one ping.
const BEHIND_SHARE: u64 = 4;
const AHEAD_PINGS: u64 = 10;
/// A head that answers is reported as too slow for its settings if it lags by more than the scan program's period
/// divided by this value.
const TOO_SLOW_SHARE: u64 = 8;

/// Minimum number of unanswered commands, among the last 32, from which on the driver attributes the head's lag to the
/// line.
const LOSSY_FROM: u32 = 3;

/// Purpose of a command to the head.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Aim {
    /// Find the head's position.
    Locate,
    /// Move the head to the position that its scan program requires.
    Home,
    /// Request the ping with this number in the scan program.
    Ping(u64),
}

/// Driver of a head.
pub struct HeadDriver {
    settings: Settings,
    timetable: Timetable,
    cutter: Cutter<Returns, MAX_RETURN_BYTES>,
    timeout: DurNs,
    /// Purpose and send time of the command in flight.
    asked: Option<(Aim, MonoNs)>,
    /// Time of the next command, unless one is in flight.
    next_at: MonoNs,
    aim: Aim,
    way_home: VecDeque<Command>,
    /// Number, in the scan program, of the first ping after homing.
    joins_at: u64,
    unanswered: u32,
    /// Which of the latest 32 commands were unanswered, one bit each. The lowest bit is the latest command.
    losses: u32,
    /// Whether the head has followed its scan program at least once.
    joined: bool,
    last_position: Option<u16>,
    foreign_id: Option<u8>,
    refused: bool,
    behind: u64,
}

impl HeadDriver {
    /// Creates a driver for a head. Without a scan program, the head rotates continuously from angle 0 of the
    /// sensor frame.
    pub fn new(settings: Settings, setup: &DriverSetup) -> Self {
        let idle = HeadProgram { start_rad: 0.0, growing: true, sector: None };
        let program = setup.head.unwrap_or(idle);
        let timetable = Timetable::new(&settings, &program, setup.begun);
        let timeout = answer_time(&settings.command);
        Self {
            settings,
            timetable,
            cutter: Cutter::new(Returns { model: Some(Model::Head881) }, SILENCE),
            timeout,
            asked: None,
            next_at: MonoNs(0),
            aim: Aim::Locate,
            way_home: VecDeque::new(),
            joins_at: 0,
            unanswered: 0,
            losses: 0,
            joined: false,
            last_position: None,
            foreign_id: None,
            refused: false,
            behind: 0,
        }
    }

    fn ask(&mut self, now: MonoNs, wire: &mut dyn Wire) {
        let bytes = match self.aim {
            Aim::Locate => self.standing_still(),
            Aim::Home => self.way_home.pop_front().and_then(|command| command.encode().ok()),
            Aim::Ping(number) => self.timetable.ping(number).map(|ping| ping.command),
        };
        let Some(bytes) = bytes else { return self.locate(now) };
        wire.send(&bytes);
        self.asked = Some((self.aim, now));
    }

    /// Command for a ping without a step. It has the dive's settings, so its return is used as a measurement.
    fn standing_still(&self) -> Option<[u8; COMMAND_BYTES]> {
        Command { step_deg: 0.0, reverse: false, ..self.settings.command }.encode().ok()
    }

    fn locate(&mut self, at: MonoNs) {
        self.aim = Aim::Locate;
        self.next_at = at;
    }

    /// Handles a return received at `now`.
    fn answered(&mut self, header: &Header, now: MonoNs) {
        if header.head_id != self.settings.command.head_id {
            self.foreign_id = Some(header.head_id);
            return;
        }
        self.foreign_id = None;
        self.refused = !header.status.accepted() || header.status.overrun();
        let position = u16::try_from(i32::from(header.position) % COUNTS_PER_TURN).unwrap_or(0);
        // If no command is in flight, the received answer is a duplicate or late.
        let Some((aim, _)) = self.asked else { return };
        if let Aim::Ping(number) = aim {
            let planned = self.timetable.ping(number).map(|ping| ping.position);
            if planned != Some(position) && self.last_position == Some(position) {
                return;
            }
        }
        self.asked = None;
        self.unanswered = 0;
        self.losses <<= 1;
        self.last_position = Some(position);
        match aim {
            Aim::Locate => self.join(position, header.clockwise, now),
            Aim::Home if !self.way_home.is_empty() => self.next_at = now,
            Aim::Home => self.go_on(self.joins_at, now),
            Aim::Ping(number) if self.is_at(number, position) => self.go_on(number + 1, now),
            Aim::Ping(_) => self.locate(now),
        }
    }

    fn is_at(&self, number: u64, position: u16) -> bool {
        self.timetable.ping(number).is_some_and(|ping| ping.position == position)
    }

    /// Continues the scan program with ping `number`, when this ping is due or, if overdue, at once.
    fn go_on(&mut self, number: u64, now: MonoNs) {
        self.joined = true;
        self.aim = Aim::Ping(number);
        self.next_at = self.timetable.due(number).max(now);
        self.behind = self.timetable.first_at(now).saturating_sub(number);
    }

    /// Continues the scan program at the head's position, or homes the head if that position is too far off the
    /// program.
    fn join(&mut self, position: u16, clockwise: bool, now: MonoNs) {
        let current = self.timetable.first_at(now);
        let most_behind = if self.joined { self.timetable.len() / BEHIND_SHARE } else { 1 };
        let near = |number: &u64| number + most_behind >= current && *number <= current + AHEAD_PINGS;
        match self.timetable.nearest(current, position, clockwise).filter(near) {
            Some(number) => self.go_on(number, now),
            None => self.go_home(position, clockwise, now),
        }
    }

    fn go_home(&mut self, position: u16, clockwise: bool, now: MonoNs) {
        let growing = clockwise == (self.settings.angle_sign > 0.0);
        let from = homing::Standing { angle_rad: self.settings.sensor_rad(position), growing };
        let current = self.timetable.first_at(now);
        self.joins_at = current;
        // The homing distance depends on the program's position when the head arrives, and this position depends on the
        // homing distance. Both are therefore found by iteration.
        for _ in 0..3 {
            let Some(Planned { position, clockwise, .. }) = self.timetable.ping(self.joins_at).copied()
            else {
                return;
            };
            let there = HeadProgram {
                start_rad: self.settings.sensor_rad(position),
                growing: clockwise == (self.settings.angle_sign > 0.0),
                sector: None,
            };
            self.way_home = homing::commands(&self.settings, from, &there).into();
            let arrives_at = current + self.way_home.len() as u64 + 1;
            if arrives_at <= self.joins_at {
                break;
            }
            self.joins_at = arrives_at;
        }
        if self.way_home.is_empty() {
            self.go_on(self.joins_at, now);
        } else {
            self.aim = Aim::Home;
            self.next_at = now;
        }
    }

    /// Stops waiting for the answer to the command in flight.
    fn give_up(&mut self, now: MonoNs) {
        self.asked = None;
        self.unanswered = self.unanswered.saturating_add(1);
        self.losses = self.losses << 1 | 1;
        let seldom = self.unanswered > ASK_SELDOM_AFTER;
        self.locate(if seldom { now + SELDOM } else { now });
    }

    fn complaint(&self) -> Option<String> {
        let own = self.settings.command.head_id;
        if let Some(id) = self.foreign_id {
            return Some(format!("answers as head {id:#04x}; head_id says {own:#04x}"));
        }
        if self.refused {
            return Some(
                "doesn't accept the command, or loses characters of it; check range_m and the line"
                    .to_owned(),
            );
        }
        (self.behind > self.timetable.len() / TOO_SLOW_SHARE).then(|| {
            if self.losses.count_ones() >= LOSSY_FROM {
                return "falls behind because replies are lost; check the cable, its plugs and the line's rate"
                    .to_owned();
            }
            let period_ms = self.settings.ping_period.as_secs_f64() * 1000.0;
            format!("can't keep up with a ping every {period_ms:.1} ms; increase turn_period_s")
        })
    }
}

impl Driver for HeadDriver {
    fn opened(&mut self, now: MonoNs, wire: &mut dyn Wire) {
        self.asked = None;
        self.unanswered = 0;
        self.last_position = None;
        self.locate(now);
        self.ask(now, wire);
    }

    fn closed(&mut self, wire: &mut dyn Wire) {
        self.cutter.flush(&mut |piece| wire.deliver(piece.received, piece.bytes));
    }

    fn heard(&mut self, received: MonoNs, bytes: &[u8], wire: &mut dyn Wire) {
        let mut headers = Vec::new();
        self.cutter.push(received, bytes, &mut |piece| {
            wire.deliver(piece.received, piece.bytes);
            if piece.is_frame {
                headers
                    .extend(Header::decode(piece.bytes, Some(Model::Head881)).ok().map(|(header, _)| header));
            }
        });
        for header in headers {
            self.answered(&header, received);
        }
    }

    fn accepts(&self, bytes: &[u8]) -> bool {
        let own = self.settings.command.head_id;
        let is_own = |(header, _): (Header, _)| header.head_id == own;
        self.cutter.accepts(bytes, |frame| Header::decode(frame, Some(Model::Head881)).is_ok_and(is_own))
    }

    fn due(&self) -> Option<MonoNs> {
        let next = self.asked.map_or(self.next_at, |(_, at)| at + self.timeout);
        Some(self.cutter.settles().map_or(next, |settles| next.min(settles)))
    }

    fn wake(&mut self, now: MonoNs, wire: &mut dyn Wire) {
        self.heard(now, &[], wire);
        if self.asked.is_some_and(|(_, at)| now.since(at) >= self.timeout) {
            self.give_up(now);
        }
        if self.asked.is_none() && now >= self.next_at {
            self.ask(now, wire);
        }
    }

    fn awaits(&self) -> bool {
        self.asked.is_some()
    }

    fn health(&self) -> DeviceHealth {
        let good_frames = self.cutter.counts().good_frames;
        let id = self.settings.command.head_id;
        let identity = (good_frames > 0).then(|| format!("Imagenex 881 family, head {id:#04x}"));
        DeviceHealth { good_frames, identity, complaint: self.complaint(), ..DeviceHealth::default() }
    }
}

/// Time limit for the head's answer to a command.
///
/// The timeout is twice the sum of three durations. These are the two-way travel time at the range setting, the
/// transmission of the command and of the longest return on a serial line, and the processing allowance.
fn answer_time(command: &Command) -> DurNs {
    let sound_s = 2.0 * f64::from(command.range_m) / SLOWEST_SOUND_MPS;
    let line_s = (COMMAND_BYTES + MAX_RETURN_BYTES) as f64 * 10.0 / LINE_BAUD;
    let once = DurNs::from_secs_f64(sound_s + line_s) + LEISURE;
    once + once
}

#[cfg(test)]
mod tests;
