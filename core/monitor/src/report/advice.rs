//! Speed advice in the report.

use serde::Serialize;

use crate::advice_log::AdviceEntry;
use headrace_geometry::time::DiveClock;
use headrace_sampling::advice::{Alternative, Left};
use headrace_sampling::margin::Margins;

/// Speed advice at one time of the dive.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct AdviceReport {
    /// Dive time of the advice, seconds.
    pub at_s: f64,
    /// Chainage of the vehicle, m.
    pub chainage_m: Option<f64>,
    /// Speed of the vehicle, m/s.
    pub speed_mps: f64,
    /// Largest speed that meets the target, m/s.
    pub v_max_mps: f64,
    /// Speed below which heads at different places along the hull run out of phase, m/s; zero if a lower
    /// speed always helps.
    pub from_mps: f64,
    /// Speed that meets the target and is nearest to the present speed, m/s; `None` if the present speed meets the
    /// target.
    pub nearest_mps: Option<f64>,
    /// Factor that limits the speed.
    pub reason: &'static str,
    /// Spacing T predicted at the present speed, m.
    pub predicted_t_m: Option<f64>,
    /// Whether the present turn of the heads will exceed the target at the present speed.
    pub will_exceed: bool,
    /// Largest phase error of a head, as an angle of the head's turn, degrees.
    pub phase_error_deg: Option<f64>,
    /// Hours needed for the rest of the tunnel at `v_max_mps`.
    pub needed_h: Option<f64>,
    /// Whether the remaining dive time is enough for the rest of the tunnel.
    pub suffices: Option<bool>,
    /// Remedy if a lower speed does not help: `centre`, `steady`, or the name of a scan mode.
    pub remedy: Option<String>,
    /// Speeds possible in each scan mode of the heads.
    pub alternatives: Vec<AlternativeReport>,
    /// Speed at which the present mode meets the target if the heads are set in phase again for this speed,
    /// m/s.
    pub restart_for_mps: Option<f64>,
    /// Largest speeds that meet the target: without margins, then as each margin is added.
    pub margins: Option<MarginsReport>,
}

/// Largest speeds that meet the target: without margins, then as each margin is added.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct MarginsReport {
    /// Largest speed for each number of margins, m/s.
    #[serde(flatten)]
    pub margins: Margins,
    /// The margin that costs most speed.
    pub costliest: &'static str,
}

/// Speed possible in one scan mode of the heads.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct AlternativeReport {
    /// Name of the scan mode.
    pub mode: String,
    /// Largest speed that meets the target in this mode, m/s.
    pub v_max_mps: f64,
    /// Hours needed for the rest of the tunnel at this `v_max_mps`.
    pub needed_h: Option<f64>,
    /// Whether the remaining dive time is enough for the rest of the tunnel.
    pub suffices: Option<bool>,
}

pub(super) fn advice_report(entry: &AdviceEntry, clock: DiveClock) -> AdviceReport {
    let (left, others) = (entry.advice.left, entry.advice.alternatives.iter().flatten());
    AdviceReport {
        at_s: clock.seconds(entry.at),
        chainage_m: entry.chainage_m,
        speed_mps: entry.speed_mps,
        v_max_mps: entry.advice.v_max_mps,
        from_mps: entry.advice.from_mps,
        nearest_mps: entry.advice.nearest_mps,
        reason: entry.advice.reason.as_str(),
        predicted_t_m: entry.advice.predicted_t_m,
        will_exceed: entry.advice.will_exceed,
        phase_error_deg: entry.advice.phase_error_rad.map(f64::to_degrees),
        needed_h: left.hours_at(entry.advice.v_max_mps),
        suffices: left.suffices_at(entry.advice.v_max_mps),
        remedy: entry.advice.remedy.map(|remedy| remedy.as_str().to_owned()),
        alternatives: others.map(|other| alternative_report(other, &left)).collect(),
        restart_for_mps: entry.advice.anew.map(|anew| anew.planned_speed_mps),
        margins: entry
            .advice
            .margins
            .map(|margins| MarginsReport { margins, costliest: margins.costliest().as_str() }),
    }
}

fn alternative_report(other: &Alternative, left: &Left) -> AlternativeReport {
    let Alternative { mode, v_max_mps } = *other;
    let (needed_h, suffices) = (left.hours_at(v_max_mps), left.suffices_at(v_max_mps));
    AlternativeReport { mode: mode.as_str().to_owned(), v_max_mps, needed_h, suffices }
}
