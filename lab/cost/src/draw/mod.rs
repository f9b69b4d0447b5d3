//! Draws a trade (comparison of error and cost): a chart for each scene, with logarithmic axes: x error, y cost.

mod labels;
mod panel;

use headrace_deliver::pictures::canvas::{Canvas, NORMAL, SMALL, Side, width_px};
use headrace_deliver::pictures::look::{self, DIM, Look};
use headrace_deliver::pictures::polyline::Px;

use crate::point::Trade;
use crate::words::number;
use panel::{BAND, CLEAR, PLATEAU, Panel};

const WIDTH_PX: u32 = 1000;
/// Height of a chart, including its heading and the text below, pixels.
const PANEL_PX: f64 = 470.0;
/// Height of title and legend together, pixels.
const TOP_PX: f64 = 96.0;
const LINE_PX: f64 = 17.0;
/// Maximum number of lines that name omitted settings.
const MOST_LEFT_OUT: usize = 6;

/// Draws a trade (comparison of error and cost) as SVG.
pub fn svg(trade: &Trade) -> String {
    let scenes = trade.scenes();
    let left_out = left_out(trade);
    let height_px = TOP_PX + PANEL_PX * scenes.len() as f64 + LINE_PX * left_out.len() as f64 + 10.0;
    let canvas = Canvas::of_size([WIDTH_PX, whole(height_px)], &trade.title, &trade.question);
    legend(&canvas, trade);
    for (number, scene) in scenes.iter().enumerate() {
        Panel::of(trade, scene, TOP_PX + PANEL_PX * number as f64, PANEL_PX).draw(&canvas);
    }
    let first_px = TOP_PX + PANEL_PX * scenes.len() as f64;
    for (k, line) in left_out.iter().enumerate() {
        canvas.text([14.0, first_px + LINE_PX * k as f64], line, Side::Right, SMALL);
    }
    canvas.into_svg()
}

fn whole(px: f64) -> u32 {
    u32::try_from(headrace_geometry::math::floor_to_i64(px) + 1).unwrap_or(0)
}

/// Draws the legend: a line below the title that explains the marks.
fn legend(canvas: &Canvas, trade: &Trade) {
    let y = 70.0;
    let mut x = 14.0;
    let mut entry = |width: f64, words: &str, sample: &dyn Fn(Px)| {
        sample([x, y]);
        canvas.text([x + width + 6.0, y], words, Side::Right, NORMAL);
        x += width + 6.0 + width_px(words, NORMAL) + 14.0;
    };
    let marker =
        |filled: bool| move |[x, y]: Px| canvas.marker([x + 6.0, y], &look::of_several(4), 5.0, filled);
    let line = |look: Look| move |[x, y]: Px| canvas.line(&[[x, y], [x + 30.0, y]], &look);
    entry(12.0, "as shipped", &marker(true));
    entry(12.0, "other settings", &marker(false));
    entry(30.0, "front: nothing beats these", &line(BAND));
    entry(30.0, "plateau: more cost, same error", &|[x, y]: Px| {
        canvas.area([x, y - 7.0], [x + 30.0, y + 7.0], PLATEAU);
    });
    if let Some(decides) = trade.decides {
        let words = format!("decides from {} {} on", number(decides), trade.error_unit());
        entry(30.0, &words, &line(look::TARGET));
    }
}

/// Lines that name omitted settings, and state which errors are drawn larger than they are.
fn left_out(trade: &Trade) -> Vec<String> {
    let fits = |line: String| {
        let room_px = f64::from(WIDTH_PX) - 28.0;
        let letters = headrace_deliver::pictures::canvas::Letters { colour: DIM, ..SMALL };
        if width_px(&line, letters) <= room_px {
            return line;
        }
        let mut short: String = line;
        while width_px(&short, letters) > room_px - 8.0 {
            short.pop();
        }
        short + "…"
    };
    let mut lines: Vec<String> =
        trade.left_out.iter().map(|left| fits(format!("left out: {}: {}", left.what, left.why))).collect();
    if lines.len() > MOST_LEFT_OUT {
        let more = lines.len() - (MOST_LEFT_OUT - 1);
        lines.truncate(MOST_LEFT_OUT - 1);
        lines.push(format!("left out: {more} more, listed on the page"));
    }
    let (least, unit) = (CLEAR * trade.oracle.size, trade.error_unit());
    if trade.points.iter().any(|point| point.error() < least) {
        lines.push(format!(
            "errors below {} {unit} are drawn there: the reference may be {} {unit} off itself",
            number(least),
            number(trade.oracle.size)
        ));
    }
    lines
}
