//! Stores samples, and adds their spacings to the sections.

use crate::entities::{HeadSweep, LastSample};
use crate::messages::{Outcome, PlacedPing};
use crate::resources::{Coverage, TunnelDesign};
use headrace_coverage::hole::FARTHEST_M;
use headrace_coverage::{StoreError, Visit, WallSample};
use headrace_geometry::frames::{Point3, Tunnel};
use headrace_geometry::math;
use headrace_geometry::tunnel::WallPoint;
use headrace_sampling::spacing;

/// Stores a sample, and adds its spacings to its section.
///
/// `is_confirming` means that another head has found wall with the same deviation from the design at the same place.
pub(super) fn note_sample(
    coverage: &mut Coverage,
    sweep: &mut HeadSweep,
    tunnel: &TunnelDesign,
    ping: &PlacedPing,
    is_confirming: bool,
) -> Result<(), StoreError> {
    let slot = &mut sweep.last;
    if ping.new_sweep {
        *slot = None;
    }
    let Outcome::Sample { point, arc_m } = ping.outcome else {
        if let Some(last) = slot {
            last.unbroken = false;
        }
        return Ok(());
    };
    let at = WallPoint { x_m: point.x(), arc_m };
    if !coverage.store.covers(at) {
        *slot = None;
        return Err(StoreError::Outside);
    }
    let before = *slot;
    let step_from = before.filter(|last| last.unbroken && ping.single_step);
    let t_x_m = coverage.store.nearest_pass_m(at, FARTHEST_M);
    let perimeter_m = coverage.store.perimeter_m();
    let step_m = step_from
        .map(|last| [point.x() - last.point.x(), math::wrap_signed(arc_m - last.arc_m, perimeter_m)]);
    let turns = coverage.frontier.turns();
    let visit = ping.fix.map(|fix| Visit::of(&fix, ping.valid_at, turns));
    let number = visit.map_or(0, |visit| visit.number);
    let sample = WallSample { x_m: point.x(), arc_m, head: ping.head, step_m, visit: number };
    let kept = coverage.store.insert(sample);
    *slot = kept.ok().map(|_| LastSample { point, arc_m, unbroken: true });
    kept?;
    coverage.soundings.add(at);
    if let Some(visit) = visit {
        coverage.sections.touch(point.x(), &visit, &tunnel.profile);
    }
    let index = coverage.sections.index_of(point.x());
    let Some(section) = coverage.sections.get_mut(index) else { return Ok(()) };
    section.samples += 1;
    let yz = |point: &Point3<Tunnel>| [point.y(), point.z()];
    let from = step_from.map(|last| (yz(&last.point), last.arc_m));
    let limits = (tunnel.contradiction_m, is_confirming);
    section.deviation.add(&tunnel.profile, (yz(&point), arc_m), from, limits);
    if let Some(t_x_m) = t_x_m {
        section.t_x_m.add(t_x_m);
    }
    if let Some(last) = before {
        let t_y_m = (point - last.point).norm();
        section.t_y_m.add(t_y_m);
        let advance_m = (point.x() - last.point.x()).abs();
        if let Some(t_x_m) = t_x_m {
            section.t_m.add(spacing::t_max_m(t_x_m, advance_m, t_y_m));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::{coverage, heard, pinged, tunnel};

    /// Test pings at intervals of a tenth of a radian: 0.3 m along the wall, and a centimetre along the
    /// tunnel.
    fn at(step: u32) -> PlacedPing {
        let step = f64::from(step);
        heard(5.05 + 0.01 * step, 0.1 * step, 3.0)
    }

    #[test]
    fn consecutive_samples_form_single_steps_until_a_ping_is_lost() {
        let (mut coverage, tunnel, mut sweep) = (coverage(), tunnel(), HeadSweep::default());
        let mut note = |ping: &PlacedPing| {
            assert_eq!(note_sample(&mut coverage, &mut sweep, &tunnel, ping, false), Ok(()));
            let section = coverage.sections.get(20).unwrap();
            let (samples, steps, t_y_m) = (section.samples, section.t_y_m.count, section.t_y_m.max);
            // Looks for a pass at the centre of each angular step. A pass is a single step that crosses an
            // arc length.
            let passes = [0.5, 1.5, 2.5, 3.5].map(|middle| {
                let Outcome::Sample { arc_m, .. } = heard(5.1, 0.1 * middle, 3.0).outcome else { panic!() };
                coverage.store.nearest_pass_m(WallPoint { x_m: 5.1, arc_m }, 1.0).is_some()
            });
            (samples, steps, t_y_m, passes)
        };
        let (samples, steps, ..) = note(&at(0));
        assert_eq!((samples, steps), (1, 0));
        let (samples, steps, t_y_m, passes) = note(&at(1));
        assert_eq!((samples, steps, passes), (2, 1, [true, false, false, false]));
        // The samples of one angular step are apart by the chord of a tenth of a radian at 3 m, and by a
        // centimetre along the tunnel.
        let chord_m = 2.0 * 3.0 * math::sin(0.05);
        assert!((t_y_m - math::hypot(chord_m, 0.01)).abs() < 1e-9, "{t_y_m}");
        // After a lost ping, the next sample is two angular steps away. That isn't a pass, but the spacing is
        // still measured.
        note(&pinged(5.07, 0.2));
        let (samples, steps, t_y_m, passes) = note(&at(3));
        assert_eq!((samples, steps, passes), (3, 2, [true, false, false, false]));
        assert!((t_y_m - math::hypot(6.0 * math::sin(0.1), 0.02)).abs() < 1e-9, "{t_y_m}");
        // Before the first of these two samples, the head has moved several angular steps at once. The second
        // sample begins a new sweep, so it has no previous sample.
        let (samples, steps, _, passes) = note(&PlacedPing { single_step: false, ..at(4) });
        assert_eq!((samples, steps, passes), (4, 3, [true, false, false, false]));
        let (samples, steps, ..) = note(&PlacedPing { new_sweep: true, ..at(5) });
        assert_eq!((samples, steps), (5, 3));
    }

    /// The new sample comes a turn later, 0.2 m farther in, half way between two samples of the first turn.
    #[test]
    fn distance_to_the_previous_pass_is_along_the_tunnel() {
        let (mut coverage, tunnel, mut sweep) = (coverage(), tunnel(), HeadSweep::default());
        for ping in [at(0), at(1), at(2), PlacedPing { new_sweep: true, ..heard(5.235, 0.05, 3.0) }] {
            note_sample(&mut coverage, &mut sweep, &tunnel, &ping, false).unwrap();
        }
        let section = coverage.sections.get(20).unwrap();
        // At the new sample's arc length, the first turn's pass was at 5.055 m. The second and the third sample of
        // that turn each end a step.
        assert!((section.t_x_m.max - 0.18).abs() < 1e-9, "{:?}", section.t_x_m);
        assert_eq!((section.samples, section.t_y_m.count), (4, 2));
    }

    #[test]
    fn sample_outside_the_store_extent_interrupts_the_sweep() {
        let (mut coverage, tunnel, mut sweep) = (coverage(), tunnel(), HeadSweep::default());
        note_sample(&mut coverage, &mut sweep, &tunnel, &at(0), false).unwrap();
        let outside = note_sample(&mut coverage, &mut sweep, &tunnel, &heard(33.0, 0.1, 3.0), false);
        assert_eq!((outside, sweep.last.is_none()), (Err(StoreError::Outside), true));
        note_sample(&mut coverage, &mut sweep, &tunnel, &at(2), false).unwrap();
        let section = coverage.sections.get(20).unwrap();
        assert_eq!((section.samples, section.t_y_m.count, coverage.store.usage().kept), (2, 0, 2));
    }
}
