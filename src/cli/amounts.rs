//! Sizes, times and stretches as people write them on the command line.

use headrace_core::time::DurNs;
use headrace_replay::log::Every;

/// A size or a time after which a part of a recording ends.
pub(super) fn every(text: &str) -> Result<Every, String> {
    let wanted =
        || "wanted is a size from 100kB (kB, MB, GB, KiB, MiB, GiB) or a time from 1s (s, min, h)".to_owned();
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

/// A time from the log's beginning.
pub(super) fn time(text: &str) -> Result<DurNs, String> {
    let wanted = || "wanted is a time: 90s, 10min, 1.5h".to_owned();
    let (number, unit) = text.split_at(text.find(|c: char| c.is_ascii_alphabetic()).unwrap_or(text.len()));
    let factor_s = match unit {
        "" | "s" => 1.0,
        "min" => 60.0,
        "h" => 3600.0,
        _ => return Err(wanted()),
    };
    let seconds = number.trim().parse::<f64>().ok().map(|number| number * factor_s);
    let seconds = seconds.filter(|seconds| (0.0..=1.0e7).contains(seconds));
    seconds.map(DurNs::from_secs_f64).ok_or_else(wanted)
}

/// A stretch of the tunnel, metres.
pub(super) fn stretch(text: &str) -> Result<[f64; 2], String> {
    let both = text
        .split_once("..")
        .and_then(|(from, to)| Some([super::chainage(from).ok()?, super::chainage(to).ok()?]));
    both.filter(|[from, to]| from < to)
        .ok_or_else(|| "wanted are two numbers of metres, FROM..TO, the first one less".to_owned())
}
