//! Digest of results, identical on all platforms.

use serde::{Deserialize, Serialize};
use xxhash_rust::xxh64::xxh64;

/// Hashes numbers by their bits, little-endian. The hash of all earlier numbers is the seed for the next one.
///
/// The digest is not cryptographic. It detects a dive that was computed differently, not a forged dive.
#[derive(Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Digest(u64);

impl core::fmt::Debug for Digest {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "{:016x}", self.value())
    }
}

impl Digest {
    /// Adds an integer to the digest.
    pub fn integer(&mut self, value: u64) -> &mut Self {
        self.0 = xxh64(&value.to_le_bytes(), self.0);
        self
    }

    /// Adds the bits of a number to the digest; -0 counts as +0.
    pub fn number(&mut self, value: f64) -> &mut Self {
        self.integer((value + 0.0).to_bits())
    }

    /// The digest of all numbers so far.
    pub fn value(&self) -> u64 {
        self.0
    }
}
