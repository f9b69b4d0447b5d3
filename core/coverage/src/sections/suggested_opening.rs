//! Openings of the wall that the vehicle file does not declare, such as side tunnels.

use super::section_table::Sections;
use crate::cause::Cause;
use crate::hole::Hole;
use crate::openings::Opening;
use crate::runs::Run;
use crate::section::{Section, Verdict};
use headrace_geometry::math;
use headrace_geometry::tunnel::Profile;

/// Least edge of a suggested opening as a multiple of the target T. A smaller patch may have lost its returns by
/// chance.
const LEAST_TARGETS: f64 = 2.0;
/// Largest edge of a suggested opening as a multiple of the equivalent radius. An opening is no wider than the tunnel.
const MOST_RADII: f64 = 2.0;
/// Largest share of lost pings, as a multiple of the patch's share of the perimeter. If the share is larger, the wall
/// around the patch loses returns too, so a low gain is more likely.
const MOST_LOST: f64 = 2.0;

impl Sections {
    /// Returns the opening that explains the lost returns of a missed stretch; `None` if they have another cause.
    ///
    /// It is the patch of wall that the stretch's empty circles cover. Every ping at the patch was lost, but only a few
    /// pings elsewhere were.
    ///
    /// Allocates: the opening's name. Called only at the end of a dive.
    pub fn suggested_opening(&self, run: &Run, profile: &Profile) -> Option<Opening> {
        let perimeter_m = profile.perimeter_m();
        let (_, worst) = run.worst;
        let lost_share = self.evidence_of(run, Cause::MissingReturns)?.missing_share;
        let across_m = |hole: &Hole| math::wrap_signed(hole.arc_m - worst.arc_m, perimeter_m);
        let lost = (run.from..run.to).filter_map(|index| self.get(index).and_then(hole_of_lost));
        let mut patch = Patch::of(&worst, 0.0);
        for hole in lost.filter(|hole| across_m(hole).abs() <= worst.diameter_m / 2.0) {
            patch.extend(&Patch::of(&hole, across_m(&hole)));
        }
        let edges_m = [patch.x_m[1] - patch.x_m[0], patch.across_m[1] - patch.across_m[0]];
        let (least_m, most_m) =
            (LEAST_TARGETS * self.target().max_hole_m, MOST_RADII * perimeter_m / math::TAU);
        let is_opening = edges_m.iter().all(|edge_m| (least_m..=most_m).contains(edge_m))
            && lost_share <= MOST_LOST * edges_m[1] / perimeter_m;
        let arc_m = math::wrap(worst.arc_m + patch.across_m[0], perimeter_m);
        let [from_m, to_m] = patch.x_m;
        is_opening.then(|| Opening {
            name: format!("opening at {from_m:.0} m"),
            from_m,
            to_m,
            arc_m: Some((arc_m, edges_m[1])),
        })
    }
}

/// Returns the empty circle of a section, if the section failed because of lost returns.
fn hole_of_lost(section: &Section) -> Option<Hole> {
    let is_lost = section.evidence.is_some_and(|evidence| evidence.causes.has(Cause::MissingReturns));
    section.hole.filter(|hole| hole.bounded && is_lost && section.verdict == Verdict::Fail)
}

/// A patch of wall. It spans chainages, and distances around the wall from the centre of the largest hole, m.
struct Patch {
    x_m: [f64; 2],
    across_m: [f64; 2],
}

impl Patch {
    fn of(hole: &Hole, across_m: f64) -> Self {
        let radius_m = hole.diameter_m / 2.0;
        let about = |middle_m: f64| [middle_m - radius_m, middle_m + radius_m];
        Self { x_m: about(hole.x_m), across_m: about(across_m) }
    }

    fn extend(&mut self, other: &Self) {
        let wider = |a: [f64; 2], b: [f64; 2]| [a[0].min(b[0]), a[1].max(b[1])];
        (self.x_m, self.across_m) = (wider(self.x_m, other.x_m), wider(self.across_m, other.across_m));
    }
}
