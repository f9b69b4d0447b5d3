//! Devices on real ports: emulated ones, faulty lines, and the kernel's own CAN and HID; and what comes of their bytes on the
//! way to the loop.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a test stops at what it can't do")]

#[cfg(unix)]
mod dead_devices;
mod devices;
#[cfg(unix)]
mod faults;
#[cfg(unix)]
mod full_ring;
#[cfg(target_os = "linux")]
mod kernel_can_hid;
#[cfg(target_os = "linux")]
mod kernel_drivers;
#[cfg(unix)]
mod rehearsal;
#[cfg(target_os = "linux")]
mod run_ports;
#[cfg(target_os = "linux")]
mod soak;
mod splits;
#[cfg(target_os = "linux")]
mod syscalls;
#[cfg(unix)]
mod who_speaks;
