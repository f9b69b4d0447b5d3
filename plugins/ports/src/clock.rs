//! The host's clock, which gives all input its timestamps.

use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, SystemTime};

use headrace_geometry::time::{DurNs, MonoNs, UtcNs};
use rustix::time::{ClockId, clock_gettime};

/// Time to add to the host's clock, ns. It is zero, except in a resumed dive that began before the host was last
/// rebooted.
static AHEAD_NS: AtomicU64 = AtomicU64::new(0);

/// Returns the current time on the dive's clock: the host's monotonic clock, which counts from boot and is never set,
/// plus the time that was passed to [`set_ahead`].
pub fn now() -> MonoNs {
    let time = clock_gettime(ClockId::Monotonic);
    let seconds = u64::try_from(time.tv_sec).unwrap_or(0);
    let rest = u64::try_from(time.tv_nsec).unwrap_or(0);
    let since_boot = seconds.saturating_mul(1_000_000_000).saturating_add(rest);
    MonoNs(since_boot.saturating_add(AHEAD_NS.load(Ordering::Relaxed)))
}

/// Returns how far the dive's clock is ahead of the host's monotonic clock.
pub fn ahead() -> DurNs {
    DurNs(i64::try_from(AHEAD_NS.load(Ordering::Relaxed)).unwrap_or(i64::MAX))
}

/// Sets the dive's clock ahead of the host's monotonic clock. Call it before the first timestamp.
pub fn set_ahead(by: DurNs) {
    AHEAD_NS.store(u64::try_from(by.0).unwrap_or(0), Ordering::Relaxed);
}

/// Converts a wall-clock timestamp of the kernel to the monotonic clock.
///
/// The age of the timestamp is kept. A timestamp in the future becomes the current time. Such timestamps can occur
/// after the wall clock was set back.
pub fn of_wall(stamped: SystemTime) -> MonoNs {
    let now = now();
    let ago = wall().duration_since(stamped).unwrap_or(Duration::ZERO);
    now - DurNs(i64::try_from(ago.as_nanos()).unwrap_or(0))
}

#[expect(clippy::disallowed_methods, reason = "the kernel stamps with wall time, which is converted here")]
fn wall() -> SystemTime {
    SystemTime::now()
}

/// Returns the current time on the monotonic clock and in UTC.
pub fn clock_anchor() -> (MonoNs, UtcNs) {
    let (mono, wall) = (now(), wall());
    let since = wall.duration_since(SystemTime::UNIX_EPOCH).unwrap_or(Duration::ZERO);
    (mono, UtcNs(i64::try_from(since.as_nanos()).unwrap_or(0)))
}

/// Converts `wait` to a `Duration`. A negative `wait` becomes zero.
pub(crate) fn duration(wait: DurNs) -> Duration {
    Duration::from_nanos(u64::try_from(wait.0).unwrap_or(0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn converted_wall_times_are_not_in_the_future() {
        let (first, stamped) = (now(), wall());
        let second = now();
        assert!(second.0 >= first.0 && first.0 > 0);
        let over = of_wall(stamped);
        // The system may have preempted the thread between the two clock reads.
        assert!(over.since(first).0 > -1_000_000_000 && over.since(now()).0 <= 0);
        assert!(of_wall(wall() + Duration::from_mins(1)).since(now()).0 <= 0);
    }
}
