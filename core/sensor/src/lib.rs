//! Interface between a device's crate and the rest of the program.
//!
//! A device has three separate parts:
//! - A codec and a decoder turn bytes into [`reading::Reading`]s. Both are pure.
//! - A driver is the host's side of the device's line, without I/O.
//! - An emulator is the device's side of the line, for simulations.
//!
//! A device's crate depends only on this crate, which re-exports the crates below it. A codec consists of a
//! [`codec::Framing`] in [`codec::Framed`]:
//!
//! ```
//! use headrace_sensor::codec::{Codec as _, Framed, Framing, Verdict};
//!
//! #[derive(Clone, Copy, Default)]
//! struct Counts; // Frames of three bytes: a marker, then a number, low byte first.
//! impl Framing for Counts {
//!     type Value = u16;
//!     fn judge(&self, front: &[u8]) -> Verdict {
//!         if front[0] == 0xA5 { Verdict::on(front, 3, |_| true) } else { Verdict::NotAStart }
//!     }
//!     fn read(&self, frame: &[u8]) -> Option<u16> {
//!         Some(u16::from_le_bytes([frame[1], frame[2]]))
//!     }
//! }
//! let (mut codec, mut values) = (Framed::<Counts, 3>::default(), Vec::new());
//! for packet in [&[0x00, 0xA5, 0x34][..], &[0x12]] {
//!     codec.push(packet, &mut |value| values.push(value));
//! }
//! assert_eq!((&values[..], codec.counts().skipped_bytes), (&[0x1234][..], 1));
//! ```

#![cfg_attr(not(test), warn(clippy::cast_possible_truncation))]
#![cfg_attr(test, allow(clippy::cast_possible_truncation))]

pub mod codec;
pub mod connect;
pub mod device;
pub mod device_clock;
pub mod driver;
pub mod measurement;
pub mod reading;
pub mod sample_times;
pub mod withheld;

pub use device::SensorConfig;
pub use headrace_config as config;
pub use headrace_geometry as geometry;
pub use headrace_geometry::snapshot;
pub use headrace_geometry::snapshot::stateful;
pub use headrace_sampling as sampling;
