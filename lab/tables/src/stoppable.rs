//! A log that ends early when another thread requests it.

use std::sync::atomic::{AtomicBool, Ordering};

use headrace_monitor::SourceInfo;
use headrace_monitor::ring::{Port, RingError};
use headrace_replay::drive::{Coming, PacketSource};
use headrace_replay::log::LogError;
use headrace_replay::player::Player;

use crate::Error;

pub(crate) struct Stoppable<'a> {
    player: &'a mut Player,
    stop: &'a AtomicBool,
}

impl<'a> Stoppable<'a> {
    pub(crate) fn new(player: &'a mut Player, stop: &'a AtomicBool) -> Self {
        Self { player, stop }
    }

    pub(crate) fn connect(&mut self, sources: &[SourceInfo]) {
        self.player.connect(sources);
    }

    /// Checks whether a stop was requested.
    ///
    /// Errors: a stop was requested.
    pub(crate) fn check(&self) -> Result<(), Error> {
        if !self.stop.load(Ordering::Relaxed) {
            return Ok(());
        }
        let log = self.player.files().first().map(|file| file.path.clone()).unwrap_or_default();
        Err(Error::Stopped { log })
    }
}

impl PacketSource for Stoppable<'_> {
    fn coming(&mut self) -> Result<Option<Coming>, LogError> {
        if self.stop.load(Ordering::Relaxed) { Ok(None) } else { self.player.coming() }
    }

    fn send(&mut self, port: &mut Port) -> Result<(), RingError> {
        self.player.send(port)
    }
}
