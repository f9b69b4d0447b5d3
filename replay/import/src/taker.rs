//! A sensor of the vehicle file as a receiver of a foreign log.

use headrace_geometry::time::{DurNs, MonoNs};
use headrace_sensor::driver::{Driver, Wire};

/// Receives the data of one sensor.
pub struct Taker {
    /// Number of the log's source.
    pub source: u16,
    /// The line that it receives.
    pub stream: String,
    /// Picks the sensor's data from a shared line; without a driver, the whole line belongs to the sensor.
    pub driver: Option<Box<dyn Driver>>,
}

/// Collects the packets that a driver delivers; output to the device is discarded.
struct Heard(Vec<(MonoNs, Vec<u8>)>);

impl Wire for Heard {
    fn send(&mut self, _: &[u8]) {}

    fn exchange(&mut self, _: &[u8], _: DurNs, _: usize) {}

    fn deliver(&mut self, received: MonoNs, bytes: &[u8]) {
        self.0.push((received, bytes.to_vec()));
    }
}

impl Taker {
    /// Whether it receives that line.
    pub(super) fn listens_to(&self, stream: &str) -> bool {
        self.stream == stream
    }

    /// Extracts the sensor's packets from an entry.
    pub(super) fn take(&mut self, at: MonoNs, bytes: &[u8]) -> Vec<(MonoNs, Vec<u8>)> {
        let mut heard = Heard(Vec::new());
        match &mut self.driver {
            Some(driver) => driver.heard(at, bytes, &mut heard),
            None => heard.deliver(at, bytes),
        }
        heard.0
    }
}
