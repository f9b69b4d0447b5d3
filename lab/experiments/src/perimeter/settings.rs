//! Inputs of the perimeter computation: pings, and the settings of the skeleton.

/// One ping: the head's angle, and the ranges at which its beam's rays hit the wall.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Ping {
    /// Angle of the head, radians, as defined in [`headrace_geometry::frames`]: 0 is down, 90 degrees to the left.
    pub angle_rad: f64,
    /// Range of every ray in the beam, m. A ray with a range of NaN or beyond the limit gives no echo.
    pub ranges_m: Vec<f64>,
}

/// Settings of the steps from echoes to skeleton.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub(crate) struct Settings {
    /// Range at the far end of the last echo bin, m.
    pub range_max_m: f64,
    /// Number of range bins of a ping's echo; 8 to 10,000.
    pub bins: usize,
    /// Length of a ray's echo along the range, m, centred on the wall.
    pub pulse_m: f64,
    /// Side of a pixel, m; at least a 4000th of twice the range.
    pub pixel_m: f64,
    /// Smallest strength of an echo that sets a pixel, as a share of the ping's strongest bin; above 0, at most 1.
    pub threshold: f64,
    /// Dilation before thinning, pixels, so that neighbouring echoes touch. The paper cleaned the image by hand.
    pub grow_px: usize,
}

impl Settings {
    /// Settings of Jorge et al. 2021 where the paper states them: 10 m, 500 points (§9.2). Pulse, pixel and threshold
    /// are chosen here.
    pub(crate) fn of_paper() -> Self {
        Self { range_max_m: 10.0, bins: 500, pulse_m: 0.05, pixel_m: 0.02, threshold: 0.5, grow_px: 2 }
    }
}
