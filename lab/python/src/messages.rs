//! The messages of a log, one after another.

use std::collections::VecDeque;
use std::path::PathBuf;
use std::sync::{Mutex, PoisonError};

use headrace_replay::log::{DiveLog, LogMessage, MessageKind};
use pyo3::types::{PyBytes, PyBytesMethods as _};
use pyo3::{Py, PyRef, Python, pyclass, pymethods};

use crate::errors::Failure;

/// Maximum number of messages that are read ahead without the interpreter's lock. `AHEAD_BYTES` is the maximum number
/// of bytes of these messages.
const AHEAD: usize = 512;
const AHEAD_BYTES: usize = 1 << 20;

/// A message of a log.
#[pyclass(frozen, get_all, module = "headrace")]
pub(crate) struct Message {
    /// Kind of the message: "raw" (bytes from a source), "sent" (bytes sent to a source), "tick", "result", or "other"
    /// (a channel that headrace doesn't define).
    kind: &'static str,
    /// The source's name; set for raw and sent messages.
    source: Option<String>,
    /// The topic; set for results.
    topic: Option<String>,
    /// Time of receipt, ns of the log's clock.
    log_time_ns: u64,
    /// Time of validity, ns of the log's clock.
    publish_time_ns: u64,
    /// Number of the message in its channel.
    sequence: u32,
    /// Content of the message.
    data: Py<PyBytes>,
}

#[pymethods]
impl Message {
    fn __repr__(&self, py: Python<'_>) -> String {
        let of = self.source.as_ref().or(self.topic.as_ref()).map(|name| format!(" {name:?}"));
        let (of, bytes) = (of.unwrap_or_default(), self.data.bind(py).as_bytes().len());
        format!("<Message {}{of} at {} ns, {bytes} bytes>", self.kind, self.log_time_ns)
    }
}

/// The messages of a log in reading order: an iterator.
///
/// The log is read while the iterator advances, at most about a thousand messages ahead, without the interpreter's
/// lock.
#[pyclass(frozen, module = "headrace")]
pub(crate) struct Messages {
    /// The lock allows several threads to share one iterator.
    reading: Mutex<Reading>,
}

impl Messages {
    /// Opens the messages of one source, or of all channels.
    ///
    /// Errors: the log can't be opened.
    pub(crate) fn open(files: &[PathBuf], source: Option<String>) -> Result<Self, Failure> {
        let log = DiveLog::open(files)?;
        let reading = Reading { log, source, ahead: VecDeque::new(), ended: false };
        Ok(Self { reading: Mutex::new(reading) })
    }
}

#[pymethods]
impl Messages {
    fn __iter__(this: PyRef<'_, Self>) -> PyRef<'_, Self> {
        this
    }

    fn __next__(&self, py: Python<'_>) -> Result<Option<Message>, Failure> {
        let next = py.detach(|| self.reading.lock().unwrap_or_else(PoisonError::into_inner).next())?;
        Ok(next.map(|next| Message {
            kind: next.kind,
            source: next.source,
            topic: next.topic,
            log_time_ns: next.log_time_ns,
            publish_time_ns: next.publish_time_ns,
            sequence: next.sequence,
            data: PyBytes::new(py, &next.data).unbind(),
        }))
    }
}

/// Converts a message as read from the log.
struct Held {
    kind: &'static str,
    source: Option<String>,
    topic: Option<String>,
    log_time_ns: u64,
    publish_time_ns: u64,
    sequence: u32,
    data: Vec<u8>,
}

struct Reading {
    log: DiveLog,
    /// The requested source; `None` for all channels.
    source: Option<String>,
    ahead: VecDeque<Held>,
    ended: bool,
}

impl Reading {
    fn next(&mut self) -> Result<Option<Held>, Failure> {
        if self.ahead.is_empty() && !self.ended {
            self.read()?;
        }
        Ok(self.ahead.pop_front())
    }

    fn read(&mut self) -> Result<(), Failure> {
        let mut bytes = 0;
        while self.ahead.len() < AHEAD && bytes < AHEAD_BYTES {
            let Some(message) = self.log.next()? else {
                self.ended = true;
                return self.check_source();
            };
            let number = match message.kind {
                MessageKind::Raw { source } | MessageKind::Sent { source } => Some(source),
                _ => None,
            };
            let mut held = held(&message);
            held.source = number.and_then(|number| self.log.source_id(number)).map(str::to_owned);
            if self.source.is_none() || held.source == self.source {
                bytes += held.data.len();
                self.ahead.push_back(held);
            }
        }
        Ok(())
    }

    /// Checks that the log has the requested source. The check is at the log's end, because only then all sources are
    /// known.
    fn check_source(&self) -> Result<(), Failure> {
        let sources = &self.log.header().sources;
        let Some(wanted) = &self.source else { return Ok(()) };
        if sources.iter().any(|source| source.id == *wanted) {
            return Ok(());
        }
        let ids: Vec<&str> = sources.iter().map(|source| source.id.as_str()).collect();
        let known = if ids.is_empty() { "none".to_owned() } else { ids.join(", ") };
        let file = self.log.files().first().map(|file| file.path.display().to_string()).unwrap_or_default();
        Err(Failure::NoSource { source_id: wanted.clone(), file, known })
    }
}

fn held(message: &LogMessage<'_>) -> Held {
    let (kind, topic) = match message.kind {
        MessageKind::Raw { .. } => ("raw", None),
        MessageKind::Sent { .. } => ("sent", None),
        MessageKind::Tick => ("tick", None),
        MessageKind::Voice => ("voice", None),
        MessageKind::Result { topic } => ("result", Some(topic.to_owned())),
        MessageKind::Other => ("other", None),
    };
    Held {
        kind,
        source: None,
        topic,
        log_time_ns: message.log_time.0,
        publish_time_ns: message.publish_time.0,
        sequence: message.sequence,
        data: message.data.to_vec(),
    }
}
