//! Backward pass over a dive: corrects each estimate of the filter by later measurements.

use super::relative_backward::Later;
use super::rts_step::Gain;
use super::step::{Move, Placed, Step};
use super::track::{Piece, Point, Track};
use crate::filter::factors::Factors;
use crate::filter::pose_sd::PoseSd;
use crate::filter::settings::Settings;
use crate::filter::state::{ERRORS, State};
use crate::relative::Relative;
use headrace_geometry::time::MonoNs;

/// An estimate of the filter after smoothing.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Estimate {
    /// Time of the smoothed estimate.
    pub at: MonoNs,
    /// The smoothed state.
    pub state: State,
    /// Covariance of the state's errors.
    pub factors: Factors<ERRORS>,
}

/// Processes the filter's steps from last to first and builds a track from them.
pub struct Backward {
    settings: Settings,
    now: Option<(u32, Estimate)>,
    later: Later,
    /// The track so far in reverse order: its pieces, its points, and its relative covariances.
    pieces: Vec<Piece>,
    points: Vec<Point>,
    relatives: Vec<(MonoNs, Relative)>,
}

impl Backward {
    /// Creates the backward pass with the settings of the filter.
    pub fn new(settings: Settings) -> Self {
        Self {
            settings,
            now: None,
            later: Later::default(),
            pieces: Vec::new(),
            points: Vec::new(),
            relatives: Vec::new(),
        }
    }

    /// Processes a step of the filter. Steps arrive in reverse order.
    ///
    /// Allocates: the point that the step adds to the track.
    pub fn take(&mut self, placed: &Placed) {
        let step = &placed.step;
        let after = self.now.filter(|(piece, _)| *piece == placed.piece).map(|(_, after)| after);
        let smoothed = after.and_then(|after| self.smooth(step, &after));
        let now = smoothed.unwrap_or_else(|| {
            // There is no later estimate in the same piece, so the filter's estimate is kept.
            self.end_piece();
            self.pieces.push(Piece::begin(placed, self.points.len(), self.relatives.len()));
            Estimate { at: step.at, state: step.state, factors: step.factors }
        });
        if self.later.is_due(now.at) {
            let number = self.relatives.len();
            self.relatives.push((now.at, Relative::default()));
            if let Some((number, relative)) = self.later.note(number, now.at, placed.gap, &now.factors) {
                answer(&mut self.relatives, number, relative);
            }
        }
        self.points.push(Point::of(now.at, &now.state, &PoseSd::of(&now.factors)));
        self.now = Some((placed.piece, now));
    }

    /// Returns the estimate that was smoothed most recently. Its time is the earliest so far.
    pub fn now(&self) -> Option<&Estimate> {
        self.now.as_ref().map(|(_, now)| now)
    }

    /// Returns the smoothed track built from all steps.
    pub fn finish(mut self) -> Track {
        self.end_piece();
        Track::of_reversed(self.pieces, self.points, self.relatives, self.settings.epoch)
    }

    /// Smooths the estimate at the beginning of a step, given the smoothed estimate at the step's end.
    ///
    /// `None` if the step is the last of its piece, or if the result is not finite.
    fn smooth(&mut self, step: &Step, after: &Estimate) -> Option<Estimate> {
        if matches!(step.by, Move::End) {
            return None;
        }
        let settings = &self.settings;
        let predicted = step.by.predict(settings, &step.factors);
        let gain = Gain::new(&step.factors, |errors| step.by.carry(settings, errors), &predicted);
        let mut noisy = after.factors;
        step.by.disturb(settings, &mut noisy);
        let factors = gain.smoothed(&step.factors, &noisy);
        let mut state = step.state;
        state.correct(&gain.back(&step.predicted.errors_to(&after.state)));
        if !(state.is_sound() && factors.is_sound()) {
            return None;
        }
        let relatives = &mut self.relatives;
        self.later.back(step.at, &gain, &factors, |(number, relative)| answer(relatives, number, relative));
        Some(Estimate { at: step.at, state, factors })
    }

    fn end_piece(&mut self) {
        let relatives = &mut self.relatives;
        self.later.end(|(number, relative)| answer(relatives, number, relative));
        if let Some(piece) = self.pieces.last_mut() {
            piece.end(self.points.len(), self.relatives.len());
        }
    }
}

fn answer(relatives: &mut [(MonoNs, Relative)], number: usize, relative: Relative) {
    if let Some((_, slot)) = relatives.get_mut(number) {
        *slot = relative;
    }
}
