//! Emulated devices at the far ends of the cables, with faults that affect their frames.

use std::collections::VecDeque;
use std::sync::Arc;
use std::sync::atomic::Ordering;

use headrace_geometry::frames::Vec3;
use headrace_geometry::time::{DurNs, MonoNs};
use headrace_sensor::connect::Connect;
use headrace_sensor::device::Emulated;

use super::cable::{Cable, FAILURES};
use super::plan::{CableFault, Window};
use crate::faulty::step;
use crate::random::Random;

/// Longest delay of a part of a frame, ns.
const LONGEST_DELAY_NS: usize = 80_000_000;

/// An emulated device at the far end of a simulated cable.
pub struct Device {
    emulated: Emulated,
    cable: Arc<Cable>,
    faults: Vec<Window<CableFault>>,
    /// Parts of frames on their way to the machine, with arrival times.
    under_way: VecDeque<(MonoNs, Vec<u8>)>,
    random: Random,
    /// Whether the cable carries a byte stream, which can be split anywhere. Otherwise each message arrives whole or
    /// never.
    is_stream: bool,
    was_broken: bool,
    /// Whether frames are also lost without a planned fault.
    loses: bool,
    whole: u64,
}

impl Device {
    /// Creates a device that is switched on. If `loses` is set, frames are also lost without a planned fault.
    pub fn new(
        emulated: Emulated,
        cable: Arc<Cable>,
        faults: Vec<Window<CableFault>>,
        loses: bool,
        random: Random,
    ) -> Self {
        let is_stream = matches!(cable.connect, Connect::Tcp { .. } | Connect::Serial { .. });
        let under_way = VecDeque::new();
        Self { emulated, cable, faults, under_way, random, is_stream, was_broken: false, loses, whole: 0 }
    }

    /// The device's cable.
    pub fn cable(&self) -> &Cable {
        &self.cable
    }

    /// Number of frames that the device has sent whole and in order over an open cable.
    pub fn whole(&self) -> u64 {
        self.whole
    }

    /// Whether no frame is lost on the cable. The cable may still delay and split frames.
    pub fn is_lossless(&self) -> bool {
        self.faults.iter().all(|fault| matches!(fault.what, CableFault::Cut | CableFault::Held))
    }

    /// Whether the plan has no fault for this device.
    pub fn is_untouched(&self) -> bool {
        self.faults.is_empty()
    }

    /// Whether the planned break of the connection has happened.
    pub fn is_broken(&self) -> bool {
        self.was_broken
    }

    /// Handles the bytes from the machine, measures, sends, and delivers the parts of frames that are due. If `quiet`
    /// is set, the device sends nothing new.
    pub fn step(&mut self, now: MonoNs, quiet: bool) {
        self.connection(now);
        let mut out = Vec::new();
        while let Some(bytes) = self.cable.to_device.pop() {
            feel(&mut self.emulated, Some(&bytes), now, &mut out);
        }
        feel(&mut self.emulated, None, now, &mut out);
        if !quiet && self.cable.is_open() {
            for frame in out {
                self.send(now, frame);
            }
        }
        while self.under_way.front().is_some_and(|(at, _)| *at <= now) {
            let (_, bytes) = self.under_way.pop_front().unwrap();
            if self.cable.is_open() {
                self.cable.arrive(bytes);
            }
        }
    }

    fn has(&self, fault: CableFault, now: MonoNs) -> bool {
        self.faults.iter().any(|window| window.what == fault && window.holds(now))
    }

    fn connection(&mut self, now: MonoNs) {
        let broken = self.has(CableFault::Broken, now);
        if broken && !self.was_broken {
            self.cable.break_off(self.random.below(FAILURES.len()));
            self.under_way.clear();
        }
        self.was_broken = broken;
        self.cable.refuses.store(broken, Ordering::SeqCst);
        self.cable.deaf.store(self.has(CableFault::Deaf, now), Ordering::SeqCst);
    }

    fn send(&mut self, now: MonoNs, mut frame: Vec<u8>) {
        if self.has(CableFault::Silent, now) {
            return;
        }
        if self.has(CableFault::Lost, now) && self.random.one_in(5) {
            return self.lose_some(now, frame);
        }
        if self.has(CableFault::Garbled, now) && self.random.one_in(5) {
            let at = self.random.below(frame.len());
            frame[at] ^= 1 << self.random.below(8);
            return self.put(now, frame);
        }
        if self.has(CableFault::Babble, now) && self.random.one_in(3) {
            let count = 1 + self.random.below(300);
            let noise = (0..count).map(|_| self.random.byte()).collect();
            self.put(now, noise);
        }
        self.whole += 1;
        if self.loses && self.whole.is_multiple_of(100) {
            return;
        }
        if self.has(CableFault::Doubled, now) && self.random.one_in(5) {
            self.put(now, frame.clone());
        }
        if self.has(CableFault::Disordered, now) && self.random.one_in(4) {
            // The delay lets messages that are sent later overtake this message.
            let late = now + DurNs(self.random.below(LONGEST_DELAY_NS) as i64);
            let place = self.under_way.partition_point(|(at, _)| *at <= late);
            return self.under_way.insert(place, (late, frame));
        }
        if self.is_stream && self.has(CableFault::Cut, now) {
            return self.cut(now, &frame);
        }
        let held = self.faults.iter().find(|fault| fault.what == CableFault::Held && fault.holds(now));
        let arrives = held.map_or(now, |held| held.to);
        self.put(arrives, frame);
    }

    /// Loses some bytes of a frame on a byte stream, or the whole frame on a carrier that keeps messages whole.
    fn lose_some(&mut self, now: MonoNs, mut frame: Vec<u8>) {
        if self.is_stream {
            let from = self.random.below(frame.len());
            let count = 1 + self.random.below(frame.len() - from);
            frame.drain(from..(from + count).min(frame.len()));
            self.put(now, frame);
        }
    }

    /// Delivers a frame in several parts with random delays.
    fn cut(&mut self, now: MonoNs, frame: &[u8]) {
        let mut rest = frame;
        let mut at = now;
        while !rest.is_empty() {
            let (part, after) = rest.split_at(1 + self.random.below(rest.len()));
            if self.random.one_in(2) {
                at = at + DurNs(self.random.below(LONGEST_DELAY_NS) as i64);
            }
            self.put(at, part.to_vec());
            rest = after;
        }
    }

    /// Queues a part of a frame. It arrives no earlier than the parts queued before it, because cables keep the order.
    fn put(&mut self, at: MonoNs, bytes: Vec<u8>) {
        let at = self.under_way.back().map_or(at, |(last, _)| at.max(*last));
        self.under_way.push_back((at, bytes));
    }
}

/// Speed of the vehicle, m/s.
pub const TRUE_SPEED_MPS: f64 = 0.2;

/// Chainage of the vehicle, m.
pub fn true_chainage_m(at: MonoNs) -> f64 {
    5.0 + TRUE_SPEED_MPS * at.since(MonoNs(0)).as_secs_f64()
}

/// Passes received bytes to a device and lets it measure. The vehicle moves along the axis of a pipe with a radius of
/// 3 m.
fn feel(device: &mut Emulated, heard: Option<&[u8]>, now: MonoNs, out: &mut Vec<Vec<u8>>) {
    match device {
        Emulated::Head(device) | Emulated::Echosounder(device) => {
            step(device.as_mut(), heard, now, out, |sounding| sounding.range_m = Some(3.0));
        }
        Emulated::Depth(device) => {
            step(device.as_mut(), heard, now, out, |pressure| pressure.pressure_pa = 150_360.0);
        }
        Emulated::Tether(device) => step(device.as_mut(), heard, now, out, |payout| {
            payout.chainage_m = true_chainage_m(payout.at);
        }),
        Emulated::Inertial(device) => step(device.as_mut(), heard, now, out, |inertia| {
            inertia.force_mps2 = Vec3::new(0.0, 0.0, 9.81);
        }),
        Emulated::VelocityLog(device) => step(device.as_mut(), heard, now, out, |_| ()),
    }
}
