//! A second filter beside the navigating one, whose steps are smoothed.
//!
//! A Rauch-Tung-Striebel smoother is valid for optimal gains only. The navigating filter applies wall measurements in
//! part and so discards some correlation on purpose; a backward pass over its steps would diverge. The second filter
//! gets the same readings, applies wall measurements in full and records the steps.

use super::journal::Journal;
use crate::filter::FilterNavigation;
use crate::filter::cable::CableDoubt;
use crate::filter::pose_sd::PoseSd;
use crate::filter::settings::Settings;
use crate::filter::sources::Consistency;
use crate::filter::suspicion::SettingDoubt;
use crate::{Fix, Navigation, NoFix, Times};
use headrace_geometry::site::Site;
use headrace_geometry::snapshot::stateful;
use headrace_geometry::time::MonoNs;
use headrace_geometry::tunnel::Profile;
use headrace_sensor::device::SensorInfo;
use headrace_sensor::reading::Reading;

/// The navigating filter together with the recorded one.
///
/// Its fixes and all other outputs equal those of the navigating filter alone, bit for bit.
pub struct BesideNavigation {
    navigating: FilterNavigation,
    recorded: FilterNavigation,
}

stateful!(BesideNavigation { state: navigating, recorded; });

/// Creates the filter to smooth: it uses optimal gains and writes its steps to a journal.
pub fn smoothable(profile: Profile, site: Site, settings: Settings, journal: Journal) -> FilterNavigation {
    let settings = Settings { wall_share: 1.0, ..settings };
    FilterNavigation::new(profile, site, settings).with_journal(journal)
}

impl BesideNavigation {
    /// Creates both filters without readings.
    pub fn new(profile: Profile, site: Site, settings: Settings, journal: Journal) -> Self {
        Self {
            navigating: FilterNavigation::new(profile.clone(), site, settings),
            recorded: smoothable(profile, site, settings, journal),
        }
    }
}

impl Navigation for BesideNavigation {
    fn update(&mut self, source: usize, sensor: &SensorInfo, times: Times, reading: &Reading) {
        self.navigating.update(source, sensor, times, reading);
        self.recorded.update(source, sensor, times, reading);
    }

    fn end(&mut self) {
        self.navigating.end();
        self.recorded.end();
    }

    fn consistency(&self, source: usize) -> Option<Consistency> {
        self.navigating.consistency(source)
    }

    fn pose_sd(&self) -> Option<PoseSd> {
        self.navigating.pose_sd()
    }

    fn cable_doubt(&self) -> Option<CableDoubt> {
        self.navigating.cable_doubt()
    }

    fn stand_s(&self) -> u32 {
        self.navigating.stand_s()
    }

    fn setting_doubt(&self) -> Option<SettingDoubt> {
        self.navigating.setting_doubt()
    }

    fn fix(&self, at: MonoNs) -> Result<Fix, NoFix> {
        self.navigating.fix(at)
    }
}
