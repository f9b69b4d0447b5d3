//! Life cycle of an alert: the effect of each event on its state.

use super::alert::{Acknowledgement, AlertChange, AlertState, Figures, ListedAlert};
use super::kind::{ListKind, Priority};
use super::list::{AlertList, MOST_LISTED, SILENCE};
use crate::console::command::Who;
use crate::messages::Notice;
use crate::result_stream::{RecordKind, ResultStream};
use crate::unread::WithheldReadings;
use headrace_geometry::time::MonoNs;
use headrace_sensor::reading::SourceId;

/// Context for publishing changes of alerts.
pub(crate) struct AlertOutputs<'a> {
    pub(crate) notices: &'a mut Vec<Notice>,
    pub(crate) stream: &'a mut ResultStream,
}

impl AlertOutputs<'_> {
    /// Publishes a change of an alert. Allocates: never.
    ///
    /// The digest includes the change even if the list of notices is full.
    pub(super) fn tell(&mut self, alert: &ListedAlert, change: AlertChange, at: MonoNs) {
        digest(self.stream, alert, change, at);
        if self.notices.len() < self.notices.capacity() {
            self.notices.push(Notice::Listed { change, at, alert: *alert });
        }
    }
}

fn digest(stream: &mut ResultStream, alert: &ListedAlert, change: AlertChange, at: MonoNs) {
    let (from, to) = alert.stretch.unwrap_or((i64::MIN, i64::MIN));
    stream
        .record(RecordKind::AlertChange)
        .integer(at.0)
        .integer(alert.number.into())
        .integer(change as u64)
        .integer(alert.kind as u64)
        .integer(alert.priority as u64)
        .integer(alert.state as u64)
        .integer(alert.source.map_or(u64::MAX, |source| source.0.into()))
        .integer(alert.count.into())
        .integer(alert.acknowledged.map_or(u64::MAX, |by| by.at.0))
        .text(alert.acknowledged.as_ref().map_or("", |by| by.by.as_str()))
        .integer(alert.silenced_until.map_or(u64::MAX, |until| until.0))
        .integer(from.cast_unsigned())
        .integer(to.cast_unsigned())
        .number(alert.x_m.unwrap_or(0.0))
        .number(alert.figures.first());
}

impl Figures {
    /// The one figure that represents the alert in digests of results.
    fn first(&self) -> f64 {
        match *self {
            Self::None => 0.0,
            Self::Missed(_, _, at_most_mps) => at_most_mps,
            Self::CannotSay(stretch) => stretch.largest().hole_m[0],
            Self::Advice(figures) => figures.speed_mps,
            Self::MissingRequirement(no_fix) => f64::from(no_fix as u8),
            Self::Error(figure, _) | Self::Left(figure) => figure,
            Self::Stalled(count) | Self::Withheld(WithheldReadings { count, .. }) => f64::from(count),
            Self::Deviation(occurrences) => occurrences.worst_m,
            Self::Setting(doubt, _) => doubt.setting.figure(),
        }
    }
}

impl AlertList {
    /// Adds a new alert. Returns its number.
    pub(super) fn raise(
        &mut self,
        kind: ListKind,
        source: Option<SourceId>,
        (at, figures): (MonoNs, Figures),
        stretch: Option<(i64, i64)>,
        to: &mut AlertOutputs<'_>,
    ) -> u32 {
        self.make_room(at, to);
        self.raised += 1;
        let alert = ListedAlert {
            number: self.raised,
            kind,
            priority: kind.priority(),
            state: AlertState::Active,
            since: at,
            rectified: None,
            cleared: None,
            acknowledged: None,
            silenced_until: None,
            source,
            stretch,
            x_m: self.x_m.filter(|_| stretch.is_none()),
            count: 1,
            open_runs: u32::from(kind == ListKind::Missed),
            merged_into: None,
            figures,
        };
        // `make_room` has freed an entry of the alert list.
        if self.alerts.len() < self.alerts.capacity() {
            self.alerts.push(alert);
        }
        to.tell(&alert, AlertChange::Raised, at);
        alert.number
    }

    /// Makes room in a full list: drops the oldest cleared alert. If no alert is cleared, first merges the newest
    /// missed stretch into another alert.
    fn make_room(&mut self, at: MonoNs, to: &mut AlertOutputs<'_>) {
        if self.alerts.len() < MOST_LISTED {
            return;
        }
        if self.alerts.iter().all(ListedAlert::is_live) {
            self.share_one(at, to);
        }
        let oldest = self.alerts.iter().position(|alert| !alert.is_live());
        // If the list has fewer than two missed stretches, nothing can be merged. Then the oldest caution is
        // dropped, because cautions are the least urgent alerts.
        let oldest =
            oldest.or_else(|| self.alerts.iter().position(|alert| alert.priority == Priority::Caution));
        if let Some(oldest) = oldest {
            self.alerts.remove(oldest);
            self.dropped += 1;
        }
    }

    /// Reactivates an alert whose condition holds again before anybody has acknowledged it, and counts the
    /// occurrence.
    pub(super) fn hold_again(&mut self, number: u32, at: MonoNs, to: &mut AlertOutputs<'_>) {
        let Some(alert) = self.get_mut(number) else { return };
        (alert.state, alert.rectified) = (AlertState::Active, None);
        alert.count += 1;
        let alert = *alert;
        to.tell(&alert, AlertChange::Raised, at);
    }

    /// Marks that an alert's condition no longer holds.
    pub(super) fn rectify(&mut self, number: u32, at: MonoNs, to: &mut AlertOutputs<'_>) {
        let Some(alert) = self.get_mut(number).filter(|alert| alert.state == AlertState::Active) else {
            return;
        };
        alert.rectified = Some(at);
        let change = if alert.needs_acknowledgement() {
            alert.state = AlertState::Rectified;
            AlertChange::Rectified
        } else {
            (alert.state, alert.cleared) = (AlertState::Cleared, Some(at));
            AlertChange::Cleared
        };
        let alert = *alert;
        to.tell(&alert, change, at);
    }

    /// Acknowledges the alert with this number, or all alerts with 0. Returns false if there was nothing to
    /// acknowledge.
    pub(crate) fn acknowledge(
        &mut self,
        number: u32,
        by: Who,
        at: MonoNs,
        to: &mut AlertOutputs<'_>,
    ) -> bool {
        let mut any = false;
        let is_meant = |alert: &&mut ListedAlert| number == 0 || alert.number == number;
        for alert in self.alerts.iter_mut().filter(is_meant).filter(|alert| alert.needs_acknowledgement()) {
            any = true;
            alert.acknowledged = Some(Acknowledgement { by, at });
            alert.silenced_until = None;
            let is_over = alert.state == AlertState::Rectified;
            if is_over {
                (alert.state, alert.cleared) = (AlertState::Cleared, Some(at));
            }
            to.tell(alert, if is_over { AlertChange::Cleared } else { AlertChange::Acknowledged }, at);
        }
        any
    }

    /// Silences all sounding alerts. Returns false if none sounded.
    pub(crate) fn silence(&mut self, at: MonoNs, to: &mut AlertOutputs<'_>) -> bool {
        let mut any = false;
        for alert in self.alerts.iter_mut().filter(|alert| alert.sounds(at)) {
            any = true;
            alert.silenced_until = Some(at + SILENCE);
            to.tell(alert, AlertChange::Silenced, at);
        }
        any
    }

    /// Raises the priority of an alert, which must then be acknowledged again.
    pub(super) fn set_priority(
        &mut self,
        number: u32,
        priority: Priority,
        at: MonoNs,
        to: &mut AlertOutputs<'_>,
    ) {
        let Some(alert) = self.get_mut(number).filter(|alert| alert.priority < priority) else { return };
        alert.priority = priority;
        (alert.acknowledged, alert.silenced_until) = (None, None);
        let alert = *alert;
        to.tell(&alert, AlertChange::Changed, at);
    }
}
