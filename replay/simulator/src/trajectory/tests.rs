use headrace_config::Document;
use headrace_geometry::math;
use headrace_vehicle::TunnelConfig;

use super::*;
use crate::random::Stream;
use crate::stretch::Stretch;

/// A trajectory in a tunnel with a length of 200 m.
fn parsed(trajectory: &str, seed: u64) -> Result<(Trajectory, Ground), String> {
    recorded(trajectory, seed, "")
}

fn recorded(trajectory: &str, seed: u64, file: &str) -> Result<(Trajectory, Ground), String> {
    let text = format!("[tunnel]\nprofile = \"ceran\"\n[trajectory]\n{trajectory}");
    let root = Document::new("scene", &text).root().unwrap();
    let load = |_: &str| Ok(file.to_owned());
    let tunnel = TunnelConfig::from_section(&root.section("tunnel").unwrap().unwrap(), &load).unwrap();
    let section = root.section("trajectory").unwrap().unwrap();
    parse(&section, (&tunnel.profile, 200.0), seed, &load).map_err(|error| error.to_string())
}

fn trajectory(keys: &str) -> Trajectory {
    parsed(keys, 1).unwrap().0
}

fn places(trajectory: &Trajectory, step_s: f64) -> Vec<Place> {
    let steps = math::floor_to_i64(trajectory.duration_s() / step_s);
    (0..=steps).map(|step| trajectory.place(step as f64 * step_s)).collect()
}

#[test]
fn legs_follow_each_other_without_a_jump() {
    let trajectory = trajectory(
        "start_m = 2\n[[trajectory.legs]]\ndistance_m = 10\nspeed_mps = 0.2\n\
                   [[trajectory.legs]]\ndistance_m = 3\nspeed_mps = 0.3\n\
                   [[trajectory.legs]]\ndistance_m = 1\nspeed_mps = -0.5\n",
    );
    assert!((trajectory.duration_s() - 62.0).abs() < 1e-12);
    let wanted =
        [(-1.0, 1.8), (0.0, 2.0), (50.0, 12.0), (60.0, 15.0), (61.0, 14.5), (62.0, 14.0), (63.0, 13.5)];
    for (after_s, x_m) in wanted {
        assert!((trajectory.place(after_s).chainage_m - x_m).abs() < 1e-9, "{after_s}");
    }
    let steps = places(&trajectory, 0.01);
    assert!(steps.windows(2).all(|w| (w[1].chainage_m - w[0].chainage_m).abs() < 0.005 + 1e-9));
}

/// Corners are rounded over two seconds. The trajectory therefore starts a little after its first waypoint and ends a
/// little before its last one. Each difference is a sixth of the distance travelled in half a second.
#[test]
fn waypoints_are_passed_at_their_speeds() {
    let trajectory = trajectory(
        "kind = \"waypoints\"\n\
                   [[trajectory.waypoints]]\nchainage_m = 2\nplace_m = [0, 4]\n\
                   [[trajectory.waypoints]]\nchainage_m = 12\nplace_m = [0, 4]\nspeed_mps = 0.5\nstay_s = 10\n\
                   [[trajectory.waypoints]]\nchainage_m = 12\nplace_m = [1, 5]\nspeed_mps = 0.1\nyaw_deg = 20\n",
    );
    let stretch_s = math::sqrt(2.0) / 0.1;
    assert!((trajectory.duration_s() - (20.0 + 10.0 + stretch_s)).abs() < 1e-9);
    let near = |after_s: f64, chainage_m: f64, [y, z]: [f64; 2], tolerance_m: f64| {
        let place = trajectory.place(after_s);
        let off = [place.chainage_m - chainage_m, place.across_m[0] - y, place.across_m[1] - z];
        assert!(off.iter().all(|m| m.abs() <= tolerance_m), "{after_s}: {place:?}");
    };
    near(0.0, 2.0, [0.0, 4.0], 0.5 * 0.5 / 6.0 + 1e-9);
    near(10.0, 7.0, [0.0, 4.0], 1e-9);
    near(25.0, 12.0, [0.0, 4.0], 1e-9);
    near(30.0 + stretch_s / 2.0, 12.0, [0.5, 4.5], 1e-9);
    near(trajectory.duration_s(), 12.0, [1.0, 5.0], 0.1 * 0.5 / 6.0 + 0.03);
    assert!((trajectory.place(30.0 + stretch_s / 2.0).turned_rad[2].to_degrees() - 10.0).abs() < 1e-9);
}

const PILOT: &str = "kind = \"pilot\"\nplace_m = [0, 5]\nstart_m = 3\nspeed_mps = 0.4\nstops_per_hour = 90\n\
                     backs_per_hour = 90\nwander_yaw_deg = 8\nwander_s = 10\n";

#[test]
fn pilot_reaches_the_end_within_bounds_in_both_directions() {
    for (from_m, to_m) in [(3.0, 60.0), (3.0, -15.0)] {
        for seed in 0..20 {
            let (trajectory, ground) = parsed(&format!("{PILOT}to_m = {to_m}\n"), seed).unwrap();
            assert_eq!(ground, Ground::Water);
            assert!((trajectory.place(trajectory.duration_s()).chainage_m - to_m).abs() < 0.2 + 1e-9);
            let (mut stood, mut back) = (0, 0);
            let steps = places(&trajectory, 0.25);
            for w in steps.windows(2) {
                let gone_m = (w[1].chainage_m - w[0].chainage_m) * (to_m - from_m).signum();
                assert!(gone_m.abs() <= 0.1 + 1e-9);
                stood += usize::from(gone_m.abs() < 0.001);
                back += usize::from(gone_m < -0.02);
            }
            for Place { chainage_m, across_m: [y, z], turned_rad: [roll, pitch, yaw] } in &steps {
                // A pilot who goes back doesn't pass the dive's start by more than a metre.
                let inside = (from_m.min(to_m) - 1.0..=from_m.max(to_m) + 1.0).contains(chainage_m);
                assert!(inside && y.abs() <= 0.5 && (z - 5.0).abs() <= 0.3, "{seed}: {chainage_m} {y} {z}");
                assert!(yaw.to_degrees().abs() <= 8.0 && roll.abs() + pitch.abs() == 0.0);
            }
            if (to_m - from_m).abs() > 50.0 && seed == 0 {
                assert!(stood > 0 && back > 0, "{stood} {back}");
            }
        }
    }
}

/// The pilot goes back by the distance `back_m`, rounded to the nearest step of the simulation.
#[test]
fn pilot_goes_back_the_given_distance() {
    let keys = "kind = \"pilot\"\nto_m = 190\nspeed_mps = 1\nstops_per_hour = 0\nbacks_per_hour = 30\n\
                back_m = [3, 3]\nwander_across_m = 0\nwander_up_m = 0\n";
    let (mut lost_m, mut backs) = (0.0, 0.0);
    for seed in 0..50 {
        let trajectory = parsed(keys, seed).unwrap().0;
        let steps = places(&trajectory, 0.5);
        let gone: Vec<f64> = steps.windows(2).map(|w| w[1].chainage_m - w[0].chainage_m).collect();
        backs += gone.windows(2).filter(|w| w[0] >= 0.0 && w[1] < 0.0).count() as f64;
        lost_m += trajectory.duration_s() - 190.0;
    }
    // Each reversal costs three seconds for going back and three seconds for driving the same distance again. The start
    // of each dive costs 1.5 s.
    let each_s = (lost_m - 50.0 * 1.5) / backs;
    assert!((each_s - 6.0).abs() < 0.3, "{each_s} of {backs}");
}

#[test]
fn pilot_trajectory_depends_only_on_the_seed() {
    let at = |seed| parsed(&format!("{PILOT}to_m = 60\n"), seed).unwrap().0;
    assert_eq!(at(4), at(4));
    assert_ne!(at(4), at(5));
}

#[test]
fn recorded_trajectory_is_followed_as_recorded() {
    let file = "# from the log of 3 May\n t_s,chainage_m,y_m,z_m,roll_deg,pitch_deg,yaw_deg\n\n\
                100,5,0,4,0,0,170\n110,7,1,4,0,2,-170\n# a break\n130,7,1,5,0,2,-170\n";
    let (trajectory, ground) = recorded("kind = \"recorded\"\nfile = \"track.csv\"\n", 1, file).unwrap();
    assert_eq!((trajectory.duration_s(), ground), (30.0, Ground::Tunnel));
    let middle = trajectory.place(5.0);
    assert!((middle.chainage_m - 6.0).abs() < 1e-9 && (middle.across_m[0] - 0.5).abs() < 1e-9);
    // From 170 to -170 degrees, the angle passes through 180 degrees and not through 0.
    assert!((middle.turned_rad[2].to_degrees() - 180.0).abs() < 1e-9);
    let later = trajectory.place(20.0);
    assert!(
        (later.across_m[1] - 4.5).abs() < 1e-9 && (later.turned_rad[2].to_degrees() - 190.0).abs() < 1e-9
    );
}

#[test]
fn errors_in_a_recorded_trajectory_are_reported() {
    let why = |file: &str| recorded("kind = \"recorded\"\nfile = \"track.csv\"\n", 1, file).unwrap_err();
    for (file, problem) in [
        ("", "has no line with a position"),
        ("t,x\n", "has no line with a position"),
        ("0,1,2,3\n0,1,2,3\n", "line 2 has the time 0 s, which is not after the previous time"),
        ("t,x,y,z\nt,x,y,z\n", "line 2 of it is \"t,x,y,z\""),
        ("0,1,2,3\n1,2,nan,3\n", "line 2"),
        ("0,1,2,3\n1,2,3\n", "expected t_s,chainage_m,y_m,z_m"),
        ("5,1,0,4\n", "takes 0 s"),
        ("0,1,0,4\n200000,2,0,4\n", "takes 200000 s"),
        ("0,1,0,4\n9,500,0,4\n", "leads to chainage 500 m; the tunnel is 200 m long"),
    ] {
        assert!(why(file).contains(problem), "{file:?}: {}", why(file));
    }
}

#[test]
fn trajectories_that_leave_the_tunnel_or_do_not_move_are_refused() {
    let why = |trajectory: &str| parsed(trajectory, 1).unwrap_err();
    let leg = "[[trajectory.legs]]\ndistance_m = 350\nspeed_mps = -1\n";
    assert!(why(&format!("start_m = 400\n{leg}")).contains("start_m = 400: leads to chainage 400 m"));
    assert!(why("start_m = 2\n").contains("has no leg"));
    assert!(why(leg).contains("leads to chainage -350 m"));
    assert!(why("kind = \"pilot\"\nstart_m = 300\nto_m = 100\nspeed_mps = 1\n").contains("start_m = 300"));
    assert!(why("kind = \"pilot\"\nto_m = 0.01\nspeed_mps = 1\n").contains("at least 0.1 m"));
    assert!(why("kind = \"waypoints\"\n").contains("do not move"));
    assert!(why("place_m = [0, 99]\n").contains("inside the tunnel's profile"));
}

fn random_knots(seed: u64) -> (Knots, Vec<Offsets>) {
    let stream = Stream::new(seed, "knots", "test");
    let point = |k: i64| {
        let draw = |block| stream.block((k + 1).unsigned_abs(), block).normal();
        let [[a, b], [c, d], [e, f]] = [0, 1, 2].map(draw);
        [a, b, c, d, e, f]
    };
    (Knots::new(30.0, 0.7, point), (-1..=44).map(point).collect())
}

#[test]
fn spline_stays_within_the_hull_of_its_points() {
    for seed in 0..20 {
        let (knots, points) = random_knots(seed);
        for step in 0..3000_u32 {
            let after_s = f64::from(step) * 0.01;
            let first = usize::try_from(math::floor_to_i64(after_s / 0.7)).unwrap();
            for (axis, value) in knots.at(after_s).into_iter().enumerate() {
                let near = points[first..first + 4].iter().map(|point| point[axis]);
                let least = near.clone().fold(f64::MAX, f64::min);
                let most = near.fold(f64::MIN, f64::max);
                assert!((least - 1e-12..=most + 1e-12).contains(&value), "{seed} {after_s} {axis}");
            }
        }
    }
}

/// Position, speed and acceleration have no jump at a knot. Beyond its ends, the curve is a straight line.
#[test]
fn spline_acceleration_has_no_jumps() {
    let (knots, _) = random_knots(3);
    let step_s = 1e-4;
    let at = |after_s: f64| knots.at(after_s)[0];
    let speed = |after_s: f64| (at(after_s + step_s) - at(after_s - step_s)) / (2.0 * step_s);
    let acceleration =
        |after_s: f64| (at(after_s + step_s) - 2.0 * at(after_s) + at(after_s - step_s)) / (step_s * step_s);
    for k in 1..42 {
        let knot_s = f64::from(k) * 0.7;
        let (before_s, behind_s) = (knot_s - 2.0 * step_s, knot_s + 2.0 * step_s);
        assert!((at(behind_s) - at(before_s)).abs() < 0.01);
        assert!((speed(behind_s) - speed(before_s)).abs() < 0.02);
        // The third derivative is at most 8 times the largest coordinate divided by 0.7^3, so the acceleration changes
        // little here.
        assert!((acceleration(behind_s) - acceleration(before_s)).abs() < 0.05, "{knot_s}");
    }
    for (end_s, sign) in [(0.0, -1.0), (43.0 * 0.7, 1.0)] {
        let slope = (at(end_s + sign * 2.0) - at(end_s + sign)) * sign;
        assert!((at(end_s + sign * 10.0) - at(end_s) - sign * 10.0 * slope).abs() < 1e-9);
        assert!((slope - (at(end_s) - at(end_s - sign * step_s)) * sign / step_s).abs() < 0.01);
    }
}

#[test]
fn random_drift_has_the_given_amplitude_and_sd() {
    let reach = [1.0, 2.0, 0.0, 0.1, 0.2, 0.3];
    let knots = wandering(Stream::new(2, "wandering", "test"), 20_000.0, 10.0, reach);
    let (mut squares, mut products, count) = ([0.0; 6], 0.0, 20_000_u32);
    for second in 0..count {
        let offsets = knots.at(f64::from(second));
        for ((sum, offset), reach) in squares.iter_mut().zip(offsets).zip(reach) {
            assert!(offset.abs() <= reach);
            *sum += offset * offset / f64::from(count);
        }
        products += offsets[0] * offsets[1] / f64::from(count);
    }
    for (variance, reach) in squares.into_iter().zip(reach) {
        // The wanted variance is 151/315 of the variance of the control points, which are uniform random numbers. The
        // tolerance allows for the error of a variance that is estimated from about 2,000 independent values.
        let wanted = reach * reach / 3.0 * 151.0 / 315.0;
        assert!((variance - wanted).abs() <= 0.1 * wanted, "{variance} {wanted}");
    }
    assert!(products.abs() < 0.05, "{products}");
}

fn everywhere(speed_mps: f64) -> Flow {
    let mut flow = Flow::default();
    assert!(flow.add(Stretch::ALL, speed_mps));
    flow
}

/// If the flow changes within a leg, the time for each piece is its length divided by its own speed. From these times
/// follow the positions within a piece.
#[test]
fn current_changes_the_speed_only_within_its_stretch() {
    let mut flow = Flow::default();
    assert!(flow.add(Stretch { from_m: 4.0, to_m: 7.0 }, 0.1));
    assert!(flow.add(Stretch { from_m: 10.0, to_m: f64::INFINITY }, -0.05));
    assert!(!flow.add(Stretch { from_m: 6.0, to_m: 8.0 }, 0.1));
    let mut legs = trajectory(
        "[[trajectory.legs]]\ndistance_m = 12\nspeed_mps = 0.2\n[[trajectory.legs]]\ndistance_m = 11\nspeed_mps = -0.25\n",
    );
    let start_m = legs.place(0.0).chainage_m;
    assert!(start_m.abs() < 1e-12, "{start_m}");
    legs.carry(&flow).unwrap();
    let there = [4.0 / 0.2, 3.0 / 0.3, 3.0 / 0.2, 2.0 / 0.15];
    let back = [2.0 / 0.3, 3.0 / 0.25, 3.0 / 0.15, 3.0 / 0.25];
    let sum = |times: &[f64]| times.iter().sum::<f64>();
    assert!((legs.duration_s() - sum(&there) - sum(&back)).abs() < 1e-9, "{}", legs.duration_s());
    for (after_s, at_m) in [
        (20.0, 4.0),
        (25.0, 5.5),
        (30.0, 7.0),
        (sum(&there[..3]), 10.0),
        (sum(&there), 12.0),
        (sum(&there) + sum(&back[..2]), 7.0),
        (sum(&there) + sum(&back[..3]), 4.0),
        (sum(&there) + sum(&back), 1.0),
    ] {
        assert!(
            (legs.place(after_s).chainage_m - at_m).abs() < 1e-9,
            "{after_s}: {}",
            legs.place(after_s).chainage_m
        );
    }
    // A leg is refused only if the flow is too strong somewhere on that leg.
    let mut strong = Flow::default();
    assert!(strong.add(Stretch { from_m: 100.0, to_m: 200.0 }, -1.0));
    legs.carry(&strong).unwrap();
}

#[test]
fn current_is_refused_for_trajectories_over_ground() {
    let mut legs = trajectory("[[trajectory.legs]]\ndistance_m = 12\nspeed_mps = 0.2\n");
    legs.carry(&everywhere(0.1)).unwrap();
    assert!((legs.duration_s() - 40.0).abs() < 1e-9 && (legs.place(20.0).chainage_m - 6.0).abs() < 1e-9);
    assert!(legs.carry(&everywhere(-0.3)).unwrap_err().contains("carries the vehicle off: leg 0"));

    let mut pilot = trajectory(&format!("{PILOT}to_m = 60\n"));
    let still_s = pilot.duration_s();
    pilot.carry(&everywhere(0.2)).unwrap();
    assert!(pilot.duration_s() < still_s && (pilot.place(pilot.duration_s()).chainage_m - 60.0).abs() < 0.4);
    assert!(pilot.carry(&everywhere(-0.6)).unwrap_err().contains("has not reached 60 m"));

    let mut ground =
        Trajectory::of_knots(Knots::new(10.0, 1.0, |k| [k as f64, 0.0, 4.0, 0.0, 0.0, 0.0]), 10.0);
    assert!(ground.carry(&everywhere(0.1)).unwrap_err().contains("given over ground"));
}

#[test]
fn drift_adds_to_the_motion_of_legs() {
    let mut legs = trajectory("place_m = [0.5, 4]\n[[trajectory.legs]]\ndistance_m = 12\nspeed_mps = 0.2\n");
    legs.sway(Knots::new(60.0, 1.0, |_| [1.0, 0.25, -0.5, 0.1, 0.2, 0.3]));
    let place = legs.place(30.0);
    assert!((place.chainage_m - 7.0).abs() < 1e-9);
    let off = [place.across_m[0] - 0.75, place.across_m[1] - 3.5];
    let turned = place.turned_rad.into_iter().zip([0.1, 0.2, 0.3]).map(|(is, wanted)| is - wanted);
    assert!(off.into_iter().chain(turned).all(|off| off.abs() < 1e-12));
}
