//! Emulates a sensor of the vehicle file. It encodes values of a foreign log as the bytes that the sensor would have
//! sent.

use headrace_config::{ConfigError, Section};
use headrace_geometry::frames::{Rot, Sensor, Vec3};
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

/// Remark in the import's report, for ranges outside a head's range setting.
pub(super) const BEYOND: &str = "ranges outside the head's range setting, imported as pings without an echo";

/// A sensor of the vehicle file, with the emulator that encodes its values.
pub(super) struct EmulatedSensor {
    pub(super) id: String,
    pub(super) sense: Sense,
    /// For a head, least and greatest measurable range, m, at the site's speed of sound.
    reach_m: Option<[f64; 2]>,
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
        let reach_m = head.map(|head| head.reach_m(vehicle.site.sound_speed_mps));
        Self { id: id.to_owned(), sense: device.sense(), reach_m, emulated: device.emulator(&setup) }
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
    /// Returns `false` if the value is impossible, or the sensor can't encode it.
    pub(super) fn tell(&mut self, at: MonoNs, value: &Value, sink: &mut dyn FnMut(MonoNs, &[u8])) -> bool {
        if !value.is_possible() {
            return false;
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
                device.tell(&Sounding { range_m, ..Sounding::due(at, 0.0) }, &mut line);
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
                device.tell(&GroundVelocity { at, velocity_mps: vector(velocity) }, &mut line);
            }
            (Emulated::Tether(device), Value::Payout(chainage_m)) => {
                device.tell(&Payout { at, chainage_m }, &mut line);
            }
            _ => return false,
        }
        is_sent
    }
}
