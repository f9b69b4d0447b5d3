//! Map of the unrolled wall: as a picture (PNG), as data (TIFF), and the world file that states where both are in the
//! tunnel frame.

use std::io::{BufWriter, Seek, Write};

use ::png::{BitDepth, ColorType, Encoder};
use ::tiff::encoder::{TiffEncoder, colortype::Gray32Float};
use ::tiff::tags::{Tag, Type};

use super::data::{FileInfo, WallMap};
use super::error::FileError;
use super::palette;

const PICTURE: &str = "map as PNG";
const DATA: &str = "map as TIFF";
const WORLD: &str = "world file of the map";
/// Value of pixels that were not measured.
pub const NO_DATA: f32 = -9999.0;
/// Largest deviation that a file may hold, m.
const LARGEST_M: f64 = 1000.0;
/// Description of a map's axes, for the file.
const AXES: &str = "unrolled wall, m: chainage from the portal to the right, arc length from the floor's centre via the left wall \
     upwards; no EPSG code";

impl WallMap<'_> {
    /// Chainage and arc length of the upper left corner.
    fn upper_left_m(&self) -> [f64; 2] {
        [self.from_m[0], self.from_m[1] + self.pixel_m[1] * f64::from(self.size[1])]
    }

    fn check(&self, what: &'static str) -> Result<(), FileError> {
        let is_sound = self.from_m.iter().all(|value| value.is_finite())
            && self.pixel_m.iter().all(|&value| value > 0.0 && value.is_finite())
            && !self.size.contains(&0);
        let text = || format!("size {:?}, from {:?} m, pixel {:?} m", self.size, self.from_m, self.pixel_m);
        if is_sound { Ok(()) } else { Err(FileError::encoding(what)(text())) }
    }

    /// Deviation at a column and row.
    fn deviation(&self, column: u32, row: u32) -> Result<Option<f64>, FileError> {
        let deviation_m = (self.deviation_m)(column, row);
        match deviation_m {
            Some(value) if value.is_nan() || value.abs() > LARGEST_M => Err(FileError::Value {
                what: format!("deviation in column {column}, row {row} of the map"),
                value,
                least: -LARGEST_M,
                most: LARGEST_M,
            }),
            _ => Ok(deviation_m),
        }
    }
}

/// Writes a world file, which states the size of a pixel and the centre of the upper left pixel.
///
/// Errors: the map is empty; the stream fails.
pub fn write_world_file(mut write: impl Write, map: &WallMap) -> Result<(), FileError> {
    map.check(WORLD)?;
    let ([width_m, height_m], [x_m, arc_m]) = (map.pixel_m, map.upper_left_m());
    let [x_m, arc_m] = [x_m + width_m / 2.0, arc_m - height_m / 2.0];
    write!(write, "{width_m}\n0\n0\n-{height_m}\n{x_m:.6}\n{arc_m:.6}\n").map_err(FileError::io(WORLD))
}

/// Writes the map as a picture. Its colours saturate at a deviation of `limit_m`. Only one row of pixels is in memory
/// at a time.
///
/// Errors: the map is empty; a deviation is not finite; the stream fails.
pub fn write_png(write: impl Write, info: &FileInfo, map: &WallMap, limit_m: f64) -> Result<(), FileError> {
    map.check(PICTURE)?;
    let failed = FileError::encoding::<::png::EncodingError>(PICTURE);
    let mut encoder = Encoder::new(BufWriter::new(write), map.size[0], map.size[1]);
    encoder.set_color(ColorType::Indexed);
    encoder.set_depth(BitDepth::Eight);
    encoder.set_palette((0..=255).flat_map(palette::colour).collect::<Vec<_>>());
    let description = format!(
        "{AXES}; blue: {limit_m} m or more inwards from the design, orange: {limit_m} m or more outwards, grey: not measured"
    );
    for (key, text) in [("Title", &info.title), ("Software", &info.program), ("Description", &description)] {
        encoder.add_itxt_chunk(key.to_owned(), text.clone()).map_err(&failed)?;
    }
    let mut writer = encoder.write_header().map_err(&failed)?;
    let mut stream = writer.stream_writer().map_err(&failed)?;
    let mut line = Vec::new();
    for row in 0..map.size[1] {
        line.clear();
        for column in 0..map.size[0] {
            line.push(palette::index(map.deviation(column, row)?, limit_m));
        }
        stream.write_all(&line).map_err(FileError::io(PICTURE))?;
    }
    stream.finish().map_err(&failed)?;
    writer.finish().map_err(&failed)
}

/// Writes the map as deviations in m, with [`NO_DATA`] where the wall was not measured. Only one strip of pixels is in
/// memory at a time.
///
/// Errors: the map is empty; a deviation is not finite; the stream fails.
pub fn write_tiff(write: impl Write + Seek, info: &FileInfo, map: &WallMap) -> Result<(), FileError> {
    map.check(DATA)?;
    let failed = FileError::encoding::<::tiff::TiffError>(DATA);
    // The strips are not compressed, because release 0.11.3 of the crate `tiff` states their compression but does not
    // apply it.
    let mut encoder = TiffEncoder::new(BufWriter::new(write)).map_err(&failed)?;
    let mut image = encoder.new_image::<Gray32Float>(map.size[0], map.size[1]).map_err(&failed)?;
    let ([width_m, height_m], [x_m, arc_m]) = (map.pixel_m, map.upper_left_m());
    let tags = image.encoder();
    let description = format!("{}; deviation from the design, m, outwards positive; {AXES}\0", info.title);
    // The text is written as bytes, because the crate refuses text beyond ASCII. Readers accept UTF-8.
    let entry = tags.write_entry_bytes(Type::ASCII, description.as_bytes()).map_err(&failed)?;
    tags.extend_from(&[(Tag::ImageDescription, entry)].into_iter().collect());
    tags.write_tag(Tag::Software, info.program.as_str()).map_err(&failed)?;
    tags.write_tag(Tag::ModelPixelScaleTag, &[width_m, height_m, 0.0][..]).map_err(&failed)?;
    tags.write_tag(Tag::ModelTiepointTag, &[0.0, 0.0, 0.0, x_m, arc_m, 0.0][..]).map_err(&failed)?;
    tags.write_tag(Tag::GdalNodata, format!("{NO_DATA}").as_str()).map_err(&failed)?;
    let (mut row, mut strip) = (0, Vec::new());
    while image.next_strip_sample_count() > 0 {
        strip.clear();
        while (strip.len() as u64) < image.next_strip_sample_count() {
            for column in 0..map.size[0] {
                #[expect(clippy::cast_possible_truncation, reason = "24 bits resolve 1000 m to 0.06 mm")]
                strip.push(map.deviation(column, row)?.map_or(NO_DATA, |value| value as f32));
            }
            row += 1;
        }
        image.write_strip(&strip).map_err(&failed)?;
    }
    image.finish().map_err(&failed)
}
