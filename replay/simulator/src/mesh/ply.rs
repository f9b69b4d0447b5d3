//! Reads triangles from PLY files in text or binary encoding.

use ply_rs_bw::parser::{ParseError, Parser, Reader};
use ply_rs_bw::ply::{
    ElementDef, Encoding, Header, Property, PropertyAccess, PropertyAccessResult, PropertyType, ScalarType,
};

use super::error::MeshError;

const AXES: [&str; 3] = ["x", "y", "z"];
/// Names of the property that lists a face's corners. Files use either name.
const CORNERS: [&str; 2] = ["vertex_indices", "vertex_index"];
/// Maximum length of an error text. An error quotes a line of the file, which may have any length.
const MAX_ERROR_CHARS: usize = 300;

/// Triangles as read from the file.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Triangles {
    /// Coordinates of the corners, in the file's units, which are taken as metres.
    pub vertices: Vec<[f64; 3]>,
    /// Numbers of the corners of each triangle, in either winding.
    pub faces: Vec<[u32; 3]>,
}

/// Reads the triangles of a PLY file. Polygons become fans about their first corner.
///
/// All elements and properties are ignored except the x, y and z of vertices and the corners of faces.
///
/// Errors: [`MeshError::File`], with the line number if the parser gives one. [`super::Mesh::new`] checks corners and
/// coordinates. Allocates: in proportion to `bytes`, independent of the counts in the header.
pub fn read(bytes: &[u8]) -> Result<Triangles, MeshError> {
    let mut reader = Reader::new(bytes);
    let mut header = Parser::<Ignored>::new().read_header(&mut reader).map_err(|error| unreadable(&error))?;
    check(&header)?;
    widen_text(&mut header);
    let mut triangles = Triangles::default();
    // An element without properties takes no bytes in the file. Its count in the header may be any number, so the count
    // must not decide how much memory is used.
    for element in header.elements.values().filter(|element| !element.properties.is_empty()) {
        match element.name.as_str() {
            "vertex" => {
                let vertices: Vec<Vertex> = rows(&mut reader, element, &header)?;
                triangles.vertices = vertices.into_iter().map(|vertex| vertex.0).collect();
            }
            "face" => {
                let faces: Vec<Face> = rows(&mut reader, element, &header)?;
                for (number, Face(corners)) in faces.iter().enumerate() {
                    let [first, second, third, ..] = corners.as_slice() else {
                        let found = corners.len();
                        let why = format!(
                            "face {number} (counted from 0) has {found} corners; a face needs at least 3"
                        );
                        return Err(MeshError::File(why));
                    };
                    triangles.faces.push([*first, *second, *third]);
                    triangles.faces.extend(corners[2..].windows(2).map(|pair| [*first, pair[0], pair[1]]));
                }
            }
            _ => drop(rows::<Ignored>(&mut reader, element, &header)?),
        }
    }
    match reader.into_inner().trim_ascii().len() {
        0 => Ok(triangles),
        left => Err(MeshError::File(format!("{left} more bytes after the last element"))),
    }
}

fn rows<E: PropertyAccess>(
    reader: &mut Reader<&[u8]>,
    element: &ElementDef,
    header: &Header,
) -> Result<Vec<E>, MeshError> {
    let rows = Parser::new().read_payload_for_element(reader, element, header);
    rows.map_err(|error| unreadable(&error))
}

/// Checks that the header has the vertices' coordinates and the faces' corners.
fn check(header: &Header) -> Result<(), MeshError> {
    let has = |element: &str, property: &str| {
        header.elements.get(element).is_some_and(|element| element.properties.contains_key(property))
    };
    if let Some(axis) = AXES.iter().find(|axis| !has("vertex", axis)) {
        return Err(MeshError::File(format!("the element vertex has no property {axis}")));
    }
    if !CORNERS.iter().any(|name| has("face", name)) {
        return Err(MeshError::File(format!(
            "the element face has no list {} or {}",
            CORNERS[0], CORNERS[1]
        )));
    }
    Ok(())
}

/// Makes the parser read text coordinates as doubles. They may have more digits than the header's type can hold.
fn widen_text(header: &mut Header) {
    let Some(vertex) = header.elements.get_mut("vertex").filter(|_| header.encoding == Encoding::Ascii)
    else {
        return;
    };
    for axis in AXES {
        let property = vertex.properties.get_mut(axis).map(|property| &mut property.data_type);
        if let Some(PropertyType::Scalar(kind)) = property {
            *kind = ScalarType::Double;
        }
    }
}

fn unreadable(error: &ParseError) -> MeshError {
    let words = error.to_string().split_whitespace().collect::<Vec<_>>().join(" ");
    MeshError::File(words.chars().take(MAX_ERROR_CHARS).collect())
}

struct Vertex([f64; 3]);

impl PropertyAccess for Vertex {
    fn new() -> Self {
        Self([f64::NAN; 3])
    }

    fn set_property(&mut self, name: &str, value: Property) -> PropertyAccessResult {
        let Some(axis) = AXES.iter().position(|axis| *axis == name) else {
            return PropertyAccessResult::Ignored;
        };
        self.0[axis] = match value {
            Property::Float(value) => value.into(),
            Property::Double(value) => value,
            _ => return PropertyAccessResult::UnsupportedType,
        };
        PropertyAccessResult::Set
    }
}

struct Face(Vec<u32>);

impl PropertyAccess for Face {
    fn new() -> Self {
        Self(Vec::new())
    }

    fn set_property(&mut self, name: &str, value: Property) -> PropertyAccessResult {
        if !CORNERS.contains(&name) {
            return PropertyAccessResult::Ignored;
        }
        let Some(corners) = value.to_u32_list() else { return PropertyAccessResult::UnsupportedType };
        self.0 = corners;
        PropertyAccessResult::Set
    }
}

struct Ignored;

impl PropertyAccess for Ignored {
    fn new() -> Self {
        Self
    }
}
