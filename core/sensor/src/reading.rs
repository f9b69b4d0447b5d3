//! What sensors say, freed of their protocols: the values that decoders hand to the loop.

use serde::{Deserialize, Serialize};

use headrace_geometry::frames::{Rot, Sensor, Vec3};
use headrace_geometry::time::MonoNs;

/// An IMU's own level reference: z up, x where its yaw is zero (magnetic or arbitrary north).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Level {}

/// The most sources that one loop takes.
pub const MAX_SOURCES: usize = 64;

/// A registered source of bytes; also the second key of the total order of messages.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct SourceId(pub u16);

impl SourceId {
    /// Index into per-source tables.
    pub fn index(self) -> usize {
        usize::from(self.0)
    }
}

/// Bytes as they came from a device, or from a log of it.
#[derive(Debug, Clone, Copy)]
pub struct Packet<'a> {
    /// When the first byte came.
    pub received: MonoNs,
    /// The bytes.
    pub bytes: &'a [u8],
}

/// One value of a sensor, in SI units and the sensor's own frame.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum Reading {
    /// A ping of a profiling head.
    Sonar(SonarReturn),
    /// A ping of a fixed echosounder, which looks along its own x.
    Echo(EchoRange),
    /// Absolute pressure of the water.
    Pressure(WaterPressure),
    /// Orientation that the device has computed: its own frame to level.
    Attitude(Rot<Level, Sensor>),
    /// Turn rate, rad/s.
    AngularRate(Vec3<Sensor>),
    /// Acceleration less gravity (specific force), m/s^2: at rest and level it is +9.8 along z.
    SpecificForce(Vec3<Sensor>),
    /// Velocity over ground, m/s.
    VelocityOverGround(Vec3<Sensor>),
    /// Cable paid out, or another measure of distance gone.
    TetherLength(TetherLength),
}

impl Reading {
    /// Whether every number of it is finite.
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
    /// Head angle in the sensor's frame, radians: 0 down, growing clockwise seen along +x; any turn.
    pub angle_rad: f64,
    /// Slant range in metres as the device computed it, or `None` where nothing was above its threshold.
    pub range_m: Option<f64>,
    /// Quantum of that range.
    pub resolution_m: f64,
    /// The range that the head was set to.
    pub max_range_m: f64,
    /// Speed of sound with which the device computed the range.
    pub sound_speed_mps: f64,
}

/// A ping of a fixed echosounder.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct EchoRange {
    /// Distance in metres as the device computed it; `None` where it found no echo.
    pub range_m: Option<f64>,
    /// The device's own confidence, 0 to 1.
    pub confidence: f64,
    /// Speed of sound with which the device computed the range.
    pub sound_speed_mps: f64,
}

/// Absolute pressure of the water.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct WaterPressure {
    /// Absolute pressure, Pa.
    pub pressure_pa: f64,
    /// Quantum of the pressure, Pa.
    pub resolution_pa: f64,
    /// Water temperature, degrees Celsius.
    pub temperature_degc: f64,
}

/// Cable paid out.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct TetherLength {
    /// Metres since the counter's zero, growing as the vehicle goes in.
    pub length_m: f64,
    /// Quantum of the length.
    pub resolution_m: f64,
}

/// A reading and the moment for which it is valid.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Decoded {
    /// Time of validity: the receive time less what the decoder knows of the delays.
    pub valid_at: MonoNs,
    /// The value.
    pub reading: Reading,
}
