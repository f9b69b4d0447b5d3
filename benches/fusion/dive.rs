//! A stationary vehicle in the middle of a tunnel. All sensors have ideal readings, so that the filter rejects none.

use headrace_fusion::filter::clones::ErrorClones;
use headrace_fusion::filter::context::Context;
use headrace_fusion::filter::eskf::Eskf;
use headrace_fusion::filter::factors::Factors;
use headrace_fusion::filter::inertial::{InertialSample, Leg};
use headrace_fusion::filter::settings::Settings;
use headrace_fusion::filter::sources::Source;
use headrace_fusion::filter::state::{ERRORS, State};
use headrace_fusion::filter::window::{Waiting, Window};
use headrace_geometry::frames::{Body, Mount, Point3, Rot, Sensor, Vec3};
use headrace_geometry::math;
use headrace_geometry::site::Site;
use headrace_geometry::time::{DurNs, MonoNs};
use headrace_geometry::tunnel::shapes;
use headrace_sensor::device::{SensorInfo, SensorKind};
use headrace_sensor::reading::MAX_SOURCES;
use headrace_sensor::reading::{EchoRange, Reading, TetherLength, WaterPressure};

pub(crate) const GRAVITY_MPS2: f64 = 9.806_65;
/// Interval of inertial samples, s.
pub(crate) const SAMPLE_S: f64 = 0.01;
const SAMPLE: DurNs = DurNs(10_000_000);
const SAMPLES: usize = 10;
/// Number of epochs before the measurement: about two minutes, enough to fill all clones of past poses.
const EPOCHS_BEFORE: usize = 1300;
/// The echosounders look left, right and up.
const YAWS_AND_PITCHES: [(f64, f64); 3] =
    [(math::TAU / 4.0, 0.0), (-math::TAU / 4.0, 0.0), (0.0, -math::TAU / 4.0)];
const SOUNDERS: usize = 3;
const IMU: usize = SOUNDERS;
const TETHER: usize = IMU + 1;
const DEPTH: usize = TETHER + 1;

pub(crate) struct Dive {
    context: Context,
    window: Window,
    sources: Vec<Option<Source>>,
    running: Eskf,
    readings: [(usize, Reading); SOUNDERS + 3],
}

impl Dive {
    /// State of a dive that has run for some minutes.
    pub(crate) fn under_way() -> Self {
        let mut dive = Self::begin();
        for _ in 0..EPOCHS_BEFORE {
            dive.epoch();
        }
        dive.check();
        dive
    }

    fn begin() -> Self {
        let profile = shapes::ceran().unwrap();
        let [y_m, z_m] = profile.reference();
        let state = State::at_rest(Point3::new(10.0, y_m, z_m), Rot::identity());
        let site = Site::default();
        let mut sources = vec![None; MAX_SOURCES];
        let mut readings = [(IMU, Reading::Attitude(Rot::identity())); SOUNDERS + 3];
        for (number, (yaw_rad, pitch_rad)) in YAWS_AND_PITCHES.into_iter().enumerate() {
            let rotation = Rot::from_roll_pitch_yaw(0.0, pitch_rad, yaw_rad);
            sources[number] = Some(source(SensorKind::Echosounder { min_confidence: 0.0 }, rotation));
            let along = rotation * Vec3::<Sensor>::new(1.0, 0.0, 0.0);
            let hit = profile.cast([y_m, z_m], [along.y(), along.z()]).unwrap();
            let echo = EchoRange {
                range_m: Some(hit.range_m),
                confidence: 1.0,
                sound_speed_mps: site.sound_speed_mps,
            };
            readings[number] = (number, Reading::Echo(echo));
        }
        sources[IMU] = Some(source(SensorKind::Imu, Rot::identity()));
        sources[TETHER] = Some(source(SensorKind::Tether { zero_at_m: 0.0, scale: 1.0 }, Rot::identity()));
        sources[DEPTH] = Some(source(SensorKind::Depth, Rot::identity()));
        let length = TetherLength { length_m: state.position.x(), resolution_m: 0.001, restart: None };
        readings[TETHER] = (TETHER, Reading::TetherLength(length));
        let pressure_pa = site.pressure_pa(site.surface_above_floor_m - z_m);
        let water = WaterPressure { pressure_pa, resolution_pa: 10.0, temperature_degc: 10.0 };
        readings[DEPTH] = (DEPTH, Reading::Pressure(water));
        let settings = Settings::default();
        let mut running = Eskf::default();
        running.begin(MonoNs(0), state, Factors::independent([0.01; ERRORS]));
        let context = Context { profile, site, settings, unit_at: Vec3::zero() };
        Self { context, window: Window::default(), sources, running, readings }
    }

    /// Runs one epoch of the filter: ten inertial samples, and six readings with eight measured numbers.
    pub(crate) fn epoch(&mut self) {
        let began = self.running.at;
        let mut at = began;
        let felt = Self::felt();
        for _ in 0..SAMPLES {
            at = at + SAMPLE;
            self.window.take_rate(at, felt.rate_radps.unwrap());
            self.window.take_force(at, felt.force_mps2.unwrap());
        }
        for (k, (source, reading)) in self.readings.into_iter().enumerate() {
            let later = DurNs(i64::try_from(k + 1).unwrap() * 15_000_000);
            self.window.take(Waiting { at: began + later, source, reading });
        }
        self.running.advance(at, &self.context, &mut self.window, &mut self.sources);
        self.window.forget(at);
    }

    /// Checks that the filter has used all readings, because the figures are meaningless otherwise.
    fn check(&self) {
        assert!(self.running.is_sound());
        for source in self.sources.iter().flatten() {
            assert_eq!((source.consistency.gated, source.consistency.dropped), (0, 0));
            assert!(source.consistency.used >= EPOCHS_BEFORE as u64);
        }
    }

    fn felt() -> InertialSample {
        let (rate, force) = (Vec3::zero(), Vec3::<Body>::new(0.0, 0.0, GRAVITY_MPS2));
        InertialSample { rate_radps: Some(rate), force_mps2: Some(force) }
    }

    pub(crate) fn state(&self) -> State {
        self.running.state
    }

    pub(crate) fn factors(&self) -> Factors<ERRORS> {
        self.running.factors
    }

    /// The filter's clones of past poses, and the time of the last epoch. No clone is later.
    pub(crate) fn clones(&self) -> (ErrorClones, MonoNs) {
        (self.running.clones.clone(), self.running.at)
    }

    /// Motion of the vehicle over one epoch of the filter.
    pub(crate) fn leg(&self) -> Leg {
        let (mut state, mut leg) = (self.running.state, Leg::default());
        for _ in 0..SAMPLES {
            state.go_on(&Self::felt(), SAMPLE_S, GRAVITY_MPS2, &mut leg);
        }
        leg
    }
}

fn source(kind: SensorKind, rotation: Rot<Body, Sensor>) -> Source {
    Source::new(SensorInfo { mount: Mount { position: Vec3::zero(), rotation }, kind })
}
