//! Cost of determinism and memory. These properties are not a choice, so there is no picture.

use std::hint::black_box;

use headrace_coverage::{SampleStore, StoreLayout, WallSample};
use headrace_geometry::math;

use crate::error::CostError;
use crate::measure::in_turns;
use crate::point::{Given, Interval};
use crate::scene::Inputs;
use headrace_oracle::timed;

/// Number of arguments for which each mathematical function is compared.
const ARGUMENTS: u32 = 100_000;
/// Length of a tunnel, m. `PERIMETER_M` is the perimeter of its wall.
const LENGTH_M: f64 = 7000.0;
const PERIMETER_M: f64 = 28.0;
/// Number of samples per metre of tunnel.
const PER_M: u32 = 1_000;
/// Length of tunnel whose samples stay unpacked, m. `PACKED_M` is the length whose samples are packed.
const OPEN_M: u32 = 20;
const PACKED_M: u32 = 160;
/// Bytes of a sample before packing: its chainage, arc length, step, visit and head number.
const PLAIN_BYTES: usize = size_of::<WallSample>();

/// Measures the costs of determinism and memory, as a table.
///
/// Errors: see [`CostError`].
pub fn tabulate(inputs: &Inputs<'_>, progress: &mut dyn FnMut(&str)) -> Result<Given, CostError> {
    progress("what determinism and memory cost");
    let mut rows = Vec::new();
    for function in FUNCTIONS {
        rows.push(of_function(inputs, &function)?);
    }
    rows.push(single_precision(inputs)?);
    rows.push(packing(inputs)?);
    let columns = ["what", "lost", "ns with it", "ns without it"].map(str::to_owned).to_vec();
    Ok(Given {
        title: "What determinism and memory cost".to_owned(),
        text: "The same bytes give the same results on every machine, in bounded memory. This has a cost that no setting avoids. Times are \
               the CPU time of one call, distance or sample, as the median of the rounds."
            .to_owned(),
        columns,
        rows,
    })
}

type Function = (&'static str, fn(f64) -> f64, fn(f64) -> f64, [f64; 2]);

/// For each function: its name, the implementation in `core`, the platform's implementation, and the range of
/// arguments.
#[expect(clippy::disallowed_methods, reason = "the platform's functions are the reference for the core's")]
const FUNCTIONS: [Function; 4] = [
    ("sine", math::sin, |x| x.sin(), [-7.0, 7.0]),
    ("arc tangent", |x| math::atan2(x, 1.0), |x| x.atan2(1.0), [-10.0, 10.0]),
    ("exponential", math::exp, |x| x.exp(), [-10.0, 1.0]),
    ("logarithm", math::ln, |x| x.ln(), [0.01, 100.0]),
];

/// Evenly spaced arguments over a range.
fn arguments([from, to]: [f64; 2]) -> impl Iterator<Item = f64> {
    (0..ARGUMENTS).map(move |k| from + (to - from) * (f64::from(k) + 0.5) / f64::from(ARGUMENTS))
}

/// Compares two functions over a range of arguments.
///
/// Returns the percentage of arguments for which the results differ in any bit, and the largest difference in units of
/// the last place.
fn differing(ours: fn(f64) -> f64, others: fn(f64) -> f64, range: [f64; 2]) -> (f64, u64) {
    let (mut count, mut most) = (0_u32, 0);
    for argument in arguments(range) {
        let (one, other) = (ours(argument).to_bits(), others(argument).to_bits());
        count += u32::from(one != other);
        most = one.abs_diff(other).max(most);
    }
    (100.0 * f64::from(count) / f64::from(ARGUMENTS), most)
}

fn of_function(inputs: &Inputs<'_>, function: &Function) -> Result<Vec<String>, CostError> {
    let (name, ours, others, range) = *function;
    let (share, most) = differing(ours, others, range);
    let costs = ns_each(inputs, ARGUMENTS, &[ours, others], |function| {
        let sum: f64 = arguments(range).map(|argument| function(black_box(argument))).sum();
        black_box(sum);
    })?;
    let lost =
        format!("{share:.1} % of results differ from this platform's, by {most} in the last place at most");
    Ok(row(&format!("libm: {name}"), lost, &costs))
}

/// Nanoseconds per item for each setting; the work consists of `count` items.
fn ns_each<T>(
    inputs: &Inputs<'_>,
    count: u32,
    settings: &[T],
    work: impl Fn(&T),
) -> Result<Vec<Interval>, CostError> {
    in_turns(inputs.effort.rounds(), settings, |setting| {
        let ((), cpu_s) = timed(|| work(setting));
        Ok(cpu_s * 1e9 / f64::from(count))
    })
}

fn row(what: &str, lost: String, costs: &[Interval]) -> Vec<String> {
    let ns = |place: usize| costs.get(place).map_or_else(String::new, |cost| format!("{:.2}", cost.middle));
    vec![what.to_owned(), lost, ns(0), ns(1)]
}

/// Compares wall positions stored in double precision with positions stored in single precision.
fn single_precision(inputs: &Inputs<'_>) -> Result<Vec<String>, CostError> {
    let places: Vec<[f64; 2]> =
        arguments([LENGTH_M - 100.0, LENGTH_M]).zip(arguments([0.0, PERIMETER_M])).map(Into::into).collect();
    #[expect(clippy::cast_possible_truncation, reason = "what is lost by it is what is asked")]
    let single: Vec<[f32; 2]> = places.iter().map(|[x, sigma]| [*x as f32, *sigma as f32]).collect();
    let lost = places.iter().zip(&single).map(|(place, [x, _])| (place[0] - f64::from(*x)).abs());
    let lost_m = lost.fold(0.0, f64::max);
    let costs = ns_each(inputs, ARGUMENTS, &[true, false], |is_double| {
        if *is_double {
            let [x, sigma] = black_box([LENGTH_M - 50.0, 14.0]);
            let nearest = places.iter().map(|p| (p[0] - x) * (p[0] - x) + (p[1] - sigma) * (p[1] - sigma));
            black_box(nearest.fold(f64::INFINITY, f64::min));
        } else {
            let [x, sigma] = black_box([6950.0_f32, 14.0]);
            let nearest = single.iter().map(|p| (p[0] - x) * (p[0] - x) + (p[1] - sigma) * (p[1] - sigma));
            black_box(nearest.fold(f32::INFINITY, f32::min));
        }
    })?;
    let lost = format!(
        "single precision loses {:.2} mm of chainage at 7 km, and {:.1} % of the distance between samples 5 mm apart",
        1e3 * lost_m,
        100.0 * 2.0 * lost_m / 0.005
    );
    Ok(row("positions in double precision, not single", lost, &costs))
}

/// Compares samples packed to about four bytes with unpacked samples.
fn packing(inputs: &Inputs<'_>) -> Result<Vec<String>, CostError> {
    let (half, packed) = (filled(PACKED_M / 2)?, filled(PACKED_M)?);
    let moved_m = packed.fidelity(0.0, 10.0).moved_m;
    // Both stores have the same unpacked part, so their difference consists of packed samples alone.
    let [fewer, more] = [half.usage(), packed.usage()];
    let bytes = (more.bytes - fewer.bytes) as f64 / (more.kept - fewer.kept).max(1) as f64;
    let costs = in_turns(inputs.effort.rounds(), &[PACKED_M, OPEN_M], |metres| {
        let mut store = empty();
        let (filled, cpu_s) = timed(|| fill(&mut store, *metres));
        filled?;
        Ok(cpu_s * 1e9 / f64::from(metres * PER_M))
    })?;
    let lost = format!(
        "positions move by {:.1} um; a sample takes {bytes:.1} bytes, not {PLAIN_BYTES}",
        1e6 * moved_m
    );
    Ok(row("samples packed behind the vehicle", lost, &costs))
}

fn empty() -> SampleStore {
    SampleStore::new(StoreLayout {
        perimeter_m: PERIMETER_M,
        from_m: 0.0,
        to_m: f64::from(PACKED_M) + 1.0,
        cell_m: StoreLayout::cell_for_target_m(0.5),
        capacity: PACKED_M * PER_M * 2,
    })
}

fn filled(metres: u32) -> Result<SampleStore, CostError> {
    let mut store = empty();
    fill(&mut store, metres)?;
    Ok(store)
}

/// Adds one head's samples, which form a helix on the wall.
fn fill(store: &mut SampleStore, metres: u32) -> Result<(), CostError> {
    let step_m = [1.0 / f64::from(PER_M), PERIMETER_M / 120.0];
    for k in 0..metres * PER_M {
        let (x_m, arc_m) = (f64::from(k) * step_m[0], math::wrap(f64::from(k) * step_m[1], PERIMETER_M));
        let sample = WallSample { x_m, arc_m, head: 0, step_m: (k > 0).then_some(step_m), visit: 0 };
        store.insert(sample).map_err(|why| CostError::Figure {
            what: "the memory of a sample".to_owned(),
            why: why.to_string(),
        })?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_functions_differ_by_0_ulp_and_shifted_ones_by_3_ulp() {
        assert_eq!(differing(math::sin, math::sin, [-7.0, 7.0]), (0.0, 0));
        let off = |x: f64| f64::from_bits(math::exp(x).to_bits() + 3);
        assert_eq!(differing(math::exp, off, [-1.0, 1.0]), (100.0, 3));
    }

    #[test]
    fn packing_moves_a_sample_by_less_than_its_quantum() {
        let store = filled(PACKED_M).unwrap();
        let usage = store.usage();
        let bytes = usage.bytes as f64 / usage.kept as f64;
        let moved_m = store.fidelity(0.0, 10.0).moved_m;
        assert!(usage.kept > 0 && moved_m > 0.0 && moved_m < 1.0 / 65_536.0, "{moved_m}");
        assert!(bytes < PLAIN_BYTES as f64, "{bytes}");
    }
}
