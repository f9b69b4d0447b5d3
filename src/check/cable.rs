//! Accuracy of the cable's chainage, from counter steps, slack and speed.

use headrace_config::Document;
use headrace_sampling::margin::ExpectedErrors;
use headrace_sensor::device::Sense;
use headrace_vehicle::{NavigationConfig, VehicleConfig};
use serde_json::{Value, json};

/// Accuracy of the cable's chainage, for a vehicle with a counter and the filter.
pub(super) struct Cable {
    /// Step of the counter, m; `None` if each reading states the step itself.
    step_m: Option<f64>,
    /// Standard deviation of the slack, m, and its time constant, s.
    slack: [f64; 2],
    /// A speed, m/s, followed by the standard deviation of a hole's diameter and the largest measured hole
    /// that passes at this speed, m.
    ///
    /// The speed is the planned speed, or else the largest speed that meets the target.
    at_speed: Option<[f64; 3]>,
    /// Keys about the cable that the vehicle file doesn't set.
    missing: Vec<String>,
}

impl Cable {
    /// Computes the cable's accuracy. `v_max_mps` is the largest speed that meets the target, m/s.
    ///
    /// Returns `None` for a vehicle without a cable counter or without the navigation filter.
    pub(super) fn of(
        vehicle: &VehicleConfig,
        text: &str,
        errors: Option<&ExpectedErrors>,
        v_max_mps: Option<f64>,
    ) -> Option<Self> {
        let NavigationConfig::Filter(settings) = &vehicle.navigation else { return None };
        let step_m = vehicle.counter?.step_m;
        let planned_mps = Some(vehicle.planned_speed_mps).filter(|planned| *planned > 0.0);
        let at_speed = errors.zip(planned_mps.or(v_max_mps)).map(|(errors, speed_mps)| {
            // `pass_error_m` takes the time between the two passes on either side of a hole that is as large as the
            // target.
            let sd_m = errors.pass_error_m(vehicle.target.max_hole_m / speed_mps);
            [speed_mps, sd_m, (vehicle.target.max_hole_m - vehicle.target.error_m(sd_m)).max(0.0)]
        });
        let slack = [settings.slack.reach, settings.slack.time_s];
        Some(Self { step_m, slack, at_speed, missing: missing(vehicle, text) })
    }

    /// Text about the cable's accuracy for the summary.
    pub(super) fn line(&self) -> String {
        let step = self.step_m.map_or("step size stated in each reading".to_owned(), |step_m| {
            format!("steps of {} mm", (step_m * 1e4).round() / 10.0)
        });
        let [slack_m, time_s] = self.slack;
        let mut parts = vec![format!("cable: {step}, slack of {slack_m} m (sd) in {time_s} s")];
        parts.extend(self.at_speed.map(|[speed_mps, sd_m, most_m]| {
            format!(
                "at {speed_mps:.3} m/s a hole is measured to {sd_m:.3} m (sd), so holes up to {most_m:.2} m pass"
            )
        }));
        if !self.missing.is_empty() {
            parts.push(format!("missing from the file: {}", self.missing.join(", ")));
        }
        parts.join("; ")
    }

    /// The cable's accuracy as JSON.
    pub(super) fn json(&self) -> Value {
        let [slack_m, time_s] = self.slack;
        let [speed_mps, sd_m, most_m] = [0, 1, 2].map(|k| self.at_speed.and_then(|at| at.get(k).copied()));
        json!({
            "step_m": self.step_m, "slack_sd_m": slack_m, "slack_time_s": time_s, "speed_mps": speed_mps,
            "hole_sd_m": sd_m, "passes_up_to_m": most_m, "missing": self.missing,
        })
    }
}

/// Keys about the cable that the vehicle file doesn't set. Their defaults apply.
fn missing(vehicle: &VehicleConfig, text: &str) -> Vec<String> {
    let Ok(root) = Document::new("", text).root() else { return Vec::new() };
    let slack = ["slack_sd_m", "slack_time_s"].into_iter().filter(|key| !sets_navigation(text, key));
    let mut missing: Vec<String> = slack.map(|key| format!("navigation.{key}")).collect();
    let sensors = root.sections("sensors").unwrap_or_default();
    let counter = vehicle.sensors.iter().position(|sensor| sensor.sense() == Sense::Tether);
    if let Some((number, table)) = counter.and_then(|number| Some((number, sensors.get(number)?)))
        && vehicle.counter.is_some_and(|counter| counter.step_m.is_some())
        && !table.keys().iter().any(|key| ["step_m", "preset"].contains(key))
    {
        missing.push(format!("sensors[{number}].step_m"));
    }
    missing
}

/// Whether the vehicle file's table `[navigation]` has this key.
pub(super) fn sets_navigation(text: &str, key: &str) -> bool {
    let navigation = Document::new("", text).root().and_then(|root| root.section("navigation"));
    navigation.ok().flatten().is_some_and(|section| section.keys().contains(&key))
}
