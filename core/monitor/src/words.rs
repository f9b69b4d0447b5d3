//! What is said to the pilot, in words: on the terminal, and in the log for people's viewers.

use super::advice_log::AdviceEntry;
use super::alerts::AlertKind;
use headrace_coverage::{Action, Cause, Evidence};
use headrace_geometry::tunnel::Profile;
use headrace_sampling::advice::{Reason, Remedy};

/// Chainage as engineers write it, kilometres, then metres with two decimals: 1+240.50 for 1240.5 m.
pub fn station(chainage_m: f64) -> String {
    let sign = if chainage_m < -0.005 { "-" } else { "" };
    let centimetres = (chainage_m.abs() * 100.0).round();
    let kilometres = (centimetres / 100_000.0).floor();
    let metres = (centimetres - kilometres * 100_000.0) / 100.0;
    format!("{sign}{kilometres:.0}+{metres:06.2}")
}

/// What the words for a cause need of its evidence.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CauseFigures {
    /// The cause.
    pub cause: Cause,
    /// Speed along the tunnel, m/s.
    pub speed_mps: f64,
    /// Largest distance between neighbours of one turn, m.
    pub t_y_m: f64,
    /// The same from the middle of the tunnel, m.
    pub middle_t_y_m: f64,
    /// Share of pings without a return.
    pub missing_share: f64,
    /// How far the beams swung along the tunnel between two passes, m.
    pub swing_m: f64,
}

impl From<&Evidence> for CauseFigures {
    fn from(evidence: &Evidence) -> Self {
        let Evidence { cause, speed_mps, t_y_m, middle_t_y_m, missing_share, swing_m, .. } = *evidence;
        Self { cause, speed_mps, t_y_m, middle_t_y_m, missing_share, swing_m }
    }
}

/// A cause in a pilot's words.
pub fn cause_words(figures: &CauseFigures) -> String {
    match figures.cause {
        Cause::TooFast => format!("too fast ({:.2} m/s)", figures.speed_mps),
        Cause::AngularStep => format!("steps of {:.2} m along the wall", figures.t_y_m),
        Cause::MissingReturns => format!("{:.0} % of returns missing", figures.missing_share * 100.0),
        Cause::OutOfRange => "wall out of range".to_owned(),
        Cause::Occluded => "the vehicle in the beams' way".to_owned(),
        Cause::OffAxis if figures.swing_m > figures.t_y_m - figures.middle_t_y_m => {
            format!("beams swung {:.1} m between turns (yaw or pitch)", figures.swing_m)
        }
        Cause::OffAxis => format!("off the middle (steps of {:.2} m along the wall)", figures.t_y_m),
        Cause::HeadStalled => "a head stood still".to_owned(),
        Cause::Phase => format!("heads out of phase ({:.2} m/s)", figures.speed_mps),
        Cause::PositionLost => "position lost".to_owned(),
        Cause::NotPassed => "not passed on both sides".to_owned(),
    }
}

/// A stretch that was missed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Missed {
    /// Where it begins, m.
    pub start_m: f64,
    /// Why.
    pub figures: CauseFigures,
    /// Arc length of its largest hole, m.
    pub hole_arc_m: f64,
    /// Target T, m.
    pub target_m: f64,
    /// The speed that is advised now, m/s; zero where none is.
    pub v_max_mps: f64,
}

/// What is said when a stretch is flagged.
pub fn flag_words(missed: &Missed, profile: &Profile) -> String {
    format!(
        "ch {}  {}: holes over {} m at {} o'clock; {}",
        station(missed.start_m),
        cause_words(&missed.figures),
        missed.target_m,
        profile.clock(missed.hole_arc_m),
        what_to_do(missed),
    )
}

/// What a pilot does about a missed stretch.
fn what_to_do(missed: &Missed) -> String {
    let Missed { start_m, v_max_mps, figures: CauseFigures { cause, .. }, .. } = *missed;
    match Action::of(cause) {
        Action::FinerMode => "slower won't help, a finer mode will".to_owned(),
        Action::LongerRange => "set a longer range".to_owned(),
        Action::Again if cause == Cause::NotPassed => "pass it again from end to end".to_owned(),
        Action::OtherSide => format!("pass {} again turned or rolled", station(start_m)),
        Action::Position => format!("pass {} again once the position is back", station(start_m)),
        _ if v_max_mps > 0.0 => {
            format!("go back to {}, then at most {v_max_mps:.2} m/s", station(start_m))
        }
        _ => format!("go back to {}", station(start_m)),
    }
}

/// What is said when a stretch was passed again and is flagged no more.
pub fn cleared_words(from_m: f64, to_m: f64) -> String {
    format!("cleared  ch {} to {}", station(from_m), station(to_m))
}

/// What is said of something wrong at a chainage, by so much, m.
pub fn alert_words(kind: AlertKind, x_m: f64, off_m: f64) -> String {
    let x = station(x_m);
    match kind {
        AlertKind::OutsideTunnel => {
            format!("ch {x}  samples {off_m:.2} m outside the tunnel: is the tether's zero right?")
        }
        AlertKind::ProfileContradicted => format!(
            "ch {x}  the wall is {off_m:+.2} m off the design profile: wrong profile or position; nothing passes"
        ),
    }
}

/// What the words for advice need of it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AdviceFigures {
    /// Speed now, m/s.
    pub speed_mps: f64,
    /// The largest speed at which the target is met, m/s; zero where none is.
    pub v_max_mps: f64,
    /// What decides.
    pub reason: Reason,
    /// The present turn will exceed the target.
    pub will_exceed: bool,
    /// How far the heads are out of phase, radians.
    pub phase_error_rad: f64,
    /// Largest distance between neighbours of one turn, m.
    pub t_y_m: f64,
    /// A strip that no head sees: its width and the arc length of its middle, m.
    pub unseen_m: Option<[f64; 2]>,
    /// What would help where slower doesn't.
    pub remedy: Option<Remedy>,
}

impl From<&AdviceEntry> for AdviceFigures {
    fn from(entry: &AdviceEntry) -> Self {
        let advice = &entry.advice;
        Self {
            speed_mps: entry.speed_mps,
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

/// Advice in a pilot's words.
pub fn advice_words(advice: &AdviceFigures, profile: &Profile) -> String {
    match advice.reason {
        Reason::HelixPitch if advice.will_exceed && advice.speed_mps.abs() > advice.v_max_mps => {
            format!("TOO FAST: at most {:.2} m/s", advice.v_max_mps)
        }
        Reason::HelixPitch if advice.will_exceed => {
            let error_deg = advice.phase_error_rad.to_degrees().abs();
            format!("OUT OF PHASE by {error_deg:.0} degrees: go {:.2} m/s", advice.v_max_mps)
        }
        Reason::HelixPitch => format!("may go {:.2} m/s (distance between turns)", advice.v_max_mps),
        Reason::AngularStep => {
            let remedy = match advice.remedy {
                Some(Remedy::Steady) => {
                    return "slower won't help: hold the heading, the beams swing".to_owned();
                }
                Some(Remedy::Centre) => "go to the middle of the tunnel".to_owned(),
                Some(Remedy::Mode(mode)) => format!("set the heads to {}", mode.as_str().to_uppercase()),
                None => "no mode meets the target here".to_owned(),
            };
            match advice.unseen_m {
                Some([width_m, sigma_m]) => {
                    let clock = profile.clock(sigma_m);
                    format!("slower won't help: no head sees {width_m:.2} m of the wall at {clock}; {remedy}")
                }
                None => format!("slower won't help: steps of {:.2} m along the wall; {remedy}", advice.t_y_m),
            }
        }
        Reason::NoHeadingOrFix => "no speed can be given: no position or heading".to_owned(),
        Reason::NoReturns => "no speed can be given: no sonar returns".to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stationing_as_engineers_write_it() {
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
}
