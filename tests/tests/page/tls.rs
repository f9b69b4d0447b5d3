//! The page over TLS with certificate files. Only clients with TLS and a token are served, and unusable files are
//! reported.
//!
//! `certificates/` has a certificate for `localhost` and 127.0.0.1 until 2126, its key, and another key that doesn't
//! match. All these files are only for tests. They were made with `openssl ecparam -name prime256v1 -genkey`, and with
//! `openssl req -x509` without a CA's rights.

use std::io::{Read, Write};
use std::net::TcpStream;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

use headrace_tests::page_client::Serving;
use headrace_tests::{Folder, root};
use serde_json::Value;
use tokio_rustls::rustls::crypto::ring;
use tokio_rustls::rustls::pki_types::pem::PemObject as _;
use tokio_rustls::rustls::pki_types::{CertificateDer, ServerName};
use tokio_rustls::rustls::{ClientConfig, ClientConnection, RootCertStore, StreamOwned};
use tungstenite::client::IntoClientRequest as _;

use crate::address::ANY;

const TOKENS: &str = "operator = operator-0123456789abcdef\nviewer = viewer-0123456789abcdef\n";
const TOKEN: &str = "Authorization: Bearer viewer-0123456789abcdef";
/// Longest time to wait for the server's answer.
const WITHIN: Duration = Duration::from_mins(2);

type Secured = StreamOwned<ClientConnection, TcpStream>;

fn file(name: &str) -> PathBuf {
    root().join("tests/tests/page/certificates").join(name)
}

fn text(name: &str) -> String {
    file(name).display().to_string()
}

/// Starts a replay with a page that has tokens and the certificate.
fn serving(folder: &Folder) -> Serving {
    folder.write("tokens", TOKENS);
    let (certificate, key) = (text("server.cert.pem"), text("server.key.pem"));
    let files = ["--page-cert", &certificate, "--page-key", &key, "--page-token-file", "tokens"];
    Serving::start(folder, &[&["replay", "dive.mcap", ANY], files.as_slice()].concat())
}

/// Opens the connection of a TLS client. The client trusts either the test's certificate or no certificate.
fn secured(address: &str, trusts: bool) -> Secured {
    let mut roots = RootCertStore::empty();
    if trusts {
        roots.add(CertificateDer::from_pem_file(file("server.cert.pem")).unwrap()).unwrap();
    }
    let config = ClientConfig::builder_with_provider(Arc::new(ring::default_provider()));
    let config = config.with_safe_default_protocol_versions().unwrap();
    let config = config.with_root_certificates(roots).with_no_client_auth();
    let name = ServerName::try_from("127.0.0.1").unwrap();
    let client = ClientConnection::new(Arc::new(config), name).unwrap();
    let stream = TcpStream::connect(address).unwrap();
    stream.set_read_timeout(Some(WITHIN)).unwrap();
    StreamOwned::new(client, stream)
}

/// Sends a request over TLS; returns status and full response.
fn ask_secured(address: &str, method: &str, path: &str, header: &str) -> (u16, String) {
    let mut stream = secured(address, true);
    let further = if header.is_empty() { String::new() } else { format!("{header}\r\n") };
    let request = format!(
        "{method} {path} HTTP/1.1\r\nHost: {address}\r\n{further}Content-Length: 0\r\nConnection: close\r\n\r\n"
    );
    stream.write_all(request.as_bytes()).unwrap();
    let mut bytes = Vec::new();
    stream.read_to_end(&mut bytes).unwrap();
    let text = String::from_utf8_lossy(&bytes).into_owned();
    let status = text.split(' ').nth(1).and_then(|code| code.parse().ok()).unwrap_or(0);
    (status, text)
}

#[test]
fn tls_page_requires_a_token() {
    let folder = Folder::with_dive();
    let serving = serving(&folder);
    let ask = |method, path, header| ask_secured(&serving.address, method, path, header);
    let (status, page) = ask("GET", "/", "");
    assert!(status == 200 && page.contains("/assets/page.js") && !page.contains("short"), "{page}");
    for path in ["/feed", "/feed.jsonl", "/state.json", "/samples?from_m=0&to_m=1", "/metrics"] {
        let (status, answer) = ask("GET", path, "");
        assert_eq!(status, 401, "{path}");
        assert!(!answer.contains("dive"), "{answer}");
    }
    assert_eq!(ask("POST", "/actions/mark", "").0, 401);
    let (status, state) = ask("GET", "/state.json", TOKEN);
    assert!(status == 200 && state.contains(r#""type":"state""#), "{state}");
    let (status, login) = ask("GET", "/login?token=viewer-0123456789abcdef", "");
    assert_eq!(status, 303);
    assert!(login.contains("HttpOnly; SameSite=Strict; Secure"), "{login}");
    let (_, extras) = ask("GET", "/cockpit_extras.json", "");
    assert!(extras.contains(r#"url":"https://127"#) && !extras.contains(r#""http://"#), "{extras}");
}

#[test]
fn viewer_feed_works_over_tls() {
    let folder = Folder::with_dive();
    let serving = serving(&folder);
    let address = &serving.address;
    let mut request =
        format!("wss://{address}/feed?token=viewer-0123456789abcdef").into_client_request().unwrap();
    request.headers_mut().insert("Origin", format!("https://{address}").parse().unwrap());
    let Ok((mut socket, _)) = tungstenite::client::client(request, secured(address, true)) else {
        panic!("no feed by TLS");
    };
    let hello: Value = serde_json::from_str(socket.read().unwrap().to_text().unwrap()).unwrap();
    assert_eq!(hello["type"], "hello");
    assert_eq!(hello["may"]["playback"], false, "the token is a viewer's");
}

#[test]
fn client_without_tls_gets_nothing_and_blocks_nobody() {
    let folder = Folder::with_dive();
    let serving = serving(&folder);
    let address = serving.address.as_str();
    // This client stays connected, but never begins a handshake.
    let silent = TcpStream::connect(address).unwrap();
    for (path, token) in [("/", None), ("/state.json", Some(TOKEN))] {
        let mut plain = TcpStream::connect(address).unwrap();
        plain.set_read_timeout(Some(WITHIN)).unwrap();
        let token = token.unwrap_or("Accept: */*");
        plain
            .write_all(format!("GET {path} HTTP/1.1\r\nHost: {address}\r\n{token}\r\n\r\n").as_bytes())
            .unwrap();
        let mut answer = Vec::new();
        // Reading may fail, because a connection is reset if the server closes it with unread data.
        let _reset = plain.read_to_end(&mut answer);
        assert!(answer.len() < 16 && !answer.starts_with(b"HTTP"), "{answer:?}");
    }
    let mut stranger = secured(address, false);
    let refused = stranger.write_all(b"GET / HTTP/1.1\r\n\r\n").unwrap_err();
    assert!(refused.to_string().contains("UnknownIssuer"), "{refused}");
    assert_eq!(ask_secured(address, "GET", "/state.json", TOKEN).0, 200);
    drop(silent);
}

#[test]
fn unusable_certificate_files_are_reported_and_the_dive_goes_on() {
    let folder = Folder::with_dive();
    folder.write("garbage.pem", "-----BEGIN CERTIFICATE-----\nnot base64!\n-----END CERTIFICATE-----\n");
    folder.write("empty.pem", "");
    let (certificate, key, other) = (text("server.cert.pem"), text("server.key.pem"), text("other.key.pem"));
    for (pair, expected_texts) in [
        (["none.pem", &key], vec!["the page's certificate none.pem can't be used"]),
        (["empty.pem", &key], vec!["the page's certificate empty.pem can't be used", "no certificate"]),
        (["garbage.pem", &key], vec!["the page's certificate garbage.pem can't be used"]),
        ([&key, &key], vec!["the page's certificate", "server.key.pem can't be used"]),
        ([&certificate, "none.pem"], vec!["the page's key none.pem can't be used"]),
        ([&certificate, "garbage.pem"], vec!["the page's key garbage.pem can't be used"]),
        ([&certificate, &other], vec!["server.cert.pem", "other.key.pem", "can't be used together"]),
    ] {
        let [page_cert, page_key] = pair;
        let answer =
            folder.headrace(&["replay", "dive.mcap", ANY, "--page-cert", page_cert, "--page-key", page_key]);
        assert_eq!(answer.code, folder.headrace(&["replay", "dive.mcap"]).code, "{pair:?}");
        for words in expected_texts.into_iter().chain(["; the dive goes on without the page"]) {
            assert!(answer.stderr.contains(words), "{pair:?}: {words:?} isn't in {}", answer.stderr);
        }
        assert!(answer.stdout.contains(" samples, target "), "{}", answer.stdout);
    }
}
