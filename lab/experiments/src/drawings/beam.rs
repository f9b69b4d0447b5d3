//! Figure 15: wall covered by a beam.

use headrace_geometry::math;
use headrace_deliver::pictures::canvas::{BOLD, Canvas, NORMAL, SMALL, Side};
use headrace_deliver::pictures::chart::{Axis, Chart, short};
use headrace_deliver::pictures::labels::{self, Label};
use headrace_deliver::pictures::look::{self, Look};
use headrace_deliver::pictures::polyline::Frame;

use crate::figures::{Footprint, Footprints};

const BY_RANGE: Frame = Frame { left: 66.0, top: 100.0, right: 340.0, bottom: 430.0 };
const BY_ANGLE: Frame = Frame { left: 526.0, top: 100.0, right: 786.0, bottom: 430.0 };

/// Draws Figure 15.
pub(super) fn footprints(figure: &Footprints) -> String {
    let all = || figure.by_range.iter().chain(&figure.by_angle).flat_map(|footprint| &footprint.points);
    let most_m = 1.05 * all().map(|[_, m]| *m).fold(0.0, f64::max);
    let title = "Figure 15: wall that a beam covers, as range and frequency change";
    let subtitle = "Imagenex 881L, full width of its beam: 1.4 degrees at 1 MHz, 2.4 degrees at 600 kHz";
    let canvas = Canvas::new(title, subtitle);
    let corner_m = figure.height_m / math::cos(figure.corner_deg.to_radians());
    let heading = format!("Floor {:.2} m below: range {corner_m:.2} m at its corner", figure.height_m);
    let y = || Axis::new("length covered in the plane of turning, m", 0.0, most_m, 8).with_name_at(40.0);
    let x = Axis::new("range, m", 0.0, figure.range_m, 10);
    curves(&canvas, (BY_RANGE, &x, &y()), "Wall met squarely", &figure.by_range);
    let x = Axis::new("angle from straight down, degrees", 0.0, figure.corner_deg, 7);
    curves(&canvas, (BY_ANGLE, &x, &y()), &heading, &figure.by_angle);
    legend(&canvas);
    canvas.into_svg()
}

fn looks() -> impl Iterator<Item = Look> {
    [0, 1].into_iter().map(look::of_several)
}

fn curves(canvas: &Canvas, (frame, x, y): (Frame, &Axis, &Axis), heading: &str, footprints: &[Footprint]) {
    let chart = Chart::new(canvas, frame, x, y);
    canvas.text([frame.left, frame.top - 18.0], heading, Side::Right, BOLD);
    let mut ends = Vec::new();
    for (footprint, look) in footprints.iter().zip(looks()) {
        chart.line(&footprint.points, &look);
        for point in &footprint.simulated {
            canvas.marker(chart.px(*point), &look, 4.0, false);
        }
        let Some(end) = footprint.points.last() else { continue };
        let lines = vec![format!("{} deg:", footprint.beam_deg), format!("{} m", short(end[1]))];
        ends.push(Label { place: chart.px(*end), lines, look, bold: true });
    }
    labels::at_right(canvas, &frame, &ends);
}

fn legend(canvas: &Canvas) {
    for (look, x) in looks().zip([66.0, 112.0]) {
        canvas.line(&[[x, 496.0], [x + 38.0, 496.0]], &look);
        canvas.marker([x + 19.0, 520.0], &look, 4.0, false);
    }
    let formula =
        "by the formula h (tan(a + z/2) - tan(a - z/2)): h distance to the wall, a angle, z beam's width";
    let rays = "simulated: from the nearest to the farthest place that the 64 rays of a beam meet";
    canvas.text([162.0, 496.0], formula, Side::Right, NORMAL);
    canvas.text([162.0, 520.0], rays, Side::Right, NORMAL);
    let note = "On the floor a beam is smeared over more and more wall towards the corner: about as 1 / cos^2 of the angle.";
    canvas.text([14.0, 546.0], note, Side::Right, SMALL);
}
