//! Service of one line, a connection to one or several devices: opens the line, serves the drivers of its devices, and
//! reopens the line after each failure.
//!
//! The service runs step by step. On real ports each service has its own thread.

use std::collections::VecDeque;
use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

use headrace_geometry::time::{DurNs, MonoNs};
use headrace_monitor::ring::{MAX_PACKET_BYTES, Port};
use headrace_sensor::connect::{Connect, ConnectError};
use headrace_sensor::driver::{Carrier, DeviceHealth, Driver, Wire};

use crate::backlog::{LateData, ReadTimes, Spread};
use crate::clock;
use crate::diagnosis;
use crate::host::Host;
use crate::lines::{self, Line, READ_BYTES, Senders};
use crate::open_error::OpenError;
use crate::status::{LineHistory, Phase, Status, StatusQueue};
use crate::wake::Waker;

/// Reconnect backoff: first pause, longest pause, and longest pause for local ports, which are cheap to retry.
const FIRST_PAUSE: DurNs = DurNs::from_millis(250);
const LONGEST_PAUSE: DurNs = DurNs::from_millis(4_000);
const LONGEST_LOCAL_PAUSE: DurNs = DurNs::from_millis(1_000);
/// Maximum wait between checks of the stop flag.
const LOOK: Duration = Duration::from_millis(50);
/// Interval between checks of the devices' health.
const STANDING_PERIOD: DurNs = DurNs::from_millis(500);
/// The reconnect backoff is reset if the line was open for at least this time and delivered a frame.
const LONG_ENOUGH: DurNs = DurNs::from_millis(2_000);
/// A line counts as read late if the read ended at least this long after its planned end.
const OVERSLEPT: DurNs = DurNs::from_millis(50);
/// Maximum number of bytes that are read at once after a stall.
const MOST_WAITING: usize = 1 << 20;
/// Keep-alive interval on an idle connection.
const KNOCK_PERIOD: DurNs = DurNs::from_millis(1_000);

/// Receives line events that are recorded without passing through the loop. Line threads call it.
///
/// Sensors are numbered as in the vehicle file.
pub trait LineRecord: Send + Sync {
    /// Records bytes sent to a sensor.
    fn sent(&self, sensor: usize, at: MonoNs, bytes: &[u8]);

    /// Records that packets of a sensor were dropped between two times.
    ///
    /// A packet is dropped if the ring is full, or if the carrier discards it unread.
    fn lost(&self, sensor: usize, from: MonoNs, to: MonoNs, packets: u64);
}

/// A sensor on a line, which is a connection to one or several devices.
pub struct Attached {
    /// Index of the sensor, in the order of the vehicle file.
    pub source: usize,
    /// Writing end of the sensor's ring buffer.
    pub port: Port,
    /// Driver of the device, which runs on the host.
    pub driver: Box<dyn Driver>,
}

/// State shared by all lines.
#[derive(Clone)]
pub struct Common {
    /// The host's clock and ports.
    pub host: Arc<dyn Host>,
    /// Flag that ends the services of all lines.
    pub stopping: Arc<AtomicBool>,
    /// Queue for changes of the devices' status.
    pub board: StatusQueue,
    /// Wakes the loop after packets have arrived.
    pub waker: Waker,
    /// Tells the loop that a line has read late data.
    pub late_data: LateData,
    /// Receives all messages sent to devices, and counts of dropped packets.
    pub record: Option<Arc<dyn LineRecord>>,
}

/// A line, which is a connection, and the devices on it.
pub struct LineService {
    connect: Result<Connect, ConnectError>,
    /// Addresses of the lines that precede this line in the vehicle file.
    before: Vec<Connect>,
    devices: Vec<AttachedState>,
    senders: Senders,
    common: Common,
    state: LineState,
    /// Pause before the next attempt to open the line.
    pause: DurNs,
}

enum LineState {
    /// The line is closed, and no attempt to open it is made before this time.
    Closed {
        until: MonoNs,
    },
    Open(OpenLine),
}

struct OpenLine {
    line: Box<dyn Line>,
    opened: MonoNs,
    /// Time of the next health check of the devices (`look_at`), and of the next keep-alive (`knock_at`).
    look_at: MonoNs,
    knock_at: MonoNs,
    /// Time at which the latest read ended, and the usual times of reads.
    read_at: MonoNs,
    times: ReadTimes,
}

/// A sensor with its connection state.
struct AttachedState {
    attached: Attached,
    history: LineHistory,
    /// Number of dropped packets already passed to [`LineRecord`], and time up to which they were counted.
    dropped_told: u64,
    dropped_until: MonoNs,
    status: Option<(Phase, String)>,
    /// Number of good frames so far (`frames`), and the number when the line was opened (`frames_before`).
    frames: u64,
    frames_before: u64,
    /// Times at which the latest bytes and the latest good frame arrived.
    last_bytes: MonoNs,
    last_frame: MonoNs,
}

/// State of a line after it has been served once.
enum Served {
    Open,
    /// All devices have been silent for longer than their timeouts, so the line is to be reopened.
    InSilence,
}

/// I/O that a driver has requested during a callback.
enum IoRequest {
    Send(Vec<u8>),
    Exchange { write: Vec<u8>, settle: DurNs, read_bytes: usize },
}

struct Ends<'a> {
    port: &'a mut Port,
    history: &'a mut LineHistory,
    requests: &'a mut VecDeque<IoRequest>,
}

impl Wire for Ends<'_> {
    fn send(&mut self, bytes: &[u8]) {
        self.requests.push_back(IoRequest::Send(bytes.to_vec()));
    }

    fn exchange(&mut self, write: &[u8], settle: DurNs, read_bytes: usize) {
        self.requests.push_back(IoRequest::Exchange { write: write.to_vec(), settle, read_bytes });
    }

    fn deliver(&mut self, received: MonoNs, bytes: &[u8]) {
        for part in bytes.chunks(MAX_PACKET_BYTES) {
            if self.port.send(received, part).is_err() {
                self.history.dropped += 1;
            }
        }
    }
}

impl LineService {
    /// Creates a closed line.
    ///
    /// `before` are the addresses of the lines that precede this line in the vehicle file. The line isn't opened if one
    /// of these addresses leads to the same device.
    pub fn new(
        connect: Result<Connect, ConnectError>,
        before: Vec<Connect>,
        attached: Vec<Attached>,
        common: Common,
    ) -> Self {
        let now = common.host.now();
        let device = |attached| AttachedState {
            attached,
            history: LineHistory::default(),
            dropped_told: 0,
            dropped_until: now,
            status: None,
            frames: 0,
            frames_before: 0,
            last_bytes: now,
            last_frame: now,
        };
        let (devices, senders) = (attached.into_iter().map(device).collect(), Senders::default());
        let state = LineState::Closed { until: now };
        Self { connect, before, devices, senders, common, state, pause: FIRST_PAUSE }
    }

    /// Serves the line until the stop flag is set. Returns each sensor's line history.
    pub(crate) fn run(mut self) -> Vec<(usize, LineHistory)> {
        let sensors: Vec<usize> = self.devices.iter().map(|device| device.attached.source).collect();
        let address = self.connect.as_ref().map_or_else(|error| error.text.clone(), Connect::to_string);
        let _span = tracing::info_span!("port", address, ?sensors).entered();
        while !self.stopping() {
            if self.closed_until().is_some_and(|until| self.common.host.now() < until) {
                thread::sleep(LOOK);
            } else {
                self.step();
            }
        }
        self.end()
    }

    /// Returns the time before which a closed line isn't tried again; `None` if the line is open.
    pub fn closed_until(&self) -> Option<MonoNs> {
        match self.state {
            LineState::Closed { until } => Some(until),
            LineState::Open(_) => None,
        }
    }

    /// Returns the time at which an open line must be stepped even without new bytes; `None` if the line is closed.
    pub fn due(&self) -> Option<MonoNs> {
        match &self.state {
            LineState::Closed { .. } => None,
            LineState::Open(open) => {
                let drivers = self.devices.iter().filter_map(|device| device.attached.driver.due()).min();
                Some(drivers.map_or(open.look_at, |due| due.min(open.look_at)).min(open.knock_at))
            }
        }
    }

    /// Opens the line if it is closed. If it is open, waits once for bytes, and serves the drivers.
    pub fn step(&mut self) {
        let closed = LineState::Closed { until: self.common.host.now() };
        self.state = match core::mem::replace(&mut self.state, closed) {
            LineState::Closed { .. } => self.open(),
            LineState::Open(mut open) => match self.serve(&mut open) {
                Ok(Served::Open) => LineState::Open(open),
                ended => {
                    self.count_dropped(open.line.as_mut());
                    self.ended(open.opened, ended.map(|_| ()))
                }
            },
        };
    }

    /// Closes the line, and delivers the bytes that its drivers still hold. Returns each sensor's line history.
    pub fn end(mut self) -> Vec<(usize, LineHistory)> {
        let closed = LineState::Closed { until: self.common.host.now() };
        if let LineState::Open(mut open) = core::mem::replace(&mut self.state, closed) {
            self.count_dropped(open.line.as_mut());
            self.closed();
            self.tell_dropped();
        }
        let strangers = self.senders.strangers.messages();
        let history = |mut device: AttachedState| {
            let own = device.attached.driver.health().strangers.messages();
            device.history.strangers = strangers + own;
            (device.attached.source, device.history)
        };
        self.devices.into_iter().map(history).collect()
    }

    /// Opens the line, unless a preceding line of the vehicle file uses the same device.
    fn open_line(&self, connect: &Connect) -> Result<Box<dyn Line>, OpenError> {
        match self.before.iter().find(|before| lines::same_device(before, connect)) {
            Some(other) => Err(OpenError::same_device(connect, other)),
            None => self.common.host.open(connect),
        }
    }

    fn open(&mut self) -> LineState {
        let connect = match self.connect.clone() {
            // A `connect` that doesn't parse stays invalid until the program is restarted.
            Err(error) => {
                self.say_all(Phase::Closed, &error.to_string());
                return LineState::Closed { until: self.common.host.now() + LONGEST_PAUSE };
            }
            Ok(connect) => connect,
        };
        let mut line = match self.open_line(&connect) {
            Ok(line) => line,
            Err(trouble) => {
                tracing::debug!(%trouble, "port not opened");
                self.say_all(Phase::Closed, &trouble.to_string());
                return self.rest();
            }
        };
        tracing::info!("port opened");
        let opened = self.common.host.now();
        match self.greet(line.as_mut(), opened) {
            Ok(()) => LineState::Open(OpenLine {
                line,
                opened,
                look_at: opened + STANDING_PERIOD,
                knock_at: opened + KNOCK_PERIOD,
                read_at: self.common.host.now(),
                times: ReadTimes::default(),
            }),
            Err(error) => self.ended(opened, Err(error)),
        }
    }

    /// Tells the drivers that their line is open.
    fn greet(&mut self, line: &mut dyn Line, opened: MonoNs) -> io::Result<()> {
        for device in &mut self.devices {
            device.history.opened += 1;
            device.frames_before = device.attached.driver.health().good_frames;
            (device.last_bytes, device.last_frame) = (opened, opened);
        }
        for number in 0..self.devices.len() {
            self.drive(line, number, |driver, wire| driver.opened(opened, wire))?;
        }
        Ok(())
    }

    /// Closes a line that was opened at `opened`, after a silence or an error.
    fn ended(&mut self, opened: MonoNs, ended: io::Result<()>) -> LineState {
        self.closed();
        self.tell_dropped();
        let served = self.common.host.now().since(opened);
        if served >= LONG_ENOUGH && self.devices.iter().any(|device| device.last_frame >= opened) {
            self.pause = FIRST_PAUSE;
        }
        self.count_lost();
        match ended {
            // The status isn't changed: the devices stay "silent" until they answer.
            Ok(()) => tracing::info!("no data, reopening the port"),
            Err(error) => self.lost(&error),
        }
        self.rest()
    }

    /// Closes the line for a while before the next attempt. Each consecutive pause is twice as long as the previous
    /// one, up to a maximum.
    fn rest(&mut self) -> LineState {
        tracing::debug!(backoff_s = self.pause.as_secs_f64(), "waiting before the next attempt");
        let until = self.common.host.now() + self.pause;
        self.pause = (self.pause + self.pause).min(self.longest_pause());
        LineState::Closed { until }
    }

    fn longest_pause(&self) -> DurNs {
        match self.connect {
            Ok(Connect::Tcp { .. } | Connect::Udp { .. }) => LONGEST_PAUSE,
            _ => LONGEST_LOCAL_PAUSE,
        }
    }

    fn stopping(&self) -> bool {
        self.common.stopping.load(Ordering::Relaxed)
    }

    fn lost(&mut self, error: &io::Error) {
        let why = diagnosis::losing(error);
        tracing::info!(%error, why, "connection lost");
        let Ok(connect) = self.connect.clone() else { return };
        self.say_all(Phase::Closed, &format!("lost {connect}: {why}; retrying"));
    }

    /// Delivers the bytes that the drivers still hold.
    fn closed(&mut self) {
        for AttachedState { attached: Attached { driver, port, .. }, history, .. } in &mut self.devices {
            driver.closed(&mut Ends { port, history, requests: &mut VecDeque::new() });
        }
        self.common.waker.wake();
    }

    fn count_lost(&mut self) {
        for device in &mut self.devices {
            device.history.lost += 1;
        }
    }

    /// Waits once for bytes, and serves the drivers.
    fn serve(&mut self, open: &mut OpenLine) -> io::Result<Served> {
        self.read(open)?;
        let OpenLine { line, look_at, knock_at, .. } = open;
        let line = line.as_mut();
        self.wake(line)?;
        let now = self.common.host.now();
        if now >= *knock_at {
            line.knock()?;
            *knock_at = now + KNOCK_PERIOD;
        }
        if now >= *look_at {
            *look_at = now + STANDING_PERIOD;
            self.look(line.complaint().as_deref(), now);
            self.count_dropped(line);
            self.tell_dropped();
            if self.devices.iter().all(|device| device.is_silent(now)) {
                return Ok(Served::InSilence);
            }
        }
        Ok(Served::Open)
    }

    /// Waits once for bytes, and passes them to the drivers. After a stall, passes on all bytes that waited.
    fn read(&mut self, open: &mut OpenLine) -> io::Result<()> {
        let wait = self.wait_for(self.common.host.now());
        let mut buffer = [0; READ_BYTES];
        let mut read = self.read_once(open.line.as_mut(), wait, &mut buffer)?;
        let now = self.common.host.now();
        let planned = DurNs(i64::try_from(wait.as_nanos()).unwrap_or(i64::MAX));
        let late = now.since(core::mem::replace(&mut open.read_at, now)) - planned;
        let is_late = late > OVERSLEPT;
        if is_late {
            for device in &mut self.devices {
                // The delay is the program's own fault, so the devices must not count as silent.
                device.last_bytes = (device.last_bytes + late).min(now);
                device.last_frame = (device.last_frame + late).min(now);
            }
            // A signal may have ended the wait. Drivers must take waiting bytes before they stop waiting for an answer.
            if read.is_none() {
                read = self.read_once(open.line.as_mut(), Duration::ZERO, &mut buffer)?;
            }
        }
        let Some((received, count)) = read else { return Ok(()) };
        open.knock_at = now + KNOCK_PERIOD;
        let bytes = buffer.get(..count).unwrap_or_default();
        // CAN frames need no correction, because the kernel states when it received each frame.
        if !self.is_on(&[Carrier::Can]) && open.times.may_be_burst(received, is_late) {
            return self.read_waiting(open, (received, bytes), is_late);
        }
        open.times.take(received, count);
        self.heard(open.line.as_mut(), received, bytes)
    }

    /// Reads all bytes that still wait after a first read. If they arrived late, they get the times at which they would
    /// have arrived.
    fn read_waiting(&mut self, open: &mut OpenLine, first: (MonoNs, &[u8]), is_late: bool) -> io::Result<()> {
        let line = open.line.as_mut();
        let mut parts = vec![(first.0, first.1.to_vec())];
        let (mut total, mut buffer) = (first.1.len(), [0; READ_BYTES]);
        let mut ended = Ok(());
        while total < MOST_WAITING {
            match self.read_once(line, Duration::ZERO, &mut buffer) {
                Ok(None) => break,
                Ok(Some((received, count))) => {
                    total += count;
                    parts.push((received, buffer.get(..count).unwrap_or_default().to_vec()));
                }
                // Bytes that were read before the connection was lost are still used.
                Err(error) => {
                    ended = Err(error);
                    break;
                }
            }
        }
        let now = self.common.host.now();
        let Some(spread) = open.times.take_waiting(now, total, is_late) else {
            parts.iter().try_for_each(|(received, bytes)| self.heard(line, *received, bytes))?;
            return ended;
        };
        tracing::debug!(bytes = total, is_late, "data arrived late in a burst");
        self.common.late_data.found(now);
        self.heard_late(line, &parts, &spread)?;
        ended
    }

    /// Passes late data to the drivers. A byte stream is passed in short parts, each with its own time.
    fn heard_late(
        &mut self,
        line: &mut dyn Line,
        parts: &[(MonoNs, Vec<u8>)],
        spread: &Spread,
    ) -> io::Result<()> {
        let is_stream = self.is_on(&[Carrier::Serial, Carrier::Tcp]);
        let mut before = 0;
        for (_, bytes) in parts {
            let part_bytes = if is_stream { spread.part_bytes() } else { bytes.len().max(1) };
            for part in bytes.chunks(part_bytes) {
                self.heard(line, spread.at(before), part)?;
                before += part.len();
            }
        }
        Ok(())
    }

    /// Whether the line's connection is on one of these carriers.
    fn is_on(&self, carriers: &[Carrier]) -> bool {
        self.connect.as_ref().is_ok_and(|connect| carriers.contains(&connect.carrier()))
    }

    fn read_once(
        &mut self,
        line: &mut dyn Line,
        wait: Duration,
        into: &mut [u8; READ_BYTES],
    ) -> io::Result<Option<(MonoNs, usize)>> {
        let devices = &self.devices;
        let is_valid = |bytes: &[u8]| devices.iter().any(|device| device.attached.driver.accepts(bytes));
        line.read_device(wait, into, &mut self.senders, &is_valid)
    }

    /// Reports to [`LineRecord`] how many packets were dropped since the previous report.
    fn tell_dropped(&mut self) {
        let now = self.common.host.now();
        for AttachedState { attached, history, dropped_told, dropped_until, .. } in &mut self.devices {
            let packets = history.dropped - *dropped_told;
            if let Some(record) = self.common.record.as_ref().filter(|_| packets > 0) {
                record.lost(attached.source, *dropped_until, now, packets);
            }
            (*dropped_told, *dropped_until) = (history.dropped, now);
        }
    }

    /// Counts messages that the system has dropped before they were read. They are counted as losses of the first
    /// device on the line, because the device that sent them isn't known.
    fn count_dropped(&mut self, line: &mut dyn Line) {
        let dropped = line.dropped();
        if let Some(first) = self.devices.first_mut().filter(|_| dropped > 0) {
            tracing::warn!(dropped, "messages were dropped unread: the computer stalled");
            first.history.dropped += dropped;
        }
    }

    /// Returns the maximum wait for bytes, which ends at the next deadline of a driver.
    fn wait_for(&self, now: MonoNs) -> Duration {
        let due = self.devices.iter().filter_map(|device| device.attached.driver.due()).min();
        due.map_or(LOOK, |due| clock::duration(due.since(now)).min(LOOK))
    }

    fn heard(&mut self, line: &mut dyn Line, received: MonoNs, bytes: &[u8]) -> io::Result<()> {
        for number in 0..self.devices.len() {
            if let Some(device) = self.devices.get_mut(number) {
                device.last_bytes = self.common.host.now();
            }
            self.drive(line, number, |driver, wire| driver.heard(received, bytes, wire))?;
        }
        self.common.waker.wake();
        Ok(())
    }

    /// Wakes drivers that are due, unless another driver on the line awaits an answer.
    ///
    /// Several drivers may await answers, e.g. just after the line was opened. The first of them is woken nevertheless,
    /// so that it can time out, because otherwise these drivers wait for each other for ever.
    fn wake(&mut self, line: &mut dyn Line) -> io::Result<()> {
        for number in 0..self.devices.len() {
            let now = self.common.host.now();
            let awaits = |device: &AttachedState| device.attached.driver.awaits();
            let Some(device) = self.devices.get(number) else { continue };
            let rivals = if awaits(device) { number } else { self.devices.len() };
            let mut others = self.devices.iter().take(rivals).enumerate();
            let awaited = others.any(|(other, device)| other != number && awaits(device));
            if device.attached.driver.due().is_some_and(|due| due <= now) && !awaited {
                self.drive(line, number, |driver, wire| driver.wake(now, wire))?;
                self.common.waker.wake();
            }
        }
        Ok(())
    }

    /// Calls a driver, and performs the I/O that it requests. The answer to a request may cause the driver to request
    /// more.
    fn drive(
        &mut self,
        line: &mut dyn Line,
        number: usize,
        call: impl FnOnce(&mut dyn Driver, &mut dyn Wire),
    ) -> io::Result<()> {
        let Some(device) = self.devices.get_mut(number) else { return Ok(()) };
        let AttachedState { attached: Attached { driver, port, source }, history, last_bytes, .. } = device;
        let mut requests = VecDeque::new();
        call(driver.as_mut(), &mut Ends { port, history, requests: &mut requests });
        while let Some(wish) = requests.pop_front() {
            match wish {
                IoRequest::Send(message) => {
                    self.common.note_sent(*source, &message);
                    line.write(&message)?;
                }
                IoRequest::Exchange { write, settle, read_bytes } => {
                    self.common.note_sent(*source, &write);
                    if let Some((received, answer)) = line.exchange(&write, settle, read_bytes)? {
                        *last_bytes = self.common.host.now();
                        driver.heard(received, &answer, &mut Ends { port, history, requests: &mut requests });
                    }
                }
            }
        }
        Ok(())
    }

    fn say_all(&mut self, phase: Phase, words: &str) {
        let now = self.common.host.now();
        for device in &mut self.devices {
            device.say(&self.common.board, now, phase, words);
        }
    }

    /// Updates the status of each device. If the line itself reports a problem, all its devices get this problem as
    /// their status.
    fn look(&mut self, complaint: Option<&str>, now: MonoNs) {
        for device in &mut self.devices {
            let (phase, words) = device.judge(now);
            let judged = (phase, with_senders(words, phase, &self.senders, device.attached.driver.as_ref()));
            if complaint.is_some() {
                // The line is at fault, not the device, so the device's silence timeout restarts.
                (device.last_bytes, device.last_frame) = (now, now);
            }
            let (phase, words) = complaint.map_or(judged, |words| (Phase::Closed, words.to_owned()));
            device.say(&self.common.board, now, phase, &words);
        }
    }
}

/// Adds the accepted sender and the rejected senders, if any, to the text of a status.
fn with_senders(words: String, phase: Phase, senders: &Senders, driver: &dyn Driver) -> String {
    let from = senders.believed.filter(|_| phase == Phase::Running).map(|sender| format!("from {sender}"));
    let parts = [(!words.is_empty()).then_some(words), from, senders.strangers.words()];
    let parts = parts.into_iter().chain([driver.health().strangers.words()]).flatten();
    parts.collect::<Vec<_>>().join("; ")
}

impl Common {
    fn note_sent(&self, source: usize, bytes: &[u8]) {
        if let Some(record) = &self.record {
            record.sent(source, self.host.now(), bytes);
        }
    }
}

impl AttachedState {
    fn is_silent(&self, now: MonoNs) -> bool {
        now.since(self.last_bytes) > self.attached.driver.silence_timeout()
    }

    /// Returns the phase of the device, with its reason.
    fn judge(&mut self, now: MonoNs) -> (Phase, String) {
        let silence_timeout = self.attached.driver.silence_timeout();
        let DeviceHealth { good_frames, identity, complaint, .. } = self.attached.driver.health();
        if good_frames != self.frames {
            self.frames = good_frames;
            // The frame arrived with the latest bytes, possibly before `now`.
            self.last_frame = self.last_bytes;
        }
        if let Some(complaint) = complaint {
            return (Phase::Wrong, complaint);
        }
        let seconds = silence_timeout.as_secs_f64();
        if now.since(self.last_frame) <= silence_timeout {
            if good_frames > self.frames_before {
                return (Phase::Running, identity.unwrap_or_default());
            }
            // After a silent line was reopened, its devices stay "silent" until they answer.
            let silent = self.status.clone().filter(|(phase, _)| *phase == Phase::Silent);
            let words = "the line is open, but no frame has arrived yet";
            return silent.unwrap_or_else(|| (Phase::Silent, words.to_owned()));
        }
        if self.is_silent(now) {
            (Phase::Silent, format!("no data for {seconds:.0} s; is it switched on?"))
        } else {
            let words = format!(
                "bytes arrive, but no frame for {seconds:.0} s; another device, or another baud rate?"
            );
            (Phase::Babbling, words)
        }
    }

    /// Posts a device's status to the queue if it has changed.
    fn say(&mut self, board: &StatusQueue, since: MonoNs, phase: Phase, words: &str) {
        if self.status.as_ref().is_some_and(|(last, said)| *last == phase && said == words) {
            return;
        }
        tracing::debug!(sensor = self.attached.source, phase = phase.as_str(), words, "status of a sensor");
        self.status = Some((phase, words.to_owned()));
        let status = Status { source: self.attached.source, since, phase, words: words.to_owned() };
        self.history.last = status.to_string();
        board.put(status);
    }
}
