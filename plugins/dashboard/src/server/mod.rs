//! The server: one thread with sockets and timers. In a live dive the loop's thread never waits for it.

#![expect(clippy::disallowed_types, reason = "locks between the page's threads; the loop's takes none")]

mod admission;
mod answers;
mod budget;
mod client;
mod feed;
mod listener;
mod metrics;
mod neighbours;
mod places;
mod pump;
mod reply;
mod stall;
mod voices;

use std::io;
use std::net::{IpAddr, SocketAddr};
use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::Duration;

use headrace_monitor::run::Loop;
use headrace_monitor::voice::Voice;
use tokio::net::TcpListener;
use tokio::sync::{Notify, broadcast, mpsc};

use crate::access::{Access, Tokens};
use crate::collector::{Collector, WAITING};
use crate::command::{Command, Play};
use crate::fed::Fed;
use crate::model::{Message, Model};
use crate::site::Site;

/// Default port.
pub const PORT: u16 = 8881;
/// Number of ports that are tried, starting with the requested one.
const PORTS: u16 = 10;
/// Number of batches that a viewer may be behind before it gets all changes at once.
const BATCHES: usize = 64;
/// Budget of wrong tokens of a client, in a burst and per second.
const MOST_GUESSES: f64 = 20.0;
const GUESSES_PER_S: f64 = 1.0;
/// Time in which viewers get the last messages.
const ENDS_WITHIN: Duration = Duration::from_secs(1);

/// Certificate and key as PEM files.
#[derive(Debug, Clone)]
pub struct TlsFiles {
    /// The certificate with its intermediate certificates.
    pub certificate: std::path::PathBuf,
    /// Its private key.
    pub key: std::path::PathBuf,
}

/// Address and access rules of the page.
#[derive(Debug, Clone)]
pub struct Settings {
    /// Address and port; port 0 is any free port.
    pub address: SocketAddr,
    /// Tokens; `None` on loopback.
    pub tokens: Option<Tokens>,
    /// Names of this machine.
    pub hosts: Vec<String>,
    /// Origins of pages that may frame this one and send actions.
    pub origins: Vec<String>,
    /// Proxies whose `X-Forwarded-For` is trusted.
    pub proxies: Vec<IpAddr>,
    /// Certificate and key.
    pub tls: Option<TlsFiles>,
}

/// Reason why the page can't be served.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PageError {
    /// No port is available.
    #[error("the page can't be served on {address} or the {PORTS} ports from there: {source}")]
    Bind {
        /// Requested address.
        address: SocketAddr,
        /// Reason.
        source: io::Error,
    },
    /// The thread or runtime can't be started.
    #[error("the page's thread can't be started: {0}")]
    Thread(io::Error),
    /// TLS can't be set up.
    #[error("{0}")]
    Tls(String),
}

/// Handler of operators' commands; its error is the reason of a refusal.
pub type Act = Arc<dyn Fn(Command) -> Result<(), String> + Send + Sync>;
/// Handler that logs the recording of a voice note and then notifies the loop; its error is the reason of a refusal.
pub type Keep = Arc<dyn Fn(&Voice) -> Result<(), String> + Send + Sync>;
/// Finds the recording of the note with this id and time (seconds) in a log; `None` without a readable one. It may
/// take seconds.
pub type Recall = Arc<dyn Fn(u32, f64) -> Result<Option<Voice>, String> + Send + Sync>;

/// Storage of voice recordings.
#[derive(Clone)]
pub enum Voices {
    /// None.
    None,
    /// The log of a live dive.
    Kept(Keep),
    /// A recorded log.
    Recalled(Recall),
}

/// Handler of playback commands.
pub type Direct = Arc<dyn Fn(Play) -> Result<(), String> + Send + Sync>;

/// Counters for `/metrics`.
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

/// State shared by the handlers.
pub(crate) struct Shared {
    model: Mutex<Model>,
    pub(crate) access: Access,
    /// `None` once the page ends.
    fan: Mutex<Option<broadcast::Sender<Arc<[Message]>>>>,
    pub(crate) counts: Counts,
    pub(crate) act: Act,
    pub(crate) direct: Direct,
    pub(crate) voices: voices::Desk,
    pub(crate) is_tls: bool,
    proxies: Vec<IpAddr>,
    places: Arc<places::Places>,
    /// Budget of wrong tokens of each client.
    guesses: budget::Budgets,
    wrong_tokens: admission::WrongTokens,
    /// Budget of actions by HTTP of each operator.
    actions: budget::Budgets,
    stop: Notify,
    has_ended: AtomicBool,
}

impl Shared {
    pub(crate) fn model(&self) -> MutexGuard<'_, Model> {
        self.model.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn fan(&self) -> MutexGuard<'_, Option<broadcast::Sender<Arc<[Message]>>>> {
        self.fan.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Counts a viewer that accepted no data for too long.
    fn count_stalled(&self) {
        Self::count(&self.counts.stalled, 1);
        tracing::info!(
            "a viewer of the page read nothing for {} s and was dropped",
            stall::STALLED_AFTER.as_secs()
        );
    }

    pub(crate) fn count(counter: &AtomicU64, by: u64) {
        counter.fetch_add(by, Ordering::Relaxed);
    }
}

/// A page that is served.
pub struct Page {
    shared: Arc<Shared>,
    thread: Option<JoinHandle<()>>,
    sender: mpsc::Sender<Fed>,
    address: SocketAddr,
    /// Ports that were taken by other programs.
    taken: Vec<u16>,
}

impl Page {
    /// Serves a dive. `instance` is its unique name.
    ///
    /// Errors: see [`PageError`].
    pub fn start(
        settings: Settings,
        site: Site,
        instance: String,
        act: Act,
        direct: Direct,
        voices: Voices,
    ) -> Result<Self, PageError> {
        let runtime = tokio::runtime::Builder::new_current_thread().enable_io().enable_time().build();
        let runtime = runtime.map_err(PageError::Thread)?;
        let (listener, taken) = {
            let _within = runtime.enter();
            bind(settings.address)?
        };
        let address = listener.local_addr().map_err(PageError::Thread)?;
        let tls = settings.tls.as_ref().map(listener::Tls::read).transpose().map_err(PageError::Tls)?;
        let (sender, receiver) = mpsc::channel(WAITING);
        let (fan, _) = broadcast::channel(BATCHES);
        let is_loopback = address.ip().is_loopback();
        let Settings { tokens, hosts, origins, proxies, .. } = settings;
        let shared = Arc::new(Shared {
            model: Mutex::new(Model::new(site, instance)),
            access: Access { tokens, hosts, origins, is_loopback },
            fan: Mutex::new(Some(fan)),
            counts: Counts::default(),
            act,
            direct,
            voices: voices::Desk::new(voices),
            is_tls: tls.is_some(),
            proxies: proxies.iter().map(IpAddr::to_canonical).collect(),
            places: Arc::default(),
            guesses: budget::Budgets::new(MOST_GUESSES, GUESSES_PER_S),
            wrong_tokens: admission::WrongTokens::default(),
            actions: budget::Budgets::new(feed::MOST_PER_S, feed::MOST_PER_S),
            stop: Notify::new(),
            has_ended: AtomicBool::new(false),
        });
        let of_thread = Arc::clone(&shared);
        let serve = move || runtime.block_on(serve(listener, tls, receiver, of_thread));
        let thread =
            std::thread::Builder::new().name("page".to_owned()).spawn(serve).map_err(PageError::Thread)?;
        Ok(Self { shared, thread: Some(thread), sender, address, taken })
    }

    /// Address of the page.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// Ports before that one which other programs use.
    pub fn taken(&self) -> &[u16] {
        &self.taken
    }

    /// Its scheme, `http` or `https`.
    pub fn scheme(&self) -> &'static str {
        if self.shared.is_tls { "https" } else { "http" }
    }

    /// Collector for a loop's results; `waits` is for a replay.
    pub fn collector(&self, dive: &Loop, waits: bool) -> Collector {
        let (is_playback, recorded_to, compared_m) = {
            let model = self.shared.model();
            let site = model.site();
            (site.is_playback, site.recorded_to.clone(), site.compared_m)
        };
        Collector::new(self.sender.clone(), dive, waits, is_playback, recorded_to).compared_with(compared_m)
    }

    /// Number of viewers.
    pub fn viewers(&self) -> usize {
        self.shared.counts.viewers.load(Ordering::Relaxed)
    }

    /// Ends the page. Viewers get the last messages, with `end` as the very last, within a second.
    pub fn end(mut self, end: Option<serde_json::Value>) {
        if let Some(end) = end {
            // Its thread may have ended early, which is reported below.
            let _ended = self.sender.blocking_send(Fed::End(Box::new(end)));
        }
        self.stop();
    }

    fn stop(&mut self) {
        self.shared.has_ended.store(true, Ordering::Relaxed);
        self.shared.stop.notify_one();
        if let Some(thread) = self.thread.take()
            && thread.join().is_err()
        {
            tracing::error!("the page's thread has ended early");
        }
    }
}

impl Drop for Page {
    fn drop(&mut self) {
        self.stop();
    }
}

/// The first free port from the requested one, and the taken ones before it.
fn bind(asked: SocketAddr) -> Result<(TcpListener, Vec<u16>), PageError> {
    let mut taken = Vec::new();
    let mut failed = io::Error::other("no port");
    for step in 0..PORTS {
        let Some(port) = asked.port().checked_add(step) else { break };
        match listener::listen(SocketAddr::new(asked.ip(), port)) {
            Ok(listener) => return Ok((listener, taken)),
            Err(error) if error.kind() == io::ErrorKind::AddrInUse => {
                taken.push(port);
                failed = error;
            }
            Err(source) => return Err(PageError::Bind { address: asked, source }),
        }
    }
    Err(PageError::Bind { address: asked, source: failed })
}

async fn serve(
    listener: TcpListener,
    tls: Option<listener::Tls>,
    fed: mpsc::Receiver<Fed>,
    shared: Arc<Shared>,
) {
    let pump = pump::pump(fed, Arc::clone(&shared));
    let serving = tokio::spawn(listener::accept(listener, tls, Arc::clone(&shared)));
    // Ends when the page is to end.
    pump.await;
    drop(shared.fan().take());
    let gone = async {
        while shared.counts.viewers.load(Ordering::Relaxed) > 0 {
            tokio::time::sleep(Duration::from_millis(5)).await;
        }
    };
    if tokio::time::timeout(ENDS_WITHIN, gone).await.is_err() {
        tracing::warn!("viewers of the page didn't take its last messages");
    }
    serving.abort();
}

#[cfg(test)]
mod tests;
