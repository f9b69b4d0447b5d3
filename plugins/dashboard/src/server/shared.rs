//! State that the server's handlers share.

use std::net::IpAddr;
use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use tokio::sync::{Notify, broadcast};

use super::budget::Budgets;
use super::places::Places;
use super::voice_desk::Desk;
use super::wrong_tokens::WrongTokens;
use crate::access::Access;
use crate::command::{Command, Play};
use crate::model::{Message, Model};

/// Time after which a peer that accepts no data is dropped.
pub(super) const STALLED_AFTER: Duration = Duration::from_secs(10);

/// Handler of operators' commands. The handler's error is the reason for a refusal.
pub type Act = Arc<dyn Fn(Command) -> Result<(), String> + Send + Sync>;

/// Handler of commands to playback. The handler's error is the reason for a refusal.
pub type Direct = Arc<dyn Fn(Play) -> Result<(), String> + Send + Sync>;

/// Counters that `/metrics` reports.
#[derive(Debug, Default)]
pub(crate) struct Counts {
    pub(crate) viewers: AtomicUsize,
    pub(crate) served: AtomicU64,
    pub(crate) stalled: AtomicU64,
    pub(crate) lagged: AtomicU64,
    pub(crate) refused: AtomicU64,
    pub(crate) unauthorised: AtomicU64,
    pub(crate) foreign: AtomicU64,
    pub(crate) bytes: AtomicU64,
}

/// State shared by all handlers of requests.
pub(crate) struct Shared {
    pub(super) model: Mutex<Model>,
    pub(crate) access: Access,
    /// Sender of messages to all viewers; `None` once the page ends.
    pub(super) fan: Mutex<Option<broadcast::Sender<Arc<[Message]>>>>,
    pub(crate) counts: Counts,
    pub(crate) act: Act,
    pub(crate) direct: Direct,
    pub(crate) voices: Desk,
    pub(crate) is_tls: bool,
    pub(super) proxies: Vec<IpAddr>,
    pub(super) places: Arc<Places>,
    /// Budget of wrong tokens for each client.
    pub(super) guesses: Budgets,
    pub(super) wrong_tokens: WrongTokens,
    /// Budget of HTTP actions for each operator's address.
    pub(super) actions: Budgets,
    pub(super) stop: Notify,
    pub(super) has_ended: AtomicBool,
}

impl Shared {
    pub(crate) fn model(&self) -> MutexGuard<'_, Model> {
        self.model.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub(super) fn fan(&self) -> MutexGuard<'_, Option<broadcast::Sender<Arc<[Message]>>>> {
        self.fan.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Counts a viewer that was dropped because it accepted no data.
    pub(super) fn count_stalled(&self) {
        Self::count(&self.counts.stalled, 1);
        tracing::info!("a viewer of the page read nothing for {} s and was dropped", STALLED_AFTER.as_secs());
    }

    pub(crate) fn count(counter: &AtomicU64, by: u64) {
        counter.fetch_add(by, Ordering::Relaxed);
    }
}
