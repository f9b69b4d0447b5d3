//! Metres of tunnel by verdict.

use super::section::Verdict;

/// Metres of tunnel by verdict. Each metre is counted once.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Metres {
    /// Metres that pass.
    pub pass_m: f64,
    /// Metres that fail.
    pub fail_m: f64,
    /// Metres undecided within the error of D.
    pub cannot_say_m: f64,
    /// Metres that further driving may still fill.
    pub open_m: f64,
    /// Metres at the ends of the coverage extent that not all heads have passed.
    ///
    /// Further driving on the present course does not change them.
    pub not_inspected_m: f64,
}

impl Metres {
    /// Adds metres with a verdict.
    pub fn add(&mut self, verdict: Verdict, metres_m: f64) {
        *match verdict {
            Verdict::Pass => &mut self.pass_m,
            Verdict::Fail => &mut self.fail_m,
            Verdict::CannotSay => &mut self.cannot_say_m,
            Verdict::Open => &mut self.open_m,
        } += metres_m;
    }
}
