//! Port of an emulated device, with faults that a real line may have.

use std::collections::VecDeque;
use std::io;
use std::net::{IpAddr, Ipv4Addr};
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};

use headrace_geometry::time::{DurNs, MonoNs};
use headrace_ports::EmulatedPort;
use headrace_sensor::connect::{Connect, SerialPort};
use headrace_sensor::driver::Carrier;

/// Time for which a restarted device is off. Echosounders and inertial units start within some seconds.
pub(super) const OFF: DurNs = DurNs(3_000_000_000);
/// Folder for the names of serial ports, in the output folder.
const PORTS: &str = "ports";

/// The port of an emulated device.
pub(super) struct Stand {
    pub(super) id: String,
    /// The device end of the line; `None` while it is unplugged.
    pub(super) port: Option<EmulatedPort>,
    /// Address at which the host opens its end.
    pub(super) connect: Connect,
    /// Link to a pseudoterminal. The pseudoterminal gets another name when the device is plugged in again.
    link: Option<PathBuf>,
    /// Report descriptor of a HID device.
    descriptor: Vec<u8>,
    pub(super) is_stalled: bool,
    pub(super) delay: DurNs,
    /// Time until which all messages are held back.
    held_until: MonoNs,
    /// Delayed messages, with the times at which they are due.
    late: VecDeque<(MonoNs, Vec<u8>)>,
    /// Time at which a restarted device gets power again.
    on_at: Option<MonoNs>,
}

impl Stand {
    /// Takes over the port of a device. A serial port gets a lasting name in `folder`.
    pub(super) fn new(id: &str, port: EmulatedPort, descriptor: Option<Vec<u8>>, folder: &Path) -> Self {
        let mut connect = port.connect().clone();
        let mut link = None;
        if let Connect::Serial { port: SerialPort::Path(path), .. } = &mut connect
            && let Some(name) = lasting_name(folder, id)
            && relink(path, Path::new(&name)).is_ok()
        {
            link = Some(PathBuf::from(&name));
            *path = name;
        }
        Self {
            id: id.to_owned(),
            port: Some(port),
            connect,
            link,
            descriptor: descriptor.unwrap_or_default(),
            is_stalled: false,
            delay: DurNs(0),
            held_until: MonoNs(0),
            late: VecDeque::new(),
            on_at: None,
        }
    }

    /// Whether the device hears and answers.
    fn is_on(&self) -> bool {
        !self.is_stalled && self.on_at.is_none()
    }

    /// The next message that the device hears. Messages to a silent device are lost.
    ///
    /// Errors: the port has failed.
    pub(super) fn read(&mut self) -> io::Result<Option<Vec<u8>>> {
        let is_on = self.is_on();
        let Some(port) = &mut self.port else { return Ok(None) };
        while let Some(bytes) = port.read()? {
            if is_on {
                return Ok(Some(bytes));
            }
        }
        Ok(None)
    }

    /// Sends a message of the device, after the delay. Messages of a silent device are lost.
    ///
    /// Errors: the port has failed.
    pub(super) fn send(&mut self, now: MonoNs, bytes: &[u8]) -> io::Result<()> {
        if !self.is_on() {
            return Ok(());
        }
        // A message never overtakes an earlier one.
        let due = self.late.back().map_or(now, |(due, _)| *due).max(now + self.delay).max(self.held_until);
        if due > now {
            self.late.push_back((due, bytes.to_vec()));
            return Ok(());
        }
        self.send_late(now)?;
        self.port.as_mut().map_or(Ok(()), |port| port.write(bytes))
    }

    /// Holds back all messages until this time.
    pub(super) fn hold(&mut self, until: MonoNs) {
        self.held_until = until;
    }

    /// Sends the delayed messages that are due.
    ///
    /// Errors: the port has failed.
    pub(super) fn send_late(&mut self, now: MonoNs) -> io::Result<()> {
        if now < self.held_until {
            return Ok(());
        }
        while let Some((_, bytes)) = self.late.pop_front_if(|(due, _)| *due <= now) {
            if let Some(port) = &mut self.port {
                port.write(&bytes)?;
            }
        }
        Ok(())
    }

    /// Closes the device's end of the line. Messages on their way are lost.
    pub(super) fn unplug(&mut self) {
        (self.port, self.on_at) = (None, None);
        self.late.clear();
        if let Some(link) = &self.link {
            remove_link(link);
        }
    }

    /// Opens the device's end of the line again, at the same address.
    ///
    /// Errors: the port can't be opened.
    pub(super) fn plug(&mut self) -> io::Result<()> {
        if self.port.is_some() {
            return Ok(());
        }
        let port = match &self.connect {
            Connect::Serial { .. } => {
                let no_link =
                    || io::Error::other("its pseudoterminal has no lasting name in the output folder");
                let link = self.link.as_ref().ok_or_else(no_link)?;
                let port = EmulatedPort::new(Carrier::Serial, IpAddr::V4(Ipv4Addr::LOCALHOST))?;
                if let Connect::Serial { port: SerialPort::Path(path), .. } = port.connect() {
                    relink(path, link)?;
                }
                port
            }
            #[cfg(target_os = "linux")]
            Connect::Can { interface } => EmulatedPort::can(interface)?,
            Connect::Hid(identity) => EmulatedPort::hid(identity, &self.descriptor)?,
            other => EmulatedPort::again(other)?,
        };
        self.port = Some(port);
        Ok(())
    }

    /// Switches the device off for a while. A device that is itself a network host or a USB device also leaves the
    /// line; the adapter of a serial line stays.
    pub(super) fn switch_off(&mut self, now: MonoNs) {
        if !matches!(self.connect, Connect::Serial { .. } | Connect::Can { .. }) {
            self.unplug();
        }
        self.late.clear();
        self.on_at = Some(now + OFF);
    }

    /// Switches a restarted device on when it is time. Returns whether it was switched on now.
    ///
    /// Errors: the port can't be opened.
    pub(super) fn switch_on(&mut self, now: MonoNs) -> io::Result<bool> {
        if self.on_at.is_none_or(|at| at > now) {
            return Ok(false);
        }
        self.on_at = None;
        self.plug().map(|()| true)
    }
}

impl Drop for Stand {
    fn drop(&mut self) {
        self.unplug();
    }
}

/// Name by which `connect` can refer to a serial port; `None` if the folder's name has characters that `connect` can't
/// have.
fn lasting_name(folder: &Path, id: &str) -> Option<String> {
    let folder = folder.canonicalize().ok()?.join(PORTS);
    std::fs::create_dir_all(&folder).ok()?;
    let name = folder.join(id).into_os_string().into_string().ok()?;
    let is_plain = |c: char| !c.is_control() && !matches!(c, '?' | '"' | '\\');
    name.chars().all(is_plain).then_some(name)
}

/// Makes `link` lead to a pseudoterminal. A link of an earlier rehearsal is replaced.
fn relink(terminal: &str, link: &Path) -> io::Result<()> {
    remove_link(link);
    symlink(terminal, link)
}

fn remove_link(link: &Path) {
    if std::fs::symlink_metadata(link).is_ok_and(|there| there.is_symlink()) {
        // If this fails, creating the new link fails, too.
        std::fs::remove_file(link).unwrap_or_default();
    }
}
