//! Wall around a vehicle, divided into strips, and the sample spacing on each strip. The same heads see all of a strip.

mod limit;
mod thin;
mod view;

use serde::{Deserialize, Serialize};

use super::error::SamplingError;
use super::head::{HeadSet, MAX_HEADS};
use super::losses::{LossRate, Sampled};
use super::passes::Passes;
use super::ring::{Ring, Sounding};
use headrace_geometry::math;
use headrace_geometry::snapshot::stateful;

use limit::Limit;
use thin::Thin;

pub use limit::Going;
pub use view::{Arc, PARTS, Sector, View};

/// Width below which a strip of wall counts as a rounding error, m.
const NO_WIDTH_M: f64 = 1e-9;

/// A strip of the wall along the tunnel.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Strip {
    /// Arc of the strip on the perimeter.
    pub arc: Arc,
    /// The heads that see the strip.
    pub seen_by: HeadSet,
    /// Index of `seen_by` among the different sets of heads that see a strip.
    set: u8,
    /// Whether any part of the strip is hidden from a head whose beam sweeps over it.
    ///
    /// If true, the head's pings stop up to one angular step before the strip's edge. If the strip is only outside the
    /// head's sector, pings stop exactly at its edge.
    pub hidden: bool,
    /// Longest time between two passes over the strip, as a share of a sweep there and back: 0.5 to 1.
    ///
    /// The share is largest at the ends of a sector. For heads that rotate continuously, it is 1.
    pub wait: f64,
}

impl Strip {
    /// Whether this strip and the strip `other` differ only in their places on the wall.
    fn is_like(&self, other: &Self) -> bool {
        let same_wait = (self.wait - other.wait).abs() <= 0.0;
        self.seen_by == other.seen_by && self.hidden == other.hidden && same_wait
    }
}

/// Largest speed for a target, and T_y at the place that limits this speed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bound {
    /// The largest speed, m/s; infinite if nothing limits it.
    pub speed_mps: f64,
    /// T_y (largest distance between samples of a turn) on the strip that limits the speed, m.
    pub t_y_m: f64,
}

/// A strip of the wall that misses a target at a speed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Unmet {
    /// Longest time between two passes over the strip, s, without extra passes for lost returns.
    ///
    /// Infinite if no head sees the strip.
    pub gap_s: f64,
    /// The largest distance between neighbouring samples of a turn on the strip, m.
    pub t_y_m: f64,
    /// Width of the strip around the wall, m. Samples on the strip's two sides are at least this far apart.
    pub width_m: f64,
}

/// Strips of the wall in order of arc length; a single strip if all heads see all of the wall.
///
/// Neighbouring strips differ in the heads that see them or in the time between passes. For each setting of the heads
/// and each strip, the largest distance between neighbouring samples of a turn is stored.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Strips {
    strips: Vec<Strip>,
    /// The different sets of heads that see a strip.
    sets: Vec<HeadSet>,
    edges_m: Vec<f64>,
    perimeter_m: f64,
    /// Two largest distances between samples of a turn on a strip, m: first among the heads that see the strip, then
    /// among all heads.
    ///
    /// The list is ordered by setting, then by strip.
    steps_m: Vec<[f64; 2]>,
    /// Numbers of passes needed because of lost returns, for holes within a strip and for holes across it.
    ///
    /// The list is ordered by setting, then by strip. It is empty before the first call of `count_losses`.
    needed: Vec<[f64; 2]>,
    /// Strip of each sounding of the present ring of rays, and approximate distance, m, from the sounding to the end of
    /// its strip.
    strip_of: Vec<(usize, f64)>,
}

stateful!(Strips { state: perimeter_m; lists: strips, sets, edges_m, steps_m, needed, strip_of; });

impl Strips {
    /// Creates an empty list with capacity for the strips of `arcs` arcs and for `settings` settings of the heads.
    pub fn with_room(arcs: usize, settings: usize, soundings: u32) -> Self {
        let strips = 2 * arcs + 1;
        Self {
            strips: Vec::with_capacity(strips),
            sets: Vec::with_capacity(strips),
            edges_m: Vec::with_capacity(2 * arcs),
            perimeter_m: 0.0,
            steps_m: Vec::with_capacity(strips * settings),
            needed: Vec::with_capacity(strips * settings),
            strip_of: Vec::with_capacity(soundings as usize),
        }
    }

    /// Divides the wall into strips by the views of the heads. [`Strips::measure`] adds the distances between samples.
    ///
    /// Allocates: not if the capacity suffices for the views' sectors and hidden arcs.
    pub fn rebuild<'a>(&mut self, perimeter_m: f64, views: &'a [View]) {
        self.perimeter_m = perimeter_m;
        self.steps_m.clear();
        self.edges_m.clear();
        let arcs = |view: &'a View| view.sector.iter().flat_map(Sector::parts).chain(&view.hidden);
        for arc in views.iter().flat_map(arcs) {
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
            let alike = a.is_like(b);
            if alike {
                a.arc.length_m += b.arc.length_m;
            }
            alike
        });
        self.join_at_the_seam();
        self.sets.clear();
        for strip in &mut self.strips {
            let known = self.sets.iter().position(|set| *set == strip.seen_by);
            let number = known.unwrap_or(self.sets.len());
            if known.is_none() {
                self.sets.push(strip.seen_by);
            }
            strip.set = u8::try_from(number).unwrap_or(u8::MAX);
        }
        debug_assert!(self.covers_perimeter(), "strips cover {perimeter_m} m: {:?}", self.strips);
    }

    /// Whether the lengths of all strips add up to the perimeter.
    fn covers_perimeter(&self) -> bool {
        let sum_m: f64 = self.strips.iter().map(|strip| strip.arc.length_m).sum();
        (sum_m - self.perimeter_m).abs() <= 1e-6 * self.perimeter_m
    }

    /// Joins the last strip with the first strip across the start of arc lengths if both strips are alike.
    fn join_at_the_seam(&mut self) {
        let first = self.strips.first().copied();
        if self.strips.len() > 1
            && let (Some(first), Some(last)) = (first, self.strips.last_mut())
            && first.is_like(last)
        {
            last.arc.length_m += first.arc.length_m;
            self.strips.remove(0);
        }
    }

    /// Measures the largest distance between samples of a turn on each strip, for each of `settings` settings of the
    /// heads.
    ///
    /// `stride` returns the number of rays in an angular step, by setting and head; `None` for an absent head.
    ///
    /// Allocates: not if the capacity suffices for the settings.
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

    /// Finds the strip of each sounding of a ring of rays.
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

    /// The strips of the wall, in order of arc length.
    pub fn as_slice(&self) -> &[Strip] {
        &self.strips
    }

    /// Returns the strip that contains an arc length.
    pub fn at(&self, arc_m: f64) -> Option<&Strip> {
        self.strips.get(number_at(&self.strips, arc_m, self.perimeter_m))
    }

    /// Returns the arc of a strip joined with its neighbours that the same heads see.
    ///
    /// The joined strips may differ in the time between passes.
    fn seen_alike(&self, k: usize) -> Arc {
        let count = self.strips.len();
        let Some(strip) = self.strips.get(k) else {
            debug_assert!(false, "strip {k} is one of {count}");
            return Arc { from_m: 0.0, length_m: 0.0 };
        };
        let is_alike = |beside: &&Strip| beside.seen_by == strip.seen_by && beside.hidden == strip.hidden;
        let alike = |number: usize| Some(self.strips.get(number % count).filter(is_alike)?.arc.length_m);
        let forward_m: f64 = (k..k + count).map_while(alike).sum();
        let back_m: f64 = (1..count).map_while(|step| alike(k + count - step)).sum();
        Arc { from_m: strip.arc.from_m - back_m, length_m: (forward_m + back_m).min(self.perimeter_m) }
    }

    /// Returns the largest distance between samples of a turn in a setting, m. All heads count, on the strips that they
    /// see.
    pub fn largest_step_m(&self, setting: usize) -> f64 {
        let count = self.strips.len();
        let of_setting = self.steps_m.iter().skip(setting * count).take(count);
        of_setting.map(|steps| steps[0]).fold(0.0, f64::max)
    }

    /// Returns the largest number of passes needed over any place because of lost returns, in a setting.
    pub fn most_needed(&self, setting: usize) -> f64 {
        let of_setting = self.needed.iter().skip(setting * self.strips.len()).take(self.strips.len());
        of_setting.map(|needed| needed[0]).fold(1.0, f64::max)
    }

    /// Returns T_max predicted at a speed, m: the largest spacing T on any strip.
    ///
    /// The result is infinite if no head sees some wide strip. Passes are farther apart on a strip that some heads do
    /// not see. If such a strip is narrow, the samples on its two sides limit T as well.
    /// Source: Jorge et al. 2021, Eq. 16.
    pub fn t_max_m(&self, setting: usize, passes: &Passes, speed_mps: f64, going: &Going) -> f64 {
        self.ts_m(setting, passes, speed_mps, going).fold(0.0, f64::max)
    }

    /// Returns the first strip that misses a target at a speed.
    ///
    /// `None` if [`Strips::t_max_m`] meets the target.
    pub fn unmet(
        &self,
        setting: usize,
        passes: &Passes,
        speed_mps: f64,
        target_m: f64,
        going: &Going,
    ) -> Option<Unmet> {
        let thin = Thin::of(passes, &self.sets);
        let is_met = |limit: Limit| limit.meets(target_m, speed_mps, going);
        // The samples on the two sides of a strip matter only if the samples within the strip miss the target.
        let is_unmet = |(k, strip): &(usize, &Strip)| {
            !(self.within(setting, (*k, strip), &thin).is_some_and(is_met)
                || self.across(setting, (*k, strip), &thin).is_some_and(is_met))
        };
        let (k, strip) = self.strips.iter().enumerate().find(is_unmet)?;
        Some(Unmet {
            gap_s: thin.gap_s(strip.set, strip.seen_by).map_or(f64::INFINITY, |gap_s| strip.wait * gap_s),
            t_y_m: self.steps_m.get(setting * self.strips.len() + k).map_or(0.0, |steps| steps[0]),
            width_m: strip.arc.length_m,
        })
    }

    /// Returns the largest speed for a target, m/s, on the assumption that every head sees all of the wall.
    ///
    /// `None` if no speed meets the target.
    pub fn bound_if_all_seen_mps(
        &self,
        setting: usize,
        passes: &Passes,
        target_m: f64,
        going: &Going,
    ) -> Option<f64> {
        let of_setting = self.steps_m.iter().skip(setting * self.strips.len());
        let gap_s = passes.gap_s(passes.heads())?;
        let limit = |(strip, steps): (&Strip, &[f64; 2])| Limit {
            gap_s: strip.wait * gap_s,
            t_y_m: steps[1],
            uneven: None,
        };
        let mut slowest_mps = f64::INFINITY;
        for limit in self.strips.iter().zip(of_setting).map(limit) {
            slowest_mps = slowest_mps.min(limit.speed_mps(target_m, going)?);
        }
        Some(slowest_mps)
    }

    /// Returns the spacing T predicted on each strip at a speed, m.
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

    /// Returns the largest speed at which [`Strips::t_max_m`] meets a target, and the T_y that limits it.
    ///
    /// The same `passes` are assumed at all speeds.
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
        for (k, within, across) in self.limits(setting, passes) {
            let limits = || [within, across].into_iter().flatten();
            let bounds = limits().filter_map(|limit| {
                let speed_mps = limit.speed_mps(target_m, going)?;
                Some(Bound { speed_mps, t_y_m: limit.t_y_m })
            });
            let fastest = bounds.max_by(|a, b| a.speed_mps.total_cmp(&b.speed_mps));
            let t_y_m = limits().map(|limit| limit.t_y_m).fold(f64::INFINITY, f64::min);
            let refused = if within.is_some() && t_y_m >= target_m {
                SamplingError::AngularStep { target_m, t_y_m }
            } else if within.is_some() {
                SamplingError::OffAxis { target_m }
            } else {
                let arc = self.seen_alike(k);
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

    /// Returns two upper bounds of the spacing T for each strip: the first from samples within the strip, the second
    /// from the samples on its two sides.
    ///
    /// The first bound is `None` if no head sees the strip. The second bound is `None` if the strip is not thin.
    fn limits(
        &self,
        setting: usize,
        passes: &Passes,
    ) -> impl Iterator<Item = (usize, Option<Limit>, Option<Limit>)> {
        let thin = Thin::of(passes, &self.sets);
        self.strips.iter().enumerate().map(move |(k, strip)| {
            let (within, across) =
                (self.within(setting, (k, strip), &thin), self.across(setting, (k, strip), &thin));
            (k, within, across)
        })
    }

    fn within(&self, setting: usize, (k, strip): (usize, &Strip), thin: &Thin<'_>) -> Option<Limit> {
        let t_y_m = self.steps_m.get(setting * self.strips.len() + k).map_or(0.0, |steps| steps[0]);
        let gap_s = strip.wait * thin.gap_s(strip.set, strip.seen_by)?;
        let [needed, _] = self.needed(setting, k, thin);
        Some(Limit { gap_s: thin.time_for_s(strip.seen_by, gap_s, needed), t_y_m, uneven: None })
    }

    fn across(&self, setting: usize, (k, strip): (usize, &Strip), thin: &Thin<'_>) -> Option<Limit> {
        (!thin.is_full(strip.set, strip.seen_by) && thin.best_s().is_finite())
            .then(|| {
                let [_, needed] = self.needed(setting, k, thin);
                let (t_y_m, is_left_out) = self.across_m(setting, k, thin);
                let uneven = thin.uneven_ends().filter(|_| is_left_out);
                Limit { gap_s: needed * thin.best_s(), t_y_m, uneven }
            })
            .filter(|limit| limit.t_y_m < self.perimeter_m)
    }

    /// Returns the width of the gap that strip `k` and its thin neighbours form, m.
    ///
    /// The width is the distance between the samples on the gap's two sides. The function also returns whether the
    /// strips are thin only because they lie between the heads' sectors.
    fn across_m(&self, setting: usize, k: usize, gaps: &Thin<'_>) -> (f64, bool) {
        let count = self.strips.len();
        let thin = |number: usize| {
            let number = number % count;
            self.strips.get(number).filter(|strip| !gaps.is_full(strip.set, strip.seen_by)).map(|_| number)
        };
        let forward = (k..k + count).map_while(&thin);
        let back = (1..count).map(|step| k + count - step).map_while(&thin);
        let (mut width_m, mut step_m, mut hidden, mut is_left_out) = (0.0, 0.0_f64, false, true);
        for number in forward.chain(back) {
            let Some(strip) = self.strips.get(number) else {
                debug_assert!(false, "strip {number} is one of {count}");
                continue;
            };
            width_m += strip.arc.length_m;
            hidden |= strip.hidden;
            is_left_out &= strip.seen_by.is_empty() && !strip.hidden;
            step_m = step_m.max(self.steps_m.get(setting * count + number).map_or(0.0, |steps| steps[1]));
        }
        // Pings end at the edge of a sector, but up to one angular step before the edge of a hidden arc.
        (width_m.min(self.perimeter_m) + if hidden { 2.0 * step_m } else { 0.0 }, is_left_out)
    }

    /// Computes, for a setting of the heads, how many passes over each strip must replace a single pass because of lost
    /// returns.
    ///
    /// The numbers are used with [`crate::passes::Passes::lossy`]. `rates` are the losses of each head, `None` for an
    /// absent head.
    ///
    /// Allocates: not if the capacity suffices for the settings.
    pub fn count_losses(&mut self, setting: usize, target_m: f64, rates: &[Option<LossRate>; MAX_HEADS]) {
        let first = setting * self.strips.len();
        self.needed.resize(self.steps_m.len(), [1.0; 2]);
        let lost = |heads: HeadSet| heads.iter().filter_map(|head| *rates.get(head)?);
        let all = HeadSet::first(MAX_HEADS);
        for k in 0..self.strips.len() {
            let (Some(strip), Some(steps_m)) = (self.strips.get(k), self.steps_m.get(first + k)) else {
                debug_assert!(false, "the steps on strip {k} are measured in setting {setting}");
                return;
            };
            let perimeter_m = self.seen_alike(k).length_m;
            let sampled = |t_y_m: f64| Sampled { target_m, t_y_m, perimeter_m };
            let passes = [
                sampled(steps_m[0]).passes_needed(lost(strip.seen_by)),
                sampled(steps_m[1]).passes_needed(lost(all)),
            ];
            if let Some(slot) = self.needed.get_mut(first + k) {
                *slot = passes;
            }
        }
    }

    /// Returns how many passes are needed in place of a single pass, for holes within a strip and for holes across it.
    fn needed(&self, setting: usize, k: usize, thin: &Thin<'_>) -> [f64; 2] {
        let needed = || self.needed.get(setting * self.strips.len() + k).copied();
        if thin.is_lossy() { needed().unwrap_or([1.0; 2]) } else { [1.0; 2] }
    }
}

/// Start and direction, on the perimeter, of the step from one sounding to the next.
struct Reached {
    head: usize,
    arc_m: f64,
    strip: usize,
    forward: bool,
    /// Whether a head's step between two soundings certainly ends in the strip in which it begins.
    is_within: bool,
}

/// Records the distance between two soundings of a head for every strip that the step between them touches or crosses.
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
            debug_assert!(
                false,
                "strip {number} is one of {count}, each with its steps in setting {setting}"
            );
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

fn strip(views: &[View], arc: Arc, perimeter_m: f64) -> Strip {
    let middle_m = arc.from_m + arc.length_m / 2.0;
    let hides = |view: &View| view.hidden.iter().any(|hidden| hidden.has(middle_m, perimeter_m));
    let wait = |view: &View| view.sector.map_or(Some(1.0), |sector| sector.wait(middle_m, perimeter_m));
    let heads = || views.iter().take(MAX_HEADS).enumerate();
    let sees = |(_, view): &(usize, &View)| wait(view).is_some() && !hides(view);
    let seen = || heads().filter(sees);
    Strip {
        arc,
        seen_by: seen().fold(HeadSet::default(), |set, (head, _)| set.with(head)),
        set: 0,
        hidden: views.iter().any(|view| wait(view).is_some() && hides(view)),
        wait: seen().filter_map(|(_, view)| wait(view)).reduce(f64::max).unwrap_or(1.0),
    }
}

/// Returns the number of the strip at an arc length, given a guess.
///
/// The guess is mostly right, because soundings are in order around the wall. If it is wrong, all strips are searched.
fn number_near(strips: &[Strip], arc_m: f64, perimeter_m: f64, guess: usize) -> usize {
    let first_m = strips.first().map_or(0.0, |strip| strip.arc.from_m);
    let from_first_m = math::wrap(arc_m - first_m, perimeter_m);
    let begins = |number: usize| strips.get(number).map(|strip| strip.arc.from_m - first_m <= from_first_m);
    if begins(guess) == Some(true) && begins(guess + 1) != Some(true) {
        return guess;
    }
    strips.iter().rposition(|strip| strip.arc.from_m - first_m <= from_first_m).unwrap_or(0)
}

/// Returns the number of the strip that begins at or nearest before an arc length.
fn number_at(strips: &[Strip], arc_m: f64, perimeter_m: f64) -> usize {
    number_near(strips, arc_m, perimeter_m, strips.len())
}

#[cfg(test)]
mod tests;
