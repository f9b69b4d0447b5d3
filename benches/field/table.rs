//! Cells, and their figures as Markdown and JSON.

use std::path::Path;

use headrace_tests::field_table::{
    CONDITIONS, Cell, Condition, DRIVEN, Falsely, Figures, KINDS_OF_SOURCES, PLACES, Place, VEHICLES, Vehicle,
};
use serde_json::json;

use crate::arguments::Arguments;
use crate::goals::{Missed, advice_share};

/// Where one vehicle goes that is let in near the portal, m.
const DRIVEN_THERE: Place = ("driven", 6900.0);
const LET_IN_M: f64 = 60.0;
/// Places up to this chainage are the same in all tunnels, m.
const NEAR_M: f64 = 100.0;

/// A cell with its name.
pub(crate) struct NamedCell {
    /// Vehicle, condition, place, speed.
    pub(crate) name: [String; 4],
    pub(crate) cell: Cell,
}

/// The cells that are wanted.
pub(crate) fn cells(arguments: &Arguments) -> Vec<NamedCell> {
    let mut cells = Vec::new();
    for vehicle in VEHICLES {
        for (condition_name, condition) in CONDITIONS {
            for (place, start_m) in PLACES.into_iter().chain([DRIVEN_THERE]).chain(arguments.own_place_m()) {
                for (speed, driven) in DRIVEN {
                    let name = [vehicle.name, condition_name, place, speed];
                    if !arguments.wants(&name) || !has(&vehicle, condition, arguments, [place, speed]) {
                        continue;
                    }
                    let let_in_m = (place == DRIVEN_THERE.0).then_some(LET_IN_M);
                    let start_m = if start_m > NEAR_M { vehicle.far_share * start_m } else { start_m };
                    let cell = Cell { vehicle, condition, start_m, let_in_m, driven };
                    cells.push(NamedCell { name: name.map(str::to_owned), cell });
                }
            }
        }
    }
    // The longest first, which would otherwise keep one core waiting for the other.
    cells.sort_by_key(|named| named.cell.let_in_m.is_none());
    cells
}

/// Whether the table has a cell: what is wrong or breaks is tried at one place, unless asked for; one vehicle is driven far.
fn has(vehicle: &Vehicle, condition: Condition, arguments: &Arguments, [place, speed]: [&str; 2]) -> bool {
    if place == DRIVEN_THERE.0 {
        return vehicle.name == "vita2-4" && condition == Condition::DataSheet && speed == "planned";
    }
    let stood = [Condition::DataSheet, Condition::Told, Condition::Rough, Condition::AsBuilt];
    let stands = place == "portal" && stood.contains(&condition);
    if speed == "stood" && !stands && arguments.cell.is_empty() {
        return false;
    }
    // Between the ends nothing is told apart from them but that it is the same.
    let told_apart = place != "3000"
        || ["vita1", "vita2-4"].contains(&vehicle.name) && ["planned", "advised"].contains(&speed);
    if !told_apart && arguments.cell.is_empty() {
        return false;
    }
    // Of these it is the same everywhere.
    if [Condition::Told, Condition::AsBuilt].contains(&condition) && arguments.cell.is_empty() {
        return place == "portal" && ["planned", "stood"].contains(&speed);
    }
    let graded = [
        Condition::Clean,
        Condition::DataSheet,
        Condition::Poor,
        Condition::Murk,
        Condition::Rough,
        Condition::Lively,
    ];
    let (common, asked) = (graded.contains(&condition), !arguments.cell.is_empty());
    common || asked || (place == "6900" && ["vita1", "vita2-4"].contains(&vehicle.name))
}

const LEGEND: &str = "\
Over: sections with D_true > T; passed: of those, passed; far: passed with D_true > 1.1 T; failed under: failed with D_true < 0.9 T,
of those with it. These count all sections. The following leave out the ends of dives, 2 m and the target: passable is
the share of metres with D_true <= T, pass, fail, can't say and open are shares of metres; D is the rms error of D and sd the median of its sigma, m; ratio
is the rms of the errors over their sigmas, within the share within two. NIS is the mean by kind of source. Told: metres of the way with a
section, of the way. `!` marks what misses the goal; passes are held to the passable metres. Advised: by a pilot
who follows the live advice within 5 % and 3 s; back: by one who is in a hurry, then goes back for all that was missed. Advice is the
median speed advised over the largest one of Eq. 16 with what the vehicle hides and no other margin. Wrong and broken cells have no
goals but those for false passes, the ratio and told metres; nor has the advice where the vehicle goes too fast or back. Stood: as
planned, after the vehicle has stood for 30 s where it begins, the program running.

Told is the data sheet's with vehicle files that say of each noise what is simulated: no allowance for rough walls, tilt and cable. Rough
is the data sheet's on a wall with bumps of 2.8 cm (sd) that follow one another over 0.3 m, as-built on one that is up to 6 cm off the design, here in
and there out, over 2 to 6 m. Conditions wrong-* each have one
wrong setting; broken has one device that breaks, by the seed. Driven: let in at 60 m and driven to 6,900 at 0.3 m/s, once. Vehicle files say what acts: slack of 3 mm for a cable that is taut, 6 cm for one that hangs (poor), a MEMS unit's
noise where it is one (poor); wrong-unit and wrong-slack are the same where the file says better.
";

/// The table, with its legend.
pub(crate) fn markdown(cells: &[NamedCell], figures: &[Figures], arguments: &Arguments) -> String {
    let mut text = format!("{} dives a cell.\n\n{LEGEND}\n", arguments.seeds);
    let nis = KINDS_OF_SOURCES.map(|(name, _)| name).join(" / ");
    let head = format!(
        "| vehicle | condition | place | speed | over | passed | far | failed under | passable | pass | fail | can't say | open | \
         advice | D | sd | ratio | within | NIS {nis} | told |\n|{}\n",
        "---|".repeat(20)
    );
    text += &head;
    let mut with_misses = 0;
    for (cell, figures, missed) in judged(cells, figures) {
        with_misses += usize::from(missed.count() > 0);
        text += &row(cell, figures, &missed);
    }
    text += &plans(cells);
    text + &format!("\n{with_misses} of {} cells miss a goal.\n", cells.len())
}

/// A line for each section that passed although its true hole is over the target.
pub(crate) fn falsely(cells: &[NamedCell], figures: &[Figures]) -> String {
    let line = |name: &[String; 4], section: &Falsely| {
        let [told_m, sd_m, true_m] = section.hole_m;
        let (x_m, clock) = &section.at;
        format!(
            "{} seed {}: {:.2} passed, D {told_m:.3} +- {sd_m:.3} m at {x_m:.2}, {clock}; true {true_m:.3}; {} doubtful\n",
            name.join("/"),
            section.seed,
            section.start_m,
            section.doubtful
        )
    };
    let of_cell = |(NamedCell { name, .. }, figures): (&NamedCell, &Figures)| -> String {
        figures.falsely.iter().map(|section| line(name, section)).collect()
    };
    cells.iter().zip(figures).map(of_cell).collect()
}

/// The same with the dives of all places together, for a page: one vehicle's places beside each other are printed.
pub(crate) fn pooled(cells: &[NamedCell], figures: &[Figures]) -> (Vec<NamedCell>, Vec<Figures>) {
    let mut pools: Vec<(NamedCell, Figures)> = Vec::new();
    for (NamedCell { name: [vehicle, condition, _, speed], cell }, figures) in cells.iter().zip(figures) {
        let name = [vehicle.clone(), condition.clone(), "all".to_owned(), speed.clone()];
        if let Some((_, pool)) = pools.iter_mut().find(|(pooled, _)| pooled.name == name) {
            pool.join(figures);
        } else {
            pools.push((NamedCell { name, cell: *cell }, figures.clone()));
        }
    }
    pools.into_iter().unzip()
}

fn row(NamedCell { name, cell }: &NamedCell, figures: &Figures, missed: &Missed) -> String {
    let nis: Vec<String> = (0..KINDS_OF_SOURCES.len())
        .map(|kind| {
            figures.nis(kind).map_or("-".to_owned(), |nis| marked(format!("{nis:.2}"), missed.nis[kind]))
        })
        .collect();
    let row = [
        name.join(" | "),
        figures.over.to_string(),
        marked(figures.passed_over.to_string(), missed.passed_over),
        marked(figures.passed_far.to_string(), missed.passed_far),
        marked(format!("{}/{}", figures.failed_under, figures.under), missed.failed_under),
        format!("{:.2}", figures.passable()),
        marked(format!("{:.2}", figures.share(0)), missed.passed),
        format!("{:.2}", figures.share(1)),
        marked(format!("{:.2}", figures.share(2)), missed.cannot_say),
        format!("{:.2}", figures.share(3)),
        marked(format!("{:.2}", advice_share(cell, figures)), missed.advice),
        format!("{:.3}", figures.error_m()),
        format!("{:.3}", figures.sd_m()),
        marked(format!("{:.2}", figures.ratio_rms()), missed.ratio),
        marked(format!("{:.2}", figures.within(2.0)), missed.within),
        nis.join(" / "),
        marked(format!("{:.2}/{:.2}", figures.way_m[1], figures.way_m[0]), missed.told),
    ];
    format!("| {} |\n", row.join(" | "))
}

/// Planned speeds over those of Eq. 16.
fn plans(cells: &[NamedCell]) -> String {
    let mut text = "\n| vehicle | plan over Eq. 16 (>= 0.95) |\n|---|---|\n".to_owned();
    for vehicle in VEHICLES {
        let graded = |cell: &&NamedCell| {
            cell.cell.vehicle.name == vehicle.name && cell.cell.condition == Condition::DataSheet
        };
        if let Some(cell) = cells.iter().find(graded) {
            let share = cell.cell.plan_share();
            let row = format!("| {} | {} |\n", vehicle.name, marked(format!("{share:.2}"), share < 0.95));
            text += &row;
        }
    }
    text
}

/// Puts the table between the two marks of a page.
pub(crate) fn replace(page: &Path, table: &str) {
    let old = std::fs::read_to_string(page).unwrap();
    let (before, rest) = old.split_once(MARKS[0]).unwrap();
    let (_, after) = rest.split_once(MARKS[1]).unwrap();
    std::fs::write(page, format!("{before}{}\n{table}{}{after}", MARKS[0], MARKS[1])).unwrap();
}

/// Between which a page has the table.
const MARKS: [&str; 2] = ["<!-- table -->", "<!-- end of table -->"];

fn judged<'a>(
    cells: &'a [NamedCell],
    figures: &'a [Figures],
) -> impl Iterator<Item = (&'a NamedCell, &'a Figures, Missed)> {
    cells.iter().zip(figures).map(|(cell, figures)| (cell, figures, Missed::of(&cell.cell, figures)))
}

fn marked(text: String, missed: bool) -> String {
    if missed { text + "!" } else { text }
}

/// Writes the figures.
pub(crate) fn write_json(cells: &[NamedCell], figures: &[Figures], arguments: &Arguments) {
    let cells: Vec<_> = judged(cells, figures)
        .map(|(NamedCell { name, cell }, figures, missed)| {
            let nis = KINDS_OF_SOURCES.iter().enumerate();
            let nis = nis.filter_map(|(kind, (name, _))| Some(((*name).to_owned(), figures.nis(kind)?.into())));
            json!({
                "vehicle": name[0], "condition": name[1], "place": name[2], "speed": name[3], "start_m": cell.start_m,
                "target_m": cell.vehicle.target_m, "dives": figures.dives, "sections": figures.sections,
                "over": figures.over, "passed_over": figures.passed_over, "passed_far": figures.passed_far,
                "under": figures.under, "failed_under": figures.failed_under,
                "inner_m": figures.inner_m, "passable_m": figures.passable_m,
                "pass_m": figures.verdicts_m[0], "fail_m": figures.verdicts_m[1],
                "cannot_say_m": figures.verdicts_m[2], "open_m": figures.verdicts_m[3],
                "advice_of_eq16": advice_share(cell, figures),
                "error_rms_m": figures.error_m(), "sd_median_m": figures.sd_m(), "ratio_rms": figures.ratio_rms(),
                "within_two": figures.within(2.0), "nis": nis.collect::<serde_json::Map<_, _>>(),
                "way_m": figures.way_m[0], "told_m": figures.way_m[1], "goals_missed": missed.count(),
            })
        })
        .collect();
    let all = json!({ "field_version": 1, "seeds": arguments.seeds, "from_seed": arguments.from_seed, "cells": cells });
    std::fs::write(&arguments.json, serde_json::to_string_pretty(&all).unwrap()).unwrap();
    println!("figures {}", arguments.json.display());
}
