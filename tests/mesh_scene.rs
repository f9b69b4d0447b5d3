//! Scenes with meshes, through the binary.

#![cfg(feature = "mesh")]
#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "clippy.toml's leave for tests doesn't reach their helpers"
)]

mod common;

use std::fmt::Write as _;

use common::{Folder, SCENE, VEHICLE};

/// A box of 1 m as OBJ, on its lower side.
fn cuboid() -> String {
    let mut text = String::from("# a box\n");
    for corner in 0..8_u8 {
        let [x, y, z] = [0, 1, 2].map(|k| f64::from(corner >> k & 1));
        writeln!(text, "v {} {} {z}", x - 0.5, y - 0.5).unwrap();
    }
    text + "f 1 3 7 5\nf 2 4 8 6\nf 1 2 6 5\nf 3 4 8 7\nf 1 2 4 3\nf 5 6 8 7\n"
}

fn folder(keys: &str) -> Folder {
    let folder = Folder::new();
    folder.write("vehicle.toml", VEHICLE);
    folder.write("scene.toml", format!("{SCENE}\n[[tunnel.features]]\nkind = \"mesh\"\n{keys}\n"));
    folder
}

/// Values of one column of the truth, from the rows whose `key` column is as told.
fn column(truth: &str, (key, value): (&str, &str), wanted: &str) -> Vec<String> {
    let mut rows = truth.lines().skip_while(|line| line.starts_with('#'));
    let columns: Vec<&str> = rows.next().unwrap().split(',').collect();
    let at = |name: &str| columns.iter().position(|column| *column == name).unwrap();
    let rows = rows.map(|row| row.split(',').collect::<Vec<_>>()).filter(|row| row[at(key)] == value);
    rows.map(|row| row[at(wanted)].to_owned()).collect()
}

#[test]
fn a_body_on_the_floor_is_what_sounders_measure() {
    let folder = folder("file = \"box.obj\"\nname = \"car\"\nchainage_m = 5");
    folder.write("box.obj", cuboid());
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
        // The sounder looks straight down from the vehicle's place, near enough.
        if (chainage_m - 5.0).abs() < 0.45 {
            over += 1;
            assert!((height_m - 1.0).abs() < 1e-9, "{chainage_m}: {height_m}");
        } else if (chainage_m - 5.0).abs() > 0.55 {
            assert!(height_m < 0.1, "{chainage_m}: {height_m}");
        }
    }
    assert!(over > 5, "{over}");
    assert!(truth.contains("car"), "the truth names what was met");
}

#[test]
fn a_mesh_that_is_none_is_refused_with_the_place() {
    let folder = folder("file = \"box.obj\"\nchainage_m = 5");
    let place = "scene.toml:13: tunnel.features[0].file = \"box.obj\"";
    folder.refuses_scene(&[place, "can't be read"]);
    folder.write("box.obj", cuboid().replace("f 5 6 8 7\n", ""));
    folder.refuses_scene(&[place, "1 hole(s)", "4 edges"]);
    folder.write("box.obj", cuboid().replace("v 0.5 0.5 0", "v 0.5"));
    folder.refuses_scene(&[place, "reading OBJ: line 5"]);
    folder.write("box.obj", &cuboid()[..100]);
    folder.refuses_scene(&[place]);
    folder.write("box.obj", cuboid().replace(" 1\n", " 9\n"));
    folder.refuses_scene(&["leads through mesh_0"]);
}
