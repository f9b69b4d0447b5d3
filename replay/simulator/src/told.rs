//! Advice to a simulated pilot.

use headrace_geometry::time::MonoNs;

/// The advice at one time.
#[derive(Debug, Clone, PartialEq)]
pub struct Told {
    /// Time of the advice.
    pub at: MonoNs,
    /// The largest speed that meets the target, m/s; zero if no speed does, `None` if unknown.
    pub v_max_mps: Option<f64>,
    /// Whether to keep the vehicle stationary for a while.
    pub stand: bool,
    /// Missed stretches that haven't been cleared yet, first and last chainage, m.
    pub missed_m: Vec<[f64; 2]>,
}
