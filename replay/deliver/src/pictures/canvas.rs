//! The drawing sheet of a figure. Positions are in pixels from the upper left corner.

use std::cell::RefCell;

use headrace_geometry::math;

use super::look::{BLACK, Colour, DIM, Look, Marker, WHITE};
use super::polyline::{self, Px};
use super::shape::Shape;
pub use super::shape::{Drawing, Letters, Side};

/// Default width and height of a drawing sheet, pixels.
pub const SIZE_PX: [u32; 2] = [900, 560];
/// Mean letter width of plain and of bold text, as a share of the font size. Both are slightly too large for common
/// fonts.
const LETTER: [f64; 2] = [0.56, 0.65];

/// Style of labels and axis names.
pub const NORMAL: Letters = Letters { size_px: 13.0, colour: BLACK, bold: false, upright: false };
/// Style of axis numbers and notes.
pub const SMALL: Letters = Letters { size_px: 12.0, colour: DIM, bold: false, upright: false };
/// Style of headings and results.
pub const BOLD: Letters = Letters { bold: true, ..NORMAL };
const TITLE: Letters = Letters { size_px: 18.0, bold: true, ..NORMAL };

/// A sheet and everything drawn so far. A later drawing covers an earlier one.
pub struct Canvas {
    size_px: [u32; 2],
    shapes: RefCell<Vec<Shape>>,
}

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

impl Canvas {
    /// A white sheet of [`SIZE_PX`] with two title lines; the second line is truncated if it is too long.
    pub fn new(title: &str, subtitle: &str) -> Self {
        Self::of_size(SIZE_PX, title, subtitle)
    }

    /// A sheet like [`Canvas::new`] with a given width and height, pixels.
    pub fn of_size(size_px: [u32; 2], title: &str, subtitle: &str) -> Self {
        let canvas = Self::untitled(size_px);
        canvas.text([14.0, 22.0], title, Side::Right, TITLE);
        let room = f64::from(size_px[0]) - 28.0;
        canvas.text([14.0, 44.0], &fitting(subtitle, room, NORMAL), Side::Right, NORMAL);
        canvas
    }

    /// A white sheet of a given width and height, pixels, for a figure whose caption is elsewhere.
    pub fn untitled(size_px: [u32; 2]) -> Self {
        let canvas = Self { size_px, shapes: RefCell::default() };
        canvas.area([0.0, 0.0], size_px.map(f64::from), WHITE);
        canvas
    }

    /// Returns the finished sheet.
    pub fn finish(self) -> Drawing {
        Drawing { size_px: self.size_px, shapes: self.shapes.into_inner() }
    }

    /// Returns the sheet as SVG.
    pub fn into_svg(self) -> String {
        self.finish().svg()
    }

    fn put(&self, shape: Shape) {
        self.shapes.borrow_mut().push(shape);
    }

    /// Draws a line of text whose vertical centre is at the given position.
    pub fn text(&self, at: Px, text: &str, side: Side, letters: Letters) {
        // Not every viewer supports vertical centring, so the baseline is moved instead. The middle of a letter is
        // about a third of the font size above the baseline.
        self.put(Shape::Text { at, down_px: 0.35 * letters.size_px, text: text.to_owned(), side, letters });
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
    pub fn area(&self, upper_left: Px, lower_right: Px, colour: Colour) {
        self.put(Shape::Area { upper_left, lower_right, colour });
    }

    /// Draws round dots of one colour as a single SVG element.
    pub fn dots(&self, places: &[Px], across_px: f64, colour: Colour) {
        self.put(Shape::Dots { places: places.to_owned(), across_px, colour });
    }

    /// Draws rectangles of one colour as a single SVG element. Each rectangle is given by its upper left corner, width
    /// and height.
    pub fn areas(&self, areas: &[(Px, Px)], colour: Colour) {
        self.put(Shape::Areas { areas: areas.to_owned(), colour });
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
        self.put(Shape::Polygon { corners: corners.to_owned(), colour });
    }

    /// Draws a line through these positions with the given look.
    pub fn line(&self, places: &[Px], look: &Look) {
        self.put(Shape::Line { places: polyline::thinned(places), look: *look });
    }

    /// Draws a marker, filled or with a white interior.
    pub fn marker(&self, place: Px, look: &Look, size_px: f64, filled: bool) {
        let inside = if filled { look.colour } else { WHITE };
        let outline = Look { width_px: 1.4, dash: &[], ..*look };
        if look.marker == Marker::Circle {
            let width_px = if filled { 0.0 } else { outline.width_px };
            self.put(Shape::Circle {
                centre: place,
                radius_px: size_px,
                inside,
                outline: Look { width_px, ..outline },
            });
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
