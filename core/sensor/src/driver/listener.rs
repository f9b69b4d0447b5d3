//! Drivers of devices that transmit without being polled.

use super::cutter::Cutter;
use super::interface::{DeviceHealth, Driver, Wire};
use crate::codec::Framing;
use headrace_geometry::time::{DurNs, MonoNs};

/// Driver that only listens to a device's byte stream. It delivers the whole stream, frame by frame.
pub struct Listener<F, const N: usize> {
    cutter: Cutter<F, N>,
    silence_timeout: DurNs,
}

impl<F: Framing, const N: usize> Listener<F, N> {
    /// Creates a listener.
    ///
    /// `silence` is the longest usual gap within a frame. `silence_timeout` is the longest gap between messages of
    /// a healthy device.
    pub fn new(framing: F, silence: DurNs, silence_timeout: DurNs) -> Self {
        Self { cutter: Cutter::new(framing, silence), silence_timeout }
    }
}

impl<F: Framing + Send, const N: usize> Driver for Listener<F, N> {
    fn opened(&mut self, _: MonoNs, _: &mut dyn Wire) {}

    fn closed(&mut self, wire: &mut dyn Wire) {
        self.cutter.flush(&mut |piece| wire.deliver(piece.received, piece.bytes));
    }

    fn heard(&mut self, received: MonoNs, bytes: &[u8], wire: &mut dyn Wire) {
        self.cutter.push(received, bytes, &mut |piece| wire.deliver(piece.received, piece.bytes));
    }

    fn accepts(&self, bytes: &[u8]) -> bool {
        self.cutter.accepts(bytes, |_| true)
    }

    fn due(&self) -> Option<MonoNs> {
        self.cutter.settles()
    }

    fn wake(&mut self, now: MonoNs, wire: &mut dyn Wire) {
        self.heard(now, &[], wire);
    }

    fn silence_timeout(&self) -> DurNs {
        self.silence_timeout
    }

    fn health(&self) -> DeviceHealth {
        DeviceHealth { good_frames: self.cutter.counts().good_frames, ..DeviceHealth::default() }
    }
}

/// Function that returns the fault of a message; `None` for a good message of the device.
pub type Judge = Box<dyn Fn(&[u8]) -> Option<String> + Send>;

/// Driver that only listens to a device on a carrier of whole messages. It delivers every message.
pub struct MessageListener {
    judge: Judge,
    silence_timeout: DurNs,
    good_frames: u64,
    complaint: Option<String>,
}

impl MessageListener {
    /// Creates a listener.
    ///
    /// `judge` recognises faulty messages and messages of other devices. `silence_timeout` is the longest gap between
    /// messages of a healthy device.
    pub fn new(judge: Judge, silence_timeout: DurNs) -> Self {
        Self { judge, silence_timeout, good_frames: 0, complaint: None }
    }
}

impl Driver for MessageListener {
    fn opened(&mut self, _: MonoNs, _: &mut dyn Wire) {
        self.complaint = None;
    }

    fn heard(&mut self, received: MonoNs, bytes: &[u8], wire: &mut dyn Wire) {
        wire.deliver(received, bytes);
        self.complaint = (self.judge)(bytes);
        self.good_frames += u64::from(self.complaint.is_none());
    }

    fn accepts(&self, bytes: &[u8]) -> bool {
        (self.judge)(bytes).is_none()
    }

    fn due(&self) -> Option<MonoNs> {
        None
    }

    fn wake(&mut self, _: MonoNs, _: &mut dyn Wire) {}

    fn silence_timeout(&self) -> DurNs {
        self.silence_timeout
    }

    fn health(&self) -> DeviceHealth {
        DeviceHealth {
            good_frames: self.good_frames,
            complaint: self.complaint.clone(),
            ..DeviceHealth::default()
        }
    }
}
