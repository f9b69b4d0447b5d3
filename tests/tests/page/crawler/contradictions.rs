//! Compares the figures of one moment. Each figure is compared wherever it appears, with the tolerance of its rounding.

use serde_json::Value;

use super::visit::Moment;

/// Verdicts in the order of the page's section frames, with their keys in JSON and their words on the terminal.
const VERDICTS: [(&str, &str); 5] = [
    ("open_m", "open"),
    ("pass_m", "passed"),
    ("fail_m", "MISSED"),
    ("cannot_say_m", "can't say"),
    ("not_inspected_m", "not inspected"),
];

/// Largest length of wall that is judged between two updates, m.
const JUDGED_SINCE_UPDATE_M: f64 = 1.01;

/// Contradictions that have been found.
#[derive(Default)]
struct Found(Vec<String>);

impl Found {
    fn check(&mut self, holds: bool, what: &str, shown: impl core::fmt::Debug) {
        if !holds {
            self.0.push(format!("{what}: {shown:?}"));
        }
    }
}

/// Contradictions between and within the screens at a moment.
pub(crate) fn contradictions(moment: &Moment) -> Vec<String> {
    let mut found = Found::default();
    for (key, value) in moment.line.as_object().unwrap() {
        found.check(moment.page.get(key) == Some(value), key, (value, moment.page.get(key)));
    }
    within_state(&moment.line, &mut found);
    alerts(moment, &mut found);
    wall(moment, &mut found);
    terminal(moment, &mut found);
    found.0
}

fn number(of: &Value, path: &str) -> Option<f64> {
    of.pointer(path).and_then(Value::as_f64)
}

fn text<'a>(of: &'a Value, path: &str) -> Option<&'a str> {
    of.pointer(path).and_then(Value::as_str)
}

/// Chainage as stationing.
fn station(x_m: f64) -> String {
    let sign = if x_m < -0.005 { "-" } else { "" };
    let centimetres = (100.0 * x_m.abs()).round();
    let km = (centimetres / 1e5).floor();
    format!("{sign}{km}+{:06.2}", (centimetres - 1e5 * km) / 100.0)
}

/// Whether a text is the speed `mps`, rounded up or down to the text's decimals. A difference of 2 % is also allowed,
/// because a speed that is this close to its limit is shown as the limit.
fn is_rounded(text: &str, mps: f64) -> bool {
    let step =
        if text.split_once('.').is_some_and(|(_, decimals)| decimals.len() > 2) { 0.001 } else { 0.01 };
    text.parse().is_ok_and(|shown: f64| (shown - mps).abs() < step * (1.0 + 1e-6) + 0.02 * mps)
}

fn within_state(state: &Value, found: &mut Found) {
    found.check(state["t_s"] == state["now_s"], "t_s and now_s", (&state["t_s"], &state["now_s"]));
    if let Some([at_s, now_s, age_s]) = all(["/at_s", "/now_s", "/age_s"].map(|path| number(state, path))) {
        found.check((now_s - at_s - age_s).abs() < 1e-6, "age", (at_s, now_s, age_s));
    }
    let line = text(state, "/text").unwrap();
    found.check(line.matches("->").count() < 2, "several instructions", line);
    let place = number(state, "/position/chainage_m").map(station);
    found.check(
        place.as_deref() == text(state, "/position/station"),
        "station",
        (&place, &state["position"]),
    );
    let place = place.unwrap_or_else(|| "-+---.--".to_owned());
    found.check(line.starts_with(&place), "place of the line", (place, line));
    let (speed, limit) = (text(state, "/speeds/speed"), text(state, "/speeds/limit"));
    if let Some(speed) = speed {
        let is_speed = number(state, "/speed_mps").is_some_and(|mps| is_rounded(speed, mps.abs()));
        found.check(is_speed, "speed", (speed, &state["speed_mps"]));
        found.check(line.contains(&format!("{speed} m/s")), "speed of the line", (speed, line));
    }
    if let Some(limit) = limit {
        let mps = number(state, "/v_max_mps").unwrap();
        found.check(is_rounded(limit, mps), "limit", (limit, mps));
        found.check(limit.parse::<f64>().unwrap() <= mps + 1e-9, "limit is rounded up", (limit, mps));
        let mut limits = line.split("up to ").skip(1).chain(line.split("at most ").skip(1));
        let is_stated = limits.all(|rest| !rest.starts_with(char::is_numeric) || rest.starts_with(limit));
        found.check(is_stated || state["condition"] != "good", "limit of the line", (limit, line));
    }
    metres(state, line, found);
    let is_sensor = |is: &str| {
        let all = state["sensors"].as_array().unwrap();
        all.iter()
            .filter(|sensor| sensor["state"] == is)
            .filter_map(|sensor| sensor["id"].as_str())
            .collect::<Vec<_>>()
    };
    for ill in ["stalled", "deaf", "withheld"] {
        for id in is_sensor(ill) {
            let is_listed = live(state).iter().any(|alert| alert["sensor"] == id);
            found.check(
                line.contains(id) || is_listed || state["old"] == true,
                "faulty sensor of the line",
                (ill, id, line),
            );
        }
    }
}

fn metres(state: &Value, line: &str, found: &mut Found) {
    let parts = VERDICTS.map(|(key, _)| number(state, &format!("/metres/{key}")).unwrap());
    let way_m = number(state, "/metres/way_m").unwrap();
    found.check((parts.iter().sum::<f64>() - way_m).abs() < 1e-6, "sum of metres", (parts, way_m));
    let missed =
        Some(parts[2]).filter(|missed_m| *missed_m > 0.0).map(|missed_m| format!("{missed_m:.2} m missed"));
    let outstanding = text(state, "/outstanding");
    let is_missed = match (&missed, outstanding) {
        (Some(missed), Some(outstanding)) => {
            outstanding.starts_with(missed.as_str()) && line.contains(outstanding)
        }
        (None, None) => true,
        _ => false,
    };
    found.check(is_missed, "outstanding", (missed, outstanding, line));
}

fn all<const N: usize>(values: [Option<f64>; N]) -> Option<[f64; N]> {
    values.iter().all(Option::is_some).then(|| values.map(Option::unwrap))
}

fn live(state: &Value) -> Vec<&Value> {
    state["alert_list"].as_array().unwrap().iter().filter(|alert| alert["state"] != "cleared").collect()
}

fn alerts(moment: &Moment, found: &mut Found) {
    let (state, list) = (&moment.line, live(&moment.line));
    let now_s = number(state, "/now_s").unwrap();
    for alert in &list {
        let what = text(alert, "/text").unwrap();
        found.check(number(alert, "/since_s").unwrap() <= now_s, "alert in the future", (alert, now_s));
        let of_page = moment.alerts.iter().find(|other| other["number"] == alert["number"]);
        for key in ["text", "advice", "state", "since_s", "from_m", "to_m", "priority", "acknowledged"] {
            found.check(
                of_page.map(|other| &other[key]) == Some(&alert[key]),
                "alert of the page",
                (key, alert, of_page),
            );
        }
        legs(moment, alert, found);
        if let Some([from_m, to_m]) = all(["/from_m", "/to_m"].map(|path| number(alert, path))) {
            let is_stated =
                !what.contains(" to ") || what.contains(&format!("{} to {}", station(from_m), station(to_m)));
            found.check(is_stated, "stretch of an alert", (what, from_m, to_m));
        }
    }
    if state["alerts_hidden"] == 0 {
        let count = |is: &dyn Fn(&Value) -> bool| list.iter().filter(|alert| is(alert)).count() as f64;
        let counts = [
            ("unacknowledged", count(&|alert| alert["needs_acknowledgement"] == true)),
            ("active", count(&|alert| alert["state"] == "active")),
            ("emergency_alarm", count(&|alert| alert["priority"] == "emergency_alarm")),
            ("alarm", count(&|alert| alert["priority"] == "alarm")),
            ("warning", count(&|alert| alert["priority"] == "warning")),
            ("caution", count(&|alert| alert["priority"] == "caution")),
        ];
        for (key, count) in counts {
            let stated = number(state, &format!("/alert_counts/{key}"));
            found.check(stated == Some(count), key, (stated, count));
        }
    }
}

/// Compares an active alert about missed wall with the leg of the way back over the same stretch.
fn legs(moment: &Moment, alert: &Value, found: &mut Found) {
    let Some(back) = &moment.back else { return };
    let same = |leg: &&Value| leg["to_m"] == alert["from_m"] && leg["from_m"] == alert["to_m"];
    let leg = back["legs"].as_array().unwrap().iter().find(same);
    if let Some(leg) = leg.filter(|_| alert["state"] == "active") {
        let (advice, back_m) = (text(alert, "/advice").unwrap(), number(leg, "/back_to_m").unwrap());
        let is_stated = !advice.contains("inspect again from ") || advice.contains(&station(back_m));
        found.check(is_stated, "place to go back to", (advice, back_m));
        found.check(leg["at_most_mps"] == alert["at_most_mps"], "speed of the way back", (leg, alert));
    }
}

/// Compares the sections of the page's wall with the stated metres. Open sections aren't compared, because they may lie
/// beyond the coverage extent. Sections come with the tick that judges them, and metres with the next update, up to 0.2
/// s later.
fn wall(moment: &Moment, found: &mut Found) {
    for ((key, _), shown_m) in VERDICTS.iter().zip(moment.metres).skip(1) {
        let stated_m = number(&moment.page, &format!("/metres/{key}")).unwrap();
        found.check((stated_m - shown_m).abs() < JUDGED_SINCE_UPDATE_M, key, (stated_m, shown_m));
    }
}

fn terminal(moment: &Moment, found: &mut Found) {
    let (state, screen) = (&moment.line, moment.screen.as_str());
    let row = |label: &str| screen.lines().find_map(|row| row.strip_prefix(label)).unwrap_or_default();
    let seconds = number(state, "/t_s").unwrap().floor();
    let time = format!(
        "{}:{:02}:{:02}",
        (seconds / 3600.0).floor(),
        (seconds / 60.0).floor() % 60.0,
        seconds % 60.0
    );
    let header = screen.lines().next().unwrap_or_default();
    found.check(header.ends_with(&time), "time of the terminal", (header, time));
    let speed = text(state, "/speeds/speed").unwrap_or("-.--");
    let is_speed = row("SPEED").trim_start().starts_with(&format!("{speed} m/s"));
    found.check(is_speed, "speed of the terminal", (row("SPEED"), speed));
    let limit = row("SPEED").split_once("(limit ").and_then(|(_, rest)| rest.split(')').next());
    found.check(
        limit == text(state, "/speeds/limit"),
        "limit of the terminal",
        (row("SPEED"), &state["speeds"]),
    );
    let place = text(state, "/position/station").unwrap_or("-+---.--");
    found.check(row("AT").trim_start().starts_with(place), "place of the terminal", (row("AT"), place));
    let sd_m = number(state, "/position/chainage_sd_m");
    let error = sd_m.map(|sd_m| format!("{:.2} m (95 %)", 2.0 * sd_m)).filter(|_| row("AT").contains("95 %"));
    found.check(
        error.is_none_or(|error| row("AT").contains(&error)),
        "error of the place",
        (row("AT"), sd_m),
    );
    let way_m = number(state, "/metres/way_m").unwrap();
    let is_way = row("METRES").trim_start().starts_with(&format!("{way_m:.2} m"));
    found.check(is_way, "way of the terminal", (row("METRES"), way_m));
    for (key, word) in VERDICTS {
        let stated_m = number(state, &format!("/metres/{key}")).unwrap();
        let has = row("METRES").contains(&format!(" {stated_m:.2} {word}"));
        found.check(has == (stated_m > 0.0), "metres of the terminal", (key, stated_m, row("METRES")));
    }
    let unwell = state["sensors"].as_array().unwrap().iter().filter(|sensor| sensor["state"] != "ok").count();
    let count = state["sensors"].as_array().unwrap().len();
    let sensors = if unwell == 0 { format!("{count} ok") } else { format!("{unwell} of {count} not ok") };
    found.check(row("SENSORS ").starts_with(&sensors), "sensors of the terminal", (row("SENSORS "), sensors));
    alerts_of_terminal(moment, row("ALERTS "), found);
    instruction(state, screen, found);
}

fn alerts_of_terminal(moment: &Moment, title: &str, found: &mut Found) {
    let (state, list) = (&moment.line, live(&moment.line));
    let new = number(state, "/alert_counts/unacknowledged").unwrap();
    let stated = match (list.len(), new) {
        (0, _) => "none".to_owned(),
        (all, 0.0) => format!("{all} "),
        (all, new) => format!("{all}, {new} to acknowledge"),
    };
    let is_stated = title.starts_with(&stated) || title.starts_with(&format!("{},", stated.trim_end()));
    found.check(is_stated, "alerts of the terminal", (title, stated));
    if let Some(first) = list.first() {
        let start: String = text(first, "/text").unwrap().chars().take(40).collect();
        found.check(moment.screen.contains(&start), "first alert of the terminal", start);
    }
}

/// Checks that the terminal's banner has the instruction of the state line, and no other instruction.
fn instruction(state: &Value, screen: &str, found: &mut Found) {
    let banner: Vec<&str> = screen.lines().skip(1).take_while(|row| !row.starts_with("SPEED")).collect();
    let arrows: Vec<&str> = banner.iter().filter_map(|row| row.trim_start().strip_prefix("→ ")).collect();
    let wanted = text(state, "/text").unwrap().split_once("-> ").map(|(_, action)| action);
    let is_same = match (wanted, arrows.as_slice()) {
        (None, []) => true,
        (Some(wanted), [shown]) => shown.starts_with(wanted),
        _ => false,
    };
    found.check(is_same, "instruction of the terminal", (wanted, banner));
}

/// Contradictions between the page's last message, the terminal's summary and the report.
pub(crate) fn of_result(end: &Value, summary: &str, report: &Value) -> Vec<String> {
    let mut found = Found::default();
    for (of_page, of_report) in [("digest", "digest"), ("summary", "summary"), ("way", "coverage_extent")] {
        found.check(end[of_page] == report[of_report], of_page, (&end[of_page], &report[of_report]));
    }
    if let Some([from_m, to_m]) =
        all(["/from_m", "/to_m"].map(|path| number(&report["coverage_extent"], path)))
    {
        let [length_m, target_m] =
            ["/coverage_extent/length_m", "/target_m"].map(|path| number(report, path).unwrap());
        let first = format!("{} to {}: {length_m:.2} m in", station(from_m), station(to_m));
        found.check(
            summary.contains(&first) && summary.contains(&format!("target {target_m} m")),
            "summary",
            (first, summary),
        );
        for (key, word) in VERDICTS.into_iter().filter(|(key, _)| *key != "fail_m") {
            let metres_m = number(report, &format!("/summary/{key}")).unwrap();
            let has = metres_m == 0.0 || summary.contains(&format!("{word} {metres_m:.2} m"));
            found.check(has, "metres of the summary", (key, metres_m, summary));
        }
    }
    let lasts_s = number(report, "/dive/duration_s").unwrap();
    let mut times = Vec::new();
    times_in(report, &mut times);
    for (key, time_s) in times {
        found.check(
            (0.0..=lasts_s + 3.0).contains(&time_s),
            "time that is no dive time",
            (key, time_s, lasts_s),
        );
    }
    found.0
}

/// Collects all dive times in a report, with their keys.
fn times_in(of: &Value, to: &mut Vec<(String, f64)>) {
    const KEYS: [&str; 8] =
        ["at_s", "since_s", "rectified_s", "cleared_s", "flagged_s", "raised_s", "from_s", "to_s"];
    match of {
        Value::Object(object) => {
            for (key, value) in object {
                if let Some(time_s) = value.as_f64().filter(|_| KEYS.contains(&key.as_str())) {
                    to.push((key.clone(), time_s));
                }
                times_in(value, to);
            }
        }
        Value::Array(list) => list.iter().for_each(|value| times_in(value, to)),
        _ => {}
    }
}
