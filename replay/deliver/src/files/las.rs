//! Points as LAS 1.4, point format 6 with extra bytes, and compressed as LAZ.
//!
//! The crate `las` is used in tests only: after a failed write, for instance on a full disk, it panics when dropped, and a
//! file without points gets infinite bounds. Source: LAS Specification 1.4 R15, ASPRS, tables 3, 5, 15 and 24.

use std::io::{BufWriter, Seek, SeekFrom, Write};

use laz::{LasZipCompressor, LazItemRecordBuilder, LazVlr};

use super::data::{FRAME, FRAME_WKT, FileInfo, Point};
use super::error::FileError;
use super::rounding::{PER_M, PER_S, RoundedPoint};

const WHAT: &str = "points as LAS";
const HEADER: u16 = 375;
const FORMAT: u8 = 6;
/// Flag of compressed points in the header's point format.
const COMPRESSED: u8 = 0x80;
/// Flag in the header: the coordinate system is given as well-known text.
const WKT: u16 = 1 << 4;
/// Values of a point that LAS has no field for: name, unit, type and scale. Source: LAS specification, table 24.
const EXTRA: [(&str, &str, u8, f64); 5] = [
    ("range_m", "range from the head, m", UNSIGNED_32, 0.001),
    ("position_sd_m", "sd of position, m, 1000: unknown", UNSIGNED_32, 0.001),
    ("clock_h", "clock position, h", UNSIGNED_16, 0.01),
    ("head", "number of the head", UNSIGNED_8, 1.0),
    ("doubtful", "1: may not be wall", UNSIGNED_8, 1.0),
];
const UNSIGNED_8: u8 = 1;
const UNSIGNED_16: u8 = 3;
const UNSIGNED_32: u8 = 5;
/// Flag of an extra value that means that its scale is used.
const SCALED: u8 = 1 << 3;
/// Length of a point's record, and length of its extra values, in bytes.
const RECORD: usize = 30 + EXTRA_BYTES as usize;
const EXTRA_BYTES: u16 = 4 + 4 + 2 + 1 + 1;

/// Number and bounds of the points, in mm.
#[derive(Default)]
struct Extent {
    count: u64,
    least_mm: [i32; 3],
    most_mm: [i32; 3],
}

impl Extent {
    fn add(&mut self, point: &RoundedPoint) {
        let is_first = self.count == 0;
        for (axis, &mm) in point.position_mm.iter().enumerate() {
            self.least_mm[axis] = if is_first { mm } else { mm.min(self.least_mm[axis]) };
            self.most_mm[axis] = if is_first { mm } else { mm.max(self.most_mm[axis]) };
        }
        self.count += 1;
    }
}

/// Writes points, compressed for a LAZ file, and returns their number. Memory does not grow with this number.
///
/// Errors: a value is not finite or too large; the stream fails.
pub fn write<W: Write + Seek + Send + Sync>(
    write: W,
    info: &FileInfo,
    is_compressed: bool,
    points: impl Iterator<Item = Result<Point, FileError>>,
) -> Result<u64, FileError> {
    let mut write = BufWriter::new(write);
    let items = LazItemRecordBuilder::default_for_point_format_id(FORMAT, EXTRA_BYTES)
        .map_err(FileError::encoding(WHAT))?;
    let vlr = LazVlr::from_laz_items(items);
    let records = variable_records(info, is_compressed.then_some(&vlr)).map_err(FileError::io(WHAT))?;
    let header = Header { info, records: &records, is_compressed };
    let begun = write.write_all(&header.bytes(&Extent::default()));
    begun.and_then(|()| write.write_all(&records.bytes)).map_err(FileError::io(WHAT))?;
    let mut extent = Extent::default();
    let rounded = points.map(|point| {
        let point = RoundedPoint::new(extent.count, &point?)?;
        extent.add(&point);
        Ok(record(&point))
    });
    if is_compressed {
        let mut compressor = LasZipCompressor::new(&mut write, vlr).map_err(FileError::encoding(WHAT))?;
        for record in rounded {
            compressor.compress_one(&record?).map_err(FileError::io(WHAT))?;
        }
        compressor.done().map_err(FileError::io(WHAT))?;
    } else {
        for record in rounded {
            write.write_all(&record?).map_err(FileError::io(WHAT))?;
        }
    }
    let begin = write.seek(SeekFrom::Start(0));
    begin
        .and_then(|_| write.write_all(&header.bytes(&extent)))
        .and_then(|()| write.flush())
        .map_err(FileError::io(WHAT))?;
    Ok(extent.count)
}

/// Bytes of a point.
fn record(point: &RoundedPoint) -> [u8; RECORD] {
    let mut bytes = [0; RECORD];
    let mut at = 0;
    let mut put = |value: &[u8]| {
        if let Some(place) = bytes.get_mut(at..at + value.len()) {
            place.copy_from_slice(value);
        }
        at += value.len();
    };
    point.position_mm.iter().for_each(|mm| put(&mm.to_le_bytes()));
    // The bytes mean: intensity; return 1 of 1; flags; unclassified; user data, angle and point source.
    put(&[0, 0, 0x11, 0, 1, 0, 0, 0, 0, 0]);
    put(&(point.time_ms as f64 / PER_S).to_le_bytes());
    put(&point.range_mm.to_le_bytes());
    put(&point.position_sd_mm.to_le_bytes());
    put(&point.clock_ch.to_le_bytes());
    put(&[point.head, point.doubtful]);
    bytes
}

/// Text as a field of fixed length, filled with zeros. Characters beyond ASCII are replaced.
fn field<const N: usize>(text: &str) -> [u8; N] {
    let mut field = [0; N];
    for (slot, character) in field.iter_mut().zip(text.chars()) {
        *slot = u8::try_from(character).ok().filter(u8::is_ascii).unwrap_or(b'?');
    }
    field
}

/// Variable length records between header and points.
#[derive(Default)]
struct VariableRecords {
    bytes: Vec<u8>,
    count: u32,
}

impl VariableRecords {
    /// Adds a record. Data longer than 65,535 bytes are cut.
    fn add(&mut self, user: &str, number: u16, description: &str, data: &[u8]) {
        let length = u16::try_from(data.len()).unwrap_or(u16::MAX);
        self.bytes.extend([0, 0]);
        self.bytes.extend(field::<16>(user));
        self.bytes.extend(number.to_le_bytes());
        self.bytes.extend(length.to_le_bytes());
        self.bytes.extend(field::<32>(description));
        self.bytes.extend(data.iter().take(usize::from(length)));
        self.count += 1;
    }
}

/// Records that state the frame, the title and the extra values.
fn variable_records(info: &FileInfo, compression: Option<&LazVlr>) -> std::io::Result<VariableRecords> {
    let mut records = VariableRecords::default();
    records.add("LASF_Projection", 2112, "frame", format!("{FRAME_WKT}\0").as_bytes());
    let text = format!("{}\n{FRAME}\nGPS time is dive time, s\0", info.title);
    records.add("LASF_Spec", 3, "title", text.as_bytes());
    let mut extra = Vec::new();
    for (name, description, kind, scale) in EXTRA {
        extra.extend([0, 0, kind, if kind == UNSIGNED_8 { 0 } else { SCALED }]);
        extra.extend(field::<32>(name));
        // The zeros stand for unused bytes, the value for no data, and the least and largest value.
        extra.extend([0; 4 + 3 * 24]);
        extra.extend(scale.to_le_bytes());
        // The zeros stand for the rest of the scale, and for the offset.
        extra.extend([0; 16 + 24]);
        extra.extend(field::<32>(description));
    }
    records.add("LASF_Spec", 4, "extra bytes", &extra);
    if let Some(vlr) = compression {
        let mut data = Vec::new();
        vlr.write_to(&mut data)?;
        records.add(LazVlr::USER_ID, LazVlr::RECORD_ID, LazVlr::DESCRIPTION, &data);
    }
    Ok(records)
}

/// Contents of the public header block.
struct Header<'a> {
    info: &'a FileInfo,
    records: &'a VariableRecords,
    is_compressed: bool,
}

impl Header<'_> {
    /// Bytes of the public header block. Source: LAS specification, table 3.
    fn bytes(&self, extent: &Extent) -> Vec<u8> {
        let (day, year) = self.info.date.map_or((0, 0), |date| (date.day, date.year));
        let points_at = usize::from(HEADER) + self.records.bytes.len();
        let mut bytes = b"LASF\0\0".to_vec();
        bytes.extend(WKT.to_le_bytes());
        bytes.extend(self.info.id);
        bytes.extend([1, 4]);
        bytes.extend(field::<32>("scanning sonar"));
        bytes.extend(field::<32>(&self.info.program));
        bytes.extend([day, year, HEADER].iter().flat_map(|value| value.to_le_bytes()));
        bytes.extend(u32::try_from(points_at).unwrap_or(u32::MAX).to_le_bytes());
        bytes.extend(self.records.count.to_le_bytes());
        bytes.push(FORMAT | if self.is_compressed { COMPRESSED } else { 0 });
        bytes.extend((30 + EXTRA_BYTES).to_le_bytes());
        // The zeros are the numbers of points as in earlier versions, which don't have this point format.
        bytes.extend([0; 6 * 4]);
        bytes.extend(
            [1.0 / PER_M, 1.0 / PER_M, 1.0 / PER_M, 0.0, 0.0, 0.0_f64].iter().flat_map(|v| v.to_le_bytes()),
        );
        for (least, most) in extent.least_mm.iter().zip(extent.most_mm) {
            bytes.extend((f64::from(most) / PER_M).to_le_bytes());
            bytes.extend((f64::from(*least) / PER_M).to_le_bytes());
        }
        // The file has neither waveforms nor extended variable length records.
        bytes.extend([0; 8 + 8 + 4]);
        // Number of all points, and number of points by return. All of them are first returns.
        bytes.extend(extent.count.to_le_bytes());
        bytes.extend(extent.count.to_le_bytes());
        bytes.extend([0; 14 * 8]);
        bytes
    }
}
