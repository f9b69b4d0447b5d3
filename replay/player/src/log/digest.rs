//! Computes SHA-256 digests of log files.

use std::io::Read;
use std::path::Path;

use sha2::{Digest, Sha256};

use super::error::LogError;
use super::format::hex;
use crate::regular_file;

/// Returns the SHA-256 of a file, in hex.
///
/// Errors: the file can't be read.
pub fn file_digest(path: &Path) -> Result<String, LogError> {
    files_digest(&[path])
}

/// Returns the SHA-256 of the concatenated files, in hex.
///
/// Errors: a file can't be read.
pub fn files_digest(paths: &[impl AsRef<Path>]) -> Result<String, LogError> {
    let mut hasher = Sha256::new();
    let mut block = vec![0; 1 << 16];
    for path in paths {
        let path = path.as_ref();
        let failed = |source| LogError::Open { path: path.to_owned(), source };
        let mut file = regular_file::open(path).map_err(failed)?;
        loop {
            match file.read(&mut block) {
                Ok(0) => break,
                Ok(len) => hasher.update(block.get(..len).unwrap_or_default()),
                Err(error) if error.kind() == std::io::ErrorKind::Interrupted => {}
                Err(source) => return Err(failed(source)),
            }
        }
    }
    Ok(hex(&hasher.finalize()))
}
