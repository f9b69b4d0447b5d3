//! Streams of results in a log.
//!
//! A message has the tick's index, the number of earlier records in the stream, and the words of
//! [`headrace_monitor::result_stream`]. All are u64, little-endian.

use crate::log::format::RESULT_PREFIX;

/// Names of the streams of results, in the order of [`headrace_monitor::view::DiveView::streams`].
pub(crate) const STREAMS: [&str; 6] = ["poses", "pings", "judgements", "advice", "states", "alerts"];
/// Number of words in a message before its records.
pub(crate) const HEAD_WORDS: usize = 2;

/// Returns the index of the stream with this topic.
pub(crate) fn stream_of(topic: &str) -> Option<usize> {
    let name = topic.strip_prefix(RESULT_PREFIX)?;
    STREAMS.iter().position(|stream| *stream == name)
}

/// Decodes a message of a stream: index of the tick, number of the first record, and words.
pub(crate) fn read_results(message: &[u8]) -> Option<(u64, u64, Vec<u64>)> {
    let (words, rest) = message.as_chunks::<8>();
    let mut words = words.iter().map(|word| u64::from_le_bytes(*word));
    let (tick, first) = (words.next()?, words.next()?);
    rest.is_empty().then(|| (tick, first, words.collect()))
}
