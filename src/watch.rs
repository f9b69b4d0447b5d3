//! What a person sees on the terminal while a dive runs: where the vehicle is, how fast it may go, and each missed
//! stretch, once.

use std::io::{IsTerminal, Write};

use headrace_core::app::flow::{AdviceEntry, Coverage, Notice};
use headrace_core::app::run::Loop;
use headrace_core::coverage::{Cause, Evidence, Judgement};
use headrace_core::sampling::advice::Reason;
use headrace_core::time::{DurNs, MonoNs};

use crate::station::station;

/// How often the state is shown where lines can't be overwritten, in the dive's own time.
const LINE_EVERY: DurNs = DurNs(10_000_000_000);
/// How often where they can.
const REFRESH_EVERY: DurNs = DurNs(1_000_000_000);

/// Shows a dive on stdout, or nothing when it is quiet.
pub(crate) struct Watch {
    quiet: bool,
    terminal: bool,
    shown: Option<MonoNs>,
    status_open: bool,
    run: Option<Run>,
    /// The speed advised last, m/s.
    v_max_mps: f64,
}

/// Neighbouring flagged sections with one cause.
struct Run {
    to: i64,
    end_m: f64,
    evidence: Evidence,
}

impl Watch {
    /// Shows what happens.
    pub(crate) fn loud() -> Self {
        Self {
            quiet: false,
            terminal: std::io::stdout().is_terminal(),
            shown: None,
            status_open: false,
            run: None,
            v_max_mps: 0.0,
        }
    }

    /// Shows nothing.
    pub(crate) fn quiet() -> Self {
        Self { quiet: true, ..Self::loud() }
    }

    /// Whether nothing is shown.
    pub(crate) fn is_quiet(&self) -> bool {
        self.quiet
    }

    /// Takes a result of the loop.
    pub(crate) fn notice(&mut self, notice: &Notice, dive: &Loop) {
        if self.quiet {
            return;
        }
        match notice {
            Notice::Advice(entry) => self.status(entry, dive.mission().target_m),
            Notice::Section { section, at, change } => self.section(*section, *at, *change, dive),
        }
    }

    /// The dive has ended.
    pub(crate) fn end(&mut self) {
        self.close_run();
        self.close_status();
    }

    fn status(&mut self, entry: &AdviceEntry, target_m: f64) {
        self.v_max_mps = entry.advice.v_max_mps;
        let every = if self.terminal { REFRESH_EVERY } else { LINE_EVERY };
        if self.shown.is_some_and(|shown| entry.at.since(shown).0 < every.0) {
            return;
        }
        self.shown = Some(entry.at);
        let place =
            entry.chainage_m.map_or_else(|| "no position".to_owned(), |x| format!("ch {}", station(x)));
        let line = format!("{place:<14} {:5.2} m/s   {}", entry.speed_mps, advice_words(entry, target_m));
        if self.terminal {
            let colour = if too_fast(entry) || entry.advice.predicted_t_m.is_none_or(|t_m| t_m > target_m) {
                "\x1b[33m"
            } else {
                "\x1b[32m"
            };
            print!("\r\x1b[K{colour}{line}\x1b[0m");
            self.status_open = true;
        } else {
            println!("{line}");
        }
        self.flush();
    }

    fn section(&mut self, section: i64, at: MonoNs, change: Judgement, dive: &Loop) {
        let sections = &dive.world().resource::<Coverage>().sections;
        let start_m = sections.bounds_m(section).0;
        match change {
            Judgement::Updated => {
                if self.run.as_ref().is_some_and(|run| section == run.to + 1) {
                    self.close_run();
                }
            }
            Judgement::Cleared => {
                self.close_run();
                self.line(&format!("cleared  ch {}", station(start_m)));
            }
            Judgement::Raised => {
                let Some(evidence) = sections.get(section).and_then(|section| section.evidence) else {
                    return;
                };
                if let Some(run) = &mut self.run
                    && run.evidence.cause == evidence.cause
                    && section == run.to + 1
                {
                    run.to = section;
                    run.end_m = sections.bounds_m(section).1;
                    return;
                }
                self.close_run();
                let clock = sections
                    .get(section)
                    .and_then(|section| section.hole)
                    .map_or_else(String::new, |hole| dive.mission().profile.clock(hole.sigma_m));
                self.line(&format!(
                    "FLAG     ch {}  {}: holes over {} m at {clock} o'clock; {}",
                    station(start_m),
                    cause_words(&evidence),
                    sections.target_m(),
                    self.what_to_do(&evidence, start_m),
                ));
                tracing::debug!(flagged_s = at.as_secs_f64(), section, "flag");
                self.run = Some(Run { to: section, end_m: sections.bounds_m(section).1, evidence });
            }
        }
    }

    /// What a pilot does about a missed stretch, with the speed that is advised now.
    fn what_to_do(&self, evidence: &Evidence, start_m: f64) -> String {
        match evidence.cause {
            Cause::AngularStep => "slower won't help, a finer mode will".to_owned(),
            Cause::NotPassed => "pass it again from end to end".to_owned(),
            Cause::OutOfRange => "set a longer range".to_owned(),
            _ if self.v_max_mps > 0.0 => {
                format!("go back to {}, then at most {:.2} m/s", station(start_m), self.v_max_mps)
            }
            _ => format!("go back to {}", station(start_m)),
        }
    }

    fn close_run(&mut self) {
        if let Some(run) = self.run.take() {
            self.line(&format!("         ... to ch {}", station(run.end_m)));
        }
    }

    fn line(&mut self, text: &str) {
        self.close_status();
        let colour =
            if self.terminal && text.starts_with("FLAG") { ("\x1b[1;31m", "\x1b[0m") } else { ("", "") };
        println!("{}{text}{}", colour.0, colour.1);
    }

    fn close_status(&mut self) {
        if self.status_open {
            println!();
            self.status_open = false;
        }
    }

    fn flush(&self) {
        if let Err(error) = std::io::stdout().flush() {
            tracing::debug!(%error, "the terminal takes no more");
        }
    }
}

fn too_fast(entry: &AdviceEntry) -> bool {
    entry.speed_mps.abs() > entry.advice.v_max_mps
}

fn advice_words(entry: &AdviceEntry, target_m: f64) -> String {
    let advice = &entry.advice;
    match advice.reason {
        Reason::HelixPitch if too_fast(entry) => format!("TOO FAST: at most {:.2} m/s", advice.v_max_mps),
        Reason::HelixPitch if advice.predicted_t_m.is_some_and(|t_m| t_m > target_m) => {
            format!("OUT OF PHASE at this speed: go {:.2} m/s", advice.v_max_mps)
        }
        Reason::HelixPitch => format!("may go {:.2} m/s (distance between turns)", advice.v_max_mps),
        Reason::AngularStep => {
            format!("slower won't help: steps of {:.2} m along the wall; finer mode needed", advice.t_y_m)
        }
        Reason::NoHeadingOrFix => "no speed can be given: no position or heading".to_owned(),
        Reason::NoReturns => "no speed can be given: no sonar returns".to_owned(),
    }
}

/// A cause in a pilot's words.
pub(crate) fn cause_words(evidence: &Evidence) -> String {
    match evidence.cause {
        Cause::TooFast => format!("too fast ({:.2} m/s)", evidence.speed_mps),
        Cause::AngularStep => format!("steps of {:.2} m along the wall", evidence.t_y_m),
        Cause::MissingReturns => format!("{:.0} % of returns missing", evidence.missing_share * 100.0),
        Cause::OutOfRange => "wall out of range".to_owned(),
        Cause::Phase => format!("heads out of phase ({:.2} m/s)", evidence.speed_mps),
        Cause::PositionLost => "position lost".to_owned(),
        Cause::NotPassed => "not passed on both sides".to_owned(),
    }
}
