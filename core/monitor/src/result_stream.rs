//! Results as they are published: hashed, and kept word by word for those who record or compare them.
//!
//! A stream is a row of records. A record is a head and then its words: whole numbers, or the bits of numbers. The head has
//! the record's kind in its lowest byte and the number of its words above it. What is hashed are the words.

use super::digest::Digest;
use headrace_snapshot::stateful;

/// Words of a stream that one tick has room for; what goes beyond is counted as lost to the record, not to the digest.
const MAX_TICK_WORDS: usize = 1 << 16;

/// What a record tells.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RecordKind {
    /// A ping that has become a sample.
    Sample = 1,
    /// A ping that has become none.
    NoSample = 2,
    /// A section that was judged.
    Section = 3,
    /// A run of sections that has changed.
    Run = 4,
    /// Advice.
    Advice = 5,
    /// Where the vehicle is.
    Pose = 6,
    /// Nobody knows where the vehicle is.
    NoPose = 7,
    /// Something is wrong with the dive as a whole.
    Alert = 8,
}

/// What a word of a record is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum WordKind {
    /// A whole number.
    Integer,
    /// The bits of a number.
    Number,
}

impl RecordKind {
    const ALL: [Self; 8] = [
        Self::Sample,
        Self::NoSample,
        Self::Section,
        Self::Run,
        Self::Advice,
        Self::Pose,
        Self::NoPose,
        Self::Alert,
    ];

    /// The kind with this number.
    pub fn of(number: u8) -> Option<Self> {
        Self::ALL.into_iter().find(|kind| *kind as u8 == number)
    }

    /// What such a record is called.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Sample => "sample",
            Self::NoSample => "ping without a sample",
            Self::Section => "section",
            Self::Run => "run",
            Self::Advice => "advice",
            Self::Pose => "pose",
            Self::NoPose => "lack of a pose",
            Self::Alert => "alert",
        }
    }

    /// The name of its word at `place`, and what it is.
    pub fn field(self, place: usize) -> (&'static str, WordKind) {
        use WordKind::{Integer, Number};
        let fields: &[(&str, WordKind)] = match self {
            Self::Sample => &[
                ("received_ns", Integer),
                ("source", Integer),
                ("outcome", Integer),
                ("x_m", Number),
                ("y_m", Number),
                ("z_m", Number),
                ("arc_m", Number),
            ],
            Self::NoSample => {
                &[("received_ns", Integer), ("source", Integer), ("outcome", Integer), ("reason", Integer)]
            }
            Self::Section => &[
                ("at_ns", Integer),
                ("section", Integer),
                ("change", Integer),
                ("verdict", Integer),
                ("hole_m", Number),
                ("hole_sd_m", Number),
                ("cause", Integer),
                ("hole_x_m", Number),
                ("hole_arc_m", Number),
                // Where there is a cause.
                ("speed_mps", Number),
                ("t_y_m", Number),
                ("middle_t_y_m", Number),
                ("missing_share", Number),
                ("swing_m", Number),
            ],
            Self::Run => &[("id", Integer), ("change", Integer)],
            Self::Advice => &[
                ("at_ns", Integer),
                ("v_max_mps", Number),
                ("reason", Integer),
                ("will_exceed", Integer),
                ("phase_error_rad", Number),
                ("t_y_m", Number),
                ("unseen_width_m", Number),
                ("unseen_arc_m", Number),
                ("remedy", Integer),
                ("remedy_mode", Integer),
                ("remedy_mode_rest", Integer),
            ],
            Self::Pose => &[
                ("at_ns", Integer),
                ("x_m", Number),
                ("y_m", Number),
                ("z_m", Number),
                ("w", Number),
                ("i", Number),
                ("j", Number),
                ("k", Number),
                ("speed_mps", Number),
                // Where navigation knows them.
                ("along_sd_m", Number),
                ("place_sd_m", Number),
                ("tilt_sd_rad", Number),
                ("yaw_sd_rad", Number),
            ],
            Self::NoPose => &[("at_ns", Integer), ("reason", Integer)],
            Self::Alert => &[("at_ns", Integer), ("kind", Integer), ("x_m", Number), ("off_m", Number)],
        };
        // Advice goes on with the speeds that other modes would allow.
        let beyond = if self == Self::Advice { "alternative_v_max_mps" } else { "beyond the last field" };
        fields.get(place).copied().unwrap_or((beyond, Number))
    }
}

/// A stream of results.
#[derive(Debug, Clone, Default)]
pub struct ResultStream {
    digest: Digest,
    words: Vec<u64>,
    /// Room for words of a tick; none while nobody keeps them.
    room: usize,
    head: usize,
    records: u64,
    lost: u64,
}

stateful!(ResultStream { state: digest, records, lost; fixed: words, room, head; });

impl ResultStream {
    /// Keeps the words of each tick from now on. Allocates: all that it will need.
    pub fn keep(&mut self) {
        self.room = MAX_TICK_WORDS;
        self.words.reserve_exact(self.room);
    }

    /// Begins a record.
    pub(super) fn record(&mut self, kind: RecordKind) -> &mut Self {
        self.records += 1;
        self.head = self.words.len();
        self.push(kind as u64);
        self
    }

    /// Takes a whole number in.
    pub(super) fn integer(&mut self, value: u64) -> &mut Self {
        self.digest.integer(value);
        self.word(value);
        self
    }

    /// Takes a number in, bit for bit; all zeros alike.
    pub(super) fn number(&mut self, value: f64) -> &mut Self {
        self.digest.number(value);
        self.word((value + 0.0).to_bits());
        self
    }

    /// The digest of all so far.
    pub fn value(&self) -> u64 {
        self.digest.value()
    }

    /// The words of the last tick, heads included.
    pub fn words(&self) -> &[u64] {
        &self.words
    }

    /// Records so far, those of the last tick included.
    pub fn records(&self) -> u64 {
        self.records
    }

    /// Words for which a tick had no room.
    pub fn lost(&self) -> u64 {
        self.lost
    }

    /// Takes a short text in: its first 16 bytes, as two whole numbers.
    pub(super) fn text(&mut self, text: &str) -> &mut Self {
        let mut bytes = [0; 16];
        bytes.iter_mut().zip(text.bytes()).for_each(|(byte, of)| *byte = of);
        let (halves, _) = bytes.as_chunks::<8>();
        for half in halves {
            self.integer(u64::from_le_bytes(*half));
        }
        self
    }

    /// Forgets the words of the last tick.
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

/// A record of a stream.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Record<'a> {
    /// What it tells; `None` for a kind that this version doesn't know.
    pub kind: Option<RecordKind>,
    /// Its words.
    pub words: &'a [u64],
}

/// The text that two words of a record hold.
pub fn text_of(words: [u64; 2]) -> String {
    let bytes = words.map(u64::to_le_bytes);
    let text = bytes.as_flattened().iter().copied().take_while(|byte| *byte != 0).collect::<Vec<_>>();
    String::from_utf8_lossy(&text).into_owned()
}

/// The first of a row of records, and the row after it. `None` at the end, or where a record isn't whole.
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
    fn records_come_out_as_they_went_in() {
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
    fn a_short_text_comes_back_and_a_long_one_is_cut() {
        for (text, back) in [("", ""), ("0.3 deg", "0.3 deg"), ("a mode's long name", "a mode's long na")] {
            let mut stream = ResultStream::default();
            stream.keep();
            stream.record(RecordKind::Advice).text(text);
            let (record, _) = first_record(stream.words()).unwrap();
            assert_eq!(text_of([record.words[0], record.words[1]]), back);
        }
    }

    /// Keeping changes no digest, nor does the lack of room.
    #[test]
    fn the_digest_is_of_the_words_alone() {
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
