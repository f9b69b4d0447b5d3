//! PLY files written and read back; refused files and their error messages.

use proptest::prelude::*;

use super::tests::icosphere;
use super::*;

const ENCODINGS: [&str; 3] = ["ascii", "binary_little_endian", "binary_big_endian"];

fn sample() -> Triangles {
    icosphere(1, || 2.0)
}

/// The triangles as a PLY file, which has more elements and properties than the reader needs.
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

#[test]
fn triangles_are_read_back_in_every_encoding() {
    let t = sample();
    assert_eq!((t.faces.len(), t.vertices.len()), (80, 42));
    for encoding in ENCODINGS {
        assert_eq!(read(&ply(&t, encoding)).unwrap(), t, "{encoding}");
    }
    assert!(Mesh::new(t, Role::Body).is_ok());
}

#[test]
fn polygons_are_split_into_triangles() {
    let ply = "ply\r\nformat ascii 1.0\r\nelement vertex 5\r\nproperty float x\r\nproperty int y\r\nproperty float \
               z\r\nelement face 1\r\nproperty list uchar uint vertex_index\r\nend_header\r\n0 0 0\r\n0.1 0 0\r\n1 1 0\r\n0 \
               1 0\r\n-1 0.5 12345.678\r\n5 0 1 2 3 4\r\n\r\n";
    let expected = Triangles {
        vertices: vec![[0.0; 3], [0.1, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0], [-1.0, 0.5, 12345.678]],
        faces: vec![[0, 1, 2], [0, 2, 3], [0, 3, 4]],
    };
    assert_eq!(read(ply.as_bytes()).unwrap(), expected);
}

fn refused(bytes: &[u8]) -> String {
    let read = read(bytes).and_then(|triangles| Mesh::new(triangles, Role::Body));
    read.unwrap_err().to_string()
}

#[test]
fn faults_in_text_ply_files_are_described() {
    let good = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\nelement \
                face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";
    assert!(read(good.as_bytes()).is_ok());
    for (from, to, said) in [
        ("ply\n", "plx\n", "Line 1: "),
        ("end_header", "", "Line 9: "),
        ("ascii", "utf8", "Line 2: "),
        ("format ascii 1.0\n", "", "No format line found."),
        ("vertex 3", "vertex -3", "Line 3: "),
        ("float x", "real x", "Line 4: "),
        ("float z", "float w", "the element vertex has no property z"),
        ("int vertex_ind", "int ind", "the element face has no list vertex_indices or vertex_index"),
        ("1 0 0", "1 nan 0", "Line 11: "),
        ("1 0 0", "1 0,0 0", "Line 11: "),
        ("3 0 1 2", "3 0 1", "Line 13: "),
        ("3 0 1 2\n", "", "Line 13: "),
        ("3 0 1 2", "3 0 1 0.5", "Line 13: "),
        ("3 0 1 2", "3 0 1 -1", "Line 13: "),
        ("3 0 1 2", "2 0 1", "face 0 (counted from 0) has 2 corners; a face needs at least 3"),
        ("3 0 1 2", "0", "face 0 (counted from 0) has 0 corners; a face needs at least 3"),
        ("3 0 1 2", "3 0 1 2\n3 0 1 2", "7 more bytes after the last element"),
    ] {
        let words = refused(good.replacen(from, to, 1).as_bytes());
        assert!(words.starts_with(&format!("reading PLY: {said}")), "{words}");
    }
    assert_eq!(
        refused(good.replace("3 0 1 2", "3 0 1").as_bytes()),
        "reading PLY: Line 13: Couldn't read element line. String: '3 0 1 ' Error: Expected 3 list elements, but found only 2."
    );
    let words = refused(good.replace("3 0 1 2", "3 0 1 3").as_bytes());
    assert_eq!(words, "face 0 refers to vertex 3, but there are 3 vertices (both counted from 0)");
    // An error quotes only the start of a long line.
    let words = refused(good.replace("1 0 0", &"x".repeat(100_000)).as_bytes());
    assert!(words.len() < 400, "{words}");
}

#[test]
fn faults_in_binary_ply_files_are_described() {
    let binary = ply(&sample(), "binary_big_endian");
    let faces = binary.len() - 80 * 17;
    let words = refused(&binary[..faces + 3]);
    assert!(words.contains("end of file") && words.contains("'face' (expected 80, got 0)"), "{words}");
    let mut wrong = binary.clone();
    wrong[faces + 1..faces + 5].fill(0xFF);
    let words = refused(&wrong);
    assert!(words.contains("'vertex_indices'") && words.contains("unsupported"), "{words}");
    wrong[faces + 1] = 0x7F;
    assert!(refused(&wrong).starts_with("face 0 refers to vertex 2147483647, but there are 42 vertices"));
    let mut wrong = binary;
    // Offset of the x of the first vertex, after the header, two cameras and the vertex's colour.
    let x = faces - 42 * 31 + 1;
    wrong[x..x + 8].copy_from_slice(&f64::NAN.to_be_bytes());
    assert!(refused(&wrong).starts_with("vertex 0 (counted from 0) is at (NaN, "));
}

#[test]
fn wrong_element_counts_in_ply_files_allocate_no_memory() {
    let file = |vertices: u64, list: &str| {
        format!(
            "ply\nformat binary_little_endian 1.0\nelement nothing {vertices}\nelement vertex {vertices}\nproperty float \
             x\nproperty float y\nproperty float z\nelement face {vertices}\nproperty list {list} int \
             vertex_index\nend_header\n"
        )
    };
    for vertices in [u64::from(u32::MAX), u64::MAX] {
        let words = refused(file(vertices, "uint").as_bytes());
        assert!(words.contains("end of file") && words.contains("'vertex'"), "{words}");
    }
    let mut long_list = file(1, "uint").into_bytes();
    long_list.extend([0; 12]);
    long_list.extend([0xFF; 4]);
    let words = refused(&long_list);
    assert!(words.contains("end of file") && words.contains("'face'"), "{words}");
    // The file is in text encoding, and ends before it has as many elements as its header states.
    let text = file(u64::MAX, "uint").replace("binary_little_endian", "ascii");
    assert!(refused(text.as_bytes()).contains("end of file"));
}

proptest! {
    /// Arbitrary bytes give a mesh or an error, and never a panic.
    #[test]
    fn arbitrary_bytes_give_mesh_or_error(bytes in proptest::collection::vec(any::<u8>(), 0..300), start in 0..3_usize) {
        let starts = ["", "ply\nformat ascii 1.0\n", "ply\nformat binary_little_endian 1.0\nelement vertex 3\nproperty float "];
        let bytes = [starts[start].as_bytes(), &bytes].concat();
        if let Ok(t) = read(&bytes) {
            drop(Mesh::new(t, Role::Body));
        }
    }

    /// Files with a few bytes changed, lost or doubled give a mesh or an error, and never a panic.
    #[test]
    fn damaged_files_give_a_mesh_or_an_error(
        encoding in 0..3_usize,
        changes in proptest::collection::vec((any::<proptest::sample::Index>(), any::<u8>(), 0..4_u8, any::<bool>()), 1..6),
    ) {
        let mut bytes = ply(&sample(), ENCODINGS[encoding]);
        for (at, byte, way, in_header) in changes {
            let at = at.index(if in_header { 400 } else { bytes.len() });
            match way {
                0 => bytes[at] = byte,
                1 => bytes[at] = b" \n-19.e"[usize::from(byte % 7)],
                2 => drop(bytes.remove(at)),
                _ => bytes.insert(at, byte),
            }
        }
        for role in [Role::Body, Role::Wall] {
            if let Ok(mesh) = read(&bytes).and_then(|t| Mesh::new(t, role)) {
                mesh.cast([0.1, 0.2, 0.3], [0.0, 0.0, 1.0], 10.0);
            }
        }
    }
}
