//! Relief: places where heads recently found wall that deviates from the design. This module also counts votes of the
//! heads on each other.
//!
//! A vote compares the returns of two heads in the same bin of the wall. If one head contradicts the design there and
//! another agrees with it, the first is outvoted.

use serde::{Deserialize, Serialize};

use super::wall_limits::{PlacedReturn, WallLimits};
use headrace_geometry::math;
use headrace_geometry::snapshot::stateful;
use headrace_sampling::head::MAX_HEADS;

/// Number of bins around the perimeter. A bin is about as wide as the step of a head.
const BINS: i64 = 128;
/// Number of bins along the tunnel. Each bin is half of `WallLimits::reach_m` long.
///
/// In a tunnel of 6 m radius, the bins are together 9 m long, which exceeds the distance between heads.
const SLABS: i64 = 32;

/// A pass that met something. It is given by the head, and by the angle that the head had turned since the dive began,
/// rad.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub(super) struct Pass {
    pub(super) head: u8,
    pub(super) turned_rad: f64,
}

impl Pass {
    /// Whether two passes differ: two heads made them, or one head made them more than half a turn apart.
    fn is_other(&self, other: &Self) -> bool {
        self.head != other.head || (self.turned_rad - other.turned_rad).abs() > math::TAU / 2.0
    }
}

/// A return that deviates from the design, stored as support for later passes.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub(super) struct Found {
    placed: PlacedReturn,
    /// Whether the return was classified as wall.
    is_wall: bool,
    /// Number of passes that met the same thing here, including `pass`.
    passes: u8,
    pass: Pass,
}

impl Found {
    /// Creates the record of a return. `confirmed` is the number of earlier passes that met the same thing.
    pub(super) fn new(placed: &PlacedReturn, is_wall: bool, confirmed: u8, pass: Pass) -> Self {
        Self { placed: *placed, is_wall, passes: confirmed.saturating_add(1), pass }
    }
}

/// Recent returns in one bin of the wall.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
struct Cell {
    /// Number of the slab (row of bins) to which the entries belong, counted from chainage zero. The entries are
    /// outdated if the bin now belongs to another slab.
    slab: i64,
    /// The latest return that deviates from the design.
    off: Option<Found>,
    /// Bitmasks of the heads whose returns in this bin agree with the design, and of those whose returns contradict it.
    as_designed: u8,
    contradicting: u8,
}

/// Votes of the other heads on one head. Each vote comes from a bin of the wall that both heads have seen.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Ballot {
    /// Number of bins in which the head and other heads agree with the design.
    agreed: u32,
    /// Number of bins in which the head contradicts the design but other heads agree with it.
    outvoted: u32,
    /// Sum of the deviations in the bins in which the head was outvoted, m, and smallest and largest chainage of these
    /// bins, m.
    off_sum_m: f64,
    between_m: Option<[f64; 2]>,
}

/// Number of votes that suffice to decide whether a head is outvoted: about one for each bin of a turn.
const FULL_BALLOT: u32 = 128;

impl Ballot {
    fn add(&mut self, outvoted: Option<&PlacedReturn>) {
        if self.agreed + self.outvoted >= 2 * FULL_BALLOT {
            (self.agreed, self.outvoted) = (self.agreed / 2, self.outvoted / 2);
            self.off_sum_m /= 2.0;
            if !self.is_lost() {
                self.between_m = None;
            }
        }
        let Some(placed) = outvoted else {
            self.agreed += 1;
            return;
        };
        self.outvoted += 1;
        self.off_sum_m += placed.off_m;
        let [from_m, to_m] = self.between_m.unwrap_or([placed.x_m; 2]);
        self.between_m = Some([from_m.min(placed.x_m), to_m.max(placed.x_m)]);
    }

    /// Returns the mean deviation of the bins in which the head was outvoted, m, and their smallest and largest
    /// chainage, m.
    ///
    /// `None` unless enough bins have votes and the head was outvoted in most of them.
    pub(super) fn verdict(&self) -> Option<(f64, [f64; 2])> {
        let lost = self.agreed + self.outvoted >= FULL_BALLOT && self.outvoted > self.agreed;
        lost.then(|| Some((self.off_sum_m / f64::from(self.outvoted), self.between_m?))).flatten()
    }

    /// Whether the head was outvoted in more than a quarter of the bins with votes.
    pub(super) fn is_lost(&self) -> bool {
        4 * self.outvoted > self.agreed + self.outvoted
    }
}

/// The relief of the wall near the vehicle, and the votes on each head.
#[derive(Debug, Clone)]
pub struct Relief {
    cells: Vec<Cell>,
    ballots: [Ballot; MAX_HEADS],
    /// Bitmask of heads that are not trusted.
    distrusted: u8,
    /// Bitmask of heads whose range varies when the range to the design does.
    changing: u8,
}

stateful!(Relief { state: ballots, distrusted, changing; slots: cells; });

impl Default for Relief {
    /// Creates an empty relief.
    ///
    /// Allocates: all memory that it will ever use.
    fn default() -> Self {
        let nowhere = Cell { slab: i64::MIN, ..Cell::default() };
        let count = usize::try_from(BINS * SLABS).unwrap_or(0);
        Self {
            cells: vec![nowhere; count],
            ballots: [Ballot::default(); MAX_HEADS],
            distrusted: 0,
            changing: 0,
        }
    }
}

fn bit(head: usize) -> u8 {
    1_u8.checked_shl(u32::try_from(head).unwrap_or(u32::MAX)).unwrap_or(0)
}

fn set(bits: &mut u8, head: usize, on: bool) {
    *bits = if on { *bits | bit(head) } else { *bits & !bit(head) };
}

impl Relief {
    /// Whether wall with the same deviation from the design was found near this return.
    pub(super) fn is_wall(&self, placed: &PlacedReturn, limits: &WallLimits) -> bool {
        self.near(placed, limits, 1.0).any(|found| found.is_wall)
    }

    /// Whether another head found wall with the same deviation from the design near this return.
    pub(super) fn is_wall_of_another(&self, placed: &PlacedReturn, head: u8, limits: &WallLimits) -> bool {
        self.near(placed, limits, 1.0).any(|found| found.is_wall && found.pass.head != head)
    }

    /// Number of earlier passes that met the same thing near this return, be it wall or not.
    pub(super) fn confirmed(&self, placed: &PlacedReturn, pass: &Pass, limits: &WallLimits) -> u8 {
        let others = self.near(placed, limits, 0.5).filter(|found| found.pass.is_other(pass));
        others.map(|found| found.passes).max().unwrap_or(0)
    }

    /// Earlier returns near this return with the same deviation from the design.
    ///
    /// `share` multiplies the limits: the reach along the tunnel, and the tolerance of the deviation.
    fn near(
        &self,
        placed: &PlacedReturn,
        limits: &WallLimits,
        share: f64,
    ) -> impl Iterator<Item = &Found> + use<'_> {
        let (slab, bin) = place(placed, limits);
        let (placed, reach_m, tolerance_m) = (*placed, share * limits.reach_m, share * limits.tolerance_m);
        let cells =
            (slab - 2..=slab + 2).flat_map(move |slab| (bin - 1..=bin + 1).map(move |bin| (slab, bin)));
        let found = cells.filter_map(move |(slab, bin)| self.cell(slab, bin)?.off.as_ref());
        found.filter(move |Found { placed: other, .. }| {
            (other.x_m - placed.x_m).abs() <= reach_m && (other.off_m - placed.off_m).abs() <= tolerance_m
        })
    }

    /// Stores a return that deviates from the design as support for later passes.
    pub(super) fn remember(&mut self, found: &Found, limits: &WallLimits) {
        if limits.is_design(&found.placed) {
            return;
        }
        let (slab, bin) = place(&found.placed, limits);
        if let Some(cell) = self.cell_mut(slab, bin) {
            cell.off = Some(*found);
        }
    }

    /// Counts the votes that follow from a head's return: on this head, and on other heads that have seen the same bin.
    pub(super) fn vote(&mut self, head: usize, placed: &PlacedReturn, limits: &WallLimits) {
        let (slab, bin) = place(placed, limits);
        // Returns between half and all of the contradiction limit do not vote. With a single limit, mere noise would
        // make heads disagree.
        let as_designed = placed.off_m.abs() <= limits.contradiction_m / 2.0;
        if !as_designed && placed.off_m.abs() <= limits.contradiction_m {
            return;
        }
        let (me, distrusted) = (bit(head), self.distrusted);
        let Some(cell) = self.cell_mut(slab, bin) else {
            debug_assert!(false, "bin {bin} of slab {slab} has a place");
            return;
        };
        if as_designed && cell.off.is_some_and(|found| !found.is_wall) {
            // This head agrees with the design here. So the unconfirmed object of earlier returns is gone.
            cell.off = None;
        }
        let seen = if as_designed { &mut cell.as_designed } else { &mut cell.contradicting };
        if *seen & me != 0 {
            return;
        }
        *seen |= me;
        let Cell { as_designed: agreeing, contradicting, off, .. } = *cell;
        let off = off.map_or(*placed, |found| found.placed);
        let others_agree = agreeing & !me & !distrusted != 0;
        if !as_designed {
            if others_agree && agreeing & me == 0 {
                self.count(head, Some(placed));
            }
            return;
        }
        if others_agree {
            self.count(head, None);
        }
        if distrusted & me != 0 {
            return;
        }
        for other in (0..MAX_HEADS).filter(|other| *other != head) {
            if agreeing & bit(other) != 0 {
                self.count(other, None);
            } else if contradicting & bit(other) != 0 {
                self.count(other, Some(&off));
            }
        }
    }

    fn count(&mut self, head: usize, outvoted: Option<&PlacedReturn>) {
        if let Some(ballot) = self.ballots.get_mut(head) {
            ballot.add(outvoted);
        }
    }

    /// Returns the votes on a head.
    pub(super) fn ballot(&self, head: usize) -> Ballot {
        debug_assert!(head < MAX_HEADS, "head {head} is one of {MAX_HEADS}");
        self.ballots.get(head).copied().unwrap_or_default()
    }

    /// Sets whether the votes of this head on other heads count.
    pub(super) fn believe(&mut self, head: usize, believed: bool) {
        set(&mut self.distrusted, head, !believed);
    }

    /// Records whether the range of a head varies when the range to the design does.
    pub(super) fn note_changing(&mut self, head: usize, changes: bool) {
        set(&mut self.changing, head, changes);
    }

    /// Whether the range of another head varies when the range to the design does.
    ///
    /// Then an error of the estimated position does not explain a constant range of `head`.
    pub(super) fn others_change(&self, head: usize) -> bool {
        self.changing & !bit(head) != 0
    }

    fn cell(&self, slab: i64, bin: i64) -> Option<&Cell> {
        self.cells.get(index(slab, bin)?).filter(|cell| cell.slab == slab)
    }

    /// Returns the cell of a bin, and empties it if it belonged to another slab.
    fn cell_mut(&mut self, slab: i64, bin: i64) -> Option<&mut Cell> {
        let cell = self.cells.get_mut(index(slab, bin)?)?;
        if cell.slab != slab {
            *cell = Cell { slab, ..Cell::default() };
        }
        Some(cell)
    }
}

/// Returns the slab along the tunnel and the bin around the perimeter.
fn place(placed: &PlacedReturn, limits: &WallLimits) -> (i64, i64) {
    let slab = math::floor_to_i64(2.0 * placed.x_m / limits.reach_m);
    (slab, math::floor_to_i64(placed.arc_m / limits.perimeter_m * BINS as f64))
}

fn index(slab: i64, bin: i64) -> Option<usize> {
    usize::try_from(slab.rem_euclid(SLABS) * BINS + bin.rem_euclid(BINS)).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A head that fails late in a dive is outvoted after two turns with wrong returns, but not after one.
    #[test]
    fn head_that_fails_late_is_outvoted_within_two_turns() {
        let wrong = PlacedReturn { x_m: 7.0, arc_m: 0.0, off_m: -0.5 };
        let mut ballot = Ballot::default();
        (0..1027).for_each(|_| ballot.add(None));
        (0..125).for_each(|_| ballot.add(Some(&wrong)));
        assert_eq!(ballot.verdict(), None, "{ballot:?}");
        (0..125).for_each(|_| ballot.add(Some(&wrong)));
        let (off_m, between_m) = ballot.verdict().unwrap();
        assert!((off_m + 0.5).abs() < 0.05, "{off_m}");
        assert!(between_m.iter().all(|x_m| (x_m - 7.0).abs() < 1e-12), "{between_m:?}");
    }

    /// A head that contradicts another head is outvoted, unless that other head is itself distrusted.
    #[test]
    fn distrusted_head_does_not_outvote_other_heads() {
        let limits = WallLimits::new(20.0, 0.3, 2.0);
        let of = |off_m: f64| PlacedReturn { x_m: 7.0, arc_m: 3.0, off_m };
        let outvoted = |believed: bool| {
            let mut relief = Relief::default();
            relief.believe(1, believed);
            relief.vote(1, &of(0.0), &limits);
            relief.vote(0, &of(-1.0), &limits);
            relief.ballot(0).outvoted
        };
        assert_eq!([outvoted(true), outvoted(false)], [1, 0]);
        let mut relief = Relief::default();
        relief.believe(1, false);
        relief.believe(1, true);
        assert_eq!(relief.distrusted, 0, "the head is trusted again");
    }
}
