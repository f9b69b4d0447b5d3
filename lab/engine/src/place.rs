//! The location of the logs: a folder, or a bucket of an object store.

use std::collections::BTreeMap;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use futures::{StreamExt as _, TryStreamExt as _};
use headrace_replay::log::part_path;
use object_store::path::Path as StorePath;
use object_store::{ObjectStore, ObjectStoreExt as _};
use percent_encoding::percent_decode_str;
use serde::{Deserialize, Serialize};
use url::Url;

use crate::error::{Error, of_file};

/// Highest part number that is recognised in the file name of a recording's part.
const MOST_PARTS: u32 = 999;

/// A folder of logs, on this machine or in an object store.
#[derive(Debug, Clone)]
pub struct Place {
    /// URL of the folder or bucket, ending in `/`.
    url: Url,
    store: Arc<dyn ObjectStore>,
    prefix: StorePath,
    /// The folder, if the place is on this machine.
    folder: Option<PathBuf>,
}

/// A dive of a campaign: a log, or the parts of a recording in order.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct DiveLog {
    /// Path of the log, relative to the place. A recording in parts has the path of the whole recording.
    pub log: String,
    /// Files of the dive, in the order of the recording.
    pub parts: Vec<Part>,
}

/// A file of a dive, with attributes that change if the content changes.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Part {
    /// Path of the file relative to the place, in the store's encoding.
    pub path: String,
    /// Length of the file, bytes.
    pub bytes: u64,
    /// Time of the last modification, microseconds of UTC.
    pub modified_us: i64,
    /// The object store's tag for this version of the content (ETag), if any.
    pub e_tag: Option<String>,
}

/// Local files of a dive. Dropping this value removes copied files.
pub struct Fetched {
    /// The files, in the order of the recording.
    pub files: Vec<PathBuf>,
    _copy: Option<tempfile::TempDir>,
}

impl Place {
    /// Opens a folder, or `s3://BUCKET/PREFIX`.
    ///
    /// Keys and endpoint of a bucket come from the environment (`AWS_ACCESS_KEY_ID`, ...).
    ///
    /// Errors: the folder doesn't exist; the URL is invalid, or its store isn't supported.
    pub fn open(text: &str) -> Result<Self, Error> {
        let failed = |why: String| Error::Place { place: text.to_owned(), why };
        let mut folder = None;
        let url = match Url::parse(text).ok().filter(|_| text.contains("://")) {
            Some(url) if url.scheme() == "file" => {
                folder = Some(url.to_file_path().map_err(|()| failed("isn't a path".to_owned()))?);
                url
            }
            Some(url) => url,
            None => {
                let path = Path::new(text).canonicalize().map_err(|error| failed(error.to_string()))?;
                if !path.is_dir() {
                    return Err(failed("isn't a folder".to_owned()));
                }
                let url = Url::from_directory_path(&path).map_err(|()| failed("isn't a path".to_owned()))?;
                folder = Some(path);
                url
            }
        };
        let mut url = url;
        if !url.path().ends_with('/') {
            url.set_path(&format!("{}/", url.path()));
        }
        let settings = std::env::vars().filter(|(key, _)| key.starts_with("AWS_"));
        let settings = settings.map(|(key, value)| (key.to_ascii_lowercase(), value));
        let (store, prefix) =
            object_store::parse_url_opts(&url, settings).map_err(|error| failed(error.to_string()))?;
        Ok(Self { url, store: Arc::from(store), prefix, folder })
    }

    /// URL of the folder or bucket.
    pub fn url(&self) -> &Url {
        &self.url
    }

    /// Dives of the place, in the order of their paths.
    ///
    /// Errors: the place can't be listed.
    pub async fn dives(&self) -> Result<Vec<DiveLog>, Error> {
        let failed = |source| Error::Store { what: self.url.to_string(), source };
        let mut parts: BTreeMap<String, Part> = BTreeMap::new();
        let mut listed = self.store.list(Some(&self.prefix));
        while let Some(meta) = listed.next().await {
            let meta = meta.map_err(failed)?;
            if meta.location.extension() != Some("mcap") {
                continue;
            }
            let Some(below) = meta.location.prefix_match(&self.prefix) else { continue };
            let path = below.map(|part| part.as_ref().to_owned()).collect::<Vec<_>>().join("/");
            let (bytes, modified_us) = (meta.size, meta.last_modified.timestamp_micros());
            parts.insert(path.clone(), Part { path, bytes, modified_us, e_tag: meta.e_tag });
        }
        Ok(grouped(parts))
    }

    /// Reads a small text file of the place; `None` if there is no such file.
    ///
    /// Errors: the file can't be read.
    pub async fn text(&self, name: &str) -> Result<Option<String>, Error> {
        let what = format!("{}{name}", self.url);
        let failed = |source| Error::Store { what: what.clone(), source };
        let location = self.location(name).map_err(failed)?;
        let got = match self.store.get(&location).await {
            Ok(got) => got.bytes().await,
            Err(object_store::Error::NotFound { .. }) => return Ok(None),
            Err(source) => Err(source),
        };
        let bytes = got.map_err(failed)?;
        let text = String::from_utf8(bytes.to_vec());
        text.map(Some).map_err(|_| Error::Place { place: what, why: "isn't UTF-8 text".to_owned() })
    }

    /// Returns the files of a dive on this machine: the original files, or copies in a folder of `scratch`.
    ///
    /// Copies last as long as the returned value.
    ///
    /// Errors: the files can't be read, or a copy can't be written.
    pub async fn fetch(&self, dive: &DiveLog, scratch: &Path) -> Result<Fetched, Error> {
        if let Some(folder) = &self.folder {
            let files = dive.parts.iter().map(|part| folder.join(plain(&part.path)));
            return Ok(Fetched { files: files.collect(), _copy: None });
        }
        let copy = tempfile::tempdir_in(scratch).map_err(of_file("making a folder in", scratch))?;
        let mut files = Vec::new();
        for (number, part) in dive.parts.iter().enumerate() {
            let failed = |source| Error::Store { what: format!("{}{}", self.url, part.path), source };
            // The copies have other names, because a path in the store may not be valid on this machine.
            let path = copy.path().join(format!("{number:03}.mcap"));
            let mut file = std::fs::File::create(&path).map_err(of_file("writing", &path))?;
            let location = self.location(&part.path).map_err(failed)?;
            let mut stream = self.store.get(&location).await.map_err(failed)?.into_stream();
            while let Some(bytes) = stream.try_next().await.map_err(failed)? {
                file.write_all(&bytes).map_err(of_file("writing", &path))?;
            }
            files.push(path);
        }
        Ok(Fetched { files, _copy: Some(copy) })
    }

    /// Converts a path relative to the place to a path in the store.
    ///
    /// Errors: none for a listed path.
    fn location(&self, below: &str) -> Result<StorePath, object_store::Error> {
        let slash = if self.prefix.as_ref().is_empty() { "" } else { "/" };
        Ok(StorePath::parse(format!("{}{slash}{below}", self.prefix))?)
    }
}

/// Decodes a path to readable text, because stores encode some characters.
fn plain(path: &str) -> String {
    percent_decode_str(path).decode_utf8_lossy().into_owned()
}

/// Groups files into dives; the parts of a recording are one dive.
fn grouped(parts: BTreeMap<String, Part>) -> Vec<DiveLog> {
    let mut dives: BTreeMap<String, Vec<(u32, Part)>> = BTreeMap::new();
    for (path, part) in parts {
        let (log, number) = recording(&path).unwrap_or((path, 0));
        dives.entry(log).or_default().push((number, part));
    }
    let dive = |(log, mut parts): (String, Vec<(u32, Part)>)| {
        parts.sort_by_key(|(number, _)| *number);
        DiveLog { log: plain(&log), parts: parts.into_iter().map(|(_, part)| part).collect() }
    };
    dives.into_iter().map(dive).collect()
}

/// The recording that a file belongs to, and the number of the part; `None` if the file is not a part.
fn recording(path: &str) -> Option<(String, u32)> {
    let stem = path.strip_suffix(".mcap")?;
    let (_, digits) = stem.rsplit_once(|c: char| !c.is_ascii_digit())?;
    let number = digits.parse().ok().filter(|number| (1..=MOST_PARTS).contains(number))?;
    let mark = part_path(Path::new("x.mcap"), number).to_string_lossy().into_owned();
    let log = format!("{}.mcap", path.strip_suffix(mark.strip_prefix('x')?)?);
    Some((log, number))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_of_a_recording_are_one_dive() {
        let part = |path: &str| Part { path: path.to_owned(), bytes: 1, modified_us: 2, e_tag: None };
        let names = [
            "a/x.part010.mcap",
            "a/x.part002.mcap",
            "a/x.mcap",
            "b/y7.mcap",
            "b/z.part003.mcap",
            "part.mcap",
        ];
        let found = grouped(names.iter().map(|name| ((*name).to_owned(), part(name))).collect());
        let found: Vec<String> = found
            .iter()
            .map(|dive| {
                format!(
                    "{}: {}",
                    dive.log,
                    dive.parts.iter().map(|part| part.path.as_str()).collect::<Vec<_>>().join(" ")
                )
            })
            .collect();
        assert_eq!(
            found,
            [
                "a/x.mcap: a/x.mcap a/x.part002.mcap a/x.part010.mcap",
                "b/y7.mcap: b/y7.mcap",
                "b/z.mcap: b/z.part003.mcap",
                "part.mcap: part.mcap",
            ]
        );
    }
}
