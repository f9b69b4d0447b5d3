//! Errors of an import.

use headrace_replay::log::LogError;

/// A file can't be imported.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ImportError {
    /// An I/O error.
    #[error("reading {name} at byte {offset}: {source}")]
    Read {
        /// The file.
        name: String,
        /// Offset, bytes.
        offset: u64,
        /// Cause.
        source: std::io::Error,
    },
    /// The file has nothing to import.
    #[error("importing {name}: there is no {what} in its {bytes} bytes{why}")]
    Nothing {
        /// The file.
        name: String,
        /// Kind of entries searched for.
        what: &'static str,
        /// Length of the file.
        bytes: u64,
        /// The content found instead, or empty.
        why: String,
    },
    /// The file isn't a known kind of bag.
    #[error("importing {name}: a ROS bag begins with \"#ROSBAG V2.0\", this file with {found:?}")]
    NoBag {
        /// The file.
        name: String,
        /// Its first bytes.
        found: String,
    },
    /// The file is a dive log of this program.
    #[error("importing {name}: it is a dive log already; `headrace replay` reads it as it is")]
    DiveLog {
        /// The file.
        name: String,
    },
    /// The log can't be written, or the recording can't be read.
    #[error(transparent)]
    Log(#[from] LogError),
}
