//! Relative error covariance between a smoothed epoch and the epoch of the previous head pass.
//!
//! The backward pass goes back in time, so it reaches the later of these two epochs first. The later epoch waits until
//! the backward pass reaches the earlier one, which is one pass gap before it.

use super::rts_step::Gain;
use crate::filter::clones::{CLONES, MOVING, STEP};
use crate::filter::factors::Factors;
use crate::filter::state::{ERRORS, Errors};
use crate::relative::Relative;
use headrace_geometry::time::{DurNs, MonoNs};

/// Marks the pass gap of an epoch without a related earlier head pass. The cable has slipped since that pass.
pub const UNTIED: DurNs = DurNs(i64::MAX);
/// Standard deviation of the relative chainage error of an epoch without a related earlier pass, m.
const UNTIED_M: f64 = 1e3;

/// An epoch that waits until the backward pass reaches the previous head pass.
#[derive(Debug, Clone, Copy)]
struct Moment {
    /// Index of the epoch in the list of results.
    number: usize,
    at: MonoNs,
    /// Time since the previous pass of the heads.
    gap: DurNs,
    /// Rows of the epoch's covariance, for the errors in [`MOVING`].
    own: [Errors; 3],
    /// Cross-covariances of the errors in `own` with all errors at the current epoch of the backward pass.
    with: [Errors; 3],
    /// Time from the current epoch of the backward pass to this epoch, s (`age_s`), and relative covariance of the two
    /// (`relative`).
    age_s: f64,
    relative: Relative,
}

/// Epochs that wait until the backward pass reaches their previous head pass. The latest epoch comes first.
#[derive(Debug, Clone, Default)]
pub struct Later {
    waiting: Vec<Moment>,
    newest: Option<MonoNs>,
}

/// Index of an epoch in the list of results, and the epoch's covariance relative to the previous head pass.
pub type Answer = (usize, Relative);

impl Later {
    /// Whether an epoch at the time `at` should be added. True for the first epoch, and for epochs at least [`STEP`]
    /// before the one added last.
    pub fn is_due(&self, at: MonoNs) -> bool {
        self.newest.is_none_or(|newest| newest.since(at).0 >= STEP.0)
    }

    /// Adds an epoch that waits for the epoch one `gap` earlier.
    ///
    /// If there is no room, removes the epoch that has waited longest, and returns its relative covariance.
    pub fn note(
        &mut self,
        number: usize,
        at: MonoNs,
        gap: DurNs,
        factors: &Factors<ERRORS>,
    ) -> Option<Answer> {
        let own = factors.rows(MOVING);
        self.newest = Some(at);
        let first = (self.waiting.len() == CLONES).then(|| self.waiting.remove(0).answer());
        let relative = Relative::default();
        self.waiting.push(Moment { number, at, gap, own, with: own, age_s: 0.0, relative });
        first
    }

    /// Moves the backward pass to an earlier epoch. Passes the relative covariances of the epochs that have waited for
    /// it to `answer`.
    pub fn back(
        &mut self,
        at: MonoNs,
        gain: &Gain<ERRORS>,
        factors: &Factors<ERRORS>,
        mut answer: impl FnMut(Answer),
    ) {
        let rows = factors.rows(MOVING);
        for moment in &mut self.waiting {
            moment.with = moment.with.map(|column| gain.back(&column));
            moment.age_s = moment.at.since(at).as_secs_f64();
            moment.relative = against(&moment.own, &rows, &moment.with);
        }
        self.waiting.retain(|moment| {
            let is_done = moment.at.since(at).0 >= moment.gap.0;
            if is_done {
                answer((moment.number, moment.relative));
            }
            !is_done
        });
    }

    /// Ends a piece of the track. Passes the relative covariances of all epochs that still wait to `answer`.
    pub fn end(&mut self, answer: impl FnMut(Answer)) {
        self.waiting.drain(..).map(|moment| moment.answer()).for_each(answer);
        self.newest = None;
    }
}

impl Moment {
    /// Extrapolates the relative covariance linearly in time to the full gap between two head passes.
    fn answer(&self) -> Answer {
        if self.gap == UNTIED {
            return (self.number, Relative::along(UNTIED_M));
        }
        let share = if self.age_s > 0.0 { self.gap.as_secs_f64() / self.age_s } else { 0.0 };
        (self.number, self.relative.weighted(share, &Relative::default(), 0.0))
    }
}

/// Returns the covariance of the difference between the errors of two epochs.
///
/// `own` is the covariance of the later epoch, `before` that of the earlier one, and `with` their cross-covariance.
fn against(own: &[Errors; 3], before: &[Errors; 3], with: &[Errors; 3]) -> Relative {
    let of = |rows: &[Errors; 3], row: usize, error: usize| {
        rows.get(row).and_then(|row| row.get(error)).copied().unwrap_or(0.0)
    };
    let element = |r: usize, c: usize| {
        let error = |k: usize| MOVING.get(k).copied().unwrap_or(0);
        of(own, r, error(c)) + of(before, r, error(c)) - of(with, r, error(c)) - of(with, c, error(r))
    };
    Relative::new(core::array::from_fn(|r| core::array::from_fn(|c| element(r, c))))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Epochs arrive latest first. An epoch is due if it is at least [`STEP`] before the one added last.
    #[test]
    fn epoch_is_due_once_it_is_2_s_before_the_last_added_epoch() {
        let at = |s: u64| MonoNs(1_000_000_000 * s);
        let mut later = Later::default();
        assert!(later.is_due(at(100)));
        assert_eq!(later.note(7, at(100), DurNs(0), &Factors::independent([1.0; ERRORS])), None);
        let step = at(100) - STEP;
        assert!(!later.is_due(at(100)) && !later.is_due(step + DurNs(1)) && later.is_due(step));
    }
}
