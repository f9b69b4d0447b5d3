//! CPU time of this thread.
//!
//! Wall time is unusable on a loaded machine. There, it was measured at six to eight times the CPU time. The thread's
//! CPU clock includes kernel work for the thread, such as page faults. `getrusage` separates user and kernel time by
//! sampling every 4 ms, which is too coarse here.

use std::hint::black_box;

use rustix::time::{ClockId, clock_gettime};

/// CPU time of this thread so far, s.
pub fn cpu_s() -> f64 {
    let time = clock_gettime(ClockId::ThreadCPUTime);
    time.tv_sec as f64 + time.tv_nsec as f64 * 1e-9
}

/// Runs some work and returns its result and the CPU time used, s.
pub fn timed<R>(work: impl FnOnce() -> R) -> (R, f64) {
    let begun_s = cpu_s();
    let result = black_box(work());
    (result, cpu_s() - begun_s)
}
