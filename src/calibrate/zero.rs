//! Zeros of depth sensors and cable counters.

use crate::calibrate::collect::Material;
use crate::calibrate::estimate::{Estimate, NotEstimated, median};
use crate::calibrate::heads::Heads;
use crate::calibrate::still::Still;
use headrace_fusion::filter::measure::with_quantum;
use headrace_fusion::filter::updates::in_tunnel;
use headrace_geometry::frames::Rot;
use headrace_geometry::math;
use headrace_geometry::site::Site;
use headrace_geometry::time::MonoNs;
use headrace_sensor::device::SensorKind;
use headrace_sensor::reading::Reading;

/// Largest variation of pressure at the surface: 5 cm of water.
const MOST_SPAN_PA: f64 = 500.0;

/// Estimated zero of one depth sensor or cable counter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Zero {
    /// Number of the packet source.
    pub(crate) source: usize,
    /// Estimated zero, in the unit of the quantity.
    pub(crate) found: Estimate,
    /// Number of readings used for the estimate.
    pub(crate) readings: usize,
}

/// Pressure at the surface, Pa: mean of the first depth sensor's readings from `from` (inclusive) to `to`
/// (exclusive).
///
/// The standard deviation is that of one reading, since waves and drift don't average out.
///
/// Errors: the pressure is missing, varied too much, or isn't that of air.
pub(crate) fn surface(material: &Material<'_>, from: MonoNs, to: MonoNs) -> Result<Zero, NotEstimated> {
    let mut source = None;
    let mut quantum_pa = 0.0;
    let mut pressures = Vec::new();
    for (event, _) in material.during(from, to) {
        let Reading::Pressure(water) = event.reading else { continue };
        if *source.get_or_insert(event.source.index()) == event.source.index()
            && water.pressure_pa.is_finite()
        {
            pressures.push(water.pressure_pa);
            quantum_pa = water.resolution_pa;
        }
    }
    let source = source.ok_or(NotEstimated::Missing { what: "a depth sensor at that time" })?;
    let least = pressures.iter().copied().fold(f64::INFINITY, f64::min);
    let most = pressures.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    if most - least > MOST_SPAN_PA {
        return Err(NotEstimated::NotAtSurface { span_pa: most - least, most_pa: MOST_SPAN_PA });
    }
    let count = pressures.len().max(1) as f64;
    let mean = pressures.iter().sum::<f64>() / count;
    if !Site::SURFACE_PRESSURE_PA.contains(&mean) {
        let (least_pa, most_pa) = (*Site::SURFACE_PRESSURE_PA.start(), *Site::SURFACE_PRESSURE_PA.end());
        return Err(NotEstimated::UnderWater { mean_pa: mean, least_pa, most_pa });
    }
    let variance = pressures.iter().map(|pa| (pa - mean) * (pa - mean)).sum::<f64>() / count;
    let sd = with_quantum(math::sqrt(variance), quantum_pa);
    Ok(Zero { source, found: Estimate { value: mean, sd }, readings: pressures.len() })
}

/// Height of the water's surface above the tunnel's floor, m.
///
/// It follows from the first depth sensor and from the height that the heads give.
///
/// `surface_pa` replaces the file's pressure at the surface.
///
/// Errors: there is no pressure, or no attitude.
pub(crate) fn water_level(
    material: &Material<'_>,
    heads: &Heads,
    surface_pa: Option<f64>,
) -> Result<Zero, NotEstimated> {
    let mut site = material.site;
    site.surface_pressure_pa = surface_pa.unwrap_or(site.surface_pressure_pa);
    let mut attitude = Rot::identity();
    let mut of = None;
    let mut quantum_m = 0.0;
    let mut levels = Vec::new();
    for (event, sensor) in material.during(heads.still.from, heads.still.to) {
        match (sensor.kind, event.reading) {
            (SensorKind::Imu, Reading::Attitude(level)) => {
                attitude = in_tunnel(&site, level) * sensor.mount.rotation.inverse();
            }
            (SensorKind::Depth, Reading::Pressure(water))
                if of.is_none_or(|of| of == event.source.index()) =>
            {
                of = Some(event.source.index());
                let height = heads.height_m(attitude * sensor.mount.position);
                levels.push(height.value + site.depth_m(water.pressure_pa));
                quantum_m = site.depth_m(site.surface_pressure_pa + water.resolution_pa);
            }
            _ => {}
        }
    }
    let readings = levels.len();
    let source =
        of.ok_or(NotEstimated::Missing { what: "a depth sensor while the vehicle is stationary" })?;
    let value = median(&mut levels).unwrap_or(f64::NAN);
    let [_, z] = heads.place_m;
    let sd = with_quantum(math::hypot(z.sd, material.settings.depth_sd_m), quantum_m);
    Ok(Zero { source, found: Estimate { value, sd }, readings })
}

/// Chainage at which each cable counter reads zero, m. The vehicle is at rest at `chainage_m`.
///
/// Errors: there is no cable counter.
pub(crate) fn tethers(
    material: &Material<'_>,
    still: &Still,
    chainage_m: f64,
) -> Result<Vec<Zero>, NotEstimated> {
    let mut found: Vec<(usize, f64, Vec<f64>)> = Vec::new();
    for (event, sensor) in material.during(still.from, still.to) {
        let (SensorKind::Tether { scale, .. }, Reading::TetherLength(length)) = (sensor.kind, event.reading)
        else {
            continue;
        };
        let (source, quantum_m) = (event.source.index(), length.resolution_m * scale.abs());
        match found.iter_mut().find(|(other, ..)| *other == source) {
            Some((.., lengths)) => lengths.push(scale * length.length_m),
            None => found.push((source, quantum_m, vec![scale * length.length_m])),
        }
    }
    if found.is_empty() {
        return Err(NotEstimated::Missing { what: "a cable counter" });
    }
    let settings = &material.settings;
    // While the vehicle is at rest, the cable's slack is constant, so the error that it causes doesn't average out.
    let sd_m = math::hypot(settings.tether_sd_m, settings.slack.reach);
    let zero = |(source, quantum_m, mut lengths): (usize, f64, Vec<f64>)| Zero {
        source,
        readings: lengths.len(),
        found: Estimate {
            value: chainage_m - median(&mut lengths).unwrap_or(0.0),
            sd: with_quantum(sd_m, quantum_m),
        },
    };
    Ok(found.into_iter().map(zero).collect())
}
