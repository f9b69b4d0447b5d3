//! The shapes of a drawing, and their form as SVG. Positions are in pixels from the upper left corner.

use svg::Node;
use svg::node::element;

use super::look::{Colour, Look};
use super::polyline::Px;

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

/// A finished drawing sheet.
#[derive(Debug, Clone)]
pub struct Drawing {
    /// Width and height, pixels.
    pub size_px: [u32; 2],
    /// Shapes in the order of drawing. A later shape covers an earlier one.
    pub(crate) shapes: Vec<Shape>,
}

/// A shape of a drawing.
#[derive(Debug, Clone)]
pub(crate) enum Shape {
    /// A line of text. Its baseline is `down_px` below the position, before an upright text is rotated about the
    /// position.
    Text { at: Px, down_px: f64, text: String, side: Side, letters: Letters },
    /// A rectangle.
    Area { upper_left: Px, lower_right: Px, colour: Colour },
    /// Round dots.
    Dots { places: Vec<Px>, across_px: f64, colour: Colour },
    /// Rectangles, each given by its upper left corner, width and height.
    Areas { areas: Vec<(Px, Px)>, colour: Colour },
    /// A filled polygon.
    Polygon { corners: Vec<Px>, colour: Colour },
    /// A line.
    Line { places: Vec<Px>, look: Look },
    /// A circle with an outline.
    Circle { centre: Px, radius_px: f64, inside: Colour, outline: Look },
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

impl Drawing {
    /// Returns the drawing as SVG.
    pub fn svg(&self) -> String {
        let [width, height] = self.size_px;
        let mut document = element::SVG::new()
            .set("width", width)
            .set("height", height)
            .set("viewBox", (0, 0, width, height))
            .set("font-family", "sans-serif");
        for shape in &self.shapes {
            shape.append_to(&mut document);
        }
        format!("{document}\n")
    }
}

impl Shape {
    fn append_to(&self, document: &mut element::SVG) {
        match self {
            Self::Text { at, down_px, text, side, letters } => {
                document.append(text_element(*at, *down_px, text, (*side, *letters)));
            }
            Self::Area { upper_left: [left, top], lower_right: [right, bottom], colour } => document.append(
                element::Rectangle::new()
                    .set("x", number(*left))
                    .set("y", number(*top))
                    .set("width", number(right - left))
                    .set("height", number(bottom - top))
                    .set("fill", hex(*colour)),
            ),
            Self::Dots { places, across_px, colour } => {
                let dot = |[x, y]: &Px| format!("M{} {}h0", number(*x), number(*y));
                document.append(
                    element::Path::new()
                        .set("d", places.iter().map(dot).collect::<String>())
                        .set("fill", "none")
                        .set("stroke", hex(*colour))
                        .set("stroke-width", number(*across_px))
                        .set("stroke-linecap", "round"),
                );
            }
            Self::Areas { areas, colour } => {
                let area = |([left, top], [width, height]): &(Px, Px)| {
                    let [width, height] = [width, height].map(|px| number(*px));
                    format!("M{} {}h{width}v{height}h-{width}z", number(*left), number(*top))
                };
                document.append(
                    element::Path::new()
                        .set("d", areas.iter().map(area).collect::<String>())
                        .set("fill", hex(*colour))
                        // Crisp edges turn anti-aliasing off. With anti-aliasing, the sheet would show between adjacent
                        // rectangles.
                        .set("shape-rendering", "crispEdges"),
                );
            }
            Self::Polygon { corners, colour } => document
                .append(element::Polygon::new().set("points", points(corners)).set("fill", hex(*colour))),
            Self::Line { places, look } => document.append(line_element(places, look)),
            Self::Circle { centre, radius_px, inside, outline } => document.append(
                element::Circle::new()
                    .set("cx", number(centre[0]))
                    .set("cy", number(centre[1]))
                    .set("r", number(*radius_px))
                    .set("fill", hex(*inside))
                    .set("stroke", hex(outline.colour))
                    .set("stroke-width", number(outline.width_px)),
            ),
        }
    }
}

fn text_element([x, y]: Px, down_px: f64, text: &str, (side, letters): (Side, Letters)) -> impl Node {
    let anchor = match side {
        Side::Right => "start",
        Side::Left => "end",
        Side::Middle => "middle",
    };
    let mut node = element::Text::new(text)
        .set("x", number(x))
        .set("y", number(y + down_px))
        .set("text-anchor", anchor)
        .set("font-size", number(letters.size_px))
        .set("fill", hex(letters.colour));
    if letters.bold {
        node = node.set("font-weight", "bold");
    }
    if letters.upright {
        node = node.set("transform", format!("rotate(-90 {} {})", number(x), number(y)));
    }
    node
}

fn line_element(places: &[Px], look: &Look) -> impl Node {
    let mut node = element::Polyline::new()
        .set("points", points(places))
        .set("fill", "none")
        .set("stroke", hex(look.colour))
        .set("stroke-width", number(look.width_px));
    if !look.dash.is_empty() {
        let dash: Vec<String> = look.dash.iter().map(|length_px| number(*length_px)).collect();
        node = node.set("stroke-dasharray", dash.join(" "));
    }
    node
}
