//! Registration of an echosounder with the loop, and conversion of its messages to readings.

use headrace_sensor::SensorConfig;
use headrace_sensor::codec::{Codec as _, CodecCounts, Framing as _, LineClock};
use headrace_sensor::config::{ConfigError, Section};
use headrace_sensor::device::{
    Decoder, Device, DeviceKind, Emulated, EmulatorSetup, OptionalPayload, Sense, SensorKind, SensorSpec,
};
use headrace_sensor::driver::{Carrier, Driver, DriverSetup, Probe};
use headrace_sensor::geometry::time::DurNs;
use headrace_sensor::reading::{Decoded, EchoRange, Packet, Reading};
use headrace_sensor::stateful;
use headrace_sensor::withheld::WithheldReason;

use crate::codec::{Addressed, Distance, DistanceSimple, Frame, Frames, Message, PingCodec};
use crate::driver::{CARRIERS, PingDriver};
use crate::emulator::PingEmulator;
use crate::probe::PingProbe;
use crate::settings::Settings;

/// Name of this device kind in vehicle files and logs.
const NAME: &str = "ping1d";

/// Buffer for several of the longest frames.
const RING_BYTES: usize = 1 << 16;

/// Longest usual gap between the bytes of a frame. An unfinished frame is dropped after this gap.
///
/// The gap is shorter than the usual ping interval, so a false frame start delays one reading at most.
const SILENCE: DurNs = DurNs::from_millis(50);

/// The Ping echosounder device kind.
#[derive(Debug, Clone, Copy)]
pub struct Ping1dKind;

impl DeviceKind for Ping1dKind {
    fn name(&self) -> &'static str {
        NAME
    }

    fn configure(&self, sensor: &SensorConfig, own: &Section<'_>) -> Result<Box<dyn Device>, ConfigError> {
        let settings = Settings::read(sensor, own)?;
        Ok(Box::new(Ping1d { sensor: sensor.clone(), settings }))
    }

    fn probes(&self) -> Vec<Box<dyn Probe>> {
        vec![Box::new(PingProbe::default())]
    }
}

/// A Ping echosounder as configured in the vehicle file.
#[derive(Debug, Clone, PartialEq)]
pub struct Ping1d {
    sensor: SensorConfig,
    settings: Settings,
}

impl Device for Ping1d {
    fn specification(&self) -> SensorSpec {
        SensorSpec {
            sensor: self.sensor.clone(),
            kind: SensorKind::Echosounder { min_confidence: self.settings.min_confidence },
            decoder: Box::new(PingDecoder::new(self.settings, self.sensor.latency)),
            ring_bytes: RING_BYTES,
        }
    }

    fn sense(&self) -> Sense {
        Sense::Echosounder
    }

    fn emulator(&self, setup: &EmulatorSetup) -> Emulated {
        Emulated::Echosounder(Box::new(PingEmulator::new(self.settings, self.sensor.latency, setup)))
    }

    /// Replaces a profile with a distance message, which has no echo strengths.
    fn without(&self, what: OptionalPayload, packet: &[u8], shorter: &mut Vec<u8>) -> bool {
        shorter.clear();
        what == OptionalPayload::Echoes && without_strengths(packet, shorter).is_some()
    }

    fn line_address(&self) -> Option<String> {
        Some(format!("device_id {}", self.settings.device_id))
    }

    fn carriers(&self) -> &'static [Carrier] {
        &CARRIERS
    }

    fn driver(&self, _: &DriverSetup) -> Box<dyn Driver> {
        Box::new(PingDriver::new(self.settings))
    }
}

/// Converts a packet that is one profile to a distance message; `None` for other packets.
fn without_strengths(packet: &[u8], shorter: &mut Vec<u8>) -> Option<()> {
    let whole = Frames.read(packet)?;
    let Message::Profile(profile) = whole.message else { return None };
    // A packet that doesn't re-encode identically is left unchanged.
    (whole.encode().ok()?.as_slice() == packet).then_some(())?;
    let distance = Addressed { message: Message::Distance(profile.distance), ..whole };
    shorter.extend_from_slice(distance.encode().ok()?.as_slice());
    Some(())
}

/// Converts the device's messages to readings, including distances that other clients requested.
#[derive(Debug, Clone)]
pub struct PingDecoder {
    codec: PingCodec,
    clock: LineClock,
    settings: Settings,
    latency: DurNs,
    withheld: u64,
    reason: Option<WithheldReason>,
}

stateful!(PingDecoder { state: codec, clock, withheld, reason; fixed: settings, latency; });

impl PingDecoder {
    /// Creates a decoder with these settings.
    pub fn new(settings: Settings, latency: DurNs) -> Self {
        let (codec, clock) = (PingCodec::default(), LineClock::new(SILENCE));
        Self { codec, clock, settings, latency, withheld: 0, reason: None }
    }
}

impl Decoder for PingDecoder {
    fn decode(&mut self, packet: Packet<'_>, sink: &mut dyn FnMut(Decoded)) {
        let Self { codec, clock, settings, latency, withheld, reason } = self;
        clock.push(codec, packet.received, packet.bytes, |received, frame| {
            let Some(frame) = Frame::parse(frame) else { return };
            let Some((distance_mm, confidence_percent)) = distance(&frame) else { return };
            // A confidence above 100 per cent is undefined, so its distance is withheld.
            let is_other = frame.source != settings.device_id;
            if is_other || confidence_percent > 100 {
                *withheld += 1;
                *reason =
                    Some(if is_other { WithheldReason::OtherDevice } else { WithheldReason::Implausible });
                return;
            }
            let heard = confidence_percent > 0 && distance_mm > 0;
            let echo = EchoRange {
                range_m: heard.then(|| f64::from(distance_mm) / 1000.0),
                confidence: f64::from(confidence_percent) / 100.0,
                sound_speed_mps: settings.sound_speed_mps,
            };
            sink(Decoded { valid_at: received - *latency, reading: Reading::Echo(echo) });
        });
    }

    fn counts(&self) -> CodecCounts {
        self.codec.counts()
    }

    /// Number of withheld distances: those of devices with another id, and those with an undefined
    /// confidence.
    fn withheld(&self) -> u64 {
        self.withheld
    }

    fn withheld_reason(&self) -> Option<WithheldReason> {
        self.reason
    }
}

/// Distance in mm and confidence in per cent, read from a distance, simple distance or profile frame.
fn distance(frame: &Frame<'_>) -> Option<(u32, u16)> {
    let simple = DistanceSimple::of(frame).map(|it| (it.distance_mm, u16::from(it.confidence_percent)));
    simple.or_else(|| Distance::of(frame).map(|it| (it.distance_mm, it.confidence_percent)))
}

#[cfg(test)]
mod tests;
