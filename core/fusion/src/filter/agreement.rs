//! Detection of a divergent filter, whose wrong estimate rejects all measurements that would correct it.

use core::ops::Range;

use serde::{Deserialize, Serialize};

use super::measure::ScalarUpdate;
use super::state::{ATTITUDE, Errors, HEADING, POSITION, RANGES, VELOCITY};
use headrace_sensor::device::SensorKind;

/// Number of recent measurements of one kind from which the share within the gate is computed.
const MEMORY: u32 = 40;
/// Minimum share of measurements within the gate. Below it, the measured quantity counts as lost and is reacquired.
const LEAST_AGREEING: f64 = 0.35;
/// If a quantity is lost, the square of one of these standard deviations is added to its variance. Units: m, m/s,
/// radians, a ratio.
///
/// `LOST_M` and `LOST_MPS` apply to position and velocity across the tunnel. `LOST_WAY_M` and `LOST_WAY_MPS` apply to
/// position and velocity along the tunnel. The other constants apply to the attitude and to the scale of ranges.
const LOST_M: f64 = 1.5;
const LOST_MPS: f64 = 1.0;
const LOST_WAY_M: f64 = 100.0;
const LOST_WAY_MPS: f64 = 10.0;
const LOST_TILT_RAD: f64 = 0.1;
const LOST_YAW_RAD: f64 = 0.1;
const LOST_RAD: f64 = 1.0;
const LOST_SCALE: f64 = 0.03;

/// Tracks how well ranges agree with the wall, and attitudes with the estimated tilt. The agreement of the cable is
/// tracked in `cable.rs`.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Agreement {
    wall: Memory,
    tilt: Memory,
}

/// Share of recent measurements of one kind that passed the gate.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
struct Memory {
    seen: u32,
    agreeing: f64,
}

impl Default for Memory {
    fn default() -> Self {
        Self { seen: 0, agreeing: 1.0 }
    }
}

impl Memory {
    fn note(&mut self, agrees: bool) {
        self.seen = (self.seen + 1).min(MEMORY);
        let share = 1.0 / f64::from(self.seen.max(1));
        self.agreeing += share * (f64::from(u8::from(agrees)) - self.agreeing);
    }

    /// Whether the estimate is wrong, because too few measurements passed the gate. If so, the average restarts.
    fn is_lost(&mut self) -> bool {
        let is_lost = self.seen == MEMORY && self.agreeing < LEAST_AGREEING;
        if is_lost {
            *self = Self::default();
        }
        is_lost
    }
}

impl Agreement {
    /// Records whether a scalar update of a sensor of this kind passed its gate.
    pub fn note(&mut self, kind: SensorKind, row: &ScalarUpdate, agrees: bool) {
        match kind {
            SensorKind::Head | SensorKind::Echosounder { .. } => self.wall.note(agrees),
            // For attitudes, only the tilt is checked, because a compass may stay disturbed for long.
            SensorKind::Imu if row.h.get(HEADING) == Some(&0.0) => self.tilt.note(agrees),
            _ => {}
        }
    }

    /// Increases variances of the estimate if one kind of measurement no longer agrees with the estimate.
    ///
    /// Variances increase for the measured part of the state, and for errors that may have caused the disagreement.
    pub fn seek(&mut self, variances: &mut Errors) {
        let [wall, tilt] = [&mut self.wall, &mut self.tilt].map(Memory::is_lost);
        if wall {
            add(variances, POSITION + 1..POSITION + 3, LOST_M);
            add(variances, VELOCITY + 1..VELOCITY + 3, LOST_MPS);
            // A tilt error also moves the estimate, through gravity. The cause of the tilt error has probably also
            // caused a yaw error, and the estimated compass deviation may have absorbed this yaw error.
            add(variances, ATTITUDE..ATTITUDE + 2, LOST_TILT_RAD);
            add(variances, ATTITUDE + 2..ATTITUDE + 3, LOST_YAW_RAD);
            add(variances, HEADING..HEADING + 1, LOST_YAW_RAD);
            // The scale of ranges may be wrong, because the tunnel may be wider here than before.
            add(variances, RANGES..RANGES + 1, LOST_SCALE);
        }
        if tilt {
            add(variances, ATTITUDE..ATTITUDE + 3, LOST_RAD);
        }
    }
}

/// Increases the variances of chainage, speed and tilt when the chainage is lost. The chainage's variance may increase
/// by (100 m)^2, because no model is linearised about the chainage.
pub fn seek_way(variances: &mut Errors) {
    add(variances, POSITION..POSITION + 1, LOST_WAY_M);
    add(variances, VELOCITY..VELOCITY + 1, LOST_WAY_MPS);
    add(variances, ATTITUDE..ATTITUDE + 2, LOST_TILT_RAD);
}

fn add(variances: &mut Errors, errors: Range<usize>, sd: f64) {
    for slot in variances.iter_mut().take(errors.end).skip(errors.start) {
        *slot += sd * sd;
    }
}
