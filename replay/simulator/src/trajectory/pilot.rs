//! A pilot's trajectory: moving, stopping, going back to look again, and drifting throughout.

use headrace_geometry::math;

use super::flow::Flow;
use super::knots::{Knots, Offsets, wandering};
use super::place::Place;
use crate::random::Stream;

/// Time between two decisions of the pilot, s.
const STEP_S: f64 = 0.5;
/// Time constant of the vehicle's response to the pilot's joystick, s.
const RESPONSE_S: f64 = 2.0;
/// Largest ratio of a dive's duration to its duration without stops. A dive that takes longer counts as endless.
const MOST_TIMES_AS_LONG: f64 = 50.0;

/// Parameters of a pilot who gets no advice.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Pilot {
    /// Chainages of the dive's start and end, m.
    pub(super) from_m: f64,
    pub(super) to_m: f64,
    /// Position in the cross-section about which the vehicle drifts: y, z, m.
    pub(super) across_m: [f64; 2],
    /// Speed while the vehicle moves, m/s.
    pub(super) speed_mps: f64,
    /// Number of stops per hour; then number of reversals per hour.
    pub(super) stops_per_hour: f64,
    pub(super) backs_per_hour: f64,
    /// Shortest and longest duration of a stop, s. Shortest and longest distance of a reversal, m.
    pub(super) stop_s: [f64; 2],
    pub(super) back_m: [f64; 2],
    /// Amplitude of the drift (left and up, m; roll, pitch and yaw, radians), and its period, s.
    pub(super) reach: Offsets,
    pub(super) period_s: f64,
}

/// A pilot with his trajectory, which depends on the current.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Piloted {
    pilot: Pilot,
    stick: Stream,
    wander: Stream,
    along: Knots,
    beside: Knots,
    duration_s: f64,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Doing {
    Going,
    Standing { left_s: f64 },
    Back { left_m: f64 },
}

impl Pilot {
    /// The vehicle's chainage at one step before the dive's start, and at each time step from the start.
    ///
    /// Errors, as text: the trajectory never ends.
    fn chainages_m(&self, stick: Stream, flow: &Flow) -> Result<Vec<f64>, String> {
        let towards = (self.to_m - self.from_m).signum();
        let plain_s = (self.to_m - self.from_m).abs() / self.speed_mps;
        let most = math::floor_to_i64((plain_s + 60.0) * MOST_TIMES_AS_LONG / STEP_S);
        let (mut x_m, mut speed_mps, mut doing) = (self.from_m, 0.0, Doing::Going);
        let mut xs = vec![x_m, x_m];
        for step in 0.. {
            if (x_m - self.to_m) * towards >= 0.0 {
                break;
            }
            if step > most {
                let after_s = most as f64 * STEP_S;
                return Err(format!("the vehicle has not reached {} m after {after_s} s", self.to_m));
            }
            doing = self.decide(doing, stick, step as u64);
            if (x_m - self.from_m) * towards <= 0.0 && matches!(doing, Doing::Back { .. }) {
                doing = Doing::Going;
            }
            let wanted = match doing {
                Doing::Going => self.speed_mps * towards,
                Doing::Standing { .. } => 0.0,
                Doing::Back { .. } => -self.speed_mps * towards,
            };
            speed_mps += (wanted - speed_mps) * (STEP_S / RESPONSE_S);
            x_m += (speed_mps + flow.at_mps(x_m)) * STEP_S;
            xs.push(x_m);
        }
        Ok(xs)
    }

    fn decide(&self, doing: Doing, stream: Stream, step: u64) -> Doing {
        let [chance, size] = stream.at(step).uniform();
        let between = |[least, most]: [f64; 2]| least + (most - least) * size;
        match doing {
            Doing::Standing { left_s } if left_s > STEP_S => Doing::Standing { left_s: left_s - STEP_S },
            Doing::Back { left_m } if left_m > self.speed_mps * STEP_S => {
                Doing::Back { left_m: left_m - self.speed_mps * STEP_S }
            }
            Doing::Standing { .. } | Doing::Back { .. } => Doing::Going,
            Doing::Going => {
                let [stop, back] = [self.stops_per_hour, self.backs_per_hour].map(|n| n * STEP_S / 3600.0);
                if chance < stop {
                    Doing::Standing { left_s: between(self.stop_s) }
                } else if chance < stop + back {
                    Doing::Back { left_m: between(self.back_m) }
                } else {
                    Doing::Going
                }
            }
        }
    }
}

impl Piloted {
    /// A pilot's trajectory in still water.
    ///
    /// Errors, as text: the trajectory never ends.
    pub(super) fn new(pilot: Pilot, stick: Stream, wander: Stream) -> Result<Self, String> {
        let nowhere = Knots::new(0.0, STEP_S, |_| [0.0; 6]);
        let (along, beside) = (nowhere.clone(), nowhere);
        let mut piloted = Self { pilot, stick, wander, along, beside, duration_s: 0.0 };
        piloted.go(&Flow::default())?;
        Ok(piloted)
    }

    pub(super) fn duration_s(&self) -> f64 {
        self.duration_s
    }

    pub(super) fn place(&self, after_s: f64) -> Place {
        let mut place = Place::from_offsets(self.along.at(after_s));
        place.shift(&self.beside.at(after_s));
        place
    }

    /// Recomputes the pilot's trajectory for water that flows as `flow` says.
    pub(super) fn carry(&mut self, flow: &Flow) -> Result<(), String> {
        self.go(flow).map_err(|why| format!("carries the vehicle off: {why}"))
    }

    fn go(&mut self, flow: &Flow) -> Result<(), String> {
        let pilot = self.pilot;
        let xs = pilot.chainages_m(self.stick, flow)?;
        let [y, z] = pilot.across_m;
        self.duration_s = xs.len().saturating_sub(2) as f64 * STEP_S;
        self.along = Knots::new(self.duration_s, STEP_S, |k| {
            let index = usize::try_from(k + 1).unwrap_or(0);
            let x = xs.get(index).or(xs.last()).copied().unwrap_or(pilot.from_m);
            [x, y, z, 0.0, 0.0, 0.0]
        });
        self.beside = wandering(self.wander, self.duration_s, pilot.period_s, pilot.reach);
        Ok(())
    }
}
