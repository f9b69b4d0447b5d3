//! Wall as GLB, binary glTF 2.0, coloured by deviation.

use std::io::{BufWriter, Write};

use serde_json::{Value, json};

use super::data::{FRAME, FileInfo, WallMesh};
use super::error::FileError;
use super::palette;

const WHAT: &str = "wall as GLB";
/// Codes of glTF 2.0: float, unsigned byte and int, and the buffers' uses.
const FLOAT: u32 = 5126;
const BYTE: u32 = 5121;
const INT: u32 = 5125;
const CORNERS: u32 = 34962;
const TRIANGLES: u32 = 34963;
/// Matrix that converts the tunnel frame to glTF's frame, which is right-handed with y up: (x, y, z) becomes (x, z,
/// -y). The matrix is stored column by column.
const GLTF_FROM_TUNNEL: [i32; 16] = [1, 0, 0, 0, 0, 0, -1, 0, 0, 1, 0, 0, 0, 0, 0, 1];
/// Largest length of a file, which its 32-bit header holds.
const LARGEST: usize = u32::MAX as usize;

/// Writes the wall. Colours saturate at a deviation of `limit_m`.
///
/// Positions are 32-bit floats, relative to the whole metre of each part's first corner. In parts of up to 2 km, they
/// are exact to 0.1 mm.
///
/// Errors: a corner is not finite; a triangle names a corner that doesn't exist; the file exceeds 4 GiB; the stream
/// fails.
pub fn write(write: impl Write, info: &FileInfo, parts: &[WallMesh], limit_m: f64) -> Result<(), FileError> {
    let (mut nodes, mut meshes, mut layout) = (Vec::new(), Vec::new(), Layout::default());
    for (number, part) in parts.iter().enumerate().filter(|(_, part)| !part.triangles.is_empty()) {
        check(number, part)?;
        nodes.push(json!({"mesh": meshes.len(), "translation": [origin_m(part), 0.0, 0.0]}));
        meshes.push(layout.mesh(part));
    }
    let root = json!({
        "name": info.title, "matrix": GLTF_FROM_TUNNEL,
        "children": (0..nodes.len()).collect::<Vec<_>>(),
    });
    let mut content = json!({
        "asset": {"version": "2.0", "generator": info.program, "extras": {"frame": FRAME}},
        "scene": 0, "scenes": [{"nodes": [nodes.len()]}],
    });
    nodes.push(root);
    if let Some(root) = nodes.last_mut().filter(|_| meshes.is_empty()) {
        // glTF allows no empty lists, so they are left out for a wall without parts.
        *root = json!({"name": info.title, "matrix": GLTF_FROM_TUNNEL});
    } else {
        let surface = json!({"metallicFactor": 0.0, "roughnessFactor": 1.0});
        content["materials"] = json!([{"doubleSided": true, "pbrMetallicRoughness": surface}]);
        content["meshes"] = Value::Array(meshes);
        content["buffers"] = json!([{"byteLength": layout.length}]);
        content["bufferViews"] = Value::Array(layout.views);
        content["accessors"] = Value::Array(layout.accessors);
    }
    content["nodes"] = Value::Array(nodes);
    let mut json = content.to_string().into_bytes();
    json.resize(json.len().next_multiple_of(4), b' ');
    write_chunks(BufWriter::new(write), &json, layout.length, parts, limit_m)
}

/// Chainage of the first corner, rounded to whole metres.
fn origin_m(part: &WallMesh) -> f64 {
    part.corners_m.first().map_or(0.0, |corner| corner[0].floor())
}

/// Position of a corner relative to its part's origin, as the file holds it.
#[expect(clippy::cast_possible_truncation, reason = "the format has 32 bits for it")]
fn relative(part: &WallMesh, [x, y, z]: [f64; 3]) -> [f32; 3] {
    [(x - origin_m(part)) as f32, y as f32, z as f32]
}

fn check(number: usize, part: &WallMesh) -> Result<(), FileError> {
    let mut values = part.corners_m.iter().flatten().chain(part.deviations_m.iter().flatten());
    if let Some(value) = values.find(|value| !value.is_finite()) {
        return Err(FileError::encoding(WHAT)(format!("a value of part {number} is {value}")));
    }
    let corners = part.corners_m.len();
    if part.deviations_m.len() != corners {
        let deviations = part.deviations_m.len();
        return Err(FileError::encoding(WHAT)(format!(
            "part {number} has {corners} corners and {deviations} deviations"
        )));
    }
    match part.triangles.iter().flatten().find(|&&corner| corner as usize >= corners) {
        Some(corner) => {
            let text = format!("a triangle of part {number} names corner {corner} of {corners}");
            Err(FileError::encoding(WHAT)(text))
        }
        None => Ok(()),
    }
}

/// Places of the parts in the binary chunk of a GLB file.
#[derive(Default)]
struct Layout {
    length: usize,
    views: Vec<Value>,
    accessors: Vec<Value>,
}

impl Layout {
    /// Adds a buffer view of `count` items, and returns the number of the accessor for it.
    fn view(&mut self, (target, bytes): (u32, usize), mut accessor: Value, count: usize) -> usize {
        self.views.push(json!({
            "buffer": 0, "byteOffset": self.length, "byteLength": bytes, "target": target,
        }));
        self.length += bytes;
        accessor["bufferView"] = json!(self.views.len() - 1);
        accessor["count"] = json!(count);
        self.accessors.push(accessor);
        self.accessors.len() - 1
    }

    fn mesh(&mut self, part: &WallMesh) -> Value {
        let corners = part.corners_m.len();
        let (mut least, mut most) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
        for corner in &part.corners_m {
            for (axis, value) in relative(part, *corner).into_iter().enumerate() {
                least[axis] = value.min(least[axis]);
                most[axis] = value.max(most[axis]);
            }
        }
        let position = json!({"componentType": FLOAT, "type": "VEC3", "min": least, "max": most});
        let colour = json!({"componentType": BYTE, "type": "VEC4", "normalized": true});
        let index = json!({"componentType": INT, "type": "SCALAR"});
        let position = self.view((CORNERS, 12 * corners), position, corners);
        let colour = self.view((CORNERS, 4 * corners), colour, corners);
        let count = 3 * part.triangles.len();
        let index = self.view((TRIANGLES, 4 * count), index, count);
        json!({"primitives": [{
            "attributes": {"POSITION": position, "COLOR_0": colour}, "indices": index, "material": 0,
        }]})
    }
}

/// Writes the header and the chunks of JSON and binary data.
fn write_chunks(
    mut write: impl Write,
    json: &[u8],
    length: usize,
    parts: &[WallMesh],
    limit_m: f64,
) -> Result<(), FileError> {
    let binary = if length == 0 { 0 } else { 8 + length };
    let total = 12 + 8 + json.len() + binary;
    if total > LARGEST {
        let text = format!("it would have {total} bytes; the format holds {LARGEST}");
        return Err(FileError::encoding(WHAT)(text));
    }
    let size = |value: usize| u32::try_from(value).unwrap_or(u32::MAX).to_le_bytes();
    let mut put = |bytes: &[u8]| write.write_all(bytes).map_err(FileError::io(WHAT));
    put(&[*b"glTF", 2_u32.to_le_bytes(), size(total), size(json.len()), *b"JSON"].concat())?;
    put(json)?;
    if length > 0 {
        put(&[size(length), *b"BIN\0"].concat())?;
    }
    for part in parts.iter().filter(|part| !part.triangles.is_empty()) {
        for corner in &part.corners_m {
            put(&relative(part, *corner).map(f32::to_le_bytes).concat())?;
        }
        for deviation in &part.deviations_m {
            let [red, green, blue] = palette::colour(palette::index(*deviation, limit_m));
            put(&[red, green, blue, 255])?;
        }
        for triangle in &part.triangles {
            put(&triangle.map(u32::to_le_bytes).concat())?;
        }
    }
    write.flush().map_err(FileError::io(WHAT))
}
