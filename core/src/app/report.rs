//! The report: what a dive has shown, as plain values with units in their names. Its JSON is versioned; docs/ has the
//! schema.

use serde::Serialize;

use super::flow::{AdviceEntry, AdviceLog, Coverage, Navigator, SourceTallies, Tally};
use super::run::Loop;
use super::smoothing::SmoothingReport;
use crate::coverage::{Evidence, Section, Sections, Spread, Verdict};
use crate::sampling::advice::{Alternative, Left, Remedy};
use crate::time::MonoNs;

/// Version of the report's form.
pub const REPORT_VERSION: u32 = 1;

/// A whole report. Field names are the contract.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Report {
    /// Version of this form.
    pub report_version: u32,
    /// The log, where the dive was read from or written to one.
    pub log: Option<LogReport>,
    /// Digest of all results, 16 hexadecimal digits.
    pub digest: String,
    /// Target T, m.
    pub target_m: f64,
    /// Length of a section, m.
    pub section_m: f64,
    /// The dive as a whole.
    pub dive: DiveReport,
    /// Metres by verdict, and the spacings over all sections.
    pub summary: SummaryReport,
    /// Every section passed, in the order of chainage.
    pub sections: Vec<SectionReport>,
    /// The advice over time.
    pub advice: Vec<AdviceReport>,
    /// Advice left out for want of room.
    pub advice_dropped: u64,
    /// What each source has sent.
    pub sources: Vec<SourceReport>,
    /// What smoothing has changed; `None` where nothing was smoothed.
    pub smoothing: Option<SmoothingReport>,
}

/// The log that a dive was read from or written to.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct LogReport {
    /// Its path as given.
    pub path: String,
    /// Its SHA-256, hexadecimal.
    pub sha256: String,
    /// Messages of sources.
    pub messages: u64,
    /// What was lost, in words, each with its time span.
    pub losses: Vec<String>,
}

/// The dive as a whole.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct DiveReport {
    /// First to last packet, seconds.
    pub duration_s: f64,
    /// First packet on the log's clock, seconds.
    pub start_s: f64,
    /// Least chainage that any head's reach covered, m.
    pub from_m: Option<f64>,
    /// Greatest, m.
    pub to_m: Option<f64>,
    /// Between them, m.
    pub distance_m: f64,
    /// Whether any ping of a profiling head came; without, there is no coverage to speak of.
    pub sonar: bool,
    /// Samples on the wall.
    pub samples_valid: u64,
    /// Pings that gave none, by reason.
    pub samples_rejected: RejectedReport,
}

/// Pings that gave no sample.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct RejectedReport {
    /// No return though the wall was within range.
    pub missing: u64,
    /// No return, the wall out of range.
    pub out_of_range: u64,
    /// A return without a fix.
    pub no_fix: u64,
    /// Beyond the ends of the tunnel.
    pub outside: u64,
    /// No room.
    pub not_stored: u64,
}

/// Count, mean, deviation and extremes; `None` where there is no value.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct SpreadReport {
    /// Values.
    pub count: u32,
    /// Smallest, m.
    pub min_m: Option<f64>,
    /// Mean, m.
    pub mean_m: Option<f64>,
    /// Largest, m.
    pub max_m: Option<f64>,
    /// Standard deviation, m.
    pub sd_m: Option<f64>,
}

/// Metres by verdict, and spacings.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SummaryReport {
    /// Metres of sections that passed.
    pub pass_m: f64,
    /// That failed.
    pub fail_m: f64,
    /// Of which nothing can be said for sure.
    pub cannot_say_m: f64,
    /// That are still open.
    pub open_m: f64,
    /// Fails that were flagged, and flags that a later pass cleared.
    pub flags_raised: u32,
    /// See `flags_raised`.
    pub flags_cleared: u32,
    /// Distance between passes.
    pub t_x: SpreadReport,
    /// Distance between neighbours of one sweep.
    pub t_y: SpreadReport,
    /// Lattice diagonal.
    pub t: SpreadReport,
    /// Holes of the sections.
    pub hole: SpreadReport,
}

/// One section.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SectionReport {
    /// Where it begins, m.
    pub start_m: f64,
    /// Where it ends, m.
    pub end_m: f64,
    /// Diameter of its largest hole, m; `None` where it wasn't measured.
    pub hole_m: Option<f64>,
    /// False where the hole is at least that large, for want of samples around it.
    pub hole_bounded: bool,
    /// Standard deviation of the hole, m.
    pub hole_sigma_m: f64,
    /// Chainage of the hole's centre, m.
    pub hole_x_m: Option<f64>,
    /// Where it is on the perimeter, m from the floor's centre via the left wall.
    pub hole_sigma_at_m: Option<f64>,
    /// The same as a clock seen along the tunnel: 6 is the floor's centre, 9 the left wall.
    pub hole_clock: Option<String>,
    /// Distance between passes.
    pub t_x: SpreadReport,
    /// Distance between neighbours of one sweep.
    pub t_y: SpreadReport,
    /// Lattice diagonal.
    pub t: SpreadReport,
    /// Samples on it.
    pub samples: u32,
    /// Samples a square metre of wall.
    pub density_perm2: f64,
    /// `pass`, `fail`, `cannot_say` or `open`.
    pub verdict: &'static str,
    /// Why it failed.
    pub cause: Option<EvidenceReport>,
    /// When it was flagged, seconds on the log's clock.
    pub flagged_s: Option<f64>,
    /// When a later pass cleared the flag.
    pub cleared_s: Option<f64>,
}

/// A cause and the figures behind it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct EvidenceReport {
    /// One of the causes of metrics.md.
    pub cause: &'static str,
    /// Mean speed in the section, m/s.
    pub speed_mps: f64,
    /// Speed that would have met the target with the heads evenly spread, m/s.
    pub even_v_max_mps: f64,
    /// Time between passes, seconds.
    pub pass_gap_s: f64,
    /// The same had the heads been spread evenly.
    pub even_pass_gap_s: f64,
    /// Share of pings without a return.
    pub missing_share: f64,
    /// Largest step along the perimeter, m.
    pub t_y_m: f64,
}

/// Advice at a moment.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct AdviceReport {
    /// Seconds on the log's clock.
    pub at_s: f64,
    /// Chainage, m.
    pub chainage_m: Option<f64>,
    /// Speed, m/s.
    pub speed_mps: f64,
    /// Largest speed that meets the target, m/s.
    pub v_max_mps: f64,
    /// Why.
    pub reason: &'static str,
    /// T predicted at the present speed, m.
    pub predicted_t_m: Option<f64>,
    /// By how much the head farthest out of its phase is, degrees of its turn.
    pub phase_error_deg: Option<f64>,
    /// Hours at `v_max_mps` for what is left of the tunnel.
    pub needed_h: Option<f64>,
    /// Whether the time that is left is enough.
    pub suffices: Option<bool>,
    /// What would help where slower doesn't: `centre`, or a mode.
    pub remedy: Option<&'static str>,
    /// What the heads could do in each of their modes.
    pub alternatives: Vec<AlternativeReport>,
}

/// What the heads could do in one of their modes.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct AlternativeReport {
    /// The mode.
    pub mode: &'static str,
    /// Largest speed that meets the target, m/s.
    pub v_max_mps: f64,
    /// Hours at that speed for what is left of the tunnel.
    pub needed_h: Option<f64>,
    /// Whether the time that is left is enough.
    pub suffices: Option<bool>,
}

/// What a source has sent.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SourceReport {
    /// Its name.
    pub id: String,
    /// Kind of device.
    pub plugin: String,
    /// Packets.
    pub packets: u64,
    /// Frames that were whole and valid.
    pub frames: u64,
    /// Candidate frames that failed.
    pub bad_frames: u64,
    /// Bytes that belong to no good frame.
    pub skipped_bytes: u64,
    /// Readings taken from them.
    pub readings: u64,
    /// Readings understood but not used: a bad status, another range setting, no calibration, a jump.
    pub withheld: u64,
    /// Longest silence between two packets, seconds.
    pub longest_gap_s: f64,
    /// Packets a second.
    pub rate_hz: f64,
    /// How well it agreed with the others in navigation; `None` without a filter, and for what it doesn't use.
    pub navigation: Option<NavigationReport>,
}

/// How a source's measurements fared in navigation.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct NavigationReport {
    /// Measured numbers that were used.
    pub used: u64,
    /// Measured numbers that were too unlikely to be used.
    pub gated: u64,
    /// Readings that came after their time.
    pub late: u64,
    /// Readings that weren't possible numbers, or for which there was no room.
    pub dropped: u64,
    /// Mean of their innovations squared, over the variances expected: about 1 where all is trusted as it deserves.
    pub nis: Option<f64>,
}

impl Report {
    /// The report of what a loop has seen so far.
    pub fn of(dive: &Loop) -> Self {
        let world = dive.world();
        let (coverage, tally) = (world.resource::<Coverage>(), *world.resource::<Tally>());
        let log = world.resource::<AdviceLog>();
        let sections = &coverage.sections;
        let passed =
            || sections.passed(coverage.frontier.swept()).filter_map(|k| Some((k, sections.get(k)?)));
        Self {
            report_version: REPORT_VERSION,
            log: None,
            digest: format!("{:016x}", dive.digest()),
            target_m: sections.target_m(),
            section_m: sections.section_m(),
            dive: dive_report(coverage, &tally),
            summary: summarise(sections.section_m(), passed().map(|(_, section)| section)),
            sections: passed().map(|(k, section)| section_report(sections, k, section, dive)).collect(),
            advice: log.entries.iter().map(advice_report).collect(),
            advice_dropped: log.dropped,
            sources: source_reports(dive, world.resource::<SourceTallies>()),
            smoothing: None,
        }
    }

    /// Whether anything that was received has been lost on the way to the results.
    pub fn lost_data(&self) -> bool {
        let rejected = &self.dive.samples_rejected;
        rejected.not_stored > 0 || self.log.as_ref().is_some_and(|log| !log.losses.is_empty())
    }
}

fn dive_report(coverage: &Coverage, tally: &Tally) -> DiveReport {
    let swept = coverage.frontier.swept();
    let (first, last) = tally.span.unwrap_or((MonoNs(0), MonoNs(0)));
    DiveReport {
        duration_s: last.since(first).as_secs_f64(),
        start_s: first.as_secs_f64(),
        from_m: swept.map(|reach| reach.from_m),
        to_m: swept.map(|reach| reach.to_m),
        distance_m: swept.map_or(0.0, |reach| reach.to_m - reach.from_m),
        sonar: tally.samples + tally.missing + tally.out_of_range + tally.unplaced > 0,
        samples_valid: tally.samples - tally.outside - tally.not_stored,
        samples_rejected: RejectedReport {
            missing: tally.missing,
            out_of_range: tally.out_of_range,
            no_fix: tally.unplaced,
            outside: tally.outside,
            not_stored: tally.not_stored,
        },
    }
}

fn summarise<'a>(section_m: f64, sections: impl Iterator<Item = &'a Section>) -> SummaryReport {
    let (mut t_x, mut t_y, mut t, mut hole) =
        (Spread::default(), Spread::default(), Spread::default(), Spread::default());
    let (mut counts, mut raised, mut cleared) = ([0_u32; 4], 0, 0);
    for section in sections {
        t_x.merge(&section.t_x_m);
        t_y.merge(&section.t_y_m);
        t.merge(&section.t_m);
        if let Some(found) = section.hole {
            hole.add(found.diameter_m);
        }
        let place = match section.verdict {
            Verdict::Pass => 0,
            Verdict::Fail => 1,
            Verdict::CannotSay => 2,
            Verdict::Open => 3,
        };
        if let Some(count) = counts.get_mut(place) {
            *count += 1;
        }
        raised += u32::from(section.flagged.is_some());
        cleared += u32::from(section.cleared.is_some());
    }
    let [pass_m, fail_m, cannot_say_m, open_m] = counts.map(|count| f64::from(count) * section_m);
    SummaryReport {
        pass_m,
        fail_m,
        cannot_say_m,
        open_m,
        flags_raised: raised,
        flags_cleared: cleared,
        t_x: spread_report(&t_x),
        t_y: spread_report(&t_y),
        t: spread_report(&t),
        hole: spread_report(&hole),
    }
}

fn section_report(sections: &Sections, index: i64, section: &Section, dive: &Loop) -> SectionReport {
    let (start_m, end_m) = sections.bounds_m(index);
    let profile = &dive.mission().profile;
    let area_m2 = profile.perimeter_m() * sections.section_m();
    SectionReport {
        start_m,
        end_m,
        hole_m: section.hole.map(|hole| hole.diameter_m),
        hole_bounded: section.hole.is_some_and(|hole| hole.bounded),
        hole_sigma_m: section.hole_sigma_m,
        hole_x_m: section.hole.map(|hole| hole.x_m),
        hole_sigma_at_m: section.hole.map(|hole| hole.sigma_m),
        hole_clock: section.hole.map(|hole| profile.clock(hole.sigma_m)),
        t_x: spread_report(&section.t_x_m),
        t_y: spread_report(&section.t_y_m),
        t: spread_report(&section.t_m),
        samples: section.samples,
        density_perm2: f64::from(section.samples) / area_m2,
        verdict: section.verdict.as_str(),
        cause: section.evidence.filter(|_| section.verdict == Verdict::Fail).map(evidence_report),
        flagged_s: section.flagged.map(MonoNs::as_secs_f64),
        cleared_s: section.cleared.map(MonoNs::as_secs_f64),
    }
}

fn evidence_report(evidence: Evidence) -> EvidenceReport {
    EvidenceReport {
        cause: evidence.cause.as_str(),
        speed_mps: evidence.speed_mps,
        even_v_max_mps: evidence.even_v_max_mps,
        pass_gap_s: evidence.pass_gap_s,
        even_pass_gap_s: evidence.even_pass_gap_s,
        missing_share: evidence.missing_share,
        t_y_m: evidence.t_y_m,
    }
}

fn advice_report(entry: &AdviceEntry) -> AdviceReport {
    let (left, others) = (entry.advice.left, entry.advice.alternatives.iter().flatten());
    AdviceReport {
        at_s: entry.at.as_secs_f64(),
        chainage_m: entry.chainage_m,
        speed_mps: entry.speed_mps,
        v_max_mps: entry.advice.v_max_mps,
        reason: entry.advice.reason.as_str(),
        predicted_t_m: entry.advice.predicted_t_m,
        phase_error_deg: entry.advice.phase_error_rad.map(f64::to_degrees),
        needed_h: left.hours_at(entry.advice.v_max_mps),
        suffices: left.suffices_at(entry.advice.v_max_mps),
        remedy: entry.advice.remedy.map(Remedy::as_str),
        alternatives: others.map(|other| alternative_report(other, &left)).collect(),
    }
}

fn alternative_report(other: &Alternative, left: &Left) -> AlternativeReport {
    let Alternative { mode, v_max_mps } = *other;
    let (needed_h, suffices) = (left.hours_at(v_max_mps), left.suffices_at(v_max_mps));
    AlternativeReport { mode, v_max_mps, needed_h, suffices }
}

fn source_reports(dive: &Loop, tallies: &SourceTallies) -> Vec<SourceReport> {
    let decoders = dive.decoder_counts().into_iter().zip(dive.decoder_withheld());
    let navigation = &dive.world().resource::<Navigator>().navigation;
    dive.sources()
        .iter()
        .zip(&tallies.0)
        .zip(decoders)
        .enumerate()
        .map(|(number, ((source, tally), (counts, withheld)))| {
            let span_s = tally.span.map_or(0.0, |(first, last)| last.since(first).as_secs_f64());
            let intervals = tally.packets.saturating_sub(1) as f64;
            SourceReport {
                id: source.id.clone(),
                plugin: source.plugin.clone(),
                packets: tally.packets,
                frames: counts.good_frames,
                bad_frames: counts.bad_frames,
                skipped_bytes: counts.skipped_bytes,
                readings: tally.readings,
                withheld,
                longest_gap_s: tally.longest_gap.as_secs_f64(),
                rate_hz: if span_s > 0.0 { intervals / span_s } else { 0.0 },
                navigation: navigation.consistency(number).map(|consistency| NavigationReport {
                    used: consistency.used,
                    gated: consistency.gated,
                    late: consistency.late,
                    dropped: consistency.dropped,
                    nis: consistency.nis(),
                }),
            }
        })
        .collect()
}

fn spread_report(spread: &Spread) -> SpreadReport {
    let known = |value: f64| (spread.count > 0).then_some(value);
    SpreadReport {
        count: spread.count,
        min_m: known(spread.min),
        mean_m: spread.mean(),
        max_m: known(spread.max),
        sd_m: spread.sd(),
    }
}
