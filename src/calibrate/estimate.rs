//! Estimated values, and the reasons why some values can't be estimated.

/// An estimated value, in the unit of its quantity.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Estimate {
    /// Estimated value.
    pub(crate) value: f64,
    /// Standard deviation of the estimated value.
    pub(crate) sd: f64,
}

impl Estimate {
    /// Whether the estimate differs from `other` by more than three standard deviations.
    ///
    /// Among many quantities, two standard deviations are often exceeded by chance.
    pub(crate) fn differs_from(&self, other: f64) -> bool {
        (self.value - other).abs() > 3.0 * self.sd
    }
}

/// Reason why a quantity can't be estimated from this log.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub(crate) enum NotEstimated {
    /// There are no readings of a required kind.
    #[error("the log has no readings of {what}")]
    Missing {
        /// Kind of readings that the log lacks.
        what: &'static str,
    },
    /// The vehicle never stood still for long enough.
    #[error(
        "the vehicle moved: {what} varied by {span:.2} {unit} (at most {limit} counts \
         as stationary); it was never stationary for {least_s} s"
    )]
    Moved {
        /// Quantity that varied most while the vehicle should have been at rest.
        what: &'static str,
        /// Largest minus smallest value of the quantity.
        span: f64,
        /// Unit of `span` and `limit`.
        unit: &'static str,
        /// Largest variation of the quantity at which the vehicle counts as stationary.
        limit: f64,
        /// Minimum time for which the vehicle must stand still, s.
        least_s: usize,
    },
    /// A head has turned less than once.
    #[error(
        "no full turn: the head turned by only {swept_deg:.0} degrees while the vehicle was stationary; 360 are \
         needed, so that it sees opposite walls; stand still {missing_s:.0} s longer"
    )]
    PartOfTurn {
        /// Angle by which the head has turned, degrees.
        swept_deg: f64,
        /// Time that the head still needs for the rest of the turn, whole seconds.
        missing_s: f64,
    },
    /// A head sweeps a sector to and fro, or doesn't turn.
    #[error(
        "no full turn: the head sweeps only {swept_deg:.0} degrees; 360 are needed, so that it sees opposite \
         walls; let it turn all the way round"
    )]
    OnlySector {
        /// Sector that the head sweeps, degrees.
        swept_deg: f64,
    },
    /// A head has seen too little of the wall.
    #[error(
        "too little wall: the head had returns from opposite walls over only {opposite_deg:.0} degrees of its \
         turn; at least {least_deg:.0} are needed"
    )]
    LittleWall {
        /// Total angle of the directions in which the head has seen wall, and has also seen wall in the opposite
        /// direction, degrees.
        opposite_deg: f64,
        /// Smallest value of `opposite_deg` that is enough for a calibration, degrees.
        least_deg: f64,
    },
    /// The cross-section looks the same at every angle of the head about its axis.
    #[error(
        "the section looks the same at every angle of the head about its axis (a circle doesn't determine \
         roll): the angle would have a standard deviation of {sd_deg:.1} degrees"
    )]
    Round {
        /// Standard deviation that an estimate of the head's angle would have, degrees.
        sd_deg: f64,
    },
    /// The offset of a single head can't be distinguished from the vehicle's position.
    #[error(
        "the offset of a single head can't be distinguished from the vehicle's position; at least two heads \
         are needed"
    )]
    OneHead,
    /// A head's offset can't be distinguished from a change of the vehicle's position or heading.
    #[error(
        "an offset can't be distinguished from another position or heading of the vehicle: it would have a \
         standard deviation of {sd_m:.3} m"
    )]
    LikePlace {
        /// Standard deviation that an estimate of the head's offset would have, m.
        sd_m: f64,
    },
    /// The head's returns fit the opposite sense of rotation nearly as well.
    #[error(
        "the opposite sense of rotation fits nearly as well (difference {margin:.0}, needed {needed:.0}): the \
         section is symmetric; put the vehicle well to one side of the centre, within range of the \
         echosounders"
    )]
    Mirror {
        /// Cost of the fit with the opposite sense minus the cost of the best fit, in squared standard
        /// deviations.
        margin: f64,
        /// Minimum difference in cost at which the sense of rotation is decided.
        needed: f64,
    },
    /// The heads' ranges to the wall contradict the design profile.
    #[error(
        "the returns contradict the profile: half of them deviate by more than {median_m:.2} m; at most \
         {most_m} m is allowed"
    )]
    Contradicted {
        /// Median of the absolute range residuals, m.
        median_m: f64,
        /// Largest allowed median of the absolute range residuals, m.
        most_m: f64,
    },
    /// The depth sensor's pressure varied too much for a vehicle that stays at the surface.
    #[error(
        "the vehicle wasn't at the surface all the time: the pressure varied by {span_pa:.0} Pa; at most \
         {most_pa} is allowed"
    )]
    NotAtSurface {
        /// Largest minus smallest pressure, Pa.
        span_pa: f64,
        /// Largest allowed variation of the pressure, Pa.
        most_pa: f64,
    },
    /// The pressure is too high for air: the sensor was under water.
    #[error(
        "the depth sensor was under water: the pressure was {mean_pa:.0} Pa; that of air is {least_pa} \
         to {most_pa}"
    )]
    UnderWater {
        /// Mean pressure measured, Pa.
        mean_pa: f64,
        /// Lowest plausible air pressure, Pa.
        least_pa: f64,
        /// Highest plausible air pressure, Pa.
        most_pa: f64,
    },
    /// The chainage of the vehicle is unknown.
    #[error("the vehicle's chainage is unknown; give --chainage METRES, counted from the portal")]
    NoChainage,
    /// The times between which the vehicle was at the surface are unknown.
    #[error("the time at the surface is unknown; give --at-surface FROM..TO")]
    NoSurface,
    /// The likelihood of the measurements hardly changes if the source's timestamps are shifted.
    #[error(
        "the vehicle hardly turned or moved: the latency would have a standard deviation of {sd_ms:.0} ms"
    )]
    Flat {
        /// Standard deviation that an estimate of the latency would have, ms.
        sd_ms: f64,
    },
    /// The likelihood has no maximum within the search range.
    #[error("no best fit was found within {reach_ms:.0} ms of the file's latency")]
    NoBest {
        /// Largest shift tried, earlier or later than the file's latency, ms.
        reach_ms: f64,
    },
    /// The likelihood still increases at the late end of the search range.
    #[error(
        "the latency exceeds the file's by {reach_ms:.0} ms or more; set latency_ms = {then_ms:.0}, and \
         calibrate again"
    )]
    Later {
        /// Largest shift tried, earlier or later than the file's latency, ms.
        reach_ms: f64,
        /// Latency at the late end of the search range, ms.
        then_ms: f64,
    },
    /// The device answers each request before the next one comes, so its latency can't be as long as the best fit says.
    #[error(
        "{found_ms:.0} ms fits best, but the device answers every {every_ms:.0} ms, so its latency is \
         shorter; look for a delay on its line, or another fault"
    )]
    Slow {
        /// Most likely latency, ms.
        found_ms: f64,
        /// Time between the device's answers, ms.
        every_ms: f64,
    },
    /// All ranges together are too long or too short for the size of the design profile.
    #[error(
        "ranges differ from this profile by {long_pct:+.1} %: set sound_speed_mps = {sound_mps:.0} \
         in the vehicle file, or correct the profile there; other values can be estimated only afterwards"
    )]
    Scaled {
        /// Relative excess of the ranges over those expected from the profile, %.
        long_pct: f64,
        /// Speed of sound at which the ranges have no excess, m/s.
        sound_mps: f64,
    },
    /// The navigation filter rejects too many measurements.
    #[error(
        "the filter rejects {gated:.0} % of all measurements; at most {most:.0} % are allowed: \
         mounts, beams or the profile of the vehicle file are wrong, or the vehicle turned too fast"
    )]
    Disagrees {
        /// Share of measurements that the navigation filter rejects at its gate, %.
        gated: f64,
        /// Largest allowed share of rejected measurements, %.
        most: f64,
    },
    /// The navigation filter never had an estimate of the vehicle's position.
    #[error(
        "the filter couldn't follow the vehicle; it needs an inertial unit's attitude and ranges to the wall"
    )]
    NoFilter,
}

/// Median of some numbers, which are sorted by this function; `None` if there are no numbers.
///
/// For an even count, the result is the larger of the two middle numbers.
pub(crate) fn median(values: &mut [f64]) -> Option<f64> {
    values.sort_unstable_by(f64::total_cmp);
    values.get(values.len() / 2).copied()
}
