//! Counts pings by their outcome.

use crate::messages::{Outcome, PlacedPing};
use crate::resources::Tally;
use headrace_coverage::Loss;

/// Counts a ping. If it has a return, the return is counted once it has been classified.
pub(super) fn count(tally: &mut Tally, ping: &PlacedPing) {
    tally.without_fix += u64::from(ping.fix.is_none());
    match ping.outcome {
        Outcome::Sample { .. } => {}
        Outcome::Lost(Loss::Missing, _) => tally.missing += 1,
        Outcome::Lost(Loss::OutOfRange, _) => tally.out_of_range += 1,
        Outcome::Lost(Loss::Occluded, _) => tally.occluded += 1,
        Outcome::Unplaced(why) => {
            tally.unplaced += 1;
            if let Some(count) = tally.no_fix.get_mut(why as usize) {
                *count += 1;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::{heard, pinged};
    use headrace_fusion::NoFix;

    #[test]
    fn every_ping_is_counted_once_under_its_outcome() {
        let mut tally = Tally::default();
        let of = |outcome: Outcome, has_fix: bool| {
            let ping = pinged(5.1, 1.0);
            PlacedPing { outcome, fix: ping.fix.filter(|_| has_fix), ..ping }
        };
        let pings = [
            heard(5.1, 1.0, 3.0),
            of(Outcome::Lost(Loss::Missing, None), true),
            of(Outcome::Lost(Loss::Missing, None), false),
            of(Outcome::Lost(Loss::OutOfRange, None), true),
            of(Outcome::Lost(Loss::Occluded, None), true),
            of(Outcome::Lost(Loss::Occluded, None), true),
            of(Outcome::Lost(Loss::Occluded, None), true),
            of(Outcome::Unplaced(NoFix::Chainage), false),
            of(Outcome::Unplaced(NoFix::Section), false),
            of(Outcome::Unplaced(NoFix::Section), false),
        ];
        for ping in pings {
            count(&mut tally, &ping);
        }
        let expected = Tally {
            missing: 2,
            out_of_range: 1,
            occluded: 3,
            unplaced: 3,
            no_fix: [0, 1, 2],
            without_fix: 4,
            ..Tally::default()
        };
        assert_eq!(tally, expected, "a return is counted once it is classified");
    }
}
