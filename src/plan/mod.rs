//! `headrace plan`: spacing, speed and hours before a dive.

mod case;
mod csv;
mod pictures;
mod table;

use std::path::Path;

use headrace_sampling::SamplingError;
use headrace_sampling::plan::{Answer, InLine, Planner, Question};
use serde_json::json;

use crate::cli::Plan;
use crate::failure::{self, Failure};
use crate::files;
use crate::output::{deliver, say, show};
use crate::outputs::{self, Claims, Kind, PICTURE};
use case::{Case, Findings, printed_mps};
use pictures::Shown;

/// Runs `headrace plan`.
pub(crate) fn plan(args: &Plan) -> Result<u8, Failure> {
    let case = Case::of(args)?;
    if let Some(folder) = &args.svg {
        outputs::folder(folder)?;
        let mut claims = Claims::reading(case.inputs.iter().cloned(), &args.overwrite);
        for (name, _) in PICTURES {
            claims.claim("--svg", &folder.join(name), Kind::Picture)?;
        }
    }
    let findings = find(case, args)?;
    if let Some(folder) = &args.svg {
        draw(&findings, folder)?;
    }
    if args.write {
        deliver(table::lines(&findings, args)?.trim_end())?;
    } else if args.json {
        deliver(&serde_json::to_string_pretty(&json(&findings))?)?;
    } else if args.csv {
        deliver(&csv::csv(&findings.answers))?;
    } else {
        show(&table::table(&findings));
        for picture in args.svg.iter().flat_map(|folder| PICTURES.map(|(name, _)| folder.join(name))) {
            say(&format!("picture {}", picture.display()));
        }
    }
    Ok(if findings.answers.iter().any(is_met) { failure::OK } else { failure::FAILED })
}

fn find(case: Case, args: &Plan) -> Result<Findings, Failure> {
    let Case { inspection, heads, tunnel, range_m, question, errors, inputs: _ } = case;
    let planner = Planner::new(inspection)?.with_errors(errors);
    let only = (args.mode != "all").then_some(args.mode.as_str());
    let answers = planner.answers(&question, only)?;
    if answers.is_empty() {
        let names: Vec<_> = planner.modes().iter().map(|planned| planned.mode.name).collect();
        let names = names.join(", ");
        return Err(Failure::Usage(format!("--mode {}: expected all or one of {names}", args.mode)));
    }
    let best = answers.iter().find(|answer| answer.best);
    let shown = best.and_then(|best| {
        let number = planner.modes().iter().position(|planned| planned.mode.name == best.mode)?;
        let asked = question.speed_mps.is_some() || question.time_s.is_some();
        let speed_mps = best.speed_mps?;
        Some((number, if asked { speed_mps } else { printed_mps(speed_mps) }))
    });
    // Occlusion doesn't depend on the speed, and is reported even if no mode meets the target. So an arbitrary speed is
    // used.
    let (mode, speed_mps) = shown.unwrap_or((0, ANY_SPEED_MPS));
    let briefing = planner.briefing(mode, speed_mps)?;
    let footprints_m = planner.footprints_m()?;
    let in_line = in_line(&planner, &question)?;
    Ok(Findings {
        planner,
        heads,
        tunnel,
        range_m,
        footprints_m,
        question,
        answers,
        shown,
        briefing,
        in_line,
    })
}

/// Gain in speed with the heads in one line along the hull. `None` unless the plan is to find a speed and the
/// gain exceeds 5 %.
fn in_line(planner: &Planner, question: &Question) -> Result<Option<InLine>, SamplingError> {
    let asks_for_speed = question.speed_mps.is_none() && question.time_s.is_none();
    let Some(target_m) = question.target_m.filter(|_| asks_for_speed) else { return Ok(None) };
    let gains = |other: &InLine| other.v_max_mps > 1.05 * other.present_mps.unwrap_or(0.0);
    Ok(planner.in_line(target_m)?.filter(gains))
}

/// Whether any mode meets the requested target, speed and hours.
fn is_met(answer: &Answer) -> bool {
    answer.meets_target.unwrap_or(answer.refused.is_none())
        && answer.spacing.is_some_and(|spacing| spacing.t_max_m.is_some())
}

/// An arbitrary speed, m/s, for results that are the same at every speed.
const ANY_SPEED_MPS: f64 = 0.1;

type Picture = fn(&Shown<'_>) -> Result<String, SamplingError>;

const PICTURES: [(&str, Picture); 4] = [
    ("perimeter.svg", pictures::perimeter),
    ("pattern.svg", pictures::pattern),
    ("speeds.svg", pictures::speeds),
    ("hours.svg", pictures::hours),
];

fn draw(findings: &Findings, folder: &Path) -> Result<(), Failure> {
    let Some((mode, speed_mps)) = findings.shown else {
        return Err(Failure::Usage(
            "--svg: no mode meets the target at any speed; nothing to draw".to_owned(),
        ));
    };
    let title = format!("{}, {}", findings.tunnel, table::heads(findings));
    let shown = Shown { planner: &findings.planner, mode, speed_mps, question: findings.question, title };
    for (name, picture) in PICTURES {
        let picture = format!("{}\n{PICTURE}", picture(&shown)?.trim_end());
        files::write(&folder.join(name), picture.as_bytes())?;
    }
    Ok(())
}

fn json(findings: &Findings) -> serde_json::Value {
    let inspection = findings.planner.inspection();
    let (farthest_m, farthest_allowed_m) = findings.planner.farthest_m();
    json!({
        "plan_version": 1,
        "tunnel": findings.tunnel,
        "perimeter_m": inspection.profile.perimeter_m(),
        "length_m": inspection.length_m,
        "place_m": inspection.place,
        "drift_m": inspection.drift_m,
        "yaw_deg": inspection.yaw_rad.to_degrees(),
        "heads": findings.heads,
        "layout": inspection.layout.as_str(),
        "range_m": findings.range_m,
        "footprints_m": findings.footprints_m,
        "reach_m": findings.planner.reach_m(),
        "farthest_wall_m": farthest_m,
        "farthest_wall_allowed_m": farthest_allowed_m,
        "target_m": findings.question.target_m,
        "asked_speed_mps": findings.question.speed_mps,
        "asked_time_h": findings.question.time_s.map(|time_s| time_s / 3600.0),
        "modes": findings.answers,
        "in_line": findings.in_line,
        "briefing": findings.shown.map(|_| &findings.briefing),
    })
}
