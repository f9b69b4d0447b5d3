//! Sampling theory alone: sample spacing in the paper's tunnel, and the speed that a target of 0.5 m allows.
//!
//! It prints both for one to four heads in FAST mode. Run: `cargo run --example sampling_theory`

use std::error::Error;

use headrace_geometry::frames::{Mount, Point3, Pose, Rot, Vec3};
use headrace_geometry::math::PI;
use headrace_geometry::tunnel::shapes;
use headrace_sampling::head::Turn;
use headrace_sampling::ring::{Ring, Standing};
use headrace_sampling::spacing::{Spiral, speed_for_target_mps};

/// The vehicle's speed in the paper, m/s.
const SPEED_MPS: f64 = 0.197;
const TARGET_M: f64 = 0.5;
/// Number of rays cast per step. Rays between the pings show the largest step for any phase of the pings.
const PER_STEP: u32 = 10;

fn main() -> Result<(), Box<dyn Error>> {
    let tunnel = shapes::ceran()?;
    // Mode FAST: steps of 0.9 degrees, 8 s per turn.
    let fast = Turn::new(0.9_f64.to_radians(), 8.0)?;

    // The vehicle's position is halfway between floor and crown, and the vehicle looks along the tunnel.
    let at = |z_m| {
        let pose = Pose { position: Point3::new(0.0, 0.0, z_m), attitude: Rot::identity() };
        Standing::new(&tunnel, &pose, &Mount { position: Vec3::zero(), rotation: Rot::identity() })
    };
    let [_, centre_m] = tunnel.reference();
    let height_m = centre_m + at(centre_m)?.sounding(PI)?.range_m();
    let ring = Ring::cast(&at(height_m / 2.0)?, 0.0, PER_STEP * fast.steps())?;
    let [_, _, t_y2_m] = ring.chords_m(PER_STEP as usize);

    println!("Ceran: perimeter {:.2} m, height {height_m:.2} m", tunnel.perimeter_m());
    println!("FAST at {SPEED_MPS} m/s: {} pings a turn of {} s", fast.steps(), fast.period_s());
    println!("heads  T_x m  T_y m    T m  speed for T = {TARGET_M} m");
    for heads in 1_u8..=4 {
        // With phase-shifted heads, each head passes each place once per turn.
        let passes = f64::from(heads);
        let spiral = Spiral::new(SPEED_MPS, fast, passes)?;
        let (t_x_m, t_y_m, t_m) = (spiral.t_x_m(), spiral.t_y_max_m(t_y2_m), spiral.t_max_m(t_y2_m));
        let speed_mps =
            speed_for_target_mps(TARGET_M, t_y2_m, fast.period_s() / passes, fast.ping_period_s());
        let speed = speed_mps.map_or_else(|| "none".to_owned(), |speed_mps| format!("{speed_mps:.3} m/s"));
        println!("{heads:>5}  {t_x_m:>5.3}  {t_y_m:>5.3}  {t_m:>5.3}  {speed}");
    }
    Ok(())
}
