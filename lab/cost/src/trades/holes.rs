//! Holes: the cost of finding the largest hole of a section exactly.
//!
//! The exact search is compared with a search with tolerances, with the spacing T of the sample lattice, and with
//! counts of empty cells.

use headrace_coverage::HoleFinder;
use headrace_monitor::run::Loop;
use headrace_sampling::plan::{PlannedMode, Planner};
use headrace_simulator::Scene;
use headrace_vehicle::VehicleConfig;

use super::cells;
use crate::effort::Effort;
use crate::error::CostError;
use crate::measure::{in_turns, side_by_side};
use crate::point::{Error, Interval, LeftOut, OracleError, Point, Trade, front};
use crate::scene::{self, Inputs};
use crate::verdicts::{self, END_M, Judged};
use crate::words::number;
use headrace_oracle::dive::{JudgedDive, JudgedSection, Recorded};
use headrace_oracle::second;
use headrace_oracle::timed;

/// Tolerances of the hole search, which the trade compares, m. The value 0.01 is a fiftieth of the target.
const TOLERANCES_M: [f64; 6] = [1e-4, 1e-3, 0.01, 0.05, 0.2, 1.0];
const QUICK_TOLERANCES_M: [f64; 2] = [0.05, 0.2];
/// Edge lengths of the grid cells for the cell-counting method, m.
const CELLS_M: [f64; 3] = [0.5, 0.1, 0.02];
const QUICK_CELLS_M: [f64; 1] = [0.1];
/// Section lengths compared with the default length, m.
const SECTIONS_M: [f64; 2] = [0.05, 1.0];
const QUICK_SECTIONS_M: [f64; 1] = [1.0];
/// Length of the evaluated part of a dive, without its ends, m: in a quick and in a full measurement.
const JUDGED_M: [f64; 2] = [4.0, 16.0];
/// Length of tunnel beyond the end of a dive, m. A shorter tunnel keeps grids of fine cells small.
const BEYOND_M: f64 = 30.0;
const STRETCHES: u32 = 4;
const NS: f64 = 1e9;
/// Speed of all scenes, m/s.
const SPEED_MPS: f64 = 0.1;

/// Target of all scenes, m. An error of `DECIDES_M` can change a decision; an error of `NOTHING_M` counts as no
/// difference.
const TARGET_M: f64 = 0.5;
const DECIDES_M: f64 = TARGET_M / 10.0;
const NOTHING_M: f64 = DECIDES_M / 10.0;

/// A method of finding the size of holes.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Setting {
    Exact,
    Tolerance(f64),
    Section(f64),
    /// Largest spacing T_max at the driven speed, by Eq. 16 of Jorge et al. 2021.
    Planned,
    /// The largest diagonal of the sample lattice in a section.
    Lattice,
    Cells(f64),
}

/// A scene whose dives are simulated and measured.
struct Case {
    name: &'static str,
    /// Text of the scene. The length of its only leg is a placeholder.
    text: String,
}

/// Simulated field effects, for a vehicle with four heads.
///
/// The shipped field scene of VITA 1 has the same effects with one head. Here the pilot sways less, because with that
/// scene's sway every section misses the target of half a metre.
const FIELD: &str = "motion_within_turn = {}\nocclusion = {}\n\
    pilot_drift = { across_m = 0.3, up_m = 0.2, yaw_deg = 2, period_s = 40 }\n\
    imu_noise = { gyro_degps_rthz = 0.007, accel_mps2_rthz = 0.001, attitude_deg = 0.3 }\n\
    imu_bias = { gyro_degps = 0.2, accel_mps2 = 0.02, tau_s = 300 }\n\
    tether_quantum = { quantum_m = 0.01 }\ntether_slack = { reach_m = 0.15, period_s = 30 }\nbeam_cone = {}\n\
    missing_returns = { share = 0.02 }\nrange_noise = { sd_m = 0.01 }\n";

fn cases() -> Result<[Case; 3], CostError> {
    let own = |changes: &str, effects: &str| {
        format!(
            "vehicle = \"vita2-4.toml\"\n{changes}[trajectory]\nstart_m = 5\n[[trajectory.legs]]\ndistance_m = LENGTH\n\
             speed_mps = {SPEED_MPS}\n[effects]\n{effects}"
        )
    };
    let drop_outs = scene::file("drop-outs.toml")?.replace("distance_m = 40", "distance_m = LENGTH");
    Ok([
        Case { name: "ideal", text: own("", "motion_within_turn = {}\nocclusion = {}\n") },
        Case { name: "drop-outs", text: drop_outs },
        // In this scene the cable hangs, and the vehicle file must state its slack.
        Case { name: "field", text: own("[vehicle_changes]\nnavigation.slack_sd_m = 0.06\n", FIELD) },
    ])
}

/// Measures the errors and costs of all settings of this trade.
///
/// Errors: see [`CostError`].
pub fn measure(inputs: &Inputs<'_>, progress: &mut dyn FnMut(&str)) -> Result<Trade, CostError> {
    let settings = settings(inputs.effort);
    let (mut prepared, mut oracle_m) = (Vec::new(), 0.0_f64);
    for case in cases()? {
        progress(&format!("holes: {}", case.name));
        let dives = Dives::of(inputs, &case)?;
        oracle_m = oracle_m.max(dives.oracle_m()?);
        prepared.push(dives.prepared(case.name, &settings)?);
    }
    progress("holes: costs");
    let mut points = points(inputs, &settings, prepared)?;
    front(&mut points, oracle_m.max(NOTHING_M));
    let (reasons, advice) = (reasons(&points), advice(&points));
    Ok(Trade {
        name: "holes".to_owned(),
        title: "Holes: the price of an exact search".to_owned(),
        question: "What does it cost to find the largest hole of a section exactly (VITA 2, four heads, target 0.5 m)?"
            .to_owned(),
        error_axis: "|D - D_true| of sections, 95th percentile, m".to_owned(),
        cost_axis: "CPU time of a replay, ns a return".to_owned(),
        cost_unit: "ns a return".to_owned(),
        cost_is_computed: false,
        decides: Some(DECIDES_M),
        points,
        left_out: left_out(inputs),
        oracle: OracleError {
            how: "on sections of each scene, Voronoi vertices are compared with lower envelopes, and arc lengths of an outline with arc lengths of rays"
                .to_owned(),
            size: oracle_m,
        },
        reasons,
        advice,
    })
}

fn left_out(inputs: &Inputs<'_>) -> Vec<LeftOut> {
    let quick = LeftOut {
        what: "tolerances of 1e-4, 1e-3, 0.01 and 1 m, cells of 0.5 and 0.02 m, sections of 0.05 m, four seeds of five and 12 m of 16".to_owned(),
        why: "`--quick`; the full measurement includes them".to_owned(),
    };
    inputs.effort.pick(Some(quick), None).into_iter().collect()
}

/// The dives of a scene, one per seed.
struct Dives(Vec<(Scene, Recorded)>);

impl Dives {
    fn of(inputs: &Inputs<'_>, case: &Case) -> Result<Self, CostError> {
        let judged_m = inputs.effort.pick(JUDGED_M[0], JUDGED_M[1]);
        let length_m = 2.0 * (END_M + TARGET_M) + judged_m;
        let text = case.text.replace("LENGTH", &format!("{length_m:?}"));
        let seeds: Vec<u32> = (1..=inputs.effort.seeds()).collect();
        let dives = side_by_side(&seeds, |seed| {
            let mut scene = inputs.scene(&text, *seed)?;
            scene.vehicle.tunnel.length_m = 5.0 + length_m + BEYOND_M;
            let recorded = Recorded::of(&scene, &scene.vehicle)?;
            Ok((scene, recorded))
        })?;
        Ok(Self(dives))
    }

    fn oracle_m(&self) -> Result<f64, CostError> {
        let Some((scene, recorded)) = self.0.first() else { return Ok(0.0) };
        let end_m = END_M + scene.vehicle.target.max_hole_m;
        let [from_m, to_m] = recorded.truth.way_m;
        let off_m = second::may_be_off_m(
            &recorded.truth,
            [from_m + end_m, to_m - end_m],
            scene.vehicle.section_m,
            STRETCHES,
        )?;
        Ok(off_m)
    }

    /// Judges the sections with each setting; keeps the first dive for timing.
    fn prepared(mut self, name: &'static str, settings: &[Setting]) -> Result<Prepared, CostError> {
        let mut judged: Vec<Vec<Vec<Judged>>> = settings.iter().map(|_| Vec::new()).collect();
        for (scene, recorded) in &mut self.0 {
            for (setting, judged) in settings.iter().zip(&mut judged) {
                judged.push(setting.judged(&mut scene.vehicle, recorded)?);
            }
        }
        let why = || CostError::Figure {
            what: format!("holes of {name}"),
            why: "no seed was simulated".to_owned(),
        };
        let (scene, recorded) = self.0.into_iter().next().ok_or_else(why)?;
        Ok(Prepared { name, vehicle: scene.vehicle, recorded, judged })
    }
}

/// A case whose sections have been judged with each setting, ready to be timed.
struct Prepared {
    name: &'static str,
    vehicle: VehicleConfig,
    recorded: Recorded,
    /// Judged sections by setting and seed.
    judged: Vec<Vec<Vec<Judged>>>,
}

/// Times all settings of all cases, round by round.
fn points(
    inputs: &Inputs<'_>,
    settings: &[Setting],
    mut prepared: Vec<Prepared>,
) -> Result<Vec<Point>, CostError> {
    let all: Vec<(usize, Setting)> =
        (0..prepared.len()).flat_map(|case| settings.iter().map(move |setting| (case, *setting))).collect();
    let mut searches: Vec<Vec<f64>> = all.iter().map(|_| Vec::new()).collect();
    let numbered: Vec<(usize, &(usize, Setting))> = all.iter().enumerate().collect();
    let costs = in_turns(inputs.effort.rounds(), &numbered, |(number, (case, setting))| {
        let Some(Prepared { vehicle, recorded, .. }) = prepared.get_mut(*case) else { return Ok(f64::NAN) };
        let [whole_s, search_s] = setting.cost_s(vehicle, recorded)?;
        let ns_a_return = NS / recorded.truth.returns.max(1) as f64;
        if let Some(searches) = searches.get_mut(*number) {
            searches.push(search_s * ns_a_return);
        }
        Ok(whole_s * ns_a_return)
    })?;
    let seeds = inputs.effort.seeds();
    let judged = prepared.iter().flat_map(|case| case.judged.iter().map(|judged| (case.name, judged)));
    let points = all.iter().zip(judged).zip(costs.into_iter().zip(searches));
    Ok(points
        .map(|(((_, setting), (name, judged)), (cost, search))| {
            setting.point(name, seeds, judged, cost, &search)
        })
        .collect())
}

fn settings(effort: Effort) -> Vec<Setting> {
    let mut settings = vec![Setting::Exact];
    let of =
        |values: &[f64], setting: fn(f64) -> Setting| values.iter().copied().map(setting).collect::<Vec<_>>();
    settings.extend(of(effort.pick(QUICK_TOLERANCES_M.as_slice(), &TOLERANCES_M), Setting::Tolerance));
    settings.extend(of(effort.pick(QUICK_SECTIONS_M.as_slice(), &SECTIONS_M), Setting::Section));
    settings.extend([Setting::Planned, Setting::Lattice]);
    settings.extend(of(effort.pick(QUICK_CELLS_M.as_slice(), &CELLS_M), Setting::Cells));
    settings
}

impl Setting {
    /// Calls `run` with the vehicle changed to this setting, and then restores the vehicle.
    fn with<T>(
        self,
        vehicle: &mut VehicleConfig,
        run: impl FnOnce(&VehicleConfig) -> Result<T, CostError>,
    ) -> Result<T, CostError> {
        let (coverage, section_m) = (vehicle.coverage.clone(), vehicle.section_m);
        match self {
            Self::Tolerance(tolerance_m) => vehicle.coverage.hole_tolerance_m = tolerance_m,
            Self::Section(section_m) => vehicle.section_m = section_m,
            Self::Cells(node_m) => vehicle.coverage.node_m = node_m,
            Self::Exact | Self::Planned | Self::Lattice => {}
        }
        let result = run(vehicle);
        (vehicle.coverage, vehicle.section_m) = (coverage, section_m);
        result
    }

    /// Judges the sections with this setting.
    fn judged(self, vehicle: &mut VehicleConfig, recorded: &Recorded) -> Result<Vec<Judged>, CostError> {
        self.with(vehicle, |vehicle| {
            let ended = recorded.replayed(vehicle, vehicle.navigation(), &mut |_| {})?;
            let dive = recorded.judge(&ended);
            Ok(match self {
                Self::Planned => {
                    let t_m = planned_t_m(vehicle)?;
                    by_lattice(&dive, &|_| Some(t_m))
                }
                Self::Lattice => by_lattice(&dive, &|section| section.report.t.max_m),
                Self::Cells(_) => by_cells(&dive, &ended),
                _ => verdicts::inner(&dive).map(Judged::of).collect(),
            })
        })
    }

    /// CPU time of a replay, and of one additional search for the holes of all its sections, s.
    ///
    /// For settings that need no search, the time of the search is subtracted from the time of the replay.
    fn cost_s(self, vehicle: &mut VehicleConfig, recorded: &Recorded) -> Result<[f64; 2], CostError> {
        self.with(vehicle, |vehicle| {
            let (ended, whole_s) = recorded.timed(vehicle)?;
            let tolerance_m = vehicle.coverage.hole_tolerance_m;
            let ((), search_s) = timed(|| search(&ended, tolerance_m));
            Ok(match self {
                Self::Planned | Self::Lattice => [whole_s - search_s, 0.0],
                Self::Cells(_) => {
                    let (_, count_s) = timed(|| cells::squares(&ended));
                    [whole_s - search_s + count_s, count_s]
                }
                _ => [whole_s, search_s],
            })
        })
    }

    fn point(self, scene: &str, seeds: u32, judged: &[Vec<Judged>], cost: Interval, search: &[f64]) -> Point {
        let (method, knob, value) = match self {
            Self::Exact => ("exact, and to a tolerance", "tolerance", Some(0.0)),
            Self::Tolerance(tolerance_m) => ("exact, and to a tolerance", "tolerance", Some(tolerance_m)),
            Self::Section(section_m) => ("other sections, exact", "section", Some(section_m)),
            Self::Planned => ("lattice's T (Eq. 16)", "of the plan", None),
            Self::Lattice => ("lattice's T (Eq. 16)", "of samples", None),
            Self::Cells(node_m) => ("empty squares of cells", "cell", Some(node_m)),
        };
        let mut errors = verdicts::errors(judged, TARGET_M);
        if let Some(search) = Interval::median(search) {
            errors.push(Error::new(SEARCH, "ns a return", search));
        }
        Point {
            method: method.to_owned(),
            knob: knob.to_owned(),
            value: match (self, value) {
                (Self::Exact, _) => "0 (exact)".to_owned(),
                (_, Some(value)) => format!("{value} m"),
                (_, None) => String::new(),
            },
            number: value,
            is_default: self == Self::Exact,
            scene: scene.to_owned(),
            seeds,
            errors,
            cost,
            instructions: None,
            on_front: false,
        }
    }
}

/// Name of the only figure of this trade that is a CPU time and not an error.
const SEARCH: &str = "search or count alone";

/// Judges each section by the spacing T that `t_m` returns for it.
fn by_lattice(dive: &JudgedDive, t_m: &dyn Fn(&JudgedSection) -> Option<f64>) -> Vec<Judged> {
    let target_m = dive.report.target_m;
    let judged = |section: &JudgedSection| {
        let hole_m = t_m(section);
        let passes = Some(hole_m.is_some_and(|hole_m| hole_m <= target_m));
        Judged { hole_m, passes, ..Judged::of(section) }
    };
    verdicts::inner(dive).map(judged).collect()
}

/// Largest spacing T_max at the driven speed for the configured heads, m, by Eq. 16 of Jorge et al. 2021.
fn planned_t_m(vehicle: &VehicleConfig) -> Result<f64, CostError> {
    let failed = |why: &str| CostError::Figure { what: "T of the plan".to_owned(), why: why.to_owned() };
    let planner = Planner::new(vehicle.inspection().map_err(|why| failed(&why))?)?;
    let step_rad = vehicle.heads().first().map_or(0.0, |head| head.step_rad);
    let is_set = |mode: &PlannedMode| (mode.mode.turn.step_rad() - step_rad).abs() < 1e-9;
    let mode = planner
        .modes()
        .iter()
        .position(is_set)
        .ok_or_else(|| failed("the heads are in none of its modes"))?;
    Ok(planner.t_max_m(mode, SPEED_MPS)?)
}

/// Judges the sections by the largest empty square of cells. A section fails if its square is as large as the target.
fn by_cells(dive: &JudgedDive, ended: &Loop) -> Vec<Judged> {
    let (target_m, squares) = (dive.report.target_m, cells::squares(ended));
    let judged = |section: &JudgedSection| {
        let hole_m = squares.largest_m(section.report.start_m, section.report.end_m);
        Judged { hole_m: Some(hole_m), passes: Some(hole_m < target_m), ..Judged::of(section) }
    };
    verdicts::inner(dive).map(judged).collect()
}

/// Searches once for the hole of each section.
fn search(dive: &Loop, tolerance_m: f64) {
    let (coverage, mut finder) = (dive.view().coverage(), HoleFinder::new(tolerance_m));
    for index in coverage.sections.sections_of(coverage.frontier.way()) {
        let (from_m, to_m) = coverage.sections.bounds_m(index);
        std::hint::black_box(finder.largest(&coverage.store, from_m, to_m));
    }
}

/// Finds a figure among the errors of a measured point, by its name.
fn figure(point: &Point, name: &str) -> f64 {
    let found = point.errors.iter().find(|error| error.name.starts_with(name));
    found.map_or(f64::NAN, |error| error.interval.middle)
}

fn find<'a>(points: &'a [Point], scene: &str, knob: &str, value: Option<f64>) -> Option<&'a Point> {
    points.iter().find(|point| point.scene.starts_with(scene) && point.knob == knob && point.number == value)
}

fn reasons(points: &[Point]) -> Vec<String> {
    let of = |scene: &str| {
        let exact = find(points, scene, "tolerance", Some(0.0))?;
        let coarse = find(points, scene, "tolerance", Some(0.05))?;
        let search = figure(exact, SEARCH);
        Some(format!(
            "Scene `{scene}`: the search takes {} of {} ns per return, so a tolerance can save at most {} %. A tolerance of 0.05 m saves {} ns and \
             leaves {} of 100 m without a verdict, instead of {}.",
            number(search),
            number(exact.cost.middle),
            number(100.0 * search / exact.cost.middle),
            number(search - figure(coarse, SEARCH)),
            number(figure(coarse, "not said")),
            number(figure(exact, "not said"))
        ))
    };
    let by_chance = "If position errors exceed the tolerance (`drop-outs`, `field`), a coarser search can look more accurate by \
                     chance, because it reports a lower bound of D."
        .to_owned();
    ["ideal", "drop-outs", "field"].into_iter().filter_map(of).chain([by_chance]).collect()
}

fn advice(points: &[Point]) -> String {
    let exact = find(points, "ideal", "tolerance", Some(0.0));
    let cells = |scene: &str| find(points, scene, "cell", Some(0.1));
    let (Some(exact), Some(ideal), Some(dropped)) = (exact, cells("ideal"), cells("drop-outs")) else {
        return String::new();
    };
    let planned = find(points, "drop-outs", "of the plan", None);
    format!(
        "Keep the exact search. It takes {} of {} ns per return and is within {} m of D_true in an ideal dive. A grid of 0.1 m cells is {} m \
         off. In the scene `drop-outs`, of every 100 m the grid wrongly passes {} m, and a verdict by the planned spacing T {} m.",
        number(figure(exact, SEARCH)),
        number(exact.cost.middle),
        number(exact.error()),
        number(ideal.error()),
        number(figure(dropped, "falsely passed")),
        number(planned.map_or(f64::NAN, |planned| figure(planned, "falsely passed")))
    )
}
