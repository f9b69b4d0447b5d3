//! What smoothing changed: plain values.

use serde::Serialize;

/// A dive's verdicts by the filter alone against those of the same dive smoothed.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SmoothingReport {
    /// Digest of the results by the filter alone.
    pub filter_digest: String,
    /// Estimates that were smoothed.
    pub estimates: u64,
    /// Pieces without a break of which the track is made.
    pub pieces: u64,
    /// Metres by verdict by the filter alone.
    pub before: MetresReport,
    /// The same smoothed.
    pub after: MetresReport,
    /// Sections whose verdict is another, in the order of chainage.
    pub changed: Vec<ChangeReport>,
}

/// Metres by verdict.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct MetresReport {
    /// Metres of sections that passed.
    pub pass_m: f64,
    /// That failed.
    pub fail_m: f64,
    /// Of which nothing can be said for sure.
    pub cannot_say_m: f64,
    /// That are still open.
    pub open_m: f64,
}

/// A section whose verdict is another than it was.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ChangeReport {
    /// Where it begins, m.
    pub start_m: f64,
    /// Where it ends, m.
    pub end_m: f64,
    /// By the filter alone; `None` where no head had passed by its account.
    pub before: Option<JudgedReport>,
    /// Smoothed; `None` where no head has passed.
    pub after: Option<JudgedReport>,
}

/// A verdict and the hole that it rests on.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct JudgedReport {
    /// `pass`, `fail`, `cannot_say` or `open`.
    pub verdict: &'static str,
    /// Diameter of the largest hole, m; `None` where it wasn't measured.
    pub hole_m: Option<f64>,
    /// Its standard deviation, m.
    pub hole_sd_m: f64,
}
