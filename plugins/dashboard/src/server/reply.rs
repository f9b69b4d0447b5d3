//! Helpers that build answers to HTTP requests.

use std::sync::Arc;

use axum::extract::State;
use axum::http::{HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use serde_json::{Value, json};

use super::shared::Shared;

pub(super) type Here = State<Arc<Shared>>;

pub(super) fn plain(status: StatusCode, text: &'static str) -> Response {
    (status, [(header::CONTENT_TYPE, "text/plain; charset=utf-8")], text).into_response()
}

pub(super) fn json_answer(value: &Value) -> Response {
    ([(header::CONTENT_TYPE, "application/json")], value.to_string()).into_response()
}

/// Returns the refusal of a command, with the reason.
pub(super) fn refused(shared: &Shared, status: StatusCode, why: &str) -> Response {
    Shared::count(&shared.counts.refused, 1);
    let mut answer = json_answer(&json!({"type": "refused", "why": why}));
    *answer.status_mut() = status;
    ask_to_wait(answer)
}

/// Adds the header `Retry-After` to the answer for a client that has sent too many requests.
pub(super) fn ask_to_wait(mut answer: Response) -> Response {
    if answer.status() == StatusCode::TOO_MANY_REQUESTS {
        answer.headers_mut().insert(header::RETRY_AFTER, HeaderValue::from_static("1"));
    }
    answer
}
