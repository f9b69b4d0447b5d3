//! Points as text, one per line.

use std::io::{BufWriter, Write};

use super::data::{FRAME, FileInfo, Point};
use super::error::FileError;
use super::rounding::{RoundedPoint, push_decimal};

const WHAT: &str = "points as XYZ";

/// Writes points. Lines that begin with # are comments. Memory does not grow with the number of points.
///
/// Errors: a value is not finite or too large; the stream fails.
pub fn write(
    write: impl Write,
    info: &FileInfo,
    points: impl Iterator<Item = Result<Point, FileError>>,
) -> Result<u64, FileError> {
    let mut write = BufWriter::new(write);
    let title = info.title.replace(['\n', '\r'], " ");
    let header =
        format!("# {title}\n# {FRAME}\n# x y z range_m position_sd_m clock_h time_s head doubtful\n");
    write.write_all(header.as_bytes()).map_err(FileError::io(WHAT))?;
    let (mut count, mut line) = (0, Vec::new());
    for point in points {
        let point = RoundedPoint::new(count, &point?)?;
        line.clear();
        for mm in point.position_mm {
            push_decimal(&mut line, i64::from(mm), 3);
            line.push(b' ');
        }
        let others = [
            (i64::from(point.range_mm), 3),
            (i64::from(point.position_sd_mm), 3),
            (i64::from(point.clock_ch), 2),
            (point.time_ms, 3),
            (i64::from(point.head), 0),
            (i64::from(point.doubtful), 0),
        ];
        for (steps, digits) in others {
            push_decimal(&mut line, steps, digits);
            line.push(b' ');
        }
        line.pop();
        line.push(b'\n');
        write.write_all(&line).map_err(FileError::io(WHAT))?;
        count += 1;
    }
    write.flush().map_err(FileError::io(WHAT))?;
    Ok(count)
}
