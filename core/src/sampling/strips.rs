//! The wall around a vehicle as strips, each seen by the same heads, and the spacing that comes of it.

use super::error::SamplingError;
use super::head::{HeadSet, MAX_HEADS};
use super::occlusion::AngleRange;
use super::passes::Passes;
use super::ring::Standing;
use super::spacing;
use crate::math;

/// Strips narrower than this are rounding, m.
const NO_WIDTH_M: f64 = 1e-9;

/// An interval of the perimeter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Arc {
    /// Arc length at which it begins, m.
    pub from_m: f64,
    /// Its length towards growing arc length, m.
    pub length_m: f64,
}

impl Arc {
    /// What a range of a head's angles covers of the wall.
    ///
    /// Errors: as for [`Standing::sounding`].
    pub fn of(standing: &Standing<'_>, angles: &AngleRange) -> Result<Self, SamplingError> {
        let sigma_m = |angle_rad| standing.sounding(angle_rad).map(|sounding| sounding.sigma_m);
        let perimeter_m = standing.perimeter_m();
        if angles.size_rad >= math::TAU {
            return Ok(Self { from_m: 0.0, length_m: perimeter_m });
        }
        let (first, last) = (sigma_m(angles.from_rad)?, sigma_m(angles.from_rad + angles.size_rad)?);
        let (middle, whole) = (
            math::wrap(sigma_m(angles.middle_rad())? - first, perimeter_m),
            math::wrap(last - first, perimeter_m),
        );
        // A head that faces aft sweeps the wall the other way.
        Ok(if middle <= whole {
            Self { from_m: first, length_m: whole }
        } else {
            Self { from_m: last, length_m: perimeter_m - whole }
        })
    }

    fn has(&self, sigma_m: f64, perimeter_m: f64) -> bool {
        math::wrap(sigma_m - self.from_m, perimeter_m) <= self.length_m
    }
}

/// What one head sees of the wall.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct View {
    /// Its sector; `None` for all around.
    pub sector: Option<Arc>,
    /// What is hidden from it.
    pub hidden: Vec<Arc>,
}

/// A strip of the wall along the tunnel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Strip {
    /// Where on the perimeter.
    pub arc: Arc,
    /// The heads that see it.
    pub seen_by: HeadSet,
}

/// The strips of a wall, in order of arc length, neighbours seen by different heads; one strip where all see all.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Strips {
    strips: Vec<Strip>,
    edges_m: Vec<f64>,
    perimeter_m: f64,
}

impl Strips {
    /// Without strips, but with room for those that so many arcs make.
    pub fn with_room(arcs: usize) -> Self {
        Self {
            strips: Vec::with_capacity(2 * arcs + 1),
            edges_m: Vec::with_capacity(2 * arcs),
            perimeter_m: 0.0,
        }
    }

    /// The strips that these views make.
    ///
    /// Allocates: not when there is room for their sectors and hidden arcs.
    pub fn rebuild(&mut self, perimeter_m: f64, views: &[View]) {
        self.perimeter_m = perimeter_m;
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
            let seen_by = seen_by(views, from_m + arc.length_m / 2.0, perimeter_m);
            match self.strips.last_mut() {
                Some(last) if last.seen_by == seen_by => last.arc.length_m += arc.length_m,
                _ => self.strips.push(Strip { arc, seen_by }),
            }
        }
        if self.strips.is_empty() {
            let arc = Arc { from_m: 0.0, length_m: perimeter_m };
            self.strips.push(Strip { arc, seen_by: seen_by(views, 0.0, perimeter_m) });
        }
    }

    /// The strips.
    pub fn as_slice(&self) -> &[Strip] {
        &self.strips
    }

    /// T_max predicted at a speed, m: the largest of any strip. `t_y_m` is the largest step of a head within a turn.
    ///
    /// On a strip that some heads don't see, passes are farther apart; but the strip is no wider than it is, so that
    /// its width and a step bound the distance between samples on its sides, too.
    pub fn t_max_m(&self, passes: &Passes, speed_mps: f64, ping_period_s: f64, t_y_m: f64) -> f64 {
        let t_m =
            |limit: Limit| spacing::t_max_m(speed_mps * limit.gap_s, speed_mps * ping_period_s, limit.t_y_m);
        self.limits(passes, t_y_m)
            .map(|(within, across)| within.map_or(f64::INFINITY, t_m).min(across.map_or(f64::INFINITY, t_m)))
            .fold(0.0, f64::max)
    }

    /// The largest speed at which [`Strips::t_max_m`] meets a target, m/s, the passes being what they are at any speed.
    ///
    /// Errors: a strip on which neighbouring samples are as far apart as the target at any speed.
    pub fn speed_for_target_mps(
        &self,
        passes: &Passes,
        target_m: f64,
        ping_period_s: f64,
        t_y_m: f64,
    ) -> Result<f64, SamplingError> {
        let mut slowest = f64::INFINITY;
        for (within, across) in self.limits(passes, t_y_m) {
            let speed = |limit: Limit| {
                spacing::speed_for_target_mps(target_m, limit.t_y_m, limit.gap_s, ping_period_s)
            };
            let fastest = [within, across].into_iter().flatten().filter_map(speed).max_by(f64::total_cmp);
            let least_t_y_m =
                [within, across].into_iter().flatten().map(|limit| limit.t_y_m).fold(f64::INFINITY, f64::min);
            let fastest = fastest.ok_or(SamplingError::AngularStep { target_m, t_y_m: least_t_y_m })?;
            slowest = slowest.min(fastest);
        }
        Ok(slowest)
    }

    /// For each strip what bounds T within it, where any head sees it, and across it, where not all do.
    fn limits(&self, passes: &Passes, t_y_m: f64) -> impl Iterator<Item = (Option<Limit>, Option<Limit>)> {
        let all = passes.heads();
        let best_s =
            self.strips.iter().filter_map(|strip| passes.gap_s(strip.seen_by)).fold(f64::INFINITY, f64::min);
        let full = move |strip: &Strip| passes.gap_s(strip.seen_by).is_some_and(|gap_s| gap_s <= best_s);
        self.strips.iter().enumerate().map(move |(k, strip)| {
            let within = passes.gap_s(strip.seen_by).map(|gap_s| Limit { gap_s, t_y_m });
            let across = (!full(strip) && !all.is_empty())
                .then(|| Limit { gap_s: best_s, t_y_m: self.run_m(k, &full) + t_y_m })
                .filter(|limit| limit.gap_s.is_finite() && limit.t_y_m < self.perimeter_m);
            (within, across)
        })
    }

    /// Width of the strips about strip `k` that aren't `full`, m.
    fn run_m(&self, k: usize, full: &impl Fn(&Strip) -> bool) -> f64 {
        let count = self.strips.len();
        let width = |number: usize| self.strips.get(number % count).map_or(0.0, |strip| strip.arc.length_m);
        let stays = |number: usize| self.strips.get(number % count).is_some_and(|strip| !full(strip));
        let forward: f64 = (k..k + count).take_while(|number| stays(*number)).map(width).sum();
        let back: f64 =
            (1..count).map(|step| k + count - step).take_while(|number| stays(*number)).map(width).sum();
        (forward + back).min(self.perimeter_m)
    }
}

/// Passes this far apart in time, and neighbours within a turn this far apart on the wall.
#[derive(Debug, Clone, Copy)]
struct Limit {
    gap_s: f64,
    t_y_m: f64,
}

fn seen_by(views: &[View], sigma_m: f64, perimeter_m: f64) -> HeadSet {
    let sees = |view: &View| {
        view.sector.is_none_or(|sector| sector.has(sigma_m, perimeter_m))
            && !view.hidden.iter().any(|hidden| hidden.has(sigma_m, perimeter_m))
    };
    let heads = views.iter().take(MAX_HEADS).enumerate().filter(|(_, view)| sees(view));
    heads.fold(HeadSet::default(), |set, (head, _)| set.with(head))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn arc(from_m: f64, length_m: f64) -> Arc {
        Arc { from_m, length_m }
    }

    fn strips(views: &[View]) -> Strips {
        let mut strips = Strips::default();
        strips.rebuild(30.0, views);
        strips
    }

    fn all_around(hidden: &[Arc]) -> View {
        View { sector: None, hidden: hidden.to_vec() }
    }

    #[test]
    fn where_all_see_all_there_is_one_strip() {
        let one = strips(&[all_around(&[]), all_around(&[])]);
        assert_eq!(one.as_slice(), [Strip { arc: arc(0.0, 30.0), seen_by: HeadSet::first(2) }]);
        let passes = Passes::evenly_phased(HeadSet::first(2), 8.0).unwrap();
        let v = one.speed_for_target_mps(&passes, 0.5, 0.02, 0.2).unwrap();
        assert!((v - spacing::speed_for_target_mps(0.5, 0.2, 4.0, 0.02).unwrap()).abs() < 1e-15);
        assert!((one.t_max_m(&passes, v, 0.02, 0.2) - 0.5).abs() < 1e-12);
    }

    #[test]
    fn a_hidden_strip_crosses_the_seam() {
        let some = strips(&[all_around(&[arc(29.0, 2.0)]), all_around(&[])]);
        let widths: Vec<f64> = some.as_slice().iter().map(|strip| strip.arc.length_m).collect();
        assert_eq!(widths, [28.0, 2.0]);
        assert_eq!(some.as_slice()[1].seen_by, HeadSet::first(2).without(0));
    }

    #[test]
    fn fewer_passes_on_a_hidden_strip_slow_the_vehicle_down() {
        let views =
            [all_around(&[arc(7.0, 1.7)]), all_around(&[]), all_around(&[arc(7.0, 1.7)]), all_around(&[])];
        let passes = Passes::evenly_phased(HeadSet::first(4), 8.0).unwrap();
        let hidden = strips(&views);
        let v = hidden.speed_for_target_mps(&passes, 0.5, 0.02, 0.16).unwrap();
        assert!((v - spacing::speed_for_target_mps(0.5, 0.16, 4.0, 0.02).unwrap()).abs() < 1e-15);
        assert!((hidden.t_max_m(&passes, v, 0.02, 0.16) - 0.5).abs() < 1e-12);
    }

    #[test]
    fn a_narrow_hidden_strip_counts_as_a_long_step_if_that_is_better() {
        let views = [all_around(&[arc(7.0, 0.1)]), all_around(&[])];
        let passes = Passes::evenly_phased(HeadSet::first(2), 8.0).unwrap();
        let v = strips(&views).speed_for_target_mps(&passes, 0.5, 0.02, 0.16).unwrap();
        assert!((v - spacing::speed_for_target_mps(0.5, 0.26, 4.0, 0.02).unwrap()).abs() < 1e-15);
    }

    #[test]
    fn a_strip_that_no_head_sees_can_make_every_speed_too_high() {
        let views = [all_around(&[arc(7.0, 0.7)]), all_around(&[arc(7.0, 0.7)])];
        let passes = Passes::evenly_phased(HeadSet::first(2), 8.0).unwrap();
        let why = strips(&views).speed_for_target_mps(&passes, 0.5, 0.02, 0.16).unwrap_err();
        assert!(
            matches!(why, SamplingError::AngularStep { t_y_m, .. } if (t_y_m - 0.86).abs() < 1e-9),
            "{why}"
        );
        assert!(strips(&views).speed_for_target_mps(&passes, 1.0, 0.02, 0.16).is_ok());
        let blind = [all_around(&[arc(0.0, 30.0)])];
        let one = Passes::evenly_phased(HeadSet::first(1), 8.0).unwrap();
        assert!(strips(&blind).speed_for_target_mps(&one, 0.5, 0.02, 0.16).is_err());
        assert!(strips(&blind).t_max_m(&one, 0.1, 0.02, 0.16).is_infinite());
    }

    #[test]
    fn sectors_that_leave_a_place_out_are_noticed() {
        let views = [
            View { sector: Some(arc(0.2, 14.8)), hidden: Vec::new() },
            View { sector: Some(arc(15.0, 14.9)), hidden: Vec::new() },
        ];
        let passes = Passes::in_sectors(HeadSet::first(2), 8.0, 8.0).unwrap();
        let some = strips(&views);
        let unseen: Vec<&Strip> = some.as_slice().iter().filter(|strip| strip.seen_by.is_empty()).collect();
        assert!(unseen.len() == 1 && (unseen[0].arc.length_m - 0.3).abs() < 1e-9);
        let v = some.speed_for_target_mps(&passes, 1.0, 0.02, 0.16).unwrap();
        assert!((v - spacing::speed_for_target_mps(1.0, 0.46, 8.0, 0.02).unwrap()).abs() < 1e-12);
    }
}
