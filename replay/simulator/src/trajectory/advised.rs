//! Trajectory of a pilot who follows a monitor's advice. The trajectory is decided during the dive, a few seconds
//! ahead.

use headrace_geometry::math;
use headrace_geometry::time::{DurNs, MonoNs};

use super::flow::Flow;
use super::knots::{Knots, Offsets, wandering};
use super::place::Place;
use crate::clock::START;
use crate::random::Stream;

/// Time between two decisions of the pilot, s.
const STEP_S: f64 = 0.5;
/// Time constant of the vehicle's response to the pilot's joystick, s.
const RESPONSE_S: f64 = 2.0;
/// Maximum number of knots after a time on which the position at that time depends.
const KNOTS_AHEAD: i64 = 3;
/// Speed at which the pilot goes back to a missed stretch, m/s.
const BACK_MPS: f64 = 0.2;
/// Distance of a missed stretch behind the vehicle from which on the pilot goes back for the stretch, m.
const BEHIND_M: f64 = 3.0;
/// Distance before a missed stretch from which the pilot passes it a second time, m.
const RUN_UP_M: f64 = 2.5;
/// Period of the variation of the driven speed relative to the advised speed, s.
const HOLD_S: f64 = 20.0;
/// Maximum total time that the pilot keeps the vehicle stationary because of advice, s.
const MOST_STOOD_S: f64 = 120.0;
/// Time that the pilot waits for more advice at the end of the dive, in addition to his reaction time `lag_s`, s.
const WAITS_S: f64 = 10.0;

/// The monitor's advice to the pilot at one time.
#[derive(Debug, Clone, PartialEq)]
pub struct PilotAdvice {
    /// Time at which the advice is given.
    pub at: MonoNs,
    /// Largest speed that meets the sampling target, m/s; zero if no speed does, `None` if unknown.
    pub v_max_mps: Option<f64>,
    /// Whether the pilot should keep the vehicle stationary for a while.
    pub stand: bool,
    /// First and last chainage of each missed stretch that has not been cleared yet, m.
    pub missed_m: Vec<[f64; 2]>,
}

/// A stretch on which the pilot is in a hurry and ignores advice.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Hurry {
    pub(super) from_m: f64,
    pub(super) to_m: f64,
    pub(super) speed_mps: f64,
}

/// Parameters of a pilot who follows advice.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Heeding {
    /// Chainages of the dive's start and end, m. The end has the larger chainage.
    pub(super) from_m: f64,
    pub(super) to_m: f64,
    /// Position in the cross-section about which the vehicle drifts: y, z, m.
    pub(super) across_m: [f64; 2],
    /// Maximum speed of the vehicle, m/s.
    pub(super) speed_mps: f64,
    /// Delay between advice and the pilot's action, at least 3 s.
    pub(super) lag_s: f64,
    /// Largest share by which the driven speed falls short of the advised speed.
    pub(super) within: f64,
    /// Whether the pilot passes missed stretches a second time.
    pub(super) goes_back: bool,
    /// Whether the pilot stops when advised to, and waits for the first advice before setting out. The monitor advises
    /// a stop if it needs to estimate gyro biases or has no position.
    pub(super) stops_if_advised: bool,
    /// Time that the pilot waits at the dive's start before setting out, s.
    pub(super) waits_s: f64,
    pub(super) hurries: Vec<Hurry>,
    /// Maximum duration of the dive, s.
    pub(super) at_most_s: f64,
    /// Amplitude of the drift (left and up, m; roll, pitch and yaw, radians), and its period, s.
    pub(super) reach: Offsets,
    pub(super) period_s: f64,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Doing {
    Going,
    Back { to_m: f64 },
    Waiting { left_s: f64 },
    Done,
}

/// The advised pilot, and the trajectory decided so far.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Advised {
    pilot: Heeding,
    along: Knots,
    beside: Knots,
    hold: Knots,
    flow: Flow,
    advice_list: Vec<PilotAdvice>,
    doing: Doing,
    x_m: f64,
    speed_mps: f64,
    farthest_m: f64,
    /// Missed stretches that the pilot has gone back for, each extended by 1 m at both ends.
    tried_m: Vec<[f64; 2]>,
    /// Number of the next knot of the trajectory that the pilot decides.
    next: i64,
    ended_s: Option<f64>,
    /// Total time that the pilot has kept the vehicle stationary because of advice, s.
    stood_s: f64,
}

impl Advised {
    pub(super) fn new(pilot: Heeding, wander: Stream, hold: Stream) -> Self {
        let (from_m, [y, z]) = (pilot.from_m, pilot.across_m);
        let plan = |k: i64| {
            let x_m = (from_m + pilot.speed_mps * STEP_S * k.max(0) as f64).min(pilot.to_m);
            [x_m, y, z, 0.0, 0.0, 0.0]
        };
        let along = Knots::new(pilot.at_most_s, STEP_S, plan);
        let beside = wandering(wander, pilot.at_most_s, pilot.period_s, pilot.reach);
        let hold = wandering(hold, pilot.at_most_s, HOLD_S, [pilot.within, 0.0, 0.0, 0.0, 0.0, 0.0]);
        Self {
            along,
            beside,
            hold,
            flow: Flow::default(),
            advice_list: Vec::new(),
            doing: Doing::Going,
            x_m: from_m,
            speed_mps: 0.0,
            farthest_m: from_m,
            tried_m: Vec::new(),
            next: -1,
            ended_s: None,
            stood_s: 0.0,
            pilot,
        }
    }

    /// Maximum duration of the dive, s. Once the pilot has finished, it is the actual duration.
    pub(super) fn duration_s(&self) -> f64 {
        self.ended_s.unwrap_or(self.pilot.at_most_s)
    }

    pub(super) fn place(&self, after_s: f64) -> Place {
        let mut place = Place::from_offsets(self.along.at(after_s));
        place.shift(&self.beside.at(after_s));
        place
    }

    /// Lets the water's flow carry the vehicle.
    pub(super) fn carry(&mut self, flow: &Flow) {
        self.flow = flow.clone();
    }

    /// Processes advice and decides the motion until `until_s` seconds after the start.
    pub(super) fn lead(&mut self, advice: Vec<PilotAdvice>, until_s: f64) {
        self.advice_list.extend(advice);
        let last = math::floor_to_i64(until_s / STEP_S) + KNOTS_AHEAD;
        while self.next <= last {
            let at_s = self.next as f64 * STEP_S;
            if at_s > 0.0 && self.ended_s.is_none() {
                self.step(at_s);
            }
            self.along.set(self.next, 0, self.x_m);
            self.next += 1;
        }
    }

    fn step(&mut self, at_s: f64) {
        let advice = self.advice_at(at_s);
        let missed_m = advice.as_ref().and_then(|advice| self.to_go_back_for(advice));
        self.doing = self.decide(at_s, missed_m);
        let wanted_mps = match self.doing {
            Doing::Going if at_s < self.pilot.waits_s => 0.0,
            Doing::Going => self.wanted_mps(at_s, advice.as_ref()),
            Doing::Back { .. } => -BACK_MPS,
            Doing::Waiting { .. } | Doing::Done => 0.0,
        };
        self.speed_mps += (wanted_mps - self.speed_mps) * (STEP_S / RESPONSE_S);
        self.x_m += (self.speed_mps + self.flow.at_mps(self.x_m)) * STEP_S;
        self.farthest_m = self.farthest_m.max(self.x_m);
    }

    fn decide(&mut self, at_s: f64, missed_m: Option<[f64; 2]>) -> Doing {
        let pilot = &self.pilot;
        match (self.doing, missed_m) {
            (Doing::Going | Doing::Waiting { .. }, Some([from_m, to_m])) => {
                self.tried_m.push([from_m - 1.0, to_m + 1.0]);
                Doing::Back { to_m: (from_m - RUN_UP_M).max(pilot.from_m) }
            }
            (Doing::Going, None) if self.x_m >= pilot.to_m => {
                Doing::Waiting { left_s: pilot.lag_s + WAITS_S }
            }
            (Doing::Back { to_m }, _) if self.x_m <= to_m => Doing::Going,
            (Doing::Waiting { left_s }, None) if left_s > 0.0 => Doing::Waiting { left_s: left_s - STEP_S },
            (Doing::Waiting { .. }, None) => {
                self.ended_s = Some(at_s);
                Doing::Done
            }
            (doing, _) => doing,
        }
    }

    /// The advice that the pilot follows at `at_s`: the latest advice that was given at least `lag_s` earlier, if any.
    fn advice_at(&self, at_s: f64) -> Option<PilotAdvice> {
        let by = START + DurNs::from_secs_f64((at_s - self.pilot.lag_s).max(0.0));
        let advice_list = |advice: &&PilotAdvice| advice.at <= by && by > MonoNs(START.0);
        self.advice_list.iter().rev().find(advice_list).cloned()
    }

    /// The missed stretch farthest behind the vehicle that the pilot has not gone back for. It must lie at least
    /// [`BEHIND_M`] behind the vehicle, unless the pilot waits at the end of the dive.
    fn to_go_back_for(&self, advice: &PilotAdvice) -> Option<[f64; 2]> {
        let behind_m = if matches!(self.doing, Doing::Waiting { .. }) { 0.0 } else { BEHIND_M };
        let missed = advice.missed_m.iter().filter(|[from_m, to_m]| {
            let tried = |[first_m, last_m]: &[f64; 2]| from_m < last_m && to_m > first_m;
            *to_m < self.x_m - behind_m && !self.tried_m.iter().any(tried)
        });
        let missed = missed.copied().reduce(|a, b| if b[0] < a[0] { b } else { a });
        missed.filter(|_| self.pilot.goes_back)
    }

    /// Whether the pilot keeps the vehicle stationary. The total time is limited to [`MOST_STOOD_S`].
    fn keeps_stationary(&mut self, advice: Option<&PilotAdvice>) -> bool {
        let is_stationary = self.pilot.stops_if_advised
            && self.stood_s < MOST_STOOD_S
            && advice.is_none_or(|advice| advice.stand);
        self.stood_s += if is_stationary { STEP_S } else { 0.0 };
        is_stationary
    }

    fn wanted_mps(&mut self, at_s: f64, advice: Option<&PilotAdvice>) -> f64 {
        let pilot = &self.pilot;
        let anew = self.x_m > self.farthest_m - 0.5;
        let hurry = pilot.hurries.iter().find(|hurry| (hurry.from_m..hurry.to_m).contains(&self.x_m));
        let [swing, ..] = self.hold.at(at_s);
        let hold = (swing - pilot.within) / 2.0;
        if let Some(hurry) = hurry.filter(|_| anew) {
            return hurry.speed_mps * (1.0 + hold);
        }
        if self.keeps_stationary(advice) {
            return 0.0;
        }
        let pilot = &self.pilot;
        // If no speed meets the target, or the speed is unknown, the pilot continues at his own speed.
        let v_max_mps = advice.and_then(|advice| advice.v_max_mps).filter(|v_max_mps| *v_max_mps > 0.0);
        v_max_mps.map_or(pilot.speed_mps, |v_max_mps| (v_max_mps * (1.0 + hold)).min(pilot.speed_mps))
    }
}
