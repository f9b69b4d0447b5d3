//! A recorded trajectory: a file with one line per timestamp.

use headrace_geometry::math;

use super::knots::{Knots, Offsets};
use super::waypoints::through;

/// Interval of the knots, s. The spline smooths the recording over four such intervals.
const SPACING_S: f64 = 0.1;
/// Maximum duration of a recorded trajectory, s. It is two days.
const MAX_S: f64 = 172_800.0;

/// A recorded pose with its time, s.
type Timed = (f64, Offsets);

/// Reads lines `t_s,chainage_m,y_m,z_m[,roll_deg,pitch_deg,yaw_deg]`; returns the poses. Times count from the first
/// pose.
///
/// Lines that begin with # and a header line are skipped. Times must increase. Angles are unwrapped.
///
/// Errors, as text with the line number: a line is invalid.
pub(super) fn parse(text: &str) -> Result<Vec<Timed>, String> {
    let mut begun = false;
    let mut timed: Vec<Timed> = Vec::new();
    for (number, line) in text.lines().enumerate() {
        let line = line.trim();
        if line.is_empty() || line.starts_with('#') {
            continue;
        }
        let first = !std::mem::replace(&mut begun, true);
        let Some((at_s, mut place)) = fields(line) else {
            if first {
                continue;
            }
            let wanted = "t_s,chainage_m,y_m,z_m and, if known, roll_deg,pitch_deg,yaw_deg";
            let start: String = line.chars().take(60).collect();
            return Err(format!("line {} of it is {start:?}; expected {wanted}", number + 1));
        };
        if timed.last().is_some_and(|(before_s, _)| at_s <= *before_s) {
            return Err(format!(
                "line {} has the time {at_s} s, which is not after the previous time",
                number + 1
            ));
        }
        if let Some((_, before)) = timed.last() {
            turn_short(before, &mut place);
        }
        timed.push((at_s, place));
    }
    let (Some((first_s, _)), Some((last_s, _))) = (timed.first().copied(), timed.last().copied()) else {
        return Err("has no line with a position".to_owned());
    };
    let duration_s = last_s - first_s;
    if !(duration_s > 0.0 && duration_s <= MAX_S) {
        return Err(format!("takes {duration_s} s; it must be above 0 and at most {MAX_S} s"));
    }
    for (at_s, _) in &mut timed {
        *at_s -= first_s;
    }
    Ok(timed)
}

/// Knots of a trajectory through recorded poses, and its duration, s.
pub(super) fn knots(timed: &[Timed]) -> (Knots, f64) {
    let duration_s = timed.last().map_or(0.0, |(last_s, _)| *last_s);
    (through(timed, SPACING_S, duration_s), duration_s)
}

/// Unwraps each new angle to within half a turn of the previous one. After 179 degrees, -179 degrees becomes 181.
fn turn_short([.., roll, pitch, yaw]: &Offsets, [.., new_roll, new_pitch, new_yaw]: &mut Offsets) {
    for (before, angle) in [(roll, new_roll), (pitch, new_pitch), (yaw, new_yaw)] {
        *angle = before + math::wrap_signed(*angle - before, math::TAU);
    }
}

fn fields(line: &str) -> Option<Timed> {
    let numbers: Option<Vec<f64>> =
        line.split(',').map(|field| field.trim().parse().ok().filter(|n: &f64| n.is_finite())).collect();
    match *numbers?.as_slice() {
        [t, x, y, z] => Some((t, [x, y, z, 0.0, 0.0, 0.0])),
        [t, x, y, z, roll, pitch, yaw] => {
            Some((t, [x, y, z, roll.to_radians(), pitch.to_radians(), yaw.to_radians()]))
        }
        _ => None,
    }
}
