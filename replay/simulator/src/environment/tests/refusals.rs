//! Scenes that are refused. The error must name the place in the scene.

use super::*;

/// Text of the error for a scene in the Ceran tunnel with a length of 100 m.
fn error(text: &str) -> String {
    try_parse(text, &shapes::ceran().unwrap()).err().map_or("accepted".to_owned(), |error| error.to_string())
}

fn refused(text: &str, place: &str, problem: &str) {
    let error = error(text);
    assert!(error.contains(place) && error.contains(problem), "{text}\n{error}");
}

fn feature(keys: &str, place: &str, problem: &str) {
    refused(&format!("[[tunnel.features]]\n{keys}"), place, problem);
}

#[test]
fn too_tight_or_reversing_axes_are_refused() {
    refused(
        "[[tunnel.axis]]\nradius_m = 12\nturn_deg = 30",
        "s.toml:2: tunnel.axis[0].radius_m = 12",
        "at least 12.1",
    );
    refused(
        "[[tunnel.axis]]\nradius_m = 60\nlength_m = 3\nturn_deg = 30",
        "length_m = 3",
        "cannot be combined with radius_m",
    );
    refused("[[tunnel.axis]]\nlength_m = 60\nturn_deg = 30", "turn_deg = 30", "needs radius_m");
    refused("[[tunnel.axis]]\nlength_m = 0", "length_m = 0", "0.01");
    refused("[[tunnel.axis]]\nradius_m = 60", "turn_deg", "missing");
    refused("[[tunnel.axis]]\nradius_m = 60\nturn_deg = 0", "turn_deg = 0", "0.01");
    let twice = "[[tunnel.axis]]\nradius_m = 60\nturn_deg = 100\n".repeat(2);
    refused(&twice, "s.toml:6: tunnel.axis[1].turn_deg = 100", "more than 180");
    refused("[[tunnel.axis]]\nlength_m = 1\nbend = 2", "axis[0].bend", "is not a key here");
    refused("[tunnel]\nlength_m = 1", "tunnel.length_m", "is not a key here");
}

#[test]
fn unordered_or_too_steep_stations_are_refused() {
    let two = |a: &str, b: &str| format!("[[tunnel.stations]]\n{a}\n[[tunnel.stations]]\n{b}");
    refused(
        &two("chainage_m = 5\nscale = 1", "chainage_m = 5\nscale = 1"),
        "stations[1].chainage_m = 5",
        "must be above the previous station's",
    );
    refused(
        &two("chainage_m = 5\nscale = 1", "chainage_m = 6\nscale = 1.2"),
        "s.toml:6: tunnel.stations[1].scale",
        "moves",
    );
    refused("[[tunnel.stations]]\nchainage_m = 105\nscale = 1", "chainage_m = 105", "0 to 100");
    refused("[[tunnel.stations]]\nchainage_m = 5\nscale = 0", "scale = 0", "0.2 to 5");
}

#[test]
fn impossible_features_are_refused() {
    feature("kind = \"rock\"", "features[0].kind = \"rock\"", "boulder");
    feature("chainage_m = 5", "features[0].kind", "missing");
    feature("kind = \"boulder\"\nchainage_m = 101\nsize_m = 1", "chainage_m = 101", "0 to 100");
    feature("kind = \"boulder\"\nchainage_m = 1\nsize_m = 0", "size_m = 0", "must be a diameter");
    feature("kind = \"boulder\"\nchainage_m = 1\nsize_m = [1, 2]", "size_m = [1, 2]", "must be a diameter");
    feature("kind = \"boulder\"\nchainage_m = 1", "size_m", "missing");
    feature("kind = \"boulder\"\nchainage_m = 1\nsize_m = 1\nsunk = 1", "sunk = 1", "0.9");
    feature("kind = \"boulder\"\nchainage_m = 1\nsize_m = 1\nwidth_m = 1", "width_m", "is not a key here");
    feature(
        "kind = \"boulders\"\nfrom_m = 9\nto_m = 5\ncount = 3\nsize_m = [1, 2]",
        "to_m = 5",
        "more than from_m",
    );
    feature(
        "kind = \"boulders\"\nfrom_m = 1\nto_m = 5\ncount = 3\nsize_m = [2, 1]",
        "size_m = [2, 1]",
        "[least, most]",
    );
    feature(
        "kind = \"rock_trap\"\nchainage_m = 1\nlength_m = 4\ndepth_m = 1",
        "length_m = 4",
        "out of the tunnel",
    );
    feature(
        "kind = \"rock_trap\"\nchainage_m = 9\nlength_m = 4\ndepth_m = 1\nwidth_m = 13",
        "width_m = 13",
        "more than the tunnel's width",
    );
    feature(
        "kind = \"gate\"\nchainage_m = 9\nslot_width_m = 1\nslot_depth_m = -1",
        "slot_depth_m = -1",
        "0.01",
    );
    let side = "kind = \"side_tunnel\"\nchainage_m = 9\nside = \"left\"\nwidth_m = 2\nlength_m = 9\n";
    feature(&format!("{side}height_m = 10"), "height_m = 10", "above the crown");
    feature(&format!("{side}height_m = 2\nangle_deg = 70"), "angle_deg = 70", "60");
    feature(&side.replace("left", "up"), "side = \"up\"", "left, right");
}

#[test]
fn impossible_walls_are_refused() {
    let bulge = |depth: f64, width: f64| {
        format!(
            "kind = \"bulge\"\nchainage_m = 9\nlength_m = 8\nwidth_m = {width}\narc_m = 0\ndepth_m = {depth}\n"
        )
    };
    feature(&bulge(2.6, 4.0), "features[0].depth_m = 2.6", "keeps away from");
    feature(&bulge(0.0, 4.0), "depth_m = 0", "must not be 0");
    feature(&bulge(2.0, 1.0), "depth_m = 2", "as long and as wide as it is deep");
    feature(&bulge(1.0, 40.0), "width_m = 40", "35.8");
    let twice = format!("{}[[tunnel.features]]\n{}", bulge(1.3, 4.0), bulge(1.3, 4.0));
    feature(&twice, "features[1].depth_m = 1.3", "moves the wall by 2.600 m");
    let bend = "[[tunnel.axis]]\nradius_m = 13\nturn_deg = 30\n";
    refused(&format!("{bend}[[tunnel.features]]\n{}", bulge(-1.0, 4.0)), "depth_m = -1", "to the side");
    feature(
        "kind = \"fall\"\nchainage_m = 9\nlength_m = 8\nwidth_m = 4\ndepth_m = -1",
        "depth_m = -1",
        "more than 0",
    );
    refused(
        "[tunnel.as_built]\nprofile = \"circle\"\nradius_m = 3\nlength_m = 9",
        "as_built.length_m = 9",
        "isn't allowed here",
    );
    feature(
        "kind = \"debris\"\nchainage_m = 9\nlength_m = 8\nheight_m = 4",
        "height_m = 4",
        "keeps away from",
    );
}

#[test]
#[cfg(not(feature = "mesh"))]
fn meshes_are_refused_without_the_mesh_feature() {
    let place = "s.toml:2: tunnel.features[0].kind = \"mesh\"";
    feature("kind = \"mesh\"\nfile = \"a.ply\"", place, "needs a build with the feature mesh");
}
