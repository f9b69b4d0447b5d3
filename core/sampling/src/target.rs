//! Target of an inspection.

/// Default confidence of a verdict, as a number of standard deviations.
pub const CONFIDENCE_SD: f64 = 2.0;

/// Largest hole that passes, and the confidence that a verdict requires.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Target {
    /// Target T: the largest hole that passes, m.
    pub max_hole_m: f64,
    /// Confidence k: in a pass or fail, the hole diameter D differs from the target T by at least k standard deviations
    /// of D.
    pub confidence_sd: f64,
}

impl Target {
    /// Creates a target with the default confidence.
    pub fn new(max_hole_m: f64) -> Self {
        Self { max_hole_m, confidence_sd: CONFIDENCE_SD }
    }

    /// Returns the error, m, to allow for in a hole's size: the confidence times the standard deviation `sd_m` of the
    /// size.
    pub fn error_m(&self, sd_m: f64) -> f64 {
        self.confidence_sd * sd_m
    }
}
