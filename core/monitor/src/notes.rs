//! Notes of a dive: what somebody has put down, with its time and place.

use bevy_ecs::prelude::Resource;
use serde::{Deserialize, Serialize};

use super::console::{NoteText, Who};
use headrace_geometry::snapshot::stateful;
use headrace_geometry::time::MonoNs;

/// Notes that are kept, and taken in a dive; later ones of an older log are in that alone.
pub const MOST_NOTES: usize = 1000;

/// What was spoken, of a voice note.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Spoken {
    /// Ties the note to its recording in the log.
    pub id: u32,
    /// How long its recording is, seconds; 0 while none is in the log.
    pub seconds: u32,
}

/// A note, or a mark without a text.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Note {
    /// Its number, from 1.
    pub number: u32,
    /// When.
    pub at: MonoNs,
    /// By whom.
    pub by: Who,
    /// Its text; empty for a mark.
    pub text: NoteText,
    /// Of a voice note; it has no text.
    pub voice: Option<Spoken>,
    /// Where the vehicle was at the last beat, m; `None` without a position.
    pub chainage_m: Option<f64>,
}

/// All notes.
#[derive(Debug, Resource)]
pub struct Notes {
    notes: Vec<Note>,
    taken: u32,
}

stateful!(Notes { state: taken; lists: notes; });

impl Default for Notes {
    /// Allocates: all that it will ever use.
    fn default() -> Self {
        Self { notes: Vec::with_capacity(MOST_NOTES), taken: 0 }
    }
}

impl Notes {
    /// Takes a note; returns it with its number.
    pub(crate) fn take(&mut self, at: MonoNs, by: Who, text: NoteText, chainage_m: Option<f64>) -> Note {
        self.keep(&Note { number: 0, at, by, text, voice: None, chainage_m })
    }

    /// Takes a voice note, whose recording begins; returns it with its number.
    pub(crate) fn speak(&mut self, at: MonoNs, by: Who, id: u32, chainage_m: Option<f64>) -> Note {
        let voice = Some(Spoken { id, seconds: 0 });
        self.keep(&Note { number: 0, at, by, text: NoteText::default(), voice, chainage_m })
    }

    /// The recording of a voice note is in the log; returns the note. `None` if none of those kept waits for it.
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

    /// Those that are kept, by number.
    pub fn iter(&self) -> impl Iterator<Item = &Note> {
        self.notes.iter()
    }

    /// The note of a number.
    pub fn get(&self, number: u32) -> Option<&Note> {
        self.notes.get(usize::try_from(number).ok()?.checked_sub(1)?)
    }

    /// Notes that aren't kept.
    pub fn dropped(&self) -> u32 {
        self.taken - u32::try_from(self.notes.len()).unwrap_or(u32::MAX)
    }
}
