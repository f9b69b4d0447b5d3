//! Corrected times of samples that arrive late, from the device's own clock.
//!
//! Buses, adapters and a busy host deliver samples in bursts. Several samples of a unit with a period of 2.5 ms then
//! have the same receive time. If receive times counted, the first sample of a burst would be valid for the whole gap
//! before the burst, even if it measured only a short jerk. The device's stamps separate the samples. Receive time
//! minus device time is usually near its minimum, and any excess is the delay of the sample. Receive times still define
//! the order of samples; only their times of validity are corrected.

use core::cmp::Ordering;

use serde::{Deserialize, Serialize};

use crate::device_clock::{ClockReport, DeviceClock};
use crate::reading::Reading;
use headrace_geometry::time::{DurNs, MonoNs};

/// Rate at which the estimated usual delay rises while device stamps arrive later than usual, s/s. Clocks drift apart
/// more slowly.
///
/// While stamps arrive earlier than usual, the usual delay falls `FALLS_TIMES` times as fast. So it converges to the
/// delay below which one stamp in ten lies. The size of a step does not depend on the stamp's delay, so a garbled stamp
/// has no larger effect than any other.
const RISES: f64 = 1e-3;
const FALLS_TIMES: f64 = 9.0;
/// Longest time between two stamps that counts for a change of the usual delay, s.
const MOST_BETWEEN_S: f64 = 0.1;
/// Shortest delay that is corrected. Clock ticks and the sending of a sample's frames cause shorter ones.
const LEAST: DurNs = DurNs(1_000_000);
/// Longest delay that is corrected. A longer one may come from a stopped device clock, and navigation waits no longer
/// than this for samples.
const MOST: DurNs = DurNs(150_000_000);

/// Corrects the times of the samples of a device with a clock. Allocates: never.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct SampleTimes {
    clock: DeviceClock,
    delay: UsualDelay,
    stamped: Option<Stamped>,
    last_reading: Option<MonoNs>,
    /// Number of samples whose stamp came before the readings, minus number of samples whose stamp came after them. It
    /// is limited to `MOST_LEADS` in size.
    ///
    /// It is needed because some units send the stamp after the readings.
    leads: i8,
}

/// A stamped sample: receive time of its stamp, the same time with the usual delay, and which readings have arrived.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
struct Stamped {
    received: MonoNs,
    usual: MonoNs,
    seen: [bool; KINDS],
}

/// Number of kinds of readings with stamps: turn rate, force, attitude. A stamp belongs to the first reading of each
/// kind after it.
const KINDS: usize = 3;
/// Smallest value of `leads` at which stamps count as coming before the readings, and largest size of `leads`.
const SURE_LEADS: i8 = 8;
const MOST_LEADS: i8 = 16;

/// Estimate of the usual difference between receive time and device time.
#[derive(Debug, Clone, Copy, Default, Serialize, Deserialize)]
struct UsualDelay {
    delay: Option<DurNs>,
    device: DurNs,
    received: MonoNs,
}

impl SampleTimes {
    /// Creates the correction for a clock of `bits` bits (1 to 64) with ticks of length `tick`, as in
    /// [`DeviceClock::new`].
    pub fn new(bits: u32, tick: DurNs) -> Self {
        Self {
            clock: DeviceClock::new(bits, tick),
            delay: UsualDelay::default(),
            stamped: None,
            last_reading: None,
            leads: 0,
        }
    }

    /// Processes the device stamp of a sample.
    pub fn stamp(&mut self, ticks: u64, received: MonoNs) {
        let device = self.clock.take(ticks, received);
        let late = self.delay.late(device, received);
        self.stamped = Some(Stamped { received, usual: received - late, seen: [false; KINDS] });
    }

    /// Returns the receive time that a reading would have had without the delay of its sample.
    ///
    /// Returns `received` for a reading without a stamp, with a usual delay, or with a longer delay than queues cause.
    /// Also returns it for all readings of a unit that sends its stamps after its readings.
    pub fn arrival(&mut self, reading: &Reading, received: MonoNs) -> MonoNs {
        let kind = match reading {
            Reading::AngularRate(_) => 0,
            Reading::SpecificForce(_) => 1,
            Reading::Attitude(_) => 2,
            _ => return received,
        };
        let Some(stamped) = &mut self.stamped else { return received };
        let last = self.last_reading.replace(received);
        if let Some(last) = last.filter(|_| stamped.seen == [false; KINDS]) {
            // Receive times within a burst are equal. They do not show whether the stamp came before the readings.
            let lead = match received.since(stamped.received).cmp(&stamped.received.since(last)) {
                Ordering::Less => 1,
                Ordering::Equal => 0,
                Ordering::Greater => -1,
            };
            let leads = self.leads.saturating_add(lead);
            self.leads = leads.clamp(-MOST_LEADS, MOST_LEADS);
        }
        let is_seen = stamped.seen.get_mut(kind).is_none_or(|seen| core::mem::replace(seen, true));
        let late = received.since(stamped.usual);
        let is_late = (LEAST..=MOST).contains(&late);
        if is_late && !is_seen && self.leads >= SURE_LEADS { stamped.usual } else { received }
    }

    /// Returns statistics of the device's clock.
    pub fn report(&self) -> ClockReport {
        self.clock.report()
    }
}

impl UsualDelay {
    /// Returns how much a stamp's delay exceeds the usual delay. Zero for the first stamp of a clock epoch.
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
