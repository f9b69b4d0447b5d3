//! Parses the two serialisations of ROS from untrusted bytes.
//!
//! Sources: ROS wiki, "Message serialization", for ROS 1: little-endian and packed. OMG DDS-XTypes 1.3, 7.4.3, plain
//! CDR, for ROS 2: four bytes state the byte order, and then numbers are aligned to their size, counted from the end of
//! these bytes.

/// Serialisation of the messages in a ROS recording.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Encoding {
    /// Serialisation of messages in ROS 1.
    Ros1,
    /// Serialisation of messages in ROS 2: plain CDR, version 1.
    Cdr,
}

/// Maximum number of padding bytes after a message's last field.
const MOST_PADDING: usize = 7;

/// A serialised message, and the position up to which it has been read.
#[derive(Debug, Clone, Copy)]
pub(super) struct Wire<'a> {
    bytes: &'a [u8],
    at: usize,
    encoding: Encoding,
    big_endian: bool,
}

/// Header of a message, with the message's timestamp.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Header<'a> {
    /// Timestamp, nanoseconds on the sender's clock, which may have any epoch.
    pub(super) stamp_ns: u64,
    pub(super) frame_id: &'a [u8],
}

macro_rules! numbers {
    ($($name:ident),*) => {
        $(pub(super) fn $name(&mut self) -> Option<$name> {
            let bytes = self.aligned()?;
            Some(if self.big_endian { $name::from_be_bytes(bytes) } else { $name::from_le_bytes(bytes) })
        })*
    };
}

impl<'a> Wire<'a> {
    /// Starts at the beginning of a serialised message. Returns `None` if its encapsulation isn't plain CDR.
    pub(super) fn new(message: &'a [u8], encoding: Encoding) -> Option<Self> {
        let (bytes, big_endian) = match (encoding, message) {
            (Encoding::Ros1, bytes) => (bytes, false),
            (Encoding::Cdr, [0, order @ (0 | 1), _, _, bytes @ ..]) => (bytes, *order == 0),
            (Encoding::Cdr, _) => return None,
        };
        Some(Self { bytes, at: 0, encoding, big_endian })
    }

    numbers!(u8, u32, f32, f64);

    /// Reads numbers of single precision, and returns them in double precision.
    pub(super) fn singles<const N: usize>(&mut self) -> Option<[f64; N]> {
        let mut all = [0.0; N];
        for one in &mut all {
            *one = self.f32()?.into();
        }
        Some(all)
    }

    pub(super) fn doubles<const N: usize>(&mut self) -> Option<[f64; N]> {
        let mut all = [0.0; N];
        for one in &mut all {
            *one = self.f64()?;
        }
        Some(all)
    }

    /// Reads the number of elements in a sequence. Each element has at least `element_bytes` bytes. Returns `None` if
    /// the message is too short for so many elements.
    pub(super) fn count(&mut self, element_bytes: usize) -> Option<usize> {
        let count = usize::try_from(self.u32()?).ok()?;
        let most = (self.bytes.len() - self.at) / element_bytes.max(1);
        (count <= most).then_some(count)
    }

    pub(super) fn single_sequence(&mut self) -> Option<Vec<f32>> {
        let count = self.count(4)?;
        (0..count).map(|_| self.f32()).collect()
    }

    /// Reads bytes with a length prefix.
    pub(super) fn bytes(&mut self) -> Option<&'a [u8]> {
        let count = self.count(1)?;
        self.take(count)
    }

    /// Reads the bytes of a text, without the terminating zero of CDR.
    pub(super) fn text(&mut self) -> Option<&'a [u8]> {
        let text = self.bytes()?;
        Some(match self.encoding {
            Encoding::Ros1 => text,
            Encoding::Cdr => text.strip_suffix(b"\0").unwrap_or(text),
        })
    }

    pub(super) fn header(&mut self) -> Option<Header<'a>> {
        if self.encoding == Encoding::Ros1 {
            let _sequence = self.u32()?;
        }
        let (seconds, nanoseconds) = (self.u32()?, self.u32()?);
        let stamp_ns = u64::from(seconds) * 1_000_000_000 + u64::from(nanoseconds);
        Some(Header { stamp_ns, frame_id: self.text()? })
    }

    /// Whether the whole message has been read, apart from padding. ROS 1 has no padding.
    pub(super) fn is_done(&self) -> bool {
        let left = self.bytes.len() - self.at;
        left == 0 || self.encoding == Encoding::Cdr && left <= MOST_PADDING
    }

    fn aligned<const N: usize>(&mut self) -> Option<[u8; N]> {
        if self.encoding == Encoding::Cdr {
            self.at = self.at.next_multiple_of(N).min(self.bytes.len());
        }
        self.take(N)?.try_into().ok()
    }

    fn take(&mut self, len: usize) -> Option<&'a [u8]> {
        let end = self.at.checked_add(len)?;
        let taken = self.bytes.get(self.at..end)?;
        self.at = end;
        Some(taken)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cdr_alignment_counts_from_the_end_of_the_encapsulation() {
        let bytes = [0, 1, 0, 0, 7, 0xAA, 0xAA, 0xAA, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0xF0, 0x3F];
        let mut wire = Wire::new(&bytes, Encoding::Cdr).unwrap();
        assert_eq!((wire.u8(), wire.u32(), wire.f64()), (Some(7), Some(1), Some(1.0)));
        assert!(wire.is_done());
        assert_eq!(wire.u8(), None);
        let big = [0, 0, 0, 0, 0, 0, 0, 2, b'a', 0];
        assert_eq!(Wire::new(&big, Encoding::Cdr).unwrap().text(), Some(&b"a"[..]));
        assert!(Wire::new(&[0, 7, 0, 0, 1], Encoding::Cdr).is_none());
    }

    #[test]
    fn sequence_counts_beyond_the_message_are_refused() {
        let bytes = [0xFF, 0xFF, 0xFF, 0xFF, 1, 2, 3, 4];
        assert_eq!(Wire::new(&bytes, Encoding::Ros1).unwrap().single_sequence(), None);
        assert_eq!(Wire::new(&bytes, Encoding::Ros1).unwrap().text(), None);
    }
}
