//! Simulates a dive once, replays it with any settings, and compares the reported sections with the true holes D_true.
//!
//! The estimated chainage may have a constant offset (slack, wheel scale). Section bounds are in estimated chainage,
//! because a pilot goes back to an estimated chainage. For the comparison, the bounds of each section are shifted by an
//! offset of their own. It is the median of the vehicle's true chainage minus its estimated chainage, over all samples
//! in or near the section.

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::sync::Arc;

use bevy_ecs::prelude::{Res, ResMut, Resource};
use headrace_fusion::Navigation;
use headrace_geometry::time::MonoNs;
use headrace_monitor::messages::Outcome;
use headrace_monitor::placer::PlacedTick;
use headrace_monitor::report::Report;
use headrace_monitor::ring::{Port, RingError};
use headrace_monitor::run::Loop;
use headrace_monitor::section_row::SectionRow;
use headrace_monitor::stage::SurveyStage;
use headrace_monitor::{App, Plugin, PluginError};
use headrace_replay::drive::{Coming, Pace, PacketSource, drive};
use headrace_replay::log::LogError;
use headrace_sensor::device::Direction;
use headrace_sensor::reading::SourceId;
use headrace_simulator::{Scene, Scenery, Simulation};
use headrace_vehicle::VehicleConfig;

use crate::blocks::Blocks;
use crate::cpu::timed;
use crate::error::TruthError;
use crate::truth::{Truth, TruthTaker};

/// Samples within this distance of a section are used for the section's chainage offset, m.
const NEAR_M: f64 = 1.0;

/// Packets sent by the devices, in order of time.
#[derive(Debug, Default)]
pub struct Packets {
    /// For each packet: receive time, source, and the offset in `bytes` at which the packet ends.
    list: Vec<(MonoNs, u16, usize)>,
    bytes: Vec<u8>,
}

impl Packets {
    fn push(&mut self, at: MonoNs, source: u16, bytes: &[u8]) {
        self.bytes.extend_from_slice(bytes);
        self.list.push((at, source, self.bytes.len()));
    }

    /// Number of packets.
    pub fn len(&self) -> usize {
        self.list.len()
    }

    /// Whether there are no packets.
    pub fn is_empty(&self) -> bool {
        self.list.is_empty()
    }

    /// Returns a feed that gives a loop all packets in order.
    pub fn feed(&self) -> PacketFeed<'_> {
        PacketFeed { packets: self, next: 0, from: 0 }
    }
}

/// Feed of packets from memory.
#[derive(Debug)]
pub struct PacketFeed<'a> {
    packets: &'a Packets,
    next: usize,
    /// Offset of the next packet's bytes among the bytes of all packets.
    from: usize,
}

impl PacketSource for PacketFeed<'_> {
    fn coming(&mut self) -> Result<Option<Coming>, LogError> {
        let coming = |(at, source, end): &(MonoNs, u16, usize)| Coming {
            at: *at,
            source: SourceId(*source),
            len: end - self.from,
        };
        Ok(self.packets.list.get(self.next).map(coming))
    }

    fn send(&mut self, port: &mut Port) -> Result<(), RingError> {
        if let Some((at, _, end)) = self.packets.list.get(self.next) {
            port.send(*at, self.packets.bytes.get(self.from..*end).unwrap_or_default())?;
            (self.next, self.from) = (self.next + 1, *end);
        }
        Ok(())
    }
}

/// A simulated dive.
pub struct Recorded {
    /// Packets sent by the devices.
    pub packets: Packets,
    /// Simulated truth of the dive: the places where beams met the wall.
    pub truth: Arc<Truth>,
    /// True trajectory of the vehicle.
    pub scenery: Scenery,
    wall: Blocks,
    /// Cache of the true holes D_true. The key is the bit patterns of the two bounds of a stretch.
    holes_m: RefCell<BTreeMap<[u64; 2], f64>>,
}

/// A reported section with its true hole.
#[derive(Debug, Clone)]
pub struct JudgedSection {
    /// The section as reported by the loop.
    pub report: SectionRow,
    /// True hole diameter D_true, m; infinite without samples.
    pub true_hole_m: f64,
    /// Chainage offset of the section: true minus estimated chainage, m.
    pub shift_m: f64,
}

/// Report of a dive, and the truth of the dive's sections.
pub struct JudgedDive {
    /// Report of the dive from the loop.
    pub report: Report,
    /// True places where beams met the wall.
    pub truth: Arc<Truth>,
    /// All sections of the report, in order.
    pub sections: Vec<JudgedSection>,
}

/// Simulates a scene and replays it with the scene's own vehicle file.
///
/// Errors: see [`TruthError`].
pub fn dive(scene: &Scene) -> Result<JudgedDive, TruthError> {
    dive_believing(scene, &scene.vehicle)
}

/// Simulates a scene and replays it with another vehicle file, with sensors that send the same bytes.
///
/// Errors: see [`TruthError`].
pub fn dive_believing(scene: &Scene, believed: &VehicleConfig) -> Result<JudgedDive, TruthError> {
    Recorded::of(scene, believed)?.judged(believed)
}

impl Recorded {
    /// Simulates a scene. `believed` configures the loop that advises the simulated pilot, and supplies the profile
    /// for arc lengths.
    ///
    /// Errors: the scene can't be simulated, or the oracle rejects its truth.
    pub fn of(scene: &Scene, believed: &VehicleConfig) -> Result<Self, TruthError> {
        let mut simulation = headrace_replay::simulation_believing(scene, believed, true)?;
        let mut taker = TruthTaker::new(scene, &simulation, &believed.tunnel.profile);
        let mut packets = Packets::default();
        while let Some(message) = simulation.next_message() {
            if message.direction == Direction::Received {
                packets.push(message.at, message.source, message.bytes);
            }
            taker.note(&mut simulation);
        }
        taker.note(&mut simulation);
        let scenery = scenery_of(&simulation)?;
        let truth = taker.truth();
        Ok(Self {
            packets,
            wall: Blocks::of(&truth)?,
            truth: Arc::new(truth),
            scenery,
            holes_m: RefCell::new(BTreeMap::new()),
        })
    }

    /// Duration of the dive, from the first to the last packet, s.
    pub fn duration_s(&self) -> f64 {
        let ends = self.packets.list.first().zip(self.packets.list.last());
        ends.map_or(0.0, |((first, ..), (last, ..))| last.since(*first).as_secs_f64())
    }

    /// True hole D_true of a stretch of true chainage, m; infinite without samples.
    pub fn true_hole_m(&self, from_m: f64, to_m: f64) -> f64 {
        let key = [from_m.to_bits(), to_m.to_bits()];
        *self.holes_m.borrow_mut().entry(key).or_insert_with(|| self.wall.hole_m(&self.truth, from_m, to_m))
    }

    /// Replays the dive with the settings of a vehicle file and compares its report with the truth.
    ///
    /// Errors: the loop can't be armed or driven.
    pub fn judged(&self, vehicle: &VehicleConfig) -> Result<JudgedDive, TruthError> {
        self.judged_with(vehicle, vehicle.navigation(), &mut |_| {})
    }

    /// As [`Recorded::judged`], with another navigation. Calls `note` with the loop after each tick.
    ///
    /// Errors: the loop can't be armed or driven.
    pub fn judged_with(
        &self,
        vehicle: &VehicleConfig,
        navigation: Box<dyn Navigation>,
        note: &mut dyn FnMut(&Loop),
    ) -> Result<JudgedDive, TruthError> {
        Ok(self.judge(&self.replayed(vehicle, navigation, note)?))
    }

    /// Replays the dive and returns the loop at its end, for [`Recorded::judge`].
    ///
    /// Errors: the loop can't be armed or driven.
    pub fn replayed(
        &self,
        vehicle: &VehicleConfig,
        navigation: Box<dyn Navigation>,
        note: &mut dyn FnMut(&Loop),
    ) -> Result<Loop, TruthError> {
        let mut dive = armed(vehicle, navigation, &[&Watch])?;
        drive(&mut dive, &mut self.packets.feed(), Pace::default(), &mut |dive: &Loop| note(dive))?;
        dive.finish(&mut |_, _| {});
        Ok(dive)
    }

    /// Compares the report of a replayed loop with the truth.
    pub fn judge(&self, dive: &Loop) -> JudgedDive {
        let report = Report::of(dive);
        let shifts = dive
            .view()
            .surveyor()
            .resource::<Seen>()
            .map_or_else(Shifts::default, |seen| seen.shifts(&self.scenery));
        let judge = |section: &SectionRow| {
            let shift_m = shifts.about(section.start_m, section.end_m);
            let true_hole_m = self.true_hole_m(section.start_m + shift_m, section.end_m + shift_m);
            JudgedSection { report: section.clone(), true_hole_m, shift_m }
        };
        let sections = report.sections.iter().map(judge).collect();
        JudgedDive { report, truth: Arc::clone(&self.truth), sections }
    }

    /// CPU time of a replay with the settings of a vehicle file, s. Arming and the report are excluded.
    ///
    /// Errors: the loop can't be armed or driven.
    pub fn cpu_s(&self, vehicle: &VehicleConfig) -> Result<f64, TruthError> {
        self.cpu_with_s(vehicle, vehicle.navigation(), Pace::default())
    }

    /// As [`Recorded::cpu_s`], with another navigation and tick length.
    ///
    /// Errors: the loop can't be armed or driven.
    pub fn cpu_with_s(
        &self,
        vehicle: &VehicleConfig,
        navigation: Box<dyn Navigation>,
        pace: Pace,
    ) -> Result<f64, TruthError> {
        Ok(self.timed_with(vehicle, navigation, pace)?.1)
    }

    /// Replays the dive and returns the loop at its end and the CPU time used, s.
    ///
    /// Errors: the loop can't be armed or driven.
    pub fn timed(&self, vehicle: &VehicleConfig) -> Result<(Loop, f64), TruthError> {
        self.timed_with(vehicle, vehicle.navigation(), Pace::default())
    }

    fn timed_with(
        &self,
        vehicle: &VehicleConfig,
        navigation: Box<dyn Navigation>,
        pace: Pace,
    ) -> Result<(Loop, f64), TruthError> {
        let mut dive = armed(vehicle, navigation, &[])?;
        let (driven, cpu_s) = timed(|| {
            let driven = drive(&mut dive, &mut self.packets.feed(), pace, &mut |_| {});
            dive.finish(&mut |_, _| {});
            driven
        });
        driven?;
        Ok((dive, cpu_s))
    }
}

/// Arms a loop with a vehicle file.
///
/// Errors: see [`PluginError`].
pub fn armed(
    vehicle: &VehicleConfig,
    navigation: Box<dyn Navigation>,
    plugins: &[&dyn Plugin],
) -> Result<Loop, PluginError> {
    let mut app = App::new(vehicle.mission());
    for sensor in &vehicle.sensors {
        app.add_device(sensor.as_ref())?;
    }
    for plugin in plugins {
        app.add_plugin(*plugin)?;
    }
    app.arm(navigation)
}

fn scenery_of(simulation: &Simulation) -> Result<Scenery, TruthError> {
    simulation.scenery().cloned().ok_or_else(|| TruthError::Figure {
        what: "a simulated dive".to_owned(),
        why: "the simulation has no scenery".to_owned(),
    })
}

/// For each placed sample: its time, its estimated chainage, and the vehicle's estimated chainage at this time.
#[derive(Resource, Default)]
struct Seen(Vec<(MonoNs, f64, f64)>);

/// Observer of the loop that records the places of samples and changes nothing.
struct Watch;

impl Plugin for Watch {
    fn build(&self, app: &mut App) -> Result<(), PluginError> {
        app.surveyor.insert_resource(Seen::default());
        app.surveyor.add_systems(SurveyStage::Surveyed, watch);
        Ok(())
    }
}

#[expect(clippy::needless_pass_by_value, reason = "systems take their parameters by value")]
fn watch(placed: Res<'_, PlacedTick>, mut seen: ResMut<'_, Seen>) {
    for ping in placed.pings() {
        if let (Outcome::Sample { point, .. }, Some(fix)) = (ping.outcome, ping.fix) {
            seen.0.push((ping.valid_at, point.x(), fix.pose.position.x()));
        }
    }
}

impl Seen {
    fn shifts(&self, scenery: &Scenery) -> Shifts {
        let shift = |(at, sample_x_m, x_m): &(MonoNs, f64, f64)| (*sample_x_m, scenery.chainage_m(*at) - x_m);
        let mut shifts: Vec<(f64, f64)> = self.0.iter().map(shift).collect();
        shifts.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)));
        Shifts(shifts)
    }
}

/// For each sample: its estimated chainage, and the vehicle's chainage offset (true minus estimated) at its time, m.
/// The samples are sorted by chainage.
#[derive(Default)]
struct Shifts(Vec<(f64, f64)>);

impl Shifts {
    /// Median chainage offset (true minus estimated) of the samples near a section. If no sample is near, it is the
    /// offset of the nearest sample. It is 0 in a dive without samples.
    fn about(&self, from_m: f64, to_m: f64) -> f64 {
        let before = |x_m: f64| self.0.partition_point(|(sample_x_m, _)| *sample_x_m < x_m);
        let near = self.0.get(before(from_m - NEAR_M)..before(to_m + NEAR_M)).unwrap_or_default();
        let mut near: Vec<f64> = near.iter().map(|(_, by_m)| *by_m).collect();
        if near.is_empty() {
            let after = before(from_m).min(self.0.len().saturating_sub(1));
            return self.0.get(after).map_or(0.0, |(_, by_m)| *by_m);
        }
        let middle = near.len() / 2;
        *near.select_nth_unstable_by(middle, f64::total_cmp).1
    }
}
