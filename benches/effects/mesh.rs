//! Simulation speed with a wall of a million triangles, compared with the profile that the mesh follows.

use headrace_geometry::tunnel::Profile;
use headrace_oracle::timed;
use headrace_simulator::Simulation;
use headrace_tests::scenes;

use crate::workload::{ROUNDS, best};

const EFFECTS: [(&str, &str); 2] = [
    ("rays", "motion_within_turn = {}\n"),
    ("occlusion, and a beam of 16 rays", "motion_within_turn = {}\nocclusion = {}\nbeam_cone = {}\n"),
];
const WALL: &str = "[[tunnel.features]]\nkind = \"mesh\"\nfile = \"rock.ply\"\nrole = \"wall\"\n";
/// Number of points around the profile. `RINGS` is the number along the tunnel. In 150 m they give a million triangles.
const SIDES: u32 = 400;
const RINGS: u32 = 1_250;
const LENGTH_M: f64 = 150.0;

/// A rock wall as binary PLY: the profile with each vertex displaced by up to 2 cm.
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
            #[expect(clippy::cast_possible_truncation, reason = "a mesh in the format that scanners write")]
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

/// Prints the speed of simulated dives along the wall of triangles and along the profile.
pub(crate) fn mesh() {
    let scene = |effects: &str, tunnel: &str, rock: &[u8]| {
        let text = format!(
            "vehicle = \"vita2-4.toml\"\n[vehicle_changes]\ntunnel.profile = \"ceran-blueprint\"\n\
             heads.planned_speed_mps = 0.197\nsensors.all.mode = \"fastest\"\n[trajectory]\nstart_m = 10\n\
             [[trajectory.legs]]\ndistance_m = 60\nspeed_mps = 0.197\n[effects]\n{effects}{tunnel}"
        );
        let load =
            |name: &str| if name == "rock.ply" { Ok(rock.to_vec()) } else { scenes::vehicle_file(name) };
        scenes::scene_from(&text, &load)
    };
    let rock = rough(&scene("", "", &[]).vehicle.tunnel.profile);
    println!(
        "\n| four heads in the fastest mode, times real time | profile | a million triangles |\n|---|---|---|"
    );
    for (name, effects) in EFFECTS {
        let [along_profile, along_mesh] = [scene(effects, "", &[]), scene(effects, WALL, &rock)];
        let ran = |scene| {
            let mut simulation = Simulation::new(scene).unwrap();
            timed(|| while simulation.advance() {}).1
        };
        let [profile_s, mesh_s] = best(ROUNDS, [&mut || ran(&along_profile), &mut || ran(&along_mesh)]);
        let duration_s = Simulation::new(&along_profile).unwrap().duration_s();
        println!("| {name} | {:.0} | {:.0} |", duration_s / profile_s, duration_s / mesh_s);
    }
    let (_, seconds) = timed(|| scene("", WALL, &rock));
    println!("\nReading and checking the mesh takes {seconds:.2} s.");
}
