//! Connection of a sensor: the key `connect` in vehicle files.

use core::fmt;
use core::num::ParseIntError;

use crate::driver::Carrier;

/// Default serial rate, baud.
const USUAL_BAUD: u32 = 115_200;
/// Highest accepted serial rate, baud.
const MAX_BAUD: u32 = 12_000_000;

/// A USB device, identified by its descriptors. These do not depend on the USB port.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct UsbIdentity {
    /// USB vendor id.
    pub vendor: u16,
    /// USB product id.
    pub product: u16,
    /// Serial number, which distinguishes devices of the same product.
    pub serial: Option<String>,
}

/// A serial port, identified by its path or by its USB adapter.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum SerialPort {
    /// A device file. A path below `/dev/serial/by-id` stays the same after replugging.
    Path(String),
    /// The port of this USB adapter, wherever the adapter is plugged in.
    Usb(UsbIdentity),
}

/// A parsed `connect` value from a vehicle file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Connect {
    /// `serial:/dev/serial/by-id/...?baud=115200` or `serial:usb:VID:PID[:SERIAL]?baud=115200`.
    Serial {
        /// Serial port of the device.
        port: SerialPort,
        /// Serial rate, bits per second; 8 data bits, no parity, 1 stop bit.
        baud: u32,
    },
    /// `tcp:HOST:PORT`: the host opens a connection to the device.
    Tcp {
        /// Host name or address of the device, and its port.
        address: String,
    },
    /// `udp:HOST:PORT`: the host sends packets to the device and receives the answers.
    Udp {
        /// Host name or address of the device, and its port.
        address: String,
    },
    /// `udp-listen:ADDRESS:PORT[?from=HOST[:PORT]]`: a local port to which the device sends.
    ///
    /// Only one sender is accepted: the one in `from`. Without `from`, it is the first one whose message the driver
    /// accepts.
    UdpListen {
        /// Local address and port at which the host receives.
        address: String,
        /// Host of the device, optionally with its port. `None` accepts any host.
        from: Option<String>,
    },
    /// `can:INTERFACE`: a CAN bus.
    Can {
        /// Name of the CAN network interface.
        interface: String,
    },
    /// `hid:VID:PID[:SERIAL]`: a USB device of the class HID.
    Hid(UsbIdentity),
    /// `i2c:/dev/i2c-1:0x40`: a device on an I2C bus.
    I2c {
        /// Device file of the I2C bus.
        bus: String,
        /// Address of the device on the I2C bus, 7 bits.
        address: u8,
    },
}

/// Error in the value of a `connect` key.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("connect = {text:?}: {problem}; {allowed}")]
pub struct ConnectError {
    /// The value of `connect` as written.
    pub text: String,
    /// Description of the fault.
    pub problem: String,
    /// Allowed forms of `connect`, with an example.
    pub allowed: String,
}

/// All forms of `connect`. An error about any other text lists them.
const FORMS: &str = "allowed are serial:/dev/serial/by-id/NAME?baud=115200, serial:usb:VID:PID[:SERIAL]?baud=115200, \
     tcp:HOST:PORT, udp:HOST:PORT, udp-listen:ADDRESS:PORT, can:INTERFACE, hid:VID:PID[:SERIAL], i2c:/dev/i2c-1:0x40";

impl Connect {
    /// Parses the `connect` of a sensor in a vehicle file.
    ///
    /// Errors: the text has none of the forms of [`Connect`]; the message lists the allowed forms.
    pub fn parse(text: &str) -> Result<Self, ConnectError> {
        let refused = |problem: &str, allowed: &str| ConnectError {
            text: text.to_owned(),
            problem: problem.to_owned(),
            allowed: allowed.to_owned(),
        };
        if text.is_empty() {
            return Err(refused("it is empty", FORMS));
        }
        let (scheme, rest) = text.split_once(':').ok_or_else(|| refused("there is no colon", FORMS))?;
        match scheme {
            "serial" => serial(rest).map_err(|problem| {
                refused(
                    &problem,
                    "allowed is serial:/dev/serial/by-id/NAME?baud=115200 or serial:usb:0403:6001:A10K",
                )
            }),
            "tcp" => host_and_port(rest)
                .map(|address| Self::Tcp { address })
                .map_err(|problem| refused(&problem, "allowed is tcp:192.168.0.5:4040")),
            "udp" => host_and_port(rest)
                .map(|address| Self::Udp { address })
                .map_err(|problem| refused(&problem, "allowed is udp:192.168.2.2:9090")),
            "udp-listen" => udp_listen(rest).map_err(|problem| {
                refused(
                    &problem,
                    "allowed is udp-listen:0.0.0.0:14550 or udp-listen:0.0.0.0:14550?from=192.168.2.2",
                )
            }),
            "can" => can_interface(rest)
                .map(|interface| Self::Can { interface })
                .map_err(|problem| refused(&problem, "allowed is can:can0")),
            "hid" => usb(rest).map(Self::Hid).map_err(|problem| {
                refused(
                    &problem,
                    "allowed is hid:VID:PID[:SERIAL] with four hexadecimal digits each, hid:1209:0001",
                )
            }),
            "i2c" => i2c(rest).map_err(|problem| refused(&problem, "allowed is i2c:/dev/i2c-1:0x40")),
            _ => Err(refused(&format!("unknown carrier {scheme:?}"), FORMS)),
        }
    }

    /// Carrier of the connection: serial, TCP, UDP, CAN, HID or I2C.
    pub fn carrier(&self) -> Carrier {
        match self {
            Self::Serial { .. } => Carrier::Serial,
            Self::Tcp { .. } => Carrier::Tcp,
            Self::Udp { .. } | Self::UdpListen { .. } => Carrier::Udp,
            Self::Can { .. } => Carrier::Can,
            Self::Hid(_) => Carrier::Hid,
            Self::I2c { .. } => Carrier::I2c,
        }
    }

    /// Returns the connection if the device supports its carrier.
    ///
    /// Errors: the carrier is not among `carriers`.
    pub fn among(self, carriers: &[Carrier]) -> Result<Self, ConnectError> {
        if carriers.contains(&self.carrier()) {
            return Ok(self);
        }
        let names: Vec<&str> = carriers.iter().map(|carrier| carrier.as_str()).collect();
        let names = match names.split_last() {
            Some((last, [])) => (*last).to_owned(),
            Some((last, others)) => format!("{} or {last}", others.join(", ")),
            None => String::new(),
        };
        Err(ConnectError {
            text: self.to_string(),
            problem: format!("a device of this kind cannot use {}", self.carrier().as_str()),
            allowed: format!("it can use {names}"),
        })
    }
}

impl Carrier {
    /// Name of the carrier in `connect`.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Serial => "serial:",
            Self::Tcp => "tcp:",
            Self::Udp => "udp:",
            Self::Can => "can:",
            Self::Hid => "hid:",
            Self::I2c => "i2c:",
        }
    }
}

impl fmt::Display for UsbIdentity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:04x}:{:04x}", self.vendor, self.product)?;
        self.serial.as_ref().map_or(Ok(()), |serial| write!(f, ":{serial}"))
    }
}

impl fmt::Display for Connect {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Serial { port: SerialPort::Path(path), baud } => write!(f, "serial:{path}?baud={baud}"),
            Self::Serial { port: SerialPort::Usb(usb), baud } => write!(f, "serial:usb:{usb}?baud={baud}"),
            Self::Tcp { address } => write!(f, "tcp:{address}"),
            Self::Udp { address } => write!(f, "udp:{address}"),
            Self::UdpListen { address, from } => {
                write!(f, "udp-listen:{address}")?;
                from.as_ref().map_or(Ok(()), |from| write!(f, "?from={from}"))
            }
            Self::Can { interface } => write!(f, "can:{interface}"),
            Self::Hid(usb) => write!(f, "hid:{usb}"),
            Self::I2c { bus, address } => write!(f, "i2c:{bus}:{address:#04x}"),
        }
    }
}

fn serial(rest: &str) -> Result<Connect, String> {
    let (place, options) =
        rest.split_once('?').map_or((rest, None), |(place, options)| (place, Some(options)));
    let mut baud = USUAL_BAUD;
    for option in options.iter().flat_map(|options| options.split('&')) {
        match option.split_once('=') {
            Some(("baud", rate)) => {
                baud =
                    rate.parse().ok().filter(|rate| (1..=MAX_BAUD).contains(rate)).ok_or_else(|| {
                        format!("baud={rate:?} must be a whole number from 1 to {MAX_BAUD}")
                    })?;
            }
            _ => return Err(format!("unknown option {option:?}; allowed is baud=RATE")),
        }
    }
    let port = match place.strip_prefix("usb:") {
        Some(identity) => SerialPort::Usb(usb(identity)?),
        None if place.starts_with('/') => SerialPort::Path(place.to_owned()),
        None => return Err(format!("{place:?} is not a path; it must begin with /")),
    };
    Ok(Connect::Serial { port, baud })
}

fn usb(rest: &str) -> Result<UsbIdentity, String> {
    let mut parts = rest.splitn(3, ':');
    let mut number = |what: &str| {
        let digits = parts.next().filter(|digits| !digits.is_empty());
        let digits = digits.ok_or_else(|| format!("there is no {what} id"))?;
        let parsed: Result<u16, ParseIntError> = u16::from_str_radix(digits, 16);
        parsed.map_err(|_| format!("{what} id {digits:?} must be hexadecimal, 0000 to ffff"))
    };
    let (vendor, product) = (number("vendor")?, number("product")?);
    let serial = parts.next().map(str::to_owned);
    if serial.as_ref().is_some_and(String::is_empty) {
        return Err(
            "the serial number is empty; to accept any serial number, remove the last colon".to_owned()
        );
    }
    Ok(UsbIdentity { vendor, product, serial })
}

fn udp_listen(rest: &str) -> Result<Connect, String> {
    let Some((address, option)) = rest.split_once('?') else {
        return host_and_port(rest).map(|address| Connect::UdpListen { address, from: None });
    };
    let from = option
        .strip_prefix("from=")
        .ok_or_else(|| format!("unknown option {option:?}; allowed is from=HOST"))?;
    if from.is_empty() {
        return Err("from= is empty; to accept the first valid sender, remove ?from=".to_owned());
    }
    // Several colons mean an IPv6 address, which may come without a port.
    if from.matches(':').count() == 1 {
        host_and_port(from).map_err(|problem| format!("from={from:?}: {problem}"))?;
    }
    Ok(Connect::UdpListen { address: host_and_port(address)?, from: Some(from.to_owned()) })
}

fn host_and_port(rest: &str) -> Result<String, String> {
    let (host, port) = rest.rsplit_once(':').ok_or_else(|| "there is no port".to_owned())?;
    if host.is_empty() {
        return Err("there is no host".to_owned());
    }
    match port.parse::<u16>() {
        Ok(1..) => Ok(rest.to_owned()),
        _ => Err(format!("port {port:?} must be a whole number from 1 to 65535")),
    }
}

/// Checks the name of a network interface. It has at most 15 characters (Linux, IFNAMSIZ).
fn can_interface(rest: &str) -> Result<String, String> {
    let allowed = |c: char| c.is_ascii_graphic() && c != '/' && c != ':';
    if rest.is_empty() || rest.len() > 15 || !rest.chars().all(allowed) {
        return Err(format!("{rest:?} is not an interface name"));
    }
    Ok(rest.to_owned())
}

fn i2c(rest: &str) -> Result<Connect, String> {
    let (bus, address) = rest.rsplit_once(':').ok_or_else(|| "there is no address".to_owned())?;
    if !bus.starts_with('/') {
        return Err(format!("bus {bus:?} is not a path; it must begin with /"));
    }
    let digits = address.strip_prefix("0x");
    let number = digits.and_then(|digits| u8::from_str_radix(digits, 16).ok());
    // Addresses below 8 and above 119 are reserved. Source: I2C specification, UM10204, table 4.
    match number {
        Some(address @ 0x08..=0x77) => Ok(Connect::I2c { bus: bus.to_owned(), address }),
        _ => Err(format!("address {address:?} must be 0x08 to 0x77")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn error(text: &str) -> String {
        Connect::parse(text).unwrap_err().to_string()
    }

    #[test]
    fn every_connect_form_parses_and_prints_unchanged() {
        for text in [
            "serial:/dev/serial/by-id/usb-FTDI_A10K-if00?baud=115200",
            "serial:usb:0403:6001?baud=9600",
            "serial:usb:0403:6001:A10K?baud=115200",
            "tcp:192.168.0.5:4040",
            "udp:blueos.local:9090",
            "udp-listen:0.0.0.0:14550",
            "udp-listen:0.0.0.0:14550?from=192.168.2.2",
            "udp-listen:0.0.0.0:14550?from=192.168.2.2:14551",
            "udp-listen:[::]:14550?from=fe80::1",
            "can:vcan0",
            "hid:1209:0001",
            "hid:1209:0001:COUNTER-7",
            "i2c:/dev/i2c-1:0x40",
        ] {
            assert_eq!(Connect::parse(text).unwrap().to_string(), text);
        }
        let Connect::Serial { baud, .. } = Connect::parse("serial:/dev/ttyS0").unwrap() else { panic!() };
        assert_eq!(baud, 115_200);
    }

    #[test]
    fn connect_error_names_the_fault_and_the_allowed_form() {
        for (text, named, right) in [
            ("", "it is empty", "tcp:HOST:PORT"),
            ("/dev/ttyUSB0", "no colon", "serial:/dev"),
            ("usb:1", "unknown carrier \"usb\"", "can:INTERFACE"),
            ("serial:ttyUSB0", "\"ttyUSB0\" is not a path", "serial:/dev"),
            ("serial:/dev/a?baud=fast", "baud=\"fast\"", "serial:/dev"),
            ("serial:/dev/a?speed=9600", "unknown option \"speed=9600\"", "serial:/dev"),
            ("tcp:192.168.0.5", "no port", "tcp:192.168.0.5:4040"),
            ("tcp::80", "no host", "tcp:192.168.0.5:4040"),
            ("udp:host:0", "port \"0\"", "udp:192.168.2.2:9090"),
            ("udp:host:70000", "port \"70000\"", "udp:192.168.2.2:9090"),
            ("udp-listen:0.0.0.0:14550?to=a", "unknown option \"to=a\"", "?from=192.168.2.2"),
            ("udp-listen:0.0.0.0:14550?from=", "from= is empty", "?from=192.168.2.2"),
            ("udp-listen:0.0.0.0:14550?from=a:b", "port \"b\"", "?from=192.168.2.2"),
            ("udp-listen:0.0.0.0?from=a", "no port", "?from=192.168.2.2"),
            ("can:", "\"\" is not an interface name", "can:can0"),
            ("can:an interface", "is not an interface name", "can:can0"),
            ("hid:1209", "no product id", "hid:1209:0001"),
            ("hid:1209:xyz", "product id \"xyz\"", "hid:1209:0001"),
            ("hid:1209:0001:", "serial number is empty", "hid:1209:0001"),
            ("i2c:/dev/i2c-1", "no address", "i2c:/dev/i2c-1:0x40"),
            ("i2c:/dev/i2c-1:64", "address \"64\"", "i2c:/dev/i2c-1:0x40"),
            ("i2c:/dev/i2c-1:0x7f", "address \"0x7f\"", "i2c:/dev/i2c-1:0x40"),
        ] {
            let error = error(text);
            assert!(error.contains(named) && error.contains(right), "{text}: {error}");
        }
    }

    #[test]
    fn unsupported_carrier_is_rejected() {
        let error = Connect::parse("can:can0").unwrap().among(&[Carrier::Serial, Carrier::Tcp]).unwrap_err();
        assert_eq!(
            error.to_string(),
            "connect = \"can:can0\": a device of this kind cannot use can:; it can use serial: or tcp:"
        );
    }
}
