//! Holes as surveyors count them: the largest square of cells without a sample.

use headrace_monitor::run::Loop;

/// Empty squares of a grid, each as the chainage of its centre and its edge length, m.
pub(super) struct Squares(Vec<[f64; 2]>);

/// The largest empty square that ends at each cell of the grid over the passed wall.
pub(super) fn squares(dive: &Loop) -> Squares {
    let coverage = dive.view().coverage();
    let [along_m, around_m] = coverage.soundings.node_m();
    let edge_m = along_m.min(around_m);
    let way = coverage.sections.sections_of(coverage.frontier.way());
    let (from_m, to_m) = (coverage.sections.bounds_m(way.start).0, coverage.sections.bounds_m(way.end).0);
    let mut squares = Vec::new();
    // For each cell of the previous and the current row: the edge length, in cells, of the largest empty square that
    // ends at the cell.
    let (mut before, mut here): (Vec<u32>, Vec<u32>) = (Vec::new(), Vec::new());
    let mut row_m = f64::NEG_INFINITY;
    for node in coverage.soundings.nodes_between(from_m, to_m) {
        if node.x_m > row_m {
            row_m = node.x_m;
            std::mem::swap(&mut before, &mut here);
            here.clear();
        }
        let column = here.len();
        let cell =
            |row: &[u32], column: Option<usize>| column.and_then(|at| row.get(at).copied()).unwrap_or(0);
        let left = column.checked_sub(1);
        let least = cell(&before, Some(column)).min(cell(&before, left)).min(cell(&here, left));
        let size = if node.count == 0 { 1 + least } else { 0 };
        here.push(size);
        if size > 0 {
            let size = f64::from(size);
            squares.push([node.x_m - 0.5 * (size - 1.0) * along_m, size * edge_m]);
        }
    }
    squares.sort_unstable_by(|a, b| a[0].total_cmp(&b[0]));
    Squares(squares)
}

impl Squares {
    /// Edge length of the largest square whose centre lies between two chainages, m; 0 if there is no such square.
    pub(super) fn largest_m(&self, from_m: f64, to_m: f64) -> f64 {
        let before = |x_m: f64| self.0.partition_point(|[at_m, _]| *at_m < x_m);
        let within = self.0.get(before(from_m)..before(to_m)).unwrap_or_default();
        within.iter().map(|[_, edge_m]| *edge_m).fold(0.0, f64::max)
    }
}
