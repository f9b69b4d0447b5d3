//! Protocol-independent sensor readings: the values that decoders pass to the loop.

use serde::{Deserialize, Serialize};

use headrace_geometry::frames::{Rot, Sensor, Vec3};
use headrace_geometry::time::MonoNs;

/// Level reference frame of an IMU: z is up, and x is the direction of zero yaw (magnetic or arbitrary north).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Level {}

/// Maximum number of sources in one loop.
pub const MAX_SOURCES: usize = 64;

/// Number of a registered source of bytes. Messages with equal times are in the order of their sources' numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct SourceId(pub u16);

impl SourceId {
    /// Index of this source in tables with one entry per source.
    pub fn index(self) -> usize {
        usize::from(self.0)
    }
}

/// Bytes received from a device, or read from a log.
#[derive(Debug, Clone, Copy)]
pub struct Packet<'a> {
    /// Receive time of the first byte.
    pub received: MonoNs,
    /// The received bytes.
    pub bytes: &'a [u8],
}

/// One value of a sensor, in SI units and the sensor's frame.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum Reading {
    /// A ping of a profiling head.
    Sonar(SonarReturn),
    /// A ping of a fixed echosounder, whose beam is along its x axis.
    Echo(EchoRange),
    /// Absolute pressure of the water.
    Pressure(WaterPressure),
    /// Orientation computed by the device: rotation from the sensor's frame to the level frame.
    Attitude(Rot<Level, Sensor>),
    /// Turn rate of the sensor, rad/s.
    AngularRate(Vec3<Sensor>),
    /// Acceleration minus gravity (specific force), m/s^2; +9.8 along z if the sensor is at rest and level.
    SpecificForce(Vec3<Sensor>),
    /// Velocity of the sensor over ground, m/s.
    VelocityOverGround(Vec3<Sensor>),
    /// Length of cable paid out, or another measure of the distance travelled.
    TetherLength(TetherLength),
}

impl Reading {
    /// Whether all numbers in the reading are finite.
    pub fn is_finite(&self) -> bool {
        let all = |numbers: &[f64]| numbers.iter().all(|number| number.is_finite());
        match self {
            Self::Sonar(sonar) => all(&[
                sonar.angle_rad,
                sonar.range_m.unwrap_or(0.0),
                sonar.resolution_m,
                sonar.max_range_m,
                sonar.sound_speed_mps,
            ]),
            Self::Echo(echo) => all(&[echo.range_m.unwrap_or(0.0), echo.confidence, echo.sound_speed_mps]),
            Self::Pressure(water) => all(&[water.pressure_pa, water.resolution_pa]),
            Self::Attitude(rotation) => all(&rotation.wxyz()),
            Self::AngularRate(vector) | Self::SpecificForce(vector) | Self::VelocityOverGround(vector) => {
                vector.is_finite()
            }
            Self::TetherLength(length) => all(&[length.length_m, length.resolution_m]),
        }
    }
}

/// A ping of a profiling head.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct SonarReturn {
    /// Head angle in the sensor's frame, radians: 0 is down, and angles increase clockwise as seen along +x.
    ///
    /// The angle may exceed one turn.
    pub angle_rad: f64,
    /// Slant range computed by the device, m; `None` if no echo exceeded its threshold.
    pub range_m: Option<f64>,
    /// Quantum (resolution step) of the range, m.
    pub resolution_m: f64,
    /// Range setting of the head, m.
    pub max_range_m: f64,
    /// Speed of sound used by the device to compute the range, m/s.
    pub sound_speed_mps: f64,
}

/// A ping of a fixed echosounder.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct EchoRange {
    /// Distance computed by the device, m; `None` if it found no echo.
    pub range_m: Option<f64>,
    /// The device's confidence in the distance, 0 to 1.
    pub confidence: f64,
    /// Speed of sound used by the device to compute the range, m/s.
    pub sound_speed_mps: f64,
}

/// Absolute pressure of the water.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct WaterPressure {
    /// Absolute pressure of the water, Pa.
    pub pressure_pa: f64,
    /// Quantum (resolution step) of the pressure, Pa.
    pub resolution_pa: f64,
    /// Water temperature, degrees Celsius.
    pub temperature_degc: f64,
}

/// A reading of a cable counter: length of cable paid out.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct TetherLength {
    /// Length counted since the counter's zero, m. It increases as the vehicle goes into the tunnel.
    pub length_m: f64,
    /// Quantum (resolution step) of the length, m.
    pub resolution_m: f64,
    /// Last restart of the cable counter from zero. `length_m` is continuous across the restart.
    pub restart: Option<CountRestart>,
}

/// A restart of the cable counter's count from zero.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct CountRestart {
    /// Number of the restart, from 1.
    pub number: u32,
    /// Whether the counter was silent before the restart, for instance because it was unplugged.
    pub was_away: bool,
}

/// A reading and its time of validity.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Decoded {
    /// Time of validity: the receive time minus the delays known to the decoder.
    pub valid_at: MonoNs,
    /// The sensor reading.
    pub reading: Reading,
}
