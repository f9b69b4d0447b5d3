//! Colours of figures.

/// A colour as red, green and blue.
#[derive(Debug, Clone, Copy)]
pub struct Colour(pub u8, pub u8, pub u8);

/// Colour of text and main curves.
pub const BLACK: Colour = Colour(0, 0, 0);
/// Colour of small text, axes and targets.
pub const DIM: Colour = Colour(85, 85, 85);
/// Colour of label leaders and hidden parts.
pub const PALE: Colour = Colour(150, 150, 150);
/// Colour of the sheet.
pub const WHITE: Colour = Colour(255, 255, 255);
