//! Effect of smoothing on the verdicts, as plain values.

use serde::Serialize;

/// Verdicts of a dive with the trajectory of the filter alone, compared with those after smoothing.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SmoothingReport {
    /// Digest of the results with the filter alone.
    pub filter_digest: String,
    /// Number of estimates that were smoothed.
    pub estimates: u64,
    /// Number of contiguous pieces of the smoothed trajectory.
    pub pieces: u64,
    /// Metres by verdict with the filter alone.
    pub before: MetresReport,
    /// Metres by verdict after smoothing.
    pub after: MetresReport,
    /// Sections whose verdict has changed, in the order of chainage.
    pub changed: Vec<ChangeReport>,
}

/// Metres by verdict.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct MetresReport {
    /// Metres of sections that passed.
    pub pass_m: f64,
    /// Metres that failed.
    pub fail_m: f64,
    /// Metres undecided within the error of the hole.
    pub cannot_say_m: f64,
    /// Metres still open.
    pub open_m: f64,
    /// Metres where some heads have not been.
    pub not_inspected_m: f64,
}

/// A section whose verdict has changed.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ChangeReport {
    /// Beginning, m.
    pub start_m: f64,
    /// End, m.
    pub end_m: f64,
    /// Verdict with the filter alone; `None` if no head passed the section on its trajectory.
    pub before: Option<JudgedReport>,
    /// Verdict after smoothing; `None` if no head passed the section on the smoothed trajectory.
    pub after: Option<JudgedReport>,
}

/// A verdict and its hole.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct JudgedReport {
    /// `pass`, `fail`, `cannot_say` or `open`.
    pub verdict: &'static str,
    /// Diameter of the largest hole, m; `None` if the hole wasn't measured.
    pub hole_m: Option<f64>,
    /// Standard deviation of the diameter, m.
    pub hole_sd_m: f64,
}
