//! Sources of bytes: a port, a log or the simulator fills the ring of each.

use headrace_sensor::device::Decoder;

/// A source of bytes, as a plugin registers it.
pub struct SourceSpec {
    /// Name of the source, and of its channel in the log.
    pub id: String,
    /// Kind of device that the source is.
    pub plugin: String,
    /// Connection of the source, as written in the vehicle file.
    pub connect: String,
    /// Decoder from the source's bytes to readings.
    pub decoder: Box<dyn Decoder>,
    /// Capacity of the source's ring, bytes.
    pub ring_bytes: usize,
}

/// A source without its decoder, as listed in reports and logs.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SourceInfo {
    /// Name of the source.
    pub id: String,
    /// Kind of device that the source is.
    pub plugin: String,
    /// Connection of the source, as written in the vehicle file.
    pub connect: String,
}
