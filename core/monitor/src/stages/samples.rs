//! Samples to the store, and their spacings to their sections.

use crate::entities::{HeadSweep, LastSample};
use crate::messages::{Outcome, PlacedPing};
use crate::resources::{Coverage, TunnelDesign};
use headrace_coverage::hole::FARTHEST_M;
use headrace_coverage::{StoreError, Visit, WallSample};
use headrace_geometry::frames::{Point3, Tunnel};
use headrace_geometry::math;
use headrace_sampling::spacing;

/// Stores a sample and adds its spacings to its section.
pub(super) fn note_sample(
    coverage: &mut Coverage,
    sweep: &mut HeadSweep,
    tunnel: &TunnelDesign,
    ping: &PlacedPing,
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
    if !coverage.store.covers(point.x(), arc_m) {
        *slot = None;
        return Err(StoreError::Outside);
    }
    let before = *slot;
    let step_from = before.filter(|last| last.unbroken && ping.single_step);
    let t_x_m = coverage.store.nearest_pass_m(point.x(), arc_m, FARTHEST_M);
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
    coverage.soundings.add(point.x(), arc_m);
    if let Some(visit) = visit {
        coverage.sections.touch(point.x(), &visit, &tunnel.profile);
    }
    let index = coverage.sections.index_of(point.x());
    let Some(section) = coverage.sections.get_mut(index) else { return Ok(()) };
    section.samples += 1;
    let yz = |point: &Point3<Tunnel>| [point.y(), point.z()];
    let from = step_from.map(|last| (yz(&last.point), last.arc_m));
    section.deviation.add(&tunnel.profile, (yz(&point), arc_m), from, tunnel.contradiction_m);
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
