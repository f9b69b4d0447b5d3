//! Builds the live state: results of earlier stages, as of each update.

use bevy_ecs::prelude::{Query, Res, ResMut};

use super::alerting::{Alerting, RunInputs};
use crate::alert_list::{AlertList, Beat};
use crate::alerts::{AlertKind, Alerts};
use crate::console::{Commands, Console};
use crate::entities::{HeadSweep, Mounted};
use crate::live_state::{
    ActiveAlert, ActiveAlerts, LiveMetres, LiveState, PositionDoubt, PositionState, source_bits,
};
use crate::messages::{
    AdviceList, Doubts, Events, JudgedStates, Notices, Placed, PlacedList, Positioned, PositionedList,
    Standing,
};
use crate::notes::Notes;
use crate::resources::{Coverage, Digests, TickTime, VehicleEntities};
use crate::result_stream::{RecordKind, ResultStream};
use headrace_geometry::time::{DurNs, MonoNs};
use headrace_sampling::head::HeadSet;
use headrace_sampling::passes::Situation;
use headrace_sensor::reading::SourceId;

/// Maximum share of the target for position errors for which the advice allows.
const SPREAD_SHARE: f64 = 0.2;
/// Time for which an alert about single occurrences stays active.
const HOLDS: DurNs = DurNs(10_000_000_000);

/// Judged metres and active alerts at an update.
pub(super) fn standing<'a>(
    at: MonoNs,
    coverage: &Coverage,
    alerts: &Alerts,
    doubts: &Doubts,
    heads: impl Iterator<Item = (SourceId, &'a HeadSweep)>,
) -> Standing {
    let metres = coverage.sections.metres(coverage.frontier.way());
    Standing {
        metres: LiveMetres {
            pass_m: metres.pass_m,
            fail_m: metres.fail_m,
            cannot_say_m: metres.cannot_say_m,
            open_m: metres.open_m,
            not_inspected_m: metres.not_inspected_m,
        },
        unsure: coverage.unsure,
        passed: false,
        back_to_m: None,
        alerts: active(at, alerts, doubts, heads),
    }
}

fn active<'a>(
    at: MonoNs,
    alerts: &Alerts,
    doubts: &Doubts,
    heads: impl Iterator<Item = (SourceId, &'a HeadSweep)>,
) -> ActiveAlerts {
    let mut distrusted = HeadBits::default();
    for (source, sweep) in heads {
        if let Some(why) = sweep.wall.distrusted() {
            distrusted.add(source, AlertKind::of_distrust(why).0);
        }
    }
    let mut active = [None; crate::alerts::MOST_ALERTS];
    let holds = alerts.iter().filter(|alert| match alert.kind {
        AlertKind::CableDoubted => doubts.cable.is_some_and(|doubt| doubt.log == alert.source),
        AlertKind::SettingDoubted => doubts.setting.is_some(),
        AlertKind::OutsideTunnel | AlertKind::ProfileContradicted => at.since(alert.latest).0 <= HOLDS.0,
        kind @ (AlertKind::HeadScattered | AlertKind::HeadConstant | AlertKind::HeadOutvoted) => {
            alert.source.is_some_and(|source| distrusted.has(source, kind))
        }
    });
    for (slot, alert) in active.iter_mut().zip(holds) {
        *slot = Some(ActiveAlert {
            kind: alert.kind,
            source: alert.source,
            since: alert.latest,
            x_m: alert.x_m,
            worst_m: alert.worst_m,
        });
    }
    active
}

/// Bitmask, for each kind of alert, of the sources distrusted for it.
#[derive(Default)]
struct HeadBits([u64; AlertKind::ALL.len()]);

impl HeadBits {
    fn add(&mut self, source: SourceId, kind: AlertKind) {
        if let Some(bits) = self.0.get_mut(kind as usize) {
            *bits |= 1 << u64::from(source.0 % 64);
        }
    }

    fn has(&self, source: SourceId, kind: AlertKind) -> bool {
        self.0.get(kind as usize).is_some_and(|bits| bits >> u64::from(source.0 % 64) & 1 == 1)
    }
}

#[expect(clippy::too_many_arguments, reason = "a system's arguments are its inputs and outputs")]
pub(super) fn live(
    events: Res<'_, Events>,
    positioned: Res<'_, PositionedList>,
    placed: Res<'_, PlacedList>,
    standings: Res<'_, JudgedStates>,
    (advice, runs, commands): (Res<'_, AdviceList>, Res<'_, RunInputs>, Res<'_, Commands>),
    mut alerted: (ResMut<'_, AlertList>, ResMut<'_, Notes>, ResMut<'_, Console>),
    mut notices: ResMut<'_, Notices>,
    entities: Res<'_, VehicleEntities>,
    sensors: Query<'_, '_, &Mounted>,
    time: Res<'_, TickTime>,
    mut state: ResMut<'_, LiveState>,
    mut digests: ResMut<'_, Digests>,
) {
    let situations = placed.0.iter().filter_map(|item| match item {
        Placed::Situation(_, situation, _) => Some(situation),
        Placed::Ping(_) => None,
    });
    let mut found = situations.zip(&advice.0).zip(&standings.0);
    let Digests { alerts, states, .. } = &mut *digests;
    let (list, notes, console) = (&mut alerted.0, &mut alerted.1, &mut alerted.2);
    let mut alerting = Alerting {
        list,
        notes,
        console,
        runs: &runs,
        commands: &commands,
        notices: &mut notices,
        stream: alerts,
        events: &events.0,
        taken: (0, 0, 0),
    };
    for item in &positioned.0 {
        let Positioned::Beat { at, doubts, sd, before, fix } = item else { continue };
        let Some(((situation, advice), standing)) = found.next() else { continue };
        alerting.before(*before, &mut state);
        let heads = entities.heads.iter().filter_map(|head| sensors.get(*head).ok());
        let turning = (0..).zip(&situation.heads).filter(|(_, motion)| motion.is_some());
        let turning = turning.fold(HeadSet::default(), |set, (head, _)| set.with(head));
        let (target_m, confidence_sd) = (state.target_m, state.confidence_sd);
        let reserved_m = confidence_sd * situation.pass_error_m;
        *state = LiveState {
            at: Some(*at),
            position: match fix {
                Err(lacking) => PositionState::None(*lacking),
                Ok(_) if doubts.cable.is_some() => PositionState::Doubtful(PositionDoubt::Cable),
                Ok(_) if reserved_m > SPREAD_SHARE * target_m => {
                    PositionState::Doubtful(PositionDoubt::Spread)
                }
                Ok(_) => PositionState::Ok,
            },
            chainage_m: situation.pose.map(|pose| pose.position.x()),
            sd: *sd,
            pass_sd_m: situation.pass_error_m,
            stand_s: doubts.stand_s,
            speed_mps: situation.pose.map(|_| situation.speed_mps),
            advice: Some(*advice),
            metres: standing.metres,
            unsure: standing.unsure,
            passed: standing.passed,
            back_to_m: standing.back_to_m,
            alerts: standing.alerts,
            turning: source_bits(heads.clone().map(|head| head.source), turning),
            hung: doubts.hung,
            deaf: source_bits(heads.map(|head| head.source), situation.deaf),
            ..*state
        };
        digest(states, *at, situation, &state);
        let as_of = LiveState { now: *at, ..*state };
        alerting.beat(&Beat { at: *at, state: &as_of, setting: doubts.setting });
    }
    alerting.rest(&mut state);
    state.now = time.now;
}

fn digest(stream: &mut ResultStream, at: MonoNs, situation: &Situation, state: &LiveState) {
    let LiveMetres { pass_m, fail_m, cannot_say_m, open_m, not_inspected_m } = state.metres;
    let (why, from, to) = state.unsure.map_or((u64::MAX, 0, 0), |of| (of.why as u64, of.from, of.to));
    let advice = state.advice.as_ref();
    stream
        .record(RecordKind::State)
        .integer(at.0)
        .integer(state.position.number())
        .number(state.chainage_m.unwrap_or(0.0))
        .number(situation.pass_error_m)
        .integer(state.stand_s.into())
        .number(situation.speed_mps)
        .number(advice.map_or(0.0, |advice| advice.v_max_mps))
        .integer(advice.map_or(u64::MAX, |advice| advice.reason as u64))
        .number(advice.and_then(|advice| advice.predicted_t_m).unwrap_or(0.0))
        .number(pass_m)
        .number(fail_m)
        .number(cannot_say_m)
        .number(open_m)
        .number(not_inspected_m)
        .integer(why)
        .integer(from.cast_unsigned())
        .integer(to.cast_unsigned())
        .integer(state.alert_bits())
        .integer(state.turning);
    for heard in state.heard.iter().take(state.sources.into()) {
        stream.integer(heard.map_or(u64::MAX, |heard| heard.0));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::{advice, situation};
    use bevy_ecs::system::RunSystemOnce as _;
    use bevy_ecs::world::World;
    use headrace_fusion::filter::cable::CableDoubt;
    use headrace_fusion::relative::Relative;
    use headrace_fusion::{Fix, NoFix};
    use headrace_geometry::frames::{Point3, Pose, Rot};
    use headrace_vehicle::{AlertTiming, LimitsConfig};

    const AT: MonoNs = MonoNs(9_000_000_000);

    /// Live state after an update with this position error between passes.
    ///
    /// The target is half a metre, with two standard deviations.
    fn after(pass_error_m: f64, is_cable_doubted: bool, lacking: Option<NoFix>) -> LiveState {
        let pose = Pose { position: Point3::new(12.5, 0.0, 3.0), attitude: Rot::identity() };
        let relative = Relative::along(pass_error_m);
        let fix = Fix { pose, speed_mps: 0.07, relative, revisit: relative, tie: 0, settled: 0 };
        let fix = lacking.map_or(Ok(fix), Err);
        let cable =
            is_cable_doubted.then_some(CableDoubt { since: AT, from_m: 12.0, differs_m: 0.5, log: None });
        let doubts = Doubts { cable, setting: None, stand_s: 3, hung: 0 };
        let pose = fix.ok().map(|fix| fix.pose);
        let situation = Situation { pose, speed_mps: 0.07, pass_error_m, ..situation(None) };
        let standing = Standing {
            metres: LiveMetres::default(),
            unsure: None,
            passed: false,
            back_to_m: None,
            alerts: [None; crate::alerts::MOST_ALERTS],
        };
        let mut world = World::new();
        let vehicle = world.spawn_empty().id();
        world.insert_resource(VehicleEntities { vehicle, by_source: Vec::new(), heads: Vec::new() });
        world.insert_resource(Events(Vec::new()));
        world.insert_resource(PositionedList(vec![Positioned::Beat {
            at: AT,
            fix,
            doubts,
            sd: None,
            before: 0,
        }]));
        world.insert_resource(PlacedList(vec![Placed::Situation(AT, situation, doubts)]));
        world.insert_resource(JudgedStates(vec![standing]));
        world.insert_resource(AdviceList(vec![advice(&situation)]));
        world.insert_resource(RunInputs(Vec::new()));
        world.insert_resource(Commands::new());
        world.insert_resource(AlertList::new(AlertTiming::default(), LimitsConfig::default(), 100));
        world.insert_resource(Notes::default());
        world.insert_resource(Console::new(SourceId(9)));
        world.insert_resource(Notices(Vec::new()));
        world.insert_resource(TickTime { index: 4, now: MonoNs(9_050_000_000) });
        world.insert_resource(LiveState::new(0.5, 2.0, 0, 0));
        world.insert_resource(Digests::default());
        world.run_system_once(live).unwrap();
        *world.resource::<LiveState>()
    }

    /// Two standard deviations may be at most a fifth of the target.
    #[test]
    fn position_is_doubtful_if_passes_are_uncertain_or_the_cable_is_distrusted() {
        let spread = PositionState::Doubtful(PositionDoubt::Spread);
        let cable = PositionState::Doubtful(PositionDoubt::Cable);
        for (pass_error_m, is_cable_doubted, lacking, expected) in [
            (0.0, false, None, PositionState::Ok),
            (0.049, false, None, PositionState::Ok),
            (0.051, false, None, spread),
            (0.3, false, None, spread),
            (0.049, true, None, cable),
            (0.051, true, None, cable),
            (0.0, false, Some(NoFix::Chainage), PositionState::None(NoFix::Chainage)),
        ] {
            let state = after(pass_error_m, is_cable_doubted, lacking);
            assert_eq!(state.position, expected, "{pass_error_m}");
            let has_fix = lacking.is_none();
            assert_eq!(
                (state.chainage_m, state.speed_mps),
                (has_fix.then_some(12.5), has_fix.then_some(0.07))
            );
            assert_eq!((state.at, state.now, state.stand_s), (Some(AT), MonoNs(9_050_000_000), 3));
        }
    }

    /// A distrusted head has an alert for its own reason only.
    #[test]
    fn distrusted_head_has_only_the_alert_for_its_reason() {
        let kinds = [AlertKind::HeadScattered, AlertKind::HeadConstant, AlertKind::HeadOutvoted];
        for (added, kind) in [(0, kinds[0]), (5, kinds[1]), (63, kinds[2])] {
            let mut bits = HeadBits::default();
            bits.add(SourceId(added), kind);
            bits.add(SourceId(added), kind);
            bits.add(SourceId(7), kind);
            for (source, asked) in (0..64).flat_map(|source| kinds.map(|asked| (source, asked))) {
                let expected = asked == kind && (source == added || source == 7);
                assert_eq!(bits.has(SourceId(source), asked), expected, "{source} {asked:?}");
            }
        }
    }
}
