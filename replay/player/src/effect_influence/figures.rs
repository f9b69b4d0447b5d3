//! Results of the loop for one simulated dive.

use std::collections::BTreeMap;

use headrace_geometry::math;
use headrace_monitor::App;
use headrace_monitor::report::Report;
use headrace_simulator::Scene;

use super::error::EffectInfluenceError;
use crate::adviser::simulation;
use crate::drive::{Pace, drive};
use crate::simulation_feed::SimulationFeed;

/// Results of one dive.
#[derive(Debug, Clone)]
pub(super) struct Figures {
    /// Diameter D of the hole, m, of each section whose hole is bounded. The key is the start of the section, mm.
    holes_m: BTreeMap<i64, f64>,
    /// Length of the sections that the vehicle has passed, m.
    pub(super) way_m: f64,
    /// Length of sections with the verdict "pass", m.
    pub(super) passed_m: f64,
}

impl Figures {
    /// Simulates a scene and runs it through the loop.
    ///
    /// Errors: see [`EffectInfluenceError`].
    pub(super) fn of(scene: &Scene) -> Result<Self, EffectInfluenceError> {
        let vehicle = &scene.vehicle;
        let mut app = App::new(vehicle.mission());
        for sensor in &vehicle.sensors {
            app.add_device(sensor.as_ref())?;
        }
        let mut dive = app.arm(vehicle.navigation())?;
        let mut feed = SimulationFeed::new(simulation(scene, false)?);
        drive(&mut dive, &mut feed, Pace::default(), &mut |_| {})?;
        dive.finish(&mut |_, _| {});
        let mut figures = Self { holes_m: BTreeMap::new(), way_m: 0.0, passed_m: 0.0 };
        for section in Report::of(&dive).sections {
            let length_m = section.end_m - section.start_m;
            figures.way_m += length_m;
            figures.passed_m += if section.verdict == "pass" { length_m } else { 0.0 };
            if let Some(hole_m) = section.hole_m.filter(|_| section.hole_bounded) {
                figures.holes_m.insert(math::round_to_i64(section.start_m * 1000.0), hole_m);
            }
        }
        Ok(figures)
    }

    /// Returns the mean of D over all sections, m.
    pub(super) fn hole_m(&self) -> f64 {
        self.holes_m.values().sum::<f64>() / self.holes_m.len() as f64
    }

    /// Returns the mean difference of D over the sections that both dives have, m; zero if there are none.
    pub(super) fn hole_more_than_m(&self, other: &Self) -> f64 {
        let both = self.holes_m.iter().filter_map(|(at, hole_m)| Some(hole_m - other.holes_m.get(at)?));
        let differences: Vec<f64> = both.collect();
        if differences.is_empty() { 0.0 } else { differences.iter().sum::<f64>() / differences.len() as f64 }
    }
}
