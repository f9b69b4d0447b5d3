//! Published results: hashed, and kept word by word for recording or comparison.
//!
//! A stream is a sequence of records. A record is a header, followed by words. A word is an integer, or the
//! bits of a floating-point number. The lowest byte of the header is the record's kind, and the bytes above
//! it are the number of words. Only words are hashed.

use super::digest::Digest;
use headrace_geometry::snapshot::stateful;

/// Capacity of a stream per tick, words. Words beyond it are hashed, but they are not kept and count as lost.
const MAX_TICK_WORDS: usize = 1 << 16;

/// Kind of a record in a result stream.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RecordKind {
    /// A ping that gave a sample.
    Sample = 1,
    /// A ping that gave no sample.
    NoSample = 2,
    /// A judged section.
    Section = 3,
    /// A missed stretch that has changed.
    Run = 4,
    /// Speed advice.
    Advice = 5,
    /// A pose of the vehicle at an advice update.
    Pose = 6,
    /// An advice update without a fix.
    NoPose = 7,
    /// First occurrence of an observation about the dive as a whole.
    Alert = 8,
    /// A ping whose return was not accepted as wall.
    Doubtful = 9,
    /// The live state at an advice update.
    State = 10,
    /// A change of an alert of the list.
    AlertChange = 11,
    /// A note of the crew.
    Note = 12,
    /// A voice note. The record is repeated once the note's recording is in the log.
    Voice = 13,
}

/// Type of a record's word.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum WordKind {
    /// An integer.
    Integer,
    /// The bits of an `f64`.
    Number,
}

/// Words of a sample, and of a doubtful return.
const SAMPLE: [(&str, WordKind); 7] = [
    ("received_ns", WordKind::Integer),
    ("source", WordKind::Integer),
    ("outcome", WordKind::Integer),
    ("x_m", WordKind::Number),
    ("y_m", WordKind::Number),
    ("z_m", WordKind::Number),
    ("arc_m", WordKind::Number),
];
/// Words of a ping without a sample.
const NO_SAMPLE: [(&str, WordKind); 4] = [
    ("received_ns", WordKind::Integer),
    ("source", WordKind::Integer),
    ("outcome", WordKind::Integer),
    ("reason", WordKind::Integer),
];
/// Words of advice.
const ADVICE: [(&str, WordKind); 11] = [
    ("at_ns", WordKind::Integer),
    ("v_max_mps", WordKind::Number),
    ("reason", WordKind::Integer),
    ("will_exceed", WordKind::Integer),
    ("phase_error_rad", WordKind::Number),
    ("t_y_m", WordKind::Number),
    ("unseen_width_m", WordKind::Number),
    ("unseen_arc_m", WordKind::Number),
    ("remedy", WordKind::Integer),
    ("remedy_mode", WordKind::Integer),
    ("remedy_mode_rest", WordKind::Integer),
];
/// Words of a pose.
const POSE: [(&str, WordKind); 13] = [
    ("at_ns", WordKind::Integer),
    ("x_m", WordKind::Number),
    ("y_m", WordKind::Number),
    ("z_m", WordKind::Number),
    ("w", WordKind::Number),
    ("i", WordKind::Number),
    ("j", WordKind::Number),
    ("k", WordKind::Number),
    ("speed_mps", WordKind::Number),
    // The standard deviations are present only if the navigation method provides them.
    ("along_sd_m", WordKind::Number),
    ("place_sd_m", WordKind::Number),
    ("tilt_sd_rad", WordKind::Number),
    ("yaw_sd_rad", WordKind::Number),
];
/// Words of the live state.
const STATE: [(&str, WordKind); 19] = [
    ("at_ns", WordKind::Integer),
    ("position", WordKind::Integer),
    ("chainage_m", WordKind::Number),
    ("pass_sd_m", WordKind::Number),
    ("stand_s", WordKind::Integer),
    ("speed_mps", WordKind::Number),
    ("v_max_mps", WordKind::Number),
    ("reason", WordKind::Integer),
    ("predicted_t_m", WordKind::Number),
    ("pass_m", WordKind::Number),
    ("fail_m", WordKind::Number),
    ("cannot_say_m", WordKind::Number),
    ("open_m", WordKind::Number),
    ("not_inspected_m", WordKind::Number),
    ("unsure", WordKind::Integer),
    ("unsure_from", WordKind::Integer),
    ("unsure_to", WordKind::Integer),
    ("alerts", WordKind::Integer),
    ("turning", WordKind::Integer),
];
/// Words of the first occurrence of an observation.
const ALERT: [(&str, WordKind); 5] = [
    ("at_ns", WordKind::Integer),
    ("kind", WordKind::Integer),
    ("x_m", WordKind::Number),
    ("off_m", WordKind::Number),
    // The source is present only if the observation names one.
    ("source", WordKind::Integer),
];
/// Names and types of the words in a judged section's record.
const SECTION: [(&str, WordKind); 17] = [
    ("at_ns", WordKind::Integer),
    ("section", WordKind::Integer),
    ("change", WordKind::Integer),
    ("verdict", WordKind::Integer),
    ("hole_m", WordKind::Number),
    ("hole_sd_m", WordKind::Number),
    ("cause", WordKind::Integer),
    ("hole_x_m", WordKind::Number),
    ("hole_arc_m", WordKind::Number),
    // The following words are present only if the section has evidence for the cause of a fail.
    ("speed_mps", WordKind::Number),
    ("t_y_m", WordKind::Number),
    ("middle_t_y_m", WordKind::Number),
    ("missing_share", WordKind::Number),
    ("swing_m", WordKind::Number),
    ("silent_heads", WordKind::Integer),
    ("causes", WordKind::Integer),
    // Records of earlier program versions lack this word.
    ("with_losses_mps", WordKind::Number),
];

/// Names and types of the words in an alert change's record.
const ALERT_CHANGE: [(&str, WordKind); 16] = [
    ("at_ns", WordKind::Integer),
    ("number", WordKind::Integer),
    ("change", WordKind::Integer),
    ("kind", WordKind::Integer),
    ("priority", WordKind::Integer),
    ("state", WordKind::Integer),
    ("source", WordKind::Integer),
    ("count", WordKind::Integer),
    ("acknowledged_ns", WordKind::Integer),
    ("by", WordKind::Integer),
    ("by_rest", WordKind::Integer),
    ("silenced_until_ns", WordKind::Integer),
    ("from", WordKind::Integer),
    ("to", WordKind::Integer),
    ("x_m", WordKind::Number),
    ("figure", WordKind::Number),
];
/// Names and types of the words in a voice note's record.
const VOICE: [(&str, WordKind); 7] = [
    ("at_ns", WordKind::Integer),
    ("number", WordKind::Integer),
    ("chainage_m", WordKind::Number),
    ("by", WordKind::Integer),
    ("by_rest", WordKind::Integer),
    ("id", WordKind::Integer),
    ("seconds", WordKind::Integer),
];
/// Names and types of the words in a note's record. The words of the note's text follow.
const NOTE: [(&str, WordKind); 5] = [
    ("at_ns", WordKind::Integer),
    ("number", WordKind::Integer),
    ("chainage_m", WordKind::Number),
    ("by", WordKind::Integer),
    ("by_rest", WordKind::Integer),
];

impl RecordKind {
    const ALL: [Self; 13] = [
        Self::Sample,
        Self::NoSample,
        Self::Section,
        Self::Run,
        Self::Advice,
        Self::Pose,
        Self::NoPose,
        Self::Alert,
        Self::Doubtful,
        Self::State,
        Self::AlertChange,
        Self::Note,
        Self::Voice,
    ];

    /// Record kind with this number.
    pub fn of(number: u8) -> Option<Self> {
        Self::ALL.into_iter().find(|kind| *kind as u8 == number)
    }

    /// Name of the record kind.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Sample => "sample",
            Self::NoSample => "ping without a sample",
            Self::Section => "section",
            Self::Run => "missed stretch",
            Self::Advice => "advice",
            Self::Pose => "pose",
            Self::NoPose => "missing pose",
            Self::Alert => "alert",
            Self::Doubtful => "doubtful return",
            Self::State => "live state",
            Self::AlertChange => "change of an alert",
            Self::Note => "note",
            Self::Voice => "voice note",
        }
    }

    /// Name and type of the record's word at index `place`.
    pub fn field(self, place: usize) -> (&'static str, WordKind) {
        // All words beyond the last field have the same name and type. They are the speeds that alternative
        // modes allow (advice), the time of each source's last reading (live state), or the text (note).
        let beyond = match self {
            Self::Advice => ("alternative_v_max_mps", WordKind::Number),
            Self::State => ("heard_ns", WordKind::Integer),
            Self::Note => ("text", WordKind::Integer),
            _ => ("beyond the last field", WordKind::Number),
        };
        self.fields().get(place).copied().unwrap_or(beyond)
    }

    fn fields(self) -> &'static [(&'static str, WordKind)] {
        match self {
            Self::Sample | Self::Doubtful => &SAMPLE,
            Self::NoSample => &NO_SAMPLE,
            Self::Section => &SECTION,
            Self::Run => &[("id", WordKind::Integer), ("change", WordKind::Integer)],
            Self::Advice => &ADVICE,
            Self::Pose => &POSE,
            Self::State => &STATE,
            Self::NoPose => &[("at_ns", WordKind::Integer), ("reason", WordKind::Integer)],
            Self::Alert => &ALERT,
            Self::AlertChange => &ALERT_CHANGE,
            Self::Note => &NOTE,
            Self::Voice => &VOICE,
        }
    }
}

/// A stream of results.
#[derive(Debug, Clone, Default)]
pub struct ResultStream {
    digest: Digest,
    words: Vec<u64>,
    /// Capacity for words per tick; zero unless words are kept.
    room: usize,
    head: usize,
    records: u64,
    lost: u64,
}

stateful!(ResultStream { state: digest, records, lost; fixed: words, room, head; });

impl ResultStream {
    /// Keeps the words of each tick from now on. Allocates: once, all memory for the words.
    pub fn keep(&mut self) {
        self.room = MAX_TICK_WORDS;
        self.words.reserve_exact(self.room);
    }

    /// Begins a record of the stream.
    pub(super) fn record(&mut self, kind: RecordKind) -> &mut Self {
        self.records += 1;
        self.head = self.words.len();
        self.push(kind as u64);
        self
    }

    /// Adds an integer to the present record.
    pub(super) fn integer(&mut self, value: u64) -> &mut Self {
        self.digest.integer(value);
        self.word(value);
        self
    }

    /// Adds the bits of a number to the present record; -0 counts as +0.
    pub(super) fn number(&mut self, value: f64) -> &mut Self {
        self.digest.number(value);
        self.word((value + 0.0).to_bits());
        self
    }

    /// The digest of all words so far.
    pub fn value(&self) -> u64 {
        self.digest.value()
    }

    /// Words of the last tick, including headers.
    pub fn words(&self) -> &[u64] {
        &self.words
    }

    /// Number of records so far, including those of the last tick.
    pub fn records(&self) -> u64 {
        self.records
    }

    /// Number of words not kept because they exceeded a tick's capacity.
    pub fn lost(&self) -> u64 {
        self.lost
    }

    /// Adds the first 16 bytes of a text to the present record, as two integers.
    pub(super) fn text(&mut self, text: &str) -> &mut Self {
        let mut bytes = [0; 16];
        bytes.iter_mut().zip(text.bytes()).for_each(|(byte, of)| *byte = of);
        let (halves, _) = bytes.as_chunks::<8>();
        for half in halves {
            self.integer(u64::from_le_bytes(*half));
        }
        self
    }

    /// Reserves as much room as another stream has. Allocates.
    pub(super) fn reserve_as(&mut self, other: &Self) {
        self.words.reserve_exact(other.room);
    }

    /// Copies the state of another stream, with the words of its last tick.
    pub(super) fn follow(&mut self, other: &Self) {
        (self.digest, self.records, self.lost) = (other.digest, other.records, other.lost);
        self.words.clear();
        self.words.extend_from_slice(&other.words);
    }

    /// Clears the words of the last tick.
    pub(super) fn next_tick(&mut self) {
        self.words.clear();
    }

    fn word(&mut self, word: u64) {
        if self.push(word)
            && let Some(head) = self.words.get_mut(self.head)
        {
            *head += 1 << 8;
        }
    }

    fn push(&mut self, word: u64) -> bool {
        let fits = self.words.len() < self.room;
        if fits {
            self.words.push(word);
        } else if self.room > 0 {
            self.lost += 1;
        }
        fits
    }
}

/// One record of a stream.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Record<'a> {
    /// Kind of the record; `None` if this version doesn't know it.
    pub kind: Option<RecordKind>,
    /// Words of the record.
    pub words: &'a [u64],
}

/// Text decoded from two words of a record.
pub fn text_of(words: [u64; 2]) -> String {
    let bytes = words.map(u64::to_le_bytes);
    let text = bytes.as_flattened().iter().copied().take_while(|byte| *byte != 0).collect::<Vec<_>>();
    String::from_utf8_lossy(&text).into_owned()
}

/// First record of a word sequence, and the words after it.
///
/// `None` if there are no more words, or if the record is incomplete.
pub fn first_record(words: &[u64]) -> Option<(Record<'_>, &[u64])> {
    let (head, rest) = words.split_first()?;
    let [kind, ..] = head.to_le_bytes();
    let (words, rest) = rest.split_at_checked(usize::try_from(head >> 8).ok()?)?;
    Some((Record { kind: RecordKind::of(kind), words }, rest))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn filled() -> ResultStream {
        let mut stream = ResultStream::default();
        stream.keep();
        stream.record(RecordKind::Run).integer(7).integer(1);
        stream.record(RecordKind::Advice).integer(5).number(0.25).integer(0).integer(1).number(-0.0);
        stream
    }

    #[test]
    fn result_records_are_read_as_written() {
        let stream = filled();
        let (first, rest) = first_record(stream.words()).unwrap();
        assert_eq!(first, Record { kind: Some(RecordKind::Run), words: &[7, 1] });
        let (second, rest) = first_record(rest).unwrap();
        assert_eq!(second.words, [5, 0.25_f64.to_bits(), 0, 1, 0]);
        assert_eq!(second.kind.map(|kind| kind.field(1)), Some(("v_max_mps", WordKind::Number)));
        assert_eq!(second.kind.map(|kind| kind.field(11).0), Some("alternative_v_max_mps"));
        assert_eq!(first_record(rest), None);
        assert_eq!((stream.records(), stream.lost()), (2, 0));
        assert_eq!(first_record(&[5 << 8 | 1, 2]), None);
    }

    #[test]
    fn only_long_texts_are_cut_in_records() {
        for (text, back) in [("", ""), ("0.3 deg", "0.3 deg"), ("a mode's long name", "a mode's long na")] {
            let mut stream = ResultStream::default();
            stream.keep();
            stream.record(RecordKind::Advice).text(text);
            let (record, _) = first_record(stream.words()).unwrap();
            assert_eq!(text_of([record.words[0], record.words[1]]), back);
        }
    }

    /// The digest is the same whether words are kept or not, and whether there is room for them or not.
    #[test]
    fn digest_does_not_depend_on_whether_records_are_stored() {
        let mut plain = ResultStream::default();
        plain.record(RecordKind::Run).integer(7).integer(1);
        plain.record(RecordKind::Advice).integer(5).number(0.25).integer(0).integer(1).number(0.0);
        assert_eq!(plain.value(), filled().value());
        assert!(plain.words().is_empty());
        let (mut kept, mut plain) = (filled(), filled());
        for stream in [&mut kept, &mut plain] {
            for value in 0..2 * MAX_TICK_WORDS as u64 {
                stream.record(RecordKind::Run).integer(value);
            }
        }
        plain.next_tick();
        assert!(kept.lost() > 0 && kept.words().len() == MAX_TICK_WORDS && plain.words().is_empty());
        assert_eq!(kept.value(), plain.value());
    }
}
