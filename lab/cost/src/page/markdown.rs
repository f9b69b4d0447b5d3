//! The page in Markdown.

use super::Results;
use crate::point::{Given, Interval, Point, Trade};
use crate::words::{self, append, number};

/// The whole page.
pub(super) fn page(results: &Results) -> String {
    let mut text = format!(
        "# What accuracy costs\n\nMade by `{}`, nothing by hand. Times are of {}, {}; they are as old as that, and differ from machine to \
         machine: compare them with one another only. All else is the same wherever it is measured.\n\n\
         Each point is a setting: its error against independent values, with 95 % or outermost bounds, beside its cost, {}. \
         The bars say how far the rounds of one run are apart: from run to run a machine is faster or slower as a whole, by which all \
         costs of a trade differ alike (`.ci/cost-page --runs ONE OTHER` tells by how much). \"Front\" says that no other setting of \
         the same scene has less error for no more cost. CPU time is that of the thread, the kernel's part for it included; wall time says \
         little on a shared machine.\n",
        results.command,
        results.program,
        results.machine,
        results.bars.as_str()
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
    let names = trade.figures();
    let is_counted = trade.points.iter().any(|point| point.instructions.is_some());
    let mut columns = ["scene", "method", "setting", "seeds"].map(str::to_owned).to_vec();
    columns.extend(names.iter().cloned());
    columns.push(trade.cost_axis.clone());
    columns.extend(is_counted.then(|| "instructions".to_owned()));
    columns.push("front".to_owned());
    let rows: Vec<Vec<String>> = trade.points.iter().map(|point| row(point, &names, is_counted)).collect();
    let counted = if is_counted {
        ""
    } else {
        "\nInstructions weren't counted: nothing on that machine counts them.\n"
    };
    format!("\n{}{counted}", lines(&columns, &rows))
}

fn row(point: &Point, names: &[String], is_counted: bool) -> Vec<String> {
    let shipped = if point.is_default { " **(shipped)**" } else { "" };
    let mut row = vec![
        point.scene.clone(),
        point.method.clone(),
        words::setting(point) + shipped,
        point.seeds.to_string(),
    ];
    row.extend(names.iter().map(|name| point.figure(name).map(figure).unwrap_or_default()));
    row.push(figure(point.cost));
    row.extend(is_counted.then(|| point.instructions.map(number).unwrap_or_default()));
    row.push(if point.on_front { "yes" } else { "" }.to_owned());
    row
}

/// A figure with its bounds, if it has any.
fn figure(Interval { low, middle, high }: Interval) -> String {
    if high <= low {
        number(middle)
    } else {
        format!("{} ({} to {})", number(middle), number(low), number(high))
    }
}

fn table(given: &Given) -> String {
    format!("\n## {}\n{}\n\n{}", given.title, given.text, lines(&given.columns, &given.rows))
}

/// A table's lines.
fn lines(columns: &[String], rows: &[Vec<String>]) -> String {
    let line = |cells: &[String]| format!("| {} |\n", cells.join(" | "));
    let rows: Vec<String> = rows.iter().map(|row| line(row)).collect();
    format!("{}|{}\n{}", line(columns), "---|".repeat(columns.len()), rows.concat())
}
