//! Tests whether two different `connect`s lead to the same device.

use std::fs;
use std::net::{SocketAddr, ToSocketAddrs as _};
use std::path::PathBuf;

use headrace_sensor::connect::{Connect, SerialPort};

/// The device or port that a `connect` leads to at present.
#[derive(Debug, PartialEq, Eq)]
enum End {
    /// A device file, with links resolved.
    File(PathBuf),
    /// A device's address on a bus.
    Bus(PathBuf, u8),
    Tcp(SocketAddr),
    Udp(SocketAddr),
    /// A local UDP port.
    Local(u16),
}

/// Whether two `connect`s lead to the same device now. Each may name the device by a link, a USB identity or another
/// host name.
///
/// Returns `false` if either device is absent, because the answer isn't known then.
pub fn same_device(one: &Connect, other: &Connect) -> bool {
    // The carriers are compared first, because name lookups take time.
    one.carrier() == other.carrier() && end(one).is_some_and(|end| Some(end) == self::end(other))
}

fn end(connect: &Connect) -> Option<End> {
    let first = |address: &str| address.to_socket_addrs().ok()?.next();
    match connect {
        Connect::Serial { port: SerialPort::Path(path), .. } => fs::canonicalize(path).ok().map(End::File),
        Connect::Serial { port: SerialPort::Usb(identity), .. } => {
            let path = super::serial::path_of(identity).ok()?;
            fs::canonicalize(path).ok().map(End::File)
        }
        Connect::Tcp { address } => first(address).map(End::Tcp),
        Connect::Udp { address } => first(address).map(End::Udp),
        Connect::UdpListen { address, .. } => first(address).map(|address| End::Local(address.port())),
        #[cfg(target_os = "linux")]
        Connect::Hid(identity) => super::hid::path_of(identity).ok().map(|path| End::File(path.into())),
        Connect::I2c { bus, address } => fs::canonicalize(bus).ok().map(|bus| End::Bus(bus, *address)),
        // CAN interfaces have only one name, so different `connect`s are different interfaces.
        _ => None,
    }
}

#[cfg(test)]
#[cfg(unix)]
mod tests {
    use std::os::unix::fs::symlink;

    use super::*;

    #[test]
    fn different_connects_to_one_device_are_detected() {
        let folder = std::env::temp_dir().join(format!("headrace-same-device-{}", std::process::id()));
        fs::create_dir_all(&folder).unwrap();
        let path = |name: &str| folder.join(name).display().to_string();
        fs::write(path("port"), "").unwrap();
        fs::write(path("other"), "").unwrap();
        symlink(path("port"), path("by-id")).unwrap();
        let serial = |name: &str| format!("serial:{}", path(name));
        let i2c = |name: &str, address: u8| format!("i2c:{}:{address:#04x}", path(name));
        for (one, other, same) in [
            (serial("port"), serial("by-id"), true),
            (serial("port"), format!("{}?baud=9600", serial("by-id")), true),
            (serial("port"), serial("other"), false),
            (serial("none"), serial("none"), false),
            (i2c("port", 0x40), i2c("by-id", 0x40), true),
            (i2c("port", 0x40), i2c("by-id", 0x41), false),
            ("tcp:127.0.0.1:9".to_owned(), "tcp:localhost:9".to_owned(), true),
            ("tcp:127.0.0.1:9".to_owned(), "udp:127.0.0.1:9".to_owned(), false),
            ("udp:127.0.0.1:9".to_owned(), "udp:127.0.0.1:10".to_owned(), false),
            ("udp:127.0.0.1:9".to_owned(), "udp-listen:127.0.0.1:9".to_owned(), false),
            ("udp-listen:0.0.0.0:9".to_owned(), "udp-listen:127.0.0.1:9".to_owned(), true),
        ] {
            let [a, b] = [&one, &other].map(|text| Connect::parse(text).unwrap());
            assert_eq!((same_device(&a, &b), same_device(&b, &a)), (same, same), "{one} {other}");
        }
        fs::remove_dir_all(folder).unwrap();
    }
}
