//! A custom outlet: it puts flagged sections into a bounded queue, and another thread prints them.
//!
//! Run: `cargo run --example own_outlet [LOG.mcap]`. Without a log it uses a golden log of a vehicle that moves too
//! fast.

use std::error::Error;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::thread;
use std::time::Duration;

use crossbeam::queue::ArrayQueue;
use headrace_config::Document;
use headrace_coverage::{Cause, Judgement};
use headrace_devices::KINDS;
use headrace_geometry::time::MonoNs;
use headrace_monitor::merge::MAX_TICK_BYTES;
use headrace_monitor::messages::Notice;
use headrace_monitor::outlet::Outlet;
use headrace_monitor::pilot_text::station;
use headrace_monitor::view::DiveView;
use headrace_monitor::{App, Plugin, PluginError};
use headrace_replay::drive::{Pace, drive};
use headrace_replay::player::Player;
use headrace_vehicle::VehicleConfig;

const GOLDEN: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/golden/too-fast.mcap");
const CAPACITY: usize = 256;

/// A flagged section, as passed to the printing thread.
struct Flag {
    at: MonoNs,
    from_m: f64,
    hole_m: f64,
    cause: Option<Cause>,
}

/// The queue between the loop and the printing thread.
struct Queue {
    flags: ArrayQueue<Flag>,
    dropped: AtomicU64,
    ended: AtomicBool,
}

struct FlagOutlet(Arc<Queue>);

impl Plugin for FlagOutlet {
    fn build(&self, app: &mut App) -> Result<(), PluginError> {
        app.add_outlet(Self(Arc::clone(&self.0)));
        Ok(())
    }
}

impl Outlet for FlagOutlet {
    /// Queues new flags; called at the end of each tick.
    ///
    /// The loop never waits: flags that don't fit in the queue are dropped and counted.
    fn publish(&mut self, dive: &DiveView<'_>) -> usize {
        let sections = &dive.coverage().sections;
        for notice in dive.notices() {
            let Notice::Section { section: index, at, change: Judgement::Raised } = notice else { continue };
            let Some(section) = sections.get(index) else { continue };
            let flag = Flag {
                at,
                from_m: sections.bounds_m(index).0,
                hole_m: section.hole.map_or(f64::INFINITY, |hole| hole.diameter_m),
                cause: section.evidence.map(|evidence| evidence.cause),
            };
            if self.0.flags.push(flag).is_err() {
                self.0.dropped.fetch_add(1, Ordering::Relaxed);
            }
        }
        MAX_TICK_BYTES
    }
}

/// Prints flags until the dive has ended and the queue is empty.
fn print(queue: &Queue) {
    loop {
        // The end of the dive is read before the queue, so that flags pushed before the end are printed.
        let ended = queue.ended.load(Ordering::Acquire);
        while let Some(Flag { at, from_m, hole_m, cause }) = queue.flags.pop() {
            let cause = cause.map_or("unknown", Cause::as_str);
            println!("{:7.2} s  ch {}  hole {hole_m:.2} m  {cause}", at.as_secs_f64(), station(from_m));
        }
        if ended {
            return;
        }
        thread::sleep(Duration::from_millis(10));
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let log = std::env::args_os().nth(1).map_or_else(|| PathBuf::from(GOLDEN), PathBuf::from);
    let mut player = Player::open(&[log])?;
    let text = player.info().vehicle_toml.clone().ok_or("no vehicle file is attached to this log")?;
    let no_files = |_: &str| Err("is not read by this example".to_owned());
    let vehicle = VehicleConfig::parse(Document::new("vehicle.toml", &text), &KINDS, &no_files)?;

    let (flags, dropped, ended) = (ArrayQueue::new(CAPACITY), AtomicU64::new(0), AtomicBool::new(false));
    let queue = Arc::new(Queue { flags, dropped, ended });
    let mut app = App::new(vehicle.mission());
    for sensor in &vehicle.sensors {
        app.add_device(sensor.as_ref())?;
    }
    app.add_plugin(&FlagOutlet(Arc::clone(&queue)))?;
    let mut dive = app.arm(vehicle.navigation())?;
    player.connect(dive.sources());

    thread::scope(|scope| {
        scope.spawn(|| print(&queue));
        let driven = drive(&mut dive, &mut player, Pace::default(), &mut |_| ());
        queue.ended.store(true, Ordering::Release);
        driven
    })?;
    println!("{} ticks, {} flags dropped", dive.ticks(), queue.dropped.load(Ordering::Relaxed));
    Ok(())
}
