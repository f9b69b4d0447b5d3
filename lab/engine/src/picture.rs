//! Draws the answer of an SQL query as a chart.
//!
//! A question's comment `-- picture: KIND key=column ...` selects the drawing:
//!
//! - `bars label=L NAME=COLUMN ...`: a bar for each row and column;
//! - `strips x=FROM to=TO row=R colour=C`: stretches of chainage, a row for each value of `R`, coloured by verdict.

use datafusion::arrow::array::cast::AsArray as _;
use datafusion::arrow::array::types::Float64Type;
use datafusion::arrow::array::{Array as _, ArrayRef, RecordBatch};
use datafusion::arrow::compute::{cast, concat_batches};
use datafusion::arrow::datatypes::{DataType, SchemaRef};
use datafusion::error::DataFusionError;
use headrace_deliver::pictures::canvas::{Canvas, NORMAL, SMALL, Side, width_px};
use headrace_deliver::pictures::chart::{Axis, Chart, short};
use headrace_deliver::pictures::look::{Colour, of_several};
use headrace_deliver::pictures::polyline::Frame;

use crate::error::Error;

/// Maximum number of rows drawn. A line below the chart states how many rows are left out.
const MOST_ROWS: usize = 60;
/// Maximum width of a label, pixels.
const LABEL_PX: f64 = 260.0;
const WIDTH_PX: u32 = 1000;
/// Colours of verdicts, as on the page.
const VERDICTS: [(&str, Colour); 4] = [
    ("pass", Colour(0, 158, 115)),
    ("fail", Colour(213, 94, 0)),
    ("cannot_say", Colour(230, 184, 0)),
    ("open", Colour(170, 170, 170)),
];

/// Draws an answer as specified by the SQL's comment.
///
/// Errors: there is no such comment, it is invalid, or it names a column that doesn't exist.
pub fn draw(sql: &str, schema: &SchemaRef, answer: &[RecordBatch]) -> Result<String, Error> {
    let title = sql.lines().next().unwrap_or_default().trim_start_matches("--").trim();
    let rest = sql.lines().find_map(|line| line.trim().strip_prefix("-- picture:"));
    let Some(rest) = rest else {
        return Err(Error::Usage(
            "--picture: the SQL has no comment -- picture: KIND key=column ...".to_owned(),
        ));
    };
    let mut words = rest.split_whitespace();
    let kind = words.next().unwrap_or_default();
    let keys: Vec<(&str, &str)> = words.filter_map(|word| word.split_once('=')).collect();
    let table = concat_batches(schema, answer).map_err(DataFusionError::from)?;
    let answer = Answer { table, keys };
    match kind {
        "bars" => bars(title, &answer),
        "strips" => strips(title, &answer),
        _ => Err(Error::Usage(format!(
            "-- picture: {kind:?} isn't a kind of picture; expected bars or strips"
        ))),
    }
}

/// An answer and the columns that the drawing uses.
struct Answer<'a> {
    table: RecordBatch,
    keys: Vec<(&'a str, &'a str)>,
}

impl Answer<'_> {
    fn column(&self, name: &str) -> Result<ArrayRef, Error> {
        let missing = || Error::Usage(format!("-- picture: the answer has no column {name}"));
        self.table.column_by_name(name).cloned().ok_or_else(missing)
    }

    fn part(&self, key: &str) -> Result<ArrayRef, Error> {
        let missing = || Error::Usage(format!("-- picture: {key}=COLUMN is missing"));
        let (_, name) = self.keys.iter().find(|(of, _)| *of == key).ok_or_else(missing)?;
        self.column(name)
    }

    fn texts(array: &ArrayRef) -> Result<Vec<String>, Error> {
        let array = cast(array, &DataType::Utf8).map_err(DataFusionError::from)?;
        Ok(array.as_string::<i32>().iter().map(|text| text.unwrap_or("-").to_owned()).collect())
    }

    /// Values of a column as numbers; null becomes NaN.
    fn numbers(array: &ArrayRef) -> Result<Vec<f64>, Error> {
        let array = cast(array, &DataType::Float64).map_err(DataFusionError::from)?;
        let numbers = array.as_primitive::<Float64Type>();
        Ok((0..numbers.len())
            .map(|row| if numbers.is_null(row) { f64::NAN } else { numbers.value(row) })
            .collect())
    }
}

/// A row's label, shortened if it is wider than the margin of the chart.
fn fitting(text: &str) -> String {
    let mut text = text.to_owned();
    while width_px(&text, NORMAL) > LABEL_PX && text.pop().is_some() {}
    text
}

/// Height of a row of the chart and of the whole chart, pixels.
fn heights(rows: usize) -> (f64, u32) {
    let row_px = if rows > 30 { 15.0 } else { 22.0 };
    #[expect(clippy::cast_possible_truncation, reason = "at most some thousand pixels")]
    let sheet_px = (row_px * rows.max(4) as f64) as u32 + 170;
    (row_px, sheet_px)
}

fn frame(rows: usize) -> (Frame, u32) {
    let (row_px, sheet_px) = heights(rows);
    let bottom = 90.0 + row_px * rows.max(4) as f64;
    (Frame { left: LABEL_PX + 20.0, top: 90.0, right: f64::from(WIDTH_PX) - 70.0, bottom }, sheet_px)
}

fn left_out(canvas: &Canvas, frame: &Frame, rows: usize, what: &str) {
    if rows > MOST_ROWS {
        let text = format!("{} more {what} aren't drawn", rows - MOST_ROWS);
        canvas.text([frame.left, frame.bottom + 62.0], &text, Side::Right, SMALL);
    }
}

fn bars(title: &str, answer: &Answer<'_>) -> Result<String, Error> {
    let labels = Answer::texts(&answer.part("label")?)?;
    let mut series = Vec::new();
    for (name, column) in answer.keys.iter().filter(|(key, _)| *key != "label") {
        series.push((*name, *column, Answer::numbers(&answer.column(column)?)?));
    }
    let rows = labels.len().min(MOST_ROWS);
    let (frame, height) = frame(rows);
    let names: Vec<&str> = series.iter().map(|(_, column, _)| *column).collect();
    let canvas = Canvas::of_size([WIDTH_PX, height], title, &names.join(", "));
    let all = series.iter().flat_map(|(_, _, values)| values.iter().take(rows));
    let most = all.copied().filter(|value| value.is_finite()).fold(0.0, f64::max);
    let x = Axis::new(&names.join(", "), 0.0, if most > 0.0 { most * 1.05 } else { 1.0 }, 10);
    let chart = Chart::new(&canvas, frame, &x, &Axis::new("", 0.0, rows.max(4) as f64, 1).bare());
    let row_px = (frame.bottom - frame.top) / rows.max(4) as f64;
    let thick_px = (row_px - 4.0) / series.len().max(1) as f64;
    for (row, label) in labels.iter().take(rows).enumerate() {
        let top = frame.top + row_px * row as f64;
        canvas.text([frame.left - 8.0, top + row_px / 2.0], &fitting(label), Side::Left, SMALL);
        for (number, (_, _, values)) in series.iter().enumerate() {
            let value = values.get(row).copied().unwrap_or(f64::NAN);
            let from = top + 2.0 + thick_px * number as f64;
            let right = chart.px([if value.is_finite() { value } else { 0.0 }, 0.0])[0];
            canvas.area([frame.left, from], [right, from + thick_px - 1.0], of_several(number).colour);
            let text = if value.is_finite() { short(value) } else { "none".to_owned() };
            canvas.text([right + 4.0, from + thick_px / 2.0], &text, Side::Right, SMALL);
        }
    }
    if series.len() > 1 {
        legend(
            &canvas,
            &frame,
            series.iter().enumerate().map(|(n, (_, column, _))| (*column, of_several(n).colour)),
        );
    }
    left_out(&canvas, &frame, labels.len(), "rows");
    Ok(canvas.into_svg())
}

fn strips(title: &str, answer: &Answer<'_>) -> Result<String, Error> {
    let (from, to) = (Answer::numbers(&answer.part("x")?)?, Answer::numbers(&answer.part("to")?)?);
    let (rows, colours) = (Answer::texts(&answer.part("row")?)?, Answer::texts(&answer.part("colour")?)?);
    let mut names: Vec<&String> = Vec::new();
    for row in &rows {
        if !names.contains(&row) {
            names.push(row);
        }
    }
    let shown = names.len().min(MOST_ROWS);
    let (frame, height) = frame(shown);
    let canvas = Canvas::of_size([WIDTH_PX, height], title, "a row for each dive");
    let ends = from.iter().chain(&to).copied().filter(|value| value.is_finite());
    let (least, most) = ends.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| (a.min(x), b.max(x)));
    let (least, most) = if least < most { (least, most) } else { (0.0, 1.0) };
    let x = Axis::new("chainage, m", least, most, 12);
    let chart = Chart::new(&canvas, frame, &x, &Axis::new("", 0.0, shown.max(4) as f64, 1).bare());
    let row_px = (frame.bottom - frame.top) / shown.max(4) as f64;
    for (number, name) in names.iter().take(shown).enumerate() {
        let top = frame.top + row_px * number as f64;
        canvas.text([frame.left - 8.0, top + row_px / 2.0], &fitting(name), Side::Left, SMALL);
        for (verdict, colour) in VERDICTS {
            let of = rows.iter().zip(&colours).zip(from.iter().zip(&to));
            let of = of.filter(|((row, of), _)| row == name && *of == verdict);
            let areas: Vec<_> = of
                .map(|(_, (from, to))| {
                    let (left, right) = (chart.px([*from, 0.0])[0], chart.px([*to, 0.0])[0]);
                    ([left, top + 2.0], [(right - left).max(0.3), row_px - 4.0])
                })
                .collect();
            if !areas.is_empty() {
                canvas.areas(&areas, colour);
            }
        }
    }
    legend(&canvas, &frame, VERDICTS.into_iter());
    left_out(&canvas, &frame, names.len(), "dives");
    Ok(canvas.into_svg())
}

fn legend<'a>(canvas: &Canvas, frame: &Frame, items: impl Iterator<Item = (&'a str, Colour)>) {
    let mut left = frame.left;
    for (name, colour) in items {
        canvas.area([left, frame.top - 18.0], [left + 12.0, frame.top - 6.0], colour);
        canvas.text([left + 17.0, frame.top - 12.0], name, Side::Right, SMALL);
        left += 40.0 + width_px(name, SMALL);
    }
}
