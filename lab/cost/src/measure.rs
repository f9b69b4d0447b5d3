//! Measures the costs of settings round by round, and runs untimed work in parallel.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;

use crate::error::CostError;
use crate::point::Interval;

/// Runs untimed work for each item on as many threads as there are processors; the results are in the order of the
/// items.
///
/// Errors: the error of the first item that fails.
pub fn side_by_side<T: Sync, R: Send>(
    items: &[T],
    work: impl Fn(&T) -> Result<R, CostError> + Sync,
) -> Result<Vec<R>, CostError> {
    let next = AtomicUsize::new(0);
    let some = || {
        let mut done = Vec::new();
        loop {
            let at = next.fetch_add(1, Ordering::Relaxed);
            let Some(item) = items.get(at) else { return done };
            done.push((at, work(item)));
        }
    };
    let workers = thread::available_parallelism().map_or(1, usize::from).min(items.len());
    let mut done: Vec<(usize, Result<R, CostError>)> = thread::scope(|scope| {
        let workers: Vec<_> = (0..workers).map(|_| scope.spawn(some)).collect();
        let joined = |worker: thread::ScopedJoinHandle<'_, _>| match worker.join() {
            Ok(done) => done,
            Err(panic) => std::panic::resume_unwind(panic),
        };
        workers.into_iter().flat_map(joined).collect()
    });
    done.sort_by_key(|(at, _)| *at);
    done.into_iter().map(|(_, result)| result).collect()
}

/// Measures each setting once per round; returns the median cost of each setting with its 95 % interval.
///
/// Rounds spread other load on the machine evenly over the settings. `run` measures a setting once and returns
/// its cost.
///
/// Errors: an error of `run`; zero rounds.
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parallel_work_keeps_the_order_and_returns_the_first_error() {
        let items: Vec<u32> = (0..100).collect();
        let halves = side_by_side(&items, |item| Ok(item / 2));
        assert_eq!(halves.unwrap(), items.iter().map(|item| item / 2).collect::<Vec<_>>());
        let nothing: Vec<u32> = side_by_side(&[], |item: &u32| Ok(*item)).unwrap();
        assert!(nothing.is_empty());

        let odd = side_by_side(&items, |item| match item % 10 {
            7 => Err(CostError::Figure { what: format!("item {item}"), why: "it ends in 7".to_owned() }),
            _ => Ok(()),
        });
        assert_eq!(odd.unwrap_err().to_string(), "measuring item 7: it ends in 7");
    }
}
