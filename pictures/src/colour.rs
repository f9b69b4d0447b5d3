//! Colours of figures.

/// A colour as red, green and blue.
#[derive(Debug, Clone, Copy)]
pub struct Colour(pub u8, pub u8, pub u8);

/// Text and the main curves.
pub const BLACK: Colour = Colour(0, 0, 0);
/// Small text, axes, targets.
pub const DIM: Colour = Colour(85, 85, 85);
/// Label leaders, hidden parts.
pub const PALE: Colour = Colour(150, 150, 150);
/// Background of the sheet.
pub const WHITE: Colour = Colour(255, 255, 255);
