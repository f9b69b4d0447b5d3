//! Perimeter of a cross-section from one turn of a stationary head (Jorge et al. 2021, §9.2). It is computed by
//! polygons through the ranges, and by the paper's method, the skeleton of an echo image.

mod chain;
mod echo;
mod error;
mod image;
mod settings;
mod thin;

use headrace_geometry::math::{self, TAU};

pub(crate) use chain::Chain;
pub(crate) use error::PerimeterError;
pub(crate) use settings::{Ping, Settings};

use chain::trace;
use echo::Echoes;
use image::Image;

/// Length of the closed polygon through points, m.
///
/// Points are (angle in radians, range in metres) in the order of their angles. Points at the same angle keep their
/// given order.
///
/// Errors: fewer than three finite points.
pub(crate) fn polygon_m(places: &[(f64, f64)]) -> Result<f64, PerimeterError> {
    let good = |(angle, range): &&(f64, f64)| angle.is_finite() && range.is_finite();
    let mut sorted: Vec<(f64, f64)> =
        places.iter().filter(good).map(|(angle, range)| (math::wrap(*angle, TAU), *range)).collect();
    sorted.sort_by(|a, b| a.0.total_cmp(&b.0));
    if sorted.len() < 3 {
        return Err(PerimeterError::TooFewPings { count: sorted.len() });
    }
    let place = |(angle, range): &(f64, f64)| {
        let (sin, cos) = math::sin_cos(*angle);
        [range * sin, -range * cos]
    };
    let next = sorted.iter().cycle().skip(1);
    let sides = sorted.iter().map(place).zip(next.map(place));
    Ok(sides.map(|(a, b)| math::hypot(b[0] - a[0], b[1] - a[1])).sum())
}

/// Angle and smallest range of each ping, as reported by a head that takes the first echo. Pings without an echo are
/// omitted.
pub(crate) fn least_ranges(pings: &[Ping]) -> Vec<(f64, f64)> {
    let least = |p: &Ping| p.ranges_m.iter().copied().filter(|r| r.is_finite()).fold(f64::INFINITY, f64::min);
    pings.iter().map(|p| (p.angle_rad, least(p))).filter(|(_, range)| range.is_finite()).collect()
}

/// Angle and mean range of each ping. Pings without an echo are omitted.
pub(crate) fn mean_ranges(pings: &[Ping]) -> Vec<(f64, f64)> {
    let mean = |p: &Ping| {
        let known = p.ranges_m.iter().filter(|r| r.is_finite());
        known.clone().sum::<f64>() / known.count() as f64
    };
    pings.iter().map(|p| (p.angle_rad, mean(p))).filter(|(_, range)| range.is_finite()).collect()
}

/// Length of the skeleton of the wall's image. Echoes are interpolated bilinearly over angle and range, and the image
/// is thresholded, thinned and pruned.
///
/// Errors: see [`PerimeterError`].
/// Source: the paper's §9.2.
pub(crate) fn skeleton(pings: &[Ping], settings: &Settings) -> Result<Chain, PerimeterError> {
    check(settings)?;
    let echoes = Echoes::of(pings, settings)?;
    let mut image = Image::of(&echoes, settings);
    image.grow(settings.grow_px);
    thin::zhang_suen(&mut image);
    thin::clean(&mut image);
    let mut ring = image.round_the_middle().ok_or(PerimeterError::NotClosed)?;
    thin::clean(&mut ring);
    trace(&ring, settings.pixel_m)
}

fn check(settings: &Settings) -> Result<(), PerimeterError> {
    let Settings { range_max_m, bins, pulse_m, pixel_m, threshold, grow_px } = *settings;
    let pixels = 2.0 * range_max_m / pixel_m;
    let settings = [
        ("range_max_m", range_max_m, range_max_m > 0.0 && range_max_m.is_finite(), "above 0"),
        ("bins", bins as f64, (8..=10_000).contains(&bins), "8 to 10,000"),
        ("pulse_m", pulse_m, (0.0..=range_max_m).contains(&pulse_m), "0 to the range"),
        ("pixel_m", pixel_m, (8.0..=4000.0).contains(&pixels), "a 4,000th to an 8th of twice the range"),
        ("threshold", threshold, threshold > 0.0 && threshold <= 1.0, "above 0, at most 1"),
        ("grow_px", grow_px as f64, grow_px <= 100, "at most 100"),
    ];
    match settings.into_iter().find(|(_, _, good, _)| !good) {
        Some((setting, value, _, wanted)) => Err(PerimeterError::Setting { setting, value, wanted }),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests;
