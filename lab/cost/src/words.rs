//! Figures and settings as text, for pictures, page and terminal alike.

use std::fmt::{self, Write as _};

use crate::point::{Point, Trade, knee};

/// Appends formatted text.
pub(crate) fn append(text: &mut String, arguments: fmt::Arguments<'_>) {
    // Writing to a String can't fail.
    let _written = text.write_fmt(arguments);
}

/// A number with three significant digits.
pub(crate) fn number(value: f64) -> String {
    match value.abs() {
        0.0 => "0".to_owned(),
        size if size < 1e-3 => format!("{value:.1e}"),
        size if size < 0.0995 => format!("{value:.4}"),
        size if size < 9.995 => format!("{value:.2}"),
        size if size < 99.95 => format!("{value:.1}"),
        _ => format!("{value:.0}"),
    }
}

/// A setting as text: the name of the varied parameter, and its value.
pub(crate) fn setting(point: &Point) -> String {
    if point.value.is_empty() { point.knob.clone() } else { format!("{} {}", point.knob, point.value) }
}

/// A setting as text, with its error and cost.
fn whole(trade: &Trade, point: &Point) -> String {
    let unit = point.errors.first().map_or("", |error| error.unit.as_str());
    format!(
        "{} ({} {unit}, {} {})",
        setting(point),
        number(point.error()),
        number(point.cost.middle),
        trade.cost_unit
    )
}

/// For a scene: the default, the knee of the front, and the price of the next step from the default to less error.
pub(crate) fn steps(trade: &Trade, scene: &str) -> Vec<String> {
    let points = || trade.points.iter().filter(|point| point.scene == scene);
    let Some(default) = points().find(|point| point.is_default) else {
        return vec!["The shipped default isn't among these settings.".to_owned()];
    };
    let mut lines = vec![format!("As shipped: {}.", whole(trade, default))];
    let resolution = trade.resolution();
    if let Some(knee) = knee(&trade.points, scene, resolution) {
        lines.push(format!("Knee of the front: {}.", whole(trade, knee)));
    }
    let finer = points().filter(|point| point.on_front && point.error() < default.error() - resolution);
    match finer.max_by(|a, b| a.error().total_cmp(&b.error())) {
        Some(next) => lines.push(format!(
            "Next step: {} for {} {}.",
            whole(trade, next),
            signed(next.cost.middle - default.cost.middle),
            trade.cost_unit
        )),
        None => lines.push(no_step(default, resolution)),
    }
    lines
}

/// Text for a scene in which no setting has a smaller error than the default, or in which the difference changes no
/// decision.
fn no_step(default: &Point, resolution: f64) -> String {
    let by = default.errors.first().filter(|_| resolution > 0.0);
    let by =
        by.map_or_else(String::new, |error| format!(" by more than {} {}", number(resolution), error.unit));
    format!("Next step: no setting has less error{by} at any cost.")
}

fn signed(value: f64) -> String {
    if value >= 0.0 { format!("{} more", number(value)) } else { format!("{} less", number(-value)) }
}

/// For each scene whose default is not on the front, a sentence that names a cheaper setting without more error.
pub(crate) fn defaults(trade: &Trade) -> Vec<String> {
    let mut lines = Vec::new();
    for scene in trade.scenes() {
        let default = trade.points.iter().find(|point| point.scene == scene && point.is_default);
        let Some(default) = default.filter(|default| !default.on_front) else { continue };
        let better = trade
            .points
            .iter()
            .filter(|point| point.scene == scene && point.error() <= default.error() + trade.resolution())
            .min_by(|a, b| a.cost.middle.total_cmp(&b.cost.middle));
        if let Some(better) = better {
            let method = &better.method;
            let is_named = *method == default.method || *method == better.knob;
            let method = if is_named { String::new() } else { format!("{method}, ") };
            lines.push(format!(
                "In \"{scene}\", {method}{} costs less than the shipped {}, without more error.",
                whole(trade, better),
                whole(trade, default)
            ));
        }
    }
    lines
}
