//! The armed loop.

use bevy_ecs::component::Component;
use bevy_ecs::prelude::{ResMut, Resource};
use bevy_ecs::schedule::Schedule;
use bevy_ecs::system::SystemState;
use bevy_ecs::world::World;

use super::advice_log::AdviceLog;
use super::alert_list::{AlertList, Telling, TextContext};
use super::alerts::Alerts;
use super::app::{App, SourceInfo};
use super::console::{Console, ConsoleCounts};
use super::digest::Digest;
use super::entities::{HeadFrontier, Mounted, Navigator, SensorDecoder, SensorHealth, VehicleState};
use super::head_descriptions::HeadDescriptions;
use super::live_state::LiveState;
use super::live_state::json::LiveStateJson;
use super::loop_snapshot;
use super::merge::Inbox;
use super::messages::{Event, Events, Notice, Notices};
use super::notes::Notes;
use super::resources::{Coverage, Digests, Finder, Tally, TickTime, VehicleEntities};
use super::ring::{Port, PortReader};
use super::stages::{Results, RunInputs, SoundSpeed, judge_one};
use headrace_coverage::{Outlook, Request};
use headrace_fusion::filter::sources::Consistency;
use headrace_fusion::{Fix, NoFix};
use headrace_geometry::snapshot::{Restorer, Saver, SnapshotError};
use headrace_geometry::time::MonoNs;
use headrace_sensor::codec::CodecCounts;
use headrace_sensor::device::SensorInfo;
use headrace_sensor::device_clock::ClockReport;
use headrace_vehicle::Mission;

/// Number of sections judged per batch at the end of a dive. The notices of a batch are delivered before the
/// next batch.
const FINISHED_AT_ONCE: usize = 256;

/// Data for judging at the end of a dive.
type AtEnd<'w> = (
    ResMut<'w, Coverage>,
    ResMut<'w, Finder>,
    ResMut<'w, Notices>,
    ResMut<'w, Digests>,
    ResMut<'w, Alerts>,
    ResMut<'w, RunInputs>,
    ResMut<'w, AlertList>,
);

/// A running loop. All of its memory is allocated; a tick takes no lock, makes no system call and formats no
/// text.
pub struct Loop {
    pub(super) world: World,
    schedule: Schedule,
    readers: Vec<PortReader>,
    ports: Vec<Option<Port>>,
    sources: Vec<SourceInfo>,
    mission: Mission,
    ticks: u64,
    finished: bool,
    /// Whether a plugin has systems in the stages that georeference pings.
    pub(super) has_own_placing: bool,
}

impl Loop {
    /// Creates the loop from an app whose world has everything that the stages need.
    pub(super) fn new(app: App) -> Self {
        let App { mission, world, schedule, sources, ports, readers, has_own_placing, .. } = app;
        let ports = ports.into_iter().map(Some).collect();
        let (ticks, finished) = (0, false);
        let mut armed =
            Self { world, schedule, readers, ports, sources, mission, ticks, finished, has_own_placing };
        // The first run of a schedule allocates memory. Without packets the run has no other effect.
        armed.tick(MonoNs(0));
        armed.ticks = 0;
        armed
    }

    /// Processes the waiting packets. Returns the number of packets consumed.
    ///
    /// `now` is the end of the tick's time. The loop only records it; no result depends on it.
    ///
    /// Allocates: never.
    pub fn tick(&mut self, now: MonoNs) -> usize {
        if let Some(mut time) = self.world.get_resource_mut::<TickTime>() {
            *time = TickTime { index: self.ticks, now };
        }
        // After the end of a dive, the judgements made there must not be cleared before they are published.
        if !self.finished {
            self.world.resource_mut::<Digests>().next_tick();
        }
        if let Some(mut inbox) = self.world.get_resource_mut::<Inbox>() {
            inbox.fill(&mut self.readers);
        }
        self.run_stages();
        self.world.get_resource::<Inbox>().map_or(0, Inbox::len)
    }

    /// Runs the stages of a tick.
    pub(super) fn run_stages(&mut self) {
        self.schedule.run(&mut self.world);
        self.ticks += 1;
    }

    /// The world, and the readers of the rings. [`crate::split`] uses them.
    pub(super) fn split_world(&mut self) -> (&mut World, &mut Vec<PortReader>) {
        (&mut self.world, &mut self.readers)
    }

    /// Takes the writing end of a source's ring, for a port's thread, a player or a simulator.
    ///
    /// `None` if it was taken already.
    pub fn take_port(&mut self, source: usize) -> Option<Port> {
        self.ports.get_mut(source)?.take()
    }

    /// Takes the writing end of the operator's input. `None` if it was taken already.
    pub fn take_console(&mut self) -> Option<Port> {
        self.take_port(self.sources.len())
    }

    /// Sources of the sensors, in the order of their ids. The operator's input is not among them.
    pub fn sources(&self) -> &[SourceInfo] {
        &self.sources
    }

    /// Tunnel and target.
    pub fn mission(&self) -> &Mission {
        &self.mission
    }

    /// Names of the heads and their alternative settings.
    pub fn head_descriptions(&self) -> &HeadDescriptions {
        self.world.resource::<HeadDescriptions>()
    }

    /// Number of ticks run so far.
    pub fn ticks(&self) -> u64 {
        self.ticks
    }

    /// End of the last tick's time.
    pub fn now(&self) -> MonoNs {
        self.world.resource::<TickTime>().now
    }

    /// A plugin's own resource.
    pub fn resource<T: Resource>(&self) -> Option<&T> {
        self.world.get_resource::<T>()
    }

    /// Fix of the vehicle at the last update, and its standard deviations.
    pub fn vehicle(&self) -> &VehicleState {
        self.of_vehicle()
    }

    /// Fix at `at`, which may be slightly before or after the last reading.
    ///
    /// Errors: the reason for which there is no fix.
    pub fn fix(&self, at: MonoNs) -> Result<Fix, NoFix> {
        self.of_vehicle::<Navigator>().navigation.fix(at)
    }

    /// Innovation statistics of a source; `None` if there are none.
    pub fn consistency(&self, source: usize) -> Option<Consistency> {
        self.of_vehicle::<Navigator>().navigation.consistency(source)
    }

    /// Readings of the last tick, in order.
    pub fn readings(&self) -> &[Event] {
        &self.world.resource::<Events>().0
    }

    /// Notices of the last tick, in order.
    pub fn notices(&self) -> &[Notice] {
        &self.world.resource::<Notices>().0
    }

    /// Coverage of the wall.
    pub fn coverage(&self) -> &Coverage {
        self.world.resource()
    }

    /// Counts of pings and packets over the whole dive.
    pub fn tally(&self) -> &Tally {
        self.world.resource()
    }

    /// Alerts about the dive as a whole.
    pub fn alerts(&self) -> &Alerts {
        self.world.resource()
    }

    /// Alerts with their life cycle.
    pub fn alert_list(&self) -> &AlertList {
        self.world.resource()
    }

    /// Notes of the dive.
    pub fn notes(&self) -> &Notes {
        self.world.resource()
    }

    /// Traffic of the operator's input.
    pub fn console_counts(&self) -> ConsoleCounts {
        self.world.resource::<Console>().counts
    }

    /// Context for the texts of the dive's alerts.
    pub fn surroundings(&self) -> TextContext<'_> {
        TextContext::of(
            &self.sources,
            &self.mission.profile,
            &self.coverage().sections,
            self.head_descriptions(),
        )
    }

    /// Live state together with the alerts, as JSON.
    pub fn live_state_json(&self) -> LiveStateJson {
        self.live_state().json(&self.surroundings(), self.alert_list())
    }

    /// Live state as of the last update, published with the last tick.
    pub fn live_state(&self) -> &LiveState {
        self.world.resource()
    }

    /// Advice history.
    pub fn advice_log(&self) -> &AdviceLog {
        self.world.resource()
    }

    /// The result streams with their digests.
    pub fn digests(&self) -> &Digests {
        self.world.resource()
    }

    /// Minimum and maximum speed of sound used for ranges, m/s.
    pub fn sound_speeds_mps(&self) -> [f64; 2] {
        self.world.resource::<SoundSpeed>().span_mps()
    }

    /// Mount and kind of each sensor, in the order of sources.
    pub fn sensors(&self) -> Vec<SensorInfo> {
        self.of_sensors::<Mounted>().map(|mounted| mounted.info).collect()
    }

    /// Traffic statistics of each sensor, in the order of sources.
    pub fn health(&self) -> impl Iterator<Item = &SensorHealth> {
        self.of_sensors()
    }

    /// A component of every sensor, in the order of sources.
    fn of_sensors<T: Component>(&self) -> impl Iterator<Item = &T> + Clone {
        let entities = self.world.resource::<VehicleEntities>();
        entities.by_source.iter().filter_map(|entity| self.world.get(*entity))
    }

    /// A component of the vehicle, present since arming.
    fn of_vehicle<T: Component>(&self) -> &T {
        let vehicle = self.world.entity(self.world.resource::<VehicleEntities>().vehicle);
        #[expect(clippy::expect_used, reason = "arming adds it, and nothing removes it")]
        vehicle.get().expect("the vehicle's components exist since arming")
    }

    /// Outlook as of the last packet: where samples have landed and where they may still land.
    pub(super) fn outlook(&self) -> Outlook {
        let at = self.tally().span.map_or(MonoNs(0), |(_, last)| last);
        self.coverage().frontier.outlook(self.of_sensors().filter_map(|reach: &HeadFrontier| reach.0), at)
    }

    /// Judges the sections whose verdict may still change, at the end of a dive, when no more samples will
    /// come.
    ///
    /// `hear` gets the notices in batches, with the loop's state after each batch. All notices of a long dive
    /// at once would take more memory than its samples.
    pub fn finish(&mut self, hear: &mut dyn FnMut(&Notice, &Self)) {
        let vehicle = self.world.resource::<VehicleEntities>().vehicle;
        if let Some(mut navigator) = self.world.get_mut::<Navigator>(vehicle) {
            navigator.navigation.end();
        }
        self.world.resource_mut::<Digests>().next_tick();
        self.finished = true;
        super::stages::end_returns(&mut self.world);
        let (open, common) = self.open_requests();
        let request = |section: &i64| Some(Request { section: *section, ..common? });
        for some in open.chunks(FINISHED_AT_ONCE) {
            self.judge_all(some.iter().filter_map(request));
            let notices = core::mem::take(&mut self.world.resource_mut::<Notices>().0);
            for notice in &notices {
                hear(notice, self);
            }
            self.world.resource_mut::<Notices>().0 = notices;
        }
    }

    /// Sections to be judged at the end of a dive, and the fields common to all requests for them.
    fn open_requests(&mut self) -> (Vec<i64>, Option<Request>) {
        let outlook = self.outlook();
        let (mut open, mut common) = (Vec::new(), None);
        let mut ask = |request: Request| {
            open.push(request.section);
            common = Some(request);
        };
        self.world.resource_mut::<Coverage>().sections.unsettled(&outlook, &mut ask);
        (open, common)
    }

    fn judge_all(&mut self, requests: impl Iterator<Item = Request>) {
        let Self { world, mission, .. } = self;
        let mut parts = SystemState::<AtEnd<'_>>::new(world);
        let Ok((mut coverage, mut finder, mut notices, mut digests, mut alerts, mut runs, mut list)) =
            parts.get_mut(world)
        else {
            return;
        };
        notices.0.clear();
        for request in requests {
            runs.0.clear();
            let mut results = Results {
                finder: &mut finder,
                notices: &mut notices,
                digests: &mut digests,
                alerts: &mut alerts,
                runs: &mut runs,
                place: (0, false),
            };
            judge_one(&request, &mission.profile, &mut coverage, &mut results);
            let mut to = Telling { notices: &mut notices, stream: &mut digests.alerts };
            runs.0.iter().for_each(|run| list.take_run(run, &mut to));
        }
    }

    /// Snapshot of the state after the last tick.
    ///
    /// A loop of the same vehicle gives the same results after it has restored the snapshot. The snapshot
    /// excludes packets waiting in the rings, and private state of plugins.
    ///
    /// Errors: a part can't be serialised.
    pub fn save(&self) -> Result<Vec<u8>, SnapshotError> {
        if self.is_split() {
            let (part, why) =
                ("the loop".to_owned(), "parts of it are on other threads; join first".to_owned());
            return Err(SnapshotError::Unsaved { part, why });
        }
        let mut to = Saver::default();
        to.part("ticks");
        to.value(&self.ticks);
        loop_snapshot::save(&self.world, &mut to);
        to.finish()
    }

    /// Restores a snapshot saved by a loop of the same vehicle and program.
    ///
    /// Packets waiting in the rings are dropped.
    ///
    /// Errors: the snapshot doesn't fit this loop. The loop must not be used afterwards.
    pub fn restore(&mut self, snapshot: &[u8]) -> Result<(), SnapshotError> {
        let mut from = Restorer::new(snapshot);
        if self.is_split() {
            return Err(from.unfit("parts of the loop are on other threads; join them first".to_owned()));
        }
        from.part("ticks")?;
        self.ticks = from.value()?;
        loop_snapshot::restore(&mut self.world, &mut from)?;
        self.readers.iter_mut().for_each(PortReader::clear);
        if from.is_empty() { Ok(()) } else { Err(from.unfit("it has extra bytes at its end".to_owned())) }
    }

    /// Frees the memory of the samples. After the end of a dive the report needs only the sections.
    pub fn release_samples(&mut self) {
        self.world.resource_mut::<Coverage>().store.release();
    }

    /// Whether packets are waiting in the rings.
    pub fn has_waiting(&self) -> bool {
        self.readers.iter().any(|reader| reader.peek().is_some())
    }

    /// Codec counts of each source, in the order of the sources.
    pub fn decoder_counts(&self) -> Vec<CodecCounts> {
        self.of_sensors::<SensorDecoder>().map(|decoder| decoder.0.counts()).collect()
    }

    /// Number of readings that each source's decoder understood but withheld, in the order of the sources.
    pub fn decoder_withheld(&self) -> Vec<u64> {
        self.of_sensors::<SensorDecoder>().map(|decoder| decoder.0.withheld()).collect()
    }

    /// Device clock statistics of each source, in the order of the sources.
    pub fn decoder_clocks(&self) -> Vec<Option<ClockReport>> {
        self.of_sensors::<SensorDecoder>().map(|decoder| decoder.0.clock()).collect()
    }

    /// Digest of all results so far: poses, pings, judgements and advice.
    pub fn digest(&self) -> u64 {
        let digests = self.world.resource::<Digests>();
        let mut all = Digest::default();
        for (_, stream) in digests.streams() {
            all.integer(stream.value());
        }
        all.value()
    }
}
