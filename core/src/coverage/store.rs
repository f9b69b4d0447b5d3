//! Samples on the unrolled wall, in square cells for searches by place.
//!
//! Everything is allocated before the loop is armed, zeroed, so that the system maps a page only when a sample falls
//! on it: memory in use grows with the wall that was seen. Samples are kept in the order in which they came; an index
//! is therefore also a moment, and a search can be made as of then.

use crate::math;

/// Place of a sample in the order in which samples came.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct SampleIndex(pub u32);

/// A sample on the unrolled wall.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WallSample {
    /// Chainage, m.
    pub x_m: f64,
    /// Arc length along the profile, in [0, perimeter).
    pub sigma_m: f64,
    /// The sample before it, when the same head has come from there in a single step of the same sweep.
    pub step_from: Option<SampleIndex>,
}

/// Extent and resolution of a [`SampleStore`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StoreLayout {
    /// Perimeter of the profile, m.
    pub perimeter_m: f64,
    /// First chainage of which samples are kept, m.
    pub from_m: f64,
    /// Last chainage, m.
    pub to_m: f64,
    /// Wanted edge of a cell, m; half the target suits the searches.
    pub cell_m: f64,
    /// Most samples that are kept.
    pub capacity: u32,
}

impl StoreLayout {
    /// The edge of a cell that suits searches for holes about as large as the target, m.
    pub fn cell_for_target_m(target_m: f64) -> f64 {
        (target_m / 2.0).clamp(0.05, 0.5)
    }
}

/// Why a sample was not kept.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum StoreError {
    /// Its chainage is outside the store's extent, or its coordinates are no numbers.
    #[error("the sample lies outside the stretch of tunnel that the store covers")]
    Outside,
    /// The store is full.
    #[error("the store is full")]
    Full,
}

/// See the module's description.
#[derive(Debug, Clone)]
pub struct SampleStore {
    layout: StoreLayout,
    rows: i64,
    columns: i64,
    column_m: f64,
    /// For each cell, one more than the index of its latest sample, or zero.
    latest: Vec<u32>,
    samples: Vec<Stored>,
    /// The longest single step so far, along the perimeter and along the tunnel, m.
    longest_step_m: (f64, f64),
}

#[derive(Debug, Clone, Copy)]
struct Stored {
    x_m: f64,
    sigma_m: f64,
    /// One more than the index of the sample before it in its cell, or zero.
    next: u32,
    /// One more than the index of the sample it came from, or zero.
    step_from: u32,
}

/// A sample that a search has found.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Found {
    /// Which.
    pub index: SampleIndex,
    /// Its chainage less the searched place's, m.
    pub dx_m: f64,
    /// Its arc length less the searched place's, the short way round, m.
    pub dsigma_m: f64,
}

impl Found {
    /// Distance from the searched place on the unrolled wall, squared.
    pub fn distance2(&self) -> f64 {
        self.dx_m * self.dx_m + self.dsigma_m * self.dsigma_m
    }
}

impl SampleStore {
    /// An empty store.
    ///
    /// Allocates: startup only; all that it will ever use.
    pub fn new(layout: StoreLayout) -> Self {
        let rows = math::floor_to_i64((layout.to_m - layout.from_m) / layout.cell_m).max(0) + 1;
        let columns = math::floor_to_i64(layout.perimeter_m / layout.cell_m).max(1);
        let cells = usize::try_from(rows * columns).unwrap_or(0);
        Self {
            layout,
            rows,
            columns,
            column_m: layout.perimeter_m / columns as f64,
            latest: vec![0; cells],
            samples: Vec::with_capacity(layout.capacity as usize),
            longest_step_m: (0.0, 0.0),
        }
    }

    /// Perimeter of the profile, m.
    pub fn perimeter_m(&self) -> f64 {
        self.layout.perimeter_m
    }

    /// Chainages between which samples are kept, m.
    pub fn extent_m(&self) -> (f64, f64) {
        (self.layout.from_m, self.layout.to_m)
    }

    /// Whether a place is within the stretch of which samples are kept, and its coordinates are numbers.
    pub fn covers(&self, x_m: f64, sigma_m: f64) -> bool {
        self.row(x_m).is_some() && sigma_m.is_finite()
    }

    /// Samples kept so far; as an index, the moment now.
    pub fn len(&self) -> SampleIndex {
        SampleIndex(u32::try_from(self.samples.len()).unwrap_or(u32::MAX))
    }

    /// Whether no sample is kept yet.
    pub fn is_empty(&self) -> bool {
        self.samples.is_empty()
    }

    /// The sample of that index.
    pub fn get(&self, index: SampleIndex) -> Option<WallSample> {
        self.samples.get(index.0 as usize).map(|stored| WallSample {
            x_m: stored.x_m,
            sigma_m: stored.sigma_m,
            step_from: stored.step_from.checked_sub(1).map(SampleIndex),
        })
    }

    /// Keeps a sample.
    ///
    /// Errors: it lies outside, or the store is full.
    /// Allocates: never.
    pub fn insert(&mut self, sample: WallSample) -> Result<SampleIndex, StoreError> {
        let row = self.row(sample.x_m).filter(|_| sample.sigma_m.is_finite()).ok_or(StoreError::Outside)?;
        if self.samples.len() >= self.layout.capacity as usize {
            return Err(StoreError::Full);
        }
        let sigma_m = math::wrap(sample.sigma_m, self.layout.perimeter_m);
        let cell = self.cell(row, self.column(sigma_m));
        let index = self.len();
        if let Some(from) = sample.step_from.and_then(|from| self.get(from)) {
            let around_m = math::wrap_signed(sigma_m - from.sigma_m, self.layout.perimeter_m).abs();
            let (longest, farthest) = self.longest_step_m;
            self.longest_step_m = (longest.max(around_m), farthest.max((sample.x_m - from.x_m).abs()));
        }
        let slot = self.latest.get_mut(cell).ok_or(StoreError::Outside)?;
        self.samples.push(Stored {
            x_m: sample.x_m,
            sigma_m,
            next: *slot,
            step_from: sample.step_from.map_or(0, |from| from.0 + 1),
        });
        *slot = index.0 + 1;
        Ok(index)
    }

    /// The nearest sample to a place, of those before `as_of`, no farther than `within_m`. Of equally near ones the
    /// latest is taken.
    ///
    /// Allocates: never.
    pub fn nearest(&self, x_m: f64, sigma_m: f64, within_m: f64, as_of: SampleIndex) -> Option<Found> {
        let mut best: Option<Found> = None;
        self.visit_rings(x_m, sigma_m, within_m, as_of, |found, limit2| {
            let distance2 = found.distance2();
            if distance2 < *limit2 || (best.is_none() && distance2 <= *limit2) {
                *limit2 = distance2;
                best = Some(found);
            }
        });
        best
    }

    /// Calls `visit` for every sample before `as_of` within `within_m` of a place, nearer rings of cells first.
    ///
    /// Allocates: never.
    pub fn visit_within(
        &self,
        x_m: f64,
        sigma_m: f64,
        within_m: f64,
        as_of: SampleIndex,
        mut visit: impl FnMut(Found),
    ) {
        self.visit_rings(x_m, sigma_m, within_m, as_of, |found, limit2| {
            if found.distance2() <= *limit2 {
                visit(found);
            }
        });
    }

    /// Calls `visit` with the samples of ever larger squares of cells, until the square holds the circle whose squared
    /// radius `visit` may shrink.
    fn visit_rings(
        &self,
        x_m: f64,
        sigma_m: f64,
        within_m: f64,
        as_of: SampleIndex,
        mut visit: impl FnMut(Found, &mut f64),
    ) {
        let sigma = math::wrap(sigma_m, self.layout.perimeter_m);
        let centre_row = math::floor_to_i64((x_m - self.layout.from_m) / self.layout.cell_m);
        let centre_column = self.column(sigma);
        let into_row = (x_m - self.layout.from_m) - centre_row as f64 * self.layout.cell_m;
        let into_column = sigma - centre_column as f64 * self.column_m;
        // Distance from the place to the nearest edge of its own cell: what each ring adds to its reach.
        let inner = into_row
            .min(self.layout.cell_m - into_row)
            .min(into_column)
            .min(self.column_m - into_column)
            .max(0.0);
        let edge = self.layout.cell_m.min(self.column_m);
        let mut limit2 = within_m * within_m;
        let mut ring = 0_i64;
        loop {
            let reach = inner + (ring - 1) as f64 * edge;
            if ring > 0 && reach > 0.0 && reach * reach > limit2 {
                return;
            }
            if ring > self.rows.max(self.columns) {
                return;
            }
            // Columns beyond half the perimeter would come round to ones that were visited already.
            let (left, right) = self.columns_of_ring(ring);
            for row in (centre_row - ring).max(0)..=(centre_row + ring).min(self.rows - 1) {
                let edge_row = row == centre_row - ring || row == centre_row + ring;
                if edge_row {
                    for offset in left..=right {
                        self.visit_cell(
                            row,
                            centre_column + offset,
                            x_m,
                            sigma,
                            as_of,
                            &mut limit2,
                            &mut visit,
                        );
                    }
                } else {
                    if left == -ring {
                        self.visit_cell(
                            row,
                            centre_column - ring,
                            x_m,
                            sigma,
                            as_of,
                            &mut limit2,
                            &mut visit,
                        );
                    }
                    if right == ring {
                        self.visit_cell(
                            row,
                            centre_column + ring,
                            x_m,
                            sigma,
                            as_of,
                            &mut limit2,
                            &mut visit,
                        );
                    }
                }
            }
            ring += 1;
        }
    }

    /// The offsets of columns, left and right, that a ring's row spans without coming round twice.
    fn columns_of_ring(&self, ring: i64) -> (i64, i64) {
        let left = (self.columns - 1) / 2;
        let right = self.columns / 2;
        (-ring.min(left), ring.min(right))
    }

    #[expect(clippy::too_many_arguments, reason = "an inner loop's body, kept apart for reading")]
    fn visit_cell(
        &self,
        row: i64,
        column: i64,
        x_m: f64,
        sigma_m: f64,
        as_of: SampleIndex,
        limit2: &mut f64,
        visit: &mut impl FnMut(Found, &mut f64),
    ) {
        let cell = self.cell(row, column.rem_euclid(self.columns));
        let mut link = self.latest.get(cell).copied().unwrap_or(0);
        while let Some(index) = link.checked_sub(1) {
            let Some(stored) = self.samples.get(index as usize) else { return };
            link = stored.next;
            if index >= as_of.0 {
                continue;
            }
            let found = Found {
                index: SampleIndex(index),
                dx_m: stored.x_m - x_m,
                dsigma_m: math::wrap_signed(stored.sigma_m - sigma_m, self.layout.perimeter_m),
            };
            visit(found, limit2);
        }
    }

    /// Distance in chainage to the nearest pass over `sigma_m` before `as_of`, no farther than `within_m`.
    ///
    /// A pass is a single step of a head from one sample to the next; where it crosses `sigma_m` its chainage is
    /// interpolated. Source: metrics.md, T_x.
    /// Allocates: never.
    pub fn nearest_pass_m(&self, x_m: f64, sigma_m: f64, within_m: f64, as_of: SampleIndex) -> Option<f64> {
        let sigma = math::wrap(sigma_m, self.layout.perimeter_m);
        let centre_row = math::floor_to_i64((x_m - self.layout.from_m) / self.layout.cell_m);
        let centre_column = self.column(sigma);
        let into_row = (x_m - self.layout.from_m) - centre_row as f64 * self.layout.cell_m;
        let inner = into_row.min(self.layout.cell_m - into_row).max(0.0);
        // A step ends at most its own length from where it crosses sigma.
        let (longest_m, along_m) = self.longest_step_m;
        let reach = (math::floor_to_i64(longest_m / self.column_m) + 1).min((self.columns - 1) / 2);
        let mut best: Option<f64> = None;
        let mut ring = 0_i64;
        loop {
            let nearest = inner + (ring - 1) as f64 * self.layout.cell_m;
            let limit = best.unwrap_or(within_m);
            if ring > 0 && nearest > limit + along_m {
                return best;
            }
            if ring > self.rows {
                return best;
            }
            for row in [centre_row - ring, centre_row + ring] {
                if (0..self.rows).contains(&row) {
                    for offset in -reach..=reach {
                        let column = (centre_column + offset).rem_euclid(self.columns);
                        self.passes_of_cell(row, column, (x_m, sigma), as_of, &mut |distance| {
                            if distance <= best.unwrap_or(within_m) {
                                best = Some(distance);
                            }
                        });
                    }
                }
                if ring == 0 {
                    break;
                }
            }
            ring += 1;
        }
    }

    fn passes_of_cell(
        &self,
        row: i64,
        column: i64,
        (x_m, sigma_m): (f64, f64),
        as_of: SampleIndex,
        pass: &mut impl FnMut(f64),
    ) {
        let mut link = self.latest.get(self.cell(row, column)).copied().unwrap_or(0);
        while let Some(index) = link.checked_sub(1) {
            let Some(end) = self.samples.get(index as usize) else { return };
            link = end.next;
            let start = end.step_from.checked_sub(1).and_then(|from| self.samples.get(from as usize));
            let Some(start) = start.filter(|_| index < as_of.0) else { continue };
            let to_end = math::wrap_signed(end.sigma_m - sigma_m, self.layout.perimeter_m);
            let to_start = math::wrap_signed(start.sigma_m - sigma_m, self.layout.perimeter_m);
            let span = to_end - to_start;
            // The start belongs to the step before.
            let crosses = (to_start < 0.0 && to_end >= 0.0) || (to_start > 0.0 && to_end <= 0.0);
            if crosses && span.abs() < self.layout.perimeter_m / 2.0 {
                let share = -to_start / span;
                let crossing_m = start.x_m + share * (end.x_m - start.x_m);
                pass((crossing_m - x_m).abs());
            }
        }
    }

    fn row(&self, x_m: f64) -> Option<i64> {
        let inside = x_m >= self.layout.from_m && x_m <= self.layout.to_m;
        inside.then(|| math::floor_to_i64((x_m - self.layout.from_m) / self.layout.cell_m).min(self.rows - 1))
    }

    fn column(&self, sigma_m: f64) -> i64 {
        math::floor_to_i64(sigma_m / self.column_m).clamp(0, self.columns - 1)
    }

    fn cell(&self, row: i64, column: i64) -> usize {
        usize::try_from(row * self.columns + column).unwrap_or(usize::MAX)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const PERIMETER_M: f64 = 7.3;

    fn store(samples: &[(f64, f64)]) -> SampleStore {
        let layout =
            StoreLayout { perimeter_m: PERIMETER_M, from_m: -1.0, to_m: 12.0, cell_m: 0.3, capacity: 1000 };
        let mut store = SampleStore::new(layout);
        for (x_m, sigma_m) in samples {
            store.insert(WallSample { x_m: *x_m, sigma_m: *sigma_m, step_from: None }).unwrap();
        }
        store
    }

    fn distance(a: (f64, f64), b: (f64, f64)) -> f64 {
        let around = (a.1 - b.1).abs() % PERIMETER_M;
        math::hypot(a.0 - b.0, around.min(PERIMETER_M - around))
    }

    proptest! {
        /// Against looking at every sample.
        #[test]
        fn the_nearest_is_the_nearest(
            samples in proptest::collection::vec((-1.0f64..12.0, 0.0f64..PERIMETER_M), 0..60),
            place in (-3.0f64..14.0, -8.0f64..16.0),
            within_m in 0.05f64..9.0,
            share in 0.0f64..1.0,
        ) {
            let as_of = (samples.len() as f64 * share) as usize;
            let expected = samples[..as_of]
                .iter()
                .map(|s| distance(*s, place))
                .filter(|d| *d <= within_m)
                .min_by(f64::total_cmp);
            let found = store(&samples).nearest(place.0, place.1, within_m, SampleIndex(as_of as u32));
            match (found, expected) {
                (Some(found), Some(d)) => prop_assert!((found.distance2().sqrt() - d).abs() < 1e-12),
                (found, expected) => prop_assert_eq!(found.is_some(), expected.is_some()),
            }
        }

        #[test]
        fn all_within_a_radius_are_visited_once(
            samples in proptest::collection::vec((-1.0f64..12.0, 0.0f64..PERIMETER_M), 0..60),
            place in (-3.0f64..14.0, -8.0f64..16.0),
            within_m in 0.05f64..9.0,
        ) {
            let mut visited = Vec::new();
            store(&samples).visit_within(place.0, place.1, within_m, SampleIndex(u32::MAX), |found| {
                visited.push(found.index.0 as usize);
            });
            visited.sort_unstable();
            let expected: Vec<usize> = (0..samples.len())
                .filter(|i| distance(samples[*i], place) <= within_m)
                .collect();
            prop_assert_eq!(visited, expected);
        }
    }

    #[test]
    fn a_pass_is_found_where_its_step_crosses() {
        let mut store = store(&[(1.0, 7.2), (1.1, 0.2), (3.0, 7.2)]);
        let step = WallSample { x_m: 1.3, sigma_m: 0.1, step_from: Some(SampleIndex(0)) };
        store.insert(step).unwrap();
        let all = SampleIndex(u32::MAX);
        // The step from (1.0, 7.2) to (1.3, 0.1) crosses the seam at its middle.
        let distance = store.nearest_pass_m(2.0, 0.0, 5.0, all).unwrap();
        assert!((distance - 0.85).abs() < 1e-9, "{distance}");
        assert_eq!(store.nearest_pass_m(2.0, 0.0, 0.5, all), None);
        assert_eq!(store.nearest_pass_m(2.0, 0.0, 5.0, SampleIndex(3)), None);
        assert_eq!(store.nearest_pass_m(2.0, 1.0, 5.0, all), None);
    }

    #[test]
    fn what_is_outside_or_too_much_is_refused() {
        let layout = StoreLayout { perimeter_m: 3.0, from_m: 0.0, to_m: 1.0, cell_m: 0.25, capacity: 1 };
        let mut store = SampleStore::new(layout);
        let sample = WallSample { x_m: 0.5, sigma_m: 1.0, step_from: None };
        for x_m in [-0.1, 1.1, f64::NAN] {
            assert_eq!(store.insert(WallSample { x_m, ..sample }), Err(StoreError::Outside));
        }
        assert_eq!(store.insert(WallSample { sigma_m: f64::INFINITY, ..sample }), Err(StoreError::Outside));
        assert_eq!(store.insert(sample), Ok(SampleIndex(0)));
        assert_eq!(store.insert(sample), Err(StoreError::Full));
    }
}
