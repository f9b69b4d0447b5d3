//! Reads the `[trajectory]` table of a scene.

use std::ops::RangeInclusive;

use headrace_config::{ConfigError, Loader, Section};
use headrace_geometry::tunnel::Profile;

use super::advised::{Advised, Heeding, Hurry};
use super::composed::Trajectory;
use super::knots::Offsets;
use super::legs::Leg;
use super::pilot::{Pilot, Piloted};
use super::place::Ground;
use super::recorded;
use super::waypoints::{self, Waypoint};
use crate::random::Stream;

/// Maximum distance outside the tunnel at which a dive may start or end, m.
const OUTSIDE_M: f64 = 20.0;
const CHAINAGE_M: RangeInclusive<f64> = -OUTSIDE_M..=1.0e6;
const ACROSS_M: RangeInclusive<f64> = -200.0..=200.0;
const SPEED_MPS: RangeInclusive<f64> = 0.001..=5.0;
const DEGREES: RangeInclusive<f64> = -80.0..=80.0;
const REACH_M: RangeInclusive<f64> = 0.0..=100.0;
const REACH_DEG: RangeInclusive<f64> = 0.0..=80.0;
/// Name under which trajectories draw random numbers.
const NAME: &str = "trajectory";

#[derive(Debug, Clone, Copy)]
enum TrajectoryKind {
    Legs,
    Waypoints,
    Pilot,
    Advised,
    Recorded,
}

const KINDS: [(&str, TrajectoryKind); 5] = [
    ("legs", TrajectoryKind::Legs),
    ("waypoints", TrajectoryKind::Waypoints),
    ("pilot", TrajectoryKind::Pilot),
    ("advised", TrajectoryKind::Advised),
    ("recorded", TrajectoryKind::Recorded),
];

/// Reads the trajectory of a scene. Also returns whether its speeds are relative to the water or to the tunnel.
///
/// Errors: a key is missing, unknown or out of range, or the trajectory goes beyond the ends of the tunnel.
pub(crate) fn parse(
    section: &Section<'_>,
    (design, length_m): (&Profile, f64),
    seed: u64,
    load: Loader<'_>,
) -> Result<(Trajectory, Ground), ConfigError> {
    let kind = section.choice("kind", &KINDS)?.unwrap_or(TrajectoryKind::Legs);
    let tunnel = Tunnel { design, length_m };
    let parsed = match kind {
        TrajectoryKind::Legs => (legs(section, tunnel)?, Ground::Water),
        TrajectoryKind::Waypoints => (waypoints(section, tunnel)?, Ground::Tunnel),
        TrajectoryKind::Pilot => (pilot(section, tunnel, seed)?, Ground::Water),
        TrajectoryKind::Advised => (advised(section, tunnel, seed)?, Ground::Water),
        TrajectoryKind::Recorded => (recorded(section, tunnel, load)?, Ground::Tunnel),
    };
    section.finish()?;
    Ok(parsed)
}

#[derive(Clone, Copy)]
struct Tunnel<'a> {
    design: &'a Profile,
    length_m: f64,
}

impl Tunnel<'_> {
    fn place(&self, section: &Section<'_>) -> Result<[f64; 2], ConfigError> {
        let place_m = match section.numbers("place_m", ACROSS_M)?.as_deref() {
            None => self.design.reference(),
            Some([y, z]) => [*y, *z],
            Some(_) => return Err(section.invalid("place_m", "must be two numbers [y, z]")),
        };
        if !self.design.contains(place_m) {
            return Err(section.invalid("place_m", "must be inside the tunnel's profile"));
        }
        Ok(place_m)
    }

    fn check(&self, section: &Section<'_>, key: &str, chainage_m: f64) -> Result<(), ConfigError> {
        if (-OUTSIDE_M..=self.length_m + OUTSIDE_M).contains(&chainage_m) {
            return Ok(());
        }
        let problem = format!("leads to chainage {chainage_m} m; the tunnel is {} m long", self.length_m);
        Err(section.invalid(key, &problem))
    }
}

fn legs(section: &Section<'_>, tunnel: Tunnel<'_>) -> Result<Trajectory, ConfigError> {
    let start_m = section.number("start_m", CHAINAGE_M)?.unwrap_or(0.0);
    tunnel.check(section, "start_m", start_m)?;
    let place_m = tunnel.place(section)?;
    let mut legs = Vec::new();
    let mut chainage_m = start_m;
    let tables = section.sections("legs")?;
    for (number, leg) in tables.iter().enumerate() {
        let parsed = leg.part(|| {
            let distance_m = leg.required("distance_m", leg.number("distance_m", 0.01..=1.0e6)?);
            let speed_mps = leg.required("speed_mps", leg.number("speed_mps", -5.0..=5.0)?);
            leg.finish()?;
            let problem = "must be at least 0.001 either way, or the leg has no end";
            let speed_mps = speed_mps.and_then(|speed_mps| {
                if speed_mps.abs() < 1e-3 { Err(leg.invalid("speed_mps", problem)) } else { Ok(speed_mps) }
            });
            Ok(Leg { distance_m: distance_m?, speed_mps: speed_mps? })
        })?;
        let Some(parsed) = parsed else { continue };
        legs.push(parsed);
        chainage_m += parsed.distance_m * parsed.speed_mps.signum();
        // The end of a leg is known only if this leg and all previous legs are valid.
        if legs.len() == number + 1 {
            tunnel.check(leg, "distance_m", chainage_m)?;
        }
    }
    if tables.is_empty() {
        let problem = "has no leg; at least one table headed [[trajectory.legs]] is needed";
        return Err(section.invalid("legs", problem));
    }
    Ok(Trajectory::of_legs(start_m, place_m, legs))
}

fn waypoints(section: &Section<'_>, tunnel: Tunnel<'_>) -> Result<Trajectory, ConfigError> {
    let mut points = Vec::new();
    for point in section.sections("waypoints")? {
        let chainage_m = point.required("chainage_m", point.number("chainage_m", CHAINAGE_M)?)?;
        tunnel.check(&point, "chainage_m", chainage_m)?;
        let [y, z] = tunnel.place(&point)?;
        let angle = |key| point.number(key, DEGREES).map(|deg| deg.unwrap_or(0.0).to_radians());
        let (roll, pitch, yaw) = (angle("roll_deg")?, angle("pitch_deg")?, angle("yaw_deg")?);
        let stay_s = point.number("stay_s", 0.0..=1.0e5)?.unwrap_or(0.0);
        let speed = point.number("speed_mps", SPEED_MPS)?;
        let speed_mps =
            if points.is_empty() { speed.unwrap_or(1.0) } else { point.required("speed_mps", speed)? };
        point.finish()?;
        points.push(Waypoint { at: [chainage_m, y, z, roll, pitch, yaw], speed_mps, stay_s });
    }
    let (knots, duration_s) = waypoints::knots(&points);
    if points.is_empty() || duration_s <= 0.0 {
        let problem = "do not move; give at least two different positions, or one with stay_s";
        return Err(section.invalid("waypoints", problem));
    }
    Ok(Trajectory::of_knots(knots, duration_s))
}

fn pilot(section: &Section<'_>, tunnel: Tunnel<'_>, seed: u64) -> Result<Trajectory, ConfigError> {
    let or = |key, allowed, usual: f64| section.number(key, allowed).map(|value| value.unwrap_or(usual));
    let pair = |key, allowed: RangeInclusive<f64>, usual: [f64; 2]| -> Result<[f64; 2], ConfigError> {
        match section.numbers(key, allowed)?.as_deref() {
            None => Ok(usual),
            Some([least, most]) if least <= most => Ok([*least, *most]),
            Some(_) => Err(section.invalid(key, "must be two numbers [least, most]")),
        }
    };
    let from_m = or("start_m", CHAINAGE_M, 0.0)?;
    tunnel.check(section, "start_m", from_m)?;
    let to_m = section.required("to_m", section.number("to_m", CHAINAGE_M)?)?;
    tunnel.check(section, "to_m", to_m)?;
    if (to_m - from_m).abs() < 0.1 {
        return Err(section.invalid("to_m", "must be at least 0.1 m from start_m"));
    }
    let pilot = Pilot {
        from_m,
        to_m,
        across_m: tunnel.place(section)?,
        speed_mps: section.required("speed_mps", section.number("speed_mps", SPEED_MPS)?)?,
        stops_per_hour: or("stops_per_hour", 0.0..=1000.0, 6.0)?,
        backs_per_hour: or("backs_per_hour", 0.0..=1000.0, 2.0)?,
        stop_s: pair("stop_s", 0.5..=3600.0, [5.0, 60.0])?,
        back_m: pair("back_m", 0.1..=1000.0, [0.5, 5.0])?,
        reach: wander(section, [0.5, 0.3, 5.0])?,
        period_s: or("wander_s", 1.0..=3600.0, 30.0)?,
    };
    let [stick, wander] = ["stick", "wander"].map(|source| Stream::new(seed, NAME, source));
    let piloted = Piloted::new(pilot, stick, wander).map_err(|problem| section.invalid("to_m", &problem))?;
    Ok(Trajectory::piloted(piloted))
}

/// Reads the amplitude of a pilot's drift: left and up, m; roll, pitch and yaw, radians.
///
/// The second argument has the default amplitudes: to the left and up, m, and of yaw, degrees.
fn wander(section: &Section<'_>, [left, up, yaw]: [f64; 3]) -> Result<Offsets, ConfigError> {
    let or = |key, allowed, usual: f64| section.number(key, allowed).map(|value| value.unwrap_or(usual));
    let degrees = |key, usual| or(key, REACH_DEG, usual).map(f64::to_radians);
    Ok([
        0.0,
        or("wander_across_m", REACH_M, left)?,
        or("wander_up_m", REACH_M, up)?,
        degrees("wander_roll_deg", 0.0)?,
        degrees("wander_pitch_deg", 0.0)?,
        degrees("wander_yaw_deg", yaw)?,
    ])
}

fn advised(section: &Section<'_>, tunnel: Tunnel<'_>, seed: u64) -> Result<Trajectory, ConfigError> {
    let or = |key, allowed, usual: f64| section.number(key, allowed).map(|value| value.unwrap_or(usual));
    let from_m = or("start_m", CHAINAGE_M, 0.0)?;
    tunnel.check(section, "start_m", from_m)?;
    let to_m = section.required("to_m", section.number("to_m", CHAINAGE_M)?)?;
    tunnel.check(section, "to_m", to_m)?;
    if to_m - from_m < 0.1 {
        return Err(section.invalid("to_m", "must be at least 0.1 m further in than start_m"));
    }
    let mut hurries = Vec::new();
    for hurry in section.sections("hurries")? {
        let chainage = |key| hurry.required(key, hurry.number(key, CHAINAGE_M)?);
        let speed_mps = hurry.required("speed_mps", hurry.number("speed_mps", SPEED_MPS)?)?;
        hurries.push(Hurry { from_m: chainage("from_m")?, to_m: chainage("to_m")?, speed_mps });
        hurry.finish()?;
    }
    let speed_mps = section.required("speed_mps", section.number("speed_mps", SPEED_MPS)?)?;
    let pilot = Heeding {
        from_m,
        to_m,
        across_m: tunnel.place(section)?,
        speed_mps,
        lag_s: or("lag_s", 3.0..=60.0, 3.0)?,
        within: or("within", 0.0..=0.5, 0.05)?,
        goes_back: section.boolean("goes_back")?.unwrap_or(true),
        stops_if_advised: section.boolean("stands")?.unwrap_or(false),
        waits_s: or("waits_s", 0.0..=3600.0, 0.0)?,
        hurries,
        at_most_s: or("at_most_s", 1.0..=1.0e6, 600.0 + 5.0 * (to_m - from_m) / speed_mps)?,
        reach: wander(section, [0.0, 0.0, 0.0])?,
        period_s: or("wander_s", 1.0..=3600.0, 30.0)?,
    };
    let [wander, hold] = ["wander", "hold"].map(|source| Stream::new(seed, NAME, source));
    Ok(Trajectory::advised(Advised::new(pilot, wander, hold)))
}

fn recorded(section: &Section<'_>, tunnel: Tunnel<'_>, load: Loader<'_>) -> Result<Trajectory, ConfigError> {
    let file = section.required("file", section.text("file")?)?;
    let text = load(&file).map_err(|why| section.invalid("file", &why))?;
    let places = recorded::parse(&text).map_err(|why| section.invalid("file", &why))?;
    for (_, [chainage_m, ..]) in &places {
        tunnel.check(section, "file", *chainage_m)?;
    }
    let (knots, duration_s) = recorded::knots(&places);
    Ok(Trajectory::of_knots(knots, duration_s))
}
