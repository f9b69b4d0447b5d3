//! CPU time of this thread.
//!
//! Wall time says little: on a loaded machine it was seen six to eight times CPU time. The clock of the thread's CPU time counts what
//! the kernel does for it, too (page faults); `getrusage` tells both apart by sampling once in 4 ms, too coarse for what is measured.

use std::hint::black_box;

use rustix::time::{ClockId, clock_gettime};

/// CPU time of this thread so far, s.
pub fn cpu_s() -> f64 {
    let time = clock_gettime(ClockId::ThreadCPUTime);
    time.tv_sec as f64 + time.tv_nsec as f64 * 1e-9
}

/// What some work gives, and the CPU time that it takes, s.
pub fn timed<R>(work: impl FnOnce() -> R) -> (R, f64) {
    let begun_s = cpu_s();
    let result = black_box(work());
    (result, cpu_s() - begun_s)
}
