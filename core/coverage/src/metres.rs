//! Metres of tunnel by verdict.

use super::section::Verdict;

/// Metres of tunnel by verdict.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Metres {
    /// Metres that pass.
    pub pass_m: f64,
    /// Metres that fail.
    pub fail_m: f64,
    /// Metres undecided within the error of D.
    pub cannot_say_m: f64,
    /// Metres still open.
    pub open_m: f64,
    /// Of the open metres, those at the ends of the way that not all heads have passed: going on won't change them.
    pub not_inspected_m: f64,
}

impl Metres {
    /// Counts in a section.
    pub fn add(&mut self, verdict: Verdict, section_m: f64) {
        *match verdict {
            Verdict::Pass => &mut self.pass_m,
            Verdict::Fail => &mut self.fail_m,
            Verdict::CannotSay => &mut self.cannot_say_m,
            Verdict::Open => &mut self.open_m,
        } += section_m;
    }
}
