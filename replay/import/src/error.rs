//! Errors of importing a foreign log.

use headrace_replay::log::LogError;

/// Reason why a foreign log can't be imported.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ImportError {
    /// Reading the file to import fails.
    #[error("reading {name} at byte {offset}: {source}")]
    Read {
        /// Name of the file.
        name: String,
        /// Offset in the file at which reading failed, bytes.
        offset: u64,
        /// Error from the operating system.
        source: std::io::Error,
    },
    /// The file to import contains no entry.
    #[error("importing {name}: there is no {what} in its {bytes} bytes{why}")]
    Nothing {
        /// Name of the file.
        name: String,
        /// Name of the entries that a file of this kind should have.
        what: &'static str,
        /// Length of the file, bytes.
        bytes: u64,
        /// First loss of the file, as text to append; empty if there is none.
        why: String,
    },
    /// The file isn't a ROS bag of version 2.0.
    #[error("importing {name}: a ROS bag begins with \"#ROSBAG V2.0\", this file with {found:?}")]
    NoBag {
        /// Name of the file.
        name: String,
        /// First bytes of the file that isn't a bag.
        found: String,
    },
    /// The file is a dive log of this program.
    #[error("importing {name}: it is a dive log already; `headrace replay` reads it as it is")]
    DiveLog {
        /// Name of the file.
        name: String,
    },
    /// The log can't be written, or the recording can't be read.
    #[error(transparent)]
    Log(#[from] LogError),
}
