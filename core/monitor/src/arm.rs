//! Arming: allocates all memory of a loop.

use bevy_ecs::entity::Entity;
use bevy_ecs::query::With;
use bevy_ecs::world::World;

use super::adviser::{Adviser, Advisor};
use super::alert_list::AlertList;
use super::alerter::Alerter;
use super::app::App;
use super::console::Console;
use super::dive_plan::planner::PlanSettings;
use super::entities::{
    Head, HeadClassifier, HeadEntities, HeadFrontier, HeadSpecification, HeadSweep, HiddenAngles, LossCount,
    MeasuredMotion, Mounted, Navigator, VehicleEntities, VehicleState,
};
use super::error::PluginError;
use super::head_descriptions::HeadDescriptions;
use super::live_state::{LiveState, source_bits};
use super::other_settings;
use super::part::Part;
use super::placer::Placer;
use super::placer::sound_speed::SoundSpeed;
use super::resources::{Coverage, Finder, Plan, TunnelDesign};
use super::ring;
use super::run::{Loop, Parts};
use super::source::SourceInfo;
use super::stage::{PlaceStage, SurveyStage};
use super::surveyor::Surveyor;
use super::view::About;
use headrace_coverage::{
    Frontier, GridLayout, HoleFinder, MissingSamples, SampleStore, Sections, Soundings, StoreLayout,
    WallLimits,
};
use headrace_fusion::Navigation;
use headrace_fusion::stuck_sensor::StuckSensor;
use headrace_sampling::advice::{self, Task};
use headrace_sampling::head::{HeadMode, HeadSet, HeadSpec, MAX_HEADS};
use headrace_sensor::device::SensorKind;
use headrace_sensor::reading::{MAX_SOURCES, SourceId};
use headrace_vehicle::Mission;

/// Margin of the sample store beyond both ends of the tunnel, m. It covers heads mounted ahead of or behind
/// the vehicle's origin.
const ROOM_BEYOND_M: f64 = 25.0;
/// Sample capacity per metre of tunnel. Four heads at 0.2 m/s give 1,000 per metre.
const SAMPLES_PER_M: f64 = 4_000.0;
const MIN_SAMPLES: f64 = 4_000_000.0;
const MAX_SAMPLES: f64 = 40_000_000.0;
/// Usual speed of a vehicle that is not inspecting, m/s.
const TRANSIT_MPS: f64 = 0.2;

impl App {
    /// Allocates all memory of the loop and makes it ready to run. No tick allocates or locks afterwards.
    ///
    /// Errors: too many heads, a missing source, an invalid opening, or an ambiguous order of systems.
    pub fn arm(self, navigation: Box<dyn Navigation>) -> Result<Loop, PluginError> {
        let Self { mission, mut placer, mut surveyor, adviser, outlets, keeps_results, .. } = self;
        let (sources, entities) = (self.sources, self.entities);
        let advisor = advisor(&mission, &number_heads(&mut placer.world, &entities)?);
        let heads = spawn_vehicle(&mut placer, &entities, navigation, &advisor);
        copy_heads(&placer.world, &heads, &mut surveyor);
        let world = &mut placer.world;
        let (tunnel, plan, reach_m) = (tunnel_design(&mission), plan(world, &mission), heads_reach_m(world));
        let descriptions = head_descriptions(world, &mission, &sources);
        let head_sources = heads.iter().filter_map(|head| world.get::<Mounted>(*head));
        let head_sources: Vec<SourceId> = head_sources.map(|mounted| mounted.source).collect();
        let advisor = Advisor::new(advisor, mission.target.max_hole_m, mission.dive_time);
        let adviser = Adviser::new(adviser, advisor, keeps_results)?;
        surveyor.insert_resource(tunnel.clone());
        surveyor.insert_resource(plan);
        let coverage = coverage(&mission, reach_m)?;
        let list = AlertList::new(mission.alerts, mission.limits, coverage.sections.len());
        let finder = Finder(HoleFinder::new(mission.coverage.hole_tolerance_m));
        let surveyor = Surveyor::new(surveyor, coverage, finder, keeps_results)?;
        placer.insert_resource(tunnel);
        placer.insert_resource(plan);
        let (console, console_reader) = ring::ring(0);
        let ports = self.ports.into_iter().chain([console]).collect();
        let readers = self.readers.into_iter().chain([console_reader]).collect();
        let sound_speed = SoundSpeed::new(mission.site.sound_speed_mps, sound_source(&mission, &sources)?);
        placer.insert_state("speed of sound", sound_speed);
        let placer = Placer::new(placer, readers, keeps_results)?;
        let live = live_state(&mission, &head_sources, sources.len(), reach_m);
        let room = (surveyor.found().runs.capacity(), keeps_results);
        let alerter = Alerter::new(list, &live, head_sources, plan_settings(&mission, reach_m), room);
        let about = About { mission, sources, descriptions };
        Ok(Loop::new(about, Parts { placer, surveyor, adviser, alerter }, outlets, ports))
    }
}

fn advisor(mission: &Mission, heads: &[(HeadSpec, Vec<HeadMode>)]) -> advice::Advisor {
    let task = Task {
        target: mission.target,
        length_m: mission.length_m,
        layout: mission.layout,
        sound_speed_mps: mission.site.sound_speed_mps,
        looks: mission.looks,
    };
    advice::Advisor::new(&mission.profile, task, heads, &mission.hull)
}

/// Spawns the vehicle in the placer, and adds the heads' remaining components. Returns the heads by number.
fn spawn_vehicle(
    placer: &mut Part<PlaceStage>,
    sensors: &[Entity],
    navigation: Box<dyn Navigation>,
    advisor: &advice::Advisor,
) -> Vec<Entity> {
    let world = &mut placer.world;
    let repeats = vec![StuckSensor::default(); MAX_SOURCES];
    let navigator = Navigator { navigation, next_update: None, repeats, hung: 0 };
    let vehicle = world.spawn((navigator, VehicleState::default())).id();
    let mut hidden = advisor.hidden_angles();
    let mut heads = Vec::new();
    for entity in sensors {
        if world.get::<Head>(*entity).is_some() {
            let hidden = HiddenAngles(hidden.next().map(<[_]>::to_vec).unwrap_or_default());
            let state = (MeasuredMotion::default(), LossCount::default());
            world.entity_mut(*entity).insert((hidden, state));
            heads.push(*entity);
        }
    }
    placer.entities = core::iter::once(vehicle).chain(sensors.iter().copied()).collect();
    // The last source is the operator's input, after all sensors.
    let console = SourceId(u16::try_from(sensors.len()).unwrap_or(u16::MAX));
    placer.insert_state("console", Console::new(console));
    placer.insert_resource(VehicleEntities { vehicle, by_source: sensors.to_vec() });
    heads
}

/// Spawns the heads in the surveyor's world, with the constants that they have in the placer's world.
fn copy_heads(placer: &World, heads: &[Entity], surveyor: &mut Part<SurveyStage>) {
    for head in heads {
        let head = placer.entity(*head);
        let (number, mounted) = (head.get::<Head>().copied(), head.get::<Mounted>().copied());
        let (Some(number), Some(mounted)) = (number, mounted) else { continue };
        let hidden = head.get::<HiddenAngles>().cloned().unwrap_or_default();
        let state = (HeadClassifier::default(), HeadSweep::default(), HeadFrontier::default());
        let copy = surveyor.world.spawn((number, mounted, hidden, state)).id();
        surveyor.entities.push(copy);
    }
    surveyor.insert_resource(HeadEntities(surveyor.entities.clone()));
}

fn tunnel_design(mission: &Mission) -> TunnelDesign {
    TunnelDesign {
        profile: mission.profile.clone(),
        site: mission.site,
        length_m: mission.length_m,
        contradiction_m: mission.coverage.contradiction_m,
        limits: WallLimits::new(
            mission.profile.perimeter_m(),
            mission.coverage.contradiction_m,
            mission.target.confidence_sd,
        ),
    }
}

fn plan(placer: &mut World, mission: &Mission) -> Plan {
    Plan {
        target: mission.target,
        layout: mission.layout,
        planned_speed_mps: mission.planned_speed_mps,
        other: other_settings::of_heads(placer, &mission.profile, mission.target.max_hole_m),
    }
}

fn plan_settings(mission: &Mission, heads_reach_m: f64) -> PlanSettings {
    let Mission { limits, length_m, planned_speed_mps, target, .. } = mission;
    PlanSettings {
        end_m: limits.cable_m.map_or(*length_m, |cable_m| cable_m.min(*length_m)),
        transit_mps: limits.transit_mps.unwrap_or(TRANSIT_MPS),
        planned_mps: *planned_speed_mps,
        run_up_m: heads_reach_m + target.max_hole_m,
    }
}

fn live_state(mission: &Mission, heads: &[SourceId], sources: usize, heads_reach_m: f64) -> LiveState {
    let bits = source_bits(heads.iter().copied(), HeadSet::from_bits(u8::MAX));
    let sources = u16::try_from(sources).unwrap_or(0);
    let live = LiveState::new(mission.target, bits, sources);
    LiveState { length_m: mission.length_m, heads_reach_m, ..live }
}

/// Numbers the heads in the order of sources. Returns each head's specification and scan modes.
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

/// Names of the heads, and the alternative settings that could be advised.
fn head_descriptions(world: &mut World, mission: &Mission, sources: &[SourceInfo]) -> HeadDescriptions {
    let mut heads = world.query::<(&Head, &Mounted, &HeadSpecification)>();
    let mut heads: Vec<_> = heads.iter(world).collect();
    heads.sort_by_key(|(head, ..)| head.0);
    let name = |mounted: &Mounted| sources.get(mounted.source.index()).map_or("", |source| &source.id);
    HeadDescriptions::of(
        heads.into_iter().map(|(_, mounted, head)| {
            head.settings(name(mounted), &mission.profile, mission.target.max_hole_m)
        }),
    )
}

/// Largest distance of a head ahead of or behind the vehicle's origin, m.
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
        cell_m: StoreLayout::cell_for_target_m(mission.target.max_hole_m),
        capacity: u32::try_from(samples).unwrap_or(u32::MAX),
    });
    let mut sections = Sections::new(mission.section_m, mission.target, 0.0, mission.length_m)
        .with_heads_reach_m(heads_reach_m);
    for opening in &mission.coverage.openings {
        let name = || opening.name.clone();
        opening
            .fill(&mut store, mission.target)
            .map_err(|why| PluginError::Opening { name: name(), why: why.to_string() })?;
        sections.mask(opening, &mission.profile);
    }
    let soundings = Soundings::new(GridLayout {
        perimeter_m: mission.profile.perimeter_m(),
        from_m: 0.0,
        to_m: mission.length_m,
        node_m: mission.coverage.node_m,
    });
    let (frontier, missing_samples) = (Frontier::default(), MissingSamples::default());
    Ok(Coverage { store, sections, frontier, soundings, unsure: None, missing_samples })
}
