//! Speed advice, with its reason, remedy and alternatives.

use serde::{Deserialize, Serialize};

use crate::margin::Margins;

/// Maximum number of modes per head for which alternatives are computed.
pub const MAX_MODES: usize = 8;
/// Maximum length of a mode name, bytes.
const MODE_NAME_BYTES: usize = 15;

/// The limiting factor of the advice.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Reason {
    /// The distance between passes is the limit, so a lower speed helps.
    HelixPitch,
    /// A lower speed does not help. Another mode, another position or a steadier vehicle may help.
    ///
    /// The cause is the distance between neighbouring samples of one turn, the width of a strip that no head sees, or
    /// the swing of the beams.
    AngularStep,
    /// No advice is possible, because position or heading is missing.
    NoHeadingOrFix,
    /// No advice is possible, because no head delivers returns.
    NoReturns,
}

impl Reason {
    /// All limiting factors of the advice.
    pub const ALL: [Self; 4] = [Self::HelixPitch, Self::AngularStep, Self::NoHeadingOrFix, Self::NoReturns];

    /// Name of the limiting factor in reports and logs.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::HelixPitch => "helix_pitch",
            Self::AngularStep => "angular_step",
            Self::NoHeadingOrFix => "no_heading_or_fix",
            Self::NoReturns => "no_returns",
        }
    }

    /// Severity of the limiting factor: a more severe factor has a larger number.
    pub(super) fn gravity(self) -> u8 {
        match self {
            Self::HelixPitch => 0,
            Self::AngularStep => 1,
            Self::NoReturns => 2,
            Self::NoHeadingOrFix => 3,
        }
    }
}

/// Name of a mode. It has a fixed size, so that advice can be saved and restored.
#[derive(Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct ModeName {
    len: u8,
    bytes: [u8; MODE_NAME_BYTES],
}

impl ModeName {
    /// Creates a mode name, truncated to 15 bytes.
    pub fn new(name: &str) -> Self {
        let mut bytes = [0; MODE_NAME_BYTES];
        let len = name.floor_char_boundary(MODE_NAME_BYTES);
        bytes.iter_mut().zip(name.bytes().take(len)).for_each(|(to, from)| *to = from);
        Self { len: u8::try_from(len).unwrap_or(0), bytes }
    }

    /// The name of the mode as text.
    pub fn as_str(&self) -> &str {
        let name = self.bytes.get(..self.len.into()).and_then(|name| core::str::from_utf8(name).ok());
        debug_assert!(name.is_some(), "a mode's name is UTF-8: {} of {:?}", self.len, self.bytes);
        name.unwrap_or_default()
    }
}

impl core::fmt::Debug for ModeName {
    fn fmt(&self, out: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(out, "{:?}", self.as_str())
    }
}

/// Change that helps if a lower speed does not help.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Remedy {
    /// Setting the heads to another mode.
    Mode(ModeName),
    /// Moving to the middle of the tunnel, level and straight.
    Centre,
    /// Holding a steady heading.
    HoldHeading,
}

impl Remedy {
    /// Number of the remedy in published data; 0 means no remedy.
    pub fn number(self) -> u64 {
        match self {
            Self::HoldHeading => 1,
            Self::Centre => 2,
            Self::Mode(_) => 3,
        }
    }

    /// Returns the remedy with this number in published data; `None` for an unknown number.
    ///
    /// `mode` is the name for [`Remedy::Mode`].
    pub fn of(number: u64, mode: &str) -> Option<Self> {
        let all = [Self::HoldHeading, Self::Centre, Self::Mode(ModeName::new(mode))];
        all.into_iter().find(|remedy| remedy.number() == number)
    }

    /// Name of the remedy in reports: `centre`, `steady`, or the mode's name.
    pub fn as_str(&self) -> &str {
        match self {
            Self::Mode(name) => name.as_str(),
            Self::Centre => "centre",
            Self::HoldHeading => "steady",
        }
    }
}

/// Alternative to the present mode: the largest speed with all heads in another mode.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Alternative {
    /// The mode in which all heads are assumed to turn.
    pub mode: ModeName,
    /// The largest speed that meets the target with the heads started in phase, m/s.
    ///
    /// Zero if no speed meets the target.
    pub v_max_mps: f64,
}

/// A restart of the heads in their present mode, with phases that suit a given speed.
///
/// The given speed corresponds to `planned_speed_mps` in `[heads]` of the vehicle file.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Anew {
    /// Speed for which to start the heads, m/s: the largest speed that meets the target after the restart.
    pub planned_speed_mps: f64,
}

/// Remaining length and time of a dive.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Left {
    /// Remaining length of tunnel in the direction of travel, m.
    pub length_m: f64,
    /// Remaining time of the dive, seconds, if known.
    pub time_s: Option<f64>,
}

impl Left {
    /// Returns the hours needed for the remaining length of tunnel at a speed; `None` at zero speed.
    pub fn hours_at(&self, speed_mps: f64) -> Option<f64> {
        (speed_mps > 0.0).then(|| self.length_m / speed_mps / 3600.0)
    }

    /// Whether the remaining time is enough for the remaining length at a speed; `None` if the time is unknown.
    pub fn suffices_at(&self, speed_mps: f64) -> Option<bool> {
        let time_s = self.time_s?;
        Some(self.hours_at(speed_mps).is_some_and(|hours| hours * 3600.0 <= time_s))
    }
}

/// Speed advice to the pilot.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Advice {
    /// The largest speed at which sections will get the verdict pass, m/s; zero if there is none.
    pub v_max_mps: f64,
    /// Lower end of the advised interval of speeds, m/s; zero if all lower speeds meet the target.
    ///
    /// At lower speeds, heads that are apart along the hull run out of phase.
    pub from_mps: f64,
    /// Speed that meets the target and is nearest to the present speed, m/s.
    ///
    /// `None` if the present speed meets the target, or if no speed near the present speed meets the target.
    pub nearest_mps: Option<f64>,
    /// The limiting factor of the advice.
    pub reason: Reason,
    /// T_max predicted at the present speed, m; `None` if it cannot be predicted or is unbounded.
    pub predicted_t_m: Option<f64>,
    /// Whether the spacing T of the present turn is forecast to exceed the target; false without a prediction.
    pub will_exceed: bool,
    /// Whether the spacing T of the present turn may exceed the target; false without a prediction.
    ///
    /// True if the predicted T exceeds the target minus the margin for position errors.
    pub may_exceed: bool,
    /// Target T minus the margin for position errors, m.
    pub sure_m: f64,
    /// The longest time between two head passes over a place that all heads see, seconds.
    pub pass_gap_s: f64,
    /// The longest time between two head passes if passes are evenly spread, seconds.
    pub even_pass_gap_s: f64,
    /// T_y: the largest distance between neighbouring samples of one turn, m.
    pub t_y_m: f64,
    /// Longest time between two pings of any head, seconds.
    pub ping_period_s: f64,
    /// Phase error of the head farthest out of phase, in radians of the head's rotation.
    ///
    /// `None` for heads in sectors, or for a single head.
    pub phase_error_rad: Option<f64>,
    /// Remaining length of tunnel and remaining time of the dive.
    pub left: Left,
    /// Width of a strip that no head sees, and the arc length of its middle, m.
    ///
    /// `Some` only if this strip is the reason why a lower speed does not help.
    pub unseen_m: Option<[f64; 2]>,
    /// Remedy if a lower speed does not help, or if only the passes of several swings together meet the target.
    pub remedy: Option<Remedy>,
    /// Largest speeds in the modes that all heads have.
    pub alternatives: [Option<Alternative>; MAX_MODES],
    /// Restart of the heads in phase for the best speed; `None` if the heads' phases do not depend on the speed.
    pub anew: Option<Anew>,
    /// Largest speeds as more and more margins are added, which show what each margin costs; updated every five
    /// seconds.
    pub margins: Option<Margins>,
    /// Share of returns that the turning heads lose by chance.
    pub lost_share: f64,
    /// Higher speed that is displayed soon if it stays possible, m/s.
    pub rising_mps: Option<f64>,
}

impl Advice {
    /// Whether the figures of the advice agree with each other.
    ///
    /// Speeds and times must be finite and not negative. The advice must state a speed if and only if a lower speed
    /// helps. The advised interval must end at the stated speed.
    pub fn is_consistent(&self) -> bool {
        let figures = [self.v_max_mps, self.sure_m, self.pass_gap_s, self.even_pass_gap_s, self.t_y_m];
        let is_figure = |figure: f64| figure >= 0.0 && figure.is_finite();
        figures.into_iter().chain(self.nearest_mps).chain(self.predicted_t_m).all(is_figure)
            && (0.0..=self.v_max_mps).contains(&self.from_mps)
            && (self.v_max_mps > 0.0) == (self.reason == Reason::HelixPitch)
            && (0.0..=1.0).contains(&self.lost_share)
    }

    pub(super) fn nothing(reason: Reason) -> Self {
        Self {
            v_max_mps: 0.0,
            from_mps: 0.0,
            nearest_mps: None,
            reason,
            predicted_t_m: None,
            will_exceed: false,
            may_exceed: false,
            sure_m: 0.0,
            pass_gap_s: 0.0,
            even_pass_gap_s: 0.0,
            t_y_m: 0.0,
            ping_period_s: 0.0,
            phase_error_rad: None,
            left: Left::default(),
            unseen_m: None,
            remedy: None,
            alternatives: [None; MAX_MODES],
            anew: None,
            margins: None,
            lost_share: 0.0,
            rising_mps: None,
        }
    }
}
