//! The tables `sources` and `alerts`: a row for each sensor, and a row for each alert.

use headrace_monitor::alert_list::{AlertState, ListedAlertJson};
use headrace_monitor::report::SourceReport;

use crate::column::{Column, Get, Table, count};

pub(crate) fn sources() -> Table<SourceReport> {
    Table {
        name: "sources",
        about: "A sensor of the vehicle file.",
        columns: vec![
            Column("source", "Id of the sensor", Get::Text(|row| Some(row.id.clone()))),
            Column("plugin", "Kind of device", Get::Text(|row| Some(row.plugin.clone()))),
            Column("packets", "Packets", Get::Count(|row| count(row.packets))),
            Column("frames", "Complete and valid frames", Get::Count(|row| count(row.frames))),
            Column(
                "bad_frames",
                "Candidate frames that failed their checks",
                Get::Count(|row| count(row.bad_frames)),
            ),
            Column("skipped_bytes", "Bytes outside valid frames", Get::Count(|row| count(row.skipped_bytes))),
            Column("readings", "Decoded readings", Get::Count(|row| count(row.readings))),
            Column("withheld", "Readings decoded but not used", Get::Count(|row| count(row.withheld))),
            Column(
                "longest_gap_s",
                "Longest time between two packets, s",
                Get::Number(|row| Some(row.longest_gap_s)),
            ),
            Column("rate_hz", "Packets per second", Get::Number(|row| Some(row.rate_hz))),
            Column(
                "drift_ppm",
                "Drift of the device's clock, parts per million; positive if it gains",
                Get::Number(|row| row.device_clock.as_ref()?.drift_ppm),
            ),
            Column(
                "drift_sd_ppm",
                "Standard deviation of the drift, parts per million",
                Get::Number(|row| row.device_clock.as_ref()?.drift_sd_ppm),
            ),
            Column(
                "clock_restarts",
                "Restarts of the device's clock",
                Get::Count(|row| count(row.device_clock.as_ref()?.restarts)),
            ),
            Column(
                "nav_used",
                "Measurements used in navigation",
                Get::Count(|row| count(row.navigation.as_ref()?.used)),
            ),
            Column(
                "nav_gated",
                "Measurements rejected by the gate",
                Get::Count(|row| count(row.navigation.as_ref()?.gated)),
            ),
            Column(
                "nis",
                "Mean normalised innovation squared: about 1 if the noise is declared correctly",
                Get::Number(|row| row.navigation.as_ref()?.nis),
            ),
        ],
    }
}

#[expect(clippy::unnecessary_wraps, reason = "as columns want it")]
fn state(row: &ListedAlertJson) -> Option<String> {
    let word = match row.state {
        AlertState::Active => "active",
        AlertState::Rectified => "rectified",
        AlertState::Cleared => "cleared",
    };
    Some(word.to_owned())
}

pub(crate) fn alerts() -> Table<ListedAlertJson> {
    Table {
        name: "alerts",
        about: "An alert and its life at the end of the dive ([alerts.md](alerts.md)).",
        columns: life_columns().into_iter().chain(extent_columns()).collect(),
    }
}

/// Columns for an alert's kind and state, and for the times at which it was raised, acknowledged and cleared.
fn life_columns() -> Vec<Column<ListedAlertJson>> {
    vec![
        Column("number", "Its number, from 1", Get::Count(|row| count(row.number))),
        Column(
            "priority",
            "`emergency_alarm`, `alarm`, `warning` or `caution`",
            Get::Text(|row| Some(row.priority.to_owned())),
        ),
        Column(
            "class",
            "`coverage`, `speed`, `position`, `sensor`, `recording` or `setting`",
            Get::Text(|row| Some(row.class.to_owned())),
        ),
        Column("kind", "Its kind", Get::Text(|row| Some(row.kind.to_owned()))),
        Column("text", "Text of the alert", Get::Text(|row| Some(row.text.clone()))),
        Column("state", "`active`, `rectified` or `cleared`", Get::Text(state)),
        Column(
            "since_s",
            "Time at which it was raised first, s of dive time",
            Get::Number(|row| Some(row.since_s)),
        ),
        Column(
            "rectified_s",
            "Time at which its situation ended, s of dive time",
            Get::Number(|row| row.rectified_s),
        ),
        Column(
            "cleared_s",
            "Time at which it was cleared, s of dive time",
            Get::Number(|row| row.cleared_s),
        ),
        Column(
            "acknowledged_s",
            "Time of its acknowledgement, s of dive time",
            Get::Number(|row| Some(row.acknowledged.as_ref()?.at_s)),
        ),
        Column(
            "acknowledged_by",
            "Name given with the acknowledgement",
            Get::Text(|row| Some(row.acknowledged.as_ref()?.by.clone())),
        ),
    ]
}

/// Columns for an alert's place and extent along the tunnel, and for its number of occurrences.
fn extent_columns() -> Vec<Column<ListedAlertJson>> {
    vec![
        Column("from_m", "Chainage of its start, or of the vehicle, m", Get::Number(|row| row.from_m)),
        Column("to_m", "Chainage of its end, m", Get::Number(|row| row.to_m)),
        Column("source", "Sensor of the alert", Get::Text(|row| row.sensor.clone())),
        Column(
            "count",
            "Times that it was raised; for missed stretches, the number of stretches that it covers",
            Get::Count(|row| count(row.count)),
        ),
        Column(
            "occurrences",
            "Occurrences of the doubt that it reports; empty for other alerts",
            Get::Count(|row| count(row.occurrences?)),
        ),
        Column("first_m", "Chainage of the first occurrence, m", Get::Number(|row| row.first_m)),
        Column("worst_m", "Largest deviation, m; 0 for a doubtful setting", Get::Number(|row| row.worst_m)),
        Column(
            "setting",
            "Kind of the doubtful setting",
            Get::Text(|row| Some(row.setting.as_ref()?.what.to_owned())),
        ),
        Column(
            "merged_into",
            "The alert into which it was merged",
            Get::Count(|row| row.merged_into.map(i64::from)),
        ),
    ]
}
