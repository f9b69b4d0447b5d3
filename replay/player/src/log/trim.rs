//! Writes a reduced log: only certain time spans, without echoes, or anonymised.

use std::collections::BTreeMap;
use std::io::{Read, Seek, Write};

use headrace_geometry::time::MonoNs;

use super::dive_log::DiveLog;
use super::error::LogError;
use super::reader::{LogInfo, LogMessage};
use super::recover::{header, lane, look_through, words};
use super::writer::{Lane, LogHeader, LogWriter, ResultChannel};

/// Metadata key of a trimmed log. Its value describes the changes.
pub const TRIMMED: &str = "trimmed";

/// Function that may change a source message. It writes the replacement, if any, into the last argument, and returns
/// whether there is one. An empty replacement drops the message.
pub type Change<'a> = &'a mut dyn FnMut(u16, &[u8], &mut Vec<u8>) -> bool;

/// Content that is kept of a log, and changes to this content.
pub struct Trim<'a> {
    /// Spans of log time to keep, in order and without overlap. An empty list keeps everything.
    pub spans: Vec<(MonoNs, MonoNs)>,
    /// Description of the trimming, for the metadata of the new log.
    pub words: String,
    /// Function that changes the log's header.
    pub header: &'a dyn Fn(&LogInfo, LogHeader) -> LogHeader,
    /// Function that changes source messages.
    pub change: Change<'a>,
    /// Whether to keep voice recordings within the kept spans.
    pub voices: bool,
    /// Decides by topic whether results are kept. It is used only if the whole dive is kept, because otherwise all
    /// results are dropped.
    pub results: &'a dyn Fn(&str) -> bool,
}

/// Result of trimming a log.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Trimmed {
    /// Number of messages written to the trimmed log.
    pub messages: u64,
    /// Number of messages dropped because they are outside the spans.
    pub cut: u64,
    /// Number of dropped result messages. They are dropped because a trimmed dive has other judgements, and because
    /// some results name people.
    pub results: u64,
    /// Number of source messages that were changed.
    pub changed: u64,
    /// Number of source messages that became empty and were dropped.
    pub emptied: u64,
    /// Total length of source messages before the change, bytes.
    pub bytes_before: u64,
    /// Total length of source messages after the change, bytes.
    pub bytes_after: u64,
    /// Number of losses of the original log.
    pub losses: u64,
    /// Log times of the first and last message written, in log order.
    pub span: Option<(MonoNs, MonoNs)>,
}

/// Writes the kept content to `output`, in the same order. The new log states the removed spans as losses.
///
/// `open` opens the log; it is called twice. `known` are the result channels whose schemas this program knows.
///
/// Errors: the log can't be read, or the output can't be written.
pub fn trim<R: Read + Seek, W: Write>(
    open: &mut dyn FnMut() -> Result<DiveLog<R>, LogError>,
    output: W,
    trim: &mut Trim<'_>,
    known: &[ResultChannel],
) -> Result<Trimmed, LogError> {
    let found = look_through(open()?)?;
    let mut reader = open()?;
    let mut topics = if trim.spans.is_empty() { found.topics } else { Vec::new() };
    topics.retain(|topic| (trim.results)(topic));
    let mut begin = header(&reader, &topics, found.sources, known);
    begin.metadata.insert(TRIMMED.to_owned(), trim.words.clone());
    begin.part = None;
    begin.voices &= trim.voices;
    let mut log = LogWriter::new(output, &(trim.header)(reader.header(), begin))?;
    let losses = found.losses.len() as u64;
    for loss in found.losses {
        log.lost(loss.from, loss.to, &words(&loss))?;
    }
    state_cuts(&trim.spans, reader.times(), &mut log)?;
    let numbers = topics.iter().map(String::as_str).zip(0..).collect();
    let mut cutter = Cutter {
        numbers,
        log,
        done: Trimmed { losses, ..Trimmed::default() },
        order: Vec::new(),
        whole: true,
        shorter: Vec::new(),
    };
    while let Some(message) = reader.next()? {
        cutter.take(&message, trim)?;
    }
    cutter.log.finish()?;
    Ok(cutter.done)
}

/// States the removed spans as losses. `times` are the first and last time of the original log.
fn state_cuts<W: Write>(
    spans: &[(MonoNs, MonoNs)],
    times: Option<(MonoNs, MonoNs)>,
    log: &mut LogWriter<W>,
) -> Result<(), LogError> {
    let (Some(first), Some(last), Some(times)) = (spans.first(), spans.last(), times) else { return Ok(()) };
    if times.0 < first.0 {
        log.lost(None, Some(first.0), "earlier data was cut off by headrace trim")?;
    }
    for pair in spans.windows(2) {
        if let [before, after] = pair {
            log.lost(Some(before.1), Some(after.0), "removed by headrace trim")?;
        }
    }
    if times.1 >= last.1 {
        log.lost(Some(last.1), None, "later data was cut off by headrace trim")?;
    }
    Ok(())
}

/// Writes the messages that are kept, one after the other.
struct Cutter<'a, W: Write> {
    numbers: BTreeMap<&'a str, u16>,
    log: LogWriter<W>,
    done: Trimmed,
    /// Source numbers of the packets kept since the latest tick, in order.
    order: Vec<u16>,
    /// Whether all packets since the latest tick were kept, so that the tick is unchanged.
    whole: bool,
    shorter: Vec<u8>,
}

impl<W: Write> Cutter<'_, W> {
    fn take(&mut self, message: &LogMessage<'_>, trim: &mut Trim<'_>) -> Result<(), LogError> {
        let Some(lane) = lane(message, &self.numbers) else {
            self.done.results += 1;
            return Ok(());
        };
        let within = |(from, to): &(MonoNs, MonoNs)| (*from..*to).contains(&message.log_time);
        if lane == Lane::Tick {
            return self.tick(message);
        }
        if lane == Lane::Voice && !trim.voices {
            self.done.cut += 1;
            return Ok(());
        }
        if !trim.spans.is_empty() && !trim.spans.iter().any(within) {
            self.done.cut += 1;
            self.whole &= !matches!(lane, Lane::Raw(_));
            return Ok(());
        }
        let Lane::Raw(source) = lane else { return self.write(lane, message, message.data) };
        self.done.bytes_before += message.data.len() as u64;
        let mut shorter = core::mem::take(&mut self.shorter);
        let changed = (trim.change)(source, message.data, &mut shorter);
        let data = if changed { shorter.as_slice() } else { message.data };
        self.done.changed += u64::from(changed);
        self.done.bytes_after += data.len() as u64;
        let written = if changed && data.is_empty() {
            self.done.emptied += 1;
            self.whole = false;
            Ok(())
        } else {
            self.order.push(source);
            self.write(lane, message, data)
        };
        self.shorter = shorter;
        written
    }

    /// Writes a tick. If packets were dropped, the tick lists only the packets that were kept.
    fn tick(&mut self, message: &LogMessage<'_>) -> Result<(), LogError> {
        let order = core::mem::take(&mut self.order);
        let whole = core::mem::replace(&mut self.whole, true);
        match super::format::Tick::decode(message.data) {
            Ok(tick) if !whole => {
                if order.is_empty() {
                    self.done.cut += 1;
                    return Ok(());
                }
                self.note(message);
                self.log.tick(tick.index, tick.now, &order)
            }
            _ => self.write(Lane::Tick, message, message.data),
        }
    }

    fn write(&mut self, lane: Lane, message: &LogMessage<'_>, data: &[u8]) -> Result<(), LogError> {
        self.note(message);
        self.log.message(lane, message.log_time, message.publish_time, data)
    }

    fn note(&mut self, message: &LogMessage<'_>) {
        self.done.messages += 1;
        let first = self.done.span.map_or(message.log_time, |span| span.0);
        self.done.span = Some((first, message.log_time));
    }
}
