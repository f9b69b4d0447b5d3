//! Records how the vehicle and its heads pass each section.

use crate::entities::HeadFrontier;
use crate::messages::{Outcome, PlacedPing};
use crate::resources::Coverage;
use headrace_coverage::{Drive, HeadReach, Loss, PassError, Visit};
use headrace_geometry::tunnel::Profile;

/// Limit for using the speed at a ping as evidence of a cause. The speed isn't used if this many standard
/// deviations of its position error relative to the previous pass reach the target.
const ADRIFT_SD: f64 = 2.0;

/// Adds a ping to the passage record of the section that the ping's head is in.
pub(super) fn note_passage(
    coverage: &mut Coverage,
    frontier: &HeadFrontier,
    drive: &Drive,
    (ping, profile): (&PlacedPing, &Profile),
) {
    // A ping without a fix counts at its head's last known place.
    let Some(reach) = ping.reach.or_else(|| Some(frontier.0?.latest())) else { return };
    let index = coverage.sections.index_of(reach.middle_m());
    let turns = coverage.frontier.turns();
    let target_m = coverage.sections.target().max_hole_m;
    let Some(section) = coverage.sections.get_mut(index) else { return };
    let passage = &mut section.passage;
    passage.pings += 1;
    passage.standing += u32::from(ping.standing);
    match ping.outcome {
        Outcome::Sample { .. } => {}
        Outcome::Lost(Loss::Missing, _) => passage.missing += 1,
        Outcome::Lost(Loss::OutOfRange, _) => passage.out_of_range += 1,
        Outcome::Lost(Loss::Occluded, _) => passage.occluded += 1,
        Outcome::Unplaced(_) => passage.unplaced += 1,
    }
    let Some(fix) = ping.fix else { return };
    passage.placed += 1;
    if PassError::of(&fix).exceeds(target_m / ADRIFT_SD, profile) {
        passage.adrift = true;
    } else {
        passage.drive = passage.drive.or_worse(Drive { speed_mps: fix.speed_mps.abs(), ..*drive });
    }
    section.note_pass(&Visit::of(&fix, ping.valid_at, turns), profile);
}

/// Updates the head's reach with a ping.
pub(super) fn note_reach(frontier: &mut HeadFrontier, ping: &PlacedPing) {
    match (ping.fix, ping.reach) {
        (Some(_), Some(reach)) => frontier.0 = Some(HeadReach::after(frontier.0, ping.received, reach)),
        _ => {
            if let Some(reach) = &mut frontier.0 {
                reach.heard(ping.received);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::{coverage, fix, heard, pinged, pipe};
    use headrace_coverage::Reach;
    use headrace_fusion::{Fix, NoFix};
    use headrace_geometry::time::MonoNs;

    /// A ping without a fix counts at its head's last known place.
    #[test]
    fn passage_counts_all_pings_and_keeps_the_worst_driving_figures() {
        let (mut coverage, profile) = (coverage(), pipe());
        let here = Reach { from_m: 7.0, to_m: 7.2 };
        let frontier = HeadFrontier(Some(HeadReach::after(None, MonoNs(0), here)));
        let drive = Drive { healthy_gap_s: 2.0, speed_mps: 0.4, ..Drive::default() };
        let slow =
            PlacedPing { fix: Some(Fix { speed_mps: -0.05, ..fix(5.1, 0.01) }), ..heard(5.1, 1.0, 3.0) };
        let fast = PlacedPing { fix: Some(Fix { speed_mps: 0.2, ..fix(5.1, 0.02) }), ..pinged(5.1, 1.0) };
        let of = |loss: Loss| PlacedPing { outcome: Outcome::Lost(loss, None), ..slow };
        let away = PlacedPing {
            fix: None,
            reach: None,
            standing: true,
            outcome: Outcome::Unplaced(NoFix::Heading),
            ..slow
        };
        for ping in [slow, fast, slow, of(Loss::OutOfRange), of(Loss::Occluded), away, away] {
            note_passage(&mut coverage, &frontier, &drive, (&ping, &profile));
        }
        let passage = coverage.sections.get(20).unwrap().passage;
        let counts = [passage.pings, passage.placed, passage.missing, passage.out_of_range, passage.occluded];
        assert_eq!((counts, passage.unplaced, passage.standing), ([5, 5, 1, 1, 1], 0, 0));
        assert_eq!((passage.drive, passage.adrift), (Drive { speed_mps: 0.2, ..drive }, false));
        assert_eq!(passage.pass_error, PassError::of(&fast.fix.unwrap()));
        let elsewhere = coverage.sections.get(28).unwrap().passage;
        let counts = [elsewhere.pings, elsewhere.placed, elsewhere.unplaced, elsewhere.standing];
        assert_eq!(counts, [2, 0, 2, 2]);
        // A head that never had a fix has no known place.
        note_passage(&mut coverage, &HeadFrontier(None), &drive, (&away, &profile));
        assert_eq!(coverage.sections.get(28).unwrap().passage, elsewhere);
    }

    /// A ping is no evidence of the speed if two standard deviations of its position relative to the previous
    /// pass reach the target. The error of a hole is 1.2 times that of a pass.
    #[test]
    fn ping_with_an_uncertain_position_is_no_evidence_of_the_speed() {
        let profile = pipe();
        let noted = |sd_m: f64| {
            let mut coverage = coverage();
            let ping = PlacedPing { fix: Some(fix(5.1, sd_m)), ..heard(5.1, 1.0, 3.0) };
            let drive = Drive { healthy_gap_s: 2.0, ..Drive::default() };
            note_passage(&mut coverage, &HeadFrontier(None), &drive, (&ping, &profile));
            let passage = coverage.sections.get(20).unwrap().passage;
            (passage.adrift, passage.drive.speed_mps > 0.0)
        };
        assert_eq!((noted(0.2), noted(0.215)), ((false, true), (true, false)));
    }

    #[test]
    fn head_that_pings_without_a_fix_keeps_the_position_of_its_latest_fix() {
        let at = |seconds: u64| MonoNs(seconds * 1_000_000_000);
        let ping = |seconds: u64, x_m: Option<f64>| PlacedPing {
            received: at(seconds),
            fix: x_m.map(|x_m| fix(x_m, 0.0)),
            reach: x_m.map(|x_m| Reach { from_m: x_m, to_m: x_m }),
            ..pinged(5.0, 1.0)
        };
        let mut frontier = HeadFrontier(None);
        note_reach(&mut frontier, &ping(1, None));
        assert_eq!(frontier.0, None);
        note_reach(&mut frontier, &ping(2, Some(5.0)));
        note_reach(&mut frontier, &ping(9, None));
        let expected = HeadReach::after(None, at(9), Reach { from_m: 5.0, to_m: 5.0 });
        assert_eq!(frontier.0, Some(expected), "heard at 9 s, with the reach of 2 s");
        note_reach(&mut frontier, &ping(10, Some(6.0)));
        assert_eq!(frontier.0.map(|reach| reach.latest()), Some(Reach { from_m: 6.0, to_m: 6.0 }));
    }
}
