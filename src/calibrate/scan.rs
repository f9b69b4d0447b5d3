//! Gathers ranges to the wall from a time at rest.

use std::collections::BTreeMap;

use crate::calibrate::collect::Material;
use crate::calibrate::estimate::{NotEstimated, median};
use crate::calibrate::still::Still;
use crate::calibrate::sweep::Sweep;
use headrace_fusion::filter::updates::in_tunnel;
use headrace_geometry::frames::{Body, Mount, Rot, Tunnel};
use headrace_geometry::math::{self, TAU};
use headrace_geometry::time::MonoNs;
use headrace_monitor::messages::Event;
use headrace_sensor::device::{SensorInfo, SensorKind};
use headrace_sensor::reading::Reading;

/// Angle of one piece of wall, radians.
///
/// All returns from one piece of wall share its roughness, so together they count as one return.
pub(super) const SAME_WALL_RAD: f64 = TAU / SECTORS as f64;
const SECTORS: usize = 120;
/// Maximum number of returns used per piece of wall. More returns from the same piece add no information.
const MOST_OF_A_SECTOR: usize = 8;

/// A return of a head.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Return {
    /// Reported angle in the frame of the head, radians.
    pub(crate) angle_rad: f64,
    /// Range at the site's speed of sound, m.
    pub(crate) range_m: f64,
    /// Attitude of the vehicle at the time of the return.
    pub(crate) attitude: Rot<Tunnel, Body>,
    /// Weight of the return within its piece of wall.
    pub(crate) share: f64,
}

/// All returns of a head while the vehicle stands still.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct HeadScan {
    /// Number of the head's packet source.
    pub(crate) source: usize,
    /// Mount of the head in the vehicle file.
    pub(crate) mount: Mount,
    /// Motion of the head about its axis, from all its pings.
    pub(crate) sweep: Sweep,
    /// Sonar returns of the head.
    pub(crate) returns: Vec<Return>,
}

/// Range of an echosounder while the vehicle stands still.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct EchoScan {
    /// Mount of the echosounder in the vehicle file.
    pub(crate) mount: Mount,
    /// Median of the echosounder's ranges, at the site's speed of sound, m.
    pub(crate) range_m: f64,
}

/// Ranges of all sonars while the vehicle stands still.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Scan {
    /// Attitude of the vehicle in the middle of the time at rest.
    pub(crate) attitude: Rot<Tunnel, Body>,
    /// Heads that detected the wall.
    pub(crate) heads: Vec<HeadScan>,
    /// Echosounders that detected the wall.
    pub(crate) echoes: Vec<EchoScan>,
}

impl HeadScan {
    /// Total angle of the sectors in which the head has seen wall, radians.
    pub(crate) fn seen_rad(&self) -> f64 {
        self.seen().iter().filter(|seen| **seen).count() as f64 * SAME_WALL_RAD
    }

    /// Total angle of the directions in which the head has seen wall, and has also seen wall in the opposite direction,
    /// radians.
    ///
    /// If a head sees only one side, an error common to all ranges shifts its estimated position and turns its
    /// estimated angle. If it sees opposite walls, these effects cancel.
    pub(crate) fn opposite_rad(&self) -> f64 {
        let seen = self.seen();
        let (first, second) = seen.split_at(SECTORS / 2);
        let pairs = first.iter().zip(second).filter(|(here, there)| **here && **there).count();
        2.0 * pairs as f64 * SAME_WALL_RAD
    }

    /// For each sector, whether the head has seen wall in it.
    fn seen(&self) -> [bool; SECTORS] {
        let mut seen = [false; SECTORS];
        for one in &self.returns {
            if let Some(slot) = seen.get_mut(sector(one.angle_rad)) {
                *slot = true;
            }
        }
        seen
    }

    /// Drops the returns of a piece of wall that exceed the limit, and sets the weights of the remaining returns.
    fn thin(&mut self) {
        let mut counts = [0_usize; SECTORS];
        for one in &self.returns {
            if let Some(count) = counts.get_mut(sector(one.angle_rad)) {
                *count += 1;
            }
        }
        let mut passed = [0_usize; SECTORS];
        let mut kept = [0_usize; SECTORS];
        self.returns.retain(|one| {
            let of = sector(one.angle_rad);
            let (Some(count), Some(passed), Some(kept)) =
                (counts.get(of), passed.get_mut(of), kept.get_mut(of))
            else {
                return false;
            };
            let keep = (*passed).is_multiple_of(count.div_ceil(MOST_OF_A_SECTOR));
            *passed += 1;
            *kept += usize::from(keep);
            keep
        });
        for one in &mut self.returns {
            let count = kept.get(sector(one.angle_rad)).copied().unwrap_or(1);
            one.share = 1.0 / count.max(1) as f64;
        }
    }
}

fn sector(angle_rad: f64) -> usize {
    let sector = math::floor_to_i64(math::wrap(angle_rad, TAU) / SAME_WALL_RAD);
    usize::try_from(sector).unwrap_or(0).min(SECTORS - 1)
}

/// Gathers the ranges that all sonars measured while the vehicle was at rest.
///
/// Errors: there is no attitude, or no head detected the wall.
pub(crate) fn gather(material: &Material<'_>, still: &Still) -> Result<Scan, NotEstimated> {
    let attitudes = attitudes(material, still);
    let middle = attitudes.get(attitudes.len() / 2);
    let (_, attitude) = *middle.ok_or(NotEstimated::Missing { what: "an inertial unit's attitude" })?;
    let heads = heads(material, still, &attitudes);
    if heads.is_empty() {
        return Err(NotEstimated::Missing { what: "any profiling head" });
    }
    Ok(Scan { attitude, heads, echoes: echoes(material, still) })
}

/// Attitudes of the vehicle with their times, in order of time.
fn attitudes(material: &Material<'_>, still: &Still) -> Vec<(MonoNs, Rot<Tunnel, Body>)> {
    let attitude = |(event, sensor): (&Event, &SensorInfo)| match (sensor.kind, event.reading) {
        (SensorKind::Imu, Reading::Attitude(level)) => {
            let attitude = in_tunnel(&material.site, level) * sensor.mount.rotation.inverse();
            Some((event.valid_at, attitude))
        }
        _ => None,
    };
    material.during(still.from, still.to).filter_map(attitude).collect()
}

/// Heads that detected the wall, in the order of their sources.
fn heads(material: &Material<'_>, still: &Still, attitudes: &[(MonoNs, Rot<Tunnel, Body>)]) -> Vec<HeadScan> {
    let mut heads: BTreeMap<usize, HeadScan> = BTreeMap::new();
    for (event, sensor) in material.during(still.from, still.to) {
        let (SensorKind::Head, Reading::Sonar(sonar)) = (sensor.kind, event.reading) else { continue };
        if !event.reading.is_finite() {
            continue;
        }
        let source = event.source.index();
        let head = heads.entry(source).or_insert_with(|| HeadScan {
            source,
            mount: sensor.mount,
            sweep: Sweep::default(),
            returns: Vec::new(),
        });
        head.sweep.add(sonar.angle_rad, event.valid_at);
        let before = attitudes.partition_point(|(at, _)| *at <= event.valid_at).saturating_sub(1);
        let (Some(range_m), Some((_, attitude))) = (sonar.range_m, attitudes.get(before)) else { continue };
        let range_m = material.site.rescaled_range_m(range_m, sonar.sound_speed_mps);
        head.returns.push(Return { angle_rad: sonar.angle_rad, range_m, attitude: *attitude, share: 1.0 });
    }
    heads.retain(|_, head| !head.returns.is_empty());
    heads.values_mut().for_each(HeadScan::thin);
    heads.into_values().collect()
}

/// Echosounders that detected the wall, in the order of their sources.
fn echoes(material: &Material<'_>, still: &Still) -> Vec<EchoScan> {
    let mut heard: BTreeMap<usize, (Mount, Vec<f64>)> = BTreeMap::new();
    for (event, sensor) in material.during(still.from, still.to) {
        let (SensorKind::Echosounder { min_confidence }, Reading::Echo(echo)) = (sensor.kind, event.reading)
        else {
            continue;
        };
        let is_sure = echo.confidence >= min_confidence && event.reading.is_finite();
        if let (Some(range_m), true) = (echo.range_m, is_sure) {
            let range_m = material.site.rescaled_range_m(range_m, echo.sound_speed_mps);
            heard.entry(event.source.index()).or_insert((sensor.mount, Vec::new())).1.push(range_m);
        }
    }
    let middle = |(mount, mut ranges_m): (Mount, Vec<f64>)| {
        median(&mut ranges_m).map(|range_m| EchoScan { mount, range_m })
    };
    heard.into_values().filter_map(middle).collect()
}
