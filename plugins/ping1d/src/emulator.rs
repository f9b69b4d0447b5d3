//! An emulated echosounder, and the host that asks it for a distance each interval.

use headrace_core::app::device::{Direction, Emulator, EmulatorSetup, Truth};
use headrace_core::codec::{Bytes, Codec as _};
use headrace_core::frames::{Mount, Vec3};
use headrace_core::math;
use headrace_core::time::{DurNs, MonoNs};

use crate::codec::{Addressed, Distance, MAX_FRAME_BYTES, Message, PingCodec, ScanRange, Text, id};
use crate::settings::Settings;

/// Where an emulated device listens: up to the practical limit of a `Ping1D`.
const SCAN: ScanRange = ScanRange { start_mm: 0, length_mm: 30_000 };

/// Constant in an emulated ping.
const PULSE_US: u16 = 60;

/// Host and device on one line.
#[derive(Debug, Clone)]
pub struct PingEmulator {
    settings: Settings,
    mount: Mount,
    latency: DurNs,
    codec: PingCodec,
    pings: u32,
    ping_at: MonoNs,
    answer: Option<Bytes<MAX_FRAME_BYTES>>,
}

impl PingEmulator {
    /// A device that is asked as soon as it is switched on.
    pub fn new(settings: Settings, mount: Mount, latency: DurNs, setup: &EmulatorSetup) -> Self {
        let (codec, ping_at) = (PingCodec::default(), setup.start);
        Self { settings, mount, latency, codec, pings: 0, ping_at, answer: None }
    }

    fn ask(&mut self, truth: &dyn Truth, line: &mut dyn FnMut(Direction, MonoNs, &[u8])) {
        let message = Message::GeneralRequest(id::DISTANCE);
        let request = Addressed { source: 0, destination: self.settings.device_id, message };
        // A request is far shorter than the longest frame.
        let Ok(bytes) = request.encode() else { return };
        line(Direction::Sent, self.ping_at, bytes.as_slice());
        let mut asked = None;
        self.codec.push(bytes.as_slice(), &mut |value| asked = Some(value.message));
        self.answer = asked.and_then(|message| {
            let message = self.answer_to(&message, truth);
            Addressed { source: self.settings.device_id, destination: 0, message }.encode().ok()
        });
    }

    fn answer_to(&mut self, message: &Message, truth: &dyn Truth) -> Message {
        if *message != Message::GeneralRequest(id::DISTANCE) {
            let text = Text(Bytes::new(b"not emulated").unwrap_or_default());
            return Message::Nack { nacked_id: message.id(), text };
        }
        self.pings = self.pings.wrapping_add(1);
        let distance_mm = self.distance_mm(truth);
        Message::Distance(Distance {
            distance_mm: distance_mm.unwrap_or(0),
            confidence_percent: if distance_mm.is_some() { 100 } else { 0 },
            pulse_us: PULSE_US,
            ping_number: self.pings,
            scan: SCAN,
            gain: 0,
        })
    }

    /// Distance in mm that the device computes with the speed of sound it is set to.
    fn distance_mm(&self, truth: &dyn Truth) -> Option<u32> {
        let pose = truth.pose(self.ping_at);
        let direction = pose.attitude * (self.mount.rotation * Vec3::new(1.0, 0.0, 0.0));
        let range_m = truth.range_m(pose.place(self.mount.position), direction)?;
        let device_m = range_m * (self.settings.sound_speed_mps / truth.site().sound_speed_mps);
        let mm = u32::try_from(math::round_to_i64(device_m * 1000.0)).ok()?;
        (1..=SCAN.length_mm).contains(&mm).then_some(mm)
    }
}

impl Emulator for PingEmulator {
    fn due(&self) -> MonoNs {
        if self.answer.is_some() { self.ping_at + self.latency } else { self.ping_at }
    }

    /// Sends a request, or receives its answer.
    fn act(&mut self, truth: &dyn Truth, line: &mut dyn FnMut(Direction, MonoNs, &[u8])) {
        match self.answer.take() {
            Some(answer) => line(Direction::Received, self.ping_at + self.latency, answer.as_slice()),
            None => self.ask(truth, line),
        }
        if self.answer.is_none() {
            self.ping_at = self.ping_at + self.settings.interval;
        }
    }
}

#[cfg(test)]
mod tests;
