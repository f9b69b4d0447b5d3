//! Parses messages from viewers.

use serde::{Deserialize, Serialize};

/// Maximum length of a viewer's message, bytes.
pub(crate) const LONGEST: usize = 4096;
/// Maximum length of a note, bytes.
const LONGEST_NOTE: usize = 240;
/// Maximum length of a sender's name, bytes.
const LONGEST_NAME: usize = 16;
/// Rates at which a viewer may request states, Hz.
const RATES_HZ: core::ops::RangeInclusive<f64> = 0.1..=5.0;

/// A viewer's request, parsed but with values that haven't been checked yet.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(tag = "do", rename_all = "snake_case", deny_unknown_fields)]
pub(crate) enum Request {
    /// Acknowledges an alert; 0 acknowledges all.
    Acknowledge {
        alert: u32,
        #[serde(default)]
        by: String,
    },
    /// Silences all alerts that sound.
    Silence {
        #[serde(default)]
        by: String,
    },
    /// Adds a text note at the present position.
    Note {
        text: String,
        #[serde(default)]
        by: String,
    },
    /// Adds a mark at the present position.
    Mark {
        #[serde(default)]
        by: String,
    },
    /// Begins a voice note at the present position.
    Voice {
        id: u32,
        #[serde(default)]
        by: String,
    },
    /// Controls the playback of a replay.
    Play {
        command: String,
        #[serde(default)]
        speed: Option<f64>,
        #[serde(default)]
        to_s: Option<f64>,
    },
    /// Sets the rate at which this viewer gets states.
    Rate { hz: f64 },
}

/// An operator's action, which is serialised as operator input of the loop.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
#[serde(tag = "do", rename_all = "snake_case")]
pub enum Command {
    /// Acknowledges an alert; 0 acknowledges all alerts that need an acknowledgement.
    Acknowledge {
        /// Number of the alert; 0 means all.
        alert: u32,
        /// Name of the sender, at most 16 bytes.
        by: String,
    },
    /// Silences all alerts that sound, for a limited time.
    Silence {
        /// Name of the sender.
        by: String,
    },
    /// Adds a text note at the present position.
    Note {
        /// Text of the note, at most 240 bytes.
        text: String,
        /// Name of the sender.
        by: String,
    },
    /// Adds a mark at the present position.
    Mark {
        /// Name of the sender.
        by: String,
    },
    /// Begins a voice note at the present position. The recording follows as a request to `/voice/ID`.
    Voice {
        /// Id that links the note to its recording; chosen by the page, not 0.
        id: u32,
        /// Name of the sender.
        by: String,
    },
}

impl Command {
    /// Keyword that names the command in a message.
    pub fn word(&self) -> &'static str {
        match self {
            Self::Acknowledge { .. } => "acknowledge",
            Self::Silence { .. } => "silence",
            Self::Note { .. } => "note",
            Self::Mark { .. } => "mark",
            Self::Voice { .. } => "voice",
        }
    }
}

/// A command that controls playback.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Play {
    /// Pauses playback.
    Pause,
    /// Resumes playback.
    Go,
    /// Plays one tick, then pauses.
    Step,
    /// Plays until a section is judged, then pauses.
    StepSection,
    /// Ends playback.
    End,
    /// Sets the speed as a multiple of real time; `None` plays as fast as possible.
    Speed(Option<f64>),
    /// Seeks to this time, seconds of dive time.
    Seek(f64),
}

/// A viewer's request, parsed and with valid values.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Asked {
    Command(Command),
    Play(Play),
    /// Rate at which this viewer gets states, Hz.
    Rate(f64),
}

impl Asked {
    /// Parses and validates the text of a message.
    ///
    /// Errors: the reason why the message is invalid.
    pub(crate) fn parse(text: &str) -> Result<Self, String> {
        let request: Request =
            serde_json::from_str(text).map_err(|error| format!("no valid command: {error}"))?;
        Self::of(request)
    }

    fn of(request: Request) -> Result<Self, String> {
        let within = |what: &str, text: String, most: usize| {
            if text.len() <= most {
                Ok(text)
            } else {
                Err(format!("{what} has {} bytes; at most {most}", text.len()))
            }
        };
        let name = |by: String| within("by", by, LONGEST_NAME);
        Ok(match request {
            Request::Acknowledge { alert, by } => {
                Self::Command(Command::Acknowledge { alert, by: name(by)? })
            }
            Request::Silence { by } => Self::Command(Command::Silence { by: name(by)? }),
            Request::Note { text, by } => {
                let text = within("text", text, LONGEST_NOTE)?;
                Self::Command(Command::Note { text, by: name(by)? })
            }
            Request::Mark { by } => Self::Command(Command::Mark { by: name(by)? }),
            Request::Voice { id: 0, .. } => return Err("id is 0; expected 1 to 4294967295".to_owned()),
            Request::Voice { id, by } => Self::Command(Command::Voice { id, by: name(by)? }),
            Request::Play { command, speed, to_s } => Self::Play(play(&command, speed, to_s)?),
            Request::Rate { hz } if RATES_HZ.contains(&hz) => Self::Rate(hz),
            Request::Rate { hz } => return Err(format!("hz is {hz}; expected 0.1 to 5")),
        })
    }
}

fn play(command: &str, speed: Option<f64>, to_s: Option<f64>) -> Result<Play, String> {
    Ok(match (command, speed, to_s) {
        ("pause", ..) => Play::Pause,
        ("go", ..) => Play::Go,
        ("step", ..) => Play::Step,
        ("step_section", ..) => Play::StepSection,
        ("end", ..) => Play::End,
        ("speed", None, _) => Play::Speed(None),
        ("speed", Some(speed), _) if (0.01..=10_000.0).contains(&speed) => Play::Speed(Some(speed)),
        ("speed", Some(speed), _) => {
            return Err(format!("speed is {speed}; expected 0.01 to 10000, or null"));
        }
        ("seek", _, Some(to_s)) if (0.0..=1.8e10).contains(&to_s) => Play::Seek(to_s),
        ("seek", ..) => return Err("seek needs to_s, seconds of dive time".to_owned()),
        (other, ..) => {
            return Err(format!(
                "{other:?} isn't a command; expected pause, go, step, step_section, end, speed or seek"
            ));
        }
    })
}

/// Parses a viewer's message into an operator's command.
///
/// Returns `None` for requests that concern only a replay or the page.
///
/// Errors: the reason why the message is invalid, as the page states it in a refusal.
pub fn command_of(message: &str) -> Result<Option<Command>, String> {
    Ok(match Asked::parse(message)? {
        Asked::Command(command) => Some(command),
        Asked::Play(_) | Asked::Rate(_) => None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn valid_commands_are_parsed_and_others_refused_with_the_reason() {
        let command = |text| Asked::parse(text);
        assert_eq!(
            command(r#"{"do":"acknowledge","alert":12,"by":"AB"}"#),
            Ok(Asked::Command(Command::Acknowledge { alert: 12, by: "AB".to_owned() }))
        );
        assert_eq!(
            command(r#"{"do":"play","command":"speed","speed":null}"#),
            Ok(Asked::Play(Play::Speed(None)))
        );
        assert_eq!(command(r#"{"do":"play","command":"seek","to_s":4.5}"#), Ok(Asked::Play(Play::Seek(4.5))));
        assert_eq!(command(r#"{"do":"rate","hz":1}"#), Ok(Asked::Rate(1.0)));
        for wrong in [
            "",
            "[]",
            r#"{"do":"acknowledge"}"#,
            r#"{"do":"acknowledge","alert":-1}"#,
            r#"{"do":"recording","fails":true}"#,
            r#"{"do":"mark","by":"12345678901234567"}"#,
            r#"{"do":"mark","to":1}"#,
            r#"{"do":"play","command":"seek"}"#,
            r#"{"do":"play","command":"seek","to_s":1e300}"#,
            r#"{"do":"play","command":"speed","speed":0}"#,
            r#"{"do":"rate","hz":1000}"#,
        ] {
            assert!(command(wrong).is_err(), "{wrong}");
        }
        let long = format!(r#"{{"do":"note","text":"{}"}}"#, "x".repeat(241));
        assert_eq!(command(&long), Err("text has 241 bytes; at most 240".to_owned()));
    }
}
