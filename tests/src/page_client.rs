//! A client of the page over real sockets, which decodes the page's state. The decoder shares no code with the
//! server.

use std::collections::BTreeMap;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::process::{Child, ChildStdin, Stdio};
use std::sync::mpsc;
use std::time::Duration;

use serde_json::{Value, json};
use tungstenite::client::IntoClientRequest as _;
use tungstenite::{Message, WebSocket};

use crate::folder::{Folder, program};

/// Longest wait for an expected message.
const WITHIN: Duration = Duration::from_mins(2);

const SCHEMA: &str = include_str!("../../docs/reference/page-feed.schema.json");

/// A running program that serves the page. It is killed when this value goes out of scope.
pub struct Serving {
    child: Child,
    /// Host and port at which the program serves the page.
    pub address: String,
    /// Standard input of the program.
    pub stdin: Option<ChildStdin>,
    rest: mpsc::Receiver<String>,
}

impl Serving {
    /// Starts the program in this folder and waits until it prints the page's address.
    pub fn start(folder: &Folder, arguments: &[&str]) -> Self {
        let mut command = program();
        command.args(arguments).current_dir(folder.path(""));
        command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
        let mut child = command.spawn().unwrap();
        #[expect(clippy::disallowed_types, reason = "a test reads it to its end, without a loop")]
        let (sender, lines): (mpsc::Sender<String>, _) = mpsc::channel();
        let streams: [Box<dyn Read + Send>; 2] =
            [Box::new(child.stdout.take().unwrap()), Box::new(child.stderr.take().unwrap())];
        for stream in streams {
            let sender = sender.clone();
            std::thread::spawn(move || {
                for line in BufReader::new(stream).lines().map_while(Result::ok) {
                    if sender.send(line).is_err() {
                        return;
                    }
                }
            });
        }
        drop(sender);
        let mut printed = Vec::new();
        let address = loop {
            let Ok(line) = lines.recv_timeout(WITHIN) else { panic!("no page: {printed:#?}") };
            let scheme = line.find("://").filter(|_| line.contains("page ") && line.contains("http"));
            if let Some(at) = scheme {
                break line[at + 3..].trim().to_owned();
            }
            printed.push(line);
        };
        let stdin = child.stdin.take();
        Self { child, address, stdin, rest: lines }
    }

    /// Sends a signal to the program.
    pub fn signal(&self, signal: rustix::process::Signal) {
        let pid = rustix::process::Pid::from_child(&self.child);
        rustix::process::kill_process(pid, signal).unwrap();
    }

    /// Waits for the program's end; returns exit code and output.
    pub fn end(mut self) -> (Option<i32>, String) {
        let code = self.child.wait().unwrap().code();
        (code, self.rest.iter().collect::<Vec<_>>().join("\n"))
    }

    /// Sends a request; returns status and full response.
    pub fn ask(&self, method: &str, path: &str, headers: &[&str], body: impl AsRef<[u8]>) -> (u16, String) {
        ask(&self.address, method, path, headers, body)
    }

    /// Sends a GET request, which must succeed with status 200. Returns the body of the response.
    pub fn get(&self, path: &str) -> Vec<u8> {
        let bytes = answer_of(&self.address, "GET", path, &[], &[]);
        assert!(bytes.starts_with(b"HTTP/1.1 200"), "{path}: {}", String::from_utf8_lossy(&bytes));
        let end = bytes.windows(4).position(|window| window == b"\r\n\r\n").unwrap();
        bytes[end + 4..].to_vec()
    }
}

impl Drop for Serving {
    fn drop(&mut self) {
        let _gone = self.child.kill();
        let _gone = self.child.wait();
    }
}

/// Sends a request to a server at this host and port; returns status and full response.
pub fn ask(
    address: &str,
    method: &str,
    path: &str,
    headers: &[&str],
    body: impl AsRef<[u8]>,
) -> (u16, String) {
    let bytes = answer_of(address, method, path, headers, body.as_ref());
    let text = String::from_utf8_lossy(&bytes).into_owned();
    let status = text.split(' ').nth(1).and_then(|code| code.parse().ok()).unwrap_or(0);
    (status, text)
}

/// Sends a GET request to a server that may close the connection; returns the status.
///
/// Errors: the server can't be reached, or has closed the connection without an answer.
pub fn try_ask(address: &str, path: &str) -> std::io::Result<u16> {
    let mut stream = TcpStream::connect(address)?;
    stream.set_read_timeout(Some(WITHIN))?;
    write!(stream, "GET {path} HTTP/1.1\r\nHost: {address}\r\nConnection: close\r\n\r\n")?;
    let mut answer = String::new();
    stream.read_to_string(&mut answer)?;
    let status = answer.split(' ').nth(1).and_then(|status| status.parse().ok());
    status.ok_or_else(|| std::io::ErrorKind::UnexpectedEof.into())
}

fn answer_of(address: &str, method: &str, path: &str, headers: &[&str], body: &[u8]) -> Vec<u8> {
    let mut stream = TcpStream::connect(address).unwrap();
    stream.set_read_timeout(Some(WITHIN)).unwrap();
    let host = if headers.iter().any(|header| header.starts_with("Host:")) {
        String::new()
    } else {
        format!("Host: {address}\r\n")
    };
    let further = headers.iter().fold(String::new(), |all, header| all + header + "\r\n");
    // If a test states a body length in its headers, even a wrong one, no other length is added.
    let states =
        headers.iter().any(|header| header.starts_with("Content-Length:") || header.contains("chunked"));
    let length = if states { String::new() } else { format!("Content-Length: {}\r\n", body.len()) };
    let head = format!("{method} {path} HTTP/1.1\r\n{host}{further}{length}Connection: close\r\n\r\n");
    stream.write_all(&[head.as_bytes(), body].concat()).unwrap();
    let mut bytes = Vec::new();
    stream.read_to_end(&mut bytes).unwrap();
    bytes
}

/// A section of the wall as the client received it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SeenSection {
    /// Verdict: 0 open, 1 pass, 2 fail, 3 cannot say, 4 not inspected.
    pub verdict: u8,
    /// Verdict for the second target; `None` without a second target.
    pub compared: Option<u8>,
    /// Number of the cause of the section's verdict.
    pub cause: u8,
    /// Diameter of the section's largest hole, m.
    pub hole_m: f32,
    /// Bit set of the covered parts of the section.
    pub seen: u64,
}

/// A connected client, and everything that it has received.
pub struct Viewer {
    socket: WebSocket<TcpStream>,
    /// First message that the server sent.
    pub hello: Value,
    /// Sections of the wall. The key is the section's number.
    pub sections: BTreeMap<i32, SeenSection>,
    /// Number of wall samples received.
    pub samples: u64,
    /// Number of WebSocket frames with sections received, and number of sections in all of them.
    pub section_frames: (u64, u64),
    /// Last live state received.
    pub state: Value,
    /// Last list of alerts received, updated by all changes received since.
    pub alerts: BTreeMap<u64, Value>,
    /// Operator's notes received.
    pub notes: Vec<Value>,
    /// All other messages received, newest last.
    pub others: Vec<Value>,
    /// Last sequence number received.
    pub seq: u64,
    /// Schema of text messages: `docs/reference/page-feed.schema.json`.
    schema: Value,
}

/// Returns the ways in which a text message violates the schema of its type.
fn faults(schema: &Value, text: &Value) -> Vec<String> {
    let of_type = schema["anyOf"].as_array().unwrap().iter().find(|one| {
        let definition = one["$ref"].as_str().unwrap().strip_prefix('#').unwrap();
        schema.pointer(definition).unwrap()["properties"]["type"]["const"] == text["type"]
    });
    let Some(of_type) = of_type else { return vec!["a type that the schema doesn't have".to_owned()] };
    let mut alone = of_type.clone();
    alone["$defs"] = schema["$defs"].clone();
    crate::json_schema::faults(&alone, text)
}

impl Viewer {
    /// Connects to the page. The URL query `query` is empty or begins with `?`.
    pub fn connect(
        serving: &Serving,
        query: &str,
        headers: &[(&'static str, &str)],
    ) -> Result<Self, tungstenite::Error> {
        Self::connect_to(&serving.address, query, headers)
    }

    /// As [`Viewer::connect`], by host and port.
    pub fn connect_to(
        address: &str,
        query: &str,
        headers: &[(&'static str, &str)],
    ) -> Result<Self, tungstenite::Error> {
        let stream = TcpStream::connect(address)?;
        stream.set_read_timeout(Some(WITHIN))?;
        let mut request = format!("ws://{address}/feed{query}").into_client_request()?;
        for (name, value) in headers {
            request.headers_mut().insert(*name, value.parse().unwrap());
        }
        let protocol = "headrace.feed.1".parse().unwrap();
        request.headers_mut().insert("Sec-WebSocket-Protocol", protocol);
        let (socket, _) = tungstenite::client::client(request, stream).map_err(|error| match error {
            tungstenite::HandshakeError::Failure(error) => error,
            tungstenite::HandshakeError::Interrupted(_) => panic!("no answer"),
        })?;
        Ok(Self {
            socket,
            hello: Value::Null,
            sections: BTreeMap::new(),
            samples: 0,
            section_frames: (0, 0),
            state: Value::Null,
            alerts: BTreeMap::new(),
            notes: Vec::new(),
            others: Vec::new(),
            seq: 0,
            schema: serde_json::from_str(SCHEMA).unwrap(),
        })
    }

    /// Reads messages until `holds` returns true. Panics if the connection ends or the time limit is reached before
    /// that.
    #[expect(clippy::disallowed_methods, reason = "the wait would never end")]
    pub fn until(&mut self, what: &str, mut holds: impl FnMut(&Self) -> bool) {
        let began = std::time::Instant::now();
        while !holds(self) {
            assert!(began.elapsed() < WITHIN, "{what}: not reached within {WITHIN:?}; state {}", self.state);
            if let Err(why) = self.read() {
                panic!("{what}: {why}; last {:?}", self.others.last());
            }
        }
    }

    /// Reads messages until a message of type `kind` arrives.
    pub fn until_type(&mut self, kind: &str) -> Value {
        let before = self.others.len();
        self.until(kind, |viewer| viewer.others[before..].iter().any(|other| other["type"] == kind));
        self.others[before..].iter().find(|other| other["type"] == kind).unwrap().clone()
    }

    /// Reads until the connection is closed; returns code and reason of the close frame.
    pub fn until_closed(&mut self) -> Option<(u16, String)> {
        loop {
            match self.socket.read() {
                Ok(Message::Close(frame)) => {
                    return frame.map(|frame| (frame.code.into(), frame.reason.to_string()));
                }
                Ok(message) => self.take(&message),
                Err(_) => return None,
            }
        }
    }

    /// Reads messages until the dive has begun. A replay can't be controlled before it has begun.
    pub fn until_begun(&mut self) {
        self.until("a state", |viewer| !viewer.state.is_null());
    }

    /// Reads a message and updates the fields.
    pub fn read(&mut self) -> Result<(), tungstenite::Error> {
        let message = self.socket.read()?;
        self.take(&message);
        if message.is_close() { Err(tungstenite::Error::ConnectionClosed) } else { Ok(()) }
    }

    /// Sends an operator's command to the server.
    pub fn send(&mut self, command: &Value) {
        self.send_raw(Message::Text(command.to_string().into())).unwrap();
    }

    /// Sends any WebSocket message to the server.
    pub fn send_raw(&mut self, message: Message) -> Result<(), tungstenite::Error> {
        self.socket.send(message)
    }

    /// URL query with which a client resumes a lost connection.
    pub fn resume(&self) -> String {
        format!("?instance={}&since={}", self.hello["instance"].as_str().unwrap(), self.seq)
    }

    fn take(&mut self, message: &Message) {
        match message {
            Message::Text(text) => self.take_text(serde_json::from_str(text).unwrap()),
            Message::Binary(bytes) => self.take_frame(bytes),
            _ => {}
        }
    }

    fn take_text(&mut self, value: Value) {
        let faults = faults(&self.schema, &value);
        assert!(faults.is_empty(), "{value:#}: {faults:#?}");
        self.seq = self.seq.max(value["seq"].as_u64().unwrap());
        match value["type"].as_str().unwrap() {
            "hello" => {
                if value["instance"] != self.hello["instance"] {
                    self.sections.clear();
                }
                self.hello = value;
            }
            "state" => {
                // As on the page, alerts that are already known get the figures of the new state.
                for alert in value["alert_list"].as_array().into_iter().flatten() {
                    let known = alert["number"].as_u64().and_then(|number| self.alerts.get_mut(&number));
                    if let Some(known) = known {
                        known.clone_from(alert);
                    }
                }
                self.state = value;
            }
            "alerts" => {
                let list = value["list"].as_array().unwrap();
                self.alerts =
                    list.iter().map(|alert| (alert["number"].as_u64().unwrap(), alert.clone())).collect();
            }
            "notes" => self.notes = value["list"].as_array().unwrap().clone(),
            "alert_change" => {
                let alert = value["alert"].clone();
                self.alerts.insert(alert["number"].as_u64().unwrap(), alert);
                self.others.push(value);
            }
            _ => self.others.push(value),
        }
    }

    fn take_frame(&mut self, bytes: &[u8]) {
        let word = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap());
        let long = |at: usize| u64::from_le_bytes(bytes[at..at + 8].try_into().unwrap());
        assert_eq!(bytes[1], 1, "version");
        let count = word(4) as usize;
        self.seq = self.seq.max(long(8));
        match bytes[0] {
            1 => {
                assert_eq!(bytes.len(), 16 + 32 * count);
                self.section_frames = (self.section_frames.0 + 1, self.section_frames.1 + count as u64);
                for at in (0..count).map(|number| 16 + 32 * number) {
                    let (verdict, cause) = (bytes[at + 4], bytes[at + 5]);
                    let section = SeenSection {
                        verdict,
                        compared: ((bytes[at + 7] >> 2) & 7).checked_sub(1),
                        cause,
                        hole_m: f32::from_bits(word(at + 8)),
                        seen: long(at + 24),
                    };
                    self.sections.insert(word(at).cast_signed(), section);
                }
            }
            2 => {
                assert_eq!(bytes.len(), 16 + 20 * count);
                self.samples += count as u64;
            }
            other => panic!("a frame of kind {other}"),
        }
    }
}

/// Command that acknowledges all alerts that require it.
pub fn acknowledge_all(by: &str) -> Value {
    json!({"do": "acknowledge", "alert": 0, "by": by})
}
