//! Tests of the effect of zero-velocity updates on the filter.

use crate::filter::eskf::Eskf;
use crate::filter::factors::Factors;
use crate::filter::state::{ERRORS, Errors, RATE_BIAS, State, VELOCITY};
use headrace_geometry::frames::{Point3, Rot, Vec3};
use headrace_geometry::time::MonoNs;

/// Returns an estimate that moves at this speed along one axis, with a standard deviation of 0.02 m/s.
///
/// The standard deviation of the gyro bias is 1e-3 rad/s.
fn moving(axis: usize, speed_mps: f64) -> Eskf {
    let mut variances: Errors = [0.0; ERRORS];
    variances[VELOCITY..VELOCITY + 3].fill(0.02 * 0.02);
    variances[RATE_BIAS..RATE_BIAS + 3].fill(1e-3 * 1e-3);
    let along = |k: usize| if k == axis { speed_mps } else { 0.0 };
    let velocity_mps = Vec3::new(along(0), along(1), along(2));
    let state = State { velocity_mps, ..State::at_rest(Point3::zero(), Rot::identity()) };
    let mut eskf = Eskf::default();
    eskf.begin(MonoNs(0), state, Factors::independent(variances));
    eskf
}

/// The difference of two normal errors with an sd of 0.02 m/s each exceeds 0.11 m/s once in ten thousand times. The
/// test values lie on either side of this.
#[test]
fn zero_velocity_update_is_skipped_for_motion_in_any_direction() {
    let turn = Vec3::new(2e-3, -4e-3, 6e-3);
    for (axis, side) in [(0, 1.0), (0, -1.0), (1, 1.0), (1, -1.0), (2, 1.0), (2, -1.0)] {
        let mut moves = moving(axis, side * 0.115);
        let before = moves.state;
        moves.rest(Some(turn));
        assert_eq!(moves.state, before, "{axis} {side}: a moving vehicle must not be corrected");
        let mut at_rest = moving(axis, side * 0.105);
        at_rest.rest(Some(turn));
        // The estimated velocity and the zero-velocity update are equally uncertain, so the result is their mean.
        let half = at_rest.state.velocity_mps.scaled(2.0) + -before.velocity_mps.scaled(0.105 / 0.115);
        assert!(half.norm() < 1e-12, "{axis} {side}: {:?}", at_rest.state.velocity_mps);
        let bias = at_rest.state.rate_bias_radps + -turn.scaled(0.5);
        assert!(bias.norm() < 1e-12, "{axis} {side}: {:?}", at_rest.state.rate_bias_radps);
    }
}
