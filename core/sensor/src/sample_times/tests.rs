use super::*;
use headrace_geometry::frames::Vec3;

const PERIOD: DurNs = DurNs(2_500_000);
const TICK: DurNs = DurNs(100_000);
/// Number of samples after which a device is known to send each sample's stamp before its readings.
const FIRST: i64 = 30;

fn force() -> Reading {
    Reading::SpecificForce(Vec3::zero())
}

fn rate() -> Reading {
    Reading::AngularRate(Vec3::zero())
}

/// Returns the true and the corrected times of samples that are taken every 2.5 ms and arrive with these delays.
fn times(delays_ns: &[i64], ticks_of: impl Fn(i64) -> i64) -> Vec<(MonoNs, MonoNs)> {
    let mut times = SampleTimes::new(32, TICK);
    let of = |(k, delay_ns): (i64, &i64)| {
        let made = MonoNs(7_000_000_000) + DurNs(k * PERIOD.0);
        let received = made + DurNs(*delay_ns);
        times.stamp(u64::try_from(ticks_of(k)).unwrap(), received);
        let at = times.arrival(&force(), received);
        (made, if k < FIRST { made } else { at })
    };
    (0..).zip(delays_ns).map(of).collect()
}

fn in_step(k: i64) -> i64 {
    k * PERIOD.0 / TICK.0
}

#[test]
fn punctual_samples_keep_their_receive_times() {
    let delays: Vec<i64> = (0..4000).map(|k| 300_000 + k * 37 % 700_000).collect();
    for (k, (made, at)) in times(&delays, in_step).iter().enumerate().skip(30) {
        assert_eq!(at.since(*made).0, delays[k], "sample {k}");
    }
}

/// Returns the largest time error after the first 4000 samples, ns.
fn worst_ns(times: &[(MonoNs, MonoNs)]) -> i64 {
    times.iter().skip(4000).map(|(made, at)| at.since(*made).0.abs()).max().unwrap()
}

#[test]
fn samples_of_a_burst_are_separated() {
    // The first of every forty samples arrives 25 ms late, together with the nine samples after it.
    let burst = |k: i64| if k % 40 < 10 { (10 - k % 40) * PERIOD.0 } else { 0 };
    let delays: Vec<i64> = (20..20_020).map(burst).collect();
    let off = worst_ns(&times(&delays, in_step));
    assert!(off <= 300_000, "{off} ns");
    let received: Vec<i64> = (0..).zip(&delays).map(|(k, delay)| k * PERIOD.0 + delay).collect();
    assert!(
        received.windows(2).filter(|pair| pair[0] == pair[1]).count() > 2500,
        "the samples must arrive in bursts"
    );
}

#[test]
fn drifting_device_clock_is_followed() {
    for ppm in [-500, -20, 200, 500] {
        // One sample in ten is 5 ms late.
        let delays: Vec<i64> = (0..40_000).map(|k| if k % 10 == 3 { 5_000_000 } else { 0 }).collect();
        let off = worst_ns(&times(&delays, |k| (k * PERIOD.0 - k * PERIOD.0 / 1_000_000 * ppm) / TICK.0));
        assert!(off <= 1_000_000, "{ppm} parts in a million: {off} ns");
    }
}

#[test]
fn garbled_stamp_affects_only_its_own_sample() {
    // One device stamp in fifty has a flipped bit.
    let garbled = |k: i64| if k % 50 == 7 { in_step(k) ^ 1 << (k / 50 % 32) } else { in_step(k) };
    let all = times(&vec![0; 20_000], garbled);
    let others: Vec<(MonoNs, MonoNs)> =
        (0..).zip(all).filter(|(k, _)| k % 50 != 7).map(|(_, times)| times).collect();
    assert_eq!(worst_ns(&others), 0);
}

#[test]
fn clock_stop_changes_at_most_60_sample_times() {
    let none = vec![0; 4000];
    let stuck = times(&none, |k| in_step(k.min(1000)));
    let put_back = stuck.iter().filter(|(made, at)| made != at).count();
    assert!(put_back <= 60, "{put_back} of 3000 samples are corrected; 60 (150 ms) are allowed");
    let again = times(&none, |k| in_step(if k < 2000 { k + 80_000 } else { k - 2000 }));
    assert!(again.iter().all(|(made, at)| made == at));
}

/// Returns the corrected times of samples taken every 10 ms. The stamp of a sample arrives before or after its turn
/// rate and force.
fn stamped(times: &mut SampleTimes, count: u64, is_first: bool) -> Vec<MonoNs> {
    let mut got = Vec::new();
    for k in 0..count {
        let at = MonoNs(1_000_000_000 + k * 10_000_000);
        if is_first {
            times.stamp(k * 100, at);
        }
        got.extend([rate(), force()].map(|reading| times.arrival(&reading, at)));
        if !is_first {
            times.stamp(k * 100, at);
        }
    }
    got
}

#[test]
fn stamp_belongs_to_the_first_reading_of_each_kind_after_it() {
    let mut times = SampleTimes::new(32, TICK);
    stamped(&mut times, 20, true);
    let at = |ms: u64| MonoNs(1_000_000_000 + ms * 1_000_000);
    times.stamp(2100, at(230));
    for reading in [rate(), force()] {
        assert!(times.arrival(&reading, at(231)).since(at(210)).0.abs() < TICK.0);
    }
    assert_eq!(
        times.arrival(&force(), at(240)),
        at(240),
        "a later sample without a stamp keeps its receive time"
    );
    let mut unstamped = SampleTimes::new(32, TICK);
    assert_eq!(unstamped.arrival(&force(), at(0)), at(0));
}

#[test]
fn timestamps_sent_after_readings_leave_sample_times_unchanged() {
    let mut times = SampleTimes::new(32, TICK);
    let got = stamped(&mut times, 200, false);
    let right = (0..200).flat_map(|k| [MonoNs(1_000_000_000 + k * 10_000_000); 2]);
    assert!(got.into_iter().eq(right));
}
