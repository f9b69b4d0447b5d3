//! Two hundred short dives of all kinds. They are simulated once, for the tests of holes and the tests of flags.

use std::sync::LazyLock;

use headrace_tests::instrumented::{self, Dive};
use headrace_tests::random_dives::{Seeded, seeded};

const SEEDS: u64 = 200;

pub(crate) static DIVES: LazyLock<Vec<(Seeded, Dive)>> = LazyLock::new(|| {
    let dive = |seed| {
        let seeded = seeded(seed);
        let dive = instrumented::dive(&seeded.vehicle, &seeded.scene);
        (seeded, dive)
    };
    (0..SEEDS).map(dive).collect()
});
