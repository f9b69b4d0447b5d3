//! Planned spacing of samples by place on the wall, and planned positions of the samples.

use super::planner::{Planner, RING, stride_of};
use crate::error::{SamplingError, positive};
use crate::head::{HeadProgram, HeadSpec};
use crate::ring::{Ring, Standing};
use crate::{layout, spacing};
use headrace_geometry::math;
use headrace_geometry::time::DurNs;

/// Spacing of samples at a place on the wall, with the vehicle at the nominal pose.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WallPlace {
    /// Arc length of the place on the wall, m.
    pub arc_m: f64,
    /// Largest distance between neighbouring samples of one turn on the wall, m, over the heads that see the place.
    pub t_y_m: f64,
    /// Smaller and larger distance between successive passes, m; `None` if no head sees the place.
    ///
    /// The two distances differ only in sectors, where smaller and larger distances alternate.
    pub t_x_m: Option<[f64; 2]>,
    /// T at the place, m, from `t_y_m` and the larger `t_x_m`; `None` if no head sees the place.
    pub t_m: Option<f64>,
}

/// A sample of the planned pattern.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PatternSample {
    /// Number of the head that takes the sample.
    pub head: usize,
    /// Chainage of the sample, m, relative to the vehicle's origin at the start.
    pub x_m: f64,
    /// Arc length of the sample on the wall, m.
    pub arc_m: f64,
    /// Whether the vehicle hides the sample's place from the head.
    pub hidden: bool,
    /// Whether the sample is the head's first, or the first after a turning point of the sweep.
    pub new_sweep: bool,
}

impl Planner {
    /// Returns the spacing in a mode at a speed, at `places` equidistant places around the perimeter.
    ///
    /// Errors: a speed that isn't above zero; as for [`Standing::sounding`].
    pub fn perimeter(
        &self,
        mode: usize,
        speed_mps: f64,
        places: usize,
    ) -> Result<Vec<WallPlace>, SamplingError> {
        positive("the speed in m/s", speed_mps)?;
        let planned = self.modes().get(mode).ok_or(SamplingError::NoCommonMode)?;
        let specs = self.specs(mode);
        let programs = layout::programs(&specs, self.inspection().layout, 0.0)?;
        let mut around = Around::new(self.inspection().profile.perimeter_m(), places);
        for (number, (spec, program)) in specs.iter().zip(&programs).enumerate() {
            around.add(self, number, spec, program)?;
        }
        let passes = planned.passes();
        let ping_s = planned.ping_period_s();
        let strips = self.nominal_strips().ok_or(SamplingError::NoCommonMode)?;
        let seen_by = |arc_m: f64| strips.at(arc_m).map(|strip| strip.seen_by);
        let place = |k: usize| {
            let arc_m = around.arc_m(k);
            let gap_s = seen_by(arc_m).and_then(|heads| passes.gap_s(heads));
            let share = around.share.get(k).copied().flatten();
            let t_x_m = gap_s.map(|gap_s| {
                let longest_m = speed_mps * gap_s;
                // In a sector, two distances between passes alternate; `longest_m` is the sum of both.
                share.map_or([longest_m; 2], |share| layout::divided_m(longest_m, share))
            });
            let t_y_m = around.t_y_m.get(k).copied().unwrap_or(0.0);
            let t_m = t_x_m.map(|[_, larger]| spacing::t_max_m(larger, speed_mps * ping_s, t_y_m));
            WallPlace { arc_m, t_y_m, t_x_m, t_m }
        };
        Ok((0..places).map(place).collect())
    }

    /// Returns the samples of a number of turns in a mode at a speed.
    ///
    /// Samples are sorted by head, then by time.
    ///
    /// Errors: a speed or number of turns that isn't above zero; as for [`Standing::sounding`].
    pub fn pattern(
        &self,
        mode: usize,
        speed_mps: f64,
        turns: f64,
    ) -> Result<Vec<PatternSample>, SamplingError> {
        positive("the number of turns", turns)?;
        let schedule = self.schedule(mode, speed_mps)?;
        let pose = self.nominal_pose();
        let mut samples = Vec::new();
        for (head, (spec, hidden)) in self.specs(mode).iter().zip(self.hidden()).enumerate() {
            let standing = Standing::new(&self.inspection().profile, &pose, &spec.mount)?;
            let pings = math::floor_to_i64(turns * math::TAU / spec.step_rad + 1e-6).min(1_000_000);
            let (mut last, mut growing) = (None, None);
            for ping in 0..=pings {
                let since_s = ping as f64 * spec.ping_period_s;
                let Some(angle_rad) = schedule.angle_rad(head, DurNs::from_secs_f64(since_s)) else {
                    debug_assert!(false, "head {head} is scheduled from the start on: {since_s} s");
                    continue;
                };
                let grows = last.map(|last| math::wrap_signed(angle_rad - last, math::TAU) > 0.0);
                let sounding = standing.sounding(angle_rad)?;
                samples.push(PatternSample {
                    head,
                    x_m: speed_mps * since_s + spec.mount.position.x() + sounding.beam.x(),
                    arc_m: sounding.arc_m,
                    hidden: hidden.iter().any(|range| range.has(angle_rad)),
                    new_sweep: last.is_none() || growing.is_some() && grows != growing,
                });
                (last, growing) = (Some(angle_rad), grows.or(growing));
            }
        }
        Ok(samples)
    }
}

/// Equidistant places around the perimeter, with the spacing of samples from the heads added so far.
struct Around {
    perimeter_m: f64,
    t_y_m: Vec<f64>,
    /// Position of each place within the sector of the head that sweeps it, from 0 to 1.
    share: Vec<Option<f64>>,
}

impl Around {
    fn new(perimeter_m: f64, places: usize) -> Self {
        Self { perimeter_m, t_y_m: vec![0.0; places], share: vec![None; places] }
    }

    fn arc_m(&self, place: usize) -> f64 {
        self.perimeter_m * (place as f64 + 0.5) / self.t_y_m.len() as f64
    }

    /// Records the distance between two neighbouring samples of a head, at each place between them that the head sees.
    fn add(
        &mut self,
        planner: &Planner,
        number: usize,
        spec: &HeadSpec,
        program: &HeadProgram,
    ) -> Result<(), SamplingError> {
        let standing = Standing::new(&planner.inspection().profile, &planner.nominal_pose(), &spec.mount)?;
        let ring = Ring::cast(&standing, 0.0, RING)?;
        let hidden = planner.hidden().get(number).map_or(&[][..], Vec::as_slice);
        let places = self.t_y_m.len();
        let stride = stride_of(spec.step_rad);
        for ((sounding, next), step_m) in ring.pairs(stride).zip(ring.steps_m(stride)) {
            if hidden.iter().any(|range| range.has(sounding.angle_rad)) {
                continue;
            }
            let share = program.sector.map(|(least_rad, size_rad)| {
                math::wrap(sounding.angle_rad - least_rad, math::TAU) / size_rad
            });
            if share.is_some_and(|share| share > 1.0) {
                continue;
            }
            let way_m = math::wrap_signed(next.arc_m - sounding.arc_m, self.perimeter_m);
            let from_m = if way_m < 0.0 { next.arc_m } else { sounding.arc_m };
            let place_m = self.perimeter_m / places as f64;
            let first = math::floor_to_i64(from_m / place_m);
            let last = math::floor_to_i64((from_m + way_m.abs()) / place_m);
            for place in first..=last {
                let Ok(place) = usize::try_from(place.rem_euclid(places as i64)) else {
                    debug_assert!(false, "place {place} is one of {places} round the perimeter");
                    continue;
                };
                if let (Some(t_y_m), Some(here)) = (self.t_y_m.get_mut(place), self.share.get_mut(place)) {
                    *t_y_m = t_y_m.max(step_m);
                    *here = here.or(share);
                }
            }
        }
        Ok(())
    }
}
