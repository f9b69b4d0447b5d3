//! Applies judgements, updates and commands to the alert list, in the order in which they were consumed.

use bevy_ecs::prelude::Resource;

use crate::alert_list::{AlertList, Beat, RunInput, Telling};
use crate::console::{Command, Commands, Console, ReceivedCommand};
use crate::live_state::LiveState;
use crate::messages::{Event, Notice, Notices};
use crate::notes::{Note, Notes, Spoken};
use crate::result_stream::{RecordKind, ResultStream};

/// Runs changed in this tick, in order.
#[derive(Debug, Resource)]
pub(crate) struct RunInputs(pub(crate) Vec<RunInput>);

/// Inputs and outputs of the alert list.
pub(crate) struct Alerting<'a> {
    pub(crate) list: &'a mut AlertList,
    pub(crate) notes: &'a mut Notes,
    pub(crate) console: &'a mut Console,
    pub(crate) runs: &'a RunInputs,
    pub(crate) commands: &'a Commands,
    pub(crate) notices: &'a mut Notices,
    pub(crate) stream: &'a mut ResultStream,
    pub(crate) events: &'a [Event],
    /// Numbers of runs, commands and events applied so far.
    pub(crate) taken: (usize, usize, usize),
}

impl Alerting<'_> {
    /// Applies everything that was consumed before an update. `event` is the index of the first event after
    /// the update.
    pub(crate) fn before(&mut self, event: usize, state: &mut LiveState) {
        self.until(Some(event), state);
        self.hear(state, event);
    }

    /// Applies an update. Everything before it must have been applied.
    pub(crate) fn beat(&mut self, beat: &Beat<'_>) {
        let mut to = Telling { notices: self.notices, stream: self.stream };
        self.list.beat(beat, &mut to);
    }

    /// Applies the rest of the tick. `state` is the live state of the last update.
    pub(crate) fn rest(&mut self, state: &mut LiveState) {
        self.until(None, state);
        self.hear(state, self.events.len());
    }

    /// Records the times of the sensors' readings, up to the event with this index.
    fn hear(&mut self, state: &mut LiveState, until: usize) {
        for event in self.events.get(self.taken.2..until).unwrap_or_default() {
            if let Some(slot) = state.heard.get_mut(event.source.index()) {
                *slot = Some(event.received);
            }
        }
        self.taken.2 = until.max(self.taken.2);
    }

    /// Applies runs and commands up to an update, or all of them.
    ///
    /// A command comes before the results of the event that follows it.
    fn until(&mut self, beat: Option<usize>, state: &mut LiveState) {
        loop {
            let run = self.runs.0.get(self.taken.0);
            let run = run.filter(|run| {
                beat.is_none_or(|event| run.event < event || run.event == event && run.at_beat)
            });
            let command = self.commands.0.get(self.taken.1);
            let command = command.filter(|command| beat.is_none_or(|event| command.before <= event));
            match (run, command) {
                (Some(run), command) if command.is_none_or(|command| command.before > run.event) => {
                    self.taken.0 += 1;
                    let mut to = Telling { notices: self.notices, stream: self.stream };
                    self.list.take_run(run, &mut to);
                }
                (_, Some(command)) => {
                    let command = *command;
                    self.taken.1 += 1;
                    self.hear(state, command.before);
                    self.command(&command, state);
                }
                (_, None) => return,
            }
        }
    }

    fn command(&mut self, received: &ReceivedCommand, state: &LiveState) {
        let ReceivedCommand { at, command, .. } = *received;
        let mut to = Telling { notices: self.notices, stream: self.stream };
        let has_effect = match command {
            Command::Acknowledge { alert, by } => self.list.acknowledge(alert, by, at, &mut to),
            Command::Silence { .. } => self.list.silence(at, &mut to),
            Command::Note { text, by } => {
                let note = self.notes.take(at, by, text, self.list.x_m());
                digest_note(self.stream, &note);
                self.tell(&note);
                true
            }
            Command::Voice { id, by } => {
                let note = self.notes.speak(at, by, id, self.list.x_m());
                digest_voice(self.stream, &note);
                self.tell(&note);
                true
            }
            Command::Voiced { id, seconds } => {
                let note = self.notes.spoken(id, seconds);
                if let Some(note) = note {
                    digest_voice(self.stream, &note);
                    self.tell(&note);
                }
                note.is_some()
            }
            Command::Recording { fails } => {
                self.list.set_recording(fails, at, &mut to);
                true
            }
            Command::Limits { battery_pct } => {
                self.list.set_battery(battery_pct);
                true
            }
            Command::Time => {
                self.list.time(at, &LiveState { now: at, ..*state }, &mut to);
                true
            }
        };
        self.console.counts.without_effect += u64::from(!has_effect);
    }

    fn tell(&mut self, note: &Note) {
        if self.notices.0.len() < self.notices.0.capacity() {
            self.notices.0.push(Notice::Note(*note));
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
mod tests {
    use super::*;
    use headrace_coverage::{
        HoleFinder, Judging, MissingSamples, Reach, Request, RunChange, RunId, SampleStore, Sections,
        StoreLayout,
    };
    use headrace_geometry::time::MonoNs;
    use headrace_geometry::tunnel::shapes;
    use headrace_sensor::reading::{Reading, SourceId};
    use headrace_vehicle::{AlertTiming, LimitsConfig};

    const NOW: MonoNs = MonoNs(9_000_000_000);

    /// The run of a section without samples. It is raised at the event with this index, or at the update
    /// before that event.
    fn run(event: usize, at_beat: bool) -> RunInput {
        let profile = shapes::circle(3.0).unwrap();
        let perimeter_m = profile.perimeter_m();
        let layout = StoreLayout { perimeter_m, from_m: 0.0, to_m: 20.0, cell_m: 0.25, capacity: 100 };
        let mut sections = Sections::new(0.25, 0.5, 0.0, 20.0);
        let mut told: Option<(RunId, RunChange)> = None;
        let request = Request {
            section: 4,
            at: NOW,
            swept_by_all: None,
            none_alive: false,
            to_come: Some(Reach { from_m: 19.0, to_m: f64::INFINITY }),
            not_passed: None,
            ended: None,
            only_fails: false,
        };
        let mut judging = Judging {
            store: &SampleStore::new(layout),
            lacks: &MissingSamples::default(),
            finder: &mut HoleFinder::default(),
            profile: &profile,
            tell: &mut |id, change| told = Some((id, change)),
        };
        sections.judge(&request, &mut judging);
        RunInput::of((event, at_beat), NOW, told.unwrap(), &sections).unwrap()
    }

    /// Inputs of a tick: a run, a command that acknowledges all alerts, and readings at ten events.
    struct Bench {
        list: AlertList,
        notes: Notes,
        console: Console,
        runs: RunInputs,
        commands: Commands,
        notices: Notices,
        stream: ResultStream,
        events: Vec<Event>,
        state: LiveState,
    }

    impl Bench {
        fn new(run: RunInput, command_before: usize) -> Self {
            let event = |k: u64| Event {
                source: SourceId(2),
                received: MonoNs(k),
                valid_at: MonoNs(k),
                reading: Reading::AngularRate(headrace_geometry::frames::Vec3::zero()),
            };
            let command = Command::Acknowledge { alert: 0, by: crate::console::Who::default() };
            let mut commands = Commands::new();
            commands.0.push(ReceivedCommand { before: command_before, at: NOW, command });
            Self {
                list: AlertList::new(AlertTiming::default(), LimitsConfig::default(), 100),
                notes: Notes::default(),
                console: Console::new(SourceId(9)),
                runs: RunInputs(vec![run]),
                commands,
                notices: Notices(Vec::with_capacity(100)),
                stream: ResultStream::default(),
                events: (0..10).map(event).collect(),
                state: LiveState::new(0.5, 2.0, 0, 3),
            }
        }

        /// Applies inputs up to the update before the event with this index, or the whole tick.
        ///
        /// Returns the number of alerts raised, the number of those acknowledged, the number of commands
        /// without effect, and the last reading's time.
        fn until(&mut self, beat: Option<usize>) -> (u32, usize, u64, Option<u64>) {
            let mut alerting = Alerting {
                list: &mut self.list,
                notes: &mut self.notes,
                console: &mut self.console,
                runs: &self.runs,
                commands: &self.commands,
                notices: &mut self.notices,
                stream: &mut self.stream,
                events: &self.events,
                taken: (0, 0, 0),
            };
            match beat {
                Some(event) => alerting.before(event, &mut self.state),
                None => alerting.rest(&mut self.state),
            }
            let acknowledged = self.list.iter().filter(|alert| alert.acknowledged.is_some()).count();
            let heard = self.state.heard.get(2).copied().flatten().map(|at| at.0);
            (self.list.raised(), acknowledged, self.console.counts.without_effect, heard)
        }
    }

    #[test]
    fn command_precedes_the_results_of_the_next_event() {
        for (before, acknowledged) in [(4, 0), (5, 0), (6, 1), (9, 1)] {
            let found = Bench::new(run(5, false), before).until(None);
            assert_eq!(found, (1, acknowledged, 1 - acknowledged as u64, Some(9)), "{before}");
        }
    }

    #[test]
    fn update_includes_only_earlier_inputs() {
        let at = |run: RunInput, command_before: usize, beat: usize| {
            Bench::new(run, command_before).until(Some(beat))
        };
        assert_eq!(at(run(4, false), 9, 5), (1, 0, 0, Some(4)));
        assert_eq!(at(run(5, false), 9, 5), (0, 0, 0, Some(4)), "that event comes after the update");
        assert_eq!(at(run(5, true), 9, 5), (1, 0, 0, Some(4)), "at the update itself");
        assert_eq!(at(run(6, true), 9, 5), (0, 0, 0, Some(4)));
        assert_eq!(at(run(9, false), 5, 5), (0, 0, 1, Some(4)), "the command comes just before the update");
        assert_eq!(at(run(9, false), 6, 5), (0, 0, 0, Some(4)), "the command comes after the update");
        assert_eq!(at(run(2, false), 4, 5), (1, 1, 0, Some(4)));
        assert_eq!(at(run(2, false), 4, 0), (0, 0, 0, None));
    }
}
