//! Chart of the duration of a dive, in hours, against the sample spacing T.

use headrace_deliver::pictures::canvas::{BOLD, Canvas, NORMAL, Side, width_px};
use headrace_deliver::pictures::chart::{Axis, Chart, short};
use headrace_deliver::pictures::labels::{self, Label};
use headrace_deliver::pictures::look::{self, Colour, Look};
use headrace_deliver::pictures::polyline::Frame;
use headrace_sampling::SamplingError;

use super::advised;
use super::modes::{self, Mode};
use super::shown::Shown;

const FRAME: Frame = Frame { left: 66.0, top: 92.0, right: 752.0, bottom: 482.0 };
/// Number of values of the spacing T at which the fastest mode is determined.
const LEAST: u32 = 300;
/// Style of the band under the mode that takes the least time.
const BAND: Look = Look { colour: Colour(222, 222, 222), width_px: 9.0, ..look::T };

/// The spacing T that the chart marks, and the hours that every mode takes for it.
struct Sought {
    t_m: f64,
    /// Hours for the whole length in each mode.
    hours: Vec<Option<f64>>,
}

/// Draws the hours for the whole length, one way, against the spacing T, for every mode.
pub(crate) fn hours(shown: &Shown<'_>) -> Result<String, SamplingError> {
    let modes = modes::all(shown)?;
    let sought = sought(shown, &modes)?;
    let most = ends(shown, &modes, &sought)?;
    let title = format!("Hours for {} m, one way, against T", shown.planner.inspection().length_m);
    let canvas = Canvas::new(&title, &shown.subtitle());
    let x = Axis::new("T: a feature this large is hit, m", 0.0, most[0], 12);
    let chart = Chart::new(&canvas, FRAME, &x, &Axis::new("hours, one way", 0.0, most[1], 9));
    let words = modes::blind_words(&modes);
    if modes.iter().any(|mode| !mode.blind) {
        curves(&chart, shown, &modes, &sought, most[0]);
    }
    if !words.is_empty() {
        chart.instead(&words);
    }
    Ok(canvas.into_svg())
}

/// Draws all curves and marks, if any mode gives a finite spacing T.
fn curves(chart: &Chart<'_>, shown: &Shown<'_>, modes: &[Mode], sought: &Sought, most_m: f64) {
    chart.line(&least(shown, modes, most_m), &BAND);
    legend(chart);
    let mut right: Vec<Label> = asked(chart, shown, sought).into_iter().collect();
    for mode in modes.iter().filter(|mode| !mode.blind) {
        let pieces = chart.line(&curve(shown, mode, most_m, sought.t_m), &mode.look);
        let end = pieces.last().and_then(|piece| piece.last()).copied();
        right.push(label(chart, mode, end, sought.hours.get(mode.number).copied().flatten()));
    }
    labels::at_right(chart.canvas, &FRAME, &right);
    marks(chart, shown, modes, sought);
}

/// The spacing T that the chart marks: the target, or else T at the requested speed.
fn sought(shown: &Shown<'_>, modes: &[Mode]) -> Result<Sought, SamplingError> {
    let length_m = shown.planner.inspection().length_m;
    let t_m = match shown.question.target_m {
        Some(target_m) => target_m,
        None => shown.planner.t_max_m(shown.mode, shown.asked_mps().unwrap_or(shown.speed_mps))?,
    };
    // Without a finite spacing T, the chart has text in place of curves, so the end of its axis has no effect.
    let t_m = if t_m.is_finite() { t_m } else { 1.0 };
    let hours = |mode: &Mode| Some(length_m / shown.planner.v_max_mps(mode.number, t_m).ok()? / 3600.0);
    Ok(Sought { t_m, hours: modes.iter().map(hours).collect() })
}

/// Upper ends of the chart's two axes: largest spacing T, m, and largest number of hours.
fn ends(shown: &Shown<'_>, modes: &[Mode], sought: &Sought) -> Result<[f64; 2], SamplingError> {
    let length_m = shown.planner.inspection().length_m;
    let all = || sought.hours.iter().flatten().copied();
    let (least_h, most_h) = (all().fold(f64::INFINITY, f64::min), all().fold(0.0, f64::max));
    let asked_h = shown.asked_mps().map_or(0.0, |asked_mps| length_m / asked_mps / 3600.0);
    let shown_h = length_m / shown.speed_mps / 3600.0;
    if most_h > 0.0 {
        return Ok([2.2 * sought.t_m, (1.15 * most_h).min(4.0 * least_h).max(1.3 * asked_h)]);
    }
    // If no mode meets the target, the axis of T extends to the largest spacing T that any mode has at the speed of the
    // charts.
    let mut reached_m = 0.0_f64;
    for mode in modes.iter().filter(|mode| !mode.blind) {
        reached_m = reached_m.max(shown.planner.t_max_m(mode.number, shown.speed_mps)?);
    }
    Ok([(1.3 * reached_m).max(2.2 * sought.t_m), (3.0 * shown_h).max(1.3 * asked_h)])
}

/// Draws the legend of the band that marks the fastest mode.
fn legend(chart: &Chart<'_>) {
    let [x, y] = [FRAME.right - 10.0, FRAME.top + 12.0];
    chart.canvas.line(&[[x - 40.0, y], [x, y]], &BAND);
    chart.canvas.text_on_white([x - 46.0, y], "takes least time", Side::Left, NORMAL);
}

/// Points of a mode's curve: the spacing T, m, and the hours for the whole length at the largest speed that meets T.
pub(super) fn curve(shown: &Shown<'_>, mode: &Mode, most_m: f64, marked_m: f64) -> Vec<[f64; 2]> {
    let length_m = shown.planner.inspection().length_m;
    let points = advised::curve(shown.planner, mode.number, most_m, Some(marked_m));
    points.into_iter().map(|[t_m, v_mps]| [t_m, length_m / v_mps / 3600.0]).collect()
}

/// Fewest hours of any mode for each spacing T.
fn least(shown: &Shown<'_>, modes: &[Mode], most_m: f64) -> Vec<[f64; 2]> {
    let length_m = shown.planner.inspection().length_m;
    let point = |k: u32| {
        let t_m = most_m * f64::from(k) / f64::from(LEAST);
        let speeds = modes.iter().filter_map(|mode| shown.planner.v_max_mps(mode.number, t_m).ok());
        let fastest_mps = speeds.max_by(f64::total_cmp)?;
        Some([t_m, length_m / fastest_mps / 3600.0])
    };
    (1..=LEAST).filter_map(point).collect()
}

/// Draws the marked spacing T as a vertical line, and the requested time as a horizontal one. Returns the label of the
/// time.
fn asked(chart: &Chart<'_>, shown: &Shown<'_>, sought: &Sought) -> Option<Label> {
    chart.upright(sought.t_m, &look::TARGET);
    if let Some(asked_mps) = shown.asked_mps() {
        let asked_h = shown.planner.inspection().length_m / asked_mps / 3600.0;
        chart.across(asked_h, &look::ASKED);
        let lines = match shown.question.time_s {
            Some(_) if shown.question.speed_mps.is_none() => {
                vec![format!("required: {} h", modes::hours(asked_h))]
            }
            _ => vec![
                format!("{} h at the", modes::hours(asked_h)),
                format!("{} m/s required", modes::speed(asked_mps)),
            ],
        };
        let place = [FRAME.right, chart.px([0.0, asked_h])[1]];
        return Some(Label { place, lines, look: look::ASKED, bold: false });
    }
    None
}

fn label(chart: &Chart<'_>, mode: &Mode, end: Option<[f64; 2]>, hours: Option<f64>) -> Label {
    let words = match hours {
        Some(hours) => format!("{}: {} h", mode.name, modes::hours(hours)),
        None => format!("{}: never", mode.name),
    };
    let place = end.unwrap_or([chart.frame.right, chart.frame.top]);
    Label { place, lines: vec![words], look: mode.look, bold: true }
}

/// Draws markers where curves meet the target. The marker of the fastest mode is filled and has its hours and
/// speed.
fn marks(chart: &Chart<'_>, shown: &Shown<'_>, modes: &[Mode], sought: &Sought) {
    let Sought { t_m, hours } = sought;
    let found = modes.iter().filter_map(|mode| Some((mode, (*hours.get(mode.number)?)?)));
    let found: Vec<_> = found.collect();
    let best = found.iter().min_by(|a, b| a.1.total_cmp(&b.1)).map(|(mode, _)| mode.number);
    for (mode, hours) in &found {
        let is_best = best == Some(mode.number);
        let place = chart.px([*t_m, *hours]);
        if !chart.frame.has(place) {
            continue;
        }
        chart.canvas.marker(place, &mode.look, if is_best { 6.5 } else { 4.5 }, is_best);
        if is_best {
            let v_mps = shown.planner.inspection().length_m / hours / 3600.0;
            let words = format!("{}: {} h at {} m/s", mode.name, modes::hours(*hours), modes::speed(v_mps));
            chart.canvas.text_on_white([place[0] - 12.0, place[1] + 20.0], &words, Side::Left, BOLD);
        }
    }
    let words = match shown.question.target_m {
        Some(target_m) if found.is_empty() => format!("target {target_m} m: no mode meets it"),
        Some(target_m) => format!("target {target_m} m"),
        None => format!("{} m, at the required speed", short(*t_m)),
    };
    let place = chart.px([*t_m, 0.0])[0].max(FRAME.left + width_px(&words, NORMAL) / 2.0);
    chart.canvas.text([place, FRAME.top - 10.0], &words, Side::Middle, NORMAL);
    for (k, line) in ["hours at the", "vertical line:"].iter().enumerate() {
        let place = [FRAME.right + 12.0, FRAME.top - 26.0 + 15.0 * k as f64];
        chart.canvas.text(place, line, Side::Right, NORMAL);
    }
}
