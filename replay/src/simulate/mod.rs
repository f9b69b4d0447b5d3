//! The simulator: a scene becomes the bytes that its devices would send.
//!
//! Only what a scene names is simulated. Without effects a device is ideal but for the quanta of its own wire format.

mod scene;
mod trajectory;

use std::collections::BTreeMap;

use headrace_core::app::device::{Direction, Emulator, EmulatorSetup, Truth};
use headrace_core::frames::{Point3, Pose, Tunnel, Vec3};
use headrace_core::site::Site;
use headrace_core::time::MonoNs;
use headrace_core::tunnel::Profile;

pub use scene::{Scene, SceneError};
pub use trajectory::{Leg, Trajectory};

/// Simulated dives begin at this moment of their clock.
pub const START: MonoNs = MonoNs(1_000_000_000);

/// A straight tunnel and the vehicle's way through it.
struct World {
    profile: Profile,
    site: Site,
    trajectory: Trajectory,
}

impl Truth for World {
    fn pose(&self, at: MonoNs) -> Pose {
        self.trajectory.pose(at.since(START).as_secs_f64())
    }

    fn range_m(&self, origin: Point3<Tunnel>, direction: Vec3<Tunnel>) -> Option<f64> {
        self.profile.cast([origin.y(), origin.z()], [direction.y(), direction.z()]).map(|hit| hit.range_m)
    }

    fn site(&self) -> &Site {
        &self.site
    }
}

/// Bytes on the line of one source.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Message {
    /// When they crossed the line.
    pub at: MonoNs,
    /// The source, in the order of the vehicle file.
    pub source: u16,
    /// Which way they went.
    pub direction: Direction,
    /// The bytes.
    pub bytes: Vec<u8>,
}

/// A dive that is being simulated: messages in the order of (time, source, sequence).
pub struct Simulation {
    world: World,
    emulators: Vec<Box<dyn Emulator>>,
    end: MonoNs,
    /// Messages that an emulator has sent ahead of the others' next ones.
    waiting: BTreeMap<(MonoNs, u16, u64), (Direction, Vec<u8>)>,
    sequence: u64,
}

impl Simulation {
    /// Puts the scene's devices into its tunnel. Heads follow the scene's programs.
    pub fn new(scene: &Scene) -> Self {
        let vehicle = &scene.vehicle;
        let mut programs = scene.programs.iter().copied();
        let emulators = vehicle
            .sensors
            .iter()
            .map(|sensor| {
                let head = sensor.head().and_then(|_| programs.next());
                sensor.emulator(&EmulatorSetup { start: START, head })
            })
            .collect();
        let end = START + headrace_core::time::DurNs::from_secs_f64(scene.trajectory.duration_s());
        Self {
            world: World {
                profile: vehicle.tunnel.profile.clone(),
                site: vehicle.site,
                trajectory: scene.trajectory.clone(),
            },
            emulators,
            end,
            waiting: BTreeMap::new(),
            sequence: 0,
        }
    }

    /// When the dive ends.
    pub fn end(&self) -> MonoNs {
        self.end
    }

    /// The next message, or `None` at the end of the dive.
    pub fn next_message(&mut self) -> Option<Message> {
        loop {
            let next = self
                .emulators
                .iter()
                .map(|emulator| emulator.due())
                .enumerate()
                .min_by_key(|(_, due)| *due)
                .filter(|(_, due)| *due <= self.end);
            // What waits may go once nobody can send anything earlier.
            if let Some(entry) = self.waiting.first_entry()
                && next.is_none_or(|(_, due)| entry.key().0 < due)
            {
                let ((at, source, _), (direction, bytes)) = entry.remove_entry();
                return Some(Message { at, source, direction, bytes });
            }
            let (index, _) = next?;
            self.act(index);
        }
    }

    fn act(&mut self, index: usize) {
        let Self { world, emulators, waiting, sequence, .. } = self;
        let (Some(emulator), Ok(source)) = (emulators.get_mut(index), u16::try_from(index)) else { return };
        emulator.act(world, &mut |direction, at, bytes| {
            *sequence += 1;
            waiting.insert((at, source, *sequence), (direction, bytes.to_vec()));
        });
    }
}
