//! Wrong tokens that clients have sent.

use std::collections::VecDeque;
use std::hash::{DefaultHasher, Hash as _, Hasher as _};
use std::sync::{Mutex, MutexGuard, PoisonError};

use super::client::Client;

/// Maximum number of wrong tokens whose hashes are remembered: first for all clients together, then for one client.
const MOST_WRONG: usize = 256;
const MOST_WRONG_OF_CLIENT: usize = 4;

/// Hashes of wrong tokens by client, the latest at the end.
///
/// A repeated wrong token isn't a new guess. Old tokens in a browser's tabs therefore don't exhaust the budget of
/// their address.
#[derive(Default)]
pub(super) struct WrongTokens(Mutex<VecDeque<(Client, u64)>>);

impl WrongTokens {
    fn list(&self) -> MutexGuard<'_, VecDeque<(Client, u64)>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub(super) fn has(&self, client: Client, token: &str) -> bool {
        self.list().contains(&(client, hash_of(token)))
    }

    pub(super) fn add(&self, client: Client, token: &str) {
        let mut list = self.list();
        if list.iter().filter(|(of, _)| *of == client).count() >= MOST_WRONG_OF_CLIENT {
            let oldest = list.iter().position(|(of, _)| *of == client);
            oldest.and_then(|oldest| list.remove(oldest));
        }
        if list.len() >= MOST_WRONG {
            list.pop_front();
        }
        list.push_back((client, hash_of(token)));
    }
}

fn hash_of(token: &str) -> u64 {
    let mut hasher = DefaultHasher::new();
    token.hash(&mut hasher);
    hasher.finish()
}
