//! Phases of a command, each logged with its duration.

use std::time::Instant;

use tracing::span::EnteredSpan;

/// A phase of a command. It lasts from its start until it is dropped.
///
/// Log messages of the same thread during the phase belong to the phase's span.
pub(crate) struct Phase {
    started: Instant,
    _span: EnteredSpan,
}

impl Phase {
    #[expect(clippy::disallowed_methods, reason = "durations are for people; no result depends on them")]
    pub(crate) fn start(name: &'static str) -> Self {
        let span = tracing::info_span!("phase", name).entered();
        tracing::debug!("started");
        Self { started: Instant::now(), _span: span }
    }
}

impl Drop for Phase {
    fn drop(&mut self) {
        tracing::info!(seconds = self.started.elapsed().as_secs_f64(), "ended");
    }
}
