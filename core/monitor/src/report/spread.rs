//! Distribution of a quantity over a dive or a section.

use serde::Serialize;

use headrace_coverage::Spread;

/// Count, mean, standard deviation and extremes of a quantity. All except the count are `None` without
/// values.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct SpreadReport {
    /// Number of values.
    pub count: u32,
    /// Smallest value, m.
    pub min_m: Option<f64>,
    /// Mean of the values, m.
    pub mean_m: Option<f64>,
    /// Largest value, m.
    pub max_m: Option<f64>,
    /// Standard deviation of the values, m.
    pub sd_m: Option<f64>,
}

impl From<&Spread> for SpreadReport {
    fn from(spread: &Spread) -> Self {
        let known = |value: f64| (spread.count > 0).then_some(value);
        Self {
            count: spread.count,
            min_m: known(spread.min),
            mean_m: spread.mean(),
            max_m: known(spread.max),
            sd_m: spread.sd(),
        }
    }
}
