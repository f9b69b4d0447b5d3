//! Treats a beam as a cone. The range is computed from all the wall within the cone.

use bevy_ecs::prelude::{Component, Query, Res};
use headrace_config::{ConfigError, Section};
use headrace_geometry::math::{self, TAU};
use headrace_sensor::device::Sense;
use headrace_sensor::measurement::Sounding;

use super::effect::{Effect, EffectKind};
use super::geometry::{square_to, squareness};
use super::targets::PerSensor;
use crate::builder::Builder;
use crate::environment::{Environment, Hit};
use crate::error::SceneError;
use crate::facts::{Facts, SensorFacts};
use crate::sensing::{Ray, Rays, Reach, Samples, Scenery};
use crate::stages::{OwnBeam, Stage};

/// A beam is a cone, and the range is computed from all the wall within the cone.
///
/// The range is that of the nearest point, the mean, or the surface by the interpolation of Jorge et al. 2021.
///
/// Keys, with defaults in brackets:
/// - `rays` per beam, from 1 to 1024 (16; 64 if `form` is bilinear).
/// - `width_deg`, the cone's full width, from 0.1 to 60; or `frequency_khz`, the frequency that determines the width of
///   a head's beam, from 600 to 1000. The default is a head's own width, and 30 degrees for an echosounder.
/// - `form`: first, mean or bilinear (first).
/// - `bin_m`, the width of a range bin for bilinear, from 0.001 to 1 m. The default is a 500th of a head's range
///   setting in the scene's water, and 0.15 m for an echosounder.
///
/// Source: Jorge et al. 2021, §6 and §9.2; for an echosounder the field of view of a Ping1D in BlueOS, 0.52 rad, and
/// the 200 points of its profile over 30 m.
pub(super) struct BeamConeKind;

/// Angle between successive rays of a sunflower pattern, radians: the golden angle. Source: Vogel, "A better way to
/// construct the sunflower head", Mathematical Biosciences 44, 1979.
const GOLDEN_RAD: f64 = 2.399_963_229_728_653;
/// Strength at the beam's edge relative to the axis. The edge is at half power, because beam widths are measured
/// between half-power points.
const EDGE: f64 = 0.5;
/// Full width of an echosounder's beam, degrees.
const ECHOSOUNDER_DEG: f64 = 30.0;
/// Width of a range bin of an echosounder's profile, m.
const ECHOSOUNDER_BIN_M: f64 = 0.15;
/// Number of points of a head's echo over its range setting. Source: Jorge et al. 2021, §9.2.
const HEAD_POINTS: f64 = 500.0;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Form {
    First,
    Mean,
    Bilinear,
}

const FORMS: [(&str, Form); 3] = [("first", Form::First), ("mean", Form::Mean), ("bilinear", Form::Bilinear)];

#[derive(Debug, Clone, Copy)]
struct Parameters {
    rays: usize,
    width_deg: Option<f64>,
    /// Frequency that determines the width of a head's beam, kHz. Echosounders have none.
    frequency_khz: Option<f64>,
    form: Form,
    bin_m: Option<f64>,
}

/// The rays of a cone about a beam's axis.
#[derive(Debug, Clone, PartialEq)]
pub struct Cone {
    rays: Vec<ConeRay>,
}

#[derive(Debug, Clone, Copy, PartialEq)]
struct ConeRay {
    /// Components of the ray's direction: along the beam's axis, along the tunnel, and perpendicular to both.
    parts: [f64; 3],
    /// Strength of the ray relative to the beam's axis.
    strength: f64,
}

#[derive(Component)]
struct BeamCone {
    cone: Cone,
    form: Form,
    bins: Bins,
    /// Hits of all rays of the current ping's cone.
    hits: Vec<Option<Hit>>,
}

impl Cone {
    /// Creates a cone with a full width of `width_rad` and `rays` rays.
    ///
    /// The first ray is the axis. The others fill the disc evenly in a sunflower pattern. The last two rays are at the
    /// cone's edges in the plane of turning, because an oblique wall is nearest and farthest there.
    pub fn new(width_rad: f64, rays: usize) -> Self {
        let last = rays.max(2) - 1;
        let ray = |number: usize| {
            let edge = number > 0 && number + 1 >= last;
            let out = if edge { 1.0 } else { math::sqrt(number as f64 / last as f64) };
            let (sine, along) = math::sin_cos(out * width_rad / 2.0);
            let (sa, ca) = math::sin_cos(math::wrap(number as f64 * GOLDEN_RAD, TAU));
            let [first, second] = match (edge, number == last) {
                (false, _) => [sine * ca, sine * sa],
                (true, false) => [0.0, -sine],
                (true, true) => [0.0, sine],
            };
            ConeRay { parts: [along, first, second], strength: 1.0 - (1.0 - EDGE) * out }
        };
        Self { rays: (0..rays.max(1)).map(ray).collect() }
    }

    /// Components of the rays' directions along the beam's axis, along the tunnel, and perpendicular to both.
    ///
    /// The ray on the axis comes first. The two rays at the edges of the cone, in the plane of turning, come last.
    pub fn parts(&self) -> impl Iterator<Item = [f64; 3]> {
        self.rays.iter().map(|ray| ray.parts)
    }

    /// Hits of the cone's rays within `far_m`. The hit of the ray on the axis comes first.
    pub(crate) fn hits<'a>(
        &'a self,
        environment: &'a Environment,
        ray: &'a Ray,
        far_m: f64,
    ) -> impl Iterator<Item = Option<Hit>> + 'a {
        let [first, second] = square_to(ray.direction);
        self.rays.iter().map(move |ConeRay { parts: [along, a, b], .. }| {
            let direction = ray.direction.scaled(*along) + first.scaled(*a) + second.scaled(*b);
            environment.cast(ray.origin, direction, far_m)
        })
    }
}

impl EffectKind for BeamConeKind {
    fn name(&self) -> &'static str {
        "beam_cone"
    }

    fn summary(&self) -> &'static str {
        "each beam is a cone, and all of the wall within the cone sets its range"
    }

    fn read(&self, tables: Vec<Section<'_>>, facts: &Facts) -> Result<Box<dyn Effect>, ConfigError> {
        let senses = [Sense::Head, Sense::Echosounder];
        Ok(Box::new(PerSensor::read(tables, facts, &senses, |table| {
            let form = table.choice("form", &FORMS)?.unwrap_or(Form::First);
            let usual = if form == Form::Bilinear { 64 } else { 16 };
            let rays = table.integer("rays", 1..=1024)?.and_then(|rays| usize::try_from(rays).ok());
            let width_deg = table.number("width_deg", 0.1..=60.0)?;
            let frequency_khz = table.number("frequency_khz", 600.0..=1000.0)?;
            if frequency_khz.is_some() && width_deg.is_some() {
                let problem = "cannot be combined with width_deg; give one of them";
                return Err(table.invalid("frequency_khz", problem));
            }
            let bin_m = table.number("bin_m", 0.001..=1.0)?;
            if bin_m.is_some() && form != Form::Bilinear {
                return Err(table.invalid("bin_m", "applies to form = \"bilinear\" only"));
            }
            Ok(Parameters { rays: rays.unwrap_or(usual), width_deg, frequency_khz, form, bin_m })
        })?))
    }
}

/// Full width of a head's beam at a frequency, degrees.
///
/// Source: Jorge et al. 2021, §6: 2.4 degrees at 600 kHz and 1.4 at 1 MHz. In between the width is linear, as in DUNE's
/// model.
fn width_at_deg(frequency_khz: f64) -> f64 {
    2.4 - (frequency_khz - 600.0) / 400.0
}

impl Effect for PerSensor<Parameters> {
    fn build(&self, sim: &mut Builder<'_>) -> Result<(), SceneError> {
        for (source, parameters) in &self.0 {
            let sound_mps = sim.facts().sound_speed_mps;
            let Some(sensor) = sim.facts().sensors.get(*source) else { continue };
            sim.insert(*source, BeamCone::new(parameters, sensor, sound_mps));
            sim.insert(*source, OwnBeam);
        }
        sim.system(Stage::Look, look_in_cones);
        Ok(())
    }
}

impl BeamCone {
    fn new(parameters: &Parameters, sensor: &SensorFacts, sound_mps: f64) -> Self {
        let (own_rad, own_bin_m) = match &sensor.head {
            None => (ECHOSOUNDER_DEG.to_radians(), ECHOSOUNDER_BIN_M),
            Some(spec) => {
                let at_frequency = parameters.frequency_khz.map(|khz| width_at_deg(khz).to_radians());
                (at_frequency.unwrap_or(spec.beam_rad), spec.reach_m(sound_mps)[1] / HEAD_POINTS)
            }
        };
        let width_rad = parameters.width_deg.map_or(own_rad, f64::to_radians);
        Self {
            cone: Cone::new(width_rad, parameters.rays),
            form: parameters.form,
            bins: Bins::new(parameters.bin_m.unwrap_or(own_bin_m)),
            hits: Vec::with_capacity(parameters.rays),
        }
    }

    /// Range of a ping, from the hits of its rays.
    fn range_m(&mut self, ray: &Ray) -> Option<f64> {
        match self.form {
            Form::First => self.hits.iter().flatten().map(|hit| hit.range_m).min_by(f64::total_cmp),
            Form::Mean => mean(self.hits.iter().flatten().map(|hit| hit.range_m)),
            Form::Bilinear => self.surface_m(ray),
        }
    }

    /// Range of the wall's surface as Jorge et al. 2021 define it, m.
    ///
    /// Each ray's echo, weighted by beam strength and incidence, is shared between the two nearest range bins. The
    /// surface is in the bin with the largest sum.
    fn surface_m(&mut self, ray: &Ray) -> Option<f64> {
        for (hit, part) in self.hits.iter().zip(&self.cone.rays) {
            if let Some(hit) = hit {
                self.bins.add(hit.range_m, part.strength * squareness(ray.direction, hit.normal));
            }
        }
        self.bins.take_surface_m()
    }
}

fn mean(ranges_m: impl Iterator<Item = f64>) -> Option<f64> {
    let (mut sum_m, mut count) = (0.0, 0_u32);
    for range_m in ranges_m {
        (sum_m, count) = (sum_m + range_m, count + 1);
    }
    (count > 0).then(|| sum_m / f64::from(count))
}

type Looking<'a> = (&'a mut Samples<Sounding>, &'a mut Rays, &'a Reach, &'a mut BeamCone);

fn look_in_cones(scenery: Res<'_, Scenery>, mut sonars: Query<'_, '_, Looking<'_>>) {
    for (mut samples, mut rays, reach, mut beam) in &mut sonars {
        let beam = &mut *beam;
        for (sounding, ray) in samples.list.iter_mut().zip(&mut rays.0) {
            beam.hits.clear();
            beam.hits.extend(beam.cone.hits(&scenery.environment, ray, reach.0));
            // The ground truth records the hit of the beam's axis.
            ray.hit = beam.hits.first().copied().flatten();
            sounding.range_m = beam.range_m(ray);
        }
    }
}

/// Strengths in bins of equal width, which are centred on multiples of the width.
///
/// The bins implement this sentence of Jorge et al. 2021, §9.2: "we use bilinear interpolation of range values of the
/// 881L sensor to determine where the tunnel surface is". The head's picture is a grid of angle and range. An echo
/// between grid points is shared linearly among the neighbouring points. In angle, the share is the beam strength,
/// which falls linearly from the axis. The surface is the ridge of the picture. If the beam is oblique to the wall, its
/// echo is long and the ridge is wide and low, as the paper reports for places next to corners.
#[derive(Debug, Clone, PartialEq)]
struct Bins {
    width_m: f64,
    strengths: Vec<f64>,
    /// Index of the first bin with an echo, and one past the last bin with an echo.
    filled: (usize, usize),
}

impl Bins {
    /// Creates empty bins of width `width_m`, which must be above 0.
    fn new(width_m: f64) -> Self {
        Self { width_m, strengths: Vec::new(), filled: (usize::MAX, 0) }
    }

    /// Adds an echo. It is shared linearly between the two bins nearest to `range_m`.
    fn add(&mut self, range_m: f64, strength: f64) {
        let at = range_m / self.width_m;
        let Ok(below) = usize::try_from(math::floor_to_i64(at)) else { return };
        let above = at - below as f64;
        if self.strengths.len() < below + 2 {
            self.strengths.resize(below + 2, 0.0);
        }
        for (bin, share) in self.strengths.iter_mut().skip(below).zip([1.0 - above, above]) {
            *bin += share * strength;
        }
        self.filled = (self.filled.0.min(below), self.filled.1.max(below + 2));
    }

    /// Returns the range of the strongest echo, m, and empties the bins.
    ///
    /// The range is the centroid of the strongest bin and its two neighbours. If several bins are equally strong, the
    /// nearest of them is taken. Returns `None` if the bins are empty.
    fn take_surface_m(&mut self) -> Option<f64> {
        let (from, to) = std::mem::replace(&mut self.filled, (usize::MAX, 0));
        let filled = self.strengths.get_mut(from..to)?;
        let mut strongest = (0, 0.0);
        for (bin, strength) in filled.iter().enumerate() {
            if *strength > strongest.1 {
                strongest = (bin, *strength);
            }
        }
        let first = strongest.0.saturating_sub(1);
        let (mut sum, mut moment) = (0.0, 0.0);
        for (bin, strength) in filled.iter().enumerate().skip(first).take(strongest.0 - first + 2) {
            (sum, moment) = (sum + strength, moment + strength * (from + bin) as f64);
        }
        filled.fill(0.0);
        (sum > 0.0).then(|| moment / sum * self.width_m)
    }
}

#[cfg(test)]
mod tests;
