//! Unpacked samples near the vehicle, in linked lists by cell and by head.
//!
//! A brick is a stretch of wall, at least a metre long, that is divided into cells. An open brick holds its samples
//! unpacked.

use serde::{Deserialize, Serialize};

use super::packed::Packed;
use headrace_geometry::snapshot::stateful;
use headrace_sampling::head::MAX_HEADS;

/// List link: index of a node plus one. Zero means none.
type Link = u32;

/// A sample in the common pool of the open bricks.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
pub(super) struct Node {
    /// Chainage of the sample, m.
    pub x_m: f64,
    /// Arc length of the sample, in [0, perimeter), m.
    pub arc_m: f64,
    /// Single step from the previous sample, along the tunnel and along the perimeter, m. Zero without a step.
    pub step_m: [f64; 2],
    /// Number of the visit that measured the sample.
    pub visit: u32,
    next_in_cell: Link,
    next_of_head: Link,
}

impl Node {
    /// Returns the sample in this node of a linked list.
    pub(super) fn sample(&self) -> Packed {
        let Self { x_m, arc_m, step_m, visit, .. } = *self;
        Packed { x_m, arc_m, step_m, visit }
    }
}

/// A cell of an open brick. A brick is a stretch of wall; if it is open, its samples are unpacked.
#[derive(Debug, Clone, Copy)]
pub(super) struct CellAt {
    /// Index of the slot that holds the cell's brick.
    pub slot: usize,
    /// Row of the cell within the brick.
    pub row: usize,
    /// Column of the cell.
    pub column: usize,
}

/// List of a cell's samples.
#[derive(Debug, Clone, Copy, Default, Serialize, Deserialize)]
struct Cell {
    latest: Link,
    count: u32,
}

/// List of a head's samples in a brick, in order of arrival.
#[derive(Debug, Clone, Copy, Default, Serialize, Deserialize)]
struct Chain {
    first: Link,
    last: Link,
}

/// A fixed number of open bricks, which are stretches of wall near the vehicle. Their unpacked samples share one pool.
#[derive(Debug, Clone)]
pub(super) struct OpenBricks {
    rows: usize,
    columns: usize,
    cells: Vec<Cell>,
    /// For each column of a slot, bitmask of the rows that have samples.
    rows_seen: Vec<u32>,
    chains: Vec<[Chain; MAX_HEADS]>,
    /// Number of the brick in each slot; `None` for an empty slot.
    bricks: Vec<Option<u32>>,
    nodes: Vec<Node>,
    most_nodes: usize,
    /// Free list of pool nodes. It is linked in the same way as the list of a cell.
    free: Link,
    used: usize,
}

stateful!(OpenBricks { state: free, used; lists: nodes; slots: cells, rows_seen, chains, bricks; fixed: rows, columns, most_nodes; });

impl OpenBricks {
    /// Creates the pool for the samples of up to `slots` open bricks. None is open yet. Allocates: at startup only.
    pub(super) fn new(slots: usize, (rows, columns): (usize, usize), most_nodes: usize) -> Self {
        Self {
            rows,
            columns,
            cells: vec![Cell::default(); slots * rows * columns],
            rows_seen: vec![0; slots * columns],
            chains: vec![[Chain::default(); MAX_HEADS]; slots],
            bricks: vec![None; slots],
            nodes: Vec::with_capacity(most_nodes),
            most_nodes,
            free: 0,
            used: 0,
        }
    }

    /// Number of samples for which the pool still has room.
    pub(super) fn room(&self) -> usize {
        self.most_nodes - self.used
    }

    /// Number of samples in the open bricks.
    pub(super) fn used(&self) -> usize {
        self.used
    }

    /// Number of bytes that have ever been used.
    pub(super) fn touched_bytes(&self) -> usize {
        self.nodes.len() * size_of::<Node>() + self.cells.len() * size_of::<Cell>()
    }

    /// Returns a slot that holds no brick.
    pub(super) fn free_slot(&self) -> Option<usize> {
        self.bricks.iter().position(Option::is_none)
    }

    /// Returns slot and number of the open brick that is farthest from brick number `brick`.
    pub(super) fn farthest_from(&self, brick: u32) -> Option<(usize, u32)> {
        let held = self.bricks.iter().enumerate().filter_map(|(slot, held)| Some((slot, (*held)?)));
        held.filter(|(_, held)| *held != brick).max_by_key(|(_, held)| held.abs_diff(brick))
    }

    /// Assigns a slot to a brick without samples.
    pub(super) fn place(&mut self, slot: usize, brick: u32) {
        if let Some(held) = self.bricks.get_mut(slot) {
            debug_assert!(held.is_none(), "slot {slot} is empty before it holds brick {brick}: {held:?}");
            *held = Some(brick);
        }
    }

    /// Whether a slot holds brick number `brick`.
    pub(super) fn holds(&self, slot: usize, brick: u32) -> bool {
        self.bricks.get(slot) == Some(&Some(brick))
    }

    /// Adds a sample of a head to a cell of a slot. Returns false if there is no room.
    pub(super) fn add(&mut self, at: CellAt, head: usize, sample: &Packed) -> bool {
        let Packed { x_m, arc_m, step_m, visit } = *sample;
        let index = self.index(at);
        debug_assert!(
            at.row < self.rows && at.column < self.columns,
            "a sample is in a cell of a brick: {at:?}"
        );
        let Some(list) = self.cells.get_mut(index) else {
            debug_assert!(false, "cell {index} is one of {}", self.cells.len());
            return false;
        };
        let node = Node { x_m, arc_m, step_m, visit, next_in_cell: list.latest, next_of_head: 0 };
        let link = self.free;
        let link =
            if let Some(unused) = link.checked_sub(1).and_then(|index| self.nodes.get_mut(index as usize)) {
                self.free = unused.next_in_cell;
                *unused = node;
                link
            } else if self.nodes.len() < self.most_nodes {
                self.nodes.push(node);
                u32::try_from(self.nodes.len()).unwrap_or(0)
            } else {
                return false;
            };
        list.latest = link;
        list.count += 1;
        self.used += 1;
        if let Some(rows) = self.rows_seen.get_mut(at.slot * self.columns + at.column) {
            *rows |= 1 << at.row;
        }
        let chain = self.chains.get_mut(at.slot).and_then(|chains| chains.get_mut(head.min(MAX_HEADS - 1)));
        if let Some(chain) = chain {
            match chain.last.checked_sub(1).and_then(|index| self.nodes.get_mut(index as usize)) {
                Some(last) => last.next_of_head = link,
                None => chain.first = link,
            }
            chain.last = link;
        }
        true
    }

    fn index(&self, at: CellAt) -> usize {
        (at.slot * self.rows + at.row) * self.columns + at.column
    }

    /// Returns the bitmask of the rows that have samples in a column of a slot.
    pub(super) fn rows_seen(&self, slot: usize, column: usize) -> u32 {
        self.rows_seen.get(slot * self.columns + column).copied().unwrap_or(0)
    }

    /// Number of samples in a cell of a slot.
    pub(super) fn count(&self, at: CellAt) -> u32 {
        self.cells.get(self.index(at)).map_or(0, |list| list.count)
    }

    /// Returns the samples of a cell of a slot. The latest comes first.
    pub(super) fn in_cell(&self, at: CellAt) -> impl Iterator<Item = &Node> {
        let latest = self.cells.get(self.index(at)).map_or(0, |list| list.latest);
        self.list(latest, |node| node.next_in_cell)
    }

    /// Returns the samples of a head in a slot. The earliest comes first.
    pub(super) fn of_head(&self, slot: usize, head: usize) -> impl Iterator<Item = &Node> {
        let chain = self.chains.get(slot).and_then(|chains| chains.get(head));
        self.list(chain.map_or(0, |chain| chain.first), |node| node.next_of_head)
    }

    fn list(&self, first: Link, next: impl Fn(&Node) -> Link) -> impl Iterator<Item = &Node> {
        let node = |link: Link| self.nodes.get(link.checked_sub(1)? as usize);
        core::iter::successors(node(first), move |before| node(next(before)))
    }

    /// Removes all samples of a slot.
    pub(super) fn clear(&mut self, slot: usize) {
        let per_brick = self.rows * self.columns;
        let Self { cells, nodes, free, used, .. } = self;
        for list in cells.iter_mut().skip(slot * per_brick).take(per_brick) {
            let mut link = list.latest;
            let mut freed = 0;
            while let Some(node) = link.checked_sub(1).and_then(|index| nodes.get_mut(index as usize)) {
                let next = node.next_in_cell;
                node.next_in_cell = *free;
                *free = link;
                *used -= 1;
                freed += 1;
                link = next;
            }
            debug_assert!(freed == list.count, "a cell's list has {} samples: {freed}", list.count);
            *list = Cell::default();
        }
        self.rows_seen.iter_mut().skip(slot * self.columns).take(self.columns).for_each(|rows| *rows = 0);
        if let Some(chains) = self.chains.get_mut(slot) {
            *chains = [Chain::default(); MAX_HEADS];
        }
        if let Some(held) = self.bricks.get_mut(slot) {
            *held = None;
        }
    }
}
