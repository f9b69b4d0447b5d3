//! Tests of the filter at extremes of dive duration, reading order, attitude and noise scale.
//!
//! A test ends either with a fix, whose error is within the limit, or with the name of the missing part of the fix.

use super::super::factors::Factors;
use super::super::inertial::{InertialSample, Leg};
use super::super::settings::Settings;
use super::super::state::{ERRORS, State, rotation_vector};
use super::rig::{
    DEPTH, ECHOES, Event, HEADS, IMU, OTHER, Rig, TETHER, Tally, VELOCITY_LOG, Way, at, cruise, rest, seconds,
};
use crate::Navigation as _;
use headrace_geometry::frames::{Point3, Pose, Rot, Vec3};
use headrace_geometry::math::{self, FRAC_PI_2};
use headrace_geometry::time::DurNs;
use headrace_sensor::reading::Reading;
use headrace_support::hard_cases::{found, found_at};

const HOUR: DurNs = DurNs(3_600_000_000_000);

/// Returns estimate and covariance a second after the last reading, when the reordering window is empty.
fn outcome(rig: &Rig, events: &[Event]) -> (State, Factors<ERRORS>) {
    let mut nav = rig.navigation();
    let last = events.iter().map(|event| event.valid).max().unwrap();
    let end = last + DurNs::from_millis(1000);
    let heartbeat = Event { received: end, valid: end, source: OTHER, reading: rig.rate(0.0) };
    for event in events.iter().chain([&heartbeat]) {
        Rig::hear(&mut nav, event);
    }
    let running = nav.running().unwrap();
    (running.state, running.factors)
}

#[test]
fn one_minute_of_ordinary_motion_has_consistent_innovations() {
    for seed in 1..5 {
        let rig = Rig::new(cruise, seed);
        let mut nav = rig.navigation();
        let mut events = rig.events(0.0, 60.0);
        let logged = (0..240).map(|k| {
            let t = 0.019 + 0.25 * f64::from(k);
            Event { received: at(t), valid: at(t), source: VELOCITY_LOG, reading: rig.velocity(t) }
        });
        events.extend(logged);
        events.sort_by_key(|event| event.valid);
        let tally = rig.run(&mut nav, &events);
        assert_eq!(tally.without_fix, 0, "seed {seed}");
        for source in [TETHER, DEPTH, ECHOES, ECHOES + 3, HEADS, HEADS + 1, VELOCITY_LOG] {
            let consistency = nav.consistency(source).unwrap();
            let nis = consistency.nis().unwrap();
            assert!((0.75..1.25).contains(&nis), "seed {seed}, source {source}: {consistency:?}");
            assert!(consistency.late + consistency.dropped == 0, "source {source}: {consistency:?}");
        }
    }
}

#[test]
fn position_is_regained_after_10_h_of_dead_reckoning() {
    let rig = Rig { imu_s: 0.1, ..Rig::new(cruise, 1) };
    let mut nav = rig.navigation();
    rig.run(&mut nav, &rig.events(0.0, 20.0));
    let (begin_s, end_s) = (20, 36_020);
    let mut tally = Tally::default();
    for from_s in (begin_s..end_s).step_by(100) {
        let mut events = rig.events(f64::from(from_s), f64::from(from_s + 100));
        events.retain(|event| event.source == IMU && !matches!(event.reading, Reading::Attitude(_)));
        for event in &events {
            Rig::hear(&mut nav, event);
        }
        rig.check(&nav, events.last().unwrap().received, &mut tally);
    }
    assert!(
        nav.running().is_none() && nav.fix(at(f64::from(end_s))).is_err(),
        "there must be no fix without measurements"
    );
    assert_eq!(nav.consistency(IMU).unwrap().dropped, 0, "unused samples must not fill the window");
    rig.run(&mut nav, &rig.events(f64::from(end_s), f64::from(end_s + 60)));
    let fix = nav.fix(at(f64::from(end_s + 60)));
    assert!(fix.is_ok(), "{fix:?} {:?}", nav.running().map(super::super::eskf::Eskf::pose_sd));
    assert!(nav.running().unwrap().pose_sd().place_m < 0.05);
    assert_eq!(nav.restarts(), 1);
}

#[test]
fn covariance_stays_valid_with_noise_of_any_scale() {
    let (exact, vague) = (1e-5, 1e5);
    for (tether_sd_m, echo_sd_m, return_sd_m, depth_sd_m) in
        [(exact, exact, vague, vague), (vague, vague, exact, exact), (exact, vague, exact, vague)]
    {
        let mut rig = Rig { noise: 0.0, ..Rig::new(cruise, 1) };
        rig.settings = Settings { tether_sd_m, depth_sd_m, echo_sd_m, return_sd_m, ..rig.settings };
        let mut nav = rig.navigation();
        let tally = rig.run(&mut nav, &rig.events(0.0, 40.0));
        assert!(tally.fixes + tally.without_fix > 300);
    }
}

#[test]
fn propagation_over_any_duration_keeps_the_covariance_valid() {
    let settings = Settings::default();
    let felt = InertialSample {
        rate_radps: Some(Vec3::new(0.1, 0.2, -0.1)),
        force_mps2: Some(Vec3::new(0.1, 0.0, 9.8)),
    };
    for (dt_s, times) in [(0.0, 10), (1e-9, 1000), (0.01, 100), (30.0, 3), (36_000.0, 2)] {
        for felt in [felt, InertialSample { rate_radps: None, force_mps2: None }] {
            let mut state = State::at_rest(Point3::new(1.0, 0.0, 3.0), Rot::identity());
            let mut factors = Factors::independent([1e-4; ERRORS]);
            let mut leg = Leg::default().with_noise([1.0; 2], Settings::default().slack);
            for _ in 0..times {
                state.go_on(&felt, dt_s, 9.8, &mut leg);
                let transition = leg.transition(&settings);
                transition.carry(&mut factors);
                leg.disturb(&settings, &transition, &mut factors);
            }
            assert!(state.is_sound() && factors.is_sound(), "{dt_s} s: {state:?}");
            for i in 0..ERRORS {
                // Without measurements, the variances of pose errors never shrink. The variances of some sensor errors
                // shrink, because these errors decay.
                let least = if i < 9 { 1e-4 * (1.0 - 1e-12) } else { 0.0 };
                assert!(factors.variance(i) > least, "{dt_s} s, error {i}: {}", factors.variance(i));
            }
            if dt_s == 0.0 {
                assert_eq!(state, State::at_rest(Point3::new(1.0, 0.0, 3.0), Rot::identity()));
                assert!((factors.variance(0) - 1e-4).abs() < 1e-18);
            }
        }
    }
}

#[test]
fn repeated_inertial_sample_counts_once() {
    let rig = Rig::new(cruise, 1);
    let events = rig.events(0.0, 20.0);
    let right = outcome(&rig, &events);
    // The second copy of a sample has the same receive time and time of validity as the first. Or both times are a
    // nanosecond later, or only the receive time is later.
    for (later, delay) in [(0, 0), (1, 1), (0, 90_000_000)] {
        let mut again = events.clone();
        let inertial = events.iter().filter(|event| !matches!(event.reading, Reading::Attitude(_)));
        again.extend(inertial.filter(|event| event.source == IMU).map(|event| Event {
            valid: event.valid + DurNs(later),
            received: event.received + DurNs(delay),
            ..*event
        }));
        again.sort_by_key(|event| event.received);
        assert_eq!(outcome(&rig, &again), right, "copies {later} ns later, delayed by {delay} ns");
    }
}

#[test]
fn simultaneous_readings_are_fused() {
    let rig = Rig::new(cruise, 3);
    let mut events = Vec::new();
    for k in 1..=400 {
        let t = 0.1 * f64::from(k);
        let mut say = |source, reading| events.push(Event { received: at(t), valid: at(t), source, reading });
        say(TETHER, rig.tether(t));
        say(DEPTH, rig.pressure(t));
        (ECHOES..ECHOES + 4).for_each(|source| say(source, rig.echo(source, t)));
        (HEADS..HEADS + 2).for_each(|source| say(source, rig.sonar(source, t)));
        say(VELOCITY_LOG, rig.velocity(t));
        say(IMU, rig.attitude(t));
    }
    let felt = rig.events(0.0, 40.0);
    events.extend(
        felt.iter().filter(|event| event.source == IMU && !matches!(event.reading, Reading::Attitude(_))),
    );
    events.sort_by_key(|event| event.valid);
    let mut nav = rig.navigation();
    let tally = rig.run(&mut nav, &events);
    assert!(tally.fixes > 380 && tally.without_fix == 0, "{tally:?}");
}

#[test]
fn readings_give_the_same_result_in_any_arrival_order() {
    let rig = Rig::new(cruise, 2);
    let events = rig.events(0.0, 30.0);
    let right = outcome(&rig, &events);
    // Each source has its own delay within the reordering window, so readings arrive in another order than that of
    // their times of validity.
    for shift in 1..4 {
        let mut mixed = events.clone();
        for event in mixed.iter_mut().filter(|event| seconds(event.valid) > 2.0) {
            let delay_ms = (event.source as i64 * 37 * shift) % 190;
            event.received = event.valid + DurNs::from_millis(delay_ms);
        }
        mixed.sort_by_key(|event| event.received);
        assert_eq!(outcome(&rig, &mixed), right, "shift {shift}");
    }
    // Additional readings of a sensor that navigation does not use have no effect, however many they are.
    let mut beaten = events.clone();
    beaten.extend((1..9000).map(|k| {
        let t = at(f64::from(k) / 300.0);
        Event { received: t, valid: t, source: OTHER, reading: rig.rate(1.0) }
    }));
    beaten.sort_by_key(|event| event.received);
    assert_eq!(outcome(&rig, &beaten), right);
}

#[test]
fn late_readings_are_counted_and_ignored() {
    let rig = Rig::new(cruise, 1);
    let window_ms = rig.settings.window.0 / 1_000_000;
    for (delay_ms, is_late) in [(window_ms - 1, false), (window_ms + 101, true)] {
        let mut events = rig.events(0.0, 30.0);
        for event in events.iter_mut().filter(|e| e.source == ECHOES && seconds(e.valid) > 5.0) {
            event.received = event.valid + DurNs::from_millis(delay_ms);
        }
        events.sort_by_key(|event| event.received);
        let mut nav = rig.navigation();
        let tally = rig.run(&mut nav, &events);
        assert_eq!(tally.without_fix, 0);
        assert_eq!(nav.consistency(ECHOES).unwrap().late, if is_late { 250 } else { 0 });
        let with = outcome(&rig, &events);
        events.retain(|e| e.source != ECHOES || seconds(e.valid) <= 5.0);
        assert_eq!(with == outcome(&rig, &events), is_late, "{delay_ms} ms");
    }
}

#[test]
fn errors_stay_within_limits_at_any_attitude() {
    let ways: [(&str, Way); 6] = [
        ("nose up, over and back", |t| tilting(t, -1.8)),
        ("nose down, over and back", |t| tilting(t, 1.8)),
        ("straight up", |t| still(t, -FRAC_PI_2, 0.0)),
        ("straight down", |t| still(t, FRAC_PI_2, 0.4)),
        ("round and round", |t| still(t, 0.01, 0.3 * t)),
        ("about the yaw of 180 degrees", |t| still(t, 0.0, math::PI + 0.2 * math::sin(t / 4.0))),
    ];
    for (name, way) in ways {
        for seed in 2..4 {
            let rig = Rig::new(way, seed);
            let mut nav = rig.navigation();
            let tally = rig.run(&mut nav, &rig.events(0.0, 70.0));
            // If no echosounder faces up or down, the height is missing at first, so there is no fix.
            assert!(tally.without_fix <= 2, "{name}: {tally:?}");
        }
    }
}

fn tilting(t: f64, most_rad: f64) -> Pose {
    let pitch = most_rad * (1.0 - math::cos(t / 10.0)) / 2.0;
    Pose { attitude: Rot::from_roll_pitch_yaw(0.0, pitch, 0.1), ..still(t, 0.0, 0.0) }
}

fn still(t: f64, pitch: f64, yaw: f64) -> Pose {
    Pose {
        position: Point3::new(3.0 + 0.05 * t, 0.4, 4.0),
        attitude: Rot::from_roll_pitch_yaw(0.02, pitch, yaw),
    }
}

#[test]
fn quaternion_sign_and_length_have_no_effect() {
    let rig = Rig::new(|t| still(t, 0.02, math::PI + 0.2 * math::sin(t / 4.0)), 1);
    let events = rig.events(0.0, 30.0);
    let (right, _) = outcome(&rig, &events);
    let mut worst = 0.0_f64;
    for factor in [-1.0, 1e-5, -1e5] {
        let mut other = events.clone();
        for (k, event) in other.iter_mut().enumerate() {
            if let (0, Reading::Attitude(level)) = (k % 2, event.reading) {
                let [w, x, y, z] = level.wxyz().map(|c| c * factor);
                event.reading = Reading::Attitude(Rot::from_wxyz(w, x, y, z).unwrap());
            }
        }
        let (state, _) = outcome(&rig, &other);
        let off = state.errors_to(&right).iter().fold(0.0, |most: f64, e| most.max(e.abs()));
        worst = worst.max(off);
    }
    found("filter.quaternions", worst, 1e-9);
}

#[test]
fn fix_at_a_past_time_has_the_attitude_of_that_time() {
    let rig = Rig::new(|t| still(t, 0.01, 0.5 * t), 1);
    let mut nav = rig.navigation();
    rig.run(&mut nav, &rig.events(0.0, 30.0));
    for back_s in [0.3, 0.5, 0.9] {
        let (fix, truth) = (nav.fix(at(30.0 - back_s)).unwrap(), (rig.way)(30.0 - back_s));
        let off = rotation_vector(truth.attitude * fix.pose.attitude.inverse());
        assert!(off.norm() < 0.03, "{back_s} s ago: {off:?}");
    }
}

#[test]
fn fix_at_a_past_time_has_the_position_of_that_time() {
    let rig = Rig::new(cruise, 1);
    let mut nav = rig.navigation();
    rig.run(&mut nav, &rig.events(0.0, 30.0));
    let x_m = |back_s: f64| nav.fix(at(30.0 - back_s)).unwrap().pose.position.x();
    for back_s in [0.3, 0.5, 0.9] {
        let gone_m = x_m(0.0) - x_m(back_s);
        assert!((gone_m - 0.2 * back_s).abs() < 0.02, "{gone_m} m in {back_s} s");
    }
}

#[test]
fn fix_survives_stopped_and_jumping_clocks() {
    let rig = Rig::new(rest, 2);
    // The clock repeatedly stands still for a second (`back` is false), or repeatedly runs backwards for a tenth of a
    // second (`back` is true).
    for (stamp, back) in [(1_000_000_000_u64, false), (100_000_000, true)] {
        let mut events = rig.events(0.0, 40.0);
        for event in &mut events {
            let within = event.received.0 % stamp;
            event.received.0 -= if back { 2 * within } else { within };
            event.valid = event.valid.min(event.received);
        }
        let mut nav = rig.navigation();
        let tally = rig.run(&mut nav, &events);
        assert!(tally.fixes > 30, "{tally:?}");
    }
    // The clock jumps ahead by an hour.
    let mut events = rig.events(0.0, 90.0);
    for event in events.iter_mut().filter(|event| seconds(event.valid) > 30.0) {
        (event.valid, event.received) = (event.valid + HOUR, event.received + HOUR);
    }
    let mut nav = rig.navigation();
    let tally = rig.run(&mut nav, &events);
    assert_eq!(nav.restarts(), 1, "{tally:?}");
    assert!(nav.fix(at(90.0) + HOUR).is_ok(), "{:?}", nav.fix(at(90.0) + HOUR));
    // One reading has a receive time an hour ahead, and another has a time of validity an hour ahead.
    let mut events = rig.events(0.0, 60.0);
    let middle = events.len() / 2;
    events[middle].received = events[middle].received + HOUR;
    events[middle + 1000].valid = events[middle + 1000].valid + HOUR;
    let source = events[middle + 1000].source;
    let mut nav = rig.navigation();
    for event in &events {
        Rig::hear(&mut nav, event);
    }
    // The jump ahead by an hour looks like a silence and causes a restart. The jump back to the right time causes
    // another.
    assert_eq!(nav.restarts(), 2);
    assert_eq!(nav.consistency(source).unwrap().dropped, 1);
    assert!(nav.fix(at(60.0)).is_ok());
}

/// Pose of a vehicle that moves as in `cruise`, but begins `KM` kilometres farther into the tunnel.
fn cruise_at<const KM: u32>(t: f64) -> Pose {
    let Pose { position: at, attitude } = cruise(t);
    Pose { position: Point3::new(at.x() + 1e3 * f64::from(KM), at.y(), at.z()), attitude }
}

/// The standard deviation of the error between passes is the same at any chainage.
///
/// The chainage itself becomes less certain with distance, because the cable's scale is uncertain: by 2 km at 1,000 km.
#[test]
fn chainage_sd_between_passes_is_the_same_at_any_chainage() {
    let ways: [(f64, Way); 3] = [(3e3, cruise_at::<3>), (7e3, cruise_at::<7>), (1e6, cruise_at::<1000>)];
    let (mut moved_m, mut sd_off, mut condition) = (0.0_f64, 0.0_f64, 0.0_f64);
    for seed in 1..4 {
        let near = Rig::new(cruise, seed);
        let mut near_nav = near.navigation();
        near.run(&mut near_nav, &near.events(0.0, 60.0));
        for (off_m, way) in ways {
            let rig = Rig::new(way, seed);
            let mut nav = rig.navigation();
            let tally = rig.run(&mut nav, &rig.events(0.0, 60.0));
            assert!(tally.fixes > 500 && tally.without_fix == 0, "{off_m} m: {tally:?}");
            let [here, there] = [&near_nav, &nav].map(|nav| nav.fix(at(60.0)).unwrap());
            let [here_sd_m, there_sd_m] =
                [here, there].map(|fix| fix.relative.sd_m(Vec3::new(0.0, 3.0, 3.0)));
            sd_off = sd_off.max((there_sd_m / here_sd_m - 1.0).abs());
            let expected = here.pose.position + Vec3::new(off_m, 0.0, 0.0);
            moved_m = moved_m.max((there.pose.position - expected).norm());
            let variance = |i: usize| nav.running().unwrap().factors.variance(i);
            let least =
                (0..ERRORS).map(variance).filter(|variance| *variance > 0.0).fold(f64::INFINITY, f64::min);
            condition = condition.max((0..ERRORS).map(variance).fold(0.0, f64::max) / least);
        }
    }
    found_at("filter.far_place", condition, moved_m, 1e-6);
    found_at("filter.far_sd", condition, sd_off, 1e-4);
}

/// Pose of a vehicle that moves to and fro over the same 12 m, one round a minute.
fn rounds(t: f64) -> Pose {
    let phase = math::TAU * t / 60.0;
    Pose {
        position: Point3::new(
            9.0 - 6.0 * math::cos(phase),
            0.4 * math::sin(phase),
            4.0 + 0.3 * math::sin(2.0 * phase),
        ),
        attitude: Rot::from_roll_pitch_yaw(
            0.05 * math::sin(phase),
            0.06 * math::sin(2.0 * phase),
            0.2 * math::sin(phase),
        ),
    }
}

/// The advice to stand still ends once the gyro bias is known, no later than first stated. It does not return.
#[test]
fn stand_still_advice_ends_once_the_bias_is_known() {
    let rig = Rig { noise: 0.0, ..Rig::new(rest, 1) };
    let mut nav = rig.navigation();
    let mut asked = Vec::new();
    for second in 0..60 {
        let from_s = f64::from(second);
        for event in &rig.events(from_s, from_s + 1.0) {
            Rig::hear(&mut nav, event);
        }
        asked.push(nav.stand_s());
    }
    println!("{asked:?}");
    let begun = asked.iter().position(|asked_s| *asked_s > 0).unwrap();
    let first_s = asked[begun];
    assert!((20..=30).contains(&first_s), "{asked:?}");
    assert!(asked[begun..].windows(2).all(|pair| pair[1] <= pair[0]), "{asked:?}");
    assert!(asked[begun + 31..].iter().all(|asked_s| *asked_s == 0), "{asked:?}");
}

/// Returns the largest relative increase of the sd between head passes after the tenth minute. It is sampled once per
/// round.
fn change_over_hours(hours: u32) -> f64 {
    let rig = Rig { imu_s: 0.1, ..Rig::new(rounds, 1) };
    let mut nav = rig.navigation();
    let (mut first_m, mut change, mut tally) = (None, 0.0_f64, Tally::default());
    for minute in 1..=60 * hours {
        let end_s = 60.0 * f64::from(minute);
        for event in &rig.events(end_s - 60.0, end_s) {
            Rig::hear(&mut nav, event);
        }
        rig.check(&nav, at(end_s), &mut tally);
        let sd_m = nav.fix(at(end_s)).unwrap().relative.sd_m(Vec3::new(0.0, 3.0, 3.0));
        if minute >= 10 {
            change = change.max(sd_m / *first_m.get_or_insert(sd_m) - 1.0);
        }
    }
    assert_eq!(nav.restarts(), 0);
    change
}

#[test]
fn position_sd_between_passes_does_not_grow_over_an_hour() {
    found("filter.hour", change_over_hours(1), 0.01);
}

#[test]
#[ignore = "takes a minute"]
fn position_sd_between_passes_does_not_grow_over_10_h() {
    let change = change_over_hours(10);
    assert!(change < 0.01, "{change}");
}
