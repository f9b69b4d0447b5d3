//! Text about the default navigation method, derived from the measured points.

use crate::point::Point;
use crate::words::number;

const CABLE: &str = "cable only";
const DIRECT: &str = "direct";
const USUAL: &str = "filter, sonar returns";
const SMOOTHED: &str = "smoothed";

/// Finds a figure among the errors of a measured point, by its name.
fn figure(point: &Point, name: &str) -> Option<f64> {
    point.errors.iter().find(|error| error.name == name).map(|error| error.interval.middle)
}

/// Worst case of a method. It is given by the largest lateral position error, m, and by the smallest share of
/// displacements whose error is within two stated standard deviations, %.
fn worst(points: &[Point], method: &str) -> Option<[f64; 2]> {
    let of = |name: &'static str| {
        points.iter().filter(|point| point.value == method).filter_map(move |point| figure(point, name))
    };
    let across_m = of("position across").reduce(f64::max)?;
    Some([across_m, of("displacements within two sigma").reduce(f64::min)?])
}

/// Reasons why the filter with sonar returns is the default, although other settings beat it.
pub(super) fn reasons(points: &[Point]) -> Vec<String> {
    let mut reasons = Vec::new();
    if let (Some(usual), Some(cable), Some(direct)) =
        (worst(points, USUAL), worst(points, CABLE), worst(points, DIRECT))
    {
        let [usual, cable, direct] = [usual, cable, direct].map(|worst| worst.map(number));
        reasons.push(format!(
            "The filter with sonar returns is the default, even where a cheaper method knows the displacement equally well. In its worst scene it \
             knows the lateral position to {} m; the cable alone knows it to {} m and `direct` to {} m. There, {} % of its displacements are \
             within two of its standard deviations, but only {} and {} % of the others' displacements. A section can pass only with such a standard deviation.",
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
            "The smoother needs the whole dive, so it cannot judge during one. It takes {} times the filter's time. In its worst scene it knows \
             the lateral position to {} m, the filter to {} m.",
            number(smoothed_ns / usual_ns),
            number(smoothed[0]),
            number(usual[0])
        ));
    }
    reasons
}

/// Advice about the default, from the points of `scene`.
pub(super) fn advice(points: &[Point], scene: &str) -> String {
    let of = |value: &str| points.iter().find(|point| point.scene == scene && point.value == value);
    let (Some(cable), Some(usual)) = (of(CABLE), of(USUAL)) else {
        return "No setting was measured.".to_owned();
    };
    let figure = |point: &Point, name: &str| figure(point, name).unwrap_or(f64::NAN);
    format!(
        "Use the sonar returns for navigation. In {scene} they reduce the error of the lateral position to {:.3} m, from {:.2} m with \
         the cable alone, and the error of D to {:.3} m, from {:.3} m, for {:.1} ms more CPU time per second of dive.",
        figure(usual, "position across"),
        figure(cable, "position across"),
        figure(usual, "abs(D - D_true), 95th percentile"),
        figure(cable, "abs(D - D_true), 95th percentile"),
        (usual.cost.middle - cable.cost.middle) * 1e-6,
    )
}
