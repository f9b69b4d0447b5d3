//! Verification that the rows of measurements and the transition are the derivatives of their models.
//!
//! The reference is central differences of the nonlinear functions, through `State::correct` and `State::go_on`.
//!
//! States are drawn at random: attitudes all over the sphere, sensors anywhere on the vehicle, biases and offsets of
//! either sign.

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
/// Step of the differences.
///
/// The truncation error is of the order of its square (1e-8 for numbers near one). Rounding is of the order of 1e-16
/// / 1e-4 times the numbers, which reach some hundreds of metres: 1e-10.
const STEP: f64 = 1e-4;
/// Covers both errors with a margin.
///
/// A wrong sign or missing term causes an error of at least a hundredth.
const TOLERANCE: f64 = 1e-6;

/// Knuth's MMIX generator; returns the upper half of its state as a share of one.
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

    /// Uniform in [-reach, reach).
    pub(super) fn within(&mut self, reach: f64) -> f64 {
        reach * (2.0 * self.share() - 1.0)
    }

    pub(super) fn vector<F>(&mut self, reach: f64) -> Vec3<F> {
        Vec3::new(self.within(reach), self.within(reach), self.within(reach))
    }

    /// Approximately normal with variance 1.
    pub(super) fn normal(&mut self) -> f64 {
        (0..12).map(|_| self.within(0.5)).sum()
    }

    /// All attitudes: upright ones, and some near a pitch of 90 degrees.
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

/// Checks a row against the differences of its residual.
///
/// The expected value is the measured one minus the residual.
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
        assert!(off < tolerance, "{what}, error {error}: {slope}, the row says {}: {state:?}", at.h[error]);
    }
    true
}

/// Beams on a rectangle, whose walls are the planes that the row assumes.
///
/// A beam whose differences cross a corner is skipped, because its wall is not a plane.
#[test]
fn beam_row_on_flat_walls() {
    let profile = shapes::rectangle(7.0, 8.0).unwrap();
    let mut draws = Draws::new(1);
    // The edge of an echosounder's beam, a head's cone, and a cone so wide that the nearest part of the wall echoes.
    for first_rad in [0.0, 0.012, 0.4] {
        let checked =
            (0..STATES).filter(|_| check_beam(&mut draws, &profile, first_rad, |_| TOLERANCE)).count();
        assert!(checked > 100, "{checked} of {STATES} beams with {first_rad} met a wall");
    }
}

/// The expected range of a cone is the shortest of its rays, and the uncertainty reaches to the shortest ray of the
/// wider cone.
#[test]
fn cone_range_is_its_shortest_ray() {
    // Rays on rings around the axis. The minimum over the grid is too long by at most the square of half a mesh, 5e-3
    // rad.
    const RINGS: u32 = 200;
    let profile = shapes::rectangle(60.0, 60.0).unwrap();
    let mut draws = Draws::new(11);
    for _ in 0..40 {
        // The beam leans sideways and along the tunnel over a floor that is too wide for the cone to meet a wall.
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
            assert!((says_m - unsure_m).abs() < 1e-3, "unsure by {says_m}, not {unsure_m}");
        }
    }
}

/// Beams on a round wall: without a cone, the row is exact on any wall.
///
/// With a cone, the tangent plane at the axis turns as that point moves, by 1 / radius per metre. The row neglects
/// range x sin(first) / cos^2 of that. The point moves by at most 1 m / cosine per metre, or `range` / cosine per
/// radian. These terms bound the error.
#[test]
fn beam_row_on_round_walls() {
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
    // Expected value of the row, from a measured range of zero.
    let Some(row) = measure::range(&state, profile, &beam, 0.0, 0.1) else { return false };
    let origin = state.position + state.attitude * beam.offset;
    let looks = state.attitude * along;
    let hit = profile.cast([origin.y(), origin.z()], [looks.y(), looks.z()]).unwrap();
    // The slope has a kink where the cone just ceases to contain the normal.
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
fn height_and_chainage_rows() {
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

/// The rows of an attitude are exact if measured and estimated attitude agree, as in a converged filter.
///
/// At a difference of an angle they are wrong by half of it. So the measured attitude is within 1e-7 of the estimate,
/// deviation included.
#[test]
fn attitude_rows() {
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

/// A compass deviation rotates the measured attitude about the tunnel's z axis.
///
/// The residual is then zero.
#[test]
fn compass_deviation_gives_no_residual() {
    let mut draws = Draws::new(5);
    for _ in 0..STATES {
        let state = draws.state();
        let deviated = rotation(Vec3::<Tunnel>::new(0.0, 0.0, state.heading_offset_rad)) * state.attitude;
        for row in measure::attitude(&state, deviated, 0.1, 0.1) {
            assert!(row.residual.abs() < 1e-12, "{row:?}");
        }
    }
}

/// The turn rate is an input, so that the gyro bias is not an error of the row.
#[test]
fn velocity_and_rest_rows() {
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

/// Velocity of a point on a turning body, by differences of the point's position.
#[test]
fn velocity_of_a_sensor_on_a_lever_arm() {
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

/// A tenth of a second earlier, the position is the present one less the displacement.
///
/// This is exact for constant velocity.
#[test]
fn row_seen_later() {
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

/// An epoch of ten samples; `None` for missing data.
fn go_on(start: &State, felt: &[InertialSample]) -> (State, Transition) {
    let (mut state, mut leg) = (*start, Leg::default());
    for felt in felt {
        state.go_on(felt, 0.01, GRAVITY_MPS2, &mut leg);
    }
    let transition = leg.transition(&Settings::default());
    transition.fade(&mut state);
    (state, transition)
}

/// The transition uses the rotation in the middle of a sample for all of it.
///
/// Its error is up to a quarter of the angle turned in a sample, 0.01 rad, in the bias terms only. The largest of
/// these is 0.1 s of turning, or 0.05 s^2 of force: 0.1 x 0.0025. A wrong factor or missing term is larger for each
/// block except the displacement by a gyro bias through tilting, 10 m/s^2 x 0.1^3 / 6. So each block is compared with
/// its own size.
#[test]
fn transition_equals_differences_of_the_model() {
    let blocks = [(POSITION, 3), (VELOCITY, 3), (ATTITUDE, 3), (FORCE_BIAS, 3), (RATE_BIAS, 3)];
    let ones = [CREEP, SLACK, SLACK_RATE, SCALE, DEPTH, HEADING, RANGES].map(|i| (i, 1));
    let blocks: Vec<_> = blocks.into_iter().chain(ones).collect();
    let mut draws = Draws::new(9);
    for round in 0..STATES {
        let start = draws.state();
        let (rate, force) = (draws.vector(0.6), draws.vector(3.0) + Vec3::new(0.0, 0.0, 9.0));
        // Some rounds miss gyro or accelerometer data, for part or all of the epoch.
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
                    "round {round}: of {from} on {to} off by {off} of {size}: {start:?}"
                );
            }
        }
    }
}

/// Factors propagated by the transition equal those of F P F^T.
#[test]
fn transition_propagates_factors() {
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
        // F P, then F (F P)^T, by columns.
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
