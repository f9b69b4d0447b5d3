//! `[coverage]` and `[[openings]]` of a vehicle file: verdict parameters and declared openings.

use headrace_config::{ConfigError, Section};
use headrace_coverage::openings::Opening;
use headrace_coverage::soundings::NODE_M;
use headrace_geometry::math::{self, TAU};
use headrace_geometry::tunnel::Profile;
use headrace_sampling::target::{CONFIDENCE_SD, Target};

/// Parameters for the verdicts on the wall.
#[derive(Debug, Clone, PartialEq)]
pub struct CoverageConfig {
    /// Maximum difference between the upper and the lower bound of a hole's size, m; zero for the exact search.
    pub hole_tolerance_m: f64,
    /// Deviation from the design profile beyond which a sample contradicts the profile, m.
    ///
    /// A section cannot pass if most of its samples contradict the profile.
    pub contradiction_m: f64,
    /// Edge length of a node of the sounding grid, m.
    pub node_m: f64,
    /// Declared openings of the wall.
    pub openings: Vec<Opening>,
}

impl Default for CoverageConfig {
    fn default() -> Self {
        Self {
            hole_tolerance_m: 0.0,
            contradiction_m: MOST_CONTRADICTION_M,
            node_m: NODE_M,
            openings: Vec::new(),
        }
    }
}

/// Default of `contradiction_m` as a share of the radius, and its upper limit, m.
///
/// The radius is that of a circle whose circumference is the profile's perimeter.
const CONTRADICTION_SHARE: f64 = 0.2;
const MOST_CONTRADICTION_M: f64 = 0.5;
/// Maximum number of samples that fill all openings together.
const MAX_PLACES: i64 = 1_000_000;

impl CoverageConfig {
    /// Returns the default deviation above which a sample contradicts a profile of this perimeter, m.
    ///
    /// It exceeds the thickness of a lining, and the error of a design that is 6 % off. If the vehicle file describes
    /// another tunnel than the inspected one, deviations exceed it.
    pub fn usual_contradiction_m(perimeter_m: f64) -> f64 {
        (CONTRADICTION_SHARE * perimeter_m / TAU).min(MOST_CONTRADICTION_M)
    }

    /// Reads the tables `[coverage]` and `[[openings]]` from the root of a vehicle file.
    ///
    /// The second value of the result is the confidence of verdicts, in standard deviations.
    ///
    /// `profile` or `target_m` is `None` if its keys in the file are invalid. Even then, both tables are checked as far
    /// as possible.
    ///
    /// Errors: a key that is missing, unknown or out of range.
    pub(super) fn of_root(
        root: &Section<'_>,
        profile: Option<&Profile>,
        target_m: Option<f64>,
    ) -> Result<(Self, f64), ConfigError> {
        let perimeter_m = profile.map_or(TAU, Profile::perimeter_m);
        let contradiction_m = Self::usual_contradiction_m(perimeter_m);
        let mut config = Self { contradiction_m, ..Self::default() };
        let mut confidence_sd = CONFIDENCE_SD;
        if let Some(section) = root.section("coverage")? {
            config.contradiction_m =
                section.number("contradiction_m", 0.01..=100.0)?.unwrap_or(config.contradiction_m);
            config.node_m = section.number("node_m", 0.05..=10.0)?.unwrap_or(config.node_m);
            if let Some(confidence) = section.integer("confidence", 1..=3)? {
                confidence_sd = confidence as f64;
            }
            let tolerance_m = root.part(|| parse_tolerance_m(&section, target_m.unwrap_or(1.0)))?;
            config.hole_tolerance_m = tolerance_m.unwrap_or_default();
            section.finish()?;
        }
        for section in root.sections("openings")? {
            config.openings.extend(root.part(|| parse_opening(&section, profile))?);
        }
        let target = Target::new(target_m.unwrap_or(f64::INFINITY));
        let places = |opening: &Opening| opening.places(perimeter_m, target);
        let count = config.openings.iter().map(places).sum::<i64>();
        if count > MAX_PLACES {
            let problem = format!(
                "need {count} samples to fill them, and at most {MAX_PLACES} are allowed; make the openings smaller, or shorten \
                 the tunnel"
            );
            root.part::<()>(|| Err(root.invalid("openings", &problem)))?;
        }
        Ok((config, confidence_sd))
    }
}

fn parse_tolerance_m(section: &Section<'_>, target_m: f64) -> Result<f64, ConfigError> {
    let exact = section.choice("hole", &[("exact", true), ("grid", false)])?.unwrap_or(true);
    let tolerance_m = section.number("tolerance_m", 1e-6..=1.0)?;
    if exact && tolerance_m.is_some() {
        return Err(section.invalid("tolerance_m", "applies to hole = \"grid\" only"));
    }
    Ok(if exact { 0.0 } else { tolerance_m.unwrap_or(target_m / 50.0) })
}

fn parse_opening(section: &Section<'_>, profile: Option<&Profile>) -> Result<Opening, ConfigError> {
    let name = section.required("name", section.text("name")?);
    let from_m = section.required("from_m", section.number("from_m", 0.0..=1.0e5)?);
    let to_m = section.required("to_m", section.number("to_m", 0.0..=1.0e5)?);
    let clock = (section.number("clock_from", 0.0..=12.0)?, section.number("clock_to", 0.0..=12.0)?);
    section.finish()?;
    let (name, from_m, to_m) = (name?, from_m?, to_m?);
    if to_m <= from_m {
        return Err(section.invalid("to_m", "must be larger than from_m"));
    }
    let arc_m = match clock {
        (None, None) => None,
        (Some(from), Some(to)) => profile.map(|profile| {
            let (from_m, to_m) = (arc_at_hour_m(profile, from), arc_at_hour_m(profile, to));
            (from_m, math::wrap(to_m - from_m, profile.perimeter_m()))
        }),
        (Some(_), None) => return Err(section.invalid("clock_from", "needs the key clock_to as well")),
        (None, Some(_)) => return Err(section.invalid("clock_to", "needs the key clock_from as well")),
    };
    Ok(Opening { name, from_m, to_m, arc_m })
}

/// Arc length of a clock position, m.
///
/// The clock is seen from the reference point, looking along the tunnel: 6 is the floor, 9 the left wall.
fn arc_at_hour_m(profile: &Profile, hour: f64) -> f64 {
    let angle = (hour - 6.0) / 12.0 * TAU;
    let direction = [math::sin(angle), -math::cos(angle)];
    let wall = profile.cast(profile.reference(), direction);
    debug_assert!(wall.is_some(), "the wall is visible from the profile's reference point at {hour} o'clock");
    wall.map_or(0.0, |wall| wall.arc_m)
}

#[cfg(test)]
mod tests {
    use super::*;
    use headrace_config::Document;
    use headrace_geometry::tunnel::shapes;

    fn parsed(text: &str) -> Result<(CoverageConfig, f64), ConfigError> {
        let root = Document::new("vehicle.toml", text).root().unwrap();
        CoverageConfig::of_root(&root, Some(&shapes::circle(3.0).unwrap()), Some(0.5))
    }

    #[test]
    fn confidence_is_1_2_or_3_standard_deviations() {
        let confidence_sd = |text: &str| parsed(text).unwrap().1;
        let whole = |value: f64| headrace_geometry::math::round_to_i64(value);
        assert_eq!(whole(confidence_sd("")), 2);
        for k in 1..=3 {
            assert_eq!(whole(confidence_sd(&format!("[coverage]\nconfidence = {k}\n"))), k);
        }
        for wrong in ["0", "4", "2.5", "\"high\""] {
            let why = parsed(&format!("[coverage]\nconfidence = {wrong}\n")).unwrap_err().to_string();
            assert!(why.contains("must be a whole number from 1 to 3"), "{wrong}: {why}");
        }
    }
}
