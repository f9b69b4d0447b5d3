//! The driver with an emulated head, on a line that loses, corrupts, duplicates and delays messages. No port and no
//! clock are used.

use headrace_sensor::device::{Direction, Emulator as _, EmulatorSetup};
use headrace_sensor::geometry::math::{PI, TAU};
use headrace_sensor::geometry::site::Site;
use headrace_sensor::measurement::Sounding;

use super::*;
use crate::codec::{Return, Status};
use crate::emulator::HeadEmulator;
use crate::settings::tests::settings;
use crate::stepping::Head;

const BEGUN: MonoNs = MonoNs(2_000_000_000);
/// Pause within an answer, so long that the rest of the answer never arrives.
const STALLS: DurNs = DurNs(i64::MAX);
const LATENCY: DurNs = DurNs(9_000_000);

/// Faults of the line. Commands and answers are identified by their numbers.
#[derive(Default)]
struct Faults {
    /// Numbers of commands that are lost; then numbers of answers that are lost.
    lost_commands: Vec<usize>,
    lost_answers: Vec<usize>,
    /// Numbers of answers in which a byte is flipped; then numbers of answers that arrive twice.
    broken_answers: Vec<usize>,
    doubled_answers: Vec<usize>,
    /// Numbers of answers that arrive in two parts, each with the pause between the parts.
    halved_answers: Vec<(usize, DurNs)>,
}

/// A driver, an emulated head and the simulated line between them.
struct Rig {
    driver: HeadDriver,
    head: HeadEmulator,
    faults: Faults,
    now: MonoNs,
    line: Vec<(MonoNs, Vec<u8>)>,
    sent: Vec<MonoNs>,
    outbox: Vec<Vec<u8>>,
    answers: usize,
    /// Whether the latest answer has been duplicated.
    doubled: bool,
    /// Time and position of each ping whose return was delivered to the host and has the dive's range setting.
    pings: Vec<(MonoNs, u16)>,
    delivered: Vec<u8>,
}

struct Ends<'a> {
    outbox: &'a mut Vec<Vec<u8>>,
    delivered: &'a mut Vec<u8>,
    pings: &'a mut Vec<(MonoNs, u16)>,
    range_m: u8,
}

impl Wire for Ends<'_> {
    fn send(&mut self, bytes: &[u8]) {
        self.outbox.push(bytes.to_vec());
    }

    fn exchange(&mut self, _: &[u8], _: DurNs, _: usize) {
        panic!("a head is on no bus");
    }

    fn deliver(&mut self, received: MonoNs, bytes: &[u8]) {
        self.delivered.extend_from_slice(bytes);
        if let Ok((header, _)) = Header::decode(bytes, Some(Model::Head881))
            && header.range_m == self.range_m
        {
            self.pings.push((received - LATENCY, header.position));
        }
    }
}

impl Rig {
    /// Creates a rig whose head is at `at_rad` at the start.
    fn new(text: &str, program: HeadProgram, at_rad: f64, faults: Faults) -> Self {
        let settings = settings(text).unwrap();
        let now = BEGUN;
        let at_rest = HeadProgram { start_rad: at_rad, growing: true, sector: None };
        let setup = EmulatorSetup { start: now, head: Some(at_rest), site: Site::default(), polled: false };
        let head = HeadEmulator::new(settings.clone(), LATENCY, &setup);
        let setup = DriverSetup { begun: BEGUN, head: Some(program) };
        Self {
            driver: HeadDriver::new(settings, &setup),
            head,
            faults,
            now,
            line: Vec::new(),
            sent: Vec::new(),
            outbox: Vec::new(),
            answers: 0,
            doubled: false,
            pings: Vec::new(),
            delivered: Vec::new(),
        }
    }

    fn drive(&mut self, mut call: impl FnMut(&mut HeadDriver, MonoNs, &mut dyn Wire)) {
        let range_m = self.driver.settings.command.range_m;
        let Self { driver, outbox, delivered, pings, .. } = self;
        call(driver, self.now, &mut Ends { outbox, delivered, pings, range_m });
        for command in std::mem::take(&mut self.outbox) {
            let awaited = self.line.len().saturating_sub(usize::from(self.doubled));
            assert_eq!(awaited, 0, "two commands in flight at {:?}", self.now);
            self.carry(&command);
        }
    }

    /// Delivers a command to the head, and puts the head's answer on the simulated line.
    fn carry(&mut self, command: &[u8]) {
        let number = self.sent.len();
        self.sent.push(self.now);
        if self.faults.lost_commands.contains(&number) {
            return;
        }
        let (mut due, mut answers) = (Vec::new(), Vec::new());
        self.head.hear(self.now, command, &mut |_, _, _| ());
        self.head.begin(self.now + DurNs(1), &mut due);
        for sounding in due {
            let heard = Sounding { range_m: Some(4.0), ..sounding };
            self.head.tell(&heard, &mut |direction, at, bytes| {
                assert_eq!(direction, Direction::Received);
                answers.push((at, bytes.to_vec()));
            });
        }
        for (at, mut bytes) in answers {
            let number = self.answers;
            self.answers += 1;
            if self.faults.lost_answers.contains(&number) {
                continue;
            }
            if self.faults.broken_answers.contains(&number) {
                bytes[0] ^= 0x10;
            }
            match self.faults.halved_answers.iter().find(|(halved, _)| *halved == number) {
                Some((_, pause)) => {
                    let (first, second) = bytes.split_at(5);
                    self.line.push((at, first.to_vec()));
                    // A head that stalls within an answer sends nothing more.
                    self.line.extend((*pause < STALLS).then(|| (at + *pause, second.to_vec())));
                }
                None => self.line.push((at, bytes.clone())),
            }
            self.doubled = self.faults.doubled_answers.contains(&number);
            if self.doubled {
                self.line.push((at + DurNs(1_000_000), bytes));
            }
        }
        self.line.sort_by_key(|(at, _)| *at);
    }

    fn run(&mut self, until: MonoNs) {
        if self.sent.is_empty() {
            self.drive(|driver, now, wire| driver.opened(now, wire));
        }
        loop {
            let due = self.driver.due().unwrap();
            let comes = self.line.first().map_or(MonoNs(u64::MAX), |(at, _)| *at);
            if due.min(comes) >= until {
                return;
            }
            if comes <= due {
                self.now = comes;
                let (_, bytes) = self.line.remove(0);
                self.drive(|driver, now, wire| driver.heard(now, &bytes, wire));
            } else {
                self.now = self.now.max(due);
                self.drive(HeadDriver::wake);
            }
        }
    }

    /// Asserts that consecutive pings after `from` are at most one step apart. At most `lost` of the distances may be
    /// two steps.
    fn assert_gapless(&self, from: MonoNs, lost: usize) {
        let step = i32::from(self.driver.settings.step_counts);
        let after: Vec<i32> = self.pings.iter().filter(|p| p.0 >= from).map(|p| i32::from(p.1)).collect();
        assert!(after.len() > 100, "{}", after.len());
        let half = COUNTS_PER_TURN / 2;
        let moved = after.windows(2).map(|two| (two[1] - two[0] + half).rem_euclid(COUNTS_PER_TURN) - half);
        let wide: Vec<i32> = moved.filter(|moved| moved.abs() > step).collect();
        assert!(wide.len() <= lost && wide.iter().all(|moved| moved.abs() <= 2 * step), "{wide:?}");
    }

    /// Asserts that each ping after `from` has the position and time of the scan program.
    fn assert_on_time(&self, from: MonoNs) {
        let timetable = &self.driver.timetable;
        let late = DurNs(1_000_000);
        let mut seen = 0;
        for (at, position) in self.pings.iter().filter(|ping| ping.0 >= from) {
            let number = timetable.first_at(*at - late);
            let off = at.since(timetable.due(number));
            assert_eq!(
                Some(*position),
                timetable.ping(number).map(|ping| ping.position),
                "ping {number}, {off:?}"
            );
            assert!(off.0.abs() < late.0, "ping {number} is off by {off:?}");
            seen += 1;
        }
        assert!(seen > 100, "{seen} pings");
    }
}

fn turning(start_rad: f64, growing: bool) -> HeadProgram {
    HeadProgram { start_rad, growing, sector: None }
}

fn after_s(seconds: i64) -> MonoNs {
    BEGUN + DurNs::from_millis(1000 * seconds)
}

#[test]
fn head_is_homed_to_its_scan_program_from_any_position() {
    let sector = HeadProgram { start_rad: 0.5, growing: false, sector: Some((0.0, PI / 2.0)) };
    for text in ["mode = \"fast\"", "mode = \"slow\"\nangle_sign = \"inverted\"\nangle_offset_deg = 40"] {
        for program in [turning(0.0, true), turning(4.0, false), sector] {
            for at_rad in [0.0, 1.0, 3.0, 6.1] {
                let mut rig = Rig::new(text, program, at_rad, Faults::default());
                rig.run(after_s(12));
                rig.assert_on_time(after_s(4));
                rig.assert_gapless(after_s(4), 0);
            }
        }
    }
}

#[test]
fn two_heads_with_separate_drivers_keep_their_phase_difference() {
    let pings: Vec<_> = [0.0, TAU / 2.0]
        .into_iter()
        .map(|start_rad| {
            let mut rig = Rig::new("mode = \"fast\"", turning(start_rad, true), 0.3, Faults::default());
            rig.run(after_s(10));
            rig.pings.into_iter().filter(|ping| ping.0 >= after_s(4)).collect::<Vec<_>>()
        })
        .collect();
    for (one, other) in pings[0].iter().zip(&pings[1]) {
        assert_eq!(one.0, other.0);
        assert_eq!((i32::from(other.1) - i32::from(one.1)).rem_euclid(COUNTS_PER_TURN), COUNTS_PER_TURN / 2);
    }
}

#[test]
fn line_fault_loses_only_the_affected_pings_and_the_phase_recovers() {
    let faults = [
        Faults { lost_commands: vec![300], ..Faults::default() },
        Faults { lost_answers: vec![300, 310], ..Faults::default() },
        Faults { broken_answers: vec![300], ..Faults::default() },
        Faults { doubled_answers: vec![300, 320, 321], ..Faults::default() },
        Faults { halved_answers: vec![(300, DurNs(20_000_000)), (310, STALLS)], ..Faults::default() },
    ];
    for (number, faults) in faults.into_iter().enumerate() {
        let sector = HeadProgram { start_rad: 0.5, growing: true, sector: Some((0.0, PI / 2.0)) };
        let program = if number % 2 == 0 { turning(1.0, true) } else { sector };
        let stalled = faults.halved_answers.iter().filter(|halved| halved.1 == STALLS).count();
        let lost = faults.lost_answers.len() + faults.broken_answers.len() + stalled;
        let mut rig = Rig::new("mode = \"fast\"", program, 1.0, faults);
        rig.run(after_s(30));
        rig.assert_gapless(after_s(3), lost);
        rig.assert_on_time(after_s(20));
    }
}

/// With one answer in fifty lost, the head lags, catches up, and misses only the pings whose answers were lost.
#[test]
fn lossy_line_misses_only_the_lost_pings() {
    let lost: Vec<usize> = (1..60).map(|n| 50 * n).collect();
    let mut rig = Rig::new(
        "mode = \"fast\"",
        turning(0.0, true),
        0.0,
        Faults { lost_answers: lost, ..Faults::default() },
    );
    rig.run(after_s(60));
    rig.assert_gapless(after_s(3), 59);
    let planned = 57.0 / rig.driver.settings.ping_period.as_secs_f64();
    let made = rig.pings.iter().filter(|ping| ping.0 >= after_s(3)).count() as f64;
    assert!(made > 0.95 * planned, "{made} of {planned}");
}

#[test]
fn power_cycled_head_is_located_and_homed() {
    let mut rig = Rig::new("mode = \"fast\"", turning(0.0, true), 0.0, Faults::default());
    rig.run(after_s(5));
    let text = "mode = \"fast\"";
    let at_rest = turning(2.0, false);
    let setup = EmulatorSetup { start: rig.now, head: Some(at_rest), site: Site::default(), polled: false };
    rig.head = HeadEmulator::new(settings(text).unwrap(), LATENCY, &setup);
    rig.run(after_s(30));
    rig.assert_on_time(after_s(12));
}

#[test]
fn silent_head_is_polled_less_often_but_never_given_up() {
    let faults = Faults { lost_commands: (0..10_000).collect(), ..Faults::default() };
    let mut rig = Rig::new("mode = \"fast\"", turning(0.0, true), 0.0, faults);
    rig.run(after_s(100));
    assert!((80..130).contains(&rig.sent.len()), "{}", rig.sent.len());
    assert_eq!(rig.driver.health(), DeviceHealth::default());
}

#[test]
fn wrong_head_and_rejected_commands_are_reported() {
    let mut rig = Rig::new("mode = \"fast\"", turning(0.0, true), 0.0, Faults::default());
    let settings = settings("mode = \"fast\"").unwrap();
    let command = settings.command;
    let answer = |head_id: u8, status: u8| {
        let ping = Head::new(600, true).obey(&command);
        let Return { header, echo } = ping.answer(&command, Some(3.0));
        Return { header: Header { head_id, status: Status(status), ..header }, echo }.encode().unwrap()
    };
    rig.drive(|driver, now, wire| driver.opened(now, wire));
    rig.line.clear();
    rig.drive(|driver, now, wire| driver.heard(now, answer(0x11, 0x40).as_slice(), wire));
    let said = rig.driver.health().complaint.unwrap();
    assert!(said.contains("head 0x11") && said.contains("0x10"), "{said}");
    rig.drive(|driver, now, wire| driver.heard(now, answer(0x10, 0x00).as_slice(), wire));
    assert!(rig.driver.health().complaint.unwrap().contains("doesn't accept"));
}
