//! What simulated devices measure, between the water and the wire: an emulated device says when and at which angle it
//! measures, a simulation says what it feels, and the device puts that into bytes.

use super::reading::Level;
use headrace_geometry::frames::{Rot, Sensor, Vec3};
use headrace_geometry::time::{DurNs, MonoNs};

/// One measurement of a device of some kind.
pub trait Measurement: Copy + Send + Sync + 'static {
    /// The true moment for which it is valid.
    fn at(&self) -> MonoNs;

    /// Moves that moment.
    fn set_at(&mut self, at: MonoNs);
}

/// A ping of a profiling head or of a fixed echosounder, which looks along its own x.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sounding {
    /// When it pings.
    pub at: MonoNs,
    /// Where a head's beam truly points, in the sensor's frame, radians; no matter to an echosounder.
    pub angle_rad: f64,
    /// Where the head says that it points.
    pub reported_rad: f64,
    /// What it hears, in metres of water at the site's speed of sound; `None` where it hears nothing.
    pub range_m: Option<f64>,
}

/// Pressure of the water at a depth sensor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pressure {
    /// When.
    pub at: MonoNs,
    /// Absolute, Pa.
    pub pressure_pa: f64,
}

/// What an inertial unit feels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Inertia {
    /// When.
    pub at: MonoNs,
    /// From sample to sample.
    pub period: DurNs,
    /// Sensor to level.
    pub attitude: Rot<Level, Sensor>,
    /// Turn rate, mean over the period, rad/s.
    pub rate_radps: Vec3<Sensor>,
    /// Acceleration less gravity, mean over the period, m/s^2.
    pub force_mps2: Vec3<Sensor>,
}

/// Velocity over ground at a velocity log.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GroundVelocity {
    /// When.
    pub at: MonoNs,
    /// Of the sensor itself, turning included, m/s.
    pub velocity_mps: Vec3<Sensor>,
}

/// How far into the tunnel the cable has been paid out.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Payout {
    /// When.
    pub at: MonoNs,
    /// Chainage that the cable reaches, m.
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
    /// A ping that is still to be heard.
    pub fn due(at: MonoNs, angle_rad: f64) -> Self {
        Self { at, angle_rad, reported_rad: angle_rad, range_m: None }
    }
}

impl Pressure {
    /// A measurement that is still to be made.
    pub fn due(at: MonoNs) -> Self {
        Self { at, pressure_pa: 0.0 }
    }
}

impl Inertia {
    /// A sample that is still to be taken.
    pub fn due(at: MonoNs, period: DurNs) -> Self {
        let (attitude, rate_radps, force_mps2) = (Rot::identity(), Vec3::zero(), Vec3::zero());
        Self { at, period, attitude, rate_radps, force_mps2 }
    }
}

impl GroundVelocity {
    /// A measurement that is still to be made.
    pub fn due(at: MonoNs) -> Self {
        Self { at, velocity_mps: Vec3::zero() }
    }
}

impl Payout {
    /// A count that is still to be made.
    pub fn due(at: MonoNs) -> Self {
        Self { at, chainage_m: 0.0 }
    }
}
