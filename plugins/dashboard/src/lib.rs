//! The operator's page: a model of the dive, and the server that sends it to browsers.
//!
//! Between ticks [`collector`] takes values from the loop and passes them to the page's thread through a bounded
//! queue. In a live dive it never waits. On the page's thread, [`model`] holds the displayed data without I/O.
//! [`server`] encodes each message once and sends it to all viewers.
//!
//! `docs/how-to/read-the-page.md` is for users of the page, `docs/reference/page-feed.md` for authors of
//! other clients.

pub mod access;
pub mod assets;
pub mod collector;
pub mod command;
mod compared;
pub mod export;
pub mod fed;
pub mod history;
pub mod model;
pub mod qr;
pub mod samples;
pub mod server;
pub mod site;
pub mod wire;

pub use access::{Role, Token, Tokens};
pub use command::{Command, Play};
pub use server::{Page, PageError, Settings, TlsFiles, Voices};
pub use site::{HeadSite, Mode, SensorSite, Site};
