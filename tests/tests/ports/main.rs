//! Devices on real ports: emulated devices, faulty lines, the kernel's own CAN and HID, and the way of the bytes to the
//! loop.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a failed step ends the test")]

#[cfg(unix)]
mod dead_devices;
mod devices;
#[cfg(unix)]
mod faults;
#[cfg(unix)]
mod foreign_senders;
#[cfg(unix)]
mod full_ring;
#[cfg(target_os = "linux")]
mod kernel_can_hid;
#[cfg(target_os = "linux")]
mod kernel_drivers;
#[cfg(unix)]
mod rehearsal;
#[cfg(unix)]
mod rehearsal_faults;
#[cfg(target_os = "linux")]
mod restarts;
#[cfg(target_os = "linux")]
mod run_ports;
#[cfg(target_os = "linux")]
mod setup;
#[cfg(target_os = "linux")]
mod soak;
mod splits;
#[cfg(target_os = "linux")]
mod syscalls;
