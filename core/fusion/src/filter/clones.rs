//! How well two moments are known against each other: the error of a displacement between them, which is what counts when
//! two passes of a head are compared, and is less than the errors of either place.
//!
//! A sample stays where it was placed; its error is that of the estimate then, and isn't corrected later. So each clone
//! keeps the covariance of the errors at its time, and how they have become those of the next clone: through the
//! filter's own propagation and corrections. Derivation: `docs/fusion.md`, "Relative uncertainty".

use serde::{Deserialize, Serialize};

use super::factors::{Factors, Gain};
use super::inertial::Transition;
use super::state::{ATTITUDE, ERRORS, Errors, POSITION};
use crate::relative::Relative;
use headrace_geometry::time::{DurNs, MonoNs};
use headrace_snapshot::stateful;

/// Time between two clones.
pub const STEP: DurNs = DurNs(2_000_000_000);
/// Clones that are kept: over four turns of a head in its slowest mode (4 x 28 s).
pub const CLONES: usize = 60;
/// Errors that move a sample along the tunnel: of chainage, pitch and yaw.
pub const MOVING: [usize; 3] = [POSITION, ATTITUDE + 1, ATTITUDE + 2];

type Square = [Errors; ERRORS];

#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
struct Moment {
    at: MonoNs,
    /// Rows of the covariance then.
    rows: [Errors; 3],
    /// By columns: how errors at the clone before have become those then.
    since_last: Square,
    /// Against the newest clone.
    relative: Relative,
}

/// See the module's description.
#[derive(Debug, Clone)]
pub struct ErrorClones {
    /// A ring.
    clones: Vec<Moment>,
    count: usize,
    /// By columns: how errors at the newest clone have become those now.
    since: Square,
}

stateful!(ErrorClones { state: count, since; lists: clones; });

impl Default for ErrorClones {
    fn default() -> Self {
        Self { clones: Vec::with_capacity(CLONES), count: 0, since: identity() }
    }
}

impl ErrorClones {
    /// Forgets everything.
    pub fn clear(&mut self) {
        self.clones.clear();
        (self.count, self.since) = (0, identity());
    }

    /// Errors move on.
    pub fn carry(&mut self, transition: &Transition) {
        for column in &mut self.since {
            transition.apply(column);
        }
    }

    /// Errors are corrected by a measurement.
    pub fn measure(&mut self, h: &Errors, gain: &Gain<ERRORS>) {
        for column in &mut self.since {
            let seen: f64 = column.iter().zip(h).map(|(c, h)| c * h).sum();
            for (c, k) in column.iter_mut().zip(&gain.k) {
                *c -= k * seen;
            }
        }
    }

    /// Notes the errors of this moment when the last clone is old enough.
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

    /// Errors of now against those `lag` ago, or as long ago as is known; `None` before there are two moments.
    pub fn relative(&self, lag: DurNs) -> Option<Relative> {
        let newest = self.newest()?;
        let kept = self.clones.len();
        // Over no time, nothing has changed.
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
        // Beyond, as if what is known went on growing as evenly.
        (kept > 1).then(|| newer.weighted(wanted_s / newer_s, &newer, 0.0))
    }

    /// Against the newest clone, each older one: from it backwards, carrying along how its errors depend on older ones.
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

/// Covariance of the difference of errors, where those now depend on those then as told.
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

/// A row times a matrix that is given by columns.
fn product(row: &Errors, columns: &Square) -> Errors {
    columns.map(|column| sum(row, &column))
}

fn identity() -> Square {
    core::array::from_fn(|j| core::array::from_fn(|i| if i == j { 1.0 } else { 0.0 }))
}
