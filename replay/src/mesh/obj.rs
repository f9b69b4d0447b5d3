//! Wavefront OBJ: vertices and faces.
//!
//! Source: Wavefront, "Object Files (.obj)", Advanced Visualizer manual, appendix B1.

use super::error::{MeshError, Place};
use super::read::{MeshFormat, Triangles, coordinate, lines, number, quoted, words};

const FORMAT: MeshFormat = MeshFormat::Obj;

/// Reads an OBJ file. Keywords other than `v` and `f` are passed over.
///
/// Errors: coordinates or corners that aren't numbers, corners that aren't there, faces of fewer than three.
pub(super) fn read(bytes: &[u8]) -> Result<Triangles, MeshError> {
    let mut triangles = Triangles::default();
    let mut corners = Vec::new();
    // Faces may come before their vertices: the corner furthest ahead is looked for at the end.
    let mut ahead: Option<(u32, Place)> = None;
    for (place, line) in lines(bytes) {
        let line = line.split(|&b| b == b'#').next().unwrap_or(line);
        let mut words = words(line);
        match words.next() {
            Some(b"v") => {
                let mut next = || coordinate(FORMAT, place, words.next());
                triangles.vertices.push([next()?, next()?, next()?]);
            }
            Some(b"f") => {
                corners.clear();
                for word in words {
                    let corner = corner(word, triangles.vertices.len(), place)?;
                    if corner as usize >= triangles.vertices.len()
                        && ahead.is_none_or(|(far, _)| corner > far)
                    {
                        ahead = Some((corner, place));
                    }
                    corners.push(corner);
                }
                if corners.len() < 3 {
                    return Err(FORMAT.error(
                        place,
                        "at least 3 corners of a face",
                        corners.len().to_string(),
                    ));
                }
                triangles.push_polygon(&corners);
            }
            _ => {}
        }
    }
    let vertices = triangles.vertices.len();
    if let Some((corner, place)) = ahead.filter(|(corner, _)| *corner as usize >= vertices) {
        let expected = format!("a corner among the file's {vertices} vertices");
        return Err(FORMAT.error(place, expected, (u64::from(corner) + 1).to_string()));
    }
    Ok(triangles)
}

/// The number from 0 of a corner written v, v/vt, v//vn or v/vt/vn, where v counts from 1, or back from -1.
fn corner(word: &[u8], so_far: usize, place: Place) -> Result<u32, MeshError> {
    let first = word.split(|&b| b == b'/').next().unwrap_or(word);
    let expected = "a corner's number from 1, or from -1 backwards";
    let number: i64 = number(first).ok_or_else(|| FORMAT.error(place, expected, quoted(Some(word))))?;
    let from_zero = if number > 0 { Some(number - 1) } else { number.checked_add_unsigned(so_far as u64) };
    let index = from_zero.filter(|_| number != 0).and_then(|index| u32::try_from(index).ok());
    index.ok_or_else(|| {
        FORMAT.error(place, format!("{expected} ({so_far} vertices so far)"), quoted(Some(word)))
    })
}
