//! Driver of a Bar100 on an I2C bus. It reads the calibration, and then requests measurements at a fixed rate.

use headrace_sensor::driver::{Carrier, DeviceHealth, Driver, Wire};
use headrace_sensor::geometry::time::{DurNs, MonoNs};

use crate::calibration::CALIBRATION_CELLS;
use crate::codec::{MEASURE, MEASURE_BYTES, MEMORY_BYTES, Transaction, TransactionError};

/// Carriers over which a Bar100 can be connected.
pub const CARRIERS: [Carrier; 2] = [Carrier::I2c, Carrier::Udp];

/// Delay from requesting a memory cell to reading it. Source: Keller's protocol, which requires at least 0.6 ms.
const MEMORY_SETTLES: DurNs = DurNs(1_000_000);
/// Delay from starting a conversion to reading its result. Source: Keller's protocol, where a conversion takes at most
/// 8 ms; other drivers wait 9 or 10 ms.
const CONVERSION: DurNs = DurNs(10_000_000);
/// Delay from reading the calibration to the first measurement. Source: `ArduPilot`'s driver.
const AFTER_CALIBRATION: DurNs = DurNs::from_millis(150);
/// Interval between attempts to read the calibration.
const RETRY: DurNs = DurNs::from_millis(500);
/// Number of consecutive bad answers after which the calibration is read again, because the sensor may have been
/// replaced.
const READ_AGAIN_AFTER: u32 = 20;

/// Driver of a Bar100.
pub struct Bar100Driver {
    period: DurNs,
    next_at: MonoNs,
    /// Index of the next calibration cell to read.
    cell: usize,
    bad_in_a_row: u32,
    good_frames: u64,
    complaint: Option<TransactionError>,
}

impl Bar100Driver {
    /// Creates a driver that requests `rate_hz` measurements a second.
    pub fn new(rate_hz: f64) -> Self {
        let period = DurNs::from_secs_f64(1.0 / rate_hz);
        Self { period, next_at: MonoNs(0), cell: 0, bad_in_a_row: 0, good_frames: 0, complaint: None }
    }

    fn answered(&mut self, answer: Result<Transaction, TransactionError>, at: MonoNs) {
        match answer {
            Ok(transaction) => {
                self.good_frames += 1;
                self.complaint = None;
                self.bad_in_a_row = 0;
                // A second answer to the same request must not count as the answer for the next memory cell.
                let asked = CALIBRATION_CELLS.get(self.cell);
                if matches!(&transaction, Transaction::Memory(read) if Some(&read.cell) == asked) {
                    self.cell += 1;
                    let done = self.cell == CALIBRATION_CELLS.len();
                    self.next_at = if done { at + AFTER_CALIBRATION } else { at };
                }
            }
            Err(error) => {
                self.complaint = Some(error);
                self.bad_in_a_row += 1;
                if self.cell < CALIBRATION_CELLS.len() || self.bad_in_a_row >= READ_AGAIN_AFTER {
                    self.cell = 0;
                    self.bad_in_a_row = 0;
                    self.next_at = at + RETRY;
                }
            }
        }
    }
}

impl Driver for Bar100Driver {
    fn opened(&mut self, now: MonoNs, _: &mut dyn Wire) {
        self.cell = 0;
        self.bad_in_a_row = 0;
        self.next_at = now;
    }

    fn heard(&mut self, received: MonoNs, bytes: &[u8], wire: &mut dyn Wire) {
        wire.deliver(received, bytes);
        self.answered(Transaction::decode(bytes), received);
    }

    fn accepts(&self, bytes: &[u8]) -> bool {
        Transaction::decode(bytes).is_ok()
    }

    fn due(&self) -> Option<MonoNs> {
        Some(self.next_at)
    }

    fn wake(&mut self, now: MonoNs, wire: &mut dyn Wire) {
        // If the request for a memory cell gets no answer, it is sent again.
        if let Some(cell) = CALIBRATION_CELLS.get(self.cell) {
            self.next_at = now + RETRY;
            wire.exchange(&[*cell], MEMORY_SETTLES, MEMORY_BYTES - 1);
        } else {
            let next = self.next_at + self.period;
            self.next_at = if next > now { next } else { now + self.period };
            wire.exchange(&[MEASURE], CONVERSION, MEASURE_BYTES - 1);
        }
    }

    fn health(&self) -> DeviceHealth {
        let identity = (self.cell == CALIBRATION_CELLS.len()).then(|| "Keller LD pressure sensor".to_owned());
        let complaint = self.complaint.as_ref().map(TransactionError::to_string);
        DeviceHealth { good_frames: self.good_frames, identity, complaint, ..DeviceHealth::default() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::codec::{MemoryWord, Status};

    #[derive(Default)]
    struct Bus(Vec<u8>);

    impl Wire for Bus {
        fn send(&mut self, _: &[u8]) {
            panic!("every request is a transaction");
        }

        fn exchange(&mut self, write: &[u8], _: DurNs, _: usize) {
            self.0.extend_from_slice(write);
        }

        fn deliver(&mut self, _: MonoNs, _: &[u8]) {}
    }

    /// The answer for the first cell is late, so the driver requests this cell twice. The second answer must not count
    /// for the next cell. The request for the next cell is lost, so it is repeated.
    #[test]
    fn late_answer_is_not_taken_for_the_next_memory_cell() {
        let (mut driver, mut bus) = (Bar100Driver::new(10.0), Bus::default());
        driver.opened(MonoNs(0), &mut bus);
        let answer = |cell| MemoryWord { cell, status: Status::IDLE, word: 7 }.encode();
        let go_on = |driver: &mut Bar100Driver, bus: &mut Bus| {
            let now = driver.due().unwrap();
            driver.wake(now, bus);
            now
        };
        go_on(&mut driver, &mut bus);
        let now = go_on(&mut driver, &mut bus);
        driver.heard(now, &answer(0x12), &mut bus);
        let now = go_on(&mut driver, &mut bus);
        driver.heard(now, &answer(0x12), &mut bus);
        for cell in CALIBRATION_CELLS.into_iter().skip(1) {
            let now = go_on(&mut driver, &mut bus);
            driver.heard(now, &answer(cell), &mut bus);
        }
        go_on(&mut driver, &mut bus);
        assert_eq!(bus.0, [0x12, 0x12, 0x13, 0x13, 0x14, 0x15, 0x16, MEASURE]);
    }
}
