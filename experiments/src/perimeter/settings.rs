//! What a perimeter is made from: pings, and how echoes become a skeleton.

/// One ping: the head's angle, and where its beam's rays met the wall.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Ping {
    /// Angle of the head in [`headrace_geometry::frames`]'s sense, radians: 0 down, 90 degrees to the left.
    pub angle_rad: f64,
    /// Range of every ray in the beam, m; rays that are no number or beyond range give no echo.
    pub ranges_m: Vec<f64>,
}

/// How echoes become a skeleton.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub(crate) struct Settings {
    /// Range of the last bin's end, m.
    pub range_max_m: f64,
    /// Bins of an echo; 8 to 10,000.
    pub bins: usize,
    /// Length of a ray's echo along the range, m, centred on the wall.
    pub pulse_m: f64,
    /// Side of a pixel, m; at least a 4000th of twice the range.
    pub pixel_m: f64,
    /// Echo from which a pixel is set, as a share of its ping's strongest bin; above 0, at most 1.
    pub threshold: f64,
    /// Pixels by which set ones grow before thinning, so that neighbouring echoes touch: the paper cleaned by hand.
    pub grow_px: usize,
}

impl Settings {
    /// The paper's where it states them: 10 m, 500 points (§9.2). Pulse, pixel and threshold are ours.
    pub(crate) fn of_paper() -> Self {
        Self { range_max_m: 10.0, bins: 500, pulse_m: 0.05, pixel_m: 0.02, threshold: 0.5, grow_px: 2 }
    }
}
