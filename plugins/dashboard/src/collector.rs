//! Collects the page's data on the loop's thread, and passes it to the page's thread without waiting.
//!
//! While the queue is full, data stays in the collector and is sent with the next message. The collector keeps all
//! section numbers, the latest state, and a limited number of samples and events. Data beyond these limits is dropped
//! and counted. Dropped wall samples are read again from the loop's own store if the store has them.

use std::collections::BTreeSet;

use headrace_geometry::frames::{Mount, Point3, Vec3};
use headrace_geometry::time::{DiveClock, DurNs, MonoNs};
use headrace_geometry::tunnel::WallPoint;
use headrace_monitor::alert_list::NoteJson;
use headrace_monitor::live_messages::LiveMessage;
use headrace_monitor::live_text::{message_line, status_line};
use headrace_monitor::messages::{Notice, Outcome as Placing};
use headrace_monitor::report::go_back;
use headrace_monitor::result_stream::{RecordKind, first_record};
use headrace_monitor::run::Loop;
use headrace_sensor::device::{SensorInfo, SensorKind};
use headrace_sensor::reading::Reading;
use serde_json::{Value, json};
use tokio::sync::mpsc::Sender;
use tokio::sync::mpsc::error::TrySendError;

use crate::compared::Compared;
use crate::fed::{Beside, Dropped, EchoJson, Fed, News, PlaybackState, PoseJson, RateJson, RecordingJson};
use crate::wire::{NONE, Outcome, SampleRecord, SectionRecord};

/// Capacity of the queue to the page's thread, messages.
pub(crate) const WAITING: usize = 64;
/// Maximum number of samples kept while the queue is full: ten seconds of four heads.
const MOST_SAMPLES: usize = 20_000;
/// Maximum length of wall for which one message replaces dropped samples, m.
const MENDED_AT_ONCE_M: f64 = 10.0;
/// Shortest piece of wall for which samples are read from the loop's store, m. If even this piece has too many samples,
/// some of them are left out.
const SHORTEST_MENDED_M: f64 = 0.01;
/// Maximum number of events, such as live messages, kept while the queue is full.
const MOST_EVENTS: usize = 256;
/// Maximum number of sections in one message.
const SECTIONS_AT_ONCE: usize = 4096;
/// Longest interval between two live states sent to the page. When it has passed, a state is sent even without an
/// update.
const EVERY: DurNs = DurNs(200_000_000);
/// Averaging window for the sensors' rates of readings.
const RATES_OVER: DurNs = DurNs(2_000_000_000);
/// Minimum change in the length of the way back after which the list of missed stretches is sent again, m.
const WAY_STEP_M: f64 = 0.5;
/// Minimum interval between two lists of missed stretches to go back to.
const BACK_EVERY: DurNs = DurNs(1_000_000_000);

/// The latest ping of an echosounder.
#[derive(Debug, Clone, Copy)]
struct Ping {
    at: MonoNs,
    range_m: Option<f64>,
}

/// A sensor, with the data for its displayed rate and range.
#[derive(Debug)]
struct Followed {
    id: String,
    mount: Mount,
    is_echosounder: bool,
    /// Index of this sensor among the heads; [`NONE`] for other sensors.
    head: u8,
    ping: Option<Ping>,
    hz: f64,
    /// Number of readings at the start of the averaging window.
    readings: u64,
}

/// Collects the page's data. The loop must keep its results, and the collector must be called after every tick.
#[expect(clippy::struct_excessive_bools, reason = "independent flags for what is due")]
pub struct Collector {
    to: Sender<Fed>,
    /// Whether the collector waits while the queue is full. A replay waits, but a live dive doesn't.
    waits: bool,
    is_playback: bool,
    sensors: Vec<Followed>,
    rates_from: Option<MonoNs>,
    clock: DiveClock,
    sent: Option<MonoNs>,
    /// Time of the latest tick that was played. Ticks that a seek skips don't count.
    played: Option<MonoNs>,
    changed: BTreeSet<i64>,
    samples: Vec<SampleRecord>,
    events: Vec<Value>,
    /// Range of chainage whose samples the page lacks, m. They will be read from the loop's store.
    unsent_m: Option<[f64; 2]>,
    dropped: Dropped,
    skips: bool,
    back_due: bool,
    notes_due: bool,
    /// The most recently sent list of missed stretches, with its time and the length of the way back, m.
    back_sent: Option<(MonoNs, f64, Value)>,
    /// Depth by the latest reading of the pressure sensor, m.
    depth_m: Option<f64>,
    recording: RecordingJson,
    playback: Option<PlaybackState>,
    compared: Option<Compared>,
}

impl Collector {
    /// Creates a collector for a loop; `waits` is true for a replay.
    pub(crate) fn new(
        to: Sender<Fed>,
        dive: &Loop,
        waits: bool,
        is_playback: bool,
        recorded_to: Option<String>,
    ) -> Self {
        let mut heads = 0..NONE;
        let followed = |(source, info): (&headrace_monitor::SourceInfo, SensorInfo)| Followed {
            id: source.id.clone(),
            mount: info.mount,
            is_echosounder: matches!(info.kind, SensorKind::Echosounder { .. }),
            head: if info.kind == SensorKind::Head { heads.next().unwrap_or(NONE) } else { NONE },
            ping: None,
            hz: 0.0,
            readings: 0,
        };
        Self {
            to,
            waits,
            is_playback,
            sensors: dive.sources().iter().zip(dive.sensors()).map(followed).collect(),
            rates_from: None,
            clock: DiveClock::default(),
            sent: None,
            played: None,
            changed: BTreeSet::new(),
            samples: Vec::new(),
            events: Vec::new(),
            unsent_m: None,
            dropped: Dropped::default(),
            skips: false,
            back_due: false,
            notes_due: false,
            back_sent: None,
            depth_m: None,
            recording: RecordingJson {
                on: recorded_to.is_some(),
                fails: false,
                words: None,
                read_again_pct: None,
                path: recorded_to,
            },
            playback: None,
            compared: None,
        }
    }

    /// Makes the collector also send verdicts for a second target, `target_m`, if there is one.
    pub(crate) fn compared_with(self, target_m: Option<f64>) -> Self {
        Self { compared: target_m.map(Compared::with), ..self }
    }

    /// Collects the live messages that a notice, a tick or the end of the dive causes. Call this method before the
    /// method that handles the notice, the tick or the end.
    pub fn messages(&mut self, messages: &[LiveMessage], dive: &Loop) {
        for one in messages {
            let mut value =
                serde_json::to_value(one).unwrap_or_else(|error| json!({"error": error.to_string()}));
            if let Some(object) = value.as_object_mut() {
                let line = message_line(one, &dive.mission().profile, dive.head_descriptions());
                object.insert("t_s".to_owned(), dive.view().clock().seconds(dive.now()).into());
                object.entry("text").or_insert_with(|| line.text().into());
            }
            self.push_told(value);
        }
    }

    /// Collects one notice of the latest tick.
    pub fn notice(&mut self, notice: &Notice) {
        match notice {
            Notice::Section { section, .. } => {
                self.changed.insert(*section);
            }
            Notice::Run { .. } => self.back_due = true,
            Notice::Note(_) => self.notes_due = true,
            Notice::Advice(_) | Notice::Listed { .. } => {}
        }
    }

    /// Collects the results of the latest tick, and sends the data that are due.
    pub fn tick(&mut self, dive: &Loop) {
        self.gather(dive);
        let now = dive.now();
        self.played = Some(now);
        let is_due = self.sent.is_none_or(|sent| now.since(sent).0.abs() >= EVERY.0);
        // Playback needs each tick's samples in a message of their own, so that it can seek back to any tick.
        if is_due
            || !self.events.is_empty()
            || !self.changed.is_empty()
            || self.is_playback && !self.samples.is_empty()
        {
            self.send(dive);
        }
    }

    /// Collects the results of a tick that a seek skips over.
    pub fn skipped(&mut self, dive: &Loop) {
        self.gather(dive);
        self.skips = true;
        self.send(dive);
        self.skips = false;
    }

    /// Handles a state of the dive that was rebuilt from the log. The wall that the dive has covered so far is sent in
    /// pieces.
    pub fn rebuilt(&mut self, dive: &Loop) {
        self.clock = dive.view().clock();
        self.unsent_m = dive.view().coverage().frontier.way().map(|way| [way.from_m, way.to_m]);
        (self.back_due, self.notes_due) = (true, true);
        self.change_all(dive);
    }

    /// Collects a change of a sensor's connection.
    pub fn sensor(&mut self, id: &str, phase: &str, text: &str, at: MonoNs) {
        self.push_told(
            json!({"type": "sensor", "t_s": self.clock.seconds(at), "id": id, "phase": phase, "text": text}),
        );
    }

    /// Collects a change of a recording.
    pub fn recording(&mut self, fails: bool, text: &str, at: MonoNs) {
        self.push_told(
            json!({"type": "recording", "t_s": self.clock.seconds(at), "fails": fails, "text": text}),
        );
    }

    /// Sets the displayed text about the recordings, and whether it is an alarm; `None` if recording works.
    /// `read_again_pct` has a value only while an interrupted dive's log is read again.
    pub fn recorded(&mut self, shown: Option<(String, bool)>, read_again_pct: Option<u8>) {
        self.recording.read_again_pct = read_again_pct;
        let (words, fails) = shown.unzip();
        (self.recording.words, self.recording.fails) = (words, fails.unwrap_or_default());
    }

    /// Collects the state of playback.
    pub fn playback(&mut self, state: PlaybackState) {
        self.playback = Some(state);
        self.hand(Fed::Playback(state));
    }

    /// Handles a seek or pause of playback, because either may have changed the loop's state.
    pub fn stopped(&mut self, dive: &Loop) {
        if self.played == Some(dive.now()) {
            self.send(dive);
            return;
        }
        let now = dive.now();
        (self.sent, self.rates_from, self.back_sent) = (None, None, None);
        (self.back_due, self.notes_due) = (true, true);
        if let Some(compared) = &mut self.compared {
            compared.forget();
        }
        self.sensors.iter_mut().for_each(|sensor| sensor.ping = None);
        self.depth_m = None;
        self.samples.clear();
        self.events.clear();
        self.played = Some(now);
        self.hand(Fed::Jump(now));
        self.change_all(dive);
        self.send(dive);
    }

    /// Sends the end of the dive. Call it when all sections are judged.
    pub fn end(&mut self, dive: &Loop) {
        self.change_all(dive);
        if let Some(compared) = &mut self.compared {
            compared.forget();
        }
        self.back_due = true;
        self.back_sent = None;
        // From the end of the dive on, even a live dive waits for room in the queue.
        self.waits = true;
        while !self.changed.is_empty() && self.send(dive) {}
    }

    /// Marks all sections of the dive as changed, because some sections change without a notice.
    fn change_all(&mut self, dive: &Loop) {
        let (sections, way) = (&dive.view().coverage().sections, dive.view().coverage().frontier.way());
        self.changed.extend(sections.sections_of(way));
    }

    fn gather(&mut self, dive: &Loop) {
        self.clock = dive.view().clock();
        for event in dive.view().readings() {
            match &event.reading {
                Reading::Echo(echo) => {
                    if let Some(sensor) = self.sensors.get_mut(event.source.index()) {
                        sensor.ping = Some(Ping { at: event.received, range_m: echo.range_m });
                    }
                }
                Reading::Pressure(water) => {
                    self.depth_m = Some(rounded(dive.mission().site.depth_m(water.pressure_pa), 1e2));
                }
                _ => {}
            }
        }
        self.samples_of(dive);
        self.aims_of(dive);
    }

    /// Collects the samples and doubtful returns of the latest tick.
    #[expect(clippy::cast_possible_truncation, reason = "shown to a fraction of a millimetre")]
    fn samples_of(&mut self, dive: &Loop) {
        let perimeter_m = dive.mission().profile.perimeter_m();
        let mut words = dive.view().surveyor().digests().pings.words();
        while let Some((record, rest)) = first_record(words) {
            words = rest;
            let outcome = match record.kind {
                Some(RecordKind::Sample) => Outcome::Wall,
                Some(RecordKind::Doubtful) => Outcome::Doubtful,
                _ => continue,
            };
            let [at, source, _, x, y, z, arc, ..] = *record.words else { continue };
            let [x_m, y_m, z_m, arc_m] = [x, y, z, arc].map(f64::from_bits);
            let [x, y, z] = [x_m, y_m, z_m].map(|value| value as f32);
            let (t_ms, head) = (self.t_ms(MonoNs(at)), self.head(source));
            let arc = SampleRecord::arc_of(arc_m, perimeter_m);
            self.push(SampleRecord { t_ms, x_m: x, y_m: y, z_m: z, arc, head, outcome: outcome as u8 });
        }
    }

    /// Collects each ping without a return, with the point at which it was aimed.
    #[expect(clippy::cast_possible_truncation, reason = "shown to a fraction of a millimetre")]
    fn aims_of(&mut self, dive: &Loop) {
        let perimeter_m = dive.mission().profile.perimeter_m();
        for ping in dive.view().placed().pings() {
            let Placing::Lost(_, Some(aim)) = ping.outcome else { continue };
            let sample = SampleRecord {
                t_ms: self.t_ms(ping.received),
                x_m: aim.x_m as f32,
                y_m: f32::NAN,
                z_m: f32::NAN,
                arc: SampleRecord::arc_of(aim.arc_m, perimeter_m),
                head: u8::try_from(ping.head).unwrap_or(NONE),
                outcome: Outcome::NoReturn as u8,
            };
            self.push(sample);
        }
    }

    fn t_ms(&self, at: MonoNs) -> u32 {
        u32::try_from(self.clock.time(at).0 / 1_000_000).unwrap_or(u32::MAX)
    }

    /// Returns the index of the head whose packets come from this source.
    fn head(&self, source: u64) -> u8 {
        let sensor = usize::try_from(source).ok().and_then(|source| self.sensors.get(source));
        sensor.map_or(NONE, |sensor| sensor.head)
    }

    fn push(&mut self, sample: SampleRecord) {
        if self.samples.len() < MOST_SAMPLES {
            self.samples.push(sample);
            return;
        }
        self.dropped.samples += 1;
        let x_m = f64::from(sample.x_m);
        let [from_m, to_m] = self.unsent_m.unwrap_or([x_m; 2]);
        self.unsent_m = Some([from_m.min(x_m), to_m.max(x_m)]);
    }

    fn push_told(&mut self, value: Value) {
        if self.events.len() < MOST_EVENTS {
            self.events.push(value);
        } else {
            self.dropped.events += 1;
        }
    }

    /// Sends the collected data. Returns `false` if the queue is full or the page has ended.
    fn send(&mut self, dive: &Loop) -> bool {
        if self.to.is_closed() || !self.waits && self.to.capacity() == 0 {
            return false;
        }
        if let Some(compared) = &mut self.compared {
            compared.refresh(dive, |index| _ = self.changed.insert(index));
        }
        let mut changed = Vec::new();
        while changed.len() < SECTIONS_AT_ONCE
            && let Some(index) = self.changed.pop_first()
        {
            let other = self.compared.as_ref().and_then(|compared| compared.verdict(index));
            let record = dive.view().section_row(index).and_then(|row| SectionRecord::of(&row));
            changed.extend(record.map(|record| record.compared(other)));
        }
        let now = dive.now();
        self.take_rates(now, dive);
        let news = News {
            now,
            is_skipped: self.skips,
            clock: self.clock,
            state: Box::new(dive.view().live_state_json()),
            beside: self.beside(dive),
            samples: core::mem::take(&mut self.samples),
            mended: self.mended(dive),
            sections: changed,
            events: core::mem::take(&mut self.events),
            notes: core::mem::take(&mut self.notes_due)
                .then(|| dive.view().notes().iter().map(|note| NoteJson::of(note, self.clock)).collect()),
            back: self.back(dive),
            dropped: self.dropped,
        };
        self.sent = Some(now);
        self.hand(Fed::News(Box::new(news)));
        true
    }

    /// Passes a message to the queue. A replay waits for room; in a live dive a full queue drops the message.
    fn hand(&self, message: Fed) {
        if self.waits {
            // Sending fails once the page has ended. The failure needs no action.
            let _gone = self.to.blocking_send(message);
        } else if let Err(TrySendError::Full(_)) = self.to.try_send(message) {
            tracing::debug!("the page is behind");
        }
    }

    /// Reads wall samples from the loop's store to replace the dropped samples. The store has neither times
    /// nor head numbers.
    #[expect(clippy::cast_possible_truncation, reason = "shown to a fraction of a millimetre")]
    fn mended(&mut self, dive: &Loop) -> Vec<SampleRecord> {
        let Some([from_m, whole_to_m]) = self.unsent_m.take() else { return Vec::new() };
        let (store, mut to_m) = (&dive.view().coverage().store, whole_to_m.min(from_m + MENDED_AT_ONCE_M));
        let count = |to_m: f64| {
            let mut count = 0;
            store.each_between(from_m, to_m, |_, _| count += 1);
            count
        };
        while count(to_m) > MOST_SAMPLES && to_m - from_m > SHORTEST_MENDED_M {
            to_m = from_m.midpoint(to_m);
        }
        self.unsent_m = (to_m < whole_to_m).then_some([to_m, whole_to_m]);
        let (profile, t_ms) = (&dive.mission().profile, self.t_ms(dive.now()));
        let mut mended = Vec::new();
        store.each_between(from_m, to_m, |WallPoint { x_m, arc_m }, _| {
            if mended.len() < MOST_SAMPLES {
                let [y_m, z_m] = profile.point_at(arc_m).map(|value| value as f32);
                let arc = SampleRecord::arc_of(arc_m, profile.perimeter_m());
                mended.push(SampleRecord {
                    t_ms,
                    x_m: x_m as f32,
                    y_m,
                    z_m,
                    arc,
                    head: NONE,
                    outcome: Outcome::Wall as u8,
                });
            }
        });
        mended
    }

    fn take_rates(&mut self, now: MonoNs, dive: &Loop) {
        let counts = dive.view().health().iter().map(|health| health.readings);
        let Some(from) = self.rates_from else {
            self.rates_from = Some(now);
            self.sensors.iter_mut().zip(counts).for_each(|(sensor, readings)| sensor.readings = readings);
            return;
        };
        let over = now.since(from);
        if over.0 >= RATES_OVER.0 {
            for (sensor, readings) in self.sensors.iter_mut().zip(counts) {
                sensor.hz =
                    rounded(readings.saturating_sub(sensor.readings) as f64 / over.as_secs_f64(), 10.0);
                sensor.readings = readings;
            }
            self.rates_from = Some(now);
        }
    }

    fn beside(&self, dive: &Loop) -> Beside {
        let fix = dive.view().vehicle().fix.ok();
        let pose = fix.map(|fix| {
            let (roll, pitch, yaw) = fix.pose.attitude.roll_pitch_yaw();
            let deg = |rad: f64| rounded(rad.to_degrees(), 100.0);
            let (y_m, z_m) = (rounded(fix.pose.position.y(), 1e3), rounded(fix.pose.position.z(), 1e3));
            PoseJson { y_m, z_m, roll_deg: deg(roll), pitch_deg: deg(pitch), yaw_deg: deg(yaw) }
        });
        let (now, mut echosounders) = (dive.now(), Vec::new());
        for sensor in self.sensors.iter().filter(|sensor| sensor.is_echosounder) {
            let (Some(ping), Some(fix)) = (sensor.ping, fix) else { continue };
            let across = |point: Point3<_>| [rounded(point.y(), 1e3), rounded(point.z(), 1e3)];
            let from = across(fix.pose.place(sensor.mount.position));
            let to = ping.range_m.map(|range_m| {
                let along = sensor.mount.rotation * Vec3::new(range_m, 0.0, 0.0);
                across(fix.pose.place(sensor.mount.position + along))
            });
            let age_s = rounded(now.since(ping.at).as_secs_f64(), 1e3);
            echosounders.push(EchoJson { id: sensor.id.clone(), range_m: ping.range_m, age_s, from, to });
        }
        let rates = self.sensors.iter().map(|sensor| RateJson { id: sensor.id.clone(), hz: sensor.hz });
        let name =
            |source: usize| dive.sources().get(source).map_or_else(String::new, |info| info.id.clone());
        let text =
            status_line(dive.view().live_state(), &dive.mission().profile, dive.head_descriptions(), &name)
                .text();
        let compared = self.compared.as_ref().map(Compared::json);
        Beside {
            pose,
            depth_m: self.depth_m,
            echosounders,
            rates: rates.collect(),
            recording: self.recording.clone(),
            compared,
            text,
        }
    }

    /// Returns the missed stretches to go back to, from the far end to the portal, if the list has changed
    /// and is due.
    fn back(&mut self, dive: &Loop) -> Option<Value> {
        let now = dive.now();
        let sent = self.back_sent.as_ref();
        let waits = sent.is_some_and(|(then, ..)| (0..BACK_EVERY.0).contains(&now.since(*then).0));
        // Even without new missed stretches, the way back changes as the vehicle moves.
        let has_legs = sent.is_some_and(|(.., legs)| legs.as_array().is_some_and(|legs| !legs.is_empty()));
        if waits || !self.back_due && !has_legs {
            return None;
        }
        self.back_due = false;
        let (legs, mut at_m, mut way_m) =
            (go_back(&dive.view().coverage().sections), dive.view().live_state().chainage_m, 0.0);
        let mut time_s = Some(0.0);
        let mut shown = Vec::new();
        for leg in &legs {
            way_m += at_m.map_or(0.0, |at_m| (at_m - leg.from_m).abs()) + leg.from_m - leg.back_to_m;
            at_m = Some(leg.back_to_m);
            time_s = time_s.zip(leg.takes_s).map(|(sum, takes_s)| sum + takes_s);
            let why: Vec<_> = leg.actions.iter().map(|action| action.as_str().replace('_', " ")).collect();
            let at_most_mps = (leg.at_most_mps > 0.0).then_some(leg.at_most_mps);
            shown.push(json!({"from_m": leg.from_m, "to_m": leg.to_m, "back_to_m": leg.back_to_m,
                "at_most_mps": at_most_mps, "why": why.join(", ")}));
        }
        let legs = Value::from(shown);
        let is_old = |(_, sent_m, before): &(MonoNs, f64, Value)| {
            *before == legs && (sent_m - way_m).abs() < WAY_STEP_M
        };
        if self.back_sent.as_ref().is_some_and(is_old) {
            return None;
        }
        let time_s = time_s.map(|s| rounded(s, 10.0));
        let back = json!({"type": "back", "legs": legs, "way_m": rounded(way_m, 100.0), "time_s": time_s});
        self.back_sent = Some((now, way_m, legs));
        Some(back)
    }
}

fn rounded(value: f64, parts: f64) -> f64 {
    (value * parts).round() / parts
}
