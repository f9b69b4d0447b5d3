//! Text lines of MTNW LCI-90 and LCI-90i line monitors: tension, speed, payout.
//!
//! ```text
//!   RD,TTTTTTTT,SSSSSSSS,PPPPPPPP,CCCC<CR><LF>                              LCI-90, protocol 1
//!   NNRD,yyyy-mm-ddThh:mm:ss.mmm,TTTTTTTT,SSSSSSSS,PPPPPPPP,CCCC<CR><LF>    LCI-90i, winch NN
//! ```
//! Numbers have eight characters. They are zero-padded, with an optional leading `-` and a decimal point anywhere. CCCC
//! is the decimal sum of the codes of all preceding characters. Any bytes may precede a line.
//! Source: LCI-90 Operator Manual, p. 48; a recorded LCI-90i line whose sum confirms the order of the fields.

use headrace_sensor::codec::{Framed, Framing, Verdict};
use headrace_sensor::geometry::math;

/// Templates of the two kinds of text lines. 9 stands for a digit, # for a character of a number, and all other
/// characters for themselves.
const PLAIN: &[u8] = b"RD,########,########,########,9999\r\n";
const STAMPED: &[u8] = b"99RD,9999-99-99T99:99:99.999,########,########,########,9999\r\n";
/// Maximum length of a text line, bytes. It is the length of the longer template.
pub const MAX_LINE_BYTES: usize = STAMPED.len();

/// Offset in a template after `RD,`. A match up to this offset is unlikely to be chance.
const PLAIN_MARKER: usize = 3;
const STAMPED_MARKER: usize = 5;

const NUMBER_CHARS: usize = 8;
/// Length of checksum, CR and LF, bytes.
const TAIL_BYTES: usize = 6;
const POWERS_OF_TEN: [i32; 8] = [1, 10, 100, 1000, 10_000, 100_000, 1_000_000, 10_000_000];

/// A number of eight characters: `mantissa` / 10^`places`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Decimal {
    mantissa: i32,
    places: u8,
}

/// Measurement time that a monitor states for a winch, with the digits as sent. The calendar isn't checked, because
/// readings use the receive time.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Stamp {
    /// Winch number, 0 to 99.
    pub winch: u8,
    /// Year, 0 to 9999.
    pub year: u16,
    /// Month, day, hour, minute, second; 0 to 99 each.
    pub month_to_second: [u8; 5],
    /// Millisecond, 0 to 999.
    pub millisecond: u16,
}

/// One text line of a monitor, in the units configured in the monitor.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct LineReading {
    /// Winch and time, which only LCI-90i lines have.
    pub stamp: Option<Stamp>,
    /// Cable tension.
    pub tension: Decimal,
    /// Cable speed.
    pub speed: Decimal,
    /// Cable paid out.
    pub payout: Decimal,
}

impl Decimal {
    /// The number zero.
    pub const ZERO: Self = Self { mantissa: 0, places: 0 };

    /// The number `mantissa` / 10^`places`; `None` if it doesn't fit eight characters.
    pub fn new(mantissa: i32, places: u8) -> Option<Self> {
        let signs = usize::from(mantissa < 0) + usize::from(places > 0);
        let digits = NUMBER_CHARS - signs;
        let fits = usize::from(places) <= digits
            && POWERS_OF_TEN.get(digits).is_none_or(|limit| mantissa.unsigned_abs() < limit.unsigned_abs())
            && mantissa.unsigned_abs() < 100_000_000;
        fits.then_some(Self { mantissa, places })
    }

    /// Number nearest to `value`, with as many decimal places as fit but at most `most_places`; zero if `value` doesn't
    /// fit eight characters.
    pub fn nearest(value: f64, most_places: u8) -> Self {
        let with = |places: u8| {
            let scale = f64::from(*POWERS_OF_TEN.get(usize::from(places))?);
            Self::new(i32::try_from(math::round_to_i64(value * scale)).ok()?, places)
        };
        (0..=most_places).rev().find_map(with).unwrap_or(Self::ZERO)
    }

    /// Value of the number as a float.
    pub fn value(self) -> f64 {
        f64::from(self.mantissa) * self.quantum()
    }

    /// Value of one unit in the number's last decimal place.
    pub fn quantum(self) -> f64 {
        1.0 / POWERS_OF_TEN.get(usize::from(self.places)).copied().map_or(1.0, f64::from)
    }

    fn parse(chars: &[u8]) -> Option<Self> {
        let (negative, chars) = match chars {
            [b'-', rest @ ..] => (true, rest),
            _ => (false, chars),
        };
        let (mut mantissa, mut digits, mut places) = (0_i32, 0, None);
        for char in chars {
            match (char, &mut places) {
                (b'.', None) => places = Some(0),
                (b'0'..=b'9', _) => {
                    mantissa = mantissa.checked_mul(10)?.checked_add(i32::from(char - b'0'))?;
                    digits += 1;
                    places = places.map(|places| places + 1);
                }
                _ => return None,
            }
        }
        let places = places.unwrap_or(0);
        (digits > 0).then_some(Self { mantissa: if negative { -mantissa } else { mantissa }, places })
    }

    fn write(self, line: &mut Vec<u8>) {
        let places = usize::from(self.places);
        let negative = self.mantissa < 0;
        let digits = NUMBER_CHARS - usize::from(negative) - usize::from(places > 0);
        let text = format!("{:0digits$}", self.mantissa.unsigned_abs());
        let (whole, fraction) = text.split_at(text.len() - places.min(text.len()));
        if negative {
            line.push(b'-');
        }
        line.extend_from_slice(whole.as_bytes());
        if places > 0 {
            line.push(b'.');
        }
        line.extend_from_slice(fraction.as_bytes());
    }
}

impl LineReading {
    /// Encodes the text line with checksum, CR and LF.
    pub fn encode(&self) -> Vec<u8> {
        let mut line = Vec::with_capacity(MAX_LINE_BYTES);
        if let Some(stamp) = &self.stamp {
            let [month, day, hour, minute, second] = stamp.month_to_second;
            let Stamp { winch, year, millisecond, .. } = stamp;
            line.extend_from_slice(
                format!(
                    "{winch:02}RD,{year:04}-{month:02}-{day:02}T{hour:02}:{minute:02}:{second:02}.{millisecond:03},"
                )
                .as_bytes(),
            );
        } else {
            line.extend_from_slice(b"RD,");
        }
        for number in [self.tension, self.speed, self.payout] {
            number.write(&mut line);
            line.push(b',');
        }
        let sum = format!("{:04}\r\n", sum(&line));
        line.extend_from_slice(sum.as_bytes());
        line
    }

    /// Decodes a line that matches its template; `None` if the checksum or a number is wrong.
    fn decode(line: &[u8]) -> Option<Self> {
        let (summed, tail) = line.split_at_checked(line.len().checked_sub(TAIL_BYTES)?)?;
        if integer(tail.get(..4)?)? != sum(summed) {
            return None;
        }
        let mut fields = summed.split(|char| *char == b',');
        let stamp = match fields.next()? {
            [tens, ones, ..] if tens.is_ascii_digit() => Some(stamp(&[*tens, *ones], fields.next()?)?),
            _ => None,
        };
        let mut number = || Decimal::parse(fields.next()?);
        Some(Self { stamp, tension: number()?, speed: number()?, payout: number()? })
    }
}

fn stamp(winch: &[u8], time: &[u8]) -> Option<Stamp> {
    let part = |at: usize, len: usize| integer(time.get(at..at + len)?);
    let byte = |at: usize| u8::try_from(part(at, 2)?).ok();
    Some(Stamp {
        winch: u8::try_from(integer(winch)?).ok()?,
        year: u16::try_from(part(0, 4)?).ok()?,
        month_to_second: [byte(5)?, byte(8)?, byte(11)?, byte(14)?, byte(17)?],
        millisecond: u16::try_from(part(20, 3)?).ok()?,
    })
}

fn integer(digits: &[u8]) -> Option<u32> {
    digits
        .iter()
        .try_fold(0_u32, |value, char| char.is_ascii_digit().then(|| value * 10 + u32::from(char - b'0')))
}

fn sum(chars: &[u8]) -> u32 {
    chars.iter().map(|char| u32::from(*char)).sum()
}

/// Separates lines in a character stream.
#[derive(Debug, Clone, Copy, Default)]
pub struct Lines;

/// Decodes the bytes of a serial line into line readings.
pub type LineCodec = Framed<Lines, MAX_LINE_BYTES>;

impl Framing for Lines {
    type Value = LineReading;

    fn judge(&self, front: &[u8]) -> Verdict {
        let (shape, marker) = match front.first() {
            Some(b'R') => (PLAIN, PLAIN_MARKER),
            Some(b'0'..=b'9') => (STAMPED, STAMPED_MARKER),
            _ => return Verdict::NotAStart,
        };
        let fits = |(char, wanted): (&u8, &u8)| match wanted {
            b'9' => char.is_ascii_digit(),
            b'#' => char.is_ascii_digit() || matches!(char, b'-' | b'.'),
            _ => char == wanted,
        };
        match front.iter().zip(shape).position(|pair| !fits(pair)) {
            Some(at) if at < marker => Verdict::NotAStart,
            Some(_) => Verdict::Bad,
            None => Verdict::on(front, shape.len(), |line| LineReading::decode(line).is_some()),
        }
    }

    fn read(&self, frame: &[u8]) -> Option<LineReading> {
        LineReading::decode(frame)
    }
}

#[cfg(test)]
mod tests {
    use headrace_sensor::codec::Codec as _;
    use headrace_sensor::codec::contract::decode_all;

    use super::*;

    const PROTOCOL_1: &[u8] = b"RD,00000125,000012.4,0152.304,1504\r\n";
    const RECORDED: &[u8] = b"03RD,2022-05-14T16:17:36.502,-0000168,00000000,-00004.8,2839\r\n";

    #[test]
    fn worked_example_4_is_read_and_written() {
        let got = decode_all(&mut LineCodec::default(), PROTOCOL_1);
        let decimal = |mantissa, places| Decimal::new(mantissa, places).unwrap();
        let expected = LineReading {
            stamp: None,
            tension: decimal(125, 0),
            speed: decimal(124, 1),
            payout: decimal(152_304, 3),
        };
        assert_eq!(got, [expected]);
        assert!((expected.payout.value() - 152.304).abs() < 1e-12);
        assert_eq!(expected.encode(), PROTOCOL_1);
    }

    #[test]
    fn worked_example_5_decodes_a_recorded_line() {
        let got = decode_all(&mut LineCodec::default(), RECORDED);
        let stamp = got[0].stamp.unwrap();
        assert_eq!((stamp.winch, stamp.year, stamp.millisecond), (3, 2022, 502));
        assert_eq!(stamp.month_to_second, [5, 14, 16, 17, 36]);
        assert!((got[0].tension.value() + 168.0).abs() < 1e-12);
        assert!((got[0].payout.value() + 4.8).abs() < 1e-12);
        assert!((got[0].payout.quantum() - 0.1).abs() < 1e-12);
        assert_eq!(got[0].encode(), RECORDED);
    }

    #[test]
    fn lines_with_a_wrong_checksum_or_number_are_refused() {
        for line in
            [&b"RD,00000125,000012.4,0152.304,1505\r\n"[..], b"RD,00000125,0000-2.4,0152.304,1501\r\n"]
        {
            let mut codec = LineCodec::default();
            assert_eq!(decode_all(&mut codec, line), []);
            assert_eq!(codec.counts().skipped_bytes, 36);
        }
    }

    #[test]
    fn line_is_decoded_after_junk_that_resembles_a_winch_number() {
        for junk in [&b"12"[..], b"\xFF\0RD,RD", b"03RD,2022-05-14T", b"1234567890"] {
            let got = decode_all(&mut LineCodec::default(), &[junk, PROTOCOL_1].concat());
            assert_eq!(got.len(), 1, "{junk:?}");
        }
    }

    #[test]
    fn numbers_have_as_many_decimal_places_as_fit() {
        assert_eq!(Decimal::nearest(-12.3456, 3), Decimal::new(-12_346, 3).unwrap());
        assert_eq!(Decimal::nearest(12_345.678, 3), Decimal::new(1_234_568, 2).unwrap());
        assert_eq!(Decimal::nearest(1e12, 3), Decimal::ZERO);
        assert_eq!(Decimal::new(100_000_000, 0), None);
        assert_eq!(Decimal::new(-10_000_000, 0), None);
    }

    fn any_decimal() -> impl proptest::strategy::Strategy<Value = Decimal> {
        use proptest::prelude::*;
        (any::<bool>(), 0u8..8, 0..100_000_000_i32).prop_map(|(negative, places, digits)| {
            let room = 8 - u8::from(negative) - u8::from(places > 0);
            let mantissa = if room == 8 { digits } else { digits % POWERS_OF_TEN[usize::from(room)] };
            Decimal::new(if negative { -mantissa } else { mantissa }, places.min(room)).unwrap()
        })
    }

    fn any_line() -> impl proptest::strategy::Strategy<Value = LineReading> {
        use proptest::prelude::*;
        let stamp = (0u8..100, 0u16..10_000, proptest::array::uniform5(0u8..100), 0u16..1000).prop_map(
            |(winch, year, month_to_second, millisecond)| Stamp { winch, year, month_to_second, millisecond },
        );
        (proptest::option::of(stamp), any_decimal(), any_decimal(), any_decimal())
            .prop_map(|(stamp, tension, speed, payout)| LineReading { stamp, tension, speed, payout })
    }

    headrace_sensor::codec_contract!(
        contract,
        codec: LineCodec::default(),
        values: any_line(),
        encode: LineReading::encode,
        frames: [PROTOCOL_1, RECORDED],
    );
}
