//! Draws figures: sheet, charts, looks of lines and markers, and labels.
//!
//! Figures are made for white paper: each line has its own dash pattern and label as well as its own colour. Equal
//! input gives equal bytes.

pub mod canvas;
pub mod chart;
pub mod clock;
pub mod labels;
pub mod look;
pub mod polyline;
pub mod shape;
pub mod xml;
