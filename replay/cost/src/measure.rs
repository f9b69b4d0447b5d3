//! What settings cost: CPU time of this thread, in turns, and instructions where something counts them.
//!
//! Wall time says little: on a loaded machine it was seen six to eight times CPU time. The clock of the thread's CPU time counts what
//! the kernel does for it, too (page faults); `getrusage` tells both apart by sampling once in 4 ms, too coarse for what is measured.

use std::hint::black_box;

use rustix::time::{ClockId, clock_gettime};

use crate::error::CostError;
use crate::point::Interval;

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

/// Median of each setting's costs with its interval of 95 %, measured so many rounds in turns, so that what the machine does besides falls upon
/// all of them alike. `run` measures a setting once and returns its cost.
///
/// Errors: those of `run`; no rounds.
pub fn in_turns<T>(
    rounds: u32,
    settings: &[T],
    mut run: impl FnMut(&T) -> Result<f64, CostError>,
) -> Result<Vec<Interval>, CostError> {
    let mut costs: Vec<Vec<f64>> = settings.iter().map(|_| Vec::new()).collect();
    for _ in 0..rounds {
        for (setting, costs) in settings.iter().zip(&mut costs) {
            costs.push(run(setting)?);
        }
    }
    let interval = |costs: &Vec<f64>| {
        let why = || CostError::Figure { what: "costs".to_owned(), why: "no round was measured".to_owned() };
        Interval::median(costs).ok_or_else(why)
    };
    costs.iter().map(interval).collect()
}
