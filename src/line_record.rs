//! Records traffic on devices' lines that doesn't reach the loop.

use headrace_geometry::time::MonoNs;
use headrace_ports::LineRecord;
use headrace_replay::log::LinePort;

/// All recordings of a dive.
pub struct InRecordings(pub Vec<LinePort>);

impl LineRecord for InRecordings {
    fn sent(&self, sensor: usize, at: MonoNs, bytes: &[u8]) {
        self.0.iter().for_each(|port| port.sent(source(sensor), at, bytes));
    }

    fn lost(&self, sensor: usize, from: MonoNs, to: MonoNs, packets: u64) {
        self.0.iter().for_each(|port| port.lost(source(sensor), from, to, packets));
    }
}

/// Number of a sensor's source in the log.
fn source(sensor: usize) -> u16 {
    u16::try_from(sensor).unwrap_or(u16::MAX)
}
