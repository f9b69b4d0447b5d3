//! Effect of smoothing on the verdicts, as plain values.

use serde::Serialize;

/// Verdicts of a dive on the navigation filter's own trajectory, compared with the verdicts on the smoothed trajectory.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SmoothingReport {
    /// Digest of the results with the navigation filter alone.
    pub filter_digest: String,
    /// Number of state estimates that were smoothed.
    pub estimates: u64,
    /// Number of contiguous pieces of the smoothed trajectory.
    pub pieces: u64,
    /// Length of tunnel by verdict with the navigation filter alone.
    pub before: MetresReport,
    /// Length of tunnel by verdict after smoothing.
    pub after: MetresReport,
    /// Sections whose verdict has changed, in the order of chainage.
    pub changed: Vec<ChangeReport>,
}

/// Length of tunnel by verdict.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct MetresReport {
    /// Length of the sections that passed.
    pub pass_m: f64,
    /// Length of the sections that failed.
    pub fail_m: f64,
    /// Length of the sections that neither pass nor fail, although no more samples will land.
    pub cannot_say_m: f64,
    /// Length of the sections still open.
    pub open_m: f64,
    /// Length of the sections where some heads have not been.
    pub not_inspected_m: f64,
}

/// A section whose verdict smoothing has changed.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ChangeReport {
    /// Beginning of the section, m.
    pub start_m: f64,
    /// End of the section, m.
    pub end_m: f64,
    /// Verdict with the navigation filter alone; `None` if no head passed the section on the filter's trajectory.
    pub before: Option<JudgedReport>,
    /// Verdict after smoothing; `None` if no head passed the section on the smoothed trajectory.
    pub after: Option<JudgedReport>,
}

/// A section's verdict and largest hole.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct JudgedReport {
    /// Verdict: `pass`, `fail`, `cannot_say` or `open`.
    pub verdict: &'static str,
    /// Diameter of the section's largest hole, m; `None` if the hole wasn't measured.
    pub hole_m: Option<f64>,
    /// Standard deviation of the diameter, m.
    pub hole_sd_m: f64,
}
