//! Navigation with two filters. The steps of the second filter are recorded for smoothing.
//!
//! A Rauch-Tung-Striebel smoother is valid only for optimal gains. The navigation filter applies only a share of each
//! wall correction, and so discards some correlation on purpose. A backward pass over its steps would diverge. So a
//! second filter gets the same readings, applies wall corrections in full, and records its steps.

use super::journal::Journal;
use crate::filter::FilterNavigation;
use crate::filter::cable::CableDoubt;
use crate::filter::pose_sd::PoseSd;
use crate::filter::setting_check::SettingDoubt;
use crate::filter::settings::Settings;
use crate::filter::sources::Consistency;
use crate::fix::{Fix, NoFix, Times};
use crate::navigation::Navigation;
use headrace_geometry::site::Site;
use headrace_geometry::snapshot::stateful;
use headrace_geometry::time::MonoNs;
use headrace_geometry::tunnel::Profile;
use headrace_sensor::device::SensorInfo;
use headrace_sensor::reading::Reading;

/// The navigation filter, and a second filter that records its steps for smoothing.
///
/// Fixes and all other outputs are bit-identical to those of the navigation filter alone.
pub struct TwoFilterNavigation {
    navigating: FilterNavigation,
    recorded: FilterNavigation,
}

stateful!(TwoFilterNavigation { state: navigating, recorded; });

/// Creates a filter for smoothing, which uses optimal gains and writes its steps to a journal.
pub fn smoothable(profile: Profile, site: Site, settings: Settings, journal: Journal) -> FilterNavigation {
    let settings = Settings { wall_share: 1.0, ..settings };
    FilterNavigation::new(profile, site, settings).with_journal(journal)
}

impl TwoFilterNavigation {
    /// Creates both filters, which have no readings yet.
    pub fn new(profile: Profile, site: Site, settings: Settings, journal: Journal) -> Self {
        Self {
            navigating: FilterNavigation::new(profile.clone(), site, settings),
            recorded: smoothable(profile, site, settings, journal),
        }
    }
}

impl Navigation for TwoFilterNavigation {
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

    fn has_unverified_mounts(&self) -> bool {
        self.navigating.has_unverified_mounts()
    }

    fn fix(&self, at: MonoNs) -> Result<Fix, NoFix> {
        self.navigating.fix(at)
    }
}
