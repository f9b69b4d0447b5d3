//! Converts the messages of a topic for the sensor that they belong to.

use std::collections::BTreeMap;

use headrace_geometry::frames::Rot;
use headrace_geometry::time::MonoNs;
use headrace_sensor::device::Sense;

use super::clocks::{Base, Clocks};
use super::message::{Read, Type, Values, read};
use super::points::{Beam, Beams, Plane};
use super::wire::Encoding;
use crate::emulated::{BEYOND, Doubt, EmulatedSensor, Unsent, Value};
use crate::entry::{Entry, ImportReport};

/// Settings that the mapping gives for a topic, apart from its sensor.
#[derive(Debug, Clone, Copy)]
pub(super) struct Manner {
    pub(super) base: Base,
    /// Factor that converts a pressure or length to SI units.
    pub(super) unit: f64,
    /// Whether pressures are gauge pressures, above the air's pressure.
    pub(super) is_gauge: bool,
    /// Speed of sound with which the device computed ranges, m/s; `None` for that of the site.
    pub(super) sound_speed_mps: Option<f64>,
    pub(super) plane: Plane,
}

impl Default for Manner {
    fn default() -> Self {
        Self { base: Base::Record, unit: 1.0, is_gauge: false, sound_speed_mps: None, plane: Plane::Yz }
    }
}

/// Converter of one topic's messages to a sensor's bytes.
pub(super) struct Feed {
    of: Type,
    sensor: EmulatedSensor,
    manner: Manner,
    clocks: Clocks,
    taken: u64,
    frame_id: Option<Vec<u8>>,
    /// Number of messages whose coordinate frame differs from the first message's.
    other_frames: u64,
    /// Sum of the specific force along z over all messages, m/s^2.
    upward_mps2: f64,
    /// Highest pressure in all messages so far, Pa.
    highest_pa: f64,
    /// Number of lost messages, points or ranges, by reason.
    lost: BTreeMap<&'static str, u64>,
    /// Number of messages or points with a remark that isn't a loss, by the remark's text.
    noted: BTreeMap<&'static str, u64>,
}

/// Losses of the parts of an inertial message whose variances are too large.
const UNCERTAIN_PARTS: [&str; 3] = [
    "readings of orientation whose variance exceeds the noise in [navigation] of the vehicle file, withheld",
    "readings of turn rate whose sd exceeds 10 times the noise of `gyro_noise_degps_rthz`, withheld",
    "readings of specific force whose sd exceeds 10 times the noise of `accel_noise_mps2_rthz`, withheld",
];

/// Lowest plausible pressure under water, Pa: half an atmosphere.
const LEAST_PA: f64 = 50_000.0;

impl Feed {
    pub(super) fn new(of: Type, sensor: EmulatedSensor, manner: Manner) -> Self {
        Self {
            of,
            sensor,
            manner,
            clocks: Clocks::new(manner.base),
            taken: 0,
            frame_id: None,
            other_frames: 0,
            upward_mps2: 0.0,
            highest_pa: 0.0,
            lost: BTreeMap::new(),
            noted: BTreeMap::new(),
        }
    }

    pub(super) fn is_of(&self, of: Type) -> bool {
        self.of == of
    }

    pub(super) fn is_of_head(&self) -> bool {
        self.sensor.is_head()
    }

    pub(super) fn sensor_id(&self) -> &str {
        &self.sensor.id
    }

    /// Converts a message into entries. If the conversion fails, counts the message as lost.
    pub(super) fn take(&mut self, encoding: Encoding, record_ns: u64, bytes: &[u8], out: &mut Vec<Entry>) {
        self.taken += 1;
        let taken = read(self.of, encoding, bytes).and_then(|read| self.values(&read, record_ns, out));
        if let Err(why) = taken {
            *self.lost.entry(why).or_default() += 1;
        }
    }

    fn values(&mut self, read: &Read<'_>, record_ns: u64, out: &mut Vec<Entry>) -> Result<(), &'static str> {
        if let Some(header) = read.header {
            let first = self.frame_id.get_or_insert_with(|| header.frame_id.to_vec());
            self.other_frames += u64::from(first != header.frame_id);
        }
        let (at_ns, stamped) = self.clocks.time(record_ns, read.header.map(|header| header.stamp_ns));
        let value = match &read.values {
            Values::Beams(beams) => return self.beams(beams, (at_ns, stamped), out),
            Values::Inertial { wxyz, rate_radps, force_mps2, variances } => {
                let is_present = [wxyz.is_some(), rate_radps.is_some(), force_mps2.is_some()];
                let [_, has_rate, has_force] = is_present;
                let [attitude, rate, force] = self.sensor.are_certain(*variances, has_rate, has_force);
                let is_withheld = [!attitude, !rate, !force];
                for ((is_present, is_withheld), why) in
                    is_present.into_iter().zip(is_withheld).zip(UNCERTAIN_PARTS)
                {
                    if is_present && is_withheld {
                        *self.lost.entry(why).or_default() += 1;
                    }
                }
                self.inertia(
                    wxyz.filter(|_| attitude),
                    rate_radps.filter(|_| rate),
                    force_mps2.filter(|_| force),
                )?
            }
            Values::Range(range_m) => Value::Range(range_m.map(|range_m| self.true_range_m(range_m))),
            Values::Scalar(value) if !value.is_finite() => return Err("whose value isn't a number"),
            Values::Scalar(value) if self.of == Type::FluidPressure => {
                let zero_pa = if self.manner.is_gauge { self.sensor.site.surface_pressure_pa } else { 0.0 };
                let pressure_pa = zero_pa + value * self.manner.unit;
                self.highest_pa = self.highest_pa.max(pressure_pa);
                Value::Pressure(pressure_pa)
            }
            Values::Scalar(value) => Value::Payout(value * self.manner.unit),
            Values::Velocity(velocity) if velocity.iter().all(|part| part.is_finite()) => {
                Value::Velocity(*velocity)
            }
            Values::Velocity(_) => return Err("whose value isn't a number"),
        };
        let mut doubt = read.doubt;
        doubt.variance *= self.manner.unit * self.manner.unit;
        match self.say((at_ns, stamped), &value, &doubt, out) {
            Ok(()) => Ok(()),
            Err(Unsent::Unencodable) => Err("with values that the sensor can't encode"),
            Err(Unsent::Doubtful(why)) => Err(why),
        }
    }

    /// Converts a range from the speed of sound of the recording to that of the site.
    fn true_range_m(&self, range_m: f64) -> f64 {
        let site = self.sensor.site;
        self.manner.sound_speed_mps.map_or(range_m, |mps| site.rescaled_range_m(range_m, mps))
    }

    /// Converts an inertial message. Attitude, turn rate or force may be missing, but not all three.
    fn inertia(
        &mut self,
        wxyz: Option<[f64; 4]>,
        rate: Option<[f64; 3]>,
        force: Option<[f64; 3]>,
    ) -> Result<Value, &'static str> {
        if wxyz.is_none() && rate.is_none() && force.is_none() {
            return Err("without orientation, turn rate and specific force");
        }
        let nowhere = || Rot::from_roll_pitch_yaw(f64::NAN, f64::NAN, f64::NAN);
        let length = |[w, x, y, z]: [f64; 4]| w * w + x * x + y * y + z * z;
        let attitude = match wxyz {
            Some(wxyz) if (0.81..=1.21).contains(&length(wxyz)) => {
                let [w, x, y, z] = wxyz;
                Rot::from_wxyz(w, x, y, z).unwrap_or_else(nowhere)
            }
            Some(_) => return Err("whose orientation isn't a unit quaternion"),
            None => nowhere(),
        };
        for (missing, what) in [
            (wxyz.is_none(), "without orientation"),
            (rate.is_none(), "without turn rate"),
            (force.is_none(), "without specific force"),
        ] {
            if missing {
                *self.noted.entry(what).or_default() += 1;
            }
        }
        let [_, _, upward_mps2] = force.unwrap_or_default();
        self.upward_mps2 += upward_mps2;
        let unknown = [f64::NAN; 3];
        Ok(Value::Inertia(attitude, rate.unwrap_or(unknown), force.unwrap_or(unknown)))
    }

    /// Converts the beams of a message.
    ///
    /// Beam times count from the first beam if the time comes from the message's header. Otherwise the last beam is
    /// taken as measured at the time of recording.
    fn beams(&mut self, beams: &Beams, at: (u64, bool), out: &mut Vec<Entry>) -> Result<(), &'static str> {
        let valid = beams.valid(self.manner.plane)?;
        for (count, what) in [(valid.nowhere, "points without a position: no echo, at an unknown angle")] {
            if count > 0 {
                *self.noted.entry(what).or_default() += count;
            }
        }
        if valid.off_plane > 0 {
            *self.lost.entry("points outside the beam's plane of rotation (`plane`)").or_default() +=
                valid.off_plane;
        }
        let last_s = valid.beams.last().map_or(0.0, |beam| beam.after_s);
        let first_s = valid.beams.first().map_or(0.0, |beam| beam.after_s);
        if valid.beams.len() > 1 && last_s <= first_s {
            *self.noted.entry("with several beams and no times: all beams get the same time").or_default() +=
                1;
        }
        let mut unsaid = 0_u64;
        let mut beyond = 0_u64;
        for Beam { angle_rad, range_m, after_s } in &valid.beams {
            let from_s = if at.1 { *after_s } else { after_s - last_s };
            let at_ns = at.0.saturating_add_signed(headrace_geometry::time::DurNs::from_secs_f64(from_s).0);
            let range_m = range_m.map(|range_m| self.true_range_m(range_m));
            let (value, is_beyond) = self.sensor.within_reach(Value::Beam(*angle_rad, range_m));
            beyond += u64::from(is_beyond);
            unsaid += u64::from(self.say((at_ns, at.1), &value, &Doubt::NONE, out).is_err());
        }
        if beyond > 0 {
            *self.lost.entry(BEYOND).or_default() += beyond;
        }
        if unsaid > 0 { Err("with beams that the sensor can't encode") } else { Ok(()) }
    }

    /// Encodes a value as entries.
    ///
    /// If the value's time comes from a message's header, the receive time is later by the sensor's own delays.
    /// Otherwise the receive time is the given time.
    fn say(
        &mut self,
        (at_ns, stamped): (u64, bool),
        value: &Value,
        doubt: &Doubt,
        out: &mut Vec<Entry>,
    ) -> Result<(), Unsent> {
        let stream = self.sensor.id.clone();
        self.sensor.tell(MonoNs(at_ns), value, doubt, &mut |received, bytes| {
            let stamp_ns = if stamped { received.0 } else { at_ns };
            out.push(Entry { stamp_ns, stream: stream.clone(), bytes: bytes.to_vec() });
        })
    }

    /// Adds the topic's losses and remarks to the report.
    pub(super) fn tell(&self, topic: &str, report: &mut ImportReport) {
        let counted = |counts: &BTreeMap<&'static str, u64>| -> Vec<String> {
            counts.iter().map(|(why, count)| format!("{topic}: {count} {}{why}", messages(why))).collect()
        };
        report.losses.extend(counted(&self.lost));
        report.remarks.extend(counted(&self.noted));
        let mut remark = |words: String| report.remarks.push(format!("{topic}: {words}"));
        for words in self.clocks.words() {
            remark(words);
        }
        if self.taken == 0 {
            remark(format!("no message for {}", self.sensor_id()));
        }
        if self.other_frames > 0 {
            let (count, first) = (self.other_frames, self.frame_id.as_deref().unwrap_or_default());
            let first = String::from_utf8_lossy(first);
            remark(format!(
                "{count} messages have another frame than the first, {first:?}; the one mount in the vehicle file is used for all"
            ));
        }
        let upward_mps2 = self.upward_mps2 / self.taken.max(1) as f64;
        if upward_mps2 < -4.0 {
            remark(format!(
                "specific force along z is {upward_mps2:.1} m/s^2 on average, so the sensor's z axis points down; set `angles_deg` of {} accordingly",
                self.sensor_id()
            ));
        }
        if self.of == Type::FluidPressure && self.taken > 0 && self.highest_pa < LEAST_PA {
            let highest_pa = self.highest_pa;
            remark(format!(
                "no pressure is above {highest_pa:.1} Pa, which is less than air pressure; set `unit`, or `quantity = \"gauge_pressure\"`, in the mapping"
            ));
        }
        let has_ranges = matches!(self.of.sense(), Sense::Head | Sense::Echosounder);
        if has_ranges && self.manner.sound_speed_mps.is_none() {
            remark(self.sensor.assumed_speed());
        }
    }
}

/// Returns "messages " as the unit in which losses are counted. Empty if the reason `why` begins with its own unit.
fn messages(why: &str) -> &'static str {
    if ["points", "ranges", "readings"].iter().any(|unit| why.starts_with(unit)) { "" } else { "messages " }
}
