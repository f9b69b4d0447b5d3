//! How well two smoothed moments are known against each other: later moments wait, on the way back, for those a pass of the
//! heads before them.

use super::rts_step::Gain;
use crate::filter::clones::{CLONES, MOVING, STEP};
use crate::filter::factors::Factors;
use crate::filter::state::{ERRORS, Errors};
use crate::relative::Relative;
use headrace_geometry::time::{DurNs, MonoNs};

/// Nothing ties a moment to passes before it, however long before: the cable has slipped in between.
pub const UNTIED: DurNs = DurNs(i64::MAX);
/// How far off it may be then, m.
const UNTIED_M: f64 = 1e3;

/// A moment that waits.
#[derive(Debug, Clone, Copy)]
struct Moment {
    /// Which of all.
    number: usize,
    at: MonoNs,
    /// How long before it the heads last passed.
    gap: DurNs,
    /// Rows of its covariance that move a sample.
    own: [Errors; 3],
    /// Covariances of all errors now with those of it.
    with: [Errors; 3],
    /// Its errors against those now, and how long ago that is, s.
    age_s: f64,
    relative: Relative,
}

/// Moments that wait, the latest first.
#[derive(Debug, Clone, Default)]
pub struct Later {
    waiting: Vec<Moment>,
    newest: Option<MonoNs>,
}

/// The errors of a moment against those a pass before.
pub type Answer = (usize, Relative);

impl Later {
    /// Whether a moment is far enough from the last one that was noted.
    pub fn is_due(&self, at: MonoNs) -> bool {
        self.newest.is_none_or(|newest| newest.since(at).0 >= STEP.0)
    }

    /// Notes a moment, which is to wait for the one `gap` before it; the answer of one that can't wait any longer.
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

    /// Goes back to an earlier moment; answers of those that have waited for it.
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

    /// The piece has come to its beginning: answers of all that wait.
    pub fn end(&mut self, answer: impl FnMut(Answer)) {
        self.waiting.drain(..).map(|moment| moment.answer()).for_each(answer);
        self.newest = None;
    }
}

impl Moment {
    /// As if what is known went on growing as evenly.
    fn answer(&self) -> Answer {
        if self.gap == UNTIED {
            return (self.number, Relative::along(UNTIED_M));
        }
        let share = if self.age_s > 0.0 { self.gap.as_secs_f64() / self.age_s } else { 0.0 };
        (self.number, self.relative.weighted(share, &Relative::default(), 0.0))
    }
}

/// Covariance of the difference of errors: those of a moment, those before it, and the latter with those of the moment.
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
