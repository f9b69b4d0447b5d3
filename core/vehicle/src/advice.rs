//! `[advice]` of a vehicle file: settings of the rays that locate the wall for the speed advice.

use core::ops::RangeInclusive;

use headrace_config::{ConfigError, Section};
use headrace_geometry::math;
use headrace_sampling::advice::Looks;

/// Allowed angles between the rays of a ring, degrees. A ring of rays is cast from a head all round the wall.
///
/// The command `plan` uses the finest angle. With angles above 1 degree, the advice would round up the angular steps of
/// every mode.
const RING_DEG: RangeInclusive<f64> = 0.1..=1.0;
/// Allowed movements of the vehicle across the tunnel after which a ring of rays is cast again, m.
const LOOK_M: RangeInclusive<f64> = 0.001..=0.1;

/// Reads the `[advice]` table of a vehicle file.
///
/// Errors: a key that is unknown or out of range.
pub(super) fn parse_looks(section: &Section<'_>) -> Result<Looks, ConfigError> {
    let mut looks = Looks::default();
    if let Some(ring_deg) = section.number("ring_deg", RING_DEG)? {
        let rays = math::round_to_i64(360.0 / ring_deg);
        looks.ring = u32::try_from(rays).map_err(|_| section.invalid("ring_deg", "gives no valid ring"))?;
    }
    looks.anew_m = section.number("look_m", LOOK_M)?;
    section.finish()?;
    Ok(looks)
}

#[cfg(test)]
mod tests {
    use super::*;
    use headrace_config::Document;

    fn parsed(text: &str) -> Result<Looks, ConfigError> {
        let root = Document::new("vehicle.toml", text).root().unwrap();
        let section = root.section("advice")?.unwrap();
        parse_looks(&section)
    }

    #[test]
    fn ray_angle_sets_the_number_of_rays() {
        assert_eq!(parsed("[advice]\n").unwrap(), Looks::default());
        assert_eq!(
            parsed("[advice]\nring_deg = 0.3\n").unwrap(),
            Looks::default(),
            "the default is 0.3 degrees"
        );
        assert_eq!(
            parsed("[advice]\nring_deg = 0.7\nlook_m = 0.001\n").unwrap(),
            Looks { ring: 514, anew_m: Some(0.001) }
        );
    }

    #[test]
    fn error_for_a_value_out_of_range_names_line_key_value_and_range() {
        let why = parsed("[advice]\nring_deg = 0.05\n").unwrap_err().to_string();
        assert!(
            why.contains("vehicle.toml:2: advice.ring_deg = 0.05: must be a number from 0.1 to 1"),
            "{why}"
        );
        let why = parsed("[advice]\nlook_m = 1\n").unwrap_err().to_string();
        assert!(
            why.contains("vehicle.toml:2: advice.look_m = 1: must be a number from 0.001 to 0.1"),
            "{why}"
        );
        assert!(parsed("[advice]\nrings = 3\n").is_err());
    }
}
