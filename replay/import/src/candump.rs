//! Logs of `candump -l` and `candump -L`, with one frame per line: `(1436509052.249713) can0 044#2A366C2B`.
//!
//! Source: can-utils, whose `lib.h` describes the format.

use crate::entry::{Clock, Entry, Step};
use crate::format::Format;

/// Length of a SocketCAN `can_frame`, bytes.
const FRAME_BYTES: usize = 16;
const EXTENDED: u32 = 1 << 31;
const REMOTE: u32 = 1 << 30;
const STANDARD_IDS: u32 = 0x7FF;
const EXTENDED_IDS: u32 = 0x1FFF_FFFF;
const LONGEST_LINE: usize = 512;

/// The candump format, whose streams are the CAN interfaces.
#[derive(Debug, Clone, Copy, Default)]
pub struct Candump;

impl Format for Candump {
    fn clock(&self) -> Clock {
        Clock::Utc
    }

    fn step(&mut self, front: &[u8], end: bool, out: &mut Vec<Entry>) -> Step {
        let newline = front.iter().take(LONGEST_LINE).position(|byte| *byte == b'\n');
        let (line, used) = match newline {
            Some(at) => (front.get(..at).unwrap_or_default(), at + 1),
            None if front.len() >= LONGEST_LINE => {
                return Step::Lost(LONGEST_LINE, "no line of candump");
            }
            None if end => (front, front.len()),
            None => return Step::More,
        };
        let text = line.trim_ascii();
        if text.is_empty() {
            return Step::Took(used);
        }
        match entry(text) {
            Ok(entry) => {
                out.extend(entry);
                Step::Took(used)
            }
            // A last line without a newline may be truncated anywhere. If it can't be parsed, it counts as incomplete.
            Err(_) if newline.is_none() => Step::More,
            Err(why) => Step::Lost(used, why),
        }
    }
}

const NO_LINE: &str = "no line of candump";

/// Parses a line of the file. Returns `None` for a frame that the logging machine sent itself.
fn entry(line: &[u8]) -> Result<Option<Entry>, &'static str> {
    let line = str::from_utf8(line).map_err(|_| NO_LINE)?;
    let mut fields = line.split_ascii_whitespace();
    let (stamp, stream, frame) = (fields.next(), fields.next(), fields.next());
    let stamp = stamp.and_then(|field| field.strip_prefix('(')?.strip_suffix(')')).ok_or(NO_LINE)?;
    let stamp_ns = nanoseconds(stamp).ok_or(NO_LINE)?;
    let (stream, frame) = stream.zip(frame).ok_or(NO_LINE)?;
    match (fields.next(), fields.next()) {
        (None | Some("R"), None) => (),
        (Some("T"), None) => return Ok(None),
        _ => return Err(NO_LINE),
    }
    Ok(Some(Entry { stamp_ns, stream: stream.to_owned(), bytes: can_frame(frame)?.to_vec() }))
}

/// Parses seconds with a fraction of up to nine places.
fn nanoseconds(text: &str) -> Option<u64> {
    let (seconds, fraction) = text.split_once('.')?;
    let digits = |text: &str| !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit());
    if !digits(seconds) || !digits(fraction) || fraction.len() > 9 {
        return None;
    }
    let scale = 10_u64.checked_pow(9 - u32::try_from(fraction.len()).ok()?)?;
    let whole = seconds.parse::<u64>().ok()?.checked_mul(1_000_000_000)?;
    whole.checked_add(fraction.parse::<u64>().ok()? * scale)
}

/// Parses a frame such as `044#2A366C2B` or `12345678#R`. An identifier of eight digits is an extended one.
fn can_frame(text: &str) -> Result<[u8; FRAME_BYTES], &'static str> {
    let (id_text, data_text) = text.split_once('#').ok_or(NO_LINE)?;
    if data_text.starts_with('#') {
        return Err("a CAN FD frame, which no supported sensor sends");
    }
    let hexadecimal = id_text.bytes().all(|byte| byte.is_ascii_hexdigit());
    let number = u32::from_str_radix(id_text, 16).ok().filter(|_| hexadecimal).ok_or(NO_LINE)?;
    let id = match id_text.len() {
        3 if number <= STANDARD_IDS => number,
        8 if number <= EXTENDED_IDS => number | EXTENDED,
        // Error frames of the CAN controller have the error flag, bit 29, in their identifier.
        8 if number >> 29 == 1 => number,
        _ => return Err(NO_LINE),
    };
    let mut data = [0_u8; 8];
    let (flags, len) = match data_text.strip_prefix('R') {
        Some("") => (REMOTE, 0),
        Some(len) => (REMOTE, len.parse::<u8>().ok().filter(|len| *len <= 8).ok_or(NO_LINE)?),
        None => (0, data_bytes(data_text, &mut data)?),
    };
    let mut frame = [0_u8; FRAME_BYTES];
    let [i0, i1, i2, i3] = (id | flags).to_le_bytes();
    let [d0, d1, d2, d3, d4, d5, d6, d7] = data;
    frame.copy_from_slice(&[i0, i1, i2, i3, len, 0, 0, 0, d0, d1, d2, d3, d4, d5, d6, d7]);
    Ok(frame)
}

/// Parses pairs of hexadecimal digits. Dots between the digits are ignored.
///
/// A suffix such as `_E` states the raw length of the frame, and is ignored too.
fn data_bytes(text: &str, data: &mut [u8; 8]) -> Result<u8, &'static str> {
    let text = text.split_once('_').map_or(text, |(data, _)| data);
    let digits: Vec<u8> = text.bytes().filter(|byte| *byte != b'.').collect();
    let (pairs, rest) = digits.as_chunks::<2>();
    if !rest.is_empty() || pairs.len() > data.len() {
        return Err(NO_LINE);
    }
    for (byte, [high, low]) in data.iter_mut().zip(pairs) {
        let digit = |digit: u8| char::from(digit).to_digit(16).and_then(|value| u8::try_from(value).ok());
        *byte = digit(*high).zip(digit(*low)).map(|(high, low)| high << 4 | low).ok_or(NO_LINE)?;
    }
    u8::try_from(pairs.len()).map_err(|_| NO_LINE)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(line: &str) -> Result<Option<Entry>, &'static str> {
        entry(line.as_bytes())
    }

    #[test]
    fn candump_lines_are_parsed_as_can_frames() {
        let got = read("(1436509052.249713) vcan0 044#2A366C2B").unwrap().unwrap();
        assert_eq!((got.stamp_ns, got.stream.as_str()), (1_436_509_052_249_713_000, "vcan0"));
        assert_eq!(got.bytes, [0x44, 0, 0, 0, 4, 0, 0, 0, 0x2A, 0x36, 0x6C, 0x2B, 0, 0, 0, 0]);
        let extended = read("(0.5) can1 0CF02D80#0102030405060708 R").unwrap().unwrap();
        assert_eq!(extended.stamp_ns, 500_000_000);
        assert_eq!(extended.bytes, [0x80, 0x2D, 0xF0, 0x8C, 8, 0, 0, 0, 1, 2, 3, 4, 5, 6, 7, 8]);
        let remote = read("(1.000000) can0 123#R3").unwrap().unwrap();
        assert_eq!(remote.bytes[..5], [0x23, 1, 0, 0x40, 3]);
        let error = read("(1.000000) can0 20000004#0004000000000000").unwrap().unwrap();
        assert_eq!(error.bytes[..5], [4, 0, 0, 0x20, 8]);
        assert_eq!(read("(1.000000) can0 123#11.22").unwrap().unwrap().bytes[8..10], [0x11, 0x22]);
        assert_eq!(read("(1.000000) can0 123#11 T"), Ok(None));
    }

    #[test]
    fn invalid_candump_lines_are_refused() {
        for line in [
            "can0 123 [2] 11 22",
            "(1.0) can0",
            "(1) can0 123#11",
            "(1.0) can0 123#1",
            "(1.0) can0 123#112233445566778899",
            "(1.0) can0 800#",
            "(1.0) can0 +12#",
            "(1.0) can0 12#",
            "(-1.0) can0 123#",
            "(99999999999999999999.0) can0 123#",
            "(1.0) can0 123#R9",
            "(1.0) can0 123#é1",
        ] {
            assert!(read(line).is_err(), "{line}");
        }
        assert!(read("(1.0) can0 123##011").unwrap_err().contains("CAN FD"));
    }
}
