//! The operator's page over real sockets. Checks its data, its access rights, and that the page doesn't influence the
//! dive.

#![cfg(unix)]
#![allow(clippy::unwrap_used, clippy::panic, reason = "a failed step ends the test")]

mod access;
mod address;
mod commands;
mod contents;
#[cfg(feature = "tls")]
mod tls;
mod undisturbed;
mod voice;
mod words;
