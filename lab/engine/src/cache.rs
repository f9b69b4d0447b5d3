//! Caches tables of dives as Parquet files, by program version, parameters and the log's digest.
//!
//! The files are `CACHE/VERSION/PARAMETERS/DIVE/sections.parquet` and so on. A dive's folder is built elsewhere and
//! then renamed. It therefore exists completely or not at all, even if a process is killed. The folder's `whole.json`
//! has the length and digest of each file. If a file differs from its digest, the dive is replayed again. `CACHE/known`
//! stores the digests of logs by path, length and modification time.

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::Read as _;
use std::path::{Path, PathBuf};

use datafusion::arrow::array::RecordBatch;
use datafusion::parquet::arrow::ArrowWriter;
use datafusion::parquet::basic::{Compression, ZstdLevel};
use datafusion::parquet::file::properties::WriterProperties;
use headrace_tables::{TABLES, Tables, dive_key, program_version};
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use crate::error::{Error, of_file};
use crate::place::DiveLog;

/// Name of the file that lists a dive's files.
const WHOLE: &str = "whole.json";
/// Folder for dives whose files are still being written.
const SCRATCH: &str = "unfinished";
/// Folder for the digests of logs.
const KNOWN: &str = "known";

/// A folder of finished dives. Several processes may use it at the same time.
#[derive(Debug, Clone)]
pub struct Cache {
    folder: PathBuf,
}

/// Length and digest of a file as written.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
struct Written {
    bytes: u64,
    sha256: String,
}

/// State of a dive in the cache.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Found {
    /// All files of the dive are present and unchanged.
    Whole,
    /// The cache has no files of the dive.
    Nothing,
    /// A file has changed since the dive was stored; the text describes the change.
    Broken(String),
}

impl Cache {
    /// Opens a cache in a folder, and creates the folder if necessary.
    ///
    /// Errors: the folder can't be created.
    pub fn open(folder: &Path) -> Result<Self, Error> {
        for name in [SCRATCH, KNOWN] {
            let path = folder.join(name);
            fs::create_dir_all(&path).map_err(of_file("making the folder", &path))?;
        }
        let folder = folder.canonicalize().map_err(of_file("opening", folder))?;
        Ok(Self { folder })
    }

    /// Folder of the cache.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// Folder for dives whose files are still being written.
    pub fn scratch(&self) -> PathBuf {
        self.folder.join(SCRATCH)
    }

    /// The folder of a dive replayed by this program version.
    pub fn dive(&self, parameters: &str, sha256: &str) -> PathBuf {
        self.folder.join(program_version()).join(parameters).join(dive_key(sha256))
    }

    /// A table's file in a dive's folder.
    pub fn table(dive: &Path, table: &str) -> PathBuf {
        dive.join(format!("{table}.parquet"))
    }

    /// Checks a dive's folder. The check reads all files.
    pub fn look(dive: &Path) -> Found {
        let whole = match fs::read_to_string(dive.join(WHOLE)) {
            Ok(text) => text,
            Err(_) if !dive.exists() => return Found::Nothing,
            Err(error) => return Found::Broken(format!("{WHOLE}: {error}")),
        };
        let Ok(written) = serde_json::from_str::<BTreeMap<String, Written>>(&whole) else {
            return Found::Broken(format!("{WHOLE} differs from the written file"));
        };
        for table in TABLES {
            let path = Self::table(dive, table);
            match digest(&path) {
                Err(error) => return Found::Broken(format!("{table}.parquet: {error}")),
                Ok(there) if written.get(table) != Some(&there) => {
                    return Found::Broken(format!("{table}.parquet differs from the written file"));
                }
                Ok(_) => {}
            }
        }
        Found::Whole
    }

    /// Stores a dive's tables, unless another process has already stored them.
    ///
    /// Errors: the tables can't be written.
    pub fn keep(&self, dive: &Path, tables: &Tables) -> Result<(), Error> {
        let scratch = self.scratch();
        let beside = tempfile::tempdir_in(&scratch).map_err(of_file("making a folder in", &scratch))?;
        let mut written = BTreeMap::new();
        for table in TABLES {
            let path = Self::table(beside.path(), table);
            if let Some(batch) = tables.get(table) {
                write(&path, batch)?;
            }
            written.insert(table, digest(&path).map_err(of_file("reading back", &path))?);
        }
        let path = beside.path().join(WHOLE);
        let text =
            serde_json::to_string(&written).map_err(|error| of_file("writing", &path)(error.into()))?;
        fs::write(&path, text).map_err(of_file("writing", &path))?;
        if let Some(parent) = dive.parent() {
            fs::create_dir_all(parent).map_err(of_file("making the folder", parent))?;
        }
        match fs::rename(beside.path(), dive) {
            Ok(()) => {
                // `keep` prevents an attempt to remove the temporary folder, which has just been renamed.
                let _gone = beside.keep();
                Ok(())
            }
            Err(_) if Self::look(dive) == Found::Whole => Ok(()),
            Err(error) => Err(of_file("renaming to", dive)(error)),
        }
    }

    /// Moves a broken dive's folder away and removes it.
    ///
    /// Errors: the folder can't be moved.
    pub fn discard(&self, dive: &Path) -> Result<(), Error> {
        let scratch = self.scratch();
        let beside = tempfile::tempdir_in(&scratch).map_err(of_file("making a folder in", &scratch))?;
        match fs::rename(dive, beside.path().join("broken")) {
            Err(error) if error.kind() != std::io::ErrorKind::NotFound => {
                Err(of_file("moving away", dive)(error))
            }
            _ => Ok(()),
        }
    }

    /// Finds the stored digest of a log; `None` if the log has changed since it was stored.
    pub fn known(&self, place: &str, dive: &DiveLog) -> Option<String> {
        let text = fs::read_to_string(self.known_path(place, dive)).ok()?;
        Some(text).filter(|text| text.len() == 64 && text.bytes().all(|byte| byte.is_ascii_hexdigit()))
    }

    /// Stores the digest of a log.
    ///
    /// Errors: the digest can't be written.
    pub fn remember(&self, place: &str, dive: &DiveLog, sha256: &str) -> Result<(), Error> {
        let (path, scratch) = (self.known_path(place, dive), self.scratch());
        let file =
            tempfile::NamedTempFile::new_in(&scratch).map_err(of_file("making a file in", &scratch))?;
        fs::write(file.path(), sha256).map_err(of_file("writing", file.path()))?;
        file.persist(&path).map_err(|error| of_file("renaming to", &path)(error.error))?;
        Ok(())
    }

    fn known_path(&self, place: &str, dive: &DiveLog) -> PathBuf {
        let mut hasher = Sha256::new();
        let mut put = |text: &str| {
            hasher.update((text.len() as u64).to_le_bytes());
            hasher.update(text.as_bytes());
        };
        put(place);
        for part in &dive.parts {
            put(&part.path);
            put(&part.bytes.to_string());
            put(&part.modified_us.to_string());
            put(part.e_tag.as_deref().unwrap_or_default());
        }
        self.folder.join(KNOWN).join(hex(&hasher.finalize()))
    }
}

/// Writes a Parquet file.
///
/// Errors: the file can't be written.
pub(crate) fn write(path: &Path, batch: &RecordBatch) -> Result<(), Error> {
    let file = File::create(path).map_err(of_file("writing", path))?;
    let level = ZstdLevel::default();
    let properties = WriterProperties::builder().set_compression(Compression::ZSTD(level)).build();
    let failed = |source| Error::Parquet { doing: "writing", path: path.to_owned(), source };
    let mut writer = ArrowWriter::try_new(file, batch.schema(), Some(properties)).map_err(failed)?;
    writer.write(batch).map_err(failed)?;
    writer.close().map_err(failed)?;
    Ok(())
}

fn digest(path: &Path) -> std::io::Result<Written> {
    let (mut file, mut hasher, mut block) = (File::open(path)?, Sha256::new(), vec![0; 1 << 16]);
    let mut bytes = 0;
    loop {
        match file.read(&mut block) {
            Ok(0) => break,
            Ok(len) => {
                hasher.update(block.get(..len).unwrap_or_default());
                bytes += len as u64;
            }
            Err(error) if error.kind() == std::io::ErrorKind::Interrupted => {}
            Err(error) => return Err(error),
        }
    }
    Ok(Written { bytes, sha256: hex(&hasher.finalize()) })
}

#[expect(clippy::format_collect, reason = "a few bytes")]
fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}
