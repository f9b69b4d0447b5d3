//! Interface that the crate of each kind of device implements.
//!
//! A kind of device parses its own keys in a sensor's table of a vehicle file. Each configured sensor has a driver, a
//! decoder and an emulator.
//!
//! None of these opens a port. Decoding is pure. The loop uses the readings.

use super::driver::{Carrier, Driver, DriverSetup, Probe};
use super::measurement::{GroundVelocity, Inertia, Payout, Pressure, Sounding};
use super::reading::{Decoded, Packet};
use crate::codec::CodecCounts;
use crate::device_clock::ClockReport;
use crate::withheld::WithheldReason;
use headrace_config::{ConfigError, Section};
use headrace_geometry::frames::{Mount, Rot, Vec3};
use headrace_geometry::site::Site;
use headrace_geometry::snapshot::Stateful;
use headrace_geometry::time::{DurNs, MonoNs};
use headrace_sampling::head::{HeadMode, HeadProgram, HeadSpec};
use serde::{Deserialize, Serialize};

/// Values of the keys that all `[[sensors]]` tables of a vehicle file share.
#[derive(Debug, Clone, PartialEq)]
pub struct SensorConfig {
    /// Name of the sensor and of its log channel.
    pub id: String,
    /// Kind of device.
    pub plugin: String,
    /// Connection, as written in the vehicle file.
    pub connect: String,
    /// Position and attitude of the sensor on the vehicle.
    pub mount: Mount,
    /// Delay from a value's time of validity to the receive time of its first byte.
    pub latency: DurNs,
}

/// Mount and kind of one sensor, as far as navigation needs them.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct SensorInfo {
    /// Position and attitude of the sensor on the vehicle.
    pub mount: Mount,
    /// Kind of sensor.
    pub kind: SensorKind,
}

impl SensorInfo {
    /// Creates the entry of a source that navigation does not use, with a mount at the vehicle's origin.
    pub fn other() -> Self {
        Self { mount: Mount { position: Vec3::zero(), rotation: Rot::identity() }, kind: SensorKind::Other }
    }
}

/// Kinds of sensor.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum SensorKind {
    /// A profiling head.
    Head,
    /// An echosounder. Readings with a confidence below `min_confidence` are ignored.
    Echosounder {
        /// Minimum confidence of a used reading, 0 to 1.
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
        /// Chainage at which the counter reads zero, m.
        zero_at_m: f64,
        /// Metres of chainage per metre of counted cable.
        scale: f64,
    },
    /// A source that navigation does not use.
    Other,
}

/// Noise of an inertial unit according to its datasheet.
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

/// Bias of an inertial sensor, in the sensor's unit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BiasSpec {
    /// Standard deviation of the bias's constant part, which changes only at power-on.
    pub turn_on: f64,
    /// Standard deviation of the bias's drift during operation.
    pub in_run: f64,
    /// Correlation time of the bias's drift, s.
    pub time_s: f64,
}

/// Step and noise of a cable counter, from the vehicle file or a preset.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CounterSpec {
    /// Smallest change of the length, m. `None` if each reading contains this step.
    pub step_m: Option<f64>,
    /// Standard deviation of the counter's noise without rounding, m. `None` if unknown.
    pub sd_m: Option<f64>,
}

/// One kind of device, named in vehicle files as `plugin`, for instance `plugin = "imagenex881"`.
pub trait DeviceKind: Sync {
    /// Name of this kind of device in vehicle files and in the channel metadata of logs.
    fn name(&self) -> &'static str;

    /// Parses the keys of this kind in a sensor's table. `sensor` contains the keys that all kinds share.
    ///
    /// Errors: the value of a key is not allowed.
    fn configure(&self, sensor: &SensorConfig, own: &Section<'_>) -> Result<Box<dyn Device>, ConfigError>;

    /// Returns probes that find devices of this kind on a byte stream; empty if they cannot be queried.
    ///
    /// If several devices can share a line, each has its own probe.
    fn probes(&self) -> Vec<Box<dyn Probe>> {
        Vec::new()
    }
}

/// Parts of a configured sensor that the loop uses.
pub struct SensorSpec {
    /// Values of the common keys in the sensor's table of the vehicle file.
    pub sensor: SensorConfig,
    /// Kind of sensor, for navigation.
    pub kind: SensorKind,
    /// Decoder from the sensor's bytes to readings.
    pub decoder: Box<dyn Decoder>,
    /// Size of the ring buffer between the sensor's port and the loop, bytes.
    pub ring_bytes: usize,
}

/// A sensor as configured in a vehicle file.
pub trait Device: Send + Sync {
    /// Returns the parts of the sensor for the loop, with a decoder in its initial state.
    fn specification(&self) -> SensorSpec;

    /// Returns the head's properties for scheduling its rotation; `None` unless the device is a profiling head.
    fn head(&self) -> Option<HeadSpec> {
        None
    }

    /// Returns the modes of a profiling head at `range_m`, or at its configured range if `None`. Other devices have no
    /// modes.
    ///
    /// Errors: a message, if the head does not have this range.
    fn modes(&self, range_m: Option<f64>) -> Result<Vec<HeadMode>, String> {
        let _ = range_m;
        Ok(Vec::new())
    }

    /// Returns the quantity that the device measures, for simulations.
    fn sense(&self) -> Sense;

    /// Returns the emulator of the device's side of the line, for simulations.
    fn emulator(&self, setup: &EmulatorSetup) -> Emulated;

    /// Returns the noise of an inertial unit, if it is known. Values in the vehicle file take precedence.
    fn inertial_noise(&self) -> Option<InertialNoise> {
        None
    }

    /// Returns the step and noise of a cable counter. The noise in `[navigation]` takes precedence.
    fn counter(&self) -> Option<CounterSpec> {
        None
    }

    /// Returns the report descriptor of a HID device. A rehearsal uses it to register an emulated device with the
    /// kernel.
    fn report_descriptor(&self) -> Option<Vec<u8>> {
        None
    }

    /// Writes a packet to `shorter` without a payload that a log may omit, and returns `true`.
    ///
    /// Returns `false` if the packet has no such payload, or if the payload cannot be recognised from this packet
    /// alone.
    fn without(&self, _what: OptionalPayload, _packet: &[u8], _shorter: &mut Vec<u8>) -> bool {
        false
    }

    /// Returns the address that distinguishes this device from others of its kind on the same line.
    ///
    /// Two devices of a kind cannot share a line if their addresses are equal or if they have none (`None`).
    fn line_address(&self) -> Option<String> {
        None
    }

    /// Returns keys whose values are allowed but seldom intended, each with the effect of its value.
    fn remarks(&self) -> Vec<(&'static str, String)> {
        Vec::new()
    }

    /// Returns the supported carriers. UDP may replace each of them; a datagram then contains one message.
    fn carriers(&self) -> &'static [Carrier];

    /// Returns the driver, which is the host's side of the device's line.
    fn driver(&self, setup: &DriverSetup) -> Box<dyn Driver>;
}

/// Part of a packet that a log may omit. Without it, the decoded readings are bit-identical.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum OptionalPayload {
    /// Echo strengths, if the message also contains the range.
    Echoes,
    /// Geographic positions, and identifiers that are unique to one machine.
    Identity,
}

/// Converts bytes to readings: a codec with the device's configuration.
///
/// A decoder is pure and runs in the loop. Its saved state depends only on the decoded bytes; it does not include the
/// configuration.
pub trait Decoder: Stateful + Send + Sync {
    /// Decodes a packet and calls `sink` for each completed reading.
    ///
    /// Allocates: never.
    fn decode(&mut self, packet: Packet<'_>, sink: &mut dyn FnMut(Decoded));

    /// Counters of the decoder's codec.
    fn counts(&self) -> CodecCounts;

    /// Number of readings that were decoded but withheld.
    fn withheld(&self) -> u64 {
        0
    }

    /// Reason for which the latest withheld reading was withheld. `None` if none was withheld.
    fn withheld_reason(&self) -> Option<WithheldReason> {
        None
    }

    /// Returns statistics that compare the device's clock with the host's. `None` if the device does not send its time.
    ///
    /// They are for reports only, because times of validity come from receive times.
    fn clock(&self) -> Option<ClockReport> {
        None
    }
}

/// Initial conditions of an emulated device.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EmulatorSetup {
    /// Time at which the device is switched on. Before this time, the device does nothing.
    pub start: MonoNs,
    /// Rotation program of a head; `None` for other devices.
    pub head: Option<HeadProgram>,
    /// Water and location of the tunnel, as the operator knows them.
    pub site: Site,
    /// Whether the host that polls the device is emulated too.
    ///
    /// If not, the device answers only the requests that are passed to [`Emulator::hear`].
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

/// Function that receives the traffic on a line: direction, time of the first byte, bytes.
pub type LineSink<'a> = &'a mut dyn FnMut(Direction, MonoNs, &[u8]);

/// Device side of the line, optionally with a host that polls it. `M` is the type of the device's measurements.
pub trait Emulator<M>: Send + Sync {
    /// Adds to `due` the measurements that the device begins before `until`, in order of time. Each is added only once.
    ///
    /// Times are on the device's clock.
    fn begin(&mut self, until: MonoNs, due: &mut Vec<M>);

    /// Processes bytes that a host sent, at time `at` on the device's clock.
    ///
    /// A device that is not polled ignores the bytes. Responses without a measurement go to `line`.
    fn hear(&mut self, _at: MonoNs, _bytes: &[u8], _line: LineSink<'_>) {}

    /// Encodes a measurement and passes each message to `line` with its time.
    ///
    /// The method is called once for each measurement that the device began, in the same order. An emulator with an
    /// emulated host also encodes imported measurements. If a value in them is not finite, the quantity was not
    /// measured, and no message contains it.
    fn tell(&mut self, measured: &M, line: LineSink<'_>);
}

/// An emulated device. Its variant determines the type of its measurements.
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
    /// Range to the wall, measured in all directions by a turning head.
    Head,
    /// Range to the wall, measured in one fixed direction.
    Echosounder,
    /// Depth below the water's surface.
    Depth,
    /// Attitude, turn rate and acceleration of the vehicle.
    Inertial,
    /// Velocity of the vehicle over ground.
    Velocity,
    /// Distance travelled, as length of cable.
    Tether,
}

impl Sense {
    /// Name of a device that measures this quantity.
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
