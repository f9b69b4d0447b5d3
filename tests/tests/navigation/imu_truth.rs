//! Validation: attitude from gyros and accelerometers alone, compared with optical motion capture.
//!
//! The filters of Madgwick and Mahony (crate `ahrs`) run on the same samples. The recording is trial 12 of BROAD: slow
//! hand motion within about a metre (`recordings/imu_broad`). The copy of the recording in this repository has the
//! first 105 s. If `HEADRACE_RECORDINGS` is set, the test also uses all 196 s. With `--nocapture` the test prints the
//! inclination error while the unit moves and the heading drift over the recording, in degrees.

use std::fs::File;
use std::io::Read as _;
use std::path::Path;

use ahrs::{Ahrs as _, Madgwick, Mahony};
use headrace_fusion::filter::factors::Factors;
use headrace_fusion::filter::inertial::{InertialSample, Leg};
use headrace_fusion::filter::measure::{self, ScalarUpdate};
use headrace_fusion::filter::settings::Settings;
use headrace_fusion::filter::state::{
    ATTITUDE, ERRORS, FORCE_BIAS, POSITION, RATE_BIAS, State, VELOCITY, put,
};
use headrace_geometry::frames::{Body, Point3, Rot, Tunnel, Vec3};
use headrace_geometry::math;
use headrace_tests::recordings;
use nalgebra_of_peers as peers;

const NAME: &str = "imu_broad/derived_12_undisturbed_slow_translation_C_95Hz.csv.gz";
/// Names of the columns that the test reads. The full-length recording has more columns.
const COLUMNS: [&str; 11] = ["gx", "gy", "gz", "ax", "ay", "az", "qw", "qx", "qy", "qz", "movement"];
const DEGREE: f64 = core::f64::consts::PI / 180.0;
const GRAVITY_MPS2: f64 = 9.81;
const SAMPLE_S: f64 = 0.0105;
/// Number of samples between updates of the error state. The time between updates is about 0.1 s, as in headrace's
/// filter.
const EPOCH: usize = 10;
/// Number of inertial samples per second in the recording.
const SECOND: usize = 95;
/// Usual speed of a hand, m/s. The filter is told to expect velocities of this size, because no sensor measures the
/// velocity.
const HAND_MPS: f64 = 0.5;
/// The inertial unit counts as stationary if its turn rate varies by no more than this within a second, and its
/// specific force by no more than `STILL_MPS2`. Both limits are a few times the noise.
const STILL_RADPS: f64 = DEGREE;
const STILL_MPS2: f64 = 0.8;
const STILL_SD_MPS: f64 = 0.01;

/// An inertial sample in the axes of the body. In this test, the tunnel's axes stand for east, north and up.
#[derive(Clone, Copy)]
struct Sample {
    rate_radps: Vec3<Body>,
    force_mps2: Vec3<Body>,
    truth: Option<Rot<Tunnel, Body>>,
    moving: bool,
}

fn samples(path: &Path) -> Vec<Sample> {
    let mut text = String::new();
    flate2::read::GzDecoder::new(File::open(path).unwrap()).read_to_string(&mut text).unwrap();
    let mut lines = text.lines();
    let names: Vec<&str> = lines.next().unwrap().split(',').collect();
    let columns = COLUMNS.map(|column| names.iter().position(|name| *name == column).unwrap());
    lines.map(|line| sample(line, columns)).collect()
}

fn sample(line: &str, columns: [usize; 11]) -> Sample {
    let cells: Vec<&str> = line.split(',').collect();
    let [gx, gy, gz, ax, ay, az, w, x, y, z, moving] =
        columns.map(|column| cells[column].parse::<f64>().unwrap());
    Sample {
        rate_radps: Vec3::new(gx, gy, gz),
        force_mps2: Vec3::new(ax, ay, az),
        truth: Rot::from_wxyz(w, x, y, z),
        moving: moving > 0.5,
    }
}

fn mean(vectors: impl Iterator<Item = Vec3<Body>>) -> Vec3<Body> {
    let (sum, count) = vectors.fold((Vec3::zero(), 0.0), |(sum, count), v| (sum + v, count + 1.0));
    sum.scaled(1.0 / count)
}

/// Diagonal of the smallest axis-parallel box around these vectors.
fn spread(vectors: impl Iterator<Item = Vec3<Body>> + Clone) -> f64 {
    let first = vectors.clone().next().unwrap().0;
    let (low, high) = vectors.fold((first, first), |(low, high), v| (low.inf(&v.0), high.sup(&v.0)));
    (high - low).norm()
}

/// Initial attitude of every filter. Roll and pitch come from the mean force of the first second.
fn first_attitude(samples: &[Sample]) -> Rot<Tunnel, Body> {
    let force = mean(samples.iter().take(SECOND).map(|sample| sample.force_mps2));
    let roll = math::atan2(force.y(), force.z());
    let pitch = math::atan2(-force.x(), math::hypot(force.y(), force.z()));
    Rot::from_roll_pitch_yaw(roll, pitch, 0.0)
}

/// Attitude errors of a filter, degrees.
#[derive(Debug, Clone, Copy)]
struct Off {
    inclination_rms: f64,
    inclination_max: f64,
    /// Heading error at the end minus the heading error at the start.
    drift: f64,
}

/// Runs an attitude filter over all samples; returns its errors.
fn judge(samples: &[Sample], mut filter: impl FnMut(&Sample) -> Rot<Tunnel, Body>) -> Off {
    let (mut squares, mut count, mut most) = (0.0, 0.0, 0.0_f64);
    let (mut first, mut drift) = (None, 0.0);
    for sample in samples {
        let estimate = filter(sample);
        let Some(truth) = sample.truth else { continue };
        let [w, x, y, z] = (estimate * truth.inverse()).wxyz();
        let heading = 2.0 * math::atan2(z, w);
        drift = math::wrap_signed(heading - *first.get_or_insert(heading), math::TAU);
        if sample.moving {
            let inclination = 2.0 * math::atan2(math::hypot(x, y), math::hypot(w, z));
            most = most.max(inclination);
            (squares, count) = (squares + inclination * inclination, count + 1.0);
        }
    }
    Off {
        inclination_rms: math::sqrt(squares / count) / DEGREE,
        inclination_max: most / DEGREE,
        drift: drift / DEGREE,
    }
}

/// Navigation by an inertial unit alone, built from headrace's filter components.
struct Alone {
    settings: Settings,
    state: State,
    factors: Factors<ERRORS>,
    leg: Leg,
    second: Vec<Sample>,
}

impl Alone {
    /// Creates the navigation with the usual settings. The noise of the unit is 0.011 deg/s and 0.0045 m/s^2 per root
    /// hertz.
    ///
    /// These two figures come from samples of the stationary unit. The settings aren't tuned to this recording.
    fn new(attitude: Rot<Tunnel, Body>) -> Self {
        let settings = Settings::default();
        let mut sds = [1e-3; ERRORS];
        for (from, sd) in [
            (POSITION, 0.5),
            (VELOCITY, 0.1),
            (ATTITUDE, DEGREE),
            (FORCE_BIAS, settings.force_bias.reach),
            (RATE_BIAS, settings.rate_bias.reach),
        ] {
            put(&mut sds, from, Vec3::<Body>::new(sd, sd, sd));
        }
        Self {
            settings,
            state: State::at_rest(Point3::zero(), attitude),
            factors: Factors::independent(sds.map(|sd| sd * sd)),
            leg: Leg::default(),
            second: Vec::new(),
        }
    }

    fn take(&mut self, sample: &Sample) -> Rot<Tunnel, Body> {
        let felt =
            InertialSample { rate_radps: Some(sample.rate_radps), force_mps2: Some(sample.force_mps2) };
        self.state.go_on(&felt, SAMPLE_S, GRAVITY_MPS2, &mut self.leg);
        self.second.push(*sample);
        if self.second.len().is_multiple_of(EPOCH) || self.second.len() == SECOND {
            self.end_leg();
        }
        if self.second.len() == SECOND {
            self.end_second();
        }
        self.state.attitude
    }

    fn end_leg(&mut self) {
        let leg = core::mem::take(&mut self.leg);
        let transition = leg.transition(&self.settings);
        transition.fade(&mut self.state);
        transition.carry(&mut self.factors);
        leg.disturb(&self.settings, &transition, &mut self.factors);
    }

    /// Constrains the velocity to zero once a second. The standard deviation is small if the unit is stationary, and
    /// otherwise the speed of a hand. A stationary unit also shows its gyro biases.
    fn end_second(&mut self) {
        let rates = self.second.iter().map(|sample| sample.rate_radps);
        let forces = self.second.iter().map(|sample| sample.force_mps2);
        if spread(rates.clone()) < STILL_RADPS && spread(forces) < STILL_MPS2 {
            let rows = measure::no_turn(&self.state, mean(rates), self.settings.rate_noise);
            self.fuse(&rows);
            self.fuse(&measure::rest(&self.state, STILL_SD_MPS));
        } else {
            self.fuse(&measure::rest(&self.state, HAND_MPS));
        }
        self.second.clear();
    }

    fn fuse(&mut self, rows: &[ScalarUpdate]) {
        let mut errors = [0.0; ERRORS];
        for row in rows {
            let expected: f64 = row.h.iter().zip(&errors).map(|(h, e)| h * e).sum();
            let gain = self.factors.measure(&row.h, row.noise);
            for (error, k) in errors.iter_mut().zip(&gain.k) {
                *error += k * (row.residual - expected);
            }
        }
        self.state.correct(&errors);
    }
}

fn ours(samples: &[Sample]) -> Off {
    let mut alone = Alone::new(first_attitude(samples));
    judge(samples, |sample| alone.take(sample))
}

type PeerVector = peers::Vector3<f64>;
type PeerRotation = peers::UnitQuaternion<f64>;

/// Computes the errors of a filter from the `ahrs` crate. Converts the samples to the vector types of this crate.
fn judge_peer(samples: &[Sample], mut step: impl FnMut(PeerVector, PeerVector) -> PeerRotation) -> Off {
    let vector = |v: Vec3<Body>| PeerVector::new(v.x(), v.y(), v.z());
    judge(samples, |sample| {
        let q = step(vector(sample.rate_radps), vector(sample.force_mps2));
        Rot::from_wxyz(q.w, q.i, q.j, q.k).unwrap()
    })
}

fn peer_start(samples: &[Sample]) -> PeerRotation {
    let [w, x, y, z] = first_attitude(samples).wxyz();
    PeerRotation::new_unchecked(peers::Quaternion::new(w, x, y, z))
}

fn madgwick(samples: &[Sample], beta: f64) -> Off {
    let mut filter = Madgwick::new_with_quat(SAMPLE_S, beta, peer_start(samples));
    judge_peer(samples, |rate, force| *filter.update_imu(&rate, &force).unwrap())
}

fn mahony(samples: &[Sample], kp: f64, ki: f64) -> Off {
    let mut filter = Mahony::new_with_quat(SAMPLE_S, kp, ki, peer_start(samples));
    judge_peer(samples, |rate, force| *filter.update_imu(&rate, &force).unwrap())
}

/// Name of an attitude filter, and its errors.
type Judged = (String, Off);

/// The attitude filter with the smallest inclination error.
fn best(many: impl Iterator<Item = Judged>) -> Judged {
    many.min_by(|(_, a), (_, b)| a.inclination_rms.total_cmp(&b.inclination_rms)).unwrap()
}

/// The published filters with the default gains of their crate.
fn usual_peers(samples: &[Sample]) -> [Judged; 2] {
    [
        ("Madgwick, usual gain 0.1".to_owned(), madgwick(samples, 0.1)),
        ("Mahony, usual gains 0.5, 0".to_owned(), mahony(samples, 0.5, 0.0)),
    ]
}

/// The published filters with the best gains for this recording.
fn best_peers(samples: &[Sample]) -> [Judged; 2] {
    let betas = [0.0005, 0.001, 0.002, 0.003, 0.005, 0.01, 0.02, 0.033, 0.05, 0.1, 0.2];
    let kps = [0.01, 0.02, 0.05, 0.07, 0.1, 0.2, 0.5, 1.0, 2.0];
    let kis = [0.0, 0.0001, 0.0002, 0.0005, 0.001, 0.002, 0.005, 0.01, 0.02, 0.05];
    let gains = kps.into_iter().flat_map(|kp| kis.map(|ki| (kp, ki)));
    [
        best(betas.into_iter().map(|beta| (format!("Madgwick, best gain {beta}"), madgwick(samples, beta)))),
        best(gains.map(|(kp, ki)| (format!("Mahony, best gains {kp}, {ki}"), mahony(samples, kp, ki)))),
    ]
}

fn say(name: &str, off: &Off) {
    println!("{name:<60} {:>6.3} {:>7.3} {:>8.2}", off.inclination_rms, off.inclination_max, off.drift);
}

/// The samples without the gyro bias. The bias is the mean turn rate while the unit rests before the motion.
fn unbiased(samples: &[Sample]) -> Vec<Sample> {
    let rest = samples.iter().take_while(|sample| !sample.moving);
    let bias = mean(rest.map(|sample| sample.rate_radps));
    samples.iter().map(|sample| Sample { rate_radps: sample.rate_radps + -bias, ..*sample }).collect()
}

#[test]
fn attitude_from_imu_alone_is_no_worse_than_published_filters() {
    for (path, rows) in recordings::both(NAME, 10_000, 18_707) {
        let samples = samples(&path);
        assert_eq!(samples.len(), rows);
        no_worse_than_published_filters(&samples);
    }
}

fn no_worse_than_published_filters(samples: &[Sample]) {
    println!(
        "{:<60} {:>6} {:>7} {:>8}",
        "degrees: inclination, and what heading has gained", "rms", "max", "end"
    );
    let ours = ours(samples);
    say("headrace", &ours);
    for (name, off) in usual_peers(samples).into_iter().chain(best_peers(samples)) {
        say(&name, &off);
        assert!(ours.inclination_rms <= off.inclination_rms, "{name}: {off:?}; ours {ours:?}");
        assert!(ours.drift.abs() <= off.drift.abs(), "{name}: {off:?}; ours {ours:?}");
    }
    // Even without gyro bias, the published filters are as accurate as headrace's filter only if their gains are tuned
    // to this recording.
    let unbiased = unbiased(samples);
    for (name, off) in usual_peers(&unbiased) {
        say(&format!("{name}, bias removed"), &off);
        assert!(ours.inclination_rms <= off.inclination_rms, "{name}: {off:?}; ours {ours:?}");
    }
    for (name, off) in best_peers(&unbiased) {
        say(&format!("{name}, bias removed"), &off);
    }
}
