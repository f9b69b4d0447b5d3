//! The operator's page over real sockets: what viewers get, what they may do, and that the dive doesn't notice them.

#![cfg(unix)]
#![allow(clippy::unwrap_used, clippy::panic, reason = "a test stops at what it can't do")]

mod access;
mod commands;
mod contents;
#[cfg(feature = "tls")]
mod tls;
mod undisturbed;
mod voice;

/// A page on any port.
const ANY: &str = "--page=127.0.0.1:0";
