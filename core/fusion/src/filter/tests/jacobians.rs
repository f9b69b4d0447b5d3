//! Verification that measurement rows and transition are the derivatives of their models.
//!
//! The reference is central differences of the nonlinear functions, through `State::correct` and `State::go_on`. States
//! are drawn at random: attitudes cover the whole sphere, sensors are anywhere on the vehicle, and biases and offsets
//! have either sign.

use crate::filter::inertial::{InertialSample, Leg, Transition};
use crate::filter::measure::{self, Beam, ScalarUpdate};
use crate::filter::settings::Settings;
use crate::filter::state::{
    ATTITUDE, CREEP, DEPTH, ERRORS, Errors, FORCE_BIAS, HEADING, POSITION, RANGES, RATE_BIAS, SCALE, SLACK,
    SLACK_RATE, State, VELOCITY, rotation,
};
use headrace_geometry::frames::{Body, Point3, Rot, Sensor, Tunnel, Vec3};
use headrace_geometry::math::{self, PI};
use headrace_geometry::tunnel::{Profile, shapes};

const STATES: u64 = 300;
const GRAVITY_MPS2: f64 = 9.81;
/// Step of the central differences.
///
/// The truncation error is about the square of the step: 1e-8 for numbers near one. The relative rounding error is that
/// of a double divided by the step, about 1e-12. Values reach some hundreds of metres, so the rounding error is 1e-10.
const STEP: f64 = 1e-4;
/// Tolerance that covers truncation and rounding with a margin. A wrong sign or a missing term causes an error of at
/// least 0.01.
const TOLERANCE: f64 = 1e-6;

/// Knuth's MMIX random number generator. The upper half of its state gives a number from 0 to 1.
pub(super) struct Draws(u64);

impl Draws {
    pub(super) fn new(seed: u64) -> Self {
        let mut draws = Self(seed);
        for _ in 0..4 {
            draws.share();
        }
        draws
    }

    fn share(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 32) as f64 / 4_294_967_296.0
    }

    /// Returns a uniformly distributed random number in [-reach, reach).
    pub(super) fn within(&mut self, reach: f64) -> f64 {
        reach * (2.0 * self.share() - 1.0)
    }

    pub(super) fn vector<F>(&mut self, reach: f64) -> Vec3<F> {
        Vec3::new(self.within(reach), self.within(reach), self.within(reach))
    }

    /// Returns an approximately normal random number with variance 1.
    pub(super) fn normal(&mut self) -> f64 {
        (0..12).map(|_| self.within(0.5)).sum()
    }

    /// Returns a random attitude: nearly upright, arbitrary, or near a pitch of 90 degrees.
    fn attitude<From>(&mut self) -> Rot<Tunnel, From> {
        let pitch = match self.0 >> 62 {
            0 => PI / 2.0 + self.within(1e-3),
            1 => self.within(0.2),
            _ => self.within(PI / 2.0),
        };
        Rot::from_roll_pitch_yaw(self.within(PI), pitch, self.within(PI))
    }

    fn mounted(&mut self) -> Rot<Body, Sensor> {
        let any = self.attitude::<Body>().wxyz();
        Rot::from_wxyz(any[0], any[1], any[2], any[3]).unwrap()
    }

    pub(super) fn state(&mut self) -> State {
        State {
            position: Point3::new(self.within(200.0), self.within(1.5), 4.0 + self.within(1.5)),
            velocity_mps: self.vector(1.0),
            attitude: self.attitude(),
            force_bias_mps2: self.vector(0.1),
            rate_bias_radps: self.vector(0.02),
            slack_m: self.within(0.5),
            slack_rate_mps: self.within(0.1),
            creep_m: self.within(2.0),
            scale: self.within(0.05),
            depth_offset_m: self.within(1.0),
            heading_offset_rad: self.within(0.3),
            range_scale: self.within(0.05),
        }
    }
}

fn moved(state: &State, error: usize, by: f64) -> State {
    let mut errors = [0.0; ERRORS];
    errors[error] = by;
    let mut state = *state;
    state.correct(&errors);
    state
}

/// Checks a measurement row against central differences of its residual.
///
/// The value that the model expects is the measured value minus the residual.
fn check_row(
    what: &str,
    state: &State,
    tolerance: f64,
    row: impl Fn(&State) -> Option<ScalarUpdate>,
) -> bool {
    let Some(at) = row(state) else { return false };
    for error in 0..ERRORS {
        let (Some(above), Some(below)) = (row(&moved(state, error, STEP)), row(&moved(state, error, -STEP)))
        else {
            return false;
        };
        let slope = (below.residual - above.residual) / (2.0 * STEP);
        let off = (slope - at.h[error]).abs();
        assert!(off < tolerance, "{what}, error {error}: {slope}, the row has {}: {state:?}", at.h[error]);
    }
    true
}

/// The walls of a rectangular tunnel are planes, as the measurement row assumes.
///
/// A beam is skipped if the finite differences cross a corner, where the wall is not a plane.
#[test]
fn beam_row_on_flat_walls_equals_finite_differences() {
    let profile = shapes::rectangle(7.0, 8.0).unwrap();
    let mut draws = Draws::new(1);
    // Half angles, radians: of an echosounder's beam, of a head's cone, and of a cone so wide that the nearest part of
    // the wall echoes.
    for first_rad in [0.0, 0.012, 0.4] {
        let checked =
            (0..STATES).filter(|_| check_beam(&mut draws, &profile, first_rad, |_| TOLERANCE)).count();
        assert!(checked > 100, "{checked} of {STATES} beams with {first_rad} met a wall");
    }
}

/// The expected range of a cone equals the length of its shortest ray. The uncertainty of the range reaches down to the
/// shortest ray of the wider cone.
#[test]
fn expected_range_of_a_cone_equals_its_shortest_ray() {
    // The rays lie on rings around the axis, spaced by 5e-3 rad. The shortest ray is longer than the true shortest
    // range, by a share of at most the square of half this spacing.
    const RINGS: u32 = 200;
    let profile = shapes::rectangle(60.0, 60.0).unwrap();
    let mut draws = Draws::new(11);
    for _ in 0..40 {
        // The beam leans sideways and along the tunnel. The floor is so wide that the cone meets no wall.
        let lean = rotation(Vec3::new(draws.within(0.6), draws.within(0.6), 0.0)) * Rot::identity();
        let position = Point3::new(0.0, 0.0, 3.0);
        let state = State { position, attitude: lean, range_scale: 0.0, ..draws.state() };
        let along = Vec3::<Body>::new(0.0, 0.0, -1.0);
        let least_m = |half_rad: f64| {
            let around = (0..=RINGS).flat_map(|ring| (0..200).map(move |turn| (ring, turn)));
            let ranges = around.map(|(ring, turn)| {
                let (sin, cos) = math::sin_cos(half_rad * f64::from(ring) / f64::from(RINGS));
                let (across, up) = math::sin_cos(PI * f64::from(turn) / 100.0);
                let ray = state.attitude * Vec3::<Body>::new(sin * across, sin * up, -cos);
                3.0 / -ray.z()
            });
            ranges.fold(f64::INFINITY, f64::min)
        };
        for (first_rad, unsure_rad) in [(0.0, 0.22), (0.012, 0.0), (0.012, 0.3)] {
            let beam = Beam { offset: Vec3::zero(), along, first_rad, unsure_rad };
            let row = measure::range(&state, &profile, &beam, 0.0, 0.1).unwrap();
            let expected_m = least_m(first_rad);
            assert!((-row.residual - expected_m).abs() < 1e-3, "{row:?}, not {expected_m}");
            let unsure_m = (expected_m - least_m(unsure_rad.max(first_rad))) / math::sqrt(3.0);
            let says_m = math::sqrt((row.noise - 0.01).max(0.0));
            assert!((says_m - unsure_m).abs() < 1e-3, "uncertainty {says_m}, not {unsure_m}");
        }
    }
}

/// Without a cone, the measurement row of a beam on a round wall is exact. With a cone, its error has the following
/// bound.
///
/// The row assumes the tangent plane where the beam's axis meets the wall. This point moves by at most 1 m / cosine per
/// metre, or by `range` / cosine per radian. The tangent plane then turns by 1 / radius per metre. The row neglects
/// this turn of the plane, which changes the range by range x sin(first) / cos^2 per radian.
#[test]
fn beam_row_on_round_walls_equals_finite_differences() {
    const RADIUS_M: f64 = 4.0;
    let profile = shapes::circle(RADIUS_M).unwrap();
    let mut draws = Draws::new(2);
    let checked = (0..STATES).filter(|_| check_beam(&mut draws, &profile, 0.0, |_| TOLERANCE)).count();
    assert!(checked > 100, "{checked}");
    let first_rad = 0.012;
    let neglect = |range_m: f64| range_m * math::sin(first_rad) * 4.0 * (2.0 * range_m.max(1.0) / RADIUS_M);
    let checked = (0..STATES).filter(|_| check_beam(&mut draws, &profile, first_rad, neglect)).count();
    assert!(checked > 100, "{checked}");
}

fn check_beam(draws: &mut Draws, profile: &Profile, first_rad: f64, tolerance: impl Fn(f64) -> f64) -> bool {
    const CORNER_M: f64 = 0.05;
    let state = draws.state();
    let along = draws.mounted() * Vec3::new(1.0, 0.0, 0.0);
    let beam = Beam { offset: draws.vector(0.5), along, first_rad, unsure_rad: 0.0 };
    // The measured range is zero, so the residual is the negative of the expected range.
    let Some(row) = measure::range(&state, profile, &beam, 0.0, 0.1) else { return false };
    let origin = state.position + state.attitude * beam.offset;
    let looks = state.attitude * along;
    let hit = profile.cast([origin.y(), origin.z()], [looks.y(), looks.z()]).unwrap();
    // The slope has a kink where the wall's normal leaves the cone. States near the kink are skipped.
    let incidence = math::acos(-(hit.normal[0] * looks.y() + hit.normal[1] * looks.z()));
    let edge = [origin.y() + looks.y() * hit.range_m, origin.z() + looks.z() * hit.range_m];
    let corner = (edge[0].abs() - 3.5).abs() < CORNER_M
        && ((edge[1] - 8.0).abs() < CORNER_M || edge[1].abs() < CORNER_M);
    if corner || (incidence - first_rad).abs() < 0.01 {
        return false;
    }
    check_row("range", &state, tolerance(-row.residual), |state| {
        measure::range(state, profile, &beam, 0.0, 0.1)
    })
}

#[test]
fn height_and_chainage_rows_equal_finite_differences() {
    let mut draws = Draws::new(3);
    for _ in 0..STATES {
        let (state, offset) = (draws.state(), draws.vector(0.8));
        let height_m = draws.within(5.0);
        assert!(check_row("height", &state, TOLERANCE, |state| {
            Some(measure::height(state, offset, height_m, 0.1))
        }));
        assert!(check_row("chainage", &state, TOLERANCE, |state| {
            Some(measure::chainage(state, offset, 0.0, 0.1))
        }));
    }
}

/// The measurement rows of an attitude are exact if the measured attitude equals the estimate, as in a converged
/// filter.
///
/// If they differ by an angle, the rows are wrong by half of it. So the test's measured attitude, deviation included,
/// is within 1e-7 rad of the estimate.
#[test]
fn attitude_rows_equal_finite_differences() {
    let mut draws = Draws::new(4);
    for _ in 0..STATES {
        let state = State { heading_offset_rad: 0.0, ..draws.state() };
        let measured = rotation(draws.vector::<Tunnel>(1e-7)) * state.attitude;
        for k in 0..3 {
            assert!(check_row("attitude", &state, TOLERANCE, |state| {
                Some(measure::attitude(state, measured, 0.1, 0.1)[k])
            }));
        }
    }
}

/// If the measured attitude is turned about the tunnel's z axis by exactly the compass deviation, the residual is zero.
#[test]
fn attitude_with_known_compass_deviation_has_no_residual() {
    let mut draws = Draws::new(5);
    for _ in 0..STATES {
        let state = draws.state();
        let deviated = rotation(Vec3::<Tunnel>::new(0.0, 0.0, state.heading_offset_rad)) * state.attitude;
        for row in measure::attitude(&state, deviated, 0.1, 0.1) {
            assert!(row.residual.abs() < 1e-12, "{row:?}");
        }
    }
}

/// The model gets the turn rate as an input, so the measurement row does not depend on the gyro bias.
#[test]
fn velocity_and_rest_rows_equal_finite_differences() {
    let mut draws = Draws::new(6);
    for _ in 0..STATES {
        let state = draws.state();
        let (offset, mounted): (Vec3<Body>, _) = (draws.vector(0.8), draws.mounted());
        let rate = draws.vector(1.0);
        for k in 0..3 {
            assert!(check_row("velocity", &state, TOLERANCE, |state| {
                Some(measure::velocity(state, (offset, mounted), rate, Vec3::zero(), 0.1)[k])
            }));
            assert!(check_row("rest", &state, TOLERANCE, |state| Some(measure::rest(state, 0.1)[k])));
        }
    }
}

/// The reference is central differences of the position of a point on a turning body.
#[test]
fn velocity_on_a_lever_arm_equals_finite_differences_of_position() {
    let mut draws = Draws::new(7);
    for _ in 0..STATES {
        let state = draws.state();
        let (offset, mounted): (Vec3<Body>, _) = (draws.vector(0.8), draws.mounted());
        let rate: Vec3<Body> = draws.vector(1.0);
        let place = |at_s: f64| {
            let attitude = state.attitude * rotation(rate.scaled(at_s));
            state.position + state.velocity_mps.scaled(at_s) + attitude * offset
        };
        let moved = (place(STEP) - place(-STEP)).scaled(0.5 / STEP);
        let in_sensor = mounted.inverse() * (state.attitude.inverse() * moved);
        for row in measure::velocity(&state, (offset, mounted), rate, in_sensor, 0.1) {
            assert!(row.residual.abs() < TOLERANCE, "{row:?}");
        }
    }
}

/// The reference predicts a measurement made 0.07 s before the estimate, from the position at the time of that
/// measurement.
///
/// The prediction is exact if the velocity is constant.
#[test]
fn row_of_an_earlier_measurement_equals_finite_differences() {
    const LATER_S: f64 = 0.07;
    let mut draws = Draws::new(8);
    for _ in 0..STATES {
        let (state, offset) = (draws.state(), draws.vector(0.8));
        let row = |now: &State| {
            let then = State { position: now.position + now.velocity_mps.scaled(-LATER_S), ..*now };
            Some(measure::chainage(&then, offset, 0.0, 0.1).seen_later(LATER_S))
        };
        assert!(check_row("seen later", &state, TOLERANCE, row));
    }
}

/// Propagates a state by samples of 10 ms; returns the final state and the transition of errors.
fn go_on(start: &State, felt: &[InertialSample]) -> (State, Transition) {
    let (mut state, mut leg) = (*start, Leg::default());
    for felt in felt {
        state.go_on(felt, 0.01, GRAVITY_MPS2, &mut leg);
    }
    let transition = leg.transition(&Settings::default());
    transition.fade(&mut state);
    (state, transition)
}

/// The transition uses the rotation in the middle of a sample for the whole sample.
///
/// The difference from the true rotation affects only the bias terms, by up to a quarter of the angle turned in a
/// sample (0.01 rad). The largest bias terms are 0.1 s of turning and 0.05 s^2 of force, so the error is up to 0.1 x
/// 0.0025. In most blocks, a wrong factor or a missing term causes a larger error. The exception is the displacement
/// that a gyro bias causes by tilting the force: it is only 10 m/s^2 x 0.1^3 / 6. So each block of the matrix is
/// compared relative to its own size.
#[test]
fn transition_matrix_equals_finite_differences_of_the_model() {
    let blocks = [(POSITION, 3), (VELOCITY, 3), (ATTITUDE, 3), (FORCE_BIAS, 3), (RATE_BIAS, 3)];
    let ones = [CREEP, SLACK, SLACK_RATE, SCALE, DEPTH, HEADING, RANGES].map(|i| (i, 1));
    let blocks: Vec<_> = blocks.into_iter().chain(ones).collect();
    let mut draws = Draws::new(9);
    for round in 0..STATES {
        let start = draws.state();
        let (rate, force) = (draws.vector(0.6), draws.vector(3.0) + Vec3::new(0.0, 0.0, 9.0));
        // In some rounds, gyro or accelerometer data are missing for part of the epoch or for all of it.
        let blind = |k: u64, part: u64| round % 4 == part && k >= round % 3 * 4;
        let felt: Vec<_> = (0..10)
            .map(|k| InertialSample {
                rate_radps: (!blind(k, 1)).then(|| rate + draws.vector(0.3)),
                force_mps2: (!blind(k, 2)).then(|| force + draws.vector(1.0)),
            })
            .collect();
        let (_, transition) = go_on(&start, &felt);
        let columns: Vec<(Errors, Errors)> = (0..ERRORS)
            .map(|error| {
                let (above, _) = go_on(&moved(&start, error, STEP), &felt);
                let (below, _) = go_on(&moved(&start, error, -STEP), &felt);
                let mut says = [0.0; ERRORS];
                says[error] = 1.0;
                transition.apply(&mut says);
                (below.errors_to(&above).map(|e| e / (2.0 * STEP)), says)
            })
            .collect();
        for (from, from_len) in &blocks {
            for (to, to_len) in &blocks {
                let (mut off, mut size) = (0.0, 0.0);
                for (slope, says) in &columns[*from..from + from_len] {
                    for i in *to..to + to_len {
                        off += (slope[i] - says[i]) * (slope[i] - says[i]);
                        size += slope[i] * slope[i];
                    }
                }
                let (off, size) = (math::sqrt(off), math::sqrt(size));
                assert!(
                    off < 3e-3 * size + 1e-9,
                    "round {round}: effect of error {from} on error {to}, {size}, is off by {off}: {start:?}"
                );
            }
        }
    }
}

/// Factors propagated by the transition are the factors of F P F^T.
#[test]
fn propagated_factors_equal_the_factors_of_the_propagated_covariance() {
    use crate::filter::factors::Factors;
    let mut draws = Draws::new(10);
    for _ in 0..20 {
        let start = draws.state();
        let felt =
            [InertialSample { rate_radps: Some(draws.vector(0.6)), force_mps2: Some(draws.vector(10.0)) };
                10];
        let (_, transition) = go_on(&start, &felt);
        let mut factors = Factors::independent([0.01; ERRORS]);
        for i in 0..ERRORS {
            let along: Errors = core::array::from_fn(|k| ((i * 7 + k * 3) % 11) as f64 / 5.0 - 1.0);
            factors.add(0.2, along, ERRORS);
        }
        let before: [Errors; ERRORS] = factors.rows(core::array::from_fn(|i| i));
        transition.carry(&mut factors);
        // The product F P is computed first, and then F (F P)^T, both by columns.
        let carried = |mut columns: [Errors; ERRORS]| {
            for column in &mut columns {
                transition.apply(column);
            }
            columns
        };
        let once = carried(before);
        let twice = carried(core::array::from_fn(|i| once.map(|column| column[i])));
        for (i, column) in twice.iter().enumerate() {
            for (j, should) in column.iter().enumerate() {
                let off = (should - factors.covariance(i, j)).abs();
                assert!(off < 1e-10, "({i}, {j}): off by {off}");
            }
        }
    }
}
