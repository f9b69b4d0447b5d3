//! The tunnel's axis: points, headings and the conversion from points to chainage.

use super::*;

const TEXT: &str = "[[tunnel.axis]]\nlength_m = 20\n[[tunnel.axis]]\nradius_m = 15\nturn_deg = -80\n\
                    [[tunnel.axis]]\nradius_m = 20\nturn_deg = 170\n[[tunnel.axis]]\nlength_m = 5\n\
                    [[tunnel.axis]]\nradius_m = 1000\nturn_deg = -0.5\n";

fn axis() -> Axis {
    parse(TEXT, &shapes::ceran().unwrap()).axis().clone()
}

#[test]
fn conversions_between_chainage_and_tunnel_frame_are_inverse() {
    let axis = axis();
    let mut lcg = Lcg(20);
    for _ in 0..20_000 {
        let wanted = [lcg.between(-50.0, 200.0), lcg.between(-6.0, 6.0), lcg.between(0.0, 9.0)];
        let found = axis.chart(axis.place(wanted[0], [wanted[1], wanted[2]]));
        assert!(wanted.iter().zip(found).all(|(a, b)| (a - b).abs() < 1e-9), "{wanted:?} {found:?}");
    }
}

#[test]
fn heading_matches_the_direction_of_the_axis() {
    let axis = axis();
    let step = 1e-4;
    for k in -200_000..2_000_000 {
        if k % 37 != 0 && k % 20_000 != 0 {
            continue;
        }
        let chainage = f64::from(k) * step;
        let (a, b) = (axis.place(chainage, [0.0, 0.0]), axis.place(chainage + step, [0.0, 0.0]));
        let way = b - a;
        assert!((way.norm() - step).abs() < 1e-10, "at {chainage}");
        let heading = axis.heading_rad(chainage + step / 2.0);
        let off = way.y() * math::cos(heading) - way.x() * math::sin(heading);
        assert!(off.abs() < 1e-9, "at {chainage}: {off}");
        assert!((axis.heading_rad(chainage + step) - axis.heading_rad(chainage)).abs() < 1e-5);
    }
}

#[test]
fn positive_turns_and_headings_are_to_the_left() {
    let axis = parse("[[tunnel.axis]]\nradius_m = 20\nturn_deg = 90", &shapes::ceran().unwrap());
    let end = axis.axis().place(20.0 * math::FRAC_PI_2, [0.0, 1.0]);
    assert!((end - Point3::new(20.0, 20.0, 1.0)).norm() < 1e-12);
    assert!((axis.axis().heading_rad(50.0) - math::FRAC_PI_2).abs() < 1e-12);
    let left = axis.axis().place(50.0, [2.0, 0.0]);
    assert!((left.x() - 18.0).abs() < 1e-12, "{left:?}");
    assert!(!axis.axis().is_straight() && Axis::straight().is_straight());
}
