//! Measured points: each setting's error and cost, and the settings that no other setting beats.

use headrace_geometry::math;
use serde::{Deserialize, Serialize};

/// A figure with the bounds of its spread.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Interval {
    /// Lower bound.
    pub low: f64,
    /// The figure, between its bounds.
    pub middle: f64,
    /// Upper bound.
    pub high: f64,
}

impl Interval {
    /// A figure without spread.
    pub fn exact(value: f64) -> Self {
        Self { low: value, middle: value, high: value }
    }

    /// Median with its 95 % interval by the sign test; `None` without values.
    ///
    /// The rank of the lower bound is as far from the first as the rank of the upper bound is from the last. The bounds
    /// are the innermost pair that covers the true median with a probability of at least 95 %. For fewer than six
    /// values, the bounds are the least and the largest value, which cover the median with a smaller probability.
    pub fn median(values: &[f64]) -> Option<Self> {
        let mut sorted = values.to_vec();
        sorted.sort_unstable_by(f64::total_cmp);
        let count = i32::try_from(sorted.len()).ok()?;
        // Probability that at most `below` of all values lie under the median. Each value lies under the median with
        // probability one half.
        let (mut ways, mut below, mut cut) = (1.0, 1.0, 0_usize);
        let all = (0..count).fold(1.0, |all, _| all * 2.0);
        for k in 1..=count / 2 {
            if below / all > 0.025 {
                break;
            }
            cut = usize::try_from(k).ok()?;
            ways *= f64::from(count - k + 1) / f64::from(k);
            below += ways;
        }
        let cut = cut.max(1) - 1;
        Some(Self {
            low: *sorted.get(cut)?,
            middle: quantile(values, 0.5)?,
            high: *sorted.get(sorted.len().checked_sub(cut + 1)?)?,
        })
    }

    /// Median and quartiles, interpolated between ranks; `None` without values.
    pub fn quartiles(values: &[f64]) -> Option<Self> {
        Some(Self {
            low: quantile(values, 0.25)?,
            middle: quantile(values, 0.5)?,
            high: quantile(values, 0.75)?,
        })
    }

    /// Mean with its 95 % confidence interval by Student's t; `None` for fewer than two values.
    pub fn mean(values: &[f64]) -> Option<Self> {
        if values.len() < 2 {
            return None;
        }
        let n = values.len() as f64;
        let middle = values.iter().sum::<f64>() / n;
        let variance =
            values.iter().map(|value| (value - middle) * (value - middle)).sum::<f64>() / (n - 1.0);
        let half = student(values.len() - 1) * math::sqrt(variance / n);
        Some(Self { low: middle - half, middle, high: middle + half })
    }

    /// Converts the interval to another unit; `factor` is the number of new units per old unit.
    #[must_use]
    pub fn scaled(self, factor: f64) -> Self {
        Self { low: self.low * factor, middle: self.middle * factor, high: self.high * factor }
    }
}

/// Interpolated quantile at `share`, from 0 to 1; `None` without values.
pub fn quantile(values: &[f64], share: f64) -> Option<f64> {
    let mut sorted = values.to_vec();
    sorted.sort_unstable_by(f64::total_cmp);
    let rank = share.clamp(0.0, 1.0) * (sorted.len().checked_sub(1)? as f64);
    let below = usize::try_from(math::floor_to_i64(rank)).ok()?;
    let (from, part) = (*sorted.get(below)?, rank - below as f64);
    // Equal or infinite neighbours are returned without interpolation, because infinity minus infinity is NaN.
    match sorted.get(below + 1) {
        Some(to) if part > 0.0 && *to > from => Some(from + part * (to - from)),
        _ => Some(from),
    }
}

/// 97.5 % quantile of Student's t distribution. Source: published tables, three decimals.
fn student(freedom: usize) -> f64 {
    const UP_TO_30: [f64; 30] = [
        12.706, 4.303, 3.182, 2.776, 2.571, 2.447, 2.365, 2.306, 2.262, 2.228, 2.201, 2.179, 2.160, 2.145,
        2.131, 2.120, 2.110, 2.101, 2.093, 2.086, 2.080, 2.074, 2.069, 2.064, 2.060, 2.056, 2.052, 2.048,
        2.045, 2.042,
    ];
    UP_TO_30.get(freedom.max(1) - 1).copied().unwrap_or(1.96)
}

/// One of a point's errors. The values are always finite.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Error {
    /// Name of the quantity that is in error, as a table heading.
    pub name: String,
    /// Unit of the quantity.
    pub unit: String,
    /// Size of the error.
    pub interval: Interval,
}

/// A measured setting.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Point {
    /// Method of the setting. The chart draws the points of a method as one line.
    pub method: String,
    /// Name of the varied parameter.
    pub knob: String,
    /// Value of the setting, with its unit.
    pub value: String,
    /// The value as a number, if the value is numeric.
    pub number: Option<f64>,
    /// Whether the setting is headrace's shipped one.
    pub is_default: bool,
    /// Scene of the dives. Each scene has its own chart, and points of different scenes are not compared.
    pub scene: String,
    /// Number of seeds; each gives one dive.
    pub seeds: u32,
    /// Errors of the setting; the axis shows the first one.
    pub errors: Vec<Error>,
    /// Cost in the unit of the trade's axis: the median, with bounds as described by `Results::bars`.
    pub cost: Interval,
    /// Counted instructions per unit of `cost`; `None` if instructions can't be counted.
    pub instructions: Option<f64>,
    /// Whether no other point beats this one ([`front`]).
    pub on_front: bool,
}

impl Error {
    /// Creates an error from its name, unit and interval.
    pub fn new(name: &str, unit: &str, interval: Interval) -> Self {
        Self { name: name.to_owned(), unit: unit.to_owned(), interval }
    }

    /// Name and unit as text.
    fn heading(&self) -> String {
        format!("{}, {}", self.name, self.unit)
    }
}

impl Point {
    /// The error shown on the axis: the middle value of the first error; infinite if there are no errors.
    pub fn error(&self) -> f64 {
        self.errors.first().map_or(f64::INFINITY, |error| error.interval.middle)
    }

    /// Finds an error by its name and unit, as listed by [`Trade::figures`].
    pub(crate) fn figure(&self, named: &str) -> Option<Interval> {
        self.errors.iter().find(|error| error.heading() == named).map(|error| error.interval)
    }
}

/// A setting without a measurement.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct LeftOut {
    /// The setting that was not measured.
    pub what: String,
    /// The reason for which the setting was not measured.
    pub why: String,
}

/// Error of the reference itself.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct OracleError {
    /// Method by which the error was found: the two references compared, and the place.
    pub how: String,
    /// Largest difference, in the unit of the trade's first error.
    pub size: f64,
}

/// A trade: a question such as "what does a finer target cost", with measured points and an answer.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Trade {
    /// Name of the trade in `--only` and in file names.
    pub name: String,
    /// Heading of the trade.
    pub title: String,
    /// The question that the trade answers.
    pub question: String,
    /// Name and unit of the x axis.
    pub error_axis: String,
    /// Name and unit of the y axis.
    pub cost_axis: String,
    /// Unit of the cost, as in a sentence: "ns a return".
    pub cost_unit: String,
    /// Whether the cost is computed rather than measured. A computed cost does not vary from run to run.
    pub cost_is_computed: bool,
    /// The error below which more accuracy changes no decision: a tenth of the target, or the speed margin of the
    /// advice.
    pub decides: Option<f64>,
    /// Measured points.
    pub points: Vec<Point>,
    /// Settings that were not measured, or whose measurement failed.
    pub left_out: Vec<LeftOut>,
    /// The reference's own error.
    pub oracle: OracleError,
    /// For each default that another setting beats, a sentence that explains why the default is kept.
    pub reasons: Vec<String>,
    /// The conclusion of the trade, with at least one number.
    pub advice: String,
}

impl Trade {
    /// Unit of the x axis.
    pub(crate) fn error_unit(&self) -> &str {
        self.error_axis.rsplit(", ").next().unwrap_or_default()
    }

    /// Largest difference of two errors that count as equal, in the unit of the error.
    ///
    /// This is a tenth of `decides`, and at least the reference's own error.
    pub fn resolution(&self) -> f64 {
        self.oracle.size.max(self.decides.map_or(0.0, |decides| decides / 10.0))
    }

    /// Names and units of all figures of the points, in the order of first appearance.
    pub(crate) fn figures(&self) -> Vec<String> {
        let mut figures: Vec<String> = Vec::new();
        for heading in self.points.iter().flat_map(|point| &point.errors).map(Error::heading) {
            if !figures.contains(&heading) {
                figures.push(heading);
            }
        }
        figures
    }

    /// Scenes, in the order of their first points.
    pub fn scenes(&self) -> Vec<&str> {
        let mut scenes: Vec<&str> = Vec::new();
        for point in &self.points {
            if !scenes.contains(&point.scene.as_str()) {
                scenes.push(&point.scene);
            }
        }
        scenes
    }
}

/// A table shown beside the trades: costs of properties that are not a choice.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Given {
    /// Heading of the table.
    pub title: String,
    /// Explanation of the table, one paragraph.
    pub text: String,
    /// Headings of the columns.
    pub columns: Vec<String>,
    /// Rows of the table.
    pub rows: Vec<Vec<String>>,
}

/// Marks the points of the front: points that no other point of their scene beats.
///
/// A point beats another point if its error and cost are no worse and one of them is clearly better. An error is
/// clearly better if it is smaller by more than `resolution`. A cost is clearly better if its upper bound is below the
/// lower bound of the other point's cost. Noise in the costs of equal settings therefore removes no point from the
/// front.
pub fn front(points: &mut [Point], resolution: f64) {
    let is_better = |one: &Point, other: &Point| {
        let (error, others) = (one.error(), other.error());
        let is_cheaper = one.cost.high < other.cost.low;
        one.scene == other.scene
            && error <= others + resolution
            && one.cost.middle <= other.cost.middle
            && (error < others - resolution || is_cheaper)
    };
    let on_front: Vec<bool> =
        points.iter().map(|point| !points.iter().any(|other| is_better(other, point))).collect();
    for (point, on_front) in points.iter_mut().zip(on_front) {
        point.on_front = on_front;
    }
}

/// The knee of a scene's front: the point farthest below the straight line between the front's ends, on logarithmic
/// axes.
///
/// Errors below `resolution` count as `resolution`, and only the cheapest of these points is on the front. `None` if
/// fewer than three points remain, or if no point lies below the line.
pub fn knee<'a>(points: &'a [Point], scene: &str, resolution: f64) -> Option<&'a Point> {
    let error_of = |point: &Point| point.error().max(resolution);
    let mut on_front: Vec<(&Point, [f64; 2])> = points
        .iter()
        .filter(|point| point.on_front && point.scene == scene)
        .filter(|point| error_of(point) > 0.0 && error_of(point).is_finite() && point.cost.middle > 0.0)
        .map(|point| (point, [math::ln(error_of(point)), math::ln(point.cost.middle)]))
        .collect();
    on_front.sort_by(|a, b| a.1[0].total_cmp(&b.1[0]).then(a.1[1].total_cmp(&b.1[1])));
    on_front.dedup_by(|dearer, cheaper| dearer.1[0].to_bits() == cheaper.1[0].to_bits());
    let (from, to) = (on_front.first()?.1, on_front.last()?.1);
    let [along, up] = [to[0] - from[0], to[1] - from[1]];
    let below = |at: [f64; 2]| up * (at[0] - from[0]) - along * (at[1] - from[1]);
    let inner = on_front.get(1..on_front.len().checked_sub(1)?)?;
    let (point, at) = inner.iter().max_by(|a, b| below(a.1).total_cmp(&below(b.1)))?;
    (below(*at) > 0.0).then_some(*point)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn point(value: &str, error: f64, cost: [f64; 3]) -> Point {
        let [low, middle, high] = cost;
        Point {
            method: "m".to_owned(),
            knob: "k".to_owned(),
            value: value.to_owned(),
            number: None,
            is_default: false,
            scene: "s".to_owned(),
            seeds: 1,
            errors: vec![Error::new("e", "m", Interval::exact(error))],
            cost: Interval { low, middle, high },
            instructions: None,
            on_front: false,
        }
    }

    fn on_front(points: &mut [Point]) -> Vec<&str> {
        front(points, 1e-9);
        points.iter().filter(|point| point.on_front).map(|point| point.value.as_str()).collect()
    }

    #[test]
    fn slower_method_without_better_accuracy_is_off_the_pareto_front() {
        let mut points = [
            point("fine", 0.01, [9.0, 10.0, 11.0]),
            point("fine but slow", 0.01, [90.0, 100.0, 110.0]),
            point("coarse", 0.1, [4.0, 5.0, 6.0]),
            point("coarse and slow", 0.2, [19.0, 20.0, 21.0]),
        ];
        assert_eq!(on_front(&mut points), ["fine", "coarse"]);
    }

    #[test]
    fn settings_equal_within_noise_are_both_on_the_pareto_front() {
        let mut points = [point("a", 0.01, [9.0, 10.0, 11.0]), point("b", 0.01, [9.5, 10.4, 11.5])];
        assert_eq!(on_front(&mut points), ["a", "b"]);
    }

    #[test]
    fn points_of_another_scene_are_not_compared() {
        let mut elsewhere = point("there", 0.001, [1.0; 3]);
        elsewhere.scene = "elsewhere".to_owned();
        assert_eq!(on_front(&mut [point("here", 0.01, [9.0; 3]), elsewhere]), ["here", "there"]);
    }

    #[test]
    fn knee_lies_farthest_below_the_line_between_the_ends() {
        let mut points = [
            point("finest", 0.001, [1000.0; 3]),
            point("knee", 0.01, [20.0; 3]),
            point("near the line", 0.1, [15.0; 3]),
            point("coarsest", 1.0, [10.0; 3]),
        ];
        front(&mut points, 0.0);
        assert_eq!(knee(&points, "s", 0.0).map(|point| point.value.as_str()), Some("knee"));
        assert!(knee(&points[..2], "s", 0.0).is_none() && knee(&points, "another", 0.0).is_none());
        // At this resolution the finest point and the knee have equal errors, so the cheaper one becomes an end
        // of the front.
        assert_eq!(knee(&points, "s", 0.02).map(|point| point.value.as_str()), Some("near the line"));
        assert!(knee(&points, "s", 0.2).is_none());
    }

    #[test]
    fn confidence_intervals_match_published_tables() {
        let values = [4.0, 1.0, 3.0, 2.0, 5.0];
        assert_eq!(Interval::quartiles(&values), Some(Interval { low: 2.0, middle: 3.0, high: 4.0 }));
        // The mean is 3 and the variance 2.5; t for four degrees of freedom is 2.776.
        let mean = Interval::mean(&values).unwrap();
        assert!((mean.middle - 3.0).abs() < 1e-12 && (mean.high - 4.963).abs() < 1e-3, "{mean:?}");
        assert_eq!(Interval::mean(&[1.0]), None);
        assert_eq!(quantile(&[], 0.5), None);
    }

    /// Ranks of the sign test at 5 %. For 6 to 8 values, they are the first and the last; for 9 to 11 values, the
    /// second; for 12 to 14, the third; for 20, the sixth. Source: Conover, "Practical nonparametric statistics", table
    /// A3.
    #[test]
    fn median_intervals_match_published_tables() {
        for (count, rank) in [(1, 1), (5, 1), (6, 1), (8, 1), (9, 2), (11, 2), (12, 3), (14, 3), (20, 6)] {
            let values: Vec<f64> = (1..=count).map(f64::from).rev().collect();
            let found = Interval::median(&values).unwrap();
            let [low, high] = [rank, count + 1 - rank].map(f64::from);
            let off = (found.low - low).abs().max((found.high - high).abs());
            assert!(off < 1e-12, "of {count}: {found:?}");
            assert!((found.middle - f64::from(count + 1) / 2.0).abs() < 1e-12);
        }
        assert_eq!(Interval::median(&[]), None);
    }
}
