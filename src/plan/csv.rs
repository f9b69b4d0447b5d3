//! The modes of a plan as CSV: one row per mode, with units in the headings.

use headrace_sampling::plan::{Answer, Spacing};

const HEADINGS: &str = "mode,step_deg,steps_per_turn,turn_s,turn_basis,overlap,t_y_min_rest_m,t_y_mean_rest_m,\
t_y_max_rest_m,t_yp_m,t_y2_m,v_max_mps,needed_h,reason,speed_mps,advance_m,pitch_m,t_x_m,t_x_hidden_m,t_y_min_m,\
t_y_mean_m,t_y_max_m,t_min_m,t_mean_m,t_max_m,hit_once_m,hit_twice_m,meets_target,suffices,best,geometry_mps,\
hidden_mps,phase_mps,swing_mps,position_mps,losses_mps,pass_error_m";

/// The table as CSV, without a line end after the last row.
pub(super) fn csv(answers: &[Answer]) -> String {
    let rows = answers.iter().map(|answer| row(answer).join(","));
    std::iter::once(HEADINGS.to_owned()).chain(rows).collect::<Vec<_>>().join("\n")
}

fn row(answer: &Answer) -> Vec<String> {
    let yes = |value: Option<bool>| value.map_or("", |value| if value { "yes" } else { "no" }).to_owned();
    let at_rest =
        [answer.t_y_min_rest_m, answer.t_y_mean_rest_m, answer.t_y_max_rest_m, answer.t_yp_m, answer.t_y2_m];
    let mut row = vec![
        answer.mode.to_owned(),
        number(answer.step_deg),
        answer.steps_per_turn.to_string(),
        number(answer.turn_s),
        answer.turn_basis.to_owned(),
        number(answer.overlap),
    ];
    row.extend(at_rest.map(number));
    row.extend([answer.v_max_mps, answer.needed_h].map(known));
    row.push(answer.reason.unwrap_or_default().to_owned());
    row.push(known(answer.speed_mps));
    row.extend(answer.spacing.as_ref().map_or([None; 12], columns).map(known));
    row.extend([yes(answer.meets_target), yes(answer.suffices), yes(Some(answer.best))]);
    row.extend(answer.margins.map_or([None; 6], |margins| margins.speeds_mps().map(Some)).map(known));
    row.push(known(answer.margins.map(|margins| margins.pass_error_m)));
    row
}

fn columns(spacing: &Spacing) -> [Option<f64>; 12] {
    [
        Some(spacing.advance_m),
        Some(spacing.pitch_m),
        Some(spacing.t_x_m),
        Some(spacing.t_x_hidden_m),
        Some(spacing.t_y_min_m),
        Some(spacing.t_y_mean_m),
        Some(spacing.t_y_max_m),
        Some(spacing.t_min_m),
        Some(spacing.t_mean_m),
        spacing.t_max_m,
        spacing.hit_once_m,
        spacing.hit_twice_m,
    ]
}

fn known(value: Option<f64>) -> String {
    value.map(number).unwrap_or_default()
}

/// A number with at most six decimals.
fn number(value: f64) -> String {
    let text = format!("{value:.6}");
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}
