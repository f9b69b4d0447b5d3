//! The effects that a scene may name. Each effect has a file of its own.
//!
//! An effect that the scene doesn't name adds no system, component or random number. Defaults of keys are in brackets.

#![allow(clippy::needless_pass_by_value, reason = "bevy hands systems their arguments by value")]

mod behind;
mod effect;
mod geometry;
mod keys;
mod places;
mod runs;
mod targets;

mod beam_cone;
mod byte_errors;
mod clock_drift;
mod current;
mod depth_noise;
mod depth_steps;
mod device_faults;
mod echo_strength;
mod head_stalls;
mod imu_bias;
mod imu_bumps;
mod imu_noise;
mod imu_vibration;
mod interference;
mod line_delay;
mod magnetic_disturbance;
mod missing_returns;
mod motion_within_turn;
mod mount_error;
mod multipath;
mod near_returns;
mod occlusion;
mod outliers;
mod pilot_drift;
mod range_noise;
mod range_quantisation;
mod sector_end_slowing;
mod side_lobes;
mod skipped_steps;
mod sound_speed_error;
mod sound_speed_profile;
mod start_phase_error;
mod stuck_range;
mod tether_lag;
mod tether_quantum;
mod tether_scale;
mod tether_slack;
mod tether_slip;

use headrace_config::{ConfigError, Document, Section};

use crate::facts::Facts;

pub use beam_cone::Cone;
pub use effect::{Effect, EffectKind};
pub use targets::PerSensor;

/// All effects. Within a stage, systems run in the order of this list, whatever the order in the scene.
pub const KINDS: [&dyn EffectKind; 38] = [
    // The next effects make the vehicle differ from its file.
    &mount_error::MountErrorKind,
    // The next effects act on the turning of heads, and on the pose from which heads look.
    &start_phase_error::StartPhaseErrorKind,
    &sector_end_slowing::SectorEndSlowingKind,
    &skipped_steps::SkippedStepsKind,
    &head_stalls::HeadStallsKind,
    &motion_within_turn::MotionWithinTurnKind,
    // The next effects act on the objects that a beam meets: wall and obstacles.
    &beam_cone::BeamConeKind,
    &occlusion::OcclusionKind,
    // The next effects act on the paths of sound.
    &echo_strength::EchoStrengthKind,
    &multipath::MultipathKind,
    &side_lobes::SideLobesKind,
    &interference::InterferenceKind,
    &near_returns::NearReturnsKind,
    // The next effects act in the sonar's processing.
    &missing_returns::MissingReturnsKind,
    &outliers::OutliersKind,
    &stuck_range::StuckRangeKind,
    &sound_speed_error::SoundSpeedErrorKind,
    &sound_speed_profile::SoundSpeedProfileKind,
    &range_noise::RangeNoiseKind,
    &range_quantisation::RangeQuantisationKind,
    // The next effects act on the vehicle's trajectory.
    &current::CurrentKind,
    &pilot_drift::PilotDriftKind,
    // The next effects act on depth sensors and inertial units.
    &depth_noise::DepthNoiseKind,
    &depth_steps::DepthStepsKind,
    &imu_noise::ImuNoiseKind,
    &imu_bias::ImuBiasKind,
    &imu_vibration::ImuVibrationKind,
    &imu_bumps::ImuBumpsKind,
    &magnetic_disturbance::MagneticDisturbanceKind,
    // The next effects act on the cable counter.
    &tether_slack::TetherSlackKind,
    &tether_scale::TetherScaleKind,
    &tether_slip::TetherSlipKind,
    &tether_lag::TetherLagKind,
    &tether_quantum::TetherQuantumKind,
    // The next effects are faults of devices.
    &device_faults::DeviceFaultsKind,
    // The next effects act on the clocks of devices and on the lines to them.
    &clock_drift::ClockDriftKind,
    &line_delay::LineDelayKind,
    &byte_errors::ByteErrorsKind,
];

/// The effects that a scene names, in the order of [`KINDS`].
pub struct Named(pub(crate) Vec<(&'static dyn EffectKind, Box<dyn Effect>)>);

/// Finds an effect by its name.
pub(crate) fn named(name: &str) -> Option<&'static dyn EffectKind> {
    KINDS.into_iter().find(|kind| kind.name() == name)
}

/// Reads the `[effects]` table.
///
/// Errors: a name isn't an effect; see [`EffectKind::read`].
pub(crate) fn parse(section: Option<Section<'_>>, facts: &Facts) -> Result<Named, ConfigError> {
    let mut named = Vec::new();
    let Some(section) = section else { return Ok(Named(named)) };
    for kind in KINDS {
        let tables = section.tables(kind.name())?;
        if !tables.is_empty() {
            let effect = section.part(|| kind.read(tables, facts))?;
            named.extend(effect.map(|effect| (kind, effect)));
        }
    }
    section.finish()?;
    Ok(Named(named))
}

impl Named {
    /// Whether the list contains the effect of this name.
    pub(crate) fn has(&self, name: &str) -> bool {
        self.0.iter().any(|(kind, _)| kind.name() == name)
    }

    /// Adds the effects from the `[effects]` tables of the TOML text `tables`. The scene must not name any of these
    /// effects itself.
    ///
    /// Errors: see [`EffectKind::read`].
    pub(crate) fn and(mut self, tables: &str, facts: &Facts) -> Result<Self, ConfigError> {
        let root = Document::new("what the scene calls for", tables).root()?;
        self.0.extend(parse(root.section("effects")?, facts)?.0);
        self.0.sort_by_key(|(kind, _)| KINDS.iter().position(|other| other.name() == kind.name()));
        Ok(self)
    }
}

#[cfg(test)]
mod tests;
