//! Supervises the threads of all lines, and runs the loop that they feed.

use std::convert::Infallible;
use std::io;
use std::marker::PhantomData;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use headrace_geometry::time::{DurNs, MonoNs};
use headrace_monitor::feed::{self, Feed};
use headrace_monitor::ring::Port;
use headrace_monitor::run::Loop;
use headrace_sensor::connect::{Connect, ConnectError};
use headrace_sensor::driver::Driver;

use crate::backlog::LateData;
use crate::clock;
use crate::host::RealHost;
use crate::line_service::{Attached, Common, LineRecord, LineService};
use crate::status::{LineHistory, Status, StatusQueue};
use crate::wake::{self, Waker};

/// Capacity of the queue of device statuses.
const BOARD: usize = 256;
/// Longest time between two ticks of the loop while no input arrives.
const PERIOD: Duration = Duration::from_millis(20);
/// Time between two ticks after which the lines may have late data.
const STALLED: DurNs = DurNs::from_millis(100);
/// Longest time for which the loop waits until all lines have read their late data.
const LONGEST_SETTLING: DurNs = DurNs::from_millis(200);
/// Pause while the loop waits for a slow output.
const BEHIND: Duration = Duration::from_millis(1);

/// A sensor, with the address and the driver that serve it.
pub struct Connection {
    /// Sensor index, in the order of the vehicle file.
    pub source: usize,
    /// Address of the sensor, or the reason why it doesn't parse.
    pub connect: Result<Connect, ConnectError>,
    /// Writing end of the sensor's ring buffer.
    pub port: Port,
    /// Driver of the device, which runs on the host.
    pub driver: Box<dyn Driver>,
}

/// Runs one thread per line. Sensors with the same `connect` share a line.
pub struct Supervisor {
    /// Number of sensors: the highest sensor index plus one.
    sensors: usize,
    threads: Vec<JoinHandle<Vec<(usize, LineHistory)>>>,
    stopping: Arc<AtomicBool>,
    board: StatusQueue,
    late_data: LateData,
    /// Makes the type not `Send`: the loop must run on this thread, because the lines wake this thread.
    on_this_thread: PhantomData<*const ()>,
}

impl Supervisor {
    /// Starts the threads of the lines. The calling thread must run the loop, because the lines wake this thread.
    ///
    /// `record` receives line events that don't pass through the loop.
    ///
    /// Errors: a thread can't be started.
    pub fn start(connections: Vec<Connection>, record: Option<Arc<dyn LineRecord>>) -> io::Result<Self> {
        let stopping = Arc::new(AtomicBool::new(false));
        let board = StatusQueue::new(BOARD);
        let waker = Waker::of_this_thread();
        let host = Arc::new(RealHost);
        let late_data = LateData::default();
        let common = Common {
            host,
            stopping: Arc::clone(&stopping),
            board: board.clone(),
            waker,
            late_data: late_data.clone(),
            record,
        };
        let sensors = connections.iter().map(|hand| hand.source + 1).max().unwrap_or(0);
        let mut supervisor =
            Self { sensors, threads: Vec::new(), stopping, board, late_data, on_this_thread: PhantomData };
        let mut before = Vec::new();
        for (name, connect, attached) in lines(connections) {
            let service = LineService::new(connect.clone(), before.clone(), attached, common.clone());
            before.extend(connect);
            let thread = thread::Builder::new().name(name).spawn(move || service.run())?;
            supervisor.threads.push(thread);
        }
        Ok(supervisor)
    }

    /// Takes the oldest change of a device's status from the queue.
    pub fn next_status(&self) -> Option<Status> {
        self.board.next()
    }

    /// Runs the loop until `ended` returns true. A tick runs when packets arrive, or after the loop period.
    pub fn run(&self, dive: &mut Loop, ended: &dyn Fn() -> bool, after_tick: &mut dyn FnMut(&Loop)) {
        let mut feed = LiveFeed { ended, late_data: &self.late_data, ticked: clock::now() };
        let Ok(()) = feed::drive(dive, &mut feed, after_tick);
    }

    /// Stops all threads and drains the rings. Returns each sensor's line history, in the order of the sensors.
    pub fn stop(mut self, dive: &mut Loop, after_tick: &mut dyn FnMut(&Loop)) -> Vec<LineHistory> {
        // A thread that panics has reported the panic itself. Its sensors get this history instead of their own.
        let ended_early =
            LineHistory { last: "its thread has ended early".to_owned(), ..LineHistory::default() };
        let mut all = vec![ended_early; self.sensors];
        let (stopping, threads) = (Arc::clone(&self.stopping), std::mem::take(&mut self.threads));
        let mut drain = || {
            if dive.has_waiting() {
                feed::work_off(dive, clock::now(), after_tick, &mut pause);
            }
        };
        let wait =
            || threads.into_iter().flat_map(|thread| thread.join().unwrap_or_default()).collect::<Vec<_>>();
        for (source, history) in wind_up(|| stopping.store(true, Ordering::Relaxed), wait, &mut drain) {
            if let Some(place) = all.get_mut(source) {
                *place = history;
            }
        }
        all
    }
}

/// Ends threads that fill rings, in three steps: notify the threads, wait for them, and drain the rings.
///
/// Rings are drained last, because a thread may still fill its ring after the notification. Joining a thread makes its
/// writes visible. Setting the stop flag doesn't.
fn wind_up<H>(tell: impl FnOnce(), wait: impl FnOnce() -> H, drain: impl FnOnce()) -> H {
    tell();
    let handed_back = wait();
    drain();
    handed_back
}

/// Feed of a live dive: the loop takes its packets from rings that the threads of the lines fill.
struct LiveFeed<'a> {
    ended: &'a dyn Fn() -> bool,
    late_data: &'a LateData,
    /// Time at which the latest tick began.
    ticked: MonoNs,
}

impl Feed for LiveFeed<'_> {
    type Error = Infallible;

    fn fill(&mut self, _: &mut Loop, _: &mut dyn FnMut(&Loop)) -> Result<Option<MonoNs>, Infallible> {
        if (self.ended)() {
            return Ok(None);
        }
        wake::sleep::<wake::System>(PERIOD);
        let woken = clock::now();
        if woken.since(self.ticked) > STALLED {
            self.late_data.found(woken);
        }
        let mut now = woken;
        while self.late_data.is_recent(now) && now.since(woken) < LONGEST_SETTLING {
            pause();
            now = clock::now();
        }
        self.ticked = now;
        Ok(Some(now))
    }

    fn pause(&mut self) {
        pause();
    }
}

fn pause() {
    thread::sleep(BEHIND);
}

impl Drop for Supervisor {
    fn drop(&mut self) {
        self.stopping.store(true, Ordering::Relaxed);
    }
}

/// A line: name of its thread, address, and devices on the line.
type LineOf = (String, Result<Connect, ConnectError>, Vec<Attached>);

fn lines(connections: Vec<Connection>) -> Vec<LineOf> {
    let mut lines: Vec<LineOf> = Vec::new();
    for Connection { source, connect, port, driver } in connections {
        let attached = Attached { source, port, driver };
        // Connections with a `connect` that doesn't parse never share a line.
        match lines.iter_mut().find(|line| line.1.is_ok() && line.1 == connect) {
            Some(line) => line.2.push(attached),
            None => lines.push((format!("line {source}"), connect, vec![attached])),
        }
    }
    lines
}

#[cfg(test)]
mod tests {
    use headrace_geometry::time::MonoNs;
    use headrace_monitor::byte_ring::model::{explore, packets};

    use super::wind_up;

    /// A function that ends a line as the loop does. Its arguments notify the line, wait for it, and drain its ring.
    type Ends = fn(&dyn Fn(), &mut dyn FnMut(), &mut dyn FnMut());

    /// Explores, with loom, a model of a line's thread that behaves as `LineService::run`.
    ///
    /// The thread checks the stop flag before each step. When the thread ends, it delivers the bytes that its driver
    /// still holds.
    fn line_and_stop(name: &str, ends: Ends) -> usize {
        explore(name, Some(4), move || {
            let (mut port, mut reader) = packets(96);
            let stopping = loom::sync::Arc::new(loom::sync::atomic::AtomicBool::new(false));
            let flag = loom::sync::Arc::clone(&stopping);
            let line = loom::thread::spawn(move || {
                let mut sent = Vec::new();
                while sent.len() < 2 && !flag.load(loom::sync::atomic::Ordering::Relaxed) {
                    port.send(MonoNs(sent.len() as u64), &[7]).unwrap();
                    sent.push(sent.len() as u64);
                }
                port.send(MonoNs(9), &[7]).unwrap();
                sent.push(9);
                sent
            });
            let (mut line, mut sent, mut taken) = (Some(line), Vec::new(), Vec::new());
            ends(
                &|| stopping.store(true, loom::sync::atomic::Ordering::Relaxed),
                &mut || sent = line.take().unwrap().join().unwrap(),
                &mut || taken.extend(std::iter::from_fn(|| reader.take_next()).map(|(at, _)| at)),
            );
            assert_eq!(taken, sent);
        })
    }

    #[test]
    fn stop_drains_every_delivered_packet() {
        let executions = line_and_stop("the lines' stop", |tell, wait, drain| wind_up(tell, wait, drain));
        assert!(executions > 5, "{executions}");
    }

    #[test]
    #[should_panic = "assertion `left == right` failed"]
    fn loom_model_detects_a_stop_that_drains_too_early() {
        line_and_stop("the lines' stop, drained first", |tell, wait, drain| wind_up(tell, drain, wait));
    }
}
