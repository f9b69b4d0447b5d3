//! Detects a divergent filter: a wrong estimate gates out every measurement that would correct it.

use serde::{Deserialize, Serialize};

use super::measure::ScalarUpdate;
use super::state::{ATTITUDE, ERRORS, Errors, HEADING, POSITION, VELOCITY};
use headrace_sensor::device::SensorKind;

/// Averaging length, in measurements of a kind.
const MEMORY: u32 = 40;
/// Minimum share of them within the gate; below it, what they measure is lost and reacquired.
const LEAST_AGREEING: f64 = 0.35;
/// Standard deviations added then: across the tunnel, along it, and of the attitude; m, m/s, radians.
const LOST_M: f64 = 1.5;
const LOST_MPS: f64 = 1.0;
const LOST_WAY_M: f64 = 100.0;
const LOST_WAY_MPS: f64 = 10.0;
const LOST_TILT_RAD: f64 = 0.1;
const LOST_RAD: f64 = 1.0;

/// Whether ranges agree with the wall, the cable with the chainage, and attitudes with the tilt.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Agreement {
    wall: Memory,
    way: Memory,
    tilt: Memory,
}

/// Share of recent measurements of a kind within the gate.
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

    /// Whether they disagree; if so, the average restarts.
    fn is_lost(&mut self) -> bool {
        let is_lost = self.seen == MEMORY && self.agreeing < LEAST_AGREEING;
        if is_lost {
            *self = Self::default();
        }
        is_lost
    }
}

impl Agreement {
    /// Notes whether a scalar update of such a sensor passed its gate.
    pub fn note(&mut self, kind: SensorKind, row: &ScalarUpdate, agrees: bool) {
        match kind {
            SensorKind::Head | SensorKind::Echosounder { .. } => self.wall.note(agrees),
            SensorKind::Tether { .. } => self.way.note(agrees),
            // Tilt alone: a compass may stay disturbed for long.
            SensorKind::Imu if row.h.get(HEADING) == Some(&0.0) => self.tilt.note(agrees),
            _ => {}
        }
    }

    /// Variances to add when a kind of measurement no longer agrees: to the part of the state that it measures, and to what
    /// may have moved it. `None` while all agree.
    pub fn seek(&mut self) -> Option<Errors> {
        let [wall, way, tilt] = [&mut self.wall, &mut self.way, &mut self.tilt].map(Memory::is_lost);
        let lost = [
            (wall, POSITION + 1..POSITION + 3, LOST_M),
            (wall, VELOCITY + 1..VELOCITY + 3, LOST_MPS),
            // Nothing is linearized about the chainage: any distance will do.
            (way, POSITION..POSITION + 1, LOST_WAY_M),
            (way, VELOCITY..VELOCITY + 1, LOST_WAY_MPS),
            // A tilt error moves the estimate too, through gravity.
            (wall || way, ATTITUDE..ATTITUDE + 2, LOST_TILT_RAD),
            (tilt, ATTITUDE..ATTITUDE + 3, LOST_RAD),
        ];
        let mut variances = [0.0; ERRORS];
        for (_, errors, reach) in lost.into_iter().filter(|(is_lost, ..)| *is_lost) {
            for slot in variances.iter_mut().take(errors.end).skip(errors.start) {
                *slot += reach * reach;
            }
        }
        (wall || way || tilt).then_some(variances)
    }
}
