//! Times at which a vehicle's heads pass a place on the wall, and the longest time between two successive passes.

mod sectors;

use super::error::SamplingError;
use super::head::{HeadMotion, HeadSet, MAX_HEADS, faces_aft};
use super::layout::HeadLayout;
use super::losses::LossRate;
use super::occlusion::AngleRange;
use headrace_geometry::frames::{Mount, Pose, Rot, Tunnel, Vec3};
use headrace_geometry::math::{self, TAU};
use headrace_geometry::tunnel::{Profile, Yz};
use sectors::{AT_ONCE, Leg};

/// Speed below which a vehicle counts as at rest, m/s.
///
/// At rest, phases are computed without the heads' offsets along the hull.
const AT_REST_MPS: f64 = 1e-3;
/// Relative difference of turn periods above which heads count as rotating at different rates.
const SAME_TURN: f64 = 0.02;
/// Limit for the cosine of the angle between a head's axis and the tunnel's axis.
///
/// If the cosine is below this limit, the head is askew: its scan plane meets no wall near the vehicle.
const ASKEW: f64 = 0.1;

/// Tolerance for rounding errors in shares of a turn or of a length.
const ROUNDING: f64 = 1e-9;

/// Measured state of a vehicle and its heads at one moment.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Situation {
    /// Pose of the vehicle; `None` without a fix.
    pub pose: Option<Pose>,
    /// Speed along the tunnel, m/s; negative on the way back.
    pub speed_mps: f64,
    /// Standard deviation of the distance between two passes over a place, m: the largest value for any place.
    pub pass_error_m: f64,
    /// Layout of the heads, from the vehicle file.
    pub layout: HeadLayout,
    /// Number of heads of the vehicle.
    pub configured: usize,
    /// Heads that turn, ping and get returns from the wall, by number.
    pub heads: [Option<HeadMotion>; MAX_HEADS],
    /// Heads that turn and ping, but get no returns from the wall.
    pub deaf: HeadSet,
    /// Rate at which each head loses returns by chance, by head number.
    pub losses: [LossRate; MAX_HEADS],
    /// Upper bound of the rate at which any head loses returns by chance.
    ///
    /// All missing returns count as losses until enough pings have been counted.
    pub lost_at_most: LossRate,
}

impl Situation {
    /// Returns the rates at which the turning heads lose returns by chance.
    pub fn losses_of_turning(&self) -> impl Iterator<Item = LossRate> {
        self.heads.iter().zip(self.losses).filter_map(|(motion, rate)| motion.is_some().then_some(rate))
    }
}

/// The times at which a vehicle's heads pass places on the wall, at one speed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Passes {
    heads: HeadSet,
    /// Heads whose phases are known, in [`Pattern::Turning`].
    in_step: HeadSet,
    /// Turn period of each head, seconds.
    turns_s: [f64; MAX_HEADS],
    pattern: Pattern,
    /// Heads in step with their phases and turn periods, s, in order of phase. Other entries are empty.
    by_phase: [(HeadSet, f64, f64); MAX_HEADS],
    /// Largest error of pass times, seconds. It arises because side-by-side heads see a place at different angles.
    parallax_s: f64,
    /// Whether the vehicle is so slow that phases along the tunnel have no meaning.
    at_rest: bool,
    /// Whether extra passes over each place are required for lost returns.
    lossy: bool,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Pattern {
    /// Two or more heads, or the only head, rotate continuously, in one sense and at one rate: they are in step.
    ///
    /// The value of each such head is the phase of its passes, as a share of the vehicle's advance per turn, in
    /// [0, 1). A head out of step, such as one that is on its way back to its program, adds only its own passes.
    Turning([f64; MAX_HEADS]),
    /// Each head sweeps a sector back and forth.
    Sectors {
        /// The longest period of a sweep there and back, seconds.
        sweep_s: f64,
        /// Unevenness of two heads' passes at the end that their sectors share, as in [`Passes::uneven_ends`].
        uneven: f64,
    },
    /// No two heads turn in one sense and at one rate.
    ///
    /// Passes come at uneven times, and only the passes of a single head are predictable.
    Loose,
}

/// Passes of a head's beam over the vertical: the first pass from now on, then one pass per turn.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HeadPasses {
    /// Number of the head.
    pub head: usize,
    /// Time of the first pass, seconds from now.
    pub first_s: f64,
    /// Turn period, seconds.
    pub turn_s: f64,
    /// Distance of the head's scan plane ahead of the vehicle's origin, m.
    pub ahead_m: f64,
}

/// Measured phasing of the heads, from which their passes at any speed follow.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Phasing {
    heads: HeadSet,
    in_step: HeadSet,
    turns_s: [f64; MAX_HEADS],
    pattern: Pattern,
    ahead_m: [f64; MAX_HEADS],
    /// Position of each head in the sweep through its sector; `None` for continuous rotation.
    legs: [Option<Leg>; MAX_HEADS],
}

impl Phasing {
    /// Creates the phasing from the measured situation.
    ///
    /// Without a fix, the vehicle is assumed to lie along the tunnel.
    pub fn of(situation: &Situation) -> Self {
        let motions = &situation.heads;
        let present = motions.iter().enumerate().filter(|(_, motion)| motion.is_some());
        let heads = present.fold(HeadSet::default(), |set, (head, _)| set.with(head));
        let attitude = situation.pose.map_or_else(Rot::identity, |pose| pose.attitude);
        let ahead =
            motions.map(|motion| motion.map_or(Some(0.0), |motion| ahead_m(&attitude, &motion.mount)));
        let (in_step, phases) = phases(motions);
        let pattern = match situation.layout {
            HeadLayout::SectorOffset => {
                let share_rad = TAU / situation.configured.max(1) as f64;
                let sweep_s = |motion: &HeadMotion| {
                    2.0 * motion.sector_rad.unwrap_or(share_rad) / motion.rate_radps.abs()
                };
                let sweep_s = motions.iter().flatten().map(sweep_s).fold(0.0, f64::max);
                Pattern::Sectors { sweep_s, uneven: AT_ONCE }
            }
            HeadLayout::PhaseShift if ahead.iter().any(Option::is_none) => Pattern::Loose,
            HeadLayout::PhaseShift if in_step.is_empty() && !heads.is_empty() => Pattern::Loose,
            HeadLayout::PhaseShift => Pattern::Turning(phases),
        };
        Self {
            heads,
            in_step: if situation.layout == HeadLayout::PhaseShift { in_step } else { heads },
            turns_s: motions.map(|motion| motion.map_or(0.0, |motion| motion.turn_period_s())),
            pattern,
            ahead_m: ahead.map(Option::unwrap_or_default),
            legs: [None; MAX_HEADS],
        }
    }

    /// Returns this phasing with the given sectors, by head number. A sector's angles are in the sensor frame of its
    /// head.
    #[must_use]
    pub fn in_sectors_of<'a>(
        self,
        situation: &Situation,
        sector: impl Fn(usize) -> Option<&'a AngleRange>,
    ) -> Self {
        let mut legs = [None; MAX_HEADS];
        for (head, (leg, motion)) in legs.iter_mut().zip(&situation.heads).enumerate() {
            *leg = motion.as_ref().zip(sector(head)).and_then(|(motion, sector)| Leg::of(motion, sector));
        }
        Self { legs, ..self }
    }

    /// Whether the heads interleave evenly only in some intervals of speed.
    ///
    /// True if the heads are apart along the hull and phased with each other.
    pub fn fits_some_speeds(&self) -> bool {
        let is_phased = match self.pattern {
            Pattern::Turning(_) => true,
            Pattern::Sectors { .. } => self.legs.iter().any(Option::is_some),
            Pattern::Loose => false,
        };
        is_phased && self.spread_m() > 0.0
    }

    /// Largest distance along the tunnel between the planes in which the heads meet the wall, m.
    ///
    /// The result is zero for heads that are not phased with each other.
    pub fn apart_m(&self) -> f64 {
        let Pattern::Turning(_) = self.pattern else { return 0.0 };
        self.spread_m()
    }

    /// Largest distance along the tunnel between the planes in which the heads meet the wall, m.
    ///
    /// Heads in sectors are also included.
    fn spread_m(&self) -> f64 {
        let ahead_m = || self.in_step.iter().filter_map(|head| self.ahead_m.get(head)).copied();
        (ahead_m().fold(f64::MIN, f64::max) - ahead_m().fold(f64::MAX, f64::min)).max(0.0)
    }

    /// Mean distance along the hull between heads that successively pass a place, as a share of [`Phasing::apart_m`].
    ///
    /// The share is 1 for two heads. It is a half for two pairs of side-by-side heads if the heads of a pair follow
    /// each other. The share is zero if all heads are at the same place along the hull.
    pub fn neighbours_apart(&self) -> f64 {
        let apart_m = self.apart_m();
        if apart_m <= 0.0 {
            return 0.0;
        }
        let ahead_m = |head: usize| self.ahead_m.get(head).copied().unwrap_or_default();
        let mut before = self.in_step.iter().last();
        let mut sum_m = 0.0;
        for head in self.in_step.iter() {
            sum_m += before.map_or(0.0, |before| (ahead_m(head) - ahead_m(before)).abs());
            before = Some(head);
        }
        let share = sum_m / (apart_m * self.in_step.len() as f64);
        debug_assert!((0.0..=1.0 + ROUNDING).contains(&share), "neighbours are within all heads: {share}");
        share
    }

    /// Returns this phasing with the phases of a schedule for `scheduled` heads at `planned_mps`.
    ///
    /// A speed of zero means a schedule that ignores positions along the hull. Heads in sectors or out of step keep
    /// their phases.
    /// Source: Jorge et al. 2021, Eq. 20.
    #[must_use]
    pub fn as_scheduled(&self, scheduled: usize, planned_mps: f64) -> Self {
        let mut then = *self;
        let Pattern::Turning(phases) = &mut then.pattern else { return then };
        for (head, ((phase, ahead_m), turn_s)) in
            phases.iter_mut().zip(self.ahead_m).zip(self.turns_s).enumerate()
        {
            let apart = planned_mps > AT_REST_MPS && turn_s > 0.0;
            let ahead = if apart { ahead_m / planned_mps / turn_s } else { 0.0 };
            *phase = scheduled_phase(head, scheduled) - ahead;
        }
        then
    }

    /// Returns the first pass of each head from now on.
    ///
    /// Only heads in step are included. Empty for heads in sectors, and if no heads are in step.
    pub fn first_passes(&self) -> impl Iterator<Item = HeadPasses> {
        let phases = if let Pattern::Turning(phases) = &self.pattern { Some(phases) } else { None };
        phases.into_iter().flat_map(|phases| {
            let figures =
                |head: usize| Some((*phases.get(head)?, *self.turns_s.get(head)?, *self.ahead_m.get(head)?));
            self.in_step.iter().filter_map(move |head| {
                let (phase, turn_s, ahead_m) = figures(head)?;
                (turn_s > 0.0).then_some(HeadPasses { head, first_s: phase * turn_s, turn_s, ahead_m })
            })
        })
    }

    /// Returns the passes of the heads at the speed `speed_mps`.
    ///
    /// Continuous rotation: head k passes the vertical at the times t_k + i T. The head is x_k ahead of the vehicle's
    /// origin, so it meets the wall at chainages x_k + v (t_k + i T). Divided by v T, these chainages are phases on a
    /// circle.
    /// Sectors: a place near a sector's end waits for a whole sweep there and back. The time between the passes of
    /// neighbouring heads at that end depends on the speed.
    /// Source: Jorge et al. 2021, §5.1 and §5.2.
    pub fn at(&self, speed_mps: f64) -> Passes {
        let Self { heads, in_step, turns_s, mut pattern, ahead_m, legs } = *self;
        let at_rest = speed_mps.abs() <= AT_REST_MPS;
        if let Pattern::Turning(phases) = &mut pattern {
            for ((phase, ahead_m), turn_s) in phases.iter_mut().zip(ahead_m).zip(turns_s) {
                let apart = ahead_m.abs() > 0.0 && turn_s > 0.0 && !at_rest;
                let ahead = if apart { ahead_m / speed_mps / turn_s } else { 0.0 };
                *phase = math::wrap(*phase + ahead, 1.0);
            }
        }
        if let Pattern::Sectors { sweep_s, uneven } = &mut pattern
            && !at_rest
            && *sweep_s > 0.0
        {
            *uneven = sectors::uneven(&legs, &ahead_m.map(|ahead_m| ahead_m / (speed_mps * *sweep_s)));
        }
        Passes { at_rest, ..Passes::new(heads, in_step, turns_s, pattern) }
    }

    /// Returns the largest set of heads in step, empty if no two heads are, or all heads in sectors.
    pub fn in_step(&self) -> HeadSet {
        self.in_step
    }
}

/// Largest set of heads that turn in one sense and at one rate, and the angle through which each of them turns until it
/// next passes the vertical, as a share of a turn.
///
/// The set is empty if no two heads are in step.
fn phases(motions: &[Option<HeadMotion>; MAX_HEADS]) -> (HeadSet, [f64; MAX_HEADS]) {
    let turning = motions.iter().flatten().count();
    let in_step_with = |first: &HeadMotion| {
        let (sense, turn_s) = (body_rate(first).signum(), first.turn_period_s());
        let is_in_step = |motion: &HeadMotion| {
            let longer_s = motion.turn_period_s() - turn_s;
            sense * body_rate(motion) > 0.0 && (0.0..=SAME_TURN * turn_s).contains(&longer_s)
        };
        let in_step =
            motions.iter().enumerate().filter(|(_, motion)| motion.as_ref().is_some_and(is_in_step));
        in_step.fold(HeadSet::default(), |set, (head, _)| set.with(head))
    };
    let sets = motions.iter().flatten().map(in_step_with);
    let in_step = sets.fold(HeadSet::default(), |most, set| if set.len() > most.len() { set } else { most });
    let in_step = if in_step.len() < turning.min(2) { HeadSet::default() } else { in_step };
    // If the body-frame angles of the heads fall, they are mirrored, so that all angles grow.
    let growing = |(head, motion): (usize, &Option<HeadMotion>)| Some((head, (*motion)?));
    let members = || motions.iter().enumerate().filter_map(growing).filter(|(head, _)| in_step.has(*head));
    let mirror = if members().all(|(_, motion)| body_rate(&motion) < 0.0) { -1.0 } else { 1.0 };
    let mut phases = [0.0; MAX_HEADS];
    for (head, motion) in members() {
        if let Some(phase) = phases.get_mut(head) {
            *phase = math::wrap(-mirror * body_sign(&motion) * motion.angle_rad, TAU) / TAU;
        }
    }
    (in_step, phases)
}

/// Chainage at which a head's scan plane meets the wall, relative to the vehicle's origin, m.
///
/// The chainage varies around the wall only by an amount that is the same for all heads with parallel axes. `None` for
/// a head whose scan plane lies along the tunnel.
///
/// The head's samples lie in the plane that contains the head and is normal to its axis n: `x n_x + y n_y + z n_z =
/// (head) n`.
pub fn ahead_m(attitude: &Rot<Tunnel, headrace_geometry::frames::Body>, mount: &Mount) -> Option<f64> {
    let axis = *attitude * (mount.rotation * Vec3::new(1.0, 0.0, 0.0));
    let offset = *attitude * mount.position;
    (axis.x().abs() > ASKEW).then(|| offset.0.dot(&axis.0) / axis.x())
}

/// Largest difference between the angles at which side-by-side heads see one place on the wall, radians.
pub fn parallax_rad(profile: &Profile, heads: &[Yz]) -> f64 {
    const PLACES: u32 = 72;
    let angle = |head: &Yz, place: Yz| math::atan2(place[0] - head[0], head[1] - place[1]);
    let Some(first) = heads.first().filter(|_| heads.len() > 1) else { return 0.0 };
    let mut most_rad = 0.0_f64;
    for k in 0..PLACES {
        let place = profile.point_at(profile.perimeter_m() * f64::from(k) / f64::from(PLACES));
        let from_first = angle(first, place);
        let (mut least, mut most) = (0.0_f64, 0.0_f64);
        for head in heads.iter().skip(1) {
            let off = math::wrap_signed(angle(head, place) - from_first, TAU);
            (least, most) = (least.min(off), most.max(off));
        }
        most_rad = most_rad.max(most - least);
    }
    most_rad
}

impl Passes {
    fn new(heads: HeadSet, in_step: HeadSet, turns_s: [f64; MAX_HEADS], pattern: Pattern) -> Self {
        let mut by_phase = [(HeadSet::default(), 0.0, 0.0); MAX_HEADS];
        if let Pattern::Turning(phases) = &pattern {
            let (known, _) = by_phase.split_at_mut(in_step.len());
            for (slot, head) in known.iter_mut().zip(in_step.iter()) {
                if let (Some(phase), Some(turn_s)) = (phases.get(head), turns_s.get(head)) {
                    *slot = (HeadSet::default().with(head), *phase, *turn_s);
                }
            }
            known.sort_unstable_by(|(_, a, _), (_, b, _)| a.total_cmp(b));
        }
        Self { heads, in_step, turns_s, pattern, by_phase, parallax_s: 0.0, at_rest: false, lossy: false }
    }

    /// Returns these passes with the timing error that the parallax of side-by-side heads causes.
    ///
    /// The angles from the heads to one place on the wall differ by up to `parallax_rad`.
    #[must_use]
    pub fn beside(self, parallax_rad: f64) -> Self {
        Self { parallax_s: parallax_rad / TAU * self.turn_s(), ..self }
    }

    /// Returns these passes with or without extra passes for lost returns; see [`super::losses`].
    #[must_use]
    pub fn lossy(self, lossy: bool) -> Self {
        Self { lossy, ..self }
    }

    /// Whether extra passes over each place are required for lost returns.
    pub fn is_lossy(&self) -> bool {
        self.lossy
    }

    /// Returns the longest time, s, that `needed` successive passes over a place take; the heads `seen_by` see the
    /// place.
    ///
    /// `gap_s` is the longest time between two passes. The other passes of a turn are assumed to be evenly spread over
    /// the rest of the turn. The result is continuous in `needed`, and equals `gap_s` for up to one pass.
    pub fn time_for_s(&self, seen_by: HeadSet, gap_s: f64, needed: f64) -> f64 {
        let (passing, turn_s) = match self.pattern {
            Pattern::Turning(_) => (seen_by.intersection(self.in_step).len(), self.turn_s()),
            // A sweep there and back passes a place twice. At a sector's end, these two passes follow each other
            // immediately.
            Pattern::Sectors { sweep_s, .. } => (2, sweep_s),
            Pattern::Loose => (1, gap_s),
        };
        let (count, needed) = (passing.max(1) as f64, needed.max(1.0));
        if passing <= 1 {
            return needed * gap_s;
        }
        let others_s = (turn_s - gap_s).max(0.0) / (count - 1.0);
        let turns = (needed / count).floor();
        let rest = needed - turns * count;
        let rest_s = if rest > 1.0 { gap_s + (rest - 1.0) * others_s } else { rest * gap_s };
        turns * (gap_s + (count - 1.0) * others_s) + rest_s
    }

    /// Creates passes of continuously rotating heads, evenly phased in order of their numbers.
    ///
    /// Heads with equal turn periods pass like this if a schedule has started them for the present speed. Heads with
    /// unequal turn periods run out of step, and have no reliable phases. `turn_s` returns the turn period of a head,
    /// seconds.
    /// Errors: no head.
    pub fn evenly_phased(heads: HeadSet, turn_s: impl Fn(usize) -> f64) -> Result<Self, SamplingError> {
        const IN_STEP: f64 = 1e-6;
        let Some(first) = heads.iter().next() else { return Err(SamplingError::HeadCount { heads: 0 }) };
        let (mut phases, mut turns_s) = ([0.0; MAX_HEADS], [0.0; MAX_HEADS]);
        for (rank, head) in heads.iter().enumerate() {
            if let (Some(phase), Some(turn)) = (phases.get_mut(head), turns_s.get_mut(head)) {
                (*phase, *turn) = (math::wrap(scheduled_phase(rank, heads.len()), 1.0), turn_s(head));
            }
        }
        let in_step = heads.iter().all(|head| (turn_s(head) / turn_s(first) - 1.0).abs() < IN_STEP);
        let pattern = if in_step { Pattern::Turning(phases) } else { Pattern::Loose };
        Ok(Self::new(heads, heads, turns_s, pattern))
    }

    /// Creates the passes of heads that sweep sectors, as if started by a schedule for the present speed.
    ///
    /// `sweep_s` is the period of a sweep there and back, s.
    ///
    /// Errors: no head.
    pub fn in_sectors(heads: HeadSet, sweep_s: f64) -> Result<Self, SamplingError> {
        if heads.is_empty() {
            return Err(SamplingError::HeadCount { heads: 0 });
        }
        let pattern = Pattern::Sectors { sweep_s, uneven: 0.0 };
        Ok(Self::new(heads, heads, [0.0; MAX_HEADS], pattern))
    }

    /// Returns the set of heads whose passes these are.
    pub fn heads(&self) -> HeadSet {
        self.heads
    }

    /// Returns the longest time between two passes of the heads `seen_by` over a place, s.
    ///
    /// `None` if none of the heads `seen_by` turns.
    pub fn gap_s(&self, seen_by: HeadSet) -> Option<f64> {
        let passing = seen_by.intersection(self.heads);
        if passing.is_empty() {
            return None;
        }
        Some(match &self.pattern {
            Pattern::Sectors { sweep_s, .. } => *sweep_s,
            Pattern::Loose => self.shortest_turn_s(passing),
            Pattern::Turning(_) => self.alone_s(passing).min(self.together_s(passing)),
        })
    }

    /// Returns the longest time between two passes of the heads in step among `passing`, s; infinite if there are none.
    fn together_s(&self, passing: HeadSet) -> f64 {
        let (mut first, mut last, mut between, mut turn_s, mut count) = (0.0, 0.0, 0.0_f64, 0.0_f64, 0);
        for (head, phase, own_s) in &self.by_phase {
            if head.intersection(passing).is_empty() {
                continue;
            }
            if count == 0 {
                first = *phase;
            } else {
                between = between.max(phase - last);
            }
            (last, turn_s, count) = (*phase, turn_s.max(*own_s), count + 1);
        }
        let gap = between.max(first + 1.0 - last);
        let even = 1.0 / f64::from(count.max(1));
        debug_assert!(
            (even - ROUNDING..=1.0 + ROUNDING).contains(&gap),
            "the largest gap is at least that of even phases, {even}, and at most a turn: {gap}"
        );
        match count {
            0 => f64::INFINITY,
            1 => turn_s * gap,
            _ => turn_s * gap + self.parallax_s,
        }
    }

    /// Returns the shortest turn period of the heads `seen_by` that are out of step, s; infinite if there are none.
    fn alone_s(&self, seen_by: HeadSet) -> f64 {
        self.shortest_turn_s(seen_by.intersection(self.heads).difference(self.in_step))
    }

    fn shortest_turn_s(&self, heads: HeadSet) -> f64 {
        heads.iter().filter_map(|head| self.turns_s.get(head)).copied().fold(f64::INFINITY, f64::min)
    }

    /// Largest unevenness of passes by two neighbouring heads at the end that their sectors share.
    ///
    /// The unevenness is a share of the vehicle's advance in a sweep there and back. It is 0 if one head reaches the
    /// shared end half a sweep after the other head. It is 0.5 if both heads reach the shared end at the same chainage,
    /// or if the timing is unknown. `None` for continuously rotating heads.
    pub fn uneven_ends(&self) -> Option<f64> {
        match self.pattern {
            Pattern::Sectors { uneven, .. } => Some(uneven),
            Pattern::Turning(_) | Pattern::Loose => None,
        }
    }

    /// Returns the longest turn period of a head in step, seconds.
    pub fn turn_s(&self) -> f64 {
        self.in_step.iter().filter_map(|head| self.turns_s.get(head)).copied().fold(0.0, f64::max)
    }

    /// Returns these passes with evenly phased heads and without parallax. Heads that are not phased with each other
    /// stay unchanged.
    #[must_use]
    pub fn evened(&self) -> Self {
        let even = match self.pattern {
            Pattern::Turning(_) => Self::evenly_phased(self.in_step, |_| self.turn_s()).ok(),
            Pattern::Sectors { sweep_s, .. } => Self::in_sectors(self.heads, sweep_s).ok(),
            Pattern::Loose => None,
        };
        let pattern = even.map_or(self.pattern, |even| even.pattern);
        let Self { heads, in_step, turns_s, at_rest, lossy, .. } = *self;
        Self { at_rest, lossy, ..Self::new(heads, in_step, turns_s, pattern) }
    }

    /// Returns the longest time between passes of all heads with even phases, seconds; zero without a head.
    pub fn even_gap_s(&self) -> f64 {
        match self.pattern {
            Pattern::Turning(_) => {
                self.alone_s(self.heads).min(self.turn_s() / self.in_step.len().max(1) as f64)
            }
            Pattern::Sectors { .. } | Pattern::Loose => self.gap_s(self.heads).unwrap_or(0.0),
        }
    }

    /// Returns the phase error of each head relative to the first head that turns, radians.
    ///
    /// The error is an angle of the head's turn, in [-pi, pi). If it is positive, the head passes the wall later, and
    /// farther ahead, than the schedule for `scheduled` heads requires. `None` for an absent head, for heads that
    /// aren't phased with each other, and at rest.
    /// Source: Jorge et al. 2021, §5.1 (phi(k) = 2 pi k / s).
    pub fn phase_errors_rad(&self, scheduled: usize) -> [Option<f64>; MAX_HEADS] {
        let mut errors = [None; MAX_HEADS];
        let Pattern::Turning(phases) = &self.pattern else { return errors };
        if self.at_rest {
            return errors;
        }
        let late = |head: usize| phases.get(head).map(|phase| phase - scheduled_phase(head, scheduled));
        let Some(first) = self.in_step.iter().next().and_then(late) else { return errors };
        for (head, error) in errors.iter_mut().enumerate().filter(|(head, _)| self.in_step.has(*head)) {
            *error = late(head).map(|here| math::wrap_signed(here - first, 1.0) * TAU);
        }
        errors
    }
}

/// Scheduled phase of head number `head` among `heads` heads, as a share of the vehicle's advance per turn.
///
/// A head that is ahead in angle passes a place earlier.
fn scheduled_phase(head: usize, heads: usize) -> f64 {
    -(head as f64) / heads.max(1) as f64
}

/// Sign of a head's rotation: 1 if its angles grow in the body's sense of rotation, -1 if in the opposite sense.
fn body_sign(motion: &HeadMotion) -> f64 {
    if faces_aft(motion.mount.rotation) { -1.0 } else { 1.0 }
}

fn body_rate(motion: &HeadMotion) -> f64 {
    body_sign(motion) * motion.rate_radps
}

#[cfg(test)]
mod tests;
