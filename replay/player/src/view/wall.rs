//! The unrolled wall near the vehicle: chainage along x, arc length along y. Colours show samples and verdicts.

use std::collections::BTreeMap;

use headrace_coverage::Verdict;
use headrace_geometry::math;
use headrace_geometry::time::{DurNs, MonoNs};
use headrace_geometry::tunnel::WallPoint;

use super::messages::{Field, Grid, Pose, Turn, Xy, Xyz, base64, rounded};
use super::site::{Site, WALL};

/// Approximate size of a grid cell along the tunnel's perimeter, m.
const CELL_M: f64 = 0.25;
/// Length of wall displayed ahead of the vehicle, and behind it, m.
const REACH_M: f64 = 8.0;
/// Length of wall kept beyond either end of the tunnel, m, because heads may be there.
const BEYOND_M: f64 = 25.0;
/// Minimum interval between two published grids of the wall.
const EVERY: DurNs = DurNs(2_000_000_000);
const FIELDS: [Field; 6] = [
    Field::byte("red", 0),
    Field::byte("green", 1),
    Field::byte("blue", 2),
    Field::byte("alpha", 3),
    Field::byte("samples", 4),
    Field::byte("verdict", 5),
];
/// Maximum number of samples that is counted in a cell. Exact counts would take up most of the message's length.
const MOST_SAMPLES: u8 = 3;

/// Samples and verdicts of the wall's cells. Columns are allocated only where the vehicle has passed.
#[derive(Debug)]
pub(super) struct Wall {
    cells: usize,
    cell_m: f64,
    section_m: f64,
    indices: core::ops::RangeInclusive<i64>,
    columns: BTreeMap<i64, Column>,
    shown: Option<MonoNs>,
    changed: bool,
}

#[derive(Debug, Clone)]
struct Column {
    verdict: Verdict,
    samples: Vec<u8>,
}

impl Wall {
    pub(super) fn new(site: &Site) -> Self {
        let perimeter_m = site.profile.perimeter_m();
        let cells = usize::try_from(math::round_to_i64(perimeter_m / CELL_M)).unwrap_or(1).clamp(8, 512);
        let index = |x_m: f64| math::floor_to_i64(x_m / site.section_m);
        Self {
            cells,
            cell_m: perimeter_m / cells as f64,
            section_m: site.section_m,
            indices: index(-BEYOND_M)..=index(site.length_m + BEYOND_M),
            columns: BTreeMap::new(),
            shown: None,
            changed: false,
        }
    }

    /// Counts a sample in its grid cell of the wall.
    pub(super) fn sample(&mut self, WallPoint { x_m, arc_m }: WallPoint) {
        let row = usize::try_from(math::floor_to_i64(arc_m / self.cell_m)).unwrap_or(0).min(self.cells - 1);
        let column = self.column(math::floor_to_i64(x_m / self.section_m));
        if let Some(count) = column.and_then(|column| column.samples.get_mut(row))
            && *count < MOST_SAMPLES
        {
            *count += 1;
            self.changed = true;
        }
    }

    /// Stores the verdict of a tunnel section for the grid of the wall.
    pub(super) fn judge(&mut self, section: i64, verdict: Verdict) {
        if let Some(column) = self.column(section)
            && column.verdict != verdict
        {
            column.verdict = verdict;
            self.changed = true;
        }
    }

    fn column(&mut self, index: i64) -> Option<&mut Column> {
        let cells = self.cells;
        let new = || Column { verdict: Verdict::Open, samples: vec![0; cells] };
        self.indices.contains(&index).then(|| self.columns.entry(index).or_insert_with(new))
    }

    /// Makes the next grid of the wall due at once.
    pub(super) fn hurry(&mut self) {
        self.shown = None;
    }

    /// Returns the wall around a chainage, if the wall has changed and a grid is due.
    pub(super) fn show(&mut self, at: MonoNs, x_m: f64) -> Option<Grid> {
        let waits = self.shown.is_some_and(|shown| (0..EVERY.0).contains(&at.since(shown).0));
        (self.changed && !waits).then(|| {
            (self.shown, self.changed) = (Some(at), false);
            self.grid(at, x_m)
        })
    }

    fn grid(&self, at: MonoNs, x_m: f64) -> Grid {
        let index = |x_m: f64| math::floor_to_i64(x_m / self.section_m);
        let (from, to) = (index(x_m - REACH_M), index(x_m + REACH_M));
        let columns: Vec<Option<&Column>> = (from..=to).map(|index| self.columns.get(&index)).collect();
        let mut data = Vec::with_capacity(columns.len() * self.cells * FIELDS.len());
        for row in 0..self.cells {
            for column in &columns {
                data.extend(cell(*column, row));
            }
        }
        let corner = [rounded(from as f64 * self.section_m, 1e4), 0.0, 0.0];
        Grid {
            timestamp: at.into(),
            frame_id: WALL,
            pose: Pose { position: Xyz::new(corner), orientation: Turn::NONE },
            column_count: columns.len(),
            cell_size: Xy { x: self.section_m, y: self.cell_m },
            row_stride: columns.len() * FIELDS.len(),
            cell_stride: FIELDS.len(),
            fields: &FIELDS,
            data: base64(&data),
        }
    }
}

/// Returns the colour, sample count and verdict of a cell.
///
/// A cell without a sample is transparent in an open section, and dark in a judged section, so that holes are visible.
fn cell(column: Option<&Column>, row: usize) -> [u8; FIELDS.len()] {
    let Some(column) = column else { return [0; FIELDS.len()] };
    let samples = column.samples.get(row).copied().unwrap_or(0);
    let [red, green, blue] = match column.verdict {
        Verdict::Open => [120, 140, 160],
        Verdict::Pass => [40, 170, 70],
        Verdict::CannotSay => [220, 160, 30],
        Verdict::Fail => [220, 50, 40],
    };
    let verdict = column.verdict as u8;
    match (samples, column.verdict) {
        (0, Verdict::Open) => [0, 0, 0, 0, 0, verdict],
        (0, _) => [red / 3, green / 3, blue / 3, 255, 0, verdict],
        _ => [red, green, blue, 255, samples, verdict],
    }
}
