//! Scenes with meshes, through the binary; and how fast one of a million triangles is.

#![cfg(feature = "mesh")]
#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "clippy.toml's leave for tests doesn't reach their helpers"
)]
#![allow(clippy::disallowed_methods, clippy::print_stdout, reason = "one test measures time, and tells it")]

mod common;

use std::fmt::Write as _;
use std::path::Path;
use std::time::Instant;

use common::{Folder, SCENE, VEHICLE};
use headrace_core::app::device::DeviceKind;
use headrace_core::config::Document;
use headrace_core::tunnel::Profile;
use headrace_replay::simulate::{Scene, Simulation};

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

#[track_caller]
fn refused(folder: &Folder, words: &[&str]) {
    let answer = folder.headrace(&["simulate", "scene.toml", "-o", "dive.mcap"]);
    assert_eq!(answer.code, Some(2), "{}", answer.stderr);
    for word in words {
        assert!(answer.stderr.contains(word), "{word:?} is not in {}", answer.stderr);
    }
    assert!(!folder.path("dive.mcap").exists(), "no log of a scene that is none");
}

#[test]
fn a_mesh_that_is_none_is_refused_with_the_place() {
    let folder = folder("file = \"box.obj\"\nchainage_m = 5");
    let place = "scene.toml:13: tunnel.features[0].file = \"box.obj\"";
    refused(&folder, &[place, "can't be read"]);
    folder.write("box.obj", cuboid().replace("f 5 6 8 7\n", ""));
    refused(&folder, &[place, "1 hole(s)", "4 edges"]);
    folder.write("box.obj", cuboid().replace("v 0.5 0.5 0", "v 0.5"));
    refused(&folder, &[place, "reading OBJ: line 5"]);
    folder.write("box.obj", &cuboid()[..100]);
    refused(&folder, &[place]);
    folder.write("box.obj", cuboid().replace(" 1\n", " 9\n"));
    refused(&folder, &["leads through mesh_0"]);
}

const KINDS: [&dyn DeviceKind; 5] = [
    &headrace_imagenex881::Kind,
    &headrace_ping1d::Kind,
    &headrace_bar100::Kind,
    &headrace_imu_can::Kind,
    &headrace_tether_hid::Kind,
];

/// Around the profile and along the tunnel: a million triangles in 150 m.
const SIDES: u32 = 400;
const RINGS: u32 = 1_250;
const LENGTH_M: f64 = 150.0;

/// A wall of rock as binary PLY: the profile, moved by up to 2 cm at each vertex.
fn rough(profile: &Profile) -> Vec<u8> {
    let header = format!(
        "ply\nformat binary_little_endian 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\n\
         element face {}\nproperty list uchar int vertex_indices\nend_header\n",
        (RINGS + 1) * SIDES,
        2 * RINGS * SIDES
    );
    let mut bytes = header.into_bytes();
    let [_, middle_m] = profile.reference();
    let mut state = 1_u64;
    for ring in 0..=RINGS {
        for side in 0..SIDES {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            let share = 1.0 + 0.01 * ((state >> 11) as f64 / (1_u64 << 53) as f64 - 0.5);
            let [y, z] = profile.point_at(profile.perimeter_m() * f64::from(side) / f64::from(SIDES));
            let x_m = LENGTH_M * f64::from(ring) / f64::from(RINGS);
            #[expect(clippy::cast_possible_truncation, reason = "as scanners write it")]
            let place = [x_m, share * y, middle_m + share * (z - middle_m)].map(|c| c as f32);
            bytes.extend(place.iter().flat_map(|c| c.to_le_bytes()));
        }
    }
    for ring in 0..RINGS {
        for side in 0..SIDES {
            let [a, b] = [side, (side + 1) % SIDES].map(|corner| ring * SIDES + corner);
            for face in [[a, b, b + SIDES], [a, b + SIDES, a + SIDES]] {
                bytes.push(3);
                bytes.extend(face.iter().flat_map(|corner| corner.to_le_bytes()));
            }
        }
    }
    bytes
}

/// Run in release: `cargo test --release --features mesh --test mesh_scene -- --ignored --nocapture`.
#[test]
#[ignore = "a measurement, for a release build"]
fn times_real_time_in_a_million_triangles() {
    let text = |effects: &str, tunnel: &str| {
        format!(
            "vehicle = \"vita2-4.toml\"\n[vehicle_changes]\ntunnel.profile = \"ceran-blueprint\"\n\
             heads.planned_speed_mps = 0.197\nsensors.all.mode = \"fastest\"\n[trajectory]\nstart_m = 10\n\
             [[trajectory.legs]]\ndistance_m = 60\nspeed_mps = 0.197\n[effects]\n{effects}\n{tunnel}"
        )
    };
    let wall = "[[tunnel.features]]\nkind = \"mesh\"\nfile = \"rock.ply\"\nrole = \"wall\"\n";
    let vehicles = Path::new(env!("CARGO_MANIFEST_DIR")).join("deploy/vehicles");
    let parse = |scene: &str, rock: &[u8]| {
        let load = |name: &str| {
            if name == "rock.ply" {
                return Ok(rock.to_vec());
            }
            std::fs::read(vehicles.join(name)).map_err(|error| error.to_string())
        };
        Scene::parse(Document::new("scene", scene), &KINDS, &load, None).unwrap()
    };
    let rock = rough(&parse(&text("", ""), &[]).vehicle.tunnel.profile);
    for effects in ["motion_within_turn = {}", "motion_within_turn = {}\nocclusion = {}\nbeam_cone = {}"] {
        for (name, tunnel) in [("profile", ""), ("mesh", wall)] {
            let begin = Instant::now();
            let scene = parse(&text(effects, tunnel), &rock);
            let parsed_s = begin.elapsed().as_secs_f64();
            let begin = Instant::now();
            let mut simulation = Simulation::new(&scene).unwrap();
            while simulation.advance() {}
            let took_s = begin.elapsed().as_secs_f64();
            let ratio = simulation.duration_s() / took_s;
            println!(
                "{name:8} {effects:?}: read in {parsed_s:.2} s, {:.0} s in {took_s:.2} s, {ratio:.0} times real time",
                simulation.duration_s()
            );
        }
    }
}
