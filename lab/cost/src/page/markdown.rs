//! The two pages in Markdown: advice for a survey, and the method of measurement.

use super::Results;
use crate::point::{Given, Trade};
use crate::words::{self, append, number};

/// The page of advice: each trade's question, advice, picture and reasons.
pub(super) fn advice(results: &Results) -> String {
    let mut text = "# What accuracy costs\n\nAdvice for planning a survey and for setting up the program. `headrace cost` measures it and writes this \
                    page. [Method](method.md) describes the measurement and its certainty. Costs are comparable only with each other: they \
                    differ from machine to machine.\n"
        .to_owned();
    for trade in &results.trades {
        text.push_str(&section(trade));
    }
    for given in &results.given {
        text.push_str(&table(given));
    }
    text
}

fn section(trade: &Trade) -> String {
    let mut text = format!("\n## {}\n{}\n\n**{}**\n\n", trade.title, trade.question, trade.advice);
    for line in trade.reasons.iter().cloned().chain(words::defaults(trade)) {
        append(&mut text, format_args!("- {line}\n"));
    }
    append(
        &mut text,
        format_args!("\n![{0}]({1}.svg)\n\nAll settings: [{1}.csv]({1}.csv)\n", trade.title, trade.name),
    );
    text
}

/// The page of the method: program, machine, meaning of the figures, error of each reference, and what was left out.
pub(super) fn method(results: &Results) -> String {
    let mut text = format!(
        "# How the cost of accuracy is measured\n\n\
         Measured with {} on {}. `{}` measures it again.\n\n\
         - Each point of a chart is a setting of the program, with its error and its cost.\n\
         - An error is the difference from a reference value that other code computes. Its bounds are a 95 % interval, or the extremes of a few seeds.\n\
         - A cost is the {}. The CSV files state both bounds.\n\
         - The whole machine may be faster in one run than in another. This scales all costs of a run alike; `.ci/cost-page --runs ONE OTHER` \
         shows by how much.\n\
         - CPU time is that of the measuring thread, including its time in the kernel. Wall time says little on a shared machine.\n\
         - `on_front` in the CSV files marks settings with no better alternative: no other setting of the scene has less error for no more \
         cost.\n",
        results.program,
        results.machine,
        results.command,
        results.bars.as_str()
    );
    for trade in &results.trades {
        append(
            &mut text,
            format_args!(
                "\n## {}\nThe reference values are accurate to {}. Evidence: {}.\n",
                trade.title,
                number(trade.oracle.size),
                trade.oracle.how
            ),
        );
        if !trade.left_out.is_empty() {
            text.push('\n');
        }
        for left in &trade.left_out {
            append(&mut text, format_args!("- Not measured: **{}** ({})\n", left.what, left.why));
        }
    }
    text
}

fn table(given: &Given) -> String {
    let line = |cells: &[String]| format!("| {} |\n", cells.join(" | "));
    let rows: String = given.rows.iter().map(|row| line(row)).collect();
    let head = line(&given.columns);
    format!("\n## {}\n{}\n\n{head}|{}\n{rows}", given.title, given.text, "---|".repeat(given.columns.len()))
}
