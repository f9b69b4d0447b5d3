//! The table of field dives, in which each vehicle dives under several conditions at several places. Each dive is
//! compared with the truth.

pub mod breaking;
mod cells;
mod figures;

pub use cells::{CONDITIONS, Cell, Condition, DRIVEN, Driven, PLACES, Place, VEHICLES, Vehicle};
pub use figures::{FalsePass, Figures, KINDS_OF_SOURCES};

use crate::truth;

/// Figures of a cell, from dives of `length_m` with the seeds `seeds`.
pub fn figures(cell: &Cell, seeds: impl IntoIterator<Item = u64>, length_m: f64) -> Figures {
    let mut figures = Figures::default();
    for seed in seeds {
        let dive = cell.dive(seed, length_m);
        let judged = truth::dive_believing(&dive.scene, &dive.believed.vehicle);
        figures.add(&judged, &dive.scene, cell.start_m);
    }
    figures
}
