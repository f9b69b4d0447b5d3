//! The report of a dive for the owner of the plant.

mod chapters;
mod figures;
mod measured;
mod shapes;
mod tables;
mod wall;

pub use chapters::{About, Delivery};
pub use wall::Wall;
