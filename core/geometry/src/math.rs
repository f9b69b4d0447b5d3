//! The only access to transcendental functions: the `libm` crate.
//!
//! The results of `libm` are the same on every platform.
//!
//! The standard library calls the platform's C library instead, whose results differ by an ulp between machines. Two
//! replays could then diverge. A lint (clippy.toml) bans the standard library's functions.

pub use core::f64::consts::{FRAC_PI_2, PI, TAU};

/// Sine of an angle in radians.
pub fn sin(angle_rad: f64) -> f64 {
    libm::sin(angle_rad)
}

/// Cosine of an angle in radians.
pub fn cos(angle_rad: f64) -> f64 {
    libm::cos(angle_rad)
}

/// Sine and cosine of an angle in radians.
pub fn sin_cos(angle_rad: f64) -> (f64, f64) {
    libm::sincos(angle_rad)
}

/// Tangent of an angle in radians.
pub fn tan(angle_rad: f64) -> f64 {
    libm::tan(angle_rad)
}

/// Arc sine in radians, the argument clamped to [-1, 1].
pub fn asin(x: f64) -> f64 {
    libm::asin(x.clamp(-1.0, 1.0))
}

/// Arc cosine in radians, the argument clamped to [-1, 1].
pub fn acos(x: f64) -> f64 {
    libm::acos(x.clamp(-1.0, 1.0))
}

/// Angle of the vector (x, y) in radians, in [-pi, pi].
pub fn atan2(y: f64, x: f64) -> f64 {
    libm::atan2(y, x)
}

/// Square root by the platform's instruction, which rounds correctly on every platform (IEEE 754).
pub fn sqrt(x: f64) -> f64 {
    x.sqrt()
}

/// Length of the vector (x, y) without overflow.
pub fn hypot(x: f64, y: f64) -> f64 {
    libm::hypot(x, y)
}

/// Natural logarithm.
pub fn ln(x: f64) -> f64 {
    libm::log(x)
}

/// e to the power of x.
pub fn exp(x: f64) -> f64 {
    libm::exp(x)
}

/// Complementary error function.
pub fn erfc(x: f64) -> f64 {
    libm::erfc(x)
}

/// Wraps `value` to [0, `modulus`). `modulus` must be positive and finite.
pub fn wrap(value: f64, modulus: f64) -> f64 {
    // Nearly all values are less than one modulus outside [0, `modulus`). For them, the branches are faster, and give
    // the same bits as the formula with the quotient.
    if (0.0..modulus).contains(&value) {
        // The addition turns -0.0 into 0.0.
        return value + 0.0;
    }
    if value < 0.0 && value > -modulus {
        let r = value + modulus;
        return if r >= modulus { 0.0 } else { r };
    }
    debug_assert!(modulus > 0.0 && modulus.is_finite(), "a modulus is positive and finite: {modulus}");
    let r = value - modulus * libm::floor(value / modulus);
    // Rounding can make the remainder r equal to the modulus, or slightly negative.
    if r >= modulus || r < 0.0 { 0.0 } else { r }
}

/// Wraps `difference` to [-`modulus`/2, `modulus`/2), the shorter way round. `modulus` must be positive and finite.
pub fn wrap_signed(difference: f64, modulus: f64) -> f64 {
    // As in `wrap`, the branches are faster and give the same bits as the formula with the quotient. Near an odd
    // multiple of half the modulus, rounding could change the result by a modulus, so the formula is used there.
    let size = difference.abs();
    if size < 0.499 * modulus {
        return difference;
    }
    if size > 0.501 * modulus && size < 1.499 * modulus {
        return if difference > 0.0 { difference - modulus } else { difference + modulus };
    }
    debug_assert!(modulus > 0.0 && modulus.is_finite(), "a modulus is positive and finite: {modulus}");
    let r = difference - modulus * libm::floor(difference / modulus + 0.5);
    if r >= modulus / 2.0 { r - modulus } else { r }
}

/// The largest integer not above `x`; saturates, and NaN gives zero.
#[expect(clippy::cast_possible_truncation, reason = "float to integer casts saturate, as intended")]
pub fn floor_to_i64(x: f64) -> i64 {
    // This is inline code instead of a library call, because the search for a sample's cell and section needs several
    // roundings.
    let towards_zero = x as i64;
    if towards_zero as f64 > x { towards_zero.saturating_sub(1) } else { towards_zero }
}

/// The nearest integer to `x` (halves to even); saturates, and NaN gives zero.
#[expect(clippy::cast_possible_truncation, reason = "float to integer casts saturate, as intended")]
pub fn round_to_i64(x: f64) -> i64 {
    /// 2^52. A double of this size has no fractional part.
    ///
    /// So adding this constant to a value rounds the value to an integer, halves to even.
    const WHOLE: f64 = 4_503_599_627_370_496.0;
    let size = x.abs();
    if size < WHOLE { ((size + WHOLE) - WHOLE).copysign(x) as i64 } else { x as i64 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wrap_shortcuts_are_bit_identical_to_the_full_formula() {
        let by_quotient = |value: f64, modulus: f64| {
            let r = value - modulus * libm::floor(value / modulus);
            if r >= modulus || r < 0.0 { 0.0 } else { r }
        };
        let signed_by_quotient = |value: f64, modulus: f64| {
            let r = value - modulus * libm::floor(value / modulus + 0.5);
            if r >= modulus / 2.0 { r - modulus } else { r }
        };
        let mut state = 1_u64;
        let mut next = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1_u64 << 53) as f64
        };
        for modulus in [TAU, 35.9, 1.0, 0.3, 34.17, 1e-3] {
            let edges = [0.0, 0.25, 0.499, 0.5, 0.501, 1.0, 1.499, 1.5, 2.0, 1e-20, 1e-310, 1e9];
            let near = edges.into_iter().flat_map(|edge| {
                let x = edge * modulus;
                [x, x.next_up(), x.next_down(), f64::midpoint(x, x.next_up().next_up())]
            });
            let anywhere = core::iter::repeat_with(|| 4.0 * modulus * next()).take(100_000);
            for x in near.chain(anywhere).flat_map(|x| [x, -x]) {
                assert_eq!(wrap(x, modulus).to_bits(), by_quotient(x, modulus).to_bits(), "{x} {modulus}");
                let signed = signed_by_quotient(x, modulus);
                assert_eq!(wrap_signed(x, modulus).to_bits(), signed.to_bits(), "{x} {modulus}");
            }
        }
    }

    #[test]
    #[expect(clippy::cast_possible_truncation, reason = "as in the functions under test")]
    fn rounding_equals_that_of_libm() {
        let whole = [0.0, 0.5, 1.0, 1.5, 2.5, 4.4e15, 4.6e15, 9.1e15, 9.2e18, 9.3e18, 1e300];
        let about = whole.into_iter().flat_map(|x: f64| [x, x.next_up(), x.next_down()]);
        let special = [f64::NAN, f64::INFINITY, 1e-310];
        for x in about.chain(special).flat_map(|x| [x, -x]) {
            assert_eq!(floor_to_i64(x), libm::floor(x) as i64, "{x}");
            assert_eq!(round_to_i64(x), libm::rint(x) as i64, "{x}");
        }
    }

    #[test]
    fn wrapped_value_is_below_the_modulus() {
        for x in [-1e-17, 0.0, 35.9, 35.899_999_999, -36.0, 1e9, -1e-300] {
            let r = wrap(x, 35.9);
            assert!((0.0..35.9).contains(&r), "{x} gave {r}");
            let s = wrap_signed(x, 35.9);
            assert!((-17.95..17.95).contains(&s), "{x} gave {s}");
        }
    }
}
