//! Results of the estimators.

use headrace_calibration::Untold;
use headrace_calibration::heads::Heads;
use headrace_calibration::timing::Lag;
use headrace_calibration::zero::Zero;

/// What each estimator said.
pub(super) struct Findings {
    pub(super) heads: Result<Heads, Untold>,
    pub(super) surface: Result<Zero, Untold>,
    pub(super) level: Result<Zero, Untold>,
    /// With what the file says.
    pub(super) tethers: Result<Vec<(Zero, f64)>, Untold>,
    pub(super) lags: Result<Vec<Lag>, Untold>,
}
