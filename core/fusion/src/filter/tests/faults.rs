//! Sensor faults: frozen, saturated, jumping, silent and disturbed sensors, and readings that are not finite.

use super::rig::{
    DEPTH, ECHOES, Event, HEADS, IMU, OTHER, Rig, TETHER, VELOCITY_LOG, Way, at, cruise, rest, seconds,
};
use crate::filter::state::CREEP;
use crate::{Navigation as _, NoFix};
use headrace_geometry::frames::{Point3, Pose, Rot, Vec3};
use headrace_geometry::math;
use headrace_sensor::reading::{CountRestart, EchoRange, Reading, SonarReturn, TetherLength, WaterPressure};

const ALL: [usize; 9] = [0, 1, 2, 3, 4, 5, 6, 7, 8];
const NOT_UNIT: [usize; 8] = [1, 2, 3, 4, 5, 6, 7, 8];
const RANGES: [usize; 6] = [3, 4, 5, 6, 7, 8];
/// Time at which each simulated sensor fault begins.
const FAULT_S: f64 = 20.0;

/// Replaces the readings of these sources by those that `with` returns, for `for_s` seconds from the start of the
/// fault.
fn say_otherwise(
    events: &mut [Event],
    sources: &[usize],
    for_s: f64,
    with: impl Fn(&Reading, f64) -> Reading,
) {
    for event in events.iter_mut().filter(|event| sources.contains(&event.source)) {
        let t = seconds(event.valid);
        if (FAULT_S..FAULT_S + for_s).contains(&t) {
            event.reading = with(&event.reading, t);
        }
    }
}

/// Makes a sensor repeat the last reading from before the fault, for `for_s` seconds.
fn freeze(events: &mut [Event], source: usize, for_s: f64) {
    let before = events.to_vec();
    let last = |like: &Reading| {
        let like = core::mem::discriminant(like);
        let mut heard = before.iter().rev().filter(|e| e.source == source && seconds(e.valid) < FAULT_S);
        heard.find(|e| core::mem::discriminant(&e.reading) == like).unwrap().reading
    };
    say_otherwise(events, &[source], for_s, |reading, _| last(reading));
}

/// Checks the filter before the fault begins, and again from `wrong_until_s` on. In between, the fault looks like real
/// motion, so the filter is not checked.
fn recovers(rig: &Rig, events: &[Event], wrong_until_s: f64) {
    let mut nav = rig.navigation();
    let parts = [0.0, FAULT_S, wrong_until_s, f64::INFINITY];
    for (part, bounds) in parts.windows(2).enumerate() {
        let within = |event: &&Event| (bounds[0]..bounds[1]).contains(&seconds(event.valid));
        let heard: Vec<Event> = events.iter().filter(within).copied().collect();
        if part == 1 {
            for event in &heard {
                Rig::hear(&mut nav, event);
            }
            assert!(nav.running().unwrap().is_sound());
        } else {
            rig.run(&mut nav, &heard);
        }
    }
    let last = events.last().unwrap().received;
    assert!(nav.fix(last).is_ok(), "{:?}", nav.fix(last));
}

#[test]
fn fix_is_withheld_during_long_sensor_silence_and_returns_afterwards() {
    /// A test of silent sensors: name, trajectory, silent sources, duration of the silence in s, and whether the fix is
    /// missing at its end.
    type Silence = (&'static str, Way, &'static [usize], f64, bool);
    let near_wall: Way = |t| Pose {
        position: Point3::new(3.0 + 0.1 * t, 5.2, 3.0),
        attitude: Rot::from_roll_pitch_yaw(0.0, 0.0, 0.1 * math::sin(t / 6.0)),
    };
    let silences: [Silence; 7] = [
        ("the unit", cruise, &[IMU], 30.0, false),
        ("all", cruise, &ALL, 30.0, true),
        ("all, for an hour", rest, &ALL, 3600.0, true),
        ("all but the unit", rest, &NOT_UNIT, 600.0, true),
        ("all that range, near the wall", near_wall, &RANGES, 100.0, true),
        ("the tether", cruise, &[TETHER], 100.0, true),
        ("the depth", cruise, &[DEPTH], 100.0, false),
    ];
    for (name, way, sources, for_s, is_lost) in silences {
        let rig = Rig::new(way, 1);
        let mut nav = rig.navigation();
        rig.run(&mut nav, &rig.events(0.0, FAULT_S));
        if sources.len() < ALL.len() {
            let mut events = rig.events(FAULT_S, FAULT_S + for_s);
            events.retain(|event| !sources.contains(&event.source));
            rig.run(&mut nav, &events);
        }
        let end_s = FAULT_S + for_s;
        assert_eq!(nav.fix(at(end_s)).is_err(), is_lost, "{name}: {:?}", nav.fix(at(end_s)));
        let tally = rig.run(&mut nav, &rig.events(end_s, end_s + 40.0));
        assert!(nav.fix(at(end_s + 40.0)).is_ok(), "{name}: {tally:?}");
        assert!(nav.restarts() <= 1, "{name}");
    }
}

#[test]
fn uncertainty_grows_while_all_sensors_are_silent() {
    let rig = Rig::new(rest, 1);
    let mut nav = rig.navigation();
    rig.run(&mut nav, &rig.events(0.0, FAULT_S));
    // For a second after the fault begins, the reordering window still contains readings from before it.
    let last = at(FAULT_S + 1.0);
    Rig::hear(&mut nav, &Event { received: last, valid: last, source: OTHER, reading: rig.rate(0.0) });
    let mut before = nav.running().unwrap().factors;
    for k in 1..24 {
        let t = at(FAULT_S + 1.0 + 0.5 * f64::from(k));
        let heartbeat = Event { received: t, valid: t, source: OTHER, reading: rig.rate(0.0) };
        Rig::hear(&mut nav, &heartbeat);
        let running = nav.running().unwrap();
        // The errors of position, velocity and attitude grow. The creep of the cable does not grow.
        for i in (0..10).filter(|i| *i != CREEP) {
            let (now, then) = (running.factors.variance(i), before.variance(i));
            assert!(now > then, "error {i} in period {k}: {now}, {then} before");
        }
        before = running.factors;
    }
    assert!(matches!(nav.fix(at(FAULT_S + 15.5)), Err(NoFix::Chainage | NoFix::Section | NoFix::Heading)));
    // The filter's position estimate does not drift away during the fault.
    assert!((nav.running().unwrap().state.position - rig.unit(0.0)).norm() < 1.0);
}

#[test]
fn readings_that_are_not_finite_are_dropped_and_counted() {
    let rig = Rig::new(cruise, 1);
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        for source in ALL {
            let mut events = rig.events(0.0, 40.0);
            say_otherwise(&mut events, &[source], 5.0, |reading, _| spoilt(reading, bad));
            let spoilt = events.iter().filter(|event| !event.reading.is_finite()).count();
            let mut nav = rig.navigation();
            rig.run(&mut nav, &events);
            assert!(spoilt > 0);
            assert_eq!(nav.consistency(source).unwrap().dropped, spoilt as u64, "source {source}");
        }
    }
}

fn spoilt(reading: &Reading, bad: f64) -> Reading {
    match reading {
        Reading::Sonar(sonar) => Reading::Sonar(SonarReturn { angle_rad: bad, ..*sonar }),
        Reading::Echo(echo) => Reading::Echo(EchoRange { range_m: Some(bad), ..*echo }),
        Reading::Pressure(water) => Reading::Pressure(WaterPressure { pressure_pa: bad, ..*water }),
        Reading::Attitude(_) => Reading::Attitude(Rot::from_roll_pitch_yaw(bad, 0.0, 0.0)),
        Reading::AngularRate(_) => Reading::AngularRate(Vec3::new(0.0, bad, 0.0)),
        Reading::SpecificForce(_) => Reading::SpecificForce(Vec3::new(bad, 0.0, 9.8)),
        Reading::VelocityOverGround(_) => Reading::VelocityOverGround(Vec3::new(0.0, 0.0, bad)),
        Reading::TetherLength(length) => Reading::TetherLength(TetherLength { length_m: bad, ..*length }),
    }
}

#[test]
fn saturated_inertial_samples_are_rejected() {
    let rig = Rig::new(cruise, 1);
    for (magnitude, for_s) in [(156.9, 0.02), (156.9, 1.0), (1e300, 0.02), (f64::MAX, 5.0)] {
        for is_rate in [true, false] {
            let mut events = rig.events(0.0, 60.0);
            say_otherwise(&mut events, &[IMU], for_s, |reading, _| match reading {
                Reading::AngularRate(_) if is_rate => Reading::AngularRate(Vec3::new(0.0, 0.0, magnitude)),
                Reading::SpecificForce(_) if !is_rate => {
                    Reading::SpecificForce(Vec3::new(-magnitude, magnitude, magnitude))
                }
                other => *other,
            });
            let mut nav = rig.navigation();
            let tally = rig.run(&mut nav, &events);
            assert!(nav.consistency(IMU).unwrap().dropped > 0);
            // The speed change by a rejected force is unknown, so the speed becomes uncertain. There is no fix until
            // the speed is certain again.
            let without_fix = if is_rate { 0 } else { math::round_to_i64(10.0 * for_s) + 5 };
            assert!(i64::from(tally.without_fix) <= without_fix, "{magnitude} for {for_s} s: {tally:?}");
        }
    }
}

#[test]
fn fix_stays_right_with_a_disturbed_compass() {
    for off_deg in [5.0_f64, 10.0, 20.0, 60.0, 180.0] {
        for sudden in [true, false] {
            let rig = Rig::new(cruise, 1);
            let mut events = rig.events(0.0, 110.0);
            say_otherwise(&mut events, &[IMU], 60.0, |reading, t| {
                let share = if sudden { 1.0 } else { math::sin((t - FAULT_S) / 60.0 * math::PI) };
                match reading {
                    Reading::Attitude(_) => Reading::Attitude(rig.level(t, off_deg.to_radians() * share)),
                    other => *other,
                }
            });
            let mut nav = rig.navigation();
            let tally = rig.run(&mut nav, &events);
            assert_eq!(tally.without_fix, 0, "{off_deg} degrees: {tally:?}");
            assert!(off_deg < 20.0 || !sudden || nav.consistency(IMU).unwrap().gated > 300);
        }
    }
}

#[test]
fn jumping_sensor_is_rejected() {
    type Jump = fn(&Reading) -> Reading;
    let jumps: [(usize, Jump); 5] = [
        (TETHER, |reading| match reading {
            Reading::TetherLength(length) => {
                Reading::TetherLength(TetherLength { length_m: length.length_m + 5.0, ..*length })
            }
            other => *other,
        }),
        (DEPTH, |reading| match reading {
            Reading::Pressure(water) => {
                Reading::Pressure(WaterPressure { pressure_pa: water.pressure_pa + 2e4, ..*water })
            }
            other => *other,
        }),
        (ECHOES, |reading| ranged(reading, 0.5)),
        (HEADS, |reading| ranged(reading, 3.0)),
        (VELOCITY_LOG, |reading| match reading {
            Reading::VelocityOverGround(_) => Reading::VelocityOverGround(Vec3::new(2.0, -1.0, 0.5)),
            other => *other,
        }),
    ];
    for (source, jump) in jumps {
        let rig = Rig::new(cruise, 1);
        let mut events = rig.events(0.0, 60.0);
        events.extend((0..600).map(|k| {
            let t = 0.013 + 0.1 * f64::from(k);
            Event { received: at(t), valid: at(t), source: VELOCITY_LOG, reading: rig.velocity(t) }
        }));
        events.sort_by_key(|event| event.valid);
        say_otherwise(&mut events, &[source], 3.0, |reading, _| jump(reading));
        let mut nav = rig.navigation();
        let tally = rig.run(&mut nav, &events);
        let consistency = nav.consistency(source).unwrap();
        // The chainage is unknown while counter and estimate differ by metres, until a second after the jump.
        let without_fix = if source == TETHER { 45 } else { 0 };
        assert!(
            tally.without_fix <= without_fix && consistency.gated >= 6,
            "source {source}: {tally:?} {consistency:?}"
        );
    }
}

#[test]
fn counter_restart_keeps_the_chainage_only_if_the_other_sensors_kept_sending() {
    for (away_s, are_all_away, is_lost) in [(0.0, false, true), (1.0, true, true), (1.0, false, false)] {
        let rig = Rig::new(cruise, 1);
        let mut events = rig.events(0.0, 60.0);
        events.retain(|event| {
            let is_away = (FAULT_S..FAULT_S + away_s).contains(&seconds(event.valid));
            !is_away || !are_all_away && event.source != TETHER
        });
        for event in events.iter_mut().filter(|event| seconds(event.valid) >= FAULT_S) {
            if let Reading::TetherLength(length) = &mut event.reading {
                length.restart = Some(CountRestart { number: 1, was_away: away_s > 0.0 });
            }
        }
        let mut nav = rig.navigation();
        for event in &events {
            Rig::hear(&mut nav, event);
        }
        let fix = nav.fix(events.last().unwrap().received);
        assert_eq!(fix.err(), is_lost.then_some(NoFix::Chainage), "{away_s} s, all {are_all_away}");
    }
}

fn ranged(reading: &Reading, share: f64) -> Reading {
    match reading {
        Reading::Echo(echo) => {
            Reading::Echo(EchoRange { range_m: echo.range_m.map(|range_m| range_m * share), ..*echo })
        }
        Reading::Sonar(sonar) => {
            Reading::Sonar(SonarReturn { range_m: sonar.range_m.map(|range_m| range_m * share), ..*sonar })
        }
        other => *other,
    }
}

#[test]
fn filter_recovers_from_plausible_wrong_inertial_readings_within_60_s() {
    // Either a knock or a faulty unit causes such readings, and the unit alone does not show which. The fix is wrong
    // until the other sensors have corrected it.
    let forces = [(5.0, 0.2), (5.0, 1.0), (1.0, 5.0), (0.2, 20.0)].map(|jump| (jump, false));
    let rates = [(5.0, 0.02), (5.0, 0.2), (1.0, 1.0), (0.1, 5.0), (0.01, 20.0)].map(|jump| (jump, true));
    let jumps = forces.into_iter().chain(rates).flat_map(|jump| (1..=6).map(move |seed| (jump, seed)));
    for (((by, for_s), is_rate), seed) in jumps {
        let rig = Rig::new(cruise, seed);
        let mut events = rig.events(0.0, 120.0);
        say_otherwise(&mut events, &[IMU], for_s, |reading, _| match reading {
            Reading::SpecificForce(force) if !is_rate => {
                Reading::SpecificForce(*force + Vec3::new(by, by, by))
            }
            Reading::AngularRate(rate) if is_rate => Reading::AngularRate(*rate + Vec3::new(by, by, by)),
            other => *other,
        });
        recovers(&rig, &events, FAULT_S + for_s + 60.0);
    }
}

#[test]
fn filter_recovers_from_a_frozen_sensor() {
    // The other sensors show at once that a depth sensor or head is frozen. A frozen echosounder moves the position by
    // centimetres before its range becomes too improbable.
    let frozen = [(DEPTH, 0.0), (HEADS, 0.0), (ECHOES, 35.0), (ECHOES + 2, 35.0), (IMU, 60.0)];
    for (source, wrong_s) in frozen {
        for seed in 1..=6 {
            let rig = Rig::new(cruise, seed);
            let mut events = rig.events(0.0, 110.0);
            freeze(&mut events, source, 30.0);
            recovers(&rig, &events, FAULT_S + wrong_s);
        }
    }
}

/// A head reports the range of its own frame, or of its last echo, while it keeps turning.
///
/// In each turn of the head, this constant range agrees with the wall for a while.
#[test]
fn head_with_constant_range_does_not_rotate_the_estimated_attitude() {
    let (for_s, mut gated) = (40.0, 0);
    for seed in 1..=5 {
        let rig = Rig::new(cruise, seed);
        let mut events = rig.events(0.0, FAULT_S + for_s);
        let from = |event: &Event| event.source == HEADS && seconds(event.valid) >= FAULT_S;
        let last_m = events.iter().find(|event| from(event)).map(|event| event.reading);
        let Some(Reading::Sonar(SonarReturn { range_m, .. })) = last_m else { panic!("{last_m:?}") };
        say_otherwise(&mut events, &[HEADS], for_s, |reading, _| match reading {
            Reading::Sonar(sonar) => Reading::Sonar(SonarReturn { range_m, ..*sonar }),
            other => *other,
        });
        let mut nav = rig.navigation();
        rig.run(&mut nav, &events);
        gated += nav.consistency(HEADS).unwrap().gated;
    }
    assert!(gated > 500, "{gated}");
}

/// Errors of the estimate stay within `MOST_SDS` standard deviations, and the counter is doubted within two seconds.
#[test]
fn stuck_or_slipping_counter_is_doubted_and_not_followed() {
    for seed in 1..4 {
        for for_s in [2.0, 5.0, 10.0, 15.0] {
            for comes_back in [false, true] {
                let rig = Rig::new(cruise, seed);
                let mut events = rig.events(0.0, 80.0);
                let stood_m = {
                    let before =
                        events.iter().rev().find(|e| e.source == TETHER && seconds(e.valid) < FAULT_S);
                    length_m(&before.unwrap().reading)
                };
                let mut lost_m = 0.0;
                for event in events.iter_mut().filter(|event| event.source == TETHER) {
                    let Reading::TetherLength(length) = &mut event.reading else { continue };
                    let t = seconds(event.valid);
                    if (FAULT_S..FAULT_S + for_s).contains(&t) {
                        lost_m = length.length_m - stood_m;
                        length.length_m = stood_m;
                    } else if t >= FAULT_S && !comes_back {
                        length.length_m -= lost_m;
                    }
                }
                let mut nav = rig.navigation();
                let split = events.partition_point(|event| seconds(event.received) < FAULT_S + 1.9);
                let (first, rest) = events.split_at(split);
                rig.run(&mut nav, first);
                assert!(nav.cable_doubted_since().is_some(), "no doubt after 1.9 s of {for_s} s");
                rig.run(&mut nav, rest);
                assert!(
                    nav.cable_doubted_since().is_none(),
                    "doubt long after {for_s} s, back: {comes_back}"
                );
                assert!(nav.fix(events.last().unwrap().received).is_ok());
            }
        }
    }
}

fn length_m(reading: &Reading) -> f64 {
    let Reading::TetherLength(length) = reading else { panic!("{reading:?}") };
    length.length_m
}

/// The counter sticks permanently while the vehicle moves on. Later, the filter reports that the chainage is unknown.
///
/// In steady motion, gyros and accelerometers show the same readings as at rest. Even so, the filter does not take the
/// steady motion for rest.
#[test]
fn permanently_stuck_counter_leads_to_no_fix() {
    let steady: Way = |t| Pose { position: Point3::new(3.0 + 0.2 * t, 0.4, 4.0), attitude: Rot::identity() };
    for way in [cruise, steady] {
        let rig = Rig::new(way, 1);
        let mut events = rig.events(0.0, 200.0);
        freeze(&mut events, TETHER, 1e3);
        let mut nav = rig.navigation();
        rig.run(&mut nav, &events);
        assert_eq!(nav.fix(events.last().unwrap().received).unwrap_err(), NoFix::Chainage);
    }
}

/// The vehicle reverses within one sample of the inertial unit, so the measured force is implausible but real.
#[test]
fn fix_returns_after_a_jolt_beyond_the_plausible_force() {
    let jolted: Way = |t| Pose {
        position: Point3::new(if t < FAULT_S { 3.0 + 0.5 * t } else { 13.0 - 0.5 * (t - FAULT_S) }, 0.4, 4.0),
        attitude: Rot::identity(),
    };
    let rig = Rig { imu_s: 0.01, ..Rig::new(jolted, 1) };
    let events = rig.events(0.0, 40.0);
    assert!(events.iter().any(|e| matches!(e.reading, Reading::SpecificForce(force) if force.norm() > 50.0)));
    let mut nav = rig.navigation();
    rig.run(&mut nav, &events);
    assert!(nav.fix(at(39.9)).is_ok());
}
