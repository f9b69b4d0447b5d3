//! Motion statistics of the vehicle and its heads per beat, stored with each section's passage.

use bevy_ecs::prelude::Component;
use serde::{Deserialize, Serialize};

use headrace_geometry::frames::Vec3;
use headrace_geometry::time::{DurNs, MonoNs};
use headrace_geometry::tunnel::Profile;
use headrace_sampling::advice::Advisor;
use headrace_sampling::head::HeadMotion;
use headrace_sampling::passes::{Phasing, Situation};
use headrace_sampling::swing::Looks;
use headrace_snapshot::stateful;

/// Maximum look-back over the time between neighbouring passes, seconds.
const LONGEST_S: f64 = 50.0;
/// Speed below which the vehicle counts as stationary, m/s.
const SLOW_MPS: f64 = 0.01;

/// Motion statistics at the last beat.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub(super) struct Driven {
    /// The longest time between two passes, seconds.
    pub(super) gap_s: f64,
    /// The same with the heads evenly spread, seconds.
    pub(super) even_gap_s: f64,
    /// The same with all configured heads turning and evenly spread, seconds.
    pub(super) all_gap_s: f64,
    /// Time between two pings, seconds.
    pub(super) ping_period_s: f64,
    /// How far the beams have swung along the tunnel since the neighbouring passes, where they reach farthest, m.
    pub(super) swing_m: f64,
    /// Largest step along the wall predicted from the middle of the tunnel, m.
    pub(super) middle_t_y_m: f64,
}

/// Motion statistics of the last beat, and the forward axis at earlier ones.
#[derive(Debug, Clone, Default, Component)]
pub(crate) struct Driving {
    pub(super) now: Driven,
    /// The step for which `middle_t_y_m` was looked up, in soundings of a ring.
    stride: usize,
    /// The last beat at which a head turned.
    turned: Option<MonoNs>,
    looks: Looks,
}

stateful!(Driving { state: now, stride, turned, looks; });

impl Driving {
    /// Updates the statistics for a beat.
    ///
    /// Allocates: never.
    pub(super) fn note(&mut self, at: MonoNs, situation: &Situation, profile: &Profile, advisor: &Advisor) {
        self.note_gaps(at, situation);
        let step_rad = situation.heads.iter().flatten().map(|motion| motion.step_rad).fold(0.0, f64::max);
        let stride = Advisor::stride(step_rad);
        if step_rad > 0.0 && stride != self.stride {
            self.stride = stride;
            self.now.middle_t_y_m = advisor.middle_step_m(step_rad);
        }
        let Some(pose) = situation.pose else {
            self.now.swing_m = 0.0;
            return;
        };
        let look = pose.attitude * Vec3::new(1.0, 0.0, 0.0);
        // Neighbouring passes may be those of heads apart along the hull.
        let apart_s = apart_m(situation) / situation.speed_mps.abs().max(SLOW_MPS);
        let since = at - DurNs::from_secs_f64((self.now.gap_s + apart_s).min(LONGEST_S));
        let turned_rad = self.looks.turned_since(look, since);
        self.now.swing_m = turned_rad * profile.farthest_m([pose.position.y(), pose.position.z()]);
        self.looks.keep(at, look);
    }

    fn note_gaps(&mut self, at: MonoNs, situation: &Situation) {
        let turning = situation.heads.iter().flatten().count();
        if turning == 0 {
            // Until a head turns again the time between two passes grows.
            if let Some(turned) = self.turned.replace(at) {
                self.now.gap_s += at.since(turned).as_secs_f64().max(0.0);
                self.now.even_gap_s = self.now.gap_s;
            }
            return;
        }
        self.turned = Some(at);
        let passes = Phasing::of(situation).at(situation.speed_mps);
        let even_gap_s = passes.even_gap_s();
        let share = turning as f64 / situation.configured.max(1) as f64;
        let periods = situation.heads.iter().flatten().map(HeadMotion::ping_period_s);
        self.now = Driven {
            gap_s: passes.gap_s(passes.heads()).unwrap_or(0.0),
            even_gap_s,
            all_gap_s: even_gap_s * share,
            ping_period_s: periods.fold(0.0, f64::max),
            ..self.now
        };
    }
}

/// How far apart along the hull the heads that turn are, m.
fn apart_m(situation: &Situation) -> f64 {
    let x_m = || situation.heads.iter().flatten().map(|motion| motion.mount.position.x());
    (x_m().fold(f64::NEG_INFINITY, f64::max) - x_m().fold(f64::INFINITY, f64::min)).max(0.0)
}
