//! What a device's crate offers to the rest: a kind that reads its part of a vehicle file, and for each configured
//! sensor a plugin, a decoder and an emulator.
//!
//! Discovering and opening the port, decoding (pure) and applying (in the loop) are three separate things; this file
//! has the second, and the device's side of the wire for simulations.

use super::plugin::Plugin;
use super::reading::{Decoded, Packet};
use crate::codec::CodecCounts;
use crate::config::{ConfigError, Section, SensorConfig};
use crate::frames::{Point3, Pose, Tunnel, Vec3};
use crate::sampling::head::{HeadMode, HeadProgram, HeadSpec};
use crate::site::Site;
use crate::time::MonoNs;

/// One kind of device, by the name that vehicle files call it: `plugin = "imagenex881"`.
pub trait DeviceKind: Sync {
    /// The name in vehicle files and in the logs' channel metadata.
    fn name(&self) -> &'static str;

    /// Reads this device's own keys of a sensor's table. The common ones are in `sensor` already.
    ///
    /// Errors: a key with a value that isn't allowed.
    fn configure(&self, sensor: &SensorConfig, own: &Section<'_>) -> Result<Box<dyn Device>, ConfigError>;
}

/// A configured sensor. As a [`Plugin`] it registers its source and its components.
pub trait Device: Plugin + Send + Sync {
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

    /// For a profiling head that is at `angle_rad` and would step towards `growing` angles, both in the sensor's frame:
    /// the messages, in order, after which it is at its program's start and steps as that begins.
    fn start_commands(&self, angle_rad: f64, growing: bool, program: &HeadProgram) -> Vec<Vec<u8>> {
        let _ = (angle_rad, growing, program);
        Vec::new()
    }

    /// The device's side of the wire, for simulations.
    fn emulator(&self, setup: &EmulatorSetup) -> Box<dyn Emulator>;
}

/// Bytes to readings: a codec with the device's configuration around it. Pure, in the loop.
pub trait Decoder: Send + Sync {
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
}

/// How an emulated device begins.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EmulatorSetup {
    /// When it is switched on; its first action may be then.
    pub start: MonoNs,
    /// For a head, its program.
    pub head: Option<HeadProgram>,
}

/// What an emulated device can sense. Implemented by the simulator.
pub trait Truth {
    /// The vehicle's true pose.
    fn pose(&self, at: MonoNs) -> Pose;

    /// Distance from `origin` along the unit vector `direction` to the wall, or `None` when there is none.
    fn range_m(&self, origin: Point3<Tunnel>, direction: Vec3<Tunnel>) -> Option<f64>;

    /// Water, gravity and where the tunnel lies.
    fn site(&self) -> &Site;
}

/// Which way bytes went on a line.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Direction {
    /// From the device to us.
    Received,
    /// From us to the device.
    Sent,
}

/// The device's side of the wire, together with the host's polling of it: one event at a time, in order.
pub trait Emulator: Send {
    /// When the next event is due; never earlier than the last.
    fn due(&self) -> MonoNs;

    /// Does what is due then, and calls `line` for each message that crosses the wire, in order of its time.
    fn act(&mut self, truth: &dyn Truth, line: &mut dyn FnMut(Direction, MonoNs, &[u8]));
}
