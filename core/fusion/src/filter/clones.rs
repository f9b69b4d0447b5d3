//! Relative error covariance between two epochs, by stochastic cloning.
//!
//! The relative error is the error of the displacement between the epochs. Coverage needs it, because it compares two
//! head passes. It is smaller than the error of either position. A sample stays where it was georeferenced, so its
//! error is that of the estimate at the time of its ping.
//!
//! Each clone keeps the error covariance at its time, and the transition of errors since the previous clone. The
//! transition includes propagation and corrections. Derivation: `docs/why/navigation.md`, "Relative uncertainty".

use serde::{Deserialize, Serialize};

use super::factors::{Factors, Gain};
use super::inertial::Transition;
use super::state::{ATTITUDE, ERRORS, Errors, POSITION};
use crate::relative::Relative;
use headrace_geometry::snapshot::stateful;
use headrace_geometry::time::{DurNs, MonoNs};

/// Time between two clones of the filter's errors.
pub const STEP: DurNs = DurNs(2_000_000_000);
/// Number of clones kept. Together, these clones cover over four turns of a head in its slowest mode (4 x 28 s).
pub const CLONES: usize = 60;
/// The chainage has suddenly become more certain if its variance falls below this share of its earlier variance.
///
/// For instance, this happens when the cable counter sends again after a silence.
const SURE_SHARE: f64 = 0.1;
/// Errors that move a sample along the tunnel: chainage, pitch and yaw.
pub const MOVING: [usize; 3] = [POSITION, ATTITUDE + 1, ATTITUDE + 2];

type Square = [Errors; ERRORS];

#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
struct Moment {
    at: MonoNs,
    /// Rows of the error covariance at the time of the clone, for the errors in `MOVING`.
    rows: [Errors; 3],
    /// Columns of the matrix that propagates errors from the previous clone to this one.
    since_last: Square,
    /// Covariance of this clone's errors relative to the newest clone's errors.
    relative: Relative,
}

impl Moment {
    /// Variance of the chainage at the time of the clone, m^2.
    fn chainage_m2(&self) -> f64 {
        self.rows[0][POSITION]
    }

    /// Whether this clone's chainage is much more uncertain than a later chainage, whose variance is `later_m2`.
    fn is_unsure_beside(&self, later_m2: f64) -> bool {
        later_m2 < SURE_SHARE * self.chainage_m2()
    }
}

/// Clones of earlier errors, for relative covariances.
#[derive(Debug, Clone)]
pub struct ErrorClones {
    /// Clones of earlier errors, in a ring buffer.
    clones: Vec<Moment>,
    count: usize,
    /// Columns of the matrix that propagates errors from the newest clone to the present.
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

    /// Extends the propagation since the newest clone by an error transition.
    pub fn carry(&mut self, transition: &Transition) {
        for column in &mut self.since {
            transition.apply(column);
        }
    }

    /// Extends the propagation since the newest clone by the correction of a measurement.
    pub fn measure(&mut self, h: &Errors, gain: &Gain<ERRORS>) {
        for column in &mut self.since {
            let seen: f64 = column.iter().zip(h).map(|(c, h)| c * h).sum();
            for (c, k) in column.iter_mut().zip(&gain.k) {
                *c -= k * seen;
            }
        }
    }

    /// Adds a clone if the newest clone is old enough, or if the chainage has suddenly become more certain since that
    /// clone.
    pub fn note(&mut self, at: MonoNs, factors: &Factors<ERRORS>) {
        let is_enough = |newest: &Moment| {
            at.since(newest.at).0 < STEP.0 && !newest.is_unsure_beside(factors.variance(POSITION))
        };
        debug_assert!(
            self.newest().is_none_or(|newest| newest.at <= at),
            "clones are in order of time: {at:?}"
        );
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
        let kept = self.clones.len();
        debug_assert!(kept == self.count.min(CLONES), "{} clones fill {kept} of {CLONES} places", self.count);
        self.compare();
    }

    /// Returns the covariance of the newest clone's errors relative to the errors at the time `lag` before that
    /// clone.
    ///
    /// `None` if there are fewer than two clones. A lag beyond the oldest clone is extrapolated.
    pub fn relative(&self, lag: DurNs) -> Option<Relative> {
        let newest = self.newest()?;
        let kept = self.clones.len();
        // For a lag of zero, the relative covariance is zero.
        let (mut newer_s, mut newer, mut newer_m2) = (0.0, Relative::default(), newest.chainage_m2());
        let wanted_s = lag.as_secs_f64();
        for back in 1..kept {
            let clone = self.back(back)?;
            let age_s = newest.at.since(clone.at).as_secs_f64();
            if age_s >= wanted_s {
                // The chainage has suddenly become more certain since this older clone. All soundings from before are
                // as uncertain as this clone.
                if clone.is_unsure_beside(newer_m2) {
                    return Some(clone.relative);
                }
                let share = (wanted_s - newer_s) / (age_s - newer_s);
                debug_assert!((0.0..=1.0).contains(&share), "{wanted_s} s is from {newer_s} to {age_s} s");
                return Some(newer.weighted(1.0 - share, &clone.relative, share));
            }
            (newer_s, newer, newer_m2) = (age_s, clone.relative, clone.chainage_m2());
        }
        // Beyond the oldest clone, the covariance is extrapolated linearly in time.
        (kept > 1).then(|| newer.weighted(wanted_s / newer_s, &newer, 0.0))
    }

    /// Computes the covariance of each older clone relative to the newest clone.
    ///
    /// It goes back through the clones. At each clone, it updates the matrix that maps the errors of this clone to
    /// those of the newest clone.
    fn compare(&mut self) {
        let Some(now) = self.newest().copied() else {
            debug_assert!(false, "there is a clone to compare with: {} so far", self.count);
            return;
        };
        let mut depends = MOVING.map(|i| core::array::from_fn(|j| if i == j { 1.0 } else { 0.0 }));
        let mut since = now.since_last;
        for back in 1..self.clones.len() {
            depends = depends.map(|row| product(&row, &since));
            let number = (self.count - 1 - back) % CLONES;
            let Some(clone) = self.clones.get_mut(number) else {
                debug_assert!(false, "clone {number} is one of {CLONES}");
                return;
            };
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

/// Returns the covariance of the difference between the present and earlier errors.
///
/// `depends` contains the rows of the matrix that maps the earlier errors to the present errors.
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

/// Product of a row vector and a matrix that is given by its columns.
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

    /// Soundings placed while the cable counter is silent stay uncertain.
    ///
    /// Those placed in the last 2 s before the counter sends again are as uncertain as the earlier ones.
    #[test]
    fn soundings_placed_while_the_cable_counter_is_silent_stay_uncertain() {
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
        // The last clone was 1.1 s old when the cable counter sent again.
        for lag_s in [0.1, 0.5, 1.1, 2.0, 4.0] {
            let is_m = sd_m(&clones, lag_s);
            assert!((is_m - 1.0).abs() < 0.01, "{lag_s}: {is_m}");
        }
        for k in 52..=90 {
            clones.note(at(k), &factors);
        }
        // The clones at 5.1 s and 7.1 s, after the counter sent again, are certain. Soundings placed before these
        // clones stay uncertain.
        let [since_m, before_m] = [1.9, 4.0].map(|lag_s| sd_m(&clones, lag_s));
        assert!(since_m < 0.1 && (before_m - 1.0).abs() < 0.01, "{since_m} {before_m}");
    }
}
