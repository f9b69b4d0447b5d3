//! Draws Figures 6 and 8: sampling patterns of heads in the phase-shift layout and in the sector-offset layout.

use headrace_deliver::pictures::canvas::{BOLD, Canvas, Letters, NORMAL, SMALL, Side, width_px};
use headrace_deliver::pictures::chart::{Axis, Chart};
use headrace_deliver::pictures::clock;
use headrace_deliver::pictures::look::{self, BLACK, Colour, Look, Marker};
use headrace_deliver::pictures::polyline::{Frame, Px};

use crate::figures::{PhaseShift, Place, Sectors, Way};

const SIZE_PX: [u32; 2] = [900, 640];
const FRAME: Frame = Frame { left: 66.0, top: 78.0, right: 806.0, bottom: 540.0 };
/// Vertical position of the legend, pixels from the top.
const LEGEND_PX: f64 = 600.0;
/// Figure 6 marks one sample in 5, and Figure 8 one in 20, so that marks don't overlap.
const MARKED: [usize; 2] = [5, 20];

/// Line style of dimension lines.
const MEASURE: Look = Look { colour: BLACK, width_px: 1.6, dash: &[], marker: Marker::Circle };
const LONG: Look = Look { colour: Colour(0, 114, 178), ..MEASURE };
const SHORT: Look = Look { colour: Colour(213, 94, 0), ..MEASURE };
const FASTER: Look = Look { width_px: 1.2, dash: &[7.0, 5.0], ..MEASURE };

fn chart(canvas: &Canvas, length_m: f64, perimeter_m: f64) -> Chart<'_> {
    let x = Axis::new("distance along the tunnel, m", 0.0, length_m, 12);
    let y = Axis::new("arc length from the floor's centre, via the left wall, m", 0.0, perimeter_m, 10);
    Chart::new(canvas, FRAME, &x, &y)
}

fn way(head: u16) -> Look {
    Look { width_px: 1.0, ..look::of_several(usize::from(head)) }
}

fn heads(chart: &Chart<'_>, ways: &[Way], samples: &[Place], marked: usize) {
    for piece in ways {
        chart.line(&piece.points, &way(piece.head));
    }
    for sample in samples.iter().step_by(marked) {
        chart.canvas.marker(chart.px([sample.x_m, sample.arc_m]), &way(sample.head), 3.2, true);
    }
}

/// Draws the heads' entries of the legend from left to right; returns the x position of the next entry, pixels.
fn legend(canvas: &Canvas, heads: u16) -> f64 {
    let mut x = FRAME.left;
    for head in 0..heads {
        let look = way(head);
        canvas.line(&[[x, LEGEND_PX], [x + 40.0, LEGEND_PX]], &look);
        canvas.marker([x + 20.0, LEGEND_PX], &look, 3.6, true);
        canvas.text([x + 46.0, LEGEND_PX], &format!("head {head}"), Side::Right, NORMAL);
        x += 112.0;
    }
    x
}

/// Draws the explanation at the bottom of the figure.
fn note(canvas: &Canvas, marked: usize, more: &str) {
    let words = format!("One in {marked} samples is marked. {more}");
    canvas.text([14.0, 626.0], &words, Side::Right, SMALL);
}

/// Draws a dimension along the tunnel, with its text on white above or below the dimension line.
fn measured(chart: &Chart<'_>, [from_m, to_m]: [f64; 2], arc_m: f64, look: &Look, words: (&str, f64)) {
    let (from, to) = (chart.px([from_m, arc_m]), chart.px([to_m, arc_m]));
    chart.canvas.span(from, to, look);
    let (words, below_px) = words;
    let letters = Letters { colour: look.colour, ..BOLD };
    let half_px = width_px(words, letters) / 2.0;
    let middle =
        f64::midpoint(from[0], to[0]).max(FRAME.left + half_px + 3.0).min(FRAME.right - half_px - 3.0);
    chart.canvas.text_on_white([middle, from[1] + below_px], words, Side::Middle, letters);
}

/// Draws extension lines from a line on the wall to a dimension beside it.
fn ends(chart: &Chart<'_>, at: [f64; 2], arc_m: f64, to_px: f64) {
    for x_m in at {
        let [x, y]: Px = chart.px([x_m, arc_m]);
        chart.canvas.line(&[[x, y], [x, y + to_px]], &look::AXIS);
    }
}

/// Draws Figure 6.
pub(super) fn phase_shift(figure: &PhaseShift) -> String {
    let PhaseShift { heads: count, t_x_m, .. } = figure;
    let spaced_m = t_x_m / f64::from(*count);
    let title = format!("Figure 6: {count} heads in phase shift on the unrolled wall, two turns");
    let subtitle = format!(
        "VITA 2, {}, {} m/s, simulated: T_x of each head {t_x_m:.3} m, together T_x/s = {spaced_m:.3} m",
        figure.mode, figure.speed_mps
    );
    let canvas = Canvas::of_size(SIZE_PX, &title, &subtitle);
    let chart = chart(&canvas, figure.length_m, figure.profile.perimeter_m());
    for piece in &figure.faster {
        chart.line(&piece.points, &FASTER);
    }
    heads(&chart, &figure.ways, &figure.samples, MARKED[0]);
    clock::at_right(&chart, &figure.profile);
    let first = figure.at_crown.windows(2).find_map(|pair| match pair {
        [(_, from_m), (_, to_m)] => Some([*from_m, *to_m]),
        _ => None,
    });
    let own: Vec<f64> = figure.at_crown.iter().filter(|(head, _)| *head == 0).map(|(_, x_m)| *x_m).collect();
    if let [from_m, to_m, ..] = own.as_slice() {
        /// Distance of the dimension line of T_x below the crown, pixels.
        const BELOW_PX: f64 = 58.0;
        let at = [*from_m, *to_m];
        ends(&chart, at, figure.crown_m, BELOW_PX);
        let off_m = BELOW_PX / (FRAME.bottom - FRAME.top) * figure.profile.perimeter_m();
        let words = format!("T_x = {:.3} m, head 0 to head 0", to_m - from_m);
        measured(&chart, at, figure.crown_m - off_m, &MEASURE, (&words, 13.0));
    }
    if let Some([from_m, to_m]) = first {
        let words = format!("{:.3} m, about T_x/s", to_m - from_m);
        measured(&chart, [from_m, to_m], figure.crown_m, &SHORT, (&words, -13.0));
    }
    let x = legend(&canvas, *count);
    canvas.line(&[[x, LEGEND_PX], [x + 40.0, LEGEND_PX]], &FASTER);
    let words = format!("one head {count} times as fast");
    canvas.text([x + 46.0, LEGEND_PX], &words, Side::Right, NORMAL);
    note(
        &canvas,
        MARKED[0],
        "Heads side by side see a place at slightly different angles, so spacing isn't quite even.",
    );
    canvas.into_svg()
}

/// Draws Figure 8.
pub(super) fn sectors(figure: &Sectors) -> String {
    let title = "Figure 8: two neighbouring heads in sector offset on the unrolled wall".to_owned();
    let subtitle = format!(
        "VITA 2, {}, {} m/s, simulated: T_x/s = {:.2} m; long and short ways alternate but in the sector's middle",
        figure.mode, figure.speed_mps, figure.t_x_m
    );
    let canvas = Canvas::of_size(SIZE_PX, &title, &subtitle);
    let chart = chart(&canvas, figure.length_m, figure.profile.perimeter_m());
    for arc_m in [figure.line_m, figure.middle_m] {
        chart.across(arc_m, &look::TARGET);
    }
    heads(&chart, &figure.ways, &figure.samples, MARKED[1]);
    clock::at_right(&chart, &figure.profile);
    for pair in figure.at_middle.windows(2).take(2) {
        if let [from_m, to_m] = pair {
            let words = format!("{:.2} m", to_m - from_m);
            measured(&chart, [*from_m, *to_m], figure.middle_m, &MEASURE, (&words, 13.0));
        }
    }
    let [short_m, long_m] = figure.alternating_m;
    for pair in figure.at_line.windows(2).take(4) {
        let [from_m, to_m] = pair else { continue };
        let gap_m = to_m - from_m;
        let (look, name) =
            if gap_m > f64::midpoint(short_m, long_m) { (&LONG, "long") } else { (&SHORT, "short") };
        let words = format!("{name} {gap_m:.2} m");
        measured(&chart, [*from_m, *to_m], figure.line_m, look, (&words, -13.0));
    }
    if let [from_m, _, to_m, ..] = figure.at_line.as_slice() {
        /// Distance of a dimension line below the wall line on which passes are measured, pixels. The dimension shows
        /// the sum of two distances between passes.
        const BELOW_PX: f64 = 30.0;
        let at = [*from_m, *to_m];
        ends(&chart, at, figure.line_m, BELOW_PX);
        let off_m = BELOW_PX / (FRAME.bottom - FRAME.top) * figure.profile.perimeter_m();
        let words = format!("sum 2 T_x/s = {:.2} m", to_m - from_m);
        measured(&chart, at, figure.line_m - off_m, &MEASURE, (&words, 13.0));
    }
    let x = legend(&canvas, 2);
    let words = format!(
        "head 0 at the upper broken line, by the formula: {short_m:.2} m and {long_m:.2} m; middle: {:.2} m",
        figure.t_x_m
    );
    canvas.text([x, LEGEND_PX], &words, Side::Right, NORMAL);
    note(
        &canvas,
        MARKED[1],
        "At a sector's end the distance is 2 T_x/s, halved by the neighbour's turning there.",
    );
    canvas.into_svg()
}
