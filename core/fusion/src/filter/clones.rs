//! Relative error covariance between two epochs (stochastic cloning): the error of the displacement between them, which
//! matters when two passes of a head are compared, and is less than the errors of either position.
//!
//! A sample stays where it was georeferenced; its error is that of the estimate then, and isn't corrected later. So each
//! clone keeps the covariance of the errors at its time, and their transition from the clone before, through the
//! filter's propagation and corrections. Derivation: `docs/fusion.md`, "Relative uncertainty".

use serde::{Deserialize, Serialize};

use super::factors::{Factors, Gain};
use super::inertial::Transition;
use super::state::{ATTITUDE, ERRORS, Errors, POSITION};
use crate::relative::Relative;
use headrace_geometry::snapshot::stateful;
use headrace_geometry::time::{DurNs, MonoNs};

/// Time between two clones.
pub const STEP: DurNs = DurNs(2_000_000_000);
/// Clones kept: over four turns of a head in its slowest mode (4 x 28 s).
pub const CLONES: usize = 60;
/// Errors that move a sample along the tunnel: chainage, pitch and yaw.
pub const MOVING: [usize; 3] = [POSITION, ATTITUDE + 1, ATTITUDE + 2];

type Square = [Errors; ERRORS];

#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
struct Moment {
    at: MonoNs,
    /// Rows of the covariance at that time.
    rows: [Errors; 3],
    /// By columns: transition of errors from the clone before.
    since_last: Square,
    /// Relative to the newest clone.
    relative: Relative,
}

/// See the module's description.
#[derive(Debug, Clone)]
pub struct ErrorClones {
    /// Ring buffer.
    clones: Vec<Moment>,
    count: usize,
    /// By columns: transition of errors from the newest clone until now.
    since: Square,
}

stateful!(ErrorClones { state: count, since; lists: clones; });

impl Default for ErrorClones {
    fn default() -> Self {
        Self { clones: Vec::with_capacity(CLONES), count: 0, since: identity() }
    }
}

impl ErrorClones {
    /// Removes all clones.
    pub fn clear(&mut self) {
        self.clones.clear();
        (self.count, self.since) = (0, identity());
    }

    /// Propagates the errors.
    pub fn carry(&mut self, transition: &Transition) {
        for column in &mut self.since {
            transition.apply(column);
        }
    }

    /// Applies the correction by a measurement to the errors.
    pub fn measure(&mut self, h: &Errors, gain: &Gain<ERRORS>) {
        for column in &mut self.since {
            let seen: f64 = column.iter().zip(h).map(|(c, h)| c * h).sum();
            for (c, k) in column.iter_mut().zip(&gain.k) {
                *c -= k * seen;
            }
        }
    }

    /// Adds a clone when the last one is old enough.
    pub fn note(&mut self, at: MonoNs, factors: &Factors<ERRORS>) {
        if self.newest().is_some_and(|newest| at.since(newest.at).0 < STEP.0) {
            return;
        }
        let rows = factors.rows(MOVING);
        let clone = Moment { at, rows, since_last: self.since, relative: Relative::default() };
        if self.clones.len() < CLONES {
            self.clones.push(clone);
        } else if let Some(slot) = self.clones.get_mut(self.count % CLONES) {
            *slot = clone;
        }
        self.count += 1;
        self.since = identity();
        self.compare();
    }

    /// Covariance at the newest clone relative to `lag` before, extrapolated beyond the oldest; `None` before there are two.
    pub fn relative(&self, lag: DurNs) -> Option<Relative> {
        let newest = self.newest()?;
        let kept = self.clones.len();
        // Zero over no time.
        let (mut newer_s, mut newer) = (0.0, Relative::default());
        let wanted_s = lag.as_secs_f64();
        for back in 1..kept {
            let clone = self.back(back)?;
            let age_s = newest.at.since(clone.at).as_secs_f64();
            if age_s >= wanted_s {
                let share = (wanted_s - newer_s) / (age_s - newer_s);
                return Some(newer.weighted(1.0 - share, &clone.relative, share));
            }
            (newer_s, newer) = (age_s, clone.relative);
        }
        // Beyond the oldest clone, extrapolated linearly in time.
        (kept > 1).then(|| newer.weighted(wanted_s / newer_s, &newer, 0.0))
    }

    /// Compares each older clone with the newest: backwards, carrying along the dependence of its errors on older ones.
    fn compare(&mut self) {
        let Some(now) = self.newest().copied() else { return };
        let mut depends = MOVING.map(|i| core::array::from_fn(|j| if i == j { 1.0 } else { 0.0 }));
        let mut since = now.since_last;
        for back in 1..self.clones.len() {
            depends = depends.map(|row| product(&row, &since));
            let number = (self.count - 1 - back) % CLONES;
            let Some(clone) = self.clones.get_mut(number) else { return };
            clone.relative = against(&now.rows, &clone.rows, &depends);
            since = clone.since_last;
        }
    }

    fn newest(&self) -> Option<&Moment> {
        self.back(0)
    }

    fn back(&self, back: usize) -> Option<&Moment> {
        self.clones.get(self.count.checked_sub(1 + back)? % CLONES)
    }
}

/// Covariance of the difference of errors, where `depends` maps the errors then to those now.
fn against(now: &[Errors; 3], then: &[Errors; 3], depends: &[Errors; 3]) -> Relative {
    let cross: [[f64; 3]; 3] = depends.map(|row| then.map(|column| sum(&row, &column)));
    let mut relative = [[0.0; 3]; 3];
    for (r, row) in relative.iter_mut().enumerate() {
        for (c, slot) in row.iter_mut().enumerate() {
            let pick = |rows: &[Errors; 3]| {
                let column = MOVING.get(c).copied().unwrap_or(0);
                rows.get(r).and_then(|row| row.get(column)).copied().unwrap_or(0.0)
            };
            let of = |r: usize, c: usize| cross.get(r).and_then(|row| row.get(c)).copied().unwrap_or(0.0);
            *slot = pick(now) + pick(then) - of(r, c) - of(c, r);
        }
    }
    Relative::new(relative)
}

fn sum(a: &Errors, b: &Errors) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// A row times a matrix given by columns.
fn product(row: &Errors, columns: &Square) -> Errors {
    columns.map(|column| sum(row, &column))
}

fn identity() -> Square {
    core::array::from_fn(|j| core::array::from_fn(|i| if i == j { 1.0 } else { 0.0 }))
}
