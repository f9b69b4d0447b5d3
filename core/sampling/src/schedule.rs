//! The scheduled angle of each head over time.

use super::error::SamplingError;
use super::head::{HeadProgram, HeadSpec};
use super::layout::{self, HeadLayout, steps_over};
use headrace_geometry::math;
use headrace_geometry::time::DurNs;

/// Rotation programs of the heads, and the head angles that result from them.
///
/// Heads step, ping at each step, and reverse at the ends of a sector. The last step is shorter if the sector is not
/// a whole number of steps.
#[derive(Debug, Clone, PartialEq)]
pub struct Schedule {
    heads: Vec<(HeadSpec, HeadProgram)>,
}

impl Schedule {
    /// Creates the schedule of heads in the given order for a speed; see [`layout::programs`].
    ///
    /// Errors: as for [`layout::programs`].
    pub fn new(heads: &[HeadSpec], layout: HeadLayout, speed_mps: f64) -> Result<Self, SamplingError> {
        let programs = layout::programs(heads, layout, speed_mps)?;
        Ok(Self { heads: heads.iter().copied().zip(programs).collect() })
    }

    /// Rotation program of each head, in the order of the heads.
    pub fn programs(&self) -> impl Iterator<Item = &HeadProgram> {
        self.heads.iter().map(|(_, program)| program)
    }

    /// Angle of a head's latest ping at the time `since` after the start, in the sensor frame, radians.
    ///
    /// The angle is in [0, 2 pi) for continuous rotation, or within the head's sector. `None` for a head that does
    /// not exist, or before the start.
    pub fn angle_rad(&self, head: usize, since: DurNs) -> Option<f64> {
        let (spec, program) = self.heads.get(head)?;
        let since = (since >= DurNs::ZERO).then_some(since)?;
        let pings = math::floor_to_i64(since.as_secs_f64() / spec.ping_period_s + 1e-6);
        Some(match program.sector {
            None => {
                let step = if program.growing { spec.step_rad } else { -spec.step_rad };
                math::wrap(program.start_rad + pings as f64 * step, math::TAU)
            }
            Some(sector) => back_and_forth(program, sector, spec.step_rad, pings),
        })
    }

    /// Longest period of a sweep there and back, seconds; `None` without sectors.
    pub fn sweep_s(&self) -> Option<f64> {
        let sweep = |(spec, program): &(HeadSpec, HeadProgram)| {
            let (_, size_rad) = program.sector?;
            Some(2.0 * steps_over(size_rad, spec.step_rad) as f64 * spec.ping_period_s)
        };
        self.heads.iter().filter_map(sweep).max_by(f64::total_cmp)
    }
}

fn back_and_forth(
    program: &HeadProgram,
    (least_rad, size_rad): (f64, f64),
    step_rad: f64,
    pings: i64,
) -> f64 {
    let along_rad = (program.start_rad - least_rad).clamp(0.0, size_rad);
    let to_end_rad = if program.growing { size_rad - along_rad } else { along_rad };
    let first = steps_over(to_end_rad, step_rad);
    let (mut from_rad, mut growing, mut left) = (along_rad, program.growing, pings);
    if pings > first {
        let sweep = steps_over(size_rad, step_rad).max(1);
        growing ^= (pings - first - 1) / sweep % 2 == 0;
        from_rad = if growing { 0.0 } else { size_rad };
        left = (pings - first - 1) % sweep + 1;
    }
    let gone_rad = left as f64 * step_rad;
    least_rad + if growing { (from_rad + gone_rad).min(size_rad) } else { (from_rad - gone_rad).max(0.0) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures;

    fn head(step_deg: f64) -> HeadSpec {
        HeadSpec { step_rad: step_deg.to_radians(), ..fixtures::head([0.0; 3], false, 0.0) }
    }

    fn angles_deg(schedule: &Schedule, head: usize, pings: i64) -> Vec<f64> {
        let at = |k| schedule.angle_rad(head, DurNs::from_millis(20 * k)).unwrap().to_degrees();
        (0..pings).map(|k| math::round_to_i64(at(k) * 10.0) as f64 / 10.0).collect()
    }

    #[test]
    fn rotating_head_advances_one_step_per_ping() {
        let schedule = Schedule::new(&[head(120.0), head(120.0)], HeadLayout::PhaseShift, 0.0).unwrap();
        assert_eq!(angles_deg(&schedule, 0, 4), [0.0, 120.0, 240.0, 0.0]);
        assert_eq!(angles_deg(&schedule, 1, 3), [180.0, 300.0, 60.0]);
        assert_eq!(
            schedule.angle_rad(0, DurNs::from_millis(39)),
            schedule.angle_rad(0, DurNs::from_millis(20))
        );
        assert_eq!((schedule.angle_rad(0, DurNs(-1)), schedule.angle_rad(2, DurNs::ZERO)), (None, None));
    }

    #[test]
    fn last_step_of_a_sector_is_shorter_if_steps_do_not_divide_the_sector() {
        let schedule = Schedule::new(&[head(75.0), head(75.0)], HeadLayout::SectorOffset, 0.0).unwrap();
        let there_and_back = [0.0, 75.0, 150.0, 180.0, 105.0, 30.0, 0.0, 75.0, 150.0, 180.0, 105.0];
        assert_eq!(angles_deg(&schedule, 0, 11), there_and_back);
        assert_eq!(angles_deg(&schedule, 1, 11), there_and_back.map(|angle| angle + 180.0));
        assert!((schedule.sweep_s().unwrap() - 0.12).abs() < 1e-12);
    }

    #[test]
    fn each_head_starts_at_its_program_angle() {
        let heads = [head(30.0), head(30.0), head(30.0)];
        for layout in [HeadLayout::PhaseShift, HeadLayout::SectorOffset] {
            let schedule = Schedule::new(&heads, layout, 0.1).unwrap();
            let starts: Vec<_> = schedule.programs().map(|program| Some(program.start_rad)).collect();
            let angles: Vec<_> = (0..3).map(|head| schedule.angle_rad(head, DurNs::ZERO)).collect();
            assert_eq!(starts, angles, "{layout:?}");
        }
    }
}
