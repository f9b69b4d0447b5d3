//! Commands and their strict JSON parser, which doesn't allocate.

use core::fmt::Write as _;

use super::text::ShortText;
use crate::voice::MAX_VOICE_S;
use headrace_geometry::time::DurNs;
use serde::{Deserialize, Serialize};

/// Longest command packet, bytes.
pub const MAX_COMMAND_BYTES: usize = 512;
/// Longest duration that [`Command::Stalled`] states: a day, seconds.
pub const MAX_STALL_S: u32 = 86_400;
/// Longest text of a note, bytes.
pub const MAX_NOTE_BYTES: usize = 240;

/// Author of a command: initials, a name, or a device.
pub type Who = ShortText<16>;
/// Text of a note.
pub type NoteText = ShortText<MAX_NOTE_BYTES>;

/// A command to the loop from the operator, the program or other equipment.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[expect(clippy::large_enum_variant, reason = "copied into preallocated room; a box would allocate")]
pub enum Command {
    /// Acknowledges the alert with this number; 0 acknowledges all alerts that need acknowledgement.
    Acknowledge {
        /// Number of the alert.
        alert: u32,
        /// Author of the acknowledgement.
        by: Who,
    },
    /// Silences all sounding alerts for 30 s.
    Silence {
        /// Person or device that silences the alerts.
        by: Who,
    },
    /// Adds a note with the vehicle's present chainage.
    Note {
        /// Text of the note; empty for a mark.
        text: NoteText,
        /// Author of the note.
        by: Who,
    },
    /// Adds a voice note with the vehicle's present chainage, when its recording begins.
    Voice {
        /// Id that ties the note to its recording; never 0.
        id: u32,
        /// Author of the voice note.
        by: Who,
    },
    /// Sent by the program: the recording of a voice note is in the log.
    Voiced {
        /// Id of the voice note.
        id: u32,
        /// Length of the recording, seconds, 1 to 60.
        seconds: u32,
    },
    /// Sent by the program: a log recording fails, or works again.
    Recording {
        /// Whether a log recording fails at present.
        fails: bool,
    },
    /// Sent by the program: it got no computing time for a while, or did not run.
    Stalled {
        /// Duration in seconds, rounded up: 1 to [`MAX_STALL_S`]. A longer stall counts as the maximum.
        seconds: u32,
    },
    /// Sent by other equipment: remaining battery charge of the vehicle.
    Limits {
        /// Charge of the vehicle's battery, percent.
        battery_pct: f64,
    },
    /// Sent by the program: time passes although no sensor delivers data.
    Time,
}

/// Reason for which a packet is not a command.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("reading a command, at byte {at}: expected {expected}")]
pub struct CommandError {
    /// Index of the first byte that no command allows.
    pub at: usize,
    /// Description of the input allowed at that byte.
    pub expected: &'static str,
}

/// JSON keys of a command.
const KEYS: [&str; 8] = ["do", "alert", "by", "text", "fails", "battery_pct", "id", "seconds"];

/// Values of the command's keys read so far.
#[derive(Default)]
struct Values {
    what: Option<Who>,
    alert: Option<u32>,
    by: Option<Who>,
    text: Option<NoteText>,
    fails: Option<bool>,
    battery_pct: Option<f64>,
    /// Id of a voice note.
    id: Option<u32>,
    /// Length of a voice note.
    seconds: Option<u32>,
}

impl Command {
    /// Whether an operator may send this command. All other commands are sent by the program or other
    /// equipment only.
    pub fn is_operators(&self) -> bool {
        matches!(
            self,
            Self::Acknowledge { .. } | Self::Silence { .. } | Self::Note { .. } | Self::Voice { .. }
        )
    }

    /// The statement that the program did not run for some time.
    pub fn stalled_for(time: DurNs) -> Self {
        let seconds = u32::try_from(time.0 / 1_000_000_000 + 1).unwrap_or(MAX_STALL_S).min(MAX_STALL_S);
        Self::Stalled { seconds }
    }

    /// The command without its author and text.
    #[must_use]
    pub fn anonymous(self) -> Self {
        let by = Who::default();
        match self {
            Self::Acknowledge { alert, .. } => Self::Acknowledge { alert, by },
            Self::Silence { .. } => Self::Silence { by },
            Self::Note { .. } => Self::Note { text: NoteText::default(), by },
            Self::Voice { id, .. } => Self::Voice { id, by },
            Self::Voiced { .. }
            | Self::Recording { .. }
            | Self::Stalled { .. }
            | Self::Limits { .. }
            | Self::Time => self,
        }
    }

    /// Parses a packet: one JSON object with exactly the keys that its command requires. Allocates: never.
    ///
    /// Errors: the first deviation from that form.
    pub fn parse(bytes: &[u8]) -> Result<Self, CommandError> {
        if bytes.len() > MAX_COMMAND_BYTES {
            return Err(CommandError { at: MAX_COMMAND_BYTES, expected: "at most 512 bytes" });
        }
        let text = core::str::from_utf8(bytes)
            .map_err(|error| CommandError { at: error.valid_up_to(), expected: "UTF-8" })?;
        let mut scan = Scan { text, at: 0 };
        let values = scan.object()?;
        values.command().map_err(|expected| CommandError { at: 0, expected })
    }

    /// Returns the command as a JSON packet.
    pub fn to_json(&self) -> String {
        let mut json = String::with_capacity(64);
        let by = |json: &mut String, by: &Who| quote(json, ",\"by\":", by.as_str());
        match self {
            Self::Acknowledge { alert, by: who } => {
                write!(json, "{{\"do\":\"acknowledge\",\"alert\":{alert}").unwrap_or_default();
                by(&mut json, who);
            }
            Self::Silence { by: who } => {
                json.push_str("{\"do\":\"silence\"");
                by(&mut json, who);
            }
            Self::Note { text, by: who } if text.as_str().is_empty() => {
                json.push_str("{\"do\":\"mark\"");
                by(&mut json, who);
            }
            Self::Note { text, by: who } => {
                json.push_str("{\"do\":\"note\"");
                quote(&mut json, ",\"text\":", text.as_str());
                by(&mut json, who);
            }
            Self::Voice { id, by: who } => {
                write!(json, "{{\"do\":\"voice\",\"id\":{id}").unwrap_or_default();
                by(&mut json, who);
            }
            Self::Voiced { id, seconds } => {
                write!(json, "{{\"do\":\"voiced\",\"id\":{id},\"seconds\":{seconds}").unwrap_or_default();
            }
            Self::Recording { fails } => {
                write!(json, "{{\"do\":\"recording\",\"fails\":{fails}").unwrap_or_default();
            }
            Self::Stalled { seconds } => {
                write!(json, "{{\"do\":\"stalled\",\"seconds\":{seconds}").unwrap_or_default();
            }
            Self::Limits { battery_pct } => {
                write!(json, "{{\"do\":\"limits\",\"battery_pct\":{battery_pct:?}").unwrap_or_default();
            }
            Self::Time => json.push_str("{\"do\":\"time\""),
        }
        json.push('}');
        json
    }
}

/// Appends a JSON key and its text value, which has no control characters.
fn quote(json: &mut String, key: &str, text: &str) {
    json.push_str(key);
    json.push('"');
    for char in text.chars() {
        if matches!(char, '"' | '\\') {
            json.push('\\');
        }
        json.push(char);
    }
    json.push('"');
}

impl Values {
    /// Builds the command from the values read. All keys of the command must be present, and no other keys.
    fn command(self) -> Result<Command, &'static str> {
        let Self { what, alert, by, text, fails, battery_pct, id, seconds } = self;
        let what = what.ok_or("the key \"do\"")?;
        if what.as_str().starts_with("voice") {
            let others = (alert, text.is_some(), fails, battery_pct) != (None, false, None, None);
            return match (what.as_str(), id, by, seconds) {
                ("voice", Some(id), Some(by), None) if !others => Ok(Command::Voice { id, by }),
                ("voiced", Some(id), None, Some(seconds)) if !others && seconds <= MAX_VOICE_S => {
                    Ok(Command::Voiced { id, seconds })
                }
                ("voice", ..) => Err("voice with \"id\" and \"by\""),
                _ => Err("voiced with \"id\" and \"seconds\" from 1 to 60"),
            };
        }
        if what.as_str() == "stalled" {
            let others = (alert, id, by, text, fails, battery_pct);
            return match seconds {
                Some(seconds) if others == (None, None, None, None, None, None) => {
                    Ok(Command::Stalled { seconds })
                }
                _ => Err("stalled with \"seconds\""),
            };
        }
        if id.is_some() || seconds.is_some() {
            return Err("\"id\" and \"seconds\" only with voice, voiced or stalled");
        }
        Ok(match (what.as_str(), alert, by, text, fails, battery_pct) {
            ("acknowledge", Some(alert), Some(by), None, None, None) => Command::Acknowledge { alert, by },
            ("acknowledge", ..) => return Err("acknowledge with \"alert\" and \"by\""),
            ("silence", None, Some(by), None, None, None) => Command::Silence { by },
            ("silence", ..) => return Err("silence with \"by\""),
            ("note", None, Some(by), Some(text), None, None) if !text.as_str().is_empty() => {
                Command::Note { text, by }
            }
            ("note", ..) => return Err("note with \"text\" and \"by\""),
            ("mark", None, Some(by), None, None, None) => Command::Note { text: NoteText::default(), by },
            ("mark", ..) => return Err("mark with \"by\""),
            ("recording", None, None, None, Some(fails), None) => Command::Recording { fails },
            ("recording", ..) => return Err("recording with \"fails\""),
            ("limits", None, None, None, None, Some(battery_pct)) => Command::Limits { battery_pct },
            ("limits", ..) => return Err("limits with \"battery_pct\""),
            ("time", None, None, None, None, None) => Command::Time,
            ("time", ..) => return Err("time without other keys"),
            _ => {
                return Err(
                    "acknowledge, silence, note, mark, voice, voiced, recording, stalled, limits or time",
                );
            }
        })
    }
}

/// Position of the parser in a JSON text.
struct Scan<'a> {
    text: &'a str,
    at: usize,
}

impl Scan<'_> {
    fn rest(&self) -> &str {
        self.text.get(self.at..).unwrap_or_default()
    }

    fn wrong<T>(&self, expected: &'static str) -> Result<T, CommandError> {
        Err(CommandError { at: self.at, expected })
    }

    fn skip_space(&mut self) {
        let is_space = |byte: &u8| matches!(byte, b' ' | b'\t' | b'\n' | b'\r');
        self.at += self.rest().bytes().take_while(is_space).count();
    }

    /// Skips blanks. If `word` comes next, consumes it and returns true.
    fn has(&mut self, word: &str) -> bool {
        self.skip_space();
        let has = self.rest().starts_with(word);
        self.at += if has { word.len() } else { 0 };
        has
    }

    fn object(&mut self) -> Result<Values, CommandError> {
        let mut values = Values::default();
        if !self.has("{") {
            return self.wrong("{");
        }
        loop {
            self.pair(&mut values)?;
            if self.has(",") {
                continue;
            }
            if !self.has("}") {
                return self.wrong(", or }");
            }
            self.skip_space();
            return if self.rest().is_empty() { Ok(values) } else { self.wrong("nothing after the object") };
        }
    }

    fn pair(&mut self, values: &mut Values) -> Result<(), CommandError> {
        self.skip_space();
        let from = self.at;
        let key: Who = self.string("a key of a command")?;
        if !self.has(":") {
            return self.wrong(":");
        }
        self.skip_space();
        let number = KEYS.iter().position(|known| *known == key.as_str());
        let is_new = match number {
            Some(0) => values.what.replace(self.string("a command of at most 16 bytes")?).is_none(),
            Some(1) => values.alert.replace(self.alert()?).is_none(),
            Some(2) => values.by.replace(self.string("a text of at most 16 bytes")?).is_none(),
            Some(3) => values.text.replace(self.string("a text of at most 240 bytes")?).is_none(),
            Some(4) => values.fails.replace(self.bool()?).is_none(),
            Some(5) => values.battery_pct.replace(self.percent()?).is_none(),
            Some(6) => values.id.replace(self.whole(u32::MAX, "an id from 1 to 4294967295")?).is_none(),
            Some(_) => values.seconds.replace(self.whole(MAX_STALL_S, "1 to 86400 seconds")?).is_none(),
            None => {
                let expected = "do, alert, by, text, fails, battery_pct, id or seconds";
                return Err(CommandError { at: from, expected });
            }
        };
        if is_new { Ok(()) } else { Err(CommandError { at: from, expected: "each key once" }) }
    }

    fn bool(&mut self) -> Result<bool, CommandError> {
        if self.has("true") {
            return Ok(true);
        }
        if self.has("false") { Ok(false) } else { self.wrong("true or false") }
    }

    /// Scans a JSON number without an exponent.
    fn number(&mut self) -> &str {
        let bytes = self.rest().as_bytes();
        let digits = |from: usize| bytes.iter().skip(from).take_while(|byte| byte.is_ascii_digit()).count();
        let whole = digits(0);
        let point = usize::from(bytes.get(whole) == Some(&b'.') && digits(whole + 1) > 0);
        let len = whole + point * (1 + digits(whole + 1));
        let from = self.at;
        let has_leading_zero = whole > 1 && bytes.first() == Some(&b'0');
        self.at += if has_leading_zero { 0 } else { len };
        self.text.get(from..self.at).unwrap_or_default()
    }

    fn alert(&mut self) -> Result<u32, CommandError> {
        let at = self.at;
        self.number()
            .parse()
            .map_err(|_| CommandError { at, expected: "the number of an alert, or 0 for all" })
    }

    /// A whole number from 1 to `most` in a JSON text.
    fn whole(&mut self, most: u32, expected: &'static str) -> Result<u32, CommandError> {
        let at = self.at;
        let number: Option<u32> = self.number().parse().ok();
        number.filter(|number| (1..=most).contains(number)).ok_or(CommandError { at, expected })
    }

    fn percent(&mut self) -> Result<f64, CommandError> {
        let at = self.at;
        let number: Option<f64> = self.number().parse().ok();
        number.filter(|pct| (0.0..=100.0).contains(pct)).ok_or(CommandError { at, expected: "0 to 100" })
    }

    fn string<const BYTES: usize>(
        &mut self,
        expected: &'static str,
    ) -> Result<ShortText<BYTES>, CommandError> {
        let from = self.at;
        let wrong = CommandError { at: from, expected };
        if !self.has("\"") {
            return Err(wrong);
        }
        let mut text = ShortText::default();
        loop {
            let char = match self.next().ok_or(wrong)? {
                '"' => return Ok(text),
                '\\' => self.escaped().ok_or(CommandError { at: self.at, expected: "an escape of JSON" })?,
                char => char,
            };
            if !text.push(char) {
                return Err(wrong);
            }
        }
    }

    fn next(&mut self) -> Option<char> {
        let char = self.rest().chars().next()?;
        self.at += char.len_utf8();
        Some(char)
    }

    /// Character represented by an escape sequence, after its backslash.
    fn escaped(&mut self) -> Option<char> {
        match self.next()? {
            char @ ('"' | '\\' | '/') => Some(char),
            // A later check of the whole text refuses control characters.
            'b' | 'f' | 'n' | 'r' | 't' => Some('\n'),
            'u' => {
                let first = self.unit()?;
                if !(0xd800..0xdc00).contains(&first) {
                    return char::from_u32(first);
                }
                let second = if self.rest().starts_with("\\u") {
                    self.at += 2;
                    self.unit().filter(|unit| (0xdc00..0xe000).contains(unit))?
                } else {
                    return None;
                };
                char::from_u32(0x1_0000 + ((first - 0xd800) << 10) + (second - 0xdc00))
            }
            _ => None,
        }
    }

    fn unit(&mut self) -> Option<u32> {
        let digits =
            self.rest().get(..4).filter(|digits| digits.bytes().all(|digit| digit.is_ascii_hexdigit()))?;
        let unit = u32::from_str_radix(digits, 16).ok()?;
        self.at += 4;
        Some(unit)
    }
}
