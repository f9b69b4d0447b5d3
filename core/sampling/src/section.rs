//! Equations of Jorge et al. 2021 for one cross-section: a rotating head on a vehicle at rest.
//!
//! The paper states the equations for a head midway between floor and crown of a tunnel of height b. The equations hold
//! for any flat or circular wall. The functions here take the distance h from the head to the wall, which is b / 2 in
//! the paper. Angles are measured from the perpendicular to the flat wall.

use super::error::{SamplingError, not_negative, positive};
use headrace_geometry::math;

/// T_y1, m: smallest distance between neighbouring samples of a turn on a flat wall, at the foot of the perpendicular.
///
/// `distance_m` > 0 is the distance h to the wall, `step_rad` the step theta, in (0, pi/2).
/// Errors: an argument out of range; a step of 90 degrees or more.
/// Source: Jorge et al. 2021, Eq. 5.
pub fn t_y1_m(distance_m: f64, step_rad: f64) -> Result<f64, SamplingError> {
    t_y2_m(distance_m, step_rad, 1)
}

/// T_y2, m: distance between the samples at (m - 1) theta and m theta on a flat wall, for any m >= 1.
///
/// The distance is the largest where m theta meets the corner. `distance_m` > 0 is the distance h to the wall. The
/// formula h (tan(m theta) - tan((m - 1) theta)) is computed as h sin(theta) / (cos(m theta) cos((m - 1) theta)), which
/// avoids cancellation. Multiples of theta have twice double precision, so that the result is also accurate for a beam
/// that is almost parallel to the wall.
/// Errors: an argument out of range; m theta of 90 degrees or more.
/// Source: Jorge et al. 2021, Eq. 6.
pub fn t_y2_m(distance_m: f64, step_rad: f64, m: u32) -> Result<f64, SamplingError> {
    positive("the distance to the wall in metres", distance_m)?;
    positive("the step in radians", step_rad)?;
    positive("the number of the step", f64::from(m))?;
    let cosine = cos_of_multiple(m, step_rad)?;
    Ok(distance_m * math::sin(step_rad) / (cosine * cos_of_multiple(m - 1, step_rad)?))
}

/// T_c, m: distance between neighbouring samples of a turn on a circular wall around a head at its centre.
///
/// T_c is a straight-line distance, and is the same everywhere on the wall. `radius_m` > 0 is the paper's b / 2;
/// `step_rad` > 0 is the step theta.
/// Errors: an argument out of range.
/// Source: Jorge et al. 2021, Eq. 7 (b sin(theta / 2)).
pub fn t_c_m(radius_m: f64, step_rad: f64) -> Result<f64, SamplingError> {
    positive("the radius in metres", radius_m)?;
    positive("the step in radians", step_rad)?;
    Ok((2.0 * radius_m * math::sin(step_rad / 2.0)).abs())
}

/// Mean distance between neighbouring samples of a turn on a flat wall, m, from the perpendicular to the angle m theta.
///
/// Errors: as for [`t_y2_m`].
/// Source: Jorge et al. 2021, Eq. 8, whose sum telescopes to Eq. 9: h tan(m theta) / m.
pub fn t_y2_mean_m(distance_m: f64, step_rad: f64, m: u32) -> Result<f64, SamplingError> {
    positive("the distance to the wall in metres", distance_m)?;
    positive("the step in radians", step_rad)?;
    positive("the number of the step", f64::from(m))?;
    let (sine, cosine) = (sin_of_multiple(m, step_rad), cos_of_multiple(m, step_rad)?);
    Ok(distance_m * sine / cosine / f64::from(m))
}

/// T_yp, m: upper bound of the mean distance between neighbouring samples of a turn: perimeter / pings per turn.
///
/// The bound holds for any head position.
///
/// Errors: a perimeter or a number of steps that isn't above zero.
/// Source: Jorge et al. 2021, Eq. 10.
pub fn t_yp_m(perimeter_m: f64, steps: u32) -> Result<f64, SamplingError> {
    Ok(positive("the perimeter in metres", perimeter_m)? / positive("the steps of a turn", f64::from(steps))?)
}

/// epsilon: overlap of the beams of neighbouring pings (beam width / angular step).
///
/// Below 1, beams do not overlap. `beam_rad` is the beam's full width zeta, `step_rad` the step theta.
/// Errors: an argument that isn't above zero.
/// Source: Jorge et al. 2021, Eq. 22.
pub fn overlap(beam_rad: f64, step_rad: f64) -> Result<f64, SamplingError> {
    Ok(positive("the beam's width in radians", beam_rad)? / positive("the step in radians", step_rad)?)
}

/// eta, m: range resolution of a head: its span of ranges divided by the number of counts for this span.
///
/// Errors: no counts, a negative least range, or an empty span of ranges.
/// Source: Jorge et al. 2021, §6.
pub fn range_resolution_m(least_m: f64, most_m: f64, counts: u32) -> Result<f64, SamplingError> {
    not_negative("the least range in metres", least_m)?;
    let span = positive("the span of ranges in metres", most_m - least_m)?;
    Ok(span / positive("the number of counts", f64::from(counts))?)
}

/// Width of a beam at perpendicular incidence on a wall at `range_m`, m.
///
/// `beam_rad` is the full width, in (0, pi).
/// Errors: an argument out of range.
/// Source: Jorge et al. 2021, Fig. 15, at 0 degrees.
pub fn beam_width_m(range_m: f64, beam_rad: f64) -> Result<f64, SamplingError> {
    positive("the range in metres", range_m)?;
    positive("the beam's width in radians", beam_rad)?;
    let cosine = cos_of_multiple(1, beam_rad / 2.0)?;
    Ok(2.0 * range_m * math::sin(beam_rad / 2.0) / cosine)
}

/// Length of a beam's footprint on a flat wall, in the head's scan plane, m.
///
/// `distance_m` is the perpendicular distance to the wall, `angle_rad` the beam's angle from the perpendicular (either
/// side), `beam_rad` its full width.
/// Errors: an argument out of range; a beam with an edge that never meets the wall.
/// Source: Jorge et al. 2021, §9.2 and Fig. 15: h (tan(alpha + zeta/2) - tan(alpha - zeta/2)), computed without the
/// subtraction.
pub fn footprint_m(distance_m: f64, angle_rad: f64, beam_rad: f64) -> Result<f64, SamplingError> {
    positive("the distance to the wall in metres", distance_m)?;
    positive("the beam's width in radians", beam_rad)?;
    let angle = not_negative("the angle from the perpendicular in radians", angle_rad.abs())?;
    let (far, near) = (cos_of_sum(angle, beam_rad / 2.0)?, cos_of_sum(angle, -beam_rad / 2.0)?);
    Ok(distance_m * math::sin(beam_rad) / (far * near))
}

/// Returns cos(m x) for m x in [0, pi/2); the product m x is computed in twice double precision.
fn cos_of_multiple(m: u32, x_rad: f64) -> Result<f64, SamplingError> {
    let (high, low) = product(f64::from(m), x_rad);
    above_zero(high, math::cos(high) - math::sin(high) * low)
}

fn sin_of_multiple(m: u32, x_rad: f64) -> f64 {
    let (high, low) = product(f64::from(m), x_rad);
    math::sin(high) + math::cos(high) * low
}

/// Returns cos(a + b) for |a + b| < pi/2.
fn cos_of_sum(a_rad: f64, b_rad: f64) -> Result<f64, SamplingError> {
    let high = a_rad + b_rad;
    // Rounding error of a sum of two doubles (Knuth's two-sum).
    let b_part = high - a_rad;
    let low = (a_rad - (high - b_part)) + (b_rad - b_part);
    above_zero(high, math::cos(high) - math::sin(high) * low)
}

fn above_zero(angle_rad: f64, cosine: f64) -> Result<f64, SamplingError> {
    let meets = angle_rad < math::FRAC_PI_2 + 1e-9 && cosine > 0.0;
    meets.then_some(cosine).ok_or(SamplingError::BeamMissesWall { angle_deg: angle_rad.to_degrees() })
}

/// The product a b as a double, and its rounding error (Dekker's product).
fn product(a: f64, b: f64) -> (f64, f64) {
    const SPLIT: f64 = 134_217_729.0;
    let halves = |x: f64| {
        let high = SPLIT * x - (SPLIT * x - x);
        (high, x - high)
    };
    let ((a_high, a_low), (b_high, b_low)) = (halves(a), halves(b));
    let high = a * b;
    (high, ((a_high * b_high - high) + a_high * b_low + a_low * b_high) + a_low * b_low)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use headrace_geometry::math::{FRAC_PI_2, tan};

    /// The cosine of a sum is accurate near a right angle, although a double cannot represent the sum.
    ///
    /// The reference is the sine of the difference from a right angle, in two exact parts.
    #[test]
    fn cosine_of_a_sum_is_accurate_up_to_a_grazing_beam() {
        const REST: f64 = 6.123_233_995_736_766e-17;
        for k in 35..60 {
            // For an angle above half a right angle, its computed difference from a right angle is exact.
            let a_rad = 0.023 * f64::from(k);
            for left in [1e-3, 1e-6, 1e-9, 1e-12] {
                let b_rad = FRAC_PI_2 - a_rad - left;
                let exact = math::sin((FRAC_PI_2 - a_rad) - b_rad + REST);
                let computed = cos_of_sum(a_rad, b_rad).unwrap();
                assert!((computed / exact - 1.0).abs() < 1e-13, "{a_rad} + {b_rad}: {computed} {exact}");
            }
        }
    }

    #[test]
    fn formulas_equal_hand_computed_values() {
        let step = f64::to_radians(0.9);
        // The hand-computed values use tan 0.9 deg = 0.015709 and h = 4.571 m.
        assert!((t_y1_m(4.571, step).unwrap() - 0.071_807).abs() < 1e-6);
        assert!((t_y2_m(2.0, step, 50).unwrap() - 2.0 * (tan(50.0 * step) - tan(49.0 * step))).abs() < 1e-13);
        assert!((t_c_m(6.05, step).unwrap() - 0.095_032).abs() < 1e-6);
        assert!((t_yp_m(34.17, 400).unwrap() - 0.085_425).abs() < 1e-12);
        assert!((overlap(f64::to_radians(2.4), f64::to_radians(0.3)).unwrap() - 8.0).abs() < 1e-12);
        assert!((range_resolution_m(0.0, 10.0, 1000).unwrap() - 0.01).abs() < 1e-15);
        // Jorge et al. 2021, Fig. 15, shows about 25 cm at 10 m.
        assert!((beam_width_m(10.0, f64::to_radians(1.4)).unwrap() - 0.244_358).abs() < 1e-6);
    }

    #[test]
    fn beam_along_the_wall_is_an_error() {
        let step = f64::to_radians(0.9);
        assert!(t_y2_m(3.0, step, 99).is_ok());
        for m in [101, 150, 399] {
            let why = t_y2_m(3.0, step, m).unwrap_err();
            assert!(matches!(why, SamplingError::BeamMissesWall { .. }), "{why}");
        }
        assert!(matches!(t_y1_m(3.0, FRAC_PI_2 * 1.01), Err(SamplingError::BeamMissesWall { .. })));
        assert!(matches!(
            footprint_m(3.0, f64::to_radians(89.9), 0.02),
            Err(SamplingError::BeamMissesWall { .. })
        ));
        assert!(matches!(beam_width_m(3.0, 3.2), Err(SamplingError::BeamMissesWall { .. })));
    }

    #[test]
    fn arguments_out_of_range_are_errors() {
        for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert!(t_y1_m(bad, 0.01).is_err() && t_y1_m(3.0, bad).is_err(), "{bad}");
            assert!(t_c_m(bad, 0.01).is_err() && t_yp_m(bad, 400).is_err(), "{bad}");
            assert!(overlap(bad, 0.01).is_err() && footprint_m(bad, 0.1, 0.01).is_err(), "{bad}");
        }
        assert!(t_y2_m(3.0, 0.01, 0).is_err() && t_yp_m(30.0, 0).is_err());
        assert!(range_resolution_m(2.0, 2.0, 500).is_err() && range_resolution_m(0.0, 2.0, 0).is_err());
    }

    proptest! {
        /// Theorem 1 of Jorge et al. 2021: on a flat wall, the samples are farther apart the farther they are from the
        /// foot of the perpendicular.
        #[test]
        fn distances_between_samples_on_a_flat_wall_grow_away_from_its_nearest_point(h in 0.01..100.0f64, step in 1e-4..0.3f64, share in 0.0..1.0f64) {
            let last = headrace_geometry::math::floor_to_i64(FRAC_PI_2 / step) - 1;
            prop_assume!(last >= 2);
            let m = 1 + headrace_geometry::math::floor_to_i64(share * (last - 1) as f64);
            let (m, h) = (u32::try_from(m).unwrap(), h);
            prop_assert!(t_y2_m(h, step, m).unwrap() < t_y2_m(h, step, m + 1).unwrap());
        }

        /// T_c < T_y1, so a circular crown is sampled more densely than a floor at the same distance.
        #[test]
        fn crown_is_sampled_more_densely_than_the_floor(h in 0.01..100.0f64, step in 1e-3..1.5f64) {
            prop_assert!(t_c_m(h, step).unwrap() < t_y1_m(h, step).unwrap());
        }

        /// The mean distance by Eq. 8 equals the mean of all distances between neighbouring samples.
        #[test]
        fn mean_sample_distance_equals_the_mean_of_the_single_distances(h in 0.01..100.0f64, step in 1e-3..0.3f64) {
            let m = u32::try_from(headrace_geometry::math::floor_to_i64(FRAC_PI_2 / step) - 1).unwrap_or(0);
            prop_assume!(m >= 1);
            let sum: f64 = (1..=m).map(|k| t_y2_m(h, step, k).unwrap()).sum();
            let mean = t_y2_mean_m(h, step, m).unwrap();
            prop_assert!((sum / f64::from(m) / mean - 1.0).abs() < 1e-11);
        }
    }
}
