//! The armed loop: three worlds and the alerter, one after the other in each tick.

use std::sync::Arc;

use super::advice_log::AdviceLog;
use super::adviser::{Advised, Adviser};
use super::alerter::Alerter;
use super::entities::{Mounted, SensorDecoder};
use super::head_descriptions::HeadDescriptions;
use super::merge::MAX_TICK_BYTES;
use super::messages::Notice;
use super::outlet::Outlet;
use super::placer::{Placed, Placer};
use super::resources::TickTime;
use super::ring::Port;
use super::source::SourceInfo;
use super::surveyor::Surveyor;
use super::view::{About, DiveView};
use headrace_coverage::{Outlook, Request};
use headrace_fusion::filter::sources::Consistency;
use headrace_fusion::{Fix, Navigation, NoFix};
use headrace_geometry::snapshot::{Restorer, Saver, SnapshotError};
use headrace_geometry::time::MonoNs;
use headrace_sensor::codec::CodecCounts;
use headrace_sensor::device::SensorInfo;
use headrace_sensor::device_clock::ClockReport;
use headrace_sensor::withheld::WithheldReason;
use headrace_vehicle::Mission;

/// Number of sections judged per batch at the end of a dive. The notices of a batch are delivered before the
/// next batch.
const FINISHED_AT_ONCE: usize = 256;

/// Parts of a loop: the three worlds (placer, adviser, surveyor) and the alerter.
pub(super) struct Parts {
    pub(super) placer: Placer,
    pub(super) surveyor: Surveyor,
    pub(super) adviser: Adviser,
    pub(super) alerter: Alerter,
}

/// A running loop. All of its memory is allocated; a tick takes no lock, makes no system call and formats no
/// text.
pub struct Loop {
    about: About,
    /// Placer and adviser; `None` while they run on other threads.
    ahead: Option<(Placer, Adviser)>,
    surveyor: Surveyor,
    alerter: Alerter,
    /// Results of placer and adviser for the last tick.
    placed: Arc<Placed>,
    advised: Advised,
    outlets: Vec<Box<dyn Outlet>>,
    /// Number of bytes of packets that the next tick may consume. A lagging outlet reduces it.
    allowance_bytes: usize,
    ports: Vec<Option<Port>>,
    time: TickTime,
    ticks: u64,
    /// Whether ticks only pass packets to the outlets, see [`Loop::hold`].
    held: bool,
    finished: bool,
}

impl Loop {
    /// Creates the loop. Allocates: the memory of the values that pass between the parts.
    pub(super) fn new(about: About, parts: Parts, outlets: Vec<Box<dyn Outlet>>, ports: Vec<Port>) -> Self {
        let Parts { placer, surveyor, adviser, alerter } = parts;
        let (placed, advised) = (placer.placed_with_room(), adviser.advised_with_room());
        let mut armed = Self {
            about,
            ahead: Some((placer, adviser)),
            surveyor,
            alerter,
            placed: Arc::new(placed),
            advised,
            outlets,
            allowance_bytes: MAX_TICK_BYTES,
            ports: ports.into_iter().map(Some).collect(),
            time: TickTime::default(),
            ticks: 0,
            held: false,
            finished: false,
        };
        // Outlets may allocate in the first tick. Without packets this tick has no other effect.
        armed.tick(MonoNs(0));
        armed.ticks = 0;
        armed
    }

    /// Processes the waiting packets. Returns the number of packets consumed.
    ///
    /// `now` is the end of the tick's time. The loop only records this time; no result depends on it.
    ///
    /// Panics: if parts of the loop are split off. Allocates: never.
    pub fn tick(&mut self, now: MonoNs) -> usize {
        let Self { ahead, placed, advised, allowance_bytes, .. } = self;
        #[expect(clippy::expect_used, reason = "a caller's mistake, as documented")]
        let (placer, adviser) = ahead.as_mut().expect("no part of the loop is split off");
        if self.held {
            placer.receive(*allowance_bytes, sole(placed, placer));
            self.time = TickTime { index: self.ticks, now };
            self.publish();
            self.ticks += 1;
            return self.placed.inbox.len();
        }
        placer.tick(*allowance_bytes, sole(placed, placer));
        adviser.tick(placed, advised);
        self.conclude(now);
        self.placed.inbox.len()
    }

    /// Runs the parts of a tick that follow placer and adviser, and publishes their results.
    fn conclude(&mut self, now: MonoNs) {
        let Self { surveyor, alerter, placed, advised, .. } = self;
        self.time = TickTime { index: self.ticks, now };
        // The judgements made at the end of a dive must not be cleared before they are published.
        if !self.finished {
            surveyor.next_tick();
            alerter.next_tick();
        }
        surveyor.tick(placed);
        debug_assert_eq!(
            surveyor.found().standings.len(),
            advised.entries.len(),
            "advice of the same updates"
        );
        alerter.tick(placed, surveyor.found(), advised, now);
        self.publish();
        self.ticks += 1;
    }

    fn publish(&mut self) {
        let mut outlets = core::mem::take(&mut self.outlets);
        let view = self.view();
        let allowances = outlets.iter_mut().map(|outlet| outlet.publish(&view));
        self.allowance_bytes = allowances.fold(MAX_TICK_BYTES, usize::min);
        self.outlets = outlets;
    }

    /// The view of the loop after the last tick.
    pub fn view(&self) -> DiveView<'_> {
        let Self { about, time, placed, surveyor, advised, alerter, .. } = self;
        DiveView { about, time: *time, placed, surveyor, advised, alerter }
    }

    /// Splits off placer and adviser for other threads, until [`Loop::join`] puts them back.
    ///
    /// Returns `None` if they are split off already. Meanwhile, [`Loop::tick_placed`] replaces
    /// [`Loop::tick`], and the loop can't be saved. Functions that ask placer or adviser, such as
    /// [`Loop::fix`] or [`Loop::advice_log`], panic.
    pub fn split(&mut self) -> Option<(Placer, Adviser)> {
        self.ahead.take()
    }

    /// Whether placer and adviser are split off.
    pub fn is_split(&self) -> bool {
        self.ahead.is_none()
    }

    /// Puts placer and adviser back into the loop, after the last tick that they have processed.
    pub fn join(&mut self, placer: Placer, adviser: Adviser) {
        (self.placed, self.advised) = (Arc::new(placer.placed_with_room()), adviser.advised_with_room());
        self.ahead = Some((placer, adviser));
    }

    /// Runs the rest of a tick from the values of placer and adviser. In exchange, `advised` gets the advice of the
    /// previous tick.
    ///
    /// Returns false if a lagging outlet holds back the tick's packets. The call then counts as a tick
    /// without packets. Call again with the same tick a little later.
    pub fn tick_placed(&mut self, now: MonoNs, placed: &Arc<Placed>, advised: &mut Advised) -> bool {
        let is_taken = placed.inbox.byte_len() <= self.allowance_bytes;
        if is_taken {
            self.placed = Arc::clone(placed);
            core::mem::swap(&mut self.advised, advised);
        } else {
            self.placed = Arc::new(self.placed.followed_by_nothing());
            self.advised = self.advised.followed_by_nothing();
        }
        self.conclude(now);
        is_taken
    }

    /// Takes the writing end of a source's ring, for a port's thread, a player or a simulator.
    ///
    /// `None` if it was taken already.
    pub fn take_port(&mut self, source: usize) -> Option<Port> {
        self.ports.get_mut(source)?.take()
    }

    /// Takes the writing end of the operator's input. `None` if it was taken already.
    pub fn take_console(&mut self) -> Option<Port> {
        self.take_port(self.about.sources.len())
    }

    /// Sources of the sensors, in the order of their ids. The operator's input is not among them.
    pub fn sources(&self) -> &[SourceInfo] {
        &self.about.sources
    }

    /// Tunnel and coverage target.
    pub fn mission(&self) -> &Mission {
        &self.about.mission
    }

    /// Names of the heads, and the alternative settings that could be advised.
    pub fn head_descriptions(&self) -> &HeadDescriptions {
        &self.about.descriptions
    }

    /// Number of ticks run so far.
    pub fn ticks(&self) -> u64 {
        self.ticks
    }

    /// Number and end time of the loop's last tick.
    pub fn time(&self) -> TickTime {
        self.time
    }

    /// End time of the last tick.
    pub fn now(&self) -> MonoNs {
        self.time.now
    }

    /// The placer, unless it is split off to another thread.
    pub fn placer(&self) -> Option<&Placer> {
        self.ahead.as_ref().map(|(placer, _)| placer)
    }

    /// Fix at the time `at`, which may be slightly before or after the last reading.
    ///
    /// Errors: the reason for which there is no fix.
    pub fn fix(&self, at: MonoNs) -> Result<Fix, NoFix> {
        self.navigation().fix(at)
    }

    /// Innovation statistics of a source; `None` if there are none.
    pub fn consistency(&self, source: usize) -> Option<Consistency> {
        self.navigation().consistency(source)
    }

    fn navigation(&self) -> &dyn Navigation {
        self.ahead().0.navigation()
    }

    fn ahead(&self) -> &(Placer, Adviser) {
        #[expect(clippy::expect_used, reason = "a caller's mistake: see Loop::split")]
        self.ahead.as_ref().expect("no part of the loop is split off")
    }

    /// Speed advice history.
    pub fn advice_log(&self) -> &AdviceLog {
        self.ahead().1.log()
    }

    /// Minimum and maximum speed of sound used for ranges, m/s.
    pub fn sound_speeds_mps(&self) -> [f64; 2] {
        self.ahead().0.sound_speeds_mps()
    }

    /// Mount and kind of each sensor, in the order of sources.
    pub fn sensors(&self) -> Vec<SensorInfo> {
        self.ahead().0.of_sensors::<Mounted>().map(|mounted| mounted.info).collect()
    }

    /// Outlook as of the last packet: where samples have landed and where they may still land.
    pub(super) fn outlook(&self) -> Outlook {
        self.surveyor.outlook(self.last_packet())
    }

    fn last_packet(&self) -> MonoNs {
        self.placed.last_received().unwrap_or(MonoNs(0))
    }

    /// Judges the sections whose verdict may still change, at the end of a dive, when no more samples will
    /// come.
    ///
    /// `hear` gets the notices in batches, with the loop's state after each batch. All notices of a long dive at once
    /// would take more memory than the dive's samples.
    pub fn finish(&mut self, hear: &mut dyn FnMut(&Notice, &Self)) {
        if let Some((placer, _)) = &mut self.ahead {
            placer.end();
        }
        self.placed = Arc::new(self.placed.followed_by_nothing());
        self.advised = self.advised.followed_by_nothing();
        self.surveyor.next_tick();
        self.alerter.next_tick();
        self.finished = true;
        self.surveyor.end_returns();
        let (open, common) = self.surveyor.open_requests(self.last_packet());
        let request = |section: &i64| Some(Request { section: *section, ..common? });
        for some in open.chunks(FINISHED_AT_ONCE) {
            let mut notices = Vec::new();
            for request in some.iter().filter_map(request) {
                self.surveyor.judge_at_end(request);
                self.alerter.take_runs_at_end(&self.surveyor.found().runs);
                notices.extend_from_slice(&self.surveyor.found().notices);
                notices.extend_from_slice(&self.alerter.notices);
            }
            for notice in &notices {
                hear(notice, self);
            }
        }
        self.alerter.take_metres_at_end(self.surveyor.coverage());
        self.list_last_observations(hear);
    }

    /// Adds alerts for the observations made at the end of a dive.
    fn list_last_observations(&mut self, hear: &mut dyn FnMut(&Notice, &Self)) {
        let at = self.last_packet();
        self.alerter.take_observations_at_end(self.surveyor.observations(), at);
        for notice in &self.alerter.notices {
            hear(notice, self);
        }
    }

    /// Snapshot of the state after the last tick.
    ///
    /// A loop of the same vehicle gives the same results after it has restored the snapshot. The snapshot
    /// excludes packets waiting in the rings, and private state of plugins.
    ///
    /// Errors: placer and adviser are split off, or a value can't be serialised.
    pub fn save(&self) -> Result<Vec<u8>, SnapshotError> {
        let Some((placer, adviser)) = &self.ahead else {
            let (part, why) =
                ("the loop".to_owned(), "parts of it are on other threads; join first".to_owned());
            return Err(SnapshotError::Unsaved { part, why });
        };
        let mut to = Saver::default();
        to.part("ticks");
        to.value(&(self.ticks, self.time));
        placer.save(&mut to);
        self.surveyor.save(&mut to);
        adviser.save(&mut to);
        self.alerter.save(&mut to);
        to.finish()
    }

    /// Restores a snapshot saved by a loop of the same vehicle and program.
    ///
    /// Packets waiting in the rings are dropped.
    ///
    /// Errors: the snapshot doesn't fit this loop. The loop must not be used afterwards.
    pub fn restore(&mut self, snapshot: &[u8]) -> Result<(), SnapshotError> {
        self.restore_parts(snapshot)?;
        if let Some((placer, _)) = &mut self.ahead {
            placer.drop_waiting();
        }
        Ok(())
    }

    fn restore_parts(&mut self, snapshot: &[u8]) -> Result<(), SnapshotError> {
        let mut from = Restorer::new(snapshot);
        let Some((placer, adviser)) = &mut self.ahead else {
            return Err(from.unfit("parts of the loop are on other threads; join them first".to_owned()));
        };
        from.part("ticks")?;
        (self.ticks, self.time) = from.value()?;
        placer.restore(&mut from)?;
        self.surveyor.restore(&mut from)?;
        adviser.restore(&mut from)?;
        self.alerter.restore(&mut from)?;
        placer.report(sole(&mut self.placed, placer));
        adviser.report(&mut self.advised);
        if from.is_empty() { Ok(()) } else { Err(from.unfit("it has extra bytes at its end".to_owned())) }
    }

    /// Makes the next ticks only pass packets to the outlets, which record them, until [`Loop::go_on`]. The next tick
    /// gets the number `tick`.
    ///
    /// Call it before the first tick of a dive that continues an interrupted one.
    pub fn hold(&mut self, tick: u64) {
        debug_assert_eq!(self.ticks, 0, "a loop that has processed packets isn't held");
        (self.held, self.ticks) = (true, tick);
    }

    /// Ends [`Loop::hold`]. From now on the loop processes packets, beginning in the state `snapshot`. Another loop
    /// has reached this state with all packets that were passed on. `None` means the state of a new loop.
    ///
    /// Packets waiting in the rings stay there. The number and time of the last tick are kept.
    ///
    /// Errors: as for [`Loop::restore`].
    pub fn go_on(&mut self, snapshot: Option<&[u8]>) -> Result<(), SnapshotError> {
        self.held = false;
        if let Some(snapshot) = snapshot {
            let last = (self.ticks, self.time);
            self.restore_parts(snapshot)?;
            (self.ticks, self.time) = last;
        }
        // Outlets that count results learn the counts of the restored state.
        self.placed = Arc::new(self.placed.followed_by_nothing());
        self.advised = self.advised.followed_by_nothing();
        self.surveyor.next_tick();
        self.alerter.next_tick();
        self.publish();
        Ok(())
    }

    /// Frees the memory of the samples. After the end of a dive the report needs only the sections.
    pub fn release_samples(&mut self) {
        self.surveyor.release_samples();
    }

    /// Whether packets are waiting in the rings.
    pub fn has_waiting(&self) -> bool {
        self.placer().is_some_and(Placer::has_waiting)
    }

    /// Codec counts of each source, in the order of the sources.
    pub fn decoder_counts(&self) -> Vec<CodecCounts> {
        self.ahead().0.of_sensors::<SensorDecoder>().map(|decoder| decoder.0.counts()).collect()
    }

    /// Number of readings that each source's decoder understood but withheld, and the reason for the last of
    /// them, in the order of the sources.
    pub fn decoder_withheld(&self) -> Vec<(u64, Option<WithheldReason>)> {
        let decoders = self.ahead().0.of_sensors::<SensorDecoder>();
        decoders.map(|decoder| (decoder.0.withheld(), decoder.0.withheld_reason())).collect()
    }

    /// Device clock statistics of each source, in the order of the sources.
    pub fn decoder_clocks(&self) -> Vec<Option<ClockReport>> {
        self.ahead().0.of_sensors::<SensorDecoder>().map(|decoder| decoder.0.clock()).collect()
    }
}

/// Returns exclusive access to the value behind an `Arc`.
///
/// Between ticks no other reader holds the value, unless the loop was split. In that case, a new value
/// replaces it.
fn sole<'a>(placed: &'a mut Arc<Placed>, placer: &Placer) -> &'a mut Placed {
    if Arc::get_mut(placed).is_none() {
        *placed = Arc::new(placer.placed_with_room());
    }
    #[expect(clippy::expect_used, reason = "a new one has no other reader")]
    Arc::get_mut(placed).expect("no other reader")
}
