//! Measures the computing cost of a simulation.

use headrace_sensor::device::{Direction, Sense};
use headrace_simulator::Scene;
use rustix::time::{ClockId, clock_gettime};

use super::error::EffectInfluenceError;
use super::mean::Mean;
use crate::adviser::{SimulationError, simulation};

/// Number of rounds. Each round simulates the scene once, and for a comparison once more without the effects.
const ROUNDS: usize = 5;

/// Returns the cost of simulating with all effects, ns of processor time per sonar return.
///
/// Errors: see [`EffectInfluenceError`].
pub(super) fn all_ns(scene: &Scene) -> Result<Mean, EffectInfluenceError> {
    let rounds: Result<Vec<f64>, SimulationError> = (0..ROUNDS).map(|_| ns_a_return(scene)).collect();
    Ok(Mean::of(&rounds?))
}

/// Returns the cost that these effects add, ns of processor time per sonar return.
///
/// Errors: see [`EffectInfluenceError`].
pub(super) fn of_ns(scene: &mut Scene, effects: &[&str]) -> Result<Mean, EffectInfluenceError> {
    let mut differences = Vec::new();
    for _ in 0..ROUNDS {
        let with = ns_a_return(scene)?;
        scene.leave_out(effects);
        let without = ns_a_return(scene);
        scene.leave_out(&[]);
        differences.push(with - without?);
    }
    Ok(Mean::of(&differences))
}

/// Simulates a scene, and returns the processor time of this thread per sonar return, ns.
fn ns_a_return(scene: &Scene) -> Result<f64, SimulationError> {
    let mut simulation = simulation(scene, false)?;
    let sensors = &scene.facts().sensors;
    let is_head = |source: u16| sensors.get(usize::from(source)).is_some_and(|of| of.sense == Sense::Head);
    let began_ns = thread_ns();
    let mut returns = 0_u64;
    while let Some(message) = simulation.next_message() {
        returns += u64::from(message.direction == Direction::Received && is_head(message.source));
    }
    Ok((thread_ns() - began_ns) / returns.max(1) as f64)
}

/// Returns the processor time used by this thread so far, ns.
fn thread_ns() -> f64 {
    let time = clock_gettime(ClockId::ThreadCPUTime);
    time.tv_sec as f64 * 1e9 + time.tv_nsec as f64
}
