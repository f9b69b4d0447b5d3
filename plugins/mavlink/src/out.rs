//! The program's own MAVLink messages: heartbeats, values and texts. The program sends them as an onboard computer
//! beside the autopilot.
//!
//! DISTANCE_SENSOR and OBSTACLE_DISTANCE are never sent. Ground stations attribute these messages to the autopilot, and
//! an autopilot tries to avoid the obstacles in them.

use mavlink::MavHeader;
use mavlink::types::CharArray;

use crate::frame::encode;
use mavlink::dialects::ardupilotmega::{
    HEARTBEAT_DATA, MavAutopilot, MavModeFlag, MavSeverity, MavState, MavType, NAMED_VALUE_FLOAT_DATA,
    STATUSTEXT_DATA,
};

/// Component id of an onboard computer. Source: MAVLink, MAV_COMP_ID_ONBOARD_COMPUTER.
pub const COMPONENT_ID: u8 = 191;
/// Maximum length of the text in a STATUSTEXT. Longer texts are sent in parts. Source: MAVLink, STATUSTEXT.
pub const TEXT_BYTES: usize = 50;
/// Maximum length of a value's name. Source: MAVLink, NAMED_VALUE_FLOAT.
pub const NAME_BYTES: usize = 10;
/// Names of values that QGroundControl attributes to the autopilot, whoever sends them. Source: QGroundControl's
/// ArduSub plugin, August 2026.
pub const RESERVED: [&str; 8] =
    ["TetherTrn", "RFTarget", "CamTilt", "Lights1", "Lights2", "PilotGain", "InputHold", "RollPitch"];

/// Severity of a text sent to ground stations.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Gravity {
    /// The pilot must act immediately.
    Emergency,
    /// The pilot must act.
    Alarm,
    /// The pilot must be careful.
    Warning,
    /// For the pilot's information.
    Caution,
}

impl From<Gravity> for MavSeverity {
    fn from(gravity: Gravity) -> Self {
        match gravity {
            Gravity::Emergency => Self::MAV_SEVERITY_ALERT,
            Gravity::Alarm => Self::MAV_SEVERITY_CRITICAL,
            Gravity::Warning => Self::MAV_SEVERITY_WARNING,
            Gravity::Caution => Self::MAV_SEVERITY_NOTICE,
        }
    }
}

/// Encodes the program's MAVLink messages in the order in which they are sent.
#[derive(Debug)]
pub struct Speaker {
    system_id: u8,
    sequence: u8,
    /// Number of the latest text that was sent in parts.
    text: u16,
}

impl Speaker {
    /// Creates an encoder for a component of the system with this id.
    pub fn new(system_id: u8) -> Self {
        Self { system_id, sequence: 0, text: 0 }
    }

    /// Encodes a heartbeat.
    pub fn heartbeat(&mut self, is_active: bool) -> Vec<u8> {
        let header = self.header();
        let system_status = if is_active { MavState::MAV_STATE_ACTIVE } else { MavState::MAV_STATE_STANDBY };
        let heartbeat = HEARTBEAT_DATA {
            mavtype: MavType::MAV_TYPE_ONBOARD_CONTROLLER,
            autopilot: MavAutopilot::MAV_AUTOPILOT_INVALID,
            base_mode: MavModeFlag::empty(),
            system_status,
            ..HEARTBEAT_DATA::DEFAULT
        };
        encode(header, &heartbeat).raw_bytes().to_vec()
    }

    /// Encodes a named value; NaN means unknown. `None` if the name is too long, not ASCII, or [`RESERVED`].
    pub fn figure(&mut self, name: &str, time_ms: u32, value: f32) -> Option<Vec<u8>> {
        if name.len() > NAME_BYTES || !name.is_ascii() || RESERVED.contains(&name) {
            return None;
        }
        let header = self.header();
        let figure = NAMED_VALUE_FLOAT_DATA { time_boot_ms: time_ms, value, name: CharArray::from(name) };
        Some(encode(header, &figure).raw_bytes().to_vec())
    }

    /// Encodes a text in as many parts as needed. Ground stations decode each part separately, so the text is
    /// converted to ASCII.
    pub fn text(&mut self, gravity: Gravity, text: &str) -> Vec<Vec<u8>> {
        let text = ascii(text);
        let is_whole = text.len() <= TEXT_BYTES;
        let id = if is_whole { 0 } else { self.next_text() };
        // A part of full length can't mark the end of the text. If the last part is full, an empty part follows.
        let parts = if is_whole { 1 } else { text.len() / TEXT_BYTES + 1 };
        let part = |part: usize| {
            let from = part * TEXT_BYTES;
            text.get(from..(from + TEXT_BYTES).min(text.len())).unwrap_or_default()
        };
        let mut frames = Vec::new();
        for (number, part) in (0..parts).map(part).enumerate() {
            let header = self.header();
            let said = STATUSTEXT_DATA {
                severity: gravity.into(),
                text: CharArray::from(part),
                id,
                // Parts have 50 bytes, so no text of this program needs 255 parts.
                chunk_seq: u8::try_from(number).unwrap_or(u8::MAX),
            };
            frames.push(encode(header, &said).raw_bytes().to_vec());
        }
        frames
    }

    fn header(&mut self) -> MavHeader {
        let sequence = self.sequence;
        self.sequence = sequence.wrapping_add(1);
        MavHeader { system_id: u32::from(self.system_id), component_id: COMPONENT_ID, sequence }
    }

    /// Number of the next text that is sent in parts. Zero is reserved for texts of one part.
    fn next_text(&mut self) -> u16 {
        self.text = self.text.checked_add(1).unwrap_or(1);
        self.text
    }
}

/// Converts a text to ASCII.
fn ascii(text: &str) -> String {
    let mut plain = String::with_capacity(text.len());
    for letter in text.chars() {
        match letter {
            ' '..='~' => plain.push(letter),
            '±' => plain.push_str("+-"),
            '→' => plain.push_str("->"),
            _ => plain.push('?'),
        }
    }
    plain
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Header and payload as in the guide's "Packet Serialization", with the zeros that the sender truncated.
    fn parts(frame: &[u8]) -> ([u8; 3], u32, Vec<u8>) {
        assert_eq!((frame[0], frame[2]), (0xfd, 0));
        let length = usize::from(frame[1]);
        assert_eq!(frame.len(), 10 + length + 2);
        let mut payload = frame[10..10 + length].to_vec();
        payload.resize(60, 0);
        ([frame[4], frame[5], frame[6]], u32::from_le_bytes([frame[7], frame[8], frame[9], 0]), payload)
    }

    fn joined(frames: &[Vec<u8>]) -> (Vec<u16>, Vec<u8>, String) {
        let (mut ids, mut chunks, mut text) = (Vec::new(), Vec::new(), String::new());
        for frame in frames {
            let (_, id, payload) = parts(frame);
            assert_eq!(id, 253);
            let bytes = &payload[1..51];
            let end = bytes.iter().position(|byte| *byte == 0).unwrap_or(50);
            text.push_str(core::str::from_utf8(&bytes[..end]).unwrap());
            ids.push(u16::from_le_bytes([payload[51], payload[52]]));
            chunks.push(payload[53]);
        }
        (ids, chunks, text)
    }

    #[test]
    fn heartbeat_is_that_of_an_onboard_computer() {
        let mut speaker = Speaker::new(7);
        let (header, id, payload) = parts(&speaker.heartbeat(true));
        assert_eq!((header, id), ([0, 7, 191], 0));
        // Fields: custom mode, type, autopilot, base mode, state, version.
        assert_eq!(&payload[..9], [0, 0, 0, 0, 18, 8, 0, 4, 3]);
        assert_eq!(parts(&speaker.heartbeat(false)).0, [1, 7, 191]);
    }

    #[test]
    fn named_value_message_refuses_reserved_names() {
        let mut speaker = Speaker::new(1);
        let (_, id, payload) = parts(&speaker.figure("HR_VMAX", 1234, 0.25).unwrap());
        assert_eq!(id, 251);
        assert_eq!(payload[..4], 1234_u32.to_le_bytes());
        assert_eq!(payload[4..8], 0.25_f32.to_le_bytes());
        assert_eq!(&payload[8..18], b"HR_VMAX\0\0\0");
        for name in RESERVED.into_iter().chain(["ELEVEN_LONG", "\u{b1}"]) {
            assert_eq!(speaker.figure(name, 0, 0.0), None, "{name}");
        }
    }

    #[test]
    fn texts_of_any_length_round_trip() {
        let mut speaker = Speaker::new(1);
        for length in 0..=260 {
            let text: String = ('a'..='z').cycle().take(length).collect();
            let frames = speaker.text(Gravity::Alarm, &text);
            let (ids, chunks, said) = joined(&frames);
            assert_eq!(said, text);
            assert!(chunks.iter().enumerate().all(|(number, chunk)| usize::from(*chunk) == number));
            assert!(ids.iter().all(|id| *id == ids[0] && (*id == 0) == (length <= 50)), "{ids:?}");
            // The text of the last part ends with a zero.
            let (_, _, last) = parts(frames.last().unwrap());
            assert!(length <= 50 || last[1..51].contains(&0));
        }
        assert_eq!(joined(&speaker.text(Gravity::Caution, "±0.2 m → go\n")).2, "+-0.2 m -> go?");
        let (_, _, payload) = parts(&speaker.text(Gravity::Warning, "x")[0]);
        assert_eq!(payload[0], 4);
    }
}
