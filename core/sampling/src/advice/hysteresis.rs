//! Hysteresis of the displayed advice, so that the display does not flicker.

use super::answer::{Advice, Reason};
use super::search::SPEED_MARGIN;
use crate::head::{HeadSet, MAX_HEADS};
use headrace_geometry::snapshot::stateful;
use headrace_geometry::time::{DurNs, MonoNs};

/// Length of the past period whose most restrictive advice is displayed.
const HOLD: DurNs = DurNs(1_000_000_000);
/// Time for which a higher advised speed must last before it is displayed.
///
/// The higher speed must exceed the displayed speed by [`RISES_BY`]: 3 mm/s at 0.1 m/s.
const RISES_AFTER: DurNs = DurNs(10_000_000_000);
const RISES_BY: f64 = 0.03;
/// Time since a head's last return within which another return of this head does not raise the displayed speed early.
///
/// A head that falls silent again and again would make the display flicker.
const RETURNS_AFTER: DurNs = DurNs(60_000_000_000);
/// A lower advised speed is displayed at once if it is lower than the displayed speed by this share.
///
/// Smaller differences are within half of the speed margin.
const FALLS_BY: f64 = SPEED_MARGIN / 2.0;
/// Number of stored advice updates: all updates within `HOLD` at 5 Hz.
const HELD: usize = 6;
/// Share by which the predicted spacing T must exceed the target before the display forecasts an exceedance.
///
/// The share is half of the speed margin, so that the forecast does not flicker at the advised speed.
const BEYOND: f64 = SPEED_MARGIN / 2.0;
/// Share by which the predicted spacing T must exceed the remaining target before a possible exceedance is displayed.
///
/// The remaining target is the target minus the margin for position errors. The limit is above 2 %, because pilots may
/// exceed the advised speed by 1 or 2 %.
const MAYBE_BEYOND: f64 = 0.03;

/// Displays the most restrictive advice of the last second.
///
/// The most restrictive advice has the most severe reason and, for equal reasons, the lowest speed. A more severe
/// reason appears at once; a less severe reason appears after a second. A speed that is lower than the displayed speed
/// by 0.5 % appears at once. If all speeds of ten seconds are higher than the displayed speed by 3 %, the lowest of
/// them appears. Smaller changes do not appear. After a head has returned, one second is enough: the higher speed has a
/// known cause, and a lower speed would not fill the gap that the head has left. Before the first advice with a speed, or with the reason why no speed
/// meets the target, nothing is filtered.
#[derive(Debug, Clone)]
pub struct Hysteresis {
    target_m: f64,
    held: [Option<(MonoNs, Advice)>; HELD],
    next: usize,
    begun: bool,
    will_exceed: bool,
    may_exceed: bool,
    /// Displayed speed, m/s, and the time of the latest advice.
    shown: Option<(MonoNs, f64)>,
    /// Time since which all advised speeds exceed the displayed speed, and the lowest of the advised speeds, m/s.
    rising: Option<(MonoNs, f64)>,
    /// Heads in step at the latest advice, and all heads that have ever been in step.
    in_step: HeadSet,
    known: HeadSet,
    /// Heads that have returned since the displayed speed last rose, and the time at which the last of them returned.
    returned: HeadSet,
    returned_at: MonoNs,
    /// Time at which the return of each head last raised the displayed speed.
    raised: [Option<MonoNs>; MAX_HEADS],
}

stateful!(Hysteresis { state: held, next, begun, will_exceed, may_exceed, shown, rising, in_step, known, returned, returned_at, raised; fixed: target_m; });

impl Hysteresis {
    /// Creates the hysteresis filter for a target T, m.
    pub fn new(target_m: f64) -> Self {
        Self {
            target_m,
            held: [None; HELD],
            next: 0,
            begun: false,
            will_exceed: false,
            may_exceed: false,
            shown: None,
            rising: None,
            in_step: HeadSet::default(),
            known: HeadSet::default(),
            returned: HeadSet::default(),
            returned_at: MonoNs(0),
            raised: [None; MAX_HEADS],
        }
    }

    /// Resets the filter after the vehicle has reversed its direction, because other speeds then apply.
    pub fn forget(&mut self) {
        let Self { in_step, known, raised, target_m, .. } = *self;
        *self = Self { in_step, known, raised, ..Self::new(target_m) };
    }

    /// Processes the advice at a timestamp of data time and returns the advice to display. The advice counts the passes
    /// of the heads `in_step` together.
    ///
    /// Allocates: never.
    pub fn show(&mut self, at: MonoNs, in_step: HeadSet, advice: Advice) -> Advice {
        self.note_returned(at, in_step);
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
        let sure_share = if self.may_exceed { 1.0 + MAYBE_BEYOND / 3.0 } else { 1.0 + MAYBE_BEYOND };
        let may_exceed = held().any(|held| held.may_exceed && exceeds(held, held.sure_m * sure_share));
        let worst =
            held().fold(&advice, |worst, held| if restricts_more(held, worst) { held } else { worst });
        let (unseen_m, remedy, reason, worst_mps) =
            (worst.unseen_m, worst.remedy, worst.reason, worst.v_max_mps);
        let v_max_mps = self.steadied_mps(at, worst_mps, reason == Reason::HelixPitch);
        let rising_mps = self.rising.map(|(_, least_mps)| least_mps);
        let shown =
            Advice { v_max_mps, reason, will_exceed, may_exceed, unseen_m, remedy, rising_mps, ..advice };
        (self.will_exceed, self.may_exceed) = (will_exceed, may_exceed);
        shown
    }

    /// Records heads that have returned to those in step since the latest advice.
    fn note_returned(&mut self, at: MonoNs, in_step: HeadSet) {
        let is_rare = |head: &usize| {
            let raised = self.raised.get(*head).copied().flatten();
            raised.is_none_or(|raised| at.since(raised).0 > RETURNS_AFTER.0)
        };
        let is_back = |head: &usize| self.known.has(*head) && !self.in_step.has(*head);
        let returned = in_step.iter().filter(is_back).filter(is_rare);
        let returned = returned.fold(HeadSet::default(), HeadSet::with);
        if !returned.is_empty() {
            self.returned_at = at;
        } else if at.since(self.returned_at).0 > RISES_AFTER.0 {
            self.returned = HeadSet::default();
        }
        self.returned = self.returned.union(returned);
        (self.in_step, self.known) = (in_step, self.known.union(in_step));
    }

    /// Returns the speed to display, m/s; `speed_mps` is the lowest advised speed of the last second.
    fn steadied_mps(&mut self, at: MonoNs, speed_mps: f64, is_speed: bool) -> f64 {
        let before = self.shown.filter(|(then, _)| at.since(*then).0.abs() <= HOLD.0);
        let Some((_, before_mps)) = before.filter(|_| is_speed) else {
            (self.shown, self.rising) = (is_speed.then_some((at, speed_mps)), None);
            return speed_mps;
        };
        let falls = speed_mps < before_mps * (1.0 - FALLS_BY);
        self.rising = (speed_mps > before_mps * (1.0 + RISES_BY)).then(|| match self.rising {
            Some((since, least_mps)) => (since, least_mps.min(speed_mps)),
            None => (at, speed_mps),
        });
        let rises_after = if self.returned.is_empty() { RISES_AFTER } else { DurNs(0) };
        let risen = self.rising.filter(|(since, _)| at.since(*since).0 >= rises_after.0);
        let shown_mps = match risen {
            _ if falls => speed_mps,
            Some((_, least_mps)) => least_mps,
            None => before_mps,
        };
        debug_assert!(
            speed_mps >= shown_mps * (1.0 - FALLS_BY),
            "the displayed speed exceeds the advised {speed_mps} m/s by at most the share {FALLS_BY}: {shown_mps} m/s"
        );
        if risen.is_some() {
            self.rising = None;
            for (_, raised) in self.raised.iter_mut().enumerate().filter(|(head, _)| self.returned.has(*head))
            {
                *raised = Some(at);
            }
            self.returned = HeadSet::default();
        }
        self.shown = Some((at, shown_mps));
        shown_mps
    }
}

/// Whether the predicted spacing T exceeds a limit.
///
/// Without a predicted T, the result is the forecast in the advice itself.
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
            steady.show(at, HeadSet::default(), advice)
        };
        of.into_iter().map(&mut show).collect()
    }

    #[test]
    fn higher_advised_speed_is_displayed_at_once_after_a_reset() {
        let mut steady = Hysteresis::new(TARGET_M);
        let show = |steady: &mut Hysteresis, k: u64, mps: f64| {
            steady.show(MonoNs(3_000_000_000 + k * 200_000_000), HeadSet::default(), speed(mps)).v_max_mps
        };
        for k in 0..20 {
            show(&mut steady, k, 0.1);
        }
        assert!((show(&mut steady, 20, 0.2) - 0.1).abs() < 1e-12, "a higher speed is delayed");
        steady.forget();
        assert!((show(&mut steady, 21, 0.2) - 0.2).abs() < 1e-12);
    }

    #[test]
    fn limiting_factor_more_severe_than_the_displayed_one_appears_at_once() {
        let ladder = [Reason::HelixPitch, Reason::AngularStep, Reason::NoReturns, Reason::NoHeadingOrFix];
        for pair in ladder.windows(2) {
            let [lesser, graver] = [0, 1].map(|k| Advice::nothing(pair[k]));
            let given = [vec![speed(0.2)], vec![lesser; 10], vec![graver], vec![lesser; 8]].concat();
            let reasons: Vec<_> = shown(given).iter().map(|advice| advice.reason).collect();
            assert_eq!(reasons[10], pair[0], "before the severe reason");
            assert_eq!(reasons[11..17], [pair[1]; 6], "the severe reason appears at once, for a second");
            assert_eq!(reasons[17..], [pair[0]; 3], "the lesser reason appears after that");
        }
    }

    #[test]
    fn intermittent_limiting_factors_do_not_flicker_on_the_display() {
        let flickering =
            (0..100).map(|k| if k % 3 == 0 { Advice::nothing(Reason::AngularStep) } else { speed(0.2) });
        let shown = shown(flickering);
        assert!(shown.iter().all(|advice| advice.reason == Reason::AngularStep && advice.v_max_mps == 0.0));
    }

    #[test]
    fn decrease_of_the_advised_speed_is_displayed_at_once_and_increase_after_10_s() {
        let given = [vec![speed(0.2); 10], vec![speed(0.1)], vec![speed(0.2); 70]].concat();
        let advised = shown(given);
        let speeds: Vec<f64> = advised.iter().map(|advice| advice.v_max_mps).collect();
        assert!((speeds[9] - 0.2).abs() < 1e-12);
        // The low speed stays in the history for a second. After this second, the higher speed must last for ten
        // seconds.
        assert_eq!(speeds[10..66], [0.1; 56]);
        let rising: Vec<Option<f64>> = advised.iter().map(|advice| advice.rising_mps).collect();
        assert_eq!(
            (&rising[10..16], &rising[16..66], rising[66]),
            (&[None; 6][..], &[Some(0.2); 50][..], None)
        );
        assert_eq!(speeds[66..], [0.2; 15]);
    }

    /// Times (s) at which the displayed speed changes while the second of two heads is in step only in some seconds.
    fn changes_s(is_in_step: impl Fn(u32) -> bool) -> Vec<f64> {
        let mut steady = Hysteresis::new(TARGET_M);
        let (mut last, mut changes) = (None, Vec::new());
        for k in 0..1000_u32 {
            let both = is_in_step(k / 5);
            let in_step = HeadSet::first(if both { 2 } else { 1 });
            let advice = speed(if both { 0.2 } else { 0.1 });
            let at = MonoNs(3_000_000_000 + u64::from(k) * 200_000_000);
            let now_mps = steady.show(at, in_step, advice).v_max_mps;
            if last.is_some_and(|last: f64| (last - now_mps).abs() > 1e-12) {
                changes.push(0.2 * f64::from(k));
            }
            last = Some(now_mps);
        }
        changes
    }

    #[test]
    fn higher_speed_is_displayed_a_second_after_a_head_has_returned() {
        let near = |found: &[f64], expected: &[f64]| {
            found.len() == expected.len() && found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 0.21)
        };
        let once = changes_s(|second| !(50..70).contains(&second));
        assert!(near(&once, &[50.0, 71.0]), "{once:?}");
        // The head falls silent for the second time within a minute after its return.
        let twice = changes_s(|second| !(50..70).contains(&second) && !(90..100).contains(&second));
        assert!(near(&twice, &[50.0, 71.0, 90.0, 111.0]), "{twice:?}");
        // A head that is silent in 3 of 8 seconds raises the displayed speed once a minute.
        let often = changes_s(|second| second < 50 || second % 8 >= 3);
        assert!(near(&often, &[50.0, 52.0, 56.0, 116.0, 120.0, 180.0, 184.0]), "{often:?}");
    }

    #[test]
    fn small_changes_of_the_advised_speed_are_not_displayed() {
        let wavering = (0..300).map(|k| speed(0.1 + if k % 7 < 3 { 0.0009 } else { 0.0027 }));
        let speeds: Vec<f64> = shown(wavering).iter().map(|advice| advice.v_max_mps).collect();
        assert!(speeds[1..].iter().all(|speed_mps| (speed_mps - 0.1009).abs() < 1e-12));
        // The displayed speed follows a slowly falling advised speed, with a lag of at most 0.5 %.
        let sinking: Vec<_> = (0..300).map(|k| speed(0.1 - 1e-4 * f64::from(k))).collect();
        let shown = shown(sinking.iter().copied());
        let over = |(shown, given): (&Advice, &Advice)| shown.v_max_mps > given.v_max_mps * 1.0051;
        assert!(!shown.iter().zip(&sinking).any(over));
    }

    #[test]
    fn advice_before_the_first_speed_is_unfiltered() {
        let given = [vec![Advice::nothing(Reason::NoHeadingOrFix); 3], vec![speed(0.2); 2]].concat();
        let shown = shown(given);
        assert_eq!(shown[2].reason, Reason::NoHeadingOrFix);
        assert_eq!((shown[3].reason, shown[3].v_max_mps), (Reason::HelixPitch, 0.2));
    }

    #[test]
    fn warning_of_a_missed_target_is_displayed_until_the_predicted_spacing_is_below_the_target() {
        let at = |t_m: f64| advice(Reason::HelixPitch, 0.2, t_m);
        let given = [
            // The predicted spacing T exceeds the target by less than `BEYOND`.
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
        assert!(exceed[22], "the spacing at an unseen strip exceeds any limit");
        let nothing = shown(vec![Advice::nothing(Reason::NoHeadingOrFix)]);
        assert!(!nothing[0].will_exceed);
    }

    #[test]
    fn possible_exceedance_is_displayed_with_hysteresis() {
        let at =
            |t_m: f64| Advice { may_exceed: t_m > 0.4, sure_m: 0.4, ..advice(Reason::HelixPitch, 0.2, t_m) };
        let given = [vec![at(0.411); 3], vec![at(0.413)], vec![at(0.406); 10], vec![at(0.403); 8]].concat();
        let may: Vec<_> = shown(given).iter().map(|advice| advice.may_exceed).collect();
        assert_eq!(may[..3], [false; 3]);
        assert_eq!(may[3..19], [true; 16]);
        assert_eq!(may[19..], [false; 3]);
    }

    #[test]
    fn advice_pause_of_more_than_1_s_resets_the_hysteresis() {
        let mut steady = Hysteresis::new(TARGET_M);
        steady.show(MonoNs(0), HeadSet::default(), speed(0.1));
        assert!(
            (steady.show(MonoNs(1_200_000_000), HeadSet::default(), speed(0.2)).v_max_mps - 0.2).abs()
                < 1e-12
        );
    }
}
