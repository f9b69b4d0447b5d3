//! Tests with simulated clocks of known drift. Their stamps have non-negative delays.

use proptest::prelude::*;

use super::*;

const S: u64 = 1_000_000_000;

/// Reproducible random numbers in [0, 1).
struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// Draws an exponentially distributed queueing delay.
    fn queue_ns(&mut self, mean_ns: f64) -> f64 {
        -mean_ns * math::ln(1.0 - self.next())
    }
}

/// A simulated device that sends its clock's time every `period_ns`. The clock has a rate error of `ppm`.
struct Device {
    bits: u32,
    tick: i64,
    ppm: f64,
    period_ns: f64,
    queue_ns: f64,
    first_ticks: u64,
}

impl Device {
    fn clock(&self) -> DeviceClock {
        DeviceClock::new(self.bits, DurNs(self.tick))
    }

    /// Returns the stamp that the device makes at host time `true_ns`.
    #[expect(clippy::cast_possible_truncation, reason = "positive and below 2^63")]
    fn ticks(&self, true_ns: f64) -> u64 {
        let elapsed = (true_ns * (1.0 + self.ppm / 1e6) / self.tick as f64) as u64;
        let mask = if self.bits == 64 { u64::MAX } else { (1 << self.bits) - 1 };
        self.first_ticks.wrapping_add(elapsed) & mask
    }

    /// Sends stamps from `from_s` to `to_s`. Returns the device time of the last one, without wraps.
    #[expect(clippy::cast_possible_truncation, reason = "positive and below 2^63")]
    fn send(&self, clock: &mut DeviceClock, random: &mut Random, from_s: f64, to_s: f64) -> DurNs {
        let mut at = from_s * 1e9;
        let mut last = 0;
        let mut device = DurNs::ZERO;
        while at < to_s * 1e9 {
            // A queue preserves the order of the stamps.
            last = last.max(5 * S + (at + 300e3 + random.queue_ns(self.queue_ns)) as u64);
            device = clock.take(self.ticks(at), MonoNs(last));
            at += self.period_ns;
        }
        device
    }
}

fn xsens(ppm: f64) -> Device {
    Device { bits: 32, tick: 100_000, ppm, period_ns: 1e7, queue_ns: 2e6, first_ticks: 77 }
}

fn sbg(ppm: f64) -> Device {
    Device {
        bits: 32,
        tick: 1000,
        ppm,
        period_ns: 2e7,
        queue_ns: 5e6,
        first_ticks: u64::from(u32::MAX) - 30_000_000,
    }
}

#[test]
fn clock_drift_error_agrees_with_its_standard_deviation() {
    let mut within_two = 0;
    let mut squares = 0.0;
    let cases = 160;
    for seed in 0..cases {
        let ppm = -200.0 + 400.0 * Random(seed * 7919 + 1).next();
        let device = if seed % 2 == 0 { xsens(ppm) } else { sbg(ppm) };
        let mut clock = device.clock();
        let seconds = [30.0, 100.0, 400.0, 1500.0][seed as usize / 2 % 4];
        device.send(&mut clock, &mut Random(seed), 0.0, seconds);
        let report = clock.report();
        let drift = report.drift.unwrap();
        assert_eq!((report.restarts, report.jumps), (0, 0), "seed {seed}");
        let error = (drift.ppm - ppm) / drift.sd_ppm;
        assert!(error.abs() < 5.0, "seed {seed}: {drift:?} of {ppm}");
        // The drift's standard deviation must be small: at most 300 ppm divided by the duration in seconds.
        assert!(drift.sd_ppm < 300.0 / seconds, "seed {seed}, {seconds} s: {drift:?}");
        within_two += u32::from(error.abs() < 2.0);
        squares += error * error;
    }
    let spread = math::sqrt(squares / cases as f64);
    println!("within two standard deviations: {within_two} of {cases}; spread {spread:.2}");
    assert!(within_two >= 146, "{within_two} of {cases} within two standard deviations");
}

#[test]
fn device_clock_ticks_over_10_h_are_unwrapped_exactly() {
    // The clock wraps every 71.6 minutes, so it wraps eight times in ten hours.
    let device = Device { period_ns: 1e8, ..sbg(20.0) };
    let mut clock = device.clock();
    let total = device.send(&mut clock, &mut Random(3), 0.0, 36_000.0);
    let last_ns = 35_999.9e9 * (1.0 + 20.0 / 1e6);
    assert_eq!(total.0 / 1000, math::floor_to_i64(last_ns / 1000.0));
    let report = clock.report();
    assert_eq!((report.restarts, report.jumps, report.stamps), (0, 0, 360_000));
    assert_eq!(report.span, total);
    let drift = report.drift.unwrap();
    println!("ten hours: {drift:?}");
    assert!((drift.ppm - 20.0).abs() < 0.01 && drift.sd_ppm < 0.01, "{drift:?}");
    // The estimated earliest receive time includes the minimum delay of 300 us. Queues of 5 ms disturb it by less than
    // 50 us.
    let earliest = clock.earliest(total).unwrap();
    let least = MonoNs(5 * S + 35_999_900_000_000 + 300_000);
    let off = earliest.since(least).0.abs();
    assert!(off < 50_000, "{off} ns");
}

#[test]
fn device_time_continues_after_hours_of_silence() {
    for gap_s in [3600.0, 4294.9, 4295.0, 20_000.0] {
        let device = sbg(-150.0);
        let mut clock = device.clock();
        let mut random = Random(9);
        device.send(&mut clock, &mut random, 0.0, 60.0);
        let end_s = 60.0 + gap_s + 60.0;
        let total = device.send(&mut clock, &mut random, 60.0 + gap_s, end_s);
        let expected_s = (end_s - 0.02) * (1.0 - 150e-6);
        assert!((total.as_secs_f64() - expected_s).abs() < 1e-3, "{gap_s}: {total:?}");
        let report = clock.report();
        assert_eq!((report.restarts, report.jumps), (0, 0), "{gap_s}");
        assert!((report.drift.unwrap().ppm + 150.0).abs() < 5.0 * report.drift.unwrap().sd_ppm);
    }
}

#[test]
fn clock_restart_begins_an_epoch_but_keeps_the_drift() {
    let device = Device { first_ticks: 0, ..xsens(80.0) };
    let mut clock = device.clock();
    let mut random = Random(4);
    device.send(&mut clock, &mut random, 0.0, 900.0);
    let before = clock.report();
    // The device is off for eight seconds. Then its ticks restart from zero, 908 s after the first start.
    let mut last = DurNs::ZERO;
    for i in 0..300_u64 {
        last = clock.take(i * 100, MonoNs((5 + 908) * S + i * S / 100));
    }
    let after = clock.report();
    assert_eq!((after.restarts, after.jumps), (1, 0));
    assert_eq!(last, DurNs(299 * 10_000_000));
    assert_eq!((after.drift, after.span), (before.drift, before.span));
}

#[test]
fn clock_restart_that_looks_like_a_delay_is_recognised() {
    // At 4.9 s, the clock shows 4.9 s. After a restart, it shows 6 s at 13 s. So it is 7 s behind, although its time
    // has never gone back.
    let mut clock = DeviceClock::new(32, DurNs(1000));
    let mut take = |device_ms: u64, ours_ms: u64| clock.take(device_ms * 1000, MonoNs(ours_ms * 1_000_000));
    for i in 0..50 {
        take(i * 100, i * 100);
    }
    for i in 0..900 {
        take(6000 + i * 100, 13_000 + i * 100);
    }
    let report = clock.report();
    assert_eq!((report.restarts, report.jumps), (1, 0));
    assert!(report.drift.unwrap().ppm.abs() < 1e-3, "{report:?}");
}

#[test]
fn clock_jump_ahead_by_1_h_begins_an_epoch() {
    // The second clock wraps every 71.6 minutes. For it, a jump ahead by an hour looks like a jump back by 11.6
    // minutes, so it counts as a restart.
    for (device, epochs) in [(xsens(30.0), (0, 1)), (sbg(30.0), (1, 0))] {
        let mut clock = device.clock();
        let mut random = Random(5);
        device.send(&mut clock, &mut random, 0.0, 300.0);
        let ahead = 3600 * S / device.tick as u64;
        let ahead = Device { first_ticks: device.first_ticks.wrapping_add(ahead), ..device };
        ahead.send(&mut clock, &mut random, 300.0, 700.0);
        let report = clock.report();
        assert_eq!((report.restarts, report.jumps), epochs);
        let drift = report.drift.unwrap();
        assert!((drift.ppm - 30.0).abs() < 5.0 * drift.sd_ppm, "{drift:?}");
        // The clock's second epoch is longer than the first.
        assert!((report.span.as_secs_f64() - 400.0).abs() < 0.1);
    }
}

#[test]
fn burst_of_stamps_after_silence_counts_as_neither_restart_nor_drift() {
    let device = Device { queue_ns: 1e5, ..sbg(12.0) };
    let mut clock = device.clock();
    let mut random = Random(6);
    device.send(&mut clock, &mut random, 0.0, 200.0);
    // The stamps of four seconds all arrive at once, at the end of this time.
    for i in 0..200_u32 {
        let at_s = 200.0 + f64::from(i) * 0.02;
        clock.take(device.ticks(at_s * 1e9), MonoNs(5 * S + 204 * S));
    }
    device.send(&mut clock, &mut random, 204.001, 400.0);
    let report = clock.report();
    assert_eq!((report.restarts, report.jumps), (0, 0));
    let drift = report.drift.unwrap();
    assert!((drift.ppm - 12.0).abs() < 5.0 * drift.sd_ppm && drift.sd_ppm < 2.0, "{drift:?}");
}

#[test]
fn burst_of_stamps_at_start_counts_as_neither_restart_nor_drift() {
    let device = sbg(25.0);
    let mut clock = device.clock();
    for i in 0..150_u32 {
        clock.take(device.ticks(f64::from(i) * 2e7), MonoNs(5 * S + 3 * S));
    }
    device.send(&mut clock, &mut Random(8), 3.0, 120.0);
    let report = clock.report();
    assert_eq!((report.restarts, report.jumps), (0, 0));
    let drift = report.drift.unwrap();
    assert!((drift.ppm - 25.0).abs() < 5.0 * drift.sd_ppm && drift.sd_ppm < 5.0, "{drift:?}");
}

#[test]
fn wrong_clock_tick_length_shows_as_restarts_or_jumps() {
    // If the real ticks are 100 us but 1 us is configured, the clock looks slow. In the reverse case, it looks fast.
    for (real, taken) in [(100_000, 1000), (1000, 100_000)] {
        let device = Device { tick: real, ..xsens(0.0) };
        let mut clock = DeviceClock::new(32, DurNs(taken));
        device.send(&mut clock, &mut Random(8), 0.0, 12_000.0);
        let report = clock.report();
        assert!(report.restarts + report.jumps > 1, "{report:?}");
    }
}

#[test]
fn sample_counter_is_unwrapped() {
    // A sample counter of 16 bits wraps every 655 s at one sample per 10 ms.
    let mut clock = DeviceClock::new(16, DurNs(10_000_000));
    let mut last = DurNs::ZERO;
    for i in 0..200_000_u64 {
        last = clock.take(i, MonoNs(i * 10_000_000));
    }
    assert_eq!(last, DurNs(199_999 * 10_000_000));
    assert_eq!(clock.report().restarts, 0);
}

#[test]
fn few_device_stamps_give_no_drift_estimate() {
    let mut clock = DeviceClock::new(32, DurNs(1000));
    assert_eq!(
        clock.report(),
        ClockReport { stamps: 0, restarts: 0, jumps: 0, span: DurNs::ZERO, drift: None }
    );
    clock.take(5, MonoNs(7));
    assert_eq!((clock.report().stamps, clock.report().drift), (1, None));
    assert_eq!(clock.earliest(DurNs::ZERO), None);
}

proptest! {
    /// For any input there is no panic, and time never decreases within an epoch.
    #[test]
    fn device_time_never_decreases_within_an_epoch(
        bits in 0_u32..80,
        tick in -5_i64..2_000_000_000,
        stamps in proptest::collection::vec((any::<u64>(), any::<u64>()), 0..300),
        small in proptest::collection::vec((0_u64..1000, 0_u64..5_000_000_000), 0..300),
    ) {
        let mut clock = DeviceClock::new(bits, DurNs(tick));
        let mut last = DurNs::ZERO;
        let mut at = 0_u64;
        let walk = small.iter().scan(0_u64, |sum, (ticks, ns)| { *sum += ticks; at += ns; Some((*sum, at)) });
        for (ticks, received) in walk.collect::<Vec<_>>().into_iter().chain(stamps) {
            let epochs = clock.report().restarts + clock.report().jumps;
            let now = clock.take(ticks, MonoNs(received));
            let same = epochs == clock.report().restarts + clock.report().jumps;
            let least = if same { last } else { DurNs::ZERO };
            prop_assert!(now >= least);
            last = now;
            if let Some(drift) = clock.report().drift {
                prop_assert!(drift.ppm.is_finite() && drift.sd_ppm >= 0.0);
            }
        }
    }
}
