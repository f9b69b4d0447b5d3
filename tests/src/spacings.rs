//! Computes the spacings T_x (along the tunnel), T_y (along the wall) and T of every sample of a dive from their
//! definitions, by comparison with all earlier samples.
//!
//! A *pass* over a place on the perimeter is one step of a head. Both pings of the step have a return, and the arc
//! between them (the shorter way round) contains the place. The chainage of the pass is interpolated linearly on the
//! unrolled wall. A step across pings without a return is no pass, because the places between its ends aren't sampled.
//! A step is earlier than a sample if both pings of the step are earlier. The definitions don't say whether a series of
//! steps includes its end points. For samples at such points, both values are computed.

use headrace_geometry::math;

use crate::instrumented::{Ping, Sample};

/// Tolerance for rounding at the ends of a step, as a fraction of the step.
const ROUNDING: f64 = 1e-9;

/// Spacings T_x, T_y and T of a sample, m.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Spacing {
    /// Chainage of the sample, m.
    pub x_m: f64,
    /// T_x: distance in chainage to the nearest earlier pass. It has two values: without and with the end points of
    /// series of steps.
    pub t_x_m: [Option<f64>; 2],
    /// T_y: distance to the previous sample of the same head.
    pub t_y_m: Option<f64>,
    /// Spacing T, computed from T_x and T_y. It has two values, like T_x.
    pub t_m: [Option<f64>; 2],
}

struct Step {
    from: [f64; 2],
    /// Change of chainage and arc length from `from` to the end of the step, m. The arc length changes along the
    /// shorter way round the wall.
    by: [f64; 2],
    /// Whether a step in the same direction directly precedes this step, and whether such a step directly follows.
    joined: [bool; 2],
}

impl Step {
    /// Chainage at which the step passes over the arc length `arc_m`; `None` if it doesn't pass over it.
    fn x_at(&self, arc_m: f64, perimeter_m: f64, with_ends: bool) -> Option<f64> {
        let along_m = math::wrap_signed(arc_m - self.from[1], perimeter_m);
        let share = along_m / self.by[1];
        let reach = self.joined.map(|joined| if joined || with_ends { ROUNDING } else { -ROUNDING });
        (-reach[0]..=1.0 + reach[1])
            .contains(&share)
            .then(|| self.from[0] + share.clamp(0.0, 1.0) * self.by[0])
    }
}

#[derive(Clone, Default)]
struct Head {
    /// Previous sample in this sweep of the head.
    last: Option<Sample>,
    /// Whether the previous ping has a return.
    returned: bool,
    /// Index of the step that ended at the previous ping.
    step: Option<usize>,
}

/// Spacings of all samples, in order of the samples.
pub fn spacings(pings: &[Ping], perimeter_m: f64) -> Vec<Spacing> {
    let heads = pings.iter().map(|ping| ping.head + 1).max().unwrap_or(0);
    let mut heads = vec![Head::default(); heads];
    let mut steps: Vec<Step> = Vec::new();
    let mut all = Vec::new();
    for ping in pings {
        let head = &mut heads[ping.head];
        if ping.new_sweep {
            *head = Head::default();
        }
        let Some(sample) = ping.sample else {
            (head.returned, head.step) = (false, None);
            continue;
        };
        let last = head.last.replace(sample);
        let one_step = std::mem::replace(&mut head.returned, true) && ping.single_step;
        all.push(spacing(&sample, last.as_ref(), &steps, perimeter_m));
        let before = head.step.take();
        if let Some(last) = last.filter(|_| one_step) {
            let [from, to] = [last.place, sample.place];
            let by = [to[0] - from[0], math::wrap_signed(to[1] - from[1], perimeter_m)];
            let before = before.filter(|number| steps[*number].by[1] * by[1] > 0.0);
            if let Some(number) = before {
                steps[number].joined[1] = true;
            }
            head.step = Some(steps.len());
            steps.push(Step { from, by, joined: [before.is_some(), false] });
        }
    }
    all
}

fn spacing(sample: &Sample, last: Option<&Sample>, steps: &[Step], perimeter_m: f64) -> Spacing {
    let [x_m, arc_m] = sample.place;
    let t_x_m = [false, true].map(|with_ends| {
        let passes = steps.iter().filter_map(|step| step.x_at(arc_m, perimeter_m, with_ends));
        passes.map(|x| (x - x_m).abs()).reduce(f64::min)
    });
    let t_y_m = last.map(|last| distance_m(last.point, sample.point));
    let d_m = last.map(|last| (x_m - last.place[0]).abs());
    let t_m = t_x_m.map(|t_x_m| Some(math::hypot(t_x_m? + d_m?, t_y_m?)));
    Spacing { x_m, t_x_m, t_y_m, t_m }
}

fn distance_m(a: [f64; 3], b: [f64; 3]) -> f64 {
    math::hypot(math::hypot(a[0] - b[0], a[1] - b[1]), a[2] - b[2])
}

/// Minimum, mean, maximum and variance; `None` without values.
pub fn spread(values: &[f64]) -> Option<[f64; 4]> {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let variance = values.iter().map(|value| (value - mean) * (value - mean)).sum::<f64>() / n;
    let least = values.iter().copied().reduce(f64::min)?;
    let most = values.iter().copied().reduce(f64::max)?;
    Some([least, mean, most, variance])
}
