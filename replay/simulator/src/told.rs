//! What a simulated pilot is told.

use headrace_geometry::time::MonoNs;

/// What a pilot is told at one time.
#[derive(Debug, Clone, PartialEq)]
pub struct Told {
    /// When.
    pub at: MonoNs,
    /// The largest speed that meets the target, m/s; zero if none does, `None` if nothing can be said.
    pub v_max_mps: Option<f64>,
    /// To stand still for a while.
    pub stand: bool,
    /// Stretches that were missed and not made good yet, first and last chainage, m.
    pub missed_m: Vec<[f64; 2]>,
}
