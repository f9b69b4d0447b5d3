//! Cost of the viewers' data in a recorded demonstration. Prints Markdown.
//!
//! The bench compares the time to build the view with all other work of the recorder's thread. It also measures the
//! bytes that the view adds to the log.

#![expect(clippy::disallowed_methods, reason = "a benchmark reads the clock")]
#![expect(clippy::unwrap_used, reason = "a failed step ends the benchmark")]

use std::path::Path;
use std::process::Command;
use std::time::{Duration, Instant};

use headrace_geometry::time::MonoNs;
use headrace_geometry::tunnel::shapes;
use headrace_replay::log::{DerivedChannels, LogHeader, LogReader, LogWriter, Made, MessageKind};
use headrace_replay::record::result_channels;
use headrace_replay::view::{Site, View};

const HEADRACE: &str = env!("CARGO_BIN_EXE_headrace_under_test");
/// Number of timed passes over the log. The fastest pass counts.
const PASSES: u32 = 5;

/// A message that the loop puts into the recorder's queue.
struct Entry {
    lane: Lane,
    at: MonoNs,
    data: Vec<u8>,
}

#[derive(Clone, Copy)]
enum Lane {
    Raw(u16),
    Tick,
    Result(u16),
}

fn main() {
    let folder = std::env::temp_dir().join(format!("headrace-view-{}", std::process::id()));
    let demo =
        Command::new(HEADRACE).args(["demo", "--speed", "max", "--out"]).arg(&folder).output().unwrap();
    assert!(demo.status.code() != Some(2), "{}", String::from_utf8_lossy(&demo.stderr));
    let (header, entries) = read(&folder.join("dive.mcap"));
    std::fs::remove_dir_all(&folder).unwrap();
    let dive_s = entries.last().unwrap().at.since(entries.first().unwrap().at).as_secs_f64();

    let (plain, plain_bytes) = fastest(|| written(&header, &entries, false));
    let (whole, whole_bytes) = fastest(|| written(&header, &entries, true));
    let (made, messages) = fastest(|| viewed(&entries).len() as u64);
    let share = |took: Duration| took.as_secs_f64() / dive_s * 100.0;
    println!("| what | figure | yardstick in the same run | ratio |\n|---|---|---|---|");
    println!(
        "| making {messages} messages for viewers of a dive of {dive_s:.0} s | {:.3} % of a core at real speed | writing \
         and compressing that dive without them: {:.3} % | {:.2} |",
        share(made),
        share(plain),
        made.as_secs_f64() / plain.as_secs_f64()
    );
    println!(
        "| the recorder's thread with them | {:.3} % of a core | the same | {:.2} |",
        share(whole),
        whole.as_secs_f64() / plain.as_secs_f64()
    );
    println!(
        "| the log with them | {:.2} MB | the log without: {:.2} MB | {:.3} |",
        whole_bytes as f64 / 1e6,
        plain_bytes as f64 / 1e6,
        whole_bytes as f64 / plain_bytes as f64
    );
}

fn fastest(mut work: impl FnMut() -> u64) -> (Duration, u64) {
    let mut least = (Duration::MAX, 0);
    for _ in 0..PASSES {
        let started = Instant::now();
        let result = work();
        least = (least.0.min(started.elapsed()), result);
    }
    least
}

/// The log's messages, without those for viewers.
fn read(log: &Path) -> (LogHeader, Vec<Entry>) {
    let mut reader = LogReader::open(log).unwrap();
    let info = reader.header();
    let header = LogHeader {
        vehicle_toml: info.vehicle_toml.clone().unwrap(),
        sources: info.sources.clone(),
        ticks: true,
        results: result_channels(),
        ..LogHeader::default()
    };
    let mut entries = Vec::new();
    while let Some(message) = reader.next().unwrap() {
        let result = |topic: &str| header.results.iter().position(|result| result.topic == topic).unwrap();
        let lane = match message.kind {
            MessageKind::Raw { source } => Lane::Raw(source),
            MessageKind::Tick => Lane::Tick,
            MessageKind::Result { topic } if !topic.contains("/view/") => {
                Lane::Result(u16::try_from(result(topic)).unwrap())
            }
            _ => continue,
        };
        entries.push(Entry { lane, at: message.log_time, data: message.data.to_vec() });
    }
    (header, entries)
}

fn view() -> View {
    // Tunnel and heads of the demonstration dive.
    View::new(Site {
        profile: shapes::ceran().unwrap(),
        target_m: 0.5,
        section_m: 0.25,
        run_up_m: 0.5,
        length_m: 1000.0,
        head_descriptions: headrace_monitor::head_descriptions::HeadDescriptions::default(),
        heads: (0..4).collect(),
    })
}

fn viewed(entries: &[Entry]) -> Vec<Made> {
    let (mut view, mut made) = (view(), Vec::new());
    for entry in entries {
        if let Lane::Result(channel) = entry.lane {
            view.take(channel, entry.at, &entry.data, &mut made);
        }
    }
    view.end(&mut made);
    made
}

/// Size of the dive's log, bytes.
fn written(header: &LogHeader, entries: &[Entry], with_view: bool) -> u64 {
    let mut log = LogWriter::new(std::io::sink(), header).unwrap();
    let (mut view, mut made) = (view(), Vec::new());
    for entry in entries {
        match entry.lane {
            Lane::Raw(source) => log.raw(source, entry.at, entry.at, &entry.data).unwrap(),
            // The message of a tick contains the order of the packets in that tick.
            Lane::Tick => {
                let tick = headrace_replay::log::format::Tick::decode(&entry.data).unwrap();
                log.tick(tick.index, tick.now, &tick.order().collect::<Vec<_>>()).unwrap();
            }
            Lane::Result(channel) => {
                log.result(channel, entry.at, &entry.data).unwrap();
                if with_view {
                    view.take(channel, entry.at, &entry.data, &mut made);
                }
            }
        }
        for Made { channel, at, bytes } in made.drain(..) {
            log.result(channel, at, &bytes).unwrap();
        }
    }
    if with_view {
        view.end(&mut made);
    }
    for Made { channel, at, bytes } in made.drain(..) {
        log.result(channel, at, &bytes).unwrap();
    }
    log.finish().unwrap().1.bytes
}
