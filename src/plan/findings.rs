//! Results of a plan, for the table, the JSON and the charts.

use headrace_sampling::plan::{Answer, Briefing, InLine, Planner, Question};

/// Results of one planning run.
pub(super) struct Findings {
    pub(super) planner: Planner,
    /// Ids of the heads.
    pub(super) heads: Vec<String>,
    pub(super) tunnel: String,
    /// Range setting, m.
    pub(super) range_m: f64,
    /// Shortest and longest stretch of perimeter that a beam covers, m.
    pub(super) footprints_m: [f64; 2],
    pub(super) question: Question,
    pub(super) answers: Vec<Answer>,
    /// Mode of the briefing and the charts, with its speed; `None` if no mode gives one.
    pub(super) shown: Option<(usize, f64)>,
    pub(super) briefing: Briefing,
    /// Gain of heads in line, if it is worth reporting.
    pub(super) in_line: Option<InLine>,
}

/// A speed as printed, m/s: rounded down to 1 mm/s, so that the printed one meets the target, too.
pub(super) fn printed_mps(speed_mps: f64) -> f64 {
    let down = (speed_mps * 1000.0 + 1e-6).floor() / 1000.0;
    if down > 0.0 { down } else { speed_mps }
}
