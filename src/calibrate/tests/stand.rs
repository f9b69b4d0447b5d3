//! A simulated vehicle at rest in a tunnel, and its sensors' readings, computed from rays of the profile.

use super::super::collect::Material;
use headrace_fusion::filter::settings::Settings;
use headrace_geometry::frames::{Body, Mount, Point3, Pose, Rot, Sensor, Tunnel, Vec3, head_direction};
use headrace_geometry::math::{self, FRAC_PI_2, TAU};
use headrace_geometry::site::Site;
use headrace_geometry::time::{DurNs, MonoNs};
use headrace_geometry::tunnel::{Profile, shapes};
use headrace_monitor::messages::Event;
use headrace_sensor::device::{SensorInfo, SensorKind};
use headrace_sensor::reading::{
    EchoRange, Level, Reading, SonarReturn, SourceId, TetherLength, WaterPressure,
};

pub(super) const IMU: usize = 0;
pub(super) const TETHER: usize = 1;
pub(super) const DEPTH: usize = 2;
const ECHOES: usize = 3;
pub(super) const HEADS: usize = 7;
const DEVICE_MPS: f64 = 1500.0;

/// Difference of a head's true mount from the vehicle file: degrees about its axis, m to the left and up, and whether
/// it is mirrored.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Wrong {
    pub(super) angle_deg: f64,
    pub(super) left_m: f64,
    pub(super) up_m: f64,
    pub(super) is_mirrored: bool,
}

/// A simulated vehicle at rest, with its tunnel and sensors.
pub(super) struct Stand {
    pub(super) profile: Profile,
    pub(super) site: Site,
    pub(super) settings: Settings,
    pub(super) wrong: Vec<Wrong>,
    /// Position y and z, m; then roll, pitch and yaw, degrees.
    pub(super) at: [f64; 2],
    pub(super) turned_deg: [f64; 3],
    pub(super) speed_mps: f64,
    pub(super) seconds: u32,
    /// Sector that the heads sweep, degrees.
    pub(super) sector_deg: f64,
    pub(super) noise_m: f64,
    pub(super) outliers: f64,
    pub(super) has_echoes: bool,
    pub(super) seed: u64,
}

pub(super) fn profiles() -> [(&'static str, Profile); 3] {
    [
        ("ceran", shapes::ceran().unwrap()),
        ("rectangle", shapes::rectangle(6.0, 5.0).unwrap()),
        ("arch", shapes::arch(6.0, 5.5, 3.2).unwrap()),
    ]
}

impl Stand {
    /// A vehicle 0.6 m beside the axis, for 12 s in which each head turns once.
    pub(super) fn new(profile: Profile, wrong: &[Wrong], seed: u64) -> Self {
        Self {
            profile,
            site: Site { axis_yaw_rad: 0.7, ..Site::default() },
            // The beams are so narrow that each is equivalent to a ray.
            settings: Settings { return_beam_rad: 1e-6, echo_beam_rad: 1e-6, ..Settings::default() },
            wrong: wrong.to_vec(),
            at: [0.6, 2.3],
            turned_deg: [2.0, -1.5, 3.0],
            speed_mps: 0.0,
            seconds: 12,
            sector_deg: 360.0,
            noise_m: 0.01,
            outliers: 0.0,
            has_echoes: true,
            seed,
        }
    }

    fn filed(source: usize) -> SensorInfo {
        let at = |x: f64, y: f64, z: f64, pitch: f64, yaw: f64| Mount {
            position: Vec3::new(x, y, z),
            rotation: Rot::from_roll_pitch_yaw(0.0, pitch, yaw),
        };
        let echo = SensorKind::Echosounder { min_confidence: 0.5 };
        let (mount, kind) = match source {
            IMU => (at(0.1, 0.0, 0.0, 0.0, 0.3), SensorKind::Imu),
            TETHER => (at(0.0, 0.0, 0.0, 0.0, 0.0), SensorKind::Tether { zero_at_m: 2.0, scale: 1.0 }),
            DEPTH => (at(-0.2, 0.0, 0.1, 0.0, 0.0), SensorKind::Depth),
            3 => (at(0.1, 0.2, 0.0, 0.0, FRAC_PI_2), echo),
            4 => (at(0.1, -0.2, 0.0, 0.0, -FRAC_PI_2), echo),
            5 => (at(0.1, 0.0, -0.1, FRAC_PI_2, 0.0), echo),
            6 => (at(0.1, 0.0, 0.1, -FRAC_PI_2, 0.0), echo),
            // The heads are close together, so that an error of the vehicle's heading can't hide their
            // offsets.
            head => (at(0.4, 0.3 * (head - HEADS) as f64, 0.0, 0.0, 0.0), SensorKind::Head),
        };
        SensorInfo { mount, kind }
    }

    pub(super) fn sensors(&self) -> Vec<SensorInfo> {
        (0..HEADS + self.wrong.len()).map(Self::filed).collect()
    }

    /// Simulates the stand's readings, and passes them to `estimate`.
    pub(super) fn ask<T>(&self, estimate: impl FnOnce(&Material<'_>) -> T) -> T {
        let (sensors, events) = (self.sensors(), self.events());
        let Self { profile, site, settings, .. } = self;
        let material =
            Material { profile, site: *site, settings: *settings, sensors: &sensors, events: &events };
        estimate(&material)
    }

    fn uniform(&self, k: u64, salt: u64) -> f64 {
        // The pseudorandom numbers are Splitmix64 of a counter.
        let mut z = (self.seed << 40) ^ (salt << 32) ^ k;
        for _ in 0..2 {
            z = z.wrapping_add(0x9E37_79B9_7F4A_7C15);
            z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
            z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
            z ^= z >> 31;
        }
        (z >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn noise(&self, k: u64, salt: u64) -> f64 {
        (0..12).map(|part| self.uniform(k, 16 * salt + part)).sum::<f64>() - 6.0
    }

    pub(super) fn pose(&self, t: f64) -> Pose {
        let [roll, pitch, yaw] = self.turned_deg.map(f64::to_radians);
        let position = Point3::new(40.0 + self.speed_mps * t, self.at[0], self.at[1]);
        Pose { position, attitude: Rot::<Tunnel, Body>::from_roll_pitch_yaw(roll, pitch, yaw) }
    }

    fn range_m(&self, t: f64, from: Vec3<Body>, along: Vec3<Body>) -> Option<f64> {
        let pose = self.pose(t);
        let (from, beam) = (pose.place(from), pose.attitude * along);
        Some(self.profile.cast([from.y(), from.z()], [beam.y(), beam.z()])?.range_m)
    }

    fn echo(&self, source: usize, t: f64, k: u64) -> Reading {
        let mount = Self::filed(source).mount;
        let range_m = self.range_m(t, mount.position, mount.rotation * Vec3::new(1.0, 0.0, 0.0));
        let range_m = range_m
            .map(|m| (m + 0.01 * self.noise(k, source as u64)) * DEVICE_MPS / self.site.sound_speed_mps);
        Reading::Echo(EchoRange { range_m, confidence: 1.0, sound_speed_mps: DEVICE_MPS })
    }

    fn sonar(&self, head: usize, t: f64, k: u64) -> Reading {
        let share = k as f64 / (f64::from(self.seconds) * 20.0);
        let angle_rad = (self.sector_deg.to_radians() * share + 0.3).min(TAU + 0.3);
        let wrong = self.wrong[head];
        let mount = Self::filed(HEADS + head).mount;
        let shown = if wrong.is_mirrored { -angle_rad } else { angle_rad };
        let looks: Vec3<Sensor> = head_direction(shown + wrong.angle_deg.to_radians());
        let from = mount.position + Vec3::new(0.0, wrong.left_m, wrong.up_m);
        let salt = 20 + head as u64;
        let mut range_m =
            self.range_m(t, from, mount.rotation * looks).map(|m| m + self.noise_m * self.noise(k, salt));
        if self.uniform(k, 1000 + salt) < self.outliers {
            range_m = Some(0.3 + 8.0 * self.uniform(k, 1100 + salt));
        }
        Reading::Sonar(SonarReturn {
            angle_rad,
            range_m: range_m.map(|m| m * DEVICE_MPS / self.site.sound_speed_mps),
            resolution_m: 0.002,
            max_range_m: 20.0,
            sound_speed_mps: DEVICE_MPS,
        })
    }

    fn events(&self) -> Vec<Event> {
        let mut events = Vec::new();
        for k in 0..u64::from(self.seconds) * 20 {
            let at = MonoNs(9_000_000_000) + DurNs::from_millis(50 * k as i64);
            let t = 0.05 * k as f64;
            let mut say = |source: usize, reading: Reading| {
                let source = SourceId(u16::try_from(source).unwrap());
                events.push(Event { source, received: at, valid_at: at, reading });
            };
            let axis = Rot::<Level, Tunnel>::from_roll_pitch_yaw(0.0, 0.0, self.site.axis_yaw_rad);
            say(IMU, Reading::Attitude(axis * self.pose(t).attitude * Self::filed(IMU).mount.rotation));
            let length_m = 38.0 + self.speed_mps * t;
            say(TETHER, Reading::TetherLength(TetherLength { length_m, resolution_m: 0.001, restart: None }));
            let height_m = self.pose(t).place(Self::filed(DEPTH).mount.position).z();
            let pressure_pa = self.site.pressure_pa(self.site.surface_above_floor_m - height_m);
            let (resolution_pa, temperature_degc) = (1.0, 10.0);
            say(DEPTH, Reading::Pressure(WaterPressure { pressure_pa, resolution_pa, temperature_degc }));
            for source in (ECHOES..HEADS).filter(|_| self.has_echoes) {
                say(source, self.echo(source, t, k));
            }
            for head in 0..self.wrong.len() {
                say(HEADS + head, self.sonar(head, t, k));
            }
        }
        events
    }
}

/// The stand's mirror image, with left and right exchanged.
pub(super) fn mirrored(stand: &Stand) -> Stand {
    let [roll, pitch, yaw] = stand.turned_deg;
    let wrong = stand.wrong.iter().map(|wrong| Wrong {
        left_m: -wrong.left_m,
        angle_deg: -wrong.angle_deg,
        ..*wrong
    });
    Stand {
        profile: stand.profile.clone(),
        wrong: wrong.collect(),
        at: [-stand.at[0], stand.at[1]],
        turned_deg: [-roll, pitch, -yaw],
        ..*stand
    }
}

/// An angle wrapped to -180 to 180 degrees.
pub(super) fn short_deg(rad: f64) -> f64 {
    math::wrap_signed(rad, TAU).to_degrees()
}
