//! The recorder's thread, its queue, and its handling of errors.

use std::io::Write;
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, mpsc};
use std::time::Duration;

use super::super::{
    DerivedChannels, LogError, LossKind, Made, Recorder, RecorderHandle, RecorderPort, Rotation, Storage,
    StoredFile,
};
use super::*;

/// A slow medium. At each flush it sends its whole content to a channel.
struct SlowMedium {
    bytes: Vec<u8>,
    nap: Duration,
    done: mpsc::SyncSender<Vec<u8>>,
}

impl Write for SlowMedium {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        std::thread::sleep(self.nap);
        let len = bytes.len().min(20_000);
        self.bytes.extend_from_slice(&bytes[..len]);
        Ok(len)
    }

    fn flush(&mut self) -> std::io::Result<()> {
        // The test may have dropped the receiver already.
        self.done.try_send(self.bytes.clone()).ok();
        Ok(())
    }
}

fn slow(millis: u64) -> (SlowMedium, mpsc::Receiver<Vec<u8>>) {
    let (done, flushed) = mpsc::sync_channel(1000);
    (SlowMedium { bytes: Vec::new(), nap: Duration::from_millis(millis), done }, flushed)
}

#[test]
fn slow_medium_loses_nothing_if_the_loop_waits_for_the_queue() {
    let (medium, flushed) = slow(1);
    let (mut port, handle) = Recorder::start(medium, &header(true), 0).unwrap();
    let mut held_back = 0;
    for round in 0..20_000_u32 {
        let bytes = noise(round.into(), usize::try_from(round % 300).unwrap());
        let needed = RecorderPort::entry_bytes(bytes.len()) + RecorderPort::tick_entry_bytes(1);
        while port.vacant_bytes() < needed {
            held_back += 1;
            std::thread::yield_now();
        }
        let now = MonoNs(round.into());
        port.raw(1, now, now, &bytes).unwrap();
        port.tick(round.into(), now, &[1]).unwrap();
    }
    let summary = handle.finish().unwrap();
    assert!(held_back > 0, "the medium was fast enough");
    assert_eq!(summary.messages, 40_000);
    let bytes = flushed.iter().last().unwrap();
    assert_eq!(bytes.len() as u64, summary.bytes);
    let (seen, losses) = read(&bytes);
    assert_eq!((seen.len(), losses), (40_000, vec![]));
    for (round, pair) in (0_u32..).zip(seen.chunks(2)) {
        assert_eq!((pair[0].0.as_str(), pair[0].1, pair[0].3), ("raw 1", round.into(), round));
        assert_eq!((pair[1].0.as_str(), pair[1].4.len()), ("tick", 22));
    }
}

/// A medium on which each flush waits until the test releases it. Flushes no longer wait after the test has dropped its
/// sender.
struct Held(mpsc::Receiver<()>);

impl Write for Held {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        Ok(bytes.len())
    }

    fn flush(&mut self) -> std::io::Result<()> {
        self.0.recv().ok();
        Ok(())
    }
}

/// Until the first sync returns, the unsynced time is the time from the first tick to the latest tick. The unsynced
/// time is zero after a sync that began after the latest tick.
#[test]
fn unsynced_time_lasts_from_latest_sync_to_latest_tick() {
    let (go, held) = mpsc::channel();
    go.send(()).unwrap();
    let (mut port, mut handle) = Recorder::start(Held(held), &header(true), 0).unwrap();
    assert_eq!(handle.unsafe_for(), DurNs(0));
    for (index, at_s) in [(0, 75_000.0), (1, 75_003.0), (2, 75_007.5)] {
        let now = MonoNs(0) + DurNs::from_secs_f64(at_s);
        port.raw(1, now, now, b"range").unwrap();
        port.tick(index, now, &[1]).unwrap();
    }
    std::thread::sleep(Duration::from_millis(700));
    assert_eq!(handle.unsafe_for(), DurNs::from_secs_f64(7.5));
    port.skip(MonoNs(0) + DurNs::from_secs_f64(75_009.0), 3);
    assert_eq!(handle.unsafe_for(), DurNs::from_secs_f64(9.0), "a skipped tick isn't on the medium either");
    port.tick(4, MonoNs(0) + DurNs::from_secs_f64(75_009.5), &[]).unwrap();
    while handle.unsafe_for() > DurNs(0) {
        go.send(()).unwrap();
        std::thread::sleep(Duration::from_millis(10));
    }
    drop(go);
    handle.begin_to_end(true);
    assert_eq!(handle.finish().unwrap().messages, 7);
}

/// Writing the queue takes seconds. With a time limit, the end of the recording waits 0.6 s in total. Without a time
/// limit, it waits while the medium makes progress.
#[test]
fn slow_recording_is_cut_off_at_the_time_limit_only_on_request() {
    // The messages are made before the recorder begins to write, so that the queue is full in a few milliseconds.
    let messages: Vec<Vec<u8>> = (0..20_000).map(|round| noise(round, 300)).collect();
    for in_time in [true, false] {
        let (medium, _flushed) = slow(10);
        let (mut port, mut handle) = Recorder::start(medium, &header(true), 16 << 20).unwrap();
        for (round, bytes) in (0_u32..).zip(&messages) {
            let now = MonoNs(round.into());
            port.raw(1, now, now, bytes).unwrap();
            port.tick(round.into(), now, &[1]).unwrap();
        }
        handle.patience = Duration::from_millis(600);
        handle.begin_to_end(in_time);
        match handle.finish() {
            Err(LogError::Stuck { .. }) => assert!(in_time, "no time limit was requested"),
            ended => assert!(!in_time && ended.is_ok_and(|summary| summary.messages == 40_000)),
        }
    }
}

#[test]
fn messages_older_than_a_second_are_readable_in_an_open_log() {
    let (medium, flushed) = slow(0);
    let (mut port, handle) = Recorder::start(medium, &header(true), 0).unwrap();
    let header_only = flushed.recv_timeout(Duration::from_secs(1)).unwrap();
    assert_eq!(open(&header_only).header().sources.len(), 3, "the header is there before the first message");
    port.raw(0, MonoNs(5), MonoNs(4), b"ping").unwrap();
    port.sent(0, MonoNs(6), b"poll").unwrap();
    port.result(0, MonoNs(7), b"{}").unwrap();
    let after_a_second = flushed.recv_timeout(Duration::from_secs(1)).unwrap();
    let (seen, losses) = read(&after_a_second);
    let kinds: Vec<_> = seen.iter().map(|message| message.0.as_str()).collect();
    assert_eq!(kinds, ["raw 0", "sent 0", "/result/advice"]);
    assert_eq!(losses.len(), 1, "{losses:?}");
    assert!(!port.is_closed() && !handle.is_failing());
    handle.finish().unwrap();
}

#[test]
fn entry_larger_than_the_queue_is_refused_as_a_whole() {
    let (medium, _flushed) = slow(0);
    let (mut port, handle) = Recorder::start(medium, &header(true), 0).unwrap();
    let capacity = port.capacity_bytes();
    let too_long = vec![0; capacity];
    let full = port.raw(0, MonoNs(0), MonoNs(0), &too_long).unwrap_err();
    assert_eq!((full.free, full.needed), (capacity, RecorderPort::entry_bytes(capacity)));
    assert!(port.tick(0, MonoNs(0), &vec![0; capacity]).is_err());
    assert_eq!(port.vacant_bytes(), capacity);
    assert_eq!(handle.finish().unwrap().messages, 0);
}

#[test]
fn dropped_recorder_handle_syncs_every_message_but_writes_no_end_mark() {
    let (medium, flushed) = slow(0);
    let (mut port, handle) = Recorder::start(medium, &header(true), 0).unwrap();
    port.raw(0, MonoNs(5), MonoNs(5), b"ping").unwrap();
    drop(handle);
    let (seen, losses) = read(&flushed.iter().last().unwrap());
    let kinds: Vec<_> = losses.into_iter().map(|loss| loss.kind).collect();
    assert_eq!((seen.len(), kinds), (1, vec![LossKind::Truncated]));
}

/// A medium that accepts only a limited number of bytes.
struct SmallMedium(Arc<AtomicUsize>);

impl Write for SmallMedium {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        let room = self.0.load(Ordering::Relaxed);
        if room == 0 {
            return Err(std::io::ErrorKind::StorageFull.into());
        }
        let len = bytes.len().min(room);
        self.0.store(room - len, Ordering::Relaxed);
        Ok(len)
    }

    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}

#[test]
fn full_medium_is_reported_but_does_not_stop_the_loop() {
    let room = Arc::new(AtomicUsize::new(1 << 20));
    let (mut port, handle) = Recorder::start(SmallMedium(Arc::clone(&room)), &header(true), 0).unwrap();
    room.store(0, Ordering::Relaxed);
    let mut rounds = 0;
    while !handle.is_failing() {
        if port.vacant_bytes() > 10_000 {
            port.raw(0, MonoNs(0), MonoNs(0), &[9; 5000]).unwrap();
        }
        rounds += 1;
        assert!(rounds < 100_000_000, "the failure never showed");
    }
    for _ in 0..1000 {
        while port.raw(0, MonoNs(0), MonoNs(0), &[9; 5000]).is_err() {
            std::thread::yield_now();
        }
    }
    let summary = handle.finish().unwrap();
    let [fault] = summary.faults.as_slice() else { panic!("{:?}", summary.faults) };
    assert!(fault.lost >= 1000 && fault.continued.is_none(), "{fault:?}");
    assert!(fault.words().contains("no storage space"), "{}", fault.words());
}

#[test]
fn message_of_an_unknown_source_is_a_recording_fault() {
    let (medium, _flushed) = slow(0);
    let (mut port, handle) = Recorder::start(medium, &header(false), 0).unwrap();
    port.raw(77, MonoNs(0), MonoNs(0), &[]).unwrap();
    let faults = handle.finish().unwrap().faults;
    assert!(faults.len() == 1 && faults[0].words().contains("Raw(77)"), "{faults:?}");
}

#[test]
fn existing_recording_is_not_overwritten() {
    let path = std::env::temp_dir().join(format!("headrace-recorder-{}.mcap", std::process::id()));
    std::fs::remove_file(&path).ok();
    let (mut port, handle) =
        Recorder::create(&path, &header(true), &Rotation::default(), 1 << 20, None).unwrap();
    port.raw(0, MonoNs(1), MonoNs(1), b"ping").unwrap();
    let summary = handle.finish().unwrap();
    assert_eq!(std::fs::metadata(&path).unwrap().len(), summary.bytes);
    assert!(matches!(
        Recorder::create(&path, &header(true), &Rotation::default(), 0, None),
        Err(LogError::Create { .. })
    ));
    assert_eq!(read(&std::fs::read(&path).unwrap()).0.len(), 1);
    std::fs::remove_file(&path).unwrap();
}

/// A storage that reports a given number of free bytes.
struct Within(Option<u64>, Option<SlowMedium>);

impl Storage for Within {
    fn create(&mut self, _: &Path) -> std::io::Result<Box<dyn StoredFile>> {
        Ok(Box::new(self.1.take().unwrap()))
    }

    fn remove(&mut self, _: &Path) -> std::io::Result<()> {
        Ok(())
    }

    fn free_bytes(&mut self, _: &Path) -> Option<u64> {
        self.0
    }
}

impl StoredFile for SlowMedium {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        Write::write(self, bytes)
    }

    fn sync(&mut self) -> std::io::Result<()> {
        self.flush()
    }
}

fn within(
    free: Option<u64>,
    medium: SlowMedium,
    header: &LogHeader,
    derived: Option<Box<dyn DerivedChannels>>,
) -> (RecorderPort, RecorderHandle) {
    let storage = Box::new(Within(free, Some(medium)));
    let begun =
        Recorder::unthreaded(storage, Path::new("dive.mcap"), header, &Rotation::default(), 0, derived);
    Recorder::spawn(begun.unwrap()).unwrap()
}

#[test]
fn recorder_on_a_nearly_full_disk_keeps_small_messages_and_states_dropped_echoes() {
    let (medium, flushed) = slow(0);
    let mut header = header(true);
    header.results.push(ResultChannel {
        topic: "/result/pings".to_owned(),
        follows_echoes: true,
        ..ResultChannel::default()
    });
    // Only source 0 is a sonar. The packets of source 2 are as long as echoes, like the lines of a velocity log.
    header.sonars = vec![0];
    let (mut port, handle) = within(Some(5_000_000), medium, &header, None);
    for tick in 1..=100_u64 {
        let at = MonoNs(tick * 1_000_000_000);
        // All messages of this test fit in the recorder's queue.
        port.raw(0, at, at, &noise(tick, 265)).unwrap();
        port.raw(2, at, at, &noise(tick, 140)).unwrap();
        port.tick(tick, at, &[0, 2]).unwrap();
        port.result(0, at, b"{}").unwrap();
        port.result(1, at, &noise(tick, 56)).unwrap();
    }
    let summary = handle.finish().unwrap();
    assert_eq!((summary.left_out.messages, summary.left_out.bytes), (200, 100 * (265 + 56)));
    assert_eq!(summary.left_out.span, Some((MonoNs(1_000_000_000), MonoNs(100_000_000_000))));
    let (seen, losses) = read(&flushed.iter().last().unwrap());
    let of = |kind: &str| seen.iter().filter(|message| message.0 == kind).count();
    assert_eq!(
        [of("raw 0"), of("raw 2"), of("tick"), of("/result/advice"), seen.len()],
        [0, 100, 100, 100, 300]
    );
    assert!(losses.iter().all(|loss| matches!(loss.kind, LossKind::Stated(_))), "{losses:?}");
    assert_eq!(
        losses.iter().map(ToString::to_string).collect::<Vec<_>>(),
        [
            "the recorder leaves echo returns out: the disk had 5000000 bytes free (after 1.000 s)",
            "200 echo returns and their results (32100 bytes) left out by the recorder: the disk was nearly full (after \
             1.000 s, before 100.000 s)",
        ]
    );
}

#[test]
fn messages_beyond_the_queue_capacity_are_counted() {
    let (medium, _flushed) = slow(0);
    let (mut port, handle) = Recorder::start(medium, &header(true), 0).unwrap();
    let sent = handle.line_port();
    // The loop fills the queue of 2,048 messages faster than any thread can empty it.
    for number in 0..1_000_000_u64 {
        sent.sent(1, MonoNs(number), b"poll");
        if sent.sent_dropped() > 0 {
            break;
        }
    }
    port.miss_results();
    let dropped = sent.sent_dropped();
    let summary = handle.finish().unwrap();
    assert!(dropped > 0);
    assert_eq!((summary.sent_dropped, summary.results_missing), (dropped, 1));
}

/// Runs the recorder's steps at the given times. Before each step, some packets are dropped. Returns the losses that
/// the log states.
fn drops_stated(drops: &[(Duration, u16, u64)]) -> Vec<String> {
    let (medium, flushed) = slow(0);
    let storage = Box::new(Within(None, Some(medium)));
    let (path, rotation) = (Path::new("dive.mcap"), Rotation::default());
    let (mut port, mut worker) =
        Recorder::unthreaded(storage, path, &header(true), &rotation, 0, None).unwrap();
    let line = worker.line_port();
    port.tick(1, MonoNs(1), &[]).unwrap();
    for &(now, source, packets) in drops {
        let at = |now: Duration| MonoNs(u64::try_from(now.as_nanos()).unwrap());
        line.lost(source, at(now.saturating_sub(Duration::from_secs(1))), at(now), packets);
        worker.step(now);
    }
    worker.finish(Duration::from_secs(100));
    let (_, losses) = read(&flushed.iter().last().unwrap());
    losses.iter().map(ToString::to_string).collect()
}

#[test]
fn counts_of_dropped_packets_are_recorded_per_source_every_few_seconds() {
    let s = Duration::from_secs;
    let words = |packets: u64, id: &str, from: u64, to: u64| {
        format!(
            "{packets} packets of {id} dropped by the kernel or a full queue: the computer stalled (after {from}.000 s, \
             before {to}.000 s)"
        )
    };
    let [first, second] = [0, 1].map(|number: usize| header(true).sources[number].id.clone());
    assert_eq!(drops_stated(&[(s(1), 0, 7)]), [words(7, &first, 0, 1)]);
    assert_eq!(
        drops_stated(&[(s(6), 1, 1), (s(7), 1, 2), (s(8), 0, 3), (s(11), 1, 4), (s(12), 1, 5)]),
        [
            words(1, &second, 5, 6),
            words(3, &first, 7, 8),
            words(6, &second, 6, 11),
            words(5, &second, 11, 12)
        ]
    );
}

/// While the recorder is too slow, every dropped packet is counted. For some of the dropped packets, the source is then
/// unknown.
#[test]
fn dropped_packets_beyond_the_queue_capacity_are_counted() {
    let (medium, flushed) = slow(0);
    let (mut port, handle) = Recorder::start(medium, &header(true), 0).unwrap();
    port.tick(1, MonoNs(1), &[]).unwrap();
    let line = handle.line_port();
    for number in 0..100_000 {
        line.lost(0, MonoNs(number), MonoNs(number + 1), 2);
    }
    handle.finish().unwrap();
    let (_, losses) = read(&flushed.iter().last().unwrap());
    let counts =
        losses.iter().map(|loss| loss.to_string().split(' ').next().unwrap().parse::<u64>().unwrap());
    assert_eq!(counts.sum::<u64>(), 200_000, "{losses:?}");
}

/// Derives two messages from each result: one for an existing channel, and one for a channel that doesn't exist.
struct Echoing;

impl DerivedChannels for Echoing {
    fn take(&mut self, channel: u16, at: MonoNs, message: &[u8], made: &mut Vec<Made>) {
        assert_eq!(channel, 0, "derived messages aren't passed back to the derivation");
        for channel in [1, 9] {
            made.push(Made { channel, at, bytes: [b"made of ", message].concat() });
        }
    }

    fn end(&mut self, made: &mut Vec<Made>) {
        made.push(Made { channel: 1, at: MonoNs(99), bytes: b"the end".to_vec() });
    }
}

#[test]
fn derived_messages_are_dropped_before_all_others() {
    for (free, kept) in [(None, 3), (Some(5_000_000), 0)] {
        let (medium, flushed) = slow(0);
        let mut header = header(true);
        let topic = "/result/view/echo".to_owned();
        header.results.push(ResultChannel { topic, follows_echoes: true, ..ResultChannel::default() });
        let derived = Some(Box::new(Echoing) as Box<dyn DerivedChannels>);
        let (mut port, handle) = within(free, medium, &header, derived);
        port.result(0, MonoNs(1), b"one").unwrap();
        port.tick(0, MonoNs(2), &[]).unwrap();
        port.result(0, MonoNs(3), b"two").unwrap();
        let summary = handle.finish().unwrap();
        assert_eq!((summary.messages, summary.left_out.messages), (3 + kept, 3 - kept));
        let (seen, _) = read(&flushed.iter().last().unwrap());
        let kinds: Vec<&str> = seen.iter().map(|message| message.0.as_str()).collect();
        let echo = "/result/view/echo";
        let whole = ["/result/advice", echo, "tick", "/result/advice", echo, echo];
        let expected: Vec<&str> = whole.into_iter().filter(|kind| kept > 0 || *kind != echo).collect();
        assert_eq!(kinds, expected);
    }
}

#[test]
fn recorder_ends_despite_a_blocked_medium() {
    /// A medium that accepts the header, and then blocks each write until the test is over.
    struct Hanging(usize, mpsc::Receiver<()>);

    impl Write for Hanging {
        fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
            if self.0 == 0 {
                self.1.recv().ok();
            }
            Ok(bytes.len())
        }

        fn flush(&mut self) -> std::io::Result<()> {
            self.0 = 0;
            Ok(())
        }
    }
    let (over, waits) = mpsc::sync_channel(1);
    let (mut port, mut handle) = Recorder::start(Hanging(1, waits), &header(true), 0).unwrap();
    handle.patience = Duration::from_millis(50);
    port.raw(0, MonoNs(0), MonoNs(0), b"ping").unwrap();
    let error = handle.finish().unwrap_err();
    assert!(matches!(error, LogError::Stuck { .. }), "{error}");
    drop(over);
}

#[test]
fn skipped_ticks_are_stated_in_the_log() {
    let (medium, flushed) = slow(0);
    let (mut port, handle) = Recorder::start(medium, &header(true), 0).unwrap();
    let second = |seconds: u64| MonoNs(seconds * 1_000_000_000);
    port.raw(0, second(1), second(1), b"ping").unwrap();
    port.skip(second(2), 3);
    port.skip(second(3), 4);
    port.raw(0, second(4), second(4), b"ping").unwrap();
    port.skip(second(5), 1);
    drop(port);
    assert_eq!(handle.finish().unwrap().skipped, 8);
    let (seen, losses) = read(&flushed.iter().last().unwrap());
    let texts: Vec<String> = losses.iter().map(ToString::to_string).collect();
    assert_eq!((seen.len(), texts.len()), (2, 2), "{texts:?}");
    assert!(
        texts[0].starts_with("7 packets not recorded")
            && texts[0].ends_with("(after 2.000 s, before 3.000 s)")
    );
    assert!(
        texts[1].starts_with("1 packets not recorded")
            && texts[1].ends_with("(after 5.000 s, before 5.000 s)")
    );
}
