//! Decision whether the cable counter and the estimate agree.
//!
//! A counter may stick, slip or run free, and an estimate may drift. During a disagreement both hypotheses are kept:
//! readings are withheld, the inertial unit carries the chainage, and the chainage is as uncertain as the difference
//! between both. Derivation: `docs/why/navigation.md`, "When cable and estimate disagree".

use serde::{Deserialize, Serialize};

use super::corrections::Corrections;
use headrace_geometry::math;
use headrace_geometry::time::{DurNs, MonoNs};
use headrace_sensor::reading::SourceId;

/// Averaging time of innovations, s.
const RECENT_S: f64 = 1.0;
/// Mean innovation, in its standard deviations, at which a dispute begins.
///
/// From 3 to 6 the number of silent seeded dives is about the same. With 4, slack of seven times the declared size
/// disputes a sound counter.
const DISPUTED_SDS: f64 = 5.0;
/// Limit in standard deviations at which each innovation is clipped.
const MOST_SDS: f64 = 6.0;
/// Smallest innovation that begins a dispute, m.
const LEAST_M: f64 = 0.01;
/// A counter on a lively cable is stuck when its count has not changed for this time.
const STANDS_FOR: DurNs = DurNs(2_000_000_000);
/// Least difference between two counts, m.
const SAME_COUNT_M: f64 = 1e-6;
/// Time after which a dispute is reported, and time over which agreement ends it.
const NOTICED_AFTER: DurNs = DurNs(1_000_000_000);
const RETURNED_AFTER: DurNs = DurNs(500_000_000);
/// Maximum sd of the innovation at which an agreeing reading rules out a loss, m.
const SURE_M: f64 = 0.3;
/// Tolerance of such a reading: a share of the vehicle's distance meanwhile, and a length, m.
const MISSING_SHARE: f64 = 0.1;
const MISSING_M: f64 = 0.02;
/// Tolerance within which a counter runs as the vehicle does: a share of its distance, and a length, m.
///
/// The agreement must last for the time and the distance below.
const SAME_SHARE: f64 = 0.1;
const SAME_M: f64 = 0.01;
/// Additional share while the vehicle's own distance is uncertain.
const UNSURE_SHARE: f64 = 0.3;
const RUNS_FOR: DurNs = DurNs(1_000_000_000);
const RUNS_M: f64 = 0.05;
/// Difference of the hypotheses at which the estimate is given up, m, innovation sd included.
///
/// The counter must also have run by `ALIVE_M` meanwhile to count as alive.
const LOST_M: f64 = 1.0;
const ALIVE_M: f64 = 0.1;

/// A dispute between counter and estimate.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct CableDoubt {
    /// Time at which the readings left the expected range.
    pub since: MonoNs,
    /// Expected chainage at that time, m.
    pub from_m: f64,
    /// Largest difference so far between the counter and the other source, m.
    pub differs_m: f64,
    /// Velocity log that it differs from; `None` for the estimate, which the inertial unit carries.
    pub log: Option<SourceId>,
}

/// A cable reading compared with the estimate.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct CableReading {
    /// Time of validity.
    pub at: MonoNs,
    /// Chainage shown, m.
    pub shown_m: f64,
    /// Shown less expected, m.
    pub off_m: f64,
    /// Standard deviation of `off_m`, m.
    pub sd_m: f64,
    /// Whether it is within the gate.
    pub agrees: bool,
    /// Whether it agrees with the inertial unit's motion as well as usual.
    pub is_usual: bool,
    /// Whether slack moves the counter in steps all the time.
    pub is_lively: bool,
}

impl CableReading {
    fn expected_m(&self) -> f64 {
        self.shown_m - self.off_m
    }
}

/// Decision about a reading.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Use {
    /// Fuse it.
    Fuse,
    /// Ignore it.
    Withhold,
    /// Ignore readings from now on, and revert the corrections by the last ones.
    ///
    /// The values are the corrections of chainage and speed, m and m/s.
    Dispute([f64; 2]),
    /// The counter runs correctly again and has lost or gained this length meanwhile, m: shown less expected.
    Slipped(f64),
    /// Give up the estimate and restart from the running counter, which may be off by this much, m.
    Seek(f64),
}

/// State of the comparison between cable counter and estimate.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Cable {
    /// The last reading.
    last: Option<CableReading>,
    /// The last reading whose count differs from the one before.
    changed: Option<CableReading>,
    /// The first of successive readings beyond the gate.
    left: Option<CableReading>,
    /// Recent effect of the counter's readings on the estimate.
    pub corrections: Corrections,
    /// Running mean of the innovations, in standard deviations.
    mean_sds: f64,
    dispute: Option<Dispute>,
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
struct Dispute {
    /// The first reading that was withheld.
    first: CableReading,
    /// Reading since which the counter runs as the vehicle does.
    same_from: CableReading,
    /// Time since which readings agree again.
    agreeing_from: Option<MonoNs>,
    /// Counter reading when the estimate was lost, m.
    lost_from_m: Option<f64>,
    /// Longest distance since, by counter or estimate, and the largest difference, m.
    longest_m: f64,
    most_m: f64,
}

impl Cable {
    /// Returns the dispute, once it has lasted long enough.
    pub fn doubt(&self, now: MonoNs) -> Option<CableDoubt> {
        let Dispute { first, most_m: differs_m, .. } = self.dispute?;
        let has_lasted = now.since(first.at).0 >= NOTICED_AFTER.0;
        has_lasted.then(|| CableDoubt { since: first.at, from_m: first.expected_m(), differs_m, log: None })
    }

    /// Difference between the hypotheses, m; 0 while counter and estimate agree and the count changes.
    pub fn differs_m(&self) -> f64 {
        let disagrees = self.dispute.is_some() || self.left.is_some();
        let off_m = self.last.filter(|_| disagrees).map_or(0.0, |last| last.off_m);
        math::hypot(off_m, self.corrections.lost_m())
    }

    /// Processes a reading and decides what to do with it.
    pub fn take(&mut self, reading: &CableReading) -> Use {
        let before = self.last.replace(*reading);
        if let Some(dispute) = &mut self.dispute {
            let used = dispute.take(reading);
            if used != Use::Withhold {
                *self = Self { last: Some(*reading), ..Self::default() };
            }
            return used;
        }
        let dt_s = before.map_or(0.0, |before| reading.at.since(before.at).as_secs_f64()).max(0.0);
        let left = math::exp(-dt_s / RECENT_S);
        let is_same = before.is_some_and(|before| (before.shown_m - reading.shown_m).abs() <= SAME_COUNT_M);
        self.corrections.pass(dt_s, is_same);
        let off_sds = (reading.off_m / reading.sd_m).clamp(-MOST_SDS, MOST_SDS);
        self.mean_sds = left * self.mean_sds + (1.0 - left) * off_sds;
        // Standard deviation of the running mean of white innovations.
        let is_apart = self.mean_sds.abs() > DISPUTED_SDS * math::sqrt((1.0 - left) / (1.0 + left));
        if let Some(first) = self.goes_wrong(reading, is_apart) {
            self.dispute = Some(Dispute::between(first, reading));
            return Use::Dispute(self.corrections.take_back());
        }
        if reading.agrees { Use::Fuse } else { Use::Withhold }
    }

    /// Returns the first of the readings that show a disagreement between counter and estimate.
    ///
    /// `None` without one.
    fn goes_wrong(&mut self, reading: &CableReading, is_apart: bool) -> Option<CableReading> {
        let lasts = |since: &CableReading, time: DurNs| reading.at.since(since.at).0 >= time.0;
        let changed = *self.changed.get_or_insert(*reading);
        if (changed.shown_m - reading.shown_m).abs() > SAME_COUNT_M {
            self.changed = Some(*reading);
        }
        // Slack that moves a counter in steps all the time does not stop at once; a stuck wheel does.
        if reading.is_lively && lasts(&changed, STANDS_FOR) {
            return Some(changed);
        }
        let first = if reading.agrees { *reading } else { *self.left.get_or_insert(*reading) };
        if reading.agrees {
            self.left = None;
        }
        // An uncertain estimate needs the counter.
        let is_unusual = !reading.is_usual && reading.sd_m <= SURE_M;
        let disagrees = is_unusual || is_apart && reading.off_m.abs() > LEAST_M;
        disagrees.then_some(first)
    }
}

impl Dispute {
    /// Starts a dispute at the first reading that disagreed.
    fn between(first: CableReading, reading: &CableReading) -> Self {
        Self {
            first,
            same_from: *reading,
            agreeing_from: None,
            lost_from_m: None,
            longest_m: way_m(&first, reading),
            most_m: reading.off_m.abs(),
        }
    }

    fn take(&mut self, reading: &CableReading) -> Use {
        self.longest_m = self.longest_m.max(way_m(&self.first, reading));
        self.most_m = self.most_m.max(reading.off_m.abs());
        let for_at_least = |since: MonoNs, time: DurNs| reading.at.since(since).0 >= time.0;
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
        if (reading.off_m - self.same_from.off_m).abs() > SAME_M + SAME_SHARE * moved_m + unsure_m {
            self.same_from = *reading;
        }
        if moved_m >= RUNS_M && for_at_least(self.same_from.at, RUNS_FOR) {
            return Use::Slipped(reading.off_m);
        }
        let apart_m = math::hypot(reading.sd_m, reading.off_m);
        if apart_m > LOST_M {
            let from_m = *self.lost_from_m.get_or_insert(reading.shown_m);
            if (reading.shown_m - from_m).abs() >= ALIVE_M && self.same_from.at == reading.at {
                return Use::Seek(self.longest_m.max(apart_m));
            }
        }
        Use::Withhold
    }

    /// Whether the counter shows most of the distance that the vehicle has travelled meanwhile.
    ///
    /// The gate alone would accept a counter that is still stuck, once the estimate is uncertain enough.
    fn has_caught_up(&self, reading: &CableReading) -> bool {
        let way_m = (reading.expected_m() - self.first.expected_m()).abs();
        reading.off_m.abs() <= MISSING_SHARE * way_m + MISSING_M
    }
}

/// Distance between two readings, m: the longer of counter and estimate.
fn way_m(first: &CableReading, reading: &CableReading) -> f64 {
    let expected_m = (reading.expected_m() - first.expected_m()).abs();
    expected_m.max((reading.shown_m - first.shown_m).abs())
}

#[cfg(test)]
mod tests {
    use super::*;

    const START: MonoNs = MonoNs(1_000_000_000);

    /// A reading at time `t`, s, of a counter that is off by `off_m`; the gate is 3 standard deviations.
    fn reading(t: f64, shown_m: f64, off_m: f64, sd_m: f64) -> CableReading {
        let at = START + DurNs::from_secs_f64(t);
        let agrees = off_m.abs() <= 3.0 * sd_m;
        CableReading { at, shown_m, off_m, sd_m, agrees, is_usual: true, is_lively: false }
    }

    /// Returns when a dispute begins, s, if the counter shows only a share of the distance at 0.1 m/s from 10 s on.
    fn disputed_at(share: f64, change: impl Fn(f64, &mut CableReading)) -> Option<f64> {
        let mut cable = Cable::default();
        (0..200).map(|k| f64::from(k) / 10.0).find(|t| {
            let off_m = (share - 1.0) * 0.1 * (t - 10.0).max(0.0);
            let mut reading = reading(*t, 7.0 + 0.1 * t + off_m, off_m, 0.005);
            change(*t, &mut reading);
            matches!(cable.take(&reading), Use::Dispute(_))
        })
    }

    #[test]
    fn stuck_or_slipping_counter_is_disputed_within_2_s() {
        for (share, within_s) in [(0.0, 1.0), (0.4, 1.5), (-1.0, 0.8), (0.85, 4.0)] {
            let at_s = disputed_at(share, |_, _| {}).unwrap();
            assert!((10.1..10.0 + within_s).contains(&at_s), "{share}: {at_s}");
        }
        assert_eq!(disputed_at(1.0, |_, _| {}), None);
    }

    /// White innovations have a mean of 0.22 over a second. Innovations of 1.5 reach five times that after 1.4 s, and
    /// those of 1 never do.
    #[test]
    fn biased_innovations_begin_a_dispute() {
        let off = |sds: f64, sd_m: f64| {
            disputed_at(1.0, |t, reading| {
                (reading.off_m, reading.sd_m) = (if t < 3.0 { 0.0 } else { sds * sd_m }, sd_m);
            })
        };
        for (sds, at_s) in [(1.5, 4.4), (-1.5, 4.4), (6.0, 3.2)] {
            let found_s = off(sds, 0.01).unwrap();
            assert!((found_s - at_s).abs() < 0.11, "{sds}: {found_s}");
        }
        assert_eq!(off(1.0, 0.01), None);
        assert_eq!(off(3.0, 0.001), None, "too little to matter");
        let both_sides = disputed_at(1.0, |t, reading| {
            reading.off_m = if math::round_to_i64(10.0 * t) % 2 == 0 { 0.015 } else { -0.015 };
        });
        assert_eq!(both_sides, None);
    }

    #[test]
    fn unusual_motion_begins_a_dispute_within_the_gate() {
        let at_s = disputed_at(1.0, |t, reading| reading.is_usual = t < 4.0).unwrap();
        assert!((at_s - 4.0).abs() < 1e-9, "{at_s}");
    }

    #[test]
    fn stationary_counter_is_disputed_only_on_a_lively_cable() {
        let stands = |is_lively: bool| {
            move |t: f64, reading: &mut CableReading| {
                reading.shown_m = if t < 6.0 { reading.shown_m } else { 7.6 };
                reading.is_lively = is_lively;
            }
        };
        let at_s = disputed_at(1.0, stands(true)).unwrap();
        assert!((at_s - 8.0).abs() < 1e-9, "{at_s}");
        assert_eq!(disputed_at(1.0, stands(false)), None);
    }

    #[test]
    fn dispute_reverts_the_last_second_of_a_stationary_count() {
        let mut cable = Cable::default();
        for k in 0..100_u32 {
            assert_eq!(cable.take(&reading(f64::from(k) / 10.0, 7.0, 0.0, 0.005)), Use::Fuse);
            cable.corrections.note([0.001, 0.0], [0.0; 2]);
        }
        assert!((cable.differs_m() - 0.3 * 0.099).abs() < 1e-9, "{}", cable.differs_m());
        let unusual = CableReading { is_usual: false, ..reading(10.0, 7.0, 0.0, 0.005) };
        let Use::Dispute([way_m, _]) = cable.take(&unusual) else { panic!("no dispute") };
        // A sum that decays over a second: 1 / (e^0.1 - 1) corrections.
        assert!((way_m - 0.001 / (math::exp(0.1) - 1.0)).abs() < 1e-6, "{way_m}");
    }

    #[test]
    fn position_sd_is_the_difference_of_counter_and_estimate() {
        let mut cable = Cable::default();
        assert_eq!(cable.take(&reading(0.0, 7.0, 0.01, 0.005)), Use::Fuse);
        assert_eq!(cable.differs_m().to_bits(), 0.0_f64.to_bits());
        for (t, off_m) in [(0.1, -0.02), (0.7, -0.4), (0.8, -0.5)] {
            cable.take(&reading(t, 7.0, off_m, 0.005));
            assert!((cable.differs_m() + off_m).abs() < 1e-12, "{t}");
        }
        assert_eq!(
            cable.doubt(START + DurNs::from_secs_f64(1.0)),
            None,
            "a dispute shorter than a second is no doubt"
        );
        let doubt = cable.doubt(START + DurNs::from_secs_f64(1.2)).unwrap();
        assert!((doubt.from_m - 7.02).abs() < 1e-12 && (doubt.differs_m - 0.5).abs() < 1e-12, "{doubt:?}");
    }

    /// Returns when and how the dispute of a counter that was off by -0.4 m ends, s.
    ///
    /// The vehicle moves at `speed_mps`, the counter shows `share` of that, and `sd_m` is uncertain.
    fn ends(share: f64, speed_mps: f64, sd_m: f64) -> Option<(f64, Use)> {
        let reading = |t: f64| {
            let (expected_m, shown_m) = (7.0 + speed_mps * t, 6.6 + share * speed_mps * t);
            CableReading { agrees: false, ..reading(t, shown_m, shown_m - expected_m, sd_m) }
        };
        let mut dispute = Dispute::between(reading(0.0), &reading(0.0));
        let times = (1..200).map(|k| f64::from(k) / 10.0);
        times.map(|t| (t, dispute.take(&reading(t)))).find(|(_, used)| *used != Use::Withhold)
    }

    /// The tolerance is a tenth of the distance plus a centimetre, and four tenths while the vehicle's distance is
    /// uncertain.
    #[test]
    fn dispute_ends_as_slip_once_the_counter_runs_correctly() {
        for (share, speed_mps, sd_m, at_s, lost_m) in [
            (1.0, 0.1, 0.0, 1.0, -0.4),
            (1.0, 0.2, 0.0, 1.0, -0.4),
            (0.95, 0.1, 0.0, 1.0, -0.405),
            (0.8, 0.1, 0.5, 1.0, -0.42),
            (1.3, 0.1, 0.5, 1.0, -0.37),
            // Over five centimetres.
            (1.0, 0.03, 0.0, 1.7, -0.4),
        ] {
            let Some((found_s, Use::Slipped(found_m))) = ends(share, speed_mps, sd_m) else {
                panic!("{share} {speed_mps} {sd_m}");
            };
            assert!((found_s - at_s).abs() < 1e-6 && (found_m - lost_m).abs() < 1e-6, "{found_s} {found_m}");
        }
        // A stationary counter does not end it either, since the vehicle may be moving.
        for (share, speed_mps) in [(0.0, 0.02), (1.0, 0.0)] {
            assert_eq!(ends(share, speed_mps, 0.0), None, "{share} {speed_mps}");
        }
    }

    /// Beyond a metre, the estimate is given up if the counter runs, and kept if the counter is stationary.
    #[test]
    fn lost_estimate_restarts_from_a_running_counter() {
        let (_, used) = ends(2.0, 0.3, 1.1).unwrap();
        let Use::Seek(lacking_m) = used else { panic!("{used:?}") };
        assert!(lacking_m > 1.1, "{lacking_m}");
        assert_eq!(ends(0.0, 0.03, 1.1), None, "the counter is stationary");
    }
}
