//! Advice to a simulated pilot.

use headrace_geometry::time::MonoNs;

/// The advice at one time.
#[derive(Debug, Clone, PartialEq)]
pub struct PilotAdvice {
    /// Time of the advice.
    pub at: MonoNs,
    /// Largest speed that meets the sampling target, m/s; zero if no speed does, `None` if unknown.
    pub v_max_mps: Option<f64>,
    /// Whether the pilot should keep the vehicle stationary for a while.
    pub stand: bool,
    /// First and last chainage of each missed stretch that has not been cleared yet, m.
    pub missed_m: Vec<[f64; 2]>,
}
