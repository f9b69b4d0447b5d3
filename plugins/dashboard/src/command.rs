//! What viewers send.

use serde::{Deserialize, Serialize};

/// Longest message from a viewer, bytes.
pub(crate) const LONGEST: usize = 4096;
/// Longest text of a note, bytes.
const LONGEST_NOTE: usize = 240;
/// Longest name of who sends, bytes.
const LONGEST_NAME: usize = 16;
/// States a second that a viewer may ask for.
const RATES_HZ: core::ops::RangeInclusive<f64> = 0.1..=5.0;

/// A request as it comes.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(tag = "do", rename_all = "snake_case", deny_unknown_fields)]
pub(crate) enum Request {
    /// Acknowledges an alert; 0 all.
    Acknowledge {
        alert: u32,
        #[serde(default)]
        by: String,
    },
    /// Silences what sounds.
    Silence {
        #[serde(default)]
        by: String,
    },
    /// Notes a text at the present place.
    Note {
        text: String,
        #[serde(default)]
        by: String,
    },
    /// Marks the present place.
    Mark {
        #[serde(default)]
        by: String,
    },
    /// Begins a voice note at the present place.
    Voice {
        id: u32,
        #[serde(default)]
        by: String,
    },
    /// Controls a replay.
    Play {
        command: String,
        #[serde(default)]
        speed: Option<f64>,
        #[serde(default)]
        to_s: Option<f64>,
    },
    /// Asks for so many states a second.
    Rate { hz: f64 },
}

/// What an operator does. Serialised as the operator's input of the loop.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
#[serde(tag = "do", rename_all = "snake_case")]
pub enum Command {
    /// Acknowledges an alert; 0 all that need it.
    Acknowledge {
        /// Its number.
        alert: u32,
        /// Who, at most 16 bytes.
        by: String,
    },
    /// Silences all that sound, for a while.
    Silence {
        /// Who.
        by: String,
    },
    /// Notes a text at the present place.
    Note {
        /// At most 240 bytes.
        text: String,
        /// Who.
        by: String,
    },
    /// Marks the present place.
    Mark {
        /// Who.
        by: String,
    },
    /// Begins a voice note at the present place; its recording follows by `/voice/ID`.
    Voice {
        /// Ties it to its recording; made on the page, not 0.
        id: u32,
        /// Who.
        by: String,
    },
}

impl Command {
    /// Its word.
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

/// What is asked of a replay.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Play {
    /// Stand still.
    Pause,
    /// Go on.
    Go,
    /// One tick, then stand still.
    Step,
    /// On until a section is judged, then stand still.
    StepSection,
    /// End.
    End,
    /// So many seconds of the dive a second; `None` is as fast as possible.
    Speed(Option<f64>),
    /// Jump to this time, seconds on the log's clock.
    Seek(f64),
}

/// A request that is valid.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Asked {
    Command(Command),
    Play(Play),
    /// States a second.
    Rate(f64),
}

impl Asked {
    /// Of a message's text.
    ///
    /// Errors: what is wrong with it.
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
        ("seek", ..) => return Err("seek needs to_s, seconds on the log's clock".to_owned()),
        (other, ..) => {
            return Err(format!(
                "{other:?} is no command; expected pause, go, step, step_section, end, speed or seek"
            ));
        }
    })
}

/// The operator's command in a message as viewers send it; `None` of requests that concern a replay or the page alone.
///
/// Errors: what is wrong with it, as the page's refusal says.
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
    fn commands_are_taken_or_refused_with_what_is_wrong() {
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
