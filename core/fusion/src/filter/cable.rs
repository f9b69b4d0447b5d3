//! Decides whether cable counter and estimate agree.
//!
//! A counter may stick, slip or run free, and an estimate may drift. During a disagreement, either of them may be
//! wrong. So the counter's readings are withheld, and the inertial unit alone carries the chainage. The difference
//! between counter and estimate serves as the uncertainty of the chainage. Derivation: `docs/why/navigation.md`, "When
//! cable and estimate disagree".

use serde::{Deserialize, Serialize};

use super::corrections::CounterCorrections;
use headrace_geometry::math;
use headrace_geometry::time::{DurNs, MonoNs};
use headrace_sensor::reading::SourceId;

/// Averaging time of the cable counter's innovations, s.
const RECENT_S: f64 = 1.0;
/// Mean innovation at which counter and estimate disagree, in units of the sd that the mean would have for white
/// innovations.
///
/// Any limit from 3 to 6 leaves about the same number of seeded dives with an unreported error. With a limit of 4,
/// slack of seven times the declared size makes a sound counter disagree.
const DISPUTED_SDS: f64 = 5.0;
/// Each innovation is clipped at this many standard deviations.
const MOST_SDS: f64 = 6.0;
/// Minimum size of the latest innovation, m. With a smaller one, a mean beyond `DISPUTED_SDS` starts no disagreement.
const LEAST_M: f64 = 0.01;
/// Time without a change of the count that shows a stuck counter, if slack has kept the count changing before.
const STANDS_FOR: DurNs = DurNs(2_000_000_000);
/// Counts that differ by less than this are equal, m.
const SAME_COUNT_M: f64 = 1e-6;
/// A disagreement is reported once it has lasted for `NOTICED_AFTER`. It ends once readings have agreed with the
/// estimate for `RETURNED_AFTER`.
const NOTICED_AFTER: DurNs = DurNs(1_000_000_000);
const RETURNED_AFTER: DurNs = DurNs(500_000_000);
/// Maximum sd of an innovation, m, at which agreement with the estimate proves that the counter has lost no length.
const SURE_M: f64 = 0.3;
/// Largest remaining difference between a counter that has caught up and the estimate: `MISSING_SHARE` of the distance
/// travelled since the disagreement began, plus `MISSING_M`.
const MISSING_SHARE: f64 = 0.1;
const MISSING_M: f64 = 0.02;
/// The counter follows the vehicle if the distances by counter and by estimate differ by at most `SAME_SHARE` of the
/// distance, plus `SAME_M`.
///
/// They must agree for at least the time `RUNS_FOR` and the distance `RUNS_M`.
const SAME_SHARE: f64 = 0.1;
const SAME_M: f64 = 0.01;
/// Share of the distance that is added to `SAME_SHARE` while the estimated distance is uncertain.
const UNSURE_SHARE: f64 = 0.3;
const RUNS_FOR: DurNs = DurNs(1_000_000_000);
const RUNS_M: f64 = 0.05;
/// Difference from the counter beyond which the estimate is given up, m. The difference is the root sum square of the
/// innovation and its sd.
///
/// Since exceeding this limit, the counter must also have counted `ALIVE_M`, which shows that its wheel turns.
const LOST_M: f64 = 1.0;
const ALIVE_M: f64 = 0.1;

/// A disagreement of the cable counter with the estimate or the velocity log.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct CableDoubt {
    /// Time since which the counter disagrees with the estimate or the velocity log.
    pub since: MonoNs,
    /// Chainage at which the disagreement began, m: as the estimate predicted it, or as the counter showed it if a
    /// comparison of distances found the disagreement.
    pub from_m: f64,
    /// Largest difference so far between the counter and the estimate or velocity log, m.
    pub differs_m: f64,
    /// Velocity log that disagrees with the counter; `None` if the estimate disagrees.
    pub log: Option<SourceId>,
}

/// A cable reading compared with the estimate.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct CableReading {
    /// Time of validity of the reading.
    pub at: MonoNs,
    /// Chainage shown by the counter, m.
    pub shown_m: f64,
    /// Shown chainage minus expected chainage, m.
    pub off_m: f64,
    /// Standard deviation of `off_m`, m.
    pub sd_m: f64,
    /// Whether the reading is within the gate.
    pub agrees: bool,
    /// Whether counter and inertial unit differ in their motion by no more than usual.
    pub is_usual: bool,
    /// Whether varying cable slack keeps the count changing by several steps.
    pub is_lively: bool,
}

impl CableReading {
    fn expected_m(&self) -> f64 {
        self.shown_m - self.off_m
    }
}

/// Decision on how to use a cable reading.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Use {
    /// Fuse the cable reading.
    Fuse,
    /// Ignore the cable reading.
    Withhold,
    /// Counter and estimate disagree. Ignore readings from now on, and revert the counter's last corrections.
    ///
    /// The values are the corrections to revert: chainage, m, and speed, m/s.
    Dispute([f64; 2]),
    /// The counter runs correctly again. The value is the chainage that it shows minus the expected chainage, m.
    Slipped(f64),
    /// Give up the estimate and restart from the running counter, which may be wrong by this length, m.
    Seek(f64),
}

/// State of the comparison between cable counter and estimate.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Cable {
    /// The latest cable reading.
    last: Option<CableReading>,
    /// The latest reading whose count differs from the count before it.
    changed: Option<CableReading>,
    /// First reading of the present series of readings beyond the gate.
    left: Option<CableReading>,
    /// Recent corrections of the estimate by the counter's readings.
    pub corrections: CounterCorrections,
    /// Running mean of the cable counter's innovations, in standard deviations.
    mean_sds: f64,
    dispute: Option<Dispute>,
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
struct Dispute {
    /// The first cable reading that was withheld from the filter.
    first: CableReading,
    /// First reading of the present series in which the counter follows the vehicle's motion.
    same_from: CableReading,
    /// Time since which readings agree with the estimate again.
    agreeing_from: Option<MonoNs>,
    /// Counter reading when the difference from the estimate first exceeded `LOST_M`, m.
    lost_from_m: Option<f64>,
    /// `longest_m` is the longest distance since the first withheld reading, by counter or by estimate, m. `most_m` is
    /// the largest difference between counter and estimate since then, m.
    longest_m: f64,
    most_m: f64,
}

impl Cable {
    /// Returns the disagreement of counter and estimate once it has lasted for `NOTICED_AFTER`.
    pub fn doubt(&self, now: MonoNs) -> Option<CableDoubt> {
        let Dispute { first, most_m: differs_m, .. } = self.dispute?;
        let has_lasted = now.since(first.at).0 >= NOTICED_AFTER.0;
        has_lasted.then(|| CableDoubt { since: first.at, from_m: first.expected_m(), differs_m, log: None })
    }

    /// Difference between the chainages by counter and by estimate, m. It is 0 while both agree and the count changes.
    pub fn differs_m(&self) -> f64 {
        let disagrees = self.dispute.is_some() || self.left.is_some();
        let off_m = self.last.filter(|_| disagrees).map_or(0.0, |last| last.off_m);
        math::hypot(off_m, self.corrections.lost_m())
    }

    /// Processes a cable reading and decides whether to fuse it.
    pub fn take(&mut self, reading: &CableReading) -> Use {
        let before = self.last.replace(*reading);
        let is_later = before.is_none_or(|before| before.at <= reading.at);
        debug_assert!(is_later, "cable readings are in order of time: {reading:?} after {before:?}");
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
        // The limit is `DISPUTED_SDS` times the standard deviation that this running mean has for white innovations.
        let is_apart = self.mean_sds.abs() > DISPUTED_SDS * math::sqrt((1.0 - left) / (1.0 + left));
        if let Some(first) = self.goes_wrong(reading, is_apart) {
            self.dispute = Some(Dispute::between(first, reading));
            return Use::Dispute(self.corrections.take_back());
        }
        if reading.agrees { Use::Fuse } else { Use::Withhold }
    }

    /// Returns the reading with which a disagreement between counter and estimate began.
    ///
    /// `None` if counter and estimate agree.
    fn goes_wrong(&mut self, reading: &CableReading, is_apart: bool) -> Option<CableReading> {
        let lasts = |since: &CableReading, time: DurNs| reading.at.since(since.at).0 >= time.0;
        let changed = *self.changed.get_or_insert(*reading);
        if (changed.shown_m - reading.shown_m).abs() > SAME_COUNT_M {
            self.changed = Some(*reading);
        }
        // If slack keeps the count changing, a count that suddenly stops changing means a stuck wheel.
        if reading.is_lively && lasts(&changed, STANDS_FOR) {
            return Some(changed);
        }
        let first = if reading.agrees { *reading } else { *self.left.get_or_insert(*reading) };
        if reading.agrees {
            self.left = None;
        }
        // If the estimate is uncertain, unusual readings start no disagreement, because the estimate needs the
        // counter's readings.
        let is_unusual = !reading.is_usual && reading.sd_m <= SURE_M;
        let disagrees = is_unusual || is_apart && reading.off_m.abs() > LEAST_M;
        disagrees.then_some(first)
    }
}

impl Dispute {
    /// Starts a disagreement whose first withheld reading is `first`.
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

    /// Whether the counter shows most of the distance that the vehicle has travelled since the first withheld
    /// reading.
    ///
    /// The gate alone would accept a counter that is still stuck as soon as the estimate is uncertain enough.
    fn has_caught_up(&self, reading: &CableReading) -> bool {
        let way_m = (reading.expected_m() - self.first.expected_m()).abs();
        reading.off_m.abs() <= MISSING_SHARE * way_m + MISSING_M
    }
}

/// Returns the distance travelled between two readings, m: by counter or by estimate, whichever is longer.
fn way_m(first: &CableReading, reading: &CableReading) -> f64 {
    let expected_m = (reading.expected_m() - first.expected_m()).abs();
    expected_m.max((reading.shown_m - first.shown_m).abs())
}

#[cfg(test)]
mod tests {
    use super::*;

    const START: MonoNs = MonoNs(1_000_000_000);

    /// A reading at time `t`, s, of a counter that shows `off_m` too much. The gate is 3 standard deviations.
    fn reading(t: f64, shown_m: f64, off_m: f64, sd_m: f64) -> CableReading {
        let at = START + DurNs::from_secs_f64(t);
        let agrees = off_m.abs() <= 3.0 * sd_m;
        CableReading { at, shown_m, off_m, sd_m, agrees, is_usual: true, is_lively: false }
    }

    /// Returns the time at which counter and estimate begin to disagree, s. The vehicle moves at 0.1 m/s. From 10 s on,
    /// the counter shows `share` of the motion.
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
    fn stuck_or_slipping_counter_is_detected_within_4_s() {
        for (share, within_s) in [(0.0, 1.0), (0.4, 1.5), (-1.0, 0.8), (0.85, 4.0)] {
            let at_s = disputed_at(share, |_, _| {}).unwrap();
            assert!((10.1..10.0 + within_s).contains(&at_s), "{share}: {at_s}");
        }
        assert_eq!(disputed_at(1.0, |_, _| {}), None);
    }

    /// The running mean of white innovations has a standard deviation of 0.22, in units of an innovation's sd. A
    /// constant innovation of 1.5 sd brings the mean to five times this standard deviation after 1.4 s. A constant
    /// innovation of 1 sd never brings the mean so far.
    #[test]
    fn persistently_biased_innovations_start_a_cable_disagreement() {
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
        assert_eq!(off(3.0, 0.001), None, "a small innovation begins no dispute");
        let both_sides = disputed_at(1.0, |t, reading| {
            reading.off_m = if math::round_to_i64(10.0 * t) % 2 == 0 { 0.015 } else { -0.015 };
        });
        assert_eq!(both_sides, None);
    }

    #[test]
    fn readings_unlike_the_inertial_motion_start_a_cable_disagreement_even_within_the_gate() {
        let at_s = disputed_at(1.0, |t, reading| reading.is_usual = t < 4.0).unwrap();
        assert!((at_s - 4.0).abs() < 1e-9, "{at_s}");
    }

    #[test]
    fn stationary_counter_counts_as_stuck_only_if_cable_slack_varies_strongly() {
        let unchanged = |is_lively: bool| {
            move |t: f64, reading: &mut CableReading| {
                reading.shown_m = if t < 6.0 { reading.shown_m } else { 7.6 };
                reading.is_lively = is_lively;
            }
        };
        let at_s = disputed_at(1.0, unchanged(true)).unwrap();
        assert!((at_s - 8.0).abs() < 1e-9, "{at_s}");
        assert_eq!(disputed_at(1.0, unchanged(false)), None);
    }

    #[test]
    fn cable_disagreement_at_a_constant_count_reverts_the_last_second_of_corrections() {
        let mut cable = Cable::default();
        for k in 0..100_u32 {
            assert_eq!(cable.take(&reading(f64::from(k) / 10.0, 7.0, 0.0, 0.005)), Use::Fuse);
            cable.corrections.note([0.001, 0.0], [0.0; 2]);
        }
        assert!((cable.differs_m() - 0.3 * 0.099).abs() < 1e-9, "{}", cable.differs_m());
        let unusual = CableReading { is_usual: false, ..reading(10.0, 7.0, 0.0, 0.005) };
        let Use::Dispute([way_m, _]) = cable.take(&unusual) else { panic!("no dispute") };
        // The sum gets ten equal corrections a second and decays with a time constant of a second. The sum tends to 1 /
        // (e^0.1 - 1) corrections.
        assert!((way_m - 0.001 / (math::exp(0.1) - 1.0)).abs() < 1e-6, "{way_m}");
    }

    #[test]
    fn cable_disagreement_is_reported_after_1_s_with_the_largest_difference() {
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
            "a dispute shorter than a second is not reported"
        );
        let doubt = cable.doubt(START + DurNs::from_secs_f64(1.2)).unwrap();
        assert!((doubt.from_m - 7.02).abs() < 1e-12 && (doubt.differs_m - 0.5).abs() < 1e-12, "{doubt:?}");
    }

    /// Returns the time at which a disagreement ends, s, and the decision that ends it. At first, the counter shows 0.4
    /// m too little.
    ///
    /// The vehicle moves at `speed_mps`, and the counter shows `share` of this motion. The innovation has the sd
    /// `sd_m`.
    fn ends(share: f64, speed_mps: f64, sd_m: f64) -> Option<(f64, Use)> {
        let reading = |t: f64| {
            let (expected_m, shown_m) = (7.0 + speed_mps * t, 6.6 + share * speed_mps * t);
            CableReading { agrees: false, ..reading(t, shown_m, shown_m - expected_m, sd_m) }
        };
        let mut dispute = Dispute::between(reading(0.0), &reading(0.0));
        let times = (1..200).map(|k| f64::from(k) / 10.0);
        times.map(|t| (t, dispute.take(&reading(t)))).find(|(_, used)| *used != Use::Withhold)
    }

    /// A counter follows the vehicle if their distances differ by at most a tenth plus a centimetre.
    ///
    /// While the estimated distance is uncertain, the tolerance is four tenths plus a centimetre.
    #[test]
    fn counter_counts_as_slipped_once_its_speed_matches_the_vehicle_again() {
        for (share, speed_mps, sd_m, at_s, lost_m) in [
            (1.0, 0.1, 0.0, 1.0, -0.4),
            (1.0, 0.2, 0.0, 1.0, -0.4),
            (0.95, 0.1, 0.0, 1.0, -0.405),
            (0.8, 0.1, 0.5, 1.0, -0.42),
            (1.3, 0.1, 0.5, 1.0, -0.37),
            // At 0.03 m/s, the vehicle needs more than a second to travel 5 cm.
            (1.0, 0.03, 0.0, 1.7, -0.4),
        ] {
            let Some((found_s, Use::Slipped(found_m))) = ends(share, speed_mps, sd_m) else {
                panic!("{share} {speed_mps} {sd_m}");
            };
            assert!((found_s - at_s).abs() < 1e-6 && (found_m - lost_m).abs() < 1e-6, "{found_s} {found_m}");
        }
        // A stationary counter does not end the disagreement, whether the vehicle moves or not.
        for (share, speed_mps) in [(0.0, 0.02), (1.0, 0.0)] {
            assert_eq!(ends(share, speed_mps, 0.0), None, "{share} {speed_mps}");
        }
    }

    /// If counter and estimate differ by over one metre and the counter runs, the estimate is given up. If the
    /// counter is stationary, the estimate is kept.
    #[test]
    fn estimate_off_by_over_1_m_restarts_from_a_running_counter() {
        let (_, used) = ends(2.0, 0.3, 1.1).unwrap();
        let Use::Seek(missing_m) = used else { panic!("{used:?}") };
        assert!(missing_m > 1.1, "{missing_m}");
        assert_eq!(ends(0.0, 0.03, 1.1), None, "the counter is stationary");
    }
}
