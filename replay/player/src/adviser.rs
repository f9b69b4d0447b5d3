//! Simulates dives whose pilot follows the advice of a loop. The loop that gives the advice runs only during the
//! simulation. The recorded dive is later run through a loop of its own.

use headrace_geometry::time::{DurNs, MonoNs};
use headrace_monitor::feed::work_off;
use headrace_monitor::live_state::Condition;
use headrace_monitor::ring::Port;
use headrace_monitor::run::Loop;
use headrace_monitor::{App, PluginError};
use headrace_sampling::advice::Reason;
use headrace_sensor::device::Direction;
use headrace_simulator::{Adviser, Message, PilotAdvice, Scene, SceneError, Simulation};
use headrace_vehicle::VehicleConfig;

/// Length of a tick of the loop that advises the pilot.
const TICK: DurNs = DurNs(20_000_000);

/// Reason why a scene can't be simulated.
#[derive(Debug, thiserror::Error)]
pub enum SimulationError {
    /// The scene or its vehicle file contains an error.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// The monitor's loop that advises the pilot can't be set up (armed).
    #[error("arming the loop that advises the scene's pilot: {0}")]
    Adviser(#[from] PluginError),
}

/// Simulates a scene, with ground truth if `noting` is true.
///
/// If the scene's pilot follows advice, the advice comes from a loop that is armed with the scene's vehicle file.
///
/// Errors: see [`SimulationError`].
pub fn simulation(scene: &Scene, noting: bool) -> Result<Simulation, SimulationError> {
    simulation_believing(scene, &scene.vehicle, noting)
}

/// Simulates a scene as [`simulation`] does, but computes the pilot's advice with another vehicle file, `believed`.
///
/// The sensors of `believed` must send the same bytes as those of the scene's vehicle file.
///
/// Errors: see [`SimulationError`].
pub fn simulation_believing(
    scene: &Scene,
    believed: &VehicleConfig,
    noting: bool,
) -> Result<Simulation, SimulationError> {
    let simulation = if noting { Simulation::with_truth(scene)? } else { Simulation::new(scene)? };
    if !scene.is_advised() {
        return Ok(simulation);
    }
    Ok(simulation.advised_by(Box::new(LoopAdviser::new(believed)?)))
}

struct LoopAdviser {
    dive: Loop,
    /// Writing ends of the loop's packet rings, by source number; `None` if a ring is in use elsewhere.
    ports: Vec<Option<Port>>,
    /// End of the current tick of the loop.
    until: MonoNs,
    advice: Vec<PilotAdvice>,
}

impl LoopAdviser {
    fn new(vehicle: &VehicleConfig) -> Result<Self, PluginError> {
        let mut app = App::new(vehicle.mission());
        for sensor in &vehicle.sensors {
            app.add_device(sensor.as_ref())?;
        }
        let mut dive = app.arm(vehicle.navigation())?;
        let ports = (0..dive.sources().len()).map(|source| dive.take_port(source)).collect();
        Ok(Self { dive, ports, until: MonoNs(0), advice: Vec::new() })
    }

    fn tick(&mut self) {
        let Self { dive, until, advice, .. } = self;
        work_off(dive, *until, &mut |dive| advice.extend(advice_of(dive)), &mut || {});
    }
}

/// Returns the advice of the latest tick, if any.
fn advice_of(dive: &Loop) -> Option<PilotAdvice> {
    let last = dive.view().advised().entries.last()?;
    let sections = &dive.view().coverage().sections;
    let open = sections.runs().all().iter().filter(|run| run.is_open());
    let missed_m = open.map(|run| [sections.bounds_m(run.from).0, sections.bounds_m(run.to).0]).collect();
    let known = matches!(last.advice.reason, Reason::HelixPitch | Reason::AngularStep);
    let state = dive.view().live_state();
    let stand = state.asks_to_stand() || matches!(state.condition(), Condition::NoPosition(_));
    Some(PilotAdvice { at: last.at, v_max_mps: known.then_some(last.advice.v_max_mps), stand, missed_m })
}

impl Adviser for LoopAdviser {
    fn hear(&mut self, message: &Message<'_>) {
        if message.direction != Direction::Received {
            return;
        }
        if message.at >= self.until {
            self.tick();
            self.until = message.at + TICK;
        }
        let source = usize::from(message.source);
        if self
            .ports
            .get(source)
            .and_then(Option::as_ref)
            .is_some_and(|port| !port.has_room(message.bytes.len()))
        {
            self.tick();
        }
        if let Some(Err(error)) = self
            .ports
            .get_mut(source)
            .and_then(Option::as_mut)
            .map(|port| port.send(message.at, message.bytes))
        {
            tracing::error!(%error, "a simulated packet didn't reach the pilot's adviser");
        }
    }

    fn advice(&mut self) -> Vec<PilotAdvice> {
        std::mem::take(&mut self.advice)
    }
}
