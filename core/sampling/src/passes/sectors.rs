//! Heads in sectors: timing of neighbouring heads at the end that their sectors share.

use serde::{Deserialize, Serialize};

use crate::head::{HeadMotion, MAX_HEADS, faces_aft};
use crate::occlusion::AngleRange;
use headrace_geometry::math::{self, TAU};

/// Unevenness of neighbouring heads that reach the end of their sectors together. Also assumed for unknown sweeps.
pub(super) const AT_ONCE: f64 = 0.5;

/// Position of a head in its sweep through its sector, there and back.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(super) struct Leg {
    /// Number of the head's sector, counted in the body's sense of rotation; `of` is the number of all sectors.
    sector: i64,
    of: i64,
    /// Completed share of the sweep there and back, counted from the beginning of the sector, 0 to 1.
    share: f64,
}

impl Leg {
    /// Creates the position of a head that turns within `sector`; `None` for a sector without a size.
    ///
    /// The angles of `sector` are in the head's sensor frame.
    pub(super) fn of(motion: &HeadMotion, sector: &AngleRange) -> Option<Self> {
        let size_rad = Some(sector.size_rad).filter(|size_rad| *size_rad > 0.0)?;
        let along = math::wrap_signed(motion.angle_rad - sector.middle_rad(), TAU) / size_rad + 0.5;
        let along = along.clamp(0.0, 1.0);
        let grows = motion.rate_radps > 0.0;
        // Seen in the body frame, a head that faces aft turns in the opposite sense.
        let (along, grows, from_rad) = if faces_aft(motion.mount.rotation) {
            (1.0 - along, !grows, TAU - sector.from_rad - size_rad)
        } else {
            (along, grows, sector.from_rad)
        };
        let of = math::round_to_i64(TAU / size_rad).max(1);
        Some(Self {
            sector: math::round_to_i64(from_rad / size_rad).rem_euclid(of),
            of,
            share: if grows { along / 2.0 } else { 1.0 - along / 2.0 },
        })
    }
}

/// Largest unevenness of passes by two neighbouring heads at the end that their sectors share.
///
/// The unevenness is a share of the vehicle's advance in a sweep there and back. It is 0 if one head reaches the shared
/// end half a sweep after the other head. It is [`AT_ONCE`] if both heads reach the shared end at the same chainage, or
/// if the timing is unknown. `ahead` is the position of each head along the hull, as a share of the vehicle's advance
/// in a sweep there and back.
pub(super) fn uneven(legs: &[Option<Leg>; MAX_HEADS], ahead: &[f64; MAX_HEADS]) -> f64 {
    let known = || legs.iter().zip(ahead).filter_map(|(leg, ahead)| Some(((*leg)?, *ahead)));
    let mut most: Option<f64> = None;
    for (leg, ahead) in known() {
        let next = (leg.sector + 1).rem_euclid(leg.of);
        for (beside, beside_ahead) in known().filter(|(beside, _)| beside.sector == next) {
            let (at_end, at_begin) = (ahead + 0.5 - leg.share, beside_ahead - beside.share);
            let off = AT_ONCE - math::wrap_signed(at_end - at_begin, 1.0).abs();
            most = Some(most.map_or(off, |most| most.max(off)));
        }
    }
    most.unwrap_or(AT_ONCE)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures;
    use crate::head::{HeadProgram, HeadSpec};
    use crate::layout::{self, HeadLayout};
    use crate::schedule::Schedule;
    use headrace_geometry::frames::{Mount, Rot, Vec3};
    use headrace_geometry::time::DurNs;

    /// Two heads are in front, and two aft-facing heads are behind.
    ///
    /// The unevenness is tested at the planned speed and 10 % above it.
    #[test]
    fn sector_heads_pass_at_equal_distances_only_at_the_planned_speed() {
        const SWEEP_S: f64 = 4.0;
        let mount = |x_m: f64, y_m: f64| Mount {
            position: Vec3::new(x_m, y_m, 0.0),
            rotation: Rot::from_roll_pitch_yaw(0.0, 0.0, if x_m < 0.0 { TAU / 2.0 } else { 0.0 }),
        };
        let (x_m, step_rad) = (0.55, f64::to_radians(0.9));
        let specs = [(x_m, 0.15), (x_m, -0.15), (-x_m, 0.15), (-x_m, -0.15)].map(|(x_m, y_m)| HeadSpec {
            mount: mount(x_m, y_m),
            step_rad,
            ping_period_s: SWEEP_S / 200.0,
            ..fixtures::head([0.0; 3], false, 0.0)
        });
        for speed_mps in [0.05, 0.11, 0.2] {
            let schedule = Schedule::new(&specs, HeadLayout::SectorOffset, speed_mps).unwrap();
            let programs = layout::programs(&specs, HeadLayout::SectorOffset, speed_mps).unwrap();
            // Several moments of a sweep there and back, including moments near the turning points.
            for moment in 0..50 {
                let at_s = 7.0 + 0.083 * f64::from(moment);
                let legs = legs_at(&schedule, &specs, &programs, at_s);
                let at = |mps: f64| {
                    let mut ahead = [0.0; MAX_HEADS];
                    for (slot, spec) in ahead.iter_mut().zip(&specs) {
                        *slot = spec.mount.position.x() / (mps * SWEEP_S);
                    }
                    uneven(&legs, &ahead)
                };
                // One angular step of a head is 1/200 of the sweep.
                assert!(at(speed_mps) < 0.011, "{speed_mps} m/s, {at_s} s: {}", at(speed_mps));
                // The rear heads reach a place 1.1 m / v after the front heads.
                let later_s = 2.0 * x_m / speed_mps - 2.0 * x_m / (1.1 * speed_mps);
                let off = math::wrap_signed(later_s / SWEEP_S, 1.0).abs();
                assert!((at(1.1 * speed_mps) - off).abs() < 0.011, "{speed_mps} m/s, {at_s} s: {off}");
            }
        }
        assert!((uneven(&[None; MAX_HEADS], &[0.0; MAX_HEADS]) - AT_ONCE).abs() <= 0.0);
    }

    fn legs_at(
        schedule: &Schedule,
        specs: &[HeadSpec],
        programs: &[HeadProgram],
        at_s: f64,
    ) -> [Option<Leg>; MAX_HEADS] {
        let mut legs = [None; MAX_HEADS];
        for (head, ((slot, spec), program)) in legs.iter_mut().zip(specs).zip(programs).enumerate() {
            let (from_rad, size_rad) = program.sector.unwrap();
            let angle_rad = |at_s: f64| schedule.angle_rad(head, DurNs::from_secs_f64(at_s)).unwrap();
            // The known angle of a head is that of its latest ping. The step is the difference between the angles of
            // the latest ping and the ping before it.
            let pings = (at_s / spec.ping_period_s).floor() * spec.ping_period_s + 1e-6;
            let step_rad = math::wrap_signed(angle_rad(pings) - angle_rad(pings - spec.ping_period_s), TAU);
            let motion = HeadMotion {
                mount: spec.mount,
                angle_rad: angle_rad(pings),
                rate_radps: step_rad / spec.ping_period_s,
                step_rad: step_rad.abs(),
                sector_rad: None,
            };
            *slot = Leg::of(&motion, &AngleRange { from_rad, size_rad });
        }
        legs
    }
}
