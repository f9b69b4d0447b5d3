//! Briefing of the crew: angles hidden from the heads, start angles of the heads, and interference between heads.

use serde::Serialize;

use super::planner::Planner;
use crate::error::SamplingError;
use crate::interference;
use crate::layout::{self, HeadLayout};
use crate::ring::Standing;
use crate::strips::Arc;
use headrace_geometry::math::{self, TAU};

/// The briefing of the crew for one mode of the heads at one speed.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Briefing {
    /// The mode of the heads.
    pub mode: &'static str,
    /// The vehicle's speed to which the briefing applies, m/s.
    pub speed_mps: f64,
    /// Angles hidden from each head.
    pub hidden: Vec<Hidden>,
    /// Strips of the wall with fewer passes than the rest of the wall, or with no passes.
    pub strips: Vec<ThinStrip>,
    /// Start angle and direction of each head.
    pub starts: Vec<Start>,
    /// Spacing rule for each head that is behind the foremost head.
    pub hull_rules: Vec<HullAdvice>,
    /// Pairs of heads that can receive each other's pings.
    pub exposures: Vec<Heard>,
}

/// A range of angles that the vehicle hides from a head.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Hidden {
    /// Number of the head from which the angles are hidden.
    pub head: usize,
    /// Middle of the hidden angle range, degrees in the sensor frame.
    pub middle_deg: f64,
    /// Size of the hidden angle range, degrees.
    pub size_deg: f64,
    /// Length of the wall hidden from the head, around the perimeter, m.
    pub wall_m: f64,
    /// Clock position of the middle of the hidden wall, looking along the tunnel.
    pub clock: String,
}

/// A strip of the wall that the heads pass less often than the rest of the wall.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ThinStrip {
    /// Arc length of the strip's start, m.
    pub from_m: f64,
    /// Width of the strip, m.
    pub width_m: f64,
    /// Clock position of the strip's middle.
    pub clock: String,
    /// The heads that see the strip.
    pub seen_by: Vec<usize>,
    /// Ratio of the strip's T_x to the smallest T_x of any strip; `None` if no head sees the strip.
    pub t_x_factor: Option<f64>,
}

/// Start of a head's rotation program.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Start {
    /// Number of the head that is started.
    pub head: usize,
    /// Angle of the first ping, degrees in the sensor frame.
    pub angle_deg: f64,
    /// Whether the head's angle grows after the first ping.
    pub growing: bool,
    /// Smallest angle of the head's sector, and size of the sector, degrees; `None` without a sector.
    pub sector_deg: Option<[f64; 2]>,
}

/// The rule x = q v T / s for the distance x of a head behind the foremost of s heads; see [`layout::HullRule`].
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct HullAdvice {
    /// Number of the head to which the rule applies.
    pub head: usize,
    /// Distance x of the head behind the foremost head, m.
    pub behind_m: f64,
    /// q: number of T / s (turn period / heads) in which the vehicle travels the distance x, rounded to a whole number.
    pub q: u32,
    /// Speed v that meets the rule with the present distance `behind_m`, m/s.
    pub speed_mps: f64,
    /// Distance x that meets the rule at the speed of the briefing, m.
    pub apart_m: f64,
}

/// Time for which two heads can receive each other's pings.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Heard {
    /// Numbers of the two heads.
    pub heads: [usize; 2],
    /// Time for which each beam points at the other head, seconds per turn or sweep.
    pub facing_s: f64,
    /// Time for which the beams hit the same patch of wall, seconds per turn or sweep.
    pub same_patch_s: f64,
    /// Period of the heads' turn or sweep, seconds.
    pub of_s: f64,
}

impl Planner {
    /// Returns the briefing for a mode at a speed, with the vehicle at the nominal pose.
    ///
    /// Errors: a speed that isn't above zero.
    pub fn briefing(&self, mode: usize, speed_mps: f64) -> Result<Briefing, SamplingError> {
        let name = self.modes().get(mode).ok_or(SamplingError::NoCommonMode)?.mode.name;
        Ok(Briefing {
            mode: name,
            speed_mps,
            hidden: self.hidden_ranges()?,
            strips: self.thin_strips(mode),
            starts: self.starts(mode, speed_mps)?,
            hull_rules: self.hull_rules(mode, speed_mps)?,
            exposures: self.exposures(mode, speed_mps)?,
        })
    }

    fn hidden_ranges(&self) -> Result<Vec<Hidden>, SamplingError> {
        let (profile, pose) = (&self.inspection().profile, self.nominal_pose());
        let mut found = Vec::new();
        for (head, ((spec, _), ranges)) in self.inspection().heads.iter().zip(self.hidden()).enumerate() {
            let standing = Standing::new(profile, &pose, &spec.mount)?;
            for range in ranges {
                let arc = Arc::of(&standing, range)?;
                found.push(Hidden {
                    head,
                    middle_deg: math::wrap(range.middle_rad(), TAU).to_degrees(),
                    size_deg: range.size_rad.to_degrees(),
                    wall_m: arc.length_m,
                    clock: profile.clock(arc.from_m + arc.length_m / 2.0),
                });
            }
        }
        Ok(found)
    }

    fn thin_strips(&self, mode: usize) -> Vec<ThinStrip> {
        let (Some(strips), Some(planned)) = (self.nominal_strips(), self.modes().get(mode)) else {
            return Vec::new();
        };
        let passes = planned.passes();
        let gaps = || strips.as_slice().iter().filter_map(|strip| passes.gap_s(strip.seen_by));
        let least_s = gaps().fold(f64::INFINITY, f64::min);
        let factor = |strip: &crate::strips::Strip| Some(passes.gap_s(strip.seen_by)? / least_s);
        let thin =
            strips.as_slice().iter().filter(|strip| factor(strip).is_none_or(|factor| factor > 1.0 + 1e-9));
        thin.map(|strip| ThinStrip {
            from_m: strip.arc.from_m,
            width_m: strip.arc.length_m,
            clock: self.inspection().profile.clock(strip.arc.from_m + strip.arc.length_m / 2.0),
            seen_by: strip.seen_by.iter().collect(),
            t_x_factor: factor(strip),
        })
        .collect()
    }

    fn starts(&self, mode: usize, speed_mps: f64) -> Result<Vec<Start>, SamplingError> {
        let schedule = self.schedule(mode, speed_mps)?;
        let start = |(head, program): (usize, &crate::head::HeadProgram)| Start {
            head,
            angle_deg: math::wrap(program.start_rad, TAU).to_degrees(),
            growing: program.growing,
            sector_deg: program.sector.map(|(least, size)| [least.to_degrees(), size.to_degrees()]),
        };
        Ok(schedule.programs().enumerate().map(start).collect())
    }

    fn hull_rules(&self, mode: usize, speed_mps: f64) -> Result<Vec<HullAdvice>, SamplingError> {
        let specs = self.specs(mode);
        let Some(planned) = self.modes().get(mode) else {
            debug_assert!(false, "mode {mode} of a briefing is one of {}", self.modes().len());
            return Ok(Vec::new());
        };
        if self.inspection().layout != HeadLayout::PhaseShift {
            return Ok(Vec::new());
        }
        let foremost_m = specs.iter().map(|spec| spec.mount.position.x()).fold(f64::MIN, f64::max);
        let mut rules = Vec::new();
        for (head, spec) in specs.iter().enumerate() {
            let behind_m = foremost_m - spec.mount.position.x();
            if behind_m > 0.0 {
                let period_s = planned.mode.turn.period_s();
                let rule = layout::hull_rule(behind_m, specs.len(), speed_mps, period_s)?;
                rules.push(HullAdvice {
                    head,
                    behind_m,
                    q: rule.q,
                    speed_mps: rule.speed_mps,
                    apart_m: rule.apart_m,
                });
            }
        }
        Ok(rules)
    }

    fn exposures(&self, mode: usize, speed_mps: f64) -> Result<Vec<Heard>, SamplingError> {
        let schedule = self.schedule(mode, speed_mps)?;
        let profile = &self.inspection().profile;
        let found = interference::exposures(&self.specs(mode), &schedule, profile, &self.nominal_pose())?;
        let heard = |exposure: interference::Exposure| Heard {
            heads: [exposure.heads.0, exposure.heads.1],
            facing_s: exposure.facing_s,
            same_patch_s: exposure.same_patch_s,
            of_s: exposure.of_s,
        };
        Ok(found.into_iter().map(heard).collect())
    }
}
