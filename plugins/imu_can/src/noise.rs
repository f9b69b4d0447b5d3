//! Noise of the units after which the presets are named, from their makers' data sheets.

use headrace_sensor::device::{BiasSpec, InertialNoise};

use crate::codec::MessageSet;

/// One degree, radians.
const DEGREE: f64 = core::f64::consts::PI / 180.0;
/// One degree an hour, rad/s.
const DEGREE_AN_HOUR: f64 = DEGREE / 3600.0;
/// A millionth of standard gravity, m/s^2.
const MICRO_G: f64 = 9.806_65e-6;
/// Time constant of the bias wander, s. The Allan deviation of a unit usually has its minimum near this time, and data
/// sheets state the in-run stability at this minimum.
const WANDERS_OVER_S: f64 = 300.0;
/// Constant bias of a factory-calibrated unit after power-on, rad/s.
///
/// It is the turn rate that a unit reads while it rests on deck. Data sheets state larger limits, which hold for the
/// worst case of a year (0.2 degrees/s, 30 mm/s^2).
const GYRO_TURN_ON: f64 = 0.05 * DEGREE;
const ACCEL_TURN_ON_MPS2: f64 = 0.02;
/// In-run instability of accelerometers, increased for mounting, temperature and resolution, m/s^2.
const ACCEL_IN_RUN_MPS2: f64 = 2e-3;

/// Noise of the inertial unit after which a message set is named; `None` if the set covers many units.
pub(crate) fn of(set: MessageSet) -> Option<InertialNoise> {
    match set {
        // MT1603P: 0.007 degrees/s/sqrt(Hz), 8 degrees/h, 60 ug/sqrt(Hz). A resolution of 2^-9 rad/s at 100 Hz adds
        // 0.003 degrees/s/sqrt(Hz).
        MessageSet::Xsens(_) => Some(unit(0.0077 * DEGREE, 8.0 * DEGREE_AN_HOUR, 60.0 * MICRO_G)),
        // Ellipse: 0.15 degrees/sqrt(h), 7 degrees/h, 57 ug/sqrt(Hz). The resolution is 1e-3 rad/s and 1e-2 m/s^2.
        MessageSet::Sbg => Some(unit(0.003 * DEGREE, 7.0 * DEGREE_AN_HOUR, 65.0 * MICRO_G)),
        MessageSet::J1939(_) | MessageSet::Bosch => None,
    }
}

fn unit(rate_noise: f64, rate_in_run: f64, force_noise: f64) -> InertialNoise {
    InertialNoise {
        rate_noise,
        rate_bias: BiasSpec { turn_on: GYRO_TURN_ON, in_run: rate_in_run, time_s: WANDERS_OVER_S },
        force_noise,
        force_bias: BiasSpec {
            turn_on: ACCEL_TURN_ON_MPS2,
            in_run: ACCEL_IN_RUN_MPS2,
            time_s: WANDERS_OVER_S,
        },
    }
}
