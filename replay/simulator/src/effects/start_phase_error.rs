//! Errors of the phases at which heads start to turn.

use headrace_config::{ConfigError, Section};
use headrace_geometry::math::{self, TAU};
use headrace_sampling::head::HeadProgram;
use headrace_sensor::device::Sense;

use super::effect::{Effect, EffectKind};
use super::targets::PerSensor;
use super::targets::targets;
use crate::builder::{Builder, Programs};
use crate::error::SceneError;
use crate::facts::Facts;
use crate::random::Stream;

/// Each head starts at a phase other than its program's, and reports its true angle.
///
/// A head that turns continuously starts at another angle. A head in a sector keeps its sector and starts at another
/// point of its sweep. With `max_deg`, the angle is uniformly distributed up to this value either way. With `sd_deg`,
/// it is normally distributed. `offsets_deg` gives the angles, one for each head of the table, in order. Without any of
/// these keys, `max_deg` is 180. In a sector the angle is a fraction of the sweep: 360 degrees stand for one sweep
/// there and back. Source: Jorge et al. 2021, §8.2 (Figure 12, without alignment).
pub(super) struct StartPhaseErrorKind;

#[derive(Debug, Clone, PartialEq)]
enum Offset {
    Even { max_rad: f64 },
    Normal { sd_rad: f64 },
    Given(Vec<(usize, f64)>),
}

impl EffectKind for StartPhaseErrorKind {
    fn name(&self) -> &'static str {
        "start_phase_error"
    }

    fn summary(&self) -> &'static str {
        "heads start with a phase error"
    }

    fn read(&self, tables: Vec<Section<'_>>, facts: &Facts) -> Result<Box<dyn Effect>, ConfigError> {
        let read = |table: &Section<'_>| offset(table, facts);
        Ok(Box::new(PerSensor::read(tables, facts, &[Sense::Head], read)?))
    }
}

fn offset(table: &Section<'_>, facts: &Facts) -> Result<Offset, ConfigError> {
    let degrees = |key, most: f64| table.number(key, 0.0..=most).map(|deg| deg.map(f64::to_radians));
    let given = table.numbers("offsets_deg", -360.0..=360.0)?;
    match (degrees("max_deg", 180.0)?, degrees("sd_deg", 180.0)?, given) {
        (None, None, None) => Ok(Offset::Even { max_rad: headrace_geometry::math::PI }),
        (Some(max_rad), None, None) => Ok(Offset::Even { max_rad }),
        (None, Some(sd_rad), None) => Ok(Offset::Normal { sd_rad }),
        (None, None, Some(given)) => {
            let heads = targets(table, facts, &[Sense::Head])?;
            if heads.len() != given.len() {
                let problem = format!("must be {} numbers, one for each head of this table", heads.len());
                return Err(table.invalid("offsets_deg", &problem));
            }
            Ok(Offset::Given(heads.into_iter().zip(given.into_iter().map(f64::to_radians)).collect()))
        }
        _ => {
            let problem = "has more than one of max_deg, sd_deg and offsets_deg; give one of them";
            Err(table.invalid_itself(problem))
        }
    }
}

impl Offset {
    fn rad(&self, source: usize, stream: Stream) -> f64 {
        match self {
            Self::Even { max_rad } => max_rad * (2.0 * stream.at(0).uniform()[0] - 1.0),
            Self::Normal { sd_rad } => sd_rad * stream.at(0).normal()[0],
            Self::Given(given) => given.iter().find(|(head, _)| *head == source).map_or(0.0, |(_, rad)| *rad),
        }
    }
}

impl Effect for PerSensor<Offset> {
    fn begin(&self, programs: &mut Programs<'_>) {
        for (source, offset) in &self.0 {
            let off_rad = offset.rad(*source, programs.stream(*source));
            programs.change(*source, |program| begun_off(program, off_rad));
        }
    }

    fn build(&self, _sim: &mut Builder<'_>) -> Result<(), SceneError> {
        Ok(())
    }
}

/// Returns the program, shifted by `off_rad`. In a sector, the shift is the fraction `off_rad` / 2 pi of a sweep there
/// and back.
fn begun_off(program: HeadProgram, off_rad: f64) -> HeadProgram {
    let Some((least_rad, size_rad)) = program.sector else {
        return HeadProgram { start_rad: program.start_rad + off_rad, ..program };
    };
    let above_rad = program.start_rad - least_rad;
    // Position in a sweep there and back. First the head's angle grows up to `size_rad`, then it falls.
    let along_rad = if program.growing { above_rad } else { 2.0 * size_rad - above_rad };
    let along_rad = math::wrap(along_rad + off_rad / TAU * 2.0 * size_rad, 2.0 * size_rad);
    let growing = along_rad < size_rad;
    let above_rad = if growing { along_rad } else { 2.0 * size_rad - along_rad };
    HeadProgram { start_rad: least_rad + above_rad, growing, ..program }
}

#[cfg(test)]
mod tests {
    use headrace_sensor::measurement::Sounding;

    use super::*;
    use crate::testing_motion::{Bench, refusal};

    const KEYS: &str = "[effects.start_phase_error]\n";

    #[test]
    fn each_head_keeps_and_reports_its_own_phase_error() {
        let keys = format!("{KEYS}offsets_deg = [10.0, -33.0]\nsensors = [\"head_b\", \"head_a\"]\n");
        for (head, off_deg) in [("head_b", 10.0_f64), ("head_a", -33.0)] {
            let (plain, off) =
                (Bench::turning("").run::<Sounding>(head), Bench::turning(&keys).run::<Sounding>(head));
            assert_eq!(plain.len(), off.len());
            for (plain, off) in plain.iter().zip(&off) {
                // The tested head turns in steps of 0.3 degrees, so a start angle is rounded by up to half a step.
                let by_rad = off.angle_rad - plain.angle_rad - off_deg.to_radians();
                assert!(math::wrap_signed(by_rad, TAU).abs() < f64::to_radians(0.150_1));
                assert_eq!(off.angle_rad.to_bits(), off.reported_rad.to_bits());
            }
        }
    }

    #[test]
    fn phase_error_shifts_the_start_within_an_unchanged_sector() {
        let program = HeadProgram { start_rad: 1.0, growing: true, sector: Some((1.0, 2.0)) };
        let begun = |off_deg: f64| {
            let HeadProgram { start_rad, growing, sector } = begun_off(program, off_deg.to_radians());
            assert_eq!(sector, program.sector);
            (math::round_to_i64(start_rad * 1e9) as f64 / 1e9, growing)
        };
        // The sector is 2 rad wide, so a sweep there and back is 4 rad long.
        assert_eq!([begun(0.0), begun(90.0), begun(270.0)], [(1.0, true), (2.0, true), (2.0, false)]);
        assert_eq!([begun(-90.0), begun(180.0), begun(360.0)], [(2.0, false), (3.0, false), (1.0, true)]);
        let back = HeadProgram { start_rad: 3.0, growing: false, ..program };
        assert!((begun_off(back, f64::to_radians(90.0)).start_rad - 2.0).abs() < 1e-12);
    }

    #[test]
    fn random_start_angles_follow_their_distribution() {
        let count = 20_000_u64;
        let angles = |offset: Offset| {
            let draw = |seed| offset.rad(0, Stream::new(seed, "start_phase_error", "head"));
            let angles: Vec<f64> = (0..count).map(draw).collect();
            let n = count as f64;
            let mean = angles.iter().sum::<f64>() / n;
            let most = angles.iter().fold(0.0, |most: f64, angle| most.max(angle.abs()));
            (mean, angles.iter().map(|a| a * a).sum::<f64>() / n, most)
        };
        let tolerance = 5.0 / headrace_geometry::math::sqrt(count as f64);
        let (mean, variance, most) = angles(Offset::Even { max_rad: 0.3 });
        assert!(mean.abs() < 0.3 * tolerance && most <= 0.3 && (variance / 0.03 - 1.0).abs() < tolerance);
        let (mean, variance, _) = angles(Offset::Normal { sd_rad: 0.2 });
        assert!(mean.abs() < 0.2 * tolerance && (variance / 0.04 - 1.0).abs() < 1.5 * tolerance);
    }

    #[test]
    fn invalid_phase_errors_are_refused() {
        let why = |keys: &str| refusal(&format!("{KEYS}{keys}"));
        assert!(why("max_deg = 1\nsd_deg = 2").contains("more than one of max_deg, sd_deg"));
        assert!(why("offsets_deg = [1]").contains("must be 2 numbers"));
        assert!(why("max_deg = 181").contains("from 0 to 180"));
        assert!(why("sensors = [\"depth\"]").contains("can act on: head_a, head_b"));
    }
}
