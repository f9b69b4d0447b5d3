//! Options of the operator's page.

use std::net::{IpAddr, Ipv4Addr, SocketAddr};
use std::path::PathBuf;

use clap::Args;
use headrace_dashboard::server::PORT;

/// Address of the page, and access to it (docs/how-to/read-the-page.md).
#[derive(Debug, Args)]
#[command(next_help_heading = "Page")]
pub(crate) struct PageArgs {
    /// Serve the operator's page, by default on 127.0.0.1:8881 or one of the nine ports after it. Without
    /// this option the page is served if stdout is a terminal, and for a replay only if it also has a speed
    /// or keys. With this option a replay continues until it is ended on the page, by a key or Ctrl-C.
    #[arg(long, value_name = "ADDRESS:PORT", num_args = 0..=1, require_equals = true, value_parser = address, default_missing_value = "127.0.0.1")]
    pub(crate) page: Option<SocketAddr>,
    /// Don't serve a page.
    #[arg(long, conflicts_with = "page")]
    pub(crate) no_page: bool,
    /// File with the lines `operator = TOKEN` and `viewer = TOKEN`, needed beyond loopback. Without it random
    /// tokens are shown in the terminal.
    #[arg(long, value_name = "FILE")]
    pub(crate) page_token_file: Option<PathBuf>,
    /// Certificate of the page's server, PEM.
    #[arg(long, value_name = "CERT.pem", requires = "page_key")]
    pub(crate) page_cert: Option<PathBuf>,
    /// Private key of the page's server, PEM.
    #[arg(long, value_name = "KEY.pem", requires = "page_cert")]
    pub(crate) page_key: Option<PathBuf>,
    /// Additional name of this machine in browsers. May be given several times.
    #[arg(long, value_name = "NAME")]
    pub(crate) page_host: Vec<String>,
    /// Origin of another page that may frame this one and send its actions, such as http://blueos.local.
    #[arg(long, value_name = "ORIGIN", value_parser = origin)]
    pub(crate) page_origin: Vec<String>,
    /// Address of a proxy in front of the page. Limits then count by the address that the proxy states in
    /// X-Forwarded-For.
    #[arg(long, value_name = "ADDRESS")]
    pub(crate) page_proxy: Vec<IpAddr>,
}

impl PageArgs {
    /// Files that the server of the page reads: tokens, certificate and key.
    pub(crate) fn files(&self) -> impl Iterator<Item = PathBuf> {
        [&self.page_token_file, &self.page_cert, &self.page_key].into_iter().flatten().cloned()
    }
}

fn address(text: &str) -> Result<SocketAddr, String> {
    let with_port = |ip: IpAddr| SocketAddr::new(ip, PORT);
    let port = |text: &str| text.parse().ok().map(|port| SocketAddr::new(Ipv4Addr::LOCALHOST.into(), port));
    let parsed = text.parse().ok().or_else(|| text.parse().ok().map(with_port)).or_else(|| port(text));
    parsed.ok_or_else(|| {
        "expected an address of this machine and a port, such as 127.0.0.1:8881 or 0.0.0.0:8881".to_owned()
    })
}

fn origin(text: &str) -> Result<String, String> {
    let host = text.strip_prefix("http://").or_else(|| text.strip_prefix("https://"));
    let is_fit = |byte: u8| byte.is_ascii_alphanumeric() || b".-[]:".contains(&byte);
    match host {
        Some(host) if !host.is_empty() && host.bytes().all(is_fit) => Ok(text.to_owned()),
        _ => Err("expected http:// or https:// and a host, without a path".to_owned()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn addresses_ports_and_origins_are_accepted() {
        let address = |text| super::address(text).map(|address| address.to_string());
        assert_eq!(address("0.0.0.0").as_deref(), Ok("0.0.0.0:8881"));
        assert_eq!(address("9000").as_deref(), Ok("127.0.0.1:9000"));
        assert_eq!(address("[::1]:0").as_deref(), Ok("[::1]:0"));
        assert!(address("rov.local:8881").is_err());
        assert!(
            origin("http://blueos.local").is_ok()
                && origin("http://a/b").is_err()
                && origin("blueos.local").is_err()
        );
    }
}
