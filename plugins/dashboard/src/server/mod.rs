//! The page's server: one thread with sockets and timers. In a live dive the loop never waits for it.

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
mod shared;
mod stall;
mod voice_desk;
mod voices;
mod wrong_tokens;

use std::io;
use std::net::{IpAddr, SocketAddr};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::Duration;

use headrace_monitor::run::Loop;
use tokio::net::TcpListener;
use tokio::sync::{Notify, broadcast, mpsc};

use self::shared::{Counts, Shared};
use self::voice_desk::Desk;
use self::wrong_tokens::WrongTokens;
use crate::access::{Access, Tokens};
use crate::collector::{Collector, WAITING};
use crate::fed::Fed;
use crate::model::Model;
use crate::site::Site;

pub use self::listener::TlsFiles;
pub use self::shared::{Act, Direct};
pub use self::voice_desk::{Keep, Recall, Voices};

/// Default port of the page.
pub const PORT: u16 = 8881;
/// Number of ports tried, beginning with the requested port.
const PORTS: u16 = 10;
/// Maximum number of message batches that a viewer may lag behind. A viewer that lags further gets all changes at once.
const BATCHES: usize = 64;
/// Budget of wrong tokens for a client: burst, and refill per second.
const MOST_GUESSES: f64 = 20.0;
const GUESSES_PER_S: f64 = 1.0;
/// Time limit for viewers to receive the last messages when the page ends.
const ENDS_WITHIN: Duration = Duration::from_secs(1);

/// Address and access rules of the page.
#[derive(Debug, Clone)]
pub struct Settings {
    /// Address and port. Port 0 selects any free port.
    pub address: SocketAddr,
    /// Tokens; `None` on loopback, where no token is needed.
    pub tokens: Option<Tokens>,
    /// Names of this machine, in addition to its addresses and `localhost`.
    pub hosts: Vec<String>,
    /// Origins of pages that may frame this page and send actions.
    pub origins: Vec<String>,
    /// Proxies whose `X-Forwarded-For` is trusted.
    pub proxies: Vec<IpAddr>,
    /// Certificate and key; `None` serves plain HTTP.
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
        /// Error of the last port tried.
        source: io::Error,
    },
    /// The page's thread or its async runtime can't be started.
    #[error("the page's thread can't be started: {0}")]
    Thread(io::Error),
    /// TLS can't be set up.
    #[error("{0}")]
    Tls(String),
}

/// The page while it is being served.
pub struct Page {
    shared: Arc<Shared>,
    thread: Option<JoinHandle<()>>,
    sender: mpsc::Sender<Fed>,
    address: SocketAddr,
    /// Tried ports that other programs use.
    taken: Vec<u16>,
}

impl Page {
    /// Starts to serve a dive. `instance` is a unique name of this run.
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
            voices: Desk::new(voices),
            is_tls: tls.is_some(),
            proxies: proxies.iter().map(IpAddr::to_canonical).collect(),
            places: Arc::default(),
            guesses: budget::Budgets::new(MOST_GUESSES, GUESSES_PER_S),
            wrong_tokens: WrongTokens::default(),
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

    /// Returns the address of the page.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// Returns the tried ports that other programs use.
    pub fn taken(&self) -> &[u16] {
        &self.taken
    }

    /// Returns the scheme of the page's address, `http` or `https`.
    pub fn scheme(&self) -> &'static str {
        if self.shared.is_tls { "https" } else { "http" }
    }

    /// Returns a collector for a loop's results; `waits` is true for a replay.
    pub fn collector(&self, dive: &Loop, waits: bool) -> Collector {
        let (is_playback, recorded_to, compared_m) = {
            let model = self.shared.model();
            let site = model.site();
            (site.is_playback, site.recorded_to.clone(), site.compared_m)
        };
        Collector::new(self.sender.clone(), dive, waits, is_playback, recorded_to).compared_with(compared_m)
    }

    /// Returns the number of connected viewers.
    pub fn viewers(&self) -> usize {
        self.shared.counts.viewers.load(Ordering::Relaxed)
    }

    /// Shows the result of the dive, and goes on serving the page.
    pub fn show_result(&self, end: serde_json::Value) {
        // Sending fails if the page's thread has ended early. The function `stop` logs this error.
        let _ended = self.sender.blocking_send(Fed::End(Box::new(end)));
    }

    /// Ends the page. Within a second, viewers get the remaining messages, and `end` as the last of them.
    pub fn end(mut self, end: Option<serde_json::Value>) {
        if let Some(end) = end {
            self.show_result(end);
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

/// Listens on the first free port, beginning with the requested one. Also returns the ports that were tried before and
/// are in use.
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
    // The task `pump` ends when the page has to end.
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
