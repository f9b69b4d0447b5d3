//! Meshes as walls and bodies, compared with the profile, with closed forms and with one another.

use std::fmt::Write as _;

use super::*;

const RADIUS_M: f64 = 3.0;
const SIDES: u32 = 240;
/// Largest distance between a side of the polygon that stands for a circle and the polygon's circumscribed circle, per
/// metre of radius.
const SAGITTA: f64 = 8.6e-5;

fn circle() -> Profile {
    shapes::circle(RADIUS_M).unwrap()
}

/// A tube-shaped prism about the x-axis, as PLY text. It extends from x = 0 to `length_m` in `rings`, and lacks the
/// faces whose numbers are in `without`.
fn tube(radius_m: f64, length_m: f64, rings: u32, without: &[u32]) -> String {
    let (mut vertices, mut faces, mut count) = (String::new(), String::new(), 0);
    for ring in 0..=rings {
        for side in 0..SIDES {
            let (sin, cos) = math::sin_cos(math::TAU * f64::from(side) / f64::from(SIDES));
            let x_m = length_m * f64::from(ring) / f64::from(rings);
            writeln!(vertices, "{x_m:?} {:?} {:?}", radius_m * cos, RADIUS_M + radius_m * sin).unwrap();
            if ring < rings && !without.contains(&(ring * SIDES + side)) {
                let [a, b] = [side, (side + 1) % SIDES].map(|corner| ring * SIDES + corner);
                writeln!(faces, "4 {a} {b} {} {}", b + SIDES, a + SIDES).unwrap();
                count += 1;
            }
        }
    }
    format!(
        "ply\nformat ascii 1.0\nelement vertex {}\nproperty double x\nproperty double y\nproperty double z\n\
         element face {count}\nproperty list uchar int vertex_indices\nend_header\n{vertices}{faces}",
        (rings + 1) * SIDES
    )
}

/// A box from -`half` to `half` on each axis, as PLY text.
fn cuboid(half: V3) -> String {
    let mut text = String::from(
        "ply\nformat ascii 1.0\nelement vertex 8\nproperty double x\nproperty double y\nproperty double z\n\
         element face 6\nproperty list uchar int vertex_indices\nend_header\n",
    );
    for corner in 0..8 {
        let [x, y, z] = [0, 1, 2].map(|k| if corner >> k & 1 == 1 { half[k] } else { -half[k] });
        writeln!(text, "{x} {y} {z}").unwrap();
    }
    text + "4 0 2 6 4\n4 1 3 7 5\n4 0 1 5 4\n4 2 3 7 6\n4 0 1 3 2\n4 4 5 7 6\n"
}

fn table(keys: &str) -> String {
    format!("[[tunnel.features]]\nkind = \"mesh\"\n{keys}\n")
}

fn with(text: &str, files: &[(&str, &str)]) -> Result<Environment, String> {
    let load = |name: &str| {
        let file = files.iter().find(|(file, _)| *file == name);
        file.map(|(_, content)| content.as_bytes().to_vec()).ok_or_else(|| "can't be read".to_owned())
    };
    try_parse_with(text, &circle(), &load).map_err(|error| error.to_string())
}

fn wall(file: &str) -> Environment {
    with(&table("file = \"t.ply\"\nrole = \"wall\"\nchainage_m = 40"), &[("t.ply", file)]).unwrap()
}

/// Casts a ray like [`super::cast`], without a distance limit.
fn cast(environment: &Environment, origin: V3, direction: V3) -> Option<Hit> {
    environment.cast(to_point(origin), to_vec(direction), FARTHEST_M)
}

/// Range from a point inside the tunnel to the circle with radius `radius_m` about the tunnel's axis.
fn to_circle(radius_m: f64, origin: V3, direction: V3) -> f64 {
    let [_, dy, dz] = direction;
    let (y, z) = (origin[1], origin[2] - RADIUS_M);
    let (a, b, c) = (dy * dy + dz * dz, y * dy + z * dz, y * y + z * z - radius_m * radius_m);
    (-b + math::sqrt(b * b - a * c)) / a
}

/// Cosine of the ray's incidence on the surface it hits.
fn facing(hit: &Hit, direction: V3) -> f64 {
    -vector::dot([hit.normal.x(), hit.normal.y(), hit.normal.z()], direction)
}

fn place_in(lcg: &mut Lcg, radius_m: f64, x_m: [f64; 2]) -> V3 {
    let (sin, cos) = math::sin_cos(lcg.between(0.0, math::TAU));
    let off_m = radius_m * math::sqrt(lcg.between(0.0, 1.0));
    [lcg.between(x_m[0], x_m[1]), off_m * cos, RADIUS_M + off_m * sin]
}

#[test]
fn mesh_of_the_profile_gives_the_ranges_of_the_profile() {
    let environment = wall(&tube(RADIUS_M, 10.0, 3, &[]));
    let within_m = RADIUS_M * (1.0 - SAGITTA);
    let mut lcg = Lcg(60);
    let (mut into, mut out, mut through) = (0, 0, 0);
    for _ in 0..20_000 {
        let origin = place_in(&mut lcg, within_m, [35.0, 55.0]);
        let mut direction = lcg.direction();
        // About every third ray is nearly along the tunnel.
        if lcg.between(0.0, 3.0) < 1.0 {
            let (y, z) = (lcg.between(-0.3, 0.3), lcg.between(-0.3, 0.3));
            direction = [math::sqrt(1.0 - y * y - z * z) * direction[0].signum(), y, z];
        }
        let hit = cast(&environment, origin, direction).unwrap();
        let (least_m, most_m) =
            (to_circle(within_m, origin, direction), to_circle(RADIUS_M, origin, direction));
        let given = (origin, direction, hit);
        assert!((least_m - 1e-9..=most_m + 1e-9).contains(&hit.range_m), "{least_m} {most_m} {given:?}");
        assert_eq!(
            environment.range_m(to_point(origin), to_vec(direction), FARTHEST_M),
            Some(hit.range_m),
            "{given:?}"
        );
        let is_mesh = |x_m: f64| (40.0..=50.0).contains(&x_m);
        let x_m = hit.point.x();
        assert_eq!(hit.what == What::Feature(0), is_mesh(x_m), "{given:?}");
        assert!(facing(&hit, direction) > 0.0, "{given:?}");
        into += usize::from(!is_mesh(origin[0]) && is_mesh(x_m));
        out += usize::from(is_mesh(origin[0]) && !is_mesh(x_m));
        through += usize::from(origin[0] < 40.0 && x_m > 50.0 || origin[0] > 50.0 && x_m < 40.0);
    }
    assert!(into > 1_000 && out > 1_000 && through > 300, "{into} {out} {through}");
    let far = environment.cast(to_point([45.0, 0.0, 3.0]), to_vec([0.0, 1.0, 0.0]), 2.9);
    assert!(far.is_none());
    // A ray along the axis meets no wall. The second ray starts outside the tunnel, where there is no water.
    assert!(cast(&environment, [20.0, 0.1, 3.0], [1.0, 0.0, 0.0]).is_none());
    assert!(cast(&environment, [45.0, 3.1, 3.0], [0.0, 1.0, 0.0]).is_none());
}

#[test]
fn no_ray_escapes_between_mismatched_mesh_and_profile() {
    for (radius_m, seed) in [(4.0, 61), (2.0, 62)] {
        let environment = wall(&tube(radius_m, 10.0, 2, &[]));
        // Points between the polygon's inscribed and circumscribed circles may be inside or outside the mesh.
        let is_within = |p: V3, share: f64| {
            let radius_m = if (40.0..=50.0).contains(&p[0]) { radius_m * share } else { RADIUS_M };
            math::hypot(p[1], p[2] - RADIUS_M) < radius_m
        };
        let (is_water, may_be) = (|p| is_within(p, 1.0 - SAGITTA), |p| is_within(p, 1.0));
        let mut lcg = Lcg(seed);
        let mut ends = 0;
        for _ in 0..12_000 {
            let ray = Ray { origin: place_in(&mut lcg, 4.2, [36.0, 54.0]), direction: lcg.direction() };
            let hit = cast(&environment, ray.origin, ray.direction);
            assert_eq!(environment.is_water(to_point(ray.origin)), hit.is_some(), "{ray:?}");
            let Some(hit) = hit else {
                assert!(!is_water(ray.origin), "{ray:?} left the tunnel");
                continue;
            };
            let places = (0..100).map(|k| ray.at(hit.range_m * f64::from(k) / 100.0));
            assert!(places.clone().all(may_be), "{ray:?} {hit:?}");
            let is_end = hit.normal.x().abs() > 0.999;
            let beyond_m = if is_end { 1e-6 } else { 3.0 * radius_m * SAGITTA / facing(&hit, ray.direction) };
            assert!(!is_water(ray.at(hit.range_m + beyond_m)), "{ray:?} {hit:?}");
            if is_end {
                let at_m = hit.point.x();
                assert!((at_m - 40.0).abs() < 1e-9 || (at_m - 50.0).abs() < 1e-9, "{hit:?}");
                assert_eq!(hit.what, What::Feature(0));
                assert!(facing(&hit, ray.direction) > 0.0);
                ends += 1;
            }
        }
        assert!(ends > 100, "{ends}");
    }
}

#[test]
fn mesh_with_ragged_ends_is_a_wall_only_where_closed() {
    // Some faces of the first and the last ring are missing, so the mesh is closed only from x = 0.25 m to 9.75 m.
    let ragged = tube(4.0, 10.0, 40, &[0, 1, 2, 50, 51, 39 * SIDES + 7]);
    let environment = wall(&ragged.replace("\n0.0 ", "\n-0.0 "));
    let placed =
        with(&table("file = \"t.ply\"\nrole = \"wall\"\nchainage_m = 39.75"), &[("t.ply", &ragged)]).unwrap();
    for x_m in [40.1, 49.9] {
        let at = to_point([x_m, 3.5, RADIUS_M]);
        assert!(!environment.is_water(at));
        assert_eq!(placed.is_water(at), x_m < 41.0);
    }
    let mut lcg = Lcg(63);
    for _ in 0..5_000 {
        let origin = place_in(&mut lcg, 2.9, [39.0, 51.0]);
        assert!(cast(&environment, origin, lcg.direction()).is_some(), "{origin:?}");
    }
}

#[test]
fn mesh_wall_follows_the_axis_behind_a_bend() {
    let bend = "[[tunnel.axis]]\nlength_m = 5\n[[tunnel.axis]]\nradius_m = 20\nturn_deg = 40\n";
    let keys = "file = \"t.ply\"\nrole = \"wall\"\nchainage_m = 20";
    let file = tube(RADIUS_M, 10.0, 1, &[]);
    let meshed = with(&format!("{bend}{}", table(keys)), &[("t.ply", &file)]).unwrap();
    let bare = parse(bend, &circle());
    let mut lcg = Lcg(64);
    let mut met = 0;
    for _ in 0..4_000 {
        let [chainage_m, y, z] = place_in(&mut lcg, 2.9, [8.0, 35.0]);
        let origin = bare.axis().place(chainage_m, [y, z]);
        let direction = lcg.direction();
        let wanted = bare.cast(origin, to_vec(direction), FARTHEST_M).unwrap();
        let hit = meshed.cast(origin, to_vec(direction), FARTHEST_M).unwrap();
        let slack_m = 3.0 * RADIUS_M * SAGITTA / facing(&wanted, direction) + 1e-7;
        if slack_m < 0.01 {
            assert!((hit.range_m - wanted.range_m).abs() <= slack_m, "{wanted:?} {hit:?}");
        }
        met += usize::from(hit.what == What::Feature(0));
    }
    assert!(met > 500, "{met}");
    let error = with(&format!("{bend}{}", table(&keys.replace("20", "12"))), &[("t.ply", &file)]);
    assert!(error.unwrap_err().contains("meets a bend"));
}

#[test]
fn box_of_triangles_equals_a_solid_block() {
    let half = [0.5, 0.4, 0.3];
    let file = cuboid(half);
    let keys = "file = \"box.ply\"\nname = \"car\"\nchainage_m = 20\nacross_m = [0.5, 1.5]\n";
    let straight = with(&table(keys), &[("box.ply", &file)]).unwrap();
    let hit = cast(&straight, [17.0, 0.4, 1.4], [1.0, 0.0, 0.0]).unwrap();
    assert!((hit.range_m - 2.5).abs() < 1e-12 && (hit.normal.x() + 1.0).abs() < 1e-12, "{hit:?}");
    assert_eq!((hit.what, straight.feature_name(0)), (What::Feature(0), "car"));
    // A ray from inside a body hits nothing.
    assert!(cast(&straight, [20.1, 0.5, 1.5], [1.0, 0.0, 0.0]).is_none());
    assert!(!straight.is_water(to_point([20.4, 0.5, 1.5])));
    assert!(straight.is_water(to_point([20.6, 0.5, 1.5])));

    let environment = with(&table(&format!("{keys}yaw_deg = 30")), &[("box.ply", &file)]).unwrap();
    let (sin, cos) = math::sin_cos(30.0_f64.to_radians());
    let axes = [[cos, sin, 0.0], [-sin, cos, 0.0], [0.0, 0.0, 1.0]];
    let block = Solid::Block(vector::Frame { origin: [20.0, 0.5, 1.5], axes }, half);
    let bare = Environment::straight(circle());
    let mut lcg = Lcg(65);
    let mut met = 0;
    for _ in 0..20_000 {
        let ray = Ray { origin: place_in(&mut lcg, 2.9, [18.0, 22.0]), direction: lcg.direction() };
        let hit = cast(&environment, ray.origin, ray.direction);
        assert_eq!(hit.is_none(), block.contains(ray.origin), "{ray:?}");
        let Some(hit) = hit else { continue };
        let wall_m = cast(&bare, ray.origin, ray.direction).map_or(f64::INFINITY, |hit| hit.range_m);
        let wanted_m = block.meet(&ray).map_or(wall_m, |(t_m, _)| t_m.min(wall_m));
        // The two methods may differ only for a ray that runs along a side of the box.
        assert!((hit.range_m - wanted_m).abs() < 1e-9, "{ray:?} {hit:?} {wanted_m}");
        met += usize::from(hit.what == What::Feature(0));
    }
    assert!(met > 300, "{met}");
}

#[test]
fn mesh_body_obstructs_rays_and_trajectories() {
    let keys = "file = \"box.ply\"\nchainage_m = 20\nacross_m = [0, 3]";
    let environment = with(&table(keys), &[("box.ply", &cuboid([0.5; 3]))]).unwrap();
    let way = |from: V3, to: V3| environment.first_obstruction(to_point(from), to_point(to));
    let hit = way([15.0, 0.0, 3.0], [25.0, 0.1, 3.1]).unwrap();
    assert_eq!(hit.what, What::Feature(0));
    assert!((hit.point.x() - 19.5).abs() < 1e-9, "{hit:?}");
    let hit = way([20.0, 0.1, 3.0], [25.0, 0.0, 3.0]).unwrap();
    assert_eq!((hit.what, hit.range_m.to_bits()), (What::Feature(0), 0.0_f64.to_bits()));
    assert!(way([15.0, 0.0, 3.0], [19.0, 0.0, 3.0]).is_none());
    assert!(way([15.0, 1.0, 3.0], [25.0, 1.0, 3.0]).is_none());
    assert_eq!(environment.feature_name(0), "mesh_0");
}

#[track_caller]
fn refused(text: &str, files: &[(&str, &str)], words: &[&str]) {
    let error = with(text, files).err().unwrap_or_else(|| "accepted".to_owned());
    assert!(words.iter().all(|word| error.contains(word)), "{words:?}\n{error}");
}

#[test]
fn error_for_an_invalid_mesh_names_scene_line_and_place() {
    let good = cuboid([0.5; 3]);
    let keys = table("chainage_m = 20\nfile = \"box.ply\"");
    let place = "s.toml:4: tunnel.features[0].file = \"box.ply\": ";
    let open = good.replace("face 6", "face 5").replace("4 4 5 7 6\n", "");
    refused(&keys, &[("box.ply", &open)], &[place, "1 hole(s)", "4 edges", "0.500)"]);
    refused(&keys, &[("box.ply", &good.replace("4 0 2 6 4", "4 0 2 8 4"))], &[place, "refers to vertex 8"]);
    refused(&keys, &[], &[place, "can't be read"]);
    let ply = tube(3.0, 10.0, 1, &[]);
    let cut = ply.get(..ply.len() / 2).unwrap();
    let wall = table("file = \"t.ply\"\nrole = \"wall\"\nchainage_m = 40");
    let place = "s.toml:3: tunnel.features[0].file = \"t.ply\": ";
    refused(&wall, &[("t.ply", cut)], &[place, "reading PLY: Line ", "but found nothing"]);
    let hole = tube(3.0, 10.0, 5, &[2 * SIDES]);
    refused(&wall, &[("t.ply", &hole)], &[place, "1 hole(s)", "(4.000, 3.000, 3.000)"]);
    let closed = "file = \"box.ply\"\nrole = \"wall\"\nchainage_m = 40";
    refused(&table(closed), &[("box.ply", &good)], &["closed at its end at x = -0.500 m"]);
    refused(&table("file = \"box.dae\""), &[], &["file = \"box.dae\"", "must end in .ply"]);
    refused(&table("chainage_m = 3"), &[], &["features[0].file", "is missing"]);
    refused(&table("file = \"box.ply\"\nrole = \"floor\""), &[], &["role = \"floor\"", "body, wall"]);
    refused(&format!("{keys}scale = 2"), &[("box.ply", &good)], &["features[0].scale", "is not a key here"]);
    refused(&table("file = \"box.ply\"\nacross_m = [1]"), &[], &["across_m = [1]", "[left, up]"]);
}

#[test]
fn meshes_in_impossible_positions_are_refused() {
    let body = cuboid([0.5; 3]);
    let tube = tube(3.0, 10.0, 1, &[]);
    let files = [("box.ply", body.as_str()), ("t.ply", tube.as_str())];
    let wall = |rest: &str| table(&format!("file = \"t.ply\"\nrole = \"wall\"\n{rest}"));
    refused(
        &table("file = \"box.ply\""),
        &files,
        &["file = ", "from -0.500 to 0.500 m", "out of the tunnel"],
    );
    refused(&table("file = \"box.ply\"\nchainage_m = 99.6"), &files, &["chainage_m = 99.6", "100 m"]);
    refused(&wall("chainage_m = 101"), &files, &["chainage_m = 101", "is outside the tunnel"]);
    refused(&wall("yaw_deg = 3"), &files, &["yaw_deg = 3", "to a body only"]);
    let station =
        |at_m: u32, scale: f64| format!("[[tunnel.stations]]\nchainage_m = {at_m}\nscale = {scale}\n");
    let text = station(45, 1.0) + &wall("chainage_m = 40");
    refused(&text, &files, &["chainage_m = 40", "the station at 45 m"]);
    let text = station(20, 1.0) + &station(80, 1.2) + &wall("chainage_m = 40");
    refused(&text, &files, &["chainage_m = 40", "between stations of different scale"]);
    let bulge =
        "[[tunnel.features]]\nkind = \"bulge\"\nchainage_m = 51\nlength_m = 4\nwidth_m = 3\ndepth_m = 1\n";
    let text = wall("chainage_m = 40") + bulge;
    refused(&text, &files, &["features[0].chainage_m = 40", "from 40.000 to 50.000 m", "features[1]"]);
    assert!(with(&(wall("chainage_m = 40") + &bulge.replace("51", "52")), &files).is_ok());
    let gate =
        "[[tunnel.features]]\nkind = \"gate\"\nchainage_m = 45\nslot_width_m = 1\nslot_depth_m = 0.3\n";
    let text = wall("chainage_m = 40") + gate;
    refused(
        &text,
        &files,
        &["features[1].chainage_m = 45", "44.500 to 45.500", "the mesh of tunnel.features[0]"],
    );
    let text = wall("chainage_m = 40") + &wall("chainage_m = 49.9");
    refused(&text, &files, &["features[1].chainage_m = 49.9", "overlaps the mesh of tunnel.features[0]"]);
    assert!(with(&(wall("chainage_m = 40") + &wall("chainage_m = 50")), &files).is_ok());
    let bend = "[[tunnel.axis]]\nlength_m = 60\n[[tunnel.axis]]\nradius_m = 10\nturn_deg = 40\n";
    let text = bend.to_owned() + &wall("chainage_m = 40\nacross_m = [8, 0]");
    refused(&text, &files, &["chainage_m = 40", "11.000 m to the side", "10.000 m"]);
}
