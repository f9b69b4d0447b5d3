//! Makes a dive's tables: reads them from the cache, or replays the log and stores them.

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use datafusion::arrow::array::RecordBatch;
use datafusion::parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;
use headrace_tables::{Parameters, Tables, log_digest, replay_digested, unread};
use tokio::sync::{Semaphore, SemaphorePermit};

use crate::cache::{Cache, Found};
use crate::error::{Error, of_file};
use crate::place::{DiveLog, Place};

/// Makes tables, with a limited number of simultaneous replays.
#[derive(Debug)]
pub struct Maker {
    cache: Cache,
    threads: Arc<Semaphore>,
    counts: Arc<Counts>,
}

/// Counts of the dives that a maker has replayed or has found in the cache.
#[derive(Debug, Default)]
pub struct Counts {
    replayed: AtomicU64,
    cached: AtomicU64,
    broken: AtomicU64,
}

impl Counts {
    /// Number of dives that were replayed.
    pub fn replayed(&self) -> u64 {
        self.replayed.load(Ordering::Relaxed)
    }

    /// Adds the numbers of dives that another process replayed or found in the cache.
    pub fn add(&self, replayed: usize, cached: usize) {
        self.replayed.fetch_add(replayed as u64, Ordering::Relaxed);
        self.cached.fetch_add(cached as u64, Ordering::Relaxed);
    }

    /// Number of dives whose tables were in the cache.
    pub fn cached(&self) -> u64 {
        self.cached.load(Ordering::Relaxed)
    }

    /// Number of dives whose tables in the cache were broken and were made again.
    pub fn broken(&self) -> u64 {
        self.broken.load(Ordering::Relaxed)
    }
}

/// Tables of a dive.
#[derive(Debug, Clone)]
pub enum Made {
    /// The tables are in the cache.
    Kept {
        /// SHA-256 of the log.
        sha256: String,
        /// Folder of the Parquet files.
        folder: PathBuf,
    },
    /// There are no tables, because the log can't be read or replayed. The row of `dives` gives the reason.
    Unread(Arc<Tables>),
}

impl Maker {
    /// Creates a maker with a cache, for `threads` simultaneous replays.
    pub fn new(cache: Cache, threads: usize) -> Self {
        Self { cache, threads: Arc::new(Semaphore::new(threads.max(1))), counts: Arc::default() }
    }

    /// Cache that this maker uses.
    pub fn cache(&self) -> &Cache {
        &self.cache
    }

    /// Counts of dives replayed so far, and of dives found in the cache.
    pub fn counts(&self) -> &Counts {
        &self.counts
    }

    /// Makes a dive's tables, or finds them in the cache; waits for a free thread.
    ///
    /// Errors: the cache can't be written, or the store can't be read. A log that can't be replayed is
    /// [`Made::Unread`].
    pub async fn make(&self, place: &Place, dive: &DiveLog, parameters: &Parameters) -> Result<Made, Error> {
        let _turn = self.turn().await?;
        let url = place.url().to_string();
        let known = self.cache.known(&url, dive);
        if let Some(sha256) = &known
            && let Some(made) = self.find(sha256.clone(), parameters).await?
        {
            self.counts.add(0, 1);
            return Ok(made);
        }
        let fetched = match place.fetch(dive, &self.cache.scratch()).await {
            Err(error @ Error::Store { .. }) => {
                return unread_dive(
                    dive,
                    known.as_deref().unwrap_or_default(),
                    parameters,
                    &error.to_string(),
                );
            }
            fetched => fetched?,
        };
        let files = fetched.files.clone();
        let sha256 = match blocking(move || log_digest(&files)).await? {
            Ok(sha256) => sha256,
            Err(error) => return unread_dive(dive, "", parameters, &error.to_string()),
        };
        if known.as_ref() != Some(&sha256) {
            self.cache.remember(&url, dive, &sha256)?;
            if let Some(made) = self.find(sha256.clone(), parameters).await? {
                self.counts.add(0, 1);
                return Ok(made);
            }
        }
        let (files, asked) = (fetched.files.clone(), parameters.clone());
        let (named, digest) = (dive.log.clone(), sha256.clone());
        let replayed = match blocking(move || replay_digested(&files, &named, &digest, &asked)).await {
            Ok(replayed) => replayed.map_err(|error| error.to_string()),
            Err(error) => Err(error.to_string()),
        };
        drop(fetched);
        self.counts.add(1, 0);
        let tables = match replayed {
            Ok(tables) => tables,
            Err(error) => return unread_dive(dive, &sha256, parameters, &error),
        };
        let (cache, folder) = (self.cache.clone(), self.cache.dive(&parameters.digest(), &sha256));
        let kept = folder.clone();
        blocking(move || cache.keep(&kept, &tables)).await??;
        Ok(Made::Kept { sha256, folder })
    }

    /// Finds a dive's tables in the cache; `None` if the log's digest is unknown or the dive is missing from the
    /// cache.
    ///
    /// Waits for a free thread. The dive isn't added to the counts of replayed or cached dives.
    ///
    /// Errors: a broken dive in the cache can't be removed.
    pub async fn kept(
        &self,
        place: &Place,
        dive: &DiveLog,
        parameters: &Parameters,
    ) -> Result<Option<Made>, Error> {
        let _turn = self.turn().await?;
        match self.cache.known(place.url().as_str(), dive) {
            Some(sha256) => self.find(sha256, parameters).await,
            None => Ok(None),
        }
    }

    async fn turn(&self) -> Result<SemaphorePermit<'_>, Error> {
        self.threads.acquire().await.map_err(|error| Error::Usage(error.to_string()))
    }

    /// Finds a dive in the cache. A broken dive is removed and counts as missing.
    async fn find(&self, sha256: String, parameters: &Parameters) -> Result<Option<Made>, Error> {
        let folder = self.cache.dive(&parameters.digest(), &sha256);
        let looked = folder.clone();
        match blocking(move || Cache::look(&looked)).await? {
            Found::Whole => Ok(Some(Made::Kept { sha256, folder })),
            Found::Nothing => Ok(None),
            Found::Broken(why) => {
                eprintln!("headrace-campaign: {}: {why}; replaying it again", folder.display());
                self.counts.broken.fetch_add(1, Ordering::Relaxed);
                self.cache.discard(&folder)?;
                Ok(None)
            }
        }
    }
}

impl Made {
    /// Reads a table from the cache.
    ///
    /// Errors: the table can't be read.
    pub async fn table(&self, table: &'static str) -> Result<Vec<RecordBatch>, Error> {
        match self {
            Self::Unread(tables) => Ok(tables.get(table).cloned().into_iter().collect()),
            Self::Kept { folder, .. } => {
                let path = Cache::table(folder, table);
                blocking(move || {
                    let file = std::fs::File::open(&path).map_err(of_file("reading", &path))?;
                    let failed = |source| Error::Parquet { doing: "reading", path: path.clone(), source };
                    let reader = ParquetRecordBatchReaderBuilder::try_new(file).map_err(failed)?;
                    let reader = reader.build().map_err(failed)?;
                    reader.collect::<Result<Vec<_>, _>>().map_err(|error| failed(error.into()))
                })
                .await?
            }
        }
    }
}

/// Makes the tables of a dive that can't be read or replayed.
///
/// Errors: the row of `dives` can't be made.
pub(crate) fn unread_dive(
    dive: &DiveLog,
    sha256: &str,
    parameters: &Parameters,
    error: &str,
) -> Result<Made, Error> {
    Ok(Made::Unread(Arc::new(unread(&dive.log, sha256, parameters, error)?)))
}

/// Runs long work on a thread of its own. A panic of the work becomes an error.
async fn blocking<T: Send + 'static>(work: impl FnOnce() -> T + Send + 'static) -> Result<T, Error> {
    tokio::task::spawn_blocking(work)
        .await
        .map_err(|error| Error::Usage(format!("a thread ended early: {error}")))
}
