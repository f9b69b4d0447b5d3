//! Checks the oracle of true holes, D_true, against other computations.

use headrace_coverage::Verdict;
use headrace_geometry::math;
use headrace_geometry::tunnel::{Profile, shapes};
use headrace_oracle::outline::Outline;
use headrace_oracle::wall::Place;
use headrace_tests::scenes;
use headrace_tests::truth::{self, JudgedDive, Truth};

const EFFECTS: &str = "motion_within_turn = {}\nocclusion = {}\nrange_noise = { sd_m = 0.01 }\n";

fn dive(start_m: f64, effects: &str) -> JudgedDive {
    truth::dive(&scenes::scene(&format!(
        "vehicle = \"vita2-4.toml\"\n[trajectory]\nstart_m = {start_m}\n[[trajectory.legs]]\ndistance_m = 3\n\
         speed_mps = 0.11\n[effects]\n{effects}"
    )))
}

/// Samples sorted into strips of chainage, for a search that doesn't use the oracle's method, a triangulation.
struct Strips<'a> {
    truth: &'a Truth,
    from_m: f64,
    strips: Vec<Vec<Place>>,
}

const STRIP_M: f64 = 0.5;

impl<'a> Strips<'a> {
    fn of(truth: &'a Truth) -> Self {
        let xs = || truth.samples.iter().map(|sample| sample.place[0]);
        let from_m = xs().fold(f64::INFINITY, f64::min);
        let mut strips = vec![Vec::new(); 1 + strip(from_m, xs().fold(from_m, f64::max))];
        for sample in &truth.samples {
            strips[strip(from_m, sample.place[0])].push(sample.place);
        }
        Self { truth, from_m, strips }
    }

    fn clear_m(&self, [x_m, arc_m]: Place) -> f64 {
        let mut nearest_m = f64::INFINITY;
        for (k, strip) in self.strips.iter().enumerate() {
            let begins_m = self.from_m + k as f64 * STRIP_M;
            if begins_m - x_m < nearest_m && x_m - begins_m - STRIP_M < nearest_m {
                for place in strip {
                    let across_m = math::wrap_signed(place[1] - arc_m, self.truth.perimeter_m);
                    nearest_m = nearest_m.min(math::hypot(place[0] - x_m, across_m));
                }
            }
        }
        nearest_m
    }
}

fn strip(from_m: f64, x_m: f64) -> usize {
    usize::try_from(math::floor_to_i64((x_m - from_m) / STRIP_M)).unwrap()
}

#[test]
fn true_holes_match_a_fine_grid() {
    let dive = dive(16.0, EFFECTS);
    let strips = Strips::of(&dive.truth);
    let (along, around) = (5_u32, 720_u32);
    let mut judged = 0;
    // The dive's ends are left out. They are far from all samples, so the grid search takes too long there.
    for section in dive.sections.iter().filter(|section| section.true_hole_m < 1.5) {
        let [from_m, to_m] = [section.report.start_m, section.report.end_m].map(|x_m| x_m + section.shift_m);
        let place = |i: u32, j: u32| {
            [
                from_m + (to_m - from_m) * f64::from(i) / f64::from(along),
                dive.truth.perimeter_m * f64::from(j) / f64::from(around),
            ]
        };
        let grid_m = (0..=along).flat_map(|i| (0..around).map(move |j| place(i, j)));
        let grid_m = grid_m.map(|at| 2.0 * strips.clear_m(at)).fold(0.0, f64::max);
        // From a point to the nearest grid point, the diameter of the empty circle changes by at most twice the
        // distance.
        let off_m =
            math::hypot((to_m - from_m) / f64::from(along), dive.truth.perimeter_m / f64::from(around));
        let short_m = section.true_hole_m - grid_m;
        assert!((-1e-9..=off_m).contains(&short_m), "{}: {short_m}", section.report.start_m);
        judged += 1;
    }
    assert!(judged >= 8, "{judged}");
}

#[test]
fn outline_arc_lengths_match_the_profile() {
    let arrow = [[-2.0, 0.0], [3.0, 0.5], [2.5, 3.0], [0.3, 4.0], [-2.5, 2.0]];
    let profiles = [
        shapes::ceran().unwrap(),
        shapes::circle(1.2).unwrap(),
        shapes::rectangle(4.0, 3.0).unwrap(),
        shapes::arch(4.0, 4.0, 2.5).unwrap(),
        Profile::polygon(&arrow, None).unwrap(),
    ];
    for profile in profiles {
        let outline = Outline::of(&profile);
        for k in 0..5_000 {
            // The tested points lie inside and outside the wall, all around it.
            let off_m = 0.3 + 1.5 * math::wrap(0.37 * f64::from(k), 1.0);
            let [y, z] = profile.point_at(0.618 * profile.perimeter_m() * f64::from(k));
            let [y0, z0] = profile.reference();
            let at = [y0 + off_m * (y - y0), z0 + off_m * (z - z0)];
            let differs_m = outline.arc_m(at) - profile.arc_of(at);
            let differs_m = math::wrap_signed(differs_m, profile.perimeter_m());
            assert!(differs_m.abs() < 1e-5, "{at:?}: {differs_m} m");
        }
    }
}

/// Whether a section can be judged in this test.
///
/// It must be at least 1.5 m beyond the start, because the position estimate has converged by then. Its true hole must
/// be below 0.7 m, because larger holes occur only at the end of the dive.
fn settled(section: &truth::JudgedSection, start_m: f64) -> bool {
    settled_below(section, start_m, 0.7)
}

/// Whether a section can be judged as in [`settled`], but with the limit `hole_m` for the true hole.
fn settled_below(section: &truth::JudgedSection, start_m: f64, hole_m: f64) -> bool {
    section.report.start_m > start_m + 1.5 && section.true_hole_m < hole_m
}

/// Without errors, reported holes equal true holes, wherever the dive begins.
#[test]
fn ideal_dive_reports_true_holes() {
    for start_m in [16.0, 6900.0] {
        let dive = dive(start_m, "motion_within_turn = {}\n");
        let inner: Vec<_> = dive.sections.iter().filter(|section| settled(section, start_m)).collect();
        assert!(inner.len() >= 5, "{}", inner.len());
        for section in inner {
            let off_m = section.report.hole_m.unwrap() - section.true_hole_m;
            assert!(off_m.abs() < 0.03, "{start_m}: {} {off_m}", section.report.start_m);
            assert!(section.shift_m.abs() < 0.05, "{start_m}: {}", section.shift_m);
        }
    }
}

#[test]
fn oracle_takes_only_returns_from_the_wall_as_samples() {
    let count = |effects: &str| dive(16.0, effects).truth.samples.len() as f64;
    let all = count("motion_within_turn = {}\n");
    for (effect, least, most) in [
        ("missing_returns = { share = 0.2 }", 0.75, 0.85),
        ("outliers = { share = 0.2, sensors = [\"sonar_0\"] }", 0.93, 0.97),
        ("range_noise = { sd_m = 0.02 }", 0.999, 1.001),
        ("sound_speed_error = { share = 0.04 }", 0.999, 1.001),
        ("byte_errors = { flipped_per_million = 1000 }", 0.6, 0.999),
    ] {
        let share = count(&format!("motion_within_turn = {{}}\n{effect}\n")) / all;
        assert!((least..=most).contains(&share), "{effect}: {share}");
    }
}

/// A wrong cable count shifts a section along the tunnel. The section's true hole is searched on the shifted stretch.
#[test]
fn true_holes_are_searched_at_the_shifted_chainage_of_a_section() {
    let effects = "motion_within_turn = {}\ntether_slack = { reach_m = 0.4, period_s = 400 }\n";
    let dive = dive(16.0, effects);
    let most_m = dive.sections.iter().map(|section| section.shift_m.abs()).fold(0.0, f64::max);
    assert!((0.02..0.5).contains(&most_m), "{most_m}");
    for section in dive.sections.iter().filter(|section| settled(section, 16.0)) {
        let off_m = section.report.hole_m.unwrap() - section.true_hole_m;
        assert!(off_m.abs() < 0.15, "{} {off_m}", section.report.start_m);
    }
}

/// The vehicle hides a part of the wall. Heads with a minimum range of 10 cm receive echoes from the vehicle itself,
/// which fill no hole.
#[test]
fn no_section_passes_because_of_echoes_from_the_vehicle() {
    let load = |name: &str| {
        let text = String::from_utf8(scenes::vehicle_file(name)?).unwrap();
        let near = text.replace("min_range_m = 0.5", "min_range_m = 0.1");
        assert_ne!(text, near);
        Ok(near.into_bytes())
    };
    let scene = scenes::scene_from(
        "vehicle = \"vita2-4.toml\"\n[vehicle_changes]\ntarget_m = 0.5\n\
         [trajectory]\nstart_m = 16\n[[trajectory.legs]]\ndistance_m = 4\nspeed_mps = 0.11\n\
         [effects]\nmotion_within_turn = {}\nocclusion = {}\n",
        &load,
    );
    let dive = truth::dive(&scene);
    let occluded = dive.report.dive.samples_rejected.occluded;
    assert!(occluded > 200, "{occluded} echoes of the vehicle");
    for section in &dive.sections {
        let (hole_m, start_m) = (section.true_hole_m, section.report.start_m);
        assert!(
            section.report.verdict != Verdict::Pass || hole_m <= 1.1 * 0.5,
            "{start_m}: passed with {hole_m} m"
        );
        if settled_below(section, 16.0, 1.5) {
            let off_m = section.report.hole_m.unwrap() - hole_m;
            assert!(off_m.abs() < 0.05, "{start_m}: {off_m}");
        }
    }
}
