//! An emulated Ping echosounder, polled by an emulated or real host.

use std::collections::VecDeque;

use headrace_sensor::codec::{Bytes, Codec as _};
use headrace_sensor::device::{Direction, Emulator, EmulatorSetup, LineSink};
use headrace_sensor::geometry::math;
use headrace_sensor::geometry::time::{DurNs, MonoNs};
use headrace_sensor::measurement::Sounding;

use crate::codec::{
    Addressed, DeviceInformation, Distance, DistanceSimple, MAX_FRAME_BYTES, MAX_STRENGTHS, Message,
    PingCodec, Profile, ProtocolVersion, ScanRange, Text, id,
};
use crate::settings::Settings;

/// Listening range of an emulated device, up to the practical limit of a `Ping1D`.
const SCAN: ScanRange = ScanRange { start_mm: 0, length_mm: 30_000 };

/// Longest usual gap between the bytes of a frame.
const SILENCE: DurNs = DurNs::from_millis(50);

/// Broadcast device id.
const EVERYONE: u8 = 255;

/// Identity of an emulated device.
const DEVICE: DeviceInformation = DeviceInformation {
    device_type: 1,
    revision: 1,
    firmware_major: 3,
    firmware_minor: 29,
    firmware_patch: 0,
    reserved: 0,
};
const PROTOCOL: ProtocolVersion = ProtocolVersion { major: 1, minor: 0, patch: 0, reserved: 0 };

/// Pulse length of an emulated ping, us.
const PULSE_US: u16 = 60;

/// Number of points of an emulated echo, and strength of the point at the wall.
const POINTS: usize = 200;
const ECHO: u8 = 255;

/// An emulated device, with an emulated host if no real host polls.
#[derive(Debug, Clone)]
pub struct PingEmulator {
    settings: Settings,
    latency: DurNs,
    /// Speed of sound in the water, m/s.
    site_mps: f64,
    /// Speed of sound setting of the device, mm/s; a host can change it.
    device_mmps: u32,
    interval: DurNs,
    codec: PingCodec,
    heard_at: MonoNs,
    pings: u32,
    /// Time of the next ping, if no real host requests it. The emulated host requests it, or the device pings
    /// continuously.
    ping_at: Option<MonoNs>,
    /// Pings that a real host has requested and that the device hasn't started yet.
    waiting: Vec<Sounding>,
    /// Message ids of the answers to the pings that a real host has requested.
    asked: VecDeque<u16>,
    polled: bool,
    /// Buffer for the frame that device or host sends.
    frame: Bytes<MAX_FRAME_BYTES>,
}

impl PingEmulator {
    /// Creates a device. The emulated host polls it from power-on, or a real host requests pings.
    pub fn new(settings: Settings, latency: DurNs, setup: &EmulatorSetup) -> Self {
        Self {
            settings,
            latency,
            site_mps: setup.site.sound_speed_mps,
            device_mmps: settings.sound_speed_mmps(),
            interval: settings.interval,
            codec: PingCodec::default(),
            heard_at: setup.start,
            pings: 0,
            ping_at: setup.polled.then_some(setup.start),
            waiting: Vec::new(),
            asked: VecDeque::new(),
            polled: setup.polled,
            frame: Bytes::default(),
        }
    }

    /// Handles a message. Returns the answer if the device answers immediately, and `None` for a distance request.
    fn answer_to(&mut self, at: MonoNs, message: &Message) -> Option<Message> {
        match *message {
            Message::GeneralRequest(about @ (id::DISTANCE | id::DISTANCE_SIMPLE | id::PROFILE)) => {
                self.waiting.push(Sounding::due(at, 0.0));
                self.asked.push_back(about);
                return None;
            }
            Message::GeneralRequest(id::PROTOCOL_VERSION) => return Some(Message::ProtocolVersion(PROTOCOL)),
            Message::GeneralRequest(id::DEVICE_INFORMATION) => {
                return Some(Message::DeviceInformation(DEVICE));
            }
            Message::GeneralRequest(id::SPEED_OF_SOUND) => {
                return Some(Message::SpeedOfSound(self.device_mmps));
            }
            Message::SetSpeedOfSound(mmps) => self.device_mmps = mmps,
            Message::SetPingInterval(ms) => self.interval = DurNs::from_millis(i64::from(ms.max(1))),
            Message::SetRange(_)
            | Message::SetGain(_)
            | Message::SetModeAuto(_)
            | Message::SetPingEnable(_) => (),
            Message::ContinuousStart(id::PROFILE) => self.ping_at = Some(at),
            Message::ContinuousStop(id::PROFILE) => self.ping_at = None,
            _ => {
                let text = Text(Bytes::new(b"not emulated").unwrap_or_default());
                return Some(Message::Nack { nacked_id: message.id(), text });
            }
        }
        Some(Message::Ack(message.id()))
    }

    /// Encodes a ping as the message with this id.
    fn distance_message(&mut self, about: u16, distance_mm: Option<u32>, confidence: f64) -> Message {
        self.pings = self.pings.wrapping_add(1);
        let confidence = math::round_to_i64(confidence * 100.0);
        let confidence = u8::try_from(confidence).ok().filter(|_| distance_mm.is_some()).unwrap_or(0);
        let distance = Distance {
            distance_mm: distance_mm.unwrap_or(0),
            confidence_percent: confidence.into(),
            pulse_us: PULSE_US,
            ping_number: self.pings,
            scan: SCAN,
            gain: 0,
        };
        match about {
            id::DISTANCE_SIMPLE => Message::DistanceSimple(DistanceSimple {
                distance_mm: distance.distance_mm,
                confidence_percent: confidence,
            }),
            id::PROFILE => Message::Profile(Profile { distance, strengths: strengths(distance_mm) }),
            _ => Message::Distance(distance),
        }
    }

    /// Distance in mm, as computed by the device from its speed of sound setting.
    fn distance_mm(&self, range_m: Option<f64>) -> Option<u32> {
        let mm = range_m? * f64::from(self.device_mmps) / self.site_mps;
        let mm = u32::try_from(math::round_to_i64(mm)).ok()?;
        (1..=SCAN.length_mm).contains(&mm).then_some(mm)
    }

    fn say(&mut self, at: MonoNs, message: &Message, line: LineSink<'_>) {
        if message.encode_to(&mut self.frame, self.settings.device_id, 0).is_ok() {
            line(Direction::Received, at + self.latency, self.frame.as_slice());
        }
    }
}

/// An echo in which only the point at the wall is not zero.
fn strengths(distance_mm: Option<u32>) -> Bytes<MAX_STRENGTHS> {
    let mut strengths = [0; POINTS];
    let point = distance_mm.map(|mm| u64::from(mm) * POINTS as u64 / u64::from(SCAN.length_mm));
    let point = point.and_then(|point| usize::try_from(point).ok());
    if let Some(strength) = point.and_then(|point| strengths.get_mut(point.min(POINTS - 1))) {
        *strength = ECHO;
    }
    Bytes::new(&strengths).unwrap_or_default()
}

impl Emulator<Sounding> for PingEmulator {
    fn begin(&mut self, until: MonoNs, due: &mut Vec<Sounding>) {
        let begun = self.waiting.partition_point(|sounding| sounding.at < until);
        due.extend(self.waiting.drain(..begun));
        while let Some(at) = self.ping_at.filter(|at| *at < until) {
            due.push(Sounding::due(at, 0.0));
            self.asked.push_back(if self.polled { id::DISTANCE } else { id::PROFILE });
            self.ping_at = Some(at + self.interval);
        }
    }

    fn hear(&mut self, at: MonoNs, bytes: &[u8], line: LineSink<'_>) {
        let mut heard = Vec::new();
        // After a silence, an unfinished frame is dropped, because it must not hide the frames that follow.
        if at.since(self.heard_at) > SILENCE {
            self.codec.flush(&mut |value| heard.push(value));
        }
        self.heard_at = at;
        self.codec.push(bytes, &mut |value| heard.push(value));
        for Addressed { destination, message, .. } in heard {
            let meant = [self.settings.device_id, EVERYONE].contains(&destination);
            if let Some(answer) = meant.then(|| self.answer_to(at, &message)).flatten() {
                self.say(at, &answer, line);
            }
        }
    }

    fn tell(&mut self, sounding: &Sounding, line: LineSink<'_>) {
        let about = self.asked.pop_front().unwrap_or(id::DISTANCE);
        if self.polled {
            // Requests are far shorter than the longest frame.
            let question = Message::GeneralRequest(about);
            if question.encode_to(&mut self.frame, 0, self.settings.device_id).is_ok() {
                line(Direction::Sent, sounding.at, self.frame.as_slice());
            }
        }
        let distance_mm = self.distance_mm(sounding.range_m);
        let message = self.distance_message(about, distance_mm, sounding.confidence);
        self.say(sounding.at, &message, line);
    }
}

#[cfg(test)]
mod tests;
