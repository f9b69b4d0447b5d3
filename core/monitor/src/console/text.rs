//! Short texts stored inline, without allocation.

use serde::de::Error as _;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// A text of at most `BYTES` bytes of UTF-8, without control characters.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct ShortText<const BYTES: usize> {
    len: u16,
    bytes: [u8; BYTES],
}

impl<const BYTES: usize> Default for ShortText<BYTES> {
    fn default() -> Self {
        Self { len: 0, bytes: [0; BYTES] }
    }
}

impl<const BYTES: usize> ShortText<BYTES> {
    /// Makes a text from a string; `None` if the string is too long or has control characters.
    pub fn new(text: &str) -> Option<Self> {
        let mut all = Self::default();
        text.chars().all(|char| all.push(char)).then_some(all)
    }

    /// Makes a text from the beginning of a string, as far as it fits, without control characters.
    pub fn cut(text: &str) -> Self {
        let mut all = Self::default();
        let mut fits = text.chars().filter(|char| !char.is_control());
        while fits.next().is_some_and(|char| all.push(char)) {}
        all
    }

    /// Appends a character. Returns false, and appends nothing, if there is no room or if it is a control
    /// character.
    pub(super) fn push(&mut self, char: char) -> bool {
        let from = usize::from(self.len);
        let room = self.bytes.get_mut(from..from + char.len_utf8()).filter(|_| !char.is_control());
        let Some(room) = room else { return false };
        char.encode_utf8(room);
        // The length is at most BYTES, which is far below the largest u16.
        self.len += u16::try_from(char.len_utf8()).unwrap_or(0);
        true
    }

    /// The text as a string slice.
    pub fn as_str(&self) -> &str {
        let bytes = self.bytes.get(..usize::from(self.len)).unwrap_or_default();
        // The buffer is valid UTF-8, because only whole characters are appended.
        core::str::from_utf8(bytes).unwrap_or_default()
    }
}

impl<const BYTES: usize> core::fmt::Debug for ShortText<BYTES> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "{:?}", self.as_str())
    }
}

impl<const BYTES: usize> Serialize for ShortText<BYTES> {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        to.serialize_str(self.as_str())
    }
}

impl<'de, const BYTES: usize> Deserialize<'de> for ShortText<BYTES> {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        let text = <&str>::deserialize(from)?;
        Self::new(text).ok_or_else(|| D::Error::custom(format!("a text of at most {BYTES} bytes")))
    }
}
