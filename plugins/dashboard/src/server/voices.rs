//! Recordings of voice notes: received from operators for the log, and played to viewers.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use axum::body::{Body as HttpBody, to_bytes};
use axum::extract::{Path, State};
use axum::http::{HeaderMap, StatusCode, Uri, header};
use axum::response::{IntoResponse, Response};
use headrace_monitor::voice::{Container, MAX_VOICE_BYTES, MAX_VOICE_S, Voice, VoiceError};
use serde_json::json;
use tokio::sync::Semaphore;
use tokio::time::timeout;

use super::admission::{Admitted, Denied};
use super::budget::Budget;
use super::reply::{Here, json_answer, plain, refused};
use super::{Voices, feed};
use crate::access::query;

/// Maximum number of voice notes that wait for their recording. Beyond it the oldest is forgotten.
const MOST_BEGUN: usize = 32;
/// Maximum size of recordings kept in memory for playing, bytes. The oldest are dropped from memory but stay in the
/// log.
const MOST_HELD_BYTES: usize = 16 << 20;
/// Maximum number of recordings that are uploaded at the same time.
const MOST_COMING: usize = 2;
/// Budget of recordings' uploads: burst, and refill per second.
const RATE: (f64, f64) = (8.0, 0.2);
/// Timeout of a recording's upload: 512 KiB at 10 kB/s.
const COMES_WITHIN: Duration = Duration::from_mins(1);

/// Voice notes that wait for their recording, and recordings kept in memory.
pub(crate) struct Desk {
    to: Voices,
    begun: Mutex<VecDeque<u32>>,
    held: Mutex<VecDeque<Arc<Voice>>>,
    budget: Budget,
    coming: Semaphore,
    recalling: Semaphore,
}

/// Status and reason of a refusal.
type Refusal = (StatusCode, String);

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
    fn keep(&self, voice: Voice) -> Result<(), Refusal> {
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
        // Keep the recording in memory before the loop notifies viewers, so that they can play it at once.
        let voice = Arc::new(voice);
        self.hold(Arc::clone(&voice));
        if let Err(why) = keep(&voice) {
            self.held().retain(|held| held.id != voice.id);
            return Err((StatusCode::SERVICE_UNAVAILABLE, why));
        }
        self.begun().retain(|id| *id != voice.id);
        Ok(())
    }

    /// Returns the recording of a note, from memory or from the log.
    async fn recall(&self, id: u32, at_s: f64) -> Result<Option<Arc<Voice>>, Refusal> {
        let Voices::Recalled(recall) = &self.to else { return Ok(self.get(id)) };
        // Only one search runs at a time, because each may read much of a log.
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

/// Receives the recording of a voice note that was begun over the feed.
pub(super) async fn take(
    State(shared): Here,
    Path(id): Path<String>,
    admitted: Result<Admitted, Denied>,
    headers: HeaderMap,
    uri: Uri,
    body: HttpBody,
) -> Response {
    let admitted = match admitted {
        Ok(admitted) => admitted,
        Err(denied) => return denied.refusal(&shared),
    };
    let received = if feed::may(&shared, admitted.role).operate {
        receive(&shared.voices, &id, &headers, &uri, body).await
    } else {
        Err((StatusCode::FORBIDDEN, "not possible in this dive, or the token is for viewing only".to_owned()))
    };
    match received {
        Ok(()) => json_answer(&json!({"type": "done", "do": "voice"})),
        Err((status, why)) => refused(&shared, status, &why),
    }
}

async fn receive(
    desk: &Desk,
    id: &str,
    headers: &HeaderMap,
    uri: &Uri,
    body: HttpBody,
) -> Result<(), Refusal> {
    let too_many =
        || (StatusCode::TOO_MANY_REQUESTS, "too many voice notes at once; send it again".to_owned());
    let _place = desk.coming.try_acquire().map_err(|_| too_many())?;
    let wrong = |why: String| (StatusCode::BAD_REQUEST, why);
    let id = id.parse().map_err(|_| wrong(format!("no id of a voice note: {id:?}")))?;
    let seconds = query(uri, "seconds").and_then(|seconds| seconds.parse().ok());
    let seconds = seconds.ok_or_else(|| wrong(format!("needs seconds, 1 to {MAX_VOICE_S}")))?;
    let media_type = headers.get(header::CONTENT_TYPE).and_then(|value| value.to_str().ok()).unwrap_or("");
    let container = Container::of_media_type(media_type)
        .ok_or_else(|| refusal(&VoiceError::Type(media_type.chars().take(40).collect())))?;
    let stated = headers.get(header::CONTENT_LENGTH).and_then(|value| value.to_str().ok()?.parse().ok());
    if let Some(bytes) = stated.filter(|bytes: &usize| *bytes > MAX_VOICE_BYTES) {
        return Err(refusal(&VoiceError::Bytes(bytes)));
    }
    if !desk.budget.take() {
        return Err(too_many());
    }
    let late = |_| (StatusCode::REQUEST_TIMEOUT, "the voice note took over a minute to arrive".to_owned());
    let audio = timeout(COMES_WITHIN, to_bytes(body, MAX_VOICE_BYTES)).await.map_err(late)?;
    let audio = audio.map_err(|_| refusal(&VoiceError::Bytes(MAX_VOICE_BYTES + 1)))?.to_vec();
    desk.keep(Voice { id, seconds, container, audio }.checked().map_err(|error| refusal(&error))?)
}

fn refusal(error: &VoiceError) -> Refusal {
    let status = match error {
        VoiceError::Bytes(_) => StatusCode::PAYLOAD_TOO_LARGE,
        VoiceError::Type(_) | VoiceError::Contents(_) => StatusCode::UNSUPPORTED_MEDIA_TYPE,
        _ => StatusCode::BAD_REQUEST,
    };
    (status, error.to_string())
}

/// Returns the recording of a voice note to any viewer.
pub(super) async fn play(State(shared): Here, Path(id): Path<String>, _: Admitted) -> Response {
    let spoken = id.parse().ok().and_then(|id| Some((id, shared.model().spoken_s(id)?)));
    let Some((id, at_s)) = spoken else {
        return plain(StatusCode::NOT_FOUND, "no voice note of this id has a recording\n");
    };
    match shared.voices.recall(id, at_s).await {
        Ok(Some(voice)) => {
            ([(header::CONTENT_TYPE, voice.container.media_type())], voice.audio.clone()).into_response()
        }
        Ok(None) => {
            plain(StatusCode::NOT_FOUND, "the note's recording isn't available here; it may be in the log\n")
        }
        Err((status, why)) => {
            let kind = [(header::CONTENT_TYPE, "text/plain; charset=utf-8")];
            (status, kind, format!("the note's recording can't be read: {why}\n")).into_response()
        }
    }
}
