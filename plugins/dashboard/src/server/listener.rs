//! Connections: a bounded number, with TLS where there is a certificate.

use std::io;
use std::net::SocketAddr;
use std::pin::Pin;
use std::sync::Arc;
use std::task::{Context, Poll};
use std::time::Duration;

use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio::net::TcpListener;
use tokio::sync::{OwnedSemaphorePermit, Semaphore};

use super::TlsFiles;

/// Connections at a time; more wait.
const MOST: usize = 128;
/// Wait after a connection couldn't be taken.
const PAUSE: Duration = Duration::from_millis(100);

/// A stream of bytes both ways.
pub(super) trait Duplex: AsyncRead + AsyncWrite + Send + Unpin {}
impl<T: AsyncRead + AsyncWrite + Send + Unpin> Duplex for T {}

/// A connection, and its place among those allowed.
pub(super) struct Connection {
    io: Box<dyn Duplex>,
    #[cfg_attr(not(feature = "tls"), expect(dead_code, reason = "held, and moved by a handshake alone"))]
    place: OwnedSemaphorePermit,
}

/// Certificate and key.
pub(super) struct Tls {
    #[cfg(feature = "tls")]
    acceptor: tokio_rustls::TlsAcceptor,
}

impl Tls {
    /// Reads them.
    ///
    /// Errors: which file, and what is wrong with it.
    #[cfg(not(feature = "tls"))]
    pub(super) fn read(files: &TlsFiles) -> Result<Self, String> {
        let path = files.certificate.display();
        Err(format!(
            "the page can't be served with certificate {path}: this program was built without feature tls"
        ))
    }

    /// Reads them.
    ///
    /// Errors: which file, and what is wrong with it.
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

/// A port that is listened on.
pub(super) struct Listening {
    listener: TcpListener,
    places: Arc<Semaphore>,
    #[cfg(feature = "tls")]
    tls: Option<secure::Handshakes>,
}

impl Listening {
    /// Listens on.
    ///
    /// Errors: the socket can't be polled.
    #[cfg_attr(
        not(feature = "tls"),
        expect(unused_variables, clippy::needless_pass_by_value, reason = "without TLS there is none")
    )]
    pub(super) fn new(listener: std::net::TcpListener, tls: Option<Tls>) -> io::Result<Self> {
        listener.set_nonblocking(true)?;
        Ok(Self {
            listener: TcpListener::from_std(listener)?,
            places: Arc::new(Semaphore::new(MOST)),
            #[cfg(feature = "tls")]
            tls: tls.map(|tls| secure::Handshakes::new(tls.acceptor)),
        })
    }

    async fn plain(&self) -> (Connection, SocketAddr) {
        loop {
            let place = Arc::clone(&self.places).acquire_owned().await;
            match (self.listener.accept().await, place) {
                (Ok((stream, from)), Ok(place)) => {
                    // Small messages are due at once.
                    if let Err(error) = stream.set_nodelay(true) {
                        tracing::debug!(%error, "a connection of the page delays small messages");
                    }
                    return (Connection { io: Box::new(stream), place }, from);
                }
                (Err(error), _) => {
                    tracing::debug!(%error, "a connection of the page couldn't be taken");
                    tokio::time::sleep(PAUSE).await;
                }
                (_, Err(_)) => tokio::time::sleep(PAUSE).await,
            }
        }
    }
}

impl axum::serve::Listener for Listening {
    type Io = Connection;
    type Addr = SocketAddr;

    #[cfg(not(feature = "tls"))]
    async fn accept(&mut self) -> (Connection, SocketAddr) {
        self.plain().await
    }

    #[cfg(feature = "tls")]
    async fn accept(&mut self) -> (Connection, SocketAddr) {
        let Some(mut tls) = self.tls.take() else { return self.plain().await };
        let ready = loop {
            tokio::select! {
                (connection, from) = self.plain() => tls.begin(connection, from),
                Some(ready) = tls.ready() => break ready,
            }
        };
        self.tls = Some(tls);
        ready
    }

    fn local_addr(&self) -> io::Result<SocketAddr> {
        self.listener.local_addr()
    }
}

#[cfg(feature = "tls")]
mod secure {
    use super::{Connection, Duration, SocketAddr};
    use tokio::sync::mpsc;
    use tokio_rustls::TlsAcceptor;

    /// How long a handshake may take.
    const WITHIN: Duration = Duration::from_secs(5);

    /// Handshakes that go on side by side: a slow one holds up no other.
    pub(super) struct Handshakes {
        acceptor: TlsAcceptor,
        done: mpsc::Sender<(Connection, SocketAddr)>,
        ready: mpsc::Receiver<(Connection, SocketAddr)>,
    }

    impl Handshakes {
        pub(super) fn new(acceptor: TlsAcceptor) -> Self {
            let (done, ready) = mpsc::channel(16);
            Self { acceptor, done, ready }
        }

        pub(super) fn begin(&self, connection: Connection, from: SocketAddr) {
            let (acceptor, done) = (self.acceptor.clone(), self.done.clone());
            tokio::spawn(async move {
                let Connection { io, place } = connection;
                match tokio::time::timeout(WITHIN, acceptor.accept(io)).await {
                    Ok(Ok(stream)) => {
                        // Nobody takes it once the page has ended.
                        let _ended = done.send((Connection { io: Box::new(stream), place }, from)).await;
                    }
                    Ok(Err(error)) => tracing::debug!(%error, "a handshake of the page failed"),
                    Err(_) => tracing::debug!("a handshake of the page took too long"),
                }
            });
        }

        pub(super) async fn ready(&mut self) -> Option<(Connection, SocketAddr)> {
            self.ready.recv().await
        }
    }
}

impl AsyncRead for Connection {
    fn poll_read(
        mut self: Pin<&mut Self>,
        cx: &mut Context<'_>,
        buf: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        Pin::new(&mut self.io).poll_read(cx, buf)
    }
}

impl AsyncWrite for Connection {
    fn poll_write(mut self: Pin<&mut Self>, cx: &mut Context<'_>, bytes: &[u8]) -> Poll<io::Result<usize>> {
        Pin::new(&mut self.io).poll_write(cx, bytes)
    }

    fn poll_flush(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.io).poll_flush(cx)
    }

    fn poll_shutdown(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.io).poll_shutdown(cx)
    }
}
