//! Rewrites the readable content of a damaged log as an intact log.

use std::collections::BTreeMap;
use std::io::{Read, Seek, Write};

use headrace_geometry::time::MonoNs;

use super::dive_log::DiveLog;
use super::error::LogError;
use super::format::BYTES_ENCODING;
use super::loss::{Loss, LossKind};
use super::reader::{LogMessage, MessageKind};
use super::writer::{Lane, LogHeader, LogWriter, ResultChannel, SourceInfo};

/// Metadata key of a recovered log. Its value is the name of the original log.
pub const RECOVERED_FROM: &str = "recovered_from";

/// Result of recovering a damaged log.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Recovered {
    /// Number of messages written to the recovered log.
    pub messages: u64,
    /// Log times of the first and last message written, in log order.
    pub span: Option<(MonoNs, MonoNs)>,
    /// Losses of the damaged log, which the recovered log lists too.
    pub losses: Vec<Loss>,
}

/// Writes the readable content of a log to `output`, in the same order.
///
/// The content is attachments, metadata, device messages, ticks and results. The new log replays to the same digest,
/// and lists the losses. All parts of a recording become one log. If only one part is given, the new log remains a
/// part.
///
/// `open` opens the log. It is called twice, because the first reading finds all damage. `known` are the result
/// channels whose schemas this program has. `from` is the name of the original log.
///
/// Errors: the log can't be read, or the output can't be written.
pub fn recover<R: Read + Seek, W: Write>(
    open: &mut dyn FnMut() -> Result<DiveLog<R>, LogError>,
    output: W,
    known: &[ResultChannel],
    from: &str,
) -> Result<Recovered, LogError> {
    let Found { losses, topics, sources } = look_through(open()?)?;
    let mut reader = open()?;
    let mut begin = header(&reader, &topics, sources, known);
    begin.metadata.insert(RECOVERED_FROM.to_owned(), from.to_owned());
    let mut log = LogWriter::new(output, &begin)?;
    for loss in &losses {
        log.lost(loss.from, loss.to, &words(loss))?;
    }
    let mut done = Recovered { messages: 0, span: None, losses };
    let numbers: BTreeMap<&str, u16> = topics.iter().map(String::as_str).zip(0..).collect();
    while let Some(message) = reader.next()? {
        let Some(lane) = lane(&message, &numbers) else { continue };
        log.message(lane, message.log_time, message.publish_time, message.data)?;
        done.messages += 1;
        done.span = Some((done.span.map_or(message.log_time, |span| span.0), message.log_time));
    }
    if let Some(end) = reader.header().part.as_ref().and_then(|part| part.end.as_ref()) {
        log.end_part(end.follows)?;
    }
    log.finish()?;
    Ok(done)
}

/// Losses, result topics and sources of a log that has been read to its end.
pub(super) struct Found {
    /// All losses, including content that dive logs have no channel for.
    pub(super) losses: Vec<Loss>,
    pub(super) topics: Vec<String>,
    pub(super) sources: Vec<SourceInfo>,
}

pub(super) fn look_through<R: Read + Seek>(mut reader: DiveLog<R>) -> Result<Found, LogError> {
    let mut others = 0_u64;
    while let Some(message) = reader.next()? {
        others += u64::from(message.kind == MessageKind::Other);
    }
    let mut losses = reader.losses();
    if others > 0 {
        let words = format!("{others} messages of channels that a dive log doesn't have");
        losses.push(Loss { kind: LossKind::Stated(words), offset: 0, bytes: 0, from: None, to: None });
    }
    let (topics, sources) = reader.channels_found();
    Ok(Found { losses, topics, sources })
}

pub(super) fn words(loss: &Loss) -> String {
    match &loss.kind {
        LossKind::Stated(words) => words.clone(),
        kind => format!("{kind}: {} bytes from byte {} of the log before recovery", loss.bytes, loss.offset),
    }
}

pub(super) fn header<R: Read + Seek>(
    reader: &DiveLog<R>,
    topics: &[String],
    sources: Vec<SourceInfo>,
    known: &[ResultChannel],
) -> LogHeader {
    let info = reader.header();
    let result = |topic: &String| {
        let known = known.iter().find(|channel| channel.topic == *topic);
        known.cloned().unwrap_or_else(|| ResultChannel {
            topic: topic.clone(),
            message_encoding: BYTES_ENCODING.to_owned(),
            ..ResultChannel::default()
        })
    };
    LogHeader {
        vehicle_toml: info.vehicle_toml.clone().unwrap_or_default(),
        attachments: info.attachments.clone(),
        metadata: info.metadata.clone(),
        sources,
        ticks: reader.has_ticks(),
        voices: reader.has_voices(),
        results: topics.iter().map(result).collect(),
        sonars: Vec::new(),
        part: info.part.as_ref().map(|part| part.head.clone()),
    }
}

/// Returns the channel of the new log for a message; `None` if dive logs have no such channel.
pub(super) fn lane(message: &LogMessage<'_>, results: &BTreeMap<&str, u16>) -> Option<Lane> {
    match message.kind {
        MessageKind::Raw { source } => Some(Lane::Raw(source)),
        MessageKind::Sent { source } => Some(Lane::Sent(source)),
        MessageKind::Tick => Some(Lane::Tick),
        MessageKind::Voice => Some(Lane::Voice),
        MessageKind::Result { topic } => results.get(topic).copied().map(Lane::Result),
        MessageKind::Other => None,
    }
}
