//! Finds the changes that each effect makes to each measurement, by comparing the measurement before and after each
//! system.
//!
//! Effects need not report their changes. This module is only active in a simulation with ground truth.

use bevy_ecs::prelude::{Component, Query, ResMut, Resource};
use headrace_sensor::measurement::{GroundVelocity, Inertia, Measurement, Payout, Pressure, Sounding};

use crate::sensing::{Line, Samples, Source};

/// Maximum number of numerical values (figures) in a measurement.
const FIGURES: usize = 10;

/// Numerical values (figures) of a measurement, with their names.
pub(crate) trait Figures: Measurement {
    /// Names of the measurement's values, with units.
    const NAMES: &'static [&'static str];

    /// The measurement's values; NaN for a missing value.
    fn figures(&self) -> [f64; FIGURES];
}

fn padded<const N: usize>(values: [f64; N]) -> [f64; FIGURES] {
    let mut figures = [f64::NAN; FIGURES];
    for (figure, value) in figures.iter_mut().zip(values) {
        *figure = value;
    }
    figures
}

impl Figures for Sounding {
    const NAMES: &'static [&'static str] = &["at_s", "angle_rad", "reported_rad", "range_m"];

    fn figures(&self) -> [f64; FIGURES] {
        let range_m = self.range_m.unwrap_or(f64::NAN);
        padded([self.at.as_secs_f64(), self.angle_rad, self.reported_rad, range_m])
    }
}

impl Figures for Pressure {
    const NAMES: &'static [&'static str] = &["at_s", "pressure_pa"];

    fn figures(&self) -> [f64; FIGURES] {
        padded([self.at.as_secs_f64(), self.pressure_pa])
    }
}

impl Figures for Payout {
    const NAMES: &'static [&'static str] = &["at_s", "chainage_m"];

    fn figures(&self) -> [f64; FIGURES] {
        padded([self.at.as_secs_f64(), self.chainage_m])
    }
}

impl Figures for GroundVelocity {
    const NAMES: &'static [&'static str] = &["at_s", "velocity_x_mps", "velocity_y_mps", "velocity_z_mps"];

    fn figures(&self) -> [f64; FIGURES] {
        let [x, y, z] = self.velocity_mps.0.into();
        padded([self.at.as_secs_f64(), x, y, z])
    }
}

impl Figures for Inertia {
    const NAMES: &'static [&'static str] = &[
        "at_s",
        "roll_rad",
        "pitch_rad",
        "yaw_rad",
        "rate_x_radps",
        "rate_y_radps",
        "rate_z_radps",
        "force_x_mps2",
        "force_y_mps2",
        "force_z_mps2",
    ];

    fn figures(&self) -> [f64; FIGURES] {
        let (roll, pitch, yaw) = self.attitude.roll_pitch_yaw();
        let ([a, b, c], [d, e, f]) = (self.rate_radps.0.into(), self.force_mps2.0.into());
        [self.at.as_secs_f64(), roll, pitch, yaw, a, b, c, d, e, f]
    }
}

/// One change of a measurement by an effect.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Note {
    /// Number of the sensor whose measurement was changed.
    pub source: u16,
    /// Number of the measurement within the current time slice.
    pub sample: usize,
    /// Index of the effect in the scene's list of effects.
    pub effect: u16,
    /// Name of the changed value.
    pub what: &'static str,
    /// The value before the change; NaN if there was none.
    pub from: f64,
    /// The value after the change.
    pub to: f64,
}

/// All changes by effects in the current time slice.
#[derive(Debug, Clone, Default, Resource)]
pub(crate) struct Notes(pub(crate) Vec<Note>);

/// Copy of the measurements as the previous system left them.
#[derive(Debug, Clone, Component)]
pub(crate) struct Before<M: Measurement>(Vec<M>);

/// Copy of the line's messages as the previous system left them.
#[derive(Debug, Clone, Default, Component)]
pub(crate) struct LineBefore(Line);

impl<M: Measurement> Default for Before<M> {
    fn default() -> Self {
        Self(Vec::new())
    }
}

/// The effect whose system has just run. `None` stands for a base system, whose output is the original measurement.
#[derive(Debug, Clone, Copy)]
struct After(Option<u16>);

type Noted<'a, M> = (&'a Source, &'a Samples<M>, &'a mut Before<M>);

type AllNoted<'w, 's, M> = Query<'w, 's, Noted<'static, M>>;

/// Returns a recording system. It attributes all changes since the previous recording system ran to `effect`.
#[expect(clippy::type_complexity, reason = "a system's signature is what it needs")]
pub(crate) fn note(
    effect: Option<u16>,
) -> impl FnMut(
    ResMut<'_, Notes>,
    AllNoted<'_, '_, Sounding>,
    AllNoted<'_, '_, Pressure>,
    AllNoted<'_, '_, Inertia>,
    AllNoted<'_, '_, GroundVelocity>,
    AllNoted<'_, '_, Payout>,
    Query<'_, '_, (&Source, &Line, &mut LineBefore)>,
) {
    move |mut notes, mut soundings, mut pressures, mut inertias, mut velocities, mut payouts, mut lines| {
        let after = After(effect);
        for noted in &mut soundings {
            compare(after, &mut notes.0, noted);
        }
        for noted in &mut pressures {
            compare(after, &mut notes.0, noted);
        }
        for noted in &mut inertias {
            compare(after, &mut notes.0, noted);
        }
        for noted in &mut velocities {
            compare(after, &mut notes.0, noted);
        }
        for noted in &mut payouts {
            compare(after, &mut notes.0, noted);
        }
        for noted in &mut lines {
            compare_lines(after, &mut notes.0, noted);
        }
    }
}

fn compare<M: Figures>(
    after: After,
    notes: &mut Vec<Note>,
    (source, samples, mut before): (&Source, &Samples<M>, bevy_ecs::change_detection::Mut<'_, Before<M>>),
) {
    if let Some(effect) = after.0 {
        for (sample, (old, new)) in before.0.iter().zip(&samples.list).enumerate() {
            let values = old.figures().into_iter().zip(new.figures());
            for (what, (from, to)) in M::NAMES.iter().zip(values) {
                if from.to_bits() != to.to_bits() {
                    notes.push(Note { source: source.0, sample, effect, what, from, to });
                }
            }
        }
    }
    before.0.clear();
    before.0.extend_from_slice(&samples.list);
}

fn compare_lines(
    after: After,
    notes: &mut Vec<Note>,
    (source, line, mut before): (&Source, &Line, bevy_ecs::change_detection::Mut<'_, LineBefore>),
) {
    if let Some(effect) = after.0 {
        for (old, new) in before.0.messages.iter().zip(&line.messages) {
            let mut note = |what, from, to| {
                notes.push(Note { source: source.0, sample: new.sample, effect, what, from, to });
            };
            if old.at != new.at {
                note("received_s", old.at.as_secs_f64(), new.at.as_secs_f64());
            }
            let of = |line: &Line, (from, to): (usize, usize)| {
                line.bytes.get(from..to).map(<[u8]>::to_vec).unwrap_or_default()
            };
            let (was, is) = (of(&before.0, old.bytes), of(line, new.bytes));
            if was != is {
                let wrong =
                    was.iter().zip(&is).filter(|(a, b)| a != b).count() + was.len().abs_diff(is.len());
                note("wrong_bytes", 0.0, wrong as f64);
            }
        }
    }
    before.0.clone_from(line);
}
