//! Texts for the pilot, with figures and units: causes, remedies and advice.
//!
//! The terminal, the log for viewers and the summary of a report use them. The words in JSON are the enums'
//! `as_str`; words without figures are in [`words`](super::words).

use super::advice_log::AdviceEntry;
use super::head_descriptions::HeadDescriptions;
use super::observations::{ObservedKind, Occurrence};
use super::words::{condition_words, limit_words};
use crate::live_state::condition::Condition;
use crate::live_state::state::LEAST_MPS;
use serde::{Deserialize, Serialize};

use headrace_coverage::{Action, Again, Cause, Causes, Evidence, Run, Sections};
use headrace_fusion::NoFix;
use headrace_fusion::filter::setting_check::{Setting, SettingDoubt};
use headrace_geometry::tunnel::Profile;
use headrace_sampling::advice::{Advice, Reason, Remedy};
use headrace_sampling::head::HeadSet;

/// Chainage as stationing: kilometres, then metres with two decimals. Example: 1+240.50 for 1240.5 m.
pub fn station(chainage_m: f64) -> String {
    let sign = if chainage_m < -0.005 { "-" } else { "" };
    let centimetres = (chainage_m.abs() * 100.0).round();
    let kilometres = (centimetres / 100_000.0).floor();
    let metres = (centimetres - kilometres * 100_000.0) / 100.0;
    format!("{sign}{kilometres:.0}+{metres:06.2}")
}

/// Number of decimals of a speed, and steps per m/s: hundredths, or thousandths below 0.1 m/s.
pub(crate) fn speed_steps(limit_mps: f64) -> (usize, f64) {
    if limit_mps < 0.1 { (3, 1000.0) } else { (2, 100.0) }
}

/// Speed limit in whole steps, rounded down.
pub(crate) fn limit_steps(limit_mps: f64, steps_per_mps: f64) -> f64 {
    // Because of rounding, 0.29 m/s would become 28 steps without the small addition.
    (limit_mps * steps_per_mps + 1e-6).floor()
}

/// Speed limit with its unit, rounded down, so that a pilot who drives at the stated speed stays within the limit.
pub fn limit_text(limit_mps: f64) -> String {
    let (decimals, steps) = speed_steps(limit_mps);
    format!("{:.decimals$} m/s", limit_steps(limit_mps, steps) / steps)
}

/// Measured speed with its unit, with as many decimals as a limit of that size.
pub(super) fn measured_speed_text(mps: f64) -> String {
    let (decimals, _) = speed_steps(mps);
    format!("{mps:.decimals$} m/s")
}

/// Clock position of an arc length, in words: "3 o'clock", or "3:30" between two hours.
pub fn clock_text(profile: &Profile, arc_m: f64) -> String {
    let clock = profile.clock(arc_m);
    clock.strip_suffix(":00").map_or(clock.clone(), |hour| format!("{hour} o'clock"))
}

/// Figures from the evidence of a failed section, for the text of its causes.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct CauseFigures {
    /// Causes that together explain the failed section.
    pub causes: Causes,
    /// Speed of the vehicle along the tunnel, m/s.
    pub speed_mps: f64,
    /// Largest step along the perimeter between neighbouring samples of one turn, m.
    pub t_y_m: f64,
    /// Largest step predicted from the tunnel's centre, m.
    pub middle_t_y_m: f64,
    /// Share of pings that gave no return.
    pub missing_share: f64,
    /// Speed advice for passing the stretch again, with the heads as scheduled.
    pub again: Again,
    /// Distance that the beams swung along the tunnel between two passes, m.
    pub swing_m: f64,
    /// Heads that passed without pinging.
    pub silent_heads: HeadSet,
}

impl From<&Evidence> for CauseFigures {
    fn from(evidence: &Evidence) -> Self {
        let Evidence { causes, speed_mps, t_y_m, middle_t_y_m, missing_share, swing_m, silent_heads, .. } =
            *evidence;
        let again = Again::of(&evidence.failing());
        Self { causes, speed_mps, t_y_m, middle_t_y_m, missing_share, again, swing_m, silent_heads }
    }
}

impl CauseFigures {
    /// Figures of a missed stretch. For each cause that the text names, the figures come from the
    /// section that represents the cause.
    pub fn of_run(sections: &Sections, run: &Run) -> Option<Self> {
        let causes = run.named();
        let main = Self::from(&sections.evidence_of(run, run.cause)?);
        let mut figures = Self { causes, again: run.again(), ..main };
        for other in causes.iter().filter(|cause| *cause != run.cause) {
            if let Some(evidence) = sections.evidence_of(run, other) {
                figures.take(other, &evidence);
            }
        }
        Some(figures)
    }

    /// Copies from the evidence the figures that a cause's text needs.
    fn take(&mut self, cause: Cause, from: &Evidence) {
        match cause {
            Cause::TooFast | Cause::Phase => self.speed_mps = from.speed_mps,
            Cause::AngularStep | Cause::OffAxis => {
                (self.t_y_m, self.middle_t_y_m, self.swing_m) = (from.t_y_m, from.middle_t_y_m, from.swing_m);
            }
            Cause::MissingReturns => self.missing_share = from.missing_share,
            Cause::HeadSilent => self.silent_heads = from.silent_heads,
            Cause::OutOfRange
            | Cause::NotPassed
            | Cause::HeadStalled
            | Cause::PositionLost
            | Cause::Occluded
            | Cause::Unknown => {}
        }
    }

    /// Speed for passing the stretch again, m/s. `v_max_mps` is the speed advised now.
    ///
    /// If the heads have to be mended or set first, the result is the speed computed for the stretch with the heads as
    /// scheduled. Otherwise the result is the lower of this speed and `v_max_mps`.
    pub fn again_mps(&self, v_max_mps: f64) -> f64 {
        let mended =
            [Cause::HeadSilent, Cause::HeadStalled, Cause::Phase, Cause::AngularStep, Cause::OutOfRange];
        let Again { at_most_mps, is_beyond_speed } = self.again;
        if at_most_mps <= 0.0 {
            if is_beyond_speed { 0.0 } else { v_max_mps }
        } else if mended.iter().any(|cause| self.causes.has(*cause)) {
            at_most_mps
        } else {
            v_max_mps.min(at_most_mps)
        }
    }

    /// Actions against the causes of the miss.
    pub fn actions(&self) -> Vec<Action> {
        Action::against(self.causes.iter(), self.again.is_beyond_speed)
    }

    /// Main cause of the miss.
    pub fn cause(&self) -> Cause {
        self.causes.iter().next().unwrap_or(Cause::Unknown)
    }
}

/// Maximum number of causes named in a text.
const NAMED: usize = 2;

/// Text of a fail's causes with their figures. If there are several causes, the first two are named.
pub fn cause_text(figures: &CauseFigures, heads: &HeadDescriptions) -> String {
    let texts: Vec<String> =
        figures.causes.iter().take(NAMED).map(|cause| one_cause_text(cause, figures, heads)).collect();
    if texts.is_empty() { one_cause_text(Cause::Unknown, figures, heads) } else { texts.join(" and ") }
}

fn one_cause_text(cause: Cause, figures: &CauseFigures, heads: &HeadDescriptions) -> String {
    match cause {
        Cause::TooFast => format!("too fast ({})", measured_speed_text(figures.speed_mps)),
        Cause::AngularStep => format!("steps of {:.2} m along the wall", figures.t_y_m),
        Cause::MissingReturns => format!("{:.0} % of returns missing", figures.missing_share * 100.0),
        Cause::OutOfRange => "wall out of range".to_owned(),
        Cause::Occluded => "the vehicle blocks the beams".to_owned(),
        Cause::OffAxis if figures.swing_m > figures.t_y_m - figures.middle_t_y_m => {
            format!("beams swung {:.1} m between turns (yaw or pitch)", figures.swing_m)
        }
        Cause::OffAxis => format!("off-centre (steps of {:.2} m along the wall)", figures.t_y_m),
        Cause::HeadStalled => "a head stopped turning".to_owned(),
        Cause::HeadSilent => heads.silent(figures.silent_heads),
        Cause::Phase => format!("heads out of phase ({})", measured_speed_text(figures.speed_mps)),
        Cause::PositionLost => "position lost".to_owned(),
        Cause::NotPassed => "not passed on both sides".to_owned(),
        Cause::Unknown => "cause unknown".to_owned(),
    }
}

/// Text of the actions for a missed stretch, as in [`action_text`]. If there are several actions, the first
/// two are named.
///
/// An action that is needed before the vehicle goes back comes first. The action "slower" is expressed by the
/// stated speed.
pub fn actions_text(
    actions: &[Action],
    back_to_m: f64,
    at_most_mps: f64,
    heads: &HeadDescriptions,
) -> String {
    let mut two: Vec<Action> = actions.iter().copied().take(NAMED).collect();
    if let [_, Action::Position | Action::HeadBack] = two.as_slice() {
        two.reverse();
    }
    // The action "slower" is left out if the stated speed covers it, or if the first action states that slower won't
    // help.
    if let [first, Action::Slower] = two.as_slice()
        && (at_most_mps > 0.0 || matches!(first, Action::FinerMode | Action::HigherGain))
    {
        two.pop();
    }
    let Some((first, others)) = two.split_first() else { return String::new() };
    let text = action_text(*first, back_to_m, at_most_mps, heads);
    others.first().map_or(text.clone(), |second| format!("{text}; and {}", short_text(*second, heads)))
}

/// Text of an action that follows another action in a sentence.
pub(crate) fn short_text(action: Action, heads: &HeadDescriptions) -> String {
    let text = match action {
        Action::Slower => "slower",
        Action::FinerMode => return format!("in {}", heads.finer_mode()),
        Action::LongerRange => return format!("with {}", heads.longer_range()),
        Action::OtherSide => "again, rolled left, then right",
        Action::Middle => "in the middle and steady",
        Action::InPhase => "with the heads in phase",
        Action::Head => "with that head repaired",
        Action::HeadBack => "with the silent sensor restored",
        Action::Position => "once the position is back",
        Action::HigherGain => "with a higher gain",
        Action::Again => "drive right through it",
    };
    text.to_owned()
}

/// Text of an action for a missed stretch: inspect it again from a chainage, m, at no more than a speed, m/s. The plan of
/// the dive says when.
///
/// The speed is zero if no known speed meets the target.
pub fn action_text(action: Action, back_to_m: f64, at_most_mps: f64, heads: &HeadDescriptions) -> String {
    let again = format!("inspect again from {}", station(back_to_m));
    let text = match action {
        // No speed is stated, because the known speed applies only to the present mode and range setting.
        Action::FinerMode => return format!("slower won't help: {}, then {again}", heads.set_finer()),
        Action::LongerRange => return format!("set {}, then {again}", heads.longer_range()),
        // A speed is stated, because a lower speed helps in other parts of the stretch.
        Action::HigherGain if at_most_mps > 0.0 => format!("{again}, with a higher gain"),
        Action::HigherGain => return "slower won't help: raise the gain, or declare an opening".to_owned(),
        Action::Slower => again,
        Action::OtherSide => format!("{again}, rolled left, then right"),
        Action::Middle => format!("{again}, in the middle and steady"),
        // The exact speed is stated, because below this speed, heads at different places along the hull are out of
        // phase again.
        Action::InPhase if at_most_mps > 0.0 => {
            return format!("{again}, with the heads in phase, at {}", limit_text(at_most_mps));
        }
        Action::InPhase => format!("{again}, with the heads in phase"),
        Action::Head => format!("{again}, with that head repaired"),
        Action::HeadBack => format!("restore the silent sensor, then {again}"),
        Action::Position => format!("once the position is back, {again}"),
        Action::Again => format!("{again}, right through it"),
    };
    if at_most_mps > 0.0 { format!("{text}, at most {}", limit_text(at_most_mps)) } else { text }
}

/// Text of the remedy for a stretch that a lower speed does not help.
fn remedy_text(remedy: Option<Remedy>) -> String {
    match remedy {
        Some(Remedy::HoldHeading) => "hold the heading: the beams swing".to_owned(),
        Some(Remedy::Centre) => "go to the middle of the tunnel".to_owned(),
        Some(Remedy::Mode(mode)) => format!("set the heads to {}", mode.as_str().to_uppercase()),
        None => "no mode meets the target here".to_owned(),
    }
}

/// Text of the requirement that is missing for a position.
pub(super) fn no_position_text(no_fix: NoFix) -> String {
    condition_words(Condition::NoPosition(no_fix)).text()
}

/// Text of the change that allows a higher speed.
///
/// If a lower speed doesn't help, the change is the remedy. If no head sees a part of the wall, the change is a longer
/// range. Otherwise the change is to a mode that all heads have and that allows a higher speed.
pub fn gain_text(advice: &Advice, heads: &HeadDescriptions) -> Option<String> {
    if advice.remedy.is_some() {
        return Some(remedy_text(advice.remedy));
    }
    if advice.unseen_m.is_some()
        && let Some(sees) = heads.seeing_more()
    {
        return Some(sees);
    }
    let others = advice.alternatives.iter().flatten();
    let best = others.max_by(|one, other| one.v_max_mps.total_cmp(&other.v_max_mps))?;
    let gains = best.v_max_mps > GAIN * advice.v_max_mps && best.v_max_mps > 0.0;
    gains.then(|| {
        format!("set the heads to {}: {}", best.mode.as_str().to_uppercase(), limit_text(best.v_max_mps))
    })
}

/// Text of a speed to keep; empty if the speed is zero.
pub(super) fn speed_text(what: &str, mps: f64) -> String {
    if mps > 0.0 { format!("{what} {}", limit_text(mps)) } else { String::new() }
}

/// Minimum ratio of a faster mode's speed to the present v_max for the mode to be displayed.
const GAIN: f64 = 1.1;

/// Figures of a missed stretch, for its text.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Missed {
    /// Beginning of the stretch, m.
    pub start_m: f64,
    /// Chainage to which the vehicle has to go back, m.
    pub back_to_m: f64,
    /// Causes of the miss with their figures.
    pub figures: CauseFigures,
    /// Arc length of the stretch's largest hole, m.
    pub hole_arc_m: f64,
    /// Coverage target T, m.
    pub target_m: f64,
    /// Speed advised now, m/s; zero if none is advised.
    pub v_max_mps: f64,
}

/// Text of a missed stretch: location, cause and action.
pub fn flag_text(missed: &Missed, profile: &Profile, heads: &HeadDescriptions) -> String {
    let Missed { start_m, back_to_m, figures, hole_arc_m, target_m, v_max_mps } = missed;
    format!(
        "ch {}  {}: holes over {target_m} m at {}; {}",
        station(*start_m),
        cause_text(figures, heads),
        clock_text(profile, *hole_arc_m),
        actions_text(&figures.actions(), *back_to_m, figures.again_mps(*v_max_mps), heads),
    )
}

/// Text for a stretch that the vehicle has driven through again and that is no longer flagged.
pub fn cleared_text(from_m: f64, to_m: f64) -> String {
    format!("cleared  ch {} to {}", station(from_m), station(to_m))
}

/// Text of an observation from a log's stream `judgements`; `None` if no kind of observation has this number.
///
/// `head` is the head or velocity log, if the observation names one.
pub fn recorded_observation_text(kind: u64, head: &str, occurrence: Occurrence) -> Option<String> {
    let kind = ObservedKind::ALL.into_iter().find(|known| *known as u64 == kind)?;
    Some(observation_text(kind, head, occurrence))
}

/// Text of an observation. `head` is the head or velocity log, if the observation names one.
pub(super) fn observation_text(kind: ObservedKind, head: &str, occurrence: Occurrence) -> String {
    let (x, off_m) = (station(occurrence.x_m), occurrence.off_m);
    match kind {
        ObservedKind::OutsideTunnel => {
            format!("ch {x}  samples {off_m:.2} m outside the tunnel: check the tether's zero")
        }
        ObservedKind::ProfileContradicted => format!(
            "ch {x}  the wall is {off_m:+.2} m off the design profile: wrong profile or position; no pass there"
        ),
        ObservedKind::HeadScattered => {
            format!("ch {x}  returns of {head} differ by {:.2} m: noise; they are ignored", off_m.abs())
        }
        ObservedKind::HeadConstant => format!(
            "ch {x}  {head} measures {off_m:.2} m at every angle, perhaps its own frame or a bubble; its returns are ignored"
        ),
        ObservedKind::HeadOutvoted => format!(
            "ch {x}  {head} measures the wall {off_m:+.2} m away from that of the other heads; its returns are ignored"
        ),
        ObservedKind::SettingDoubted => format!("ch {x}  ranges contradict a setting of the vehicle file"),
        ObservedKind::CableDoubted if !head.is_empty() => format!(
            "ch {x}  cable counter and {head} differ by {:.2} m: one of them is wrong; sections there get no verdict",
            off_m.abs()
        ),
        ObservedKind::CableDoubted => format!(
            "ch {x}  cable counter and inertial unit differ by {:.2} m: position from the inertial unit alone; sections there get no verdict",
            off_m.abs()
        ),
    }
}

/// Text of a doubtful setting, found at a chainage, m. `name` returns a source's id.
pub fn setting_text(doubt: &SettingDoubt, x_m: f64, name: &dyn Fn(u16) -> String) -> String {
    let source = doubt.source.map(name).unwrap_or_default();
    let what = match doubt.setting {
        Setting::RangeScale(share) => format!(
            "ranges {:.1} % too {}: is the speed of sound right, or the wall {}?",
            share.abs() * 100.0,
            if share > 0.0 { "long" } else { "short" },
            if share > 0.0 { "wider" } else { "narrower" },
        ),
        Setting::HeadTurned(by_rad) => {
            format!("{source} seems to be turned by {:+.1} degrees about its axis", by_rad.to_degrees())
        }
        Setting::HeadPitched(by_rad) => {
            format!("{source} seems to be pitched by {:+.1} degrees on its mount", by_rad.to_degrees())
        }
        Setting::HeadYawed(by_rad) => {
            format!("{source} seems to be yawed by {:+.1} degrees on its mount", by_rad.to_degrees())
        }
        Setting::WrongWayRound => format!("{source} seems to be mounted the wrong way round"),
        Setting::Swapped(other) => format!("{source} and {} seem to be swapped", name(other)),
    };
    format!("ch {}  {what}", station(x_m))
}

/// Figures for the text of an advice.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct AdviceFigures {
    /// Present speed of the vehicle, m/s.
    pub speed_mps: f64,
    /// Largest speed that meets the target, m/s; zero if there is none.
    pub v_max_mps: f64,
    /// Factor that limits the speed.
    pub reason: Reason,
    /// Whether the present turn of the heads will exceed the target.
    pub will_exceed: bool,
    /// Phase error of the heads, radians.
    pub phase_error_rad: f64,
    /// Largest step along the perimeter between neighbouring samples of one turn, m.
    pub t_y_m: f64,
    /// Strip of wall that no head sees: width and arc length of its centre, m.
    pub unseen_m: Option<[f64; 2]>,
    /// Remedy if a lower speed does not help.
    pub remedy: Option<Remedy>,
}

impl From<&AdviceEntry> for AdviceFigures {
    fn from(entry: &AdviceEntry) -> Self {
        Self::of(&entry.advice, entry.speed_mps)
    }
}

impl AdviceFigures {
    /// Figures of speed advice at the present speed, m/s.
    pub fn of(advice: &Advice, speed_mps: f64) -> Self {
        Self {
            speed_mps,
            v_max_mps: advice.v_max_mps,
            reason: advice.reason,
            will_exceed: advice.will_exceed,
            phase_error_rad: advice.phase_error_rad.unwrap_or(0.0),
            t_y_m: advice.t_y_m,
            unseen_m: advice.unseen_m,
            remedy: advice.remedy,
        }
    }
}

/// Text of the speed advice, with its figures.
pub fn advice_text(advice: &AdviceFigures, profile: &Profile, heads: &HeadDescriptions) -> String {
    let no_speed = condition_words(Condition::NoSpeed);
    let (no_help, limit) = (no_speed.name, limit_words(advice.reason));
    match advice.reason {
        Reason::HelixPitch if advice.v_max_mps < LEAST_MPS => no_speed.detail.to_owned(),
        Reason::HelixPitch if advice.will_exceed && advice.speed_mps.abs() > advice.v_max_mps => {
            format!("TOO FAST: at most {}", limit_text(advice.v_max_mps))
        }
        Reason::HelixPitch if advice.will_exceed => {
            let error_deg = advice.phase_error_rad.to_degrees().abs();
            format!("OUT OF PHASE by {error_deg:.0} degrees: go {}", limit_text(advice.v_max_mps))
        }
        Reason::HelixPitch => format!("may go {} ({limit})", limit_text(advice.v_max_mps)),
        Reason::AngularStep => {
            let more_seen =
                heads.seeing_more().filter(|_| advice.remedy.is_none() && advice.unseen_m.is_some());
            let remedy = more_seen.unwrap_or_else(|| remedy_text(advice.remedy));
            match (advice.remedy, advice.unseen_m) {
                (Some(Remedy::HoldHeading), _) => format!("{no_help}: {remedy}"),
                (_, Some([width_m, arc_m])) => {
                    let clock = clock_text(profile, arc_m);
                    format!("{no_help}: no head sees {width_m:.2} m of the wall at {clock}; {remedy}")
                }
                (_, None) => {
                    format!("{no_help}: steps of {:.2} m along the wall; {remedy}", advice.t_y_m)
                }
            }
        }
        Reason::NoHeadingOrFix | Reason::NoReturns => format!("no speed can be given: {limit}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::head_descriptions::tests::two;

    #[test]
    fn speed_limit_is_rounded_down_to_two_digits() {
        let limits = [0.0049, 0.0184, 0.0939, 0.0994, 0.0996, 0.1, 0.29, 0.297, 1.1449];
        let texts = limits.map(limit_text);
        let expected = ["0.004", "0.018", "0.093", "0.099", "0.099", "0.10", "0.29", "0.29", "1.14"];
        assert_eq!(texts, expected.map(|text| format!("{text} m/s")));
    }

    #[test]
    fn stationing_has_kilometres_and_metres() {
        for (chainage_m, text) in [
            (0.0, "0+000.00"),
            (1240.5, "1+240.50"),
            (999.996, "1+000.00"),
            (-0.25, "-0+000.25"),
            (7012.0, "7+012.00"),
        ] {
            assert_eq!(station(chainage_m), text);
        }
    }

    #[test]
    fn action_text_has_an_instruction_and_its_speed() {
        let at = |action, at_most_mps| action_text(action, 1240.5, at_most_mps, &two());
        for action in Action::ALL {
            let without = at(action, 0.0);
            assert!(!without.contains("m/s") && !without.ends_with([',', ' ']), "{without:?}");
            let with = at(action, 0.25);
            let speed = match action {
                Action::FinerMode | Action::LongerRange => "",
                Action::InPhase => "in phase, at 0.25 m/s",
                _ => "at most 0.25 m/s",
            };
            assert!(with.ends_with(speed) && with.contains("m/s") != speed.is_empty(), "{with:?}");
        }
        assert_eq!(at(Action::Slower, 0.25), "inspect again from 1+240.50, at most 0.25 m/s");
        assert_eq!(
            at(Action::Middle, 0.25),
            "inspect again from 1+240.50, in the middle and steady, at most 0.25 m/s"
        );
        assert_eq!(at(Action::Again, 0.0), "inspect again from 1+240.50, right through it");
        assert_eq!(
            actions_text(&[Action::Slower, Action::OtherSide, Action::Again], 1240.5, 0.25, &two()),
            "inspect again from 1+240.50, at most 0.25 m/s; and again, rolled left, then right"
        );
        // A lower speed helps in other parts of the stretch, so the text doesn't state that slower won't
        // help.
        let lossy = [Action::HigherGain, Action::Slower];
        assert_eq!(
            actions_text(&lossy, 1240.5, 0.25, &two()),
            "inspect again from 1+240.50, with a higher gain, at most 0.25 m/s"
        );
        assert_eq!(
            actions_text(&lossy, 1240.5, 0.0, &two()),
            "slower won't help: raise the gain, or declare an opening"
        );
        let lost = [Action::Slower, Action::Position];
        let back = "once the position is back, inspect again from 1+240.50";
        assert_eq!(actions_text(&lost, 1240.5, 0.25, &two()), format!("{back}, at most 0.25 m/s"));
        assert_eq!(actions_text(&lost, 1240.5, 0.0, &two()), format!("{back}; and slower"));
    }
}
