//! Whether the cable counter is believed.
//!
//! A counter sticks, slips or runs free where the vehicle goes on. Its readings then leave what the inertial unit expects;
//! they are withheld, and the inertial unit alone carries the chainage, less surely by the second. Derivation:
//! `docs/fusion.md`, "A cable that isn't believed".

use serde::{Deserialize, Serialize};

use headrace_geometry::time::{DurNs, MonoNs};

/// Time beyond the gate, and standard deviations, after which a counter isn't believed.
const DOUBTED_AFTER: DurNs = DurNs(500_000_000);
const DOUBTED_SDS: f64 = 6.0;
/// Time over which its rate is meaned, s; the least that counts, m/s, and how steady it must stay for the fault to be the
/// inertial unit's: its rate, and its reading at the beginning.
const RATE_MEMORY_S: f64 = 2.0;
const RUNS_MPS: f64 = 0.03;
const STEADY_SHARE: f64 = 0.25;
const JUMPS_M: f64 = 0.05;
/// A counter that leaves again within this time isn't one that has slipped once.
const AGAIN: DurNs = DurNs(120_000_000_000);
/// Time over which a disagreement, or an agreement, counts.
const NOTICED_AFTER: DurNs = DurNs(1_000_000_000);
const RETURNED_AFTER: DurNs = DurNs(500_000_000);
/// Standard deviation of the innovation up to which a reading that agrees again says that nothing was lost, m.
const SURE_M: f64 = 0.3;
/// Share of the vehicle's way meanwhile, and length, that such a reading may lack.
const MISSING_SHARE: f64 = 0.1;
const MISSING_M: f64 = 0.02;
/// A counter that runs as the vehicle does: within a tenth of its way and this, over so long and so far. Without moving, over
/// the longer time.
const SAME_SHARE: f64 = 0.1;
const SAME_M: f64 = 0.01;
/// Further share of its way by which the vehicle's may differ where that is uncertain.
const UNSURE_SHARE: f64 = 0.3;
const RUNS_FOR: DurNs = DurNs(1_000_000_000);
const RUNS_M: f64 = 0.05;
const STANDS_FOR: DurNs = DurNs(5_000_000_000);
/// Standard deviation of the innovation beyond which inertial data no longer judge the counter, m, and how far it must run
/// then to be alive.
const BLIND_M: f64 = 1.0;
const ALIVE_M: f64 = 0.1;
/// Share of the way made in doubt that may be the inertial unit's fault, as a standard deviation.
const DOUBTED_SHARE: f64 = 0.5;

/// A counter in doubt.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct CableDoubt {
    /// When its readings left what was expected.
    pub since: MonoNs,
    /// Chainage expected then, m.
    pub from_m: f64,
    /// Way since, the longer by the counter and by the estimate, m.
    pub way_m: f64,
}

/// A reading against the estimate.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct CableReading {
    /// Time of validity.
    pub at: MonoNs,
    /// Chainage shown, m.
    pub shown_m: f64,
    /// Shown less expected, m.
    pub off_m: f64,
    /// Standard deviation of that, m.
    pub sd_m: f64,
    /// Whether it is within the gate.
    pub agrees: bool,
}

/// What a counter has lost or gained.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Slip {
    /// Shown less expected, m.
    pub lost_m: f64,
    /// Standard deviation of the part that may be the inertial unit's fault, m.
    pub doubted_m: f64,
}

impl CableReading {
    fn expected_m(&self) -> f64 {
        self.shown_m - self.off_m
    }
}

/// What to do with a reading.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Use {
    /// Fuse it.
    Fuse,
    /// Don't.
    Withhold,
    /// Don't from now on: the counter's rate has changed by so much, m/s, and readings just before may have misled the speed.
    Left(f64),
    /// The counter runs truly again.
    Slipped(Slip),
    /// The counter runs on as before: it is the inertial unit that is wrong.
    Unsteady,
    /// The counter leaves time and again: the cable hangs loose, or is handled in bursts, by this much, m.
    Loose(f64),
    /// The chainage is lost, and the counter runs: begin anew with what it shows, which may lack this much, m.
    Seek(f64),
}

/// See the module's description.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Cable {
    /// The last reading, and the rate at which it has been running, m/s.
    last: Option<CableReading>,
    rate_mps: f64,
    /// The first of successive readings beyond the gate.
    left: Option<CableReading>,
    doubt: Option<Doubt>,
    /// The last doubt.
    before: Option<Over>,
}

/// A doubt that is over.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
struct Over {
    at: MonoNs,
    /// How far readings were off, and what the counter was found to have lost or gained, m.
    most_m: f64,
    lost_m: f64,
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
struct Doubt {
    /// The first reading that was withheld.
    first: CableReading,
    /// The rate at which the counter had run before, m/s.
    rate_mps: f64,
    /// The reading from which the counter runs as the vehicle does.
    same_from: CableReading,
    /// When readings began to agree again.
    agreeing_from: Option<MonoNs>,
    /// What it showed when inertial data could no longer judge it, m.
    blind_from_m: Option<f64>,
    /// How far readings have been off, and the longest way since it was doubted, m.
    most_m: f64,
    longest_m: f64,
}

impl Cable {
    /// The doubt, once it has lasted.
    pub fn doubt(&self, now: MonoNs) -> Option<CableDoubt> {
        let Doubt { first, longest_m, .. } = self.doubt?;
        let has_lasted = now.since(first.at).0 >= NOTICED_AFTER.0;
        has_lasted.then(|| CableDoubt { since: first.at, from_m: first.expected_m(), way_m: longest_m })
    }

    /// Takes a reading.
    pub fn take(&mut self, reading: &CableReading) -> Use {
        if let Some(doubt) = &mut self.doubt {
            let used = doubt.take(reading);
            if used != Use::Withhold {
                let lost_m = if let Use::Slipped(slip) = used { slip.lost_m } else { 0.0 };
                let before = Some(Over { at: reading.at, most_m: doubt.most_m, lost_m });
                *self = Self { before, ..Self::default() };
            }
            return used;
        }
        if reading.agrees {
            self.run(reading);
            self.left = None;
            return Use::Fuse;
        }
        // Slack that is larger than usual leaves the gate for a while, too.
        let first = *self.left.get_or_insert(*reading);
        let is_long = reading.at.since(first.at).0 >= DOUBTED_AFTER.0;
        if is_long && reading.off_m.abs() > DOUBTED_SDS * reading.sd_m {
            let before = self.before;
            if let Some(over) = before.filter(|over| over.is_followed_by(&first)) {
                let most_m = over.most_m.max(reading.off_m.abs());
                *self = Self { before: Some(Over { at: reading.at, ..over }), ..Self::default() };
                return Use::Loose(most_m);
            }
            if self.runs_on(&first, reading) {
                *self = Self { before, ..Self::default() };
                return Use::Unsteady;
            }
            self.doubt = Some(Doubt::between(first, reading, self.rate_mps));
            let now_mps = (reading.shown_m - first.shown_m) / reading.at.since(first.at).as_secs_f64();
            return Use::Left((now_mps - self.rate_mps).abs());
        }
        Use::Withhold
    }
}

impl Cable {
    /// Notes the rate at which a counter runs that is believed.
    fn run(&mut self, reading: &CableReading) {
        if let Some(last) = self.last {
            let dt_s = reading.at.since(last.at).as_secs_f64();
            if dt_s > 0.0 {
                let share = (dt_s / RATE_MEMORY_S).min(1.0);
                self.rate_mps += share * ((reading.shown_m - last.shown_m) / dt_s - self.rate_mps);
            }
        }
        self.last = Some(*reading);
    }

    /// Whether it has run as before since the first reading beyond the gate. A counter that begins to stick, slip or run free
    /// changes its rate.
    fn runs_on(&self, first: &CableReading, reading: &CableReading) -> bool {
        let dt_s = reading.at.since(first.at).as_secs_f64();
        let rate_mps = (reading.shown_m - first.shown_m) / dt_s;
        let jumped_m = self.last.map_or(0.0, |last| {
            let between_s = first.at.since(last.at).as_secs_f64();
            (first.shown_m - last.shown_m - self.rate_mps * between_s).abs()
        });
        self.rate_mps.abs() >= RUNS_MPS
            && jumped_m <= JUMPS_M
            && (rate_mps - self.rate_mps).abs() <= STEADY_SHARE * self.rate_mps.abs()
    }
}

impl Over {
    /// Whether the counter leaves too soon after this, and doesn't just take back what it had lost or gained.
    fn is_followed_by(&self, first: &CableReading) -> bool {
        let taken_back_m = (first.off_m + self.lost_m).abs();
        first.at.since(self.at).0 < AGAIN.0 && taken_back_m > SAME_SHARE * self.lost_m.abs() + MISSING_M
    }
}

impl Doubt {
    /// From the first reading beyond the gate to this one, of a counter that had run at this rate, m/s.
    fn between(first: CableReading, reading: &CableReading, rate_mps: f64) -> Self {
        let doubt = Self {
            first,
            rate_mps,
            same_from: *reading,
            agreeing_from: None,
            blind_from_m: None,
            most_m: reading.off_m.abs(),
            longest_m: 0.0,
        };
        Self { longest_m: doubt.way_m(reading), ..doubt }
    }

    fn take(&mut self, reading: &CableReading) -> Use {
        self.most_m = self.most_m.max(reading.off_m.abs());
        self.longest_m = self.longest_m.max(self.way_m(reading));
        let for_at_least = |since: MonoNs, time: DurNs| reading.at.since(since).0 >= time.0;
        if reading.sd_m > BLIND_M {
            let from_m = *self.blind_from_m.get_or_insert(reading.shown_m);
            let is_alive = (reading.shown_m - from_m).abs() >= ALIVE_M;
            return if is_alive { Use::Seek(self.way_m(reading)) } else { Use::Withhold };
        }
        if reading.agrees && reading.sd_m <= SURE_M && self.has_caught_up(reading) {
            let from = *self.agreeing_from.get_or_insert(reading.at);
            if for_at_least(from, RETURNED_AFTER) {
                return Use::Fuse;
            }
        } else {
            self.agreeing_from = None;
        }
        let moved_m = (reading.shown_m - self.same_from.shown_m).abs();
        let unsure_m = reading.sd_m.min(UNSURE_SHARE * moved_m);
        let same_m = SAME_M + SAME_SHARE * moved_m + unsure_m;
        if (reading.off_m - self.same_from.off_m).abs() > same_m {
            self.same_from = *reading;
            return Use::Withhold;
        }
        let runs = moved_m >= RUNS_M && for_at_least(self.same_from.at, RUNS_FOR);
        if runs || for_at_least(self.same_from.at, STANDS_FOR) {
            let doubted_m = DOUBTED_SHARE * self.way_m(reading).min(reading.off_m.abs());
            return Use::Slipped(Slip { lost_m: reading.off_m, doubted_m });
        }
        Use::Withhold
    }

    /// Way since it was doubted, the longest by the counter, by the estimate, and at the rate of before, m.
    fn way_m(&self, reading: &CableReading) -> f64 {
        let expected_m = (reading.expected_m() - self.first.expected_m()).abs();
        let at_rate_m = self.rate_mps.abs() * reading.at.since(self.first.at).as_secs_f64();
        expected_m.max((reading.shown_m - self.first.shown_m).abs()).max(at_rate_m)
    }

    /// Whether it shows most of the way that the vehicle has made meanwhile. The gate alone would let a counter in that still
    /// stands, once the estimate is unsure enough.
    fn has_caught_up(&self, reading: &CableReading) -> bool {
        let way_m = (reading.expected_m() - self.first.expected_m()).abs();
        reading.off_m.abs() <= MISSING_SHARE * way_m + MISSING_M
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Whether a counter that had lost 0.4 m leaves again, so many seconds after, with a reading that is off by this.
    fn leaves_again(after_s: u64, off_m: f64) -> bool {
        let over = Over { at: MonoNs(1_000_000_000_000), most_m: 0.5, lost_m: 0.4 };
        let at = over.at + DurNs(i64::try_from(after_s).unwrap() * 1_000_000_000);
        over.is_followed_by(&CableReading { at, shown_m: 10.0, off_m, sd_m: 0.01, agrees: false })
    }

    /// When a counter is doubted that had run at 0.1 m/s for 10 s and then counts only a share of that, s, and by how much it has left.
    fn left(share: f64) -> (f64, f64) {
        let mut cable = Cable::default();
        for k in 0..140_u32 {
            let t = f64::from(k) / 10.0;
            let at = MonoNs(1_000_000_000) + DurNs::from_secs_f64(t);
            let off_m = (share - 1.0) * 0.1 * (t - 10.0).max(0.0);
            let agrees = off_m > -0.01;
            let used =
                cable.take(&CableReading { at, shown_m: 7.0 + 0.1 * t + off_m, off_m, sd_m: 0.005, agrees });
            match used {
                Use::Left(by_mps) => return (t, by_mps),
                used => assert_eq!(used, if agrees { Use::Fuse } else { Use::Withhold }, "at {t}"),
            }
        }
        panic!("believed for ever");
    }

    /// A counter that sticks or slips is doubted within a second, with what its rate has changed by: that may have misled the filter.
    #[test]
    fn a_counter_has_left_by_what_its_rate_has_changed() {
        for (share, changed_mps, within_s) in [(0.0, 0.1, 1.0), (0.4, 0.06, 1.5), (-1.0, 0.2, 0.8)] {
            let (at_s, by_mps) = left(share);
            assert!((by_mps - changed_mps).abs() < 0.012, "{share}: {by_mps}");
            assert!((10.5..10.0 + within_s).contains(&at_s), "{share}: {at_s}");
        }
    }

    /// One that leaves soon again hangs loose; one that takes back what it had lost doesn't, nor one that leaves minutes later.
    #[test]
    fn a_counter_leaves_again_soon_and_for_something_else() {
        assert!(leaves_again(10, 0.4) && leaves_again(119, 0.4) && leaves_again(10, -0.2));
        assert!(!leaves_again(121, 0.4) && !leaves_again(3600, 0.4));
        // It takes back 0.4 m, to a tenth of it and 2 cm.
        assert!(!leaves_again(10, -0.4) && !leaves_again(10, -0.45) && !leaves_again(10, -0.35));
        assert!(leaves_again(10, -0.47) && leaves_again(10, -0.33));
    }

    /// What ends the doubt of a counter that was off by -0.4 m, and when, s: while the vehicle goes on at this speed it counts a share of that,
    /// and so much is unsure.
    fn ends(share: f64, speed_mps: f64, sd_m: f64) -> Option<(f64, Use)> {
        let reading = |t: f64| {
            let (expected_m, shown_m) = (7.0 + speed_mps * t, 6.6 + share * speed_mps * t);
            let at = MonoNs(1_000_000_000) + DurNs::from_secs_f64(t);
            CableReading { at, shown_m, off_m: shown_m - expected_m, sd_m, agrees: false }
        };
        let mut doubt = Doubt::between(reading(0.0), &reading(0.0), 0.0);
        let times = (1..200).map(|k| f64::from(k) / 10.0);
        times.map(|t| (t, doubt.take(&reading(t)))).find(|(_, used)| *used != Use::Withhold)
    }

    /// Truly: within a tenth of its way and a centimetre; where the vehicle's way is unsure, within four tenths.
    #[test]
    fn a_counter_has_slipped_once_it_runs_truly_again() {
        let slipped = |share: f64, speed_mps: f64, sd_m: f64| match ends(share, speed_mps, sd_m) {
            Some((at_s, Use::Slipped(slip))) => Some((at_s, slip.lost_m, slip.doubted_m)),
            other => {
                assert_eq!(other, None, "{share} {speed_mps} {sd_m}");
                None
            }
        };
        for (share, speed_mps, sd_m, at_s, lost_m, doubted_m) in [
            // Over a second, half of whose way is in doubt.
            (1.0, 0.1, 0.0, 1.0, -0.4, 0.05),
            (1.0, 0.2, 0.0, 1.0, -0.4, 0.1),
            (0.95, 0.1, 0.0, 1.0, -0.405, 0.05),
            (0.8, 0.1, 0.5, 1.0, -0.42, 0.05),
            (1.3, 0.1, 0.5, 1.0, -0.37, 0.065),
            // Over five centimetres.
            (1.0, 0.03, 0.0, 1.7, -0.4, 0.0255),
            // Both stand, for five seconds.
            (1.0, 0.0, 0.0, 5.0, -0.4, 0.0),
        ] {
            let found = slipped(share, speed_mps, sd_m).unwrap();
            let off = [found.0 - at_s, found.1 - lost_m, found.2 - doubted_m];
            assert!(off.iter().all(|off| off.abs() < 1e-6), "{share} {speed_mps} {sd_m}: {found:?}");
        }
        for (share, speed_mps, sd_m) in [(0.8, 0.1, 0.0), (0.5, 0.1, 0.5), (0.0, 0.1, 0.5), (2.0, 0.1, 0.5)] {
            assert_eq!(slipped(share, speed_mps, sd_m), None, "{share} {sd_m}");
        }
    }

    /// Beyond a metre the inertial unit doesn't know better: a counter that runs by a decimetre is taken for what it shows.
    #[test]
    fn where_nothing_else_is_known_a_counter_that_runs_is_sought() {
        let (at_s, used) = ends(1.0, 0.3, 1.1).unwrap();
        let Use::Seek(lacking_m) = used else { panic!("{used:?}") };
        // From the first such reading, at 0.1 s, on; the way is 0.3 m/s since the doubt began.
        assert!((at_s - 0.5).abs() < 1e-9 && (lacking_m - 0.15).abs() < 1e-9, "{at_s} {lacking_m}");
        assert_eq!(ends(0.0, 0.3, 1.1), None, "it stands");
    }
}
