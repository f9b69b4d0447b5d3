//! Refused meshes, repaired meshes, error messages, and the run time for large meshes.

use super::tests::{cuboid, icosphere, tube};
use super::*;

fn refused(triangles: &Triangles, role: Role) -> String {
    Mesh::new(triangles.clone(), role).unwrap_err().to_string()
}

#[test]
fn corner_numbers_and_coordinates_out_of_range_are_refused() {
    let cube = cuboid([1.0; 3]);
    let mut t = cube.clone();
    t.faces[5][1] = 8;
    assert_eq!(
        refused(&t, Role::Body),
        "face 5 refers to vertex 8, but there are 8 vertices (both counted from 0)"
    );
    for (value, shown) in [(f64::NAN, "NaN"), (f64::INFINITY, "inf"), (1e6, "1000000.000")] {
        let mut t = cube.clone();
        t.vertices[3][2] = value;
        let expected = format!(
            "vertex 3 (counted from 0) is at (1.000, 1.000, {shown}); coordinates must be finite and within 100 km of 0"
        );
        assert_eq!(refused(&t, Role::Body), expected);
    }
}

#[test]
fn degenerate_triangles_are_dropped() {
    let none = "the mesh has no face (0 given; triangles with two equal corners are ignored)";
    assert_eq!(refused(&Triangles::default(), Role::Wall), none);
    let mut t = cuboid([1.0; 3]);
    let point = Triangles { vertices: vec![[7.0; 3]; 3], faces: vec![[0, 1, 2]] };
    assert!(refused(&point, Role::Body).starts_with("the mesh has no face (1 given;"));
    t.faces.insert(0, [4, 4, 5]);
    t.vertices.push(t.vertices[7].map(|c| c + 1e-10));
    t.faces.insert(3, [7, 2, 8]);
    let mesh = Mesh::new(t, Role::Body).unwrap();
    assert_eq!(mesh.surface.faces.len(), 12);
    let hit = mesh.cast([0.0; 3], [0.0, 0.0, 1.0], 9.0).unwrap();
    assert_eq!(hit.face, 12, "numbers are those of the triangles given");
}

#[test]
fn duplicated_vertices_are_welded() {
    let whole = icosphere(3, || 2.0);
    let mut t = Triangles::default();
    for (i, corner) in (0_u32..).zip(whole.faces.as_flattened()) {
        // The copies of a vertex are less than a billionth of the mesh's diagonal apart, so they are welded.
        let off = f64::from(i % 3) * 1e-9;
        t.vertices.push(whole.vertices[*corner as usize].map(|c| c + off));
    }
    t.faces = (0..u32::try_from(whole.faces.len()).unwrap()).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    assert_eq!(Mesh::new(t.clone(), Role::Body).unwrap().surface.faces.len(), whole.faces.len());
    t.vertices[0][0] += 1e-6;
    assert!(refused(&t, Role::Body).starts_with("the mesh has 1 hole(s)"));
}

#[test]
fn edge_shared_by_three_faces_is_refused() {
    let mut t = cuboid([1.0; 3]);
    t.vertices.push([5.0, 0.0, 0.0]);
    t.faces.push([0, 1, 8]);
    assert_eq!(
        refused(&t, Role::Body),
        "3 faces share the edge from (-1.000, -1.000, -1.000) to (1.000, -1.000, -1.000); at most 2 may"
    );
}

#[test]
fn body_with_holes_is_refused() {
    let mut t = icosphere(3, || 2.0);
    let mut middle = t.faces.len() / 2;
    t.faces.remove(0);
    while t.faces[middle].iter().any(|corner| t.faces[0].contains(corner)) {
        middle += 1;
    }
    // Removes all faces around vertex 100, which is not a corner of the icosahedron.
    t.faces.retain(|face| !face.contains(&100));
    let expected =
        "the mesh has 2 hole(s) where it must be closed; the largest has 6 edges, one of them at (";
    let said = refused(&t, Role::Body);
    assert!(said.starts_with(expected), "{said}");
    let tube = tube(10, 8, 10.0, || 2.0);
    let said = refused(&tube, Role::Body);
    assert_eq!(
        said,
        "the mesh has 2 hole(s) where it must be closed; the largest has 8 edges, one of them at (0.000, 0.000, 2.000)"
    );
}

#[test]
fn mesh_wall_may_be_open_only_at_its_ends() {
    let whole = tube(100, 8, 100.0, || 2.0);
    assert!(Mesh::new(whole.clone(), Role::Wall).is_ok());

    // Each ring has 16 faces. A face that is missing within 2 % of the wall's length from an end is part of the open
    // end.
    let mut t = whole.clone();
    t.faces.remove(16);
    assert!(Mesh::new(t, Role::Wall).is_ok());
    let mut t = whole.clone();
    t.faces.remove(16 * 50);
    assert_eq!(
        refused(&t, Role::Wall),
        "the mesh has 1 hole(s) where it must be closed; the largest has 3 edges, one of them at (50.000, 0.000, 2.000)"
    );

    // A half pipe is refused, because all its open edges form a single rim.
    let mut t = whole.clone();
    t.faces.retain(|face| face.iter().all(|corner| corner % 8 <= 4));
    assert!(
        refused(&t, Role::Wall)
            .starts_with("the mesh has 1 hole(s) where it must be closed; the largest has 208")
    );

    let mut t = whole.clone();
    t.vertices.push([100.0, 0.0, 0.0]);
    t.faces.extend((0..8).map(|j| [800 + j, 800 + (j + 1) % 8, 808]));
    assert_eq!(
        refused(&t, Role::Wall),
        "the wall is closed at its end at x = 100.000 m; it must have an opening within 2.000 m of it"
    );
    assert_eq!(
        refused(&cuboid([1.0; 3]), Role::Wall),
        "the wall is closed at its end at x = -1.000 m; it must have an opening within 0.500 m of it"
    );
}
