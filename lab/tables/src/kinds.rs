//! The device kinds that a vehicle file may name. A test checks that this list equals the `headrace` command's list.

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

#[cfg(test)]
mod tests {
    /// The two lists can't be shared: the command's crate would add its terminal, page and ports as dependencies.
    #[test]
    fn device_kinds_equal_those_of_the_headrace_command() {
        let lines = |text: &str| -> Vec<String> {
            let kinds = text.lines().map(str::trim).filter(|line| line.starts_with("&headrace_"));
            kinds.map(str::to_owned).collect()
        };
        let ours = lines(include_str!("kinds.rs"));
        assert_eq!(ours.len(), super::KINDS.len());
        assert_eq!(ours, lines(include_str!("../../../src/devices.rs")));
    }
}
