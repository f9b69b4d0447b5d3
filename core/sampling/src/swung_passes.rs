//! Passes over the wall by the heads of a swinging vehicle, simulated from its latest swing.
//!
//! Swing moves passes along the tunnel by up to metres. Successive passes may then be farther apart than the target at
//! any speed, but passes of later swings land between them. At a low speed, these passes fill the gaps.

use super::head::HeadSet;
use super::passes::{HeadPasses, Phasing};
use super::swing::RecentSwing;
use headrace_geometry::math;
use headrace_geometry::tunnel::Yz;

/// Maximum number of simulated passes over a place. At a speed that needs more passes than this, the gaps count as
/// infinite.
const MOST_PASSES: usize = 512;
/// Length of the stretch along the tunnel in which gaps are checked, as a multiple of the target.
const STRETCH: f64 = 3.0;
/// `SLOWER_BY` is the ratio of each tried speed to the speed tried before it, and `TRIED` the number of tried speeds.
const SLOWER_BY: f64 = 0.93;
const TRIED: u32 = 40;
/// Multiples of a tried speed that must also meet the target, because a single speed may meet it by chance.
const ALSO: [f64; 6] = [1.0, 1.1, 1.2, 0.9, 0.8, 0.7];

/// A place on the wall's perimeter, and the heads that see it.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Place {
    /// Position relative to the vehicle, m: to the left and up.
    pub(crate) from_vehicle_m: Yz,
    /// Heads that see the place.
    pub(crate) seen_by: HeadSet,
}

/// Returns the largest speed up to `bound_mps` at which all gaps between passes meet the target, m/s.
///
/// Zero if there is no such speed. `meets` tells whether a gap, m, meets the target at a speed, m/s. Several speeds
/// around the result meet the target, too. The vehicle is assumed to continue the swing of the history.
/// Allocates: never.
pub(crate) fn highest_mps(
    bound_mps: f64,
    (swing, phasing): (&RecentSwing<'_>, &Phasing),
    places: &[Place],
    target_m: f64,
    meets: impl Fn(f64, f64) -> bool,
) -> f64 {
    let met = |speed_mps: f64| {
        let gap_m = |place: &Place| largest_gap_m(speed_mps, (swing, phasing), place, target_m);
        places.iter().all(|place| meets(gap_m(place), speed_mps))
    };
    let mut slower = (0..TRIED).scan(bound_mps, |speed_mps, _| {
        let tried_mps = *speed_mps;
        *speed_mps *= SLOWER_BY;
        Some(tried_mps)
    });
    slower.find(|speed_mps| ALSO.iter().all(|share| met(speed_mps * share))).unwrap_or(0.0)
}

/// Largest distance along the tunnel between neighbouring passes over a place, m.
///
/// Infinite if the place needs more than [`MOST_PASSES`] simulated passes.
fn largest_gap_m(
    speed_mps: f64,
    (swing, phasing): (&RecentSwing<'_>, &Phasing),
    place: &Place,
    target_m: f64,
) -> f64 {
    let [y_m, z_m] = place.from_vehicle_m;
    let of_heads = || phasing.first_passes().filter(|passes| place.seen_by.has(passes.head));
    let ahead =
        |of: fn(f64, f64) -> f64, start: f64| of_heads().fold(start, |so_far, head| of(so_far, head.ahead_m));
    let [least_m, most_m] = swing.displacements_m(place.from_vehicle_m);
    // Gaps are checked only in this stretch. Outside it, some passes come before the present or after the simulation's
    // end.
    let from_m = ahead(f64::max, f64::MIN) + most_m;
    let until_m = from_m + STRETCH * target_m;
    let takes_s = (until_m - ahead(f64::min, f64::MAX) - least_m) / speed_mps;
    // A head's beam reaches the place this share of a turn after it passes the vertical.
    let turned = math::atan2(y_m, -z_m) / math::TAU;
    let mut places_m = [0.0; MOST_PASSES];
    let mut count = 0;
    for HeadPasses { first_s, turn_s, ahead_m, .. } in of_heads() {
        let mut at_s = math::wrap(first_s + turned * turn_s, turn_s);
        while at_s <= takes_s {
            let Some(slot) = places_m.get_mut(count) else { return f64::INFINITY };
            *slot = speed_mps * at_s + ahead_m + swing.displacement_m(at_s, place.from_vehicle_m);
            count += 1;
            at_s += turn_s;
        }
    }
    let places_m = places_m.get_mut(..count).unwrap_or_default();
    places_m.sort_unstable_by(f64::total_cmp);
    let pairs = places_m.iter().zip(places_m.iter().skip(1));
    let counts = |(before_m, after_m): &(&f64, &f64)| **after_m > from_m && **before_m < until_m;
    let gaps = pairs.filter(counts).map(|(before_m, after_m)| after_m - before_m);
    if count < 2 { f64::INFINITY } else { gaps.fold(0.0, f64::max) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::head;
    use crate::head::{HeadMotion, MAX_HEADS};
    use crate::layout::HeadLayout;
    use crate::losses::LossRate;
    use crate::passes::Situation;
    use crate::swing::Looks;
    use headrace_geometry::frames::{Body, Rot, Vec3};
    use headrace_geometry::math::TAU;
    use headrace_geometry::time::MonoNs;

    const TURN_S: f64 = 8.0;
    const TARGET_M: f64 = 0.5;
    /// Left wall, right wall, floor and ceiling.
    const WALL_M: [Yz; 4] = [[3.5, 0.0], [-3.5, 0.0], [0.0, -3.0], [0.0, 4.0]];

    /// Two heads in phase at 0.05 m/s, `apart_m` apart along the hull.
    fn phasing(apart_m: f64) -> Phasing {
        let mut heads = [None; MAX_HEADS];
        for (number, slot) in heads.iter_mut().take(2).enumerate() {
            *slot = Some(HeadMotion {
                mount: head([apart_m * number as f64, 0.0, 0.0], false, 0.0).mount,
                angle_rad: 0.3 + 0.5 * TAU * number as f64,
                rate_radps: TAU / TURN_S,
                step_rad: 0.0157,
                sector_rad: None,
            });
        }
        Phasing::of(&Situation {
            pose: None,
            speed_mps: 0.05,
            pass_error_m: 0.0,
            layout: HeadLayout::PhaseShift,
            configured: 2,
            heads,
            deaf: HeadSet::default(),
            losses: [LossRate::default(); MAX_HEADS],
            lost_at_most: LossRate::default(),
        })
    }

    /// A minute of directions of a vehicle whose yaw is a sine with the amplitude `yaw_rad` and this period, s.
    fn looks(yaw_rad: f64, period_s: f64) -> Looks {
        let mut looks = Looks::default();
        for update in 0..320_u32 {
            let yaw = yaw_rad * math::sin(TAU * 0.2 * f64::from(update) / period_s);
            let look = Rot::from_roll_pitch_yaw(0.0, 0.0, yaw) * Vec3::<Body>::new(1.0, 0.0, 0.0);
            looks.keep(MonoNs(u64::from(update) * 200_000_000), look);
        }
        looks
    }

    fn highest(yaw_rad: f64, period_s: f64, apart_m: f64) -> f64 {
        let seen_by = HeadSet::default().with(0).with(1);
        let places = WALL_M.map(|from_vehicle_m| Place { from_vehicle_m, seen_by });
        let bound_mps = TARGET_M / (TURN_S / 2.0);
        let (looks, phasing) = (looks(yaw_rad, period_s), phasing(apart_m));
        highest_mps(bound_mps, (&looks.uninterrupted(), &phasing), &places, TARGET_M, |gap_m, _| {
            gap_m <= TARGET_M + 1e-9
        })
    }

    /// Largest gap along 10 m of a wall at `y_m` to the left, for a sinusoidal yaw that never ends.
    fn true_gap_m(
        speed_mps: f64,
        (yaw_rad, period_s, apart_m): (f64, f64, f64),
        y_m: f64,
        phase_s: f64,
    ) -> f64 {
        let mut places_m: Vec<f64> = (0..100_000)
            .map(|pass| {
                let (head, at_s) = (f64::from(pass % 2), f64::from(pass) * TURN_S / 2.0);
                let yaw = yaw_rad * math::sin(TAU * (at_s + phase_s) / period_s);
                speed_mps * at_s + apart_m * head - y_m * math::tan(yaw)
            })
            .take_while(|x_m| *x_m < 20.0)
            .collect();
        places_m.sort_by(f64::total_cmp);
        let inner = places_m.windows(2).filter(|pair| pair[0] > 5.0 && pair[1] < 15.0);
        inner.map(|pair| pair[1] - pair[0]).fold(0.0, f64::max)
    }

    /// Without swing, the result is about a sixth below the bound `bound_mps`, because speeds up to 20 % above the
    /// result must also meet the target.
    #[test]
    fn steady_vehicle_gets_a_speed_10_to_25_percent_below_the_theoretical_limit() {
        let (bound_mps, found_mps) = (TARGET_M / (TURN_S / 2.0), highest(0.0, 20.0, 0.0));
        assert!((0.75 * bound_mps..0.9 * bound_mps).contains(&found_mps), "{found_mps} m/s");
        assert!(highest(0.005, 20.0, 0.0) < found_mps);
    }

    /// A swing of ten degrees puts successive passes up to 0.7 m apart, which exceeds the target of 0.5 m.
    #[test]
    fn passes_of_several_swings_meet_the_target_at_a_low_speed() {
        for (period_s, apart_m) in [(20.0, 0.0), (13.0, 0.0), (27.0, 0.0), (20.0, 1.1), (17.0, 0.6)] {
            let swing = (0.1745, period_s, apart_m);
            let speed_mps = highest(0.1745, period_s, apart_m);
            assert!((0.005..0.07).contains(&speed_mps), "{swing:?}: {speed_mps} m/s");
            let gap_m = |speed_mps: f64| {
                let phases = (0..10).map(|k| period_s * f64::from(k) / 10.0);
                let gaps = phases
                    .flat_map(|phase_s| [3.5, -3.5].map(|y_m| true_gap_m(speed_mps, swing, y_m, phase_s)));
                gaps.fold(0.0, f64::max)
            };
            assert!(
                gap_m(speed_mps) <= 1.15 * TARGET_M,
                "{swing:?}: {} m at {speed_mps} m/s",
                gap_m(speed_mps)
            );
            assert!(gap_m(3.0 * speed_mps) > TARGET_M, "{swing:?}: {speed_mps} m/s is too low");
        }
    }

    /// A place without passes has an infinite gap.
    #[test]
    fn place_that_no_head_sees_allows_no_speed() {
        let places = [Place { from_vehicle_m: [3.5, 0.0], seen_by: HeadSet::default() }];
        let found = highest_mps(
            0.1,
            (&looks(0.1, 20.0).uninterrupted(), &phasing(0.0)),
            &places,
            TARGET_M,
            |gap_m, _| gap_m <= 0.5,
        );
        assert!(found <= 0.0, "{found} m/s");
    }
}
