//! Each format written and read back; what is wrong in a file, told with its place.

use std::fmt::Write;

use proptest::prelude::*;

use super::tests::{cuboid, icosphere};
use super::*;

/// A mesh whose coordinates are exact in single precision, its vertices in the order in which faces need them first.
fn sample() -> Triangles {
    let mut t = icosphere(1, || 2.0);
    t.vertices.iter_mut().flatten().for_each(|c| *c = f64::from(narrow(*c)));
    read(MeshFormat::Stl, &stl_binary(&t, b"in order")).unwrap()
}

#[expect(clippy::cast_possible_truncation, reason = "single precision is wanted")]
fn narrow(c: f64) -> f32 {
    c as f32
}

fn count(n: usize) -> u32 {
    u32::try_from(n).unwrap()
}

fn obj(t: &Triangles) -> String {
    let mut s = String::from("# a comment\nmtllib x.mtl\no thing\n");
    for [x, y, z] in &t.vertices {
        writeln!(s, "v {x} {y} {z}\r").unwrap();
    }
    s.push_str("vn 0 0 1\nvt 0 0\n");
    let back = count(t.vertices.len());
    for (i, face) in t.faces.iter().enumerate() {
        let [a, b, c] = face.map(|corner| corner + 1);
        match i % 5 {
            0 => writeln!(s, "f {a} {b} {c} # three"),
            1 => writeln!(s, "f {a}/1 {b}/1 {c}/1"),
            2 => writeln!(s, "f\t{a}//1 {b}//1  {c}//1"),
            3 => writeln!(s, "f {a}/1/1 {b}/1/1 {c}/1/1"),
            _ => writeln!(s, "f -{} -{} -{}", back - a + 1, back - b + 1, back - c + 1),
        }
        .unwrap();
    }
    s
}

fn stl_text(t: &Triangles) -> String {
    let mut s = String::from("solid a thing\n");
    for face in &t.faces {
        s.push_str("  facet normal 0 0 0\n    outer loop\n");
        for [x, y, z] in face.map(|corner| t.vertices[corner as usize]) {
            writeln!(s, "      vertex {x:e} {y:e} {z:e}").unwrap();
        }
        s.push_str("    endloop\n  endfacet\n");
    }
    s.push_str("endsolid a thing\n");
    s
}

fn stl_binary(t: &Triangles, title: &[u8]) -> Vec<u8> {
    let mut bytes = title.to_vec();
    bytes.resize(80, 0);
    bytes.extend(count(t.faces.len()).to_le_bytes());
    for face in &t.faces {
        bytes.extend([0; 12]);
        for c in face.map(|corner| t.vertices[corner as usize]).as_flattened() {
            bytes.extend(narrow(*c).to_le_bytes());
        }
        bytes.extend([0; 2]);
    }
    bytes
}

/// A PLY file with more in it than is needed.
fn ply(t: &Triangles, encoding: &str) -> Vec<u8> {
    let header = format!(
        "ply\nformat {encoding} 1.0\ncomment by hand\nobj_info no\nelement camera 2\nproperty short id\nproperty list uchar \
         double view\nelement vertex {}\nproperty uchar red\nproperty double x\nproperty double y\nproperty list ushort \
         int tags\nproperty double z\nelement face {}\nproperty list uchar int vertex_indices\nproperty float \
         quality\nelement nothing 4000000000\nend_header\n",
        t.vertices.len(),
        t.faces.len()
    );
    let mut out = Out { bytes: header.into_bytes(), encoding };
    for i in 0..2_u8 {
        out.put(&i16::from(i).to_le_bytes(), i);
        out.put(&[i], i);
        for _ in 0..i {
            out.put(&0.5_f64.to_le_bytes(), 0.5);
        }
        out.end_row();
    }
    for [x, y, z] in &t.vertices {
        out.put(&[7], 7);
        out.put(&x.to_le_bytes(), x);
        out.put(&y.to_le_bytes(), y);
        out.put(&1_u16.to_le_bytes(), 1);
        out.put(&(-3_i32).to_le_bytes(), -3);
        out.put(&z.to_le_bytes(), z);
        out.end_row();
    }
    for face in &t.faces {
        out.put(&[3], 3);
        for corner in face {
            out.put(&corner.to_le_bytes(), corner);
        }
        out.put(&1_f32.to_le_bytes(), 1);
        out.end_row();
    }
    out.bytes
}

struct Out<'a> {
    bytes: Vec<u8>,
    encoding: &'a str,
}

impl Out<'_> {
    fn put(&mut self, little: &[u8], text: impl std::fmt::Display) {
        match self.encoding {
            "ascii" => self.bytes.extend(format!("{text} ").bytes()),
            "binary_little_endian" => self.bytes.extend(little),
            _ => self.bytes.extend(little.iter().rev()),
        }
    }

    fn end_row(&mut self) {
        if self.encoding == "ascii" {
            self.bytes.push(b'\n');
        }
    }
}

/// The sample in every format and encoding.
fn files() -> Vec<(MeshFormat, Vec<u8>)> {
    let t = sample();
    let encodings = ["ascii", "binary_little_endian", "binary_big_endian"];
    let mut files: Vec<_> = encodings.iter().map(|encoding| (MeshFormat::Ply, ply(&t, encoding))).collect();
    files.push((MeshFormat::Obj, obj(&t).into_bytes()));
    files.push((MeshFormat::Stl, stl_text(&t).into_bytes()));
    files.push((MeshFormat::Stl, stl_binary(&t, b"solid in name only")));
    files
}

#[test]
fn what_is_written_is_read_back_from_every_format() {
    let t = sample();
    assert_eq!(t.faces.len(), 80);
    assert_eq!(t.vertices.len(), 42);
    for (format, bytes) in files() {
        assert_eq!(read(format, &bytes).unwrap(), t, "{format}");
    }
    assert!(Mesh::new(t, Role::Body).is_ok());
}

#[test]
fn polygons_become_fans() {
    let expected = Triangles {
        vertices: vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]],
        faces: vec![[0, 1, 2], [0, 2, 3]],
    };
    let obj = "f 1 2 3 4\nv 0 0 0\nv 1 0 0\nv 1 1 0 1.0\nv 0 1 0 0.5 0.5 0.5";
    assert_eq!(read(MeshFormat::Obj, obj.as_bytes()).unwrap(), expected);
    let ply = "ply\r\nformat ascii 1.0\r\nelement vertex 4\r\nproperty float x\r\nproperty float y\r\nproperty float \
               z\r\nelement face 1\r\nproperty list uchar uint vertex_index\r\nend_header\r\n0 0 0\r\n1 0 0\r\n1 1 0\r\n0 1 \
               0\r\n4 0 1 2 3\r\n";
    assert_eq!(read(MeshFormat::Ply, ply.as_bytes()).unwrap(), expected);
}

#[test]
fn extensions_tell_the_format() {
    assert_eq!(MeshFormat::from_extension("STL"), Some(MeshFormat::Stl));
    assert_eq!(MeshFormat::from_extension("ply"), Some(MeshFormat::Ply));
    assert_eq!(MeshFormat::from_extension("Obj"), Some(MeshFormat::Obj));
    assert_eq!(MeshFormat::from_extension("3ds"), None);
}

fn refused(format: MeshFormat, bytes: &[u8]) -> String {
    read(format, bytes).unwrap_err().to_string()
}

#[test]
fn faults_in_obj_are_told_with_their_line() {
    for (text, said) in [
        ("v 0 0\n", "line 1: expected a finite coordinate, found nothing"),
        ("\nv 0 x 0\n", "line 2: expected a finite coordinate, found \"x\""),
        ("v 0 0 inf\n", "line 1: expected a finite coordinate, found \"inf\""),
        ("v 0 0 0\nf 1 1\n", "line 2: expected at least 3 corners of a face, found 2"),
        ("v 0 0 0\nf 1 2 1\n", "line 2: expected a corner among the file's 1 vertices, found 2"),
        (
            "f 0 1 1\n",
            "line 1: expected a corner's number from 1, or from -1 backwards (0 vertices so far), found \"0\"",
        ),
        (
            "v 0 0 0\nf 1 1 -2//5\n",
            "line 2: expected a corner's number from 1, or from -1 backwards (1 vertices so far), found \"-2//5\"",
        ),
        ("f 1 /2 \x01", "line 1: expected a corner's number from 1, or from -1 backwards, found \"/2\""),
    ] {
        assert_eq!(refused(MeshFormat::Obj, text.as_bytes()), format!("reading OBJ: {said}"));
    }
}

#[test]
fn faults_in_stl_are_told_with_their_place() {
    for (text, said) in [
        ("", "byte 0: expected \"solid\", or a binary header of 84 bytes, found a file of 0 bytes"),
        ("solid\nfacet\nvertex 1 2\n", "line 3: expected a finite coordinate, found nothing"),
        ("solid\nvertex 1 2 3\nendloop\n", "line 3: expected 3 corners of a facet, found 1"),
        ("solid\nvertex 1 2 3\nfacet\n", "line 3: expected vertex or endloop, found \"facet\""),
        ("SOLID\nfacit\n", "line 2: expected a keyword of STL, found \"facit\""),
        ("solid\n\nfacet\n\n", "line 3: expected endsolid as the last line, found the end of the file"),
    ] {
        assert_eq!(refused(MeshFormat::Stl, text.as_bytes()), format!("reading STL: {said}"));
    }
    let cube = cuboid([1.0; 3]);
    let mut bytes = stl_binary(&cube, b"binary");
    bytes[84 + 50 + 12 + 16..][..4].copy_from_slice(&f32::NAN.to_le_bytes());
    assert_eq!(
        refused(MeshFormat::Stl, &bytes),
        "reading STL: byte 162: expected a finite coordinate, found NaN"
    );
    bytes.pop();
    assert_eq!(
        refused(MeshFormat::Stl, &bytes),
        "reading STL: byte 80: expected 684 bytes in all, for the 12 facets that the file says it has, found 683 bytes"
    );
}

#[test]
fn faults_in_ply_are_told_with_their_place() {
    let good = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\nelement \
                face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";
    assert!(read(MeshFormat::Ply, good.as_bytes()).is_ok());
    for (from, to, said) in [
        ("ply\n", "plx\n", "line 1: expected \"ply\", found \"plx\""),
        (
            "end_header",
            "",
            "line 10: expected format, element, property, comment, obj_info or end_header, found \"0 0 0\"",
        ),
        (
            "ascii",
            "utf8",
            "line 2: expected ascii, binary_little_endian or binary_big_endian, and 1.0, found \"format utf8 1.0\"",
        ),
        (
            "format ascii 1.0",
            "",
            "line 9: expected a line \"format\" before the header's end, found \"end_header\"",
        ),
        (
            "vertex 3",
            "vertex -3",
            "line 3: expected an element's name and a count below 2^32, found \"element vertex -3\"",
        ),
        ("float x", "real x", "line 4: expected a property's type and name, found \"property real x\""),
        ("float z", "float w", "line 9: expected a property z of the element vertex, found the header's end"),
        (
            "int vertex_ind",
            "int ind",
            "line 9: expected a list vertex_indices or vertex_index of the element face, found the header's end",
        ),
        ("element face", "element vertex", "line 7: expected each element once, found \"element vertex 1\""),
        ("1 0 0", "1 nan 0", "line 11: expected a finite coordinate, found NaN"),
        ("1 0 0", "1 0,0 0", "line 11: expected a number, found \"0,0\""),
        ("3 0 1 2", "3 0 1", "line 14: expected a number, found the end of the file"),
        ("3 0 1 2", "3 0 1 3", "line 13: expected a vertex, an integer from 0 and below 3, found 3"),
        ("3 0 1 2", "3 0 1 0.5", "line 13: expected a vertex, an integer from 0 and below 3, found 0.5"),
        ("3 0 1 2", "2 0 1", "line 13: expected at least 3 corners of a face, found 2"),
        (
            "3 0 1 2",
            "3 0 1 2\n3 0 1 2",
            "line 14: expected the end of the file after the last element, found 8 more bytes",
        ),
    ] {
        let text = good.replacen(from, to, 1);
        assert_eq!(refused(MeshFormat::Ply, text.as_bytes()), format!("reading PLY: {said}"));
    }
    let binary = ply(&sample(), "binary_big_endian");
    let start = binary.len() - 80 * 17;
    let cut = &binary[..start + 3];
    assert_eq!(
        refused(MeshFormat::Ply, cut),
        format!(
            "reading PLY: byte {}: expected 4 bytes of a value, found 2 before the end of the file",
            start + 1
        )
    );
    let mut wrong = binary.clone();
    wrong[start + 1..start + 5].fill(0xFF);
    let place = start + 1;
    let said =
        format!("reading PLY: byte {place}: expected a vertex, an integer from 0 and below 42, found -1");
    assert_eq!(refused(MeshFormat::Ply, &wrong), said);
}

#[test]
fn counts_that_lie_take_no_memory() {
    let header = "ply\nformat binary_little_endian 1.0\nelement vertex 4294967295\nproperty float x\nproperty float \
                  y\nproperty float z\nelement face 4294967295\nproperty list uint int vertex_index\nend_header\n";
    assert!(refused(MeshFormat::Ply, header.as_bytes()).contains("4 bytes of a value, found 0 before"));
    let mut stl = vec![0; 84];
    stl[80..].fill(0xFF);
    assert!(refused(MeshFormat::Stl, &stl).contains("214748364834 bytes in all"));
}

proptest! {
    /// Whatever the bytes, nothing panics; what is read makes a mesh or an error.
    #[test]
    fn any_bytes_are_let_pass_or_refused(bytes in proptest::collection::vec(any::<u8>(), 0..300), start in 0..4_usize) {
        let starts: [&[u8]; 4] = [b"", b"solid ", b"ply\nformat ascii 1.0\n", b"v 0 0 0\nf "];
        let bytes = [starts[start], &bytes].concat();
        for format in [MeshFormat::Ply, MeshFormat::Obj, MeshFormat::Stl] {
            if let Ok(t) = read(format, &bytes) {
                drop(Mesh::new(t, Role::Body));
            }
        }
    }

    /// The same for files in which a few bytes are changed, lost or doubled.
    #[test]
    fn damaged_files_are_let_pass_or_refused(
        file in 0..6_usize,
        changes in proptest::collection::vec((any::<proptest::sample::Index>(), any::<u8>(), 0..4_u8), 1..6),
    ) {
        let (format, mut bytes) = files().swap_remove(file);
        for (at, byte, way) in changes {
            let at = at.index(bytes.len());
            match way {
                0 => bytes[at] = byte,
                1 => bytes[at] = b" \n-19.e"[usize::from(byte % 7)],
                2 => drop(bytes.remove(at)),
                _ => bytes.insert(at, byte),
            }
        }
        for role in [Role::Body, Role::Wall] {
            if let Ok(mesh) = read(format, &bytes).and_then(|t| Mesh::new(t, role)) {
                prop_assert!(mesh.distance_m([0.1, 0.2, 0.3]).is_finite());
                mesh.cast([0.1, 0.2, 0.3], [0.0, 0.0, 1.0], 10.0);
            }
        }
    }
}
