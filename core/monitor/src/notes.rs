//! Notes of a dive: what somebody has put down, with its time and place.

use bevy_ecs::prelude::Resource;
use serde::{Deserialize, Serialize};

use super::console::{NoteText, Who};
use headrace_geometry::time::MonoNs;
use headrace_snapshot::stateful;

/// Notes that are kept; later ones are in the log alone.
pub const MOST_NOTES: usize = 1000;

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
        self.taken += 1;
        let note = Note { number: self.taken, at, by, text, chainage_m };
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
