//! What was heard of the wall while the vehicle stood still.

use super::still::Still;
use super::{Material, Untold, median};
use crate::app::reading::Reading;
use crate::frames::{Body, Mount, Rot, Tunnel};
use crate::fusion::SensorKind;
use crate::fusion::filter::running::in_tunnel;
use crate::math::{self, TAU};

/// Returns nearer together than this see the same roughness of the wall: together they count as one.
pub(super) const SAME_WALL_RAD: f64 = TAU / SECTORS as f64;
const SECTORS: usize = 120;
/// More returns than these of one piece of wall say nothing new.
const MOST_OF_A_SECTOR: usize = 8;

/// A return of a head.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Return {
    /// Where the head said that it looked, in its own frame, radians.
    pub angle_rad: f64,
    /// Range at the site's speed of sound, m.
    pub range_m: f64,
    /// How the vehicle hung then.
    pub attitude: Rot<Tunnel, Body>,
    /// Its share of what is known of its piece of wall.
    pub share: f64,
}

/// All returns of a head.
#[derive(Debug, Clone, PartialEq)]
pub struct HeadScan {
    /// The source.
    pub source: usize,
    /// How it sits by the vehicle file.
    pub mount: Mount,
    /// Its returns.
    pub returns: Vec<Return>,
}

/// What an echosounder said.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EchoScan {
    /// How it sits by the vehicle file.
    pub mount: Mount,
    /// The middle one of its ranges, at the site's speed of sound, m.
    pub range_m: f64,
}

/// See the module's description.
#[derive(Debug, Clone, PartialEq)]
pub struct Scan {
    /// How the vehicle hung in the middle of the time.
    pub attitude: Rot<Tunnel, Body>,
    /// The heads that heard the wall.
    pub heads: Vec<HeadScan>,
    /// The echosounders that heard it.
    pub echoes: Vec<EchoScan>,
}

impl HeadScan {
    /// How much of the wall it has seen, radians of its own turn.
    pub fn seen_rad(&self) -> f64 {
        let mut seen = [false; SECTORS];
        for one in &self.returns {
            if let Some(slot) = seen.get_mut(sector(one.angle_rad)) {
                *slot = true;
            }
        }
        seen.iter().filter(|seen| **seen).count() as f64 * SAME_WALL_RAD
    }

    /// Leaves out what says nothing new, and shares out what is left.
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

/// Gathers what was heard during a stand.
///
/// Errors: no attitude, or no head that heard the wall.
pub fn gather(material: &Material<'_>, still: &Still) -> Result<Scan, Untold> {
    let attitudes: Vec<_> = material
        .during(still.from, still.to)
        .filter_map(|(event, sensor)| match (sensor.kind, event.reading) {
            (SensorKind::Imu, Reading::Attitude(level)) => {
                let attitude = in_tunnel(&material.site, level) * sensor.mount.rotation.inverse();
                Some((event.valid_at, attitude))
            }
            _ => None,
        })
        .collect();
    let (_, attitude) =
        *attitudes.get(attitudes.len() / 2).ok_or(Untold::Missing { what: "an inertial unit's attitude" })?;
    let mut heads: Vec<HeadScan> = Vec::new();
    let mut echoes: Vec<(usize, Mount, Vec<f64>)> = Vec::new();
    for (event, sensor) in material.during(still.from, still.to) {
        let source = event.source.index();
        match (sensor.kind, event.reading) {
            (SensorKind::Head, Reading::Sonar(sonar)) => {
                let Some(range_m) = sonar.range_m else { continue };
                let range_m = material.site.rescaled_range_m(range_m, sonar.sound_speed_mps);
                let before = attitudes.partition_point(|(at, _)| *at <= event.valid_at);
                let attitude =
                    attitudes.get(before.saturating_sub(1)).map_or(attitude, |(_, attitude)| *attitude);
                let one = Return { angle_rad: sonar.angle_rad, range_m, attitude, share: 1.0 };
                if !(one.angle_rad.is_finite() && range_m.is_finite()) {
                    continue;
                }
                match heads.iter_mut().find(|head| head.source == source) {
                    Some(head) => head.returns.push(one),
                    None => {
                        heads.push(HeadScan { source, mount: sensor.mount, returns: vec![one] });
                    }
                }
            }
            (SensorKind::Echosounder { min_confidence }, Reading::Echo(echo))
                if echo.confidence >= min_confidence =>
            {
                let Some(range_m) = echo.range_m.filter(|range_m| range_m.is_finite()) else { continue };
                let range_m = material.site.rescaled_range_m(range_m, echo.sound_speed_mps);
                match echoes.iter_mut().find(|(other, ..)| *other == source) {
                    Some((.., ranges_m)) => ranges_m.push(range_m),
                    None => echoes.push((source, sensor.mount, vec![range_m])),
                }
            }
            _ => {}
        }
    }
    if heads.is_empty() {
        return Err(Untold::Missing { what: "any profiling head" });
    }
    heads.sort_unstable_by_key(|head| head.source);
    heads.iter_mut().for_each(HeadScan::thin);
    let echoes = echoes.into_iter().filter_map(|(_, mount, mut ranges_m)| {
        median(&mut ranges_m).map(|range_m| EchoScan { mount, range_m })
    });
    Ok(Scan { attitude, heads, echoes: echoes.collect() })
}
