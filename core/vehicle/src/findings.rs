//! Checks of a vehicle file as a whole, after each of its keys has been read.
//!
//! The checks find sensors that cannot share a connection, wall outside the heads' range limits, and heads whose passes
//! cannot interleave.

use core::fmt;

use headrace_geometry::frames::{Point3, Pose, Rot};
use headrace_geometry::math::TAU;
use headrace_geometry::tunnel::Profile;
use headrace_sampling::head::HeadSpec;
use headrace_sampling::layout::HeadLayout;
use headrace_sampling::occlusion::{self, AngleRange};
use headrace_sampling::ring::Standing;
use headrace_sensor::connect::Connect;

use crate::vehicle::VehicleConfig;

/// Severity of a finding.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Grade {
    /// The vehicle file cannot work as written.
    Error,
    /// The vehicle file works, but at a cost, or works as intended only if an unusual setting is meant.
    Warning,
}

/// A problem between keys of a vehicle file that are valid one by one.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Finding {
    /// Severity of the finding.
    pub grade: Grade,
    /// Dotted path of the key that the finding is about. The file may lack this key.
    pub key: String,
    /// The problem, and what to do about it.
    pub problem: String,
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.key, self.problem)
    }
}

/// Number of beams per turn that the check of head ranges casts.
const BEAMS: u32 = 720;
/// Minimum share of the wall that a head must reach, from 0 to 1.
///
/// A lower share means that the range setting or the tunnel is wrong.
const LEAST_SHARE: f64 = 0.5;
/// Largest relative difference of turn periods at which heads stay in phase for hours.
const SAME_TURN: f64 = 1e-6;
/// Finest range step of a sonar, m: that of an 881L with a range setting of 5 m or less (data sheet).
///
/// A sonar's returns show no finer details of a wall.
const FINEST_M: f64 = 0.002;
/// Edge length of a polyline, m, that is short enough for a curved wall of any radius.
///
/// The polyline deviates from the wall by the sagitta e^2 / (8 r). In the narrowest pipe, with a radius of 0.1 m, this
/// is 0.1 mm, which is less than [`FINEST_M`].
const ENOUGH_M: f64 = 0.01;
/// Largest distance along the hull at which heads count as side by side, m.
const APART_M: f64 = 0.01;

impl VehicleConfig {
    /// Returns all findings, ordered by subject: single sensors, all heads together, the tunnel.
    pub fn findings(&self) -> Vec<Finding> {
        let [devices, configs] = [self.sensors.len(), self.sensor_configs.len()];
        debug_assert!(
            devices == configs,
            "each of {devices} sensors has the common part of its table: {configs}"
        );
        let mut found = self.connections();
        found.extend(self.remarks());
        found.extend(self.reaches());
        found.extend(self.interleaving());
        found.extend(self.too_fine());
        found
    }

    /// Returns the index of each sensor that cannot use its connection because of an earlier sensor, with the reason.
    pub fn excluded_from_lines(&self) -> Vec<(usize, String)> {
        let mut found = Vec::new();
        let mut before: Vec<(usize, Connect)> = Vec::new();
        for (number, config) in self.sensor_configs.iter().enumerate() {
            let Ok(connect) = Connect::parse(&config.connect) else { continue };
            let mut excluded =
                before.iter().filter_map(|(other, theirs)| self.exclude(*other, theirs, number, &connect));
            let error =
                excluded.find(|(grade, _)| *grade == Grade::Error).map(|(_, problem)| (number, problem));
            found.extend(error);
            before.push((number, connect));
        }
        found
    }

    /// Returns the connections that do not parse, or that conflict with the connection of an earlier sensor.
    fn connections(&self) -> Vec<Finding> {
        let mut found = Vec::new();
        let mut before: Vec<(usize, Connect)> = Vec::new();
        let mut silent = Vec::new();
        for (number, (config, device)) in self.sensor_configs.iter().zip(&self.sensors).enumerate() {
            let key = format!("sensors[{number}].connect");
            if config.connect.is_empty() {
                silent.push(config.id.as_str());
                continue;
            }
            let parsed = Connect::parse(&config.connect).and_then(|connect| connect.among(device.carriers()));
            match parsed {
                Err(why) => found.push(error(key, format!("{}; {}", why.problem, why.allowed))),
                Ok(connect) => {
                    let excluded = before
                        .iter()
                        .find_map(|(other, theirs)| self.exclude(*other, theirs, number, &connect));
                    found.extend(excluded.map(|(grade, problem)| Finding { grade, key, problem }));
                    before.push((number, connect));
                }
            }
        }
        // No sensor has a connection if the vehicle is only simulated or replayed.
        if silent.len() < self.sensors.len() {
            let problem = format!("have no connect, so `run` can't reach them: {}", silent.join(", "));
            found.extend((!silent.is_empty()).then(|| warning("sensors".to_owned(), problem)));
        }
        found
    }

    /// Returns the reason why two sensors cannot have these two connections at once; `None` if they can.
    fn exclude(&self, a: usize, of_a: &Connect, b: usize, of_b: &Connect) -> Option<(Grade, String)> {
        let other = self.sensor_configs.get(a)?;
        let own = self.sensor_configs.get(b)?;
        let end = same_end(of_a, of_b)?;
        if of_a != of_b {
            let problem = format!(
                "is also the {end} of sensor {:?}, but with other settings; only one sensor can open it",
                other.id
            );
            return Some((Grade::Error, problem));
        }
        if other.plugin != own.plugin {
            // CAN frames have identifiers, so devices of different kinds can share the bus.
            let shared = matches!(of_a, Connect::Can { .. });
            let problem = format!(
                "is also the {end} of sensor {:?}, a {}; each device receives the other's bytes and skips them",
                other.id, other.plugin
            );
            return (!shared).then_some((Grade::Warning, problem));
        }
        let address = |number: usize| self.sensors.get(number)?.line_address();
        if address(a).is_some() && address(a) != address(b) {
            return None;
        }
        let problem = format!(
            "is also the {end} of sensor {:?}, and the bytes of two {} cannot be separated there; give each its own",
            other.id, own.plugin
        );
        Some((Grade::Error, problem))
    }

    fn remarks(&self) -> impl Iterator<Item = Finding> + '_ {
        self.sensors.iter().enumerate().flat_map(|(number, sensor)| {
            let remark = move |(key, what)| warning(format!("sensors[{number}].{key}"), what);
            sensor.remarks().into_iter().map(remark)
        })
    }

    /// Returns a finding for each head that does not reach all of the wall from the centre of the tunnel.
    fn reaches(&self) -> Vec<Finding> {
        let heads = self.heads();
        let hidden = occlusion::hidden_by_vehicle(&heads, &self.hull);
        let numbered = self.sensors.iter().enumerate().filter(|(_, sensor)| sensor.head().is_some());
        let heads = numbered.map(|(number, _)| number).zip(heads.iter().zip(&hidden));
        heads.filter_map(|(number, (spec, hidden))| self.reach(number, spec, hidden)).collect()
    }

    fn reach(&self, number: usize, spec: &HeadSpec, hidden: &[AngleRange]) -> Option<Finding> {
        let profile = &self.tunnel.profile;
        let [y, z] = profile.reference();
        let pose = Pose { position: Point3::new(0.0, y, z), attitude: Rot::identity() };
        let standing = match Standing::new(profile, &pose, &spec.mount) {
            Ok(standing) => standing,
            Err(why) => return Some(error(format!("sensors[{number}].position_m"), why.to_string())),
        };
        let angles = (0..BEAMS).map(|k| TAU * f64::from(k) / f64::from(BEAMS));
        let seen = angles.filter(|angle| !hidden.iter().any(|range| range.has(*angle)));
        let walls: Vec<Wall> = seen.filter_map(|angle| Wall::at(&standing, angle)).collect();
        let [least_m, most_m] = spec.reach_m(self.site.sound_speed_mps);
        let out: Vec<&Wall> =
            walls.iter().filter(|wall| !(least_m..=most_m).contains(&wall.range_m)).collect();
        if out.is_empty() {
            return None;
        }
        let share = 1.0 - out.len() as f64 / walls.len() as f64;
        let nearest_m = walls.iter().map(|wall| wall.range_m).fold(f64::INFINITY, f64::min);
        let farthest_m = walls.iter().map(|wall| wall.range_m).fold(0.0, f64::max);
        let places = if out.len() == walls.len() { "all around".to_owned() } else { clocks(&out, profile) };
        let problem = format!(
            "reaches {:.0} % of the wall around this head: the wall is {nearest_m:.2} to {farthest_m:.2} m away, and the \
             setting covers {least_m:.2} to {most_m:.2} m; out of reach: {places}",
            (share * 100.0).floor()
        );
        let grade = if share < LEAST_SHARE { Grade::Error } else { Grade::Warning };
        Some(Finding { grade, key: format!("sensors[{number}].range_m"), problem })
    }

    /// Returns a warning if points of the profile are closer together than the finest detail that a sonar resolves.
    fn too_fine(&self) -> Option<Finding> {
        let tunnel = &self.tunnel;
        if tunnel.name != "polyline" {
            return None;
        }
        // The first and the last piece of the profile are one edge, split at the floor's centre.
        let pieces = tunnel.profile.pieces_m();
        let edges = pieces.len().saturating_sub(1);
        let whole = pieces.take(edges).skip(1);
        let short: Vec<(f64, f64)> = whole.filter(|(_, length_m)| *length_m < FINEST_M).collect();
        let (first_m, length_m) = *short.first()?;
        let problem = format!(
            "has {} of {edges} edges shorter than {} mm, the finest range step of a sonar; the first is {:.3} mm long, at \
             {first_m:.3} m round the wall ({}); the direction of such short edges is survey noise, and points every {} mm \
             are enough",
            short.len(),
            FINEST_M * 1e3,
            length_m * 1e3,
            tunnel.profile.clock(first_m),
            ENOUGH_M * 1e3,
        );
        Some(warning("tunnel.file".to_owned(), problem))
    }

    /// Returns findings about heads whose passes cannot interleave.
    fn interleaving(&self) -> Vec<Finding> {
        let heads = self.heads();
        let mut found = Vec::new();
        if let Err(why) = self.programs() {
            found.push(error("heads".to_owned(), format!("no program is possible for these heads: {why}")));
        }
        let turns = || heads.iter().map(|head| TAU / head.step_rad * head.ping_period_s);
        let (shortest_s, longest_s) =
            (turns().fold(f64::INFINITY, f64::min), turns().fold(0.0_f64, f64::max));
        if heads.len() > 1 && longest_s > shortest_s * (1.0 + SAME_TURN) {
            let list: Vec<String> = turns().map(|turn_s| format!("{turn_s:.2} s")).collect();
            let problem = format!(
                "can't interleave: the heads' turns take {}; give all heads the same mode and range_m",
                list.join(", ")
            );
            found.push(warning("heads".to_owned(), problem));
        }
        let along = || heads.iter().map(|head| head.mount.position.x());
        let apart_m = along().fold(f64::MIN, f64::max) - along().fold(f64::MAX, f64::min);
        let unplanned = self.planned_speed_mps <= 0.0 && self.layout == HeadLayout::PhaseShift;
        if heads.len() > 1 && unplanned && apart_m > APART_M {
            let problem = format!(
                "is 0: heads {apart_m:.2} m apart along the hull are put in phase as if they were side by side; give the \
                 speed of the dive"
            );
            found.push(warning("heads.planned_speed_mps".to_owned(), problem));
        }
        found
    }
}

fn error(key: String, problem: String) -> Finding {
    Finding { grade: Grade::Error, key, problem }
}

fn warning(key: String, problem: String) -> Finding {
    Finding { grade: Grade::Warning, key, problem }
}

/// Returns in words what two connections have in common: a serial port, address, interface or device. `None` if there
/// is nothing.
fn same_end(a: &Connect, b: &Connect) -> Option<&'static str> {
    match (a, b) {
        (Connect::Serial { port: a, .. }, Connect::Serial { port: b, .. }) => {
            (a == b).then_some("serial port")
        }
        (Connect::Tcp { address: a }, Connect::Tcp { address: b }) => (a == b).then_some("TCP address"),
        (Connect::Udp { address: a }, Connect::Udp { address: b })
        | (Connect::UdpListen { address: a, .. }, Connect::UdpListen { address: b, .. }) => {
            (a == b).then_some("UDP address")
        }
        (Connect::Can { interface: a }, Connect::Can { interface: b }) => (a == b).then_some("CAN interface"),
        (Connect::Hid(a), Connect::Hid(b)) => (a == b).then_some("HID device"),
        (Connect::I2c { .. }, Connect::I2c { .. }) => (a == b).then_some("I2C address"),
        _ => None,
    }
}

/// Point where a beam meets the wall.
struct Wall {
    range_m: f64,
    arc_m: f64,
}

impl Wall {
    /// Returns the point where a beam meets the wall; `None` if the beam runs along the tunnel.
    fn at(standing: &Standing<'_>, angle_rad: f64) -> Option<Self> {
        let sounding = standing.sounding(angle_rad).ok()?;
        Some(Self { range_m: sounding.range_m(), arc_m: sounding.arc_m })
    }
}

/// Lists the clock positions of points on the wall, without duplicates, starting at the floor.
fn clocks(walls: &[&Wall], profile: &Profile) -> String {
    let mut arcs: Vec<f64> = walls.iter().map(|wall| wall.arc_m).collect();
    arcs.sort_by(f64::total_cmp);
    let mut clocks: Vec<String> = arcs.into_iter().map(|arc_m| profile.clock(arc_m)).collect();
    clocks.dedup();
    // The lowest and the highest arc lengths are both at the floor, so the floor's clock position may appear twice.
    if clocks.len() > 1 && clocks.first() == clocks.last() {
        clocks.pop();
    }
    match clocks.as_slice() {
        [first, .., last] if clocks.len() > MANY => {
            format!("{} clock positions from {first} to {last}", clocks.len())
        }
        _ => clocks.join(", "),
    }
}

/// Maximum number of listed clock positions.
const MANY: usize = 8;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn connections_to_the_same_end_are_recognised_in_every_notation() {
        let parse = |text: &str| Connect::parse(text).unwrap();
        for (a, b, expected) in [
            ("serial:/dev/a?baud=9600", "serial:/dev/a", Some("serial port")),
            ("serial:/dev/a", "serial:/dev/b", None),
            ("tcp:a:1", "tcp:a:1", Some("TCP address")),
            ("tcp:a:1", "tcp:a:2", None),
            ("tcp:a:1", "udp:a:1", None),
            ("udp-listen:0.0.0.0:1", "udp-listen:0.0.0.0:1", Some("UDP address")),
            ("can:can0", "can:can0", Some("CAN interface")),
            ("hid:1209:0001", "hid:1209:0001:A", None),
            ("i2c:/dev/i2c-1:0x40", "i2c:/dev/i2c-1:0x41", None),
        ] {
            assert_eq!(same_end(&parse(a), &parse(b)), expected, "{a} {b}");
        }
    }
}
