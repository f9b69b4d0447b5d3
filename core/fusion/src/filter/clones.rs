//! Relative error covariance between two epochs (stochastic cloning): the error of the displacement between them, which
//! matters when two passes of a head are compared, and is less than the errors of either position.
//!
//! A sample stays where it was georeferenced; its error is that of the estimate then, and isn't corrected later. So each
//! clone keeps the covariance of the errors at its time, and their transition from the clone before, through the
//! filter's propagation and corrections. Derivation: `docs/why/navigation.md`, "Relative uncertainty".

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
/// Share to which the variance of the chainage has fallen where it became sure at once: as a silent cable is heard again.
const SURE_SHARE: f64 = 0.1;
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

impl Moment {
    /// Variance of the chainage, m^2.
    fn chainage_m2(&self) -> f64 {
        self.rows[0][POSITION]
    }

    /// Whether its chainage is unsure beside one of a later time with this variance, m^2.
    fn is_unsure_beside(&self, later_m2: f64) -> bool {
        later_m2 < SURE_SHARE * self.chainage_m2()
    }
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

    /// Adds a clone when the last one is old enough, or the chainage has become sure since.
    pub fn note(&mut self, at: MonoNs, factors: &Factors<ERRORS>) {
        let is_enough = |newest: &Moment| {
            at.since(newest.at).0 < STEP.0 && !newest.is_unsure_beside(factors.variance(POSITION))
        };
        if self.newest().is_some_and(is_enough) {
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
        let (mut newer_s, mut newer, mut newer_m2) = (0.0, Relative::default(), newest.chainage_m2());
        let wanted_s = lag.as_secs_f64();
        for back in 1..kept {
            let clone = self.back(back)?;
            let age_s = newest.at.since(clone.at).as_secs_f64();
            if age_s >= wanted_s {
                // What was placed in between was placed as unsurely as before.
                if clone.is_unsure_beside(newer_m2) {
                    return Some(clone.relative);
                }
                let share = (wanted_s - newer_s) / (age_s - newer_s);
                return Some(newer.weighted(1.0 - share, &clone.relative, share));
            }
            (newer_s, newer, newer_m2) = (age_s, clone.relative, clone.chainage_m2());
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

#[cfg(test)]
mod tests {
    use headrace_geometry::frames::Vec3;

    use super::*;

    /// What was placed while a cable was silent was placed unsurely until it was heard, not ever more surely in the 2 s before.
    #[test]
    fn a_chainage_that_becomes_sure_at_once_was_unsure_until_then() {
        let mut clones = ErrorClones::default();
        let mut factors = Factors::independent(core::array::from_fn(|_| 1.0));
        let at = |k: i64| MonoNs(0) + DurNs::from_millis(100 * k);
        for k in 0..=50 {
            clones.note(at(k), &factors);
        }
        let chainage = core::array::from_fn(|i| if i == POSITION { 1.0 } else { 0.0 });
        let gain = factors.measure(&chainage, 1e-4);
        clones.measure(&chainage, &gain);
        clones.note(at(51), &factors);
        let sd_m = |clones: &ErrorClones, lag_s: f64| {
            clones.relative(DurNs::from_secs_f64(lag_s)).unwrap().sd_m(Vec3::zero())
        };
        // The last clone before was 1.1 s old.
        for lag_s in [0.1, 0.5, 1.1, 2.0, 4.0] {
            let is_m = sd_m(&clones, lag_s);
            assert!((is_m - 1.0).abs() < 0.01, "{lag_s}: {is_m}");
        }
        for k in 52..=90 {
            clones.note(at(k), &factors);
        }
        // Surely placed since, at 5.1, 7.1 and, as the newest, 8.1 s or before; and before that as unsurely as ever.
        let [since_m, before_m] = [1.9, 4.0].map(|lag_s| sd_m(&clones, lag_s));
        assert!(since_m < 0.1 && (before_m - 1.0).abs() < 0.01, "{since_m} {before_m}");
    }
}
