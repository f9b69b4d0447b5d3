//! Converts scans and point clouds of a profiling head to beams: angle, range and time.
//!
//! The angles of a scan are about the scan's z axis, from x towards y. The scan's z axis is the head's x axis. The
//! scan's x axis points where the head's angle is zero (down, -z), and the scan's y axis is the head's y axis.
//!
//! The points of a cloud are in the head's own frame, so that the beam turns in the plane of y and z. If the mapping
//! says `xy`, the points are in the frame of a scan instead.

use headrace_geometry::math;

use super::wire::Wire;

/// Maximum number of beams in one turn of a head.
const MOST_BEAMS: usize = 1 << 16;
/// Maximum time between a beam and its message's timestamp, s.
const LONGEST_S: f64 = 120.0;
/// Maximum distance of a point from the beam's plane, as a share of the point's range. Other points are dropped and
/// counted.
const OFF_PLANE: f64 = 0.1;

/// Interprets a range by REP 117; `None` without an echo.
///
/// The sender writes infinity if nothing was in range or the target was too near, and NaN if nothing was measured. A
/// range outside the stated limits is invalid, unless the limits themselves are invalid.
pub(super) fn heard(range_m: f64, least_m: f64, most_m: f64) -> Option<f64> {
    let limited = most_m > 0.0 && least_m <= most_m;
    let within = !limited || (least_m..=most_m).contains(&range_m);
    (range_m.is_finite() && range_m > 0.0 && within).then_some(range_m)
}

/// A beam of a head, as converted from a message.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Beam {
    /// Angle of the beam, as in [`headrace_sensor::reading::SonarReturn::angle_rad`].
    pub(super) angle_rad: f64,
    /// Range of the beam, m; `None` without an echo.
    pub(super) range_m: Option<f64>,
    /// Time of the beam after the message's timestamp, s.
    pub(super) after_s: f64,
}

/// Plane in which the head's beam rotates, by the axes of a message.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Plane {
    /// Plane of y and z, in the head's own axes.
    Yz,
    /// Plane of x and y, in the axes of a laser scanner.
    Xy,
}

/// Beams of a message, not checked yet.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Beams {
    /// Beams whose angles are stated.
    Turned(Vec<Beam>),
    /// Points of a cloud, each with its time after the message's timestamp, s.
    Points(Vec<([f64; 3], f64)>),
}

/// Valid beams of a message, and counts of the invalid points.
#[derive(Debug, Default)]
pub(super) struct ValidBeams {
    /// Valid beams, sorted by time.
    pub(super) beams: Vec<Beam>,
    /// Number of points that are too far from the plane in which the beam rotates.
    pub(super) off_plane: u64,
    /// Number of points that are NaN or at the origin. Such a point means that there was no echo, at an unknown angle.
    pub(super) nowhere: u64,
}

impl Beams {
    /// Returns the valid beams, in the axes of a head.
    ///
    /// Errors: the reason, as text, why no head can have measured the beams.
    pub(super) fn valid(&self, plane: Plane) -> Result<ValidBeams, &'static str> {
        let mut valid = ValidBeams::default();
        match self {
            Self::Turned(beams) => {
                if beams.iter().any(|beam| !beam.angle_rad.is_finite() || beam.angle_rad.abs() > 1e3) {
                    return Err("with angles that aren't numbers");
                }
                valid.beams.clone_from(beams);
            }
            Self::Points(points) => {
                for (point, after_s) in points {
                    valid.point(*point, *after_s, plane);
                }
            }
        }
        if valid.beams.len() > MOST_BEAMS {
            return Err("with more than 65536 beams, the maximum for a turn of a head");
        }
        if valid.beams.iter().any(|beam| !(-LONGEST_S..=LONGEST_S).contains(&beam.after_s)) {
            return Err("whose beams take more than 120 s");
        }
        valid.beams.sort_by(|one, other| one.after_s.total_cmp(&other.after_s));
        if valid.are_mostly_on_one_ray() {
            return Err(ON_ONE_RAY);
        }
        Ok(valid)
    }
}

/// Reason to refuse a message with the points of an echo.
const ON_ONE_RAY: &str = "with points behind one another on one ray: the points of an echo, not ranges; a head has one \
                          range for each ping, so detect the wall in each echo first";
/// Largest difference of two angles on one ray, radians: above the rounding of coordinates, below the step of any head.
const SAME_RAY_RAD: f64 = 1e-4;

impl ValidBeams {
    /// Whether most beams have the angle and time of the beam before them, but another range.
    fn are_mostly_on_one_ray(&self) -> bool {
        let is_same = |pair: &[Beam]| match pair {
            [one, next] => {
                (next.angle_rad - one.angle_rad).abs() < SAME_RAY_RAD
                    && next.after_s <= one.after_s
                    && next.range_m != one.range_m
            }
            _ => false,
        };
        let same = self.beams.windows(2).filter(|pair| is_same(pair)).count();
        same > 1 && 2 * same > self.beams.len()
    }

    fn point(&mut self, [x, y, z]: [f64; 3], after_s: f64, plane: Plane) {
        let (across, along, off) = match plane {
            Plane::Yz => (y, -z, x),
            Plane::Xy => (y, x, z),
        };
        let range_m = math::hypot(math::hypot(across, along), off);
        if !range_m.is_finite() || range_m <= 0.0 {
            self.nowhere += 1;
        } else if off.abs() > OFF_PLANE * range_m {
            self.off_plane += 1;
        } else {
            let angle_rad = math::atan2(across, along);
            self.beams.push(Beam { angle_rad, range_m: Some(range_m), after_s });
        }
    }
}

/// Parses a sensor_msgs/LaserScan, after its header.
pub(super) fn scan(wire: &mut Wire<'_>) -> Option<Beams> {
    let [first, _last, step, each_s, _scan_s, least, most] = wire.singles()?;
    let ranges = wire.single_sequence()?;
    let _strengths = wire.single_sequence()?;
    let beam = |(number, range): (u32, &f32)| {
        let number = f64::from(number);
        // A scan with a single beam may state any step between beams. The step may even be infinite, so it must not be
        // multiplied by zero.
        let turned = |each: f64| if number > 0.0 { number * each } else { 0.0 };
        Beam {
            angle_rad: first + turned(step),
            range_m: heard((*range).into(), least, most),
            after_s: turned(each_s),
        }
    };
    Some(Beams::Turned((0..).zip(&ranges).map(beam).collect()))
}

/// Parses a sensor_msgs/PointCloud, after its header.
pub(super) fn points(wire: &mut Wire<'_>) -> Option<Beams> {
    let count = wire.count(12)?;
    let points = (0..count).map(|_| Some((wire.singles()?, 0.0))).collect::<Option<Vec<_>>>()?;
    for _ in 0..wire.count(8)? {
        let (_name, _values) = (wire.text()?, wire.single_sequence()?);
    }
    Some(Beams::Points(points))
}

/// Encoding of a numerical field in a sensor_msgs/PointCloud2.
#[derive(Debug, Clone, Copy)]
enum Number {
    U32,
    F32,
    F64,
}

/// Offset and number encoding of a field within a point of a cloud.
#[derive(Debug, Clone, Copy)]
struct Field {
    offset: usize,
    number: Number,
}

/// Unit of a point's time, and the time from which it counts.
#[derive(Debug, Clone, Copy)]
enum Time {
    /// The time is in nanoseconds after the message's timestamp.
    After,
    /// The time is in seconds after the message's timestamp.
    AfterSeconds,
    /// The time is in seconds on the clock of the message's timestamp.
    Seconds,
}

impl Field {
    fn of(self, point: &[u8], big_endian: bool) -> Option<f64> {
        let rest = point.get(self.offset..)?;
        Some(match self.number {
            Number::U32 => {
                let bytes = *rest.first_chunk()?;
                f64::from(if big_endian { u32::from_be_bytes(bytes) } else { u32::from_le_bytes(bytes) })
            }
            Number::F32 => {
                let bytes = *rest.first_chunk()?;
                f64::from(if big_endian { f32::from_be_bytes(bytes) } else { f32::from_le_bytes(bytes) })
            }
            Number::F64 => {
                let bytes = *rest.first_chunk()?;
                if big_endian { f64::from_be_bytes(bytes) } else { f64::from_le_bytes(bytes) }
            }
        })
    }
}

/// Fields of a point cloud that the conversion uses.
#[derive(Debug, Default)]
struct Layout {
    place: [Option<Field>; 3],
    time: Option<(Field, Time)>,
}

impl Layout {
    /// Adds a field if the conversion uses it.
    ///
    /// A point's time is called `t` by Ouster's driver, `time` by Velodyne's and `timestamp` by Hesai's.
    fn add(&mut self, name: &[u8], offset: usize, datatype: u8) {
        let number = match datatype {
            6 => Number::U32,
            7 => Number::F32,
            8 => Number::F64,
            _ => return,
        };
        let field = Field { offset, number };
        let [x, y, z] = &mut self.place;
        match (name, number) {
            (b"x", Number::F32 | Number::F64) => *x = Some(field),
            (b"y", Number::F32 | Number::F64) => *y = Some(field),
            (b"z", Number::F32 | Number::F64) => *z = Some(field),
            (b"t", Number::U32) => self.time = Some((field, Time::After)),
            (b"time", Number::F32 | Number::F64) => self.time = Some((field, Time::AfterSeconds)),
            (b"timestamp", Number::F64) => self.time = Some((field, Time::Seconds)),
            _ => (),
        }
    }

    fn point(&self, point: &[u8], big_endian: bool, stamp_ns: u64) -> Option<([f64; 3], f64)> {
        let [x, y, z] = self.place;
        let place = [x?.of(point, big_endian)?, y?.of(point, big_endian)?, z?.of(point, big_endian)?];
        let Some((field, time)) = self.time else { return Some((place, 0.0)) };
        let time_of = field.of(point, big_endian)?;
        let after_s = match time {
            Time::After => time_of / 1e9,
            Time::AfterSeconds => time_of,
            Time::Seconds => time_of - stamp_ns as f64 / 1e9,
        };
        Some((place, after_s))
    }
}

/// Parses a sensor_msgs/PointCloud2, after its header.
pub(super) fn cloud(wire: &mut Wire<'_>, stamp_ns: u64) -> Option<Result<Beams, &'static str>> {
    let (height, width) = (usize::try_from(wire.u32()?).ok()?, usize::try_from(wire.u32()?).ok()?);
    let mut layout = Layout::default();
    for _ in 0..wire.count(13)? {
        let (name, offset, datatype, _count) = (wire.text()?, wire.u32()?, wire.u8()?, wire.u32()?);
        layout.add(name, usize::try_from(offset).ok()?, datatype);
    }
    let big_endian = wire.u8()? != 0;
    let (point_step, row_step) = (usize::try_from(wire.u32()?).ok()?, usize::try_from(wire.u32()?).ok()?);
    let data = wire.bytes()?;
    let _is_dense = wire.u8()?;
    if layout.place.iter().any(Option::is_none) {
        return Some(Err("without x, y and z in floating point"));
    }
    let count = height.checked_mul(width)?;
    if count > MOST_BEAMS {
        return Some(Err("with more than 65536 beams, the maximum for a turn of a head"));
    }
    let mut points = Vec::new();
    for row in 0..height.min(count) {
        for column in 0..width {
            let start = row.checked_mul(row_step)?.checked_add(column.checked_mul(point_step)?)?;
            let point = data.get(start..start.checked_add(point_step)?);
            match point.and_then(|point| layout.point(point, big_endian, stamp_ns)) {
                Some(point) => points.push(point),
                None => return Some(Err("with less data than width, height and steps say")),
            }
        }
    }
    Some(Ok(Beams::Points(points)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use core::f64::consts::FRAC_PI_2;
    use headrace_geometry::frames::head_direction;

    #[test]
    fn points_are_converted_to_beam_angles_of_the_head() {
        for quarter in -3_i32..=4 {
            let angle_rad = f64::from(quarter) * FRAC_PI_2 / 2.0;
            let at = head_direction(angle_rad).scaled(3.0);
            let valid = Beams::Points(vec![([at.x(), at.y(), at.z()], 0.0)]).valid(Plane::Yz).unwrap();
            let beam = valid.beams[0];
            assert!((beam.angle_rad - angle_rad).abs() < 1e-12, "{angle_rad}: {beam:?}");
            assert!((beam.range_m.unwrap() - 3.0).abs() < 1e-12);
            // The same point in the axes of a scanner: x points where the head's angle is zero, and y is the head's y.
            let valid = Beams::Points(vec![([-at.z(), at.y(), at.x()], 0.0)]).valid(Plane::Xy).unwrap();
            assert!((valid.beams[0].angle_rad - angle_rad).abs() < 1e-12);
        }
    }

    #[test]
    fn invalid_and_off_plane_points_are_counted() {
        let all = [[3.0, 0.0, 1.0], [0.0, f64::NAN, 1.0], [0.0; 3], [0.0, 1.0, 1.0]];
        let valid = Beams::Points(all.map(|point| (point, 0.0)).to_vec()).valid(Plane::Yz).unwrap();
        assert_eq!((valid.beams.len(), valid.off_plane, valid.nowhere), (1, 1, 2));
    }

    #[test]
    fn ranges_are_interpreted_by_rep_117() {
        assert_eq!(heard(2.0, 0.5, 5.0), Some(2.0));
        for none in [f64::INFINITY, f64::NEG_INFINITY, f64::NAN, 0.4, 5.1, 0.0, -1.0] {
            assert_eq!(heard(none, 0.5, 5.0), None, "{none}");
        }
        assert_eq!(heard(7.0, 0.0, 0.0), Some(7.0), "limits of zero mean no limits");
        assert_eq!(heard(7.0, 0.0, f64::INFINITY), Some(7.0));
        assert_eq!(heard(7.0, f64::NAN, f64::NAN), Some(7.0));
    }
}
