//! Stereolithography files: triangles without topology, text or binary.
//!
//! Source: 3D Systems, "StereoLithography Interface Specification", 1989.

use super::error::{MeshError, Place};
use super::read::{MeshFormat, Triangles, coordinate, lines, quoted, words};

const FORMAT: MeshFormat = MeshFormat::Stl;
const HEADER_BYTES: usize = 80;
const FACET_BYTES: usize = 50;

/// Reads an STL file. Corners of equal coordinates become one vertex.
///
/// A file of the length that its count of facets asks for is binary, even if it begins with "solid", as some do.
/// Errors: keywords, coordinates or corners amiss; binary files of another length.
pub(super) fn read(bytes: &[u8]) -> Result<Triangles, MeshError> {
    let claimed = bytes.get(HEADER_BYTES..HEADER_BYTES + 4);
    let claimed = claimed.map(|b| u64::from(b.iter().rev().fold(0_u32, |n, &byte| n << 8 | u32::from(byte))));
    let wanted = claimed.map(|facets| (HEADER_BYTES + 4) as u64 + facets * FACET_BYTES as u64);
    let is_binary = wanted == Some(bytes.len() as u64);
    let is_text = bytes.trim_ascii_start().get(..5).is_some_and(|word| word.eq_ignore_ascii_case(b"solid"));
    let corners = match (is_binary, is_text, claimed, wanted) {
        (true, ..) => binary(bytes)?,
        (_, true, ..) => text(bytes)?,
        (_, _, Some(claimed), Some(wanted)) => {
            let expected =
                format!("{wanted} bytes in all, for the {claimed} facets that the file says it has");
            return Err(FORMAT.error(Place::Byte(HEADER_BYTES), expected, format!("{} bytes", bytes.len())));
        }
        _ => {
            let expected = "\"solid\", or a binary header of 84 bytes";
            return Err(FORMAT.error(Place::Byte(0), expected, format!("a file of {} bytes", bytes.len())));
        }
    };
    merge(&corners)
}

/// Corners, three a triangle, of a binary file of the right length.
fn binary(bytes: &[u8]) -> Result<Vec<[f64; 3]>, MeshError> {
    let facets = bytes.get(HEADER_BYTES + 4..).unwrap_or_default();
    let mut corners = Vec::with_capacity(facets.len() / FACET_BYTES * 3);
    let (facets, _) = facets.as_chunks::<FACET_BYTES>();
    for (i, facet) in facets.iter().enumerate() {
        // The first twelve bytes are a normal, which many writers leave zero; the last two are free.
        let (floats, _) = facet[12..].as_chunks::<4>();
        for (j, corner) in floats.chunks_exact(3).enumerate() {
            let at: [f64; 3] = core::array::from_fn(|k| f64::from(f32::from_le_bytes(corner[k])));
            if let Some(k) = at.iter().position(|c| !c.is_finite()) {
                let byte = HEADER_BYTES + 4 + i * FACET_BYTES + 12 + j * 12 + k * 4;
                return Err(FORMAT.error(Place::Byte(byte), "a finite coordinate", at[k].to_string()));
            }
            corners.push(at);
        }
    }
    Ok(corners)
}

/// Corners, three a triangle, of a text.
fn text(bytes: &[u8]) -> Result<Vec<[f64; 3]>, MeshError> {
    let mut corners: Vec<[f64; 3]> = Vec::new();
    let mut in_loop = 0;
    let mut in_solid = false;
    let mut last = Place::Line(1);
    for (place, line) in lines(bytes) {
        let mut words = words(line);
        let Some(keyword) = words.next() else {
            continue;
        };
        last = place;
        match keyword.to_ascii_lowercase().as_slice() {
            b"vertex" if in_loop < 3 => {
                let mut next = || coordinate(FORMAT, place, words.next());
                corners.push([next()?, next()?, next()?]);
                in_loop += 1;
            }
            b"vertex" => return Err(FORMAT.error(place, "3 corners of a facet", "a fourth")),
            b"endloop" if in_loop == 3 => in_loop = 0,
            b"endloop" => return Err(FORMAT.error(place, "3 corners of a facet", in_loop.to_string())),
            b"solid" => in_solid = true,
            b"endsolid" if in_loop == 0 => in_solid = false,
            b"facet" | b"outer" | b"endfacet" if in_loop == 0 => {}
            _ => {
                let expected = if in_loop > 0 { "vertex or endloop" } else { "a keyword of STL" };
                return Err(FORMAT.error(place, expected, quoted(Some(keyword))));
            }
        }
    }
    if in_solid {
        return Err(FORMAT.error(last, "endsolid as the last line", "the end of the file"));
    }
    Ok(corners)
}

/// Gives corners of the same bits the same number, counted in the order of their first appearance.
fn merge(corners: &[[f64; 3]]) -> Result<Triangles, MeshError> {
    let too_many = || MeshError::TooMany { what: "corners", given: corners.len() };
    let count = u32::try_from(corners.len()).map_err(|_| too_many())?;
    // Adding zero makes -0 and 0 the same.
    let bits = |i: u32| corners[i as usize].map(|c| (c + 0.0).to_bits());
    let mut order: Vec<u32> = (0..count).collect();
    order.sort_unstable_by_key(|&i| (bits(i), i));
    let mut first: Vec<u32> = vec![0; corners.len()];
    for equal in order.chunk_by(|&a, &b| bits(a) == bits(b)) {
        for &i in equal {
            first[i as usize] = equal[0];
        }
    }
    let mut triangles = Triangles::default();
    let mut number: Vec<u32> = vec![0; corners.len()];
    for i in 0..count {
        let at = i as usize;
        if first[at] == i {
            number[at] = u32::try_from(triangles.vertices.len()).map_err(|_| too_many())?;
            triangles.vertices.push(corners[at]);
        } else {
            number[at] = number[first[at] as usize];
        }
    }
    triangles.faces = number.chunks_exact(3).map(|c| [c[0], c[1], c[2]]).collect();
    Ok(triangles)
}
