//! Hollows that open from the tunnel: rock traps, side tunnels, and the slots of gates.

use headrace_config::{ConfigError, Section};
use headrace_geometry::math;

use super::keys;
use super::placing::{Ground, Placed};
use super::shapes::{Hollow, Ring, Solid};
use super::widths::flat_floor_m;

/// Ratio of the thickness of a bulkhead to the width of its slot.
const BULKHEAD_SHARE: f64 = 0.6;
/// Largest angle between a side tunnel and the perpendicular to the tunnel.
const SLANT_DEG: f64 = 60.0;
/// The height of the floor is measured at this distance inside the upper edges of a rock trap, m.
const INSIDE_M: f64 = 1e-6;
/// Step along a hollow at which the hollow's length is sampled, m.
const STEP_M: f64 = 0.5;

/// Reads a rock trap from the scene: a ditch across the floor, modelled as an upright box.
///
/// Errors: a key is missing or out of range, or the rock trap is wider than the tunnel.
pub(super) fn rock_trap(
    table: &Section<'_>,
    ground: Ground<'_>,
    feature: u16,
) -> Result<Placed<Hollow>, ConfigError> {
    let (chainage_m, length_m) = keys::extent_m(table, "length_m", ground.length_m)?;
    let depth_m = keys::length_m(table, "depth_m", 0.01..=50.0)?;
    let profile = ground.tube.profile();
    let scale = ground.tube.scale(chainage_m);
    let width_m = match table.number("width_m", 0.01..=200.0)? {
        Some(width_m) => width_m,
        None => flat_floor_m(profile).map(|width_m| width_m * scale).ok_or_else(|| {
            table.invalid("width_m", "is missing, and the profile has no flat floor to take it from")
        })?,
    };
    let floor_m = ground.tube.scaled(chainage_m, profile.point_at(0.0))[1];
    let half_width_m = width_m / 2.0;
    let top_m = edge_m(ground, chainage_m, half_width_m).ok_or_else(|| {
        table.invalid("width_m", "is more than the tunnel's width at the height of its reference point")
    })?;
    let bottom_m = floor_m - depth_m;
    let frame = ground.frame(chainage_m, [0.0, f64::midpoint(top_m, bottom_m)]);
    let half = [length_m / 2.0, half_width_m, (top_m - bottom_m) / 2.0];
    let span_m = ground.span_m(chainage_m, length_m / 2.0);
    Ok(Placed { shape: Hollow::Block(frame, half), feature, span_m })
}

/// Height of the floor at the edges of a rock trap, m. The result is the height at the higher of the two edges.
fn edge_m(ground: Ground<'_>, chainage_m: f64, half_width_m: f64) -> Option<f64> {
    let [_, from_m] = ground.tube.scaled(chainage_m, ground.tube.profile().reference());
    let height_m = |y: f64| {
        let range_m = ground.tube.section_range_m(chainage_m, [y, from_m], [0.0, -1.0])?;
        Some(from_m - range_m)
    };
    let inside_m = half_width_m - INSIDE_M;
    Some(height_m(inside_m)?.max(height_m(-inside_m)?))
}

/// Reads a side tunnel: a box that starts in the middle of the tunnel and ends in the rock.
///
/// Errors: a key is missing or out of range, or the mouth is higher than the tunnel.
pub(super) fn side_tunnel(
    table: &Section<'_>,
    ground: Ground<'_>,
    feature: u16,
) -> Result<Placed<Hollow>, ConfigError> {
    let chainage_m = keys::chainage_m(table, ground.length_m)?;
    let side = table.required("side", table.choice("side", &[("left", 1.0), ("right", -1.0)])?)?;
    let width_m = keys::length_m(table, "width_m", 0.05..=100.0)?;
    let height_m = keys::length_m(table, "height_m", 0.05..=100.0)?;
    let sill_m = table.number("sill_m", 0.0..=100.0)?.unwrap_or(0.0);
    let length_m = keys::length_m(table, "length_m", 0.05..=1000.0)?;
    let slant_rad = table.number("angle_deg", -SLANT_DEG..=SLANT_DEG)?.unwrap_or(0.0).to_radians();
    let profile = ground.tube.profile();
    let [_, floor_m] = ground.tube.scaled(chainage_m, profile.point_at(0.0));
    let [middle_m, reference_m] = ground.tube.scaled(chainage_m, profile.reference());
    let up_m = ground.tube.section_range_m(chainage_m, [middle_m, reference_m], [0.0, 1.0]).unwrap_or(0.0);
    if floor_m + sill_m + height_m > reference_m + up_m {
        let problem =
            format!("reaches above the crown, {:.3} m above the floor", reference_m + up_m - floor_m);
        return Err(table.invalid("height_m", &problem));
    }
    let centre_m = floor_m + sill_m + height_m / 2.0;
    let to_wall_m = ground.tube.section_range_m(chainage_m, [middle_m, centre_m], [side, 0.0]).unwrap_or(0.0);
    let (sin, cos) = math::sin_cos(slant_rad);
    let whole_m = to_wall_m / cos + length_m;
    // A positive slant points towards growing chainage, on either side of the tunnel. The middle of the opening stays
    // at the given chainage.
    let mut frame = ground.frame(chainage_m, [middle_m, centre_m]);
    let start = frame.outwards([-to_wall_m * sin / cos, 0.0, 0.0]);
    let inwards = frame.outwards([sin, side * cos, 0.0]);
    let across = frame.outwards([cos, -side * sin, 0.0]);
    for k in 0..3 {
        frame.origin[k] += start[k] + inwards[k] * whole_m / 2.0;
    }
    frame.axes[0] = across;
    frame.axes[1] = inwards;
    let half = [width_m / 2.0, whole_m / 2.0, height_m / 2.0];
    let span_m = mouth_span_m(ground, chainage_m, frame.origin, inwards, half);
    Ok(Placed { shape: Hollow::Block(frame, half), feature, span_m })
}

/// Range of chainage over which a side tunnel opens into the tunnel, m. The result is also valid next to a bend.
fn mouth_span_m(
    ground: Ground<'_>,
    chainage_m: f64,
    centre: [f64; 3],
    inwards: [f64; 3],
    half: [f64; 3],
) -> (f64, f64) {
    let around_m = math::hypot(half[0], STEP_M);
    let reach_m = ground.tube.reach_m() + around_m;
    let mut span_m = (chainage_m, chainage_m);
    let steps = math::floor_to_i64(2.0 * half[1] / STEP_M) + 1;
    for step in 0..=steps {
        let along_m = (step as f64 * STEP_M).min(2.0 * half[1]) - half[1];
        let plan = [centre[0] + along_m * inwards[0], centre[1] + along_m * inwards[1]];
        let (_, here_m, left_m) = ground.tube.axis().locate(plan);
        if left_m.abs() <= reach_m {
            let (from_m, to_m) = ground.span_m(here_m, around_m);
            span_m = (span_m.0.min(from_m), span_m.1.max(to_m));
        }
    }
    span_m
}

/// Reads a gate: a slot around the whole section, and a bulkhead if the gate is closed.
///
/// Errors: a key is missing or out of range.
pub(super) fn gate(
    table: &Section<'_>,
    ground: Ground<'_>,
    feature: u16,
) -> Result<(Placed<Hollow>, Option<Placed<Solid>>), ConfigError> {
    let (chainage_m, width_m) = keys::extent_m(table, "slot_width_m", ground.length_m)?;
    let depth_m = keys::length_m(table, "slot_depth_m", 0.01..=10.0)?;
    let closed = table.boolean("closed")?.unwrap_or(false);
    let profile = ground.tube.profile();
    let reference = ground.tube.scaled(chainage_m, profile.reference());
    let scale = ground.tube.scale(chainage_m);
    // The depth of the slot is measured at the sides, at the height of the reference point.
    let to_side_m = ground.tube.section_range_m(chainage_m, reference, [1.0, 0.0]).unwrap_or(depth_m);
    let enlarged = scale * (1.0 + depth_m / to_side_m);
    let ring = Ring {
        frame: ground.frame(chainage_m, [0.0, 0.0]),
        half_width_m: width_m / 2.0,
        profile: profile.clone(),
        reference,
        scale: enlarged,
    };
    let span_m = ground.span_m(chainage_m, width_m / 2.0);
    // The bulkhead must be at least as large as the slot. It may reach into the rock, because no ray gets there.
    let reach_m = enlarged * profile.farthest_m(profile.reference());
    let bulkhead = closed.then(|| Placed {
        shape: Solid::Block(
            ground.frame(chainage_m, reference),
            [BULKHEAD_SHARE * width_m / 2.0, reach_m, reach_m],
        ),
        feature,
        span_m,
    });
    Ok((Placed { shape: Hollow::Ring(ring), feature, span_m }, bulkhead))
}
