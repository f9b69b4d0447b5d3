//! Answers HTTP requests, without waiting for the loop.

use std::convert::Infallible;
use std::sync::Arc;
use std::time::Duration;

use axum::body::{Body as HttpBody, Bytes, to_bytes};
use axum::extract::ws::WebSocketUpgrade;
use axum::extract::ws::rejection::WebSocketUpgradeRejection;
use axum::extract::{Path, Request, State};
use axum::http::{HeaderMap, HeaderName, HeaderValue, Method, StatusCode, Uri, header};
use axum::middleware::{self, Next};
use axum::response::{IntoResponse, Response};
use axum::routing::{get, post};
use axum::{Extension, Router};
use serde_json::{Value, json};
use tokio::time::{Instant, timeout};

use super::admission::{Admitted, Caller, Denied};
use super::reply::{Here, json_answer, plain, refused};
use super::shared::{STALLED_AFTER, Shared};
use super::{feed, metrics, neighbours, voices};
use crate::access::{COOKIE, name_of, query};
use crate::assets;
use crate::command::{Asked, LONGEST};
use crate::model::{Body, MOST_IN_RANGE, Message, Sort};

/// The feed's WebSocket subprotocol.
const SUBPROTOCOL: &str = "headrace.feed.1";
/// Maximum length of a message accepted from a viewer, bytes.
const LONGEST_READ: usize = 16 << 10;
/// Lifetime of the cookie that stores the token in a browser, seconds: a day.
const COOKIE_S: u32 = 86_400;
const TOO_MANY_STREAMS: &str = "too many viewers, or too many from this address\n";

/// Returns the routes of the server.
pub(super) fn router(shared: Arc<Shared>) -> Router {
    Router::new()
        .route("/", get(page))
        .route("/widget/speed", get(page))
        .route("/widget/wall", get(page))
        .route("/widget/alerts", get(page))
        .route("/assets/{*path}", get(asset))
        .route("/widget/assets/{*path}", get(asset))
        .route("/feed", get(socket))
        .route("/feed.jsonl", get(lines))
        .route("/samples", get(samples))
        .route("/state.json", get(state))
        .route("/schema.json", get(schema))
        .route("/metrics", get(figures))
        .route("/register_service", get(|| async { json_answer(&neighbours::service()) }))
        .route(neighbours::EXTRAS, get(extras))
        .route("/login", get(login))
        .route("/voice/{id}", get(voices::play).post(voices::take))
        .route("/actions/{name}", post(action).options(preflight))
        .fallback(missing)
        .layer(middleware::from_fn_with_state(Arc::clone(&shared), guard))
        .with_state(shared)
}

/// Refuses unknown hosts and origins, and adds security headers to every answer.
async fn guard(State(shared): Here, request: Request, next: Next) -> Response {
    let (headers, uri) = (request.headers(), request.uri());
    let frame_ancestors = ancestors(&shared, headers);
    let changes = request.method() == Method::POST || uri.path() == "/feed";
    let mut answer = if !shared.access.is_host(headers) {
        Shared::count(&shared.counts.foreign, 1);
        plain(
            StatusCode::MISDIRECTED_REQUEST,
            "this machine isn't known by that name; name it with --page-host\n",
        )
    } else if changes && !shared.access.is_origin(headers) {
        Shared::count(&shared.counts.foreign, 1);
        plain(
            StatusCode::FORBIDDEN,
            "this request came from another page; allow that page with --page-origin\n",
        )
    } else {
        next.run(request).await
    };
    let policy = format!(
        "default-src 'none'; script-src 'self'; style-src 'self' 'unsafe-inline'; img-src 'self' data: blob:; \
         font-src 'self'; media-src 'self' data: blob:; connect-src 'self'; worker-src 'self' blob:; manifest-src 'self'; \
         base-uri 'none'; form-action 'self'; frame-ancestors {frame_ancestors}"
    );
    let set = answer.headers_mut();
    let fixed = |text| HeaderValue::from_static(text);
    set.insert(
        header::CONTENT_SECURITY_POLICY,
        HeaderValue::from_str(&policy).unwrap_or(fixed("default-src 'none'")),
    );
    // This page may record voice notes. Pages in frames around or inside it may not.
    set.insert(HeaderName::from_static("permissions-policy"), fixed("microphone=(self)"));
    set.insert(header::X_CONTENT_TYPE_OPTIONS, fixed("nosniff"));
    set.insert(header::REFERRER_POLICY, fixed("no-referrer"));
    set.insert(HeaderName::from_static("cross-origin-resource-policy"), fixed("same-site"));
    set.entry(header::CACHE_CONTROL).or_insert(fixed("no-store"));
    answer
}

/// Returns the origins that may frame the page: other services of this machine, such as Cockpit, and declared
/// origins.
fn ancestors(shared: &Shared, headers: &HeaderMap) -> String {
    let mut all = "'self'".to_owned();
    let name = headers.get(header::HOST).and_then(|host| host.to_str().ok()).map(name_of);
    let is_fit = |byte: u8| byte.is_ascii_alphanumeric() || b".-[]:".contains(&byte);
    if let Some(name) = name.filter(|name| !name.is_empty() && name.bytes().all(is_fit)) {
        all = format!("{all} http://{name}:* https://{name}:*");
    }
    for origin in &shared.access.origins {
        all.push(' ');
        all.push_str(origin);
    }
    all
}

async fn missing() -> Response {
    plain(StatusCode::NOT_FOUND, "no such page\n")
}

/// Returns the page to any client, without a token.
///
/// The page itself asks for the token. The status is never an error, because programs that frame the page retry for
/// ever after an error.
async fn page() -> Response {
    ([(header::CONTENT_TYPE, "text/html; charset=utf-8")], assets::index()).into_response()
}

async fn asset(Path(path): Path<String>) -> Response {
    match assets::asset(&format!("assets/{path}")) {
        Some(bytes) => {
            let kind =
                [(header::CONTENT_TYPE, assets::content_type(&path)), (header::CACHE_CONTROL, "no-cache")];
            (kind, bytes).into_response()
        }
        None => missing().await,
    }
}

/// Checks a token, and stores it in the browser as a cookie.
///
/// Only the token in the request's query counts. A cookie sent with the request is from an earlier login and is
/// ignored.
async fn login(State(shared): Here, caller: Extension<Caller>, headers: HeaderMap, uri: Uri) -> Response {
    // The address is relative, because a proxy may serve the page below a path.
    let home = [(header::LOCATION, "./")];
    if shared.access.tokens.is_none() {
        return (StatusCode::SEE_OTHER, home).into_response();
    }
    let token = query(&uri, "token").unwrap_or_default();
    if let Err(denied) = Admitted::of_tokens(&shared, &caller, &headers, &[token.clone()].into()) {
        return denied.into_response();
    }
    let secure = if shared.is_tls { "; Secure" } else { "" };
    // Without a path, the cookie belongs to the folder of /login as the browser sees it. Behind a proxy that serves several
    // programs below paths, the others don't get the token.
    let cookie = format!("{COOKIE}={token}; Max-Age={COOKIE_S}; HttpOnly; SameSite=Strict{secure}");
    (StatusCode::SEE_OTHER, home, [(header::SET_COOKIE, cookie)]).into_response()
}

async fn socket(
    State(shared): Here,
    admitted: Admitted,
    uri: Uri,
    upgrade: Result<WebSocketUpgrade, WebSocketUpgradeRejection>,
) -> Response {
    let upgrade = match upgrade {
        Ok(upgrade) => upgrade,
        Err(rejection) => return rejection.into_response(),
    };
    if !admitted.may_stream() {
        return plain(StatusCode::SERVICE_UNAVAILABLE, TOO_MANY_STREAMS);
    }
    let role = admitted.role;
    let since = query(&uri, "since").and_then(|since| since.parse().ok());
    let resume = query(&uri, "instance").zip(since).map(|(instance, since)| feed::Resume { instance, since });
    let upgrade =
        upgrade.protocols([SUBPROTOCOL]).max_message_size(LONGEST_READ).max_frame_size(LONGEST_READ);
    upgrade.on_upgrade(move |socket| feed::serve(socket, shared, role, resume))
}

/// Streams the feed's texts, one per line, with one state a second.
async fn lines(State(shared): Here, admitted: Admitted) -> Response {
    let Some(batches) = shared.fan().as_ref().map(tokio::sync::broadcast::Sender::subscribe) else {
        return plain(StatusCode::SERVICE_UNAVAILABLE, "the dive has ended\n");
    };
    if !admitted.may_stream() {
        return plain(StatusCode::SERVICE_UNAVAILABLE, TOO_MANY_STREAMS);
    }
    let stream = futures_util::stream::unfold((batches, None), |(mut batches, mut stated)| async move {
        loop {
            use tokio::sync::broadcast::error::RecvError;
            match batches.recv().await {
                Ok(batch) => {
                    let text = lines_of(&batch, &mut stated);
                    if !text.is_empty() {
                        return Some((Ok::<_, Infallible>(Bytes::from(text)), (batches, stated)));
                    }
                }
                Err(RecvError::Lagged(_)) => {}
                Err(RecvError::Closed) => return None,
            }
        }
    });
    ([(header::CONTENT_TYPE, "application/x-ndjson")], HttpBody::from_stream(stream)).into_response()
}

fn lines_of(batch: &[Message], stated: &mut Option<Instant>) -> String {
    let mut text = String::new();
    for message in batch {
        let Body::Text(line) = &message.body else { continue };
        if message.sort == Sort::State {
            if stated.is_some_and(|stated: Instant| stated.elapsed() < Duration::from_millis(900)) {
                continue;
            }
            *stated = Some(Instant::now());
        }
        text.push_str(line);
        text.push('\n');
    }
    text
}

async fn samples(State(shared): Here, _: Admitted, uri: Uri) -> Response {
    let number = |key| query(&uri, key)?.parse::<f32>().ok().filter(|value| value.is_finite());
    let (Some(from_m), Some(to_m)) = (number("from_m"), number("to_m")) else {
        return plain(StatusCode::BAD_REQUEST, "needs from_m and to_m, metres of chainage\n");
    };
    let (frame, step) = shared.model().samples_frame(from_m, to_m);
    let head = [
        (header::CONTENT_TYPE, "application/octet-stream".to_owned()),
        (HeaderName::from_static("headrace-one-of"), step.to_string()),
        (HeaderName::from_static("headrace-most"), MOST_IN_RANGE.to_string()),
    ];
    (head, frame).into_response()
}

async fn state(State(shared): Here, _: Admitted) -> Response {
    json_answer(
        &shared.model().state().unwrap_or(json!({"type": "state", "old": true, "condition": "no_data"})),
    )
}

async fn schema() -> Response {
    let kind = [(header::CONTENT_TYPE, "application/schema+json")];
    (kind, include_str!("../../../../docs/reference/page-feed.schema.json")).into_response()
}

async fn figures(State(shared): Here, _: Admitted) -> Response {
    ([(header::CONTENT_TYPE, "text/plain; version=0.0.4")], metrics::metrics(&shared)).into_response()
}

async fn extras(State(shared): Here, headers: HeaderMap) -> Response {
    let host = headers.get(header::HOST).and_then(|host| host.to_str().ok()).unwrap_or("localhost");
    let scheme = if shared.is_tls { "https" } else { "http" };
    json_answer(&neighbours::extras(&format!("{scheme}://{host}")))
}

/// Returns the headers that allow a page from a declared origin to read the answer.
fn allowed(shared: &Shared, headers: &HeaderMap) -> HeaderMap {
    let mut set = HeaderMap::new();
    let Some(origin) = headers.get(header::ORIGIN) else { return set };
    if shared.access.is_origin(headers) {
        set.insert(header::ACCESS_CONTROL_ALLOW_ORIGIN, origin.clone());
        set.insert(header::ACCESS_CONTROL_ALLOW_METHODS, HeaderValue::from_static("POST"));
        set.insert(
            header::ACCESS_CONTROL_ALLOW_HEADERS,
            HeaderValue::from_static("content-type, authorization"),
        );
        set.insert(header::VARY, HeaderValue::from_static("origin"));
    }
    set
}

async fn preflight(State(shared): Here, headers: HeaderMap) -> Response {
    (StatusCode::NO_CONTENT, allowed(&shared, &headers)).into_response()
}

/// Runs an action that a joystick's button sends: acknowledge, silence, mark or note.
async fn action(
    State(shared): Here,
    Path(name): Path<String>,
    admitted: Result<Admitted, Denied>,
    headers: HeaderMap,
    body: HttpBody,
) -> Response {
    let set = allowed(&shared, &headers);
    let admitted = match admitted {
        Ok(admitted) => admitted,
        Err(denied) => return (set, denied.refusal(&shared)).into_response(),
    };
    match act(&shared, &name, &admitted, body).await {
        Ok(done) => (set, json_answer(&done)).into_response(),
        Err((status, why)) => (set, refused(&shared, status, &why)).into_response(),
    }
}

async fn act(
    shared: &Shared,
    name: &str,
    admitted: &Admitted,
    body: HttpBody,
) -> Result<Value, (StatusCode, String)> {
    if !feed::may(shared, admitted.role).operate {
        return Err((
            StatusCode::FORBIDDEN,
            "not possible in this dive, or the token is for viewing only".to_owned(),
        ));
    }
    if !["acknowledge", "silence", "mark", "note"].contains(&name) {
        return Err((
            StatusCode::NOT_FOUND,
            format!("unknown action {name:?}; expected acknowledge, silence, mark or note"),
        ));
    }
    let too_long = |_| (StatusCode::PAYLOAD_TOO_LARGE, format!("at most {LONGEST} bytes"));
    if !shared.actions.take(admitted.client, 1) {
        let why =
            format!("more than {} actions per second from this address; send it again", feed::MOST_PER_S);
        return Err((StatusCode::TOO_MANY_REQUESTS, why));
    }
    let late = |_| {
        (StatusCode::REQUEST_TIMEOUT, format!("the action took over {} s to arrive", STALLED_AFTER.as_secs()))
    };
    let bytes = timeout(STALLED_AFTER, to_bytes(body, LONGEST)).await.map_err(late)?.map_err(too_long)?;
    let wrong = |why: String| (StatusCode::BAD_REQUEST, why);
    let mut value: Value = if bytes.is_empty() {
        json!({})
    } else {
        serde_json::from_slice(&bytes).map_err(|error| wrong(format!("no JSON: {error}")))?
    };
    let object = value.as_object_mut().ok_or_else(|| wrong("expected a JSON object".to_owned()))?;
    object.insert("do".to_owned(), name.into());
    if name == "acknowledge" {
        object.entry("alert").or_insert(0.into());
    }
    match Asked::parse(&value.to_string()).map_err(wrong)? {
        Asked::Command(command) => (shared.act)(command).map_err(|why| (StatusCode::CONFLICT, why))?,
        Asked::Play(_) | Asked::Rate(_) => {}
    }
    Ok(json!({"type": "done", "do": name}))
}
