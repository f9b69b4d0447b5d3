//! Features compared with an independent model and closed forms, and the index of objects compared with a full search.

use super::oracle::{Oracle, Shape, ellipsoid, upright};
use super::*;

const CERAN: Shape = Shape::Trimmed(6.05, 10.4);

fn feature(kind: &str, keys: &str) -> String {
    format!("[[tunnel.features]]\nkind = \"{kind}\"\n{keys}\n")
}

#[test]
fn boulder_is_an_ellipsoid_sunk_into_the_floor() {
    let text = feature("boulder", "chainage_m = 10\nsize_m = [2, 1, 0.8]\nsunk = 0.25");
    let environment = parse(&text, &CERAN.profile());
    let hit = cast(&environment, [10.0, 0.0, 5.0], [0.0, 0.0, -1.0]).unwrap();
    assert!((hit.range_m - (5.0 - 0.6)).abs() < 1e-12 && hit.what == What::Feature(0), "{hit:?}");
    // The rays are at the height of the boulder's centre, 0.2 m above the floor. One runs along the tunnel, the other
    // comes from the side.
    let hit = cast(&environment, [5.0, 0.0, 0.2], [1.0, 0.0, 0.0]).unwrap();
    assert!((hit.range_m - 4.0).abs() < 1e-12 && (hit.normal.x() + 1.0).abs() < 1e-12, "{hit:?}");
    let hit = cast(&environment, [10.0, 4.0, 0.2], [0.0, -1.0, 0.0]).unwrap();
    assert!((hit.range_m - 3.5).abs() < 1e-12, "{hit:?}");
    assert!(cast(&environment, [10.0, 0.0, 0.3], [0.0, 0.0, 1.0]).is_none(), "begins inside");
    let mut oracle = Oracle::new(CERAN);
    oracle.solids.push(ellipsoid([10.0, 0.0, 0.2], [1.0, 0.5, 0.4]));
    let met = oracle.compare(&environment, 30, 3_000, [8.0, 12.0]);
    assert!(met[0] > 30, "{met:?}");
}

#[test]
fn boulder_on_a_round_wall_is_aligned_with_the_wall() {
    let quarter = 3.0 * math::FRAC_PI_2;
    let text = feature("boulder", &format!("chainage_m = 10\nsize_m = 1\nsunk = 0\narc_m = {quarter}"));
    let environment = parse(&text, &shapes::circle(3.0).unwrap());
    let hit = cast(&environment, [10.0, 0.0, 3.0], [0.0, 1.0, 0.0]).unwrap();
    assert!((hit.range_m - 2.0).abs() < 1e-12 && hit.what == What::Feature(0), "{hit:?}");
}

#[test]
fn rock_trap_is_a_ditch_across_the_floor() {
    let text = feature("rock_trap", "chainage_m = 10\nlength_m = 4\ndepth_m = 1.5");
    let environment = parse(&text, &CERAN.profile());
    let mut oracle = Oracle::new(CERAN);
    let half = widths::flat_floor_m(&CERAN.profile()).unwrap() / 2.0;
    assert!((half - 5.2).abs() < 0.05, "{half}");
    oracle.hollows.push(upright([8.0, -half, -1.5], [12.0, half, 0.0]));
    let met = oracle.compare(&environment, 31, 4_000, [7.0, 13.0]);
    assert!(met[0] > 300, "{met:?}");
    let hit = cast(&environment, [10.0, 1.0, 2.0], [0.0, 0.0, -1.0]).unwrap();
    assert!((hit.range_m - 3.5).abs() < 1e-12 && hit.what == What::Feature(0), "{hit:?}");
}

#[test]
fn side_tunnel_has_the_given_length() {
    let keys = "chainage_m = 10\nside = \"left\"\nwidth_m = 3\nheight_m = 2\nsill_m = 1\nlength_m = 30";
    let environment = parse(&feature("side_tunnel", keys), &shapes::rectangle(8.0, 5.0).unwrap());
    let hit = cast(&environment, [10.0, -1.0, 2.0], [0.0, 1.0, 0.0]).unwrap();
    assert!((hit.range_m - 35.0).abs() < 1e-12 && hit.what == What::Feature(0), "{hit:?}");
    // The rays start inside the side tunnel. The first one hits the opposite wall of the main tunnel, the second one a
    // side wall of the side tunnel.
    let back = cast(&environment, [10.5, 30.0, 2.0], [0.0, -1.0, 0.0]).unwrap();
    assert!((back.range_m - 34.0).abs() < 1e-12 && back.what == What::Wall, "{back:?}");
    let side = cast(&environment, [10.5, 30.0, 2.0], [1.0, 0.0, 0.0]).unwrap();
    assert!((side.range_m - 1.0).abs() < 1e-12 && (side.normal.x() + 1.0).abs() < 1e-12, "{side:?}");
    let mut oracle = Oracle::new(Shape::Rectangle(8.0, 5.0));
    oracle.hollows.push(upright([8.5, 0.0, 1.0], [11.5, 34.0, 3.0]));
    let met = oracle.compare(&environment, 32, 4_000, [7.0, 13.0]);
    assert!(met[0] > 100, "{met:?}");
}

#[test]
fn positive_slant_turns_a_side_tunnel_forwards() {
    let keys = "chainage_m = 10\nside = \"right\"\nwidth_m = 3\nheight_m = 2\nlength_m = 10\nangle_deg = 30";
    let environment = parse(&feature("side_tunnel", keys), &shapes::rectangle(8.0, 5.0).unwrap());
    // The centre line of the side tunnel meets the wall at chainage 10.
    let (sin, cos) = math::sin_cos(math::PI / 6.0);
    let hit = cast(&environment, [10.0 - sin, -4.0 + cos, 1.0], [sin, -cos, 0.0]).unwrap();
    assert!((hit.range_m - 11.0).abs() < 1e-12 && hit.what == What::Feature(0), "{hit:?}");
    let mut oracle = Oracle::new(Shape::Rectangle(8.0, 5.0));
    oracle.hollows.push(Box::new(move |p, _| {
        let (dx, dy) = (p[0] - 10.0, p[1] + 4.0);
        let (along, across) = (dx * sin - dy * cos, dx * cos + dy * sin);
        (-4.0 / cos..=10.0).contains(&along) && across.abs() <= 1.5 && (0.0..=2.0).contains(&p[2])
    }));
    let met = oracle.compare(&environment, 33, 4_000, [6.0, 16.0]);
    assert!(met[0] > 100, "{met:?}");
}

#[test]
fn gate_has_slots_and_a_closed_gate_has_a_bulkhead() {
    let keys = "chainage_m = 10\nslot_width_m = 0.8\nslot_depth_m = 0.4";
    let mut oracle = Oracle::new(Shape::Circle(3.0));
    oracle.hollows.push(Box::new(|p, _| {
        let (y, z) = (p[1], p[2] - 3.0);
        (p[0] - 10.0).abs() <= 0.4 && y * y + z * z < 3.4 * 3.4
    }));
    let open = parse(&feature("gate", keys), &shapes::circle(3.0).unwrap());
    let met = oracle.compare(&open, 34, 3_000, [8.0, 12.0]);
    assert!(met[0] > 100, "{met:?}");
    let closed = parse(&feature("gate", &format!("{keys}\nclosed = true")), &shapes::circle(3.0).unwrap());
    oracle.solids.push(Box::new(|p, _| (p[0] - 10.0).abs() < 0.24));
    let met = oracle.compare(&closed, 35, 3_000, [8.0, 12.0]);
    assert!(met[0] > 500, "{met:?}");
    let ahead = closed.first_obstruction(Point3::new(2.0, 0.0, 3.0), Point3::new(20.0, 0.0, 3.0)).unwrap();
    assert!((ahead.range_m - 7.76).abs() < 1e-12 && ahead.what == What::Feature(0), "{ahead:?}");
    assert!(open.first_obstruction(Point3::new(2.0, 0.0, 3.0), Point3::new(20.0, 0.0, 3.0)).is_none());
    let inside = closed.first_obstruction(Point3::new(10.0, 0.0, 3.0), Point3::new(20.0, 0.0, 3.0)).unwrap();
    assert!(inside.range_m == 0.0 && inside.what == What::Feature(0), "{inside:?}");
}

#[test]
fn rock_fall_leaves_a_cavity_and_a_heap() {
    let keys = "chainage_m = 20\nlength_m = 6\nwidth_m = 5\ndepth_m = 2\npieces = 40\nseed = 7";
    let text = feature("fall", keys)
        + &feature("debris", "chainage_m = 30\nlength_m = 4\nheight_m = 0.7\nname = \"spoil\"");
    let environment = parse(&text, &CERAN.profile());
    let mut oracle = Oracle::new(CERAN);
    let floor = widths::floor_m(&CERAN.profile());
    let crown = CERAN.profile().perimeter_m() / 2.0;
    oracle.bulges = vec![
        [20.0, 6.0, crown, 5.0, -2.0],
        [20.0, 9.0, 0.0, floor, 1.5 * 2.0 * 6.0 * 5.0 / (9.0 * floor)],
        [30.0, 4.0, 0.0, floor, 0.7],
    ];
    assert_eq!(environment.solids.len(), 40);
    for solid in &environment.solids {
        let solid = solid.clone();
        oracle.solids.push(Box::new(move |p, _| in_ellipsoid(&solid.shape, p)));
    }
    let met = oracle.compare(&environment, 36, 4_000, [15.0, 33.0]);
    assert!(met[0] > 300 && met[1] > 100, "{met:?}");
    assert_eq!((environment.feature_name(0), environment.feature_name(1)), ("fall_0", "spoil"));
    assert_eq!(environment.feature_name(2), "");
}

/// Whether a point is in an ellipsoid, by the quadratic form in the ellipsoid's frame.
fn in_ellipsoid(solid: &Solid, p: V3) -> bool {
    let Solid::Ellipsoid(frame, half) = solid else { panic!("a box") };
    let mut sum = 0.0;
    for (axis, half) in frame.axes.iter().zip(half) {
        let c: f64 = (0..3).map(|k| (p[k] - frame.origin[k]) * axis[k]).sum();
        sum += c * c / (half * half);
    }
    sum < 1.0
}

#[test]
fn all_features_in_a_bend_match_the_model() {
    let shape = Shape::Rectangle(6.0, 5.0);
    let text = "[[tunnel.axis]]\nlength_m = 10\n[[tunnel.axis]]\nradius_m = 14\nturn_deg = 70\n".to_owned()
        + &feature(
            "side_tunnel",
            "chainage_m = 14\nside = \"left\"\nwidth_m = 2\nheight_m = 2\nlength_m = 40",
        )
        + &feature("rock_trap", "chainage_m = 19\nlength_m = 2\ndepth_m = 1\nwidth_m = 4")
        + &feature("gate", "chainage_m = 23\nslot_width_m = 0.6\nslot_depth_m = 0.3")
        + &feature("boulders", "from_m = 10\nto_m = 27\ncount = 60\nsize_m = [0.2, 1.5]\nseed = 3")
        + &feature("bulge", "chainage_m = 17\nlength_m = 3\narc_m = 6\nwidth_m = 3\ndepth_m = 0.8");
    let environment = parse(&text, &shape.profile());
    let mut oracle = Oracle::new(shape);
    oracle.axis = vec![(10.0, 0.0), (14.0 * 70.0_f64.to_radians(), 1.0 / 14.0)];
    oracle.bulges = vec![[17.0, 3.0, 6.0, 3.0, 0.8]];
    for (chainage, least, most) in [
        (14.0, [-1.0, 0.0, 0.0], [1.0, 43.0, 2.0]),
        (19.0, [-1.0, -2.0, -1.0], [1.0, 2.0, 0.0]),
        (23.0, [-0.3, -3.3, -0.25], [0.3, 3.3, 5.25]),
    ] {
        let (at, heading) = oracle.station(chainage);
        let (sin, cos) = math::sin_cos(heading);
        oracle.hollows.push(Box::new(move |p, _| {
            let (dx, dy) = (p[0] - at[0], p[1] - at[1]);
            let local = [dx * cos + dy * sin, dy * cos - dx * sin, p[2]];
            (0..3).all(|k| (least[k]..=most[k]).contains(&local[k]))
        }));
    }
    for solid in &environment.solids {
        let solid = solid.clone();
        oracle.solids.push(Box::new(move |p, _| in_ellipsoid(&solid.shape, p)));
    }
    let met = oracle.compare(&environment, 37, 5_000, [8.0, 30.0]);
    assert!(met.iter().all(|count| *count > 30), "{met:?}");
}

#[test]
fn index_finds_the_same_hits_as_a_full_search() {
    let text = feature("boulders", "from_m = 0\nto_m = 100\ncount = 10000\nsize_m = [0.02, 0.6]\nseed = 11");
    let environment = parse(&text, &CERAN.profile());
    assert_eq!(environment.solids.len(), 10_000);
    let mut lcg = Lcg(38);
    let mut met = 0;
    for _ in 0..3_000 {
        let origin = [lcg.between(-5.0, 105.0), lcg.between(-3.0, 3.0), lcg.between(0.5, 6.0)];
        let ray = Ray { origin, direction: lcg.direction() };
        let wall = CERAN.profile().cast([origin[1], origin[2]], [ray.direction[1], ray.direction[2]]);
        let inside = environment.solids.iter().any(|solid| solid.shape.contains(origin));
        let all = environment.solids.iter().filter_map(|solid| solid.shape.meet(&ray));
        let wanted = all
            .map(|(t, _)| t)
            .chain(wall.map(|hit| hit.range_m))
            .filter(|t| *t <= 200.0)
            .fold(f64::INFINITY, f64::min);
        let hit = cast(&environment, ray.origin, ray.direction);
        let found = hit.map_or(f64::INFINITY, |hit| hit.range_m);
        assert_eq!(found.to_bits(), if inside { f64::INFINITY } else { wanted }.to_bits(), "{ray:?}");
        met += usize::from(hit.is_some_and(|hit| hit.what == What::Feature(0)));
    }
    assert!(met > 200, "{met}");
}

#[test]
fn scattered_boulders_are_reproducible_and_within_their_limits() {
    let text = |seed: u64| {
        feature(
            "boulders",
            &format!("from_m = 20\nto_m = 30\ncount = 500\nsize_m = [0.1, 1.6]\nseed = {seed}"),
        )
    };
    let sizes = |seed: u64| -> Vec<V3> {
        let environment = parse(&text(seed), &CERAN.profile());
        let ellipsoid = |placed: &Placed<Solid>| match placed.shape {
            Solid::Ellipsoid(frame, half) if (20.0..30.0).contains(&frame.origin[0]) => half,
            _ => panic!("out of place"),
        };
        environment.solids.iter().map(ellipsoid).collect()
    };
    assert_eq!(sizes(1), sizes(1));
    assert_ne!(sizes(1), sizes(2));
    let octave = |least: f64| sizes(1).iter().filter(|half| (least..2.0 * least).contains(&half[0])).count();
    for least in [0.05, 0.1, 0.2, 0.4] {
        assert!((90..160).contains(&octave(least)), "{least}: {}", octave(least));
    }
}
