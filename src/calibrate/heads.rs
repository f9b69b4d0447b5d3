//! Estimates the mounts of the heads from their turns while the vehicle stands still in a tunnel of known profile.

use crate::calibrate::collect::Material;
use crate::calibrate::estimate::{Estimate, NotEstimated, median};
use crate::calibrate::fit::{ANGLE_SD_RAD, COMMON, Fit, OFFSET_SD_M, OWN, Problem, is_outlier, moved, own};
use crate::calibrate::scan::{HeadScan, Scan, gather};
use crate::calibrate::still::{Still, longest};
use headrace_fusion::section::{Echo, settle};
use headrace_geometry::frames::{Mount, Vec3};
use headrace_geometry::math::{self, TAU};
use headrace_sampling::head::MAX_HEADS;

/// A head is calibrated only if it has seen two opposite walls over at least this total angle, degrees.
const LEAST_OPPOSITE_DEG: f64 = 120.0;
/// Largest allowed median of the absolute range residuals, m. Above it, the wall doesn't match the profile.
const MOST_MEDIAN_M: f64 = 0.15;
/// Largest share of the vehicle file's standard deviation that an estimate may have. An estimate that is less certain
/// isn't reported.
const TOLD: f64 = 0.3;
/// Minimum difference in cost between the two senses of rotation, in squared standard deviations. Below it, the sense
/// isn't decided. Chance alone exceeds it once in 10,000 times.
const CLEAR: f64 = 15.0;
/// Number of starting angles in the search for a head's angle. `START_ROUNDS` is the number of rounds per start,
/// `START_STRIDE` the stride of the returns, and `ROUNDS` the number of rounds of all other fits.
const STARTS: usize = 24;
const START_ROUNDS: usize = 2;
const START_STRIDE: usize = 5;
const ROUNDS: usize = 12;

/// Estimates for one head, compared with the vehicle file.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Head {
    /// Number of the head's packet source.
    pub(crate) source: usize,
    /// Mount of the head in the vehicle file.
    pub(crate) filed: Mount,
    /// Estimated mount; the file's mount if there is no estimate.
    pub(crate) found: Mount,
    /// Sector from which the head received returns, degrees.
    pub(crate) seen_deg: f64,
    /// Number of the head's returns used in the fit.
    pub(crate) used: usize,
    /// Number of returns rejected as outliers, or because they grazed the wall.
    pub(crate) rejected: usize,
    /// Root mean square of the range residuals of the returns used, m.
    pub(crate) rms_m: f64,
    /// Angle to be added to the head's angle about its axis, radians, in the estimated sense of rotation.
    pub(crate) angle_rad: Result<Estimate, NotEstimated>,
    /// Offset to the left of the file's position, relative to the other heads, m.
    pub(crate) left_m: Result<Estimate, NotEstimated>,
    /// Offset upwards from the file's position, relative to the other heads, m.
    pub(crate) up_m: Result<Estimate, NotEstimated>,
    /// Whether the head turns the opposite way. It then faces aft instead of forward, or forward instead of
    /// aft.
    pub(crate) is_mirrored: Result<bool, NotEstimated>,
}

/// Estimates for all heads, and the vehicle's position.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Heads {
    /// Period in which the vehicle stood still.
    pub(crate) still: Still,
    /// y and z of the vehicle body's origin, m.
    pub(crate) place_m: [Estimate; 2],
    /// Relative excess of the ranges over those expected from the profile.
    pub(crate) scale: Estimate,
    /// Median of the absolute range residuals, m.
    pub(crate) median_m: f64,
    /// Estimates for each head, in the order of the heads' packet sources.
    pub(crate) heads: Vec<Head>,
}

/// Calibrates the heads from the longest time at rest.
///
/// Errors: the vehicle never stands still for long enough, no head turns once in that time, or the wall doesn't match
/// the profile.
pub(crate) fn heads(material: &Material<'_>) -> Result<Heads, NotEstimated> {
    let still = longest(material)?;
    let scan = gather(material, &still)?;
    let (mut scans, mut refused) = (Vec::new(), Vec::new());
    for head in &scan.heads {
        match check_evidence(head) {
            Ok(()) => scans.push(head.clone()),
            Err(why) => refused.push((head, why)),
        }
    }
    if let (true, Some(why)) = (scans.is_empty(), hardest(&refused)) {
        return Err(why);
    }
    let scan = Scan { heads: scans, ..scan };
    let mut found = match scan.heads.len() {
        1 => solve::<{ COMMON + OWN }>(material, &scan, still),
        2 => solve::<{ COMMON + 2 * OWN }>(material, &scan, still),
        3 | 4 => solve::<{ COMMON + 4 * OWN }>(material, &scan, still),
        _ => solve::<{ COMMON + MAX_HEADS * OWN }>(material, &scan, still),
    }?;
    found.heads.extend(refused.into_iter().map(|(head, why)| unseen(head, why)));
    found.heads.sort_unstable_by_key(|head| head.source);
    Ok(found)
}

/// Checks that a head has turned once, and seen opposite walls.
///
/// After less than a turn, a fit may have a small standard deviation and still be wrong, because the fit counts the
/// errors of neighbouring returns as independent. Errors that many returns share (footprint, wall, profile) then look
/// like another position of the vehicle and another angle of the head. Returns from opposite walls distinguish such
/// errors from a real offset.
fn check_evidence(head: &HeadScan) -> Result<(), NotEstimated> {
    let swept_deg = head.sweep.swept_rad().to_degrees();
    if !head.sweep.is_whole() {
        return Err(match head.sweep.missing_s() {
            Some(missing_s) => NotEstimated::PartOfTurn { swept_deg, missing_s: missing_s.ceil() },
            None => NotEstimated::OnlySector { swept_deg },
        });
    }
    let opposite_deg = head.opposite_rad().to_degrees();
    if opposite_deg < LEAST_OPPOSITE_DEG {
        return Err(NotEstimated::LittleWall { opposite_deg, least_deg: LEAST_OPPOSITE_DEG });
    }
    Ok(())
}

/// Reason to report if no head can be calibrated: the reason with the longest missing time, or else the first reason.
fn hardest(refused: &[(&HeadScan, NotEstimated)]) -> Option<NotEstimated> {
    let missing_s = |why: &NotEstimated| match why {
        NotEstimated::PartOfTurn { missing_s, .. } => *missing_s,
        _ => 0.0,
    };
    // The list is reversed because `max_by` returns the last of several equal reasons, but the first one is wanted.
    refused.iter().rev().map(|(_, why)| *why).max_by(|a, b| missing_s(a).total_cmp(&missing_s(b)))
}

/// Result for a head that was not calibrated for the reason `why`.
fn unseen(head: &HeadScan, why: NotEstimated) -> Head {
    Head {
        source: head.source,
        filed: head.mount,
        found: head.mount,
        seen_deg: head.seen_rad().to_degrees(),
        used: 0,
        rejected: head.returns.len(),
        rms_m: 0.0,
        angle_rad: Err(why),
        left_m: Err(why),
        up_m: Err(why),
        is_mirrored: Err(why),
    }
}

fn solve<const N: usize>(material: &Material<'_>, scan: &Scan, still: Still) -> Result<Heads, NotEstimated> {
    let place = first_place(material, scan);
    let guesses: Vec<[Guess; 2]> = scan
        .heads
        .iter()
        .map(|head| [false, true].map(|is_mirrored| search(material, scan, head, is_mirrored, place)))
        .collect();
    let senses = Senses::choose::<N>(material, scan, &guesses);
    let fit = joint::<N>(material, scan, &guesses, &senses.mirrored);
    let problem = problem(material, scan, &scan.heads, &senses.mirrored, 1);
    let residuals = problem.residuals(&fit.x);
    let mut sizes: Vec<f64> =
        residuals.iter().filter_map(|one| one.row.map(|(_, off_m)| off_m.abs())).collect();
    let median_m = median(&mut sizes).unwrap_or(f64::INFINITY);
    if median_m > MOST_MEDIAN_M {
        return Err(NotEstimated::Contradicted { median_m, most_m: MOST_MEDIAN_M });
    }
    let count = scan.heads.len();
    let heads = scan.heads.iter().enumerate().map(|(number, head)| {
        let mut used = (0, 0.0);
        for (_, off_m) in residuals.iter().filter(|one| one.head == number).filter_map(|one| one.row) {
            if !is_outlier(off_m, fit.scale_m) {
                used = (used.0 + 1, used.1 + off_m * off_m);
            }
        }
        let is_mirrored = senses.of(number);
        let angle_rad = angle(&fit, number);
        let [left_m, up_m] = [1, 2].map(|i| offset(&fit, number, i, count));
        let value = |of: &Result<Estimate, NotEstimated>| of.as_ref().map_or(0.0, |of| of.value);
        let turned = senses.mirrored.get(number).copied().unwrap_or(false);
        Head {
            source: head.source,
            filed: head.mount,
            found: moved(&head.mount, [value(&angle_rad), value(&left_m), value(&up_m)], turned),
            seen_deg: head.seen_rad().to_degrees(),
            used: used.0,
            rejected: head.returns.len() - used.0,
            rms_m: math::sqrt(used.1 / (used.0.max(1) as f64)),
            angle_rad,
            left_m,
            up_m,
            is_mirrored,
        }
    });
    let heads = heads.collect();
    let [y, z, scale] = [0, 1, 5].map(|i| estimate(&fit, &[(i, 1.0)]));
    Ok(Heads { still, place_m: [y, z], scale, median_m, heads })
}

/// Position of the vehicle, from the echosounders. Without echosounders, it is the centre of the cross-section.
fn first_place(material: &Material<'_>, scan: &Scan) -> [f64; 2] {
    let start = material.profile.reference();
    let echoes = scan.echoes.iter().map(|echo| Echo { mount: echo.mount, range_m: echo.range_m });
    settle(material.profile, scan.attitude, start, (start, [2.0; 2]), material.settings.echo_sd_m, &echoes)
        .at_m
}

fn problem<'a>(
    material: &'a Material<'_>,
    scan: &'a Scan,
    heads: &'a [HeadScan],
    mirrored: &'a [bool],
    stride: usize,
) -> Problem<'a> {
    Problem {
        profile: material.profile,
        settings: &material.settings,
        heads,
        echoes: &scan.echoes,
        attitude: scan.attitude,
        mirrored,
        stride,
    }
}

/// Fit of one head alone. Its unknowns are the common ones and those of the head.
type Guess = Fit<{ COMMON + OWN }>;

/// Best fit of one head alone, over all angles.
fn search(
    material: &Material<'_>,
    scan: &Scan,
    head: &HeadScan,
    is_mirrored: bool,
    [y_m, z_m]: [f64; 2],
) -> Guess {
    let (heads, mirrored) = (core::slice::from_ref(head), [is_mirrored]);
    let coarse = problem(material, scan, heads, &mirrored, START_STRIDE);
    let mut best: Option<Guess> = None;
    for start in 0..STARTS {
        let angle_rad = math::wrap_signed(start as f64 * TAU / STARTS as f64, TAU);
        let fit = coarse.fit([y_m, z_m, 0.0, 0.0, 0.0, 0.0, angle_rad, 0.0, 0.0], START_ROUNDS);
        if best.as_ref().is_none_or(|best| fit.cost < best.cost) {
            best = Some(fit);
        }
    }
    let start = best.map_or([0.0; COMMON + OWN], |best| best.x);
    problem(material, scan, heads, &mirrored, 1).fit(start, ROUNDS)
}

/// Fits all heads together. The fit of each head alone is the start.
fn joint<const N: usize>(
    material: &Material<'_>,
    scan: &Scan,
    guesses: &[[Guess; 2]],
    mirrored: &[bool],
) -> Fit<N> {
    let mut start = [0.0; N];
    let chosen = guesses
        .iter()
        .zip(mirrored)
        .map(|([straight, other], is_mirrored)| if *is_mirrored { other } else { straight });
    let share = 1.0 / guesses.len().max(1) as f64;
    for (number, guess) in chosen.enumerate() {
        for (slot, value) in start.iter_mut().zip(guess.x.iter().take(2)) {
            *slot += share * value;
        }
        for (slot, value) in start.iter_mut().skip(own(number, 0)).zip(guess.x.iter().skip(COMMON).take(1)) {
            *slot = *value;
        }
    }
    if !material
        .profile
        .contains([start.first().copied().unwrap_or(0.0), start.get(1).copied().unwrap_or(0.0)])
    {
        for (slot, value) in start.iter_mut().zip(material.profile.reference()) {
            *slot = value;
        }
    }
    problem(material, scan, &scan.heads, mirrored, 1).fit(start, ROUNDS)
}

/// Direction of rotation of each head: whether it is opposite to the direction in the vehicle file, and by how much the
/// cost of the fit rises if the head turns the other way.
struct Senses {
    mirrored: Vec<bool>,
    margins: Vec<f64>,
}

impl Senses {
    /// Chooses the directions of rotation that fit best, one head at a time. Keeps the directions in the vehicle
    /// file unless others fit clearly better.
    ///
    /// In a symmetric cross-section, there is a second solution: the vehicle is on the other side, and all heads turn
    /// the opposite way. This second solution is tried, too.
    fn choose<const N: usize>(material: &Material<'_>, scan: &Scan, guesses: &[[Guess; 2]]) -> Self {
        let count = scan.heads.len();
        let cost = |mirrored: &[bool]| joint::<N>(material, scan, guesses, mirrored).cost;
        let other = |mirrored: &[bool], which: usize| -> Vec<bool> {
            let turned = |(number, is): (usize, &bool)| *is != (which == count || which == number);
            mirrored.iter().enumerate().map(turned).collect()
        };
        let filed = vec![false; count];
        let filed_cost = cost(&filed);
        let (mut best, mut best_cost) = (filed.clone(), filed_cost);
        let mut margins = vec![0.0; count];
        for _ in 0..=count {
            let costs: Vec<f64> = (0..=count).map(|which| cost(&other(&best, which))).collect();
            let all = costs.last().copied().unwrap_or(f64::INFINITY);
            margins = costs.iter().take(count).map(|one| one.min(all) - best_cost).collect();
            let better = costs.iter().enumerate().min_by(|a, b| a.1.total_cmp(b.1));
            match better {
                Some((which, least)) if *least < best_cost => {
                    best = other(&best, which);
                    best_cost = *least;
                }
                _ => break,
            }
        }
        if filed_cost - best_cost < CLEAR {
            best = filed;
        }
        Self { mirrored: best, margins }
    }

    fn of(&self, head: usize) -> Result<bool, NotEstimated> {
        let margin = self.margins.get(head).copied().unwrap_or(0.0);
        if margin < CLEAR {
            return Err(NotEstimated::Mirror { margin: margin.max(0.0), needed: CLEAR });
        }
        Ok(self.mirrored.get(head).copied().unwrap_or(false))
    }
}

/// Estimate of a sum of unknowns, in which each unknown has a weight.
fn estimate<const N: usize>(fit: &Fit<N>, parts: &[(usize, f64)]) -> Estimate {
    let mut h = [0.0; N];
    let mut value = 0.0;
    for (i, share) in parts {
        if let Some(slot) = h.get_mut(*i) {
            *slot += share;
        }
        value += share * fit.x.get(*i).copied().unwrap_or(0.0);
    }
    Estimate { value, sd: math::sqrt(fit.factors.variance_along(&h)) }
}

fn angle<const N: usize>(fit: &Fit<N>, head: usize) -> Result<Estimate, NotEstimated> {
    let angle = estimate(fit, &[(own(head, 0), 1.0)]);
    if angle.sd > TOLD * ANGLE_SD_RAD {
        return Err(NotEstimated::Round { sd_deg: angle.sd.to_degrees() });
    }
    Ok(angle)
}

/// Offset of a head from the file's position, relative to the mean of all heads.
fn offset<const N: usize>(
    fit: &Fit<N>,
    head: usize,
    i: usize,
    count: usize,
) -> Result<Estimate, NotEstimated> {
    if count < 2 {
        return Err(NotEstimated::OneHead);
    }
    let share = |other: usize| f64::from(u8::from(other == head)) - 1.0 / count as f64;
    let parts: Vec<(usize, f64)> = (0..count).map(|other| (own(other, i), share(other))).collect();
    let apart = estimate(fit, &parts);
    if apart.sd > TOLD * OFFSET_SD_M {
        return Err(NotEstimated::LikePlace { sd_m: apart.sd });
    }
    Ok(apart)
}

impl Heads {
    /// Height above the tunnel's floor, m, of a point at `up_m` from the body's origin, m.
    pub(crate) fn height_m(&self, up_m: Vec3<headrace_geometry::frames::Tunnel>) -> Estimate {
        let [_, z] = self.place_m;
        Estimate { value: z.value + up_m.z(), sd: z.sd }
    }
}
