//! Returns: 12 bytes of header, the echo, and 0xFC. The 881 heads and the 852 sounder use the same format.
//!
//! Source: Imagenex 881A serial interface, return data; Imagenex 852 serial interface specification 1.04.

use headrace_sensor::codec::{Bytes, Framed, Framing, Verdict};

/// Maximum length of a return's echo, bytes.
pub const MAX_ECHO_BYTES: usize = MAX_ECHO as usize;

/// Maximum length of a return, bytes.
pub const MAX_RETURN_BYTES: usize = HEADER_BYTES + MAX_ECHO_BYTES + 1;

/// Maximum head position of an 881: +180 degrees.
pub const MAX_POSITION: u16 = 1200;

const MAX_ECHO: u16 = 500;
const HEADER_BYTES: usize = 12;
const TERMINATOR: u8 = 0xFC;
const CLOCKWISE: u8 = 0x40;
/// Smallest range setting at which one count of profile range means 1 cm, m.
const COARSE_FROM_M: u8 = 5;

/// Type of a return, which its tag states.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Tag {
    /// `IMX`: echo of nominally 250 points.
    Imx,
    /// `IGX`: echo of 500 points.
    Igx,
    /// `IPX`: profile point only, without an echo.
    Ipx,
    /// Return of a GS model, which has attitude sensors.
    Ina,
    /// Return of a GS model, which has attitude sensors.
    Inb,
    /// Return of a GS model, which has attitude sensors.
    Inc,
}

impl Tag {
    const ALL: [Self; 6] = [Self::Imx, Self::Igx, Self::Ipx, Self::Ina, Self::Inb, Self::Inc];

    /// The tag's three letters on the wire.
    pub const fn letters(self) -> [u8; 3] {
        match self {
            Self::Imx => *b"IMX",
            Self::Igx => *b"IGX",
            Self::Ipx => *b"IPX",
            Self::Ina => *b"INA",
            Self::Inb => *b"INB",
            Self::Inc => *b"INC",
        }
    }

    /// Whether the return is from a GS model. GS models add fields after the common header. Only one published source
    /// describes the added fields.
    pub const fn is_gs(self) -> bool {
        matches!(self, Self::Ina | Self::Inb | Self::Inc)
    }

    fn from_letters(letters: [u8; 3]) -> Option<Self> {
        Self::ALL.into_iter().find(|tag| tag.letters() == letters)
    }
}

/// Device model of a return. The formats of position and profile range depend on the model.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Model {
    /// A rotating head: positions are 0 to 1200, and a count of profile range is 2 or 10 mm.
    Head881,
    /// The 852 echosounder: positions have 13 bits and no meaning, and a count of profile range is always 10 mm.
    Sounder852,
}

impl Model {
    /// Model that uses this head id by default: sounders use 0x11 to 0x15.
    pub const fn of_head_id(head_id: u8) -> Self {
        if matches!(head_id, 0x11..=0x15) { Self::Sounder852 } else { Self::Head881 }
    }
}

/// The serial status byte of a return.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Status(pub u8);

impl Status {
    /// Whether the head accepted the settings of the command.
    pub const fn accepted(self) -> bool {
        self.0 & 0x40 != 0
    }

    /// Whether the head lost characters of the command.
    pub const fn overrun(self) -> bool {
        self.0 & 0x80 != 0
    }
}

/// Header of a return, in wire units.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Header {
    /// Type of the return.
    pub tag: Tag,
    /// Id of the sending head.
    pub head_id: u8,
    /// Status of the head.
    pub status: Status,
    /// Head position in counts of 0.3 degrees, 600 at 0 degrees; at most 1200 on an 881, up to 13 bits on other models.
    pub position: u16,
    /// Whether the head steps clockwise.
    pub clockwise: bool,
    /// Range setting of the ping, m.
    pub range_m: u8,
    /// Profile range in counts of [`Header::count_mm`], 14 bits; 0 if no echo was above the threshold.
    pub profile_counts: u16,
}

/// A whole return.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Return {
    /// The header of the return.
    pub header: Header,
    /// Echo strengths, packed by the command's number of data bits. Empty in [`Tag::Ipx`].
    pub echo: Bytes<MAX_ECHO_BYTES>,
}

/// A reason why bytes are no return, or why a value is invalid.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ReturnError {
    /// The tag, the first three bytes of the return, is unknown.
    #[error("return: tag {got:02X?}; allowed are IMX, IGX, IPX, INA, INB, INC")]
    Tag {
        /// The three bytes received in place of a tag.
        got: [u8; 3],
    },
    /// There are too few bytes for a whole return.
    #[error("return: {got} bytes; needed are {needed}")]
    Short {
        /// Number of bytes present.
        got: usize,
        /// Number of bytes needed.
        needed: usize,
    },
    /// Bit 7 of a packed field is set.
    #[error("return: a packed field has bit 7 set in bytes {got:02X?}; allowed is 0x00 to 0x7F")]
    HighBit {
        /// Bytes 5, 6 and 8 to 11 of the return.
        got: [u8; 6],
    },
    /// A field of the return is above its maximum.
    #[error("return: {field} is {got}; at most {max} is allowed")]
    TooGreat {
        /// Name of the field.
        field: &'static str,
        /// Value of the field.
        got: u16,
        /// Maximum of the field.
        max: u16,
    },
    /// The terminator isn't 0xFC.
    #[error("return: ends in {got:#04X}; allowed is 0xFC")]
    Terminator {
        /// Byte received in place of the terminator.
        got: u8,
    },
}

impl Header {
    /// Decodes the header at the front of `bytes`; also returns the length of the following echo.
    ///
    /// `model` overrides the model that the head id implies.
    /// Errors: too short, unknown tag, bit 7 set in a packed field, or a position or length above its maximum.
    pub fn decode(bytes: &[u8], model: Option<Model>) -> Result<(Self, usize), ReturnError> {
        let short = ReturnError::Short { got: bytes.len(), needed: HEADER_BYTES };
        let &[t0, t1, t2, head_id, status, p0, p1, range_m, r0, r1, n0, n1] =
            bytes.first_chunk::<HEADER_BYTES>().ok_or(short)?;
        let tag = Tag::from_letters([t0, t1, t2]).ok_or(ReturnError::Tag { got: [t0, t1, t2] })?;
        let packed = [p0, p1, r0, r1, n0, n1];
        if packed.iter().any(|byte| byte & 0x80 != 0) {
            return Err(ReturnError::HighBit { got: packed });
        }
        let header = Self {
            tag,
            head_id,
            status: Status(status),
            position: unpack(p0, p1 & !CLOCKWISE),
            clockwise: p1 & CLOCKWISE != 0,
            range_m,
            profile_counts: unpack(r0, r1),
        };
        header.check(model)?;
        let echo = unpack(n0, n1);
        at_most("number of echo bytes", echo, header.max_echo_bytes())?;
        Ok((header, usize::from(echo)))
    }

    /// Size of a profile range count, mm.
    ///
    /// Source: Imagenex 881A serial interface, profile range. For the 852, the specification of the 852.
    pub const fn count_mm(&self, model: Model) -> u32 {
        match model {
            Model::Head881 if self.range_m < COARSE_FROM_M => 2,
            Model::Head881 | Model::Sounder852 => 10,
        }
    }

    /// Profile range in mm, computed with 1500 m/s; `None` if no echo was above the threshold.
    pub fn profile_mm(&self, model: Model) -> Option<u32> {
        (self.profile_counts != 0).then(|| u32::from(self.profile_counts) * self.count_mm(model))
    }

    fn encode(&self, echo_len: u16) -> [u8; HEADER_BYTES] {
        let [t0, t1, t2] = self.tag.letters();
        let ([p0, p1], [r0, r1], [n0, n1]) = (pack(self.position), pack(self.profile_counts), pack(echo_len));
        let p1 = if self.clockwise { p1 | CLOCKWISE } else { p1 };
        [t0, t1, t2, self.head_id, self.status.0, p0, p1, self.range_m, r0, r1, n0, n1]
    }

    fn check(&self, model: Option<Model>) -> Result<(), ReturnError> {
        let max_position = match model.unwrap_or(Model::of_head_id(self.head_id)) {
            Model::Head881 => MAX_POSITION,
            Model::Sounder852 => 0x1FFF,
        };
        at_most("head position", self.position, max_position)?;
        at_most("profile range in counts", self.profile_counts, 0x3FFF)
    }

    fn max_echo_bytes(&self) -> u16 {
        if self.tag == Tag::Ipx { 0 } else { MAX_ECHO }
    }
}

impl Return {
    /// Encodes the return.
    ///
    /// Errors: a position, profile range or echo length is above its maximum.
    pub fn encode(&self) -> Result<Bytes<MAX_RETURN_BYTES>, ReturnError> {
        self.header.check(None)?;
        let echo = self.echo.as_slice();
        let echo_len = u16::try_from(echo.len()).unwrap_or(u16::MAX);
        at_most("number of echo bytes", echo_len, self.header.max_echo_bytes())?;
        let mut bytes = Bytes::default();
        for part in [&self.header.encode(echo_len)[..], echo, &[TERMINATOR]] {
            let needed = HEADER_BYTES + echo.len() + 1;
            bytes.extend(part).map_err(|_| ReturnError::Short { got: MAX_RETURN_BYTES, needed })?;
        }
        Ok(bytes)
    }

    /// Decodes the return at the front of `bytes`.
    ///
    /// Errors: as for [`Header::decode`], missing bytes, or a terminator other than 0xFC.
    pub fn decode(bytes: &[u8], model: Option<Model>) -> Result<Self, ReturnError> {
        let (header, echo_len) = Header::decode(bytes, model)?;
        let needed = HEADER_BYTES + echo_len + 1;
        let short = ReturnError::Short { got: bytes.len(), needed };
        match *bytes.get(needed - 1).ok_or(short)? {
            TERMINATOR => {
                let echo = bytes.get(HEADER_BYTES..needed - 1).and_then(|echo| Bytes::new(echo).ok());
                Ok(Self { header, echo: echo.ok_or(short)? })
            }
            got => Err(ReturnError::Terminator { got }),
        }
    }
}

fn unpack(low: u8, high: u8) -> u16 {
    (u16::from(high & 0x7F) << 7) | u16::from(low & 0x7F)
}

/// Packs seven bits into each byte, so that bit 7 stays clear.
fn pack(value: u16) -> [u8; 2] {
    [(value & 0x7F) as u8, ((value >> 7) & 0x7F) as u8]
}

fn at_most(field: &'static str, got: u16, max: u16) -> Result<(), ReturnError> {
    if got > max { Err(ReturnError::TooGreat { field, got, max }) } else { Ok(()) }
}

/// Separates returns in the stream from head to host.
#[derive(Debug, Clone, Copy, Default)]
pub struct Returns {
    /// Model of the device on the line, if known. It overrides the model that the head id implies.
    pub model: Option<Model>,
}

/// Decodes returns from the stream from head to host.
pub type ReturnCodec = Framed<Returns, MAX_RETURN_BYTES>;

impl Framing for Returns {
    type Value = Return;

    fn judge(&self, front: &[u8]) -> Verdict {
        let start = front.get(..front.len().min(3)).unwrap_or_default();
        if !Tag::ALL.iter().any(|tag| tag.letters().starts_with(start)) {
            return Verdict::NotAStart;
        }
        match Header::decode(front, self.model) {
            Err(ReturnError::Short { needed, .. }) => Verdict::Need(needed),
            Err(_) => Verdict::Bad,
            Ok((_, echo_len)) => {
                Verdict::on(front, HEADER_BYTES + echo_len + 1, |frame| frame.last() == Some(&TERMINATOR))
            }
        }
    }

    fn read(&self, frame: &[u8]) -> Option<Return> {
        Return::decode(frame, self.model).ok()
    }
}

#[cfg(test)]
mod tests;
