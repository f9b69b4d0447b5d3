//! Navigation without a filter, as in Jorge et al. 2021, §9.2: the baseline for judging the filter.
//!
//! Attitude comes from the IMU and chainage from the tether. The position in the cross-section is the best fit of the
//! echosounders' ranges to the design profile. While the echosounders are silent, height comes from the depth sensor.
//! The method suits data with low noise.

use super::relative::Relative;
use super::section::{Echo, settle};
use crate::fix::{Fix, NoFix, Times};
use crate::navigation::Navigation;
use headrace_geometry::frames::{Body, Mount, Point3, Pose, Rot, Sensor, Tunnel};
use headrace_geometry::math;
use headrace_geometry::site::Site;
use headrace_geometry::snapshot::stateful;
use headrace_geometry::time::{DurNs, MonoNs};
use headrace_geometry::tunnel::Profile;
use headrace_sensor::device::{SensorInfo, SensorKind};
use headrace_sensor::reading::{EchoRange, Level, MAX_SOURCES, Reading, TetherLength};

/// Maximum age of an echosounder range that is used for the position in the cross-section.
const ECHO_AGE: DurNs = DurNs(500_000_000);
/// Maximum age of an attitude, a chainage or a position used in a fix.
const STALE: DurNs = DurNs(2_000_000_000);
/// The speed comes from at most `SPEED_READINGS` cable readings, none of them older than `SPEED_WINDOW`.
const SPEED_WINDOW: DurNs = DurNs(1_000_000_000);
const SPEED_READINGS: usize = 64;
/// Standard deviation of an echosounder's range, m.
const ECHO_SD_M: f64 = 0.01;
/// Standard deviations of the position before the fit to the echoes, m: to the left, and up.
const PRIOR_SD_M: [f64; 2] = [10.0, 1.0];

/// Navigation without a Kalman filter.
pub struct DirectNavigation {
    profile: Profile,
    site: Site,
    attitude: Option<(MonoNs, Rot<Tunnel, Body>)>,
    tether: TetherTrack,
    echoes: [Option<(MonoNs, Echo)>; MAX_SOURCES],
    place: Option<(MonoNs, [f64; 2])>,
    /// `height_m` is the height by the depth sensor, m. `height_offset_m` is added to it, to make it agree with the
    /// echoes.
    height_m: Option<f64>,
    height_offset_m: f64,
}

stateful!(DirectNavigation { state: attitude, tether, place, height_m, height_offset_m; slots: echoes; fixed: profile, site; });

/// The latest readings of the cable counter, as chainages.
#[derive(Debug, Clone)]
struct TetherTrack {
    readings: [(MonoNs, f64); SPEED_READINGS],
    count: usize,
    resolution_m: f64,
    /// Restart number in the cable counter's first reading. A higher number means that the counter has restarted
    /// since.
    restarts: u32,
}

stateful!(TetherTrack { state: count, resolution_m, restarts; slots: readings; });

impl DirectNavigation {
    /// Creates the navigation, which has no readings yet.
    pub fn new(profile: Profile, site: Site) -> Self {
        Self {
            profile,
            site,
            attitude: None,
            tether: TetherTrack {
                readings: [(MonoNs(0), 0.0); SPEED_READINGS],
                count: 0,
                resolution_m: 0.0,
                restarts: 0,
            },
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
            *slot = Some((at, Echo { mount: *mount, range_m }));
        }
        self.find_place(at);
    }

    /// Updates the position in the cross-section to the best fit of recent ranges to the profile.
    fn find_place(&mut self, now: MonoNs) {
        let Some((_, attitude)) = self.attitude else { return };
        let [reference_y, reference_z] = self.profile.reference();
        let prior_z = self.height_m.map_or(reference_z, |height| height + self.height_offset_m);
        let prior = [self.place.map_or(reference_y, |(_, place)| place[0]), prior_z];
        let start = self.place.map_or([reference_y, reference_z], |(_, place)| place);
        let recent = self.echoes.iter().flatten().filter(|(at, _)| now.since(*at).0.abs() <= ECHO_AGE.0);
        let echoes = recent.map(|(_, echo)| *echo);
        let place = settle(&self.profile, attitude, start, (prior, PRIOR_SD_M), ECHO_SD_M, &echoes);
        self.place = Some((now, place.at_m));
        if let (true, Some(height_m)) = (place.is_height_seen, self.height_m) {
            self.height_offset_m = place.at_m[1] - height_m;
        }
    }

    fn take_pressure(&mut self, at: MonoNs, mount: &Mount, pressure_pa: f64) {
        let up = self.attitude.map_or(mount.position.z(), |(_, attitude)| (attitude * mount.position).z());
        let height_m = self.site.surface_above_floor_m - self.site.depth_m(pressure_pa) - up;
        self.height_m = Some(height_m);
        // Without recent echoes, the depth sensor alone updates the height.
        let silent = self.echoes.iter().flatten().all(|(echoed, _)| at.since(*echoed).0.abs() > ECHO_AGE.0);
        if let (true, Some((_, place))) = (silent, &mut self.place) {
            place[1] = height_m + self.height_offset_m;
        }
    }
}

impl TetherTrack {
    fn take(&mut self, at: MonoNs, zero_at_m: f64, scale: f64, reading: &TetherLength) {
        let restarts = reading.restart.map_or(0, |restart| restart.number);
        if self.count == 0 {
            self.restarts = restarts;
        }
        // After a restart, the cable counter begins at zero again. Navigation without a filter cannot restore the
        // chainage, so the chainage is lost.
        if restarts != self.restarts {
            return;
        }
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
    fn update(&mut self, source: usize, sensor: &SensorInfo, times: Times, reading: &Reading) {
        let at = times.valid;
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
        // Two cable readings are each rounded to the counter's resolution. This causes the chainage error between two
        // passes.
        let relative = Relative::along(self.tether.resolution_m * math::sqrt(2.0 / 12.0));
        Ok(Fix {
            pose: Pose { position: Point3::new(x_m, y_m, z_m), attitude },
            speed_mps,
            tie: 0,
            settled: 0,
            relative,
            revisit: relative,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use headrace_geometry::frames::Vec3;
    use headrace_geometry::tunnel::shapes;
    use headrace_sensor::reading::WaterPressure;

    fn sensor(kind: SensorKind, yaw_deg: f64, pitch_deg: f64) -> SensorInfo {
        let rotation = Rot::from_roll_pitch_yaw(0.0, pitch_deg.to_radians(), yaw_deg.to_radians());
        SensorInfo { mount: Mount { position: Vec3::new(0.1, 0.0, 0.05), rotation }, kind }
    }

    fn at_once(at: MonoNs) -> Times {
        Times { received: at, valid: at }
    }

    fn echo(range_m: f64) -> Reading {
        Reading::Echo(EchoRange { range_m: Some(range_m), confidence: 1.0, sound_speed_mps: 1500.0 })
    }

    #[test]
    fn four_echoes_determine_the_position_in_the_cross_section() {
        let profile = shapes::ceran().unwrap();
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
        nav.update(0, &imu, at_once(MonoNs(0)), &Reading::Attitude(Rot::from_wxyz(w, x, y, z).unwrap()));
        assert_eq!(nav.fix(MonoNs(0)), Err(NoFix::Chainage));
        let tether = SensorInfo { kind: SensorKind::Tether { zero_at_m: 2.0, scale: 1.0 }, ..imu };
        for (at, length_m) in [(0, 9.9), (500_000_000, 10.0)] {
            let reading =
                Reading::TetherLength(TetherLength { length_m, resolution_m: 0.001, restart: None });
            nav.update(1, &tether, at_once(MonoNs(at)), &reading);
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
            nav.update(2 + source, &info, at_once(now), &echo(hit.range_m * 1500.0 / site.sound_speed_mps));
        }
        let fix = nav.fix(now).unwrap();
        let off = fix.pose.position - truth.position;
        assert!(off.norm() < 2e-3, "{:?}", fix.pose);
        assert!((fix.speed_mps - 0.2).abs() < 1e-12);
        // Between cable readings, the chainage is extrapolated.
        let later = nav.fix(now + headrace_geometry::time::DurNs::from_millis(100)).unwrap();
        assert!((later.pose.position.x() - fix.pose.position.x() - 0.02).abs() < 1e-9, "{:?}", later.pose);
        assert_eq!(nav.fix(MonoNs(3_000_000_000)), Err(NoFix::Heading));
    }

    #[test]
    fn depth_sensor_updates_the_height_while_echosounders_are_silent() {
        let profile = shapes::ceran().unwrap();
        let site = Site::default();
        let mut nav = DirectNavigation::new(profile, site);
        let imu = SensorInfo {
            mount: Mount { position: Vec3::zero(), rotation: Rot::identity() },
            kind: SensorKind::Imu,
        };
        nav.update(0, &imu, at_once(MonoNs(0)), &Reading::Attitude(Rot::identity()));
        let pressure = |height_m: f64| {
            Reading::Pressure(WaterPressure {
                pressure_pa: site.pressure_pa(site.surface_above_floor_m - height_m),
                resolution_pa: 1.0,
                temperature_degc: 10.0,
            })
        };
        let depth = SensorInfo { kind: SensorKind::Depth, ..imu };
        // The depth sensor shows a height of 3.4 m, and the echoes measure 3.0 m. So the depth sensor is 0.4 m too
        // high.
        nav.update(1, &depth, at_once(MonoNs(0)), &pressure(3.4));
        let down = SensorInfo {
            mount: Mount {
                position: Vec3::zero(),
                rotation: Rot::from_roll_pitch_yaw(0.0, math::FRAC_PI_2, 0.0),
            },
            kind: SensorKind::Echosounder { min_confidence: 0.5 },
        };
        nav.update(2, &down, at_once(MonoNs(0)), &echo(3.0 * 1500.0 / site.sound_speed_mps));
        nav.update(1, &depth, at_once(MonoNs(1_000_000_000)), &pressure(3.6));
        let height = nav.place.unwrap().1[1];
        assert!((height - 3.2).abs() < 2e-3, "{height}");
    }
}
