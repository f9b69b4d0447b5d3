//! Echoes of a turn: strength by angle and range.

use headrace_geometry::math::{self, TAU};

use super::error::PerimeterError;
use super::settings::{Ping, Settings};

/// Echoes of a turn, sorted by angle.
pub(super) struct Echoes {
    angles_rad: Vec<f64>,
    strengths: Vec<Vec<f64>>,
    bin_m: f64,
}

impl Echoes {
    /// Collects all pings with an echo within range. The strongest bin of each ping is scaled to one.
    pub(super) fn of(pings: &[Ping], settings: &Settings) -> Result<Self, PerimeterError> {
        let mut lines: Vec<(f64, Vec<f64>)> = pings
            .iter()
            .filter(|ping| ping.angle_rad.is_finite())
            .filter_map(|ping| Some((math::wrap(ping.angle_rad, TAU), line(&ping.ranges_m, settings)?)))
            .collect();
        lines.sort_by(|a, b| a.0.total_cmp(&b.0));
        lines.dedup_by(|later, first| {
            let same = later.0 <= first.0;
            if same {
                first.1.iter_mut().zip(&later.1).for_each(|(a, b)| *a = a.max(*b));
            }
            same
        });
        if lines.len() < 3 {
            return Err(PerimeterError::TooFewPings { count: lines.len() });
        }
        let (angles_rad, strengths) = lines.into_iter().unzip();
        Ok(Self { angles_rad, strengths, bin_m: settings.range_max_m / settings.bins as f64 })
    }

    /// Strength at an angle in [0, TAU) and a range; zero beyond the last bin.
    ///
    /// The value is interpolated bilinearly between pings and bins.
    pub(super) fn at(&self, angle_rad: f64, range_m: f64) -> f64 {
        let count = self.angles_rad.len();
        let after = self.angles_rad.partition_point(|angle| *angle <= angle_rad);
        let (a, b) = ((after + count - 1) % count, after % count);
        let width = math::wrap(self.angles_rad[b] - self.angles_rad[a], TAU);
        let share = math::wrap(angle_rad - self.angles_rad[a], TAU) / width;
        (1.0 - share) * self.along(a, range_m) + share * self.along(b, range_m)
    }

    fn along(&self, ping: usize, range_m: f64) -> f64 {
        let at = range_m / self.bin_m - 0.5;
        let index = math::floor_to_i64(at);
        let share = at - index as f64;
        let value = |k: i64| {
            let line = &self.strengths[ping];
            usize::try_from(k).ok().and_then(|k| line.get(k)).copied().unwrap_or(0.0)
        };
        (1.0 - share) * value(index) + share * value(index + 1)
    }
}

/// Strengths of a ping's bins; `None` without any echo.
///
/// Each ray adds an echo of the pulse's length, centred on the ray's range. All echoes have equal area.
fn line(ranges_m: &[f64], settings: &Settings) -> Option<Vec<f64>> {
    let bin_m = settings.range_max_m / settings.bins as f64;
    // An echo is made at least one bin long. Otherwise it falls into one or two bins, depending on its position.
    let half = settings.pulse_m.max(bin_m) / 2.0;
    let mut bins = vec![0.0; settings.bins];
    for range_m in ranges_m.iter().filter(|r| r.is_finite() && **r >= 0.0 && **r < settings.range_max_m) {
        let (from, to) = ((range_m - half) / bin_m, (range_m + half) / bin_m);
        let first = crate::index(math::floor_to_i64(from));
        for (bin, strength) in bins.iter_mut().enumerate().skip(first) {
            let overlap = to.min(bin as f64 + 1.0) - from.max(bin as f64);
            if overlap <= 0.0 {
                break;
            }
            *strength += overlap;
        }
    }
    let strongest = bins.iter().copied().fold(0.0, f64::max);
    (strongest > 0.0).then(|| bins.into_iter().map(|b| b / strongest).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn turn(range_m: f64) -> Echoes {
        let ping = |k: u32| Ping { angle_rad: f64::from(k) * 0.1 + 0.05, ranges_m: vec![range_m; 3] };
        Echoes::of(&(0..62).map(ping).collect::<Vec<_>>(), &Settings::of_paper()).unwrap()
    }

    #[test]
    fn echo_is_centred_on_its_range_at_every_angle() {
        for range_m in [1.0, 4.003, 9.0] {
            let echoes = turn(range_m);
            for angle in [0.0, 0.01, 3.0, 6.2, TAU - 1e-9] {
                let (mut sum, mut moment) = (0.0, 0.0);
                for k in 0..10_000 {
                    let r = f64::from(k) * 0.001;
                    let strength = echoes.at(angle, r);
                    sum += strength;
                    moment += strength * r;
                }
                assert!((moment / sum - range_m).abs() < 1e-3, "{range_m} {angle}: {}", moment / sum);
            }
        }
    }

    #[test]
    fn invalid_ranges_are_left_out() {
        let settings = Settings::of_paper();
        for range in [f64::NAN, f64::INFINITY, -1.0, 10.0, 1e300] {
            assert!(line(&[range], &settings).is_none(), "{range}");
        }
        assert!(line(&[0.0], &settings).is_some() && line(&[9.999], &settings).is_some());
    }
}
