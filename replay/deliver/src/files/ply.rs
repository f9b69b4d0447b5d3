//! Points as binary PLY. It is written first, and the other formats are made from it.

use std::io::{BufRead as _, BufReader, BufWriter, Read, Seek, SeekFrom, Write};

use super::data::{FRAME, FileInfo, Point};
use super::error::FileError;
use super::rounding::{PER_H, PER_M, PER_S, RoundedPoint};

const WHAT: &str = "points as PLY";
/// Properties of a point, in the order of its bytes.
const PROPERTIES: [(&str, &str); 9] = [
    ("double", "x"),
    ("double", "y"),
    ("double", "z"),
    ("float", "range_m"),
    ("float", "position_sd_m"),
    ("float", "clock_h"),
    ("double", "time_s"),
    ("uchar", "head"),
    ("uchar", "doubtful"),
];
/// Length of a point in bytes.
const RECORD: usize = 3 * 8 + 3 * 4 + 8 + 2;
/// Number of digits that the header reserves for the number of points.
const COUNT_DIGITS: usize = 20;

/// Writes points one by one. Memory does not grow with their number.
pub struct PointWriter<'a, W: Write + Seek> {
    write: BufWriter<W>,
    info: &'a FileInfo,
    count: u64,
}

impl<'a, W: Write + Seek> PointWriter<'a, W> {
    /// Begins a file.
    pub fn new(write: W, info: &'a FileInfo) -> Result<Self, FileError> {
        let mut write = BufWriter::new(write);
        write.write_all(header(info, 0).as_bytes()).map_err(FileError::io(WHAT))?;
        Ok(Self { write, info, count: 0 })
    }

    /// Writes a point.
    ///
    /// Errors: a value is not finite or too large; the stream fails.
    pub fn add(&mut self, point: &Point) -> Result<(), FileError> {
        let rounded = RoundedPoint::new(self.count, point)?;
        let mut record = [0; RECORD];
        let mut place = record.as_mut_slice();
        let mut put = |bytes: &[u8]| place.write_all(bytes);
        #[expect(clippy::cast_possible_truncation, reason = "the format has 32 bits for it")]
        let single = |steps: u32, per_unit: f64| ((f64::from(steps) / per_unit) as f32).to_le_bytes();
        let [x, y, z] = rounded.position_m().map(f64::to_le_bytes);
        let written = put(&x)
            .and_then(|()| put(&y))
            .and_then(|()| put(&z))
            .and_then(|()| put(&single(rounded.range_mm, PER_M)))
            .and_then(|()| put(&single(rounded.position_sd_mm, PER_M)))
            .and_then(|()| put(&single(u32::from(rounded.clock_ch), PER_H)))
            .and_then(|()| put(&(rounded.time_ms as f64 / PER_S).to_le_bytes()))
            .and_then(|()| put(&[rounded.head, rounded.doubtful]))
            .and_then(|()| self.write.write_all(&record));
        self.count += 1;
        written.map_err(FileError::io(WHAT))
    }

    /// Writes the number of points into the header, and returns it.
    pub fn finish(mut self) -> Result<u64, FileError> {
        let written = self.write.seek(SeekFrom::Start(0));
        written
            .and_then(|_| self.write.write_all(header(self.info, self.count).as_bytes()))
            .and_then(|()| self.write.flush())
            .map_err(FileError::io(WHAT))?;
        Ok(self.count)
    }
}

/// Header of a file. Its length does not depend on the number of points.
fn header(info: &FileInfo, count: u64) -> String {
    // Other characters are replaced, because some readers accept only ASCII.
    let one_line =
        |text: &str| text.replace(['\n', '\r'], " ").replace(|character| !char::is_ascii(&character), "?");
    let digits = count.to_string();
    let properties = PROPERTIES.map(|(kind, name)| format!("property {kind} {name}\n")).concat();
    format!(
        "ply\nformat binary_little_endian 1.0\ncomment {}\ncomment {FRAME}\ncomment {}{}\n\
         element vertex {digits}\n{properties}end_header\n",
        one_line(&info.title),
        one_line(&info.program),
        // Some readers accept neither leading zeros nor spaces in the count, so a comment is padded to keep the
        // header's length.
        " ".repeat(COUNT_DIGITS - digits.len()),
    )
}

/// Reads the points of a file that [`PointWriter`] has written.
///
/// Errors: the stream fails or ends early; the header is not that of such a file.
pub fn read_points<R: Read + Seek>(
    mut read: R,
) -> Result<impl Iterator<Item = Result<Point, FileError>>, FileError> {
    read.seek(SeekFrom::Start(0)).map_err(FileError::io(WHAT))?;
    let mut read = BufReader::new(read);
    let (mut count, mut properties) = (None, 0);
    loop {
        let mut line = String::new();
        read.read_line(&mut line).map_err(FileError::io(WHAT))?;
        let words = line.split_whitespace().collect::<Vec<_>>();
        match words.as_slice() {
            ["ply" | "comment", ..] | ["format", "binary_little_endian", "1.0"] => {}
            ["element", "vertex", number] => count = number.parse::<u64>().ok(),
            ["property", kind, name] if PROPERTIES.get(properties) == Some(&(kind, name)) => properties += 1,
            ["end_header"] if properties == PROPERTIES.len() => break,
            _ => return Err(FileError::encoding(WHAT)(format!("unexpected line {line:?} in the header"))),
        }
    }
    let count = count.ok_or_else(|| FileError::encoding(WHAT)("the header has no number of points"))?;
    Ok((0..count).map(move |_| {
        let mut record = [0; RECORD];
        read.read_exact(&mut record).map_err(FileError::io(WHAT))?;
        Ok(point(&record))
    }))
}

/// Point of a record.
fn point(record: &[u8; RECORD]) -> Point {
    fn part<const N: usize>(record: &[u8], at: usize) -> [u8; N] {
        record.get(at..at + N).and_then(|bytes| bytes.try_into().ok()).unwrap_or([0; N])
    }
    let single = |at| f64::from(f32::from_le_bytes(part(record, at)));
    Point {
        position_m: [0, 8, 16].map(|at| f64::from_le_bytes(part(record, at))),
        range_m: single(24),
        position_sd_m: single(28),
        clock_h: single(32),
        time_s: f64::from_le_bytes(part(record, 36)),
        head: record[44],
        is_doubtful: record[45] != 0,
    }
}
