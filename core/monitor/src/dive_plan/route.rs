//! Order, direction and speed of the remaining passes.
//!
//! The vehicle must return to the portal. It therefore drives from its place to a turning point and back, and every
//! pass is added to this route on the way that costs the least time:
//!
//! - inward, while the vehicle goes to the turning point;
//! - outward, while it comes back;
//! - inward, by a loop on the way back. Heads that are apart along the hull are in phase at other speeds on the way
//!   out, so a loop can be faster than a slow pass outward.
//!
//! For each turning point the times of the passes do not depend on each other. The best selection for each turning
//! point therefore gives the best route.

use serde::{Deserialize, Serialize};

use super::selection::{Ahead, MOST_PASSES, Offer, Selection, select};
use headrace_coverage::{Causes, RunId};

/// Number of steps that screens show.
pub const SHOWN_STEPS: usize = 3;
/// Distance that needs no step of its own, m.
const NEAR_M: f64 = 0.05;
/// Lengths that need no mention, m.
pub(super) const LITTLE_M: f64 = 0.05;

/// Pass over a missed stretch. Chainages are those of the vehicle's origin.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pass {
    /// Number of the missed stretch.
    pub run: RunId,
    /// End of the pass nearer to the portal, with run-up, m.
    pub near_m: f64,
    /// Other end of the pass, with run-up, m.
    pub far_m: f64,
    /// Missed length that the pass covers, m.
    pub missed_m: f64,
    /// Largest speed inwards, m/s.
    pub inward_mps: f64,
    /// Largest speed outwards, m/s; zero if no speed meets the target on the way out.
    pub outward_mps: f64,
    /// Whether the speeds are known to meet the target.
    pub is_speed_known: bool,
    /// Roll of the first pass; two passes are due if it is [`Roll::Left`].
    pub roll: Roll,
    /// Changes that the pass needs.
    pub changes: Changes,
}

/// Causes of a missed stretch, from which the changes for the next pass follow.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Changes {
    /// Causes that texts name.
    pub causes: Causes,
    /// Whether so many returns are missing that no speed makes up for them.
    pub is_beyond_speed: bool,
}

/// Side to which the vehicle rolls during a pass.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Roll {
    /// The vehicle stays level.
    Level,
    /// The vehicle is rolled left.
    Left,
    /// The vehicle is rolled right.
    Right,
}

/// Tunnel ahead that has not been inspected.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Onward {
    /// Chainage from which the vehicle goes on, m.
    pub from_m: f64,
    /// End of the tunnel or of the cable, m.
    pub to_m: f64,
    /// Largest speed, m/s.
    pub at_most_mps: f64,
}

/// Start and limits of a route.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Start {
    /// Chainage of the vehicle, m.
    pub x_m: f64,
    /// Chainage at which the dive ends, m: the portal.
    pub home_m: f64,
    /// Speed without inspecting, m/s.
    pub transit_mps: f64,
    /// Remaining time, s; `None` if it is unlimited.
    pub left_s: Option<f64>,
    /// Pass that has begun and is finished first. It reaches from the vehicle to the end of the pass.
    pub begun: Option<DiveStep>,
}

/// Kind of a step.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum StepKind {
    /// Drive to a chainage at any speed.
    Go,
    /// Pass a missed stretch again.
    Inspect,
    /// Inspect the tunnel ahead.
    GoOn,
    /// Drive back to the portal at any speed.
    Home,
}

/// Step of a plan.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct DiveStep {
    /// Kind of the step.
    pub kind: StepKind,
    /// Chainage at which the step begins, m.
    pub from_m: f64,
    /// Chainage at which the step ends, m.
    pub to_m: f64,
    /// Largest speed, m/s; `None` for any speed, or if no speed is known to meet the target.
    pub at_most_mps: Option<f64>,
    /// Roll of the vehicle.
    pub roll: Roll,
    /// Missed stretch that the step passes.
    pub run: Option<RunId>,
    /// Changes that the step needs.
    pub changes: Changes,
    /// Time from now to the end of the step, s.
    pub ends_s: f64,
}

/// Plan for the rest of the dive.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct DivePlan {
    /// The next steps, in order.
    pub steps: [Option<DiveStep>; SHOWN_STEPS],
    /// Number of all steps.
    pub step_count: u16,
    /// Time to the end of the dive at the portal, s.
    pub takes_s: f64,
    /// Remaining time, s; `None` if it is unlimited.
    pub left_s: Option<f64>,
    /// Missed length for which the remaining time is too short, m.
    pub stays_missed_m: f64,
    /// Length of tunnel ahead for which the remaining time is too short, m.
    pub stays_ahead_m: f64,
}

impl DivePlan {
    /// Whether the dive can end at the portal in time.
    pub fn is_in_time(&self) -> bool {
        self.left_s.is_none_or(|left_s| self.takes_s <= left_s + 1.0)
    }

    /// Whether all missed stretches and the tunnel ahead fit into the remaining time.
    pub fn all_fits(&self) -> bool {
        self.is_in_time() && self.stays_missed_m <= LITTLE_M && self.stays_ahead_m <= LITTLE_M
    }
}

/// Way on which a pass is made.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Way {
    /// Inward before the vehicle goes on.
    FirstInward,
    /// Inward while the vehicle goes on.
    GoingInward,
    /// Outward on the way back.
    ComingOutward,
    /// Inward by a loop on the way back.
    ComingInward,
}

impl Pass {
    fn count(&self) -> f64 {
        if self.roll == Roll::Left { 2.0 } else { 1.0 }
    }

    /// Time that the pass adds to a route to a turning point and home, by way; infinite if it is impossible.
    fn more_s(&self, way: Way, start: &Start, turn: Turn) -> f64 {
        let (length_m, count, transit) = (self.far_m - self.near_m, self.count(), 1.0 / start.transit_mps);
        let is_reached = self.far_m <= turn.at_m;
        // From the end of the pass, the vehicle comes back to where it goes on, and passes this part once more.
        let twice_s = 2.0 * (self.far_m - turn.on_from_m).max(0.0) * transit;
        let passes_s = |mps: f64| length_m * (count / mps.min(start.transit_mps) + (count - 1.0) * transit);
        match way {
            Way::FirstInward if self.near_m < start.x_m && start.x_m < self.far_m && is_reached => {
                (2.0 * start.x_m - self.near_m - self.far_m) * transit + passes_s(self.inward_mps) + twice_s
            }
            Way::GoingInward if self.near_m >= start.x_m && is_reached => {
                passes_s(self.inward_mps) - length_m * transit + twice_s
            }
            Way::ComingOutward if is_reached && self.outward_mps > 0.0 => {
                passes_s(self.outward_mps) - length_m * transit
            }
            Way::ComingInward if is_reached || self.near_m < start.x_m => {
                passes_s(self.inward_mps) + length_m * transit
            }
            _ => f64::INFINITY,
        }
    }

    /// Way that adds the least time, and this time, s.
    fn best_way(&self, start: &Start, turn: Turn) -> Option<(Way, f64)> {
        let ways = [Way::GoingInward, Way::FirstInward, Way::ComingOutward, Way::ComingInward];
        let timed = ways.map(|way| (way, self.more_s(way, start, turn)));
        timed.into_iter().reduce(|a, b| if b.1 < a.1 { b } else { a }).filter(|(_, s)| s.is_finite())
    }

    /// Share of the pass that covers no missed wall.
    fn run_up_share(&self) -> f64 {
        (1.0 - self.missed_m / (self.far_m - self.near_m)).max(0.0)
    }

    fn offer(&self, way: Way, more_s: f64) -> Offer {
        let may_be_part = self.roll != Roll::Left && way != Way::FirstInward;
        let run_up_share = may_be_part.then(|| self.run_up_share());
        Offer { missed_m: self.missed_m, more_s, run_up_share }
    }
}

/// Turning point of a route, and the chainage from which the vehicle goes on into the tunnel ahead, m.
#[derive(Debug, Clone, Copy)]
struct Turn {
    at_m: f64,
    /// Infinite if the vehicle does not go on.
    on_from_m: f64,
}

/// Wall at the turning point of a route, of which any part can be covered.
#[derive(Debug, Clone, Copy)]
enum End {
    /// The route turns at a pass or at the vehicle.
    Nothing,
    /// The tunnel ahead.
    Onward(Onward),
    /// A pass inward, by its number.
    Pass(usize),
}

/// Route to a turning point and back, with the selected passes.
#[derive(Clone, Copy)]
struct Route {
    ways: [Option<Way>; MOST_PASSES],
    selection: Selection,
    end: End,
    /// Time of the whole route, s.
    takes_s: f64,
}

/// The plan that covers the most wall within the remaining time, in the least time.
///
/// `passes` are disjoint and ascending, at most `MOST_PASSES`. Speeds above the transit speed count as the transit
/// speed. Allocates: never.
pub fn plan(start: &Start, passes: &[Pass], onward: Option<Onward>) -> DivePlan {
    let mut writer = Writer::new(start);
    if let Some(begun) = &start.begun {
        writer.pass(begun.to_m, begun.at_most_mps.unwrap_or(start.transit_mps), begun);
    }
    let time_s = start.left_s.map_or(f64::INFINITY, |left_s| left_s - writer.time_s);
    let start = &Start { x_m: writer.x_m, ..*start };
    let onward = onward.filter(|onward| onward.to_m > onward.from_m + NEAR_M);
    let best = best_route(start, passes, onward, time_s);
    writer.write(&best, passes);
    writer.go(start.home_m, StepKind::Home);
    let all_m: f64 = passes.iter().map(|pass| pass.missed_m).sum();
    let all_ahead_m = onward.map_or(0.0, |onward| onward.to_m - onward.from_m);
    let ahead_m = if matches!(best.end, End::Onward(_)) { best.selection.ahead.1 } else { 0.0 };
    DivePlan {
        steps: writer.steps,
        step_count: writer.count,
        takes_s: writer.time_s,
        left_s: start.left_s,
        stays_missed_m: (all_m + ahead_m - best.selection.covered_m).max(0.0),
        stays_ahead_m: all_ahead_m - ahead_m,
    }
}

/// The best of the routes to all turning points: the vehicle, passes ahead of it, and the tunnel ahead.
fn best_route(start: &Start, passes: &[Pass], onward: Option<Onward>, time_s: f64) -> Route {
    let mut best = route_by(start, passes, (start.x_m, End::Nothing), time_s);
    let mut compare = |turn_m: f64, end: End| {
        let route = route_by(start, passes, (turn_m, end), time_s);
        best = if route.is_better(&best) { route } else { best };
    };
    for (number, pass) in passes.iter().enumerate().filter(|(_, pass)| pass.far_m > start.x_m) {
        compare(pass.far_m, End::Nothing);
        if pass.near_m >= start.x_m && pass.roll != Roll::Left {
            compare(pass.near_m, End::Pass(number));
        }
    }
    if let Some(onward) = onward {
        compare(onward.from_m.max(start.x_m), End::Onward(onward));
        // Passes may reach into the tunnel ahead by their run-up.
        let within = passes.iter().map(|pass| pass.far_m).filter(|far_m| *far_m <= onward.to_m);
        compare(within.fold(onward.from_m.max(start.x_m), f64::max), End::Onward(onward));
    }
    best
}

fn route_by(start: &Start, passes: &[Pass], (turn_m, end): (f64, End), time_s: f64) -> Route {
    let transit = 1.0 / start.transit_mps;
    let there_and_back_s = |length_m: f64, mps: f64| length_m * (1.0 / mps.min(start.transit_mps) + transit);
    let way_s = (turn_m - start.x_m + (turn_m - start.home_m).abs()) * transit;
    let (mut ways, mut offers) = ([None; MOST_PASSES], [None; MOST_PASSES]);
    let on_from_m = if let End::Onward(onward) = end { onward.from_m } else { f64::INFINITY };
    let turn = Turn { at_m: turn_m, on_from_m };
    for ((pass, way), offer) in passes.iter().zip(&mut ways).zip(&mut offers) {
        if let Some((best, more_s)) = pass.best_way(start, turn) {
            (*way, *offer) = (Some(best), Some(pass.offer(best, more_s)));
        }
    }
    let ahead = match end {
        End::Nothing => None,
        End::Onward(Onward { from_m, to_m, at_most_mps }) => {
            let beyond_m = turn_m - from_m.max(start.x_m);
            let more_s = there_and_back_s(to_m - from_m, at_most_mps) - 2.0 * beyond_m * transit;
            Some(Ahead { length_m: to_m - from_m, more_s, run_up_share: 0.0, is_whole: beyond_m > 0.0 })
        }
        End::Pass(number) => passes.get(number).map(|pass| {
            let more_s = there_and_back_s(pass.far_m - pass.near_m, pass.inward_mps);
            Ahead { length_m: pass.missed_m, more_s, run_up_share: pass.run_up_share(), is_whole: false }
        }),
    };
    let selection = if way_s <= time_s {
        select(offers.get(..passes.len()).unwrap_or_default(), ahead, time_s - way_s)
    } else {
        Selection::default()
    };
    Route { ways, selection, end, takes_s: way_s + selection.more_s }
}

impl Route {
    fn is_better(&self, than: &Self) -> bool {
        let all = |route: &Self| Selection { more_s: route.takes_s, ..route.selection };
        all(self).is_better(&all(than))
    }
}

/// Steps written so far, with the place and time of the vehicle after them.
struct Writer {
    x_m: f64,
    time_s: f64,
    transit_mps: f64,
    steps: [Option<DiveStep>; SHOWN_STEPS],
    count: u16,
}

impl Writer {
    fn new(start: &Start) -> Self {
        let Start { x_m, transit_mps, .. } = *start;
        Self { x_m, time_s: 0.0, transit_mps, steps: [None; SHOWN_STEPS], count: 0 }
    }

    fn write(&mut self, route: &Route, passes: &[Pass]) {
        let share = |number: usize| match route.selection.part {
            _ if route.selection.has(number) => Some(1.0),
            Some((part, share)) if part == number => Some(share),
            _ => None,
        };
        let legs = || {
            let numbered = passes.iter().zip(route.ways).enumerate();
            numbered.filter_map(|(number, (pass, way))| Some((pass, way?, share(number)?)))
        };
        let is_first = |way: Way| matches!(way, Way::FirstInward | Way::GoingInward);
        for (pass, _, share) in legs().filter(|(_, way, _)| is_first(*way)) {
            self.inspect(pass, true, share);
        }
        self.write_end(route, passes);
        for (pass, way, share) in legs().rev().filter(|(_, way, _)| !is_first(*way)) {
            self.inspect(pass, way == Way::ComingInward, share);
        }
    }

    /// Adds the wall at the turning point.
    fn write_end(&mut self, route: &Route, passes: &[Pass]) {
        let (share, _) = route.selection.ahead;
        match route.end {
            End::Onward(Onward { from_m, to_m, at_most_mps }) if share > 0.0 => {
                self.go(from_m, StepKind::Go);
                let step = DiveStep { at_most_mps: Some(at_most_mps), ..self.step(StepKind::GoOn) };
                self.pass(from_m + share * (to_m - from_m), at_most_mps, &step);
            }
            End::Pass(number) if share > 0.0 => {
                passes.get(number).into_iter().for_each(|pass| self.inspect(pass, true, share));
            }
            End::Onward(_) | End::Pass(_) | End::Nothing => {}
        }
    }

    /// Adds a pass, or the given share of it.
    fn inspect(&mut self, pass: &Pass, is_inward: bool, share: f64) {
        let length_m = (pass.far_m - pass.near_m) * share;
        let (from_m, to_m, mps) = if is_inward {
            (pass.near_m, pass.near_m + length_m, pass.inward_mps)
        } else {
            (pass.far_m, pass.far_m - length_m, pass.outward_mps)
        };
        let rolls = if pass.roll == Roll::Left {
            [Some(Roll::Left), Some(Roll::Right)]
        } else {
            [Some(pass.roll), None]
        };
        for roll in rolls.into_iter().flatten() {
            self.go(from_m, StepKind::Go);
            let at_most_mps = pass.is_speed_known.then_some(mps);
            let step = DiveStep { at_most_mps, roll, changes: pass.changes, ..self.step(StepKind::Inspect) };
            let step = DiveStep { run: Some(pass.run), ..step };
            self.pass(to_m, mps, &step);
        }
    }

    fn step(&self, kind: StepKind) -> DiveStep {
        let (x_m, time_s) = (self.x_m, self.time_s);
        DiveStep {
            kind,
            from_m: x_m,
            to_m: x_m,
            at_most_mps: None,
            roll: Roll::Level,
            run: None,
            changes: Changes::default(),
            ends_s: time_s,
        }
    }

    /// Drives to a chainage at the transit speed. A short way is no step of its own.
    fn go(&mut self, to_m: f64, kind: StepKind) {
        let way_m = (to_m - self.x_m).abs();
        if way_m > NEAR_M {
            let step = self.step(kind);
            self.pass(to_m, self.transit_mps, &step);
        } else {
            (self.x_m, self.time_s) = (to_m, self.time_s + way_m / self.transit_mps);
        }
    }

    /// Drives to a chainage at a speed, as a step like the given one.
    fn pass(&mut self, to_m: f64, mps: f64, like: &DiveStep) {
        self.time_s += (to_m - self.x_m).abs() / mps.min(self.transit_mps);
        if let Some(slot) = self.steps.get_mut(usize::from(self.count)) {
            *slot = Some(DiveStep { from_m: self.x_m, to_m, ends_s: self.time_s, ..*like });
        }
        self.x_m = to_m;
        self.count += 1;
    }
}

#[cfg(test)]
mod tests;
