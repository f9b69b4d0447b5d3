//! Prints a plan as text: a table of modes, or with `--write` the lines for a vehicle file.

use headrace_geometry::math;
use headrace_sampling::head::Basis;
use headrace_sampling::layout::HeadLayout;
use headrace_sampling::margin::{Margin, Margins};
use headrace_sampling::plan::{Answer, Briefing, HELD_SHARE, Heard, InLine, Spacing, ThinStrip};

use super::case::{Findings, printed_mps};
use crate::cli::Plan;
use crate::failure::Failure;
use crate::output::append;

/// The plan as text with a table of modes.
pub(super) fn table(findings: &Findings) -> String {
    let mut lines = vec![tunnel_line(findings), heads_line(findings), question_line(findings), String::new()];
    lines.extend(range_warning(findings));
    lines.push(HEADINGS[0].to_owned());
    lines.push(HEADINGS[1].to_owned());
    lines.extend(findings.answers.iter().map(row));
    lines.push(String::new());
    lines.extend(notes(findings));
    lines.extend(hidden_lines(findings, &findings.briefing));
    if findings.shown.is_some() {
        lines.extend(start_lines(findings, &findings.briefing));
    }
    lines.push(String::new());
    lines.iter().map(|line| line.trim_end()).collect::<Vec<_>>().join("\n")
}

/// Text with the number and layout of the heads.
pub(super) fn heads(findings: &Findings) -> String {
    let layout = match findings.planner.inspection().layout {
        HeadLayout::PhaseShift => "phase shift",
        HeadLayout::SectorOffset => "sector offset",
    };
    match findings.heads.len() {
        1 => "1 head".to_owned(),
        count => format!("{count} heads, {layout}"),
    }
}

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

fn tunnel_line(findings: &Findings) -> String {
    let inspection = findings.planner.inspection();
    let [y, z] = inspection.place;
    let mut allowed = match (inspection.drift_m > 0.0, inspection.yaw_rad > 0.0) {
        (false, false) => String::new(),
        _ => format!(
            "; allowing for a constant offset of {} m and yaw of {:.1} degrees",
            inspection.drift_m,
            inspection.yaw_rad.to_degrees()
        ),
    };
    if inspection.yaw_rate_radps > 0.0 {
        append(
            &mut allowed,
            format_args!("; turning by {:.1} degrees/s", inspection.yaw_rate_radps.to_degrees()),
        );
    }
    format!(
        "{}: perimeter {:.2} m, {} m long; vehicle at y {y:.2} m, z {z:.2} m{allowed}",
        findings.tunnel,
        inspection.profile.perimeter_m(),
        inspection.length_m
    )
}

fn heads_line(findings: &Findings) -> String {
    let [least_m, most_m] = findings.footprints_m;
    let (heads, range_m) = (heads(findings), findings.range_m);
    format!("{heads}, range setting {range_m} m; a beam covers {least_m:.2} to {most_m:.2} m of wall")
}

fn question_line(findings: &Findings) -> String {
    let question = &findings.question;
    let mut asked = Vec::new();
    asked.extend(question.target_m.map(|target_m| format!("target {target_m} m")));
    asked.extend(question.speed_mps.map(|speed_mps| format!("speed {speed_mps} m/s")));
    asked.extend(question.time_s.map(|time_s| {
        let speed_mps = findings.planner.inspection().length_m / time_s;
        format!("{} h for the whole length, one way: {speed_mps:.3} m/s", time_s / 3600.0)
    }));
    asked.join(", ")
}

/// Warning if parts of the wall are beyond the heads' range setting.
fn range_warning(findings: &Findings) -> Option<String> {
    let ((here_m, allowed_m), reach_m) = (findings.planner.farthest_m(), findings.planner.reach_m());
    (allowed_m > reach_m).then(|| {
        let where_it_is = if here_m > reach_m { "" } else { " with that offset and yaw" };
        format!("OUT OF RANGE: the wall is up to {allowed_m:.1} m away{where_it_is}; the heads reach {reach_m:.1} m\n")
    })
}

const HEADINGS: [&str; 2] = [
    "                                   T_y at rest, m         at  T_x, m, seen by   T_max  certain hit, m   v_max   hours",
    "  mode     step   turn  overlap    min   mean  worst     m/s    all    fewest       m   once    twice     m/s  needed",
];

fn row(answer: &Answer) -> String {
    let mark = if answer.best { '*' } else { ' ' };
    let estimated = if answer.turn_basis == Basis::Estimated.as_str() { '~' } else { ' ' };
    // If no head sees the wall, there is no sample spacing to print.
    let worst = if answer.t_y2_m > 0.0 { format!("{:.3}", answer.t_y2_m) } else { "-".to_owned() };
    let known = format!(
        "{mark} {:<8} {:>4.1} {estimated}{:>6.2} {:>8.2}  {:>5.3}  {:>5.3}  {worst:>5}",
        answer.mode,
        answer.step_deg,
        answer.turn_s,
        answer.overlap,
        answer.t_y_min_rest_m,
        answer.t_y_mean_rest_m
    );
    let at_speed = match (&answer.spacing, answer.speed_mps) {
        (Some(spacing), Some(speed_mps)) if answer.v_max_mps == answer.speed_mps => {
            spacing_columns(spacing, printed_mps(speed_mps))
        }
        (Some(spacing), Some(speed_mps)) => spacing_columns(spacing, speed_mps),
        _ => format!("{:>50}", "-"),
    };
    let v_max = match (answer.v_max_mps, answer.needed_h) {
        (Some(v_mps), Some(hours)) => format!("{:>8.3} {hours:>7.1}", printed_mps(v_mps)),
        _ if answer.refused.is_some() => "    none".to_owned(),
        _ => String::new(),
    };
    format!("{known}{at_speed}{v_max}")
}

fn spacing_columns(spacing: &Spacing, speed_mps: f64) -> String {
    let metres = |value: Option<f64>, digits: usize| {
        value.map_or_else(|| "-".to_owned(), |value| format!("{value:.digits$}"))
    };
    format!(
        "  {speed_mps:>6.3} {:>6.3} {:>9.3} {:>7} {:>6} {:>8}",
        spacing.t_x_m,
        spacing.t_x_hidden_m,
        metres(spacing.t_max_m, 3),
        metres(spacing.hit_once_m, 2),
        metres(spacing.hit_twice_m, 2)
    )
}

fn notes(findings: &Findings) -> Vec<String> {
    let mut notes = Vec::new();
    // Several modes often miss the request for the same reason, so each reason is printed once.
    let mut reasons: Vec<(&String, Vec<&str>)> = Vec::new();
    for answer in &findings.answers {
        let Some(why) = &answer.refused else { continue };
        match reasons.iter_mut().find(|(known, _)| *known == why) {
            Some((_, modes)) => modes.push(answer.mode),
            None => reasons.push((why, vec![answer.mode])),
        }
    }
    notes.extend(reasons.into_iter().map(|(why, modes)| format!("{}: {why}", modes.join(", "))));
    if let Some(best) = findings.answers.iter().find(|answer| answer.best) {
        notes.push(format!("* {}", best_words(best)));
        notes.extend(best.margins.map(|margins| margin_words(best.mode, &margins)));
    }
    notes.extend(findings.in_line.as_ref().map(|in_line| in_line_words(findings, in_line)));
    if findings.answers.iter().any(|answer| answer.turn_basis == Basis::Estimated.as_str()) {
        notes.push(
            "~ extrapolated from another range setting; measure the turn period and add it to the vehicle file"
                .to_owned(),
        );
    }
    notes
}

fn best_words(best: &Answer) -> String {
    let met = match (best.meets_target, best.suffices) {
        (Some(true), _) => "; it meets the target",
        (Some(false), _) => "; it doesn't meet the target",
        _ => "",
    };
    match (best.v_max_mps, best.needed_h, best.meets_target) {
        (Some(v_mps), Some(hours), None) => {
            let mode = best.mode;
            format!(
                "fastest for the target: {mode}, at most {:.3} m/s, {hours:.1} h one way",
                printed_mps(v_mps)
            )
        }
        _ => format!("finest at this speed: {}{met}", best.mode),
    }
}

/// Text about how much speed each safety margin costs.
fn margin_words(mode: &str, margins: &Margins) -> String {
    /// Smallest cost of a margin that is printed, m/s. A smaller cost would not show in the rounded speeds.
    const NOTHING_MPS: f64 = 5e-4;
    let mut words = vec![format!("{mode}: {:.3} m/s from the geometry alone", margins.geometry_mps)];
    let after = margins.speeds_mps().into_iter().skip(1);
    for ((margin, price_mps), speed_mps) in margins.prices_mps().into_iter().zip(after) {
        let why = match margin {
            Margin::Hidden => "with occlusion by the vehicle".to_owned(),
            Margin::Phase => "with heads side by side or at an angle".to_owned(),
            Margin::Swing => "with yaw motion".to_owned(),
            Margin::Position => {
                format!("with passes known to +-{:.1} cm", 100.0 * margins.pass_error_m)
            }
            // The plan assumes that no returns are lost.
            Margin::Geometry | Margin::Losses => continue,
        };
        if price_mps >= NOTHING_MPS {
            words.push(format!("{speed_mps:.3} {why}"));
        }
    }
    words.join(", ")
}

/// Text about the gain in speed if the heads were in one line along the hull.
fn in_line_words(findings: &Findings, in_line: &InLine) -> String {
    let InLine { positions_m, mode, v_max_mps, .. } = in_line;
    let hours = findings.planner.inspection().length_m / v_max_mps / 3600.0;
    let places: Vec<String> = positions_m.iter().map(|place| format!("{:.2}", place[0])).collect();
    let [_, y_m, z_m] = positions_m.first().copied().unwrap_or_default();
    format!(
        "with the heads in line, x {} m, y {y_m:.2}, z {z_m:.2}: {mode}, at most {:.3} m/s, {hours:.1} h",
        places.join(", "),
        printed_mps(*v_max_mps)
    )
}

/// Text about occlusion by the vehicle, and about strips of wall with fewer passes.
fn hidden_lines(findings: &Findings, briefing: &Briefing) -> Vec<String> {
    let names = |heads: &[usize]| names(findings, heads);
    let hidden = briefing.hidden.iter().map(|hidden| {
        format!(
            "{}: {:.1} degrees about {:.0} are hidden by the vehicle, {:.2} m of wall at {}",
            names(&[hidden.head]),
            hidden.size_deg,
            hidden.middle_deg,
            hidden.wall_m,
            hidden.clock
        )
    });
    hidden.chain(briefing.strips.iter().map(|strip| strip_words(strip, &names))).collect()
}

fn names(findings: &Findings, heads: &[usize]) -> String {
    let name = |head: &usize| findings.heads.get(*head).map_or("?", String::as_str);
    heads.iter().map(name).collect::<Vec<_>>().join(", ")
}

/// Text about start angles, interference between heads, and distances along the hull that allow equal start
/// angles.
fn start_lines(findings: &Findings, briefing: &Briefing) -> Vec<String> {
    let names = |heads: &[usize]| names(findings, heads);
    let mut lines = Vec::new();
    lines.extend(briefing.exposures.iter().map(|heard| heard_words(heard, &names)));
    if findings.heads.len() > 1 {
        let degrees = |start: &headrace_sampling::plan::Start| {
            let way = if start.growing { '+' } else { '-' };
            let sector = start.sector_deg.map_or_else(String::new, |[least, size]| {
                format!(" within {:.0} to {:.0}", least, least + size)
            });
            format!("{} {:.1}{way}{sector}", names(&[start.head]), start.angle_deg)
        };
        let starts: Vec<String> = briefing.starts.iter().map(degrees).collect();
        lines.push(format!(
            "start angles in {} at {:.3} m/s, degrees, + growing: {}",
            briefing.mode,
            briefing.speed_mps,
            starts.join("; ")
        ));
    }
    // Pairs of heads at equal distances have the same rule for equal start angles, so each rule is printed once.
    let mut said = Vec::new();
    for rule in &briefing.hull_rules {
        let text = format!(
            "heads {:.3} m apart along the hull start at equal angles at {:.3} m/s; at this speed, {:.3} m apart (q = {})",
            rule.behind_m, rule.speed_mps, rule.apart_m, rule.q
        );
        if !said.contains(&text) {
            said.push(text);
        }
    }
    lines.extend(said);
    lines
}

fn strip_words(strip: &ThinStrip, names: &impl Fn(&[usize]) -> String) -> String {
    let (width_m, clock) = (strip.width_m, &strip.clock);
    match strip.t_x_factor {
        Some(factor) => {
            let heads = names(&strip.seen_by);
            format!(
                "{width_m:.2} m of wall at {clock} are seen by {heads} only: T_x is {factor:.3} times as large there"
            )
        }
        None => format!("{width_m:.2} m of wall at {clock} are seen by NO head"),
    }
}

fn heard_words(heard: &Heard, names: &impl Fn(&[usize]) -> String) -> String {
    let mut ways = Vec::new();
    if heard.facing_s > 0.0 {
        ways.push(format!("face each other for {:.2} s", heard.facing_s));
    }
    if heard.same_patch_s > 0.0 {
        ways.push(format!("see the same patch for {:.2} s", heard.same_patch_s));
    }
    format!("{} {} of every {:.1} s, and may interfere", names(&heard.heads), ways.join(" and "), heard.of_s)
}
