//! Decides from the tokens of a request whether the request may see the dive, and with which role.

use std::collections::BTreeSet;
use std::net::IpAddr;
use std::sync::Arc;

use axum::extract::FromRequestParts;
use axum::http::request::Parts;
use axum::http::{HeaderMap, StatusCode};
use axum::response::{IntoResponse, Response};

use super::client::Client;
use super::places::Place;
use super::reply::{ask_to_wait, plain, refused};
use super::shared::Shared;
use crate::access::{Role, tokens_of};

/// Connection on which a request arrived.
#[derive(Clone)]
pub(super) struct Caller {
    pub(super) peer: IpAddr,
    pub(super) place: Arc<Place>,
}

/// A request that may see the dive, with its role and client.
pub(super) struct Admitted {
    pub(super) role: Role,
    pub(super) client: Client,
    place: Arc<Place>,
    /// Whether a declared proxy has forwarded the request.
    is_forwarded: bool,
}

/// Reason why a request may not see the dive.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Denied {
    /// The request has no token, or only wrong ones.
    NoToken,
    /// The client has sent too many wrong tokens, so the token of this request isn't checked.
    Spent,
}

impl Denied {
    fn status(self) -> StatusCode {
        match self {
            Self::NoToken => StatusCode::UNAUTHORIZED,
            Self::Spent => StatusCode::TOO_MANY_REQUESTS,
        }
    }

    /// Returns the refusal as an answer to a command.
    pub(super) fn refusal(self, shared: &Shared) -> Response {
        refused(shared, self.status(), self.why().trim_end())
    }

    fn why(self) -> &'static str {
        match self {
            Self::NoToken => "a token is needed: open this server's page\n",
            Self::Spent => "too many wrong tokens came from this address; try again in a second\n",
        }
    }
}

impl IntoResponse for Denied {
    fn into_response(self) -> Response {
        ask_to_wait(plain(self.status(), self.why()))
    }
}

impl FromRequestParts<Arc<Shared>> for Admitted {
    type Rejection = Denied;

    async fn from_request_parts(parts: &mut Parts, shared: &Arc<Shared>) -> Result<Self, Denied> {
        let caller = parts.extensions.get::<Caller>().ok_or(Denied::NoToken)?;
        Self::of_tokens(shared, caller, &parts.headers, &tokens_of(&parts.headers, &parts.uri))
    }
}

impl Admitted {
    /// Admits a request that carries `tokens`, if one of them is right.
    pub(super) fn of_tokens(
        shared: &Shared,
        caller: &Caller,
        headers: &HeaderMap,
        tokens: &BTreeSet<String>,
    ) -> Result<Self, Denied> {
        let client = Client::of_request(caller.peer, &shared.proxies, headers);
        let role = shared.role(client, &caller.place, tokens);
        let role = role.inspect_err(|_| Shared::count(&shared.counts.unauthorised, 1))?;
        caller.place.promote(client, role);
        let is_forwarded = client != Client::of_address(caller.peer);
        Ok(Self { role, client, place: Arc::clone(&caller.place), is_forwarded })
    }

    /// Registers the connection as a stream of the feed. Returns `false` if there are too many streams.
    pub(super) fn may_stream(&self) -> bool {
        self.place.stream(self.client, self.is_forwarded)
    }
}

impl Shared {
    /// Returns the highest role among these tokens.
    ///
    /// Each wrong token uses one guess of the client's budget. A right token that was already shown on this connection
    /// uses no guess, and neither does a wrong token that is still remembered.
    fn role(&self, client: Client, place: &Place, tokens: &BTreeSet<String>) -> Result<Role, Denied> {
        if self.access.tokens.is_none() {
            return Ok(Role::Operator);
        }
        let shown = place.shown(client);
        let is_shown = |token: &&String| shown.is_some_and(|role| self.access.is_token_of(role, token));
        let known = shown.filter(|_| tokens.iter().any(|token| is_shown(&token)));
        let is_new = |token: &&String| !is_shown(token) && !self.wrong_tokens.has(client, token);
        let guesses: Vec<_> = tokens.iter().filter(is_new).collect();
        if !self.guesses.take(client, guesses.len()) {
            return known.ok_or(Denied::Spent);
        }
        let mut role = known;
        for token in guesses {
            if let Some(right) = self.access.role_of(token) {
                self.guesses.give_back(client, 1);
                role = role.max(Some(right));
            } else {
                self.wrong_tokens.add(client, token);
            }
        }
        role.ok_or(Denied::NoToken)
    }
}
