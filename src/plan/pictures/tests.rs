//! Checks every chart of every kind of plan. Each chart must be well-formed and reproducible, and have the
//! right content.

use clap::Parser;
use headrace_deliver::pictures::xml::well_formed;
use headrace_geometry::frames::Vec3;
use headrace_sampling::SamplingError;
use headrace_sampling::occlusion::Obstacle;
use headrace_sampling::plan::{Inspection, Planner, Question};

use super::*;
use crate::cli::{Cli, Command};
use crate::plan::case::Case;

const FAST: usize = 2;
const TARGET: Question = Question { target_m: Some(0.5), speed_mps: None, time_s: None };
const SPEED: Question = Question { target_m: None, speed_mps: Some(0.1), time_s: None };
/// VITA 2 with four heads in phase-shift mode: two side by side in front, and two aft.
const VITA_2: &str = "--vehicle deploy/vehicles/vita2-4.toml";
/// VITA 2 with four heads in sector mode. The heads' distances along the hull leave a strip that no head
/// sees.
const SECTORS: &str = "--vehicle deploy/vehicles/vita2-4.toml --layout sector_offset";
const ONE: &str = "--tunnel ceran --length 7000";

type Picture = fn(&Shown<'_>) -> Result<String, SamplingError>;

const PICTURES: [(&str, Picture); 4] =
    [("perimeter", perimeter), ("pattern", pattern), ("speeds", speeds), ("hours", hours)];

/// The plan described by these arguments of `headrace plan`.
fn case(arguments: &str) -> Case {
    let cli = Cli::try_parse_from(["headrace", "plan"].into_iter().chain(arguments.split(' '))).unwrap();
    let Command::Plan(plan) = cli.command else { panic!("{arguments}") };
    Case::of(&plan).unwrap()
}

fn inspection(arguments: &str) -> Inspection {
    case(arguments).inspection
}

/// A vehicle whose hull occludes its head's beams, either to the left or all around.
fn walled_in(all_around: bool) -> Inspection {
    let plate = |[x, y, z]: [f64; 3], most: [f64; 3]| Obstacle::Box {
        least: Vec3::new(x, y, z),
        most: Vec3::new(most[0], most[1], most[2]),
    };
    let left = plate([-2.0, 0.3, -2.0], [2.0, 0.5, 2.0]);
    let others = [
        plate([-2.0, -0.5, -2.0], [2.0, -0.3, 2.0]),
        plate([-2.0, -2.0, 0.3], [2.0, 2.0, 0.5]),
        plate([-2.0, -2.0, -0.5], [2.0, 2.0, -0.3]),
    ];
    let hull = [left].into_iter().chain(others.into_iter().filter(|_| all_around)).collect();
    Inspection { hull, ..inspection(ONE) }
}

/// Draws a chart of a plan, and makes the checks that apply to all charts.
fn draw(inspection: Inspection, mode: usize, speed_mps: f64, question: Question, name: &str) -> String {
    let planner = Planner::new(inspection).unwrap();
    let title = "ceran, <4> heads & phase shift".to_owned();
    let shown = Shown { planner: &planner, mode, speed_mps, question, title };
    let picture = PICTURES.iter().find(|(known, _)| *known == name).unwrap().1;
    let svg = picture(&shown).unwrap();
    assert_eq!(svg, picture(&shown).unwrap(), "{name} differs when drawn again");
    check(name, &svg);
    svg
}

fn check(name: &str, svg: &str) {
    well_formed(svg).unwrap_or_else(|why| panic!("{name}: {why}"));
    assert!(svg.len() < 60_000, "{name}: {} bytes", svg.len());
    assert!(!svg.contains("NaN") && !svg.contains("inf\"") && !svg.contains("inf "), "{name}");
    let opening = svg.lines().next().unwrap();
    for attribute in ["<svg ", "width=\"900\"", "height=\"560\"", "viewBox=\"0 0 900 560\"", "\"sans-serif\""]
    {
        assert!(opening.contains(attribute), "{name}: {opening}");
    }
    assert!(svg.contains("ceran, &lt;4&gt; heads &amp; phase shift"), "{name}");
    for size in svg.split("font-size=\"").skip(1) {
        let size_px: f64 = size.split('"').next().unwrap().parse().unwrap();
        assert!(size_px > 11.9, "{name}: letters of {size_px} pixels");
    }
    let texts = svg.matches("<text").count();
    assert!(texts > 15, "{name}: {texts}");
}

fn says(svg: &str, all: &[&str]) {
    for words in all {
        assert!(svg.contains(words), "{words:?} is missing");
    }
}

fn silent(svg: &str, none: &[&str]) {
    for words in none {
        assert!(!svg.contains(words), "{words:?} must not appear");
    }
}

#[test]
fn perimeter_chart_names_curves_clock_hours_and_number_of_heads() {
    let svg = draw(inspection(VITA_2), FAST, 0.115, TARGET, "perimeter");
    says(&svg, &["Spacing around the wall: FAST at 0.115 m/s", "target 0.5 m", "T, both together:"]);
    says(&svg, &["T_x, between passes", "T_y, neighbours", "2 of 4", "9:00 left", "12:00 crown", "m, 9:00"]);
    silent(&svg, &["no head", "that alternate", "over the target", " across"]);
    says(&draw(inspection(VITA_2), FAST, 0.2, TARGET, "perimeter"), &["over the target"]);
}

#[test]
fn perimeter_chart_for_sector_offset_shows_alternating_distances_and_unseen_strips() {
    let svg = draw(inspection(SECTORS), 1, 0.048, TARGET, "perimeter");
    says(
        &svg,
        &["two distances", "that alternate", "no head", "sees it", " m across", "counts as one long step"],
    );
}

#[test]
fn pattern_chart_shows_heads_circle_and_hidden_tracks() {
    let svg = draw(inspection(VITA_2), FAST, 0.115, TARGET, "pattern");
    says(
        &svg,
        &["Pattern on the unrolled wall: FAST at 0.115 m/s", "head 0", "head 3", "hidden by the vehicle"],
    );
    says(&svg, &[" m (T). Any feature as", "true to scale", "9:00 left", "distance along the tunnel, m"]);
    silent(&draw(inspection(ONE), FAST, 0.058, TARGET, "pattern"), &["head 1", "hidden by"]);
}

/// In the pattern, no empty circle has a diameter larger than the spacing T, and no gap is larger than the circle that
/// the chart draws.
#[test]
fn no_empty_circle_is_wider_than_the_spacing_t() {
    let plans = [
        (ONE, 0.058),
        ("--tunnel ceran --heads 4", 0.2),
        (VITA_2, 0.118),
        (SECTORS, 0.099),
        ("--tunnel ceran --heads 2 --layout sector_offset", 0.1),
        ("--tunnel circle,radius_m=0.5 --heads 8", 0.3),
    ];
    for (arguments, speed_mps) in plans {
        let planner = Planner::new(inspection(arguments)).unwrap();
        let shown =
            Shown { planner: &planner, mode: FAST, speed_mps, question: TARGET, title: String::new() };
        let laid = laid::lay(&shown).unwrap();
        let t_m = laid.t_m.unwrap();
        let places = planner.perimeter(FAST, speed_mps, 180).unwrap();
        let empty_m = |arc_m: f64| laid.emptiest(arc_m).unwrap().1;
        let around_m = places.iter().step_by(9).map(|place| empty_m(place.arc_m)).fold(0.0, f64::max);
        let worst_m = wall::unseen_m(&planner).or(wall::worst(&planner, &places).map(|place| place.arc_m));
        let shown_m = empty_m(worst_m.unwrap());
        assert!(around_m.max(shown_m) <= 1.001 * t_m, "{arguments}: {around_m} {shown_m} of {t_m}");
        // With a steep helix, whose turns are far apart, the largest gap is clearly smaller than the spacing T.
        assert!(shown_m > 0.75 * t_m, "{arguments}: {shown_m} of {t_m}");
        assert!(shown_m > 0.97 * around_m, "{arguments}: {shown_m} of {around_m} elsewhere");
    }
}

/// Names of the modes that meet a target. `words` makes the text about each mode's speed.
fn met(inspection: Inspection, target_m: f64, words: impl Fn(f64) -> String) -> Vec<String> {
    let planner = Planner::new(inspection).unwrap();
    let speed = |mode| Some((modes::name(&planner, mode), planner.v_max_mps(mode, target_m).ok()?));
    let met = (0..planner.modes().len()).filter_map(speed);
    met.map(|(name, v_mps)| format!("{name}: {}", words(v_mps))).collect()
}

#[test]
fn speed_chart_names_every_mode_and_its_speed() {
    let svg = draw(inspection(VITA_2), FAST, 0.115, TARGET, "speeds");
    let modes = met(inspection(VITA_2), 0.5, |v_mps| format!("{} m/s", modes::speed(v_mps)));
    assert_eq!(modes.len(), 5);
    for mode in &modes {
        says(&svg, &[mode]);
    }
    says(&svg, &["target 0.5 m", "at most, to meet"]);
    silent(&svg, &["required", "never"]);
    let svg = draw(inspection(VITA_2), FAST, 0.1, SPEED, "speeds");
    says(&svg, &["required: 0.100 m/s", "MEDIUM"]);
    silent(&svg, &["target"]);
}

#[test]
fn duration_chart_marks_the_best_mode_and_the_available_time() {
    let svg = draw(inspection(VITA_2), FAST, 0.115, TARGET, "hours");
    let modes = met(inspection(VITA_2), 0.5, |v_mps| format!("{} h", modes::hours(7000.0 / v_mps / 3600.0)));
    for mode in &modes {
        says(&svg, &[mode]);
    }
    let planner = Planner::new(inspection(VITA_2)).unwrap();
    let best = planner.answers(&TARGET, None).unwrap().into_iter().find(|answer| answer.best).unwrap();
    let (hours, speed) = (modes::hours(best.needed_h.unwrap()), modes::speed(best.v_max_mps.unwrap()));
    says(
        &svg,
        &[&format!("{}: {hours} h at {speed} m/s", best.mode.to_uppercase()), "Hours for 7000 m, one way"],
    );
    let day = Question { time_s: Some(20.0 * 3600.0), ..TARGET };
    says(&draw(inspection(VITA_2), FAST, 0.097, day, "hours"), &["required: 20.0 h", "20 h required"]);
}

/// Checks that the hours and speeds of the table equal those in labels and curves, position errors included.
fn compare(planner: &Planner, target_m: f64, title: &str) {
    let question = Question { target_m: Some(target_m), ..Question::default() };
    let answers = planner.answers(&question, None).unwrap();
    let fastest = answers.iter().position(|answer| answer.best);
    let (number, speed_mps) = fastest.map_or((0, 0.1), |k| (k, answers[k].v_max_mps.unwrap()));
    let shown = Shown { planner, mode: number, speed_mps, question, title: title.to_owned() };
    let (hours_svg, speeds_svg) = (hours(&shown).unwrap(), speeds(&shown).unwrap());
    for (mode, answer) in modes::all(&shown).unwrap().iter().zip(&answers).filter(|(mode, _)| !mode.blind) {
        let name = format!("{title}, target {target_m} m, {}", mode.name);
        // The first curve has no point at the target, so the line between the neighbouring points is compared.
        let most_m = 2.2 * target_m;
        let by_hours = hours::curve(&shown, mode, most_m, f64::INFINITY);
        let by_speeds = speeds::curve(&shown, mode, most_m).into_iter().map(|[v_mps, t_m]| [t_m, v_mps]);
        let drawn_h = advised::at(&by_hours, target_m);
        let drawn_mps = advised::at(&by_speeds.collect::<Vec<_>>(), target_m);
        let (Some(needed_h), Some(v_max_mps)) = (answer.needed_h, answer.v_max_mps) else {
            assert_eq!((drawn_h, drawn_mps), (None, None), "{name}");
            says(&hours_svg, &[&format!("{}: never", mode.name)]);
            continue;
        };
        let (drawn_h, drawn_mps) = (drawn_h.unwrap(), drawn_mps.unwrap());
        assert!((drawn_h / needed_h - 1.0).abs() < 0.01, "{name}: {drawn_h} h drawn, {needed_h} h needed");
        assert!((drawn_mps / v_max_mps - 1.0).abs() < 0.01, "{name}: {drawn_mps} drawn, {v_max_mps} planned");
        says(&hours_svg, &[&format!("{}: {} h", mode.name, modes::hours(needed_h))]);
        says(&speeds_svg, &[&format!("{}: {} m/s", mode.name, modes::speed(v_max_mps))]);
    }
}

#[test]
fn labels_and_curves_agree_with_the_table_for_every_mode_of_the_shipped_vehicles() {
    let files = std::fs::read_dir("deploy/vehicles").unwrap().map(|file| file.unwrap().path());
    let mut vehicles = 0;
    for file in files.filter(|file| file.extension().is_some_and(|name| name == "toml")) {
        let Case { inspection, question, errors, .. } = case(&format!("--vehicle {}", file.display()));
        let planner = Planner::new(inspection).unwrap().with_errors(errors);
        for target_m in [question.target_m.unwrap(), 0.5] {
            compare(&planner, target_m, &file.display().to_string());
        }
        vehicles += 1;
    }
    assert!(vehicles >= 7, "{vehicles} vehicles");
}

#[test]
fn duration_chart_without_a_target_uses_the_spacing_at_the_requested_speed() {
    let planner = Planner::new(inspection(VITA_2)).unwrap();
    let finest = planner.answers(&SPEED, None).unwrap().iter().position(|answer| answer.best).unwrap();
    let svg = draw(inspection(VITA_2), finest, 0.1, SPEED, "hours");
    let name = modes::name(&planner, finest);
    says(&svg, &["m, at the required speed", "19.4 h at the", &format!("{name}: 19.4 h at 0.100 m/s")]);
}

#[test]
fn charts_label_modes_that_miss_the_target() {
    // In the corners, the angular step of the mode FASTEST alone gives a larger spacing T than this target.
    let coarse = Question { target_m: Some(0.4), ..TARGET };
    for name in ["speeds", "hours"] {
        let svg = draw(inspection(VITA_2), FAST, 0.08, coarse, name);
        says(&svg, &["FASTEST: never"]);
        silent(&svg, &["FASTER: never"]);
    }
    let tiny = Question { target_m: Some(0.02), ..TARGET };
    for name in ["speeds", "hours"] {
        says(&draw(inspection(ONE), FAST, 0.1, tiny, name), &["target 0.02 m: no mode meets it"]);
    }
}

#[test]
fn charts_without_visible_wall_have_text_in_place_of_curves() {
    let words = [
        "No head sees the wall anywhere",
        "No head sees part of the wall",
        "seen by no head",
        "seen by no head",
    ];
    for ((name, _), words) in PICTURES.iter().zip(words) {
        for question in [TARGET, SPEED] {
            says(&draw(walled_in(true), FAST, 0.1, question, name), &[words]);
        }
        draw(walled_in(false), FAST, 0.1, TARGET, name);
    }
}

#[test]
fn charts_of_small_pipes_large_tunnels_and_many_heads_are_valid() {
    let asked = Question { speed_mps: Some(0.3), ..TARGET };
    for (name, _) in PICTURES {
        for heads in [1, 8] {
            draw(inspection(&format!("--tunnel circle,radius_m=0.5 --heads {heads}")), 4, 0.3, asked, name);
            let large = format!("--tunnel circle,radius_m=20 --range 50 --heads {heads}");
            draw(inspection(&large), 0, 0.05, TARGET, name);
            let drifting = inspection(&format!("{large} --drift 2 --yaw 11"));
            let svg = draw(drifting, FAST, 0.25, TARGET, name);
            assert!(name != "perimeter" || svg.contains("with 2 m of drift and 11° of yaw"));
        }
        draw(inspection("--tunnel ceran --heads 8 --layout sector_offset"), FAST, 0.1, TARGET, name);
        draw(inspection("--tunnel rectangle,width_m=12,height_m=0.8 --heads 3"), FAST, 0.1, TARGET, name);
    }
}

#[test]
fn charts_at_extreme_speeds_are_valid() {
    for speed_mps in [0.002, 5.0] {
        for (name, _) in PICTURES {
            let asked = Question { speed_mps: Some(speed_mps), ..Question::default() };
            draw(inspection(VITA_2), FAST, speed_mps, asked, name);
        }
    }
}
