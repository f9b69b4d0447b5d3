//! Draws a detail of the sampling pattern around its largest gap, to scale.

use headrace_deliver::pictures::canvas::{Canvas, NORMAL, SMALL, Side};
use headrace_deliver::pictures::chart::{Axis, Chart, short};
use headrace_deliver::pictures::look::{self, Colour, Look};
use headrace_deliver::pictures::polyline::{Frame, Px};

use super::laid::Laid;

/// Fill colour of the circle whose diameter is the spacing T.
pub(super) const CIRCLE: Colour = Colour(255, 240, 190);
const FRAME: Frame = Frame { left: 676.0, top: 92.0, right: 886.0, bottom: 302.0 };
/// Position of the detail's caption, pixels.
const WORDS: Px = [634.0, 348.0];
/// Minimum distance between the markers of two samples, pixels. Samples that are closer to each other share one marker.
const APART_PX: f64 = 4.0;
/// Number of samples in the detail above which a reader can't distinguish them.
const MOST: usize = 450;
/// Half the width of the detail, as a multiple of the spacing T.
const HALF: f64 = 1.5;

struct Detail<'c> {
    chart: Chart<'c>,
    laid: &'c Laid,
    centre: [f64; 2],
    /// Chainage at the left edge of the detail, m.
    from_m: f64,
    half_m: f64,
}

/// Draws the detail of the pattern around its largest gap.
pub(super) fn draw(canvas: &Canvas, laid: &Laid, centre: [f64; 2], from_m: f64, t_m: f64) {
    let half_m = HALF * t_m;
    let [x_m, arc_m] = [centre[0] - from_m, centre[1]];
    let x = Axis::new("m", x_m - half_m, x_m + half_m, 5).with_name_at(30.0);
    let y = Axis::new("", arc_m - half_m, arc_m + half_m, 6);
    let chart = Chart::new(canvas, FRAME, &x, &y);
    let radius_px = (FRAME.right - FRAME.left) / (4.0 * HALF);
    let outline = Look { width_px: 1.8, ..look::T };
    chart.ellipse(chart.px([x_m, arc_m]), [radius_px; 2], CIRCLE, &outline);
    let detail = Detail { chart, laid, centre, from_m, half_m };
    let samples = detail.samples();
    // With too many samples to distinguish, only the heads' tracks are drawn.
    let dense = samples.len() > MOST;
    detail.lines(dense);
    for (head, place) in samples.iter().filter(|_| !dense) {
        canvas.marker(*place, &look::of_several(*head), 2.6, true);
    }
    words(canvas, t_m);
}

fn words(canvas: &Canvas, t_m: f64) {
    canvas.text([FRAME.left, FRAME.top - 12.0], "detail, true to scale", Side::Right, SMALL);
    let circle = format!("Circle: {} m (T). Any feature as", short(t_m));
    let lines = [circle.as_str(), "large is hit, even here, where the", "gaps are widest."];
    for (k, line) in lines.into_iter().enumerate() {
        canvas.text([WORDS[0], WORDS[1] + 17.0 * k as f64], line, Side::Right, NORMAL);
    }
}

impl Detail<'_> {
    /// Draws the heads' tracks. The tracks are repeated on either side of the seam, where the unrolled wall begins and
    /// ends.
    fn lines(&self, dense: bool) {
        for pass in self.laid.passes().into_iter().filter(|pass| !(dense && pass.hidden)) {
            let thin = Look { width_px: 0.8, dash: &[], ..look::of_several(pass.head) };
            let look = if pass.hidden { look::HIDDEN } else { thin };
            for turns in [-1.0, 0.0, 1.0] {
                let place = |[x, arc]: &[f64; 2]| [x - self.from_m, arc + turns * self.laid.perimeter_m];
                self.chart.line(&pass.points.iter().map(place).collect::<Vec<_>>(), &look);
            }
        }
    }

    /// Samples that the vehicle doesn't occlude, each with its head and its position on the sheet.
    fn samples(&self) -> Vec<(usize, Px)> {
        let mut places: Vec<(usize, Px)> = Vec::new();
        for (sample, at) in self.laid.near(self.centre, [self.half_m; 2]) {
            let place = self.chart.px([at[0] - self.from_m, at[1]]);
            let near = |(head, before): &(usize, Px)| {
                *head == sample.head && (before[0] - place[0]).abs() + (before[1] - place[1]).abs() < APART_PX
            };
            if !sample.hidden && self.chart.frame.has(place) && !places.last().is_some_and(near) {
                places.push((sample.head, place));
            }
        }
        places
    }
}
