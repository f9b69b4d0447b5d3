//! Each file read back: with the reader of another crate if there is one, or else with a small reader in this file.

#![allow(
    clippy::float_cmp,
    clippy::cast_possible_truncation,
    clippy::type_complexity,
    reason = "tests of exact values"
)]

use std::io::{self, Cursor, Read, Seek, SeekFrom, Write};

use serde_json::Value;

use super::data::*;
use super::{FileError, dxf, e57, encode_to, glb, las, map, palette, ply, tables, xyz};

const NAME: &str = "Kraftwerk \"Süd\", tunnel Žižka & <Söhne>";

fn info() -> FileInfo {
    let date = Some(Date { year: 2026, day: 334 });
    FileInfo { title: NAME.to_owned(), program: "headrace 0.1.0".to_owned(), date, id: [7; 16] }
}

/// Points 20 km from the portal, on whole millimetres.
fn points(count: u32) -> Vec<Point> {
    let point = |number: u32| Point {
        position_m: [20_000.0 + f64::from(number) / 1000.0, -2.345, f64::from(number % 7000) / 1000.0],
        range_m: 2.0 + f64::from(number % 3000) / 1000.0,
        position_sd_m: 0.031,
        clock_h: f64::from(number % 1200) / 100.0,
        time_s: 36_000.0 + f64::from(number) / 1000.0,
        head: (number % 4) as u8,
        is_doubtful: number.is_multiple_of(5),
    };
    (0..count).map(point).collect()
}

fn stream(points: &[Point]) -> impl Iterator<Item = Result<Point, FileError>> + '_ {
    points.iter().map(|point| Ok(*point))
}

type Points<'a> = &'a mut dyn Iterator<Item = Result<Point, FileError>>;

/// A file in memory. Writes beyond a certain length fail, as on a full disk.
struct Disk {
    bytes: Cursor<Vec<u8>>,
    size: u64,
}

impl Disk {
    fn new(size: u64) -> Self {
        Self { bytes: Cursor::default(), size }
    }
}

impl Write for Disk {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        if self.bytes.position() + bytes.len() as u64 > self.size {
            return Err(io::Error::new(io::ErrorKind::StorageFull, "disk full"));
        }
        self.bytes.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

impl Read for Disk {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        self.bytes.read(bytes)
    }
}

impl Seek for Disk {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        self.bytes.seek(to)
    }
}

/// Encoders of points.
const POINT_FILES: [(&str, fn(&mut Disk, Points) -> Result<u64, FileError>); 5] = [
    ("LAS", |disk, points| las::write(disk, &info(), false, points)),
    ("LAZ", |disk, points| las::write(disk, &info(), true, points)),
    ("E57", |disk, points| e57::write(disk, &info(), points)),
    ("XYZ", |disk, points| xyz::write(disk, &info(), points)),
    ("PLY", |disk, points| {
        let info = info();
        let mut writer = ply::PointWriter::new(disk, &info)?;
        for point in points {
            writer.add(&point?)?;
        }
        writer.finish()
    }),
];

fn encoded(format: &str, points: &[Point]) -> Vec<u8> {
    let (_, encode) = POINT_FILES.iter().find(|(name, _)| *name == format).unwrap();
    let mut disk = Disk::new(u64::MAX);
    assert_eq!(encode(&mut disk, &mut stream(points)).unwrap(), points.len() as u64, "{format}");
    disk.bytes.into_inner()
}

#[test]
fn las_and_laz_hold_every_value_and_the_bounds() {
    // These are more points than a chunk of LAZ holds, which has 50,000.
    let points = points(60_001);
    for format in ["LAS", "LAZ"] {
        let mut reader = ::las::Reader::new(Cursor::new(encoded(format, &points))).unwrap();
        let header = reader.header().clone();
        assert_eq!(header.number_of_points(), 60_001);
        assert_eq!(header.bounds().max.x, 20_060.0);
        assert_eq!(header.bounds().min.x, 20_000.0);
        assert_eq!(header.date().unwrap().to_string(), "2026-11-30");
        assert_eq!(header.version(), ::las::Version::new(1, 4));
        assert!(header.vlrs().iter().any(|vlr| vlr.data.starts_with(NAME.as_bytes())));
        for (read, point) in reader.read_all().unwrap().points().map(Result::unwrap).zip(&points) {
            let error = |axis: usize, value: f64| (value - point.position_m[axis]).abs();
            assert!(error(0, read.x) < 1e-9 && error(1, read.y) < 1e-9 && error(2, read.z) < 1e-9);
            assert!((read.gps_time.unwrap() - point.time_s).abs() < 1e-9);
            let mut extra = ((point.range_m * 1000.0).round() as u32).to_le_bytes().to_vec();
            extra.extend(31_u32.to_le_bytes());
            extra.extend(((point.clock_h * 100.0).round() as u16).to_le_bytes());
            extra.extend([point.head, u8::from(point.is_doubtful)]);
            assert_eq!(read.extra_bytes, extra);
        }
    }
}

#[test]
fn e57_holds_every_value_and_the_title() {
    let points = points(5000);
    let mut reader = ::e57::E57Reader::new(Cursor::new(encoded("E57", &points))).unwrap();
    let cloud = reader.pointclouds().remove(0);
    assert_eq!(cloud.name.as_deref(), Some(NAME));
    assert!(cloud.description.as_ref().unwrap().contains(FRAME));
    let bounds = cloud.cartesian_bounds.clone().unwrap();
    assert!((bounds.x_max.unwrap() - 20_004.999).abs() < 1e-9);
    let values = reader.pointcloud_raw(&cloud).unwrap().map(Result::unwrap).collect::<Vec<_>>();
    assert_eq!(values.len(), points.len());
    for (values, point) in values.iter().zip(&points) {
        let value = |index: usize| values[index].to_f64(&cloud.prototype[index].data_type).unwrap();
        let [x, y, z] = point.position_m;
        let others = [point.range_m, point.position_sd_m, point.clock_h, f64::from(point.head)];
        let told = [x, y, z, point.time_s].into_iter().chain(others);
        assert!(told.enumerate().all(|(index, told)| (value(index) - told).abs() < 1e-9));
        assert_eq!(value(8) > 0.5, point.is_doubtful);
    }
}

#[test]
fn points_read_from_ply_give_the_same_files_as_the_points_themselves() {
    let mut points = points(3000);
    // The values are between whole millimetres, and a clock position is rounded up to 12.
    for (number, point) in points.iter_mut().enumerate() {
        point.position_m[0] += 0.000_3;
        point.range_m += 0.000_4;
        point.clock_h = if number == 0 { 11.999 } else { point.clock_h };
    }
    let ply = encoded("PLY", &points);
    let read = ply::read_points(Cursor::new(&ply)).unwrap().map(Result::unwrap).collect::<Vec<_>>();
    assert_eq!(read[0].position_m[0], 20_000.0);
    assert_eq!(read[0].clock_h, 0.0);
    for (format, _) in POINT_FILES {
        assert_eq!(encoded(format, &read), encoded(format, &points), "{format}");
    }
}

#[test]
fn xyz_has_a_line_per_point_with_the_digits_of_its_resolution() {
    let text = String::from_utf8(encoded("XYZ", &points(2))).unwrap();
    let lines = text.lines().filter(|line| !line.starts_with('#')).collect::<Vec<_>>();
    assert_eq!(lines[1], "20000.001 -2.345 0.001 2.001 0.031 0.01 36000.001 1 0");
    assert_eq!(lines.len(), 2);
    assert!(text.contains(FRAME) && text.contains(NAME));
}

#[test]
fn file_without_points_can_be_read() {
    let las = encoded("LAS", &[]);
    for format in ["LAS", "LAZ"] {
        let reader = ::las::Reader::new(Cursor::new(encoded(format, &[]))).unwrap();
        assert_eq!((reader.header().number_of_points(), reader.header().bounds().max.x), (0, 0.0));
    }
    assert!(las.windows(8).all(|bytes| bytes != f64::INFINITY.to_le_bytes()));
    let mut reader = ::e57::E57Reader::new(Cursor::new(encoded("E57", &[]))).unwrap();
    let cloud = reader.pointclouds().remove(0);
    assert_eq!(reader.pointcloud_raw(&cloud).unwrap().count(), 0);
    assert_eq!(ply::read_points(Cursor::new(encoded("PLY", &[]))).unwrap().count(), 0);
}

#[test]
fn value_that_no_file_can_hold_is_refused_with_its_name_and_place() {
    let wrong: [(&str, fn(&mut Point)); 6] = [
        ("position_m of point 2 is NaN", |point| point.position_m[1] = f64::NAN),
        ("position_m of point 2 is 3000000", |point| point.position_m[0] = 3_000_000.0),
        ("range_m of point 2 is inf", |point| point.range_m = f64::INFINITY),
        ("position_sd_m of point 2 is -1", |point| point.position_sd_m = -1.0),
        ("clock_h of point 2 is 13", |point| point.clock_h = 13.0),
        ("time_s of point 2 is NaN", |point| point.time_s = f64::NAN),
    ];
    for (format, encode) in POINT_FILES {
        for (words, spoil) in wrong {
            let mut points = points(3);
            spoil(&mut points[2]);
            let error = encode(&mut Disk::new(u64::MAX), &mut stream(&points)).unwrap_err().to_string();
            assert!(error.starts_with(words) && error.contains("; the file holds "), "{format}: {error}");
        }
    }
}

#[test]
fn full_disk_is_an_error_wherever_it_occurs() {
    let points = points(20_000);
    for (format, encode) in POINT_FILES {
        let length = encoded(format, &points).len() as u64;
        for size in (0..length).step_by(length as usize / 9) {
            let error = encode(&mut Disk::new(size), &mut stream(&points)).unwrap_err().to_string();
            assert!(error.starts_with("points as "), "{format} of {size} bytes: {error}");
        }
    }
}

#[test]
fn error_names_the_path() {
    let path = std::env::temp_dir().join("headrace-no-such-folder/points.las");
    let error = encode_to(&path, |file| xyz::write(file, &info(), stream(&[]))).unwrap_err().to_string();
    assert!(error.contains("no-such-folder/points.las: a new file can't be written"), "{error}");
}

/// Cells of a table, read by the rules of RFC 4180.
fn cells(text: &str) -> Vec<Vec<String>> {
    let (mut rows, mut row, mut cell) = (Vec::new(), Vec::new(), String::new());
    let (mut is_quoted, mut characters) = (false, text.chars().peekable());
    while let Some(character) = characters.next() {
        match (character, is_quoted) {
            ('"', true) if characters.peek() == Some(&'"') => cell.extend(characters.next()),
            ('"', _) => is_quoted = !is_quoted,
            (',', false) => row.push(std::mem::take(&mut cell)),
            ('\r', false) => assert_eq!(characters.peek(), Some(&'\n')),
            ('\n', false) => {
                row.push(std::mem::take(&mut cell));
                rows.push(std::mem::take(&mut row));
            }
            _ => cell.push(character),
        }
    }
    assert!(row.is_empty() && cell.is_empty() && !is_quoted);
    rows
}

fn section() -> Section {
    Section {
        station: "20+000.00".to_owned(),
        chainage_m: 20_000.0,
        measured_m: vec![vec![[-1.0, 0.0], [-1.0, 2.0]], vec![[1.0, 2.0], [1.001, 0.001], [0.9, 0.0]]],
        design_m: vec![[-1.0, 0.0], [-1.0, 2.0], [1.0, 2.0], [1.0, 0.0]],
        verdict: NAME.to_owned(),
        hole_m: Some(0.6125),
        hole_sd_m: None,
    }
}

#[test]
fn table_keeps_quotes_commas_line_breaks_and_umlauts() {
    let text = "said \"hole\",\r\nthen left; Ä";
    let finding = Finding { kind: NAME.to_owned(), text: text.to_owned(), ..Finding::default() };
    let mut bytes = Vec::new();
    tables::write_findings(&mut bytes, &[finding]).unwrap();
    let rows = cells(std::str::from_utf8(&bytes).unwrap());
    assert_eq!(rows[1], ["", "", "0.000", "0.000", NAME, "", text]);
}

#[test]
fn tables_of_sections_have_a_row_per_section_and_per_corner() {
    let (mut bytes, mut outlines) = (Vec::new(), Vec::new());
    tables::write_sections(&mut bytes, &[section()]).unwrap();
    assert_eq!(tables::write_outlines(&mut outlines, &[section()]).unwrap(), 9);
    let rows = cells(std::str::from_utf8(&bytes).unwrap());
    assert_eq!(rows[1], ["20+000.00", "20000.000", NAME, "0.613", ""]);
    let rows = cells(std::str::from_utf8(&outlines).unwrap());
    assert_eq!(rows[8], ["20+000.00", "20000.000", "measured", "1", "1.001", "0.001"]);
}

#[test]
fn track_leaves_unknown_standard_deviations_empty_and_refuses_nan() {
    let mut at = TrackPoint {
        time_s: 1.2,
        position_m: [-0.000_4, -0.5, 1.0],
        attitude_deg: [0.0, -1.006, 180.0],
        chainage_sd_m: Some(0.0123),
        lateral_sd_m: None,
        tilt_sd_deg: Some(0.1),
        yaw_sd_deg: None,
    };
    let mut bytes = Vec::new();
    let mut track = tables::TrackWriter::new(&mut bytes).unwrap();
    track.add(&at).unwrap();
    assert_eq!(track.finish().unwrap(), 1);
    let rows = cells(std::str::from_utf8(&bytes).unwrap());
    assert_eq!(rows[1].join(" "), "1.200 0.000 -0.500 1.000 0.00 -1.01 180.00 0.012  0.10 ");
    at.position_m[2] = f64::NAN;
    let error = tables::TrackWriter::new(&mut bytes).unwrap().add(&at).unwrap_err().to_string();
    assert!(error.starts_with("z_m in row 1 of track as CSV is NaN"), "{error}");
}

/// Groups of a drawing: code and value.
fn groups(bytes: &[u8]) -> Vec<(u16, String)> {
    assert!(bytes.is_ascii());
    let lines = std::str::from_utf8(bytes).unwrap().split_terminator("\r\n").collect::<Vec<_>>();
    lines.chunks(2).map(|pair| (pair[0].trim().parse().unwrap(), pair[1].to_owned())).collect()
}

fn count(groups: &[(u16, String)], code: u16, value: &str) -> usize {
    groups.iter().filter(|group| group.0 == code && group.1 == value).count()
}

#[test]
fn drawing_of_sections_keeps_gaps_places_and_names() {
    let mut bytes = Vec::new();
    assert_eq!(dxf::write_sections(&mut bytes, &info(), &[section()]).unwrap(), 4);
    let groups = groups(&bytes);
    assert_eq!((count(&groups, 0, "POLYLINE"), count(&groups, 0, "VERTEX")), (3, 9));
    assert_eq!((count(&groups, 10, "20000.000"), count(&groups, 11, "20000.000")), (10, 1));
    assert_eq!(count(&groups, 20, "1.001"), 1);
    let label = "20+000.00  Kraftwerk \"S\\U+00FCd\", tunnel \\U+017Di\\U+017Eka & <S\\U+00F6hne>  D 0.613 m";
    assert_eq!(count(&groups, 1, label), 1);
    let broken = Section { verdict: "50%% ^ of\nit".to_owned(), ..section() };
    let mut bytes = Vec::new();
    dxf::write_sheet(&mut bytes, &info(), &[broken]).unwrap();
    assert!(String::from_utf8(bytes).unwrap().contains("50%%%%%% ^  of it"));
}

#[test]
fn sheet_shows_the_left_wall_on_the_left() {
    let mut bytes = Vec::new();
    let section = Section { measured_m: vec![vec![[1.5, 0.0], [1.5, 1.0]]], ..section() };
    dxf::write_sheet(&mut bytes, &info(), &[section]).unwrap();
    assert_eq!(count(&groups(&bytes), 10, "-1.500"), 2);
}

#[test]
fn profile_is_interrupted_where_the_wall_was_not_measured() {
    let station = |chainage_m: f64, crown_m: Option<f64>| ProfileStation {
        station: format!("{chainage_m}"),
        chainage_m,
        measured: Edges { crown_m, ..Edges::default() },
        design: Edges { floor_m: Some(0.0), crown_m: Some(3.0), ..Edges::default() },
    };
    let crowns = [Some(3.1), Some(3.2), None, Some(3.3), None, Some(2.9), Some(3.1)];
    let stations = (0_u32..).zip(crowns).map(|(x, crown)| station(x.into(), crown)).collect::<Vec<_>>();
    let mut bytes = Vec::new();
    assert_eq!(dxf::write_profile(&mut bytes, &info(), &stations).unwrap(), 5 + 1);
    assert_eq!(count(&groups(&bytes), 0, "POINT"), 1);
    assert_eq!(count(&groups(&bytes), 20, "3.100"), 2);
    let mut bytes = Vec::new();
    assert_eq!(tables::write_profile(&mut bytes, &stations).unwrap(), 7);
}

fn deviation_m(column: u32, row: u32) -> Option<f64> {
    (column != 3).then(|| f64::from(column) / 100.0 - f64::from(row) / 10.0)
}

const MAP: WallMap =
    WallMap { size: [700, 600], from_m: [20_000.0, 0.0], pixel_m: [0.25, 0.1], deviation_m: &deviation_m };

#[test]
fn tiff_holds_every_deviation_and_its_place() {
    let mut bytes = Cursor::new(Vec::new());
    map::write_tiff(&mut bytes, &info(), &MAP).unwrap();
    let mut decoder = ::tiff::decoder::Decoder::new(Cursor::new(bytes.into_inner())).unwrap();
    let tag = |decoder: &mut ::tiff::decoder::Decoder<_>, tag| decoder.get_tag_f64_vec(tag).unwrap();
    assert_eq!(tag(&mut decoder, ::tiff::tags::Tag::ModelPixelScaleTag), [0.25, 0.1, 0.0]);
    assert_eq!(tag(&mut decoder, ::tiff::tags::Tag::ModelTiepointTag), [0.0, 0.0, 0.0, 20_000.0, 60.0, 0.0]);
    assert_eq!(decoder.get_tag_ascii_string(::tiff::tags::Tag::GdalNodata).unwrap(), "-9999");
    let ::tiff::decoder::DecodingResult::F32(values) = decoder.read_image().unwrap() else { panic!() };
    assert_eq!(values.len(), 700 * 600);
    for (index, value) in (0_u32..).zip(values) {
        assert_eq!(value, deviation_m(index % 700, index / 700).map_or(map::NO_DATA, |told| told as f32));
    }
    let mut world = Vec::new();
    map::write_world_file(&mut world, &MAP).unwrap();
    assert_eq!(world, b"0.25\n0\n0\n-0.1\n20000.125000\n59.950000\n");
}

#[test]
fn picture_of_the_map_has_the_colours_of_the_deviations() {
    let mut bytes = Vec::new();
    map::write_png(&mut bytes, &info(), &MAP, 0.5).unwrap();
    let mut reader = ::png::Decoder::new(Cursor::new(bytes)).read_info().unwrap();
    assert!(reader.info().utf8_text.iter().any(|text| text.get_text().unwrap() == NAME));
    let colours = reader.info().palette.clone().unwrap();
    let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
    reader.next_frame(&mut pixels).unwrap();
    let index = |column: u32, row: u32| pixels[(700 * row + column) as usize];
    assert_eq!([index(3, 7), index(0, 0), index(699, 0), index(0, 599)], [0, 128, 255, 1]);
    assert_eq!(colours[..3], palette::NOT_MEASURED);
    assert_eq!(colours[3 * 128..3 * 129], [247, 247, 247]);
}

#[test]
fn map_without_pixels_or_with_nan_is_refused() {
    let empty = WallMap { size: [0, 5], ..MAP };
    let error = map::write_tiff(Cursor::new(Vec::new()), &info(), &empty).unwrap_err().to_string();
    assert!(error.starts_with("map as TIFF can't be encoded: size [0, 5]"), "{error}");
    let broken = WallMap { deviation_m: &|column, _| Some(if column == 4 { f64::NAN } else { 0.0 }), ..MAP };
    let error = map::write_png(Vec::new(), &info(), &broken, 0.5).unwrap_err().to_string();
    assert!(error.starts_with("deviation in column 4, row 0 of the map is NaN"), "{error}");
}

fn wall() -> WallMesh {
    WallMesh {
        corners_m: vec![[20_000.123_4, -1.0, 0.0], [20_001.5, -1.0, 0.0], [20_000.5, -1.0, 2.0]],
        deviations_m: vec![Some(-1.0), None, Some(0.0)],
        triangles: vec![[0, 1, 2]],
    }
}

/// JSON and binary chunk of a GLB file.
fn chunks(bytes: &[u8]) -> (Value, Vec<u8>) {
    let size = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as usize;
    assert_eq!((&bytes[..4], size(4), size(8)), (b"glTF".as_slice(), 2, bytes.len()));
    let end = 20 + size(12);
    assert_eq!((end % 4, &bytes[16..20]), (0, b"JSON".as_slice()));
    let binary = if end < bytes.len() { bytes[end + 8..end + 8 + size(end)].to_vec() } else { Vec::new() };
    (serde_json::from_slice(&bytes[20..end]).unwrap(), binary)
}

#[test]
fn glb_keeps_a_tenth_of_a_millimetre_20_km_from_the_portal() {
    let mut bytes = Vec::new();
    glb::write(&mut bytes, &info(), &[wall(), wall()], 0.5).unwrap();
    let (json, binary) = chunks(&bytes);
    assert_eq!(json["nodes"][2]["children"], serde_json::json!([0, 1]));
    assert_eq!(binary.len(), 2 * 3 * (12 + 4 + 4));
    let x = f32::from_le_bytes(binary[..4].try_into().unwrap());
    let x_m = json["nodes"][0]["translation"][0].as_f64().unwrap() + f64::from(x);
    assert!((x_m - 20_000.123_4).abs() < 1e-4);
    assert_eq!(binary[36..40], [0, 114, 178, 255]);
    assert_eq!(binary[40..43], palette::NOT_MEASURED);
}

#[test]
fn glb_without_wall_is_valid_and_wrong_meshes_are_refused() {
    let mut bytes = Vec::new();
    glb::write(&mut bytes, &info(), &[], 0.5).unwrap();
    let (json, binary) = chunks(&bytes);
    assert!(binary.is_empty() && json.get("meshes").is_none() && json["nodes"][0].get("children").is_none());
    let wrong: [(&str, fn(&mut WallMesh)); 3] = [
        ("a value of part 0 is NaN", |wall| wall.corners_m[1][2] = f64::NAN),
        ("a triangle of part 0 names corner 3 of 3", |wall| wall.triangles[0][1] = 3),
        ("part 0 has 3 corners and 2 deviations", |wall| wall.deviations_m.truncate(2)),
    ];
    for (words, spoil) in wrong {
        let mut wall = wall();
        spoil(&mut wall);
        let error = glb::write(Vec::new(), &info(), &[wall], 0.5).unwrap_err().to_string();
        assert!(error.ends_with(words), "{error}");
    }
}
