//! The largest hole of each section of a point cloud on the unrolled wall, by the search used for dives.

use std::sync::Arc;

use arrow_array::{ArrayRef, BooleanArray, Float64Array, RecordBatch};
use headrace_coverage::hole::FARTHEST_M;
use headrace_coverage::{Hole, HoleFinder, SampleStore, StoreError, StoreLayout, WallSample};
use headrace_geometry::math;
use pyo3::{Python, pyfunction};

use crate::arguments::{Coordinates, points, positive};
use crate::errors::Failure;
use crate::table::Table;

/// Edge length of a cell in the sample store, m; the same as in a dive with a target of half a metre.
const CELL_M: f64 = 0.25;
/// Length of the stretch whose points are put into one sample store, m.
///
/// The stretch, with the search radius on either side, is so short that the store packs no sample.
const STRETCH_M: f64 = 32.0;
/// Maximum number of sections per call.
const MAX_SECTIONS: f64 = 4e6;

/// The largest hole of each section, for points on the unrolled wall.
///
/// A hole's diameter is twice the largest distance from a place in the section to the nearest point. Arc lengths are
/// cyclic in `perimeter_m`. Sections are [k L, (k + 1) L) with L = `section_m`. The first section contains `from_m`,
/// the last one `to_m`. These default to the points' first and last chainage.
///
/// Columns: chainage_m and end_m are the start and end of the section. d_m is the diameter D. d_least_m and d_most_m
/// are bounds of D, which differ if the points are too dense to keep every point. d_bounded is false if some place has
/// no point within 12 m; D is then at least d_m, and d_most_m is null. d_x_m and d_arc_m are the hole's centre.
///
/// Raises ValueError for lists of different lengths, a coordinate that isn't finite, no points without bounds, or more
/// than 4,000,000 sections.
#[pyfunction]
#[pyo3(signature = (x_m, arc_m, *, perimeter_m, section_m=0.25, from_m=None, to_m=None))]
#[expect(clippy::needless_pass_by_value, reason = "made for this call")]
pub(crate) fn holes(
    py: Python<'_>,
    x_m: Coordinates,
    arc_m: Coordinates,
    perimeter_m: f64,
    section_m: f64,
    from_m: Option<f64>,
    to_m: Option<f64>,
) -> Result<Table, Failure> {
    let points = points(["x_m", "arc_m"], &x_m, &arc_m)?;
    py.detach(|| {
        let wall = Wall::new(points, perimeter_m, section_m, [from_m, to_m])?;
        table(&wall.holes()?).map(Table::of)
    })
}

/// A point cloud and the sections to search.
struct Wall {
    /// Chainage and arc length of each point, m, in the order of chainage.
    points: Vec<[f64; 2]>,
    perimeter_m: f64,
    section_m: f64,
    /// Number of the first section, and number after the last section.
    sections: [i64; 2],
}

/// Start and end of a section, m, and its hole.
type Found = (f64, f64, Hole);

impl Wall {
    fn new(
        mut points: Vec<[f64; 2]>,
        perimeter_m: f64,
        section_m: f64,
        bounds_m: [Option<f64>; 2],
    ) -> Result<Self, Failure> {
        positive("perimeter_m", perimeter_m)?;
        positive("section_m", section_m)?;
        points.sort_by(|a, b| a[0].total_cmp(&b[0]));
        let ends = [points.first(), points.last()].map(|end| end.map(|point| point[0]));
        let [Some(from_m), Some(to_m)] = [bounds_m[0].or(ends[0]), bounds_m[1].or(ends[1])] else {
            let words = "there are no points; give from_m and to_m for the stretch that they leave empty";
            return Err(Failure::Argument(words.to_owned()));
        };
        let count = (to_m - from_m) / section_m;
        if !(count.is_finite() && (0.0..=MAX_SECTIONS).contains(&count)) {
            return Err(Failure::Argument(format!(
                "from_m {from_m} and to_m {to_m} are {count} sections of {section_m} m; 0 to {MAX_SECTIONS} are possible"
            )));
        }
        let number = |at_m: f64| math::floor_to_i64(at_m / section_m);
        Ok(Self { points, perimeter_m, section_m, sections: [number(from_m), number(to_m) + 1] })
    }

    fn holes(&self) -> Result<Vec<Found>, Failure> {
        let [first, end] = self.sections;
        let per_stretch = math::floor_to_i64(STRETCH_M / self.section_m).max(1);
        let mut found = Vec::new();
        let mut finder = HoleFinder::default();
        let mut from = first;
        while from < end {
            let to = (from + per_stretch).min(end);
            let store = self.store(self.begin_m(from), self.begin_m(to))?;
            for section in from..to {
                let (from_m, to_m) = (self.begin_m(section), self.begin_m(section + 1));
                found.push((from_m, to_m, finder.largest(&store, from_m, to_m)));
            }
            from = to;
        }
        Ok(found)
    }

    fn begin_m(&self, section: i64) -> f64 {
        section as f64 * self.section_m
    }

    /// A store of the points in a stretch, and of the points within the search radius of the stretch.
    fn store(&self, from_m: f64, to_m: f64) -> Result<SampleStore, Failure> {
        let (from_m, to_m) = (from_m - FARTHEST_M, to_m + FARTHEST_M);
        let first = self.points.partition_point(|point| point[0] < from_m);
        let end = self.points.partition_point(|point| point[0] <= to_m);
        let points = self.points.get(first..end).unwrap_or_default();
        let capacity = u32::try_from(points.len().max(1)).map_err(|_| too_many(points.len()))?;
        let layout = StoreLayout { perimeter_m: self.perimeter_m, from_m, to_m, cell_m: CELL_M, capacity };
        let mut store = SampleStore::new(layout);
        for [x_m, arc_m] in points {
            let sample = WallSample { x_m: *x_m, arc_m: *arc_m, head: 0, step_m: None, visit: 0 };
            store.insert(sample).map_err(|error| not_stored(error, points.len()))?;
        }
        Ok(store)
    }
}

fn too_many(points: usize) -> Failure {
    Failure::Argument(format!(
        "{points} points within {STRETCH_M} m of tunnel; at most {} are possible",
        u32::MAX
    ))
}

fn not_stored(error: StoreError, points: usize) -> Failure {
    Failure::Argument(format!("keeping {points} points within {STRETCH_M} m of tunnel: {error}"))
}

fn table(found: &[Found]) -> Result<RecordBatch, Failure> {
    let numbers = |of: fn(&Found) -> Option<f64>| -> ArrayRef {
        Arc::new(found.iter().map(of).collect::<Float64Array>())
    };
    let bounded: BooleanArray = found.iter().map(|(_, _, hole)| Some(hole.bounded)).collect();
    let columns: [(&str, ArrayRef); 8] = [
        ("chainage_m", numbers(|found| Some(found.0))),
        ("end_m", numbers(|found| Some(found.1))),
        ("d_m", numbers(|found| Some(found.2.diameter_m))),
        ("d_least_m", numbers(|found| Some(found.2.least_m))),
        ("d_most_m", numbers(|found| Some(found.2.most_m).filter(|most_m| most_m.is_finite()))),
        ("d_bounded", Arc::new(bounded)),
        ("d_x_m", numbers(|found| Some(found.2.x_m))),
        ("d_arc_m", numbers(|found| Some(found.2.arc_m))),
    ];
    let columns = columns.map(|(name, column)| (name, column, true));
    RecordBatch::try_from_iter_with_nullable(columns)
        .map_err(|error| Failure::Argument(format!("making the table of holes: {error}")))
}
