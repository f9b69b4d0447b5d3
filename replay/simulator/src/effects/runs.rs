//! Selects random pings, either singly or in runs of consecutive pings.

use headrace_config::{ConfigError, Section};

/// Largest allowed mean length of a run, pings.
const LONGEST_RUN: f64 = 10_000.0;

/// A Markov chain with two states: in a run, and not in a run.
///
/// Source: Gilbert, "Capacity of a burst-noise channel", Bell System Technical Journal 39, 1960.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Runs {
    share: f64,
    /// Probability that a run begins with the next ping, if the previous ping is in no run.
    begin: f64,
    /// Probability that a run continues with the next ping.
    go_on: f64,
}

impl Runs {
    /// Creates the chain in which runs of mean length `mean` contain the share `share` of the pings.
    pub(super) fn new(share: f64, mean: f64) -> Self {
        Self { share, begin: share / (mean * (1.0 - share)), go_on: 1.0 - 1.0 / mean }
    }

    /// Reads `share` and `mean_run`; `None` for a share of zero, which is the default.
    ///
    /// Errors: a value is out of range, or the mean is too small for the share.
    pub(super) fn read(table: &Section<'_>) -> Result<Option<Self>, ConfigError> {
        let share = table.number("share", 0.0..=0.95)?.unwrap_or(0.0);
        let mean = table.number("mean_run", 1.0..=LONGEST_RUN)?;
        if share == 0.0 {
            return match mean {
                Some(_) => Err(table.invalid("mean_run", "has an effect only with a share above zero")),
                None => Ok(None),
            };
        }
        let least = share / (1.0 - share);
        if mean.is_some_and(|mean| mean < least) {
            let problem =
                format!("must be at least {least:.2}: shorter runs cannot make up a share of {share}");
            return Err(table.invalid("mean_run", &problem));
        }
        Ok(Some(Self::new(share, mean.unwrap_or(1.0 / (1.0 - share)))))
    }

    /// Whether the next ping is in a run. `before` tells whether the previous ping was in a run; `chance` is a random
    /// number between 0 and 1.
    ///
    /// The first ping is in a run with a probability equal to the share of pings in runs.
    pub(super) fn next(&self, before: Option<bool>, chance: f64) -> bool {
        let in_run = match before {
            None => self.share,
            Some(false) => self.begin,
            Some(true) => self.go_on,
        };
        chance < in_run
    }

    /// Correlation between the states of consecutive pings. The state is 1 in a run and 0 otherwise.
    #[cfg(test)]
    pub(super) fn correlation(&self) -> f64 {
        self.go_on - self.begin
    }
}
