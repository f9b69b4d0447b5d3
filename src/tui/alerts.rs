//! The screen's alerts, and the operator's commands.

use headrace_monitor::alert_list::{AlertState, ListedAlert, Priority};
use headrace_monitor::console::{Command, ConsolePort, NoteText, Who};
use headrace_monitor::live_state::Lamp;
use headrace_monitor::run::Loop;
use headrace_monitor::words::priority_word;

/// Author named in acknowledgements and notes from this screen.
const BY: &str = "terminal";

/// An alert on the screen.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct AlertRow {
    pub(super) number: u32,
    pub(super) priority: &'static str,
    /// Whether the condition holds, and whether the alert is acknowledged, as text.
    pub(super) state: &'static str,
    pub(super) lamp: Lamp,
    /// Whether the alert flashes because somebody must still acknowledge it.
    pub(super) needs_acknowledgement: bool,
    pub(super) is_caution: bool,
    pub(super) text: String,
    pub(super) advice: String,
}

/// Rows of the live alerts, most urgent first, and the number of alerts for which there is no row.
pub(super) fn rows(dive: &Loop) -> (Vec<AlertRow>, usize) {
    let around = dive.view().surroundings();
    let (shown, hidden) = dive.view().alert_list().shown();
    let row = |alert: &&ListedAlert| AlertRow {
        number: alert.number,
        priority: priority_word(alert.priority),
        state: match (alert.state, alert.needs_acknowledgement()) {
            (AlertState::Active, true) => "NEW",
            (AlertState::Active, false) => "active",
            (AlertState::Rectified, _) => "rectified, not acknowledged",
            (AlertState::Cleared, _) => "cleared",
        },
        lamp: match alert.priority {
            Priority::EmergencyAlarm | Priority::Alarm => Lamp::Red,
            Priority::Warning | Priority::Caution => Lamp::Amber,
        },
        needs_acknowledgement: alert.needs_acknowledgement(),
        is_caution: alert.priority == Priority::Caution,
        text: alert.text(&around),
        advice: alert.advice(&around),
    };
    (shown.iter().filter(|alert| alert.is_live()).map(row).collect(), hidden)
}

/// Hands the operator's commands to the loop, if the dive accepts commands.
pub(super) struct Desk(Option<ConsolePort>);

impl Desk {
    /// Creates the handle for the operator's commands. A recorded dive has no console.
    pub(super) fn new(console: Option<ConsolePort>) -> Self {
        Self(console)
    }

    /// Acknowledges the alert with this number, or all alerts with 0. Returns the answer to show.
    pub(super) fn acknowledge(&self, alert: u32) -> String {
        let done = if alert == 0 { "all acknowledged".to_owned() } else { format!("{alert} acknowledged") };
        self.send(&Command::Acknowledge { alert, by: Who::cut(BY) }, done)
    }

    /// Silences all sounding alerts. Returns the answer to show.
    pub(super) fn silence(&self) -> String {
        self.send(&Command::Silence { by: Who::cut(BY) }, "alerts silenced for 30 s".to_owned())
    }

    /// Adds a note at the vehicle's present chainage. Returns the answer to show.
    pub(super) fn note(&self, text: &str) -> String {
        self.send(&Command::Note { text: NoteText::cut(text), by: Who::cut(BY) }, format!("noted: {text}"))
    }

    fn send(&self, command: &Command, done: String) -> String {
        match self.0.as_ref().map(|console| console.send(command)) {
            Some(Ok(())) => done,
            Some(Err(error)) => error.to_string(),
            None => "this dive has ended: its log contains the acknowledgements and notes".to_owned(),
        }
    }

    /// Whether the dive accepts an operator's commands.
    pub(super) fn is_open(&self) -> bool {
        self.0.is_some()
    }
}
