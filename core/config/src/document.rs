//! A TOML text with its file name: parses the root table and finds the line number of a key.

use toml::Spanned;
use toml::de::{DeTable, DeValue};

use super::error::ConfigError;

/// Maximum length of a TOML text, bytes. A limit is needed because parsing takes many times the text's length in
/// memory. A long vehicle file has about a hundredth of this length.
const MAX_TEXT_BYTES: usize = 1 << 20;

/// A TOML text and its file name.
#[derive(Debug, Clone, Copy)]
pub struct Document<'a> {
    pub(super) file: &'a str,
    pub(super) text: &'a str,
}

impl<'a> Document<'a> {
    /// Creates a document. `file` is the file's name in error messages.
    pub fn new(file: &'a str, text: &'a str) -> Self {
        Self { file, text }
    }

    /// Parses the TOML text into its root table.
    pub(super) fn table(self) -> Result<DeTable<'a>, ConfigError> {
        self.is_short()?;
        DeTable::parse(self.text).map(Spanned::into_inner).map_err(|error| self.broken(&error))
    }

    /// Rejects a text that is too long to parse.
    pub(super) fn is_short(self) -> Result<(), ConfigError> {
        if self.text.len() <= MAX_TEXT_BYTES {
            return Ok(());
        }
        let len = self.text.len();
        Err(self.broken_as(&format!("a text of {len} bytes; at most {MAX_TEXT_BYTES} are allowed"), 0))
    }

    pub(super) fn broken(self, error: &toml::de::Error) -> ConfigError {
        self.broken_as(error.message(), error.span().map_or(0, |span| span.start))
    }

    pub(super) fn broken_as(self, problem: &str, at: usize) -> ConfigError {
        ConfigError {
            file: self.file.to_owned(),
            line: self.line(at),
            key: "TOML".to_owned(),
            value: None,
            problem: problem.to_owned(),
        }
    }

    /// Returns the line of the key with this dotted path (`sensors[1].connect`).
    ///
    /// If the key is missing, returns the line of its table. If the table is missing too, returns the first line.
    pub fn line_of(self, path: &str) -> usize {
        if self.is_short().is_err() {
            return 1;
        }
        let Ok(root) = DeTable::parse(self.text) else { return 1 };
        let (mut table, mut at) = (root.get_ref(), 0);
        for name in path.split('.') {
            let (key, number) = name.split_once('[').map_or((name, None), |(key, rest)| {
                (key, rest.strip_suffix(']').and_then(|number| number.parse::<usize>().ok()))
            });
            let Some(value) = table.get(key) else { break };
            let item = number.and_then(|number| value.get_ref().as_array()?.get(number));
            let value = item.unwrap_or(value);
            at = value.span().start;
            let DeValue::Table(inner) = value.get_ref() else { break };
            table = inner;
        }
        self.line(at)
    }

    pub(super) fn line(&self, at: usize) -> usize {
        self.text.bytes().take(at).filter(|byte| *byte == b'\n').count() + 1
    }
}
