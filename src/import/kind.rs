//! The formats of foreign logs.

/// A kind of foreign log.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub(crate) enum Kind {
    /// Telemetry log of MAVLink.
    Tlog,
    /// Text of `candump -l` or `-L`.
    Candump,
    /// File of the software of Imagenex 881 and 852.
    Imagenex,
    /// Log of Ping Viewer.
    Ping,
    /// Table of values, with --map.
    Csv,
    /// Bag of ROS 1.
    Rosbag,
    /// Recording of ROS 2 (or 1) in MCAP.
    Mcap,
}

impl Kind {
    /// Its name, as `--format` takes it.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Tlog => "tlog",
            Self::Candump => "candump",
            Self::Imagenex => "imagenex",
            Self::Ping => "ping",
            Self::Csv => "csv",
            Self::Rosbag => "rosbag",
            Self::Mcap => "mcap",
        }
    }

    /// What one of its entries is called.
    pub(crate) fn entries(self) -> &'static str {
        match self {
            Self::Tlog | Self::Candump => "frame",
            Self::Imagenex => "shot",
            Self::Ping | Self::Csv | Self::Rosbag | Self::Mcap => "message",
        }
    }
}
