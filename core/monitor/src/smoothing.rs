//! What smoothing changed: a dive's report against that of the same dive by the filter alone.

use serde::Serialize;

use super::report::{Report, SectionReport, SummaryReport};

/// See the module's description.
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
    pub hole_sigma_m: f64,
}

impl SmoothingReport {
    /// Of the dive by the filter and the same smoothed, over so many estimates in so many pieces.
    pub fn of(filter: &Report, smoothed: &Report, estimates: u64, pieces: u64) -> Self {
        Self {
            filter_digest: filter.digest.clone(),
            estimates,
            pieces,
            before: MetresReport::of(&filter.summary),
            after: MetresReport::of(&smoothed.summary),
            changed: changes(&filter.sections, &smoothed.sections),
        }
    }
}

impl MetresReport {
    fn of(summary: &SummaryReport) -> Self {
        let SummaryReport { pass_m, fail_m, cannot_say_m, open_m, .. } = *summary;
        Self { pass_m, fail_m, cannot_say_m, open_m }
    }
}

impl JudgedReport {
    fn of(section: &SectionReport) -> Self {
        let SectionReport { verdict, hole_m, hole_sigma_m, .. } = *section;
        Self { verdict, hole_m, hole_sigma_m }
    }
}

/// Both are in the order of chainage; either may have sections that the other hasn't.
fn changes(before: &[SectionReport], after: &[SectionReport]) -> Vec<ChangeReport> {
    let (mut before, mut after) = (before.iter().peekable(), after.iter().peekable());
    let mut changed = Vec::new();
    loop {
        let next = [before.peek(), after.peek()].map(|next| next.map_or(f64::INFINITY, |s| s.start_m));
        let start_m = next[0].min(next[1]);
        let was = before.next_if(|section| section.start_m <= start_m);
        let is = after.next_if(|section| section.start_m <= start_m);
        let Some(section) = was.or(is) else { return changed };
        if was.map(|section| section.verdict) != is.map(|section| section.verdict) {
            let SectionReport { start_m, end_m, .. } = *section;
            let [before, after] = [was, is].map(|section| section.map(JudgedReport::of));
            changed.push(ChangeReport { start_m, end_m, before, after });
        }
    }
}
