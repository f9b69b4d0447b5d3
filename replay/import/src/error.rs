//! Why a file can't be imported.

use headrace_replay::log::LogError;

/// Why a file can't be imported.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ImportError {
    /// The medium failed.
    #[error("reading {name} at byte {offset}: {source}")]
    Read {
        /// The file.
        name: String,
        /// Where.
        offset: u64,
        /// Why.
        source: std::io::Error,
    },
    /// Nothing in it that could be imported.
    #[error("importing {name}: there is no {what} in its {bytes} bytes{why}")]
    Nothing {
        /// The file.
        name: String,
        /// What was looked for.
        what: &'static str,
        /// Length of the file.
        bytes: u64,
        /// What was found in place, or empty.
        why: String,
    },
    /// No bag that is known.
    #[error("importing {name}: a ROS bag begins with \"#ROSBAG V2.0\", this file with {found:?}")]
    NoBag {
        /// The file.
        name: String,
        /// Its first bytes.
        found: String,
    },
    /// A log of ours.
    #[error("importing {name}: it is a dive log already; `headrace replay` reads it as it is")]
    DiveLog {
        /// The file.
        name: String,
    },
    /// The log can't be written, or the recording not be read.
    #[error(transparent)]
    Log(#[from] LogError),
}
