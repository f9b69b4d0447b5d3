//! Parsers of the values of command line arguments, with their allowed ranges.

use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use headrace_geometry::time::DurNs;
use headrace_import::FileKind;
use headrace_replay::log::Every;
use headrace_sampling::layout::HeadLayout;
use headrace_sensor::connect::Connect;

/// Size or duration of a part of a recording.
pub(super) fn rotation(text: &str) -> Result<Every, String> {
    let wanted = || {
        "expected a size from 100kB (kB, MB, GB, KiB, MiB, GiB) or a duration from 1s (s, min, h)".to_owned()
    };
    let (number, unit) = text.split_at(text.find(|c: char| c.is_ascii_alphabetic()).ok_or_else(wanted)?);
    let number: f64 = number.trim().parse().map_err(|_| wanted())?;
    let bytes = |factor: f64| {
        let bytes = number * factor;
        #[expect(clippy::cast_possible_truncation, reason = "a fraction of a byte")]
        (1e5..=1e15).contains(&bytes).then_some(Every::Bytes(bytes as u64))
    };
    let span = |factor_s: f64| {
        let span_s = number * factor_s;
        (1.0..=1e7).contains(&span_s).then(|| Every::Span(DurNs::from_secs_f64(span_s)))
    };
    let every = match unit {
        "kB" => bytes(1e3),
        "MB" => bytes(1e6),
        "GB" => bytes(1e9),
        "KiB" => bytes(1024.0),
        "MiB" => bytes(1024.0 * 1024.0),
        "GiB" => bytes(1024.0 * 1024.0 * 1024.0),
        "s" => span(1.0),
        "min" => span(60.0),
        "h" => span(3600.0),
        _ => None,
    };
    every.ok_or_else(wanted)
}

/// A time from the log's beginning: `90`, `90s`, `15min`, `1h20min`, `1:23:45`, `23:45.5`.
pub(crate) fn time(text: &str) -> Result<DurNs, String> {
    let seconds = if text.contains(':') { by_colons(text) } else { by_units(text) };
    let seconds = seconds.filter(|seconds| (0.0..=1.0e7).contains(seconds));
    seconds
        .map(DurNs::from_secs_f64)
        .ok_or_else(|| format!("{text:?} isn't a time; expected one like 90s, 1h20min or 1:23:45"))
}

fn by_colons(text: &str) -> Option<f64> {
    text.split(':').try_fold(0.0, |total, part| {
        let number = part.parse::<f64>().ok().filter(|number| *number >= 0.0)?;
        Some(60.0 * total + number)
    })
}

fn by_units(text: &str) -> Option<f64> {
    let (mut total, mut rest) = (0.0, text);
    while !rest.is_empty() {
        let digits = rest.find(|c: char| !c.is_ascii_digit() && c != '.').unwrap_or(rest.len());
        let (number, after) = rest.split_at(digits);
        let letters = after.find(|c: char| !c.is_ascii_alphabetic()).unwrap_or(after.len());
        let (unit, later) = after.split_at(letters);
        let factor = match unit {
            "s" | "" => 1.0,
            "min" | "m" => 60.0,
            "h" => 3600.0,
            _ => return None,
        };
        total += factor * number.parse::<f64>().ok()?;
        rest = later;
    }
    (!text.is_empty()).then_some(total)
}

/// A range of chainage, metres.
pub(super) fn chainage_range(text: &str) -> Result<[f64; 2], String> {
    let both = text.split_once("..").and_then(|(from, to)| Some([chainage(from).ok()?, chainage(to).ok()?]));
    both.filter(|[from, to]| from < to)
        .ok_or_else(|| "expected FROM..TO in metres, FROM less than TO".to_owned())
}

/// Playback speed relative to real time; `None` is as fast as possible.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Speed(pub(crate) Option<f64>);

pub(crate) fn speed(text: &str) -> Result<Speed, String> {
    if text == "max" {
        return Ok(Speed(None));
    }
    let number = text.strip_suffix('x').unwrap_or(text).parse::<f64>().ok();
    number
        .filter(|factor| (0.01..=10_000.0).contains(factor))
        .map(|factor| Speed(Some(factor)))
        .ok_or_else(|| "expected max, or a factor from 0.01x to 10000x".to_owned())
}

pub(super) fn address(text: &str) -> Result<Connect, String> {
    match Connect::parse(text) {
        Ok(connect @ (Connect::Tcp { .. } | Connect::Udp { .. })) => Ok(connect),
        _ => Err("expected tcp:HOST:PORT or udp:HOST:PORT".to_owned()),
    }
}

/// Address for MAVLink. It may begin with `udpout:`, as other programs write it.
pub(super) fn udp_address(text: &str) -> Result<String, String> {
    let text = text.strip_prefix("udpout:").unwrap_or(text);
    let host = text.rsplit_once(':').map_or("", |(host, _)| host);
    let is_host = !host.contains(':') || host.starts_with('[');
    match Connect::parse(&format!("udp:{text}")) {
        Ok(Connect::Udp { .. }) if is_host => Ok(text.to_owned()),
        _ => Err("expected HOST:PORT, for instance 127.0.0.1:14550".to_owned()),
    }
}

pub(super) fn source_line(text: &str) -> Result<(String, String), String> {
    let both = text.split_once('=').filter(|(id, line)| !id.is_empty() && !line.is_empty());
    let both = both.map(|(id, line)| (id.to_owned(), line.to_owned()));
    both.ok_or_else(|| {
        "expected ID=STREAM, a sensor's id and the stream that it receives: imu=can0".to_owned()
    })
}

pub(crate) fn target(text: &str) -> Result<f64, String> {
    within(text, "metres", 0.01, 20.0)
}

pub(super) fn section(text: &str) -> Result<f64, String> {
    within(text, "metres", 0.05, 10.0)
}

pub(super) fn sound_speed(text: &str) -> Result<f64, String> {
    within(text, "m/s", 1300.0, 1700.0)
}

pub(crate) fn length(text: &str) -> Result<f64, String> {
    within(text, "metres", 0.1, 1.0e5)
}

pub(super) fn speed_mps(text: &str) -> Result<f64, String> {
    within(text, "m/s", 0.001, 5.0)
}

pub(super) fn hours(text: &str) -> Result<f64, String> {
    within(text, "hours", 0.01, 10_000.0)
}

pub(super) fn drift(text: &str) -> Result<f64, String> {
    within(text, "metres", 0.0, 100.0)
}

pub(super) fn yaw(text: &str) -> Result<f64, String> {
    within(text, "degrees", 0.0, 80.0)
}

fn within(text: &str, unit: &str, least: f64, most: f64) -> Result<f64, String> {
    let number = text.parse::<f64>().ok().filter(|number| (least..=most).contains(number));
    number.ok_or_else(|| format!("expected a number from {least} to {most} {unit}"))
}

pub(super) fn seconds(text: &str) -> Result<f64, String> {
    within(text, "seconds", 0.0, 1.0e7)
}

/// Duration of a self-test. The drift of a clock can only be measured over at least ten seconds.
pub(super) fn test_seconds(text: &str) -> Result<f64, String> {
    within(text, "seconds", 10.0, 120.0)
}

pub(super) fn seconds_range(text: &str) -> Result<[f64; 2], String> {
    let both = text.split_once("..").and_then(|(from, to)| Some([seconds(from).ok()?, seconds(to).ok()?]));
    both.filter(|[from, to]| from < to)
        .ok_or_else(|| "expected FROM..TO in seconds, FROM less than TO".to_owned())
}

pub(super) fn chainage(text: &str) -> Result<f64, String> {
    within(text, "metres", -1000.0, 1.0e5)
}

pub(super) fn place(text: &str) -> Result<[f64; 2], String> {
    let number = |text: &str| within(text.trim(), "metres", -200.0, 200.0);
    match text.split_once(',') {
        Some((y, z)) => Ok([number(y)?, number(z)?]),
        None => Err("expected Y,Z in metres".to_owned()),
    }
}

pub(super) fn layout(text: &str) -> Result<HeadLayout, String> {
    let known = HeadLayout::NAMES.iter().find(|(name, _)| *name == text);
    known.map(|(_, layout)| *layout).ok_or_else(|| "expected phase_shift or sector_offset".to_owned())
}

/// Parser that finds a kind of foreign log by its name.
pub(crate) fn file_kind() -> impl TypedValueParser<Value = FileKind> {
    let value = |kind: FileKind| PossibleValue::new(kind.name()).help(kind.summary());
    PossibleValuesParser::new(FileKind::ALL.map(value))
        .try_map(|name| FileKind::named(&name).ok_or("isn't a known kind of log"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_accepted_in_common_notations() {
        let seconds = |text: &str| time(text).map(DurNs::as_secs_f64);
        for (text, wanted) in [
            ("90", 90.0),
            ("90s", 90.0),
            ("1.5min", 90.0),
            ("1h20min", 4800.0),
            ("1:23:45", 5025.0),
            ("2:03.5", 123.5),
        ] {
            assert_eq!(seconds(text), Ok(wanted), "{text}");
        }
        for text in ["", "x", "-5", "1:-2", "5 days", "h", "nan", "1e99"] {
            assert!(time(text).is_err(), "{text}");
        }
    }
}
