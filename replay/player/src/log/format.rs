//! Names and layouts of the dive log.
//!
//! | channel | message | log time | publish time |
//! |---|---|---|---|
//! | `/raw/<source id>` | bytes as received: one device frame, datagram, CAN frame, HID report or I2C transaction | receive time | time of validity, if the device gives one, else the receive time |
//! | `/sent/<source id>` | bytes sent to the device | time of sending | the same |
//! | `/loop/tick` | one tick of the loop, see [`Tick`] | the tick's time | the same |
//! | `/notes/voice` | the recording of a voice note, see [`super::voice`]. A replay doesn't read it | log time of the previous message | the same |
//! | `/result/poses`, `/result/pings`, `/result/judgements`, `/result/advice`, `/result/states` | the loop's results of a tick as words ([`headrace_monitor::result_stream`]): u64 tick, u64 number of the first record, then the records. Only `verify` reads them, a replay doesn't | the tick's time | the same |
//! | `/result/view/...` | results for viewers, in JSON: [`crate::view`] | the tick's time | the same |
//!
//! Times are nanoseconds of the host's monotonic clock. Every channel counts its messages from 0 (`sequence`).
//!
//! Channels of bytes have the message encoding `application/octet-stream` and no schema. Their metadata has the keys
//! `plugin`, `connect` and `source`. The value of `source` is the source's number in `/loop/tick`.

use std::collections::BTreeMap;

use headrace_geometry::time::MonoNs;
use sha2::{Digest, Sha256};

/// Version of the log format that this module describes.
pub const FORMAT_VERSION: u32 = 1;
/// Prefix of the `library` field in this program's logs. The program's version follows it.
pub const LIBRARY: &str = "headrace ";
/// Topic prefix for bytes received from a source; the source's id follows.
pub const RAW_PREFIX: &str = "/raw/";
/// Topic prefix for bytes sent to a source; the source's id follows.
pub const SENT_PREFIX: &str = "/sent/";
/// Topic prefix of the channels with the loop's results.
pub const RESULT_PREFIX: &str = "/result/";
/// Topic prefix of results for viewers.
pub const VIEW_PREFIX: &str = "/result/view/";
/// Topic of the channel with recordings of voice notes.
pub const VOICE_TOPIC: &str = "/notes/voice";
/// Topic of the channel with the loop's ticks.
pub const TICK_TOPIC: &str = "/loop/tick";
/// Message encoding of raw, sent, tick and voice channels.
pub const BYTES_ENCODING: &str = "application/octet-stream";
/// Name of the metadata record written by the recorder: versions, digests, clock anchors.
pub const METADATA: &str = "headrace";
/// Name of the metadata record that repeats the channel definitions and lists the attachments.
///
/// Each channel has the keys `<number>/topic` and `<number>/<key of its metadata>`. Each attachment has the key
/// [`ATTACHMENT_PREFIX`] followed by its name, and its length in bytes as the value.
pub const CHANNEL_LIST: &str = "headrace.channels";
/// Name of the metadata records that state known losses of the log.
///
/// The key is `<number>`, the value is `<from> <to> <words>`. The two log times are in ns; `-` stands for an unknown
/// time. A recorder writes these records when the disk is full or after a fault; `headrace recover` writes them too.
pub const LOSSES: &str = "headrace.losses";
/// Prefix of the keys in [`CHANNEL_LIST`] that contain attachment names.
pub const ATTACHMENT_PREFIX: &str = "attachment/";
/// Key of [`FORMAT_VERSION`] in [`METADATA`].
pub const FORMAT_KEY: &str = "format";
/// Key of a digest over a metadata record's name and its other entries. MCAP has no checksum for these records.
pub const DIGEST_KEY: &str = "sha256";
/// Name of the attachment that holds the vehicle file.
pub const VEHICLE_FILE: &str = "vehicle.toml";
/// Key in a channel's metadata whose value is the plugin of the device.
pub const PLUGIN_KEY: &str = "plugin";
/// Key in a channel's metadata whose value is the connection of the device.
pub const CONNECT_KEY: &str = "connect";
/// Key in a channel's metadata whose value is the source number in `/loop/tick`.
pub const SOURCE_KEY: &str = "source";

/// Length of a tick message before the list of sources, bytes.
pub const TICK_HEAD_BYTES: usize = 20;

/// One tick of the loop, as stored in a `/loop/tick` message.
///
/// Layout, little-endian: u64 index of the tick, u64 time in ns, u32 count, then as many u16. The u16 are the source
/// numbers of the packets that the tick consumed, in the order of consumption. The packets of one source are consumed
/// in the order of their sequence numbers, so the list identifies every packet.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Tick<'a> {
    /// Number of the tick in the dive, from 0.
    pub index: u64,
    /// Time at the end of the tick.
    pub now: MonoNs,
    order: &'a [u8],
}

/// Error of a malformed `/loop/tick` message.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error(
    "a tick of {packets} packets takes {TICK_HEAD_BYTES} + 2 * {packets} bytes, and the message has {len}"
)]
pub struct TickError {
    /// Number of packets that the message states; 0 if the message is too short to state one.
    pub packets: u32,
    /// Length of the malformed message, bytes.
    pub len: usize,
}

impl<'a> Tick<'a> {
    /// Decodes a message, without allocation.
    ///
    /// Errors: the length doesn't match the count.
    pub fn decode(message: &'a [u8]) -> Result<Self, TickError> {
        let fields = || {
            let mut fields = super::fields::Fields::new(message);
            Some((fields.u64()?, fields.u64()?, fields.u32()?, fields.rest()))
        };
        let (index, now, packets, order) = fields().ok_or(TickError { packets: 0, len: message.len() })?;
        if order.len() as u64 != 2 * u64::from(packets) {
            return Err(TickError { packets, len: message.len() });
        }
        Ok(Self { index, now: MonoNs(now), order })
    }

    /// Returns the source numbers of the packets, in the order of consumption.
    pub fn order(&self) -> impl ExactSizeIterator<Item = u16> + 'a {
        self.order.as_chunks::<2>().0.iter().map(|pair| u16::from_le_bytes(*pair))
    }
}

/// Encodes a tick message up to the list of sources, without allocation.
pub(super) fn tick_head(index: u64, now: MonoNs, packets: u32) -> [u8; TICK_HEAD_BYTES] {
    let mut head = [0; TICK_HEAD_BYTES];
    let values = index.to_le_bytes().into_iter().chain(now.0.to_le_bytes()).chain(packets.to_le_bytes());
    head.iter_mut().zip(values).for_each(|(byte, value)| *byte = value);
    head
}

/// Returns the bytes of the list of sources in the message.
pub(super) fn order_bytes(order: &[u16]) -> impl Iterator<Item = u8> {
    order.iter().flat_map(|source| source.to_le_bytes())
}

/// Formats a loss as the value of a [`LOSSES`] entry.
pub(super) fn stated_loss(from: Option<MonoNs>, to: Option<MonoNs>, words: &str) -> String {
    let time = |time: Option<MonoNs>| time.map_or_else(|| "-".to_owned(), |time| time.0.to_string());
    format!("{} {} {words}", time(from), time(to))
}

/// Parses the text of [`stated_loss`] into start time, end time and words.
pub(super) fn read_loss(text: &str) -> (Option<MonoNs>, Option<MonoNs>, &str) {
    let mut parts = text.splitn(3, ' ');
    let mut time = || parts.next().and_then(|time| time.parse().ok()).map(MonoNs);
    let (from, to) = (time(), time());
    (from, to, parts.next().unwrap_or(text))
}

/// Adds the digest of a metadata record's name and entries to the record.
pub(super) fn seal(name: &str, mut metadata: BTreeMap<String, String>) -> BTreeMap<String, String> {
    metadata.remove(DIGEST_KEY);
    metadata.insert(DIGEST_KEY.to_owned(), digest_of(name, &metadata));
    metadata
}

/// Removes the digest from a metadata record. Returns `false` if the digest doesn't match.
///
/// Records of other writers need no digest.
pub(super) fn unseal(name: &str, metadata: &mut BTreeMap<String, String>) -> bool {
    match metadata.remove(DIGEST_KEY) {
        Some(digest) => digest == digest_of(name, metadata),
        None => name != METADATA && name != CHANNEL_LIST,
    }
}

fn digest_of(name: &str, metadata: &BTreeMap<String, String>) -> String {
    let mut hasher = Sha256::new();
    let entries = metadata.iter().flat_map(|(key, value)| [key.as_str(), value]);
    for text in [name].into_iter().chain(entries) {
        hasher.update((text.len() as u64).to_le_bytes());
        hasher.update(text);
    }
    hex(&hasher.finalize())
}

/// Formats bytes as lower-case hex without spaces.
pub(super) fn hex(bytes: &[u8]) -> String {
    let digits = |byte: &u8| [byte >> 4, byte & 0xF].map(|digit| char::from_digit(digit.into(), 16));
    bytes.iter().flat_map(digits).flatten().collect()
}

/// Names of the streams of results, in the order of [`headrace_monitor::view::DiveView::streams`].
pub(crate) const STREAMS: [&str; 6] = ["poses", "pings", "judgements", "advice", "states", "alerts"];
/// Number of u64 words in a result message before its records.
pub(crate) const HEAD_WORDS: usize = 2;

/// Returns the index of the result stream with this topic.
pub(crate) fn stream_of(topic: &str) -> Option<usize> {
    let name = topic.strip_prefix(RESULT_PREFIX)?;
    STREAMS.iter().position(|stream| *stream == name)
}

/// Decodes a message of a result stream: index of the tick, number of the first record, and words.
///
/// [`headrace_monitor::result_stream`] defines the words. All numbers are u64, little-endian.
pub(crate) fn read_results(message: &[u8]) -> Option<(u64, u64, Vec<u64>)> {
    let (words, rest) = message.as_chunks::<8>();
    let mut words = words.iter().map(|word| u64::from_le_bytes(*word));
    let (tick, first) = (words.next()?, words.next()?);
    rest.is_empty().then(|| (tick, first, words.collect()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn encode(index: u64, now: u64, order: &[u16]) -> Vec<u8> {
        let mut bytes = tick_head(index, MonoNs(now), u32::try_from(order.len()).unwrap()).to_vec();
        bytes.extend(order_bytes(order));
        bytes
    }

    #[test]
    fn tick_message_has_the_documented_layout() {
        let bytes = [1, 0, 0, 0, 0, 0, 0, 0, 2, 1, 0, 0, 0, 0, 0, 0, 3, 0, 0, 0, 5, 0, 0, 1, 5, 0];
        assert_eq!(encode(1, 258, &[5, 256, 5]), bytes);
        let tick = Tick::decode(&bytes).unwrap();
        assert_eq!((tick.index, tick.now), (1, MonoNs(258)));
        assert_eq!(tick.order().collect::<Vec<_>>(), [5, 256, 5]);
    }

    #[test]
    fn tick_with_wrong_count_is_an_error() {
        let mut bytes = encode(0, 0, &[1, 2]);
        bytes[16..20].copy_from_slice(&u32::MAX.to_le_bytes());
        assert_eq!(Tick::decode(&bytes), Err(TickError { packets: u32::MAX, len: 24 }));
        assert_eq!(Tick::decode(&bytes[..19]), Err(TickError { packets: 0, len: 19 }));
        assert!(Tick::decode(&encode(0, 0, &[7])[..21]).is_err());
    }

    #[test]
    fn changed_metadata_record_fails_its_digest() {
        let plain = BTreeMap::from([("a".to_owned(), "b".to_owned()), ("c".to_owned(), String::new())]);
        let mut sealed = seal("m", plain.clone());
        assert!(!unseal("n", &mut sealed.clone()));
        assert!(unseal("m", &mut sealed));
        assert_eq!(sealed, plain);
        let mut changed = seal("m", plain.clone());
        changed.insert("a".to_owned(), "B".to_owned());
        assert!(!unseal("m", &mut changed));
        assert!(unseal("m", &mut plain.clone()), "other writers' records have no digest");
        assert!(!unseal(METADATA, &mut plain.clone()));
    }

    proptest! {
        #[test]
        fn encoded_ticks_are_decoded(index: u64, now: u64, order: Vec<u16>) {
            let bytes = encode(index, now, &order);
            let tick = Tick::decode(&bytes).unwrap();
            prop_assert_eq!((tick.index, tick.now), (index, MonoNs(now)));
            prop_assert_eq!(tick.order().collect::<Vec<_>>(), order);
        }

        #[test]
        fn arbitrary_bytes_decode_to_a_tick_or_an_error(bytes: Vec<u8>) {
            if let Ok(tick) = Tick::decode(&bytes) {
                prop_assert_eq!(TICK_HEAD_BYTES + 2 * tick.order().len(), bytes.len());
            }
        }
    }
}
