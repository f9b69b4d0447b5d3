//! What answers are made of.

use std::sync::Arc;

use axum::extract::State;
use axum::http::{HeaderMap, StatusCode, Uri, header};
use axum::response::{IntoResponse, Response};
use serde_json::Value;

use super::Shared;
use crate::access::Role;

pub(super) type Here = State<Arc<Shared>>;

pub(super) fn plain(status: StatusCode, text: &'static str) -> Response {
    (status, [(header::CONTENT_TYPE, "text/plain; charset=utf-8")], text).into_response()
}

pub(super) fn json_answer(value: &Value) -> Response {
    ([(header::CONTENT_TYPE, "application/json")], value.to_string()).into_response()
}

/// The role of a request.
///
/// Errors: the answer where it has none.
pub(super) fn admit(shared: &Shared, headers: &HeaderMap, uri: &Uri) -> Result<Role, Box<Response>> {
    shared.access.role(headers, uri).ok_or_else(|| {
        Shared::count(&shared.counts.unauthorised, 1);
        Box::new(plain(StatusCode::UNAUTHORIZED, "a token is needed: open this server's page\n"))
    })
}
