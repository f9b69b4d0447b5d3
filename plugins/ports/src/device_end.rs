//! Emulates the device end of a line, for rehearsals: pseudoterminals, TCP, UDP, and the kernel's CAN and HID.
//!
//! The host opens the other end as it opens a real port.

use std::fs::File;
use std::io::{self, Read as _, Write as _};
use std::net::{IpAddr, SocketAddr, TcpListener, TcpStream, ToSocketAddrs, UdpSocket};
use std::os::fd::{AsFd, BorrowedFd};

use headrace_sensor::connect::{Connect, SerialPort, UsbIdentity};
use headrace_sensor::driver::Carrier;
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::fs::{OFlags, fcntl_getfl, fcntl_setfl};
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{OptionalActions, tcgetattr, tcsetattr};

use crate::lines::READ_BYTES;
use crate::uhid::{self, Identity, VirtualDevice};

/// Baud rate that the host sets on an emulated serial port.
const BAUD: u32 = 115_200;

/// The device end of an emulated line.
pub struct EmulatedPort {
    end: End,
    /// Address at which the host opens its end of the line.
    connect: Connect,
}

enum End {
    Pty {
        master: File,
    },
    Tcp {
        listener: TcpListener,
        stream: Option<TcpStream>,
    },
    Udp {
        socket: UdpSocket,
        peers: Vec<SocketAddr>,
    },
    #[cfg(target_os = "linux")]
    Can {
        interface: String,
        /// Socket on the interface; `None` while the interface doesn't exist.
        socket: Option<socketcan::CanSocket>,
    },
    Hid(VirtualDevice<File>),
}

/// Maximum number of hosts served by an emulated UDP bridge.
const MAX_PEERS: usize = 8;

impl EmulatedPort {
    /// Opens a device end on `carrier`. A network end listens on address `at`.
    ///
    /// Errors: the system can't provide such a port, or refuses it.
    pub fn new(carrier: Carrier, at: IpAddr) -> io::Result<Self> {
        match carrier {
            Carrier::Serial => pty(),
            Carrier::Tcp => tcp((at, 0)),
            Carrier::Udp | Carrier::I2c => udp((at, 0)),
            #[cfg(target_os = "linux")]
            Carrier::Can => Self::can("vcan0"),
            other => Err(io::Error::new(
                io::ErrorKind::Unsupported,
                format!("rehearsing on {} isn't possible here", other.as_str()),
            )),
        }
    }

    /// Reopens a network end at a known address, as a network device does after a power cycle.
    ///
    /// Errors: the address is in use, or the system chooses the address on this carrier.
    pub fn again(connect: &Connect) -> io::Result<Self> {
        match connect {
            Connect::Tcp { address } => tcp(address),
            Connect::Udp { address } => udp(address),
            other => Err(io::Error::new(
                io::ErrorKind::Unsupported,
                format!("{other} can't be reopened; the system chooses its name"),
            )),
        }
    }

    /// Creates a HID device with this identity through the kernel's uhid.
    ///
    /// Errors: the kernel has no uhid, or this user may not open it.
    pub fn hid(identity: &UsbIdentity, descriptor: &[u8]) -> io::Result<Self> {
        let kernel = File::options().read(true).write(true).open(uhid::PATH)?;
        let serial = identity.serial.as_deref().unwrap_or_default();
        let (vendor_id, product_id) = (identity.vendor, identity.product);
        let identity = Identity { name: "headrace rehearsal", serial, vendor_id, product_id, descriptor };
        let device = VirtualDevice::plug(kernel, &identity).map_err(io::Error::other)?;
        let serial = (!serial.is_empty()).then(|| serial.to_owned());
        let connect = Connect::Hid(UsbIdentity { vendor: vendor_id, product: product_id, serial });
        Ok(Self { end: End::Hid(device), connect })
    }

    /// Opens a device end on a CAN bus.
    ///
    /// Errors: the interface doesn't exist.
    #[cfg(target_os = "linux")]
    pub fn can(interface: &str) -> io::Result<Self> {
        let socket = Some(can_socket(interface)?);
        let interface = interface.to_owned();
        let connect = Connect::Can { interface: interface.clone() };
        Ok(Self { end: End::Can { interface, socket }, connect })
    }

    /// Returns the address at which the host opens its end of the line.
    pub fn connect(&self) -> &Connect {
        &self.connect
    }

    /// Whether a host is connected, as far as this can be detected.
    pub fn is_called(&self) -> bool {
        match &self.end {
            End::Pty { master } => {
                let mut polled = [PollFd::new(master, PollFlags::IN)];
                // Polling a pseudoterminal's master reports a hang-up while no host has the terminal open.
                poll(&mut polled, Some(&Timespec { tv_sec: 0, tv_nsec: 0 })).is_ok()
                    && polled.iter().all(|end| !end.revents().contains(PollFlags::HUP))
            }
            End::Tcp { stream, .. } => stream.is_some(),
            End::Udp { peers, .. } => !peers.is_empty(),
            #[cfg(target_os = "linux")]
            End::Can { .. } => true,
            End::Hid(_) => true,
        }
    }

    /// Returns the next message from the host, without blocking. An empty message is a keep-alive.
    ///
    /// Errors: this end has failed. A disconnected host is no error.
    pub fn read(&mut self) -> io::Result<Option<Vec<u8>>> {
        let mut buffer = [0; READ_BYTES];
        let read = match &mut self.end {
            End::Pty { master } => master.read(&mut buffer),
            End::Tcp { listener, stream } => {
                if let Ok((accepted, _)) = listener.accept() {
                    accepted.set_nonblocking(true)?;
                    accepted.set_nodelay(true)?;
                    *stream = Some(accepted);
                }
                let Some(open) = stream else { return Ok(None) };
                let read = open.read(&mut buffer);
                if matches!(read, Ok(0)) || read.as_ref().is_err_and(is_gone) {
                    *stream = None;
                    return Ok(None);
                }
                read
            }
            End::Udp { socket, peers } => socket.recv_from(&mut buffer).map(|(count, peer)| {
                if !peers.contains(&peer) {
                    peers.truncate(MAX_PEERS - 1);
                    peers.insert(0, peer);
                }
                count
            }),
            #[cfg(target_os = "linux")]
            End::Can { .. } => return Ok(None),
            // A HID device end receives no messages: the kernel would return only events such as open and
            // close.
            End::Hid(_) => return Ok(None),
        };
        match read {
            Ok(count) => Ok(buffer.get(..count).map(<[u8]>::to_vec)),
            Err(error) if is_gone(&error) || error.kind() == io::ErrorKind::WouldBlock => Ok(None),
            Err(error) => Err(error),
        }
    }

    /// Sends a message of the device. The message is lost if no host is connected or reads it.
    ///
    /// Errors: this end has failed.
    pub fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
        let written = match &mut self.end {
            End::Pty { master } => master.write_all(bytes),
            End::Tcp { stream, .. } => stream.as_mut().map_or(Ok(()), |open| open.write_all(bytes)),
            End::Udp { socket, peers } => {
                peers.retain(|peer| socket.send_to(bytes, *peer).is_ok_and(|sent| sent == bytes.len()));
                Ok(())
            }
            #[cfg(target_os = "linux")]
            End::Can { interface, socket } => write_can(interface, socket, bytes),
            End::Hid(device) => device.report(bytes).map_err(io::Error::other),
        };
        match written {
            Err(error) if is_gone(&error) || error.kind() == io::ErrorKind::WouldBlock => Ok(()),
            other => other,
        }
    }

    fn fds(&self) -> Vec<BorrowedFd<'_>> {
        match &self.end {
            End::Pty { master } => vec![master.as_fd()],
            End::Tcp { listener, stream } => {
                std::iter::once(listener.as_fd()).chain(stream.as_ref().map(AsFd::as_fd)).collect()
            }
            End::Udp { socket, .. } => vec![socket.as_fd()],
            #[cfg(target_os = "linux")]
            End::Can { .. } => Vec::new(),
            End::Hid(_) => Vec::new(),
        }
    }
}

/// Waits until one of the device ends has input, or until `wait_ns` nanoseconds have passed.
pub fn wait_for_any<'a>(stands: impl IntoIterator<Item = &'a EmulatedPort>, wait_ns: u32) {
    // Pseudoterminals without a host are left out: they report a hang-up at once, so poll would never wait.
    let open = stands.into_iter().filter(|stand| !matches!(stand.end, End::Pty { .. }) || stand.is_called());
    let fds: Vec<BorrowedFd<'_>> = open.flat_map(EmulatedPort::fds).collect();
    let mut polled: Vec<PollFd<'_>> = fds.iter().map(|fd| PollFd::new(fd, PollFlags::IN)).collect();
    let wait = Timespec { tv_sec: 0, tv_nsec: i64::from(wait_ns.min(999_999_999)) };
    // A signal may end the wait early, which does no harm.
    poll(&mut polled, Some(&wait)).unwrap_or_default();
}

/// Whether an error means that the host has closed its end of the line.
fn is_gone(error: &io::Error) -> bool {
    /// A pseudoterminal's master returns this error while no host has the terminal open. Source: Linux, EIO.
    const EIO: i32 = 5;
    use io::ErrorKind as E;
    error.raw_os_error() == Some(EIO)
        || matches!(
            error.kind(),
            E::ConnectionReset | E::BrokenPipe | E::ConnectionRefused | E::ConnectionAborted
        )
}

fn pty() -> io::Result<EmulatedPort> {
    let master = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC)?;
    grantpt(&master)?;
    unlockpt(&master)?;
    let path = ptsname(&master, Vec::new())?.to_string_lossy().into_owned();
    // Raw mode without echo must be set before the host opens the terminal.
    let mut settings = tcgetattr(&master)?;
    settings.make_raw();
    tcsetattr(&master, OptionalActions::Now, &settings)?;
    let flags = fcntl_getfl(&master)?;
    fcntl_setfl(&master, flags | OFlags::NONBLOCK)?;
    let connect = Connect::Serial { port: SerialPort::Path(path), baud: BAUD };
    Ok(EmulatedPort { end: End::Pty { master: File::from(master) }, connect })
}

fn tcp(at: impl ToSocketAddrs) -> io::Result<EmulatedPort> {
    let listener = TcpListener::bind(at)?;
    listener.set_nonblocking(true)?;
    let connect = Connect::Tcp { address: listener.local_addr()?.to_string() };
    Ok(EmulatedPort { end: End::Tcp { listener, stream: None }, connect })
}

fn udp(at: impl ToSocketAddrs) -> io::Result<EmulatedPort> {
    let socket = UdpSocket::bind(at)?;
    socket.set_nonblocking(true)?;
    let connect = Connect::Udp { address: socket.local_addr()?.to_string() };
    Ok(EmulatedPort { end: End::Udp { socket, peers: Vec::new() }, connect })
}

#[cfg(target_os = "linux")]
fn can_socket(interface: &str) -> io::Result<socketcan::CanSocket> {
    use socketcan::{Socket as _, SocketOptions as _};
    let socket = socketcan::CanSocket::open(interface)?;
    socket.set_filter_drop_all()?;
    Ok(socket)
}

/// Sends a frame, and reopens an interface that has reappeared.
///
/// The frame is lost while the interface is down or absent.
#[cfg(target_os = "linux")]
fn write_can(interface: &str, socket: &mut Option<socketcan::CanSocket>, bytes: &[u8]) -> io::Result<()> {
    /// `GONE`: no such device or address; no such device. `LOST`: network is down; no buffer space. Source: Linux,
    /// errno.
    const GONE: [i32; 2] = [6, 19];
    const LOST: [i32; 2] = [100, 105];
    let number = |error: &io::Error| error.raw_os_error().unwrap_or_default();
    if socket.is_none() {
        *socket = can_socket(interface).ok();
    }
    let Some(open) = socket else { return Ok(()) };
    match crate::lines::can::write(open, bytes) {
        Err(error) if GONE.contains(&number(&error)) => {
            *socket = None;
            Ok(())
        }
        Err(error) if LOST.contains(&number(&error)) => Ok(()),
        other => other,
    }
}

#[cfg(test)]
mod tests;
