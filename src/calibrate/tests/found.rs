//! Compares the estimates with the errors of the simulated vehicle.

use super::super::estimate::NotEstimated;
use super::super::heads::{Heads, heads};
use super::super::scan::gather;
use super::super::still::longest;
use super::super::zero;
use super::stand::{DEPTH, HEADS, Stand, TETHER, Wrong, mirrored, profiles, short_deg};
use headrace_geometry::math;
use headrace_geometry::time::{DurNs, MonoNs};
use headrace_geometry::tunnel::shapes;

fn found(stand: &Stand) -> Heads {
    stand.ask(|material| heads(material).unwrap())
}

/// Mount errors of two heads. One head is turned and moved relative to the vehicle file, and for some seeds it
/// is mirrored.
fn wrong(seed: u64) -> [Wrong; 2] {
    let swing = math::sin(seed as f64);
    [
        Wrong {
            angle_deg: 4.0 * swing,
            left_m: 0.03,
            up_m: -0.02 * swing,
            is_mirrored: seed.is_multiple_of(2),
        },
        Wrong { angle_deg: -2.0, left_m: -0.01, up_m: 0.01, is_mirrored: seed.is_multiple_of(3) },
    ]
}

/// Estimated angles, relative positions and senses of rotation of heads are correct within three of the
/// stated standard deviations.
///
/// The standard deviations are as small as a survey needs.
#[test]
fn injected_mount_errors_are_estimated() {
    let mut worst = (0.0_f64, 0.0_f64);
    for (name, profile) in profiles() {
        for seed in 1..=20 {
            let wrong = wrong(seed);
            let stand = Stand { outliers: 0.08, ..Stand::new(profile.clone(), &wrong, seed) };
            let found = found(&stand);
            assert!(found.median_m < 0.02);
            let mean = |of: fn(&Wrong) -> f64| f64::midpoint(of(&wrong[0]), of(&wrong[1]));
            for (head, wrong) in found.heads.iter().zip(&wrong) {
                let case = format!("{name}, seed {seed}, {head:?}");
                assert_eq!(head.is_mirrored, Ok(wrong.is_mirrored), "{case}");
                let [angle, left, up] = [head.angle_rad, head.left_m, head.up_m]
                    .map(|of| of.unwrap_or_else(|why| panic!("{case}: {why}")));
                let off_deg = short_deg(angle.value) - wrong.angle_deg;
                let off_left = left.value - (wrong.left_m - mean(|w| w.left_m));
                let off_up = up.value - (wrong.up_m - mean(|w| w.up_m));
                for (off, sd, most) in
                    [(off_deg, angle.sd.to_degrees(), 0.3), (off_left, left.sd, 0.01), (off_up, up.sd, 0.01)]
                {
                    assert!(off.abs() <= 3.0 * sd && off.abs() < most, "{off} +- {sd}: {case}");
                    worst.0 = worst.0.max(off.abs() / sd);
                    worst.1 = worst.1.max(sd / most);
                }
                assert!(head.used > 190 && head.rejected > 5, "{case}");
            }
            let [y, z] = found.place_m;
            assert!(
                (y.value - stand.at[0] - mean(|w| w.left_m)).abs() <= 3.0 * y.sd
                    && (z.value - stand.at[1]).abs() <= 3.0 * z.sd
            );
        }
    }
    println!("worst error {:.2} sigma, widest sigma {:.2} of what a survey needs", worst.0, worst.1);
}

/// The estimated mount's beams have the directions of the true beams.
#[test]
fn estimated_mount_has_the_beam_directions_of_the_true_head() {
    let (_, profile) = profiles().into_iter().next().unwrap();
    let wrong = [Wrong { angle_deg: 7.0, is_mirrored: true, ..Wrong::default() }, Wrong::default()];
    let head = found(&Stand::new(profile, &wrong, 3)).heads[0];
    for angle in [0.0, 1.0, 2.5, 4.0] {
        let looks = head.found.rotation * headrace_geometry::frames::head_direction(angle);
        let truth =
            head.filed.rotation * headrace_geometry::frames::head_direction(-angle + f64::to_radians(7.0));
        assert!((looks + -truth).norm() < 0.006, "{looks:?} {truth:?}");
    }
}

#[test]
fn mirrored_tunnel_gives_mirrored_estimates() {
    for (name, profile) in profiles() {
        // The stand has no noise, because noise would not be mirrored.
        let wrong =
            [Wrong { angle_deg: 3.0, left_m: 0.02, up_m: 0.01, is_mirrored: false }, Wrong::default()];
        let stand = Stand { noise_m: 0.0, ..Stand::new(profile, &wrong, 5) };
        // Only the first head is used. The second one is to its left, and would be to its right in the
        // mirror.
        let stand = Stand { wrong: stand.wrong[..1].to_vec(), ..stand };
        let (here, there) = (found(&stand), found(&mirrored(&stand)));
        let [a, b] = [&here, &there].map(|found| found.heads[0].angle_rad.unwrap());
        assert!((a.value + b.value).abs() < 0.15_f64.to_radians(), "{name}: {a:?} {b:?}");
        assert!((a.value - 3.0_f64.to_radians()).abs() < 3.0 * a.sd, "{name}: {a:?}");
        assert!((here.place_m[0].value + there.place_m[0].value).abs() < 0.02, "{name}");
        assert!((here.place_m[1].value - there.place_m[1].value).abs() < 0.02, "{name}");
    }
}

#[test]
fn echosounders_reveal_upside_down_heads() {
    let wrong = [Wrong { angle_deg: 180.0, ..Wrong::default() }, Wrong::default()];
    for (name, profile) in profiles() {
        let found = found(&Stand { at: [0.6, 1.8], ..Stand::new(profile, &wrong, 2) });
        let angle = found.heads[0].angle_rad.unwrap();
        assert!(short_deg(angle.value - math::PI).abs() < 1.0, "{name}: {angle:?}");
        assert!(short_deg(found.heads[1].angle_rad.unwrap().value).abs() < 1.0, "{name}");
    }
}

/// The zeros of cable counter, surface and water level are exact, except for rounding and for the error of the height
/// that the heads measure.
#[test]
fn estimated_zeros_of_cable_counter_surface_and_water_level_are_exact() {
    let mut stand = Stand { noise_m: 0.0, ..Stand::new(shapes::ceran().unwrap(), &[Wrong::default(); 2], 1) };
    // With a surface 2.6 m above the floor, the depth sensor is slightly under water.
    stand.site.surface_above_floor_m = 2.6;
    stand.ask(|material| {
        let still = longest(material).unwrap();
        let tether = zero::tethers(material, &still, 40.0).unwrap()[0];
        assert_eq!(tether.source, TETHER);
        assert!((tether.found.value - 2.0).abs() < 1e-9 && tether.found.sd < 0.1, "{tether:?}");
        let (from, to) = (MonoNs(9_000_000_000), MonoNs(12_000_000_000));
        let surface = zero::surface(material, from, to).unwrap();
        let height_m = stand.pose(0.0).place(material.sensors[DEPTH].mount.position).z();
        let truth_pa = stand.site.pressure_pa(stand.site.surface_above_floor_m - height_m);
        assert!((surface.found.value - truth_pa).abs() < 1e-6 && surface.found.sd < 1.0, "{surface:?}");
        assert_eq!(surface.readings, 60);
        let heads = heads(material).unwrap();
        let level = zero::water_level(material, &heads, None).unwrap();
        assert!((level.found.value - stand.site.surface_above_floor_m).abs() < 0.01, "{level:?}");
        // A surface pressure lower by 1000 Pa puts the surface 10 cm higher.
        let pa = stand.site.surface_pressure_pa - 1000.0;
        let higher = zero::water_level(material, &heads, Some(pa)).unwrap();
        assert!((higher.found.value - level.found.value - 0.102).abs() < 1e-3);
        assert_eq!(
            zero::surface(material, to, to),
            Err(NotEstimated::Missing { what: "a depth sensor at that time" })
        );
    });
}

/// Repeated turns see the same roughness of the wall. Their returns share the weight, so each piece of wall counts
/// once.
#[test]
fn repeated_turns_add_no_weight_to_a_piece_of_wall() {
    let stand = Stand { seconds: 100, ..Stand::new(shapes::ceran().unwrap(), &[Wrong::default()], 1) };
    stand.ask(|material| {
        let still = longest(material).unwrap();
        assert_eq!(still.to.since(still.from), DurNs(100_000_000_000));
        let scan = gather(material, &still).unwrap();
        let shares: f64 = scan.heads[0].returns.iter().map(|one| one.share).sum();
        assert!((shares - 120.0).abs() < 1e-9, "{shares}");
        assert!(scan.heads[0].returns.len() <= 960 && scan.heads[0].source == HEADS);
    });
}
