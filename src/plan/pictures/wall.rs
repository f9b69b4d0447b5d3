//! Finds the point of largest spacing, and the strips that some heads don't see.

use headrace_geometry::math;
use headrace_sampling::plan::{Planner, WallPlace};
use headrace_sampling::strips::Strips;

/// Point on the wall with the largest sample spacing T. Among points with nearly equal T, the one nearest to
/// the left wall is returned.
pub(super) fn worst(planner: &Planner, places: &[WallPlace]) -> Option<WallPlace> {
    /// Two values of T count as equal if the smaller one divided by the larger one is above this value. At the edge of
    /// a strip, T is slightly larger than within the strip, because of steps across the edge.
    const EQUAL: f64 = 0.995;
    let profile = &planner.inspection().profile;
    let [y_m, z_m] = profile.reference();
    let left_m = profile.arc_of([y_m + 1.0, z_m]);
    let most_m = places.iter().filter_map(|place| place.t_m).fold(0.0, f64::max);
    let worst = places.iter().filter(|place| place.t_m.is_some_and(|t_m| t_m >= EQUAL * most_m));
    let off_m = |place: &WallPlace| (place.arc_m - left_m).abs();
    worst.min_by(|a, b| off_m(a).total_cmp(&off_m(b))).copied()
}

/// A stretch of the perimeter that fewer heads see than the best-covered part of the perimeter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Thin {
    pub(super) from_m: f64,
    pub(super) to_m: f64,
    /// Number of heads that see the stretch. `of` is the largest number of heads at any point.
    pub(super) heads: usize,
    pub(super) of: usize,
}

impl Thin {
    /// Caption of the stretch, as two short lines.
    pub(super) fn words(&self) -> [String; 2] {
        match self.heads {
            0 => ["no head".to_owned(), "sees it".to_owned()],
            heads => [format!("{heads} of {}", self.of), "heads".to_owned()],
        }
    }
}

/// Stretches that fewer heads see than the best-covered part, with the vehicle at its nominal position. A stretch that
/// crosses the seam is split.
pub(super) fn thin(planner: &Planner) -> Vec<Thin> {
    let perimeter_m = planner.inspection().profile.perimeter_m();
    let strips = planner.nominal_strips().map(Strips::as_slice).unwrap_or_default();
    let of = strips.iter().map(|strip| strip.seen_by.len()).max().unwrap_or(0);
    let mut stretches = Vec::new();
    for strip in strips.iter().filter(|strip| strip.seen_by.len() < of.max(1)) {
        let (from_m, to_m) = (strip.arc.from_m, strip.arc.from_m + strip.arc.length_m);
        let heads = strip.seen_by.len();
        stretches.push(Thin { from_m, to_m: to_m.min(perimeter_m), heads, of });
        if to_m > perimeter_m {
            stretches.push(Thin { from_m: 0.0, to_m: to_m - perimeter_m, heads, of });
        }
    }
    stretches.retain(|stretch| stretch.to_m - stretch.from_m > 1e-6);
    stretches.sort_by(|a, b| a.from_m.total_cmp(&b.from_m));
    stretches
}

/// Centre of the widest strip that no head sees, m.
pub(super) fn unseen_m(planner: &Planner) -> Option<f64> {
    let profile = &planner.inspection().profile;
    let strips = planner.nominal_strips()?.as_slice().iter();
    let unseen = strips.filter(|strip| strip.seen_by.is_empty()).map(|strip| strip.arc);
    let widest = unseen.max_by(|a, b| a.length_m.total_cmp(&b.length_m))?;
    Some(math::wrap(widest.from_m + widest.length_m / 2.0, profile.perimeter_m()))
}
