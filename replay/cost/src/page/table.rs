//! A trade for the terminal.

use crate::point::{Point, Trade};
use crate::words::{self, append, number};

/// A trade as a table, with its advice.
pub fn table(trade: &Trade) -> String {
    let mut text = format!("{}\n{}\n", trade.title, trade.question);
    let [wide, methods] = [
        trade.points.iter().map(|point| words::setting(point).chars().count()).max().unwrap_or(0),
        trade.points.iter().map(|point| point.method.chars().count()).max().unwrap_or(0),
    ];
    for scene in trade.scenes() {
        append(&mut text, format_args!("\n  {scene}\n"));
        for point in trade.points.iter().filter(|point| point.scene == scene) {
            text.push_str(&row(trade, point, methods, wide));
        }
    }
    append(
        &mut text,
        format_args!(
            "\n  * on the front; (shipped) the default; error: {}\n  oracle's own error {}: {}\n",
            trade.error_axis,
            number(trade.oracle.size),
            trade.oracle.how
        ),
    );
    for left in &trade.left_out {
        append(&mut text, format_args!("  left out: {}: {}\n", left.what, left.why));
    }
    for line in words::defaults(trade).iter().chain(&trade.reasons) {
        append(&mut text, format_args!("  {line}\n"));
    }
    append(&mut text, format_args!("  {}\n", trade.advice));
    text
}

fn row(trade: &Trade, point: &Point, methods: usize, wide: usize) -> String {
    let errors: Vec<String> = point
        .errors
        .iter()
        .map(|error| format!("{} {} {}", error.name, number(error.interval.middle), error.unit))
        .collect();
    format!(
        "  {} {:<methods$}  {:<wide$}  {:>9} {} ({} to {})  {}{}\n",
        if point.on_front { '*' } else { ' ' },
        point.method,
        words::setting(point),
        number(point.cost.middle),
        trade.cost_unit,
        number(point.cost.low),
        number(point.cost.high),
        errors.join(", "),
        if point.is_default { "  (shipped)" } else { "" }
    )
}
