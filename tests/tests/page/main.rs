//! Tests the operator's page over real sockets: its data and its access rights. Also checks that the page doesn't
//! influence the dive.

#![cfg(unix)]
#![allow(clippy::unwrap_used, clippy::panic, reason = "a failed step ends the test")]

mod access;
mod address;
mod commands;
mod contents;
mod crawler;
mod crowd;
#[cfg(feature = "tls")]
mod tls;
mod undisturbed;
mod voice;
mod words;
