//! Roughness of the wall, learnt from echosounders that face opposite walls.
//!
//! The sum of two opposite ranges does not depend on the vehicle's position between the walls. So if the sum varies
//! by more than its noise, the walls are rough. An echosounder sees the same bump for seconds. Derivation:
//! `docs/why/navigation.md`, "Noise that is learnt".

use serde::{Deserialize, Serialize};

use super::settings::Settings;
use headrace_geometry::frames::{Tunnel, Vec3};
use headrace_geometry::time::{DurNs, MonoNs};

/// Maximum number of bumps in the running mean (`MEMORY`), and weight of the declared roughness, in bumps (`DECLARED`).
const MEMORY: f64 = 30.0;
const DECLARED: f64 = 1.0;
/// Multiple of its variance at which the square of a sum of two residuals is clipped. One outlier is no bump.
const MOST: f64 = 9.0;
/// Maximum variance of the bumps, as a factor of the declared variance. With the default settings, the bumps then have
/// an sd of 6 cm.
const ROUGHEST: f64 = 4.0;
/// Smallest assumed speed along the wall, m/s. Even a nearly stationary vehicle drifts sideways at about this speed.
const STILL_MPS: f64 = 0.05;
/// Number of echosounders whose last pings are kept.
const ECHOSOUNDERS: usize = 8;
/// Two echosounders face opposite walls if the cosine of the angle between their range gradients is below this. The
/// gradient is the change of a range with the vehicle's position.
const FACING: f64 = -0.95;
/// Maximum time between two opposite pings whose ranges are added, s.
const AT_ONCE_S: f64 = 0.25;

/// An echosounder's ping that has been fused.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(super) struct Look {
    /// Source number of the echosounder.
    pub(super) source: usize,
    /// Time of the ping.
    pub(super) at: MonoNs,
    /// Change of the expected range per metre of the vehicle's position.
    pub(super) by_place: Vec3<Tunnel>,
    /// Residual of the range after the correction by the ping, m.
    pub(super) left_m: f64,
    /// Variance of the white noise of the range, m^2.
    pub(super) white_m2: f64,
}

/// Variance of the bumps that echosounders see, as a factor of the declared variance.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(super) struct Roughness {
    factor: f64,
    /// Number of bumps averaged in `factor`, at most `MEMORY`.
    seen: f64,
    looks: [Option<Look>; ECHOSOUNDERS],
}

impl Default for Roughness {
    /// Creates the record with the declared roughness of the wall.
    fn default() -> Self {
        Self { factor: 1.0, seen: DECLARED, looks: [None; ECHOSOUNDERS] }
    }
}

impl Roughness {
    /// Processes a ping that has corrected the estimate.
    ///
    /// `bump` is one divided by the number of pings that see the same bump. `scale_m2` is the variance that the unknown
    /// scale of ranges causes in a sum of two ranges.
    pub(super) fn note(&mut self, look: Look, bump: f64, scale_m2: f64, settings: &Settings) {
        let faces = |other: &&Look| {
            other.by_place.dot(&look.by_place) < FACING
                && look.at.since(other.at).as_secs_f64().abs() < AT_ONCE_S
        };
        let declared_m2 = settings.echo_sd_m * settings.echo_sd_m;
        if let Some(other) = self.looks.iter().flatten().find(faces).filter(|_| scale_m2 < declared_m2) {
            let noise_m2 = look.white_m2 + other.white_m2 + scale_m2;
            let sum_m = look.left_m + other.left_m;
            let most_m2 = MOST * (noise_m2 + 2.0 * self.variance_m2(settings).max(declared_m2));
            // The sum contains the bumps of both echosounders, so its variance is twice that of one echosounder's
            // bumps.
            let found_m2 = ((sum_m * sum_m).min(most_m2) - noise_m2) / 2.0;
            let share = bump / 2.0;
            self.seen = (self.seen + share).min(MEMORY);
            self.factor += (found_m2 / declared_m2 - self.factor) * share / self.seen;
        }
        let same = self.looks.iter().position(|old| old.is_some_and(|old| old.source == look.source));
        let slot = same.or_else(|| self.looks.iter().position(Option::is_none)).unwrap_or(0);
        if let Some(slot) = self.looks.get_mut(slot) {
            *slot = Some(look);
        }
    }

    /// Returns the variance of the wall's bumps, m^2.
    pub(super) fn variance_m2(&self, settings: &Settings) -> f64 {
        self.factor.clamp(0.0, ROUGHEST) * settings.echo_sd_m * settings.echo_sd_m
    }

    /// Returns how many pings of this echosounder see the same bump at this speed, at least 1.
    ///
    /// Together, these pings tell no more about the position than a single ping. Returns 1 for an echosounder's first
    /// ping.
    pub(super) fn looks_at_a_bump(&self, source: usize, at: MonoNs, speed_mps: f64, bump_m: f64) -> f64 {
        let before = self.looks.iter().flatten().find(|look| look.source == source);
        before.map_or(1.0, |before| looks(at.since(before.at), speed_mps, bump_m))
    }
}

/// Returns how many pings of an echosounder see the same bump at this speed; `apart` is the time between two pings.
fn looks(apart: DurNs, speed_mps: f64, bump_m: f64) -> f64 {
    let way_m = apart.as_secs_f64().abs() * speed_mps.abs().max(STILL_MPS);
    if way_m > 0.0 { (bump_m / way_m).max(1.0) } else { 1.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use headrace_geometry::math;

    /// Height of the wall's bumps at a chainage, m; bumps are a third of a metre long, and their sd is `sd_m`.
    fn height_m(side: f64, along_m: f64, sd_m: f64) -> f64 {
        sd_m * (math::sin((19.0 + 2.0 * side) * along_m) + math::sin((31.7 + 4.0 * side) * along_m))
    }

    /// Returns the roughness that two opposite echosounders find while the vehicle moves at 0.1 m/s, m.
    ///
    /// The vehicle sways between the walls.
    fn found_m(rough_m: f64, white_m: f64, scale_m2: f64, end_s: f64) -> f64 {
        let settings = Settings::default();
        let mut roughness = Roughness::default();
        let count = math::round_to_i64(end_s * 15.0);
        for k in 0..count {
            let at_s = k as f64 / 15.0;
            let aside_m = 0.3 * math::sin(0.2 * at_s);
            for (source, side) in [(3, 1.0), (5, -1.0)] {
                let at = MonoNs(1_000_000_000) + DurNs::from_secs_f64(at_s + 0.02 * side);
                let white = white_m * math::sqrt(2.0) * math::sin((2.0 + 0.3 * side) * (k * k) as f64);
                let left_m = side * aside_m + height_m(side, 0.1 * at_s, rough_m) + white;
                let looks = roughness.looks_at_a_bump(source, at, 0.1, 0.3);
                let by_place = Vec3::new(0.0, side, 0.0);
                let look = Look { source, at, by_place, left_m, white_m2: white_m * white_m };
                roughness.note(look, 1.0 / looks, scale_m2, &settings);
            }
        }
        math::sqrt(roughness.variance_m2(&settings))
    }

    /// The roughness is found although the vehicle sways. A smooth wall is recognised even if it is declared as
    /// rough.
    #[test]
    fn wall_roughness_equals_the_excess_variation_of_opposite_range_sums() {
        for rough_m in [0.0, 0.01, 0.03, 0.05] {
            for white_m in [0.0, 0.02] {
                let found_m = found_m(rough_m, white_m, 0.0, 400.0);
                assert!((found_m - rough_m).abs() < 0.006, "{found_m} of {rough_m}, noise {white_m}");
            }
        }
    }

    /// Nothing is learnt while the scale of ranges is unknown. Nothing is learnt either from a single echosounder, or
    /// from two that face the same way.
    ///
    /// The learnt roughness is at most twice the declared one.
    #[test]
    fn wall_roughness_is_as_declared_until_observed() {
        let settings = Settings::default();
        assert!((found_m(0.05, 0.0, 0.1, 100.0) - settings.echo_sd_m).abs() < 1e-12);
        assert!((found_m(1.0, 0.0, 0.0, 400.0) - 2.0 * settings.echo_sd_m).abs() < 1e-12);
        let mut roughness = Roughness::default();
        for source in [0, 1, 0, 1, 0, 1] {
            let by_place = Vec3::new(0.0, 1.0, 0.0);
            let look = Look { source, at: MonoNs::default(), by_place, left_m: 1.0, white_m2: 0.0 };
            roughness.note(look, 1.0, 0.0, &settings);
        }
        assert!((roughness.variance_m2(&settings) - settings.echo_sd_m * settings.echo_sd_m).abs() < 1e-12);
    }

    #[test]
    fn pings_per_bump_follow_from_speed_and_bump_length() {
        let looks = |apart_s: f64, speed_mps: f64| looks(DurNs::from_secs_f64(apart_s), speed_mps, 0.1);
        assert!((looks(0.1, 0.2) - 5.0).abs() < 1e-9);
        assert!((looks(0.1, -0.2) - 5.0).abs() < 1e-9 && (looks(-0.1, 0.2) - 5.0).abs() < 1e-9);
        // A nearly stationary vehicle still sways. Each ping counts as one look if the pings are farther apart than a
        // bump or simultaneous.
        assert!((looks(0.1, 0.0) - 20.0).abs() < 1e-9);
        assert_eq!((looks(1.0, 0.2), looks(0.0, 0.2)), (1.0, 1.0));
    }
}
