//! Channels derived from recorded results, computed on the recorder's thread.

use headrace_geometry::time::MonoNs;

/// A derived message.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Made {
    /// Number of its result channel; ignored if the log has no such channel.
    pub channel: u16,
    /// Log time.
    pub at: MonoNs,
    /// Content.
    pub bytes: Vec<u8>,
}

/// Derives messages from results as they pass through the recorder, without involving the loop.
pub trait DerivedChannels: Send {
    /// Takes a message of result channel `channel`; called whether or not the disk has room for the message.
    fn take(&mut self, channel: u16, at: MonoNs, message: &[u8], made: &mut Vec<Made>);

    /// Called when the dive has ended.
    fn end(&mut self, made: &mut Vec<Made>);
}
