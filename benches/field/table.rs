//! Cells of the field table, and their figures as CSV and JSON.

use headrace_tests::field_table::{
    CONDITIONS, Cell, Condition, DRIVEN, FalsePass, Figures, KINDS_OF_SOURCES, PLACES, Place, VEHICLES,
    Vehicle,
};
use serde_json::json;

use crate::arguments::Arguments;
use crate::goals::{Missed, advice_share};

/// Place that one vehicle reaches by driving from a launch near the portal, m.
const DRIVEN_THERE: Place = ("driven", 6900.0);
const LET_IN_M: f64 = 60.0;
/// Largest chainage of a place near the portal, m. Such places have the same chainage in all tunnels.
const NEAR_M: f64 = 100.0;

/// A cell of the field table with its name.
pub(crate) struct NamedCell {
    /// Name of the cell: vehicle, condition, place and speed.
    pub(crate) name: [String; 4],
    pub(crate) cell: Cell,
}

/// The cells that the arguments select.
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
    // The longest dives run first. Otherwise, one core is idle while the other one finishes them.
    cells.sort_by_key(|named| named.cell.let_in_m.is_none());
    cells
}

/// Whether the table contains a cell. Unless the arguments select them, cells with wrong settings or broken devices are
/// in the table at one place only. Only one vehicle drives from the launch to the far place.
fn has(vehicle: &Vehicle, condition: Condition, arguments: &Arguments, [place, speed]: [&str; 2]) -> bool {
    if place == DRIVEN_THERE.0 {
        return vehicle.name == "vita2-4" && condition == Condition::DataSheet && speed == "planned";
    }
    let stood = [Condition::DataSheet, Condition::Declared, Condition::Rough, Condition::AsBuilt];
    let is_included = place == "portal" && stood.contains(&condition);
    if speed == "stood" && !is_included && arguments.cell.is_empty() {
        return false;
    }
    let of_mounts = [Condition::Mounts, Condition::WrongMount];
    if speed == "swung" && !of_mounts.contains(&condition) && arguments.cell.is_empty() {
        return false;
    }
    // Few cells have the middle place, because it only shows that results don't depend on the place.
    let is_covered_elsewhere = place != "3000"
        || ["vita1", "vita2-4"].contains(&vehicle.name) && ["planned", "advised"].contains(&speed);
    if !is_covered_elsewhere && arguments.cell.is_empty() {
        return false;
    }
    // Cells with these conditions are near the portal only, because their results don't depend on the place.
    let anywhere = [Condition::Declared, Condition::AsBuilt, Condition::Altered];
    if anywhere.contains(&condition) && arguments.cell.is_empty() {
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

/// The table as CSV with one row for each cell; docs/why/field.md explains its columns.
pub(crate) fn csv(cells: &[NamedCell], figures: &[Figures]) -> String {
    let nis = KINDS_OF_SOURCES.map(|(name, _)| format!("nis_{}", name.replace(' ', "_"))).join(",");
    let mut text = format!(
        "vehicle,condition,place,speed,over,passed,far,failed_under,under,passable,pass,fail,cannot_say,open,\
         advice,plan,d_error_m,d_sd_m,ratio,within,{nis},told_m,way_m,misses\n"
    );
    for (cell, figures, missed) in judged(cells, figures) {
        text += &row(cell, figures, &missed);
    }
    text
}

/// One line for each section that passed although its true hole exceeds the target.
pub(crate) fn falsely(cells: &[NamedCell], figures: &[Figures]) -> String {
    let line = |name: &[String; 4], section: &FalsePass| {
        let [reported_m, sd_m, true_m] = section.hole_m;
        let (x_m, clock) = &section.at;
        format!(
            "{} seed {}: {:.2} passed, D {reported_m:.3} +- {sd_m:.3} m at {x_m:.2}, {clock}; true {true_m:.3}; {} doubtful\n",
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

/// Cells for the documented table. Each cell combines the dives of all places, which the printed table keeps separate.
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
    let shares = |number: f64| format!("{number:.2}");
    let nis = (0..KINDS_OF_SOURCES.len()).map(|kind| figures.nis(kind).map_or(String::new(), shares));
    let row = [
        name.join(","),
        figures.over.to_string(),
        figures.passed_over.to_string(),
        figures.passed_far.to_string(),
        figures.failed_under.to_string(),
        figures.under.to_string(),
        shares(figures.passable()),
        [0, 1, 2, 3].map(|verdict| shares(figures.share(verdict))).join(","),
        shares(advice_share(cell, figures)),
        shares(cell.plan_share()),
        format!("{:.3}", figures.error_m()),
        format!("{:.3}", figures.sd_m()),
        shares(figures.ratio_rms()),
        shares(figures.within(2.0)),
        nis.collect::<Vec<_>>().join(","),
        format!("{:.2},{:.2}", figures.way_m[1], figures.way_m[0]),
        missed.names().join(" "),
    ];
    format!("{}\n", row.join(","))
}

fn judged<'a>(
    cells: &'a [NamedCell],
    figures: &'a [Figures],
) -> impl Iterator<Item = (&'a NamedCell, &'a Figures, Missed)> {
    cells.iter().zip(figures).map(|(cell, figures)| (cell, figures, Missed::of(&cell.cell, figures)))
}

/// Writes all figures to a file.
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
                "way_m": figures.way_m[0], "told_m": figures.way_m[1], "goals_missed": missed.names(),
            })
        })
        .collect();
    let all = json!({ "field_version": 1, "seeds": arguments.seeds, "from_seed": arguments.from_seed, "cells": cells });
    std::fs::write(&arguments.json, serde_json::to_string_pretty(&all).unwrap()).unwrap();
    println!("figures {}", arguments.json.display());
}
