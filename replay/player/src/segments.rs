//! Verification of one log in segments side by side, from the snapshots that an earlier verification has saved.
//!
//! A segment begins in a snapshot, is compared with what the dive published, and must end in the state of the next snapshot, bit for
//! bit; the first begins in the loop as armed. If all hold, the dive is verified as if in one piece: nothing is taken on trust of the
//! file but where its segments end.

use std::fs::File;
use std::io::{BufReader, ErrorKind, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

use crossbeam::channel::unbounded;
use headrace_geometry::time::{DurNs, MonoNs};
use headrace_monitor::run::Loop;
use headrace_snapshot::{Restorer, Saver, SnapshotError};

use crate::drive::{DriveError, Driver, PacketSource};
use crate::log::LogError;
use crate::player::{Player, PlayerPlace, seconds};
use crate::results::STREAMS;
use crate::threads::joined;
use crate::verify::{StreamVerified, Verified, Verifier, combined};
use crate::whole_file::WholeFile;

/// What a file of snapshots begins with.
const MAGIC: &[u8] = b"headrace snapshots 1\n";
/// The part of a snapshot beside the loop's.
const PLACE_PART: &str = "place of a segment";

/// Why a verification in segments failed.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SegmentError {
    /// The loop can't be driven.
    #[error(transparent)]
    Drive(#[from] DriveError),
    /// The log can't be read.
    #[error(transparent)]
    Log(#[from] LogError),
    /// A snapshot can't be saved or restored.
    #[error(transparent)]
    Snapshot(#[from] SnapshotError),
    /// The file of snapshots can't be read or written.
    #[error("snapshots in {}: {source}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// Cause.
        source: std::io::Error,
    },
    /// The file holds no snapshots, or others.
    #[error("snapshots in {}: {why}; remove the file to have it made anew", path.display())]
    Unfit {
        /// The file.
        path: PathBuf,
        /// What is the matter.
        why: String,
    },
    /// A segment doesn't end in the state in which the next begins.
    #[error(
        "segment {segment} of {segments}, {} to {}, doesn't end in the state that was saved: another dive, or snapshots that were \
         changed", seconds(*from), seconds(*to)
    )]
    Parted {
        /// The segment, from one.
        segment: usize,
        /// How many there are.
        segments: usize,
        /// Where it begins.
        from: MonoNs,
        /// Where it ends.
        to: MonoNs,
    },
}

/// A log, and the ticks in which it is replayed.
#[derive(Debug, Clone, Copy)]
pub struct Segmented<'a> {
    /// Its files.
    pub log: &'a [PathBuf],
    /// Length of a tick.
    pub tick: DurNs,
    /// File of snapshots.
    pub snapshots: &'a Path,
    /// What the snapshots are of: program, vehicle, log.
    pub of: &'a str,
}

/// The result of a verification, and what the log has lost.
pub type VerifiedLog = (Verified, Vec<String>);

/// Begin and length of each snapshot in a file, bytes.
#[derive(Debug)]
pub struct Snapshots(Vec<(u64, u64)>);

impl Snapshots {
    /// Number of snapshots, and of the segments that begin in them.
    pub fn len(&self) -> usize {
        self.0.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }
}

impl Segmented<'_> {
    /// Verifies the log in one piece with a loop just armed that keeps its results, and saves the snapshots of `segments` segments,
    /// equally long in the log's time. The file is there once it is complete.
    ///
    /// Errors: see [`SegmentError`].
    pub fn verify_and_save(&self, mut dive: Loop, segments: u32) -> Result<VerifiedLog, SegmentError> {
        let (mut player, mut verifier) = (self.player(&dive)?, Verifier::open(self.log)?);
        let mut driver = Driver::new(&mut dive, self.tick)?;
        let (from, to) = player.span().unwrap_or_default();
        let begin_s =
            |number: u32| to.since(from).as_secs_f64() / f64::from(segments.max(1)) * f64::from(number);
        let mut file = WholeFile::create(self.snapshots).map_err(|error| self.file_error(error))?;
        let mut write = |bytes: &[u8]| {
            let length = (bytes.len() as u64).to_le_bytes();
            file.write_all(&length).and_then(|()| file.write_all(bytes))
        };
        write(&[MAGIC, self.of.as_bytes()].concat()).map_err(|error| self.file_error(error))?;
        let mut next = 0;
        while let Some(until) = driver.due(&mut player)? {
            let is_due = |number: u32| number < segments && until.since(from).as_secs_f64() > begin_s(number);
            if is_due(next) {
                write(&snapshot(&dive, &driver, &player)?).map_err(|error| self.file_error(error))?;
                // A gap in the log may be longer than a segment.
                next += (next..segments).take_while(|number| is_due(*number)).count().try_into().unwrap_or(1);
            }
            run_tick(&mut driver, &mut dive, &mut player, &mut verifier)?;
        }
        file.complete().map_err(|error| self.file_error(error))?;
        let streams = ended(&mut dive, verifier)?;
        Ok((combined(&[streams]), player.losses()))
    }

    /// The snapshots of the file.
    ///
    /// Errors: it can't be read, or holds none, or those of another program, vehicle or log.
    pub fn snapshots(&self) -> Result<Snapshots, SegmentError> {
        let mut file = BufReader::new(File::open(self.snapshots).map_err(|error| self.file_error(error))?);
        let cut_off = |error: std::io::Error| match error.kind() {
            ErrorKind::UnexpectedEof => self.unfit("it was cut off"),
            _ => self.file_error(error),
        };
        let size = file.get_ref().metadata().map_err(|error| self.file_error(error))?.len();
        let of = [MAGIC, self.of.as_bytes()].concat();
        let of = [&(of.len() as u64).to_le_bytes(), of.as_slice()].concat();
        let mut found = vec![0; of.len()];
        if size < of.len() as u64 || file.read_exact(&mut found).is_err() || found != of {
            return Err(self.unfit("it isn't of this program, vehicle, log and tick"));
        }
        let (mut places, mut at) = (Vec::new(), of.len() as u64);
        while at < size {
            file.seek(SeekFrom::Start(at)).map_err(cut_off)?;
            let mut bytes = [0; 8];
            file.read_exact(&mut bytes).map_err(cut_off)?;
            let length = u64::from_le_bytes(bytes);
            at = at.saturating_add(8).saturating_add(length);
            if at > size {
                return Err(self.unfit("it was cut off"));
            }
            places.push((at - length, length));
        }
        Ok(Snapshots(places))
    }

    /// Verifies the log in the segments of `snapshots`, each on one of these loops: they are just armed, and keep their results.
    ///
    /// Errors: see [`SegmentError`]; of several segments that fail, the first one's.
    pub fn verify(&self, dives: Vec<Loop>, snapshots: &Snapshots) -> Result<VerifiedLog, SegmentError> {
        let (next, (to, verified)) = (AtomicUsize::new(0), unbounded());
        std::thread::scope(|scope| {
            let mut threads = Vec::new();
            for dive in dives {
                let (next, to) = (&next, to.clone());
                threads.push(scope.spawn(move || {
                    let mut worker = match Worker::new(self, dive) {
                        Ok(worker) => worker,
                        // Nothing else can be verified either.
                        Err(error) => return to.send((0, Err(error))).unwrap_or(()),
                    };
                    loop {
                        let segment = next.fetch_add(1, Ordering::Relaxed);
                        if segment >= snapshots.0.len()
                            || to.send((segment, worker.segment(snapshots, segment))).is_err()
                        {
                            return;
                        }
                    }
                }));
            }
            drop(to);
            threads.into_iter().try_for_each(|thread| joined(thread, "verifies a segment"))
        })?;
        let mut found: Vec<(usize, Result<Segment, SegmentError>)> = verified.into_iter().collect();
        found.sort_by_key(|(segment, _)| *segment);
        let (mut streams, mut losses) = (Vec::new(), Vec::new());
        for (_, segment) in found {
            let segment = segment?;
            streams.push(segment.streams);
            losses = segment.losses;
        }
        if streams.is_empty() {
            return Err(self.unfit("it holds no snapshot"));
        }
        Ok((combined(&streams), losses))
    }

    fn player(&self, dive: &Loop) -> Result<Player, LogError> {
        let mut player = Player::open(self.log)?;
        player.connect(dive.sources());
        Ok(player)
    }

    fn file_error(&self, source: std::io::Error) -> SegmentError {
        SegmentError::File { path: self.snapshots.to_owned(), source }
    }

    fn unfit(&self, why: impl Into<String>) -> SegmentError {
        SegmentError::Unfit { path: self.snapshots.to_owned(), why: why.into() }
    }
}

/// A segment that has been verified.
struct Segment {
    streams: Streams,
    /// What the log has lost up to its end.
    losses: Vec<String>,
}

/// Results of a segment, by stream.
type Streams = [StreamVerified; STREAMS.len()];

/// A thread's loop and what feeds it.
struct Worker<'a> {
    segmented: &'a Segmented<'a>,
    dive: Loop,
    driver: Driver,
    player: Player,
    /// The snapshot before the first tick.
    armed: Vec<u8>,
}

impl<'a> Worker<'a> {
    fn new(segmented: &'a Segmented<'a>, mut dive: Loop) -> Result<Self, SegmentError> {
        let mut player = segmented.player(&dive)?;
        let driver = Driver::new(&mut dive, segmented.tick)?;
        // As when it was saved: the first message has been looked at.
        driver.due(&mut player)?;
        let armed = snapshot(&dive, &driver, &player)?;
        Ok(Self { segmented, dive, driver, player, armed })
    }

    fn segment(&mut self, snapshots: &Snapshots, segment: usize) -> Result<Segment, SegmentError> {
        let begins = self.load(snapshots, segment)?.unwrap_or_default();
        if segment == 0 && begins != self.armed {
            return Err(self.segmented.unfit("the first snapshot isn't that of a dive that begins"));
        }
        let ends = self.load(snapshots, segment + 1)?;
        let from = self.restore(&begins)?;
        let records = self.dive.digests().streams().map(|(_, stream)| stream.records());
        let place = self.player.place();
        let mut verifier = Verifier::from_place(self.segmented.log, &place, records)?;
        let end = ends.as_deref().map(ended_at).transpose()?.flatten();
        while self.driver.due(&mut self.player)?.is_some() && (ends.is_none() || self.driver.ended_at() < end)
        {
            run_tick(&mut self.driver, &mut self.dive, &mut self.player, &mut verifier)?;
        }
        let streams = match ends {
            None => ended(&mut self.dive, verifier)?,
            Some(ends) if ends == snapshot(&self.dive, &self.driver, &self.player)? => verifier.so_far(),
            Some(_) => {
                let [from, to] = [from, end].map(Option::unwrap_or_default);
                let (segment, segments) = (segment + 1, snapshots.0.len());
                return Err(SegmentError::Parted { segment, segments, from, to });
            }
        };
        Ok(Segment { streams, losses: self.player.losses() })
    }

    /// The bytes of a snapshot; `None` beyond the last.
    fn load(&self, snapshots: &Snapshots, number: usize) -> Result<Option<Vec<u8>>, SegmentError> {
        let Some((begin, length)) = snapshots.0.get(number).copied() else { return Ok(None) };
        let mut bytes = Vec::new();
        let read = File::open(self.segmented.snapshots).and_then(|mut file| {
            file.seek(SeekFrom::Start(begin))?;
            file.take(length).read_to_end(&mut bytes)
        });
        read.map_err(|error| self.segmented.file_error(error))?;
        Ok(Some(bytes))
    }

    fn restore(&mut self, snapshot: &[u8]) -> Result<Option<MonoNs>, SegmentError> {
        let mut from = Restorer::new(snapshot);
        from.part(PLACE_PART)?;
        let until: Option<MonoNs> = from.value()?;
        let place: PlayerPlace = from.value()?;
        self.player.go_to(&place)?;
        self.dive.restore(from.raw()?)?;
        self.driver.go_to(until);
        Ok(until)
    }
}

/// The snapshot between two ticks: the end of the last, the place in the log, and the loop.
fn snapshot(dive: &Loop, driver: &Driver, player: &Player) -> Result<Vec<u8>, SegmentError> {
    let mut to = Saver::default();
    to.part(PLACE_PART);
    to.value(&driver.ended_at());
    to.value(&player.place());
    to.raw(&dive.save()?);
    Ok(to.finish()?)
}

/// The end of the last tick before a snapshot.
fn ended_at(snapshot: &[u8]) -> Result<Option<MonoNs>, SegmentError> {
    let mut from = Restorer::new(snapshot);
    from.part(PLACE_PART)?;
    Ok(from.value()?)
}

fn run_tick(
    driver: &mut Driver,
    dive: &mut Loop,
    player: &mut Player,
    verifier: &mut Verifier,
) -> Result<(), SegmentError> {
    let mut failed = None;
    driver.tick(dive, player, &mut |dive| {
        if failed.is_none() {
            failed = verifier.after_tick(dive).err();
        }
    })?;
    failed.map_or(Ok(()), |error| Err(error.into()))
}

/// Ends the dive, and compares what is judged then.
fn ended(dive: &mut Loop, mut verifier: Verifier) -> Result<Streams, SegmentError> {
    dive.finish(&mut |_, _| ());
    verifier.after_tick(dive)?;
    Ok(verifier.at_end()?)
}
