//! Results of planning with a vehicle file: the largest speed, the hours of a dive, and the wall that the
//! vehicle hides.

use headrace_sampling::SamplingError;
use headrace_sampling::head::HeadMode;
use headrace_sampling::margin::ExpectedErrors;
use headrace_sampling::plan::{Answer, HELD_SHARE, Inspection, Planner, Question, ThinStrip};
use headrace_vehicle::{Finding, Grade, VehicleConfig};
use serde_json::{Value, json};

/// Plan for the vehicle as its file describes it. The vehicle is assumed to be on the tunnel's axis.
pub(super) struct Outlook {
    /// Planner's answer for the mode to which all heads are set; `None` if their modes differ.
    own: Option<Answer>,
    /// Planner's answer for the mode with the largest speed.
    best: Option<Answer>,
    /// Largest speed, m/s, if the heads' start angles are those for the planned speed.
    ///
    /// `None` if no speed is planned, or if the heads' modes differ.
    as_started_mps: Option<f64>,
    planned_mps: f64,
    /// Strips that the vehicle hides from some heads.
    hidden: Vec<ThinStrip>,
    /// Ids of the heads.
    heads: Vec<String>,
    perimeter_m: f64,
    length_m: f64,
}

/// Relative difference below which two speeds are reported as one. It equals the margin that the advice keeps
/// for errors of the measured speed.
const TOLD_APART: f64 = 0.02;
/// Relative difference below which two turn periods count as equal.
const SAME: f64 = 1e-6;

impl Outlook {
    /// Plans for the vehicle's heads, with the expected position errors between passes.
    ///
    /// `None` without heads.
    ///
    /// Errors: the heads can't be planned for.
    pub(super) fn of(
        vehicle: &VehicleConfig,
        errors: Option<ExpectedErrors>,
    ) -> Result<Option<Self>, SamplingError> {
        let sensors = vehicle.sensors.iter().zip(&vehicle.sensor_configs);
        let (mut heads, mut ids) = (Vec::new(), Vec::new());
        for (sensor, config) in sensors {
            let Some(spec) = sensor.head() else { continue };
            // Each head is planned with all of its modes, at its configured range setting.
            heads.push((spec, sensor.modes(None).unwrap_or_default()));
            ids.push(config.id.clone());
        }
        if heads.is_empty() {
            return Ok(None);
        }
        let own = own_mode(&heads);
        let planner = Planner::new(Inspection {
            profile: vehicle.tunnel.profile.clone(),
            length_m: vehicle.tunnel.length_m,
            place: vehicle.tunnel.profile.reference(),
            heads,
            hull: vehicle.hull.clone(),
            layout: vehicle.layout,
            drift_m: 0.0,
            yaw_rad: 0.0,
            yaw_rate_radps: 0.0,
            sound_speed_mps: vehicle.site.sound_speed_mps,
        })?
        .with_errors(errors);
        let question = Question { target_m: Some(vehicle.target.max_hole_m), speed_mps: None, time_s: None };
        let answers = planner.answers(&question, None)?;
        let mode = planner.modes().iter().position(|planned| Some(planned.mode.name) == own);
        let briefing = planner.briefing(mode.unwrap_or(0), ANY_SPEED_MPS)?;
        let planned_mps = vehicle.planned_speed_mps;
        let as_started_mps = mode
            .filter(|_| planned_mps > 0.0)
            .and_then(|mode| planner.as_started_mps(mode, vehicle.target.max_hole_m, planned_mps).ok());
        let best = answers.iter().find(|answer| answer.best && answer.v_max_mps.is_some()).cloned();
        Ok(Some(Self {
            own: answers.into_iter().find(|answer| Some(answer.mode) == own),
            best,
            as_started_mps,
            planned_mps,
            hidden: briefing.strips,
            heads: ids,
            perimeter_m: vehicle.tunnel.profile.perimeter_m(),
            length_m: vehicle.tunnel.length_m,
        }))
    }

    /// Largest speed in the mode to which all heads are set, m/s.
    pub(super) fn v_max_mps(&self) -> Option<f64> {
        self.own.as_ref().and_then(|own| own.v_max_mps)
    }

    /// The mode with the largest speed, and this speed less a margin for heads out of phase, m/s.
    pub(super) fn best_mode(&self) -> Option<(&'static str, f64)> {
        planned(self.best.as_ref()?)
    }

    /// The mode to which all heads are set, and its largest speed less the same margin, m/s.
    pub(super) fn own_mode(&self) -> Option<(&'static str, f64)> {
        planned(self.own.as_ref()?)
    }

    /// Problems that the plan reveals.
    pub(super) fn findings(&self, vehicle: &VehicleConfig) -> Vec<Finding> {
        let warning = |key: &str, problem| Finding { grade: Grade::Warning, key: key.to_owned(), problem };
        let mut found = Vec::new();
        if let Some(Answer { mode, refused: Some(why), .. }) = &self.own {
            found.push(warning("target_m", format!("can't be met in {mode} at any speed: {why}")));
        }
        let planned_mps = vehicle.planned_speed_mps;
        let v_max_mps = self.v_max_mps();
        if let Some(v_max_mps) = v_max_mps.filter(|v_max_mps| planned_mps > *v_max_mps) {
            let problem =
                format!("is {planned_mps}, faster than the target allows; the limit is {v_max_mps:.3} m/s");
            found.push(warning("heads.planned_speed_mps", problem));
        } else if let (Some(v_max_mps), Some(started_mps)) = (v_max_mps, self.as_started_mps)
            && started_mps < planned_mps
        {
            let problem = format!(
                "is {planned_mps}, which leaves no margin: with the heads started for it the limit is {:.3} m/s; {:.3} leaves a margin",
                down(started_mps),
                down(HELD_SHARE * v_max_mps)
            );
            found.push(warning("heads.planned_speed_mps", problem));
        }
        found
    }

    /// Text about the plan for the summary.
    pub(super) fn lines(&self) -> Vec<String> {
        let speed = |answer: &Answer| match (answer.v_max_mps, answer.needed_h, &answer.refused) {
            (Some(v_max_mps), Some(hours), _) => {
                format!("at most {:.3} m/s, {hours:.1} h for {} m one way", down(v_max_mps), self.length_m)
            }
            (_, _, Some(why)) => format!("no speed: {why}"),
            _ => "no speed".to_owned(),
        };
        let mut lines = Vec::new();
        match &self.own {
            Some(own) => lines.push(format!("plan in {}: {}", own.mode, speed(own))),
            None => lines.push("plan: the heads are in different modes".to_owned()),
        }
        let v_max_mps = self.v_max_mps();
        if let (Some(v_max_mps), Some(started_mps)) = (v_max_mps, self.as_started_mps)
            && (started_mps / v_max_mps - 1.0).abs() > TOLD_APART
        {
            let hours = if started_mps > 0.0 { self.length_m / started_mps / 3600.0 } else { f64::INFINITY };
            lines.push(format!(
                "     with heads started for the planned {} m/s: at most {:.3} m/s, {hours:.1} h",
                self.planned_mps,
                down(started_mps)
            ));
        }
        let is_own = |best: &&Answer| self.own.as_ref().is_some_and(|own| own.mode == best.mode);
        if let Some(best) = self.best.as_ref().filter(|best| !is_own(best)) {
            lines.push(format!("     in {}: {}", best.mode, speed(best)));
        }
        lines.push(self.hidden_line());
        lines
    }

    /// Text about the wall that the vehicle hides from some or all heads.
    fn hidden_line(&self) -> String {
        if self.hidden.is_empty() {
            return "every head sees all of the wall".to_owned();
        }
        let width = |unseen: bool| -> f64 {
            let strips = self.hidden.iter().filter(|strip| strip.seen_by.is_empty() == unseen);
            strips.map(|strip| strip.width_m).sum()
        };
        let clocks = |unseen: bool| {
            let strips = self.hidden.iter().filter(|strip| strip.seen_by.is_empty() == unseen);
            let mut clocks: Vec<&str> = strips.map(|strip| strip.clock.as_str()).collect();
            clocks.dedup();
            clocks.join(", ")
        };
        let part = |unseen: bool| {
            let (width_m, share) = (width(unseen), 100.0 * width(unseen) / self.perimeter_m);
            format!("{share:.0} % of the wall ({width_m:.2} m) at {}", clocks(unseen))
        };
        match (width(false) > 0.0, width(true) > 0.0) {
            (true, true) => {
                format!("hidden by the vehicle from ALL heads {}; from some {}", part(true), part(false))
            }
            (false, true) => format!("hidden by the vehicle from ALL heads {}", part(true)),
            _ => format!("hidden by the vehicle from some heads {}", part(false)),
        }
    }

    /// The plan as JSON.
    pub(super) fn json(&self) -> Value {
        let answer = |answer: &Answer| {
            json!({
                "mode": answer.mode, "v_max_mps": answer.v_max_mps, "needed_h": answer.needed_h,
                "refused": answer.refused,
            })
        };
        let strip = |strip: &ThinStrip| {
            let seen_by: Vec<&str> =
                strip.seen_by.iter().filter_map(|head| self.heads.get(*head)).map(String::as_str).collect();
            json!({
                "clock": strip.clock, "width_m": strip.width_m, "share": strip.width_m / self.perimeter_m,
                "seen_by": seen_by,
            })
        };
        json!({
            "own": self.own.as_ref().map(answer), "as_started_v_max_mps": self.as_started_mps, "fastest": self.best.as_ref().map(answer),
            "hidden": self.hidden.iter().map(strip).collect::<Vec<_>>(),
        })
    }
}

/// Mode of an answer, and its largest speed less a margin, m/s.
fn planned(answer: &Answer) -> Option<(&'static str, f64)> {
    Some((answer.mode, down(HELD_SHARE * answer.v_max_mps?)))
}

/// Arbitrary speed for results that don't depend on the speed, m/s.
const ANY_SPEED_MPS: f64 = 0.1;

/// A speed rounded down to 1 mm/s. The printed speed thus meets the target, too.
fn down(speed_mps: f64) -> f64 {
    (speed_mps * 1000.0 + 1e-6).floor() / 1000.0
}

/// Mode that all heads have, if there is one.
fn own_mode(heads: &[(headrace_sampling::head::HeadSpec, Vec<HeadMode>)]) -> Option<&'static str> {
    let same = |a: f64, b: f64| (a / b - 1.0).abs() < SAME;
    let modes = heads.iter().map(|(spec, modes)| {
        let is_it = |mode: &&HeadMode| {
            same(mode.turn.step_rad(), spec.step_rad) && same(mode.turn.ping_period_s(), spec.ping_period_s)
        };
        modes.iter().find(is_it).map(|mode| mode.name)
    });
    let names: Option<Vec<&'static str>> = modes.collect();
    let names = names?;
    let first = *names.first()?;
    names.iter().all(|name| *name == first).then_some(first)
}
