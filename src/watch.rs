//! Terminal output during a dive: position, advised speed, and each missed stretch once.

use headrace_coverage::{Run, RunChange, RunId, Section, Sections, Verdict};
use headrace_geometry::time::{DurNs, MonoNs};
use headrace_monitor::advice_log::AdviceEntry;
use headrace_monitor::messages::Notice;
use headrace_monitor::pilot_text::{
    Missed, advice_text, alert_text, cleared_text, flag_text, setting_text, station,
};
use headrace_monitor::run::Loop;
use headrace_ports::{Phase, Status};
use headrace_vehicle::Mission;

use crate::output::{put, say};
use crate::terminal::{self, Terminal};
use crate::transient;

/// Interval of state lines where they can't be overwritten, in the dive's time.
const LINE_EVERY: DurNs = DurNs(10_000_000_000);
/// Interval of lines with the way and its metres by verdict, in the dive's time.
const WAY_EVERY: DurNs = DurNs(60_000_000_000);
/// Interval of state lines that are overwritten, in the dive's time.
const REFRESH_EVERY: DurNs = DurNs(1_000_000_000);

/// Shows a dive on stdout, unless quiet.
pub(crate) struct Watch {
    quiet: bool,
    terminal: Terminal,
    shown: Option<MonoNs>,
    way_shown: Option<MonoNs>,
    status_open: bool,
    /// The run that was flagged last, until its end is shown.
    run: Option<RunId>,
    /// The latest advised speed, m/s; zero if none.
    v_max_mps: f64,
}

impl Watch {
    /// Shows the dive.
    pub(crate) fn loud() -> Self {
        Self {
            quiet: terminal::is_quiet(),
            terminal: terminal::of(&std::io::stdout()),
            shown: None,
            way_shown: None,
            status_open: false,
            run: None,
            v_max_mps: 0.0,
        }
    }

    /// Shows no output.
    pub(crate) fn quiet() -> Self {
        Self { quiet: true, ..Self::loud() }
    }

    /// Shows no output if it is JSON.
    pub(crate) fn unless(json: bool) -> Self {
        if json { Self::quiet() } else { Self::loud() }
    }

    /// Whether nothing is shown.
    pub(crate) fn is_quiet(&self) -> bool {
        self.quiet
    }

    /// Shows a result of the loop.
    pub(crate) fn notice(&mut self, notice: &Notice, dive: &Loop) {
        if self.quiet {
            return;
        }
        match notice {
            Notice::Advice(entry) => {
                self.way(entry.at, dive);
                self.status(entry, dive.mission());
            }
            Notice::Section { section, .. } => self.section(*section, sections(dive)),
            Notice::Run { id, change, .. } => self.run(*id, *change, dive),
            Notice::Alert(kind, source) => {
                if let Some(alert) = dive.alerts().get(*kind, *source) {
                    let name = |source: u16| {
                        dive.sources()
                            .get(usize::from(source))
                            .map_or_else(String::new, |info| info.id.clone())
                    };
                    let head = source.map_or_else(String::new, |source| name(source.0));
                    let text = match &alert.setting {
                        Some(doubt) => setting_text(doubt, alert.x_m, &name),
                        None => alert_text(alert.kind, &head, alert.x_m, alert.worst_m),
                    };
                    self.line(&format!("ALERT    {text}"));
                }
            }
        }
    }

    /// Shows a change of a sensor's state.
    pub(crate) fn sensor(&mut self, id: &str, status: &Status) {
        if !self.quiet {
            let amber = (status.phase != Phase::Running).then_some("\x1b[33m");
            self.coloured(&format!("SENSOR   {id:<12} {status}"), amber);
        }
    }

    /// Shows that a replay has paused, jumped or ended at `time` after its beginning.
    pub(crate) fn stopped(&mut self, dive: &Loop, time: DurNs, ended: bool) {
        (self.shown, self.way_shown, self.run) = (None, None, None);
        if !self.quiet {
            let seconds = time.as_secs_f64();
            let (h, min, s) = (seconds / 3600.0, seconds / 60.0 % 60.0, seconds % 60.0);
            let end = if ended { "  (end)" } else { "" };
            let tally = dive.tally();
            self.line(&format!(
                "AT       {}:{:02}:{s:06.3}{end}: tick {}, {} samples, digest {:016x}",
                h.floor(),
                min.floor(),
                dive.ticks(),
                tally.samples,
                dive.digest()
            ));
        }
    }

    /// Ends the output of a dive.
    pub(crate) fn end(&mut self, dive: &Loop) {
        self.close_run(sections(dive));
        self.close_status();
    }

    fn status(&mut self, entry: &AdviceEntry, mission: &Mission) {
        self.v_max_mps = entry.advice.v_max_mps;
        let every = if self.terminal.overwrites { REFRESH_EVERY } else { LINE_EVERY };
        if self.shown.is_some_and(|shown| entry.at.since(shown).0 < every.0) {
            return;
        }
        self.shown = Some(entry.at);
        let place =
            entry.chainage_m.map_or_else(|| "no position".to_owned(), |x| format!("ch {}", station(x)));
        let line = format!(
            "{place:<14} {:5.2} m/s   {}",
            entry.speed_mps,
            advice_text(&entry.into(), &mission.profile)
        );
        if self.terminal.overwrites {
            let advice = &entry.advice;
            let wrong = advice.will_exceed || advice.predicted_t_m.is_none();
            let colour = if wrong { "\x1b[33m" } else { "\x1b[32m" };
            let line = if self.terminal.colour { format!("{colour}{line}\x1b[0m") } else { line };
            put(&format!("{}{line}", terminal::CLEAR));
            transient::shown();
            self.status_open = true;
        } else {
            say(&line);
        }
    }

    /// Shows the way so far and its metres by verdict.
    fn way(&mut self, at: MonoNs, dive: &Loop) {
        // Counted from the first beat, as there is nothing to show then.
        let since = *self.way_shown.get_or_insert(at);
        let (sections, way) = (sections(dive), dive.coverage().frontier.way());
        let range = sections.sections_of(way);
        if at.since(since).0.abs() < WAY_EVERY.0 || range.is_empty() {
            return;
        }
        self.way_shown = Some(at);
        let metres = sections.metres(way);
        let (from_m, to_m) = (sections.bounds_m(range.start).0, sections.bounds_m(range.end).0);
        self.line(&format!(
            "WAY      ch {} to {}: passed {:.2} m   failed {:.2} m   can't say {:.2} m   open {:.2} m",
            station(from_m),
            station(to_m),
            metres.pass_m,
            metres.fail_m,
            metres.cannot_say_m,
            metres.open_m
        ));
    }

    /// Shows the end of the run flagged last at a neighbouring section that doesn't fail.
    fn section(&mut self, section: i64, sections: &Sections) {
        // An open section may still join the run.
        let other = |section: &Section| !section.is_flagged() && section.verdict != Verdict::Open;
        let ends = sections.get(section).is_some_and(other);
        let run = self.run.and_then(|id| sections.runs().get(id));
        if ends && run.is_some_and(|run| section == run.to || section == run.from - 1) {
            self.close_run(sections);
        }
    }

    fn run(&mut self, id: RunId, change: RunChange, dive: &Loop) {
        let sections = sections(dive);
        let Some(run) = sections.runs().get(id) else { return };
        match change {
            RunChange::Raised => {
                self.close_run(sections);
                self.run = Some(id);
                self.flag(run, dive);
            }
            RunChange::Cleared => {
                // Sections whose cause has changed belong to another run, which is shown.
                if !(run.from..run.to).filter_map(|index| sections.get(index)).any(Section::is_flagged) {
                    let (from_m, to_m) = (sections.bounds_m(run.from).0, sections.bounds_m(run.to - 1).1);
                    self.line(&cleared_text(from_m, to_m));
                }
            }
            RunChange::Changed | RunChange::Merged => {}
        }
    }

    fn flag(&mut self, run: &Run, dive: &Loop) {
        let sections = sections(dive);
        let Some(evidence) = sections.get(run.worst.0).and_then(|section| section.evidence) else { return };
        let missed = Missed {
            start_m: sections.bounds_m(run.from).0,
            figures: (&evidence).into(),
            hole_arc_m: run.worst.1.arc_m,
            target_m: sections.target_m(),
            v_max_mps: self.v_max_mps,
        };
        self.line(&format!("FLAG     {}", flag_text(&missed, &dive.mission().profile)));
    }

    /// Shows the bounds of the run flagged last.
    fn close_run(&mut self, sections: &Sections) {
        let Some(run) = self.run.take().and_then(|id| sections.runs().get(id)) else { return };
        let (from_m, to_m) = (sections.bounds_m(run.from).0, sections.bounds_m(run.to - 1).1);
        self.line(&format!("   ...   ch {} to {}", station(from_m), station(to_m)));
    }

    fn line(&mut self, text: &str) {
        let red = (text.starts_with("FLAG") || text.starts_with("ALERT")).then_some("\x1b[1;31m");
        self.coloured(text, red);
    }

    fn coloured(&mut self, text: &str, colour: Option<&str>) {
        self.close_status();
        match colour.filter(|_| self.terminal.colour) {
            Some(colour) => say(&format!("{colour}{text}\x1b[0m")),
            None => say(text),
        }
    }

    fn close_status(&mut self) {
        if self.status_open {
            // A log message has already cleared it.
            if transient::take() {
                say("");
            }
            self.status_open = false;
        }
    }
}

fn sections(dive: &Loop) -> &Sections {
    &dive.coverage().sections
}
