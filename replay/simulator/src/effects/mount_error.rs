//! Mounts of sensors that differ from the vehicle file.

use headrace_config::{ConfigError, Section};
use headrace_geometry::frames::{Body, Mount, Rot, Sensor, Vec3};

use super::effect::{Effect, EffectKind};
use super::keys;
use super::line_delay::SENSES;
use super::targets::PerSensor;
use crate::builder::Builder;
use crate::error::SceneError;
use crate::facts::Facts;
use crate::sensing::Mounted;

/// A sensor's true mount differs from the mount in the vehicle file. The loop uses the vehicle file.
///
/// `position_m` and `angles_deg` (roll, pitch and yaw, applied before the file's angles) are added to the mounts of all
/// named sensors. `position_sd_m`, up to 1, and `angles_sd_deg`, up to 30, are the standard deviations of additional
/// errors, which are drawn for each axis and sensor. A head that occludes other heads does so from its position in the
/// file.
pub(super) struct MountErrorKind;

#[derive(Debug, Clone, Copy)]
struct Parameters {
    position_m: [f64; 3],
    angles_rad: [f64; 3],
    position_sd_m: f64,
    angles_sd_rad: f64,
}

impl EffectKind for MountErrorKind {
    fn name(&self) -> &'static str {
        "mount_error"
    }

    fn summary(&self) -> &'static str {
        "sensor mounts differ from the vehicle file"
    }

    fn read(&self, tables: Vec<Section<'_>>, facts: &Facts) -> Result<Box<dyn Effect>, ConfigError> {
        Ok(Box::new(PerSensor::read(tables, facts, &SENSES, |table| {
            let position_m = table.triple("position_m", -1.0..=1.0)?;
            let angles_deg = table.triple("angles_deg", -180.0..=180.0)?;
            let position_sd_m = keys::or_zero(table, "position_sd_m", 0.0..=1.0)?;
            let angles_sd_deg = keys::or_zero(table, "angles_sd_deg", 0.0..=30.0)?;
            if position_m.is_none() && angles_deg.is_none() {
                let sds = [("position_sd_m", position_sd_m), ("angles_sd_deg", angles_sd_deg)];
                keys::some_not_zero(table, &sds)?;
            }
            Ok(Parameters {
                position_m: position_m.unwrap_or_default(),
                angles_rad: angles_deg.unwrap_or_default().map(f64::to_radians),
                position_sd_m,
                angles_sd_rad: angles_sd_deg.to_radians(),
            })
        })?))
    }
}

impl Effect for PerSensor<Parameters> {
    fn build(&self, sim: &mut Builder<'_>) -> Result<(), SceneError> {
        for (source, parameters) in &self.0 {
            let Some(mount) = sim.mount(*source) else { continue };
            let is_drawn = parameters.position_sd_m > 0.0 || parameters.angles_sd_rad > 0.0;
            let drawn = is_drawn.then(|| {
                let stream = sim.stream(*source);
                [0, 1, 2].map(|axis| stream.block(axis, 0).normal())
            });
            sim.insert(*source, Mounted(parameters.moved(&mount, drawn.unwrap_or_default())));
        }
        Ok(())
    }
}

impl Parameters {
    /// The mount with its error. `drawn` has, for each axis, the errors of position and angle in standard deviations.
    fn moved(&self, mount: &Mount, drawn: [[f64; 2]; 3]) -> Mount {
        let off_m = [0, 1, 2].map(|axis: usize| {
            let [place, _] = drawn.get(axis).copied().unwrap_or_default();
            self.position_m.get(axis).copied().unwrap_or_default() + self.position_sd_m * place
        });
        let [roll, pitch, yaw] = [0, 1, 2].map(|axis: usize| {
            let [_, angle] = drawn.get(axis).copied().unwrap_or_default();
            self.angles_rad.get(axis).copied().unwrap_or_default() + self.angles_sd_rad * angle
        });
        let turned = Rot::<Sensor, Sensor>::from_roll_pitch_yaw(roll, pitch, yaw);
        let [x, y, z] = off_m;
        Mount { position: mount.position + Vec3::<Body>::new(x, y, z), rotation: mount.rotation * turned }
    }
}

#[cfg(test)]
mod tests {
    use headrace_geometry::math;

    use super::*;
    use crate::testing::Dive;

    /// Compares ranges with those of a head on the axis of a rectangle.
    ///
    /// If the mount is rolled by an angle, a beam meets the wall like an unrolled beam at another angle. If the mount
    /// is moved sideways, the beam starts at the moved position.
    #[test]
    fn turned_and_moved_head_sees_walls_from_its_true_mount() {
        let dive = Dive::with_head();
        let keys = "[effects.mount_error]\nposition_m = [0, 0.25, 0.5]\nangles_deg = [3, 0, 0]";
        let dived = dive.dive(keys);
        assert!(!dived.rows.is_empty());
        for row in &dived.rows {
            let sounding = row.sounding.unwrap();
            // The head's angle is 0 straight down and grows clockwise, seen looking ahead. y is left, z up. The roll
            // turns y towards z, so the left side goes up.
            let turned_rad = sounding.measured.angle_rad + f64::to_radians(3.0);
            let (sine, cosine) = math::sin_cos(turned_rad);
            let (y, z) = (0.25 + row.pose.position.y(), 0.5 + row.pose.position.z());
            let across_m = if sine > 0.0 { (3.0 - y) / sine } else { (3.0 + y) / -sine };
            let up_m = if cosine < 0.0 { (5.0 - z) / -cosine } else { z / cosine };
            let expected_m = across_m.min(up_m);
            let range_m = sounding.measured.range_m.unwrap();
            assert!((range_m - expected_m).abs() < 1e-9, "{turned_rad}: {range_m}, not {expected_m}");
        }
    }

    #[test]
    fn mount_errors_have_the_given_sd_and_are_independent_between_sensors() {
        let mut places = Vec::new();
        for seed in 0..200 {
            let dive = Dive { seed, seconds: 0.2, ..Dive::with_heads(&[[0.3, 0.0, 0.0], [-0.3, 0.0, 0.0]]) };
            let dived = dive.dive("[effects.mount_error]\nposition_sd_m = 0.01");
            for source in [0, 1] {
                let row = dived.rows.iter().find(|row| row.source == source).unwrap();
                places.push(row.sounding.unwrap().origin.z() - row.pose.position.z());
            }
        }
        let n = places.len() as f64;
        let variance = places.iter().map(|m| m * m).sum::<f64>() / n;
        assert!((variance / 1e-4 - 1.0).abs() < 5.0 * math::sqrt(2.0 / n), "{variance}");
        let pairs = places.chunks(2).map(|pair| pair[0] * pair[1]).sum::<f64>() / (n / 2.0);
        assert!(pairs.abs() < 5e-4 / math::sqrt(n / 2.0), "{pairs}");
    }

    /// A beam is perpendicular to the head's axis. Roll turns the beam within its plane of turning; pitch and yaw turn
    /// it out of this plane.
    #[test]
    fn mount_angle_errors_have_the_given_sd_about_each_axis() {
        let sd_rad = f64::to_radians(0.5);
        let (mut within, mut out) = (Vec::new(), Vec::new());
        for seed in 0..400 {
            let dive = Dive { seed, seconds: 0.2, ..Dive::with_head() };
            let [plain, turned] = ["", "[effects.mount_error]\nangles_sd_deg = 0.5"]
                .map(|effects| dive.dive(effects).rows.first().unwrap().sounding.unwrap().direction);
            let angle_rad = |y: f64, z: f64| math::atan2(z, y);
            let by_rad = angle_rad(turned.y(), turned.z()) - angle_rad(plain.y(), plain.z());
            within.push(math::wrap_signed(by_rad, math::TAU));
            out.push(turned.x() - plain.x());
        }
        for errors in [within, out] {
            let n = errors.len() as f64;
            let variance = errors.iter().map(|rad| rad * rad).sum::<f64>() / n / (sd_rad * sd_rad);
            assert!((variance - 1.0).abs() < 5.0 * math::sqrt(2.0 / n), "{variance}");
        }
    }

    /// On a sensor that looks to the left, the sensor's x is the vehicle's y. A roll turns z backwards, and a pitch
    /// turns x down.
    #[test]
    fn angle_errors_act_about_the_axes_of_the_sensor() {
        let left = Mount {
            position: Vec3::new(0.3, 0.0, 0.0),
            rotation: Rot::from_roll_pitch_yaw(0.0, 0.0, math::TAU / 4.0),
        };
        let angle_rad = f64::to_radians(5.0);
        let (sine, cosine) = math::sin_cos(angle_rad);
        let none =
            Parameters { position_m: [0.0; 3], angles_rad: [0.0; 3], position_sd_m: 0.0, angles_sd_rad: 0.0 };
        for (angles_rad, axis, expected) in [
            ([angle_rad, 0.0, 0.0], [0.0, 0.0, 1.0], [sine, 0.0, cosine]),
            ([0.0, angle_rad, 0.0], [1.0, 0.0, 0.0], [0.0, cosine, -sine]),
            ([0.0, 0.0, angle_rad], [1.0, 0.0, 0.0], [-sine, cosine, 0.0]),
        ] {
            let [x, y, z] = axis;
            let moved = Parameters { angles_rad, ..none }.moved(&left, [[0.0; 2]; 3]);
            let found = moved.rotation * Vec3::<Sensor>::new(x, y, z);
            let [x, y, z] = expected;
            assert!((found + Vec3::<Body>::new(-x, -y, -z)).norm() < 1e-12, "{angles_rad:?}: {found:?}");
            assert!((moved.position + left.position.scaled(-1.0)).norm() < 1e-12);
        }
    }

    #[test]
    fn time_slice_length_does_not_change_results() {
        Dive::with_head().assert_slices_dont_matter("[effects.mount_error]\nangles_sd_deg = 2");
        let refusal = Dive::with_head().refusal("[effects.mount_error]");
        assert!(refusal.contains("angles_sd_deg must not be zero"), "{refusal}");
    }
}
