//! Interface of a device's crate: a kind that parses its part of a vehicle file, and for each configured sensor a driver,
//! a decoder and an emulator.
//!
//! Discovering and opening the port, decoding (pure) and applying (in the loop) are three separate things; this file
//! has the second, and the device's side of the wire for simulations.

use super::driver::{Carrier, Driver, DriverSetup, Probe};
use super::measurement::{GroundVelocity, Inertia, Payout, Pressure, Sounding};
use super::reading::{Decoded, Packet};
use crate::codec::CodecCounts;
use crate::device_clock::ClockReport;
use headrace_config::{ConfigError, Section};
use headrace_geometry::frames::{Mount, Rot, Vec3};
use headrace_geometry::site::Site;
use headrace_geometry::snapshot::Stateful;
use headrace_geometry::time::{DurNs, MonoNs};
use headrace_sampling::head::{HeadMode, HeadProgram, HeadSpec};
use serde::{Deserialize, Serialize};

/// Keys common to all `[[sensors]]` tables.
#[derive(Debug, Clone, PartialEq)]
pub struct SensorConfig {
    /// Name of the sensor and of its channel in the log.
    pub id: String,
    /// Kind of device.
    pub plugin: String,
    /// Connection, as written.
    pub connect: String,
    /// Mount on the vehicle.
    pub mount: Mount,
    /// Time from validity of a value to the receive time of its first byte.
    pub latency: DurNs,
}

/// A sensor as seen by navigation.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct SensorInfo {
    /// Mount on the vehicle.
    pub mount: Mount,
    /// Kind of sensor.
    pub kind: SensorKind,
}

impl SensorInfo {
    /// A sensor at the vehicle's origin, unused by navigation.
    pub fn other() -> Self {
        Self { mount: Mount { position: Vec3::zero(), rotation: Rot::identity() }, kind: SensorKind::Other }
    }
}

/// Kinds of sensor.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum SensorKind {
    /// A profiling head.
    Head,
    /// An echosounder; readings below `min_confidence` aren't used.
    Echosounder {
        /// Minimum confidence, 0 to 1.
        min_confidence: f64,
    },
    /// A pressure sensor.
    Depth,
    /// An inertial unit.
    Imu,
    /// A sonar that measures velocity over ground.
    VelocityLog,
    /// A cable counter.
    Tether {
        /// Chainage where it reads zero, m.
        zero_at_m: f64,
        /// Metres of chainage per metre of cable.
        scale: f64,
    },
    /// A source unused by navigation.
    Other,
}

/// Noise of an inertial unit by its maker's data sheet.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct InertialNoise {
    /// White noise of the gyros, quantisation included, rad/s/sqrt(Hz).
    pub rate_noise: f64,
    /// Bias of the gyros, rad/s.
    pub rate_bias: BiasSpec,
    /// White noise of the accelerometers, quantisation included, m/s^2/sqrt(Hz).
    pub force_noise: f64,
    /// Bias of the accelerometers, m/s^2.
    pub force_bias: BiasSpec,
}

/// Bias of an inertial sensor, in its unit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BiasSpec {
    /// Standard deviation at power-on, constant from then on.
    pub turn_on: f64,
    /// Standard deviation of its wandering while it runs.
    pub in_run: f64,
    /// Correlation time of the wandering, s.
    pub time_s: f64,
}

/// Step and noise of a cable counter, from its vehicle file or preset.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CounterSpec {
    /// Smallest change of the length, m; `None` if each reading carries it.
    pub step_m: Option<f64>,
    /// Noise without rounding, standard deviation, m; `None` if unknown.
    pub sd_m: Option<f64>,
}

/// One kind of device, by its name in vehicle files: `plugin = "imagenex881"`.
pub trait DeviceKind: Sync {
    /// The name in vehicle files and in the logs' channel metadata.
    fn name(&self) -> &'static str;

    /// Parses this kind's keys of a sensor's table. The common ones are in `sensor` already.
    ///
    /// Errors: a key with a value that isn't allowed.
    fn configure(&self, sensor: &SensorConfig, own: &Section<'_>) -> Result<Box<dyn Device>, ConfigError>;

    /// Probe for devices of this kind on a byte stream. `None` if they can't be queried.
    fn probe(&self) -> Option<Box<dyn Probe>> {
        None
    }
}

/// The parts of a configured sensor used by the loop.
pub struct SensorSpec {
    /// The common part of its table in the vehicle file.
    pub sensor: SensorConfig,
    /// Kind of sensor, for navigation.
    pub kind: SensorKind,
    /// Bytes to readings.
    pub decoder: Box<dyn Decoder>,
    /// Size of the ring buffer ahead of the loop, bytes.
    pub ring_bytes: usize,
}

/// A configured sensor.
pub trait Device: Send + Sync {
    /// The parts used by the loop, with a decoder in its initial state.
    fn specification(&self) -> SensorSpec;

    /// For a profiling head, its specification for scheduling.
    fn head(&self) -> Option<HeadSpec> {
        None
    }

    /// For a profiling head, the modes available at `range_m`, or at its configured range.
    ///
    /// Errors: a message for a range that isn't a setting of it.
    fn modes(&self, range_m: Option<f64>) -> Result<Vec<HeadMode>, String> {
        let _ = range_m;
        Ok(Vec::new())
    }

    /// Quantity measured, for simulations.
    fn sense(&self) -> Sense;

    /// The device's side of the wire, for simulations.
    fn emulator(&self, setup: &EmulatorSetup) -> Emulated;

    /// For an inertial unit whose noise is known, that noise: navigation goes by it unless the vehicle file says otherwise.
    fn inertial_noise(&self) -> Option<InertialNoise> {
        None
    }

    /// Step and noise of a cable counter; `[navigation]` overrides the noise.
    fn counter(&self) -> Option<CounterSpec> {
        None
    }

    /// For a HID device, the report descriptor that a rehearsal registers with the kernel.
    fn report_descriptor(&self) -> Option<Vec<u8>> {
        None
    }

    /// Writes the packet to `shorter` with optional payload stripped and returns `true`; `false` if it has none, or if that
    /// can't be determined from these bytes alone.
    fn without(&self, _what: Needless, _packet: &[u8], _shorter: &mut Vec<u8>) -> bool {
        false
    }

    /// What tells its bytes from those of others of its kind on one line; devices for which it is equal, or `None`, can't share
    /// one.
    fn line_address(&self) -> Option<String> {
        None
    }

    /// Values of its keys that are allowed and seldom meant: each key with what its value does.
    fn remarks(&self) -> Vec<(&'static str, String)> {
        Vec::new()
    }

    /// Supported carriers. UDP may replace any of them, one message per datagram.
    fn carriers(&self) -> &'static [Carrier];

    /// Host side of its line.
    fn driver(&self, setup: &DriverSetup) -> Box<dyn Driver>;
}

/// Payload that a log may omit: the readings stay the same, bit for bit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Needless {
    /// Echo strengths, where the range is sent beside them.
    Echoes,
    /// Geographic positions, and identifiers unique to one machine.
    Identity,
}

/// Bytes to readings: a codec with the device's configuration. Pure, runs in the loop. Its state depends on the bytes
/// decoded so far; the configuration isn't part of it.
pub trait Decoder: Stateful + Send + Sync {
    /// Takes a packet and calls `sink` for every reading completed by it.
    ///
    /// Allocates: never.
    fn decode(&mut self, packet: Packet<'_>, sink: &mut dyn FnMut(Decoded));

    /// Counters of the codec.
    fn counts(&self) -> CodecCounts;

    /// Readings decoded but not passed on: a bad status, a range setting other than the configured one, an unknown
    /// calibration, a jump, an orientation marked invalid by the device.
    fn withheld(&self) -> u64 {
        0
    }

    /// Statistics of the device's clock against the host's, if it sends its time. For reports only: readings are valid by the
    /// receive time.
    fn clock(&self) -> Option<ClockReport> {
        None
    }
}

/// Initial conditions of an emulated device.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EmulatorSetup {
    /// Power-on time; its first action may be then.
    pub start: MonoNs,
    /// For a head, its program.
    pub head: Option<HeadProgram>,
    /// Water and location of the tunnel, as known to the operator.
    pub site: Site,
    /// Whether the host that polls it is emulated too; otherwise it answers requests passed to [`Emulator::hear`].
    pub polled: bool,
}

/// Direction of bytes on a line.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Direction {
    /// From the device to the host.
    Received,
    /// From the host to the device.
    Sent,
}

/// Takes the traffic on a line: direction, time of the first byte, bytes.
pub type LineSink<'a> = &'a mut dyn FnMut(Direction, MonoNs, &[u8]);

/// Device side of the wire, together with the host's polling of it; `M` is its measurement.
pub trait Emulator<M>: Send + Sync {
    /// Adds the measurements that the device makes before `until` and that haven't been returned yet, in order of time, on
    /// the device's clock.
    fn begin(&mut self, until: MonoNs, due: &mut Vec<M>);

    /// Bytes sent by a host, at `at` on the device's clock; a device that isn't polled ignores them. Responses without a
    /// measurement go to `line`.
    fn hear(&mut self, _at: MonoNs, _bytes: &[u8], _line: LineSink<'_>) {}

    /// Encodes a measurement onto the line, each message with its time: once for each measurement begun, in the same order.
    /// An emulator with an emulated host that has begun none encodes measurements from elsewhere, those of an import; there,
    /// values that aren't finite weren't measured and no message carries them.
    fn tell(&mut self, measured: &M, line: LineSink<'_>);
}

/// An emulated device, by its kind of measurement.
pub enum Emulated {
    /// A profiling head.
    Head(Box<dyn Emulator<Sounding>>),
    /// A fixed echosounder, whose beam is along its x axis.
    Echosounder(Box<dyn Emulator<Sounding>>),
    /// A depth sensor.
    Depth(Box<dyn Emulator<Pressure>>),
    /// An inertial unit.
    Inertial(Box<dyn Emulator<Inertia>>),
    /// A velocity log.
    VelocityLog(Box<dyn Emulator<GroundVelocity>>),
    /// A cable counter.
    Tether(Box<dyn Emulator<Payout>>),
}

/// Quantity measured by a device.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Sense {
    /// Range to the wall, all around.
    Head,
    /// Range to the wall, in one direction.
    Echosounder,
    /// Depth.
    Depth,
    /// Attitude and motion.
    Inertial,
    /// Velocity over ground.
    Velocity,
    /// Distance travelled.
    Tether,
}

impl Sense {
    /// Name of such a device.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Head => "profiling head",
            Self::Echosounder => "echosounder",
            Self::Depth => "depth sensor",
            Self::Inertial => "inertial unit",
            Self::Velocity => "velocity log",
            Self::Tether => "cable counter",
        }
    }
}
