//! Readings that wait until all of their time have come: each is fused at its own time, in whatever order they came.

use serde::{Deserialize, Serialize};

use crate::filter::inertial::Felt;
use headrace_geometry::frames::{Body, Vec3};
use headrace_geometry::time::{DurNs, MonoNs};
use headrace_sensor::reading::Reading;
use headrace_snapshot::stateful;

/// Room for readings that wait; four heads, four sounders and the rest have a tenth of it in a window.
const MOST: usize = 1024;
/// Room for samples of inertial units.
const MOST_FELT: usize = 1024;
/// An inertial sample speaks for so much time at most.
const SPEAKS_FOR: DurNs = DurNs(100_000_000);
/// Two samples nearer than this are parts of one.
const SAME: DurNs = DurNs(500_000);

/// A reading that waits.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
pub struct Waiting {
    /// When it is valid.
    pub at: MonoNs,
    /// Its source.
    pub source: usize,
    /// What was read.
    pub reading: Reading,
}

/// Readings in order of time, those of one time in the order in which they came.
#[derive(Debug, Clone)]
pub struct Window {
    waiting: Vec<Waiting>,
    felt: Vec<(MonoNs, Felt)>,
}

stateful!(Window { lists: waiting, felt; });

impl Default for Window {
    fn default() -> Self {
        Self { waiting: Vec::with_capacity(MOST), felt: Vec::with_capacity(MOST_FELT) }
    }
}

impl Window {
    /// Puts a reading in its place; false when there is no room.
    pub fn take(&mut self, reading: Waiting) -> bool {
        if self.waiting.len() == MOST {
            return false;
        }
        let place = self.waiting.partition_point(|other| other.at <= reading.at);
        self.waiting.insert(place, reading);
        true
    }

    /// Notes a turn rate; false when there is no room.
    pub fn take_rate(&mut self, at: MonoNs, rate_radps: Vec3<Body>) -> bool {
        self.felt_at(at).map(|felt| felt.rate_radps = Some(rate_radps)).is_some()
    }

    /// Notes a specific force; false when there is no room.
    pub fn take_force(&mut self, at: MonoNs, force_mps2: Vec3<Body>) -> bool {
        self.felt_at(at).map(|felt| felt.force_mps2 = Some(force_mps2)).is_some()
    }

    fn felt_at(&mut self, at: MonoNs) -> Option<&mut Felt> {
        let place = self.felt.partition_point(|(other, _)| *other + SAME < at);
        let same = self.felt.get(place).is_some_and(|(other, _)| other.since(at).0.abs() <= SAME.0);
        if !same {
            if self.felt.len() == MOST_FELT {
                return None;
            }
            self.felt.insert(place, (at, Felt { rate_radps: None, force_mps2: None }));
        }
        self.felt.get_mut(place).map(|(_, felt)| felt)
    }

    /// What was felt from `from` on, and until when that holds, `until` at the latest: the mean of a sample is that of the
    /// time before it.
    pub fn felt(&self, from: MonoNs, until: MonoNs) -> (Felt, MonoNs) {
        let next = self.felt.partition_point(|(at, _)| *at <= from);
        let speaking = |number: Option<usize>| {
            let sample = number.and_then(|number| self.felt.get(number));
            sample.filter(|(at, _)| at.since(from).0.abs() <= SPEAKS_FOR.0)
        };
        let (at, sample) = match (speaking(Some(next)), speaking(next.checked_sub(1))) {
            (Some((at, felt)), _) => ((*at).min(until), *felt),
            (None, Some((at, felt))) => ((*at + SPEAKS_FOR).min(until), *felt),
            (None, None) => {
                let later = self.felt.get(next).map_or(until, |(at, _)| *at - SPEAKS_FOR);
                return (Felt { rate_radps: None, force_mps2: None }, later.clamp(from + DurNs(1), until));
            }
        };
        // A unit that sends its rates and its forces by turns: the nearest of each.
        let near = |pick: fn(&Felt) -> Option<Vec3<Body>>| {
            pick(&sample).or_else(|| {
                let around = [Some(next + 1), next.checked_sub(1), next.checked_sub(2)];
                around.into_iter().find_map(|number| speaking(number).and_then(|(_, felt)| pick(felt)))
            })
        };
        let felt =
            Felt { rate_radps: near(|felt| felt.rate_radps), force_mps2: near(|felt| felt.force_mps2) };
        (felt, at.max(from + DurNs(1)).min(until))
    }

    /// The first reading valid at or before a moment, which leaves the window.
    pub fn pop(&mut self, until: MonoNs) -> Option<Waiting> {
        let first = self.waiting.first()?;
        (first.at <= until).then(|| self.waiting.remove(0))
    }

    /// When the next reading of any kind after `at` is valid.
    pub fn next_heard(&self, at: MonoNs) -> Option<MonoNs> {
        let waiting = self.waiting.first().map(|waiting| waiting.at);
        waiting.into_iter().chain(self.next_felt(at)).min()
    }

    /// When an inertial unit next spoke after `at`.
    pub fn next_felt(&self, at: MonoNs) -> Option<MonoNs> {
        self.felt.get(self.felt.partition_point(|(felt, _)| *felt <= at)).map(|(at, _)| *at)
    }

    /// Forgets everything.
    pub fn clear(&mut self) {
        self.waiting.clear();
        self.felt.clear();
    }

    /// Forgets readings valid at or before a moment.
    pub fn drop_until(&mut self, at: MonoNs) {
        let old = self.waiting.partition_point(|waiting| waiting.at <= at);
        self.waiting.drain(..old);
    }

    /// Forgets samples of inertial units that no time after `at` needs.
    pub fn forget(&mut self, at: MonoNs) {
        let old = self.felt.partition_point(|(other, _)| *other + SPEAKS_FOR < at);
        self.felt.drain(..old.saturating_sub(2));
    }
}
