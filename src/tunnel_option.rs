//! The option `--tunnel`: `NAME`, `NAME,KEY=VALUE,...` with the keys of a vehicle file, or a polyline file.

use std::path::{Path, PathBuf};

use headrace_config::{Document, Loader};
use headrace_vehicle::TunnelConfig;

use crate::failure::Failure;

/// A tunnel as the option describes it. `load` loads the file of a polyline.
pub(crate) fn parse(text: &str, load: Loader<'_>) -> Result<TunnelConfig, Failure> {
    let table = table(text);
    let root = Document::new("--tunnel", &table).root()?;
    Ok(TunnelConfig::from_section(&root, load)?)
}

/// Lines of the vehicle file's table `[tunnel]`.
pub(crate) fn table(text: &str) -> String {
    let mut parts = text.split(',');
    let name = parts.next().unwrap_or_default().trim();
    let begin = if is_file(name) {
        format!("profile = \"polyline\"\nfile = {name:?}\n")
    } else {
        format!("profile = {name:?}\n")
    };
    let part = |part: &str| {
        let (key, value) = part.split_once('=').unwrap_or((part, "?"));
        line(key, value)
    };
    std::iter::once(begin).chain(parts.map(part)).collect()
}

/// A line of a vehicle file. A value is written as a text unless it is a number, true or false.
pub(crate) fn line(key: &str, value: &str) -> String {
    let value = value.trim();
    let is_bare =
        value.parse::<f64>().is_ok() || value.starts_with("0x") || ["true", "false"].contains(&value);
    let value = if is_bare { value.to_owned() } else { format!("{value:?}") };
    format!("{} = {value}\n", key.trim())
}

/// Beginning of the line with the tunnel's length.
pub(crate) const LENGTH: &str = "length_m = ";

/// Length of the tunnel, metres, as the text of its key; `None` without the key.
pub(crate) fn length(text: &str) -> Option<String> {
    table(text).lines().find_map(|line| line.strip_prefix(LENGTH)).map(str::to_owned)
}

/// File that describes the tunnel; `None` if it isn't read from a file.
pub(crate) fn file(text: &str) -> Option<PathBuf> {
    let name = text.split(',').next().map(str::trim);
    name.filter(|name| is_file(name)).map(PathBuf::from)
}

/// Whether a tunnel's name is the name of a polyline file.
fn is_file(name: &str) -> bool {
    Path::new(name).extension().is_some_and(|extension| extension == "csv")
}
