//! Cause of a failed section, from the statistics of its passage.
//!
//! A cause is a factor whose removal would have let the section pass: each is tested on the figures of the passage. Lost
//! pings count only if aimed into the hole itself. `docs/coverage.md` has the order and its reasons.

use serde::{Deserialize, Serialize};

use super::hole::Hole;
use super::passage::{Loss, Passage, lost_within};
use crate::Reach;
use headrace_sampling::head::HeadSet;
use headrace_sampling::margin::position_margin_m;
use headrace_sampling::spacing;

/// Cause assigned to a fail. Source: metrics.md, "Sections and verdicts".
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Cause {
    /// The distance between passes was too large at the speed driven.
    TooFast,
    /// The angular step alone leaves such holes; lower speed does not help.
    AngularStep,
    /// No returns although the wall was within range.
    MissingReturns,
    /// The wall was farther than the heads' range setting.
    OutOfRange,
    /// The vehicle occluded the beams.
    Occluded,
    /// The vehicle was off-centre, or turned so that its beams swung along the tunnel.
    OffAxis,
    /// The heads' passes were unevenly spread; evenly spread they would have met the target.
    Phase,
    /// A head was stalled.
    HeadStalled,
    /// A head went by without a ping.
    HeadSilent,
    /// Returns came without a valid position.
    PositionLost,
    /// The hole reaches beyond the stretch that was passed.
    NotPassed,
}

impl Cause {
    /// All of them.
    pub const ALL: [Self; 11] = [
        Self::TooFast,
        Self::AngularStep,
        Self::MissingReturns,
        Self::OutOfRange,
        Self::Occluded,
        Self::OffAxis,
        Self::Phase,
        Self::HeadStalled,
        Self::HeadSilent,
        Self::PositionLost,
        Self::NotPassed,
    ];

    /// The word used in reports and logs.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::TooFast => "too_fast",
            Self::AngularStep => "angular_step",
            Self::MissingReturns => "missing_returns",
            Self::OutOfRange => "out_of_range",
            Self::Occluded => "occluded",
            Self::OffAxis => "off_axis",
            Self::Phase => "phase",
            Self::HeadStalled => "head_stalled",
            Self::HeadSilent => "head_silent",
            Self::PositionLost => "position_lost",
            Self::NotPassed => "not_passed",
        }
    }

    fn of_loss(loss: Loss) -> Self {
        match loss {
            Loss::Missing => Self::MissingReturns,
            Loss::OutOfRange => Self::OutOfRange,
            Loss::Occluded => Self::Occluded,
        }
    }
}

/// Figures behind a cause: means over the pings of the worst-driven section that the hole touches; shares and counts
/// over all sections that it touches.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Evidence {
    /// The cause.
    pub cause: Cause,
    /// Speed along the tunnel, m/s.
    pub speed_mps: f64,
    /// Largest speed that would have met the target less the margin for errors of position, with the heads evenly spread, m/s;
    /// zero where none.
    pub even_v_max_mps: f64,
    /// Time between passes, seconds.
    pub pass_gap_s: f64,
    /// Time between passes had they been spread evenly, seconds.
    pub even_pass_gap_s: f64,
    /// The same if all heads had been turning, seconds.
    pub all_pass_gap_s: f64,
    /// Share of pings without a return, beyond range or not.
    pub missing_share: f64,
    /// Share of pings occluded by the vehicle.
    pub occluded_share: f64,
    /// Share of pings of a stalled head.
    pub standing_share: f64,
    /// Bins of the hole's wall (a 64th of the perimeter by one section) into which pings were lost, summed over reasons.
    pub lost_in_hole: u32,
    /// Largest step along the perimeter between neighbouring samples of one turn, m.
    pub t_y_m: f64,
    /// The same predicted for a level vehicle in the middle of the tunnel, m.
    pub middle_t_y_m: f64,
    /// How far the beams swung along the tunnel between two passes, m.
    pub swing_m: f64,
    /// Heads that went by without a ping, by number.
    #[serde(with = "head_numbers")]
    pub silent_heads: HeadSet,
}

/// A failed hole and its surroundings.
#[derive(Debug, Clone, Copy)]
pub struct Case<'a> {
    /// The hole.
    pub hole: &'a Hole,
    /// Stretch that every live head had swept by then.
    pub swept_by_all: Option<Reach>,
    /// No head was alive then.
    pub none_alive: bool,
    /// Target T, m.
    pub target_m: f64,
    /// Standard deviations of a hole that a verdict of pass keeps below it.
    pub confidence_sd: f64,
    /// Perimeter of the profile, m.
    pub perimeter_m: f64,
}

/// Determines the cause of a hole from the sections that it touches, each with its start and end chainage.
pub fn explain<'a>(
    case: &Case<'_>,
    sections: &(impl Iterator<Item = ((f64, f64), &'a Passage)> + Clone),
) -> Evidence {
    let Case { hole, swept_by_all, none_alive, target_m, confidence_sd, perimeter_m } = *case;
    // An empty circle of the target's size suffices for a fail; the hole may still shrink from ahead.
    let radius_m = hole.diameter_m.min(target_m) / 2.0;
    let lost = lost_within(hole, radius_m, perimeter_m, sections.clone());
    let seen = Seen::over(sections.clone().map(|(_, passage)| passage));
    let worst = sections
        .clone()
        .filter(|(_, passage)| passage.placed > 0)
        .map(|(_, passage)| Driven::of(passage))
        .max_by(|a, b| a.t_m().total_cmp(&b.t_m()))
        .unwrap_or_default();
    let passed = swept_by_all
        .is_some_and(|swept| hole.x_m - radius_m >= swept.from_m && hole.x_m + radius_m <= swept.to_m);
    let lost_in_hole = lost.iter().sum();
    let whole = passed && hole.bounded;
    // A hole much larger than the driving explains has another cause, unless the driving alone misses the target
    // clearly: lost pings have then only enlarged the hole.
    let explained =
        worst.t_m() * EXPLAINED > hole.diameter_m || worst.t_m() > BAD_ENOUGH * target_m && lost_in_hole > 0;
    let driving_explains = worst.t_m() > target_m && explained;
    let cause = if seen.dark {
        Cause::HeadSilent
    } else if seen.is_unseen(lost_in_hole) && !driving_explains {
        Cause::PositionLost
    } else if seen.pings == 0 || (!whole && lost_in_hole == 0) {
        // What a live head hasn't swept isn't passed; where none was alive, the silence is the cause.
        if none_alive && !seen.silent.is_empty() { Cause::HeadSilent } else { Cause::NotPassed }
    } else if driving_explains {
        worst.likeliest(&seen, target_m)
    } else if let Some(loss) = most_lost(lost) {
        Cause::of_loss(loss)
    } else if seen.head_stood() {
        Cause::HeadStalled
    } else if !seen.silent.is_empty() {
        Cause::HeadSilent
    } else {
        // No ping was lost, yet no sample fell into the hole: navigation has jumped.
        Cause::PositionLost
    };
    let margin_m = position_margin_m(target_m, confidence_sd, worst.pass_error_m, worst.t_y_m);
    let even_v_max = spacing::speed_for_target_mps(
        target_m - margin_m,
        worst.t_y_m,
        worst.even_gap_s,
        worst.ping_period_s,
    );
    Evidence {
        cause,
        speed_mps: worst.speed_mps,
        even_v_max_mps: even_v_max.unwrap_or(0.0),
        pass_gap_s: worst.gap_s,
        even_pass_gap_s: worst.even_gap_s,
        all_pass_gap_s: worst.all_gap_s,
        missing_share: seen.share(seen.missing),
        occluded_share: seen.share(seen.occluded),
        standing_share: seen.share(seen.standing),
        lost_in_hole,
        t_y_m: worst.t_y_m,
        middle_t_y_m: worst.middle_t_y_m,
        swing_m: worst.swing_m,
        silent_heads: seen.silent,
    }
}

/// The reason for which most pings into the hole were lost.
fn most_lost(lost: [u32; Loss::ALL.len()]) -> Option<Loss> {
    let most =
        Loss::ALL.into_iter().zip(lost).filter(|(_, count)| *count > 0).max_by_key(|(_, count)| *count);
    most.map(|(loss, _)| loss)
}

/// Counts over all the sections that a hole touches.
#[derive(Debug, Clone, Copy, Default)]
struct Seen {
    pings: u32,
    missing: u32,
    occluded: u32,
    unplaced: u32,
    standing: u32,
    unseen: bool,
    silent: HeadSet,
    /// No head pinged in one of the sections, and some were silent there.
    dark: bool,
}

/// Minimum share of pings of a stalled head for it to matter.
const STANDING_SHARE: f64 = 0.02;
/// Factor by which a hole may exceed T as driven: figures are means over a section.
const EXPLAINED: f64 = 1.5;
/// Multiple of the target beyond which the driving alone would have failed.
const BAD_ENOUGH: f64 = 1.1;
/// A factor is a cause only if its removal reduces T below this share.
const HELPS: f64 = 0.99;

impl Seen {
    fn over<'a>(passages: impl Iterator<Item = &'a Passage>) -> Self {
        passages.fold(Self::default(), |sum, passage| Self {
            pings: sum.pings.saturating_add(passage.pings),
            missing: sum.missing.saturating_add(passage.missing).saturating_add(passage.out_of_range),
            occluded: sum.occluded.saturating_add(passage.occluded),
            unplaced: sum.unplaced.saturating_add(passage.unplaced),
            standing: sum.standing.saturating_add(passage.standing),
            unseen: sum.unseen || passage.unseen,
            silent: sum.silent.union(passage.silent),
            dark: sum.dark || passage.pings == 0 && !passage.silent.is_empty(),
        })
    }

    fn share(&self, count: u32) -> f64 {
        f64::from(count) / f64::from(self.pings.max(1))
    }

    fn head_stood(&self) -> bool {
        self.share(self.standing) > STANDING_SHARE
    }

    /// Whether the position was unknown while most of the missing samples were due.
    fn is_unseen(&self, lost_in_hole: u32) -> bool {
        self.unseen || self.unplaced > self.missing.max(lost_in_hole)
    }
}

/// Driving statistics of a section: means over its pings.
#[derive(Debug, Clone, Copy, Default)]
struct Driven {
    speed_mps: f64,
    gap_s: f64,
    even_gap_s: f64,
    all_gap_s: f64,
    ping_period_s: f64,
    swing_m: f64,
    t_y_m: f64,
    middle_t_y_m: f64,
    /// Standard deviation of a hole's size straight beside the vehicle, m.
    pass_error_m: f64,
}

impl Driven {
    fn of(passage: &Passage) -> Self {
        let mean = |sum: f64| sum / f64::from(passage.placed.max(1));
        let t_y_m = passage.t_y_m;
        Self {
            speed_mps: mean(passage.speed_sum_mps),
            gap_s: mean(passage.pass_gap_sum_s),
            even_gap_s: mean(passage.even_gap_sum_s),
            all_gap_s: mean(passage.all_gap_sum_s),
            ping_period_s: mean(passage.ping_period_sum_s),
            swing_m: mean(passage.swing_sum_m),
            t_y_m,
            middle_t_y_m: passage.middle_t_y_m.min(t_y_m),
            pass_error_m: passage.pass_error.sd_m(passage.pass_error.from_m),
        }
    }

    /// T_max as driven, m. Source: Eq. 16, the swing added to the distance between passes.
    fn t_m(&self) -> f64 {
        spacing::t_max_m(
            self.speed_mps * self.gap_s + self.swing_m,
            self.speed_mps * self.ping_period_s,
            self.t_y_m,
        )
    }

    fn on_axis(&self) -> Self {
        Self { swing_m: 0.0, t_y_m: self.middle_t_y_m, ..*self }
    }

    fn in_phase(&self) -> Self {
        Self { gap_s: self.even_gap_s.min(self.gap_s), ..*self }
    }

    /// No change if all heads are turning already: phase is tested separately.
    fn all_turning(&self) -> Self {
        let gap_s = if self.all_gap_s < HELPS * self.even_gap_s { self.all_gap_s } else { self.gap_s };
        Self { gap_s: gap_s.min(self.gap_s), ..*self }
    }

    /// The cause whose removal alone meets the target; if several must go, the one with the largest effect.
    fn likeliest(&self, seen: &Seen, target_m: f64) -> Cause {
        if self.middle_t_y_m >= target_m {
            return Cause::AngularStep;
        }
        let absent = match seen {
            seen if seen.head_stood() => Cause::HeadStalled,
            seen if !seen.silent.is_empty() => Cause::HeadSilent,
            _ => Cause::MissingReturns,
        };
        let without =
            [(absent, self.all_turning()), (Cause::Phase, self.in_phase()), (Cause::OffAxis, self.on_axis())];
        let helps = |then: &Self| then.t_m() < HELPS * self.t_m();
        let least = |a: &(Cause, Self), b: &(Cause, Self)| a.1.t_m().total_cmp(&b.1.t_m());
        let alone =
            without.into_iter().filter(|(_, then)| helps(then) && then.t_m() <= target_m).min_by(least);
        let best = Self { gap_s: self.all_gap_s.min(self.gap_s), ..self.on_axis() };
        let together =
            || without.into_iter().min_by(least).filter(|(_, then)| helps(then) && best.t_m() <= target_m);
        alone.or_else(together).map_or(Cause::TooFast, |(cause, _)| cause)
    }
}

mod head_numbers;
#[cfg(test)]
mod tests;
