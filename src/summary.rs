//! The end of a dive in words.

use headrace_core::app::report::{Report, SectionReport};

use crate::station::station;

/// The report in a few lines.
pub(crate) fn summary(report: &Report) -> String {
    let mut text = String::new();
    let mut line = |words: String| {
        text.push_str(&words);
        text.push('\n');
    };
    let dive = &report.dive;
    if let (true, Some(from_m), Some(to_m)) = (dive.sonar, dive.from_m, dive.to_m) {
        line(format!(
            "ch {} to {}: {:.1} m in {:.0} s, {} samples, target {} m",
            station(from_m),
            station(to_m),
            dive.distance_m,
            dive.duration_s,
            dive.samples_valid,
            report.target_m
        ));
    }
    if dive.sonar {
        let sum = &report.summary;
        line(format!(
            "  passed {:.2} m   failed {:.2} m   can't say {:.2} m   open {:.2} m",
            sum.pass_m, sum.fail_m, sum.cannot_say_m, sum.open_m
        ));
        for run in runs(&report.sections) {
            line(run);
        }
        let metres = |value: Option<f64>| value.map_or_else(|| "-".to_owned(), |v| format!("{v:.3}"));
        line(format!(
            "  largest hole {} m   T_x mean {} m   T_y max {} m",
            metres(sum.hole.max_m),
            metres(sum.t_x.mean_m),
            metres(sum.t_y.max_m)
        ));
    } else {
        line(
            "NO COVERAGE: no return of any profiling sonar in this dive; nothing has been inspected"
                .to_owned(),
        );
    }
    let rejected = &dive.samples_rejected;
    let lost = [
        (rejected.missing, "pings without a return"),
        (rejected.out_of_range, "pings beyond the range setting"),
        (rejected.occluded, "pings stopped by the vehicle itself"),
        (rejected.no_fix, "returns without a position"),
        (rejected.outside, "returns beyond the ends of the tunnel"),
        (rejected.not_stored, "returns for which there was no room"),
    ];
    for (count, what) in lost.iter().filter(|(count, _)| *count > 0) {
        line(format!("  {count} {what}"));
    }
    for loss in report.log.iter().flat_map(|log| &log.losses) {
        line(format!("  LOST: {loss}"));
    }
    line(format!("digest {}", report.digest));
    text
}

/// Neighbouring failed sections with one cause, a line each.
fn runs(sections: &[SectionReport]) -> Vec<String> {
    let mut lines = Vec::new();
    let mut rest = sections;
    while let Some(first) = rest.first() {
        let same = |s: &&SectionReport| cause(s) == cause(first);
        let len = rest.iter().take_while(same).count();
        let (run, after) = rest.split_at(len);
        rest = after;
        let Some(cause) = cause(first) else { continue };
        let worst = run.iter().filter_map(|s| s.hole_m).fold(0.0, f64::max);
        let end_m = run.last().map_or(first.end_m, |last| last.end_m);
        lines.push(format!(
            "  missed ch {} to {}: {cause}, holes up to {worst:.2} m",
            station(first.start_m),
            station(end_m)
        ));
    }
    lines
}

fn cause(section: &SectionReport) -> Option<&'static str> {
    section.cause.map(|evidence| evidence.cause)
}
