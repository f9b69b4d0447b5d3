//! Figures 12 and 13: samples on the unrolled wall, and the distance of the surface through them.

use headrace_geometry::math;
use headrace_deliver::pictures::canvas::{BOLD, Canvas, Letters, SMALL, Side, width_px};
use headrace_deliver::pictures::chart::{Axis, Chart};
use headrace_deliver::pictures::clock;
use headrace_deliver::pictures::look::{BLACK, Colour, Look, Marker};
use headrace_deliver::pictures::polyline::{Frame, Px};

use super::scale;
use crate::figures::{Panel, Walls};

const SIZE_PX: [u32; 2] = [900, 900];
const LEFT_PX: f64 = 66.0;
const RIGHT_PX: f64 = 802.0;
/// Horizontal gap between adjacent panels, pixels.
const APART_PX: f64 = 20.0;
/// Top and bottom of the upper panels (samples), pixels.
const SAMPLES_PX: [f64; 2] = [136.0, 446.0];
/// Top and bottom of the lower panels (surfaces), pixels.
const SURFACES_PX: [f64; 2] = [514.0, 790.0];
/// Maximum number of samples drawn as dots in a panel.
const MOST_DOTS: usize = 3000;
/// Colour of strips of wall with widely spaced passes.
const WIDE: Colour = Colour(255, 244, 200);
/// Colour of strips of wall without passes.
const UNSEEN: Colour = Colour(245, 170, 90);
const GAP: Look = Look { colour: Colour(213, 94, 0), width_px: 1.8, dash: &[], marker: Marker::Circle };

/// Draws panels side by side, samples above and surfaces below.
pub(super) fn walls(title: &str, figure: &Walls) -> String {
    let subtitle = format!(
        "VITA 2, {} m/s, simulated with 10 mm of noise: {:.0} m of a dive of {:.0} m. s: number of heads.",
        figure.speed_mps, figure.length_m, figure.dive_m
    );
    let canvas = Canvas::of_size(SIZE_PX, title, &subtitle);
    for (number, panel) in figure.panels.iter().enumerate() {
        titles(&canvas, panel, frame(figure, number, SAMPLES_PX).left);
        let chart = chart(&canvas, figure, number, SAMPLES_PX);
        samples(&chart, panel, figure.length_m);
        let chart = self::chart(&canvas, figure, number, SURFACES_PX);
        surface(&chart, panel, figure);
    }
    notes(&canvas, figure);
    canvas.into_svg()
}

fn frame(figure: &Walls, number: usize, [top, bottom]: [f64; 2]) -> Frame {
    let count = figure.panels.len().max(1) as f64;
    let width = (RIGHT_PX - LEFT_PX - APART_PX * (count - 1.0)) / count;
    let left = LEFT_PX + (width + APART_PX) * number as f64;
    Frame { left, top, right: left + width, bottom }
}

fn chart<'c>(canvas: &'c Canvas, figure: &Walls, number: usize, across: [f64; 2]) -> Chart<'c> {
    let x = Axis::new("along the tunnel, m", 0.0, figure.length_m, 6).with_name_at(30.0);
    let y = Axis::new("arc length, via the left wall, m", 0.0, figure.profile.perimeter_m(), 7);
    let frame = frame(figure, number, across);
    let chart = Chart::new(canvas, frame, &x, &if number == 0 { y } else { y.bare() });
    if number + 1 == figure.panels.len() {
        clock::at_right(&chart, &figure.profile);
    }
    chart
}

fn titles(canvas: &Canvas, panel: &Panel, left: f64) {
    let layout = if panel.sectors { "sector offset" } else { "phase shift" };
    let aligned = if panel.aligned { "aligned" } else { "unaligned" };
    let lines = [
        (format!("{} heads, {}", panel.heads, panel.mode.to_uppercase()), BOLD),
        (format!("{layout}, {aligned}"), Letters { size_px: 13.0, ..BOLD }),
        (gap_words(panel), Letters { colour: GAP.colour, ..SMALL }),
    ];
    for (k, (words, letters)) in (0_u32..).zip(&lines) {
        canvas.text([left, 78.0 + 18.0 * f64::from(k)], words, Side::Right, *letters);
    }
}

/// Text that states the largest distance T_x between passes.
fn gap_words(panel: &Panel) -> String {
    let Some(gap) = panel.widest else { return "no two passes".to_owned() };
    let length_m = gap.length_m();
    format!("T_x up to {length_m:.2} m, {:.1} T_x/s", length_m / panel.t_x_m)
}

fn samples(chart: &Chart<'_>, panel: &Panel, length_m: f64) {
    for (strips, colour) in [(&panel.wide_m, WIDE), (&panel.unseen_m, UNSEEN)] {
        for [from_m, to_m] in strips {
            chart.canvas.area(chart.px([0.0, *to_m]), chart.px([length_m, *from_m]), colour);
        }
    }
    let dots: Vec<Px> =
        panel.samples.iter().step_by(thinned(panel)).map(|s| chart.px([s.x_m, s.arc_m])).collect();
    chart.canvas.dots(&dots, 1.5, BLACK);
    if let Some(gap) = panel.widest {
        let (from, to) = (chart.px([gap.x_m[0], gap.arc_m]), chart.px([gap.x_m[1], gap.arc_m]));
        chart.canvas.span(from, to, &GAP);
        let words = format!("{:.2} m", gap.length_m());
        let letters = Letters { colour: GAP.colour, ..BOLD };
        let half_px = width_px(&words, letters) / 2.0;
        let room = [chart.frame.left + half_px + 2.0, chart.frame.right - half_px - 2.0];
        let middle = f64::midpoint(from[0], to[0]).max(room[0]).min(room[1]);
        let above = from[1] > f64::midpoint(chart.frame.top, chart.frame.bottom);
        let place = [middle, from[1] + if above { -13.0 } else { 13.0 }];
        chart.canvas.text_on_white(place, &words, Side::Middle, letters);
    }
}

/// Returns n if one in n samples of the panel is drawn.
fn thinned(panel: &Panel) -> usize {
    panel.samples.len().div_ceil(MOST_DOTS).max(1)
}

/// Draws the cells of a panel, coloured by their distance from the surface. Vertically adjacent cells of one colour are
/// joined.
fn surface(chart: &Chart<'_>, panel: &Panel, figure: &Walls) {
    let [along, round] = panel.cells.map(|cells| usize::try_from(cells).unwrap_or(1).max(1));
    let size_m = [figure.length_m / along as f64, figure.profile.perimeter_m() / round as f64];
    let mut areas: Vec<Vec<(Px, Px)>> = vec![Vec::new(); scale::LEVELS];
    for (i, column) in panel.distances_m.chunks(round).enumerate() {
        let levels: Vec<usize> =
            column.iter().map(|distance_m| scale::level(*distance_m, figure.most_m)).collect();
        let mut from = 0;
        for run in levels.chunk_by(|a, b| a == b) {
            let to = from + run.len();
            // Edges are on whole pixels, so that no gap shows between neighbouring cells.
            let corner = |i: usize, k: usize| {
                chart.px([i as f64 * size_m[0], k as f64 * size_m[1]]).map(|px| math::round_to_i64(px) as f64)
            };
            let (lower, upper) = (corner(i, from), corner(i + 1, to));
            if let Some(areas) = run.first().and_then(|level| areas.get_mut(*level)) {
                areas.push(([lower[0], upper[1]], [upper[0] - lower[0], lower[1] - upper[1]]));
            }
            from = to;
        }
    }
    for (level, areas) in areas.iter().enumerate().filter(|(_, areas)| !areas.is_empty()) {
        chart.canvas.areas(areas, scale::colour(level));
    }
    let words = format!("mean {:.0} mm off", 1e3 * panel.mean_m);
    chart.canvas.text([chart.frame.left, chart.frame.top - 11.0], &words, Side::Right, BOLD);
}

fn notes(canvas: &Canvas, figure: &Walls) {
    let words = "Poisson surface's distance from the wall, mm";
    scale::legend(canvas, [LEFT_PX, 852.0], [300.0, 16.0], words, 1e3 * figure.most_m);
    let thinned: Vec<usize> = figure.panels.iter().map(thinned).collect();
    let (least, most) =
        (thinned.iter().min().copied().unwrap_or(1), thinned.iter().max().copied().unwrap_or(1));
    let drawn = if least == most { most.to_string() } else { format!("{least} to {most}") };
    let mut lines = vec![
        (None, format!("One in {drawn} samples is drawn; arrows: passes farthest apart.")),
        (Some(WIDE), "passes over 1.5 T_x/s apart".to_owned()),
    ];
    let unseen = figure.panels.iter().flat_map(|panel| &panel.unseen_m).map(|[from_m, to_m]| to_m - from_m);
    let unseen_m = unseen.fold(0.0, f64::max);
    if unseen_m > 0.0 {
        lines.push((
            Some(UNSEEN),
            format!("no sample along the whole stretch: up to {unseen_m:.2} m of wall"),
        ));
    }
    if figure.panels.iter().any(|panel| !panel.aligned) {
        lines.push((None, "Unaligned: heads begin anywhere in their turn or sector; one draw.".to_owned()));
    }
    lines.push((None, "Dark lines below: the floor's corners, which the surface rounds off.".to_owned()));
    for (k, (ground, line)) in (0_u32..).zip(&lines) {
        let [x, y] = [470.0, 838.0 + 17.0 * f64::from(k)];
        if let Some(ground) = ground {
            canvas.area([x, y - 6.0], [x + 28.0, y + 6.0], *ground);
        }
        canvas.text([if ground.is_some() { x + 36.0 } else { x }, y], line, Side::Right, SMALL);
    }
}
