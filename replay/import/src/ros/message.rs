//! Known message types, and the sensor values that they contain.
//!
//! Sources: the .msg files of ROS' common_interfaces (sensor_msgs, geometry_msgs, std_msgs), REP 103 (axes and
//! units), REP 117 (ranges), REP 145 (inertial units).

use headrace_sensor::device::Sense;

use super::points::{Beams, cloud, heard, points, scan};
use super::wire::{Encoding, Header, Wire};
use crate::emulated::Doubt;

/// A supported type of message.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Type {
    /// Message with attitude, turn rate and specific force.
    Imu,
    /// Message with one distance.
    Range,
    /// Message with a pressure.
    FluidPressure,
    /// Message with ranges at equally spaced angles about an axis.
    LaserScan,
    /// Message with points that have named fields.
    PointCloud2,
    /// Message with points that have x, y and z.
    PointCloud,
    /// Message with a velocity.
    Twist,
    /// Message with a velocity and its covariance.
    TwistWithCovariance,
    /// Message with a bare number.
    Float32,
    /// Message with a bare number of double precision.
    Float64,
}

/// All message types, each with its name, and the MD5 of its definition in ROS 1.
const TYPES: [(Type, &str, &str); 10] = [
    (Type::Imu, "sensor_msgs/Imu", "6a62c6daae103f4ff57a132d6f95cec2"),
    (Type::Range, "sensor_msgs/Range", "c005c34273dc426c67a020a87bc24148"),
    (Type::FluidPressure, "sensor_msgs/FluidPressure", "804dc5cea1c5306d6a2eb80b9833befe"),
    (Type::LaserScan, "sensor_msgs/LaserScan", "90c7ef2dc6895d81024acba2ac42f369"),
    (Type::PointCloud2, "sensor_msgs/PointCloud2", "1158d486dd51d683ce2f1be655c3c181"),
    (Type::PointCloud, "sensor_msgs/PointCloud", "d8e9c3f5afbdd8a130fd1d2763945fca"),
    (Type::Twist, "geometry_msgs/TwistStamped", "98d34b0043a2093cf9d9345ab6eef12e"),
    (
        Type::TwistWithCovariance,
        "geometry_msgs/TwistWithCovarianceStamped",
        "8927a1a12fb2607ceea095b2dc440a96",
    ),
    (Type::Float32, "std_msgs/Float32", "73fcbf46b49191e672908e50842a83d4"),
    (Type::Float64, "std_msgs/Float64", "fdb28210bfa9d7c91146260178d9a584"),
];

impl Type {
    /// Finds a type by its name in the form of ROS 1 (`sensor_msgs/Imu`) or ROS 2 (`sensor_msgs/msg/Imu`).
    pub(crate) fn named(name: &str) -> Option<Self> {
        let name = name.replacen("/msg/", "/", 1);
        TYPES.iter().find(|(_, known, _)| *known == name).map(|(known, ..)| *known)
    }

    /// Whether `md5` is the MD5 of this type's definition in ROS 1. `*` stands for an unknown MD5, which is accepted.
    pub(super) fn is_defined_as(self, md5: &str) -> bool {
        md5 == "*" || TYPES.iter().any(|(known, _, known_md5)| *known == self && *known_md5 == md5)
    }

    /// Returns the kind of sensor that sends this type of message.
    pub(super) fn sense(self) -> Sense {
        match self {
            Self::Imu => Sense::Inertial,
            Self::Range => Sense::Echosounder,
            Self::FluidPressure => Sense::Depth,
            Self::LaserScan | Self::PointCloud2 | Self::PointCloud => Sense::Head,
            Self::Twist | Self::TwistWithCovariance => Sense::Velocity,
            Self::Float32 | Self::Float64 => Sense::Tether,
        }
    }

    /// Whether the message type states what was measured. A bare number doesn't, because it may be anything.
    pub(super) fn is_self_describing(self) -> bool {
        !matches!(self, Self::Float32 | Self::Float64)
    }
}

/// Values of a message, in the units and axes of its type.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Values {
    /// Values of an inertial unit. Parts that the sender marks as missing are `None`.
    Inertial {
        wxyz: Option<[f64; 4]>,
        rate_radps: Option<[f64; 3]>,
        force_mps2: Option<[f64; 3]>,
        /// Variances of tilt, heading, turn rate and specific force, in squares of SI units; 0 if not stated.
        variances: [f64; 4],
    },
    /// A range, m; `None` without an echo.
    Range(Option<f64>),
    /// A pressure, or a length of cable, in the mapping's unit, which is SI by default.
    Scalar(f64),
    Velocity([f64; 3]),
    Beams(Beams),
}

/// A parsed message: its header, if its type has one, and its values.
pub(super) struct Read<'a> {
    pub(super) header: Option<Header<'a>>,
    pub(super) values: Values,
    /// Doubt in the values, apart from the variances of an inertial message.
    pub(super) doubt: Doubt,
}

/// Parses a message.
///
/// Errors: the reason, as text, why the message doesn't fit its type.
pub(super) fn read(of: Type, encoding: Encoding, bytes: &[u8]) -> Result<Read<'_>, &'static str> {
    let mut wire = Wire::new(bytes, encoding).ok_or("in another encapsulation than plain CDR")?;
    let read =
        fields(of, &mut wire).ok_or("shorter than their type requires, or with an impossible count")??;
    if !wire.is_done() {
        return Err("longer than their type allows");
    }
    Ok(read)
}

fn fields<'a>(of: Type, wire: &mut Wire<'a>) -> Option<Result<Read<'a>, &'static str>> {
    let header = if of.is_self_describing() { Some(wire.header()?) } else { None };
    let mut doubt = Doubt::NONE;
    let values = match of {
        Type::Imu => inertial(wire)?,
        Type::Range => {
            let (range, variance) = range(wire)?;
            doubt.variance = variance;
            range
        }
        Type::FluidPressure => {
            let [pressure, variance] = wire.doubles()?;
            doubt.variance = stated(variance);
            Values::Scalar(pressure)
        }
        Type::LaserScan => Values::Beams(scan(wire)?),
        Type::PointCloud2 => match cloud(wire, header?.stamp_ns)? {
            Ok(beams) => Values::Beams(beams),
            Err(why) => return Some(Err(why)),
        },
        Type::PointCloud => Values::Beams(points(wire)?),
        Type::Twist | Type::TwistWithCovariance => {
            let [x, y, z, _, _, _] = wire.doubles()?;
            if of == Type::TwistWithCovariance {
                let covariance: [f64; 36] = wire.doubles()?;
                doubt.variance = stated(largest(&covariance, &[0, 7, 14]));
            }
            Values::Velocity([x, y, z])
        }
        Type::Float32 => Values::Scalar(wire.f32()?.into()),
        Type::Float64 => Values::Scalar(wire.f64()?),
    };
    Some(Ok(Read { header, values, doubt }))
}

/// Parses an inertial message. A covariance whose first element is -1 marks a missing value.
fn inertial(wire: &mut Wire<'_>) -> Option<Values> {
    let is_known = |covariance: &[f64; 9]| covariance.first().is_none_or(|first| !is_minus_one(*first));
    let [x, y, z, w] = wire.doubles()?;
    let of_attitude: [f64; 9] = wire.doubles()?;
    let wxyz = is_known(&of_attitude).then_some([w, x, y, z]);
    let rate: [f64; 3] = wire.doubles()?;
    let of_rate: [f64; 9] = wire.doubles()?;
    let rate_radps = is_known(&of_rate).then_some(rate);
    let force: [f64; 3] = wire.doubles()?;
    let of_force: [f64; 9] = wire.doubles()?;
    let force_mps2 = is_known(&of_force).then_some(force);
    let whole = |values: &[f64]| values.iter().all(|value| value.is_finite());
    // Senders that know no orientation leave the field at its default, which is all zeros.
    let wxyz = wxyz.filter(|wxyz| whole(wxyz) && wxyz.iter().any(|part| part.abs() > 0.0));
    Some(Values::Inertial {
        wxyz,
        rate_radps: rate_radps.filter(|it| whole(it)),
        force_mps2: force_mps2.filter(|it| whole(it)),
        variances: [
            largest(&of_attitude, &[0, 4]),
            largest(&of_attitude, &[8]),
            largest(&of_rate, &[0, 4, 8]),
            largest(&of_force, &[0, 4, 8]),
        ],
    })
}

/// Returns the largest of some elements of a covariance matrix; NaN if one of them is NaN.
fn largest(covariance: &[f64], of: &[usize]) -> f64 {
    let elements = of.iter().filter_map(|at| covariance.get(*at));
    elements.fold(f64::NEG_INFINITY, |most, next| if next.is_nan() || *next > most { *next } else { most })
}

fn is_minus_one(value: f64) -> bool {
    value.to_bits() == (-1.0_f64).to_bits()
}

/// Returns a message's variance, or 0 if its value is -1, with which drivers state that they don't know it.
fn stated(variance: f64) -> f64 {
    if is_minus_one(variance) { 0.0 } else { variance }
}

/// Parses a range and its variance, which is 0 if it isn't stated or if there was no echo.
fn range(wire: &mut Wire<'_>) -> Option<(Values, f64)> {
    let _radiation = wire.u8()?;
    let [_field_of_view, least, most, range] = wire.singles()?;
    // Only newer definitions of this message end with a variance.
    let variance = if wire.is_done() { 0.0 } else { wire.f32()?.into() };
    let range_m = heard(range, least, most);
    Some((Values::Range(range_m), if range_m.is_some() { stated(variance) } else { 0.0 }))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn message_types_are_found_by_ros_1_and_ros_2_names() {
        assert_eq!(Type::named("sensor_msgs/Imu"), Some(Type::Imu));
        assert_eq!(Type::named("sensor_msgs/msg/LaserScan"), Some(Type::LaserScan));
        assert_eq!(Type::named("sensor_msgs/Image"), None);
        assert!(!Type::Imu.is_defined_as("c005c34273dc426c67a020a87bc24148"));
    }

    #[test]
    fn messages_of_wrong_length_are_refused() {
        let whole = [[0; 16].as_slice(), &[0; 37 * 8]].concat();
        assert!(read(Type::Imu, Encoding::Ros1, &whole).is_ok());
        assert!(read(Type::Imu, Encoding::Ros1, &whole[1..]).err().unwrap().contains("shorter"));
        let longer = [&whole[..], &[0]].concat();
        assert!(read(Type::Imu, Encoding::Ros1, &longer).err().unwrap().contains("longer"));
        let other = read(Type::Imu, Encoding::Cdr, &[0, 9, 0, 0]).err().unwrap();
        assert!(other.contains("encapsulation"));
    }
}
