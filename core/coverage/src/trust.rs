//! Trust in heads. Detects noise, a range that never changes, and wall that no other head sees.

use serde::{Deserialize, Serialize};

use super::relief::Ballot;
use super::wall_limits::{PlacedReturn, WallLimits};
use headrace_fusion::constant_range::ConstantRange;
use headrace_geometry::math;

/// Reason for distrusting a head, with the figure that shows it, m.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum Distrust {
    /// Most successive returns of the head disagree. The value is their mean difference.
    Scattered(f64),
    /// The head's range is constant although the range to the design varies. The value is this constant range.
    Constant(f64),
    /// The head contradicts the design where other heads agree with it. The value is the mean deviation from the
    /// design.
    Outvoted(f64),
}

/// Beam of a return: its range, its direction, and whether the head turns.
pub struct Beam<'a> {
    /// Range of the return, m.
    pub range_m: f64,
    /// Direction of the beam across the tunnel, rad.
    pub angle_rad: f64,
    /// Whether the head is stalled.
    pub standing: bool,
    /// Range to the design profile, m. `None` if the beam does not meet the profile.
    pub design_range_m: &'a dyn Fn() -> Option<f64>,
}

/// Evidence about one head from the vehicle's other heads.
pub(super) struct Others {
    /// Votes of other heads on this head; see [`Ballot`].
    pub(super) ballot: Ballot,
    /// Whether another head's range varies when the range to the design does.
    pub(super) change: bool,
}

/// Disagreement of a return with the returns before it.
pub(super) struct Disagreement {
    /// Difference from the previous return, m. `None` if the two returns agree.
    pub(super) jump_m: Option<f64>,
    /// Number of waiting returns that this return made doubtful.
    pub(super) doubtful: u32,
}

/// Counts of a head's returns over half a turn.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
struct HalfTurn {
    returns: u32,
    doubtful: u32,
    /// Number of returns that disagree with the return before (`jumps`), and sum of these differences, m.
    jumps: u32,
    jump_sum_m: f64,
    turned_rad: f64,
    /// Sums over the half turn, m and m2: of the range, of its square, and of the squared change since the previous
    /// return.
    range_sum_m: f64,
    range_square_m2: f64,
    change_square_m2: f64,
    /// Smallest and largest chainage of the half turn's returns, m.
    between_m: Option<[f64; 2]>,
    /// Number of returns within runs of constant range.
    ///
    /// The next two fields belong to these returns: the smallest and largest range, m, and the smallest and largest
    /// range to the design in the same directions, m.
    unchanged: u32,
    unchanged_m: Option<[f64; 2]>,
    design_m: Option<[f64; 2]>,
}

impl HalfTurn {
    fn with(&self, other: &Self) -> Self {
        Self {
            returns: self.returns + other.returns,
            doubtful: self.doubtful + other.doubtful,
            jumps: self.jumps + other.jumps,
            jump_sum_m: self.jump_sum_m + other.jump_sum_m,
            turned_rad: self.turned_rad + other.turned_rad,
            range_sum_m: self.range_sum_m + other.range_sum_m,
            range_square_m2: self.range_square_m2 + other.range_square_m2,
            change_square_m2: self.change_square_m2 + other.change_square_m2,
            between_m: joined(self.between_m, other.between_m),
            unchanged: self.unchanged + other.unchanged,
            unchanged_m: joined(self.unchanged_m, other.unchanged_m),
            design_m: joined(self.design_m, other.design_m),
        }
    }

    fn is_full(&self) -> bool {
        self.turned_rad >= math::TAU / 2.0 && self.returns >= FEW
    }

    /// Whether the range is constant in more than one in `parts` returns, although the range to the design varies.
    fn is_constant(&self, parts: u32, limits: &WallLimits) -> bool {
        let span_m = |of: Option<[f64; 2]>| of.map_or(0.0, |[least_m, most_m]| most_m - least_m);
        parts * self.unchanged > self.returns
            && span_m(self.unchanged_m) < CONSTANT * limits.tolerance_m
            && span_m(self.design_m) > VARIES * limits.tolerance_m
    }

    /// Whether the range follows a wall, so that it varies more over all directions than from one return to the next.
    ///
    /// For a constant range with independent noise, the ratio of squared changes to squared deviations from the mean is
    /// about 2, however strong the noise (von Neumann 1941, doi 10.1214/aoms/1177731677). A head in the centre of a
    /// round pipe looks like a frozen head, so it counts as frozen.
    fn follows_a_wall(&self) -> bool {
        let mean_m = self.range_sum_m / f64::from(self.returns.max(1));
        let variation_m2 = self.range_square_m2 - mean_m * self.range_sum_m;
        let resolution_m2 = f64::from(self.returns) * RESOLUTION_M * RESOLUTION_M;
        self.returns >= FEW && self.change_square_m2 + resolution_m2 < NOISE_RATIO * variation_m2
    }

    /// Whether more than one in `parts` returns disagrees with its neighbours.
    fn has_one_in(&self, parts: u32) -> bool {
        parts * self.jumps.max(self.doubtful) > self.returns
    }
}

/// Ratio of squared changes to squared deviations from the mean from which a range counts as noise.
///
/// Over half a turn, independent noise has a ratio of 2 +- 0.2. The range to a wall has a much smaller ratio, unless
/// the vehicle is in the centre of a round tunnel.
const NOISE_RATIO: f64 = 1.0;
/// Resolution of a profiling sonar's range, m. Smaller changes of range show nothing.
const RESOLUTION_M: f64 = 0.002;
/// Minimum number of returns in half a turn from which a head is judged.
const FEW: u32 = 20;
/// Share of the tolerance by which an unchanged range may vary.
///
/// It corresponds to some quanta of a profiling sonar.
const UNCHANGED: f64 = 0.2;
/// Share of the tolerance by which runs of unchanged range may differ to count as one constant range.
const CONSTANT: f64 = 0.6;
/// Multiple of the tolerance by which the range to the design must vary for a constant range to contradict it.
const VARIES: f64 = 2.0;
/// Number of successive returns from which on they make a run of unchanged range.
///
/// It must be large, because a few neighbouring returns of a wall may have nearly the same range.
const RUN: u32 = 8;
/// Multiple of the tolerance by which the range to the design must vary for an exactly constant range to contradict it.
///
/// The limit applies only if another head's range varies when the range to the design does. Otherwise a constant range
/// may be correct, because in a round tunnel the range to the design also varies if the vehicle is beside its estimated
/// place.
const STUCK_VARIES: f64 = 1.0;

fn joined(a: Option<[f64; 2]>, b: Option<[f64; 2]>) -> Option<[f64; 2]> {
    match (a, b) {
        (Some([a, b]), Some([c, d])) => Some([a.min(c), b.max(d)]),
        (one, other) => one.or(other),
    }
}

/// Successive returns with nearly the same range.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
struct Unchanged {
    returns: u32,
    /// Smallest and largest range of these returns, m.
    range_m: [f64; 2],
}

impl Unchanged {
    /// Adds a return. Returns true if it is within a run of unchanged range.
    fn add(&mut self, range_m: f64, limits: &WallLimits) -> bool {
        let [least_m, most_m] = self.range_m;
        let span_m = [least_m.min(range_m), most_m.max(range_m)];
        if self.returns == 0 || span_m[1] - span_m[0] > UNCHANGED * limits.tolerance_m {
            *self = Self { returns: 1, range_m: [range_m; 2] };
        } else {
            *self = Self { returns: self.returns.saturating_add(1), range_m: span_m };
        }
        self.returns >= RUN
    }
}

/// State of the trust in one head.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub(super) struct HeadTrust {
    /// Counts of the present half turn, and of the two half turns before.
    halves: [HalfTurn; 3],
    angle_rad: Option<f64>,
    range_m: Option<f64>,
    unchanged: Unchanged,
    one_range: ConstantRange,
    /// Smallest and largest chainage of the returns with an exactly constant range, m. The next field is the angle that
    /// the head has turned since the first of them, rad.
    one_range_at_m: [f64; 2],
    one_range_rad: f64,
    distrusted: Option<Distrust>,
}

impl HeadTrust {
    pub(super) fn distrusted(&self) -> Option<Distrust> {
        self.distrusted
    }

    /// Adds a return.
    ///
    /// If the head is distrusted from now on, returns the reason and the chainages of its recent returns.
    pub(super) fn note(
        &mut self,
        placed: &PlacedReturn,
        beam: &Beam<'_>,
        disagreement: Disagreement,
        limits: &WallLimits,
        others: &Others,
    ) -> Option<(Distrust, [f64; 2])> {
        // A stalled head sees only one place, where the wall may well deviate from the design.
        if beam.standing {
            return None;
        }
        let one = self.counts(placed, beam, disagreement, limits);
        self.halves[0] = self.halves[0].with(&one);
        self.note_range(placed, beam, one.turned_rad, limits);
        let is_stuck = others.change && self.is_stuck(limits);
        let is_full = self.halves[0].is_full();
        let turn = self.halves[0].with(&self.halves[1]);
        let late_m = turn.with(&self.halves[2]).between_m.unwrap_or([placed.x_m; 2]);
        if is_full {
            self.halves = [HalfTurn::default(), self.halves[0], self.halves[1]];
        }
        let whole = is_full && turn.turned_rad >= 0.9 * math::TAU;
        if self.distrusted.is_some() {
            if whole
                && !is_stuck
                && !turn.has_one_in(4)
                && !others.ballot.is_lost()
                && !turn.is_constant(4, limits)
            {
                self.distrusted = None;
            }
            return None;
        }
        let (why, between_m) = if is_stuck {
            (Distrust::Constant(beam.range_m), self.one_range_at_m)
        } else if whole && turn.is_constant(2, limits) {
            (Distrust::Constant(beam.range_m), late_m)
        } else if whole && turn.has_one_in(2) {
            (Distrust::Scattered(turn.jump_sum_m / f64::from(turn.jumps.max(1))), late_m)
        } else {
            let (off_m, between_m) = others.ballot.verdict()?;
            (Distrust::Outvoted(off_m), joined(Some(late_m), Some(between_m))?)
        };
        self.distrusted = Some(why);
        Some((why, between_m))
    }

    /// Counts of one return.
    fn counts(
        &mut self,
        placed: &PlacedReturn,
        beam: &Beam<'_>,
        Disagreement { jump_m, doubtful }: Disagreement,
        limits: &WallLimits,
    ) -> HalfTurn {
        let before = self.angle_rad.replace(beam.angle_rad).unwrap_or(beam.angle_rad);
        let turned_rad = math::wrap_signed(beam.angle_rad - before, math::TAU).abs();
        let change_m = beam.range_m - self.range_m.replace(beam.range_m).unwrap_or(beam.range_m);
        let unchanged = self.unchanged.add(beam.range_m, limits);
        let is_run = |range_m: f64| unchanged.then_some([range_m; 2]);
        HalfTurn {
            returns: 1,
            doubtful,
            jumps: u32::from(jump_m.is_some()),
            jump_sum_m: jump_m.unwrap_or(0.0).abs(),
            turned_rad,
            range_sum_m: beam.range_m,
            range_square_m2: beam.range_m * beam.range_m,
            change_square_m2: change_m * change_m,
            between_m: Some([placed.x_m; 2]),
            unchanged: u32::from(unchanged),
            unchanged_m: is_run(beam.range_m),
            design_m: if unchanged { (beam.design_range_m)().and_then(is_run) } else { None },
        }
    }

    /// Records a return for the check of an exactly constant range.
    ///
    /// The record starts again after half a turn, unless the constant range contradicts the design.
    fn note_range(&mut self, placed: &PlacedReturn, beam: &Beam<'_>, turned_rad: f64, limits: &WallLimits) {
        if self.one_range_rad > math::TAU / 2.0 && !self.is_stuck(limits) {
            self.one_range = ConstantRange::default();
        }
        let off_m = (beam.design_range_m)().map_or(0.0, |design_m| beam.range_m - design_m);
        self.one_range.note(beam.range_m, off_m);
        if self.one_range.is_new() {
            (self.one_range_at_m, self.one_range_rad) = ([placed.x_m; 2], 0.0);
        }
        let [least_m, most_m] = self.one_range_at_m;
        self.one_range_at_m = [least_m.min(placed.x_m), most_m.max(placed.x_m)];
        self.one_range_rad += turned_rad;
    }

    /// Whether the ranges of the latest turn show that the head is not frozen; see [`HalfTurn::follows_a_wall`].
    pub(super) fn follows_a_wall(&self) -> bool {
        self.halves[0].with(&self.halves[1]).follows_a_wall()
    }

    /// Whether the latest returns have an exactly constant range although the range to the design varies.
    pub(super) fn is_stuck(&self, limits: &WallLimits) -> bool {
        self.one_range.is_stuck(RUN, STUCK_VARIES * limits.tolerance_m)
    }
}
