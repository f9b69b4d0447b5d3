//! Compares the report of a smoothed dive with the report of the same dive by the navigation filter alone.

use super::report::{ChangeReport, JudgedReport, MetresReport, Report, SmoothingReport, SummaryReport};
use super::section_row::SectionRow;

/// Compares the report by the navigation filter with the report after smoothing. The smoothed trajectory has
/// `estimates` state estimates in `pieces` contiguous pieces.
pub fn compare(filter: &Report, smoothed: &Report, estimates: u64, pieces: u64) -> SmoothingReport {
    SmoothingReport {
        filter_digest: filter.digest.clone(),
        estimates,
        pieces,
        before: metres(&filter.summary),
        after: metres(&smoothed.summary),
        changed: changes(&filter.sections, &smoothed.sections),
    }
}

fn metres(summary: &SummaryReport) -> MetresReport {
    let SummaryReport { pass_m, fail_m, cannot_say_m, open_m, not_inspected_m, .. } = *summary;
    MetresReport { pass_m, fail_m, cannot_say_m, open_m, not_inspected_m }
}

fn judged(section: &SectionRow) -> JudgedReport {
    let SectionRow { verdict, hole_m, hole_sd_m, .. } = *section;
    JudgedReport { verdict: verdict.as_str(), hole_m, hole_sd_m }
}

/// Lists the sections whose verdict differs between two reports.
///
/// Both lists are in the order of chainage. Either may have sections that are missing in the other.
fn changes(before: &[SectionRow], after: &[SectionRow]) -> Vec<ChangeReport> {
    let (mut before, mut after) = (before.iter().peekable(), after.iter().peekable());
    let mut changed = Vec::new();
    loop {
        let next = [before.peek(), after.peek()].map(|next| next.map_or(f64::INFINITY, |s| s.start_m));
        let start_m = next[0].min(next[1]);
        let was = before.next_if(|section| section.start_m <= start_m);
        let is = after.next_if(|section| section.start_m <= start_m);
        let Some(section) = was.or(is) else { return changed };
        if was.map(|section| section.verdict) != is.map(|section| section.verdict) {
            let SectionRow { start_m, end_m, .. } = *section;
            let [before, after] = [was, is].map(|section| section.map(judged));
            changed.push(ChangeReport { start_m, end_m, before, after });
        }
    }
}
