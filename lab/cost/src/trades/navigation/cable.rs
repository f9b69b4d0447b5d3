//! Navigation by the cable's counter alone: the simplest possible method, with which all other methods are compared.

use headrace_fusion::relative::Relative;
use headrace_fusion::{Fix, Navigation, NoFix, Times};
use headrace_geometry::frames::{Point3, Pose, Rot};
use headrace_geometry::math;
use headrace_geometry::snapshot::stateful;
use headrace_geometry::time::MonoNs;
use headrace_geometry::tunnel::{Profile, Yz};
use headrace_sensor::device::{SensorInfo, SensorKind};
use headrace_sensor::reading::Reading;

/// Time over which the speed is averaged from the cable counter's readings, s.
const SPEED_OVER_S: f64 = 1.0;
/// Age above which the cable counter's latest reading is ignored, s.
const STALE_S: f64 = 2.0;

/// The chainage of a cable reading, m; `None` for any other reading.
pub(super) fn chainage_m(info: &SensorInfo, reading: &Reading) -> Option<f64> {
    match (info.kind, reading) {
        (SensorKind::Tether { zero_at_m, scale }, Reading::TetherLength(length)) => {
            Some(zero_at_m + scale * length.length_m)
        }
        _ => None,
    }
}

/// Navigation that takes chainage and speed from the counter.
///
/// The vehicle is assumed to be in the middle of the cross-section, level and heading straight ahead. The stated errors
/// come from the counter's resolution.
pub(super) struct CableNavigation {
    middle: Yz,
    /// The latest reading, as time and chainage, m. `before` is a reading about [`SPEED_OVER_S`] earlier.
    last: Option<(MonoNs, f64)>,
    before: Option<(MonoNs, f64)>,
    speed_mps: f64,
    resolution_m: f64,
}

stateful!(CableNavigation { state: last, before, speed_mps, resolution_m; fixed: middle; });

impl CableNavigation {
    /// Creates the navigation without readings.
    pub(super) fn new(profile: &Profile) -> Self {
        Self { middle: profile.reference(), last: None, before: None, speed_mps: 0.0, resolution_m: 0.0 }
    }
}

impl Navigation for CableNavigation {
    fn update(&mut self, _: usize, info: &SensorInfo, times: Times, reading: &Reading) {
        let Some(chainage_m) = chainage_m(info, reading) else { return };
        if let Reading::TetherLength(length) = reading {
            self.resolution_m = length.resolution_m;
        }
        let now = (times.valid, chainage_m);
        let (then, then_m) = *self.before.get_or_insert(now);
        let over_s = times.valid.since(then).as_secs_f64();
        if over_s >= SPEED_OVER_S {
            self.speed_mps = (chainage_m - then_m) / over_s;
            self.before = Some(now);
        }
        self.last = Some(now);
    }

    fn fix(&self, at: MonoNs) -> Result<Fix, NoFix> {
        let (then, chainage_m) = self.last.ok_or(NoFix::Chainage)?;
        let age_s = at.since(then).as_secs_f64();
        if age_s.abs() > STALE_S {
            return Err(NoFix::Chainage);
        }
        let [y_m, z_m] = self.middle;
        let position = Point3::new(chainage_m + self.speed_mps * age_s, y_m, z_m);
        // The difference of two readings contains two independent roundings to the counter's quantum.
        let relative = Relative::along(self.resolution_m * math::sqrt(2.0 / 12.0));
        Ok(Fix {
            pose: Pose { position, attitude: Rot::identity() },
            speed_mps: self.speed_mps,
            relative,
            revisit: relative,
            tie: 0,
            settled: 0,
        })
    }
}
