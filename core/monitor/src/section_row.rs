//! Row of one section for the report, the page and the tables. All three encode this row.

use serde::{Serialize, Serializer};

use crate::report::spread::SpreadReport;
use headrace_coverage::{Evidence, Section, Sections, Unsure, Verdict};
use headrace_geometry::time::DiveClock;
use headrace_geometry::tunnel::Profile;

/// One section with its verdict and figures.
#[expect(clippy::struct_excessive_bools, reason = "the flags are independent of one another")]
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SectionRow {
    /// Number of the section: the chainage of its start divided by the section length.
    #[serde(skip)]
    pub index: i64,
    /// Beginning of the section, m.
    pub start_m: f64,
    /// End of the section, m.
    pub end_m: f64,
    /// Diameter of the section's largest hole, m; `None` if the hole wasn't measured.
    pub hole_m: Option<f64>,
    /// Lower bound of the hole's diameter, m. Samples that were dropped may have divided the hole.
    pub hole_least_m: Option<f64>,
    /// Upper bound of the hole's diameter, m; `None` if unbounded.
    pub hole_most_m: Option<f64>,
    /// Whether there are samples around the hole. Without them, the diameter is at least `hole_m`.
    pub hole_bounded: bool,
    /// Standard deviation of the hole's diameter, m.
    pub hole_sd_m: f64,
    /// Chainage of the hole's centre, m.
    pub hole_x_m: Option<f64>,
    /// Arc length of the hole's centre, m from the floor's centre via the left wall.
    pub hole_arc_m: Option<f64>,
    /// Clock position of the hole's centre, looking along the tunnel: 6 is the floor's centre, 9 the left
    /// wall.
    pub hole_clock: Option<String>,
    /// Distance along the tunnel between passes of heads over the same arc length.
    pub t_x: SpreadReport,
    /// Distance between neighbouring samples of one sweep.
    pub t_y: SpreadReport,
    /// Diagonal of the lattice formed by neighbouring samples of neighbouring passes.
    pub t: SpreadReport,
    /// Number of samples on the section's wall.
    pub samples: u32,
    /// Number of samples per square metre of the section's wall.
    pub density_perm2: f64,
    /// Deviation of the section's wall from the design profile; `None` without samples.
    pub deviation: Option<DeviationReport>,
    /// Share of the section's wall that is a declared opening.
    pub masked_share: f64,
    /// Verdict: `pass`, `fail`, `cannot_say` or `open`.
    #[serde(serialize_with = "verdict_word")]
    pub verdict: Verdict,
    /// Whether no further sample on the present course can change the verdict or, for a fail, the hole.
    #[serde(skip)]
    pub settled: bool,
    /// Whether the section is open although driving on does not change it.
    ///
    /// In such a section some heads have not been, because the vehicle began or turned back there.
    pub not_inspected: bool,
    /// Reason for `cannot_say`. A section with `not_inspected` has the reason `NotInspected`, which the report omits.
    #[serde(serialize_with = "reason_word")]
    pub cannot_say: Option<Unsure>,
    /// Evidence for the cause of a fail; `None` unless the verdict is `fail`.
    pub cause: Option<Evidence>,
    /// Dive time at which the section was flagged, seconds.
    pub flagged_s: Option<f64>,
    /// Dive time at which a later pass cleared the flag, seconds.
    pub cleared_s: Option<f64>,
    /// Number of returns on the section's wall that were not accepted as wall.
    pub doubtful_returns: u32,
    /// Whether the section has samples of a head that became distrusted soon afterwards. Such a section can't
    /// pass.
    pub suspect: bool,
}

/// Deviation of a section's wall from the design, along the rays from the reference point. Outward is
/// positive.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct DeviationReport {
    /// Mean deviation, m.
    pub mean_m: f64,
    /// Largest inward deviation, m; never above zero.
    pub inmost_m: f64,
    /// Largest outward deviation, m; never below zero.
    pub outmost_m: f64,
    /// Ratio of the cross-section area to the design's; `None` without sweeps.
    pub area_ratio: Option<f64>,
    /// Whether most samples deviate from the design profile by more than the contradiction limit, while no other head
    /// measured the wall at the same place.
    pub contradicts: bool,
}

impl SectionRow {
    /// Row of the section with this index, or `None` if there is no such section. It needs the tunnel's design profile
    /// and the dive's clock.
    pub(super) fn of(
        sections: &Sections,
        index: i64,
        (profile, clock): (&Profile, DiveClock),
    ) -> Option<Self> {
        let section = sections.get(index)?;
        let (start_m, end_m) = sections.bounds_m(index);
        let area_m2 = profile.perimeter_m() * sections.section_m();
        Some(Self {
            index,
            start_m,
            end_m,
            hole_m: section.hole.map(|hole| hole.diameter_m),
            hole_least_m: section.hole.map(|hole| hole.least_m),
            hole_most_m: section.hole.map(|hole| hole.most_m).filter(|most_m| most_m.is_finite()),
            hole_bounded: section.hole.is_some_and(|hole| hole.bounded),
            hole_sd_m: section.hole_sd_m,
            hole_x_m: section.hole.map(|hole| hole.x_m),
            hole_arc_m: section.hole.map(|hole| hole.arc_m),
            hole_clock: section.hole.map(|hole| profile.clock(hole.arc_m)),
            t_x: SpreadReport::from(&section.t_x_m),
            t_y: SpreadReport::from(&section.t_y_m),
            t: SpreadReport::from(&section.t_m),
            samples: section.samples,
            density_perm2: f64::from(section.samples) / area_m2,
            deviation: deviation_report(section),
            masked_share: section.masked_share,
            verdict: section.verdict,
            settled: section.settled,
            not_inspected: section.not_inspected,
            cannot_say: section.unsure(),
            cause: section.evidence.filter(|_| section.verdict == Verdict::Fail),
            flagged_s: section.flagged.map(|at| clock.seconds(at)),
            cleared_s: section.cleared.map(|at| clock.seconds(at)),
            doubtful_returns: section.doubtful,
            suspect: section.suspect,
        })
    }

    /// Whether the section is flagged at present.
    pub fn is_flagged(&self) -> bool {
        self.flagged_s.is_some() && self.cleared_s.is_none()
    }
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde's signature")]
fn verdict_word<S: Serializer>(verdict: &Verdict, to: S) -> Result<S::Ok, S::Error> {
    to.serialize_str(verdict.as_str())
}

#[expect(clippy::ref_option, clippy::trivially_copy_pass_by_ref, reason = "serde's signature")]
fn reason_word<S: Serializer>(reason: &Option<Unsure>, to: S) -> Result<S::Ok, S::Error> {
    reason.filter(|reason| *reason != Unsure::NotInspected).map(Unsure::as_str).serialize(to)
}

fn deviation_report(section: &Section) -> Option<DeviationReport> {
    let [inmost_m, outmost_m] = section.deviation.extremes_m()?;
    Some(DeviationReport {
        mean_m: section.deviation.mean_m()?,
        inmost_m,
        outmost_m,
        area_ratio: section.deviation.area_ratio(),
        contradicts: section.contradicts(),
    })
}
