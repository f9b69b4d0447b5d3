//! Notes of a dive: texts or voice recordings by the crew, with time and place.

use bevy_ecs::prelude::Resource;
use serde::{Deserialize, Serialize};

use super::console::command::{NoteText, Who};
use headrace_geometry::snapshot::stateful;
use headrace_geometry::time::MonoNs;

/// Maximum number of notes in a dive. If an older log has more, the rest stay in the log only.
pub const MOST_NOTES: usize = 1000;

/// Recording that belongs to a voice note.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Spoken {
    /// Id that ties the note to its recording in the log.
    pub id: u32,
    /// Length of the recording, seconds; 0 until the recording is in the log.
    pub seconds: u32,
}

/// A note, or a mark without a text.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Note {
    /// Number of the note, from 1.
    pub number: u32,
    /// Time of the note.
    pub at: MonoNs,
    /// Author of the note.
    pub by: Who,
    /// Text of the note; empty for a mark.
    pub text: NoteText,
    /// Recording of a voice note, which has no text.
    pub voice: Option<Spoken>,
    /// Chainage of the vehicle at the last advice update, m; `None` without a position.
    pub chainage_m: Option<f64>,
}

/// All notes of a dive.
#[derive(Debug, Resource)]
pub struct Notes {
    notes: Vec<Note>,
    taken: u32,
}

stateful!(Notes { state: taken; lists: notes; });

impl Default for Notes {
    /// Creates an empty list of notes. Allocates: at startup, all memory of the list.
    fn default() -> Self {
        Self { notes: Vec::with_capacity(MOST_NOTES), taken: 0 }
    }
}

impl Notes {
    /// Adds a note. Returns the note with its number.
    pub(crate) fn take(&mut self, at: MonoNs, by: Who, text: NoteText, chainage_m: Option<f64>) -> Note {
        self.keep(&Note { number: 0, at, by, text, voice: None, chainage_m })
    }

    /// Adds a voice note when its recording begins. Returns the note with its number.
    pub(crate) fn speak(&mut self, at: MonoNs, by: Who, id: u32, chainage_m: Option<f64>) -> Note {
        let voice = Some(Spoken { id, seconds: 0 });
        self.keep(&Note { number: 0, at, by, text: NoteText::default(), voice, chainage_m })
    }

    /// Records that a voice note's recording is in the log. Returns the note; `None` if no kept note waits
    /// for the recording.
    pub(crate) fn spoken(&mut self, id: u32, seconds: u32) -> Option<Note> {
        let waits = Some(Spoken { id, seconds: 0 });
        let note = self.notes.iter_mut().rev().find(|note| note.voice == waits)?;
        note.voice = Some(Spoken { id, seconds });
        Some(*note)
    }

    fn keep(&mut self, note: &Note) -> Note {
        self.taken += 1;
        let note = Note { number: self.taken, ..*note };
        if self.notes.len() < MOST_NOTES {
            self.notes.push(note);
        }
        note
    }

    /// Notes kept, in order of their numbers.
    pub fn iter(&self) -> impl Iterator<Item = &Note> {
        self.notes.iter()
    }

    /// Note with this number.
    pub fn get(&self, number: u32) -> Option<&Note> {
        self.notes.get(usize::try_from(number).ok()?.checked_sub(1)?)
    }

    /// Number of notes that were not kept.
    pub fn dropped(&self) -> u32 {
        self.taken - u32::try_from(self.notes.len()).unwrap_or(u32::MAX)
    }
}
