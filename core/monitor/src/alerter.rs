//! The alerter: combines the results of the other parts of the loop and the operator's commands into the live
//! state, alerts and notes.

use super::adviser::Advised;
use super::alert_list::{AdviceUpdate, AlertList, AlertOutputs, MOST_LISTED, RunInput};
use super::console::command::Command;
use super::console::packets::ReceivedCommand;
use super::dive_plan::planner::{Now, PlanSettings, Planner};
use super::dive_plan::route::{DiveStep, StepKind};
use super::live_state::{LiveState, PositionDoubt, PositionState, source_bits};
use super::merge::MAX_TICK_PACKETS;
use super::messages::{Doubts, Event, Notice, PlacedItem, Placement, Standing, Update};
use super::notes::{Note, Notes, Spoken};
use super::observations::Observations;
use super::placer::Placed;
use super::resources::Coverage;
use super::result_stream::{RecordKind, ResultStream};
use super::surveyor::Found;
use crate::unread::UnreadPacket;
use headrace_coverage::Metres;
use headrace_geometry::snapshot::{Restorer, Saver, SnapshotError, Stateful as _};
use headrace_geometry::time::MonoNs;
use headrace_sampling::advice::Advice;
use headrace_sampling::head::HeadSet;
use headrace_sampling::passes::Situation;
use headrace_sensor::reading::SourceId;

/// Largest share of the target that position errors may use up. Above this share, the position is doubtful.
const SPREAD_SHARE: f64 = 0.2;
/// Number of notices per alert for which a tick has room. An alert may change several times in a tick.
const NOTICES_PER_ALERT: usize = 4;

/// Alerts, notes and the live state.
pub struct Alerter {
    pub(super) list: AlertList,
    pub(super) notes: Notes,
    pub(super) state: LiveState,
    /// Number of operator commands without effect.
    pub(super) without_effect: u64,
    /// Result stream of the live states at the advice updates.
    pub(super) states: ResultStream,
    /// Result stream of alert changes and notes.
    pub(super) changes: ResultStream,
    /// Alert changes and notes of the last tick, in order.
    pub(super) notices: Vec<Notice>,
    /// Sources of the heads, by number.
    heads: Vec<SourceId>,
    planner: Planner,
}

impl Alerter {
    /// Creates the alerter. `keeps_results` says whether its streams keep the contents of each tick.
    ///
    /// `runs` is the maximum number of missed stretches that change in a tick. Allocates: all memory.
    pub(super) fn new(
        list: AlertList,
        state: &LiveState,
        heads: Vec<SourceId>,
        plan: PlanSettings,
        (runs, keeps_results): (usize, bool),
    ) -> Self {
        let (mut states, mut changes) = (ResultStream::default(), ResultStream::default());
        if keeps_results {
            states.keep();
            changes.keep();
        }
        let notices = Vec::with_capacity(runs + MAX_TICK_PACKETS + NOTICES_PER_ALERT * MOST_LISTED);
        Self {
            list,
            notes: Notes::default(),
            state: *state,
            without_effect: 0,
            states,
            changes,
            notices,
            heads,
            planner: Planner::new(plan),
        }
    }

    /// Clears the results of the last tick from the streams.
    pub(super) fn next_tick(&mut self) {
        self.states.next_tick();
        self.changes.next_tick();
    }

    /// Applies the results of the other parts for a tick that ends at `now`. Allocates: never.
    pub(super) fn tick(&mut self, placed: &Placed, found: &Found, advised: &Advised, now: MonoNs) {
        self.notices.clear();
        self.list.clock = placed.clock;
        let (runs, commands) = (&found.runs[..], &placed.commands.0[..]);
        let (events, unread) = (&placed.events[..], &placed.unread[..]);
        let mut inputs = Inputs { runs, commands, events, unread, taken: Taken::default() };
        let mut results = advised.entries.iter().zip(&found.standings);
        for PlacedItem { event, placement } in &placed.items {
            let Placement::Update(update) = placement else { continue };
            let Some((entry, standing)) = results.next() else { continue };
            self.take_before(*event, &mut inputs);
            self.update(update, &entry.advice, standing);
        }
        debug_assert!(results.next().is_none(), "each update has one advice and one standing");
        self.take_rest(&mut inputs);
        self.state.now = now;
    }

    /// Applies the missed stretches that the judgement at the end of a dive has changed.
    pub(super) fn take_runs_at_end(&mut self, runs: &[RunInput]) {
        self.notices.clear();
        for run in runs {
            self.take_run(run);
        }
    }

    /// Updates the length of each verdict after the last judgement of a dive.
    pub(super) fn take_metres_at_end(&mut self, coverage: &Coverage) {
        self.state.metres = coverage.metres();
        self.state.missed_from_m = coverage.sections.missed_from_m();
    }

    /// Applies the observations after the last judgement of a dive.
    pub(super) fn take_observations_at_end(&mut self, observations: &Observations, at: MonoNs) {
        self.notices.clear();
        let mut to = AlertOutputs { notices: &mut self.notices, stream: &mut self.changes };
        self.list.take_observations_at_end(observations, at, &mut to);
    }

    fn update(&mut self, update: &Update, advice: &Advice, standing: &Standing) {
        let Update { at, situation, doubts, fix, sd } = update;
        let turning = (0..).zip(&situation.heads).filter(|(_, motion)| motion.is_some());
        let turning = turning.fold(HeadSet::default(), |set, (head, _)| set.with(head));
        let reserved_m = self.state.target.error_m(situation.pass_error_m);
        self.state = LiveState {
            at: Some(*at),
            position: match fix {
                Err(no_fix) => PositionState::None(*no_fix),
                Ok(_) if doubts.cable.is_some() => PositionState::Doubtful(PositionDoubt::Cable),
                Ok(_) if reserved_m > SPREAD_SHARE * self.state.target.max_hole_m => {
                    PositionState::Doubtful(PositionDoubt::Spread)
                }
                Ok(_) => PositionState::Ok,
            },
            chainage_m: situation.pose.map(|pose| pose.position.x()),
            sd: *sd,
            pass_sd_m: situation.pass_error_m,
            stand_s: doubts.stand_s,
            speed_mps: situation.pose.map(|_| situation.speed_mps),
            last_band: self.state.speed_band(),
            advice: Some(*advice),
            metres: standing.metres,
            missed_from_m: standing.missed_from_m,
            unsure: standing.unsure,
            passed: standing.passed,
            back_to_m: standing.back_to_m,
            observations: standing.observations,
            turning: source_bits(self.heads.iter().copied(), turning),
            hung: doubts.hung,
            deaf: source_bits(self.heads.iter().copied(), situation.deaf),
            ..self.state
        };
        if self.state.position == PositionState::Ok {
            self.state.sure_v_max_mps = self.state.v_max_mps();
        }
        self.plan(*at, situation, standing);
        digest(&mut self.states, *at, situation, &self.state);
        let as_of = LiveState { now: *at, ..self.state };
        let Doubts { setting, unverified_mounts, .. } = *doubts;
        self.take_update(&AdviceUpdate { at: *at, state: &as_of, setting, unverified_mounts });
    }

    /// Plans the rest of the dive. While the vehicle goes back, its destination is that of the plan.
    fn plan(&mut self, at: MonoNs, situation: &Situation, standing: &Standing) {
        let is_sure = self.state.position == PositionState::Ok;
        let v_max_mps = self.state.v_max_mps().filter(|_| is_sure);
        let now = Now { at, situation, is_sure, v_max_mps, left_s: self.list.time_left_s(at) };
        self.state.plan = self.planner.update(&now, &standing.missed, self.state.plan);
        let next = self.state.plan.and_then(|plan| plan.steps.first().copied().flatten());
        self.state.back_to_m = self.state.back_to_m.and_then(|to_m| match next {
            // On a pass outward the limit applies.
            Some(DiveStep { kind: StepKind::Inspect, from_m, to_m, .. }) if to_m < from_m => None,
            Some(DiveStep { kind: StepKind::Go, from_m, to_m, .. }) if to_m < from_m => Some(to_m),
            _ => Some(to_m),
        });
    }

    pub(super) fn save(&self, to: &mut Saver) {
        to.part("list of alerts");
        self.list.save(to);
        to.part("notes");
        self.notes.save(to);
        to.part("live state");
        self.state.save(to);
        to.part("plan");
        self.planner.save(to);
        to.part("streams of the alerter");
        to.value(&self.without_effect);
        self.states.save(to);
        self.changes.save(to);
    }

    pub(super) fn restore(&mut self, from: &mut Restorer<'_>) -> Result<(), SnapshotError> {
        from.part("list of alerts")?;
        self.list.restore(from)?;
        from.part("notes")?;
        self.notes.restore(from)?;
        from.part("live state")?;
        self.state.restore(from)?;
        from.part("plan")?;
        self.planner.restore(from)?;
        from.part("streams of the alerter")?;
        self.without_effect = from.value()?;
        self.states.restore(from)?;
        self.changes.restore(from)
    }
}

fn digest(stream: &mut ResultStream, at: MonoNs, situation: &Situation, state: &LiveState) {
    let Metres { pass_m, fail_m, cannot_say_m, open_m, not_inspected_m } = state.metres;
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
        .integer(state.observation_bits())
        .integer(state.turning);
    for heard in state.heard.iter().take(state.sources.into()) {
        stream.integer(heard.map_or(u64::MAX, |heard| heard.0));
    }
}

/// Inputs of a tick, and how many of them have been applied so far.
struct Inputs<'a> {
    runs: &'a [RunInput],
    commands: &'a [ReceivedCommand],
    events: &'a [Event],
    unread: &'a [UnreadPacket],
    taken: Taken,
}

/// Numbers of a tick's inputs that have been applied so far.
#[derive(Debug, Clone, Copy, Default)]
struct Taken {
    runs: usize,
    commands: usize,
    events: usize,
    unread: usize,
}

impl Inputs<'_> {
    /// Number of packets without a reading that come before the event with this index.
    fn unread_before(&self, event: usize) -> usize {
        self.unread.partition_point(|packet| packet.before <= event)
    }
}

impl Alerter {
    /// Applies all inputs of the tick that came before an advice update. `event` is the index of the first
    /// event after the update.
    fn take_before(&mut self, event: usize, inputs: &mut Inputs<'_>) {
        self.take_until(Some(event), inputs);
        self.hear(inputs, event, inputs.unread_before(event));
    }

    /// Applies an advice update. All inputs before it must have been applied already.
    fn take_update(&mut self, update: &AdviceUpdate<'_>) {
        let mut to = AlertOutputs { notices: &mut self.notices, stream: &mut self.changes };
        self.list.update(update, &mut to);
    }

    /// Applies the inputs that remain in the tick.
    fn take_rest(&mut self, inputs: &mut Inputs<'_>) {
        self.take_until(None, inputs);
        self.hear(inputs, inputs.events.len(), inputs.unread.len());
    }

    /// Applies a changed missed stretch.
    fn take_run(&mut self, run: &RunInput) {
        let mut to = AlertOutputs { notices: &mut self.notices, stream: &mut self.changes };
        self.list.take_run(run, &mut to);
    }

    /// Records the sensors' readings and packets without a reading, up to the event and the packet with these
    /// indexes.
    fn hear(&mut self, inputs: &mut Inputs<'_>, until: usize, unread_until: usize) {
        for (index, event) in inputs.events.iter().enumerate().take(until).skip(inputs.taken.events) {
            self.hear_unread(inputs, inputs.unread_before(index).min(unread_until));
            self.state.hear(event.source, event.received);
        }
        inputs.taken.events = until.max(inputs.taken.events);
        self.hear_unread(inputs, unread_until);
    }

    fn hear_unread(&mut self, inputs: &mut Inputs<'_>, until: usize) {
        let packets = inputs.unread.get(inputs.taken.unread..until).unwrap_or_default();
        for packet in packets {
            self.state.hear_unread(packet);
        }
        inputs.taken.unread = until.max(inputs.taken.unread);
    }

    /// Applies changed missed stretches and commands: those before an advice update, or all if `update` is `None`.
    ///
    /// A command comes before the results of the event that follows it.
    fn take_until(&mut self, update: Option<usize>, inputs: &mut Inputs<'_>) {
        loop {
            let run = inputs.runs.get(inputs.taken.runs);
            let run = run.filter(|run| {
                update.is_none_or(|event| run.event < event || run.event == event && run.at_update)
            });
            let command = inputs.commands.get(inputs.taken.commands);
            let command = command.filter(|command| update.is_none_or(|event| command.before <= event));
            match (run, command) {
                (Some(run), command) if command.is_none_or(|command| command.before > run.event) => {
                    inputs.taken.runs += 1;
                    self.take_run(run);
                }
                (_, Some(command)) => {
                    inputs.taken.commands += 1;
                    self.hear(inputs, command.before, command.before_unread);
                    self.take_command(command);
                }
                (_, None) => return,
            }
        }
    }

    fn take_command(&mut self, received: &ReceivedCommand) {
        let ReceivedCommand { at, command, .. } = *received;
        let mut to = AlertOutputs { notices: &mut self.notices, stream: &mut self.changes };
        let has_effect = match command {
            Command::Acknowledge { alert, by } => self.list.acknowledge(alert, by, at, &mut to),
            Command::Silence { .. } => self.list.silence(at, &mut to),
            Command::Note { text, by } => {
                let note = self.notes.take(at, by, text, self.list.x_m());
                digest_note(&mut self.changes, &note);
                self.tell(&note);
                true
            }
            Command::Voice { id, by } => {
                let note = self.notes.speak(at, by, id, self.list.x_m());
                digest_voice(&mut self.changes, &note);
                self.tell(&note);
                true
            }
            Command::Voiced { id, seconds } => {
                let note = self.notes.spoken(id, seconds);
                if let Some(note) = note {
                    digest_voice(&mut self.changes, &note);
                    self.tell(&note);
                }
                note.is_some()
            }
            Command::Recording { fails } => {
                self.list.set_recording(fails, at, &mut to);
                true
            }
            Command::Stalled { seconds } => {
                self.list.set_stalled(seconds, at, &mut to);
                true
            }
            Command::Limits { battery_pct } => {
                self.list.set_battery(battery_pct);
                true
            }
            Command::Time => {
                self.list.time(at, &LiveState { now: at, ..self.state }, &mut to);
                true
            }
        };
        self.without_effect += u64::from(!has_effect);
    }

    fn tell(&mut self, note: &Note) {
        if self.notices.len() < self.notices.capacity() {
            self.notices.push(Notice::Note(*note));
        }
    }
}

fn digest_voice(stream: &mut ResultStream, note: &Note) {
    let Spoken { id, seconds } = note.voice.unwrap_or(Spoken { id: 0, seconds: 0 });
    stream
        .record(RecordKind::Voice)
        .integer(note.at.0)
        .integer(note.number.into())
        .number(note.chainage_m.unwrap_or(0.0))
        .text(note.by.as_str())
        .integer(id.into())
        .integer(seconds.into());
}

fn digest_note(stream: &mut ResultStream, note: &Note) {
    stream
        .record(RecordKind::Note)
        .integer(note.at.0)
        .integer(note.number.into())
        .number(note.chainage_m.unwrap_or(0.0))
        .text(note.by.as_str());
    let (whole, rest) = note.text.as_str().as_bytes().as_chunks::<8>();
    for word in whole {
        stream.integer(u64::from_le_bytes(*word));
    }
    let mut last = [0; 8];
    last.iter_mut().zip(rest).for_each(|(byte, of)| *byte = *of);
    stream.integer(u64::from_le_bytes(last));
}

#[cfg(test)]
mod tests;
