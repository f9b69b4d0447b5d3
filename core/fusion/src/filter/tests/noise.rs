//! Verification that the process noise of an epoch equals the noise of the modelled random processes.

use super::jacobians::Draws;
use crate::filter::factors::Factors;
use crate::filter::inertial::{InertialSample, Leg, Transition};
use crate::filter::settings::{GaussMarkov, Settings};
use crate::filter::state::{
    ATTITUDE, DEPTH, ERRORS, FORCE_BIAS, HEADING, POSITION, RATE_BIAS, SCALE, SLACK, SLACK_RATE, State,
    VELOCITY,
};
use headrace_geometry::frames::Vec3;
use headrace_geometry::math;

/// Returns the transition of a leg with these inertial data, and the covariance of the leg's noise alone.
fn leg(settings: &Settings, dt_s: f64, felt: InertialSample) -> (Transition, Factors<ERRORS>) {
    let mut state = Draws::new(1).state();
    let mut leg = Leg::default().with_noise([1.0; 2], settings.slack);
    state.go_on(&felt, dt_s, 9.81, &mut leg);
    let transition = leg.transition(settings);
    let mut factors = Factors::independent([0.0; ERRORS]);
    leg.disturb(settings, &transition, &mut factors);
    (transition, factors)
}

fn still() -> InertialSample {
    InertialSample { rate_radps: Some(Vec3::zero()), force_mps2: Some(Vec3::new(0.0, 0.0, 9.81)) }
}

fn near(what: &str, is: f64, should: f64, share: f64) {
    assert!((is - should).abs() <= share * should.abs() + 1e-18, "{what}: {is}, not {should}");
}

/// The slack process is two lags in series, s' = -s / T + r, r' = -r / T + w. The test integrates it by Euler's method
/// in steps of 1e-5 T.
///
/// The method's error is of the order of the step.
#[test]
fn slack_noise_equals_numerical_integration_of_the_slack_process() {
    let settings = Settings { slack: GaussMarkov { reach: 0.06, time_s: 10.0 }, ..Settings::default() };
    // Density of w at which s has a variance of reach^2: 4 reach^2 / T^3.
    let density = 4.0 * 0.06 * 0.06 / 1e3;
    for lags in [0.01, 0.3, 1.0, 4.0] {
        let (_, factors) = leg(&settings, lags * 10.0, still());
        let (mut ss, mut sr, mut rr) = (0.0, 0.0, 0.0);
        let step = 1e-5;
        let dt_s = step * 10.0;
        for _ in 0..math::round_to_i64(lags / step) {
            (ss, sr, rr) = (
                ss + 2.0 * (sr * dt_s - ss * step),
                sr + rr * dt_s - 2.0 * sr * step,
                rr - 2.0 * rr * step + density * dt_s,
            );
        }
        // With fewer steps, the error of the first steps matters more.
        let share = 1e-4 + 3.0 * step / lags;
        near("slack", factors.variance(SLACK), ss, share);
        near("both", factors.covariance(SLACK, SLACK_RATE), sr, share);
        near("rate", factors.variance(SLACK_RATE), rr, share);
    }
}

/// In the steady state, the slack has its declared variance. Its autocorrelation after x time constants is (1 + x)
/// e^-x.
#[test]
fn slack_variance_converges_to_the_declared_value() {
    let settings = Settings { slack: GaussMarkov { reach: 0.3, time_s: 7.0 }, ..Settings::default() };
    let mut factors = Factors::independent([0.0; ERRORS]);
    // The epochs have various lengths, because the steady state must not depend on them.
    for k in 0..3000 {
        let (transition, noise) = leg(&settings, 0.03 + 0.02 * f64::from(k % 5), still());
        transition.carry(&mut factors);
        add_slack(&mut factors, &noise);
    }
    near("variance", factors.variance(SLACK), 0.09, 1e-9);
    near("of the rate", factors.variance(SLACK_RATE), settings.slack.drive() * settings.slack.drive(), 1e-9);
    for lags in [0.1, 0.5, 1.0, 2.0, 5.0] {
        let (transition, _) = leg(&settings, lags * 7.0, still());
        let mut column: [f64; ERRORS] = core::array::from_fn(|i| factors.covariance(i, SLACK));
        transition.apply(&mut column);
        near("autocorrelation", column[SLACK] / 0.09, (1.0 + lags) * math::exp(-lags), 1e-9);
    }
}

fn add_slack(factors: &mut Factors<ERRORS>, noise: &Factors<ERRORS>) {
    let rr = noise.variance(SLACK_RATE);
    let sr = noise.covariance(SLACK, SLACK_RATE);
    let mut along = [0.0; ERRORS];
    (along[SLACK], along[SLACK_RATE]) = (sr / rr, 1.0);
    factors.add(rr, along, ERRORS);
    factors.add_to(SLACK, noise.variance(SLACK) - sr * sr / rr);
}

/// The reference is 4000 random epochs of ten samples with white force and white turn rate, by `State::go_on`.
///
/// A variance from n draws has a relative standard deviation of sqrt(2 / n) = 2.2 %, so the limit of 9 % is four of
/// them. Noise of the turn rate also tilts the force, which the process noise of an epoch neglects. So the simulated
/// unit is level and tilts only about x. The test compares its x axis, on which gravity has no first-order effect.
#[test]
fn white_process_noise_covariance_equals_monte_carlo() {
    const DRAWS: u32 = 4000;
    let settings = Settings { rate_noise: 0.004, force_noise: 0.02, ..Settings::default() };
    let (_, factors) = leg(&settings, 0.1, still());
    let mut draws = Draws::new(2);
    let (mut pp, mut pv, mut vv, mut tt) = (0.0, 0.0, 0.0, 0.0);
    for _ in 0..DRAWS {
        let start = State::at_rest(
            headrace_geometry::frames::Point3::zero(),
            headrace_geometry::frames::Rot::identity(),
        );
        let (mut state, mut leg) = (start, Leg::default());
        for _ in 0..10 {
            let felt = InertialSample {
                rate_radps: Some(Vec3::new(draws.normal() * 0.004 / math::sqrt(0.01), 0.0, 0.0)),
                force_mps2: Some(Vec3::new(draws.normal() * 0.02 / math::sqrt(0.01), 0.0, 9.81)),
            };
            state.go_on(&felt, 0.01, 9.81, &mut leg);
        }
        let off = start.errors_to(&state);
        pp += off[POSITION] * off[POSITION] / f64::from(DRAWS);
        pv += off[POSITION] * off[VELOCITY] / f64::from(DRAWS);
        vv += off[VELOCITY] * off[VELOCITY] / f64::from(DRAWS);
        tt += off[ATTITUDE] * off[ATTITUDE] / f64::from(DRAWS);
    }
    for axis in 0..3 {
        near("way", factors.variance(POSITION + axis), pp, 0.09);
        near("both", factors.covariance(POSITION + axis, VELOCITY + axis), pv, 0.09);
        near("velocity", factors.variance(VELOCITY + axis), vv, 0.09);
        near("attitude", factors.variance(ATTITUDE + axis), tt, 0.09);
    }
}

/// While inertial data are missing, the noise that is configured for missing data applies.
#[test]
fn noise_for_missing_inertial_data_equals_the_configured_values() {
    let settings = Settings { blind_rate_noise: 0.03, blind_force_noise: 0.5, ..Settings::default() };
    let (_, blind) = leg(&settings, 0.4, InertialSample { rate_radps: None, force_mps2: None });
    for axis in 0..3 {
        near("velocity", blind.variance(VELOCITY + axis), 0.25 * 0.4, 1e-12);
        near("way", blind.variance(POSITION + axis), 0.25 * 0.064 / 3.0, 1e-12);
        near("attitude", blind.variance(ATTITUDE + axis), 0.0009 * 0.4, 1e-12);
    }
}

/// The noise of each epoch makes up for the decay of an error, so the error keeps its variance.
///
/// The variance of a random walk grows with time.
#[test]
fn decaying_errors_keep_their_standard_deviation() {
    let settings = Settings::default();
    let reaches = [
        (FORCE_BIAS, settings.force_bias.reach),
        (RATE_BIAS, settings.rate_bias.reach),
        (HEADING, settings.heading.reach),
    ];
    let mut factors = Factors::independent([0.0; ERRORS]);
    let (transition, noise) = leg(&settings, 5.0, still());
    for _ in 0..5000 {
        transition.carry(&mut factors);
        for i in FORCE_BIAS..ERRORS {
            factors.add_to(i, noise.variance(i));
        }
    }
    for (i, reach) in reaches {
        near("reach", factors.variance(i), reach * reach, 1e-9);
    }
    near("scale", factors.variance(SCALE), settings.scale_noise * settings.scale_noise * 25e3, 1e-9);
    near("depth", factors.variance(DEPTH), settings.depth_noise * settings.depth_noise * 25e3, 1e-9);
    // After one time constant, 1/e of the initial error is left.
    let (transition, _) = leg(&settings, settings.heading.time_s, still());
    let mut column = [1.0; ERRORS];
    transition.apply(&mut column);
    near("heading", column[HEADING], math::exp(-1.0), 1e-12);
}
