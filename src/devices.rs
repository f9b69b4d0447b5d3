//! The device kinds of this build. Adding a device adds a line here.

use headrace_sensor::device::DeviceKind;

/// Every kind of device that a vehicle file may name.
pub const KINDS: [&dyn DeviceKind; 7] = [
    &headrace_imagenex881::Kind,
    &headrace_ping1d::Kind,
    &headrace_bar100::Kind,
    &headrace_imu_can::Kind,
    &headrace_tether_hid::Kind,
    &headrace_mavlink::Kind,
    &headrace_a50::Kind,
];
