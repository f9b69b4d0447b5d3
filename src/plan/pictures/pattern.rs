//! Chart of the sampling pattern on the unrolled wall.

use headrace_deliver::pictures::canvas::{BOLD, Canvas, Letters, NORMAL, SMALL, Side};
use headrace_deliver::pictures::chart::{Axis, Chart};
use headrace_deliver::pictures::clock;
use headrace_deliver::pictures::look::{self, Look};
use headrace_deliver::pictures::polyline::{Frame, Px};
use headrace_sampling::SamplingError;

use super::detail::{self, CIRCLE};
use super::laid::{self, Laid};
use super::shown::Shown;
use super::{modes, wall};

const FRAME: Frame = Frame { left: 66.0, top: 92.0, right: 548.0, bottom: 482.0 };
/// Position of the legend, pixels.
const LEGEND: Px = [634.0, 412.0];
/// Number of points around the wall at which the spacing is compared to find the largest.
const PLACES: usize = 360;

/// Draws the samples of several turns on the unrolled wall, with a circle at the largest gap. The diameter of
/// the circle is the spacing T.
pub(crate) fn pattern(shown: &Shown<'_>) -> Result<String, SamplingError> {
    let laid = laid::lay(shown)?;
    let places = shown.planner.perimeter(shown.mode, shown.speed_mps, PLACES)?;
    let worst = wall::worst(shown.planner, &places);
    let worst_m = wall::unseen_m(shown.planner).or(worst.map(|place| place.arc_m));
    let centre = worst_m.and_then(|arc_m| laid.emptiest(arc_m)).map(|(centre, _)| centre);
    let length_m = (laid::turns_shown(laid.heads) * laid.pitch_m).min(laid.to_m - laid.from_m);
    let from_m = centre.map_or(laid.from_m, |[x_m, _]| x_m - length_m / 2.0);
    let from_m = from_m.max(laid.from_m).min(laid.to_m - length_m);
    let title = format!("Pattern on the unrolled wall: {}", modes::at_speed(shown));
    let canvas = Canvas::new(&title, &shown.subtitle());
    let chart = chart(&canvas, &laid, length_m);
    if let (Some(centre), Some(t_m)) = (centre, laid.t_m) {
        circle(&chart, [centre[0] - from_m, centre[1]], t_m);
    }
    let ways = passes(&chart, &laid, from_m);
    numbers(&chart, laid.heads, &ways);
    clock::at_right(&chart, &shown.planner.inspection().profile);
    legend(&canvas, &laid);
    match (centre, laid.t_m) {
        (Some(centre), Some(t_m)) => detail::draw(&canvas, &laid, centre, from_m, t_m),
        _ => unseen(&canvas),
    }
    Ok(canvas.into_svg())
}

fn chart<'c>(canvas: &'c Canvas, laid: &Laid, length_m: f64) -> Chart<'c> {
    let x = Axis::new("distance along the tunnel, m", 0.0, length_m, 10);
    let y = Axis::new("arc length from the floor's centre, via the left wall, m", 0.0, laid.perimeter_m, 10);
    Chart::new(canvas, FRAME, &x, &y)
}

/// Draws the circle whose diameter is the spacing T, clipped to the chart. The axes differ in scale, so the circle
/// becomes an ellipse.
fn circle(chart: &Chart<'_>, centre: [f64; 2], t_m: f64) {
    let (middle, corner) = (chart.px(centre), chart.px([centre[0] + t_m / 2.0, centre[1] + t_m / 2.0]));
    chart.ellipse(middle, [corner[0] - middle[0], middle[1] - corner[1]], CIRCLE, &look::T);
    let note = "Left: the scales along and around the tunnel differ, so the circle appears as an ellipse.";
    chart.canvas.text([14.0, 546.0], note, Side::Right, SMALL);
}

/// Pieces of the heads' tracks, each with its head and its points on the sheet.
type Ways = Vec<(usize, Vec<Px>)>;

/// Draws the heads' tracks. Returns the tracks that are visible in the chart.
fn passes(chart: &Chart<'_>, laid: &Laid, from_m: f64) -> Ways {
    let mut ways = Vec::new();
    for pass in laid.passes() {
        let look = if pass.hidden { look::HIDDEN } else { way(pass.head) };
        let points: Vec<_> = pass.points.iter().map(|[x, arc]| [x - from_m, *arc]).collect();
        let pieces = chart.line(&points, &look);
        ways.extend(pieces.into_iter().filter(|_| !pass.hidden).map(|piece| (pass.head, piece)));
    }
    ways
}

/// Writes each head's number where its track reaches the top of the chart, or else on the longest piece of
/// the track.
fn numbers(chart: &Chart<'_>, heads: usize, ways: &Ways) {
    /// Distance below which two numbers would overlap, pixels.
    const APART_PX: f64 = 9.0;
    let mut taken: Vec<(usize, f64)> = Vec::new();
    for (head, piece) in ways {
        let ends = [piece.first(), piece.last()].into_iter().flatten();
        for top in ends.filter(|end| end[1] <= chart.frame.top + 1.0) {
            if taken.iter().all(|(_, x)| (x - top[0]).abs() > APART_PX) {
                number(chart, *head, [top[0], top[1] - 10.0]);
                taken.push((*head, top[0]));
            }
        }
    }
    for head in (0..heads).filter(|head| taken.iter().all(|(numbered, _)| numbered != head)) {
        let longest = ways.iter().filter(|(of, _)| *of == head).max_by_key(|(_, piece)| piece.len());
        if let Some(middle) = longest.and_then(|(_, piece)| piece.get(piece.len() / 2)) {
            number(chart, head, *middle);
        }
    }
}

/// Style of a head's track. It is thinner than a curve.
fn way(head: usize) -> Look {
    Look { width_px: 1.5, ..look::of_several(head) }
}

fn number(chart: &Chart<'_>, head: usize, place: Px) {
    let letters = Letters { colour: way(head).colour, ..BOLD };
    chart.canvas.text_on_white(place, &head.to_string(), Side::Middle, letters);
}

/// Draws the legend: each head's number with its line and marker, two heads per row.
fn legend(canvas: &Canvas, laid: &Laid) {
    const ROW_PX: f64 = 19.0;
    for head in 0..laid.heads {
        let place = [LEGEND[0] + 126.0 * (head % 2) as f64, LEGEND[1] + ROW_PX * (head / 2) as f64];
        canvas.marker([place[0] + 20.0, place[1]], &look::of_several(head), 3.2, true);
        entry(canvas, place, &format!("head {head}"), &way(head));
    }
    if laid.samples.iter().all(|sample| !sample.hidden) {
        return;
    }
    let y = LEGEND[1] + ROW_PX * laid.heads.div_ceil(2) as f64;
    entry(canvas, [LEGEND[0], y], "hidden by the vehicle", &look::HIDDEN);
}

fn entry(canvas: &Canvas, place: Px, words: &str, look: &Look) {
    canvas.line(&[place, [place[0] + 40.0, place[1]]], look);
    canvas.text([place[0] + 48.0, place[1]], words, Side::Right, NORMAL);
}

fn unseen(canvas: &Canvas) {
    let lines =
        ["No head sees part of the wall:", "no feature there is hit, however", "large, and there is no T."];
    for (k, line) in lines.iter().enumerate() {
        canvas.text([LEGEND[0], 150.0 + 19.0 * k as f64], line, Side::Right, BOLD);
    }
}
