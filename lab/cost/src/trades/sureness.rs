//! The trade "sureness": hours of diving that a higher confidence in the verdicts costs.
//!
//! The hours depend on the standard deviation of the displacement between passes, and on the required confidence.

use headrace_sampling::layout::HeadLayout;
use headrace_sampling::margin::ExpectedErrors;
use headrace_sampling::plan::Planner;

use super::navigation::field_of_four;
use super::survey::planner;
use crate::error::CostError;
use crate::measure::side_by_side;
use crate::point::{Error, Interval, LeftOut, OracleError, Point, Trade, front};
use crate::scene::{Inputs, file};
use crate::verdicts::{self, Judged, inner};
use crate::words::number;
use headrace_oracle::dive::Recorded;

const VEHICLE: &str = "vita2-4.toml";
/// Mode of the heads for which the plans are made.
const MODE: &str = "fast";
/// Target for which the plans are made, m.
const TARGET_M: f64 = 0.5;
/// Length of the tunnel, m.
const LENGTH_M: f64 = 7000.0;
/// Standard deviations of the displacement between passes, m.
const SIGMAS_M: [f64; 7] = [0.002, 0.005, 0.01, 0.02, 0.03, 0.04, 0.06];
/// Compared confidences. A confidence is the required difference between hole and target for a verdict, in standard
/// deviations.
const CONFIDENCES: [u32; 3] = [1, 2, 3];
const USUAL: u32 = 2;
/// Ratio of the speed in the second half of a dive to the planned speed. It makes some sections fail.
const HURRY: f64 = 1.2;
/// Range of times between two passes for which the standard deviation is stated, s. The range covers all passes.
const TIMES_S: [f64; 2] = [0.001, 1000.0];

/// Measures the errors and costs of all settings of this trade.
///
/// Errors: see [`CostError`].
pub fn measure(inputs: &Inputs<'_>, progress: &mut dyn FnMut(&str)) -> Result<Trade, CostError> {
    let planner = planner(inputs, file(VEHICLE)?, HeadLayout::PhaseShift, 0.0)?;
    let mode = planner.modes().iter().position(|planned| planned.mode.name == MODE);
    let mode = mode.ok_or_else(|| CostError::Figure {
        what: format!("the mode {MODE:?} of {VEHICLE}"),
        why: "its heads have none of that name".to_owned(),
    })?;
    let calm_m = planner.margins(mode, TARGET_M)?.pass_error_m;
    let mut points = Vec::new();
    for confidence in CONFIDENCES {
        for sigma_m in SIGMAS_M {
            points.push(point(&planner, mode, confidence, sigma_m, Vec::new())?);
        }
        progress(&format!("sureness: dives at the speed for {confidence} sigma"));
        let speed_mps = speed_mps(&planner, mode, confidence, calm_m)?;
        let dived = dived(inputs, confidence, speed_mps)?;
        let at_calm = point(&planner, mode, confidence, calm_m, dived)?;
        points.push(Point {
            is_default: confidence == USUAL,
            seeds: inputs.effort.seeds(),
            value: format!("{calm_m:.4} m (a calm dive)"),
            ..at_calm
        });
    }
    front(&mut points, 0.0);
    let (reasons, advice) = (reasons(&points), advice(&points, calm_m));
    Ok(Trade {
        name: "sureness".to_owned(),
        title: "Confidence and position error".to_owned(),
        question: "What do more confidence and a less certain position cost in hours?".to_owned(),
        error_axis: "sigma of the displacement between passes, m".to_owned(),
        cost_axis: "hours for 7 km".to_owned(),
        cost_unit: "h".to_owned(),
        cost_is_computed: true,
        decides: Some(0.1 * TARGET_M),
        points,
        left_out: left_out(inputs),
        oracle: OracleError {
            how: "sigma is an input, not a measurement; the hours come from the plan; D_true checks the verdicts of the dives".to_owned(),
            size: 0.0,
        },
        reasons,
        advice,
    })
}

fn left_out(inputs: &Inputs<'_>) -> Vec<LeftOut> {
    let mut left_out = vec![LeftOut {
        what: "other modes and targets".to_owned(),
        why: format!(
            "all hours are one way, for the shipped file: VITA 2 with four heads, mode {MODE}, target {TARGET_M} m; the part Survey has other modes and targets"
        ),
    }];
    left_out.extend(inputs.effort.pick(
        Some(LeftOut {
            what: "four of five seeds, and half of the dives' length".to_owned(),
            why: "`--quick`; the full measurement includes them".to_owned(),
        }),
        None,
    ));
    left_out
}

/// The largest speed at which sections still pass, m/s.
fn speed_mps(planner: &Planner, mode: usize, confidence: u32, sigma_m: f64) -> Result<f64, CostError> {
    let by_time = TIMES_S.map(|time_s| [time_s, sigma_m]).to_vec();
    let errors = ExpectedErrors { confidence_sd: f64::from(confidence), by_time };
    Ok(planner.clone().with_errors(Some(errors)).v_max_mps(mode, TARGET_M)?)
}

fn point(
    planner: &Planner,
    mode: usize,
    confidence: u32,
    sigma_m: f64,
    dived: Vec<Error>,
) -> Result<Point, CostError> {
    let speed_mps = speed_mps(planner, mode, confidence, sigma_m)?;
    let own = [
        Error::new("sigma of the displacement", "m", Interval::exact(sigma_m)),
        Error::new("largest speed", "m/s", Interval::exact(speed_mps)),
    ];
    Ok(Point {
        method: format!("{confidence} sigma"),
        knob: "sigma of the displacement between passes".to_owned(),
        value: format!("{sigma_m} m"),
        number: Some(sigma_m),
        is_default: false,
        scene: "VITA 2, four heads, FAST, 0.5 m".to_owned(),
        seeds: 0,
        errors: own.into_iter().chain(dived).collect(),
        cost: Interval::exact(LENGTH_M / speed_mps / 3600.0),
        instructions: None,
        on_front: false,
    })
}

/// Errors of verdicts that require `confidence` standard deviations, in simulated dives with field effects. The vehicle
/// drives the first half of a dive at `speed_mps`, and the second half faster.
fn dived(inputs: &Inputs<'_>, confidence: u32, speed_mps: f64) -> Result<Vec<Error>, CostError> {
    let half_m = inputs.effort.pick(8.0, 15.0);
    let legs = [(half_m, speed_mps), (half_m, HURRY * speed_mps)];
    // Head phases are computed for a speed rounded to a millimetre per second.
    let changes = format!("[vehicle_changes]\nheads.planned_speed_mps = {speed_mps:.3}\n");
    let text = field_of_four(16, &legs)?.replace("[trajectory]", &format!("{changes}[trajectory]"));
    let seeds: Vec<u32> = (1..=inputs.effort.seeds()).collect();
    let dives = side_by_side(&seeds, |seed| {
        let mut scene = inputs.scene(&text, *seed)?;
        scene.vehicle.target.confidence_sd = f64::from(confidence);
        let dive = Recorded::of(&scene, &scene.vehicle)?.judged(&scene.vehicle)?;
        Ok(inner(&dive).map(Judged::of).collect::<Vec<_>>())
    })?;
    Ok(verdicts::errors(&dives, TARGET_M))
}

/// Reasons for requiring two standard deviations, although one is cheaper.
fn reasons(points: &[Point]) -> Vec<String> {
    let passed = |confidence: u32| {
        let is = |point: &&Point| point.method == format!("{confidence} sigma");
        let mut errors = points.iter().filter(is).flat_map(|point| &point.errors);
        errors.find(|error| error.name.starts_with("passed of those over")).map(|error| error.interval)
    };
    let (Some(one), Some(usual)) = (passed(1), passed(USUAL)) else { return Vec::new() };
    vec![format!(
        "Two standard deviations are the default although one is cheaper. Of the sections over the target, {} % pass with one (worst dive \
         {} %) and {} % with two (worst dive {} %). At most 2.5 % may pass.",
        number(one.middle),
        number(one.high),
        number(usual.middle),
        number(usual.high)
    )]
}

fn advice(points: &[Point], calm_m: f64) -> String {
    let hours = |confidence: u32, sigma_m: f64| {
        let same = |point: &&Point| {
            point.method == format!("{confidence} sigma")
                && point.number.is_some_and(|number| number.to_bits() == sigma_m.to_bits())
        };
        points.iter().find(same).map_or(f64::NAN, |point| point.cost.middle)
    };
    let [fine_m, coarse_m] = [0.01, 0.02];
    format!(
        "In a calm dive (displacement between passes known to {calm_m:.4} m), a confidence of two standard deviations instead of one costs \
         {:.1} h over 7 km one way, and three cost {:.1} h more. With two, a displacement known to {fine_m} m instead of {coarse_m} m saves {:.1} h.",
        hours(2, calm_m) - hours(1, calm_m),
        hours(3, calm_m) - hours(2, calm_m),
        hours(2, coarse_m) - hours(2, fine_m),
    )
}
