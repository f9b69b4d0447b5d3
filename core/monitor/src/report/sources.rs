//! Statistics of the sources in the report.

use headrace_geometry::time::MonoNs;
use serde::Serialize;

use crate::run::Loop;
use crate::unread::WithheldReadings;
use crate::words::withheld_text;
use headrace_sensor::device_clock::ClockReport;
use headrace_sensor::withheld::WithheldReason;

/// Traffic statistics of a source.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SourceReport {
    /// Name of the source.
    pub id: String,
    /// Kind of device that the source is.
    pub plugin: String,
    /// Number of packets from the source.
    pub packets: u64,
    /// Number of whole and valid frames.
    pub frames: u64,
    /// Number of candidate frames that failed the check.
    pub bad_frames: u64,
    /// Number of bytes that belong to no valid frame.
    pub skipped_bytes: u64,
    /// Number of readings decoded from the frames.
    pub readings: u64,
    /// Number of readings decoded but not used.
    pub withheld: u64,
    /// Number of withheld readings and the reason, for the summary; `None` if the source gave a reading, or sent
    /// nothing.
    #[serde(skip)]
    pub no_reading: Option<String>,
    /// Longest silence between two packets, seconds.
    pub longest_gap_s: f64,
    /// Time from the source's last packet to the dive's last reading, seconds; `None` without packets.
    pub silent_at_end_s: Option<f64>,
    /// Mean number of packets per second.
    pub rate_hz: f64,
    /// Device clock statistics; `None` if the source sends no timestamps.
    pub device_clock: Option<DeviceClockReport>,
    /// Innovation statistics in navigation; `None` without a filter, or if the filter doesn't use the source.
    pub navigation: Option<NavigationReport>,
    /// Connection statistics; `None` if the source's bytes didn't come from a port.
    pub line: Option<LineReport>,
}

/// Connection statistics of a sensor.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct LineReport {
    /// Number of times the connection was opened.
    pub opened: u64,
    /// Number of times the connection was lost, or closed after a silence timeout.
    pub lost: u64,
    /// Number of packets dropped before they were read, for lack of room or by the network.
    pub dropped_packets: u64,
    /// Number of messages from senders other than the device. They were not used.
    pub ignored: u64,
    /// Final status of the connection, in plain text.
    pub status: String,
}

/// Comparison of a source's device clock with the program's clock.
///
/// This is for information only, because the receive time of a packet gives the time of its readings.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct DeviceClockReport {
    /// Number of timestamps received.
    pub stamps: u64,
    /// Number of times the device clock restarted or fell behind.
    pub restarts: u64,
    /// Number of times the device clock jumped ahead.
    pub jumps: u64,
    /// Time on the device clock over which the drift is estimated, seconds.
    pub span_s: f64,
    /// Drift, parts per million; positive if the device clock gains on the program's clock. `None` until
    /// there are enough data.
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
    /// Number of scalar measurements used.
    pub used: u64,
    /// Number of scalar measurements rejected by the gate.
    pub gated: u64,
    /// Number of readings that came too late.
    pub late: u64,
    /// Number of readings with impossible values, or dropped for lack of room.
    pub dropped: u64,
    /// Mean normalised innovation squared (NIS): about 1 if the noise settings are right.
    pub nis: Option<f64>,
}

fn no_reading_text(packets: u64, withheld: u64, reason: Option<WithheldReason>) -> String {
    let (count, reason) = reason.map_or((packets, WithheldReason::NoMessage), |reason| (withheld, reason));
    withheld_text(WithheldReadings { count: u32::try_from(count).unwrap_or(u32::MAX), reason })
}

pub(super) fn source_reports(dive: &Loop) -> Vec<SourceReport> {
    let end = dive.view().last_received().unwrap_or(MonoNs(0));
    let decoders = dive.decoder_counts().into_iter().zip(dive.decoder_withheld()).zip(dive.decoder_clocks());
    dive.sources()
        .iter()
        .zip(dive.view().health())
        .zip(decoders)
        .enumerate()
        .map(|(number, ((source, tally), ((counts, (withheld, reason)), clock)))| {
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
                no_reading: (tally.packets > 0 && tally.readings == 0)
                    .then(|| no_reading_text(tally.packets, withheld, reason)),
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
