use super::conditions::Seen;
use super::*;
use crate::console::Who;
use crate::live_state::ActiveObservation;
use crate::messages::Notice;
use crate::observations::{Observations, ObservedKind};
use crate::result_stream::ResultStream;
use headrace_coverage::{RunChange, RunId};
use headrace_geometry::snapshot::{Restorer, Saver, Stateful as _};
use headrace_geometry::time::{DurNs, MonoNs};
use headrace_sensor::reading::SourceId;
use headrace_vehicle::{AlertTiming, ClassTiming, LimitsConfig};
use proptest::prelude::*;

/// An alert list for a test, and the context in which its changes are published.
struct Bench {
    list: AlertList,
    notices: Vec<Notice>,
    stream: ResultStream,
}

impl Bench {
    fn new(hold_s: f64, off_s: f64) -> Self {
        let timing = ClassTiming { hold: DurNs::from_secs_f64(hold_s), off: DurNs::from_secs_f64(off_s) };
        let all = AlertClass::ALL.into_iter();
        let timing = all.fold(AlertTiming::default(), |all, class| all.with(class, timing));
        Self {
            list: AlertList::new(timing, LimitsConfig::default(), 30_000),
            notices: Vec::with_capacity(100_000),
            stream: ResultStream::default(),
        }
    }

    /// The same alert list after its state has been saved to a snapshot and restored.
    fn restored(self) -> Self {
        let mut saver = Saver::default();
        self.list.save(&mut saver);
        self.stream.save(&mut saver);
        let bytes = saver.finish().unwrap();
        let mut list = AlertList::new(self.list.timing, self.list.limits, 30_000);
        let (mut stream, mut from) = (ResultStream::default(), Restorer::new(&bytes));
        list.restore(&mut from).unwrap();
        stream.restore(&mut from).unwrap();
        Self { list, notices: self.notices, stream }
    }

    fn with<T>(&mut self, act: impl FnOnce(&mut AlertList, &mut AlertOutputs<'_>) -> T) -> T {
        let Self { list, notices, stream } = self;
        act(list, &mut AlertOutputs { notices, stream })
    }

    fn run(&mut self, id: u32, change: RunChange, stretch: (i64, i64), merged_into: Option<u32>) {
        let merged_into = merged_into.map(RunId);
        let causes = None;
        let (at, id) = (MonoNs(u64::from(id) + 1), RunId(id));
        let input = RunInput { event: 0, at_update: false, at, id, change, stretch, causes, merged_into };
        self.with(|list, to| list.take_run(&input, to));
    }
}

/// Events that the random alert test may generate.
#[derive(Debug, Clone, Copy)]
enum Happens {
    /// An advice update, with the conditions that hold.
    AdviceUpdate([bool; 3]),
    AcknowledgeNewest,
    AcknowledgeAll,
    Silence,
    Snapshot,
}

/// One alert kind for each of three priorities. Each kind has a single situation.
const KINDS: [ListKind; 3] = [ListKind::TooFast, ListKind::NotRecorded, ListKind::TurnFails];
const BEAT_MS: u64 = 200;

/// Expected life cycle of one situation's alerts, from the condition's history and the table of
/// MSC.302(87).
#[derive(Debug, Clone, Default)]
struct Oracle {
    history: Vec<(u64, bool)>,
    is_caution: bool,
    /// For each alert: number, state, whether it is acknowledged, time until which it is silenced, and count.
    all: Vec<(u32, &'static str, bool, u64, u32)>,
}

impl Oracle {
    /// Returns for how long the condition has held, and for how long it has been absent, ms.
    ///
    /// Breaks shorter than `least_ms` count as time for which the condition held.
    fn spells_ms(&self, least_ms: u64) -> (Option<u64>, Option<u64>) {
        let now = self.history.last().map_or(0, |(at, _)| *at);
        let off_from = |until: usize| {
            let back = self.history[..until].iter().rev().take_while(|(_, held)| !held);
            back.last().map(|(at, _)| *at)
        };
        let off = off_from(self.history.len()).map(|from| now - from);
        // The first time at which the condition held after the last break that was long enough to count.
        let (mut on, mut break_from) = (None, None);
        for (at, held) in &self.history {
            if *held {
                on = on.or(Some(*at));
                break_from = None;
            } else {
                let from = *break_from.get_or_insert(*at);
                if at - from >= least_ms {
                    on = None;
                }
            }
        }
        (on.map(|from| now - from), off)
    }

    fn update(&mut self, at: u64, holds: bool, (hold_ms, off_ms): (u64, u64), next: &mut u32) {
        self.history.push((at, holds));
        let state = self.all.last().map_or("none", |last| last.1);
        let (on, off) = self.spells_ms(hold_ms);
        match state {
            "active unacknowledged" | "active acknowledged" | "active caution"
                if off.is_some_and(|off| off >= off_ms) =>
            {
                // A condition starts afresh after its alert has ended.
                self.history.clear();
                self.all.last_mut().unwrap().1 =
                    if state == "active unacknowledged" { "rectified unacknowledged" } else { "cleared" };
            }
            "active unacknowledged" | "active acknowledged" | "active caution" => {}
            _ if holds && on.is_some_and(|on| on >= hold_ms) => {
                let active = if self.is_caution { "active caution" } else { "active unacknowledged" };
                if state == "rectified unacknowledged" {
                    let last = self.all.last_mut().unwrap();
                    (last.1, last.4) = (active, last.4 + 1);
                } else {
                    *next += 1;
                    self.all.push((*next, active, false, 0, 1));
                }
            }
            _ => {}
        }
    }

    fn acknowledge(&mut self) {
        let Some(last) = self.all.last_mut() else { return };
        (last.1, last.2, last.3) = match last.1 {
            "active unacknowledged" => ("active acknowledged", true, 0),
            "rectified unacknowledged" => ("cleared", true, 0),
            other => (other, last.2, last.3),
        };
    }

    fn silence(&mut self, at: u64) {
        if let Some(last) =
            self.all.last_mut().filter(|last| last.1 == "active unacknowledged" && last.3 <= at)
        {
            last.3 = at + 30_000;
        }
    }
}

fn happens() -> impl Strategy<Value = Happens> {
    prop_oneof![
        12 => any::<[bool; 3]>().prop_map(Happens::AdviceUpdate),
        6 => Just(Happens::AdviceUpdate([true; 3])),
        6 => Just(Happens::AdviceUpdate([false; 3])),
        1 => Just(Happens::AcknowledgeNewest),
        1 => Just(Happens::AcknowledgeAll),
        1 => Just(Happens::Silence),
        1 => Just(Happens::Snapshot),
    ]
}

proptest! {
    /// After an arbitrary sequence of conditions and operator commands, every alert is in the state that the
    /// table of MSC.302(87) gives.
    #[test]
    fn alert_life_cycle_follows_the_msc_table(
        steps in proptest::collection::vec((happens(), 1usize..8), 1..120),
        hold_ms in prop_oneof![Just(0u64), 200..1500u64],
        off_ms in prop_oneof![Just(0u64), 200..3000u64],
    ) {
        let mut bench = Bench::new(hold_ms as f64 / 1e3, off_ms as f64 / 1e3);
        let mut oracles: [Oracle; 3] = Default::default();
        oracles[2].is_caution = true;
        let (mut now, mut next) = (1000, 0);
        for (step, times) in steps {
            let at = MonoNs(now * 1_000_000);
            match step {
                Happens::AdviceUpdate(holds) => {
                    for _ in 0..times {
                        now += BEAT_MS;
                        let at = MonoNs(now * 1_000_000);
                        for ((kind, holds), oracle) in KINDS.into_iter().zip(holds).zip(&mut oracles) {
                            let seen = Seen::of(kind, holds, Figures::None);
                            bench.with(|list, to| list.observe(at, &seen, to));
                            oracle.update(now, holds, (hold_ms, off_ms), &mut next);
                        }
                    }
                }
                Happens::AcknowledgeNewest => {
                    bench.with(|list, to| list.acknowledge(next.max(1), Who::cut("AB"), at, to));
                    let newest = oracles.iter_mut().find(|oracle| oracle.all.last().is_some_and(|last| last.0 == next));
                    newest.into_iter().for_each(Oracle::acknowledge);
                }
                Happens::AcknowledgeAll => {
                    bench.with(|list, to| list.acknowledge(0, Who::cut("AB"), at, to));
                    oracles.iter_mut().for_each(Oracle::acknowledge);
                }
                Happens::Silence => {
                    bench.with(|list, to| list.silence(at, to));
                    for oracle in &mut oracles {
                        oracle.silence(now);
                    }
                }
                Happens::Snapshot => bench = bench.restored(),
            }
            let now_ns = MonoNs(now * 1_000_000);
            let expected: Vec<_> = oracles.iter().flat_map(|oracle| oracle.all.clone()).collect();
            prop_assert_eq!(bench.list.iter().count(), expected.len());
            for (number, state, acknowledged, silenced, count) in expected {
                let alert = bench.list.get(number).unwrap();
                let found = match (alert.state, alert.priority, alert.acknowledged.is_some()) {
                    (AlertState::Cleared, ..) => "cleared",
                    (AlertState::Rectified, _, false) => "rectified unacknowledged",
                    (AlertState::Active, Priority::Caution, false) => "active caution",
                    (AlertState::Active, _, false) => "active unacknowledged",
                    (AlertState::Active, _, true) => "active acknowledged",
                    (AlertState::Rectified, _, true) => "no such state",
                };
                prop_assert_eq!(found, state, "{:?}", alert);
                prop_assert_eq!(alert.acknowledged.is_some(), acknowledged);
                prop_assert_eq!(alert.count, count);
                prop_assert_eq!(alert.sounds(now_ns), state == "active unacknowledged" && now >= silenced);
                prop_assert_eq!(alert.needs_acknowledgement(), state.ends_with("unacknowledged"));
            }
        }
    }
}

#[test]
fn flickering_speed_raises_one_alert() {
    let mut bench = Bench::new(1.0, 5.0);
    for update in 0..3000_u64 {
        let seen = Seen::of(ListKind::TooFast, update % 3 != 0, Figures::None);
        bench.with(|list, to| list.observe(MonoNs(update * 200_000_000), &seen, to));
    }
    assert_eq!((bench.list.raised(), bench.notices.len()), (1, 1));
    // Without hold time and dead band, the same speeds raise ten alerts a minute.
    let mut bench = Bench::new(0.0, 0.0);
    for update in 0..300_u64 {
        let seen = Seen::of(ListKind::TurnFails, update % 3 != 0, Figures::None);
        bench.with(|list, to| list.observe(MonoNs(update * 200_000_000), &seen, to));
    }
    assert_eq!(bench.list.raised(), 100);
}

#[test]
fn only_existing_unacknowledged_alerts_are_acknowledged() {
    let mut bench = Bench::new(0.0, 0.0);
    let at = MonoNs(7);
    let acknowledge =
        |bench: &mut Bench, number| bench.with(|list, to| list.acknowledge(number, Who::cut("AB"), at, to));
    assert!(!acknowledge(&mut bench, 0) && !acknowledge(&mut bench, 1));
    bench.with(|list, to| list.observe(at, &Seen::of(ListKind::NotRecorded, true, Figures::None), to));
    bench.with(|list, to| list.observe(at, &Seen::of(ListKind::TurnFails, true, Figures::None), to));
    assert!(!acknowledge(&mut bench, 2), "a caution needs no acknowledgement");
    assert!(acknowledge(&mut bench, 1) && !acknowledge(&mut bench, 1) && !acknowledge(&mut bench, 0));
    assert_eq!(bench.list.get(1).unwrap().acknowledged, Some(Acknowledgement { by: Who::cut("AB"), at }));
}

/// The alert names the duration, and ends ten seconds after the stall.
#[test]
fn stall_of_the_computer_is_listed_for_a_while() {
    let mut bench = Bench::new(0.0, 0.0);
    let at = |seconds: u64| MonoNs(seconds * 1_000_000_000);
    let mut state = crate::live_state::test_state();
    let mut active = |seconds: u64, stalled: Option<u32>| {
        state.now = at(seconds);
        let state = &state;
        bench.with(|list, to| match stalled {
            Some(duration) => list.set_stalled(duration, state.now, to),
            None => list.time(state.now, state, to),
        });
        let found = bench.list.iter().find(|alert| alert.kind == ListKind::ComputerStalled);
        found.filter(|alert| alert.state == AlertState::Active).map(|alert| alert.figures)
    };
    assert_eq!(active(3, None), None);
    assert_eq!(active(5, Some(2)), Some(Figures::Stalled(2)));
    assert_eq!((active(15, None), active(16, None)), (Some(Figures::Stalled(2)), None));
}

/// The dive's time begins with its data, however long the program waits for them.
#[test]
fn silence_of_all_sensors_raises_only_one_alert() {
    let mut bench = Bench::new(0.0, 0.0);
    let heard = [None; headrace_sensor::reading::MAX_SOURCES];
    for minutes in 0..90 {
        let now = MonoNs(minutes * 60_000_000_000);
        let mut state = crate::live_state::test_state();
        (state.now, state.at, state.heard) = (now, None, heard);
        bench.with(|list, to| list.time(now, &state, to));
    }
    let kinds: Vec<_> = bench.list.iter().map(|alert| alert.kind).collect();
    assert_eq!((kinds, bench.list.begun), (vec![ListKind::NoData], None));
}

#[test]
fn alert_with_increased_priority_needs_a_new_acknowledgement() {
    let mut bench = Bench::new(0.0, 5.0);
    let mut state = crate::live_state::test_state();
    let mut update = |bench: &mut Bench, at_s: u64, pct: f64| {
        let at = MonoNs(at_s * 1_000_000_000);
        (state.at, state.now) = (Some(at), at);
        bench.list.set_battery(pct);
        bench.with(|list, to| {
            list.update(&AdviceUpdate { at, state: &state, setting: None, unverified_mounts: false }, to);
        });
    };
    let battery = |bench: &Bench| {
        let found = bench.list.iter().find(|alert| alert.kind == ListKind::BatteryLeft);
        found.map(|alert| (alert.priority, alert.needs_acknowledgement()))
    };
    update(&mut bench, 1, 21.0);
    assert_eq!(battery(&bench), None);
    update(&mut bench, 2, 20.0);
    assert_eq!(battery(&bench), Some((Priority::Warning, true)));
    bench.with(|list, to| list.acknowledge(0, Who::cut("AB"), MonoNs(3), to));
    update(&mut bench, 4, 10.0);
    assert_eq!(battery(&bench), Some((Priority::Alarm, true)));
    bench.with(|list, to| list.acknowledge(0, Who::cut("AB"), MonoNs(5), to));
    // The charge rises a little above the alarm's limit and falls back to it.
    update(&mut bench, 6, 11.0);
    update(&mut bench, 7, 10.0);
    assert_eq!(battery(&bench), Some((Priority::Alarm, false)));
    update(&mut bench, 8, 4.0);
    assert_eq!(battery(&bench), Some((Priority::EmergencyAlarm, true)));
}

/// A dive begins with unverified mounts. The vehicle may swing during the first 30 s. After that, the alert asks for a
/// swing.
#[test]
fn unverified_mounts_raise_a_caution_after_the_grace_period_until_they_are_verified() {
    let mut bench = Bench::new(0.0, 0.0);
    let mut state = crate::live_state::test_state();
    let mut update = |at_s: u64, unverified_mounts: bool| {
        let at = MonoNs(at_s * 1_000_000_000);
        (state.at, state.now) = (Some(at), at);
        bench.with(|list, to| {
            list.update(&AdviceUpdate { at, state: &state, setting: None, unverified_mounts }, to);
        });
        let found = bench.list.iter().find(|alert| alert.kind == ListKind::MountsUnverified);
        found.map(|alert| (alert.priority, alert.state == AlertState::Active))
    };
    assert_eq!((update(1, true), update(30, true)), (None, None));
    assert_eq!(
        (update(31, true), update(90, true)),
        (Some((Priority::Caution, true)), Some((Priority::Caution, true)))
    );
    assert_eq!(update(91, false), Some((Priority::Caution, false)));
}

/// Later occurrences only update the figures of the active alert. They publish no notice.
#[test]
fn later_occurrences_update_the_alert_figures_and_publish_no_notice() {
    let mut bench = Bench::new(0.0, 5.0);
    let mut state = crate::live_state::test_state();
    let mut update = |bench: &mut Bench, at: MonoNs, occurrences: Occurrences| {
        let kind = ObservedKind::ProfileContradicted;
        state.observations[0] = Some(ActiveObservation { kind, source: None, occurrences });
        (state.at, state.now) = (Some(at), at);
        bench.with(|list, to| {
            list.update(&AdviceUpdate { at, state: &state, setting: None, unverified_mounts: false }, to);
        });
    };
    let first = Occurrences { count: 1, first_m: 7.0, worst_m: 0.4 };
    update(&mut bench, MonoNs(1_000_000_000), first);
    let (notices, digest) = (bench.notices.len(), bench.stream.value());
    let second = Occurrences { count: 2, worst_m: 0.5, ..first };
    update(&mut bench, MonoNs(1_200_000_000), second);
    let alert = bench.list.iter().find(|alert| alert.kind == ListKind::ProfileContradicted).unwrap();
    assert_eq!(alert.figures, Figures::Deviation(second));
    assert_eq!((bench.notices.len(), bench.stream.value()), (notices, digest));
}

#[test]
fn contradiction_found_at_the_end_of_a_dive_raises_one_alert() {
    let mut bench = Bench::new(1.0, 5.0);
    let (mut observations, at) = (Observations::default(), MonoNs(9));
    let first = Occurrence { x_m: 7.0, off_m: 0.4 };
    observations.note(ObservedKind::ProfileContradicted, at, first);
    observations.note_of(Some(SourceId(1)), ObservedKind::HeadConstant, at, first);
    for (count, worst_m) in [(1, 0.4), (2, 0.5)] {
        bench.with(|list, to| list.take_observations_at_end(&observations, at, to));
        let alerts: Vec<_> =
            bench.list.iter().map(|alert| (alert.kind, alert.since, alert.figures)).collect();
        let figures = Figures::Deviation(Occurrences { count, first_m: 7.0, worst_m });
        assert_eq!(alerts, [(ListKind::ProfileContradicted, at, figures)]);
        observations.note(ObservedKind::ProfileContradicted, at, Occurrence { x_m: 8.0, off_m: 0.5 });
    }
    assert_eq!(bench.notices.len(), 1);
}

#[test]
fn alert_spans_only_wall_that_is_still_missed() {
    let mut bench = Bench::new(0.0, 0.0);
    let stretch = |bench: &Bench| bench.list.iter().next().and_then(|alert| alert.stretch);
    bench.run(0, RunChange::Raised, (40, 41), None);
    bench.run(0, RunChange::Changed, (40, 64), None);
    bench.run(0, RunChange::Changed, (40, 52), None);
    assert_eq!(stretch(&bench), Some((40, 52)), "the far end was passed again");
    // A second pass covers the middle of the missed stretch. The alert then covers two missed stretches.
    bench.run(1, RunChange::Raised, (48, 52), None);
    bench.run(0, RunChange::Changed, (40, 44), None);
    assert_eq!((stretch(&bench), bench.list.iter().count()), (Some((40, 52)), 1));
    bench.run(1, RunChange::Cleared, (48, 52), None);
    bench.run(0, RunChange::Changed, (41, 44), None);
    assert_eq!(stretch(&bench), Some((41, 44)));
}

#[test]
fn merged_stretches_keep_the_lower_of_their_alert_numbers() {
    let mut bench = Bench::new(0.0, 0.0);
    bench.run(0, RunChange::Raised, (10, 11), None);
    bench.run(1, RunChange::Raised, (14, 15), None);
    bench.with(|list, to| list.acknowledge(1, Who::cut("AB"), MonoNs(9), to));
    bench.run(1, RunChange::Merged, (14, 15), Some(0));
    bench.run(0, RunChange::Changed, (10, 15), None);
    let [kept, gone] = [1, 2].map(|number| *bench.list.get(number).unwrap());
    assert_eq!((kept.stretch, kept.count, kept.needs_acknowledgement()), (Some((10, 15)), 2, true));
    assert_eq!((gone.state, gone.merged_into), (AlertState::Cleared, Some(1)));
    // A later pass covers the middle of the missed stretch and so splits it in two. One alert covers both
    // parts. Then a pass covers both parts.
    bench.run(2, RunChange::Raised, (13, 15), None);
    bench.run(0, RunChange::Changed, (10, 12), None);
    assert_eq!(bench.list.raised(), 2);
    bench.run(0, RunChange::Cleared, (10, 12), None);
    assert_eq!(bench.list.get(1).unwrap().state, AlertState::Active);
    bench.run(2, RunChange::Cleared, (13, 15), None);
    assert_eq!(bench.list.get(1).unwrap().state, AlertState::Rectified);
    bench.with(|list, to| list.acknowledge(0, Who::cut("AB"), MonoNs(9), to));
    assert_eq!(bench.list.get(1).unwrap().state, AlertState::Cleared);
    bench.run(3, RunChange::Raised, (10, 11), None);
    assert_eq!(bench.list.raised(), 3, "a cleared alert stays cleared");
}

proptest! {
    /// Missed stretches in a tunnel of 7 km are flagged and cleared at random. Every unacknowledged
    /// missed stretch stays in an alert, and the list never exceeds its capacity. No alert is active once
    /// every stretch is cleared.
    #[test]
    fn full_list_loses_no_missed_stretch(
        events in proptest::collection::vec((0u8..10, 0u32..2000), 800..2500),
    ) {
        let mut bench = Bench::new(0.0, 0.0);
        let room = bench.list.alerts.capacity();
        let mut open: Vec<u32> = Vec::new();
        let (mut raised, mut unknown) = (0_u32, Vec::new());
        let stretch = |id: u32| (i64::from(id) * 10, i64::from(id) * 10 + 4);
        for (what, pick) in events {
            match what {
                0..=6 => {
                    bench.run(raised, RunChange::Raised, stretch(raised), None);
                    open.push(raised);
                    unknown.push(raised);
                    raised += 1;
                }
                7 | 8 if !open.is_empty() => {
                    let id = open.swap_remove(pick as usize % open.len());
                    bench.run(id, RunChange::Cleared, stretch(id), None);
                }
                9 if pick % 50 == 0 => {
                    bench.with(|list, to| list.acknowledge(0, Who::cut("AB"), MonoNs(1), to));
                    unknown.clear();
                }
                _ => {}
            }
        }
        prop_assert_eq!(bench.list.alerts.capacity(), room);
        prop_assert!(bench.list.iter().count() <= MOST_LISTED);
        for id in &open {
            let (from, to) = stretch(*id);
            let mut holding = bench.list.iter().filter(|alert| {
                alert.state == AlertState::Active && alert.stretch.is_some_and(|(of, until)| of <= from && to <= until)
            });
            let needs = unknown.contains(id);
            prop_assert!(holding.any(|alert| !needs || alert.needs_acknowledgement()), "run {}", id);
        }
        let (shown, hidden) = bench.list.shown();
        let live = bench.list.iter().filter(|alert| alert.is_live()).count();
        prop_assert_eq!(shown.iter().filter(|alert| alert.is_live()).count() + hidden, live);
        prop_assert!(shown.is_sorted_by_key(|alert| alert.rank()) && shown.len() <= json::MOST_SHOWN);
        for id in open {
            bench.run(id, RunChange::Cleared, stretch(id), None);
        }
        prop_assert_eq!(bench.list.counts().active, 0);
    }
}
