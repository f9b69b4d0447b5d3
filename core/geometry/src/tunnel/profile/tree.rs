//! Tree of boxes over a profile's elements, for queries in logarithmic time.
//!
//! A search skips only elements that cannot affect the result, so results are bit-identical to those of a full
//! search.

use super::element::{Element, Shape};
use super::plane::{Yz, norm};

/// Number of elements in a leaf of the tree. They are neighbours along the wall.
const LEAF: usize = 8;
/// Number of elements up to which a profile has no tree, because searching all of them is as fast.
const FEW: usize = 24;
/// Margin of the boxes around their elements, m. It is far larger than rounding errors and `ARC_SLACK_RAD`.
const MARGIN_M: f64 = 1e-6;
/// Depth of a tree over the largest supported number of elements.
const DEPTH: usize = 40;

/// A bounding box around elements of the profile.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Bounds {
    low: Yz,
    high: Yz,
}

/// The bounding boxes of the tree.
///
/// Node 1 contains all elements, and nodes 2 i and 2 i + 1 contain the halves of node i. `leaves` is the number of
/// leaves. A profile of few elements has an empty tree.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct Tree {
    nodes: Vec<Bounds>,
    leaves: usize,
}

impl Bounds {
    const EMPTY: Self = Self { low: [f64::INFINITY; 2], high: [f64::NEG_INFINITY; 2] };

    /// The box of an arc contains the whole circle, because that box is simpler to compute.
    fn of(element: &Element) -> Self {
        let Element { start, end, .. } = *element;
        let of = |place: fn(f64, f64) -> f64, off: f64| {
            let ends = [place(start[0], end[0]) + off, place(start[1], end[1]) + off];
            let Shape::Arc { centre, radius_m, .. } = element.shape else { return ends };
            let reach_m = radius_m * off.signum() + off;
            [place(ends[0], centre[0] + reach_m), place(ends[1], centre[1] + reach_m)]
        };
        Self { low: of(f64::min, -MARGIN_M), high: of(f64::max, MARGIN_M) }
    }

    fn with(self, other: Self) -> Self {
        let each = |of: fn(f64, f64) -> f64, a: Yz, b: Yz| [of(a[0], b[0]), of(a[1], b[1])];
        Self { low: each(f64::min, self.low, other.low), high: each(f64::max, self.high, other.high) }
    }

    /// Ray parameter at which the ray enters the box: zero from inside, infinite if the ray misses the box.
    pub(super) fn entry(&self, origin: Yz, direction: Yz) -> f64 {
        let (mut from, mut to) = (0.0, f64::INFINITY);
        for (((low, high), at), along) in self.low.iter().zip(&self.high).zip(origin).zip(direction) {
            if along == 0.0 {
                if at < *low || at > *high {
                    return f64::INFINITY;
                }
                continue;
            }
            let (one, other) = ((low - at) / along, (high - at) / along);
            from = f64::max(from, one.min(other));
            to = f64::min(to, one.max(other));
        }
        if from <= to { from } else { f64::INFINITY }
    }

    /// Returns the distance from a point to the box, m; zero inside.
    pub(super) fn distance_m(&self, point: Yz) -> f64 {
        let off = |axis: usize| {
            let (low, high, at) = (self.low[axis], self.high[axis], point[axis]);
            f64::max(low - at, at - high).max(0.0)
        };
        norm([off(0), off(1)])
    }
}

impl Tree {
    pub(super) fn over(elements: &[Element]) -> Self {
        if elements.len() <= FEW {
            return Self::default();
        }
        let leaves = elements.len().div_ceil(LEAF).next_power_of_two();
        let mut nodes = vec![Bounds::EMPTY; 2 * leaves];
        for (node, some) in nodes.iter_mut().skip(leaves).zip(elements.chunks(LEAF)) {
            *node = some.iter().fold(Bounds::EMPTY, |all, element| all.with(Bounds::of(element)));
        }
        for node in (1..leaves).rev() {
            let halves = [nodes.get(2 * node), nodes.get(2 * node + 1)];
            let both = halves.into_iter().flatten().fold(Bounds::EMPTY, |all, half| all.with(*half));
            if let Some(node) = nodes.get_mut(node) {
                *node = both;
            }
        }
        Self { nodes, leaves }
    }

    /// Visits ranges of element indices that may contain a better result than the best one found so far.
    ///
    /// `bound` returns the least cost that an element in a box may have. `look` visits a range and returns the lowest
    /// cost so far. If several elements have the lowest cost, all of them are visited.
    pub(super) fn search(
        &self,
        count: usize,
        bound: impl Fn(&Bounds) -> f64,
        mut look: impl FnMut(core::ops::Range<usize>) -> f64,
    ) {
        if self.nodes.is_empty() {
            look(0..count);
            return;
        }
        let mut best = f64::INFINITY;
        let cost = |node: usize| match self.nodes.get(node) {
            Some(bounds) if *bounds != Bounds::EMPTY => bound(bounds),
            _ => f64::INFINITY,
        };
        let mut stack = [(0, 0.0); DEPTH];
        let mut waiting = 0;
        let wait = |stack: &mut [(usize, f64); DEPTH], waiting: &mut usize, node: usize, cost: f64| {
            debug_assert!(
                *waiting < DEPTH,
                "a search waits for at most {DEPTH} nodes; node {node} is one more"
            );
            if let Some(slot) = stack.get_mut(*waiting) {
                *slot = (node, cost);
                *waiting += 1;
            }
        };
        wait(&mut stack, &mut waiting, 1, cost(1));
        while waiting > 0 {
            waiting -= 1;
            let (node, least) = stack.get(waiting).copied().unwrap_or_default();
            if least > best || least == f64::INFINITY {
                continue;
            }
            if node >= self.leaves {
                let from = (node - self.leaves) * LEAF;
                best = look(from..(from + LEAF).min(count));
                continue;
            }
            let (first, second) = ((2 * node, cost(2 * node)), (2 * node + 1, cost(2 * node + 1)));
            let (near, far) = if first.1 <= second.1 { (first, second) } else { (second, first) };
            wait(&mut stack, &mut waiting, far.0, far.1);
            wait(&mut stack, &mut waiting, near.0, near.1);
        }
    }
}
