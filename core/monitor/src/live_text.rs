//! Live texts: first the place, then the problem, then the action. Terminals break the texts to their width.

use super::alert_list::{AlertChange, ListedAlertJson};
use super::head_descriptions::HeadDescriptions;
use super::live_messages::LiveMessage;
use super::live_state::{Condition, Lamp, LiveState, PositionDoubt, SensorState};
use super::pilot_text::{AdviceFigures, actions_text, advice_text, cause_text, clock_text, station};
pub use super::unsure_stretch::{helps_text, unsure_text};
use super::words::{NOT_INSPECTED, STAND_STILL, STARTING, condition_words, sensor_words, verdict_words};
use headrace_coverage::{Metres, Verdict};
use headrace_geometry::time::DurNs;
use headrace_geometry::tunnel::Profile;

/// A line of text for the pilot.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct PilotLine {
    /// Place: one stationing, or two for a stretch.
    pub place: String,
    /// Speed of the vehicle; empty if it isn't shown.
    pub speed: String,
    /// Parts of the problem, most important part first. A narrow screen leaves out the last parts.
    pub what: Vec<String>,
    /// Action to take; empty if there is none.
    pub action: String,
    /// Colour of the line, if any.
    pub lamp: Option<Lamp>,
}

impl PilotLine {
    /// The whole line as text.
    pub fn text(&self) -> String {
        let mut text = format!("{:<9}  ", self.place);
        if !self.speed.is_empty() {
            text.push_str(&self.speed);
            text.push_str("  ");
        }
        text.push_str(&self.what.join("  "));
        if !self.action.is_empty() {
            text.push_str("  -> ");
            text.push_str(&self.action);
        }
        text
    }

    /// The pilot's line, broken into lines of at most `columns` characters. Continuation lines are indented
    /// to the beginning of the first line's text.
    pub fn broken(&self, columns: usize) -> Vec<String> {
        let whole = self.text();
        if whole.chars().count() <= columns {
            return vec![whole];
        }
        let mut lines = vec![format!("{:<9} ", self.place)];
        let mut put = |word: &str, anew: bool| {
            let Some(line) = lines.last_mut() else { return };
            if anew || line.chars().count() + 1 + word.chars().count() > columns && !line.trim().is_empty() {
                lines.push(format!("{:<10} {word}", ""));
            } else {
                line.push(' ');
                line.push_str(word);
            }
        };
        self.what.iter().flat_map(|part| part.split(' ')).for_each(|word| put(word, false));
        if !self.action.is_empty() {
            put("->", true);
            self.action.split(' ').for_each(|word| put(word, false));
        }
        lines
    }

    /// As much of a status line as fits into `columns` characters.
    ///
    /// The last parts are left out first, then the speed, then the reason if there is an action. A line that
    /// is still too long is cut off.
    pub fn cut(&self, columns: usize) -> String {
        let mut line = self.clone();
        let is_wide = |line: &Self| line.text().chars().count() > columns;
        while is_wide(&line) && line.what.len() > 1 {
            line.what.pop();
        }
        // The condition matters more to the pilot than the speed.
        if is_wide(&line) {
            line.speed.clear();
        }
        // The action matters more to the pilot than the reason.
        if is_wide(&line)
            && !line.action.is_empty()
            && let Some(what) = line.what.first_mut()
            && let Some(end) = what.find(": ")
        {
            what.truncate(end);
        }
        line.text().chars().take(columns).collect()
    }
}

/// Status line: place, speed, condition and action. Missed metres, faulty sensors and the turn's
/// forecast follow the condition.
///
/// `name` returns a source's id.
pub fn status_line(
    state: &LiveState,
    profile: &Profile,
    heads: &HeadDescriptions,
    name: &dyn Fn(usize) -> String,
) -> PilotLine {
    let condition = state.condition();
    let place = state.chainage_m.map_or_else(|| "-+---.--".to_owned(), station);
    let texts = state.speed_texts();
    let v_max = texts.limit.map_or_else(String::new, |limit| format!("{limit} m/s"));
    let what = condition_text(condition, state, &v_max, (profile, heads));
    let action = match condition {
        _ if state.asks_to_stand() => format!("{STAND_STILL} {} s", state.stand_s),
        // The text of the condition states v_max already.
        Condition::Good => String::new(),
        _ => condition_words(condition).action_text(&v_max),
    };
    let is_old = matches!(condition, Condition::Old(_) | Condition::NoData);
    let is_back = state.is_driving_back();
    let speed = texts.speed.map_or_else(String::new, |speed| {
        if is_back { format!("{speed} m/s back") } else { format!("{speed} m/s") }
    });
    let mut parts = vec![what];
    // Failed metres come first, since a narrow screen leaves out the last parts.
    parts.extend(state.outstanding_text());
    let ill_parts = |ill: SensorState| {
        let sensors = state.sensors_that_are(ill);
        sensors.map(move |source| format!("{} {}", name(source), sensor_words(ill)))
    };
    parts.extend(ill_parts(SensorState::Withheld));
    if !is_old {
        let silent: Vec<usize> = state.silent().collect();
        match silent.as_slice() {
            [] => {}
            [one] => parts.push(format!("{} {}", name(*one), sensor_words(SensorState::Silent))),
            some => parts.push(format!(
                "{} of {} sensors {}",
                some.len(),
                state.sources,
                sensor_words(SensorState::Silent)
            )),
        }
        parts.extend([SensorState::Deaf, SensorState::Hung].into_iter().flat_map(ill_parts));
        let forecast = losses_text(state).or_else(|| forecast_text(state));
        let any_speed =
            matches!(condition, Condition::Passed | Condition::GoingBack(_) | Condition::Outside(_));
        let counts = state.has_sonar() && state.speed_mps.is_some() && !any_speed;
        parts.extend(forecast.filter(|_| counts));
    }
    PilotLine { place, speed, what: parts, action, lamp: Some(condition.lamp()) }
}

/// Text of a condition with its explanation. `v_max` is the text of v_max with its unit.
fn condition_text(
    condition: Condition,
    state: &LiveState,
    v_max: &str,
    (profile, heads): (&Profile, &HeadDescriptions),
) -> String {
    let words = condition_words(condition);
    match condition {
        Condition::NoData if state.heard.iter().any(Option::is_some) => STARTING.to_owned(),
        Condition::Old(age) => format!("{} {}: {}", words.name, age_text(age), words.detail),
        Condition::Outside(end_m) => {
            let which = if state.chainage_m.is_some_and(|x_m| x_m < end_m) { "begins" } else { "ends" };
            format!("{}: the tunnel {which} at {}", words.name, station(end_m))
        }
        Condition::Passed => words.name.to_owned(),
        Condition::GoingBack(to_m) => format!("{} to {}: {}", words.name, station(to_m), words.detail),
        Condition::NoSpeed => no_speed_text(state, profile, heads),
        Condition::TurnFails | Condition::TurnUnsure => turn_text(words.name, state),
        Condition::CannotSay(PositionDoubt::Spread) => {
            format!("{}: position ±{:.2} m", words.name, state.target.error_m(state.pass_sd_m))
        }
        Condition::Good => format!("ok up to {v_max}"),
        Condition::NoData
        | Condition::NoPosition(_)
        | Condition::NoSonar
        | Condition::TooFast
        | Condition::CannotSay(PositionDoubt::Cable)
        | Condition::Over => words.text(),
    }
}

fn age_text(age: DurNs) -> String {
    let seconds = age.as_secs_f64();
    if seconds < 100.0 { format!("{seconds:.0} s") } else { format!("{:.0} min", seconds / 60.0) }
}

fn figures(state: &LiveState) -> Option<AdviceFigures> {
    state.advice.as_ref().map(|advice| AdviceFigures::of(advice, state.speed_mps.unwrap_or(0.0)))
}

fn no_speed_text(state: &LiveState, profile: &Profile, heads: &HeadDescriptions) -> String {
    figures(state).map_or_else(String::new, |figures| advice_text(&figures, profile, heads))
}

fn turn_text(what: &str, state: &LiveState) -> String {
    let error_deg = state.advice.and_then(|advice| advice.phase_error_rad).unwrap_or(0.0).to_degrees().abs();
    if error_deg >= 1.0 {
        format!("{what}: heads {error_deg:.0} degrees out of phase")
    } else {
        what.to_owned()
    }
}

/// Text of the share of lost returns, if lost returns limit the speed. In that case the turn's forecast, which assumes
/// no losses, means little.
fn losses_text(state: &LiveState) -> Option<String> {
    state.lost_share().map(|share| format!("{:.0} % of returns lost", 100.0 * share))
}

/// Text of the spacing T forecast for the present turn, and of the target.
fn forecast_text(state: &LiveState) -> Option<String> {
    let advice = state.advice.as_ref().filter(|_| state.v_max_mps().is_some())?;
    Some(match advice.predicted_t_m {
        Some(t_m) => format!("turn {t_m:.2} m (limit {:.2})", state.target.max_hole_m),
        None => "turn: unseen wall".to_owned(),
    })
}

/// Text of the length of each verdict within the coverage extent. Verdicts with a length of zero are left out.
pub fn metres_text(metres: &Metres) -> String {
    let Metres { pass_m, fail_m, cannot_say_m, open_m, not_inspected_m } = *metres;
    let all = [
        (fail_m, verdict_words(Verdict::Fail)),
        (cannot_say_m, verdict_words(Verdict::CannotSay)),
        (open_m, verdict_words(Verdict::Open)),
        (not_inspected_m, NOT_INSPECTED),
    ];
    let others = all.into_iter().filter(|(metres_m, _)| *metres_m > 0.0);
    let parts = others.map(|(metres_m, what)| format!("{what} {metres_m:.2} m"));
    let passed = format!("{} {pass_m:.2} m", verdict_words(Verdict::Pass));
    core::iter::once(passed).chain(parts).collect::<Vec<_>>().join(", ")
}

/// Length of a part of a stretch, m, as text such as ", 1.25 m of it". The text is empty if the part is empty
/// or the whole stretch.
pub fn of_it_text(part_m: f64, whole_m: f64) -> String {
    if part_m <= 0.0 || part_m > whole_m - 1e-6 { String::new() } else { format!(", {part_m:.2} m of it") }
}

/// Line of text for a live message.
pub fn message_line(message: &LiveMessage, profile: &Profile, heads: &HeadDescriptions) -> PilotLine {
    let line = |place: String, what: String, action: String, lamp: Option<Lamp>| PilotLine {
        place,
        speed: String::new(),
        what: vec![what],
        action,
        lamp,
    };
    let to = |from_m: f64, to_m: f64| format!("{} to {}", station(from_m), station(to_m));
    match message {
        LiveMessage::Flag { from_m, missed, .. } => {
            let at_most_mps = missed.figures.again_mps(missed.v_max_mps);
            let action = actions_text(&missed.figures.actions(), missed.back_to_m, at_most_mps, heads);
            let clock = clock_text(profile, missed.hole_arc_m);
            let what = format!(
                "MISSED: {}, holes over {} m at {clock}",
                cause_text(&missed.figures, heads),
                missed.target_m
            );
            line(station(*from_m), what, action, Some(Lamp::Red))
        }
        LiveMessage::FlagEnds { from_m, to_m, failed_m, .. } => {
            let of_it = of_it_text(*failed_m, to_m - from_m);
            line(station(*from_m), format!("missed until {}{of_it}", station(*to_m)), String::new(), None)
        }
        LiveMessage::Cleared { from_m, to_m, .. } => line(
            station(*from_m),
            format!("CLEARED until {}", station(*to_m)),
            String::new(),
            Some(Lamp::Green),
        ),
        LiveMessage::CannotSay(stretch) => {
            let what = format!("CAN'T SAY: {}", unsure_text(stretch));
            line(station(stretch.from_m), what, helps_text(stretch), Some(Lamp::Amber))
        }
        LiveMessage::CannotSayEnds(stretch) => {
            let of_it = of_it_text(stretch.metres_m, stretch.to_m - stretch.from_m);
            let what = format!("can't say until {}{of_it}", station(stretch.to_m));
            line(station(stretch.from_m), what, String::new(), None)
        }
        LiveMessage::NotInspected(stretch) => {
            let what = format!("NOT INSPECTED: {}", unsure_text(stretch));
            let place = to(stretch.from_m, stretch.to_m);
            line(place, what, helps_text(stretch), Some(Lamp::Amber))
        }
        LiveMessage::AlertChange { change, alert } => alert_line(*change, alert),
        LiveMessage::Note(note) => {
            let by = if note.by.is_empty() { String::new() } else { format!(" ({})", note.by) };
            let place = note.station.clone().unwrap_or_else(|| "-+---.--".to_owned());
            line(place, format!("{}{by}", note.words()), String::new(), None)
        }
        LiveMessage::Way { from_m, to_m, metres } => {
            line(to(*from_m, *to_m), format!("Coverage: {}", metres_text(metres)), String::new(), None)
        }
    }
}

/// Line for a change of an alert.
fn alert_line(change: AlertChange, alert: &ListedAlertJson) -> PilotLine {
    let by = match (&alert.acknowledged, change) {
        (Some(by), AlertChange::Acknowledged) if !by.by.is_empty() => format!(" by {}", by.by),
        _ => String::new(),
    };
    let has_advice = matches!(change, AlertChange::Raised | AlertChange::Changed);
    PilotLine {
        place: format!("ALERT {}", alert.number),
        what: vec![format!("{}{by}: {}", change.as_str(), alert.text)],
        action: if has_advice { alert.advice.clone() } else { String::new() },
        lamp: (change == AlertChange::Raised).then_some(Lamp::Amber),
        ..PilotLine::default()
    }
}

impl LiveMessage {
    /// Whether the message's line tells the pilot something that the status line and the other lines don't.
    ///
    /// Among changes of alerts, these add something: acknowledgements, remaining resources, doubts about
    /// sensors, settings and the dive as a whole, and ends that no other line shows.
    pub fn adds_line(&self) -> bool {
        let Self::AlertChange { change, alert } = self else { return true };
        let is_left = matches!(alert.kind, "cable_left" | "time_left" | "battery_left");
        let is_sensor = matches!(
            alert.kind,
            "sensor_silent" | "sensor_withheld" | "sensor_stalled" | "sensor_deaf" | "sensor_hung"
        );
        let is_observed = alert.occurrences.is_some();
        let has_end_line =
            is_sensor || is_observed && !matches!(alert.kind, "outside_tunnel" | "profile_contradicted");
        match change {
            AlertChange::Acknowledged => true,
            AlertChange::Raised => is_left || is_sensor || is_observed || alert.kind == "no_data",
            AlertChange::Changed => is_left || is_observed,
            // If nobody has acknowledged the alert, the line appears when the condition ends, not at the
            // acknowledgement.
            AlertChange::Rectified => has_end_line,
            AlertChange::Cleared => has_end_line && alert.rectified_s == alert.cleared_s,
            AlertChange::Silenced => false,
        }
    }
}

#[cfg(test)]
mod tests;
