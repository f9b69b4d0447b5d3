//! A frame of the screen: a copy of the dive's state, made on the loop's thread between ticks.

use std::collections::{BTreeMap, BTreeSet, VecDeque};

use headrace_geometry::time::{DurNs, MonoNs};
use headrace_geometry::tunnel::Profile;
use headrace_monitor::dive_plan::route::DivePlan;
use headrace_monitor::dive_plan::texts::{fits_text, step_text};
use headrace_monitor::head_descriptions::HeadDescriptions;
use headrace_monitor::live_messages::LiveMessage;
use headrace_monitor::live_state::{Condition, LiveState, SensorState};
use headrace_monitor::live_text::{PilotLine, message_line, status_line};
use headrace_monitor::messages::Notice;
use headrace_monitor::pilot_text::{AdviceFigures, advice_text};
use headrace_monitor::run::Loop;
use headrace_monitor::words::limit_words;
use headrace_ports::{Phase, Status};
use headrace_sampling::advice::{Advice, Reason};

use crate::recording_state::RecordingState;

use super::alerts::{self, AlertRow};
use super::mode::Stop;
use super::wall::{Cell, Clock, WallNews};

/// Averaging window for a sensor's rate of readings, in the time of the data.
const RATE_OVER: DurNs = DurNs(2_000_000_000);
/// Maximum number of messages kept until the next frame.
const MOST_MESSAGES: usize = 64;
/// Number of sections on each side of the vehicle that are in every frame.
const NEAR: i64 = 8;

/// A frame of the screen.
pub(super) struct ScreenFrame {
    pub(super) vehicle: String,
    pub(super) state: LiveState,
    /// Dive time.
    pub(super) time: DurNs,
    pub(super) stopped: Option<Stop>,
    /// Status line: place, speed, condition and action.
    pub(super) status: PilotLine,
    /// Text about the factor that limits the speed.
    pub(super) reason: String,
    /// Whether the plan for the rest of the dive fits into the remaining time, and its next steps; empty without a plan.
    pub(super) plan: Vec<String>,
    pub(super) sensors: Vec<SensorRow>,
    pub(super) alerts: Vec<AlertRow>,
    /// Number of alerts that aren't in the list.
    pub(super) alerts_hidden: usize,
    /// Text about the recordings, and whether the text is an alarm.
    pub(super) recording: Option<(String, bool)>,
    pub(super) wall: WallNews,
    /// Messages since the last frame, oldest first.
    pub(super) messages: Vec<PilotLine>,
}

/// A sensor's row on the screen.
pub(super) struct SensorRow {
    pub(super) id: String,
    pub(super) state: SensorState,
    pub(super) age: Option<DurNs>,
    pub(super) rate_hz: Option<f64>,
    /// Withheld readings, or the status of the sensor's port; empty while both are well.
    pub(super) why: String,
}

/// Builds the frames, and keeps the state that is needed between frames.
pub(super) struct FrameBuilder {
    vehicle: String,
    messages: VecDeque<PilotLine>,
    /// Sections that have changed since the last frame; `None` if all have to be shown.
    changed: Option<BTreeSet<i64>>,
    clock: Option<Clock>,
    /// Number of readings of each sensor at two times, from which the rate follows.
    counted: [Option<(MonoNs, Vec<u64>)>; 2],
    recorded: RecordingState,
    ports: BTreeMap<usize, String>,
}

impl FrameBuilder {
    pub(super) fn new(vehicle: &str) -> Self {
        Self {
            vehicle: vehicle.to_owned(),
            messages: VecDeque::new(),
            changed: None,
            clock: None,
            counted: [None, None],
            recorded: RecordingState::default(),
            ports: BTreeMap::new(),
        }
    }

    /// Adds a line to the messages.
    pub(super) fn tell(&mut self, line: PilotLine) {
        if self.messages.len() == MOST_MESSAGES {
            self.messages.pop_front();
        }
        self.messages.push_back(line);
    }

    pub(super) fn hear(&mut self, notice: &Notice) {
        if let (Notice::Section { section, .. }, Some(changed)) = (notice, &mut self.changed) {
            changed.insert(*section);
        }
    }

    /// Adds the lines of live messages, except messages that only repeat other lines.
    pub(super) fn messages(&mut self, messages: &[LiveMessage], dive: &Loop) {
        for one in messages.iter().filter(|one| one.adds_line()) {
            self.tell(message_line(one, &dive.mission().profile, dive.head_descriptions()));
        }
    }

    /// Sets the state of a sensor's port.
    pub(super) fn sensor(&mut self, status: &Status) {
        let words = if status.phase == Phase::Running { String::new() } else { status.to_string() };
        self.ports.insert(status.source, words);
    }

    /// Sets the state of the recordings.
    pub(super) fn recorded(&mut self, state: &RecordingState) {
        self.recorded = *state;
    }

    /// Makes the next frame include all sections, because a frame was lost.
    pub(super) fn show_all_again(&mut self) {
        self.changed = None;
    }

    /// Resets the state after a jump of the playback.
    pub(super) fn forget(&mut self) {
        self.changed = None;
        self.counted = [None, None];
    }

    pub(super) fn shot(&mut self, dive: &Loop, stopped: Option<Stop>) -> ScreenFrame {
        let state = *dive.view().live_state();
        let (profile, heads) = (&dive.mission().profile, dive.head_descriptions());
        let name =
            |source: usize| dive.sources().get(source).map_or_else(String::new, |info| info.id.clone());
        let reason = state
            .advice
            .as_ref()
            .map_or_else(String::new, |advice| reason_text(advice, &state, (profile, heads)));
        let (alerts, alerts_hidden) = alerts::rows(dive);
        ScreenFrame {
            vehicle: self.vehicle.clone(),
            time: dive.view().clock().time(state.now),
            stopped,
            status: status_line(&state, profile, heads, &name),
            reason,
            plan: state.plan.as_ref().map_or_else(Vec::new, |plan| plan_texts(plan, heads)),
            sensors: self.sensors(&state, dive),
            alerts,
            alerts_hidden,
            recording: self.recorded.words(),
            wall: self.wall(&state, dive),
            messages: self.messages.drain(..).collect(),
            state,
        }
    }

    fn sensors(&mut self, state: &LiveState, dive: &Loop) -> Vec<SensorRow> {
        let counts: Vec<u64> = dive.view().health().iter().map(|health| health.readings).collect();
        let [before, last] = &mut self.counted;
        let is_due = last.as_ref().is_none_or(|(at, _)| state.now.since(*at).0 >= RATE_OVER.0);
        let from = before.as_ref().or(last.as_ref());
        let rate = |source: usize| {
            let (at, readings) = from?;
            let seconds = state.now.since(*at).as_secs_f64();
            let more = counts.get(source)?.checked_sub(*readings.get(source)?)?;
            (seconds > 0.5).then(|| more as f64 / seconds)
        };
        let row = |(source, info): (usize, &headrace_monitor::SourceInfo)| SensorRow {
            id: info.id.clone(),
            state: state.sensor(source),
            age: state.age_of(source),
            rate_hz: rate(source),
            why: state.withheld_text(source).or_else(|| self.ports.get(&source).cloned()).unwrap_or_default(),
        };
        let rows = dive.sources().iter().enumerate().map(row).collect();
        if is_due {
            *before = last.take();
            *last = Some((state.now, counts));
        }
        rows
    }

    fn wall(&mut self, state: &LiveState, dive: &Loop) -> WallNews {
        let sections = &dive.view().coverage().sections;
        let clock = self.clock.get_or_insert_with(|| Clock::of(&dive.mission().profile));
        let indexes: Vec<i64> = match self.changed.take() {
            None => (0..).take(sections.len()).collect(),
            Some(mut changed) => {
                if let Some(x_m) = state.chainage_m {
                    let here = sections.index_of(x_m);
                    changed.extend(here - NEAR..=here + NEAR);
                }
                changed.into_iter().collect()
            }
        };
        self.changed = Some(BTreeSet::new());
        let cell = |index: i64| Some((index, Cell::of(index, dive, clock)?));
        WallNews {
            section_m: sections.section_m(),
            count: sections.len(),
            at_m: state.chainage_m,
            inwards: state.speed_mps.is_none_or(|speed_mps| speed_mps >= 0.0),
            cells: indexes.into_iter().filter_map(cell).collect(),
        }
    }
}

/// Whether the plan fits into the remaining time, and its next steps, numbered.
fn plan_texts(plan: &DivePlan, heads: &HeadDescriptions) -> Vec<String> {
    let steps = (1..).zip(plan.steps.iter().flatten());
    let steps = steps.map(|(number, step)| format!("{number}. {}", step_text(step, heads)));
    core::iter::once(fits_text(plan)).chain(steps).collect()
}

/// Text about the reason that limits the speed, unless the condition states it already.
fn reason_text(
    advice: &Advice,
    state: &LiveState,
    (profile, heads): (&Profile, &HeadDescriptions),
) -> String {
    if let Some(phase) = state.phase_text() {
        return phase;
    }
    let is_shown = matches!(state.condition(), Condition::TurnFails | Condition::NoSpeed);
    if advice.reason == Reason::HelixPitch && !is_shown {
        return format!("the {} limits the speed", limit_words(advice.reason));
    }
    advice_text(&AdviceFigures::of(advice, state.speed_mps.unwrap_or(0.0)), profile, heads)
}
