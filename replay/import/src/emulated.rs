//! Emulates a sensor of the vehicle file. It encodes values of a foreign log as the bytes that the sensor would have
//! sent.

use headrace_config::{ConfigError, Section};
use headrace_geometry::frames::{Rot, Sensor, Vec3};
use headrace_geometry::math;
use headrace_geometry::site::Site;
use headrace_geometry::time::{DurNs, MonoNs};
use headrace_sampling::head::HeadProgram;
use headrace_sensor::device::{Device, Direction, Emulated, EmulatorSetup, Sense};
use headrace_sensor::measurement::{GroundVelocity, Inertia, Payout, Pressure, Sounding};
use headrace_sensor::reading::Level;
use headrace_vehicle::VehicleConfig;

/// Period between emulated inertial samples. Foreign logs don't state the period.
const PERIOD: DurNs = DurNs(10_000_000);

/// A measured value, for an emulator to encode.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Value {
    /// A beam of a head: its angle, and its range if there was an echo.
    Beam(f64, Option<f64>),
    /// Range of an echosounder, m; `None` without an echo.
    Range(Option<f64>),
    /// Absolute pressure at a depth sensor, Pa.
    Pressure(f64),
    /// Attitude, turn rate, rad/s, and specific force, m/s^2, of an inertial unit. Parts that were not measured are
    /// NaN.
    Inertia(Rot<Level, Sensor>, [f64; 3], [f64; 3]),
    /// Velocity over ground from a velocity log, m/s.
    Velocity([f64; 3]),
    /// Chainage from a cable counter, computed from the length of cable paid out, m.
    Payout(f64),
}

impl Value {
    /// Whether the measured value is possible, by limits far beyond the values in tunnels.
    ///
    /// Larger values must be refused, because wire formats turn them into plausible values by wrapping or clamping.
    fn is_possible(&self) -> bool {
        let within = |values: &[f64], most: f64| values.iter().all(|value| value.abs() <= most);
        // A NaN means "not measured", which is allowed.
        let known =
            |values: &[f64; 3], most: f64| values.iter().all(|value| value.is_nan() || value.abs() <= most);
        match self {
            Self::Beam(angle_rad, range_m) => within(&[*angle_rad, range_m.unwrap_or(0.0)], 1e5),
            Self::Range(range_m) => within(&[range_m.unwrap_or(0.0)], 1e5),
            Self::Pressure(pressure_pa) => (0.0..=1e9).contains(pressure_pa),
            Self::Inertia(_, rate, force) => known(rate, 1e3) && known(force, 1e4),
            Self::Velocity(velocity) => within(velocity, 1e3),
            Self::Payout(chainage_m) => within(&[*chainage_m], 1e6),
        }
    }
}

/// Doubt that a foreign log states about a value.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Doubt {
    /// Confidence in a range, 0 to 1.
    pub(super) confidence: f64,
    /// Variance of the value, in the square of its SI unit; 0 if it isn't stated.
    pub(super) variance: f64,
    /// Whether the value is marked as valid.
    pub(super) is_valid: bool,
    /// Status of the device; 0 without a fault.
    pub(super) status: u8,
}

impl Doubt {
    /// No doubt is stated.
    pub(super) const NONE: Self = Self { confidence: 1.0, variance: 0.0, is_valid: true, status: 0 };
}

/// Reason why a value isn't encoded.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Unsent {
    /// The value is impossible, or the sensor can't encode it.
    Unencodable,
    /// The log states a doubt, as text, for which the sensor's messages have no field.
    Doubtful(&'static str),
}

/// Loss of readings whose variance exceeds the noise that navigation assumes.
pub(super) const TOO_UNCERTAIN: &str =
    "readings whose variance exceeds the noise in [navigation] of the vehicle file, withheld";

/// Largest stated sd of a turn rate or force, as a multiple of the noise that the filter assumes.
///
/// The noise is that of a sample of [`PERIOD`]. Stated sds contain more than white noise, such as the bias. The factor of
/// 10 allows for this. It is a choice, not a measurement.
const INERTIAL_SD_FACTOR: f64 = 10.0;

/// Least confidence of a range that a head reports as certain. The same limit is the default of echosounders.
const LEAST_CONFIDENCE: f64 = 0.5;

/// Remark in the import's report, for ranges outside a head's range setting.
pub(super) const BEYOND: &str = "ranges outside the head's range setting, imported as pings without an echo";

/// A sensor of the vehicle file, with the emulator that encodes its values.
pub(super) struct EmulatedSensor {
    pub(super) id: String,
    pub(super) sense: Sense,
    /// For a head, least and greatest measurable range, m, at the site's speed of sound.
    reach_m: Option<[f64; 2]>,
    /// Properties of the water, which convert values to those that the sensor measures.
    pub(super) site: Site,
    /// Noise variance that the vehicle file states for the sensor, in the square of the SI unit.
    usual_variance: f64,
    /// Largest variances of an inertial unit's tilt without turn rate or specific force, of its heading, turn rate and
    /// specific force.
    inertial_variances: [f64; 4],
    emulated: Emulated,
}

impl EmulatedSensor {
    /// Finds the sensor named by `sensor` in a table of the mapping.
    ///
    /// Errors: the vehicle file has no such sensor.
    pub(super) fn named(
        section: &Section<'_>,
        vehicle: &VehicleConfig,
        id: &str,
    ) -> Result<Self, ConfigError> {
        Self::all(vehicle).find(|(config_id, _)| *config_id == id).map_or_else(
            || {
                let ids: Vec<&str> = Self::all(vehicle).map(|(id, _)| id).collect();
                let problem = format!("isn't a sensor of the vehicle file, which has {}", ids.join(", "));
                Err(section.invalid("sensor", &problem))
            },
            |(id, device)| Ok(Self::new(id, device, vehicle)),
        )
    }

    /// Returns the sensors of a vehicle file, with their ids.
    pub(super) fn all(vehicle: &VehicleConfig) -> impl Iterator<Item = (&str, &dyn Device)> {
        let ids = vehicle.sensor_configs.iter().map(|config| config.id.as_str());
        ids.zip(vehicle.sensors.iter().map(|device| &**device))
    }

    pub(super) fn new(id: &str, device: &dyn Device, vehicle: &VehicleConfig) -> Self {
        let program = HeadProgram { start_rad: 0.0, growing: true, sector: None };
        let head = device.head();
        let setup = EmulatorSetup {
            start: MonoNs(0),
            head: head.as_ref().map(|_| program),
            site: vehicle.site,
            polled: true,
        };
        let site = vehicle.site;
        let navigation = vehicle.navigation.settings();
        let declared = navigation.usual_variance(device.specification().kind);
        let pa_per_m = site.density_kgpm3 * site.gravity_mps2;
        let deviation = navigation.heading.reach;
        let most_variance = |density: f64| {
            let sd = INERTIAL_SD_FACTOR * density;
            sd * sd / PERIOD.as_secs_f64()
        };
        Self {
            id: id.to_owned(),
            sense: device.sense(),
            reach_m: head.map(|head| head.reach_m(site.sound_speed_mps)),
            site,
            // The noise of a depth sensor is declared in metres.
            usual_variance: declared * if device.sense() == Sense::Depth { pa_per_m * pa_per_m } else { 1.0 },
            inertial_variances: [
                navigation.attitude_sd_rad * navigation.attitude_sd_rad,
                navigation.heading_sd_rad * navigation.heading_sd_rad + deviation * deviation,
                most_variance(navigation.rate_noise),
                most_variance(navigation.force_noise),
            ],
            emulated: device.emulator(&setup),
        }
    }

    /// Returns whether orientation, turn rate and specific force of an inertial unit have variances that their messages
    /// need not state. `variances` are those of tilt, heading, turn rate and specific force. `has_rate` and `has_force`
    /// tell whether the message has a turn rate and a specific force.
    pub(super) fn are_certain(
        &self,
        [tilt, heading, rate, force]: [f64; 4],
        has_rate: bool,
        has_force: bool,
    ) -> [bool; 3] {
        let [tilt_alone, most_heading, most_rate, most_force] = self.inertial_variances;
        let (is_rate_certain, is_force_certain) = (rate <= most_rate, force <= most_force);
        // The filter assumes less noise of the tilt if turn rate or specific force is missing.
        let is_complete = has_rate && is_rate_certain && has_force && is_force_certain;
        let most_tilt = if is_complete { self.usual_variance } else { tilt_alone };
        [tilt <= most_tilt && heading <= most_heading, is_rate_certain, is_force_certain]
    }

    /// Returns the doubt about a value for which the sensor's messages have no field, as text.
    fn doubt_without_field(&self, doubt: &Doubt) -> Option<&'static str> {
        let has_confidence = matches!(self.emulated, Emulated::Echosounder(_));
        let has_validity = matches!(self.emulated, Emulated::VelocityLog(_));
        if has_validity && (!doubt.is_valid || doubt.status != 0) {
            // The replay withholds the reading because of its validity or status.
            None
        } else if !doubt.is_valid {
            Some("readings marked as invalid, withheld: the sensor's messages have no field for this")
        } else if doubt.status != 0 {
            Some("readings with a status other than 0, withheld: the sensor's messages have no field for it")
        } else if !has_confidence && doubt.confidence < LEAST_CONFIDENCE {
            Some(
                "readings with a confidence below 50 %, withheld: the sensor's messages have no field for it",
            )
        } else if doubt.variance <= self.usual_variance {
            None
        } else {
            Some(TOO_UNCERTAIN)
        }
    }

    /// Remark on ranges for which the recording's speed of sound isn't stated.
    pub(super) fn assumed_speed(&self) -> String {
        let (id, mps) = (&self.id, self.site.sound_speed_mps);
        format!(
            "ranges of {id} count as computed with the speed of sound of the site, {mps} m/s; if the device used another, set `sound_speed_mps` in the mapping"
        )
    }

    /// Whether the sensor is a head.
    pub(super) fn is_head(&self) -> bool {
        self.reach_m.is_some()
    }

    /// Returns the value that the sensor can report instead of `value`, and whether the two values differ.
    ///
    /// A beam whose range is outside the head's range setting becomes a beam without an echo.
    pub(super) fn within_reach(&self, value: Value) -> (Value, bool) {
        match (value, self.reach_m) {
            (Value::Beam(angle_rad, Some(range_m)), Some([least_m, most_m]))
                if !(least_m..=most_m).contains(&range_m) =>
            {
                (Value::Beam(angle_rad, None), true)
            }
            (value, _) => (value, false),
        }
    }

    /// Emits the bytes that the sensor would have sent, with their receive times.
    ///
    /// Errors: the value is impossible, the sensor can't encode it, or its messages have no field for its doubt.
    pub(super) fn tell(
        &mut self,
        at: MonoNs,
        value: &Value,
        doubt: &Doubt,
        sink: &mut dyn FnMut(MonoNs, &[u8]),
    ) -> Result<(), Unsent> {
        if let Some(why) = self.doubt_without_field(doubt) {
            return Err(Unsent::Doubtful(why));
        }
        if !value.is_possible() {
            return Err(Unsent::Unencodable);
        }
        let mut is_sent = false;
        let mut line = |direction, at: MonoNs, bytes: &[u8]| {
            if direction == Direction::Received && !bytes.is_empty() {
                is_sent = true;
                sink(at, bytes);
            }
        };
        let vector = |[x, y, z]: [f64; 3]| Vec3::new(x, y, z);
        match (&mut self.emulated, *value) {
            (Emulated::Head(device), Value::Beam(angle_rad, range_m)) => {
                device.tell(&Sounding { range_m, ..Sounding::due(at, angle_rad) }, &mut line);
            }
            (Emulated::Echosounder(device), Value::Range(range_m)) => {
                let confidence = doubt.confidence;
                device.tell(&Sounding { range_m, confidence, ..Sounding::due(at, 0.0) }, &mut line);
            }
            (Emulated::Depth(device), Value::Pressure(pressure_pa)) => {
                device.tell(&Pressure { at, pressure_pa }, &mut line);
            }
            (Emulated::Inertial(device), Value::Inertia(attitude, rate, force)) => {
                let (rate_radps, force_mps2) = (vector(rate), vector(force));
                let motion = Inertia { at, period: PERIOD, attitude, rate_radps, force_mps2 };
                device.tell(&motion, &mut line);
            }
            (Emulated::VelocityLog(device), Value::Velocity(velocity)) => {
                let is_stated = doubt.variance.is_finite() && doubt.variance >= 0.0;
                let motion = GroundVelocity {
                    at,
                    velocity_mps: vector(velocity),
                    fom_mps: (is_stated && doubt.variance > 0.0).then(|| math::sqrt(doubt.variance)),
                    is_valid: doubt.is_valid && is_stated,
                    status: doubt.status,
                };
                device.tell(&motion, &mut line);
            }
            (Emulated::Tether(device), Value::Payout(chainage_m)) => {
                device.tell(&Payout { at, chainage_m }, &mut line);
            }
            _ => (),
        }
        if is_sent { Ok(()) } else { Err(Unsent::Unencodable) }
    }
}
