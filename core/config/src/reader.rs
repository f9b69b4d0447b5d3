//! Typed access to a TOML text; errors name file, line, key, value and the allowed values.

use core::cell::RefCell;
use core::ops::RangeInclusive;

use toml::Spanned;
use toml::de::{DeTable, DeValue};

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

/// A text and its file name.
#[derive(Debug, Clone, Copy)]
pub struct Document<'a> {
    file: &'a str,
    text: &'a str,
}

/// Reads a file referenced by another one (a polyline profile, a device's definitions), by the name given there.
pub type Loader<'a> = &'a dyn Fn(&str) -> Result<String, String>;

/// A file referenced by a key.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct NamedFile {
    /// File name, as written at the key.
    pub name: String,
    /// Content of the file.
    pub text: String,
}

/// Loader of the files referenced by keys, if any.
#[derive(Clone, Copy)]
struct Files<'a>(Option<Loader<'a>>);

impl core::fmt::Debug for Files<'_> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(if self.0.is_some() { "Files" } else { "no files" })
    }
}

/// A value's path, its text, and a constructor for errors about it.
pub(super) type Leaf<'s> = (Vec<String>, &'s str, Box<dyn Fn(&str) -> ConfigError + 's>);

/// One table of a document. Keys that were never read are an error at [`Section::finish`].
#[derive(Debug)]
pub struct Section<'a> {
    document: Document<'a>,
    path: String,
    table: DeTable<'a>,
    at: usize,
    asked: RefCell<Vec<&'static str>>,
    files: Files<'a>,
}

impl<'a> Document<'a> {
    /// `file` is the name used in errors.
    pub fn new(file: &'a str, text: &'a str) -> Self {
        Self { file, text }
    }

    /// Parses the text to its root table.
    ///
    /// Errors: the text isn't TOML.
    pub fn root(self) -> Result<Section<'a>, ConfigError> {
        let table = self.table()?;
        let (path, asked) = (String::new(), RefCell::default());
        Ok(Section { document: self, path, at: 0, table, asked, files: Files(None) })
    }

    /// The root table as parsed.
    pub(super) fn table(self) -> Result<DeTable<'a>, ConfigError> {
        match DeTable::parse(self.text) {
            Ok(root) => Ok(root.into_inner()),
            Err(error) => {
                let at = error.span().map_or(0, |span| span.start);
                Err(ConfigError {
                    file: self.file.to_owned(),
                    line: self.line(at),
                    key: "TOML".to_owned(),
                    value: None,
                    problem: error.message().to_owned(),
                })
            }
        }
    }

    fn line(&self, at: usize) -> usize {
        self.text.bytes().take(at).filter(|byte| *byte == b'\n').count() + 1
    }
}

impl<'a> Section<'a> {
    /// Lets keys of this table and its subtables reference files, which `load` reads.
    #[must_use]
    pub fn with_files(self, load: Loader<'a>) -> Self {
        Self { files: Files(Some(load)), ..self }
    }

    /// The file referenced by a key. Files referenced by a vehicle file are also attached to logs.
    ///
    /// Errors: not a string, or a file that can't be read.
    pub fn named_file(&self, key: &'static str) -> Result<Option<NamedFile>, ConfigError> {
        let Some(name) = self.text(key)? else { return Ok(None) };
        let Files(load) = self.files;
        let load = load.ok_or_else(|| self.invalid(key, "names a file, and files can't be read here"))?;
        let text = load(&name).map_err(|problem| self.invalid(key, &problem))?;
        Ok(Some(NamedFile { name, text }))
    }

    /// A number within `allowed`, in the unit of the key's suffix.
    ///
    /// Errors: not a finite number, or outside `allowed`.
    pub fn number(
        &self,
        key: &'static str,
        allowed: RangeInclusive<f64>,
    ) -> Result<Option<f64>, ConfigError> {
        let Some(value) = self.ask(key) else { return Ok(None) };
        let wanted = || format!("must be a number from {} to {}", allowed.start(), allowed.end());
        let number = as_number(value.get_ref()).ok_or_else(|| self.error(key, Some(value), wanted()))?;
        if !allowed.contains(&number) {
            return Err(self.error(key, Some(value), wanted()));
        }
        Ok(Some(number))
    }

    /// A whole number within `allowed`; hexadecimal (0x...) is accepted too.
    ///
    /// Errors: not a whole number, or outside `allowed`.
    pub fn integer(
        &self,
        key: &'static str,
        allowed: RangeInclusive<i64>,
    ) -> Result<Option<i64>, ConfigError> {
        let Some(value) = self.ask(key) else { return Ok(None) };
        let wanted = || format!("must be a whole number from {} to {}", allowed.start(), allowed.end());
        match as_integer(value.get_ref()) {
            Some(number) if allowed.contains(&number) => Ok(Some(number)),
            _ => Err(self.error(key, Some(value), wanted())),
        }
    }

    /// A string.
    ///
    /// Errors: not a string.
    pub fn text(&self, key: &'static str) -> Result<Option<String>, ConfigError> {
        let Some(value) = self.ask(key) else { return Ok(None) };
        match value.get_ref().as_str() {
            Some(text) => Ok(Some(text.to_owned())),
            None => Err(self.error(key, Some(value), "must be a text in quotes".to_owned())),
        }
    }

    /// True or false.
    ///
    /// Errors: anything else.
    pub fn boolean(&self, key: &'static str) -> Result<Option<bool>, ConfigError> {
        let Some(value) = self.ask(key) else { return Ok(None) };
        match value.get_ref().as_bool() {
            Some(boolean) => Ok(Some(boolean)),
            None => Err(self.error(key, Some(value), "must be true or false".to_owned())),
        }
    }

    /// One of the given words; returns its associated value.
    ///
    /// Errors: another word; the message lists those allowed.
    pub fn choice<T: Copy>(&self, key: &'static str, among: &[(&str, T)]) -> Result<Option<T>, ConfigError> {
        let Some(value) = self.ask(key) else { return Ok(None) };
        let found = value.get_ref().as_str().and_then(|text| among.iter().find(|(word, _)| *word == text));
        if let Some((_, meaning)) = found {
            return Ok(Some(*meaning));
        }
        let words: Vec<&str> = among.iter().map(|(word, _)| *word).collect();
        Err(self.error(key, Some(value), format!("must be one of {}", words.join(", "))))
    }

    /// Three numbers, each within `allowed`.
    ///
    /// Errors: not an array of three, or one of them outside.
    pub fn triple(
        &self,
        key: &'static str,
        allowed: RangeInclusive<f64>,
    ) -> Result<Option<[f64; 3]>, ConfigError> {
        let Some(value) = self.ask(key) else { return Ok(None) };
        let wanted =
            || format!("must be three numbers [a, b, c], each from {} to {}", allowed.start(), allowed.end());
        let numbers = self.array_of_numbers(key, value, &allowed, &wanted)?;
        match numbers.as_slice() {
            [a, b, c] => Ok(Some([*a, *b, *c])),
            _ => Err(self.error(key, Some(value), wanted())),
        }
    }

    /// An array of numbers of any length, each within `allowed`.
    ///
    /// Errors: not an array of numbers, or one of them outside.
    pub fn numbers(
        &self,
        key: &'static str,
        allowed: RangeInclusive<f64>,
    ) -> Result<Option<Vec<f64>>, ConfigError> {
        let Some(value) = self.ask(key) else { return Ok(None) };
        let wanted =
            || format!("must be numbers [a, b, ...], each from {} to {}", allowed.start(), allowed.end());
        self.array_of_numbers(key, value, &allowed, &wanted).map(Some)
    }

    /// A table within this one.
    ///
    /// Errors: the key holds something else.
    pub fn section(&self, key: &'static str) -> Result<Option<Section<'a>>, ConfigError> {
        let Some(value) = self.ask(key) else { return Ok(None) };
        match value.get_ref() {
            DeValue::Table(table) => Ok(Some(self.child(key, table.clone(), value.span().start))),
            _ => Err(self.error(key, Some(value), "must be a table".to_owned())),
        }
    }

    /// The tables of an array of tables; none when the key is absent.
    ///
    /// Errors: the key holds something else.
    pub fn sections(&self, key: &'static str) -> Result<Vec<Section<'a>>, ConfigError> {
        let Some(value) = self.ask(key) else { return Ok(Vec::new()) };
        let wrong = || self.error(key, Some(value), format!("must be tables, each headed [[{key}]]"));
        let array = value.get_ref().as_array().ok_or_else(wrong)?;
        array
            .iter()
            .enumerate()
            .map(|(i, item)| match item.get_ref() {
                DeValue::Table(table) => {
                    Ok(self.child(&format!("{key}[{i}]"), table.clone(), item.span().start))
                }
                _ => Err(wrong()),
            })
            .collect()
    }

    /// One table, or the tables of an array of tables; none when the key is absent.
    ///
    /// Errors: the key holds something else.
    pub fn tables(&self, key: &'static str) -> Result<Vec<Section<'a>>, ConfigError> {
        let one = self.ask(key).is_some_and(|value| matches!(value.get_ref(), DeValue::Table(_)));
        if one { Ok(self.section(key)?.into_iter().collect()) } else { self.sections(key) }
    }

    /// An array of strings.
    ///
    /// Errors: the key holds something else.
    pub fn texts(&self, key: &'static str) -> Result<Option<Vec<String>>, ConfigError> {
        let Some(value) = self.ask(key) else { return Ok(None) };
        let wrong = || self.error(key, Some(value), "must be texts [\"a\", \"b\", ...]".to_owned());
        let array = value.get_ref().as_array().ok_or_else(wrong)?;
        let text = |item: &Spanned<DeValue<'a>>| item.get_ref().as_str().map(str::to_owned);
        array.iter().map(|item| text(item).ok_or_else(wrong)).collect::<Result<Vec<_>, _>>().map(Some)
    }

    /// `value`, or an error that the key is missing.
    ///
    /// Errors: `value` is `None`.
    pub fn required<T>(&self, key: &'static str, value: Option<T>) -> Result<T, ConfigError> {
        value.ok_or_else(|| self.error(key, None, "is missing".to_owned()))
    }

    /// Checks that every key of this table was read.
    ///
    /// Errors: the first key that wasn't; the message lists the known ones.
    pub fn finish(self) -> Result<(), ConfigError> {
        let asked = self.asked.borrow();
        let unknown = self.table.keys().filter(|key| !asked.contains(&key.get_ref().as_ref()));
        match unknown.min_by_key(|key| key.span().start) {
            None => Ok(()),
            Some(key) => Err(ConfigError {
                file: self.document.file.to_owned(),
                line: self.document.line(key.span().start),
                key: self.full(key.get_ref()),
                value: None,
                problem: format!("is not a key here; known are {}", asked.join(", ")),
            }),
        }
    }

    /// An error about `key` in this table, for checks that only the caller can make.
    pub fn invalid(&self, key: &str, problem: &str) -> ConfigError {
        let value = self.table.get(key);
        self.error(key, value, problem.to_owned())
    }

    /// An error about this table as a whole.
    pub fn invalid_itself(&self, problem: &str) -> ConfigError {
        ConfigError {
            file: self.document.file.to_owned(),
            line: self.document.line(self.at),
            key: self.path.clone(),
            value: None,
            problem: problem.to_owned(),
        }
    }

    /// File of this table, as the caller named it.
    pub fn file(&self) -> &str {
        self.document.file
    }

    /// Keys present in this table, in the order of the file.
    pub fn keys(&self) -> Vec<&str> {
        let mut keys: Vec<_> = self.table.keys().collect();
        keys.sort_by_key(|key| key.span().start);
        keys.into_iter().map(|key| key.get_ref().as_ref()).collect()
    }

    /// All values below this table that aren't tables: path from here, text, and error constructor.
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

    fn array_of_numbers(
        &self,
        key: &str,
        value: &Spanned<DeValue<'a>>,
        allowed: &RangeInclusive<f64>,
        wanted: &impl Fn() -> String,
    ) -> Result<Vec<f64>, ConfigError> {
        let wrong = || self.error(key, Some(value), wanted());
        let array = value.get_ref().as_array().ok_or_else(wrong)?;
        array
            .iter()
            .map(|item| as_number(item.get_ref()).filter(|n| allowed.contains(n)).ok_or_else(wrong))
            .collect()
    }

    fn child(&self, key: &str, table: DeTable<'a>, at: usize) -> Section<'a> {
        let (path, asked) = (self.full(key), RefCell::default());
        Section { document: self.document, path, table, at, asked, files: self.files }
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

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "target_m = 0.5\n[water]\nsound_speed_mps = 14470\nsalt = 1\n";

    #[test]
    fn an_error_names_file_line_key_value_and_what_is_allowed() {
        let root = Document::new("v.toml", TEXT).root().unwrap();
        assert_eq!(root.number("target_m", 0.0..=1.0).unwrap(), Some(0.5));
        let water = root.section("water").unwrap().unwrap();
        let error = water.number("sound_speed_mps", 1300.0..=1600.0).unwrap_err();
        assert_eq!(
            error.to_string(),
            "v.toml:3: water.sound_speed_mps = 14470: must be a number from 1300 to 1600"
        );
        let error = water.finish().unwrap_err();
        assert_eq!(error.to_string(), "v.toml:4: water.salt: is not a key here; known are sound_speed_mps");
    }

    #[test]
    fn a_missing_key_and_a_broken_text_have_their_line() {
        let root = Document::new("v.toml", "\n[water]\n").root().unwrap();
        let water = root.section("water").unwrap().unwrap();
        let error =
            water.required("density_kgpm3", water.number("density_kgpm3", 0.0..=1.0).unwrap()).unwrap_err();
        assert_eq!(error.to_string(), "v.toml:2: water.density_kgpm3: is missing");
        assert_eq!(Document::new("v.toml", "a = 1\nb = \n").root().unwrap_err().line, 2);
    }

    #[test]
    fn a_key_names_a_file() {
        let files = |name: &str| match name {
            "a.dbc" => Ok("text".to_owned()),
            _ => Err("isn't there".to_owned()),
        };
        let text = "file = \"a.dbc\"\n[inner]\nfile = \"a.dbc\"\nother = \"b.dbc\"\n";
        let root = Document::new("v.toml", text).root().unwrap();
        let error = root.named_file("file").unwrap_err().to_string();
        assert_eq!(error, "v.toml:1: file = \"a.dbc\": names a file, and files can't be read here");
        let root = root.with_files(&files);
        let expected = NamedFile { name: "a.dbc".to_owned(), text: "text".to_owned() };
        let inner = root.section("inner").unwrap().unwrap();
        assert_eq!(root.named_file("file").unwrap(), Some(expected.clone()));
        assert_eq!(inner.named_file("file").unwrap(), Some(expected));
        assert_eq!(root.named_file("none").unwrap(), None);
        let error = inner.named_file("other").unwrap_err().to_string();
        assert_eq!(error, "v.toml:4: inner.other = \"b.dbc\": isn't there");
    }

    #[test]
    fn not_a_number_is_refused() {
        let root = Document::new("v.toml", "a = nan\nb = inf\nc = \"1\"\nd = [1, 2]\n").root().unwrap();
        for key in ["a", "b", "c"] {
            assert!(root.number(key, f64::MIN..=f64::MAX).is_err(), "{key}");
        }
        assert!(root.triple("d", -1.0..=9.0).is_err());
    }
}
