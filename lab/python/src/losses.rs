//! Losses of a log.

use headrace_replay::log;
use pyo3::{pyclass, pymethods};

/// A loss of a log: damage, a gap, or messages that the recorder had to leave out.
#[pyclass(frozen, get_all, module = "headrace")]
#[derive(Clone)]
pub(crate) struct Loss {
    /// Description of the loss and its place.
    what: String,
    /// Start of the loss in its file, bytes; 0 if the loss has no place in a file.
    offset: u64,
    /// Length of the loss in its file, bytes; 0 if the loss has no place in a file.
    bytes: u64,
    /// Latest log time before the loss, ns of the log's clock; None if there is none.
    from_ns: Option<u64>,
    /// Earliest log time after the loss, ns of the log's clock; None if there is none.
    to_ns: Option<u64>,
}

impl Loss {
    pub(crate) fn of(loss: &log::Loss) -> Self {
        Self {
            what: loss.to_string(),
            offset: loss.offset,
            bytes: loss.bytes,
            from_ns: loss.from.map(|at| at.0),
            to_ns: loss.to.map(|at| at.0),
        }
    }

    /// The loss of messages that are too far out of order for the reader to sort.
    pub(crate) fn of_order(late: u64) -> Self {
        let what = format!("{late} messages too far out of order to be sorted, delivered in file order");
        Self { what, offset: 0, bytes: 0, from_ns: None, to_ns: None }
    }
}

#[pymethods]
impl Loss {
    fn __str__(&self) -> &str {
        &self.what
    }

    fn __repr__(&self) -> String {
        format!("Loss({:?})", self.what)
    }
}
