//! The nearest pass: the place nearest to a point where a head crosses the point's arc length.

use core::ops::Range;

use super::open::Node;
use super::sample_store::SampleStore;
use headrace_geometry::math;
use headrace_geometry::tunnel::WallPoint;

/// Point from which a pass search looks for the nearest pass.
#[derive(Debug, Clone, Copy)]
struct Place {
    x_m: f64,
    /// Arc length of the point in [0, perimeter), m.
    arc_m: f64,
    perimeter_m: f64,
}

impl Place {
    /// Returns how far away in chainage a sample's step crosses the arc length of this point, m.
    ///
    /// `None` if the step does not cross it.
    fn to_crossing_m(self, end: &Node) -> Option<f64> {
        let [along_m, around_m] = end.step_m;
        let mut to_end = end.arc_m - self.arc_m;
        if to_end >= self.perimeter_m / 2.0 {
            to_end -= self.perimeter_m;
        } else if to_end < -self.perimeter_m / 2.0 {
            to_end += self.perimeter_m;
        }
        let to_start = to_end - around_m;
        // A step that only starts at the arc length does not count, because the previous step ends there and counts.
        let crosses = (to_start < 0.0 && to_end >= 0.0) || (to_start > 0.0 && to_end <= 0.0);
        crosses.then(|| (end.x_m - along_m * (to_end / around_m) - self.x_m).abs())
    }
}

/// State of a pass search on one side of the query point.
///
/// `brick` is the number of the brick that the search has reached. A brick is a group of rows of cells.
#[derive(Debug, Clone, Copy, Default)]
struct Side {
    brick: Option<u32>,
    slot: usize,
    /// Bitmask of the brick's rows in which a pass may be.
    rows: u32,
}

impl SampleStore {
    /// Returns the distance in chainage to the nearest pass over a point's arc length within `within_m`, m.
    ///
    /// A pass is a single step of a head from one sample to the next. Its chainage at this arc length is interpolated.
    /// If a packed brick has to be opened, the distance is accurate to some micrometres. Source:
    /// docs/reference/glossary.md, "Spacing and holes", T_x.
    ///
    /// Allocates: never.
    pub fn nearest_pass_m(&mut self, of: WallPoint, within_m: f64) -> Option<f64> {
        let WallPoint { x_m, arc_m } = of;
        let perimeter_m = self.layout.perimeter_m;
        let place = Place { x_m, arc_m: math::wrap(arc_m, perimeter_m), perimeter_m };
        let centre = math::floor_to_i64((x_m - self.layout.from_m) / self.layout.cell_m);
        let into_row = (x_m - self.layout.from_m) - centre as f64 * self.layout.cell_m;
        let inner = into_row.min(self.layout.cell_m - into_row).max(0.0);
        // The end of a step is at most one step length away from its crossing with the arc length.
        let [along_m, around_m] = self.longest_step_m;
        let left = math::floor_to_i64((place.arc_m - around_m) / self.column_m);
        let right = math::floor_to_i64((place.arc_m + around_m) / self.column_m);
        let columns = left..(right + 1).min(left + self.columns);
        let mut best: Option<f64> = None;
        let mut sides = [Side::default(); 2];
        for ring in 0..=self.rows {
            let nearest = inner + (ring - 1) as f64 * self.layout.cell_m;
            if ring > 0 && nearest > best.unwrap_or(within_m) + along_m {
                break;
            }
            let rows = [centre - ring, centre + ring].into_iter().take(if ring == 0 { 1 } else { 2 });
            for (row, side) in rows.zip(&mut sides) {
                if !(0..self.rows).contains(&row) {
                    continue;
                }
                let brick = self.brick_of(row);
                if side.brick != Some(brick) {
                    *side = self.side(brick, &columns);
                }
                if side.rows & (1 << self.row_in_brick(row)) == 0 {
                    continue;
                }
                for column in columns.clone() {
                    let at = self.cell_at(side.slot, row, self.wrapped(column));
                    for distance_m in self.open.in_cell(at).filter_map(|end| place.to_crossing_m(end)) {
                        if distance_m <= best.unwrap_or(within_m) {
                            best = Some(distance_m);
                        }
                    }
                }
            }
        }
        best
    }

    /// Opens a brick and finds its rows that have samples in a range of columns.
    fn side(&mut self, brick: u32, columns: &Range<i64>) -> Side {
        let Some(slot) = self.opened(brick, false) else {
            return Side { brick: Some(brick), slot: 0, rows: 0 };
        };
        let seen = |column| usize::try_from(self.wrapped(column)).map_or(0, |c| self.open.rows_seen(slot, c));
        Side { brick: Some(brick), slot, rows: columns.clone().map(seen).fold(0, |all, rows| all | rows) }
    }

    /// Wraps the number of a column that may lie beyond the seam of the unrolled wall.
    fn wrapped(&self, column: i64) -> i64 {
        if (0..self.columns).contains(&column) { column } else { column.rem_euclid(self.columns) }
    }
}
