//! Report of a dive: plain values with units in their names. Its JSON is versioned; docs/reference has the
//! schema.

use serde::Serialize;

use super::alert_list::{ListedAlertJson, NoteJson};
use super::console::ConsoleCounts;
use super::head_descriptions::HeadDescriptions;
use super::other_targets::OtherTargetReport;
use super::run::Loop;
use super::section_row::SectionRow;
use headrace_coverage::openings::Opening;
use headrace_coverage::{Section, Spread, Verdict};
use headrace_geometry::time::MonoNs;

mod advice;
mod inspected;
mod position_gaps;
mod runs;
mod smoothing;
mod sources;
pub(crate) mod spread;
mod survey;
mod unsure;
mod wall;

pub use advice::{AdviceReport, AlternativeReport};
pub use inspected::{CoverageExtentReport, NotInspectedReport};
pub use position_gaps::PositionGapReport;
pub use runs::{ReturnReport, RunReport, go_back};
pub use smoothing::{ChangeReport, JudgedReport, MetresReport, SmoothingReport};
pub use sources::{DeviceClockReport, LineReport, NavigationReport, SourceReport};
pub use spread::SpreadReport;
pub use survey::{HolidayReport, NodeRowReport, SurveyReport};
pub use unsure::NoVerdictReport;
pub use wall::{SuggestedOpeningReport, WallStretchReport};

/// Version of the report's JSON schema.
pub const REPORT_VERSION: u32 = 10;

/// A whole report. The field names are a contract.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Report {
    /// Version of the report's JSON schema.
    pub report_version: u32,
    /// Program that made the report, with its version.
    pub program: &'static str,
    /// UTC of the dive's first packet, such as 2026-11-30T05:12:33Z; `None` if the log doesn't state it.
    pub begun_utc: Option<String>,
    /// Reason for which the dive is no inspection; `None` if the dive is an inspection.
    pub not_inspected: Option<NotInspectedReport>,
    /// Log that the dive was read from or written to; `None` without a log.
    pub log: Option<LogReport>,
    /// Digest of all results, 16 hexadecimal digits.
    pub digest: String,
    /// Coverage target T, m.
    pub target_m: f64,
    /// Length of a section, m.
    pub section_m: f64,
    /// Confidence: number of standard deviations of the hole by which a pass or a fail must clear the target.
    pub confidence_sd: u32,
    /// Coverage extent: the part of the tunnel that the metres by verdict cover.
    pub coverage_extent: CoverageExtentReport,
    /// Summary figures of the dive as a whole.
    pub dive: DiveReport,
    /// Length of tunnel by verdict, and spacings of the samples over all sections.
    pub summary: SummaryReport,
    /// Every section of the coverage extent, in the order of chainage.
    pub sections: Vec<SectionRow>,
    /// Missed stretches, in the order of their numbers.
    pub runs: Vec<RunReport>,
    /// Stretches that neither pass nor fail although no more samples will come, in the order of chainage.
    pub no_verdict: Vec<NoVerdictReport>,
    /// Stretches to pass again on the way home, in order from the far end to the portal.
    pub go_back: Vec<ReturnReport>,
    /// Stretches of the dive without a position, in order of time.
    pub position_gaps: Vec<PositionGapReport>,
    /// Stretches of wall off the design profile, in the order of chainage.
    pub wall_stretches: Vec<WallStretchReport>,
    /// Undeclared openings that explain missed stretches, in the order of the stretches' numbers.
    pub suggested_openings: Vec<SuggestedOpeningReport>,
    /// Samples by node of a square grid, as in survey specifications.
    pub survey: SurveyReport,
    /// Length of tunnel by verdict, for each additional target and section length requested.
    pub other_targets: Vec<OtherTargetReport>,
    /// Names of the heads and their alternative settings, for the text form of the report.
    #[serde(skip)]
    pub heads: HeadDescriptions,
    /// Declared openings of the wall, excluded from verdicts.
    pub openings: Vec<OpeningReport>,
    /// Alerts with their life cycle, in order of their numbers.
    pub alert_list: Vec<ListedAlertJson>,
    /// Number of cleared alerts left out for lack of room.
    pub alerts_dropped: u64,
    /// Notes that the crew made during the dive.
    pub notes: Vec<NoteJson>,
    /// Number of notes left out for lack of room.
    pub notes_dropped: u32,
    /// Traffic statistics of the operator's input; `None` without any input.
    pub console: Option<ConsoleReport>,
    /// Speed advice history.
    pub advice: Vec<AdviceReport>,
    /// Number of advice entries dropped for lack of room.
    pub advice_dropped: u64,
    /// Traffic statistics of each source.
    pub sources: Vec<SourceReport>,
    /// Effect of smoothing on the verdicts; `None` without smoothing.
    pub smoothing: Option<SmoothingReport>,
}

/// The log that a dive was read from or written to.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct LogReport {
    /// Path of the log, as given by the user.
    pub path: String,
    /// SHA-256 of the log, hexadecimal. For a recording in parts, of the concatenated parts.
    pub sha256: String,
    /// Number of messages from sources in the log.
    pub messages: u64,
    /// Losses of logged data, in plain text. Each text has the time span of the loss.
    pub losses: Vec<String>,
    /// Irregularities in the log that lost no data, and how they were handled, in plain text.
    pub notes: Vec<String>,
    /// Files of a recording in parts, in order.
    pub parts: Vec<PartReport>,
}

/// A file of a recording in parts.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct PartReport {
    /// Path of the file.
    pub path: String,
    /// SHA-256 of the file, hexadecimal.
    pub sha256: String,
    /// Number of messages from sources in the file.
    pub messages: u64,
}

/// Summary figures of the dive as a whole.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct DiveReport {
    /// Time from the first to the last packet, seconds.
    pub duration_s: f64,
    /// Time of the first packet on the log's clock, seconds. All other times of the report are dive times: seconds since
    /// this packet.
    pub start_s: f64,
    /// Smallest chainage reached by any head, m.
    pub from_m: Option<f64>,
    /// Largest chainage reached by any head, m.
    pub to_m: Option<f64>,
    /// Distance between the smallest and the largest chainage, m.
    pub distance_m: f64,
    /// Whether any profiling head pinged. If none did, there is no coverage.
    pub sonar: bool,
    /// Minimum speed of sound used for ranges, m/s.
    pub sound_speed_least_mps: f64,
    /// Maximum speed of sound used for ranges, m/s.
    pub sound_speed_most_mps: f64,
    /// Number of samples on the wall.
    pub samples_valid: u64,
    /// Number of valid samples dropped because their cells of the sample store were full.
    pub samples_thinned: u64,
    /// Number of pings without a sample, by reason.
    pub samples_rejected: RejectedReport,
}

/// Numbers of pings that gave no sample, by reason.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct RejectedReport {
    /// No return although the wall was within range.
    pub missing: u64,
    /// No return because the wall was out of range.
    pub out_of_range: u64,
    /// The beam was occluded by the vehicle.
    pub occluded: u64,
    /// The return came without a fix.
    pub no_fix: u64,
    /// The sample lay beyond the ends of the tunnel.
    pub outside: u64,
    /// The sample store was full.
    pub not_stored: u64,
    /// The return was not accepted as wall.
    pub doubtful_returns: u64,
}

/// Length of tunnel by verdict, and spacings of the samples.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SummaryReport {
    /// Length of the sections that passed.
    pub pass_m: f64,
    /// Length of the sections that failed.
    pub fail_m: f64,
    /// Length of the sections that neither pass nor fail, although no more samples will land.
    pub cannot_say_m: f64,
    /// Length of the sections still open.
    pub open_m: f64,
    /// Length of the sections where some heads have not been, because the vehicle began or turned back there.
    pub not_inspected_m: f64,
    /// Number of failed sections that were flagged.
    pub flags_raised: u32,
    /// Number of flags that a later pass cleared.
    pub flags_cleared: u32,
    /// Distance along the tunnel between passes of heads over the same arc length.
    pub t_x: SpreadReport,
    /// Distance between neighbouring samples of one sweep.
    pub t_y: SpreadReport,
    /// Diagonal of the lattice formed by neighbouring samples of neighbouring passes.
    pub t: SpreadReport,
    /// Diameter of the largest hole in each section.
    pub hole: SpreadReport,
}

/// A declared opening of the wall.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct OpeningReport {
    /// Display name of the opening.
    pub name: String,
    /// Beginning of the opening, m.
    pub from_m: f64,
    /// End of the opening, m.
    pub to_m: f64,
    /// Arc length at which the opening begins, m; `None` for the whole perimeter.
    pub arc_from_m: Option<f64>,
    /// Length of the opening along the perimeter, m; `None` for the whole perimeter.
    pub arc_length_m: Option<f64>,
}

/// Traffic statistics of the operator's input.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct ConsoleReport {
    /// Number of packets from the operator's input.
    pub packets: u64,
    /// Number of packets that are not a valid command.
    pub invalid: u64,
    /// Number of commands without effect.
    pub without_effect: u64,
}

impl Report {
    /// Creates the report of a loop's results so far.
    pub fn of(dive: &Loop) -> Self {
        let (coverage, log, clock) = (dive.view().coverage(), dive.advice_log(), dive.view().clock());
        let sections = &coverage.sections;
        let way = || sections.sections_of(coverage.frontier.way());
        let report = Self {
            report_version: REPORT_VERSION,
            program: concat!("headrace ", env!("CARGO_PKG_VERSION")),
            begun_utc: None,
            not_inspected: inspected::not_inspected(dive),
            log: None,
            digest: format!("{:016x}", dive.view().digest()),
            target_m: sections.target().max_hole_m,
            section_m: sections.section_m(),
            confidence_sd: confidence(sections.target().confidence_sd),
            coverage_extent: inspected::way_report(coverage),
            dive: dive_report(dive),
            summary: summarise(sections.section_m(), way().filter_map(|index| sections.get(index))),
            sections: way().filter_map(|index| dive.view().section_row(index)).collect(),
            runs: runs::run_reports(dive),
            no_verdict: unsure::unsure_reports(coverage),
            go_back: runs::go_back(sections),
            position_gaps: position_gaps::position_gaps(dive),
            wall_stretches: wall::wall_stretches(coverage, &dive.mission().profile),
            suggested_openings: wall::suggested_openings(
                coverage,
                &dive.mission().profile,
                dive.mission().length_m,
            ),
            survey: survey::survey(coverage, &dive.mission().profile),
            other_targets: Vec::new(),
            heads: dive.head_descriptions().clone(),
            openings: dive.mission().coverage.openings.iter().map(opening_report).collect(),
            alert_list: listed(dive),
            alerts_dropped: dive.view().alert_list().dropped(),
            notes: dive.view().notes().iter().map(|note| NoteJson::of(note, clock)).collect(),
            notes_dropped: dive.view().notes().dropped(),
            console: console_report(dive.view().console_counts()),
            advice: log.entries.iter().map(|entry| advice::advice_report(entry, clock)).collect(),
            advice_dropped: log.dropped,
            sources: sources::source_reports(dive),
            smoothing: None,
        };
        let (sum_m, way_m) = (report.summary.way_m(), report.coverage_extent.length_m);
        debug_assert!(
            (sum_m - way_m).abs() < 1e-6,
            "metres by verdict add up to {sum_m} m, not to the coverage extent of {way_m} m"
        );
        report
    }

    /// Length of tunnel by verdict, for the dive's own target and section length.
    pub fn metres(&self) -> OtherTargetReport {
        let sum = &self.summary;
        OtherTargetReport {
            target_m: self.target_m,
            section_m: self.section_m,
            pass_m: sum.pass_m,
            fail_m: sum.fail_m,
            cannot_say_m: sum.cannot_say_m,
            open_m: sum.open_m,
            not_inspected_m: sum.not_inspected_m,
        }
    }

    /// Whether any received data were lost before they were used.
    pub fn lost_data(&self) -> bool {
        let rejected = &self.dive.samples_rejected;
        let dropped =
            self.sources.iter().flat_map(|source| &source.line).any(|line| line.dropped_packets > 0);
        rejected.not_stored > 0 || dropped || self.log.as_ref().is_some_and(|log| !log.losses.is_empty())
    }
}

impl SummaryReport {
    /// Total length over all verdicts, m.
    pub fn way_m(&self) -> f64 {
        self.pass_m + self.fail_m + self.cannot_say_m + self.open_m + self.not_inspected_m
    }
}

/// Alerts that the list still holds at the end of the dive, in their state at that time.
fn listed(dive: &Loop) -> Vec<ListedAlertJson> {
    let around = dive.view().surroundings();
    let now = dive.view().last_received().unwrap_or(MonoNs(0));
    dive.view().alert_list().iter().map(|alert| alert.json(&around, now)).collect()
}

fn console_report(counts: ConsoleCounts) -> Option<ConsoleReport> {
    let ConsoleCounts { packets, invalid, without_effect } = counts;
    (packets > 0).then_some(ConsoleReport { packets, invalid, without_effect })
}

/// Confidence as a whole number, as in the setting.
fn confidence(confidence_sd: f64) -> u32 {
    u32::try_from(headrace_geometry::math::round_to_i64(confidence_sd)).unwrap_or(0)
}

fn dive_report(dive: &Loop) -> DiveReport {
    let (coverage, tally) = (dive.view().coverage(), dive.view().tally());
    let [sound_speed_least_mps, sound_speed_most_mps] = dive.sound_speeds_mps();
    let swept = coverage.frontier.swept();
    let (clock, last) = (dive.view().clock(), dive.view().last_received());
    DiveReport {
        duration_s: last.map_or(0.0, |last| clock.seconds(last)),
        start_s: clock.zero().unwrap_or(MonoNs(0)).as_secs_f64(),
        from_m: swept.map(|reach| reach.from_m),
        to_m: swept.map(|reach| reach.to_m),
        distance_m: swept.map_or(0.0, |reach| reach.to_m - reach.from_m),
        sonar: inspected::pings(tally) > 0,
        sound_speed_least_mps,
        sound_speed_most_mps,
        samples_valid: tally.samples - tally.outside - tally.not_stored,
        samples_thinned: coverage.store.usage().thinned,
        samples_rejected: RejectedReport {
            missing: tally.missing,
            out_of_range: tally.out_of_range,
            occluded: tally.occluded,
            no_fix: tally.unplaced,
            outside: tally.outside,
            not_stored: tally.not_stored,
            doubtful_returns: tally.doubtful,
        },
    }
}

fn summarise<'a>(section_m: f64, sections: impl Iterator<Item = &'a Section>) -> SummaryReport {
    let (mut t_x, mut t_y, mut t, mut hole) =
        (Spread::default(), Spread::default(), Spread::default(), Spread::default());
    let (mut counts, mut raised, mut cleared) = ([0_u32; 5], 0, 0);
    for section in sections {
        t_x.merge(&section.t_x_m);
        t_y.merge(&section.t_y_m);
        t.merge(&section.t_m);
        if let Some(found) = section.hole {
            hole.add(found.diameter_m);
        }
        // Each section counts once, so that the sums add up to the coverage extent.
        let place = match (section.verdict, section.not_inspected) {
            (Verdict::Pass, _) => 0,
            (Verdict::Fail, _) => 1,
            (Verdict::CannotSay, _) => 2,
            (Verdict::Open, false) => 3,
            (Verdict::Open, true) => 4,
        };
        if let Some(count) = counts.get_mut(place) {
            *count += 1;
        }
        raised += u32::from(section.flagged.is_some());
        cleared += u32::from(section.cleared.is_some());
    }
    let [pass_m, fail_m, cannot_say_m, open_m, not_inspected_m] =
        counts.map(|count| f64::from(count) * section_m);
    SummaryReport {
        pass_m,
        fail_m,
        cannot_say_m,
        open_m,
        not_inspected_m,
        flags_raised: raised,
        flags_cleared: cleared,
        t_x: SpreadReport::from(&t_x),
        t_y: SpreadReport::from(&t_y),
        t: SpreadReport::from(&t),
        hole: SpreadReport::from(&hole),
    }
}

fn opening_report(opening: &Opening) -> OpeningReport {
    OpeningReport {
        name: opening.name.clone(),
        from_m: opening.from_m,
        to_m: opening.to_m,
        arc_from_m: opening.arc_m.map(|(from_m, _)| from_m),
        arc_length_m: opening.arc_m.map(|(_, length_m)| length_m),
    }
}
