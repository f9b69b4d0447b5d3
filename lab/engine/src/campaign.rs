//! A campaign: the dives of a place, their tables, and a session for queries.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use datafusion::arrow::array::RecordBatch;
use datafusion::arrow::array::cast::AsArray as _;
use datafusion::arrow::array::types::Int64Type;
use datafusion::arrow::datatypes::SchemaRef;
use datafusion::datasource::MemTable;
use datafusion::datasource::file_format::parquet::ParquetFormat;
use datafusion::datasource::listing::{ListingOptions, ListingTable, ListingTableConfig, ListingTableUrl};
use datafusion::error::DataFusionError;
use datafusion::prelude::{SessionConfig, SessionContext};
use futures::{StreamExt as _, TryStreamExt as _};
use headrace_tables::{Parameters, TABLES, dive_key, program_version, schema};
use tempfile::TempDir;
use url::Url;

use crate::about::Abouts;
use crate::cache::{Cache, Found, write};
use crate::dives::dives_table;
use crate::error::{Error, of_file};
use crate::maker::{Made, Maker, unread_dive};
use crate::place::{DiveLog, Place};
use crate::provider::{ReplayFunction, ReplayTable, Replayed};

/// Prefix of the tables of another program version.
pub const BEFORE: &str = "before_";

/// The dives of a folder or bucket, and the parameters with which they are replayed.
#[derive(Debug)]
pub struct Campaign {
    /// Location of the logs.
    pub place: Place,
    /// The dives, in the order of their paths.
    pub dives: Vec<DiveLog>,
    /// Parameters of the replays.
    pub parameters: Parameters,
    /// Makes the tables of dives, by replaying or from the cache.
    pub maker: Arc<Maker>,
    threads: usize,
    elsewhere: Option<Elsewhere>,
}

/// A session that runs in other processes, and a folder shared with these processes.
struct Elsewhere {
    session: SessionContext,
    folder: TempDir,
}

impl std::fmt::Debug for Elsewhere {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Elsewhere").field("folder", &self.folder).finish_non_exhaustive()
    }
}

/// The dives of a campaign with their tables.
#[derive(Debug)]
pub struct Finished {
    /// Each dive with its tables. If a log has several copies, only the first copy is included.
    pub dives: Vec<(DiveLog, Made)>,
    /// Logs that are copies of another log: path of the copy, path of the other log.
    pub copies: Vec<(String, String)>,
    /// Logs that `dives.csv` names but that are not among the dives.
    pub unknown: Vec<String>,
    /// The table `dives`, with a row for each dive.
    pub table: RecordBatch,
}

impl Campaign {
    /// Opens the dives of a place.
    ///
    /// Errors: a parameter is out of its range; the place can't be listed, or has no logs.
    pub async fn open(
        place: Place,
        parameters: Parameters,
        maker: Arc<Maker>,
        threads: usize,
    ) -> Result<Self, Error> {
        parameters.check()?;
        let dives = place.dives().await?;
        if dives.is_empty() {
            return Err(Error::NoLogs(place.url().to_string()));
        }
        Ok(Self { place, dives, parameters, maker, threads: threads.max(1), elsewhere: None })
    }

    /// Makes the campaign run replays and queries in a session of other processes, which use the same cache.
    ///
    /// Errors: a folder in the cache can't be made.
    pub fn send_to(&mut self, session: SessionContext) -> Result<(), Error> {
        let scratch = self.maker.cache().scratch();
        let folder = tempfile::tempdir_in(&scratch).map_err(of_file("making a folder in", &scratch))?;
        self.elsewhere = Some(Elsewhere { session, folder });
        Ok(())
    }

    /// Keeps every `of`-th dive, starting with dive number `shard` (counted from 1), and drops the others.
    pub fn keep_shard(&mut self, shard: usize, of: usize) {
        let mut number = 0;
        self.dives.retain(|_| {
            number += 1;
            number % of == shard % of
        });
    }

    /// Makes the tables of all dives; `note` is called for each finished dive.
    ///
    /// Errors: the cache can't be written, or `dives.csv` is invalid. A dive that can't be replayed isn't an error.
    pub async fn make(&self, note: &mut dyn FnMut(&DiveLog, &Made)) -> Result<Finished, Error> {
        let about = Abouts::read(&self.place).await?;
        let logs: Vec<String> = self.dives.iter().map(|dive| dive.log.clone()).collect();
        let unknown = about.beyond(&logs).into_iter().map(str::to_owned).collect();
        let (mut first, mut dives, mut copies) = (BTreeMap::new(), Vec::new(), Vec::new());
        for (dive, made) in self.made(note).await? {
            if let Made::Kept { sha256, .. } = &made
                && let Some(of) = first.insert(sha256.clone(), dive.log.clone())
            {
                first.insert(sha256.clone(), of.clone());
                copies.push((dive.log, of));
                continue;
            }
            dives.push((dive, made));
        }
        let table = dives_table(&dives, &about).await?;
        Ok(Finished { dives, copies, unknown, table })
    }

    /// Each dive with its tables, in the order of the dives' paths.
    async fn made(&self, note: &mut dyn FnMut(&DiveLog, &Made)) -> Result<Vec<(DiveLog, Made)>, Error> {
        let mut sent = match &self.elsewhere {
            Some(elsewhere) => self.made_by(&elsewhere.session).await?,
            None => BTreeMap::new(),
        };
        let making = self.dives.iter().map(|dive| {
            let sent = sent.remove(&dive.log);
            async move {
                let made = match sent {
                    Some(made) => made,
                    None => self.maker.make(&self.place, dive, &self.parameters).await?,
                };
                Ok::<_, Error>((dive.clone(), made))
            }
        });
        let mut making = futures::stream::iter(making).buffered(self.threads);
        let mut all = Vec::new();
        while let Some((dive, made)) = making.try_next().await? {
            note(&dive, &made);
            all.push((dive, made));
        }
        Ok(all)
    }

    /// Makes the processes of a session replay the dives that are missing from the cache; returns all dives by log.
    ///
    /// If a process ends early, its answers are lost, but its finished dives are in the cache. The other dives are sent
    /// again, as long as fewer are missing each time.
    async fn made_by(&self, session: &SessionContext) -> Result<BTreeMap<String, Made>, Error> {
        let (mut made, mut wanted) = self.looked_for(self.dives.clone()).await?;
        self.maker.counts().add(wanted.len(), made.len());
        while !wanted.is_empty() {
            match self.replayed_by(session, &wanted).await {
                Ok(replayed) => {
                    made.extend(replayed);
                    wanted.clear();
                }
                Err(error) => {
                    let sent = wanted.len();
                    let (kept, missing) = self.looked_for(wanted).await?;
                    if missing.len() == sent {
                        return Err(error);
                    }
                    eprintln!("headrace-campaign: {error}; {} of {sent} dives are sent again", missing.len());
                    made.extend(kept);
                    wanted = missing;
                }
            }
        }
        Ok(made)
    }

    /// Divides dives into those in the cache, returned by log, and those that must be replayed.
    async fn looked_for(&self, dives: Vec<DiveLog>) -> Result<(BTreeMap<String, Made>, Vec<DiveLog>), Error> {
        let looking = dives.into_iter().map(|dive| async move {
            let kept = self.maker.kept(&self.place, &dive, &self.parameters).await?;
            Ok::<_, Error>((dive, kept))
        });
        let mut looking = futures::stream::iter(looking).buffered(self.threads);
        let (mut found, mut missing) = (BTreeMap::new(), Vec::new());
        while let Some((dive, kept)) = looking.try_next().await? {
            match kept {
                Some(made) => _ = found.insert(dive.log, made),
                None => missing.push(dive),
            }
        }
        Ok((found, missing))
    }

    /// Makes the processes of a session replay dives; returns the dives by log.
    async fn replayed_by(
        &self,
        session: &SessionContext,
        dives: &[DiveLog],
    ) -> Result<BTreeMap<String, Made>, Error> {
        let replayed = Replayed { dives: dives.to_vec(), ..self.replayed("dives") };
        let table = Arc::new(ReplayTable::new(self.maker.clone(), replayed)?);
        let rows = session.read_table(table)?.select_columns(&["log", "log_sha256", "error"])?;
        let by_log: BTreeMap<&str, &DiveLog> = dives.iter().map(|dive| (dive.log.as_str(), dive)).collect();
        let mut made = BTreeMap::new();
        for rows in rows.collect().await? {
            let texts = |name: &str| rows.column_by_name(name).and_then(|of| of.as_string_opt::<i32>());
            let (Some(logs), Some(digests), Some(errors)) =
                (texts("log"), texts("log_sha256"), texts("error"))
            else {
                return Err(
                    DataFusionError::Internal(format!("{} isn't a table of dives", rows.schema())).into()
                );
            };
            for ((log, sha256), error) in logs.iter().zip(digests).zip(errors) {
                let Some(dive) = log.and_then(|log| by_log.get(log)) else { continue };
                let sha256 = sha256.unwrap_or_default();
                let of = match error {
                    Some(error) => unread_dive(dive, sha256, &self.parameters, error)?,
                    None => self.seen(sha256)?,
                };
                made.insert(dive.log.clone(), of);
            }
        }
        Ok(made)
    }

    /// Finds a dive that another process has replayed.
    ///
    /// Errors: the dive is not in this process's cache.
    fn seen(&self, sha256: &str) -> Result<Made, Error> {
        let folder = self.maker.cache().dive(&self.parameters.digest(), sha256);
        if !folder.exists() {
            let (folder, cache) = (folder.display(), self.maker.cache().folder().display());
            let why =
                "is missing, although an executor has written it; all machines must share one --cache folder";
            return Err(Error::Usage(format!("{folder} {why}; on this machine it is {cache}")));
        }
        Ok(Made::Kept { sha256: sha256.to_owned(), folder })
    }

    /// Number of replays that run at the same time.
    pub fn threads(&self) -> usize {
        self.threads
    }

    /// Describes a table of all dives by name, so that any process can make it.
    pub fn replayed(&self, table: &str) -> Replayed {
        Replayed {
            place: self.place.url().to_string(),
            dives: self.dives.clone(),
            parameters: self.parameters.clone(),
            table: table.to_owned(),
        }
    }

    /// Creates a session with the tables of these dives, the tables of version `before`, and the function `replay`.
    ///
    /// Errors: a table can't be registered.
    pub fn session(&self, finished: &Finished, before: Option<&str>) -> Result<SessionContext, Error> {
        let session = if let Some(elsewhere) = &self.elsewhere {
            elsewhere.session.clone()
        } else {
            let config = SessionConfig::new().with_target_partitions(self.threads);
            SessionContext::new_with_config(config.with_information_schema(true))
        };
        self.register(&session, finished, before)?;
        Ok(session)
    }

    /// Registers the tables in a session.
    ///
    /// Errors: a table can't be registered.
    pub fn register(
        &self,
        session: &SessionContext,
        finished: &Finished,
        before: Option<&str>,
    ) -> Result<(), Error> {
        let folders: Vec<PathBuf> = finished.dives.iter().filter_map(|(_, made)| folder(made)).collect();
        self.register_batch(session, "dives", finished.table.clone())?;
        for table in TABLES.into_iter().filter(|table| *table != "dives") {
            self.register_files(session, table, table, &folders)?;
        }
        let earlier = match before.map(ToOwned::to_owned).or_else(|| self.other_version()) {
            Some(version) => self.earlier(&version, finished),
            None => Vec::new(),
        };
        for table in TABLES {
            self.register_files(session, &format!("{BEFORE}{table}"), table, &earlier)?;
        }
        let function = ReplayFunction { maker: self.maker.clone(), all: self.replayed("sections") };
        session.register_udtf("replay", Arc::new(function));
        Ok(())
    }

    /// Registers a table of Parquet files, one from each dive's folder.
    fn register_files(
        &self,
        session: &SessionContext,
        name: &str,
        table: &'static str,
        folders: &[PathBuf],
    ) -> Result<(), Error> {
        let Some(schema) = schema(table) else { return Ok(()) };
        if folders.is_empty() {
            return self.register_batch(session, name, RecordBatch::new_empty(schema));
        }
        register_listed(session, name, schema, folders.iter().map(|folder| Cache::table(folder, table)))
    }

    /// Registers rows as a table. Other processes can't read this process's memory, so the rows are written to a file
    /// for them.
    fn register_batch(&self, session: &SessionContext, name: &str, rows: RecordBatch) -> Result<(), Error> {
        let Some(elsewhere) = &self.elsewhere else {
            let table = MemTable::try_new(rows.schema(), vec![vec![rows]])?;
            session.register_table(name, Arc::new(table))?;
            return Ok(());
        };
        let path = Cache::table(elsewhere.folder.path(), name);
        write(&path, &rows)?;
        register_listed(session, name, rows.schema(), std::iter::once(path))
    }

    /// The program version with the most dives in the cache for the campaign's parameters, apart from this program's
    /// version.
    fn other_version(&self) -> Option<String> {
        let versions = std::fs::read_dir(self.maker.cache().folder()).ok()?.filter_map(Result::ok);
        let counted = versions.filter_map(|entry| {
            let name = entry.file_name().to_string_lossy().into_owned();
            let dives = std::fs::read_dir(entry.path().join(self.parameters.digest())).ok()?.count();
            (name != program_version()).then_some((dives, name))
        });
        counted.max().map(|(_, name)| name)
    }

    /// Folders of the dives as replayed by another version. Only complete dives are included.
    fn earlier(&self, version: &str, finished: &Finished) -> Vec<PathBuf> {
        let folder = self.maker.cache().folder().join(version).join(self.parameters.digest());
        let kept = finished.dives.iter().filter_map(|(_, made)| match made {
            Made::Kept { sha256, .. } => Some(folder.join(dive_key(sha256))),
            Made::Unread(_) => None,
        });
        kept.filter(|dive| Cache::look(dive) == Found::Whole).collect()
    }
}

impl Finished {
    /// Number of dives that couldn't be replayed, and number of dives that lost data.
    pub fn failures(&self) -> (usize, usize) {
        let codes = self.table.column_by_name("exit_code");
        let codes = codes.and_then(|codes| codes.as_primitive_opt::<Int64Type>());
        let count =
            |code: i64| codes.map_or(0, |codes| codes.values().iter().filter(|of| **of == code).count());
        (count(2), count(3))
    }
}

fn folder(made: &Made) -> Option<PathBuf> {
    match made {
        Made::Kept { folder, .. } => Some(folder.clone()),
        Made::Unread(_) => None,
    }
}

/// Registers a table of Parquet files.
fn register_listed(
    session: &SessionContext,
    name: &str,
    schema: SchemaRef,
    files: impl Iterator<Item = PathBuf>,
) -> Result<(), Error> {
    let urls = files.map(|path| file_url(&path)).collect::<Result<_, _>>()?;
    let options = ListingOptions::new(Arc::new(ParquetFormat::default())).with_file_extension(".parquet");
    let config =
        ListingTableConfig::new_with_multi_paths(urls).with_listing_options(options).with_schema(schema);
    session.register_table(name, Arc::new(ListingTable::try_new(config)?))?;
    Ok(())
}

fn file_url(path: &Path) -> Result<ListingTableUrl, Error> {
    let wrong = |()| of_file("opening", path)(std::io::Error::other("isn't an absolute path"));
    let url = Url::from_file_path(path).map_err(wrong)?;
    Ok(ListingTableUrl::parse(url.as_str())?)
}
