//! Rate limits of requests. A budget allows a burst, and refills at a constant rate.

use std::collections::BTreeMap;
use std::sync::{Mutex, PoisonError};

use tokio::time::Instant;

use super::client::Client;

/// Maximum number of clients in a table of budgets. A full table takes about 200 KiB.
const MOST_CLIENTS: usize = 4096;

/// Maximum number of requests in a budget, and refill per second.
#[derive(Debug, Clone, Copy)]
struct Rate {
    most: f64,
    per_s: f64,
}

/// Number of requests that a budget had left, and the time at which this number was computed.
#[derive(Debug, Clone, Copy)]
struct Left(f64, Instant);

impl Left {
    fn now(self, rate: Rate, now: Instant) -> f64 {
        (self.0 + now.duration_since(self.1).as_secs_f64() * rate.per_s).min(rate.most)
    }
}

/// A budget of requests that all clients share.
pub(crate) struct Budget {
    rate: Rate,
    left: Mutex<Option<Left>>,
}

impl Budget {
    pub(crate) fn new(most: f64, per_s: f64) -> Self {
        Self { rate: Rate { most, per_s }, left: Mutex::new(None) }
    }

    /// Takes one request from the budget. Returns `false` if the budget is exhausted.
    pub(crate) fn take(&self) -> bool {
        let mut left = self.left.lock().unwrap_or_else(PoisonError::into_inner);
        let now = Instant::now();
        let budget = left.map_or(self.rate.most, |left| left.now(self.rate, now));
        let has_one = budget >= 1.0;
        *left = Some(Left(if has_one { budget - 1.0 } else { budget }, now));
        has_one
    }
}

/// A budget of requests for each client.
pub(crate) struct Budgets {
    rate: Rate,
    left: Mutex<BTreeMap<Client, Left>>,
}

impl Budgets {
    pub(crate) fn new(most: f64, per_s: f64) -> Self {
        Self { rate: Rate { most, per_s }, left: Mutex::default() }
    }

    /// Takes `count` requests from a client's budget. If fewer are left, takes none and returns `false`.
    pub(crate) fn take(&self, client: Client, count: usize) -> bool {
        if count == 0 {
            return true;
        }
        let (rate, count) = (self.rate, count as f64);
        let now = Instant::now();
        let mut left = self.left.lock().unwrap_or_else(PoisonError::into_inner);
        let budget = left.get(&client).map_or(rate.most, |left| left.now(rate, now));
        if budget < count {
            return false;
        }
        if left.len() >= MOST_CLIENTS && !left.contains_key(&client) {
            forget_one(&mut left, rate, now);
        }
        left.insert(client, Left(budget - count, now));
        true
    }

    /// Gives back requests that a client took from its budget but did not use.
    pub(crate) fn give_back(&self, client: Client, count: usize) {
        let mut left = self.left.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(left) = left.get_mut(&client) {
            left.0 = (left.0 + count as f64).min(self.rate.most);
        }
    }
}

/// Makes room in a full table. Removes all clients with a full budget. If the table is then still full, removes the
/// client with the largest budget.
fn forget_one(left: &mut BTreeMap<Client, Left>, rate: Rate, now: Instant) {
    left.retain(|_, left| left.now(rate, now) < rate.most);
    if left.len() >= MOST_CLIENTS {
        let fullest = left.iter().max_by(|a, b| a.1.now(rate, now).total_cmp(&b.1.now(rate, now)));
        if let Some(client) = fullest.map(|(client, _)| *client) {
            left.remove(&client);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn client(number: u32) -> Client {
        Client::of_address(std::net::Ipv4Addr::from(number).into())
    }

    #[test]
    fn budget_of_one_client_does_not_affect_others() {
        let budgets = Budgets::new(20.0, 0.0);
        assert!(budgets.take(client(1), 15) && !budgets.take(client(1), 6) && budgets.take(client(1), 5));
        assert!(!budgets.take(client(1), 1) && budgets.take(client(2), 20));
        budgets.give_back(client(1), 1);
        assert!(budgets.take(client(1), 1) && !budgets.take(client(1), 1));
        assert!(!budgets.take(client(3), 21), "more than a whole budget");
    }

    #[test]
    fn full_table_keeps_exhausted_budgets() {
        let budgets = Budgets::new(20.0, 0.0);
        assert!(budgets.take(client(0), 20));
        for number in 1..2 * u32::try_from(MOST_CLIENTS).unwrap() {
            assert!(budgets.take(client(number), 1));
        }
        assert_eq!(budgets.left.lock().unwrap().len(), MOST_CLIENTS);
        assert!(!budgets.take(client(0), 1));
    }
}
