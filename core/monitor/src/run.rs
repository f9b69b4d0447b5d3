//! The armed loop.

use bevy_ecs::schedule::Schedule;
use bevy_ecs::world::{Mut, World};

use super::alerts::Alerts;
use super::components::{Mounted, SonarHead};
use super::digest::Digest;
use super::flow::{
    AdviceLog, Coverage, Digests, Events, Finder, HeadTable, HiddenAngles, MAX_TICK_READINGS, Navigator,
    Notice, Notices, Place, PlacedList, PositionedList, Requests, SensorTable, SourceTallies, Tally,
    TickTime,
};
use super::head::HeadTrack;
use super::merge::{Inbox, MAX_TICK_PACKETS};
use super::plugin::PluginError;
use super::ring::{Port, PortReader};
use super::saving;
use super::stages::{Advisor, Decoders, Driving, HeadSweeps, Results, WaterSound, judge_one};
use super::{App, SourceInfo};
use headrace_coverage::{
    Frontier, GridLayout, HoleFinder, Request, SampleStore, Sections, Soundings, StoreLayout,
};
use headrace_fusion::Navigation;
use headrace_geometry::time::MonoNs;
use headrace_sampling::advice::{self, Task};
use headrace_sampling::head::{HeadMode, HeadSpec, MAX_HEADS};
use headrace_sensor::device::{SensorInfo, SensorKind};
use headrace_sensor::reading::{MAX_SOURCES, SourceId};
use headrace_snapshot::{Restorer, Saver, SnapshotError};
use headrace_vehicle::Mission;

/// Room beyond both ends of the tunnel for heads that sit ahead of or behind the vehicle's origin, m.
const ROOM_BEYOND_M: f64 = 25.0;
/// Samples for which there is room, for a metre of tunnel and at most. Four heads at 0.2 m/s lay 1,000 a metre.
const SAMPLES_PER_M: f64 = 4_000.0;
const MIN_SAMPLES: f64 = 4_000_000.0;
const MAX_SAMPLES: f64 = 40_000_000.0;

/// A section that is judged may change its run and two others, and raise an alert.
const NOTICES_EACH: usize = 5;
/// Sections judged at the end of a dive before their notices are heard.
const FINISHED_AT_ONCE: usize = 256;

/// A loop that runs. All memory is allocated; a tick takes no lock, makes no system call and formats nothing.
pub struct Loop {
    world: World,
    schedule: Schedule,
    readers: Vec<PortReader>,
    ports: Vec<Option<Port>>,
    sources: Vec<SourceInfo>,
    mission: Mission,
    ticks: u64,
    finished: bool,
}

impl Loop {
    pub(super) fn new(app: App, navigation: Box<dyn Navigation>) -> Result<Self, PluginError> {
        let App { mission, mut world, mut schedule, sources, decoders, ports, readers } = app;
        let (sensors, heads, specs) = tables(&mut world, sources.len())?;
        world.insert_resource(sensors);
        world.insert_resource(heads);
        world.insert_resource(Decoders(decoders));
        let told_by = sound_source(&mission, &sources)?;
        world.insert_resource(WaterSound::new(mission.site.sound_speed_mps, told_by));
        world.insert_resource(Inbox::default());
        world.insert_resource(Events(Vec::with_capacity(MAX_TICK_READINGS)));
        world.insert_resource(PositionedList(Vec::with_capacity(2 * MAX_TICK_READINGS)));
        world.insert_resource(PlacedList(Vec::with_capacity(2 * MAX_TICK_READINGS)));
        world.insert_resource(Navigator { navigation, next_beat: None });
        world.insert_resource(HeadSweeps::default());
        world.insert_resource(Driving::default());
        world.insert_resource(Finder(HoleFinder::new(mission.coverage.hole_tolerance_m)));
        world.insert_resource(Alerts::default());
        let task = Task {
            target_m: mission.target_m,
            length_m: mission.length_m,
            layout: mission.layout,
            sound_speed_mps: mission.site.sound_speed_mps,
        };
        let advisor = advice::Advisor::new(&mission.profile, task, &specs, &mission.hull);
        world.insert_resource(HiddenAngles(advisor.hidden_angles().map(<[_]>::to_vec).collect()));
        world.insert_resource(Advisor::new(advisor, mission.target_m, mission.dive_time));
        world.insert_resource(AdviceLog::default());
        if world.get_resource::<Digests>().is_none() {
            world.insert_resource(Digests::default());
        }
        world.insert_resource(Tally::default());
        world.insert_resource(TickTime::default());
        world.insert_resource(SourceTallies::new(sources.len()));
        let coverage = coverage(&mission)?;
        // A jump along the tunnel may ask for every section at once.
        let most = coverage.sections.len() + MAX_TICK_PACKETS;
        world.insert_resource(Requests(Vec::with_capacity(most)));
        world.insert_resource(Notices(Vec::with_capacity(NOTICES_EACH * most + MAX_TICK_PACKETS)));
        world.insert_resource(coverage);
        world.insert_resource(Place {
            profile: mission.profile.clone(),
            site: mission.site,
            target_m: mission.target_m,
            layout: mission.layout,
            length_m: mission.length_m,
            contradiction_m: mission.coverage.contradiction_m,
        });
        schedule
            .initialize(&mut world)
            .map_err(|error| PluginError::Schedule { why: format!("{error:?}") })?;
        let mut armed = Self {
            world,
            schedule,
            readers,
            ports: ports.into_iter().map(Some).collect(),
            sources,
            mission,
            ticks: 0,
            finished: false,
        };
        // The first run of a schedule allocates; with nothing to do it has no other effect.
        armed.tick(MonoNs(0));
        armed.ticks = 0;
        Ok(armed)
    }

    /// Takes what has come and works it off. Gives the number of packets consumed.
    ///
    /// `now` is the end of the tick's time, for the record; no result depends on it.
    /// Allocates: never.
    pub fn tick(&mut self, now: MonoNs) -> usize {
        if let Some(mut time) = self.world.get_resource_mut::<TickTime>() {
            *time = TickTime { index: self.ticks, now };
        }
        // What the end of a dive has judged is still to be published.
        if !self.finished {
            self.world.resource_mut::<Digests>().next_tick();
        }
        if let Some(mut inbox) = self.world.get_resource_mut::<Inbox>() {
            inbox.fill(&mut self.readers);
        }
        self.schedule.run(&mut self.world);
        self.ticks += 1;
        self.world.get_resource::<Inbox>().map_or(0, Inbox::len)
    }

    /// The writing end of a source's ring, once: for a port's thread, a player or a simulator.
    pub fn take_port(&mut self, source: usize) -> Option<Port> {
        self.ports.get_mut(source)?.take()
    }

    /// The sources, in the order of their ids.
    pub fn sources(&self) -> &[SourceInfo] {
        &self.sources
    }

    /// The tunnel and the target.
    pub fn mission(&self) -> &Mission {
        &self.mission
    }

    /// Ticks run so far.
    pub fn ticks(&self) -> u64 {
        self.ticks
    }

    /// The end of the last tick's time.
    pub fn now(&self) -> MonoNs {
        self.world.resource::<TickTime>().now
    }

    /// What happens in the world, for plugins, tests and reports.
    pub fn world(&self) -> &World {
        &self.world
    }

    pub(super) fn world_mut(&mut self) -> &mut World {
        &mut self.world
    }

    /// Judges what is still open: the dive has ended, and no sample will come. `hear` is given the notices of it, some
    /// sections' at a time, and the loop as it is then: those of a long dive at once would take more than its samples.
    pub fn finish(&mut self, hear: &mut dyn FnMut(&Notice, &Self)) {
        self.world.resource_mut::<Navigator>().navigation.end();
        self.world.resource_mut::<Digests>().next_tick();
        self.finished = true;
        let (open, common) = self.open_requests();
        let request =
            |(section, fails): &(i64, bool)| Some(Request { section: *section, fails: *fails, ..common? });
        for some in open.chunks(FINISHED_AT_ONCE) {
            self.judge_all(some.iter().filter_map(request));
            let notices = core::mem::take(&mut self.world.resource_mut::<Notices>().0);
            for notice in &notices {
                hear(notice, self);
            }
            self.world.resource_mut::<Notices>().0 = notices;
        }
    }

    /// The sections that are to be judged at the end, which of them are known to fail, and what they have in common.
    fn open_requests(&mut self) -> (Vec<(i64, bool)>, Option<Request>) {
        let at = self.world.resource::<Tally>().span.map_or(MonoNs(0), |(_, last)| last);
        let profile = &self.mission.profile;
        let (mut open, mut common) = (Vec::new(), None);
        self.world.resource_scope(|world, mut coverage: Mut<'_, Coverage>| {
            let mut finder = world.resource_mut::<Finder>();
            let Coverage { store, sections, frontier, .. } = &mut *coverage;
            let mut ask = |request: Request| {
                open.push((request.section, request.fails));
                common = Some(request);
            };
            sections.unsettled((frontier, at), store, &mut finder.0, profile, &mut ask);
        });
        (open, common)
    }

    fn judge_all(&mut self, requests: impl Iterator<Item = Request>) {
        let Self { world, mission, .. } = self;
        world.resource_scope(|world, mut coverage: Mut<'_, Coverage>| {
            world.resource_scope(|world, mut finder: Mut<'_, Finder>| {
                world.resource_scope(|world, mut notices: Mut<'_, Notices>| {
                    world.resource_scope(|world, mut alerts: Mut<'_, Alerts>| {
                        notices.0.clear();
                        let mut digests = world.resource_mut::<Digests>();
                        let mut results = Results {
                            finder: &mut finder,
                            notices: &mut notices,
                            digests: &mut digests,
                            alerts: &mut alerts,
                        };
                        for request in requests {
                            judge_one(&request, &mission.profile, &mut coverage, &mut results);
                        }
                    });
                });
            });
        });
    }

    /// The state after the last tick, from which a loop of the same vehicle goes on to the same results. Packets that wait
    /// in the rings are no part of it, nor is what plugins keep for themselves.
    ///
    /// Errors: something can't be written.
    pub fn save(&self) -> Result<Vec<u8>, SnapshotError> {
        let mut to = Saver::default();
        to.part("ticks");
        to.value(&self.ticks);
        saving::save(&self.world, &mut to);
        to.finish()
    }

    /// Goes on from a state that a loop of the same vehicle and program has saved. What waits in the rings is dropped.
    ///
    /// Errors: the bytes are another's. The loop must not be used then.
    pub fn restore(&mut self, snapshot: &[u8]) -> Result<(), SnapshotError> {
        let mut from = Restorer::new(snapshot);
        from.part("ticks")?;
        self.ticks = from.value()?;
        saving::restore(&mut self.world, &mut from)?;
        self.readers.iter_mut().for_each(PortReader::clear);
        if from.is_empty() { Ok(()) } else { Err(from.unfit("there is more of it".to_owned())) }
    }

    /// Gives the samples' memory back: after the end of a dive a report needs the sections alone.
    pub fn release_samples(&mut self) {
        self.world.resource_mut::<Coverage>().store.release();
    }

    /// Whether packets wait in the rings.
    pub fn has_waiting(&self) -> bool {
        self.readers.iter().any(|reader| reader.peek().is_some())
    }

    /// What each source's codec has seen, in the order of the sources.
    pub fn decoder_counts(&self) -> Vec<headrace_sensor::codec::CodecCounts> {
        self.world.resource::<Decoders>().0.iter().map(|decoder| decoder.counts()).collect()
    }

    /// Readings that each source's decoder understood but did not hand on, in the order of the sources.
    pub fn decoder_withheld(&self) -> Vec<u64> {
        self.world.resource::<Decoders>().0.iter().map(|decoder| decoder.withheld()).collect()
    }

    /// How each source's own clock goes, in the order of the sources.
    pub fn decoder_clocks(&self) -> Vec<Option<headrace_sensor::device_clock::ClockReport>> {
        self.world.resource::<Decoders>().0.iter().map(|decoder| decoder.clock()).collect()
    }

    /// Digest of all results so far: poses, places, judgements and advice.
    pub fn digest(&self) -> u64 {
        let digests = self.world.resource::<Digests>();
        let mut all = Digest::default();
        for (_, stream) in digests.streams() {
            all.integer(stream.value());
        }
        all.value()
    }
}

/// The source that tells the speed of sound.
fn sound_source(mission: &Mission, sources: &[SourceInfo]) -> Result<Option<SourceId>, PluginError> {
    let Some(id) = &mission.sound_speed_from else { return Ok(None) };
    let place =
        sources.iter().position(|source| source.id == *id).and_then(|place| u16::try_from(place).ok());
    place.map(|place| Some(SourceId(place))).ok_or_else(|| PluginError::MissingSource { id: id.clone() })
}

fn coverage(mission: &Mission) -> Result<Coverage, PluginError> {
    let (from_m, to_m) = (-ROOM_BEYOND_M, mission.length_m + ROOM_BEYOND_M);
    let samples = headrace_geometry::math::round_to_i64(
        ((to_m - from_m) * SAMPLES_PER_M).clamp(MIN_SAMPLES, MAX_SAMPLES),
    );
    let mut store = SampleStore::new(StoreLayout {
        perimeter_m: mission.profile.perimeter_m(),
        from_m,
        to_m,
        cell_m: StoreLayout::cell_for_target_m(mission.target_m),
        capacity: u32::try_from(samples).unwrap_or(u32::MAX),
    });
    let mut sections = Sections::new(mission.section_m, mission.target_m, 0.0, mission.length_m);
    for opening in &mission.coverage.openings {
        let name = || opening.name.clone();
        opening
            .fill(&mut store, mission.target_m)
            .map_err(|why| PluginError::Opening { name: name(), why: why.to_string() })?;
        sections.mask(opening, &mission.profile);
    }
    let soundings = Soundings::new(GridLayout {
        perimeter_m: mission.profile.perimeter_m(),
        from_m: 0.0,
        to_m: mission.length_m,
        node_m: mission.coverage.node_m,
    });
    Ok(Coverage { store, sections, frontier: Frontier::default(), soundings })
}

/// What stages look up by source: navigation's view of each sensor, and the number and entity of each head; and the
/// heads themselves, by number.
#[expect(clippy::type_complexity, reason = "three tables, taken apart at once")]
fn tables(
    world: &mut World,
    sources: usize,
) -> Result<(SensorTable, HeadTable, Vec<(HeadSpec, Vec<HeadMode>)>), PluginError> {
    let nothing = SensorInfo {
        mount: headrace_geometry::frames::Mount {
            position: headrace_geometry::frames::Vec3::zero(),
            rotation: headrace_geometry::frames::Rot::identity(),
        },
        kind: SensorKind::Other,
    };
    let mut sensors = vec![nothing; sources.min(MAX_SOURCES)];
    let mut heads = vec![None; sources.min(MAX_SOURCES)];
    let mut found = Vec::new();
    let mut query = world.query::<(bevy_ecs::entity::Entity, &Mounted, Option<&SonarHead>)>();
    for (entity, mounted, head) in query.iter(world) {
        if let Some(slot) = sensors.get_mut(mounted.source.index()) {
            *slot = mounted.info;
        }
        if mounted.info.kind == SensorKind::Head {
            found.push((mounted.source, entity, head.cloned()));
        }
    }
    found.sort_unstable_by_key(|(source, ..)| *source);
    if found.len() > MAX_HEADS {
        return Err(PluginError::TooManyHeads { count: found.len(), max: MAX_HEADS });
    }
    let mut specs = Vec::new();
    for (number, (source, entity, head)) in found.into_iter().enumerate() {
        specs.extend(head.map(|head| (head.spec, head.modes)));
        world.entity_mut(entity).insert(HeadTrack::default());
        if let Some(slot) = heads.get_mut(source.index()) {
            *slot = Some((number, entity));
        }
    }
    Ok((SensorTable(sensors), HeadTable(heads), specs))
}
