//! Files that a scene names.

/// Loads the content of a file that a scene names.
pub type FileLoader<'a> = &'a dyn Fn(&str) -> Result<Vec<u8>, String>;
