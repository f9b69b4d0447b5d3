//! Sections and profile as DXF, release 12, which all CAD programs read.
//!
//! Release 12 is a text format of few records, so no library writes it. The drawing is never in memory as a whole.

use std::io::{BufWriter, Write};

use super::data::{Edges, FRAME, FileInfo, ProfileStation, Section};
use super::error::FileError;
use super::rounding::{PER_M, push_decimal, steps};

/// Layers with their colours: grey, red, white or black, green.
const DESIGN: &str = "DESIGN";
const MEASURED: &str = "MEASURED";
const LABELS: &str = "LABELS";
const LAYERS: [(&str, u8); 3] = [(DESIGN, 8), (MEASURED, 1), (LABELS, 7)];
/// Flags of a polyline in DXF. Source: DXF reference, release 12, group 70 of POLYLINE and of VERTEX.
const CLOSED: u8 = 1;
const POLYLINE_3D: u8 = 8;
const VERTEX_3D: u8 = 32;
/// Height of labels, and least distance of a profile's stations with a label, m.
const LABEL_M: f64 = 0.25;
const LABEL_STEP_M: f64 = 10.0;
/// Columns of a sheet.
const SHEET_COLUMNS: usize = 10;
/// Largest coordinate, mm (a million kilometres). A double resolves it far below a millimetre.
const LARGEST_MM: i64 = 1_000_000_000_000;

/// Drawing that is written entity by entity.
struct Drawing<W: Write> {
    write: BufWriter<W>,
    what: &'static str,
    entities: u64,
}

impl<W: Write> Drawing<W> {
    /// Begins a drawing with its header and layers. `frame` is a text that states how the drawing is placed in the
    /// tunnel frame.
    fn new(write: W, what: &'static str, info: &FileInfo, frame: &str) -> Result<Self, FileError> {
        let mut drawing = Self { write: BufWriter::new(write), what, entities: 0 };
        for comment in [&info.title, &info.program, frame] {
            drawing.group(999, &escaped(comment))?;
        }
        drawing.groups(&[(0, "SECTION"), (2, "HEADER"), (9, "$ACADVER"), (1, "AC1009")])?;
        drawing.groups(&[
            (9, "$DWGCODEPAGE"),
            (3, "ANSI_1252"),
            (9, "$LUNITS"),
            (70, "2"),
            (9, "$LUPREC"),
        ])?;
        drawing.groups(&[(70, "3"), (0, "ENDSEC"), (0, "SECTION"), (2, "TABLES")])?;
        drawing.groups(&[
            (0, "TABLE"),
            (2, "LTYPE"),
            (70, "1"),
            (0, "LTYPE"),
            (2, "CONTINUOUS"),
            (70, "0"),
        ])?;
        drawing.groups(&[(3, "Solid line"), (72, "65"), (73, "0"), (40, "0.0"), (0, "ENDTAB")])?;
        drawing.groups(&[(0, "TABLE"), (2, "LAYER"), (70, "3")])?;
        for (layer, colour) in LAYERS {
            drawing.groups(&[
                (0, "LAYER"),
                (2, layer),
                (70, "0"),
                (62, &colour.to_string()),
                (6, "CONTINUOUS"),
            ])?;
        }
        drawing.groups(&[(0, "ENDTAB"), (0, "TABLE"), (2, "STYLE"), (70, "1"), (0, "STYLE")])?;
        drawing.groups(&[(2, "STANDARD"), (70, "0"), (40, "0.0"), (41, "1.0"), (50, "0.0"), (71, "0")])?;
        drawing.groups(&[(42, "0.25"), (3, "txt"), (4, ""), (0, "ENDTAB"), (0, "ENDSEC")])?;
        drawing.groups(&[(0, "SECTION"), (2, "ENTITIES")])?;
        Ok(drawing)
    }

    fn group(&mut self, code: u16, value: &str) -> Result<(), FileError> {
        write!(self.write, "{code:3}\r\n{value}\r\n").map_err(FileError::io(self.what))
    }

    fn groups(&mut self, groups: &[(u16, &str)]) -> Result<(), FileError> {
        groups.iter().try_for_each(|(code, value)| self.group(*code, value))
    }

    /// Writes a position in mm as three groups of DXF. `code` is the group code of x.
    fn place(&mut self, code: u16, position_m: [f64; 3]) -> Result<(), FileError> {
        for (code, value) in [code, code + 10, code + 20].into_iter().zip(position_m) {
            let place = || format!("coordinate of entity {} of {}", self.entities, self.what);
            let millimetres = steps(value, PER_M, [-LARGEST_MM, LARGEST_MM], place)?;
            let mut text = Vec::new();
            push_decimal(&mut text, millimetres, 3);
            self.group(code, &String::from_utf8_lossy(&text))?;
        }
        Ok(())
    }

    /// Writes a polyline. A single corner between gaps becomes a point.
    fn polyline(&mut self, layer: &str, is_closed: bool, corners_m: &[[f64; 3]]) -> Result<(), FileError> {
        match corners_m {
            [] => return Ok(()),
            [corner] => {
                self.groups(&[(0, "POINT"), (8, layer)])?;
                self.entities += 1;
                return self.place(10, *corner);
            }
            _ => {}
        }
        let flags = POLYLINE_3D | if is_closed { CLOSED } else { 0 };
        self.groups(&[(0, "POLYLINE"), (8, layer), (66, "1"), (70, &flags.to_string())])?;
        self.place(10, [0.0; 3])?;
        for corner in corners_m {
            self.groups(&[(0, "VERTEX"), (8, layer), (70, &VERTEX_3D.to_string())])?;
            self.place(10, *corner)?;
        }
        self.groups(&[(0, "SEQEND"), (8, layer)])?;
        self.entities += 1;
        Ok(())
    }

    /// Writes a label, centred at a position and turned by `turn_deg`.
    fn label(&mut self, position_m: [f64; 3], turn_deg: u8, text: &str) -> Result<(), FileError> {
        self.groups(&[(0, "TEXT"), (8, LABELS)])?;
        self.place(10, position_m)?;
        self.groups(&[
            (40, &LABEL_M.to_string()),
            (1, &escaped(text)),
            (50, &turn_deg.to_string()),
            (72, "1"),
        ])?;
        self.place(11, position_m)?;
        self.entities += 1;
        Ok(())
    }

    /// Ends the drawing. Returns the number of its entities.
    fn finish(mut self) -> Result<u64, FileError> {
        self.groups(&[(0, "ENDSEC"), (0, "EOF")])?;
        self.write.flush().map_err(FileError::io(self.what))?;
        Ok(self.entities)
    }
}

/// Text in one line of ASCII. Percent signs and carets that would begin a code of DXF are escaped.
fn escaped(text: &str) -> String {
    let mut escaped = String::new();
    for character in text.replace("%%", "%%%%%%").chars() {
        match character {
            '^' => escaped.push_str("^ "),
            '\r' | '\n' | '\t' => escaped.push(' '),
            ' '..='~' => escaped.push(character),
            _ if character.is_control() => {}
            _ => {
                let mut units = [0; 2];
                let units = character.encode_utf16(&mut units).iter();
                escaped.extend(units.map(|unit| format!("\\U+{unit:04X}")));
            }
        }
    }
    escaped
}

/// Writes the sections at their places in the tunnel frame. Returns the number of entities.
///
/// Errors: a coordinate is not finite; the stream fails.
pub fn write_sections(write: impl Write, info: &FileInfo, sections: &[Section]) -> Result<u64, FileError> {
    let mut drawing = Drawing::new(write, "sections as DXF", info, FRAME)?;
    for section in sections {
        let in_place = |[y, z]: [f64; 2]| [section.chainage_m, y, z];
        draw_section(&mut drawing, section, in_place)?;
    }
    drawing.finish()
}

/// Writes the sections side by side on a sheet, looking inwards. Returns the number of entities.
///
/// Errors: a coordinate is not finite; the stream fails.
pub fn write_sheet(write: impl Write, info: &FileInfo, sections: &[Section]) -> Result<u64, FileError> {
    let frame =
        "sheet, m: sections from left to right and from top to bottom, looking inwards along the tunnel";
    let mut drawing = Drawing::new(write, "sheet of sections as DXF", info, frame)?;
    let corners = || {
        let measured = sections.iter().flat_map(|section| section.measured_m.iter().flatten());
        sections.iter().flat_map(|section| &section.design_m).chain(measured)
    };
    let largest = |axis: usize| corners().map(|corner| corner[axis].abs()).fold(0.0, f64::max);
    // Space for a section with a margin for its label.
    let [width_m, height_m] = [2.0 * largest(0) + 2.0, largest(1) + 2.0];
    for (number, section) in sections.iter().enumerate() {
        let right_m = (number % SHEET_COLUMNS) as f64 * width_m;
        let down_m = (number / SHEET_COLUMNS) as f64 * height_m;
        // The minus is needed because y points to the left.
        draw_section(&mut drawing, section, |[y, z]| [right_m - y, z - down_m, 0.0])?;
    }
    drawing.finish()
}

/// Draws outlines and label of a section. `to_drawing` converts y and z to a position in the drawing.
fn draw_section<W: Write>(
    drawing: &mut Drawing<W>,
    section: &Section,
    to_drawing: impl Fn([f64; 2]) -> [f64; 3],
) -> Result<(), FileError> {
    let placed = |outline: &[[f64; 2]]| outline.iter().map(|&corner| to_drawing(corner)).collect::<Vec<_>>();
    drawing.polyline(DESIGN, true, &placed(&section.design_m))?;
    for piece in &section.measured_m {
        drawing.polyline(MEASURED, false, &placed(piece))?;
    }
    let hole = section.hole_m.map_or(String::new(), |hole_m| format!("  D {hole_m:.3} m"));
    let label = format!("{}  {}{hole}", section.station, section.verdict);
    drawing.label(to_drawing([0.0, -3.0 * LABEL_M]), 0, &label)
}

/// Writes floor and crown along the tunnel: chainage to the right, z upwards. Returns the number of entities.
///
/// Errors: a coordinate is not finite; the stream fails.
pub fn write_profile(
    write: impl Write,
    info: &FileInfo,
    stations: &[ProfileStation],
) -> Result<u64, FileError> {
    let frame =
        "longitudinal profile, m: chainage from the portal to the right, z from the floor's centre upwards";
    let mut drawing = Drawing::new(write, "profile as DXF", info, frame)?;
    let edges: [fn(&Edges) -> Option<f64>; 2] = [|edges| edges.floor_m, |edges| edges.crown_m];
    for edge in edges {
        draw_line(&mut drawing, DESIGN, stations.iter().map(|at| (at.chainage_m, edge(&at.design))))?;
        draw_line(&mut drawing, MEASURED, stations.iter().map(|at| (at.chainage_m, edge(&at.measured))))?;
    }
    let mut next_m = f64::NEG_INFINITY;
    for station in stations.iter().filter(|station| {
        let is_due = station.chainage_m >= next_m;
        next_m = if is_due { station.chainage_m + LABEL_STEP_M } else { next_m };
        is_due
    }) {
        drawing.label([station.chainage_m, -6.0 * LABEL_M, 0.0], 90, &station.station)?;
    }
    drawing.finish()
}

/// Draws a line of z by chainage that is interrupted where there is no value.
fn draw_line<W: Write>(
    drawing: &mut Drawing<W>,
    layer: &str,
    values: impl Iterator<Item = (f64, Option<f64>)>,
) -> Result<(), FileError> {
    let mut piece = Vec::new();
    for (chainage_m, z_m) in values {
        if let Some(z_m) = z_m {
            piece.push([chainage_m, z_m, 0.0]);
        } else {
            drawing.polyline(layer, false, &std::mem::take(&mut piece))?;
        }
    }
    drawing.polyline(layer, false, &piece)
}
