//! Accepts connections as they arrive, with TLS if there is a certificate. A connection that sends no request in time
//! is closed.

use std::io;
use std::net::SocketAddr;
use std::sync::Arc;
use std::time::Duration;

use hyper::body::Incoming;
use hyper::server::conn::http1;
use hyper::service::{Service as _, service_fn};
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::service::TowerToHyperService;
use tokio::io::{AsyncRead, AsyncWrite};
use tokio::net::{TcpListener, TcpSocket, TcpStream};

use super::admission::Caller;
use super::answers;
use super::client::Client;
use super::shared::Shared;
use super::stall::Stream;

/// Pause after accepting a connection has failed.
const PAUSE: Duration = Duration::from_millis(100);
/// Timeout for the head of a request. Silent and idle connections are closed, and so are connections with unfinished
/// requests.
const HEAD_WITHIN: Duration = Duration::from_secs(10);
/// Timeout of a TLS handshake.
#[cfg(feature = "tls")]
const HANDSHAKE_WITHIN: Duration = Duration::from_secs(5);
/// Size of a connection's send buffer in the kernel, bytes; the kernel adds as much again for itself.
///
/// With the default size of some megabytes, it takes a minute to notice that a viewer reads nothing.
const SEND_BUFFER: u32 = 32 << 10;
/// Maximum number of unsent bytes in a connection's send buffer. It keeps the buffer of a stalled viewer from filling.
#[cfg(any(target_os = "android", target_os = "linux"))]
const MOST_NOT_SENT: u32 = 8 << 10;
/// Size of a connection's buffer in this program, bytes.
///
/// The buffer holds the longest head of a request, and the part of an answer that waits to be sent.
const HELD: usize = 64 << 10;
/// Maximum number of connections that wait in the kernel to be accepted.
const BACKLOG: u32 = 1024;

/// Files with certificate and key, in PEM format.
#[derive(Debug, Clone)]
pub struct TlsFiles {
    /// File with the certificate and its intermediate certificates.
    pub certificate: std::path::PathBuf,
    /// File with the certificate's private key.
    pub key: std::path::PathBuf,
}

/// TLS configuration from a certificate and its key.
pub(super) struct Tls {
    #[cfg(feature = "tls")]
    acceptor: tokio_rustls::TlsAcceptor,
}

impl Tls {
    /// Reads a certificate and its key.
    ///
    /// Errors: always, because this program was built without TLS.
    #[cfg(not(feature = "tls"))]
    pub(super) fn read(files: &TlsFiles) -> Result<Self, String> {
        let path = files.certificate.display();
        Err(format!(
            "the page can't be served with certificate {path}: this program was built without feature tls"
        ))
    }

    /// Reads a certificate and its key.
    ///
    /// Errors: the file and the reason.
    #[cfg(feature = "tls")]
    pub(super) fn read(files: &TlsFiles) -> Result<Self, String> {
        use tokio_rustls::rustls::pki_types::pem::PemObject as _;
        use tokio_rustls::rustls::pki_types::{CertificateDer, PrivateKeyDer};
        use tokio_rustls::rustls::{ServerConfig, crypto::ring};
        let TlsFiles { certificate, key } = files;
        let of = |what: &str, path: &std::path::Path, error: &dyn std::fmt::Display| {
            format!("the page's {what} {} can't be used: {error}; expected PEM", path.display())
        };
        let read =
            CertificateDer::pem_file_iter(certificate).and_then(Iterator::collect::<Result<Vec<_>, _>>);
        let chain = read.map_err(|error| of("certificate", certificate, &error))?;
        if chain.is_empty() {
            return Err(of("certificate", certificate, &"it holds no certificate"));
        }
        let secret = PrivateKeyDer::from_pem_file(key).map_err(|error| of("key", key, &error))?;
        let config = ServerConfig::builder_with_provider(Arc::new(ring::default_provider()));
        let config = config.with_safe_default_protocol_versions().map_err(|error| error.to_string())?;
        let config = config.with_no_client_auth().with_single_cert(chain, secret);
        let config = config.map_err(|error| {
            let [certificate, key] = [certificate, key].map(|path| path.display());
            format!("the page's certificate {certificate} and key {key} can't be used together: {error}")
        })?;
        Ok(Self { acceptor: Arc::new(config).into() })
    }
}

/// Listens on an address. Must be called within the runtime.
///
/// Errors: system errors.
pub(super) fn listen(address: SocketAddr) -> io::Result<TcpListener> {
    let socket = if address.is_ipv4() { TcpSocket::new_v4() } else { TcpSocket::new_v6() }?;
    // The option SO_REUSEADDR is set on Unix only, as in the standard library. On other systems it lets two programs
    // share a port.
    #[cfg(unix)]
    socket.set_reuseaddr(true)?;
    // Accepted connections inherit the size of the send buffer and the limit of unsent bytes.
    socket.set_send_buffer_size(SEND_BUFFER)?;
    #[cfg(any(target_os = "android", target_os = "linux"))]
    if let Err(error) = socket2::SockRef::from(&socket).set_tcp_notsent_lowat(MOST_NOT_SENT) {
        tracing::warn!("a viewer that reads nothing is dropped late: limiting unsent bytes: {error}");
    }
    socket.bind(address)?;
    socket.listen(BACKLOG)
}

/// Accepts connections until the task is aborted.
pub(super) async fn accept(listener: TcpListener, tls: Option<Tls>, shared: Arc<Shared>) {
    let app = App::new(answers::router(Arc::clone(&shared)));
    let tls = tls.map(Arc::new);
    loop {
        match listener.accept().await {
            Ok((tcp, from)) => {
                // Without TCP_NODELAY, TCP delays small messages.
                if let Err(error) = tcp.set_nodelay(true) {
                    tracing::debug!(%error, "a connection of the page delays small messages");
                }
                let place = Arc::new(shared.places.enter(Client::of_address(from.ip())));
                let caller = Caller { peer: from.ip(), place };
                tokio::spawn(serve(tcp, caller, app.clone(), tls.clone(), Arc::clone(&shared)));
            }
            Err(error) => {
                tracing::debug!(%error, "a connection of the page couldn't be taken");
                tokio::time::sleep(PAUSE).await;
            }
        }
        // Lets each new connection run. Otherwise many later connections might arrive first, and the new connection
        // would be closed to make room for them.
        tokio::task::yield_now().await;
    }
}

type App = TowerToHyperService<axum::Router>;

/// Serves a connection until it ends or has to make room for another one.
async fn serve(tcp: TcpStream, caller: Caller, app: App, tls: Option<Arc<Tls>>, shared: Arc<Shared>) {
    let place = Arc::clone(&caller.place);
    let stream = Stream::new(tcp, Arc::clone(&place), shared);
    let serving = async {
        match tls {
            None => answer(stream, caller, app).await,
            #[cfg(not(feature = "tls"))]
            Some(_) => {}
            #[cfg(feature = "tls")]
            Some(tls) => match tokio::time::timeout(HANDSHAKE_WITHIN, tls.acceptor.accept(stream)).await {
                Ok(Ok(stream)) => answer(stream, caller, app).await,
                Ok(Err(error)) => tracing::debug!(%error, "a handshake of the page failed"),
                Err(_) => tracing::debug!("a handshake of the page took too long"),
            },
        }
    };
    tokio::select! {
        () = serving => {}
        () = place.closed() => tracing::debug!("a connection of the page was closed for a newer one"),
    }
}

/// Answers the requests on a connection.
async fn answer(stream: impl AsyncRead + AsyncWrite + Send + Unpin + 'static, caller: Caller, app: App) {
    let service = service_fn(move |mut request: hyper::Request<Incoming>| {
        request.extensions_mut().insert(caller.clone());
        app.call(request)
    });
    let mut http = http1::Builder::new();
    http.timer(TokioTimer::new()).header_read_timeout(HEAD_WITHIN).max_buf_size(HELD);
    if let Err(error) = http.serve_connection(TokioIo::new(stream), service).with_upgrades().await {
        tracing::debug!(%error, "a connection of the page failed");
    }
}
