//! Errors of hand-written files, and their collection.

use core::cell::RefCell;
use core::fmt;
use std::rc::Rc;

/// An error in a hand-written file.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{file}:{line}: {key}{}: {problem}", .value.as_ref().map(|v| format!(" = {v}")).unwrap_or_default())]
pub struct ConfigError {
    /// The file, as the caller named it.
    pub file: String,
    /// Line, counted from one.
    pub line: usize,
    /// Dotted path of the key.
    pub key: String,
    /// The value of the key, if present.
    pub value: Option<String>,
    /// The problem and the allowed values.
    pub problem: String,
}

/// All errors of a file, in the order of its lines; at least one.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ConfigErrors(Vec<ConfigError>);

impl ConfigErrors {
    /// In the order of lines, each once; `None` without any.
    pub(super) fn of(mut errors: Vec<ConfigError>) -> Option<Self> {
        // Stable: of one line, in the order in which they were found. Other files' errors are where they were found.
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
        Some(Self(each))
    }

    /// These, and then those of a file that the first names.
    #[must_use]
    pub fn and(mut self, others: Self) -> Self {
        self.0.extend(others.0);
        self
    }

    /// The errors.
    pub fn errors(&self) -> &[ConfigError] {
        &self.0
    }
}

impl From<ConfigError> for ConfigErrors {
    fn from(error: ConfigError) -> Self {
        Self(vec![error])
    }
}

/// One error a line.
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

/// Errors of the tables of one document, if they are collected.
#[derive(Debug, Clone, Default)]
pub(super) struct Notes(Option<Rc<RefCell<Vec<ConfigError>>>>);

impl Notes {
    /// An empty collection.
    pub(super) fn collecting() -> Self {
        Self(Some(Rc::default()))
    }

    /// Whether errors are collected, so that reading goes on after one.
    pub(super) fn are_kept(&self) -> bool {
        self.0.is_some()
    }

    pub(super) fn add(&self, error: &ConfigError) {
        if let Some(notes) = self.0.as_ref().filter(|notes| !notes.borrow().contains(error)) {
            notes.borrow_mut().push(error.clone());
        }
    }

    /// The first error that is so.
    pub(super) fn find(&self, is_so: impl Fn(&ConfigError) -> bool) -> Option<ConfigError> {
        self.0.as_ref()?.borrow().iter().find(|error| is_so(error)).cloned()
    }

    pub(super) fn count(&self) -> usize {
        self.0.as_ref().map_or(0, |notes| notes.borrow().len())
    }

    pub(super) fn take(&self) -> Vec<ConfigError> {
        self.0.as_ref().map(|notes| notes.take()).unwrap_or_default()
    }
}
