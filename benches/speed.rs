//! Speed of the loop, each figure compared with a reference measured in the same run. Prints Markdown.
//!
//! `cargo bench -p headrace_tests` runs on one core for about a minute. Absolute times drift on shared machines, but
//! the ratios hold.

#![expect(clippy::disallowed_methods, reason = "a benchmark reads the clock")]
#![expect(clippy::disallowed_types, reason = "std's hash map is a reference here")]
#![expect(clippy::unwrap_used, reason = "a failed step ends the benchmark")]

use std::collections::HashMap;
use std::hint::black_box;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use bevy_ecs::prelude::{Res, Resource};
use bevy_ecs::schedule::{IntoScheduleConfigs, Schedule, SingleThreadedExecutor};
use bevy_ecs::world::World;
use headrace_coverage::hole::FARTHEST_M;
use headrace_coverage::{
    GridLayout, HoleFinder, PassError, SampleStore, Sections, Soundings, StoreLayout, Visit, WallSample,
};
use headrace_geometry::math;
use headrace_geometry::snapshot::{Restorer, Saver, SnapshotError, Stateful};
use headrace_geometry::time::{DurNs, MonoNs};
use headrace_geometry::tunnel::{WallPoint, shapes};
use headrace_monitor::merge::MAX_TICK_BYTES;
use headrace_monitor::outlet::Outlet;
use headrace_monitor::part::Part;
use headrace_monitor::resources::Coverage;
use headrace_monitor::run::Loop;
use headrace_monitor::stage::Stage;
use headrace_monitor::view::DiveView;
use headrace_monitor::{App, SourceSpec};
use headrace_sampling::Target;
use headrace_sensor::codec::CodecCounts;
use headrace_sensor::device::{Decoder, Direction};
use headrace_sensor::reading::{Decoded, Packet};
use headrace_simulator::{START, Scene, Simulation};
use headrace_tests::scenes;
use headrace_vehicle::Mission;

const SCENE: &str = "vehicle = \"vita2-4.toml\"\n[vehicle_changes]\nheads.planned_speed_mps = 0.197\n[trajectory]\n\
    [[trajectory.legs]]\ndistance_m = 120\nspeed_mps = 0.197\n";
const SPEED_MPS: f64 = 0.197;
const TICK: DurNs = DurNs(20_000_000);
const ROUNDS: usize = 5;

fn main() {
    println!(
        "{}, {} {}, {} rounds, best of each\n",
        cpu(),
        std::env::consts::ARCH,
        std::env::consts::OS,
        ROUNDS
    );
    println!("| what | figure | yardstick in the same run | ratio |\n|---|---|---|---|");
    // A part's name as argument runs that part alone: `cargo bench -p headrace_tests -- holes`.
    let wanted = std::env::args().nth(1).filter(|word| !word.starts_with('-'));
    let benches: [(&str, fn()); 6] = [
        ("loop", whole_loop),
        ("stages", by_stage),
        ("alerts", alerts),
        ("idle", idle_tick),
        ("covering", covering),
        ("holes", holes),
    ];
    for (name, bench) in benches {
        if wanted.as_deref().is_none_or(|word| word == name) {
            bench();
        }
    }
}

fn row(what: &str, figure: &str, yardstick: &str, ratio: f64) {
    println!("| {what} | {figure} | {yardstick} | {ratio:.2} |");
}

fn cpu() -> String {
    let info = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let model =
        info.lines().find_map(|line| line.strip_prefix("model name")).unwrap_or(": unknown processor");
    model.trim_start_matches(['\t', ' ', ':']).to_owned()
}

fn best(mut work: impl FnMut() -> Duration) -> Duration {
    (0..ROUNDS).map(|_| work()).min().unwrap()
}

struct Nothing;

impl Stateful for Nothing {
    fn save(&self, _: &mut Saver) {}

    fn restore(&mut self, _: &mut Restorer<'_>) -> Result<(), SnapshotError> {
        Ok(())
    }
}

impl Decoder for Nothing {
    fn decode(&mut self, _: Packet<'_>, _: &mut dyn FnMut(Decoded)) {}

    fn counts(&self) -> CodecCounts {
        CodecCounts::default()
    }
}

/// Names and end times of the loop's stages, in the order in which the stages ended.
#[derive(Resource, Clone)]
struct Ends(Arc<Mutex<Vec<(String, Instant)>>>);

/// Adds a system after each stage of a part of the loop. The system records the stage's end.
fn note_stages<S: Stage>(part: &mut Part<S>, ends: &Ends) {
    part.insert_resource(ends.clone());
    for stage in S::ALL {
        let name = format!("{stage:?}");
        part.add_systems_after(*stage, move |ends: Res<'_, Ends>| {
            ends.0.lock().unwrap().push((name.clone(), Instant::now()));
        });
    }
}

/// An outlet that records when the alerter has finished, because outlets run directly after it.
struct Alerted(Ends);

impl Outlet for Alerted {
    fn publish(&mut self, _: &DiveView<'_>) -> usize {
        self.0.0.lock().unwrap().push((ALERTER.to_owned(), Instant::now()));
        MAX_TICK_BYTES
    }
}

/// Name under which the alerter is listed among the loop's stages.
const ALERTER: &str = "Alerter";

/// A loop that records the end of each stage.
fn noting(scene: &Scene, ends: &Ends) -> Loop {
    let mut app = app(scene, true);
    note_stages(&mut app.placer, ends);
    note_stages(&mut app.adviser, ends);
    note_stages(&mut app.surveyor, ends);
    app.add_outlet(Alerted(ends.clone()));
    app.arm(scene.vehicle.navigation()).unwrap()
}

fn armed(scene: &Scene, decoding: bool) -> Loop {
    app(scene, decoding).arm(scene.vehicle.navigation()).unwrap()
}

fn app(scene: &Scene, decoding: bool) -> App {
    let vehicle = &scene.vehicle;
    let mut app = App::new(Mission { length_m: 200.0, ..vehicle.mission() });
    for (sensor, config) in vehicle.sensors.iter().zip(&vehicle.sensor_configs) {
        if decoding {
            app.add_device(sensor.as_ref()).unwrap();
        } else {
            let id = config.id.clone();
            let decoder = Box::new(Nothing);
            app.add_source(SourceSpec {
                id,
                plugin: String::new(),
                connect: String::new(),
                decoder,
                ring_bytes: 1 << 17,
            })
            .unwrap();
        }
    }
    app
}

/// A message of a simulated device, to be fed to the loop.
struct Kept {
    at: MonoNs,
    source: u16,
    bytes: Vec<u8>,
}

/// Feeds all messages tick by tick. Returns the duration of each tick, including the time to fill its rings.
fn run(dive: &mut Loop, messages: &[Kept]) -> Vec<Duration> {
    run_noting(dive, messages, &mut Vec::new())
}

/// As [`run`]; also records the start of each tick.
fn run_noting(dive: &mut Loop, messages: &[Kept], begins: &mut Vec<Instant>) -> Vec<Duration> {
    let mut ports: Vec<_> = (0..dive.sources().len()).map(|source| dive.take_port(source).unwrap()).collect();
    let mut ticks = Vec::new();
    let mut rest = messages;
    let mut until = START;
    while !rest.is_empty() {
        until = until + TICK;
        let (now, later) = rest.split_at(rest.partition_point(|message| message.at < until));
        rest = later;
        let started = Instant::now();
        for message in now {
            ports[usize::from(message.source)].send(message.at, &message.bytes).unwrap();
        }
        begins.push(Instant::now());
        dive.tick(until);
        ticks.push(started.elapsed());
    }
    ticks
}

fn whole_loop() {
    let scene = scenes::scene(SCENE);
    let (data_s, messages) = messages_of(&scene);
    let mut ticks = Vec::new();
    let mut samples = 0;
    let full = best(|| {
        let mut dive = armed(&scene, true);
        ticks = run(&mut dive, &messages);
        samples = dive.view().tally().samples;
        ticks.iter().sum()
    });
    let bare = best(|| run(&mut armed(&scene, false), &messages).iter().sum());
    let per_packet = |time: Duration| time.as_secs_f64() * 1e9 / messages.len() as f64;
    row(
        &format!("whole loop, four heads, {} packets, {samples} samples", messages.len()),
        &format!(
            "{:.2} M packets/s, {:.0} ns a packet, {:.0} x real time",
            1e3 / per_packet(full),
            per_packet(full),
            data_s / full.as_secs_f64()
        ),
        &format!("rings, merge and empty decoders: {:.0} ns a packet", per_packet(bare)),
        full.as_secs_f64() / bare.as_secs_f64(),
    );
    ticks.sort_unstable();
    let at = |share: usize| ticks[(ticks.len() - 1) * share / 1000].as_secs_f64() * 1e6;
    row(
        "a tick of 20 ms of that dive",
        &format!(
            "p50 {:.1} us, p99 {:.1} us, p99.9 {:.1} us, max {:.1} us",
            at(500),
            at(990),
            at(999),
            at(1000)
        ),
        "its 20 ms",
        at(500) / 20_000.0,
    );
}

/// Duration of a scene, and the messages for the loop.
fn messages_of(scene: &Scene) -> (f64, Vec<Kept>) {
    let mut simulation = Simulation::new(scene).unwrap();
    let data_s = simulation.duration_s();
    let mut messages: Vec<Kept> = Vec::new();
    while let Some(message) = simulation.next_message() {
        if message.direction == Direction::Received {
            messages.push(Kept { at: message.at, source: message.source, bytes: message.bytes.to_vec() });
        }
    }
    (data_s, messages)
}

/// Returns the loop after a dive, and the duration of each stage in each tick, us.
///
/// The duration of the first stage also contains all work before it: filling rings, merging, and starting the schedule.
/// If a stage runs several times in a tick, its durations are added up.
fn spans(scene: &Scene) -> (Loop, Vec<(String, Vec<f64>)>) {
    let (_, messages) = messages_of(scene);
    let ends = Ends(Arc::default());
    let mut dive = noting(scene, &ends);
    // The ends recorded so far are dropped, because arming a loop also runs a tick.
    ends.0.lock().unwrap().clear();
    let mut begins = Vec::new();
    run_noting(&mut dive, &messages, &mut begins);
    let mut spans: Vec<(String, Vec<f64>)> = Vec::new();
    let ends = core::mem::take(&mut *ends.0.lock().unwrap());
    let mut ends = ends.into_iter().peekable();
    for (tick, begin) in begins.iter().enumerate() {
        let mut before = *begin;
        while let Some((name, end)) =
            ends.next_if(|(_, end)| begins.get(tick + 1).is_none_or(|next| end <= next))
        {
            let place = spans.iter().position(|(other, _)| *other == name).unwrap_or_else(|| {
                spans.push((name, Vec::new()));
                spans.len() - 1
            });
            let span = &mut spans[place].1;
            span.resize(tick + 1, 0.0);
            span[tick] += (end - before).as_secs_f64() * 1e6;
            before = end;
        }
    }
    (dive, spans)
}

fn percentiles(mut span: Vec<f64>) -> String {
    span.sort_unstable_by(f64::total_cmp);
    let at = |thousandths: usize| span[(span.len() - 1) * thousandths / 1000];
    let [p50, p99, p999, most] = [500, 990, 999, 1000].map(at);
    format!("p50 {p50:.2} us, p99 {p99:.1} us, p99.9 {p999:.1} us, max {most:.0} us")
}

/// Prints percentiles of each stage over the ticks of a dive.
fn by_stage() {
    let (_, spans) = spans(&scenes::scene(SCENE));
    let whole_us: f64 = spans.iter().flat_map(|(_, span)| span).sum();
    for (number, (stage, span)) in spans.into_iter().enumerate() {
        let share = span.iter().sum::<f64>() / whole_us;
        let what = format!("stage {stage}{}", if number == 0 { ", merge included" } else { "" });
        row(&what, &percentiles(span), "all stages", share);
    }
}

/// Cost of the alerter in a dive with a missed stretch every four metres, compared with a dive that misses
/// nothing.
fn alerts() {
    const PAIRS: usize = 40;
    const WAY: &str =
        "vehicle = \"vita2-4.toml\"\n[vehicle_changes]\nheads.planned_speed_mps = 0.08\n[trajectory]\n";
    let leg = |(distance_m, speed_mps): (u32, f64)| {
        format!("[[trajectory.legs]]\ndistance_m = {distance_m}\nspeed_mps = {speed_mps}\n")
    };
    let of_alerter = |fast_mps: f64| {
        let legs = [(1, fast_mps), (3, 0.08)].map(leg).concat().repeat(PAIRS);
        let (dive, spans) = spans(&scenes::scene(&format!("{WAY}{legs}")));
        let list = dive.view().alert_list();
        let span = spans.into_iter().find(|(stage, _)| stage == ALERTER).unwrap().1;
        (list.raised(), list.iter().count(), span)
    };
    let [many, few] = [0.4, 0.08].map(of_alerter);
    let mean = |span: &[f64]| span.iter().sum::<f64>() / span.len() as f64;
    row(
        &format!("alerter, {} alerts raised, {} in the list at the end", many.0, many.1),
        &format!("mean {:.2} us, {}", mean(&many.2), percentiles(many.2.clone())),
        &format!("{} raised: mean {:.2} us, {}", few.0, mean(&few.2), percentiles(few.2.clone())),
        mean(&many.2) / mean(&few.2),
    );
}

fn nothing() {}

fn idle_tick() {
    const RUNS: u32 = 200_000;
    let mut dive = armed(&scenes::scene(SCENE), true);
    let idle = best(|| {
        let started = Instant::now();
        for _ in 0..RUNS {
            black_box(dive.tick(MonoNs(0)));
        }
        started.elapsed() / RUNS
    });
    let mut world = World::new();
    let mut schedule = Schedule::default();
    schedule.set_executor(SingleThreadedExecutor::new());
    // The reference is a schedule with as many chained systems as the loop has.
    schedule.add_systems((|| nothing(), || nothing(), || nothing(), || nothing(), || nothing()).chain());
    let bare = best(|| {
        let started = Instant::now();
        for _ in 0..RUNS {
            schedule.run(&mut world);
        }
        started.elapsed() / RUNS
    });
    row(
        "a tick with nothing to do",
        &format!("{} ns", idle.as_nanos()),
        &format!("a bare schedule of five empty systems: {} ns", bare.as_nanos()),
        idle.as_secs_f64() / bare.as_secs_f64(),
    );
}

/// Samples of ideal heads in time order. All heads are at the centre of a circular tunnel.
fn helix(steps: u32, turn_s: f64, heads: u32, length_m: f64) -> Vec<(f64, f64, usize)> {
    let profile = shapes::ceran().unwrap();
    let per_ping_m = SPEED_MPS * turn_s / f64::from(steps);
    let pings = math::floor_to_i64(length_m / per_ping_m);
    let mut samples = Vec::new();
    for ping in 0..pings {
        for head in 0..heads {
            let angle = math::TAU * (ping as f64 / f64::from(steps) + f64::from(head) / f64::from(heads));
            let hit = profile.cast(profile.reference(), [math::sin(angle), -math::cos(angle)]).unwrap();
            samples.push((ping as f64 * per_ping_m, hit.arc_m, head as usize));
        }
    }
    samples
}

fn store(length_m: f64, capacity: usize) -> SampleStore {
    SampleStore::new(StoreLayout {
        perimeter_m: shapes::ceran().unwrap().perimeter_m(),
        from_m: -1.0,
        to_m: length_m + 1.0,
        cell_m: 0.25,
        capacity: u32::try_from(capacity).unwrap(),
    })
}

/// Stores all samples as the loop's cover stage does. For each sample, finds the nearest pass, stores the sample, and
/// marks the sections that it touches.
fn cover(samples: &[(f64, f64, usize)], length_m: f64) -> Coverage {
    let mut coverage = Coverage {
        store: store(length_m, samples.len()),
        sections: Sections::new(0.25, Target::new(0.5), -1.0, length_m + 1.0),
        frontier: headrace_coverage::Frontier::default(),
        soundings: Soundings::new(GridLayout {
            perimeter_m: shapes::ceran().unwrap().perimeter_m(),
            from_m: 0.0,
            to_m: length_m,
            node_m: 0.5,
        }),
        unsure: None,
        missing_samples: headrace_coverage::MissingSamples::default(),
    };
    let mut last = [None; 8];
    let profile = shapes::ceran().unwrap();
    let errors = [PassError::default(); 2];
    let visit = Visit { number: 0, tie: 0, at: MonoNs(0), errors };
    for (x_m, arc_m, head) in samples {
        let at = WallPoint { x_m: *x_m, arc_m: *arc_m };
        black_box(coverage.store.nearest_pass_m(at, FARTHEST_M));
        let step_m = last[*head].map(|(from_x_m, from_arc_m): (f64, f64)| {
            [x_m - from_x_m, math::wrap_signed(arc_m - from_arc_m, coverage.store.perimeter_m())]
        });
        last[*head] = Some((*x_m, *arc_m));
        let sample = WallSample { x_m: *x_m, arc_m: *arc_m, head: *head, step_m, visit: 0 };
        coverage.store.insert(sample).unwrap();
        coverage.soundings.add(at);
        coverage.sections.touch(*x_m, &visit, &profile);
    }
    coverage
}

fn covering() {
    let length_m = 100.0;
    let samples = helix(400, 8.0, 4, length_m);
    let per_sample = |time: Duration| time.as_secs_f64() * 1e9 / samples.len() as f64;
    let ours = best(|| {
        let started = Instant::now();
        black_box(cover(&samples, length_m));
        started.elapsed()
    });
    let hashed = best(|| {
        let mut grid: HashMap<(i64, i64), (u32, f64)> = HashMap::new();
        let started = Instant::now();
        for (x_m, arc_m, _) in &samples {
            let cell = (math::floor_to_i64(x_m / 0.05), math::floor_to_i64(arc_m / 0.05));
            let entry = grid.entry(cell).or_default();
            *entry = (entry.0 + 1, *x_m);
        }
        black_box(&grid);
        started.elapsed()
    });
    row(
        "covering a sample (nearest pass, keeping, sections)",
        &format!("{:.0} ns", per_sample(ours)),
        &format!("counting it in a hash map of 5 cm cells: {:.0} ns", per_sample(hashed)),
        ours.as_secs_f64() / hashed.as_secs_f64(),
    );
}

fn holes() {
    for (mode, steps, turn_s, heads) in
        [("FAST", 400, 8.0, 4), ("SLOW", 1200, 21.6, 1), ("SLOW", 1200, 21.6, 4), ("FASTEST", 150, 4.8, 2)]
    {
        let length_m = 60.0;
        let samples = helix(steps, turn_s, heads, length_m);
        let coverage = cover(&samples, length_m);
        let mut finder = HoleFinder::default();
        let sections = 160;
        let ours = best(|| {
            let started = Instant::now();
            for k in 0..sections {
                let from_m = 10.0 + 0.25 * f64::from(k);
                black_box(finder.largest(&coverage.store, from_m, from_m + 0.25));
            }
            started.elapsed()
        });
        let passes = best(|| {
            let mut store = coverage.store.clone();
            let started = Instant::now();
            for (x_m, arc_m, _) in &samples {
                let at = WallPoint { x_m: x_m + 0.1, arc_m: arc_m + 0.1 };
                black_box(store.nearest_pass_m(at, FARTHEST_M));
            }
            started.elapsed()
        });
        let in_sections = samples.len() as f64 * (0.25 * f64::from(sections)) / length_m;
        let per_sample = ours.as_secs_f64() * 1e9 / in_sections;
        let per_query = passes.as_secs_f64() * 1e9 / samples.len() as f64;
        row(
            &format!("exact hole, {mode} x {heads}, a sample"),
            &format!(
                "{per_sample:.0} ns ({:.0} us a section)",
                ours.as_secs_f64() * 1e6 / f64::from(sections)
            ),
            &format!("one search for the nearest pass: {per_query:.0} ns"),
            per_sample / per_query,
        );
    }
}
