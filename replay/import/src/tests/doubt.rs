//! Tests that doubt in a foreign log is encoded, or withheld and counted, and never becomes certainty.

use headrace_config::{ConfigError, Document};
use headrace_devices::KINDS;
use headrace_geometry::math;
use headrace_vehicle::VehicleConfig;

use super::formats::cut;
use crate::csv::Csv;
use crate::emulated::TOO_UNCERTAIN;
use crate::entry::{Clock, Entry, ImportReport};
use crate::ping::PingFormat;
use crate::ros::{Encoding, Feeds, Topic, Type};

const VEHICLE: &str = "target_m = 1
[tunnel]
profile = \"circle\"
radius_m = 3
length_m = 100
[water]
sound_speed_mps = 1480
density_kgpm3 = 1000
[[sensors]]
id = \"ping\"
plugin = \"ping1d\"
[[sensors]]
id = \"lidar\"
plugin = \"mavlink\"
part = \"distance\"
[[sensors]]
id = \"dvl\"
plugin = \"a50\"
[[sensors]]
id = \"depth\"
plugin = \"mavlink\"
part = \"pressure\"
[[sensors]]
id = \"imu\"
plugin = \"imu_can\"
preset = \"xsens_mti600\"
[[sensors]]
id = \"head\"
plugin = \"imagenex881\"
mode = \"fastest\"
range_m = 10
";

fn vehicle() -> VehicleConfig {
    let none = |_: &str| Err("is none".to_owned());
    VehicleConfig::parse(Document::new("vehicle", VEHICLE), &KINDS, &none).unwrap()
}

/// A column of a mapping: the quantity's name is the column's name, and `further` has the other keys.
fn column(sensor: &str, quantity: &str, further: &str) -> String {
    format!(
        "[[columns]]\ncolumn = \"{quantity}\"\nsensor = \"{sensor}\"\nquantity = \"{quantity}\"\n{further}\n"
    )
}

fn table(columns: &[String], text: &str) -> Result<Csv, ConfigError> {
    let mapping = format!("time_column = \"t\"\n{}", columns.concat());
    Csv::new(&Document::new("mapping", &mapping).root()?, &vehicle(), text)
}

/// Reads a table. Returns its entries and the reasons of its losses.
fn read(columns: &[String], text: &str) -> (Vec<Entry>, Vec<&'static str>) {
    let (entries, lost, _) = cut(&mut table(columns, text).unwrap(), text.as_bytes());
    (entries, lost.into_iter().map(|(_, why)| why).collect())
}

fn text(entry: &Entry) -> String {
    String::from_utf8_lossy(&entry.bytes).into_owned()
}

fn velocity(further: &[String]) -> Vec<String> {
    let axes = ["velocity_x", "velocity_y", "velocity_z"].map(|axis| column("dvl", axis, "unit = \"m/s\""));
    [&axes[..], further].concat()
}

#[test]
fn confidence_of_a_table_becomes_that_of_the_echosounder() {
    let columns = |id| [column(id, "range", "unit = \"m\""), column(id, "confidence", "unit = \"percent\"")];
    let rows = "t,range,confidence\n1,2.5,37\n2,2.5,100\n3,2.5,101\n4,2.5,\n";
    let (entries, lost) = read(&columns("ping"), rows);
    // The confidence follows the header of eight bytes and the distance of four.
    let confidences: Vec<u8> = entries.iter().map(|entry| entry.bytes[12]).collect();
    assert_eq!(confidences, [37, 100]);
    assert_eq!(lost.len(), 2, "{lost:?}");
    assert!(lost.iter().all(|why| why.starts_with("rows whose confidence")), "{lost:?}");
    let (entries, _) = read(&columns("lidar"), rows);
    // The quality is the last byte before the checksum.
    let qualities: Vec<u8> = entries.iter().map(|entry| entry.bytes[entry.bytes.len() - 3]).collect();
    assert_eq!(qualities, [37, 100]);
}

#[test]
fn validity_status_and_figure_of_merit_of_a_table_become_those_of_the_velocity_log() {
    let further =
        [column("dvl", "valid", ""), column("dvl", "status", ""), column("dvl", "sd", "unit = \"m/s\"")];
    let rows = "t,velocity_x,velocity_y,velocity_z,valid,status,sd\n\
                1,0.1,0,0,1,0,0.015625\n2,0.1,0,0,false,0,0.25\n3,0.1,0,0,1,4,0.25\n4,0.1,0,0,1,0,0.015625\n\
                5,0.1,0,0,1,0,0.25\n";
    let (entries, lost) = read(&velocity(&further), rows);
    let lines: Vec<String> = entries.iter().map(text).collect();
    // The navigation assumes 0.02 m/s, the default of `velocity_sd_mps`, for each valid velocity.
    assert_eq!((lines.len(), &lost[..]), (4, &[TOO_UNCERTAIN][..]));
    for (line, words) in lines.iter().zip([
        ["\"fom\":0.015625,", "\"velocity_valid\":true,\"status\":0,"],
        ["\"fom\":0.25000000000000006,", "\"velocity_valid\":false,\"status\":0,"],
        ["\"fom\":0.25,", "\"velocity_valid\":true,\"status\":4,"],
        // Equal figures of merit alternate by one unit in the last place, because equal reports count as repeats.
        ["\"fom\":0.015625000000000003,", "\"velocity_valid\":true,\"status\":0,"],
    ]) {
        assert!(words.iter().all(|word| line.contains(word)), "{words:?} is not in {line}");
    }
    let variance = [column("dvl", "variance", "unit = \"m2/s2\"")];
    let rows = "t,velocity_x,velocity_y,velocity_z,variance\n1,0.1,0,0,0.000244140625\n2,0.1,0,0,0.09\n";
    let (entries, lost) = read(&velocity(&variance), rows);
    assert_eq!((entries.len(), &lost[..]), (1, &[TOO_UNCERTAIN][..]));
    assert!(text(&entries[0]).contains("\"fom\":0.015625,"), "{}", text(&entries[0]));
}

#[test]
fn doubt_without_a_field_in_the_message_is_withheld_with_its_reason() {
    let pressure = column("depth", "pressure", "unit = \"Pa\"");
    for (doubt, cells, reason) in [
        (column("depth", "valid", ""), ["1", "0"], "readings marked as invalid, withheld"),
        (column("depth", "status", ""), ["0", "2"], "readings with a status other than 0, withheld"),
        // 0.02 m, the default of `depth_sd_m`, is 196 Pa.
        (column("depth", "sd", "unit = \"Pa\""), ["190", "200"], "readings whose variance exceeds the noise"),
        (column("depth", "variance", "unit = \"Pa2\""), ["36100", "1e6"], "readings whose variance exceeds"),
    ] {
        let name = doubt.split('"').nth(1).unwrap();
        let [certain, doubtful] = cells;
        let rows = format!("t,pressure,{name}\n1,150000,{certain}\n2,150000,{doubtful}\n");
        let (entries, lost) = read(&[pressure.clone(), doubt.clone()], &rows);
        assert_eq!((entries.len(), lost.len()), (1, 1), "{rows}: {lost:?}");
        assert!(lost[0].starts_with(reason), "{lost:?}");
    }
    let head = [
        column("head", "angle", "unit = \"deg\""),
        column("head", "range", "unit = \"m\""),
        column("head", "confidence", "unit = \"ratio\""),
    ];
    let (entries, lost) = read(&head, "t,angle,range,confidence\n1,0,3,0.5\n2,1,3,0.49\n");
    assert_eq!((entries.len(), lost.len()), (1, 1));
    assert!(lost[0].starts_with("readings with a confidence below 50 %"), "{lost:?}");
}

#[test]
fn head_without_an_echo_needs_no_confidence() {
    let head = [
        column("head", "angle", "unit = \"deg\""),
        column("head", "range", "unit = \"m\""),
        column("head", "confidence", "unit = \"ratio\""),
        column("head", "sd", "unit = \"m\""),
        column("head", "valid", ""),
    ];
    let rows = "t,angle,range,confidence,sd,valid\n1,0,,0,9,1\n2,2.4,,,,1\n3,4.8,3,,0,1\n4,7.2,,0,0,0\n";
    let (entries, lost) = read(&head, rows);
    assert_eq!((entries.len(), lost.len()), (2, 2), "{lost:?}");
    assert!(lost[0].starts_with("rows whose confidence") && lost[1].contains("invalid"), "{lost:?}");
}

#[test]
fn words_for_flags_are_not_numbers() {
    let columns = [
        column("ping", "range", "unit = \"m\""),
        column("ping", "confidence", "unit = \"ratio\""),
        column("ping", "sd", "unit = \"m\""),
        column("ping", "valid", ""),
        column("ping", "status", ""),
    ];
    let rows = "t,range,confidence,sd,valid,status\n1,3,1,0,true,false\n2,3,true,0,1,0\n3,3,1,false,1,0\n";
    let (entries, lost) = read(&columns, rows);
    assert_eq!((entries.len(), lost.len()), (1, 2), "{lost:?}");
    assert!(lost.iter().all(|why| why.starts_with("rows whose confidence")), "{lost:?}");
}

#[test]
fn each_lost_reading_of_a_row_is_counted() {
    let columns = [
        column("depth", "pressure", "unit = \"Pa\""),
        column("depth", "valid", ""),
        column("ping", "range", "unit = \"m\""),
        column("ping", "status", ""),
    ];
    let rows = "t,pressure,valid,range,status\n1,150000,0,3,1\n2,150000,1,3,1\n3,150000,0,3,1\n";
    let mut csv = table(&columns, rows).unwrap();
    let (entries, lost, _) = cut(&mut csv, rows.as_bytes());
    let reasons: Vec<&str> = lost.iter().map(|(_, why)| why.split(',').next().unwrap()).collect();
    let [invalid, status] = ["readings marked as invalid", "readings with a status other than 0"];
    assert_eq!((entries.len(), &reasons[..]), (1, &[invalid, status, invalid][..]));
    let losses = crate::Format::report(&csv).losses;
    assert_eq!(losses.len(), 1, "{losses:?}");
    assert!(losses[0].starts_with(status) && losses[0].contains(": 2 more, in rows"), "{losses:?}");
}

#[test]
fn table_with_the_points_of_echoes_is_refused() {
    let head = [column("head", "angle", "unit = \"deg\""), column("head", "range", "unit = \"m\"")];
    let points = (0..396).map(|bin| format!("1.0,12.5,{}.{:02}\n", bin / 40, bin % 40));
    let rows: String = core::iter::once("t,angle,range\n".to_owned()).chain(points).collect();
    let error = table(&head, &rows).err().unwrap().to_string();
    assert!(
        error.contains("three ranges of sensor \"head\" at one time and angle: the points of an echo"),
        "{error}"
    );
    // Rows for other sensors, and points without a range, lie between the points.
    let sparse = "t,angle,range\n1,12.5,3.1\n1,,\n1,12.5,\n1,12.5,3.2\n1.1,,\n1,12.5,3.3\n";
    assert!(table(&head, sparse).is_err());
    // A head that turns by a step for each ping, in a table with coarse times.
    assert!(table(&head, "t,angle,range\n1,0,3.1\n1,2.4,3.2\n1,4.8,3.3\n").is_ok());
}

/// Passes messages of ROS 1 to a sensor. Returns the entries with a sensor, and the report.
fn feed(sensor: &str, type_name: &str, further: &str, messages: &[Vec<u8>]) -> (Vec<Entry>, ImportReport) {
    let known = Type::named(type_name).unwrap();
    let topic = Topic { name: "/topic".to_owned(), type_name: type_name.to_owned(), known: Ok(known) };
    let mapping = format!("[[topics]]\ntopic = \"/topic\"\nsensor = \"{sensor}\"\n{further}\n");
    let mapping = Document::new("mapping", &mapping).root().unwrap();
    let mut feeds = Feeds::mapped(&mapping, &vehicle(), core::slice::from_ref(&topic)).unwrap();
    let mut entries = Vec::new();
    for (second, message) in (1..).zip(messages) {
        // A header has a number, a timestamp and an empty frame name.
        let message = [&[0; 16][..], message].concat();
        feeds.take(&topic, Encoding::Ros1, second * 1_000_000_000, &message, &mut entries);
    }
    (entries, feeds.report())
}

fn doubles(values: &[f64]) -> Vec<u8> {
    values.iter().flat_map(|value| value.to_le_bytes()).collect()
}

#[test]
fn variance_of_a_ros_velocity_becomes_the_figure_of_merit() {
    let twist = |variances: [f64; 3]| {
        let mut covariance = [0.0; 36];
        for (at, variance) in [0, 7, 14].into_iter().zip(variances) {
            covariance[at] = variance;
        }
        doubles(&[&[0.3, 0.0, 0.0, 0.0, 0.0, 0.0][..], &covariance].concat())
    };
    let messages = [
        twist([1e6, 0.01, 0.01]),
        twist([1e-4, 0.000_244_140_625, 1e-4]),
        twist([f64::NAN, 0.0, 0.0]),
        twist([0.09, 1e-4, 1e-4]),
        // The driver doesn't know the variances.
        twist([-1.0; 3]),
    ];
    let (entries, report) = feed("dvl", "geometry_msgs/TwistWithCovarianceStamped", "", &messages);
    let lines: Vec<String> = entries.iter().map(text).collect();
    assert_eq!(lines.len(), 2);
    assert!(lines[0].contains("\"fom\":0.015625,"), "{lines:?}");
    assert!(lines.iter().all(|line| line.contains("\"velocity_valid\":true")), "{lines:?}");
    assert_eq!(report.losses, [format!("/topic: 3 {TOO_UNCERTAIN}")]);
}

#[test]
fn ros_values_with_large_variances_are_withheld() {
    let pressures = [0.0, 100.0, 1e6, -1.0].map(|variance| doubles(&[150_000.0, variance]));
    let (entries, report) = feed("depth", "sensor_msgs/FluidPressure", "", &pressures);
    assert_eq!((entries.len(), &report.losses[..]), (3, &[format!("/topic: 1 {TOO_UNCERTAIN}")][..]));
    let range = |range_m: f32, variance: f32| {
        let singles: Vec<u8> =
            [0.1, 0.0, 50.0, range_m, variance].into_iter().flat_map(f32::to_le_bytes).collect();
        [&[0][..], &singles].concat()
    };
    // The last message has no echo, because its range is beyond its limit of 50 m.
    let messages = [range(4.0, 0.0), range(4.0, 1e6), range(4.0, -1.0), range(60.0, 1e6)];
    let (entries, report) = feed("ping", "sensor_msgs/Range", "", &messages);
    assert_eq!((entries.len(), report.losses.len()), (3, 1), "{:?}", report.losses);
}

#[test]
fn parts_of_ros_inertial_messages_with_large_variances_are_withheld() {
    let imu = |variances: [f64; 4]| {
        let [tilt, heading, rate, force] = variances;
        let covariance = |x: f64, z: f64| [x, 0.0, 0.0, 0.0, x, 0.0, 0.0, 0.0, z];
        let parts = [
            &[0.0, 0.0, 0.0, 1.0][..],
            &covariance(tilt, heading),
            &[0.0; 3],
            &covariance(rate, rate),
            &[0.0, 0.0, 9.8],
            &covariance(force, force),
        ];
        doubles(&parts.concat())
    };
    // For this unit, the largest sds are 0.013 rad/s and 0.059 m/s^2.
    let messages = [
        [1e-4; 4],
        [1e6, 0.0, 0.0, 0.0],
        [0.0, 1e6, 0.0, 0.0],
        [0.0, 0.0, 4e-4, 0.0],
        [0.0, 0.0, 0.0, 0.01],
        // A tilt with an sd of 1.4 degrees is certain enough only with turn rate and specific force.
        [6e-4, 0.0, 0.0, 0.0],
        [6e-4, 0.0, 1e6, 0.0],
        // An absent orientation isn't withheld.
        [-1.0, 1e6, 0.0, 0.0],
    ];
    let (_, report) = feed("imu", "sensor_msgs/Imu", "", &messages.map(imu));
    for words in ["3 readings of orientation", "2 readings of turn rate", "1 readings of specific force"] {
        assert!(
            report.losses.iter().any(|loss| loss.contains(words)),
            "{words:?} is not in {:?}",
            report.losses
        );
    }
    assert_eq!(report.losses.len(), 3, "{:?}", report.losses);
}

#[test]
fn cloud_with_the_points_of_an_echo_is_refused() {
    let cloud = |points: Vec<[f64; 3]>| {
        let count = u32::try_from(points.len()).unwrap().to_le_bytes();
        #[expect(clippy::cast_possible_truncation, reason = "the message has single precision")]
        let points = points.iter().flatten().flat_map(|value| (*value as f32).to_le_bytes());
        [&count[..], &points.collect::<Vec<u8>>(), &[0; 4]].concat()
    };
    let echo = (1..=396).map(|bin| f64::from(bin) * 0.02).map(|range_m| [0.0, 0.6 * range_m, -0.8 * range_m]);
    let turn = (0..150)
        .map(|step| f64::from(step) * 0.0419)
        .map(|angle| [0.0, 3.0 * math::sin(angle), -3.0 * math::cos(angle)]);
    let (entries, report) =
        feed("head", "sensor_msgs/PointCloud", "", &[cloud(echo.collect()), cloud(turn.collect())]);
    assert_eq!(entries.len(), 150);
    assert_eq!(report.losses.len(), 1, "{:?}", report.losses);
    assert!(report.losses[0].starts_with("/topic: 1 messages with points behind one another on one ray"));
}

#[test]
fn ranges_are_converted_from_the_speed_of_sound_of_the_recording() {
    // The distance follows the header of eight bytes. The device assumes 1500 m/s, and the site has 1480 m/s.
    let distance_mm = |entry: &Entry| u32::from_le_bytes(entry.bytes[8..12].try_into().unwrap());
    for (key, expected_mm) in [("sound_speed_mps = 1500", 4000), ("", 4054)] {
        let range = [column("ping", "range", &format!("unit = \"m\"\n{key}"))];
        let mut csv = table(&range, "t,range\n1,4\n").unwrap();
        let (entries, _, _) = cut(&mut csv, b"t,range\n1,4\n");
        assert_eq!(distance_mm(&entries[0]), expected_mm);
        let remarks = crate::Format::report(&csv).remarks;
        assert_eq!(remarks.len(), usize::from(key.is_empty()), "{remarks:?}");
        let singles: Vec<u8> = [0.1_f32, 0.0, 50.0, 4.0].into_iter().flat_map(f32::to_le_bytes).collect();
        let (entries, report) = feed("ping", "sensor_msgs/Range", key, &[[&[0][..], &singles].concat()]);
        assert_eq!(
            (distance_mm(&entries[0]), report.remarks.len()),
            (expected_mm, usize::from(key.is_empty()))
        );
    }
}

#[test]
fn depths_and_gauge_pressures_become_absolute_pressures() {
    let site = vehicle().site;
    // The pressure in hPa follows the header of ten bytes and the time of four.
    let pressure_pa =
        |entry: &Entry| f64::from(f32::from_le_bytes(entry.bytes[14..18].try_into().unwrap())) * 100.0;
    for (quantity, keys, cell, expected_pa) in [
        ("depth", "unit = \"m\"\noffset = 0.5", "12", site.pressure_pa(12.5)),
        ("depth", "unit = \"cm\"\nfactor = -1", "-250", site.pressure_pa(2.5)),
        ("depth", "unit = \"m\"\nfactor = -1\noffset = 0.5", "-12", site.pressure_pa(12.5)),
        ("gauge_pressure", "unit = \"kPa\"", "120", site.surface_pressure_pa + 120_000.0),
        ("pressure", "unit = \"mbar\"\noffset = -3", "1503", 150_000.0),
    ] {
        let text = format!("t,{quantity}\n1,{cell}\n");
        let (entries, lost) = read(&[column("depth", quantity, keys)], &text);
        assert!(
            lost.is_empty() && (pressure_pa(&entries[0]) - expected_pa).abs() < 6.0,
            "{quantity}: {lost:?}"
        );
    }
    let both = [column("depth", "depth", "unit = \"m\""), column("depth", "pressure", "unit = \"Pa\"")];
    let error = table(&both, "t,depth,pressure\n").err().unwrap().to_string();
    assert!(error.contains("already has a column"), "{error}");
    let gauge = "quantity = \"gauge_pressure\"\nunit = \"kPa\"";
    let (entries, _) = feed("depth", "sensor_msgs/FluidPressure", gauge, &[doubles(&[120.0, 0.0])]);
    assert!((pressure_pa(&entries[0]) - site.surface_pressure_pa - 120_000.0).abs() < 6.0);
}

#[test]
fn iso_8601_times_of_a_table_give_its_clock() {
    let csv = |text: &str| {
        let mapping = format!(
            "time_column = \"t\"\ntime_unit = \"iso8601\"\n{}",
            column("ping", "range", "unit = \"m\"")
        );
        let mut csv =
            Csv::new(&Document::new("mapping", &mapping).root().unwrap(), &vehicle(), text).unwrap();
        let (entries, lost, _) = cut(&mut csv, text.as_bytes());
        (
            entries.iter().map(|entry| entry.stamp_ns).collect::<Vec<_>>(),
            lost.len(),
            crate::Format::clock(&csv),
        )
    };
    let (times, lost, clock) =
        csv("t,range\n2023-11-14T22:13:20.25Z,4\n2023-11-15T00:13:21+02:00,4\n2023-11-14T22:13:22,4\n");
    assert_eq!(times, [1_700_000_000_250_000_000, 1_700_000_001_000_000_000]);
    assert_eq!((lost, clock), (1, Clock::Utc), "a time without a zone after times with one");
    assert_eq!(csv("t,range\n2023-11-14 22:13:20,4\n").2, Clock::Local);
    assert_eq!(csv("t,range\n1700000000,4\n").1, 1);
}

#[test]
fn ping_viewer_log_of_a_ping360_is_refused_with_the_reason() {
    let file = super::formats::ping_log(2, &[("00:00:01.000", b"one")]);
    let (entries, lost, _) = cut(&mut PingFormat::default(), &file);
    assert!(entries.is_empty() && lost[0].1.starts_with("the log of a Ping360"), "{lost:?}");
}

#[test]
fn ping_viewer_times_count_from_the_start_in_the_name_of_the_file() {
    let start_ns = 1_700_000_000_250_000_000;
    let name = "20231114-221320250.bin";
    for (name, time, clock, expected_ns) in [
        (name, "00:00:01.500", Clock::Local, start_ns + 1_500_000_000),
        (name, "22:13:21.750", Clock::Local, start_ns + 1_500_000_000),
        ("dive.bin", "00:00:01.500", Clock::Own, 1_500_000_000),
        ("20231332-221320250.bin", "00:00:01.500", Clock::Own, 1_500_000_000),
    ] {
        let mut format = PingFormat::new(name);
        let (entries, ..) = cut(&mut format, &super::formats::ping_log(1, &[(time, b"one")]));
        assert_eq!(
            (entries[0].stamp_ns, crate::Format::clock(&format)),
            (expected_ns, clock),
            "{name}, {time}"
        );
        assert_eq!(crate::Format::report(&format).remarks.len(), 1);
    }
}

#[test]
fn ping_viewer_messages_after_24_h_are_counted_as_lost() {
    let file = super::formats::ping_log(1, &[("23:59:59.900", b"one"), ("", b"two"), ("", b"three")]);
    let (entries, lost, left) = cut(&mut PingFormat::default(), &file);
    assert_eq!((entries.len(), lost.len(), left), (1, 2, 0));
    assert!(lost[0].1.starts_with("messages without a time"), "{lost:?}");
}
