//! Comparison of distances along the tunnel by cable counter, velocity log and estimate.
//!
//! The comparison detects differences that the data sheets do not explain. It uses only readings and the estimated
//! chainage, and never the filter's covariance, gates or learnt noise. So the comparison still works when the filter
//! has settled on a wrong speed. The inertial unit is not compared here, because it measures only changes of speed;
//! `slack_level.rs` compares it with the counter.
//!
//! Distances over a time window of W seconds differ significantly if they differ by more than the following limit in m.
//! n is the variance of a counter reading, m^2, and v the noise of the velocity log, m/s:
//!
//! ```text
//! 2 max(0.15 m, 3 slack_sd) + 5 sqrt(2 n + (scale distance)^2 + v^2 0.25 s W)
//! ```

use super::cable::CableDoubt;
use super::settings::Settings;
use super::slack_level::{MOST_REACH_M, at_time};
use super::updates::in_tunnel;
use headrace_geometry::frames::{Body, Rot, Tunnel};
use headrace_geometry::math;
use headrace_geometry::site::Site;
use headrace_geometry::snapshot::stateful;
use headrace_geometry::time::{DurNs, MonoNs};
use headrace_sensor::device::{SensorInfo, SensorKind};
use headrace_sensor::reading::{Reading, SourceId};

/// Time windows over which distances are compared, s.
const WINDOWS_S: [f64; 3] = [2.0, 10.0, 60.0];
/// `EVERY` is the time between two rows of distances. `ROOM` rows suffice for the longest window.
const EVERY: DurNs = DurNs(200_000_000);
const ROOM: usize = 320;
/// Number of readings kept per source, and least time between two of them.
///
/// Together, these readings cover more than the longest delay of the filter's estimate, at any reading rate.
const READINGS: usize = 96;
const NEAR: DurNs = DurNs(20_000_000);
/// Duration of silence after which a source is no longer compared. A velocity log may send only every two seconds, so
/// it must be longer.
const SILENT: DurNs = DurNs(3_000_000_000);
/// Time by which the comparison lags behind the present, because some readings arrive late.
const BEHIND: DurNs = DurNs(500_000_000);
/// Maximum difference between two distances, in standard deviations. A larger difference causes a doubt once it has
/// lasted for `LASTS`.
const MOST_SDS: f64 = 5.0;
const LASTS: DurNs = DurNs(1_000_000_000);
/// Scale error of a velocity log, a ratio: 1 % on the data sheet of the A50, plus the error of its mounting angle.
const LOG_SCALE: f64 = 0.015;
/// Correlation time of a velocity log's noise, s.
const LOG_TIME_S: f64 = 0.25;

/// Columns of a row of distances: `CABLE` by the cable counter, `LOG` by the velocity log, `ESTIMATE` by the estimate.
const CABLE: usize = 0;
const LOG: usize = 1;
const ESTIMATE: usize = 2;

/// Recent distances by each source, and the doubt about the cable counter if the distances differ.
#[derive(Debug, Clone)]
pub(super) struct DistanceComparison {
    /// Recent values, m: `cable` holds chainages by the counter, `log` distances by the velocity log, and `estimate`
    /// chainages by the filter.
    cable: Vec<(MonoNs, [f64; 1])>,
    log: Vec<(MonoNs, [f64; 1])>,
    estimate: Vec<(MonoNs, [f64; 1])>,
    /// Source number of the velocity log that is compared.
    log_source: Option<usize>,
    /// Last attitude measured by an inertial unit.
    attitude: Option<(MonoNs, Rot<Tunnel, Body>)>,
    /// Rows of the distances by each source at one time, m; NaN for a missing distance.
    rows: Vec<(MonoNs, [f64; 3])>,
    /// Times since which the distance by cable has differed from the distance by velocity log, and from that by the
    /// estimate.
    since: [Option<MonoNs>; 2],
    doubt: Option<CableDoubt>,
    /// Value of [`super::eskf::Eskf::ties`] at the last comparison.
    ties: u32,
}

stateful!(DistanceComparison { state: log_source, attitude, since, doubt, ties; lists: cable, log, estimate, rows; });

impl Default for DistanceComparison {
    /// Creates the comparison with allocated buffers, but no readings.
    fn default() -> Self {
        let readings = || Vec::with_capacity(READINGS);
        let rows = Vec::with_capacity(ROOM);
        Self {
            cable: readings(),
            log: readings(),
            estimate: readings(),
            log_source: None,
            attitude: None,
            rows,
            since: [None; 2],
            doubt: None,
            ties: 0,
        }
    }
}

impl DistanceComparison {
    /// Processes a reading of any sensor.
    ///
    /// Allocates: never.
    pub(super) fn hear(
        &mut self,
        at: MonoNs,
        source: usize,
        sensor: &SensorInfo,
        reading: &Reading,
        site: &Site,
    ) {
        match (sensor.kind, reading) {
            (SensorKind::Tether { zero_at_m, scale }, Reading::TetherLength(length)) => {
                append(&mut self.cable, at, zero_at_m + scale * length.length_m);
            }
            (SensorKind::Imu, Reading::Attitude(level)) => {
                self.attitude = Some((at, in_tunnel(site, *level) * sensor.mount.rotation.inverse()));
            }
            (SensorKind::VelocityLog, Reading::VelocityOverGround(moved))
                if *self.log_source.get_or_insert(source) == source =>
            {
                let moved = sensor.mount.rotation * *moved;
                let attitude = self.attitude.filter(|(measured_at, _)| at.since(*measured_at).0 < SILENT.0);
                let along_mps = attitude.map_or(moved.x(), |(_, attitude)| (attitude * moved).x());
                let is_near = |then: MonoNs| (0..SILENT.0).contains(&at.since(then).0);
                let before = self.log.last().copied().filter(|(then, _)| is_near(*then));
                let way_m =
                    before.map_or(0.0, |(then, [way_m])| way_m + along_mps * at.since(then).as_secs_f64());
                if before.is_none() {
                    self.log.clear();
                    self.forget(LOG);
                }
                append(&mut self.log, at, way_m);
            }
            _ => {}
        }
    }

    /// Compares the distances at the end of an epoch.
    ///
    /// `estimate_m` is the estimated chainage at that time, m; `None` while the filter itself reports a disagreement
    /// with the cable. If the number `ties` has changed, chainages before the change are unrelated to those after it.
    ///
    /// Allocates: never.
    pub(super) fn compare(&mut self, at: MonoNs, estimate_m: Option<f64>, ties: u32, settings: &Settings) {
        // While the filter itself reports a disagreement with the cable, the estimate is not compared.
        if core::mem::replace(&mut self.ties, ties) != ties || estimate_m.is_none() {
            self.estimate.clear();
            self.forget(ESTIMATE);
        }
        if let Some(estimate_m) = estimate_m {
            append(&mut self.estimate, at, estimate_m);
        }
        let at = at - BEHIND;
        let since = self.rows.last().map(|(last, _)| at.since(*last));
        if since.is_some_and(|since| (0..EVERY.0).contains(&since.0)) {
            return;
        }
        if since.is_some_and(|since| !(0..SILENT.0).contains(&since.0)) {
            self.rows.clear();
        }
        if self.rows.len() == ROOM {
            self.rows.remove(0);
        }
        let way = |readings| at_time(readings, at).map_or(f64::NAN, |[way_m]| way_m);
        self.rows.push((at, [way(&self.cable), way(&self.log), way(&self.estimate)]));
        self.judge(at, settings);
    }

    /// Updates the times since which the distance by cable has differed from those by log and estimate. Then updates
    /// the doubt, which states the largest difference that has lasted for `LASTS`.
    fn judge(&mut self, at: MonoNs, settings: &Settings) {
        let mut doubt: Option<CableDoubt> = None;
        for (k, other) in [LOG, ESTIMATE].into_iter().enumerate() {
            let windows = WINDOWS_S.into_iter();
            let differs_m = windows.filter_map(|window_s| self.differs_m(other, window_s, settings));
            let differs_m = differs_m.fold(0.0, f64::max);
            let Some(since) = self.since.get_mut(k) else {
                debug_assert!(false, "comparison {k} is one of {}", self.since.len());
                continue;
            };
            if differs_m <= 0.0 {
                *since = None;
                continue;
            }
            let since = *since.get_or_insert(at);
            if at.since(since).0 >= LASTS.0 && doubt.is_none_or(|known| known.differs_m < differs_m) {
                let log = self.log_source.filter(|_| other == LOG);
                let log = log.and_then(|number| u16::try_from(number).ok()).map(SourceId);
                doubt = Some(CableDoubt { since, from_m: self.cable_m(), differs_m, log });
            }
        }
        self.doubt = doubt.map(|doubt| match self.doubt {
            Some(known) if known.since == doubt.since && known.log == doubt.log => {
                let differs_m = known.differs_m.max(doubt.differs_m);
                CableDoubt { differs_m, ..known }
            }
            _ => doubt,
        });
    }

    /// Returns the chainage that the cable shows, m.
    fn cable_m(&self) -> f64 {
        self.cable.last().map_or(0.0, |(_, [shown_m])| *shown_m)
    }

    /// Returns the doubt about the cable counter, if a difference has lasted for `LASTS`.
    pub(super) fn doubt(&self) -> Option<CableDoubt> {
        self.doubt
    }

    /// Marks all distances in a column of the rows as missing.
    fn forget(&mut self, column: usize) {
        for (_, row) in &mut self.rows {
            if let Some(way_m) = row.get_mut(column) {
                *way_m = f64::NAN;
            }
        }
    }

    /// Returns the difference between the distances by the cable and by another source in a time window, m.
    ///
    /// If a distance was missing at the window's beginning or end, a shorter time is compared. `None` if no time is
    /// left or if the difference is within its tolerance.
    fn differs_m(&self, other: usize, window_s: f64, settings: &Settings) -> Option<f64> {
        let (at, _) = self.rows.last()?;
        let both = |row: &[f64; 3]| {
            Some([*row.get(CABLE)?, *row.get(other)?]).filter(|ways| ways.iter().all(|way| way.is_finite()))
        };
        let mut recent = self.rows.iter().rev().take_while(|(then, _)| at.since(*then).0 < SILENT.0);
        let now = recent.find_map(|(_, row)| both(row))?;
        let from = self.rows.partition_point(|(then, _)| at.since(*then).as_secs_f64() > window_s);
        let then = self.rows.get(from..)?.iter().find_map(|(_, row)| both(row))?;
        let (cable_m, other_m) = (now[0] - then[0], now[1] - then[1]);
        let differs_m = (cable_m - other_m).abs();
        let [log_scale, log_mps] =
            if other == LOG { [LOG_SCALE, settings.velocity_sd_mps] } else { [0.0; 2] };
        let of_scale_m = math::hypot(settings.scale_sd, log_scale) * f64::max(cable_m.abs(), other_m.abs());
        let counter_m2 = 2.0 * settings.tether_sd_m * settings.tether_sd_m;
        let variance_m2 = counter_m2 + of_scale_m * of_scale_m + log_mps * log_mps * LOG_TIME_S * window_s;
        // Slack may change from its negative to its positive limit in the window, so it may explain twice the limit.
        let slack_m = 2.0 * MOST_REACH_M.max(3.0 * settings.slack.reach);
        (differs_m > slack_m + MOST_SDS * math::sqrt(variance_m2)).then_some(differs_m)
    }
}

/// Appends a reading to a list, unless it is close in time to the last one.
///
/// If the time goes back or a long gap has passed, the list restarts with this reading.
fn append(readings: &mut Vec<(MonoNs, [f64; 1])>, at: MonoNs, way_m: f64) {
    if readings.last().is_some_and(|(last, _)| (0..NEAR.0).contains(&at.since(*last).0)) {
        return;
    }
    if readings.last().is_some_and(|(last, _)| !(1..SILENT.0).contains(&at.since(*last).0)) {
        readings.clear();
    }
    if readings.len() == READINGS {
        readings.remove(0);
    }
    readings.push((at, [way_m]));
}

#[cfg(test)]
mod tests {
    use super::*;
    use headrace_geometry::frames::Vec3;
    use headrace_sensor::reading::TetherLength;

    const TETHER: usize = 1;
    const DVL: usize = 4;

    /// Position of a vehicle that moves to and fro, m, at time `t`, s.
    fn way_m(t: f64) -> f64 {
        3000.0 + 0.2 * t + 2.0 * math::sin(t / 20.0)
    }

    fn speed_mps(t: f64) -> f64 {
        0.2 + 0.1 * math::cos(t / 20.0)
    }

    /// Compares distances for `lasts_s`; returns the time of the first doubt about the cable, s, and the last doubt.
    ///
    /// Each function returns the value that a source shows at a time.
    fn compared(
        lasts_s: u32,
        cable_m: impl Fn(f64) -> f64,
        log_mps: impl Fn(f64) -> Option<f64>,
        estimate_m: impl Fn(f64) -> Option<f64>,
    ) -> (Option<f64>, Option<CableDoubt>) {
        compared_at(10, 1, lasts_s, (cable_m, log_mps, estimate_m))
    }

    /// Compares distances as `compared` does. There are `rate_hz` counter readings a second, and one log reading for
    /// every `log_every` counter readings.
    fn compared_at(
        rate_hz: u32,
        log_every: u32,
        lasts_s: u32,
        (cable_m, log_mps, estimate_m): (
            impl Fn(f64) -> f64,
            impl Fn(f64) -> Option<f64>,
            impl Fn(f64) -> Option<f64>,
        ),
    ) -> (Option<f64>, Option<CableDoubt>) {
        let (mut ways, mut first) = (DistanceComparison::default(), None);
        let (site, settings) = (Site::default(), Settings::default());
        let at = |t: f64| MonoNs(9_000_000_000) + DurNs::from_secs_f64(t);
        let of = |kind: SensorKind| SensorInfo { kind, ..SensorInfo::other() };
        let (tether, log) =
            (of(SensorKind::Tether { zero_at_m: 0.0, scale: 1.0 }), of(SensorKind::VelocityLog));
        for k in 1..rate_hz * lasts_s {
            let t = f64::from(k) / f64::from(rate_hz);
            let length = TetherLength { length_m: cable_m(t), resolution_m: 0.01, restart: None };
            ways.hear(at(t), TETHER, &tether, &Reading::TetherLength(length), &site);
            if let Some(along_mps) = log_mps(t).filter(|_| k.is_multiple_of(log_every)) {
                let moved = Vec3::new(along_mps, 0.02, 0.0);
                ways.hear(at(t), DVL, &log, &Reading::VelocityOverGround(moved), &site);
            }
            // An epoch of this test lasts a tenth of a second.
            if k.is_multiple_of(rate_hz / 10) {
                ways.compare(at(t - 0.2), estimate_m(t - 0.2), 1, &settings);
            }
            if ways.doubt().is_some() {
                first = first.or(Some(t));
            }
        }
        (first, ways.doubt())
    }

    #[test]
    fn distances_agree_if_their_errors_are_within_the_data_sheets() {
        for period_s in [3.0, 20.0, 60.0] {
            let cable_m = |t: f64| 1.002 * way_m(t) + 0.15 * math::sin(t * math::TAU / period_s);
            let none = compared(300, cable_m, |t| Some(1.01 * speed_mps(t) + 0.002), |t| Some(way_m(t)));
            assert_eq!(none, (None, None), "{period_s}");
        }
    }

    #[test]
    fn velocity_log_wrong_by_a_fifth_is_reported_with_the_difference() {
        let (first_s, doubt) = compared(120, way_m, |t| Some(1.2 * speed_mps(t)), |t| Some(way_m(t)));
        let doubt = doubt.unwrap();
        // In a window of a minute, the vehicle travels about 12 m, so the log shows about 2.4 m too much. In windows
        // with slow motion, this difference is smaller.
        assert!((0.5..3.6).contains(&doubt.differs_m) && doubt.log == Some(SourceId(4)), "{doubt:?}");
        assert!((5.0..20.0).contains(&first_s.unwrap()), "{first_s:?}");
    }

    #[test]
    fn stuck_counter_is_doubted_within_8_s() {
        let stops_at_60_s = |t: f64| way_m(t.min(60.0));
        let (first_s, doubt) =
            compared(70, stops_at_60_s, |t| Some(speed_mps(t)), |t| Some(way_m(t.min(60.0))));
        assert!((61.0..68.0).contains(&first_s.unwrap()), "{first_s:?}");
        assert_eq!(doubt.unwrap().log, Some(SourceId(4)));
    }

    #[test]
    fn diverging_estimate_is_reported_unless_the_filter_reports_a_cable_disagreement() {
        let runs = |t: f64| Some(way_m(t) + 0.5 * (t - 60.0).max(0.0));
        let (first_s, doubt) = compared(70, way_m, |_| None, runs);
        assert!((61.0..63.0).contains(&first_s.unwrap()), "{first_s:?}");
        let doubt = doubt.unwrap();
        assert!(doubt.log.is_none() && (4.0..5.0).contains(&doubt.differs_m), "{doubt:?}");
        let until_60_s = |t: f64| runs(t).filter(|_| t < 60.0);
        assert_eq!(compared(70, way_m, |_| None, until_60_s), (None, None));
    }

    #[test]
    fn cable_counters_and_velocity_logs_of_any_rate_are_compared() {
        for (rate_hz, log_every) in [(10, 1), (10, 10), (10, 20), (50, 5), (200, 50), (1000, 125)] {
            let log_mps = |t: f64| Some(1.2 * speed_mps(t));
            let compare = |share: f64| {
                let log_mps = move |t: f64| log_mps(t).map(|mps| share * mps);
                compared_at(rate_hz, log_every, 60, (way_m, log_mps, |t: f64| Some(way_m(t))))
            };
            let (first_s, doubt) = compare(1.0);
            assert!((5.0..25.0).contains(&first_s.unwrap()) && doubt.is_some(), "{rate_hz}: {first_s:?}");
            assert_eq!(compare(1.0 / 1.2), (None, None), "{rate_hz}");
        }
    }

    #[test]
    fn velocity_log_that_returns_after_silence_causes_no_doubt_about_the_cable() {
        let log_mps = |t: f64| (!(30.0..50.0).contains(&t)).then(|| speed_mps(t));
        assert_eq!(compared(120, way_m, log_mps, |t| Some(way_m(t))), (None, None));
    }
}
