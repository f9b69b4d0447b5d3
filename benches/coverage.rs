//! Compares headrace's sample store and hole search with other methods on the same samples, and measures the memory
//! of the store. Prints Markdown.
//!
//! `cargo bench -p headrace_tests --bench coverage` takes about a minute; `-- FAST` runs one mode alone, `-- memory`
//! runs only the memory part. Absolute times drift on shared machines, but the ratios hold. The tree of the crate
//! `kiddo` and the hash map answer queries at given points only. They are queried on a grid of points, so their hole
//! diameters D are only accurate to some centimetres. headrace and the triangulation are exact. kiddo before version 6
//! panicked if more than 32 samples had a coordinate in common, but ideal heads produce only a few such samples.

#![expect(clippy::disallowed_methods, reason = "a benchmark reads the clock")]
#![expect(clippy::disallowed_types, reason = "std's hash map is a reference here")]
#![expect(clippy::unwrap_used, reason = "a failed step ends the benchmark")]

use std::collections::HashMap;
use std::hint::black_box;
use std::time::{Duration, Instant};

use headrace_coverage::hole::FARTHEST_M;
use headrace_coverage::{HoleFinder, SampleStore, StoreLayout, WallSample};
use headrace_geometry::math;
use headrace_geometry::tunnel::{WallPoint, shapes};
use kiddo::{ImmutableKdTree, SquaredEuclidean};
use spade::{DelaunayTriangulation, Point2, Triangulation};

const SPEED_MPS: f64 = 0.197;
const ROUNDS: usize = 5;
const SECTION_M: f64 = 0.25;
const SECTIONS: usize = 40;
const LENGTH_M: f64 = 24.0;
/// Grid spacing of the points in a section at which kiddo and the hash map are queried, m.
const GRID_M: f64 = 0.05;

fn main() {
    let wanted = std::env::args().nth(1).filter(|word| !word.starts_with('-'));
    println!("{ROUNDS} rounds, best of each\n");
    println!("| what | ours | beside it | figure | ratio |\n|---|---|---|---|---|");
    for (mode, steps, turn_s, heads) in [
        ("SLOW", 1200, 21.6, 1),
        ("SLOW", 1200, 21.6, 4),
        ("MEDIUM", 600, 10.8, 2),
        ("FAST", 400, 8.0, 1),
        ("FAST", 400, 8.0, 4),
        ("FASTEST", 150, 4.8, 2),
    ] {
        if wanted.as_deref().is_some_and(|word| word != mode) {
            continue;
        }
        let samples = helix(steps, turn_s, heads);
        covering(&format!("{mode} x {heads}"), &samples);
        holes(&format!("{mode} x {heads}"), &samples);
    }
    if wanted.is_some_and(|word| word != "memory") {
        return;
    }
    println!("\n| what | samples | kept | resident | bytes a sample |\n|---|---|---|---|---|");
    memory();
}

/// Samples of ideal heads in time order. All heads are at the centre of a circular tunnel.
fn helix(steps: u32, turn_s: f64, heads: u32) -> Vec<WallSample> {
    let profile = shapes::ceran().unwrap();
    let per_ping_m = SPEED_MPS * turn_s / f64::from(steps);
    let mut last: Vec<Option<f64>> = vec![None; heads as usize];
    let mut samples = Vec::new();
    for ping in 0..math::floor_to_i64(LENGTH_M / per_ping_m) {
        for head in 0..heads {
            let angle = math::TAU * (ping as f64 / f64::from(steps) + f64::from(head) / f64::from(heads));
            let hit = profile.cast(profile.reference(), [math::sin(angle), -math::cos(angle)]).unwrap();
            let (arc_m, head) = (hit.arc_m, head as usize);
            let around_m =
                last[head].replace(arc_m).map(|from| math::wrap_signed(arc_m - from, perimeter_m()));
            let step_m = around_m.map(|around_m| [per_ping_m, around_m]);
            samples.push(WallSample { x_m: ping as f64 * per_ping_m, arc_m, head, step_m, visit: 0 });
        }
    }
    samples
}

fn perimeter_m() -> f64 {
    shapes::ceran().unwrap().perimeter_m()
}

fn store(length_m: f64, capacity: u32) -> SampleStore {
    let perimeter_m = perimeter_m();
    SampleStore::new(StoreLayout { perimeter_m, from_m: -1.0, to_m: length_m + 1.0, cell_m: 0.25, capacity })
}

fn covered(samples: &[WallSample]) -> SampleStore {
    let mut store = store(LENGTH_M, u32::try_from(samples.len()).unwrap());
    for sample in samples {
        let at = WallPoint { x_m: sample.x_m, arc_m: sample.arc_m };
        black_box(store.nearest_pass_m(at, FARTHEST_M));
        store.insert(*sample).unwrap();
    }
    store
}

fn best<T>(mut work: impl FnMut() -> T) -> (Duration, T) {
    let timed = |work: &mut dyn FnMut() -> T| {
        let started = Instant::now();
        let result = work();
        (started.elapsed(), result)
    };
    let rounds = (0..ROUNDS).map(|_| timed(&mut work));
    rounds.min_by_key(|(time, _)| *time).unwrap()
}

fn row(what: &str, ours_ns: f64, beside: &str, theirs_ns: f64) {
    println!("| {what} | {ours_ns:.0} ns | {beside} | {theirs_ns:.0} ns | {:.2} |", theirs_ns / ours_ns);
}

fn covering(what: &str, samples: &[WallSample]) {
    let per_sample = |time: Duration| time.as_secs_f64() * 1e9 / samples.len() as f64;
    let (ours, _) = best(|| covered(samples));
    let (hashed, _) = best(|| {
        let mut grid: HashMap<(i64, i64), (u32, f64)> = HashMap::new();
        for sample in samples {
            let cell = (math::floor_to_i64(sample.x_m / 0.05), math::floor_to_i64(sample.arc_m / 0.05));
            let entry = grid.entry(cell).or_default();
            *entry = (entry.0 + 1, sample.x_m);
        }
        grid
    });
    row(
        &format!("covering a sample, {what}"),
        per_sample(ours),
        "counting it in a HashMap of 5 cm cells",
        per_sample(hashed),
    );
}

/// Finds the holes of all sections with each method. The printed times are per sample in the sections.
fn holes(what: &str, samples: &[WallSample]) {
    let store = covered(samples);
    let sections = || (0..SECTIONS).map(|k| 7.0 + SECTION_M * k as f64);
    let per_sample = |time: Duration| {
        time.as_secs_f64() * 1e9 * LENGTH_M / (SECTION_M * SECTIONS as f64) / samples.len() as f64
    };
    let mut finder = HoleFinder::default();
    let (ours, exact) =
        best(|| sections().map(|x| finder.largest(&store, x, x + SECTION_M).diameter_m).collect::<Vec<_>>());
    let what = format!("hole, a sample, {what} (hole {:.2} m)", exact.iter().copied().fold(0.0, f64::max));
    let mut tolerant = HoleFinder::new(0.01);
    let (to_a_centimetre, _) =
        best(|| sections().map(|x| tolerant.largest(&store, x, x + SECTION_M).most_m).sum::<f64>());
    row(&what, per_sample(ours), "ours, to 1 cm", per_sample(to_a_centimetre));
    // Search radius of all methods except headrace's, m.
    let reach_m = exact.iter().copied().fold(0.0, f64::max) / 2.0 + 0.05;
    let around = |x: f64| {
        let window = (x - reach_m)..(x + SECTION_M + reach_m);
        let near = samples.iter().filter(move |s| window.contains(&s.x_m));
        // Samples near an edge of the unrolled wall are copied to the other side, because arc length is cyclic.
        near.flat_map(move |s| [-perimeter_m(), 0.0, perimeter_m()].map(|turn| [s.x_m, s.arc_m + turn]))
            .filter(move |s| s[1] > -reach_m - 0.1 && s[1] < perimeter_m() + reach_m + 0.1)
            .collect::<Vec<_>>()
    };
    let windows: Vec<_> = sections().map(|x| (x, around(x))).collect();
    let (spade, by_spade) =
        best(|| windows.iter().map(|(x, near)| by_triangulation(*x, near)).collect::<Vec<_>>());
    let apart = exact.iter().zip(&by_spade).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    row(&what, per_sample(ours), &format!("spade rebuilt (D apart by {apart:.0e} m)"), per_sample(spade));
    let (kiddo, by_kiddo) = best(|| windows.iter().map(|(x, near)| by_tree(*x, near)).collect::<Vec<_>>());
    let short = exact.iter().zip(&by_kiddo).map(|(a, b)| a - b).fold(0.0, f64::max);
    row(
        &what,
        per_sample(ours),
        &format!("kiddo rebuilt, every 5 cm (D short by {short:.3} m)"),
        per_sample(kiddo),
    );
    let (hashed, by_hash) =
        best(|| windows.iter().map(|(x, near)| by_hash_map(*x, near)).collect::<Vec<_>>());
    let short = exact.iter().zip(&by_hash).map(|(a, b)| a - b).fold(0.0, f64::max);
    row(
        &what,
        per_sample(ours),
        &format!("HashMap of cells, every 5 cm (D short by {short:.3} m)"),
        per_sample(hashed),
    );
}

/// Finds the largest hole of a section from Voronoi corners and edges.
///
/// Candidates are the Voronoi corners inside the section, and the points where Voronoi edges cross its ends.
fn by_triangulation(from_m: f64, near: &[[f64; 2]]) -> f64 {
    let points = near.iter().map(|[x, sigma]| Point2::new(*x, *sigma)).collect();
    let triangulation = DelaunayTriangulation::<Point2<f64>>::bulk_load(points).unwrap();
    let mut largest2 = 0.0_f64;
    for face in triangulation.inner_faces() {
        let (centre, radius2) = face.circumcircle();
        if (from_m..=from_m + SECTION_M).contains(&centre.x) && (0.0..=perimeter_m()).contains(&centre.y) {
            largest2 = largest2.max(radius2);
        }
    }
    for edge in triangulation.undirected_edges() {
        let sides = [edge.as_directed(), edge.as_directed().rev()].map(|side| side.face().as_inner());
        let [Some(a), Some(b)] = sides else { continue };
        let (a, b) = (a.circumcenter(), b.circumcenter());
        for end in [from_m, from_m + SECTION_M] {
            if (a.x < end) != (b.x < end) {
                let y = a.y + (b.y - a.y) * (end - a.x) / (b.x - a.x);
                let owner = edge.vertices()[0].position();
                if (0.0..=perimeter_m()).contains(&y) {
                    largest2 =
                        largest2.max((owner.x - end) * (owner.x - end) + (owner.y - y) * (owner.y - y));
                }
            }
        }
    }
    2.0 * math::sqrt(largest2)
}

/// Grid points of a section: chainage and arc length, m.
fn places(from_m: f64) -> impl Iterator<Item = [f64; 2]> {
    let columns = math::floor_to_i64(perimeter_m() / GRID_M);
    let rows = math::round_to_i64(SECTION_M / GRID_M);
    (0..=rows).flat_map(move |i| (0..columns).map(move |k| [from_m + i as f64 * GRID_M, k as f64 * GRID_M]))
}

fn by_tree(from_m: f64, near: &[[f64; 2]]) -> f64 {
    let tree = ImmutableKdTree::new_from_slice(near).unwrap();
    let distance2 =
        |place: [f64; 2]| tree.query(&place).nearest_one::<SquaredEuclidean<f64>>().execute().distance;
    2.0 * math::sqrt(places(from_m).map(distance2).fold(0.0, f64::max))
}

fn by_hash_map(from_m: f64, near: &[[f64; 2]]) -> f64 {
    const CELL_M: f64 = 0.25;
    let cell_of = |s: &[f64; 2]| s.map(|m| math::floor_to_i64(m / CELL_M));
    let mut cells: HashMap<[i64; 2], Vec<[f64; 2]>> = HashMap::new();
    for sample in near {
        cells.entry(cell_of(sample)).or_default().push(*sample);
    }
    let nearest2 = |place: [f64; 2]| {
        let [row, column] = cell_of(&place);
        let mut best2 = f64::INFINITY;
        for ring in 0_i64.. {
            // All cells of ring number `ring` are at least `ring` - 1 cell widths away from the query point.
            let inner_m = (ring - 1) as f64 * CELL_M;
            if ring > 0 && inner_m > 0.0 && inner_m * inner_m > best2 {
                break;
            }
            for i in -ring..=ring {
                let inside = i.abs() < ring;
                for k in (-ring..=ring).filter(|k| !inside || k.abs() == ring) {
                    for s in cells.get(&[row + i, column + k]).into_iter().flatten() {
                        let (dx, darc) = (s[0] - place[0], s[1] - place[1]);
                        best2 = best2.min(dx * dx + darc * darc);
                    }
                }
            }
        }
        best2
    };
    2.0 * math::sqrt(places(from_m).map(nearest2).fold(0.0, f64::max))
}

/// Resident memory of this process, bytes.
fn resident() -> f64 {
    let pages = std::fs::read_to_string("/proc/self/statm").unwrap_or_default();
    pages.split(' ').nth(1).and_then(|pages| pages.parse::<f64>().ok()).unwrap_or(f64::NAN) * 4096.0
}

/// Measures the memory that the samples of four heads in mode FAST need in ten hours, over 7 km and while parked. Each
/// head sends 49 pings a second, with noise of some centimetres.
fn memory() {
    for (what, length_m) in [("7 km in ten hours", 7_000.0), ("parked for ten hours", 0.0)] {
        let (before, perimeter_m) = (resident(), perimeter_m());
        let mut store = store(7_000.0, 28_000_000);
        let pings = 36_000 * 49;
        let mut state = 1_u64;
        let mut noise_m = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            ((state >> 33) as f64 / (1_u64 << 31) as f64 - 0.5) * 0.06
        };
        let mut last = [None; 4];
        for ping in 0..pings {
            for (head, last) in last.iter_mut().enumerate() {
                let turns = f64::from(ping) / 400.0 + head as f64 / 4.0;
                let arc_m = math::wrap(turns * perimeter_m + noise_m(), perimeter_m);
                let x_m = length_m * f64::from(ping) / f64::from(pings) + 0.3 * noise_m();
                let step = |(from_x_m, from_arc_m): (f64, f64)| {
                    [x_m - from_x_m, math::wrap_signed(arc_m - from_arc_m, perimeter_m)]
                };
                let step_m = last.replace((x_m, arc_m)).map(step);
                store.insert(WallSample { x_m, arc_m, head, step_m, visit: 0 }).unwrap();
            }
        }
        let (samples, mapped) = (4 * pings, resident() - before);
        println!(
            "| {what} | {samples} | {} | {:.1} MiB | {:.2} |",
            store.usage().kept,
            mapped / 1_048_576.0,
            mapped / f64::from(samples)
        );
    }
}
