//! Emulates an autopilot, which sends the messages of one sensor at a fixed rate.

use headrace_sensor::device::{Direction, Emulator, EmulatorSetup, LineSink};
use headrace_sensor::geometry::math;
use headrace_sensor::geometry::time::{DurNs, MonoNs};
use headrace_sensor::measurement::{Inertia, Measurement, Pressure as InertialSample, Sounding};

use mavlink::{MAVLinkV2MessageRaw, MavHeader};

use crate::decoder::{DecoderSettings, DistancePart, Part};
use crate::frame::encode;
use crate::message::{Distance, HECTOPASCAL, Imu, MILLI_G_MPS2, MILLIRADPS, Message, Pressure, to_ours};
use mavlink::dialects::ardupilotmega::{
    ATTITUDE_DATA, HEARTBEAT_DATA, MavAutopilot, MavModeFlag, MavState, MavType,
};

/// Least and greatest distance of an emulated distance sensor, cm: about the limits of a Ping1D.
const LEAST_CM: u16 = 30;
const MOST_CM: u16 = 5000;
/// Quality of an invalid distance, per cent. Source: MAVLink, `DISTANCE_SENSOR`. A quality of 0 is unknown.
const QUALITY_INVALID_PERCENT: u8 = 1;
/// Period of heartbeats. Source: MAVLink, heartbeat protocol, once a second.
const HEARTBEAT_PERIOD: DurNs = DurNs::from_millis(1_000);
/// Temperature of the emulated sensors: ten degrees Celsius, in hundredths.
const TEMPERATURE_CDEGC: i16 = 1000;

/// An ideal emulated autopilot: there is no noise and no added delay, but values are whole wire units.
#[derive(Debug, Clone)]
pub struct AutopilotEmulator {
    meaning: DecoderSettings,
    rate_hz: f64,
    start: MonoNs,
    /// Ratio of a distance that the sensor reports to the true distance at the site.
    device_per_site: f64,
    begun: u64,
    sequence: u8,
    /// Time of the next heartbeat; `None` if no host receives heartbeats.
    heartbeat_at: Option<MonoNs>,
}

impl AutopilotEmulator {
    /// Creates an autopilot that is switched on, and first sends, at the setup's start.
    pub fn new(meaning: DecoderSettings, rate_hz: f64, setup: &EmulatorSetup) -> Self {
        let device_per_site = match meaning.part {
            Part::Distance(part) => part.sound_speed_mps / setup.site.sound_speed_mps,
            _ => 1.0,
        };
        // Without a real host there are no heartbeats, because a sensor's driver records only that sensor's messages.
        let heartbeat_at = (!setup.polled).then_some(setup.start);
        Self { meaning, rate_hz, start: setup.start, device_per_site, begun: 0, sequence: 0, heartbeat_at }
    }

    fn begin_each<M: Measurement>(&mut self, until: MonoNs, due: &mut Vec<M>, new: impl Fn(MonoNs) -> M) {
        loop {
            let at = self.start + DurNs::from_secs_f64(self.begun as f64 / self.rate_hz);
            if at >= until {
                return;
            }
            due.push(new(at));
            self.begun += 1;
        }
    }

    fn send(&mut self, at: MonoNs, message: &Message, line: LineSink<'_>) {
        let came = at + self.meaning.latency;
        if self.heartbeat_at.is_some_and(|due| at >= due) {
            self.heartbeat_at = Some(at + HEARTBEAT_PERIOD);
            line(Direction::Received, came, heartbeat(self.next_header()).raw_bytes());
        }
        line(Direction::Received, came, message.to_frame(self.next_header()).raw_bytes());
    }

    fn next_header(&mut self) -> MavHeader {
        let sequence = self.sequence;
        self.sequence = sequence.wrapping_add(1);
        MavHeader {
            system_id: u32::from(self.meaning.system_id.unwrap_or(1)),
            component_id: self.meaning.component_id.unwrap_or(1),
            sequence,
        }
    }

    fn since_boot_us(&self, at: MonoNs) -> u64 {
        u64::try_from(at.since(self.start).0 / 1000).unwrap_or_default()
    }

    fn since_boot_ms(&self, at: MonoNs) -> u32 {
        u32::try_from((self.since_boot_us(at) / 1000) & u64::from(u32::MAX)).unwrap_or_default()
    }
}

impl Emulator<Inertia> for AutopilotEmulator {
    fn begin(&mut self, until: MonoNs, due: &mut Vec<Inertia>) {
        let period = DurNs::from_secs_f64(1.0 / self.rate_hz);
        self.begin_each(until, due, |at| Inertia::due(at, period));
    }

    fn tell(&mut self, motion: &Inertia, line: LineSink<'_>) {
        let Part::Imu { message } = self.meaning.part else { return };
        let (roll, pitch, yaw) = motion.attitude.roll_pitch_yaw();
        let rates_radps = to_ours(motion.rate_radps.0.into());
        let [rollspeed, pitchspeed, yawspeed] = rates_radps.map(single);
        let time_boot_ms = self.since_boot_ms(motion.at);
        // A value that isn't finite wasn't measured, and is not sent.
        let is_known = |values: &[f64]| values.iter().all(|value| value.is_finite());
        if !is_known(&rates_radps) {
            return;
        }
        if is_known(&[roll, pitch, yaw]) {
            let [roll, pitch, yaw] = to_ours([roll, pitch, yaw]).map(single);
            let attitude = ATTITUDE_DATA { time_boot_ms, roll, pitch, yaw, rollspeed, pitchspeed, yawspeed };
            self.send(motion.at, &Message::Attitude(attitude), line);
        }
        let Some(message) = message.filter(|_| motion.force_mps2.is_finite()) else { return };
        let imu = Imu {
            message,
            time_us: self.since_boot_us(motion.at),
            force_mg: to_ours(motion.force_mps2.0.into()).map(|mps2| counts(mps2 / MILLI_G_MPS2)),
            rate_mradps: rates_radps.map(|radps| counts(radps / MILLIRADPS)),
            unit: 0,
        };
        self.send(motion.at, &Message::Imu(imu), line);
    }
}

impl Emulator<InertialSample> for AutopilotEmulator {
    fn begin(&mut self, until: MonoNs, due: &mut Vec<InertialSample>) {
        self.begin_each(until, due, InertialSample::due);
    }

    fn tell(&mut self, felt: &InertialSample, line: LineSink<'_>) {
        let Part::Pressure { message, resolution_pa } = self.meaning.part else { return };
        let steps = math::round_to_i64(felt.pressure_pa / resolution_pa);
        let pressure = Pressure {
            message,
            time_boot_ms: self.since_boot_ms(felt.at),
            absolute_hpa: single(steps as f64 * resolution_pa / HECTOPASCAL),
            temperature_cdegc: TEMPERATURE_CDEGC,
        };
        self.send(felt.at, &Message::Pressure(pressure), line);
    }
}

impl Emulator<Sounding> for AutopilotEmulator {
    fn begin(&mut self, until: MonoNs, due: &mut Vec<Sounding>) {
        self.begin_each(until, due, |at| Sounding::due(at, 0.0));
    }

    fn tell(&mut self, sounding: &Sounding, line: LineSink<'_>) {
        let Part::Distance(DistancePart { orientation, sensor_id, .. }) = self.meaning.part else { return };
        let cm = sounding.range_m.map(|range_m| math::round_to_i64(range_m * self.device_per_site * 100.0));
        let heard = cm.and_then(|cm| u16::try_from(cm).ok()).filter(|cm| (LEAST_CM..=MOST_CM).contains(cm));
        let quality_percent = u8::try_from(math::round_to_i64(sounding.confidence * 100.0)).ok();
        let quality_percent = quality_percent.filter(|_| heard.is_some()).unwrap_or(0);
        let distance = Distance {
            time_boot_ms: self.since_boot_ms(sounding.at),
            least_cm: LEAST_CM,
            most_cm: MOST_CM,
            distance_cm: heard.unwrap_or(0),
            sensor_id: sensor_id.unwrap_or(0),
            orientation: orientation.unwrap_or(0),
            quality_percent: quality_percent.max(QUALITY_INVALID_PERCENT),
        };
        self.send(sounding.at, &Message::Distance(distance), line);
    }
}

/// The heartbeat of a vehicle with ArduSub.
fn heartbeat(header: MavHeader) -> MAVLinkV2MessageRaw {
    let heartbeat = HEARTBEAT_DATA {
        mavtype: MavType::MAV_TYPE_SUBMARINE,
        autopilot: MavAutopilot::MAV_AUTOPILOT_ARDUPILOTMEGA,
        base_mode: MavModeFlag::empty(),
        system_status: MavState::MAV_STATE_ACTIVE,
        ..HEARTBEAT_DATA::DEFAULT
    };
    encode(header, &heartbeat)
}

/// Whole number nearest to a value, within the range of the wire format.
fn counts(value: f64) -> i16 {
    let counts = math::round_to_i64(value);
    i16::try_from(counts).unwrap_or(if counts < 0 { i16::MIN } else { i16::MAX })
}

#[expect(clippy::cast_possible_truncation, reason = "the wire has single precision")]
fn single(value: f64) -> f32 {
    value as f32
}
