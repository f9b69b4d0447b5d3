//! A profiling head in the terms of sampling theory: rotation, mounting and program.

use super::error::{SamplingError, positive};
pub use super::head_set::{HeadSet, MAX_HEADS};
use headrace_geometry::frames::{Body, Mount, Rot, Sensor, head_direction};
use headrace_geometry::math::{self, TAU};
use headrace_geometry::time::DurNs;

/// Duration without a return after which a head counts as silent.
///
/// Headrace stops waiting for the returns of a silent head, and leaves the head out of the advice.
pub const SILENT_AFTER: DurNs = DurNs(2_000_000_000);

/// Tolerance, in steps, with which a turn must be a whole number of steps. It is needed because steps are given in
/// decimal degrees.
const WHOLE_STEPS: f64 = 1e-6;
/// Maximum number of angular steps per turn of a head.
const MAX_STEPS: f64 = 100_000.0;

/// Rotation of a head in a whole number of equal steps per turn, with a ping at each step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Turn {
    step_rad: f64,
    period_s: f64,
    steps: u32,
}

impl Turn {
    /// Creates a turn of `period_s` seconds in steps of `step_rad`, from 1 to 100,000 steps.
    ///
    /// Errors: a step or period that isn't above zero; a step that doesn't divide a turn.
    /// Source: Jorge et al. 2021, Eq. 3 (n = 2 pi / theta).
    pub fn new(step_rad: f64, period_s: f64) -> Result<Self, SamplingError> {
        positive("the step in radians", step_rad)?;
        positive("the turn's period in seconds", period_s)?;
        let steps = TAU / step_rad;
        let whole = math::round_to_i64(steps);
        let refused = SamplingError::StepDoesNotDivide { step_deg: step_rad.to_degrees(), steps };
        if whole < 1 || steps > MAX_STEPS || (steps - whole as f64).abs() > WHOLE_STEPS {
            return Err(refused);
        }
        let steps = u32::try_from(whole).map_err(|_| refused)?;
        Ok(Self { step_rad, period_s, steps })
    }

    /// theta: angle between two pings, radians.
    pub fn step_rad(&self) -> f64 {
        self.step_rad
    }

    /// T: time of a whole turn, seconds.
    pub fn period_s(&self) -> f64 {
        self.period_s
    }

    /// n: pings per turn. Source: Jorge et al. 2021, Eq. 3.
    pub fn steps(&self) -> u32 {
        self.steps
    }

    /// T_s: time between two pings, seconds.
    pub fn ping_period_s(&self) -> f64 {
        self.period_s / f64::from(self.steps)
    }

    /// omega: angle turned per second, rad/s. Source: Jorge et al. 2021, Eq. 4.
    pub fn rate_radps(&self) -> f64 {
        TAU / self.period_s
    }
}

/// Origin of the stated turn period of a mode.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Basis {
    /// Period measured on this head at this range setting, from the vehicle file.
    Measured,
    /// Period from the manufacturer's table, at the table's range setting.
    Table,
    /// Period estimated from the period at another range setting.
    Estimated,
}

impl Basis {
    /// Name of the turn period's origin in tables.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Measured => "measured",
            Self::Table => "table",
            Self::Estimated => "estimated",
        }
    }
}

/// A rotation mode of a head, at its range setting.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HeadMode {
    /// Name of the mode in vehicle files.
    pub name: &'static str,
    /// Angular step and turn period.
    pub turn: Turn,
    /// Origin of the turn period.
    pub basis: Basis,
}

/// The body of a head: a cylinder around the head's axis, which may occlude neighbouring heads.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HeadBody {
    /// Radius of the body, m; zero for a head without a body.
    pub radius_m: f64,
    /// Extent of the body ahead of the beam, along the sensor's +x, m.
    pub ahead_m: f64,
    /// Extent of the body behind the beam, m.
    pub behind_m: f64,
}

/// Properties of a head that are needed to schedule its rotation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HeadSpec {
    /// Position and attitude of the head on the vehicle.
    pub mount: Mount,
    /// Angle between two pings, radians.
    pub step_rad: f64,
    /// Time between two pings, seconds.
    pub ping_period_s: f64,
    /// Smallest and largest range at the head's range setting, m, as computed with `sound_speed_mps`.
    pub range_m: [f64; 2],
    /// Speed of sound with which the head computes ranges, m/s.
    pub sound_speed_mps: f64,
    /// zeta: full width of the beam, radians.
    pub beam_rad: f64,
    /// Body of the head, which may occlude other heads.
    pub body: HeadBody,
}

impl HeadSpec {
    /// Smallest and largest range, m, at which the head detects a wall in water with this speed of sound.
    pub fn reach_m(&self, sound_speed_mps: f64) -> [f64; 2] {
        self.range_m.map(|range_m| range_m * sound_speed_mps / self.sound_speed_mps)
    }
}

/// Rotation program of a head for a dive: start angle, direction and sector. Angles are in the sensor frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HeadProgram {
    /// Head angle at the first ping, radians.
    pub start_rad: f64,
    /// Whether the head's first step is towards growing angles.
    pub growing: bool,
    /// Smallest angle and size of the sector that the head sweeps back and forth, radians; `None` for continuous
    /// rotation.
    pub sector: Option<(f64, f64)>,
}

/// Measured motion of a head that is turning.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HeadMotion {
    /// Position and attitude of the head on the vehicle.
    pub mount: Mount,
    /// Current angle of the head in the sensor frame, radians.
    pub angle_rad: f64,
    /// Rate of the head's rotation, rad/s, positive if its angle grows.
    pub rate_radps: f64,
    /// Angle between two pings, radians, positive.
    pub step_rad: f64,
    /// Size of the sector between the two latest turning points, radians; `None` for continuous rotation.
    pub sector_rad: Option<f64>,
}

impl HeadMotion {
    /// Whether the head turns in steps: the rate isn't zero, the step is positive, and both are finite.
    pub fn is_turning(&self) -> bool {
        let [rate_radps, step_rad] = [self.rate_radps.abs(), self.step_rad];
        rate_radps > 0.0 && rate_radps.is_finite() && step_rad > 0.0 && step_rad.is_finite()
    }

    /// Time of a whole turn at the head's present rate, seconds.
    pub fn turn_period_s(&self) -> f64 {
        TAU / self.rate_radps.abs()
    }

    /// Time between two pings, seconds.
    pub fn ping_period_s(&self) -> f64 {
        self.step_rad / self.rate_radps.abs()
    }
}

/// Whether a head's axis points aft, so that its angles grow in the opposite sense in the body frame.
pub fn faces_aft(rotation: Rot<Body, Sensor>) -> bool {
    (rotation * head_direction(math::FRAC_PI_2)).y() < 0.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn turn_has_a_whole_number_of_steps() {
        for (step_deg, steps) in [(0.3, 1200), (0.6, 600), (0.9, 400), (1.2, 300), (2.4, 150), (360.0, 1)] {
            let turn = Turn::new(f64::to_radians(step_deg), 8.0).unwrap();
            assert_eq!(turn.steps(), steps);
            assert!((turn.ping_period_s() * f64::from(steps) - 8.0).abs() < 1e-12);
            assert!((turn.rate_radps() * turn.ping_period_s() - f64::to_radians(step_deg)).abs() < 1e-12);
        }
    }

    #[test]
    fn error_about_an_invalid_turn_names_the_cause() {
        let why =
            |step_deg: f64, period_s| Turn::new(step_deg.to_radians(), period_s).unwrap_err().to_string();
        assert!(why(0.7, 8.0).starts_with("a step of 0.7"), "{}", why(0.7, 8.0));
        assert!(why(361.0, 8.0).contains("doesn't divide a turn"));
        assert_eq!(why(0.9, 0.0), "the turn's period in seconds is 0; it must be a finite number above zero");
        for step_deg in [0.0, -0.9, f64::NAN, f64::INFINITY] {
            assert!(why(step_deg, 8.0).starts_with("the step in radians"));
        }
        assert!(why(1e-12, 8.0).contains("doesn't divide"));
        assert!(why(0.9, f64::NAN).contains("period"));
    }
}
