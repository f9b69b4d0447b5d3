//! The vehicle's trajectory through the tunnel: where it is at any moment, in the axis's own terms.

mod knots;
mod legs;
mod parse;
mod pilot;
mod place;
mod recorded;
mod waypoints;

use legs::Legs;
use pilot::Piloted;

pub use knots::{Knots, Offsets, wandering};
pub use legs::Leg;
pub(crate) use parse::parse;
pub use place::{Ground, Place};

/// A trajectory from the dive's start to its end.
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
}

impl Trajectory {
    /// Legs at one speed each from `start_m`, level, at one place of the cross-section.
    pub fn of_legs(start_m: f64, across_m: [f64; 2], legs: Vec<Leg>) -> Self {
        let legs = Legs::new(start_m, across_m, legs);
        Self { duration_s: legs.duration_s(), base: Base::Legs(legs), sways: Vec::new() }
    }

    /// A smooth trajectory along knots for `duration_s`.
    pub fn of_knots(knots: Knots, duration_s: f64) -> Self {
        Self { base: Base::Knots(knots), sways: Vec::new(), duration_s }
    }

    /// As a pilot goes.
    fn piloted(piloted: Piloted) -> Self {
        Self { duration_s: piloted.duration_s(), base: Base::Piloted(Box::new(piloted)), sways: Vec::new() }
    }

    /// Time from its start to its end, seconds.
    pub fn duration_s(&self) -> f64 {
        self.duration_s
    }

    /// Where the vehicle is `after_s` seconds after the start. Before it, and after the end, it goes on as it did.
    pub fn place(&self, after_s: f64) -> Place {
        let mut place = match &self.base {
            Base::Legs(legs) => legs.place(after_s),
            Base::Knots(knots) => Place::from_offsets(knots.at(after_s)),
            Base::Piloted(piloted) => piloted.place(after_s),
        };
        for sway in &self.sways {
            place.shift(&sway.at(after_s));
        }
        place
    }

    /// Adds a motion of its own to it. It is for the duration that the trajectory has by then.
    pub fn sway(&mut self, knots: Knots) {
        self.sways.push(knots);
    }

    /// Lets a current of `speed_mps`, positive towards growing chainage, carry a vehicle that goes through the water. It
    /// goes to the same end, in another time.
    ///
    /// Errors: in words, the leg that couldn't be gone against it; a trajectory that is given over ground.
    pub fn carry(&mut self, speed_mps: f64) -> Result<(), String> {
        match &mut self.base {
            Base::Legs(legs) => {
                legs.carry(speed_mps)?;
                self.duration_s = legs.duration_s();
            }
            Base::Piloted(piloted) => {
                piloted.carry(speed_mps)?;
                self.duration_s = piloted.duration_s();
            }
            Base::Knots(_) => return Err("is of no effect: the trajectory is given over ground".to_owned()),
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests;
