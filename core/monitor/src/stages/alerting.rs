//! The alert list's part of a tick: judgements, beats and commands in the order in which they were consumed.

use bevy_ecs::prelude::Resource;

use crate::alert_list::{AlertList, Beat, RunInput, Telling};
use crate::console::{Command, Commands, Console, ReceivedCommand};
use crate::live_state::LiveState;
use crate::messages::{Event, Notice, Notices};
use crate::notes::{Note, Notes, Spoken};
use crate::result_stream::{RecordKind, ResultStream};

/// Runs that have changed in this tick, in order.
#[derive(Debug, Resource)]
pub(crate) struct RunInputs(pub(crate) Vec<RunInput>);

/// What alerts are made of, and where they go.
pub(crate) struct Alerting<'a> {
    pub(crate) list: &'a mut AlertList,
    pub(crate) notes: &'a mut Notes,
    pub(crate) console: &'a mut Console,
    pub(crate) runs: &'a RunInputs,
    pub(crate) commands: &'a Commands,
    pub(crate) notices: &'a mut Notices,
    pub(crate) stream: &'a mut ResultStream,
    pub(crate) events: &'a [Event],
    /// How many runs, commands and events have been taken.
    pub(crate) taken: (usize, usize, usize),
}

impl Alerting<'_> {
    /// Takes what comes before the beat that precedes the event of this index.
    pub(crate) fn before(&mut self, event: usize, state: &mut LiveState) {
        self.until(Some(event), state);
        self.hear(state, event);
    }

    /// Takes a beat, after what comes before it.
    pub(crate) fn beat(&mut self, beat: &Beat<'_>) {
        let mut to = Telling { notices: self.notices, stream: self.stream };
        self.list.beat(beat, &mut to);
    }

    /// Takes the rest of the tick; `state` is as of the last beat.
    pub(crate) fn rest(&mut self, state: &mut LiveState) {
        self.until(None, state);
        self.hear(state, self.events.len());
    }

    /// Notes when sensors have spoken, up to the event of this index.
    fn hear(&mut self, state: &mut LiveState, until: usize) {
        for event in self.events.get(self.taken.2..until).unwrap_or_default() {
            if let Some(slot) = state.heard.get_mut(event.source.index()) {
                *slot = Some(event.received);
            }
        }
        self.taken.2 = until.max(self.taken.2);
    }

    /// Takes runs and commands up to a beat, or all: a command comes before what the event after it has brought.
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
