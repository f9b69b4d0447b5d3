//! Samples by node of a survey grid, in the report.

use serde::Serialize;

use crate::resources::Coverage;
use headrace_coverage::soundings::ENOUGH;
use headrace_geometry::tunnel::Profile;

/// Samples by node of a square grid over the sections of the coverage extent.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SurveyReport {
    /// Edge of a node along the tunnel, m.
    pub node_m: f64,
    /// Edge of a node round the perimeter, m.
    pub around_m: f64,
    /// Number of samples that a node needs.
    pub enough: u16,
    /// Number of nodes in the coverage extent.
    pub nodes: u32,
    /// Share of the nodes in the coverage extent that have enough samples; `None` if there are no nodes.
    pub enough_share: Option<f64>,
    /// Number of nodes in the coverage extent without a sample.
    pub empty: u32,
    /// Node counts by row along the tunnel.
    pub rows: Vec<NodeRowReport>,
    /// The first nodes without a sample, in the order of chainage.
    pub holidays: Vec<HolidayReport>,
}

/// A row of nodes round the perimeter.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct NodeRowReport {
    /// Beginning of the row, m.
    pub start_m: f64,
    /// Number of nodes in the row.
    pub nodes: u32,
    /// Number of nodes with enough samples.
    pub enough: u32,
    /// Number of nodes without any sample.
    pub empty: u32,
}

/// A node without a sample.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct HolidayReport {
    /// Chainage of the node's centre, m.
    pub x_m: f64,
    /// Arc length of the node's centre, m.
    pub arc_m: f64,
    /// Clock position of the node's centre.
    pub clock: String,
}

/// Maximum number of nodes without a sample that are listed. The field `empty` counts all of them.
const LISTED: usize = 1000;

pub(super) fn survey(coverage: &Coverage, profile: &Profile) -> SurveyReport {
    let Coverage { soundings, sections, frontier, .. } = coverage;
    let [node_m, around_m] = soundings.node_m();
    let way = sections.sections_of(frontier.way());
    let (from_m, to_m) = (sections.bounds_m(way.start).0, sections.bounds_m(way.end).0);
    let all = soundings.summary(from_m, to_m);
    let mut rows: Vec<NodeRowReport> = Vec::new();
    for node in soundings.nodes_between(from_m, to_m) {
        let start_m = node.x_m - node_m / 2.0;
        if rows.last().is_none_or(|row| row.start_m < start_m) {
            rows.push(NodeRowReport { start_m, nodes: 0, enough: 0, empty: 0 });
        }
        if let Some(row) = rows.last_mut() {
            row.nodes += 1;
            row.enough += u32::from(node.count >= ENOUGH);
            row.empty += u32::from(node.count == 0);
        }
    }
    let holidays = soundings.empty_between(from_m, to_m).take(LISTED).map(|node| HolidayReport {
        x_m: node.x_m,
        arc_m: node.arc_m,
        clock: profile.clock(node.arc_m),
    });
    SurveyReport {
        node_m,
        around_m,
        enough: ENOUGH,
        nodes: all.nodes,
        enough_share: all.enough_share(),
        empty: all.empty,
        holidays: holidays.collect(),
        rows,
    }
}
