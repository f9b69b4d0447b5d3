//! `headrace plan`: text, JSON and CSV output, and refusals with their reasons.

use std::fmt::Write as _;

use headrace_tests::Folder;
use serde_json::Value;

const VITA_2: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../deploy/vehicles/vita2-4.toml");

fn plan(folder: &Folder, args: &[&str]) -> headrace_tests::Answer {
    folder.headrace(&[&["plan"], args].concat())
}

fn json(folder: &Folder, args: &[&str]) -> Value {
    let answer = plan(folder, &[args, &["--json"]].concat());
    serde_json::from_str(&answer.stdout).unwrap_or_else(|error| panic!("{error}: {}", answer.stderr))
}

#[test]
fn plan_of_a_vehicle_is_printed_as_text() {
    let answer = plan(&Folder::new(), &["--vehicle", VITA_2]);
    assert_eq!((answer.code, answer.stderr.as_str()), (Some(0), ""));
    insta::assert_snapshot!(answer.stdout, @r"
    ceran: perimeter 35.90 m, 7000 m long; vehicle at y 0.00 m, z 3.09 m
    4 heads, phase shift, range setting 10 m; a beam covers 0.08 to 0.28 m of wall
    target 0.5 m

                                       T_y at rest, m         at  T_x, m, seen by   T_max  certain hit, m   v_max   hours
      mode     step   turn  overlap    min   mean  worst     m/s    all    fewest       m   once    twice     m/s  needed
      slow      0.3   21.60     4.67  0.016  0.030  0.064   0.041  0.221     0.443   0.458   0.46     0.92   0.041    47.4
      medium    0.6   10.80     2.33  0.032  0.060  0.126   0.083  0.226     0.451   0.471   0.47     0.94   0.083    23.3
      fast      0.9    8.00     1.56  0.049  0.090  0.188   0.112  0.226     0.452   0.477   0.48     0.95   0.112    17.2
    * faster    1.2    6.60     1.17  0.065  0.120  0.249   0.135  0.223     0.447   0.480   0.48     0.96   0.135    14.4
      fastest   2.4    4.80     0.58  0.130  0.239  0.481   0.063  0.076     0.152   0.488   0.49     0.98   0.063    30.7

    * fastest for the target: faster, at most 0.135 m/s, 14.4 h one way
    faster: 0.259 m/s from the geometry alone, 0.146 with occlusion by the vehicle, 0.142 with heads side by side or at an angle, 0.135 with passes known to +-1.2 cm
    with the heads in line, x 0.41, 0.69, -0.69, -0.41 m, y 0.00, z 0.00: faster, at most 0.251 m/s, 7.7 h
    sonar_0: 15.3 degrees about 270 are hidden by the vehicle, 1.66 m of wall at 3:00
    sonar_1: 15.3 degrees about 90 are hidden by the vehicle, 1.66 m of wall at 9:00
    sonar_2: 15.3 degrees about 90 are hidden by the vehicle, 1.66 m of wall at 3:00
    sonar_3: 15.3 degrees about 270 are hidden by the vehicle, 1.66 m of wall at 9:00
    1.66 m of wall at 9:00 are seen by sonar_0, sonar_2 only: T_x is 2.000 times as large there
    1.66 m of wall at 3:00 are seen by sonar_1, sonar_3 only: T_x is 2.000 times as large there
    start angles in faster at 0.135 m/s, degrees, + growing: sonar_0 0.0+; sonar_1 90.0+; sonar_2 265.3-; sonar_3 175.3-
    heads 1.102 m apart along the hull start at equal angles at 0.134 m/s; at this speed, 1.114 m apart (q = 5)
    ");
}

#[test]
fn plan_with_drift_yaw_and_deadline_is_printed_as_text() {
    let args = ["--tunnel", "ceran", "--length", "7000", "--heads", "2", "--layout", "sector_offset"];
    let allowed = ["--target", "0.6", "--drift", "1", "--yaw", "10", "--hours", "30", "--range", "20"];
    let answer = plan(&Folder::new(), &[&args[..], &allowed].concat());
    assert_eq!(answer.code, Some(1), "{}", answer.stderr);
    insta::assert_snapshot!(answer.stdout, @r"
    ceran: perimeter 35.90 m, 7000 m long; vehicle at y 0.00 m, z 3.09 m; allowing for a constant offset of 1 m and yaw of 10.0 degrees
    2 heads, sector offset, range setting 20 m; a beam covers 0.08 to 0.28 m of wall
    target 0.6 m, 30 h for the whole length, one way: 0.065 m/s

                                       T_y at rest, m         at  T_x, m, seen by   T_max  certain hit, m   v_max   hours
      mode     step   turn  overlap    min   mean  worst     m/s    all    fewest       m   once    twice     m/s  needed
      slow      0.3 ~ 37.60     4.67  0.016  0.030  0.108   0.065  2.437     2.437   2.439   2.44     4.88   0.015   122.2
      medium    0.6 ~ 18.80     2.33  0.032  0.060  0.213   0.065  1.219     1.219   1.223   1.22     2.45   0.031    61.5
      fast      0.9 ~ 13.33     1.56  0.049  0.090  0.315   0.065  0.864     0.864   0.874   0.87     1.75   0.044    44.2
    * faster    1.2 ~ 10.60     1.17  0.065  0.120  0.414   0.065  0.687     0.687   0.706   0.71     1.41   0.054    35.7
      fastest   2.4 ~  6.80     0.58  0.130  0.239  0.782   0.065  0.441     0.441   0.830   0.83     1.66    none

    fastest: no speed meets a target of 0.6 m: neighbouring samples of one turn are 0.782 m apart at every speed
    * finest at this speed: faster; it doesn't meet the target
    faster: 0.055 m/s from the geometry alone
    ~ extrapolated from another range setting; measure the turn period and add it to the vehicle file
    start angles in faster at 0.065 m/s, degrees, + growing: head_0 0.0+ within 0 to 180; head_1 180.0+ within 180 to 360
    ");
}

#[test]
fn json_and_csv_have_the_same_figures() {
    let folder = Folder::new();
    let args = ["--tunnel", "ceran-blueprint", "--heads", "3", "--speed", "0.2", "--target", "0.9"];
    let plan_json = json(&folder, &args);
    assert_eq!(
        (plan_json["plan_version"].as_u64(), plan_json["layout"].as_str()),
        (Some(1), Some("phase_shift"))
    );
    let csv = plan(&folder, &[&args[..], &["--csv"]].concat()).stdout;
    let mut rows = csv.lines().map(|line| line.split(',').collect::<Vec<_>>());
    let headings = rows.next().unwrap();
    let modes = plan_json["modes"].as_array().unwrap();
    let rows: Vec<_> = rows.collect();
    assert_eq!((rows.len(), modes.len()), (5, 5));
    for (row, mode) in rows.iter().zip(modes) {
        assert_eq!(row.len(), headings.len());
        let cell = |heading: &str| row[headings.iter().position(|h| *h == heading).unwrap()];
        assert_eq!(cell("mode"), mode["mode"]);
        for (heading, value) in [
            ("t_y2_m", &mode["t_y2_m"]),
            ("v_max_mps", &mode["v_max_mps"]),
            ("t_max_m", &mode["spacing"]["t_max_m"]),
            ("pitch_m", &mode["spacing"]["pitch_m"]),
        ] {
            let (cell, value) = (cell(heading).parse::<f64>().unwrap(), value.as_f64().unwrap());
            assert!((cell - value).abs() < 1e-6, "{heading}: {cell} and {value}");
        }
        assert_eq!(cell("meets_target") == "yes", mode["meets_target"].as_bool().unwrap());
    }
}

/// At a speed slightly above v_max, the spacing T still meets the target, but leaves no margin for position errors.
#[test]
fn speed_above_v_max_misses_the_target_even_if_t_meets_it() {
    let folder = Folder::new();
    let at = |speed: &str| {
        let plan = json(&folder, &["--vehicle", VITA_2, "--mode", "fast", "--speed", speed]);
        let mode = &plan["modes"][0];
        (mode["spacing"]["t_max_m"].as_f64().unwrap(), mode["meets_target"].clone())
    };
    let [(slow_m, slow), (fast_m, fast)] = ["0.112", "0.116"].map(at);
    assert!(slow_m < fast_m && fast_m < 0.5, "{slow_m} {fast_m}");
    assert_eq!([slow, fast], [true, false]);
}

#[test]
fn plan_at_v_max_has_a_spacing_equal_to_the_target() {
    let folder = Folder::new();
    for tunnel in ["ceran", "rectangle,width_m=4,height_m=3", "circle,radius_m=1.2"] {
        for layout in ["phase_shift", "sector_offset"] {
            let args = ["--tunnel", tunnel, "--heads", "2", "--layout", layout, "--mode", "medium"];
            let there = json(&folder, &[&args[..], &["--target", "0.7"]].concat());
            let v_mps = there["modes"][0]["v_max_mps"].as_f64().unwrap();
            let back = json(&folder, &[&args[..], &["--speed", &v_mps.to_string()]].concat());
            let t_m = back["modes"][0]["spacing"]["t_max_m"].as_f64().unwrap();
            assert!((t_m - 0.7).abs() < 1e-9, "{tunnel} {layout}: {t_m}");
        }
    }
}

#[test]
fn measured_turn_times_of_a_vehicle_file_override_the_table() {
    let folder = Folder::new();
    let measured = "mode = \"fast\"\nrange_m = 5\nturn_period_s = 6\n\
                    [[sensors.measured_turns]]\nmode = \"slow\"\nrange_m = 4\nturn_period_s = 15\n\
                    [[sensors.measured_turns]]\nmode = \"slow\"\nrange_m = 10\nturn_period_s = 21\n";
    let vehicle = format!(
        "target_m = 0.5\n[tunnel]\nprofile = \"circle\"\nradius_m = 3\n\
         [[sensors]]\nid = \"sonar\"\nplugin = \"imagenex881\"\n{measured}"
    );
    folder.write("vehicle.toml", vehicle);
    let found = json(&folder, &["--vehicle", "vehicle.toml"]);
    let turn = |name: &str| {
        let mode = found["modes"].as_array().unwrap().iter().find(|mode| mode["mode"] == name).unwrap();
        (mode["turn_s"].as_f64().unwrap(), mode["turn_basis"].as_str().unwrap().to_owned())
    };
    assert_eq!(turn("fast"), (6.0, "measured".to_owned()));
    // Turn times were measured at ranges of 4 m and 10 m. The range of 5 m is a sixth of the way between them.
    assert_eq!(turn("slow"), (16.0, "estimated".to_owned()));
    // A range that is shorter by 5 m shortens the sound path of each of the 600 pings by 10 m. At 1500 m/s this saves 4
    // s per turn.
    let (medium_s, basis) = turn("medium");
    assert!((medium_s - (10.8 - 600.0 * 10.0 / 1500.0)).abs() < 1e-6 && basis == "estimated", "{medium_s}");
}

#[test]
fn impossible_plans_are_refused_with_the_reason() {
    let folder = Folder::new();
    folder.write("bow.csv", "y_m,z_m\n-1,0\n1,0\n-1,2\n1,2\n");
    let vehicle = |more: &str| {
        format!(
            "target_m = 0.5\n{more}[tunnel]\nprofile = \"circle\"\nradius_m = 3\n\
             [[sensors]]\nid = \"sonar\"\nplugin = \"imagenex881\"\nmode = \"fast\"\n"
        )
    };
    folder.write("sectors.toml", vehicle("heads = { layout = \"sector_offset\" }\n"));
    folder.write("hull.toml", vehicle("hull = [{ least_m = [0, 0, 1], most_m = [1, 1, 0] }]\n"));
    folder.write(
        "sensors.toml",
        vehicle("").replace("imagenex881", "tether_hid").replace("mode = \"fast\"", "counts_per_metre = 1"),
    );
    let cases: [&[&str]; 17] = [
        &[],
        &["--vehicle", "sectors.toml"],
        &["--vehicle", "hull.toml"],
        &["--vehicle", "sensors.toml"],
        &["--tunnel", "ceran"],
        &["--tunnel", "egg", "--target", "0.5"],
        &["--tunnel", "circle,radius_m=-3", "--target", "0.5"],
        &["--tunnel", "circle,radius=3", "--target", "0.5"],
        &["--tunnel", "bow.csv", "--target", "0.5"],
        &["--tunnel", "ceran", "--target", "0.5", "--layout", "sector_offset"],
        &["--tunnel", "ceran", "--target", "0.5", "--drift", "8"],
        &["--tunnel", "ceran", "--target", "0.5", "--at", "9,1"],
        &["--tunnel", "ceran", "--target", "0.5", "--mode", "hasty"],
        &["--tunnel", "ceran", "--target", "0.5", "--range", "7"],
        &["--tunnel", "ceran", "--speed", "0"],
        &["--tunnel", "ceran", "--speed=-0.2"],
        &["--tunnel", "ceran", "--target", "nan"],
    ];
    let mut said = String::new();
    for args in cases {
        let answer = plan(&folder, args);
        assert_eq!((answer.code, answer.stdout.as_str()), (Some(2), ""), "{args:?}");
        writeln!(said, "{}\n    {}", args.join(" "), answer.stderr.lines().next().unwrap()).unwrap();
    }
    insta::assert_snapshot!(said, @r#"
        headrace: plan: needs --tunnel or --vehicle
    --vehicle sectors.toml
        headrace: sectors.toml:2: heads.layout = "sector_offset": sector offset divides a turn among heads: it needs at least 2, not 1
    --vehicle hull.toml
        headrace: hull.toml:2: hull[0].most_m = [1, 1, 0]: must be larger than least_m in each of x, y, z
    --vehicle sensors.toml
        headrace: plan: sensors.toml has no profiling head
    --tunnel ceran
        headrace: planning: nothing to plan: give a target, a speed or a time
    --tunnel egg --target 0.5
        headrace: --tunnel:1: profile = "egg": must be one of ceran, ceran-blueprint, rectangle, circle, arch, trimmed_circle, polyline
    --tunnel circle,radius_m=-3 --target 0.5
        headrace: --tunnel:2: radius_m = -3: must be a number from 0.1 to 200
    --tunnel circle,radius=3 --target 0.5
        headrace: --tunnel:2: radius: is not a key here; did you mean radius_m?
    --tunnel bow.csv --target 0.5
        headrace: --tunnel:2: file = "bow.csv": line 2: the profile isn't star-shaped about (-1, 0): it runs backwards or crosses itself at vertex 0, counted from 0
    --tunnel ceran --target 0.5 --layout sector_offset
        headrace: planning: sector offset divides a turn among heads: it needs at least 2, not 1
    --tunnel ceran --target 0.5 --drift 8
        headrace: planning: a head at y = 0.000 m, z = -4.908 m is outside the tunnel's profile
    --tunnel ceran --target 0.5 --at 9,1
        headrace: planning: a head at y = 9.000 m, z = 1.000 m is outside the tunnel's profile
    --tunnel ceran --target 0.5 --mode hasty
        headrace: --mode hasty: expected all or one of slow, medium, fast, faster, fastest
    --tunnel ceran --target 0.5 --range 7
        headrace: --range: 7 m is not a range setting of the head; it has [1, 2, 3, 4, 5, 10, 20, 30, 40, 50, 60, 80, 100]
    --tunnel ceran --speed 0
        error: invalid value '0' for '--speed <MPS>': expected a number from 0.001 to 5 m/s
    --tunnel ceran --speed=-0.2
        error: invalid value '-0.2' for '--speed <MPS>': expected a number from 0.001 to 5 m/s
    --tunnel ceran --target nan
        error: invalid value 'nan' for '--target <METRES>': expected a number from 0.01 to 20 metres
    "#);
}

#[test]
fn target_that_no_mode_meets_exits_with_1() {
    let folder = Folder::new();
    let args = ["--tunnel", "ceran", "--target", "0.02"];
    let answer = plan(&folder, &args);
    assert_eq!(answer.code, Some(1));
    assert!(answer.stdout.contains("no speed meets a target of 0.02 m"), "{}", answer.stdout);
    assert!(!answer.stdout.contains("NaN") && !answer.stdout.contains("inf"));
    let modes = &json(&folder, &args)["modes"];
    assert!(modes.as_array().unwrap().iter().all(|mode| mode["reason"] == "angular_step"));
    let drawn = plan(&folder, &[&args[..], &["--svg", "pictures"]].concat());
    assert_eq!(drawn.code, Some(2), "{}", drawn.stderr);
}

#[test]
fn pictures_are_identical_in_every_run() {
    let folder = Folder::new();
    for pictures in ["once", "twice"] {
        let answer = plan(&folder, &["--vehicle", VITA_2, "--svg", pictures]);
        assert_eq!(answer.code, Some(0), "{}", answer.stderr);
    }
    for name in ["perimeter", "pattern", "speeds", "hours"] {
        let [once, twice] = ["once", "twice"].map(|pictures| folder.read(&format!("{pictures}/{name}.svg")));
        assert!(once == twice && once.starts_with(b"<svg"), "{name}");
    }
}

/// The documents must show the pictures that the command draws now. If a change is intended, draw them again with the
/// command in docs/how-to/plan/README.md.
#[test]
fn pages_show_the_pictures_of_the_current_program() {
    let folder = Folder::new();
    let args = ["--vehicle", VITA_2, "--target", "0.5", "--mode", "fast", "--svg", "pictures"];
    assert_eq!(plan(&folder, &args).code, Some(0));
    for name in ["perimeter", "pattern", "speeds", "hours"] {
        let page = headrace_tests::root().join(format!("docs/how-to/plan/{name}.svg"));
        let shown = std::fs::read(&page).unwrap();
        assert!(
            shown == folder.read(&format!("pictures/{name}.svg")),
            "{} differs from the picture drawn now",
            page.display()
        );
    }
}

#[test]
fn lines_written_by_plan_configure_the_best_mode() {
    let folder = Folder::new();
    let written = plan(&folder, &["--vehicle", VITA_2, "--write"]);
    assert_eq!((written.code, written.stderr.as_str()), (Some(0), ""));
    let best = json(&folder, &["--vehicle", VITA_2]);
    let best = best["modes"].as_array().unwrap().iter().find(|mode| mode["best"] == true).unwrap().clone();
    let line = |key: &str| {
        let found = written.stdout.lines().find(|line| line.starts_with(key));
        found.unwrap_or_else(|| panic!("{key}: {}", written.stdout)).to_owned()
    };
    let speed_mps: f64 = line("planned_speed_mps").split_once(" = ").unwrap().1.parse().unwrap();
    let v_max_mps = best["v_max_mps"].as_f64().unwrap();
    assert!((0.0..0.001).contains(&(0.95 * v_max_mps - speed_mps)), "{speed_mps} of {v_max_mps}");
    assert_eq!(line("mode"), format!("mode = {}", best["mode"]));
    assert_eq!(written.stdout.matches("[[sensors]]").count(), 4);
    // The lines from `plan --write` replace the same keys in the vehicle file. Then `check` accepts the file and
    // computes the same v_max.
    let old = std::fs::read_to_string(VITA_2).unwrap();
    let pasted: Vec<String> = old
        .lines()
        .map(|text| match text.split(' ').next().unwrap() {
            key @ ("planned_speed_mps" | "mode" | "layout") => line(key),
            _ => text.to_owned(),
        })
        .collect();
    folder.write("pasted.toml", pasted.join("\n"));
    let checked = folder.headrace(&["check", "pasted.toml"]);
    assert_eq!(checked.code, Some(0), "{}{}", checked.stdout, checked.stderr);
    let again = json(&folder, &["--vehicle", "pasted.toml"]);
    let now =
        &again["modes"].as_array().unwrap().iter().find(|mode| mode["best"] == true).unwrap()["v_max_mps"];
    assert!((now.as_f64().unwrap() - v_max_mps).abs() < 0.003, "{now} of {v_max_mps}");
    // At the planned speed, no too-fast alert occurs once the heading is known, and every section passes.
    folder.write(
        "scene.toml",
        format!(
            "vehicle = \"pasted.toml\"\n[trajectory]\nkind = \"waypoints\"\n[[trajectory.waypoints]]\nchainage_m = 5\nstay_s = 20\n\
             [[trajectory.waypoints]]\nchainage_m = 21\nspeed_mps = {speed_mps}\n[effects]\nmotion_within_turn = {{}}\nocclusion = {{}}\n"
        ),
    );
    folder.simulate("scene.toml", "dive.mcap");
    let lines = folder.headrace(&["replay", "dive.mcap", "--json-lines"]).stdout;
    let lines: Vec<Value> = lines.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    let within = |x_m: &Value| x_m.as_f64().is_some_and(|x_m| (12.0..19.5).contains(&x_m));
    let states =
        lines.iter().filter(|line| line["type"] == "state" && within(&line["position"]["chainage_m"]));
    let conditions: Vec<&str> = states.map(|state| state["condition"].as_str().unwrap()).collect();
    assert!(
        conditions.len() > 20 && conditions.iter().all(|conditions| *conditions == "good"),
        "{conditions:?}"
    );
    let no_vehicle =
        plan(&folder, &["--tunnel", "circle,radius_m=3", "--length", "10", "--target", "0.5", "--write"]);
    assert_eq!(no_vehicle.code, Some(2), "{}", no_vehicle.stdout);
}
