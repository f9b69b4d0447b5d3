//! What pictures are drawn with: a sheet, charts, looks of lines and markers, labels; as SVG text.
//!
//! Drawn for white paper: every line has a dash pattern and a label of its own besides its colour.

pub(crate) mod canvas;
pub(crate) mod chart;
pub(crate) mod clock;
pub(crate) mod labels;
pub(crate) mod look;
pub(crate) mod polyline;
pub(crate) mod scale;
#[cfg(test)]
pub(crate) mod xml;

use headrace_sampling::SamplingError;

/// Why there is no picture.
#[derive(Debug, thiserror::Error)]
pub(crate) enum PictureError {
    #[error("computing a picture: {0}")]
    Sampling(#[from] SamplingError),
}
