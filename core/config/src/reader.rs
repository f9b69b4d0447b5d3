//! Typed access to a TOML text; errors name file, line, key, value and the allowed values.

use core::cell::RefCell;
use core::ops::RangeInclusive;

use toml::Spanned;
use toml::de::{DeTable, DeValue};

use super::document::Document;
use super::error::{ConfigError, ConfigErrors, MOST_ERRORS, Notes};
use super::nearest::nearest;
use super::plain::is_plain;

/// Function that returns the text of a file named by a key, for instance a polyline profile or a DBC file.
pub type Loader<'a> = &'a dyn Fn(&str) -> Result<String, String>;

/// Maximum number of tables in an array. A limit is needed because each table is compared with all others.
const MOST_TABLES: usize = 2000;

/// A file whose name is the value of a key.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct NamedFile {
    /// File name, as written in the key's value.
    pub name: String,
    /// Text of the file.
    pub text: String,
}

/// Loader of the files that keys refer to. `None` if keys may not refer to files.
#[derive(Clone, Copy)]
struct Files<'a>(Option<Loader<'a>>);

impl core::fmt::Debug for Files<'_> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(if self.0.is_some() { "Files" } else { "no files" })
    }
}

/// Key path of a value, text of the value, and a constructor for errors about the value.
pub(super) type Leaf<'s> = (Vec<String>, &'s str, Box<dyn Fn(&str) -> ConfigError + 's>);

/// One table of a document. [`Section::finish`] reports the keys that were never read.
#[derive(Debug)]
pub struct Section<'a> {
    document: Document<'a>,
    path: String,
    table: DeTable<'a>,
    at: usize,
    asked: RefCell<Vec<&'static str>>,
    files: Files<'a>,
    notes: Notes,
}

impl<'a> Document<'a> {
    /// Parses the TOML text and returns its root table, whose methods fail at the first error.
    ///
    /// Errors: the text is not TOML.
    pub fn root(self) -> Result<Section<'a>, ConfigError> {
        Ok(Section::of_root(self, self.table()?, Notes::default()))
    }

    /// Reads the whole TOML text by calling `read`, and finds all of its errors.
    ///
    /// The table and its subtables note each error. Reading continues as if the key with the error were absent. Keys
    /// that were never read are errors too.
    ///
    /// Errors: all noted errors, and the error that `read` returned.
    pub fn read<T>(
        self,
        read: impl FnOnce(&Section<'a>) -> Result<T, ConfigError>,
    ) -> Result<T, ConfigErrors> {
        self.is_short()?;
        let (table, broken) = DeTable::parse_recoverable(self.text);
        // Only the first syntax error of a line is reported, because it causes the others on this line.
        let reported = broken.iter().take(2 * MOST_ERRORS);
        let mut broken: Vec<ConfigError> = reported.map(|error| self.broken(error)).collect();
        broken.dedup_by_key(|error| error.line);
        if let Some(errors) = ConfigErrors::of(broken) {
            return Err(errors);
        }
        let notes = Notes::collecting();
        let root = Section::of_root(self, table.into_inner(), notes.clone());
        let result = root.go_on(read(&root))?;
        if result.is_some() {
            root.finish()?;
        }
        match (result, ConfigErrors::of(notes.take())) {
            (Some(result), None) => Ok(result),
            (_, Some(errors)) => Err(errors),
            // Unreachable, because an error is noted for every missing result.
            (None, None) => Err(self.broken_as("couldn't be read", 0).into()),
        }
    }
}

impl<'a> Section<'a> {
    /// Creates the root table of a document.
    fn of_root(document: Document<'a>, table: DeTable<'a>, notes: Notes) -> Self {
        let (path, asked) = (String::new(), RefCell::default());
        Self { document, path, at: 0, table, asked, files: Files(None), notes }
    }

    /// Allows keys of this table and its subtables to refer to files, which `load` reads.
    #[must_use]
    pub fn with_files(self, load: Loader<'a>) -> Self {
        Self { files: Files(Some(load)), ..self }
    }

    /// Returns the name and text of the file that a key refers to. A log contains the files of its vehicle file.
    ///
    /// Errors: the value is not a string, or the file cannot be read.
    pub fn named_file(&self, key: &'static str) -> Result<Option<NamedFile>, ConfigError> {
        let Some(name) = self.text(key)? else { return Ok(None) };
        let Files(load) = self.files;
        let load = load.ok_or_else(|| self.invalid(key, "names a file, but files are not allowed here"))?;
        match load(&name) {
            Ok(text) => Ok(Some(NamedFile { name, text })),
            Err(problem) => self.wrong(key, self.table.get(key), problem),
        }
    }

    /// Reads a number within `allowed`, in the unit of the key's suffix.
    ///
    /// Errors: the value is not a finite number or is outside `allowed`.
    pub fn number(
        &self,
        key: &'static str,
        allowed: RangeInclusive<f64>,
    ) -> Result<Option<f64>, ConfigError> {
        let Some(value) = self.ask(key) else { return Ok(None) };
        let wanted = || format!("must be a number from {} to {}", allowed.start(), allowed.end());
        match as_number(value.get_ref()) {
            Some(number) if allowed.contains(&number) => Ok(Some(number)),
            _ => self.wrong(key, Some(value), wanted()),
        }
    }

    /// Reads a whole number within `allowed`. Hexadecimal (0x...) is also accepted.
    ///
    /// Errors: the value is not a whole number or is outside `allowed`.
    pub fn integer(
        &self,
        key: &'static str,
        allowed: RangeInclusive<i64>,
    ) -> Result<Option<i64>, ConfigError> {
        let Some(value) = self.ask(key) else { return Ok(None) };
        let wanted = || format!("must be a whole number from {} to {}", allowed.start(), allowed.end());
        match as_integer(value.get_ref()) {
            Some(number) if allowed.contains(&number) => Ok(Some(number)),
            _ => self.wrong(key, Some(value), wanted()),
        }
    }

    /// Reads a string.
    ///
    /// Errors: the value is not a string, or contains control characters.
    pub fn text(&self, key: &'static str) -> Result<Option<String>, ConfigError> {
        let Some(value) = self.ask(key) else { return Ok(None) };
        match value.get_ref().as_str() {
            Some(text) if is_plain(text) => Ok(Some(text.to_owned())),
            Some(_) => self.wrong(key, Some(value), "must be without control characters".to_owned()),
            None => self.wrong(key, Some(value), "must be a text in quotes".to_owned()),
        }
    }

    /// Reads a boolean.
    ///
    /// Errors: the value is neither true nor false.
    pub fn boolean(&self, key: &'static str) -> Result<Option<bool>, ConfigError> {
        let Some(value) = self.ask(key) else { return Ok(None) };
        match value.get_ref().as_bool() {
            Some(boolean) => Ok(Some(boolean)),
            None => self.wrong(key, Some(value), "must be true or false".to_owned()),
        }
    }

    /// Reads one of the words in `among`, and returns the value that belongs to it.
    ///
    /// Errors: the value is none of these words; the message lists them.
    pub fn choice<T: Copy>(&self, key: &'static str, among: &[(&str, T)]) -> Result<Option<T>, ConfigError> {
        let Some(value) = self.ask(key) else { return Ok(None) };
        let found = value.get_ref().as_str().and_then(|text| among.iter().find(|(word, _)| *word == text));
        if let Some((_, meaning)) = found {
            return Ok(Some(*meaning));
        }
        let words: Vec<&str> = among.iter().map(|(word, _)| *word).collect();
        let meant = value.get_ref().as_str().and_then(|text| nearest(text, words.iter().copied()));
        let meant = meant.map_or_else(String::new, |meant| format!("; did you mean {meant:?}?"));
        self.wrong(key, Some(value), format!("must be one of {}{meant}", words.join(", ")))
    }

    /// Reads an array of three numbers, each within `allowed`.
    ///
    /// Errors: the value is not an array of three numbers, or a number is outside `allowed`.
    pub fn triple(
        &self,
        key: &'static str,
        allowed: RangeInclusive<f64>,
    ) -> Result<Option<[f64; 3]>, ConfigError> {
        let Some(value) = self.ask(key) else { return Ok(None) };
        let wanted =
            || format!("must be three numbers [a, b, c], each from {} to {}", allowed.start(), allowed.end());
        match array_of_numbers(value.get_ref(), &allowed).as_deref() {
            Some([a, b, c]) => Ok(Some([*a, *b, *c])),
            _ => self.wrong(key, Some(value), wanted()),
        }
    }

    /// Reads an array of numbers of any length, each within `allowed`.
    ///
    /// Errors: the value is not an array of numbers, or a number is outside `allowed`.
    pub fn numbers(
        &self,
        key: &'static str,
        allowed: RangeInclusive<f64>,
    ) -> Result<Option<Vec<f64>>, ConfigError> {
        let Some(value) = self.ask(key) else { return Ok(None) };
        let wanted =
            || format!("must be numbers [a, b, ...], each from {} to {}", allowed.start(), allowed.end());
        match array_of_numbers(value.get_ref(), &allowed) {
            Some(numbers) => Ok(Some(numbers)),
            None => self.wrong(key, Some(value), wanted()),
        }
    }

    /// Reads a number or an array of numbers, each within `allowed`. Error messages contain `wanted`, a description of
    /// the allowed values.
    ///
    /// Errors: the value is neither a number nor an array of numbers, or a number is outside `allowed`.
    pub fn number_or_numbers(
        &self,
        key: &'static str,
        allowed: RangeInclusive<f64>,
        wanted: &str,
    ) -> Result<Option<Vec<f64>>, ConfigError> {
        let Some(value) = self.ask(key) else { return Ok(None) };
        let one = as_number(value.get_ref()).filter(|number| allowed.contains(number)).map(|one| vec![one]);
        match one.or_else(|| array_of_numbers(value.get_ref(), &allowed)) {
            Some(numbers) => Ok(Some(numbers)),
            None => self.wrong(key, Some(value), wanted.to_owned()),
        }
    }

    /// Reads a subtable of this table.
    ///
    /// Errors: the value is not a table.
    pub fn section(&self, key: &'static str) -> Result<Option<Section<'a>>, ConfigError> {
        let Some(value) = self.ask(key) else { return Ok(None) };
        match value.get_ref() {
            DeValue::Table(table) => Ok(Some(self.child(key, table.clone(), value.span().start))),
            _ => self.wrong(key, Some(value), "must be a table".to_owned()),
        }
    }

    /// Reads the tables of an array of tables. Returns none if the key is absent.
    ///
    /// Errors: the value is not an array of tables, or it has too many tables.
    pub fn sections(&self, key: &'static str) -> Result<Vec<Section<'a>>, ConfigError> {
        let Some(value) = self.ask(key) else { return Ok(Vec::new()) };
        let table = |(i, item): (usize, &Spanned<DeValue<'a>>)| match item.get_ref() {
            DeValue::Table(table) => {
                Some(self.child(&format!("{key}[{i}]"), table.clone(), item.span().start))
            }
            _ => None,
        };
        let count = value.get_ref().as_array().map_or(0, |array| array.iter().count());
        if count > MOST_TABLES {
            let problem = format!("{count} tables; at most {MOST_TABLES} are allowed");
            return Ok(self.wrong(key, Some(value), problem)?.unwrap_or_default());
        }
        let items = value.get_ref().as_array().map(|array| array.iter().enumerate().map(table));
        if let Some(tables) = items.and_then(Iterator::collect::<Option<Vec<_>>>) {
            return Ok(tables);
        }
        let problem = format!("must be tables, each headed [[{key}]]");
        Ok(self.wrong(key, Some(value), problem)?.unwrap_or_default())
    }

    /// Reads one table or an array of tables. Returns none if the key is absent.
    ///
    /// Errors: the value is neither a table nor an array of tables, or it has too many tables.
    pub fn tables(&self, key: &'static str) -> Result<Vec<Section<'a>>, ConfigError> {
        let one = self.ask(key).is_some_and(|value| matches!(value.get_ref(), DeValue::Table(_)));
        if one { Ok(self.section(key)?.into_iter().collect()) } else { self.sections(key) }
    }

    /// Reads an array of strings.
    ///
    /// Errors: the value is not an array of strings.
    pub fn texts(&self, key: &'static str) -> Result<Option<Vec<String>>, ConfigError> {
        let Some(value) = self.ask(key) else { return Ok(None) };
        let text = |item: &Spanned<DeValue<'a>>| item.get_ref().as_str().map(str::to_owned);
        match value.get_ref().as_array().and_then(|array| array.iter().map(text).collect()) {
            Some(texts) => Ok(Some(texts)),
            None => self.wrong(key, Some(value), "must be texts [\"a\", \"b\", ...]".to_owned()),
        }
    }

    /// Returns `value`, or an error that the key is missing. If an unread key has a similar name, the error suggests
    /// that this key is meant.
    ///
    /// Errors: `value` is `None`.
    pub fn required<T>(&self, key: &'static str, value: Option<T>) -> Result<T, ConfigError> {
        value.ok_or_else(|| self.missing(key))
    }

    fn missing(&self, key: &'static str) -> ConfigError {
        let name = self.full(key);
        let is_below = |error: &ConfigError| {
            error.key.strip_prefix(&name).is_some_and(|rest| rest.is_empty() || rest.starts_with(['.', '[']))
        };
        // The key is present, but its value is wrong. The error about it was already noted, and is returned again.
        if let Some(wrong) = self.noted(|error| self.table.contains_key(key) && is_below(error)) {
            return wrong;
        }
        let misnamed = self.misnamed(key);
        misnamed.unwrap_or_else(|| self.noting(self.error(key, None, "is missing".to_owned())))
    }

    /// Returns an error about an unread key of this table whose name is similar to `key`, if there is one.
    fn misnamed(&self, key: &str) -> Option<ConfigError> {
        let asked = self.asked.borrow();
        let mut others: Vec<_> =
            self.table.keys().filter(|other| !asked.contains(&other.get_ref().as_ref())).collect();
        others.sort_by_key(|other| other.span().start);
        let found = nearest(key, others.iter().map(|other| other.get_ref().as_ref()))?;
        let other = others.iter().find(|other| other.get_ref() == found)?;
        Some(self.noting(self.unknown(other, &[key])))
    }

    /// Reads a part of the file. `None` if the part has errors; these are noted, and reading continues.
    ///
    /// Errors: the error of the part, if errors are not collected.
    pub fn part<T>(&self, read: impl FnOnce() -> Result<T, ConfigError>) -> Result<Option<T>, ConfigError> {
        let before = self.notes.count();
        let part = self.go_on(read())?;
        Ok(part.filter(|_| self.notes.count() == before))
    }

    /// Returns the value of `result`. If `result` is an error and errors are collected, notes it and returns `None`.
    fn go_on<T>(&self, result: Result<T, ConfigError>) -> Result<Option<T>, ConfigError> {
        match result {
            Ok(result) => Ok(Some(result)),
            Err(error) if self.notes.are_kept() => {
                self.notes.add(&error);
                Ok(None)
            }
            Err(error) => Err(error),
        }
    }

    /// Checks that every key of this table was read.
    ///
    /// Errors: a key was not read; the message names the nearest known key, or lists the known keys.
    pub fn finish(&self) -> Result<(), ConfigError> {
        let asked = self.asked.borrow();
        let mut unknown: Vec<_> =
            self.table.keys().filter(|key| !asked.contains(&key.get_ref().as_ref())).collect();
        unknown.sort_by_key(|key| key.span().start);
        for key in unknown {
            if self.notes.are_enough() {
                break;
            }
            let name = self.full(key.get_ref());
            // A similar key may be missing. Then an error about this key is already noted.
            if self.noted(|error| error.key == name).is_none() {
                self.go_on::<()>(Err(self.unknown(key, &asked)))?;
            }
        }
        Ok(())
    }

    fn unknown(&self, key: &Spanned<std::borrow::Cow<'a, str>>, known: &[&str]) -> ConfigError {
        let problem = match nearest(key.get_ref(), known.iter().copied()) {
            Some(meant) => format!("is not a key here; did you mean {meant}?"),
            None => format!("is not a key here; known are {}", known.join(", ")),
        };
        ConfigError {
            file: self.document.file.to_owned(),
            line: self.document.line(key.span().start),
            key: self.full(key.get_ref()),
            value: None,
            problem,
        }
    }

    /// Returns an error about `key` in this table, for checks that only the caller can make.
    ///
    /// The problem may be a mere consequence of an error that was already noted. If an error about the same key was
    /// noted, returns that error instead. If the key is absent from a table below the root, returns a noted error of
    /// that table, or an error about a key with a similar name, if there is one.
    pub fn invalid(&self, key: &str, problem: &str) -> ConfigError {
        let (name, value) = (self.full(key), self.table.get(key));
        let is_below = value.is_none() && !self.path.is_empty();
        let follows = self.noted(|error| error.key == name || (is_below && self.is_of(error)));
        let misnamed = || if is_below { self.misnamed(key) } else { None };
        follows.or_else(misnamed).unwrap_or_else(|| self.noting(self.error(key, value, problem.to_owned())))
    }

    /// Returns an error about this table as a whole. If an error about one of its keys was noted, returns that error
    /// instead.
    pub fn invalid_itself(&self, problem: &str) -> ConfigError {
        let error = || ConfigError {
            file: self.document.file.to_owned(),
            line: self.document.line(self.at),
            key: self.path.clone(),
            value: None,
            problem: problem.to_owned(),
        };
        self.noted(|noted| self.is_of(noted)).unwrap_or_else(|| self.noting(error()))
    }

    /// Whether an error concerns a key directly in this table.
    fn is_of(&self, error: &ConfigError) -> bool {
        let key = if self.path.is_empty() {
            Some(error.key.as_str())
        } else {
            error.key.strip_prefix(&self.path).and_then(|rest| rest.strip_prefix('.'))
        };
        key.is_some_and(|key| !key.contains(['.', '[']))
    }

    /// Returns the first noted error of this file that satisfies `is_so`.
    fn noted(&self, is_so: impl Fn(&ConfigError) -> bool) -> Option<ConfigError> {
        self.notes.find(|error| error.file == self.document.file && is_so(error))
    }

    /// Notes an error and returns it to the caller.
    fn noting(&self, error: ConfigError) -> ConfigError {
        self.notes.add(&error);
        error
    }

    /// Handles a wrong value. If errors are collected, notes an error and returns `None`, as for an absent key.
    /// Otherwise returns the error.
    fn wrong<T>(
        &self,
        key: &str,
        value: Option<&Spanned<DeValue<'a>>>,
        problem: String,
    ) -> Result<Option<T>, ConfigError> {
        self.go_on(Err(self.error(key, value, problem)))
    }

    /// File name of this table's document, as given by the caller.
    pub fn file(&self) -> &str {
        self.document.file
    }

    /// Keys present in this table, in the order of the file.
    pub fn keys(&self) -> Vec<&str> {
        let mut keys: Vec<_> = self.table.keys().collect();
        keys.sort_by_key(|key| key.span().start);
        keys.into_iter().map(|key| key.get_ref().as_ref()).collect()
    }

    /// Returns all values in this table and its subtables. Each comes with its path, its text, and a constructor for
    /// errors about it.
    pub(super) fn leaves(&self) -> Vec<Leaf<'_>> {
        let mut leaves = Vec::new();
        self.collect_leaves(&self.table, &[], &mut leaves);
        leaves
    }

    fn collect_leaves<'s>(&'s self, table: &'s DeTable<'a>, above: &[String], leaves: &mut Vec<Leaf<'s>>) {
        for (key, value) in table {
            let path: Vec<String> = above.iter().cloned().chain([key.get_ref().to_string()]).collect();
            if let DeValue::Table(inner) = value.get_ref() {
                self.collect_leaves(inner, &path, leaves);
                continue;
            }
            let text = self.document.text.get(value.span()).unwrap_or_default();
            let name = path.join(".");
            leaves.push((path, text, Box::new(move |why| self.error(&name, Some(value), why.to_owned()))));
        }
    }

    fn ask(&self, key: &'static str) -> Option<&Spanned<DeValue<'a>>> {
        if !self.asked.borrow().contains(&key) {
            self.asked.borrow_mut().push(key);
        }
        self.table.get(key)
    }

    fn child(&self, key: &str, table: DeTable<'a>, at: usize) -> Section<'a> {
        let (path, asked) = (self.full(key), RefCell::default());
        let notes = self.notes.clone();
        Section { document: self.document, path, table, at, asked, files: self.files, notes }
    }

    fn full(&self, key: &str) -> String {
        if self.path.is_empty() { key.to_owned() } else { format!("{}.{key}", self.path) }
    }

    fn error(&self, key: &str, value: Option<&Spanned<DeValue<'a>>>, problem: String) -> ConfigError {
        let at = value.map_or(self.at, |value| value.span().start);
        let text = value.and_then(|value| self.document.text.get(value.span()));
        ConfigError {
            file: self.document.file.to_owned(),
            line: self.document.line(at),
            key: self.full(key),
            value: text.map(|text| text.lines().next().unwrap_or_default().chars().take(60).collect()),
            problem,
        }
    }
}

fn as_integer(value: &DeValue<'_>) -> Option<i64> {
    let integer = value.as_integer()?;
    i64::from_str_radix(integer.as_str(), integer.radix()).ok()
}

fn as_number(value: &DeValue<'_>) -> Option<f64> {
    let number = match value {
        DeValue::Integer(_) => as_integer(value)? as f64,
        DeValue::Float(float) => float.as_str().parse().ok()?,
        _ => return None,
    };
    number.is_finite().then_some(number)
}

fn array_of_numbers(value: &DeValue<'_>, allowed: &RangeInclusive<f64>) -> Option<Vec<f64>> {
    let number = |item: &Spanned<DeValue<'_>>| as_number(item.get_ref()).filter(|n| allowed.contains(n));
    value.as_array()?.iter().map(number).collect()
}
