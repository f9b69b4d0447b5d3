//! Limits the number of connections, in three classes: without a token, viewers, and operators.
//!
//! Each class has its own number of places, so that a full class doesn't affect the others. In a full class a new
//! connection replaces the oldest connection without a stream. Idle connections therefore can't keep anybody out.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use tokio::sync::Notify;

use super::client::Client;
use crate::access::Role;

/// Maximum number of connections in a class. One browser opens up to six.
pub(super) const MOST_OF_CLASS: usize = 64;
/// Maximum number of feed streams in a class.
pub(super) const MOST_STREAMS: usize = 32;
/// Maximum number of streams from an address behind a declared proxy. It is twice the streams of Cockpit's three
/// widgets and the page.
const MOST_STREAMS_FORWARDED: usize = 8;

/// Places of all connections, the longest-standing first.
#[derive(Default)]
pub(super) struct Places {
    held: Mutex<Vec<Held>>,
}

struct Held {
    key: Arc<Notify>,
    peer: Client,
    class: Option<Role>,
    stream: Option<Client>,
}

/// A connection's place among the limited number of places. The place is freed on drop.
pub(super) struct Place {
    /// Tells the connection to close. It also identifies the connection's place.
    key: Arc<Notify>,
    places: Arc<Places>,
    shown: Mutex<Option<(Client, Role)>>,
}

impl Places {
    /// Takes a place for a new connection.
    pub(super) fn enter(self: &Arc<Self>, peer: Client) -> Place {
        let key = Arc::new(Notify::new());
        let mut held = self.held();
        make_room(&mut held, None);
        held.push(Held { key: Arc::clone(&key), peer, class: None, stream: None });
        Place { key, places: Arc::clone(self), shown: Mutex::new(None) }
    }

    fn held(&self) -> MutexGuard<'_, Vec<Held>> {
        self.held.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// If a class is full, closes a connection without a stream. It is the oldest one of the client that has the most
/// connections without a stream.
fn make_room(held: &mut Vec<Held>, class: Option<Role>) {
    if held.iter().filter(|one| one.class == class).count() < MOST_OF_CLASS {
        return;
    }
    let of_class = |one: &Held| one.class == class && one.stream.is_none();
    let mut counts: BTreeMap<Client, usize> = BTreeMap::new();
    for one in held.iter().filter(|one| of_class(one)) {
        *counts.entry(one.peer).or_default() += 1;
    }
    let most = counts.values().max();
    let oldest = held.iter().position(|one| of_class(one) && counts.get(&one.peer) == most);
    if let Some(oldest) = oldest {
        held.remove(oldest).key.notify_one();
    }
}

impl Place {
    /// Waits until the connection must be closed to make room for another one.
    pub(super) async fn closed(&self) {
        self.key.notified().await;
    }

    /// Returns the role that this client has proved by a token on this connection.
    pub(super) fn shown(&self, client: Client) -> Option<Role> {
        let shown = self.shown.lock().unwrap_or_else(PoisonError::into_inner);
        shown.filter(|(by, _)| *by == client).map(|(_, role)| role)
    }

    /// Moves the connection to the class of a role, after the client has shown the role's token.
    pub(super) fn promote(&self, client: Client, role: Role) {
        *self.shown.lock().unwrap_or_else(PoisonError::into_inner) = Some((client, role));
        let mut held = self.places.held();
        let Some(at) = self.index(&held).filter(|at| held[*at].class < Some(role)) else { return };
        let mut own = held.remove(at);
        make_room(&mut held, Some(role));
        own.class = Some(role);
        held.push(own);
    }

    /// Registers the connection as a stream of the feed. Returns `false` if there are too many streams.
    pub(super) fn stream(&self, client: Client, is_forwarded: bool) -> bool {
        let mut held = self.places.held();
        let Some(at) = self.index(&held) else { return false };
        let class = held[at].class;
        let others = || held.iter().filter(|one| one.stream.is_some() && !Arc::ptr_eq(&one.key, &self.key));
        let of_class = others().filter(|one| one.class == class).count();
        let of_client = others().filter(|one| one.class == class && one.stream == Some(client)).count();
        if of_class >= MOST_STREAMS || is_forwarded && of_client >= MOST_STREAMS_FORWARDED {
            return false;
        }
        held[at].stream = Some(client);
        true
    }

    fn index(&self, held: &[Held]) -> Option<usize> {
        held.iter().position(|one| Arc::ptr_eq(&one.key, &self.key))
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        self.places.held().retain(|one| !Arc::ptr_eq(&one.key, &self.key));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn client(number: u32) -> Client {
        Client::of_address(std::net::Ipv4Addr::from(number).into())
    }

    fn is_open(place: &Place) -> bool {
        place.index(&place.places.held()).is_some()
    }

    #[test]
    fn silent_connections_take_no_places_reserved_for_viewers_or_operators() {
        let places = Arc::new(Places::default());
        let of = |role| {
            let place = places.enter(client(1));
            place.promote(client(1), role);
            place
        };
        let (viewer, operator) = (of(Role::Viewer), of(Role::Operator));
        let silent: Vec<_> = (0..1000).map(|_| places.enter(client(1))).collect();
        assert_eq!(silent.iter().filter(|place| is_open(place)).count(), MOST_OF_CLASS);
        assert!(silent.last().is_some_and(is_open), "the newest is served");
        let idle: Vec<_> = (0..1000).map(|_| of(Role::Viewer)).collect();
        assert_eq!(idle.iter().filter(|place| is_open(place)).count(), MOST_OF_CLASS);
        assert!(!is_open(&viewer) && is_open(&operator));
    }

    #[test]
    fn full_class_closes_a_connection_of_the_busiest_address() {
        let places = Arc::new(Places::default());
        let other = places.enter(client(2));
        let _many: Vec<_> = (0..1000).map(|_| places.enter(client(1))).collect();
        assert!(is_open(&other));
    }

    #[test]
    fn viewer_streams_take_no_streams_reserved_for_operators() {
        let places = Arc::new(Places::default());
        let stream = |role, number, is_forwarded| {
            let place = places.enter(client(9));
            place.promote(client(number), role);
            let is_taken = place.stream(client(number), is_forwarded);
            (place, is_taken)
        };
        let viewers: Vec<_> = (0..40).map(|_| stream(Role::Viewer, 1, false)).collect();
        assert_eq!(viewers.iter().filter(|(_, is_taken)| *is_taken).count(), MOST_STREAMS);
        assert!(stream(Role::Operator, 1, false).1);
        drop(viewers);
        let forwarded: Vec<_> = (0..40).map(|_| stream(Role::Viewer, 1, true)).collect();
        assert_eq!(forwarded.iter().filter(|(_, is_taken)| *is_taken).count(), MOST_STREAMS_FORWARDED);
        assert!(stream(Role::Viewer, 2, true).1, "another address behind the proxy");
    }
}
