//! A step between two estimates of the filter, and its encoding as a record for smoothing.

use crate::filter::factors::Factors;
use crate::filter::inertial::{LEG_NUMBERS, Leg};
use crate::filter::settings::Settings;
use crate::filter::state::{ERRORS, Errors, STATE_NUMBERS, State};
use headrace_geometry::frames::{Body, Vec3};
use headrace_geometry::time::{DurNs, MonoNs};

/// Number of values in the factors of a covariance.
const FACTOR_NUMBERS: usize = ERRORS * (ERRORS + 1) / 2;
/// Number of header words of a record: start and end time, kind of change, piece number, clock number and pass gap.
const HEADER: usize = 6;
/// Number of 64-bit words in the record of a step.
pub const WORDS: usize = HEADER + 3 + 2 * STATE_NUMBERS + FACTOR_NUMBERS + LEG_NUMBERS;

/// The record of a step. A word is an integer, or a float as its bits. Words that a step does not need are zero.
pub type Words = [u64; WORDS];

/// Change from one estimate to the next that is not caused by a measurement.
#[derive(Debug, Clone, Copy, PartialEq)]
#[expect(clippy::large_enum_variant, reason = "most are legs, and few are kept at a time")]
pub enum Move {
    /// Propagation by the inertial motion of a leg.
    Leg(Leg),
    /// Addition to the variances of errors that were too small.
    Widened(Errors),
    /// No change, because this is the last estimate of its piece of the track.
    End,
}

/// A step of the filter. It begins with the estimate after the measurements of an epoch, and ends before the
/// measurements of the next.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Step {
    /// Start time of the step.
    pub at: MonoNs,
    /// End time of the step.
    pub to: MonoNs,
    /// Estimate at the beginning of the step.
    pub state: State,
    /// Covariance of the errors of `state`.
    pub factors: Factors<ERRORS>,
    /// Change of the estimate during the step.
    pub by: Move,
    /// Predicted estimate at the end of the step, before the measurements at that time.
    pub predicted: State,
}

/// A step of the filter with its context in the dive.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Placed {
    /// The step of the filter.
    pub step: Step,
    /// Position of the inertial unit on the vehicle, m. The estimate refers to this position.
    pub unit_at: Vec3<Body>,
    /// Time between two passes of the heads over the same position.
    pub gap: DurNs,
    /// Number of the piece of the track; a piece consists of contiguous steps.
    pub piece: u32,
    /// Number of times the clock has been set back.
    pub clock: u32,
}

impl Step {
    /// Whether all numbers of the step are finite and no variance is negative.
    pub fn is_sound(&self) -> bool {
        self.state.is_sound() && self.predicted.is_sound() && self.factors.is_sound()
    }
}

impl Move {
    /// Propagates errors from the beginning to the end of the step.
    pub fn carry(&self, settings: &Settings, errors: &mut Errors) {
        if let Self::Leg(leg) = self {
            leg.transition(settings).apply(errors);
        }
    }

    /// Adds the process noise of the step to a covariance.
    pub fn disturb(&self, settings: &Settings, factors: &mut Factors<ERRORS>) {
        match self {
            Self::Leg(leg) => leg.disturb(settings, &leg.transition(settings), factors),
            Self::Widened(variances) => factors.widen(variances),
            Self::End => {}
        }
    }

    /// Returns the covariance predicted for the end of the step. It is bit-identical to the filter's.
    pub fn predict(&self, settings: &Settings, factors: &Factors<ERRORS>) -> Factors<ERRORS> {
        let mut predicted = *factors;
        if let Self::Leg(leg) = self {
            leg.transition(settings).carry(&mut predicted);
        }
        self.disturb(settings, &mut predicted);
        predicted
    }

    fn kind(&self) -> u64 {
        match self {
            Self::Leg(_) => 0,
            Self::Widened(_) => 1,
            Self::End => 2,
        }
    }
}

impl Placed {
    /// Encodes the step as a record.
    pub fn words(&self) -> Words {
        let Step { at, to, state, factors, by, predicted } = &self.step;
        let header: [u64; HEADER] =
            [at.0, to.0, by.kind(), u64::from(self.piece), u64::from(self.clock), self.gap.0.cast_unsigned()];
        let leg = match by {
            Move::Leg(leg) => Some(leg.numbers()),
            _ => None,
        };
        let widened = match by {
            Move::Widened(variances) => variances.as_slice(),
            _ => &[],
        };
        let numbers = self.unit_at.0.iter().copied();
        let numbers = numbers.chain(state.numbers()).chain(predicted.numbers()).chain(factors.numbers());
        let numbers = numbers.chain(leg.into_iter().flatten()).chain(widened.iter().copied());
        let mut words = [0; WORDS];
        for (slot, word) in words.iter_mut().zip(header.into_iter().chain(numbers.map(f64::to_bits))) {
            *slot = word;
        }
        words
    }

    /// Parses the record of a step; `None` if the record is malformed.
    pub fn of_words(words: &Words) -> Option<Self> {
        let (header, numbers) = words.split_first_chunk::<HEADER>()?;
        let [at, to, kind, piece, clock, gap] = *header;
        let mut numbers = numbers.iter().map(|bits| f64::from_bits(*bits));
        let unit_at = Vec3::new(numbers.next()?, numbers.next()?, numbers.next()?);
        let state = state_of(&mut numbers)?;
        let predicted = state_of(&mut numbers)?;
        let factors = Factors::of_numbers(&mut numbers)?;
        let by = match kind {
            0 => Move::Leg(Leg::of_numbers(&mut numbers)?),
            1 => {
                let mut variances = [0.0; ERRORS];
                for slot in &mut variances {
                    *slot = numbers.next()?;
                }
                Move::Widened(variances)
            }
            2 => Move::End,
            _ => return None,
        };
        let step = Step { at: MonoNs(at), to: MonoNs(to), state, factors, by, predicted };
        let (piece, clock) = (u32::try_from(piece).ok()?, u32::try_from(clock).ok()?);
        Some(Self { step, unit_at, gap: DurNs(gap.cast_signed()), piece, clock })
    }
}

fn state_of(numbers: &mut impl Iterator<Item = f64>) -> Option<State> {
    let mut all = [0.0; STATE_NUMBERS];
    for slot in &mut all {
        *slot = numbers.next()?;
    }
    State::of_numbers(all)
}
