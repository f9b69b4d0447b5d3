//! When the heads of a vehicle pass a place of the wall, and the longest time between two passes.

use super::error::SamplingError;
use super::head::{HeadMotion, HeadSet, MAX_HEADS, faces_aft};
use crate::math::{self, TAU};

/// Slower than this, a vehicle stands still, m/s: its heads' offsets along the hull have no phase.
const AT_REST_MPS: f64 = 1e-3;

/// The passes of a vehicle's heads at one speed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Passes {
    heads: HeadSet,
    turn_s: f64,
    pattern: Pattern,
    /// At no speed to speak of, phases along the tunnel mean nothing.
    at_rest: bool,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Pattern {
    /// All turn on in one sense: by head, where in a turn's advance its passes fall, in [0, 1).
    Turning([f64; MAX_HEADS]),
    /// Each goes back and forth; the time of the longest sweep there and back, seconds.
    Sectors(f64),
    /// Some turn against the others and meet every place at uneven times: one of them can be counted on.
    Opposed,
}

impl Passes {
    /// As the heads are phased now, were the vehicle to go at `speed_mps`.
    ///
    /// Heads that turn on: head k passes body angle zero at the times t_k + i T, and as it sits x_k ahead of the
    /// vehicle's origin, on the wall at chainages x_k + v (t_k + i T). Divided by v T these are phases on a circle.
    /// Heads in sectors: a place near a sector's end waits for a sweep there and back, twice the time of one.
    /// Source: Jorge et al. 2021, §5.1 and §5.2.
    pub fn measured(motions: &[Option<HeadMotion>; MAX_HEADS], speed_mps: f64) -> Self {
        let turning = || motions.iter().flatten();
        let present = motions.iter().enumerate().filter(|(_, motion)| motion.is_some());
        let heads = present.fold(HeadSet::default(), |set, (head, _)| set.with(head));
        let at_rest = speed_mps.abs() <= AT_REST_MPS;
        let turn_s = turning().map(HeadMotion::turn_period_s).fold(0.0, f64::max);
        let sweep_s =
            |motion: &HeadMotion| motion.sector_rad.map(|size| 2.0 * size / motion.rate_radps.abs());
        if let Some(longest) = turning().filter_map(sweep_s).max_by(f64::total_cmp) {
            return Self { heads, turn_s, pattern: Pattern::Sectors(longest), at_rest };
        }
        // Seen in a mirror, heads that all turn the other way turn this way.
        let mirror = if turning().all(|motion| body_rate(motion) < 0.0) { -1.0 } else { 1.0 };
        let mut phases = [0.0; MAX_HEADS];
        for (motion, phase) in motions.iter().zip(&mut phases) {
            let Some(motion) = motion else { continue };
            let rate = mirror * body_rate(motion);
            if rate <= 0.0 || turn_s <= 0.0 {
                return Self { heads, turn_s, pattern: Pattern::Opposed, at_rest };
            }
            let angle = mirror * body_sign(motion) * motion.angle_rad;
            let until_zero_s = math::wrap(-angle, TAU) / rate;
            let ahead_m = motion.mount.position.x();
            let ahead_s = if at_rest { 0.0 } else { ahead_m / speed_mps };
            *phase = math::wrap((until_zero_s + ahead_s) / turn_s, 1.0);
        }
        Self { heads, turn_s, pattern: Pattern::Turning(phases), at_rest }
    }

    /// These heads turning on, evenly spread in the order of their numbers: what a schedule for this speed gives.
    ///
    /// `turn_s` is the time of a turn.
    /// Errors: no head.
    pub fn evenly_phased(heads: HeadSet, turn_s: f64) -> Result<Self, SamplingError> {
        if heads.is_empty() {
            return Err(SamplingError::HeadCount { heads: 0 });
        }
        let mut phases = [0.0; MAX_HEADS];
        for (rank, head) in heads.iter().enumerate() {
            if let Some(phase) = phases.get_mut(head) {
                *phase = math::wrap(scheduled_phase(rank, heads.len()), 1.0);
            }
        }
        Ok(Self { heads, turn_s, pattern: Pattern::Turning(phases), at_rest: false })
    }

    /// Heads in sectors whose sweep there and back takes `sweep_s`.
    ///
    /// Errors: fewer heads than two.
    pub fn in_sectors(heads: HeadSet, turn_s: f64, sweep_s: f64) -> Result<Self, SamplingError> {
        match heads.len() {
            count @ (0 | 1) => Err(SamplingError::SectorNeedsHeads { heads: count }),
            _ => Ok(Self { heads, turn_s, pattern: Pattern::Sectors(sweep_s), at_rest: false }),
        }
    }

    /// The heads that pass.
    pub fn heads(&self) -> HeadSet {
        self.heads
    }

    /// The longest time between two passes over a place that these heads see, seconds; `None` where none does.
    pub fn gap_s(&self, seen_by: HeadSet) -> Option<f64> {
        let passing = || seen_by.iter().filter(|head| self.heads.has(*head));
        passing().next()?;
        Some(match &self.pattern {
            Pattern::Sectors(sweep_s) => *sweep_s,
            Pattern::Opposed => self.turn_s,
            Pattern::Turning(phases) => {
                let mut known = [0.0; MAX_HEADS];
                let mut count = 0;
                for (slot, head) in known.iter_mut().zip(passing()) {
                    *slot = phases.get(head).copied().unwrap_or_default();
                    count += 1;
                }
                self.turn_s * largest_gap(known.get_mut(..count).unwrap_or_default())
            }
        })
    }

    /// What [`Passes::gap_s`] of all heads would be if they were evenly phased, seconds; zero without a head.
    pub fn even_gap_s(&self) -> f64 {
        match self.pattern {
            Pattern::Sectors(sweep_s) => sweep_s,
            _ => self.turn_s / self.heads.len().max(1) as f64,
        }
    }

    /// By how much each head is out of its phase against the first that turns, radians of its turn, in [-pi, pi).
    ///
    /// Positive: it passes a place later, farther ahead, than the schedule for `scheduled` heads has it. `None` for a
    /// head that isn't there, for heads that don't all turn on, and at rest.
    /// Source: Jorge et al. 2021, §5.1 (phi(k) = 2 pi k / s).
    pub fn phase_errors_rad(&self, scheduled: usize) -> [Option<f64>; MAX_HEADS] {
        let mut errors = [None; MAX_HEADS];
        let Pattern::Turning(phases) = &self.pattern else { return errors };
        if self.at_rest {
            return errors;
        }
        let late = |head: usize| phases.get(head).map(|phase| phase - scheduled_phase(head, scheduled));
        let Some(first) = self.heads.iter().next().and_then(late) else { return errors };
        for (head, error) in errors.iter_mut().enumerate().filter(|(head, _)| self.heads.has(*head)) {
            *error = late(head).map(|here| math::wrap_signed(here - first, 1.0) * TAU);
        }
        errors
    }
}

/// Where in a turn's advance the passes of head `head` of `heads` belong: a head that is ahead in angle passes a place
/// earlier.
fn scheduled_phase(head: usize, heads: usize) -> f64 {
    -(head as f64) / heads.max(1) as f64
}

/// The largest gap between neighbours on a circle of circumference 1; sorts them.
fn largest_gap(phases: &mut [f64]) -> f64 {
    phases.sort_unstable_by(f64::total_cmp);
    let wrapped = phases.first().zip(phases.last()).map_or(1.0, |(first, last)| first + 1.0 - last);
    let between = phases.windows(2).map(|pair| match pair {
        [a, b] => b - a,
        _ => 0.0,
    });
    between.fold(wrapped, f64::max)
}

/// 1 where the head's own angles are the body's, -1 where they grow the other way.
fn body_sign(motion: &HeadMotion) -> f64 {
    if faces_aft(motion.mount.rotation) { -1.0 } else { 1.0 }
}

fn body_rate(motion: &HeadMotion) -> f64 {
    body_sign(motion) * motion.rate_radps
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frames::{Mount, Rot, Vec3};

    fn motions(angles_deg: &[f64], x_m: &[f64]) -> [Option<HeadMotion>; MAX_HEADS] {
        let mut motions = [None; MAX_HEADS];
        for ((slot, angle), x) in motions.iter_mut().zip(angles_deg).zip(x_m) {
            *slot = Some(HeadMotion {
                mount: Mount { position: Vec3::new(*x, 0.0, 0.0), rotation: Rot::identity() },
                angle_rad: angle.to_radians(),
                rate_radps: TAU / 8.0,
                step_rad: f64::to_radians(0.9),
                sector_rad: None,
            });
        }
        motions
    }

    fn all(passes: &Passes) -> f64 {
        passes.gap_s(passes.heads()).unwrap()
    }

    #[test]
    fn evenly_phased_heads_share_the_turn() {
        let passes = Passes::measured(&motions(&[10.0, 100.0, 190.0, 280.0], &[0.0; 4]), 0.2);
        assert!((all(&passes) - 2.0).abs() < 1e-9 && (passes.even_gap_s() - 2.0).abs() < 1e-12);
        let errors = passes.phase_errors_rad(4);
        assert!(errors[..4].iter().all(|error| error.unwrap().abs() < 1e-9) && errors[4].is_none());
        let planned = Passes::evenly_phased(HeadSet::first(4), 8.0).unwrap();
        assert!((all(&planned) - 2.0).abs() < 1e-12);
    }

    #[test]
    fn where_heads_do_not_see_a_place_the_others_leave_longer_gaps() {
        let passes = Passes::evenly_phased(HeadSet::first(4), 8.0).unwrap();
        let gap_s =
            |hidden: [usize; 2]| passes.gap_s(passes.heads().without(hidden[0]).without(hidden[1])).unwrap();
        // Half a turn apart: doubled. A quarter apart: two passes in a row are missing.
        assert!((gap_s([0, 2]) - 4.0).abs() < 1e-12 && (gap_s([0, 1]) - 6.0).abs() < 1e-12);
        assert_eq!(passes.gap_s(HeadSet::default()), None);
        assert_eq!(passes.gap_s(HeadSet::default().with(6)), None);
    }

    #[test]
    fn heads_together_pass_together() {
        let together = Passes::measured(&motions(&[0.0, 0.0], &[0.0, 0.0]), 0.2);
        assert!((all(&together) - 8.0).abs() < 1e-9 && (together.even_gap_s() - 4.0).abs() < 1e-12);
        assert!((together.phase_errors_rad(2)[1].unwrap().abs() - math::PI).abs() < 1e-9);
        // Half a pitch apart along the hull, the same angles interleave: 0.2 m/s, 8 s a turn, 0.8 m.
        let apart = Passes::measured(&motions(&[0.0, 0.0], &[0.8, 0.0]), 0.2);
        assert!((all(&apart) - 4.0).abs() < 1e-9);
    }

    #[test]
    fn a_head_that_is_late_has_a_positive_error() {
        // The second of two belongs half a turn ahead; it is 30 degrees short of that.
        let passes = Passes::measured(&motions(&[0.0, 150.0], &[0.0, 0.0]), 0.2);
        assert!((passes.phase_errors_rad(2)[1].unwrap() - f64::to_radians(30.0)).abs() < 1e-9);
        // Ten per cent faster than scheduled, a head 1.6 m (a turn's advance) astern is early by a tenth / 1.1 of a turn.
        let at = |speed| Passes::measured(&motions(&[0.0, 180.0], &[1.6, 0.0]), speed).phase_errors_rad(2)[1];
        assert!(at(0.2).unwrap().abs() < 1e-9);
        assert!((at(0.22).unwrap() - TAU * (1.0 - 1.0 / 1.1)).abs() < 1e-9, "{:?}", at(0.22));
    }

    #[test]
    fn heads_that_all_turn_the_other_way_are_phased_alike_and_opposed_ones_are_not() {
        let mut mirrored = motions(&[0.0, 180.0], &[0.0, 0.0]);
        for head in mirrored.iter_mut().flatten() {
            head.rate_radps = -head.rate_radps;
        }
        assert!((all(&Passes::measured(&mirrored, 0.2)) - 4.0).abs() < 1e-9);
        if let Some(first) = mirrored.iter_mut().flatten().next() {
            first.rate_radps = -first.rate_radps;
        }
        let opposed = Passes::measured(&mirrored, 0.2);
        assert!((all(&opposed) - 8.0).abs() < 1e-9 && opposed.phase_errors_rad(2) == [None; MAX_HEADS]);
    }

    #[test]
    fn heads_that_are_left_share_the_turn_evenly() {
        let three = Passes::evenly_phased(HeadSet::first(4).without(1), 9.0).unwrap();
        assert!((all(&three) - 3.0).abs() < 1e-12);
        let none = HeadSet::default();
        assert_eq!(Passes::evenly_phased(none, 8.0), Err(SamplingError::HeadCount { heads: 0 }));
        let one = HeadSet::first(1);
        assert_eq!(Passes::in_sectors(one, 8.0, 16.0), Err(SamplingError::SectorNeedsHeads { heads: 1 }));
        assert!((all(&Passes::in_sectors(HeadSet::first(2), 8.0, 8.0).unwrap()) - 8.0).abs() < 1e-12);
    }
}
