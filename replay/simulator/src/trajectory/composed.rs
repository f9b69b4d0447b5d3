//! The trajectory: a base motion, and other motions added to it.

use super::advised::{Advised, PilotAdvice};
use super::flow::Flow;
use super::knots::Knots;
use super::legs::{Leg, Legs};
use super::pilot::Piloted;
use super::place::Place;

/// A trajectory of the vehicle from the dive's start to its end.
#[derive(Debug, Clone, PartialEq)]
pub struct Trajectory {
    base: Base,
    sways: Vec<Knots>,
    duration_s: f64,
}

#[derive(Debug, Clone, PartialEq)]
enum Base {
    Legs(Legs),
    Knots(Knots),
    Piloted(Box<Piloted>),
    Advised(Box<Advised>),
}

impl Trajectory {
    /// Creates a trajectory of legs at constant speed from `start_m`, all at the same position in the cross-section.
    /// The vehicle stays level.
    pub fn of_legs(start_m: f64, across_m: [f64; 2], legs: Vec<Leg>) -> Self {
        let legs = Legs::new(start_m, across_m, legs);
        Self { duration_s: legs.duration_s(), base: Base::Legs(legs), sways: Vec::new() }
    }

    /// Creates a smooth trajectory through knots, with duration `duration_s`.
    pub fn of_knots(knots: Knots, duration_s: f64) -> Self {
        Self { base: Base::Knots(knots), sways: Vec::new(), duration_s }
    }

    /// Creates the trajectory of a pilot who gets no advice.
    pub(super) fn piloted(piloted: Piloted) -> Self {
        Self { duration_s: piloted.duration_s(), base: Base::Piloted(Box::new(piloted)), sways: Vec::new() }
    }

    /// Creates the trajectory of a pilot who follows advice.
    pub(super) fn advised(advised: Advised) -> Self {
        Self { duration_s: advised.duration_s(), base: Base::Advised(Box::new(advised)), sways: Vec::new() }
    }

    /// Whether the trajectory depends on a monitor's advice to the pilot.
    pub fn is_advised(&self) -> bool {
        matches!(self.base, Base::Advised(_))
    }

    /// Passes advice to the pilot and decides the motion until `until_s` seconds after the start. Other kinds of
    /// trajectory stay as they are.
    pub(crate) fn lead(&mut self, advice: Vec<PilotAdvice>, until_s: f64) {
        if let Base::Advised(advised) = &mut self.base {
            advised.lead(advice, until_s);
            self.duration_s = advised.duration_s();
        }
    }

    /// Duration, s. For an advised pilot, this is the maximum duration until he has finished.
    pub fn duration_s(&self) -> f64 {
        self.duration_s
    }

    /// Position `after_s` seconds after the start. Before the start and after the end, the motion continues.
    pub fn place(&self, after_s: f64) -> Place {
        let mut place = match &self.base {
            Base::Legs(legs) => legs.place(after_s),
            Base::Knots(knots) => Place::from_offsets(knots.at(after_s)),
            Base::Piloted(piloted) => piloted.place(after_s),
            Base::Advised(advised) => advised.place(after_s),
        };
        for sway in &self.sways {
            place.shift(&sway.at(after_s));
        }
        place
    }

    /// Adds the motion `knots` to the trajectory. The duration stays the same.
    pub fn sway(&mut self, knots: Knots) {
        self.sways.push(knots);
    }

    /// Lets the flow carry a vehicle that moves through the water. The vehicle ends at the same place, but after
    /// another duration.
    ///
    /// Errors, as text: a leg makes no progress against the current, or the trajectory is given over ground.
    pub fn carry(&mut self, flow: &Flow) -> Result<(), String> {
        match &mut self.base {
            Base::Legs(legs) => {
                legs.carry(flow)?;
                self.duration_s = legs.duration_s();
            }
            Base::Piloted(piloted) => {
                piloted.carry(flow)?;
                self.duration_s = piloted.duration_s();
            }
            Base::Advised(advised) => advised.carry(flow),
            Base::Knots(_) => return Err("has no effect: the trajectory is given over ground".to_owned()),
        }
        Ok(())
    }
}
