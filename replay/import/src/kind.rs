//! The kinds of foreign logs that can be imported.

use std::path::Path;

use headrace_sensor::connect::Connect;
use headrace_sensor::device::DeviceKind as _;

use crate::a50::{self, A50Format};
use crate::candump::Candump;
use crate::format::Format;
use crate::imagenex::{self, ImagenexFormat};
use crate::ping::{self, PingFormat};
use crate::tlog::{self, TlogFormat};

/// A kind of foreign log.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FileKind {
    /// Telemetry log of the MAVLink protocol.
    Tlog,
    /// Text log of `candump -l` or `candump -L`.
    Candump,
    /// File of Imagenex's software for the heads 881 and 852.
    Imagenex,
    /// Log of the program Ping Viewer.
    Ping,
    /// Lines of a velocity log A50 or A125.
    A50,
    /// Table of values, with a mapping that describes its columns.
    Csv,
    /// Bag of ROS 1.
    Rosbag,
    /// Recording of ROS 2 (or 1) in MCAP.
    Mcap,
}

impl FileKind {
    /// All kinds of foreign logs, in the order in which help lists them.
    pub const ALL: [Self; 8] = [
        Self::Tlog,
        Self::Candump,
        Self::Imagenex,
        Self::Ping,
        Self::A50,
        Self::Csv,
        Self::Rosbag,
        Self::Mcap,
    ];

    /// Recognises the kind of a file by the extension of its name, in upper or lower case.
    pub fn of(path: &Path) -> Option<Self> {
        let extension = path.extension()?.to_string_lossy().to_ascii_lowercase();
        match extension.as_str() {
            "tlog" => Some(Self::Tlog),
            "log" => Some(Self::Candump),
            "852" | "81a" | "81b" | "81s" | "31l" => Some(Self::Imagenex),
            "bin" => Some(Self::Ping),
            "json" | "jsonl" => Some(Self::A50),
            "csv" => Some(Self::Csv),
            "bag" => Some(Self::Rosbag),
            "mcap" => Some(Self::Mcap),
            _ => None,
        }
    }

    /// Returns the name of this kind of file.
    pub fn name(self) -> &'static str {
        match self {
            Self::Tlog => "tlog",
            Self::Candump => "candump",
            Self::Imagenex => "imagenex",
            Self::Ping => "ping",
            Self::A50 => "a50",
            Self::Csv => "csv",
            Self::Rosbag => "rosbag",
            Self::Mcap => "mcap",
        }
    }

    /// Finds a kind of file by its name.
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|kind| kind.name() == name)
    }

    /// Returns a one-line description of files of this kind.
    pub fn summary(self) -> &'static str {
        match self {
            Self::Tlog => "Telemetry log of MAVLink",
            Self::Candump => "Text of `candump -l` or `-L`",
            Self::Imagenex => "File of the software of Imagenex 881 and 852",
            Self::Ping => "Log of Ping Viewer",
            Self::A50 => "Lines of JSON from an A50 or A125",
            Self::Csv => "Table of values, with --map",
            Self::Rosbag => "Bag of ROS 1",
            Self::Mcap => "Recording of ROS 2 (or 1) in MCAP",
        }
    }

    /// Returns the name of one entry in files of this kind.
    pub fn entries(self) -> &'static str {
        match self {
            Self::Tlog | Self::Candump => "frame",
            Self::Imagenex => "shot",
            Self::Ping | Self::A50 | Self::Csv | Self::Rosbag | Self::Mcap => "message",
        }
    }

    /// Returns the format of this kind of file; `None` if the format needs a vehicle file or a mapping. The name of the
    /// file may give the time at which it starts.
    pub fn format(self, file_name: &str) -> Option<Box<dyn Format>> {
        match self {
            Self::Tlog => Some(Box::<TlogFormat>::default()),
            Self::Candump => Some(Box::new(Candump)),
            Self::Imagenex => Some(Box::new(ImagenexFormat)),
            Self::Ping => Some(Box::new(PingFormat::new(file_name))),
            Self::A50 => Some(Box::<A50Format>::default()),
            Self::Csv | Self::Rosbag | Self::Mcap => None,
        }
    }

    /// Whether files of this kind contain values, which emulators turn into bytes.
    pub fn has_values(self) -> bool {
        matches!(self, Self::Csv | Self::Rosbag | Self::Mcap)
    }

    /// Whether a file of this kind comes from a single device.
    pub(crate) fn has_one_device(self) -> bool {
        matches!(self, Self::Imagenex | Self::Ping | Self::A50)
    }

    /// Returns the plugin of the sensors whose bytes are in files of this kind; empty if the files contain values.
    pub(crate) fn plugin(self) -> &'static str {
        match self {
            Self::Tlog => headrace_mavlink::MavlinkKind.name(),
            Self::Candump => headrace_imu_can::ImuCanKind.name(),
            Self::Imagenex => headrace_imagenex881::Imagenex881Kind.name(),
            Self::Ping => headrace_ping1d::Ping1dKind.name(),
            Self::A50 => headrace_a50::A50Kind.name(),
            Self::Csv | Self::Rosbag | Self::Mcap => "",
        }
    }

    /// Returns the name that a file gives to a connection. `connect` is the connection's address in the vehicle file.
    pub(crate) fn usual_line(self, connect: &str) -> Option<String> {
        match self {
            Self::Candump => match Connect::parse(connect) {
                Ok(Connect::Can { interface }) => Some(interface),
                _ => None,
            },
            other => Some(other.line_form().to_owned()),
        }
    }

    /// Returns the form of a connection's name in files of this kind, for error texts.
    pub(crate) fn line_form(self) -> &'static str {
        match self {
            Self::Tlog => tlog::STREAM,
            Self::Candump => "INTERFACE",
            Self::Imagenex => imagenex::STREAM,
            Self::Ping => ping::STREAM,
            Self::A50 => a50::STREAM,
            Self::Csv | Self::Rosbag | Self::Mcap => "ID",
        }
    }
}
