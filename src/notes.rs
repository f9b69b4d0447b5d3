//! `headrace notes`: lists the notes of a dive, and writes the files of its voice notes.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use headrace_config::plain::one_line;
use headrace_monitor::alert_list::NoteJson;
use headrace_monitor::voice::Container;
use headrace_replay::log::files_of;
use headrace_replay::notes::{LoggedNotes, each_voice, notes_of};
use serde_json::json;

use crate::cli::Notes;
use crate::failure::{self, Failure};
use crate::files;
use crate::output::{deliver, say};
use crate::outputs::{self, Claims, Kind};
use crate::page::utc_of_zero_s;
use crate::report_output::utc_text;

/// Runs `headrace notes`.
pub(crate) fn notes(args: &Notes) -> Result<u8, Failure> {
    let logs = files_of(&args.logs)?;
    let found = notes_of(&logs)?;
    let named = args.out.as_deref().map(|folder| named(&found, folder)).unwrap_or_default();
    if let Some(folder) = &args.out {
        outputs::folder(folder)?;
        let mut claims = Claims::reading(logs.clone(), &args.overwrite);
        for path in named.values() {
            claims.claim("--out", path, Kind::Voice)?;
        }
        each_voice(&logs, |voice| match named.get(&voice.id) {
            Some(path) => files::write(path, &voice.audio),
            None => Ok(()),
        })?;
    }
    let missing = missing(&found);
    tell(args, &found, &named, &missing)?;
    let is_whole = found.losses.is_empty() && missing.is_empty() && found.wrong.is_empty();
    Ok(if is_whole { failure::OK } else { failure::DATA_LOST })
}

/// File names for the recordings of voice notes, by the recording's id.
///
/// A file is named after its note's number. If no note has the recording, the file is named after the recording's id.
fn named(found: &LoggedNotes, folder: &Path) -> BTreeMap<u32, PathBuf> {
    let name = |(id, (_, container, _)): (&u32, &(u32, Container, usize))| {
        let is_it = |note: &&NoteJson| note.voice.as_ref().is_some_and(|voice| voice.id == *id);
        let stem = match found.notes.iter().find(is_it) {
            Some(note) => format!("note-{}", note.number),
            None => format!("voice-{id}"),
        };
        (*id, folder.join(format!("{stem}.{}", container.extension())))
    };
    found.voices.iter().map(name).collect()
}

/// Texts about voice notes whose recordings are missing in the log.
fn missing(found: &LoggedNotes) -> Vec<String> {
    let missing_note = |note: &NoteJson| {
        let voice = note.voice.as_ref().filter(|voice| voice.seconds.is_some())?;
        let words = format!("note {}: its recording isn't in the log", note.number);
        (!found.voices.contains_key(&voice.id)).then_some(words)
    };
    found.notes.iter().filter_map(missing_note).collect()
}

fn tell(
    args: &Notes,
    found: &LoggedNotes,
    named: &BTreeMap<u32, PathBuf>,
    missing: &[String],
) -> Result<(), Failure> {
    let lost: Vec<&String> = found.losses.iter().chain(&found.wrong).chain(missing).collect();
    if args.json {
        let file = |id: u32| named.get(&id).map(|path| path.display().to_string());
        let notes = found.notes.iter().map(|note| {
            let id = note.voice.as_ref().map(|voice| voice.id);
            let recording = id.and_then(|id| found.voices.get(&id));
            let recording = recording.map(|(seconds, container, bytes)| {
                json!({"seconds": seconds, "media_type": container.media_type(), "bytes": bytes,
                    "file": id.and_then(file)})
            });
            let mut value = json!(note);
            value["recording"] = json!(recording);
            value
        });
        return deliver(&json!({"notes": notes.collect::<Vec<_>>(), "lost": lost}).to_string());
    }
    let begun_utc_s = utc_of_zero_s(&found.metadata).zip(found.clock.zero());
    let begun_utc_s = begun_utc_s.map(|(zero_s, begun)| zero_s + begun.as_secs_f64());
    for note in &found.notes {
        let place = note.station.clone().unwrap_or_else(|| "-+---.--".to_owned());
        let by = if note.by.is_empty() { String::new() } else { format!(" ({})", note.by) };
        let id = note.voice.as_ref().map(|voice| voice.id);
        let file = id.and_then(|id| named.get(&id)).map(|path| format!(": {}", path.display()));
        let utc = begun_utc_s.map(|begun_s| format!(" ({})", utc_text(begun_s + note.at_s)));
        let text = format!(
            "{:>4}  {place}  {:.1} s{}  {}{by}{}",
            note.number,
            note.at_s,
            utc.unwrap_or_default(),
            note.words(),
            file.unwrap_or_default()
        );
        say(&one_line(&text));
    }
    for words in &lost {
        say(&one_line(&format!("lost  {words}")));
    }
    let (notes, voices) = (found.notes.len(), found.voices.len());
    say(&format!("{notes} notes, {voices} with a recording"));
    Ok(())
}
