//! Text about the default, derived from the points.

use crate::point::Point;
use crate::words::number;

const CABLE: &str = "cable only";
const DIRECT: &str = "direct";
const USUAL: &str = "filter, sonar returns";
const SMOOTHED: &str = "smoothed";

/// A figure of a point by its name.
fn figure(point: &Point, name: &str) -> Option<f64> {
    point.errors.iter().find(|error| error.name == name).map(|error| error.interval.middle)
}

/// Worst case of a method: its largest error across, m, and the smallest share of displacements within two of its
/// stated sigmas, %.
fn worst(points: &[Point], method: &str) -> Option<[f64; 2]> {
    let of = |name: &'static str| {
        points.iter().filter(|point| point.value == method).filter_map(move |point| figure(point, name))
    };
    let across_m = of("position across").reduce(f64::max)?;
    Some([across_m, of("displacements within two sigma").reduce(f64::min)?])
}

/// Reasons why the filter with sonar returns is the default although something beats it.
pub(super) fn reasons(points: &[Point]) -> Vec<String> {
    let mut reasons = Vec::new();
    if let (Some(usual), Some(cable), Some(direct)) =
        (worst(points, USUAL), worst(points, CABLE), worst(points, DIRECT))
    {
        let [usual, cable, direct] = [usual, cable, direct].map(|worst| worst.map(number));
        reasons.push(format!(
            "The filter with sonar returns stays the default where something cheaper has the same displacement: where each does worst, it \
             knows the place across to {} m, the cable alone to {} m and `direct` to {} m, and of displacements {} % lie within two of \
             the sigmas that it tells, in place of {} and {} %. Without such a sigma no section may pass.",
            usual[0], cable[0], direct[0], usual[1], cable[1], direct[1]
        ));
    }
    let costs = |method: &str| {
        let of = points.iter().filter(|point| point.value == method);
        of.map(|point| point.cost.middle).reduce(f64::max)
    };
    if let (Some(smoothed_ns), Some(usual_ns), Some(smoothed), Some(usual)) =
        (costs(SMOOTHED), costs(USUAL), worst(points, SMOOTHED), worst(points, USUAL))
    {
        reasons.push(format!(
            "The smoother isn't the default: it needs the whole dive, and verdicts are said during it. It takes {} times the filter's time \
             and knows the place across to {} m where it does worst, the filter to {} m.",
            number(smoothed_ns / usual_ns),
            number(smoothed[0]),
            number(usual[0])
        ));
    }
    reasons
}

/// Advice about the default, from the data of the last scene.
pub(super) fn advice(points: &[Point], scene: &str) -> String {
    let of = |value: &str| points.iter().find(|point| point.scene == scene && point.value == value);
    let (Some(cable), Some(usual)) = (of(CABLE), of(USUAL)) else {
        return "Without points there is nothing to advise.".to_owned();
    };
    let figure = |point: &Point, name: &str| figure(point, name).unwrap_or(f64::NAN);
    format!(
        "{scene}: the filter with sonar returns knows the place across to {:.3} m instead of {:.2} m by the cable alone, and D to \
         {:.3} m instead of {:.3} m, for {:.1} ms of CPU more a second of dive.",
        figure(usual, "position across"),
        figure(cable, "position across"),
        figure(usual, "abs(D - D_true), 95th percentile"),
        figure(cable, "abs(D - D_true), 95th percentile"),
        (usual.cost.middle - cable.cost.middle) * 1e-6,
    )
}
