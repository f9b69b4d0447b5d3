//! Frames of both MAVLink versions.
//!
//! ```text
//!   FE length sequence system component id                     payload CRC16              first version
//!   FD length incompatible compatible sequence system component id id id payload CRC16 [signature 13]
//! ```
//! Definitions, checksum and packing come from the mavlink crate. Its reader isn't used for three reasons. The reader
//! doesn't report the start of a frame, which is needed for the receive time. It has no counters, and it accepts
//! version 1 frames of any length. Version 2 truncates trailing zeros of a payload. Signatures aren't verified, because
//! access to the vehicle's own network is controlled elsewhere. If a frame is cut off in its signature, the bytes that
//! follow are therefore taken as the rest of the signature. Source: MAVLink guide, "Packet Serialization" and "Message
//! Signing".

use headrace_sensor::codec::{Bytes, Framed, Framing, Verdict};
use mavlink::consts::{CHECKSUM_SIZE, MAX_PAYLOAD_LEN, STX_SIZE, v1, v2};
use mavlink::{
    MAV_STX, MAV_STX_V2, MAVLinkV2MessageRaw, MavHeader, MavlinkVersion, Message as _, MessageData,
    calculate_crc,
};

use mavlink::dialects::ardupilotmega::{self as dialect, MavMessage};

/// Maximum frame length: header, payload, checksum, signature.
pub const MAX_FRAME_BYTES: usize = V2_HEADER_BYTES + MAX_PAYLOAD_LEN + CHECKSUM_SIZE + v2::SIGNATURE_SIZE;

const V1_HEADER_BYTES: usize = STX_SIZE + v1::HEADER_SIZE;
const V2_HEADER_BYTES: usize = STX_SIZE + v2::MIN_HEADER_SIZE;

/// A MAVLink frame with a correct checksum.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Frame {
    /// MAVLink version of the frame.
    pub version: MavlinkVersion,
    /// Sender and sequence number of the frame.
    pub header: MavHeader,
    /// Message id: up to 24 bits, or 8 bits in version 1.
    pub message_id: u32,
    /// Message fields, without truncated zeros.
    pub payload: Bytes<MAX_PAYLOAD_LEN>,
}

/// Fields of a frame header.
#[derive(Debug, Clone, Copy)]
struct Header {
    version: MavlinkVersion,
    payload_bytes: usize,
    signed: bool,
    sender: MavHeader,
    message_id: u32,
}

impl Header {
    /// Decodes the header at the front of `front`; `None` if the header is incomplete.
    fn of(front: &[u8]) -> Option<Self> {
        let (version, payload_bytes, signed, [sequence, system_id, component_id], message_id) = match *front {
            [MAV_STX, len, n, system, component, id, ..] => {
                (MavlinkVersion::V1, len, false, [n, system, component], u32::from(id))
            }
            [MAV_STX_V2, len, incompatible, _, n, system, component, i0, i1, i2, ..] => {
                let signed = incompatible & v2::IFLAG_SIGNED != 0;
                let id = u32::from_le_bytes([i0, i1, i2, 0]);
                (MavlinkVersion::V2, len, signed, [n, system, component], id)
            }
            _ => return None,
        };
        let sender = MavHeader { system_id: u32::from(system_id), component_id, sequence };
        Some(Self { version, payload_bytes: usize::from(payload_bytes), signed, sender, message_id })
    }

    /// Start of the payload in the frame.
    fn header_bytes(&self) -> usize {
        match self.version {
            MavlinkVersion::V1 => V1_HEADER_BYTES,
            MavlinkVersion::V2 => V2_HEADER_BYTES,
        }
    }

    /// End of the payload in the frame.
    fn summed_bytes(&self) -> usize {
        self.header_bytes() + self.payload_bytes
    }

    fn whole_bytes(&self) -> usize {
        self.summed_bytes() + CHECKSUM_SIZE + if self.signed { v2::SIGNATURE_SIZE } else { 0 }
    }

    /// Whether the checksum of the frame's message can be checked. In version 1 the payload must also have exactly the
    /// length of the message.
    fn is_known(&self) -> bool {
        match self.version {
            MavlinkVersion::V1 => v1_payload_bytes(self.message_id) == Some(self.payload_bytes),
            MavlinkVersion::V2 => MavMessage::all_ids().binary_search(&self.message_id).is_ok(),
        }
    }
}

/// Payload length of a message in version 1, which has all fields except extensions.
fn v1_payload_bytes(message_id: u32) -> Option<usize> {
    let message = MavMessage::default_message_from_id(message_id)?;
    Some(message.ser(MavlinkVersion::V1, &mut [0; MAX_PAYLOAD_LEN]))
}

/// Encodes a message as a version 2 frame.
pub fn encode(header: MavHeader, message: &impl MessageData) -> MAVLinkV2MessageRaw {
    let mut frame = MAVLinkV2MessageRaw::new();
    frame.serialize_message_data(header, message);
    frame
}

/// The sender's system id, a byte on the wire.
pub(crate) fn system_of(frame: &Frame) -> u8 {
    u8::try_from(frame.header.system_id).unwrap_or(u8::MAX)
}

/// Whether a frame is the heartbeat of an autopilot, and not of a ground station, a router or another onboard computer.
/// Source: MAVLink, HEARTBEAT (custom mode of four bytes, then type and autopilot).
pub(crate) fn is_autopilots_heartbeat(frame: &Frame) -> bool {
    let [kind, autopilot] = match *frame.payload.as_slice() {
        [_, _, _, _, kind, autopilot, ..] if frame.message_id == dialect::HEARTBEAT_DATA::ID => {
            [kind, autopilot]
        }
        _ => return false,
    };
    kind != dialect::MavType::MAV_TYPE_GCS as u8
        && autopilot != dialect::MavAutopilot::MAV_AUTOPILOT_INVALID as u8
}

/// Length that the header at the front of `front` states for its frame; `None` if the header is incomplete.
pub(crate) fn announced_bytes(front: &[u8]) -> Option<usize> {
    Header::of(front).map(|header| header.whole_bytes())
}

/// Separates frames in a byte stream.
///
/// A frame with an unknown message, or with an incompatibility flag other than signing, can't be distinguished from
/// noise. Its bytes are skipped.
#[derive(Debug, Clone, Copy, Default)]
pub struct Frames;

/// Decodes frames from a byte stream.
pub type MavlinkCodec = Framed<Frames, MAX_FRAME_BYTES>;

impl Framing for Frames {
    type Value = Frame;

    fn judge(&self, front: &[u8]) -> Verdict {
        match front {
            [MAV_STX_V2, _, incompatible, ..] if incompatible & !v2::IFLAG_SIGNED != 0 => {
                return Verdict::NotAStart;
            }
            [MAV_STX | MAV_STX_V2, ..] => (),
            _ => return Verdict::NotAStart,
        }
        let Some(header) = Header::of(front) else {
            let v1 = front.first() == Some(&MAV_STX);
            return Verdict::Need(if v1 { V1_HEADER_BYTES } else { V2_HEADER_BYTES });
        };
        if !header.is_known() {
            return Verdict::NotAStart;
        }
        Verdict::on(front, header.whole_bytes(), |frame| {
            let summed = frame.get(STX_SIZE..header.summed_bytes()).unwrap_or_default();
            let sum = calculate_crc(summed, MavMessage::extra_crc(header.message_id));
            frame.get(header.summed_bytes()..).and_then(<[u8]>::first_chunk) == Some(&sum.to_le_bytes())
        })
    }

    fn read(&self, frame: &[u8]) -> Option<Frame> {
        let header = Header::of(frame)?;
        let payload = Bytes::new(frame.get(header.header_bytes()..header.summed_bytes())?).ok()?;
        let Header { version, sender, message_id, .. } = header;
        Some(Frame { version, header: sender, message_id, payload })
    }
}

/// Messages with geographic position, hardware identity or free text. This crate decodes none of them.
#[expect(deprecated, reason = "older autopilots send superseded messages")]
const IDENTITY: [u32; 16] = [
    dialect::GPS_RAW_INT_DATA::ID,
    dialect::GPS_STATUS_DATA::ID,
    dialect::GLOBAL_POSITION_INT_DATA::ID,
    dialect::SET_GPS_GLOBAL_ORIGIN_DATA::ID,
    dialect::GPS_GLOBAL_ORIGIN_DATA::ID,
    dialect::GLOBAL_POSITION_INT_COV_DATA::ID,
    dialect::MISSION_ITEM_INT_DATA::ID,
    dialect::POSITION_TARGET_GLOBAL_INT_DATA::ID,
    dialect::HIL_GPS_DATA::ID,
    dialect::GPS2_RAW_DATA::ID,
    dialect::TERRAIN_REPORT_DATA::ID,
    dialect::AUTOPILOT_VERSION_DATA::ID,
    dialect::GPS_INPUT_DATA::ID,
    dialect::HOME_POSITION_DATA::ID,
    dialect::STATUSTEXT_DATA::ID,
    dialect::OPEN_DRONE_ID_BASIC_ID_DATA::ID,
];

/// Copies a packet of whole frames to `shorter`, without the messages in [`IDENTITY`].
///
/// `None` if the packet has none of these messages, or has anything except whole frames.
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
        let MavHeader { system_id, component_id, sequence } = frame.header;
        let sender = [sequence, u8::try_from(system_id).unwrap(), component_id];
        let payload = frame.payload.as_slice();
        let len = u8::try_from(payload.len()).unwrap();
        let id = frame.message_id.to_le_bytes();
        let mut bytes = match frame.version {
            MavlinkVersion::V1 => [&[MAV_STX, len][..], &sender, &id[..1], payload].concat(),
            MavlinkVersion::V2 => [&[MAV_STX_V2, len, 0, 0][..], &sender, &id[..3], payload].concat(),
        };
        let sum = calculate_crc(&bytes[STX_SIZE..], MavMessage::extra_crc(frame.message_id));
        bytes.extend(sum.to_le_bytes());
        bytes
    }

    /// Adds the signing flag and a signature of these bytes to a frame.
    fn signed(frame: &[u8], signature: [u8; v2::SIGNATURE_SIZE]) -> Vec<u8> {
        let message = Frames.read(frame).unwrap().message_id;
        let (front, _) = frame.split_at(frame.len() - CHECKSUM_SIZE);
        let mut bytes = front.to_vec();
        bytes[v2::INCOMPAT_FLAGS_OFFSET] = v2::IFLAG_SIGNED;
        let sum = calculate_crc(&bytes[STX_SIZE..], MavMessage::extra_crc(message));
        [&bytes[..], &sum.to_le_bytes(), &signature].concat()
    }

    /// RAW_IMU in version 1. All fields are zero except the first.
    fn first_version() -> Frame {
        let mut payload = [0; 26];
        payload[0] = 0xFD;
        Frame {
            version: MavlinkVersion::V1,
            header: MavHeader { system_id: 1, component_id: 1, sequence: 7 },
            message_id: 27,
            payload: Bytes::new(&payload).unwrap(),
        }
    }

    #[test]
    fn every_message_has_its_definition_and_v1_length() {
        assert!(MavMessage::all_ids().is_sorted());
        for id in MavMessage::all_ids() {
            assert!(v1_payload_bytes(*id).is_some(), "{id}");
        }
        for (id, extra, base_bytes) in [
            (26, 170, 22),
            (27, 144, 26),
            (29, 115, 14),
            (30, 39, 28),
            (116, 76, 22),
            (129, 46, 22),
            (132, 85, 14),
            (137, 195, 14),
            (143, 131, 14),
        ] {
            assert_eq!((MavMessage::extra_crc(id), v1_payload_bytes(id)), (extra, Some(base_bytes)), "{id}");
        }
        assert_eq!(v1_payload_bytes(60_000), None);
    }

    #[test]
    fn recorded_frame_round_trips() {
        let got = decode_all(&mut MavlinkCodec::default(), RECORDED_PRESSURE);
        let frame = got[0];
        assert_eq!((frame.version, frame.message_id), (MavlinkVersion::V2, 137));
        let MavHeader { system_id, component_id, .. } = frame.header;
        assert_eq!((system_id, component_id, frame.payload.as_slice().len()), (1, 1, 14));
        assert_eq!(encoded(&frame), RECORDED_PRESSURE);
    }

    #[test]
    fn frame_with_a_wrong_bit_is_refused() {
        for at in 0..RECORDED_ATTITUDE.len() * 8 {
            let mut bytes = RECORDED_ATTITUDE.to_vec();
            bytes[at / 8] ^= 1 << (at % 8);
            assert_eq!(decode_all(&mut MavlinkCodec::default(), &bytes), [], "bit {at}");
        }
    }

    #[test]
    fn signed_frame_is_read_with_its_signature() {
        let bytes = signed(RECORDED_ATTITUDE, [0xFE; v2::SIGNATURE_SIZE]);
        assert_eq!(bytes.len(), RECORDED_ATTITUDE.len() + v2::SIGNATURE_SIZE);
        let mut codec = MavlinkCodec::default();
        assert_eq!(decode_all(&mut codec, &[&bytes, RECORDED_PRESSURE].concat()).len(), 2);
        assert_eq!(codec.counts(), CodecCounts { good_frames: 2, ..CodecCounts::default() });
    }

    #[test]
    fn unverifiable_frame_is_skipped_and_the_following_frames_are_read() {
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
    fn v1_frame_needs_its_exact_length() {
        let mut frame = first_version();
        assert_eq!(decode_all(&mut MavlinkCodec::default(), &encoded(&frame)), [frame]);
        frame.payload = Bytes::new(&[1; 25]).unwrap();
        assert_eq!(decode_all(&mut MavlinkCodec::default(), &encoded(&frame)), []);
    }

    /// The frames have no signatures, because a truncated signature can't be distinguished from the following frame.
    fn any_frame() -> impl Strategy<Value = Frame> {
        let ids = proptest::sample::select(vec![0_u32, 26, 27, 29, 30, 116, 132, 137, 143, 253, 11_032]);
        let payload = proptest::collection::vec(any::<u8>(), 255);
        (any::<[u8; 3]>(), ids, any::<bool>(), 1..=MAX_PAYLOAD_LEN, payload).prop_map(
            |([sequence, system_id, component_id], message_id, first, len, payload): (
                [u8; 3],
                _,
                _,
                _,
                _,
            )| {
                let first = first && message_id < 256;
                let len = if first { v1_payload_bytes(message_id).unwrap() } else { len };
                Frame {
                    version: if first { MavlinkVersion::V1 } else { MavlinkVersion::V2 },
                    header: MavHeader { system_id: u32::from(system_id), component_id, sequence },
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
