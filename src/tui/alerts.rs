//! Alerts as the screen lists them, and the operator's commands.

use headrace_monitor::alert_list::{AlertState, ListedAlert, Priority};
use headrace_monitor::console::{Command, ConsolePort, NoteText, Who};
use headrace_monitor::live_state::Lamp;
use headrace_monitor::run::Loop;

/// Who commands from here.
const BY: &str = "terminal";

/// An alert.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct AlertRow {
    pub(super) number: u32,
    pub(super) priority: &'static str,
    /// Whether it holds, and whether somebody knows.
    pub(super) state: &'static str,
    pub(super) lamp: Lamp,
    /// Flashes until somebody acknowledges it.
    pub(super) needs_acknowledgement: bool,
    pub(super) text: String,
    pub(super) advice: String,
}

/// The alerts that aren't over, the most urgent first, and how many more there are.
pub(super) fn rows(dive: &Loop) -> (Vec<AlertRow>, usize) {
    let around = dive.surroundings();
    let (shown, hidden) = dive.alert_list().shown();
    let row = |alert: &&ListedAlert| AlertRow {
        number: alert.number,
        priority: match alert.priority {
            Priority::EmergencyAlarm => "EMERGENCY",
            Priority::Alarm => "ALARM",
            Priority::Warning => "WARNING",
            Priority::Caution => "CAUTION",
        },
        state: match (alert.state, alert.needs_acknowledgement()) {
            (AlertState::Active, true) => "NEW",
            (AlertState::Active, false) => "active",
            (AlertState::Rectified, _) => "is OVER, not acknowledged",
            (AlertState::Cleared, _) => "cleared",
        },
        lamp: match alert.priority {
            Priority::EmergencyAlarm | Priority::Alarm => Lamp::Red,
            Priority::Warning | Priority::Caution => Lamp::Amber,
        },
        needs_acknowledgement: alert.needs_acknowledgement(),
        text: alert.text(&around),
        advice: alert.advice(&around),
    };
    (shown.iter().filter(|alert| alert.is_live()).map(row).collect(), hidden)
}

/// Hands the operator's commands to the loop.
pub(super) struct Desk(Option<ConsolePort>);

impl Desk {
    /// Of a dive that is over without a console.
    pub(super) fn new(console: Option<ConsolePort>) -> Self {
        Self(console)
    }

    /// Acknowledges the alert of a number, or with 0 all; returns what is said of it.
    pub(super) fn acknowledge(&self, alert: u32) -> String {
        let done = if alert == 0 { "all acknowledged".to_owned() } else { format!("{alert} acknowledged") };
        self.send(&Command::Acknowledge { alert, by: Who::cut(BY) }, done)
    }

    /// Silences all that sound.
    pub(super) fn silence(&self) -> String {
        self.send(&Command::Silence { by: Who::cut(BY) }, "silent for 30 s".to_owned())
    }

    /// Puts down a note at the present place.
    pub(super) fn note(&self, text: &str) -> String {
        self.send(&Command::Note { text: NoteText::cut(text), by: Who::cut(BY) }, format!("noted: {text}"))
    }

    fn send(&self, command: &Command, done: String) -> String {
        match self.0.as_ref().map(|console| console.send(command)) {
            Some(Ok(())) => done,
            Some(Err(error)) => error.to_string(),
            None => "this dive is over: what was acknowledged and noted is in its log".to_owned(),
        }
    }

    /// Whether anybody can command.
    pub(super) fn is_open(&self) -> bool {
        self.0.is_some()
    }
}
