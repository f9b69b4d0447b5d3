//! A document as PDF on A4, in Helvetica. Lengths are points, of which an inch has 72; heights are measured from the top
//! of a page.

use std::io::Write as _;

use flate2::Compression;
use flate2::write::ZlibEncoder;
use pdf_writer::types::{LineCapStyle, LineJoinStyle};
use pdf_writer::{Content, Filter, Finish as _, Name, Pdf as Writer, Rect, Ref, Str, TextStr};

use super::helvetica::{code, codes};
use super::layout::{Font, GAP_PT, column_widths};
use super::model::{Block, Document, Table};
use crate::pictures::look::{Colour, Look};
use crate::pictures::polyline::Px;
use crate::pictures::shape::{Drawing, Letters, Shape, Side};

const PAGE_PT: [f64; 2] = [595.276, 841.89];
const MARGIN_PT: f64 = 57.0;
const ROOM_PT: f64 = PAGE_PT[0] - 2.0 * MARGIN_PT;
/// Height at which a page's content ends.
const END_PT: f64 = PAGE_PT[1] - 68.0;
const TITLE: Font = Font { size_pt: 24.0, bold: true };
const HEADING: Font = Font { size_pt: 14.0, bold: true };
const SUBHEADING: Font = Font { size_pt: 11.0, bold: true };
const TEXT: Font = Font { size_pt: 10.0, bold: false };
const STRONG: Font = Font { bold: true, ..TEXT };
const CELL: Font = Font { size_pt: 8.5, bold: false };
const CELL_HEAD: Font = Font { bold: true, ..CELL };
const FOOTER: Font = Font { size_pt: 8.0, bold: false };
/// Distance between lines, as a share of the font size.
const LEADING: f64 = 1.35;
/// Smallest room below a heading, in which the next block must begin. With less room, the heading moves to the next
/// page.
const KEPT_PT: f64 = 60.0;
/// Indentation of a list.
const INDENT_PT: f64 = 12.0;
/// Largest width of the column of names in a list of values.
const NAMES_PT: f64 = 150.0;
const FONTS: [(Name<'static>, Name<'static>); 2] =
    [(Name(b"F0"), Name(b"Helvetica")), (Name(b"F1"), Name(b"Helvetica-Bold"))];

/// A document as PDF.
pub struct Pdf {
    /// Contents of the file.
    pub bytes: Vec<u8>,
    /// Characters that the PDF shows as question marks, because its font doesn't have them.
    pub unknown: Vec<char>,
}

/// Returns a document as PDF.
pub fn pdf(document: &Document) -> Pdf {
    let mut pages = Pages { done: Vec::new(), content: Content::new(), at_pt: MARGIN_PT };
    pages.at_pt = 190.0;
    pages.lines(&document.title, TITLE, MARGIN_PT, ROOM_PT);
    pages.at_pt += 28.0;
    for (place, block) in document.blocks.iter().enumerate() {
        pages.block(block, document.blocks.get(place + 1));
    }
    pages.break_page();
    let mut unknown: Vec<char> =
        document.text().chars().filter(|c| *c != '\n' && code(*c).is_none()).collect();
    unknown.sort_unstable();
    unknown.dedup();
    Pdf { bytes: written(pages.done, document), unknown }
}

/// Lines of a cell. If `right_pt` is given, the lines end there.
struct Cell {
    left_pt: f64,
    right_pt: Option<f64>,
    lines: Vec<String>,
}

/// Pages filled from top to bottom.
struct Pages {
    done: Vec<Content>,
    content: Content,
    at_pt: f64,
}

impl Pages {
    fn break_page(&mut self) {
        self.done.push(core::mem::replace(&mut self.content, Content::new()));
        self.at_pt = MARGIN_PT;
    }

    /// Begins a new page if the present page has less room than `height_pt`.
    fn keep(&mut self, height_pt: f64) {
        if self.at_pt + height_pt > END_PT && self.at_pt > MARGIN_PT {
            self.break_page();
        }
    }

    fn block(&mut self, block: &Block, next: Option<&Block>) {
        match block {
            Block::Heading(text) => self.heading(text, HEADING, [16.0, 8.0], next),
            Block::Subheading(text) => self.heading(text, SUBHEADING, [8.0, 4.0], next),
            Block::Paragraph(text) => {
                self.lines(text, TEXT, MARGIN_PT, ROOM_PT);
                self.at_pt += 6.0;
            }
            Block::Warning(text) => self.warning(text),
            Block::List(items) => {
                for item in items {
                    self.keep(TEXT.size_pt * LEADING);
                    let baseline_pt = self.at_pt + TEXT.size_pt;
                    text(&mut self.content, [MARGIN_PT, baseline_pt], "•", TEXT);
                    self.lines(item, TEXT, MARGIN_PT + INDENT_PT, ROOM_PT - INDENT_PT);
                    self.at_pt += 2.0;
                }
                self.at_pt += 6.0;
            }
            Block::Values(values) => self.values(values),
            Block::Table(table) => self.table(table),
            Block::Figure(drawing, caption) => self.figure(drawing, caption),
            Block::PageBreak => self.break_page(),
        }
    }

    fn heading(&mut self, text: &str, font: Font, [above_pt, below_pt]: [f64; 2], next: Option<&Block>) {
        let next_pt = match next {
            Some(Block::Figure(drawing, _)) => height_pt(drawing) + 30.0,
            _ => KEPT_PT,
        };
        if self.at_pt > MARGIN_PT {
            self.at_pt += above_pt;
        }
        self.keep(font.size_pt * LEADING + below_pt + next_pt);
        self.lines(text, font, MARGIN_PT, ROOM_PT);
        self.at_pt += below_pt;
    }

    /// Writes a text, broken into lines.
    fn lines(&mut self, words: &str, font: Font, left_pt: f64, room_pt: f64) {
        for line in font.broken(words, room_pt) {
            self.keep(font.size_pt * LEADING);
            text(&mut self.content, [left_pt, self.at_pt + font.size_pt], &line, font);
            self.at_pt += font.size_pt * LEADING;
        }
    }

    fn warning(&mut self, words: &str) {
        let inset_pt = 8.0;
        let count = STRONG.broken(words, ROOM_PT - 2.0 * inset_pt).len() as f64;
        let height_pt = count * STRONG.size_pt * LEADING + 2.0 * inset_pt;
        self.keep(height_pt);
        let [left, top] = page_point([MARGIN_PT, self.at_pt]);
        self.content.set_line_width(1.0).rect(left, top, single(ROOM_PT), -single(height_pt)).stroke();
        self.at_pt += inset_pt;
        self.lines(words, STRONG, MARGIN_PT + inset_pt, ROOM_PT - 2.0 * inset_pt);
        self.at_pt += inset_pt + 8.0;
    }

    fn values(&mut self, values: &[(String, String)]) {
        let names_pt = values.iter().map(|(name, _)| TEXT.width_pt(name)).fold(0.0, f64::max).min(NAMES_PT);
        let left_pt = MARGIN_PT + names_pt + 16.0;
        for (name, value) in values {
            let cell = |left_pt: f64, lines: Vec<String>| Cell { left_pt, right_pt: None, lines };
            let value = TEXT.broken(value, ROOM_PT + MARGIN_PT - left_pt);
            self.row(&[cell(MARGIN_PT, TEXT.broken(name, NAMES_PT)), cell(left_pt, value)], TEXT);
            self.at_pt += 2.0;
        }
        self.at_pt += 8.0;
    }

    /// Writes cells side by side. Rows that are higher than a page are divided.
    fn row(&mut self, cells: &[Cell], font: Font) {
        let line_pt = font.size_pt * LEADING;
        let most = cells.iter().map(|cell| cell.lines.len()).max().unwrap_or(0);
        if most as f64 * line_pt < END_PT - MARGIN_PT {
            self.keep(most as f64 * line_pt);
        }
        for number in 0..most {
            self.keep(line_pt);
            for Cell { left_pt, right_pt, lines } in cells {
                let Some(line) = lines.get(number) else { continue };
                let left_pt = right_pt.map_or(*left_pt, |right_pt| right_pt - font.width_pt(line));
                text(&mut self.content, [left_pt, self.at_pt + font.size_pt], line, font);
            }
            self.at_pt += line_pt;
        }
    }

    fn table(&mut self, table: &Table) {
        let widths = column_widths(table, [CELL_HEAD, CELL], ROOM_PT);
        let end_pt = MARGIN_PT + widths.iter().sum::<f64>() + GAP_PT * (widths.len() as f64 - 1.0);
        let numbers: Vec<bool> = (0..widths.len()).map(|column| table.is_number(column)).collect();
        let cells = |row: &[String], font: Font| -> Vec<Cell> {
            let mut left_pt = MARGIN_PT;
            let cell = |((text, width_pt), is_number): ((&String, &f64), &bool)| {
                let lines = font.broken(text, *width_pt);
                left_pt += width_pt + GAP_PT;
                Cell {
                    left_pt: left_pt - width_pt - GAP_PT,
                    right_pt: is_number.then_some(left_pt - GAP_PT),
                    lines,
                }
            };
            row.iter().zip(&widths).zip(&numbers).map(cell).collect()
        };
        let head = cells(&table.columns, CELL_HEAD);
        self.keep(KEPT_PT);
        self.table_head(&head, end_pt);
        for row in &table.rows {
            let cells = cells(row, CELL);
            let most = cells.iter().map(|cell| cell.lines.len()).max().unwrap_or(0);
            if self.at_pt + most as f64 * CELL.size_pt * LEADING + 5.0 > END_PT {
                self.break_page();
                self.table_head(&head, end_pt);
            }
            self.at_pt += 2.0;
            self.row(&cells, CELL);
            self.at_pt += 2.0;
            self.rule(end_pt, 0.3);
        }
        self.at_pt += 12.0;
    }

    fn table_head(&mut self, head: &[Cell], end_pt: f64) {
        self.row(head, CELL_HEAD);
        self.at_pt += 2.0;
        self.rule(end_pt, 0.8);
    }

    /// Draws a horizontal line from the left margin to `end_pt`.
    fn rule(&mut self, end_pt: f64, width_pt: f64) {
        let ([left, y], [right, _]) = (page_point([MARGIN_PT, self.at_pt]), page_point([end_pt, 0.0]));
        self.content.set_line_width(single(width_pt)).move_to(left, y).line_to(right, y).stroke();
    }

    fn figure(&mut self, drawing: &Drawing, caption: &str) {
        let (height_pt, lines) = (height_pt(drawing), CELL.broken(caption, ROOM_PT).len() as f64);
        self.keep(height_pt + 4.0 + lines * CELL.size_pt * LEADING);
        draw(&mut self.content, drawing, self.at_pt);
        self.at_pt += height_pt + 4.0;
        self.lines(caption, CELL, MARGIN_PT, ROOM_PT);
        self.at_pt += 12.0;
    }
}

fn scale(drawing: &Drawing) -> f64 {
    ROOM_PT / f64::from(drawing.size_px[0])
}

fn height_pt(drawing: &Drawing) -> f64 {
    f64::from(drawing.size_px[1]) * scale(drawing)
}

/// Converts a number to single precision, as in PDF.
#[expect(clippy::cast_possible_truncation, reason = "a thousandth of a point is finer than any printer")]
fn single(value: f64) -> f32 {
    // The number is rounded, so that the file isn't full of digits.
    ((value * 1000.0).round() / 1000.0) as f32
}

/// Converts a position from the page's upper left corner to PDF's position from the lower left corner.
fn page_point([x_pt, y_pt]: [f64; 2]) -> [f32; 2] {
    [single(x_pt), single(PAGE_PT[1] - y_pt)]
}

fn text(content: &mut Content, baseline_pt: [f64; 2], text: &str, font: Font) {
    let [x, y] = page_point(baseline_pt);
    let name = FONTS[usize::from(font.bold)].0;
    content.begin_text().set_font(name, single(font.size_pt)).next_line(x, y);
    content.show(Str(&codes(text))).end_text();
}

fn colour(Colour(red, green, blue): Colour) -> [f32; 3] {
    [red, green, blue].map(|part| single(f64::from(part) / 255.0))
}

/// Draws a drawing across the page, below `top_pt`.
fn draw(content: &mut Content, drawing: &Drawing, top_pt: f64) {
    let scale = scale(drawing);
    content.save_state();
    // From here on, positions in the PDF are those of the drawing, in pixels, except that y grows upwards.
    let [left, top] = page_point([MARGIN_PT, top_pt]);
    content.transform([single(scale * 1e3) / 1e3, 0.0, 0.0, single(scale * 1e3) / 1e3, left, top]);
    content.set_line_join(LineJoinStyle::RoundJoin);
    for shape in &drawing.shapes {
        draw_shape(content, shape);
    }
    content.restore_state();
}

fn draw_shape(content: &mut Content, shape: &Shape) {
    let fill = |content: &mut Content, of: Colour| {
        let [red, green, blue] = colour(of);
        content.set_fill_rgb(red, green, blue);
    };
    match shape {
        Shape::Text { at, down_px, text, side, letters } => {
            fill(content, letters.colour);
            draw_text(content, *at, *down_px, text, (*side, *letters));
        }
        Shape::Area { upper_left: [left, top], lower_right: [right, bottom], colour } => {
            fill(content, *colour);
            rectangles(content, &[([*left, *top], [right - left, bottom - top])]);
        }
        Shape::Areas { areas, colour } => {
            fill(content, *colour);
            rectangles(content, areas);
        }
        Shape::Dots { places, across_px, colour: of } => {
            let [red, green, blue] = colour(*of);
            content.set_stroke_rgb(red, green, blue).set_line_width(single(*across_px));
            content.set_line_cap(LineCapStyle::RoundCap).set_dash_pattern([], 0.0);
            for [x, y] in places {
                content.move_to(single(*x), -single(*y)).line_to(single(*x), -single(*y));
            }
            content.stroke().set_line_cap(LineCapStyle::ButtCap);
        }
        Shape::Polygon { corners, colour } => {
            fill(content, *colour);
            path(content, corners);
            content.close_path().fill_nonzero();
        }
        Shape::Line { places, look } => {
            pen(content, look);
            path(content, places);
            content.stroke();
        }
        Shape::Circle { centre, radius_px, inside, outline } => {
            fill(content, *inside);
            pen(content, outline);
            circle(content, *centre, *radius_px);
            if outline.width_px > 0.0 {
                content.fill_nonzero_and_stroke();
            } else {
                content.fill_nonzero();
            }
        }
    }
}

fn pen(content: &mut Content, look: &Look) {
    let [red, green, blue] = colour(look.colour);
    content.set_stroke_rgb(red, green, blue).set_line_width(single(look.width_px));
    content.set_dash_pattern(look.dash.iter().map(|length_px| single(*length_px)), 0.0);
}

fn path(content: &mut Content, places: &[Px]) {
    for (number, [x, y]) in places.iter().enumerate() {
        let (x, y) = (single(*x), -single(*y));
        if number == 0 {
            content.move_to(x, y)
        } else {
            content.line_to(x, y)
        };
    }
}

fn rectangles(content: &mut Content, areas: &[(Px, Px)]) {
    for ([left, top], [width, height]) in areas {
        content.rect(single(*left), -single(*top), single(*width), -single(*height));
    }
    content.fill_nonzero();
}

fn circle(content: &mut Content, [x, y]: Px, radius: f64) {
    /// Distance of a quarter circle's control points from its ends, as a share of the radius. PDF draws circles as
    /// cubic curves.
    const CONTROL: f64 = 0.552_284_75;
    let point = |across: f64, up: f64| [single(x + radius * across), single(radius * up - y)];
    let [from_x, from_y] = point(1.0, 0.0);
    content.move_to(from_x, from_y);
    for [across, up] in [[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0]] {
        let first = point(across - CONTROL * up, up + CONTROL * across);
        let second = point(CONTROL * across - up, CONTROL * up + across);
        let end = point(-up, across);
        content.cubic_to(first[0], first[1], second[0], second[1], end[0], end[1]);
    }
    content.close_path();
}

fn draw_text(content: &mut Content, [x, y]: Px, down_px: f64, text: &str, (side, letters): (Side, Letters)) {
    let Letters { size_px, bold, upright, .. } = letters;
    let width_px = Font { size_pt: size_px, bold }.width_pt(text);
    let back_px = match side {
        Side::Right => 0.0,
        Side::Middle => width_px / 2.0,
        Side::Left => width_px,
    };
    let matrix = if upright {
        [0.0, 1.0, -1.0, 0.0, single(x + down_px), single(-y - back_px)]
    } else {
        [1.0, 0.0, 0.0, 1.0, single(x - back_px), single(-y - down_px)]
    };
    content.begin_text().set_font(FONTS[usize::from(bold)].0, single(size_px)).set_text_matrix(matrix);
    content.show(Str(&codes(text))).end_text();
}

/// Writes the file: catalogue, fonts, and each page with its footer.
fn written(pages: Vec<Content>, document: &Document) -> Vec<u8> {
    let (catalogue, tree, info) = (Ref::new(1), Ref::new(2), Ref::new(3));
    let fonts = [Ref::new(4), Ref::new(5)];
    let count = i32::try_from(pages.len()).unwrap_or(i32::MAX);
    let page = |number: i32| (Ref::new(6 + 2 * number), Ref::new(7 + 2 * number));
    let mut writer = Writer::new();
    writer.catalog(catalogue).pages(tree).lang(TextStr("en-GB"));
    writer.pages(tree).kids((0..count).map(|number| page(number).0)).count(count);
    writer.document_info(info).title(TextStr(&document.title)).producer(TextStr("headrace"));
    for (font, (_, name)) in fonts.into_iter().zip(FONTS) {
        writer.type1_font(font).base_font(name).encoding_predefined(Name(b"WinAnsiEncoding"));
    }
    for (number, mut content) in (0..count).zip(pages) {
        footer(&mut content, document, &format!("Page {} of {count}", number + 1));
        let (this, stream) = page(number);
        let mut page = writer.page(this);
        page.parent(tree).contents(stream);
        page.media_box(Rect::new(0.0, 0.0, single(PAGE_PT[0]), single(PAGE_PT[1])));
        let mut resources = page.resources();
        let mut names = resources.fonts();
        for (font, (name, _)) in fonts.into_iter().zip(FONTS) {
            names.pair(name, font);
        }
        names.finish();
        resources.finish();
        page.finish();
        writer.stream(stream, &packed(&content.finish())).filter(Filter::FlateDecode);
    }
    writer.finish()
}

fn footer(content: &mut Content, document: &Document, page: &str) {
    let baseline_pt = PAGE_PT[1] - 40.0;
    let right = format!("{}   {page}", document.footer);
    content.set_fill_gray(0.0);
    text(content, [PAGE_PT[0] - MARGIN_PT - FOOTER.width_pt(&right), baseline_pt], &right, FOOTER);
    let room_pt = ROOM_PT - FOOTER.width_pt(&right) - 12.0;
    if let Some(title) = FOOTER.broken(&document.title, room_pt).first() {
        text(content, [MARGIN_PT, baseline_pt], title, FOOTER);
    }
}

/// Compresses a page's content.
fn packed(content: &[u8]) -> Vec<u8> {
    let mut encoder = ZlibEncoder::new(Vec::new(), Compression::default());
    // Writing to a Vec can't fail.
    encoder.write_all(content).and_then(|()| encoder.finish()).unwrap_or_default()
}
