//! Finds the longest period in which the vehicle stood still, in steps of one second.
//!
//! Attitude, cable, depth and echosounders show whether the vehicle moved.

use std::collections::BTreeMap;

use crate::calibrate::collect::Material;
use crate::calibrate::estimate::{NotEstimated, median};
use headrace_fusion::filter::state::rotation_vector;
use headrace_geometry::frames::{Rot, Sensor};
use headrace_geometry::time::{DurNs, MonoNs};
use headrace_monitor::messages::Event;
use headrace_sensor::device::{SensorInfo, SensorKind};
use headrace_sensor::reading::{Level, Reading};

/// Length of a time bin. A source's readings in a bin give one median, so noise and outliers don't count as
/// motion.
const BIN: DurNs = DurNs(1_000_000_000);
/// Minimum length of a time at rest, in bins. `MOST` is the maximum number of bins that are used, because more bins add
/// no information.
const LEAST: usize = 3;
const MOST: usize = 120;

/// Measured quantity by which motion of the vehicle is detected.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Sign {
    Cable,
    Depth,
    Echo,
    Attitude,
}

impl Sign {
    fn what(self) -> &'static str {
        match self {
            Self::Cable => "the cable length",
            Self::Depth => "depth",
            Self::Echo => "an echosounder's range",
            Self::Attitude => "attitude",
        }
    }

    /// Largest variation of the quantity at rest, and the quantity's unit.
    fn limit(self) -> (f64, &'static str) {
        match self {
            Self::Cable => (0.05, "m"),
            Self::Depth | Self::Echo => (0.1, "m"),
            Self::Attitude => (2.0, "degrees"),
        }
    }
}

/// A period of a log in which the vehicle stood still and its heads detected the wall.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Still {
    /// Receive time at which the period begins.
    pub(crate) from: MonoNs,
    /// End of the period, exclusive. All readings were received before this time.
    pub(crate) to: MonoNs,
}

/// Kind of quantity that one source measures, and the source's values in each time bin.
type Raw = (Sign, Vec<Vec<f64>>);

/// One source's values, reduced to their median in each time bin.
struct Channel {
    sign: Sign,
    by_bin: Vec<Option<f64>>,
}

/// Finds the longest period in which the vehicle stood still; of several periods of equal length, the first.
///
/// Errors: there is no attitude or no return, or the vehicle moved all the time.
pub(crate) fn longest(material: &Material<'_>) -> Result<Still, NotEstimated> {
    let (first, last) = match (material.events.first(), material.events.last()) {
        (Some(first), Some(last)) => (first.received, last.received),
        _ => return Err(NotEstimated::Missing { what: "any sensor" }),
    };
    let bins = bin_of(last, first) + 1;
    let channels = channels(material, first, bins);
    let heard = heard(material, first, bins);
    if !channels.iter().any(|channel| channel.sign == Sign::Attitude) {
        return Err(NotEstimated::Missing { what: "an inertial unit's attitude" });
    }
    if !heard.contains(&true) {
        return Err(NotEstimated::Missing { what: "any profiling head" });
    }
    let mut best = (0, 0);
    for from in 0..bins {
        let length = length_from(from, &channels, &heard);
        if length > best.1 {
            best = (from, length);
        }
        if length == MOST {
            break;
        }
    }
    let (from, length) = best;
    if length < LEAST {
        return Err(moved(&channels));
    }
    Ok(Still { from: first + bins_long(from), to: first + bins_long(from + length) })
}

fn bin_of(at: MonoNs, first: MonoNs) -> usize {
    usize::try_from(at.since(first).0 / BIN.0).unwrap_or(0)
}

fn bins_long(bins: usize) -> DurNs {
    DurNs(BIN.0.saturating_mul(i64::try_from(bins).unwrap_or(i64::MAX)))
}

/// Number of consecutive bins, beginning with bin `from`, in which nothing moves and the wall is detected.
fn length_from(from: usize, channels: &[Channel], heard: &[bool]) -> usize {
    let mut spans: Vec<Option<(f64, f64)>> = vec![None; channels.len()];
    let mut length = 0;
    while length < MOST && heard.get(from + length) == Some(&true) {
        let mut is_still = true;
        for (span, channel) in spans.iter_mut().zip(channels) {
            let value = channel.by_bin.get(from + length).copied().flatten();
            *span = value.map_or(*span, |value| Some(widened(*span, value)));
            is_still &= span.is_none_or(|(least, most)| most - least <= channel.sign.limit().0);
        }
        if !is_still {
            break;
        }
        length += 1;
    }
    length
}

fn widened(span: Option<(f64, f64)>, value: f64) -> (f64, f64) {
    span.map_or((value, value), |(least, most)| (least.min(value), most.max(value)))
}

/// Error that names the quantity which exceeded its limit by the largest factor.
fn moved(channels: &[Channel]) -> NotEstimated {
    let mut worst = (Sign::Attitude, 0.0);
    for channel in channels {
        let span = channel.by_bin.iter().flatten().fold(None, |span, value| Some(widened(span, *value)));
        let width = span.map_or(0.0, |(least, most)| most - least);
        if width / channel.sign.limit().0 > worst.1 / worst.0.limit().0 {
            worst = (channel.sign, width);
        }
    }
    let (sign, span) = worst;
    let (limit, unit) = sign.limit();
    NotEstimated::Moved { what: sign.what(), span, unit, limit, least_s: LEAST }
}

fn heard(material: &Material<'_>, first: MonoNs, bins: usize) -> Vec<bool> {
    let mut heard = vec![false; bins];
    for event in material.events {
        let is_return = matches!(event.reading, Reading::Sonar(sonar) if sonar.range_m.is_some());
        if let (true, Some(slot)) = (is_return, heard.get_mut(bin_of(event.received, first))) {
            *slot = true;
        }
    }
    heard
}

fn channels(material: &Material<'_>, first: MonoNs, bins: usize) -> Vec<Channel> {
    let mut raw: BTreeMap<(usize, usize), Raw> = BTreeMap::new();
    let mut upright: BTreeMap<usize, Rot<Level, Sensor>> = BTreeMap::new();
    for event in material.events {
        let Some(sensor) = material.sensors.get(event.source.index()) else { continue };
        let source = event.source.index();
        if let Reading::Attitude(attitude) = event.reading {
            upright.entry(source).or_insert(attitude);
        }
        let Some((sign, values)) = shows(material, sensor, event, upright.get(&source)) else { continue };
        for (axis, value) in values.into_iter().enumerate().filter(|(_, value)| value.is_finite()) {
            let (_, lists) = raw.entry((source, axis)).or_insert_with(|| (sign, vec![Vec::new(); bins]));
            if let Some(list) = lists.get_mut(bin_of(event.received, first)) {
                list.push(value);
            }
        }
    }
    let channel = |(sign, mut lists): Raw| Channel {
        sign,
        by_bin: lists.iter_mut().map(|list| median(list)).collect(),
    };
    raw.into_values().map(channel).collect()
}

/// Up to three numbers of a reading that change if the vehicle moves. Unused numbers are NaN.
fn shows(
    material: &Material<'_>,
    sensor: &SensorInfo,
    event: &Event,
    upright: Option<&Rot<Level, Sensor>>,
) -> Option<(Sign, [f64; 3])> {
    let one = |value: f64| [value, f64::NAN, f64::NAN];
    match (sensor.kind, event.reading) {
        (SensorKind::Imu, Reading::Attitude(attitude)) => {
            let turned = rotation_vector(attitude * upright?.inverse());
            Some((Sign::Attitude, [turned.x(), turned.y(), turned.z()].map(f64::to_degrees)))
        }
        (SensorKind::Tether { scale, .. }, Reading::TetherLength(length)) => {
            Some((Sign::Cable, one(length.length_m * scale)))
        }
        (SensorKind::Depth, Reading::Pressure(water)) => {
            Some((Sign::Depth, one(material.site.depth_m(water.pressure_pa))))
        }
        (SensorKind::Echosounder { min_confidence }, Reading::Echo(echo))
            if echo.confidence >= min_confidence =>
        {
            Some((Sign::Echo, one(echo.range_m?)))
        }
        _ => None,
    }
}
