//! A sensor that receives data from a foreign log.

use headrace_geometry::time::{DurNs, MonoNs};
use headrace_sensor::driver::{Driver, Wire};

/// Receives the data of one sensor.
pub struct Taker {
    /// Source number of the sensor in the log.
    pub source: u16,
    /// Name of the line that the sensor receives.
    pub stream: String,
    /// Driver that picks the sensor's data from a shared line. Without a driver, the sensor gets everything on the
    /// line.
    pub driver: Option<Box<dyn Driver>>,
}

/// Collects the packets that a driver delivers. Messages to the device are discarded.
struct Heard(Vec<(MonoNs, Vec<u8>)>);

impl Wire for Heard {
    fn send(&mut self, _: &[u8]) {}

    fn exchange(&mut self, _: &[u8], _: DurNs, _: usize) {}

    fn deliver(&mut self, received: MonoNs, bytes: &[u8]) {
        self.0.push((received, bytes.to_vec()));
    }
}

impl Taker {
    /// Whether the sensor receives this line.
    pub(super) fn listens_to(&self, stream: &str) -> bool {
        self.stream == stream
    }

    /// Returns the sensor's packets in an entry.
    pub(super) fn take(&mut self, at: MonoNs, bytes: &[u8]) -> Vec<(MonoNs, Vec<u8>)> {
        let mut heard = Heard(Vec::new());
        match &mut self.driver {
            Some(driver) => driver.heard(at, bytes, &mut heard),
            None => heard.deliver(at, bytes),
        }
        heard.0
    }
}
