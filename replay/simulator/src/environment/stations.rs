//! Scale of the tunnel's profile along the tunnel.

use headrace_config::{ConfigError, Section};

/// Largest allowed change, per metre of chainage, of the distance between the wall and the floor's centre.
const STEEPEST: f64 = 1.0;

/// Scale of the profile by chainage: linear between stations, constant before the first and after the last station, and
/// 1 without stations.
#[derive(Debug, Clone, Default)]
pub(super) struct Scales {
    /// Chainage, m, and scale of each station, in order of chainage.
    stations: Vec<(f64, f64)>,
}

impl Scales {
    /// Reads the `[[tunnel.stations]]` tables. `farthest_m` is the largest distance of the wall from the floor's
    /// centre, m.
    ///
    /// Errors: a key is missing, unknown or out of range, stations are out of order, or the scale changes too steeply
    /// between two stations.
    pub(super) fn parse(
        sections: Vec<Section<'_>>,
        farthest_m: f64,
        length_m: f64,
    ) -> Result<Self, ConfigError> {
        let mut stations: Vec<(f64, f64)> = Vec::new();
        for section in sections {
            let chainage_m = section.required("chainage_m", section.number("chainage_m", 0.0..=length_m)?)?;
            let scale = section.required("scale", section.number("scale", 0.2..=5.0)?)?;
            if let Some((before_m, before)) = stations.last() {
                if chainage_m <= *before_m {
                    let problem = format!("must be above the previous station's chainage, {before_m} m");
                    return Err(section.invalid("chainage_m", &problem));
                }
                let least_m = (scale - before).abs() * farthest_m / STEEPEST;
                if chainage_m - before_m < least_m {
                    let problem = format!(
                        "moves the wall by {least_m:.3} m within {:.3} m of tunnel; at most {STEEPEST} m a metre is allowed",
                        chainage_m - before_m
                    );
                    return Err(section.invalid("scale", &problem));
                }
            }
            section.finish()?;
            stations.push((chainage_m, scale));
        }
        Ok(Self { stations })
    }

    /// Chainages of the stations, m. The slope of the profile's scale changes there.
    pub(super) fn breaks(&self) -> impl Iterator<Item = f64> + '_ {
        self.stations.iter().map(|station| station.0)
    }

    /// Scale of the profile at `chainage_m`.
    pub(super) fn at(&self, chainage_m: f64) -> f64 {
        let after = self.stations.partition_point(|station| station.0 <= chainage_m);
        match (after.checked_sub(1).and_then(|before| self.stations.get(before)), self.stations.get(after)) {
            (Some((from_m, from)), Some((to_m, to))) => {
                from + (to - from) * ((chainage_m - from_m) / (to_m - from_m))
            }
            (Some((_, only)), None) | (None, Some((_, only))) => *only,
            (None, None) => 1.0,
        }
    }

    /// Slope of the profile's scale between two chainages, 1/m. No station may lie between them.
    pub(super) fn slope_pm(&self, from_m: f64, to_m: f64) -> f64 {
        if from_m.is_finite() && to_m.is_finite() {
            (self.at(to_m) - self.at(from_m)) / (to_m - from_m)
        } else {
            0.0
        }
    }

    /// Whether the profile's scale is 1 everywhere.
    #[expect(clippy::float_cmp, reason = "any other scale, however near, is one")]
    pub(super) fn is_one(&self) -> bool {
        self.stations.iter().all(|station| station.1 == 1.0)
    }

    /// The largest scale of the profile at any chainage.
    pub(super) fn largest(&self) -> f64 {
        self.stations.iter().map(|station| station.1).reduce(f64::max).unwrap_or(1.0)
    }

    /// The smallest scale of the profile between two chainages.
    pub(super) fn smallest(&self, from_m: f64, to_m: f64) -> f64 {
        let within = self.stations.iter().filter(|station| (from_m..=to_m).contains(&station.0));
        within.map(|station| station.1).fold(self.at(from_m).min(self.at(to_m)), f64::min)
    }
}
