//! Arming: allocates all memory of a loop.

use bevy_ecs::entity::Entity;
use bevy_ecs::query::With;
use bevy_ecs::world::World;

use super::advice_log::AdviceLog;
use super::alert_list::{AlertList, MOST_LISTED};
use super::alerts::Alerts;
use super::app::{App, SourceInfo};
use super::console::{Commands, Console};
use super::entities::{
    Head, HeadFrontier, HeadSpecification, HeadSweep, HiddenAngles, LossCount, MeasuredMotion, Mounted,
    Navigator, VehicleState,
};
use super::error::PluginError;
use super::head_descriptions::HeadDescriptions;
use super::live_state::{LiveState, source_bits};
use super::merge::{Inbox, MAX_TICK_BYTES, MAX_TICK_PACKETS};
use super::messages::{
    AdviceList, Events, JudgedStates, Notices, PlacedEvents, PlacedList, PositionedList, Requests,
};
use super::notes::Notes;
use super::other_settings;

use super::resources::{Coverage, Digests, Finder, Tally, Target, TickTime, TunnelDesign, VehicleEntities};
use super::ring;
use super::run::Loop;
use super::stages::{Advisor, Driving, RunInputs, SoundSpeed};
use headrace_coverage::{
    Frontier, GridLayout, HoleFinder, MissingSamples, Relief, SampleStore, Sections, Soundings, StoreLayout,
    WallLimits,
};
use headrace_fusion::Navigation;
use headrace_fusion::stuck_sensor::StuckSensor;
use headrace_sampling::advice::{self, Task};
use headrace_sampling::head::{HeadMode, HeadSet, HeadSpec, MAX_HEADS};
use headrace_sensor::device::SensorKind;
use headrace_sensor::reading::{MAX_SOURCES, SourceId};
use headrace_vehicle::Mission;

/// Capacity for the readings of one tick. The shortest frame of any device has over ten bytes.
const MAX_TICK_READINGS: usize = MAX_TICK_BYTES / 8;

/// Margin of the sample store beyond both ends of the tunnel, m. It covers heads mounted ahead of or behind
/// the vehicle's origin.
const ROOM_BEYOND_M: f64 = 25.0;
/// Sample capacity per metre of tunnel. Four heads at 0.2 m/s give 1,000 per metre.
const SAMPLES_PER_M: f64 = 4_000.0;
const MIN_SAMPLES: f64 = 4_000_000.0;
const MAX_SAMPLES: f64 = 40_000_000.0;

/// Maximum number of runs that change when one section is judged: its own run and two others.
const RUNS_EACH: usize = 3;
/// Notices per judged section: one for the section, three per run and its alert, and one for an alert.
const NOTICES_EACH: usize = 2 + 3 * RUNS_EACH;
/// Additional notices of alerts per tick.
const NOTICES_OF_ALERTS: usize = 4 * MOST_LISTED;

impl App {
    /// Allocates all memory of the loop and makes it ready to run. No tick allocates or locks afterwards.
    ///
    /// Errors: too many heads, a missing source, an invalid opening, or an ambiguous order of systems.
    pub fn arm(mut self, navigation: Box<dyn Navigation>) -> Result<Loop, PluginError> {
        let mission = &self.mission;
        let specs = number_heads(&mut self.world, &self.entities)?;
        let task = Task {
            target_m: mission.target_m,
            confidence_sd: mission.coverage.confidence_sd,
            length_m: mission.length_m,
            layout: mission.layout,
            sound_speed_mps: mission.site.sound_speed_mps,
            looks: mission.looks,
        };
        let advisor = advice::Advisor::new(&mission.profile, task, &specs, &mission.hull);
        self.add_console();
        let entities = self.spawn_entities(navigation, &advisor);
        self.insert_resources(entities, advisor)?;
        self.insert_messages();
        self.schedule
            .initialize(&mut self.world)
            .map_err(|error| PluginError::Schedule { why: format!("{error:?}") })?;
        Ok(Loop::new(self))
    }

    /// Adds the operator's input after all sensors.
    fn add_console(&mut self) {
        let (port, reader) = ring::ring(0);
        self.ports.push(port);
        self.readers.push(reader);
        // The number is at most that of the sensors.
        let number = u16::try_from(self.sources.len()).unwrap_or(u16::MAX);
        self.world.insert_resource(Console::new(SourceId(number)));
        self.world.insert_resource(Commands::new());
        self.world.insert_resource(Notes::default());
    }

    /// Spawns the vehicle, and adds the heads' remaining components.
    fn spawn_entities(
        &mut self,
        navigation: Box<dyn Navigation>,
        advisor: &advice::Advisor,
    ) -> VehicleEntities {
        let world = &mut self.world;
        let repeats = vec![StuckSensor::default(); MAX_SOURCES];
        let navigator = Navigator { navigation, next_beat: None, repeats, hung: 0 };
        let vehicle = world.spawn((navigator, VehicleState::default(), Driving::default())).id();
        let mut hidden = advisor.hidden_angles();
        let mut heads = Vec::new();
        for entity in &self.entities {
            if world.get::<Head>(*entity).is_none() {
                continue;
            }
            let hidden = HiddenAngles(hidden.next().map(<[_]>::to_vec).unwrap_or_default());
            let state = (
                MeasuredMotion::default(),
                LossCount::default(),
                HeadSweep::default(),
                HeadFrontier::default(),
            );
            world.entity_mut(*entity).insert((hidden, state));
            heads.push(*entity);
        }
        VehicleEntities { vehicle, by_source: self.entities.clone(), heads }
    }

    fn insert_resources(
        &mut self,
        entities: VehicleEntities,
        advisor: advice::Advisor,
    ) -> Result<(), PluginError> {
        let Self { mission, world, sources, .. } = self;
        let source_of = |entity: &Entity| world.get::<Mounted>(*entity).map(|mounted| mounted.source);
        let heads: Vec<SourceId> = entities.heads.iter().filter_map(source_of).collect();
        world.insert_resource(entities);
        let told_by = sound_source(mission, sources)?;
        world.insert_resource(SoundSpeed::new(mission.site.sound_speed_mps, told_by));
        world.insert_resource(Finder(HoleFinder::new(mission.coverage.hole_tolerance_m)));
        world.insert_resource(Alerts::default());
        world.insert_resource(Advisor::new(advisor, mission.target_m, mission.dive_time));
        world.insert_resource(AdviceLog::default());
        if world.get_resource::<Digests>().is_none() {
            world.insert_resource(Digests::default());
        }
        world.insert_resource(Tally::default());
        world.insert_resource(TickTime::default());
        let reach_m = heads_reach_m(world);
        let coverage = coverage(mission, reach_m)?;
        world.insert_resource(AlertList::new(mission.alerts, mission.limits, coverage.sections.len()));
        world.insert_resource(coverage);
        world.insert_resource(TunnelDesign {
            profile: mission.profile.clone(),
            site: mission.site,
            length_m: mission.length_m,
            contradiction_m: mission.coverage.contradiction_m,
            limits: WallLimits::new(mission.profile.perimeter_m(), mission.coverage.contradiction_m),
        });
        let words = head_descriptions(world, mission, sources);
        world.insert_resource(words);
        let heads = source_bits(heads.into_iter(), HeadSet::from_bits(u8::MAX));
        let sources = u16::try_from(sources.len()).unwrap_or(0);
        let confidence_sd = mission.coverage.confidence_sd;
        let live = LiveState::new(mission.target_m, confidence_sd, heads, sources);
        let (length_m, heads_reach_m) = (mission.length_m, reach_m);
        world.insert_resource(LiveState { length_m, heads_reach_m, ..live });
        let other = other_settings::of_heads(world, &mission.profile, mission.target_m);
        world.insert_resource(Target {
            target_m: mission.target_m,
            layout: mission.layout,
            planned_speed_mps: mission.planned_speed_mps,
            other,
        });
        Ok(())
    }

    fn insert_messages(&mut self) {
        let world = &mut self.world;
        // A jump along the tunnel may make all sections due for judging at once.
        let most = world.resource::<Coverage>().sections.len() + MAX_TICK_PACKETS;
        world.insert_resource(Inbox::default());
        world.insert_resource(Events(Vec::with_capacity(MAX_TICK_READINGS)));
        world.insert_resource(PositionedList(Vec::with_capacity(2 * MAX_TICK_READINGS)));
        world.insert_resource(PlacedList(Vec::with_capacity(2 * MAX_TICK_READINGS)));
        world.insert_resource(PlacedEvents(Vec::with_capacity(2 * MAX_TICK_READINGS)));
        world.insert_resource(AdviceList(Vec::with_capacity(MAX_TICK_PACKETS)));
        world.insert_resource(RunInputs(Vec::with_capacity(RUNS_EACH * most)));
        world.insert_resource(JudgedStates(Vec::with_capacity(MAX_TICK_PACKETS)));
        world.insert_resource(Requests(Vec::with_capacity(most)));
        world.insert_resource(Notices(Vec::with_capacity(
            NOTICES_EACH * most + MAX_TICK_PACKETS + NOTICES_OF_ALERTS,
        )));
    }
}

/// Numbers the heads in the order of sources. Returns each head's specification and modes.
fn number_heads(
    world: &mut World,
    sensors: &[Entity],
) -> Result<Vec<(HeadSpec, Vec<HeadMode>)>, PluginError> {
    let is_head = |entity: &&Entity| {
        world.get::<Mounted>(**entity).is_some_and(|mounted| mounted.info.kind == SensorKind::Head)
    };
    let heads: Vec<Entity> = sensors.iter().filter(is_head).copied().collect();
    if heads.len() > MAX_HEADS {
        return Err(PluginError::TooManyHeads { count: heads.len(), max: MAX_HEADS });
    }
    let mut specs = Vec::new();
    for (number, entity) in heads.into_iter().enumerate() {
        let head = world.get::<HeadSpecification>(entity).cloned();
        specs.extend(head.map(|head| (head.spec, head.modes)));
        world.entity_mut(entity).insert(Head(number));
    }
    Ok(specs)
}

/// Depth sensor that supplies the speed of sound.
fn sound_source(mission: &Mission, sources: &[SourceInfo]) -> Result<Option<SourceId>, PluginError> {
    let Some(id) = &mission.sound_speed_from else { return Ok(None) };
    let place =
        sources.iter().position(|source| source.id == *id).and_then(|place| u16::try_from(place).ok());
    place.map(|place| Some(SourceId(place))).ok_or_else(|| PluginError::MissingSource { id: id.clone() })
}

/// Names of the heads and their alternative settings.
fn head_descriptions(world: &mut World, mission: &Mission, sources: &[SourceInfo]) -> HeadDescriptions {
    let mut heads = world.query::<(&Head, &Mounted, &HeadSpecification)>();
    let mut heads: Vec<_> = heads.iter(world).collect();
    heads.sort_by_key(|(head, ..)| head.0);
    let name = |mounted: &Mounted| sources.get(mounted.source.index()).map_or("", |source| &source.id);
    HeadDescriptions::of(
        heads
            .into_iter()
            .map(|(_, mounted, head)| head.settings(name(mounted), &mission.profile, mission.target_m)),
    )
}

/// Largest distance of a head before or behind the vehicle's origin, m.
fn heads_reach_m(world: &mut World) -> f64 {
    let mut heads = world.query_filtered::<&Mounted, With<Head>>();
    heads.iter(world).map(|mounted| mounted.info.mount.position.x().abs()).fold(0.0, f64::max)
}

fn coverage(mission: &Mission, heads_reach_m: f64) -> Result<Coverage, PluginError> {
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
    let mut sections = Sections::new(mission.section_m, mission.target_m, 0.0, mission.length_m)
        .with_confidence_sd(mission.coverage.confidence_sd)
        .with_heads_reach_m(heads_reach_m);
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
    let (frontier, relief, lacks) = (Frontier::default(), Relief::default(), MissingSamples::default());
    Ok(Coverage { store, sections, frontier, soundings, relief, unsure: None, lacks })
}
