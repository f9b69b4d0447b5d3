//! Input data of the calibration.

use headrace_fusion::filter::settings::Settings;
use headrace_geometry::site::Site;
use headrace_geometry::time::MonoNs;
use headrace_geometry::tunnel::Profile;
use headrace_monitor::messages::Event;
use headrace_sensor::device::SensorInfo;

/// Readings of a log, with the sensors and settings that the vehicle file describes.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Material<'a> {
    /// Design profile.
    pub(crate) profile: &'a Profile,
    /// Water and location, from the vehicle file.
    pub(crate) site: Site,
    /// Noise settings of the sensors.
    pub(crate) settings: Settings,
    /// The sensors of the vehicle file, by source.
    pub(crate) sensors: &'a [SensorInfo],
    /// All readings, in the order in which the loop processed them.
    pub(crate) events: &'a [Event],
}

impl<'a> Material<'a> {
    /// Readings received from `from` until before `to`, each with its sensor.
    pub(crate) fn during(
        &self,
        from: MonoNs,
        to: MonoNs,
    ) -> impl Iterator<Item = (&'a Event, &'a SensorInfo)> {
        let sensors = self.sensors;
        let within = self.events.iter().filter(move |event| event.received >= from && event.received < to);
        within.filter_map(move |event| sensors.get(event.source.index()).map(|sensor| (event, sensor)))
    }
}
