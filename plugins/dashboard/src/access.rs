//! Decides who may access the page, by tokens, hosts and origins.

use std::collections::BTreeSet;
use std::fmt;
use std::net::IpAddr;

use axum::http::{HeaderMap, Uri, header};

/// Name of the cookie that holds the token.
pub(crate) const COOKIE: &str = "headrace_token";
/// Entropy of a random token, bytes.
const TOKEN_BYTES: usize = 16;

/// Role of a viewer of the page. The role decides the viewer's rights.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Role {
    /// A viewer who may only watch.
    Viewer,
    /// An operator, who may also acknowledge alerts, take notes, and control a replay.
    Operator,
}

/// A secret token. `Debug` output hides its text.
#[derive(Clone)]
pub struct Token(String);

impl fmt::Debug for Token {
    fn fmt(&self, to: &mut fmt::Formatter<'_>) -> fmt::Result {
        to.write_str("Token(..)")
    }
}

impl Token {
    /// Creates a random token from the system's entropy.
    ///
    /// Errors: the system provides no entropy.
    pub fn random() -> Result<Self, getrandom::Error> {
        let mut bytes = [0; TOKEN_BYTES];
        getrandom::fill(&mut bytes)?;
        Ok(Self(format!("{:032x}", u128::from_be_bytes(bytes))))
    }

    /// Accepts a token chosen by the user: 16 to 128 letters, digits, `-` and `_`.
    ///
    /// Errors: the reason, without the token's text.
    pub fn chosen(text: &str) -> Result<Self, String> {
        let is_fit = |byte: u8| byte.is_ascii_alphanumeric() || b"-_".contains(&byte);
        if !(16..=128).contains(&text.len()) {
            return Err(format!("has {} characters; expected 16 to 128", text.len()));
        }
        if text.bytes().all(is_fit) {
            Ok(Self(text.to_owned()))
        } else {
            Err("has characters other than letters, digits, - and _".to_owned())
        }
    }

    /// Text of the token, which is shown to the person who starts the program.
    pub fn text(&self) -> &str {
        &self.0
    }

    /// Compares the token with a text in constant time.
    fn is(&self, other: &str) -> bool {
        let (own, other) = (self.0.as_bytes(), other.as_bytes());
        let differs =
            own.iter().zip(other).fold(own.len() ^ other.len(), |all, (a, b)| all | usize::from(a ^ b));
        core::hint::black_box(differs) == 0
    }
}

/// Tokens of viewers and operators.
#[derive(Debug, Clone)]
pub struct Tokens {
    /// Token that admits its bearer as a viewer.
    pub viewer: Token,
    /// Token that admits its bearer as an operator.
    pub operator: Token,
}

/// Access rules of the page.
#[derive(Debug, Clone)]
pub(crate) struct Access {
    /// Tokens; `None` on loopback, where every local user may operate.
    pub(crate) tokens: Option<Tokens>,
    /// Names of this machine, in addition to its addresses and `localhost`.
    pub(crate) hosts: Vec<String>,
    /// Origins (`http://host`) of other pages that may frame this page and send actions.
    pub(crate) origins: Vec<String>,
    /// Whether this machine accepts only requests to `localhost` and loopback addresses.
    pub(crate) is_loopback: bool,
}

impl Access {
    /// Returns the role of a token; `None` for a wrong token.
    pub(crate) fn role_of(&self, token: &str) -> Option<Role> {
        let tokens = self.tokens.as_ref()?;
        // The text is always compared with both tokens, so that the response time does not reveal a match.
        let (operates, sees) = (tokens.operator.is(token), tokens.viewer.is(token));
        if operates { Some(Role::Operator) } else { sees.then_some(Role::Viewer) }
    }

    /// Whether a token is the token of this role. The token isn't compared with the tokens of other roles.
    pub(crate) fn is_token_of(&self, role: Role, token: &str) -> bool {
        self.tokens.as_ref().is_some_and(|tokens| match role {
            Role::Viewer => tokens.viewer.is(token),
            Role::Operator => tokens.operator.is(token),
        })
    }

    /// Whether the request's host is an address or a known name of this machine. This prevents DNS rebinding.
    pub(crate) fn is_host(&self, headers: &HeaderMap) -> bool {
        let Some(host) = headers.get(header::HOST).and_then(|value| value.to_str().ok()) else {
            return false;
        };
        let name = name_of(host);
        if let Ok(address) = name.trim_matches(['[', ']']).parse::<IpAddr>() {
            return !self.is_loopback || address.is_loopback();
        }
        name.eq_ignore_ascii_case("localhost")
            || self.hosts.iter().any(|known| known.eq_ignore_ascii_case(name))
    }

    /// Whether a request comes from this page, from a declared origin, or from a client that isn't a page.
    pub(crate) fn is_origin(&self, headers: &HeaderMap) -> bool {
        let Some(origin) = headers.get(header::ORIGIN) else { return true };
        let (Ok(origin), Some(Ok(host))) =
            (origin.to_str(), headers.get(header::HOST).map(|host| host.to_str()))
        else {
            return false;
        };
        let authority = origin.strip_prefix("http://").or_else(|| origin.strip_prefix("https://"));
        authority == Some(host) || self.origins.iter().any(|known| known == origin)
    }
}

/// Returns all distinct tokens of a request: from cookies, `Authorization: Bearer`, and the query.
pub(crate) fn tokens_of(headers: &HeaderMap, uri: &Uri) -> BTreeSet<String> {
    let values = |name| headers.get_all(name).iter().filter_map(|value| value.to_str().ok());
    let cookies = values(header::COOKIE).flat_map(|line| line.split(';'));
    let cookies = cookies.filter_map(|pair| pair.trim().split_once('=')).filter(|(name, _)| *name == COOKIE);
    let bearers = values(header::AUTHORIZATION).filter_map(|value| value.strip_prefix("Bearer "));
    let all = cookies.map(|(_, token)| token).chain(bearers).map(str::to_owned);
    all.chain(query(uri, "token")).collect()
}

/// Returns a host without its port.
pub(crate) fn name_of(host: &str) -> &str {
    match host.rsplit_once(':') {
        Some((name, port)) if port.bytes().all(|byte| byte.is_ascii_digit()) && !name.is_empty() => name,
        _ => host,
    }
}

/// Returns the decoded value of a key in the query.
pub(crate) fn query(uri: &Uri, key: &str) -> Option<String> {
    let pairs = uri.query()?.split('&').filter_map(|pair| pair.split_once('='));
    pairs.into_iter().find(|(name, _)| *name == key).map(|(_, value)| unescaped(value))
}

fn unescaped(text: &str) -> String {
    let mut bytes = Vec::with_capacity(text.len());
    let mut rest = text.bytes();
    while let Some(byte) = rest.next() {
        let hex = |byte: u8| char::from(byte).to_digit(16);
        let ahead = (rest.clone().next().and_then(hex), rest.clone().nth(1).and_then(hex));
        match (byte, ahead) {
            (b'%', (Some(high), Some(low))) => {
                bytes.push(u8::try_from(high * 16 + low).unwrap_or(b'?'));
                rest.nth(1);
            }
            (b'+', _) => bytes.push(b' '),
            _ => bytes.push(byte),
        }
    }
    String::from_utf8_lossy(&bytes).into_owned()
}

#[cfg(test)]
mod tests {
    use super::*;
    use axum::http::HeaderValue;

    fn access(is_loopback: bool) -> Access {
        let token = |text| Token::chosen(text).unwrap();
        let tokens = Tokens { viewer: token("viewer-0123456789"), operator: token("operator-01234567") };
        let origins = vec!["http://blueos.local".to_owned()];
        Access { tokens: Some(tokens), hosts: vec!["rov.local".to_owned()], origins, is_loopback }
    }

    fn headers(pairs: &[(header::HeaderName, &str)]) -> HeaderMap {
        pairs.iter().map(|(name, value)| (name.clone(), HeaderValue::from_str(value).unwrap())).collect()
    }

    #[test]
    fn tokens_are_read_once_each_from_cookies_bearer_header_and_query() {
        let tokens = |pairs: &[(header::HeaderName, &str)], uri: &'static str| {
            let headers = pairs.iter().map(|(name, value)| (name, HeaderValue::from_str(value).unwrap()));
            let mut map = HeaderMap::new();
            for (name, value) in headers {
                map.append(name, value);
            }
            tokens_of(&map, &Uri::from_static(uri)).into_iter().collect::<Vec<_>>().join(" ")
        };
        assert_eq!(tokens(&[], "/"), "");
        assert_eq!(tokens(&[(header::COOKIE, "a=b; headrace_token=x")], "/"), "x");
        assert_eq!(tokens(&[(header::AUTHORIZATION, "Bearer y")], "/feed?x=1&token=%7a"), "y z");
        let lines = [(header::COOKIE, "headrace_token=1"), (header::COOKIE, "headrace_token=2")];
        assert_eq!(tokens(&[lines.as_slice(), &lines].concat(), "/?token=1"), "1 2");
    }

    #[test]
    fn token_determines_the_role_of_the_viewer() {
        let access = access(false);
        assert_eq!(access.role_of("viewer-0123456789"), Some(Role::Viewer));
        assert_eq!(access.role_of("operator-01234567"), Some(Role::Operator));
        for wrong in ["operator-0123456", "operator-012345678", "operator-01234568", ""] {
            assert_eq!(access.role_of(wrong), None, "{wrong:?}");
        }
    }

    #[test]
    fn unknown_host_names_are_refused() {
        let is_host = |is_loopback, host| access(is_loopback).is_host(&headers(&[(header::HOST, host)]));
        for host in ["localhost:8881", "127.0.0.1:8881", "[::1]:8881", "rov.local"] {
            assert!(is_host(true, host) && is_host(false, host), "{host}");
        }
        assert!(is_host(false, "192.168.2.2:8881") && !is_host(true, "192.168.2.2:8881"));
        for host in ["evil.example", "localhost.evil.example:8881", "rov.local.evil.example", ""] {
            assert!(!is_host(true, host) && !is_host(false, host), "{host}");
        }
        assert!(!access(false).is_host(&HeaderMap::new()));
    }

    #[test]
    fn undeclared_origins_are_refused() {
        let is_origin = |origin| {
            access(false).is_origin(&headers(&[(header::HOST, "127.0.0.1:8881"), (header::ORIGIN, origin)]))
        };
        assert!(
            is_origin("http://127.0.0.1:8881")
                && is_origin("https://127.0.0.1:8881")
                && is_origin("http://blueos.local")
        );
        for origin in [
            "http://127.0.0.1:3000",
            "http://evil.example",
            "null",
            "127.0.0.1:8881",
            "http://blueos.local:81",
        ] {
            assert!(!is_origin(origin), "{origin}");
        }
    }

    #[test]
    fn random_tokens_differ_and_debug_output_hides_them() {
        let (one, other) = (Token::random().unwrap(), Token::random().unwrap());
        assert!(one.text() != other.text() && one.text().len() == 32);
        assert_eq!(format!("{one:?}"), "Token(..)");
        assert!(Token::chosen("short").is_err() && Token::chosen("with a space 0123456").is_err());
    }
}
