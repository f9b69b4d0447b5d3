//! Points as E57 (ASTM E2807).

use std::io::{Read, Seek, Write};

use ::e57::{E57Writer, Extension, Record, RecordDataType, RecordName, RecordValue};

use super::data::{FRAME, FRAME_WKT, FileInfo, Point};
use super::error::FileError;
use super::rounding::RoundedPoint;

const WHAT: &str = "points as E57";
/// Namespace of the values that the standard does not have.
const NAMESPACE: &str = "headrace";

/// Type of a value that is stored in whole millimetres.
fn millimetres(min: i64, max: i64) -> RecordDataType {
    RecordDataType::ScaledInteger { min, max, scale: 0.001, offset: 0.0 }
}

/// Values of a point, in order.
fn prototype() -> Vec<Record> {
    let position = || millimetres(i64::from(i32::MIN), i64::from(i32::MAX));
    let other = |name: &str| RecordName::Unknown { namespace: NAMESPACE.to_owned(), name: name.to_owned() };
    let clock = RecordDataType::ScaledInteger { min: 0, max: 1199, scale: 0.01, offset: 0.0 };
    let records = [
        (RecordName::CartesianX, position()),
        (RecordName::CartesianY, position()),
        (RecordName::CartesianZ, position()),
        (RecordName::TimeStamp, millimetres(0, (1 << 36) - 1)),
        (other("range_m"), millimetres(0, u32::MAX.into())),
        (other("position_sd_m"), millimetres(0, u32::MAX.into())),
        (other("clock_h"), clock),
        (other("head"), RecordDataType::Integer { min: 0, max: 255 }),
        (other("doubtful"), RecordDataType::Integer { min: 0, max: 1 }),
    ];
    records.map(|(name, data_type)| Record { name, data_type }).to_vec()
}

/// Writes points, and returns their number. Memory does not grow with this number. The stream must be empty.
///
/// Errors: a value is not finite or too large; the stream fails.
pub fn write<W: Read + Write + Seek>(
    write: W,
    info: &FileInfo,
    points: impl Iterator<Item = Result<Point, FileError>>,
) -> Result<u64, FileError> {
    let failed = FileError::encoding::<::e57::Error>(WHAT);
    let mut writer = E57Writer::new(write, &guid(info.id)).map_err(&failed)?;
    writer.set_coordinate_metadata(Some(FRAME_WKT.to_owned()));
    writer.register_extension(Extension::new(NAMESPACE, "urn:headrace:e57")).map_err(&failed)?;
    let mut cloud_id = info.id;
    cloud_id[0] ^= 1;
    let mut cloud = writer.add_pointcloud(&guid(cloud_id), prototype()).map_err(&failed)?;
    cloud.set_name(Some(info.title.clone()));
    cloud.set_description(Some(format!("{FRAME}; time stamps are dive time, s")));
    cloud.set_sensor_sw_version(Some(info.program.clone()));
    let mut count = 0;
    for point in points {
        let point = RoundedPoint::new(count, &point?)?;
        let [x, y, z] = point.position_mm.map(|mm| RecordValue::ScaledInteger(mm.into()));
        let values = vec![
            x,
            y,
            z,
            RecordValue::ScaledInteger(point.time_ms),
            RecordValue::ScaledInteger(point.range_mm.into()),
            RecordValue::ScaledInteger(point.position_sd_mm.into()),
            RecordValue::ScaledInteger(point.clock_ch.into()),
            RecordValue::Integer(point.head.into()),
            RecordValue::Integer(point.doubtful.into()),
        ];
        cloud.add_point(values).map_err(&failed)?;
        count += 1;
    }
    cloud.finalize().map_err(&failed)?;
    writer.finalize().map_err(&failed)?;
    Ok(count)
}

/// GUID as E57 writes it.
fn guid(id: [u8; 16]) -> String {
    let number = u128::from_be_bytes(id);
    let (high, low) = (number >> 64, number & u128::from(u64::MAX));
    format!(
        "{{{:08X}-{:04X}-{:04X}-{:04X}-{:012X}}}",
        high >> 32,
        (high >> 16) & 0xFFFF,
        high & 0xFFFF,
        low >> 48,
        low & 0xFFFF_FFFF_FFFF
    )
}
