//! Overrides of values in a TOML text. For instance, a scene changes values of a vehicle file.

use core::ops::Range;

use toml::de::{DeTable, DeValue};

use super::document::Document;
use super::error::ConfigError;
use super::reader::Section;

/// Word in a key's path that selects every table of an array of tables.
const ALL: &str = "all";
/// Key whose value identifies a table in an array of tables.
const ID: &str = "id";

/// Returns `text` with the values of the keys in `changes` replaced.
///
/// - `heads.layout = "x"` changes a key of a table.
/// - `sensors.ID.key` changes a key of the table with this id in an array of tables.
/// - `sensors.all.key` changes the key in each table of the array that has it.
/// - An inline array that is missing from `text`, such as `openings = [{ .. }]`, is added at the start.
///
/// Errors: `text` is not TOML. Or a key in `changes` is missing from `text` and cannot be added.
pub fn changed(text: &str, changes: &Section<'_>) -> Result<String, ConfigError> {
    let table = Document::new(changes.file(), text).table()?;
    let mut changed = String::new();
    let mut edits: Vec<(Range<usize>, &str)> = Vec::new();
    for (path, value, invalid) in changes.leaves() {
        let path: Vec<&str> = path.iter().map(String::as_str).collect();
        let mut found = Vec::new();
        find(&table, &path, &mut found);
        if let ([key], true, true) = (path.as_slice(), found.is_empty(), is_array(value)) {
            changed.extend([*key, " = ", value, "\n"]);
            continue;
        }
        if found.is_empty() {
            return Err(invalid("is not in the vehicle file, so it can't be changed"));
        }
        edits.extend(found.into_iter().map(|span| (span, value)));
    }
    edits.sort_by_key(|(span, _)| span.start);
    let mut at = 0;
    for (span, value) in edits {
        changed.push_str(text.get(at..span.start).unwrap_or_default());
        changed.push_str(value);
        at = span.end;
    }
    changed.push_str(text.get(at..).unwrap_or_default());
    Ok(changed)
}

/// Whether a value is an inline array. Tables under `[[headers]]` are not, and cannot be added at the start.
fn is_array(value: &str) -> bool {
    value.starts_with('[') && !value.starts_with("[[")
}

/// Finds the byte ranges of the values at `path` in the text.
fn find(table: &DeTable<'_>, path: &[&str], found: &mut Vec<Range<usize>>) {
    let Some((key, rest)) = path.split_first() else { return };
    let Some(value) = table.get(*key) else { return };
    match (value.get_ref(), rest) {
        (_, []) => found.push(value.span()),
        (DeValue::Table(inner), _) => find(inner, rest, found),
        (DeValue::Array(items), [name, rest @ ..]) => {
            for item in items {
                let DeValue::Table(inner) = item.get_ref() else { continue };
                let id = inner.get(ID).and_then(|id| id.get_ref().as_str());
                if *name == ALL || id == Some(*name) {
                    find(inner, rest, found);
                }
            }
        }
        _ => {}
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "a = 1 # one\n[heads]\nlayout = \"phase_shift\"\n\n[[sensors]]\nid = \"x\"\nmode = \"slow\"\n\
                        [[sensors]]\nid = \"y\"\n[[sensors]]\nid = \"z\"\nmode = \"slow\"\n";

    fn change(changes: &str) -> Result<String, String> {
        let root = Document::new("s.toml", changes).root().unwrap();
        changed(TEXT, &root).map_err(|error| error.to_string())
    }

    #[test]
    fn changes_replace_only_the_named_values() {
        let expected = TEXT
            .replace("a = 1", "a = [2, 3]")
            .replace("\"phase_shift\"", "\"sector_offset\"")
            .replace("\"slow\"", "\"fast\"");
        let changes = "sensors.all.mode = \"fast\"\na = [2, 3]\nheads.layout = \"sector_offset\"\n";
        assert_eq!(change(changes).unwrap(), expected);
        let one = change("[sensors.z]\nmode = 'medium'\n").unwrap();
        assert_eq!(
            one,
            TEXT.replacen(
                "[[sensors]]\nid = \"z\"\nmode = \"slow\"",
                "[[sensors]]\nid = \"z\"\nmode = 'medium'",
                1
            )
        );
        assert_eq!(change("").unwrap(), TEXT);
    }

    #[test]
    fn missing_array_is_added_at_the_start_of_the_file() {
        let opening = "openings = [{ name = \"gate\", from_m = 1, to_m = 2 }]\n";
        let added = change(&format!("{opening}heads.layout = \"x\"\n")).unwrap();
        assert_eq!(added, format!("{opening}{}", TEXT.replace("phase_shift", "x")));
    }

    #[test]
    fn change_of_a_missing_key_is_rejected() {
        let missing = "is not in the vehicle file, so it can't be changed";
        let tables = "\n[[openings]]\nname = \"gate\"";
        assert_eq!(change(tables).unwrap_err(), format!("s.toml:2: openings = [[openings]]: {missing}"));
        for (changes, key) in
            [("\nheads.speed = 1", "heads.speed"), ("\nsensors.y.mode = 1", "sensors.y.mode")]
        {
            assert_eq!(change(changes).unwrap_err(), format!("s.toml:2: {key} = 1: {missing}"));
        }
    }
}
