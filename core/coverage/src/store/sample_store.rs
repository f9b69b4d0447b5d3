//! The store of samples: insertion, queries, and opening and packing of bricks.

use serde::{Deserialize, Serialize};

use super::open::{CellAt, OpenBricks};
use super::packed::{self, Arena, Lattice, MOST_WORDS, Packed, Reader, Writer};
use super::thinning;
use headrace_geometry::math;
use headrace_geometry::snapshot::stateful;
use headrace_geometry::tunnel::WallPoint;
use headrace_sampling::head::MAX_HEADS;

/// Number of bricks that are open at a time. A brick is a stretch of wall; if it is open, its samples are unpacked.
///
/// A brick is at least a metre long, so the open bricks extend beyond any search radius on either side.
const OPEN_BRICKS: usize = 64;
/// Minimum length of a brick, a stretch of wall whose samples are packed together, m.
const BRICK_M: f64 = 1.0;
/// Maximum number of rows per brick. An open brick has a bit for each row in a `u32`.
const MOST_ROWS: usize = 32;
/// Maximum number of samples in all open bricks.
const OPEN_SAMPLES: usize = 1 << 18;
/// Words per brick that hold no sample: unused words of the last block, and words that switch heads.
const WORDS_PER_BRICK: usize = 48;

/// A sample on the unrolled wall.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WallSample {
    /// Chainage of the sample, m.
    pub x_m: f64,
    /// Arc length of the sample along the profile, m.
    pub arc_m: f64,
    /// Number of the head that measured the sample, below [`MAX_HEADS`].
    pub head: usize,
    /// Step from the same head's previous sample, along the tunnel and along the perimeter, m.
    ///
    /// `None` unless the two samples are one step apart in one sweep.
    pub step_m: Option<[f64; 2]>,
    /// Number of the visit that measured the sample, from zero. Later samples never have a lower number.
    pub visit: u32,
}

/// Extent and resolution of a [`SampleStore`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StoreLayout {
    /// Perimeter of the profile, m.
    pub perimeter_m: f64,
    /// First chainage of the store, m.
    pub from_m: f64,
    /// Last chainage of the store, m.
    pub to_m: f64,
    /// Nominal edge of a cell, m. Half the target makes the searches fast.
    pub cell_m: f64,
    /// Minimum capacity of the store in samples.
    pub capacity: u32,
}

impl StoreLayout {
    /// Returns the best cell edge for finding holes about as large as the target, m.
    pub fn cell_for_target_m(target_m: f64) -> f64 {
        (target_m / 2.0).clamp(0.05, 0.5)
    }
}

/// Outcome of inserting a sample.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kept {
    /// The sample was stored.
    Stored,
    /// The sample was dropped, because its cell is full and a stored sample nearby represents it.
    Thinned,
}

/// Reason why a sample was not stored.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum StoreError {
    /// The sample's chainage is outside the store's extent, or its coordinates are not finite.
    #[error("storing a sample: it lies outside the stretch of tunnel that the store covers")]
    Outside,
    /// The store is full.
    #[error("storing a sample: the store is full")]
    Full,
}

/// Largest differences between the samples that were inserted into a stretch and those stored for it.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Fidelity {
    /// Maximum distance of a dropped sample from the nearest stored sample, m.
    pub thinned_m: f64,
    /// Maximum displacement of a stored sample, m.
    pub moved_m: f64,
}

/// Contents and memory use of a store.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct StoreUse {
    /// Number of samples stored.
    pub kept: u64,
    /// Number of samples dropped by thinning.
    pub thinned: u64,
    /// Number of bytes that have ever been used, and so have been mapped by the OS.
    pub bytes: usize,
}

/// A brick: a group of rows of cells.
#[derive(Debug, Clone, Copy, Default, Serialize, Deserialize)]
struct Brick {
    /// Link to the brick's first block of packed samples. Zero means none.
    first_block: u32,
    /// Number of samples in the brick.
    count: u32,
    /// Slot of the brick plus one if it is open (unpacked). Zero otherwise.
    slot: u16,
    /// Coarsest thinning tier applied to the brick.
    tier: u8,
    /// Whether the brick has ever been packed, which may have moved its samples.
    moved: bool,
}

impl Brick {
    fn open_slot(&self) -> Option<usize> {
        self.slot.checked_sub(1).map(usize::from)
    }
}

/// Store of samples in bricks; see the description of the module `store`.
#[derive(Debug, Clone)]
pub struct SampleStore {
    pub(super) layout: StoreLayout,
    pub(super) rows: i64,
    pub(super) columns: i64,
    pub(super) column_m: f64,
    /// Binary logarithm of the number of rows in a brick.
    rows_shift: u32,
    bricks: Vec<Brick>,
    pub(super) open: OpenBricks,
    arena: Arena,
    /// Longest single step so far, along the tunnel and along the perimeter, m.
    pub(super) longest_step_m: [f64; 2],
    kept: u64,
    thinned: u64,
}

stateful!(SampleStore { state: open, arena, longest_step_m, kept, thinned; slots: bricks; fixed: layout, rows, columns, column_m, rows_shift; });

impl SampleStore {
    /// Creates an empty store.
    ///
    /// Allocates: at startup, all memory that it will ever use.
    pub fn new(layout: StoreLayout) -> Self {
        let rows = math::floor_to_i64((layout.to_m - layout.from_m) / layout.cell_m).max(0) + 1;
        let columns = math::floor_to_i64(layout.perimeter_m / layout.cell_m).max(1);
        let to_usize = |count: i64| usize::try_from(count).unwrap_or(0);
        let rows_of_brick = math::floor_to_i64(BRICK_M / layout.cell_m - 1e-9) + 1;
        let rows_per_brick = to_usize(rows_of_brick).next_power_of_two().min(MOST_ROWS);
        let bricks = to_usize(rows).div_ceil(rows_per_brick);
        let capacity = layout.capacity as usize;
        let open_samples = OPEN_SAMPLES.min(capacity);
        // Nearly all packed samples take one word. But for the open samples, the maximum number of words is reserved.
        let words = capacity
            + capacity / 8
            + MOST_WORDS * (open_samples + 1)
            + WORDS_PER_BRICK * (bricks + OPEN_BRICKS);
        Self {
            layout,
            rows,
            columns,
            column_m: layout.perimeter_m / columns as f64,
            rows_shift: rows_per_brick.trailing_zeros(),
            bricks: vec![Brick::default(); bricks],
            open: OpenBricks::new(OPEN_BRICKS.min(bricks), (rows_per_brick, to_usize(columns)), open_samples),
            arena: Arena::new(words / packed::ROOM + 1),
            longest_step_m: [0.0; 2],
            kept: 0,
            thinned: 0,
        }
    }

    /// Frees all samples and their memory.
    ///
    /// Afterwards, nothing can be stored. The number of thinned samples is kept.
    pub fn release(&mut self) {
        let layout = StoreLayout { to_m: self.layout.from_m, capacity: 0, ..self.layout };
        *self = Self { thinned: self.thinned, ..Self::new(layout) };
    }

    /// Perimeter of the profile, m.
    pub fn perimeter_m(&self) -> f64 {
        self.layout.perimeter_m
    }

    /// Whether a point is finite and within the store's extent.
    pub fn covers(&self, at: WallPoint) -> bool {
        self.row(at.x_m).is_some() && at.arc_m.is_finite()
    }

    /// Returns the current contents and memory use.
    pub fn usage(&self) -> StoreUse {
        debug_assert!(
            self.in_bricks() == self.kept,
            "bricks hold {} kept samples: {}",
            self.kept,
            self.in_bricks()
        );
        StoreUse {
            kept: self.kept,
            thinned: self.thinned,
            bytes: self.bricks.len() * size_of::<Brick>()
                + self.open.touched_bytes()
                + self.arena.touched_bytes(),
        }
    }

    /// Stores a sample, unless its cell is full and contains a nearby sample.
    ///
    /// Errors: the sample lies outside the store's extent, or the store is full. Allocates: never.
    pub fn insert(&mut self, sample: WallSample) -> Result<Kept, StoreError> {
        let row = self.row(sample.x_m).filter(|_| sample.arc_m.is_finite()).ok_or(StoreError::Outside)?;
        let arc_m = math::wrap(sample.arc_m, self.layout.perimeter_m);
        let number = self.brick_of(row);
        let slot = self.opened(number, true).ok_or(StoreError::Full)?;
        debug_assert!(
            self.open.holds(slot, number),
            "slot {slot} holds brick {number}, which it was opened for"
        );
        let cell = self.cell_at(slot, row, self.column(arc_m));
        if let Some(tier) =
            thinning::dropping_tier(&self.open, cell, (sample.x_m, arc_m), sample.step_m, self.edge_m())
        {
            self.thinned += 1;
            if let Some(brick) = self.bricks.get_mut(number as usize) {
                brick.tier = brick.tier.max(tier);
            }
            return Ok(Kept::Thinned);
        }
        // When all open samples are packed, they must fit into the arena.
        if self.arena.free_words() < MOST_WORDS * (self.open.used() + 1) + WORDS_PER_BRICK * OPEN_BRICKS {
            return Err(StoreError::Full);
        }
        self.make_room(number, 1);
        debug_assert!(
            (0.0..self.layout.perimeter_m).contains(&arc_m),
            "an arc length is on the wall: {arc_m} m"
        );
        let step_m = sample.step_m.unwrap_or_default();
        debug_assert!(step_m.iter().all(|step| step.is_finite()), "a step has a length: {step_m:?} m");
        let packed = Packed { x_m: sample.x_m, arc_m, step_m, visit: sample.visit };
        if !self.open.add(cell, sample.head, &packed) {
            return Err(StoreError::Full);
        }
        for (longest, step) in self.longest_step_m.iter_mut().zip(step_m) {
            *longest = longest.max(step.abs());
        }
        if let Some(brick) = self.bricks.get_mut(number as usize) {
            brick.count += 1;
        }
        self.kept += 1;
        debug_assert!(
            self.open.used() as u64 <= self.kept,
            "open samples are kept: {} of {}",
            self.open.used(),
            self.kept
        );
        Ok(Kept::Stored)
    }

    /// Calls `take` with the place and visit number of all samples between two chainages, m.
    ///
    /// It may also be called for some samples beyond them.
    ///
    /// Allocates: never.
    pub fn each_between(&self, from_m: f64, to_m: f64, mut take: impl FnMut(WallPoint, u32)) {
        for number in self.bricks_between(from_m, to_m) {
            let Some(brick) = self.bricks.get(number as usize).filter(|brick| brick.count > 0) else {
                continue;
            };
            match brick.open_slot() {
                Some(slot) => {
                    let (first, last) =
                        (self.row_near(from_m - packed::MOVED_M), self.row_near(to_m + packed::MOVED_M));
                    let in_brick =
                        i64::from(number) << self.rows_shift..i64::from(number + 1) << self.rows_shift;
                    for row in in_brick.start.max(first)..in_brick.end.min(last + 1) {
                        for column in 0..self.columns {
                            for node in self.open.in_cell(self.cell_at(slot, row, column)) {
                                take(WallPoint { x_m: node.x_m, arc_m: node.arc_m }, node.visit);
                            }
                        }
                    }
                }
                None => {
                    for (_, sample) in self.packed_samples(number, brick) {
                        take(WallPoint { x_m: sample.x_m, arc_m: sample.arc_m }, sample.visit);
                    }
                }
            }
        }
    }

    /// Returns the fidelity of the samples between two chainages.
    pub fn fidelity(&self, from_m: f64, to_m: f64) -> Fidelity {
        let mut worst = Fidelity::default();
        for number in self.bricks_between(from_m, to_m) {
            let Some(brick) = self.bricks.get(number as usize) else {
                debug_assert!(false, "brick {number} is one of {}", self.bricks.len());
                continue;
            };
            worst.thinned_m = worst.thinned_m.max(thinning::delta_m(brick.tier, self.edge_m()));
            if brick.moved {
                worst.moved_m = packed::MOVED_M;
            }
        }
        worst
    }

    fn bricks_between(&self, from_m: f64, to_m: f64) -> core::ops::RangeInclusive<u32> {
        // A sample near the edge of a brick may have been moved across this edge by packing.
        self.brick_of(self.row_near(from_m - packed::MOVED_M))
            ..=self.brick_of(self.row_near(to_m + packed::MOVED_M))
    }

    /// Number of samples in all bricks, open or packed.
    fn in_bricks(&self) -> u64 {
        self.bricks.iter().map(|brick| u64::from(brick.count)).sum()
    }

    fn packed_samples(&self, number: u32, brick: &Brick) -> Reader<'_> {
        Reader::new(&self.arena, self.lattice(number), brick.first_block, brick.count)
    }

    fn lattice(&self, number: u32) -> Lattice {
        let from_m = self.layout.from_m + (i64::from(number) << self.rows_shift) as f64 * self.layout.cell_m;
        Lattice::new(from_m, self.layout.perimeter_m)
    }

    /// Returns the slot of a brick.
    ///
    /// Opens the brick if it is packed, or if it is empty and `wanted` is true.
    pub(super) fn opened(&mut self, number: u32, wanted: bool) -> Option<usize> {
        let brick = *self.bricks.get(number as usize)?;
        if brick.slot > 0 || (brick.count == 0 && !wanted) {
            return brick.open_slot();
        }
        self.make_room(number, brick.count as usize);
        let slot = match self.open.free_slot() {
            Some(slot) => slot,
            None => self.pack_farthest_from(number)?,
        };
        if self.open.room() < brick.count as usize {
            return None;
        }
        self.open.place(slot, number);
        self.unpack(number, slot, &brick);
        if let Some(entry) = self.bricks.get_mut(number as usize) {
            (entry.slot, entry.first_block) = (u16::try_from(slot + 1).unwrap_or(0), 0);
        }
        self.arena.release(brick.first_block);
        Some(slot)
    }

    fn unpack(&mut self, number: u32, slot: usize, brick: &Brick) {
        let (rows_shift, columns, column_m) = (self.rows_shift, self.columns, self.column_m);
        let layout = self.layout;
        let first_row = i64::from(number) << rows_shift;
        let reader = Reader::new(&self.arena, self.lattice(number), brick.first_block, brick.count);
        let used = self.open.used();
        for (head, sample) in reader {
            let row = math::floor_to_i64((sample.x_m - layout.from_m) / layout.cell_m) - first_row;
            debug_assert!(
                (-1..=1 << rows_shift).contains(&row) && (0.0..layout.perimeter_m).contains(&sample.arc_m),
                "a packed sample stays in brick {number}, except for rounding: {sample:?}"
            );
            let row = row.clamp(0, (1 << rows_shift) - 1);
            let column = math::floor_to_i64(sample.arc_m / column_m).clamp(0, columns - 1);
            let at = CellAt {
                slot,
                row: usize::try_from(row).unwrap_or(0),
                column: usize::try_from(column).unwrap_or(0),
            };
            self.open.add(at, head, &sample);
        }
        let unpacked = self.open.used() - used;
        debug_assert!(
            unpacked == brick.count as usize,
            "brick {number} has {} samples: {unpacked}",
            brick.count
        );
    }

    /// Packs the open bricks farthest from `number` until there is room for `samples` more samples.
    fn make_room(&mut self, number: u32, samples: usize) {
        while self.open.room() < samples && self.pack_farthest_from(number).is_some() {}
    }

    fn pack_farthest_from(&mut self, number: u32) -> Option<usize> {
        let (slot, far) = self.open.farthest_from(number)?;
        let lattice = self.lattice(far);
        let mut writer = Writer::new(&mut self.arena, lattice);
        let mut written = 0;
        for head in 0..MAX_HEADS {
            let mut samples = self.open.of_head(slot, head).peekable();
            if samples.peek().is_some() {
                writer.head(head)?;
            }
            for node in samples {
                writer.sample(node.sample())?;
                written += 1;
            }
        }
        let first_block = writer.finish();
        self.open.clear(slot);
        let brick = self.bricks.get_mut(far as usize)?;
        debug_assert!(written == brick.count, "the heads' chains have {} samples: {written}", brick.count);
        (brick.first_block, brick.slot, brick.moved) = (first_block, 0, brick.moved || brick.count > 0);
        Some(slot)
    }

    /// Length of the longer edge of a cell, m.
    fn edge_m(&self) -> f64 {
        self.layout.cell_m.max(self.column_m)
    }

    fn row(&self, x_m: f64) -> Option<i64> {
        let inside = x_m >= self.layout.from_m && x_m <= self.layout.to_m;
        inside.then(|| self.row_near(x_m))
    }

    /// Returns the row of cells at a chainage, or the row nearest to it.
    fn row_near(&self, x_m: f64) -> i64 {
        math::floor_to_i64((x_m - self.layout.from_m) / self.layout.cell_m).clamp(0, self.rows - 1)
    }

    pub(super) fn brick_of(&self, row: i64) -> u32 {
        u32::try_from(row >> self.rows_shift).unwrap_or(0)
    }

    pub(super) fn row_in_brick(&self, row: i64) -> i64 {
        row & ((1 << self.rows_shift) - 1)
    }

    fn column(&self, arc_m: f64) -> i64 {
        math::floor_to_i64(arc_m / self.column_m).clamp(0, self.columns - 1)
    }

    pub(super) fn cell_at(&self, slot: usize, row: i64, column: i64) -> CellAt {
        let row = self.row_in_brick(row);
        let [row, column] = [row, column].map(|number| usize::try_from(number).unwrap_or(usize::MAX));
        CellAt { slot, row, column }
    }
}

#[cfg(test)]
mod tests;
