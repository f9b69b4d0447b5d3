//! Reordering window that releases readings in order of validity.
//!
//! A reading waits until all readings with an earlier time of validity have arrived.

use serde::{Deserialize, Serialize};

use crate::filter::inertial::InertialSample;
use headrace_geometry::frames::{Body, Vec3};
use headrace_geometry::snapshot::stateful;
use headrace_geometry::time::{DurNs, MonoNs};
use headrace_sensor::reading::Reading;

/// Maximum number of waiting readings. Four heads, four echosounders and all other sensors need a tenth of this number.
const MOST: usize = 1024;
/// Maximum number of waiting samples of inertial units.
const MOST_FELT: usize = 1024;
/// Longest interval for which an inertial sample is valid.
const SPEAKS_FOR: DurNs = DurNs(100_000_000);
/// Samples whose times differ by at most this are merged into their mean.
///
/// So the turn rate and the force of one sample are merged, and so are samples that arrive in one burst. The mean of a
/// burst is valid for the whole time since the sample before the burst.
const SAME: DurNs = DurNs(500_000);

/// A reading that waits in the window.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
pub struct Waiting {
    /// Time of validity of the reading.
    pub at: MonoNs,
    /// Number of the reading's source.
    pub source: usize,
    /// The reading.
    pub reading: Reading,
}

/// Mean of the inertial samples at one time, with the numbers of averaged turn rates and specific forces.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
struct FeltAt {
    at: MonoNs,
    felt: InertialSample,
    counts: [u32; 2],
}

/// Readings in order of validity; readings with equal times stay in order of arrival.
#[derive(Debug, Clone)]
pub struct Window {
    waiting: Vec<Waiting>,
    felt: Vec<FeltAt>,
    /// Time of the last implausible force, and the speed change that such forces cause if they are real, m/s. It is not
    /// yet added to the uncertainty.
    jolt: Option<(MonoNs, f64)>,
}

stateful!(Window { state: jolt; lists: waiting, felt; });

impl Default for Window {
    fn default() -> Self {
        Self { waiting: Vec::with_capacity(MOST), felt: Vec::with_capacity(MOST_FELT), jolt: None }
    }
}

impl Window {
    /// Inserts a reading in order of validity; returns false if there is no room.
    pub fn take(&mut self, reading: Waiting) -> bool {
        if self.waiting.len() == MOST {
            return false;
        }
        let place = self.waiting.partition_point(|other| other.at <= reading.at);
        self.waiting.insert(place, reading);
        true
    }

    /// Adds a turn rate sample; returns false if there is no room.
    pub fn take_rate(&mut self, at: MonoNs, rate_radps: Vec3<Body>) -> bool {
        self.felt_at(at)
            .map(|FeltAt { felt, counts: [of, _], .. }| take_mean(&mut felt.rate_radps, of, rate_radps))
            .is_some()
    }

    /// Adds a specific force sample; returns false if there is no room.
    pub fn take_force(&mut self, at: MonoNs, force_mps2: Vec3<Body>) -> bool {
        self.felt_at(at)
            .map(|FeltAt { felt, counts: [_, of], .. }| take_mean(&mut felt.force_mps2, of, force_mps2))
            .is_some()
    }

    /// Records a rejected specific force, m/s^2. Adds the speed change that it causes, if it is real, since the
    /// previous sample.
    pub fn take_jolt(&mut self, at: MonoNs, force_mps2: f64) {
        let before = self.felt.iter().rev().map(|felt| felt.at).find(|felt| *felt < at);
        let lasted = before.map_or(SPEAKS_FOR, |before| at.since(before).min(SPEAKS_FOR));
        let carried_mps = self.jolt.map_or(0.0, |(_, speed_mps)| speed_mps);
        self.jolt = Some((at, carried_mps + force_mps2 * lasted.as_secs_f64()));
    }

    /// Returns the speed change, m/s, by implausible forces until a time, and clears it. It assumes that they are real.
    pub fn jolted(&mut self, until: MonoNs) -> f64 {
        self.jolt.take_if(|(at, _)| *at <= until).map_or(0.0, |(_, speed_mps)| speed_mps)
    }

    /// Returns the time of the last implausible force, and the speed change, m/s, that [`Self::jolted`] has not yet
    /// returned.
    pub fn jolt(&self) -> Option<(MonoNs, f64)> {
        self.jolt
    }

    fn felt_at(&mut self, at: MonoNs) -> Option<&mut FeltAt> {
        let place = self.felt.partition_point(|other| other.at + SAME < at);
        let same = self.felt.get(place).is_some_and(|other| other.at.since(at).0.abs() <= SAME.0);
        if !same {
            if self.felt.len() == MOST_FELT {
                return None;
            }
            let felt = InertialSample { rate_radps: None, force_mps2: None };
            self.felt.insert(place, FeltAt { at, felt, counts: [0; 2] });
        }
        self.felt.get_mut(place)
    }

    /// Returns the inertial data that are valid from `from` on, and the end of their validity, at the latest `until`.
    ///
    /// An inertial sample is the mean over the time before its timestamp.
    pub fn felt(&self, from: MonoNs, until: MonoNs) -> (InertialSample, MonoNs) {
        let next = self.felt.partition_point(|felt| felt.at <= from);
        let speaking = |number: Option<usize>| {
            let sample = number.and_then(|number| self.felt.get(number));
            sample.filter(|sample| sample.at.since(from).0.abs() <= SPEAKS_FOR.0)
        };
        let (at, sample) = match (speaking(Some(next)), speaking(next.checked_sub(1))) {
            (Some(next), _) => (next.at.min(until), next.felt),
            (None, Some(last)) => ((last.at + SPEAKS_FOR).min(until), last.felt),
            (None, None) => {
                let later = self.felt.get(next).map_or(until, |next| next.at - SPEAKS_FOR);
                return (
                    InertialSample { rate_radps: None, force_mps2: None },
                    later.clamp(from + DurNs(1), until),
                );
            }
        };
        // A unit may send rates and forces alternately, so the nearest rate and the nearest force are used.
        let near = |pick: fn(&InertialSample) -> Option<Vec3<Body>>| {
            pick(&sample).or_else(|| {
                let around = [Some(next + 1), next.checked_sub(1), next.checked_sub(2)];
                around.into_iter().find_map(|number| speaking(number).and_then(|sample| pick(&sample.felt)))
            })
        };
        let felt = InertialSample {
            rate_radps: near(|felt| felt.rate_radps),
            force_mps2: near(|felt| felt.force_mps2),
        };
        (felt, at.max(from + DurNs(1)).min(until))
    }

    /// Removes and returns the reading with the earliest time of validity, if that is at or before `until`.
    pub fn pop(&mut self, until: MonoNs) -> Option<Waiting> {
        let first = self.waiting.first()?;
        let is_first = self.waiting.get(1).is_none_or(|next| first.at <= next.at);
        debug_assert!(
            is_first,
            "readings wait in order of validity: source {} at {:?}",
            first.source, first.at
        );
        (first.at <= until).then(|| self.waiting.remove(0))
    }

    /// Returns the time of the next reading or inertial sample after `at`.
    pub fn next_heard(&self, at: MonoNs) -> Option<MonoNs> {
        let waiting = self.waiting.first().map(|waiting| waiting.at);
        waiting.into_iter().chain(self.next_felt(at)).min()
    }

    /// Returns the time of the next inertial sample after `at`.
    pub fn next_felt(&self, at: MonoNs) -> Option<MonoNs> {
        self.felt.get(self.felt.partition_point(|felt| felt.at <= at)).map(|felt| felt.at)
    }

    /// Removes all waiting readings and inertial samples.
    pub fn clear(&mut self) {
        self.waiting.clear();
        self.felt.clear();
        self.jolt = None;
    }

    /// Removes waiting readings valid at or before `at`.
    pub fn drop_until(&mut self, at: MonoNs) {
        let old = self.waiting.partition_point(|waiting| waiting.at <= at);
        self.waiting.drain(..old);
    }

    /// Removes inertial samples that are not needed for any time after `at`.
    pub fn forget(&mut self, at: MonoNs) {
        let old = self.felt.partition_point(|other| other.at + SPEAKS_FOR < at);
        self.felt.drain(..old.saturating_sub(2));
    }
}

/// Adds a value to a running mean.
fn take_mean(mean: &mut Option<Vec3<Body>>, of: &mut u32, value: Vec3<Body>) {
    *of = of.saturating_add(1);
    *mean = Some(mean.map_or(value, |mean| mean + (value + -mean).scaled(1.0 / f64::from(*of))));
}
