//! Logs of Ping Viewer: a preface, then messages. The time of day precedes each message.
//!
//! Source: Ping Viewer, docs, "Binary log file structure". Numbers are big-endian. A text is stored as its length in
//! bytes, a u32, followed by UTF-16.

use crate::entry::{Clock, Entry, Step};
use crate::format::Format;

/// The Ping Viewer format. Its only stream is [`STREAM`].
#[derive(Debug, Default)]
pub struct PingFormat {
    begun: bool,
    /// Number of midnights passed since the log's first message.
    days: u64,
    last_of_day_ns: u64,
}

/// Name of the only stream in a Ping Viewer log: all messages belong to it.
pub const STREAM: &str = "ping";

/// Number of texts in the preface after the title and the version. Two numbers follow them.
const TEXTS: usize = 5;
const TITLE: &str = "PingViewer sensor log file";
const DAY_NS: u64 = 86_400_000_000_000;
/// A step back in time by more than this means a new day. A smaller step back means that entries are out of order.
const MIDNIGHT_NS: u64 = DAY_NS / 2;
/// Upper bound on the length of a text or message in the log, bytes.
const MOST_BYTES: usize = 1 << 16;

/// Reason why a field can't be read: more bytes are needed, or the field is invalid.
enum Stop {
    More,
    Bad,
}

impl Format for PingFormat {
    fn clock(&self) -> Clock {
        Clock::Own
    }

    fn step(&mut self, front: &[u8], _: bool, out: &mut Vec<Entry>) -> Step {
        let mut rest = front;
        let done = if self.begun { self.record(&mut rest, out) } else { self.preface(&mut rest) };
        match done {
            Ok(()) => Step::Took(front.len() - rest.len()),
            Err(Stop::More) => Step::More,
            // Records of this file format have no sync mark, so no record can be found after damage.
            Err(Stop::Bad) if self.begun => {
                Step::Lost(front.len(), "no time and message where they are expected")
            }
            Err(Stop::Bad) => Step::Lost(front.len(), "no preface of Ping Viewer"),
        }
    }
}

impl PingFormat {
    fn preface(&mut self, rest: &mut &[u8]) -> Result<(), Stop> {
        if text(rest)? != TITLE {
            return Err(Stop::Bad);
        }
        number(rest)?;
        for _ in 0..TEXTS {
            text(rest)?;
        }
        number(rest)?;
        number(rest)?;
        self.begun = true;
        Ok(())
    }

    fn record(&mut self, rest: &mut &[u8], out: &mut Vec<Entry>) -> Result<(), Stop> {
        let of_day_ns = time_of_day_ns(&text(rest)?).ok_or(Stop::Bad)?;
        let message = sized(rest)?;
        if self.last_of_day_ns > of_day_ns + MIDNIGHT_NS {
            self.days += 1;
        }
        self.last_of_day_ns = of_day_ns;
        let stamp_ns = self.days * DAY_NS + of_day_ns;
        out.push(Entry { stamp_ns, stream: STREAM.to_owned(), bytes: message.to_vec() });
        Ok(())
    }
}

fn number(rest: &mut &[u8]) -> Result<u32, Stop> {
    let (bytes, behind) = rest.split_first_chunk().ok_or(Stop::More)?;
    *rest = behind;
    Ok(u32::from_be_bytes(*bytes))
}

fn sized<'a>(rest: &mut &'a [u8]) -> Result<&'a [u8], Stop> {
    // Ping Viewer's library Qt writes `u32::MAX` as the length of a null string, which has no bytes.
    let len = match number(rest)? {
        u32::MAX => 0,
        len => usize::try_from(len).map_err(|_| Stop::Bad)?,
    };
    if len > MOST_BYTES {
        return Err(Stop::Bad);
    }
    let (bytes, behind) = rest.split_at_checked(len).ok_or(Stop::More)?;
    *rest = behind;
    Ok(bytes)
}

fn text(rest: &mut &[u8]) -> Result<String, Stop> {
    let (units, odd) = sized(rest)?.as_chunks::<2>();
    let units: Vec<u16> = units.iter().map(|unit| u16::from_be_bytes(*unit)).collect();
    String::from_utf16(&units).ok().filter(|_| odd.is_empty()).ok_or(Stop::Bad)
}

/// Parses a time of day, `hh:mm:ss.zzz`. A zero character may follow it.
fn time_of_day_ns(text: &str) -> Option<u64> {
    let text = text.trim_end_matches('\0');
    let (clock, milliseconds) = text.split_once('.')?;
    let mut parts = clock.split(':');
    let mut part = |limit: u64| parts.next()?.parse::<u64>().ok().filter(|part| *part < limit);
    let seconds = (part(24)? * 60 + part(60)?) * 60 + part(60)?;
    let milliseconds = milliseconds.parse::<u64>().ok().filter(|part| *part < 1000)?;
    parts.next().is_none().then_some((seconds * 1000 + milliseconds) * 1_000_000)
}
