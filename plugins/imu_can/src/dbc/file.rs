//! Parses a DBC text, and looks up its signals. Used while reading a vehicle file, never in the loop.

use std::collections::BTreeMap;

use can_dbc::{ByteOrder, Dbc, MessageId, MultiplexIndicator, SignalExtendedValueType, ValueType};

use super::layout::{Bits, DATA_BYTES, Layout, Order};
use crate::frame::CanId;

/// Maximum size of a DBC text. Files of IMUs have some kilobytes, files of whole vehicles some hundreds. The worst case
/// is a text with lists of one-letter names: the parser takes 75 bytes of memory for each byte of it.
const MOST_BYTES: usize = 1 << 20;

/// Maximum number of names that an error lists.
const MOST_NAMES: usize = 40;

const MOST_STANDARD: u32 = 0x7FF;
const EXTENDED: u64 = 1 << 31;

/// An error in a DBC text, or in a signal requested from the text.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum DbcError {
    /// The text isn't valid in the DBC format.
    #[error("reading the DBC: {problem}")]
    Parse {
        /// Number of the faulty line, counted from one.
        line: usize,
        /// Offending text.
        problem: String,
    },
    /// The DBC text is too long.
    #[error(
        "reading the DBC: {0} bytes; at most {MOST_BYTES} are allowed: keep only the messages of the unit"
    )]
    Long(usize),
    /// The DBC has no signal of the requested name.
    #[error("looking for the signal {wanted:?}: the DBC has none of that name; it has {has}")]
    NoSignal {
        /// Requested name of the signal.
        wanted: String,
        /// Names of signals that the DBC has.
        has: String,
    },
    /// Several messages have a signal of the requested name.
    #[error("looking for the signal {wanted:?}: it is in several messages; name one of {among}")]
    Ambiguous {
        /// Requested name of the signal.
        wanted: String,
        /// Unambiguous names of the signals.
        among: String,
    },
    /// The signal extends beyond the end of its frame.
    #[error(
        "laying out the signal {signal:?}: bits {start}|{size}@{order} extend beyond the end of its frame of \
         {frame_bytes} bytes (1 to 64 bits within a classic frame's 8 bytes are allowed)"
    )]
    Wide {
        /// Name of the signal.
        signal: String,
        /// Start bit of the signal.
        start: u64,
        /// Size of the signal in bits.
        size: u64,
        /// Byte order: 1 Intel, 0 Motorola.
        order: u8,
        /// Length of the signal's message.
        frame_bytes: u64,
    },
    /// A signal that is a float has a length other than 32 or 64 bits.
    #[error(
        "laying out the signal {signal:?}: a float of {size} bits; allowed are 32 for SIG_VALTYPE_ 1 and 64 for 2"
    )]
    Float {
        /// Name of the signal.
        signal: String,
        /// Size of the signal in bits.
        size: u64,
    },
    /// The factor of a signal is zero, or its factor or offset is not finite.
    #[error(
        "reading the signal {signal:?}: factor {factor}, offset {offset}; both must be finite, and the factor not zero"
    )]
    Scale {
        /// Name of the signal.
        signal: String,
        /// Factor of the signal, as text.
        factor: String,
        /// Offset of the signal, as text.
        offset: String,
    },
    /// The identifier of a message is invalid.
    #[error(
        "reading the message {message:?}: identifier {id}; allowed are up to 2047, or with bit 31 set for an extended one"
    )]
    Id {
        /// Name of the message.
        message: String,
        /// Identifier of the message, as written.
        id: u64,
    },
    /// A multiplexed signal whose message has nested multiplexing, or not exactly one multiplexer.
    #[error(
        "reading the signal {signal:?}: unsupported multiplexing; allowed is one multiplexer per message, with single \
         values"
    )]
    Multiplexed {
        /// Name of the signal.
        signal: String,
    },
}

/// A signal that was found in the DBC.
#[derive(Debug, Clone, PartialEq)]
pub struct Signal {
    /// Name of the signal, as `Message.Signal`.
    pub name: String,
    /// Unit of the signal, as written in the DBC.
    pub unit: String,
    /// Location of the signal.
    pub place: Place,
}

/// Location of a signal in CAN frames, and the conversion of its bits to a number.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Place {
    /// Identifier of the frames that contain the signal.
    pub id: CanId,
    /// Length of the frames' data.
    pub frame_bytes: u8,
    /// Position of the signal in the data.
    pub layout: Layout,
    /// Number format of the signal.
    pub bits: Bits,
    /// Factor of the conversion "value = bits x factor + offset", in the signal's unit.
    pub factor: f64,
    /// Offset of the conversion; see `factor`.
    pub offset: f64,
    /// Condition of multiplexing: the signal is present only if these bits have this value. `None` if always present.
    pub switch: Option<(Layout, u64)>,
}

impl Place {
    /// Raw bits of the signal in a frame's data, which is padded with zeros to eight bytes; `None` if the frame doesn't
    /// have the signal.
    pub fn raw(&self, id: CanId, data: [u8; DATA_BYTES]) -> Option<u64> {
        let there = self.switch.is_none_or(|(switch, value)| switch.extract(data) == value);
        (self.id == id && there).then(|| self.layout.extract(data))
    }

    /// Value of the signal in the signal's unit.
    pub fn value(&self, id: CanId, data: [u8; DATA_BYTES]) -> Option<f64> {
        let raw = self.raw(id, data)?;
        Some(self.bits.value(raw, self.layout.bits()) * self.factor + self.offset)
    }

    /// Writes the raw value nearest to `value` into a frame's data.
    pub fn put(&self, data: [u8; DATA_BYTES], value: f64) -> [u8; DATA_BYTES] {
        let raw = self.bits.raw((value - self.offset) / self.factor, self.layout.bits());
        self.layout.insert(data, raw)
    }
}

/// A parsed DBC text.
#[derive(Debug)]
pub struct DbcFile {
    dbc: Dbc,
    /// Identifiers as written, by name of the message. They are kept because the parser truncates standard identifiers
    /// to 16 bits.
    wide_ids: BTreeMap<String, u64>,
}

impl DbcFile {
    /// Parses a DBC text.
    ///
    /// Errors: the text is no DBC text, with the offending line; the text is too long.
    pub fn parse(text: &str) -> Result<Self, DbcError> {
        if text.len() > MOST_BYTES {
            return Err(DbcError::Long(text.len()));
        }
        // Strips a byte-order mark, and appends the newline that the grammar requires at the end.
        let text = format!("{}\n", text.trim_start_matches('\u{FEFF}'));
        let dbc = Dbc::try_from(text.as_str()).map_err(|error| named(&text, &error))?;
        Ok(Self { dbc, wide_ids: wide_ids(&text) })
    }

    /// Looks up a signal by its name, or as `Message.Signal`.
    ///
    /// Errors: no signal has this name, or several signals have it; the signal can't be extracted from a classic frame.
    pub fn signal(&self, wanted: &str) -> Result<Signal, DbcError> {
        let all =
            || self.dbc.messages.iter().flat_map(|message| message.signals.iter().map(move |s| (message, s)));
        let full = |message: &can_dbc::Message, signal: &can_dbc::Signal| {
            format!("{}.{}", message.name, signal.name)
        };
        let found: Vec<_> = all().filter(|(m, s)| s.name == wanted || full(m, s) == wanted).collect();
        match found.as_slice() {
            [] => {
                let names: Vec<&str> = all().map(|(_, signal)| signal.name.as_str()).collect();
                Err(DbcError::NoSignal { wanted: wanted.to_owned(), has: listed(&names) })
            }
            [(message, signal)] => self.read(message, signal),
            several => {
                let names: Vec<String> = several.iter().map(|(m, s)| full(m, s)).collect();
                let names: Vec<&str> = names.iter().map(String::as_str).collect();
                Err(DbcError::Ambiguous { wanted: wanted.to_owned(), among: listed(&names) })
            }
        }
    }

    fn read(&self, message: &can_dbc::Message, signal: &can_dbc::Signal) -> Result<Signal, DbcError> {
        let name = format!("{}.{}", message.name, signal.name);
        let layout = layout(message, signal)?;
        if !(signal.factor.is_finite() && signal.offset.is_finite() && signal.factor != 0.0) {
            let (factor, offset) = (signal.factor.to_string(), signal.offset.to_string());
            return Err(DbcError::Scale { signal: name, factor, offset });
        }
        let place = Place {
            id: self.id(message)?,
            frame_bytes: u8::try_from(message.size).unwrap_or(u8::MAX),
            layout,
            bits: self.bits(message, signal)?,
            factor: signal.factor,
            offset: signal.offset,
            switch: self.switch(message, signal)?,
        };
        Ok(Signal { name, unit: signal.unit.clone(), place })
    }

    fn id(&self, message: &can_dbc::Message) -> Result<CanId, DbcError> {
        let wrong = |id: u64| DbcError::Id { message: message.name.clone(), id };
        if let Some(id) = self.wide_ids.get(&message.name) {
            return Err(wrong(*id));
        }
        match message.id {
            MessageId::Standard(id) if u32::from(id) <= MOST_STANDARD => Ok(CanId::Standard(id)),
            MessageId::Standard(id) => Err(wrong(u64::from(id))),
            MessageId::Extended(id) => Ok(CanId::Extended(id)),
        }
    }

    fn bits(&self, message: &can_dbc::Message, signal: &can_dbc::Signal) -> Result<Bits, DbcError> {
        let types = self.dbc.signal_extended_value_type_list.iter();
        let mut own = types.filter(|t| t.message_id == message.id && t.signal_name == signal.name);
        let wrong = || DbcError::Float { signal: signal.name.clone(), size: signal.size };
        match own.next().map(|own| own.signal_extended_value_type) {
            Some(SignalExtendedValueType::IEEEfloat32Bit) if signal.size == 32 => Ok(Bits::Float32),
            Some(SignalExtendedValueType::IEEEdouble64bit) if signal.size == 64 => Ok(Bits::Float64),
            Some(SignalExtendedValueType::IEEEfloat32Bit | SignalExtendedValueType::IEEEdouble64bit) => {
                Err(wrong())
            }
            _ if signal.value_type == ValueType::Signed => Ok(Bits::Signed),
            _ => Ok(Bits::Unsigned),
        }
    }

    fn switch(
        &self,
        message: &can_dbc::Message,
        signal: &can_dbc::Signal,
    ) -> Result<Option<(Layout, u64)>, DbcError> {
        let wrong = || DbcError::Multiplexed { signal: signal.name.clone() };
        let extended = &self.dbc.extended_multiplex;
        if extended.iter().any(|e| e.message_id == message.id && e.signal_name == signal.name) {
            return Err(wrong());
        }
        let value = match signal.multiplexer_indicator {
            MultiplexIndicator::Plain | MultiplexIndicator::Multiplexor => return Ok(None),
            MultiplexIndicator::MultiplexedSignal(value) => value,
            MultiplexIndicator::MultiplexorAndMultiplexedSignal(_) => return Err(wrong()),
        };
        let is_switch = |s: &&can_dbc::Signal| s.multiplexer_indicator == MultiplexIndicator::Multiplexor;
        let mut switches = message.signals.iter().filter(is_switch);
        match (switches.next(), switches.next()) {
            (Some(switch), None) => Ok(Some((layout(message, switch)?, value))),
            _ => Err(wrong()),
        }
    }
}

fn layout(message: &can_dbc::Message, signal: &can_dbc::Signal) -> Result<Layout, DbcError> {
    let (order, digit) = match signal.byte_order {
        ByteOrder::LittleEndian => (Order::Intel, 1),
        ByteOrder::BigEndian => (Order::Motorola, 0),
    };
    let bytes = usize::try_from(message.size).ok().filter(|bytes| *bytes <= DATA_BYTES);
    let layout = bytes.and_then(|bytes| Layout::new(signal.start_bit, signal.size, order, bytes));
    layout.ok_or_else(|| DbcError::Wide {
        signal: signal.name.clone(),
        start: signal.start_bit,
        size: signal.size,
        order: digit,
        frame_bytes: message.size,
    })
}

/// Messages with a non-extended identifier of more than 16 bits.
fn wide_ids(text: &str) -> BTreeMap<String, u64> {
    let message = |line: &str| {
        let (id, rest) =
            line.trim_start().strip_prefix("BO_ ")?.trim_start().split_once(char::is_whitespace)?;
        let id: u64 = id.parse().ok()?;
        let name = rest.trim_start().split([':', ' ', '\t']).next()?;
        (id & EXTENDED == 0 && id > u64::from(u16::MAX)).then(|| (name.to_owned(), id))
    };
    text.lines().filter_map(message).collect()
}

/// Converts a parser error to a readable error with the line and the offending text.
fn named(text: &str, error: &can_dbc::DbcError) -> DbcError {
    let words = error.to_string();
    let line = if matches!(error, can_dbc::DbcError::Pest(_)) {
        // The line number is parsed from ` --> 3:1`, because other ways of getting it require naming the parser's
        // grammar types.
        let at = words.split_once("--> ").and_then(|(_, at)| at.split(':').next());
        at.and_then(|line| line.trim().parse().ok()).unwrap_or(1)
    } else {
        // All other parser errors name the offending text.
        let value = words.split('\'').nth(1).or_else(|| words.rsplit(' ').next());
        let holds = |line: &str| value.is_some_and(|value| !value.is_empty() && line.contains(value));
        text.lines().position(holds).map_or(1, |line| line + 1)
    };
    let there: String =
        text.lines().nth(line.saturating_sub(1)).unwrap_or_default().trim().chars().take(60).collect();
    let problem = match error {
        can_dbc::DbcError::Pest(_) if there.is_empty() => {
            "it ends or is empty, but more is expected".to_owned()
        }
        can_dbc::DbcError::Pest(_) => format!("{there:?} is not valid DBC"),
        _ => words,
    };
    DbcError::Parse { line, problem }
}

fn listed(names: &[&str]) -> String {
    match names.get(..MOST_NAMES) {
        None if names.is_empty() => "none at all".to_owned(),
        None => names.join(", "),
        Some(first) => format!("{} and {} more", first.join(", "), names.len() - first.len()),
    }
}
