//! Measured points: a setting's error and cost, and the settings that no other beats.

use headrace_geometry::math;
use serde::{Deserialize, Serialize};

/// A figure with the bounds of its spread.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Interval {
    /// Lower bound.
    pub low: f64,
    /// The figure itself.
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
    /// The interval lies between two values equally far from the least and the largest rank, the innermost with that
    /// probability of covering the true median. For fewer than six values it is the least and the largest, which cover
    /// the median with less probability.
    pub fn median(values: &[f64]) -> Option<Self> {
        let mut sorted = values.to_vec();
        sorted.sort_unstable_by(f64::total_cmp);
        let count = i32::try_from(sorted.len()).ok()?;
        // Probability that at most `below` of all values lie under the median: that of a fair coin.
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

    /// Converts to another unit; `factor` is the number of new units per old unit.
    #[must_use]
    pub fn scaled(self, factor: f64) -> Self {
        Self { low: self.low * factor, middle: self.middle * factor, high: self.high * factor }
    }
}

/// Interpolated quantile, with `share` from 0 to 1; `None` without values.
pub fn quantile(values: &[f64], share: f64) -> Option<f64> {
    let mut sorted = values.to_vec();
    sorted.sort_unstable_by(f64::total_cmp);
    let rank = share.clamp(0.0, 1.0) * (sorted.len().checked_sub(1)? as f64);
    let below = usize::try_from(math::floor_to_i64(rank)).ok()?;
    let (from, part) = (*sorted.get(below)?, rank - below as f64);
    // Equal or infinite neighbours are not subtracted.
    match sorted.get(below + 1) {
        Some(to) if part > 0.0 && *to > from => Some(from + part * (to - from)),
        _ => Some(from),
    }
}

/// 97.5 % quantile of Student's distribution. Source: its tables, three decimals.
fn student(freedom: usize) -> f64 {
    const UP_TO_30: [f64; 30] = [
        12.706, 4.303, 3.182, 2.776, 2.571, 2.447, 2.365, 2.306, 2.262, 2.228, 2.201, 2.179, 2.160, 2.145,
        2.131, 2.120, 2.110, 2.101, 2.093, 2.086, 2.080, 2.074, 2.069, 2.064, 2.060, 2.056, 2.052, 2.048,
        2.045, 2.042,
    ];
    UP_TO_30.get(freedom.max(1) - 1).copied().unwrap_or(1.96)
}

/// One of a point's errors; always finite.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Error {
    /// Name of the wrong quantity, as a table heading.
    pub name: String,
    /// Its unit.
    pub unit: String,
    /// Size of the error.
    pub interval: Interval,
}

/// A measured setting.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Point {
    /// Method: the line in the chart that this marker belongs to.
    pub method: String,
    /// The setting's name.
    pub knob: String,
    /// Its value, with its unit.
    pub value: String,
    /// The value as a number, if it is one.
    pub number: Option<f64>,
    /// Whether this is the shipped setting of headrace.
    pub is_default: bool,
    /// The dived scene. Points of different scenes aren't compared, and each scene has its own chart.
    pub scene: String,
    /// Number of seeds; each gives one dive.
    pub seeds: u32,
    /// Its errors; the first one is shown on the axis.
    pub errors: Vec<Error>,
    /// Its cost in the unit of the trade's axis: median, with the bounds that `Results::bars` explains.
    pub cost: Interval,
    /// Counted instructions per unit of `cost`; `None` if they can't be counted.
    pub instructions: Option<f64>,
    /// Whether no other point beats it ([`front`]).
    pub on_front: bool,
}

impl Error {
    /// An error by its name and unit.
    pub fn new(name: &str, unit: &str, interval: Interval) -> Self {
        Self { name: name.to_owned(), unit: unit.to_owned(), interval }
    }

    /// Name and unit.
    fn heading(&self) -> String {
        format!("{}, {}", self.name, self.unit)
    }
}

impl Point {
    /// The error shown on the axis: the middle of the first one, infinite without any.
    pub fn error(&self) -> f64 {
        self.errors.first().map_or(f64::INFINITY, |error| error.interval.middle)
    }

    /// A figure by its name and unit, as [`Trade::figures`] lists them.
    pub(crate) fn figure(&self, named: &str) -> Option<Interval> {
        self.errors.iter().find(|error| error.heading() == named).map(|error| error.interval)
    }
}

/// A setting that isn't measured.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct LeftOut {
    /// The setting.
    pub what: String,
    /// The reason.
    pub why: String,
}

/// Error of the reference itself.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct OracleError {
    /// How it was found: the two references compared, and the place.
    pub how: String,
    /// Largest difference, in the unit of the trade's first error.
    pub size: f64,
}

/// An answered question of the kind "what does more of this cost".
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Trade {
    /// Its name in `--only` and in names of files.
    pub name: String,
    /// Its heading.
    pub title: String,
    /// The question.
    pub question: String,
    /// Name and unit of the axis to the right.
    pub error_axis: String,
    /// Name and unit of the axis upwards.
    pub cost_axis: String,
    /// Unit of the cost, as in a sentence: "ns a return".
    pub cost_unit: String,
    /// Whether cost is computed rather than measured, so that it doesn't differ from run to run.
    pub cost_is_computed: bool,
    /// The error below which accuracy decides nothing: a tenth of the target, or the speed margin of the advice.
    pub decides: Option<f64>,
    /// Measured points.
    pub points: Vec<Point>,
    /// Settings that weren't measured, or failed.
    pub left_out: Vec<LeftOut>,
    /// The reference's own error.
    pub oracle: OracleError,
    /// For each default that another setting beats, a sentence that explains why it stays.
    pub reasons: Vec<String>,
    /// The conclusion, with a number.
    pub advice: String,
}

impl Trade {
    /// Unit of the axis to the right.
    pub(crate) fn error_unit(&self) -> &str {
        self.error_axis.rsplit(", ").next().unwrap_or_default()
    }

    /// Largest difference of the error that decides nothing, in the unit of the error.
    ///
    /// It is a tenth of the deciding error, and at least the reference's own error.
    pub fn resolution(&self) -> f64 {
        self.oracle.size.max(self.decides.map_or(0.0, |decides| decides / 10.0))
    }

    /// Names and units of all figures of its points, in the order of first appearance.
    pub(crate) fn figures(&self) -> Vec<String> {
        let mut figures: Vec<String> = Vec::new();
        for heading in self.points.iter().flat_map(|point| &point.errors).map(Error::heading) {
            if !figures.contains(&heading) {
                figures.push(heading);
            }
        }
        figures
    }

    /// Scenes in the order of their first points.
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

/// A table beside the trades: costs of things that aren't a choice.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Given {
    /// Its heading.
    pub title: String,
    /// Explanation, one paragraph.
    pub text: String,
    /// Headings of its columns.
    pub columns: Vec<String>,
    /// Its rows.
    pub rows: Vec<Vec<String>>,
}

/// Marks the points that no other point of their scene beats.
///
/// A point beats another if it is no worse in error and cost, and clearly better in one. Clearly better means an error
/// smaller by more than `resolution`, or a cost whose upper bound is below the other's lower bound. Noise in the costs
/// of equal settings therefore beats neither.
pub fn front(points: &mut [Point], resolution: f64) {
    let beats = |one: &Point, other: &Point| {
        let (error, others) = (one.error(), other.error());
        let is_cheaper = one.cost.high < other.cost.low;
        one.scene == other.scene
            && error <= others + resolution
            && one.cost.middle <= other.cost.middle
            && (error < others - resolution || is_cheaper)
    };
    let on_front: Vec<bool> =
        points.iter().map(|point| !points.iter().any(|other| beats(other, point))).collect();
    for (point, on_front) in points.iter_mut().zip(on_front) {
        point.on_front = on_front;
    }
}

/// The knee of a scene's front: the point farthest below the straight line between the front's ends, on logarithmic
/// axes.
///
/// Errors below `resolution` count as `resolution`, and of those only the cheapest is on the front. `None` if fewer
/// than three points remain, or none lies below the line.
pub fn knee<'a>(points: &'a [Point], scene: &str, resolution: f64) -> Option<&'a Point> {
    let told = |point: &Point| point.error().max(resolution);
    let mut on_front: Vec<(&Point, [f64; 2])> = points
        .iter()
        .filter(|point| point.on_front && point.scene == scene)
        .filter(|point| told(point) > 0.0 && told(point).is_finite() && point.cost.middle > 0.0)
        .map(|point| (point, [math::ln(told(point)), math::ln(point.cost.middle)]))
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
    fn slow_method_is_off_the_front() {
        let mut points = [
            point("fine", 0.01, [9.0, 10.0, 11.0]),
            point("fine but slow", 0.01, [90.0, 100.0, 110.0]),
            point("coarse", 0.1, [4.0, 5.0, 6.0]),
            point("coarse and slow", 0.2, [19.0, 20.0, 21.0]),
        ];
        assert_eq!(on_front(&mut points), ["fine", "coarse"]);
    }

    #[test]
    fn noise_of_equal_settings_beats_neither() {
        let mut points = [point("a", 0.01, [9.0, 10.0, 11.0]), point("b", 0.01, [9.5, 10.4, 11.5])];
        assert_eq!(on_front(&mut points), ["a", "b"]);
    }

    #[test]
    fn points_of_other_scenes_beat_nothing() {
        let mut elsewhere = point("there", 0.001, [1.0; 3]);
        elsewhere.scene = "elsewhere".to_owned();
        assert_eq!(on_front(&mut [point("here", 0.01, [9.0; 3]), elsewhere]), ["here", "there"]);
    }

    #[test]
    fn the_knee_lies_farthest_below_the_line_between_the_ends() {
        let mut points = [
            point("finest", 0.001, [1000.0; 3]),
            point("knee", 0.01, [20.0; 3]),
            point("near the line", 0.1, [15.0; 3]),
            point("coarsest", 1.0, [10.0; 3]),
        ];
        front(&mut points, 0.0);
        assert_eq!(knee(&points, "s", 0.0).map(|point| point.value.as_str()), Some("knee"));
        assert!(knee(&points[..2], "s", 0.0).is_none() && knee(&points, "another", 0.0).is_none());
        // Finest and knee then have the same error, and the cheaper one becomes an end of the front.
        assert_eq!(knee(&points, "s", 0.02).map(|point| point.value.as_str()), Some("near the line"));
        assert!(knee(&points, "s", 0.2).is_none());
    }

    #[test]
    fn spreads_match_published_tables() {
        let values = [4.0, 1.0, 3.0, 2.0, 5.0];
        assert_eq!(Interval::quartiles(&values), Some(Interval { low: 2.0, middle: 3.0, high: 4.0 }));
        // Mean 3, variance 2.5; t of four degrees of freedom is 2.776.
        let mean = Interval::mean(&values).unwrap();
        assert!((mean.middle - 3.0).abs() < 1e-12 && (mean.high - 4.963).abs() < 1e-3, "{mean:?}");
        assert_eq!(Interval::mean(&[1.0]), None);
        assert_eq!(quantile(&[], 0.5), None);
    }

    /// Ranks of the sign test at 5 %, from tables (Conover, "Practical nonparametric statistics", A3): the first and
    /// the last of 6 to 8 values, the second of 9 to 11, the third of 12 to 14, the sixth of 20.
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
