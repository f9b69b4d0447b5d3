//! Cables of the simulated machine. They carry the data that the host's lines read and write, without ports, threads
//! or a real clock.

use std::collections::VecDeque;
use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::Duration;

use crossbeam::queue::SegQueue;
use headrace_geometry::time::{DurNs, MonoNs};
use headrace_ports::{Host, Line, OpenError, OpenErrorKind, READ_BYTES};
use headrace_sensor::connect::Connect;

/// Errors that an open line may return after its connection has broken.
pub const FAILURES: [io::ErrorKind; 4] = [
    io::ErrorKind::BrokenPipe,
    io::ErrorKind::ConnectionReset,
    io::ErrorKind::UnexpectedEof,
    io::ErrorKind::PermissionDenied,
];

/// The world's clock. Its time changes only when it is set.
#[derive(Default)]
pub struct Clock(AtomicU64);

impl Clock {
    /// Current time of the simulated world.
    pub fn now(&self) -> MonoNs {
        MonoNs(self.0.load(Ordering::SeqCst))
    }

    /// Sets the time of the simulated world.
    pub fn set(&self, now: MonoNs) {
        self.0.store(now.0, Ordering::SeqCst);
    }
}

/// A simulated cable between the machine and one device.
pub struct Cable {
    /// Address at which the simulated machine opens the cable.
    pub connect: Connect,
    /// Data that has arrived at the machine and is still unread.
    pub to_host: SegQueue<Vec<u8>>,
    /// Data sent by the machine.
    pub to_device: SegQueue<Vec<u8>>,
    /// Whether opening the device fails.
    pub refuses: AtomicBool,
    /// Whether the machine's writes to the device fail.
    pub deaf: AtomicBool,
    /// Number of breaks of the connection. A line that was opened before the latest break fails.
    breaks: AtomicU64,
    /// Error that lines return after the latest break, as an index of [`FAILURES`].
    failure: AtomicU64,
    /// Number of breaks before the latest opening, plus one; 0 before the first opening. The connection is intact if
    /// `opened` exceeds `breaks`.
    opened: AtomicU64,
    /// Number of unread datagrams that the machine has dropped since the last query.
    unread: AtomicU64,
}

/// Number of datagrams that the machine keeps for a port until somebody reads them.
const KEPT_DATAGRAMS: usize = 400;

impl Cable {
    /// Creates a cable without faults.
    pub fn new(connect: Connect) -> Self {
        let (to_host, to_device) = (SegQueue::new(), SegQueue::new());
        let [refuses, deaf] = [AtomicBool::new(false), AtomicBool::new(false)];
        let [breaks, failure, opened, unread] = [0; 4].map(AtomicU64::new);
        Self { connect, to_host, to_device, refuses, deaf, breaks, failure, opened, unread }
    }

    /// Delivers a message of the device. If too many datagrams are unread, the new one is dropped.
    pub fn arrive(&self, bytes: Vec<u8>) {
        if matches!(self.connect, Connect::Udp { .. }) && self.to_host.len() >= KEPT_DATAGRAMS {
            self.unread.fetch_add(1, Ordering::SeqCst);
        } else {
            self.to_host.push(bytes);
        }
    }

    /// Breaks the cable's connection. Data that the machine hasn't read yet is lost.
    pub fn break_off(&self, failure: usize) {
        while self.to_host.pop().is_some() {}
        self.failure.store(failure as u64, Ordering::SeqCst);
        self.breaks.fetch_add(1, Ordering::SeqCst);
    }

    /// Whether the machine has the cable open and the connection is intact.
    pub fn is_open(&self) -> bool {
        self.opened.load(Ordering::SeqCst) > self.breaks.load(Ordering::SeqCst)
    }

    fn error(&self) -> io::Error {
        let number = usize::try_from(self.failure.load(Ordering::SeqCst)).unwrap();
        io::Error::from(FAILURES[number % FAILURES.len()])
    }
}

/// The machine's clock and cables.
pub struct Machine {
    /// Clock of the machine.
    pub clock: Arc<Clock>,
    /// Cables of the machine.
    pub cables: Vec<Arc<Cable>>,
}

impl Host for Machine {
    fn now(&self) -> MonoNs {
        self.clock.now()
    }

    fn open(&self, connect: &Connect) -> Result<Box<dyn Line>, OpenError> {
        let cable = self.cables.iter().find(|cable| cable.connect == *connect).unwrap();
        if cable.refuses.load(Ordering::SeqCst) {
            let why = format!("opening {connect}: refused");
            return Err(OpenError { kind: OpenErrorKind::Absent, why, remedy: None });
        }
        let breaks = cable.breaks.load(Ordering::SeqCst);
        cable.opened.store(breaks + 1, Ordering::SeqCst);
        let (cable, clock) = (Arc::clone(cable), Arc::clone(&self.clock));
        Ok(Box::new(OpenCable { cable, clock, breaks, left: VecDeque::new() }))
    }
}

/// The simulated machine's end of an open cable.
struct OpenCable {
    cable: Arc<Cable>,
    clock: Arc<Clock>,
    breaks: u64,
    /// Rest of a message that was longer than the buffer of the last read.
    left: VecDeque<u8>,
}

impl OpenCable {
    fn sound(&self) -> io::Result<()> {
        let broken = self.cable.breaks.load(Ordering::SeqCst) != self.breaks;
        if broken { Err(self.cable.error()) } else { Ok(()) }
    }
}

impl Line for OpenCable {
    fn read(&mut self, _: Duration, into: &mut [u8; READ_BYTES]) -> io::Result<Option<(MonoNs, usize)>> {
        self.sound()?;
        if self.left.is_empty() {
            match self.cable.to_host.pop() {
                None => return Ok(None),
                Some(bytes) => self.left.extend(bytes),
            }
        }
        let count = self.left.len().min(into.len());
        for (place, byte) in into.iter_mut().zip(self.left.drain(..count)) {
            *place = byte;
        }
        Ok(Some((self.clock.now(), count)))
    }

    fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.sound()?;
        if self.cable.deaf.load(Ordering::SeqCst) {
            return Err(io::Error::from(io::ErrorKind::WriteZero));
        }
        self.cable.to_device.push(bytes.to_vec());
        Ok(())
    }

    fn dropped(&mut self) -> u64 {
        self.cable.unread.swap(0, Ordering::SeqCst)
    }

    /// Writes one message to the device. The answer arrives later as one message, as over UDP.
    fn exchange(
        &mut self,
        write: &[u8],
        _: DurNs,
        read_bytes: usize,
    ) -> io::Result<Option<(MonoNs, Vec<u8>)>> {
        self.write(&[write, &[u8::try_from(read_bytes).unwrap()]].concat())?;
        Ok(None)
    }
}
