//! A campaign: the dives of a place, their tables, and a session to ask them in.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use datafusion::arrow::array::RecordBatch;
use datafusion::arrow::array::cast::AsArray as _;
use datafusion::arrow::array::types::Int64Type;
use datafusion::datasource::MemTable;
use datafusion::datasource::file_format::parquet::ParquetFormat;
use datafusion::datasource::listing::{ListingOptions, ListingTable, ListingTableConfig, ListingTableUrl};
use datafusion::prelude::{SessionConfig, SessionContext};
use futures::{StreamExt as _, TryStreamExt as _};
use headrace_tables::{Parameters, TABLES, dive_key, program_version, schema};
use url::Url;

use crate::about::Abouts;
use crate::cache::{Cache, Found};
use crate::dives::dives_table;
use crate::error::{Error, of_file};
use crate::maker::{Made, Maker};
use crate::place::{DiveLog, Place};
use crate::provider::{ReplayFunction, Replayed};

/// Prefix of the tables of another program version.
pub const BEFORE: &str = "before_";

/// The dives of a place, with parameters.
#[derive(Debug)]
pub struct Campaign {
    /// Where the logs are.
    pub place: Place,
    /// The dives, in the order of their paths.
    pub dives: Vec<DiveLog>,
    /// Parameters of their replays.
    pub parameters: Parameters,
    /// Makes their tables.
    pub maker: Arc<Maker>,
    threads: usize,
}

/// A campaign's dives as made.
#[derive(Debug)]
pub struct Finished {
    /// Each dive with its tables; of copies of a log, the first.
    pub dives: Vec<(DiveLog, Made)>,
    /// Logs that are copies of another: both paths.
    pub copies: Vec<(String, String)>,
    /// Logs that `dives.csv` names and that aren't among the dives.
    pub unknown: Vec<String>,
    /// The table `dives`.
    pub table: RecordBatch,
}

impl Campaign {
    /// The dives of a place.
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
        Ok(Self { place, dives, parameters, maker, threads: threads.max(1) })
    }

    /// Every `of`-th dive, beginning with number `shard`, from 1.
    pub fn keep_shard(&mut self, shard: usize, of: usize) {
        let mut number = 0;
        self.dives.retain(|_| {
            number += 1;
            number % of == shard % of
        });
    }

    /// Makes the tables of all dives. `note` hears each that is done.
    ///
    /// Errors: the cache can't be written, or `dives.csv` is wrong. A dive that can't be replayed is no error.
    pub async fn make(&self, note: &mut dyn FnMut(&DiveLog, &Made)) -> Result<Finished, Error> {
        let about = Abouts::read(&self.place).await?;
        let logs: Vec<String> = self.dives.iter().map(|dive| dive.log.clone()).collect();
        let unknown = about.beyond(&logs).into_iter().map(str::to_owned).collect();
        let making = self.dives.iter().map(|dive| async move {
            let made = self.maker.make(&self.place, dive, &self.parameters).await?;
            Ok::<_, Error>((dive.clone(), made))
        });
        let mut making = futures::stream::iter(making).buffered(self.threads);
        let (mut first, mut dives, mut copies) = (BTreeMap::new(), Vec::new(), Vec::new());
        while let Some((dive, made)) = making.try_next().await? {
            note(&dive, &made);
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

    /// Replays at a time.
    pub fn threads(&self) -> usize {
        self.threads
    }

    /// What a table of all dives is of.
    pub fn replayed(&self, table: &str) -> Replayed {
        Replayed {
            place: self.place.url().to_string(),
            dives: self.dives.clone(),
            parameters: self.parameters.clone(),
            table: table.to_owned(),
            about: None,
        }
    }

    /// A session with the tables of these dives, those of `before`, and `replay`.
    ///
    /// Errors: a table can't be registered.
    pub fn session(&self, finished: &Finished, before: Option<&str>) -> Result<SessionContext, Error> {
        let config = SessionConfig::new().with_target_partitions(self.threads).with_information_schema(true);
        let session = SessionContext::new_with_config(config);
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
        let dives = MemTable::try_new(finished.table.schema(), vec![vec![finished.table.clone()]])?;
        session.register_table("dives", Arc::new(dives))?;
        for table in TABLES.into_iter().filter(|table| *table != "dives") {
            register_files(session, table, table, &folders)?;
        }
        let earlier = match before.map(ToOwned::to_owned).or_else(|| self.other_version()) {
            Some(version) => self.earlier(&version, finished),
            None => Vec::new(),
        };
        for table in TABLES {
            register_files(session, &format!("{BEFORE}{table}"), table, &earlier)?;
        }
        let function = ReplayFunction { maker: self.maker.clone(), all: self.replayed("sections") };
        session.register_udtf("replay", Arc::new(function));
        Ok(())
    }

    /// The program version, other than this, by which most dives of these parameters are in the cache.
    fn other_version(&self) -> Option<String> {
        let versions = std::fs::read_dir(self.maker.cache().folder()).ok()?.filter_map(Result::ok);
        let counted = versions.filter_map(|entry| {
            let name = entry.file_name().to_string_lossy().into_owned();
            let dives = std::fs::read_dir(entry.path().join(self.parameters.digest())).ok()?.count();
            (name != program_version()).then_some((dives, name))
        });
        counted.max().map(|(_, name)| name)
    }

    /// Folders of the dives as replayed by another version, where the cache has them whole.
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
    /// Numbers of dives that couldn't be replayed, and that lost data.
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

/// Registers a table of Parquet files, one of each dive's folder.
fn register_files(
    session: &SessionContext,
    name: &str,
    table: &'static str,
    folders: &[PathBuf],
) -> Result<(), Error> {
    let Some(schema) = schema(table) else { return Ok(()) };
    if folders.is_empty() {
        session.register_table(name, Arc::new(MemTable::try_new(schema, vec![Vec::new()])?))?;
        return Ok(());
    }
    let urls = folders.iter().map(|folder| file_url(&Cache::table(folder, table)));
    let options = ListingOptions::new(Arc::new(ParquetFormat::default())).with_file_extension(".parquet");
    let config = ListingTableConfig::new_with_multi_paths(urls.collect::<Result<_, _>>()?)
        .with_listing_options(options)
        .with_schema(schema);
    session.register_table(name, Arc::new(ListingTable::try_new(config)?))?;
    Ok(())
}

fn file_url(path: &Path) -> Result<ListingTableUrl, Error> {
    let wrong = |()| of_file("opening", path)(std::io::Error::other("isn't an absolute path"));
    let url = Url::from_file_path(path).map_err(wrong)?;
    Ok(ListingTableUrl::parse(url.as_str())?)
}
