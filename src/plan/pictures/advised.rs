//! Curves of the advised speed: for each spacing T, the largest speed at which a mode meets it, position errors included.
//!
//! Table, labels and curves use the same speeds, [`Planner::v_max_mps`].

use headrace_sampling::plan::Planner;

/// Number of values of the spacing T at which a curve is computed.
const POINTS: u32 = 200;
/// Number of halvings of the interval in which a curve begins. The beginning of the curve is then known to far less
/// than a pixel.
const HALVINGS: u32 = 40;

/// Returns a mode's curve up to the spacing `most_m`: pairs of a spacing T, m, and the largest speed that meets it,
/// m/s.
///
/// The curve begins at the smallest T that any speed meets, and the spacing `marked_m` is one of its points. It is empty
/// if no speed meets `most_m`.
pub(super) fn curve(planner: &Planner, mode: usize, most_m: f64, marked_m: Option<f64>) -> Vec<[f64; 2]> {
    let Some(least_m) = least_m(planner, mode, most_m) else { return Vec::new() };
    // Near the smallest spacing T, the speed grows with the square root of the excess of T, so the points lie closer
    // there.
    let grid = (0..=POINTS).map(|k| {
        let share = f64::from(k) / f64::from(POINTS);
        least_m + share * share * (most_m - least_m)
    });
    let marked_m = marked_m.filter(|marked_m| (least_m..=most_m).contains(marked_m));
    let mut ts_m: Vec<f64> = grid.chain(marked_m).collect();
    ts_m.sort_unstable_by(f64::total_cmp);
    ts_m.into_iter().filter_map(|t_m| Some([t_m, planner.v_max_mps(mode, t_m).ok()?])).collect()
}

/// Smallest spacing T that any speed meets, m. `None` if this T is above `most_m`.
fn least_m(planner: &Planner, mode: usize, most_m: f64) -> Option<f64> {
    let is_met = |t_m: f64| planner.v_max_mps(mode, t_m).is_ok();
    let (mut unmet_m, mut met_m) = (0.0, most_m);
    if !is_met(most_m) {
        return None;
    }
    for _ in 0..HALVINGS {
        let middle_m = f64::midpoint(unmet_m, met_m);
        if is_met(middle_m) {
            met_m = middle_m;
        } else {
            unmet_m = middle_m;
        }
    }
    Some(met_m)
}

/// Speed of a curve at the spacing `t_m`, m/s, between its points. `None` outside the curve.
#[cfg(test)]
pub(super) fn at(points: &[[f64; 2]], t_m: f64) -> Option<f64> {
    points.windows(2).find_map(|pair| {
        let [[from_m, from], [to_m, to]] = *pair else { return None };
        let share = (t_m - from_m) / (to_m - from_m);
        (to_m > from_m && (0.0..=1.0).contains(&share)).then_some(from + share * (to - from))
    })
}
