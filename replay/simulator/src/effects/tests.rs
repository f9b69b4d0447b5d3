//! Combinations of effects.

mod motion;
mod sonar;
