//! Provides a recorded dive as a source of packets for the loop.

use std::cell::OnceCell;
use std::collections::BTreeMap;
use std::path::PathBuf;

use headrace_geometry::time::{DiveClock, MonoNs};
use headrace_monitor::SourceInfo;
use headrace_monitor::console::CONSOLE_ID;
use headrace_monitor::ring::{MAX_PACKET_BYTES, NO_ORDER, Port, RingError};
use headrace_sensor::reading::SourceId;
use serde::{Deserialize, Serialize};

use crate::clocks::{self, Clock};
use crate::drive::{Coming, PacketSource};
use crate::log::{DiveLog, DivePlace, LogError, LogInfo, Loss, MessageKind, PartFile};
use crate::saved_state::Consumed;

/// Plays the messages of a log that were received from sources.
pub struct Player {
    reader: DiveLog,
    /// For each source of the log, the loop's source of the same name.
    sources: Vec<Option<SourceId>>,
    ids: Vec<String>,
    next: Option<Coming>,
    bytes: Vec<u8>,
    order: u64,
    played: u64,
    /// Number of messages by source id, for sources that are missing from the vehicle file.
    unmatched: BTreeMap<String, u64>,
    too_long: u64,
    /// The clock with the most messages, if the log has several clocks.
    clock: Option<Clock>,
    dive_clock: OnceCell<DiveClock>,
    /// Whether the dive's clock has started with a packet of one of the loop's sensors.
    is_started: bool,
    /// Messages with timestamps of another clock, by source id: count and first timestamp.
    astray: BTreeMap<String, (u64, MonoNs)>,
    /// The farthest position that playback has reached, as a number of messages, and the losses up to that position.
    farthest: (u64, Vec<String>),
}

/// A player's position in its log, from which playing can be resumed.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct PlayerPlace {
    pub(crate) log: DivePlace,
    /// A message that was read but not sent yet: receive time, source, bytes.
    next: Option<(MonoNs, u16, Vec<u8>)>,
    order: u64,
    played: u64,
    unmatched: BTreeMap<String, u64>,
    too_long: u64,
    astray: BTreeMap<String, (u64, MonoNs)>,
}

impl Player {
    /// Opens a log, or the parts of a recording.
    ///
    /// Errors: see [`DiveLog::open`].
    pub fn open(files: &[PathBuf]) -> Result<Self, LogError> {
        let reader = DiveLog::open(files)?;
        let clock = clocks::of(files, reader.times())?;
        let ids: Vec<String> = reader.header().sources.iter().map(|source| source.id.clone()).collect();
        Ok(Self {
            sources: vec![None; ids.len()],
            ids,
            next: None,
            bytes: Vec::new(),
            order: 0,
            played: 0,
            unmatched: BTreeMap::new(),
            too_long: 0,
            clock,
            dive_clock: OnceCell::new(),
            is_started: false,
            astray: BTreeMap::new(),
            farthest: (0, Vec::new()),
            reader,
        })
    }

    /// Returns the log's header.
    pub fn info(&self) -> &LogInfo {
        self.reader.header()
    }

    /// Maps the log's sources to the loop's sources by name. The number of the operator's input follows the numbers of
    /// the sensors.
    ///
    /// Before this call, no message of the log has a source in the loop.
    pub fn connect(&mut self, sources: &[SourceInfo]) {
        let find = |id: &String| {
            let sensor = sources.iter().position(|source| source.id == *id);
            let index = sensor.or_else(|| (id == CONSOLE_ID).then_some(sources.len()))?;
            u16::try_from(index).ok().map(SourceId)
        };
        self.sources = self.ids.iter().map(find).collect();
    }

    /// Returns the player's current position, between two ticks.
    pub fn place(&self) -> PlayerPlace {
        PlayerPlace {
            log: self.reader.place(),
            next: self.next.map(|next| (next.at, next.source.0, self.bytes.clone())),
            order: self.order,
            played: self.played,
            unmatched: self.unmatched.clone(),
            too_long: self.too_long,
            astray: self.astray.clone(),
        }
    }

    /// Continues from a position of this player, or of another player of the same log and vehicle.
    ///
    /// Losses are then counted as if the log had been played straight through. Losses found beyond the position stay in
    /// the list until playback passes them again.
    ///
    /// Errors: the log can't be read at that position.
    pub fn go_to(&mut self, place: &PlayerPlace) -> Result<(), LogError> {
        if self.order > self.farthest.0 {
            self.farthest = (self.order, self.losses_here());
        }
        self.reader.go_to(&place.log)?;
        self.next = place.next.as_ref().map(|(at, source, bytes)| {
            self.bytes.clone_from(bytes);
            Coming { at: *at, source: SourceId(*source), len: bytes.len() }
        });
        (self.order, self.played, self.too_long) = (place.order, place.played, place.too_long);
        self.unmatched.clone_from(&place.unmatched);
        self.astray.clone_from(&place.astray);
        Ok(())
    }

    /// Returns the files of the log, in order.
    pub fn files(&self) -> &[PartFile] {
        self.reader.files()
    }

    /// Returns the dive's clock, the same as the loop's.
    ///
    /// Before the first packet is played, the log's beginning is read for it. If that fails, the clock has no zero, and
    /// playing the log returns the error.
    pub fn dive_clock(&self) -> DiveClock {
        let read = || {
            let paths: Vec<PathBuf> = self.files().iter().map(|file| file.path.clone()).collect();
            clocks::clock_of(&paths).unwrap_or_default()
        };
        *self.dive_clock.get_or_init(read)
    }

    /// Returns the number of messages sent to the loop so far.
    pub fn played(&self) -> u64 {
        self.played
    }

    /// Returns losses and omissions so far, as text, including losses that were found before a jump back.
    pub fn losses(&self) -> Vec<String> {
        let (order, losses) = &self.farthest;
        if *order > self.order { losses.clone() } else { self.losses_here() }
    }

    /// Returns losses and omissions from the beginning of the log to the current position.
    fn losses_here(&self) -> Vec<String> {
        let mut all: Vec<String> = self.reader.losses().iter().map(|loss| self.loss_text(loss)).collect();
        for (id, count) in &self.unmatched {
            all.push(format!("{count} messages of source {id:?}, which the vehicle file doesn't have"));
        }
        if self.too_long > 0 {
            all.push(format!("{} messages of over {MAX_PACKET_BYTES} bytes", self.too_long));
        }
        if self.reader.late() > 0 {
            all.push(format!(
                "{} messages too far out of order to be sorted, delivered in file order",
                self.reader.late()
            ));
        }
        let clock = self.clock.iter().flat_map(|clock| self.astray.iter().map(move |found| (clock, found)));
        for (clock, (id, (count, first))) in clock {
            all.push(format!(
                "{count} messages of source {id:?} left out: their timestamps are {} those of most messages",
                clock.distance(*first)
            ));
        }
        all
    }

    fn loss_text(&self, loss: &Loss) -> String {
        loss.in_dive_time(self.dive_clock()).to_string()
    }

    /// Returns losses and omissions so far, as text. The cut-off end of the last file is left out.
    pub(crate) fn losses_before_cut(&self) -> Vec<String> {
        let cut =
            self.reader.losses().iter().rfind(|loss| loss.is_open_end()).map(|loss| self.loss_text(loss));
        let mut losses = self.losses_here();
        losses.retain(|loss| Some(loss) != cut.as_ref());
        losses
    }

    /// Returns anomalies found so far, and how they were handled, as text. These anomalies lose no data.
    pub fn notes(&self) -> Vec<String> {
        let note = |(topic, ids): (String, Vec<u16>)| {
            let ids: Vec<String> = ids.iter().map(u16::to_string).collect();
            format!("channels {} are all called {topic:?}: read as one", ids.join(", "))
        };
        self.reader.doubles().into_iter().map(note).collect()
    }

    /// Reads the next message of the log that comes from one of the loop's sources.
    fn read(&mut self) -> Result<Option<Coming>, LogError> {
        while let Some(message) = self.reader.next()? {
            let MessageKind::Raw { source } = message.kind else { continue };
            let index = usize::from(source);
            let Some(id) = self.sources.get(index).copied().flatten() else {
                let name = self.reader.source_id(source).map_or_else(|| source.to_string(), str::to_owned);
                *self.unmatched.entry(name).or_default() += 1;
                continue;
            };
            if self.clock.is_some_and(|clock| !clock.is_of(message.log_time)) {
                let name = self.ids.get(index).cloned().unwrap_or_default();
                self.astray.entry(name).or_insert((0, message.log_time)).0 += 1;
                continue;
            }
            if message.data.len() > MAX_PACKET_BYTES {
                self.too_long += 1;
                continue;
            }
            if !self.is_started && self.ids.get(index).is_none_or(|id| id != CONSOLE_ID) {
                // The dive's clock starts only with a sensor of the vehicle file. The log may begin with another
                // sensor.
                (self.dive_clock, self.is_started) = (DiveClock::new(Some(message.log_time)).into(), true);
            }
            self.bytes.clear();
            self.bytes.extend_from_slice(message.data);
            return Ok(Some(Coming { at: message.log_time, source: id, len: self.bytes.len() }));
        }
        Ok(None)
    }
}

impl Player {
    /// Skips the next packet, and counts it.
    pub(crate) fn pass(&mut self, consumed: &mut Consumed) {
        if let Some(next) = self.next.take() {
            consumed.add(next.source, next.at, &self.bytes);
            self.order += 1;
            self.played += 1;
        }
    }

    /// Sends the next packet to the ring of its source, and counts it.
    ///
    /// Errors: the packet doesn't fit, and remains the next packet.
    pub(crate) fn send_counted(&mut self, port: &mut Port, consumed: &mut Consumed) -> Result<(), RingError> {
        let next = self.next;
        self.send(port)?;
        if let Some(next) = next {
            consumed.add(next.source, next.at, &self.bytes);
        }
        Ok(())
    }
}

impl PacketSource for Player {
    fn coming(&mut self) -> Result<Option<Coming>, LogError> {
        if self.next.is_none() {
            self.next = self.read()?;
        }
        Ok(self.next)
    }

    fn span(&self) -> Option<(MonoNs, MonoNs)> {
        self.reader.times()
    }

    fn send(&mut self, port: &mut Port) -> Result<(), RingError> {
        let Some(coming) = self.next else { return Ok(()) };
        // Only this program's own logs state the order in which the loop consumed packets. Other logs are read in time
        // order.
        let order = if self.reader.has_ticks() { self.order } else { NO_ORDER };
        port.send_in_order(coming.at, order, &self.bytes)?;
        self.order += 1;
        self.played += 1;
        self.next = None;
        Ok(())
    }
}

/// Formats a time for messages, as dive time.
pub fn seconds(at: MonoNs, clock: DiveClock) -> String {
    format!("{:.3} s", clock.seconds(at))
}
