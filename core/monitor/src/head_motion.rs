//! Motion of a head, measured from its returns.

use bevy_ecs::prelude::Component;
use serde::{Deserialize, Serialize};

use headrace_geometry::math::{self, TAU};
use headrace_geometry::time::{DurNs, MonoNs};

/// Angles that differ by at most this much count as equal, radians. The finest step of any head, 0.3 degrees,
/// is much larger.
const SAME_ANGLE_RAD: f64 = 1e-6;
/// Minimum angle over which the turn rate is measured, radians. Until the head has turned by this angle, the turn rate
/// is measured over all of the head's motion so far.
const RATE_SPAN_RAD: f64 = TAU / 2.0;
/// A step longer than this multiple of the usual angular step counts as several steps, because pings were skipped.
const LONG_STEP: f64 = 1.5;

/// Multiples of the usual angular step between pings, and of the angle expected at the turn rate. A step that exceeds
/// both multiples shows that the head has restarted at another angle.
///
/// A head that lags behind its programmed angle catches up in steps of at most eight times the usual step.
const ELSEWHERE_STEPS: f64 = 10.0;
const ELSEWHERE_RATES: f64 = 4.0;

/// Relative difference between the angle of a step and the angle expected at the turn rate, above which a head that has
/// changed its step turns at another rate. Pings that arrive up to 5 ms early or late differ less.
const ANOTHER_RATE: f64 = 0.3;

/// Duration of a stall or silence after which the measurement of the turn rate restarts.
const STANDING: DurNs = DurNs(1_000_000_000);

/// Classification of a ping by the head's motion since the previous ping.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Turned {
    /// Whether the head has moved a single angular step since the previous ping.
    pub single_step: bool,
    /// Whether a new sweep begins: the head has reversed, or its motion is unknown.
    pub new_sweep: bool,
    /// Whether the head is stalled, which means at the same angle for longer than any normal ping interval.
    pub standing: bool,
}

/// Measured motion of one head; part of the loop's state.
#[derive(Debug, Clone, Copy, PartialEq, Default, Component, Serialize, Deserialize)]
pub struct MeasuredMotion {
    last: Option<(MonoNs, f64)>,
    /// Signed angle of the head's most recent step, radians.
    last_step_rad: f64,
    /// Unsigned angle turned through since the latest turning point or start, radians.
    since_turning_rad: f64,
    /// Size of the latest complete sweep between two turning points, radians.
    sector_rad: Option<f64>,
    /// Whether the present sweep began at a turning point.
    from_turning_point: bool,
    /// Total unsigned angle turned through, radians. The turn rate is measured between the two points `anchors`.
    turned_rad: f64,
    anchors: [Option<(MonoNs, f64)>; 2],
    step_rad: Option<f64>,
}

impl MeasuredMotion {
    /// Time and angle (radians) of the most recent ping at a new angle.
    pub fn last(&self) -> Option<(MonoNs, f64)> {
        self.last
    }

    /// Angle between pings, radians; `None` until two steps have agreed.
    pub fn step_rad(&self) -> Option<f64> {
        self.step_rad
    }

    /// Signed turn rate, rad/s; `None` until the head has turned four steps.
    pub fn rate_radps(&self) -> Option<f64> {
        let (now, _) = self.last?;
        let (then, turned_then) = self.anchors.iter().flatten().next()?;
        let turned = self.turned_rad - turned_then;
        let span_s = now.since(*then).as_secs_f64();
        let enough = self.step_rad.is_some_and(|step| turned >= 4.0 * step);
        (enough && span_s > 0.0).then(|| turned / span_s * self.last_step_rad.signum())
    }

    /// Size of the sector, radians, once the head has reversed twice; `None` after the head has turned a full
    /// circle.
    pub fn sector_rad(&self) -> Option<f64> {
        self.sector_rad
    }

    /// Updates the motion with a ping at `angle_rad`.
    pub fn ping(&mut self, at: MonoNs, angle_rad: f64) -> Turned {
        let Some((last, before)) = self.last else {
            self.last = Some((at, angle_rad));
            self.anchors = [Some((at, 0.0)), None];
            return Turned { single_step: false, new_sweep: true, standing: false };
        };
        let step = math::wrap_signed(angle_rad - before, TAU);
        let size = step.abs();
        if size < SAME_ANGLE_RAD {
            // The head has not turned, so `last` and the turn rate are unchanged.
            let standing = at.since(last).as_secs_f64() > self.stalled_after_s();
            return Turned { single_step: false, new_sweep: false, standing };
        }
        if self.is_elsewhere(at.since(last), size) {
            // The head's motion between the two angles, and its direction, are unknown.
            self.last = Some((at, angle_rad));
            self.anchors = [Some((at, self.turned_rad)), None];
            (self.last_step_rad, self.since_turning_rad, self.from_turning_point) = (0.0, 0.0, false);
            return Turned { single_step: false, new_sweep: true, standing: false };
        }
        self.last = Some((at, angle_rad));
        if at.since(last).0.abs() > STANDING.0 {
            self.anchors = [Some((at, self.turned_rad + size)), None];
        }
        let reversed = step * self.last_step_rad < 0.0;
        if reversed {
            self.sector_rad = self.from_turning_point.then_some(self.since_turning_rad);
            self.since_turning_rad = 0.0;
            self.from_turning_point = true;
        }
        if (size - self.last_step_rad.abs()).abs() < SAME_ANGLE_RAD {
            if self.has_another_rate(size, at.since(last)) {
                self.anchors = [Some((last, self.turned_rad)), None];
            }
            self.step_rad = Some(size);
        }
        self.last_step_rad = step;
        self.since_turning_rad += size;
        if self.since_turning_rad > TAU + size / 2.0 {
            self.sector_rad = None;
            self.from_turning_point = false;
        }
        self.turned_rad += size;
        self.move_anchors(at);
        let usual = self.step_rad.unwrap_or(size);
        let single_step = !reversed && size < LONG_STEP * usual;
        Turned { single_step, new_sweep: reversed, standing: false }
    }

    /// Whether the head may have restarted at a distant angle.
    ///
    /// A head that resumes after a stall is not elsewhere, because its first step is of normal size.
    fn is_elsewhere(&self, silence: DurNs, size_rad: f64) -> bool {
        let by_far = self.step_rad.zip(self.rate_radps()).is_some_and(|(step_rad, rate_radps)| {
            let turned_rad = (rate_radps * silence.as_secs_f64()).abs();
            size_rad > ELSEWHERE_STEPS * step_rad && size_rad > ELSEWHERE_RATES * turned_rad
        });
        let long = self.step_rad.is_some_and(|step_rad| size_rad > LONG_STEP * step_rad);
        by_far || long && silence.0.abs() > STANDING.0
    }

    /// Time at the same angle after which a head counts as stalled, seconds. It is four ping periods.
    fn stalled_after_s(&self) -> f64 {
        let ping_period_s = self.step_rad.zip(self.rate_radps()).map(|(step, rate)| step / rate.abs());
        ping_period_s.map_or(STANDING.as_secs_f64(), |period_s| 4.0 * period_s)
    }

    /// Whether a repeated step of another size shows that the head turns at another rate than before, such as after its
    /// way back to its program.
    ///
    /// Steps over missing pings are longer, too, but take longer.
    fn has_another_rate(&self, size_rad: f64, after: DurNs) -> bool {
        let is_other_step =
            self.step_rad.is_some_and(|step_rad| (size_rad - step_rad).abs() > SAME_ANGLE_RAD);
        let turned_rad = self.rate_radps().map(|rate_radps| (rate_radps * after.as_secs_f64()).abs());
        let is_other_rate = |turned_rad: f64| (size_rad - turned_rad).abs() > ANOTHER_RATE * size_rad;
        is_other_step && turned_rad.is_some_and(is_other_rate)
    }

    /// Keeps the two anchors of the rate measurement half a turn apart. The older anchor thus lies between
    /// half a turn and a whole turn back.
    fn move_anchors(&mut self, at: MonoNs) {
        match self.anchors {
            [Some((_, older)), None] if self.turned_rad - older >= RATE_SPAN_RAD => {
                self.anchors[1] = Some((at, self.turned_rad));
            }
            [Some(_), Some((when, newer))] if self.turned_rad - newer >= RATE_SPAN_RAD => {
                self.anchors = [Some((when, newer)), Some((at, self.turned_rad))];
            }
            _ => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn run(angles_deg: impl Iterator<Item = f64>) -> (MeasuredMotion, Vec<Turned>) {
        let mut track = MeasuredMotion::default();
        let turned = (0..)
            .zip(angles_deg)
            .map(|(k, angle)| track.ping(MonoNs(k * 20_000_000), angle.to_radians()))
            .collect();
        (track, turned)
    }

    #[test]
    fn turning_head_has_rate_and_step_but_no_sector() {
        let (track, turned) = run((0..1000).map(|k| f64::from(k) * 0.9 - 170.0));
        assert!((track.rate_radps().unwrap() - f64::to_radians(45.0)).abs() < 1e-9);
        assert!((track.step_rad().unwrap() - f64::to_radians(0.9)).abs() < 1e-9);
        assert_eq!(track.sector_rad(), None);
        assert!(turned.iter().skip(1).all(|t| t.single_step && !t.new_sweep));
    }

    #[test]
    fn head_that_sweeps_a_sector_reverses_at_the_sector_ends() {
        let (track, turned) = run((0..500).map(|k| {
            let phase = f64::from(k % 200);
            if phase <= 100.0 { phase * 0.9 } else { (200.0 - phase) * 0.9 }
        }));
        assert!((track.sector_rad().unwrap() - f64::to_radians(90.0)).abs() < 1e-9);
        let rounds: Vec<_> = (0..500).filter(|k| turned[*k].new_sweep).collect();
        assert_eq!(rounds, [0, 101, 201, 301, 401]);
    }

    #[test]
    fn stall_of_a_head_does_not_change_its_measured_rate() {
        let mut track = MeasuredMotion::default();
        for k in 0..100 {
            track.ping(MonoNs(k * 20_000_000), f64::to_radians(0.9 * k as f64));
        }
        for k in 100..500 {
            track.ping(MonoNs(k * 20_000_000), f64::to_radians(0.9 * 99.0));
        }
        assert_eq!(track.last().unwrap().0, MonoNs(99 * 20_000_000));
        assert!((track.rate_radps().unwrap() - f64::to_radians(45.0)).abs() < 1e-9);
        for k in 500..510 {
            track.ping(MonoNs(k * 20_000_000), f64::to_radians(0.9 * (k - 400) as f64));
        }
        assert!((track.rate_radps().unwrap() - f64::to_radians(45.0)).abs() < 1e-9);
    }

    /// The head takes coarse steps on its way to its program, and then turns as programmed.
    #[test]
    fn turn_rate_is_known_soon_after_a_head_has_been_homed() {
        let mut track = MeasuredMotion::default();
        let (mut at, mut angle_deg) = (MonoNs(0), 0.0_f64);
        let mut turn = |pings: u32, ping_ms: i64, step_deg: f64| {
            for _ in 0..pings {
                (at, angle_deg) = (at + DurNs::from_millis(ping_ms), angle_deg + step_deg);
                track.ping(at, angle_deg.to_radians());
            }
            track.rate_radps().unwrap().to_degrees()
        };
        assert!((turn(1000, 20, 0.9) - 45.0).abs() < 1e-9);
        assert!((turn(50, 15, 2.4) - 160.0).abs() < 1.0, "homing");
        assert!((turn(10, 20, 0.9) - 45.0).abs() < 0.5, "on the program");
        // Pings are lost, so each step is twice as long, but so is its time.
        assert!((turn(200, 40, 1.8) - 45.0).abs() < 0.5);
    }

    #[test]
    fn step_across_missing_pings_is_not_a_single_step() {
        let (track, turned) = run([0.0, 0.9, 1.8, 2.7, 4.5, 5.4].into_iter());
        assert!(!turned[4].single_step && turned[5].single_step);
        assert!((track.step_rad().unwrap() - f64::to_radians(0.9)).abs() < 1e-9);
    }

    /// After a restart, or after somebody has turned the head by hand, earlier pings are no longer used. The angle
    /// between the old and the new position doesn't count as turned by the head.
    #[test]
    fn head_restart_at_a_distant_angle_does_not_count_as_turning() {
        for gap_ms in [20, 60, 1500, 60_000] {
            for jump_deg in [-170, -60, -20, 20, 60, 170] {
                for way in [0.9, -0.9] {
                    let mut track = MeasuredMotion::default();
                    let mut at = MonoNs(0);
                    for k in 0..1000 {
                        at = MonoNs(k * 20_000_000);
                        track.ping(at, f64::to_radians(way * k as f64));
                    }
                    let from = way * 999.0 + f64::from(jump_deg);
                    for k in 0..1000 {
                        let when = at + DurNs::from_millis(gap_ms + 20 * k);
                        let turned = track.ping(when, f64::to_radians(from + way * k as f64));
                        let what = format!("{gap_ms} ms, {jump_deg} deg, step {way}: ping {k}: {turned:?}");
                        assert_eq!(turned.single_step, k > 0, "{what}");
                        assert!(k == 0 || !turned.new_sweep, "{what}");
                        assert_eq!(track.sector_rad(), None, "{what}");
                        if let Some(rate) = track.rate_radps() {
                            let off = rate.to_degrees() / (50.0 * way) - 1.0;
                            assert!(off.abs() < 0.02, "{what}: {} deg/s", rate.to_degrees());
                        }
                    }
                    assert!(track.rate_radps().is_some());
                }
            }
        }
    }
}
