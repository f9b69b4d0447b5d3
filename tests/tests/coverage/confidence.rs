//! Confidence of verdicts. One dive is judged three times. The margin between hole and target is one, two or three
//! standard deviations.

use headrace_coverage::Verdict;
use headrace_monitor::report::Report;
use headrace_monitor::section_row::SectionRow;
use headrace_tests::instrumented;

/// A scene in which the speed increases, so that the holes grow from well below the target to well above it.
fn scene() -> String {
    let leg = |k: u32| {
        let speed_mps = 0.11 + 0.004 * f64::from(k);
        format!("[[trajectory.legs]]\ndistance_m = 1.5\nspeed_mps = {speed_mps:.3}\n")
    };
    let legs: String = (0..11).map(leg).collect();
    format!(
        "seed = 5\nvehicle = \"vehicle.toml\"\n[trajectory]\nstart_m = 3\n{legs}\
         [effects]\nmotion_within_turn = {{}}\nrange_noise = {{ sd_m = 0.01 }}\n"
    )
}

fn judged(confidence: u32) -> Report {
    let vehicle = include_str!("../../../deploy/vehicles/vita2-4.toml");
    let vehicle = vehicle.replace("[heads]", &format!("[coverage]\nconfidence = {confidence}\n\n[heads]"));
    instrumented::dive(&vehicle, &scene()).report
}

/// Whether the verdict follows from the bounds and the standard deviation of the reported hole.
fn keeps_clear(report: &Report, section: &SectionRow) -> bool {
    let error_m = f64::from(report.confidence_sd) * section.hole_sd_m;
    let passes = section.hole_most_m.is_some_and(|most_m| most_m + error_m <= report.target_m);
    let fails = section.hole_least_m.is_some_and(|least_m| least_m - error_m > report.target_m);
    match section.verdict {
        Verdict::Pass => passes,
        Verdict::Fail => fails,
        Verdict::CannotSay => !passes && !fails,
        Verdict::Open => true,
    }
}

#[test]
fn verdict_margin_follows_the_configured_confidence() {
    let reports = [1, 2, 3].map(judged);
    for (confidence, report) in (1..).zip(&reports) {
        assert_eq!(report.confidence_sd, confidence);
        for section in &report.sections {
            assert!(keeps_clear(report, section), "{confidence}: {section:?}");
        }
    }
    let metres = reports.each_ref().map(|report| (report.summary.pass_m, report.summary.fail_m));
    let unsure = reports.each_ref().map(|report| report.summary.cannot_say_m);
    assert!(metres.is_sorted_by(|a, b| a.0 >= b.0 && a.1 >= b.1), "{metres:?}");
    assert!(unsure[0] < unsure[1] && unsure[1] < unsure[2], "{unsure:?}");
}
