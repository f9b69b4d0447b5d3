//! Sources in the report.

use headrace_geometry::time::MonoNs;
use serde::Serialize;

use crate::run::Loop;
use headrace_sensor::device_clock::ClockReport;

/// Traffic of a source.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SourceReport {
    /// Name.
    pub id: String,
    /// Kind of device.
    pub plugin: String,
    /// Packets.
    pub packets: u64,
    /// Frames that were whole and valid.
    pub frames: u64,
    /// Candidate frames that failed.
    pub bad_frames: u64,
    /// Bytes that belong to no valid frame.
    pub skipped_bytes: u64,
    /// Readings decoded from them.
    pub readings: u64,
    /// Readings understood but not used: a bad status, another range setting, no calibration, a jump.
    pub withheld: u64,
    /// Longest silence between two packets, seconds.
    pub longest_gap_s: f64,
    /// Time from its last packet to the dive's last reading, seconds; `None` without packets.
    pub silent_at_end_s: Option<f64>,
    /// Packets per second.
    pub rate_hz: f64,
    /// Device clock statistics; `None` if it sends no timestamps.
    pub device_clock: Option<DeviceClockReport>,
    /// Innovation statistics in navigation; `None` without a filter, or if the filter doesn't use it.
    pub navigation: Option<NavigationReport>,
    /// Connection statistics; `None` if its bytes didn't come from a port.
    pub line: Option<LineReport>,
}

/// Connection statistics of a sensor.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct LineReport {
    /// Number of times it was opened.
    pub opened: u64,
    /// Number of times it was lost, or closed after a silence timeout.
    pub lost: u64,
    /// Packets dropped unread, for lack of room or by the carrier.
    pub dropped_packets: u64,
    /// Messages of senders other than the device, which were not used.
    pub strangers: u64,
    /// Final status, in plain text.
    pub status: String,
}

/// A source's device clock compared with the program's. For information only: readings are timed by the
/// receive time.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct DeviceClockReport {
    /// Timestamps received.
    pub stamps: u64,
    /// Number of times it restarted or fell behind.
    pub restarts: u64,
    /// Number of times it jumped ahead.
    pub jumps: u64,
    /// Time on its clock over which the drift is estimated, seconds.
    pub span_s: f64,
    /// Drift, parts per million; positive if it gains on the program's clock. `None` until there are enough
    /// data.
    pub drift_ppm: Option<f64>,
    /// Standard deviation of the drift, parts per million.
    pub drift_sd_ppm: Option<f64>,
}

impl From<ClockReport> for DeviceClockReport {
    fn from(clock: ClockReport) -> Self {
        Self {
            stamps: clock.stamps,
            restarts: clock.restarts,
            jumps: clock.jumps,
            span_s: clock.span.as_secs_f64(),
            drift_ppm: clock.drift.map(|drift| drift.ppm),
            drift_sd_ppm: clock.drift.map(|drift| drift.sd_ppm),
        }
    }
}

/// Innovation statistics of a source in navigation.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct NavigationReport {
    /// Scalar measurements used.
    pub used: u64,
    /// Scalar measurements rejected by the gate.
    pub gated: u64,
    /// Readings that came too late.
    pub late: u64,
    /// Readings with impossible values, or dropped for lack of room.
    pub dropped: u64,
    /// Mean normalised innovation squared (NIS): about 1 if the noise settings are right.
    pub nis: Option<f64>,
}

pub(super) fn source_reports(dive: &Loop) -> Vec<SourceReport> {
    let end = dive.tally().span.map_or(MonoNs(0), |(_, last)| last);
    let decoders = dive.decoder_counts().into_iter().zip(dive.decoder_withheld()).zip(dive.decoder_clocks());
    dive.sources()
        .iter()
        .zip(dive.health())
        .zip(decoders)
        .enumerate()
        .map(|(number, ((source, tally), ((counts, withheld), clock)))| {
            let span_s = tally.span.map_or(0.0, |(first, last)| last.since(first).as_secs_f64());
            let intervals = tally.packets.saturating_sub(1) as f64;
            SourceReport {
                id: source.id.clone(),
                plugin: source.plugin.clone(),
                packets: tally.packets,
                frames: counts.good_frames,
                bad_frames: counts.bad_frames,
                skipped_bytes: counts.skipped_bytes,
                readings: tally.readings,
                withheld,
                longest_gap_s: tally.longest_gap.as_secs_f64(),
                silent_at_end_s: tally.span.map(|(_, last)| end.since(last).as_secs_f64().max(0.0)),
                rate_hz: if span_s > 0.0 { intervals / span_s } else { 0.0 },
                device_clock: clock.map(DeviceClockReport::from),
                navigation: dive.consistency(number).map(|consistency| NavigationReport {
                    used: consistency.used,
                    gated: consistency.gated,
                    late: consistency.late,
                    dropped: consistency.dropped,
                    nis: consistency.nis(),
                }),
                line: None,
            }
        })
        .collect()
}
