//! PLY: a header that says which elements follow, with which properties; then their values, as text or binary.
//!
//! Source: G. Turk, "The PLY Polygon File Format", Stanford, 1994.

use headrace_geometry::math;

use super::error::{MeshError, Place};
use super::read::{MeshFormat, Triangles, number, quoted, words};

const FORMAT: MeshFormat = MeshFormat::Ply;

/// Type of a value.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Scalar {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

impl Scalar {
    fn named(word: &[u8]) -> Option<Self> {
        Some(match word {
            b"char" | b"int8" => Self::I8,
            b"uchar" | b"uint8" => Self::U8,
            b"short" | b"int16" => Self::I16,
            b"ushort" | b"uint16" => Self::U16,
            b"int" | b"int32" => Self::I32,
            b"uint" | b"uint32" => Self::U32,
            b"float" | b"float32" => Self::F32,
            b"double" | b"float64" => Self::F64,
            _ => return None,
        })
    }
}

/// A property of an element; `count` is given for lists alone.
struct Property<'a> {
    name: &'a [u8],
    count: Option<Scalar>,
    item: Scalar,
}

/// A kind of rows, and how many of them follow.
struct Element<'a> {
    name: &'a [u8],
    rows: u32,
    properties: Vec<Property<'a>>,
}

/// How the values are written.
#[derive(Clone, Copy)]
enum Encoding {
    Text,
    Little,
    Big,
}

/// Reads a PLY file. Elements and properties other than the vertices' x, y, z and the faces' corners are passed over.
///
/// Errors: a header that isn't one, or without what is needed; values that aren't numbers, are missing or too many.
pub(super) fn read(bytes: &[u8]) -> Result<Triangles, MeshError> {
    let mut values = Values { bytes, at: 0, line: 1, last: Place::Line(1), encoding: Encoding::Text };
    let elements = header(&mut values)?;
    let mut triangles = Triangles::default();
    for element in &elements {
        rows(&mut values, element, &elements, &mut triangles)?;
    }
    values.end()?;
    Ok(triangles)
}

fn header<'a>(values: &mut Values<'a>) -> Result<Vec<Element<'a>>, MeshError> {
    let (place, magic) = values.header_line()?;
    if magic != b"ply" {
        return Err(FORMAT.error(place, "\"ply\"", quoted(Some(magic))));
    }
    let mut encoding = None;
    let mut elements: Vec<Element<'a>> = Vec::new();
    loop {
        let (place, line) = values.header_line()?;
        let wrong = |expected: &str| FORMAT.error(place, expected, quoted(Some(line)));
        let parts: Vec<&[u8]> = words(line).collect();
        match parts.as_slice() {
            [b"end_header"] => {
                values.encoding =
                    encoding.ok_or_else(|| wrong("a line \"format\" before the header's end"))?;
                needed(&elements, place)?;
                return Ok(elements);
            }
            [b"comment" | b"obj_info", ..] | [] => {}
            [b"format", b"ascii", b"1.0"] => encoding = Some(Encoding::Text),
            [b"format", b"binary_little_endian", b"1.0"] => encoding = Some(Encoding::Little),
            [b"format", b"binary_big_endian", b"1.0"] => encoding = Some(Encoding::Big),
            [b"format", ..] => {
                return Err(wrong("ascii, binary_little_endian or binary_big_endian, and 1.0"));
            }
            [b"element", name, rows] => {
                let rows = number(rows).ok_or_else(|| wrong("an element's name and a count below 2^32"))?;
                if elements.iter().any(|element| element.name == *name) {
                    return Err(wrong("each element once"));
                }
                elements.push(Element { name, rows, properties: Vec::new() });
            }
            [b"property", kinds @ .., name] => {
                let property = match kinds {
                    [item] => Scalar::named(item).map(|item| Property { name, count: None, item }),
                    [b"list", count, item] => Scalar::named(count)
                        .zip(Scalar::named(item))
                        .map(|(count, item)| Property { name, count: Some(count), item }),
                    _ => None,
                };
                let property = property.ok_or_else(|| wrong("a property's type and name"))?;
                let element = elements.last_mut().ok_or_else(|| wrong("an element before its properties"))?;
                element.properties.push(property);
            }
            _ => return Err(wrong("format, element, property, comment, obj_info or end_header")),
        }
    }
}

/// Sees that the header promises vertices and faces.
fn needed(elements: &[Element<'_>], place: Place) -> Result<(), MeshError> {
    let has = |element: &str, property: &dyn Fn(&Property<'_>) -> bool| {
        elements.iter().any(|e| e.name == element.as_bytes() && e.properties.iter().any(property))
    };
    for axis in [b"x", b"y", b"z"] {
        if !has("vertex", &|p| p.name == axis && p.count.is_none()) {
            let expected = format!("a property {} of the element vertex", axis.escape_ascii());
            return Err(FORMAT.error(place, expected, "the header's end"));
        }
    }
    if !has("face", &is_corners) {
        let expected = "a list vertex_indices or vertex_index of the element face";
        return Err(FORMAT.error(place, expected, "the header's end"));
    }
    Ok(())
}

fn is_corners(property: &Property<'_>) -> bool {
    property.count.is_some() && matches!(property.name, b"vertex_indices" | b"vertex_index")
}

/// Reads all rows of an element.
fn rows(
    values: &mut Values<'_>,
    element: &Element<'_>,
    elements: &[Element<'_>],
    triangles: &mut Triangles,
) -> Result<(), MeshError> {
    if element.properties.is_empty() {
        // Nothing follows, however many rows there are.
        return Ok(());
    }
    let (is_vertex, is_face) = (element.name == b"vertex", element.name == b"face");
    let vertices = elements.iter().find(|e| e.name == b"vertex").map_or(0, |e| e.rows);
    // A row takes at least two bytes as text, and one as binary; what the header claims may not be there.
    let possible = (element.rows as usize).min(values.left() / element.properties.len());
    if is_vertex {
        triangles.vertices.reserve(possible);
    }
    let mut corners = Vec::new();
    for _ in 0..element.rows {
        let mut at = [0.0; 3];
        for property in &element.properties {
            let Some(count) = property.count else {
                let value = values.next(property.item)?;
                let axis = [b"x", b"y", b"z"].iter().position(|name| *name == property.name);
                if let Some(axis) = axis.filter(|_| is_vertex) {
                    if !value.is_finite() {
                        return Err(FORMAT.error(values.last, "a finite coordinate", value.to_string()));
                    }
                    at[axis] = value;
                }
                continue;
            };
            let length = values.next_index(count, u32::MAX, "a list's length")?;
            if !(is_face && is_corners(property)) {
                for _ in 0..length {
                    values.next(property.item)?;
                }
                continue;
            }
            if length < 3 {
                return Err(FORMAT.error(values.last, "at least 3 corners of a face", length.to_string()));
            }
            corners.clear();
            for _ in 0..length {
                corners.push(values.next_index(property.item, vertices, "a vertex")?);
            }
            triangles.push_polygon(&corners);
        }
        if is_vertex {
            triangles.vertices.push(at);
        }
    }
    Ok(())
}

/// The file as a sequence of lines, then of values.
struct Values<'a> {
    bytes: &'a [u8],
    /// Offset of the byte next to be read.
    at: usize,
    /// Line of that byte, as long as lines are counted.
    line: usize,
    /// Place of the value read last.
    last: Place,
    encoding: Encoding,
}

impl<'a> Values<'a> {
    fn left(&self) -> usize {
        self.bytes.len().saturating_sub(self.at)
    }

    fn rest(&self) -> &'a [u8] {
        self.bytes.get(self.at..).unwrap_or_default()
    }

    /// The next line of the header. It ends with a line feed, before which a carriage return is let pass.
    fn header_line(&mut self) -> Result<(Place, &'a [u8]), MeshError> {
        let place = Place::Line(self.line);
        let rest = self.rest();
        let Some(length) = rest.iter().position(|&b| b == b'\n') else {
            return Err(FORMAT.error(place, "a header up to \"end_header\"", "the end of the file"));
        };
        self.at += length + 1;
        self.line += 1;
        Ok((place, rest.get(..length).unwrap_or_default().trim_ascii()))
    }

    /// The next value; integers of up to 32 bits are exact as doubles.
    fn next(&mut self, kind: Scalar) -> Result<f64, MeshError> {
        let little = match self.encoding {
            Encoding::Text => return self.next_word(),
            Encoding::Little => true,
            Encoding::Big => false,
        };
        let value = match kind {
            Scalar::I8 => f64::from(i8::from_le_bytes(self.take(little)?)),
            Scalar::U8 => f64::from(u8::from_le_bytes(self.take(little)?)),
            Scalar::I16 => f64::from(i16::from_le_bytes(self.take(little)?)),
            Scalar::U16 => f64::from(u16::from_le_bytes(self.take(little)?)),
            Scalar::I32 => f64::from(i32::from_le_bytes(self.take(little)?)),
            Scalar::U32 => f64::from(u32::from_le_bytes(self.take(little)?)),
            Scalar::F32 => f64::from(f32::from_le_bytes(self.take(little)?)),
            Scalar::F64 => f64::from_le_bytes(self.take(little)?),
        };
        Ok(value)
    }

    /// The next bytes, with the least significant first.
    fn take<const N: usize>(&mut self, little: bool) -> Result<[u8; N], MeshError> {
        self.last = Place::Byte(self.at);
        let Some(mut bytes) = self.rest().first_chunk::<N>().copied() else {
            let found = format!("{} before the end of the file", self.left());
            return Err(FORMAT.error(self.last, format!("{N} bytes of a value"), found));
        };
        self.at += N;
        if !little {
            bytes.reverse();
        }
        Ok(bytes)
    }

    fn next_word(&mut self) -> Result<f64, MeshError> {
        self.skip_blanks();
        let rest = self.rest();
        let length = rest.iter().position(u8::is_ascii_whitespace).unwrap_or(rest.len());
        self.last = Place::Line(self.line);
        if length == 0 {
            return Err(FORMAT.error(self.last, "a number", "the end of the file"));
        }
        self.at += length;
        let word = rest.get(..length);
        word.and_then(number).ok_or_else(|| FORMAT.error(self.last, "a number", quoted(word)))
    }

    fn skip_blanks(&mut self) {
        let rest = self.rest();
        let blanks = rest.len() - rest.trim_ascii_start().len();
        self.line += rest.iter().take(blanks).filter(|&&b| b == b'\n').count();
        self.at += blanks;
    }

    /// The next value as an integer below `limit`.
    fn next_index(&mut self, kind: Scalar, limit: u32, what: &str) -> Result<u32, MeshError> {
        let value = self.next(kind)?;
        let whole = math::floor_to_i64(value);
        // Equal bits of value and whole number, or it had a fraction or was beyond all integers.
        if let Some(index) =
            u32::try_from(whole).ok().filter(|&i| i < limit && f64::from(i).total_cmp(&(value + 0.0)).is_eq())
        {
            return Ok(index);
        }
        Err(FORMAT.error(
            self.last,
            format!("{what}, an integer from 0 and below {limit}"),
            value.to_string(),
        ))
    }

    /// Sees that nothing but blanks is left, as would be if a count were too small.
    fn end(&mut self) -> Result<(), MeshError> {
        self.skip_blanks();
        if self.left() == 0 {
            return Ok(());
        }
        let place = match self.encoding {
            Encoding::Text => Place::Line(self.line),
            Encoding::Little | Encoding::Big => Place::Byte(self.at),
        };
        Err(FORMAT.error(
            place,
            "the end of the file after the last element",
            format!("{} more bytes", self.left()),
        ))
    }
}
