//! Handling of cable counter readings: the decision whether to fuse them, and the effects of a dispute.

use headrace_geometry::math;
use headrace_sensor::device::SensorKind;
use headrace_sensor::reading::Reading;

use super::Eskf;
use crate::filter::agreement;
use crate::filter::cable::{CableReading, Use};
use crate::filter::measure::ScalarUpdate;
use crate::filter::settings::Settings;
use crate::filter::slack_level::Noises;
use crate::filter::sources::Source;
use crate::filter::state::{CREEP, Errors, POSITION, RATE_BIAS, VELOCITY, add_to};
use crate::filter::window::Waiting;

impl Eskf {
    /// Judges a counter reading by its innovation, m, and the innovation's variance, m^2; returns whether to fuse
    /// it.
    ///
    /// `None` for readings of other sensors.
    pub(super) fn believes_counter(
        &mut self,
        waiting: &Waiting,
        source: &Source,
        [off_m, variance_m2]: [f64; 2],
        settings: &Settings,
        errors: &mut Errors,
    ) -> Option<bool> {
        let (SensorKind::Tether { zero_at_m, scale }, Reading::TetherLength(length)) =
            (source.sensor.kind, waiting.reading)
        else {
            return None;
        };
        let (at, shown_m) = (waiting.at, zero_at_m + scale * length.length_m);
        let step_m = source.count_step.step_m(length.resolution_m) * scale.abs();
        let known = self.factors.variance(RATE_BIAS).max(self.factors.variance(RATE_BIAS + 1));
        let [restless, _] = self.unrest.factors();
        let noises = Noises::of(
            settings.tether_sd_m * settings.tether_sd_m + step_m * step_m / 12.0,
            known,
            restless * settings.rate_bias.density(),
        );
        let is_usual = self.slack_level.hear(at, shown_m, noises, settings);
        let is_lively = self.slack_level.is_lively(step_m, noises, settings);
        let agrees = off_m * off_m <= settings.gate * variance_m2;
        let sd_m = math::sqrt(variance_m2);
        Some(self.trusts(&CableReading { at, shown_m, off_m, sd_m, agrees, is_usual, is_lively }, errors))
    }

    /// Corrects by a counter reading, and records how much the estimate changes.
    pub(super) fn correct_by_counter(&mut self, row: &ScalarUpdate, known: &Errors, errors: &mut Errors) {
        let along = |eskf: &Self, errors: &Errors| {
            [POSITION, VELOCITY].map(|i| [errors.get(i).copied().unwrap_or(0.0), eskf.factors.variance(i)])
        };
        let [before_p, before_v] = along(self, errors);
        self.correct(row, known, errors);
        let [after_p, after_v] = along(self, errors);
        let by = [after_p[0] - before_p[0], after_v[0] - before_v[0]];
        self.cable.corrections.note(by, [before_p[1] - after_p[1], before_v[1] - after_v[1]]);
    }

    /// Judges a cable reading; returns whether to fuse it. A length that the counter has lost is added to the
    /// creep.
    fn trusts(&mut self, reading: &CableReading, errors: &mut Errors) -> bool {
        let used = self.cable.take(reading);
        self.slipped_m2 += self.cable.corrections.take_slipped_m2();
        match used {
            Use::Fuse => return true,
            Use::Withhold => {}
            Use::Dispute(corrections) => {
                for (i, by) in [POSITION, VELOCITY].into_iter().zip(corrections) {
                    add_to(errors, i, -by);
                    add_to(&mut self.doubts, i, by * by);
                }
                self.ties += 1;
            }
            Use::Slipped(lost_m) => {
                self.slack_level.skip();
                // The estimated position does not change, so that later soundings fit those placed during the
                // dispute.
                add_to(errors, CREEP, lost_m);
                add_to(&mut self.doubts, CREEP, lost_m * lost_m);
                // Either the counter has lost this length, or the estimated motion was wrong during the dispute.
                self.slipped_m2 += (lost_m * lost_m).max(reading.sd_m * reading.sd_m);
                self.ties += 1;
            }
            Use::Seek(lacking_m) => {
                self.way_sought = Some(reading.at);
                self.slack_level.skip();
                self.slipped_m2 += lacking_m * lacking_m;
                add_to(&mut self.doubts, CREEP, lacking_m * lacking_m);
                agreement::seek_way(&mut self.doubts);
                self.ties += 1;
            }
        }
        false
    }
}
