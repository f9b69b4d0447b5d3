//! Gain in speed from mounting the heads in line along the hull.

use serde::Serialize;

use super::planner::{Inspection, Planner};
use crate::error::SamplingError;
use headrace_geometry::frames::Vec3;

/// Gap between two heads in line along the hull, m, for connectors and cables.
const GAP_M: f64 = 0.05;
/// Distance below which two mounts count as the same, m.
const SAME_M: f64 = 0.01;

/// Heads in line along the hull, so that no head hides the wall from another head.
///
/// The line passes through the mean position of the heads as mounted now.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct InLine {
    /// Position of each head in the body frame, m, in the order of the heads.
    pub positions_m: Vec<[f64; 3]>,
    /// Fastest mode with the heads in line.
    pub mode: &'static str,
    /// Largest speed at which sections get the verdict pass with the heads in line, m/s.
    pub v_max_mps: f64,
    /// Largest speed with the present mounts in their fastest mode, m/s; `None` if no mode meets the target.
    pub present_mps: Option<f64>,
}

impl Planner {
    /// Returns the mounts of heads in line along the hull, with the best mode and speed.
    ///
    /// `None` if the heads already are in line, or if no mode meets the target with heads in line.
    ///
    /// Errors: as for [`Planner::new`].
    pub fn in_line(&self, target_m: f64) -> Result<Option<InLine>, SamplingError> {
        let Some(inspection) = in_line(&self.inspection) else { return Ok(None) };
        let position = |mount: Vec3<_>| [mount.x(), mount.y(), mount.z()];
        let positions_m = inspection.heads.iter().map(|(spec, _)| position(spec.mount.position)).collect();
        let there = Self::new(inspection)?.with_errors(self.errors.clone());
        Ok(there.fastest(target_m).map(|(mode, v_max_mps)| InLine {
            positions_m,
            mode,
            v_max_mps,
            present_mps: self.fastest(target_m).map(|(_, mps)| mps),
        }))
    }

    /// Returns the fastest mode for a target, and the largest speed in this mode, m/s.
    fn fastest(&self, target_m: f64) -> Option<(&'static str, f64)> {
        let speeds = self.modes.iter().enumerate().filter_map(|(number, planned)| {
            Some((planned.mode.name, self.v_max_mps(number, target_m).ok()?))
        });
        speeds.max_by(|a, b| a.1.total_cmp(&b.1))
    }
}

/// Returns the inspection with the heads in line; `None` if the heads already are in line.
///
/// The order of the heads along the hull is unchanged.
fn in_line(inspection: &Inspection) -> Option<Inspection> {
    let mut moved = inspection.clone();
    let count = moved.heads.len() as f64;
    let middle = |of: fn(&Vec3<_>) -> f64| {
        inspection.heads.iter().map(|(spec, _)| of(&spec.mount.position)).sum::<f64>() / count
    };
    let [x_m, y_m, z_m] = [middle(Vec3::x), middle(Vec3::y), middle(Vec3::z)];
    let mut order: Vec<usize> = (0..moved.heads.len()).collect();
    let place_x =
        |number: usize| inspection.heads.get(number).map_or(0.0, |(spec, _)| spec.mount.position.x());
    order.sort_by(|a, b| place_x(*a).total_cmp(&place_x(*b)));
    let mut last: Option<(f64, f64)> = None;
    for number in &order {
        let Some((spec, _)) = moved.heads.get_mut(*number) else {
            debug_assert!(false, "head {number} is one of {}", inspection.heads.len());
            continue;
        };
        let long_m = spec.body.ahead_m + spec.body.behind_m;
        let own_m = place_x(*number);
        let at_m = last.map_or(own_m, |(before_m, before_long_m)| {
            own_m.max(before_m + before_long_m.max(long_m) + GAP_M)
        });
        spec.mount.position = Vec3::new(at_m, y_m, z_m);
        last = Some((at_m, long_m));
    }
    // The line is centred on the mean position of the present mounts, so that it extends equally ahead and astern of
    // it.
    let shift_m = x_m - moved.heads.iter().map(|(spec, _)| spec.mount.position.x()).sum::<f64>() / count;
    let mut farthest_m: f64 = 0.0;
    for ((spec, _), (before, _)) in moved.heads.iter_mut().zip(&inspection.heads) {
        spec.mount.position = spec.mount.position + Vec3::new(shift_m, 0.0, 0.0);
        farthest_m = farthest_m.max((spec.mount.position + -before.mount.position).norm());
    }
    (farthest_m > SAME_M).then_some(moved)
}
