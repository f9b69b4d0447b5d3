//! Formats a trade (comparison of error and cost) for the terminal.

use crate::point::{Point, Trade};
use crate::words::{self, append, number};

/// Formats a trade as a table, with its advice. Figures are numbered and explained below the table.
pub fn table(trade: &Trade) -> String {
    let mut text = format!("{}\n{}\n", trade.title, trade.question);
    let names = trade.figures();
    let wide = |of: &dyn Fn(&Point) -> usize| trade.points.iter().map(of).max().unwrap_or(0);
    let widths = [wide(&|point| point.method.chars().count()), wide(&|point| shown(point).chars().count())];
    for scene in trade.scenes() {
        let heads = (1..=names.len()).map(|number| format!("{:>9}", format!("[{number}]")));
        let heads = heads.collect::<Vec<_>>().concat();
        append(
            &mut text,
            format_args!("\n  {scene:<0$}{1:>30}{heads}\n", widths[0] + widths[1] + 4, trade.cost_unit),
        );
        for point in trade.points.iter().filter(|point| point.scene == scene) {
            text.push_str(&row(point, &names, widths));
        }
    }
    text.push('\n');
    for (k, name) in names.iter().enumerate() {
        append(&mut text, format_args!("  [{}] {name}\n", k + 1));
    }
    let (size, how) = (number(trade.oracle.size), &trade.oracle.how);
    append(
        &mut text,
        format_args!(
            "  * nothing beats it   # as shipped   cost with its 95 % interval\n  oracle's own error {size}: {how}\n"
        ),
    );
    for left in &trade.left_out {
        append(&mut text, format_args!("  left out: {}: {}\n", left.what, left.why));
    }
    for line in words::defaults(trade).iter().chain(&trade.reasons).chain([&trade.advice]) {
        append(&mut text, format_args!("  {line}\n"));
    }
    text
}

/// The setting as text. The name of the varied parameter is left out if it equals the method's name.
fn shown(point: &Point) -> String {
    if point.knob == point.method { point.value.clone() } else { words::setting(point) }
}

fn row(point: &Point, names: &[String], [methods, settings]: [usize; 2]) -> String {
    let figure = |name: &String| {
        format!("{:>9}", point.figure(name).map(|figure| number(figure.middle)).unwrap_or_default())
    };
    let cost = point.cost;
    let spread = if cost.high > cost.low {
        format!("{} ({} to {})", number(cost.middle), number(cost.low), number(cost.high))
    } else {
        number(cost.middle)
    };
    format!(
        "  {}{} {:<methods$} {:<settings$}{spread:>30}{}\n",
        if point.on_front { '*' } else { ' ' },
        if point.is_default { '#' } else { ' ' },
        point.method,
        shown(point),
        names.iter().map(figure).collect::<Vec<_>>().concat(),
    )
}
