//! Driver of one sensor that an autopilot reports on a telemetry link. It receives the sensor's messages and
//! sends heartbeats.

use headrace_sensor::codec::Framing as _;
use headrace_sensor::device::Decoder as _;
use headrace_sensor::driver::{Carrier, Cutter, DeviceHealth, Driver, IgnoredSenders, Wire};
use headrace_sensor::geometry::time::{DurNs, MonoNs};
use headrace_sensor::reading::Packet;

use mavlink::{MAVLinkV2MessageRaw, MavHeader};

use crate::decoder::{DecoderSettings, MavlinkDecoder};
use crate::frame::{Frames, MAX_FRAME_BYTES, encode, is_autopilots_heartbeat, system_of};
use mavlink::dialects::ardupilotmega::{
    HEARTBEAT_DATA, MavAutopilot, MavComponent, MavModeFlag, MavState, MavType,
};

/// Carriers over which an autopilot can be connected.
pub const CARRIERS: [Carrier; 3] = [Carrier::Udp, Carrier::Tcp, Carrier::Serial];

/// Longest usual gap between the bytes of a frame. The longest frame takes 50 ms at 57,600 baud.
const SILENCE: DurNs = DurNs::from_millis(100);
/// Period of the heartbeats. A MAVLink router sends nothing to a client without heartbeats. Source: MAVLink, heartbeat
/// protocol, once a second.
const HEARTBEAT_PERIOD: DurNs = DurNs::from_millis(1_000);
/// Component id of the host, an onboard computer of the vehicle.
const COMPONENT_ID: u8 = MavComponent::MAV_COMP_ID_ONBOARD_COMPUTER as u8;
const SYSTEM_ID: u8 = 1;

/// Driver of one sensor that an autopilot reports. The driver delivers only messages of its sensor, so that
/// each message on a shared line is recorded once.
///
/// The driver drops messages of other systems. It also drops all messages until the accepted system is known.
pub struct MavlinkDriver {
    cutter: Cutter<Frames, MAX_FRAME_BYTES>,
    /// Decides which of the received messages belong to the sensor.
    decoder: MavlinkDecoder,
    own_frames: u64,
    next_at: MonoNs,
    sequence: u8,
    /// Accepted system id: the configured one, or that of the first autopilot's heartbeat.
    system_id: Option<u8>,
    strangers: IgnoredSenders,
}

impl MavlinkDriver {
    /// Creates the driver of a sensor with these settings.
    pub fn new(meaning: DecoderSettings) -> Self {
        Self {
            cutter: Cutter::new(Frames, SILENCE),
            decoder: MavlinkDecoder::new(meaning),
            own_frames: 0,
            next_at: MonoNs(0),
            sequence: 0,
            system_id: meaning.system_id,
            strangers: IgnoredSenders::default(),
        }
    }

    fn heartbeat(&mut self) -> MAVLinkV2MessageRaw {
        self.sequence = self.sequence.wrapping_add(1);
        let system_id = u32::from(self.system_id.unwrap_or(SYSTEM_ID));
        let header = MavHeader { system_id, component_id: COMPONENT_ID, sequence: self.sequence };
        let heartbeat = HEARTBEAT_DATA {
            mavtype: MavType::MAV_TYPE_ONBOARD_CONTROLLER,
            autopilot: MavAutopilot::MAV_AUTOPILOT_INVALID,
            base_mode: MavModeFlag::empty(),
            system_status: MavState::MAV_STATE_ACTIVE,
            ..HEARTBEAT_DATA::DEFAULT
        };
        encode(header, &heartbeat)
    }
}

impl Driver for MavlinkDriver {
    fn opened(&mut self, now: MonoNs, _: &mut dyn Wire) {
        self.next_at = now;
    }

    fn closed(&mut self, wire: &mut dyn Wire) {
        self.cutter.flush(&mut |piece| wire.deliver(piece.received, piece.bytes));
    }

    fn heard(&mut self, received: MonoNs, bytes: &[u8], wire: &mut dyn Wire) {
        let Self { cutter, decoder, own_frames, system_id, strangers, .. } = self;
        cutter.push(received, bytes, &mut |piece| {
            if let Some(frame) = Frames.read(piece.bytes).filter(|_| piece.is_frame) {
                if is_autopilots_heartbeat(&frame) {
                    system_id.get_or_insert(system_of(&frame));
                }
                if *system_id != Some(system_of(&frame)) {
                    strangers.note(1, &format!("system {}", system_of(&frame)));
                    return;
                }
            }
            let before = decoder.passed_over();
            decoder.decode(Packet { received: piece.received, bytes: piece.bytes }, &mut |_| ());
            if !piece.is_frame || decoder.passed_over() == before {
                *own_frames += u64::from(piece.is_frame);
                wire.deliver(piece.received, piece.bytes);
            }
        });
    }

    fn accepts(&self, bytes: &[u8]) -> bool {
        self.cutter.accepts(bytes, |frame| {
            Frames.read(frame).is_some_and(|frame| match self.system_id {
                Some(id) => id == system_of(&frame),
                None => is_autopilots_heartbeat(&frame),
            })
        })
    }

    fn due(&self) -> Option<MonoNs> {
        Some(self.cutter.settles().map_or(self.next_at, |settles| self.next_at.min(settles)))
    }

    fn wake(&mut self, now: MonoNs, wire: &mut dyn Wire) {
        self.heard(now, &[], wire);
        if now >= self.next_at {
            self.next_at = now + HEARTBEAT_PERIOD;
            wire.send(self.heartbeat().raw_bytes());
        }
    }

    fn health(&self) -> DeviceHealth {
        let others = self.cutter.counts().good_frames > 50 && self.own_frames == 0;
        let strangers = self.strangers.clone();
        let complaint = match self.system_id {
            _ if !others => None,
            None => {
                Some("no autopilot heartbeat has arrived; set system_id to that of the autopilot".to_owned())
            }
            Some(id) if strangers.messages() == self.cutter.counts().good_frames => {
                Some(format!("no messages from system {id}; check system_id"))
            }
            Some(_) => Some(
                "the autopilot sends other messages, but not the one of this sensor; check the key message and the autopilot's stream rates"
                    .to_owned(),
            ),
        };
        let identity = self.system_id.map(|id| format!("MAVLink system {id}"));
        DeviceHealth { good_frames: self.own_frames, identity, complaint, strangers }
    }
}
