//! The sheet that a picture is drawn on, in pixels from its upper left corner.

use headrace_core::math;
use plotters::coord::Shift;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use super::PictureError;
use super::look::{Look, Marker};
use super::polyline;

/// A place on the sheet: to the right and down, pixels.
pub(super) type Px = [f64; 2];

/// Width and height of a picture, pixels.
pub(super) const SIZE_PX: [u32; 2] = [900, 560];
/// plotters knows whole units only: a pixel is ten of them, lest slanting lines become stairs.
const UNITS: u32 = 10;
/// What plotters divides the size of letters by on its way to SVG.
const PLOTTERS_POINTS: f64 = 1.24;
/// Mean width of a letter of the usual fonts, plain and bold, as a share of their size; rather too wide.
const LETTER: [f64; 2] = [0.56, 0.65];

pub(super) const BLACK: RGBColor = RGBColor(0, 0, 0);
pub(super) const DIM: RGBColor = RGBColor(85, 85, 85);
pub(super) const PALE: RGBColor = RGBColor(150, 150, 150);
pub(super) const WHITE: RGBColor = RGBColor(255, 255, 255);

/// Where a text stands with respect to its place.
#[derive(Debug, Clone, Copy)]
pub(super) enum Side {
    Right,
    Left,
    Middle,
}

/// How a text is written.
#[derive(Debug, Clone, Copy)]
pub(super) struct Letters {
    pub(super) size_px: f64,
    pub(super) colour: RGBColor,
    pub(super) bold: bool,
    /// Upwards instead of to the right.
    pub(super) upright: bool,
}

pub(super) const NORMAL: Letters = Letters { size_px: 13.0, colour: BLACK, bold: false, upright: false };
pub(super) const SMALL: Letters = Letters { size_px: 12.0, colour: DIM, bold: false, upright: false };
pub(super) const BOLD: Letters = Letters { bold: true, ..NORMAL };
const TITLE: Letters = Letters { size_px: 18.0, bold: true, ..NORMAL };

pub(super) struct Canvas<'a> {
    root: DrawingArea<SVGBackend<'a>, Shift>,
}

pub(super) type Drawn = Result<(), PictureError>;

/// A white sheet with two lines of title, and what `draw` puts on it, as SVG.
pub(super) fn sheet(
    title: &str,
    subtitle: &str,
    draw: impl FnOnce(&Canvas<'_>) -> Drawn,
) -> Result<String, PictureError> {
    let mut svg = String::new();
    {
        let size = (SIZE_PX[0] * UNITS, SIZE_PX[1] * UNITS);
        let canvas = Canvas { root: SVGBackend::with_string(&mut svg, size).into_drawing_area() };
        canvas.root.fill(&WHITE).map_err(failed)?;
        canvas.text([14.0, 22.0], title, Side::Right, TITLE)?;
        let room = f64::from(SIZE_PX[0]) - 28.0;
        canvas.text([14.0, 44.0], &fitting(subtitle, room, NORMAL), Side::Right, NORMAL)?;
        draw(&canvas)?;
        canvas.root.present().map_err(failed)?;
    }
    // Units are seen by the drawing alone: whoever embeds the picture gets its size in pixels.
    let [width, height] = SIZE_PX;
    let inside = format!("<svg width=\"{}\" height=\"{}\"", width * UNITS, height * UNITS);
    Ok(svg.replacen(&inside, &format!("<svg width=\"{width}\" height=\"{height}\""), 1))
}

fn failed(why: impl std::fmt::Display) -> PictureError {
    PictureError::Drawing(why.to_string())
}

/// About how wide a text will be, pixels.
pub(super) fn width_px(text: &str, letters: Letters) -> f64 {
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

/// Pixels in plotters' units.
fn units(px: f64) -> i32 {
    i32::try_from(math::round_to_i64(px * f64::from(UNITS))).unwrap_or(0)
}

fn at(place: Px) -> (i32, i32) {
    (units(place[0]), units(place[1]))
}

fn stroke(look: &Look) -> ShapeStyle {
    look.colour.stroke_width(units(look.width_px).unsigned_abs())
}

/// A style of plotters' for text.
fn style(letters: Letters, side: Side) -> TextStyle<'static> {
    let weight = if letters.bold { FontStyle::Bold } else { FontStyle::Normal };
    let size = letters.size_px * f64::from(UNITS) * PLOTTERS_POINTS;
    let font = FontDesc::new(FontFamily::SansSerif, size, weight);
    let font = if letters.upright { font.transform(FontTransform::Rotate270) } else { font };
    let side = match side {
        Side::Right => HPos::Left,
        Side::Left => HPos::Right,
        Side::Middle => HPos::Center,
    };
    TextStyle { font, color: letters.colour.to_backend_color(), pos: Pos::new(side, VPos::Center) }
}

impl Canvas<'_> {
    /// A line of text, centred on its place from top to bottom.
    pub(super) fn text(&self, place: Px, text: &str, side: Side, letters: Letters) -> Drawn {
        self.root.draw_text(text, &style(letters, side), at(place)).map_err(failed)
    }

    /// The same on a white ground, for places that lines cross.
    pub(super) fn text_on_white(&self, place: Px, text: &str, side: Side, letters: Letters) -> Drawn {
        let width = width_px(text, letters);
        let left = match side {
            Side::Right => place[0] - 2.0,
            Side::Left => place[0] - width + 2.0,
            Side::Middle => place[0] - width / 2.0,
        };
        let half = letters.size_px * 0.6;
        self.area([left, place[1] - half], [left + width, place[1] + half], WHITE)?;
        self.text(place, text, side, letters)
    }

    /// A rectangle without an outline.
    pub(super) fn area(&self, upper_left: Px, lower_right: Px, colour: RGBColor) -> Drawn {
        self.root.draw(&Rectangle::new([at(upper_left), at(lower_right)], colour.filled())).map_err(failed)
    }

    /// A filled polygon without an outline.
    pub(super) fn polygon(&self, corners: &[Px], colour: RGBColor) -> Drawn {
        let corners: Vec<_> = corners.iter().map(|corner| at(*corner)).collect();
        self.root.draw(&Polygon::new(corners, colour.filled())).map_err(failed)
    }

    /// A line through these places as a look has it.
    pub(super) fn line(&self, places: &[Px], look: &Look) -> Drawn {
        for piece in polyline::dashes(&polyline::thinned(places), look.dash) {
            let piece: Vec<_> = piece.into_iter().map(at).collect();
            self.root.draw(&PathElement::new(piece, stroke(look))).map_err(failed)?;
        }
        Ok(())
    }

    /// A marker, filled or with a white inside.
    pub(super) fn marker(&self, place: Px, look: &Look, size_px: f64, filled: bool) -> Drawn {
        let inside = if filled { look.colour } else { WHITE };
        let outline = Look { width_px: 1.4, dash: &[], ..*look };
        if look.marker == Marker::Circle {
            let circle = |style: ShapeStyle| Circle::new(at(place), units(size_px), style);
            self.root.draw(&circle(inside.filled())).map_err(failed)?;
            return if filled { Ok(()) } else { self.root.draw(&circle(stroke(&outline))).map_err(failed) };
        }
        let corner = |[x, y]: &[f64; 2]| [place[0] + size_px * x, place[1] + size_px * y];
        let mut corners: Vec<Px> = look.marker.corners().iter().map(corner).collect();
        self.polygon(&corners, inside)?;
        corners.extend(corners.first().copied());
        if filled { Ok(()) } else { self.line(&corners, &outline) }
    }
}
