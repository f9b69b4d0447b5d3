//! Time as integer nanoseconds. Three types keep monotonic time, UTC and durations apart.
//!
//! The loop uses only [`MonoNs`], the host's monotonic clock. Its timestamps come from the thread that receives a
//! device's bytes, from a log or from a simulation. UTC appears only at the program's inputs and outputs.

use serde::{Deserialize, Serialize};

use core::ops::{Add, Neg, Sub};

const NS_PER_S: f64 = 1e9;

/// A timestamp of the host's monotonic clock, in nanoseconds since an arbitrary origin.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default, Serialize, Deserialize)]
pub struct MonoNs(pub u64);

/// A UTC timestamp, in nanoseconds since 1970-01-01 (negative before). Only the program's inputs and outputs use it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default, Serialize, Deserialize)]
pub struct UtcNs(pub i64);

/// A signed duration in nanoseconds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default, Serialize, Deserialize)]
pub struct DurNs(pub i64);

impl DurNs {
    /// Zero duration.
    pub const ZERO: Self = Self(0);

    /// Creates a duration of whole milliseconds. Beyond 292 years, it saturates.
    pub const fn from_millis(millis: i64) -> Self {
        Self(millis.saturating_mul(1_000_000))
    }

    /// Creates a duration from seconds, rounded to the nearest nanosecond.
    ///
    /// NaN gives zero, and values beyond 292 years saturate.
    #[expect(clippy::cast_possible_truncation, reason = "float to integer casts saturate, as intended")]
    pub fn from_secs_f64(seconds: f64) -> Self {
        Self(libm::rint(seconds * NS_PER_S) as i64)
    }

    /// Duration in seconds, for numerical models. All other code keeps durations as integers.
    pub fn as_secs_f64(self) -> f64 {
        self.0 as f64 / NS_PER_S
    }
}

impl MonoNs {
    /// Signed duration from `earlier` to `self`. Beyond 292 years, it saturates.
    pub fn since(self, earlier: Self) -> DurNs {
        let span = i128::from(self.0) - i128::from(earlier.0);
        DurNs(i64::try_from(span).unwrap_or(if span < 0 { i64::MIN } else { i64::MAX }))
    }

    /// Timestamp in seconds since the clock's origin, for reports.
    ///
    /// Use [`Self::since`] for differences; it is exact.
    pub fn as_secs_f64(self) -> f64 {
        self.0 as f64 / NS_PER_S
    }
}

/// Clock of a dive: converts timestamps to dive time, the time that people read and type, and back.
///
/// Dive time is zero at the receive time of the first sensor packet that the loop takes. The operator's commands and
/// messages to devices may come earlier; their dive time is zero.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct DiveClock {
    zero: Option<MonoNs>,
}

impl DiveClock {
    /// Creates the clock of a dive whose first sensor packet was received at `zero`; `None` before the first packet.
    pub const fn new(zero: Option<MonoNs>) -> Self {
        Self { zero }
    }

    /// Starts the clock with a sensor packet received at `at`, unless an earlier packet has started it.
    pub fn start(&mut self, at: MonoNs) {
        self.zero.get_or_insert(at);
    }

    /// Timestamp at which dive time is zero; `None` before the first packet.
    pub fn zero(self) -> Option<MonoNs> {
        self.zero
    }

    /// Dive time of a timestamp; never negative.
    pub fn time(self, at: MonoNs) -> DurNs {
        self.zero.map_or(DurNs::ZERO, |zero| at.since(zero).max(DurNs::ZERO))
    }

    /// Dive time of a timestamp in seconds.
    pub fn seconds(self, at: MonoNs) -> f64 {
        self.time(at).as_secs_f64()
    }

    /// Timestamp of a dive time.
    pub fn timestamp(self, time: DurNs) -> MonoNs {
        self.zero.unwrap_or(MonoNs(0)) + time
    }
}

impl Add<DurNs> for MonoNs {
    type Output = Self;

    /// A sum beyond the clock's range saturates at the end of the range.
    fn add(self, span: DurNs) -> Self {
        Self(self.0.saturating_add_signed(span.0))
    }
}

impl Sub<DurNs> for MonoNs {
    type Output = Self;

    fn sub(self, span: DurNs) -> Self {
        self + -span
    }
}

impl Neg for DurNs {
    type Output = Self;

    fn neg(self) -> Self {
        Self(self.0.saturating_neg())
    }
}

impl Add for DurNs {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self(self.0.saturating_add(other.0))
    }
}

impl Sub for DurNs {
    type Output = Self;

    fn sub(self, other: Self) -> Self {
        Self(self.0.saturating_sub(other.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn duration_between_timestamps_is_signed_and_saturates() {
        assert_eq!(MonoNs(5).since(MonoNs(8)), DurNs(-3));
        assert_eq!(MonoNs(u64::MAX).since(MonoNs(0)), DurNs(i64::MAX));
        assert_eq!(MonoNs(0).since(MonoNs(u64::MAX)), DurNs(i64::MIN));
        assert_eq!(MonoNs(3) - DurNs(8), MonoNs(0));
        assert_eq!(-DurNs(i64::MIN), DurNs(i64::MAX));
    }

    #[test]
    fn dive_time_counts_from_the_first_packet_and_is_never_negative() {
        let mut clock = DiveClock::default();
        assert_eq!((clock.time(MonoNs(7)), clock.timestamp(DurNs(7))), (DurNs(0), MonoNs(7)));
        clock.start(MonoNs(5));
        clock.start(MonoNs(3));
        assert_eq!([3, 5, 8].map(|at| clock.time(MonoNs(at)).0), [0, 0, 3]);
        assert_eq!(clock.timestamp(DurNs(3)), MonoNs(8));
    }

    #[test]
    fn seconds_round_to_the_nearest_nanosecond() {
        assert_eq!(DurNs::from_secs_f64(0.018), DurNs(18_000_000));
        assert_eq!(DurNs::from_secs_f64(f64::NAN), DurNs::ZERO);
        assert_eq!(DurNs::from_secs_f64(1e300), DurNs(i64::MAX));
    }

    #[test]
    fn time_steps_over_10_hours_sum_exactly() {
        let step = DurNs::from_secs_f64(0.0048);
        let mut now = MonoNs(0);
        for _ in 0..7_500_000 {
            now = now + step;
        }
        assert_eq!(now, MonoNs(36_000 * 1_000_000_000));
    }
}
