//! Effects combined, and their cost.

mod motion;
mod sonar;
