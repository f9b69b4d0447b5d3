//! `headrace plan --write`: prints the lines for a vehicle file.

use crate::cli::Plan;
use crate::failure::Failure;
use headrace_geometry::math;
use headrace_sampling::plan::HELD_SHARE;

use super::findings::Findings;

/// Keys of a vehicle file for the best answer of the plan: layout, planned speed and modes.
///
/// The start angles follow from these keys.
///
/// Errors: there is no vehicle file, or no mode meets the target.
pub(super) fn lines(findings: &Findings, args: &Plan) -> Result<String, Failure> {
    let Some(vehicle) = &args.vehicle else {
        return Err(Failure::Usage("--write: needs --vehicle, to print lines for that file".to_owned()));
    };
    let Some((number, speed_mps)) = findings.shown else {
        return Err(Failure::Usage("--write: no mode meets the target at any speed".to_owned()));
    };
    let inspection = findings.planner.inspection();
    let held_mps = math::floor_to_i64(1e3 * HELD_SHARE * speed_mps) as f64 / 1e3;
    let mode = findings.planner.modes().get(number).map_or("", |planned| planned.mode.name);
    let met = findings
        .question
        .target_m
        .map(|target_m| format!(": {target_m} m in {mode}, driven at {held_mps:.3} m/s"));
    let target = args.target.map(|target_m| format!("target_m = {target_m}\n")).unwrap_or_default();
    let mut text = format!(
        "# Replaces the same keys of {}{}\n{target}\n[heads]\nlayout = {:?}\n\
         # The limit is {speed_mps:.3}, less a margin for the pilot's speed variation: heads at different positions along the hull are in phase only near the planned speed.\n\
         planned_speed_mps = {held_mps:.3}\n",
        vehicle.display(),
        met.unwrap_or_default(),
        inspection.layout.as_str()
    );
    let range = args.range.map(|range_m| format!("range_m = {range_m}\n")).unwrap_or_default();
    for (id, start) in findings.heads.iter().zip(&findings.briefing.starts) {
        let way = if start.growing { "growing" } else { "falling" };
        let sensor = format!(
            "\n[[sensors]]    # {id}: begins at {:.1} degrees, {way}\nmode = {mode:?}\n{range}",
            start.angle_deg
        );
        text.push_str(&sensor);
    }
    Ok(text)
}
