//! Navigation without a filter, after the paper's §9.2: attitude from the IMU, chainage from the tether, the place in
//! the cross-section from the echosounders' ranges to the design profile, depth where they are silent.
//!
//! Good for data without much noise, and the yardstick for a filter.

use super::{Fix, Navigation, NoFix, SensorInfo, SensorKind};
use crate::app::MAX_SOURCES;
use crate::app::reading::{EchoRange, Level, Reading, TetherLength};
use crate::frames::{Body, Mount, Point3, Pose, Rot, Sensor, Tunnel, Vec3};
use crate::math;
use crate::site::Site;
use crate::time::{DurNs, MonoNs};
use crate::tunnel::Profile;

/// Ranges older than this don't take part in finding the place in the section.
const ECHO_AGE: DurNs = DurNs(500_000_000);
/// An attitude or a place older than this is no fix.
const STALE: DurNs = DurNs(2_000_000_000);
/// Tether readings over which the speed is taken: those of the last second, at most so many.
const SPEED_WINDOW: DurNs = DurNs(1_000_000_000);
const SPEED_READINGS: usize = 64;
/// Weight of an echo against the prior place, as standard deviations, m.
const ECHO_SIGMA_M: f64 = 0.01;
const PRIOR_Y_SIGMA_M: f64 = 10.0;
const PRIOR_Z_SIGMA_M: f64 = 1.0;

/// See the module's description.
pub struct DirectNavigation {
    profile: Profile,
    site: Site,
    attitude: Option<(MonoNs, Rot<Tunnel, Body>)>,
    tether: TetherTrack,
    echoes: [Option<Echo>; MAX_SOURCES],
    place: Option<(MonoNs, [f64; 2])>,
    /// Height by pressure, and by how much the echoes have shown it to be off, m.
    height_m: Option<f64>,
    height_offset_m: f64,
}

#[derive(Debug, Clone, Copy)]
struct Echo {
    at: MonoNs,
    mount: Mount,
    range_m: f64,
}

/// The last readings of the cable counter, as chainages.
#[derive(Debug, Clone)]
struct TetherTrack {
    readings: [(MonoNs, f64); SPEED_READINGS],
    count: usize,
    resolution_m: f64,
}

impl DirectNavigation {
    /// Nothing is known yet.
    pub fn new(profile: Profile, site: Site) -> Self {
        Self {
            profile,
            site,
            attitude: None,
            tether: TetherTrack { readings: [(MonoNs(0), 0.0); SPEED_READINGS], count: 0, resolution_m: 0.0 },
            echoes: [None; MAX_SOURCES],
            place: None,
            height_m: None,
            height_offset_m: 0.0,
        }
    }

    fn take_attitude(&mut self, at: MonoNs, mount: &Mount, level_from_sensor: Rot<Level, Sensor>) {
        let tunnel_from_level = Rot::<Tunnel, Level>::from_roll_pitch_yaw(0.0, 0.0, -self.site.axis_yaw_rad);
        self.attitude = Some((at, tunnel_from_level * level_from_sensor * mount.rotation.inverse()));
    }

    fn take_echo(&mut self, source: usize, at: MonoNs, mount: &Mount, echo: &EchoRange) {
        let Some(range_m) = echo.range_m else { return };
        let range_m = self.site.rescaled_range_m(range_m, echo.sound_speed_mps);
        if let Some(slot) = self.echoes.get_mut(source) {
            *slot = Some(Echo { at, mount: *mount, range_m });
        }
        self.find_place(at);
    }

    /// Moves the place in the section to where the recent ranges agree best with the profile: Gauss-Newton on
    /// sum((measured - predicted)^2 / sigma^2) with a weak prior, d range / d place = -n / (n . direction).
    fn find_place(&mut self, now: MonoNs) {
        let Some((_, attitude)) = self.attitude else { return };
        let [reference_y, reference_z] = self.profile.reference();
        let prior_z = self.height_m.map_or(reference_z, |height| height + self.height_offset_m);
        let prior = [self.place.map_or(reference_y, |(_, place)| place[0]), prior_z];
        let mut place = self.place.map_or([reference_y, reference_z], |(_, place)| place);
        let mut vertical = false;
        for _ in 0..3 {
            let (wy, wz) = (weight(PRIOR_Y_SIGMA_M), weight(PRIOR_Z_SIGMA_M));
            let (mut hyy, mut hyz, mut hzz) = (wy, 0.0, wz);
            let (mut gy, mut gz) = (wy * (prior[0] - place[0]), wz * (prior[1] - place[1]));
            for echo in self.echoes.iter().flatten().filter(|echo| now.since(echo.at).0.abs() <= ECHO_AGE.0) {
                let offset = attitude * echo.mount.position;
                let beam = attitude * (echo.mount.rotation * Vec3::<Sensor>::new(1.0, 0.0, 0.0));
                let origin = [place[0] + offset.y(), place[1] + offset.z()];
                let Some(hit) = self.profile.cast(origin, [beam.y(), beam.z()]) else { continue };
                let cosine = hit.normal[0] * beam.y() + hit.normal[1] * beam.z();
                if cosine.abs() < 0.1 {
                    continue;
                }
                let slope = [-hit.normal[0] / cosine, -hit.normal[1] / cosine];
                vertical |= slope[1].abs() > 0.7;
                let weight = weight(ECHO_SIGMA_M);
                let residual = echo.range_m - hit.range_m;
                hyy += weight * slope[0] * slope[0];
                hyz += weight * slope[0] * slope[1];
                hzz += weight * slope[1] * slope[1];
                gy += weight * slope[0] * residual;
                gz += weight * slope[1] * residual;
            }
            // The prior keeps the determinant at 1e-2 or more.
            let determinant = hyy * hzz - hyz * hyz;
            let moved = [
                place[0] + (hzz * gy - hyz * gz) / determinant,
                place[1] + (hyy * gz - hyz * gy) / determinant,
            ];
            if !self.profile.contains(moved) {
                break;
            }
            place = moved;
        }
        self.place = Some((now, place));
        if let (true, Some(height_m)) = (vertical, self.height_m) {
            self.height_offset_m = place[1] - height_m;
        }
    }

    fn take_pressure(&mut self, at: MonoNs, mount: &Mount, pressure_pa: f64) {
        let up = self.attitude.map_or(mount.position.z(), |(_, attitude)| (attitude * mount.position).z());
        let height_m = self.site.surface_above_floor_m - self.site.depth_m(pressure_pa) - up;
        self.height_m = Some(height_m);
        // Where the echoes say nothing of height, depth alone moves the place.
        let silent = self.echoes.iter().flatten().all(|echo| at.since(echo.at).0.abs() > ECHO_AGE.0);
        if let (true, Some((_, place))) = (silent, &mut self.place) {
            place[1] = height_m + self.height_offset_m;
        }
    }
}

/// Weight of an observation of this standard deviation.
const fn weight(sigma_m: f64) -> f64 {
    1.0 / (sigma_m * sigma_m)
}

impl TetherTrack {
    fn take(&mut self, at: MonoNs, zero_at_m: f64, scale: f64, reading: &TetherLength) {
        let chainage_m = zero_at_m + scale * reading.length_m;
        if let Some(slot) = self.readings.get_mut(self.count % SPEED_READINGS) {
            *slot = (at, chainage_m);
            self.count += 1;
        }
        self.resolution_m = reading.resolution_m * scale.abs();
    }

    fn latest(&self) -> Option<(MonoNs, f64)> {
        let last = self.count.checked_sub(1)?;
        self.readings.get(last % SPEED_READINGS).copied()
    }

    fn speed_mps(&self) -> f64 {
        let Some((now, chainage_m)) = self.latest() else { return 0.0 };
        let kept = self.count.min(SPEED_READINGS);
        let recent = (self.count - kept..self.count)
            .filter_map(|k| self.readings.get(k % SPEED_READINGS))
            .find(|(at, _)| now.since(*at).0.abs() <= SPEED_WINDOW.0);
        match recent {
            Some((then, before_m)) if now > *then => (chainage_m - before_m) / now.since(*then).as_secs_f64(),
            _ => 0.0,
        }
    }
}

impl Navigation for DirectNavigation {
    fn update(&mut self, source: usize, sensor: &SensorInfo, at: MonoNs, reading: &Reading) {
        match (sensor.kind, reading) {
            (SensorKind::Imu, Reading::Attitude(rotation)) => {
                self.take_attitude(at, &sensor.mount, *rotation);
            }
            (SensorKind::Tether { zero_at_m, scale }, Reading::TetherLength(length)) => {
                self.tether.take(at, zero_at_m, scale, length);
            }
            (SensorKind::Echosounder { min_confidence }, Reading::Echo(echo))
                if echo.confidence >= min_confidence =>
            {
                self.take_echo(source, at, &sensor.mount, echo);
            }
            (SensorKind::Depth, Reading::Pressure(water)) => {
                self.take_pressure(at, &sensor.mount, water.pressure_pa);
            }
            _ => {}
        }
    }

    fn fix(&self, at: MonoNs) -> Result<Fix, NoFix> {
        let fresh = |since: MonoNs| at.since(since).0.abs() <= STALE.0;
        let (_, attitude) = self.attitude.filter(|(since, _)| fresh(*since)).ok_or(NoFix::Heading)?;
        let (since, chainage_m) =
            self.tether.latest().filter(|(since, _)| fresh(*since)).ok_or(NoFix::Chainage)?;
        let (_, [y_m, z_m]) = self.place.filter(|(since, _)| fresh(*since)).ok_or(NoFix::Section)?;
        let speed_mps = self.tether.speed_mps();
        let x_m = chainage_m + speed_mps * at.since(since).as_secs_f64();
        Ok(Fix {
            pose: Pose { position: Point3::new(x_m, y_m, z_m), attitude },
            speed_mps,
            // Two independent roundings to the counter's quantum.
            relative_sigma_m: self.tether.resolution_m * math::sqrt(2.0 / 12.0),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::app::reading::WaterPressure;
    use crate::tunnel::named;

    fn sensor(kind: SensorKind, yaw_deg: f64, pitch_deg: f64) -> SensorInfo {
        let rotation = Rot::from_roll_pitch_yaw(0.0, pitch_deg.to_radians(), yaw_deg.to_radians());
        SensorInfo { mount: Mount { position: Vec3::new(0.1, 0.0, 0.05), rotation }, kind }
    }

    fn echo(range_m: f64) -> Reading {
        Reading::Echo(EchoRange { range_m: Some(range_m), confidence: 1.0, sound_speed_mps: 1500.0 })
    }

    #[test]
    fn four_echoes_find_the_place_in_the_section() {
        let profile = named::ceran().unwrap();
        let site = Site { axis_yaw_rad: 0.3, ..Site::default() };
        let truth = Pose {
            position: Point3::new(12.0, 1.3, 4.1),
            attitude: Rot::from_roll_pitch_yaw(0.05, -0.04, 0.2),
        };
        let mut nav = DirectNavigation::new(profile.clone(), site);
        assert_eq!(nav.fix(MonoNs(0)), Err(NoFix::Heading));
        let level = Rot::<Level, Tunnel>::from_roll_pitch_yaw(0.0, 0.0, 0.3) * truth.attitude;
        let imu = SensorInfo {
            mount: Mount { position: Vec3::zero(), rotation: Rot::identity() },
            kind: SensorKind::Imu,
        };
        let [w, x, y, z] = level.wxyz();
        nav.update(0, &imu, MonoNs(0), &Reading::Attitude(Rot::from_wxyz(w, x, y, z).unwrap()));
        assert_eq!(nav.fix(MonoNs(0)), Err(NoFix::Chainage));
        let tether = SensorInfo { kind: SensorKind::Tether { zero_at_m: 2.0, scale: 1.0 }, ..imu };
        for (at, length_m) in [(0, 9.9), (500_000_000, 10.0)] {
            let reading = Reading::TetherLength(TetherLength { length_m, resolution_m: 0.001 });
            nav.update(1, &tether, MonoNs(at), &reading);
        }
        assert_eq!(nav.fix(MonoNs(0)), Err(NoFix::Section));
        let echosounder = SensorKind::Echosounder { min_confidence: 0.5 };
        let now = MonoNs(500_000_000);
        for (source, (yaw, pitch)) in
            [(90.0, 0.0), (-90.0, 0.0), (0.0, -90.0), (0.0, 90.0)].iter().enumerate()
        {
            let info = sensor(echosounder, *yaw, *pitch);
            let origin = truth.place(info.mount.position);
            let beam = truth.attitude * (info.mount.rotation * Vec3::new(1.0, 0.0, 0.0));
            let hit = profile.cast([origin.y(), origin.z()], [beam.y(), beam.z()]).unwrap();
            nav.update(2 + source, &info, now, &echo(hit.range_m * 1500.0 / site.sound_speed_mps));
        }
        let fix = nav.fix(now).unwrap();
        let off = fix.pose.position - truth.position;
        assert!(off.norm() < 2e-3, "{:?}", fix.pose);
        assert!((fix.speed_mps - 0.2).abs() < 1e-12);
        assert_eq!(nav.fix(MonoNs(3_000_000_000)), Err(NoFix::Heading));
    }

    #[test]
    fn depth_carries_the_height_on_when_the_echoes_fall_silent() {
        let profile = named::ceran().unwrap();
        let site = Site::default();
        let mut nav = DirectNavigation::new(profile, site);
        let imu = SensorInfo {
            mount: Mount { position: Vec3::zero(), rotation: Rot::identity() },
            kind: SensorKind::Imu,
        };
        nav.update(0, &imu, MonoNs(0), &Reading::Attitude(Rot::identity()));
        let pressure = |height_m: f64| {
            Reading::Pressure(WaterPressure {
                pressure_pa: site.pressure_pa(site.surface_above_floor_m - height_m),
                resolution_pa: 1.0,
                temperature_degc: 10.0,
            })
        };
        let depth = SensorInfo { kind: SensorKind::Depth, ..imu };
        // The sensor is 0.4 m off; the echoes say 3.0 m.
        nav.update(1, &depth, MonoNs(0), &pressure(3.4));
        let down = SensorInfo {
            mount: Mount {
                position: Vec3::zero(),
                rotation: Rot::from_roll_pitch_yaw(0.0, math::FRAC_PI_2, 0.0),
            },
            kind: SensorKind::Echosounder { min_confidence: 0.5 },
        };
        nav.update(2, &down, MonoNs(0), &echo(3.0 * 1500.0 / site.sound_speed_mps));
        nav.update(1, &depth, MonoNs(1_000_000_000), &pressure(3.6));
        let height = nav.place.unwrap().1[1];
        assert!((height - 3.2).abs() < 2e-3, "{height}");
    }
}
