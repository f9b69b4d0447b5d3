//! Position gaps in the report.

use serde::Serialize;

use crate::run::Loop;
use crate::surveyor::PositionGap;

/// A stretch of the dive in which the heads pinged without a position for at least five seconds.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PositionGapReport {
    /// Beginning of the gap, seconds of dive time.
    pub from_s: f64,
    /// End of the gap, seconds of dive time.
    pub to_s: f64,
    /// Number of pings without a position.
    pub pings: u64,
    /// Chainage of the last fix before the gap, m; `None` if there was none.
    pub from_m: Option<f64>,
    /// Chainage at the end of the gap, m; `None` if it can't be predicted.
    pub to_m: Option<f64>,
    /// Whether a fix has ended the gap. Otherwise `to_m` is predicted from the mean speed before the gap.
    pub is_over: bool,
    /// Chainage to which the vehicle has to go back to scan the stretch with a position, m.
    pub back_to_m: Option<f64>,
}

pub(super) fn position_gaps(dive: &Loop) -> Vec<PositionGapReport> {
    let view = dive.view();
    let sections = &view.coverage().sections;
    let end_m = dive.mission().length_m;
    let report = |gap: &PositionGap| {
        let ends_m = gap.from_m.zip(gap.to_m);
        PositionGapReport {
            from_s: view.clock().seconds(gap.span[0]),
            to_s: view.clock().seconds(gap.span[1]),
            pings: gap.pings,
            from_m: gap.from_m,
            to_m: gap.to_m.map(|to_m| if gap.is_over { to_m } else { to_m.clamp(0.0, end_m) }),
            is_over: gap.is_over,
            back_to_m: ends_m.map(|(from_m, to_m)| sections.back_to_m(from_m.min(to_m))),
        }
    };
    view.surveyor().position_gaps().iter().map(report).collect()
}
