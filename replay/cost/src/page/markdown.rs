//! The page.

use super::Results;
use crate::point::{Given, Interval, Point, Trade};
use crate::words::{self, append, number};

/// The whole page.
pub(super) fn page(results: &Results) -> String {
    let mut text = format!(
        "# What accuracy costs\n\nMade by `{}`, nothing by hand. Times are of {}, {}; they are as old as that, and differ from machine to \
         machine: compare them with one another only. All else is the same wherever it is measured.\n\n\
         Each point is a setting: its error against independent values, with 95 % or quartile bounds, beside its cost, median and \
         quartiles of at least nine rounds in turns. \"Front\" says that no other setting of the same scene has less error for no \
         more cost. CPU time is that of the thread, the kernel's part for it included; wall time says little on a shared machine.\n",
        results.command, results.program, results.machine
    );
    for trade in &results.trades {
        text.push_str(&section(trade));
    }
    for given in &results.given {
        text.push_str(&table(given));
    }
    text
}

fn section(trade: &Trade) -> String {
    let mut text = format!(
        "\n## {}\n{}\n\n![{}]({}.svg)\n\n**{}**\n\n",
        trade.title, trade.question, trade.title, trade.name, trade.advice
    );
    let mut lines = words::defaults(trade);
    lines.extend(trade.reasons.iter().cloned());
    for line in lines {
        append(&mut text, format_args!("- {line}\n"));
    }
    text.push_str(&points(trade));
    append(
        &mut text,
        format_args!("\nThe oracle's own error: {}; {}.\n", number(trade.oracle.size), trade.oracle.how),
    );
    if !trade.left_out.is_empty() {
        text.push_str("\nLeft out:\n");
        for left in &trade.left_out {
            append(&mut text, format_args!("- {}: {}\n", left.what, left.why));
        }
    }
    text
}

fn points(trade: &Trade) -> String {
    let mut names: Vec<String> = Vec::new();
    for error in trade.points.iter().flat_map(|point| &point.errors) {
        let name = format!("{}, {}", error.name, error.unit);
        if !names.contains(&name) {
            names.push(name);
        }
    }
    let mut text = format!(
        "\n| scene | method | setting | seeds | {} | {} | instructions | front |\n|---|---|---|---|{}---|---|---|\n",
        names.join(" | "),
        trade.cost_axis,
        "---|".repeat(names.len())
    );
    for point in &trade.points {
        text.push_str(&row(point, &names));
    }
    text
}

fn row(point: &Point, names: &[String]) -> String {
    let shipped = if point.is_default { " **(shipped)**" } else { "" };
    let figure = |name: &String| {
        let error = point.errors.iter().find(|error| format!("{}, {}", error.name, error.unit) == *name);
        error.map(|error| figure(error.interval)).unwrap_or_default()
    };
    let errors: Vec<String> = names.iter().map(figure).collect();
    format!(
        "| {} | {} | {} {}{shipped} | {} | {} | {} | {} | {} |\n",
        point.scene,
        point.method,
        point.knob,
        point.value,
        point.seeds,
        errors.join(" | "),
        figure_of_cost(point),
        point.instructions.map(number).unwrap_or_default(),
        if point.on_front { "yes" } else { "" }
    )
}

fn figure_of_cost(point: &Point) -> String {
    figure(point.cost)
}

/// A figure with its bounds, where it has any.
fn figure(Interval { low, middle, high }: Interval) -> String {
    if high <= low {
        number(middle)
    } else {
        format!("{} ({} to {})", number(middle), number(low), number(high))
    }
}

fn table(given: &Given) -> String {
    let line = |cells: &[String]| format!("| {} |\n", cells.join(" | "));
    let rows: String = given.rows.iter().map(|row| line(row)).collect();
    format!(
        "\n## {}\n{}\n\n{}|{}\n{rows}",
        given.title,
        given.text,
        line(&given.columns),
        "---|".repeat(given.columns.len())
    )
}
