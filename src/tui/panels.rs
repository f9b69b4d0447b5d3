//! Draws the panels of the screen.

use headrace_config::plain::one_line;
use headrace_coverage::{Metres, Verdict};
use headrace_geometry::math;
use headrace_geometry::time::DurNs;
use headrace_monitor::live_state::{Condition, Lamp, PositionState, SensorState};
use headrace_monitor::pilot_text::station;
use headrace_monitor::words::{NOT_INSPECTED, sensor_words as state_words, verdict_words};
use ratatui::buffer::Buffer;
use ratatui::style::{Color, Modifier, Style};
use ratatui::text::{Line, Span};

use super::alerts::AlertRow;
use super::frame::{ScreenFrame, SensorRow};
use super::mode::Stop;
use super::screen_buffer::{Palette, Rows};
use super::wall::{Cell, Extent, HOURS, Known, Strip, Wall};
use crate::output::append;

/// Number of rows of the strips that show coverage by clock hour.
pub(super) const CLOCK_ROWS: usize = HOURS;
/// Widths of a sensor's entry, columns: with the age of its data, and without it.
const LAMP_COLUMNS: [usize; 2] = [24, 19];
/// Width of the labels before the wall's strips, columns.
const LABEL: usize = 6;

/// Draws the speed relative to v_max as a bar, with the reason below.
pub(super) fn speed(shot: &ScreenFrame, ink: Palette, rows: &mut Rows<'_>) {
    let state = &shot.state;
    let is_known = is_now(shot);
    let texts = state.speed_texts();
    let speed = texts.speed.unwrap_or_else(|| "-.--".to_owned());
    let back = if state.is_driving_back() { " back" } else { "" };
    let limit = texts.limit.map_or_else(String::new, |limit| format!("(limit {limit})  "));
    let words = format!("SPEED  {speed} m/s{back} {limit}");
    let v_max_mps = state.v_max_mps().filter(|_| !limit.is_empty());
    let mut spans = vec![Span::styled(words.clone(), Style::default().add_modifier(Modifier::BOLD))];
    let columns = usize::from(rows.width()).saturating_sub(words.chars().count() + 2).min(60);
    if let (Some(speed_mps), Some(v_max_mps)) = (state.speed_mps, v_max_mps)
        && columns >= 10
    {
        // The bar ends at one and a half times v_max.
        let share = |mps: f64| (mps.abs() / (1.5 * v_max_mps)).min(1.0);
        let at = |mps: f64| usize::try_from(math::round_to_i64(share(mps) * columns as f64)).unwrap_or(0);
        let (filled, mark) = (at(speed_mps), at(v_max_mps));
        let (full, empty, limit) = if ink.unicode { ('█', '░', '┃') } else { ('=', '.', '|') };
        let style = ink.style(state.condition().lamp());
        spans.push(Span::raw("["));
        for column in 0..columns {
            let (letter, style) = match column {
                column if column == mark => (limit, Style::default().add_modifier(Modifier::BOLD)),
                column if column < filled => (full, style),
                _ => (empty, Palette::dim()),
            };
            spans.push(Span::styled(letter.to_string(), style));
        }
        spans.push(Span::raw("]"));
    }
    rows.line(Line::from(spans));
    let mut parts: Vec<&str> = Vec::new();
    // If returns are lost, the status line states their share, so the reason is left out.
    if is_known && !shot.reason.is_empty() && state.lost_share().is_none() {
        parts.push(&shot.reason);
    }
    // The banner already shows the first parts of the status line.
    let shown = if shot.status.action.is_empty() { 2 } else { 1 };
    parts.extend(shot.status.what.iter().skip(shown).map(String::as_str));
    rows.text(&one_line(&format!("WHY    {}", fitted(&parts, columns_after_label(rows)))), Style::default());
}

fn columns_after_label(rows: &Rows<'_>) -> usize {
    usize::from(rows.width()).saturating_sub(LABEL + 1)
}

/// Joins texts, from the first on, as long as they fit in full.
fn fitted(parts: &[&str], columns: usize) -> String {
    let mut text = String::new();
    for part in parts {
        let gap = if text.is_empty() { "" } else { "  " };
        if text.chars().count() + gap.len() + part.chars().count() > columns {
            break;
        }
        text = format!("{text}{gap}{part}");
    }
    text
}

/// Whether the frame's state of the dive is up to date.
pub(super) fn is_now(shot: &ScreenFrame) -> bool {
    !matches!(shot.state.condition(), Condition::Old(_) | Condition::NoData)
}

/// Draws the vehicle's position with its error, and the length of wall with each verdict.
pub(super) fn place(shot: &ScreenFrame, ink: Palette, rows: &mut Rows<'_>) {
    let state = &shot.state;
    let place = state.chainage_m.map_or_else(|| "-+---.--".to_owned(), station);
    let mut spans =
        vec![Span::styled(format!("AT     {place}"), Style::default().add_modifier(Modifier::BOLD))];
    let pm = if ink.unicode { "±" } else { "+-" };
    let along = state
        .sd
        .map_or_else(|| "error unknown".to_owned(), |sd| format!("{pm}{:.2} m (95 %)", 2.0 * sd.along_m));
    let (words, lamp) = match state.position {
        _ if !is_now(shot) => {
            let age =
                state.age().map_or_else(|| "not known".to_owned(), |age| format!("{} ago", age_text(age)));
            (age, Lamp::Red)
        }
        PositionState::None(_) => ("no position".to_owned(), Lamp::Red),
        PositionState::Doubtful(_) => {
            let between_m = state.target.error_m(state.pass_sd_m);
            (format!("doubtful: {along}, {pm}{between_m:.2} m between passes"), Lamp::Amber)
        }
        PositionState::Ok => (format!("ok: {along}"), Lamp::Green),
    };
    spans.push(Span::styled(format!("  {} {words}", ink.shape(lamp)), ink.style(lamp)));
    rows.line(Line::from(spans));
    let style = if state.metres.fail_m > 0.0 { ink.style(Lamp::Red) } else { Style::default() };
    rows.text(&format!("METRES {}", metres_text(&state.metres, columns_after_label(rows))), style);
}

/// Draws the next steps of the plan for the rest of the dive, if there is a plan.
pub(super) fn plan(shot: &ScreenFrame, rows: &mut Rows<'_>) {
    if shot.plan.is_empty() || shot.stopped == Some(Stop::Ended) {
        return;
    }
    let parts: Vec<&str> = shot.plan.iter().map(String::as_str).collect();
    rows.text(&format!("PLAN   {}", fitted(&parts, columns_after_label(rows))), Style::default());
}

/// Text with the length of each verdict in metres: failed, unsure and uninspected lengths come first. Dots stand for
/// omitted figures.
fn metres_text(metres: &Metres, columns: usize) -> String {
    let Metres { pass_m, fail_m, cannot_say_m, open_m, not_inspected_m } = *metres;
    let missed = verdict_words(Verdict::Fail).to_uppercase();
    let all = [
        (fail_m, missed.as_str()),
        (cannot_say_m, verdict_words(Verdict::CannotSay)),
        (not_inspected_m, NOT_INSPECTED),
        (pass_m, verdict_words(Verdict::Pass)),
        (open_m, verdict_words(Verdict::Open)),
    ];
    let mut text = format!("{:.2} m:", metres.way_m());
    for (part_m, what) in all.iter().filter(|(part_m, _)| *part_m > 0.0) {
        let part = format!(" {part_m:.2} {what},");
        // Room is kept for the dots that stand for omitted figures.
        if text.len() + part.len() + 3 > columns {
            text += " ..";
            break;
        }
        text += &part;
    }
    text.trim_end_matches([',', ':']).to_owned()
}

/// Lines of an alert. If there is no room beside the problem, the action goes below it.
fn alert_lines(alert: &AlertRow, ink: Palette, columns: usize) -> Vec<String> {
    let AlertRow { number, priority, state, lamp, text, advice, .. } = alert;
    let first = format!("{} {number} {priority} {state}: {text}", ink.shape(*lamp));
    if advice.is_empty() {
        return wrapped(&first, columns);
    }
    let arrow = if ink.unicode { "→" } else { "->" };
    let whole = format!("{first} {arrow} {advice}");
    if whole.chars().count() <= columns {
        return vec![whole];
    }
    // The action is more important than the last words of the problem.
    let mut lines = vec![wrapped(&first, columns).swap_remove(0)];
    lines.extend(wrapped(&format!("    {arrow} {advice}"), columns));
    lines
}

/// Text wrapped at blanks to lines of at most `columns` columns. Continuation lines are indented.
fn wrapped(text: &str, columns: usize) -> Vec<String> {
    let mut lines = vec![String::new()];
    for word in text.split(' ') {
        let Some(line) = lines.last_mut() else { break };
        let is_begun = !line.trim().is_empty();
        if is_begun && line.chars().count() + 1 + word.chars().count() > columns {
            lines.push(format!("      {word}"));
        } else {
            if !line.is_empty() || word.is_empty() {
                line.push(' ');
            }
            line.push_str(word);
        }
    }
    lines
}

/// Number of rows needed for the alerts more urgent than a caution, and for all alerts.
pub(super) fn alert_rows(shot: &ScreenFrame, ink: Palette, columns: usize) -> [usize; 2] {
    [false, true].map(|cautions| {
        let counted = shot.alerts.iter().filter(|alert| cautions || !alert.is_caution);
        counted.map(|alert| alert_lines(alert, ink, columns).len()).sum()
    })
}

/// Draws the alerts in `room` rows below a title with their number.
pub(super) fn alerts(shot: &ScreenFrame, ink: Palette, room: usize, rows: &mut Rows<'_>) {
    let columns = usize::from(rows.width());
    let (mut lines, mut shown) = (Vec::new(), 0);
    for alert in &shot.alerts {
        let of_it = alert_lines(alert, ink, columns);
        // If room is short, an alert's action is left out before its problem.
        if lines.len() == room {
            break;
        }
        shown += 1;
        lines.extend(of_it.into_iter().take(room - lines.len()).map(|line| (line, alert)));
    }
    let new = shot.alerts.iter().filter(|alert| alert.needs_acknowledgement).count();
    let hidden = shot.alerts.len().saturating_sub(shown) + shot.alerts_hidden;
    let more = if hidden > 0 { format!(", {hidden} not shown") } else { String::new() };
    let title = match (shot.alerts.len(), new) {
        (0, _) => "ALERTS none".to_owned(),
        (all, 0) => format!("ALERTS {all}{more}"),
        (all, new) => format!("ALERTS {all}, {new} to acknowledge{more}"),
    };
    rows.title(&title, ink);
    let mut lines = lines.into_iter();
    for _ in 0..room {
        let Some((line, alert)) = lines.next() else {
            rows.text("", Style::default());
            continue;
        };
        let text: String = one_line(&line).chars().take(columns).collect();
        let style = ink.style(alert.lamp);
        let flashing = style.add_modifier(Modifier::REVERSED | Modifier::SLOW_BLINK);
        rows.text(&text, if alert.needs_acknowledgement { flashing } else { style });
    }
}

/// Number of rows needed for the entries of this many healthy sensors.
pub(super) fn sensor_rows(sensors: usize, columns: usize) -> usize {
    sensors.div_ceil((columns / LAMP_COLUMNS[0]).max(1))
}

/// Draws the sensors' lamps with rate and age.
///
/// Faulty sensors come first. Each faulty sensor has a row of its own with a reason, as long as there is room.
pub(super) fn sensors(shot: &ScreenFrame, ink: Palette, room: usize, rows: &mut Rows<'_>) {
    let unwell = shot.sensors.iter().filter(|sensor| sensor.state != SensorState::Ok).count();
    let columns = usize::from(rows.width());
    let has_room = sensor_rows(shot.sensors.len() - unwell, columns) + unwell <= room;
    let across = (columns / LAMP_COLUMNS[usize::from(!has_room)]).max(1);
    // One row is reserved for the healthy sensors, if there are any.
    let rows_of_ill = unwell.min(room.saturating_sub(usize::from(unwell < shot.sensors.len())));
    let hidden = shot.sensors.len().saturating_sub(rows_of_ill + (room - rows_of_ill) * across);
    let more = if hidden > 0 { format!(", {hidden} not shown") } else { String::new() };
    let title = match unwell {
        0 => format!("SENSORS {} ok{more}", shot.sensors.len()),
        some => format!("SENSORS {some} of {} not ok{more}", shot.sensors.len()),
    };
    rows.title(&title, ink);
    let (ill, well): (Vec<_>, Vec<_>) =
        shot.sensors.iter().partition(|sensor| sensor.state != SensorState::Ok);
    let mut ill = ill.into_iter();
    for sensor in ill.by_ref().take(rows_of_ill) {
        let (words, lamp) = sensor_words(sensor, true);
        let text: String = format!("{} {words}", ink.shape(lamp)).chars().take(columns).collect();
        rows.text(&one_line(&text), ink.style(lamp));
    }
    let others: Vec<&SensorRow> = ill.chain(well).collect();
    let width = columns / across;
    let mut lines = others.chunks(across);
    for _ in rows_of_ill..room {
        let spans = lines.next().unwrap_or_default().iter().map(|sensor| {
            let (words, lamp) = sensor_words(sensor, has_room);
            let text: String = format!("{} {words}", ink.shape(lamp)).chars().take(width - 1).collect();
            Span::styled(format!("{:<width$}", one_line(&text)), ink.style(lamp))
        });
        rows.line(Line::from(spans.collect::<Vec<_>>()));
    }
}

fn sensor_words(sensor: &SensorRow, long: bool) -> (String, Lamp) {
    let SensorRow { id, state, age, rate_hz, why } = sensor;
    let age = age.map_or_else(String::new, age_text);
    let rate = rate_hz.map_or_else(String::new, |hz| format!(" {hz:.0}/s"));
    let name = state_words(*state);
    let (words, lamp) = match state {
        SensorState::Ok if long => (format!("{id}{rate} {age}"), Lamp::Green),
        SensorState::Ok => (format!("{id}{rate}"), Lamp::Green),
        SensorState::Silent => (format!("{id} {} {age}", name.to_uppercase()), Lamp::Red),
        SensorState::Never
        | SensorState::Withheld
        | SensorState::Stalled
        | SensorState::Hung
        | SensorState::Deaf => (format!("{id} {name}"), Lamp::Red),
        SensorState::Distrusted => (format!("{id} {name}"), Lamp::Amber),
    };
    let why = if long && !why.is_empty() { format!(": {why}") } else { String::new() };
    (words + &why, lamp)
}

fn age_text(age: DurNs) -> String {
    let seconds = age.as_secs_f64();
    match seconds {
        _ if seconds < 9.95 => format!("{seconds:.1} s"),
        _ if seconds < 100.0 => format!("{seconds:.0} s"),
        _ => format!("{:.0} min", seconds / 60.0),
    }
}

/// Draws the wall by section: holes relative to the target, and verdicts. A ruler and coverage by clock
/// position are optional.
pub(super) fn wall(
    wall: &Wall,
    extent: Extent,
    ink: Palette,
    (clock, ruler): (bool, bool),
    rows: &mut Rows<'_>,
) {
    let columns = usize::from(rows.width()).saturating_sub(LABEL);
    let strip = wall.strip(extent, columns);
    let each = strip.column_m;
    rows.title(&format!("WALL {}, {each} m per column", extent.words()), ink);
    if clock {
        for hour in 0..HOURS {
            let label = format!("{:>4}h ", if hour == 0 { 12 } else { hour });
            strip_row(&label, &strip, rows, |cell| clock_mark(cell, hour, ink));
        }
    }
    strip_row("hole  ", &strip, rows, |cell| hole_mark(cell, ink));
    strip_row("judged", &strip, rows, |cell| verdict_mark(cell, ink));
    if let Some((column, inwards)) = strip.vehicle {
        let mark = match (ink.unicode, inwards) {
            (true, true) => "▶",
            (true, false) => "◀",
            (false, true) => ">",
            (false, false) => "<",
        };
        let x = u16::try_from(LABEL + column).unwrap_or(u16::MAX);
        let style = Style::default().add_modifier(Modifier::BOLD | Modifier::REVERSED);
        let y = rows.top.saturating_sub(1);
        rows.to.set_stringn(x, y, mark, 1, style);
    }
    if ruler {
        rows.text(&ruler_text(&strip), Palette::dim());
    }
}

fn strip_row(label: &str, strip: &Strip, rows: &mut Rows<'_>, mark: impl Fn(Cell) -> (char, Style)) {
    let mut spans = vec![Span::styled(label.to_owned(), Palette::dim())];
    for column in &strip.columns {
        let (letter, style) = column.map_or((' ', Style::default()), &mark);
        spans.push(Span::styled(letter.to_string(), style));
    }
    rows.line(Line::from(spans));
}

fn known_style(known: Known, ink: Palette) -> Style {
    match known {
        Known::Unseen => Palette::dim(),
        Known::Pass => ink.style(Lamp::Green),
        Known::Open if ink.colour => Style::default().fg(Color::Cyan),
        Known::Open | Known::NotInspected => Style::default(),
        Known::CannotSay => ink.style(Lamp::Amber),
        Known::Missed => ink.style(Lamp::Red).add_modifier(Modifier::REVERSED),
    }
}

/// Bar for the diameter of a section's largest hole. Half of the full height stands for the target, and the
/// full bar has eight steps.
fn hole_mark(cell: Cell, ink: Palette) -> (char, Style) {
    let Some(share) = cell.share else {
        return (if cell.known == Known::Unseen { '·' } else { ' ' }, Palette::dim()).ascii(ink);
    };
    let style = ink.style(if share > 1.0 { Lamp::Red } else { Lamp::Green });
    let step = usize::try_from(math::floor_to_i64((share * 4.0).clamp(0.0, 7.0))).unwrap_or(0);
    let bars: [char; 8] = if ink.unicode {
        ['▁', '▂', '▃', '▄', '▅', '▆', '▇', '█']
    } else {
        ['1', '2', '3', '4', '5', '6', '7', '8']
    };
    (bars.get(step).copied().unwrap_or(' '), style)
}

fn verdict_mark(cell: Cell, ink: Palette) -> (char, Style) {
    let mark = match cell.known {
        Known::Unseen => '·',
        Known::Pass => '=',
        Known::Open => '~',
        Known::NotInspected => 'o',
        Known::CannotSay => '?',
        Known::Missed => '✖',
    };
    (mark, known_style(cell.known, ink)).ascii(ink)
}

fn clock_mark(cell: Cell, hour: usize, ink: Palette) -> (char, Style) {
    let seen = cell.seen >> hour & 1 == 1;
    match (cell.known, seen) {
        (Known::Unseen, false) => (' ', Style::default()),
        (known, true) => ('█', known_style(known, ink).remove_modifier(Modifier::REVERSED)).ascii(ink),
        (_, false) => ('·', ink.style(Lamp::Red)).ascii(ink),
    }
}

trait Ascii {
    /// Replaces non-ASCII symbols if the terminal can't show them.
    fn ascii(self, ink: Palette) -> Self;
}

impl Ascii for (char, Style) {
    fn ascii(self, ink: Palette) -> Self {
        let letter = match self.0 {
            letter if ink.unicode => letter,
            '·' => '.',
            '█' => '#',
            '✖' => 'X',
            letter => letter,
        };
        (letter, self.1)
    }
}

/// Text of the ruler: chainages, each at its column below a strip.
fn ruler_text(strip: &Strip) -> String {
    let mut text = " ".repeat(LABEL);
    let mut column = 0;
    while column + 10 <= strip.columns.len() {
        let place = station(strip.from_m + column as f64 * strip.column_m);
        append(&mut text, format_args!("{:<20}", format!("|{place}")));
        column += 20;
    }
    text
}

/// Large digits, each of five rows. The three bits of a row are its columns, from the most significant bit.
const DIGITS: [[u8; 5]; 10] = [
    [7, 5, 5, 5, 7],
    [2, 6, 2, 2, 7],
    [7, 1, 7, 4, 7],
    [7, 1, 7, 1, 7],
    [5, 5, 7, 1, 1],
    [7, 4, 7, 1, 7],
    [7, 4, 7, 5, 7],
    [7, 1, 2, 2, 2],
    [7, 5, 7, 5, 7],
    [7, 5, 7, 1, 7],
];

/// Draws a number in large digits at the right of a banner of seven rows. Its unit is below the number.
pub(super) fn large_digits(
    figure: &str,
    unit: &str,
    (width, top): (u16, u16),
    style: Style,
    ink: Palette,
    to: &mut Buffer,
) {
    let letter_columns = |letter: char| if letter == '.' { 4 } else { 8 };
    let columns: u16 = figure.chars().map(letter_columns).sum();
    let mut left = width.saturating_sub(columns + 15);
    let block = if ink.unicode { "██" } else { "##" };
    for letter in figure.chars() {
        for row in 0..5_u16 {
            let bits = match letter.to_digit(10) {
                Some(digit) => DIGITS
                    .get(digit as usize)
                    .and_then(|rows| rows.get(usize::from(row)))
                    .copied()
                    .unwrap_or(0),
                None if row == 4 => 4,
                None => 0,
            };
            for bit in (0..3_u16).filter(|bit| bits >> (2 - bit) & 1 == 1) {
                to.set_stringn(left + 2 * bit, top + 1 + row, block, 2, style);
            }
        }
        left += letter_columns(letter);
    }
    to.set_stringn(left + 1, top + 5, unit, 12, style);
}
