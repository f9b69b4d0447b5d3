//! The list of device kinds. A new kind of device is added here.

use headrace_sensor::device::DeviceKind;

/// Every kind of device that a vehicle file may name.
pub const KINDS: [&dyn DeviceKind; 7] = [
    &headrace_imagenex881::Imagenex881Kind,
    &headrace_ping1d::Ping1dKind,
    &headrace_bar100::Bar100Kind,
    &headrace_imu_can::ImuCanKind,
    &headrace_tether_hid::TetherHidKind,
    &headrace_mavlink::MavlinkKind,
    &headrace_a50::A50Kind,
];
