//! The view: everything that outlets and plugins can read after a tick. It borrows the values of the parts
//! and computes nothing.

use super::adviser::Advised;
use super::alert_list::{AlertList, TextContext};
use super::alerter::Alerter;
use super::console::packets::ConsoleCounts;
use super::digest::Digest;
use super::entities::{SensorHealth, VehicleState};
use super::head_descriptions::HeadDescriptions;
use super::live_state::LiveState;
use super::live_state::json::LiveStateJson;
use super::messages::{Event, Notice};
use super::notes::Notes;
use super::placer::Placed;
use super::resources::{Coverage, Tally, TickTime};
use super::result_stream::ResultStream;
use super::section_row::SectionRow;
use super::source::SourceInfo;
use super::surveyor::Surveyor;
use headrace_geometry::time::{DiveClock, MonoNs};
use headrace_vehicle::Mission;

/// Mission and sensors of a loop; constant after arming.
#[derive(Debug)]
pub struct About {
    /// Tunnel and coverage target.
    pub mission: Mission,
    /// Sources of the sensors, in the order of their ids. The operator's input is not among them.
    pub sources: Vec<SourceInfo>,
    /// Names of the heads, and the alternative settings that could be advised.
    pub descriptions: HeadDescriptions,
}

/// Read-only view of the loop after a tick.
#[derive(Clone, Copy)]
pub struct DiveView<'a> {
    pub(super) about: &'a About,
    pub(super) time: TickTime,
    pub(super) placed: &'a Placed,
    pub(super) surveyor: &'a Surveyor,
    pub(super) advised: &'a Advised,
    pub(super) alerter: &'a Alerter,
}

impl<'a> DiveView<'a> {
    /// Tunnel and coverage target.
    pub fn mission(&self) -> &'a Mission {
        &self.about.mission
    }

    /// Sources of the sensors, in the order of their ids. The operator's input is not among them.
    pub fn sources(&self) -> &'a [SourceInfo] {
        &self.about.sources
    }

    /// Names of the heads, and the alternative settings that could be advised.
    pub fn head_descriptions(&self) -> &'a HeadDescriptions {
        &self.about.descriptions
    }

    /// Number and end time of the tick.
    pub fn time(&self) -> TickTime {
        self.time
    }

    /// Results of the placer for the tick.
    pub fn placed(&self) -> &'a Placed {
        self.placed
    }

    /// The surveyor after the tick.
    pub fn surveyor(&self) -> &'a Surveyor {
        self.surveyor
    }

    /// Speed advice of the tick.
    pub fn advised(&self) -> &'a Advised {
        self.advised
    }

    /// Fix of the vehicle at the last advice update, and its standard deviations.
    pub fn vehicle(&self) -> &'a VehicleState {
        &self.placed.vehicle
    }

    /// Traffic statistics of each sensor, in the order of sources.
    pub fn health(&self) -> &'a [SensorHealth] {
        &self.placed.health
    }

    /// Clock of the dive, for the times that people read.
    pub fn clock(&self) -> DiveClock {
        self.placed.clock
    }

    /// Latest receive time of the sensors' packets so far.
    pub fn last_received(&self) -> Option<MonoNs> {
        self.placed.last_received()
    }

    /// Readings of the tick, in order.
    pub fn readings(&self) -> &'a [Event] {
        &self.placed.events
    }

    /// Notices of the tick, in order.
    pub fn notices(&self) -> impl Iterator<Item = Notice> + use<'a> {
        let found = self.surveyor.found().notices.iter().copied();
        let advised = self.advised.entries.iter().copied().map(Notice::Advice);
        found.chain(advised).chain(self.alerter.notices.iter().copied())
    }

    /// Coverage of the wall, with samples and verdicts.
    pub fn coverage(&self) -> &'a Coverage {
        self.surveyor.coverage()
    }

    /// The section with this index; `None` beyond the tunnel's ends.
    pub fn section_row(&self, index: i64) -> Option<SectionRow> {
        SectionRow::of(&self.coverage().sections, index, (&self.about.mission.profile, self.clock()))
    }

    /// Counts of pings over the whole dive.
    pub fn tally(&self) -> &'a Tally {
        self.surveyor.tally()
    }

    /// Alerts of the dive with their life cycle.
    pub fn alert_list(&self) -> &'a AlertList {
        &self.alerter.list
    }

    /// Notes of the dive.
    pub fn notes(&self) -> &'a Notes {
        &self.alerter.notes
    }

    /// Traffic statistics of the operator's input.
    pub fn console_counts(&self) -> ConsoleCounts {
        ConsoleCounts { without_effect: self.alerter.without_effect, ..self.placed.console }
    }

    /// Context for the texts of the dive's alerts.
    pub fn surroundings(&self) -> TextContext<'a> {
        let About { mission, sources, descriptions } = self.about;
        let sections = &self.coverage().sections;
        TextContext::of(sources, &mission.profile, sections, descriptions, self.clock())
    }

    /// Live state as of the last advice update.
    pub fn live_state(&self) -> &'a LiveState {
        &self.alerter.state
    }

    /// Live state together with the alerts, as JSON.
    pub fn live_state_json(&self) -> LiveStateJson {
        self.live_state().json(&self.surroundings(), self.alert_list())
    }

    /// Result streams by name, in log order.
    pub fn streams(&self) -> [(&'static str, &'a ResultStream); 6] {
        let digests = self.surveyor.digests();
        [
            ("poses", &self.placed.poses),
            ("pings", &digests.pings),
            ("judgements", &digests.judgements),
            ("advice", &self.advised.stream),
            ("states", &self.alerter.states),
            ("alerts", &self.alerter.changes),
        ]
    }

    /// Digest of all results so far.
    pub fn digest(&self) -> u64 {
        let mut all = Digest::default();
        for (_, stream) in self.streams() {
            all.integer(stream.value());
        }
        all.value()
    }
}
