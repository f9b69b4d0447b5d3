//! Cost of a more accurate simulation: effects left out one by one, and the number of rays per beam.

mod effects;

use headrace_coverage::Verdict;
use headrace_geometry::math;
use headrace_simulator::environment::What;
use headrace_simulator::{Scene, Simulation};

use self::effects::{ALL, without};
use super::figures::{error, spread};
use crate::error::CostError;
use crate::measure::{in_turns, side_by_side};
use crate::point::{Error, Interval, LeftOut, OracleError, Point, Trade, front};
use crate::scene::{Inputs, file};
use crate::words::number;
use headrace_oracle::dive::{JudgedDive, Recorded};
use headrace_oracle::timed;

/// Numbers of rays per beam that are compared with [`MANY_RAYS`].
const RAYS: [u32; 7] = [1, 2, 4, 8, 16, 32, 64];
/// Default number of rays per beam.
const USUAL_RAYS: u32 = 16;
const MANY_RAYS: u32 = 1024;
/// Number of rays of a second reference, which is as good as [`MANY_RAYS`]. Its rays have other directions within the
/// beam.
const OTHER_RAYS: u32 = 769;
/// Change of the hole diameter D that can change a decision, m: a tenth of the smallest shipped target, 0.5 m.
const DECIDES_M: f64 = 0.05;
/// Smallest difference of the hole diameter D that counts, m. Rounding in the simulation is far smaller.
const RESOLUTION_M: f64 = 1e-4;
/// Minimum number of seeds, because differences need a spread.
const LEAST_SEEDS: u32 = 2;
/// Maximum number of seconds of a dive that are timed. The simulation advances in slices of a second.
const TIMED_S: u32 = 8;
/// Number of seeds when the number of rays is varied. It is small, because a simulation with [`MANY_RAYS`] takes long.
const RAYS_SEEDS: u32 = 2;

/// A scene and the effects that may be left out of it.
struct Stage {
    name: &'static str,
    text: String,
    effects: Vec<String>,
    /// Sizes of the scene's boulders by feature number, m.
    boulders_m: Vec<f64>,
}

/// Results of a simulated dive.
struct Figures {
    /// Hole diameter D and verdict of each section, by the section's start in millimetres.
    sections: Vec<(i64, Option<f64>, Verdict)>,
    /// Numbers of the features that beams hit.
    features_hit: Vec<u16>,
}

/// Measures the errors and costs of all settings of this trade.
///
/// Errors: see [`CostError`].
pub fn measure(inputs: &Inputs<'_>, progress: &mut dyn FnMut(&str)) -> Result<Trade, CostError> {
    let seeds = inputs.effort.seeds().max(LEAST_SEEDS);
    let mut prepared = Vec::new();
    let stages = stages(inputs)?;
    for stage in &stages {
        progress(&format!("simulation: effects of {}", stage.name));
        prepared.extend(effects_of(inputs, stage, seeds)?);
    }
    let mut size = 0.0_f64;
    for stage in &beams(inputs)? {
        progress(&format!("simulation: rays of {}", stage.name));
        let (of_rays, off_m) = rays_of(inputs, stage, seeds.min(RAYS_SEEDS))?;
        prepared.extend(of_rays);
        size = size.max(off_m);
    }
    progress("simulation: costs");
    let mut points = points(inputs, prepared)?;
    front(&mut points, RESOLUTION_M);
    let (reasons, advice) = (reasons(&points), advice(&points));
    Ok(Trade {
        name: "simulation".to_owned(),
        title: "Simulation".to_owned(),
        question: "What does each simulated effect cost, and what changes without it?".to_owned(),
        error_axis: "change of D, mean over a scene's sections, m".to_owned(),
        cost_axis: "simulation, ns of CPU a return".to_owned(),
        cost_unit: "ns a return".to_owned(),
        cost_is_computed: false,
        decides: Some(DECIDES_M),
        points,
        left_out: left_out(inputs),
        oracle: OracleError {
            how: format!(
                "{MANY_RAYS} rays are compared with {OTHER_RAYS} rays at other places within the beam"
            ),
            size,
        },
        reasons,
        advice,
    })
}

fn stages(inputs: &Inputs<'_>) -> Result<Vec<Stage>, CostError> {
    let stage = |name, text: String| {
        let effects = effects::named(&text);
        Stage { name, text, effects, boulders_m: Vec::new() }
    };
    let shorter = |text: &str, from: &str, to: &str| {
        let found = text.contains(from);
        let why = || CostError::Figure {
            what: "a shipped scene over another stretch".to_owned(),
            why: format!("it doesn't have {from:?}"),
        };
        found.then(|| text.replace(from, to)).ok_or_else(why)
    };
    let boulders_m: Vec<f64> = (0..BOULDERS).map(boulder_m).collect();
    let boulders: String = boulders_m.iter().enumerate().map(|(number, m)| boulder(number, *m)).collect();
    let mut stages = vec![
        Stage { boulders_m, ..stage("boulders", format!("{AMONG_BOULDERS}{boulders}{BOULDERS_EFFECTS}")) },
        stage("small pipe", shorter(file("small-pipe.toml")?, "distance_m = 30", "distance_m = 3\n")?),
    ];
    if inputs.effort.pick(false, true) {
        let collapse = file("collapse.toml")?;
        let collapse = shorter(collapse, "start_m = 5\n", "start_m = 18\n")?;
        stages.push(stage("collapse", shorter(&collapse, "distance_m = 45", "distance_m = 2\n")?));
        stages.push(field(18)?);
        stages.push(stage("all effects", format!("{BARE}{ALL}")));
    }
    Ok(stages)
}

/// Number of boulders around the wall.
const BOULDERS: u32 = 60;
const SMALLEST_M: f64 = 0.02;
const LARGEST_M: f64 = 0.8;

/// Size of a boulder, m. Boulders with consecutive numbers have similar sizes.
fn boulder_m(number: u32) -> f64 {
    SMALLEST_M + (LARGEST_M - SMALLEST_M) * f64::from(number) / f64::from(BOULDERS - 1)
}

/// Table of a boulder.
///
/// Chainage and arc length follow additive sequences of the golden ratio and the root of two, so boulders of similar
/// size are far from each other.
fn boulder(number: usize, size_m: f64) -> String {
    let share = |by: f64| math::wrap(number as f64 * by, 1.0);
    let (chainage_m, arc_m) = (5.5 + 3.0 * share(0.618_033_988_7), 28.0 * share(0.414_213_562_4));
    format!(
        "[[tunnel.features]]\nkind = \"boulder\"\nchainage_m = {chainage_m}\narc_m = {arc_m}\nsize_m = {size_m}\nsunk = 0.5\n"
    )
}

const AMONG_BOULDERS: &str = "vehicle = \"vita2-4.toml\"\n[trajectory]\nstart_m = 5\n[[trajectory.legs]]\ndistance_m = 4\nspeed_mps = 0.1\n";
/// The effects of the shipped scene `boulders`.
const BOULDERS_EFFECTS: &str =
    "[effects]\nmotion_within_turn = {}\nocclusion = {}\nbeam_cone = {}\nrange_noise = { sd_m = 0.01 }\n";
/// Scene: VITA 2 with four heads along a stretch without features.
const BARE: &str = "vehicle = \"vita2-4.toml\"\n[trajectory]\nstart_m = 5\n[[trajectory.legs]]\ndistance_m = 4\nspeed_mps = 0.09\n";

/// The scenes in which the number of rays is varied.
///
/// The scenes are short, because a dive with a thousand rays per beam takes long. Both references are compared in the
/// first scene.
fn beams(inputs: &Inputs<'_>) -> Result<Vec<Stage>, CostError> {
    let lengths = inputs.effort.pick(&[("field", 7.0)][..], &[("field", 20.0), ("boulders", 0.6)]);
    let mut of_field = vec![field(20)?];
    of_field.extend(stages(inputs)?.into_iter().filter(|stage| stage.name == "boulders"));
    let mut beams = Vec::new();
    for (mut stage, (_, metres)) in of_field.into_iter().zip(lengths) {
        let legs = stage.text.lines().map(|line| {
            if line.starts_with("distance_m") {
                format!("distance_m = {metres}\n")
            } else {
                format!("{line}\n")
            }
        });
        stage.text = legs.collect();
        beams.push(stage);
    }
    Ok(beams)
}

/// The shipped field scene over `length_m` metres.
fn field(length_m: u32) -> Result<Stage, CostError> {
    let text = file("vita1-field.toml")?.replace("distance_m = 130", &format!("distance_m = {length_m}"));
    // The dive has the planned speed of the scene's vehicle file.
    let planned = text.replace("speed_mps = 0.16", "speed_mps = 0.197");
    if planned == text {
        let why = "the shipped scene has another speed than this trade changes".to_owned();
        return Err(CostError::Figure { what: "vita1-field.toml as planned".to_owned(), why });
    }
    let text = planned;
    let effects = effects::named(&text);
    Ok(Stage { name: "field", text, effects, boulders_m: Vec::new() })
}

/// A point whose errors are known and whose cost is still to be timed, with the scene to time.
struct Prepared {
    point: Point,
    scene: Scene,
    /// Number of sonar returns in the simulated time.
    returns: f64,
}

impl Prepared {
    /// Prepares to time the scene of the first seed.
    fn of(inputs: &Inputs<'_>, text: &str, point: Point) -> Result<Self, CostError> {
        let scene = inputs.scene(text, 1)?;
        let recorded = Recorded::of(&scene, &scene.vehicle)?;
        let recorded_s = recorded.duration_s().max(f64::from(TIMED_S));
        let returns = recorded.truth.returns.max(1) as f64 * f64::from(TIMED_S) / recorded_s;
        Ok(Self { point, scene, returns })
    }

    /// CPU time of simulating, ns per sonar return.
    fn cost_ns(&self) -> Result<f64, CostError> {
        let mut simulation = Simulation::new(&self.scene)?;
        let ((), cpu_s) = timed(|| (0..TIMED_S).take_while(|_| simulation.advance()).for_each(drop));
        Ok(cpu_s * 1e9 / self.returns)
    }
}

/// Times all settings of all scenes, round by round.
///
/// The time saved by leaving an effect out is relative to the scene with all effects.
fn points(inputs: &Inputs<'_>, prepared: Vec<Prepared>) -> Result<Vec<Point>, CostError> {
    let costs = in_turns(inputs.effort.rounds(), &prepared, Prepared::cost_ns)?;
    let mut whole = f64::NAN;
    let mut points = Vec::new();
    for (Prepared { mut point, .. }, cost) in prepared.into_iter().zip(costs) {
        point.cost = cost;
        if point.method == LEFT_OUT {
            whole = if point.is_default { cost.middle } else { whole };
            point.errors.push(Error::new("saved", "ns a return", Interval::exact(whole - cost.middle)));
        }
        points.push(point);
    }
    Ok(points)
}

/// Method name of the points with one effect left out. The default point leaves no effect out and comes first.
const LEFT_OUT: &str = "left out";

fn effects_of(inputs: &Inputs<'_>, stage: &Stage, seeds: u32) -> Result<Vec<Prepared>, CostError> {
    let mut texts = vec![("none".to_owned(), stage.text.clone())];
    for effect in &stage.effects {
        texts.push((effect.clone(), without(&stage.text, effect)?));
    }
    let (differences, hits) = differences(inputs, &texts, seeds)?;
    let mut prepared = Vec::new();
    for (((effect, text), differences), hits) in texts.iter().zip(differences).zip(hits) {
        let mut errors = differences.errors();
        errors.extend(boulders_hit(&stage.boulders_m, &hits));
        let point = Point {
            method: LEFT_OUT.to_owned(),
            knob: "effect left out".to_owned(),
            value: effect.clone(),
            number: None,
            is_default: effect == "none",
            scene: stage.name.to_owned(),
            seeds,
            errors,
            cost: Interval::exact(f64::NAN),
            instructions: None,
            on_front: false,
        };
        prepared.push(Prepared::of(inputs, text, point)?);
    }
    Ok(prepared)
}

/// Makes the points for numbers of rays; also returns the difference between the two references, m.
fn rays_of(inputs: &Inputs<'_>, stage: &Stage, seeds: u32) -> Result<(Vec<Prepared>, f64), CostError> {
    let rays = || [MANY_RAYS].into_iter().chain(RAYS);
    let text = |rays: u32| Ok((rays.to_string(), effects::with_rays(&stage.text, rays)?));
    let texts = rays().map(text).collect::<Result<Vec<_>, CostError>>()?;
    let (differences, _) = differences(inputs, &texts, seeds)?;
    let mut prepared = Vec::new();
    for ((rays, differences), (_, text)) in rays().zip(differences).zip(&texts).skip(1) {
        let point = Point {
            method: "rays of a beam".to_owned(),
            knob: "rays".to_owned(),
            value: rays.to_string(),
            number: Some(f64::from(rays)),
            is_default: rays == USUAL_RAYS,
            scene: format!("{}, rays", stage.name),
            seeds,
            errors: differences.errors(),
            cost: Interval::exact(f64::NAN),
            instructions: None,
            on_front: false,
        };
        prepared.push(Prepared::of(inputs, text, point)?);
    }
    if stage.name != "field" {
        return Ok((prepared, 0.0));
    }
    // One dive is enough to find the difference between the two references.
    let others = [MANY_RAYS, OTHER_RAYS].map(text).into_iter().collect::<Result<Vec<_>, CostError>>()?;
    let (references, _) = self::differences(inputs, &others, 1)?;
    Ok((prepared, references.get(1).map_or(f64::NAN, Differences::change_m)))
}

/// Differences between the results of a changed scene and of the original scene, one value per seed.
#[derive(Default)]
struct Differences {
    hole_m: Vec<f64>,
    passed: Vec<f64>,
    other_verdicts: Vec<f64>,
}

impl Differences {
    fn change_m(&self) -> f64 {
        spread(&self.hole_m).map_or(f64::NAN, |change| change.middle.abs())
    }

    /// Returns the errors: first the magnitude of the mean change of the hole diameter D, with an interval; then the
    /// changes with their signs.
    fn errors(&self) -> Vec<Error> {
        let size = spread(&self.hole_m).map(|Interval { low, middle, high }| Interval {
            low: if low <= 0.0 && high >= 0.0 { 0.0 } else { low.abs().min(high.abs()) },
            middle: middle.abs(),
            high: low.abs().max(high.abs()),
        });
        let size = size.map(|size| Error::new("size of the change of D", "m", size));
        let rest = [
            error("change of D", "m", &self.hole_m),
            error("change of metres passed", "m in 100", &self.passed),
            error("other verdicts", "m in 100", &self.other_verdicts),
        ];
        size.into_iter().chain(rest.into_iter().flatten()).collect()
    }
}

/// Simulates each scene with the same seeds, and compares each dive with the dive of the first scene.
///
/// Also returns the features that beams hit in the dives of the first seed.
fn differences(
    inputs: &Inputs<'_>,
    texts: &[(String, String)],
    seeds: u32,
) -> Result<(Vec<Differences>, Vec<Hits>), CostError> {
    let mut differences: Vec<Differences> = texts.iter().map(|_| Differences::default()).collect();
    let mut hits: Vec<Hits> = texts.iter().map(|_| Hits::new()).collect();
    let seeds: Vec<u32> = (1..=seeds).collect();
    let dives = seeds.iter().flat_map(|seed| texts.iter().map(move |(_, text)| (*seed, text)));
    let figures = side_by_side(&dives.collect::<Vec<_>>(), |(seed, text)| {
        let with_features = *seed == 1 && text.contains("\"boulder\"") && !text.contains("rays = ");
        Figures::of(&inputs.scene(text, *seed)?, with_features)
    })?;
    for (seed, of_seed) in seeds.iter().zip(figures.chunks(texts.len().max(1))) {
        for ((figures, differences), hits) in of_seed.iter().zip(&mut differences).zip(&mut hits) {
            compare(of_seed.first().unwrap_or(figures), figures, differences);
            if *seed == 1 {
                hits.push(figures.features_hit.clone());
            }
        }
    }
    Ok((differences, hits))
}

/// Numbers of the hit features, by dive.
type Hits = Vec<Vec<u16>>;

/// Sizes of the smallest boulder hit and the largest boulder missed, m; empty if the scene has no boulders.
fn boulders_hit(sizes_m: &[f64], hits: &Hits) -> Vec<Error> {
    let by_number = || (0_u16..).zip(sizes_m);
    let (mut smallest_m, mut missed_m) = (Vec::new(), Vec::new());
    for hit in hits.iter().filter(|_| !sizes_m.is_empty()) {
        let sizes =
            |is_hit: bool| by_number().filter(move |(n, _)| hit.contains(n) == is_hit).map(|(_, m)| *m);
        smallest_m.extend(sizes(true).min_by(f64::total_cmp));
        missed_m.push(sizes(false).fold(0.0, f64::max));
    }
    let errors =
        [error("smallest boulder hit", "m", &smallest_m), error("largest boulder missed", "m", &missed_m)];
    errors.into_iter().flatten().collect()
}

/// Compares two dives section by section. Both dives have the same vehicle and trajectory.
fn compare(whole: &Figures, other: &Figures, differences: &mut Differences) {
    let (mut changes_m, mut count, mut passed, mut differing) = (Vec::new(), 0.0, 0.0, 0.0);
    for (start, hole_m, verdict) in &other.sections {
        let Some((_, hole_before_m, before)) = whole.sections.iter().find(|(of, ..)| of == start) else {
            continue;
        };
        changes_m.extend(hole_m.zip(*hole_before_m).map(|(now_m, before_m)| now_m - before_m));
        let passes = |verdict: &Verdict| f64::from(u8::from(*verdict == Verdict::Pass));
        count += 1.0;
        passed += passes(verdict) - passes(before);
        differing += f64::from(u8::from(verdict != before));
    }
    if changes_m.is_empty() {
        return;
    }
    differences.hole_m.push(changes_m.iter().sum::<f64>() / changes_m.len() as f64);
    differences.passed.push(100.0 * passed / count);
    differences.other_verdicts.push(100.0 * differing / count);
}

impl Figures {
    fn of(scene: &Scene, has_boulders: bool) -> Result<Self, CostError> {
        let JudgedDive { report, .. } = Recorded::of(scene, &scene.vehicle)?.judged(&scene.vehicle)?;
        let millimetres = |m: f64| math::round_to_i64(1000.0 * m);
        let section = |section: &headrace_monitor::section_row::SectionRow| {
            let hole_m = section.hole_m.filter(|_| section.hole_bounded);
            (millimetres(section.start_m), hole_m, section.verdict)
        };
        let sections = report.sections.iter().filter(|section| !section.not_inspected).map(section).collect();
        let features_hit = if has_boulders { features_hit(scene)? } else { Vec::new() };
        Ok(Self { sections, features_hit })
    }
}

/// Numbers of the features that the axis of a beam hits with a detected return.
fn features_hit(scene: &Scene) -> Result<Vec<u16>, CostError> {
    let mut simulation = Simulation::with_truth(scene)?;
    let mut hit = Vec::new();
    while simulation.advance() {
        for sounding in simulation.take_truth().into_iter().filter_map(|row| row.sounding) {
            if let (Some((wall, _)), Some(_)) = (sounding.wall, sounding.measured.range_m)
                && let What::Feature(feature) = wall.what
            {
                hit.push(feature);
            }
        }
    }
    hit.sort_unstable();
    hit.dedup();
    Ok(hit)
}

fn left_out(inputs: &Inputs<'_>) -> Vec<LeftOut> {
    let mut left_out = vec![
        LeftOut {
            what: "step lengths of a ray".to_owned(),
            why: "shorter steps would change no result, because a ray already ends within 1e-11 m of the wall; longer steps would miss walls"
                .to_owned(),
        },
        LeftOut {
            what: "rays in the small pipe and the collapse".to_owned(),
            why: "a thousand rays take minutes between bent walls or fallen blocks".to_owned(),
        },
    ];
    if inputs.effort.pick(true, false) {
        left_out.push(LeftOut {
            what: "collapse, field, all effects, rays among boulders, and three of five seeds".to_owned(),
            why: "`--quick`; the full measurement includes them".to_owned(),
        });
    }
    left_out
}

/// Change of the hole diameter D below which D counts as unchanged, m.
const UNCHANGED_M: f64 = 0.01;

/// Reasons for the default number of rays and for keeping all effects.
fn reasons(points: &[Point]) -> Vec<String> {
    let of_rays = |rays: u32| {
        let is = move |point: &&Point| point.knob == "rays" && point.value == rays.to_string();
        points.iter().filter(is).find(|point| !point.errors.is_empty())
    };
    let rays = of_rays(1).zip(of_rays(USUAL_RAYS)).map(|(one, usual)| {
        format!(
            "A beam has {USUAL_RAYS} rays by default. In the scene `{}`, D with one ray differs by {} m from D with {MANY_RAYS} rays; D with {USUAL_RAYS} rays \
             differs by {} m. {USUAL_RAYS} rays cost {} ns per return, one ray {}. Only several rays find the edge of a boulder that cuts a beam; D \
             does not show this benefit.",
            usual.scene.trim_end_matches(", rays"),
            number(one.error()),
            number(usual.error()),
            number(usual.cost.middle),
            number(one.cost.middle)
        )
    });
    let left_out: Vec<&Point> =
        points.iter().filter(|point| point.method == LEFT_OUT && !point.is_default).collect();
    let surely = |point: &&&Point| {
        point.errors.first().is_some_and(|error| error.unit == "m" && error.interval.low > UNCHANGED_M)
    };
    let effects = (!left_out.is_empty()).then(|| {
        format!(
            "The influence of an effect depends on the scene. Of {} cases in which one effect was left out of a scene, {} certainly change D by \
             more than {UNCHANGED_M} m.",
            left_out.len(),
            left_out.iter().filter(surely).count()
        )
    });
    rays.into_iter().chain(effects).collect()
}

/// Advice: the most expensive effect that changed nothing, and the effect that changed most.
fn advice(points: &[Point]) -> String {
    let left_out = || points.iter().filter(|point| point.method == LEFT_OUT && !point.is_default);
    let figure = |point: &Point, name: &str| {
        let found = point.errors.iter().find(|error| error.name == name);
        found.map_or(f64::NAN, |error| error.interval.middle)
    };
    // A dive in which no section has a hole diameter D gives a change that isn't finite.
    let is_known = |point: &&Point| figure(point, "change of D").is_finite();
    let most = left_out().filter(is_known).max_by(|a, b| a.error().total_cmp(&b.error()));
    let within = |point: &&Point| point.errors.first().is_some_and(|error| error.interval.high < UNCHANGED_M);
    let idle = left_out().filter(within).max_by(|a, b| figure(a, "saved").total_cmp(&figure(b, "saved")));
    let most = most.map(|point| {
        let by_m = figure(point, "change of D");
        format!(
            "Leaving out `{}` changes D most: by {by_m:+.3} m in the scene `{}`.",
            point.value, point.scene
        )
    });
    let idle = idle.map(|point| {
        let saved_ns = figure(point, "saved");
        format!(
            "Of the effects that change D by less than 1 cm, `{}` costs most: {saved_ns:.0} ns per return in the scene `{}`.",
            point.value, point.scene
        )
    });
    [most, idle].into_iter().flatten().collect::<Vec<_>>().join(" ")
}
