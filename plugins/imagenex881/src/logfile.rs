//! Log files of the maker's software: a 100-byte header before each raw return.
//!
//! The format is documented for the 852 (`.852`) and the 81S, and inferred for the heads (`.81A`, `.81B`, `.31L`).
//! Source: Imagenex 852 file format.

use headrace_sensor::geometry::time::DurNs;

const HEADER_BYTES: usize = 100;
const MAGICS: [[u8; 3]; 5] = [*b"852", *b"81A", *b"81B", *b"81S", *b"31L"];
const MONTHS: [[u8; 3]; 12] = [
    *b"Jan", *b"Feb", *b"Mar", *b"Apr", *b"May", *b"Jun", *b"Jul", *b"Aug", *b"Sep", *b"Oct", *b"Nov",
    *b"Dec",
];

/// Iterates over the shots of a log file. The iteration ends after the first error.
#[derive(Debug, Clone)]
pub struct LogFile<'a> {
    bytes: &'a [u8],
    offset: usize,
}

/// One shot of a log file: a header and a return.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Shot<'a> {
    /// Three-letter model name of the device.
    pub model: [u8; 3],
    /// Day, month (1 to 12) and year; `None` if the field isn't a date.
    pub date: Option<(u8, u8, u16)>,
    /// Time of day; `None` if the field isn't a time.
    pub time_of_day: Option<DurNs>,
    /// Speed of sound that is set in the software, m/s.
    pub sound_speed_mps: f64,
    /// The return as sent by the device.
    pub raw: &'a [u8],
}

/// A reason why the reading of a log file stops.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum LogFileError {
    /// There is no shot header at the expected offset.
    #[error("log file: shot at byte {offset} begins with {got:02X?}; allowed are 852, 81A, 81B, 81S, 31L")]
    Magic {
        /// Offset of the shot in the file.
        offset: usize,
        /// The three bytes found at this offset.
        got: [u8; 3],
    },
    /// The file ends within a shot.
    #[error("log file: shot at byte {offset} needs {needed} bytes and the file has {left} more")]
    Short {
        /// Offset of the shot in the file.
        offset: usize,
        /// Number of bytes that the shot needs.
        needed: usize,
        /// Number of bytes left in the file.
        left: usize,
    },
    /// The return is longer than the shot.
    #[error(
        "log file: shot at byte {offset} has {total} bytes, but it needs more: a header of 100 and a return of {raw}"
    )]
    Lengths {
        /// Offset of the shot in the file.
        offset: usize,
        /// Length of the shot as stated in its header.
        total: usize,
        /// Length of the return as stated in its header.
        raw: usize,
    },
}

impl<'a> LogFile<'a> {
    /// Creates an iterator over the bytes of a whole file.
    pub fn new(bytes: &'a [u8]) -> Self {
        Self { bytes, offset: 0 }
    }

    fn shot(&self) -> Result<(Shot<'a>, &'a [u8]), LogFileError> {
        let offset = self.offset;
        let short = |needed| LogFileError::Short { offset, needed, left: self.bytes.len() };
        let (header, body) =
            self.bytes.split_first_chunk::<HEADER_BYTES>().ok_or_else(|| short(HEADER_BYTES))?;
        let [m0, m1, m2, _, t0, t1, n0, n1, ..] = *header;
        let model = [m0, m1, m2];
        if !MAGICS.contains(&model) {
            return Err(LogFileError::Magic { offset, got: model });
        }
        let total = usize::from(u16::from_be_bytes([t0, t1]));
        let raw = usize::from(u16::from_be_bytes([n0, n1]));
        if total < HEADER_BYTES + raw {
            return Err(LogFileError::Lengths { offset, total, raw });
        }
        let (body, rest) = body.split_at_checked(total - HEADER_BYTES).ok_or_else(|| short(total))?;
        let shot = Shot {
            model,
            date: header.get(8..19).and_then(date),
            time_of_day: header.get(20..32).and_then(time_of_day),
            sound_speed_mps: header.get(46..48).map_or(1500.0, sound_speed_mps),
            raw: body.get(..raw).unwrap_or_default(),
        };
        Ok((shot, rest))
    }
}

impl<'a> Iterator for LogFile<'a> {
    type Item = Result<Shot<'a>, LogFileError>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.bytes.is_empty() {
            return None;
        }
        let shot = self.shot();
        let rest = shot.map_or(&[][..], |(_, rest)| rest);
        self.offset += self.bytes.len() - rest.len();
        self.bytes = rest;
        Some(shot.map(|(shot, _)| shot))
    }
}

/// Parses a date, `DD-MMM-YYYY`.
fn date(field: &[u8]) -> Option<(u8, u8, u16)> {
    let &[d0, d1, b'-', m0, m1, m2, b'-', y0, y1, y2, y3] = field else { return None };
    let month = (1..).zip(MONTHS).find(|(_, letters)| *letters == [m0, m1, m2])?.0;
    let century = u16::from(two_digits(y0, y1)?);
    Some((two_digits(d0, d1)?, month, century * 100 + u16::from(two_digits(y2, y3)?)))
}

/// Parses a time: `HH:MM:SS`, a zero byte, `.hh`.
fn time_of_day(field: &[u8]) -> Option<DurNs> {
    let &[h0, h1, b':', m0, m1, b':', s0, s1, 0, b'.', c0, c1] = field else { return None };
    let part = |tens, ones, limit| two_digits(tens, ones).filter(|part| *part < limit).map(i64::from);
    let seconds = (part(h0, h1, 24)? * 60 + part(m0, m1, 60)?) * 60 + part(s0, s1, 60)?;
    Some(DurNs::from_millis(seconds * 1000 + part(c0, c1, 100)? * 10))
}

fn two_digits(tens: u8, ones: u8) -> Option<u8> {
    let digit = |byte: u8| byte.is_ascii_digit().then(|| byte - b'0');
    Some(digit(tens)? * 10 + digit(ones)?)
}

/// Speed of sound, m/s. Bit 15 marks a value set by the user, in tenths of m/s; otherwise the speed is 1500.
fn sound_speed_mps(field: &[u8]) -> f64 {
    match *field {
        [high, low] if high & 0x80 != 0 => f64::from(u16::from_be_bytes([high & 0x7F, low])) / 10.0,
        _ => 1500.0,
    }
}

#[cfg(test)]
mod tests {
    use headrace_sensor::codec::Codec as _;

    use super::*;
    use crate::codec::{Model, Return, ReturnCodec, Tag};

    fn returns(file: &[u8]) -> Vec<Return> {
        LogFile::new(file).map(|shot| Return::decode(shot.unwrap().raw, None).unwrap()).collect()
    }

    fn check_all(returns: &[Return]) {
        for value in returns {
            let header = value.header;
            assert_eq!((header.tag, header.head_id, header.position), (Tag::Igx, 0x11, 1400));
            assert!(header.status.accepted() && value.echo.as_slice().len() == 500);
        }
    }

    /// Asserts that a stream codec finds every return in the whole file, and skips headers and fill bytes.
    fn check_stream(file: &[u8], expected: &[Return]) {
        for piece in [file.len(), 1, 97] {
            let (mut codec, mut got) = (ReturnCodec::default(), Vec::new());
            file.chunks(piece).for_each(|bytes| codec.push(bytes, &mut |value| got.push(value)));
            assert_eq!(got, expected);
            let left = codec.counts().skipped_bytes + codec.held_bytes() as u64;
            assert_eq!(left, expected.len() as u64 * 127);
        }
    }

    #[test]
    fn real_sounder_log_is_read() {
        // For each file, the number of shots, and how many of these have an echo.
        let counts = [(300, 203), (917, 452)];
        let name = "imagenex852_cidco/19_26_51-2016_11_18-sonar.852";
        for (path, (shots, echoes)) in headrace_support::recordings::both(name, counts[0], counts[1]) {
            let file = std::fs::read(path).unwrap();
            let returns = returns(&file);
            assert_eq!(returns.len(), shots);
            check_all(&returns);
            check_stream(&file, &returns);
            let with_echo: Vec<u32> =
                returns.iter().filter_map(|value| value.header.profile_mm(Model::Sounder852)).collect();
            assert_eq!((with_echo.len(), with_echo.iter().max()), (echoes, Some(&9960)));
            let first = LogFile::new(&file).next().unwrap().unwrap();
            assert_eq!(first.date, Some((18, 11, 2016)));
            assert_eq!(first.time_of_day, Some(DurNs::from_millis(70_150_170)));
            assert_eq!(first.sound_speed_mps.to_bits(), 1460.0_f64.to_bits());
        }
    }

    #[test]
    fn log_with_sonar_bytes_in_the_time_field_is_read() {
        for (path, shots) in headrace_support::recordings::both("imagenex852_cidco/hydroball.852", 50, 177) {
            let file = std::fs::read(path).unwrap();
            let returns = returns(&file);
            assert_eq!(returns.len(), shots);
            check_all(&returns);
            check_stream(&file, &returns);
            assert_eq!(returns[0].header.profile_mm(Model::Sounder852), Some(4480));
            for shot in LogFile::new(&file) {
                let shot = shot.unwrap();
                assert_eq!((shot.date.map(|date| date.2), shot.time_of_day), (Some(2019), None));
            }
        }
    }

    #[test]
    fn truncated_file_gives_whole_shots_and_then_an_error_with_offset() {
        let mut shot = [0; 128];
        shot[..8].copy_from_slice(b"81A\0\0\x80\0\x0D");
        let file = [shot; 3].concat();
        for len in 0..=file.len() {
            let shots: Vec<_> = LogFile::new(&file[..len]).collect();
            assert_eq!(shots.iter().filter(|shot| shot.is_ok()).count(), len / 128);
            let short = matches!(shots.last(), Some(Err(LogFileError::Short { offset, .. })) if *offset == len / 128 * 128);
            assert_eq!(short, len % 128 != 0);
        }
    }

    #[test]
    fn file_that_is_no_log_is_reported() {
        let error = LogFile::new(&[0x41; 200]).next().unwrap().unwrap_err();
        assert_eq!(error, LogFileError::Magic { offset: 0, got: [0x41; 3] });
        let mut lying = [0; 200];
        lying[..8].copy_from_slice(b"852\x03\0\x80\x02\x01");
        let error = LogFile::new(&lying).next().unwrap().unwrap_err();
        assert_eq!(error, LogFileError::Lengths { offset: 0, total: 128, raw: 513 });
    }
}
