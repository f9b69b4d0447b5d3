//! Layout of the screen. Panels come in order of importance, each as high as the room allows.

use std::collections::VecDeque;

use headrace_config::plain::one_line;
use headrace_coverage::Verdict;
use headrace_geometry::time::DurNs;
use headrace_monitor::live_state::{Condition, Lamp, SensorState};
use headrace_monitor::live_text::PilotLine;
use headrace_monitor::words::{NOT_INSPECTED, UNSEEN, verdict_words};
use ratatui::buffer::{Buffer, Cell};
use ratatui::layout::Rect;
use ratatui::style::{Modifier, Style};
use ratatui::text::{Line, Span};

use super::frame::ScreenFrame;
use super::mode::Stop;
use super::panels::{self, CLOCK_ROWS};
use super::screen_buffer::{Palette, Rows};
use super::wall::{Extent, Wall};
use crate::cli::KEYS;

/// Maximum number of message lines that the screen keeps.
const MOST_MESSAGES: usize = 100;
/// Minimum size of the screen, columns and rows.
const LEAST: (u16, u16) = (40, 10);
/// Minimum size of the screen at which the allowed speed is also shown in large digits.
const LARGE: (u16, u16) = (90, 34);

/// Minimum height of the screen at which the plan is shown, rows.
const ROWS_WITH_PLAN: u16 = 24;

/// Playback state of a replay.
#[derive(Debug, Clone, Copy)]
pub(super) struct Playing {
    /// Playback speed relative to real time; `None` if unlimited.
    pub(super) speed: Option<f64>,
    pub(super) paused: bool,
}

/// Data that the screen shows.
pub(super) struct Page {
    mode: &'static str,
    pub(super) ink: Palette,
    pub(super) shot: Option<ScreenFrame>,
    pub(super) wall: Wall,
    messages: VecDeque<PilotLine>,
    /// Time for which the loop has been stalled; `None` if it isn't.
    pub(super) late: Option<DurNs>,
    pub(super) playing: Option<Playing>,
    /// Text of the note that the operator is writing.
    pub(super) note: Option<String>,
    pub(super) help: bool,
    pub(super) extent: Extent,
    said: Option<String>,
}

impl Page {
    pub(super) fn new(mode: &'static str, ink: Palette) -> Self {
        Self {
            mode,
            ink,
            shot: None,
            wall: Wall::default(),
            messages: VecDeque::new(),
            late: None,
            playing: None,
            note: None,
            help: false,
            extent: Extent::default(),
            said: None,
        }
    }

    /// Updates the screen's content with a frame.
    pub(super) fn take(&mut self, mut shot: ScreenFrame) {
        self.wall.take(&shot.wall);
        for line in shot.messages.drain(..) {
            self.tell(line);
        }
        self.shot = Some(shot);
    }

    /// Shows a log message among the message lines.
    pub(super) fn log(&mut self, text: String) {
        self.tell(PilotLine { place: "LOG".to_owned(), what: vec![text], ..PilotLine::default() });
    }

    fn tell(&mut self, line: PilotLine) {
        if self.messages.len() == MOST_MESSAGES {
            self.messages.pop_front();
        }
        self.messages.push_back(line);
    }

    /// Shows an answer to a key in the last row.
    pub(super) fn say(&mut self, text: impl Into<String>) {
        self.said = Some(text.into());
    }

    pub(super) fn clear_said(&mut self) {
        self.said = None;
    }

    /// Draws the whole screen.
    pub(super) fn draw(&self, to: &mut Buffer) {
        let area = to.area;
        if area.width < LEAST.0 || area.height < LEAST.1 {
            let text = format!("needs {}x{}", LEAST.0, LEAST.1);
            to.set_stringn(0, 0, text, usize::from(area.width), Style::default());
            return;
        }
        let mut rows = Rows { to, top: area.y, bottom: area.bottom() };
        self.footer(&mut rows);
        self.header(&mut rows);
        let Some(shot) = &self.shot else {
            rows.text("waiting for the dive's first tick", Style::default());
            return;
        };
        self.banner(shot, area, &mut rows);
        panels::speed(shot, self.ink, &mut rows);
        panels::place(shot, self.ink, &mut rows);
        if area.height >= ROWS_WITH_PLAN {
            panels::plan(shot, &mut rows);
        }
        self.panels(shot, &mut rows);
        if self.help {
            self.show_help(area, to);
        }
        if !self.ink.unicode {
            to.content.iter_mut().for_each(in_ascii);
        }
    }

    /// Draws the panels within the available room.
    fn panels(&self, shot: &ScreenFrame, rows: &mut Rows<'_>) {
        // Room is reserved: alerts and messages have at least two rows, and the wall has two strips. Each panel except
        // the last has a title. The wall's strips by clock hour get room before alerts of the level caution.
        let left = usize::from(rows.left()).saturating_sub(3 + 3 + 1 + 2);
        let well = shot.sensors.iter().filter(|sensor| sensor.state == SensorState::Ok).count();
        let wanted = shot.sensors.len() - well + panels::sensor_rows(well, usize::from(rows.width()));
        let sensors = wanted.min(left).max(1);
        let left = left.saturating_sub(sensors);
        let columns = usize::from(rows.width());
        let [urgent, all] =
            panels::alert_rows(shot, self.ink, columns).map(|rows| rows.saturating_sub(2).min(8));
        let left_by_urgent = left.saturating_sub(urgent);
        let clock = if left_by_urgent > CLOCK_ROWS { CLOCK_ROWS } else { 0 };
        let more_alerts = all.min(left - clock);
        let ruler = left - clock > more_alerts;
        panels::alerts(shot, self.ink, 2 + more_alerts, rows);
        panels::sensors(shot, self.ink, sensors, rows);
        panels::wall(&self.wall, self.extent, self.ink, (clock > 0, ruler), rows);
        self.messages(rows);
    }

    fn header(&self, rows: &mut Rows<'_>) {
        let width = usize::from(rows.width());
        let (vehicle, target) = match &self.shot {
            Some(shot) => {
                (one_line(&shot.vehicle).into_owned(), format!(", target {} m", shot.state.target.max_hole_m))
            }
            None => (String::new(), String::new()),
        };
        let time = self.shot.as_ref().map_or_else(String::new, |shot| time_text(shot.time));
        let mut mode = self.mode.to_owned();
        if let Some(playing) = self.playing {
            mode += &playing.speed.map_or_else(|| " max".to_owned(), |speed| format!(" {speed}x"));
            let ended = self.shot.as_ref().is_some_and(|shot| shot.stopped == Some(Stop::Ended));
            mode += match (ended, playing.paused) {
                (true, _) => " END",
                (false, true) => " PAUSED",
                (false, false) => "",
            };
        }
        let right = format!("{mode}  {time}");
        let left: String = format!("headrace  {vehicle}{target}")
            .chars()
            .take(width.saturating_sub(right.chars().count() + 1))
            .collect();
        let gap = width.saturating_sub(left.chars().count() + right.chars().count());
        rows.line(Line::from(vec![
            Span::styled(left, Palette::dim()),
            Span::raw(" ".repeat(gap)),
            Span::styled(right, Style::default().add_modifier(Modifier::BOLD)),
        ]));
    }

    /// Draws the banner with the dive's condition, and with the allowed speed in large digits if there is
    /// room.
    fn banner(&self, shot: &ScreenFrame, area: Rect, rows: &mut Rows<'_>) {
        let condition = shot.state.condition();
        let lamp = if self.late.is_some() { Lamp::Red } else { condition.lamp() };
        let style = self.ink.banner(lamp);
        let shape = self.ink.shape(lamp);
        let what = match self.late {
            Some(late) => format!("OLD {:.0} s: the program has stalled", late.as_secs_f64()),
            None => shot.status.what.first().cloned().unwrap_or_default(),
        };
        let words =
            if condition == Condition::Good && self.late.is_none() { format!("GOOD: {what}") } else { what };
        let arrow = if self.ink.unicode { "→" } else { "->" };
        let action = match self.late {
            Some(_) => format!("{arrow} the values below are old; stop"),
            None if shot.status.action.is_empty() => shot.status.what.get(1).cloned().unwrap_or_default(),
            None => format!("{arrow} {}", shot.status.action),
        };
        let large = area.width >= LARGE.0 && area.height >= LARGE.1;
        let height = if large {
            7
        } else if area.height >= 24 {
            4
        } else {
            2
        };
        let top = rows.top;
        for _ in 0..height {
            rows.line(Line::styled(" ".repeat(usize::from(area.width)), style));
        }
        let width = usize::from(area.width).saturating_sub(2);
        let middle = top + (height - 2) / 2;
        rows.to.set_stringn(1, middle, format!("{shape} {words} {shape}"), width, style);
        let indent = "  ";
        rows.to.set_stringn(1, middle + 1, format!("{indent}{action}"), width, style);
        if large && let Some(limit) = shot.state.speed_texts().limit.filter(|_| self.late.is_none()) {
            panels::large_digits(&limit, "m/s at most", (area.width, top), style, self.ink, rows.to);
        }
        if let Some((words, is_alarm)) = &shot.recording {
            let lamp = if *is_alarm { Lamp::Red } else { Lamp::Amber };
            rows.line(Line::styled(format!(" {} {words}", self.ink.shape(lamp)), self.ink.banner(lamp)));
        }
    }

    /// Draws the last messages, newest at the bottom.
    fn messages(&self, rows: &mut Rows<'_>) {
        let room = usize::from(rows.left());
        if room == 0 {
            return;
        }
        let room = if room > 2 {
            rows.title("EVENTS", self.ink);
            room - 1
        } else {
            room
        };
        let columns = usize::from(rows.width());
        let mut lines: VecDeque<(String, Option<Lamp>)> = VecDeque::new();
        for line in self.messages.iter().rev() {
            if lines.len() >= room {
                break;
            }
            let broken = line.broken(columns);
            // If a message doesn't fit in full, only its beginning is shown.
            let fits = broken.len().min(room - lines.len());
            broken.into_iter().take(fits).rev().for_each(|text| lines.push_front((text, line.lamp)));
        }
        for (text, lamp) in lines {
            let style = lamp.map_or(Style::default(), |lamp| self.ink.style(lamp));
            rows.text(&one_line(&text), style);
        }
    }

    fn footer(&self, rows: &mut Rows<'_>) {
        rows.bottom -= 1;
        let reversed = Style::default().add_modifier(Modifier::REVERSED);
        let text = match (&self.note, &self.said) {
            (Some(note), _) => format!(" note: {note}_   (Enter saves it, Esc discards it)"),
            (None, Some(said)) => format!(" {said}"),
            (None, None) => {
                let play: &[&str] =
                    if self.playing.is_some() { &["space pause", "arrows seek", "q quit"] } else { &[] };
                let ours = ["a acknowledge", "s silence", "n note", "w wall", "Ctrl-C ends the dive"];
                let mut text = " ? keys".to_owned();
                // As many keys are shown as there is room for.
                for key in play.iter().chain(&ours) {
                    if text.len() + 2 + key.len() < usize::from(rows.to.area.width) {
                        text = format!("{text}  {key}");
                    }
                }
                text
            }
        };
        let width = usize::from(rows.to.area.width);
        let text: String = one_line(&text).chars().chain(core::iter::repeat(' ')).take(width).collect();
        rows.to.set_stringn(0, rows.bottom, text, width, reversed);
    }

    fn show_help(&self, area: Rect, to: &mut Buffer) {
        let mut lines = vec![
            "a   acknowledge the alert on top".to_owned(),
            "A   acknowledge all alerts".to_owned(),
            "s   silence alerts for 30 s".to_owned(),
            "n   note at this position".to_owned(),
            "w   wall: nearby, all seen, whole tunnel".to_owned(),
            "?   list of keys".to_owned(),
            "Ctrl-C ends the dive; twice ends the program".to_owned(),
            String::new(),
            "wall: bar height is hole / target".to_owned(),
            format!(
                "{} {}  ? {}  ~ {}",
                if self.ink.unicode { '✖' } else { 'X' },
                verdict_words(Verdict::Fail),
                verdict_words(Verdict::CannotSay),
                verdict_words(Verdict::Open)
            ),
            format!("o {NOT_INSPECTED}  . {UNSEEN}  ^ vehicle"),
        ];
        if self.playing.is_some() {
            lines.push(String::new());
            lines.extend(KEYS.split(", ").map(str::to_owned));
        }
        let width = lines.iter().map(|line| line.chars().count()).max().unwrap_or(0) + 4;
        let width = u16::try_from(width).unwrap_or(u16::MAX).min(area.width);
        let height = u16::try_from(lines.len()).unwrap_or(u16::MAX).saturating_add(2).min(area.height - 1);
        let (left, top) = ((area.width - width) / 2, (area.height - height) / 2);
        let style = Style::default().add_modifier(Modifier::REVERSED);
        for row in 0..height {
            let line =
                row.checked_sub(1).and_then(|line| lines.get(usize::from(line))).map_or("", String::as_str);
            let text: String =
                format!("  {line}").chars().chain(core::iter::repeat(' ')).take(usize::from(width)).collect();
            to.set_stringn(left, top + row, text, usize::from(width), style);
        }
    }
}

/// Replaces the non-ASCII characters of text from outside the program. A plus-minus sign becomes a tilde.
fn in_ascii(cell: &mut Cell) {
    if !cell.symbol().is_ascii() {
        let plain = if cell.symbol() == "±" { "~" } else { "?" };
        cell.set_symbol(plain);
    }
}

fn time_text(time: DurNs) -> String {
    let seconds = time.0 / 1_000_000_000;
    format!("{}:{:02}:{:02}", seconds / 3600, seconds / 60 % 60, seconds % 60)
}
