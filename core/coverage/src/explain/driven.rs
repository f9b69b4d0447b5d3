//! Movement of the vehicle and its heads with some of the present factors removed.

use super::case::HELPS;
use crate::cause::Cause;
use crate::causes::Causes;
use crate::passage::Drive;
use headrace_geometry::math;
use headrace_sampling::losses::MOST_PASSES;

impl Drive {
    /// Largest speed that leaves time for this many passes in place of one, m/s.
    ///
    /// Zero if so many returns are lost that no useful speed remains.
    pub(crate) fn with_losses_mps(&self, passes_needed: f64) -> f64 {
        if passes_needed >= MOST_PASSES {
            return 0.0;
        }
        let turn_s = passes_needed * self.all_gap_s + self.ping_period_s;
        if passes_needed > 1.0 {
            self.fits_mps.min(self.fits_along_m / turn_s.max(1e-9))
        } else {
            self.fits_mps
        }
    }

    /// Returns the driving figures with some factors removed.
    ///
    /// `margin_m` is the target less a margin, m; a corrected speed is computed from it. With `all_turn`, no
    /// head is silent or stalled.
    pub(super) fn without(&self, removed: Causes, margin_m: f64, all_turn: bool) -> Self {
        let mut then = *self;
        let mut slower = 1.0;
        if removed.has(Cause::OutOfRange) {
            slower *= self.other.longer_turn;
        }
        if removed.has(Cause::AngularStep) {
            slower *= self.other.finer_turn;
            then.t_y_m *= self.other.finer_step;
            then.middle_t_y_m *= self.other.finer_step;
        }
        if removed.has(Cause::OffAxis) {
            (then.swing_m, then.t_y_m) = (0.0, then.middle_t_y_m.min(then.t_y_m));
        }
        let is_at_plan = removed.has(Cause::Phase) && self.is_slow_out_of_phase(1.0 / HELPS);
        if is_at_plan {
            then.speed_mps = self.planned_mps;
        }
        let is_slowed = removed.has(Cause::TooFast);
        let gap_s = match (all_turn, removed.has(Cause::Phase), is_slowed || is_at_plan) {
            (true, true, true) => self.all_gap_s,
            (true, true, false) => self.planned_gap_s.min(self.healthy_gap_s),
            (true, false, true) => self.healthy_at_plan_s,
            (false, true, _) => self.left_at_plan_s.min(self.healthy_gap_s),
            (false, false, true) => self.gap_at_plan_s,
            (_, false, false) => self.healthy_gap_s,
        };
        then.healthy_gap_s = slower * gap_s;
        then.ping_period_s *= slower;
        if is_slowed {
            let t_y_m = then.middle_t_y_m;
            let squared = (margin_m - t_y_m) * (margin_m + t_y_m);
            let along_m = math::sqrt(squared.max(0.0)).max(0.3 * margin_m);
            let fits = along_m / (then.speed_mps * slower * self.all_gap_s + then.advance_m()).max(1e-9);
            // Advised speeds allow for wall that the vehicle hides.
            let advised = if self.fits_mps > 0.0 { self.fits_mps / then.speed_mps.max(1e-9) } else { 1.0 };
            then.speed_mps *= fits.min(advised).min(1.0);
        }
        then
    }
}
