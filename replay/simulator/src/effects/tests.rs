//! Tests of combinations of effects.

mod motion;
mod sonar;
