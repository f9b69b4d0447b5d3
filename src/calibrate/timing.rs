//! Estimates the latency of each source from the likelihood of the whole log.
//!
//! The filter runs with one source's timestamps shifted. The best shift is the one at which all innovations together
//! are most likely.

use crate::calibrate::collect::Material;
use crate::calibrate::estimate::{Estimate, NotEstimated};
use headrace_fusion::filter::FilterNavigation;
use headrace_fusion::{Navigation, Times};
use headrace_geometry::math;
use headrace_geometry::time::{DurNs, MonoNs};
use headrace_monitor::messages::Event;
use headrace_sensor::device::SensorKind;

/// Largest time offset tried in either direction, s. `COARSE_S` is the step of the coarse search.
const REACH_S: f64 = 0.2;
const COARSE_S: f64 = 0.1;
/// Limits of the step between the offsets tried around the best one, s.
///
/// Within these limits, the step is two standard deviations of the best offset.
const FINE_S: core::ops::RangeInclusive<f64> = 0.01..=0.05;
/// Gain in likelihood above which a source is corrected before the others are examined. It corresponds to
/// five standard deviations.
const CLEAR: f64 = 25.0;
/// Largest standard deviation at which a time offset is reported, s.
const TOLD_S: f64 = 0.03;
/// Amount by which a source may seem early, as if its latency were negative, before its latency counts as inconsistent,
/// s.
const EARLY_S: f64 = 0.01;
/// Largest share of measurements rejected at the gate at which the filter still follows the vehicle.
const MOST_GATED: f64 = 0.2;
/// Minimum number of readings of a source. `MOST` is the length of the part of a log that is used, from the log's
/// beginning.
const LEAST_READINGS: usize = 50;
const MOST: DurNs = DurNs(600_000_000_000);

/// Delay of a source's values beyond the latency in the vehicle file.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Lag {
    /// Number of the packet source.
    pub(crate) source: usize,
    /// Offset to be added to the latency in the vehicle file, s.
    pub(crate) offset_s: Result<Estimate, NotEstimated>,
}

/// Estimates the lag of each source that navigation uses.
///
/// `latencies` are those of the vehicle file, by source. The events' times of validity already include them.
/// `progress` is called before each run of the filter.
///
/// Sources that are clearly late are corrected first, beginning with the clearest one, because the other sources seem
/// early as long as one source is late. No source can be early by more than its latency.
///
/// Errors: the filter never gave a fix.
pub(crate) fn lags(
    material: &Material<'_>,
    latencies: &[DurNs],
    progress: &mut dyn FnMut(),
) -> Result<Vec<Lag>, NotEstimated> {
    let mut runs = Runs::new(material, progress);
    let sources = runs.sources();
    let mut base = runs.surprise().ok_or(NotEstimated::NoFilter)?;
    if runs.gated > MOST_GATED {
        return Err(NotEstimated::Disagrees { gated: runs.gated * 100.0, most: MOST_GATED * 100.0 });
    }
    let mut coarse: Vec<Option<Curve>> = Vec::new();
    for _ in 0..sources.len() {
        coarse = sources.iter().map(|source| runs.coarse(*source, base)).collect();
        let worth = |(source, curve): (&usize, &Option<Curve>)| {
            let curve = curve.as_ref()?;
            let latency_s = latencies.get(*source).map_or(0.0, |latency| latency.as_secs_f64());
            let late_s = runs.shift_s(*source) + curve.best_s;
            (curve.gain > CLEAR && latency_s + late_s >= -EARLY_S).then_some((*source, *curve))
        };
        let clearest =
            sources.iter().zip(&coarse).filter_map(worth).max_by(|a, b| a.1.gain.total_cmp(&b.1.gain));
        let Some((source, curve)) = clearest else { break };
        let before_s = runs.shift_s(source);
        runs.shift(source, before_s + curve.best_s);
        let refined = runs.surprise().and_then(|now| runs.fine(source, now, curve.sd_s));
        let by_s = refined.map_or(curve.best_s, |fine| curve.best_s + fine.best_s);
        runs.shift(source, before_s + by_s);
        let Some(now) = runs.surprise().filter(|now| *now < base) else {
            runs.shift(source, before_s);
            break;
        };
        base = now;
    }
    let lag = |(source, curve): (&usize, &Option<Curve>)| {
        let offset_s = runs.lag(*source, curve.as_ref());
        Lag { source: *source, offset_s }
    };
    let mut lags: Vec<Lag> = sources.iter().zip(&coarse).map(lag).collect();
    own_up(&mut lags, latencies);
    for lag in &mut lags {
        let latency_s = latencies.get(lag.source).map_or(0.0, |latency| latency.as_secs_f64());
        lag.offset_s = lag.offset_s.and_then(|offset| runs.possible(lag.source, latency_s, offset));
        if let (Err(NotEstimated::NoBest { .. }), true) = (lag.offset_s, runs.is_later(lag.source)) {
            let reach_ms = REACH_S * 1e3;
            lag.offset_s = Err(NotEstimated::Later { reach_ms, then_ms: latency_s * 1e3 + reach_ms });
        }
    }
    Ok(lags)
}

/// Widens all standard deviations if a source seems early by several of its standard deviations.
///
/// No source can really be early. The cause is then something other than a time offset, such as a beam narrower
/// than assumed, or a mount.
fn own_up(lags: &mut [Lag], latencies: &[DurNs]) {
    let early = |lag: &Lag| {
        let latency_s = latencies.get(lag.source).map_or(0.0, |latency| latency.as_secs_f64());
        lag.offset_s.as_ref().map_or(0.0, |offset| -(latency_s + offset.value) / offset.sd)
    };
    let amiss = lags.iter().map(early).fold(1.0, f64::max);
    for offset in lags.iter_mut().filter_map(|lag| lag.offset_s.as_mut().ok()) {
        offset.sd *= amiss;
    }
}

/// A parabola fitted to the likelihood as a function of a source's shift, relative to its current shift.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Curve {
    /// Shift of the source's timestamps that is most likely, s.
    best_s: f64,
    /// Standard deviation of the most likely shift, s.
    sd_s: f64,
    /// Gain in likelihood at the best shift, in the unit of
    /// [`headrace_fusion::filter::sources::Consistency::surprise`].
    gain: f64,
}

/// Repeated runs of the filter over the log, with different shifts.
struct Runs<'a, 'b> {
    material: &'a Material<'a>,
    events: &'a [Event],
    shifts_s: Vec<f64>,
    /// Whether each source's likelihood was clearly largest at the late end of the search range.
    later: Vec<bool>,
    /// Share of measurements that the filter rejected at its gate in the last run.
    gated: f64,
    progress: &'b mut dyn FnMut(),
}

impl<'a, 'b> Runs<'a, 'b> {
    fn new(material: &'a Material<'a>, progress: &'b mut dyn FnMut()) -> Self {
        let first = material.events.first().map_or(MonoNs(0), |event| event.received);
        let end = material.events.partition_point(|event| event.received.since(first).0 < MOST.0);
        let events = material.events.get(..end).unwrap_or(material.events);
        Self {
            material,
            events,
            shifts_s: vec![0.0; material.sensors.len()],
            later: vec![false; material.sensors.len()],
            gated: 0.0,
            progress,
        }
    }

    /// Sources that navigation uses and that have enough readings.
    fn sources(&self) -> Vec<usize> {
        let mut counts = vec![0_usize; self.material.sensors.len()];
        for event in self.events {
            if let Some(count) = counts.get_mut(event.source.index()) {
                *count += 1;
            }
        }
        let sensors = self.material.sensors.iter().zip(counts).enumerate();
        let speaks = |(source, (sensor, count)): (usize, (&headrace_sensor::device::SensorInfo, usize))| {
            (sensor.kind != SensorKind::Other && count >= LEAST_READINGS).then_some(source)
        };
        sensors.filter_map(speaks).collect()
    }

    fn is_later(&self, source: usize) -> bool {
        self.later.get(source).copied().unwrap_or(false)
    }

    /// Returns the time offset, or an error if the device would then answer each request only after the next request.
    fn possible(&self, source: usize, latency_s: f64, offset: Estimate) -> Result<Estimate, NotEstimated> {
        let answers = |kind: SensorKind| matches!(kind, SensorKind::Head | SensorKind::Echosounder { .. });
        let is_asked = self.material.sensors.get(source).is_some_and(|sensor| answers(sensor.kind));
        let of_source = || self.events.iter().filter(|event| event.source.index() == source);
        let (count, late_s) = (of_source().count(), latency_s + offset.value);
        let ends = of_source().next().zip(of_source().next_back());
        let span_s = ends.map_or(0.0, |(first, last)| last.received.since(first.received).as_secs_f64());
        let every_s = span_s / count.saturating_sub(1).max(1) as f64;
        if is_asked && late_s >= every_s && every_s > 0.0 {
            return Err(NotEstimated::Slow { found_ms: late_s * 1e3, every_ms: every_s * 1e3 });
        }
        Ok(offset)
    }

    fn shift_s(&self, source: usize) -> f64 {
        self.shifts_s.get(source).copied().unwrap_or(0.0)
    }

    fn shift(&mut self, source: usize, to_s: f64) {
        if let Some(slot) = self.shifts_s.get_mut(source) {
            *slot = to_s;
        }
    }

    /// Runs the filter. `None` if the filter has no estimate at the end, or if the likelihood isn't finite.
    fn surprise(&mut self) -> Option<f64> {
        (self.progress)();
        let Material { profile, site, mut settings, sensors, .. } = *self.material;
        // A reading shifted back in time must still fit into the filter's window of past times.
        settings.learns = false;
        settings.window = settings.window + DurNs::from_secs_f64(REACH_S + COARSE_S);
        let mut filter = FilterNavigation::new(profile.clone(), site, settings);
        for event in self.events {
            let source = event.source.index();
            let Some(sensor) = sensors.get(source) else { continue };
            let valid = event.valid_at - DurNs::from_secs_f64(self.shift_s(source));
            let times = Times { received: event.received, valid };
            filter.update(source, sensor, times, &event.reading);
        }
        filter.running()?;
        let all = (0..sensors.len()).filter_map(|source| filter.consistency(source));
        let (mut sum, mut used, mut gated) = (0.0, 0, 0);
        for consistency in all {
            sum += consistency.surprise;
            used += consistency.used;
            gated += consistency.gated;
        }
        self.gated = gated as f64 / (used + gated).max(1) as f64;
        sum.is_finite().then_some(sum)
    }

    fn surprise_at(&mut self, source: usize, by_s: f64) -> Option<f64> {
        let was_s = self.shift_s(source);
        self.shift(source, was_s + by_s);
        let surprise = self.surprise();
        self.shift(source, was_s);
        surprise
    }

    /// Parabola through the best point of a coarse grid and the two points beside it.
    fn coarse(&mut self, source: usize, base: f64) -> Option<Curve> {
        let mut points = vec![(0.0, base)];
        for by_s in [-COARSE_S, COARSE_S, -REACH_S, REACH_S] {
            points.push((by_s, self.surprise_at(source, by_s)?));
        }
        points.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
        let latest = points.last().map_or(f64::INFINITY, |point| point.1);
        if let Some(later) = self.later.get_mut(source) {
            *later = base - latest > CLEAR && points.iter().all(|point| point.1 >= latest);
        }
        let best = (1..points.len() - 1).min_by(|a, b| {
            let of = |k: &usize| points.get(*k).map_or(f64::INFINITY, |point| point.1);
            of(a).total_cmp(&of(b))
        })?;
        parabola(points.get(best - 1..=best + 1)?, base)
    }

    /// A parabola fitted to the likelihood at five points around the current shift.
    fn fine(&mut self, source: usize, base: f64, sd_s: f64) -> Option<Curve> {
        let step_s = (2.0 * sd_s).clamp(*FINE_S.start(), *FINE_S.end());
        let mut points = vec![(0.0, base)];
        for by in [-2.0, -1.0, 1.0, 2.0] {
            points.push((by * step_s, self.surprise_at(source, by * step_s)?));
        }
        parabola(&points, base)
    }

    fn lag(&mut self, source: usize, coarse: Option<&Curve>) -> Result<Estimate, NotEstimated> {
        let none = NotEstimated::NoBest { reach_ms: REACH_S * 1e3 };
        let coarse = coarse.ok_or(none)?;
        if coarse.sd_s > 2.0 * TOLD_S {
            return Err(NotEstimated::Flat { sd_ms: coarse.sd_s * 1e3 });
        }
        let was_s = self.shift_s(source);
        let near = coarse.best_s.clamp(-REACH_S, REACH_S);
        self.shift(source, was_s + near);
        let fine = self.surprise().and_then(|now| self.fine(source, now, coarse.sd_s));
        self.shift(source, was_s);
        let fine = fine.ok_or(none)?;
        if fine.sd_s > TOLD_S {
            return Err(NotEstimated::Flat { sd_ms: fine.sd_s * 1e3 });
        }
        if fine.best_s.abs() > COARSE_S {
            return Err(none);
        }
        Ok(Estimate { value: was_s + near + fine.best_s, sd: fine.sd_s })
    }
}

/// Least-squares parabola; `None` if the parabola has no minimum.
///
/// Twice the log-likelihood falls by 1 within one standard deviation, so its second derivative is 2 divided by the
/// variance.
fn parabola(points: &[(f64, f64)], base: f64) -> Option<Curve> {
    // x is scaled by the farthest point, so that the sums have similar sizes.
    let unit = points.iter().map(|(x, _)| x.abs()).fold(0.0, f64::max);
    let mut m = nalgebra::Matrix3::<f64>::zeros();
    let mut v = nalgebra::Vector3::<f64>::zeros();
    for (x, y) in points {
        let row = nalgebra::Vector3::new(1.0, x / unit, x * x / (unit * unit));
        m += row * row.transpose();
        v += row * (y - base);
    }
    let [c, b, a] = (m.try_inverse()? * v).into();
    if a.is_nan() || a <= 0.0 {
        return None;
    }
    let best = -b / (2.0 * a);
    let least = c + b * best + a * best * best;
    Some(Curve { best_s: best * unit, sd_s: unit / math::sqrt(a), gain: -least })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn source_that_seems_early_by_more_than_its_latency_widens_all_timing_sds() {
        let lag = |source, value, sd| Lag { source, offset_s: Ok(Estimate { value, sd }) };
        let latencies = [DurNs::from_secs_f64(0.01); 2];
        let sds = |mut lags: [Lag; 2]| {
            own_up(&mut lags, &latencies);
            lags.map(|lag| lag.offset_s.unwrap().sd)
        };
        let near =
            |got: [f64; 2], wanted: [f64; 2]| got.iter().zip(wanted).all(|(a, b)| (a - b).abs() < 1e-12);
        assert!(near(sds([lag(0, -0.07, 0.02), lag(1, 0.09, 0.01)]), [0.06, 0.03]));
        assert!(near(sds([lag(0, -0.02, 0.02), lag(1, 0.09, 0.01)]), [0.02, 0.01]));
    }
}
