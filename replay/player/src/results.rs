//! The streams of results in a log. A message consists of the tick's index, the number of records before it, and the words
//! of [`headrace_monitor::result_stream`], all u64, little-endian.

use crate::log::format::RESULT_PREFIX;

/// The streams of results in a log; [`headrace_monitor::resources::Digests::streams`] has them in the same order.
pub(crate) const STREAMS: [&str; 6] = ["poses", "pings", "judgements", "advice", "states", "alerts"];
/// Words before a message's records.
pub(crate) const HEAD_WORDS: usize = 2;

/// Index of the stream with that topic.
pub(crate) fn stream_of(topic: &str) -> Option<usize> {
    let name = topic.strip_prefix(RESULT_PREFIX)?;
    STREAMS.iter().position(|stream| *stream == name)
}

/// Decodes a message of a stream: the tick's index, the number of the first record, and the words.
pub(crate) fn read_results(message: &[u8]) -> Option<(u64, u64, Vec<u64>)> {
    let (words, rest) = message.as_chunks::<8>();
    let mut words = words.iter().map(|word| u64::from_le_bytes(*word));
    let (tick, first) = (words.next()?, words.next()?);
    rest.is_empty().then(|| (tick, first, words.collect()))
}
