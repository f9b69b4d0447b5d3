//! Effects together, and what they cost.

mod motion;
mod sonar;
