//! Sections, profile, findings and track as CSV (RFC 4180), UTF-8, with units in the names of the columns.

use std::io::{BufWriter, Write};

use super::data::{Edges, Finding, ProfileStation, Section, TrackPoint};
use super::error::FileError;
use super::rounding::{push_decimal, steps};

/// Number of decimals of lengths, angles and times, for mm, 0.01 degrees and ms.
const M: usize = 3;
const DEG: usize = 2;
const S: usize = 3;

/// Value of a cell.
enum Cell<'a> {
    Text(&'a str),
    /// A number, and how many digits it has after the point. `None` gives an empty cell.
    Number(Option<f64>, usize),
}

/// Table that is written row by row.
struct Table<W: Write> {
    write: BufWriter<W>,
    what: &'static str,
    columns: &'static str,
    line: Vec<u8>,
    rows: u64,
}

impl<W: Write> Table<W> {
    fn new(write: W, what: &'static str, columns: &'static str) -> Result<Self, FileError> {
        let mut table = Self { write: BufWriter::new(write), what, columns, line: Vec::new(), rows: 0 };
        let header = format!("{columns}\r\n");
        table.write.write_all(header.as_bytes()).map_err(FileError::io(what))?;
        Ok(table)
    }

    fn row(&mut self, cells: &[Cell]) -> Result<(), FileError> {
        debug_assert_eq!(cells.len(), self.columns.split(',').count(), "one cell per column");
        self.line.clear();
        for (cell, column) in cells.iter().zip(self.columns.split(',')) {
            match *cell {
                Cell::Text(text) => self.line.extend(quoted(text).as_bytes()),
                Cell::Number(None, _) => {}
                Cell::Number(Some(value), digits) => {
                    let per_unit = [1.0, 10.0, 100.0, 1000.0].get(digits).copied().unwrap_or(1000.0);
                    let place = || format!("{column} in row {} of {}", self.rows + 1, self.what);
                    // The conversion is exact, because doubles hold whole numbers up to 2^53.
                    push_decimal(
                        &mut self.line,
                        steps(value, per_unit, [-(1 << 53), 1 << 53], place)?,
                        digits,
                    );
                }
            }
            self.line.push(b',');
        }
        self.line.pop();
        self.line.extend(b"\r\n");
        self.rows += 1;
        self.write.write_all(&self.line).map_err(FileError::io(self.what))
    }

    fn finish(mut self) -> Result<u64, FileError> {
        self.write.flush().map_err(FileError::io(self.what))?;
        Ok(self.rows)
    }
}

/// Text of a cell, in quotes if its characters require them.
fn quoted(text: &str) -> String {
    if text.contains(['"', ',', '\r', '\n']) {
        format!("\"{}\"", text.replace('"', "\"\""))
    } else {
        text.to_owned()
    }
}

/// Writes one row per section. Returns the number of rows.
///
/// Errors: a number is not finite; the stream fails.
pub fn write_sections(write: impl Write, sections: &[Section]) -> Result<u64, FileError> {
    let columns = "station,chainage_m,verdict,hole_m,hole_sd_m";
    let mut table = Table::new(write, "sections as CSV", columns)?;
    for section in sections {
        table.row(&[
            Cell::Text(&section.station),
            Cell::Number(Some(section.chainage_m), M),
            Cell::Text(&section.verdict),
            Cell::Number(section.hole_m, M),
            Cell::Number(section.hole_sd_m, M),
        ])?;
    }
    table.finish()
}

/// Writes one row per corner of the sections' outlines. A gap in the measured wall begins a new piece.
///
/// Errors: a number is not finite; the stream fails.
pub fn write_outlines(write: impl Write, sections: &[Section]) -> Result<u64, FileError> {
    let columns = "station,chainage_m,outline,piece,y_m,z_m";
    let mut table = Table::new(write, "outlines as CSV", columns)?;
    for section in sections {
        let design = std::iter::once((("design", 0_u32), &section.design_m));
        let measured =
            (0_u32..).zip(&section.measured_m).map(|(piece, outline)| (("measured", piece), outline));
        for ((outline, piece), corners) in design.chain(measured) {
            for [y_m, z_m] in corners {
                table.row(&[
                    Cell::Text(&section.station),
                    Cell::Number(Some(section.chainage_m), M),
                    Cell::Text(outline),
                    Cell::Number(Some(piece.into()), 0),
                    Cell::Number(Some(*y_m), M),
                    Cell::Number(Some(*z_m), M),
                ])?;
            }
        }
    }
    table.finish()
}

/// Writes one row per station of the profile. Returns the number of rows.
///
/// Errors: a number is not finite; the stream fails.
pub fn write_profile(write: impl Write, stations: &[ProfileStation]) -> Result<u64, FileError> {
    let columns = "station,chainage_m,floor_z_m,crown_z_m,left_y_m,right_y_m,\
                   design_floor_z_m,design_crown_z_m,design_left_y_m,design_right_y_m";
    let cells = |edges: &Edges| {
        [edges.floor_m, edges.crown_m, edges.left_m, edges.right_m].map(|value| Cell::Number(value, M))
    };
    let mut table = Table::new(write, "profile as CSV", columns)?;
    for station in stations {
        let mut row = vec![Cell::Text(&station.station), Cell::Number(Some(station.chainage_m), M)];
        row.extend(cells(&station.measured));
        row.extend(cells(&station.design));
        table.row(&row)?;
    }
    table.finish()
}

/// Writes one row per finding. Returns the number of rows.
///
/// Errors: a number is not finite; the stream fails.
pub fn write_findings(write: impl Write, findings: &[Finding]) -> Result<u64, FileError> {
    let columns = "from_station,to_station,from_m,to_m,kind,cause,text";
    let mut table = Table::new(write, "findings as CSV", columns)?;
    for finding in findings {
        table.row(&[
            Cell::Text(&finding.stations[0]),
            Cell::Text(&finding.stations[1]),
            Cell::Number(Some(finding.chainages_m[0]), M),
            Cell::Number(Some(finding.chainages_m[1]), M),
            Cell::Text(&finding.kind),
            Cell::Text(&finding.cause),
            Cell::Text(&finding.text),
        ])?;
    }
    table.finish()
}

/// Writes the track row by row, as the replay goes on. Memory does not grow with it.
pub struct TrackWriter<W: Write>(Table<W>);

impl<W: Write> TrackWriter<W> {
    /// Begins the table.
    pub fn new(write: W) -> Result<Self, FileError> {
        let columns = "time_s,chainage_m,y_m,z_m,roll_deg,pitch_deg,yaw_deg,chainage_sd_m,lateral_sd_m,tilt_sd_deg,\
                       yaw_sd_deg";
        Table::new(write, "track as CSV", columns).map(Self)
    }

    /// Writes a row.
    ///
    /// Errors: a number is not finite; the stream fails.
    pub fn add(&mut self, point: &TrackPoint) -> Result<(), FileError> {
        let [x, y, z] = point.position_m.map(|value| Cell::Number(Some(value), M));
        let [roll, pitch, yaw] = point.attitude_deg.map(|value| Cell::Number(Some(value), DEG));
        let [along, lateral] = [point.chainage_sd_m, point.lateral_sd_m].map(|value| Cell::Number(value, M));
        let [tilt, turn] = [point.tilt_sd_deg, point.yaw_sd_deg].map(|value| Cell::Number(value, DEG));
        let time = Cell::Number(Some(point.time_s), S);
        self.0.row(&[time, x, y, z, roll, pitch, yaw, along, lateral, tilt, turn])
    }

    /// Ends the table. Returns the number of rows.
    pub fn finish(self) -> Result<u64, FileError> {
        self.0.finish()
    }
}
