//! Emulated devices on real ports, with faults of their lines.

use std::net::{IpAddr, Ipv4Addr};
use std::os::unix::fs::symlink;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use headrace_geometry::time::{DurNs, MonoNs};
use headrace_ports::{EmulatedPort, wait_for_any};
use headrace_sensor::connect::{Connect, SerialPort};
use headrace_sensor::device::{Direction, Emulated, Emulator};
use headrace_sensor::driver::Carrier;
use headrace_sensor::measurement::Measurement;

const LOCAL: IpAddr = IpAddr::V4(Ipv4Addr::LOCALHOST);
const WAIT_NS: u32 = 1_000_000;
const BAUD: u32 = 115_200;

/// A fault of a line between device and host, which changes the data on that line.
pub trait Fault: Send {
    /// Sends frame `number` of the device to the host.
    fn to_host(&mut self, number: u64, frame: &[u8], line: &mut Wire) {
        let _ = number;
        line.whole(frame);
    }

    /// Takes bytes that the host sent, and returns the bytes that reach the device.
    fn to_device(&mut self, bytes: Vec<u8>) -> Vec<u8> {
        bytes
    }

    /// Hook that runs in every cycle of the device's thread, between frames.
    fn meanwhile(&mut self, line: &mut Wire) {
        let _ = line;
    }
}

/// A line without faults.
pub struct Healthy;

impl Fault for Healthy {}

/// The device's end of a line, which can be unplugged and plugged in again at the same place.
pub struct End {
    connect: Connect,
    /// Stable name of a serial port: a symbolic link to the port's name in the system. `None` for other ports.
    link: Option<PathBuf>,
    stand: Option<EmulatedPort>,
    /// Whether the device shares the line of the previous sensor.
    beside: bool,
}

impl End {
    /// Creates the end of a serial port. The port has a stable name in `folder`, like the links that udev makes by a
    /// device's identity.
    pub fn serial(folder: &std::path::Path, name: &str) -> Self {
        let link = folder.join(name);
        let port = SerialPort::Path(link.display().to_string());
        let mut end = Self {
            connect: Connect::Serial { port, baud: BAUD },
            link: Some(link),
            stand: None,
            beside: false,
        };
        end.plug();
        end
    }

    /// Creates the end of a TCP port on this machine.
    pub fn tcp() -> Self {
        Self::of_network(Carrier::Tcp)
    }

    /// Creates the end of a UDP port on this machine.
    pub fn udp() -> Self {
        Self::of_network(Carrier::Udp)
    }

    fn of_network(carrier: Carrier) -> Self {
        let stand = EmulatedPort::new(carrier, LOCAL).unwrap();
        Self { connect: stand.connect().clone(), link: None, stand: Some(stand), beside: false }
    }

    /// The end of a device on a line that it shares with another device, whose end is `other`.
    pub fn beside(other: &Self) -> Self {
        Self { connect: other.connect.clone(), link: None, stand: None, beside: true }
    }

    /// Whether the device shares the line of the previous sensor.
    pub fn is_beside(&self) -> bool {
        self.beside
    }

    /// Whether the line is a serial port.
    pub fn is_pseudoterminal(&self) -> bool {
        self.link.is_some()
    }

    /// Returns the same end of the line, but the device isn't plugged in yet.
    #[must_use]
    pub fn absent(mut self) -> Self {
        self.unplug();
        self
    }

    /// Address that the host opens to reach the device.
    pub fn connect(&self) -> &Connect {
        &self.connect
    }

    fn plug(&mut self) {
        let Some(link) = &self.link else {
            self.stand = Some(EmulatedPort::again(&self.connect).unwrap());
            return;
        };
        let stand = EmulatedPort::new(Carrier::Serial, LOCAL).unwrap();
        let Connect::Serial { port: SerialPort::Path(path), .. } = stand.connect() else { panic!("a port") };
        symlink(path, link).unwrap();
        self.stand = Some(stand);
    }

    fn unplug(&mut self) {
        if let Some(link) = &self.link {
            std::fs::remove_file(link).unwrap();
        }
        self.stand = None;
    }
}

/// Controls and counters of an emulated device in a test.
#[derive(Default)]
pub struct Control {
    unplugged: AtomicBool,
    silent: AtomicBool,
    /// Whether the device sends nothing.
    quiet: AtomicBool,
    gone: AtomicBool,
    healed: AtomicBool,
    whole: AtomicU64,
}

impl Control {
    /// Unplugs the device as soon as the next request from the host arrives.
    pub fn unplug(&self) {
        self.unplugged.store(true, Ordering::SeqCst);
    }

    /// Plugs the device in again.
    pub fn plug(&self) {
        self.unplugged.store(false, Ordering::SeqCst);
    }

    /// Makes the device send nothing from now on.
    pub fn fall_silent(&self) {
        self.silent.store(true, Ordering::SeqCst);
        while !self.quiet.load(Ordering::SeqCst) {
            thread::sleep(Duration::from_millis(1));
        }
    }

    /// Ends the device's silence.
    pub fn speak(&self) {
        self.quiet.store(false, Ordering::SeqCst);
        self.silent.store(false, Ordering::SeqCst);
    }

    /// Ends the fault of the line.
    pub fn heal(&self) {
        self.healed.store(true, Ordering::SeqCst);
    }

    /// Number of frames that the device has sent whole.
    pub fn whole(&self) -> u64 {
        self.whole.load(Ordering::SeqCst)
    }
}

/// The device's end of the line, with the operations that faults may use.
pub struct Wire {
    end: End,
    control: Arc<Control>,
}

impl Wire {
    /// Sends a whole frame to the host and counts it.
    pub fn whole(&mut self, frame: &[u8]) {
        self.part(frame);
        let called = self.end.stand.as_ref().is_some_and(EmulatedPort::is_called);
        self.control.whole.fetch_add(u64::from(called), Ordering::SeqCst);
    }

    /// Sends bytes to the host that aren't a whole frame. They aren't counted.
    pub fn part(&mut self, bytes: &[u8]) {
        if let Some(stand) = &mut self.end.stand {
            stand.write(bytes).unwrap();
        }
    }

    /// Adds to the count of whole frames those that were sent without [`Wire::whole`].
    pub fn count(&self, frames: u64) {
        self.control.whole.fetch_add(frames, Ordering::SeqCst);
    }

    /// Waits for a time in milliseconds.
    pub fn pause(ms: u64) {
        thread::sleep(Duration::from_millis(ms));
    }
}

/// A device in its own thread, on a line that may fail.
pub struct Faulty {
    control: Arc<Control>,
    thread: Option<JoinHandle<()>>,
}

impl Faulty {
    /// Starts the devices of one line. They run until the returned value is dropped.
    pub fn start(devices: Vec<Emulated>, end: End, fault: Box<dyn Fault>) -> Self {
        let control = Arc::new(Control::default());
        control.unplugged.store(end.stand.is_none(), Ordering::SeqCst);
        let wire = Wire { end, control: Arc::clone(&control) };
        let mut life = Life { devices, wire, fault, frames_sent: 0, out: Vec::new() };
        let thread = thread::spawn(move || life.live());
        Self { control, thread: Some(thread) }
    }

    /// Controls and counters of the devices on this line.
    pub fn control(&self) -> &Control {
        &self.control
    }
}

impl Drop for Faulty {
    fn drop(&mut self) {
        self.control.gone.store(true, Ordering::SeqCst);
        let ended = self.thread.take().unwrap().join();
        assert!(ended.is_ok() || thread::panicking(), "a device's thread has panicked");
    }
}

struct Life {
    devices: Vec<Emulated>,
    wire: Wire,
    fault: Box<dyn Fault>,
    frames_sent: u64,
    out: Vec<Vec<u8>>,
}

impl Life {
    fn live(&mut self) {
        let control = Arc::clone(&self.wire.control);
        let is = |flag: &AtomicBool| flag.load(Ordering::SeqCst);
        while !is(&control.gone) {
            let plugged = self.wire.end.stand.is_some();
            control.quiet.store(is(&control.silent), Ordering::SeqCst);
            if plugged {
                self.serve(is(&control.silent), is(&control.unplugged));
            } else {
                self.step(None);
                self.out.clear();
                thread::sleep(Duration::from_millis(1));
                if !is(&control.unplugged) {
                    self.wire.end.plug();
                }
            }
        }
    }

    /// Passes the host's bytes to the device, and the device's bytes onto the line.
    fn serve(&mut self, silent: bool, unplugging: bool) {
        if let Some(stand) = &self.wire.end.stand {
            wait_for_any(std::slice::from_ref(stand), WAIT_NS);
        }
        let mut asked = false;
        while let Some(bytes) = self.wire.end.stand.as_mut().and_then(|stand| stand.read().unwrap()) {
            asked |= !bytes.is_empty();
            let healed = self.wire.control.healed.load(Ordering::SeqCst);
            let heard = if healed { bytes } else { self.fault.to_device(bytes) };
            if !heard.is_empty() {
                self.step(Some(&heard));
            }
        }
        self.step(None);
        let out = std::mem::take(&mut self.out);
        if unplugging && asked {
            // A new request shows that the host has read all earlier answers. The host gets half of the answer to this
            // request, and then the device is unplugged.
            if let Some(frame) = out.first() {
                self.wire.part(&frame[..frame.len() / 2]);
            }
            self.wire.end.unplug();
            return;
        }
        if silent {
            return;
        }
        for frame in out {
            self.frames_sent += 1;
            if self.wire.control.healed.load(Ordering::SeqCst) {
                self.wire.whole(&frame);
            } else {
                self.fault.to_host(self.frames_sent, &frame, &mut self.wire);
            }
        }
        if !self.wire.control.healed.load(Ordering::SeqCst) {
            self.fault.meanwhile(&mut self.wire);
        }
    }

    fn step(&mut self, heard: Option<&[u8]>) {
        let (now, out) = (headrace_ports::now(), &mut self.out);
        for device in &mut self.devices {
            feel(device, heard, now, out);
        }
    }
}

/// Passes received bytes to a device and lets it measure. The measured values are always the same.
fn feel(device: &mut Emulated, heard: Option<&[u8]>, now: MonoNs, out: &mut Vec<Vec<u8>>) {
    match device {
        Emulated::Head(device) | Emulated::Echosounder(device) => {
            step(device.as_mut(), heard, now, out, |sounding| sounding.range_m = Some(3.0));
        }
        Emulated::Depth(device) => {
            step(device.as_mut(), heard, now, out, |pressure| pressure.pressure_pa = 150_000.0);
        }
        Emulated::Tether(device) => {
            step(device.as_mut(), heard, now, out, |payout| payout.chainage_m = 5.0);
        }
        Emulated::Inertial(device) => step(device.as_mut(), heard, now, out, |_| ()),
        Emulated::VelocityLog(device) => step(device.as_mut(), heard, now, out, |_| ()),
    }
}

/// Passes received bytes to a device and lets it measure. The values that it measures come from `feel`.
pub(crate) fn step<M: Measurement>(
    device: &mut dyn Emulator<M>,
    heard: Option<&[u8]>,
    now: MonoNs,
    out: &mut Vec<Vec<u8>>,
    feel: impl Fn(&mut M),
) {
    let mut line = |direction, _, bytes: &[u8]| {
        if direction == Direction::Received {
            out.push(bytes.to_vec());
        }
    };
    if let Some(bytes) = heard {
        device.hear(now, bytes, &mut line);
    }
    let mut due = Vec::new();
    device.begin(now + DurNs(1), &mut due);
    for mut measured in due {
        feel(&mut measured);
        device.tell(&measured, &mut line);
    }
}
