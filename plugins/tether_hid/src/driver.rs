//! The host's side of a counter's line: it listens.

use headrace_sensor::driver::{Carrier, Listener, MessageListener};
use headrace_sensor::geometry::time::DurNs;

use crate::line::{Lines, MAX_LINE_BYTES};
use crate::report::ReportLayout;

/// What may carry reports.
pub const REPORT_CARRIERS: [Carrier; 2] = [Carrier::Hid, Carrier::Udp];
/// What may carry lines.
pub const LINE_CARRIERS: [Carrier; 3] = [Carrier::Serial, Carrier::Tcp, Carrier::Udp];

const PATIENCE: DurNs = DurNs::from_millis(5_000);
/// A line's characters follow one another.
const SILENCE: DurNs = DurNs::from_millis(100);

/// The driver of a HID counter.
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

/// The driver of a counter that sends lines.
pub fn lines() -> Listener<Lines, MAX_LINE_BYTES> {
    Listener::new(Lines, SILENCE, PATIENCE)
}
