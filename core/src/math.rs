//! The only door to transcendental functions: the `libm` crate, whose results are the same on every platform.
//!
//! The standard library's versions call the platform's C library and differ by an ulp between machines, which is
//! enough to part two replays. A lint (clippy.toml) keeps the others out.

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

/// Square root; IEEE 754 rounds it exactly, so that the platform's instruction will do.
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

/// `value` brought into [0, `modulus`). `modulus` must be positive and finite.
pub fn wrap(value: f64, modulus: f64) -> f64 {
    let r = value - modulus * libm::floor(value / modulus);
    // Rounding can leave r at the modulus itself, or a hair below zero.
    if r >= modulus || r < 0.0 { 0.0 } else { r }
}

/// `difference` brought into [-`modulus`/2, `modulus`/2): the short way round.
pub fn wrap_signed(difference: f64, modulus: f64) -> f64 {
    let r = difference - modulus * libm::floor(difference / modulus + 0.5);
    if r >= modulus / 2.0 { r - modulus } else { r }
}

/// The largest integer not above `x`; saturates, and NaN gives zero.
#[expect(
    clippy::cast_possible_truncation,
    reason = "float to integer casts saturate, which is what is wanted"
)]
pub fn floor_to_i64(x: f64) -> i64 {
    libm::floor(x) as i64
}

/// The nearest integer to `x` (halves to even); saturates, and NaN gives zero.
#[expect(
    clippy::cast_possible_truncation,
    reason = "float to integer casts saturate, which is what is wanted"
)]
pub fn round_to_i64(x: f64) -> i64 {
    libm::rint(x) as i64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wrap_stays_below_its_modulus() {
        for x in [-1e-17, 0.0, 35.9, 35.899_999_999, -36.0, 1e9, -1e-300] {
            let r = wrap(x, 35.9);
            assert!((0.0..35.9).contains(&r), "{x} gave {r}");
            let s = wrap_signed(x, 35.9);
            assert!((-17.95..17.95).contains(&s), "{x} gave {s}");
        }
    }
}
