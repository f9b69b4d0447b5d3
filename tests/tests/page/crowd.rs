//! Crowds of other clients, drawn from seeds, must neither delay an operator nor change a live dive or its recording.
//!
//! The page's server needs real sockets and time, so the simulated world of `tests/tests/world.rs` has no crowds.

#![expect(clippy::disallowed_methods, reason = "an operator waits in wall time")]

use std::io::{Read as _, Write as _};
use std::net::TcpStream;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use headrace_tests::Folder;
use headrace_tests::page_client::{Serving, Viewer};
use headrace_tests::random::Random;
use headrace_tests::world::fewest::fewest;
use headrace_tests::world::seeds;

use crate::address::ANY;

const TOKENS: &str = "operator = operator-0123456789abcdef\nviewer = viewer-0123456789abcdef\n";
const OPERATOR: &str = "?token=operator-0123456789abcdef";
const VIEWER: &str = "?token=viewer-0123456789abcdef";
/// Longest time in which the operator must be served.
const WITHIN: Duration = Duration::from_secs(1);
/// Interval between the crowd's actions, and between the operator's requests.
const PAUSE: Duration = Duration::from_millis(50);
const MOST_MEMBERS: usize = 120;

/// Behaviour of the clients of a group.
#[derive(Debug, Clone, Copy)]
enum Client {
    /// Connects and sends nothing.
    Silent,
    /// Sends half of a request's head.
    HalfSent,
    /// Requests the feed as lines and reads them slowly.
    SlowReader,
    /// Requests the feed as lines and reads nothing.
    UnreadLines,
    /// Opens a WebSocket and reads nothing.
    UnreadSocket,
}

const CLIENTS: [Client; 5] =
    [Client::Silent, Client::HalfSent, Client::SlowReader, Client::UnreadLines, Client::UnreadSocket];

/// Clients that behave alike.
#[derive(Debug, Clone, Copy)]
struct Group {
    client: Client,
    members: usize,
}

fn drawn(seed: u64) -> Vec<Group> {
    let mut random = Random(seed);
    let mut group =
        || Group { client: CLIENTS[random.below(CLIENTS.len())], members: 1 + random.below(MOST_MEMBERS) };
    let count = 1 + usize::try_from(seed % 4).unwrap();
    (0..count).map(|_| group()).collect()
}

impl Group {
    /// Returns the bytes that a client of this group sends. `query` is the URL query of its request.
    fn request(self, query: &str) -> String {
        match self.client {
            Client::Silent => String::new(),
            Client::HalfSent => "GET / HTTP/1.1\r\nHost: 127.0.0.1\r\nX-Half".to_owned(),
            Client::SlowReader | Client::UnreadLines => {
                format!("GET /feed.jsonl{query} HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n")
            }
            Client::UnreadSocket => format!(
                "GET /feed{query} HTTP/1.1\r\nHost: 127.0.0.1\r\nConnection: Upgrade\r\nUpgrade: websocket\r\n\
                 Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n"
            ),
        }
    }

    /// Keeps the group's connections open until the dive has ended. A new connection replaces the oldest one at each
    /// interval [`PAUSE`].
    fn stay(self, address: &str, query: &str, has_ended: &AtomicBool) {
        let mut open = std::collections::VecDeque::new();
        while !has_ended.load(Ordering::SeqCst) {
            while open.len() < self.members
                && let Ok(mut stream) = TcpStream::connect(address)
            {
                // Sending may fail, because the server may close this connection at once in favour of a newer one.
                let _closed = stream.write_all(self.request(query).as_bytes());
                stream.set_nonblocking(true).unwrap();
                open.push_back(stream);
            }
            if matches!(self.client, Client::SlowReader) {
                for stream in &mut open {
                    let _nothing_yet = stream.read(&mut [0; 64]);
                }
            }
            open.pop_front();
            std::thread::sleep(PAUSE);
        }
    }
}

/// Result of a dive among a crowd.
struct Among {
    /// Longest time in which the operator was served.
    longest: Duration,
    /// Refusals of the operator's requests.
    refused: Vec<String>,
    digest: String,
    code: Option<i32>,
}

/// Runs a live dive with its page among a crowd. The clients use the URL query `query`, which may have a token.
fn dive_among(folder: &Folder, crowd: &[Group], query: &str) -> Among {
    drop(std::fs::remove_file(folder.path("live.mcap")));
    let arguments = ["run", "vehicle.toml", "--source", "dive.mcap", "--record", "live.mcap"];
    let further = ["--speed", "5x", ANY, "--page-token-file", "tokens"];
    let serving = Serving::start(folder, &[&arguments[..], &further].concat());
    let mut operator = Viewer::connect(&serving, OPERATOR, &[]).unwrap();
    let has_ended = AtomicBool::new(false);
    let (mut longest, mut refused) = (Duration::ZERO, Vec::new());
    let digest = std::thread::scope(|scope| {
        for group in crowd {
            scope.spawn(|| group.stay(&serving.address, query, &has_ended));
        }
        let watching = scope.spawn(|| {
            let end = operator.until_type("end")["digest"].as_str().unwrap().to_owned();
            has_ended.store(true, Ordering::SeqCst);
            end
        });
        while !has_ended.load(Ordering::SeqCst) && !watching.is_finished() {
            let began = Instant::now();
            if let Err(why) = served(&serving)
                && !has_ended.load(Ordering::SeqCst)
            {
                refused.push(why);
            }
            longest = longest.max(began.elapsed());
            std::thread::sleep(PAUSE);
        }
        has_ended.store(true, Ordering::SeqCst);
        watching.join().unwrap_or_else(|_| "the operator's feed was lost".to_owned())
    });
    let (code, _) = serving.end();
    Among { longest, refused, digest, code }
}

/// Requests the state and opens a feed as an operator, who tries again if the server closes a connection.
fn served(serving: &Serving) -> Result<(), String> {
    let began = Instant::now();
    while began.elapsed() < WITHIN {
        let path = format!("/state.json{OPERATOR}");
        match headrace_tests::page_client::try_ask(&serving.address, &path) {
            Ok(200) => {}
            Ok(status) => return Err(format!("status {status}")),
            Err(_) => continue,
        }
        match Viewer::connect(serving, OPERATOR, &[]) {
            Ok(_) => return Ok(()),
            Err(tungstenite::Error::Http(answer)) => return Err(format!("feed: {}", answer.status())),
            Err(_) => {}
        }
    }
    Err(format!("not served within {WITHIN:?}"))
}

/// Returns the broken invariants of a dive among a crowd.
fn broken(folder: &Folder, crowd: &[Group], query: &str, digest: &str) -> Vec<String> {
    let among = dive_among(folder, crowd, query);
    let mut broken = Vec::new();
    let mut hold = |holds: bool, what: String| broken.extend((!holds).then_some(what));
    hold(among.refused.is_empty(), format!("the operator was refused: {:?}", among.refused));
    hold(among.longest < WITHIN, format!("the operator waited {:?}", among.longest));
    hold(among.digest == digest, format!("the results differ: {}", among.digest));
    let (code, report) = folder.replay("live.mcap", &[]);
    let recorded = (among.code, code, report["digest"].as_str());
    hold(recorded == (Some(0), Some(0), Some(digest)), format!("the recording differs: {recorded:?}"));
    println!("an operator waited {:?} at most among {crowd:?}", among.longest);
    broken
}

fn folder_and_digest() -> (Folder, String) {
    let folder = Folder::with_dive();
    folder.write("tokens", TOKENS);
    folder.record("dive.mcap", "alone.mcap", &[]);
    let digest = folder.digest("alone.mcap", &[]);
    (folder, digest)
}

#[test]
fn crowd_neither_delays_an_operator_nor_changes_the_dive() {
    let (folder, digest) = folder_and_digest();
    for seed in seeds(0..4) {
        let crowd = drawn(seed);
        if !broken(&folder, &crowd, VIEWER, &digest).is_empty() {
            let fewest = fewest(&crowd, |crowd| !broken(&folder, crowd, VIEWER, &digest).is_empty());
            let broken = broken(&folder, &fewest, VIEWER, &digest);
            panic!("seed {seed}, {} of {} groups: {fewest:?}\n{broken:#?}", fewest.len(), crowd.len());
        }
    }
}

#[test]
fn crowd_with_operator_token_is_found_and_reduced_to_its_streams() {
    let (folder, digest) = folder_and_digest();
    let group = |client, members| Group { client, members };
    let crowd = [group(Client::Silent, 20), group(Client::UnreadSocket, 60), group(Client::HalfSent, 20)];
    let fewest = fewest(&crowd, |crowd| !broken(&folder, crowd, OPERATOR, &digest).is_empty());
    assert!(matches!(fewest[..], [Group { client: Client::UnreadSocket, .. }]), "{fewest:?}");
}
