//! Prediction of the live advice: the largest speed for heads that were started for another speed.

use super::planner::Planner;
use crate::advice::{Advisor, Looks, Task};
use crate::error::{SamplingError, positive};
use crate::head::{HeadMode, HeadMotion, HeadSet, HeadSpec, MAX_HEADS};
use crate::layout;
use crate::losses::LossRate;
use crate::passes::Situation;
use crate::swing::Swing;

impl Planner {
    /// Returns the largest speed in a mode for heads started for `planned_mps`, m/s.
    ///
    /// Zero if no speed meets the target. For a steady vehicle on the axis, the result equals the live advice,
    /// margins included.
    ///
    /// Errors: no such mode; a target or a speed that isn't above zero; heads that the layout doesn't allow.
    pub fn as_started_mps(&self, mode: usize, target_m: f64, planned_mps: f64) -> Result<f64, SamplingError> {
        positive("the target in metres", target_m)?;
        positive("the speed in m/s", planned_mps)?;
        let planned = self.modes.get(mode).ok_or(SamplingError::NoCommonMode)?;
        let inspection = self.inspection();
        let specs = self.specs(mode);
        let task = Task {
            target: self.target(target_m),
            length_m: inspection.length_m,
            layout: inspection.layout,
            sound_speed_mps: inspection.sound_speed_mps,
            looks: Looks::default(),
        };
        let modes = |number: usize| inspection.heads.get(number).map(|(_, modes)| modes.clone());
        let heads: Vec<(HeadSpec, Vec<HeadMode>)> = specs
            .iter()
            .enumerate()
            .map(|(number, spec)| (*spec, modes(number).unwrap_or_default()))
            .collect();
        let mut motions = [None; MAX_HEADS];
        let programs = layout::programs(&specs, inspection.layout, planned_mps)?;
        for ((slot, spec), program) in motions.iter_mut().zip(&specs).zip(&programs) {
            let rate_radps = spec.step_rad / spec.ping_period_s;
            *slot = Some(HeadMotion {
                mount: spec.mount,
                angle_rad: program.start_rad,
                rate_radps: if program.growing { rate_radps } else { -rate_radps },
                step_rad: spec.step_rad,
                sector_rad: program.sector.map(|(_, size_rad)| size_rad),
            });
        }
        let situation = Situation {
            pose: Some(self.nominal_pose()),
            speed_mps: planned_mps,
            pass_error_m: self.pass_error_m(planned, planned_mps),
            layout: inspection.layout,
            configured: specs.len(),
            heads: motions,
            deaf: HeadSet::default(),
            losses: [LossRate::default(); MAX_HEADS],
            lost_at_most: LossRate::default(),
        };
        let mut advisor = Advisor::new(&inspection.profile, task, &heads, &inspection.hull);
        // Each call of the advisor recasts only one outdated ring of rays, so one call per head is needed.
        let calls = 0..specs.len().max(1);
        let advised = calls.map(|_| advisor.advise(&situation, Swing::default(), None).v_max_mps);
        Ok(advised.last().unwrap_or(0.0))
    }
}
