//! Robust least-squares fit of the vehicle's position and the heads' mounts to the design profile.
//!
//! The method is Gauss-Newton. In each round, [`Factors`] start with the prior and then include one return after the
//! other. If the returns don't determine an unknown, the unknown keeps the vehicle file's value and uncertainty.

use crate::calibrate::estimate::median;
use crate::calibrate::scan::{EchoScan, HeadScan, Return};
use headrace_fusion::filter::factors::Factors;
use headrace_fusion::filter::measure::{self, Beam, ScalarUpdate};
use headrace_fusion::filter::settings::Settings;
use headrace_fusion::filter::state::{ATTITUDE, POSITION, State, rotation, vec};
use headrace_geometry::frames::{Body, Mount, Point3, Rot, Sensor, Tunnel, Vec3, head_direction};
use headrace_geometry::math;
use headrace_geometry::tunnel::Profile;

/// Number of unknowns common to all heads.
///
/// They are the vehicle's y and z, m, the rotation vector from the inertial unit's attitude to the true one,
/// radians, and the relative excess of the ranges.
pub(crate) const COMMON: usize = 6;
/// Number of unknowns of each head.
///
/// They are its angle about its axis, radians, and its offsets to the left and upwards from the file's
/// position, m.
pub(crate) const OWN: usize = 3;

/// Standard deviation of the prior of the vehicle's position, m: the vehicle may be anywhere in the cross-section.
const PLACE_SD_M: f64 = 10.0;
/// Standard deviation of the roll and pitch errors of an inertial unit at rest, radians.
///
/// Source: data sheets of MEMS units, static accuracy 0.2 degrees.
const TILT_SD_RAD: f64 = 0.2 * DEGREE;
/// Relative standard deviation of a speed of sound from tables. It corresponds to an error of 1 degree in the
/// water temperature.
const SCALE_SD: f64 = 0.003;
/// Standard deviation of the angle of a mount in a vehicle file, radians.
///
/// This value and [`OFFSET_SD_M`] allow for a tape measure on a round hull, and for the bracket of a head.
pub(crate) const ANGLE_SD_RAD: f64 = 10.0 * DEGREE;
/// Standard deviation of the position of a mount in a vehicle file, m. See [`ANGLE_SD_RAD`].
pub(crate) const OFFSET_SD_M: f64 = 0.05;
const DEGREE: f64 = core::f64::consts::PI / 180.0;

/// Minimum standard deviation assumed for returns, m. It stands for the roughness that every wall has.
const LEAST_SCALE_M: f64 = 0.01;
/// Residuals beyond `HUBER` robust standard deviations get less weight. Residuals beyond `TUKEY` robust
/// standard deviations are rejected. Source: the usual constants of Huber and Tukey.
const HUBER: f64 = 1.5;
const TUKEY: f64 = 4.685;
/// Number of rounds with Huber's weights before the rounds with Tukey's weights, which need a good start.
const HUBER_ROUNDS: usize = 3;
/// Upper limit of the cost that one piece of wall adds to the fit, in squared standard deviations. `MISSED_COST` is the
/// cost of a piece of wall that the beam grazes or misses.
const MOST_COST: f64 = 9.0;
const MISSED_COST: f64 = 4.5;
/// Upper limit of the cost that an echosounder's range adds to the fit, in squared standard deviations.
///
/// The limit is high, because echosounders are few and only they distinguish left from right.
const MOST_ECHO_COST: f64 = 100.0;
/// Largest change of a head's angle in one round of the fit, radians. A larger change is shortened.
const MOST_STEP_RAD: f64 = 0.2;

/// Input of a fit of the vehicle's position and the heads' mounts.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Problem<'a> {
    /// Design profile of the tunnel's cross-section.
    pub(crate) profile: &'a Profile,
    /// Measurement noise of the sonars.
    pub(crate) settings: &'a Settings,
    /// Sonar returns of each head. The number of heads is limited by the number of unknowns.
    pub(crate) heads: &'a [HeadScan],
    /// Ranges of each echosounder.
    pub(crate) echoes: &'a [EchoScan],
    /// Attitude of the vehicle at the time of the fit.
    pub(crate) attitude: Rot<Tunnel, Body>,
    /// Whether each head is taken to turn opposite to the sense in the vehicle file.
    pub(crate) mirrored: &'a [bool],
    /// Only every `stride`-th return is used.
    pub(crate) stride: usize,
}

/// Result of a fit. The unknowns are [`COMMON`], followed by [`OWN`] for each head.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Fit<const N: usize> {
    /// Values of the unknowns.
    pub(crate) x: [f64; N],
    /// Covariance of the unknowns, as factors.
    pub(crate) factors: Factors<N>,
    /// Sum of the misfits of returns, echoes and prior, in squared standard deviations.
    pub(crate) cost: f64,
    /// Robust standard deviation of the residuals, m.
    pub(crate) scale_m: f64,
}

/// Range residual of a head's return.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Residual<const N: usize> {
    /// Index of the head that received the return.
    pub(crate) head: usize,
    /// Weight of the return. The returns from one piece of wall share a total weight of one.
    pub(crate) share: f64,
    /// Derivatives of the expected range, and the measured minus the expected range, m; `None` if the beam
    /// grazes or misses the wall.
    pub(crate) row: Option<([f64; N], f64)>,
}

/// Index of unknown `i` of head `head`.
pub(crate) fn own(head: usize, i: usize) -> usize {
    COMMON + OWN * head + i
}

fn at<const N: usize>(x: &[f64; N], i: usize) -> f64 {
    x.get(i).copied().unwrap_or(0.0)
}

fn add<const N: usize>(x: &mut [f64; N], i: usize, value: f64) {
    if let Some(slot) = x.get_mut(i) {
        *slot += value;
    }
}

/// A mount after its head is turned about the head's axis and moved. The head may also turn the opposite way.
pub(crate) fn moved(mount: &Mount, [angle_rad, left_m, up_m]: [f64; 3], is_mirrored: bool) -> Mount {
    let turned: Rot<Body, Sensor> = mount.rotation * about_x(angle_rad);
    // A head that faces the opposite way, such as aft, measures its angles in the opposite sense.
    let yaw = if is_mirrored { math::PI } else { 0.0 };
    Mount {
        position: mount.position + Vec3::new(0.0, left_m, up_m),
        rotation: turned * Rot::<Sensor, Sensor>::from_roll_pitch_yaw(0.0, 0.0, yaw),
    }
}

fn about_x(angle_rad: f64) -> Rot<Sensor, Sensor> {
    Rot::from_roll_pitch_yaw(angle_rad, 0.0, 0.0)
}

impl Problem<'_> {
    /// Standard deviations of the prior of all unknowns.
    fn known<const N: usize>(&self) -> [f64; N] {
        let yaw = self.settings.heading.reach;
        let common = [PLACE_SD_M, PLACE_SD_M, TILT_SD_RAD, TILT_SD_RAD, yaw, SCALE_SD];
        let of_head = [ANGLE_SD_RAD, OFFSET_SD_M, OFFSET_SD_M];
        let mut all = common.into_iter().chain(of_head.into_iter().cycle());
        core::array::from_fn(|_| all.next().unwrap_or(1.0))
    }

    /// Fits the unknowns, beginning with `start`, in at most `rounds` rounds.
    pub(crate) fn fit<const N: usize>(&self, start: [f64; N], rounds: usize) -> Fit<N> {
        let known = self.known::<N>();
        let mut prior = start;
        // The prior of the vehicle's position is centred on the start of the fit. The priors of all other unknowns are
        // centred on the vehicle file's values.
        prior.iter_mut().skip(2).for_each(|slot| *slot = 0.0);
        let mut x = start;
        let mut factors = Factors::independent(known.map(|sd| sd * sd));
        let mut scale_m = LEAST_SCALE_M;
        for round in 0..rounds {
            let residuals = self.residuals(&x);
            scale_m = scale(&residuals);
            factors = Factors::independent(known.map(|sd| sd * sd));
            let mut step: [f64; N] = core::array::from_fn(|i| at(&prior, i) - at(&x, i));
            let mut take = |h: &[f64; N], residual: f64, variance: f64| {
                let shown: f64 = h.iter().zip(&step).map(|(h, e)| h * e).sum();
                let gain = factors.measure(h, variance);
                for (e, k) in step.iter_mut().zip(&gain.k) {
                    *e += k * (residual - shown);
                }
            };
            for residual in &residuals {
                let Some((h, off_m)) = &residual.row else { continue };
                let weight = residual.share * weight(off_m / scale_m, round >= HUBER_ROUNDS);
                if weight > 1e-3 * residual.share {
                    take(h, *off_m, scale_m * scale_m / weight);
                }
            }
            for (h, off_m, variance) in self.echo_rows(&x) {
                let weight = weight(off_m / math::sqrt(variance), false);
                take(&h, off_m, variance / weight);
            }
            self.go(&mut x, &step);
            if round > HUBER_ROUNDS && step.iter().all(|e| e.abs() < 1e-7) {
                break;
            }
        }
        let cost = self.cost(&x, &prior, &known);
        Fit { x, factors, cost, scale_m }
    }

    /// Applies one step of the fit to the unknowns. The step is shortened if it would turn a head too far or leave the
    /// tunnel.
    fn go<const N: usize>(&self, x: &mut [f64; N], step: &[f64; N]) {
        let turns = (0..self.heads.len()).map(|head| at(step, own(head, 0)).abs());
        let most_rad = turns.fold(0.0, f64::max);
        let mut share = if most_rad > MOST_STEP_RAD { MOST_STEP_RAD / most_rad } else { 1.0 };
        for _ in 0..8 {
            if self.profile.contains([at(x, 0) + share * at(step, 0), at(x, 1) + share * at(step, 1)]) {
                for (x, e) in x.iter_mut().zip(step) {
                    *x += share * e;
                }
                return;
            }
            share /= 2.0;
        }
    }

    /// Range residuals of all heads' returns.
    pub(crate) fn residuals<const N: usize>(&self, x: &[f64; N]) -> Vec<Residual<N>> {
        let mut all = Vec::new();
        for (head, scan) in self.heads.iter().enumerate() {
            let is_mirrored = self.mirrored.get(head).copied().unwrap_or(false);
            for one in scan.returns.iter().step_by(self.stride.max(1)) {
                let row = self.row(x, head, &scan.mount, one, is_mirrored);
                all.push(Residual { head, share: one.share * self.stride.max(1) as f64, row });
            }
        }
        all
    }

    fn row<const N: usize>(
        &self,
        x: &[f64; N],
        head: usize,
        mount: &Mount,
        one: &Return,
        is_mirrored: bool,
    ) -> Option<([f64; N], f64)> {
        let [angle_rad, left_m, up_m] = [0, 1, 2].map(|i| at(x, own(head, i)));
        let rotation = mount.rotation * about_x(angle_rad);
        let looks = head_direction(if is_mirrored { -one.angle_rad } else { one.angle_rad });
        let offset = mount.position + Vec3::new(0.0, left_m, up_m);
        let beam = Beam {
            offset,
            along: rotation * looks,
            first_rad: self.settings.return_beam_rad / 2.0,
            unsure_rad: 0.0,
        };
        let state = state(x, one.attitude);
        let (mut h, row) = self.common_row(x, &state, &beam, one.range_m, 1.0)?;
        let place = vec::<Tunnel>(&row.h, POSITION);
        // A change of the head's angle rotates the beam about the head's axis and leaves the origin of the beam
        // unchanged.
        let swing = vec::<Tunnel>(&row.h, ATTITUDE) + -(state.attitude * offset).cross(&place);
        let [axis, left, up] =
            [rotation * Vec3::new(1.0, 0.0, 0.0), Vec3::new(0.0, 1.0, 0.0), Vec3::new(0.0, 0.0, 1.0)];
        add(&mut h, own(head, 0), swing.dot(&(state.attitude * axis)));
        add(&mut h, own(head, 1), place.dot(&(state.attitude * left)));
        add(&mut h, own(head, 2), place.dot(&(state.attitude * up)));
        Some((h, row.residual))
    }

    /// Range update as in the navigation filter, with its derivatives with respect to the unknowns common to
    /// all sonars.
    fn common_row<const N: usize>(
        &self,
        x: &[f64; N],
        state: &State,
        beam: &Beam,
        range_m: f64,
        sd_m: f64,
    ) -> Option<([f64; N], ScalarUpdate)> {
        let range_m = range_m / (1.0 + at(x, 5));
        let row = measure::range(state, self.profile, beam, range_m, sd_m)?;
        let mut h = [0.0; N];
        for (i, from) in
            [POSITION + 1, POSITION + 2, ATTITUDE, ATTITUDE + 1, ATTITUDE + 2].into_iter().enumerate()
        {
            add(&mut h, i, at(&row.h, from));
        }
        add(&mut h, 5, range_m - row.residual);
        Some((h, row))
    }

    /// Derivatives, residual and variance of each echosounder. The variance includes the mount's error.
    fn echo_rows<const N: usize>(&self, x: &[f64; N]) -> Vec<([f64; N], f64, f64)> {
        let state = state(x, self.attitude);
        let row = |echo: &EchoScan| {
            let beam = Beam {
                offset: echo.mount.position,
                along: echo.mount.rotation * Vec3::new(1.0, 0.0, 0.0),
                first_rad: 0.0,
                unsure_rad: self.settings.echo_beam_rad / 2.0,
            };
            let sd_m = math::hypot(self.settings.echo_sd_m, OFFSET_SD_M);
            let (h, row) = self.common_row(x, &state, &beam, echo.range_m, sd_m)?;
            Some((h, row.residual, row.noise))
        };
        self.echoes.iter().filter_map(row).collect()
    }

    fn cost<const N: usize>(&self, x: &[f64; N], prior: &[f64; N], known: &[f64; N]) -> f64 {
        let sd_m = self.settings.return_sd_m;
        let of_return = |residual: &Residual<N>| {
            let cost =
                residual.row.map_or(MISSED_COST, |(_, off_m)| (off_m * off_m / sd_m / sd_m).min(MOST_COST));
            residual.share * cost
        };
        let returns: f64 = self.residuals(x).iter().map(of_return).sum();
        let of_echo =
            |(_, off_m, variance): ([f64; N], f64, f64)| (off_m * off_m / variance).min(MOST_ECHO_COST);
        let echoes: f64 = self.echo_rows(x).into_iter().map(of_echo).sum();
        let square = |i: usize| (at(x, i) - at(prior, i)) / at(known, i);
        let beforehand: f64 = (2..N).map(|i| square(i) * square(i)).sum();
        returns + echoes + beforehand
    }
}

/// State of the vehicle for these unknowns. The inertial unit is assumed to be at the body's origin.
fn state<const N: usize>(x: &[f64; N], attitude: Rot<Tunnel, Body>) -> State {
    let turn = rotation(Vec3::<Tunnel>::new(at(x, 2), at(x, 3), at(x, 4)));
    State::at_rest(Point3::new(0.0, at(x, 0), at(x, 1)), turn * attitude)
}

/// Robust standard deviation of residuals, from the median of their magnitudes.
fn scale<const N: usize>(residuals: &[Residual<N>]) -> f64 {
    let mut sizes: Vec<f64> =
        residuals.iter().filter_map(|residual| residual.row.map(|(_, off_m)| off_m.abs())).collect();
    // Half of all normally distributed numbers lie within 0.6745 standard deviations.
    (median(&mut sizes).unwrap_or(0.0) / 0.6745).max(LEAST_SCALE_M)
}

fn weight(off: f64, is_near: bool) -> f64 {
    let size = off.abs();
    if is_near {
        let inside = 1.0 - (size / TUKEY) * (size / TUKEY);
        if size < TUKEY { inside * inside } else { 0.0 }
    } else if size > HUBER {
        HUBER / size
    } else {
        1.0
    }
}

/// Whether a residual of this size, m, is an outlier if the robust standard deviation is `scale_m`.
pub(crate) fn is_outlier(off_m: f64, scale_m: f64) -> bool {
    off_m.abs() > TUKEY * scale_m
}
