//! The error-state Kalman filter.
//!
//! In each epoch, inertial data first propagate the estimate; then the epoch's measurements correct it.

use core::ops::Range;

use super::agreement::{self, Agreement};
use super::bias_drift::BiasDrift;
use super::cable::{Cable, CableReading, Use};
use super::clones::ErrorClones;
use super::context::Context;
use super::factors::{Factors, Gain};
use super::inertial::Leg;
use super::measure::{self, ScalarUpdate};
use super::pose_sd::PoseSd;
use super::repeated_bumps::RepeatedBumps;
use super::roughness::{Look, Roughness};
use super::setting_check::SettingChecks;
use super::settings::Settings;
use super::slack_level::{Noises, SlackEstimate};
use super::sources::{self, Source, TETHER_PERIOD, VELOCITY_LOOKS};
use super::state::{
    self, ATTITUDE, CREEP, ERRORS, Errors, FORCE_BIAS, HEADING, POSITION, RANGES, RATE_BIAS, State, VELOCITY,
    add_to, put,
};
use super::updates::rows;
use super::window::{Waiting, Window};
use crate::smooth::step::{Move, Step};
use headrace_geometry::frames::{Body, Point3, Rot, Tunnel, Vec3};
use headrace_geometry::math;
use headrace_geometry::snapshot::stateful;
use headrace_geometry::time::{DurNs, MonoNs};
use headrace_geometry::tunnel::Profile;
use headrace_sensor::device::SensorKind;
use headrace_sensor::reading::{Reading, SonarReturn};

/// Maximum number of estimates kept within an epoch, one at each inertial sample.
const KNOTS: usize = 256;
/// Standard deviation of the velocity of a vehicle at rest, m/s, caused by motion of the sea or of the deck.
const REST_SD_MPS: f64 = 0.02;
/// Standard deviation of the mean turn rate over a second at rest, rad/s.
const REST_SD_RADPS: f64 = 1e-3;
/// Gate for zero-velocity updates (chi-square). An update of a vehicle at rest exceeds the gate once in ten thousand
/// times.
const REST_GATE: f64 = 15.1;
/// Standard deviation of a predicted range below which the wall counts as flat, m.
///
/// If the sd of the range noise is smaller, that sd is the limit.
const NEAR_M: f64 = 0.03;
/// Standard deviation of the prior for the vehicle's speed, m/s.
const SPEED_SD_MPS: f64 = 0.5;
/// The variances of a position beyond the wall increase by the square of this, m.
const BEYOND_M: f64 = 1.5;

/// Standard deviation below which the gyro bias counts as known, rad/s.
///
/// A bias error of this size turns the attitude by a milliradian in a head pass of 3 s. So a longer stop would gain
/// little.
pub(super) const BIAS_KNOWN_RADPS: f64 = 3e-4;
/// Largest normalised squared innovation at which a range gets the learnt noise of a smooth wall.
const SMOOTH: f64 = 4.0;
/// Largest ratio of a counter's step to its noise at which the rounding is negligible.
const FINE_SHARE: f64 = 0.2;
/// Maximum time for which an estimate settles after its start. While it settles, its yaw becomes more certain.
const SETTLES_WITHIN: DurNs = DurNs(20_000_000_000);
/// Standard deviation of yaw at which an estimate counts as settled, radians.
///
/// A yaw error of this size moves a sounding at 6 m by 5 cm. When yaw becomes more certain than this, earlier and later
/// soundings are still compared.
const SETTLED_RAD: f64 = 0.5 * core::f64::consts::PI / 180.0;

/// Maximum number of recorded steps in an epoch: the propagation, two additions to the covariance, and an end.
const STEPS: usize = 4;

/// The filter's estimate at one time, with its covariance.
#[derive(Debug, Clone)]
pub struct Eskf {
    /// Time of the estimate. All earlier readings have been fused.
    pub at: MonoNs,
    /// The estimated state.
    pub state: State,
    /// Covariance of the state's errors.
    pub factors: Factors<ERRORS>,
    /// Clones of earlier errors, for relative covariances.
    pub clones: ErrorClones,
    /// Time at which the filter last reacquired a lost chainage.
    pub way_sought: Option<MonoNs>,
    /// Variance of the length that the counter may have lost permanently, m^2.
    slipped_m2: f64,
    /// Number of times that the offset between earlier and later soundings has become unknown.
    pub ties: u32,
    /// Start time of the estimate, and standard deviation of yaw at the start or when it had last halved, radians.
    begun: (MonoNs, f64),
    /// Number of times that the standard deviation of yaw has halved while the estimate settled.
    pub settled: u32,
    /// Estimates within the last epoch, before the epoch's measurements were fused.
    knots: Vec<(MonoNs, State)>,
    agreement: Agreement,
    /// Comparison of the cable counter with the estimate.
    pub cable: Cable,
    unrest: BiasDrift,
    slack_level: SlackEstimate,
    /// Learnt roughness of the wall.
    roughness: Roughness,
    seen_again: RepeatedBumps,
    /// Share of the declared variance that is used for ranges of heads until the gyro bias is known. It is the largest
    /// share that a head has learnt.
    smoothness: f64,
    /// Whether the vehicle is known to be at rest. Its heads then see the same bumps in every turn.
    pub is_at_rest: bool,
    /// Whether inertial data were missing in the last epoch. The motion is then a guess, and no noise is learnt.
    is_blind: bool,
    /// Checks of settings by the residuals of ranges.
    pub suspicions: SettingChecks,
    /// Variances to add at the end of the epoch, because the estimate may be wrong.
    doubts: Errors,
    /// Filter steps of the last epoch, for smoothing. Empty unless `keeps_steps` is true.
    pub steps: Vec<Step>,
    keeps_steps: bool,
}

stateful!(Eskf { state: at, state, factors, clones, way_sought, slipped_m2, ties, begun, settled, agreement, cable, unrest, slack_level, roughness, seen_again, smoothness, is_at_rest, is_blind, suspicions, doubts; lists: knots; fixed: steps, keeps_steps; });

impl Default for Eskf {
    /// Creates a filter with allocated buffers and no state estimate yet.
    fn default() -> Self {
        Self {
            at: MonoNs(0),
            state: State::at_rest(Point3::zero(), Rot::identity()),
            factors: Factors::independent([0.0; ERRORS]),
            clones: ErrorClones::default(),
            way_sought: None,
            slipped_m2: 0.0,
            ties: 0,
            begun: (MonoNs(0), 0.0),
            settled: 0,
            knots: Vec::with_capacity(KNOTS),
            agreement: Agreement::default(),
            cable: Cable::default(),
            unrest: BiasDrift::default(),
            slack_level: SlackEstimate::default(),
            roughness: Roughness::default(),
            seen_again: RepeatedBumps::default(),
            smoothness: 1.0,
            is_at_rest: false,
            is_blind: false,
            suspicions: SettingChecks::default(),
            doubts: [0.0; ERRORS],
            steps: Vec::new(),
            keeps_steps: false,
        }
    }
}

/// Innovation of an update, with the variances that determine its weight.
struct Weighed {
    innovation: f64,
    /// Variance of the innovation that comes from the estimate.
    of_estimate: f64,
    /// Declared variance of the measurement noise.
    declared: f64,
    /// Learnt variance of the noise of a single reading.
    white: f64,
    /// Variance caused by bumps of the wall, if many readings see the same bump.
    bumps: f64,
}

impl Eskf {
    /// Records the steps of each epoch in `steps` from now on, for smoothing. The caller drains them after each
    /// epoch.
    ///
    /// Allocates: the buffer for the steps.
    pub fn keep_steps(&mut self) {
        self.steps.reserve_exact(STEPS);
        self.keeps_steps = true;
    }

    /// Starts the filter with a first estimate and its covariance.
    pub fn begin(&mut self, at: MonoNs, state: State, factors: Factors<ERRORS>) {
        (self.at, self.state, self.factors) = (at, state, factors);
        self.clones.clear();
        self.agreement = Agreement::default();
        self.cable = Cable::default();
        self.slack_level.skip();
        self.doubts = [0.0; ERRORS];
        self.way_sought = None;
        self.slipped_m2 = 0.0;
        self.ties += 1;
        self.begun = (at, self.pose_sd().yaw_rad);
    }

    /// Marks earlier samples as unrelated to later ones each time the standard deviation of yaw has halved.
    ///
    /// While the estimate settles, samples become ever more certain. So the errors of earlier samples say nothing about
    /// the errors between later passes.
    fn settle(&mut self) {
        debug_assert!(self.factors.has_variances(), "variances aren't negative: {:?}", self.factors);
        let (begun, yaw_rad) = self.begun;
        let now_rad = self.pose_sd().yaw_rad;
        let is_settling = self.at.since(begun).0 <= SETTLES_WITHIN.0 && yaw_rad > SETTLED_RAD;
        if is_settling && now_rad < yaw_rad / 2.0 {
            self.begun = (begun, now_rad);
            self.settled += 1;
            self.clones.clear();
            self.clones.note(self.at, &self.factors);
        }
    }

    /// Advances the estimate to a later time, and fuses the waiting readings up to that time.
    pub fn advance(
        &mut self,
        to: MonoNs,
        context: &Context,
        window: &mut Window,
        sources: &mut [Option<Source>],
    ) {
        let (mut nominal, leg) = self.propagate(to, context, window);
        let leg = leg.with_noise(self.unrest.factors(), self.slack_level.slack(&context.settings));
        self.is_blind = leg.is_blind();
        let transition = leg.transition(&context.settings);
        transition.fade(&mut nominal);
        self.keep(to, &Move::Leg(leg), nominal);
        transition.carry(&mut self.factors);
        leg.disturb(&context.settings, &transition, &mut self.factors);
        self.clones.carry(&transition);
        let is_bias_known = self.factors.variance(RATE_BIAS + 2) < BIAS_KNOWN_RADPS * BIAS_KNOWN_RADPS;
        self.smoothness = if is_bias_known { 1.0 } else { sources::smoothness(sources) };
        self.seen_again.pass(nominal.position.x(), &context.settings);
        let jolt_mps = window.jolted(to);
        if jolt_mps > 0.0 {
            self.slack_level.skip();
        }
        let mut errors = [0.0; ERRORS];
        while let Some(waiting) = window.pop(to) {
            self.fuse_reading(&waiting, (to, window), context, sources, &mut errors);
        }
        (self.at, self.state) = (to, nominal);
        self.state.correct(&errors);
        self.bound_speed();
        self.stay_inside(&context.profile);
        self.clones.note(to, &self.factors);
        self.settle();
        self.unrest.pass(leg.dt_s(), &context.settings);
        self.note_jolt(jolt_mps, context.settings.epoch.as_secs_f64());
        self.agreement.seek(&mut self.doubts);
        let doubts = core::mem::replace(&mut self.doubts, [0.0; ERRORS]);
        if doubts.iter().any(|variance| *variance > 0.0) {
            self.widen(&doubts);
        }
    }

    /// Fuses a reading of an epoch that ends at `to`, and adds the corrections to `errors`.
    fn fuse_reading(
        &mut self,
        waiting: &Waiting,
        (to, window): (MonoNs, &Window),
        context: &Context,
        sources: &mut [Option<Source>],
        errors: &mut Errors,
    ) {
        // Each reading is compared with the best estimate so far, because the first readings after a silence
        // may change the estimate by metres.
        let known = *errors;
        let later_s = to.since(waiting.at).as_secs_f64();
        let mut then = self.state_at(waiting.at);
        then.correct(&state::earlier(&known, later_s));
        self.suspicions.hear(&then, &context.design(), sources, waiting);
        let others_change = sources::others_change(sources, waiting.source);
        let Some(Some(source)) = sources.get_mut(waiting.source) else { return };
        if let Reading::TetherLength(length) = waiting.reading {
            source.count_step.hear(waiting.at, length.length_m, length.resolution_m);
            if !source.is_due(waiting.at, TETHER_PERIOD) {
                return;
            }
        }
        for (number, row) in rows(&then, context, source, waiting, window).into_iter().enumerate() {
            let again =
                |state: &State| rows(state, context, source, waiting, window).get(number).copied().flatten();
            if let Some(row) = row.and_then(|row| self.straight(row, &then, again)) {
                let sd_m = math::sqrt(self.factors.variance_along(&row.h));
                if source.says_one_range(&waiting.reading, row.residual, sd_m) && others_change {
                    source.leave_out(number);
                    continue;
                }
                let row = row.seen_later(later_s);
                self.fuse(&row, (waiting, number), &context.settings, source, (&known, &mut *errors));
            }
        }
    }

    /// Adds the speed change by an implausible force to the uncertainty. The filter ignores the force, but it may be
    /// real.
    fn note_jolt(&mut self, speed_mps: f64, epoch_s: f64) {
        let variance = speed_mps * speed_mps;
        let way = variance * epoch_s * epoch_s;
        for k in 0..3 {
            add_to(&mut self.doubts, VELOCITY + k, variance);
            add_to(&mut self.doubts, POSITION + k, way);
        }
    }

    /// Adds to the variances of the estimate's errors. The estimate itself does not change.
    fn widen(&mut self, variances: &Errors) {
        self.keep(self.at, &Move::Widened(*variances), self.state);
        self.factors.widen(variances);
    }

    /// Records a step that begins with the current estimate.
    fn keep(&mut self, to: MonoNs, by: &Move, predicted: State) {
        let kept = self.steps.len();
        debug_assert!(
            !self.keeps_steps || kept < STEPS,
            "an epoch has at most {STEPS} steps: {kept} before this"
        );
        if self.keeps_steps && kept < STEPS {
            let (at, state, factors) = (self.at, self.state, self.factors);
            self.steps.push(Step { at, to, state, factors, by: *by, predicted });
        }
    }

    /// Records that the estimate ends at its current time.
    pub fn keep_end(&mut self) {
        self.keep(self.at, &Move::End, self.state);
    }

    /// Fuses zero velocity (ZUPT), and the mean turn rate as gyro bias, unless the estimated velocity contradicts
    /// rest.
    pub fn rest(&mut self, mean_radps: Option<Vec3<Body>>) {
        let rows = measure::rest(&self.state, REST_SD_MPS);
        let unlikely = |row: &ScalarUpdate| {
            row.residual * row.residual > REST_GATE * (self.factors.variance_along(&row.h) + row.noise)
        };
        if rows.iter().any(unlikely) {
            return;
        }
        let mut errors = [0.0; ERRORS];
        let turns = mean_radps.map(|mean| measure::no_turn(&self.state, mean, REST_SD_RADPS));
        for row in rows.iter().chain(turns.iter().flatten()) {
            self.correct(row, &[0.0; ERRORS], &mut errors);
        }
        self.state.correct(&errors);
    }

    /// Whether state and covariance are finite and no variance is negative.
    pub fn is_sound(&self) -> bool {
        self.state.is_sound() && self.factors.is_sound()
    }

    fn propagate(&mut self, to: MonoNs, context: &Context, window: &Window) -> (State, Leg) {
        debug_assert!(to >= self.at, "an epoch from {:?} ends later: {to:?}", self.at);
        let mut leg = Leg::default();
        let (mut now, mut state) = (self.at, self.state);
        self.knots.clear();
        self.knots.push((now, state));
        self.slack_level.begin(now);
        while now < to {
            let (felt, until) = window.felt(now, to);
            self.slack_level.go_on(&felt, until, &self.state, context.site.gravity_mps2);
            state.go_on(&felt, until.since(now).as_secs_f64(), context.site.gravity_mps2, &mut leg);
            now = until;
            if self.knots.len() < KNOTS {
                self.knots.push((now, state));
            }
        }
        (state, leg)
    }

    /// Returns the estimate at a time within the last epoch, before the measurements of the epoch.
    fn state_at(&self, at: MonoNs) -> State {
        debug_assert!(at > self.at, "earlier readings than {:?} are fused: {at:?}", self.at);
        let next = self.knots.partition_point(|(knot, _)| *knot < at);
        let (before, after) = (self.knots.get(next.saturating_sub(1)), self.knots.get(next));
        let (Some((from, before)), Some((to, after))) = (before, after) else {
            return before.or(after).map_or(self.state, |(_, state)| *state);
        };
        if to <= from {
            return *after;
        }
        let share = at.since(*from).as_secs_f64() / to.since(*from).as_secs_f64();
        before.between(after, share)
    }

    /// Fuses a scalar update. The residual of `row` already takes account of the corrections in `known`.
    fn fuse(
        &mut self,
        row: &ScalarUpdate,
        (waiting, number): (&Waiting, usize),
        settings: &Settings,
        source: &mut Source,
        (known, errors): (&Errors, &mut Errors),
    ) {
        let mut row =
            row.unless_sure(source.noise_level.is_usual(), |by| math::sqrt(self.factors.variance_along(by)));
        row.noise += self.left_out(row.bends);
        let (kind, declared) = (source.sensor.kind, row.noise);
        let is_head_square = kind == SensorKind::Head && row.is_square();
        let is_white = is_white(&waiting.reading, source, settings);
        if settings.learns && is_white {
            row.noise *= source.noise_level.factor(kind, number);
        }
        let innovation = row.residual - row.found(known, errors);
        let along = self.factors.along(&row.h);
        let of_estimate = row.h.iter().zip(&along).map(|(h, along)| h * along).sum::<f64>();
        if settings.learns && is_head_square {
            // The declared noise suits a rough wall. It stays in use if the residual is too large for a smooth wall.
            let smooth = row.noise * self.smoothness;
            if innovation * innovation <= SMOOTH * (of_estimate + smooth) {
                row.noise = smooth;
            }
        }
        let (white, bumps) = (row.noise, self.bumps(kind, settings));
        row.noise = white + bumps;
        let variance = of_estimate + row.noise;
        let nis = innovation * innovation / variance;
        let is_near = nis <= settings.gate;
        source.consistency.count(nis, settings.gate, variance, settings.usual_variance(kind));
        let part = |from: usize| [0, 1, 2].map(|k| along.get(from + k).copied().unwrap_or(0.0));
        if is_head_square && !self.is_blind {
            source.noise_level.note_share((innovation * innovation - of_estimate) / declared, is_near);
        }
        let relative = source.noise_level.relative(nis.min(settings.gate));
        // Ranges of heads are excluded, because rocks change them in the same way as a drifting gyro bias does.
        if kind != SensorKind::Head {
            self.unrest.note([part(RATE_BIAS), part(FORCE_BIAS)], variance, relative);
        }
        let believes = self.believes_counter(waiting, source, [innovation, variance], settings, errors);
        if believes.is_none() {
            self.agreement.note(kind, &row, is_near);
        }
        let agrees = believes.unwrap_or(is_near);
        if !agrees || self.is_blind || !is_white {
            source.noise_level.skip(number);
        } else {
            source.noise_level.note(kind, number, innovation, of_estimate + white);
        }
        if agrees {
            let weighed = Weighed { innovation, of_estimate, declared, white, bumps };
            row.noise = self.noise_of_correction(&row, waiting, &weighed, source, settings);
            self.correct_by(kind, &row, settings, known, errors);
        }
    }

    /// Returns the noise variance with which an accepted update corrects the estimate.
    fn noise_of_correction(
        &mut self,
        row: &ScalarUpdate,
        waiting: &Waiting,
        weighed: &Weighed,
        source: &Source,
        settings: &Settings,
    ) -> f64 {
        let Weighed { declared, white, .. } = *weighed;
        if source.sensor.kind == SensorKind::VelocityLog {
            declared * VELOCITY_LOOKS
        } else if matches!(source.sensor.kind, SensorKind::Echosounder { .. }) {
            self.spread_over_looks(row, waiting, weighed, settings)
        } else if let Reading::Sonar(SonarReturn { range_m: Some(range_m), .. }) = waiting.reading
            && settings.learns
        {
            let again_m2 = self.seen_again.noise_m2(range_m, white, source.noise_level.share(), settings);
            if self.is_at_rest { again_m2 } else { white }
        } else {
            row.noise
        }
    }

    /// Corrects the estimate by an update from a sensor of this kind.
    fn correct_by(
        &mut self,
        kind: SensorKind,
        row: &ScalarUpdate,
        settings: &Settings,
        known: &Errors,
        errors: &mut Errors,
    ) {
        match kind {
            SensorKind::Head | SensorKind::Echosounder { .. } => {
                self.correct_by_wall(row, settings.wall_share, known, errors);
            }
            SensorKind::Tether { .. } => self.correct_by_counter(row, known, errors),
            _ => self.correct(row, known, errors),
        }
    }

    /// Returns the variance, m^2, that bumps of the wall add to a range if many pings see the same bump.
    ///
    /// The result is 0 for other measurements.
    fn bumps(&self, kind: SensorKind, settings: &Settings) -> f64 {
        let sees_one = settings.learns && matches!(kind, SensorKind::Echosounder { .. });
        if sees_one { self.roughness.variance_m2(settings) } else { 0.0 }
    }

    /// Returns the noise variance of a ping, m^2, if many pings see the same bump.
    ///
    /// Also records the ping for learning the roughness of the wall.
    fn spread_over_looks(
        &mut self,
        row: &ScalarUpdate,
        waiting: &Waiting,
        weighed: &Weighed,
        settings: &Settings,
    ) -> f64 {
        let Weighed { innovation, of_estimate, white, bumps, .. } = *weighed;
        let speed_mps = self.state.velocity_mps.norm();
        let looks = self.roughness.looks_at_a_bump(waiting.source, waiting.at, speed_mps, settings.bump_m);
        let noise_m2 = white + bumps * looks;
        let mut of_scale = [0.0; ERRORS];
        if let (Some(slot), Some(by)) = (of_scale.get_mut(RANGES), row.h.get(RANGES)) {
            *slot = 2.0 * by;
        }
        let look = Look {
            source: waiting.source,
            at: waiting.at,
            by_place: state::vec(&row.h, POSITION),
            left_m: innovation * noise_m2 / (of_estimate + noise_m2),
            white_m2: white,
        };
        self.roughness.note(look, 1.0 / looks, self.factors.variance_along(&of_scale), settings);
        noise_m2
    }

    /// Returns the variance of the second-order terms that a linearised update neglects.
    ///
    /// They matter only while position or attitude is very uncertain. For a normal error e, the mean square of f'' e^2
    /// / 2 is 3/4 (f'' sd^2)^2.
    fn left_out(&self, [by_place, by_turn, by_both]: [f64; 3]) -> f64 {
        let sum = |axes: Range<usize>| axes.map(|i| self.factors.variance(i)).sum::<f64>();
        let (place, turn) = (sum(POSITION + 1..POSITION + 3), sum(ATTITUDE..ATTITUDE + 3));
        let bent = by_place * place + by_turn * turn + 2.0 * by_both * math::sqrt(place * turn);
        0.75 * bent * bent
    }

    /// Increases the noise of a measurement by the error of its linear prediction at +-1 sd of the estimate
    /// (sigma-point check).
    ///
    /// `None` if the measurement cannot be predicted at these two points.
    fn straight(
        &self,
        mut row: ScalarUpdate,
        then: &State,
        again: impl Fn(&State) -> Option<ScalarUpdate>,
    ) -> Option<ScalarUpdate> {
        let variance = self.factors.variance_along(&row.h);
        if row.lean.is_none() || variance < row.noise.min(NEAR_M * NEAR_M) {
            return Some(row);
        }
        let sd_m = math::sqrt(variance);
        let step = self.factors.along(&row.h).map(|covariance| covariance / sd_m);
        let mut bent_m = 0.0_f64;
        for side in [1.0, -1.0] {
            let mut moved = *then;
            moved.correct(&step.map(|step| side * step));
            let straight_m = row.residual - side * sd_m;
            bent_m = bent_m.max((again(&moved)?.residual - straight_m).abs());
        }
        row.noise += bent_m * bent_m;
        Some(row)
    }

    /// Moves an estimate beyond the wall back into the tunnel, because ranges cannot be predicted from beyond the wall.
    fn stay_inside(&mut self, profile: &Profile) {
        let place = [self.state.position.y(), self.state.position.z()];
        if profile.contains(place) {
            return;
        }
        let reference = profile.reference();
        let reach_m = profile.farthest_m(reference);
        let mut variances = [0.0; ERRORS];
        put(&mut variances, POSITION, Vec3::<Tunnel>::new(0.0, BEYOND_M * BEYOND_M, BEYOND_M * BEYOND_M));
        self.widen(&variances);
        let mut errors = [0.0; ERRORS];
        for (axis, (is, middle)) in (1..3).zip(place.into_iter().zip(reference)) {
            self.correct(
                &ScalarUpdate::of(POSITION + axis, middle - is, reach_m * reach_m),
                &[0.0; ERRORS],
                &mut errors,
            );
        }
        self.state.correct(&errors);
    }

    /// Returns the standard deviations of the estimate's position and attitude.
    pub fn pose_sd(&self) -> PoseSd {
        let along_m = math::sqrt(self.along_sd_m() * self.along_sd_m() + self.slipped_m2);
        PoseSd { along_m, ..PoseSd::of(&self.factors) }
    }

    /// Returns the standard deviation of the chainage error that later samples share, m.
    ///
    /// This error excludes length that the counter may have lost permanently.
    pub fn along_sd_m(&self) -> f64 {
        math::hypot(PoseSd::of(&self.factors).along_m, self.cable.differs_m())
    }

    /// Fuses zero speed with the sd `SPEED_SD_MPS`. Without it, an unaided accelerometer would integrate gravity
    /// without limit.
    fn bound_speed(&mut self) {
        let mut errors = [0.0; ERRORS];
        for (axis, row) in measure::rest(&self.state, SPEED_SD_MPS).iter().enumerate() {
            if self.factors.variance(VELOCITY + axis) > SPEED_SD_MPS * SPEED_SD_MPS {
                self.correct(row, &[0.0; ERRORS], &mut errors);
            }
        }
        self.state.correct(&errors);
    }

    fn correct(&mut self, row: &ScalarUpdate, known: &Errors, errors: &mut Errors) {
        let gain = self.factors.measure(&row.h, row.noise);
        self.apply(row, &gain, known, errors);
    }

    /// Corrects by a range to the wall. Attitude and related errors get only a share of the computed correction.
    ///
    /// The covariance has Joseph's form with the smaller gain. It equals the optimal covariance plus a dyad of the
    /// omitted gain.
    ///
    /// Source: Brink, Partial-Update Schmidt-Kalman Filter, 2017.
    fn correct_by_wall(&mut self, row: &ScalarUpdate, share: f64, known: &Errors, errors: &mut Errors) {
        debug_assert!((0.0..=1.0).contains(&share), "the applied part of a correction is a share: {share}");
        let mut gain = self.factors.measure(&row.h, row.noise);
        let mut left_out = [0.0; ERRORS];
        for i in (ATTITUDE..ATTITUDE + 3).chain(RATE_BIAS..RATE_BIAS + 3).chain([HEADING]) {
            if let (Some(k), Some(left)) = (gain.k.get_mut(i), left_out.get_mut(i)) {
                *left = (1.0 - share) * *k;
                *k *= share;
            }
        }
        self.factors.add(gain.variance, left_out, HEADING + 1);
        self.apply(row, &gain, known, errors);
    }

    fn apply(&mut self, row: &ScalarUpdate, gain: &Gain<ERRORS>, known: &Errors, errors: &mut Errors) {
        let innovation = row.residual - row.found(known, errors);
        self.clones.measure(&row.h, gain);
        for (error, k) in errors.iter_mut().zip(&gain.k) {
            *error += k * innovation;
        }
    }

    /// Decides whether to fuse a cable reading, given its innovation, m, and the innovation's variance, m^2.
    ///
    /// `None` for readings of other sensors.
    fn believes_counter(
        &mut self,
        waiting: &Waiting,
        source: &Source,
        [off_m, variance_m2]: [f64; 2],
        settings: &Settings,
        errors: &mut Errors,
    ) -> Option<bool> {
        let (SensorKind::Tether { zero_at_m, scale }, Reading::TetherLength(length)) =
            (source.sensor.kind, waiting.reading)
        else {
            return None;
        };
        let (at, shown_m) = (waiting.at, zero_at_m + scale * length.length_m);
        let step_m = source.count_step.step_m(length.resolution_m) * scale.abs();
        let known = self.factors.variance(RATE_BIAS).max(self.factors.variance(RATE_BIAS + 1));
        let [restless, _] = self.unrest.factors();
        let noises = Noises::of(
            settings.tether_sd_m * settings.tether_sd_m + step_m * step_m / 12.0,
            known,
            restless * settings.rate_bias.density(),
        );
        let is_usual = self.slack_level.hear(at, shown_m, noises, settings);
        let is_lively = self.slack_level.is_lively(step_m, noises, settings);
        let agrees = off_m * off_m <= settings.gate * variance_m2;
        let sd_m = math::sqrt(variance_m2);
        Some(self.trusts(&CableReading { at, shown_m, off_m, sd_m, agrees, is_usual, is_lively }, errors))
    }

    /// Corrects the estimate by a cable reading, and records how much the estimate changes.
    fn correct_by_counter(&mut self, row: &ScalarUpdate, known: &Errors, errors: &mut Errors) {
        let along = |eskf: &Self, errors: &Errors| {
            [POSITION, VELOCITY].map(|i| [errors.get(i).copied().unwrap_or(0.0), eskf.factors.variance(i)])
        };
        let [before_p, before_v] = along(self, errors);
        self.correct(row, known, errors);
        let [after_p, after_v] = along(self, errors);
        let by = [after_p[0] - before_p[0], after_v[0] - before_v[0]];
        self.cable.corrections.note(by, [before_p[1] - after_p[1], before_v[1] - after_v[1]]);
    }

    /// Decides whether to fuse a cable reading. A length that the counter has lost is added to the creep.
    fn trusts(&mut self, reading: &CableReading, errors: &mut Errors) -> bool {
        let used = self.cable.take(reading);
        self.slipped_m2 += self.cable.corrections.take_slipped_m2();
        match used {
            Use::Fuse => return true,
            Use::Withhold => {}
            Use::Dispute(corrections) => {
                for (i, by) in [POSITION, VELOCITY].into_iter().zip(corrections) {
                    add_to(errors, i, -by);
                    add_to(&mut self.doubts, i, by * by);
                }
                self.ties += 1;
            }
            Use::Slipped(lost_m) => {
                self.slack_level.skip();
                // The estimated position does not change, so that later soundings fit those placed during the cable
                // disagreement.
                add_to(errors, CREEP, lost_m);
                add_to(&mut self.doubts, CREEP, lost_m * lost_m);
                // Either the counter has lost `lost_m`, or the estimated motion was wrong during the cable
                // disagreement.
                self.slipped_m2 += (lost_m * lost_m).max(reading.sd_m * reading.sd_m);
                self.ties += 1;
            }
            Use::Seek(missing_m) => {
                self.way_sought = Some(reading.at);
                self.slack_level.skip();
                self.slipped_m2 += missing_m * missing_m;
                add_to(&mut self.doubts, CREEP, missing_m * missing_m);
                agreement::seek_way(&mut self.doubts);
                self.ties += 1;
            }
        }
        false
    }
}

/// Whether the noise of a reading is independent of that of other readings.
///
/// Several readings of a counter share one rounding error. If the rounding is not negligible, no noise is learnt from
/// the innovation.
fn is_white(reading: &Reading, source: &Source, settings: &Settings) -> bool {
    !matches!(reading, Reading::TetherLength(length)
        if source.count_step.step_m(length.resolution_m) > FINE_SHARE * settings.tether_sd_m)
}
