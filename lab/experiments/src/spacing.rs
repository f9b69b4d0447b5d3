//! Sample spacings of Jorge et al. 2021, measured on simulated samples: T_y from ping to ping, T_x from pass to pass, T
//! combined.

use headrace_geometry::math::{self, TAU};
use headrace_sampling::layout::HeadLayout;
use serde::Serialize;

use crate::Spread;
use crate::runs::{Dive, Sample};

/// Number of lines along the wall on which passes are counted.
const LINES: usize = 72;
/// Tolerance of the angle of a regular step, as a share of the usual step.
const STEP_SHARE: f64 = 0.25;

/// The sample spacings of a run, as in the paper's Tables 3 to 5.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub(crate) struct Spacing {
    /// T_x: mean distance along the tunnel from pass to pass.
    ///
    /// In the phase-shift layout, passes are counted on lines along the wall. In the sector-offset layout, each turning
    /// point of a head at one end of its sector counts as a pass.
    pub t_x_m: f64,
    /// T_y: distance across the tunnel from ping to ping, in the cross-section.
    pub t_y: Spread,
    /// T = sqrt(T_x^2 + T_y^2) for the mean, least and largest T_y.
    pub t_m: [f64; 3],
}

/// Measures the spacings of a dive.
pub(crate) fn spacing(dive: &Dive, layout: HeadLayout) -> Spacing {
    let t_y = Spread::of(dive.heads.iter().flat_map(|samples| steps_m(samples, dive.step_rad)));
    let t_x_m = match layout {
        HeadLayout::PhaseShift => Spread::of(passes(dive, LINES).iter().flat_map(|line| gaps_m(line))).mean_m,
        HeadLayout::SectorOffset => {
            Spread::of(dive.heads.iter().flat_map(|samples| turning_gaps_m(samples))).mean_m
        }
    };
    let t = |t_y: f64| math::hypot(t_x_m, t_y);
    Spacing { t_x_m, t_y, t_m: [t(t_y.mean_m), t(t_y.min_m), t(t_y.max_m)] }
}

fn turned_rad(a: &Sample, b: &Sample) -> f64 {
    math::wrap_signed(b.angle_rad - a.angle_rad, TAU)
}

/// Distances in the cross-section between consecutive pings that are one regular step apart.
fn steps_m(samples: &[Sample], step_rad: f64) -> impl Iterator<Item = f64> {
    samples.windows(2).filter_map(move |pair| {
        let [a, b] = pair else { return None };
        let whole = (turned_rad(a, b).abs() - step_rad).abs() < STEP_SHARE * step_rad;
        let between = b.at - a.at;
        (whole && a.of_wall && b.of_wall).then(|| math::hypot(between.y(), between.z()))
    })
}

/// The chainages at which heads passed each line along the wall, ascending.
pub(crate) fn passes(dive: &Dive, count: usize) -> Vec<Vec<f64>> {
    let perimeter_m = dive.profile.perimeter_m();
    // Only the stretch that all heads have passed is used. Elsewhere fewer heads have passed, so passes are farther
    // apart.
    let ends = |pick: fn(&[Sample]) -> Option<&Sample>| {
        dive.heads.iter().filter_map(move |samples| pick(samples)).map(|s| s.at.x())
    };
    let from_m = ends(<[Sample]>::first).fold(f64::NEG_INFINITY, f64::max);
    let to_m = ends(<[Sample]>::last).fold(f64::INFINITY, f64::min);
    let line = |number: usize| {
        let arc_m = perimeter_m * (number as f64 + 0.37) / count as f64;
        let passed = dive.heads.iter().flat_map(|samples| passes_of(dive, samples, arc_m));
        let mut line: Vec<f64> = passed.filter(|x_m| (from_m..to_m).contains(x_m)).collect();
        line.sort_by(f64::total_cmp);
        line
    };
    (0..count).map(line).collect()
}

/// The chainages at which a head passed a line along the wall, in time order.
pub(crate) fn passes_of(dive: &Dive, samples: &[Sample], arc_m: f64) -> impl Iterator<Item = f64> {
    let (perimeter_m, step_rad) = (dive.profile.perimeter_m(), dive.step_rad);
    samples.windows(2).filter_map(move |pair| {
        let [a, b] = pair else { return None };
        if !(a.of_wall && b.of_wall) || turned_rad(a, b).abs() > 2.0 * step_rad {
            return None;
        }
        let around_m = math::wrap_signed(b.arc_m - a.arc_m, perimeter_m);
        let share = math::wrap_signed(arc_m - a.arc_m, perimeter_m) / around_m;
        (0.0..1.0).contains(&share).then(|| a.at.x() + share * (b.at.x() - a.at.x()))
    })
}

pub(crate) fn gaps_m(passes: &[f64]) -> impl Iterator<Item = f64> {
    passes.windows(2).filter_map(|pair| match pair {
        [a, b] => Some(b - a),
        _ => None,
    })
}

/// Distances in chainage between a head's turning points at the same end of its sector.
fn turning_gaps_m(samples: &[Sample]) -> Vec<f64> {
    let mut ends: [Vec<f64>; 2] = [Vec::new(), Vec::new()];
    for triple in samples.windows(3) {
        let [a, b, c] = triple else { continue };
        let (before, after) = (turned_rad(a, b), turned_rad(b, c));
        if before * after < 0.0 {
            ends[usize::from(before > 0.0)].push(b.at.x());
        }
    }
    ends.iter().flat_map(|end| gaps_m(end)).collect()
}
