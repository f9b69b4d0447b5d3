//! Command-line arguments of the bench.

use std::path::PathBuf;

use headrace_tests::field_table::PLACES;

/// Number of dives of each cell: first in a full run, then with `--quick`. A full run takes a quarter of an hour on two
/// cores.
const SEEDS: [u64; 2] = [2, 1];
/// Vehicles that dive in a run with `--quick`. Such a run also leaves out the place in the middle of the tunnel.
const QUICK_VEHICLES: [&str; 2] = ["vita1", "vita2-4"];

/// Command-line arguments of a run.
pub(crate) struct Arguments {
    /// Whether to run only a tenth of the dives.
    pub(crate) quick: bool,
    /// Parts of the names of the selected cells. `*` matches any part.
    pub(crate) cell: Vec<String>,
    /// Number of dives of each cell.
    pub(crate) seeds: u64,
    /// Seed of the first dive of each cell.
    pub(crate) from_seed: u64,
    /// Length of each dive, m. It overrides the default length of the vehicle's dives.
    pub(crate) metres: Option<f64>,
    /// JSON file to which the figures of all cells are written.
    pub(crate) json: PathBuf,
    /// CSV file for the table in which each row combines all places. If it is `None`, the table isn't written.
    pub(crate) csv: Option<PathBuf>,
}

impl Arguments {
    pub(crate) fn of(words: impl Iterator<Item = String>) -> Self {
        // Cargo adds the argument `--bench`, which is ignored.
        let mut words = words.filter(|word| word != "--bench");
        let mut seeds = None;
        let json = headrace_tests::root().join("target/field.json");
        let mut all =
            Self { quick: false, cell: Vec::new(), seeds: 0, from_seed: 1, metres: None, json, csv: None };
        while let Some(word) = words.next() {
            if word == "--quick" {
                all.quick = true;
                continue;
            }
            let value = words.next().unwrap_or_else(|| panic!("{word} needs a value"));
            let number =
                || value.parse().unwrap_or_else(|_| panic!("{word} {value}: must be a whole number"));
            match word.as_str() {
                "--cell" => all.cell = value.split('/').map(str::to_owned).collect(),
                "--seeds" => seeds = Some(number()),
                "--from-seed" => all.from_seed = number(),
                "--metres" => {
                    let metres =
                        value.parse().unwrap_or_else(|_| panic!("--metres {value}: must be a number"));
                    all.metres = Some(metres);
                }
                "--json" => all.json = PathBuf::from(value),
                "--csv" => all.csv = Some(headrace_tests::root().join(value)),
                _ => {
                    panic!("{word}: known are --quick, --cell, --seeds, --from-seed, --metres, --json, --csv")
                }
            }
        }
        all.seeds = seeds.unwrap_or(SEEDS[usize::from(all.quick)]);
        all
    }

    /// Whether the arguments select the cell with this name.
    pub(crate) fn wants(&self, name: &[&str]) -> bool {
        let named = |(part, wanted): (&&str, &String)| wanted == "*" || wanted == part;
        let skipped = self.quick && self.cell.is_empty() && {
            name.first().is_some_and(|vehicle| !QUICK_VEHICLES.contains(vehicle))
                || name.get(2) == Some(&"3000")
        };
        !skipped && name.iter().zip(&self.cell).all(named)
    }

    /// Place that the arguments select by its chainage, if it isn't one of the table's places.
    pub(crate) fn own_place_m(&self) -> Option<(&str, f64)> {
        let place = self.cell.get(2).filter(|place| PLACES.iter().all(|(known, _)| known != place))?;
        Some((place, place.parse().ok()?))
    }
}
