//! Property tests of the filter's parts with random inputs.

use proptest::prelude::*;

use super::super::clones::ErrorClones;
use super::super::factors::Factors;
use super::super::inertial::{InertialSample, Leg, Transition};
use super::super::settings::Settings;
use super::super::sources::{Source, Turning};
use super::super::state::{ATTITUDE, ERRORS, Errors, POSITION, State};
use super::super::window::{Waiting, Window};
use super::rig::{ECHOES, Rig, TETHER};
use crate::section::{Echo, settle};
use headrace_geometry::frames::{Body, Point3, Rot, Tunnel, Vec3};
use headrace_geometry::math;
use headrace_geometry::time::{DurNs, MonoNs};
use headrace_geometry::tunnel::shapes;
use headrace_sensor::reading::{Reading, SonarReturn};

const MS: u64 = 1_000_000;

fn reading(number: f64) -> Reading {
    Reading::AngularRate(Vec3::new(number, 0.0, 0.0))
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// Each reading leaves the reordering window exactly once, in order of validity.
    ///
    /// Readings with the same time of validity leave in order of arrival.
    #[test]
    fn readings_leave_the_window_once_in_order_of_valid_time(times in proptest::collection::vec(0_u64..50, 1..200), cut in 0_u64..50) {
        let mut window = Window::default();
        for (k, at) in times.iter().enumerate() {
            let taken = window.take(Waiting { at: MonoNs(*at), source: k, reading: reading(k as f64) });
            prop_assert!(taken);
        }
        let mut right: Vec<(u64, usize)> = times.iter().enumerate().map(|(k, at)| (*at, k)).collect();
        right.sort_unstable();
        let mut left = Vec::new();
        while let Some(waiting) = window.pop(MonoNs(cut)) {
            left.push((waiting.at.0, waiting.source));
        }
        prop_assert!(left.iter().all(|(at, _)| *at <= cut));
        prop_assert_eq!(window.next_heard(MonoNs(0)), right.get(left.len()).map(|(at, _)| MonoNs(*at)));
        while let Some(waiting) = window.pop(MonoNs(50)) {
            left.push((waiting.at.0, waiting.source));
        }
        prop_assert_eq!(left, right);
    }

    /// Inertial data cover all times without a gap.
    ///
    /// An inertial sample is valid for the time before its timestamp, for at most a tenth of a second.
    #[test]
    fn inertial_data_cover_all_times_without_a_gap(
        samples in proptest::collection::vec((1_u64..3000, any::<bool>()), 0..60),
        from in 0_u64..3000,
        length in 1_u64..1000,
        forgotten in 0_u64..3000,
    ) {
        let mut window = Window::default();
        for (at_ms, is_rate) in &samples {
            let (at, value) = (MonoNs(at_ms * MS), Vec3::new(*at_ms as f64, 0.0, 0.0));
            let taken = if *is_rate { window.take_rate(at, value) } else { window.take_force(at, value) };
            prop_assert!(taken);
        }
        let end = MonoNs((from + length) * MS);
        let pieces = |window: &Window| {
            let (mut now, mut pieces) = (MonoNs(from * MS), Vec::new());
            while now < end {
                let (felt, until) = window.felt(now, end);
                assert!(now < until && until <= end);
                pieces.push((now, until, felt));
                now = until;
            }
            pieces
        };
        let whole = pieces(&window);
        for (now, until, felt) in &whole {
            let near = |value: &Vec3<Body>| (value.x() - now.0 as f64 / MS as f64).abs() <= 100.0;
            prop_assert!(felt.rate_radps.iter().chain(&felt.force_mps2).all(near));
            let next = samples.iter().map(|(at, _)| at * MS).filter(|at| *at > now.0).min();
            let is_blind = felt.rate_radps.is_none() && felt.force_mps2.is_none();
            if let Some(next) = next {
                prop_assert!(until.0 <= next, "a piece extends beyond a sample");
                prop_assert!(!is_blind || next > now.0 + 100 * MS, "a sample is ignored");
            }
        }
        // Removal of old inertial samples does not change the data of later times.
        let old = MonoNs(forgotten.min(from) * MS);
        let mut younger = window.clone();
        younger.forget(old);
        prop_assert_eq!(pieces(&younger), whole);
    }

    /// The echoes come from a known position. A fit that starts about half a metre away ends at this position.
    ///
    /// With arbitrary ranges, the fit still ends inside the tunnel.
    #[test]
    fn fit_to_echoes_finds_the_position_of_the_vehicle(
        (y, z) in (-2.5_f64..2.5, 1.5_f64..6.0),
        (off_y, off_z) in (-0.4_f64..0.4, -0.4_f64..0.4),
        (roll, pitch, yaw) in (-0.1_f64..0.1, -0.2_f64..0.2, -0.3_f64..0.3),
        nonsense in proptest::collection::vec(any::<f64>(), 4),
    ) {
        let profile = shapes::ceran().unwrap();
        let attitude = Rot::<Tunnel, Body>::from_roll_pitch_yaw(roll, pitch, yaw);
        let echoes: Vec<Echo> = (ECHOES..ECHOES + 4)
            .map(|source| {
                let mount = Rig::sensor(source).mount;
                let offset = attitude * mount.position;
                let beam = attitude * (mount.rotation * Vec3::new(1.0, 0.0, 0.0));
                let hit = profile.cast([y + offset.y(), z + offset.z()], [beam.y(), beam.z()]).unwrap();
                Echo { mount, range_m: hit.range_m }
            })
            .collect();
        let start = [y + off_y, z + off_z];
        let place = settle(&profile, attitude, start, (start, [2.0; 2]), 0.03, &echoes.iter().copied());
        prop_assert!(math::hypot(place.at_m[0] - y, place.at_m[1] - z) < 0.02, "{place:?} is not {y}, {z}");
        prop_assert!(place.is_height_seen);
        let wrong: Vec<Echo> =
            echoes.iter().zip(nonsense).map(|(echo, range_m)| Echo { range_m, ..*echo }).collect();
        let place = settle(&profile, attitude, start, (start, [2.0; 2]), 0.03, &wrong.iter().copied());
        prop_assert!(profile.contains(place.at_m), "{place:?}");
    }

    /// If a sensor sends too often, its used readings are at least one period apart. Every skipped reading is less than
    /// a period after a used one.
    #[test]
    fn readings_of_a_source_are_used_once_per_period(steps in proptest::collection::vec(0_u64..80, 1..200)) {
        let period = DurNs::from_millis(100);
        let mut source = Source::new(Rig::sensor(TETHER));
        let (mut now, mut used) = (MonoNs(0), Vec::new());
        for step in steps {
            now = MonoNs(now.0 + step * MS);
            if source.is_due(now, period) {
                used.push(now);
            } else {
                prop_assert!(used.last().is_some_and(|last| now.since(*last) < period));
            }
        }
        prop_assert!(used.windows(2).all(|pair| pair[1].since(pair[0]) >= period));
    }

    /// The turn rate of a head is right in both directions and across the wrap of the angle.
    ///
    /// Used pings have a range and are at least one angular step apart.
    #[test]
    fn returns_of_a_head_are_used_once_per_angle_step(step_deg in 0.3_f64..5.0, clockwise in any::<bool>(), start in -10.0_f64..10.0) {
        let step_rad = step_deg.to_radians() * if clockwise { 1.0 } else { -1.0 };
        let wanted_rad = 3.0_f64.to_radians();
        let mut turning = Turning::default();
        let mut used: Vec<f64> = Vec::new();
        let ping = |k: u64, answers: bool| SonarReturn {
            angle_rad: math::wrap(start + step_rad * k as f64, math::TAU),
            range_m: answers.then_some(3.0),
            resolution_m: 0.01,
            max_range_m: 10.0,
            sound_speed_mps: 1500.0,
        };
        for k in 0..400 {
            let sonar = ping(k, k % 7 != 3);
            if turning.ping(MonoNs(k * 20 * MS), &sonar, wanted_rad) {
                prop_assert!(sonar.range_m.is_some());
                used.push(sonar.angle_rad);
            }
        }
        let apart = |pair: &[f64]| math::wrap_signed(pair[1] - pair[0], math::TAU).abs();
        prop_assert!(used.windows(2).all(|pair| apart(pair) >= wanted_rad));
        let turns = turning.turns_per_s(MonoNs(400 * 20 * MS)).unwrap();
        prop_assert!((turns * math::TAU * 0.02 - step_rad.abs()).abs() < 1e-9);
        prop_assert_eq!(turning.turns_per_s(MonoNs(400 * 20 * MS + 4_000 * MS)), None);
    }
}

#[test]
fn inertial_samples_in_one_burst_are_averaged() {
    let mut window = Window::default();
    for (at_ns, x) in [(0, 1.0), (10 * MS, 2.0), (10 * MS, 40.0), (10 * MS + 1000, 3.0)] {
        assert!(window.take_force(MonoNs(at_ns), Vec3::new(x, 0.0, 0.0)));
    }
    assert!(window.take_rate(MonoNs(10 * MS), Vec3::new(0.5, 0.0, 0.0)));
    let (felt, until) = window.felt(MonoNs(1), MonoNs(20 * MS));
    assert_eq!(until, MonoNs(10 * MS));
    assert_eq!(felt.force_mps2.map(|force| force.x()), Some(15.0));
    assert_eq!(felt.rate_radps.map(|rate| rate.x()), Some(0.5));
}

#[test]
fn full_reordering_window_rejects_readings_and_recovers() {
    let mut window = Window::default();
    let taken =
        (0..2000_u64).filter(|k| window.take(Waiting { at: MonoNs(*k), source: 0, reading: reading(0.0) }));
    assert_eq!(taken.count(), 1024);
    let felt = (0..2000_u64).filter(|k| window.take_rate(MonoNs(k * 2 * MS), Vec3::zero()));
    assert_eq!(felt.count(), 1024);
    window.drop_until(MonoNs(500));
    assert!(window.take(Waiting { at: MonoNs(3), source: 0, reading: reading(0.0) }));
    window.forget(MonoNs(1000 * MS));
    assert!(window.take_rate(MonoNs(9000 * MS), Vec3::zero()));
}

type Square = [Errors; ERRORS];

fn product(a: &Square, b: &Square) -> Square {
    core::array::from_fn(|i| core::array::from_fn(|j| (0..ERRORS).map(|k| a[i][k] * b[k][j]).sum()))
}

fn transposed(a: &Square) -> Square {
    core::array::from_fn(|i| core::array::from_fn(|j| a[j][i]))
}

fn unit(i: usize) -> Errors {
    core::array::from_fn(|j| f64::from(u8::from(i == j)))
}

/// Returns the transition F of a leg as a full matrix.
fn whole(transition: &Transition) -> Square {
    transposed(&core::array::from_fn(|j| {
        let mut column = unit(j);
        transition.apply(&mut column);
        column
    }))
}

/// An augmented filter as in textbooks. Errors of clones are appended to the present errors, and are not corrected.
struct Augmented {
    now: Square,
    /// For each clone, the covariance of the errors at its time, and their cross-covariance with the present errors.
    clones: Vec<(Square, Square)>,
}

impl Augmented {
    fn carry(&mut self, f: &Square, q: &Square) {
        let moved = product(&product(f, &self.now), &transposed(f));
        self.now = core::array::from_fn(|i| core::array::from_fn(|j| moved[i][j] + q[i][j]));
        for (_, cross) in &mut self.clones {
            *cross = product(f, cross);
        }
    }

    fn measure(&mut self, h: &Errors, noise: f64) {
        let ph = self.now.map(|row| row.iter().zip(h).map(|(p, h)| p * h).sum::<f64>());
        let s = ph.iter().zip(h).map(|(p, h)| p * h).sum::<f64>() + noise;
        let left: Square = core::array::from_fn(|i| core::array::from_fn(|j| unit(i)[j] - ph[i] / s * h[j]));
        self.now = product(&left, &self.now);
        for (_, cross) in &mut self.clones {
            *cross = product(&left, cross);
        }
    }

    /// Standard deviation of the change in chainage error, at `arm`, since the clone `back` places before the newest
    /// one.
    fn arc_m(&self, back: usize, arm: Vec3<Tunnel>) -> f64 {
        let (then, cross) = &self.clones[self.clones.len() - 1 - back];
        let weights = [(POSITION, 1.0), (ATTITUDE + 1, arm.z()), (ATTITUDE + 2, -arm.y())];
        let mut sum = 0.0;
        for (i, w) in weights {
            for (j, v) in weights {
                sum += w * v * (self.now[i][j] + then[i][j] - cross[i][j] - cross[j][i]);
            }
        }
        math::sqrt(sum)
    }
}

#[test]
fn relative_covariance_from_clones_equals_an_augmented_filter() {
    // The first case has eight propagation legs between clones. The second has enough clones to fill the ring buffer.
    for (legs, leg_s, times) in [(8, 0.25, 12), (1, 2.0, 70)] {
        let settings = Settings::default();
        let rig = Rig::new(super::rig::cruise, 5);
        let mut state = State::at_rest(Point3::new(0.0, 0.0, 3.0), Rot::identity());
        let mut factors = Factors::independent(core::array::from_fn(|i| 0.01 / (1.0 + i as f64)));
        let mut augmented = Augmented {
            now: core::array::from_fn(|i| unit(i).map(|u| u * factors.variance(i))),
            clones: Vec::new(),
        };
        let mut clones = ErrorClones::default();
        let mut at = MonoNs(0);
        for clone in 0..times {
            for leg_number in 0..legs {
                let salt = f64::from(clone * legs + leg_number);
                let felt = InertialSample {
                    rate_radps: Some(rig.noisy_vector(salt, 1, 0.2)),
                    force_mps2: Some(rig.noisy_vector::<Body>(salt, 4, 0.5) + Vec3::new(0.0, 0.0, 9.8)),
                };
                let mut leg = Leg::default();
                for _ in 0..4 {
                    state.go_on(&felt, leg_s / 4.0, 9.8, &mut leg);
                }
                let transition = leg.transition(&settings);
                let mut noise = Factors::independent([0.0; ERRORS]);
                leg.disturb(&settings, &transition, &mut noise);
                let q = core::array::from_fn(|i| core::array::from_fn(|j| noise.covariance(i, j)));
                transition.carry(&mut factors);
                leg.disturb(&settings, &transition, &mut factors);
                clones.carry(&transition);
                augmented.carry(&whole(&transition), &q);
                for number in 0..2 {
                    let h: Errors =
                        core::array::from_fn(|i| rig.noisy(salt, 100 + number * 20 + i as u64, 0.5));
                    let gain = factors.measure(&h, 0.01);
                    clones.measure(&h, &gain);
                    augmented.measure(&h, 0.01);
                }
            }
            at = at + DurNs::from_millis(2000);
            clones.note(at, &factors);
            augmented.clones.push((augmented.now, augmented.now));
            for back in 1..augmented.clones.len().min(60) {
                let relative = clones.relative(DurNs::from_millis(2000 * back as i64)).unwrap();
                for arm in [Vec3::zero(), Vec3::new(0.0, 4.0, 0.0), Vec3::new(0.0, -2.0, 5.0)] {
                    let (is, right) = (relative.sd_m(arm), augmented.arc_m(back, arm));
                    assert!((is / right - 1.0).abs() < 1e-6, "clone {clone}, {back} back: {is}, not {right}");
                }
            }
        }
        assert!(clones.relative(DurNs(0)).unwrap().sd_m(Vec3::zero()) < 1e-12);
    }
}
