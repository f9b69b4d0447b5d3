//! Classic CAN frames as passed by `SocketCAN`: `struct can_frame`, 16 bytes.
//!
//! ```text
//!   0 .. 3   identifier, u32 little-endian; bit 31 extended, bit 30 remote, bit 29 error
//!   4        length, 0 to 8
//!   5 .. 7   padding
//!   8 .. 15  data
//! ```
//! Source: linux/can.h.

/// Length of a CAN frame in the log, bytes.
pub const FRAME_BYTES: usize = 16;

const MAX_DATA_BYTES: u8 = 8;
const EXTENDED: u32 = 1 << 31;
const REMOTE: u32 = 1 << 30;
const ERROR: u32 = 1 << 29;
const STANDARD_IDS: u16 = 0x7FF;
const EXTENDED_IDS: u32 = 0x1FFF_FFFF;

/// The arbitration identifier of a CAN frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CanId {
    /// Standard identifier of 11 bits.
    Standard(u16),
    /// Extended identifier of 29 bits.
    Extended(u32),
}

/// Kind of a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FrameKind {
    /// A data frame from a device.
    Data(CanId),
    /// A remote frame, which requests data.
    Remote(CanId),
    /// An error frame from the controller, with its error class bits.
    Error(u32),
}

/// A classic CAN frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct CanFrame {
    kind: FrameKind,
    len: u8,
    data: [u8; 8],
}

/// A reason why bytes are no CAN frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum FrameError {
    /// There is more data than a classic frame holds.
    #[error("reading a CAN frame: {0} data bytes; a classic frame has 0 to 8")]
    Length(usize),
    /// The identifier has too many bits.
    #[error(
        "reading a CAN frame: identifier {0:#X}; allowed are up to 0x7FF, or 0x1FFFFFFF for an extended one"
    )]
    Id(u32),
}

/// Data of a frame, up to eight bytes, built piece by piece.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Payload {
    len: u8,
    data: [u8; 8],
}

impl CanId {
    fn checked(self) -> Result<Self, FrameError> {
        match self {
            Self::Standard(id) if id > STANDARD_IDS => Err(FrameError::Id(u32::from(id))),
            Self::Extended(id) if id > EXTENDED_IDS => Err(FrameError::Id(id)),
            id => Ok(id),
        }
    }

    fn bits(self) -> u32 {
        match self {
            Self::Standard(id) => u32::from(id),
            Self::Extended(id) => id | EXTENDED,
        }
    }
}

impl Payload {
    /// Appends bytes to the data. Bytes beyond eight are dropped.
    #[must_use]
    pub fn with(mut self, bytes: &[u8]) -> Self {
        for byte in bytes {
            if let Some(place) = self.data.get_mut(usize::from(self.len)) {
                *place = *byte;
                self.len += 1;
            }
        }
        self
    }
}

impl CanFrame {
    /// Creates a data frame. Excess upper bits of the identifier are dropped.
    pub fn new(id: CanId, payload: Payload) -> Self {
        let id = match id {
            CanId::Standard(id) => CanId::Standard(id & STANDARD_IDS),
            CanId::Extended(id) => CanId::Extended(id & EXTENDED_IDS),
        };
        Self { kind: FrameKind::Data(id), len: payload.len, data: payload.data }
    }

    /// Creates a frame of any kind. A remote frame has a length but no data.
    ///
    /// Errors: more than eight bytes, or an identifier with too many bits.
    pub fn of_kind(kind: FrameKind, data: &[u8]) -> Result<Self, FrameError> {
        let len = u8::try_from(data.len()).ok().filter(|len| *len <= MAX_DATA_BYTES);
        let len = len.ok_or(FrameError::Length(data.len()))?;
        let kind = match kind {
            FrameKind::Data(id) => FrameKind::Data(id.checked()?),
            FrameKind::Remote(id) => FrameKind::Remote(id.checked()?),
            FrameKind::Error(classes) if classes > EXTENDED_IDS => return Err(FrameError::Id(classes)),
            FrameKind::Error(classes) => FrameKind::Error(classes),
        };
        let data = match kind {
            FrameKind::Remote(_) => [0; 8],
            _ => Payload::default().with(data).data,
        };
        Ok(Self { kind, len, data })
    }

    /// Kind of the frame.
    pub fn kind(&self) -> FrameKind {
        self.kind
    }

    /// Data bytes; none in a remote frame.
    pub fn data(&self) -> &[u8] {
        match self.kind {
            FrameKind::Remote(_) => &[],
            _ => self.data.get(..usize::from(self.len)).unwrap_or_default(),
        }
    }

    /// Decodes a `can_frame`.
    ///
    /// Errors: more than eight bytes, or an identifier with too many bits.
    pub fn decode(bytes: &[u8; FRAME_BYTES]) -> Result<Self, FrameError> {
        let [b0, b1, b2, b3, len, _, _, _, data @ ..] = bytes;
        let bits = u32::from_le_bytes([*b0, *b1, *b2, *b3]);
        let id = bits & EXTENDED_IDS;
        let can_id = if bits & EXTENDED != 0 {
            CanId::Extended(id)
        } else {
            CanId::Standard(u16::try_from(id).unwrap_or(u16::MAX))
        };
        let kind = if bits & ERROR != 0 {
            FrameKind::Error(id)
        } else if bits & REMOTE != 0 {
            FrameKind::Remote(can_id)
        } else {
            FrameKind::Data(can_id)
        };
        Self::of_kind(kind, data.get(..usize::from(*len)).ok_or(FrameError::Length(usize::from(*len)))?)
    }

    /// Encodes the frame as a `can_frame`.
    pub fn encode(&self) -> [u8; FRAME_BYTES] {
        let bits = match self.kind {
            FrameKind::Data(id) => id.bits(),
            FrameKind::Remote(id) => id.bits() | REMOTE,
            FrameKind::Error(classes) => classes | ERROR,
        };
        let [b0, b1, b2, b3] = bits.to_le_bytes();
        let [d0, d1, d2, d3, d4, d5, d6, d7] = self.data;
        [b0, b1, b2, b3, self.len, 0, 0, 0, d0, d1, d2, d3, d4, d5, d6, d7]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn identifier_flags_give_the_kind_of_a_can_frame() {
        let kind = |id: [u8; 4]| {
            let mut bytes = [0; FRAME_BYTES];
            bytes[..4].copy_from_slice(&id);
            CanFrame::decode(&bytes).map(|frame| frame.kind())
        };
        assert_eq!(kind([0x34, 0, 0, 0]), Ok(FrameKind::Data(CanId::Standard(0x34))));
        assert_eq!(kind([0x21, 0, 0xFF, 0x99]), Ok(FrameKind::Data(CanId::Extended(0x19FF_0021))));
        assert_eq!(kind([0x34, 0, 0, 0x40]), Ok(FrameKind::Remote(CanId::Standard(0x34))));
        assert_eq!(kind([0x04, 0, 0, 0x20]), Ok(FrameKind::Error(4)));
        assert_eq!(kind([0, 8, 0, 0]), Err(FrameError::Id(0x800)));
    }

    fn any_frame() -> impl proptest::strategy::Strategy<Value = CanFrame> {
        use proptest::prelude::*;
        let id = || {
            prop_oneof![
                (0u16..0x800).prop_map(CanId::Standard),
                (0u32..0x2000_0000).prop_map(CanId::Extended),
            ]
        };
        let kind = prop_oneof![
            id().prop_map(FrameKind::Data),
            id().prop_map(FrameKind::Remote),
            (0u32..0x2000_0000).prop_map(FrameKind::Error),
        ];
        (kind, proptest::collection::vec(any::<u8>(), 0..=8))
            .prop_filter_map("valid", |(kind, data)| CanFrame::of_kind(kind, &data).ok())
    }

    proptest::proptest! {
        #[test]
        fn every_frame_round_trips(frame in any_frame()) {
            proptest::prop_assert_eq!(CanFrame::decode(&frame.encode()), Ok(frame));
        }
    }
}
