//! Transformations of a dive that must not change its results.
//!
//! The transformations are a mirror, other origins of chainage and arc length, other names of heads, another order of
//! heads, and another tick length.

use headrace_coverage::Verdict;
use std::fmt::Write as _;
use std::sync::Arc;

use headrace_geometry::math::{self, TAU};
use headrace_geometry::time::DurNs;
use headrace_geometry::tunnel::{Piece, Profile};
use headrace_monitor::report::SpreadReport;
use headrace_monitor::section_row::SectionRow;
use headrace_oracle::wall::Wall;
use headrace_tests::instrumented::{self, Dive};
use headrace_tests::random_dives::{self, seeded};
use headrace_tests::{Folder, raw_messages, write_log};
use mcap::{Channel, Message, WriteOptions};
use serde_json::Value;

const TOLERANCE_M: f64 = 1e-9;

/// Two dives. After a transformation, the results of the second dive must agree with the results of the first dive.
struct Beside<'a> {
    here: &'a Dive,
    there: &'a Dive,
    /// Chainage offset of the second dive, m.
    along_m: f64,
    /// Maps arc lengths of the second dive to arc lengths of the first dive.
    around: &'a dyn Fn(f64) -> f64,
}

impl Beside<'_> {
    #[track_caller]
    fn agree(&self) {
        let [here, there] = [self.here, self.there].map(|dive| &dive.report.sections);
        assert_eq!(here.len(), there.len(), "sections");
        let wall = Wall::new(self.here.samples().map(|sample| sample.place), self.here.profile.perimeter_m())
            .unwrap();
        let verdicts: Vec<Verdict> = here.iter().map(|section| section.verdict).collect();
        assert!(
            verdicts.contains(&Verdict::Fail) && verdicts.contains(&Verdict::Pass),
            "the dive has too few kinds of verdicts"
        );
        for (a, b) in here.iter().zip(there) {
            let wrong = self.differs(&wall, a, b);
            assert!(wrong.is_empty(), "section {}: {wrong:?}: {a:#?}, {b:#?}", a.start_m);
        }
    }

    fn differs(&self, wall: &Wall, a: &SectionRow, b: &SectionRow) -> Vec<&'static str> {
        let near = |a: f64, b: f64| (a - b).abs() <= TOLERANCE_M;
        let both = |a: Option<f64>, b: Option<f64>| match (a, b) {
            (Some(a), Some(b)) => near(a, b),
            _ => a.is_none() && b.is_none(),
        };
        let spreads = |a: &SpreadReport, b: &SpreadReport| {
            let deviations = [a.sd_m, b.sd_m].map(|sd_m| sd_m.map(|sd_m| sd_m * sd_m));
            a.count == b.count
                && both(a.min_m, b.min_m)
                && both(a.mean_m, b.mean_m)
                && both(a.max_m, b.max_m)
                && both(deviations[0], deviations[1])
        };
        let cause = |section: &SectionRow| section.cause.map(|evidence| evidence.cause);
        // The two dives may report different holes of the same size. The hole of the second dive must then also exist
        // in the first dive.
        let is_hole_here = b.hole_x_m.zip(b.hole_arc_m).zip(a.hole_m).is_none_or(|((x, sigma), hole_m)| {
            near(2.0 * wall.clear_m([x - self.along_m, (self.around)(sigma)]), hole_m)
        });
        [
            ("chainage", near(a.start_m + self.along_m, b.start_m)),
            ("hole", both(a.hole_m, b.hole_m) && a.hole_bounded == b.hole_bounded),
            ("place of the hole", is_hole_here),
            ("standard deviation", near(a.hole_sd_m, b.hole_sd_m)),
            ("T_x", spreads(&a.t_x, &b.t_x)),
            ("T_y", spreads(&a.t_y, &b.t_y)),
            ("T", spreads(&a.t, &b.t)),
            ("samples", a.samples == b.samples),
            ("verdict", a.verdict == b.verdict),
            ("cause", cause(a) == cause(b)),
            ("flag", both(a.flagged_s, b.flagged_s) && both(a.cleared_s, b.cleared_s)),
        ]
        .into_iter()
        .filter_map(|(what, right)| (!right).then_some(what))
        .collect()
    }
}

/// Vehicle file without a navigation filter, with heads at the positions `heads` in the body frame.
///
/// If `side` is -1, the vehicle is mirrored: the positions and turning directions of its heads, and the directions of
/// its echosounders.
fn vehicle(tunnel: &str, heads: &[[f64; 2]], side: f64) -> String {
    let mut text = format!(
        "target_m = 0.7\n[tunnel]\nlength_m = 1200\n{tunnel}\n[navigation]\nway = \"direct\"\n[heads]\nplanned_speed_mps = 0\n"
    );
    let sign = if side < 0.0 { "inverted" } else { "normal" };
    for (number, [x, y]) in heads.iter().enumerate() {
        write!(
            text,
            "[[sensors]]\nid = \"sonar_{number}\"\nplugin = \"imagenex881\"\nmode = \"fastest\"\nrange_m = 5\n\
             position_m = [{x}, {}, 0]\nangle_sign = \"{sign}\"\n",
            side * y
        )
        .unwrap();
    }
    let (left, right) = ("angles_deg = [0, 0, 90]", "angles_deg = [0, 0, -90]");
    if side < 0.0 {
        text.push_str(
            &random_dives::SENSORS.replace(left, "LEFT").replace(right, left).replace("LEFT", right),
        );
    } else {
        text.push_str(random_dives::SENSORS);
    }
    text
}

/// Trajectory of a vehicle that is slow enough at first, then too fast, and then goes back over a part of its path.
fn legs(start_m: f64, place_m: [f64; 2]) -> String {
    let mut text = format!(
        "vehicle = \"vehicle.toml\"\n[effects]\nmotion_within_turn = {{}}\n[trajectory]\nstart_m = {start_m}\nplace_m = {place_m:?}\n"
    );
    for (distance_m, speed_mps) in [(2.0, 0.1), (3.0, 0.35), (1.0, -0.2), (2.0, 0.15)] {
        writeln!(text, "[[trajectory.legs]]\ndistance_m = {distance_m}\nspeed_mps = {speed_mps}").unwrap();
    }
    text
}

const CIRCLE: &str = "profile = \"circle\"\nradius_m = 2";
const HEADS: [[f64; 2]; 2] = [[0.4, 0.1], [-0.3, 0.05]];

/// A mirrored vehicle in a mirrored tunnel sends the same bytes.
#[test]
fn mirrored_wall_gives_a_mirrored_report() {
    let corners = [[-1.8, 0.0], [2.2, 0.0], [2.6, 1.4], [1.0, 3.0], [-1.4, 2.6], [-2.1, 1.0]];
    let [polygon, mirrored] = [1.0, -1.0].map(|side| {
        let lines: Vec<String> = corners.iter().map(|[y, z]| format!("{},{z}", side * y)).collect();
        lines.join("\n")
    });
    let tunnel = |side: f64| {
        format!("profile = \"polyline\"\nfile = \"polygon.csv\"\nreference_m = [{}, 1.4]", side * 0.2)
    };
    let scene = legs(3.1, [0.35, 1.3]);
    for heads in [&HEADS[..1], &HEADS[..]] {
        let [vehicle, opposite] = [1.0, -1.0].map(|side| vehicle(&tunnel(side), heads, side));
        let here = instrumented::dive_believing([&vehicle; 2], [&polygon; 2], &scene);
        let there = instrumented::dive_believing([&vehicle, &opposite], [&polygon, &mirrored], &scene);
        let perimeter_m = here.profile.perimeter_m();
        let around = |arc_m: f64| math::wrap(-arc_m, perimeter_m);
        assert!(here.samples().count() > 1000);
        for (a, b) in here.samples().zip(there.samples()) {
            assert!((a.point[1] + b.point[1]).abs() < TOLERANCE_M, "{a:?} isn't mirrored: {b:?}");
        }
        Beside { here: &here, there: &there, along_m: 0.0, around: &around }.agree();
    }
}

#[test]
fn chainage_origin_does_not_change_results() {
    let vehicle = vehicle(CIRCLE, &HEADS, 1.0);
    let dive = |start_m: f64| instrumented::dive(&vehicle, &legs(start_m, [0.3, 2.1]));
    let here = dive(3.1);
    for along_m in [16.0, 1000.0] {
        let there = dive(3.1 + along_m);
        Beside { here: &here, there: &there, along_m, around: &|arc_m| arc_m }.agree();
    }
}

#[test]
fn arc_length_origin_does_not_change_results() {
    let (vehicle, scene) = (vehicle(CIRCLE, &HEADS, 1.0), legs(3.1, [0.3, 2.1]));
    let here = instrumented::dive(&vehicle, &scene);
    let (perimeter_m, [y, z]) = (here.profile.perimeter_m(), here.profile.reference());
    for share in [0.11, 0.5, 0.83] {
        let begins_m = share * perimeter_m;
        let whole = [Piece::Arc { centre: [y, z], sweep_rad: TAU }];
        let there = Profile::new(here.profile.point_at(begins_m), &whole, [y, z]).unwrap();
        let there = instrumented::dive_with_profile(&vehicle, &scene, there);
        let around = |arc_m: f64| math::wrap(arc_m + begins_m, perimeter_m);
        let moved = here.samples().zip(there.samples()).all(|(a, b)| (a.place[1] - b.place[1]).abs() > 0.1);
        assert!(moved, "the loop uses another origin");
        Beside { here: &here, there: &there, along_m: 0.0, around: &around }.agree();
    }
}

#[test]
fn tick_length_does_not_change_results() {
    for seed in 0..8 {
        let seeded = seeded(seed);
        let dive = |ms: i64| {
            instrumented::dive_in_ticks(&seeded.vehicle, &seeded.scene, DurNs(ms * 1_000_000)).report
        };
        let expected = dive(20);
        for ms in [1, 777] {
            let got = dive(ms);
            assert_eq!(got.sections, expected.sections, "seed {seed}: ticks of {ms} ms");
            assert_eq!(got.digest, expected.digest, "seed {seed}: ticks of {ms} ms");
        }
    }
}

/// The vehicle file with its heads in another order. The heads are the first sensors in the file.
fn reordered(vehicle: &str, heads: usize) -> String {
    let mut tables: Vec<&str> = vehicle.split("[[sensors]]\n").collect();
    tables[1..=heads].reverse();
    tables.join("[[sensors]]\n")
}

/// Values of the keys `keys` in the report.
fn answers<'a>(report: &'a Value, keys: &[&str]) -> Vec<&'a Value> {
    assert!(report["summary"]["flags_raised"].as_u64().unwrap() > 5, "{}", report["summary"]);
    keys.iter().map(|key| &report[*key]).collect()
}

#[test]
fn head_order_does_not_change_results() {
    let folder = Folder::new();
    let vehicle = vehicle(CIRCLE, &[HEADS[0], HEADS[1], [0.0, -0.2]], 1.0);
    folder.write("vehicle.toml", &vehicle);
    folder.write("scene.toml", legs(3.1, [0.3, 2.1]));
    folder.simulate("scene.toml", "dive.mcap");
    let (_, expected) = folder.replay("dive.mcap", &[]);
    folder.write("reordered.toml", reordered(&vehicle, 3));
    let (_, got) = folder.replay("dive.mcap", &["--vehicle", "reordered.toml"]);
    assert_eq!(got["sources"][0]["id"], "sonar_2", "the order of heads hasn't changed");
    // Causes of failed sections may differ, because start angles and phases are assigned in the order of the heads.
    let [got, expected] = [got, expected].map(|mut report| {
        for section in report["sections"].as_array_mut().unwrap() {
            section.as_object_mut().unwrap().remove("cause");
        }
        report
    });
    let keys = ["dive", "summary", "sections"];
    assert_eq!(answers(&got, &keys), answers(&expected, &keys));
}

/// The same message on a channel with another name.
fn renamed<'a>(message: &Message<'a>, named: &dyn Fn(&str) -> String) -> Message<'a> {
    let metadata = message.channel.metadata.iter().map(|(key, value)| (key.clone(), named(value))).collect();
    let topic = named(&message.channel.topic);
    let channel = Channel { topic, metadata, ..(*message.channel).clone() };
    Message { channel: Arc::new(channel), ..message.clone() }
}

#[test]
fn head_names_do_not_change_results() {
    let folder = Folder::new();
    let vehicle = vehicle(CIRCLE, &HEADS, 1.0);
    folder.write("vehicle.toml", &vehicle);
    folder.write("scene.toml", legs(3.1, [0.3, 2.1]));
    folder.simulate("scene.toml", "dive.mcap");
    let log = folder.read("dive.mcap");
    let report = |names: [&str; 2]| {
        let named = |text: &str| text.replace("sonar_0", names[0]).replace("sonar_1", names[1]);
        let messages: Vec<_> = raw_messages(&log).iter().map(|message| renamed(message, &named)).collect();
        write_log(&folder.path("named.mcap"), WriteOptions::new(), Some(&named(&vehicle)), &messages);
        folder.replay("named.mcap", &[]).1
    };
    let expected = report(["sonar_0", "sonar_1"]);
    let got = report(["zeta", "alpha-2"]);
    assert_eq!(got["sources"][0]["id"], "zeta");
    let keys = ["dive", "summary", "sections", "advice"];
    assert_eq!(answers(&got, &keys), answers(&expected, &keys));
}
