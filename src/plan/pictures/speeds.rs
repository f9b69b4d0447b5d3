//! Chart of the sample spacing T against speed.

use headrace_deliver::pictures::canvas::{BOLD, Canvas, NORMAL, Side};
use headrace_deliver::pictures::chart::{Axis, Chart};
use headrace_deliver::pictures::labels::{self, Label};
use headrace_deliver::pictures::look;
use headrace_deliver::pictures::polyline::Frame;
use headrace_sampling::SamplingError;

use super::advised;
use super::modes::{self, Mode};
use super::shown::Shown;

const FRAME: Frame = Frame { left: 66.0, top: 92.0, right: 708.0, bottom: 482.0 };
/// Number of speeds at which the spacing T is computed for the upper end of the axis of T.
const SPEEDS: u32 = 400;

/// Draws the spacing T against speed for every mode, with the target and the requested speed.
pub(crate) fn speeds(shown: &Shown<'_>) -> Result<String, SamplingError> {
    let modes = modes::all(shown)?;
    let most_mps = most_mps(shown, &modes);
    let curves = modes.iter().filter(|mode| !mode.blind);
    let curves = curves.map(|mode| Ok((mode, spacings(shown, mode, most_mps)?)));
    let curves = curves.collect::<Result<Vec<_>, SamplingError>>()?;
    let most_m = most_m(shown, &curves);
    let canvas = Canvas::new("T against speed: how fast each mode may go", &shown.subtitle());
    let x = Axis::new("speed along the tunnel, m/s", 0.0, most_mps, 10);
    let y = Axis::new("T: a feature this large is hit, m", 0.0, most_m, 9);
    let chart = Chart::new(&canvas, FRAME, &x, &y);
    if let Some(target_m) = shown.question.target_m {
        chart.across(target_m, &look::TARGET);
    }
    let asked = asked(&chart, shown);
    let mut ends = Ends::default();
    for (mode, _) in &curves {
        ends.add(&chart, shown, mode, &curve(shown, mode, most_m));
    }
    marks(&chart, shown, &modes);
    ends.draw(&canvas, shown.question.target_m.is_some());
    if let Some((x, words)) = asked {
        canvas.text_on_white([x, FRAME.bottom - 14.0], &words, Side::Middle, NORMAL);
    }
    blind(&chart, &modes);
    Ok(canvas.into_svg())
}

/// Right end of the chart's speed axis, m/s.
fn most_mps(shown: &Shown<'_>, modes: &[Mode]) -> f64 {
    let fastest = modes.iter().filter_map(|mode| mode.v_max_mps).map(|v_mps| 1.5 * v_mps);
    let asked = shown
        .asked_mps()
        .map(|asked_mps| if shown.question.target_m.is_some() { 1.25 } else { 2.0 } * asked_mps);
    let most = fastest.chain(asked).fold(0.0, f64::max);
    if most > 0.0 { most } else { 2.0 * shown.speed_mps }
}

/// Upper end of the chart's axis for the spacing T, m.
fn most_m(shown: &Shown<'_>, curves: &[(&Mode, Vec<[f64; 2]>)]) -> f64 {
    let at_rest = curves.iter().filter_map(|(_, points)| points.first()).map(|[_, t_m]| *t_m);
    let at_rest_m = at_rest.fold(f64::INFINITY, f64::min);
    let here = curves.iter().find(|(mode, _)| mode.number == shown.mode);
    let asked_m = here.zip(shown.asked_mps()).and_then(|((_, points), asked_mps)| {
        points.iter().find(|[v_mps, _]| *v_mps >= asked_mps).map(|[_, t_m]| 1.25 * t_m)
    });
    // Without a target, the axis shows larger spacings T too, so that all modes can be compared.
    let wide = if shown.question.target_m.is_none() { 4.0 } else { 1.0 };
    let target_m = shown.question.target_m.map(|target_m| 2.6 * target_m);
    let least_m = if at_rest_m.is_finite() { 1.5 * at_rest_m } else { 0.0 };
    let most_m = target_m.into_iter().chain(asked_m.map(|t_m| wide * t_m)).fold(least_m, f64::max);
    let most_m = if wide > 1.0 { most_m.min(1.1 * highest_m(curves)) } else { most_m };
    if most_m > 0.0 { most_m } else { 1.0 }
}

/// Largest spacing T of any mode at the speeds of the axis, m.
fn highest_m(curves: &[(&Mode, Vec<[f64; 2]>)]) -> f64 {
    curves.iter().flat_map(|(_, points)| points).map(|[_, t_m]| *t_m).fold(0.0, f64::max)
}

/// Points of a mode's curve: the largest speed that meets the spacing T, m/s, and T, m.
pub(super) fn curve(shown: &Shown<'_>, mode: &Mode, most_m: f64) -> Vec<[f64; 2]> {
    let points = advised::curve(shown.planner, mode.number, most_m, shown.question.target_m);
    points.into_iter().map(|[t_m, v_mps]| [v_mps, t_m]).collect()
}

/// Points of the curve of T without position errors, one for each speed of the axis: speed, m/s, and T, m.
fn spacings(shown: &Shown<'_>, mode: &Mode, most_mps: f64) -> Result<Vec<[f64; 2]>, SamplingError> {
    let point = |k: u32| {
        // The spacing T is undefined at rest, so the first speed is very low.
        let v_mps = most_mps * f64::from(k).max(0.01) / f64::from(SPEEDS);
        Ok([v_mps, shown.planner.t_max_m(mode.number, v_mps)?])
    };
    (0..=SPEEDS).map(point).collect()
}

/// Draws the requested speed as a line. Returns the line's x position and its label.
fn asked(chart: &Chart<'_>, shown: &Shown<'_>) -> Option<(f64, String)> {
    let asked_mps = shown.asked_mps()?;
    chart.upright(asked_mps, &look::ASKED);
    let why = match shown.question.time_s {
        Some(time_s) if shown.question.speed_mps.is_none() => {
            format!("{} h: ", modes::hours(time_s / 3600.0))
        }
        _ => "required: ".to_owned(),
    };
    Some((chart.px([asked_mps, 0.0])[0], format!("{why}{} m/s", modes::speed(asked_mps))))
}

/// Labels at the points where the modes' curves leave the chart's frame.
#[derive(Default)]
struct Ends {
    right: Vec<Label>,
    above: Vec<Label>,
}

impl Ends {
    fn add(&mut self, chart: &Chart<'_>, shown: &Shown<'_>, mode: &Mode, points: &[[f64; 2]]) {
        let pieces = chart.line(points, &mode.look);
        let end = pieces.last().and_then(|piece| piece.last()).copied();
        let reached = match (shown.question.target_m, mode.v_max_mps) {
            (None, _) => None,
            (Some(_), Some(v_mps)) => Some(format!("{} m/s", modes::speed(v_mps))),
            (Some(_), None) => Some("never".to_owned()),
        };
        let Some(end) = end else {
            // The whole curve is above the chart's frame.
            let corner = [chart.frame.left, chart.frame.top];
            self.above.push(label(corner, mode, format!("{}: above", mode.name)));
            return;
        };
        let words = [Some(mode.name.clone()), reached].into_iter().flatten().collect::<Vec<_>>().join(": ");
        let ends = if end[0] >= chart.frame.right - 1.0 { &mut self.right } else { &mut self.above };
        ends.push(label(end, mode, words));
    }

    fn draw(&self, canvas: &Canvas, heading: bool) {
        for (k, line) in ["at most, to meet", "the target:"].iter().enumerate().filter(|_| heading) {
            let place = [FRAME.right + 12.0, FRAME.top - 26.0 + 15.0 * k as f64];
            canvas.text(place, line, Side::Right, NORMAL);
        }
        labels::above(canvas, &FRAME, &self.above);
        labels::at_right(canvas, &FRAME, &self.right);
    }
}

fn label(place: [f64; 2], mode: &Mode, words: String) -> Label {
    Label { place, lines: vec![words], look: mode.look, bold: true }
}

/// Draws markers where curves meet the target. The marker of the fastest mode is filled and has its speed.
fn marks(chart: &Chart<'_>, shown: &Shown<'_>, modes: &[Mode]) {
    let Some(target_m) = shown.question.target_m else { return };
    let fastest = modes::fastest(modes).map(|mode| mode.number);
    for mode in modes {
        let Some(v_mps) = mode.v_max_mps else { continue };
        let best = fastest == Some(mode.number);
        let place = chart.px([v_mps, target_m]);
        chart.canvas.marker(place, &mode.look, if best { 6.0 } else { 4.5 }, best);
        if best {
            chart.line(&[[v_mps, 0.0], [v_mps, target_m]], &look::LEADER);
            let words = format!("{} {} m/s", mode.name, modes::speed(v_mps));
            chart.canvas.text_on_white([place[0] + 8.0, place[1] + 18.0], &words, Side::Right, BOLD);
        }
    }
    let none = fastest.is_none() && modes.iter().any(|mode| !mode.blind);
    let words = format!("target {target_m} m{}", if none { ": no mode meets it" } else { "" });
    chart.canvas.text_on_white(
        [FRAME.left + 6.0, chart.px([0.0, target_m])[1] - 11.0],
        &words,
        Side::Right,
        NORMAL,
    );
}

fn blind(chart: &Chart<'_>, modes: &[Mode]) {
    let words = modes::blind_words(modes);
    if !words.is_empty() {
        chart.instead(&words);
    }
}
