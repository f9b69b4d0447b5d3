//! Layouts of several heads: phase shift and sector offset (Jorge et al. 2021, §5).

use super::error::{SamplingError, not_negative, positive};
use super::head::{HeadProgram, HeadSpec, MAX_HEADS, faces_aft};
use headrace_geometry::math::{self, TAU};

/// Layout of the heads of a vehicle: how they share the wall between them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum HeadLayout {
    /// All s heads rotate continuously. Their angles are 2 pi / s apart if each is taken when its head reaches the same
    /// chainage.
    PhaseShift,
    /// Each of s heads sweeps back and forth in a sector of 2 pi / s.
    SectorOffset,
}

impl HeadLayout {
    /// Names of the layouts in files and on command lines.
    pub const NAMES: [(&'static str, Self); 2] =
        [("phase_shift", Self::PhaseShift), ("sector_offset", Self::SectorOffset)];

    /// Name of the layout.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::PhaseShift => "phase_shift",
            Self::SectorOffset => "sector_offset",
        }
    }

    /// Checks whether this number of heads can have this layout.
    ///
    /// Errors: no head, more than [`MAX_HEADS`], or sectors for fewer than two heads.
    pub fn check(self, heads: usize) -> Result<(), SamplingError> {
        match (self, heads) {
            (_, 0) => Err(SamplingError::HeadCount { heads }),
            (Self::SectorOffset, 1) => Err(SamplingError::SectorNeedsHeads { heads }),
            (_, 1..=MAX_HEADS) => Ok(()),
            _ => Err(SamplingError::HeadCount { heads }),
        }
    }
}

/// Angle through which a head turns while the vehicle travels `x_m`, radians, not wrapped to a turn.
///
/// `rate_radps` is the head's angular velocity omega, of either sign; `speed_mps` > 0.
/// Errors: a distance, rate or speed that isn't finite; a negative speed; a speed of zero if the distance is not zero,
/// because x / v is then infinite.
/// Source: Jorge et al. 2021, Eq. 19 (alpha_k = omega x / v).
pub fn turned_over_rad(rate_radps: f64, x_m: f64, speed_mps: f64) -> Result<f64, SamplingError> {
    not_negative("the rate of turn in rad/s, without its sign", rate_radps.abs())?;
    not_negative("the distance along the hull in metres, without its sign", x_m.abs())?;
    not_negative("the speed in m/s", speed_mps)?;
    let turned = if x_m == 0.0 { 0.0 } else { rate_radps * x_m / speed_mps };
    turned.is_finite().then_some(turned).ok_or(SamplingError::NoPhaseAtRest { apart_m: x_m, speed_mps })
}

/// gamma: start angle of a head `x_m` behind the foremost head, in [0, 2 pi).
///
/// The head has the phase `phase_rad` when it reaches the chainage of the foremost head. The rounding error is about
/// 1e-16 of the angle through which the head turns until then.
///
/// Errors: as for [`turned_over_rad`]; a phase that isn't finite.
/// Source: Jorge et al. 2021, Eq. 20 (gamma = phi(k) - omega x / v).
pub fn start_rad(phase_rad: f64, rate_radps: f64, x_m: f64, speed_mps: f64) -> Result<f64, SamplingError> {
    not_negative("the phase in radians, without its sign", phase_rad.abs())?;
    Ok(math::wrap(phase_rad - turned_over_rad(rate_radps, x_m, speed_mps)?, TAU))
}

/// gamma: start angle of a head that faces opposite to the foremost head, in [0, 2 pi).
///
/// The angles of this head and of the foremost head grow in opposite senses.
///
/// Errors: as for [`start_rad`].
/// Source: Jorge et al. 2021, Eq. 21 (gamma = 2 pi - (phi(k) - omega x / v)).
pub fn start_reversed_rad(
    phase_rad: f64,
    rate_radps: f64,
    x_m: f64,
    speed_mps: f64,
) -> Result<f64, SamplingError> {
    Ok(math::wrap(TAU - start_rad(phase_rad, rate_radps, x_m, speed_mps)?, TAU))
}

/// Angles closer together than this count as equal, radians.
const ROUNDING_RAD: f64 = 1e-9;

/// Number of steps to cover the angle `far_rad`; the last step is shorter if the steps do not divide `far_rad`.
pub(super) fn steps_over(far_rad: f64, step_rad: f64) -> i64 {
    -math::floor_to_i64(-(far_rad / step_rad - 1e-6))
}

/// Angle and direction of a head that sweeps a sector, in the sensor frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct InSector {
    /// Head angle, radians, in [0, 2 pi).
    pub angle_rad: f64,
    /// Whether the head's angle is growing.
    pub growing: bool,
}

/// The share of a turn that one of several heads sweeps.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sector {
    /// Sector number, from zero at the floor.
    pub number: usize,
    /// Number of sectors of all heads.
    pub of: usize,
    /// Distance of the head behind the first head, m.
    pub behind_m: f64,
    /// Whether the head faces opposite to the first head.
    pub reversed: bool,
}

/// Returns the angle at which a head is in step with the first head.
///
/// Two heads are in step if each is at the same point of its sweep when it reaches the same chainage. The first head,
/// in sector 0, is at `lead`. `turn_s` is the turn period T; a sweep there and back in a sector takes 2 T / s. A
/// `speed_mps` of zero means no delay: all heads are at the same point of their sweeps, regardless of their positions
/// along the hull.
/// Errors: fewer than two sectors, a sector number that doesn't exist, a lead outside sector 0, a time that isn't above
/// zero, a speed below zero.
/// Source: Jorge et al. 2021, Algorithm 1. Here the sector's size has only one name, and the period of a sweep is 2 T /
/// s.
pub fn in_step(
    lead: InSector,
    sector: &Sector,
    turn_s: f64,
    speed_mps: f64,
) -> Result<InSector, SamplingError> {
    HeadLayout::SectorOffset.check(sector.of)?;
    if sector.number >= sector.of {
        return Err(SamplingError::HeadCount { heads: sector.number + 1 });
    }
    positive("the turn's period in seconds", turn_s)?;
    not_negative("the speed in m/s", speed_mps)?;
    not_negative("the distance along the hull in metres, without its sign", sector.behind_m.abs())?;
    not_negative("the first head's angle in radians", lead.angle_rad)?;
    let size_rad = TAU / sector.of as f64;
    let sweep_s = turn_s / sector.of as f64;
    let delay_s = if speed_mps > 0.0 { sector.behind_m / speed_mps } else { 0.0 };
    not_negative(
        "the remaining part of the first head's sector in radians",
        size_rad - lead.angle_rad + ROUNDING_RAD,
    )?;
    // Unfolded position in the sweep: 0 to 1 on the way out, 1 to 2 on the way back.
    let share = (lead.angle_rad / size_rad).min(1.0);
    let lead_legs = if lead.growing { share } else { 2.0 - share };
    let legs = math::wrap(lead_legs - delay_s / sweep_s, 2.0);
    let growing = legs < 1.0;
    let along = if growing { legs } else { 2.0 - legs };
    let angle_rad = size_rad * (along + sector.number as f64);
    let angle_rad = if sector.reversed { TAU - angle_rad } else { angle_rad };
    Ok(InSector { angle_rad: math::wrap(angle_rad, TAU), growing: growing != sector.reversed })
}

/// Assigns a sector to each head such that heads look outwards, away from their neighbours.
///
/// The assignment maximises a sum over all heads: the head's offset across the hull, projected on the direction of its
/// sector's middle. Among assignments with equal sums, the function prefers head k in sector k.
pub fn sectors(heads: &[HeadSpec]) -> Vec<usize> {
    let count = heads.len().min(MAX_HEADS);
    let share = TAU / count.max(1) as f64;
    let outwards = |head: &HeadSpec, sector: usize| {
        let (sine, cosine) = math::sin_cos(share * (sector as f64 + 0.5));
        head.mount.position.y() * sine - head.mount.position.z() * cosine
    };
    let gains: Vec<Vec<f64>> =
        heads.iter().map(|head| (0..count).map(|sector| outwards(head, sector)).collect()).collect();
    let mut best = (f64::NEG_INFINITY, (0..count).collect());
    assign(&gains, 0.0, &mut Vec::with_capacity(count), &mut best);
    best.1
}

/// Tries each unassigned sector for the next head, in order.
///
/// Among assignments with equal sums, the first one is kept.
fn assign(gains: &[Vec<f64>], so_far: f64, taken: &mut Vec<usize>, best: &mut (f64, Vec<usize>)) {
    /// Assignments whose sums differ by less than this count as equal, m.
    const SAME_M: f64 = 1e-9;
    let Some(gain) = gains.get(taken.len()) else {
        if so_far > best.0 + SAME_M {
            *best = (so_far, taken.clone());
        }
        return;
    };
    for (sector, gain) in gain.iter().enumerate() {
        if !taken.contains(&sector) {
            taken.push(sector);
            assign(gains, so_far + gain, taken, best);
            taken.pop();
        }
    }
}

/// Returns the program of each head, such that the heads' passes interleave evenly at `speed_mps`.
///
/// Head k of s starts at the body-frame angle gamma_k = 2 pi k / s - omega x_k / v, where x_k is the distance of head k
/// behind the foremost head (Eq. 20). A head that faces aft turns the other way, so its start is mirrored (Eq. 21). In
/// sectors, the foremost head starts at the beginning of its sector, and all other heads at the angles of Algorithm 1.
/// At zero speed the offsets along the hull have no meaning and are ignored.
/// Errors: a number of heads that the layout doesn't allow; a speed, step or ping period out of range.
/// Source: Jorge et al. 2021, Eq. 19 to 21, §5.2 and Algorithm 1.
pub fn programs(
    heads: &[HeadSpec],
    layout: HeadLayout,
    speed_mps: f64,
) -> Result<Vec<HeadProgram>, SamplingError> {
    layout.check(heads.len())?;
    not_negative("the speed in m/s", speed_mps)?;
    let foremost_m = heads.iter().map(|head| head.mount.position.x()).fold(f64::MIN, f64::max);
    let behind_m = |head: &HeadSpec| foremost_m - head.mount.position.x();
    match layout {
        HeadLayout::PhaseShift => {
            let share = TAU / heads.len() as f64;
            let program = |(k, head)| phase_shift(head, share * k as f64, behind_m(head), speed_mps);
            heads.iter().enumerate().map(program).collect()
        }
        HeadLayout::SectorOffset => {
            let program = |(number, head): (usize, &HeadSpec)| {
                let reversed = faces_aft(head.mount.rotation);
                let sector = Sector { number, of: heads.len(), behind_m: behind_m(head), reversed };
                sector_offset(head, &sector, speed_mps)
            };
            sectors(heads).into_iter().zip(heads).map(program).collect()
        }
    }
}

/// Rotation program of a head for continuous rotation.
///
/// All heads turn in the same sense in the body frame, so a head that faces aft steps downwards in its sensor frame.
fn phase_shift(
    head: &HeadSpec,
    phase_rad: f64,
    behind_m: f64,
    speed_mps: f64,
) -> Result<HeadProgram, SamplingError> {
    let step_rad = positive("the step in radians", head.step_rad)?;
    let rate_radps = step_rad / positive("the ping period in seconds", head.ping_period_s)?;
    let behind_m = if speed_mps > 0.0 { behind_m } else { 0.0 };
    let aft = faces_aft(head.mount.rotation);
    let start = if aft { start_reversed_rad } else { start_rad };
    let start_rad = start(phase_rad, rate_radps, behind_m, speed_mps)?;
    Ok(HeadProgram { start_rad, growing: !aft, sector: None })
}

fn sector_offset(head: &HeadSpec, sector: &Sector, speed_mps: f64) -> Result<HeadProgram, SamplingError> {
    let size_rad = TAU / sector.of as f64;
    let step_rad = positive("the step in radians", head.step_rad)?;
    // A sweep of a sector takes a whole number of pings. If steps do not divide the sector, the turn period is
    // rounded up.
    let turn_s = head.ping_period_s * steps_over(size_rad, step_rad) as f64 * sector.of as f64;
    let least_rad = size_rad * sector.number as f64;
    let least_rad = if sector.reversed { math::wrap(TAU - least_rad - size_rad, TAU) } else { least_rad };
    let begin = InSector { angle_rad: 0.0, growing: true };
    let start = in_step(begin, sector, turn_s, speed_mps)?;
    // The angle was wrapped to one turn, so it may differ from the sector's start by an extra whole turn.
    let along_rad = math::wrap(start.angle_rad - least_rad + ROUNDING_RAD, TAU) - ROUNDING_RAD;
    Ok(HeadProgram {
        start_rad: least_rad + along_rad,
        growing: start.growing,
        sector: Some((least_rad, size_rad)),
    })
}

/// Spacing rule x = q v T / s for s heads: x is the distance between heads along the hull, v the speed, T the turn
/// period.
///
/// If the rule holds for a whole number q, the heads' passes interleave with start angles that differ by multiples of
/// 1/s turn. Heads with such start angles interfere least with each other.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HullRule {
    /// q: number of T / s in which the vehicle travels the distance between the heads, rounded to a whole number.
    pub q: u32,
    /// Speed that meets the rule with the given distance and turn period, m/s: s x / (q T).
    pub speed_mps: f64,
    /// Distance between the heads that meets the rule with the given speed and turn period, m: q v T / s.
    pub apart_m: f64,
    /// Turn period that meets the rule with the given distance and speed, seconds: s x / (q v).
    pub turn_s: f64,
}

/// Returns the values of the spacing rule for `heads` heads in phase shift, one of which is `apart_m` behind the first.
///
/// Errors: an argument that isn't above zero, or an invalid number of heads.
/// Source: Jorge et al. 2021, §5.1 (x = q v T for whole turns; T = s x / (q v) for fractions 1/s of a turn).
pub fn hull_rule(apart_m: f64, heads: usize, speed_mps: f64, turn_s: f64) -> Result<HullRule, SamplingError> {
    HeadLayout::PhaseShift.check(heads)?;
    let apart_m = positive("the distance along the hull in metres", apart_m)?;
    let speed_mps = positive("the speed in m/s", speed_mps)?;
    let turn_s = positive("the turn's period in seconds", turn_s)?;
    let s = heads as f64;
    let q = math::round_to_i64(s * apart_m / (speed_mps * turn_s)).clamp(1, 1_000_000) as f64;
    Ok(HullRule {
        q: u32::try_from(math::round_to_i64(q)).unwrap_or(1),
        speed_mps: s * apart_m / (q * turn_s),
        apart_m: q * speed_mps * turn_s / s,
        turn_s: s * apart_m / (q * speed_mps),
    })
}

/// The two alternating distances between passes in a head's sector, m, the smaller first.
///
/// The distances are measured along the tunnel. `pitch_m` is T_x of one continuously rotating head (v T), `heads` the
/// number s, `share` the position in the sector from 0 to 1. The sum of the distances is 2 T_x / s everywhere. In the
/// middle of the sector, the two distances are equal; at its ends, one of them is zero.
/// Errors: fewer than two heads, a pitch below zero, a share outside 0 to 1.
/// Source: Jorge et al. 2021, §5.2 (T_x1 + T_x2 = 2 T_x / s).
pub fn alternating_m(pitch_m: f64, heads: usize, share: f64) -> Result<[f64; 2], SamplingError> {
    HeadLayout::SectorOffset.check(heads)?;
    not_negative("the pitch in metres", pitch_m)?;
    not_negative("the share of the sector", share)?;
    not_negative("the rest of the sector", 1.0 - share)?;
    Ok(divided_m(2.0 * pitch_m / heads as f64, share))
}

/// Divides the distance `both_m` into the two distances between passes at a position in the sector, the smaller first.
///
/// `both_m` is the distance travelled in a sweep there and back.
pub(super) fn divided_m(both_m: f64, share: f64) -> [f64; 2] {
    let nearer = share.min(1.0 - share);
    [both_m * nearer, both_m * (1.0 - nearer)]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The rule is x = q v T / s, with q rounded to a whole number. Each of speed, distance and turn period meets the
    /// rule if the two others are as given.
    #[test]
    fn each_hull_rule_figure_satisfies_the_rule_with_the_other_inputs() {
        for (apart_m, heads, speed_mps, turn_s, q) in
            [(0.6, 4, 0.1, 8.0, 3), (1.1, 2, 0.14, 7.3, 2), (0.05, 3, 0.2, 28.0, 1), (2.0, 3, 0.09, 5.5, 12)]
        {
            let rule = hull_rule(apart_m, heads, speed_mps, turn_s).unwrap();
            assert_eq!(rule.q, q);
            let is_met = |x_m: f64, v_mps: f64, t_s: f64| {
                (x_m * heads as f64 / (v_mps * t_s) - f64::from(rule.q)).abs() < 1e-9
            };
            assert!(is_met(rule.apart_m, speed_mps, turn_s), "{rule:?}");
            assert!(is_met(apart_m, rule.speed_mps, turn_s), "{rule:?}");
            assert!(is_met(apart_m, speed_mps, rule.turn_s), "{rule:?}");
        }
    }

    #[test]
    fn head_1_outside_its_own_sector_is_an_error() {
        let sector = Sector { number: 1, of: 4, behind_m: 0.5, reversed: false };
        let at = |angle_rad: f64| in_step(InSector { angle_rad, growing: true }, &sector, 8.0, 0.1);
        assert!(at(0.0).is_ok() && at(TAU / 4.0).is_ok());
        assert!(at(TAU / 4.0 + 0.01).is_err() && at(TAU / 2.0).is_err());
        let beyond =
            in_step(InSector { angle_rad: 0.1, growing: true }, &Sector { number: 4, ..sector }, 8.0, 0.1);
        assert!(matches!(beyond, Err(SamplingError::HeadCount { heads: 5 })), "{beyond:?}");
    }
}
