//! Decides which returns are wall: returns near the design profile, and returns that agree with other returns.
//!
//! A return within the tolerance of the design is wall. A return is also wall if an earlier pass found wall with the
//! same deviation nearby. Other successive returns that agree with one another are a *run*, which has odds of being
//! wall; see `origin`.
//!
//! A boulder begins with a single return. So a return waits for the head's next returns before it is classified.

use serde::{Deserialize, Serialize};

use headrace_geometry::math;

use super::origin::{Experience, Extent};
use super::relief::{Found, Pass, Relief};
use super::trust::{Beam, Disagreement, Distrust, HeadTrust, Others};
use super::wall_limits::{PlacedReturn, WallLimits};

/// Classification of a return.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Taken {
    /// The return came from wall.
    Wall,
    /// Uncertain: either wall, or something in the water.
    Doubtful,
    /// The return came from something in the water, or by a second path.
    Other,
    /// Pending: the head's next returns decide.
    Waits,
}

/// Decisions on a head's returns, made when its newest return arrives.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sorted {
    /// Classification of all waiting returns. `None` if no return waits, or if they go on waiting.
    pub waiting: Option<Taken>,
    /// Classification of the newest return.
    pub this: Taken,
    /// Whether another head has found the same wall as the newest return. This head's range must also follow a wall.
    pub is_confirming: bool,
    /// Reason for distrusting the head from the newest return on, and chainages of its recent returns, m.
    pub distrusted: Option<(Distrust, [f64; 2])>,
}

/// Maximum number of a head's returns that wait for classification.
pub const MOST_WAITING: usize = 24;
/// A run: successive returns that agree only with one another.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
struct Run {
    waiting: [PlacedReturn; MOST_WAITING],
    waits: u8,
    /// First return and number of returns of the run, including returns that have already been classified.
    first: Option<PlacedReturn>,
    all: u32,
    /// Largest distance of the run from the design, and its width, m.
    off_m: f64,
    width_m: f64,
    /// Number of earlier passes that met the same thing, summed over all returns of the run.
    confirmed: u32,
    /// Number of earlier passes that met the same thing, for each waiting return.
    confirmed_each: [u8; MOST_WAITING],
    /// Number of the run's ends that slope to the wall.
    slopes: u8,
    /// Whether the run is certain to be wall, so that its next returns need not wait.
    is_wall: bool,
}

impl Run {
    /// Number of the run's returns that wait for classification.
    fn count(&self) -> u32 {
        u32::from(self.waits)
    }

    /// Returns the run's waiting returns, each with the number of earlier passes that met the same thing.
    fn returns(&self) -> impl Iterator<Item = (&PlacedReturn, u8)> {
        self.waiting.iter().zip(self.confirmed_each).take(usize::from(self.waits))
    }

    /// Adds a return to the run. It waits for classification.
    fn add(&mut self, placed: &PlacedReturn, confirmed: u8, limits: &WallLimits) {
        debug_assert!(!self.is_full(), "a run is given up when {MOST_WAITING} returns wait: {}", self.waits);
        let first = *self.first.get_or_insert(*placed);
        self.all += 1;
        self.confirmed += u32::from(confirmed);
        self.off_m = self.off_m.max(placed.off_m.abs());
        // Each return represents a width of one step, half a step on either side of it.
        let steps = f64::from(self.all.max(2)) / f64::from(self.all.max(2) - 1);
        self.width_m = self.width_m.max(steps * limits.width_m(&first, placed)).max(limits.step_m(placed));
        let at = usize::from(self.waits);
        if let (Some(slot), Some(each)) = (self.waiting.get_mut(at), self.confirmed_each.get_mut(at)) {
            (*slot, *each) = (*placed, confirmed);
            self.waits += 1;
        }
    }

    /// Size of the run, with the mean number of passes that confirmed its returns.
    fn extent(&self) -> Extent {
        let confirmed = f64::from(self.confirmed) / f64::from(self.all.max(1));
        Extent { width_m: self.width_m, off_m: self.off_m, confirmed, slopes: self.slopes }
    }

    /// Whether the run is farther out than the design profile.
    fn is_behind(&self) -> bool {
        self.first.is_some_and(|first| first.off_m > 0.0)
    }

    /// Whether no more returns can wait.
    fn is_full(&self) -> bool {
        usize::from(self.waits) == MOST_WAITING
    }

    /// Removes all waiting returns except the latest, which is `last`.
    fn give_up(&mut self, last: &PlacedReturn) {
        let confirmed =
            self.waits.checked_sub(1).and_then(|at| self.confirmed_each.get(usize::from(at)).copied());
        (self.waiting[0], self.confirmed_each[0], self.waits) = (*last, confirmed.unwrap_or(0), 1);
    }
}

/// The latest returns of a head, and the trust in it.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct HeadWall {
    /// The two latest returns with their classification. The newer one comes first.
    last: [Option<(PlacedReturn, Taken)>; 2],
    /// The run of returns that wait for classification.
    run: Run,
    /// Experience with runs inside the design profile, and with runs outside it.
    experience: [Experience; 2],
    /// Angle of the latest beam, and angle turned since the start of the dive, rad.
    angle_rad: f64,
    turned_rad: f64,
    trust: HeadTrust,
}

impl HeadWall {
    /// Reason for distrusting the head; `None` if it is trusted.
    pub fn distrusted(&self) -> Option<Distrust> {
        self.trust.distrusted()
    }

    /// Classifies the head's next return, and the returns that have waited for it.
    ///
    /// `beam` is the beam of the next return.
    ///
    /// Allocates: never.
    pub fn sort(
        &mut self,
        head: usize,
        placed: PlacedReturn,
        beam: &Beam<'_>,
        limits: &WallLimits,
        relief: &mut Relief,
    ) -> Sorted {
        let [last, last_but_one] =
            self.last.map(|before| before.filter(|(other, _)| limits.agree(&placed, other)));
        let is_of_wall =
            |other: Option<(PlacedReturn, Taken)>| other.is_some_and(|(_, taken)| taken == Taken::Wall);
        let is_design = limits.is_design(&placed);
        let is_wall = is_design || relief.is_wall(&placed, limits);
        let slopes = is_of_wall(last) || is_of_wall(last_but_one);
        let before = self.last[0].map(|(other, _)| other);
        let pass = self.pass(head, beam);
        let confirmed = if is_wall { 0 } else { relief.confirmed(&placed, &pass, limits) };
        let (waited, waiting, this) =
            self.decide((&placed, confirmed), (is_wall, last.is_some(), slopes), limits);
        relief.vote(head, &placed, limits);
        let both_design = is_design && before.is_some_and(|other| limits.is_design(&other));
        let jump_m =
            before.filter(|_| last.is_none() && !both_design).map(|other| placed.off_m - other.off_m);
        let is_rejected = matches!(waiting, Some(Taken::Doubtful | Taken::Other));
        let doubtful = if is_rejected { waited.count() } else { 0 };
        let others = Others { ballot: relief.ballot(head), change: relief.others_change(head) };
        let distrusted = self.trust.note(&placed, beam, Disagreement { jump_m, doubtful }, limits, &others);
        relief.note_changing(head, !self.trust.is_stuck(limits));
        relief.believe(head, self.distrusted().is_none());
        if self.distrusted().is_some() {
            self.run = Run::default();
            self.last[0] = Some((placed, Taken::Other));
            let waiting = (waited.count() > 0).then_some(Taken::Other);
            return Sorted { waiting, this: Taken::Other, is_confirming: false, distrusted };
        }
        // Heads that are frozen at one range must not confirm each other.
        let is_confirming = this == Taken::Wall
            && !is_design
            && self.trust.follows_a_wall()
            && relief.is_wall_of_another(&placed, pass.head, limits);
        if let Some(taken) = waiting {
            let found = |(other, passes)| Found::new(other, taken == Taken::Wall, passes, pass);
            waited.returns().for_each(|other| relief.remember(&found(other), limits));
        }
        if this == Taken::Wall {
            relief.remember(&Found::new(&placed, true, confirmed, pass), limits);
        }
        Sorted { waiting, this, is_confirming, distrusted }
    }

    /// Turns the head to the next beam, and returns the pass to which it belongs.
    fn pass(&mut self, head: usize, beam: &Beam<'_>) -> Pass {
        self.turned_rad += math::wrap_signed(beam.angle_rad - self.angle_rad, math::TAU).abs();
        self.angle_rad = beam.angle_rad;
        Pass { head: u8::try_from(head).unwrap_or(u8::MAX), turned_rad: self.turned_rad }
    }

    /// Classifies a head's new return and the returns that wait for it.
    ///
    /// `confirmed` is the number of earlier passes that met the same thing. `agrees` means that the new return agrees
    /// with the head's previous return. `slopes` means that it agrees with one of the two previous returns, and that
    /// this one is wall. Returns the run of waiting returns, its classification (`None` if undecided), and the
    /// classification of the new return.
    fn decide(
        &mut self,
        (placed, confirmed): (&PlacedReturn, u8),
        (is_wall, agrees, slopes): (bool, bool, bool),
        limits: &WallLimits,
    ) -> (Run, Option<Taken>, Taken) {
        let mut waited = self.run;
        let goes_on = !is_wall && agrees && waited.all > 0;
        let mut run = if goes_on { waited } else { Run { slopes: u8::from(slopes), ..Run::default() } };
        if is_wall {
            waited.slopes += u8::from(agrees);
        } else {
            run.add(placed, confirmed, limits);
        }
        run.is_wall = !is_wall && (run.is_wall || self.log_odds(&run, limits) >= limits.sure_log_odds);
        let this = if is_wall || run.is_wall { Taken::Wall } else { Taken::Waits };
        let waiting = match waited.count() {
            0 => None,
            _ if goes_on && run.is_wall => Some(Taken::Wall),
            _ if !goes_on || run.is_full() => Some(self.taken(&waited, limits)),
            _ => None,
        };
        if run.is_wall && !(goes_on && waited.is_wall) {
            self.note(&run, limits);
        } else if waiting.is_some() {
            self.note(&waited, limits);
        }
        if this == Taken::Wall {
            run.waits = 0;
        } else if waiting.is_some() && goes_on {
            run.give_up(placed);
        }
        self.run = if is_wall { Run::default() } else { run };
        let settled = |(other, taken): (PlacedReturn, Taken)| {
            (other, waiting.filter(|_| taken == Taken::Waits).unwrap_or(taken))
        };
        self.last = [Some((*placed, this)), self.last[0].map(settled)];
        (waited, waiting, this)
    }

    /// Log odds that a run is wall.
    fn log_odds(&self, run: &Run, limits: &WallLimits) -> f64 {
        let [front, behind] = &self.experience;
        let experience = if run.is_behind() { behind } else { front };
        experience.log_odds(&run.extent(), limits.radius_m)
    }

    /// Classification of a run that has ended or cannot wait longer.
    fn taken(&self, run: &Run, limits: &WallLimits) -> Taken {
        let log_odds = self.log_odds(run, limits);
        if log_odds >= limits.sure_log_odds {
            Taken::Wall
        } else if log_odds > -limits.sure_log_odds {
            Taken::Doubtful
        } else {
            Taken::Other
        }
    }

    /// Adds a classified run to the experience with runs on its side of the design profile.
    fn note(&mut self, run: &Run, limits: &WallLimits) {
        let log_odds = self.log_odds(run, limits);
        let [front, behind] = &mut self.experience;
        let experience = if run.is_behind() { behind } else { front };
        experience.add(log_odds);
    }
}

#[cfg(test)]
mod tests;
