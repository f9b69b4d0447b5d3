//! Texts of the plan that all screens show.

use super::route::{Changes, DivePlan, DiveStep, LITTLE_M, Roll, StepKind};
use crate::head_descriptions::HeadDescriptions;
use crate::pilot_text::{limit_text, short_text, station};
use headrace_coverage::Action;

/// Instruction for a step, such as "back to 0+008.2 at any speed".
///
/// A step into the tunnel ahead states no speed, because the displayed limit applies there.
pub fn step_text(step: &DiveStep, heads: &HeadDescriptions) -> String {
    let (from, to) = (decimetre_station(step.from_m), decimetre_station(step.to_m));
    let speed = step.at_most_mps.map_or_else(String::new, |mps| format!(" at most {}", limit_text(mps)));
    match step.kind {
        StepKind::Go if step.to_m < step.from_m => format!("back to {to} at any speed"),
        StepKind::Go => format!("on to {to} at any speed"),
        StepKind::Home => "back to the portal at any speed".to_owned(),
        StepKind::GoOn => format!("go on from {from}"),
        StepKind::Inspect => {
            let roll = match step.roll {
                Roll::Level => "",
                Roll::Left => ", rolled left",
                Roll::Right => ", rolled right",
            };
            let change = change(step.changes).map(|action| format!(", {}", short_text(action, heads)));
            format!("inspect {from} to {to}{speed}{roll}{}", change.unwrap_or_default())
        }
    }
}

/// Stationing with one decimal, which is enough for the ends of a pass.
fn decimetre_station(chainage_m: f64) -> String {
    let mut text = station((chainage_m * 10.0).round() / 10.0);
    text.pop();
    text
}

/// Change that a pass needs apart from speed and roll.
fn change(changes: Changes) -> Option<Action> {
    let actions = Action::against(changes.causes.iter(), changes.is_beyond_speed);
    let stated = [Action::Slower, Action::OtherSide, Action::Again];
    actions.into_iter().find(|action| !stated.contains(action))
}

/// Whether the plan fits into the remaining time, such as "fits in the 1 h 20 min left".
pub fn fits_text(plan: &DivePlan) -> String {
    let stays = [(plan.stays_missed_m, "missed"), (plan.stays_ahead_m, "not inspected")];
    let stays: Vec<String> = stays
        .into_iter()
        .filter(|(length_m, _)| *length_m > LITTLE_M)
        .map(|(length_m, state)| format!("{length_m:.1} m {state}"))
        .collect();
    let takes = time_text((plan.takes_s / 60.0).ceil());
    let left = |left_s: f64| time_text((left_s.max(0.0) / 60.0).floor());
    match plan.left_s {
        None => format!("takes {takes}"),
        Some(left_s) if !plan.is_in_time() => format!("only {} left, the plan takes {takes}", left(left_s)),
        Some(_) if !stays.is_empty() => format!("not all fits: {} would remain", stays.join(" and ")),
        Some(left_s) => format!("fits in the {} left", left(left_s)),
    }
}

/// Whole minutes in hours and minutes.
fn time_text(minutes: f64) -> String {
    let hours = (minutes / 60.0).floor();
    if hours > 0.0 {
        format!("{hours:.0} h {:02.0} min", minutes - 60.0 * hours)
    } else {
        format!("{minutes:.0} min")
    }
}

#[cfg(test)]
mod tests {
    use super::super::route::{Onward, Pass, Start, plan};
    use super::*;
    use headrace_coverage::{Cause, Causes, RunId};

    /// The next steps of a plan, numbered, and whether it fits into the remaining time.
    fn plan_texts(plan: &DivePlan) -> String {
        let steps = (1..).zip(plan.steps.iter().flatten());
        let steps = steps
            .map(|(number, step)| format!("{number}. {}", step_text(step, &HeadDescriptions::default())));
        steps.chain([fits_text(plan)]).collect::<Vec<_>>().join("  ")
    }

    fn texts(left_s: Option<f64>) -> String {
        let pass = Pass {
            run: RunId(0),
            near_m: 8.2,
            far_m: 12.0,
            missed_m: 2.0,
            inward_mps: 0.0925,
            outward_mps: 0.0,
            is_speed_known: true,
            roll: Roll::Level,
            changes: Changes { causes: Causes::of(Cause::OffAxis), is_beyond_speed: false },
        };
        let start = Start { x_m: 31.0, home_m: 0.0, transit_mps: 0.2, left_s, begun: None };
        let onward = Onward { from_m: 31.0, to_m: 60.0, at_most_mps: 0.1 };
        plan_texts(&plan(&start, &[pass], Some(onward)))
    }

    #[test]
    fn text_of_a_plan_has_three_steps_and_says_whether_it_fits() {
        let steps = "1. go on from 0+031.0  2. back to 0+008.2 at any speed  3. inspect 0+008.2 to \
                     0+012.0 at most 0.092 m/s, in the middle and steady";
        assert_eq!(texts(None), format!("{steps}  takes 11 min"));
        assert_eq!(texts(Some(4800.0)), format!("{steps}  fits in the 1 h 20 min left"));
        let short = texts(Some(400.0));
        assert!(
            short.ends_with("  not all fits: 2.0 m missed and 12.7 m not inspected would remain"),
            "{short}"
        );
        let late = texts(Some(60.0));
        assert_eq!(late, "1. back to the portal at any speed  only 1 min left, the plan takes 3 min");
    }
}
