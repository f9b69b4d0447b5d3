//! A digest of results, the same wherever they are computed.

use serde::{Deserialize, Serialize};
use xxhash_rust::xxh64::xxh64;

/// Hashes numbers by their bits, little-endian, each with what came before as the seed.
///
/// Not a cryptographic digest: it tells a dive computed otherwise, not a forged one.
#[derive(Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Digest(u64);

impl core::fmt::Debug for Digest {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "{:016x}", self.value())
    }
}

impl Digest {
    /// Takes a whole number in.
    pub fn integer(&mut self, value: u64) -> &mut Self {
        self.0 = xxh64(&value.to_le_bytes(), self.0);
        self
    }

    /// Takes a number in, bit for bit; all zeros alike.
    pub fn number(&mut self, value: f64) -> &mut Self {
        self.integer((value + 0.0).to_bits())
    }

    /// The digest of all so far.
    pub fn value(&self) -> u64 {
        self.0
    }
}
