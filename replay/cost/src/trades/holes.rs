//! Holes: what finding the largest hole of a section exactly costs, beside tolerances, the lattice's T, and counts of cells.

use headrace_coverage::HoleFinder;
use headrace_monitor::run::Loop;
use headrace_simulator::Scene;
use headrace_vehicle::VehicleConfig;

use super::cells;
use crate::dive::{JudgedDive, Recorded};
use crate::error::CostError;
use crate::measure::{in_turns, timed};
use crate::oracle::second;
use crate::point::{Error, Interval, OracleError, Point, Trade, front};
use crate::scene::{self, Inputs};
use crate::verdicts::{self, END_M, Judged};
use crate::words::number;

/// Tolerances, m; a fiftieth of the target is added.
const TOLERANCES_M: [f64; 6] = [1e-4, 1e-3, 0.01, 0.05, 0.2, 1.0];
/// Edges of cells, m.
const CELLS_M: [f64; 3] = [0.5, 0.1, 0.02];
/// Lengths of sections, m, besides the shipped one.
const SECTIONS_M: [f64; 2] = [0.05, 1.0];
/// Metres of a dive that are judged, away from its ends.
const JUDGED_M: [f64; 2] = [6.0, 16.0];
/// Beyond the end of a dive the tunnel goes on so far, m: grids of fine cells would otherwise be of its whole length.
const BEYOND_M: f64 = 30.0;
const STRETCHES: u32 = 4;
const NS: f64 = 1e9;

/// A way to find how large the holes are.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Setting {
    Exact,
    Tolerance(f64),
    Section(f64),
    Lattice,
    Cells(f64),
}

/// What is dived.
struct Case {
    name: &'static str,
    target_m: f64,
    /// The scene, but for the length of its only leg.
    text: String,
}

fn cases() -> Result<[Case; 3], CostError> {
    let leg = |file: &str, length: &str| {
        Ok::<_, CostError>(scene::file(file)?.replace(length, "distance_m = LENGTH"))
    };
    let ideal = "vehicle = \"vita2-4.toml\"\n[trajectory]\nstart_m = 5\n[[trajectory.legs]]\ndistance_m = LENGTH\n\
                 speed_mps = 0.1\n[effects]\nmotion_within_turn = {}\nocclusion = {}\n";
    Ok([
        Case { name: "ideal: VITA 2, four heads", target_m: 0.5, text: ideal.to_owned() },
        Case {
            name: "drop-outs: VITA 2, four heads",
            target_m: 0.5,
            text: leg("drop-outs.toml", "distance_m = 40")?,
        },
        Case {
            name: "field: VITA 1, one head",
            target_m: 5.0,
            text: leg("vita1-field.toml", "distance_m = 130")?,
        },
    ])
}

/// Measures the trade.
///
/// Errors: see [`CostError`].
pub fn measure(inputs: &Inputs<'_>, progress: &mut dyn FnMut(&str)) -> Result<Trade, CostError> {
    let (mut points, mut oracle_m) = (Vec::new(), 0.0_f64);
    for case in cases()? {
        progress(&format!("holes: {}", case.name));
        let dives = Dives::of(inputs, &case)?;
        oracle_m = oracle_m.max(dives.oracle_m()?);
        points.extend(dives.points(inputs, &case)?);
    }
    front(&mut points, oracle_m);
    let (reasons, advice) = (reasons(&points), advice(&points));
    Ok(Trade {
        name: "holes".to_owned(),
        title: "Holes: what the exact search costs".to_owned(),
        question: "What does it cost to know D of a section exactly, beside tolerances, the lattice's T and counts of cells?"
            .to_owned(),
        error_axis: "|D - D_true| of sections, 95th percentile, m".to_owned(),
        cost_axis: "CPU time of a replay, ns a return".to_owned(),
        cost_unit: "ns a return".to_owned(),
        cost_is_computed: false,
        decides: Some(0.05),
        points,
        left_out: Vec::new(),
        oracle: OracleError {
            how: "Voronoi vertices against lower envelopes, and arc lengths of an outline against those of rays, on sections of each scene"
                .to_owned(),
            size: oracle_m,
        },
        reasons,
        advice,
    })
}

/// A case's dives, a seed each.
struct Dives(Vec<(Scene, Recorded)>);

impl Dives {
    fn of(inputs: &Inputs<'_>, case: &Case) -> Result<Self, CostError> {
        let judged_m = inputs.effort.pick(JUDGED_M[0], JUDGED_M[1]);
        let length_m = 2.0 * (END_M + case.target_m) + judged_m;
        let text = case.text.replace("LENGTH", &format!("{length_m:?}"));
        let mut dives = Vec::new();
        for seed in 1..=inputs.effort.seeds() {
            let mut scene = inputs.scene(&text, seed)?;
            scene.vehicle.tunnel.length_m = 5.0 + length_m + BEYOND_M;
            let recorded = Recorded::of(&scene, &scene.vehicle)?;
            dives.push((scene, recorded));
        }
        Ok(Self(dives))
    }

    fn oracle_m(&self) -> Result<f64, CostError> {
        let Some((scene, recorded)) = self.0.first() else { return Ok(0.0) };
        let end_m = END_M + scene.vehicle.target_m;
        let [from_m, to_m] = recorded.truth.way_m;
        second::may_be_off_m(
            &recorded.truth,
            [from_m + end_m, to_m - end_m],
            scene.vehicle.section_m,
            STRETCHES,
        )
    }

    fn points(mut self, inputs: &Inputs<'_>, case: &Case) -> Result<Vec<Point>, CostError> {
        let settings = settings(case.target_m);
        let mut errors: Vec<Vec<Vec<Judged>>> = settings.iter().map(|_| Vec::new()).collect();
        for (scene, recorded) in &mut self.0 {
            for (setting, errors) in settings.iter().zip(&mut errors) {
                errors.push(setting.judged(&mut scene.vehicle, recorded)?);
            }
        }
        let Some((scene, recorded)) = self.0.first_mut() else { return Ok(Vec::new()) };
        let returns = recorded.truth.returns.max(1) as f64;
        let mut searches: Vec<Vec<f64>> = settings.iter().map(|_| Vec::new()).collect();
        let numbered: Vec<(usize, Setting)> = settings.iter().copied().enumerate().collect();
        let costs = in_turns(inputs.effort.rounds(), &numbered, |(number, setting)| {
            let [whole_s, search_s] = setting.cost_s(&mut scene.vehicle, recorded)?;
            if let Some(searches) = searches.get_mut(*number) {
                searches.push(search_s / returns * NS);
            }
            Ok(whole_s / returns * NS)
        })?;
        let seeds = inputs.effort.seeds();
        let points = settings.iter().zip(errors).zip(costs.into_iter().zip(searches));
        Ok(points
            .map(|((setting, judged), (cost, search))| setting.point(case, seeds, &judged, cost, &search))
            .collect())
    }
}

fn settings(target_m: f64) -> Vec<Setting> {
    let mut tolerances_m = TOLERANCES_M.to_vec();
    let share_m = target_m / 50.0;
    if !tolerances_m.iter().any(|tolerance_m| (tolerance_m - share_m).abs() < 1e-12) {
        tolerances_m.push(share_m);
        tolerances_m.sort_by(f64::total_cmp);
    }
    let mut settings = vec![Setting::Exact];
    settings.extend(tolerances_m.into_iter().map(Setting::Tolerance));
    settings.extend(SECTIONS_M.map(Setting::Section));
    settings.push(Setting::Lattice);
    settings.extend(CELLS_M.map(Setting::Cells));
    settings
}

impl Setting {
    /// Replays with this setting, and sets the vehicle back.
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
            Self::Exact | Self::Lattice => {}
        }
        let result = run(vehicle);
        (vehicle.coverage, vehicle.section_m) = (coverage, section_m);
        result
    }

    /// The sections as this setting has them.
    fn judged(self, vehicle: &mut VehicleConfig, recorded: &Recorded) -> Result<Vec<Judged>, CostError> {
        self.with(vehicle, |vehicle| {
            let ended = recorded.replayed(vehicle, vehicle.navigation(), &mut |_| {})?;
            let dive = recorded.judge(&ended);
            Ok(match self {
                Self::Lattice => by_lattice(&dive),
                Self::Cells(_) => by_cells(&dive, &ended),
                _ => verdicts::inner(&dive).map(Judged::of).collect(),
            })
        })
    }

    /// CPU time of a replay, and of looking for the holes of all its sections once more, s. What needs no search is without it.
    fn cost_s(self, vehicle: &mut VehicleConfig, recorded: &Recorded) -> Result<[f64; 2], CostError> {
        self.with(vehicle, |vehicle| {
            let (ended, whole_s) = recorded.timed(vehicle)?;
            let tolerance_m = vehicle.coverage.hole_tolerance_m;
            let ((), search_s) = timed(|| search(&ended, tolerance_m));
            Ok(match self {
                Self::Lattice => [whole_s - search_s, 0.0],
                Self::Cells(_) => {
                    let (_, count_s) = timed(|| cells::squares(&ended));
                    [whole_s - search_s + count_s, count_s]
                }
                _ => [whole_s, search_s],
            })
        })
    }

    fn point(self, case: &Case, seeds: u32, judged: &[Vec<Judged>], cost: Interval, search: &[f64]) -> Point {
        let (method, knob, value) = match self {
            Self::Exact => ("exact, and to a tolerance", "tolerance", Some(0.0)),
            Self::Tolerance(tolerance_m) => ("exact, and to a tolerance", "tolerance", Some(tolerance_m)),
            Self::Section(section_m) => ("other sections, exact", "section", Some(section_m)),
            Self::Lattice => ("lattice's T (Eq. 16)", "lattice", None),
            Self::Cells(node_m) => ("empty squares of cells", "cell", Some(node_m)),
        };
        let mut errors = verdicts::errors(judged, case.target_m);
        if let Some(search) = Interval::quartiles(search) {
            errors.push(Error::new(SEARCH, "ns a return", search));
        }
        Point {
            method: method.to_owned(),
            knob: knob.to_owned(),
            value: match (self, value) {
                (Self::Exact, _) => "0 (exact)".to_owned(),
                (_, value) => value.map(|value| format!("{value} m")).unwrap_or_default(),
            },
            number: value,
            is_default: self == Self::Exact,
            scene: case.name.to_owned(),
            seeds,
            errors,
            cost,
            instructions: None,
            on_front: false,
        }
    }
}

/// Name of the figure that isn't an error.
const SEARCH: &str = "search or count alone";

/// The sections by the largest diagonal of the lattice of samples.
fn by_lattice(dive: &JudgedDive) -> Vec<Judged> {
    let target_m = dive.report.target_m;
    let judged = |section: &crate::dive::JudgedSection| {
        let hole_m = section.report.t.max_m;
        let passes = Some(hole_m.is_some_and(|hole_m| hole_m <= target_m));
        Judged { hole_m, passes, ..Judged::of(section) }
    };
    verdicts::inner(dive).map(judged).collect()
}

/// The sections by the largest empty square of cells; one as large as the target fails.
fn by_cells(dive: &JudgedDive, ended: &Loop) -> Vec<Judged> {
    let (target_m, squares) = (dive.report.target_m, cells::squares(ended));
    let judged = |section: &crate::dive::JudgedSection| {
        let hole_m = squares.largest_m(section.report.start_m, section.report.end_m);
        Judged { hole_m: Some(hole_m), passes: Some(hole_m < target_m), ..Judged::of(section) }
    };
    verdicts::inner(dive).map(judged).collect()
}

/// Looks for the hole of each section once.
fn search(dive: &Loop, tolerance_m: f64) {
    let (coverage, mut finder) = (dive.coverage(), HoleFinder::new(tolerance_m));
    for index in coverage.sections.sections_of(coverage.frontier.way()) {
        let (from_m, to_m) = coverage.sections.bounds_m(index);
        std::hint::black_box(finder.largest(&coverage.store, from_m, to_m));
    }
}

/// A figure of a point by its name.
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
        let coarse = find(points, scene, "tolerance", Some(0.2))?;
        Some(format!(
            "{}: the exact search stays: it takes {} of {} ns a return; a tolerance of 0.2 m saves {} ns and leaves {} m in 100 unsaid in place of \
             {}.",
            exact.scene,
            number(figure(exact, SEARCH)),
            number(exact.cost.middle),
            number(exact.cost.middle - coarse.cost.middle),
            number(figure(coarse, "not said")),
            number(figure(exact, "not said"))
        ))
    };
    ["ideal", "drop-outs", "field"].into_iter().filter_map(of).collect()
}

fn advice(points: &[Point]) -> String {
    let exact = find(points, "ideal", "tolerance", Some(0.0));
    let (Some(exact), Some(lattice)) = (exact, find(points, "ideal", "lattice", None)) else {
        return String::new();
    };
    let dropped =
        find(points, "drop-outs", "lattice", None).map_or(f64::NAN, |point| figure(point, "falsely passed"));
    format!(
        "Keep the exact search: of {} ns a return it takes {}, and what it finds is within {} m of D_true on an ideal dive, where the \
         lattice's T is {} m off; with drop-outs the lattice passes {} m in 100 falsely.",
        number(exact.cost.middle),
        number(figure(exact, SEARCH)),
        number(exact.error()),
        number(lattice.error()),
        number(dropped)
    )
}
