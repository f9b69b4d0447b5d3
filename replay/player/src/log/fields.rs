//! Reads fields of MCAP records from untrusted bytes.
//!
//! Source: MCAP format specification, "Serialization": integers are little-endian; strings and maps have a length
//! prefix in bytes.

use std::collections::BTreeMap;

use super::limits::{MAX_HEADER_BYTES, map_cost};

/// The unread rest of a record, and the number of bytes read.
#[derive(Debug, Clone, Copy)]
pub(super) struct Fields<'a> {
    rest: &'a [u8],
    taken: u64,
}

impl<'a> Fields<'a> {
    pub(super) fn new(bytes: &'a [u8]) -> Self {
        Self { rest: bytes, taken: 0 }
    }

    /// Returns the number of bytes of the record read so far.
    pub(super) fn taken(&self) -> u64 {
        self.taken
    }

    /// Returns the unread bytes of the record.
    pub(super) fn rest(&self) -> &'a [u8] {
        self.rest
    }

    /// Reads the next `len` bytes; `None` if there are fewer.
    pub(super) fn take(&mut self, len: u64) -> Option<&'a [u8]> {
        let (head, rest) = self.rest.split_at_checked(usize::try_from(len).ok()?)?;
        self.rest = rest;
        self.taken += len;
        Some(head)
    }

    pub(super) fn u8(&mut self) -> Option<u8> {
        self.take(1)?.first().copied()
    }

    pub(super) fn u16(&mut self) -> Option<u16> {
        Some(u16::from_le_bytes(self.take(2)?.try_into().ok()?))
    }

    pub(super) fn u32(&mut self) -> Option<u32> {
        Some(u32::from_le_bytes(self.take(4)?.try_into().ok()?))
    }

    pub(super) fn u64(&mut self) -> Option<u64> {
        Some(u64::from_le_bytes(self.take(8)?.try_into().ok()?))
    }

    pub(super) fn text(&mut self) -> Option<&'a str> {
        let len = self.u32()?;
        str::from_utf8(self.take(len.into())?).ok()
    }

    /// Reads a map; `None` if it is invalid, or needs more memory than a log's header may take.
    pub(super) fn map(&mut self) -> Option<BTreeMap<String, String>> {
        if self.map_cost()? > MAX_HEADER_BYTES {
            return None;
        }
        let len = self.u32()?;
        let mut entries = Fields::new(self.take(len.into())?);
        let mut map = BTreeMap::new();
        while !entries.rest.is_empty() {
            map.insert(entries.text()?.to_owned(), entries.text()?.to_owned());
        }
        Some(map)
    }

    /// Returns the memory that the map at the current position needs, see [`map_cost`]. The position doesn't change.
    pub(super) fn map_cost(&self) -> Option<u64> {
        let mut all = *self;
        let len = all.u32()?;
        let mut entries = Fields::new(all.take(len.into())?);
        let mut count = 0;
        while !entries.rest.is_empty() {
            let (_key, _value) = (entries.text()?, entries.text()?);
            count += 1;
        }
        Some(map_cost(count, len.into()))
    }
}

/// Fields of a message record before its data.
///
/// Source: MCAP format specification, "Message (op=0x05)".
#[derive(Debug, Clone, Copy)]
pub(super) struct MessageHead {
    pub(super) channel: u16,
    pub(super) sequence: u32,
    pub(super) log_time: u64,
    pub(super) publish_time: u64,
}

impl MessageHead {
    pub(super) fn read(fields: &mut Fields<'_>) -> Option<Self> {
        Some(Self {
            channel: fields.u16()?,
            sequence: fields.u32()?,
            log_time: fields.u64()?,
            publish_time: fields.u64()?,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fields_beyond_the_end_of_a_record_are_none() {
        assert_eq!(Fields::new(&[5, 0, 0, 0, b'a']).text(), None);
        assert_eq!(Fields::new(&[0xFF; 12]).map(), None);
        assert_eq!(Fields::new(&[1, 0, 0, 0, 0xFF]).text(), None);
        assert_eq!(Fields::new(&[1]).u16(), None);
        assert_eq!(Fields::new(&[1, 2]).take(u64::MAX), None);
    }

    #[test]
    fn encoded_map_is_decoded() {
        let bytes = b"\x0c\0\0\0\x01\0\0\0a\x03\0\0\0bcd rest";
        let mut fields = Fields::new(bytes);
        assert_eq!(fields.map(), Some(BTreeMap::from([("a".to_owned(), "bcd".to_owned())])));
        assert_eq!(fields.taken(), 16);
        assert_eq!(fields.rest(), b" rest");
    }
}
