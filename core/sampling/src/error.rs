//! Errors of sampling theory.

use super::head_set::MAX_HEADS;

/// Reason why a function of this crate has no result.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SamplingError {
    /// A quantity that must be positive is zero or negative.
    #[error("{what} is {value}; it must be a finite number above zero")]
    NotPositive {
        /// The quantity that is not positive, with its unit.
        what: &'static str,
        /// The value of the quantity.
        value: f64,
    },
    /// A quantity that must not be negative is negative or not finite.
    #[error("{what} is {value}; it must be a finite number, zero or above")]
    Negative {
        /// The quantity that is negative or not finite, with its unit.
        what: &'static str,
        /// The value of the quantity.
        value: f64,
    },
    /// The angular step of a head does not divide a turn.
    #[error("a step of {step_deg} degrees doesn't divide a turn of 360 degrees: it would take {steps} steps")]
    StepDoesNotDivide {
        /// The angular step, degrees.
        step_deg: f64,
        /// Number of steps per turn.
        steps: f64,
    },
    /// A beam at or beyond 90 degrees from the perpendicular to a flat wall.
    #[error(
        "a beam {angle_deg} degrees off the perpendicular never meets the flat wall; it must be below 90"
    )]
    BeamMissesWall {
        /// Angle of the beam from the perpendicular, degrees.
        angle_deg: f64,
    },
    /// The beam runs along the tunnel and meets no wall within a kilometre.
    #[error("the beam at a head angle of {angle_deg} degrees runs along the tunnel and meets no wall")]
    BeamAlongTunnel {
        /// Head angle of the beam, degrees.
        angle_deg: f64,
    },
    /// The scan plane of a head lies along the tunnel.
    #[error("a head's axis lies across the tunnel, so its beams run along the tunnel")]
    HeadAskew,
    /// A head outside the tunnel's profile.
    #[error("a head at y = {y_m:.3} m, z = {z_m:.3} m is outside the tunnel's profile")]
    HeadOutside {
        /// Position of the head left of the tunnel's axis, m.
        y_m: f64,
        /// Height of the head above the floor's centre, m.
        z_m: f64,
    },
    /// Sectors are impossible with fewer than two heads.
    #[error("sector offset divides a turn among heads: it needs at least 2, not {heads}")]
    SectorNeedsHeads {
        /// Number of heads.
        heads: usize,
    },
    /// There is no head, or there are more than [`MAX_HEADS`].
    #[error("{heads} heads; from 1 to {MAX_HEADS} are possible")]
    HeadCount {
        /// Number of heads.
        heads: usize,
    },
    /// The heads have no common mode.
    #[error("the heads have no common mode")]
    NoCommonMode,
    /// A planning question has no target, speed or time.
    #[error("nothing to plan: give a target, a speed or a time")]
    NothingAsked,
    /// Heads that are apart along the hull cannot be phased for a stationary vehicle.
    #[error(
        "heads {apart_m} m apart along the hull cannot be started in phase at {speed_mps} m/s; the speed must be above zero"
    )]
    NoPhaseAtRest {
        /// Distance between the heads along the hull, m.
        apart_m: f64,
        /// Speed of the vehicle, m/s.
        speed_mps: f64,
    },
    /// A strip of the wall that no head sees is as wide as the target.
    #[error(
        "no speed meets a target of {target_m} m: no head sees {width_m:.2} m of the wall, {arc_m:.2} m from the floor's centre"
    )]
    UnseenStrip {
        /// The target T, m.
        target_m: f64,
        /// Width of the strip, m.
        width_m: f64,
        /// Arc length of the strip's middle, m.
        arc_m: f64,
    },
    /// The vehicle's heading is too far off the tunnel's axis, or the vehicle swings too fast, for the target at any
    /// speed.
    #[error(
        "no speed meets a target of {target_m} m: because of the heading or swing, passes are farther apart than that"
    )]
    OffAxis {
        /// The target T, m.
        target_m: f64,
    },
    /// Neighbouring samples of one turn are as far apart as the target.
    #[error(
        "no speed meets a target of {target_m} m: neighbouring samples of one turn are {t_y_m:.3} m apart at every speed"
    )]
    AngularStep {
        /// The target T, m.
        target_m: f64,
        /// The largest distance between neighbouring samples of one turn, m.
        t_y_m: f64,
    },
}

impl SamplingError {
    /// Returns the error with the configured target, m.
    ///
    /// The error may name the target minus a margin for position errors.
    #[must_use]
    pub(crate) fn of_target(mut self, asked_m: f64) -> Self {
        if let Self::UnseenStrip { target_m, .. }
        | Self::OffAxis { target_m }
        | Self::AngularStep { target_m, .. } = &mut self
        {
            *target_m = asked_m;
        }
        self
    }
}

/// Returns `value` if it is finite and positive.
///
/// Errors: [`SamplingError::NotPositive`].
pub(crate) fn positive(what: &'static str, value: f64) -> Result<f64, SamplingError> {
    if value.is_finite() && value > 0.0 { Ok(value) } else { Err(SamplingError::NotPositive { what, value }) }
}

/// Returns `value` if it is finite and not negative.
///
/// Errors: [`SamplingError::Negative`].
pub(crate) fn not_negative(what: &'static str, value: f64) -> Result<f64, SamplingError> {
    if value.is_finite() && value >= 0.0 { Ok(value) } else { Err(SamplingError::Negative { what, value }) }
}
