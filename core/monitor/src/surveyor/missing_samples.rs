//! Finds missing samples: lost pings, pings that silent and stalled heads would have made, and pings without
//! a fix.
//!
//! A silent or stalled head is assumed to turn on at its last rate. At each advice update, the points are
//! recorded at which its pings would have met the design. Pings without a fix are recorded as soon as there
//! is a fix again. They are placed along the straight line between the two fixes.

use serde::{Deserialize, Serialize};

use super::heads::Heads;
use crate::messages::{Hidden, Outcome, PlacedPing};
use crate::resources::Coverage;
use headrace_coverage::{Cause, Causes, Drive, Loss, MissingSample, MissingSamples};
use headrace_geometry::frames::{Mount, Pose, Vec3, head_direction};
use headrace_geometry::math::{self, TAU};
use headrace_geometry::snapshot::stateful;
use headrace_geometry::time::{DurNs, MonoNs};
use headrace_geometry::tunnel::{Profile, WallPoint};
use headrace_sampling::head::{HeadMotion, HeadSet, MAX_HEADS};
use headrace_sampling::losses::LossRate;
use headrace_sampling::passes::Situation;

/// Time without a ping at a new angle after which a head's samples count as missing.
const LACKING_AFTER: DurNs = DurNs(400_000_000);
/// Number of latest pings at angles assumed to be occluded that decide whether the angles are really occluded, and
/// share of lost pings that confirms it.
const HIDDEN_PINGS: u16 = 600;
const HIDDEN_SHARE: f64 = 0.7;
/// Maximum number of pings without a fix that are kept. It suffices for over two minutes of four heads.
const ROOM: usize = 1 << 15;

/// State of a head as last seen turning.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
struct Turning {
    /// Time of the last advice update at which the head turned, and the head's angle, radians, rate, rad/s,
    /// and step, radians, at that time.
    seen: Option<(MonoNs, f64, f64, f64)>,
    /// Time of the last ping, and of the last ping at a new angle.
    pinged: Option<MonoNs>,
    moved: Option<MonoNs>,
    /// Time up to which the head's missing samples have been recorded.
    noted: Option<MonoNs>,
    /// Longest range at the head's range setting, m.
    longest_m: f64,
    /// Latest pings at angles that the vehicle is assumed to occlude: number without a return, and total.
    hidden: [u16; 2],
    /// Whether the last simulated ping was lost.
    would_lose: bool,
}

impl Turning {
    fn note_hidden(&mut self, is_hidden: bool, is_lost: bool) {
        if !is_hidden {
            return;
        }
        self.hidden = [self.hidden[0] + u16::from(is_lost), self.hidden[1] + 1];
        if self.hidden[1] >= HIDDEN_PINGS {
            self.hidden = self.hidden.map(|count| count / 2);
        }
    }

    /// Decides at random whether a simulated ping is lost, at the head's loss rate.
    ///
    /// The random number depends only on the time of the ping.
    fn would_lose(&mut self, when: MonoNs, rate: LossRate) -> bool {
        let LossRate { share, after_lost } = rate;
        // The loss rate after a return is unknown if all pings were lost, or if every loss was followed by
        // another loss.
        let is_known = share < 1.0 && after_lost < 1.0;
        let after_heard = if is_known { share * (1.0 - after_lost) / (1.0 - share) } else { share };
        let chance = if self.would_lose { after_lost } else { after_heard };
        self.would_lose = unit_of(when.0) < chance;
        self.would_lose
    }

    /// Whether the vehicle really occludes the angles at which occlusion is assumed.
    fn is_hidden(&self) -> bool {
        let [lost, all] = self.hidden;
        HIDDEN_SHARE * f64::from(all) <= f64::from(lost)
    }
}

/// A ping to be placed: a real ping without a fix, or a simulated ping of a silent or stalled head.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
struct Away {
    at: MonoNs,
    head: u8,
    angle_rad: f64,
    /// Causes known so far, including a missing position. A ping without a return gets further causes once the
    /// point is known at which its beam meets the design.
    why: Causes,
    is_lost: bool,
}

/// Finder of missing samples, with data of earlier updates and pings.
#[derive(Debug, Clone)]
pub(crate) struct MissingSampleFinder {
    heads: [Turning; MAX_HEADS],
    /// Time and pose of the last advice update with a fix.
    pose: Option<(MonoNs, Pose)>,
    away: Vec<Away>,
    /// Whether pings without a fix were dropped for lack of room.
    forgot: bool,
    /// Heads that have stalled and have not been in phase since.
    pub(super) stalled: HeadSet,
    /// Deaf heads as of the last advice update: heads that turn and ping without detecting the wall.
    deaf: HeadSet,
}

stateful!(MissingSampleFinder { state: heads, pose, forgot, stalled, deaf; lists: away; });

impl Default for MissingSampleFinder {
    /// Creates a finder of missing samples. Allocates: at startup, all memory of the finder.
    fn default() -> Self {
        Self {
            heads: [Turning::default(); MAX_HEADS],
            pose: None,
            away: Vec::with_capacity(ROOM),
            forgot: false,
            stalled: HeadSet::default(),
            deaf: HeadSet::default(),
        }
    }
}

impl MissingSampleFinder {
    /// Whether every head that pings also turns, so that each ping is at a new angle.
    pub(super) fn all_turn(&self, at: MonoNs) -> bool {
        let turns = |moved: MonoNs| at.since(moved).0 <= LACKING_AFTER.0;
        self.heads.iter().filter_map(|head| head.moved).all(turns)
    }

    /// The situation as if no head were silent or stalled. Such heads are assumed to continue turning at
    /// their last rate.
    pub(super) fn healthy(&mut self, at: MonoNs, situation: &Situation, heads: &Heads<'_, '_>) -> Situation {
        let stalled = self.stalled;
        let mut healthy = *situation;
        for (number, mounted, ..) in heads {
            let slot = self.heads.get_mut(number.0).zip(healthy.heads.get_mut(number.0));
            let Some((head, motion)) = slot else { continue };
            match motion {
                Some(motion) if !stalled.has(number.0) => {
                    let turns_on = motion.sector_rad.is_none();
                    head.seen =
                        turns_on.then_some((at, motion.angle_rad, motion.rate_radps, motion.step_rad));
                }
                _ => {
                    let Some((seen, angle_rad, rate_radps, step_rad)) = head.seen else { continue };
                    let angle_rad = angle_rad + rate_radps * at.since(seen).as_secs_f64();
                    let mount = mounted.info.mount;
                    *motion = Some(HeadMotion { mount, angle_rad, rate_radps, step_rad, sector_rad: None });
                }
            }
        }
        healthy
    }
}

/// Records a ping. If the ping was aimed at the wall and gave no return, it is a missing sample.
pub(super) fn note_ping(
    missing_finder: &mut MissingSampleFinder,
    ping: &PlacedPing,
    missing_samples: &mut MissingSamples,
) {
    if ping.standing {
        missing_finder.stalled = missing_finder.stalled.with(ping.head);
    }
    let MissingSampleFinder { heads, away, forgot, deaf, .. } = missing_finder;
    let Some(head) = heads.get_mut(ping.head) else { return };
    head.pinged = Some(ping.valid_at);
    head.longest_m = ping.longest_m;
    if ping.standing {
        return;
    }
    head.moved = Some(ping.valid_at);
    match ping.outcome {
        Outcome::Sample { .. } => head.note_hidden(ping.hidden == Hidden::Yes, false),
        Outcome::Lost(loss, Some(WallPoint { x_m, arc_m })) => {
            head.note_hidden(loss == Loss::Occluded, true);
            // If other pings at angles assumed to be occluded detect the wall, a lost ping there is a missing
            // return.
            let heard = loss == Loss::Occluded && !head.is_hidden();
            let cause = match loss {
                Loss::Missing if deaf.has(ping.head) => Cause::HeadSilent,
                Loss::Occluded if heard => Cause::MissingReturns,
                loss => Cause::of_loss(loss),
            };
            // The vehicle would occlude this wall even with a longer range setting, so occlusion is a further cause.
            let stays = loss == Loss::OutOfRange && ping.hidden == Hidden::Yes && head.is_hidden();
            let why = if stays { Causes::of(cause).with(Cause::Occluded) } else { Causes::of(cause) };
            missing_samples.add(MissingSample {
                x_m,
                arc_m,
                head: number_of(ping.head),
                why,
                may_be_wall: false,
            });
        }
        Outcome::Lost(_, None) | Outcome::Unplaced(_) if ping.fix.is_none() => {
            let is_lost = !matches!(ping.outcome, Outcome::Unplaced(_));
            let why = Causes::of(Cause::PositionLost);
            let head = number_of(ping.head);
            let away_ping = Away { at: ping.valid_at, head, angle_rad: ping.angle_rad, why, is_lost };
            *forgot |= !keep(away, away_ping);
        }
        Outcome::Lost(_, None) | Outcome::Unplaced(_) => {}
    }
}

/// The integer type in which a head's number is stored.
pub(super) fn number_of(head: usize) -> u8 {
    u8::try_from(head).unwrap_or(u8::MAX)
}

/// Records the heads that ping without detecting the wall. Their losses in the last turn are not random.
fn note_deaf(missing_finder: &mut MissingSampleFinder, deaf: HeadSet, coverage: &mut Coverage) {
    let before = core::mem::replace(&mut missing_finder.deaf, deaf);
    for head in deaf.iter().filter(|head| !before.has(*head)) {
        let Some((.., step_rad)) = missing_finder.heads.get(head).and_then(|turning| turning.seen) else {
            continue;
        };
        let turn = usize::try_from(math::floor_to_i64(TAU / step_rad)).unwrap_or(0);
        let causes = [Cause::MissingReturns, Cause::HeadSilent];
        let Some([from_m, to_m]) = coverage.missing_samples.revise(number_of(head), turn, causes) else {
            continue;
        };
        let sections = &mut coverage.sections;
        for index in sections.index_of(from_m)..=sections.index_of(to_m) {
            if let Some(section) = sections.get_mut(index) {
                section.passage.silent = section.passage.silent.with(head);
            }
        }
    }
}

/// Records missing samples at an advice update: simulated pings of silent and stalled heads, and pings
/// without a fix.
///
/// Allocates: never.
pub(super) fn note_update(
    missing_finder: &mut MissingSampleFinder,
    now: Drive,
    heads: &Heads<'_, '_>,
    (at, situation): (MonoNs, &Situation),
    profile: &Profile,
    coverage: &mut Coverage,
) {
    let stalled = missing_finder.stalled;
    note_deaf(missing_finder, situation.deaf, coverage);
    if let Some(pose) = situation.pose {
        note_away(missing_finder, now, heads, (at, pose), profile, coverage);
    }
    let MissingSampleFinder { heads: turning, pose: before, away, forgot, .. } = missing_finder;
    let speed_mps = situation.speed_mps;
    for (number, mounted, hidden, ..) in heads {
        let Some(head) = turning.get_mut(number.0) else { continue };
        // Until a stalled head is in phase again, its scheduled angle decides where its samples are missing.
        let out_of_step = stalled.has(number.0);
        let late = |moved: &MonoNs| out_of_step || at.since(*moved).0 > LACKING_AFTER.0;
        let Some(moved) = head.moved.filter(late) else { continue };
        let Some((seen, angle_rad, rate_radps, step_rad)) = head.seen.filter(|seen| seen.2.abs() > 0.0)
        else {
            continue;
        };
        let from = match head.noted {
            Some(noted) if out_of_step || noted.0 > moved.0 => noted,
            _ => moved,
        };
        let is_silent = head.pinged.is_none_or(|pinged| at.since(pinged).0 > LACKING_AFTER.0);
        let is_silent = is_silent && !out_of_step;
        let cause = if is_silent { Cause::HeadSilent } else { Cause::HeadStalled };
        let period = DurNs::from_secs_f64(step_rad / rate_radps.abs());
        let mut when = from + period;
        let owed = owed(when, at, period);
        if situation.pose.is_some() && owed > ROOM as i64 {
            (when, *forgot) = (when + DurNs((owed - ROOM as i64).saturating_mul(period.0)), true);
        }
        while period.0 > 0 && at.since(when).0 >= 0 {
            let angle_rad = angle_rad + rate_radps * when.since(seen).as_secs_f64();
            let number = number_of(number.0);
            let rate = situation.losses.get(usize::from(number)).copied().unwrap_or_default();
            let would_lose = head.would_lose(when, rate);
            let cause = Causes::of(cause);
            let why = if would_lose { cause.with(Cause::MissingReturns) } else { cause };
            let ping = Away { at: when, head: number, angle_rad, why, is_lost: true };
            if let Some(pose) = situation.pose {
                let back_m = speed_mps * at.since(when).as_secs_f64();
                let pose = Pose { position: pose.position + Vec3::new(-back_m, 0.0, 0.0), ..pose };
                let hides = |angle_rad| hidden.hides(angle_rad);
                let placing = Placing { mount: &mounted.info.mount, turning: head, profile, hidden: &hides };
                placing.add_missing(&pose, &ping, now, coverage);
            } else if !keep(away, Away { why: ping.why.with(Cause::PositionLost), ..ping }) {
                // There is no room for the remaining pings of this head, so they are skipped.
                *forgot = true;
                when = when + DurNs((self::owed(when, at, period) - 1).saturating_mul(period.0));
            }
            head.noted = Some(when);
            when = when + period;
        }
    }
    if let Some(pose) = situation.pose {
        *before = Some((at, pose));
    }
}

/// Records pings without a fix as soon as there is a fix again.
///
/// Allocates: never.
pub(super) fn note_away(
    missing_finder: &mut MissingSampleFinder,
    now: Drive,
    heads: &Heads<'_, '_>,
    (at, pose): (MonoNs, Pose),
    profile: &Profile,
    coverage: &mut Coverage,
) {
    let MissingSampleFinder { heads: turning, pose: before, away, forgot, .. } = missing_finder;
    let Some((then, from)) = *before else { return };
    let way = Way { from: (then, from), to: (at, pose) };
    let speed_mps = way.speed_mps();
    if core::mem::take(forgot) {
        let [from_m, to_m] = [&from, &pose].map(|pose| pose.position.x());
        let sections = &mut coverage.sections;
        for index in sections.index_of(from_m.min(to_m))..=sections.index_of(from_m.max(to_m)) {
            if let Some(section) = sections.get_mut(index) {
                section.passage.unseen = true;
            }
        }
    }
    for ping in away.drain(..) {
        let head = usize::from(ping.head);
        let mut mounts = heads.iter().filter(|(number, ..)| number.0 == head);
        let mount = mounts.next().map(|(_, mounted, ..)| mounted.info.mount);
        let (Some(mount), Some(turning)) = (mount, turning.get(head)) else { continue };
        let hidden = |angle_rad| hides(heads, head, angle_rad);
        let placing = Placing { mount: &mount, turning, profile, hidden: &hidden };
        placing.add_missing(&way.at(ping.at), &ping, Drive { speed_mps, ..now }, coverage);
    }
}

/// Number of pings due from `first` to `at`.
///
/// The computation takes constant time, since two updates in a log may be years apart.
fn owed(first: MonoNs, at: MonoNs, period: DurNs) -> i64 {
    let since = at.since(first).0;
    if since < 0 { 0 } else { since.checked_div(period.0).map_or(0, |periods| periods.saturating_add(1)) }
}

/// Pseudo-random number from 0 to 1, evenly distributed over different inputs. Source: Steele et al. 2014,
/// finaliser of splitmix64.
fn unit_of(number: u64) -> f64 {
    let mixed = (number ^ (number >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((mixed ^ (mixed >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
}

/// Keeps a ping without a fix until the next fix. Returns false if there is no room.
fn keep(away: &mut Vec<Away>, ping: Away) -> bool {
    let has_room = away.len() < away.capacity();
    if has_room {
        away.push(ping);
    }
    has_room
}

fn hides(heads: &Heads<'_, '_>, head: usize, angle_rad: f64) -> bool {
    heads.iter().any(|(number, _, hidden, ..)| number.0 == head && hidden.hides(angle_rad))
}

/// Straight-line motion between two fixes.
struct Way {
    from: (MonoNs, Pose),
    to: (MonoNs, Pose),
}

impl Way {
    fn speed_mps(&self) -> f64 {
        let seconds = self.to.0.since(self.from.0).as_secs_f64().max(1e-3);
        (self.to.1.position.x() - self.from.1.position.x()).abs() / seconds
    }

    /// Pose at a time between the two fixes. The attitude is taken from the nearer fix.
    fn at(&self, at: MonoNs) -> Pose {
        let whole_s = self.to.0.since(self.from.0).as_secs_f64().max(1e-3);
        let share = (at.since(self.from.0).as_secs_f64() / whole_s).clamp(0.0, 1.0);
        let (from, to) = (&self.from.1, &self.to.1);
        let attitude = if share < 0.5 { from.attitude } else { to.attitude };
        Pose { position: from.position + (to.position - from.position).scaled(share), attitude }
    }
}

/// Context for finding the wall points of a head's real or simulated pings.
struct Placing<'a> {
    mount: &'a Mount,
    turning: &'a Turning,
    profile: &'a Profile,
    hidden: &'a dyn Fn(f64) -> bool,
}

impl Placing<'_> {
    /// Records a missing sample at the wall point at which a ping was aimed, and the driving figures in the
    /// section of that point.
    fn add_missing(&self, pose: &Pose, ping: &Away, drive: Drive, coverage: &mut Coverage) {
        let origin = pose.place(self.mount.position);
        let beam = pose.attitude * (self.mount.rotation * head_direction(ping.angle_rad));
        let wall = self.profile.cast([origin.y(), origin.z()], [beam.y(), beam.z()]);
        let Some(wall) = wall else { return };
        let x_m = origin.x() + wall.range_m * beam.x();
        let index = coverage.sections.index_of(x_m);
        if let Some(section) = coverage.sections.get_mut(index) {
            section.passage.drive = section.passage.drive.or_worse(drive);
        }
        let mut why = ping.why;
        // A real ping without a return gets a further cause here. A simulated ping already has all its
        // causes.
        let made = why == Causes::of(Cause::PositionLost);
        if ping.is_lost {
            // If the head could not have detected the wall at this point anyway, the ping's loss is not due to chance.
            let elsewhere = |why: Causes| why.without(Cause::MissingReturns);
            let is_far = wall.range_m > self.turning.longest_m;
            let is_hidden = self.turning.is_hidden() && (self.hidden)(ping.angle_rad);
            let because = |why: Causes, is: bool, cause: Cause| if is { why.with(cause) } else { why };
            if is_far || is_hidden {
                why = because(elsewhere(why), is_far, Cause::OutOfRange);
                why = because(why, is_hidden, Cause::Occluded);
            } else if made {
                why = why.with(Cause::MissingReturns);
            }
        }
        coverage.missing_samples.add(MissingSample {
            x_m,
            arc_m: wall.arc_m,
            head: ping.head,
            why,
            may_be_wall: false,
        });
    }
}

#[cfg(test)]
mod tests;
