//! Identifies clients by address, for rate limits.

use std::net::{IpAddr, Ipv6Addr};

use axum::http::{HeaderMap, HeaderName};

/// Header with the addresses that a request has passed. Each proxy appends the address of the machine that sent it the
/// request.
const FORWARDED_FOR: HeaderName = HeaderName::from_static("x-forwarded-for");

/// Address by which rate limits identify a client.
///
/// For IPv6 only the first half counts, because one machine has many addresses with the same first half.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Client(IpAddr);

impl Client {
    pub(crate) fn of_address(address: IpAddr) -> Self {
        Self(match address.to_canonical() {
            IpAddr::V6(address) => Ipv6Addr::from_bits(address.to_bits() & !u128::from(u64::MAX)).into(),
            v4 @ IpAddr::V4(_) => v4,
        })
    }

    /// Returns the client that sent a request: the forwarded address behind a declared proxy, otherwise the peer's
    /// address.
    pub(super) fn of_request(peer: IpAddr, proxies: &[IpAddr], headers: &HeaderMap) -> Self {
        let is_proxy = |address: &IpAddr| proxies.contains(&address.to_canonical());
        if !is_proxy(&peer) {
            return Self::of_address(peer);
        }
        let lines = headers.get_all(FORWARDED_FOR).iter().filter_map(|line| line.to_str().ok());
        let passed: Vec<_> = lines.flat_map(|line| line.split(',')).collect();
        // Only declared proxies are trusted. Addresses to the left of the rightmost untrusted address may be forged.
        let addresses = passed.iter().rev().map_while(|text| text.trim().parse::<IpAddr>().ok());
        Self::of_address(addresses.into_iter().find(|address| !is_proxy(address)).unwrap_or(peer))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use axum::http::HeaderValue;

    #[test]
    fn forwarded_addresses_are_used_only_from_declared_proxies() {
        let address = |text: &str| text.parse::<IpAddr>().unwrap();
        let mut headers = HeaderMap::new();
        headers.append(FORWARDED_FOR, HeaderValue::from_static("1.1.1.1, 10.0.0.9"));
        headers.append(FORWARDED_FOR, HeaderValue::from_static("172.17.0.2"));
        let proxies = [address("172.17.0.1"), address("172.17.0.2")];
        let client = |peer: &str| Client::of_request(address(peer), &proxies, &headers);
        assert_eq!(client("10.0.0.5"), Client::of_address(address("10.0.0.5")));
        assert_eq!(client("172.17.0.1"), Client::of_address(address("10.0.0.9")));
        assert_eq!(client("::ffff:172.17.0.1"), client("172.17.0.1"));
        let none = Client::of_request(address("172.17.0.1"), &proxies, &HeaderMap::new());
        assert_eq!(none, Client::of_address(address("172.17.0.1")));
    }

    #[test]
    fn addresses_of_one_ipv6_network_are_one_client() {
        let client = |text: &str| Client::of_address(text.parse().unwrap());
        assert_eq!(client("fd00:0:0:1::1"), client("fd00:0:0:1:ffff::2"));
        assert_ne!(client("fd00:0:0:1::1"), client("fd00:0:0:2::1"));
        assert_eq!(client("::ffff:10.0.0.1"), client("10.0.0.1"));
    }
}
