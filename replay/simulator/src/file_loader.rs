//! Access to the files that a scene names.

/// Loads the content of a file named in a scene.
pub type FileLoader<'a> = &'a dyn Fn(&str) -> Result<Vec<u8>, String>;
