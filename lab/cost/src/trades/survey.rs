//! Survey: the cost of a finer target in hours of diving.
//!
//! Hours and the planned spacing T come from the functions of `headrace plan`. They are shown beside the largest hole
//! of a simulated dive at the planned speed, with heads phased for that speed. A dive keeps its plan if its largest
//! hole is at most the planned T.

use headrace_sampling::layout::HeadLayout;
use headrace_sampling::plan::{Planner, Question};
use headrace_simulator::{Simulation, position_error_model};

use crate::error::CostError;
use crate::measure::side_by_side;
use crate::point::{Error, Interval, LeftOut, OracleError, Point, Trade, front};
use crate::scene::{self, Inputs};
use crate::verdicts::END_M;
use crate::words::number;
use headrace_oracle::second;
use headrace_oracle::truth::{Truth, TruthTaker};

/// Targets (largest allowed holes) for which each vehicle is planned, m.
const TARGETS_M: [f64; 8] = [0.2, 0.3, 0.4, 0.5, 0.7, 1.0, 1.4, 2.0];
const QUICK_TARGETS_M: [f64; 3] = [0.5, 0.7, 1.0];
/// Targets for which modes, drifts and layouts are compared, m.
const FEW_TARGETS_M: [f64; 4] = [0.4, 0.5, 1.0, 2.0];
const QUICK_FEW_TARGETS_M: [f64; 1] = [SHIPPED_M];
/// The shipped target, m.
const SHIPPED_M: f64 = 0.5;
/// The shipped mode of the vehicle whose modes are compared.
const SHIPPED_MODE: &str = "fast";
/// Lateral positions of the vehicle relative to the middle, left and up, as multiples of its drift.
const PLACES: [[f64; 2]; 5] = [[1.0, 1.0], [-1.0, -1.0], [1.0, -1.0], [-1.0, 1.0], [1.0, 0.0]];
/// Speed at which the vehicle returns without inspecting, m/s.
///
/// The demonstration's pilot drives at about this speed when in a hurry.
const WAY_BACK_MPS: f64 = 0.3;
/// Share of the tunnel that is assumed to be inspected a second time.
const AGAIN_SHARE: f64 = 0.1;
/// Length of the sections in which both references are compared, m. `STRETCHES` is the number of these sections.
const STRETCH_M: f64 = 0.25;
const STRETCHES: u32 = 4;
/// Smallest error claimed for the references, m. Both references are computed to this accuracy.
const LEAST_M: f64 = 1e-9;
/// Names of the compared vehicles, with their files. Modes, layouts and drifts are compared for the last vehicle in the
/// list.
const VEHICLES: [(&str, &str); 4] = [
    ("VITA 1, one head", "vita1.toml"),
    ("VITA 2, two heads", "vita2-2.toml"),
    ("VITA 2, three heads", "vita2-3.toml"),
    ("VITA 2, four heads", "vita2-4.toml"),
];

/// Name of the scene in which the vehicles are compared.
const HEADS: &str = "heads, each vehicle in its fastest mode";

/// A vehicle file with the mode, layout and drift for which it is planned.
struct Way<'a> {
    /// Name of the vehicle's line in the picture.
    method: String,
    file: &'a str,
    mode: Option<&'static str>,
    layout: HeadLayout,
    drift_m: f64,
}

/// Measures the errors and costs of all settings of this trade.
///
/// Errors: see [`CostError`].
pub fn measure(inputs: &Inputs<'_>, progress: &mut dyn FnMut(&str)) -> Result<Trade, CostError> {
    let mut survey =
        Survey { inputs, progress, points: Vec::new(), left_out: Vec::new(), oracle_m: LEAST_M, compared: 0 };
    if let Some((name, text)) = inputs.vehicle {
        survey.vehicles(&[(name, text)])?;
    } else {
        let texts = VEHICLES.map(|(name, file)| scene::file(file).map(|text| (name, text)));
        survey.vehicles(&texts.into_iter().collect::<Result<Vec<_>, _>>()?)?;
    }
    let Survey { mut points, mut left_out, oracle_m, compared, .. } = survey;
    left_out.extend(inputs.effort.pick(Some(quick_left_out()), None));
    front(&mut points, oracle_m);
    let (reasons, advice) = (reasons(&points), advice(&points));
    Ok(Trade {
        name: "survey".to_owned(),
        title: "Survey: hours for a target".to_owned(),
        question: "How many hours does a finer target cost, by number of heads, mode, head layout and drift?"
            .to_owned(),
        error_axis: "T promised, m".to_owned(),
        cost_axis: "hours: there, back and a tenth again".to_owned(),
        cost_unit: "h".to_owned(),
        cost_is_computed: true,
        decides: None,
        points,
        left_out,
        oracle: OracleError {
            how: format!(
                "on {compared} sections of the simulated dives, Voronoi vertices are compared with lower envelopes, and arc lengths of an outline with arc lengths of rays; D_true checks the \
                 promised T, because no function of the plan computes D_true"
            ),
            size: oracle_m,
        },
        reasons,
        advice,
    })
}

fn quick_left_out() -> LeftOut {
    LeftOut {
        what: format!(
            "targets but {QUICK_TARGETS_M:?} m, of modes, layouts and drifts but {QUICK_FEW_TARGETS_M:?} m; of places off the middle all but two"
        ),
        why: "`--quick`; the full measurement includes them".to_owned(),
    }
}

fn reasons(points: &[Point]) -> Vec<String> {
    let mut reasons = vec![format!(
        "The hours are for the whole tunnel: out at the largest speed of the plan, a second pass over {:.0} % of it at that speed, and back at {WAY_BACK_MPS} m/s. \
         survey.csv lists the three parts. If the vehicle is off the middle, D_true is the largest value of up to five positions.",
        100.0 * AGAIN_SHARE
    )];
    let shipped = points.iter().find(|point| point.is_default && point.scene == HEADS);
    let at_target = |point: &&Point| point.scene == HEADS && point.number == Some(SHIPPED_M);
    let best = points.iter().filter(at_target).min_by(|a, b| a.cost.middle.total_cmp(&b.cost.middle));
    let far = points
        .iter()
        .find(|point| point.method == "phase shift, 1.5 m off" && point.number == Some(SHIPPED_M));
    if let (Some(shipped), Some(best), Some(far)) = (shipped, best, far)
        && best.cost.middle < shipped.cost.middle
    {
        reasons.push(format!(
            "The shipped file uses {}, the mode of the paper's survey, because its finer step tolerates more drift. At the largest speed it \
             takes {} h (longer at the file's own `planned_speed_mps`); in the middle of the tunnel, `{}` takes {} h. At 1.5 m off the \
             middle, only `{}` keeps the target, in {} h. `headrace plan` shows what your vehicle gains by another mode.",
            SHIPPED_MODE.to_uppercase(),
            number(shipped.cost.middle),
            best.value.trim_start_matches("target "),
            number(best.cost.middle),
            far.value.trim_start_matches("target "),
            number(far.cost.middle)
        ));
    }
    reasons.extend(broken(points));
    reasons
}

/// Sentence about plans whose simulated dives have a hole larger than the planned spacing T.
fn broken(points: &[Point]) -> Option<String> {
    let is_broken = |point: &&Point| {
        point.errors.get(1).is_some_and(|error| error.unit == "m" && error.interval.middle > point.error())
    };
    let broken: Vec<String> = points
        .iter()
        .filter(is_broken)
        .map(|point| {
            let most_m = point.errors.get(1).map_or(f64::NAN, |error| error.interval.middle);
            format!("{}, {} ({} m)", point.method, point.value, number(most_m))
        })
        .collect();
    (!broken.is_empty())
        .then(|| format!("Settings whose simulated dive exceeds the promised T: {}.", broken.join("; ")))
}

struct Survey<'a> {
    inputs: &'a Inputs<'a>,
    progress: &'a mut dyn FnMut(&str),
    points: Vec<Point>,
    left_out: Vec<LeftOut>,
    oracle_m: f64,
    compared: u32,
}

impl Survey<'_> {
    fn vehicles(&mut self, vehicles: &[(&str, &str)]) -> Result<(), CostError> {
        let targets_m = self.inputs.effort.pick(QUICK_TARGETS_M.as_slice(), &TARGETS_M);
        let few_m = self.inputs.effort.pick(QUICK_FEW_TARGETS_M.as_slice(), &FEW_TARGETS_M);
        for (name, file) in vehicles {
            let way = Way {
                method: (*name).to_owned(),
                file,
                mode: None,
                layout: HeadLayout::PhaseShift,
                drift_m: 0.0,
            };
            self.way(HEADS, &way, targets_m)?;
        }
        let Some((name, file)) = vehicles.last() else { return Ok(()) };
        let shipped = Way {
            method: "as shipped".to_owned(),
            file,
            mode: Some(SHIPPED_MODE),
            layout: HeadLayout::PhaseShift,
            drift_m: 0.0,
        };
        if self.inputs.vehicle.is_none() {
            self.way(HEADS, &shipped, &[SHIPPED_M])?;
            self.way(&format!("layout and drift of {name}"), &shipped, &[SHIPPED_M])?;
        }
        for mode in self.modes(file)? {
            let layout = HeadLayout::PhaseShift;
            let way = Way { method: mode.to_owned(), file, mode: Some(mode), layout, drift_m: 0.0 };
            self.way(&format!("modes of {name}"), &way, few_m)?;
        }
        for (layout, named) in
            [(HeadLayout::PhaseShift, "phase shift"), (HeadLayout::SectorOffset, "sector offset")]
        {
            for drift_m in [0.0, 0.5, 1.5] {
                let method = format!("{named}, {drift_m} m off");
                let way = Way { method, file, mode: None, layout, drift_m };
                self.way(&format!("layout and drift of {name}"), &way, few_m)?;
            }
        }
        Ok(())
    }

    fn modes(&self, text: &str) -> Result<Vec<&'static str>, CostError> {
        let planner = planner(self.inputs, text, HeadLayout::PhaseShift, 0.0)?;
        Ok(planner.modes().iter().map(|planned| planned.mode.name).collect())
    }

    fn way(&mut self, scene: &str, way: &Way<'_>, targets_m: &[f64]) -> Result<(), CostError> {
        (self.progress)(&format!("survey: {scene}: {}", way.method));
        let planner = match planner(self.inputs, way.file, way.layout, way.drift_m) {
            Ok(planner) => planner,
            Err(why) => {
                self.left_out
                    .push(LeftOut { what: format!("{scene}, {}", way.method), why: why.to_string() });
                return Ok(());
            }
        };
        let mut planned = Vec::new();
        for target_m in targets_m {
            let question = Question { target_m: Some(*target_m), speed_mps: None, time_s: None };
            let answers = planner.answers(&question, way.mode)?;
            let answer = answers.iter().find(|answer| answer.best).or(answers.first());
            let Some(answer) = answer else { continue };
            match (answer.v_max_mps, answer.needed_h) {
                (Some(speed_mps), Some(there_h)) => {
                    let (mode, target_m) = (answer.mode, *target_m);
                    planned.push(Planned { scene, way, mode, target_m, speed_mps, there_h });
                }
                _ => self.left_out.push(LeftOut {
                    what: format!("{scene}, {}, {target_m} m", way.method),
                    why: answer.refused.clone().unwrap_or_default(),
                }),
            }
        }
        let inspection = planner.inspection();
        let holes = true_holes(self.inputs, &planned, inspection.place)?;
        for (planned, holes) in planned.iter().zip(&holes) {
            self.point(planned, holes, inspection.length_m);
        }
        Ok(())
    }

    /// Adds a point with the true holes of its dives. The tunnel is `length_m` long.
    fn point(&mut self, planned: &Planned<'_>, holes: &[TrueHole], length_m: f64) {
        let Planned { scene, way, mode, target_m, speed_mps, there_h } = *planned;
        let back_h = length_m / WAY_BACK_MPS / 3600.0;
        let again_h = AGAIN_SHARE * there_h;
        for off_m in holes.iter().filter_map(|hole| hole.may_be_off_m) {
            self.oracle_m = self.oracle_m.max(off_m);
            self.compared += STRETCHES;
        }
        let most_m = holes.iter().map(|hole| hole.hole_m).fold(0.0, f64::max);
        let mut errors = vec![Error::new("T promised", "m", Interval::exact(target_m))];
        if most_m.is_finite() {
            let least_m = holes.iter().map(|hole| hole.hole_m).fold(f64::INFINITY, f64::min);
            let interval = Interval { low: least_m, middle: most_m, high: most_m };
            errors.push(Error::new("largest D_true at that speed", "m", interval));
        } else {
            let what = format!("D_true of {scene}, {}, {target_m} m", way.method);
            self.left_out.push(LeftOut { what, why: "a place of the wall has no sample".to_owned() });
        }
        errors.push(Error::new("speed", "m/s", Interval::exact(speed_mps)));
        for (name, hours) in [("there", there_h), ("back", back_h), ("again", again_h)] {
            errors.push(Error::new(name, "h", Interval::exact(hours)));
        }
        let is_default =
            self.inputs.vehicle.is_none() && way.mode == Some(SHIPPED_MODE) && is_shipped(target_m);
        let value = if way.mode.is_some() { String::new() } else { format!(", {mode}") };
        self.points.push(Point {
            method: way.method.clone(),
            knob: "target".to_owned(),
            value: format!("{target_m} m{value}"),
            number: Some(target_m),
            is_default,
            scene: scene.to_owned(),
            seeds: u32::try_from(holes.len()).unwrap_or(u32::MAX),
            errors,
            cost: Interval::exact(there_h + back_h + again_h),
            instructions: None,
            on_front: false,
        });
    }
}

fn is_shipped(target_m: f64) -> bool {
    (target_m - SHIPPED_M).abs() < 1e-9
}

/// The plan for a target.
struct Planned<'a> {
    scene: &'a str,
    way: &'a Way<'a>,
    mode: &'static str,
    target_m: f64,
    speed_mps: f64,
    there_h: f64,
}

/// The largest hole of a dive, m, and the error of both references if they are compared.
struct TrueHole {
    hole_m: f64,
    may_be_off_m: Option<f64>,
}

/// The true holes of each plan, one per seed.
fn true_holes(
    inputs: &Inputs<'_>,
    planned: &[Planned<'_>],
    middle: [f64; 2],
) -> Result<Vec<Vec<TrueHole>>, CostError> {
    // Without random effects, a seed changes only the vehicle's offset from the middle of the tunnel.
    let seeds_of = |planned: &Planned<'_>| {
        if planned.way.drift_m > 0.0 { inputs.effort.pick(2, 5) } else { 1 }
    };
    let of_seeds = |(at, planned)| (1..=seeds_of(planned)).map(move |seed| (at, planned, seed));
    let dives: Vec<(usize, &Planned<'_>, u32)> = planned.iter().enumerate().flat_map(of_seeds).collect();
    let found = side_by_side(&dives, |(_, planned, seed)| {
        let Planned { way, mode, target_m, speed_mps, .. } = **planned;
        true_hole(inputs, &Dives { way, mode, target_m, speed_mps, middle }, *seed)
    })?;
    let mut holes: Vec<Vec<TrueHole>> = planned.iter().map(|_| Vec::new()).collect();
    for ((at, ..), hole) in dives.iter().zip(found) {
        if let Some(holes) = holes.get_mut(*at) {
            holes.push(hole);
        }
    }
    Ok(holes)
}

/// Largest true hole D_true of a dive, away from the dive's ends.
fn true_hole(inputs: &Inputs<'_>, dives: &Dives<'_>, seed: u32) -> Result<TrueHole, CostError> {
    let end_m = END_M + dives.target_m;
    let length_m = inputs.effort.length_m() + 2.0 * end_m;
    let truth = dives.truth(inputs, seed, length_m)?;
    let [from_m, to_m] = [truth.way_m[0] + end_m, truth.way_m[1] - end_m];
    let is_compared = dives.way.mode.is_some() && is_shipped(dives.target_m);
    let may_be_off_m = is_compared
        .then(|| second::may_be_off_m(&truth, [from_m, to_m], STRETCH_M, STRETCHES))
        .transpose()?;
    Ok(TrueHole { hole_m: truth.wall()?.hole_m(from_m, to_m), may_be_off_m })
}

/// The plan that `headrace plan` makes of a vehicle file with the given layout and tolerated drift.
///
/// Errors: the vehicle is invalid, or can't be planned for.
pub fn planner(
    inputs: &Inputs<'_>,
    text: &str,
    layout: HeadLayout,
    drift_m: f64,
) -> Result<Planner, CostError> {
    let vehicle = inputs.vehicle(text)?;
    let load = |_: &str| Ok(text.as_bytes().to_vec());
    let errors = position_error_model::expected_errors(&vehicle, "vehicle.toml", inputs.kinds, &load)?;
    let why = |why| CostError::Figure { what: "the modes of a vehicle's heads".to_owned(), why };
    let mut inspection = vehicle.inspection().map_err(why)?;
    (inspection.layout, inspection.drift_m) = (layout, drift_m);
    Ok(Planner::new(inspection)?.with_errors(errors))
}

/// Settings of simulated dives at the planned speed.
struct Dives<'a> {
    way: &'a Way<'a>,
    mode: &'static str,
    target_m: f64,
    speed_mps: f64,
    /// Middle of the tunnel, left and up, m.
    middle: [f64; 2],
}

impl Dives<'_> {
    fn truth(&self, inputs: &Inputs<'_>, seed: u32, length_m: f64) -> Result<Truth, CostError> {
        let Self { way, mode, target_m, speed_mps, middle } = self;
        let [left, up] = PLACES.get(usize::try_from(seed).unwrap_or(1) - 1).copied().unwrap_or_default();
        let [y_m, z_m] = middle;
        let place = [y_m + left * way.drift_m, z_m + up * way.drift_m];
        let text = format!(
            "vehicle = \"vehicle.toml\"\n[vehicle_changes]\ntarget_m = {target_m:?}\nheads.layout = {:?}\n\
             heads.planned_speed_mps = {speed_mps:?}\nsensors.all.mode = {mode:?}\n[trajectory]\nstart_m = 5\nplace_m = {place:?}\n\
             [[trajectory.legs]]\ndistance_m = {length_m:?}\nspeed_mps = {speed_mps:?}\n\
             [effects]\nmotion_within_turn = {{}}\nocclusion = {{}}\n",
            way.layout.as_str()
        );
        let scene = inputs.scene_of(&text, way.file, seed)?;
        let mut simulation = Simulation::with_truth(&scene)?;
        let mut taker = TruthTaker::new(&scene, &simulation, &scene.vehicle.tunnel.profile);
        while simulation.advance() {
            taker.note(&mut simulation);
        }
        taker.note(&mut simulation);
        Ok(taker.truth())
    }
}

/// Advice, derived from the hours of the points.
fn advice(points: &[Point]) -> String {
    let hours = |method: &str, target_m: f64| {
        let is = |point: &&Point| {
            point.method.ends_with(method)
                && point.number.is_some_and(|number| (number - target_m).abs() < 1e-9)
        };
        points.iter().find(is).map(|point| point.cost.middle)
    };
    let mut said = Vec::new();
    if let (Some(two_h), Some(four_h)) = (hours("two heads", 0.5), hours("four heads", 0.5)) {
        said.push(format!("At a target of 0.5 m, four heads save {} h over two.", number(two_h - four_h)));
    }
    if let (Some(coarse_h), Some(fine_h)) = (hours("four heads", 0.5), hours("four heads", 0.4)) {
        said.push(format!(
            "With four heads, a target of 0.4 m instead of 0.5 m costs {} h more; a target of 1 m saves {} h.",
            number(fine_h - coarse_h),
            number(coarse_h - hours("four heads", 1.0).unwrap_or(coarse_h))
        ));
    }
    if said.is_empty() {
        let mut of_targets: Vec<&Point> = points.iter().filter(|point| point.on_front).collect();
        of_targets.sort_by(|a, b| a.error().total_cmp(&b.error()));
        if let [finest, .., coarsest] = of_targets.as_slice() {
            said.push(format!(
                "A target of {} m instead of {} m costs {} h more.",
                number(finest.error()),
                number(coarsest.error()),
                number(finest.cost.middle - coarsest.cost.middle)
            ));
        }
    }
    said.join(" ")
}
