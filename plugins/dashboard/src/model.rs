//! The page's displayed data, as of the latest message from the loop. The model uses neither sockets nor clocks.
//!
//! Each message has a number, and each section stores the number of the last message that contained it. A viewer that
//! reconnects therefore gets only later changes, and a new viewer gets everything.

use std::collections::{BTreeMap, VecDeque};

use axum::body::Bytes;
use axum::extract::ws::Utf8Bytes;
use headrace_geometry::time::{DiveClock, MonoNs};
use headrace_monitor::alert_list::NoteJson;
use headrace_monitor::live_state::json::LiveStateJson;
use serde_json::{Value, json};

use crate::fed::{Beside, Dropped, Fed, News, PlaybackState};
use crate::history::History;
use crate::samples::Samples;
use crate::site::{Greeting, May, Site};
use crate::wire::{SectionRecord, sample_frame, section_frame};

/// Maximum number of events, such as live messages, kept for viewers that reconnect.
const MOST_EVENTS: usize = 256;
/// Maximum number of samples in one message: 100 kB/s at five messages a second. More samples are thinned; `/samples`
/// returns all of them.
const MOST_AT_ONCE: usize = 1000;
/// Maximum number of samples sent to a viewer that connects or reconnects.
const MOST_BACK: usize = 10_000;
/// Number of latest messages for which the model remembers how many samples had been sent. They cover five minutes.
const MOST_PLACES: usize = 1500;
/// Maximum number of samples in the answer to a request for a range of chainage.
pub const MOST_IN_RANGE: usize = 200_000;

/// Kind of a message to viewers. A viewer can request some kinds only.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Sort {
    /// A live state, which replaces the previous one.
    State,
    /// Samples since the previous message.
    Samples,
    /// Any other message.
    Other,
}

/// A message to viewers, encoded once for all of them.
#[derive(Debug, Clone)]
pub struct Message {
    /// Number of the message.
    pub seq: u64,
    /// Kind of the message.
    pub sort: Sort,
    /// Content of the message.
    pub body: Body,
}

/// Encoded content of a message.
#[derive(Debug, Clone)]
pub enum Body {
    /// Text in JSON.
    Text(Utf8Bytes),
    /// A binary frame.
    Binary(Bytes),
}

/// A section, a bit mask of the parts of its perimeter that have samples, and the number of the last message
/// that contained it.
#[derive(Debug, Clone, Copy)]
struct Shown {
    record: SectionRecord,
    seen: u64,
    seq: u64,
}

/// Model of the displayed data.
#[derive(Debug)]
pub struct Model {
    site: Site,
    instance: String,
    jumps: u32,
    seq: u64,
    clock: DiveClock,
    sections: BTreeMap<i32, Shown>,
    changed: Vec<i32>,
    samples: Samples,
    /// Number of samples sent to viewers so far.
    sent_samples: usize,
    /// Message numbers, each with the number of samples sent up to that message.
    places: VecDeque<(u64, usize)>,
    state: Option<Box<(Box<LiveStateJson>, Beside)>>,
    state_is_new: bool,
    /// Value of `jumps` when the lists of alerts and notes were last sent. They are sent with the first state after a
    /// jump.
    listed: u32,
    playback: Option<PlaybackState>,
    new_events: Vec<Value>,
    events: VecDeque<(u64, Utf8Bytes)>,
    notes: Vec<NoteJson>,
    back: Option<Value>,
    back_is_new: bool,
    history: History,
    end: Option<Value>,
    end_is_new: bool,
    dropped: Dropped,
}

impl Model {
    /// Creates an empty model. `instance` is a unique name of this run.
    pub fn new(site: Site, instance: String) -> Self {
        Self {
            site,
            instance,
            jumps: 0,
            seq: 0,
            clock: DiveClock::default(),
            sections: BTreeMap::new(),
            changed: Vec::new(),
            samples: Samples::default(),
            sent_samples: 0,
            places: VecDeque::new(),
            state: None,
            state_is_new: false,
            listed: 0,
            playback: None,
            new_events: Vec::new(),
            events: VecDeque::new(),
            notes: Vec::new(),
            back: None,
            back_is_new: false,
            history: History::default(),
            end: None,
            end_is_new: false,
            dropped: Dropped::default(),
        }
    }

    /// Makes the model keep the history of the whole dive.
    pub fn keep_whole(&mut self) {
        self.history.whole = true;
    }

    /// Applies a message from the loop. Returns whether the change must be displayed at once.
    pub fn take(&mut self, fed: Fed) -> bool {
        match fed {
            Fed::News(news) => return self.news(*news),
            Fed::Jump(at) => self.jump(at),
            Fed::Playback(state) => {
                self.playback = Some(state);
                self.state_is_new = true;
            }
            Fed::End(end) => {
                self.end = Some(*end);
                (self.end_is_new, self.state_is_new) = (true, true);
            }
        }
        true
    }

    fn news(&mut self, news: News) -> bool {
        if news.clock.zero().is_some() {
            self.clock = news.clock;
        }
        if news.is_skipped {
            let at_ms = self.ms(news.now);
            self.samples.take(at_ms, &news.samples, self.site.is_playback);
            return false;
        }
        let is_urgent = !news.events.is_empty();
        for record in news.sections {
            let before = self.sections.get(&record.index);
            if before.is_none_or(|before| before.record != record) {
                let seen = before.map_or(0, |before| before.seen);
                self.sections.insert(record.index, Shown { record, seen, seq: 0 });
                self.changed.push(record.index);
            }
        }
        for sample in news.samples.iter().chain(&news.mended) {
            self.see(f64::from(sample.x_m), sample.seen());
        }
        let at_ms = self.ms(news.now);
        self.samples.take(at_ms, &news.samples, self.site.is_playback);
        if !news.mended.is_empty() {
            self.samples.take(at_ms, &news.mended, false);
        }
        self.history.take(&news.state);
        if let Some(playback) = &mut self.playback {
            playback.at_s = self.clock.seconds(news.now);
        }
        self.state = Some(Box::new((news.state, news.beside)));
        self.state_is_new = true;
        self.new_events.extend(news.events);
        self.notes = news.notes.unwrap_or(core::mem::take(&mut self.notes));
        if news.back.is_some() {
            (self.back, self.back_is_new) = (news.back, true);
        }
        self.dropped = news.dropped;
        is_urgent
    }

    fn see(&mut self, x_m: f64, seen: u64) {
        #[expect(clippy::cast_possible_truncation, reason = "chainages of a tunnel in sections")]
        let index = (x_m / self.site.section_m).floor() as i32;
        let blank = || Shown { record: SectionRecord::blank(index), seen: 0, seq: 0 };
        if seen == 0 {
            return;
        }
        let shown = self.sections.entry(index).or_insert_with(blank);
        if shown.seen | seen != shown.seen {
            shown.seen |= seen;
            self.changed.push(index);
        }
    }

    fn jump(&mut self, at: MonoNs) {
        self.jumps += 1;
        self.state = None;
        self.sections.clear();
        self.changed.clear();
        self.events.clear();
        self.new_events.clear();
        self.places.clear();
        self.samples.jump(self.ms(at));
        self.history.jump(self.clock.seconds(at));
        self.end = None;
        let seen: Vec<_> = self.samples.since(0).map(|sample| (sample.x_m, sample.seen())).collect();
        for (x_m, seen) in seen {
            self.see(f64::from(x_m), seen);
        }
        self.sent_samples = self.samples.len();
    }

    fn ms(&self, at: MonoNs) -> u32 {
        u32::try_from(self.clock.time(at).0 / 1_000_000).unwrap_or(u32::MAX)
    }

    /// Returns the unique name of this dive. In a replay each seek gives a new name.
    pub fn instance(&self) -> String {
        if self.jumps == 0 { self.instance.clone() } else { format!("{}.{}", self.instance, self.jumps) }
    }

    /// Returns the changes since the previous call, as messages for all viewers.
    pub fn flush(&mut self) -> Vec<Message> {
        let mut messages = Vec::new();
        for value in core::mem::take(&mut self.new_events) {
            let message = self.text(value, Sort::Other);
            if let Body::Text(text) = &message.body {
                self.events.push_back((message.seq, text.clone()));
            }
            messages.push(message);
        }
        while self.events.len() > MOST_EVENTS {
            self.events.pop_front();
        }
        messages.extend(self.flush_sections());
        messages.extend(self.flush_samples());
        if core::mem::take(&mut self.back_is_new)
            && let Some(back) = self.back.clone()
        {
            messages.push(self.text(back, Sort::Other));
        }
        if core::mem::take(&mut self.state_is_new)
            && let Some(state) = self.state()
        {
            if core::mem::replace(&mut self.listed, self.jumps) != self.jumps {
                let lists = self.lists();
                messages.extend(lists.into_iter().map(|list| self.text(list, Sort::Other)));
            }
            messages.push(self.text(state, Sort::State));
        }
        if core::mem::take(&mut self.end_is_new)
            && let Some(end) = self.end.clone()
        {
            messages.push(self.text(end, Sort::Other));
        }
        messages
    }

    /// Returns the present state as a new message, for viewers of a paused dive.
    pub fn again(&mut self) -> Option<Message> {
        let state = self.state()?;
        Some(self.text(state, Sort::State))
    }

    fn flush_sections(&mut self) -> Option<Message> {
        let mut changed = core::mem::take(&mut self.changed);
        changed.sort_unstable();
        changed.dedup();
        if changed.is_empty() {
            return None;
        }
        self.seq += 1;
        let mut records = Vec::with_capacity(changed.len());
        for index in changed {
            if let Some(shown) = self.sections.get_mut(&index) {
                shown.seq = self.seq;
                records.push((shown.record, shown.seen));
            }
        }
        Some(self.binary(section_frame(self.seq, &records), Sort::Other))
    }

    fn flush_samples(&mut self) -> Option<Message> {
        let new = self.samples.len().saturating_sub(self.sent_samples);
        if new == 0 {
            return None;
        }
        self.seq += 1;
        let step = new.div_ceil(MOST_AT_ONCE);
        let some: Vec<_> = self.samples.since(self.sent_samples).step_by(step).copied().collect();
        self.sent_samples = self.samples.len();
        self.places.push_back((self.seq, self.sent_samples));
        if self.places.len() > MOST_PLACES {
            self.places.pop_front();
        }
        Some(self.binary(sample_frame(self.seq, &some), Sort::Samples))
    }

    fn text(&mut self, mut value: Value, sort: Sort) -> Message {
        self.seq += 1;
        if let Some(object) = value.as_object_mut() {
            object.insert("seq".to_owned(), self.seq.into());
        }
        Message { seq: self.seq, sort, body: Body::Text(value.to_string().into()) }
    }

    fn binary(&self, bytes: Vec<u8>, sort: Sort) -> Message {
        Message { seq: self.seq, sort, body: Body::Binary(bytes.into()) }
    }

    /// Returns the messages for a viewer that connects: everything, or only the changes since message `since`.
    ///
    /// Call [`Model::flush`] first.
    pub fn catch_up(&self, since: Option<u64>, may: May, tokens_needed: bool) -> Vec<Message> {
        let since = since.filter(|since| *since <= self.seq);
        // These messages carry the number `since`, so that a viewer that disconnects before it has all of them resumes
        // from `since`.
        let low = since.unwrap_or(0);
        let text = |value: &Value| {
            let body = Body::Text(numbered(value, low).to_string().into());
            Message { seq: low, sort: Sort::Other, body }
        };
        let binary =
            |bytes: Vec<u8>| Message { seq: low, sort: Sort::Other, body: Body::Binary(bytes.into()) };
        let mut messages = vec![text(&self.hello(may, tokens_needed, None))];
        let missed = |shown: &&Shown| since.is_none_or(|since| shown.seq > since);
        let sections: Vec<_> =
            self.sections.values().filter(missed).map(|shown| (shown.record, shown.seen)).collect();
        if !sections.is_empty() {
            messages.push(binary(section_frame(low, &sections)));
        }
        let known = since.and_then(|since| self.samples_until(since));
        let first = known.unwrap_or(0).max(self.samples.len().saturating_sub(MOST_BACK));
        let samples: Vec<_> = self.samples.since(first).copied().collect();
        if !samples.is_empty() {
            messages.push(binary(sample_frame(low, &samples)));
        }
        if let Some(since) = since {
            let missed = self.events.iter().filter(|(seq, _)| *seq > since);
            messages.extend(missed.map(|(seq, events)| Message {
                seq: *seq,
                sort: Sort::Other,
                body: Body::Text(events.clone()),
            }));
        }
        messages.extend(self.lists().iter().chain(&self.back).map(text));
        messages.push(text(&self.history.message(low)));
        messages.extend(self.state().as_ref().map(text));
        messages.extend(self.end.as_ref().map(text));
        let ready = numbered(&json!({"type": "ready"}), self.seq).to_string();
        messages.push(Message { seq: self.seq, sort: Sort::Other, body: Body::Text(ready.into()) });
        messages
    }

    /// Returns the number of samples sent up to message `since`; `None` if the model no longer has this number.
    fn samples_until(&self, since: u64) -> Option<usize> {
        let place = self.places.partition_point(|(seq, _)| *seq <= since).checked_sub(1)?;
        self.places.get(place).map(|(_, count)| *count)
    }

    /// Returns the dive time at which the voice note with this id starts, seconds.
    ///
    /// Returns `None` if there is no such note, or it has no recording.
    pub(crate) fn spoken_s(&self, id: u32) -> Option<f64> {
        let is_it = |note: &&NoteJson| {
            note.voice.as_ref().is_some_and(|voice| voice.id == id && voice.seconds.is_some())
        };
        self.notes.iter().find(is_it).map(|note| note.at_s)
    }

    /// Returns the messages that list all alerts and notes.
    fn lists(&self) -> Vec<Value> {
        let state = self.state.as_ref().map(|shown| &shown.0);
        let (list, hidden) =
            state.map_or((json!([]), 0), |state| (json!(state.alert_list), state.alerts_hidden));
        vec![
            json!({"type": "alerts", "list": list, "hidden": hidden}),
            json!({"type": "notes", "list": self.notes}),
        ]
    }

    /// Returns the first message to a viewer.
    pub fn hello(&self, may: May, tokens_needed: bool, thinned: Option<usize>) -> Value {
        let instance = self.instance();
        let begun_utc_s = self.begun_utc_s();
        let greeting =
            Greeting { seq: self.seq, instance: &instance, may, begun_utc_s, tokens_needed, thinned };
        serde_json::to_value(self.site.hello(&greeting))
            .unwrap_or_else(|error| json!({"error": error.to_string()}))
    }

    /// Returns the UTC at which dive time is zero, seconds since 1970; `None` while unknown.
    fn begun_utc_s(&self) -> Option<f64> {
        self.site.utc_of_zero_s.zip(self.clock.zero()).map(|(utc_s, zero)| utc_s + zero.as_secs_f64())
    }

    /// Returns the live state as a message.
    pub fn state(&self) -> Option<Value> {
        let (state, beside) = &**self.state.as_ref()?;
        let mut value = serde_json::to_value(state).ok()?;
        let object = value.as_object_mut()?;
        object.insert("type".to_owned(), "state".into());
        object.insert("t_s".to_owned(), state.now_s.into());
        if let Ok(Value::Object(beside)) = serde_json::to_value(beside) {
            object.extend(beside);
        }
        object.insert("begun_utc_s".to_owned(), json!(self.begun_utc_s()));
        object.insert("playback".to_owned(), json!(self.playback));
        object.insert("ended".to_owned(), self.end.is_some().into());
        object.insert("page_dropped".to_owned(), json!(self.dropped));
        Some(value)
    }

    /// Returns the dive time of the live state, seconds.
    pub fn now_s(&self) -> Option<f64> {
        self.state.as_ref().map(|shown| shown.0.now_s)
    }

    /// Returns a frame with the samples between two chainages, m, and the thinning step n: the frame has every n-th
    /// sample.
    ///
    /// The frame has at most [`MOST_IN_RANGE`] samples.
    pub fn samples_frame(&self, from_m: f32, to_m: f32) -> (Vec<u8>, usize) {
        let (samples, step) = self.samples.between(from_m, to_m, MOST_IN_RANGE);
        (sample_frame(self.seq, &samples), step)
    }

    /// Returns all samples of the dive.
    pub fn samples(&self) -> &Samples {
        &self.samples
    }

    /// Returns the counts of data dropped on the way to the page.
    pub fn dropped(&self) -> Dropped {
        self.dropped
    }

    /// Returns the number of the latest message.
    pub fn seq(&self) -> u64 {
        self.seq
    }

    /// Returns the number of sections.
    pub fn sections(&self) -> usize {
        self.sections.len()
    }

    /// Returns the constants of the dive.
    pub fn site(&self) -> &Site {
        &self.site
    }

    /// Returns all sections as a frame.
    pub fn sections_frame(&self) -> Vec<u8> {
        let all: Vec<_> = self.sections.values().map(|shown| (shown.record, shown.seen)).collect();
        section_frame(self.seq, &all)
    }

    /// Returns messages for an exported file: alerts, notes, history, and the missed stretches to go back to.
    pub fn closing(&self) -> Vec<Value> {
        let mut all = self.lists();
        all.push(self.history.message(self.seq));
        all.extend(self.back.clone());
        all
    }

    /// Returns the last message of the dive; `None` if the dive hasn't ended.
    pub fn end(&self) -> Option<&Value> {
        self.end.as_ref()
    }
}

/// Returns a message with its message number added.
fn numbered(value: &Value, seq: u64) -> Value {
    let mut value = value.clone();
    if let Some(object) = value.as_object_mut() {
        object.insert("seq".to_owned(), seq.into());
    }
    value
}
