//! Frames of both versions of MAVLink.
//!
//! ```text
//!   FE length sequence system component id                     payload CRC16              first version
//!   FD length incompatible compatible sequence system component id id id payload CRC16 [signature 13]
//! ```
//! The second version leaves zeros at a payload's end unsent. A signature's truth isn't checked: who may send on the
//! vehicle's own network is the network's affair. A frame that is cut off in its signature therefore takes the bytes that
//! follow for the rest of it.
//! Source: MAVLink guide, "Packet Serialization" and "Message Signing".

use headrace_sensor::codec::{Bytes, Framed, Framing, TooLong, Verdict};

use crate::checksum::{accumulate, known};

/// The longest payload.
pub const MAX_PAYLOAD_BYTES: usize = 255;
/// The longest frame: header, payload, checksum, signature.
pub const MAX_FRAME_BYTES: usize = V2_HEADER_BYTES + MAX_PAYLOAD_BYTES + CRC_BYTES + SIGNATURE_BYTES;
/// Length of a signature.
pub const SIGNATURE_BYTES: usize = 13;

const V1_START: u8 = 0xFE;
const V2_START: u8 = 0xFD;
const V1_HEADER_BYTES: usize = 6;
const V2_HEADER_BYTES: usize = 10;
const CRC_BYTES: usize = 2;
/// The one incompatible feature that is defined. Frames with others must not be read.
const SIGNED: u8 = 1;

/// Which version a frame is of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Version {
    /// The first.
    V1,
    /// The second, with a signature or without.
    V2(Option<[u8; SIGNATURE_BYTES]>),
}

/// A frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Frame {
    /// Its version.
    pub version: Version,
    /// Counts a component's frames, modulo 256.
    pub sequence: u8,
    /// The sender's vehicle.
    pub system_id: u8,
    /// The sender within it.
    pub component_id: u8,
    /// Which message it is; up to 24 bits, 8 in the first version.
    pub message_id: u32,
    /// The message's fields, as far as they are sent.
    pub payload: Bytes<MAX_PAYLOAD_BYTES>,
}

/// What a header announces.
#[derive(Debug, Clone, Copy)]
struct Header {
    version_bytes: usize,
    payload_bytes: usize,
    signed: bool,
    sender: [u8; 3],
    message_id: u32,
}

impl Header {
    /// The header that `front` begins with. `None` where it isn't whole.
    fn of(front: &[u8]) -> Option<Self> {
        match *front {
            [V1_START, len, sequence, system, component, id, ..] => Some(Self {
                version_bytes: V1_HEADER_BYTES,
                payload_bytes: usize::from(len),
                signed: false,
                sender: [sequence, system, component],
                message_id: u32::from(id),
            }),
            [V2_START, len, incompatible, _, sequence, system, component, i0, i1, i2, ..] => Some(Self {
                version_bytes: V2_HEADER_BYTES,
                payload_bytes: usize::from(len),
                signed: incompatible & SIGNED != 0,
                sender: [sequence, system, component],
                message_id: u32::from_le_bytes([i0, i1, i2, 0]),
            }),
            _ => None,
        }
    }

    /// Where the payload ends.
    fn summed_bytes(&self) -> usize {
        self.version_bytes + self.payload_bytes
    }

    fn whole_bytes(&self) -> usize {
        self.summed_bytes() + CRC_BYTES + if self.signed { SIGNATURE_BYTES } else { 0 }
    }
}

impl Frame {
    /// The frame as bytes. Zeros at the end of a payload are sent or not as they are held.
    ///
    /// Errors: never for what [`Frames`] has read; a message that isn't in the list has no checksum, and its frame none
    /// that another side would take.
    pub fn encode(&self) -> Result<Bytes<MAX_FRAME_BYTES>, TooLong> {
        let payload = self.payload.as_slice();
        let len = u8::try_from(payload.len())
            .map_err(|_| TooLong { len: payload.len(), max: MAX_PAYLOAD_BYTES })?;
        let [i0, i1, i2, _] = self.message_id.to_le_bytes();
        let sender = [self.sequence, self.system_id, self.component_id];
        let mut bytes = Bytes::default();
        let signature = match self.version {
            Version::V1 => {
                bytes.extend(&[V1_START, len])?;
                bytes.extend(&sender)?;
                bytes.extend(&[i0])?;
                None
            }
            Version::V2(signature) => {
                bytes.extend(&[V2_START, len, if signature.is_some() { SIGNED } else { 0 }, 0])?;
                bytes.extend(&sender)?;
                bytes.extend(&[i0, i1, i2])?;
                signature
            }
        };
        bytes.extend(payload)?;
        let crc = checksum(bytes.as_slice(), self.message_id).unwrap_or_default();
        bytes.extend(&crc.to_le_bytes())?;
        bytes.extend(signature.as_ref().map_or(&[], |signature| signature.as_slice()))?;
        Ok(bytes)
    }

    /// Reads a whole frame that was found good.
    fn decode(frame: &[u8]) -> Option<Self> {
        let header = Header::of(frame)?;
        let [sequence, system_id, component_id] = header.sender;
        let version = match (header.version_bytes, header.signed) {
            (V1_HEADER_BYTES, _) => Version::V1,
            (_, false) => Version::V2(None),
            (_, true) => Version::V2(Some(*frame.last_chunk()?)),
        };
        let payload = Bytes::new(frame.get(header.version_bytes..header.summed_bytes())?).ok()?;
        Some(Self { version, sequence, system_id, component_id, message_id: header.message_id, payload })
    }
}

/// Length of the frame that `front` begins with, as its header announces it; `None` where there is no whole header.
pub(crate) fn announced_bytes(front: &[u8]) -> Option<usize> {
    Header::of(front).map(|header| header.whole_bytes())
}

/// The checksum of what is before it, the start marker included in `bytes` but not in the sum.
fn checksum(bytes: &[u8], message_id: u32) -> Option<u16> {
    let extra = known(message_id)?.extra;
    Some(accumulate(accumulate(0xFFFF, bytes.get(1..)?), &[extra]))
}

/// How frames stand in a stream of bytes.
///
/// A frame whose message isn't in the list, and one with an incompatible feature that isn't known, are no start: they
/// can't be told from noise, and their bytes are skipped.
#[derive(Debug, Clone, Copy, Default)]
pub struct Frames;

/// Frames out of a stream of bytes.
pub type MavlinkCodec = Framed<Frames, MAX_FRAME_BYTES>;

impl Framing for Frames {
    type Value = Frame;

    fn judge(&self, front: &[u8]) -> Verdict {
        match front {
            [V2_START, _, incompatible, ..] if incompatible & !SIGNED != 0 => return Verdict::NotAStart,
            [V1_START | V2_START, ..] => (),
            _ => return Verdict::NotAStart,
        }
        let Some(header) = Header::of(front) else {
            let v1 = front.first() == Some(&V1_START);
            return Verdict::Need(if v1 { V1_HEADER_BYTES } else { V2_HEADER_BYTES });
        };
        let Some(known) = known(header.message_id) else { return Verdict::NotAStart };
        if header.version_bytes == V1_HEADER_BYTES && header.payload_bytes != usize::from(known.base_bytes) {
            return Verdict::NotAStart;
        }
        Verdict::on(front, header.whole_bytes(), |frame| {
            let sum =
                frame.get(..header.summed_bytes()).and_then(|summed| checksum(summed, header.message_id));
            let sent = frame.get(header.summed_bytes()..).and_then(<[u8]>::first_chunk);
            sum.is_some() && sum == sent.map(|sent| u16::from_le_bytes(*sent))
        })
    }

    fn read(&self, frame: &[u8]) -> Option<Frame> {
        Frame::decode(frame)
    }
}

/// Messages that tell a place on Earth, a machine's own number, or what people wrote; none of them is read here: GPS_RAW_INT,
/// GPS_STATUS, GLOBAL_POSITION_INT, SET_GPS_GLOBAL_ORIGIN, GPS_GLOBAL_ORIGIN, GLOBAL_POSITION_INT_COV, MISSION_ITEM_INT,
/// POSITION_TARGET_GLOBAL_INT, HIL_GPS, GPS2_RAW, TERRAIN_REPORT, AUTOPILOT_VERSION, GPS_INPUT, HOME_POSITION, STATUSTEXT,
/// OPEN_DRONE_ID_BASIC_ID. Source: MAVLink common message set.
const IDENTITY: [u32; 16] = [24, 25, 33, 48, 49, 63, 73, 87, 113, 124, 136, 148, 232, 242, 253, 12900];

/// The frames of a packet that holds whole ones alone, without those of [`IDENTITY`]; `None` where it holds something else, or
/// none of them.
pub(crate) fn without_identity(packet: &[u8], shorter: &mut Vec<u8>) -> Option<()> {
    let mut rest = packet;
    while !rest.is_empty() {
        let header = Header::of(rest)?;
        let (frame, after) = rest.split_at_checked(header.whole_bytes())?;
        if !IDENTITY.contains(&header.message_id) {
            shorter.extend_from_slice(frame);
        }
        rest = after;
    }
    (shorter.len() < packet.len()).then_some(())
}

#[cfg(test)]
mod tests {
    use headrace_sensor::codec::contract::decode_all;
    use headrace_sensor::codec::{Codec as _, CodecCounts};
    use proptest::prelude::*;

    use super::*;
    use crate::tests::{RECORDED_ATTITUDE, RECORDED_PRESSURE};

    fn encoded(frame: &Frame) -> Vec<u8> {
        frame.encode().unwrap().as_slice().to_vec()
    }

    /// RAW_IMU of the first version, all fields zero but the first.
    fn first_version() -> Frame {
        let mut payload = [0; 26];
        payload[0] = 0xFD;
        Frame {
            version: Version::V1,
            sequence: 7,
            system_id: 1,
            component_id: 1,
            message_id: 27,
            payload: Bytes::new(&payload).unwrap(),
        }
    }

    #[test]
    fn a_recorded_frame_is_read_and_written() {
        let got = decode_all(&mut MavlinkCodec::default(), RECORDED_PRESSURE);
        let frame = got[0];
        assert_eq!((frame.version, frame.message_id), (Version::V2(None), 137));
        assert_eq!((frame.system_id, frame.component_id, frame.payload.as_slice().len()), (1, 1, 14));
        assert_eq!(encoded(&frame), RECORDED_PRESSURE);
    }

    #[test]
    fn a_wrong_bit_anywhere_is_no_frame() {
        for at in 0..RECORDED_ATTITUDE.len() * 8 {
            let mut bytes = RECORDED_ATTITUDE.to_vec();
            bytes[at / 8] ^= 1 << (at % 8);
            assert_eq!(decode_all(&mut MavlinkCodec::default(), &bytes), [], "bit {at}");
        }
    }

    #[test]
    fn a_signed_frame_is_taken_whole() {
        let mut frame = decode_all(&mut MavlinkCodec::default(), RECORDED_ATTITUDE)[0];
        frame.version = Version::V2(Some([0xFE; SIGNATURE_BYTES]));
        let bytes = encoded(&frame);
        assert_eq!(bytes.len(), RECORDED_ATTITUDE.len() + SIGNATURE_BYTES);
        let mut codec = MavlinkCodec::default();
        assert_eq!(decode_all(&mut codec, &[&bytes, RECORDED_PRESSURE].concat()).len(), 2);
        assert_eq!(codec.counts(), CodecCounts { good_frames: 2, ..CodecCounts::default() });
    }

    #[test]
    fn what_cannot_be_checked_is_skipped_and_hides_nothing() {
        let mut unknown = RECORDED_ATTITUDE.to_vec();
        unknown[7] = 0xFF;
        unknown[8] = 0xFF;
        let mut incompatible = RECORDED_ATTITUDE.to_vec();
        incompatible[2] = 2;
        for bytes in [unknown, incompatible] {
            let mut codec = MavlinkCodec::default();
            assert_eq!(decode_all(&mut codec, &[&bytes, RECORDED_PRESSURE].concat()).len(), 1);
            let counts = codec.counts();
            assert_eq!((counts.good_frames, counts.bad_frames), (1, 0));
            assert_eq!(counts.skipped_bytes, bytes.len() as u64);
        }
    }

    #[test]
    fn a_frame_of_the_first_version_has_its_one_length() {
        let mut frame = first_version();
        assert_eq!(decode_all(&mut MavlinkCodec::default(), &encoded(&frame)), [frame]);
        frame.payload = Bytes::new(&[1; 25]).unwrap();
        assert_eq!(decode_all(&mut MavlinkCodec::default(), &encoded(&frame)), []);
    }

    /// Without signatures: nothing tells a signature that was cut off from the frame that follows.
    fn any_frame() -> impl Strategy<Value = Frame> {
        let ids = proptest::sample::select(vec![0_u32, 26, 27, 29, 30, 116, 132, 137, 143, 253, 11_032]);
        let payload = proptest::collection::vec(any::<u8>(), 255);
        (any::<[u8; 3]>(), ids, any::<bool>(), 1..=MAX_PAYLOAD_BYTES, payload).prop_map(
            |([sequence, system_id, component_id], message_id, first, len, payload)| {
                let base_bytes = known(message_id).unwrap().base_bytes;
                let first = first && message_id < 256;
                let len = if first { usize::from(base_bytes) } else { len };
                Frame {
                    version: if first { Version::V1 } else { Version::V2(None) },
                    sequence,
                    system_id,
                    component_id,
                    message_id,
                    payload: Bytes::new(&payload[..len]).unwrap(),
                }
            },
        )
    }

    headrace_sensor::codec_contract!(
        contract,
        codec: MavlinkCodec::default(),
        values: any_frame(),
        encode: encoded,
        frames: [RECORDED_ATTITUDE.to_vec(), RECORDED_PRESSURE.to_vec(), encoded(&first_version())],
    );
}
