//! Scenes with meshes, simulated by the program.

use std::fmt::Write as _;

use headrace_tests::{Folder, SCENE, VEHICLE};

/// A cube with edges of 1 m, as a PLY mesh. The mesh's origin is in the lower face of the cube.
fn cuboid() -> String {
    let mut text = String::from(
        "ply\nformat ascii 1.0\nelement vertex 8\nproperty float x\nproperty float y\nproperty float z\n\
         element face 6\nproperty list uchar int vertex_indices\nend_header\n",
    );
    for corner in 0..8_u8 {
        let [x, y, z] = [0, 1, 2].map(|k| f64::from(corner >> k & 1));
        writeln!(text, "{} {} {z}", x - 0.5, y - 0.5).unwrap();
    }
    text + "4 0 2 6 4\n4 1 3 7 5\n4 0 1 5 4\n4 2 3 7 6\n4 0 1 3 2\n4 4 5 7 6\n"
}

fn folder(keys: &str) -> Folder {
    let folder = Folder::new();
    folder.write("vehicle.toml", VEHICLE);
    folder.write("scene.toml", format!("{SCENE}\n[[tunnel.features]]\nkind = \"mesh\"\n{keys}\n"));
    folder
}

/// Values of the column `wanted` in the ground truth, from rows with `value` in the column `key`.
fn column(truth: &str, (key, value): (&str, &str), wanted: &str) -> Vec<String> {
    let mut rows = truth.lines().skip_while(|line| line.starts_with('#'));
    let columns: Vec<&str> = rows.next().unwrap().split(',').collect();
    let at = |name: &str| columns.iter().position(|column| *column == name).unwrap();
    let rows = rows.map(|row| row.split(',').collect::<Vec<_>>()).filter(|row| row[at(key)] == value);
    rows.map(|row| row[at(wanted)].to_owned()).collect()
}

#[test]
fn echosounder_measures_a_mesh_body_on_the_floor() {
    let folder = folder("file = \"box.ply\"\nname = \"car\"\nchainage_m = 5");
    folder.write("box.ply", cuboid());
    let arguments = ["simulate", "scene.toml", "-o", "dive.mcap", "--truth", "truth.csv"];
    let answer = folder.headrace(&arguments);
    assert_eq!(answer.code, Some(0), "{}", answer.stderr);
    let truth = String::from_utf8(folder.read("truth.csv")).unwrap();
    let down = ("source", "ping_down");
    let chainages = column(&truth, down, "chainage_m");
    let heights = column(&truth, down, "wall_z_m");
    let mut over = 0;
    for (chainage, height) in chainages.iter().zip(&heights) {
        let (chainage_m, height_m): (f64, f64) = (chainage.parse().unwrap(), height.parse().unwrap());
        // The echosounder looks straight down from near the vehicle's position, so it hits the cube if the vehicle is
        // above the cube.
        if (chainage_m - 5.0).abs() < 0.45 {
            over += 1;
            assert!((height_m - 1.0).abs() < 1e-9, "{chainage_m}: {height_m}");
        } else if (chainage_m - 5.0).abs() > 0.55 {
            assert!(height_m < 0.1, "{chainage_m}: {height_m}");
        }
    }
    assert!(over > 5, "{over}");
    assert!(truth.contains("car"), "the truth doesn't name the body that the beam met");
}

#[test]
fn invalid_mesh_is_refused_with_the_place() {
    let folder = folder("file = \"box.ply\"\nchainage_m = 5");
    let place = "scene.toml:13: tunnel.features[0].file = \"box.ply\"";
    folder.refuses_scene(&[place, "can't be read"]);
    folder.write("box.ply", cuboid().replace("face 6", "face 5").replace("4 4 5 7 6\n", ""));
    folder.refuses_scene(&[place, "1 hole(s)", "4 edges"]);
    folder.write("box.ply", cuboid().replace("\n0.5 0.5 0\n", "\n0.5\n"));
    folder.refuses_scene(&[place, "reading PLY: Line 13: "]);
    folder.write("box.ply", &cuboid()[..200]);
    folder.refuses_scene(&[place]);
    folder.write("box.ply", cuboid().replace(" 1\n", " 9\n"));
    folder.refuses_scene(&["leads through mesh_0"]);
}
