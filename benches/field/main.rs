//! Compares verdicts and standard deviations of simulated field dives with the truth.
//!
//! `cargo bench -p headrace_tests --bench field` runs all cells in a quarter of an hour on two cores. It prints them as
//! CSV, followed by the sections that passed although their true hole exceeds the target. docs/why/field.md explains
//! the columns. Arguments, after `--`:
//! - `--quick`: a tenth of the dives
//! - `--cell VEHICLE/CONDITION/PLACE/SPEED`: only these cells. Any part may be `*`, trailing parts may be left out, and
//!   a place may be any chainage
//! - `--seeds N`, `--from-seed N`: number of dives of each cell, and the first seed
//! - `--metres N`: length of each dive
//! - `--json FILE`: where to write all figures (target/field.json)
//! - `--csv docs/why/field.csv`: rewrites the documented table, whose rows combine all places
//!
//! The true hole D_true comes from `headrace_tests::truth`, which shares no code with the program's coverage. All other
//! figures come from the report.

#![expect(clippy::unwrap_used, clippy::panic, reason = "a failed step ends the benchmark")]

mod arguments;
mod goals;
mod table;

use std::sync::atomic::{AtomicUsize, Ordering};

use headrace_tests::field_table::{self, Figures};

use arguments::Arguments;
use table::NamedCell;

fn main() {
    let arguments = Arguments::of(std::env::args().skip(1));
    let cells = table::cells(&arguments);
    assert!(!cells.is_empty(), "no cell of the table matches --cell VEHICLE/CONDITION/PLACE/SPEED");
    let figures = run(&cells, &arguments);
    print!("{}\n{}", table::csv(&cells, &figures), table::falsely(&cells, &figures));
    if let Some(file) = &arguments.csv {
        let (cells, figures) = table::pooled(&cells, &figures);
        std::fs::write(file, table::csv(&cells, &figures)).unwrap();
    }
    table::write_json(&cells, &figures, &arguments);
}

/// Figures of all cells, computed on all cores.
fn run(cells: &[NamedCell], arguments: &Arguments) -> Vec<Figures> {
    let next = AtomicUsize::new(0);
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let work = || {
        let mut done = Vec::new();
        loop {
            let number = next.fetch_add(1, Ordering::Relaxed);
            let Some(NamedCell { cell, .. }) = cells.get(number) else { return done };
            // A dive of several hours is simulated with one seed only.
            let count = if cell.let_in_m.is_some() { 1 } else { arguments.seeds };
            let seeds = arguments.from_seed..arguments.from_seed + count;
            let length_m = arguments.metres.unwrap_or(cell.vehicle.length_m);
            done.push((number, field_table::figures(cell, seeds, length_m)));
            eprint!("\r{} of {} cells", number + 1, cells.len());
        }
    };
    let mut all: Vec<(usize, Figures)> = std::thread::scope(|scope| {
        let threads: Vec<_> = (0..cores).map(|_| scope.spawn(work)).collect();
        threads.into_iter().flat_map(|thread| thread.join().unwrap()).collect()
    });
    eprintln!();
    all.sort_by_key(|(number, _)| *number);
    all.into_iter().map(|(_, figures)| figures).collect()
}
