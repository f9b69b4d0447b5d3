//! Looks of lines and markers, never distinguished by colour alone.

use super::colour::{BLACK, Colour, DIM, PALE};

/// The palette of Okabe and Ito, which most colour-blind people can distinguish, without the colours too pale for
/// lines.
const BLUE: Colour = Colour(0, 114, 178);
const VERMILION: Colour = Colour(213, 94, 0);
const GREEN: Colour = Colour(0, 158, 115);
const PURPLE: Colour = Colour(170, 51, 119);

/// Shape that marks a point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Marker {
    /// Drawn as a circle; has no corners.
    Circle,
    /// Sides vertical and horizontal.
    Square,
    /// Tip up.
    Triangle,
    /// A square on its corner.
    Diamond,
    /// A triangle with its tip down.
    Down,
}

impl Marker {
    /// Its corners, about a circle of radius 1.
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
    /// Lengths of dash, gap, dash, ..., pixels; empty for a solid line.
    pub dash: &'static [f64],
    /// Marker of its points.
    pub marker: Marker,
}

const fn look(colour: Colour, dash: &'static [f64], marker: Marker) -> Look {
    Look { colour, width_px: 2.0, dash, marker }
}

/// Looks for series of several curves: modes, heads.
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

/// The look of curve number `number` among several.
pub fn of_several(number: usize) -> Look {
    SEVERAL.get(number % SEVERAL.len()).copied().unwrap_or(T)
}

/// T, and curves that represent it.
pub const T: Look = look(BLACK, &[], Marker::Circle);
/// T_x: between passes.
pub const T_X: Look = look(BLUE, &[10.0, 4.0], Marker::Square);
/// T_y: between neighbours of a turn.
pub const T_Y: Look = look(VERMILION, &[3.0, 3.0], Marker::Triangle);
/// The target.
pub const TARGET: Look = Look { width_px: 1.6, ..look(DIM, &[6.0, 5.0], Marker::Circle) };
/// The requested value.
pub const ASKED: Look = Look { width_px: 1.4, ..look(DIM, &[2.0, 4.0], Marker::Circle) };
/// Parts occluded by the vehicle.
pub const HIDDEN: Look = Look { width_px: 1.2, ..look(PALE, &[1.5, 3.5], Marker::Circle) };
/// Grid lines.
pub const GRID: Look = Look { width_px: 0.8, ..look(Colour(228, 228, 228), &[], Marker::Circle) };
/// The axes.
pub const AXIS: Look = Look { width_px: 1.0, ..look(DIM, &[], Marker::Circle) };
/// A line from a label to its item.
pub const LEADER: Look = Look { width_px: 0.8, ..look(PALE, &[], Marker::Circle) };
