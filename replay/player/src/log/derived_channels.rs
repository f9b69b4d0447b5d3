//! What works beside the recorder, on its thread: it makes more messages of the results that are written.

use headrace_geometry::time::MonoNs;

/// A message that a derived has made.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Made {
    /// Number of its result channel; one that the log doesn't have is passed over.
    pub channel: u16,
    /// Its log time.
    pub at: MonoNs,
    /// Its content.
    pub bytes: Vec<u8>,
}

/// Makes messages of results as they pass through the recorder. The loop has no part in it.
pub trait DerivedChannels: Send {
    /// A message of the result channel with that number. It comes whether or not the disk has room for it.
    fn take(&mut self, channel: u16, at: MonoNs, message: &[u8], made: &mut Vec<Made>);

    /// The dive has ended.
    fn end(&mut self, made: &mut Vec<Made>);
}
