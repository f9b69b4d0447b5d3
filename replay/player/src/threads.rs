//! Drives a loop from a log on several threads, or several loops that share one navigation.
//!
//! The placer, which georeferences pings, runs on one thread. The adviser, which computes the speed advice, runs on
//! another. All remaining work runs on the caller's thread. Bounded queues pass batches of ticks between the threads.
//! Each part processes all ticks in order, so the results are identical bit for bit on any number of threads.

use std::any::Any;
use std::sync::Arc;
use std::thread::ScopedJoinHandle;

use crossbeam::channel::{Receiver, bounded};
use headrace_geometry::time::{DurNs, MonoNs};
use headrace_monitor::adviser::{Advised, Adviser};
use headrace_monitor::merge::MAX_TICK_BYTES;
use headrace_monitor::placer::{Placed, Placer};
use headrace_monitor::run::Loop;

use crate::drive::{DriveError, Driver, Pace, PacketSource, drive, pause};

/// Maximum number of threads for one loop: one for georeferencing pings, one for the speed advice,
/// and one for all remaining work.
pub const MOST_THREADS: usize = 3;

/// Number of ticks in a batch. One queue operation then passes some milliseconds of work to another thread.
const BATCH_TICKS: usize = 32;
/// Maximum number of batches of ticks that wait in the queue between two threads.
const MOST_WAITING: usize = 4;
/// Capacity of the queue that returns used batches for reuse. It has room for the batches of two queues, and for the
/// batches being processed.
const MOST_UNUSED: usize = 2 * MOST_WAITING + MOST_THREADS;

/// A tick, with its georeferenced pings and its speed advice.
#[derive(Default)]
struct Tick {
    /// Time at the end of the tick.
    now: MonoNs,
    placed: Arc<Placed>,
    advised: Advised,
}

/// A batch of ticks, which is passed between threads as a whole.
#[derive(Default)]
struct Batch {
    ticks: Vec<Tick>,
    /// Number of ticks that the batch holds. Further elements of the list are kept for reuse.
    len: usize,
}

impl Batch {
    /// Runs the placer, which georeferences pings, for the next tick.
    fn place(&mut self, placer: &mut Placer, now: MonoNs) {
        if self.len == self.ticks.len() {
            self.ticks.push(Tick::default());
        }
        let tick = &mut self.ticks[self.len];
        tick.now = now;
        // A loop may still hold the georeferenced pings of its latest tick. The pings of all other ticks can be
        // overwritten.
        if Arc::get_mut(&mut tick.placed).is_none() {
            tick.placed = Arc::default();
        }
        if let Some(placed) = Arc::get_mut(&mut tick.placed) {
            placer.tick(MAX_TICK_BYTES, placed);
        }
        self.len += 1;
    }

    fn advise(&mut self, adviser: &mut Adviser) {
        for tick in self.ticks.iter_mut().take(self.len) {
            adviser.tick(&tick.placed, &mut tick.advised);
        }
    }
}

/// Runs the loop until the source ends, as fast as possible, on up to `threads` threads including the caller's.
///
/// `after_tick` is called on the caller's thread after every tick. If `threads` is one, [`drive`] runs instead. Its
/// results are the same.
///
/// Errors: see [`DriveError`]. Packets fed before the error have been processed, unless a thread has panicked.
pub fn drive_on(
    threads: usize,
    dive: &mut Loop,
    source: &mut (dyn PacketSource + Send),
    tick: DurNs,
    after_tick: &mut dyn FnMut(&Loop),
) -> Result<(), DriveError> {
    let parts = if threads > 1 { dive.split() } else { None };
    let Some((mut placer, mut adviser)) = parts else {
        return drive(dive, source, Pace { tick, speed: None }, after_tick);
    };
    let driven = Driver::new(dive, tick).and_then(|driver| {
        drive_parts(threads, dive, (&mut placer, driver), source, &mut adviser, after_tick)
    });
    if !matches!(driven, Err(DriveError::Panicked { .. })) {
        dive.join(placer, adviser);
    }
    driven
}

fn drive_parts(
    threads: usize,
    dive: &mut Loop,
    (placer, driver): (&mut Placer, Driver),
    source: &mut (dyn PacketSource + Send),
    adviser: &mut Adviser,
    after_tick: &mut dyn FnMut(&Loop),
) -> Result<(), DriveError> {
    std::thread::scope(|scope| {
        let (used, unused) = bounded(MOST_UNUSED);
        let (to, placed) = bounded::<Batch>(MOST_WAITING);
        let placing =
            scope.spawn(move || place(placer, driver, source, &unused, &mut |batch| to.send(batch).is_ok()));
        let (mut adviser, mut beside, mut batches) = (Some(adviser), None, placed);
        if threads >= MOST_THREADS
            && let Some(adviser) = adviser.take()
        {
            let (to, advised) = bounded(MOST_WAITING);
            let placed = core::mem::replace(&mut batches, advised);
            beside = Some(scope.spawn(move || {
                for mut batch in placed {
                    batch.advise(adviser);
                    if to.send(batch).is_err() {
                        return;
                    }
                }
            }));
        }
        for mut batch in batches {
            if let Some(adviser) = &mut adviser {
                batch.advise(adviser);
            }
            for tick in batch.ticks.iter_mut().take(batch.len) {
                run_tick(dive, tick, after_tick);
            }
            // An error means that the thread that georeferences pings has ended and needs no batches.
            used.try_send(batch).ok();
        }
        beside.map_or(Ok(()), |beside| joined(beside, "advises"))?;
        joined(placing, "reads and places pings")?
    })
}

/// Runs the steps of a tick that follow georeferencing and speed advice. Waits while an outlet is too slow.
fn run_tick(dive: &mut Loop, tick: &mut Tick, after_tick: &mut dyn FnMut(&Loop)) {
    while !dive.tick_placed(tick.now, &tick.placed, &mut tick.advised) {
        after_tick(dive);
        pause();
    }
    after_tick(dive);
}

/// Georeferences the pings of a packet source until the source ends or no receiver takes batches any more. `unused`
/// delivers used batches for reuse.
fn place(
    placer: &mut Placer,
    mut driver: Driver,
    source: &mut dyn PacketSource,
    unused: &Receiver<Batch>,
    pass_on: &mut dyn FnMut(Batch) -> bool,
) -> Result<(), DriveError> {
    let (mut batch, mut is_wanted) = (Batch::default(), true);
    let mut work_off = |now: MonoNs| {
        loop {
            batch.place(placer, now);
            if batch.len == BATCH_TICKS {
                let next = Batch { len: 0, ..unused.try_recv().unwrap_or_default() };
                is_wanted &= pass_on(core::mem::replace(&mut batch, next));
            }
            if !placer.has_waiting() {
                return is_wanted;
            }
        }
    };
    let mut fill = || -> Result<bool, DriveError> {
        let Some(until) = driver.due(source)? else { return Ok(false) };
        driver.fill(source, until, &mut |now| {
            work_off(now);
        })?;
        Ok(work_off(until))
    };
    let placed = loop {
        match fill() {
            Ok(true) => {}
            Ok(false) => break Ok(()),
            Err(error) => break Err(error),
        }
    };
    pass_on(batch);
    placed
}

/// Runs several loops until the source ends, with the navigation of the first loop.
///
/// Packets are decoded and pings are georeferenced only once. Each loop gives the results that it would give alone. The
/// caller must arm all loops with the same navigation, because this can't be checked here.
///
/// Errors: see [`DriveError`]; loops differ in more than the target, the sections and the requirements on sections.
pub fn drive_together(
    threads: usize,
    dives: &mut [Loop],
    source: &mut dyn PacketSource,
    tick: DurNs,
) -> Result<(), DriveError> {
    let Some(first) = dives.first_mut() else { return Ok(()) };
    let driver = Driver::new(first, tick)?;
    let (sources, sensors, mission) = (first.sources().to_vec(), first.sensors(), first.mission().clone());
    let mut parts = Vec::new();
    for (number, dive) in dives.iter_mut().enumerate() {
        let is_alike =
            dive.sources() == sources && dive.sensors() == sensors && mission.places_as(dive.mission());
        let split = if is_alike { dive.split() } else { None };
        parts.push(split.ok_or(DriveError::Unlike { number })?);
    }
    let (mut placers, mut advisers): (Vec<Placer>, Vec<Adviser>) = parts.into_iter().unzip();
    let Some((placer, others)) = placers.split_first_mut() else { return Ok(()) };
    let parted: Vec<(&mut Loop, &mut Adviser)> = dives.iter_mut().zip(&mut advisers).collect();
    let driven = drive_all(threads, parted, (placer, driver), source);
    if let Err(DriveError::Panicked { .. }) = driven {
        return driven;
    }
    for (number, other) in (1..).zip(others) {
        other.take_over(placer).map_err(|_| DriveError::Unlike { number })?;
    }
    for ((dive, placer), adviser) in dives.iter_mut().zip(placers).zip(advisers) {
        dive.join(placer, adviser);
    }
    driven
}

fn drive_all(
    threads: usize,
    mut dives: Vec<(&mut Loop, &mut Adviser)>,
    (placer, driver): (&mut Placer, Driver),
    source: &mut dyn PacketSource,
) -> Result<(), DriveError> {
    let (used, unused) = bounded(MOST_UNUSED);
    if threads < 2 {
        return place(placer, driver, source, &unused, &mut |batch| {
            survey_all(&mut dives, &batch);
            used.try_send(batch).is_ok()
        });
    }
    std::thread::scope(|scope| {
        let (mut queues, mut covering) = (Vec::new(), Vec::new());
        let each = dives.len().div_ceil((threads - 1).min(dives.len()).max(1));
        while !dives.is_empty() {
            let mut some: Vec<_> = dives.drain(..each.min(dives.len())).collect();
            let (to, placed) = bounded::<Arc<Batch>>(MOST_WAITING);
            let used = used.clone();
            queues.push(to);
            covering.push(scope.spawn(move || {
                for batch in placed {
                    survey_all(&mut some, &batch);
                    // The loop that finishes last returns the batch. An error means that the thread that georeferences
                    // pings has ended and needs no batches.
                    if let Some(batch) = Arc::into_inner(batch) {
                        used.try_send(batch).ok();
                    }
                }
            }));
        }
        let placed = place(placer, driver, source, &unused, &mut |batch| {
            let batch = Arc::new(batch);
            queues.iter().all(|queue| queue.send(Arc::clone(&batch)).is_ok())
        });
        drop(queues);
        for covering in covering {
            joined(covering, "surveys the wall")?;
        }
        placed
    })
}

/// Computes advice and verdicts in each loop, for all ticks in a batch of georeferenced pings. Each loop advises for
/// its own target.
fn survey_all(dives: &mut [(&mut Loop, &mut Adviser)], batch: &Batch) {
    let mut own = Tick::default();
    for (dive, adviser) in dives {
        for tick in batch.ticks.iter().take(batch.len) {
            (own.now, own.placed) = (tick.now, Arc::clone(&tick.placed));
            adviser.tick(&own.placed, &mut own.advised);
            run_tick(dive, &mut own, &mut |_| ());
        }
    }
}

/// Waits for a thread, and returns its result. A panic becomes an error.
pub(crate) fn joined<T>(thread: ScopedJoinHandle<'_, T>, what: &'static str) -> Result<T, DriveError> {
    thread.join().map_err(|panic| DriveError::Panicked { what, message: words_of(panic.as_ref()) })
}

fn words_of(panic: &(dyn Any + Send)) -> String {
    let text = panic.downcast_ref::<&str>().map(|text| (*text).to_owned());
    text.or_else(|| panic.downcast_ref::<String>().cloned()).unwrap_or_default()
}
