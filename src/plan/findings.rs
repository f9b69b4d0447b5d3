//! Results of a plan, for the table, the JSON and the charts.

use headrace_sampling::plan::{Answer, Briefing, InLine, Planner, Question};

/// Results of one planning run, with its input.
pub(super) struct Findings {
    pub(super) planner: Planner,
    /// Ids of the heads.
    pub(super) heads: Vec<String>,
    pub(super) tunnel: String,
    /// Range setting, m.
    pub(super) range_m: f64,
    /// Shortest and longest part of the perimeter that a beam covers, m.
    pub(super) footprints_m: [f64; 2],
    pub(super) question: Question,
    pub(super) answers: Vec<Answer>,
    /// Mode for the briefing and the charts, with its speed, m/s; `None` if no mode gives a speed.
    pub(super) shown: Option<(usize, f64)>,
    pub(super) briefing: Briefing,
    /// Gain in speed with heads in line, if it is worth reporting.
    pub(super) in_line: Option<InLine>,
}

/// A speed rounded down to 1 mm/s for printing, m/s. The printed speed thus meets the target, too.
pub(super) fn printed_mps(speed_mps: f64) -> f64 {
    let down = (speed_mps * 1000.0 + 1e-6).floor() / 1000.0;
    if down > 0.0 { down } else { speed_mps }
}
