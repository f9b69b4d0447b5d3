//! What the tables are made of.

use serde::Serialize;

use super::printed::{Digits, Printed, difference_percent};

/// A printed number and ours, both in the unit that the field's name says.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Cell {
    /// As the paper has it.
    pub printed: Printed,
    /// What we get.
    pub ours: f64,
    /// By how much ours exceeds the printed number, percent of it; `None` for a printed zero.
    pub difference_percent: Option<f64>,
    /// How the printed digits come from ours.
    pub digits: Digits,
    /// The note that it refers to.
    pub note: Option<char>,
}

/// Something to know about a table.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Note {
    /// By what cells refer to it.
    pub mark: char,
    /// Whose it is.
    pub kind: NoteKind,
    /// In words.
    pub text: String,
}

/// Whether a note is about a fault of the paper.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum NoteKind {
    /// The paper contradicts itself or its own equations.
    Erratum,
    /// The same, seen only when the tables were recomputed.
    NewErratum,
    /// How the printed numbers came about, or why ours are others.
    Finding,
}

/// A table of the paper.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Table<Row> {
    /// Its number in the paper.
    pub number: u8,
    /// What it shows.
    pub title: &'static str,
    /// Its rows, in the paper's order.
    pub rows: Vec<Row>,
    /// What is to be said of it.
    pub notes: Vec<Note>,
}

impl Cell {
    pub(super) fn new(printed: Printed, ours: f64) -> Self {
        let difference_percent = difference_percent(ours, printed);
        Self { printed, ours, difference_percent, digits: printed.digits_of(ours), note: None }
    }

    pub(super) fn noted(self, mark: char) -> Self {
        Self { note: Some(mark), ..self }
    }

    /// Refers to a note where the printed digits come of ours in neither way.
    pub(super) fn noted_unless_equal(self, mark: char) -> Self {
        if self.digits == Digits::Neither { self.noted(mark) } else { self }
    }

    /// Refers to a note where the printed digits aren't ours rounded: where other numbers of its kind differ, truncation
    /// would explain this one by chance.
    pub(super) fn noted_unless_rounded(self, mark: char) -> Self {
        if self.digits.rounded() { self } else { self.noted(mark) }
    }
}

impl Note {
    pub(super) fn new(mark: char, kind: NoteKind, text: impl Into<String>) -> Self {
        Self { mark, kind, text: text.into() }
    }
}

impl NoteKind {
    /// The word before a note's text.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Erratum => "erratum",
            Self::NewErratum => "new erratum",
            Self::Finding => "finding",
        }
    }
}
