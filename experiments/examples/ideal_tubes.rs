//! The paper's §8.2 without a dive: ideal heads in a straight tunnel, the surface through their samples, and its distance
//! from the design. `cargo run --release -p headrace_experiments --example ideal_tubes -- [depth] [heads...]`

use std::error::Error;

use headrace_core::math::{self, PI, TAU};
use headrace_core::tunnel::{Profile, named};
use headrace_experiments::surface::chart::{Chart, Deviation};
use headrace_experiments::surface::poisson::{Settings, Surface};
use headrace_experiments::surface::wall::{self, Stretch};
use headrace_experiments::surface::{MeshIndex, Sample, Spread, Xyz, normals};

const LENGTH_M: f64 = 130.0;
const SPEED_MPS: f64 = 0.197;
/// SLOW: 0.3 degrees a ping, 55.55 pings a second.
const PINGS_A_TURN: f64 = 1200.0;
const PINGS_A_SECOND: f64 = 55.55;
/// Between the forward and the backward heads (§8.2), m.
const APART_M: f64 = 1.102;
const INNER: Stretch = Stretch { from_m: 15.0, to_m: 115.0, step_m: 0.1 };

#[derive(Debug, Clone, Copy, PartialEq)]
enum Way {
    Phase,
    Sector,
}

/// Angle of a head whose `turns` were counted from where its pattern begins.
fn angle(way: Way, turns: f64, head: usize, heads: usize) -> f64 {
    match way {
        Way::Phase => TAU * turns,
        Way::Sector => {
            let sector = 1.0 / heads as f64;
            let folded = math::wrap(turns, 2.0 * sector);
            TAU * (head as f64 * sector + folded.min(2.0 * sector - folded))
        }
    }
}

/// Samples of heads that sit on the tunnel's axis. With `shift_turns` a head after the first begins its pattern so much
/// later than aligned.
fn samples(profile: &Profile, way: Way, heads: usize, shift_turns: f64) -> Vec<Xyz> {
    let step_m = SPEED_MPS / PINGS_A_SECOND;
    let pings = math::floor_to_i64(LENGTH_M / step_m);
    let centre = profile.reference();
    let mut places = Vec::new();
    for head in 0..heads {
        let back_m = if head < heads / 2 { 0.0 } else { APART_M };
        for ping in 0..pings {
            let x_m = ping as f64 * step_m - back_m;
            // Aligned by chainage: at one chainage the heads are evenly apart.
            let share = if way == Way::Phase { head as f64 / heads as f64 } else { 0.0 };
            let turns = x_m / (step_m * PINGS_A_TURN) + share + shift_turns * head as f64;
            let (sin, cos) = math::sin_cos(angle(way, turns, head, heads) - PI / 2.0);
            if let Some(hit) = profile.cast_from_inside(centre, [cos, sin])
                && x_m >= 0.0
            {
                places.push([x_m, hit.point[0], hit.point[1]]);
            }
        }
    }
    places
}

fn show(spread: Spread) -> String {
    format!("{:.4} ({:.4}) max {:.3}", spread.mean_m, spread.sd_m, spread.max_m)
}

fn report(
    profile: &Profile,
    what: &str,
    cloud: &[Sample],
    settings: &Settings,
) -> Result<(), Box<dyn Error>> {
    let surface = Surface::through(cloud, settings)?;
    let mesh = surface.mesh();
    let index = MeshIndex::new(&mesh, surface.cell_m() / 2.0).ok_or("no surface")?;
    let from_wall = wall::from_wall(profile, &index, &INNER, |_, _| 0.0);
    let to_design = wall::to_design(profile, &mesh, &INNER);
    let (steps, residual) = surface.convergence();
    println!(
        "{what}: wall to surface {}; surface to wall {}; {} samples, {} nodes of {:.3} m, {steps} steps to {residual:.1e}",
        show(from_wall),
        show(to_design),
        cloud.len(),
        surface.nodes(),
        surface.cell_m(),
    );
    Ok(())
}

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<u32> = std::env::args().skip(1).map(|a| a.parse()).collect::<Result<_, _>>()?;
    let depth = arguments.first().copied().unwrap_or(8);
    let heads = arguments.get(1..).filter(|h| !h.is_empty()).unwrap_or(&[2]);
    let mut settings = Settings::of_paper();
    settings.depth = depth;
    let profile = named::ceran_blueprint()?;
    for heads in heads {
        for way in [Way::Phase, Way::Sector] {
            for shift_turns in [0.0, 0.26, 0.41] {
                let places = samples(&profile, way, *heads as usize, shift_turns);
                let what = format!("{heads} heads, {way:?}, {shift_turns} turns off");
                let axis = normals::towards_axis(&profile, &places);
                report(&profile, &format!("{what}, normals to axis"), &axis, &settings)?;
                let design = normals::of_design(&profile, &places);
                report(&profile, &format!("{what}, normals of design"), &design, &settings)?;
                let deviations: Vec<_> = places.iter().map(|p| Deviation::of(&profile, *p)).collect();
                let chart = Chart::new(profile.perimeter_m(), &deviations)?.compare(&INNER, |_, _| 0.0);
                println!("{what}, chart: {}, {} uncovered", show(chart.spread), chart.uncovered);
            }
        }
    }
    Ok(())
}
