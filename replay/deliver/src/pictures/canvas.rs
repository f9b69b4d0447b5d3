//! The drawing sheet of a figure. Positions are in pixels from the upper left corner.

use std::cell::RefCell;

use headrace_geometry::math;
use svg::node::element;
use svg::{Document, Node};

use super::look::{BLACK, Colour, DIM, Look, Marker, WHITE};
use super::polyline::{self, Px};

/// Default width and height of a drawing sheet, pixels.
pub const SIZE_PX: [u32; 2] = [900, 560];
/// Mean letter width of plain and of bold text, as a share of the font size. Both are slightly too large for common
/// fonts.
const LETTER: [f64; 2] = [0.56, 0.65];

/// Horizontal alignment of a text at its position.
#[derive(Debug, Clone, Copy)]
pub enum Side {
    /// The text extends to the right of its position.
    Right,
    /// The text extends to the left of its position.
    Left,
    /// The text is centred on its position.
    Middle,
}

/// Style of a text.
#[derive(Debug, Clone, Copy)]
pub struct Letters {
    /// Height of the letters, pixels.
    pub size_px: f64,
    /// Colour of the letters.
    pub colour: Colour,
    /// Whether the letters are bold.
    pub bold: bool,
    /// Whether the text is rotated to run upwards.
    pub upright: bool,
}

/// Style of labels and axis names.
pub const NORMAL: Letters = Letters { size_px: 13.0, colour: BLACK, bold: false, upright: false };
/// Style of axis numbers and notes.
pub const SMALL: Letters = Letters { size_px: 12.0, colour: DIM, bold: false, upright: false };
/// Style of headings and results.
pub const BOLD: Letters = Letters { bold: true, ..NORMAL };
const TITLE: Letters = Letters { size_px: 18.0, bold: true, ..NORMAL };

/// A sheet and everything drawn so far. A later drawing covers an earlier one.
pub struct Canvas(RefCell<Document>);

/// Approximate width of a text, pixels.
pub fn width_px(text: &str, letters: Letters) -> f64 {
    letter_px(letters) * text.chars().count() as f64
}

fn letter_px(letters: Letters) -> f64 {
    LETTER[usize::from(letters.bold)] * letters.size_px
}

fn fitting(text: &str, room_px: f64, letters: Letters) -> String {
    if width_px(text, letters) <= room_px {
        return text.to_owned();
    }
    let most = math::floor_to_i64(room_px / letter_px(letters)) - 1;
    text.chars().take(usize::try_from(most).unwrap_or(0)).chain(['…']).collect()
}

/// Formats a number of pixels to a tenth, which is finer than the eye resolves.
fn number(px: f64) -> String {
    let text = format!("{:.1}", px + 0.0);
    let text = text.strip_suffix(".0").unwrap_or(&text);
    if text == "-0" { "0".to_owned() } else { text.to_owned() }
}

fn points(places: &[Px]) -> String {
    let pairs: Vec<String> = places.iter().map(|[x, y]| format!("{},{}", number(*x), number(*y))).collect();
    pairs.join(" ")
}

fn hex(Colour(red, green, blue): Colour) -> String {
    format!("#{red:02x}{green:02x}{blue:02x}")
}

impl Canvas {
    /// A white sheet of [`SIZE_PX`] with two title lines; the second is truncated if too long.
    pub fn new(title: &str, subtitle: &str) -> Self {
        Self::of_size(SIZE_PX, title, subtitle)
    }

    /// A sheet like [`Canvas::new`] with a given width and height, pixels.
    pub fn of_size([width, height]: [u32; 2], title: &str, subtitle: &str) -> Self {
        let document = Document::new()
            .set("width", width)
            .set("height", height)
            .set("viewBox", (0, 0, width, height))
            .set("font-family", "sans-serif");
        let canvas = Self(RefCell::new(document));
        canvas.area([0.0, 0.0], [width, height].map(f64::from), WHITE);
        canvas.text([14.0, 22.0], title, Side::Right, TITLE);
        let room = f64::from(width) - 28.0;
        canvas.text([14.0, 44.0], &fitting(subtitle, room, NORMAL), Side::Right, NORMAL);
        canvas
    }

    /// Returns the sheet as SVG.
    pub fn into_svg(self) -> String {
        format!("{}\n", self.0.into_inner())
    }

    fn put(&self, node: impl Node) {
        self.0.borrow_mut().append(node);
    }

    /// Draws a line of text whose vertical centre is at the given position.
    pub fn text(&self, [x, y]: Px, text: &str, side: Side, letters: Letters) {
        let anchor = match side {
            Side::Right => "start",
            Side::Left => "end",
            Side::Middle => "middle",
        };
        // Not every viewer supports vertical centring, so the baseline is moved instead. The middle of a letter is
        // about a third of the font size above the baseline.
        let mut node = element::Text::new(text)
            .set("x", number(x))
            .set("y", number(y + 0.35 * letters.size_px))
            .set("text-anchor", anchor)
            .set("font-size", number(letters.size_px))
            .set("fill", hex(letters.colour));
        if letters.bold {
            node = node.set("font-weight", "bold");
        }
        if letters.upright {
            node = node.set("transform", format!("rotate(-90 {} {})", number(x), number(y)));
        }
        self.put(node);
    }

    /// Draws a line of text on a white background, for places where lines cross the text.
    pub fn text_on_white(&self, place: Px, text: &str, side: Side, letters: Letters) {
        let width = width_px(text, letters);
        let left = match side {
            Side::Right => place[0] - 2.0,
            Side::Left => place[0] - width + 2.0,
            Side::Middle => place[0] - width / 2.0,
        };
        let half = letters.size_px * 0.6;
        self.area([left, place[1] - half], [left + width, place[1] + half], WHITE);
        self.text(place, text, side, letters);
    }

    /// Draws a rectangle without an outline.
    pub fn area(&self, [left, top]: Px, [right, bottom]: Px, colour: Colour) {
        let node = element::Rectangle::new()
            .set("x", number(left))
            .set("y", number(top))
            .set("width", number(right - left))
            .set("height", number(bottom - top))
            .set("fill", hex(colour));
        self.put(node);
    }

    /// Draws round dots of one colour as a single SVG element.
    pub fn dots(&self, places: &[Px], across_px: f64, colour: Colour) {
        let dot = |[x, y]: &Px| format!("M{} {}h0", number(*x), number(*y));
        let node = element::Path::new()
            .set("d", places.iter().map(dot).collect::<String>())
            .set("fill", "none")
            .set("stroke", hex(colour))
            .set("stroke-width", number(across_px))
            .set("stroke-linecap", "round");
        self.put(node);
    }

    /// Draws rectangles of one colour as a single SVG element. Each rectangle is given by its upper left corner, width
    /// and height.
    pub fn areas(&self, areas: &[(Px, Px)], colour: Colour) {
        let area = |([left, top], [width, height]): &(Px, Px)| {
            let [width, height] = [width, height].map(|px| number(*px));
            format!("M{} {}h{width}v{height}h-{width}z", number(*left), number(*top))
        };
        let node = element::Path::new()
            .set("d", areas.iter().map(area).collect::<String>())
            .set("fill", hex(colour))
            // Crisp edges turn off anti-aliasing, which would show the sheet between adjacent rectangles.
            .set("shape-rendering", "crispEdges");
        self.put(node);
    }

    /// Draws a line with an arrowhead at each end.
    pub fn span(&self, from: Px, to: Px, look: &Look) {
        self.line(&[from, to], look);
        let [dx, dy] = [to[0] - from[0], to[1] - from[1]];
        let length_px = math::hypot(dx, dy).max(1e-9);
        let (ahead, aside) = ([dx / length_px, dy / length_px], [-dy / length_px, dx / length_px]);
        let long_px = 7.0_f64.min(length_px / 2.5);
        for (tip, way) in [(from, 1.0), (to, -1.0)] {
            let corner =
                |side: f64| [0, 1].map(|k| tip[k] + long_px * (way * ahead[k] + 0.45 * side * aside[k]));
            self.polygon(&[tip, corner(1.0), corner(-1.0)], look.colour);
        }
    }

    /// Draws a filled polygon without an outline.
    pub fn polygon(&self, corners: &[Px], colour: Colour) {
        self.put(element::Polygon::new().set("points", points(corners)).set("fill", hex(colour)));
    }

    /// Draws a line through these positions with the given look.
    pub fn line(&self, places: &[Px], look: &Look) {
        let mut node = element::Polyline::new()
            .set("points", points(&polyline::thinned(places)))
            .set("fill", "none")
            .set("stroke", hex(look.colour))
            .set("stroke-width", number(look.width_px));
        if !look.dash.is_empty() {
            let dash: Vec<String> = look.dash.iter().map(|length_px| number(*length_px)).collect();
            node = node.set("stroke-dasharray", dash.join(" "));
        }
        self.put(node);
    }

    /// Draws a marker, filled or with a white interior.
    pub fn marker(&self, place: Px, look: &Look, size_px: f64, filled: bool) {
        let inside = if filled { look.colour } else { WHITE };
        let outline = Look { width_px: 1.4, dash: &[], ..*look };
        if look.marker == Marker::Circle {
            let node = element::Circle::new()
                .set("cx", number(place[0]))
                .set("cy", number(place[1]))
                .set("r", number(size_px))
                .set("fill", hex(inside))
                .set("stroke", hex(look.colour))
                .set("stroke-width", number(if filled { 0.0 } else { outline.width_px }));
            self.put(node);
            return;
        }
        let corner = |[x, y]: &[f64; 2]| [place[0] + size_px * x, place[1] + size_px * y];
        let mut corners: Vec<Px> = look.marker.corners().iter().map(corner).collect();
        self.polygon(&corners, inside);
        corners.extend(corners.first().copied());
        if !filled {
            self.line(&corners, &outline);
        }
    }
}
