//! Registration of a head with the loop, and conversion of its returns to readings.

use headrace_sensor::SensorConfig;
use headrace_sensor::codec::{Bytes, Codec as _, CodecCounts, LineClock};
use headrace_sensor::config::{ConfigError, Section};
use headrace_sensor::device::{
    Decoder, Device, DeviceKind, Emulated, EmulatorSetup, OptionalPayload, Sense, SensorKind, SensorSpec,
};
use headrace_sensor::driver::{Carrier, Driver, DriverSetup, Probe};
use headrace_sensor::geometry::time::DurNs;
use headrace_sensor::reading::{Decoded, Packet, Reading, SonarReturn};
use headrace_sensor::sampling::head::{HeadMode, HeadSpec};
use headrace_sensor::stateful;
use headrace_sensor::withheld::WithheldReason;
use serde::{Deserialize, Serialize};

use crate::codec::{Header, Model, Return, ReturnCodec, Returns, SOUND_SPEED_MPS, Tag};
use crate::driver::{CARRIERS, HeadDriver};
use crate::emulator::HeadEmulator;
use crate::probe::{HEAD_IDS, HeadProbe};
use crate::settings::{Settings, range_setting};

/// Name of this device kind in vehicle files and logs.
const NAME: &str = "imagenex881";

/// Buffer for several seconds of the longest returns.
const RING_BYTES: usize = 1 << 17;

/// Longest usual gap between the bytes of a return. An unfinished return is dropped after this gap.
const SILENCE: DurNs = DurNs::from_millis(100);

/// The Imagenex 881 device kind.
#[derive(Debug, Clone, Copy)]
pub struct Imagenex881Kind;

impl DeviceKind for Imagenex881Kind {
    fn name(&self) -> &'static str {
        NAME
    }

    fn configure(&self, sensor: &SensorConfig, own: &Section<'_>) -> Result<Box<dyn Device>, ConfigError> {
        let settings = Settings::read(sensor, own)?;
        Ok(Box::new(Imagenex881 { sensor: sensor.clone(), settings }))
    }

    fn probes(&self) -> Vec<Box<dyn Probe>> {
        HEAD_IDS.iter().map(|id| Box::new(HeadProbe::new(*id)) as Box<dyn Probe>).collect()
    }
}

/// A head as configured in the vehicle file.
#[derive(Debug, Clone, PartialEq)]
pub struct Imagenex881 {
    sensor: SensorConfig,
    settings: Settings,
}

impl Imagenex881 {
    fn spec(&self) -> HeadSpec {
        HeadSpec {
            mount: self.sensor.mount,
            step_rad: self.settings.step_rad(),
            ping_period_s: self.settings.ping_period.as_secs_f64(),
            range_m: [self.settings.command.min_range_m, f64::from(self.settings.command.range_m)],
            sound_speed_mps: SOUND_SPEED_MPS,
            beam_rad: self.settings.beam_rad(),
            body: self.settings.body,
        }
    }
}

impl Device for Imagenex881 {
    fn specification(&self) -> SensorSpec {
        SensorSpec {
            sensor: self.sensor.clone(),
            kind: SensorKind::Head,
            decoder: Box::new(HeadDecoder::new(self.settings.clone(), self.sensor.latency)),
            ring_bytes: RING_BYTES,
        }
    }

    fn head(&self) -> Option<HeadSpec> {
        Some(self.spec())
    }

    fn modes(&self, range_m: Option<f64>) -> Result<Vec<HeadMode>, String> {
        let range_m = range_m.map_or(Ok(self.settings.command.range_m), range_setting)?;
        Ok(self.settings.modes(range_m))
    }

    fn sense(&self) -> Sense {
        Sense::Head
    }

    fn emulator(&self, setup: &EmulatorSetup) -> Emulated {
        Emulated::Head(Box::new(HeadEmulator::new(self.settings.clone(), self.sensor.latency, setup)))
    }

    /// Replaces returns that have an echo with returns that have only the profile point.
    fn without(&self, what: OptionalPayload, packet: &[u8], shorter: &mut Vec<u8>) -> bool {
        shorter.clear();
        what == OptionalPayload::Echoes && without_echoes(packet, shorter).is_some()
    }

    fn line_address(&self) -> Option<String> {
        Some(format!("head_id {}", self.settings.command.head_id))
    }

    fn carriers(&self) -> &'static [Carrier] {
        &CARRIERS
    }

    fn driver(&self, setup: &DriverSetup) -> Box<dyn Driver> {
        Box::new(HeadDriver::new(self.settings.clone(), setup))
    }
}

/// Reduces each return of a packet to its profile point (`IPX`), and writes the result to `shorter`.
///
/// `None` if the packet holds anything except whole returns, or holds no echo.
fn without_echoes(packet: &[u8], shorter: &mut Vec<u8>) -> Option<()> {
    let mut rest = packet;
    while !rest.is_empty() {
        let whole = Return::decode(rest, Some(Model::Head881)).ok()?;
        let (frame, after) = rest.split_at_checked(whole.encode().ok()?.as_slice().len())?;
        let point = match whole.header.tag {
            Tag::Imx | Tag::Igx => {
                Return { header: Header { tag: Tag::Ipx, ..whole.header }, echo: Bytes::default() }
            }
            _ => whole,
        };
        // A packet is left unchanged if one of its returns doesn't re-encode identically.
        (whole.encode().ok()?.as_slice() == frame).then_some(())?;
        shorter.extend_from_slice(point.encode().ok()?.as_slice());
        rest = after;
    }
    (shorter.len() < packet.len()).then_some(())
}

/// Number of whole returns that give no reading, by reason.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Rejected {
    /// The head rejected the command, or lost characters of the command.
    pub status: u64,
    /// The return is from another head id.
    pub head_id: u64,
    /// The return is from a GS model, whose additional fields aren't known well enough.
    pub tag: u64,
    /// The range setting differs from the configured one.
    pub range_setting: u64,
    /// The profile range is beyond the range setting.
    pub beyond_range: u64,
}

impl Rejected {
    fn total(&self) -> u64 {
        self.status + self.head_id + self.tag + self.range_setting + self.beyond_range
    }
}

/// Decodes a head's returns into readings.
#[derive(Debug, Clone)]
pub struct HeadDecoder {
    codec: ReturnCodec,
    clock: LineClock,
    reader: Reader,
}

stateful!(HeadDecoder { state: codec, clock, reader; });

/// Converts whole returns to readings. It is separate from the codec, so that both can be borrowed at once.
#[derive(Debug, Clone)]
struct Reader {
    settings: Settings,
    latency: DurNs,
    rejected: Rejected,
    /// Reason why the latest rejected return was rejected.
    reason: Option<WithheldReason>,
}

stateful!(Reader { state: rejected, reason; fixed: settings, latency; });

impl HeadDecoder {
    /// Creates a decoder. A frame with a position past +180 degrees is bad, whatever its head id.
    pub fn new(settings: Settings, latency: DurNs) -> Self {
        let reader = Reader { settings, latency, rejected: Rejected::default(), reason: None };
        let codec = ReturnCodec::new(Returns { model: Some(Model::Head881) });
        Self { codec, clock: LineClock::new(SILENCE), reader }
    }

    /// Number of whole returns so far that gave no reading, by reason.
    pub fn rejected(&self) -> Rejected {
        self.reader.rejected
    }
}

impl Decoder for HeadDecoder {
    fn decode(&mut self, packet: Packet<'_>, sink: &mut dyn FnMut(Decoded)) {
        let Self { codec, clock, reader } = self;
        clock.push(codec, packet.received, packet.bytes, |received, frame| {
            if let Some(reading) = reader.read(frame) {
                let valid_at = received - reader.latency;
                sink(Decoded { valid_at, reading: Reading::Sonar(reading) });
            }
        });
    }

    fn counts(&self) -> CodecCounts {
        self.codec.counts()
    }

    fn withheld(&self) -> u64 {
        self.rejected().total()
    }

    fn withheld_reason(&self) -> Option<WithheldReason> {
        self.reader.reason
    }
}

impl Reader {
    fn read(&mut self, frame: &[u8]) -> Option<SonarReturn> {
        let (header, _) = Header::decode(frame, Some(Model::Head881)).ok()?;
        let command = &self.settings.command;
        let profile_mm = header.profile_mm(Model::Head881);
        let Rejected { status, head_id, tag, range_setting, beyond_range } = &mut self.rejected;
        let reason = if header.head_id != command.head_id {
            Some((head_id, WithheldReason::OtherDevice))
        } else if header.tag.is_gs() {
            Some((tag, WithheldReason::OtherDevice))
        } else if !header.status.accepted() || header.status.overrun() {
            Some((status, WithheldReason::Fault))
        } else if header.range_m != command.range_m {
            Some((range_setting, WithheldReason::OtherRange))
        } else if profile_mm.is_some_and(|mm| mm > u32::from(header.range_m) * 1000) {
            Some((beyond_range, WithheldReason::Implausible))
        } else {
            None
        };
        if let Some((count, reason)) = reason {
            *count += 1;
            self.reason = Some(reason);
            return None;
        }
        Some(SonarReturn {
            angle_rad: self.settings.sensor_rad(header.position),
            range_m: profile_mm.map(metres),
            resolution_m: metres(header.count_mm(Model::Head881)),
            max_range_m: f64::from(header.range_m),
            sound_speed_mps: SOUND_SPEED_MPS,
        })
    }
}

fn metres(mm: u32) -> f64 {
    f64::from(mm) / 1000.0
}

#[cfg(test)]
mod tests;
