//! What a person sees on the terminal while a dive runs: where the vehicle is, how fast it may go, and each missed
//! stretch, once.

use std::io::{IsTerminal, Write};

use headrace_core::app::flow::{AdviceEntry, Coverage, Notice};
use headrace_core::app::run::Loop;
use headrace_core::coverage::{Evidence, Judgement};
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
}

/// Neighbouring flagged sections with one cause.
struct Run {
    from: i64,
    to: i64,
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
        }
    }

    /// Shows nothing.
    pub(crate) fn quiet() -> Self {
        Self { quiet: true, ..Self::loud() }
    }

    /// Takes a result of the loop.
    pub(crate) fn notice(&mut self, notice: &Notice, dive: &Loop) {
        if self.quiet {
            return;
        }
        match notice {
            Notice::Advice(entry) => self.status(entry),
            Notice::Section { section, at, change } => self.section(*section, *at, *change, dive),
        }
    }

    /// The dive has ended.
    pub(crate) fn end(&mut self) {
        self.close_run();
        self.close_status();
    }

    fn status(&mut self, entry: &AdviceEntry) {
        let every = if self.terminal { REFRESH_EVERY } else { LINE_EVERY };
        if self.shown.is_some_and(|shown| entry.at.since(shown).0 < every.0) {
            return;
        }
        self.shown = Some(entry.at);
        let place =
            entry.chainage_m.map_or_else(|| "no position".to_owned(), |x| format!("ch {}", station(x)));
        let line = format!("{place:<14} {:5.2} m/s   {}", entry.speed_mps, advice_words(entry));
        if self.terminal {
            let colour = if too_fast(entry) { "\x1b[33m" } else { "\x1b[32m" };
            print!("\r\x1b[K{colour}{line}\x1b[0m");
            self.status_open = true;
        } else {
            print!("{line}\n");
        }
        self.flush();
    }

    fn section(&mut self, section: i64, at: MonoNs, change: Judgement, dive: &Loop) {
        let coverage = dive.world().resource::<Coverage>();
        let section_m = coverage.sections.section_m();
        match change {
            Judgement::Updated => {}
            Judgement::Cleared => {
                self.close_run();
                self.line(&format!("cleared  ch {}", station(section as f64 * section_m)));
            }
            Judgement::Raised => {
                let found = coverage.sections.get(section).and_then(|section| section.evidence);
                let Some(evidence) = found else { return };
                if let Some(run) = &mut self.run
                    && run.evidence.cause == evidence.cause
                    && section == run.to + 1
                {
                    run.to = section;
                    return;
                }
                self.close_run();
                let start_m = section as f64 * section_m;
                let clock = coverage.sections.get(section).and_then(|section| section.hole).map_or_else(
                    String::new,
                    |hole| {
                        format!(
                            ", hole {:.2} m at {} o'clock",
                            hole.diameter_m,
                            dive.mission().profile.clock(hole.sigma_m)
                        )
                    },
                );
                self.line(&format!(
                    "FLAG     ch {}  {}{clock}; {}   [{:.1} s]",
                    station(start_m),
                    cause_words(&evidence),
                    what_to_do(&evidence, start_m),
                    at.as_secs_f64(),
                ));
                self.run = Some(Run { from: section, to: section, evidence });
            }
        }
    }

    fn close_run(&mut self) {
        if let Some(run) = self.run.take()
            && run.to > run.from
        {
            self.line(&format!("         ... {} sections in a row", run.to - run.from + 1));
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

fn advice_words(entry: &AdviceEntry) -> String {
    let advice = &entry.advice;
    match advice.reason {
        Reason::HelixPitch if too_fast(entry) => format!("TOO FAST: at most {:.2} m/s", advice.v_max_mps),
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
    use headrace_core::coverage::Cause;
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

fn what_to_do(evidence: &Evidence, start_m: f64) -> String {
    use headrace_core::coverage::Cause;
    match evidence.cause {
        Cause::TooFast if evidence.v_max_mps > 0.0 => {
            format!("go back to {}, then at most {:.2} m/s", station(start_m), evidence.v_max_mps)
        }
        Cause::AngularStep => "a finer mode is needed".to_owned(),
        Cause::NotPassed => "begin further out".to_owned(),
        _ => format!("go back to {}", station(start_m)),
    }
}
