//! When samples would have come that were late: the device's own clock tells how much later than usual.
//!
//! Buses, adapters and a busy host deliver samples in bursts. Of a unit that samples every 2.5 ms, several then have the same receive
//! time, and a jerk that one of them has felt would count for as long as the gap before it. The device's stamps tell the samples
//! apart: receive time less device time is usually near its minimum, and what a stamp came later than that, its sample came late.
//! Receive times still order everything; only the time of validity is put back.

use core::cmp::Ordering;

use serde::{Deserialize, Serialize};

use super::{ClockReport, DeviceClock};
use crate::reading::Reading;
use headrace_geometry::time::{DurNs, MonoNs};

/// How fast the usual delay follows stamps that come later than it, per second: more than clocks drift apart. It follows earlier ones
/// so many times as fast, and is so about the delay that one stamp in ten is below. A stamp that is garbled moves it no further.
const RISES: f64 = 1e-3;
const FALLS_TIMES: f64 = 9.0;
/// Longest time between stamps that counts, s.
const MOST_BETWEEN_S: f64 = 0.1;
/// Least lateness that is corrected: less comes of ticks, and of the frames of one sample being sent one after the other.
const LEAST: DurNs = DurNs(1_000_000);
/// Largest: a clock that stands still looks late, too, and navigation waits no longer for samples.
const MOST: DurNs = DurNs(150_000_000);

/// A device's clock, and the times of its samples. Allocates: never.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct SampleTimes {
    clock: DeviceClock,
    delay: UsualDelay,
    stamped: Option<Stamped>,
    last_reading: Option<MonoNs>,
    /// How much more often readings came soon after a stamp than a stamp soon after readings: some units send it last.
    leads: i8,
}

/// A stamped sample: when its stamp came, when that would usually have come, and which of its readings have.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
struct Stamped {
    received: MonoNs,
    usual: MonoNs,
    told: [bool; KINDS],
}

/// Rate, force, attitude: a stamp is of the first of each that follows it.
const KINDS: usize = 3;
/// How often it must have led more than not to be believed, and the limit of the count.
const SURE_LEADS: i8 = 8;
const MOST_LEADS: i8 = 16;

/// What receive time less device time usually is.
#[derive(Debug, Clone, Copy, Default, Serialize, Deserialize)]
struct UsualDelay {
    delay: Option<DurNs>,
    device: DurNs,
    received: MonoNs,
}

impl SampleTimes {
    /// Of a clock of `bits` bits (1 to 64) whose ticks are `tick` long, as [`DeviceClock::new`].
    pub fn new(bits: u32, tick: DurNs) -> Self {
        Self {
            clock: DeviceClock::new(bits, tick),
            delay: UsualDelay::default(),
            stamped: None,
            last_reading: None,
            leads: 0,
        }
    }

    /// Takes the stamp of a sample.
    pub fn stamp(&mut self, ticks: u64, received: MonoNs) {
        let device = self.clock.take(ticks, received);
        let late = self.delay.late(device, received);
        self.stamped = Some(Stamped { received, usual: received - late, told: [false; KINDS] });
    }

    /// When a reading received at `received` would have come if its sample weren't late; `received` of what follows no stamp, of
    /// what came about as soon as usual, of what is later than a queue explains, and of a unit that sends its stamps after its readings.
    pub fn arrival(&mut self, reading: &Reading, received: MonoNs) -> MonoNs {
        let kind = match reading {
            Reading::AngularRate(_) => 0,
            Reading::SpecificForce(_) => 1,
            Reading::Attitude(_) => 2,
            _ => return received,
        };
        let Some(stamped) = &mut self.stamped else { return received };
        let last = self.last_reading.replace(received);
        if let Some(last) = last.filter(|_| stamped.told == [false; KINDS]) {
            // In a burst they are the same, and say nothing.
            let lead = match received.since(stamped.received).cmp(&stamped.received.since(last)) {
                Ordering::Less => 1,
                Ordering::Equal => 0,
                Ordering::Greater => -1,
            };
            let leads = self.leads.saturating_add(lead);
            self.leads = leads.clamp(-MOST_LEADS, MOST_LEADS);
        }
        let is_told = stamped.told.get_mut(kind).is_none_or(|told| core::mem::replace(told, true));
        let late = received.since(stamped.usual);
        let is_late = (LEAST..=MOST).contains(&late);
        if is_late && !is_told && self.leads >= SURE_LEADS { stamped.usual } else { received }
    }

    /// Statistics of the clock.
    pub fn report(&self) -> ClockReport {
        self.clock.report()
    }
}

impl UsualDelay {
    /// How much later than usual a stamp came; zero for the first of an epoch of the clock.
    fn late(&mut self, device: DurNs, received: MonoNs) -> DurNs {
        let delay = received.since(MonoNs(0)) - device;
        let is_first = device <= DurNs::ZERO || device < self.device;
        let usual = self.delay.filter(|_| !is_first).unwrap_or(delay);
        let between_s = received.since(self.received).as_secs_f64().clamp(0.0, MOST_BETWEEN_S);
        let rise = DurNs::from_secs_f64(RISES * between_s);
        let change =
            if delay < usual { DurNs::from_secs_f64(-FALLS_TIMES * RISES * between_s) } else { rise };
        *self = Self { delay: Some(usual + change), device, received };
        delay - usual
    }
}

#[cfg(test)]
mod tests;
