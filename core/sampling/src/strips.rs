//! The wall around a vehicle as strips, each seen by the same heads, and the spacing on them.

use serde::{Deserialize, Serialize};

use super::error::SamplingError;
use super::head::{HeadSet, MAX_HEADS};
use super::occlusion::AngleRange;
use super::passes::Passes;
use super::ring::{Ring, Sounding, Standing};
use super::spacing;
use headrace_geometry::math;
use headrace_snapshot::stateful;

mod lossy;
mod thin;

use thin::Thin;

/// Strips narrower than this are rounding errors, m.
const NO_WIDTH_M: f64 = 1e-9;

/// An interval of the perimeter.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Arc {
    /// Arc length of its start, m.
    pub from_m: f64,
    /// Its length in the direction of growing arc length, m.
    pub length_m: f64,
}

impl Arc {
    /// The part of the wall covered by a range of head angles.
    ///
    /// Errors: as for [`Standing::sounding`].
    pub fn of(standing: &Standing<'_>, angles: &AngleRange) -> Result<Self, SamplingError> {
        let arc_m = |angle_rad| standing.sounding(angle_rad).map(|sounding| sounding.arc_m);
        let perimeter_m = standing.perimeter_m();
        if angles.size_rad >= math::TAU {
            return Ok(Self { from_m: 0.0, length_m: perimeter_m });
        }
        let (first, last) = (arc_m(angles.from_rad)?, arc_m(angles.from_rad + angles.size_rad)?);
        let (middle, whole) = (
            math::wrap(arc_m(angles.middle_rad())? - first, perimeter_m),
            math::wrap(last - first, perimeter_m),
        );
        // A head that faces aft sweeps the wall in the other direction.
        Ok(if middle <= whole {
            Self { from_m: first, length_m: whole }
        } else {
            Self { from_m: last, length_m: perimeter_m - whole }
        })
    }

    /// From the start of this arc to the end of the next, in the head's direction of rotation.
    fn on_to(&self, next: &Self, forward: bool, perimeter_m: f64) -> Self {
        let (first, last) = if forward { (self, next) } else { (next, self) };
        let length_m = math::wrap(last.from_m + last.length_m - first.from_m, perimeter_m);
        Self { from_m: first.from_m, length_m }
    }

    fn has(&self, arc_m: f64, perimeter_m: f64) -> bool {
        math::wrap(arc_m - self.from_m, perimeter_m) <= self.length_m
    }
}

/// The parts of the wall that one head sees.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct View {
    /// Its sector; `None` for the whole perimeter.
    pub sector: Option<Arc>,
    /// Arcs hidden from it, by the vehicle or out of its reach.
    pub hidden: Vec<Arc>,
}

stateful!(View { state: sector; lists: hidden; });

impl View {
    /// Hides the parts of a ring nearer or farther than the head's reach. Without capacity for another arc, the last is
    /// extended over the visible part between: hiding too much is the safe side.
    ///
    /// Allocates: not with capacity for one arc.
    pub fn hide_out_of_reach(&mut self, ring: &Ring, reach_m: [f64; 2]) {
        let [least_m, most_m] = reach_m;
        let heard = |range_m: f64| (least_m..=most_m).contains(&range_m);
        let soundings = ring.soundings();
        let Some(first) = soundings.iter().position(|sounding| heard(sounding.range_m())) else {
            self.hidden.clear();
            self.hidden.push(Arc { from_m: 0.0, length_m: ring.perimeter_m() });
            return;
        };
        let mut began: Option<f64> = None;
        let mut before_m = 0.0;
        for sounding in soundings.iter().cycle().skip(first).take(soundings.len() + 1) {
            match (heard(sounding.range_m()), began) {
                (false, None) => began = Some(before_m),
                (true, Some(from_m)) => {
                    let way_m = math::wrap_signed(sounding.arc_m - from_m, ring.perimeter_m());
                    let forward = ring.way_round_m() >= 0.0;
                    let (from_m, way_m) = if forward { (from_m, way_m) } else { (sounding.arc_m, -way_m) };
                    let arc = Arc { from_m, length_m: math::wrap(way_m, ring.perimeter_m()) };
                    let full = self.hidden.len() == self.hidden.capacity();
                    match self.hidden.last_mut().filter(|_| full) {
                        Some(last) => *last = last.on_to(&arc, forward, ring.perimeter_m()),
                        None => self.hidden.push(arc),
                    }
                    began = None;
                }
                _ => {}
            }
            before_m = sounding.arc_m;
        }
    }
}

/// A strip of the wall along the tunnel.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Strip {
    /// Its arc on the perimeter.
    pub arc: Arc,
    /// The heads that see it.
    pub seen_by: HeadSet,
    /// All or part of it is hidden from a head: pings stop up to a step before its edge. Where it is only outside a
    /// sector, they stop at its edge.
    pub hidden: bool,
}

/// Vehicle motion for the prediction of spacing.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Going {
    /// Time between two pings, the longest of any head, seconds.
    pub ping_period_s: f64,
    /// Largest speed of the beams along the wall due to swing, in addition to the vehicle's speed, m/s.
    pub swing_mps: f64,
    /// Displacement of passes from their places at any speed, m.
    pub shift_m: f64,
    /// Distance between heads along the hull, m: the swing acts while the vehicle covers it.
    pub apart_m: f64,
    /// Largest speed of the beams along the wall due to swing, averaged over that time, m/s.
    pub apart_swing_mps: f64,
    /// Limit of the swing's displacement over any time, m; `None` if unknown.
    pub swing_most_m: Option<f64>,
}

/// The largest speed for a target, and T_y where it limits that speed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bound {
    /// The speed, m/s; infinite where nothing bounds it.
    pub speed_mps: f64,
    /// T_y of the limiting strip, m.
    pub t_y_m: f64,
}

/// Strips of the wall, in order of arc length, neighbours seen by different heads; one strip where all heads see all.
/// Holds the largest steps on each strip for each of several settings of the heads.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Strips {
    strips: Vec<Strip>,
    edges_m: Vec<f64>,
    perimeter_m: f64,
    /// By setting and strip: the largest step of the heads that see it, and of all heads, m.
    steps_m: Vec<[f64; 2]>,
    /// By setting and strip: passes needed for one within it, and across it, as returns are lost; empty before the first count.
    needed: Vec<[f64; 2]>,
    /// Strip of each sounding of the current ring, and the approximate distance to the strip's end, m.
    strip_of: Vec<(usize, f64)>,
}

stateful!(Strips { state: perimeter_m; lists: strips, edges_m, steps_m, needed, strip_of; });

impl Strips {
    /// Without strips, with capacity for those of `arcs` arcs in `settings` settings.
    pub fn with_room(arcs: usize, settings: usize, soundings: u32) -> Self {
        let strips = 2 * arcs + 1;
        Self {
            strips: Vec::with_capacity(strips),
            edges_m: Vec::with_capacity(2 * arcs),
            perimeter_m: 0.0,
            steps_m: Vec::with_capacity(strips * settings),
            needed: Vec::with_capacity(strips * settings),
            strip_of: Vec::with_capacity(soundings as usize),
        }
    }

    /// Builds the strips of these views, without steps.
    ///
    /// Allocates: not with capacity for their sectors and hidden arcs.
    pub fn rebuild(&mut self, perimeter_m: f64, views: &[View]) {
        self.perimeter_m = perimeter_m;
        self.steps_m.clear();
        self.edges_m.clear();
        for arc in views.iter().flat_map(|view| view.sector.iter().chain(&view.hidden)) {
            self.edges_m.push(math::wrap(arc.from_m, perimeter_m));
            self.edges_m.push(math::wrap(arc.from_m + arc.length_m, perimeter_m));
        }
        self.edges_m.sort_unstable_by(f64::total_cmp);
        self.edges_m.dedup_by(|b, a| *b - *a < NO_WIDTH_M);
        self.strips.clear();
        let edges = &self.edges_m;
        for (k, from_m) in edges.iter().enumerate() {
            let to_m =
                edges.get(k + 1).copied().unwrap_or(perimeter_m + edges.first().copied().unwrap_or(0.0));
            let arc = Arc { from_m: *from_m, length_m: to_m - from_m };
            self.strips.push(strip(views, arc, perimeter_m));
        }
        if self.strips.is_empty() {
            self.strips.push(strip(views, Arc { from_m: 0.0, length_m: perimeter_m }, perimeter_m));
        }
        self.strips.dedup_by(|b, a| {
            let alike = a.seen_by == b.seen_by && a.hidden == b.hidden;
            if alike {
                a.arc.length_m += b.arc.length_m;
            }
            alike
        });
        self.join_at_the_seam();
    }

    /// Joins the last strip and the first across the seam where they are alike.
    fn join_at_the_seam(&mut self) {
        let alike = |a: &Strip, b: &Strip| a.seen_by == b.seen_by && a.hidden == b.hidden;
        let first = self.strips.first().copied();
        if self.strips.len() > 1
            && let (Some(first), Some(last)) = (first, self.strips.last_mut())
            && alike(&first, last)
        {
            last.arc.length_m += first.arc.length_m;
            self.strips.remove(0);
        }
    }

    /// Measures the largest steps on each strip in `settings` settings of the heads: `stride` gives the ring stride of
    /// a head's step by setting and head, `None` for a head that is absent.
    ///
    /// Allocates: not with capacity for the settings.
    pub fn measure<'a>(
        &mut self,
        settings: usize,
        rings: impl Iterator<Item = &'a Ring>,
        stride: impl Fn(usize, usize) -> Option<usize>,
    ) {
        let count = self.strips.len();
        self.steps_m.clear();
        self.steps_m.resize(count * settings, [0.0; 2]);
        for (head, ring) in rings.enumerate() {
            let forward = ring.way_round_m() >= 0.0;
            self.find_strips(ring, forward);
            for setting in 0..settings {
                let Some(stride) = stride(setting, head) else { continue };
                let Self { strips, strip_of, steps_m, perimeter_m, .. } = &mut *self;
                let from = ring.soundings().iter().zip(strip_of.iter());
                let mut note = |((sounding, (strip, left_m)), step_m): ((&Sounding, &(usize, f64)), f64)| {
                    let (strip, is_within) = (*strip, step_m < left_m - NO_WIDTH_M);
                    let from = Reached { head, arc_m: sounding.arc_m, strip, forward, is_within };
                    note_step(strips, steps_m, setting, &from, step_m, *perimeter_m);
                };
                match ring.kept_steps_m(stride) {
                    Some(kept_m) => from.zip(kept_m.iter().copied()).for_each(&mut note),
                    None => from.zip(ring.steps_m(stride)).for_each(&mut note),
                }
            }
        }
    }

    /// Finds the strip of each sounding of a ring.
    fn find_strips(&mut self, ring: &Ring, forward: bool) {
        let first_m = self.strips.first().map_or(0.0, |strip| strip.arc.from_m);
        let mut number = 0;
        self.strip_of.clear();
        for sounding in ring.soundings() {
            number = number_near(&self.strips, sounding.arc_m, self.perimeter_m, number);
            let from_first_m = math::wrap(sounding.arc_m - first_m, self.perimeter_m);
            let left_m = self.strips.get(number).map_or(0.0, |strip| {
                let into_m = from_first_m - (strip.arc.from_m - first_m);
                if forward { strip.arc.length_m - into_m } else { into_m }
            });
            self.strip_of.push((number, left_m));
        }
    }

    /// The strips.
    pub fn as_slice(&self) -> &[Strip] {
        &self.strips
    }

    /// The strip at an arc length.
    pub fn at(&self, arc_m: f64) -> Option<&Strip> {
        self.strips.get(number_at(&self.strips, arc_m, self.perimeter_m))
    }

    /// The largest step of any head on the strips that it sees, in a setting, m.
    pub fn largest_step_m(&self, setting: usize) -> f64 {
        let count = self.strips.len();
        let of_setting = self.steps_m.iter().skip(setting * count).take(count);
        of_setting.map(|steps| steps[0]).fold(0.0, f64::max)
    }

    /// T_max predicted at a speed, m: the largest of any strip; infinite where a wide strip is seen by no head.
    ///
    /// On a strip that some heads don't see, passes are farther apart; but the strip's width also bounds the distance
    /// between the samples on either side of it.
    /// Source: Jorge et al. 2021, Eq. 16.
    pub fn t_max_m(&self, setting: usize, passes: &Passes, speed_mps: f64, going: &Going) -> f64 {
        self.ts_m(setting, passes, speed_mps, going).fold(0.0, f64::max)
    }

    /// Whether [`Strips::t_max_m`] is within a target; stops at the first strip that isn't.
    pub fn meets(
        &self,
        setting: usize,
        passes: &Passes,
        speed_mps: f64,
        target_m: f64,
        going: &Going,
    ) -> bool {
        let thin = Thin::of(passes, self.strips.iter().map(|strip| strip.seen_by));
        let is_met = |limit: Limit| limit.t_m(speed_mps, going) <= target_m;
        // What is across a strip is only looked at where the strip itself doesn't meet it.
        self.strips.iter().enumerate().all(|(k, strip)| {
            self.within(setting, (k, strip), &thin).is_some_and(is_met)
                || self.across(setting, (k, strip), &thin).is_some_and(is_met)
        })
    }

    /// The largest speed for a target if every head saw all of the wall, m/s; `None` where none meets it.
    pub fn bound_if_all_seen_mps(
        &self,
        setting: usize,
        passes: &Passes,
        target_m: f64,
        going: &Going,
    ) -> Option<f64> {
        let count = self.strips.len();
        let of_setting = self.steps_m.iter().skip(setting * count).take(count);
        let t_y_m = of_setting.map(|steps| steps[1]).fold(0.0, f64::max);
        Limit { gap_s: passes.gap_s(passes.heads())?, t_y_m }.speed_mps(target_m, going)
    }

    /// T predicted on each strip at a speed, m.
    fn ts_m(
        &self,
        setting: usize,
        passes: &Passes,
        speed_mps: f64,
        going: &Going,
    ) -> impl Iterator<Item = f64> {
        let t_m = move |limit: Limit| limit.t_m(speed_mps, going);
        self.limits(setting, passes).map(move |(_, within, across)| {
            within.map_or(f64::INFINITY, t_m).min(across.map_or(f64::INFINITY, t_m))
        })
    }

    /// The largest speed at which [`Strips::t_max_m`] meets a target, for passes that are the same at any speed, and
    /// its limiting T_y.
    ///
    /// Errors: a strip on which no speed meets the target.
    pub fn bound_for_target(
        &self,
        setting: usize,
        passes: &Passes,
        target_m: f64,
        going: &Going,
    ) -> Result<Bound, SamplingError> {
        let mut slowest = Bound { speed_mps: f64::INFINITY, t_y_m: 0.0 };
        for (strip, within, across) in self.limits(setting, passes) {
            let limits = || [within, across].into_iter().flatten();
            let bounds = limits().filter_map(|limit| {
                let speed_mps = limit.speed_mps(target_m, going)?;
                Some(Bound { speed_mps, t_y_m: limit.t_y_m })
            });
            let fastest = bounds.max_by(|a, b| a.speed_mps.total_cmp(&b.speed_mps));
            let t_y_m = limits().map(|limit| limit.t_y_m).fold(f64::INFINITY, f64::min);
            let arc = strip.arc;
            let refused = if within.is_some() && t_y_m >= target_m {
                SamplingError::AngularStep { target_m, t_y_m }
            } else if within.is_some() {
                SamplingError::OffAxis { target_m }
            } else {
                let arc_m = math::wrap(arc.from_m + arc.length_m / 2.0, self.perimeter_m);
                SamplingError::UnseenStrip { target_m, width_m: arc.length_m, arc_m }
            };
            let fastest = fastest.ok_or(refused)?;
            if fastest.speed_mps < slowest.speed_mps {
                slowest = fastest;
            }
        }
        Ok(slowest)
    }

    /// For each strip, the limits of T within it, where any head sees it, and across it, where not all do.
    fn limits(
        &self,
        setting: usize,
        passes: &Passes,
    ) -> impl Iterator<Item = (&Strip, Option<Limit>, Option<Limit>)> {
        let thin = Thin::of(passes, self.strips.iter().map(|strip| strip.seen_by));
        self.strips.iter().enumerate().map(move |(k, strip)| {
            let (within, across) =
                (self.within(setting, (k, strip), &thin), self.across(setting, (k, strip), &thin));
            (strip, within, across)
        })
    }

    fn within(&self, setting: usize, (k, strip): (usize, &Strip), thin: &Thin<'_>) -> Option<Limit> {
        let t_y_m = self.steps_m.get(setting * self.strips.len() + k).map_or(0.0, |steps| steps[0]);
        let gap_s = thin.gap_s(k, strip.seen_by)?;
        let [needed, _] = self.needed(setting, k, thin);
        Some(Limit { gap_s: thin.time_for_s(strip.seen_by, gap_s, needed), t_y_m })
    }

    fn across(&self, setting: usize, (k, strip): (usize, &Strip), thin: &Thin<'_>) -> Option<Limit> {
        (!thin.is_full(k, strip.seen_by) && thin.best_s().is_finite())
            .then(|| {
                let [_, needed] = self.needed(setting, k, thin);
                Limit { gap_s: needed * thin.best_s(), t_y_m: self.across_m(setting, k, thin) }
            })
            .filter(|limit| limit.t_y_m < self.perimeter_m)
    }

    /// Distance between the samples on either side of the strips around strip `k` that are thin, m.
    fn across_m(&self, setting: usize, k: usize, gaps: &Thin<'_>) -> f64 {
        let count = self.strips.len();
        let thin = |number: usize| {
            let number = number % count;
            self.strips.get(number).filter(|strip| !gaps.is_full(number, strip.seen_by)).map(|_| number)
        };
        let forward = (k..k + count).map_while(&thin);
        let back = (1..count).map(|step| k + count - step).map_while(&thin);
        let (mut width_m, mut step_m, mut hidden) = (0.0, 0.0_f64, false);
        for number in forward.chain(back) {
            let Some(strip) = self.strips.get(number) else { continue };
            width_m += strip.arc.length_m;
            hidden |= strip.hidden;
            step_m = step_m.max(self.steps_m.get(setting * count + number).map_or(0.0, |steps| steps[1]));
        }
        // Pings end at a sector's edge, but up to a step before a hidden arc.
        width_m.min(self.perimeter_m) + if hidden { 2.0 * step_m } else { 0.0 }
    }
}

/// Start and direction of a step.
struct Reached {
    head: usize,
    arc_m: f64,
    strip: usize,
    forward: bool,
    /// Whether it certainly ends in the strip in which it begins.
    is_within: bool,
}

/// Records a step on every strip that it touches or crosses, however narrow.
fn note_step(
    strips: &[Strip],
    steps_m: &mut [[f64; 2]],
    setting: usize,
    from: &Reached,
    step_m: f64,
    perimeter_m: f64,
) {
    let count = strips.len();
    let mut number = from.strip;
    if from.is_within {
        if let (Some(strip), Some(steps)) = (strips.get(number), steps_m.get_mut(setting * count + number)) {
            note_on(strip, steps, from.head, step_m);
        }
        return;
    }
    let into_m =
        strips.get(number).map_or(0.0, |strip| math::wrap(from.arc_m - strip.arc.from_m, perimeter_m));
    let mut left_behind_m = if from.forward {
        -into_m
    } else {
        into_m - strips.get(number).map_or(0.0, |strip| strip.arc.length_m)
    };
    for _ in 0..count {
        let (Some(strip), Some(steps)) = (strips.get(number), steps_m.get_mut(setting * count + number))
        else {
            return;
        };
        note_on(strip, steps, from.head, step_m);
        left_behind_m += strip.arc.length_m;
        if left_behind_m >= step_m {
            return;
        }
        number = if from.forward { number + 1 } else { number + count - 1 } % count;
    }
}

fn note_on(strip: &Strip, steps_m: &mut [f64; 2], head: usize, step_m: f64) {
    if strip.seen_by.has(head) {
        steps_m[0] = steps_m[0].max(step_m);
    }
    steps_m[1] = steps_m[1].max(step_m);
}

/// Limit of T: time between passes, and distance between neighbours around the wall.
#[derive(Debug, Clone, Copy)]
struct Limit {
    gap_s: f64,
    t_y_m: f64,
}

impl Limit {
    fn t_m(&self, speed_mps: f64, going: &Going) -> f64 {
        let over_ground_mps = speed_mps + going.swing_mps;
        let lag_m2ps = going.apart_swing_mps * going.apart_m;
        let lag_m = if lag_m2ps > 0.0 { lag_m2ps / speed_mps } else { 0.0 };
        let swung_m = over_ground_mps * self.gap_s + going.shift_m + lag_m;
        let at_most_m = going.swing_most_m.map(|most_m| speed_mps * self.gap_s + going.shift_m + most_m);
        let t_x_m = at_most_m.map_or(swung_m, |at_most_m| swung_m.min(at_most_m));
        spacing::t_max_m(t_x_m, over_ground_mps * going.ping_period_s, self.t_y_m)
    }

    /// The largest speed that solves T = hypot((v + w) t + shift + u a / v, T_y), with t the sum of gap and ping
    /// period, w the swing speed, u that between heads, and a their distance; or, if faster, the same with the swing's limit
    /// between passes.
    fn speed_mps(&self, target_m: f64, going: &Going) -> Option<f64> {
        let along_m = spacing::along_m(target_m, self.t_y_m)?;
        let bounded = going.swing_most_m.and_then(|most_m| self.bounded_mps(along_m, most_m, going));
        self.swung_mps(along_m, going).into_iter().chain(bounded).max_by(f64::total_cmp)
    }

    fn bounded_mps(&self, along_m: f64, most_m: f64, going: &Going) -> Option<f64> {
        let time_s = self.gap_s + going.ping_period_s;
        let for_speed_m = along_m - going.shift_m - most_m - going.swing_mps * going.ping_period_s;
        (time_s > 0.0 && for_speed_m > 0.0).then(|| for_speed_m / time_s)
    }

    fn swung_mps(&self, along_m: f64, going: &Going) -> Option<f64> {
        let time_s = self.gap_s + going.ping_period_s;
        let for_speed_m = along_m - going.shift_m - going.swing_mps * time_s;
        let rest = for_speed_m * for_speed_m - 4.0 * time_s * going.apart_swing_mps * going.apart_m;
        let possible = time_s > 0.0 && for_speed_m > 0.0 && rest >= 0.0;
        possible.then(|| (for_speed_m + math::sqrt(rest)) / (2.0 * time_s))
    }
}

fn strip(views: &[View], arc: Arc, perimeter_m: f64) -> Strip {
    let middle_m = arc.from_m + arc.length_m / 2.0;
    let hides = |view: &View| view.hidden.iter().any(|hidden| hidden.has(middle_m, perimeter_m));
    let sees =
        |view: &View| view.sector.is_none_or(|sector| sector.has(middle_m, perimeter_m)) && !hides(view);
    let heads = views.iter().take(MAX_HEADS).enumerate().filter(|(_, view)| sees(view));
    Strip {
        arc,
        seen_by: heads.fold(HeadSet::default(), |set, (head, _)| set.with(head)),
        hidden: views.iter().any(hides),
    }
}

/// As [`number_at`], with a guess that is mostly right: soundings follow each other round the wall.
fn number_near(strips: &[Strip], arc_m: f64, perimeter_m: f64, guess: usize) -> usize {
    let first_m = strips.first().map_or(0.0, |strip| strip.arc.from_m);
    let from_first_m = math::wrap(arc_m - first_m, perimeter_m);
    let begins = |number: usize| strips.get(number).map(|strip| strip.arc.from_m - first_m <= from_first_m);
    if begins(guess) == Some(true) && begins(guess + 1) != Some(true) {
        return guess;
    }
    strips.iter().rposition(|strip| strip.arc.from_m - first_m <= from_first_m).unwrap_or(0)
}

/// The number of the strip at an arc length: the last that begins at or before it.
fn number_at(strips: &[Strip], arc_m: f64, perimeter_m: f64) -> usize {
    number_near(strips, arc_m, perimeter_m, strips.len())
}

#[cfg(test)]
mod tests;
