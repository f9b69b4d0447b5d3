//! Records the input of navigation in a dive, so that navigation can be run and timed without the rest of the loop.

use headrace_fusion::filter::settings::Settings;
use headrace_fusion::smooth::backward::Backward;
use headrace_fusion::smooth::journal::Journal;
use headrace_fusion::smooth::step::{Placed, Words};
use headrace_fusion::smooth::track::TrackNavigation;
use headrace_fusion::smooth::two_filters::smoothable;
use headrace_fusion::{Fix, Navigation, NoFix, Times};
use headrace_geometry::time::MonoNs;
use headrace_sensor::device::{SensorInfo, SensorSpec};
use headrace_sensor::reading::{MAX_SOURCES, Reading};
use headrace_vehicle::VehicleConfig;

use super::cable::CableNavigation;
use crate::error::CostError;
use headrace_oracle::dive::{JudgedDive, Recorded};

/// Capacity of the filter's journal, steps. The journal is emptied after each reading, but the first reading
/// after a silence may add many steps.
const JOURNAL: usize = 4096;

/// A reading as passed to navigation.
#[derive(Debug, Clone, Copy)]
struct Heard {
    source: usize,
    times: Times,
    reading: Reading,
}

/// All readings of a dive, in the loop's order.
pub(super) struct RecordedReadings {
    sensors: Vec<SensorInfo>,
    readings: Vec<Heard>,
    /// Time from the first to the last reading, s.
    pub(super) duration_s: f64,
}

impl RecordedReadings {
    /// Replays a dive with navigation by the cable alone, and records its readings.
    ///
    /// Errors: the loop can't be armed or driven.
    pub(super) fn of(recorded: &Recorded, vehicle: &VehicleConfig) -> Result<(Self, JudgedDive), CostError> {
        let mut readings: Vec<Heard> = Vec::new();
        let navigation = Box::new(CableNavigation::new(&vehicle.tunnel.profile));
        let dive = recorded.judged_with(vehicle, navigation, &mut |dive| {
            readings.extend(dive.view().readings().iter().map(|event| Heard {
                source: event.source.index(),
                times: Times { received: event.received, valid: event.valid_at },
                reading: event.reading,
            }));
        })?;
        let info = |specification: SensorSpec| SensorInfo {
            mount: specification.sensor.mount,
            kind: specification.kind,
        };
        let ends = readings.first().zip(readings.last());
        let duration_s =
            ends.map_or(0.0, |(first, last)| last.times.received.since(first.times.received).as_secs_f64());
        Ok((
            Self {
                sensors: vehicle.sensors.iter().map(|sensor| info(sensor.specification())).collect(),
                readings,
                duration_s,
            },
            dive,
        ))
    }

    /// Chainage of each cable reading, m, with its time of validity.
    pub(super) fn chainages(&self) -> impl Iterator<Item = (MonoNs, f64)> {
        self.readings.iter().filter_map(|heard| {
            let info = self.sensors.get(heard.source)?;
            Some((heard.times.valid, super::cable::chainage_m(info, &heard.reading)?))
        })
    }

    /// The readings of the first `part_s` seconds of the dive.
    pub(super) fn first(&self, part_s: f64) -> Self {
        let begun = self.readings.first().map_or(MonoNs(0), |heard| heard.times.received);
        let within = |heard: &&Heard| heard.times.received.since(begun).as_secs_f64() <= part_s;
        let readings: Vec<Heard> = self.readings.iter().take_while(within).copied().collect();
        Self { sensors: self.sensors.clone(), readings, duration_s: self.duration_s.min(part_s) }
    }

    /// Runs a navigation method as the live loop does: requests a position fix before each ping and passes it to
    /// `take`.
    pub(super) fn run(
        &self,
        navigation: &mut dyn Navigation,
        take: &mut dyn FnMut(MonoNs, Result<Fix, NoFix>),
    ) {
        self.run_noting(navigation, take, &mut || {});
    }

    /// Runs a navigation as [`RecordedReadings::run`] does, and calls `after` after each reading.
    fn run_noting(
        &self,
        navigation: &mut dyn Navigation,
        take: &mut dyn FnMut(MonoNs, Result<Fix, NoFix>),
        after: &mut dyn FnMut(),
    ) {
        for Heard { source, times, reading } in &self.readings {
            let Some(info) = self.sensors.get(*source) else { continue };
            if matches!(reading, Reading::Sonar(_)) {
                take(times.valid, navigation.fix(times.valid));
            }
            navigation.update(*source, info, *times, reading);
            after();
        }
        navigation.end();
        after();
    }

    /// Runs the filter, smooths its result, and returns a navigation along the smoothed track.
    pub(super) fn smoothed(&self, vehicle: &VehicleConfig, settings: &Settings) -> TrackNavigation {
        let (journal, steps) = Journal::new(JOURNAL);
        let mut filter = smoothable(vehicle.tunnel.profile.clone(), vehicle.site, *settings, journal);
        let mut kept: Vec<Words> = Vec::new();
        self.run_noting(&mut filter, &mut |_, _| {}, &mut || {
            kept.extend(std::iter::from_fn(|| steps.next()));
        });
        let mut backward = Backward::new(*settings);
        for placed in kept.iter().rev().filter_map(Placed::of_words) {
            backward.take(&placed);
        }
        let mut consistency = [None; MAX_SOURCES];
        for (source, slot) in consistency.iter_mut().enumerate() {
            *slot = filter.consistency(source);
        }
        TrackNavigation::new(backward.finish(), consistency)
    }
}
