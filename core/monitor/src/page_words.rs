//! The page's copy of the table of words: `plugins/dashboard/page/src/text/table.ts`.
//!
//! Allocates: tests only.

use crate::alert_list::json::NoteJson;
use crate::alert_list::kind::{AlertClass, Priority};
use crate::console::command::{NoteText, Who};
use crate::live_state::condition::Condition;
use crate::live_state::state::{PositionDoubt, SensorState};
use crate::notes::{Note, Spoken};
use crate::words::{
    NOT_INSPECTED, STAND_STILL, STARTING, UNSEEN, condition_words, doubt_words, limit_words, missing_words,
    priority_word, sensor_words, verdict_words,
};
use headrace_coverage::{Unsure, Verdict};
use headrace_fusion::NoFix;
use headrace_geometry::time::{DiveClock, DurNs, MonoNs};
use headrace_sampling::advice::Reason;

/// First lines of the generated TypeScript file.
const HEADER: &str =
    "// Words for the codes of the feed. Generated from core/monitor/src/words.rs; renew it with
// HEADRACE_RENEW_WORDS=1 cargo test -p headrace_tests --test page words
";

/// One example of each condition, with arbitrary figures.
const CONDITIONS: [Condition; 14] = [
    Condition::NoData,
    Condition::Old(DurNs(0)),
    Condition::NoPosition(NoFix::Heading),
    Condition::Outside(0.0),
    Condition::NoSonar,
    Condition::Passed,
    Condition::GoingBack(0.0),
    Condition::NoSpeed,
    Condition::TooFast,
    Condition::TurnFails,
    Condition::CannotSay(PositionDoubt::Cable),
    Condition::Over,
    Condition::TurnUnsure,
    Condition::Good,
];
const DOUBTS: [PositionDoubt; 2] = [PositionDoubt::Cable, PositionDoubt::Spread];
const SENSOR_STATES: [SensorState; 8] = [
    SensorState::Never,
    SensorState::Silent,
    SensorState::Withheld,
    SensorState::Stalled,
    SensorState::Deaf,
    SensorState::Hung,
    SensorState::Distrusted,
    SensorState::Ok,
];
const PRIORITIES: [Priority; 4] =
    [Priority::EmergencyAlarm, Priority::Alarm, Priority::Warning, Priority::Caution];

/// Text of the TypeScript file.
pub fn table() -> String {
    let conditions = CONDITIONS.map(|condition| (condition.as_str(), condition_object(condition)));
    let mut positions = entries(NoFix::ALL, NoFix::as_str, missing_words);
    positions.extend(entries(DOUBTS, PositionDoubt::as_str, doubt_words));
    let reasons = entries(Reason::ALL, Reason::as_str, limit_words);
    let mut verdicts = entries(Verdict::ALL, Verdict::as_str, verdict_words);
    verdicts.push((Unsure::NotInspected.as_str(), quoted(NOT_INSPECTED)));
    let sensors = entries(SENSOR_STATES, SensorState::as_str, sensor_words);
    let priorities = entries(PRIORITIES, Priority::as_str, priority_word);
    let classes = AlertClass::ALL.map(|class| quoted(class.as_str())).join(", ");
    let voice = Some(Spoken { id: 0, seconds: 0 });
    let notes = [("mark", quoted(&note_words(None))), ("voice", quoted(&note_words(voice)))];
    [
        HEADER.to_owned(),
        object("CONDITIONS", "Conditions: name, explanation, action, and words before v_max", &conditions),
        constant("STARTING", "Condition if sensors deliver data, but no update has come yet", STARTING),
        constant("STAND_STILL", "Action for finding the gyros' bias", STAND_STILL),
        object("POSITION_WHY", "Reasons for a missing or doubtful position", &positions),
        object("REASONS", "Factors that limit the speed", &reasons),
        object("VERDICTS", "States of a section", &verdicts),
        constant("UNSEEN", "State of wall without any data", UNSEEN),
        object("SENSOR_STATES", "States of a sensor", &sensors),
        object("PRIORITIES", "Priorities of alerts", &priorities),
        format!("\n/** Classes of alerts. */\nexport const CLASSES = [{classes}] as const;\n"),
        object("NOTES", "Notes without a text", &notes),
    ]
    .concat()
}

/// Code and TypeScript literal of each enum value.
fn entries<T: Copy, const N: usize>(
    all: [T; N],
    code: fn(T) -> &'static str,
    words: fn(T) -> &'static str,
) -> Vec<(&'static str, String)> {
    all.iter().map(|value| (code(*value), quoted(words(*value)))).collect()
}

/// Words of a condition as an object. The page adds the reason for the position's state itself.
fn condition_object(condition: Condition) -> String {
    let words = condition_words(condition);
    let detail = match condition {
        Condition::NoPosition(_) | Condition::CannotSay(_) => "",
        _ => words.detail,
    };
    let [name, detail, action, speed] = [words.name, detail, words.action, words.speed].map(quoted);
    format!("{{ name: {name}, detail: {detail}, action: {action}, speed: {speed} }}")
}

/// Words of a note without a text.
fn note_words(voice: Option<Spoken>) -> String {
    let (by, text) = (Who::default(), NoteText::default());
    let note = Note { number: 1, at: MonoNs(0), by, text, voice, chainage_m: None };
    NoteJson::of(&note, DiveClock::default()).words()
}

/// TypeScript constant: an object with a word for each code.
fn object(name: &str, comment: &str, entries: &[(&str, String)]) -> String {
    let lines: Vec<String> = entries.iter().map(|(code, value)| format!("  {code}: {value},\n")).collect();
    format!("\n/** {comment}. */\nexport const {name} = {{\n{}}} as const;\n", lines.concat())
}

fn constant(name: &str, comment: &str, words: &str) -> String {
    format!("\n/** {comment}. */\nexport const {name} = {};\n", quoted(words))
}

/// A text as a string literal, which is the same in Rust and TypeScript for texts without control characters.
fn quoted(text: &str) -> String {
    format!("{text:?}")
}
