//! Command line of campaigns on many machines.

use std::net::SocketAddr;
use std::sync::Arc;

use datafusion::prelude::SessionContext;
use headrace_campaign::campaign::Campaign;
use headrace_campaign::maker::Maker;
use headrace_campaign::{Error, cluster};

/// Default addresses of the scheduler and of an executor.
const LISTENS: [SocketAddr; 2] = [
    SocketAddr::new(std::net::IpAddr::V4(std::net::Ipv4Addr::LOCALHOST), 50050),
    SocketAddr::new(std::net::IpAddr::V4(std::net::Ipv4Addr::LOCALHOST), 50051),
];

/// Options of campaigns on many machines.
#[derive(Debug, clap::Args)]
#[group(skip)]
#[command(next_help_heading = "Many machines (all with one --cache, and logs and cache at the same paths)")]
pub(crate) struct Arguments {
    /// Run replays and queries on the executors of this scheduler.
    #[arg(long, value_name = "HOST:PORT", conflicts_with_all = ["schedule", "executor"])]
    scheduler: Option<String>,
    /// Run as the scheduler (that of Ballista).
    #[arg(long, conflicts_with_all = ["folder", "executor"])]
    schedule: bool,
    /// Run as an executor for this scheduler, with --threads tasks at a time. It waits until the scheduler is available.
    #[arg(long, value_name = "HOST:PORT", conflicts_with = "folder")]
    executor: Option<String>,
    /// Listening address of the scheduler or executor; by default 127.0.0.1:50050 and 127.0.0.1:50051, on this machine only.
    /// Anybody who reaches it can read the logs: there is neither a password nor encryption.
    #[arg(long, value_name = "ADDRESS:PORT", conflicts_with = "folder")]
    listen: Option<SocketAddr>,
}

impl Arguments {
    /// Runs as the scheduler or an executor if the options request it; returns whether they did.
    pub(crate) async fn serve(&self, maker: &Arc<Maker>, threads: usize) -> Result<bool, Error> {
        if self.schedule {
            let address = self.listen.unwrap_or(LISTENS[0]);
            eprintln!("headrace-campaign: scheduling on {address}");
            cluster::schedule(address, maker.clone()).await?;
        } else if let Some(scheduler) = &self.executor {
            let address = self.listen.unwrap_or(LISTENS[1]);
            let (host, port) = host_and_port("--executor", scheduler)?;
            eprintln!("headrace-campaign: executing {threads} tasks at a time on {address} for {scheduler}");
            cluster::execute((host, port), address, threads, maker.clone()).await?;
        } else {
            return Ok(false);
        }
        Ok(true)
    }

    /// Creates a session on the scheduler named by the options, if any.
    pub(crate) fn session(&self, campaign: &Campaign) -> Result<Option<SessionContext>, Error> {
        let Some(scheduler) = &self.scheduler else { return Ok(None) };
        host_and_port("--scheduler", scheduler)?;
        Ok(Some(cluster::session(scheduler, campaign.maker.clone())?))
    }
}

/// Splits a host and a port number.
fn host_and_port<'a>(option: &str, text: &'a str) -> Result<(&'a str, u16), Error> {
    let both = text.rsplit_once(':').and_then(|(host, port)| Some((host, port.parse().ok()?)));
    let found = both.filter(|(host, port)| !host.is_empty() && *port > 0);
    found.ok_or_else(|| Error::Usage(format!("{option} {text}: expected HOST:PORT, like localhost:50050")))
}
