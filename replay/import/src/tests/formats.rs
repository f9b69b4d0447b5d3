//! Tests of the file formats with constructed and arbitrary bytes.

use headrace_config::Document;
use headrace_devices::KINDS;
use headrace_mavlink::MavHeader;
use headrace_mavlink::dialect::ATTITUDE_DATA;
use headrace_mavlink::message::Message;
use headrace_vehicle::VehicleConfig;
use proptest::prelude::*;

use crate::csv::Csv;
use crate::imagenex::ImagenexFormat;
use crate::ping::PingFormat;
use crate::tlog::TlogFormat;
use crate::{Entry, Format, Step};

/// Splits a file by a format. Returns the entries, the lengths of the losses with their reasons, and the number of
/// bytes left at the end of the file.
pub(crate) fn cut(
    format: &mut dyn Format,
    mut file: &[u8],
) -> (Vec<Entry>, Vec<(usize, &'static str)>, usize) {
    let (mut entries, mut lost) = (Vec::new(), Vec::new());
    while !file.is_empty() {
        let used = match format.step(file, true, &mut entries) {
            Step::Took(used) => used,
            Step::Lost(used, why) => {
                lost.push((used, why));
                used
            }
            Step::Held => continue,
            Step::More => break,
        };
        assert!((1..=file.len()).contains(&used), "{used} of {} bytes", file.len());
        file = &file[used..];
    }
    (entries, lost, file.len())
}

fn frame(sequence: u8) -> Vec<u8> {
    // MAVLink drops trailing zeros of a frame. The last field isn't zero, so that the frame has all its 28 bytes.
    let attitude = ATTITUDE_DATA { yawspeed: 1.0, ..ATTITUDE_DATA::DEFAULT };
    let frame = Message::Attitude(attitude).to_frame(MavHeader { system_id: 1, component_id: 1, sequence });
    frame.raw_bytes().to_vec()
}

fn tlog(numbers: core::ops::Range<u8>) -> Vec<u8> {
    let stamp = |n: u8| (1_600_000_000_000_000 + u64::from(n)).to_be_bytes().to_vec();
    numbers.flat_map(|n| [stamp(n), frame(n)].concat()).collect()
}

fn text(text: &str) -> Vec<u8> {
    let units: Vec<u8> = text.encode_utf16().flat_map(u16::to_be_bytes).collect();
    [&u32::try_from(units.len()).unwrap().to_be_bytes()[..], &units].concat()
}

/// Builds a log of Ping Viewer for a type of sensor: 1 for a Ping echosounder.
pub(super) fn ping_log(sensor_type: u8, records: &[(&str, &[u8])]) -> Vec<u8> {
    let mut file = text("PingViewer sensor log file");
    file.extend(1_u32.to_be_bytes());
    for words in ["abc", "2024-01-01", "v2.4", "Linux", "12"] {
        file.extend(text(words));
    }
    file.extend([0, 0, 0, 1, 0, 0, 0, sensor_type]);
    for (time, message) in records {
        file.extend(text(time));
        file.extend(u32::try_from(message.len()).unwrap().to_be_bytes());
        file.extend_from_slice(message);
    }
    file
}

fn shot(seconds: u8) -> Vec<u8> {
    let mut shot = vec![0; 128];
    shot[..8].copy_from_slice(b"81A\0\0\x80\0\x0D");
    shot[8..19].copy_from_slice(b"18-Nov-2016");
    shot[20..32].copy_from_slice(format!("19:29:{seconds:02}\0.17").as_bytes());
    shot[100] = b'I';
    shot
}

#[test]
fn telemetry_log_reader_finds_the_next_frame_after_damage() {
    let (entries, lost, left) = cut(&mut TlogFormat::default(), &tlog(0..3));
    assert_eq!((entries.len(), lost.len(), left), (3, 0, 0));
    assert_eq!((entries[2].stamp_ns, &entries[2].bytes), (1_600_000_000_000_002_000, &frame(2)));
    let damaged = [tlog(0..2), vec![0xAB; 37], tlog(2..4)].concat();
    let (entries, lost, left) = cut(&mut TlogFormat::default(), &damaged);
    assert_eq!((entries.len(), lost.len(), left), (4, 37, 0));
    let mut flipped = tlog(0..3);
    flipped[8 + frame(0).len() + 8 + 20] ^= 1;
    let (entries, lost, left) = cut(&mut TlogFormat::default(), &flipped);
    assert_eq!((entries.len(), left), (2, 0));
    assert_eq!(lost, [(8 + frame(1).len(), "frames that fit no known message and its checksum")]);
}

#[test]
fn ping_viewer_times_continue_after_midnight() {
    let file = ping_log(1, &[("23:59:59.999", b"one"), ("00:00:00.001\0", b"two")]);
    let (entries, lost, left) = cut(&mut PingFormat::default(), &file);
    let got: Vec<_> =
        entries.iter().map(|entry| (entry.stamp_ns / 1_000_000, entry.bytes.as_slice())).collect();
    assert_eq!(got, [(86_399_999, &b"one"[..]), (86_400_001, b"two")]);
    assert_eq!((lost.len(), left), (0, 0));
    let (_, lost, _) = cut(&mut PingFormat::default(), b"BR\x02\0\x01\x02\x03\x04");
    assert_eq!(lost, [(8, "no preface of Ping Viewer")]);
    let (_, lost, _) = cut(&mut PingFormat::default(), &text("another log"));
    assert_eq!(lost[0].1, "no preface of Ping Viewer");
}

#[test]
fn imagenex_shots_get_the_times_of_their_headers() {
    let mut file = [shot(10), shot(11), shot(12)].concat();
    let (entries, lost, left) = cut(&mut ImagenexFormat, &file);
    assert_eq!((entries.len(), lost.len(), left), (3, 0, 0));
    assert_eq!(entries[0].stamp_ns, 1_479_497_350_170_000_000);
    assert_eq!((entries[0].bytes.len(), entries[0].bytes[0]), (13, b'I'));
    file[128 + 20] = b'x';
    let (entries, lost, left) = cut(&mut ImagenexFormat, &file);
    assert_eq!((entries.len(), left), (2, 0));
    assert_eq!(lost, [(128, "shots whose header has no date and time")]);
}

#[test]
fn table_values_are_converted_to_wire_units() {
    let vehicle = "target_m = 1\n[tunnel]\nprofile = \"circle\"\nradius_m = 3\nlength_m = 100\n\
        [[sensors]]\nid = \"d\"\nplugin = \"mavlink\"\npart = \"pressure\"\n";
    let mapping = "time_column = \"t\"\ntime_unit = \"ms\"\nseparator = \";\"\n[[columns]]\ncolumn = \"p\"\n\
        sensor = \"d\"\nquantity = \"pressure\"\nunit = \"bar\"\nfactor = -1\n";
    let none = |_: &str| Err("is none".to_owned());
    let vehicle = VehicleConfig::parse(Document::new("vehicle", vehicle), &KINDS, &none).unwrap();
    let mapping = Document::new("mapping", mapping).root().unwrap();
    let mut table = Csv::new(&mapping, &vehicle, "\"t\"; p\r\n").unwrap();
    let (entries, lost, left) = cut(&mut table, b"\"t\"; p\r\n20.5;-1.5005\r\n");
    assert_eq!((entries.len(), lost.len(), left), (1, 0, 0));
    assert_eq!((entries[0].stamp_ns, entries[0].stream.as_str()), (20_500_000, "d"));
    // The MAVLink message SCALED_PRESSURE2 has a header of ten bytes, then the time, then the absolute pressure in
    // hPa.
    assert_eq!(entries[0].bytes[14..18], 1500.5_f32.to_le_bytes());
    let (entries, lost, left) = cut(&mut table, b"20.5;-1.5005\n20.6;-1");
    assert_eq!((entries.len(), left), (1, 0), "a row that may be cut short is not imported");
    assert!(matches!(lost[..], [(_, why)] if why.contains("without a line end")), "{lost:?}");
}

proptest! {
    #[test]
    fn arbitrary_bytes_are_split_into_entries_or_lost(
        bytes in proptest::collection::vec(any::<u8>(), 0..3000),
        which in 0_usize..3,
        at in 0_usize..400,
    ) {
        let whole = [tlog(0..6), [shot(1), shot(2), shot(3)].concat(), ping_log(1, &[("01:02:03.004", &b"BR"[..]); 5])];
        let mut damaged = whole[which].clone();
        for (place, byte) in damaged.iter_mut().skip(at).zip(bytes.iter().take(9)) {
            *place = *byte;
        }
        for file in [&bytes, &damaged] {
            let mut format: Box<dyn Format> = match which {
                0 => Box::<TlogFormat>::default(),
                1 => Box::new(ImagenexFormat),
                _ => Box::<PingFormat>::default(),
            };
            let (entries, lost, left) = cut(format.as_mut(), file);
            prop_assert!(left <= file.len() && lost.len() <= file.len());
            prop_assert!(entries.iter().map(|entry| entry.bytes.len()).sum::<usize>() <= file.len());
        }
    }

    #[test]
    fn arbitrary_table_is_read_to_its_end(
        bytes in prop_oneof![
            proptest::collection::vec(any::<u8>(), 0..2000),
            "(-?[0-9e.]{0,22},[-0-9einaf.]{0,9},[0-9.]{0,3}\n?){0,40}".prop_map(String::into_bytes),
        ],
    ) {
        const VEHICLE: &str = "target_m = 1\n[tunnel]\nprofile = \"circle\"\nradius_m = 3\nlength_m = 100\n\
            [[sensors]]\nid = \"d\"\nplugin = \"bar100\"\n[[sensors]]\nid = \"p\"\nplugin = \"ping1d\"\n";
        const MAPPING: &str = "time_column = \"t\"\n[[columns]]\ncolumn = \"p\"\nsensor = \"d\"\nquantity = \"pressure\"\n\
            unit = \"bar\"\n[[columns]]\ncolumn = \"r\"\nsensor = \"p\"\nquantity = \"range\"\nunit = \"m\"\n";
        let none = |_: &str| Err("is none".to_owned());
        let vehicle = VehicleConfig::parse(Document::new("vehicle", VEHICLE), &KINDS, &none).unwrap();
        let mapping = Document::new("mapping", MAPPING).root().unwrap();
        let mut table = Csv::new(&mapping, &vehicle, "t,p,r\n").unwrap();
        let (entries, lost, left) = cut(&mut table, &[b"t,p,r\n", &bytes[..]].concat());
        let lines = bytes.split(|byte| *byte == b'\n').count();
        prop_assert!(left == 0 && lost.len() <= lines && entries.len() <= 20 + 2 * lines);
    }
}
