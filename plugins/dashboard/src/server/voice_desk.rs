//! Voice notes that wait for their recording, and recordings kept in memory.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use axum::http::StatusCode;
use headrace_monitor::voice::Voice;
use tokio::sync::Semaphore;

use super::budget::Budget;

/// Maximum number of voice notes that wait for their recording. If there are more, the oldest note is forgotten.
const MOST_BEGUN: usize = 32;
/// Maximum size of recordings kept in memory for playing, bytes. The oldest are dropped from memory but stay in the
/// log.
const MOST_HELD_BYTES: usize = 16 << 20;
/// Maximum number of recordings that clients may upload at the same time.
const MOST_COMING: usize = 2;
/// Budget of recordings' uploads: burst, and refill per second.
const RATE: (f64, f64) = (8.0, 0.2);
/// Handler that logs the recording of a voice note and then notifies the loop. Its error is the reason for a
/// refusal.
pub type Keep = Arc<dyn Fn(&Voice) -> Result<(), String> + Send + Sync>;
/// Handler that finds a voice note's recording in a log, by the note's id and time, seconds.
///
/// Returns `None` if the log has no readable recording of the note. The search may take seconds.
pub type Recall = Arc<dyn Fn(u32, f64) -> Result<Option<Voice>, String> + Send + Sync>;

/// Source and destination of voice recordings.
#[derive(Clone)]
pub enum Voices {
    /// Recordings are not available.
    None,
    /// Recordings are written to the log of a live dive.
    Kept(Keep),
    /// Recordings are read from a recorded log.
    Recalled(Recall),
}

/// Voice notes that wait for their recording, and recordings kept in memory.
pub(crate) struct Desk {
    to: Voices,
    begun: Mutex<VecDeque<u32>>,
    held: Mutex<VecDeque<Arc<Voice>>>,
    pub(super) budget: Budget,
    pub(super) coming: Semaphore,
    recalling: Semaphore,
}

/// Status and reason of a refusal.
pub(super) type Refusal = (StatusCode, String);

impl Desk {
    pub(super) fn new(to: Voices) -> Self {
        Self {
            to,
            begun: Mutex::default(),
            held: Mutex::default(),
            budget: Budget::new(RATE.0, RATE.1),
            coming: Semaphore::new(MOST_COMING),
            recalling: Semaphore::new(1),
        }
    }

    /// Registers a voice note whose recording is to follow.
    pub(super) fn begin(&self, id: u32) {
        let mut begun = self.begun();
        if !begun.contains(&id) {
            begun.push_back(id);
        }
        if begun.len() > MOST_BEGUN {
            begun.pop_front();
        }
    }

    fn begun(&self) -> MutexGuard<'_, VecDeque<u32>> {
        self.begun.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn held(&self) -> MutexGuard<'_, VecDeque<Arc<Voice>>> {
        self.held.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn get(&self, id: u32) -> Option<Arc<Voice>> {
        self.held().iter().find(|voice| voice.id == id).cloned()
    }

    fn hold(&self, voice: Arc<Voice>) {
        let mut held = self.held();
        held.push_back(voice);
        while held.iter().map(|voice| voice.audio.len()).sum::<usize>() > MOST_HELD_BYTES {
            held.pop_front();
        }
    }

    /// Stores the recording of a registered note. A repeated upload of the same recording is accepted.
    pub(super) fn keep(&self, voice: Voice) -> Result<(), Refusal> {
        let Voices::Kept(keep) = &self.to else {
            return Err((
                StatusCode::CONFLICT,
                "this dive isn't recorded, so voice notes can't be stored".to_owned(),
            ));
        };
        if self.get(voice.id).is_some_and(|held| *held == voice) {
            return Ok(());
        }
        if !self.begun().contains(&voice.id) {
            let why = format!("no voice note {} waits for its recording", voice.id);
            return Err((StatusCode::CONFLICT, why));
        }
        // Keep the recording in memory before the loop notifies the viewers, so that viewers can play it at once.
        let voice = Arc::new(voice);
        self.hold(Arc::clone(&voice));
        if let Err(why) = keep(&voice) {
            self.held().retain(|held| held.id != voice.id);
            return Err((StatusCode::SERVICE_UNAVAILABLE, why));
        }
        self.begun().retain(|id| *id != voice.id);
        Ok(())
    }

    /// Returns the recording of a voice note, from memory or from the log.
    pub(super) async fn recall(&self, id: u32, at_s: f64) -> Result<Option<Arc<Voice>>, Refusal> {
        let Voices::Recalled(recall) = &self.to else { return Ok(self.get(id)) };
        // Only one search runs at a time, because each search may read much of a log.
        let _turn = self.recalling.acquire().await;
        if let Some(voice) = self.get(id) {
            return Ok(Some(voice));
        }
        let recall = Arc::clone(recall);
        let failed = |why: String| (StatusCode::INTERNAL_SERVER_ERROR, why);
        let found = tokio::task::spawn_blocking(move || recall(id, at_s)).await;
        let found = found.map_err(|error| failed(error.to_string()))?.map_err(failed)?.map(Arc::new);
        if let Some(voice) = &found {
            self.hold(Arc::clone(voice));
        }
        Ok(found)
    }
}
