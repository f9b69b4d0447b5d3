//! The equations of Jorge et al. 2021: turns, the spiral of samples, and the closed forms for flat and circular walls.

use headrace_sampling::{head, section, spacing};
use pyo3::{pyclass, pyfunction, pymethods};

use crate::errors::Failure;

/// Rotation of a head in equal steps, with a ping at each step and a whole number of steps to a turn (Jorge et al.
/// 2021, Eq. 3).
///
/// Raises SamplingError for a step or period that isn't above zero, or a step that doesn't divide a turn.
#[pyclass(frozen, eq, module = "headrace")]
#[derive(PartialEq)]
pub(crate) struct Turn {
    turn: head::Turn,
}

impl Turn {
    pub(crate) fn of(&self) -> head::Turn {
        self.turn
    }
}

#[pymethods]
impl Turn {
    #[new]
    fn new(step_rad: f64, period_s: f64) -> Result<Self, Failure> {
        Ok(Self { turn: head::Turn::new(step_rad, period_s)? })
    }

    /// theta: angle between two pings, rad.
    #[getter]
    fn step_rad(&self) -> f64 {
        self.turn.step_rad()
    }

    /// T: time of a whole turn, s.
    #[getter]
    fn period_s(&self) -> f64 {
        self.turn.period_s()
    }

    /// n: pings to a turn (Eq. 3).
    #[getter]
    fn steps(&self) -> u32 {
        self.turn.steps()
    }

    /// T_s: time between two pings, s.
    #[getter]
    fn ping_period_s(&self) -> f64 {
        self.turn.ping_period_s()
    }

    /// omega: angle turned per second, rad/s (Eq. 4).
    #[getter]
    fn rate_radps(&self) -> f64 {
        self.turn.rate_radps()
    }

    fn __repr__(&self) -> String {
        format!("Turn(step_rad={:?}, period_s={:?})", self.turn.step_rad(), self.turn.period_s())
    }
}

/// The spiral of samples on the wall at a constant speed.
///
/// `passes_per_turn` is the number of passes over a place in the time of one turn. It is 1 for a single head, s for s
/// heads in phase shift, and s / 2 for s heads in sectors.
/// Raises SamplingError for a negative speed, or passes that aren't above zero.
#[pyclass(frozen, module = "headrace")]
pub(crate) struct Spiral {
    spiral: spacing::Spiral,
}

#[pymethods]
impl Spiral {
    #[new]
    fn new(speed_mps: f64, turn: &Turn, passes_per_turn: f64) -> Result<Self, Failure> {
        Ok(Self { spiral: spacing::Spiral::new(speed_mps, turn.turn, passes_per_turn)? })
    }

    /// d: distance travelled between two pings, m (Eq. 11).
    #[getter]
    fn advance_m(&self) -> f64 {
        self.spiral.advance_m()
    }

    /// T_x of one head: distance travelled in a turn, m (Eq. 12).
    #[getter]
    fn pitch_m(&self) -> f64 {
        self.spiral.pitch_m()
    }

    /// T_x: distance along the tunnel between passes over a place, m (sections 5.1 and 5.2).
    #[getter]
    fn t_x_m(&self) -> f64 {
        self.spiral.t_x_m()
    }

    /// T_ymax, m, from the largest step of a head at rest (Eq. 13).
    fn t_y_max_m(&self, t_y2_m: f64) -> f64 {
        self.spiral.t_y_max_m(t_y2_m)
    }

    /// T_ymin, m, from the smallest step of a head at rest (Eq. 14).
    fn t_y_min_m(&self, smallest_step_m: f64) -> f64 {
        self.spiral.t_y_min_m(smallest_step_m)
    }

    /// Mean step along the wall, m. It combines the mean step of a head at rest with the advance during one step.
    fn t_y_mean_m(&self, t_yp_m: f64) -> f64 {
        self.spiral.t_y_mean_m(t_yp_m)
    }

    /// Mean step, m, as printed in Eq. 15: with the advance during a whole turn.
    fn t_y_mean_printed_m(&self, t_yp_m: f64) -> f64 {
        self.spiral.t_y_mean_printed_m(t_yp_m)
    }

    /// T_max, m, from the largest step of a head at rest (Eq. 16).
    fn t_max_m(&self, t_y2_m: f64) -> f64 {
        self.spiral.t_max_m(t_y2_m)
    }

    /// T_mean, m, from the mean step including the advance (Eq. 17).
    fn t_mean_m(&self, t_y_mean_m: f64) -> f64 {
        self.spiral.t_mean_m(t_y_mean_m)
    }

    /// T_min, m, from the smallest step including the advance (Eq. 18).
    fn t_min_m(&self, t_y_min_m: f64) -> f64 {
        self.spiral.t_min_m(t_y_min_m)
    }
}

/// T_max, m: the longer diagonal of four neighbouring samples (Jorge et al. 2021, Eq. 16).
///
/// `t_x_m` is the distance between passes. `advance_m` is the distance travelled between two pings. `t_y_m` is the
/// largest distance between neighbours within a turn.
#[pyfunction]
#[expect(clippy::similar_names, reason = "the paper's, and names of arguments")]
pub(crate) fn t_max_m(t_x_m: f64, advance_m: f64, t_y_m: f64) -> f64 {
    spacing::t_max_m(t_x_m, advance_m, t_y_m)
}

/// The speed at which T_max equals the target, m/s; None if `t_y_m` alone reaches the target (Eq. 16 solved for v).
///
/// `pass_gap_s` is the time between passes (T / s for s heads in phase shift). `ping_period_s` is the time between
/// pings.
#[pyfunction]
pub(crate) fn speed_for_target_mps(
    target_m: f64,
    t_y_m: f64,
    pass_gap_s: f64,
    ping_period_s: f64,
) -> Option<f64> {
    spacing::speed_for_target_mps(target_m, t_y_m, pass_gap_s, ping_period_s)
}

/// T_y1, m: the smallest step on a flat wall, next to the foot of the perpendicular (Eq. 5).
///
/// Raises SamplingError for an argument that isn't above zero, or a step of 90 degrees or more.
#[pyfunction]
pub(crate) fn t_y1_m(distance_m: f64, step_rad: f64) -> Result<f64, Failure> {
    Ok(section::t_y1_m(distance_m, step_rad)?)
}

/// T_y2, m: the m-th step along a flat wall, from (m - 1) theta to m theta (Eq. 6).
///
/// Raises SamplingError for an argument that isn't above zero, or m theta of 90 degrees or more.
#[pyfunction]
pub(crate) fn t_y2_m(distance_m: f64, step_rad: f64, m: u32) -> Result<f64, Failure> {
    Ok(section::t_y2_m(distance_m, step_rad, m)?)
}

/// T_c, m: the step on a circular wall for a head at its centre (Eq. 7).
///
/// Raises SamplingError for an argument that isn't above zero.
#[pyfunction]
pub(crate) fn t_c_m(radius_m: f64, step_rad: f64) -> Result<f64, Failure> {
    Ok(section::t_c_m(radius_m, step_rad)?)
}

/// Mean of the first m steps along a flat wall, m (Eq. 8 and 9).
///
/// Raises SamplingError for an argument that isn't above zero, or m theta of 90 degrees or more.
#[pyfunction]
pub(crate) fn t_y2_mean_m(distance_m: f64, step_rad: f64, m: u32) -> Result<f64, Failure> {
    Ok(section::t_y2_mean_m(distance_m, step_rad, m)?)
}

/// T_yp, m: upper bound of the mean step of a turn, perimeter by pings (Eq. 10).
///
/// Raises SamplingError for an argument that isn't above zero.
#[pyfunction]
pub(crate) fn t_yp_m(perimeter_m: f64, steps: u32) -> Result<f64, Failure> {
    Ok(section::t_yp_m(perimeter_m, steps)?)
}

/// epsilon: overlap of neighbouring beams; below 1 there is none (Eq. 22).
///
/// Raises SamplingError for an argument that isn't above zero.
#[pyfunction]
pub(crate) fn overlap(beam_rad: f64, step_rad: f64) -> Result<f64, Failure> {
    Ok(section::overlap(beam_rad, step_rad)?)
}

/// eta, m: range resolution of a head, its span of ranges divided by the number of counts (section 6).
///
/// Raises SamplingError for no counts, a negative least range, or an empty span.
#[pyfunction]
pub(crate) fn range_resolution_m(least_m: f64, most_m: f64, counts: u32) -> Result<f64, Failure> {
    Ok(section::range_resolution_m(least_m, most_m, counts)?)
}

/// Width of a beam that meets a wall at right angles, m (Fig. 15).
///
/// Raises SamplingError for an argument out of range.
#[pyfunction]
pub(crate) fn beam_width_m(range_m: f64, beam_rad: f64) -> Result<f64, Failure> {
    Ok(section::beam_width_m(range_m, beam_rad)?)
}

/// Length of a beam's footprint on a flat wall, in the scan plane, m (section 9.2 and Fig. 15).
///
/// Raises SamplingError for an argument out of range, or an edge of the beam that never meets the wall.
#[pyfunction]
pub(crate) fn footprint_m(distance_m: f64, angle_rad: f64, beam_rad: f64) -> Result<f64, Failure> {
    Ok(section::footprint_m(distance_m, angle_rad, beam_rad)?)
}
