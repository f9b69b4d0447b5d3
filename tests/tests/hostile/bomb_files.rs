//! Text files and foreign logs that never end, or that are far larger than is sensible.

use std::fmt::Write as _;

use headrace_tests::{Folder, SCENE, VEHICLE};

use crate::run::run;

const MOST_MIB: u64 = 200;

fn many(count: usize, line: impl Fn(usize) -> String) -> String {
    (0..count).fold(String::new(), |mut text, number| {
        writeln!(text, "{}", line(number)).unwrap();
        text
    })
}

/// The vehicle file with a profile in another file.
fn with_profile(file: &str) -> String {
    let tunnel = format!("profile = \"polyline\"\nfile = \"{file}\"\n");
    let vehicle = VEHICLE.replace("profile = \"circle\"\nradius_m = 3\n", &tunnel);
    assert_ne!(vehicle, VEHICLE);
    vehicle
}

/// An oversized file: its name, its content, the command that reads it, and the expected message.
type Bomb = (&'static str, String, &'static [&'static str], &'static str);

/// All oversized files.
#[expect(clippy::too_many_lines, reason = "a table")]
fn files() -> Vec<Bomb> {
    let check: &[&str] = &["check", "file"];
    let scene: &[&str] = &["simulate", "file", "-o", "dive.mcap"];
    let sensor = |number| format!("[[sensors]]\nid = \"d{number}\"\nplugin = \"bar100\"");
    let import = |kind: &'static str| -> &'static [&'static str] {
        match kind {
            "csv" => &[
                "import",
                "file",
                "--format",
                "csv",
                "--map",
                "map.toml",
                "--vehicle",
                "vehicle.toml",
                "-o",
                "x.mcap",
            ],
            "rosbag" => {
                &["import", "file", "--format", "rosbag", "--vehicle", "vehicle.toml", "-o", "x.mcap"]
            }
            "ping" => &["import", "file", "--format", "ping", "--source", "a=ping", "-o", "x.mcap"],
            "candump" => &["import", "file", "--format", "candump", "--source", "a=can0", "-o", "x.mcap"],
            _ => &["import", "file", "--format", "tlog", "--source", "a=mavlink", "-o", "x.mcap"],
        }
    };
    vec![
        (
            "a vehicle of 1 MiB",
            format!("{VEHICLE}#{}", "x".repeat(1 << 20)),
            check,
            "at most 1048576 are allowed",
        ),
        (
            "a vehicle of 17 MiB",
            format!("{VEHICLE}#{}", "x".repeat(17 << 20)),
            check,
            "it is longer than 16777216 bytes",
        ),
        (
            "100,000 unknown keys",
            many(100_000, |n| format!("k{n:x}=0")),
            check,
            "has more errors; these are the first 100",
        ),
        (
            "500,000 lines that are no TOML",
            many(500_000, |_| "x".to_owned()),
            check,
            "has more errors; these are the first 100",
        ),
        (
            "70,000 sensors without keys",
            VEHICLE.to_owned() + &"[[sensors]]\n".repeat(70_000),
            check,
            "tables; at most 2000 are allowed",
        ),
        (
            "20,000 sensors",
            VEHICLE.to_owned() + &many(20_000, sensor),
            check,
            "tables; at most 2000 are allowed",
        ),
        (
            "70,000 openings",
            VEHICLE.to_owned() + &"[[openings]]\n".repeat(70_000),
            check,
            "tables; at most 2000 are allowed",
        ),
        ("tables in tables", format!("a={}", "[".repeat(500_000)), check, "recurs"),
        ("a key of 400,000 parts", format!("{}=1", ["a"; 400_000].join(".")), check, "recursion limit"),
        ("300,000 arrays", format!("a=[{}]", "[],".repeat(300_000)), check, "is not a key here"),
        (
            "a profile that never ends",
            with_profile("/dev/zero"),
            check,
            "it is a pipe, a device or a socket; a file is required",
        ),
        (
            "a profile that is a pipe",
            with_profile("pipe"),
            check,
            "it is a pipe, a device or a socket; a file is required",
        ),
        ("a profile of 400,000 points", with_profile("points.csv"), check, "has more than 100000 points"),
        ("a profile of 30 MB", with_profile("long.csv"), check, "it is longer than 16777216 bytes"),
        (
            "a scene at 1e-300 m/s",
            change(SCENE, "speed_mps = ", "speed_mps = 1e-300 # "),
            scene,
            "must be at least 0.001 either way",
        ),
        ("a scene of 1e300 m", change(SCENE, "distance_m = ", "distance_m = 1e300 # "), scene, "1e300"),
        (
            "a scene whose vehicle never ends",
            change(SCENE, "vehicle = ", "vehicle = \"/dev/zero\" # "),
            scene,
            "it is a pipe, a device or a socket",
        ),
        (
            "a table in one line of 40 MB",
            "t,depth\n".to_owned() + &"1".repeat(40 << 20),
            import("csv"),
            "no row within 64 KiB",
        ),
        (
            "a bag with a chunk of 4 GiB",
            "#ROSBAG V2.0\n".to_owned()
                + "\u{1f}\0\0\0\u{4}\0\0\0op=\u{5}\u{f}\0\0\0compression=bz2"
                + &"\0".repeat(1 << 20),
            import("rosbag"),
            "",
        ),
        (
            "a log of pings with a text of 2 GiB",
            "\0\0\0\x34PingViewer".to_owned() + &"\u{7f}".repeat(3 << 20),
            import("ping"),
            "",
        ),
        (
            "a candump in one line of 40 MB",
            "(1436509052.249713) can0 044#".to_owned() + &"A".repeat(40 << 20),
            import("candump"),
            "",
        ),
        ("telemetry of entry beginnings only", "\0\0\0\0\0\0\0\0\u{7e}".repeat(1 << 20), import("tlog"), ""),
    ]
}

fn change(text: &str, from: &str, to: &str) -> String {
    let changed = text.replacen(from, to, 1);
    assert_ne!(changed, text, "{from}");
    changed
}

#[test]
fn oversized_files_are_refused_with_the_limit() {
    let folder = Folder::new();
    folder.write("vehicle.toml", VEHICLE);
    folder.write("map.toml", "time_column = \"t\"\n[[columns]]\ncolumn = \"depth\"\nsensor = \"depth\"\nquantity = \"pressure\"\nunit = \"Pa\"\n");
    folder.write("points.csv", many(400_000, |n| format!("{n},1")));
    folder.write("long.csv", "1.25,2.5\n".repeat(3_500_000));
    rustix::fs::mknodat(
        rustix::fs::CWD,
        folder.path("pipe"),
        rustix::fs::FileType::Fifo,
        rustix::fs::Mode::RUSR,
        0,
    )
    .unwrap();
    let mut wrong = Vec::new();
    println!("| file | bytes | code | MiB | s |");
    for (name, content, arguments, expected_text) in files() {
        folder.write("file", &content);
        let ran = run(&folder, arguments);
        println!("| {name} | {} | {:?} | {} | {:.2} |", content.len(), ran.code, ran.most_mib, ran.took_s);
        let is_reported = ran.stderr.contains(expected_text);
        let refused = matches!(ran.code, Some(1..=3));
        if !is_reported || !refused || ran.most_mib >= MOST_MIB || ran.stderr.len() > 100_000 {
            let start: String = ran.stderr.chars().take(400).collect();
            wrong.push(format!("{name}: {:?} {} MiB {start}", ran.code, ran.most_mib));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// The files contain long lists of one-letter names, because such lists need the most memory per byte.
#[test]
fn dbc_files_of_any_length_stay_within_the_memory_limit() {
    let folder = Folder::new();
    let signals = "[sensors.signals]\nrate = [\"GyroX\", \"GyroY\", \"GyroZ\"]\nforce = [\"AccX\", \"AccY\", \"AccZ\"]\n\
        quaternion = [\"QuatW\", \"QuatX\", \"QuatY\", \"QuatZ\"]\n";
    folder.write(
        "vehicle.toml",
        change(VEHICLE, "preset = \"xsens_mti600\"\n", &format!("dbc = \"unit.dbc\"\n{signals}")),
    );
    let unit = include_str!("../../../plugins/imu_can/dbc/xsens_mti600.dbc");
    for (bytes, code) in [((1 << 20) - 16, 0), (4 << 20, 2)] {
        for list in ["BU_: ", "SIG_GROUP_ 1 g 1: ", "VAL_TABLE_ t "] {
            let entry = if list.starts_with("VAL") { "0 \"\" " } else { "A " };
            let names = format!("{list}{};\n", entry.repeat((bytes - unit.len() - list.len()) / entry.len()));
            let text = if list.starts_with("BU_") {
                change(unit, "BU_:", names.trim_end_matches(";\n"))
            } else {
                format!("{unit}{names}")
            };
            folder.write("unit.dbc", text);
            let ran = run(&folder, &["check", "vehicle.toml"]);
            assert_eq!(ran.code, Some(code), "{list} {bytes}: {}", ran.stderr);
            assert!(ran.most_mib < MOST_MIB, "{list} {bytes}: {} MiB", ran.most_mib);
        }
    }
}

#[test]
fn pipe_or_device_instead_of_a_file_does_not_block() {
    let folder = Folder::new();
    rustix::fs::mknodat(
        rustix::fs::CWD,
        folder.path("pipe"),
        rustix::fs::FileType::Fifo,
        rustix::fs::Mode::RUSR,
        0,
    )
    .unwrap();
    for file in ["pipe", "/dev/zero"] {
        for arguments in [
            &["check", file][..],
            &["replay", file],
            &["verify", file],
            &["recover", file, "-o", "x.mcap"],
            &["simulate", file, "-o", "x.mcap"],
            &["import", file, "--format", "ping", "--source", "a=ping", "-o", "x.mcap"],
        ] {
            let ran = run(&folder, arguments);
            assert_eq!(ran.code, Some(2), "{arguments:?}");
            assert!(
                ran.stderr.contains("it is a pipe, a device or a socket; a file is required"),
                "{}",
                ran.stderr
            );
        }
    }
}
