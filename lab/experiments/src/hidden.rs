//! Occlusion between adjacent heads (Jorge et al. 2021, §8.3).

use headrace_geometry::math::{self, TAU};
use headrace_sampling::layout::HeadLayout;
use serde::Serialize;

use crate::runs::{Dive, Sample, Setting};
use crate::spacing::{gaps_m, passes};
use crate::{ExperimentError, Progress};

/// Length of each simulated run, m.
const LENGTH_M: f64 = 130.0;
/// Number of lines around the perimeter on which passes are evaluated.
const LINES: usize = 720;

/// Occlusion in a layout whose heads occlude each other.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct HiddenRow {
    /// Number of heads.
    pub heads: u8,
    /// Phase difference between adjacent heads, degrees.
    pub side_by_side_deg: f64,
    /// Part of a head's turn in which its neighbour occludes the wall, degrees.
    pub angle_deg: f64,
    /// Arc length of wall that the neighbour occludes from the head, m.
    pub gap_m: f64,
    /// Distance between passes without occlusion, m: T_x of one head divided by the number of heads.
    pub t_x_m: f64,
    /// The largest distance between passes on any line, as a multiple of `t_x_m`.
    pub times: f64,
    /// Mean of the largest distances between passes on the occluded lines, as a multiple of `t_x_m`.
    pub times_in_shadow: f64,
}

/// The layouts: three heads; four heads with neighbours a quarter turn apart, in two arrangements; four heads with
/// neighbours half a turn apart.
///
/// In the first arrangement with quarter turns, the occluded forward and aft heads follow each other on either wall
/// after half a turn. In the second arrangement, the same heads follow each other after a quarter turn.
const ARRANGEMENTS: [(u8, &str); 4] = [(3, ""), (4, ""), (4, "[0, 0, -90, 90]"), (4, "[0, 90, 90, 0]")];

/// Simulates all layouts in MEDIUM, as in Figure 13.
///
/// Errors: none with the built-in vehicles.
pub(crate) fn rows(progress: Progress<'_>) -> Result<Vec<HiddenRow>, ExperimentError> {
    let mut rows = Vec::new();
    for (heads, offsets) in ARRANGEMENTS {
        let effects = match offsets {
            "" => String::new(),
            offsets => format!("start_phase_error = {{ offsets_deg = {offsets} }}\n"),
        };
        progress(&format!("occlusion with {heads} heads"));
        let setting = Setting {
            heads,
            mode: "medium",
            layout: HeadLayout::PhaseShift,
            aligned: true,
            occlusion: true,
            length_m: LENGTH_M,
            effects,
            seed: 1,
        };
        let dive = setting.dive()?;
        rows.push(row(heads, &dive));
    }
    Ok(rows)
}

fn row(heads: u8, dive: &Dive) -> HiddenRow {
    let aft = dive.heads.last().map(Vec::as_slice).unwrap_or_default();
    let (angle_rad, gap_m) = shadow(aft, dive);
    let lines = passes(dive, LINES);
    let largest: Vec<f64> = lines.iter().map(|line| gaps_m(line).fold(0.0, f64::max)).collect();
    let mut sorted = largest.clone();
    sorted.sort_by(f64::total_cmp);
    let t_x_m = sorted.get(sorted.len() / 4).copied().unwrap_or(0.0);
    let hidden: Vec<f64> = largest.iter().copied().filter(|gap| *gap > 1.5 * t_x_m).collect();
    let mean = hidden.iter().sum::<f64>() / (hidden.len().max(1)) as f64;
    HiddenRow {
        heads,
        side_by_side_deg: side_by_side_rad(dive).to_degrees(),
        angle_deg: angle_rad.to_degrees(),
        gap_m,
        t_x_m,
        times: sorted.last().copied().unwrap_or(0.0) / t_x_m,
        times_in_shadow: mean / t_x_m,
    }
}

/// The largest range of consecutive angles at which a head hits its neighbour, and the length of wall behind the
/// neighbour.
fn shadow(samples: &[Sample], dive: &Dive) -> (f64, f64) {
    let (mut angle_rad, mut gap_m) = (0.0_f64, 0.0_f64);
    let mut began: Option<&Sample> = None;
    let mut last: Option<&Sample> = None;
    for sample in samples {
        if sample.of_wall {
            if let (Some(from), Some(before)) = (began, last) {
                // The edge of the occluded range falls between two pings. On average it is half a step away, so half a
                // step at each edge counts as occluded.
                let turned = math::wrap_signed(before.angle_rad - from.angle_rad, TAU).abs() + dive.step_rad;
                angle_rad = angle_rad.max(turned);
                let around = math::wrap_signed(before.arc_m - from.arc_m, dive.profile.perimeter_m());
                gap_m = gap_m.max(around.abs() * (turned / (turned - dive.step_rad)));
            }
            began = None;
        } else if began.is_none() {
            began = Some(sample);
        }
        last = Some(sample);
    }
    (angle_rad, gap_m)
}

/// Phase difference between the last two heads, radians in (0, pi]. These heads are adjacent.
fn side_by_side_rad(dive: &Dive) -> f64 {
    let firsts: Vec<f64> =
        dive.heads.iter().rev().take(2).filter_map(|samples| samples.first()).map(|s| s.angle_rad).collect();
    match firsts.as_slice() {
        [a, b] => math::wrap_signed(a - b, TAU).abs(),
        _ => 0.0,
    }
}
