//! Measurements of devices with a fault.

use bevy_ecs::prelude::{Component, Query, Res};
use headrace_geometry::frames::Rot;
use headrace_sensor::measurement::{GroundVelocity, Inertia, Measurement, Payout, Pressure, Sounding};

use super::span::Span;
use crate::sensing::{Echosounder, Samples, Scenery};

/// Makes a sensor repeat its last value.
#[derive(Component)]
pub(super) struct Stuck<M: Measurement> {
    span: Span,
    held: Option<M>,
}

impl<M: Measurement> Stuck<M> {
    pub(super) fn new(span: Span) -> Self {
        Self { span, held: None }
    }
}

/// A measurement whose value can be replaced by that of another measurement.
pub(super) trait Sticking: Measurement {
    /// Returns this measurement with the value of `other`. Time and head angles are unchanged.
    #[must_use]
    fn valued(self, other: &Self) -> Self;
}

impl Sticking for Sounding {
    fn valued(self, other: &Self) -> Self {
        Self { range_m: other.range_m, ..self }
    }
}

impl Sticking for Pressure {
    fn valued(self, other: &Self) -> Self {
        Self { at: self.at, ..*other }
    }
}

impl Sticking for Inertia {
    fn valued(self, other: &Self) -> Self {
        Self { at: self.at, period: self.period, ..*other }
    }
}

impl Sticking for GroundVelocity {
    fn valued(self, other: &Self) -> Self {
        Self { at: self.at, ..*other }
    }
}

impl Sticking for Payout {
    fn valued(self, other: &Self) -> Self {
        Self { at: self.at, ..*other }
    }
}

/// Repeats the last value before the span. A device that is stuck from the dive's start repeats its first value.
pub(super) fn stick<M: Sticking>(mut devices: Query<'_, '_, (&mut Samples<M>, &mut Stuck<M>)>) {
    for (mut samples, mut stuck) in &mut devices {
        for measured in &mut samples.list {
            if stuck.span.holds(measured.at())
                && let Some(held) = &stuck.held
            {
                *measured = measured.valued(held);
            }
            stuck.held = Some(*measured);
        }
    }
}

/// Adds a constant error to a sensor's values.
#[derive(Component)]
pub(super) struct Jumped {
    pub(super) size: f64,
    pub(super) span: Span,
}

pub(super) fn jump_soundings(
    mut sonars: Query<'_, '_, (&mut Samples<Sounding>, &Jumped, Option<&Echosounder>)>,
) {
    for (mut samples, Jumped { size, span }, echosounder) in &mut sonars {
        for sounding in samples.list.iter_mut().filter(|sounding| span.holds(sounding.at)) {
            if echosounder.is_some() {
                // A range is never negative.
                sounding.range_m = sounding.range_m.map(|range_m| (range_m + size).max(0.0));
            } else {
                sounding.reported_rad += size.to_radians();
            }
        }
    }
}

type Others<'a> = (
    &'a Jumped,
    Option<&'a mut Samples<Pressure>>,
    Option<&'a mut Samples<Inertia>>,
    Option<&'a mut Samples<GroundVelocity>>,
    Option<&'a mut Samples<Payout>>,
);

pub(super) fn jump_others(scenery: Res<'_, Scenery>, mut sensors: Query<'_, '_, Others<'_>>) {
    let site = &scenery.site;
    for (Jumped { size, span }, pressures, inertias, velocities, payouts) in &mut sensors {
        within(pressures, span, |pressure| {
            pressure.pressure_pa = site.pressure_pa(site.depth_m(pressure.pressure_pa) + size);
        });
        within(inertias, span, |inertia| {
            let (roll, pitch, yaw) = inertia.attitude.roll_pitch_yaw();
            inertia.attitude = Rot::from_roll_pitch_yaw(roll, pitch, yaw + size.to_radians());
        });
        within(velocities, span, |moved| {
            let [x, y, z] = moved.velocity_mps.0.into();
            moved.velocity_mps = headrace_geometry::frames::Vec3::new(x + size, y, z);
        });
        within(payouts, span, |payout| payout.chainage_m += size);
    }
}

fn within<M: Measurement>(
    samples: Option<bevy_ecs::change_detection::Mut<'_, Samples<M>>>,
    span: &Span,
    change: impl Fn(&mut M),
) {
    if let Some(mut samples) = samples {
        samples.list.iter_mut().filter(|measured| span.holds(measured.at())).for_each(change);
    }
}
