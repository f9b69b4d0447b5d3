//! Elements of the recomputed tables: cells with numbers, and notes.

use serde::Serialize;

use super::printed::{Digits, Printed, difference_percent};

/// A printed number and the recomputed one, both in the unit of the field's name.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Cell {
    /// The number as printed.
    pub printed: Printed,
    /// Recomputed number.
    pub ours: f64,
    /// Difference of the recomputed from the printed number, percent of the printed one; `None` for a printed zero.
    pub difference_percent: Option<f64>,
    /// Whether the printed digits follow from the recomputed value by rounding or by truncating.
    pub digits: Digits,
    /// Mark of the note that explains the cell.
    pub note: Option<char>,
}

/// A note on a table.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Note {
    /// Letter that marks the cells to which the note applies.
    pub mark: char,
    /// Kind of the note.
    pub kind: NoteKind,
    /// Text of the note.
    pub text: String,
}

/// Kind of a note.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum NoteKind {
    /// The paper is inconsistent with itself or with its own equations.
    Erratum,
    /// An erratum found only when the tables were recomputed.
    NewErratum,
    /// Origin of the printed numbers, or the reason for a difference.
    Finding,
}

/// A table of the paper.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Table<Row> {
    /// Number of the table in the paper.
    pub number: u8,
    /// Title of the table.
    pub title: &'static str,
    /// Rows of the table, in the paper's order.
    pub rows: Vec<Row>,
    /// Notes on the table.
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

    /// Adds the mark of a note, unless rounding or truncating the recomputed value gives the printed digits.
    pub(super) fn noted_unless_equal(self, mark: char) -> Self {
        if self.digits == Digits::Neither { self.noted(mark) } else { self }
    }

    /// Adds the mark of a note, unless rounding the recomputed value gives the printed digits.
    ///
    /// Truncation doesn't count here, because for related numbers that differ it gives the printed digits only by
    /// chance.
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
