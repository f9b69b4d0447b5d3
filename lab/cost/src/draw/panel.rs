//! One scene's chart: a line per method, a marker per setting, the Pareto front, and the plateau of costly settings.
//!
//! Text states the default, the knee and the price of the next step.

use headrace_deliver::pictures::canvas::{BOLD, Canvas, NORMAL, SMALL, Side};
use headrace_deliver::pictures::chart::{Axis, Chart};
use headrace_deliver::pictures::labels::{self as ends, Label};
use headrace_deliver::pictures::look::{self, Colour, Look};
use headrace_deliver::pictures::polyline::Frame;

use super::labels::Taken;
use crate::point::{Point, Trade};
use crate::words;

/// Wide grey line that is drawn under the Pareto front.
pub(super) const BAND: Look = Look { colour: Colour(214, 214, 214), width_px: 9.0, ..look::T };
/// Background colour of the plateau: settings that cost clearly more without a smaller error.
pub(super) const PLATEAU: Colour = Colour(255, 240, 200);
const WHISKER: Look = Look { colour: Colour(170, 170, 170), width_px: 0.9, ..look::T };
/// Line from a marker to a label that is not beside the marker.
const LEADER: Look = Look { colour: Colour(110, 110, 110), width_px: 0.7, ..look::T };
/// A setting belongs to the plateau if its error is at most this multiple of its method's smallest error.
const SAME: f64 = 1.05;
/// Smallest error drawn, as a multiple of the oracle's own error.
pub(super) const CLEAR: f64 = 10.0;
/// Margin around the outermost points, as a ratio.
const ROOM: f64 = 1.25;

pub(super) struct Panel<'a> {
    trade: &'a Trade,
    scene: &'a str,
    points: Vec<&'a Point>,
    frame: Frame,
}

impl<'a> Panel<'a> {
    pub(super) fn of(trade: &'a Trade, scene: &'a str, top_px: f64, height_px: f64) -> Self {
        let frame =
            Frame { left: 96.0, top: top_px + 34.0, right: 780.0, bottom: top_px + height_px - 112.0 };
        let points = trade.points.iter().filter(|point| point.scene == scene);
        Self { trade, scene, points: points.filter(|point| point.cost.middle > 0.0).collect(), frame }
    }

    pub(super) fn draw(&self, canvas: &Canvas) {
        canvas.text([14.0, self.frame.top - 20.0], self.scene, Side::Right, BOLD);
        let Some([x, y]) = self.ranges() else {
            canvas.text([self.frame.left, self.frame.top + 20.0], "nothing measured", Side::Right, NORMAL);
            return;
        };
        let x_axis = Axis::logarithmic(&self.trade.error_axis, x[0], x[1], 10).with_name_at(34.0);
        let y_axis = Axis::logarithmic(&self.trade.cost_axis, y[0], y[1], 8).with_name_at(62.0);
        self.plateau(canvas, x, y);
        let chart = Chart::new(canvas, self.frame, &x_axis, &y_axis);
        if let Some(decides) = self.trade.decides.filter(|decides| (x[0]..x[1]).contains(decides)) {
            chart.upright(decides, &look::TARGET);
        }
        chart.line(&self.front().iter().map(|point| self.place(point)).collect::<Vec<_>>(), &BAND);
        self.lines(&chart);
        self.markers(&chart);
        for (k, line) in words::steps(self.trade, self.scene).iter().enumerate() {
            let place = [self.frame.left, self.frame.bottom + 58.0 + 17.0 * k as f64];
            canvas.text(place, line, Side::Right, if k == 0 { NORMAL } else { SMALL });
        }
    }

    /// Position of a point in the chart. Errors below [`CLEAR`] times the reference's own error are drawn at that
    /// limit.
    fn place(&self, point: &Point) -> [f64; 2] {
        [self.shown(point.error()), point.cost.middle]
    }

    fn shown(&self, error: f64) -> f64 {
        error.max(CLEAR * self.trade.oracle.size)
    }

    fn ranges(&self) -> Option<[[f64; 2]; 2]> {
        let finite = |value: &f64| value.is_finite() && *value > 0.0;
        let range = |values: Vec<f64>| {
            let least = values.iter().copied().filter(finite).fold(f64::INFINITY, f64::min);
            let most = values.iter().copied().filter(finite).fold(0.0, f64::max);
            (most > 0.0).then_some([least / ROOM, most * ROOM])
        };
        let errors = self.points.iter().map(|point| self.shown(point.error())).chain(self.trade.decides);
        let costs = self.points.iter().flat_map(|point| [point.cost.low, point.cost.high]);
        Some([range(errors.collect())?, range(costs.collect())?])
    }

    fn methods(&self) -> Vec<&'a str> {
        let mut methods: Vec<&str> = Vec::new();
        for point in &self.points {
            if !methods.contains(&point.method.as_str()) {
                methods.push(&point.method);
            }
        }
        methods
    }

    /// Points of the Pareto front, from small errors to large ones.
    fn front(&self) -> Vec<&'a Point> {
        let mut front: Vec<&Point> = self.points.iter().copied().filter(|point| point.on_front).collect();
        front.sort_by(|a, b| a.error().total_cmp(&b.error()).then(b.cost.middle.total_cmp(&a.cost.middle)));
        front
    }

    /// Draws the background behind each method's plateau: points that cost clearly more than others without a smaller
    /// error.
    fn plateau(&self, canvas: &Canvas, x: [f64; 2], y: [f64; 2]) {
        for method in self.methods() {
            self.plateau_of(method, canvas, x, y);
        }
    }

    fn plateau_of(&self, method: &str, canvas: &Canvas, x: [f64; 2], y: [f64; 2]) {
        let points: Vec<&&Point> = self.points.iter().filter(|point| point.method == method).collect();
        let errors = points.iter().map(|point| self.shown(point.error()));
        let least = errors.fold(f64::INFINITY, f64::min);
        let same = points.into_iter().filter(|point| self.shown(point.error()) <= least * SAME);
        let same: Vec<&&Point> = same.collect();
        let cheapest = same.iter().map(|point| point.cost.high).fold(f64::INFINITY, f64::min);
        let dearest = same.iter().map(|point| point.cost.low).fold(0.0, f64::max);
        if same.len() < 2 || dearest <= cheapest {
            return;
        }
        let share = |value: f64, [from, to]: [f64; 2]| {
            headrace_geometry::math::ln(value / from) / headrace_geometry::math::ln(to / from)
        };
        let Frame { left, top, right, bottom } = self.frame;
        let across = [least / 1.04, least * SAME * 1.04]
            .map(|error| (left + share(error, x) * (right - left)).clamp(left, right));
        let up =
            [dearest, cheapest].map(|cost| (bottom - share(cost, y) * (bottom - top)).clamp(top, bottom));
        let wide = (across[1] - across[0]).max(18.0);
        let middle = f64::midpoint(across[0], across[1]);
        canvas.area([middle - wide / 2.0, up[0]], [middle + wide / 2.0, up[1]], PLATEAU);
    }

    fn lines(&self, chart: &Chart<'_>) {
        let mut labels: Vec<Label> = Vec::new();
        for (number, method) in self.methods().into_iter().enumerate() {
            let look = look::of_several(number);
            let points = self.points.iter().filter(|point| point.method == method);
            let places: Vec<[f64; 2]> = points.map(|point| self.place(point)).collect();
            chart.line(&places, &Look { width_px: 1.4, ..look });
            let end = places.iter().copied().max_by(|a, b| a[0].total_cmp(&b[0]));
            let place = end.map_or([chart.frame.right, chart.frame.top], |end| chart.px(end));
            labels.push(Label { place, lines: vec![method.to_owned()], look, bold: true });
        }
        ends::at_right(chart.canvas, &chart.frame, &labels);
    }

    fn markers(&self, chart: &Chart<'_>) {
        let mut taken = Taken::default();
        let methods = self.methods();
        let look = |point: &Point| {
            look::of_several(methods.iter().position(|method| *method == point.method).unwrap_or(0))
        };
        for point in &self.points {
            let place = self.place(point);
            let errors = point.errors.first().map(|error| error.interval);
            let across = errors.map(|of| [of.low, of.high].map(|error| [self.shown(error), place[1]]));
            let up = [point.cost.low, point.cost.high].map(|cost| [place[0], cost]);
            across.iter().chain([&up]).for_each(|ends| {
                chart.line(ends, &WHISKER);
            });
        }
        for point in &self.points {
            let at = chart.px(self.place(point));
            let size_px = if point.is_default { 6.5 } else { 4.2 };
            chart.canvas.marker(at, &look(point), size_px, point.is_default);
            taken.marker(at);
        }
        // The most important labels are placed first. Points whose labels find no room are listed only in the table on
        // the page.
        let knee = crate::point::knee(&self.trade.points, self.scene, self.trade.resolution());
        let is_knee = |point: &Point| knee.is_some_and(|knee| std::ptr::eq(knee, point));
        let mut points = self.points.clone();
        points.sort_by_key(|point| (!point.is_default, !is_knee(point), !point.on_front));
        for point in points {
            let text = match (point.is_default, is_knee(point)) {
                (true, true) => format!("{}: shipped, the knee", point.value),
                (true, false) => format!("{}: shipped", point.value),
                (false, true) => format!("{}: knee", point.value),
                (false, false) => point.value.clone(),
            };
            let text = if point.value.is_empty() { point.knob.clone() + &text } else { text };
            let letters = if point.is_default || is_knee(point) { BOLD } else { SMALL };
            let at = chart.px(self.place(point));
            if let Some(placed) = taken.label(at, &text, letters, &self.frame) {
                if let Some(label) = placed.led_from {
                    chart.canvas.line(&[at, label], &LEADER);
                }
                chart.canvas.text_on_white(placed.place, &text, placed.side, letters);
            }
        }
    }
}
