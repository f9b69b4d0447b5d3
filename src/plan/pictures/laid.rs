//! Computes the sampling pattern on the wall, and the chainages that all heads have passed.

use headrace_deliver::pictures::polyline;
use headrace_geometry::math;
use headrace_sampling::SamplingError;
use headrace_sampling::plan::PatternSample;

use super::shown::Shown;

/// Maximum number of samples computed for a chart.
const MOST_SAMPLES: f64 = 400_000.0;

/// A sampling pattern on the wall, computed for a chart.
pub(super) struct Laid {
    pub(super) samples: Vec<PatternSample>,
    pub(super) heads: usize,
    pub(super) perimeter_m: f64,
    /// Distance that the vehicle moves in a turn of a head, m.
    pub(super) pitch_m: f64,
    /// Sample spacing T at the speed of the chart, m; `None` if there is a strip that no head sees.
    pub(super) t_m: Option<f64>,
    /// Start of the stretch that all heads have passed, m. `to_m` is its end.
    pub(super) from_m: f64,
    pub(super) to_m: f64,
}

/// A piece of a head's track on the wall, drawn as one connected line.
pub(super) struct Pass {
    pub(super) head: usize,
    pub(super) hidden: bool,
    /// Chainage and arc length of each point of the track, m.
    pub(super) points: Vec<[f64; 2]>,
}

/// Computes the pattern, with enough turns for the chart and its detail.
pub(super) fn lay(shown: &Shown<'_>) -> Result<Laid, SamplingError> {
    let planner = shown.planner;
    let specs = planner.specs(shown.mode);
    let turn = planner.modes().get(shown.mode).map(|planned| planned.mode.turn);
    let pitch_m = shown.speed_mps * turn.map_or(1.0, |turn| turn.period_s());
    let t_m = Some(planner.t_max_m(shown.mode, shown.speed_mps)?).filter(|t_m| t_m.is_finite());
    let places = || specs.iter().map(|spec| spec.mount.position.x());
    let apart_m = places().fold(f64::NEG_INFINITY, f64::max) - places().fold(f64::INFINITY, f64::min);
    // The search for the largest gap needs the travel of a whole turn, and the detail chart needs some length
    // around the gap.
    let wanted_m = (turns_shown(specs.len()) * pitch_m).max(pitch_m + 3.2 * t_m.unwrap_or(0.0));
    let steps = turn.map_or(1.0, |turn| f64::from(turn.steps())) * specs.len().max(1) as f64;
    let turns = ((wanted_m + apart_m.max(0.0)) / pitch_m + 1.0).min(MOST_SAMPLES / steps).max(2.0);
    let samples = planner.pattern(shown.mode, shown.speed_mps, turns)?;
    let [from_m, to_m] = all_passed_m(&samples, specs.len(), pitch_m);
    let perimeter_m = planner.inspection().profile.perimeter_m();
    Ok(Laid { samples, heads: specs.len(), perimeter_m, pitch_m, t_m, from_m, to_m })
}

/// Number of turns shown in the chart. With more heads, fewer turns are shown.
pub(super) fn turns_shown(heads: usize) -> f64 {
    match heads {
        0 | 1 => 3.0,
        2 => 2.5,
        3 | 4 => 2.0,
        _ => 1.5,
    }
}

/// Chainages between which all heads have samples: from the largest first chainage of a head to the smallest last one.
///
/// If these chainages span less than a turn, returns the ends of the whole pattern.
fn all_passed_m(samples: &[PatternSample], heads: usize, pitch_m: f64) -> [f64; 2] {
    let of = |head: usize| samples.iter().filter(move |sample| sample.head == head).map(|sample| sample.x_m);
    let firsts = (0..heads).map(|head| of(head).fold(f64::INFINITY, f64::min));
    let lasts = (0..heads).map(|head| of(head).fold(f64::NEG_INFINITY, f64::max));
    let (from_m, to_m) =
        (firsts.clone().fold(f64::NEG_INFINITY, f64::max), lasts.clone().fold(f64::INFINITY, f64::min));
    if to_m - from_m >= pitch_m {
        return [from_m, to_m];
    }
    [firsts.fold(f64::INFINITY, f64::min), lasts.fold(f64::NEG_INFINITY, f64::max)]
}

impl Laid {
    /// Tracks of the heads. They are split where a head reverses, crosses the seam, or becomes hidden or
    /// visible.
    pub(super) fn passes(&self) -> Vec<Pass> {
        let mut passes: Vec<Pass> = Vec::new();
        for pair in self.samples.windows(2) {
            let [before, here] = pair else { continue };
            if here.new_sweep || here.head != before.head {
                continue;
            }
            // The wall between a hidden sample and its neighbour isn't sampled, so no line is drawn across it.
            let hidden = here.hidden || before.hidden;
            let (from, to) = ([before.x_m, before.arc_m], [here.x_m, here.arc_m]);
            for [begin, end] in polyline::over_seam(self.perimeter_m, from, to) {
                match passes.last_mut() {
                    Some(pass)
                        if pass.head == here.head
                            && pass.hidden == hidden
                            && pass.points.last() == Some(&begin) =>
                    {
                        pass.points.push(end);
                    }
                    _ => passes.push(Pass { head: here.head, hidden, points: vec![begin, end] }),
                }
            }
        }
        passes
    }

    /// Samples within `half_m` of a point in both directions. Their arc lengths are continuous across the
    /// seam.
    pub(super) fn near(&self, centre: [f64; 2], half_m: [f64; 2]) -> Vec<(&PatternSample, [f64; 2])> {
        let place = |sample: &PatternSample| {
            let across_m = math::wrap_signed(sample.arc_m - centre[1], self.perimeter_m);
            [sample.x_m, centre[1] + across_m]
        };
        let placed = self.samples.iter().map(|sample| (sample, place(sample)));
        let near =
            |at: &[f64; 2]| (at[0] - centre[0]).abs() <= half_m[0] && (at[1] - centre[1]).abs() <= half_m[1];
        placed.filter(|(_, at)| near(at)).collect()
    }

    /// Centre and diameter, m, of the largest gap in the pattern near an arc length.
    ///
    /// The gap is the largest circle without samples, with its centre on a stretch as long as the vehicle's travel in
    /// one turn.
    ///
    /// `None` without a spacing T.
    pub(super) fn emptiest(&self, arc_m: f64) -> Option<([f64; 2], f64)> {
        /// Number of grid points along the tunnel and around the perimeter.
        const TRIED: [u32; 2] = [120, 40];
        let t_m = self.t_m?;
        // The search keeps away from the ends of the pattern, beyond which no samples were computed.
        let room_m = (self.to_m - self.from_m - self.pitch_m).max(0.0) / 2.0;
        let begin_m = self.from_m + room_m;
        let middle = [begin_m + self.pitch_m / 2.0, arc_m];
        let half = [self.pitch_m / 2.0 + t_m, 1.5 * t_m];
        let near: Vec<[f64; 2]> = self
            .near(middle, half)
            .into_iter()
            .filter(|(sample, _)| !sample.hidden)
            .map(|(_, at)| at)
            .collect();
        let nearest_m2 = |place: [f64; 2]| {
            let m2 = near.iter().map(|at| {
                let (x, y) = (at[0] - place[0], at[1] - place[1]);
                x * x + y * y
            });
            m2.fold(f64::INFINITY, f64::min)
        };
        let mut best = (f64::NEG_INFINITY, middle);
        for (i, j) in (0..TRIED[0]).flat_map(|i| (0..TRIED[1]).map(move |j| (i, j))) {
            let share = |k: u32, of: u32| f64::from(k) / f64::from(of);
            let place =
                [begin_m + self.pitch_m * share(i, TRIED[0]), arc_m + t_m * (share(j, TRIED[1]) - 0.5)];
            let m2 = nearest_m2(place);
            if m2 > best.0 {
                best = (m2, place);
            }
        }
        Some((best.1, 2.0 * math::sqrt(best.0)))
    }
}
