//! Driver of a cable counter, which only listens to the line.

use headrace_sensor::driver::{Carrier, Listener, MessageListener};
use headrace_sensor::geometry::time::DurNs;

use crate::line::{Lines, MAX_LINE_BYTES};
use crate::report::ReportLayout;

/// Carriers over which a HID counter can be connected.
pub const REPORT_CARRIERS: [Carrier; 2] = [Carrier::Hid, Carrier::Udp];
/// Carriers over which a counter with text lines can be connected.
pub const LINE_CARRIERS: [Carrier; 3] = [Carrier::Serial, Carrier::Tcp, Carrier::Udp];

const PATIENCE: DurNs = DurNs::from_millis(5_000);
/// Longest usual gap between the bytes of one text line.
const SILENCE: DurNs = DurNs::from_millis(100);

/// Creates a driver of a HID counter.
pub fn reports(layout: ReportLayout) -> MessageListener {
    let judge = move |report: &[u8]| {
        let (len, wanted) = (report.len(), layout.report_bytes);
        let other_id = layout.report_id.filter(|id| report.first() != Some(id));
        if len < wanted {
            Some(format!("sends reports of {len} bytes; report_bytes says {wanted}"))
        } else {
            let got = report.first().copied().unwrap_or_default();
            other_id.map(|id| format!("sends reports of id {got}; report_id says {id}"))
        }
    };
    MessageListener::new(Box::new(judge), PATIENCE)
}

/// Creates a driver of a counter that sends text lines.
pub fn lines() -> Listener<Lines, MAX_LINE_BYTES> {
    Listener::new(Lines, SILENCE, PATIENCE)
}
