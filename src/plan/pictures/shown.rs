//! Content of the charts.

use headrace_sampling::plan::{Planner, Question};

/// Content of the charts.
pub(crate) struct Shown<'a> {
    pub(crate) planner: &'a Planner,
    /// Index of the mode that the charts of the perimeter and the pattern show.
    pub(crate) mode: usize,
    /// Speed for which the perimeter and the pattern are drawn, m/s.
    pub(crate) speed_mps: f64,
    pub(crate) question: Question,
    /// Tunnel, heads and layout as text.
    pub(crate) title: String,
}

impl Shown<'_> {
    /// Requested speed, m/s. If a time was requested, the speed follows from the length.
    pub(super) fn asked_mps(&self) -> Option<f64> {
        let needed = |time_s: f64| self.planner.inspection().length_m / time_s;
        self.question.speed_mps.or(self.question.time_s.map(needed))
    }

    /// Subtitle of a chart: tunnel, heads, layout, and the requested target, speed and hours.
    pub(super) fn subtitle(&self) -> String {
        let Question { target_m, speed_mps, time_s } = self.question;
        let words = [
            target_m.map(|target_m| format!("target {target_m} m")),
            speed_mps.map(|speed_mps| format!("{speed_mps} m/s required")),
            time_s.map(|time_s| format!("{} h required", time_s / 3600.0)),
        ];
        [Some(self.title.clone())].into_iter().chain(words).flatten().collect::<Vec<_>>().join(", ")
    }
}
