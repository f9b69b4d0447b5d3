//! Colours, and looks of lines and markers. Any two looks differ in more than colour, so that they can be distinguished
//! in black and white.

/// A colour as red, green and blue.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Colour(pub u8, pub u8, pub u8);

/// Colour of text and main curves.
pub const BLACK: Colour = Colour(0, 0, 0);
/// Colour of small text, axes and targets.
pub const DIM: Colour = Colour(85, 85, 85);
/// Colour of lines that connect labels with curves, and of parts that the vehicle occludes.
pub const PALE: Colour = Colour(150, 150, 150);
/// Colour of the sheet.
pub const WHITE: Colour = Colour(255, 255, 255);

/// Colours of the Okabe and Ito palette, which most colour-blind people can distinguish. Colours that are too pale for
/// lines are left out.
const BLUE: Colour = Colour(0, 114, 178);
const VERMILION: Colour = Colour(213, 94, 0);
const GREEN: Colour = Colour(0, 158, 115);
const PURPLE: Colour = Colour(170, 51, 119);

/// Shape that marks a point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Marker {
    /// A circle, which has no corners.
    Circle,
    /// A square with vertical and horizontal sides.
    Square,
    /// A triangle with its tip up.
    Triangle,
    /// A square that stands on a corner.
    Diamond,
    /// A triangle with its tip down.
    Down,
}

impl Marker {
    /// Returns the corners of the marker's shape, which lie close to a circle of radius 1.
    pub fn corners(self) -> &'static [[f64; 2]] {
        match self {
            Self::Circle => &[],
            Self::Square => &[[-0.9, -0.9], [0.9, -0.9], [0.9, 0.9], [-0.9, 0.9]],
            Self::Triangle => &[[0.0, -1.2], [1.1, 0.8], [-1.1, 0.8]],
            Self::Diamond => &[[0.0, -1.3], [1.3, 0.0], [0.0, 1.3], [-1.3, 0.0]],
            Self::Down => &[[0.0, 1.2], [1.1, -0.8], [-1.1, -0.8]],
        }
    }
}

/// Look of a line and its markers.
#[derive(Debug, Clone, Copy)]
pub struct Look {
    /// Colour of line, markers and labels.
    pub colour: Colour,
    /// Width of the line, pixels.
    pub width_px: f64,
    /// Lengths of dash and gap in turn, pixels; empty for a solid line.
    pub dash: &'static [f64],
    /// Shape that marks points on the line.
    pub marker: Marker,
}

const fn look(colour: Colour, dash: &'static [f64], marker: Marker) -> Look {
    Look { colour, width_px: 2.0, dash, marker }
}

/// Looks of the curves in a series, such as one curve per mode or per head.
const SEVERAL: [Look; 8] = [
    look(BLUE, &[], Marker::Circle),
    look(VERMILION, &[9.0, 4.0], Marker::Square),
    look(GREEN, &[14.0, 4.0, 3.0, 4.0], Marker::Triangle),
    look(PURPLE, &[3.0, 3.0], Marker::Diamond),
    look(BLACK, &[20.0, 5.0], Marker::Down),
    look(BLUE, &[6.0, 3.0], Marker::Square),
    look(VERMILION, &[10.0, 3.0, 3.0, 3.0, 3.0, 3.0], Marker::Triangle),
    look(GREEN, &[5.0, 7.0], Marker::Diamond),
];

/// Returns the look of curve number `number` in a series.
pub fn of_several(number: usize) -> Look {
    SEVERAL.get(number % SEVERAL.len()).copied().unwrap_or(T)
}

/// Look of T, the diagonal of the lattice of samples.
pub const T: Look = look(BLACK, &[], Marker::Circle);
/// Look of T_x, the spacing between passes.
pub const T_X: Look = look(BLUE, &[10.0, 4.0], Marker::Square);
/// Look of T_y, the spacing between neighbouring returns of a turn.
pub const T_Y: Look = look(VERMILION, &[3.0, 3.0], Marker::Triangle);
/// Look of the target, which is the largest hole that may pass.
pub const TARGET: Look = Look { width_px: 1.6, ..look(DIM, &[6.0, 5.0], Marker::Circle) };
/// Look of the value that the user requested.
pub const ASKED: Look = Look { width_px: 1.4, ..look(DIM, &[2.0, 4.0], Marker::Circle) };
/// Look of parts of a curve that the vehicle occludes.
pub const HIDDEN: Look = Look { width_px: 1.2, ..look(PALE, &[1.5, 3.5], Marker::Circle) };
/// Look of grid lines.
pub const GRID: Look = Look { width_px: 0.8, ..look(Colour(228, 228, 228), &[], Marker::Circle) };
/// Look of axes.
pub const AXIS: Look = Look { width_px: 1.0, ..look(DIM, &[], Marker::Circle) };
/// Look of the line that connects a label with the curve or marker that it names.
pub const LEADER: Look = Look { width_px: 0.8, ..look(PALE, &[], Marker::Circle) };
