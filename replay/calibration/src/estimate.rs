//! What was found, or why nothing was.

/// A number that was found, in the unit of what it is of.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Estimate {
    /// The number.
    pub value: f64,
    /// Its standard deviation.
    pub sd: f64,
}

impl Estimate {
    /// Whether it differs from `other` by more than two standard deviations.
    pub fn differs_from(&self, other: f64) -> bool {
        (self.value - other).abs() > 2.0 * self.sd
    }
}

/// Why something can't be told from this log.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Untold {
    /// No readings of a kind that is needed.
    #[error("there are no readings of {what}")]
    Missing {
        /// Of what.
        what: &'static str,
    },
    /// The vehicle never stood still for long enough.
    #[error(
        "the vehicle moved: {what} went by {span:.2} {unit}, and {limit} is taken for still; it never stood still for \
         {least_s} s"
    )]
    Moved {
        /// What showed it.
        what: &'static str,
        /// By how much it went.
        span: f64,
        /// The unit of that.
        unit: &'static str,
        /// What counts as still.
        limit: f64,
        /// How long it had to stand still, s.
        least_s: usize,
    },
    /// A head has looked at too little of the wall.
    #[error(
        "no full turn: the head has seen only {seen_deg:.0} degrees of wall, and {least_deg:.0} are needed"
    )]
    LittleWall {
        /// What it has seen, degrees.
        seen_deg: f64,
        /// What is needed, degrees.
        least_deg: f64,
    },
    /// Turning the head about its axis changes nothing.
    #[error(
        "the section looks the same however the head is turned about its axis (a circle doesn't tell roll): it would be \
         known to {sd_deg:.1} degrees"
    )]
    Round {
        /// Standard deviation that is left, degrees.
        sd_deg: f64,
    },
    /// One head alone is where the vehicle is.
    #[error("with one head, where it sits can't be told from where the vehicle is")]
    OneHead,
    /// Another unknown looks the same.
    #[error("it looks like another place or heading of the vehicle: it would be known to {sd_m:.3} m")]
    LikePlace {
        /// Standard deviation that is left, m.
        sd_m: f64,
    },
    /// A mirrored head would fit as well.
    #[error(
        "turning the other way would fit nearly as well (by {margin:.0}, and {needed:.0} is clear): the section is \
         symmetric; stand well to one side of the middle, within hearing of the echosounders"
    )]
    Mirror {
        /// By how much the other way fits worse, in squared standard deviations.
        margin: f64,
        /// What is clear.
        needed: f64,
    },
    /// The wall isn't the profile.
    #[error(
        "the returns contradict the profile: half of them are more than {median_m:.2} m off, and {most_m} is allowed"
    )]
    Contradicted {
        /// Median of the residuals without sign, m.
        median_m: f64,
        /// The most that is allowed, m.
        most_m: f64,
    },
    /// Pressure wasn't that of one level.
    #[error(
        "the vehicle wasn't at the surface all the time: the pressure went by {span_pa:.0} Pa, and {most_pa} is allowed"
    )]
    NotAtSurface {
        /// By how much it went, Pa.
        span_pa: f64,
        /// What is allowed, Pa.
        most_pa: f64,
    },
    /// Pressure was that of depth.
    #[error(
        "the depth sensor was under water: the pressure was {mean_pa:.0} Pa, and air has {least_pa} to {most_pa}"
    )]
    UnderWater {
        /// The pressure, Pa.
        mean_pa: f64,
        /// What air has at least, Pa.
        least_pa: f64,
        /// What it has at most, Pa.
        most_pa: f64,
    },
    /// Nobody has said where the vehicle was.
    #[error("nobody has said where the vehicle stood: --chainage METRES does, the portal is 0")]
    NoChainage,
    /// Nobody has said when it was at the surface.
    #[error("nobody has said when the vehicle was at the surface: --at-surface FROM..TO does")]
    NoSurface,
    /// Shifting a source's times changes nothing.
    #[error("the vehicle hardly turned or moved for it: it would be known to {sd_ms:.0} ms")]
    Flat {
        /// Standard deviation that is left, ms.
        sd_ms: f64,
    },
    /// The likelihood has no maximum within reach.
    #[error("no offset within {reach_ms:.0} ms of the file's is best")]
    NoBest {
        /// How far was looked, ms.
        reach_ms: f64,
    },
    /// The filter isn't where the vehicle is.
    #[error(
        "the filter leaves out {gated:.0} % of all measurements, and {most:.0} % are allowed: mounts, beams or the profile \
         of the vehicle file are off, or the vehicle turned too wildly"
    )]
    Disagrees {
        /// Share that it leaves out, %.
        gated: f64,
        /// What is allowed, %.
        most: f64,
    },
    /// The filter never ran.
    #[error(
        "the filter couldn't follow the vehicle: an inertial unit's attitude and ranges to the wall are needed"
    )]
    NoFilter,
}

/// The middle one of some numbers, which it sorts; `None` without any.
pub(crate) fn median(values: &mut [f64]) -> Option<f64> {
    values.sort_unstable_by(f64::total_cmp);
    values.get(values.len() / 2).copied()
}
