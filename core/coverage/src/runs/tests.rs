use proptest::prelude::*;

use super::*;

const COUNT: i64 = 60;

/// Missed stretches under test, and the states of the sections that they must match.
struct Rig {
    runs: Runs,
    failing: Vec<Option<Failing>>,
    holes: Vec<f64>,
    changes: Vec<(RunId, RunChange)>,
}

impl Rig {
    fn new() -> Self {
        let count = usize::try_from(COUNT).unwrap();
        Self {
            runs: Runs::new(-5, count, 0.25),
            failing: vec![None; count],
            holes: vec![0.0; count],
            changes: Vec::new(),
        }
    }

    fn say(&mut self, section: i64, cause: Option<Cause>, diameter_m: f64) {
        self.say_all(section, cause.map(Causes::of), diameter_m);
    }

    fn say_all(&mut self, section: i64, causes: Option<Causes>, diameter_m: f64) {
        let slot = usize::try_from(section + 5).unwrap();
        // In this test, no speed helps against holes of a metre or more.
        let again_mps = if diameter_m < 1.0 { 0.1 * diameter_m } else { 0.0 };
        let failing = causes.map(|causes| Failing { causes, again_mps });
        (self.failing[slot], self.holes[slot]) = (failing, diameter_m);
        let Self { runs, holes, changes, .. } = self;
        let hole = |index: i64| {
            let diameter_m = *holes.get(usize::try_from(index + 5).ok()?)?;
            Some(Hole {
                diameter_m,
                least_m: diameter_m,
                most_m: diameter_m,
                x_m: 0.0,
                arc_m: 0.0,
                bounded: true,
            })
        };
        let mut tell = |id, change| changes.push((id, change));
        runs.set(section, failing, &mut RunUpdate { at: MonoNs(1), hole: &hole, tell: &mut tell });
    }

    /// Checks every missed stretch that is not cleared against the states of its sections.
    fn check(&self) {
        let failing = |index: i64| self.failing[usize::try_from(index + 5).unwrap()];
        let causes = |index: i64| failing(index).map(|failing| failing.causes);
        let indexes = || -5..COUNT - 5;
        for index in indexes() {
            let run = self.runs.of(index).map(|id| self.runs.get(id).unwrap());
            assert_eq!(run.is_some(), causes(index).is_some(), "section {index}");
            assert!(run.is_none_or(|run| (run.from..run.to).contains(&index)));
        }
        for (number, run) in (0..).zip(self.runs.all()) {
            let members: Vec<_> =
                indexes().filter(|index| self.runs.of(*index) == Some(RunId(number))).collect();
            assert_eq!(members.len(), run.failed as usize);
            assert_eq!(run.cleared.is_some(), members.is_empty());
            let (Some(first), Some(last)) = (members.first(), members.last()) else { continue };
            assert_eq!((run.from, run.to), (*first, *last + 1));
            assert!(
                members.windows(2).all(|pair| pair[1] - pair[0] <= 3),
                "run {number} has a gap that is too wide"
            );
            let largest = members
                .iter()
                .map(|index| self.holes[usize::try_from(index + 5).unwrap()])
                .fold(0.0, f64::max);
            assert!((run.worst.1.diameter_m - largest).abs() < 1e-12);
            for other in last + 1..=(last + 3).min(COUNT - 6) {
                assert!(self.runs.of(other).is_none(), "run {number} must include its neighbour");
            }
            let having =
                |cause: Cause| members.iter().filter(|index| causes(**index).unwrap().has(cause)).count();
            let speeds = || members.iter().map(|index| failing(*index).unwrap().again_mps);
            let mended = speeds().filter(|mps| *mps > 0.0);
            let least_mps = mended.clone().reduce(f64::min).filter(|_| 2 * mended.count() >= members.len());
            let missing = |index: &&i64| causes(**index).unwrap().has(Cause::MissingReturns);
            let beyond =
                members.iter().filter(missing).filter(|index| failing(**index).unwrap().again_mps <= 0.0);
            let beyond = beyond.count();
            assert_eq!(
                run.again(),
                Again {
                    at_most_mps: least_mps.unwrap_or(0.0),
                    is_beyond_speed: beyond > 0 && 10 * beyond >= members.len()
                }
            );
            for cause in Cause::ALL {
                assert_eq!(run.count(cause) as usize, having(cause));
                assert!(having(run.cause) >= having(cause), "{cause:?} is more frequent in run {number}");
            }
        }
    }
}

#[test]
fn missed_stretches_grow_merge_and_are_cleared() {
    let mut rig = Rig::new();
    rig.say(10, Some(Cause::TooFast), 1.0);
    rig.say(11, Some(Cause::TooFast), 1.5);
    rig.say(16, Some(Cause::TooFast), 1.2);
    // Section 14 is within half a metre of both missed stretches.
    rig.say(14, Some(Cause::Phase), 1.1);
    let first = *rig.runs.get(RunId(0)).unwrap();
    assert_eq!((first.from, first.to, first.failed, first.worst.0), (10, 17, 4, 11));
    assert_eq!(rig.runs.get(RunId(1)).unwrap().merged_into, Some(RunId(0)));
    // Sections 7 and 19 are just near enough to join the missed stretch. Sections 6 and 20 are not.
    assert_eq!([6, 7, 19, 20].map(|section| rig.runs.is_beyond(&first, section)), [true, false, false, true]);
    for section in [10, 11, 14, 16] {
        rig.say(section, None, 0.2);
    }
    assert!(rig.changes.contains(&(RunId(0), RunChange::Cleared)));
    rig.check();
}

#[test]
fn most_frequent_cause_of_a_missed_stretch_is_its_main_cause() {
    let mut rig = Rig::new();
    let run = |rig: &Rig| *rig.runs.get(RunId(0)).unwrap();
    rig.say(0, Some(Cause::Occluded), 1.0);
    rig.say(1, Some(Cause::TooFast), 1.0);
    assert_eq!(run(&rig).cause, Cause::Occluded, "the first of two equally frequent causes");
    rig.say_all(2, Some(Causes::of(Cause::TooFast).with(Cause::Phase)), 1.0);
    assert_eq!(run(&rig).cause, Cause::TooFast);
    assert_eq!(run(&rig).causes(), [Cause::TooFast, Cause::Phase, Cause::Occluded]);
    assert_eq!(run(&rig).named(), Causes::of(Cause::TooFast).with(Cause::Phase));
    for section in 3..22 {
        rig.say(section, Some(Cause::TooFast), 1.0);
    }
    assert_eq!(run(&rig).named(), Causes::of(Cause::TooFast), "a cause of one section in 22 isn't named");
    // All failed sections except the first are judged again, now with another cause.
    for section in 1..22 {
        rig.say(section, Some(Cause::HeadSilent), 1.0);
    }
    assert_eq!(run(&rig).causes(), [Cause::HeadSilent, Cause::Occluded]);
    rig.check();
}

#[test]
fn missed_stretch_splits_when_its_middle_sections_pass_and_the_first_part_keeps_the_number() {
    let mut rig = Rig::new();
    for section in 0..9 {
        rig.say(section, Some(Cause::MissingReturns), 0.6 + 0.1 * section as f64);
    }
    for section in 3..6 {
        rig.say(section, None, 0.1);
    }
    let (first, second) = (*rig.runs.get(RunId(0)).unwrap(), *rig.runs.get(RunId(1)).unwrap());
    assert_eq!((first.from, first.to, second.from, second.to), (0, 3, 6, 9));
    assert!((first.worst.1.diameter_m - 0.8).abs() < 1e-12 && second.raised == MonoNs(1));
    rig.check();
}

proptest! {
    /// After any sequence of updates, missed stretches match the states of the sections.
    #[test]
    fn missed_stretches_match_the_section_states(
        said in proptest::collection::vec((-5..COUNT - 5, 0_u8..4, 0.1_f64..3.0), 1..300),
    ) {
        let mut rig = Rig::new();
        for (section, cause, diameter_m) in said {
            let both = Causes::of(Cause::TooFast).with(Cause::Phase);
            let lost = Causes::of(Cause::MissingReturns);
            let causes = [None, Some(Causes::of(Cause::TooFast)), Some(both), Some(lost)];
            rig.say_all(section, causes[usize::from(cause)], diameter_m);
        }
        // Many changes may use up the numbers of missed stretches. Then some sections belong to none.
        if rig.runs.all().len() < usize::try_from(COUNT).unwrap() {
            rig.check();
        }
    }
}
