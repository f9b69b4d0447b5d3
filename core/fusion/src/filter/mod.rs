//! Navigation by an error-state Kalman filter: inertial propagation, corrected by all other sensors.
//!
//! Readings wait in a window until all readings of the same time have arrived. They are fused at their time of
//! validity, epoch by epoch. A fix is the estimate of the last epoch, propagated by the inertial samples after it.
//! Derivation: `docs/why/navigation.md`.

pub mod agreement;
pub mod align;
pub mod bias_drift;
pub mod cable;
pub mod clones;
pub mod context;
pub mod corrections;
pub mod count_step;
pub mod counter_zero;
mod distance_comparison;
pub mod eskf;
mod evidence;
pub mod factors;
mod head_tilt;
pub mod inertial;
pub mod measure;
pub mod noise_level;
pub mod pose_sd;
mod pose_window;
mod repeated_bumps;
mod roughness;
pub mod setting_check;
pub mod settings;
mod slack_level;
pub mod sources;
pub mod state;
pub mod updates;
pub mod window;
pub mod zupt;

#[cfg(test)]
mod tests;

use self::align::{LISTENS, Listening};
use self::cable::CableDoubt;
use self::context::Context;
use self::counter_zero::CounterZero;
use self::distance_comparison::DistanceComparison;
use self::eskf::{BIAS_KNOWN_RADPS, Eskf};
use self::pose_sd::PoseSd;
use self::setting_check::SettingDoubt;
use self::settings::Settings;
use self::sources::{ATTITUDE_PERIOD, Consistency, DEPTH_PERIOD, Source, VELOCITY_PERIOD};
use self::state::{RANGES, RATE_BIAS, State, rotation};
use self::window::{Waiting, Window};
use self::zupt::RestDetector;
use super::relative::Relative;
use super::smooth::journal::Journal;
use super::smooth::relative_backward::UNTIED;
use crate::fix::{Fix, NoFix, Times};
use crate::navigation::Navigation;
use headrace_geometry::frames::{Body, Pose, Vec3};
use headrace_geometry::math;
use headrace_geometry::site::Site;
use headrace_geometry::snapshot::stateful;
use headrace_geometry::time::{DurNs, MonoNs};
use headrace_geometry::tunnel::Profile;
use headrace_sampling::margin::{APART_SHARE, error_time_s};
use headrace_sensor::device::{SensorInfo, SensorKind};
use headrace_sensor::reading::{MAX_SOURCES, Reading};

/// Maximum time by which a fix is extrapolated beyond the last inertial sample.
pub(super) const CARRIES: DurNs = DurNs(2_000_000_000);
/// Largest plausible step of the clock. If the clock goes back by more than this, it has been reset.
///
/// A reading is also rejected if its timestamp is ahead of its receive time by more than this.
pub(super) const CLOCK_JUMP: DurNs = DurNs(10_000_000_000);
/// Largest standard deviations of position and tilt. Beyond them, linearised updates would not converge, so the
/// estimate is restarted.
const LOST_PLACE_M: f64 = 3.0;
const LOST_TILT_RAD: f64 = 0.2;
/// The estimate is restarted after all sensors have been silent for this time.
const SILENCE: DurNs = DurNs(5_000_000_000);
/// Largest plausible turn rate and specific force of an inertial sample. A unit that exceeds these values is saturated
/// or faulty.
const MOST_RATE_RADPS: f64 = 10.0;
const MOST_FORCE_MPS2: f64 = 50.0;
/// Maximum number of estimates after the last epoch. The longest window plus the longest epoch is 1.2 s. In this time,
/// an inertial unit at 600 Hz needs 720 estimates.
const AHEAD: usize = 1024;
/// Assumed time between two passes of the heads over the same position if no head is known to turn.
const USUAL_GAP: DurNs = DurNs(20_000_000_000);

/// Navigation by the error-state Kalman filter.
pub struct FilterNavigation {
    context: Context,
    window: Window,
    sources: Vec<Option<Source>>,
    /// Inertial unit for propagation: the first unit that delivered a reading. The estimate refers to its position.
    unit: Option<usize>,
    listening: Listening,
    stillness: RestDetector,
    raw_ways: DistanceComparison,
    zero: CounterZero,
    running: Eskf,
    is_running: bool,
    /// Start of the first epoch. Each later epoch begins a whole number of epoch lengths after it.
    epoch_zero: MonoNs,
    /// Latest receive time of any reading.
    received: MonoNs,
    /// Estimates after the last epoch, propagated by inertial samples.
    ahead: Vec<(MonoNs, State)>,
    standing: Result<Relative, NoFix>,
    /// Error covariance relative to a much earlier visit to this position. The error at that visit is assumed to be
    /// independent and equally large.
    revisit: Relative,
    /// Number of restarts of the estimate, because it was lost or not finite, or because the clock went back.
    restarts: u64,
    journal: Option<Journal>,
}

stateful!(FilterNavigation { state: context, window, unit, listening, stillness, raw_ways, zero, running, is_running, epoch_zero, received, standing, revisit, restarts; lists: ahead; slots: sources; fixed: journal; });

impl FilterNavigation {
    /// Creates the navigation filter, which has no readings yet.
    pub fn new(profile: Profile, site: Site, settings: Settings) -> Self {
        Self {
            context: Context { profile, site, settings, unit_at: Vec3::zero() },
            unit: None,
            window: Window::default(),
            sources: vec![None; MAX_SOURCES],
            listening: Listening::default(),
            stillness: RestDetector::default(),
            raw_ways: DistanceComparison::default(),
            zero: CounterZero::default(),
            running: Eskf::default(),
            is_running: false,
            epoch_zero: MonoNs(0),
            received: MonoNs(0),
            ahead: Vec::with_capacity(AHEAD),
            standing: Err(NoFix::Heading),
            revisit: Relative::default(),
            restarts: 0,
            journal: None,
        }
    }

    /// Returns the estimate and its covariance; `None` before the first estimate.
    pub fn running(&self) -> Option<&Eskf> {
        self.is_running.then_some(&self.running)
    }

    /// Returns the time at which the cable readings left the expected range. `None` while the readings are trusted.
    ///
    /// A doubt is reported once it has lasted for a second.
    pub fn cable_doubted_since(&self) -> Option<MonoNs> {
        self.cable_doubt().map(|doubt| doubt.since)
    }

    /// Position of the inertial unit on the vehicle. The estimate refers to this position.
    pub fn unit_at(&self) -> Vec3<Body> {
        self.context.unit_at
    }

    /// Number of restarts of the estimate so far.
    pub fn restarts(&self) -> u64 {
        self.restarts
    }

    /// Records the filter's steps in each epoch from now on, for smoothing after the dive.
    #[must_use]
    pub(crate) fn with_journal(mut self, journal: Journal) -> Self {
        self.running.keep_steps();
        self.journal = Some(journal);
        self
    }

    /// Fuses all epochs that ended at or before `until`.
    fn close_epochs(&mut self, until: MonoNs) {
        let last = self.epoch_before(until);
        if !self.is_running || self.running.at >= last {
            return;
        }
        while self.running.at < last {
            let due = self.epoch_before(self.running.at + self.context.settings.epoch);
            // A time span without readings is propagated in a single step.
            let heard =
                self.window.next_heard(self.running.at).map_or(last, |heard| self.epoch_before(heard));
            let to = due.max(heard).min(last);
            debug_assert!(to > self.running.at, "an epoch from {:?} ends later: {to:?}", self.running.at);
            let is_silent = to.since(self.running.at).0 > SILENCE.0;
            self.running.is_at_rest = self.stillness.is_still() && self.dispute().is_none();
            self.running.advance(to, &self.context, &mut self.window, &mut self.sources);
            if self.running.is_at_rest && self.dispute().is_none() {
                let unit = self.unit.and_then(|unit| self.sources.get(unit).copied().flatten());
                let mean = self.stillness.take_mean_rate().zip(unit);
                self.running.rest(mean.map(|(rate, unit)| unit.sensor.mount.rotation * rate));
            }
            self.window.forget(to);
            let is_reported = self.dispute().is_some() || self.has_jumped();
            let estimate_m = (!is_reported).then(|| self.running.state.position.x());
            self.raw_ways.compare(to, estimate_m, self.running.ties, &self.context.settings);
            self.write_steps();
            if is_silent {
                self.begin_anew(self.running.pose_sd().along_m);
                return;
            }
        }
        self.after_epochs();
    }

    /// Returns the filter's own doubt about the cable counter.
    fn dispute(&self) -> Option<CableDoubt> {
        self.running().and_then(|running| running.cable.doubt(running.at))
    }

    /// Returns the difference of the cable's distance from that of velocity log or estimate, as an error along the
    /// tunnel.
    fn raw_error(&self) -> Relative {
        Relative::along(self.raw_ways.doubt().map_or(0.0, |doubt| doubt.differs_m))
    }

    fn write_steps(&mut self) {
        let gap = match self.pass_gap() {
            _ if self.has_jumped() => UNTIED,
            gap => gap,
        };
        let unit_at = self.context.unit_at;
        if let Some(journal) = &mut self.journal {
            for step in self.running.steps.drain(..) {
                journal.write(&step, unit_at, gap);
            }
        }
    }

    /// Records for smoothing that the present estimate ends.
    fn write_end(&mut self) {
        if self.is_running && self.journal.is_some() {
            self.running.keep_end();
            self.write_steps();
        }
    }

    /// Returns the start of the epoch that contains the time `at`.
    fn epoch_before(&self, at: MonoNs) -> MonoNs {
        let epoch_ns = self.context.settings.epoch.0.unsigned_abs().max(1);
        MonoNs(at.0 - at.0.saturating_sub(self.epoch_zero.0) % epoch_ns)
    }

    fn after_epochs(&mut self) {
        let sd = self.running.pose_sd();
        if !self.running.is_sound() || sd.place_m > LOST_PLACE_M || sd.tilt_rad > LOST_TILT_RAD {
            self.begin_anew(sd.along_m);
            return;
        }
        debug_assert!(sd.is_valid(), "standard deviations of a sound estimate are numbers: {sd:?}");
        let pass_gap = self.pass_gap();
        let relative = self.running.clones.relative(pass_gap);
        // Until two clones exist, errors of new soundings count as independent of the errors of earlier soundings.
        self.revisit = sd.independent();
        let differs = Relative::along(self.running.cable.differs_m());
        let relative = relative.unwrap_or(self.revisit).weighted(1.0, &differs, 1.0);
        let unslipped = PoseSd { along_m: self.running.along_sd_m(), ..sd };
        self.standing = match unslipped.standing(relative) {
            Ok(_) if self.has_jumped() => Err(NoFix::Chainage),
            standing => standing,
        };
        self.carry_ahead();
    }

    /// Whether the offset between earlier and present soundings is unknown.
    ///
    /// It is unknown if the chainage was reacquired since the heads last passed this position. Once the cable counter's
    /// zero is lost, it stays unknown.
    fn has_jumped(&self) -> bool {
        if self.zero.is_lost() {
            return true;
        }
        let longest = self.between_passes(1.0);
        self.running.way_sought.is_some_and(|then| self.running.at.since(then).0 <= longest.0)
    }

    /// Ends the estimate and starts a new alignment, because step-by-step correction would not converge.
    ///
    /// Samples that are already georeferenced keep their positions. The chainage is kept until the next cable reading.
    fn begin_anew(&mut self, along_m: f64) {
        self.write_end();
        let x_m = self.running.state.position.x();
        if self.is_running && x_m.is_finite() && along_m.is_finite() {
            self.listening = Listening::after(Some((x_m, along_m)));
        } else {
            self.listening = Listening::after(self.listening.before());
        }
        self.standing = Err(self.listening.missing_part());
        self.is_running = false;
        self.restarts += 1;
    }

    /// Propagates the estimate to each inertial sample since the last epoch.
    fn carry_ahead(&mut self) {
        let (mut now, mut state) = (self.running.at, self.running.state);
        self.ahead.clear();
        self.ahead.push((now, state));
        while let Some(heard) = self.window.next_felt(now).filter(|_| self.ahead.len() < AHEAD) {
            let (felt, until) = self.window.felt(now, heard);
            state.move_on(&felt, until.since(now).as_secs_f64(), self.context.site.gravity_mps2);
            now = until;
            self.ahead.push((now, state));
        }
    }

    /// Returns the time over which errors accumulate between two successive passes over the same position.
    fn pass_gap(&self) -> DurNs {
        self.between_passes(APART_SHARE)
    }

    /// Returns the time between two passes of evenly spread heads, plus the share `apart_share` of the time until the
    /// rearmost head reaches the position of the foremost head.
    fn between_passes(&self, apart_share: f64) -> DurNs {
        let (mut passes_per_s, mut ahead_m, mut astern_m) = (0.0, f64::NEG_INFINITY, f64::INFINITY);
        for source in self.sources.iter().flatten() {
            let Some(turns_per_s) = source.turning.turns_per_s(self.received) else { continue };
            let x_m = source.sensor.mount.position.x();
            passes_per_s += turns_per_s;
            (ahead_m, astern_m) = (f64::max(ahead_m, x_m), f64::min(astern_m, x_m));
        }
        if passes_per_s <= 0.0 {
            return USUAL_GAP;
        }
        let speed_mps = self.running.state.velocity_mps.x();
        DurNs::from_secs_f64(error_time_s(passes_per_s, ahead_m - astern_m, speed_mps, apart_share))
    }

    /// Adds a reading to the window, unless recent readings of the same source make it superfluous.
    fn take(&mut self, number: usize, at: MonoNs, reading: &Reading) {
        let step_rad = self.context.settings.return_step_rad;
        let Some(Some(source)) = self.sources.get_mut(number) else {
            debug_assert!(false, "source {number}, which has a reading, is known");
            return;
        };
        let mount = source.sensor.mount;
        let wanted = match (source.sensor.kind, reading) {
            (SensorKind::Head, Reading::Sonar(sonar)) => source.turning.ping(at, sonar, step_rad),
            (SensorKind::Echosounder { min_confidence }, Reading::Echo(echo)) => {
                echo.range_m.is_some() && echo.confidence >= min_confidence
            }
            (SensorKind::Imu, Reading::Attitude(_)) => source.is_due(at, ATTITUDE_PERIOD),
            (SensorKind::Depth, Reading::Pressure(_)) => source.is_due(at, DEPTH_PERIOD),
            (SensorKind::VelocityLog, Reading::VelocityOverGround(_)) => source.is_due(at, VELOCITY_PERIOD),
            (SensorKind::Tether { .. }, Reading::TetherLength(_)) => true,
            (SensorKind::Imu, Reading::AngularRate(_) | Reading::SpecificForce(_))
                if self.unit != Some(number) =>
            {
                false
            }
            (SensorKind::Imu, Reading::AngularRate(turn)) if turn.norm() > MOST_RATE_RADPS => {
                source.consistency.dropped += 1;
                false
            }
            (SensorKind::Imu, Reading::SpecificForce(force)) if force.norm() > MOST_FORCE_MPS2 => {
                source.consistency.dropped += 1;
                self.window.take_jolt(at, force.norm());
                false
            }
            (SensorKind::Imu, Reading::AngularRate(rate)) => {
                source.consistency.dropped += u64::from(!self.window.take_rate(at, mount.rotation * *rate));
                false
            }
            (SensorKind::Imu, Reading::SpecificForce(force)) => {
                source.consistency.dropped += u64::from(!self.window.take_force(at, mount.rotation * *force));
                false
            }
            _ => false,
        };
        if !wanted {
            return;
        }
        if self.is_running && at <= self.running.at {
            source.consistency.late += 1;
            return;
        }
        let waiting = Waiting { at, source: number, reading: *reading };
        source.consistency.dropped += u64::from(!self.window.take(waiting));
    }
}

impl Navigation for FilterNavigation {
    fn update(&mut self, number: usize, sensor: &SensorInfo, times: Times, reading: &Reading) {
        if self.received.since(times.received) > CLOCK_JUMP {
            // Either the clock was reset now, or the previous timestamp was wrong. The estimate is restarted in both
            // cases, because otherwise the clock may catch up only much later.
            let along_m = self.running.pose_sd().along_m;
            self.begin_anew(along_m);
            self.window.clear();
            self.received = times.received;
            if let Some(journal) = &mut self.journal {
                journal.clock_set();
            }
        }
        self.received = self.received.max(times.received);
        self.close_epochs(self.received - self.context.settings.window);
        let Some(slot) = self.sources.get_mut(number) else { return };
        let source = slot.get_or_insert_with(|| Source::new(*sensor));
        if !reading.is_finite() || times.valid.since(times.received) > CLOCK_JUMP {
            source.consistency.dropped += 1;
            return;
        }
        match reading {
            Reading::TetherLength(length) if matches!(sensor.kind, SensorKind::Tether { .. }) => {
                self.zero.hear(times.received, length, self.standing.is_ok());
            }
            _ => self.zero.hear_other(times.received),
        }
        self.raw_ways.hear(times.valid, number, sensor, reading, &self.context.site);
        if !self.is_running {
            if sensor.kind == SensorKind::Imu && self.unit.is_none() {
                self.unit = Some(number);
                self.context.unit_at = sensor.mount.position;
            }
            // Readings from before the start of the alignment are never fused.
            let old = self.received - LISTENS;
            self.window.drop_until(old);
            self.window.forget(old);
            self.listening.hear(&self.context, number, sensor, times.valid, reading);
            self.standing = Err(self.listening.missing_part());
            self.epoch_zero = self.listening.since().unwrap_or(times.valid);
            let at = self.epoch_before(times.valid);
            if let Some((state, factors)) = self.listening.settle(at, &self.context) {
                self.running.begin(at, state, factors);
                self.is_running = true;
                self.stillness.ask_from(at);
                if let Some(journal) = &mut self.journal {
                    journal.begin();
                }
                self.window.drop_until(at);
                self.after_epochs();
            }
        }
        if sensor.kind != SensorKind::Imu || self.unit == Some(number) {
            self.stillness.take(times.valid, sensor.kind, reading);
        }
        self.take(number, times.valid, reading);
    }

    fn end(&mut self) {
        if self.journal.is_some() {
            self.close_epochs(self.received);
            self.write_end();
        }
    }

    fn consistency(&self, source: usize) -> Option<Consistency> {
        self.sources.get(source).copied().flatten().map(|source| source.consistency)
    }

    fn pose_sd(&self) -> Option<PoseSd> {
        let raw_m = self.raw_error().sd_m(Vec3::zero());
        self.running().map(Eskf::pose_sd).map(|sd| PoseSd { along_m: math::hypot(sd.along_m, raw_m), ..sd })
    }

    fn stand_s(&self) -> u32 {
        let Some(running) = self.running() else { return 0 };
        let variances = [0, 1, 2].map(|axis| running.factors.variance(RATE_BIAS + axis));
        let is_known = variances.iter().all(|variance| *variance < BIAS_KNOWN_RADPS * BIAS_KNOWN_RADPS);
        if is_known || self.unit.is_none() { 0 } else { self.stillness.stop_left_s(running.at) }
    }

    fn setting_doubt(&self) -> Option<SettingDoubt> {
        let running = self.running()?;
        let scale_sd = math::sqrt(running.factors.variance(RANGES));
        running.suspicions.doubt([running.state.range_scale, scale_sd])
    }

    fn has_unverified_mounts(&self) -> bool {
        self.running().is_some_and(|running| running.suspicions.has_unverified_mounts())
    }

    fn cable_doubt(&self) -> Option<CableDoubt> {
        self.dispute().or_else(|| self.raw_ways.doubt())
    }

    fn fix(&self, at: MonoNs) -> Result<Fix, NoFix> {
        let relative = self.standing?.weighted(1.0, &self.raw_error(), 1.0);
        let before = self.ahead.partition_point(|(knot, _)| *knot <= at);
        let (from, state) = self.ahead.get(before.saturating_sub(1)).ok_or(NoFix::Heading)?;
        let mut state = *state;
        if at > *from {
            if at.since(*from).0 > CARRIES.0 {
                return Err(NoFix::Heading);
            }
            let mut now = *from;
            while now < at {
                let (felt, until) = self.window.felt(now, at);
                state.move_on(&felt, until.since(now).as_secs_f64(), self.context.site.gravity_mps2);
                now = until;
            }
        } else {
            let back_s = from.since(at).as_secs_f64();
            if back_s > 1.0 {
                return Err(NoFix::Heading);
            }
            state.position = state.position + state.velocity_mps.scaled(-back_s);
            let (felt, _) = self.window.felt(*from, *from + DurNs(1));
            let rate = felt.rate_radps.map_or_else(Vec3::zero, |rate| rate + -state.rate_bias_radps);
            state.attitude = state.attitude * rotation(rate.scaled(-back_s));
        }
        let arm = state.attitude * -self.context.unit_at;
        let pose = Pose { position: state.position + arm, attitude: state.attitude };
        debug_assert!(pose.position.is_finite() && pose.attitude.is_unit(), "a fix has a pose: {pose:?}");
        let (speed_mps, tie) = (state.velocity_mps.x(), self.running.ties);
        let settled = self.running.settled;
        let mounts = self.running.suspicions.mount_error(self.context.settings.mount_sd_rad);
        let [relative, revisit] =
            [relative, self.revisit].map(|of| of.moved(arm).weighted(1.0, &mounts, 1.0));
        Ok(Fix { pose, speed_mps, relative, revisit, tie, settled })
    }
}
