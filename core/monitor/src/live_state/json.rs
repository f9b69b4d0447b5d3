//! The live state as JSON. It has plain values with units in their names. Ages are measured up to the tick,
//! and stale data is marked.
//!
//! `docs/reference/live-state.schema.json` is the schema. Allocates: outlets' threads only, never the loop's.

use serde::Serialize;

use super::condition::Lamp;
use super::state::{LIVE_STATE_VERSION, LiveState, PositionState, SensorState};
use super::texts::SpeedTexts;
use crate::alert_list::AlertList;
use crate::alert_list::TextContext;
use crate::alert_list::{AlertCountsJson, LeftJson, ListedAlertJson};
use crate::dive_plan::route::{DivePlan, DiveStep, Roll, StepKind};
use crate::dive_plan::texts::{fits_text, step_text};
use crate::pilot_text::{gain_text, station};
use headrace_coverage::Metres;
use headrace_geometry::time::DurNs;

/// The live state as JSON. The field names are a contract.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LiveStateJson {
    /// Version of this schema.
    pub version: u32,
    /// Dive time of publication, seconds.
    pub now_s: f64,
    /// Dive time of the advice update that made the state, seconds; `None` before the first update.
    pub at_s: Option<f64>,
    /// Age of the state at publication, seconds.
    pub age_s: Option<f64>,
    /// Whether the state is to be shown as stale.
    pub old: bool,
    /// Present condition of the dive, as a word.
    pub condition: &'static str,
    /// Colour of the condition.
    pub lamp: Lamp,
    /// Position of the vehicle, with its state.
    pub position: PositionJson,
    /// Speed of the vehicle along the tunnel, positive inwards, m/s; `None` without a position.
    pub speed_mps: Option<f64>,
    /// Largest speed that meets the target, m/s; `None` if there is none.
    pub v_max_mps: Option<f64>,
    /// Texts of the speed, its limit and their difference, the same on all screens.
    pub speeds: SpeedTexts,
    /// Text about missed stretches, the same on all screens; `None` if there are none.
    pub outstanding: Option<String>,
    /// Plan for the rest of the dive; `None` without a position or without missed stretches.
    pub plan: Option<PlanJson>,
    /// Reason that limits the speed; `None` before the first advice.
    pub reason: Option<&'static str>,
    /// Margins of speed and turn, the part of the target that position errors use up, and the share of lost
    /// returns.
    pub margins: MarginsJson,
    /// Forecast of the present turn.
    pub turn: Option<TurnJson>,
    /// Every sensor, in the order of the vehicle file.
    pub sensors: Vec<SensorJson>,
    /// Length of each verdict within the coverage extent, and the sum `way_m` of these lengths.
    pub metres: MetresJson,
    /// Last judged stretch without a verdict.
    pub cannot_say: Option<StretchJson>,
    /// Counts of the alerts that have not ended.
    pub alert_counts: AlertCountsJson,
    /// Text of what would allow a higher speed; `None` if there is nothing.
    pub remedy: Option<String>,
    /// Remaining cable, time and charge. An unknown amount is `None`.
    pub left: LeftJson,
    /// Alerts, most urgent first, at most 64. A few ended alerts come last.
    pub alert_list: Vec<ListedAlertJson>,
    /// Number of live alerts that have no room in `alert_list`.
    pub alerts_hidden: usize,
}

/// Plan for the rest of the dive.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PlanJson {
    /// The next steps, at most three.
    pub steps: Vec<PlanStepJson>,
    /// Number of all steps.
    pub step_count: u16,
    /// Text about the time that the plan takes, the same on all screens.
    pub fits: String,
    /// Whether all missed stretches and the tunnel ahead fit into the remaining time.
    pub all_fits: bool,
    /// Time to the end of the dive at the portal, seconds.
    pub takes_s: f64,
    /// Missed length for which the remaining time is too short, m.
    pub stays_missed_m: f64,
    /// Length of tunnel ahead for which the remaining time is too short, m.
    pub stays_ahead_m: f64,
}

/// Step of a plan.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PlanStepJson {
    /// Kind of the step: `go`, `inspect`, `go_on` or `home`.
    pub kind: StepKind,
    /// Instruction, the same on all screens.
    pub text: String,
    /// Chainage at which the step begins, m.
    pub from_m: f64,
    /// Chainage at which the step ends, m.
    pub to_m: f64,
    /// Largest speed, m/s; `None` for any speed, for the tunnel ahead, where the displayed limit applies, or if no speed
    /// is known to meet the target.
    pub at_most_mps: Option<f64>,
    /// Roll of the vehicle: `level`, `left` or `right`.
    pub roll: Roll,
    /// Number of the missed stretch; `None` for other steps.
    pub run: Option<u32>,
    /// Time from now to the end of the step, seconds.
    pub ends_s: f64,
}

impl PlanJson {
    fn of(plan: &DivePlan, around: &TextContext<'_>) -> Self {
        let step = |step: &DiveStep| PlanStepJson {
            kind: step.kind,
            text: step_text(step, around.heads),
            from_m: step.from_m,
            to_m: step.to_m,
            at_most_mps: step.at_most_mps.filter(|_| step.kind != StepKind::GoOn),
            roll: step.roll,
            run: step.run.map(|run| run.0),
            ends_s: step.ends_s,
        };
        Self {
            steps: plan.steps.iter().flatten().map(step).collect(),
            step_count: plan.step_count,
            fits: fits_text(plan),
            all_fits: plan.all_fits(),
            takes_s: plan.takes_s,
            stays_missed_m: plan.stays_missed_m,
            stays_ahead_m: plan.stays_ahead_m,
        }
    }
}

/// Position of the vehicle.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PositionJson {
    /// State of the position: `ok`, `doubtful` or `none`.
    pub state: &'static str,
    /// Reason for which the position is doubtful or missing.
    ///
    /// A doubtful position has `cable` or `spread`. A missing one has `no_heading`, `no_chainage` or
    /// `no_place_in_section`.
    pub why: Option<&'static str>,
    /// Chainage of the vehicle, m.
    pub chainage_m: Option<f64>,
    /// Chainage of the vehicle as stationing, such as 1+240.50.
    pub station: Option<String>,
    /// Standard deviation of the chainage, m.
    pub chainage_sd_m: Option<f64>,
    /// Standard deviation of the vehicle's place in the cross-section, m.
    pub place_sd_m: Option<f64>,
    /// Standard deviation of the vehicle's yaw, degrees.
    pub yaw_sd_deg: Option<f64>,
    /// Standard deviation of the position at one pass of a head relative to the next pass, m; `None` without
    /// a position.
    pub pass_sd_m: Option<f64>,
    /// Time for which the vehicle should stay stationary to find the gyros' bias, s; 0 if that isn't needed.
    pub stand_s: u32,
}

/// Margins of speed and turn, the part of the target that position errors use up, and the share of lost
/// returns.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct MarginsJson {
    /// v_max minus the present speed, m/s; negative if the speed is too fast.
    pub speed_mps: Option<f64>,
    /// Target minus the spacing T that is forecast for the present turn, m; negative if the turn fails.
    pub turn_m: Option<f64>,
    /// Part of the target used up by position errors, m.
    ///
    /// It is the confidence times the standard deviation of the position at one pass relative to the next
    /// pass.
    pub position_m: Option<f64>,
    /// Share of lost returns; `None` unless lost returns limit the speed.
    pub lost_share: Option<f64>,
}

/// Forecast of the present turn at the present speed.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct TurnJson {
    /// Coverage target T, m.
    pub target_m: f64,
    /// Forecast spacing T, m; `None` if it is unbounded.
    pub predicted_t_m: Option<f64>,
    /// Whether the forecast spacing T will exceed the target.
    pub will_exceed: bool,
    /// Largest step along the wall, m.
    pub t_y_m: f64,
    /// Longest time between two passes, seconds.
    pub pass_gap_s: f64,
    /// Phase error of the heads, degrees.
    pub phase_error_deg: Option<f64>,
}

/// State of a sensor.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SensorJson {
    /// Id of the sensor.
    pub id: String,
    /// State of the sensor, as a word.
    pub state: SensorState,
    /// Age of the sensor's last reading, seconds; `None` if there is none.
    pub age_s: Option<f64>,
    /// Whether the sensor is a profiling head.
    pub is_head: bool,
    /// Number of withheld readings, with the reason; `None` unless the state is `withheld`.
    pub withheld: Option<String>,
}

/// Length of each verdict within the coverage extent, and the sum of these lengths.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct MetresJson {
    /// Length of each verdict, m.
    #[serde(flatten)]
    pub by_state: Metres,
    /// Length of the whole coverage extent, m: the sum over all verdicts.
    pub way_m: f64,
}

/// A stretch of tunnel without a verdict.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct StretchJson {
    /// Reason for the missing verdict: `not_inspected`, `position`, `several_stretches`, `doubtful_returns`,
    /// `distrusted_head`, `contradicted_profile`, `other_size` or `no_wall`.
    pub why: &'static str,
    /// Beginning of the stretch, m.
    pub from_m: f64,
    /// End of the stretch, m.
    pub to_m: f64,
}

impl LiveState {
    /// The live state as JSON, with the alerts of the same dive. See
    /// [`DiveView::live_state_json`](crate::view::DiveView::live_state_json).
    pub fn json(&self, around: &TextContext<'_>, alerts: &AlertList) -> LiveStateJson {
        let TextContext { sources, section_m, clock, .. } = *around;
        let (shown, alerts_hidden) = alerts.shown();
        let condition = self.condition();
        let advice = self.advice.as_ref();
        let name = |source: usize| sources.get(source).map(|source| source.id.clone());
        let less = |limit: Option<f64>, of: Option<f64>| limit.zip(of).map(|(limit, of)| limit - of);
        let predicted_m = advice.and_then(|advice| advice.predicted_t_m);
        let has_position = !matches!(self.position, PositionState::None(_));
        let pass_sd_m = Some(self.pass_sd_m).filter(|_| has_position);
        LiveStateJson {
            version: LIVE_STATE_VERSION,
            now_s: clock.seconds(self.now),
            at_s: self.at.map(|at| clock.seconds(at)),
            age_s: self.age().map(DurNs::as_secs_f64),
            old: self.is_old(),
            condition: condition.as_str(),
            lamp: condition.lamp(),
            position: self.position_json(pass_sd_m),
            speed_mps: self.speed_mps,
            v_max_mps: self.v_max_mps(),
            speeds: self.speed_texts(),
            outstanding: self.outstanding_text(),
            plan: self.plan.map(|plan| PlanJson::of(&plan, around)),
            reason: advice.map(|advice| advice.reason.as_str()),
            margins: MarginsJson {
                speed_mps: less(self.v_max_mps(), self.speed_mps.map(f64::abs)),
                turn_m: less(Some(self.target.max_hole_m), predicted_m),
                position_m: pass_sd_m.map(|sd_m| self.target.error_m(sd_m)),
                lost_share: self.lost_share(),
            },
            turn: advice.map(|advice| TurnJson {
                target_m: self.target.max_hole_m,
                predicted_t_m: predicted_m,
                will_exceed: advice.will_exceed,
                t_y_m: advice.t_y_m,
                pass_gap_s: advice.pass_gap_s,
                phase_error_deg: advice.phase_error_rad.map(f64::to_degrees),
            }),
            sensors: (0..usize::from(self.sources))
                .map(|source| SensorJson {
                    id: name(source).unwrap_or_default(),
                    state: self.sensor(source),
                    age_s: self.age_of(source).map(DurNs::as_secs_f64),
                    is_head: self.heads >> source & 1 == 1,
                    withheld: self.withheld_text(source),
                })
                .collect(),
            metres: MetresJson { by_state: self.metres, way_m: self.metres.way_m() },
            cannot_say: self.unsure.map(|stretch| StretchJson {
                why: stretch.why.as_str(),
                from_m: stretch.from as f64 * section_m,
                to_m: stretch.to as f64 * section_m,
            }),
            alert_counts: alerts.counts(),
            remedy: self.phase_text().or_else(|| gain_text(advice?, around.heads)),
            left: alerts.left(self),
            alert_list: shown.into_iter().map(|alert| alert.json(around, self.now)).collect(),
            alerts_hidden,
        }
    }

    fn position_json(&self, pass_sd_m: Option<f64>) -> PositionJson {
        PositionJson {
            state: self.position.as_str(),
            why: match self.position {
                PositionState::Ok => None,
                PositionState::Doubtful(doubt) => Some(doubt.as_str()),
                PositionState::None(no_fix) => Some(no_fix.as_str()),
            },
            chainage_m: self.chainage_m,
            station: self.chainage_m.map(station),
            chainage_sd_m: self.sd.map(|sd| sd.along_m),
            place_sd_m: self.sd.map(|sd| sd.place_m),
            yaw_sd_deg: self.sd.map(|sd| sd.yaw_rad.to_degrees()),
            pass_sd_m,
            stand_s: self.stand_s,
        }
    }
}
