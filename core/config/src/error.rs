//! Errors of hand-written files, and a collection of such errors.

use core::cell::RefCell;
use core::fmt;
use std::rc::Rc;

use super::plain::one_line;

/// An error in a hand-written file.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{}", one_line(&self.text()))]
pub struct ConfigError {
    /// The name of the file, as given by the caller.
    pub file: String,
    /// Line of the error, counted from one.
    pub line: usize,
    /// Dotted path of the key that the error concerns.
    pub key: String,
    /// The wrong value of the key, if present.
    pub value: Option<String>,
    /// The problem with the value, and the allowed values.
    pub problem: String,
}

impl ConfigError {
    /// Formats the error as one text, without escaping special characters.
    fn text(&self) -> String {
        let Self { file, line, key, value, problem } = self;
        let value = value.as_ref().map(|value| format!(" = {value}")).unwrap_or_default();
        format!("{file}:{line}: {key}{value}: {problem}")
    }
}

/// All errors of a file, at least one, in the order of its lines.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ConfigErrors(Vec<ConfigError>);

impl ConfigErrors {
    /// Sorts the errors by line and removes duplicates. `None` if there are no errors.
    pub(super) fn of(mut errors: Vec<ConfigError>) -> Option<Self> {
        // The sort is stable, so errors of one line stay in the order of discovery. Errors of several files are not
        // sorted.
        let file = errors.first()?.file.clone();
        if errors.iter().all(|error| error.file == file) {
            errors.sort_by_key(|error| error.line);
        }
        let mut each: Vec<ConfigError> = Vec::new();
        for error in errors {
            if !each.contains(&error) {
                each.push(error);
            }
        }
        if each.len() > MOST_ERRORS {
            each.truncate(MOST_ERRORS);
            let file = each.first()?.file.clone();
            let problem = format!("has more errors; these are the first {MOST_ERRORS}");
            let line = each.last()?.line;
            each.push(ConfigError { file, line, key: "TOML".to_owned(), value: None, problem });
        }
        Some(Self(each))
    }

    /// Appends the errors of another file to which this file refers.
    #[must_use]
    pub fn and(mut self, others: Self) -> Self {
        self.0.extend(others.0);
        self
    }

    /// All errors of the file.
    pub fn errors(&self) -> &[ConfigError] {
        &self.0
    }
}

impl From<ConfigError> for ConfigErrors {
    fn from(error: ConfigError) -> Self {
        Self(vec![error])
    }
}

/// Formats the errors, one per line.
impl fmt::Display for ConfigErrors {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (number, error) in self.0.iter().enumerate() {
            let between = if number == 0 { "" } else { "\n" };
            write!(f, "{between}{error}")?;
        }
        Ok(())
    }
}

impl std::error::Error for ConfigErrors {}

/// Maximum number of reported errors of a file. A file that is not TOML may have an error in each line.
pub(super) const MOST_ERRORS: usize = 100;

/// Errors found so far in one document. `None` if reading stops at the first error.
#[derive(Debug, Clone, Default)]
pub(super) struct Notes(Option<Rc<RefCell<Vec<ConfigError>>>>);

impl Notes {
    /// Creates an empty collection of errors.
    pub(super) fn collecting() -> Self {
        Self(Some(Rc::default()))
    }

    /// Whether errors are collected, so that reading continues after an error.
    pub(super) fn are_kept(&self) -> bool {
        self.0.is_some()
    }

    pub(super) fn add(&self, error: &ConfigError) {
        let is_new =
            |notes: &RefCell<Vec<_>>| notes.borrow().len() <= MOST_ERRORS && !notes.borrow().contains(error);
        if let Some(notes) = self.0.as_ref().filter(|notes| is_new(notes)) {
            notes.borrow_mut().push(error.clone());
        }
    }

    /// Returns the first collected error that satisfies `is_so`.
    pub(super) fn find(&self, is_so: impl Fn(&ConfigError) -> bool) -> Option<ConfigError> {
        self.0.as_ref()?.borrow().iter().find(|error| is_so(error)).cloned()
    }

    /// Whether more errors were found than will be reported.
    pub(super) fn are_enough(&self) -> bool {
        self.count() > MOST_ERRORS
    }

    pub(super) fn count(&self) -> usize {
        self.0.as_ref().map_or(0, |notes| notes.borrow().len())
    }

    pub(super) fn take(&self) -> Vec<ConfigError> {
        self.0.as_ref().map(|notes| notes.take()).unwrap_or_default()
    }
}
