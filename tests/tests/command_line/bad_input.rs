//! Wrong input is refused. Every message names file, line, key, value and allowed values, and the exit code is right.
//!
//! Exit codes are 0 ok, 1 failed, 2 usage, and 3 finished with data loss. The readable part of a damaged log is used,
//! and losses are reported with their time span.

use std::fmt::Write as _;
use std::path::Path;

use headrace_tests::{Folder, SCENE, VEHICLE, raw_messages, write_log};
use mcap::{Compression, WriteOptions};
use serde_json::Value;

/// Replaces a piece of a text. The piece must occur exactly once.
fn change(text: &str, from: &str, to: &str) -> String {
    assert_eq!(text.matches(from).count(), 1, "{from:?}");
    text.replace(from, to)
}

/// Output of the program for each of the wrong texts that `cases` makes from `text`. Every run must end with a usage
/// error and write nothing to stdout.
fn refusals(command: &[&str], file: &str, text: &str, cases: &[(&str, &str, &str)]) -> String {
    let folder = Folder::with_dive();
    let mut said = String::new();
    for (what, from, to) in cases {
        folder.write(file, change(text, from, to));
        let answer = folder.headrace(command);
        assert_eq!((answer.code, answer.stdout.as_str()), (Some(2), ""), "{what}: {}", answer.stderr);
        write!(said, "{what}\n    {}", answer.stderr).unwrap();
    }
    said
}

#[test]
fn wrong_vehicle_file_is_refused_with_line_key_value_and_allowed_values() {
    let cases = [
        ("key missing", "target_m = 1.2\n", ""),
        ("key of a sensor missing", "counts_per_metre = 2000\n", ""),
        ("dimension missing", "radius_m = 3\n", ""),
        ("table missing", "[tunnel]\nprofile = \"circle\"\nradius_m = 3\nlength_m = 100\n", ""),
        ("unknown key", "target_m = 1.2", "target_m = 1.2\ncolour = \"red\""),
        ("unknown key in a table", "sound_speed_mps = 1447", "sound_speed_mps = 1447\nsalt = 3"),
        ("unknown key of a sensor", "counts_per_metre = 2000", "counts_per_metre = 2000\ncolour = \"red\""),
        ("unknown table", "[heads]\n", "[head]\n"),
        ("text in place of a number", "target_m = 1.2", "target_m = \"1.2\""),
        ("number in place of a text", "name = \"test vehicle\"", "name = 7"),
        ("number in place of a table", "[water]\nsound_speed_mps = 1447\n", "[[water]]\n"),
        ("two numbers in place of three", "angles_deg = [0, 0, 90]", "angles_deg = [0, 90]"),
        ("no number at all", "radius_m = 3", "radius_m = nan"),
        ("negative", "radius_m = 3", "radius_m = -3"),
        ("too large", "sound_speed_mps = 1447", "sound_speed_mps = 14470"),
        ("zero", "counts_per_metre = 2000", "counts_per_metre = 0"),
        (
            "not a setting of the head",
            "0.5:4040\"\nmode = \"fastest\"\nrange_m = 5",
            "0.5:4040\"\nmode = \"fastest\"\nrange_m = 7",
        ),
        ("unknown mode", "0.5:4040\"\nmode = \"fastest\"", "0.5:4040\"\nmode = \"hasty\""),
        ("same id twice", "id = \"ping_right\"", "id = \"ping_left\""),
        ("id with a space", "id = \"ping_right\"", "id = \"ping right\""),
        ("unknown plugin", "plugin = \"bar100\"", "plugin = \"bar300\""),
        ("unknown profile", "profile = \"circle\"", "profile = \"egg\""),
        ("unknown preset", "preset = \"xsens_mti600\"", "preset = \"xsens\""),
        ("not TOML", "target_m = 1.2", "target_m = = 1.2"),
        ("key twice", "target_m = 1.2", "target_m = 1.2\ntarget_m = 1.3"),
        ("text without an end", "name = \"test vehicle\"", "name = \"test vehicle"),
    ];
    insta::assert_snapshot!(refusals(&["check", "vehicle.toml"], "vehicle.toml", VEHICLE, &cases), @r#"
    key missing
        headrace: vehicle.toml:1: target_m: is missing
    key of a sensor missing
        headrace: vehicle.toml:58: sensors[8].counts_per_metre: is missing
    dimension missing
        headrace: vehicle.toml:4: tunnel.radius_m: is missing
    table missing
        headrace: vehicle.toml:1: tunnel: is missing
    unknown key
        headrace: vehicle.toml:3: colour: is not a key here; known are name, target_m, section_m, dive_hours, tunnel, water, coverage, openings, hull, sensors, navigation, heads, advice, alerts, limits
    unknown key in a table
        headrace: vehicle.toml:11: water.salt: is not a key here; known are sound_speed_mps, density_kgpm3, gravity_mps2, surface_pressure_pa, surface_above_floor_m, sound_speed_from
    unknown key of a sensor
        headrace: vehicle.toml:62: sensors[8].colour: is not a key here; known are id, plugin, position_m, angles_deg, connect, latency_ms, kind, scale, zero_at_m, rate_hz, report_id, width_bits, report_bytes, offset, signed, endian, sequence_offset, status_offset, clock_ms_offset, mode, preset, counts_per_metre, step_m, max_speed_mps
    unknown table
        headrace: vehicle.toml:12: head: is not a key here; did you mean heads?
    text in place of a number
        headrace: vehicle.toml:2: target_m = "1.2": must be a number from 0.01 to 20
    number in place of a text
        headrace: vehicle.toml:1: name = 7: must be a text in quotes
    number in place of a table
        headrace: vehicle.toml:9: water = [[water]]: must be a table
    two numbers in place of three
        headrace: vehicle.toml:32: sensors[2].angles_deg = [0, 90]: must be three numbers [a, b, c], each from -360 to 360
    no number at all
        headrace: vehicle.toml:6: tunnel.radius_m = nan: must be a number from 0.1 to 200
    negative
        headrace: vehicle.toml:6: tunnel.radius_m = -3: must be a number from 0.1 to 200
    too large
        headrace: vehicle.toml:10: water.sound_speed_mps = 14470: must be a number from 1300 to 1700
    zero
        headrace: vehicle.toml:61: sensors[8].counts_per_metre = 0: must be at least 0.1 away from zero
    not a setting of the head
        headrace: vehicle.toml:27: sensors[1].range_m = 7: switch command: range of 7; allowed are 1, 2, 3, 4, 5, 10, 20, 30, 40, 50, 60, 80, 100 m
    unknown mode
        headrace: vehicle.toml:26: sensors[1].mode = "hasty": must be one of slow, medium, fast, faster, fastest
    same id twice
        headrace: vehicle.toml:35: sensors[3].id = "ping_left": is the id of an earlier sensor; ids must differ
    id with a space
        headrace: vehicle.toml:35: sensors[3].id = "ping right": must be 1 to 32 letters, digits, _ or -
    unknown plugin
        headrace: vehicle.toml:51: sensors[6].plugin = "bar300": must be one of imagenex881, ping1d, bar100, imu_can, tether_hid, mavlink, a50; did you mean "bar100"?
    unknown profile
        headrace: vehicle.toml:5: tunnel.profile = "egg": must be one of ceran, ceran-blueprint, rectangle, circle, arch, trimmed_circle, polyline
    unknown preset
        headrace: vehicle.toml:56: sensors[7].preset = "xsens": must be one of xsens_mti600, sbg_ellipse, j1939, bosch_mm5
    not TOML
        headrace: vehicle.toml:2: TOML: extra `=`, expected nothing
    key twice
        headrace: vehicle.toml:3: TOML: duplicate key
    text without an end
        headrace: vehicle.toml:1: TOML: invalid basic string, expected `"`
    "#);
}

#[test]
fn wrong_scene_is_refused_with_line_key_value_and_allowed_values() {
    let cases = [
        ("key missing", "vehicle = \"vehicle.toml\"\n", ""),
        ("vehicle file not there", "vehicle = \"vehicle.toml\"", "vehicle = \"boat.toml\""),
        ("speed missing", "speed_mps = 0.2\n", ""),
        ("no legs", "[[trajectory.legs]]\ndistance_m = 4\nspeed_mps = 0.2\n", ""),
        ("unknown key", "start_m = 3", "start_m = 3\nend_m = 7"),
        ("unknown table", "[trajectory]", "[weather]\n[trajectory]"),
        ("unknown effect", "[trajectory]", "[effects]\nfish = 12\n[trajectory]"),
        ("text in place of a number", "start_m = 3", "start_m = \"portal\""),
        ("no distance", "distance_m = 4", "distance_m = 0"),
        ("never arrives", "speed_mps = 0.2", "speed_mps = 0"),
        ("outside the tunnel", "start_m = 3", "start_m = 3\nplace_m = [3.5, 3]"),
        ("before its beginning", "start_m = 3", "start_m = -50"),
        ("not TOML", "[trajectory]", "[trajectory"),
    ];
    let command = ["simulate", "scene.toml", "-o", "other.mcap"];
    insta::assert_snapshot!(refusals(&command, "scene.toml", SCENE, &cases), @r#"
    key missing
        headrace: scene.toml:1: vehicle: is missing
    vehicle file not there
        headrace: scene.toml:2: vehicle = "boat.toml": can't be read at boat.toml: No such file or directory (os error 2)
    speed missing
        headrace: scene.toml:7: trajectory.legs[0].speed_mps: is missing
    no legs
        headrace: scene.toml:4: trajectory.legs: has no leg; at least one table headed [[trajectory.legs]] is needed
    unknown key
        headrace: scene.toml:6: trajectory.end_m: is not a key here; known are kind, start_m, place_m, legs
    unknown table
        headrace: scene.toml:4: weather: is not a key here; known are name, seed, vehicle, vehicle_changes, tunnel, trajectory, effects, water, cable, thrusters
    unknown effect
        headrace: scene.toml:5: effects.fish: is not a key here; known are take, leave, mount_error, start_phase_error, sector_end_slowing, skipped_steps, head_stalls, motion_within_turn, beam_cone, occlusion, echo_strength, multipath, side_lobes, interference, near_returns, missing_returns, outliers, stuck_range, sound_speed_error, sound_speed_profile, range_noise, range_quantisation, current, pilot_drift, depth_noise, depth_steps, imu_noise, imu_bias, imu_vibration, imu_bumps, magnetic_disturbance, tether_slack, tether_scale, tether_slip, late_winding, tether_quantum, device_faults, clock_drift, line_delay, byte_errors
    text in place of a number
        headrace: scene.toml:5: trajectory.start_m = "portal": must be a number from -20 to 1000000
    no distance
        headrace: scene.toml:8: trajectory.legs[0].distance_m = 0: must be a number from 0.01 to 1000000
    never arrives
        headrace: scene.toml:9: trajectory.legs[0].speed_mps = 0: must be at least 0.001 either way, or the leg has no end
    outside the tunnel
        headrace: scene.toml:6: trajectory.place_m = [3.5, 3]: must be inside the tunnel's profile
    before its beginning
        headrace: scene.toml:5: trajectory.start_m = -50: must be a number from -20 to 1000000
    not TOML
        headrace: scene.toml:4: TOML: unclosed table, expected `]`
    "#);
}

#[test]
fn wrong_polyline_is_refused_with_its_line_or_vertex() {
    let folder = Folder::new();
    let tunnel = "profile = \"polyline\"\nfile = \"profile.csv\"\n";
    folder.write("vehicle.toml", change(VEHICLE, "profile = \"circle\"\nradius_m = 3\n", tunnel));
    let mut said = String::new();
    let mut refuse = |what: &str, points: Option<&str>| {
        if let Some(points) = points {
            folder.write("profile.csv", points);
        }
        let answer = folder.headrace(&["check", "vehicle.toml"]);
        assert_eq!((answer.code, answer.stdout.as_str()), (Some(2), ""), "{what}: {}", answer.stderr);
        write!(said, "{what}\n    {}", answer.stderr).unwrap();
    };
    refuse("not there", None);
    refuse("empty", Some(""));
    refuse("two points", Some("y_m,z_m\n-2,0\n2,0\n"));
    refuse("no number", Some("y_m,z_m\n-2,0\n2,zero\n2,4\n-2,4\n"));
    refuse("one number", Some("y_m,z_m\n-2,0\n2\n2,4\n-2,4\n"));
    refuse("not finite", Some("-2,0\n2,0\n2,inf\n-2,4\n"));
    // A side chamber that can't be seen from the centre, because it lies around a corner.
    refuse("not star-shaped", Some("-2,0\n2,0\n2,1\n5,1\n5,6\n4.5,6\n4.5,2\n2,2\n2,4\n-2,4\n"));
    refuse("crosses itself", Some("-2,0\n2,4\n2,0\n-2,4\n"));
    insta::assert_snapshot!(said, @r#"
    not there
        headrace: vehicle.toml:6: tunnel.file = "profile.csv": can't be read at profile.csv: No such file or directory (os error 2)
    empty
        headrace: vehicle.toml:6: tunnel.file = "profile.csv": a profile needs at least 3 distinct points; this one has 0
    two points
        headrace: vehicle.toml:6: tunnel.file = "profile.csv": a profile needs at least 3 distinct points; this one has 2
    no number
        headrace: vehicle.toml:6: tunnel.file = "profile.csv": line 3 is "2,zero"; expected two numbers: y_m,z_m
    one number
        headrace: vehicle.toml:6: tunnel.file = "profile.csv": line 3 is "2"; expected two numbers: y_m,z_m
    not finite
        headrace: vehicle.toml:6: tunnel.file = "profile.csv": line 3: vertex 2 has a coordinate that is not a number within 1000 m
    not star-shaped
        headrace: vehicle.toml:6: tunnel.file = "profile.csv": line 6: the profile isn't star-shaped about (0.9523809523809526, 2.119047619047619): it runs backwards or crosses itself at vertex 5, counted from 0
    crosses itself
        headrace: vehicle.toml:6: tunnel.file = "profile.csv": line 1: the profile isn't star-shaped about (-2, 0): it runs backwards or crosses itself at vertex 0, counted from 0
    "#);
}

#[test]
fn log_replays_without_the_polyline_file() {
    let folder = Folder::new();
    let tunnel = "profile = \"polyline\"\nfile = \"profile.csv\"\n";
    folder.write("vehicle.toml", change(VEHICLE, "profile = \"circle\"\nradius_m = 3\n", tunnel));
    folder.write("profile.csv", "y_m,z_m\n-2,0\n2,0\n2,4\n-2,4\n");
    folder.write("scene.toml", SCENE);
    folder.simulate("scene.toml", "dive.mcap");
    let digest = folder.digest("dive.mcap", &["--vehicle", "vehicle.toml"]);
    std::fs::remove_file(folder.path("profile.csv")).unwrap();
    assert_eq!(folder.digest("dive.mcap", &[]), digest);
}

#[test]
fn log_replays_without_the_dbc_file() {
    let folder = Folder::new();
    let dbc = include_str!("../../../plugins/imu_can/dbc/xsens_mti600.dbc");
    let keys = "dbc = \"imu.dbc\"\nsignals = { rate = [\"GyroX\", \"GyroY\", \"GyroZ\"], force = [\"AccX\", \"AccY\", \"AccZ\"], \
                quaternion = [\"QuatW\", \"QuatX\", \"QuatY\", \"QuatZ\"], sample_time = \"SampleTime\" }\n";
    folder.write("vehicle.toml", change(VEHICLE, "preset = \"xsens_mti600\"\n", keys));
    folder.write("scene.toml", SCENE);
    folder.write("imu.dbc", dbc.replace("SG_ GyroY : 23|16@0-", "SG_ GyroY : 23|16@3-"));
    let answer = folder.headrace(&["check", "vehicle.toml"]);
    assert_eq!(answer.code, Some(2), "{}", answer.stderr);
    assert!(answer.stderr.contains("imu.dbc:43: DBC: \"SG_ GyroY : 23|16@3-"), "{}", answer.stderr);

    folder.write("imu.dbc", dbc);
    folder.simulate("scene.toml", "dive.mcap");
    let (_, report) = folder.replay("dive.mcap", &["--vehicle", "vehicle.toml"]);
    let imu = report["sources"].as_array().unwrap().iter().find(|source| source["id"] == "imu").unwrap();
    assert_eq!(imu["device_clock"]["restarts"], 0);
    assert!(imu["device_clock"]["drift_ppm"].as_f64().unwrap().abs() < 1.0, "{imu}");
    std::fs::remove_file(folder.path("imu.dbc")).unwrap();
    assert_eq!(folder.digest("dive.mcap", &[]), report["digest"].as_str().unwrap());
}

/// Writes a log of the short dive with its vehicle file, in chunks of about a second.
fn chunked_log(folder: &Folder, log: &str) -> usize {
    let dive = folder.read("dive.mcap");
    let messages = raw_messages(&dive);
    let options = WriteOptions::new().compression(Some(Compression::Lz4)).chunk_size(Some(32 << 10));
    write_log(&folder.path(log), options, Some(VEHICLE), &messages);
    messages.len()
}

fn losses(report: &Value) -> Vec<&str> {
    report["log"]["losses"].as_array().unwrap().iter().map(|loss| loss.as_str().unwrap()).collect()
}

/// The dive time after `word` in a loss such as "after 9.800 s".
fn seconds(loss: &str, word: &str) -> f64 {
    let (_, rest) = loss.split_once(word).unwrap_or_else(|| panic!("no {word:?} in {loss:?}"));
    rest.split_whitespace().next().unwrap().parse().unwrap()
}

/// Replaces every number with #, because the test compares only the words.
fn without_numbers(text: &str) -> String {
    let mut short = String::new();
    for c in text.chars().map(|c| if c.is_ascii_digit() { '#' } else { c }) {
        if !(c == '#' && short.ends_with('#')) {
            short.push(c);
        }
    }
    short
}

#[test]
fn truncated_log_is_used_up_to_the_cut_and_the_rest_reported_lost() {
    let folder = Folder::with_dive();
    let count = chunked_log(&folder, "chunked.mcap");
    let dive = folder.read("dive.mcap");
    let messages = raw_messages(&dive);
    for log in ["dive.mcap", "chunked.mcap"] {
        let whole = folder.read(log);
        let mut read_before = 0;
        for tenths in [1, 3, 5, 7, 9] {
            folder.write("cut.mcap", &whole[..whole.len() * tenths / 10]);
            let (code, report) = folder.replay("cut.mcap", &[]);
            assert_eq!(code, Some(3), "{log} {tenths}");
            let read = usize::try_from(report["log"]["messages"].as_u64().unwrap()).unwrap();
            assert!(read_before <= read && read <= count, "{log} {tenths}: {read} of {count}");
            read_before = read;
            let losses = losses(&report);
            assert_eq!(losses.len(), 1, "{losses:?}");
            if read == 0 {
                continue;
            }
            let last_s = (messages[read - 1].log_time - messages[0].log_time) as f64 * 1e-9;
            assert!((seconds(losses[0], "after") - last_s).abs() < 1e-3, "{losses:?}, last {last_s}");

            // The readable part of the damaged log gives the same results as an intact log with only the messages of
            // this part.
            write_log(&folder.path("short.mcap"), WriteOptions::new(), Some(VEHICLE), &messages[..read]);
            let (_, short) = folder.replay("short.mcap", &[]);
            assert_eq!(report["digest"], short["digest"], "{log} {tenths}");
            assert_eq!(report["sections"], short["sections"], "{log} {tenths}");
        }
        assert!(read_before > 0);
    }

    folder.write("cut.mcap", &dive[..dive.len() / 5]);
    let answer = folder.headrace(&["replay", "cut.mcap"]);
    assert_eq!(answer.code, Some(3));
    let lost = answer.stdout.lines().find(|line| line.contains("LOST")).unwrap();
    insta::assert_snapshot!(without_numbers(lost), @"  LOST: byte #: the file ends before its closing records (# bytes, after #.# s)");
}

#[test]
fn corrupt_log_loses_only_the_broken_chunk() {
    let folder = Folder::with_dive();
    let count = chunked_log(&folder, "chunked.mcap");
    let whole = folder.read("chunked.mcap");
    let chunks = mcap::Summary::read(&whole).unwrap().unwrap().chunk_indexes;
    assert!(chunks.len() > 10, "{}", chunks.len());
    let first_ns = chunks.iter().map(|chunk| chunk.message_start_time).min().unwrap();
    let last_ns = chunks.iter().map(|chunk| chunk.message_end_time).max().unwrap();
    for chunk in [0, chunks.len() / 2, chunks.len() - 1] {
        let chunk = &chunks[chunk];
        let middle = usize::try_from(chunk.chunk_start_offset + chunk.chunk_length / 2).unwrap();
        let mut broken = whole.clone();
        for byte in &mut broken[middle..middle + 16] {
            *byte ^= 0xFF;
        }
        folder.write("broken.mcap", broken);
        let (code, report) = folder.replay("broken.mcap", &[]);
        assert_eq!(code, Some(3));
        let read = usize::try_from(report["log"]["messages"].as_u64().unwrap()).unwrap();
        assert!(read < count && read > count * 8 / 10, "{read} of {count}");
        // The reported loss extends from the last message before the broken chunk to the first message after the chunk.
        let [loss] = losses(&report)[..] else { panic!("{:?}", losses(&report)) };
        // Dive time begins with the first packet that is left.
        let start_s = report["dive"]["start_s"].as_f64().unwrap();
        let dive_time_s = |at_ns: u64| (at_ns as f64 * 1e-9 - start_s).max(0.0);
        let close = |word, at_ns: u64| (seconds(loss, word) - dive_time_s(at_ns)).abs() < 0.02;
        assert_eq!(chunk.message_start_time > first_ns, loss.contains("after"), "{loss}");
        assert!(!loss.contains("after") || close("after", chunk.message_start_time), "{loss}");
        assert_eq!(chunk.message_end_time < last_ns, loss.contains("before"), "{loss}");
        assert!(!loss.contains("before") || close("before", chunk.message_end_time), "{loss}");
    }
}

#[test]
fn changed_byte_is_detected_or_has_no_effect() {
    let folder = Folder::with_dive();
    chunked_log(&folder, "chunked.mcap");
    for log in ["dive.mcap", "chunked.mcap"] {
        let whole = folder.read(log);
        let (_, expected) = folder.replay(log, &["--vehicle", "vehicle.toml"]);
        let mut noticed = 0;
        for k in 0..40 {
            let mut broken = whole.clone();
            let place = whole.len() * k / 40 + k;
            broken[place] ^= 1 << (k % 8);
            folder.write("broken.mcap", broken);
            let (code, report) = folder.replay("broken.mcap", &["--vehicle", "vehicle.toml"]);
            match code {
                Some(0) => assert_eq!(report["digest"], expected["digest"], "{log}, byte {place}"),
                Some(3) => {
                    assert!(!losses(&report).is_empty(), "{log}, byte {place}");
                    noticed += 1;
                }
                other => panic!("{log}, byte {place}: exit code {other:?}"),
            }
        }
        assert!(noticed > 5, "{log}: {noticed}");
    }
}

#[test]
fn file_that_is_no_log_is_refused_with_the_reason() {
    let folder = Folder::with_dive();
    folder.write("empty.mcap", "");
    folder.write("text.mcap", VEHICLE);
    let mut said = String::new();
    for log in ["empty.mcap", "text.mcap", "missing.mcap", "."] {
        let answer = folder.headrace(&["replay", log, "--vehicle", "vehicle.toml"]);
        assert!(matches!(answer.code, Some(1 | 2)), "{log}: {:?}", answer.code);
        assert_eq!(answer.stdout, "", "{log}");
        said.push_str(&answer.stderr);
    }
    insta::assert_snapshot!(said, @"
    headrace: empty.mcap is not an MCAP file: it begins with []; expected [89 4d 43 41 50 30 0d 0a]
    headrace: text.mcap is not an MCAP file: it begins with [6e 61 6d 65 20 3d 20 22]; expected [89 4d 43 41 50 30 0d 0a]
    headrace: could not open missing.mcap: No such file or directory (os error 2)
    headrace: ./dive.mcap is not a part of a recording; name one log, or only the parts of one recording
    ");
}

#[test]
fn log_without_a_vehicle_file_needs_the_vehicle_option() {
    let folder = Folder::with_dive();
    let dive = folder.read("dive.mcap");
    write_log(&folder.path("bare.mcap"), WriteOptions::new(), None, &raw_messages(&dive));
    let answer = folder.headrace(&["replay", "bare.mcap"]);
    assert_eq!((answer.code, answer.stdout.as_str()), (Some(2), ""));
    insta::assert_snapshot!(answer.stderr, @"headrace: reading bare.mcap: no vehicle file is attached to this log; give one with --vehicle");
    assert_eq!(folder.digest("bare.mcap", &["--vehicle", "vehicle.toml"]), folder.digest("dive.mcap", &[]));
}

#[test]
fn messages_of_a_source_missing_in_the_vehicle_file_are_reported_lost() {
    let folder = Folder::with_dive();
    folder.write("other.toml", change(VEHICLE, "id = \"sonar_1\"", "id = \"front\""));
    let answer = folder.headrace(&["replay", "dive.mcap", "--vehicle", "other.toml"]);
    assert_eq!(answer.code, Some(3));
    let lost = answer.stdout.lines().find(|line| line.contains("LOST")).unwrap();
    insta::assert_snapshot!(lost, @r#"  LOST: 790 messages of source "sonar_1", which the vehicle file doesn't have"#);
}

#[test]
fn dive_without_sonar_has_no_coverage_and_no_passed_section() {
    let folder = Folder::with_dive();
    let dive = folder.read("dive.mcap");
    let messages: Vec<_> =
        raw_messages(&dive).into_iter().filter(|m| !m.channel.topic.starts_with("/raw/sonar")).collect();
    write_log(&folder.path("deaf.mcap"), WriteOptions::new(), Some(VEHICLE), &messages);
    let answer = folder.headrace(&["replay", "deaf.mcap"]);
    assert_eq!(answer.code, Some(1));
    insta::assert_snapshot!(answer.stdout);
    let (code, report) = folder.replay("deaf.mcap", &[]);
    assert_eq!((code, &report["dive"]["sonar"]), (Some(1), &Value::Bool(false)));
    assert_eq!(report["summary"]["pass_m"], 0.0);
    assert!(report["sections"].as_array().unwrap().iter().all(|section| section["verdict"] != "pass"));
}

#[test]
fn wrong_arguments_are_usage_errors() {
    let folder = Folder::with_dive();
    for arguments in [
        &["replay"][..],
        &["replay", "dive.mcap", "--tick-ms", "0"],
        &["replay", "dive.mcap", "--target", "-1"],
        &["replay", "dive.mcap", "--target", "nan"],
        &["replay", "dive.mcap", "--speed", "fast"],
        &["simulate", "scene.toml"],
        &["dive"],
        &[],
    ] {
        let answer = folder.headrace(arguments);
        assert_eq!((answer.code, answer.stdout.as_str()), (Some(2), ""), "{arguments:?}");
        assert!(!answer.stderr.is_empty(), "{arguments:?}");
    }
    assert!(!Path::new(&folder.path("other.mcap")).exists());
}

#[test]
fn every_command_has_help_with_an_example() {
    let folder = Folder::new();
    let help = folder.headrace(&["--help"]).stdout;
    let (_, list) = help.split_once("Commands:\n").unwrap();
    let commands: Vec<&str> = list
        .lines()
        .take_while(|line| !line.is_empty())
        .filter_map(|line| line.split_whitespace().next())
        .collect();
    assert!(commands.contains(&"replay") && commands.contains(&"demo"), "{commands:?}");
    for command in commands.into_iter().filter(|command| *command != "help") {
        let answer = folder.headrace(&[command, "--help"]);
        // The commands `campaign`, `batch` and `cost` run another program. If that program is missing, the message says
        // how to build it.
        if ["campaign", "batch", "cost"].contains(&command) && answer.code == Some(2) {
            assert!(
                answer.stderr.contains("cargo build --release --manifest-path lab/Cargo.toml -p headrace_c"),
                "{}",
                answer.stderr
            );
            continue;
        }
        assert_eq!((answer.code, answer.stderr.as_str()), (Some(0), ""), "{command}");
        assert!(answer.stdout.contains(&format!("Example:\n  headrace {command}")), "{}", answer.stdout);
    }
}

#[test]
fn wrong_log_is_a_usage_error_and_leaves_no_file() {
    let folder = Folder::new();
    folder.write("vehicle.toml", VEHICLE);
    folder.write("empty.mcap", "");
    folder.write("gzip.mcap", [0x1f, 0x8b, 8, 0, 0, 0, 0, 0, 0, 3]);
    std::fs::create_dir(folder.path("folder.mcap")).unwrap();
    let mut wrong = vec!["none.mcap", "empty.mcap", "gzip.mcap", "folder.mcap", "vehicle.toml"];
    let fifo = std::process::Command::new("mkfifo").arg(folder.path("fifo.mcap")).status();
    if fifo.is_ok_and(|status| status.success()) {
        wrong.push("fifo.mcap");
    }
    for log in wrong {
        for command in [
            &["replay", log][..],
            &["verify", log],
            &["notes", log],
            &["calibrate", log],
            &["recover", log, "-o", "out.mcap"],
            &["trim", log, "-o", "out.mcap"],
            &["export", log, "--html", "out.mcap"],
            &["run", "vehicle.toml", "--source", log, "--record", "out.mcap"],
        ] {
            let answer = folder.headrace(command);
            let said = (answer.code, answer.stdout.as_str());
            assert_eq!(said, (Some(2), ""), "{command:?}: {}", answer.stderr);
            assert!(answer.stderr.contains(log), "{command:?}: {}", answer.stderr);
            assert!(!folder.path("out.mcap").exists(), "{command:?}");
        }
    }
}
