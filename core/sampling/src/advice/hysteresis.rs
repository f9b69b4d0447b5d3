//! Hysteresis of the displayed advice, so that it doesn't chatter.

use super::SPEED_MARGIN;
use super::answer::{Advice, Reason};
use headrace_geometry::time::{DurNs, MonoNs};
use headrace_snapshot::stateful;

/// Less restrictive advice is shown once nothing more restrictive has come for this long.
const HOLD: DurNs = DurNs(1_000_000_000);
/// Number of advice updates kept: those within `HOLD` at 5 Hz.
const HELD: usize = 6;
/// A turn is forecast to exceed the target when the predicted T is above it by this share: half of the speed margin, so
/// that the forecast doesn't chatter at the advised speed.
const BEYOND: f64 = SPEED_MARGIN / 2.0;

/// Shows the most restrictive advice of the last second: the gravest reason and, within it, the lowest speed.
///
/// More restrictive advice shows at once, less restrictive advice after it has held for a second. Until there has been
/// a speed, or a reason against any, advice is shown unfiltered.
#[derive(Debug, Clone)]
pub struct Hysteresis {
    target_m: f64,
    held: [Option<(MonoNs, Advice)>; HELD],
    next: usize,
    begun: bool,
    will_exceed: bool,
}

stateful!(Hysteresis { state: held, next, begun, will_exceed; fixed: target_m; });

impl Hysteresis {
    /// For a target T, m.
    pub fn new(target_m: f64) -> Self {
        Self { target_m, held: [None; HELD], next: 0, begun: false, will_exceed: false }
    }

    /// Takes the advice at a timestamp of data time and returns the advice to show.
    ///
    /// Allocates: never.
    pub fn show(&mut self, at: MonoNs, advice: Advice) -> Advice {
        if !self.begun {
            self.begun = matches!(advice.reason, Reason::HelixPitch | Reason::AngularStep);
            self.held = [None; HELD];
        }
        if let Some(slot) = self.held.get_mut(self.next % HELD) {
            *slot = Some((at, advice));
        }
        self.next = (self.next + 1) % HELD;
        let held = || {
            let recent = self.held.iter().flatten().filter(|(then, _)| at.since(*then).0.abs() <= HOLD.0);
            recent.map(|(_, held)| held)
        };
        let limit_m = self.target_m * if self.will_exceed { 1.0 } else { 1.0 + BEYOND };
        let will_exceed = held().any(|held| exceeds(held, limit_m));
        let worst =
            held().fold(&advice, |worst, held| if restricts_more(held, worst) { held } else { worst });
        let shown = Advice {
            v_max_mps: worst.v_max_mps,
            reason: worst.reason,
            unseen_m: worst.unseen_m,
            remedy: worst.remedy,
            will_exceed,
            ..advice
        };
        self.will_exceed = will_exceed;
        shown
    }
}

/// Whether the predicted T exceeds a limit; without a prediction, the advice's own forecast.
fn exceeds(advice: &Advice, limit_m: f64) -> bool {
    advice.predicted_t_m.map_or(advice.will_exceed, |t_m| t_m > limit_m)
}

fn restricts_more(a: &Advice, than: &Advice) -> bool {
    let (a_gravity, gravity) = (a.reason.gravity(), than.reason.gravity());
    a_gravity > gravity || a_gravity == gravity && a.v_max_mps < than.v_max_mps
}

#[cfg(test)]
mod tests {
    use super::*;

    const TARGET_M: f64 = 0.5;
    const BEAT: DurNs = DurNs(200_000_000);

    fn advice(reason: Reason, v_max_mps: f64, t_m: f64) -> Advice {
        Advice {
            v_max_mps,
            predicted_t_m: t_m.is_finite().then_some(t_m),
            will_exceed: t_m > TARGET_M,
            ..Advice::nothing(reason)
        }
    }

    fn speed(v_max_mps: f64) -> Advice {
        advice(Reason::HelixPitch, v_max_mps, 0.4)
    }

    fn shown(of: impl IntoIterator<Item = Advice>) -> Vec<Advice> {
        let mut steady = Hysteresis::new(TARGET_M);
        let mut at = MonoNs(3_000_000_000);
        let mut show = |advice| {
            at = at + BEAT;
            steady.show(at, advice)
        };
        of.into_iter().map(&mut show).collect()
    }

    #[test]
    fn a_graver_reason_shows_at_once_and_a_lesser_one_after_a_second() {
        let ladder = [Reason::HelixPitch, Reason::AngularStep, Reason::NoReturns, Reason::NoHeadingOrFix];
        for pair in ladder.windows(2) {
            let [lesser, graver] = [0, 1].map(|k| Advice::nothing(pair[k]));
            let given = [vec![speed(0.2)], vec![lesser; 10], vec![graver], vec![lesser; 8]].concat();
            let reasons: Vec<_> = shown(given).iter().map(|advice| advice.reason).collect();
            assert_eq!(reasons[10], pair[0], "before");
            assert_eq!(reasons[11..17], [pair[1]; 6], "at once, and for a second");
            assert_eq!(reasons[17..], [pair[0]; 3], "after it");
        }
    }

    #[test]
    fn reasons_that_come_and_go_do_not_flicker() {
        let flickering =
            (0..100).map(|k| if k % 3 == 0 { Advice::nothing(Reason::AngularStep) } else { speed(0.2) });
        let shown = shown(flickering);
        assert!(shown.iter().all(|advice| advice.reason == Reason::AngularStep && advice.v_max_mps == 0.0));
    }

    #[test]
    fn a_lower_speed_shows_at_once_and_a_higher_one_after_a_second() {
        let given = [vec![speed(0.2); 10], vec![speed(0.1)], vec![speed(0.2); 10]].concat();
        let speeds: Vec<f64> = shown(given).iter().map(|advice| advice.v_max_mps).collect();
        assert!((speeds[9] - 0.2).abs() < 1e-12);
        assert_eq!(speeds[10..16], [0.1; 6]);
        assert_eq!(speeds[16..], [0.2; 5]);
    }

    #[test]
    fn what_comes_before_the_first_speed_is_not_held() {
        let given = [vec![Advice::nothing(Reason::NoHeadingOrFix); 3], vec![speed(0.2); 2]].concat();
        let shown = shown(given);
        assert_eq!(shown[2].reason, Reason::NoHeadingOrFix);
        assert_eq!((shown[3].reason, shown[3].v_max_mps), (Reason::HelixPitch, 0.2));
    }

    #[test]
    fn what_is_exceeded_is_said_at_once_and_taken_back_once_the_target_is_met() {
        let at = |t_m: f64| advice(Reason::HelixPitch, 0.2, t_m);
        let given = [
            // Above the target by less than `BEYOND`.
            vec![at(0.502); 3],
            vec![at(0.503)],
            vec![at(0.5005); 10],
            vec![at(0.4995); 8],
            vec![at(f64::INFINITY)],
        ];
        let exceed: Vec<_> = shown(given.concat()).iter().map(|advice| advice.will_exceed).collect();
        assert_eq!(exceed[..3], [false; 3]);
        assert_eq!(exceed[3..19], [true; 16]);
        assert_eq!(exceed[19..22], [false; 3]);
        assert!(exceed[22], "a strip that nobody sees");
        let nothing = shown(vec![Advice::nothing(Reason::NoHeadingOrFix)]);
        assert!(!nothing[0].will_exceed);
    }

    #[test]
    fn after_a_silence_nothing_is_held() {
        let mut steady = Hysteresis::new(TARGET_M);
        steady.show(MonoNs(0), speed(0.1));
        assert!((steady.show(MonoNs(1_200_000_000), speed(0.2)).v_max_mps - 0.2).abs() < 1e-12);
    }
}
