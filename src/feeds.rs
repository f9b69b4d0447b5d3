//! Wrappers around a dive's packet source that let it end early and report its progress.

use std::cell::Cell;
use std::sync::atomic::{AtomicBool, Ordering};

use headrace_geometry::time::MonoNs;
use headrace_monitor::ring::{Port, RingError};
use headrace_replay::drive::{Coming, PacketSource};
use headrace_replay::log::LogError;

/// A packet source that ends as soon as the flag `interrupted` is set.
pub(crate) struct Interruptible<'a> {
    pub(crate) feed: &'a mut dyn PacketSource,
    pub(crate) interrupted: &'a AtomicBool,
}

impl PacketSource for Interruptible<'_> {
    fn coming(&mut self) -> Result<Option<Coming>, LogError> {
        if self.interrupted.load(Ordering::Relaxed) { Ok(None) } else { self.feed.coming() }
    }

    fn send(&mut self, port: &mut Port) -> Result<(), RingError> {
        self.feed.send(port)
    }

    fn span(&self) -> Option<(MonoNs, MonoNs)> {
        self.feed.span()
    }
}

/// A packet source that stores the time of its next packet in `at`.
pub(crate) struct Followed<'a> {
    pub(crate) feed: &'a mut dyn PacketSource,
    pub(crate) at: &'a Cell<MonoNs>,
}

impl PacketSource for Followed<'_> {
    fn coming(&mut self) -> Result<Option<Coming>, LogError> {
        let coming = self.feed.coming()?;
        if let Some(coming) = coming {
            self.at.set(coming.at);
        }
        Ok(coming)
    }

    fn send(&mut self, port: &mut Port) -> Result<(), RingError> {
        self.feed.send(port)
    }

    fn span(&self) -> Option<(MonoNs, MonoNs)> {
        self.feed.span()
    }
}

/// Share of a time span that has passed at `at`, 0 to 1; `None` without a span.
pub(crate) fn share(span: Option<(MonoNs, MonoNs)>, at: MonoNs) -> Option<f64> {
    let (from, to) = span?;
    let whole_s = to.since(from).as_secs_f64();
    (whole_s > 0.0).then(|| (at.since(from).as_secs_f64() / whole_s).clamp(0.0, 1.0))
}
