//! A printable document, which can be written as HTML and as PDF. Equal documents give equal bytes.

mod helvetica;
mod html;
mod layout;
mod model;
mod pdf;

pub use html::html;
pub use model::{Block, Document, Table};
pub use pdf::{Pdf, pdf};
