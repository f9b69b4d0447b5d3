//! Sounding density: number of samples per node of a square grid, as survey specifications require.
//!
//! A grid does not detect all gaps: a helix can fill every node and still leave strips wider than the target. The
//! density is therefore given in addition to the holes, and never replaces them.

use headrace_geometry::math;
use headrace_geometry::snapshot::stateful;
use headrace_geometry::tunnel::WallPoint;

/// Minimum number of samples that a node needs.
pub const ENOUGH: u16 = 5;
/// Default edge of a grid node, m.
pub const NODE_M: f64 = 0.5;

/// Extent and resolution of [`Soundings`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GridLayout {
    /// Perimeter of the profile, m.
    pub perimeter_m: f64,
    /// First chainage of the grid, m. Rows are aligned to chainage zero.
    pub from_m: f64,
    /// Last chainage of the grid, m.
    pub to_m: f64,
    /// Node edge along the tunnel, m.
    ///
    /// Around the perimeter, the edge is adjusted to give a whole number of nodes.
    pub node_m: f64,
}

/// Number of samples by node.
#[derive(Debug, Clone)]
pub struct Soundings {
    layout: GridLayout,
    first_row: i64,
    columns: i64,
    counts: Vec<u16>,
}

stateful!(Soundings { slots: counts; fixed: layout, first_row, columns; });

/// Number of grid nodes in a stretch, by density.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct GridSummary {
    /// Number of nodes whose centre is in the stretch.
    pub nodes: u32,
    /// Number of nodes with at least [`ENOUGH`] samples.
    pub enough: u32,
    /// Number of nodes without any sample (holidays).
    pub empty: u32,
}

/// A node of the sounding grid.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GridNode {
    /// Chainage of the node's centre, m.
    pub x_m: f64,
    /// Arc length of the node's centre, m.
    pub arc_m: f64,
    /// Number of samples on the node, at most 65,535.
    pub count: u16,
}

impl GridSummary {
    /// Share of nodes with enough samples; `None` if there are no nodes.
    pub fn enough_share(&self) -> Option<f64> {
        (self.nodes > 0).then(|| f64::from(self.enough) / f64::from(self.nodes))
    }
}

impl Soundings {
    /// Creates an empty grid.
    ///
    /// Allocates: at startup, two bytes per node. The OS maps a page when its first sample arrives.
    pub fn new(layout: GridLayout) -> Self {
        let first_row = math::floor_to_i64(layout.from_m / layout.node_m);
        let rows = (math::floor_to_i64(layout.to_m / layout.node_m) - first_row).max(0) + 1;
        let columns = math::round_to_i64(layout.perimeter_m / layout.node_m).max(1);
        let nodes = usize::try_from(rows * columns).unwrap_or(0);
        Self { layout, first_row, columns, counts: vec![0; nodes] }
    }

    /// Returns the edges of a node along the tunnel and around the perimeter, m.
    pub fn node_m(&self) -> [f64; 2] {
        [self.layout.node_m, self.layout.perimeter_m / self.columns as f64]
    }

    /// Counts a sample in its node. Returns false if the sample lies outside the grid or is not finite.
    ///
    /// Allocates: never.
    pub fn add(&mut self, at: WallPoint) -> bool {
        let inside = at.x_m >= self.layout.from_m && at.x_m <= self.layout.to_m && at.arc_m.is_finite();
        let Some(index) = inside.then(|| self.index(at)).flatten() else { return false };
        let Some(count) = self.counts.get_mut(index) else {
            debug_assert!(false, "node {index} of a sample inside is one of {}", self.counts.len());
            return false;
        };
        *count = count.saturating_add(1);
        true
    }

    fn index(&self, WallPoint { x_m, arc_m }: WallPoint) -> Option<usize> {
        let row = math::floor_to_i64(x_m / self.layout.node_m) - self.first_row;
        let into = math::wrap(arc_m, self.layout.perimeter_m) / self.node_m()[1];
        usize::try_from(row * self.columns + math::floor_to_i64(into).min(self.columns - 1)).ok()
    }

    /// Returns the nodes with their centre in chainages [`from_m`, `to_m`), row by row.
    ///
    /// Allocates: never.
    pub fn nodes_between(&self, from_m: f64, to_m: f64) -> impl Iterator<Item = GridNode> {
        let [along_m, around_m] = self.node_m();
        // Returns the first row whose centre is at or after a chainage.
        let row = |x_m: f64| -math::floor_to_i64(0.5 - x_m / along_m) - self.first_row;
        let last = i64::try_from(self.counts.len()).unwrap_or(0) / self.columns;
        (row(from_m).max(0)..row(to_m).min(last)).flat_map(move |row| {
            (0..self.columns).filter_map(move |column| {
                let index = usize::try_from(row * self.columns + column).ok()?;
                Some(GridNode {
                    x_m: ((self.first_row + row) as f64 + 0.5) * along_m,
                    arc_m: (column as f64 + 0.5) * around_m,
                    count: *self.counts.get(index)?,
                })
            })
        })
    }

    /// Returns the summary of the nodes with their centre in chainages [`from_m`, `to_m`).
    ///
    /// Allocates: never.
    pub fn summary(&self, from_m: f64, to_m: f64) -> GridSummary {
        let mut summary = GridSummary::default();
        for node in self.nodes_between(from_m, to_m) {
            summary.nodes += 1;
            summary.enough += u32::from(node.count >= ENOUGH);
            summary.empty += u32::from(node.count == 0);
        }
        summary
    }

    /// Returns the nodes without a sample whose centre is in chainages [`from_m`, `to_m`).
    ///
    /// Allocates: never.
    pub fn empty_between(&self, from_m: f64, to_m: f64) -> impl Iterator<Item = GridNode> {
        self.nodes_between(from_m, to_m).filter(|node| node.count == 0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const LAYOUT: GridLayout = GridLayout { perimeter_m: 7.3, from_m: -3.2, to_m: 20.0, node_m: 0.5 };

    fn soundings(samples: &[(f64, f64)]) -> Soundings {
        let mut soundings = Soundings::new(LAYOUT);
        for &(x_m, arc_m) in samples {
            assert!(soundings.add(WallPoint { x_m, arc_m }));
        }
        soundings
    }

    proptest! {
        /// The expected counts come from the samples within the edges of each node.
        #[test]
        fn each_grid_node_counts_the_samples_within_its_edges(
            samples in proptest::collection::vec((-3.0f64..19.0, 0.0f64..7.3), 0..400),
            from_m in -3.0f64..10.0,
            length_m in 0.0f64..8.0,
        ) {
            let soundings = soundings(&samples);
            let [along_m, around_m] = soundings.node_m();
            let on = |node: &GridNode| {
                let within = |s: &&(f64, f64)| {
                    (s.0 - node.x_m + along_m / 2.0).div_euclid(along_m).abs() < 0.5
                        && (s.1 - node.arc_m + around_m / 2.0).div_euclid(around_m).abs() < 0.5
                };
                samples.iter().filter(within).count()
            };
            let nodes: Vec<_> = soundings.nodes_between(from_m, from_m + length_m).collect();
            for node in &nodes {
                prop_assert_eq!(usize::from(node.count), on(node));
                prop_assert!(node.x_m >= from_m - 1e-9 && node.x_m < from_m + length_m + 1e-9);
            }
            let summary = soundings.summary(from_m, from_m + length_m);
            prop_assert_eq!(summary.nodes as usize, nodes.len());
            prop_assert_eq!(summary.enough as usize, nodes.iter().filter(|node| on(node) >= 5).count());
            prop_assert_eq!(summary.empty as usize, nodes.iter().filter(|node| on(node) == 0).count());
            prop_assert_eq!(soundings.empty_between(from_m, from_m + length_m).count(), summary.empty as usize);
        }

        /// Consecutive stretches contain each node exactly once.
        #[test]
        fn consecutive_stretches_contain_each_grid_node_once(section_m in 0.1f64..3.0) {
            let soundings = soundings(&[]);
            let parts: u32 = (0..6)
                .map(|k| soundings.summary(section_m * f64::from(k), section_m * f64::from(k + 1)).nodes)
                .sum();
            prop_assert_eq!(parts, soundings.summary(0.0, 6.0 * section_m).nodes);
        }
    }

    #[test]
    fn all_grid_nodes_can_have_samples_despite_a_missed_strip() {
        // Two passes run along the edges of each row of nodes. So every node has ten samples, but the strip of 0.4 m
        // between the passes has none.
        let passes = (0..20).flat_map(|k| [0.05, 0.45].map(|x_m| f64::from(k) * 0.5 + x_m));
        let samples: Vec<_> =
            passes.flat_map(|x_m| (0..73).map(move |i| (x_m, f64::from(i) * 0.1))).collect();
        let summary = soundings(&samples).summary(0.0, 10.0);
        assert_eq!((summary.nodes, summary.empty), (20 * 15, 0));
        assert_eq!(summary.enough_share(), Some(1.0));
    }

    #[test]
    fn samples_outside_the_grid_are_not_counted() {
        let mut soundings = soundings(&[]);
        for (x_m, arc_m) in [(-3.3, 0.0), (20.1, 0.0), (f64::NAN, 0.0), (0.0, f64::NAN), (0.0, f64::INFINITY)]
        {
            assert!(!soundings.add(WallPoint { x_m, arc_m }), "{x_m} {arc_m}");
        }
        assert_eq!(soundings.summary(-10.0, 30.0).empty, soundings.summary(-10.0, 30.0).nodes);
        for _ in 0..70_000 {
            soundings.add(WallPoint { x_m: 1.0, arc_m: -0.1 });
        }
        let most = soundings.nodes_between(1.0, 1.5).map(|node| node.count).max();
        assert_eq!(most, Some(u16::MAX));
        assert_eq!(GridSummary::default().enough_share(), None);
    }
}
