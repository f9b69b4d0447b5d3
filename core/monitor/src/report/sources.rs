//! Sources in the report.

use serde::Serialize;

use crate::run::Loop;
use headrace_sensor::device_clock::ClockReport;

/// What a source has sent.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SourceReport {
    /// Its name.
    pub id: String,
    /// Kind of device.
    pub plugin: String,
    /// Packets.
    pub packets: u64,
    /// Frames that were whole and valid.
    pub frames: u64,
    /// Candidate frames that failed.
    pub bad_frames: u64,
    /// Bytes that belong to no good frame.
    pub skipped_bytes: u64,
    /// Readings taken from them.
    pub readings: u64,
    /// Readings understood but not used: a bad status, another range setting, no calibration, a jump.
    pub withheld: u64,
    /// Longest silence between two packets, seconds.
    pub longest_gap_s: f64,
    /// Packets a second.
    pub rate_hz: f64,
    /// How its own clock goes; `None` where it sends no time.
    pub device_clock: Option<DeviceClockReport>,
    /// How well it agreed with the others in navigation; `None` without a filter, and for what it doesn't use.
    pub navigation: Option<NavigationReport>,
    /// What its line has been through; `None` where bytes didn't come from a port.
    pub line: Option<LineReport>,
}

/// What a sensor's line has been through.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct LineReport {
    /// How often it was opened.
    pub opened: u64,
    /// How often it was lost, or given up for silence.
    pub lost: u64,
    /// Packets that came and for which there was no room.
    pub dropped_packets: u64,
    /// How it was at the end, in words.
    pub status: String,
}

/// How a source's own clock goes beside ours. Readings are valid by the receive time, whatever it says.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct DeviceClockReport {
    /// Stamps that came.
    pub stamps: u64,
    /// How often it began anew or fell behind.
    pub restarts: u64,
    /// How often it ran ahead.
    pub jumps: u64,
    /// Time on its clock from which its drift is known, seconds.
    pub span_s: f64,
    /// How fast it runs, parts per million; above zero it gains on ours. `None` before there is enough to tell.
    pub drift_ppm: Option<f64>,
    /// Standard deviation of it, parts per million.
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

/// How a source's measurements fared in navigation.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct NavigationReport {
    /// Measured numbers that were used.
    pub used: u64,
    /// Measured numbers that were too unlikely to be used.
    pub gated: u64,
    /// Readings that came after their time.
    pub late: u64,
    /// Readings that weren't possible numbers, or for which there was no room.
    pub dropped: u64,
    /// Mean of their innovations squared, over the variances expected: about 1 where all is trusted as it deserves.
    pub nis: Option<f64>,
}

pub(super) fn source_reports(dive: &Loop) -> Vec<SourceReport> {
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
