//! Channels derived from recorded results, computed on the recorder's thread.

use headrace_geometry::time::MonoNs;

/// A derived message.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Made {
    /// Number of the result channel for the message. The message is ignored if the log has no such channel.
    pub channel: u16,
    /// Log time of the message.
    pub at: MonoNs,
    /// Content of the message.
    pub bytes: Vec<u8>,
}

/// Derives messages from results on the recorder's thread, so that the loop has no extra work.
pub trait DerivedChannels: Send {
    /// Processes a message of result channel `channel`. It is called even if the disk has no room for that message.
    fn take(&mut self, channel: u16, at: MonoNs, message: &[u8], made: &mut Vec<Made>);

    /// Called at the end of the dive.
    fn end(&mut self, made: &mut Vec<Made>);
}
