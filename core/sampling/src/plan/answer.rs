//! Planning questions, and the answer for each mode.

use serde::Serialize;

use super::planner::Planner;
use crate::error::{SamplingError, positive};
use crate::margin::Margins;
use crate::section;
use crate::spacing::Spiral;

/// A planning question: target, speed or time.
///
/// With a target alone, the question asks for the speed. With a speed or a time alone, the question asks for the target
/// that can be met. With a target and a speed or time, the question asks whether the target is met.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Question {
    /// Target T, m.
    pub target_m: Option<f64>,
    /// Speed of the vehicle, m/s.
    pub speed_mps: Option<f64>,
    /// Time for the whole length of the tunnel, seconds.
    pub time_s: Option<f64>,
}

/// The answer to a planning question for one mode of the heads; distances along the tunnel are at `speed_mps`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Answer {
    /// The mode of the heads.
    pub mode: &'static str,
    /// theta: angle between two pings, degrees.
    pub step_deg: f64,
    /// n: pings per turn. Source: Jorge et al. 2021, Eq. 3.
    pub steps_per_turn: u32,
    /// T: time of a turn, seconds.
    pub turn_s: f64,
    /// Origin of the turn period: `measured`, `table` or `estimated`.
    pub turn_basis: &'static str,
    /// epsilon: overlap of neighbouring beams; below 1, beams do not overlap. Source: Jorge et al. 2021, Eq. 22.
    pub overlap: f64,
    /// Smallest T_y (straight-line distance between neighbouring samples of a turn), at rest and at the nominal pose,
    /// m. Source: Jorge et al. 2021, Eq. 5 or 7.
    pub t_y_min_rest_m: f64,
    /// Mean straight-line T_y, at rest and at the nominal pose, m. Source: Jorge et al. 2021, Eq. 10.
    pub t_y_mean_rest_m: f64,
    /// Largest straight-line T_y, at rest and at the nominal pose, m. Source: Jorge et al. 2021, Eq. 6.
    pub t_y_max_rest_m: f64,
    /// T_yp: upper bound of the mean T_y, m. Source: Jorge et al. 2021, Eq. 10.
    pub t_yp_m: f64,
    /// T_y2: the largest distance between neighbouring samples of one turn on the wall, at any tolerated pose, m.
    pub t_y2_m: f64,
    /// The largest speed that meets the target, m/s.
    pub v_max_mps: Option<f64>,
    /// The largest speeds without margins, with one margin, with two margins, and so on; the last is `v_max_mps`.
    pub margins: Option<Margins>,
    /// Time for the whole length of the tunnel at `v_max_mps`, hours.
    pub needed_h: Option<f64>,
    /// Reason why no speed meets the target: `angular_step`, `unseen_strip` or `off_axis`.
    pub reason: Option<&'static str>,
    /// Message for the reason why no speed meets the target.
    pub refused: Option<String>,
    /// Speed that the fields below refer to, m/s: the speed in the question, or else `v_max_mps`.
    pub speed_mps: Option<f64>,
    /// Distances between samples at `speed_mps`.
    pub spacing: Option<Spacing>,
    /// Part of the target reserved for position errors at `speed_mps`, m; zero if the position errors are unknown.
    pub position_margin_m: f64,
    /// Whether the speed in the question meets the target, position errors included.
    pub meets_target: Option<bool>,
    /// Whether the time in the question is enough at `v_max_mps`.
    pub suffices: Option<bool>,
    /// Whether this mode is the best answer to the question among all modes.
    pub best: bool,
}

/// Distances between samples at a speed, m.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Spacing {
    /// d: distance travelled between two pings. Source: Jorge et al. 2021, Eq. 11.
    pub advance_m: f64,
    /// v T: distance travelled in a turn. Source: Jorge et al. 2021, Eq. 12.
    pub pitch_m: f64,
    /// T_x: distance between passes where all heads see the wall.
    pub t_x_m: f64,
    /// T_x on the strip of wall with the longest time between passes, which is hidden from some heads.
    pub t_x_hidden_m: f64,
    /// T_ymin, including the advance between two pings. Source: Jorge et al. 2021, Eq. 14.
    pub t_y_min_m: f64,
    /// Mean T_y, including the advance between two pings.
    pub t_y_mean_m: f64,
    /// T_ymax, including the advance between two pings. Source: Jorge et al. 2021, Eq. 13.
    pub t_y_max_m: f64,
    /// T_min: smallest spacing of samples. Source: Jorge et al. 2021, Eq. 18.
    pub t_min_m: f64,
    /// T_mean: mean spacing of samples. Source: Jorge et al. 2021, Eq. 17.
    pub t_mean_m: f64,
    /// Largest T_max over all tolerated poses; `None` if no head sees some strip. Source: Jorge et al. 2021, Eq. 16.
    ///
    /// T_max includes strips that the vehicle hides from some heads.
    pub t_max_m: Option<f64>,
    /// Size of the smallest feature that is certain to get one sample.
    pub hit_once_m: Option<f64>,
    /// Size of the smallest feature that is certain to get two samples, as the sampling theorem requires for each
    /// feature.
    pub hit_twice_m: Option<f64>,
}

impl Planner {
    /// Returns the answers for all modes, or for the mode `only`.
    ///
    /// If a mode can't meet the target, its answer says so. This isn't an error.
    ///
    /// Errors: no target, speed or time; a value that isn't above zero.
    pub fn answers(&self, question: &Question, only: Option<&str>) -> Result<Vec<Answer>, SamplingError> {
        let Question { target_m, speed_mps, time_s } = *question;
        let length_m = self.inspection().length_m;
        let positive = |what, value: Option<f64>| value.map(|value| positive(what, value)).transpose();
        let target_m = positive("the target in metres", target_m)?;
        let needed_mps = positive("the time in seconds", time_s)?.map(|time_s| length_m / time_s);
        let asked_mps = positive("the speed in m/s", speed_mps)?.or(needed_mps);
        if target_m.is_none() && asked_mps.is_none() {
            return Err(SamplingError::NothingAsked);
        }
        let asked = Asked { target_m, asked_mps, needed_mps };
        let wanted = |mode: &str| only.is_none_or(|only| only == mode);
        let modes = self.modes().iter().enumerate().filter(|(_, planned)| wanted(planned.mode.name));
        let mut answers = modes.map(|(mode, _)| self.answer(mode, &asked)).collect::<Result<Vec<_>, _>>()?;
        mark_best(&mut answers, &asked);
        Ok(answers)
    }

    fn answer(&self, mode: usize, asked: &Asked) -> Result<Answer, SamplingError> {
        let planned = self.modes().get(mode).ok_or(SamplingError::NoCommonMode)?;
        let turn = planned.mode.turn;
        let beam_rad = self.inspection().heads.first().map_or(0.0, |(spec, _)| spec.beam_rad);
        let v_max = asked.target_m.map(|target_m| self.v_max_mps(mode, target_m));
        let (v_max_mps, refused) = match v_max {
            None => (None, None),
            Some(Ok(v_mps)) => (Some(v_mps), None),
            Some(Err(
                why @ (SamplingError::AngularStep { .. }
                | SamplingError::UnseenStrip { .. }
                | SamplingError::OffAxis { .. }),
            )) => (None, Some(why)),
            Some(Err(why)) => return Err(why),
        };
        let speed_mps = asked.asked_mps.or(v_max_mps);
        let spacing = speed_mps.map(|speed_mps| self.spacing(mode, speed_mps)).transpose()?;
        let t_max_m = spacing.and_then(|spacing| spacing.t_max_m);
        let margin_m =
            |target_m: f64| speed_mps.map_or(0.0, |speed_mps| self.margin_m(planned, target_m, speed_mps));
        let meets = |target_m: f64| t_max_m.is_some_and(|t_m| t_m + margin_m(target_m) <= target_m);
        Ok(Answer {
            mode: planned.mode.name,
            step_deg: turn.step_rad().to_degrees(),
            steps_per_turn: turn.steps(),
            turn_s: turn.period_s(),
            turn_basis: planned.mode.basis.as_str(),
            overlap: section::overlap(beam_rad, turn.step_rad())?,
            t_y_min_rest_m: planned.chords_m[0],
            t_y_mean_rest_m: planned.chords_m[1],
            t_y_max_rest_m: planned.chords_m[2],
            t_yp_m: section::t_yp_m(self.inspection().profile.perimeter_m(), turn.steps())?,
            t_y2_m: planned.t_y2_m,
            v_max_mps,
            margins: v_max_mps
                .zip(asked.target_m)
                .map(|(_, target_m)| self.margins(mode, target_m))
                .transpose()?,
            needed_h: v_max_mps.map(|v_mps| self.inspection().length_m / v_mps / 3600.0),
            reason: refused.map(|why| match why {
                SamplingError::UnseenStrip { .. } => "unseen_strip",
                SamplingError::OffAxis { .. } => "off_axis",
                _ => "angular_step",
            }),
            refused: refused.map(|why| why.to_string()),
            speed_mps,
            spacing,
            position_margin_m: asked.target_m.map_or(0.0, margin_m),
            meets_target: asked.asked_mps.and(asked.target_m).map(meets),
            suffices: asked
                .needed_mps
                .filter(|_| asked.target_m.is_some())
                .map(|needed| v_max_mps.is_some_and(|v_mps| v_mps >= needed)),
            best: false,
        })
    }

    fn spacing(&self, mode: usize, speed_mps: f64) -> Result<Spacing, SamplingError> {
        let planned = self.modes().get(mode).ok_or(SamplingError::NoCommonMode)?;
        let (gap_s, hidden_gap_s) = self.gaps_s(mode).ok_or(SamplingError::NoCommonMode)?;
        let turn = planned.mode.turn;
        let spiral = Spiral::new(speed_mps, turn, turn.period_s() / gap_s)?;
        let [least_m, mean_m, most_m] = planned.chords_m;
        let t_max_m = Some(self.t_max_m(mode, speed_mps)?).filter(|t_m| t_m.is_finite());
        Ok(Spacing {
            advance_m: spiral.advance_m(),
            pitch_m: spiral.pitch_m(),
            t_x_m: spiral.t_x_m(),
            t_x_hidden_m: speed_mps * hidden_gap_s,
            t_y_min_m: spiral.t_y_min_m(least_m),
            t_y_mean_m: spiral.t_y_mean_m(mean_m),
            t_y_max_m: spiral.t_y_max_m(most_m),
            t_min_m: spiral.t_min_m(spiral.t_y_min_m(least_m)),
            t_mean_m: spiral.t_mean_m(spiral.t_y_mean_m(mean_m)),
            t_max_m,
            hit_once_m: t_max_m,
            hit_twice_m: t_max_m.map(|t_m| 2.0 * t_m),
        })
    }
}

struct Asked {
    target_m: Option<f64>,
    asked_mps: Option<f64>,
    needed_mps: Option<f64>,
}

/// Marks the best mode. For a target, this is the fastest mode; for a speed, it is the mode with the smallest T_max.
fn mark_best(answers: &mut [Answer], asked: &Asked) {
    let t_max = |answer: &Answer| answer.spacing.and_then(|spacing| spacing.t_max_m);
    let best = if asked.asked_mps.is_some() {
        let finest = answers.iter().enumerate().filter_map(|(k, answer)| Some((k, t_max(answer)?)));
        finest.min_by(|a, b| a.1.total_cmp(&b.1))
    } else {
        let fastest = answers.iter().enumerate().filter_map(|(k, answer)| Some((k, answer.v_max_mps?)));
        fastest.max_by(|a, b| a.1.total_cmp(&b.1))
    };
    if let Some(answer) = best.and_then(|(k, _)| answers.get_mut(k)) {
        answer.best = true;
    }
}
