//! Chart of the spacing around the wall.

use headrace_deliver::pictures::canvas::{self, Canvas, NORMAL, SMALL, Side, width_px};
use headrace_deliver::pictures::chart::{Axis, Chart, short};
use headrace_deliver::pictures::clock::{self, Hour};
use headrace_deliver::pictures::labels::{self, Label};
use headrace_deliver::pictures::look::{self, BLACK, Colour, Look, PALE};
use headrace_deliver::pictures::polyline::Frame;
use headrace_sampling::SamplingError;
use headrace_sampling::plan::WallPlace;

use super::modes;
use super::shown::Shown;
use super::wall::{self, Thin};

const FRAME: Frame = Frame { left: 66.0, top: 72.0, right: 724.0, bottom: 444.0 };
/// Number of points around the wall at which the spacing is computed.
const PLACES: usize = 720;
const FEWER: Colour = Colour(236, 241, 246);
const UNSEEN: Colour = Colour(214, 214, 214);
const BAND: Colour = Colour(205, 226, 240);

/// Spacing around the wall, and the places that the chart marks.
struct Around {
    places: Vec<WallPlace>,
    /// Point with the largest sample spacing T.
    worst: Option<WallPlace>,
    /// Sample spacing T that the plan uses, m.
    counted_m: Option<f64>,
    /// Centre of the widest strip that no head sees, m.
    unseen_m: Option<f64>,
}

/// Draws the spacings along the perimeter: T_y around the wall, T_x along the tunnel, T computed from both, the target,
/// and the strips that only some heads see.
pub(crate) fn perimeter(shown: &Shown<'_>) -> Result<String, SamplingError> {
    let places = shown.planner.perimeter(shown.mode, shown.speed_mps, PLACES)?;
    let around = Around {
        worst: wall::worst(shown.planner, &places),
        counted_m: Some(shown.planner.t_max_m(shown.mode, shown.speed_mps)?).filter(|t_m| t_m.is_finite()),
        unseen_m: wall::unseen_m(shown.planner),
        places,
    };
    let title = format!("Spacing around the wall: {}", modes::at_speed(shown));
    let canvas = Canvas::new(&title, &shown.subtitle());
    let chart = chart(&canvas, shown, &around);
    let stretches = wall::thin(shown.planner);
    for stretch in &stretches {
        shade(&chart, stretch);
    }
    clocks(&chart, &clock::hours(&shown.planner.inspection().profile));
    if let Some(target_m) = shown.question.target_m {
        chart.across(target_m, &look::TARGET);
    }
    match around.worst {
        Some(worst) => curves(&chart, shown, &around.places, &worst),
        None => chart.instead(&[
            "No head sees the wall anywhere:".to_owned(),
            "there is no spacing to show.".to_owned(),
        ]),
    }
    captions(&chart, &stretches);
    across(&chart, &around);
    canvas.text([14.0, 546.0], &note(shown, &around), Side::Right, SMALL);
    Ok(canvas.into_svg())
}

impl Around {
    fn most_m(&self) -> f64 {
        self.places.iter().filter_map(|place| place.t_m).fold(0.0, f64::max)
    }

    /// Place of the widest strip that no head sees, and the spacing T across it.
    ///
    /// `None` unless this T is the largest value in the chart, and less than three times the second largest.
    fn across_m(&self) -> Option<[f64; 2]> {
        let t_m = self.counted_m.filter(|t_m| *t_m > self.most_m() && *t_m < 3.0 * self.most_m())?;
        Some([self.unseen_m?, t_m])
    }
}

/// Draws the spacing T across the widest strip that no head sees, as a marked value.
fn across(chart: &Chart<'_>, around: &Around) {
    let Some(point) = around.across_m() else { return };
    let place = chart.px(point);
    chart.canvas.marker(place, &look::T, 4.5, false);
    let side =
        if place[0] > f64::midpoint(chart.frame.left, chart.frame.right) { Side::Left } else { Side::Right };
    let x = if matches!(side, Side::Left) { place[0] - 10.0 } else { place[0] + 10.0 };
    chart.canvas.text_on_white([x, place[1] + 16.0], &format!("{} m across", short(point[1])), side, NORMAL);
}

/// Text about the plan's spacing T; empty if this T is also the largest in the chart.
fn note(shown: &Shown<'_>, around: &Around) -> String {
    let (Some(counted_m), Some(here_m)) = (around.counted_m, around.worst.and_then(|place| place.t_m)) else {
        return String::new();
    };
    let allowed = allowed(shown);
    if allowed.is_empty() && (counted_m / here_m - 1.0).abs() < 0.005 {
        return String::new();
    }
    let why = if around.unseen_m.is_some() {
        "a strip that no head sees counts as one long step across it"
    } else if counted_m < here_m {
        "a narrow strip that few heads see is bounded by its width"
    } else {
        "the worst case of each strip of the wall"
    };
    format!("The plan uses T = {} m: {why}{allowed}.", short(counted_m))
}

/// Text about the drift, yaw and yaw rate that the plan allows for.
fn allowed(shown: &Shown<'_>) -> String {
    let inspection = shown.planner.inspection();
    let drift = (inspection.drift_m > 0.0).then(|| format!("{} m of drift", inspection.drift_m));
    let degrees = |rad: f64, of: &str| (rad > 0.0).then(|| format!("{:.0}°{of}", rad.to_degrees()));
    let yaw = degrees(inspection.yaw_rad, " of yaw");
    let turning = degrees(inspection.yaw_rate_radps, "/s of turning about");
    let all: Vec<String> = [drift, yaw, turning].into_iter().flatten().collect();
    if all.is_empty() { String::new() } else { format!(", with {}", all.join(" and ")) }
}

fn chart<'c>(canvas: &'c Canvas, shown: &Shown<'_>, around: &Around) -> Chart<'c> {
    let most_m = [Some(around.most_m()), around.across_m().map(|[_, t_m]| t_m), shown.question.target_m];
    let most_m = most_m.into_iter().flatten().fold(0.0, f64::max);
    // There must be room for the captions above the curves.
    let top_m = if most_m > 0.0 { 1.25 * most_m } else { 1.0 };
    let perimeter_m = shown.planner.inspection().profile.perimeter_m();
    let x = Axis::new(
        "arc length from the floor's centre via the left wall, m; clock seen looking along the tunnel",
        0.0,
        perimeter_m,
        12,
    )
    .with_name_at(62.0);
    Chart::new(canvas, FRAME, &x, &Axis::new("distance between samples, m", 0.0, top_m, 9))
}

fn shade(chart: &Chart<'_>, stretch: &Thin) {
    let [left, right] = [stretch.from_m, stretch.to_m].map(|arc_m| chart.px([arc_m, 0.0])[0]);
    let Frame { top, bottom, .. } = chart.frame;
    if stretch.heads > 0 {
        chart.canvas.area([left, top], [right, bottom], FEWER);
        return;
    }
    chart.canvas.area([left, top], [right, bottom], UNSEEN);
    for x in [left, right] {
        chart.canvas.line(&[[x, top], [x, bottom]], &Look { colour: PALE, width_px: 1.0, ..look::T });
    }
}

/// Draws a second row of axis labels: positions on the wall as clock hours.
fn clocks(chart: &Chart<'_>, hours: &[Hour]) {
    let y = chart.frame.bottom + 34.0;
    let mut taken: Vec<[f64; 2]> = Vec::new();
    // The floor, the walls and the crown are labelled first. The hours between them are labelled if there is
    // room.
    let (named, between): (Vec<&Hour>, Vec<&Hour>) = hours.iter().partition(|hour| !hour.place.is_empty());
    for hour in named.into_iter().chain(between) {
        let x = chart.px([hour.arc_m, 0.0])[0];
        let half = width_px(&hour.words(), NORMAL) / 2.0;
        if taken.iter().any(|[from, to]| x + half > *from && x - half < *to) {
            continue;
        }
        taken.push([x - half, x + half]);
        chart.canvas.text([x, y], &hour.words(), Side::Middle, NORMAL);
        chart.canvas.line(&[[x, y - 14.0], [x, y - 9.0]], &Look { colour: PALE, width_px: 1.0, ..look::T });
    }
}

/// Writes captions above the stretches of wall that fewer heads see than the best-covered part. A caption states how
/// many heads see the stretch.
fn captions(chart: &Chart<'_>, stretches: &[Thin]) {
    let mut last: Option<(f64, [String; 2])> = None;
    for stretch in stretches {
        let words = stretch.words();
        let half = words.iter().map(|word| width_px(word, SMALL)).fold(0.0, f64::max) / 2.0;
        let [x, _] = chart.px([f64::midpoint(stretch.from_m, stretch.to_m), 0.0]);
        let x = x.clamp(chart.frame.left + half + 2.0, chart.frame.right - half - 2.0);
        if last.as_ref().is_some_and(|(before, said)| *said == words && x - before < 2.0 * half + 6.0) {
            continue;
        }
        for (k, word) in words.iter().enumerate() {
            let letters = canvas::Letters { colour: BLACK, ..SMALL };
            chart.canvas.text([x, chart.frame.top + 11.0 + 14.0 * k as f64], word, Side::Middle, letters);
        }
        last = Some((x, words));
    }
}

fn curves(chart: &Chart<'_>, shown: &Shown<'_>, places: &[WallPlace], largest: &WallPlace) {
    let t_x = |place: &WallPlace, which: usize| place.t_x_m.and_then(|both| both.get(which).copied());
    let alternate =
        places.iter().filter_map(|place| place.t_x_m).any(|[smaller, larger]| larger - smaller > 1e-9);
    if alternate {
        for band in runs(places, |place| place.t_x_m) {
            let upper = band.iter().map(|(arc_m, [_, larger])| chart.px([*arc_m, *larger]));
            let lower = band.iter().rev().map(|(arc_m, [smaller, _])| chart.px([*arc_m, *smaller]));
            chart.canvas.polygon(&upper.chain(lower).collect::<Vec<_>>(), BAND);
        }
        line(chart, places, |place| t_x(place, 0), &Look { width_px: 1.2, ..look::T_X });
    }
    line(chart, places, |place| t_x(place, 1), &look::T_X);
    line(chart, places, |place| (place.t_y_m > 0.0).then_some(place.t_y_m), &look::T_Y);
    line(chart, places, |place| place.t_m, &look::T);
    let t_m = largest.t_m.unwrap_or(0.0);
    chart.canvas.marker(chart.px([largest.arc_m, t_m]), &look::T, 4.5, true);
    name_curves(chart, shown, places, largest, alternate);
}

fn name_curves(
    chart: &Chart<'_>,
    shown: &Shown<'_>,
    places: &[WallPlace],
    largest: &WallPlace,
    alternate: bool,
) {
    let last = places.iter().rev().find(|place| place.t_m.is_some());
    let end = |y_m: f64| [chart.frame.right, chart.px([0.0, y_m])[1]];
    let label = |y_m: f64, look: Look, bold: bool, lines: &[&str]| Label {
        place: end(y_m),
        lines: lines.iter().map(|line| (*line).to_owned()).collect(),
        look,
        bold,
    };
    let clock = shown.planner.inspection().profile.clock(largest.arc_m);
    let most = format!("up to {} m, {clock}", short(largest.t_m.unwrap_or(0.0)));
    let mut labels = Vec::new();
    if let Some(last) = last {
        let mut of_both = vec!["T, both together:", &most];
        let over =
            shown.question.target_m.is_some_and(|target_m| largest.t_m.is_some_and(|t_m| t_m > target_m));
        of_both.extend(over.then_some("over the target"));
        labels.push(label(last.t_m.unwrap_or(0.0), look::T, true, &of_both));
        let between: &[&str] = if alternate {
            &["T_x, between passes:", "two distances", "that alternate"]
        } else {
            &["T_x, between passes"]
        };
        labels.push(label(last.t_x_m.map_or(0.0, |both| both[1]), look::T_X, false, between));
        labels.push(label(last.t_y_m, look::T_Y, false, &["T_y, neighbours", "of one turn"]));
    }
    if let Some(target_m) = shown.question.target_m {
        labels.push(label(target_m, look::TARGET, false, &[&format!("target {target_m} m")]));
    }
    labels::at_right(chart.canvas, &chart.frame, &labels);
}

fn line(chart: &Chart<'_>, places: &[WallPlace], of: impl Fn(&WallPlace) -> Option<f64>, look: &Look) {
    for run in runs(places, of) {
        let points: Vec<_> = run.into_iter().map(|(arc_m, value_m)| [arc_m, value_m]).collect();
        chart.line(&points, look);
    }
}

/// Splits a curve into pieces of neighbouring points that have a value.
fn runs<V>(places: &[WallPlace], of: impl Fn(&WallPlace) -> Option<V>) -> Vec<Vec<(f64, V)>> {
    let mut runs = vec![Vec::new()];
    for place in places {
        match (of(place), runs.last_mut()) {
            (Some(value), Some(run)) => run.push((place.arc_m, value)),
            (None, Some(run)) if !run.is_empty() => runs.push(Vec::new()),
            _ => {}
        }
    }
    runs
}
