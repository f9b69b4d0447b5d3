//! The table of words for codes: conditions, positions, reasons, verdicts, sensors and priorities.
//!
//! The lines, the terminal and the page use these words. [`page_words`](super::page_words) makes the page's
//! copy. Texts with figures are in [`pilot_text`](super::pilot_text).

use crate::alert_list::kind::Priority;
use crate::live_state::condition::Condition;
use crate::live_state::state::{PositionDoubt, SensorState};
use crate::unread::WithheldReadings;
use headrace_coverage::Verdict;
use headrace_fusion::NoFix;
use headrace_sampling::advice::Reason;
use headrace_sensor::withheld::WithheldReason;

/// Name of the condition after sensors have begun to deliver data and before the first advice update.
pub const STARTING: &str = "STARTING";
/// Action for finding the gyros' bias. The number of seconds follows in the text.
pub const STAND_STILL: &str = "stand still";
/// Words for the state of a section where some heads have not been.
pub const NOT_INSPECTED: &str = "not inspected";
/// Words for the state of wall without any data.
pub const UNSEEN: &str = "unseen";

/// Words for a condition, without figures.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ConditionWords {
    /// Name of the condition.
    pub name: &'static str,
    /// Explanation of the condition; empty if its name explains itself.
    pub detail: &'static str,
    /// Action against the condition; empty if there is none, or if it is a speed.
    pub action: &'static str,
    /// Words before v_max; empty if v_max isn't stated.
    pub speed: &'static str,
}

impl ConditionWords {
    /// Name of the condition, followed by its explanation.
    pub fn text(&self) -> String {
        let Self { name, detail, .. } = self;
        if detail.is_empty() { (*name).to_owned() } else { format!("{name}: {detail}") }
    }

    /// Action against the condition; empty if there is none. `v_max` is v_max with its unit.
    pub fn action_text(&self, v_max: &str) -> String {
        let Self { action, speed, .. } = self;
        if speed.is_empty() { (*action).to_owned() } else { format!("{speed} {v_max}") }
    }
}

/// Words for a condition.
pub fn condition_words(condition: Condition) -> ConditionWords {
    let [name, detail, action, speed] = match condition {
        Condition::NoData => ["WAITING", "no reading from any sensor yet", "", ""],
        Condition::Old(_) => ["OLD", "nothing from any sensor", "stop", ""],
        Condition::NoPosition(no_fix) => ["NO POSITION", missing_words(no_fix), "hold still", ""],
        Condition::Outside(_) => ["OUTSIDE", "no head is within the tunnel", "", ""],
        Condition::NoSonar => ["NO SONAR", "no returns", "stop", ""],
        Condition::Passed => ["passed here", "any speed will do", "", ""],
        Condition::GoingBack(_) => ["going back", "at any speed", "", ""],
        Condition::NoSpeed => ["slower won't help", "no speed meets the target here", "", ""],
        Condition::TooFast => ["TOO FAST", "", "", "at most"],
        // Below v_max, heads at different places along the hull can be out of phase and miss wall. Going
        // slower would then make it worse, so the action is v_max itself.
        Condition::TurnFails => ["THIS TURN MISSES", "", "", "go"],
        Condition::CannotSay(doubt) => ["CAN'T SAY", doubt_words(doubt), "", "at most"],
        Condition::Over => ["a little fast", "", "", "at most"],
        Condition::TurnUnsure => ["THIS TURN MAY MISS", "", "", "go"],
        Condition::Good => ["good", "", "", "may go up to"],
    };
    ConditionWords { name, detail, action, speed }
}

/// Words for the requirement that is missing for a position.
pub fn missing_words(no_fix: NoFix) -> &'static str {
    match no_fix {
        NoFix::Heading => "heading unknown",
        NoFix::Chainage => "chainage unknown",
        NoFix::Section => "lateral position unknown",
    }
}

/// Words for the reason for which a position is doubtful.
pub fn doubt_words(doubt: PositionDoubt) -> &'static str {
    match doubt {
        PositionDoubt::Cable => "cable doubtful",
        PositionDoubt::Spread => "position drifts between passes",
    }
}

/// Words for the factor that limits the speed.
pub fn limit_words(reason: Reason) -> &'static str {
    match reason {
        Reason::HelixPitch => "distance between turns",
        Reason::AngularStep => "samples too far apart along the wall: slower won't help",
        Reason::NoHeadingOrFix => "no position or heading",
        Reason::NoReturns => "no sonar returns",
    }
}

/// Words for a verdict.
pub fn verdict_words(verdict: Verdict) -> &'static str {
    match verdict {
        Verdict::Open => "open",
        Verdict::Pass => "passed",
        Verdict::Fail => "missed",
        Verdict::CannotSay => "can't say",
    }
}

/// Words for the state of a sensor.
pub fn sensor_words(state: SensorState) -> &'static str {
    match state {
        SensorState::Never => "no data yet",
        SensorState::Silent => "silent",
        SensorState::Withheld => "readings withheld",
        SensorState::Stalled => "doesn't turn",
        SensorState::Deaf => "detects no wall",
        SensorState::Hung => "stuck",
        SensorState::Distrusted => "not trusted",
        SensorState::Ok => "ok",
    }
}

/// Text of a sensor's withheld readings: their number, and the reason.
pub fn withheld_text(readings: WithheldReadings) -> String {
    let WithheldReadings { count, reason } = readings;
    let reason = match reason {
        WithheldReason::NoMessage => {
            let packets = if count == 1 { "packet" } else { "packets" };
            return format!("{count} {packets} without a message of this device");
        }
        WithheldReason::OtherDevice => "they have the id of another device".to_owned(),
        WithheldReason::OtherRange => "measured at another range than the vehicle file's".to_owned(),
        WithheldReason::NoCalibration => "calibration unknown".to_owned(),
        WithheldReason::MarkedInvalid => "marked invalid by the device".to_owned(),
        WithheldReason::Fault => "the device reports a fault or is busy".to_owned(),
        WithheldReason::Implausible => "values that cannot be".to_owned(),
        WithheldReason::Repeated => "the device repeats one reading".to_owned(),
        WithheldReason::Late { age_s, at_most_s } => format!("{age_s:.1} s late, at most {at_most_s} s"),
    };
    let what = if count == 1 { "reading" } else { "readings" };
    format!("{count} {what} withheld: {reason}")
}

/// Action against withheld readings.
pub fn withheld_action(reason: WithheldReason) -> &'static str {
    match reason {
        WithheldReason::NoMessage | WithheldReason::OtherDevice => {
            "check its plugin, connection and ids in the vehicle file"
        }
        WithheldReason::OtherRange => "write the device's range in the vehicle file",
        WithheldReason::NoCalibration => "write its calibration in the vehicle file",
        WithheldReason::MarkedInvalid | WithheldReason::Implausible => {
            "check its mounting, view and settings"
        }
        WithheldReason::Fault | WithheldReason::Repeated | WithheldReason::Late { .. } => "restart it",
    }
}

/// Word for a priority of alerts.
pub fn priority_word(priority: Priority) -> &'static str {
    match priority {
        Priority::EmergencyAlarm => "EMERGENCY",
        Priority::Alarm => "ALARM",
        Priority::Warning => "WARNING",
        Priority::Caution => "CAUTION",
    }
}
