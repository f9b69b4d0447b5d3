//! The operator's page: a model of the dive, and the server that shows it to browsers.
//!
//! [`collector`] takes values of the loop between ticks and hands them, in a bounded queue, to the page's thread; in a live dive it
//! never waits. There [`model`] holds what is shown, pure, and [`server`] gives each message, encoded once, to all viewers.
//! `docs/how-to/read-the-page.md` is for who uses it, `docs/reference/page-feed.md` for who builds his own.

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
