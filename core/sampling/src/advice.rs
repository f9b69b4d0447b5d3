//! Speed advice from the current measurements, and alternative modes of the heads.

mod answer;
mod hysteresis;
mod intervals;
mod returning;
mod ring_cache;
mod search;

use super::error::SamplingError;
use super::head::{HeadMode, HeadMotion, HeadSet, HeadSpec, MAX_HEADS};
use super::layout::{self, HeadLayout};
use super::losses::LossRate;
use super::margin::{self, APART_SHARE, Margins, RemainingTarget};
use super::occlusion::{self, AngleRange, Obstacle};
use super::passes::{self, Passes, Phasing, Situation};
use super::ring::Ring;
use super::spacing;
use super::strips::{Going, PARTS, Strips, View};
use super::swing::{self, Swing};
use super::swung_passes::{self, Place};
use super::target::Target;
use headrace_geometry::frames::{Point3, Pose, Rot};
use headrace_geometry::math;
use headrace_geometry::snapshot::stateful;
use headrace_geometry::tunnel::Profile;
use intervals::Driving;
use ring_cache::AdvisedHead;

pub use answer::{Advice, Alternative, Anew, Left, MAX_MODES, ModeName, Reason, Remedy};
pub use hysteresis::Hysteresis;
pub use returning::ReturningHeads;
pub use ring_cache::Looks;
pub use search::SPEED_MARGIN;

/// Number of advice updates after which the largest speeds in other modes are recomputed.
const ALTERNATIVES_EVERY: u32 = 25;
/// Number of iterations that solve for the speed and the position margin, which depend on each other.
const FALLS: u32 = 3;
/// Speed below which the direction of travel is unclear, m/s. The previous direction is then used.
const UNDER_WAY_MPS: f64 = 0.02;
/// Maximum number of stored stretches of wall outside a head's range limits.
const OUT_OF_REACH: usize = 16;

/// The largest speed that meets a target, as found by the search.
struct Fastest {
    /// The largest speed that meets the target, m/s.
    speed_mps: f64,
    /// Advised speed, which is lower by the margin for speed errors, m/s.
    advised_mps: f64,
    /// T_y (largest distance between neighbouring samples of a turn) at the place that limits the speed, m.
    t_y_m: f64,
}

/// The advised speed, and its place among the speeds that meet the target.
struct Chosen {
    /// Advised speed, m/s; `None` if no speed meets the target.
    advised_mps: Option<f64>,
    /// Lower end of the interval of suitable speeds whose upper end is the advised speed, m/s.
    from_mps: f64,
    /// Speed that meets the target and is nearest to the present speed, m/s.
    nearest_mps: Option<f64>,
    /// Whether the advised speed meets the target only if passes from several swings of the vehicle are taken together.
    by_several_swings: bool,
}

/// The inspection task that the advice is for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Task {
    /// Coverage target, with the confidence of verdicts.
    pub target: Target,
    /// Length of the tunnel, m.
    pub length_m: f64,
    /// Layout of the heads.
    pub layout: HeadLayout,
    /// Speed of sound in the tunnel's water, m/s.
    pub sound_speed_mps: f64,
    /// Number of rays with which the advice finds the wall, and the vehicle's movement after which the rays are cast
    /// again.
    pub looks: Looks,
}

/// Computes speed advice. Caches the rays from the heads to the wall until the vehicle moves.
#[derive(Debug, Clone)]
pub struct Advisor {
    profile: Profile,
    task: Task,
    heads: Vec<AdvisedHead>,
    views: Vec<View>,
    /// Strips of the wall: `now` with the heads in their present settings, `modes` with the heads in each of their
    /// modes.
    now: Strips,
    modes: Strips,
    /// Largest distance between neighbouring samples of a turn, in each mode, for a vehicle at the tunnel's centre, m.
    centred_m: Vec<f64>,
    parallax_rad: f64,
    /// Number of rays of the ring per angular step, for each head that turns.
    strides: [Option<usize>; MAX_HEADS],
    /// The head whose ring of rays is checked first at the next update.
    next: usize,
    /// Number of advice updates until the alternative modes are recomputed. `alternatives` holds the latest result.
    until_alternatives: u32,
    alternatives: [Option<Alternative>; MAX_MODES],
    anew: Option<Anew>,
    margins: Option<Margins>,
    astern: bool,
    /// Largest speed that met the target in the previous update.
    last_mps: Option<f64>,
    /// Distance that the vehicle may move before the heads' rays are cast again, m.
    still_m: f64,
    /// Speed at which passes from several swings of the vehicle together meet the target, m/s; zero if there is none.
    swung_mps: f64,
}

stateful!(Advisor { state: now, parallax_rad, next, until_alternatives, alternatives, anew, margins, astern, last_mps, still_m, swung_mps; slots: strides; each: heads, views; fixed: profile, task, modes, centred_m; });

impl Advisor {
    /// Creates an advisor for heads with their modes, and for parts of the hull that may occlude the heads.
    ///
    /// Allocates: startup only.
    pub fn new(
        profile: &Profile,
        task: Task,
        heads: &[(HeadSpec, Vec<HeadMode>)],
        hull: &[Obstacle],
    ) -> Self {
        let specs: Vec<HeadSpec> = heads.iter().map(|(spec, _)| *spec).collect();
        let hidden = occlusion::hidden_by_vehicle(&specs, hull);
        let programs = layout::programs(&specs, task.layout, 0.0).unwrap_or_default();
        let sector = |head: usize| {
            let (from_rad, size_rad) = programs.get(head)?.sector?;
            Some(AngleRange { from_rad, size_rad })
        };
        let advised =
            heads.iter().zip(hidden).enumerate().map(|(number, ((spec, modes), hidden))| AdvisedHead {
                spec: *spec,
                modes: modes.iter().copied().take(MAX_MODES).collect(),
                hidden,
                sector: sector(number),
                ring: Ring::default(),
                cast_at: None,
            });
        let heads: Vec<AdvisedHead> = advised.collect();
        let room = |head: &AdvisedHead| head.hidden.len() + OUT_OF_REACH;
        let view = |head: &AdvisedHead| View { sector: None, hidden: Vec::with_capacity(room(head)) };
        let arcs = heads.iter().map(|head| room(head) + PARTS).sum();
        let mut advisor = Self {
            profile: profile.clone(),
            task,
            views: heads.iter().map(view).collect(),
            heads,
            now: Strips::with_room(arcs, 1, task.looks.ring),
            modes: Strips::with_room(arcs, MAX_MODES, task.looks.ring),
            centred_m: Vec::new(),
            parallax_rad: 0.0,
            strides: [None; MAX_HEADS],
            next: 0,
            until_alternatives: 0,
            alternatives: [None; MAX_MODES],
            anew: None,
            margins: None,
            astern: false,
            last_mps: None,
            still_m: 0.0,
            swung_mps: 0.0,
        };
        advisor.look_from_the_middle();
        advisor
    }

    /// Casts the rings of rays once from the tunnel's centre, so that later casts don't allocate. Marks the rings as
    /// outdated.
    fn look_from_the_middle(&mut self) {
        let [y, z] = self.profile.reference();
        let centre = Pose { position: Point3::new(0.0, y, z), attitude: Rot::identity() };
        for (head, view) in self.heads.iter_mut().zip(&mut self.views) {
            if head.cast(&self.profile, &centre, self.task.looks.ring).is_ok() {
                head.look(&self.profile, &centre, self.task.sound_speed_mps, view);
            }
        }
        self.now.rebuild(self.profile.perimeter_m(), &self.views);
        self.measure_modes();
        self.centred_m = (0..MAX_MODES).map(|mode| self.modes.largest_step_m(mode)).collect();
        for head in &mut self.heads {
            head.cast_at = None;
        }
    }

    /// Whether the vehicle moved backwards when it last moved.
    pub fn is_astern(&self) -> bool {
        self.astern
    }

    /// Angles that the vehicle hides from each head, in that head's sensor frame.
    pub fn hidden_angles(&self) -> impl Iterator<Item = &[AngleRange]> {
        self.heads.iter().map(|head| head.hidden.as_slice())
    }

    /// Number of rays of the ring per angular step of a head.
    fn stride(&self, step_rad: f64) -> usize {
        Ring::stride(step_rad, self.task.looks.ring)
    }

    /// Returns the largest speed at which the predicted T_max stays within the target.
    ///
    /// The function inverts Eq. 16 of Jorge et al. 2021 with measured values: the turn period, step, number and phases
    /// of the heads, the wall hidden by the vehicle or outside the range limits, position, attitude and swing. The
    /// phases are propagated to each tested speed. `left_s` is the remaining time, if known.
    ///
    /// Heads that are apart along the hull keep their phases only in some intervals of speed. The result is the upper
    /// end of the highest interval, whatever the present speed; see [`Advice::from_mps`] and [`Advice::nearest_mps`].
    /// Source: docs/decisions/0005-advice-and-plan.md.
    /// Allocates: never.
    pub fn advise(&mut self, situation: &Situation, swing: Swing<'_>, left_s: Option<f64>) -> Advice {
        let Some(pose) = situation.pose else { return Advice::nothing(Reason::NoHeadingOrFix) };
        if situation.heads.iter().all(Option::is_none) {
            return Advice::nothing(Reason::NoReturns);
        }
        let is_turning = |motion: &HeadMotion| motion.is_turning();
        debug_assert!(situation.heads.iter().flatten().all(is_turning), "heads turn: {:?}", situation.heads);
        if !self.look(situation, &pose) {
            return Advice::nothing(Reason::NoHeadingOrFix);
        }
        if situation.speed_mps.abs() > UNDER_WAY_MPS {
            self.astern = situation.speed_mps < 0.0;
        }
        let advice = self.advise_at(&pose, situation, swing, left_s);
        debug_assert!(advice.is_consistent(), "the figures of an advice agree: {advice:?}");
        advice
    }

    /// Returns the advice for a vehicle at `pose`, from which the heads' rings of rays have been cast.
    fn advise_at(
        &mut self,
        pose: &Pose,
        situation: &Situation,
        swing: Swing<'_>,
        left_s: Option<f64>,
    ) -> Advice {
        let sector = |head: usize| self.heads.get(head)?.sector.as_ref();
        let phasing = Phasing::of(situation).in_sectors_of(situation, sector);
        let passes = phasing.at(situation.speed_mps).beside(self.parallax_rad);
        let going = self.going(pose, situation, &phasing, swing);
        let sure = self.sure(&phasing, &passes, situation);
        let sure_m = sure.at_m(situation.speed_mps);
        let lossy = passes.lossy(true);
        self.now.count_losses(0, sure_m, &rates_of(situation));
        let fastest = self.fastest(&phasing, &lossy, &going, sure, self.last_mps);
        let possible = fastest.as_ref().ok().filter(|fastest| fastest.speed_mps > 0.0);
        let depends_on_swing = matches!(&fastest, Ok(_) | Err(SamplingError::OffAxis { .. }));
        if self.until_alternatives == 0 || !depends_on_swing {
            let swung_mps = depends_on_swing.then(|| self.swung_mps(&phasing, &going, swing, sure, pose));
            self.swung_mps = swung_mps.unwrap_or(0.0);
        }
        let driving = self.driving(&phasing, &lossy, &going, sure);
        let chosen = self.choose(possible, &driving, situation.speed_mps.abs());
        self.last_mps = possible.map(|fastest| fastest.speed_mps);
        self.still_m = self.still_m_for(&fastest, &going);
        let mut predicted_t_m = self.now.t_max_m(0, &passes, situation.speed_mps.abs(), &going);
        if chosen.by_several_swings {
            // Passes of later swings fill the gaps of this turn until the target is met. At a higher speed, the
            // remaining gaps are larger in proportion.
            let over = (situation.speed_mps.abs() / self.swung_mps).max(1.0);
            predicted_t_m = predicted_t_m.min(sure_m * over);
        }
        self.think_over(&phasing, &lossy, &going, situation, sure);
        let unseen_m = unseen_m(&fastest);
        let helps = chosen.advised_mps.is_some();
        let needs_remedy = !helps || chosen.by_several_swings;
        Advice {
            v_max_mps: chosen.advised_mps.unwrap_or(0.0),
            from_mps: chosen.from_mps,
            nearest_mps: chosen.nearest_mps,
            reason: if helps { Reason::HelixPitch } else { Reason::AngularStep },
            predicted_t_m: predicted_t_m.is_finite().then_some(predicted_t_m),
            will_exceed: predicted_t_m > self.task.target.max_hole_m,
            may_exceed: predicted_t_m > sure_m,
            sure_m,
            pass_gap_s: passes.gap_s(passes.heads()).unwrap_or(0.0),
            even_pass_gap_s: passes.even_gap_s(),
            t_y_m: self.now.largest_step_m(0),
            ping_period_s: going.ping_period_s,
            phase_error_rad: largest_phase_error_rad(&passes, self.heads.len()),
            left: Left { length_m: self.left_m(pose.position.x()), time_s: left_s },
            unseen_m,
            remedy: if needs_remedy { self.remedy(situation, &passes, &going, unseen_m) } else { None },
            alternatives: self.alternatives,
            anew: self.anew,
            margins: self.margins,
            lost_share: mean(situation.losses_of_turning().map(|rate| rate.share)),
            rising_mps: None,
        }
    }

    /// Returns the length of tunnel, m, that remains in the direction of travel.
    fn left_m(&self, x_m: f64) -> f64 {
        let left_m = if self.astern { x_m } else { self.task.length_m - x_m };
        left_m.clamp(0.0, self.task.length_m)
    }

    /// Chooses between two speeds: the largest speed at which successive passes meet the target, and the speed at which
    /// passes of several swings together meet the target.
    fn choose(&self, fastest: Option<&Fastest>, driving: &Driving<'_>, now_mps: f64) -> Chosen {
        let Some(fastest) = fastest.filter(|fastest| fastest.advised_mps >= self.swung_mps) else {
            let advised_mps = Some(self.swung_mps).filter(|mps| *mps > 0.0);
            let by_several_swings = advised_mps.is_some();
            return Chosen { advised_mps, from_mps: 0.0, nearest_mps: None, by_several_swings };
        };
        let is_under_way = now_mps > UNDER_WAY_MPS;
        Chosen {
            advised_mps: Some(fastest.advised_mps),
            from_mps: driving.lower_end_mps(fastest.advised_mps),
            nearest_mps: if is_under_way { driving.nearest_mps(now_mps) } else { None },
            by_several_swings: false,
        }
    }

    /// Returns the advised speed at which passes of several swings together meet the target, m/s.
    ///
    /// Zero if there is no such speed, or if the swing is so small that successive passes allow a higher speed.
    fn swung_mps(
        &self,
        phasing: &Phasing,
        going: &Going,
        swing: Swing<'_>,
        sure: RemainingTarget,
        pose: &Pose,
    ) -> f64 {
        const PLACES: u32 = 8;
        /// The passes of several swings are simulated only if the beams swing by at least this share of the target.
        const LEAST_SHARE: f64 = 0.5;
        /// Shortest history that shows how the vehicle swings, seconds.
        const LEAST_S: f64 = 30.0;
        let is_small = |most_m: f64| most_m < LEAST_SHARE * sure.most_m();
        if sure.most_m() <= 0.0 || going.swing_most_m.is_none_or(is_small) {
            return 0.0;
        }
        let recent = swing.history.map(swing::Looks::uninterrupted);
        let Some(recent) = recent.filter(|recent| recent.span_s() >= LEAST_S) else { return 0.0 };
        let perimeter_m = self.profile.perimeter_m();
        let mut places = [Place::default(); PLACES as usize];
        for (slot, number) in places.iter_mut().zip(0..PLACES) {
            let arc_m = perimeter_m * f64::from(number) / f64::from(PLACES);
            let [y_m, z_m] = self.profile.point_at(arc_m);
            let seen_by = self.now.at(arc_m).map(|strip| strip.seen_by).unwrap_or_default();
            *slot = Place { from_vehicle_m: [y_m - pose.position.y(), z_m - pose.position.z()], seen_by };
        }
        let (t_y_m, needed) = (self.now.largest_step_m(0), self.now.most_needed(0));
        let meets = |gap_m: f64, speed_mps: f64| {
            let advance_m = (speed_mps + going.swing_mps) * going.ping_period_s;
            spacing::t_max_m(gap_m * needed, advance_m, t_y_m) <= sure.at_m(speed_mps)
        };
        let bound_mps = sure.most_m() / (sure.even_gap_s + going.ping_period_s);
        let speed_mps =
            swung_passes::highest_mps(bound_mps, (&recent, phasing), &places, sure.most_m(), meets);
        speed_mps * (1.0 - SPEED_MARGIN)
    }

    /// Returns the motion of the vehicle and its beams, from which the spacing is predicted.
    fn going(&self, pose: &Pose, situation: &Situation, phasing: &Phasing, swing: Swing<'_>) -> Going {
        let periods_s = situation.heads.iter().flatten().map(HeadMotion::ping_period_s);
        let farthest_m = self.profile.farthest_m([pose.position.y(), pose.position.z()]);
        Going {
            ping_period_s: periods_s.fold(0.0, f64::max),
            swing_mps: swing.rate_radps * farthest_m,
            shift_m: 0.0,
            apart_m: phasing.apart_m(),
            apart_swing_mps: phasing.neighbours_apart() * swing.apart_rate_radps * farthest_m,
            swing_most_m: Some(swing.most_rad * farthest_m),
        }
    }

    /// Updates the heads' rings of rays for the vehicle's pose; returns `false` if no turning head has a ring.
    ///
    /// A head's ring of rays is outdated once the vehicle has moved. If several rings are outdated, each call recasts
    /// only one, because the vehicle moves little between calls.
    fn look(&mut self, situation: &Situation, pose: &Pose) -> bool {
        let count = self.heads.len().max(1);
        let present = |number: usize| situation.heads.get(number).is_some_and(Option::is_some);
        let first = self.next;
        let mut may_cast = true;
        let mut cast = false;
        for number in (first..first + count).map(|number| number % count).filter(|number| present(*number)) {
            let (Some(head), Some(view)) = (self.heads.get_mut(number), self.views.get_mut(number)) else {
                continue;
            };
            if head.cast_at.is_none() || may_cast && !head.is_near(pose, self.still_m) {
                may_cast &= head.cast_at.is_none();
                if head.cast(&self.profile, pose, self.task.looks.ring).is_ok() {
                    head.look(&self.profile, pose, self.task.sound_speed_mps, view);
                }
                self.next = (number + 1) % count;
                cast = true;
            }
        }
        let stride = |motion: Option<HeadMotion>| Some(self.stride(motion?.step_rad));
        let strides = situation.heads.map(stride);
        if cast || strides != self.strides {
            self.strides = strides;
            self.measure_now(pose);
        }
        self.heads.iter().enumerate().any(|(number, head)| present(number) && head.cast_at.is_some())
    }

    fn measure_now(&mut self, pose: &Pose) {
        let mut places = [[0.0; 2]; MAX_HEADS];
        let mut known = 0;
        for (head, slot) in self.heads.iter().filter(|head| head.cast_at.is_some()).zip(&mut places) {
            let place = pose.place(head.spec.mount.position);
            *slot = [place.y(), place.z()];
            known += 1;
        }
        self.parallax_rad = passes::parallax_rad(&self.profile, places.get(..known).unwrap_or_default());
        self.now.rebuild(self.profile.perimeter_m(), &self.views);
        // The distances between samples are kept with the ring, because most rings are unchanged since the previous
        // advice.
        for (head, stride) in self.heads.iter_mut().zip(self.strides) {
            if let Some(stride) = stride {
                head.ring.keep_steps(stride);
            }
        }
        let rings = self.heads.iter().map(|head| &head.ring);
        self.now.measure(1, rings, |_, head| self.strides.get(head).copied().flatten());
    }

    /// Returns the inputs for deciding whether a speed meets a target with the present phases of the heads.
    fn driving<'a>(
        &'a self,
        phasing: &'a Phasing,
        passes: &Passes,
        going: &'a Going,
        sure: RemainingTarget,
    ) -> Driving<'a> {
        Driving {
            strips: &self.now,
            phasing,
            going,
            parallax_rad: self.parallax_rad,
            lossy: passes.is_lossy(),
            astern: self.astern,
            sure,
            most_m: sure.most_m(),
            apart_m: phasing.apart_m(),
            bound_mps: sure.most_m() / (passes.even_gap_s() + going.ping_period_s),
        }
    }

    /// Returns the largest speed at which the heads' present phases meet a target, and the advised speed.
    ///
    /// Errors: no speed meets the target, whatever the heads' phases.
    fn fastest(
        &self,
        phasing: &Phasing,
        passes: &Passes,
        going: &Going,
        sure: RemainingTarget,
        last_mps: Option<f64>,
    ) -> Result<Fastest, SamplingError> {
        let bound = self.now.bound_for_target(0, passes, sure.most_m(), going);
        let driving = self.driving(phasing, passes, going, sure);
        let t_y_m = match &bound {
            Ok(bound) => bound.t_y_m,
            // This error may not apply at another speed, where the heads have other phases and less swing between their
            // passes.
            Err(SamplingError::OffAxis { .. }) => self.now.largest_step_m(0),
            Err(why) => return Err(*why),
        };
        let speed_mps = driving.fastest_mps(last_mps);
        debug_assert!(speed_mps >= 0.0 && speed_mps.is_finite(), "a speed is zero or more: {speed_mps} m/s");
        if speed_mps <= 0.0 {
            bound?;
        }
        Ok(Fastest { speed_mps, advised_mps: driving.kept_back_mps(speed_mps), t_y_m })
    }

    /// Returns the distance that the vehicle may move before the heads' rays are cast again, m.
    fn still_m_for(&self, fastest: &Result<Fastest, SamplingError>, going: &Going) -> f64 {
        if let Some(anew_m) = self.task.looks.anew_m {
            return anew_m;
        }
        let (t_y_m, swing_share) = match fastest {
            Ok(fastest) => (fastest.t_y_m, going.swing_mps / fastest.speed_mps.max(UNDER_WAY_MPS)),
            // If the vehicle swings too much at any speed, a slightly different position does not help.
            Err(SamplingError::OffAxis { .. }) => (self.now.largest_step_m(0), 0.0),
            // The distance between samples that limits the speed is unknown, so the target stands in for it.
            Err(_) => (self.task.target.max_hole_m, 0.0),
        };
        ring_cache::still_m(
            self.task.target.max_hole_m,
            t_y_m,
            self.profile.perimeter_m() / math::TAU,
            swing_share,
        )
    }

    /// Computes the largest speed in each mode common to all heads, and the cost of each margin.
    ///
    /// The computation assumes that the turning heads are restarted in phase.
    fn think_over(
        &mut self,
        phasing: &Phasing,
        passes: &Passes,
        going: &Going,
        situation: &Situation,
        sure: RemainingTarget,
    ) {
        if let Some(left) = self.until_alternatives.checked_sub(1) {
            self.until_alternatives = left;
            return;
        }
        self.until_alternatives = ALTERNATIVES_EVERY - 1;
        self.measure_modes();
        let rates = rates_of(situation);
        for mode in 0..MAX_MODES {
            self.modes.count_losses(mode, self.sure_in(mode, sure).at_m(situation.speed_mps), &rates);
        }
        let names = self.heads.first().map(|head| head.modes.as_slice()).unwrap_or_default();
        let mut alternatives = [None; MAX_MODES];
        let mut anew = None;
        for (number, (slot, mode)) in alternatives.iter_mut().zip(names).enumerate() {
            let Some(v_mps) = self.mode_speed_mps(number, passes.heads(), going, sure) else {
                continue;
            };
            let v_max_mps = v_mps * (1.0 - SPEED_MARGIN);
            *slot = Some(Alternative { mode: ModeName::new(mode.name), v_max_mps });
            // A restart in the present mode changes only the phases of the heads.
            if v_max_mps > 0.0 && phasing.fits_some_speeds() && self.is_now(mode, passes) {
                anew = Some(Anew { planned_speed_mps: v_max_mps });
            }
        }
        (self.alternatives, self.anew) = (alternatives, anew);
        self.margins = Some(self.margins(phasing, passes, going, sure));
    }

    /// Whether the heads presently turn in this mode.
    fn is_now(&self, mode: &HeadMode, passes: &Passes) -> bool {
        const SAME: f64 = 0.02;
        let stride = self.strides.iter().flatten().next().copied();
        let period_s = mode.turn.period_s();
        Some(self.stride(mode.turn.step_rad())) == stride
            && (passes.turn_s() - period_s).abs() < SAME * period_s
    }

    /// Returns the largest speed without margins, then with one margin, with two margins, and so on.
    fn margins(&self, phasing: &Phasing, passes: &Passes, going: &Going, sure: RemainingTarget) -> Margins {
        /// Number of speeds, at the front of the list, that do not allow for swing.
        const BEFORE_SWING: usize = 3;
        let target_m = self.task.target.max_hole_m;
        let known = RemainingTarget { pass_error_m: 0.0, ..sure };
        let steady = Going { ping_period_s: going.ping_period_s, ..Going::default() };
        let (lossy, passes) = (passes, &passes.lossy(false));
        let even = passes.evened();
        let hidden = self.now.bound_for_target(0, &even, target_m, &steady);
        let fastest = |passes: &Passes, going: &Going, sure: RemainingTarget| {
            self.fastest(phasing, passes, going, sure, self.last_mps).map_or(0.0, |fastest| fastest.speed_mps)
        };
        let speeds = [
            self.now.bound_if_all_seen_mps(0, &even, target_m, &steady).unwrap_or(0.0),
            hidden.map_or(0.0, |bound| bound.speed_mps),
            fastest(passes, &steady, known),
            fastest(passes, going, known),
            fastest(passes, going, sure),
            fastest(lossy, going, sure),
        ];
        let mut advised = speeds.map(|speed_mps| speed_mps * (1.0 - SPEED_MARGIN));
        // The speeds that allow for swing may need the passes of several swings together, like the advised speed.
        for speed_mps in advised.iter_mut().skip(BEFORE_SWING) {
            *speed_mps = speed_mps.max(self.swung_mps);
        }
        Margins::of(advised, sure.pass_error_m)
    }

    fn measure_modes(&mut self) {
        let Self { heads, modes, views, profile, task, .. } = self;
        let ring = &task.looks.ring;
        modes.rebuild(profile.perimeter_m(), views);
        let name = |mode: usize| heads.first()?.modes.get(mode).map(|mode| mode.name);
        let rings = heads.iter().map(|head| &head.ring);
        modes.measure(MAX_MODES, rings, |mode, head| {
            let turn = heads.get(head)?.mode(name(mode)?)?.turn;
            Some(Ring::stride(turn.step_rad(), *ring))
        });
    }

    /// Largest speed in a mode, m/s.
    ///
    /// Zero if no speed meets the target; `None` if a head does not have the mode.
    fn mode_speed_mps(
        &self,
        number: usize,
        heads: HeadSet,
        going: &Going,
        sure: RemainingTarget,
    ) -> Option<f64> {
        let name = self.heads.first()?.modes.get(number)?.name;
        let turn = |head: usize| self.heads.get(head)?.mode(name).map(|mode| mode.turn);
        let (mut longest_s, mut ping_period_s) = (0.0_f64, 0.0_f64);
        for head in heads.iter() {
            longest_s = longest_s.max(turn(head)?.period_s());
            ping_period_s = ping_period_s.max(turn(head)?.ping_period_s());
        }
        let passes = match self.task.layout {
            // A head's sector keeps its size if other heads fail, so the configured number of heads counts.
            HeadLayout::SectorOffset => {
                Passes::in_sectors(heads, 2.0 * longest_s / self.heads.len().max(1) as f64)
            }
            HeadLayout::PhaseShift => {
                Passes::evenly_phased(heads, |head| turn(head).map_or(0.0, |turn| turn.period_s()))
            }
        };
        let passes = passes.ok()?.beside(self.parallax_rad);
        let going = Going { ping_period_s, ..*going };
        let passes = passes.lossy(true);
        let sure = RemainingTarget { even_gap_s: passes.even_gap_s(), ..self.sure_in(number, sure) };
        let bound_mps = |target_m: f64| {
            self.modes
                .bound_for_target(number, &passes, target_m, &going)
                .map_or(0.0, |bound| bound.speed_mps)
        };
        // Each iteration finds a lower speed with a larger position margin, so the speeds converge from above.
        Some((0..FALLS).fold(bound_mps(sure.most_m()), |speed_mps, _| bound_mps(sure.at_m(speed_mps))))
    }

    /// Returns the target minus the margin for position errors, for the present motion of the heads.
    fn sure(&self, phasing: &Phasing, passes: &Passes, situation: &Situation) -> RemainingTarget {
        let (even_gap_s, apart_m) = (passes.even_gap_s(), phasing.apart_m());
        RemainingTarget {
            target: self.task.target,
            pass_error_m: situation.pass_error_m,
            measured_s: margin::error_time_s(1.0 / even_gap_s, apart_m, situation.speed_mps, APART_SHARE),
            even_gap_s,
            apart_m,
            t_y_m: self.now.largest_step_m(0),
        }
    }

    /// Returns the target minus the margin for position errors, with the angular steps of another mode.
    fn sure_in(&self, mode: usize, sure: RemainingTarget) -> RemainingTarget {
        RemainingTarget { t_y_m: self.modes.largest_step_m(mode), ..sure }
    }

    /// Returns the first remedy that makes the target possible without further remedies.
    ///
    /// The remedies are tried in this order: a steady heading, then the tunnel's centre if samples of a turn are close
    /// enough there, then the fastest mode.
    fn remedy(
        &self,
        situation: &Situation,
        passes: &Passes,
        going: &Going,
        unseen_m: Option<[f64; 2]>,
    ) -> Option<Remedy> {
        let target_m = self.task.target.max_hole_m;
        let steady = Going { ping_period_s: going.ping_period_s, ..Going::default() };
        if going.swing_mps.max(going.apart_swing_mps) > 0.0
            && self.now.bound_for_target(0, passes, target_m, &steady).is_ok()
        {
            return Some(Remedy::HoldHeading);
        }
        let stride = situation.heads.iter().flatten().map(|motion| self.stride(motion.step_rad)).max();
        let same = |mode: &HeadMode| Some(self.stride(mode.turn.step_rad())) == stride;
        let modes = self.heads.first().map(|head| head.modes.as_slice()).unwrap_or_default();
        let centred_m = modes.iter().position(same).and_then(|mode| self.centred_m.get(mode));
        if unseen_m.is_none()
            && self.now.largest_step_m(0) >= target_m
            && centred_m.is_some_and(|centred_m| *centred_m < target_m)
        {
            return Some(Remedy::Centre);
        }
        let best = self.alternatives.iter().flatten().max_by(|a, b| a.v_max_mps.total_cmp(&b.v_max_mps));
        best.filter(|best| best.v_max_mps > 0.0).map(|best| Remedy::Mode(best.mode))
    }
}

/// Phase error of the head farthest out of phase, radians; `None` for a single head and for heads in sectors.
fn largest_phase_error_rad(passes: &Passes, heads: usize) -> Option<f64> {
    let errors = passes.phase_errors_rad(heads).into_iter().flatten();
    errors.max_by(|a, b| a.abs().total_cmp(&b.abs())).filter(|_| passes.heads().len() > 1)
}

/// Width of the strip that no head sees, and the arc length of its middle, m.
///
/// `None` unless this strip is the reason why no speed meets the target.
fn unseen_m(fastest: &Result<Fastest, SamplingError>) -> Option<[f64; 2]> {
    match fastest {
        Err(SamplingError::UnseenStrip { width_m, arc_m, .. }) => Some([*width_m, *arc_m]),
        _ => None,
    }
}

/// Rates at which each turning head loses returns by chance, by head number.
fn rates_of(situation: &Situation) -> [Option<LossRate>; MAX_HEADS] {
    let mut rates = [None; MAX_HEADS];
    for ((slot, motion), rate) in rates.iter_mut().zip(&situation.heads).zip(situation.losses) {
        *slot = motion.map(|_| rate);
    }
    rates
}

fn mean(shares: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = shares.fold((0.0, 0.0), |(sum, count), share| (sum + share, count + 1.0));
    if count > 0.0 { sum / count } else { 0.0 }
}

#[cfg(test)]
mod tests;
