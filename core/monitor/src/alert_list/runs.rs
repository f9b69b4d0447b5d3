//! Alerts for missed stretches, one for each. If two stretches merge, their alerts merge, too.

use super::alert::{AlertChange, AlertState, Figures, ListedAlert};
use super::kind::ListKind;
use super::life_cycle::AlertOutputs;
use super::list::AlertList;
use crate::pilot_text::CauseFigures;
use headrace_coverage::{RunChange, RunId, Sections};
use headrace_geometry::time::MonoNs;

/// A missed stretch that a judgement has changed, with its figures after the change.
#[derive(Debug, Clone, Copy)]
pub(crate) struct RunInput {
    /// Index of the event at which the stretch was judged. If it was judged at an advice update: index of the
    /// event after the update.
    pub(crate) event: usize,
    /// Whether the stretch was judged at an advice update before the event with the index `event`.
    pub(crate) at_update: bool,
    pub(crate) at: MonoNs,
    pub(crate) id: RunId,
    pub(crate) change: RunChange,
    pub(super) stretch: (i64, i64),
    /// Causes of the miss, and arc length of the stretch's largest hole, m.
    pub(super) causes: Option<(CauseFigures, f64)>,
    pub(super) merged_into: Option<RunId>,
}

impl RunInput {
    /// Alert input for a missed stretch that a judgement has changed; `None` if there is no such stretch.
    pub(crate) fn of(
        (event, at_update): (usize, bool),
        at: MonoNs,
        (id, change): (RunId, RunChange),
        sections: &Sections,
    ) -> Option<Self> {
        let run = sections.runs().get(id)?;
        let causes = CauseFigures::of_run(sections, run).map(|figures| (figures, run.worst.1.arc_m));
        let stretch = (run.from, run.to);
        Some(Self { event, at_update, at, id, change, stretch, causes, merged_into: run.merged_into })
    }
}

impl AlertList {
    /// Applies a changed missed stretch to the alert list.
    pub(crate) fn take_run(&mut self, input: &RunInput, to: &mut AlertOutputs<'_>) {
        let at = input.at;
        match input.change {
            RunChange::Raised => self.raise_run(input, to),
            RunChange::Changed => {
                let number = self.alert_of(input.id);
                self.widen(number, input, to);
            }
            RunChange::Cleared => {
                let number = self.alert_of(input.id);
                self.set_alert_of(input.id, 0);
                self.close_run(number, at, to);
            }
            RunChange::Merged => self.merge_runs(input, to),
        }
    }

    fn alert_of(&self, id: RunId) -> u32 {
        self.by_run.get(id.0 as usize).copied().unwrap_or(0)
    }

    fn set_alert_of(&mut self, id: RunId, number: u32) {
        // The capacity of `by_run` suffices, because there are no more missed stretches than sections.
        while self.by_run.len() <= id.0 as usize && self.by_run.len() < self.by_run.capacity() {
            self.by_run.push(0);
        }
        if let Some(slot) = self.by_run.get_mut(id.0 as usize) {
            *slot = number;
        }
    }

    fn raise_run(&mut self, input: &RunInput, to: &mut AlertOutputs<'_>) {
        let v_max_mps = self.v_max_mps;
        let figures =
            input.causes.map_or(Figures::None, |(causes, arc_m)| Figures::Missed(causes, arc_m, v_max_mps));
        // If a later pass has split this stretch off from a longer one, the alert of the longer stretch covers
        // it.
        let (from, until) = input.stretch;
        let has = |alert: &&ListedAlert| {
            alert.kind == ListKind::Missed
                && alert.is_live()
                && alert.stretch.is_some_and(|(of, to)| of <= from && until <= to)
        };
        let number = if let Some(known) = self.alerts.iter_mut().rfind(|alert| has(&&**alert)) {
            known.figures = figures;
            known.open_runs += 1;
            let (number, state) = (known.number, known.state);
            if state == AlertState::Rectified {
                self.hold_again(number, input.at, to);
            }
            number
        } else {
            self.raise(ListKind::Missed, None, (input.at, figures), Some(input.stretch), to)
        };
        self.set_alert_of(input.id, number);
    }

    /// Adapts an alert to a missed stretch that has grown. If the alert has no other stretch, the alert also shrinks
    /// with this stretch.
    ///
    /// If a later pass splits a stretch in two, one alert covers both parts.
    fn widen(&mut self, number: u32, input: &RunInput, to: &mut AlertOutputs<'_>) {
        let Some(alert) = self.get_mut(number) else { return };
        let (from, until) = alert.stretch.unwrap_or(input.stretch);
        let wide = if alert.open_runs == 1 {
            input.stretch
        } else {
            (from.min(input.stretch.0), until.max(input.stretch.1))
        };
        let is_wider = from > wide.0 || until < wide.1 || alert.stretch.is_none();
        if let (Figures::Missed(causes, arc_m, _), Some((now, hole_m))) = (&mut alert.figures, input.causes)
            && alert.open_runs == 1
        {
            (*causes, *arc_m) = (now, hole_m);
        }
        alert.stretch = Some(wide);
        let alert = *alert;
        if is_wider {
            to.tell(&alert, AlertChange::Changed, input.at);
        }
    }

    fn close_run(&mut self, number: u32, at: MonoNs, to: &mut AlertOutputs<'_>) {
        let Some(alert) = self.get_mut(number) else { return };
        alert.open_runs = alert.open_runs.saturating_sub(1);
        if alert.open_runs == 0 {
            self.rectify(number, at, to);
        }
    }

    /// Merges the alerts of two missed stretches that have merged. The alert with the lower number represents
    /// both stretches.
    fn merge_runs(&mut self, input: &RunInput, to: &mut AlertOutputs<'_>) {
        let Some(into) = input.merged_into else { return };
        let (other, kept) = (self.alert_of(input.id), self.alert_of(into));
        self.set_alert_of(input.id, 0);
        if other == kept {
            // Both stretches already had the same alert.
            if let Some(alert) = self.get_mut(kept) {
                alert.open_runs = alert.open_runs.saturating_sub(1);
            }
            return;
        }
        let (low, high) = (other.min(kept), other.max(kept));
        if low == 0 {
            return;
        }
        self.merge(low, high, input.at, to);
        if let Some(alert) = self.get_mut(low) {
            alert.open_runs = alert.open_runs.saturating_sub(1);
        }
    }

    /// Merges the alert `high` into the alert `low`. The alert `high` ends.
    fn merge(&mut self, low: u32, high: u32, at: MonoNs, to: &mut AlertOutputs<'_>) {
        let Some(gone) = self.get_mut(high) else { return };
        let before = *gone;
        (gone.state, gone.cleared) = (AlertState::Cleared, Some(at));
        (gone.merged_into, gone.open_runs) = (Some(low), 0);
        let gone = *gone;
        for of_run in self.by_run.iter_mut().filter(|number| **number == high) {
            *of_run = low;
        }
        let Some(kept) = self.get_mut(low) else { return };
        let both = kept.stretch.zip(before.stretch);
        kept.stretch = both.map(|(one, other)| (one.0.min(other.0), one.1.max(other.1))).or(kept.stretch);
        kept.count += before.count;
        kept.open_runs += before.open_runs;
        // If either alert still needs acknowledgement, the merged alert needs it, too.
        if before.needs_acknowledgement() {
            (kept.acknowledged, kept.silenced_until) = (None, before.silenced_until);
        }
        if before.state == AlertState::Active {
            (kept.state, kept.rectified) = (AlertState::Active, None);
        }
        let kept = *kept;
        to.tell(&gone, AlertChange::Cleared, at);
        to.tell(&kept, AlertChange::Changed, at);
    }

    /// Merges the newest missed stretch into its nearest neighbour. This frees an entry in a list that is
    /// full of live alerts.
    pub(super) fn share_one(&mut self, at: MonoNs, to: &mut AlertOutputs<'_>) {
        let stretches = || {
            let missed = self.alerts.iter().filter(|alert| alert.kind == ListKind::Missed && alert.is_live());
            missed.filter_map(|alert| Some((alert.number, alert.stretch?)))
        };
        let Some((number, (from, until))) = stretches().next_back() else { return };
        let others = stretches().filter(|(other, _)| *other != number);
        let nearest = others.min_by_key(|(_, (of, to))| (of - until).max(from - to));
        if let Some((nearest, _)) = nearest {
            self.merge(nearest, number, at, to);
        }
    }
}
