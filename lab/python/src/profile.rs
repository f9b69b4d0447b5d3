//! Tunnel profiles: the unrolled wall, and a stationary head in front of it.

use std::path::PathBuf;

use headrace_geometry::frames::{Mount, Point3, Pose, Rot, Vec3};
use headrace_geometry::tunnel::{self, shapes};
use headrace_sampling::ring::{Ring, Standing};
use pyo3::{Bound, PyAny, PyResult, Python, pyclass, pymethods};

use crate::arguments::{Coordinates, array, points};
use crate::errors::Failure;
use crate::spacing::Turn;
use crate::vehicle;

/// Number of computed ranges per step of the head. With this number the largest step is found for any phase of the
/// pings within the turn.
const PER_STEP: u32 = 10;

/// A tunnel's design profile: a closed cross-section in y (left) and z (up from the floor's centre), m.
///
/// Arc length runs around the cross-section from the floor's centre via the left wall, crown and right wall.
#[pyclass(frozen, module = "headrace")]
pub(crate) struct Profile {
    profile: tunnel::Profile,
}

impl Profile {
    pub(crate) fn of(profile: tunnel::Profile) -> Self {
        Self { profile }
    }
}

#[pymethods]
impl Profile {
    /// A rectangle on the floor.
    ///
    /// Raises SamplingError for dimensions that don't give a profile.
    #[staticmethod]
    fn rectangle(width_m: f64, height_m: f64) -> Result<Self, Failure> {
        Ok(Self::of(shapes::rectangle(width_m, height_m)?))
    }

    /// A circle.
    ///
    /// Raises SamplingError for dimensions that don't give a profile.
    #[staticmethod]
    fn circle(radius_m: f64) -> Result<Self, Failure> {
        Ok(Self::of(shapes::circle(radius_m)?))
    }

    /// Vertical walls under an arc; `height_m` is that of the crown (Jorge et al. 2021, Fig. 2).
    ///
    /// Raises SamplingError for dimensions that don't give a profile.
    #[staticmethod]
    fn arch(width_m: f64, height_m: f64, arch_radius_m: f64) -> Result<Self, Failure> {
        Ok(Self::of(shapes::arch(width_m, height_m, arch_radius_m)?))
    }

    /// A circle whose lower part is cut off by a floor of width `base_m`.
    ///
    /// Raises SamplingError for dimensions that don't give a profile.
    #[staticmethod]
    fn trimmed_circle(radius_m: f64, base_m: f64) -> Result<Self, Failure> {
        Ok(Self::of(shapes::trimmed_circle(radius_m, base_m)?))
    }

    /// The tunnel of Jorge et al. 2021 with its stated dimensions: perimeter 35.90 m.
    #[staticmethod]
    fn ceran() -> Result<Self, Failure> {
        Ok(Self::of(shapes::ceran()?))
    }

    /// The tunnel of Jorge et al. 2021, scaled to the perimeter of its blueprint, 34.17 m.
    #[staticmethod]
    fn ceran_blueprint() -> Result<Self, Failure> {
        Ok(Self::of(shapes::ceran_blueprint()?))
    }

    /// The profile of a vehicle file.
    ///
    /// Raises ConfigError if the file can't be read or is invalid.
    #[staticmethod]
    #[expect(clippy::needless_pass_by_value, reason = "made for this call")]
    fn of_vehicle(vehicle: PathBuf) -> Result<Self, Failure> {
        let (_, vehicle) = vehicle::read(&vehicle)?;
        Ok(Self::of(vehicle.tunnel.profile))
    }

    /// Length of the closed curve, m.
    #[getter]
    fn perimeter_m(&self) -> f64 {
        self.profile.perimeter_m()
    }

    /// y and z of the point from which the whole wall is visible, m.
    #[getter]
    fn reference_m(&self) -> (f64, f64) {
        let [y_m, z_m] = self.profile.reference();
        (y_m, z_m)
    }

    /// Whether a point is inside the profile.
    fn contains(&self, y_m: f64, z_m: f64) -> bool {
        self.profile.contains([y_m, z_m])
    }

    /// Arc lengths of points, m, as seen from the reference point: the second coordinate of the unrolled wall.
    ///
    /// Raises ValueError for lists of different lengths, or a coordinate that isn't finite.
    #[expect(clippy::needless_pass_by_value, reason = "made for this call")]
    fn arc_m<'py>(&self, py: Python<'py>, y_m: Coordinates, z_m: Coordinates) -> PyResult<Bound<'py, PyAny>> {
        let points = points(["y_m", "z_m"], &y_m, &z_m)?;
        let arcs_m = py.detach(|| points.iter().map(|point| self.profile.arc_of(*point)).collect::<Vec<_>>());
        array(py, &arcs_m)
    }

    /// y and z of the wall at an arc length, m.
    fn point_at_m(&self, arc_m: f64) -> (f64, f64) {
        let [y_m, z_m] = self.profile.point_at(arc_m);
        (y_m, z_m)
    }

    /// Clock position of an arc length, as seen looking along the tunnel: "6:00" is the floor's centre, "9:00" the left
    /// wall.
    fn clock(&self, arc_m: f64) -> String {
        self.profile.clock(arc_m)
    }

    /// T_y at rest of a head at (y_m, z_m): the least, mean and largest straight distance between neighbouring samples
    /// of one turn, m. The general case of the paper's Eq. 5, 6 and 10, by ray casting.
    ///
    /// Raises SamplingError for a head outside the profile.
    fn t_y_at_rest_m(&self, y_m: f64, z_m: f64, turn: &Turn) -> Result<(f64, f64, f64), Failure> {
        let pose = Pose { position: Point3::new(0.0, y_m, z_m), attitude: Rot::identity() };
        let mount = Mount { position: Vec3::zero(), rotation: Rot::identity() };
        let standing = Standing::new(&self.profile, &pose, &mount)?;
        let ring = Ring::cast(&standing, 0.0, PER_STEP * turn.of().steps())?;
        let [least_m, mean_m, most_m] = ring.chords_m(PER_STEP as usize);
        Ok((least_m, mean_m, most_m))
    }

    fn __repr__(&self) -> String {
        format!("<Profile, perimeter {:.3} m>", self.profile.perimeter_m())
    }
}
