//! Opens and reads regular files only. Reading a pipe without a writer blocks for ever, and a device may never end.

use std::fs::File;
use std::io::{Error, ErrorKind, Read, Result};
use std::path::Path;

/// Opens a regular file for reading.
///
/// Errors: a system error; the path is a pipe, a device or a socket.
pub fn open(path: &Path) -> Result<File> {
    let kind = std::fs::metadata(path)?.file_type();
    if !kind.is_file() && !kind.is_dir() {
        return Err(Error::new(
            ErrorKind::InvalidInput,
            "it is a pipe, a device or a socket; a file is required",
        ));
    }
    File::open(path)
}

/// Reads a regular file of at most `most_bytes`.
///
/// Errors: as for [`open`]; the file is longer.
pub fn read(path: &Path, most_bytes: u64) -> Result<Vec<u8>> {
    let mut bytes = Vec::new();
    open(path)?.take(most_bytes.saturating_add(1)).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > most_bytes {
        let words = format!("it is longer than {most_bytes} bytes, the limit for such a file");
        return Err(Error::new(ErrorKind::FileTooLarge, words));
    }
    Ok(bytes)
}

/// Reads a regular text file of at most `most_bytes`, in UTF-8.
///
/// Errors: as for [`read`]; the file isn't UTF-8.
pub fn read_text(path: &Path, most_bytes: u64) -> Result<String> {
    String::from_utf8(read(path, most_bytes)?)
        .map_err(|_| Error::new(ErrorKind::InvalidData, "stream did not contain valid UTF-8"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn devices_and_long_files_are_refused() {
        let words = |result: Result<Vec<u8>>| result.unwrap_err().to_string();
        assert_eq!(
            words(read(Path::new("/dev/zero"), 10)),
            "it is a pipe, a device or a socket; a file is required"
        );
        let own = Path::new(env!("CARGO_MANIFEST_DIR")).join("Cargo.toml");
        assert!(words(read(&own, 10)).starts_with("it is longer than 10 bytes"));
        let len = std::fs::metadata(&own).unwrap().len();
        assert_eq!(read(&own, len).unwrap().len() as u64, len);
        assert!(read_text(Path::new(env!("CARGO_MANIFEST_DIR")), 10).is_err(), "a folder");
    }
}
