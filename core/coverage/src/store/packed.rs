//! Packed samples away from the vehicle. Most of them take four bytes each.
//!
//! The samples of a brick lie in a chain of blocks, head by head in order of arrival. Most samples take one word: the
//! difference from the previous sample, in quanta of 2^-17 m. Quanta are aligned to chainage zero and arc length zero.
//! So all samples are on one lattice, on which a step ends exactly where the next step begins. A sample that is
//! unpacked and packed again does not move again.

use headrace_geometry::math;
use headrace_geometry::snapshot::{Restorer, Saver, SnapshotError, Stateful};
use headrace_sampling::head::MAX_HEADS;

/// Number of quanta per metre.
const QUANTA_PER_M: f64 = 131_072.0;
/// Maximum displacement of a sample by packing, m.
///
/// Along the tunnel, it is up to half a quantum. Along the perimeter, it is up to one quantum, because the perimeter's
/// last quantum is incomplete.
pub(super) const MOVED_M: f64 = 8.6e-6;
/// Number of words for samples per block. One more word links to the next block.
pub(super) const ROOM: usize = 31;
/// Maximum number of words that a sample takes.
pub(super) const MOST_WORDS: usize = 7;
/// Lower half of an escape word. No difference between samples has this value.
const ESCAPE: u16 = 0x8000;
const PLACE: u16 = 0;
const STEPPED: u16 = 1;
/// Tag: the next word is the visit number of the samples that follow.
const VISIT: u16 = u16::MAX;
/// Tag that switches to another head: `HEAD` plus the head's number.
const HEAD: u16 = 2;

/// Lattice point. Its quanta are counted along the tunnel from the start of the brick, and along the perimeter.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Spot {
    x: i64,
    arc: i64,
}

/// The lattice of a brick, on which packed samples lie.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Lattice {
    origin: i64,
    perimeter_m: f64,
    last_arc: i64,
}

/// A sample that is being packed or unpacked.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Packed {
    /// Chainage of the sample, m.
    pub x_m: f64,
    /// Arc length of the sample, m.
    pub arc_m: f64,
    /// Single step from the previous sample, along the tunnel and along the perimeter, m. Zero without a step.
    pub step_m: [f64; 2],
    /// Number of the visit that measured the sample.
    pub visit: u32,
}

impl Lattice {
    pub(super) fn new(from_m: f64, perimeter_m: f64) -> Self {
        // The last quantum must have its centre below the perimeter.
        let last_arc = math::floor_to_i64(perimeter_m * QUANTA_PER_M - 0.5 - 1e-6).max(0);
        Self { origin: math::floor_to_i64(from_m * QUANTA_PER_M), perimeter_m, last_arc }
    }

    fn spot(&self, x_m: f64, arc_m: f64) -> Spot {
        Spot {
            x: math::floor_to_i64(x_m * QUANTA_PER_M) - self.origin,
            arc: math::floor_to_i64(math::wrap(arc_m, self.perimeter_m) * QUANTA_PER_M).min(self.last_arc),
        }
    }

    /// Returns the centre of a quantum, m.
    fn place_m(&self, spot: Spot) -> (f64, f64) {
        (((self.origin + spot.x) as f64 + 0.5) / QUANTA_PER_M, (spot.arc as f64 + 0.5) / QUANTA_PER_M)
    }
}

/// Returns the word for a sample that stores its difference from the previous sample.
///
/// `None` if the samples are too far apart.
fn difference(from: Spot, to: Spot, stepped: bool) -> Option<u32> {
    let along = i16::try_from(to.x - from.x).ok().filter(|along| (-0x4000..0x4000).contains(along))?;
    let around = i16::try_from(to.arc - from.arc).ok().filter(|around| *around != i16::MIN)?;
    let upper = ((along as u16) << 1) | u16::from(stepped);
    Some(u32::from(upper) << 16 | u32::from(around as u16))
}

fn escape(tag: u16) -> u32 {
    u32::from(tag) << 16 | u32::from(ESCAPE)
}

/// Blocks of words, with a free list.
#[derive(Debug, Clone)]
pub(super) struct Arena {
    blocks: Vec<[u32; ROOM + 1]>,
    most: usize,
    /// First free block: its index plus one. Zero means none.
    free: u32,
    used: usize,
}

impl Stateful for Arena {
    fn save(&self, to: &mut Saver) {
        to.value(&(self.free, self.used));
        let words = self.blocks.as_flattened();
        to.raw(&words.iter().flat_map(|word| word.to_le_bytes()).collect::<Vec<u8>>());
    }

    fn restore(&mut self, from: &mut Restorer<'_>) -> Result<(), SnapshotError> {
        (self.free, self.used) = from.value()?;
        let bytes = from.raw()?;
        let (blocks, rest) = bytes.as_chunks::<{ 4 * (ROOM + 1) }>();
        if !rest.is_empty() || blocks.len() > self.most {
            return Err(from.unfit(format!("{} bytes of blocks; at most {} fit", bytes.len(), self.most)));
        }
        self.blocks.clear();
        self.blocks.extend(blocks.iter().map(|block| {
            let mut words = [0; ROOM + 1];
            for (word, bytes) in words.iter_mut().zip(block.as_chunks::<4>().0) {
                *word = u32::from_le_bytes(*bytes);
            }
            words
        }));
        Ok(())
    }
}

impl Arena {
    /// Creates an arena of blocks. Allocates: at startup only.
    pub(super) fn new(most_blocks: usize) -> Self {
        Self { blocks: Vec::with_capacity(most_blocks), most: most_blocks, free: 0, used: 0 }
    }

    /// Number of free words in the arena.
    pub(super) fn free_words(&self) -> usize {
        (self.most - self.used) * ROOM
    }

    /// Number of bytes that have ever been used.
    pub(super) fn touched_bytes(&self) -> usize {
        self.blocks.len() * size_of::<[u32; ROOM + 1]>()
    }

    fn take(&mut self) -> Option<u32> {
        let link = match self.free.checked_sub(1) {
            Some(index) => {
                let link = self.free;
                self.free = self.blocks.get(index as usize)?.last().copied()?;
                link
            }
            None if self.blocks.len() < self.most => {
                self.blocks.push([0; ROOM + 1]);
                u32::try_from(self.blocks.len()).ok()?
            }
            None => return None,
        };
        self.used += 1;
        if let Some(next) = self.block_mut(link).and_then(|block| block.last_mut()) {
            *next = 0;
        }
        Some(link)
    }

    fn block_mut(&mut self, link: u32) -> Option<&mut [u32; ROOM + 1]> {
        self.blocks.get_mut(link.checked_sub(1)? as usize)
    }

    /// Frees the chain of blocks that begins with `first`.
    pub(super) fn release(&mut self, first: u32) {
        let mut link = first;
        let free = self.free;
        let mut released = 0;
        while link != 0 {
            let Some(next) = self.block_mut(link).and_then(|block| block.last_mut()) else {
                debug_assert!(false, "block {link} of a brick is one of {}", self.blocks.len());
                break;
            };
            released += 1;
            let after = *next;
            if after == 0 {
                *next = free;
            }
            link = after;
        }
        if released > 0 {
            self.free = first;
            self.used -= released;
        }
    }
}

/// Writer of the samples of a packed brick.
pub(super) struct Writer<'a> {
    arena: &'a mut Arena,
    lattice: Lattice,
    first: u32,
    block: u32,
    at: usize,
    before: Option<(Spot, Packed)>,
    visit: u32,
}

impl<'a> Writer<'a> {
    pub(super) fn new(arena: &'a mut Arena, lattice: Lattice) -> Self {
        Self { arena, lattice, first: 0, block: 0, at: ROOM, before: None, visit: 0 }
    }

    /// Switches to another head's samples. `None` if there is no room.
    pub(super) fn head(&mut self, head: usize) -> Option<()> {
        self.before = None;
        self.word(escape(HEAD + u16::try_from(head).ok()?))
    }

    /// Writes a sample. `None` if there is no room.
    pub(super) fn sample(&mut self, sample: Packed) -> Option<()> {
        if sample.visit != self.visit {
            self.visit = sample.visit;
            self.word(escape(VISIT))?;
            self.word(sample.visit)?;
        }
        let spot = self.lattice.spot(sample.x_m, sample.arc_m);
        let [along_m, around_m] = sample.step_m;
        let stepped = along_m.abs() + around_m.abs() > 0.0;
        let start_m = (sample.x_m - along_m, math::wrap(sample.arc_m - around_m, self.lattice.perimeter_m));
        // Whether the step began at the head's previous sample, apart from rounding.
        let follows = |before: &Packed| {
            (before.x_m - start_m.0).abs() < 1e-9 && (before.arc_m - start_m.1).abs() < 1e-9
        };
        let short = self.before.filter(|(_, before)| !stepped || follows(before));
        let start = match self.before.filter(|(_, before)| follows(before)) {
            Some((start, _)) => start,
            None => self.lattice.spot(start_m.0, start_m.1),
        };
        self.before = Some((spot, sample));
        if let Some(word) = short.and_then(|(before, _)| difference(before, spot, stepped)) {
            return self.word(word);
        }
        self.word(escape(if stepped { STEPPED } else { PLACE }))?;
        self.spot(spot)?;
        if stepped { self.spot(start) } else { Some(()) }
    }

    fn spot(&mut self, spot: Spot) -> Option<()> {
        for number in [spot.x, spot.arc] {
            self.word(i32::try_from(number).unwrap_or(i32::MAX) as u32)?;
        }
        Some(())
    }

    fn word(&mut self, word: u32) -> Option<()> {
        if self.at == ROOM {
            let next = self.arena.take()?;
            match self.arena.block_mut(self.block).and_then(|block| block.last_mut()) {
                Some(link) => *link = next,
                None => self.first = next,
            }
            (self.block, self.at) = (next, 0);
        }
        *self.arena.block_mut(self.block)?.get_mut(self.at)? = word;
        self.at += 1;
        Some(())
    }

    /// Returns the first block of the written brick.
    pub(super) fn finish(self) -> u32 {
        self.first
    }
}

/// Reader of a packed brick: iterates over head numbers and samples.
pub(super) struct Reader<'a> {
    arena: &'a Arena,
    lattice: Lattice,
    block: Option<&'a [u32; ROOM + 1]>,
    at: usize,
    left: u32,
    head: usize,
    visit: u32,
    before: Spot,
}

impl<'a> Reader<'a> {
    pub(super) fn new(arena: &'a Arena, lattice: Lattice, first: u32, samples: u32) -> Self {
        let block = first.checked_sub(1).and_then(|index| arena.blocks.get(index as usize));
        Self { arena, lattice, block, at: 0, left: samples, head: 0, visit: 0, before: Spot { x: 0, arc: 0 } }
    }

    fn word(&mut self) -> Option<u32> {
        if self.at == ROOM {
            let link = self.block?.last()?;
            self.block = Some(self.arena.blocks.get(link.checked_sub(1)? as usize)?);
            self.at = 0;
        }
        let word = *self.block?.get(self.at)?;
        self.at += 1;
        Some(word)
    }

    fn spot(&mut self) -> Option<Spot> {
        let mut number = || self.word().map(|word| i64::from(word as i32));
        Some(Spot { x: number()?, arc: number()? })
    }
}

impl Iterator for Reader<'_> {
    type Item = (usize, Packed);

    fn next(&mut self) -> Option<Self::Item> {
        self.left = self.left.checked_sub(1)?;
        let (spot, start) = loop {
            let word = self.word()?;
            let [a, b, c, d] = word.to_le_bytes();
            let (lower, upper) = (u16::from_le_bytes([a, b]), u16::from_le_bytes([c, d]));
            if lower != ESCAPE {
                let spot = Spot {
                    x: self.before.x + i64::from((upper as i16) >> 1),
                    arc: self.before.arc + i64::from(lower as i16),
                };
                break (spot, (upper & 1 == 1).then_some(self.before));
            }
            match upper {
                PLACE => break (self.spot()?, None),
                STEPPED => break (self.spot()?, Some(self.spot()?)),
                VISIT => self.visit = self.word()?,
                head => self.head = usize::from(head - HEAD).min(MAX_HEADS - 1),
            }
        };
        self.before = spot;
        let (x_m, arc_m) = self.lattice.place_m(spot);
        let step_m = start.map_or([0.0; 2], |start| {
            let (from_x_m, from_arc_m) = self.lattice.place_m(start);
            [x_m - from_x_m, math::wrap_signed(arc_m - from_arc_m, self.lattice.perimeter_m)]
        });
        Some((self.head, Packed { x_m, arc_m, step_m, visit: self.visit }))
    }
}
