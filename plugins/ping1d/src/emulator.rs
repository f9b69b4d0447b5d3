//! An emulated echosounder, and the host that asks it for a distance each interval.

use headrace_core::app::device::{Direction, Emulator, EmulatorSetup, LineSink};
use headrace_core::app::measurement::Sounding;
use headrace_core::codec::{Bytes, Codec as _};
use headrace_core::math;
use headrace_core::time::{DurNs, MonoNs};

use crate::codec::{Addressed, Distance, Message, PingCodec, ScanRange, Text, id};
use crate::settings::Settings;

/// Where an emulated device listens: up to the practical limit of a `Ping1D`.
const SCAN: ScanRange = ScanRange { start_mm: 0, length_mm: 30_000 };

/// Constant in an emulated ping.
const PULSE_US: u16 = 60;

/// Host and device on one line.
#[derive(Debug, Clone)]
pub struct PingEmulator {
    settings: Settings,
    latency: DurNs,
    /// Metres as the device reckons them for a metre of the site's.
    device_per_site: f64,
    codec: PingCodec,
    pings: u32,
    ping_at: MonoNs,
}

impl PingEmulator {
    /// A device that is asked as soon as it is switched on.
    pub fn new(settings: Settings, latency: DurNs, setup: &EmulatorSetup) -> Self {
        let device_per_site = settings.sound_speed_mps / setup.site.sound_speed_mps;
        let (codec, ping_at) = (PingCodec::default(), setup.start);
        Self { settings, latency, device_per_site, codec, pings: 0, ping_at }
    }

    fn answer_to(&mut self, message: &Message, distance_mm: Option<u32>) -> Message {
        if *message != Message::GeneralRequest(id::DISTANCE) {
            let text = Text(Bytes::new(b"not emulated").unwrap_or_default());
            return Message::Nack { nacked_id: message.id(), text };
        }
        self.pings = self.pings.wrapping_add(1);
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
    fn distance_mm(&self, range_m: Option<f64>) -> Option<u32> {
        let mm = u32::try_from(math::round_to_i64(range_m? * self.device_per_site * 1000.0)).ok()?;
        (1..=SCAN.length_mm).contains(&mm).then_some(mm)
    }
}

impl Emulator<Sounding> for PingEmulator {
    fn begin(&mut self, until: MonoNs, due: &mut Vec<Sounding>) {
        while self.ping_at < until {
            due.push(Sounding::due(self.ping_at, 0.0));
            self.ping_at = self.ping_at + self.settings.interval;
        }
    }

    fn tell(&mut self, sounding: &Sounding, line: LineSink<'_>) {
        let device = self.settings.device_id;
        let message = Message::GeneralRequest(id::DISTANCE);
        // A request is far shorter than the longest frame.
        let Ok(bytes) = (Addressed { source: 0, destination: device, message }).encode() else { return };
        line(Direction::Sent, sounding.at, bytes.as_slice());
        let mut asked = None;
        self.codec.push(bytes.as_slice(), &mut |value| asked = Some(value.message));
        let Some(asked) = asked else { return };
        let message = self.answer_to(&asked, self.distance_mm(sounding.range_m));
        if let Ok(answer) = (Addressed { source: device, destination: 0, message }).encode() {
            line(Direction::Received, sounding.at + self.latency, answer.as_slice());
        }
    }
}

#[cfg(test)]
mod tests;
