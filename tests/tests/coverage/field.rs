//! A tenth of the table of field dives: what must never be, in cells that take little time.
//! `cargo bench -p headrace_benches --bench field` makes the whole table.

use headrace_tests::field_table::{self, Cell, Condition, Driven, Figures, KINDS_OF_SOURCES, VEHICLES};

fn print(name: &str, figures: &Figures) {
    let nis = (0..KINDS_OF_SOURCES.len()).map(|kind| figures.nis(kind).map_or(f64::NAN, |nis| nis));
    println!(
        "| {name} | {} over, {} passed, {} far | {}/{} failed under 0.9 T | pass {:.2} fail {:.2} cannot say {:.2} open {:.2} | \
         err {:.3} sd {:.3} rms {:.2} within {:.2} | NIS {:.2?} | told {:.2} of {:.2} |",
        figures.over,
        figures.passed_over,
        figures.passed_far,
        figures.failed_under,
        figures.under,
        figures.share(0),
        figures.share(1),
        figures.share(2),
        figures.share(3),
        figures.error_m(),
        figures.sd_m(),
        figures.ratio_rms(),
        figures.within(2.0),
        nis.collect::<Vec<_>>(),
        figures.way_m[1],
        figures.way_m[0],
    );
}

/// None passes that is far over the target, and of those over it at most one in forty.
#[test]
fn val_what_passes_is_within_the_target() {
    let vehicle = VEHICLES.into_iter().find(|vehicle| vehicle.name == "vita2-4").unwrap();
    for condition in [Condition::Clean, Condition::DataSheet, Condition::Lively] {
        for start_m in [16.0, 6900.0] {
            for driven in [Driven::Planned, Driven::Times(1.2)] {
                let cell = Cell { vehicle, condition, start_m, driven };
                let figures = field_table::figures(&cell, [1], 15.0);
                let name = format!("{condition:?} {start_m} {driven:?}");
                print(&name, &figures);
                assert!(figures.over > 0 && figures.inner_m > 5.0, "{name}: {figures:?}");
                assert_eq!(figures.passed_far, 0, "{name}");
                assert!(
                    figures.false_passes() <= 0.025,
                    "{name}: {} of {}",
                    figures.passed_over,
                    figures.over
                );
            }
        }
    }
}
