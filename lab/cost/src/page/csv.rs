//! Formats the points of a trade (settings with error and cost) as CSV, one row per point.

use crate::point::{Interval, Point, Trade};

/// Formats the points of a trade as CSV.
pub(super) fn csv(trade: &Trade) -> String {
    let mut text =
        "scene,method,knob,value,number,shipped,on_front,seeds,error,unit,error_low,error_middle,error_high,\
                    cost_unit,cost_low,cost_middle,cost_high,instructions\n"
            .to_owned();
    for point in &trade.points {
        for error in &point.errors {
            let row = row(trade, point, [&error.name, &error.unit], error.interval);
            text.push_str(&(row.iter().map(|cell| quoted(cell)).collect::<Vec<_>>().join(",") + "\n"));
        }
    }
    text
}

fn row(trade: &Trade, point: &Point, [name, unit]: [&str; 2], error: Interval) -> Vec<String> {
    let yes = |value: bool| if value { "yes" } else { "no" }.to_owned();
    let known = |value: Option<f64>| value.map(|value| value.to_string()).unwrap_or_default();
    let mut row = [&point.scene, &point.method, &point.knob, &point.value].map(String::clone).to_vec();
    row.extend([known(point.number), yes(point.is_default), yes(point.on_front), point.seeds.to_string()]);
    row.extend([name.to_owned(), unit.to_owned()]);
    row.extend([error.low, error.middle, error.high].map(|value| value.to_string()));
    row.push(trade.cost_unit.clone());
    row.extend([point.cost.low, point.cost.middle, point.cost.high].map(|value| value.to_string()));
    row.push(known(point.instructions));
    row
}

/// A CSV cell, quoted if necessary.
fn quoted(cell: &str) -> String {
    if cell.contains([',', '"', '\n']) {
        format!("\"{}\"", cell.replace('"', "\"\""))
    } else {
        cell.to_owned()
    }
}
