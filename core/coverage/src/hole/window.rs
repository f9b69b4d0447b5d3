//! Samples around a section, sorted into fine cells for nearest-sample search.

use crate::store::SampleStore;
use headrace_geometry::math;
use headrace_geometry::tunnel::WallPoint;

/// Maximum number of samples in a window.
const ROOM: usize = 1 << 20;
/// Maximum number of cells in a window.
const CELLS: usize = 1 << 20;

/// The sample nearest to a point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Nearest {
    /// Chainage of the sample relative to the window's origin, m.
    pub x_m: f64,
    /// Arc length of the sample, in [0, perimeter), m.
    pub arc_m: f64,
    /// Number of perimeters to add to the sample's arc length to get its image nearest to the point.
    pub turns: f64,
    /// Squared distance from the point to the sample on the unrolled wall, m2.
    pub distance2: f64,
}

/// A window: a stretch of wall with all its samples, sorted into cells.
#[derive(Debug)]
pub(super) struct Window {
    perimeter_m: f64,
    /// Chainage of the window's origin, m.
    origin_m: f64,
    /// Distance from the origin to the first row of cells, m.
    from_m: f64,
    cell_m: f64,
    column_m: f64,
    /// Reciprocals of perimeter, cell length and cell width, 1/m. Sorting and lookup must use equal values.
    per_m: [f64; 3],
    rows: usize,
    columns: usize,
    /// Start index of each cell's samples, row by row, with two additional entries at the end.
    begins: Vec<u32>,
    /// Samples by cell. Their chainage is relative to the window's origin.
    spots: Vec<WallPoint>,
    unsorted: Vec<(u32, WallPoint)>,
    /// Whether samples were dropped because the window was full.
    pub overfull: bool,
}

impl Default for Window {
    fn default() -> Self {
        Self {
            perimeter_m: 1.0,
            origin_m: 0.0,
            from_m: 0.0,
            cell_m: 1.0,
            column_m: 1.0,
            per_m: [1.0; 3],
            rows: 0,
            columns: 1,
            begins: Vec::with_capacity(CELLS + 2),
            spots: Vec::with_capacity(ROOM),
            unsorted: Vec::with_capacity(ROOM),
            overfull: false,
        }
    }
}

impl Window {
    /// Loads the stored samples between two chainages into the window. Cells are about `cell_m` long.
    ///
    /// The chainages `from_m` and `to_m` are relative to `origin_m`. Samples of visits before `first_visit` are
    /// ignored.
    ///
    /// Allocates: never.
    pub(super) fn fill(
        &mut self,
        (store, first_visit): (&SampleStore, u32),
        origin_m: f64,
        (from_m, to_m): (f64, f64),
        cell_m: f64,
    ) {
        self.begin(store.perimeter_m(), origin_m, (from_m, to_m), cell_m);
        store.each_between(origin_m + from_m, origin_m + to_m, |at, visit| {
            if visit >= first_visit {
                self.push(WallPoint { x_m: at.x_m - origin_m, ..at });
            }
        });
        self.sort();
    }

    /// Begins a window between two chainages relative to `origin_m`.
    ///
    /// Then the caller pushes samples and sorts the window.
    pub(super) fn begin(&mut self, perimeter_m: f64, origin_m: f64, between_m: (f64, f64), cell_m: f64) {
        self.lay_out(perimeter_m, origin_m, between_m, cell_m);
        self.unsorted.clear();
        self.overfull = false;
    }

    /// Adds a sample unless it lies outside the window.
    ///
    /// The sample's chainage is relative to the window's origin.
    pub(super) fn push(&mut self, spot: WallPoint) {
        let [_, per_row, per_column] = self.per_m;
        let row = (spot.x_m - self.from_m) * per_row;
        if !(0.0..self.rows as f64).contains(&row) {
            return;
        }
        if self.unsorted.len() == ROOM {
            self.overfull = true;
            return;
        }
        let cell = whole(row) * self.columns + whole(spot.arc_m * per_column).min(self.columns - 1);
        if let Some(count) = self.begins.get_mut(cell + 2) {
            *count += 1;
        }
        self.unsorted.push((u32::try_from(cell).unwrap_or(u32::MAX), spot));
    }

    fn lay_out(&mut self, perimeter_m: f64, origin_m: f64, (from_m, to_m): (f64, f64), cell_m: f64) {
        let cells = (to_m - from_m) * perimeter_m;
        // Larger cells are used if there is no room for all cells of this size.
        let cell_m = cell_m.max(1.5 * math::sqrt(cells / CELLS as f64));
        (self.perimeter_m, self.origin_m, self.from_m, self.cell_m) = (perimeter_m, origin_m, from_m, cell_m);
        self.rows = whole((to_m - from_m) / cell_m) + 1;
        self.columns = whole(perimeter_m / cell_m).clamp(1, CELLS / self.rows);
        self.column_m = perimeter_m / self.columns as f64;
        self.per_m = [1.0 / perimeter_m, 1.0 / cell_m, 1.0 / self.column_m];
        self.begins.clear();
        self.begins.resize(self.rows * self.columns + 2, 0);
    }

    /// Sorts the samples by cell, with a counting sort.
    ///
    /// The count of each cell is stored at cell + 2. So the running sum at cell + 1 is the start index of the cell.
    /// While samples are placed, this index advances to the start of the next cell.
    pub(super) fn sort(&mut self) {
        let mut sum = 0;
        for begin in &mut self.begins {
            sum += *begin;
            *begin = sum;
        }
        self.spots.resize(self.unsorted.len(), WallPoint::default());
        for (cell, spot) in &self.unsorted {
            let Some(next) = self.begins.get_mut(*cell as usize + 1) else {
                debug_assert!(false, "cell {cell} is one of {} x {}", self.rows, self.columns);
                continue;
            };
            if let Some(place) = self.spots.get_mut(*next as usize) {
                *place = *spot;
            }
            *next += 1;
        }
        debug_assert!(
            self.is_sorted(),
            "{} samples lie in {} x {} cells",
            self.spots.len(),
            self.rows,
            self.columns
        );
    }

    /// Whether the last cell ends with the last sample, as it does if all samples lie in cells.
    fn is_sorted(&self) -> bool {
        self.begins.iter().rev().take(2).all(|end| *end as usize == self.spots.len())
    }

    /// Converts chainage relative to the window's origin to chainage along the tunnel, m.
    pub(super) fn chainage_m(&self, x_m: f64) -> f64 {
        self.origin_m + x_m
    }

    /// Perimeter of the wall, m.
    pub(super) fn perimeter_m(&self) -> f64 {
        self.perimeter_m
    }

    /// Returns the sample nearest to a point within `within_m`. If several are equally near, returns the first one
    /// found.
    pub(super) fn nearest(&self, to: WallPoint, within_m: f64) -> Option<Nearest> {
        self.near(to, within_m, -1.0)
    }

    /// Returns the sample nearest to a point within `within_m`, or any sample within `enough_m`.
    pub(super) fn near_enough(&self, to: WallPoint, within_m: f64, enough_m: f64) -> Option<Nearest> {
        let enough2 = if enough_m > 0.0 { enough_m * enough_m } else { -1.0 };
        self.near(to, within_m, enough2)
    }

    fn near(&self, WallPoint { x_m, arc_m }: WallPoint, within_m: f64, enough2: f64) -> Option<Nearest> {
        let [per_turn, per_row, _] = self.per_m;
        let turn = libm::floor(arc_m * per_turn);
        let arc_m = arc_m - turn * self.perimeter_m;
        let mut best = Search { x_m, arc_m, limit2: within_m * within_m, enough2, found: None };
        let centre = whole((x_m - self.from_m) * per_row).min(self.rows - 1);
        // The search begins in the point's row, and then takes the next row on either side at each step.
        self.look_in_row(centre, &mut best);
        for ring in 1..self.rows {
            if best.is_enough() {
                break;
            }
            let below = (centre >= ring).then(|| centre - ring);
            let above = Some(centre + ring).filter(|row| *row < self.rows);
            let mut in_reach = false;
            for row in [below, above].into_iter().flatten() {
                in_reach |= self.look_in_row(row, &mut best);
            }
            if !in_reach {
                break;
            }
        }
        let (spot, turns) = best.found?;
        let turns = turns + turn;
        Some(Nearest { x_m: spot.x_m, arc_m: spot.arc_m, turns, distance2: best.limit2 })
    }

    /// Searches a row of cells near a point. Returns false if the whole row is out of range.
    fn look_in_row(&self, row: usize, best: &mut Search) -> bool {
        let low = self.from_m + row as f64 * self.cell_m - best.x_m;
        let away = low.max(-(low + self.cell_m)).max(0.0);
        let width2 = best.limit2 - away * away;
        // The margin allows for rounding of the coordinates of the row's edges.
        if width2 < -1e-9 {
            return false;
        }
        let width_m = math::sqrt(width2.max(0.0)) + 1e-9;
        let first = row * self.columns;
        if 2.0 * width_m + self.column_m >= self.perimeter_m {
            self.look_all_round(first, best);
            return true;
        }
        // The shift by one turn keeps column numbers non-negative.
        let on_m = best.arc_m + self.perimeter_m;
        let [_, _, per_column] = self.per_m;
        let (left, right) = (whole((on_m - width_m) * per_column), whole((on_m + width_m) * per_column));
        let columns = self.columns;
        if left < columns {
            self.look_at(first + left, first + columns, -1.0, best);
        }
        if right >= 2 * columns {
            self.look_at(first, first + right - 2 * columns + 1, 1.0, best);
        }
        if best.is_enough() {
            return true;
        }
        let (left, right) = (left.max(columns) - columns, right.min(2 * columns - 1) - columns);
        self.look_at(first + left, first + right + 1, 0.0, best);
        true
    }

    /// Returns the samples of a range of cells in a row of the window.
    fn spots(&self, from: usize, to: usize) -> &[WallPoint] {
        let (Some(begin), Some(end)) = (self.begins.get(from), self.begins.get(to)) else { return &[] };
        self.spots.get(*begin as usize..*end as usize).unwrap_or_default()
    }

    /// Searches a range of cells in a row. Their samples are shifted by `turns` turns round the perimeter.
    fn look_at(&self, from: usize, to: usize, turns: f64, best: &mut Search) {
        let arc_m = best.arc_m - turns * self.perimeter_m;
        for spot in self.spots(from, to) {
            let (dx, darc) = (spot.x_m - best.x_m, spot.arc_m - arc_m);
            if best.takes(spot, turns, dx * dx + darc * darc) && best.is_enough() {
                return;
            }
        }
    }

    /// Searches all samples of a row. The distance to each is measured the shorter way round the perimeter.
    fn look_all_round(&self, first: usize, best: &mut Search) {
        let half_m = self.perimeter_m / 2.0;
        for spot in self.spots(first, first + self.columns) {
            let (dx, straight) = (spot.x_m - best.x_m, spot.arc_m - best.arc_m);
            let turns = if straight >= half_m {
                -1.0
            } else if straight < -half_m {
                1.0
            } else {
                0.0
            };
            let darc = straight + turns * self.perimeter_m;
            if best.takes(spot, turns, dx * dx + darc * darc) && best.is_enough() {
                return;
            }
        }
    }
}

/// State of a nearest-sample search.
struct Search {
    x_m: f64,
    arc_m: f64,
    limit2: f64,
    /// Squared distance below which the search stops, m2.
    enough2: f64,
    found: Option<(WallPoint, f64)>,
}

impl Search {
    /// Keeps a sample if it is nearer than all samples found so far. Returns true if it was kept.
    fn takes(&mut self, spot: &WallPoint, turns: f64, distance2: f64) -> bool {
        let is_nearer = distance2 < self.limit2 || (distance2 <= self.limit2 && self.found.is_none());
        if is_nearer {
            (self.limit2, self.found) = (distance2, Some((*spot, turns)));
        }
        is_nearer
    }

    /// Whether a sample was found that is near enough to stop the search.
    fn is_enough(&self) -> bool {
        self.limit2 <= self.enough2 && self.found.is_some()
    }
}

/// Integer part of a non-negative number.
#[expect(
    clippy::cast_possible_truncation,
    reason = "float to integer casts saturate, which is what is wanted"
)]
fn whole(x: f64) -> usize {
    x as usize
}
