//! Recordings of voice notes: received from operators for the log, and played to viewers.

use std::time::Duration;

use axum::body::{Body as HttpBody, to_bytes};
use axum::extract::{Path, State};
use axum::http::{HeaderMap, StatusCode, Uri, header};
use axum::response::{IntoResponse as _, Response};
use headrace_monitor::voice::{Container, MAX_VOICE_BYTES, MAX_VOICE_S, Voice, VoiceError};
use serde_json::json;
use tokio::time::timeout;

use super::admission::{Admitted, Denied};
use super::feed;
use super::reply::{Here, json_answer, plain, refused};
use super::voice_desk::{Desk, Refusal};
use crate::access::query;
/// Timeout of a recording's upload: 512 KiB at 10 kB/s.
const COMES_WITHIN: Duration = Duration::from_mins(1);

/// Receives the recording of a voice note that an operator has begun by a message on the feed.
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
