//! Parameters of a replay, which override the parameters in its log.

use std::collections::BTreeMap;
use std::ops::RangeInclusive;

use headrace_vehicle::VehicleConfig;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use crate::Error;

/// Allowed targets, m; the same as for `headrace replay --target`.
const TARGET_M: RangeInclusive<f64> = 0.01..=20.0;
/// Allowed section lengths, m.
const SECTION_M: RangeInclusive<f64> = 0.05..=10.0;
/// Allowed speeds of sound, m/s.
const SOUND_SPEED_MPS: RangeInclusive<f64> = 1300.0..=1700.0;

/// Parameters of a replay. Each one defaults to the setting of the vehicle file attached to the log.
///
/// The length of a tick isn't a parameter, because no result depends on it.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Parameters {
    /// Target T: the largest hole that passes, m, 0.01 to 20.
    pub target_m: Option<f64>,
    /// Length of a section along the tunnel, m, 0.05 to 10.
    pub section_m: Option<f64>,
    /// Speed of sound in the water, m/s, 1300 to 1700.
    pub sound_speed_mps: Option<f64>,
    /// Text of a vehicle file that replaces the log's.
    pub vehicle: Option<String>,
    /// Texts of the files that `vehicle` names. The key is the file's name. Other files are taken from the log.
    pub vehicle_files: BTreeMap<String, String>,
    /// Judge along the smoothed trajectory.
    pub smooth: bool,
}

impl Parameters {
    /// Digest of all parameters, as 16 hexadecimal digits. It is the same in any process and on any machine.
    pub fn digest(&self) -> String {
        let mut hasher = Sha256::new();
        let mut put = |bytes: &[u8]| {
            hasher.update((bytes.len() as u64).to_le_bytes());
            hasher.update(bytes);
        };
        for number in [self.target_m, self.section_m, self.sound_speed_mps] {
            put(number.map(|number| number.to_bits().to_le_bytes()).as_ref().map_or(&[], |bytes| bytes));
        }
        put(if self.vehicle.is_some() { b"vehicle" } else { b"" });
        put(self.vehicle.as_deref().unwrap_or_default().as_bytes());
        for (name, text) in &self.vehicle_files {
            put(name.as_bytes());
            put(text.as_bytes());
        }
        put(if self.smooth { b"smooth" } else { b"" });
        crate::hex(&hasher.finalize(), 8)
    }

    /// Overrides a vehicle's settings by these parameters.
    ///
    /// Errors: a value is out of its range.
    pub(crate) fn apply(&self, vehicle: &mut VehicleConfig) -> Result<(), Error> {
        if let Some(target_m) = within("target_m", self.target_m, TARGET_M)? {
            vehicle.target.max_hole_m = target_m;
        }
        if let Some(section_m) = within("section_m", self.section_m, SECTION_M)? {
            vehicle.section_m = section_m;
        }
        if let Some(speed_mps) = within("sound_speed_mps", self.sound_speed_mps, SOUND_SPEED_MPS)? {
            vehicle.site.sound_speed_mps = speed_mps;
        }
        Ok(())
    }

    /// Checks that every value is in its range. Campaigns call this before they open the first log.
    ///
    /// Errors: a value is out of its range.
    pub fn check(&self) -> Result<(), Error> {
        within("target_m", self.target_m, TARGET_M)?;
        within("section_m", self.section_m, SECTION_M)?;
        within("sound_speed_mps", self.sound_speed_mps, SOUND_SPEED_MPS).map(|_| ())
    }
}

fn within(
    name: &'static str,
    value: Option<f64>,
    allowed: RangeInclusive<f64>,
) -> Result<Option<f64>, Error> {
    match value {
        Some(value) if !allowed.contains(&value) => {
            Err(Error::Parameter { name, value, from: *allowed.start(), to: *allowed.end() })
        }
        value => Ok(value),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_parameter_changes_the_digest() {
        let of = |change: fn(&mut Parameters)| {
            let mut parameters = Parameters::default();
            change(&mut parameters);
            parameters.digest()
        };
        let all = [
            of(|_| ()),
            of(|p| p.target_m = Some(0.3)),
            of(|p| p.target_m = Some(0.6)),
            of(|p| p.section_m = Some(0.3)),
            of(|p| p.sound_speed_mps = Some(1450.0)),
            of(|p| p.vehicle = Some(String::new())),
            of(|p| p.vehicle = Some("x".to_owned())),
            of(|p| p.vehicle_files = [("x".to_owned(), String::new())].into()),
            of(|p| p.smooth = true),
        ];
        let different: std::collections::BTreeSet<_> = all.iter().collect();
        assert_eq!(different.len(), all.len(), "{all:?}");
        assert_eq!(all[0], "17b0761f87b081d5");
        let refused = Parameters { target_m: Some(0.0), ..Parameters::default() }.check();
        assert_eq!(refused.unwrap_err().to_string(), "target_m = 0: must be from 0.01 to 20");
        assert!(Parameters { section_m: Some(f64::NAN), ..Parameters::default() }.check().is_err());
    }
}
