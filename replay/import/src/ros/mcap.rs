//! Recordings of ROS 2 in MCAP, and recordings of ROS 1 that were converted to MCAP.
//!
//! Sources: MCAP format specification, and its "well-known" profiles and encodings. The log reader parses MCAP
//! itself.

use std::collections::BTreeMap;
use std::io::{self, BufReader, Read, Seek, SeekFrom};

use super::feeds::{Feeds, Topic};
use super::message::Type;
use super::wire::Encoding;
use crate::entry::{Clock, Entry, ImportReport};
use crate::error::ImportError;
use crate::input::Source;
use crate::order::Order;
use headrace_replay::log::format::FORMAT_KEY;
use headrace_replay::log::{ChannelInfo, LogReader};

/// Maximum number of messages read at once.
const AT_A_TIME: usize = 64;

/// A ROS recording in MCAP.
pub struct Mcap<R> {
    name: String,
    reader: LogReader<R>,
    bytes: u64,
    channels: BTreeMap<u16, (Topic, Encoding)>,
    feeds: Feeds,
    found: Vec<Entry>,
    first_ns: Option<u64>,
    /// Number of messages that the recording's summary states; `None` if it states none.
    stated: Option<u64>,
    /// Number of messages read so far.
    read: u64,
    is_at_end: bool,
}

impl<R: Read + Seek> Mcap<R> {
    /// Opens a recording.
    ///
    /// Errors: the file can't be read, isn't MCAP, or is a dive log.
    pub fn open(name: &str, mut file: R) -> Result<Self, ImportError> {
        let failed = |source| ImportError::Read { name: name.to_owned(), offset: 0, source };
        let bytes = file.seek(std::io::SeekFrom::End(0)).map_err(failed)?;
        // An unreadable summary is no error here, because the log reader below reports what is unreadable.
        let stated = stated_messages(&mut file, bytes).ok().flatten();
        let reader = LogReader::new(file, name.to_owned())?;
        if reader.header().metadata.contains_key(FORMAT_KEY) {
            return Err(ImportError::DiveLog { name: name.to_owned() });
        }
        let channels = reader.channels().map(|channel| (channel.id, topic(&channel))).collect();
        Ok(Self {
            name: name.to_owned(),
            reader,
            bytes,
            channels,
            feeds: Feeds::default(),
            found: Vec::new(),
            first_ns: None,
            stated,
            read: 0,
            is_at_end: false,
        })
    }

    /// Returns the topics of the recording.
    pub fn topics(&self) -> Vec<Topic> {
        let mut topics: Vec<Topic> = Vec::new();
        for (topic, _) in self.channels.values() {
            if !topics.contains(topic) {
                topics.push(topic.clone());
            }
        }
        topics
    }

    /// Sets the feeds that receive the recording's messages.
    #[must_use]
    pub fn feeding(self, feeds: Feeds) -> Self {
        Self { feeds, ..self }
    }
}

fn topic(channel: &ChannelInfo<'_>) -> (Topic, Encoding) {
    let (encoding, schema) = (channel.encoding, channel.schema.unwrap_or_default());
    let known = match (encoding, Type::named(schema)) {
        ("cdr" | "ros1", Some(known)) => Ok(known),
        ("cdr" | "ros1", None) => Err(format!("messages of type {schema} aren't supported")),
        (encoding, _) => Err(format!("messages are encoded as {encoding:?}; supported are cdr and ros1")),
    };
    let topic = Topic { name: channel.topic.to_owned(), type_name: schema.to_owned(), known };
    (topic, if encoding == "ros1" { Encoding::Ros1 } else { Encoding::Cdr })
}

impl<R: Read + Seek> Source for Mcap<R> {
    fn name(&self) -> &str {
        &self.name
    }

    fn more(&mut self, order: &mut Order) -> Result<bool, ImportError> {
        for _ in 0..AT_A_TIME {
            let Some(message) = self.reader.next()? else {
                self.is_at_end = true;
                return Ok(false);
            };
            self.read += 1;
            let at_ns = message.log_time.0;
            self.first_ns = Some(self.first_ns.map_or(at_ns, |first_ns| first_ns.min(at_ns)));
            if let Some((topic, encoding)) = self.channels.get(&message.channel) {
                self.feeds.take(topic, *encoding, at_ns, message.data, &mut self.found);
            }
            self.found.drain(..).for_each(|entry| order.push(entry));
            if order.is_full() {
                break;
            }
        }
        Ok(true)
    }

    fn clock(&self) -> Clock {
        Clock::of_first(self.first_ns)
    }

    fn reach_ns(&self) -> u64 {
        self.feeds.reach_ns()
    }

    fn bytes(&self) -> u64 {
        self.bytes
    }

    fn report(&self) -> ImportReport {
        let mut report = self.feeds.report();
        report.losses.extend(self.reader.losses().iter().map(ToString::to_string));
        if let Some(stated) = self.stated.filter(|stated| self.is_at_end && *stated > self.read) {
            let missing = stated - self.read;
            report
                .losses
                .push(format!("{missing} of the {stated} messages that its summary states are missing"));
        }
        if self.reader.late() > 0 {
            report.losses.push(format!(
                "{} messages come too late in the file to be put in order",
                self.reader.late()
            ));
        }
        report
    }
}

/// Opcodes of two records near the end of a file: statistics and footer. Source: MCAP format specification, "Footer"
/// and "Statistics".
const STATISTICS: u8 = 0x0B;
const FOOTER: u8 = 0x02;
const FOOTER_BYTES: u64 = 20;
/// Length of a record's opcode and length field, bytes.
const HEAD_BYTES: u64 = 9;
/// Length of the footer record and the closing magic, bytes.
const END_BYTES: u64 = HEAD_BYTES + FOOTER_BYTES + 8;
/// Maximum number of records skipped in a summary. The limit is ample, because the recording of a day has only some
/// thousands of chunks.
const MOST_RECORDS: usize = 100_000;

/// Returns the number of messages that the summary of an MCAP file states. `bytes` is the file's length.
///
/// Returns `None` without a summary, or without statistics in it.
///
/// Errors: the file can't be read.
fn stated_messages(file: &mut (impl Read + Seek), bytes: u64) -> io::Result<Option<u64>> {
    let Some(end) = bytes.checked_sub(END_BYTES) else { return Ok(None) };
    let mut file = BufReader::new(file);
    file.seek(SeekFrom::Start(end))?;
    let footer = head(&mut file)?;
    let mut at = number(&mut file)?;
    if footer != (FOOTER, FOOTER_BYTES) || at == 0 {
        return Ok(None);
    }
    file.seek(SeekFrom::Start(at.min(end)))?;
    for _ in 0..MOST_RECORDS {
        if at >= end {
            break;
        }
        let (opcode, len) = head(&mut file)?;
        if opcode == STATISTICS {
            return number(&mut file).map(Some);
        }
        at = at.saturating_add(HEAD_BYTES).saturating_add(len);
        let Some(skipped) = i64::try_from(len).ok().filter(|_| at < end) else { break };
        file.seek_relative(skipped)?;
    }
    Ok(None)
}

fn head(file: &mut impl Read) -> io::Result<(u8, u64)> {
    let mut opcode = [0];
    file.read_exact(&mut opcode)?;
    Ok((opcode[0], number(file)?))
}

fn number(file: &mut impl Read) -> io::Result<u64> {
    let mut bytes = [0; 8];
    file.read_exact(&mut bytes)?;
    Ok(u64::from_le_bytes(bytes))
}

#[cfg(test)]
mod tests {
    use std::io::Cursor;

    use super::*;

    fn record(opcode: u8, body: &[u8]) -> Vec<u8> {
        [&[opcode][..], &(body.len() as u64).to_le_bytes(), body].concat()
    }

    fn stated(summary: &[u8], summary_at: u64) -> Option<u64> {
        let footer = record(FOOTER, &[&summary_at.to_le_bytes()[..], &[0; 12]].concat());
        let file = [&[0; 50][..], summary, &footer, b"\x89MCAP0\r\n"].concat();
        let bytes = file.len() as u64;
        stated_messages(&mut Cursor::new(file), bytes).unwrap()
    }

    #[test]
    fn stated_message_count_is_found_after_other_records() {
        let statistics = record(STATISTICS, &[&1234_u64.to_le_bytes()[..], &[0; 38]].concat());
        let other = record(0x08, &[7; 100]);
        assert_eq!(stated(&[&other[..], &other, &statistics].concat(), 50), Some(1234));
        assert_eq!(stated(&statistics, 50), Some(1234));
    }

    #[test]
    fn mcap_files_without_statistics_state_no_message_count() {
        let endless = [&[0x08][..], &u64::MAX.to_le_bytes(), &[7; 100]].concat();
        for (summary, at) in [(&record(0x08, &[7; 100])[..], 50), (&[], 0), (&endless, 50), (&[], u64::MAX)] {
            assert_eq!(stated(summary, at), None);
        }
        assert_eq!(stated_messages(&mut Cursor::new([0; 20]), 20).unwrap(), None);
        assert_eq!(stated_messages(&mut Cursor::new([0; 200]), 200).unwrap(), None);
    }
}
