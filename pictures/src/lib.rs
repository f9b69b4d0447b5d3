//! What figures are drawn with: a sheet, charts, looks of lines and markers, labels; as SVG text.
//!
//! Drawn for white paper: every line has a dash pattern and a label of its own besides its colour. The same input gives
//! the same bytes.

pub mod canvas;
pub mod chart;
pub mod clock;
pub mod colour;
pub mod labels;
pub mod look;
pub mod polyline;
pub mod xml;
