//! Commands that fix port problems, for `run` and `devices`.

/// CAN bit rate in the advised command, bit/s. Same as in `deploy/systemd/can@.service`.
const CAN_BITRATE: u32 = 250_000;

/// Remedy if the device's group has access, but the user isn't in the group.
pub(crate) fn join(group: &str) -> String {
    format!("sudo usermod -aG {group} $USER, and log in again")
}

/// Remedy if the user joined the group after this session began.
pub(crate) fn log_in_again(group: &str) -> String {
    format!("log in again: this user joined the group {group} after the login")
}

/// Remedy if the device's group has no access, or is root's group.
pub(crate) fn rule(path: &str) -> String {
    if path.starts_with("/dev/hidraw") {
        "install deploy/udev/70-headrace.rules, with the ids of this device in it, and sudo udevadm trigger"
            .into()
    } else if path.starts_with("/dev/i2c") {
        "install deploy/udev/70-headrace.rules, and sudo udevadm trigger".into()
    } else {
        format!("sudo chgrp dialout {path} && sudo chmod 660 {path}; {}", join("dialout"))
    }
}

/// Remedy if a CAN interface is down. Interfaces without hardware have no bit rate.
pub(crate) fn set_up(interface: &str, has_bitrate: bool) -> String {
    if has_bitrate {
        format!("sudo ip link set {interface} up type can bitrate {CAN_BITRATE}, with the rate of the bus")
    } else {
        format!("sudo ip link set {interface} up")
    }
}

/// Remedy if a CAN interface is up but bus-off.
pub(crate) fn back_on_bus(interface: &str) -> String {
    format!("check bit rate, wiring and termination: ip -details link show {interface}")
}

/// Remedy if a CAN interface doesn't exist.
pub(crate) fn no_interface(interface: &str) -> String {
    if interface.starts_with("vcan") {
        format!("sudo modprobe vcan; sudo ip link add {interface} type vcan; {}", set_up(interface, false))
    } else {
        "plug the adapter in; ip link lists the interfaces".into()
    }
}

/// Remedy if the kernel has no raw CAN sockets.
pub(crate) const CAN_RAW: &str = "sudo modprobe can-raw";

/// Remedy if an I2C bus has no device file.
pub(crate) const I2C_DEV: &str =
    "sudo modprobe i2c-dev; to load it at each boot: echo i2c-dev | sudo tee /etc/modules-load.d/i2c.conf";

/// Remedy if an address doesn't answer.
pub(crate) const NOBODY_ANSWERS: &str = "check that it is switched on, that its port is right, and that this computer is in its network: ip address";

/// Remedy if a connection is refused, because no server uses the port.
pub(crate) const NOBODY_LISTENS: &str = "check that the device is switched on and the port number is right";
