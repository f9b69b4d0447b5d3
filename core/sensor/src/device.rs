//! What a device's crate offers to the rest: a kind that reads its part of a vehicle file, and for each configured
//! sensor a plugin, a decoder and an emulator.
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
use headrace_geometry::time::{DurNs, MonoNs};
use headrace_sampling::head::{HeadMode, HeadProgram, HeadSpec};
use headrace_snapshot::Stateful;
use serde::{Deserialize, Serialize};

/// What every `[[sensors]]` table has.
#[derive(Debug, Clone, PartialEq)]
pub struct SensorConfig {
    /// Name of the sensor and of its channel in the log.
    pub id: String,
    /// Kind of device.
    pub plugin: String,
    /// Where it is connected, as written.
    pub connect: String,
    /// How it sits on the vehicle.
    pub mount: Mount,
    /// Time from validity of a value to the receive time of its first byte.
    pub latency: DurNs,
}

/// A sensor as navigation knows it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct SensorInfo {
    /// How it sits on the vehicle.
    pub mount: Mount,
    /// What it is.
    pub kind: SensorKind,
}

impl SensorInfo {
    /// At the vehicle's origin, of no use to navigation.
    pub fn other() -> Self {
        Self { mount: Mount { position: Vec3::zero(), rotation: Rot::identity() }, kind: SensorKind::Other }
    }
}

/// Kinds of sensor.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum SensorKind {
    /// A profiling head.
    Head,
    /// An echosounder; readings of less confidence are not used.
    Echosounder {
        /// Least confidence, 0 to 1.
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
        /// Metres of chainage for a metre of cable.
        scale: f64,
    },
    /// A source that navigation has no use for.
    Other,
}

/// One kind of device, by the name that vehicle files call it: `plugin = "imagenex881"`.
pub trait DeviceKind: Sync {
    /// The name in vehicle files and in the logs' channel metadata.
    fn name(&self) -> &'static str;

    /// Reads this device's own keys of a sensor's table. The common ones are in `sensor` already.
    ///
    /// Errors: a key with a value that isn't allowed.
    fn configure(&self, sensor: &SensorConfig, own: &Section<'_>) -> Result<Box<dyn Device>, ConfigError>;

    /// Asks what is on a row of bytes whether it is of this kind. `None` where such devices can't be asked.
    fn probe(&self) -> Option<Box<dyn Probe>> {
        None
    }
}

/// What the loop needs of a configured sensor.
pub struct SensorSpec {
    /// The common part of its table in the vehicle file.
    pub sensor: SensorConfig,
    /// What it is, as navigation knows it.
    pub kind: SensorKind,
    /// Bytes to readings.
    pub decoder: Box<dyn Decoder>,
    /// Size of the ring before the loop, bytes.
    pub ring_bytes: usize,
}

/// A configured sensor.
pub trait Device: Send + Sync {
    /// What the loop needs of it, with a decoder that has heard nothing yet.
    fn specification(&self) -> SensorSpec;

    /// For a profiling head, what a schedule of heads needs to know of it.
    fn head(&self) -> Option<HeadSpec> {
        None
    }

    /// For a profiling head, the modes that it could be set to at `range_m`, or at its own range setting.
    ///
    /// Errors: in words, a range that isn't a setting of it.
    fn modes(&self, range_m: Option<f64>) -> Result<Vec<HeadMode>, String> {
        let _ = range_m;
        Ok(Vec::new())
    }

    /// What it senses: what a simulation has to tell its emulator.
    fn sense(&self) -> Sense;

    /// The device's side of the wire, for simulations.
    fn emulator(&self, setup: &EmulatorSetup) -> Emulated;

    /// For a HID device, the report descriptor by which a rehearsal introduces it to the kernel.
    fn report_descriptor(&self) -> Option<Vec<u8>> {
        None
    }

    /// Puts into `shorter` what a packet of it is without what nobody needs for its readings, and gives `true`; `false` where
    /// there is nothing of that in it, or where that can't be told from these bytes alone.
    fn without(&self, _what: Needless, _packet: &[u8], _shorter: &mut Vec<u8>) -> bool {
        false
    }

    /// What may carry its bytes. UDP may stand in for any of them, a message a datagram.
    fn carriers(&self) -> &'static [Carrier];

    /// The host's side of its line.
    fn driver(&self, setup: &DriverSetup) -> Box<dyn Driver>;
}

/// What a log may do without: the readings are the same, bit for bit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Needless {
    /// Strengths of echoes, where the range is told beside them.
    Echoes,
    /// Places on Earth, and numbers that tell one machine from all others.
    Identity,
}

/// Bytes to readings: a codec with the device's configuration around it. Pure, in the loop. Its state is what it has heard;
/// the configuration isn't.
pub trait Decoder: Stateful + Send + Sync {
    /// Takes a packet and calls `sink` for every reading that it completes.
    ///
    /// Allocates: never.
    fn decode(&mut self, packet: Packet<'_>, sink: &mut dyn FnMut(Decoded));

    /// What the codec has seen so far.
    fn counts(&self) -> CodecCounts;

    /// Readings that were understood but not handed on: a bad status, another range setting than the configured one, a
    /// calibration that isn't known, a jump, an orientation that the device itself calls invalid.
    fn withheld(&self) -> u64 {
        0
    }

    /// How the device's own clock goes beside ours, where it sends its time. It is reported and nothing else: readings
    /// are valid by the receive time.
    fn clock(&self) -> Option<ClockReport> {
        None
    }
}

/// How an emulated device begins.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EmulatorSetup {
    /// When it is switched on; its first action may be then.
    pub start: MonoNs,
    /// For a head, its program.
    pub head: Option<HeadProgram>,
    /// The water and the tunnel's place, as those who set it up know them.
    pub site: Site,
    /// Whether the host that polls it is emulated, too; else it does what is asked of it through [`Emulator::hear`].
    pub polled: bool,
}

/// Which way bytes went on a line.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Direction {
    /// From the device to us.
    Received,
    /// From us to the device.
    Sent,
}

/// Takes what crosses a line: which way, when its first byte did, the bytes.
pub type LineSink<'a> = &'a mut dyn FnMut(Direction, MonoNs, &[u8]);

/// The device's side of the wire, together with the host's polling of it; `M` is what the device measures.
pub trait Emulator<M>: Send + Sync {
    /// Adds the measurements that the device makes before `until` and hasn't been asked for yet, in order of time, on
    /// the device's own clock.
    fn begin(&mut self, until: MonoNs, due: &mut Vec<M>);

    /// Bytes that a host has sent it, at `at` on the device's own clock; a device that isn't polled heeds none. What it answers
    /// without measuring goes to `line`.
    fn hear(&mut self, _at: MonoNs, _bytes: &[u8], _line: LineSink<'_>) {}

    /// Puts what was measured on the line, each message with its time: once for each measurement that has begun, in the
    /// same order. Of an emulator that is polled by its own host, and that begins nothing, what others have measured: an
    /// import's. There, values that aren't numbers weren't measured, and no message tells them.
    fn tell(&mut self, measured: &M, line: LineSink<'_>);
}

/// An emulated device by what it senses.
pub enum Emulated {
    /// A profiling head.
    Head(Box<dyn Emulator<Sounding>>),
    /// A fixed echosounder: it looks along its own x.
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

/// What a device senses.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Sense {
    /// The wall, round about.
    Head,
    /// The wall, in one direction.
    Echosounder,
    /// Depth.
    Depth,
    /// Attitude and motion.
    Inertial,
    /// Velocity over ground.
    Velocity,
    /// The way gone.
    Tether,
}

impl Sense {
    /// What such a device is called.
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
