//! Measurements of simulated devices, before they are encoded.
//!
//! An emulated device sets the time and, for a head, the angle of each measurement. The simulation fills in the value,
//! and the device encodes the measurement.

use super::reading::Level;
use headrace_geometry::frames::{Rot, Sensor, Vec3};
use headrace_geometry::time::{DurNs, MonoNs};

/// A simulated measurement of any kind of device.
pub trait Measurement: Copy + Send + Sync + 'static {
    /// Returns the true time of validity of the measurement.
    fn at(&self) -> MonoNs;

    /// Sets the measurement's true time of validity.
    fn set_at(&mut self, at: MonoNs);
}

/// A ping of a profiling head, or of a fixed echosounder whose beam is along its x axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sounding {
    /// Time of the ping.
    pub at: MonoNs,
    /// True angle of a profiling head's beam in the sensor's frame, radians; unused for an echosounder.
    pub angle_rad: f64,
    /// Beam angle reported by the head, radians.
    pub reported_rad: f64,
    /// Range in water at the site's speed of sound, m; `None` without an echo.
    pub range_m: Option<f64>,
    /// Confidence of an echosounder in the range, 0 to 1; unused for a profiling head.
    pub confidence: f64,
}

/// Simulated water pressure at a depth sensor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pressure {
    /// Time of validity of the pressure.
    pub at: MonoNs,
    /// Absolute pressure of the water, Pa.
    pub pressure_pa: f64,
}

/// A sample of an inertial unit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Inertia {
    /// Time of validity of the sample.
    pub at: MonoNs,
    /// Period between two samples.
    pub period: DurNs,
    /// Attitude: rotation from the sensor's frame to the level frame.
    pub attitude: Rot<Level, Sensor>,
    /// Mean turn rate over the sample period, rad/s.
    pub rate_radps: Vec3<Sensor>,
    /// Mean acceleration minus gravity over the sample period, m/s^2.
    pub force_mps2: Vec3<Sensor>,
}

/// Simulated velocity over ground at a velocity log.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GroundVelocity {
    /// Time of validity of the velocity.
    pub at: MonoNs,
    /// Velocity of the sensor itself, m/s. It includes the motion by the vehicle's rotation.
    pub velocity_mps: Vec3<Sensor>,
    /// Figure of merit: standard deviation of the velocity, m/s; `None` for the device's usual value.
    pub fom_mps: Option<f64>,
    /// Whether the device marks the velocity as valid.
    pub is_valid: bool,
    /// Status of the device; 0 without a fault.
    pub status: u8,
}

/// Simulated length of cable paid out into the tunnel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Payout {
    /// Time of validity of the length.
    pub at: MonoNs,
    /// Chainage that the cable's end has reached, m.
    pub chainage_m: f64,
}

macro_rules! measurement {
    ($($type:ident),*) => {
        $(impl Measurement for $type {
            fn at(&self) -> MonoNs {
                self.at
            }

            fn set_at(&mut self, at: MonoNs) {
                self.at = at;
            }
        })*
    };
}

measurement!(Sounding, Pressure, Inertia, GroundVelocity, Payout);

impl Sounding {
    /// Creates a scheduled ping that has no echo yet. An echo is certain unless the confidence is reduced.
    pub fn due(at: MonoNs, angle_rad: f64) -> Self {
        Self { at, angle_rad, reported_rad: angle_rad, range_m: None, confidence: 1.0 }
    }
}

impl Pressure {
    /// Creates a scheduled measurement that has no value yet.
    pub fn due(at: MonoNs) -> Self {
        Self { at, pressure_pa: 0.0 }
    }
}

impl Inertia {
    /// Creates a scheduled sample of an inertial unit that has no values yet.
    pub fn due(at: MonoNs, period: DurNs) -> Self {
        let (attitude, rate_radps, force_mps2) = (Rot::identity(), Vec3::zero(), Vec3::zero());
        Self { at, period, attitude, rate_radps, force_mps2 }
    }
}

impl GroundVelocity {
    /// Creates a scheduled measurement that has no value yet.
    pub fn due(at: MonoNs) -> Self {
        Self { at, velocity_mps: Vec3::zero(), fom_mps: None, is_valid: true, status: 0 }
    }
}

impl Payout {
    /// Creates a scheduled reading of a cable counter that has no value yet.
    pub fn due(at: MonoNs) -> Self {
        Self { at, chainage_m: 0.0 }
    }
}
