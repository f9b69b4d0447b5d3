//! Decodes MAVLink frames into readings of one sensor that the autopilot reports. Good frames of other
//! sensors are ignored.

use headrace_sensor::codec::{Codec as _, CodecCounts, Framing as _, LineClock};
use headrace_sensor::device::Decoder;
use headrace_sensor::geometry::frames::{Rot, Vec3};
use headrace_sensor::geometry::math;
use headrace_sensor::geometry::time::DurNs;
use headrace_sensor::reading::{Decoded, EchoRange, Packet, Reading, WaterPressure};
use headrace_sensor::stateful;
use headrace_sensor::withheld::WithheldReason;
use serde::{Deserialize, Serialize};

use crate::frame::{Frame, Frames, MavlinkCodec, is_autopilots_heartbeat, system_of};
use crate::message::{
    Distance, HECTOPASCAL, Imu, ImuMessage, MILLI_G_MPS2, MILLIRADPS, Message, Pressure, PressureMessage,
    to_ours,
};
use mavlink::dialects::ardupilotmega::ATTITUDE_DATA;

/// Longest usual gap between the bytes of a frame. The longest frame takes 50 ms at 57,600 baud.
const SILENCE: DurNs = DurNs::from_millis(100);

/// Amount by which an angle may exceed its limits because of rounding, radians.
const ANGLE_TOLERANCE_RAD: f64 = 1e-3;

/// Quality value that marks a distance as invalid, per cent.
const QUALITY_INVALID_PERCENT: u8 = 1;

/// Decoding settings of one sensor that the autopilot reports.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DecoderSettings {
    /// Sensor whose messages are decoded.
    pub part: Part,
    /// Accepted MAVLink system id. `None` accepts the first system that sends an autopilot's heartbeat or one of the
    /// sensor's messages.
    pub system_id: Option<u8>,
    /// Accepted MAVLink component id; `None` for any.
    pub component_id: Option<u8>,
    /// Delay from a reading's time of validity to its receipt.
    pub latency: DurNs,
}

/// A sensor that the autopilot reports: the value of the key `part`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Part {
    /// The inertial unit: attitude, turn rate and specific force.
    Imu {
        /// Message with rates and forces. With `None`, the rates come from ATTITUDE, and there are no forces.
        message: Option<ImuMessage>,
    },
    /// A depth sensor: water pressure.
    Pressure {
        /// MAVLink message of the barometer that measures the water pressure.
        message: PressureMessage,
        /// Resolution of the barometer's sensor, Pa.
        resolution_pa: f64,
    },
    /// An echosounder: a distance.
    Distance(DistancePart),
}

/// Selection and decoding settings of a distance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DistancePart {
    /// MAV_SENSOR_ORIENTATION number; `None` for any.
    pub orientation: Option<u8>,
    /// Sensor id; `None` for any.
    pub sensor_id: Option<u8>,
    /// Confidence, 0 to 1, of a distance whose quality is unknown.
    pub unknown_confidence: f64,
    /// Speed of sound setting of the sensor, m/s.
    pub sound_speed_mps: f64,
}

/// Decodes bytes into readings of one sensor.
#[derive(Debug, Clone)]
pub struct MavlinkDecoder {
    codec: MavlinkCodec,
    clock: LineClock,
    state: State,
}

stateful!(MavlinkDecoder { state: codec, clock, state; });

#[derive(Debug, Clone)]
struct State {
    meaning: DecoderSettings,
    boot: BootClock,
    /// Accepted MAVLink system id, once it is known.
    system_id: Option<u8>,
    passed_over: u64,
    withheld: u64,
    /// Reason why the latest withheld message was withheld.
    reason: Option<WithheldReason>,
}

stateful!(State { state: boot, system_id, passed_over, withheld, reason; fixed: meaning; });

/// The autopilot's 32-bit millisecond clock, without wraps.
#[derive(Debug, Clone, Copy, Default, Serialize, Deserialize)]
struct BootClock {
    last_ms: Option<u32>,
    since_boot_ms: i64,
}

impl BootClock {
    /// Processes a timestamp of the clock. A small backward step is no wrap, because messages may be sent out of order.
    fn note(&mut self, time_ms: u32) {
        self.since_boot_ms = match self.last_ms {
            None => i64::from(time_ms),
            Some(last_ms) => self.since_boot_ms + i64::from(time_ms.wrapping_sub(last_ms).cast_signed()),
        };
        self.last_ms = Some(time_ms);
    }
}

impl MavlinkDecoder {
    /// Creates a decoder with these settings.
    pub fn new(meaning: DecoderSettings) -> Self {
        let system_id = meaning.system_id;
        let boot = BootClock::default();
        let state = State { meaning, boot, system_id, passed_over: 0, withheld: 0, reason: None };
        Self { codec: MavlinkCodec::default(), clock: LineClock::new(SILENCE), state }
    }

    /// Number of good frames that don't belong to this sensor.
    pub fn passed_over(&self) -> u64 {
        self.state.passed_over
    }

    /// Time since the autopilot's boot, as stated in the sensor's latest message.
    pub fn since_boot(&self) -> Option<DurNs> {
        self.state.boot.last_ms.map(|_| DurNs::from_millis(self.state.boot.since_boot_ms))
    }
}

impl Decoder for MavlinkDecoder {
    fn decode(&mut self, packet: Packet<'_>, sink: &mut dyn FnMut(Decoded)) {
        let Self { codec, clock, state } = self;
        clock.push(codec, packet.received, packet.bytes, |received, frame| {
            let Some(frame) = Frames.read(frame) else { return };
            let valid_at = received - state.meaning.latency;
            state.take(&frame, &mut |reading| sink(Decoded { valid_at, reading }));
        });
    }

    fn counts(&self) -> CodecCounts {
        self.codec.counts()
    }

    /// Number of withheld readings, plus the number of the sensor's messages from other systems.
    ///
    /// Readings are withheld if their values are invalid: angles beyond their range, numbers that aren't finite, a
    /// pressure that isn't above zero, or contradictory limits.
    fn withheld(&self) -> u64 {
        self.state.withheld
    }

    fn withheld_reason(&self) -> Option<WithheldReason> {
        self.state.reason
    }
}

impl State {
    fn take(&mut self, frame: &Frame, sink: &mut dyn FnMut(Reading)) {
        let before = self.passed_over;
        let is_ours = self.system_id.is_none_or(|id| id == system_of(frame));
        if is_ours {
            self.take_own(frame, sink);
        } else if self.is_of_part(frame) {
            self.withhold(WithheldReason::OtherDevice);
        } else {
            self.passed_over += 1;
        }
        // In headrace's own logs all messages are from one system. Other logs may lack a heartbeat, so the
        // sensor's first message also decides the accepted system.
        if is_ours && (is_autopilots_heartbeat(frame) || self.passed_over == before) {
            self.system_id = Some(system_of(frame));
        }
    }

    /// Whether a frame's message belongs to this sensor, whatever its sender.
    fn is_of_part(&self, frame: &Frame) -> bool {
        let mut same = Self { system_id: None, passed_over: 0, ..self.clone() };
        same.take_own(frame, &mut |_| ());
        same.passed_over == 0
    }

    fn take_own(&mut self, frame: &Frame, sink: &mut dyn FnMut(Reading)) {
        let DecoderSettings { part, component_id, .. } = self.meaning;
        let is_component = component_id.is_none_or(|id| id == frame.header.component_id);
        match (part, Message::of(frame).filter(|_| is_component)) {
            (Part::Imu { message }, Some(Message::Attitude(attitude))) => {
                self.boot.note(attitude.time_boot_ms);
                self.tell(self::attitude(&attitude), sink);
                if message.is_none() {
                    let rates = [attitude.rollspeed, attitude.pitchspeed, attitude.yawspeed];
                    self.tell(Some(rate(rates.map(f64::from))), sink);
                }
            }
            (Part::Imu { message: Some(message) }, Some(Message::Imu(imu)))
                if imu.message == message && imu.unit == 0 =>
            {
                let [rate, force] = rate_and_force(&imu);
                self.tell(Some(rate), sink);
                self.tell(Some(force), sink);
            }
            (Part::Pressure { message, resolution_pa }, Some(Message::Pressure(pressure)))
                if pressure.message == message =>
            {
                self.boot.note(pressure.time_boot_ms);
                self.tell(water_pressure(&pressure, resolution_pa), sink);
            }
            (Part::Distance(part), Some(Message::Distance(distance))) if part.is_of(&distance) => {
                self.boot.note(distance.time_boot_ms);
                self.tell(part.echo(&distance), sink);
            }
            _ => self.passed_over += 1,
        }
    }

    fn tell(&mut self, reading: Option<Reading>, sink: &mut dyn FnMut(Reading)) {
        match reading.filter(Reading::is_finite) {
            Some(reading) => sink(reading),
            None => self.withhold(WithheldReason::Implausible),
        }
    }

    fn withhold(&mut self, reason: WithheldReason) {
        self.withheld += 1;
        self.reason = Some(reason);
    }
}

/// Converts roll, pitch and yaw to an attitude; `None` if an angle is beyond its limits.
///
/// MAVLink's angles are an intrinsic z-y-x rotation. This rotation equals the extrinsic x-y-z rotation that [`Rot`]
/// takes.
fn attitude(attitude: &ATTITUDE_DATA) -> Option<Reading> {
    let [roll, pitch, yaw] = to_ours([attitude.roll, attitude.pitch, attitude.yaw].map(f64::from));
    let within = |angle: f64, most: f64| angle.abs() <= most + ANGLE_TOLERANCE_RAD;
    let possible = within(roll, math::PI) && within(pitch, math::FRAC_PI_2) && within(yaw, math::PI);
    possible.then(|| Reading::Attitude(Rot::from_roll_pitch_yaw(roll, pitch, yaw)))
}

fn rate(radps: [f64; 3]) -> Reading {
    let [x, y, z] = to_ours(radps);
    Reading::AngularRate(Vec3::new(x, y, z))
}

fn rate_and_force(imu: &Imu) -> [Reading; 2] {
    let [x, y, z] = to_ours(imu.force_mg.map(|milli_g| f64::from(milli_g) * MILLI_G_MPS2));
    let force = Reading::SpecificForce(Vec3::new(x, y, z));
    [rate(imu.rate_mradps.map(|mradps| f64::from(mradps) * MILLIRADPS)), force]
}

fn water_pressure(pressure: &Pressure, resolution_pa: f64) -> Option<Reading> {
    let pressure_pa = f64::from(pressure.absolute_hpa) * HECTOPASCAL;
    let temperature_degc = f64::from(pressure.temperature_cdegc) / 100.0;
    let water = WaterPressure { pressure_pa, resolution_pa, temperature_degc };
    (pressure_pa > 0.0).then_some(Reading::Pressure(water))
}

impl DistancePart {
    fn is_of(&self, distance: &Distance) -> bool {
        self.orientation.is_none_or(|orientation| orientation == distance.orientation)
            && self.sensor_id.is_none_or(|id| id == distance.sensor_id)
    }

    /// Converts a distance to a reading. A distance marked invalid, or outside the sensor's limits, gives a ping
    /// without an echo.
    fn echo(&self, distance: &Distance) -> Option<Reading> {
        if distance.least_cm >= distance.most_cm || distance.quality_percent > 100 {
            return None;
        }
        let invalid = distance.quality_percent == QUALITY_INVALID_PERCENT;
        let within = (distance.least_cm.max(1)..=distance.most_cm).contains(&distance.distance_cm);
        let heard = within && !invalid;
        let confidence = match distance.quality_percent {
            _ if !heard => 0.0,
            0 => self.unknown_confidence,
            percent => f64::from(percent) / 100.0,
        };
        Some(Reading::Echo(EchoRange {
            range_m: heard.then(|| f64::from(distance.distance_cm) / 100.0),
            confidence,
            sound_speed_mps: self.sound_speed_mps,
        }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn autopilot_clock_may_wrap_or_step_back() {
        let mut clock = BootClock::default();
        for (time_ms, since_boot_ms) in
            [(4_294_967_000, 4_294_967_000), (4_294_966_990, 4_294_966_990), (4, 4_294_967_300_i64)]
        {
            clock.note(time_ms);
            assert_eq!(clock.since_boot_ms, since_boot_ms);
        }
    }
}
