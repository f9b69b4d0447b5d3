//! Reference frames as types, so that vectors of different frames can't be mixed.
//!
//! ```text
//!            z up                       head angle alpha, seen looking along +x:
//!            |                                   180 deg
//!            |   x along the axis                   |
//!            |  /  (chainage)            left  90 --+-- 270  right
//!            | /                          (+y)      |
//!   y left --+/                                   0 deg (-z)
//! ```
//! Tunnel frame: right-handed, metres; x = chainage along the axis, y = left, z = up from the floor's centre. Body
//! frame: x forward, y left, z up. Sensor frame: a profiling head turns about its own x; an echosounder looks along its
//! own x. The type of a rotation names the target frame first: `Rot<Tunnel, Body>` turns body vectors into tunnel
//! vectors.

use core::fmt;
use core::marker::PhantomData;
use core::ops::{Add, Mul, Neg, Sub};

use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};

use crate::math;

/// Marker type of the tunnel frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Tunnel {}

/// Marker type of the body frame, which is fixed to the vehicle.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Body {}

/// Marker type of the frame of one mounted sensor.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Sensor {}

/// A displacement in frame `F`, metres, or a direction, which has no unit.
#[derive(Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(bound = "")]
pub struct Vec3<F>(pub Vector3<f64>, PhantomData<F>);

/// A position in frame `F`, metres.
#[derive(Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(bound = "")]
pub struct Point3<F>(pub Vector3<f64>, PhantomData<F>);

/// A rotation that takes vectors of frame `From` to frame `To`.
#[derive(Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(bound = "")]
pub struct Rot<To, From>(pub UnitQuaternion<f64>, PhantomData<(To, From)>);

macro_rules! components {
    ($type:ident) => {
        impl<F> $type<F> {
            /// Creates a vector or a point from its components, metres.
            pub fn new(x: f64, y: f64, z: f64) -> Self {
                Self(Vector3::new(x, y, z), PhantomData)
            }

            /// Creates a vector or a point from its three components in one `nalgebra` vector, metres.
            pub fn of(vector: Vector3<f64>) -> Self {
                Self(vector, PhantomData)
            }

            /// The zero vector, or the frame's origin.
            pub fn zero() -> Self {
                Self::new(0.0, 0.0, 0.0)
            }

            /// Component along x.
            pub fn x(&self) -> f64 {
                self.0.x
            }

            /// Component along y.
            pub fn y(&self) -> f64 {
                self.0.y
            }

            /// Component along z.
            pub fn z(&self) -> f64 {
                self.0.z
            }

            /// Whether every component is a finite number.
            pub fn is_finite(&self) -> bool {
                self.0.iter().all(|c| c.is_finite())
            }
        }

        impl<F> fmt::Debug for $type<F> {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                write!(f, "[{}, {}, {}]", self.0.x, self.0.y, self.0.z)
            }
        }
    };
}

components!(Vec3);
components!(Point3);

impl<F> Vec3<F> {
    /// Length of the vector.
    pub fn norm(&self) -> f64 {
        math::sqrt(self.0.x * self.0.x + self.0.y * self.0.y + self.0.z * self.0.z)
    }

    /// The scalar product.
    pub fn dot(&self, other: &Self) -> f64 {
        self.0.x * other.0.x + self.0.y * other.0.y + self.0.z * other.0.z
    }

    /// The vector product.
    #[must_use]
    pub fn cross(&self, other: &Self) -> Self {
        Self(self.0.cross(&other.0), PhantomData)
    }

    /// The vector times `factor`.
    #[must_use]
    pub fn scaled(&self, factor: f64) -> Self {
        Self(self.0 * factor, PhantomData)
    }
}

impl<F> Add for Vec3<F> {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self(self.0 + other.0, PhantomData)
    }
}

impl<F> Neg for Vec3<F> {
    type Output = Self;

    fn neg(self) -> Self {
        Self(-self.0, PhantomData)
    }
}

impl<F> Add<Vec3<F>> for Point3<F> {
    type Output = Self;

    fn add(self, displacement: Vec3<F>) -> Self {
        Self(self.0 + displacement.0, PhantomData)
    }
}

impl<F> Sub for Point3<F> {
    type Output = Vec3<F>;

    fn sub(self, other: Self) -> Vec3<F> {
        Vec3(self.0 - other.0, PhantomData)
    }
}

impl<To, From> Rot<To, From> {
    /// The identity rotation, between frames with parallel axes.
    pub fn identity() -> Self {
        Self(UnitQuaternion::identity(), PhantomData)
    }

    /// Creates a rotation from a quaternion w, x, y, z. The quaternion may have any length above 1e-6.
    ///
    /// Errors: `None` for a shorter or infinite quaternion, or one with NaN.
    pub fn from_wxyz(w: f64, x: f64, y: f64, z: f64) -> Option<Self> {
        let norm = math::sqrt(w * w + x * x + y * y + z * z);
        if !(norm.is_finite() && norm > 1e-6) {
            return None;
        }
        let q = Quaternion::new(w / norm, x / norm, y / norm, z / norm);
        Some(Self(UnitQuaternion::new_unchecked(q), PhantomData))
    }

    /// Creates a rotation from roll about x, then pitch about y, then yaw about z (fixed axes), radians.
    pub fn from_roll_pitch_yaw(roll_rad: f64, pitch_rad: f64, yaw_rad: f64) -> Self {
        let (sr, cr) = math::sin_cos(roll_rad / 2.0);
        let (sp, cp) = math::sin_cos(pitch_rad / 2.0);
        let (sy, cy) = math::sin_cos(yaw_rad / 2.0);
        let q = Quaternion::new(
            cr * cp * cy + sr * sp * sy,
            sr * cp * cy - cr * sp * sy,
            cr * sp * cy + sr * cp * sy,
            cr * cp * sy - sr * sp * cy,
        );
        Self(UnitQuaternion::new_unchecked(q), PhantomData)
    }

    /// Returns roll, pitch and yaw in radians, with pitch in [-pi/2, pi/2]. Inverse of [`Rot::from_roll_pitch_yaw`].
    pub fn roll_pitch_yaw(&self) -> (f64, f64, f64) {
        let q = self.0.quaternion();
        let (w, x, y, z) = (q.w, q.i, q.j, q.k);
        (
            math::atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y)),
            math::asin(2.0 * (w * y - z * x)),
            math::atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)),
        )
    }

    /// Components w, x, y, z of the rotation's unit quaternion.
    pub fn wxyz(&self) -> [f64; 4] {
        let q = self.0.quaternion();
        [q.w, q.i, q.j, q.k]
    }

    /// Whether the quaternion has unit length, apart from the rounding errors of a long product of rotations.
    pub fn is_unit(&self) -> bool {
        /// Largest accepted error of the quaternion's squared length. Ten hours of rotations at 600 Hz, multiplied one
        /// by one, give errors below 1e-8.
        const DRIFT: f64 = 1e-6;
        let [w, x, y, z] = self.wxyz();
        (w * w + x * x + y * y + z * z - 1.0).abs() <= DRIFT
    }

    /// The inverse rotation.
    pub fn inverse(&self) -> Rot<From, To> {
        Rot(self.0.inverse(), PhantomData)
    }
}

impl<To, Mid, From> Mul<Rot<Mid, From>> for Rot<To, Mid> {
    type Output = Rot<To, From>;

    fn mul(self, inner: Rot<Mid, From>) -> Rot<To, From> {
        Rot(self.0 * inner.0, PhantomData)
    }
}

impl<To, From> Mul<Vec3<From>> for Rot<To, From> {
    type Output = Vec3<To>;

    fn mul(self, v: Vec3<From>) -> Vec3<To> {
        Vec3(self.0 * v.0, PhantomData)
    }
}

impl<To, From> fmt::Debug for Rot<To, From> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:?}", self.wxyz())
    }
}

/// Position and attitude of the vehicle in the tunnel.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Pose {
    /// Position of the body frame's origin in the tunnel.
    pub position: Point3<Tunnel>,
    /// Rotation from body to tunnel frame.
    pub attitude: Rot<Tunnel, Body>,
}

impl Pose {
    /// Returns the tunnel-frame position of a body-frame point.
    pub fn place(&self, offset: Vec3<Body>) -> Point3<Tunnel> {
        debug_assert!(self.attitude.is_unit(), "an attitude is a unit quaternion: {:?}", self.attitude);
        self.position + self.attitude * offset
    }
}

/// Position and attitude of a sensor on the vehicle.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Mount {
    /// Position of the sensor frame's origin in the body frame.
    pub position: Vec3<Body>,
    /// Rotation from sensor to body frame.
    pub rotation: Rot<Body, Sensor>,
}

/// Returns the direction of a head's beam at `angle_rad`, in the sensor frame.
///
/// The angle is 0 down, and grows clockwise as seen along +x.
///
/// Source: docs/reference/glossary.md, "Sonar and samples".
pub fn head_direction(angle_rad: f64) -> Vec3<Sensor> {
    let (sin, cos) = math::sin_cos(angle_rad);
    Vec3::new(0.0, sin, -cos)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn near(a: Vec3<Body>, b: [f64; 3]) {
        for (x, y) in a.0.iter().zip(b) {
            assert!((x - y).abs() < 1e-15, "{a:?} is not {b:?}");
        }
    }

    #[test]
    fn aft_facing_head_rotates_in_the_opposite_sense() {
        let aft = Rot::<Body, Sensor>::from_roll_pitch_yaw(0.0, 0.0, math::PI);
        near(aft * head_direction(0.0), [0.0, 0.0, -1.0]);
        near(aft * head_direction(math::FRAC_PI_2), [0.0, -1.0, 0.0]);
    }

    #[test]
    fn echosounder_axis_follows_yaw_and_pitch() {
        let ahead = Vec3::<Sensor>::new(1.0, 0.0, 0.0);
        let left = Rot::<Body, Sensor>::from_roll_pitch_yaw(0.0, 0.0, math::FRAC_PI_2);
        near(left * ahead, [0.0, 1.0, 0.0]);
        let up = Rot::<Body, Sensor>::from_roll_pitch_yaw(0.0, -math::FRAC_PI_2, 0.0);
        near(up * ahead, [0.0, 0.0, 1.0]);
    }

    #[test]
    fn roll_pitch_yaw_round_trip_returns_the_angles() {
        for (roll, pitch, yaw) in [(0.1, -0.2, 3.0), (-3.0, 1.5, -1.0), (0.0, 0.0, 0.0)] {
            let (r, p, y) = Rot::<Tunnel, Body>::from_roll_pitch_yaw(roll, pitch, yaw).roll_pitch_yaw();
            assert!((r - roll).abs() < 1e-12 && (p - pitch).abs() < 1e-12 && (y - yaw).abs() < 1e-12);
        }
    }

    #[test]
    fn quaternion_of_zero_length_is_rejected() {
        assert!(Rot::<Tunnel, Body>::from_wxyz(0.0, 0.0, 0.0, 0.0).is_none());
        assert!(Rot::<Tunnel, Body>::from_wxyz(f64::NAN, 0.0, 0.0, 1.0).is_none());
    }
}
