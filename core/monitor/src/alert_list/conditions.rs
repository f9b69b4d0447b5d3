//! Checks the conditions of all alerts at each advice update.

use super::alert::{AlertChange, AlertState, Figures};
use super::kind::{ListKind, Priority};
use super::life_cycle::AlertOutputs;
use super::list::AlertList;
use super::timer::{self, Due};
use crate::live_state::condition::Condition;
use crate::live_state::state::{
    ActiveObservation, LiveState, OLD_AFTER, PositionDoubt, PositionState, SensorState,
};
use crate::observations::{Observations, ObservedKind};
use crate::pilot_text::AdviceFigures;
use headrace_coverage::Unsure;
use headrace_fusion::filter::setting_check::SettingDoubt;
use headrace_geometry::time::{DurNs, MonoNs};
use headrace_sensor::reading::SourceId;

/// Grace period after the first advice update. Data or positions that haven't arrived by the end of this period count
/// as missing.
const GRACE: DurNs = DurNs(30_000_000_000);
/// Time for which the alerts `CannotSay` and `ComputerStalled` stay active after their situation last occurred.
const GROWS: DurNs = DurNs(10_000_000_000);
/// Three limits of the remaining cable, time and charge, percent. At or below the first, a warning is raised, at or
/// below the second an alarm, at or below the third an emergency alarm.
///
/// A negative limit means that more than the whole cable or time is used up.
const CABLE_PCT: [f64; 3] = [10.0, 5.0, -1.0];
const TIME_PCT: [f64; 3] = [10.0, 0.0, -1.0];
const BATTERY_PCT: [f64; 3] = [20.0, 10.0, 5.0];
/// Dead band, percent. The alert ends only if the remaining amount rises above the warning's limit by more than this
/// band.
const MORE_PCT: f64 = 2.0;

/// An advice update, with the live state at that time.
pub(crate) struct AdviceUpdate<'a> {
    pub(crate) at: MonoNs,
    /// Live state whose `now` is the time of the advice update.
    pub(crate) state: &'a LiveState,
    pub(crate) setting: Option<SettingDoubt>,
    /// Whether the heads' pitch and yaw on their mounts are not verified yet.
    pub(crate) unverified_mounts: bool,
}

/// Result of checking a condition: whether the condition holds.
pub(super) struct Seen {
    pub(super) kind: ListKind,
    pub(super) source: Option<SourceId>,
    pub(super) holds: bool,
    pub(super) figures: Figures,
}

impl Seen {
    pub(super) fn of(kind: ListKind, holds: bool, figures: Figures) -> Self {
        Self { kind, source: None, holds, figures }
    }
}

impl AlertList {
    /// Checks all conditions at an advice update.
    pub(crate) fn update(&mut self, update: &AdviceUpdate<'_>, to: &mut AlertOutputs<'_>) {
        let AdviceUpdate { at, state, .. } = *update;
        let begun = *self.begun.get_or_insert(at);
        self.v_max_mps = state.v_max_mps().unwrap_or(0.0);
        self.x_m = state.chainage_m;
        self.had.position |= !matches!(state.position, PositionState::None(_));
        self.had.sure_position |= state.position == PositionState::Ok;
        self.had.turning |= state.turning;
        self.had.sonar |= state.has_sonar() && state.turning != 0;
        self.take_speed(update, to);
        self.take_position(update, begun, to);
        self.take_unsure(update, to);
        self.take_observations(update, to);
        self.take_sensors(at, state, to);
        self.take_left(at, state, to);
        self.take_recording(at, to);
        self.take_stall(at, to);
    }

    /// Checks sensors and remaining resources while no sensor delivers data.
    ///
    /// `state` is the live state of the last advice update, with `now` set to `at`.
    pub(crate) fn time(&mut self, at: MonoNs, state: &LiveState, to: &mut AlertOutputs<'_>) {
        self.take_sensors(at, state, to);
        if self.begun.is_some() {
            self.take_left(at, state, to);
        }
        self.take_recording(at, to);
        self.take_stall(at, to);
    }

    /// Records whether a log recording fails.
    pub(crate) fn set_recording(&mut self, fails: bool, at: MonoNs, to: &mut AlertOutputs<'_>) {
        self.recording_fails = fails;
        self.take_recording(at, to);
    }

    /// Records that the computer stalled for some seconds until `at`.
    pub(crate) fn set_stalled(&mut self, seconds: u32, at: MonoNs, to: &mut AlertOutputs<'_>) {
        self.stalled = Some((at, seconds));
        self.take_stall(at, to);
    }

    fn take_stall(&mut self, at: MonoNs, to: &mut AlertOutputs<'_>) {
        let last = self.stalled.filter(|(ended, _)| at.since(*ended).0 <= GROWS.0);
        let figures = last.map_or(Figures::None, |(_, seconds)| Figures::Stalled(seconds));
        self.observe(at, &Seen::of(ListKind::ComputerStalled, last.is_some(), figures), to);
    }

    /// Records the charge of the vehicle's battery, percent.
    pub(crate) fn set_battery(&mut self, battery_pct: f64) {
        self.battery_pct = Some(battery_pct);
    }

    fn take_recording(&mut self, at: MonoNs, to: &mut AlertOutputs<'_>) {
        let seen = Seen::of(ListKind::NotRecorded, self.recording_fails, Figures::None);
        self.observe(at, &seen, to);
    }

    /// Whether data or positions that have not arrived yet are overdue.
    fn is_late(&self, at: MonoNs) -> bool {
        self.begun.is_some_and(|begun| at.since(begun).0 >= GRACE.0)
    }

    fn take_speed(&mut self, update: &AdviceUpdate<'_>, to: &mut AlertOutputs<'_>) {
        let AdviceUpdate { at, state, .. } = *update;
        let condition = state.condition();
        let speed_mps = state.speed_mps.unwrap_or(0.0);
        let figures = state
            .advice
            .as_ref()
            .map_or(Figures::None, |advice| Figures::Advice(AdviceFigures::of(advice, speed_mps)));
        // Slightly over v_max the alert neither begins nor ends, because that range of speeds is the alert's
        // dead band.
        let is_over = condition == Condition::Over && self.is_active(ListKind::TooFast, None);
        let too_fast = condition == Condition::TooFast || is_over;
        self.observe(at, &Seen::of(ListKind::TooFast, too_fast, figures), to);
        self.observe(at, &Seen::of(ListKind::NoSpeed, condition == Condition::NoSpeed, figures), to);
        self.observe(at, &Seen::of(ListKind::TurnFails, condition == Condition::TurnFails, figures), to);
    }

    fn take_position(&mut self, update: &AdviceUpdate<'_>, begun: MonoNs, to: &mut AlertOutputs<'_>) {
        let AdviceUpdate { at, state, .. } = *update;
        let (is_missing, figures) = match state.position {
            PositionState::None(no_fix) => (true, Figures::MissingRequirement(no_fix)),
            _ => (false, Figures::None),
        };
        // Navigation needs time to align before it gives the first position.
        let is_late = at.since(begun).0 >= GRACE.0;
        let is_missing = is_missing && (self.had.position || is_late);
        self.observe(at, &Seen::of(ListKind::NoPosition, is_missing, figures), to);
        let is_spread = state.position == PositionState::Doubtful(PositionDoubt::Spread)
            && (self.had.sure_position || is_late);
        let error = Figures::Error(state.target.error_m(state.pass_sd_m), state.stand_s > 0);
        self.observe(at, &Seen::of(ListKind::PositionDoubtful, is_spread, error), to);
    }

    fn take_unsure(&mut self, update: &AdviceUpdate<'_>, to: &mut AlertOutputs<'_>) {
        let AdviceUpdate { at, state, .. } = *update;
        // Stretches at the ends of the coverage extent (the tunnel that the vehicle has visited) are reported
        // once the vehicle has left them.
        let now = state.unsure.filter(|stretch| stretch.why != Unsure::NotInspected);
        let before = self.had.unsure;
        if now.is_some() && now != before.map(|(stretch, _)| stretch) {
            self.had.unsure = now.map(|stretch| (stretch, at));
        }
        let Some((stretch, grown)) = self.had.unsure else { return };
        let grows = at.since(grown).0 < GROWS.0;
        self.observe(at, &Seen::of(ListKind::CannotSay, grows, Figures::CannotSay(stretch)), to);
    }

    /// Checks the observations about the dive as a whole.
    fn take_observations(&mut self, update: &AdviceUpdate<'_>, to: &mut AlertOutputs<'_>) {
        let AdviceUpdate { at, state, setting, unverified_mounts } = *update;
        let unverified = unverified_mounts && self.is_late(at);
        self.observe(at, &Seen::of(ListKind::MountsUnverified, unverified, Figures::None), to);
        let active = |kind: ListKind, source: Option<SourceId>| {
            let is_it =
                |known: &&ActiveObservation| ListKind::from(known.kind) == kind && known.source == source;
            state.observations.iter().flatten().find(is_it).copied()
        };
        for kind in ObservedKind::ALL.map(ListKind::from) {
            let of_none = (!kind.is_of_sensor()).then_some(None);
            let sources = if kind.may_name_a_sensor() { usize::from(state.sources) } else { 0 };
            let of_sensors = (0..).take(sources).map(|number| Some(SourceId(number)));
            for source in of_none.into_iter().chain(of_sensors) {
                let found = active(kind, source);
                let figures = match (found, setting) {
                    (Some(known), Some(doubt)) if kind == ListKind::SettingDoubted => {
                        Figures::Setting(doubt, known.occurrences)
                    }
                    (Some(known), _) => Figures::Deviation(known.occurrences),
                    (None, _) => Figures::None,
                };
                self.observe(at, &Seen { kind, source, holds: found.is_some(), figures }, to);
            }
        }
    }

    /// Adds alerts for the observations made at the end of a dive, without a hold time.
    ///
    /// If an observation has an alert already, only the alert's figures change.
    pub(crate) fn take_observations_at_end(
        &mut self,
        observations: &Observations,
        at: MonoNs,
        to: &mut AlertOutputs<'_>,
    ) {
        let is_made_at_end = |kind: ObservedKind| {
            matches!(kind, ObservedKind::OutsideTunnel | ObservedKind::ProfileContradicted)
        };
        for known in observations.iter().filter(|known| is_made_at_end(known.kind)) {
            let (kind, figures) = (ListKind::from(known.kind), Figures::Deviation(known.occurrences));
            if let Some(alert) = self.alerts.iter_mut().rfind(|alert| alert.kind == kind) {
                alert.figures = figures;
            } else {
                self.raise(kind, None, (at, figures), None, to);
            }
        }
    }

    fn take_sensors(&mut self, at: MonoNs, state: &LiveState, to: &mut AlertOutputs<'_>) {
        let is_late = self.is_late(at);
        let sources = || (0_u16..).take(usize::from(state.sources));
        let heard = |source: u16| state.heard.get(usize::from(source)).copied().flatten();
        let is_silent =
            |source: u16| matches!(state.sensor(source.into()), SensorState::Never | SensorState::Silent);
        // The silence of all sensors is a single situation with one alert, not one alert per sensor.
        let all_silent = state.sources > 0 && sources().all(is_silent);
        self.observe(at, &Seen::of(ListKind::NoData, all_silent, Figures::None), to);
        // A sensor is silent if it delivers nothing while another sensor does.
        let newest = sources().filter_map(heard).max();
        for source in sources() {
            let holds = match (heard(source), newest) {
                (Some(heard), Some(newest)) => newest.since(heard).0 > OLD_AFTER.0,
                (None, _) => is_late && !all_silent,
                (Some(_), None) => false,
            };
            let withheld = state.withheld(source.into());
            let is_withheld = state.sensor(source.into()) == SensorState::Withheld;
            // A device that has just been switched on may need some time, as long as other sensors deliver data.
            let is_due = heard(source).is_some() || is_late || newest.is_none();
            let (kind, source) = (ListKind::SensorSilent, Some(SourceId(source)));
            let holds = holds && !is_withheld;
            self.observe(at, &Seen { kind, source, holds, figures: Figures::None }, to);
            let (kind, holds) = (ListKind::SensorWithheld, is_withheld && is_due);
            let figures = withheld.map_or(Figures::None, Figures::Withheld);
            self.observe(at, &Seen { kind, source, holds, figures }, to);
        }
        let is_head = |source: &u16| state.heads.checked_shr((*source).into()).unwrap_or(0) & 1 == 1;
        for number in sources().filter(is_head) {
            let has_turned = self.had.turning.checked_shr(number.into()).unwrap_or(0) & 1 == 1;
            let stalled = state.sensor(number.into()) == SensorState::Stalled && (has_turned || is_late);
            let (kind, source) = (ListKind::SensorStalled, Some(SourceId(number)));
            self.observe(at, &Seen { kind, source, holds: stalled, figures: Figures::None }, to);
        }
        for number in sources() {
            for (kind, of) in
                [(ListKind::SensorDeaf, SensorState::Deaf), (ListKind::SensorHung, SensorState::Hung)]
            {
                let (source, holds) = (Some(SourceId(number)), state.sensor(number.into()) == of);
                self.observe(at, &Seen { kind, source, holds, figures: Figures::None }, to);
            }
        }
        let no_sonar = state.heads != 0
            && (!state.has_sonar() || state.turning == 0)
            && !all_silent
            && (self.had.sonar || is_late);
        self.observe(at, &Seen::of(ListKind::NoSonar, no_sonar, Figures::None), to);
    }

    /// Checks the remaining cable, time and charge.
    fn take_left(&mut self, at: MonoNs, state: &LiveState, to: &mut AlertOutputs<'_>) {
        let cable = self.cable_left_m(state.chainage_m).zip(self.limits.cable_m);
        let time = self.time_left_s(at).zip(self.limits.dive_time.map(DurNs::as_secs_f64));
        let battery = self.battery_pct.map(|pct| (pct, 100.0));
        self.observe_left(at, ListKind::CableLeft, cable, CABLE_PCT, to);
        self.observe_left(at, ListKind::TimeLeft, time, TIME_PCT, to);
        self.observe_left(at, ListKind::BatteryLeft, battery, BATTERY_PCT, to);
    }

    fn observe_left(
        &mut self,
        at: MonoNs,
        kind: ListKind,
        left: Option<(f64, f64)>,
        little_pct: [f64; 3],
        to: &mut AlertOutputs<'_>,
    ) {
        let Some((left, all)) = left else { return };
        let share_pct = 100.0 * left / all;
        let [warning, alarm, emergency] = little_pct;
        let more_pct = if self.is_active(kind, None) { MORE_PCT } else { 0.0 };
        self.observe(at, &Seen::of(kind, share_pct <= warning + more_pct, Figures::Left(left)), to);
        let number = self.timers.get(timer::place(kind, None)).map_or(0, |timer| timer.number);
        for (limit, priority) in [(emergency, Priority::EmergencyAlarm), (alarm, Priority::Alarm)] {
            if share_pct <= limit {
                self.set_priority(number, priority, at, to);
                return;
            }
        }
    }

    /// Length of cable left beyond the vehicle's chainage, m; `None` if the cable's length or the chainage is unknown.
    pub(super) fn cable_left_m(&self, x_m: Option<f64>) -> Option<f64> {
        self.limits.cable_m.zip(x_m).map(|(cable_m, x_m)| cable_m - x_m.max(0.0))
    }

    /// Remaining dive time, seconds; `None` if the dive's duration is unlimited.
    pub(crate) fn time_left_s(&self, at: MonoNs) -> Option<f64> {
        Some((self.limits.dive_time? - self.clock.time(at)).as_secs_f64())
    }

    fn is_active(&self, kind: ListKind, source: Option<SourceId>) -> bool {
        self.timers.get(timer::place(kind, source)).is_some_and(|timer| timer.number != 0)
    }

    /// Updates the timer of a situation, and raises or ends the situation's alert when due.
    pub(super) fn observe(&mut self, at: MonoNs, seen: &Seen, to: &mut AlertOutputs<'_>) {
        let Seen { kind, source, holds, figures } = *seen;
        let place = timer::place(kind, source);
        let timing = self.timing.of(kind.class());
        let Some(timer) = self.timers.get_mut(place) else { return };
        let number = timer.number;
        match timer.take(at, holds, timing.hold, timing.off) {
            Due::Raise => {
                let number = self.raise_or_hold_again(kind, source, (at, figures), to);
                if let Some(timer) = self.timers.get_mut(place) {
                    timer.number = number;
                }
            }
            Due::End => {
                if let Some(timer) = self.timers.get_mut(place) {
                    timer.number = 0;
                }
                self.rectify(number, at, to);
            }
            Due::GoesOn => self.change_figures(number, figures, to, at),
            Due::Nothing => {}
        }
    }

    /// Raises an alert. If the situation has an alert that nobody has acknowledged yet, reactivates that
    /// alert instead.
    fn raise_or_hold_again(
        &mut self,
        kind: ListKind,
        source: Option<SourceId>,
        (at, figures): (MonoNs, Figures),
        to: &mut AlertOutputs<'_>,
    ) -> u32 {
        let stretch = figures.stretch();
        let waits =
            self.alerts.iter().rev().find(|alert| {
                (alert.kind, alert.source, alert.state) == (kind, source, AlertState::Rectified)
            });
        let Some(number) = waits.map(|alert| alert.number) else {
            return self.raise(kind, source, (at, figures), stretch, to);
        };
        if let Some(alert) = self.get_mut(number) {
            alert.figures = alert.figures.and_then(figures, kind);
            alert.stretch = stretch;
        }
        self.hold_again(number, at, to);
        number
    }

    /// Updates the figures of a continuing alert, and publishes a change of place.
    fn change_figures(&mut self, number: u32, figures: Figures, to: &mut AlertOutputs<'_>, at: MonoNs) {
        let Some(alert) = self.get_mut(number) else { return };
        alert.figures = alert.figures.and_then(figures, alert.kind);
        let stretch = figures.stretch();
        if alert.stretch != stretch {
            alert.stretch = stretch;
            let alert = *alert;
            to.tell(&alert, AlertChange::Changed, at);
        }
    }
}

impl Figures {
    /// Figures of a continuing situation: the present figures, except that the speed is the highest so far.
    ///
    /// Once the pilot has slowed down, the present speed would no longer show by how much the limit was
    /// exceeded.
    fn and_then(self, now: Self, kind: ListKind) -> Self {
        match (self, now) {
            (Self::Advice(before), Self::Advice(figures))
                if kind == ListKind::TooFast && before.speed_mps.abs() > figures.speed_mps.abs() =>
            {
                Self::Advice(AdviceFigures { speed_mps: before.speed_mps, ..figures })
            }
            _ => now,
        }
    }

    fn stretch(&self) -> Option<(i64, i64)> {
        match self {
            Self::CannotSay(stretch) => Some((stretch.from, stretch.to)),
            _ => None,
        }
    }
}
