//! A digest of results, the same wherever they are computed.

use xxhash_rust::xxh64::Xxh64;

/// Hashes numbers by their bits, little-endian.
///
/// Not a cryptographic digest: it tells a dive computed otherwise, not a forged one.
#[derive(Clone)]
pub struct Digest(Xxh64);

impl Default for Digest {
    fn default() -> Self {
        Self(Xxh64::new(0))
    }
}

impl core::fmt::Debug for Digest {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "{:016x}", self.value())
    }
}

impl Digest {
    /// Takes a whole number in.
    pub fn integer(&mut self, value: u64) -> &mut Self {
        self.0.update(&value.to_le_bytes());
        self
    }

    /// Takes a number in, bit for bit; all zeros alike.
    pub fn number(&mut self, value: f64) -> &mut Self {
        self.integer((value + 0.0).to_bits())
    }

    /// The digest of all so far.
    pub fn value(&self) -> u64 {
        self.0.digest()
    }
}
