//! A chart: a frame with two axes, and the mapping from values to pixels.

use headrace_geometry::math;

use super::canvas::{BOLD, Canvas, Letters, NORMAL, SMALL, Side};
use super::look::{AXIS, BLACK, Colour, GRID, Look};
use super::polyline::{Frame, Px};

/// Smallest ratio between the ends of a logarithmic axis at which it has logarithmic ticks. An axis with a smaller
/// ratio has linear ticks.
const SHORT: f64 = 4.0;
/// Length of an axis's tick mark, pixels.
const TICK_PX: f64 = 4.0;
const NUMBER: Letters = Letters { colour: BLACK, ..SMALL };

/// The range of an axis, and whether it is logarithmic.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Scale {
    from: f64,
    to: f64,
    logarithmic: bool,
}

impl Scale {
    /// Position of a value on the axis: 0 at the beginning, 1 at the end.
    fn share(&self, value: f64) -> f64 {
        if self.logarithmic {
            math::ln(value / self.from) / math::ln(self.to / self.from)
        } else {
            (value - self.from) / (self.to - self.from)
        }
    }
}

/// An axis: name, range and ticks.
#[derive(Debug, Clone)]
#[must_use]
pub struct Axis {
    scale: Scale,
    /// Value and text of each tick.
    ticks: Vec<(f64, String)>,
    name: String,
    /// Distance from the axis to its name, pixels.
    name_px: f64,
    numbered: bool,
}

impl Axis {
    /// A linear axis. Its ticks divide it into at most `most_ticks` steps.
    pub fn new(name: &str, from: f64, to: f64, most_ticks: u32) -> Self {
        let (ticks, digits) = ticks(from, to, most_ticks);
        let ticks = ticks.into_iter().map(|tick| (tick, format!("{tick:.digits$}"))).collect();
        let scale = Scale { from, to, logarithmic: false };
        Self { scale, ticks, name: name.to_owned(), name_px: 36.0, numbered: true }
    }

    /// A logarithmic axis with at most `most_ticks` ticks; both ends must be above zero.
    ///
    /// Ticks are powers of ten and, if they fit, also 2 and 5 times or 3 times each power. A short axis gets linear
    /// ticks instead.
    pub fn logarithmic(name: &str, from: f64, to: f64, most_ticks: u32) -> Self {
        let scale = Scale { from, to, logarithmic: true };
        if to / from < SHORT {
            return Self { scale, ..Self::new(name, from, to, most_ticks) };
        }
        let ticks = log_ticks(from, to, most_ticks).into_iter().map(|tick| (tick, tidy(tick))).collect();
        Self { scale, ticks, name: name.to_owned(), name_px: 36.0, numbered: true }
    }

    /// Sets the distance from the axis to its name, pixels.
    pub fn with_name_at(self, name_px: f64) -> Self {
        Self { name_px, ..self }
    }

    /// Removes the axis's name and numbers, for a chart beside another chart that already shows them.
    pub fn bare(self) -> Self {
        Self { name: String::new(), numbered: false, ..self }
    }
}

/// Returns round numbers within a range, and the number of decimals that they need.
fn ticks(from: f64, to: f64, most: u32) -> (Vec<f64>, usize) {
    const DECADES: [(f64, usize); 10] = [
        (1e-4, 4),
        (1e-3, 3),
        (1e-2, 2),
        (0.1, 1),
        (1.0, 0),
        (10.0, 0),
        (100.0, 0),
        (1e3, 0),
        (1e4, 0),
        (1e5, 0),
    ];
    let steps = DECADES.iter().flat_map(|(decade, digits)| {
        [1.0, 2.0, 5.0].into_iter().map(move |factor| (factor * decade, *digits))
    });
    let wide_enough = |(step, _): &(f64, usize)| (to - from) / step <= f64::from(most);
    let Some((step, digits)) = steps.into_iter().find(wide_enough) else { return (Vec::new(), 0) };
    let first = (from / step - 1e-9).ceil();
    let tick = |k: u32| step * (first + f64::from(k));
    ((0..=most).map(tick).filter(|tick| *tick <= to + 1e-9 * step).collect(), digits)
}

/// Returns at most `most` ticks within a range, for a logarithmic axis. The first of these sets that fits is used:
/// - 1, 2 and 5 times each power of ten;
/// - 1 and 3 times each power of ten;
/// - every n-th power of ten, with the smallest n that fits.
fn log_ticks(from: f64, to: f64, most: u32) -> Vec<f64> {
    let within = |factors: &[f64]| -> Vec<f64> {
        let decades =
            (-15..=15_i32).map(|power| if power < 0 { 1.0 / ten_to(-power) } else { ten_to(power) });
        let ticks = decades.flat_map(|decade| factors.iter().map(move |factor| factor * decade));
        ticks.filter(|tick| (from * (1.0 - 1e-9)..=to * (1.0 + 1e-9)).contains(tick)).collect()
    };
    let fitting = [&[1.0, 2.0, 5.0][..], &[1.0, 3.0]].into_iter().map(within);
    let fitting = fitting.into_iter().find(|ticks| ticks.len() <= usize::try_from(most).unwrap_or(0));
    fitting.unwrap_or_else(|| {
        let powers = within(&[1.0]);
        let every = powers.len().div_ceil(usize::try_from(most).unwrap_or(1).max(1));
        powers.into_iter().step_by(every.max(1)).collect()
    })
}

fn ten_to(power: i32) -> f64 {
    (0..power).map(|_| 10.0).product()
}

/// Formats the number of a logarithmic tick as briefly as possible.
fn tidy(tick: f64) -> String {
    if (1e-4..1e6).contains(&tick) {
        let text = format!("{tick:.4}");
        text.trim_end_matches('0').trim_end_matches('.').to_owned()
    } else {
        format!("{tick:.0e}")
    }
}

/// Formats a number with about three significant digits.
pub fn short(value: f64) -> String {
    match value.abs() {
        size if size < 0.0995 => format!("{value:.3}"),
        size if size < 9.995 => format!("{value:.2}"),
        size if size < 99.95 => format!("{value:.1}"),
        _ => format!("{value:.0}"),
    }
}

/// A chart drawn on a canvas.
pub struct Chart<'c> {
    /// The canvas with the chart.
    pub canvas: &'c Canvas,
    /// Position of the plot area on the sheet.
    pub frame: Frame,
    x: Scale,
    y: Scale,
}

impl<'c> Chart<'c> {
    /// Draws the grid and both axes of a chart.
    pub fn new(canvas: &'c Canvas, frame: Frame, x: &Axis, y: &Axis) -> Self {
        let chart = Self { canvas, frame, x: x.scale, y: y.scale };
        let Frame { left, top, right, bottom } = frame;
        for (tick, words) in &x.ticks {
            let [at, _] = chart.px([*tick, y.scale.from]);
            canvas.line(&[[at, top], [at, bottom]], &GRID);
            canvas.line(&[[at, bottom], [at, bottom + TICK_PX]], &AXIS);
            if x.numbered {
                canvas.text([at, bottom + 14.0], words, Side::Middle, NUMBER);
            }
        }
        for (tick, words) in &y.ticks {
            let [_, at] = chart.px([x.scale.from, *tick]);
            canvas.line(&[[left, at], [right, at]], &GRID);
            canvas.line(&[[left - TICK_PX, at], [left, at]], &AXIS);
            if y.numbered {
                canvas.text([left - 8.0, at], words, Side::Left, NUMBER);
            }
        }
        canvas.line(&[[left, top], [left, bottom], [right, bottom]], &AXIS);
        let middle = [f64::midpoint(left, right), f64::midpoint(top, bottom)];
        if x.numbered {
            canvas.text([middle[0], bottom + x.name_px], &x.name, Side::Middle, NORMAL);
        }
        if y.numbered {
            canvas.text(
                [left - y.name_px - 8.0, middle[1]],
                &y.name,
                Side::Middle,
                Letters { upright: true, ..NORMAL },
            );
        }
        chart
    }

    /// Position on the sheet of a point given in the chart's values.
    pub fn px(&self, [x, y]: [f64; 2]) -> Px {
        let Frame { left, top, right, bottom } = self.frame;
        [left + self.x.share(x) * (right - left), bottom - self.y.share(y) * (bottom - top)]
    }

    /// Draws the line through these points, clipped to the frame. Returns the pieces of the line on the sheet.
    pub fn line(&self, points: &[[f64; 2]], look: &Look) -> Vec<Vec<Px>> {
        let places: Vec<Px> = points.iter().map(|point| self.px(*point)).collect();
        let pieces = self.frame.cut(&places);
        for piece in &pieces {
            self.canvas.line(piece, look);
        }
        pieces
    }

    /// Draws a horizontal line across the chart at a value of y.
    pub fn across(&self, y: f64, look: &Look) {
        self.line(&[[self.x.from, y], [self.x.to, y]], look);
    }

    /// Draws a vertical line across the chart at a value of x.
    pub fn upright(&self, x: f64, look: &Look) {
        self.line(&[[x, self.y.from], [x, self.y.to]], look);
    }

    /// Draws an ellipse about a position on the sheet, clipped to the frame.
    pub fn ellipse(&self, centre: Px, radii: Px, ground: Colour, look: &Look) {
        /// Number of corners of the polygon that approximates the ellipse.
        const CORNERS: u32 = 72;
        let Frame { left, top, right, bottom } = self.frame;
        let corner = |k: u32| {
            let (sine, cosine) = math::sin_cos(math::TAU * f64::from(k) / f64::from(CORNERS));
            [centre[0] + radii[0] * cosine, centre[1] + radii[1] * sine]
        };
        let corners: Vec<Px> = (0..=CORNERS).map(corner).collect();
        let within: Vec<Px> =
            corners.iter().map(|[x, y]| [x.clamp(left, right), y.clamp(top, bottom)]).collect();
        self.canvas.polygon(&within, ground);
        for piece in self.frame.cut(&corners) {
            self.canvas.line(&piece, look);
        }
    }

    /// Writes text in the middle of the frame, in place of a curve that can't be drawn.
    pub fn instead(&self, lines: &[String]) {
        let Frame { left, top, right, bottom } = self.frame;
        let first = f64::midpoint(top, bottom) - 10.0 * (lines.len() as f64 - 1.0);
        for (k, line) in lines.iter().enumerate() {
            let place = [f64::midpoint(left, right), first + 20.0 * k as f64];
            self.canvas.text_on_white(place, line, Side::Middle, BOLD);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn axis_ticks_are_round_numbers_within_the_range() {
        assert_eq!(ticks(0.0, 35.9, 10), (vec![0.0, 5.0, 10.0, 15.0, 20.0, 25.0, 30.0, 35.0], 0));
        let (fine, digits) = ticks(0.0, 0.13, 7);
        assert_eq!((fine.len(), digits), (7, 2));
        assert_eq!(ticks(-0.5, 0.5, 5).0, [-0.4, -0.2, 0.0, 0.2, 0.4]);
        for (from, to) in [(0.0, 1e-3), (3.0, 4.0), (0.0, 9e4)] {
            let (ticks, _) = ticks(from, to, 8);
            assert!(ticks.len() >= 3 && ticks.iter().all(|tick| (from..=to).contains(tick)), "{ticks:?}");
        }
    }

    #[test]
    fn logarithmic_ticks_are_round_numbers() {
        assert_eq!(log_ticks(0.01, 1.0, 8), [0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0]);
        assert_eq!(log_ticks(1e-9, 1.0, 8), [1e-9, 1e-7, 1e-5, 1e-3, 0.1]);
        let words: Vec<String> = [1e-9, 1e-4, 0.05, 1.0, 2e6].map(tidy).into();
        assert_eq!(words, ["1e-9", "0.0001", "0.05", "1", "2e6"]);
    }

    #[test]
    fn equal_ratios_have_equal_lengths_on_a_logarithmic_axis() {
        let scale = Scale { from: 1e-3, to: 1.0, logarithmic: true };
        for (value, share) in [(1e-3, 0.0), (1e-2, 1.0 / 3.0), (0.1, 2.0 / 3.0), (1.0, 1.0)] {
            assert!((scale.share(value) - share).abs() < 1e-12, "{value}");
        }
    }

    #[test]
    fn numbers_have_about_three_significant_digits() {
        for (value, text) in [(0.0641, "0.064"), (0.5, "0.50"), (16.94, "16.9"), (121.04, "121")] {
            assert_eq!(short(value), text);
        }
    }
}
