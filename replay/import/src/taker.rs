//! A sensor of the vehicle file, as it listens to a foreign log.

use headrace_geometry::time::{DurNs, MonoNs};
use headrace_sensor::driver::{Driver, Wire};

/// Takes what its sensor would have heard.
pub struct Taker {
    /// Number of the log's source.
    pub source: u16,
    /// The line that it listens to.
    pub stream: String,
    /// Picks its own from a line that several share; without one, all is its own.
    pub driver: Option<Box<dyn Driver>>,
}

/// Keeps what a driver hands on; what it would send has nowhere to go.
struct Heard(Vec<(MonoNs, Vec<u8>)>);

impl Wire for Heard {
    fn send(&mut self, _: &[u8]) {}

    fn exchange(&mut self, _: &[u8], _: DurNs, _: usize) {}

    fn deliver(&mut self, received: MonoNs, bytes: &[u8]) {
        self.0.push((received, bytes.to_vec()));
    }
}

impl Taker {
    /// Whether it listens to a line.
    pub(super) fn listens_to(&self, stream: &str) -> bool {
        self.stream == stream
    }

    /// What of an entry is its own.
    pub(super) fn take(&mut self, at: MonoNs, bytes: &[u8]) -> Vec<(MonoNs, Vec<u8>)> {
        let mut heard = Heard(Vec::new());
        match &mut self.driver {
            Some(driver) => driver.heard(at, bytes, &mut heard),
            None => heard.deliver(at, bytes),
        }
        heard.0
    }
}
