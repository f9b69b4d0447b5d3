//! The wall: as designed, scaled, displaced, in bends, and all of these together.

use super::oracle::{Oracle, Shape};
use super::*;

const CERAN: Shape = Shape::Trimmed(6.05, 10.4);

#[test]
fn ranges_in_a_plain_tunnel_equal_those_of_its_profile_bit_for_bit() {
    let profile = shapes::ceran().unwrap();
    let far_feature = "[tunnel]\n[[tunnel.features]]\nkind = \"boulder\"\nchainage_m = 90\nsize_m = 1";
    let bare = Environment::straight(profile.clone());
    let empty = parse("[tunnel]", &profile);
    let featured = parse(far_feature, &profile);
    let mut lcg = Lcg(1);
    for _ in 0..20_000 {
        let origin = [lcg.between(0.0, 50.0), lcg.between(-7.0, 7.0), lcg.between(-1.0, 9.0)];
        let d = lcg.direction();
        let wanted = profile.cast([origin[1], origin[2]], [d[1], d[2]]).map(|hit| hit.range_m);
        let wanted = wanted.filter(|range| *range <= 30.0).map(f64::to_bits);
        for environment in [&bare, &empty, &featured] {
            let range = environment.range_m(to_point(origin), to_vec(d), 30.0);
            assert_eq!(range.map(f64::to_bits), wanted, "{origin:?} {d:?}");
            let hit = environment.cast(to_point(origin), to_vec(d), 30.0);
            assert_eq!(hit.map(|hit| hit.range_m.to_bits()), wanted);
        }
    }
    assert!(bare.range_m(Point3::new(0.0, 0.0, 3.0), Vec3::new(1.0, 0.0, 0.0), 1e9).is_none());
}

#[test]
fn as_built_profile_may_differ_from_the_design() {
    let text = "[tunnel.as_built]\nprofile = \"circle\"\nradius_m = 4";
    let environment = parse(text, &shapes::ceran().unwrap());
    Oracle::new(Shape::Circle(4.0)).compare(&environment, 2, 1_000, [0.0, 50.0]);
    let mut oracle = Oracle::new(Shape::Circle(4.0));
    oracle.stations = vec![(10.0, 0.5), (20.0, 1.0), (40.0, 1.5)];
    let stations = "\n[[tunnel.stations]]\nchainage_m = 10\nscale = 0.5\n[[tunnel.stations]]\nchainage_m = 20\n\
                    scale = 1\n[[tunnel.stations]]\nchainage_m = 40\nscale = 1.5";
    let environment = parse(&format!("{text}{stations}"), &shapes::ceran().unwrap());
    oracle.compare(&environment, 3, 3_000, [0.0, 50.0]);
}

#[test]
fn wall_is_scaled_between_stations_as_configured() {
    for (seed, shape) in [(4, CERAN), (5, Shape::Rectangle(9.0, 4.0))] {
        let mut oracle = Oracle::new(shape);
        oracle.stations = vec![(10.0, 1.0), (18.0, 0.6), (25.0, 0.6), (33.0, 1.2)];
        let table = |(chainage, scale): &(f64, f64)| {
            format!("[[tunnel.stations]]\nchainage_m = {chainage}\nscale = {scale}\n")
        };
        let text: String = oracle.stations.iter().map(table).collect();
        oracle.compare(&parse(&text, &shape.profile()), seed, 3_000, [2.0, 45.0]);
    }
}

fn bulge(b: &[f64; 5]) -> String {
    format!(
        "[[tunnel.features]]\nkind = \"bulge\"\nchainage_m = {}\nlength_m = {}\narc_m = {}\nwidth_m = {}\ndepth_m = {}\n",
        b[0], b[1], b[2], b[3], b[4]
    )
}

#[test]
fn bulges_displace_the_wall() {
    for (seed, shape) in [(6, CERAN), (7, Shape::Rectangle(9.0, 4.0)), (8, Shape::Circle(3.0))] {
        let mut oracle = Oracle::new(shape);
        // The bulges point inwards or outwards, lie across the floor's centre, where the arc length jumps from p to 0,
        // overlap each other, or are thin.
        oracle.bulges = vec![
            [10.0, 4.0, 9.0, 3.0, 1.0],
            [13.0, 6.0, 11.0, 6.0, -2.0],
            [17.0, 8.0, 0.5, 4.0, 1.2],
            [20.0, 0.2, 0.0, 0.3, 0.15],
            [20.0, 2.0, 8.0, 18.0, -0.5],
        ];
        let text: String = oracle.bulges.iter().map(bulge).collect();
        let met = oracle.compare(&parse(&text, &shape.profile()), seed, 4_000, [6.0, 24.0]);
        assert!(met[0] > 20 && met[1] > 20 && met[2] > 20 && met[4] > 20, "{met:?}");
    }
}

#[test]
fn rays_do_not_skip_a_thin_bulge() {
    let environment = parse(&bulge(&[10.0, 0.02, 0.0, 0.02, 0.02]), &shapes::ceran().unwrap());
    let centre = environment.design.reference();
    let hit = cast(&environment, [10.0, centre[0], centre[1]], [0.0, 0.0, -1.0]).unwrap();
    assert!((hit.range_m - (centre[1] - 0.02)).abs() < 1e-9 && hit.what == What::Feature(0), "{hit:?}");
    // The rays run along the floor, through the middle of the bulge, and over its top.
    let low = cast(&environment, [5.0, 0.0, 0.01], [1.0, 0.0, 0.0]).unwrap();
    assert!((low.range_m - 4.995).abs() < 1e-9 && low.what == What::Feature(0), "{low:?}");
    assert!(cast(&environment, [5.0, 0.0, 0.0201], [1.0, 0.0, 0.0]).is_none());
}

const BENDS: [(f64, f64); 5] =
    [(8.0, 0.0), (12.0, -1.0 / 15.0), (5.0, 0.0), (20.0, 1.0 / 13.0), (6.0, -1.0 / 30.0)];

fn bends() -> String {
    let table = |(length, curvature): &(f64, f64)| {
        if *curvature == 0.0 {
            return format!("[[tunnel.axis]]\nlength_m = {length}\n");
        }
        let turn = (length * curvature).to_degrees();
        format!("[[tunnel.axis]]\nradius_m = {:?}\nturn_deg = {turn:?}\n", 1.0 / curvature.abs())
    };
    BENDS.iter().map(table).collect()
}

#[test]
fn wall_follows_the_bends() {
    for (seed, shape) in [(9, CERAN), (10, Shape::Rectangle(9.0, 4.0)), (11, Shape::Circle(3.0))] {
        let mut oracle = Oracle::new(shape);
        oracle.axis = BENDS.to_vec();
        oracle.compare(&parse(&bends(), &shape.profile()), seed, 3_000, [-5.0, 60.0]);
    }
}

#[test]
fn combined_bends_stations_and_bulges_match_the_model() {
    let shape = Shape::Trimmed(5.0, 8.0);
    let mut oracle = Oracle::new(shape);
    oracle.axis = BENDS.to_vec();
    oracle.stations = vec![(5.0, 1.0), (15.0, 0.8), (40.0, 1.1)];
    oracle.bulges =
        vec![[12.0, 5.0, 15.0, 5.0, 1.0], [30.0, 8.0, 10.0, 6.0, -0.9], [31.0, 3.0, 9.0, 3.0, 1.0]];
    let stations =
        oracle.stations.iter().map(|(c, s)| format!("[[tunnel.stations]]\nchainage_m = {c}\nscale = {s}\n"));
    let text: String = stations.chain([bends()]).chain(oracle.bulges.iter().map(bulge)).collect();
    let met = oracle.compare(&parse(&text, &shape.profile()), 12, 4_000, [0.0, 50.0]);
    assert!(met.iter().all(|count| *count > 5), "{met:?}");
}

#[test]
fn arc_length_is_measured_on_the_design_profile_in_bends_too() {
    let design = shapes::ceran().unwrap();
    let environment =
        parse(&format!("{}[tunnel.as_built]\nprofile = \"circle\"\nradius_m = 4", bends()), &design);
    for (chainage, y, z) in [(3.0, 1.0, 0.5), (17.0, -2.0, 6.0), (40.0, 2.0, 5.0)] {
        let place = environment.axis().place(chainage, [y, z]);
        assert!((environment.arc_m(place) - design.arc_of([y, z])).abs() < 1e-9);
    }
}

#[test]
fn rough_wall_is_the_same_from_all_viewpoints() {
    let profile = shapes::ceran().unwrap();
    let smooth = Environment::straight(profile.clone());
    let rough = parse("[tunnel]\n[[tunnel.rough]]\nfrom_m = 10\nto_m = 20\nsd_m = 0.03", &profile);
    let height_m = |from: V3, direction: V3| {
        let [bare, bumpy] = [&smooth, &rough].map(|tunnel| cast(tunnel, from, direction).unwrap());
        assert_eq!(bare.point, bumpy.point);
        (bumpy.range_m - bare.range_m) * -to_vec(direction).dot(&bare.normal)
    };
    let mut most_m = 0.0_f64;
    for k in 0..200 {
        let x_m = 10.0 + 0.05 * f64::from(k);
        let [near, far] = [0.0, 3.0].map(|y_m| height_m([x_m, y_m, 3.0], [0.0, 1.0, 0.0]));
        assert!((near - far).abs() < 1e-9, "{x_m} m: {near} and {far}");
        most_m = most_m.max(near.abs());
        assert_eq!(height_m([x_m - 10.0, 0.0, 3.0], [0.0, 1.0, 0.0]).to_bits(), 0.0_f64.to_bits());
    }
    assert!((0.04..0.15).contains(&most_m), "{most_m}");
}

#[test]
fn overlapping_or_flat_rough_stretches_are_refused() {
    let profile = shapes::ceran().unwrap();
    let twice =
        "[tunnel]\n[[tunnel.rough]]\nsd_m = 0.03\nto_m = 9\n[[tunnel.rough]]\nsd_m = 0.01\nfrom_m = 8";
    for (text, words) in [(twice, "earlier rough stretch"), ("[tunnel]\n[[tunnel.rough]]\nto_m = 9", "sd_m")]
    {
        let error = try_parse(text, &profile).err().map(|error| error.to_string()).unwrap_or_default();
        assert!(error.contains(words), "{error}");
    }
}
