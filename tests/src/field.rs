//! The scene `vita1-field` with navigation settings that match its sensor errors, and the errors of the estimated
//! trajectory.

use headrace_fusion::Fix;
use headrace_geometry::frames::{Tunnel, Vec3};
use headrace_geometry::math;
use headrace_geometry::time::MonoNs;
use headrace_simulator::Scene;
use nalgebra::{SMatrix, SVector};

use crate::scenes;
use crate::tracking::{self, Track};

/// Time of a head's turn in mode SLOW, s.
pub const TURN_S: f64 = 21.6;

/// Root mean squares of the navigation errors in a dive.
#[derive(Debug, Default, Clone, Copy)]
pub struct Figures {
    /// Position error across the tunnel, m.
    pub across_m: f64,
    /// Vertical position error, m.
    pub up_m: f64,
    /// Chainage error, m.
    pub along_m: f64,
    /// Error of the estimated displacement of the vehicle during one turn of a head, m.
    pub turn_m: f64,
    /// Reported standard deviation of the displacement during one turn of a head, m.
    pub turn_arc_m: f64,
    /// Heading error, degrees.
    pub yaw_deg: f64,
    /// Errors of roll and pitch together, degrees.
    pub tilt_deg: f64,
    /// Fraction of pings with a position fix, 0 to 1.
    pub fixed: f64,
}

/// Root mean square of the values; 0 without values.
pub fn rms(values: impl IntoIterator<Item = f64>) -> f64 {
    let (mut n, mut sum) = (0.0, 0.0);
    for value in values {
        n += 1.0;
        sum += value * value;
    }
    math::sqrt(sum / f64::max(n, 1.0))
}

/// Errors of a dive's position fixes against the truth.
pub fn figures(track: &Track) -> Figures {
    let known: Vec<_> = track.fixes.iter().filter_map(|t| Some((t.at, t.fix.ok()?, t.truth))).collect();
    let off: Vec<Vec3<Tunnel>> =
        known.iter().map(|(_, fix, truth)| fix.pose.position - truth.position).collect();
    let turned = known.iter().map(|(_, fix, truth)| fix.pose.attitude * truth.attitude.inverse());
    let turned: Vec<_> = turned.map(|off| off.roll_pitch_yaw()).collect();
    let turns =
        turns(&known.iter().map(|(at, fix, truth)| (*at, *fix, truth.position.x())).collect::<Vec<_>>());
    Figures {
        across_m: rms(off.iter().map(Vec3::y)),
        up_m: rms(off.iter().map(Vec3::z)),
        along_m: rms(off.iter().map(Vec3::x)),
        turn_m: rms(turns.iter().map(|(error, _)| *error)),
        turn_arc_m: rms(turns.iter().map(|(_, sigma)| *sigma)),
        yaw_deg: rms(turned.iter().map(|(_, _, yaw)| yaw.to_degrees())),
        tilt_deg: rms(turned.iter().map(|(roll, pitch, _)| math::hypot(*roll, *pitch).to_degrees())),
        fixed: known.len() as f64 / track.fixes.len() as f64,
    }
}

/// Errors, along the tunnel, of the vehicle's estimated displacement during one turn of a head, m. Each error comes
/// with its reported standard deviation.
pub fn turns(known: &[(MonoNs, Fix, f64)]) -> Vec<(f64, f64)> {
    let mut before = 0;
    let mut turns = Vec::new();
    for (at, fix, x_m) in known {
        while at.since(known[before].0).as_secs_f64() > TURN_S {
            before += 1;
        }
        if before > 0 {
            let (_, then, x_then_m) = &known[before];
            let moved_m = fix.pose.position.x() - then.pose.position.x();
            turns.push((moved_m - (x_m - x_then_m), fix.relative.sd_m(Vec3::zero())));
        }
    }
    turns
}

/// Settings that match the field scene's sensor effects.
///
/// In this scene the echosounders' beams are rays, not cones. The settings state the rounding of cable and depth as
/// noise.
pub const SETTINGS: &str = "[navigation]
gyro_noise_degps_rthz = 0.007
accel_noise_mps2_rthz = 0.001
accel_bias_mps2 = 0.02
accel_bias_time_s = 300
gyro_bias_degps = 0.2
gyro_bias_time_s = 300
tether_sd_m = 0.003
tether_scale_sd = 1e-4
slack_sd_m = 0.085
slack_time_s = 15
deviation_deg = 5
depth_sd_m = 0.009
heading_sd_deg = 0.3
tilt_sd_deg = 0.3
echo_sd_m = 0.02
echo_beam_deg = 0.1
return_sd_m = 0.011

[heads]";

/// The scene `vita1-field`, shortened to `length_m`.
pub fn field(seed: u64, length_m: f64) -> Scene {
    field_with(seed, length_m, SETTINGS, "")
}

/// The field scene with the `[navigation]` settings `settings`, and with the text `without` removed.
pub fn field_with(seed: u64, length_m: f64, settings: &str, without: &str) -> Scene {
    let scene = include_str!("../../deploy/scenes/vita1-field.toml");
    let length = format!("distance_m = {length_m}");
    let planned = scene.replace("speed_mps = 0.16", "speed_mps = 0.197");
    let shorter =
        planned.replace("distance_m = 130", &length).replace("../vehicles/", "").replace(without, "");
    assert!(shorter.contains(&length) && planned != scene && scene.contains(without));
    let load = |name: &str| {
        let text = String::from_utf8(scenes::vehicle_file(name)?).map_err(|error| error.to_string())?;
        // These settings replace the vehicle's own `[navigation]` table.
        let own = text.find("[navigation]").filter(|_| settings.starts_with("[navigation]"));
        let (before, heads) = text.split_at(text.find("[heads]").ok_or("no heads")?);
        let before = own.map_or(before, |from| &before[..from]);
        Ok((before.to_owned() + &heads.replacen("[heads]", settings, 1)).into_bytes())
    };
    scenes::seeded(&shorter, &load, Some(seed))
}

/// Indices of the pose's six degrees of freedom in the filter's error state.
pub const POSE: [usize; 6] = [0, 1, 2, 6, 7, 8];

/// Normalised estimation error squared (NEES) of the pose.
pub fn nees(epoch: &tracking::Epoch) -> f64 {
    let covariance = SMatrix::<f64, 6, 6>::from_fn(|i, j| epoch.factors.covariance(POSE[i], POSE[j]));
    let error = SVector::<f64, 6>::from_fn(|i, _| epoch.errors[POSE[i]]);
    error.dot(&covariance.cholesky().unwrap().solve(&error))
}

/// Fraction of values that are true, 0 to 1; 0 without values.
pub fn share(of: impl Iterator<Item = bool>) -> f64 {
    let (mut n, mut yes) = (0.0, 0.0);
    for is in of {
        n += 1.0;
        yes += f64::from(u8::from(is));
    }
    yes / f64::max(n, 1.0)
}
