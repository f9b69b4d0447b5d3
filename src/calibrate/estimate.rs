//! Estimates, and the reasons for missing ones.

/// An estimated number, in the unit of its quantity.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Estimate {
    /// The value.
    pub(crate) value: f64,
    /// Its standard deviation.
    pub(crate) sd: f64,
}

impl Estimate {
    /// Whether it differs from `other` by more than three standard deviations: of so many quantities one is soon two off by chance.
    pub(crate) fn differs_from(&self, other: f64) -> bool {
        (self.value - other).abs() > 3.0 * self.sd
    }
}

/// Reason why a quantity can't be estimated from this log.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub(crate) enum Untold {
    /// No readings of a required kind.
    #[error("there are no readings of {what}")]
    Missing {
        /// The kind.
        what: &'static str,
    },
    /// The vehicle never stood still for long enough.
    #[error(
        "the vehicle moved: {what} went by {span:.2} {unit}, and {limit} is taken for still; it never stood still for \
         {least_s} s"
    )]
    Moved {
        /// The quantity that moved.
        what: &'static str,
        /// Its range of motion.
        span: f64,
        /// Its unit.
        unit: &'static str,
        /// Largest range that counts as still.
        limit: f64,
        /// Required duration at rest, s.
        least_s: usize,
    },
    /// A head has covered too little of the wall.
    #[error(
        "no full turn: the head has seen only {seen_deg:.0} degrees of wall, and {least_deg:.0} are needed"
    )]
    LittleWall {
        /// Sector covered, degrees.
        seen_deg: f64,
        /// Sector required, degrees.
        least_deg: f64,
    },
    /// Turning the head about its axis changes nothing.
    #[error(
        "the section looks the same however the head is turned about its axis (a circle doesn't tell roll): it would be \
         known to {sd_deg:.1} degrees"
    )]
    Round {
        /// Remaining standard deviation, degrees.
        sd_deg: f64,
    },
    /// The offset of a single head can't be separated from the vehicle's position.
    #[error("with one head, where it sits can't be told from where the vehicle is")]
    OneHead,
    /// Another unknown has the same effect.
    #[error("it looks like another place or heading of the vehicle: it would be known to {sd_m:.3} m")]
    LikePlace {
        /// Remaining standard deviation, m.
        sd_m: f64,
    },
    /// A mirrored head would fit as well.
    #[error(
        "turning the other way would fit nearly as well (by {margin:.0}, and {needed:.0} is clear): the section is \
         symmetric; stand well to one side of the middle, within hearing of the echosounders"
    )]
    Mirror {
        /// Cost difference of the other way, in squared standard deviations.
        margin: f64,
        /// Difference required.
        needed: f64,
    },
    /// The wall doesn't match the profile.
    #[error(
        "the returns contradict the profile: half of them are more than {median_m:.2} m off, and {most_m} is allowed"
    )]
    Contradicted {
        /// Median of the absolute residuals, m.
        median_m: f64,
        /// Largest median allowed, m.
        most_m: f64,
    },
    /// The pressure varied too much for one level.
    #[error(
        "the vehicle wasn't at the surface all the time: the pressure went by {span_pa:.0} Pa, and {most_pa} is allowed"
    )]
    NotAtSurface {
        /// Its variation, Pa.
        span_pa: f64,
        /// Largest variation allowed, Pa.
        most_pa: f64,
    },
    /// The pressure was that under water.
    #[error(
        "the depth sensor was under water: the pressure was {mean_pa:.0} Pa, and air has {least_pa} to {most_pa}"
    )]
    UnderWater {
        /// The pressure, Pa.
        mean_pa: f64,
        /// Lowest air pressure, Pa.
        least_pa: f64,
        /// Highest air pressure, Pa.
        most_pa: f64,
    },
    /// The vehicle's chainage wasn't given.
    #[error("nobody has said where the vehicle stood: --chainage METRES does, the portal is 0")]
    NoChainage,
    /// The time at the surface wasn't given.
    #[error("nobody has said when the vehicle was at the surface: --at-surface FROM..TO does")]
    NoSurface,
    /// Shifting a source's timestamps changes nothing.
    #[error("the vehicle hardly turned or moved for it: it would be known to {sd_ms:.0} ms")]
    Flat {
        /// Remaining standard deviation, ms.
        sd_ms: f64,
    },
    /// The likelihood has no maximum within the search range.
    #[error("no offset within {reach_ms:.0} ms of the file's is best")]
    NoBest {
        /// Search range to either side, ms.
        reach_ms: f64,
    },
    /// The likelihood is still growing at the end of the search range.
    #[error(
        "it is later than the file's by {reach_ms:.0} ms or more: set latency_ms = {then_ms:.0}, and calibrate again"
    )]
    Later {
        /// Search range to either side, ms.
        reach_ms: f64,
        /// Latency at the end of the range, ms.
        then_ms: f64,
    },
    /// A device that answers before it is asked again can't be as late as that.
    #[error(
        "{found_ms:.0} ms would fit best, and it answers every {every_ms:.0} ms: it can't be as late; look for what delays its line, or \
         for what else is wrong"
    )]
    Slow {
        /// The likeliest latency, ms.
        found_ms: f64,
        /// Time between its answers, ms.
        every_ms: f64,
    },
    /// Ranges don't fit the design profile's size.
    #[error(
        "ranges are {long_pct:+.1} % long for this profile: sound_speed_mps = {sound_mps:.0} fits, or the file's wall is off by as much; \
         mend that first, other values can't be told till then"
    )]
    Scaled {
        /// By how much ranges are too long, %.
        long_pct: f64,
        /// Speed of sound with which they aren't, m/s.
        sound_mps: f64,
    },
    /// The filter disagrees with the measurements.
    #[error(
        "the filter leaves out {gated:.0} % of all measurements, and {most:.0} % are allowed: mounts, beams or the profile \
         of the vehicle file are off, or the vehicle turned too wildly"
    )]
    Disagrees {
        /// Share of measurements it gates, %.
        gated: f64,
        /// Largest share allowed, %.
        most: f64,
    },
    /// The filter never had an estimate.
    #[error(
        "the filter couldn't follow the vehicle: an inertial unit's attitude and ranges to the wall are needed"
    )]
    NoFilter,
}

/// Median of some numbers, which it sorts (the upper one of an even count); `None` without any.
pub(crate) fn median(values: &mut [f64]) -> Option<f64> {
    values.sort_unstable_by(f64::total_cmp);
    values.get(values.len() / 2).copied()
}
