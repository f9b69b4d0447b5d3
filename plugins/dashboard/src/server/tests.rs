//! Tests of the server over real sockets, with clients that flood it or guess tokens.

use std::io::{Read as _, Write as _};
use std::net::{Ipv4Addr, TcpStream};
use std::sync::atomic::{AtomicU32, AtomicU64};

use headrace_geometry::tunnel::shapes::circle;
use headrace_sampling::Target;
use tokio::time::Instant;

use super::*;
use crate::access::Token;
use crate::model::{Body, Message, Sort};
use crate::site::Mode;

const VIEWER: &str = "Authorization: Bearer viewer-0123456789\r\n";
const OPERATOR: &str = "Authorization: Bearer operator-01234567\r\n";

/// A page that requires tokens, and the number of commands that it has passed to the loop.
struct Served {
    page: Page,
    commands: Arc<AtomicU32>,
}

fn served(proxies: &[IpAddr]) -> Served {
    let token = |text| Token::chosen(text).unwrap();
    let settings = Settings {
        address: (Ipv4Addr::LOCALHOST, 0).into(),
        tokens: Some(Tokens { viewer: token("viewer-0123456789"), operator: token("operator-01234567") }),
        hosts: Vec::new(),
        origins: Vec::new(),
        proxies: proxies.to_vec(),
        tls: None,
    };
    let site = Site {
        mode: Mode::Live,
        dive: "dive".to_owned(),
        vehicle: "vehicle".to_owned(),
        target: Target::new(0.5),
        compared_m: None,
        section_m: 0.25,
        length_m: 100.0,
        profile: circle(2.0).unwrap(),
        heads: Vec::new(),
        sensors: Vec::new(),
        utc_of_zero_s: None,
        span_s: None,
        takes_commands: true,
        is_playback: false,
        recorded_to: None,
    };
    let commands = Arc::new(AtomicU32::new(0));
    let counter = Arc::clone(&commands);
    let act = Arc::new(move |_| {
        counter.fetch_add(1, Ordering::Relaxed);
        Ok(())
    });
    let direct = Arc::new(|_| Err("nothing is played".to_owned()));
    let page = Page::start(settings, site, "test".to_owned(), act, direct, Voices::None).unwrap();
    Served { page, commands }
}

impl Served {
    fn connect(&self) -> TcpStream {
        let stream = TcpStream::connect(self.page.address()).unwrap();
        stream.set_read_timeout(Some(Duration::from_secs(20))).unwrap();
        stream
    }

    /// Connects a client whose kernel buffers about `bytes` unread bytes.
    fn connect_with_buffer(&self, bytes: usize) -> TcpStream {
        let socket = socket2::Socket::new(socket2::Domain::IPV4, socket2::Type::STREAM, None).unwrap();
        socket.set_recv_buffer_size(bytes).unwrap();
        socket.connect(&self.page.address().into()).unwrap();
        socket.into()
    }

    /// Sends a request on a new connection; returns status and head of the answer.
    fn ask(&self, request: &str, headers: &str, body: &str) -> (u16, String) {
        ask(&mut self.connect(), request, headers, body)
    }

    fn count(&self, of: impl Fn(&Counts) -> &AtomicU64) -> u64 {
        of(&self.page.shared.counts).load(Ordering::Relaxed)
    }

    /// Sends a message of `bytes` bytes to all viewers.
    fn feed(&self, bytes: usize) {
        let body = Body::Text(format!("{{\"type\":\"test\",\"text\":\"{}\"}}", "x".repeat(bytes)).into());
        let batch = vec![Message { seq: 1, sort: Sort::Other, body }];
        let _nobody = self.page.shared.fan().as_ref().unwrap().send(batch.into());
    }
}

/// Sends a request on an open connection; returns status and head of the answer, and reads its body.
fn ask(stream: &mut TcpStream, request: &str, headers: &str, body: &str) -> (u16, String) {
    let length = body.len();
    let text =
        format!("{request} HTTP/1.1\r\nHost: 127.0.0.1\r\n{headers}Content-Length: {length}\r\n\r\n{body}");
    // The write fails if the server has closed the connection.
    if stream.write_all(text.as_bytes()).is_err() {
        return (0, String::new());
    }
    answer(stream)
}

fn answer(stream: &mut TcpStream) -> (u16, String) {
    let mut head = Vec::new();
    let mut byte = [0];
    while !head.ends_with(b"\r\n\r\n") {
        if !matches!(stream.read(&mut byte), Ok(1)) {
            return (0, String::new());
        }
        head.push(byte[0]);
    }
    let head = String::from_utf8(head).unwrap().to_lowercase();
    let length = head.lines().find_map(|line| line.strip_prefix("content-length: ")?.parse().ok());
    stream.read_exact(&mut vec![0; length.unwrap_or(0)]).unwrap();
    (head.split(' ').nth(1).unwrap().parse().unwrap(), head)
}

/// Whether the server has closed a connection. Reads and discards the data that the server sent.
fn is_closed(stream: &mut TcpStream) -> bool {
    stream.set_nonblocking(true).unwrap();
    let mut bytes = [0; 4096];
    loop {
        match stream.read(&mut bytes) {
            Ok(0) => return true,
            Ok(_) => {}
            Err(error) => return error.kind() != io::ErrorKind::WouldBlock,
        }
    }
}

const UPGRADE: &str = "Connection: Upgrade\r\nUpgrade: websocket\r\nSec-WebSocket-Version: 13\r\n\
                       Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n";

#[test]
fn operator_is_served_within_1_s_among_1000_connections() {
    let served = served(&[]);
    let mut others = Vec::new();
    let mut longest = Duration::ZERO;
    for number in 0..1000 {
        let mut stream = served.connect();
        let sent = match number % 4 {
            0 => String::new(),
            1 => "GET / HTTP/1.1\r\nHost: 127.0.0.1\r\nX-Half".to_owned(),
            2 => "GET /register_service HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n".to_owned(),
            _ => format!("GET /feed.jsonl HTTP/1.1\r\nHost: 127.0.0.1\r\n{VIEWER}\r\n"),
        };
        // The server may already have closed this connection for a newer one.
        let _closed = stream.write_all(sent.as_bytes());
        others.push(stream);
        if number % 20 == 19 {
            served.feed(1000);
            let began = Instant::now();
            assert_eq!(served.ask("GET /state.json", OPERATOR, "").0, 200, "after {number}");
            assert_eq!(served.ask("POST /actions/acknowledge", OPERATOR, "").0, 200, "after {number}");
            let mut socket = served.connect();
            assert_eq!(ask(&mut socket, "GET /feed", &format!("{OPERATOR}{UPGRADE}"), "").0, 101);
            longest = longest.max(began.elapsed());
            // An operator may send only 20 actions a second, so the client pauses.
            std::thread::sleep(Duration::from_millis(50));
        }
    }
    println!("among 1,000 connections an operator waited {longest:?} at most for three requests");
    assert!(longest < Duration::from_secs(1), "{longest:?}");
}

#[test]
fn operator_is_served_within_1_s_while_1000_connections_a_second_are_opened() {
    let served = served(&[]);
    let (has_ended, opened) = (AtomicBool::new(false), AtomicU32::new(0));
    let flood = || {
        let mut last = std::collections::VecDeque::new();
        while !has_ended.load(Ordering::Relaxed) {
            last.push_back(served.connect());
            std::thread::sleep(Duration::from_millis(1));
            opened.fetch_add(1, Ordering::Relaxed);
            if last.len() > 200 {
                last.pop_front();
            }
        }
    };
    std::thread::scope(|scope| {
        scope.spawn(flood);
        let (mut longest, mut refused) = (Duration::ZERO, 0);
        for _ in 0..60 {
            let began = Instant::now();
            // Reconnect if the server has closed the connection for a newer one, as browsers do.
            while served.ask("GET /state.json", OPERATOR, "").0 != 200 {
                refused += 1;
            }
            longest = longest.max(began.elapsed());
            std::thread::sleep(Duration::from_millis(50));
        }
        has_ended.store(true, Ordering::Relaxed);
        let opened = opened.load(Ordering::Relaxed);
        println!(
            "while {opened} connections were opened an operator waited {longest:?} at most, and repeated {refused} requests"
        );
        assert!(longest < Duration::from_secs(1), "{longest:?}");
    });
}

#[test]
fn silent_half_sent_and_idle_connections_are_closed_after_10_s() {
    let served = served(&[]);
    let mut all: Vec<_> = (0..4).map(|_| served.connect()).collect();
    all[1].write_all(b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\nX-Half").unwrap();
    assert_eq!(ask(&mut all[2], "GET /register_service", "", "").0, 200);
    let body =
        format!("POST /actions/mark HTTP/1.1\r\nHost: 127.0.0.1\r\n{OPERATOR}Content-Length: 9\r\n\r\n{{");
    all[3].write_all(body.as_bytes()).unwrap();
    let began = Instant::now();
    std::thread::sleep(Duration::from_secs(9));
    assert!(all.iter_mut().all(|stream| !is_closed(stream)), "none is closed early");
    while !all.iter_mut().take(3).all(is_closed) {
        assert!(began.elapsed() < Duration::from_secs(12));
        std::thread::sleep(Duration::from_millis(50));
    }
    all[3].set_nonblocking(false).unwrap();
    assert!(matches!(answer(&mut all[3]).0, 0 | 408), "an unfinished action gets no answer or 408");
    assert_eq!(served.commands.load(Ordering::Relaxed), 0);
}

#[test]
fn unread_streams_are_dropped_10_s_after_their_machine_takes_no_more_data() {
    let served = served(&[]);
    let lines = format!("GET /feed.jsonl HTTP/1.1\r\nHost: 127.0.0.1\r\n{VIEWER}\r\n");
    let mut unread = [served.connect(), served.connect_with_buffer(4096), served.connect()];
    assert_eq!(ask(&mut unread[0], "GET /feed", &format!("{VIEWER}{UPGRADE}"), "").0, 101);
    for stream in &mut unread[1..] {
        stream.write_all(lines.as_bytes()).unwrap();
    }
    let began = Instant::now();
    let mut dropped = Vec::new();
    while dropped.len() < unread.len() && began.elapsed() < Duration::from_secs(40) {
        // The messages have about the data rate of a dive with four heads.
        served.feed(4400);
        std::thread::sleep(Duration::from_millis(200));
        while (dropped.len() as u64) < served.count(|counts| &counts.stalled) {
            dropped.push(began.elapsed().as_secs_f64());
        }
    }
    println!("dropped after {dropped:.1?} s: WebSocket, lines with a small buffer and with the usual one");
    assert_eq!(dropped.len(), unread.len());
    // At first the kernels of the clients take some 200 kB at most, depending on the machine. The server counts these
    // bytes as sent, although no client has read them.
    assert!(dropped[0] < 15.0 && dropped[2] < 40.0, "{dropped:?}");
    assert_eq!(served.page.viewers(), 0);
}

#[test]
fn answer_to_a_samples_request_has_one_content_type() {
    let (status, head) = served(&[]).ask("GET /samples?from_m=0&to_m=1", VIEWER, "");
    assert_eq!((status, head.matches("content-type:").count()), (200, 1), "{head}");
    assert!(head.contains("content-type: application/octet-stream"), "{head}");
}

#[test]
fn wrong_tokens_in_all_headers_share_one_budget() {
    let served = served(&[]);
    let mut right = served.connect();
    assert_eq!(ask(&mut right, "GET /state.json", OPERATOR, "").0, 200);
    let cookies: Vec<_> = (0..10).map(|number| format!("headrace_token=cookie-{number}")).collect();
    assert_eq!(served.ask("GET /state.json", &format!("Cookie: {}\r\n", cookies.join("; ")), "").0, 401);
    for number in 0..5 {
        assert_eq!(served.ask(&format!("GET /login?token=login-{number}"), "", "").0, 401);
        assert_eq!(
            served.ask("POST /actions/mark", &format!("Authorization: Bearer action-{number}\r\n"), "").0,
            401
        );
    }
    let bearer = "Authorization: Bearer wrong\r\n";
    // The budget refills by one guess a second, possibly between two requests.
    let asked = AtomicU32::new(0);
    let spent = |request: &str, headers: &str| {
        (0..3).any(|_| {
            let of = |text: &str| {
                text.replace("wrong", &format!("wrong-{}", asked.fetch_add(1, Ordering::Relaxed)))
            };
            served.ask(&of("GET /state.json?token=wrong"), "", "");
            let (status, head) = served.ask(&of(request), &of(headers), "");
            status == 429 && head.contains("retry-after: 1")
        })
    };
    assert!(spent("GET /state.json", bearer) && spent("GET /state.json?token=wrong", ""));
    assert!(spent("GET /login?token=wrong", "") && spent("GET /metrics", "Cookie: headrace_token=wrong\r\n"));
    assert!(spent("POST /actions/mark", bearer) && spent("POST /voice/1?seconds=1", bearer));
    assert!(
        spent("GET /state.json", OPERATOR),
        "an address without guesses is refused even with a right token"
    );
    assert_eq!(served.ask("GET /", bearer, "").0, 200, "the page itself needs no token");
    assert_eq!(
        ask(&mut right, "GET /state.json", OPERATOR, "").0,
        200,
        "this connection has shown its token before"
    );
    assert_ne!(
        ask(&mut right, "GET /state.json", VIEWER, "").0,
        200,
        "a viewer's token is new on this connection, so it needs a guess"
    );
    std::thread::sleep(Duration::from_millis(2500));
    assert_eq!(served.ask("GET /state.json", OPERATOR, "").0, 200);
}

#[test]
fn correct_tokens_do_not_count_as_guesses() {
    let served = served(&[]);
    for _ in 0..50 {
        assert_eq!(served.ask("GET /state.json", OPERATOR, "").0, 200);
    }
}

#[test]
fn repeated_wrong_token_counts_as_one_guess() {
    let served = served(&[]);
    for _ in 0..50 {
        assert_eq!(served.ask("GET /state.json", "Cookie: headrace_token=of-yesterday\r\n", "").0, 401);
    }
    assert_eq!(served.ask("GET /state.json", OPERATOR, "").0, 200);
}

#[test]
fn guesses_through_a_declared_proxy_count_for_the_forwarded_address() {
    let served = served(&[Ipv4Addr::LOCALHOST.into()]);
    let status = |of: &str, token: &str| {
        let headers = format!("X-Forwarded-For: {of}\r\nAuthorization: Bearer {token}\r\n");
        served.ask("GET /state.json", &headers, "").0
    };
    let refused = (0..30).filter(|number| status("10.0.0.1", &format!("wrong-{number}")) == 429).count();
    assert!(refused > 5, "{refused}");
    assert_eq!(status("10.0.0.2", "operator-01234567"), 200);
    assert_eq!(
        status("10.0.0.2, 10.0.0.1", "operator-01234567"),
        429,
        "an address that the client adds isn't trusted"
    );
}

#[test]
fn flood_of_wrong_tokens_gets_at_most_26_guesses_in_5_s() {
    let served = served(&[]);
    let began = Instant::now();
    let (mut guesses, mut requests) = (0_u32, 0_u32);
    let mut stream = served.connect();
    while began.elapsed() < Duration::from_secs(5) {
        let cookies: Vec<_> =
            (0..=requests % 25).map(|n| format!("headrace_token=wrong-{requests}-{n}")).collect();
        let count = u32::try_from(cookies.len()).unwrap();
        match ask(&mut stream, "GET /state.json", &format!("Cookie: {}\r\n", cookies.join("; ")), "").0 {
            401 => guesses += count,
            429 => {}
            other => panic!("{other}"),
        }
        requests += 1;
    }
    println!("{guesses} guesses in 5 s of {requests} requests");
    assert!((20..=26).contains(&guesses), "{guesses}");
}

#[test]
fn actions_beyond_the_limit_are_refused() {
    let served = served(&[]);
    let mut stream = served.connect();
    let (mut done, mut refused) = (0, 0);
    let began = Instant::now();
    while began.elapsed() < Duration::from_secs(3) {
        let (status, head) =
            ask(&mut stream, "POST /actions/note", OPERATOR, r#"{"text":"rubble","by":"AB"}"#);
        match status {
            200 => done += 1,
            429 => refused += u32::from(head.contains("retry-after: 1")),
            other => panic!("{other}: {head}"),
        }
    }
    println!("{done} notes taken and {refused} refused in 3 s");
    assert!((60..=81).contains(&done) && refused > 0, "{done} {refused}");
    assert_eq!(served.commands.load(Ordering::Relaxed), done);
}
