//! A byte string of bounded length without heap allocation.

/// Up to `N` bytes. Unused bytes are zero, so that byte strings with equal contents compare as equal.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct Bytes<const N: usize> {
    bytes: [u8; N],
    len: usize,
}

/// Error: the bytes do not fit into the byte string.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("storing {len} bytes; at most {max} are allowed")]
pub struct TooLong {
    /// Number of bytes that were to be stored.
    pub len: usize,
    /// Capacity of the byte string, bytes.
    pub max: usize,
}

impl<const N: usize> Default for Bytes<N> {
    fn default() -> Self {
        Self { bytes: [0; N], len: 0 }
    }
}

impl<const N: usize> Bytes<N> {
    /// Creates a byte string with a copy of `bytes`.
    ///
    /// Errors: `bytes` has more than `N` bytes.
    pub fn new(bytes: &[u8]) -> Result<Self, TooLong> {
        let mut new = Self::default();
        new.extend(bytes)?;
        Ok(new)
    }

    /// Appends `bytes`.
    ///
    /// Errors: the bytes do not fit; then nothing is appended.
    pub fn extend(&mut self, bytes: &[u8]) -> Result<(), TooLong> {
        let len = self.len + bytes.len();
        let free = self.bytes.get_mut(self.len..len).ok_or(TooLong { len, max: N })?;
        free.copy_from_slice(bytes);
        self.len = len;
        Ok(())
    }

    /// Removes all bytes of the string.
    pub fn clear(&mut self) {
        self.as_mut_slice().fill(0);
        self.len = 0;
    }

    /// Returns the bytes of the string as a mutable slice.
    pub fn as_mut_slice(&mut self) -> &mut [u8] {
        self.bytes.get_mut(..self.len).unwrap_or_default()
    }

    /// Returns the bytes of the string.
    pub fn as_slice(&self) -> &[u8] {
        self.bytes.get(..self.len).unwrap_or_default()
    }
}

impl<const N: usize> core::fmt::Debug for Bytes<N> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "{:02X?}", self.as_slice())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn oversized_input_is_rejected_and_appends_nothing() {
        let mut bytes = Bytes::<4>::new(&[1, 2, 3]).unwrap();
        assert_eq!(bytes.extend(&[4, 5]), Err(TooLong { len: 5, max: 4 }));
        assert_eq!(bytes, Bytes::new(&[1, 2, 3]).unwrap());
        bytes.extend(&[0]).unwrap();
        assert_eq!(bytes.as_slice(), [1, 2, 3, 0]);
        assert_ne!(bytes, Bytes::new(&[1, 2, 3]).unwrap());
        assert_eq!(format!("{bytes:?}"), "[01, 02, 03, 00]");
        bytes.clear();
        assert_eq!(bytes, Bytes::default());
    }
}
