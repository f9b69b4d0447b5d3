//! Reads notes and voice notes from a log without a replay.

use std::collections::BTreeMap;
use std::path::PathBuf;

use headrace_geometry::time::DiveClock;
use headrace_monitor::alert_list::{NoteJson, SpokenJson};
use headrace_monitor::console::{CONSOLE_ID, Command};
use headrace_monitor::pilot_text::station;
use headrace_monitor::result_stream::{RecordKind, first_record};
use headrace_monitor::voice::{Container, Voice};

use crate::clocks::clock_of;
use crate::log::format::{read_results, stream_of};
use crate::log::voice::decode;
use crate::log::{DiveLog, LogError, LogMessage, MessageKind};
use crate::player::seconds;

/// The notes in a log, including voice notes.
#[derive(Debug, Default)]
pub struct LoggedNotes {
    /// The notes, numbered as in a replay. Chainages come from the log's results; without results, the notes have no
    /// chainage.
    pub notes: Vec<NoteJson>,
    /// Recordings of voice notes, by the note's id. Each has seconds, container, and length in bytes.
    pub voices: BTreeMap<u32, (u32, Container, usize)>,
    /// Decoding error of each invalid voice message.
    pub wrong: Vec<String>,
    /// Losses of the log that was read, as text.
    pub losses: Vec<String>,
    /// Clock of the dive.
    pub clock: DiveClock,
    /// Metadata of the log from which the notes were read.
    pub metadata: BTreeMap<String, String>,
}

/// Reads the notes in a log.
///
/// Errors: the log can't be read.
pub fn notes_of(files: &[PathBuf]) -> Result<LoggedNotes, LogError> {
    let mut log = DiveLog::open(files)?;
    let clock = clock_of(files)?;
    let (mut found, mut places) = (LoggedNotes { clock, ..LoggedNotes::default() }, BTreeMap::new());
    let console = |log: &DiveLog| {
        let number = log.header().sources.iter().position(|source| source.id == CONSOLE_ID);
        number.and_then(|number| u16::try_from(number).ok())
    };
    let mut of_console = console(&log);
    while let Some(message) = log.next()? {
        match message.kind {
            MessageKind::Raw { source } if Some(source) == of_console => found.hear(&message),
            MessageKind::Voice => found.take_voice(&message),
            MessageKind::Result { topic } if stream_of(topic).is_some() => place(message.data, &mut places),
            _ => {}
        }
        of_console = of_console.or_else(|| console(&log));
    }
    for note in &mut found.notes {
        note.chainage_m = places.get(&note.number).copied();
        note.station = note.chainage_m.map(station);
    }
    found.losses = log.losses().iter().map(|loss| loss.in_dive_time(clock).to_string()).collect();
    found.metadata.clone_from(&log.header().metadata);
    Ok(found)
}

/// Passes each voice recording in a log to `take`, in order.
///
/// Errors: the log can't be read; errors of `take`.
pub fn each_voice<E: From<LogError>>(
    files: &[PathBuf],
    mut take: impl FnMut(Voice) -> Result<(), E>,
) -> Result<(), E> {
    let mut log = DiveLog::open(files)?;
    while let Some(message) = log.next()? {
        if message.kind == MessageKind::Voice
            && let Ok(voice) = decode(message.data)
        {
            take(voice)?;
        }
    }
    Ok(())
}

impl LoggedNotes {
    /// Processes a message of the operator's input.
    fn hear(&mut self, message: &LogMessage<'_>) {
        let (by, text, voice) = match Command::parse(message.data) {
            Ok(Command::Note { text, by }) => (by, text.as_str().to_owned(), None),
            Ok(Command::Voice { id, by }) => (by, String::new(), Some(SpokenJson { id, seconds: None })),
            Ok(Command::Voiced { id, seconds }) => {
                let waits = Some(SpokenJson { id, seconds: None });
                if let Some(note) = self.notes.iter_mut().rev().find(|note| note.voice == waits) {
                    note.voice = Some(SpokenJson { id, seconds: Some(seconds) });
                }
                return;
            }
            _ => return,
        };
        self.notes.push(NoteJson {
            number: u32::try_from(self.notes.len() + 1).unwrap_or(u32::MAX),
            at_s: self.clock.seconds(message.log_time),
            by: by.as_str().to_owned(),
            text,
            voice,
            chainage_m: None,
            station: None,
        });
    }

    fn take_voice(&mut self, message: &LogMessage<'_>) {
        match decode(message.data) {
            Ok(Voice { id, seconds, container, audio }) => {
                self.voices.insert(id, (seconds, container, audio.len()));
            }
            Err(error) => {
                let at = seconds(message.log_time, self.clock);
                self.wrong.push(format!("the voice message at {at}: {error}"));
            }
        }
    }
}

/// Reads the chainages of notes from a message of results.
fn place(message: &[u8], places: &mut BTreeMap<u32, f64>) {
    let Some((_, _, words)) = read_results(message) else { return };
    let mut rest = words.as_slice();
    while let Some((record, after)) = first_record(rest) {
        rest = after;
        if let (Some(RecordKind::Note | RecordKind::Voice), [_, number, chainage, ..]) =
            (record.kind, record.words)
        {
            // In the results, chainage 0 means that the chainage was unknown.
            let chainage_m = Some(f64::from_bits(*chainage)).filter(|chainage_m| *chainage_m != 0.0);
            if let (Ok(number), Some(chainage_m)) = (u32::try_from(*number), chainage_m) {
                places.insert(number, chainage_m);
            }
        }
    }
}
