//! A dive's log: its header and its content.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::OnceLock;

use headrace_geometry::time::MonoNs;
use headrace_replay::log::{DiveLog, LogInfo, SourceInfo, files_of};
use pyo3::types::PyBytes;
use pyo3::{Py, Python, pyclass, pymethods};

use crate::arguments::Named;
use crate::errors::Failure;
use crate::losses::Loss;
use crate::messages::Messages;
use crate::profile::Profile;
use crate::vehicle;

/// A source of a log: one sensor's stream of packets, or the operator's commands (`console`).
#[pyclass(frozen, get_all, module = "headrace")]
pub(crate) struct Source {
    /// Name of the source.
    id: String,
    /// Kind of the device; empty if unknown.
    plugin: String,
    /// Connection of the device; empty if unknown.
    connect: String,
}

#[pymethods]
impl Source {
    fn __repr__(&self) -> String {
        format!("Source(id={:?}, plugin={:?}, connect={:?})", self.id, self.plugin, self.connect)
    }
}

impl Source {
    fn of(source: &SourceInfo) -> Self {
        let SourceInfo { id, plugin, connect } = source.clone();
        Self { id, plugin, connect }
    }
}

/// A dive's log: an MCAP file, the parts of a recording, or a folder with these. Opening a log scans it once, without
/// unpacking its content.
///
/// Raises LogError if a file can't be read, isn't MCAP, or has a later format, or if several files aren't parts of one
/// recording. Damage isn't an error: see `losses`.
#[pyclass(frozen, module = "headrace")]
pub(crate) struct Log {
    files: Vec<PathBuf>,
    info: LogInfo,
    span: Option<(MonoNs, MonoNs)>,
    has_ticks: bool,
    found: OnceLock<Found>,
}

/// Content that is known only after the log has been read to its end.
struct Found {
    losses: Vec<Loss>,
    notes: Vec<String>,
    sources: Vec<SourceInfo>,
}

impl Log {
    fn name(&self) -> String {
        self.files.first().map(|file| file.display().to_string()).unwrap_or_default()
    }

    fn found(&self, py: Python<'_>) -> Result<&Found, Failure> {
        if let Some(found) = self.found.get() {
            return Ok(found);
        }
        let found = py.detach(|| read_all(&self.files))?;
        Ok(self.found.get_or_init(|| found))
    }
}

#[pymethods]
impl Log {
    #[new]
    fn new(py: Python<'_>, path: Named) -> Result<Self, Failure> {
        let named = path.paths();
        py.detach(|| {
            let log = DiveLog::open(&files_of(&named)?)?;
            Ok(Self {
                files: log.files().iter().map(|file| file.path.clone()).collect(),
                info: log.header().clone(),
                span: log.times(),
                has_ticks: log.has_ticks(),
                found: OnceLock::new(),
            })
        })
    }

    /// Files of the log, in reading order.
    #[getter]
    fn files(&self) -> Vec<PathBuf> {
        self.files.clone()
    }

    /// First and last time, ns of the log's clock, from the chunks' headers; None if the log has no messages.
    #[getter]
    fn span_ns(&self) -> Option<(u64, u64)> {
        self.span.map(|(from, to)| (from.0, to.0))
    }

    /// Whether the log has the ticks of the loop that wrote it. Logs of headrace have them.
    #[getter]
    fn has_ticks(&self) -> bool {
        self.has_ticks
    }

    /// Metadata. Entries of headrace's own record are found by "key", entries of other records by "record/key".
    #[getter]
    fn metadata(&self) -> BTreeMap<String, String> {
        self.info.metadata.clone()
    }

    /// The attached vehicle file, as TOML text; None if no readable vehicle file is attached.
    #[getter]
    fn vehicle_toml(&self) -> Option<&str> {
        self.info.vehicle_toml.as_deref()
    }

    /// Attachments other than the vehicle file, by name.
    #[getter]
    fn attachments(&self, py: Python<'_>) -> BTreeMap<String, Py<PyBytes>> {
        let content = |(name, bytes): &(String, Vec<u8>)| (name.clone(), PyBytes::new(py, bytes).unbind());
        self.info.attachments.iter().map(content).collect()
    }

    /// The tunnel's design profile from the attached vehicle file.
    ///
    /// Raises LogError if no vehicle file is attached, ConfigError if the vehicle file is invalid.
    fn profile(&self) -> Result<Profile, Failure> {
        let name = self.name();
        let vehicle = vehicle::attached(&self.info, &name)?;
        Ok(Profile::of(vehicle.tunnel.profile))
    }

    /// Sources of the log, in order of their numbers. Reads the log to its end, once, because a log may define channels
    /// late.
    ///
    /// Raises LogError on an I/O error.
    fn sources(&self, py: Python<'_>) -> Result<Vec<Source>, Failure> {
        Ok(self.found(py)?.sources.iter().map(Source::of).collect())
    }

    /// Losses: damage, gaps, and messages that the recorder left out. Empty for a complete log. Reads the log to its
    /// end, once.
    ///
    /// Raises LogError on an I/O error.
    fn losses(&self, py: Python<'_>) -> Result<Vec<Loss>, Failure> {
        Ok(self.found(py)?.losses.clone())
    }

    /// Anomalies that lost no data, and how the reader handled them. Reads the log to its end, once.
    ///
    /// Raises LogError on an I/O error.
    fn notes(&self, py: Python<'_>) -> Result<Vec<String>, Failure> {
        Ok(self.found(py)?.notes.clone())
    }

    /// Messages of the log, in reading order: all messages, or only those from and to one source.
    ///
    /// Raises LogError on an I/O error or, at the end, if the log has no such source.
    #[pyo3(signature = (source=None))]
    fn messages(&self, py: Python<'_>, source: Option<String>) -> Result<Messages, Failure> {
        py.detach(|| Messages::open(&self.files, source))
    }

    fn __repr__(&self) -> String {
        let span_s = self.span.map_or(0.0, |(from, to)| to.since(from).as_secs_f64());
        format!("<Log {:?}, {} files, {span_s:.3} s>", self.name(), self.files.len())
    }
}

/// Reads a log to its end and collects its sources, losses and notes.
fn read_all(files: &[PathBuf]) -> Result<Found, Failure> {
    let mut log = DiveLog::open(files)?;
    let mut doubles = log.doubles();
    while log.next()?.is_some() {}
    doubles.extend(log.doubles());
    doubles.sort();
    doubles.dedup();
    let note = |(topic, ids): (String, Vec<u16>)| {
        let ids: Vec<String> = ids.iter().map(u16::to_string).collect();
        format!("channels {} are all called {topic:?}: read as one", ids.join(", "))
    };
    let mut losses: Vec<Loss> = log.losses().iter().map(Loss::of).collect();
    if log.late() > 0 {
        losses.push(Loss::of_order(log.late()));
    }
    Ok(Found {
        losses,
        notes: doubles.into_iter().map(note).collect(),
        sources: log.header().sources.clone(),
    })
}
