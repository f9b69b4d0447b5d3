//! What is advised.

use serde::{Deserialize, Serialize};

use super::MAX_MODES;

/// Bytes of the longest mode name.
const MODE_NAME_BYTES: usize = 15;

/// Why the advice is what it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Reason {
    /// The distance between passes decides: slower helps.
    HelixPitch,
    /// The distance between neighbours of one turn, a strip that no head sees, or the swing of the beams is as large as
    /// the target: slower won't help, another mode or place, or a steadier vehicle would.
    AngularStep,
    /// Without a position and heading nothing can be said.
    NoHeadingOrFix,
    /// No head gives returns.
    NoReturns,
}

impl Reason {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::HelixPitch, Self::AngularStep, Self::NoHeadingOrFix, Self::NoReturns];

    /// The word used in reports and logs.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::HelixPitch => "helix_pitch",
            Self::AngularStep => "angular_step",
            Self::NoHeadingOrFix => "no_heading_or_fix",
            Self::NoReturns => "no_returns",
        }
    }

    /// How much it restricts: a graver one is larger.
    pub(super) fn gravity(self) -> u8 {
        match self {
            Self::HelixPitch => 0,
            Self::AngularStep => 1,
            Self::NoReturns => 2,
            Self::NoHeadingOrFix => 3,
        }
    }
}

/// The name of a mode, as advice that is saved and restored has it.
#[derive(Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct ModeName {
    len: u8,
    bytes: [u8; MODE_NAME_BYTES],
}

impl ModeName {
    /// Of a name; what goes beyond 15 bytes is cut.
    pub fn new(name: &str) -> Self {
        let mut bytes = [0; MODE_NAME_BYTES];
        let len = name.floor_char_boundary(MODE_NAME_BYTES);
        bytes.iter_mut().zip(name.bytes().take(len)).for_each(|(to, from)| *to = from);
        Self { len: u8::try_from(len).unwrap_or(0), bytes }
    }

    /// The name.
    pub fn as_str(&self) -> &str {
        self.bytes.get(..self.len.into()).and_then(|name| core::str::from_utf8(name).ok()).unwrap_or_default()
    }
}

impl core::fmt::Debug for ModeName {
    fn fmt(&self, out: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(out, "{:?}", self.as_str())
    }
}

/// What would help where slower doesn't.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Remedy {
    /// Another mode.
    Mode(ModeName),
    /// The middle of the tunnel, level and straight.
    Centre,
    /// A steady heading.
    Hysteresis,
}

impl Remedy {
    /// Its number in what is published; 0 is none.
    pub fn number(self) -> u64 {
        match self {
            Self::Hysteresis => 1,
            Self::Centre => 2,
            Self::Mode(_) => 3,
        }
    }

    /// The one with that number, and the name of a mode where it is one; `None` for none.
    pub fn of(number: u64, mode: &str) -> Option<Self> {
        let all = [Self::Hysteresis, Self::Centre, Self::Mode(ModeName::new(mode))];
        all.into_iter().find(|remedy| remedy.number() == number)
    }

    /// The word used in reports: `centre`, `steady`, or the mode's name.
    pub fn as_str(&self) -> &str {
        match self {
            Self::Mode(name) => name.as_str(),
            Self::Centre => "centre",
            Self::Hysteresis => "steady",
        }
    }
}

/// What all heads could do in one of their modes.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Alternative {
    /// The mode.
    pub mode: ModeName,
    /// The largest speed at which it meets the target with the heads started in phase for it, m/s; zero where none is.
    pub v_max_mps: f64,
}

/// What is left of a dive.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Left {
    /// Length of tunnel in the direction of travel, m.
    pub length_m: f64,
    /// Time, seconds, where it is known.
    pub time_s: Option<f64>,
}

impl Left {
    /// Hours that the length takes at a speed; `None` at zero speed.
    pub fn hours_at(&self, speed_mps: f64) -> Option<f64> {
        (speed_mps > 0.0).then(|| self.length_m / speed_mps / 3600.0)
    }

    /// Whether the time is enough at a speed; `None` where it isn't known.
    pub fn suffices_at(&self, speed_mps: f64) -> Option<bool> {
        let time_s = self.time_s?;
        Some(self.hours_at(speed_mps).is_some_and(|hours| hours * 3600.0 <= time_s))
    }
}

/// The advice.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Advice {
    /// The largest speed at which the target is met, m/s; zero where none is.
    pub v_max_mps: f64,
    /// What decides.
    pub reason: Reason,
    /// T_max predicted at the present speed, m; `None` where nothing can be said or nothing bounds it.
    pub predicted_t_m: Option<f64>,
    /// At the present speed the present turn will exceed the target; false where nothing can be predicted.
    pub will_exceed: bool,
    /// The longest time between two passes over a place that all heads see, seconds.
    pub pass_gap_s: f64,
    /// What that time would be if the heads' passes were spread evenly, seconds.
    pub even_pass_gap_s: f64,
    /// The largest distance between neighbours of one turn, m.
    pub t_y_m: f64,
    /// Time between two pings, seconds; the longest of any head.
    pub ping_period_s: f64,
    /// By how much the head farthest out of its phase is, radians of its turn; `None` in sectors, or with one head.
    pub phase_error_rad: Option<f64>,
    /// What is left of the tunnel and of the time.
    pub left: Left,
    /// Where slower doesn't help because no head sees a strip of the wall: its width and the arc length of its middle,
    /// m.
    pub unseen_m: Option<[f64; 2]>,
    /// What would help where slower doesn't.
    pub remedy: Option<Remedy>,
    /// The modes that all heads have.
    pub alternatives: [Option<Alternative>; MAX_MODES],
}

impl Advice {
    pub(super) fn nothing(reason: Reason) -> Self {
        Self {
            v_max_mps: 0.0,
            reason,
            predicted_t_m: None,
            will_exceed: false,
            pass_gap_s: 0.0,
            even_pass_gap_s: 0.0,
            t_y_m: 0.0,
            ping_period_s: 0.0,
            phase_error_rad: None,
            left: Left::default(),
            unseen_m: None,
            remedy: None,
            alternatives: [None; MAX_MODES],
        }
    }
}
