//! Logs of Ping Viewer: a preface, then messages. A time precedes each message.
//!
//! Sources: Ping Viewer, docs, "Binary log file structure", and `filelink.cpp`. Numbers are big-endian. A text is stored
//! as its length in bytes, a u32, followed by UTF-16. Times of current versions count from the start of the log, which
//! the file's name gives; those of older versions are times of day.

use crate::calendar::{DAY_NS, days_since_1970, digits, time_of_day_ns};
use crate::entry::{Clock, Entry, ImportReport, Step};
use crate::format::Format;

/// The Ping Viewer format. Its only stream is [`STREAM`].
#[derive(Debug, Default)]
pub struct PingFormat {
    /// Start of the log: nanoseconds from 1970 to its day, and from then on; `None` if the file's name has no time.
    start: Option<(u64, u64)>,
    begun: bool,
    /// Whether the log is of a device other than a Ping echosounder.
    is_of_another_device: bool,
    /// Time that is added to the log's times, and its meaning; `None` before the first message.
    zero: Option<(u64, &'static str)>,
    /// Number of midnights passed since the log's first message.
    days: u64,
    last_of_day_ns: u64,
}

/// Name of the only stream in a Ping Viewer log: all messages belong to it.
pub const STREAM: &str = "ping";

/// Number of texts in the preface after the title and the version. The sensor's family and type follow them.
const TEXTS: usize = 5;
const TITLE: &str = "PingViewer sensor log file";
/// Types of a sensor that are refused: all but an unknown device (0) and a Ping echosounder (1). A Ping360 has type 2.
/// Source: Ping protocol, "device_information".
const REFUSED_TYPES: core::ops::RangeFrom<u32> = 2..;
const OTHER_DEVICE: &str = "the log of a Ping360 or another scanning device (sensor type 2 or more): its messages are \
                            echoes by angle, and a ping1d has one range for each ping";
/// A step back in time by more than this means a new day. A smaller step back means that entries are out of order.
const MIDNIGHT_NS: u64 = DAY_NS / 2;
/// Longest time from the start of a log to its first message. Ping Viewer creates the file at the first message.
const FIRST_NS: u64 = 60_000_000_000;
/// Upper bound on the length of a text or message in the log, bytes.
const MOST_BYTES: usize = 1 << 16;

/// Reason why a field can't be read: more bytes are needed, or the field is invalid.
enum Stop {
    More,
    Bad,
}

impl Format for PingFormat {
    fn clock(&self) -> Clock {
        if self.start.is_some() { Clock::Local } else { Clock::Own }
    }

    fn report(&self) -> ImportReport {
        let remarks = self.zero.iter().map(|(_, meaning)| (*meaning).to_owned()).collect();
        ImportReport { remarks, ..ImportReport::default() }
    }

    fn step(&mut self, front: &[u8], _: bool, out: &mut Vec<Entry>) -> Step {
        let mut rest = front;
        let done = if self.begun { self.record(&mut rest, out) } else { self.preface(&mut rest) };
        match done {
            Ok(true) => Step::Took(front.len() - rest.len()),
            // Ping Viewer formats times as times of day. Those from 24 hours on aren't valid, and remain empty.
            Ok(false) => Step::Lost(
                front.len() - rest.len(),
                "messages without a time, as Ping Viewer writes them from 24 h after the start of the log",
            ),
            Err(Stop::More) => Step::More,
            Err(Stop::Bad) if self.is_of_another_device => Step::Lost(front.len(), OTHER_DEVICE),
            // Records of this file format have no sync mark, so no record can be found after damage.
            Err(Stop::Bad) if self.begun => {
                Step::Lost(front.len(), "no time and message where they are expected")
            }
            Err(Stop::Bad) => Step::Lost(front.len(), "no preface of Ping Viewer"),
        }
    }
}

impl PingFormat {
    /// Creates the format for a file of this name. Ping Viewer names files by the local time at which the log starts:
    /// `20240131-235959123.bin`.
    pub fn new(file_name: &str) -> Self {
        let start = || {
            let (date, time) = (file_name.get(..8)?, file_name.get(9..18)?);
            let part = |text: &str, from: usize, to: usize| digits(text.get(from..to)?);
            if file_name.get(8..9) != Some("-") || digits(date).is_none() || digits(time).is_none() {
                return None;
            }
            let days = days_since_1970(part(date, 0, 4)?, part(date, 4, 6)?, part(date, 6, 8)?)?;
            let clock = [0, 2, 4].map(|at| time.get(at..at + 2).unwrap_or_default()).join(":");
            let of_day_ns = time_of_day_ns(&format!("{clock}.{}", time.get(6..)?))?;
            Some((days * DAY_NS, of_day_ns))
        };
        Self { start: start(), ..Self::default() }
    }

    fn preface(&mut self, rest: &mut &[u8]) -> Result<bool, Stop> {
        if self.is_of_another_device || text(rest)? != TITLE {
            return Err(Stop::Bad);
        }
        number(rest)?;
        for _ in 0..TEXTS {
            text(rest)?;
        }
        let _family = number(rest)?;
        self.is_of_another_device = REFUSED_TYPES.contains(&number(rest)?);
        if self.is_of_another_device {
            return Err(Stop::Bad);
        }
        self.begun = true;
        Ok(true)
    }

    /// Reads a record. Returns `false` if it has no time.
    fn record(&mut self, rest: &mut &[u8], out: &mut Vec<Entry>) -> Result<bool, Stop> {
        let time = text(rest)?;
        let time = time.trim_end_matches('\0');
        if time.is_empty() {
            sized(rest)?;
            return Ok(false);
        }
        let of_day_ns = time_of_day_ns(time).ok_or(Stop::Bad)?;
        let message = sized(rest)?;
        if self.last_of_day_ns > of_day_ns + MIDNIGHT_NS {
            self.days += 1;
        }
        self.last_of_day_ns = of_day_ns;
        let start = self.start;
        let (zero_ns, _) = *self.zero.get_or_insert_with(|| zero(start, of_day_ns));
        let stamp_ns = zero_ns + self.days * DAY_NS + of_day_ns;
        out.push(Entry { stamp_ns, stream: STREAM.to_owned(), bytes: message.to_vec() });
        Ok(true)
    }
}

/// Returns the time that is added to a log's times, and its meaning as text, from the log's start and first time.
fn zero(start: Option<(u64, u64)>, first_ns: u64) -> (u64, &'static str) {
    let Some((day_ns, of_day_ns)) = start else {
        return (
            0,
            "times have no date, because the file's name isn't that of Ping Viewer, such as 20240131-235959123.bin",
        );
    };
    if first_ns >= of_day_ns && first_ns - of_day_ns <= FIRST_NS {
        (day_ns, "times are times of day; the file's name gives the day, in local time")
    } else {
        (
            day_ns + of_day_ns,
            "times count from the start of the log, which the file's name gives, in local time",
        )
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
