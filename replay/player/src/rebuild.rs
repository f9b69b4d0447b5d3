//! Rebuilds the state of an interrupted dive from its log, on a thread of its own. Meanwhile, new packets are only
//! recorded.
//!
//! A second loop replays the log, and then processes the new packets. When it has caught up, its state is restored into
//! the dive's loop.

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::thread::JoinHandle;

use crossbeam::channel::{Receiver, Sender, unbounded};
use headrace_geometry::time::MonoNs;
use headrace_monitor::merge::Inbox;
use headrace_monitor::ring::{Port, RingError};
use headrace_monitor::run::Loop;
use headrace_sensor::reading::SourceId;

use crate::drive::{Coming, Pace, PacketSource, drive};
use crate::log::{LogError, PartFile};
use crate::playback::PlaybackError;
use crate::player::Player;
use crate::saved_state::{Consumed, SavedState};

/// If at most this many new packets are still unprocessed, the dive's loop waits for the rebuilding loop. The wait
/// takes a fraction of a second.
const NEAR_PACKETS: u64 = 100;

/// A dive whose state is being rebuilt.
pub struct Rebuild {
    thread: JoinHandle<Result<Rebuilt, PlaybackError>>,
    packets: Sender<Packet>,
    sent: u64,
    progress: Arc<Progress>,
}

/// The state of a dive that was rebuilt from its log.
#[derive(Debug)]
pub struct Rebuilt {
    /// Snapshot of the state, for [`Loop::go_on`].
    pub snapshot: Vec<u8>,
    /// Number of packets in the saved state that was used; 0 if the whole log was replayed.
    pub saved_packets: u64,
    /// Number and digest of all packets of the dive so far.
    pub consumed: Consumed,
    /// Files of the log, with their numbers of messages.
    pub files: Vec<PartFile>,
    /// Losses of the log, as text, without the cut-off end of the last file.
    pub losses: Vec<String>,
}

struct Packet {
    received: MonoNs,
    source: SourceId,
    bytes: Vec<u8>,
}

#[derive(Default)]
struct Progress {
    /// Time of the latest packet from the log, ns.
    at_ns: AtomicU64,
    /// Number of new packets taken so far.
    taken: AtomicU64,
    /// Whether the log has been read to its end.
    read: AtomicBool,
    cancelled: AtomicBool,
}

impl Rebuild {
    /// Starts to rebuild a dive from the files of its recording. `dive` is a new loop of the same vehicle.
    ///
    /// `saved` is the path of a state saved during the dive. If it fits the log and this program, only the rest of the
    /// log is replayed.
    ///
    /// Errors: the thread can't be started.
    pub fn start(mut dive: Loop, files: Vec<PathBuf>, saved: PathBuf) -> Result<Self, LogError> {
        let (packets, live) = unbounded();
        let progress = Arc::new(Progress::default());
        let shared = Arc::clone(&progress);
        let thread = std::thread::Builder::new().name("rebuild".to_owned());
        let thread = thread.spawn(move || {
            let mut player = Player::open(&files)?;
            player.connect(dive.sources());
            let mut source = Rejoined {
                player,
                live,
                next: None,
                order: 0,
                consumed: Consumed::default(),
                progress: shared,
            };
            let saved_packets = match SavedState::read(&saved) {
                Some(state) => source.start_at(&state, &mut dive, &files)?,
                None => 0,
            };
            drive(&mut dive, &mut source, Pace::default(), &mut |_| ())?;
            let Rejoined { player, consumed, .. } = source;
            Ok(Rebuilt {
                snapshot: dive.save()?,
                saved_packets,
                consumed,
                files: player.files().to_vec(),
                losses: player.losses_before_cut(),
            })
        });
        let thread = thread.map_err(|source| LogError::Thread { source })?;
        Ok(Self { thread, packets, sent: 0, progress })
    }

    /// Passes the packets of a tick to the rebuilding thread. The dive's loop only records these packets.
    pub fn take(&mut self, inbox: &Inbox) {
        for (source, packet) in inbox.iter() {
            let packet = Packet { received: packet.received, source, bytes: packet.bytes.to_vec() };
            // A packet can't be sent if the thread has ended early. [`Rebuild::finish`] then returns the thread's
            // error.
            self.sent += u64::from(self.packets.send(packet).is_ok());
        }
    }

    /// Returns the time in the log up to which the state is rebuilt.
    pub fn at(&self) -> MonoNs {
        MonoNs(self.progress.at_ns.load(Ordering::Relaxed))
    }

    /// Whether [`Rebuild::finish`] would take only a fraction of a second, or the thread has ended early.
    pub fn is_near(&self) -> bool {
        let behind = self.sent.saturating_sub(self.progress.taken.load(Ordering::Relaxed));
        self.thread.is_finished() || self.progress.read.load(Ordering::Relaxed) && behind <= NEAR_PACKETS
    }

    /// Waits until all packets that were passed on have been processed, ends the thread, and returns the state.
    ///
    /// Errors: the log can't be read, or the loop fails.
    pub fn finish(self) -> Result<Rebuilt, PlaybackError> {
        drop(self.packets);
        self.thread.join().unwrap_or(Err(PlaybackError::Log(LogError::Panicked)))
    }

    /// Tells the thread to end without a result. Doesn't wait for the thread, because the medium that it reads may not
    /// respond.
    pub fn cancel(self) {
        self.progress.cancelled.store(true, Ordering::Relaxed);
    }
}

/// Feed with the packets of a log, followed by new packets.
struct Rejoined {
    player: Player,
    live: Receiver<Packet>,
    /// The next new packet.
    next: Option<Packet>,
    /// Number of the next new packet, counted over all packets of the dive.
    order: u64,
    consumed: Consumed,
    progress: Arc<Progress>,
}

impl Rejoined {
    /// Skips the packets that a saved state contains, and restores the saved state.
    ///
    /// If the state's packets aren't those of the log, the dive is rebuilt from its beginning. Returns the number of
    /// packets skipped.
    fn start_at(
        &mut self,
        state: &SavedState,
        dive: &mut Loop,
        files: &[PathBuf],
    ) -> Result<u64, PlaybackError> {
        while self.consumed.packets < state.consumed.packets
            && !self.progress.cancelled.load(Ordering::Relaxed)
        {
            let Some(coming) = self.player.coming()? else { break };
            self.progress.at_ns.store(coming.at.0, Ordering::Relaxed);
            self.player.pass(&mut self.consumed);
        }
        if self.consumed == state.consumed {
            dive.restore(&state.snapshot)?;
            return Ok(self.consumed.packets);
        }
        tracing::warn!("the saved state doesn't fit the log; the dive is rebuilt from its beginning");
        self.player = Player::open(files)?;
        self.player.connect(dive.sources());
        self.consumed = Consumed::default();
        Ok(0)
    }

    fn coming_from_log(&mut self) -> Result<Option<Coming>, LogError> {
        let coming = self.player.coming()?;
        match coming {
            Some(coming) => self.progress.at_ns.store(coming.at.0, Ordering::Relaxed),
            None => self.progress.read.store(true, Ordering::Relaxed),
        }
        Ok(coming)
    }
}

impl PacketSource for Rejoined {
    fn coming(&mut self) -> Result<Option<Coming>, LogError> {
        if self.progress.cancelled.load(Ordering::Relaxed) {
            return Ok(None);
        }
        if let Some(coming) = self.coming_from_log()? {
            return Ok(Some(coming));
        }
        self.order = self.order.max(self.player.played());
        if self.next.is_none() {
            self.next = self.live.recv().ok();
        }
        Ok(self.next.as_ref().map(|next| Coming {
            at: next.received,
            source: next.source,
            len: next.bytes.len(),
        }))
    }

    fn send(&mut self, port: &mut Port) -> Result<(), RingError> {
        if !self.progress.read.load(Ordering::Relaxed) {
            return self.player.send_counted(port, &mut self.consumed);
        }
        let Some(next) = &self.next else { return Ok(()) };
        port.send_in_order(next.received, self.order, &next.bytes)?;
        self.consumed.add(next.source, next.received, &next.bytes);
        self.order += 1;
        self.progress.taken.fetch_add(1, Ordering::Relaxed);
        self.next = None;
        Ok(())
    }
}
