//! Texts of the live state that all screens show.

use serde::Serialize;

use super::condition::Condition;
use super::speed_band::SpeedBand;
use super::state::{LiveState, SensorState};
use crate::pilot_text::{limit_steps, limit_text, speed_steps, station};
use crate::words::{verdict_words, withheld_text};
use headrace_coverage::Verdict;

/// Phase error below which the heads count as in phase: 20 degrees.
const IN_PHASE_RAD: f64 = 20.0 * core::f64::consts::PI / 180.0;

/// Minimum ratio of the speed in phase to the present limit for the phases to be named. At 1.1 the text flickered in
/// a simulated dive with heads in phase.
const PHASE_GAIN: f64 = 1.3;

/// Texts of the speed and its limit, each without its unit.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize)]
pub struct SpeedTexts {
    /// Absolute speed along the tunnel; `None` without a position, or if the data are old.
    pub speed: Option<String>,
    /// Largest advised speed; `None` if no limit applies here and now.
    pub limit: Option<String>,
    /// Difference between speed and limit, in words; `None` if either is missing.
    pub margin: Option<String>,
}

impl LiveState {
    /// Whether the pilot has to keep a speed limit at present.
    fn has_limit(&self) -> bool {
        match self.condition() {
            Condition::NoData
            | Condition::Old(_)
            | Condition::NoPosition(_)
            | Condition::Outside(_)
            | Condition::NoSonar
            | Condition::Passed
            | Condition::GoingBack(_)
            | Condition::NoSpeed => false,
            Condition::TooFast
            | Condition::TurnFails
            | Condition::CannotSay(_)
            | Condition::Over
            | Condition::TurnUnsure
            | Condition::Good => !self.asks_to_stand(),
        }
    }

    /// Texts of the speed and its limit.
    ///
    /// Speed and limit have the same number of decimals. The limit is rounded down. A speed over the limit is rounded
    /// up. Any other speed is shown as at most the limit. The figures therefore agree with the condition.
    pub fn speed_texts(&self) -> SpeedTexts {
        let is_now = !matches!(self.condition(), Condition::NoData | Condition::Old(_));
        let speed_mps = self.speed_mps.filter(|_| is_now).map(f64::abs);
        let limit_mps = self.v_max_mps().filter(|_| self.has_limit());
        let (decimals, steps) = speed_steps(limit_mps.or(speed_mps).unwrap_or(0.0));
        let limit = limit_mps.map(|mps| limit_steps(mps, steps));
        let is_over = self.speed_band() != SpeedBand::Within;
        let speed = speed_mps.map(|mps| match limit {
            Some(limit) if is_over => (mps * steps - 1e-6).ceil().max(limit + 1.0),
            Some(limit) => (mps * steps).round().min(limit),
            None => (mps * steps).round(),
        });
        let text = |in_steps: f64| format!("{:.decimals$}", in_steps / steps);
        let margin = limit.zip(speed).map(|(limit, speed)| match limit - speed {
            left if left > 0.5 => format!("{} to spare", text(left)),
            left if left < -0.5 => format!("{} too fast", text(-left)),
            _ => "at the limit".to_owned(),
        });
        SpeedTexts { speed: speed.map(text), limit: limit.map(text), margin }
    }

    /// Text about a limit that rises soon, or is low because the heads are out of phase; `None` if it
    /// is not.
    ///
    /// While a head is silent or does not turn, the text about that head is the cause.
    pub fn phase_text(&self) -> Option<String> {
        let advice = self.advice.as_ref().filter(|_| self.turning & !self.deaf == self.heads)?;
        let limit_mps = self.v_max_mps().filter(|_| self.has_limit() && self.heads.count_ones() > 1)?;
        if let Some(mps) = advice.rising_mps {
            return Some(format!("limit rises to {} in a few seconds", limit_text(mps)));
        }
        advice.phase_error_rad.filter(|error_rad| error_rad.abs() >= IN_PHASE_RAD)?;
        let in_phase_mps = advice.anew.map(|anew| anew.planned_speed_mps);
        let in_phase_mps = in_phase_mps.filter(|mps| *mps > PHASE_GAIN * limit_mps)?;
        // The driver keeps the heads at their start phases, so only other start phases help.
        let (decimals, steps) = speed_steps(in_phase_mps);
        let planned = limit_steps(in_phase_mps, steps) / steps;
        Some(format!("heads out of phase: set planned_speed_mps to {planned:.decimals$} and restart"))
    }

    /// Number of a sensor's withheld readings, with the reason; `None` unless they make it useless.
    pub fn withheld_text(&self, source: usize) -> Option<String> {
        let is_useless = self.sensor(source) == SensorState::Withheld;
        self.withheld(source).filter(|_| is_useless).map(withheld_text)
    }

    /// Text about missed stretches: their length, and where the first one begins; `None` if there are none.
    pub fn outstanding_text(&self) -> Option<String> {
        let missed = verdict_words(Verdict::Fail);
        let missed_m = Some(self.metres.fail_m).filter(|missed_m| *missed_m > 0.0)?;
        let from =
            self.missed_from_m.map_or_else(String::new, |from_m| format!(", from {}", station(from_m)));
        Some(format!("{missed_m:.2} m {missed}{from}"))
    }
}

#[cfg(test)]
mod tests {
    use super::super::condition::test_state;
    use super::*;
    use headrace_sampling::advice::{Advice, Anew};

    /// Texts for a speed and a limit, m/s, as one line.
    fn shown(speed_mps: f64, v_max_mps: f64) -> String {
        let state = test_state();
        let advice = state.advice.map(|advice| Advice { v_max_mps, ..advice });
        let texts = LiveState { speed_mps: Some(speed_mps), advice, ..state }.speed_texts();
        [texts.speed, texts.limit, texts.margin].map(Option::unwrap).join(" | ")
    }

    #[test]
    fn speed_limit_and_margin_agree_with_the_condition() {
        let texts = [(0.0904, 0.0939), (0.0939, 0.0939), (0.0945, 0.0939), (0.0965, 0.0939), (0.1, 0.0939)]
            .map(|(speed_mps, v_max_mps)| shown(speed_mps, v_max_mps));
        insta::assert_snapshot!(texts.join("\n"), @r"
        0.090 | 0.093 | 0.003 to spare
        0.093 | 0.093 | at the limit
        0.093 | 0.093 | at the limit
        0.097 | 0.093 | 0.004 too fast
        0.100 | 0.093 | 0.007 too fast
        ");
        insta::assert_snapshot!([shown(0.104, 0.119), shown(-0.25, 0.1), shown(0.1049, 0.1)].join("\n"), @r"
        0.10 | 0.11 | 0.01 to spare
        0.25 | 0.10 | 0.15 too fast
        0.11 | 0.10 | 0.01 too fast
        ");
    }

    #[test]
    fn limit_that_is_low_because_of_the_phases_names_the_cause() {
        let state = LiveState { heads: 0b11, turning: 0b11, ..test_state() };
        let text = |in_phase_mps: f64, rising_mps: Option<f64>, state: &LiveState| {
            let anew = Some(Anew { planned_speed_mps: in_phase_mps });
            let phase_error_rad = Some(1.0);
            let advice = state.advice.map(|advice| Advice {
                v_max_mps: 0.06,
                phase_error_rad,
                anew,
                rising_mps,
                ..advice
            });
            LiveState { advice, speed_mps: Some(0.05), ..*state }.phase_text()
        };
        let texts = [text(0.094, None, &state), text(0.094, Some(0.092), &state), text(0.065, None, &state)];
        let [out, rising, fits] = texts;
        assert_eq!(out.as_deref(), Some("heads out of phase: set planned_speed_mps to 0.094 and restart"));
        assert_eq!(rising.as_deref(), Some("limit rises to 0.092 m/s in a few seconds"));
        assert_eq!(fits, None);
        // A head that does not turn is the cause itself.
        assert_eq!(text(0.094, Some(0.092), &LiveState { turning: 0b01, ..state }), None);
    }

    #[test]
    fn speed_limit_is_shown_only_if_one_applies() {
        let state = test_state();
        let back = LiveState { back_to_m: Some(8.2), speed_mps: Some(-0.3), ..state }.speed_texts();
        assert_eq!((back.speed.as_deref(), back.limit, back.margin), (Some("0.30"), None, None));
        let passed = LiveState { passed: true, ..state }.speed_texts();
        assert_eq!(passed.limit, None);
    }
}
