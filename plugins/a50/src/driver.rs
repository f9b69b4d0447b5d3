//! Driver of an A50, which only listens to the connection.

use headrace_sensor::codec::Framing as _;
use headrace_sensor::driver::{Carrier, Cutter, DeviceHealth, Driver, Wire};
use headrace_sensor::geometry::time::{DurNs, MonoNs};

use crate::report::{Lines, MAX_LINE_BYTES, format_of};

/// Carriers over which an A50 can be connected.
pub const CARRIERS: [Carrier; 2] = [Carrier::Tcp, Carrier::Udp];

/// Longest usual gap between the bytes of one text line.
const SILENCE: DurNs = DurNs::from_millis(200);
/// Number of consecutive lines without a velocity after which the device's format counts as unknown.
///
/// The device reports several times a second, so this number is reached within a few seconds.
const NOT_UNDERSTOOD_FROM: u32 = 20;

/// Driver of an A50.
pub struct A50Driver {
    cutter: Cutter<Lines, MAX_LINE_BYTES>,
    velocities: u64,
    /// `others`: number of lines received since the latest velocity. `format`: format that the latest of these lines
    /// names.
    others: u32,
    format: Option<String>,
}

impl A50Driver {
    /// Creates a driver that has received nothing yet.
    pub fn new() -> Self {
        Self { cutter: Cutter::new(Lines, SILENCE), velocities: 0, others: 0, format: None }
    }
}

impl Default for A50Driver {
    fn default() -> Self {
        Self::new()
    }
}

impl Driver for A50Driver {
    fn opened(&mut self, _: MonoNs, _: &mut dyn Wire) {
        (self.others, self.format) = (0, None);
    }

    fn closed(&mut self, wire: &mut dyn Wire) {
        self.cutter.flush(&mut |piece| wire.deliver(piece.received, piece.bytes));
    }

    fn heard(&mut self, received: MonoNs, bytes: &[u8], wire: &mut dyn Wire) {
        let Self { cutter, velocities, others, format } = self;
        cutter.push(received, bytes, &mut |piece| {
            wire.deliver(piece.received, piece.bytes);
            if piece.is_frame && Lines.read(piece.bytes).is_some() {
                *velocities += 1;
                *others = 0;
            } else if let Some(named) = format_of(piece.bytes) {
                // A report with a missing field can't be decoded, but the name of its format can still be read.
                *others = others.saturating_add(1);
                *format = Some(named);
            } else if piece.is_frame {
                *others = others.saturating_add(1);
            }
        });
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

    fn health(&self) -> DeviceHealth {
        let complaint = (self.others >= NOT_UNDERSTOOD_FROM).then(|| {
            let what = match &self.format {
                Some(format) => {
                    format!("sends lines of format {format} without a known velocity")
                }
                None => "sends lines without a velocity or a format".to_owned(),
            };
            format!("{what}; supported are json_v3 to json_v3.3: check the device's firmware")
        });
        DeviceHealth { good_frames: self.velocities, complaint, ..DeviceHealth::default() }
    }
}
