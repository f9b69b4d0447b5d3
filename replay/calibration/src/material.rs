//! What there is to calibrate by.

use headrace_fusion::filter::settings::Settings;
use headrace_geometry::site::Site;
use headrace_geometry::time::MonoNs;
use headrace_geometry::tunnel::Profile;
use headrace_monitor::messages::Event;
use headrace_sensor::device::SensorInfo;

/// Readings, and what the vehicle file says of where they come from.
#[derive(Debug, Clone, Copy)]
pub struct Material<'a> {
    /// The design.
    pub profile: &'a Profile,
    /// The water and the place, as the vehicle file has them.
    pub site: Site,
    /// How far sensors are trusted.
    pub settings: Settings,
    /// The sensors as the vehicle file has them, by source.
    pub sensors: &'a [SensorInfo],
    /// All readings, in the order in which the loop took them.
    pub events: &'a [Event],
}

impl<'a> Material<'a> {
    /// Readings received from `from` to before `to`, with their sensors.
    pub fn during(&self, from: MonoNs, to: MonoNs) -> impl Iterator<Item = (&'a Event, &'a SensorInfo)> {
        let sensors = self.sensors;
        let within = self.events.iter().filter(move |event| event.received >= from && event.received < to);
        within.filter_map(move |event| sensors.get(event.source.index()).map(|sensor| (event, sensor)))
    }
}
